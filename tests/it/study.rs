//! Studies as a person meets them: ranking, interruption, shards in processes of their own.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::cli::{fails, json, names_in, noctograph};

/// A small study: two scenes, two short words.
const RANK: [&str; 9] =
    ["rank", "team", "geometric", "--words", "I:3,L:2", "--seed", "1", "--threads", "2"];

/// The same command as a process that can be killed.
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

/// Waits until a file holds some lines; the process that writes it is still at it.
fn wait_for_lines(path: &Path, n: usize) {
    let patience = Instant::now() + Duration::from_secs(60);
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
    assert!(String::from_utf8(output.stderr).unwrap().contains("10 flights are there already"));
    let best = &ranking["measures"][0];
    assert_eq!((&best["place"], &best["n_flights"]), (&1.into(), &5.into()));
    assert!(
        best["legibility"]["low"].as_f64().unwrap()
            <= best["legibility"]["value"].as_f64().unwrap()
    );
    assert!(ranking["pairs"][0]["distinguishable"].is_boolean());
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
    // What a write in mid-air would have left.
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
    // Files may not grow beyond 1 KiB: two flights, as on a disk that is full.
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
    run(&[&["sweep", "plan"], &study[..]].concat());
    let mut workers: Vec<_> = ["1/3", "2/3", "3/3"]
        .map(|shard| {
            let args = ["sweep", "run", "sweep.json", "--shard", shard, "--threads", "1"];
            start(folder.path(), &args)
        })
        .into();
    workers[1].kill().unwrap(); // a machine goes down
    let codes: Vec<bool> = workers.iter_mut().map(|w| w.wait().unwrap().success()).collect();
    assert_eq!(codes, [true, false, true]);
    let merge = ["sweep", "merge", "sweep.json", "parts", "-o", "merged"];
    let missing = noctograph(folder.path()).args(merge).output().unwrap();
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8(missing.stderr).unwrap().contains("flights are missing"));
    run(&["sweep", "run", "sweep.json", "--shard", "2/3"]);
    run(&merge);
    run(&[&RANK[..], &["-o", "alone"]].concat());
    for name in ["flights.csv", "ranking.csv", "ranking.json", "photos.png"] {
        assert!(
            read(folder.path(), &format!("merged/{name}"))
                == read(folder.path(), &format!("alone/{name}")),
            "{name} differs"
        );
    }
    let slurm = ["sweep", "slurm", "sweep.json", "--shards", "4"];
    let script = noctograph(folder.path()).args(slurm).output().unwrap().stdout;
    let script = String::from_utf8(script).unwrap();
    for line in ["#!/bin/bash\n", "#SBATCH --array=1-4\n", "--shard \"$SLURM_ARRAY_TASK_ID/4\""] {
        assert!(script.contains(line), "{line} in\n{script}");
    }
}

#[test]
fn broken_studies_are_named() {
    fails(&["rank", "nobody"], &[], &["nobody", "team, pid, geometric"]);
    fails(&["rank", "team", "--words", "N1:x"], &[], &["N1:x", "WORD:N"]);
    fails(&["rank", "team", "--words", "NOOR:0"], &[], &["at least one of each"]);
    fails(
        &["rank", "team", "--conditions", "c.toml"],
        &[("c.toml", "rain = 1")],
        &["c.toml", "rain"],
    );
    fails(&["sweep", "run", "p.json"], &[("p.json", "{}")], &["p.json", "a sweep's plan"]);
    fails(&["sweep", "run", "p.json", "--shard", "3"], &[("p.json", "{}")], &["p.json"]);
}
