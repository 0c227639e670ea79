//! Tests of the messages that `check`, `export`, `preview` and `meter` print before a flight.

use std::path::Path;

use predicates::prelude::*;
use serde_json::Value;

use noctograph::crazyflie::SLOW_CLOCK;

use crate::cli::{json, names_in, noctograph};

/// Returns the exit code, the JSON output and the warnings of a command.
pub(crate) fn run(folder: &Path, arguments: &[&str]) -> (i32, Value, String) {
    let output = noctograph(folder).args(arguments).arg("--json").output().unwrap();
    let warnings = String::from_utf8(output.stderr).unwrap();
    (output.status.code().unwrap(), json(&output.stdout), warnings)
}

fn finding<'a>(report: &'a Value, check: &str) -> &'a Value {
    let findings = report["findings"].as_array().unwrap();
    findings.iter().find(|finding| finding["check"] == check).unwrap()
}

/// Returns the mode of a script and the data that it flies.
pub(crate) fn script(path: &Path) -> (String, Value) {
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("DATA = json.loads(")).unwrap();
    let data: String = serde_json::from_str(line.strip_suffix(')').unwrap()).unwrap();
    let data = serde_json::from_str(&data).unwrap();
    (text, data)
}

const SMALL: [&str; 4] = ["--backend", "cpu", "--size", "640x360"];

#[test]
fn a_plan_and_a_word_are_judged_against_the_room() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    noctograph(at).args(["plan", "NOOR", "-o", "plan.csv"]).assert().success();
    let (code, small, _) = run(at, &["check", "plan.csv", "--room", "1.5x1.5x1"]);
    assert_eq!((code, &small["fly"]), (1, &false.into()), "the plan is 2 m wide");
    assert_eq!(finding(&small, "volume")["severity"], "stop");
    let (code, hall, _) = run(at, &["check", "plan.csv", "--room", "4x6x2.5"]);
    assert_eq!((code, &finding(&hall, "volume")["severity"]), (0, &"fine".into()));
    // A word is fitted to its room, unless a larger size of the letters is given.
    for room in ["1.5x1.5x1", "2x2x2", "4x3x2.5", "5x2x2"] {
        let (code, word, _) = run(at, &["check", "HI", "--room", room]);
        assert_eq!(finding(&word, "volume")["severity"], "fine", "{room}");
        assert_eq!((code, &finding(&word, "camera")["severity"]), (0, &"fine".into()), "{room}");
    }
    let higher = ["check", "HI", "--room", "2x2x2", "--set", "letters.cap_height_m=1.5"];
    let higher = [&higher[..], &["--set", "letters.baseline_m=0.5"]].concat();
    let (code, word, _) = run(at, &higher);
    let wide = [&higher[..], &["--set", "letters.canvas_m=[9, 9]"]].concat();
    let (wide_code, wide, _) = run(at, &wide);
    assert_eq!((code, wide_code), (1, 1), "a typed height is kept: {word}, {wide}");
}

