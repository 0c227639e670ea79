//! Tests of `plan` and `check` on the command line.

use std::path::Path;

use noctograph::letters::{LetterOptions, write};
use noctograph::plan::{PlanOptions, infer_lights, plan};
use noctograph::sim::{Drone, SimOptions, fly};
use predicates::str::contains;

use crate::cli::{noctograph, run_json};

#[test]
fn the_papers_letters_are_flagged_and_may_fly() {
    let report = run_json(Path::new("."), &["check", "WX", "--scene", "team"]);
    assert_eq!(report["fly"], true);
    let findings = report["findings"].as_array().unwrap();
    let found = |check: &str| {
        let finding = findings.iter().find(|finding| finding["check"] == check).unwrap();
        (finding["severity"].as_str().unwrap(), finding["found"].as_str().unwrap())
    };
    assert_eq!(found("doubled stroke"), ("warning", "W (0.51 m)"));
    assert_eq!(found("light never off"), ("warning", "X"));
    assert_eq!(found("lit transit").0, "warning", "the team's lights are on the wrong clock");
    assert_eq!(found("speed").0, "fine");
    for finding in findings.iter().filter(|finding| finding["severity"] != "fine") {
        assert_ne!(finding["change"], "", "{finding}");
    }
    let page = include_str!("../../docs/reference/json.md");
    for finding in findings {
        let name = finding["check"].as_str().unwrap();
        let is_there = |line: &str| line.starts_with("| ") && line.contains(name);
        assert!(page.lines().any(is_there), "docs/reference/json.md says what {name} measures");
    }
}

#[test]
fn a_plan_that_outlasts_the_battery_is_named_before_it_is_flown() {
    let folder = tempfile::tempdir().unwrap();
    for (charge_frac, warned) in [("1", false), ("0.1", true)] {
        let charge = format!("battery.charge_frac={charge_frac}");
        let command = ["plan", "HELLO", "--set", &charge, "-o", "plan.csv"];
        let assert = noctograph(folder.path()).args(command).assert().success();
        let stderr =
            String::from_utf8_lossy(&assert.get_output().stderr).replace("\n         ", " ");
        let is_named = stderr.contains("but the battery can hover for only");
        assert_eq!(is_named, warned, "{stderr}");
    }
}

#[test]
fn an_even_noor_passes_and_a_typed_speed_is_too_fast_for_the_careful() {
    let report = run_json(Path::new("."), &["check", "NOOR", "--style", "even"]);
    let findings = report["findings"].as_array().unwrap();
    for check in ["lit dwell", "evenness", "tilt", "acceleration", "jump"] {
        let finding = findings.iter().find(|finding| finding["check"] == check).unwrap();
        assert_eq!(finding["severity"], "fine", "{finding}");
    }
    let row = |check: &str| {
        let finding = findings.iter().find(|finding| finding["check"] == check).unwrap();
        (finding["severity"].clone(), finding["found"].as_str().unwrap().to_owned())
    };
    let (severity, memory) = row("memory");
    assert_eq!(severity, "fine");
    assert!(memory.contains(" of 4096 bytes compressed; "), "{memory}");
    assert!(memory.contains(" of 31 pieces as poly4d; the plan can be exported as "), "{memory}");
    assert_eq!(row("LED memory"), ("fine".into(), "not used".to_owned()));
    assert_eq!(row("lit transit").0, "fine", "{:?}", row("lit transit"));
    let long = run_json(Path::new("."), &["check", "ABCDEFGHIJKLMNOPQRSTUVWXYZ"]);
    let memory = long["findings"].as_array().unwrap().iter().find(|f| f["check"] == "memory");
    let found = memory.unwrap()["found"].as_str().unwrap();
    assert!(found.contains("pieces as poly4d, too many"), "pieces bind before bytes: {found}");
    let careful = ["check", "NOOR", "--style", "even", "--profile", "careful"];
    noctograph(Path::new(".")).args(careful).assert().code(0);
    let fast = ["--set", "plan.style.dark_speed_m_s=1"];
    let assert = noctograph(Path::new(".")).args(careful).args(fast).assert();
    assert.code(1).stdout(contains("STOP  speed"));
    noctograph(Path::new(".")).args(["check", "NOOR", "--profile", "brave"]).assert().code(2);
}

