//! Tests of gaps in a flight's log. Gaps are stored in the flight and in its photo, so that a
//! stroke lost in a gap is not attributed to the lamps.

use std::path::Path;

use noctograph::flight::{Flight, FlightSample};
use predicates::prelude::*;
use serde_json::{Value, json};

use crate::cli::{fails, noctograph, run_json};
use crate::dialects::{flown, json_2022};

/// Returns the sample in the middle of the bottom stroke of the square letter O.
fn bottom_of_o(flight: &Flight) -> FlightSample {
    let samples = flight.samples.iter().zip(&flight.lights["headlights"]);
    let low = samples.filter(|(sample, level)| {
        sample.letter == Some(1) && **level > 0.0 && sample.design_m.z < 0.501
    });
    let low: Vec<FlightSample> = low.map(|(sample, _)| *sample).collect();
    low[low.len() / 2]
}

const SMALL: [&str; 4] = ["--backend", "cpu", "--size", "640x360"];

#[test]
fn a_gap_of_a_log_travels_into_the_advice_and_the_lamps_are_not_blamed() {
    let (folder, flight) = (tempfile::tempdir().unwrap(), flown("NO"));
    let middle = bottom_of_o(&flight);
    let [from_s, to_s] = [middle.time_s - 0.5, middle.time_s + 0.5];
    let is_lost = |_: &str, sample: &FlightSample| sample.time_s > from_s && sample.time_s < to_s;
    std::fs::write(folder.path().join("log.json"), json_2022(&flight, is_lost)).unwrap();

    // Without a scene, the letters are inferred, and the gap is stored in the flight's file.
    let import = ["import", "log.json", "--word", "NO", "-o", "flown.csv"];
    let run = noctograph(folder.path()).args(import).assert().success();
    run.stderr(predicate::str::contains("letters of ae483-2022"));
    let gaps = run_json(folder.path(), &import)["gaps_s"].clone();
    let read = Flight::read_csv(&folder.path().join("flown.csv")).unwrap();
    assert_eq!(json!(read.gaps), gaps);
    assert!(read.gaps.len() == 1 && (read.gaps[0][0] - from_s).abs() < 0.02, "{gaps}");
    assert!(read.samples.iter().any(|sample| sample.letter == Some(1)));

    // The photo of the log contains the word and the gap. So does the flight that is passed to
    // `score`.
    let exposed = ["expose", "log.json", "--word", "NO"];
    noctograph(folder.path()).args(exposed).args(SMALL).assert().success();
    for more in [&[][..], &["--flight", "log.json"], &["--flight", "flown.csv"]] {
        let score = [&["score", "photo.png", "--json"], more].concat();
        let output = noctograph(folder.path()).args(&score).output().unwrap();
        let verdict = crate::cli::json(&output.stdout);
        check_verdict(&verdict, &middle, [from_s, to_s]);
    }
}

fn check_verdict(verdict: &Value, middle: &FlightSample, gap_s: [f64; 2]) {
    assert_eq!(verdict["word"], "NO", "the photo names it");
    let causes = verdict["causes"].as_array().unwrap();
    let of_o = |kind: &str| {
        let of_kind = move |cause: &&Value| cause["kind"] == *kind && cause["letter"] == 1;
        causes.iter().filter(of_kind).collect::<Vec<_>>()
    };
    // A single gap may leave several dark pieces of the stroke.
    let gaps = of_o("log_gap");
    assert!(!gaps.is_empty(), "{causes:#?}");
    for gap in gaps {
        for (end, gap_s) in gap_s.into_iter().enumerate() {
            let found_s = gap["log_gap_s"][end].as_f64().unwrap();
            assert!((found_s - gap_s).abs() < 0.02, "{gap}");
        }
    }
    for cause in of_o("missing_run") {
        let [x_m, z_m] = [0, 1].map(|axis| cause["at_m"][axis].as_f64().unwrap());
        let away_m = libm::hypot(x_m - middle.position_m.x, z_m - middle.position_m.z);
        assert!(away_m > 0.1, "the lamp is blamed {away_m} m from the gap: {cause}");
    }
}

/// Because the attitude moves the lamps by only a few millimeters, a gap in it omits no light.
#[test]
fn a_gap_of_the_attitude_alone_leaves_no_gap_in_the_flight() {
    let (folder, flight) = (tempfile::tempdir().unwrap(), flown("NO"));
    let middle_s = bottom_of_o(&flight).time_s;
    let import = |variable: &'static str, half_s: f64| {
        let is_lost = |name: &str, sample: &FlightSample| {
            name == variable && (sample.time_s - middle_s).abs() < half_s
        };
        std::fs::write(folder.path().join("log.json"), json_2022(&flight, is_lost)).unwrap();
        run_json(folder.path(), &["import", "log.json"])["gaps_s"].clone()
    };
    assert_eq!(import("stateEstimate.roll", 0.3), json!([]));
    assert_eq!(import("stateEstimate.roll", 0.7).as_array().unwrap().len(), 1);
    assert_eq!(import("stateEstimate.x", 0.3).as_array().unwrap().len(), 1);
}

#[test]
fn a_log_of_other_letters_names_the_command_that_reads_it() {
    let log = json_2022(&flown("NO"), |_, _| false);
    let other = ["expose", "log.json", "--word", "QUIZ"];
    let command = "noctograph import log.json --word QUIZ --scene SCENE.toml";
    fails(&other, &[("log.json", &log)], &["word QUIZ", command]);
    let nameless = ["expose", "log.json"];
    fails(&nameless, &[("log.json", &log)], &["light.headlights", "`--word` infers the lights"]);
}

#[test]
fn a_photo_without_a_word_says_so_when_it_is_made_and_when_it_is_scored() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| noctograph(folder.path()).args(arguments).assert();
    run(&["plan", "I"]).success();
    run(&["fly", "plan.csv"]).success();
    std::fs::remove_file(folder.path().join("flight.scene.toml")).unwrap();
    let small = ["--backend", "cpu", "--size", "192x108"];
    let nameless = run(&[&["expose", "flight.csv", "-o", "a.png"], &small[..]].concat());
    nameless.success().stderr(predicate::str::contains("names no word"));
    let score = run(&["score", "a.png"]).code(2);
    score.stderr(predicate::str::contains("name the word after the photo"));
    run(&[&["expose", "flight.csv", "--word", "I"], &small[..]].concat()).success();
    run(&["score", "photo.png"]).code(predicates::ord::le(1));
    assert!(word_of(&folder.path().join("photo.png")).contains("word = \"I\""));
}

fn word_of(photo: &Path) -> String {
    noctograph::photo::read_with_notes(photo).unwrap().0.into_data().scene_toml.unwrap()
}
