//! Tests of the command line's files, output and errors.

use std::path::Path;

use assert_cmd::Command;
use predicates::prelude::*;

/// Returns the command, to be run in the given folder with the CPU backend.
pub(crate) fn noctograph(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("noctograph").unwrap();
    command.current_dir(folder);
    command
}

pub(crate) fn json(output: &[u8]) -> serde_json::Value {
    serde_json::from_slice(output).expect("one JSON object on stdout")
}

/// Returns all verbs in the order of the help.
pub(crate) fn verbs() -> Vec<String> {
    let help = noctograph(Path::new(".")).arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let (_, groups) = help.split_once("\n\nBegin with:\n").unwrap();
    let (first, rest) = groups.split_once("\n\nFurther verbs").unwrap();
    let (rest, _) = rest.split_once("\n\n").unwrap();
    let first = first.lines().filter_map(|line| line.split_whitespace().next());
    let rest = rest.lines().skip(1).filter_map(|line| line.rsplit_once("  "));
    let rest = rest.flat_map(|(_, verbs)| verbs.split(", "));
    let verbs: Vec<String> = first.chain(rest).map(|verb| verb.trim().to_owned()).collect();
    assert!(verbs.len() >= 20, "{verbs:?}");
    verbs
}

pub(crate) fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

const SMALL: [&str; 4] = ["--backend", "cpu", "--size", "640x360"];

#[test]
fn preview_writes_five_files_and_says_what_it_read() {
    let folder = tempfile::tempdir().unwrap();
    let run = noctograph(folder.path()).args(["preview", "NOOR"]).args(SMALL).assert().success();
    run.stdout(predicate::str::contains("NOOR reads as NOOR: legible").and(
        predicate::str::contains("RMSE").and(predicate::str::contains("noctograph-out/photo.png")),
    ));
    let names = names_in(&folder.path().join("noctograph-out"));
    assert_eq!(names, ["flight.csv", "photo.png", "plan.csv", "scene.toml", "verdict.json"]);
    // There is no verdict.json for a word with letters that the reader does not know.
    noctograph(folder.path()).args(["preview", "Ж"]).args(SMALL).assert().success();
    let names = names_in(&folder.path().join("noctograph-out"));
    assert_eq!(names, ["flight.csv", "photo.png", "plan.csv", "scene.toml"]);
}

#[test]
fn preview_prints_json_with_the_promised_fields() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = noctograph(folder.path());
    let output = command.args(["preview", "NOOR", "--json", "-o", "a"]).args(SMALL).output();
    let json = json(&output.unwrap().stdout);
    assert_eq!((&json["word"], &json["read"]), (&"NOOR".into(), &"NOOR".into()));
    assert_eq!((&json["legible"], &json["backend"]), (&true.into(), &"cpu".into()));
    assert_eq!(json["letters"].as_array().unwrap().len(), 4);
    for field in ["expected", "best", "p", "rivals"] {
        assert!(!json["letters"][0][field].is_null(), "letters[].{field}");
    }
    let flight = &json["flights"][0];
    assert!(flight["duration_s"].as_f64().unwrap() > 20.0);
    assert_eq!(flight["rmse_m"].as_array().unwrap().len(), 3);
    assert_eq!(json["photo_sha256"].as_str().unwrap().len(), 64);
    let digest = flight["sha256"].as_str().unwrap();
    assert_eq!(digest.len(), 64);
    for name in ["photo.png", "verdict.json"] {
        let bytes = std::fs::read(folder.path().join("a").join(name)).unwrap();
        let named = bytes.windows(64).any(|text| text == digest.as_bytes());
        assert!(named, "{name} names the flight that it shows");
    }
    let again = noctograph(folder.path()).args(["import", "a/flight.csv"]).assert().success();
    again.stdout(predicate::str::contains(format!("digest    {digest}")));
    assert_eq!(json["files"].as_array().unwrap().len(), 5);
    assert!(json["adapter"].is_string());

    // All outputs have the same schema. verdict.json equals the output of `score` and is a part of
    // the output of `preview`.
    let file = std::fs::read(folder.path().join("a/verdict.json")).unwrap();
    let file: serde_json::Value = serde_json::from_slice(&file).unwrap();
    let file = file.as_object().unwrap();
    file.iter().for_each(|(key, value)| assert_eq!(&json[key], value, "{key}"));
    let score = ["score", "a/photo.png", "--flight", "a/flight.csv"];
    let scored = run_json(folder.path(), &score);
    let keys = |object: &serde_json::Map<String, serde_json::Value>| {
        object.keys().filter(|key| *key != "files").cloned().collect::<Vec<_>>()
    };
    assert_eq!(keys(scored.as_object().unwrap()), keys(file));
    for key in ["word", "read", "legible", "readability", "letters", "flight_sha256"] {
        assert_eq!(scored[key], file[key], "{key}");
    }
}