#[test]
fn drones_share_a_word_into_a_folder_and_their_plans_are_checked_together() {
    let folder = tempfile::tempdir().unwrap();
    let shared = folder.path().join("shared");
    let at = |name: &str| shared.join(name);
    let args = ["plan", "NO", "--scene", "team", "--style", "even", "--drones", "2", "-o"];
    let report = run_json(folder.path(), &[&args[..], &["shared"]].concat());
    assert_eq!(report["drones"].as_array().unwrap().len(), 2);
    assert!(report["drones"][0]["worst_streak_mm"].as_f64().unwrap() < 10.0, "{report}");
    let drawing = folder.path().join("both.svg");
    noctograph(folder.path()).args(args).arg(&drawing).assert().code(0);
    assert!(drawing.exists(), "a drawing of both");
    let both = || {
        let mut command = noctograph(folder.path());
        command.arg("check").arg(at("plan-1.csv"));
        command
    };
    both().arg(at("plan-2.csv")).assert().code(0).stdout(contains("m or more apart sideways"));
    both().arg(at("plan-1.csv")).assert().code(1).stdout(contains("STOP  separation"));
    let team = ["plan", "NO", "--style", "team", "--drones", "2", "-o"];
    noctograph(folder.path()).args(team).arg("team").assert().code(2);
}

#[test]
fn a_plan_is_drawn_where_its_name_ends_in_svg() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("noor.svg");
    noctograph(folder.path())
        .args(["plan", "NOOR", "--style", "even", "-o", "noor.svg"])
        .assert()
        .code(0);
    let svg = std::fs::read_to_string(Path::new(&path)).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("NOOR, planned: "), "{}", &svg[..200]);
}

#[test]
fn a_plan_from_elsewhere_has_a_verdict_though_its_scene_cannot_be_planned() {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["plan", "I", "-o", "plan.csv"]).assert().success();
    // The style `team` supports only one drone.
    let scene = ["--word", "QUIZ", "--style", "team", "--drones", "2", "--size", "320x180"];
    let mut preview = noctograph(folder.path());
    let preview = preview.args(["preview", "plan.csv", "--backend", "cpu"]).args(scene).assert();
    preview.code(1).stdout(contains("QUIZ reads as ????: NOT legible"));
}

#[test]
fn letters_and_lights_are_recovered_from_setpoints() {
    for word in ["NOOR", "WAX", "QUIZ"] {
        let strokes = write(word, &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let flown = fly(&plan, &Drone::new(&SimOptions::default(), 0), &mut |_| {}).unwrap();
        let mut bare = flown.clone();
        bare.edit(|bare| {
            bare.lights.clear();
            bare.samples.iter_mut().for_each(|sample| sample.letter = None);
        });
        infer_lights(&mut bare, &strokes).unwrap();
        let pairs = flown.lights["headlights"].iter().zip(&bare.lights["headlights"]);
        let wrong = pairs.filter(|(a, b)| a != b).count();
        // At a corner where the light switches off, the setpoint is briefly on both moves.
        let share = wrong as f64 / flown.samples.len() as f64;
        assert!(share < 0.01, "{word}: {wrong} of {} samples", flown.samples.len());
    }
}

#[test]
fn the_lights_of_another_word_are_refused() {
    let strokes = |word: &str| write(word, &LetterOptions::default()).unwrap();
    let plan = plan(&strokes("NO"), &PlanOptions::default()).unwrap();
    let mut flight = fly(&plan, &Drone::new(&SimOptions::default(), 0), &mut |_| {}).unwrap();
    for other in ["QUIZZICAL", "QUIZ", "ON", "NOOR", "N"] {
        let error = infer_lights(&mut flight.clone(), &strokes(other)).map_err(|e| e.to_string());
        assert!(error.is_err_and(|error| error.contains(other)), "{other}");
    }
    infer_lights(&mut flight, &strokes("NO")).unwrap();
}