/// The test measures the size of the word, and checks that the Lighthouse stations in their default
/// positions see its whole flight.
#[test]
fn a_word_is_as_large_as_its_room_and_is_seen_there() {
    let folder = tempfile::tempdir().unwrap();
    for (word, room, largest_m) in [
        ("NOOR", "4x3x2.5", [3.0, 1.3]),
        ("NOOR", "20x20x8m", [4.0, 1.5]),
        ("HELLO WORLD", "5x5x2.5", [4.0, 1.3]),
        ("NO", "3x3x2.5", [2.0, 1.3]),
    ] {
        let (code, json, _) = run(folder.path(), &["check", word, "--room", room]);
        let placement = &json["placement"];
        let word_m = placement["word_m"].as_array().unwrap();
        let [left, bottom, right, top] = [0, 1, 2, 3].map(|i| word_m[i].as_f64().unwrap());
        let fills = [(right - left) / largest_m[0], (top - bottom) / largest_m[1]];
        let sides: Vec<f64> =
            room.trim_end_matches('m').split('x').map(|side| side.parse().unwrap()).collect();
        // Otherwise, the word is as large as a camera 0.3 m in front of the wall can show.
        let least_m = placement["cameras"][0]["least_m"].as_f64().unwrap();
        let shown = least_m / (0.5 * sides[1] - 0.3);
        let fills = [fills[0], fills[1], shown];
        let most = fills.into_iter().fold(0.0, f64::max);
        assert!((most - 1.0).abs() < 1e-5, "{word} in {room}: {fills:?}");
        assert!((left + right).abs() < 1e-9, "in the middle of the room");
        assert_eq!(finding(&json, "coverage")["severity"], "fine");
        assert_eq!((code, &finding(&json, "camera")["severity"]), (0, &"fine".into()), "{room}");
        for (axis, side) in sides[..2].iter().enumerate() {
            let at = placement["stations_m"][1][axis].as_f64().unwrap();
            assert!((at - (0.5 * side).min(2.5)).abs() < 1e-9, "in the corner: {at}");
        }
    }
    let own = ["check", "I", "--room", "4x3x2.5", "--set"];
    let stations = "sensors.lighthouse.stations=[{generation=\"v2\",position_m=[-1,-1,2],yaw_rad=0.8,pitch_rad=0.5,roll_rad=0.0}]";
    let (_, json, _) = run(folder.path(), &[&own[..], &[stations]].concat());
    assert_eq!(json["placement"]["stations_m"], serde_json::json!([[-1.0, -1.0, 2.0]]), "its own");
    let (_, json, _) = run(folder.path(), &["check", "I"]);
    assert!(json["placement"].is_null(), "no room is known");
}

#[test]
fn a_check_that_has_nothing_to_judge_by_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    noctograph(at).args(["plan", "NO", "--style", "even", "-o", "plan.csv"]).assert().success();
    let (_, report, _) = run(at, &["check", "plan.csv", "--scene", "ae483-2022"]);
    for check in ["doubled stroke", "altitude hold", "battery"] {
        let finding = finding(&report, check);
        assert_eq!(finding["severity"], "unknown", "{finding}");
        let found = finding["found"].as_str().unwrap();
        assert!(found.starts_with("not checked: "), "{finding}");
        assert_ne!(finding["change"], "", "{finding}");
    }
    let table = noctograph(at).args(["check", "plan.csv", "--scene", "ae483-2022"]).assert();
    table.stdout(predicate::str::contains("properties not checked"));
}

#[test]
fn export_refuses_what_check_stops_and_a_script_that_is_forced_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let large = ["HI", "--set", "letters.baseline_m=2.2"];
    let (code, report, _) = run(at, &[&["check"], &large[..]].concat());
    assert_eq!((code, &finding(&report, "volume")["severity"]), (1, &"stop".into()));
    for format in ["cflib", "compressed", "crazyswarm2", "skyc", "vviz"] {
        let arguments = [&["export"], &large[..], &["--to", format, "-o", "out"]].concat();
        let (code, report, _) = run(at, &arguments);
        assert_eq!(code, 1, "{format}: {report}");
        assert!(report["stops"].as_str().unwrap().contains("volume"), "{format}: {report}");
        assert!(names_in(at).is_empty(), "{format}: nothing is written");
    }
    let forced = ["--to", "cflib", "-o", "out.py", "--unchecked"];
    let (code, report, _) = run(at, &[&["export"], &large[..], &forced].concat());
    assert_eq!(code, 0, "{report}");
    let second = script(&at.join("out.py")).0.lines().nth(1).unwrap().to_owned();
    assert!(second.starts_with("# EXPORTED UNCHECKED, NOT SAFE TO FLY: volume ("), "{second}");
    // Exports of flights are checked, but gains and log configurations are not.
    noctograph(at).args(["export", "HI", "--to", "cflib", "-o", "hi.py"]).assert().success();
    assert!(!script(&at.join("hi.py")).0.contains("UNCHECKED"));
    let gains = [&["export"], &large[..], &["--to", "gains", "-o", "gains.json"]].concat();
    noctograph(at).args(gains).assert().success();
}