/// Runs a command that must succeed, and returns the JSON that it prints.
pub(crate) fn run_json(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let run = noctograph(folder).args(arguments).arg("--json").assert().success();
    json(&run.get_output().stdout)
}

#[test]
fn two_drones_share_a_word_in_one_command_and_stage_by_stage() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        noctograph(folder.path()).args(arguments).assert().success();
    };
    let preview = ["preview", "HE", "--style", "even", "--drones", "2", "-o", "out"];
    run(&[&preview[..], &SMALL].concat());
    let names = names_in(&folder.path().join("out"));
    let wanted = ["flight-1.csv", "flight-2.csv", "photo.png", "plan-1.csv", "plan-2.csv"];
    assert_eq!(names[..5], wanted);
    let scene = ["--scene", "out/scene.toml"];
    run(&[&["plan"], &scene[..]].concat());
    run(&[&["fly", "plans/plan-1.csv", "plans/plan-2.csv"], &scene[..]].concat());
    let flights = ["expose", "flights/flight-1.csv", "flights/flight-2.csv", "--backend", "cpu"];
    run(&[&flights, &scene[..]].concat());
    let plans = ["preview", "plans/plan-1.csv", "plans/plan-2.csv", "-o", "again"];
    run(&[&plans, &scene[..], &SMALL].concat());
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    for (alone, whole) in [
        ("plans/plan-2.csv", "out/plan-2.csv"),
        ("flights/flight-2.csv", "out/flight-2.csv"),
        ("photo.png", "out/photo.png"),
        ("again/photo.png", "out/photo.png"),
        ("again/verdict.json", "out/verdict.json"),
    ] {
        assert!(bytes(alone) == bytes(whole), "{alone} differs");
    }
}

#[test]
fn keys_of_the_scene_are_set_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), "[plan]\nstroke_speed_m_s = 0.3\n").unwrap();
    let set = ["--set", "plan.style=team", "--set", "vehicle.center_of_mass_m=[0, 0.002]"];
    let scene = [&["scene", "ON", "--scene", "s.toml"], &set[..]].concat();
    let json = run_json(folder.path(), &scene);
    assert_eq!(json["plan"]["stroke_speed_m_s"], 0.3, "a key of the file stays");
    assert_eq!(json["plan"]["style"]["kind"], "team");
    assert_eq!(json["plan"]["light_clock"], "setpoint", "a default of the style");
    assert_eq!(json["vehicle"]["center_of_mass_m"][1], 0.002);
    let by_flag = ["scene", "ON", "--scene", "s.toml", "--style", "team"];
    assert_eq!(run_json(folder.path(), &by_flag)["plan"], json["plan"], "--style is the same");
    fails(&["scene", "--set", "camera.izo=3"], &[], &["izo", "camera.iso"]);
    fails(&["scene", "--set", "vehicle.mass_kg=-1"], &[], &["vehicle.mass_kg", "-1"]);
    fails(&["scene", "--scene", "tunde"], &[], &["tunde", "did you mean tuned?"]);
}

