//! Tests of hostile input, such as endless files, times and numbers beyond those of any drone, and
//! photos that refer to files.

use noctograph::photo::{self, Photo, PhotoData};

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
        &["locate", "--region", "--anchors", "/dev/zero"],
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
    let wanted = ["f.csv:11: column time_s", "are the times in milliseconds?"];
    fails(&["expose", "f.csv", "--word", "I"], &[("f.csv", &late)], &wanted);
    let log = format!("t,x,y,z\n{rows}10000000,0,0,1\n");
    fails(&["import", "l.csv"], &[("l.csv", &log)], &["of log", "are the times in milliseconds?"]);
    let wild = format!("{own}10,1e308,0,1,0,0,0\n");
    let wanted = ["f.csv:11: column x_m", "within"];
    fails(&["compare", "f.csv", "f.csv"], &[("f.csv", &wild)], &wanted);
    let wild = "t,x,y,z\n0.5,0,0,1\n1,1e9,0,1\n2,0,0,1\n";
    fails(&["import", "l.csv", "--max-gap", "9"], &[("l.csv", wild)], &["x_m", "within"]);
}

/// Writes a photo that contains an arbitrary text as its scene.
fn photo_of(scene: &str, path: &std::path::Path) {
    let scene_toml = Some(scene.to_owned());
    let photo = Photo::made(PhotoData {
        width_px: 64,
        height_px: 36,
        rgb8: vec![0; 64 * 36 * 3],
        scene_toml,
    });
    std::fs::write(path, photo::encode_png(&photo, None, &[])).unwrap();
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
    assert!(error.contains("two/flight.csv: found a flight with the digest"), "{error}");
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

/// Runs the command under a shell limit (`ulimit`) as an ordinary user, because a limit on
/// processes does not apply to the superuser.
#[cfg(target_os = "linux")]
fn limited(limit: &str, arguments: &str) -> (Option<i32>, String) {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let folder = tempfile::tempdir().unwrap();
    let open = std::fs::Permissions::from_mode(0o777);
    std::fs::set_permissions(folder.path(), open).unwrap();
    // The program is copied, because the ordinary user may not reach the superuser's folders.
    let program = noctograph(folder.path()).get_program().to_owned();
    std::fs::copy(program, folder.path().join("noctograph")).unwrap();
    let script = format!("ulimit {limit}; exec ./noctograph {arguments}");
    let superuser = folder.path().metadata().unwrap().uid() == 0;
    let user: &[&str] = if superuser { &["--reuid=65534", "--clear-groups"] } else { &[] };
    let run = std::process::Command::new("setpriv")
        .args(user)
        .args(["bash", "-c", &script])
        .current_dir(folder.path())
        .output()
        .unwrap();
    (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
}

#[cfg(target_os = "linux")]
#[test]
fn a_small_stack_and_no_threads_are_enough_but_not_both() {
    let small = "preview I --backend cpu --size 320x180 -o out";
    for limit in ["-s 64", "-s 1024", "-u 1"] {
        let (code, error) = limited(limit, small);
        assert!(matches!(code, Some(0 | 1)), "{limit}: {error}");
        assert_eq!(error.contains("allows no more thread"), limit == "-u 1", "{limit}: {error}");
    }
    let (code, error) = limited("-u 1; ulimit -s 1024", small);
    assert_eq!(code, Some(2), "{error}");
    assert!(error.contains("cannot start a thread, and the stack has only 1024 KiB"), "{error}");
    let (code, error) = limited("-v 400000", &format!("{small} --threads 64"));
    assert_eq!(code, Some(2), "{error}");
    assert!(error.contains("cannot start 64 threads"), "{error}");
}

#[test]
fn what_would_take_too_much_work_is_refused() {
    let drawing = |inner: &str| {
        format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9'>{inner}\
             <path d='M0 0h9v9' stroke='red'/></svg>"
        )
    };
    let style = |css: String| drawing(&format!("<style>{css}</style>{}", "<path/>".repeat(9000)));
    let entities: String = (0..30_000).map(|n| format!("<!ENTITY e{n} 'x'>")).collect();
    let attributes: String = (0..100_000).map(|n| format!(" a{n}=''")).collect();
    let long = "a".repeat(200_000);
    let files = [
        style("path{stroke-width:2;fill:none}".repeat(60_000)),
        drawing(&format!("<style>*{{font-family:{long}}}</style>{}", "<g/>".repeat(9000))),
        style(format!("{}b{{{}}}", "path,".repeat(50_000), "x:y;".repeat(50_000))),
        drawing(&format!("<path style='{}'/>", "fill:none;".repeat(20_000))),
        format!("<!DOCTYPE svg [{entities}]>") + &drawing(&"&e29999;".repeat(300_000)),
        drawing(&format!("<g{attributes}/>")),
    ];
    for file in files {
        let wanted = ["a.svg: found", "than an input may"];
        fails(&["plan", "--drawing", "a.svg", "-o", "plan.csv"], &[("a.svg", &file)], &wanted);
    }
}