#[test]
fn a_person_beside_the_take_off_mark_stops_check_and_export() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let verdict = |people: &str| {
        let people = format!("sensors.lighthouse.people_m={people}");
        let subject = ["NOOR", "--room", "4x6x2.5", "--set", &people];
        let (code, report, _) = run(at, &[&["check"], &subject[..]].concat());
        let severity = finding(&report, "people")["severity"].clone();
        let to = ["--to", "cflib", "-o", "out.py"];
        (code, severity, run(at, &[&["export"], &subject[..], &to].concat()).0)
    };
    assert_eq!(verdict("[[1.5, -0.3, 0.25]]"), (1, "stop".into(), 1));
    assert_eq!(verdict("[[1.5, -2.9, 0.25]]"), (0, "fine".into(), 0));
    // A slower drone covers less distance when it fails.
    let careful = ["HI", "--room", "4x6x2.5", "--profile", "careful"];
    let (code, report, _) = run(at, &[&["check"], &careful[..]].concat());
    assert_eq!(code, 0, "{report}");
}

#[test]
fn preview_of_a_flight_that_check_stops_exits_1_and_writes_its_photo() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let legible = ["preview", "NOOR", "-o", "out"];
    assert_eq!(run(at, &[&legible[..], &SMALL].concat()).0, 0);
    std::fs::remove_dir_all(at.join("out")).unwrap();
    let fast = ["--profile", "careful", "--set", "plan.style.dark_speed_m_s=1"];
    let careful = [&legible[..], &SMALL, &fast].concat();
    let (code, report, _) = run(at, &careful[..]);
    assert_eq!((code, &report["legible"]), (1, &true.into()), "legible, not safe: {report}");
    assert!(report["stops"].as_str().unwrap().starts_with("speed (0.8"), "{report}");
    assert!(at.join("out/photo.png").is_file());
}

/// The default scene's PID controller lags behind a trajectory by half a second, and the lights
/// must be timed accordingly.
#[test]
fn the_lights_of_a_trajectory_are_timed_on_its_own_flight() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let to = |to: &str, name: &str, more: &[&str]| {
        let arguments = [&["export", "NOOR", "--to", to, "-o", name], more].concat();
        let (code, report, warnings) = run(at, &arguments);
        assert_eq!(code, 0, "{report}");
        warnings
    };
    let warnings = to("cflib", "noor.py", &["--mode", "trajectory"]);
    let preview = ["preview", "NOOR", "--as-exported", "compressed", "-o", "out"];
    let (code, report, previewed) = run(at, &[&preview[..], &SMALL].concat());
    assert_eq!((code, &report["read"]), (0, &"NOOR".into()), "{report}");
    assert_eq!(warnings, previewed, "export warns as its preview does");
    assert!(warnings.contains("lags behind a trajectory"), "{warnings}");

    // The preview's plan, the script and the tables of a show must contain the same light changes.
    let data = script(&at.join("noor.py")).1;
    let number = |value: &Value| value.as_f64().unwrap();
    let ahead_s = number(&data["trajectory"]["start_s"]);
    let lights = data["trajectory"]["lights"].as_array().unwrap();
    let flown: Vec<f64> = lights.iter().map(|light| number(&light[0]) - ahead_s).collect();
    let sent = data["lights"].as_array().unwrap();
    let sent: Vec<f64> = sent.iter().map(|light| number(&light[0]) - ahead_s).collect();
    assert_eq!(flown.len(), sent.len());
    let later: Vec<f64> = flown.iter().zip(&sent).map(|(flown, sent)| flown - sent).collect();
    let mean_s = later.iter().sum::<f64>() / 8.0_f64.max(later.len() as f64);
    assert!((0.2..0.8).contains(&mean_s), "the drone trails: {later:?}");

    let plan = std::fs::read_to_string(at.join("out/plan.csv")).unwrap();
    let mut rows = plan.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let columns = rows.next().unwrap();
    let column = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let (time, light) = (column("time_s"), column("light.headlights"));
    let rows: Vec<(f64, f64)> =
        rows.map(|row| (row[time].parse().unwrap(), row[light].parse().unwrap())).collect();
    let changes = rows.windows(2).filter(|pair| pair[0].1 != pair[1].1).map(|pair| pair[1].0);
    let changes: Vec<f64> = changes.collect();
    assert_eq!(changes.len(), flown.len());
    for (previewed_s, flown_s) in changes.iter().zip(&flown) {
        // The trajectory is timed by the drone's slow clock, so the script scales the times of its
        // lights accordingly.
        let on_board_s = previewed_s * SLOW_CLOCK;
        assert!((on_board_s - flown_s).abs() < 1e-4, "{previewed_s} s, {flown_s} s");
    }
    to("skyc", "noor.skyc", &[]);
    to("vviz", "noor.vviz", &[]);
    let show: Value =
        serde_json::from_slice(&std::fs::read(at.join("noor.vviz")).unwrap()).unwrap();
    let colors = show["performances"][0]["payloadDescription"][0]["payloadActions"].as_array();
    let first = colors.unwrap().iter().position(|color| color["r"] != 0).unwrap();
    // A viewer shows the design without the lag of a controller, so the lights are timed by the
    // design's positions.
    let ahead_s = changes[0] - first as f64 / 20.0;
    assert!((0.15..0.9).contains(&ahead_s), "{first} of 20 Hz, {changes:?}");
}