#[test]
fn lines_are_at_most_80_columns_wide() {
    let folder = tempfile::tempdir().unwrap();
    let verbs = verbs();
    let mut commands: Vec<Vec<&str>> = vec![vec!["--help"], vec!["-h"]];
    for verb in &verbs {
        commands.extend([vec![verb, "--help"], vec![verb, "-h"]]);
    }
    for command in [
        "preview I --backend cpu --size 160x90",
        "plan I --style even",
        "fly plan.csv --seed 1",
        "expose flight.csv --backend cpu --size 160x90",
        "score photo.png I",
        "read photo.png",
        "check I --style even",
        "meter --flight flight.csv",
        "coverage I --step 0.2",
        "coverage --scene two-drones-three-anchors",
        "locate --region --scene two-drones-three-anchors",
        "locate --region",
        "import flight.csv --word I -o b.csv",
        "compare flight.csv b.csv -o plots",
        "identify flight.csv",
        "gains --bryson",
        "scene",
        "scene --style even",
        "scene --preset bzzz",
        "rank team pid --words I:2",
        "tune team --words I:1 --budget 4 --test-words O --test-seeds 1",
        "preview NO漢R",
        "scene --set camera.izo=3",
        "fly none.csv",
        "preview I --size 0x0",
        "generate man",
        "notices",
    ] {
        commands.push(command.split_whitespace().collect());
    }
    for command in commands {
        let output = noctograph(folder.path()).args(&command).output().unwrap();
        let text = [output.stdout, output.stderr].concat();
        for line in String::from_utf8(text).unwrap().lines() {
            let width = line.chars().count();
            // The list of a font's characters is one long word that cannot be wrapped.
            assert!(width <= 80 || line.contains("ABCDEF"), "{command:?}: {width}: {line}");
        }
    }
}

#[test]
fn completions_and_man_pages_are_generated() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let run = noctograph(folder.path()).args(["generate", "completions", shell]).assert();
        run.success().stdout(predicate::str::contains("compare-photo"));
    }
    let run = ["generate", "completions", "powershell", "-o", "noctograph.ps1"];
    noctograph(folder.path()).args(run).assert().success();
    let script = std::fs::read_to_string(folder.path().join("noctograph.ps1")).unwrap();
    assert!(script.contains("compare-photo"), "{script}");
    noctograph(folder.path()).args(["generate", "man"]).assert().success();
    let page = std::fs::read_to_string(folder.path().join("man/noctograph-rank.1")).unwrap();
    assert!(page.contains("shard"), "{page}");
    let names = names_in(&folder.path().join("man"));
    assert!(names.iter().any(|name| name == "noctograph-generate-man.1"), "{names:?}");
    assert!(!names.iter().any(|name| name.contains("device")), "what is hidden: {names:?}");
}

#[test]
fn a_build_says_what_it_is_made_of_and_whose() {
    let folder = tempfile::tempdir().unwrap();
    let printed = |arguments: &[&str]| {
        let run = noctograph(folder.path()).args(arguments).assert().success();
        String::from_utf8(run.get_output().stdout.clone()).unwrap()
    };
    let source = noctograph::studies::SOURCE;
    assert!(source.len() == 16 && source.chars().all(|c| c.is_ascii_hexdigit()), "{source}");
    assert!(printed(&["--version"]).ends_with(&format!("source {source})\n")));
    let notices = printed(&["--notices"]);
    assert_eq!(notices, printed(&["notices"]));
    for name in ["wgpu", "Roboto", "Hershey", "Noctograph contributors", "Apache License"] {
        assert!(notices.contains(name), "{name}");
    }
}

#[test]
fn the_same_command_makes_the_same_bytes_and_its_scene_makes_them_again() {
    let folder = tempfile::tempdir().unwrap();
    let preview = |arguments: &[&str]| {
        let mut command = noctograph(folder.path());
        command.arg("preview").args(arguments).args(SMALL).assert().success();
    };
    preview(&["ON", "--seed", "3", "-o", "a"]);
    preview(&["ON", "--seed", "3", "-o", "b"]);
    preview(&["--scene", "a/scene.toml", "-o", "c"]);
    preview(&["ON", "--seed", "4", "-o", "d"]);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    for name in ["photo.png", "flight.csv", "plan.csv", "scene.toml", "verdict.json"] {
        assert_eq!(bytes(&format!("a/{name}")), bytes(&format!("b/{name}")), "{name} twice");
        assert_eq!(bytes(&format!("a/{name}")), bytes(&format!("c/{name}")), "{name} by scene");
    }
    assert_ne!(bytes("a/flight.csv"), bytes("d/flight.csv"), "another seed, another flight");
}

#[test]
fn the_stages_alone_make_the_photo_of_the_preview() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        noctograph(folder.path()).args(arguments).assert().success();
    };
    let scene = ["--scene", "out/scene.toml"];
    run(&[&["preview", "LOG", "-o", "out"], &SMALL[..]].concat());
    run(&[&["plan", "LOG"], &scene[..]].concat());
    run(&[&["fly", "plan.csv"], &scene[..]].concat());
    run(&[&["expose", "flight.csv", "--backend", "cpu"], &scene[..]].concat());
    run(&["score", "photo.png", "LOG"]);
    for name in ["plan.csv", "flight.csv", "photo.png"] {
        let alone = std::fs::read(folder.path().join(name)).unwrap();
        let whole = std::fs::read(folder.path().join("out").join(name)).unwrap();
        assert!(alone == whole, "{name} differs");
    }
}

