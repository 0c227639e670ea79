//! Tests of words that are file names, files that are moved with their scene, texts from other
//! systems, and names that are not valid Unicode.

use std::path::Path;

use crate::cli::{names_in, noctograph};

const LOGO: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 50">
<path d="M5 45 L50 5 L95 45" fill="none" stroke="black"/></svg>"#;
const SMALL: [&str; 2] = ["--size", "64x36"];

fn succeeds(folder: &Path, arguments: &[&str]) -> String {
    let run = noctograph(folder).args(arguments).output().unwrap();
    let error = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.code().is_some_and(|code| code < 2), "{arguments:?}: {error}");
    String::from_utf8_lossy(&run.stdout).into_owned()
}

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let run = noctograph(folder).args(arguments).assert().code(2);
    String::from_utf8_lossy(&run.get_output().stderr).into_owned()
}

#[test]
fn a_plan_in_capitals_is_that_plan_and_a_word_is_never_guessed_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    succeeds(here, &["plan", "NO"]);
    let plan = std::fs::read(here.join("plan.csv")).unwrap();
    std::fs::write(here.join("PLAN.CSV"), &plan).unwrap();
    std::fs::copy(here.join("plan.scene.toml"), here.join("PLAN.scene.toml")).unwrap();
    let checked = succeeds(here, &["check", "PLAN.CSV"]);
    assert_eq!(checked, succeeds(here, &["check", "plan.csv"]));

    std::fs::write(here.join("plan.txt"), &plan).unwrap();
    std::fs::write(here.join("HI"), "").unwrap();
    std::fs::create_dir(here.join("out")).unwrap();
    std::fs::create_dir(here.join("NO")).unwrap();
    std::fs::write(here.join("out/plan.csv"), &plan).unwrap();
    for verb in ["check", "preview", "export", "meter", "plan", "scene", "coverage"] {
        for word in ["plan.txt", "PLAN.TXT.json", "HI", "out"] {
            let takes_plans = !["plan", "scene", "coverage"].contains(&verb);
            if word == "out" && !takes_plans {
                continue;
            }
            let more = if verb == "export" { &["--to", "cflib"][..] } else { &[] };
            let error = refused(here, &[&[verb, word], more].concat());
            let way = format!("`--word {word}` writes this word");
            assert!(error.contains("word or file") && error.contains(&way), "{verb}: {error}");
        }
    }
    assert!(refused(here, &["score", "photo.png", "plan.txt"]).contains("plan.txt"));
    assert!(refused(here, &["check", "gone.CSV"]).contains("gone.CSV"));
    // A folder without plans does not count as a plan, and the value of --word is always a word.
    succeeds(here, &["check", "NO"]);
    for verb in ["check", "plan", "scene", "coverage"] {
        succeeds(here, &[verb, "--word", "HI"]);
    }
    std::fs::write(here.join("NO/PLAN-2.CSV"), &plan).unwrap();
    assert!(refused(here, &["check", "NO"]).contains("wanted plan-1.csv first"));
}

/// Writes a scene with a drawing, a font and a background in separate folders.
fn illustrated(project: &Path) {
    for name in ["art", "faces", "rooms"] {
        std::fs::create_dir_all(project.join(name)).unwrap();
    }
    std::fs::write(project.join("art/logo.svg"), LOGO).unwrap();
    let fonts = Path::new(env!("CARGO_MANIFEST_DIR")).join("fonts/ae483.strokes");
    std::fs::copy(fonts, project.join("faces/own.strokes")).unwrap();
    succeeds(project, &["preview", "I", "--size", "64x36", "-o", "before"]);
    std::fs::copy(project.join("before/photo.png"), project.join("rooms/photo.png")).unwrap();
}

