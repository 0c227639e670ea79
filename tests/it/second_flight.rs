//! Tests that the room, the camera and the drone are stored with plans, flights and logs, so that a
//! second flight uses them.

use std::path::Path;

use serde_json::{Value, json};

use noctograph::flight::Flight;

use crate::cli::{names_in, noctograph, run_json};
use crate::safety::{run, script};

const SMALL: [&str; 4] = ["--backend", "cpu", "--size", "640x360"];
const ROOM: [&str; 2] = ["--room", "4x6x2.5"];

/// Returns the log that a script would write for a simulated flight.
fn log(script: &Value, flight: &Path) -> Value {
    let flight = Flight::read_csv(flight).unwrap();
    let samples = || flight.samples.iter().step_by(3);
    let column = |number: &dyn Fn(usize) -> f64| {
        let ms: Vec<f64> = samples().map(|sample| (1e3 * sample.time_s).round()).collect();
        let data: Vec<f64> = (0..flight.samples.len()).step_by(3).map(number).collect();
        json!({ "time": ms, "data": data })
    };
    let mut log = json!({ "noctograph": script["origin"].clone() });
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let position_m = |row: usize| flight.samples[row].position_m[axis];
        let design_m = |row: usize| flight.samples[row].design_m[axis];
        log[format!("stateEstimate.{name}")] = column(&position_m);
        log[format!("ctrltarget.{name}")] = column(&design_m);
    }
    log["light.headlights"] = column(&|row| flight.lights["headlights"][row]);
    log
}

#[test]
fn a_second_flight_is_in_the_room_of_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let fence = |name: &str| script(&at.join(name)).1["limits"]["fence_m"].clone();
    let to = ["--to", "cflib", "-o"];
    run_json(at, &[&["preview", "HI", "--seed", "3", "-o", "first"], &ROOM[..], &SMALL].concat());
    run_json(at, &[&["export", "HI"], &ROOM[..], &to, &["HI.py"]].concat());
    assert_eq!(fence("HI.py")[1], json!([1.9, 2.6, 2.4]));

    let written = log(&script(&at.join("HI.py")).1, &at.join("first/flight.csv"));
    std::fs::write(at.join("HI_flight.json"), written.to_string()).unwrap();
    run_json(at, &["import", "HI_flight.json", "-o", "flown.csv"]);
    for flown in ["HI_flight.json", "flown.csv", "first/flight.csv"] {
        // The photo is taken by the camera in the room.
        run_json(at, &[&["expose", flown, "-o", "flown.png"], &SMALL[..]].concat());
        let verdict = run_json(at, &["score", "flown.png"]);
        assert_eq!(
            (&verdict["read"], &verdict["legible"]),
            (&json!("HI"), &json!(true)),
            "{flown}"
        );
        run_json(at, &["plan", "HI", "--after", flown, "-o", "HI2.csv"]);
        let (_, checked, _) = run(at, &["check", "HI2.csv"]);
        assert_eq!(checked["profile"]["room_m"], json!([4.0, 6.0, 2.5]), "{flown}");
        run_json(at, &[&["export", "HI2.csv"], &to[..], &["HI2.py"]].concat());
        assert_eq!(fence("HI2.py"), fence("HI.py"), "{flown}");
    }
    // The scene of a custom controller has no room, so the plan's room is kept.
    run_json(
        at,
        &[&["export", "HI2.csv", "--word", "HI", "--scene", "pid"], &to[..], &["pid.py"]].concat(),
    );
    assert_eq!(fence("pid.py"), fence("HI.py"));
    // A second preview, from the log's scene or from the plan, also uses the room.
    for again in [&["HI", "--scene", "HI_flight.json"][..], &["HI2.csv"]] {
        run_json(at, &[&["preview"], again, &["-o", "again"], &SMALL].concat());
        let scene = std::fs::read_to_string(at.join("again/scene.toml")).unwrap();
        assert!(scene.contains("\nroom_m = [4.0, 6.0, 2.5]\n"), "{again:?}");
    }
}