#[test]
fn a_flight_becomes_pictures_of_every_kind() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        noctograph(folder.path()).args(arguments).assert().success();
    };
    run(&["plan", "I"]);
    run(&["fly", "plan.csv"]);
    let expose = ["expose", "flight.csv", "--word", "I", "--backend", "cpu", "--size", "192x108"];
    let pixels = 192 * 108 * 3;
    let kinds = [
        ("a.png", "png16", &b"\x89PNG"[..], pixels),
        ("b.exr", "exr", b"\x76\x2f\x31\x01", 4 * pixels),
    ];
    for (name, format, magic, least_bytes) in kinds {
        run(&[&expose[..], &["-o", name, "--format", format]].concat());
        let bytes = std::fs::read(folder.path().join(name)).unwrap();
        assert!(bytes.starts_with(magic), "{name}");
        assert!((least_bytes..least_bytes + 2 * pixels).contains(&bytes.len()), "{name}");
        run(&[&expose[..], &["-o", name, "--format", format]].concat());
        assert!(bytes == std::fs::read(folder.path().join(name)).unwrap(), "{name} twice");
    }
    run(&[&expose[..], &["-o", "d.exr"]].concat());
    let [named, meant] = ["b.exr", "d.exr"].map(|name| std::fs::read(folder.path().join(name)));
    assert!(named.unwrap() == meant.unwrap(), "the name says the kind");
}

#[test]
fn a_missing_background_and_an_effect_out_of_range_are_named() {
    let scene = "[photo]\nbackground = \"nowhere/room.png\"\n";
    let arguments = ["preview", "I", "--scene", "s.toml", "--backend", "cpu", "--size", "64x36"];
    fails(&arguments, &[("s.toml", scene)], &["nowhere/room.png"]);
    let scene = "[photo]\nglare_frac = 2.0\n";
    fails(&arguments, &[("s.toml", scene)], &["s.toml:2: photo.glare_frac", "from 0 to 0.5"]);
}

#[test]
fn a_photo_of_another_word_exits_with_1() {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["preview", "LOG"]).args(SMALL).assert().success();
    noctograph(folder.path())
        .args(["score", "noctograph-out/photo.png", "NUT"])
        .assert()
        .code(1)
        .stdout(predicate::str::contains("NUT reads as").and(predicate::str::contains("NOT")));
}

#[test]
fn the_printed_scene_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = noctograph(folder.path()).args(["scene", "LOG"]).output().unwrap().stdout;
    std::fs::write(folder.path().join("my.toml"), scene).unwrap();
    let preview = ["preview", "--scene", "my.toml"];
    noctograph(folder.path()).args(preview).args(SMALL).assert().success();
}

/// Runs a command that must fail with exit code 2, print each text, and leave no files behind.
pub(crate) fn fails(arguments: &[&str], files: &[(&str, &str)], texts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    let before = names_in(folder.path());
    let run = noctograph(folder.path()).args(arguments).assert().code(2);
    let stderr = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    // Line breaks are ignored in the comparison, because messages are wrapped.
    let stderr = stderr.split_whitespace().collect::<Vec<_>>().join(" ");
    for text in texts.iter().chain(&["hint: "]) {
        assert!(stderr.contains(text), "{arguments:?} does not say {text:?}: {stderr}");
    }
    assert!(!stderr.contains("panicked"), "{stderr}");
    assert_eq!(names_in(folder.path()), before, "{arguments:?} left something behind");
}

#[test]
fn an_empty_word_is_refused() {
    fails(&["preview", ""], &[], &["an empty word", "at least one letter"]);
}

#[test]
fn a_character_without_a_letter_is_named_with_its_position() {
    fails(&["preview", "NO漢R"], &[], &["position 3", "'漢'", "Noto"]);
    let team = ["preview", "NOÖR", "--scene", "ae483-2022"];
    fails(&team, &[], &["position 3", "'Ö'", "one of ABC"]);
}

