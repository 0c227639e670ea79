//! Tests of `noctograph compare`, `noctograph fly --setpoints`, and plots.

use nalgebra::Vector3;
use noctograph::flight::FlightSample;
use noctograph::report::{NamedFlight, error_over_time, front_view, top_view};
use predicates::prelude::*;
use serde_json::Value;

use crate::cli::{fails, names_in, noctograph, run_json};
use crate::golden::assert_golden;

/// Returns a folder with the plan and the flight of "I".
fn flown() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["plan", "I", "--scene", "team"]).assert().success();
    noctograph(folder.path()).args(["fly", "plan.csv", "--scene", "team"]).assert().success();
    folder
}

fn largest(vector: &Value) -> f64 {
    vector.as_array().unwrap().iter().map(|v| v.as_f64().unwrap().abs()).fold(0.0, f64::max)
}

#[test]
fn fly_prints_lag_and_contour_error() {
    let folder = flown();
    let run =
        noctograph(folder.path()).args(["fly", "plan.csv", "--scene", "team"]).assert().success();
    run.stdout(predicate::str::contains("lag ").and(predicate::str::contains("contour error")));
    let flight = &run_json(folder.path(), &["fly", "plan.csv", "--scene", "team"])["flight"];
    // The expected lag consists of the lag of these gains behind a ramp, 0.46 s, and that of
    // setpoints held for 0.1 s.
    let lag_s = flight["lag_s"].as_f64().unwrap();
    assert!((0.4..0.7).contains(&lag_s), "trails by {lag_s} s");
    let contour_m = flight["contour"]["mean_m"].as_f64().unwrap();
    let rmse_m = flight["in_plane_rmse_m"].as_f64().unwrap();
    assert!(contour_m < 0.6 * rmse_m, "off the path by {contour_m}, in the plane by {rmse_m} m");
    assert_eq!(flight["part"], "letters");
}

#[test]
fn a_replay_of_a_replay_is_the_same_flight() {
    let folder = flown();
    let replay = |log: &str, out: &str| {
        let arguments = ["fly", "--setpoints", log, "--scene", "team", "-o", out];
        noctograph(folder.path()).args(arguments).assert().success();
    };
    replay("flight.csv", "once.csv");
    replay("once.csv", "twice.csv");
    let apart_m = |other: &str| {
        let comparison = run_json(folder.path(), &["compare", other, "once.csv"]);
        assert_eq!(
            (&comparison["part"], &comparison["offset_s"]),
            (&"airborne".into(), &0.0.into())
        );
        assert!(largest(&comparison["a"]["tracking"]["rmse_m"]) > 0.02, "{comparison}");
        largest(&comparison["rmse_m"])
    };
    // A log that holds each setpoint from the sample at which it was sent is replayed exactly. A
    // log whose design is interpolated between setpoints leads by half of their interval, which is
    // 50 ms or 10 mm along the path.
    assert_eq!(apart_m("twice.csv"), 0.0);
    assert!((0.002..0.010).contains(&apart_m("flight.csv")), "{} m", apart_m("flight.csv"));
}

#[test]
fn a_log_that_names_no_firmware_is_flown_by_a_guess_that_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let rows = (0..300).map(|i| {
        let (ms, z) = (20 * i, 0.4 * f64::from(i.min(100)) / 100.0);
        format!("{ms},0,0,{z},0,0,{z}")
    });
    let head = "Timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z,ctrltarget.x,\
                ctrltarget.y,ctrltarget.z";
    let text = format!("{head}\n{}\n", rows.collect::<Vec<_>>().join("\n"));
    std::fs::write(folder.path().join("log.csv"), text).unwrap();
    let said = |log: &str, out: &str| {
        let run = ["fly", "--setpoints", log, "-o", out];
        let run = noctograph(folder.path()).args(run).assert().success();
        String::from_utf8(run.get_output().stderr.clone()).unwrap()
    };
    let warned = said("log.csv", "flown.csv");
    assert!(warned.contains("log.csv: the log names no firmware: "), "{warned}");
    assert!(!said("flown.csv", "again.csv").contains("firmware"), "a flight of ours has none");
}

