//! Hostile input: endless files, times and numbers beyond a drone's world, and photos that name
//! files.

use noctograph::photo::Photo;

use crate::cli::{fails, noctograph};

#[cfg(target_os = "linux")]
#[test]
fn an_endless_file_is_refused_by_every_reader() {
    for arguments in [
        &["preview", "I", "--scene", "/dev/zero"][..],
        &["preview", "I", "--lighthouse", "/dev/zero"],
        &["preview", "I", "--camera-from", "/dev/zero"],
        &["fly", "/dev/zero"],
        &["expose", "/dev/zero", "--word", "I"],
        &["import", "/dev/zero"],
        &["score", "/dev/zero", "I"],
        &["read", "/dev/zero"],
        &["sweep", "run", "/dev/zero"],
        &["rank", "team", "--conditions", "/dev/zero"],
    ] {
        fails(arguments, &[], &["hint: "]);
    }
}

#[test]
fn times_of_days_and_numbers_beyond_a_drones_world_are_refused() {
    let rows: String = (0..9).map(|i| format!("{i},0,0,1\n")).collect();
    let own = format!("time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad\n{rows}")
        .replace("1\n", "1,0,0,0\n");
    let late = format!("{own}10000000,0,0,1,0,0,0\n");
    let wanted = ["f.csv:11: column time_s", "are these milliseconds?"];
    fails(&["expose", "f.csv", "--word", "I"], &[("f.csv", &late)], &wanted);
    let log = format!("t,x,y,z\n{rows}10000000,0,0,1\n");
    fails(&["import", "l.csv"], &[("l.csv", &log)], &["of log", "are these milliseconds?"]);
    let wild = format!("{own}10,1e308,0,1,0,0,0\n");
    let wanted = ["f.csv:11: column x_m", "within"];
    fails(&["compare", "f.csv", "f.csv"], &[("f.csv", &wild)], &wanted);
    let wild = "t,x,y,z\n0,0,0,1\n1,1e9,0,1\n2,0,0,1\n";
    fails(&["import", "l.csv", "--max-gap", "9"], &[("l.csv", wild)], &["x_m", "within"]);
}

/// A photo whose scene is somebody's text.
fn photo_of(scene: &str, path: &std::path::Path) {
    let scene_toml = Some(scene.to_owned());
    let photo = Photo { width_px: 64, height_px: 36, rgb8: vec![0; 64 * 36 * 3], scene_toml };
    photo.write_png(std::fs::File::create(path).unwrap(), None, &[]).unwrap();
}

#[test]
fn a_photo_opens_no_file_unless_it_is_trusted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.png");
    let secret = folder.path().join("secret.strokes");
    std::fs::write(&secret, "a password\n").unwrap();
    let score = |more: &[&str]| {
        let mut command = noctograph(folder.path());
        let run = command.args(["score", "photo.png", "I"]).args(more).assert();
        let error = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        error.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    for key in ["font", "drawing"] {
        let ending = if key == "font" { "strokes" } else { "svg" };
        for name in [format!("../secret.{ending}"), secret.display().to_string()] {
            let name = if key == "drawing" { name.replace("strokes", "svg") } else { name };
            photo_of(&format!("word = \"I\"\n[letters]\n{key} = '{name}'\n"), &path);
            let error = score(&[]);
            let wanted = format!("letters.{key}: found the path of a file");
            assert!(error.contains(&wanted) && error.contains("--trust"), "{error}");
            assert!(!error.contains("password"), "{error}");
        }
    }
    photo_of(&format!("word = \"I\"\n[letters]\nfont = '{}'\n", secret.display()), &path);
    assert!(score(&["--trust"]).contains("a password"), "trusted, it is opened");
    let error = score(&["--set", "letters.font=simplex"]);
    assert!(!error.contains("path of a file"), "a font that was typed: {error}");
}

#[test]
fn what_is_echoed_cannot_steer_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.png");
    photo_of(
        "word = \"I\"\n[letters]\nfont = \"\\u001b]0;title\\u0007\\u009b31m\\u202e\"\n",
        &path,
    );
    let run = noctograph(folder.path()).args(["score", "photo.png"]).assert().code(2);
    let error = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(error.chars().all(|c| c == '\n' || !c.is_control()), "{error:?}");
    assert!(!error.contains('\u{202e}'), "{error:?}");
}

#[test]
fn one_number_too_many_is_named_in_any_array() {
    let texts = [
        "[[sensors.lighthouse.stations]]\nposition_m = [1.0, 2.0, 3.0, 4.0]\n",
        "[[light.fixtures]]\nname = \"a\"\n[[light.fixtures.dies]]\nchromaticity = [0.3, 0.3, 0.3]\n",
        "[plan]\nmean_error_m = [0.0, 0.0, 0.0, 0.0]\n",
        "[camera.framing]\nkind = \"fixed\"\nposition_m = [0.0, -3.0, 1.0, 1.0]\n",
    ];
    for scene in texts {
        fails(&["plan", "I", "--scene", "s.toml"], &[("s.toml", scene)], &["s.toml:", "length"]);
    }
}

#[test]
fn the_flight_of_another_photo_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| noctograph(folder.path()).args(arguments).assert();
    let small = ["--backend", "cpu", "--size", "320x180", "-o"];
    run(&[&["preview", "I"], &small[..], &["one", "--seed", "1"]].concat());
    run(&[&["preview", "I"], &small[..], &["two", "--seed", "2"]].concat());
    let other = run(&["score", "one/photo.png", "--flight", "two/flight.csv"]).code(2);
    let error = String::from_utf8_lossy(&other.get_output().stderr).into_owned();
    assert!(error.contains("two/flight.csv: found a flight of digest"), "{error}");
    let own = run(&["score", "one/photo.png", "--flight", "one/flight.csv"]);
    assert_ne!(own.get_output().status.code(), Some(2));
}

#[test]
fn usage_and_figures_beyond_their_range_come_with_a_hint() {
    for arguments in [
        &["preview", "I", "--sett", "a=b"][..],
        &["nothing"],
        &["preview", "I", "--threads", "65535"],
        &["tune", "team", "--longest", "nan", "--budget", "1"],
        &["plan", "I", "--set", "rates.attitude_hz=650"],
        &["rank", "team", "--words", "I:19999999"],
        &[
            "preview",
            "I",
            "--size",
            "8000x8000",
            "--set",
            "plan.setpoint_interval_s=0.002",
            "--set",
            "plan.reference=inverse",
        ],
    ] {
        fails(arguments, &[], &["hint: "]);
    }
    let corners = ["read", "a.png", "--corners", "-5,0 9,0 9,9 -5,9"];
    fails(&corners, &[("a.png", "no image")], &["a.png: found no PNG"]);
}
