//! Tests that docs/reference/json.md contains every key that a verb prints with `--json`, and that
//! every key in its tables is printed.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::cli::{json, noctograph};

/// Headings of verbs, each with its commands. A command may read files that earlier commands wrote.
const COMMANDS: [(&str, &str); 16] = [
    ("plan", "plan I --style even"),
    ("plan", "plan --drawing line.svg -o line.csv"),
    ("fly", "fly plan.csv"),
    ("expose", "expose flight.csv --word I --backend cpu --size 320x180"),
    ("read", "read photo.png"),
    ("check", "check I --room 4x3x2.5"),
    ("meter", "meter --flight flight.csv --word I"),
    ("coverage", "coverage I --step 0.3"),
    ("coverage", "coverage --scene two-drones-three-anchors -o c.svg"),
    ("export", "export I --to cflib"),
    ("import", "import flight.csv -o b.csv"),
    ("compare", "compare flight.csv b.csv -o plots"),
    ("compare-photo", "compare-photo photo.png photo.png"),
    ("identify", "identify flight.csv --scene team"),
    ("gains", "gains --scene team"),
    ("rank", "rank team pid --words I:2 --acuity 1"),
];

/// Collects all keys of a value at any depth.
fn keys(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            found.extend(object.keys().cloned());
            object.values().for_each(|value| keys(value, found));
        }
        Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

/// Returns the texts between backquotes.
fn quoted(text: &str) -> BTreeSet<String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Returns the keys in the first column of a section's tables.
fn of_tables(section: &str) -> BTreeSet<String> {
    let rows = section.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.flat_map(|row| quoted(&format!("`{}", row.split(" | ").next().unwrap()))).collect()
}

#[test]
fn every_key_of_json_is_documented_and_every_documented_one_is_printed() {
    let page = include_str!("../../docs/reference/json.md");
    let section = |title: &str| {
        let (_, rest) = page.split_once(&format!("\n## {title}\n")).unwrap();
        rest.split("\n## ").next().unwrap()
    };
    let shared = quoted(section("Shared objects"));
    let folder = tempfile::tempdir().unwrap();
    let (mut wrong, mut printed) = (Vec::new(), std::collections::BTreeMap::new());
    let line = r#"<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0L9 9" stroke="red"/></svg>"#;
    std::fs::write(folder.path().join("line.svg"), line).unwrap();
    for (verb, command) in COMMANDS {
        let mut run = noctograph(folder.path());
        let output = run.args(command.split(' ')).arg("--json").output().unwrap();
        assert!(output.status.code() < Some(2), "{command}: {output:?}");
        let value = json(&output.stdout);
        let mut all = BTreeSet::new();
        keys(&value, &mut all);
        let documented = quoted(section(verb));
        let unknown = all.iter().filter(|key| !documented.contains(*key) && !shared.contains(*key));
        wrong
            .extend(unknown.map(|key| format!("{verb}: `{key}` is not in docs/reference/json.md")));
        let top = value.as_object().unwrap().keys().cloned();
        printed.entry(verb).or_insert_with(BTreeSet::new).extend(top);
    }
    for (verb, printed) in printed {
        let never = of_tables(section(verb)).into_iter().filter(|key| !printed.contains(key));
        wrong.extend(never.map(|key| format!("{verb}: `{key}` is not printed")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns the checks in the first column of the table of limits in `docs/reference/json.md`.
fn documented_checks() -> BTreeSet<String> {
    let page = include_str!("../../docs/reference/json.md");
    let (_, table) = page.split_once("| check | value | limit |\n|---|---|---|\n").unwrap();
    let rows = table.lines().map_while(|line| line.strip_prefix("| "));
    rows.flat_map(|row| row.split(" | ").next().unwrap().split(", ").map(str::to_owned)).collect()
}

#[test]
fn every_check_is_documented_and_every_documented_one_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let mut made = BTreeSet::new();
    let commands = [
        "check I --room 4x3x2.5 --scene team",
        "check IO --drones 2 --room 9x9x7",
        "check I --scene bzzz --set observer.kind=truth --set air.wind_m_s=[3,0,0]",
        "check I --set sensors.lighthouse.people_m=[[0,0,0.2]] --profile outdoor",
    ];
    for command in commands {
        let output = noctograph(folder.path()).args(command.split(' ')).arg("--json").output();
        let output = output.unwrap();
        let found = json(&output.stdout);
        let findings = found["findings"].as_array().unwrap_or_else(|| panic!("{output:?}"));
        made.extend(findings.iter().map(|finding| finding["check"].as_str().unwrap().to_owned()));
    }
    // This check appears only if a drone is lost, which depends on the tuning.
    made.insert("flight".to_owned());
    // This check appears only if a file places the base stations side by side.
    made.insert("baseline".to_owned());
    assert_eq!(made, documented_checks());
}
