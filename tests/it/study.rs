//! Tests of studies on the command line, with ranking, interruption, and shards in separate
//! processes.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::cli::{fails, json, names_in, noctograph};

/// Arguments of a small study with two scenes and two short words.
const RANK: [&str; 9] =
    ["rank", "team", "geometric", "--words", "I:3,L:2", "--seed", "1", "--threads", "2"];

/// Starts the same command as a process that can be killed.
fn start(folder: &Path, arguments: &[&str]) -> std::process::Child {
    Command::new(assert_cmd::cargo::cargo_bin("noctograph"))
        .current_dir(folder)
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

/// Waits until a file contains `n` lines, while a process is still writing it.
fn wait_for_lines(path: &Path, n: usize) {
    let patience = Instant::now() + Duration::from_secs(300);
    let lines = || std::fs::read(path).map_or(0, |b| b.iter().filter(|c| **c == b'\n').count());
    while lines() < n {
        assert!(Instant::now() < patience, "{} has {} lines", path.display(), lines());
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn rank_leaves_tables_flights_and_photos() {
    let folder = tempfile::tempdir().unwrap();
    let run = noctograph(folder.path()).args(RANK).args(["-o", "a"]).assert().success();
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(text.lines().all(|line| line.chars().count() <= 80), "within 80 columns:\n{text}");
    for shown in ["geometric", "team", "P(read)", "2 words, 5 flights each scene"] {
        assert!(text.contains(shown), "{shown} in\n{text}");
    }
    let names = names_in(&folder.path().join("a"));
    let all = [
        "flights.csv",
        "flights.jsonl",
        "lock",
        "photos.png",
        "ranking.csv",
        "ranking.json",
        "study.json",
    ];
    assert_eq!(names, all);
    let csv = String::from_utf8(read(folder.path(), "a/flights.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 10);
    let output = noctograph(folder.path()).args(RANK).args(["-o", "a", "--json"]).output().unwrap();
    let ranking = json(&output.stdout);
    assert!(String::from_utf8(output.stderr).unwrap().contains("already contains 10 flights"));
    let best = &ranking["measures"][0];
    assert_eq!((&best["place"], &best["n_flights"]), (&1.into(), &5.into()));
    assert!(
        best["legibility"]["low"].as_f64().unwrap()
            <= best["legibility"]["value"].as_f64().unwrap()
    );
    assert!(ranking["pairs"][0]["distinguishable"].is_boolean());
}

#[test]
fn a_scene_whose_every_photo_lacks_a_letter_ranks_below_one_that_reads() {
    let folder = tempfile::tempdir().unwrap();
    // The shutter closes before the last letter is written.
    let late = "[camera]\nshutter_close_s = 31.9\n";
    std::fs::write(folder.path().join("late.toml"), late).unwrap();
    std::fs::write(folder.path().join("whole.toml"), "word = \"PARIS\"\n").unwrap();
    let args = ["rank", "late.toml", "whole.toml", "--words", "PARIS:20", "--json", "-o", "a"];
    let output = noctograph(folder.path()).args(args).output().unwrap();
    let ranking = json(&output.stdout);
    let of = |name: &str| {
        let measures = ranking["measures"].as_array().unwrap().iter();
        measures.clone().find(|m| m["contender"] == name).unwrap().clone()
    };
    let (late, whole) = (of("late"), of("whole"));
    let value = |m: &serde_json::Value, key: &str| m[key]["value"].as_f64().unwrap();
    assert_eq!((value(&late, "legible"), &late["legible"]["low"]), (0.0, &0.0.into()));
    assert!(late["legible"]["high"].as_f64().unwrap() < 0.2, "none of 20: {late}");
    assert!(value(&late, "legibility") < 0.5, "a likelier word caps it: {late}");
    assert!(value(&whole, "legible") > 0.5, "{whole}");
    assert_eq!((&whole["place"], late["place"].is_null()), (&1.into(), true), "{ranking}");
    let csv = String::from_utf8(read(folder.path(), "a/ranking.csv")).unwrap();
    assert!(csv.lines().next().unwrap().contains("legible,legible_low,legible_high"), "{csv}");
}

#[test]
fn scenes_with_long_names_keep_rows_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a-scene-with-a-long-name-1", "a-scene-with-a-long-name-2"];
    for name in names {
        std::fs::write(folder.path().join(format!("{name}.toml")), "word = \"I\"\n").unwrap();
    }
    let args = ["rank", &format!("{}.toml", names[0]), &format!("{}.toml", names[1])];
    let output = noctograph(folder.path()).args(args).args(["--words", "I:2"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    for end in ["long-name-1", "long-name-2"] {
        assert_eq!(text.lines().filter(|line| line.contains(end)).count(), 4, "{end} in\n{text}");
    }
}

#[test]
fn tuning_that_finds_nothing_says_so_and_values_are_in_their_own_units() {
    let folder = tempfile::tempdir().unwrap();
    let tune = |knob: &str, out: &str| {
        let args = ["tune", "team", "--words", "L:1", "--budget", "36", "--test-seeds", "2", "-o"];
        let mut command = noctograph(folder.path());
        let run = command.args(args).args([out, "--knob", knob, "--json"]).output().unwrap();
        json(&run.stdout)
    };
    let worse = tune("plan.stroke_speed_m_s=1.9..2.0", "worse");
    assert_eq!(worse["helped"], false, "{worse}");
    assert_eq!(worse["tests"], serde_json::json!([]), "nothing to compare");
    let own = worse["before"]["settings"]["plan.stroke_speed_m_s"].as_f64().unwrap();
    assert_eq!(worse["best"]["settings"]["plan.stroke_speed_m_s"].as_f64(), Some(own));
    let csv = String::from_utf8(read(folder.path(), "worse/candidates.csv")).unwrap();
    let speeds: Vec<f64> =
        csv.lines().skip(1).map(|row| row.rsplit(',').next().unwrap().parse().unwrap()).collect();
    assert!(speeds[0] == own && speeds[1..].iter().all(|s| (1.9..=2.0).contains(s)), "{csv}");
    let svg = String::from_utf8(read(folder.path(), "worse/pareto.svg")).unwrap();
    assert!(svg.contains(&format!("{} candidates", speeds.len())), "all of them");
    let args = ["tune", "team", "--words", "L:1", "--budget", "36", "--test-seeds", "2"];
    let knob = ["--knob", "plan.stroke_speed_m_s=1.9..2.0", "-o", "worse"];
    let text = noctograph(folder.path()).args(args).args(knob).output().unwrap().stdout;
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("nothing found"), "{text}");
}

#[test]
fn a_killed_ranking_goes_on_to_the_same_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let run = |out: &str| {
        noctograph(folder.path()).args(RANK).args(["-o", out]).assert().success();
    };
    run("whole");
    let mut killed = start(folder.path(), &[&RANK[..], &["-o", "killed"]].concat());
    let flights = folder.path().join("killed/flights.jsonl");
    wait_for_lines(&flights, 2);
    killed.kill().unwrap(); // SIGKILL
    killed.wait().unwrap();
    let left = std::fs::read(&flights).unwrap();
    // The file ends as after an interrupted write.
    std::fs::write(&flights, [&left[..], &left[..left.len() / 3]].concat()).unwrap();
    run("killed");
    for name in ["flights.csv", "ranking.csv", "ranking.json", "photos.png"] {
        assert!(
            read(folder.path(), &format!("whole/{name}"))
                == read(folder.path(), &format!("killed/{name}")),
            "{name} differs"
        );
    }
    assert!(std::fs::read(&flights).unwrap().starts_with(&left[..left.len() / 2]), "kept");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    // The file size is limited to 1 KiB, enough for two flights, to simulate a full disk.
    let command = format!(
        "trap '' XFSZ; ulimit -f 1; exec {} {} -o out",
        assert_cmd::cargo::cargo_bin("noctograph").display(),
        RANK.join(" ")
    );
    let run = Command::new("bash").args(["-c", &command]).current_dir(folder.path()).output();
    let run = run.unwrap();
    assert_eq!(run.status.code(), Some(2));
    let stderr = String::from_utf8(run.stderr).unwrap();
    assert!(stderr.contains("out/flights.jsonl") && stderr.contains("space left"), "{stderr}");
    let left = String::from_utf8(read(folder.path(), "out/flights.jsonl")).unwrap();
    assert!(left.ends_with('\n') && left.lines().count() >= 1, "whole lines: {left}");
    noctograph(folder.path()).args(RANK).args(["-o", "out"]).assert().success();
    let whole = String::from_utf8(read(folder.path(), "out/flights.jsonl")).unwrap();
    assert!(whole.starts_with(&left) && whole.lines().count() == 10);
}

#[test]
fn one_process_at_a_time_has_a_store() {
    let folder = tempfile::tempdir().unwrap();
    let long = ["rank", "team", "--words", "NOOR:500", "--threads", "1", "-o", "out"];
    let mut first = start(folder.path(), &long);
    wait_for_lines(&folder.path().join("out/flights.jsonl"), 1);
    let second = noctograph(folder.path()).args(RANK).args(["-o", "out"]).output().unwrap();
    first.kill().unwrap();
    first.wait().unwrap();
    let stderr = String::from_utf8(second.stderr).unwrap();
    assert!(second.status.code() == Some(2) && stderr.contains("another noctograph"), "{stderr}");
}

#[test]
fn shards_in_processes_of_their_own_merge_to_what_one_process_ranks() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        noctograph(folder.path()).args(arguments).assert().success();
    };
    let study = ["team", "geometric", "--words", "I:3,L:2", "--seed", "1"];
    let shard = |shard| {
        let args = ["--parts", "parts", "--threads", "1", "--shard", shard];
        [&["rank"], &study[..], &args].concat()
    };
    let mut lost = start(folder.path(), &shard("2/3"));
    lost.kill().unwrap(); // a machine goes down
    lost.wait().unwrap();
    let workers = ["1/3", "3/3"].map(|part| start(folder.path(), &shard(part)));
    assert!(workers.map(|mut worker| worker.wait().unwrap().success()) == [true, true]);
    let parts = || names_in(&folder.path().join("parts"));
    let [first, third] = parts().try_into().expect("whole shards, and nothing else");
    assert!(first.ends_with("-1-of-3.jsonl") && third.ends_with("-3-of-3.jsonl"), "{first}");
    run(&shard("2/3"));
    assert_eq!(parts().len(), 3);
    let merge = ["--parts", "parts", "-o", "merged"];
    run(&[&["rank"], &study[..], &merge].concat());
    let merged = String::from_utf8(read(folder.path(), "merged/flights.jsonl")).unwrap();
    let read_one = |name| String::from_utf8(read(folder.path(), &format!("parts/{name}"))).unwrap();
    assert_eq!(merged, parts().iter().map(read_one).collect::<String>(), "none is flown again");
    run(&[&RANK[..], &["-o", "alone"]].concat());
    for name in ["flights.csv", "ranking.csv", "ranking.json", "photos.png"] {
        assert!(
            read(folder.path(), &format!("merged/{name}"))
                == read(folder.path(), &format!("alone/{name}")),
            "{name} differs"
        );
    }
}

#[test]
fn broken_studies_are_named() {
    fails(&["rank", "nobody"], &[], &["nobody", "team, pid, geometric"]);
    fails(&["rank", "team", "--words", "N1:x"], &[], &["N1:x", "WORD:N"]);
    fails(&["rank", "team", "--words", "NOOR:0"], &[], &["a scene, a word and a seed"]);
    fails(
        &["rank", "team", "--conditions", "c.toml"],
        &[("c.toml", "rain = 1")],
        &["c.toml", "rain"],
    );
    fails(&["rank", "team", "--parts", "p", "--shard", "3"], &[], &["shard", "I/N"]);
    fails(&["rank", "team", "--parts", "none"], &[], &["none"]);
}
