//! Tests of `expose --follow`, which photographs a log while it grows.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use noctograph::flight::Flight;
use predicates::prelude::*;

use crate::cli::{noctograph, run_json};
use crate::dialects::FIRMWARE;

/// Returns the log of a flight as an exported script writes it, sampled at 50 Hz, with the lights
/// when they change.
fn lines(flight: &Flight) -> String {
    let mut text = "{\"noctograph\": {\"word\": \"NO\", \"firmware\": \"2026.08\"}}\n".to_owned();
    let mut lights: Vec<f64> = vec![-1.0; flight.lights.len()];
    let step = flight.samples.iter().position(|s| s.time_s >= 0.02).unwrap();
    for (row, sample) in flight.samples.iter().enumerate() {
        let stamp_ms = (1000.0 * sample.time_s).round();
        for (light, (channel, levels)) in lights.iter_mut().zip(&flight.lights) {
            if *light != levels[row] {
                *light = levels[row];
                let level = levels[row];
                writeln!(text, "{{\"time\": {stamp_ms}, \"light.{channel}\": {level:?}}}").unwrap();
            }
        }
        for block in FIRMWARE.iter().filter(|_| row % step == 0) {
            let mut line = format!("{{\"time\": {stamp_ms}");
            for (name, value) in *block {
                write!(line, ", \"{name}\": {:?}", value(sample)).unwrap();
            }
            writeln!(text, "{line}}}").unwrap();
        }
    }
    text + "{\"end\": true}\n"
}

/// Returns a folder with a plan and its scene, and the text of the log of its flight.
pub(crate) fn flown() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    for args in ["plan NO -o plan.csv", "fly plan.csv -o flight.csv"] {
        noctograph(folder.path()).args(args.split(' ')).assert().success();
    }
    let flight = std::fs::read(folder.path().join("flight.csv")).unwrap();
    let options = noctograph::logs::ImportOptions::default();
    let flight = noctograph::logs::import_bytes(&flight, "flight.csv", &options).unwrap();
    (folder, lines(&flight))
}

const PICTURE: [&str; 4] = ["--scene", "plan.csv", "--size", "640x360"];

/// Starts `expose --follow` of `log.jsonl`.
fn followed(folder: &Path, more: &[&str]) -> std::process::Child {
    let follow = ["expose", "--follow", "log.jsonl", "-o", "followed.png"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_noctograph"));
    command.current_dir(folder).args(follow).args(PICTURE).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_log_that_grows_leaves_photos_on_the_way_and_at_the_end_the_bytes_of_the_whole_log() {
    let (folder, text) = flown();
    let path = |name: &str| folder.path().join(name);
    let run = followed(folder.path(), &["--plan", "plan.csv"]);
    // The script starts later, and writes parts of lines.
    std::thread::sleep(Duration::from_millis(300));
    let mut log = std::fs::File::create(path("log.jsonl")).unwrap();
    let mut photos: Vec<Vec<u8>> = Vec::new();
    for part in text.as_bytes().chunks(text.len() / 40) {
        log.write_all(part).unwrap();
        std::thread::sleep(Duration::from_millis(100));
        if let Ok(photo) = std::fs::read(path("followed.png")) {
            let end = photo[photo.len() - 12..].to_vec();
            assert_eq!(&end[4..8], b"IEND", "each photo is whole");
            if photos.last() != Some(&photo) {
                photos.push(photo);
            }
        }
    }
    let out = run.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{said}");
    assert!(photos.len() > 1 && photos.len() < 12, "{} photos in 4 s", photos.len());
    assert!(said.contains("waiting for log.jsonl"), "{said}");
    for letter in ["N: reads as N", "O: reads as O", "so far NO"] {
        assert!(said.contains(letter), "{said}");
    }
    let report = String::from_utf8_lossy(&out.stdout);
    assert!(report.contains("NO reads as NO: legible"), "{report}");

    let expose = ["expose", "log.jsonl", "-o", "whole.png", "--backend", "cpu"];
    run_json(folder.path(), &[&expose[..], &PICTURE].concat());
    let [followed, whole] = ["followed.png", "whole.png"].map(|name| std::fs::read(path(name)));
    assert!(followed.unwrap() == whole.unwrap(), "the bytes of the whole log");
}

#[test]
fn what_cannot_be_followed_is_refused_and_a_log_that_ends_early_is_read() {
    let (folder, text) = flown();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("log.jsonl"), "t,x,y,z\n").unwrap();
    let run = followed(folder.path(), &[]).wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.code() == Some(2) && said.contains("NAME_flight.jsonl"), "{said}");
    for (broken, wanted) in [("[1]", "log.jsonl:2"), ("{\"a\": 1}", "without a time")] {
        let head = text.lines().next().unwrap();
        std::fs::write(path("log.jsonl"), format!("{head}\n{broken}\n{{\"end\": true}}\n"))
            .unwrap();
        let run = followed(folder.path(), &[]).wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.code() == Some(2) && said.contains(wanted), "{said}");
    }
    assert!(!path("followed.png").exists(), "nothing is written");

    let torn = &text[..2 * text.len() / 3];
    std::fs::write(path("log.jsonl"), torn).unwrap();
    let ends_early = predicate::str::contains("ends early");
    let import = ["import", "log.jsonl", "-o", "torn.csv"];
    noctograph(folder.path()).args(import).assert().success().stderr(ends_early);
}

/// The log's clock, position and light differ from those of the previewed flight.
#[test]
fn a_flight_is_compared_with_the_promised_one_letter_by_letter() {
    let (folder, text) = flown();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("log.jsonl"), text).unwrap();
    let preview = ["preview", "NO", "--size", "640x360", "--flown", "log.jsonl", "--report"];
    let told = run_json(folder.path(), &preview);
    let flown = &told["flown"];
    assert_eq!((&flown["read"], flown["letters"].as_array().unwrap().len()), (&"NO".into(), 2));
    for letter in flown["letters"].as_array().unwrap() {
        let [promised, flown] = ["promised", "flown"].map(|side| &letter[side]);
        // The log is that of the same flight, at a tenth of its sample rate.
        for (key, tolerance) in [("lag_s", 0.02), ("contour_m", 2e-3), ("lit_s", 0.1)] {
            let [a, b] = [promised, flown].map(|side| side[key].as_f64().unwrap());
            assert!(a.is_finite() && (a - b).abs() < tolerance, "{key}: {letter}");
        }
        assert!(flown["p"].as_f64().unwrap() > 0.9 && flown["lit_s"].as_f64().unwrap() > 1.0);
    }
    let page = std::fs::read_to_string(path("noctograph-out/report.html")).unwrap();
    assert!(page.contains("Promised and flown") && page.contains("flown 0."), "the section");
    let fleet = ["preview", "NO", "--set", "plan.drones=2", "--flown", "log.jsonl"];
    let one = predicate::str::contains("a word written by a single drone");
    noctograph(folder.path()).args(fleet).assert().code(2).stderr(one);
}