#[test]
fn a_scene_travels_with_its_files_and_tells_no_folder_of_this_machine() {
    let folder = tempfile::tempdir().unwrap();
    let secret = folder.path().join("somebody");
    illustrated(&secret);
    let absolute = secret.join("art/logo.svg").display().to_string();
    let room = ["--set", "photo.background=rooms/photo.png", "--report"];
    let drawn = ["preview", "--drawing", &absolute, "-o", "../drawn"];
    succeeds(&secret, &[&drawn[..], &SMALL, &room].concat());
    let written = ["preview", "I", "--font", "faces/own.strokes", "-o", "../written"];
    succeeds(&secret, &[&written[..], &SMALL, &room].concat());
    succeeds(&secret, &["plan", "--drawing", "art/logo.svg", "-o", "plan.csv"]);
    std::fs::create_dir(folder.path().join("plans")).unwrap();
    succeeds(&secret, &["plan", "--drawing", &absolute, "-o", "../plans/plan.csv"]);
    succeeds(&secret, &["scene", "--drawing", "art/logo.svg", "-o", "art/my.toml"]);

    // Everything except the project is moved to another folder.
    let there = folder.path().join("there");
    std::fs::create_dir(&there).unwrap();
    for name in ["drawn", "written", "plans"] {
        std::fs::rename(folder.path().join(name), there.join(name)).unwrap();
    }
    for path in ["drawn", "written", "plans"].map(|name| there.join(name)) {
        for name in names_in(&path).iter().map(|name| path.join(name)) {
            let bytes = std::fs::read(&name).unwrap();
            let told = bytes.windows(8).any(|part| part == b"somebody");
            assert!(!told, "{} tells a folder of this machine", name.display());
        }
    }
    let beside = ["plan.csv", "plan.logo.svg", "plan.scene.toml"];
    assert_eq!(names_in(&there.join("plans")), beside);
    let inside = ["flight.csv", "logo.svg", "photo.png", "plan.csv", "report.html", "scene.toml"];
    // The background's copy is renamed, because its name is also that of the photo.
    assert_eq!(names_in(&there.join("drawn")), [&["2-photo.png"][..], &inside].concat());
    std::fs::rename(&secret, folder.path().join("moved")).unwrap();
    let moved = folder.path().join("moved");
    for (here, scene) in [
        (&there, "drawn"),
        (&there, "written/scene.toml"),
        (&there, "written/photo.png"),
        (&moved, "plan.csv"),
        (&moved, "art/my.toml"),
    ] {
        succeeds(here, &[&["preview", "--scene", scene, "-o", "again"][..], &SMALL].concat());
    }
    for (name, again) in [("drawn/photo.png", "drawn"), ("written/photo.png", "written")] {
        let named = ["preview", "--scene", again, "-o", "again"];
        succeeds(&there, &named);
        let [a, b] = [name, "again/photo.png"].map(|name| std::fs::read(there.join(name)).unwrap());
        assert!(a == b, "{name}: the same bytes from another place");
    }
    succeeds(&there, &["check", "plans/plan.csv"]);
}

#[test]
fn a_scene_names_its_files_from_its_own_folder_on_as_windows_does_too() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("scenes/art")).unwrap();
    std::fs::write(folder.path().join("scenes/art/logo.svg"), LOGO).unwrap();
    for drawing in ["art/logo.svg", r"art\logo.svg", "./art/logo.svg"] {
        let toml = format!("[letters]\ndrawing = '{drawing}'\n");
        std::fs::write(folder.path().join("scenes/my.toml"), toml).unwrap();
        succeeds(folder.path(), &["plan", "--scene", "scenes/my.toml"]);
    }
    let scene = std::fs::read_to_string(folder.path().join("plan.scene.toml")).unwrap();
    assert!(scene.contains("drawing = \"scenes/art/logo.svg\""), "{scene}");
}

#[test]
fn a_text_of_powershell_is_read_wherever_a_text_is() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let write = |name: &str, text: &str| {
        let text = format!("\u{feff}{}", text.replace('\n', "\r\n"));
        let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        std::fs::write(here.join(name), bytes).unwrap();
    };
    write("my.toml", &succeeds(here, &["scene", "NO"]));
    write("logo.svg", LOGO);
    write("words.txt", "I:1\n");
    write("drawn.json", r#"{"strokes": [[[0, 0], [1, 1], [2, 0]]]}"#);
    let fonts = Path::new(env!("CARGO_MANIFEST_DIR")).join("fonts/ae483.strokes");
    write("own.strokes", &std::fs::read_to_string(fonts).unwrap());
    succeeds(here, &["plan", "--scene", "my.toml", "-o", "a.csv"]);
    for (name, again) in [("a.csv", "b.csv"), ("a.scene.toml", "a.scene.toml")] {
        write(again, &std::fs::read_to_string(here.join(name)).unwrap());
    }
    succeeds(here, &["check", "a.csv"]);
    succeeds(here, &["check", "b.csv"]);
    succeeds(here, &["plan", "--drawing", "logo.svg"]);
    succeeds(here, &["plan", "NO", "--font", "own.strokes"]);
    succeeds(here, &["rank", "my.toml", "--words", "words.txt"]);
    succeeds(here, &["plan", "--drawing", "drawn.json"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_name_that_is_no_unicode_is_shown_and_never_a_panic() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let odd = |end: &str| OsStr::from_bytes(&[b"\xff\xfe", end.as_bytes()].concat()).to_owned();
    std::fs::write(folder.path().join(odd("t.csv")), "x,y,z\n0,0,0\n0,0,1\n0,0,1\n").unwrap();
    let run = |arguments: &[&str], name: &OsStr| {
        let run = noctograph(folder.path()).args(arguments).arg(name).output().unwrap();
        assert!(run.status.code().is_some_and(|code| code <= 2), "{arguments:?}: {run:?}");
        String::from_utf8_lossy(&run.stderr).into_owned()
    };
    run(&["preview", "I", "--size", "64x36", "--report", "-o"], &odd("d"));
    assert!(run(&["plan", "漢", "-o"], &odd("p.csv")).contains("`--font`"), "advice is given");
    for verb in ["import", "identify", "expose", "locate", "check", "compare"] {
        run(&[verb], &odd("t.csv"));
    }
    // A scene's files are also found in such a folder.
    std::fs::create_dir(folder.path().join(odd("d2"))).unwrap();
    std::fs::write(folder.path().join(odd("d2")).join("logo.svg"), LOGO).unwrap();
    let inside = folder.path().join(odd("d2"));
    succeeds(&inside, &["plan", "--drawing", "logo.svg"]);
    succeeds(&inside, &["check", "plan.csv"]);
}