#[test]
fn a_scene_with_its_trajectory_on_board_is_exported_as_another() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let exported = |more: &[&str]| {
        let to = ["export", "I", "--to", "cflib", "--mode", "trajectory", "-o", "i.py"];
        assert_eq!(run(at, &[&to[..], more].concat()).0, 0);
        script(&at.join("i.py")).1["trajectory"]["hex"].clone()
    };
    let on_board = ["--set", "radio.drones=1", "--set", "radio.setpoints=on-board"];
    assert_eq!(exported(&[]), exported(&on_board), "its clock paces it once, on board");
}

#[test]
fn check_and_export_count_the_same_entries_of_the_timing_memory() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ring = ["--set", "plan.lights=[\"ring\"]", "--set", "light.ring=solid"];
    // A stroke that is lit for longer than an entry's maximum duration takes two entries.
    for (word, more, fits) in [
        ("I", &["--set", "plan.stroke_speed_m_s=0.02"][..], true),
        ("L", &["--set", "plan.stroke_speed_m_s=0.01"], true),
        ("L", &[], true),
        ("NOOR", &[], false),
    ] {
        let arguments = [&[word], &ring[..], more].concat();
        let (_, report, _) = run(at, &[&["check"], &arguments[..]].concat());
        let led = finding(&report, "LED memory");
        let to = ["--to", "cflib", "--mode", "trajectory", "-o", "script.py"];
        let (code, report, warnings) = run(at, &[&["export"], &arguments[..], &to].concat());
        assert_eq!(code, 0, "{word}: {report}");
        let timing = script(&at.join("script.py")).1["trajectory"]["timing"].clone();
        let entries = timing["entries"].as_array().map(Vec::len);
        assert_eq!(led["severity"] == "fine", fits, "{word}: {led}");
        if fits {
            assert_eq!(led["value"].as_f64().unwrap(), entries.unwrap() as f64, "{word}: {led}");
            assert!(!warnings.contains("timing memory"), "{warnings}");
        } else {
            assert_eq!(entries, None, "{word}");
            assert!(warnings.contains("LED timing memory"), "{word}: {warnings}");
        }
    }
}

const COLORS: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 60">
<path d="M10 50 L10 10 L40 10" fill="none" stroke="#ff0000"/>
<path d="M60 50 L90 50 L90 20" fill="none" stroke="#00ff00"/>
<path d="M50 10 L80 10" fill="none" stroke="#0000ff"/></svg>"##;

#[test]
fn no_stroke_of_a_drawing_ends_with_a_flash_of_the_next_color() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("colors.svg"), COLORS).unwrap();
    let deck = ["--set", "light.deck=color-led"];
    // If the design's positions are the setpoints, the drone lags behind, and its light is delayed
    // by the same time.
    let late = ["--set", "plan.reference=design", "--set", "letters.canvas_m=[1, 0.6]"];
    let late = [&late[..], &["--drawing", "colors.svg"]].concat();
    let to = ["--to", "cflib", "-o", "script.py"];
    let (code, report, _) = run(at, &[&["export"], &deck[..], &late, &to].concat());
    assert_eq!(code, 0, "{report}");
    let data = script(&at.join("script.py")).1;
    for lights in [&data["lights"], &data["trajectory"]["lights"]] {
        let values: Vec<u64> =
            lights.as_array().unwrap().iter().map(|light| light[2].as_u64().unwrap()).collect();
        assert_eq!(values.len(), 6, "each stroke has a color and an end: {values:x?}");
        let colors = values.iter().copied().filter(|value| *value > 0);
        assert!(values.iter().skip(1).step_by(2).all(|value| *value == 0), "{values:x?}");
        // Blue, green and red are distinguished by their strongest byte.
        let strongest =
            |color: u64| color.to_le_bytes().iter().enumerate().max_by_key(|it| it.1).unwrap().0;
        let mut shown: Vec<usize> = colors.map(strongest).collect();
        shown.sort_unstable();
        assert_eq!(shown, [0, 1, 2], "{values:x?}");
    }
}