#[test]
fn compare_prints_a_table_and_writes_plots() {
    let folder = flown();
    let other = ["fly", "plan.csv", "--scene", "team", "--seed", "5", "-o", "other.csv"];
    noctograph(folder.path()).args(other).assert().success();
    let compared = |out: &str| {
        let arguments = ["compare", "flight.csv", "other.csv", "--part", "letters", "-o", out];
        let run = noctograph(folder.path()).args(arguments).assert().success();
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    };
    let text = compared("plots");
    for row in ["A against B", "A against its design", "B without its lag", "B observer", "drift"] {
        assert!(text.contains(row), "no {row:?} in {text}");
    }
    let names = names_in(&folder.path().join("plots"));
    assert_eq!(names, ["error.svg", "flight-xy.svg", "flight-xz.svg"]);
    compared("again");
    for name in names {
        let plot = |dir: &str| std::fs::read_to_string(folder.path().join(dir).join(&name));
        let svg = plot("plots").unwrap();
        assert!(
            svg.starts_with("<svg xmlns=")
                && svg.contains(" width=\"800\"")
                && svg.ends_with("</svg>\n"),
            "{name}"
        );
        assert!(svg.contains("A flight.csv") && svg.contains("B other.csv"), "{name}");
        assert!(svg == plot("again").unwrap(), "{name} twice");
    }
}

#[test]
fn files_that_cannot_be_compared_or_flown_are_refused() {
    let folder = flown();
    let flight = std::fs::read_to_string(folder.path().join("flight.csv")).unwrap();
    let head = flight.lines().next().unwrap();
    let empty = format!("{head}\n");
    // During one second on the floor without setpoints, all columns except the time are 0.
    let zeros = ",0".repeat(head.split(',').count() - 1);
    let nowhere = format!("{head}\n0{zeros}\n1{zeros}\n");
    let files = [("a.csv", &flight[..]), ("empty.csv", &empty), ("nowhere.csv", &nowhere)];

    fails(&["compare", "a.csv", "none.csv", "-o", "plots"], &files, &["none.csv"]);
    fails(&["compare", "a.csv", "empty.csv"], &files, &["empty.csv", "no row"]);
    let no_design = ["flight B", "no design position", "offset"];
    fails(&["compare", "a.csv", "nowhere.csv"], &files, &no_design);
    let untold = ["compare", "a.csv", "nowhere.csv", "--offset", "0"];
    fails(&untold, &files, &["no sample in the air", "all samples"]);
    let letters = [&untold[..], &["--part", "letters"]].concat();
    fails(&letters, &files, &["no sample is part of a letter", "airborne part"]);
    let apart = ["compare", "a.csv", "a.csv", "--offset", "-500", "-o", "plots"];
    fails(&apart, &files, &["a time that both flights cover", "shift B's clock"]);
    fails(&["compare", "a.csv", "a.csv", "--offset", "NaN"], &files, &["offset_s", "NaN"]);

    fails(&["fly", "--setpoints", "nowhere.csv"], &files, &["no design position"]);
    fails(&["fly", "--setpoints", "none.csv"], &files, &["none.csv"]);
    noctograph(folder.path()).arg("fly").assert().code(2);
    noctograph(folder.path()).args(["fly", "a.csv", "--setpoints", "a.csv"]).assert().code(2);
}

/// Returns an arc of 60 samples with a gap of half a second, at a height `up_m` above its design.
fn bow(name: &str, up_m: f64) -> NamedFlight {
    let samples = (0..60).filter(|k| !(30..40).contains(k)).map(|k| {
        let time_s = f64::from(k) * 0.05;
        let design_m = Vector3::new(0.4 * time_s - 0.6, 0.0, 0.5 + 0.1 * time_s * (3.0 - time_s));
        FlightSample {
            time_s,
            position_m: design_m + Vector3::new(0.0, 0.1 * time_s - 0.05, up_m),
            estimate_m: design_m,
            design_m,
            motors: [44_000.0; 4],
            ..FlightSample::default()
        }
    });
    NamedFlight { name: name.to_owned(), samples: samples.collect() }
}

#[test]
fn golden_plots_are_the_same_to_the_byte() {
    let traces = [bow("A <one> & only", 0.02), bow("B", -0.05)];
    let plots = [
        ("flight-xy.svg", top_view(&traces)),
        ("flight-xz.svg", front_view(&traces)),
        ("error.svg", error_over_time(&traces)),
    ];
    for (name, svg) in plots {
        assert_golden(&format!("report/{name}"), &svg);
    }
}
