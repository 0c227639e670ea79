//! Tests of ranking the submissions of a class. A submission that cheats or is invalid is refused
//! by name, and does not affect the others.

use std::path::Path;

use crate::cli::{fails, json, noctograph};

const TASK: &str = "preset = \"cf-brushless\"\n[controller]\nkind = \"lqr\"\n";
/// Submissions that obey the task.
const HONEST: [(&str, &str); 3] = [
    ("anna", "[controller]\nkind = \"lqr-integral\"\n"),
    ("bert", "preset = \"cf-brushless\"\n[controller]\nkind = \"pid\"\n"),
    ("cleo", "[controller]\nlqr.r = [1e9, 1e9, 1e9, 1e9]\n"),
];
/// Submissions that would win without flying better, each with the reason for which it is refused.
const CHEATS: [(&str, &str, &str); 6] = [
    ("picture", "photo.background = \"tea.png\"", "photo.background differs from the task's"),
    ("shutter", "camera.shutter_close_s = 1.2", "camera.shutter_close_s differs from the task's"),
    ("=truth", "observer.kind = \"truth\"", "observer.kind differs from the task's: \"truth\" for"),
    ("motors", "vehicle.motor_rise_s = 0", "vehicle.motor_rise_s differs from the task's: 0"),
    ("light", "vehicle.mass_kg = 0.02", "vehicle.mass_kg differs from the task's: 0.02 for 0.0434"),
    ("drone", "preset = \"cf21\"", "preset differs from the task's: \"cf21\" for \"cf-brushless\""),
];
/// Invalid submissions with the expected messages.
const FAULTY: [(&str, &str, &str); 4] = [
    ("syntax", "[controller]\n\nkind = lqr\n", "all/syntax.toml:3: found"),
    ("unknown", "controller.lqr.qq = [1.0]\n", "did you mean controller.lqr.q?"),
    (
        "shape",
        "[controller.lqr]\nk = [[1.0]]\n",
        "all/shape.toml:2: controller.lqr.k: found 1 rows",
    ),
    ("empty", "\n", "an empty file"),
];

fn write(folder: &Path, name: &str, toml: &str) {
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join(name).with_extension("toml"), toml).unwrap();
}

#[test]
fn cheats_are_refused_by_name_and_the_honest_keep_order_and_marks() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write(here, "task", TASK);
    for (name, toml) in HONEST {
        ["honest", "all"].iter().for_each(|to| write(&here.join(to), name, toml));
    }
    for (name, toml, _) in CHEATS.into_iter().chain(FAULTY) {
        write(&here.join("all"), name, toml);
    }
    let grade = |of: &str, more: &[&str]| {
        let study = ["rank", "--task", "task.toml", of, "--words", "TEA:6", "--seed", "7"];
        noctograph(here).args(study).args(more).output().unwrap()
    };
    let read = |file: &str| std::fs::read_to_string(here.join(file)).unwrap();

    let alone = grade("honest", &["-o", "alone", "--threads", "1"]);
    let run = grade("all", &["-o", "class", "--threads", "4", "--json"]);
    assert_eq!((alone.status.code(), run.status.code()), (Some(0), Some(1)), "some are refused");
    assert!(read("class/marks.csv").starts_with(&read("alone/marks.csv")), "bit for bit");
    assert_eq!(read("class/flights.csv"), read("alone/flights.csv"));
    let marks: Vec<String> = read("alone/marks.csv").lines().map(str::to_owned).collect();
    assert_eq!(marks[0], "name,place,p_read,low,high,marks,note");
    assert!(marks[3].starts_with("cleo,,0,0,") && marks[3].contains("lost on 6 of 6 flights"));

    let ranking = json(&run.stdout);
    assert_eq!(ranking["measures"][2]["place"], serde_json::Value::Null, "lost on every flight");
    let unranked = ranking["unranked"].as_array().unwrap();
    assert_eq!(unranked.len(), CHEATS.len() + FAULTY.len());
    assert_eq!(read("class/ranking.csv").lines().count(), 1 + 3 + 10);
    noctograph(here).args(["report", "class", "-o", "class.html"]).assert().success();
    for (name, _, why) in CHEATS.into_iter().chain(FAULTY) {
        let refused = unranked.iter().find(|it| it["contender"] == name).unwrap();
        let note = refused["note"].as_str().unwrap();
        assert!(note.starts_with("refused: ") && note.contains(why), "{name}: {note}");
        for table in ["class/marks.csv", "class/ranking.csv", "class.html"] {
            assert!(read(table).contains(name), "{name} in {table}");
        }
    }

    assert!(read("class/marks.csv").contains("\n'=truth,"), "no formula of a spreadsheet");

    // Shards run as in examples/dask_rank.py, and must not fail because of other submissions.
    for shard in ["1/2", "2/2"] {
        assert!(grade("all", &["--parts", "parts", "--shard", shard]).status.success());
    }
    assert_eq!(grade("all", &["--parts", "parts", "-o", "merged"]).status.code(), Some(1));
    assert_eq!(read("merged/marks.csv"), read("class/marks.csv"));
}

#[test]
fn the_number_of_flights_is_said_and_keys_that_name_files_cannot_be_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write(here, "task", TASK);
    write(&here.join("all"), "a", "controller.kind = \"lqr-integral\"");
    write(&here.join("all"), "b", "vehicle.mass_kg = 0.02");
    let rank = ["rank", "--task", "task.toml", "all", "--words", "I"];
    let run = noctograph(here).args(rank).output().unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(said.contains("1 submission flies 100 times each"), "{said}");
    let text = String::from_utf8(run.stdout).unwrap();
    assert!(text.contains(" -  b refused: vehicle.mass_kg differs"), "{text}");
    std::fs::remove_file(here.join("all/a.toml")).unwrap();
    let run = noctograph(here).args(rank).output().unwrap();
    assert_eq!(run.status.code(), Some(1), "none is left, and that is a result");
    let allows = |key| ["rank", "a.toml", "--task", "cf21", "--may", key];
    fails(&allows("letters.font"), &[], &["may: found letters.font", "names no file"]);
    fails(&allows("gains.*"), &[], &["may: found gains.*"]);
}