#[test]
fn preview_and_meter_recommend_one_exposure_and_check_its_evenness() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let colors = ["--color", "red,orange,yellow,green,cyan,blue,magenta"];
    for subject in [&["NOOR"][..], &[&["Matilda"], &colors[..]].concat()] {
        let preview = [&["preview"], subject, &["-o", "out", "--backend", "cpu"]].concat();
        let camera = run(at, &preview).1["camera"].clone();
        let (_, meter, _) = run(at, &[&["meter"], subject].concat());
        let recommended = &meter["recommended"];
        for key in ["f_number", "iso"] {
            assert_eq!(recommended[key], camera[key], "{subject:?}: {recommended}, {camera}");
        }
        assert_eq!(recommended["trail_stops"], camera["metered"]["trail_stops"]);
        // The result is the same in a scene without metering.
        let off = ["--set", "camera.metering=off", "--set", "camera.f_number=22"];
        let (_, by_hand, _) = run(at, &[&["meter"], subject, &off].concat());
        assert_eq!(&by_hand["recommended"], recommended, "{subject:?}");

        let (_, checked, _) = run(at, &[&["check"], subject].concat());
        let lamps = meter["lamps"].as_array().unwrap().iter();
        let stops = |lamp: &&Value| lamp["median_stops"].as_f64().unwrap();
        let brightest = lamps.max_by(|a, b| stops(a).total_cmp(&stops(b))).unwrap();
        let evenness = &finding(&checked, "evenness")["value"];
        assert_eq!(evenness, &brightest["evenness_stops"], "{subject:?}: {brightest}");
    }
}

#[test]
fn findings_have_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let pair = ["check", "NO", "--style", "even", "--drones", "2"];
    let (_, report, _) = run(at, &pair);
    let drones: Vec<u64> = report["findings"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|finding| finding["check"] == "speed")
        .map(|finding| finding["drone"].as_u64().unwrap())
        .collect();
    assert_eq!(drones, [1, 2]);
    let apart = finding(&report, "separation");
    assert!(apart["value"].as_f64().unwrap() >= 0.3, "{apart}");
    let table = noctograph(at).args(pair).assert();
    table.stdout(
        predicate::str::contains("drone 2: ").and(predicate::str::contains("m or more apart")),
    );

    let (_, deck, _) = run(at, &["check", "HI", "--color", "red,blue"]);
    assert_eq!(finding(&deck, "headlights")["found"], "not used");
    let dwell = finding(&deck, "lit dwell");
    assert_eq!(dwell["severity"], "fine", "each color has a full level of its own: {dwell}");
    let (_, long, _) = run(at, &["check", "SOFIAANNA", "--set", "letters.canvas_m=[4, 1]"]);
    let memory = finding(&long, "memory");
    let beyond = memory["found"].as_str().unwrap().contains("too many");
    assert_eq!(beyond, memory["severity"] == "warning", "{memory}");
    assert!(beyond, "{memory}");
    let (_, small, _) = run(at, &["check", "HI", "--room", "1.5x1.5x1"]);
    let wanted = finding(&small, "altitude hold")["wanted"].as_str().unwrap().to_owned();
    assert!(!wanted.contains("0000"), "{wanted}");
    for (style, says) in [("even", false), ("team", true)] {
        let slow = ["--set", "plan.stroke_speed_m_s=0.02", "--set", "plan.lights=[\"headlights\"]"];
        let (_, report, _) = run(at, &[&["check", "I", "--style", style], &slow[..]].concat());
        let mut findings = report["findings"].as_array().unwrap().iter();
        let is_said = findings.any(|f| f["change"].as_str().unwrap().contains("--style even"));
        assert_eq!(is_said, says, "{style}: {report}");
    }
}