#[test]
fn a_negative_mass_is_refused_with_line_and_key() {
    let scene = "# mine\n[vehicle]\nmass_kg = -0.035\n";
    let arguments = ["preview", "NOOR", "--scene", "s.toml"];
    fails(&arguments, &[("s.toml", scene)], &["s.toml:3: vehicle.mass_kg", "-0.035", "from"]);
}

#[test]
fn an_unwritable_folder_is_refused_before_the_flight() {
    fails(
        &["preview", "NOOR", "-o", "file/out"],
        &[("file", "")],
        &["file/out", "a file has this folder's name"],
    );
    fails(&["plan", "NOOR", "-o", "nowhere/plan.csv"], &[], &["nowhere/plan.csv"]);
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    for size in ["0x0", "100000x100000"] {
        fails(&["preview", "NOOR", "--size", size], &[], &[size, "sides of 1 to"]);
    }
}

#[test]
fn a_plan_with_nan_is_refused_with_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["plan", "I"]).assert().success();
    let plan = std::fs::read_to_string(folder.path().join("plan.csv")).unwrap();
    let mut lines: Vec<String> = plan.lines().map(str::to_owned).collect();
    lines[6] = lines[6].replacen(",0,", ",NaN,", 1);
    let broken = lines.join("\n");
    let texts = ["p.csv:7: column ", "NaN", "a finite number"];
    fails(&["fly", "p.csv"], &[("p.csv", &broken)], &texts);
}

#[test]
fn files_that_are_missing_or_of_another_kind_are_named() {
    fails(&["fly", "none.csv"], &[], &["none.csv"]);
    fails(&["expose", "none.csv", "--word", "NO"], &[], &["none.csv"]);
    fails(&["score", "none.png", "NO"], &[], &["none.png"]);
    fails(&["score", "a.png", "NO"], &[("a.png", "no image")], &["a.png", "a PNG image"]);
    fails(&["fly", "a.csv"], &[("a.csv", "time_s\n0\n")], &["a.csv:1", "a column x_m"]);
}

#[test]
fn gains_prints_both_matrices_for_people_and_for_programs() {
    let folder = tempfile::tempdir().unwrap();
    let run =
        noctograph(folder.path()).args(["gains", "--bryson", "--scene", "team"]).assert().success();
    let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    for shown in ["0.004877", "-50.715", "8 observable", "not: psi", "r = [", "stable loop: 0.1"] {
        assert!(text.contains(shown), "{shown} in\n{text}");
    }

    let output =
        noctograph(folder.path()).args(["gains", "--scene", "team", "--json"]).output().unwrap();
    assert!(output.stderr.is_empty(), "no warning at the usual lag");
    let json = json(&output.stdout);
    let shape = |name: &str| {
        let rows = json[name].as_array().unwrap();
        (rows.len(), rows[0].as_array().unwrap().len())
    };
    assert_eq!((shape("K"), shape("L")), ((4, 12), (8, 3)));
    assert_eq!((shape("A"), shape("B")), ((12, 12), (12, 4)));
    let forward_from_pitch = json["A"][6][4].as_f64().unwrap();
    assert!((forward_from_pitch - 9.81).abs() < 1e-9);
    assert!((json["K"][1][0].as_f64().unwrap() - 0.004_876_789_371_788_077).abs() < 1e-13);
    assert_eq!((&json["observability_rank"], &json["unobservable"][0]), (&8.into(), &"psi".into()));
    assert!(json["regulator_poles"][0][0].as_f64().unwrap() < 0.0);
}

#[test]
fn warnings_name_what_has_no_effect() {
    let folder = tempfile::tempdir().unwrap();
    let stderr = |args: &str| {
        let run = noctograph(folder.path()).args(args.split(' ')).assert().success();
        String::from_utf8(run.get_output().stderr.clone()).unwrap()
    };
    assert!(stderr("plan PIX --drones 5").contains("3 of 5 drones fly"));
    let on_board = "--set radio.setpoints=on-board";
    assert!(stderr(&format!("plan I {on_board}")).contains("radio.setpoints has no effect"));
    let rank = stderr(&format!("rank cf21 --words I:1 --conditions evening {on_board}"));
    assert!(!rank.contains("no effect"), "conditions have a radio: {rank}");
}