#[test]
fn drones_that_share_a_word_share_its_room() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run_json(at, &[&["plan", "HI", "--drones", "2", "-o", "both"], &ROOM[..]].concat());
    let (_, checked, _) = run(at, &["check", "both"]);
    assert_eq!(checked["profile"]["room_m"], json!([4.0, 6.0, 2.5]));
    run_json(at, &["fly", "both/plan-1.csv", "both/plan-2.csv", "-o", "flown"]);
    assert_eq!(names_in(&at.join("flown")), ["flight-1.csv", "flight-2.csv", "scene.toml"]);
    // Plans for different rooms have no common scene.
    run_json(at, &["plan", "I", "-o", "elsewhere.csv"]);
    let both = noctograph(at).args(["check", "both/plan-1.csv", "elsewhere.csv"]).assert().code(2);
    let said = String::from_utf8_lossy(&both.get_output().stderr).into_owned();
    assert!(
        said.contains("one scene for all files") && said.contains("elsewhere.scene.toml"),
        "{said}"
    );
}

#[test]
fn a_plan_of_which_nothing_says_its_room_is_not_exported() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run_json(at, &[&["plan", "HI", "-o", "HI2.csv"], &ROOM[..]].concat());
    std::fs::remove_file(at.join("HI2.scene.toml")).unwrap();
    let export = |more: &[&str]| {
        let to = ["export", "HI2.csv", "--word", "HI", "--to", "cflib", "-o", "HI2.py"];
        noctograph(at).args(to).args(more).assert()
    };
    for guess in [&[][..], &["--scene", "cf21"]] {
        let refused = export(guess).code(2);
        let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
        assert!(said.contains("--room WxDxH"), "{said}");
        assert_eq!(names_in(at), ["HI2.csv"], "nothing is written");
    }
    export(&ROOM).success();
    assert_eq!(script(&at.join("HI2.py")).1["limits"]["fence_m"][1], json!([1.9, 2.6, 2.4]));
    // The export is forced, and then repeated outdoors, without walls.
    export(&["--unchecked"]).success();
    export(&["--profile", "outdoor"]).success();
}

#[test]
fn the_scene_of_a_log_opens_no_file_unless_the_log_is_named_as_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run_json(at, &[&["preview", "HI", "-o", "first"], &SMALL[..]].concat());
    let scene = "word = \"HI\"\n[photo]\nbackground = \"first/photo.png\"\n";
    let written = log(&json!({ "origin": { "scene": scene } }), &at.join("first/flight.csv"));
    std::fs::write(at.join("log.json"), written.to_string()).unwrap();
    let expose = |more: &[&str]| {
        noctograph(at).args(["expose", "log.json", "-o", "log.png"]).args(more).args(SMALL).assert()
    };
    let refused = expose(&[]).code(2);
    let said = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(said.contains("photo.background") && said.contains("as the scene"), "{said}");
    expose(&["--scene", "log.json"]).success();
    expose(&["--set", "photo.background="]).success();
}

#[test]
fn the_scene_of_an_earlier_file_of_the_same_name_is_forgotten() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run_json(at, &[&["plan", "I", "-o", "plan.csv"], &ROOM[..]].concat());
    run_json(at, &[&["preview", "HI", "-o", "."], &SMALL[..]].concat());
    let (_, checked, _) = run(at, &["check", "plan.csv"]);
    assert_eq!(checked["profile"]["room_m"], Value::Null);
    run_json(at, &["fly", "plan.csv", "-o", "flown.csv"]);
    // A log of another program contains no scene.
    std::fs::write(at.join("log.csv"), "t,x,y,z\n0,0,0,0\n1,0,0,1\n2,0,0,1\n").unwrap();
    run_json(at, &["import", "log.csv", "--max-gap", "2", "-o", "flown.csv"]);
    assert!(!at.join("flown.scene.toml").exists(), "{:?}", names_in(at));
}
