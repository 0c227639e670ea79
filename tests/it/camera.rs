//! Tests of cameras on the command line: errors, warnings, and the light meter.

use predicates::prelude::*;

use crate::cli::{fails, json, noctograph};

/// Returns a light trace of a lamp that moves along x for two seconds at the height of the word.
fn streak() -> String {
    let mut csv = "t,x,y,z,r,g,b\n".to_owned();
    for i in 0..=200 {
        let t = f64::from(i) / 100.0;
        csv += &format!("{t},{:.4},0,0.75,1,1,1\n", 0.2 * t);
    }
    csv
}

const FIXED: &str = "preset = \"ae483-2022\"\n[camera]\nwidth_px = 320\nheight_px = 180\nframing.kind = \"fixed\"\n";

#[test]
fn cameras_that_cannot_be_are_refused_and_leave_nothing() {
    let broken = [
        ("f_number = 0", "camera.f_number"),
        ("iso = -1", "camera.iso"),
        ("shutter_open_s = 5.0\nshutter_close_s = 3.0", "camera.shutter_close_s"),
        (
            "framing.position_m = [0.2, -0.02, 0.75]\nframing.target_m = [0.2, 9.0, 0.75]",
            "from lamp `trace`",
        ),
        ("framing.target_m = [0.15, -3.0, 0.75]", "camera.framing.target_m"),
        ("framing.position_m = [nan, 0.0, 0.0]", "camera.framing.position_m"),
        ("framing.orientation_wxyz = [0.0, 0.0, 0.0, 0.0]", "camera.framing.orientation_wxyz"),
        ("focus_m = 0.0", "camera.focus_m"),
        ("lens.distortion = [inf, 0.0, 0.0, 0.0]", "camera.lens.distortion"),
        ("lens = \"kit-16mm\"\nf_number = 2.0", "camera.f_number"),
        ("body = \"obscura\"", "obscura"),
    ];
    for (keys, text) in broken {
        let scene = format!("{FIXED}{keys}\n");
        let files = [("a.csv", &*streak()), ("s.toml", &*scene)];
        let arguments = ["expose", "a.csv", "--backend", "cpu", "--scene", "s.toml"];
        fails(&arguments, &files, &[text]);
    }
}

#[test]
fn a_camera_behind_the_word_is_refused() {
    let scene = format!("{FIXED}framing.position_m = [0.15, 3.0, 0.75]\n");
    let files = [("a.csv", &*streak()), ("s.toml", &*scene)];
    let arguments = ["expose", "a.csv", "--backend", "cpu", "--scene", "s.toml", "--word", "NO"];
    fails(&arguments, &files, &["camera.framing.position_m", "behind the word", "mirrored"]);
}

#[test]
fn a_light_trace_with_nan_is_refused_with_line_and_column() {
    let broken = streak().replacen("0.0200,0,", "0.0200,NaN,", 1);
    let scene = ("s.toml", FIXED);
    let arguments = ["expose", "a.csv", "--scene", "s.toml"];
    fails(&arguments, &[("a.csv", &broken), scene], &["a.csv:12", "column y", "NaN"]);
}

#[test]
fn what_falls_outside_is_told_by_side_and_centimetres_and_auto_mends_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.csv"), streak()).unwrap();
    let scene = format!(
        "{FIXED}framing.position_m = [1.84, -3.0, 0.75]\nframing.target_m = [1.84, 0.0, 0.75]\n"
    );
    std::fs::write(folder.path().join("s.toml"), scene).unwrap();
    let arguments = ["expose", "a.csv", "--backend", "cpu", "--scene", "s.toml", "--word", "I"];
    let run = || {
        let mut command = noctograph(folder.path());
        command.args(arguments);
        command
    };
    let warning = predicate::str::contains("light is outside the picture: 30 cm on the left");
    run().assert().success().stderr(warning);
    let outside = predicate::str::contains("word is outside");
    run().args(["--camera", "auto"]).assert().success().stderr(outside.not());
}