#[test]
fn gains_shows_the_loops_of_the_scenes_own_controller() {
    let folder = tempfile::tempdir().unwrap();
    for (scene, kind, loop_of) in
        [("pid", "pid", "rate pitch"), ("geometric", "geometric", "attitude y")]
    {
        let mut command = noctograph(folder.path());
        let run = command.args(["gains", "--scene", scene]).assert().success();
        let text = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        for shown in [kind, loop_of, " dB", "linearized at hover"] {
            assert!(text.contains(shown), "{shown} in\n{text}");
        }
        assert!(
            !text.contains("K (x - x_des)"),
            "no gain of a regulator that does not fly:\n{text}"
        );
        assert!(text.lines().all(|line| line.chars().count() <= 80), "80 columns:\n{text}");
        let json = run_json(folder.path(), &["gains", "--scene", scene]);
        assert_eq!((&json["controller"], &json["K"]), (&kind.into(), &serde_json::Value::Null));
        assert!(json["gains"][loop_of]["p"].as_f64().unwrap() > 0.0);
        let margins = json["lagging_margins"].as_array().expect("stable with its motors");
        assert_eq!(margins.len(), 4);
        for one in margins.iter().filter(|one| !one["gain_up"].is_null()) {
            let [up, db] = ["gain_up", "gain_up_db"].map(|key| one[key].as_f64().unwrap());
            assert!((db - 20.0 * libm::log10(up)).abs() < 1e-9, "{one}");
        }
    }
}

#[test]
fn a_spread_of_two_flights_does_not_claim_nine_tenths() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["preview", "I", "--spread", "2", "-o", "a"];
    // A single stroke may be illegible, which gives exit code 1.
    let output = noctograph(folder.path()).args(args).args(SMALL).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("all 2 flights, and 33 % of further flights,"), "{text}");
    let svg = std::fs::read_to_string(folder.path().join("a/spread.svg")).unwrap();
    assert!(svg.contains("all 2 flights"), "{svg}");
    assert!(!text.contains("90 %") && !svg.contains("90 %"), "{text}");
}

#[test]
fn gains_warns_of_a_gain_that_only_motors_without_lag_obey() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = noctograph(folder.path());
    let run = command.args(["gains", "--scene", "team", "--motor-lag", "0.12"]).assert().success();
    run.stdout(predicate::str::contains("unstable"))
        .stderr(predicate::str::contains("stable without motor lag, but not with"));
    noctograph(folder.path()).args(["gains", "--motor-lag", "2"]).assert().code(2);
}

#[test]
fn a_spread_has_a_band_photos_and_verdicts() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["preview", "HI", "--spread", "3", "--size", "320x180", "-o", "out", "--json"];
    let output = noctograph(folder.path()).args(args).output().unwrap();
    let spread = &json(&output.stdout)["spread"];
    let flights = spread["flights"].as_array().unwrap();
    assert_eq!(flights.len(), 3);
    assert!(flights.iter().all(|flight| flight["readability"].is_number()), "{flights:?}");
    let half_m = |key: &str| spread[key][0]["half_width_m"][2].as_f64().unwrap();
    assert!(half_m("bands") > 0.0 && half_m("bands_within") > 0.0);
    for name in ["spread.svg", "spread-xz.svg", "spread.png"] {
        assert!(folder.path().join("out").join(name).exists(), "{name}");
    }
    assert_eq!(spread["bands"][0]["holds_frac"], 0.5, "three flights: half of further ones");
    let near = ["preview", "HI", "--spread", "3", "--conditions", "rom"];
    fails(&near, &[], &["did you mean room?"]);
}

#[test]
fn a_word_that_does_not_read_is_followed_by_settings_that_mend_it() {
    let folder = tempfile::tempdir().unwrap();
    let set = ["--set", "camera.shutter_close_s=4", "--size", "320x180"];
    let run = noctograph(folder.path()).args(["preview", "HI"]).args(set).output().unwrap();
    let text = String::from_utf8_lossy(&run.stdout).into_owned();
    let advice = text.lines().skip_while(|line| *line != "P(read)  change").nth(1).unwrap();
    assert!(advice.starts_with('+'), "{text}");
    let (_, flags) = advice.split_once("  ").unwrap();
    let mut mended = noctograph(folder.path());
    let mended =
        mended.args(["preview", "HI"]).args(set).args(flags.trim().split(' ')).output().unwrap();
    assert_eq!(mended.status.code(), Some(0), "{}", String::from_utf8_lossy(&mended.stdout));
}
