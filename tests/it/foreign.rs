//! Tests of light logs and other foreign files, the clocks of two logs, and guesses in `--json`.

use std::fmt::Write;

use predicates::prelude::*;

use crate::cli::{noctograph, run_json};

/// Returns a 40 s flight as a table whose timestamps come from a clock with the given rate.
fn table(ratio: f64) -> String {
    let mut text = "t,x,y,z\n".to_owned();
    for i in 0..=800 {
        let t = f64::from(i) * 0.05;
        let up = ((t - 1.0) / 2.0).clamp(0.0, 1.0) * ((39.0 - t) / 2.0).clamp(0.0, 1.0);
        let (x, y) = (up * (0.8 * t).sin(), up * 0.5 * (0.5 * t).cos());
        writeln!(text, "{:.5},{x:.4},{y:.4},{up:.4}", t * ratio).unwrap();
    }
    text
}

#[test]
fn a_clock_ratio_stretches_the_drones_log_alone() {
    let folder = tempfile::tempdir().unwrap();
    for (name, ratio) in [("drone.csv", 84.0 / 85.0), ("mocap.csv", 1.0)] {
        std::fs::write(folder.path().join(name), table(ratio)).unwrap();
    }
    for pair in [["drone.csv", "mocap.csv"], ["mocap.csv", "drone.csv"]] {
        let with = |ratio: &str| {
            let args = ["compare", pair[0], pair[1], "--align", "flown", "--clock-ratio", ratio];
            let rmse_m = run_json(folder.path(), &args)["rmse_m"].clone();
            (0..3).map(|axis| rmse_m[axis].as_f64().unwrap().powi(2)).sum::<f64>().sqrt()
        };
        let (before_m, after_m) = (with("1"), with("84/85"));
        assert!(before_m > 0.05 && after_m < 0.003, "{pair:?}: {before_m} m, then {after_m} m");
    }
    // If both logs are the same file, the drone's log cannot be determined.
    let args = ["compare", "mocap.csv", "mocap.csv", "--align", "flown", "--clock-ratio", "84/85"];
    noctograph(folder.path()).args(args).assert().code(2).stderr(predicate::str::contains("clock"));
}

#[test]
fn an_import_says_which_firmware_flew_and_where_the_scene_has_another() {
    let folder = tempfile::tempdir().unwrap();
    let stamps: Vec<u32> = (0..200).map(|i| 20 * i).collect();
    let column = |rate: f64| {
        let data: Vec<f64> = stamps.iter().map(|ms| rate * f64::from(*ms)).collect();
        serde_json::json!({ "time": stamps, "data": data })
    };
    let mut log = serde_json::json!({ "noctograph": { "word": "NO", "firmware": "2025.12.1" } });
    for (name, rate) in [("x", 1e-4), ("y", 2e-4), ("z", 3e-4)] {
        log[format!("stateEstimate.{name}")] = column(rate);
    }
    std::fs::write(folder.path().join("log.json"), log.to_string()).unwrap();
    std::fs::write(folder.path().join("log.csv"), format!("# firmware: 2025.12.1\n{}", table(1.0)))
        .unwrap();
    for log in ["log.json", "log.csv"] {
        let said = |more: &[&str]| {
            let found = run_json(folder.path(), &[&["import", log], more].concat());
            assert_eq!(found["firmware"], "2025.12.1", "{log}: {found}");
            found["warnings"].to_string()
        };
        let doubt = "which vehicle.firmware = \\\"2025.12\\\" models";
        let of_another = said(&[]);
        assert!(of_another.contains(doubt), "{log}: {of_another}");
        let of_its_own = said(&["--set", "vehicle.firmware=2026.04"]);
        assert!(!of_its_own.contains("firmware"), "{log}: {of_its_own}");
    }
}

#[test]
fn a_light_log_is_exposed_in_its_colors_without_a_word_and_a_bare_log_lit_all_along() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "# time,X,Y,Z,R,G,B\n".to_owned();
    for i in 0..60 {
        let t = f64::from(i) * 0.1;
        writeln!(text, "{t:.1},{:.2},0.1,{:.2},255,0,0", 0.2 * t, 0.5 + 0.1 * t).unwrap();
    }
    std::fs::write(folder.path().join("light.csv"), text).unwrap();
    let small = ["--backend", "cpu", "--size", "160x90"];
    let found = run_json(folder.path(), &[&["expose", "light.csv"][..], &small].concat());
    assert!(found["warnings"][0].as_str().unwrap().contains("0 to 255"), "{found}");
    let photo = image::open(folder.path().join("photo.png")).unwrap().into_rgb8();
    let brightest = photo.pixels().max_by_key(|pixel| pixel.0[0]).unwrap().0;
    assert!(
        brightest[0] > 100 && brightest[0] > brightest[1] && brightest[0] > brightest[2],
        "{brightest:?}"
    );
    std::fs::write(folder.path().join("flight.csv"), table(1.0)).unwrap();
    let dark = [&["expose", "flight.csv", "-o", "dark.png"][..], &small].concat();
    noctograph(folder.path())
        .args(&dark)
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--lit"));
    let lit = [&["expose", "flight.csv", "--lit", "-o", "lit.png"][..], &small].concat();
    noctograph(folder.path()).args(&lit).assert().success();
    // A flag that was already typed is not suggested.
    let worded = [&["expose", "flight.csv", "--word", "NO", "-o", "dark.png"][..], &small].concat();
    let said = noctograph(folder.path()).args(&worded).output().unwrap().stderr;
    assert!(
        !String::from_utf8_lossy(&said).contains("`--word`"),
        "{}",
        String::from_utf8_lossy(&said)
    );
}

#[test]
fn what_is_guessed_of_a_log_is_in_json() {
    let folder = tempfile::tempdir().unwrap();
    let more = table(1.0).replace('\n', ",7,9\n").replacen("z,7,9", "z,mood,m1", 1);
    std::fs::write(folder.path().join("log.csv"), more).unwrap();
    let found = run_json(folder.path(), &["import", "log.csv"]);
    let said = found["warnings"].to_string();
    assert!(said.contains("mood (column 5)") && said.contains("m1 without"), "{said}");
    let n = found["warnings"].as_array().unwrap().len();
    let said: std::collections::BTreeSet<String> =
        found["warnings"].as_array().unwrap().iter().map(ToString::to_string).collect();
    assert_eq!(said.len(), n, "each once");
    let missing = ["import", "log.csv", "--period", "0.1"];
    noctograph(folder.path())
        .args(missing)
        .assert()
        .code(2)
        .stderr(predicate::str::contains("times"));
}