#[test]
fn the_meter_says_how_much_to_stop_down() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.csv"), streak()).unwrap();
    std::fs::write(folder.path().join("s.toml"), FIXED).unwrap();
    let meter = |more: &[&str]| {
        let mut command = noctograph(folder.path());
        command.args(["meter", "--flight", "a.csv", "--scene", "s.toml"]).args(more);
        command.assert().success().get_output().stdout.clone()
    };
    let json = json(&meter(&["--json", "--target-stops", "1"]));
    let lamp = &json["lamps"][0];
    let stops = lamp["median_stops"].as_f64().unwrap();
    // Doubling the f-number reduces the light by two stops.
    let f_number = lamp["advice"]["f_number"].as_f64().unwrap();
    assert!((2.0 * libm::log2(f_number / 8.0) - (stops - 1.0)).abs() < 1e-9, "{lamp}");

    let scene = format!("{FIXED}f_number = {f_number}\n");
    std::fs::write(folder.path().join("s.toml"), scene).unwrap();
    let table = String::from_utf8(meter(&[])).unwrap();
    assert!(table.lines().all(|line| line.len() <= 80), "{table}");
    assert!(table.contains("+1.0"), "where it was asked for: {table}");
}

/// The recommendations of the two verbs once differed by two stops.
#[test]
fn preview_and_meter_recommend_the_same_exposure() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = |verb: &str, arguments: &[&str]| {
        let mut command = noctograph(at);
        command.arg(verb).args(arguments).args(["--json", "--backend", "cpu"]);
        json(&command.args(["--size", "320x180"]).output().unwrap().stdout)
    };
    // The words are legible, because the advice on an illegible word takes ten flights.
    for scene in [
        &["NO"][..],
        &["NO", "--set", "photo.ambient_cd_m2=0.2", "--set", "camera.lens=28mm"],
        &["NOOR", "--scene", "ae483-2022"],
        &["NO", "--room", "4x3x2.5", "--set", "camera.body=iphone-15-pro"],
        &["NO", "--color", "red", "--set", "camera.body=pixel-8-pro"],
        &["N O", "--drones", "2", "--set", "camera.body=a6400", "--set", "camera.lens=kit-16mm"],
    ] {
        let preview = &run("preview", &[scene, &["-o", "out"]].concat())["camera"];
        let meter = run("meter", scene);
        let (set, said) = (&preview["metered"], &meter["recommended"]);
        for key in ["trail_stops", "room_stops", "gave_way", "filter_stops", "longest_s"] {
            // The team's scene does not use the light meter.
            assert!(set.is_null() || set[key] == said[key], "{scene:?}: {set} and {said}");
        }
        if !set.is_null() {
            assert_eq!([&preview["f_number"], &preview["iso"]], [&said["f_number"], &said["iso"]]);
            let again = run("meter", &["--scene", "out/photo.png"]);
            assert_eq!(again["recommended"], *said, "{scene:?}: of the photo's own scene");
        }
    }
}

#[test]
fn a_telephone_is_told_what_it_lacks_and_no_aperture() {
    let folder = tempfile::tempdir().unwrap();
    let meter = |more: &[&str]| {
        let mut command = noctograph(folder.path());
        command.args(["meter", "NOOR", "--set", "camera.body=galaxy-s24"]).args(more);
        command.output().unwrap().stdout
    };
    let table = String::from_utf8(meter(&[])).unwrap().replace('\n', " ");
    assert!(table.contains("f/1.8 and ISO 50"), "{table}");
    assert!(
        table.contains("neutral-density filter of") && table.contains("light-trail mode"),
        "{table}"
    );
    assert!(!table.contains("f/5") && !table.contains("f/6"), "it has no such aperture: {table}");
    let json = json(&meter(&["--json", "--target-stops", "0"]));
    assert!(json["lamps"][0]["advice"]["f_number"].is_null(), "{json}");
}

#[test]
fn a_poster_has_its_dots_and_says_how_large_it_prints() {
    let folder = tempfile::tempdir().unwrap();
    let run = |size: &str| {
        let mut command = noctograph(folder.path());
        command.args(["preview", "NOOR", "--backend", "cpu", "--size", size]).assert()
    };
    run("A5@60").success();
    let file = std::fs::File::open(folder.path().join("noctograph-out/photo.png")).unwrap();
    let reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
    let info = reader.info();
    assert_eq!((info.width, info.height), (496, 350), "210 mm by 148 mm");
    assert_eq!(info.pixel_dims.map(|dims| dims.xppu), Some(2362), "60 dots in 25.4 mm");
    run("A0@600").code(2).stderr(predicate::str::contains("fewer dots per inch"));
}
