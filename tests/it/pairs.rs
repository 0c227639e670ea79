//! Tests of files that belong together. They are written completely or not at all, and read only if
//! they are unchanged.
#![cfg(unix)]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::json;

use noctograph::scene::CarriedScene;

use crate::cli::{names_in, noctograph, run_json};
use crate::safety::run;

const SMALL: [&str; 4] = ["--backend", "cpu", "--size", "320x180"];
const FIRST: [&str; 4] = ["plan", "HI", "--room", "4x6x2.5"];
const OTHER: [&str; 4] = ["plan", "I", "--room", "6x8x3"];

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

fn copy(folder: &Path, from: &str, to: &str) {
    std::fs::copy(folder.join(from), folder.join(to)).unwrap();
}

/// Replaces the first occurrence of a string in a file, which must contain the string.
fn edit(path: &Path, from: &str, to: &str) {
    let before = text(path);
    assert!(before.contains(from), "{from} in {}", path.display());
    std::fs::write(path, before.replacen(from, to, 1)).unwrap();
}

/// Returns the message of a refused command in one line.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let names = names_in(folder);
    let output = noctograph(folder).args(arguments).assert().code(2).get_output().clone();
    assert_eq!(names_in(folder), names, "{arguments:?}: nothing is written");
    assert!(output.stdout.is_empty(), "{arguments:?}: nothing is said of it");
    let said = String::from_utf8(output.stderr).unwrap();
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs a small preview, whose word may be illegible.
fn preview(folder: &Path, arguments: &[&str]) {
    let run = noctograph(folder).arg("preview").args(arguments).args(SMALL).output().unwrap();
    assert!(run.status.code().is_some_and(|code| code < 2), "{run:?}");
}

/// Returns a folder with the plans `a.csv` and `b.csv`, their flights `a-flown.csv` and
/// `b-flown.csv`, and the scenes of both.
fn flown() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (plan, name) in [(FIRST, "a"), (OTHER, "b")] {
        let [csv, flown] = ["", "-flown"].map(|end| format!("{name}{end}.csv"));
        run_json(folder.path(), &[&plan[..], &["-o", &csv]].concat());
        run_json(folder.path(), &["fly", &csv, "-o", &flown]);
    }
    folder
}

#[test]
fn the_scene_of_another_plan_or_flight_stops_every_verb_that_reads_it() {
    let folder = flown();
    let parent = folder.path();
    copy(parent, "b.scene.toml", "a.scene.toml");
    copy(parent, "b-flown.scene.toml", "a-flown.scene.toml");
    let verbs: [&[&str]; 16] = [
        &["check", "a.csv"],
        &["check", "b.csv", "a.csv"],
        &["check", "HI", "--scene", "a.csv"],
        &["export", "a.csv", "--to", "cflib"],
        &["export", "a.csv", "--to", "skyc", "--unchecked"],
        &["preview", "a.csv", "-o", "out"],
        &["fly", "a.csv"],
        &["meter", "a.csv"],
        &["fly", "--setpoints", "a-flown.csv"],
        &["import", "a-flown.csv", "-o", "again.csv"],
        &["expose", "a-flown.csv"],
        &["meter", "HI", "--flight", "a-flown.csv"],
        &["identify", "a-flown.csv"],
        &["plan", "HI", "--after", "a-flown.csv"],
        &["rank", "a.csv", "cf21", "--words", "I:1"],
        &["score", "a.png", "HI", "--scene", "a-flown.csv"],
    ];
    preview(parent, &["I", "-o", "photo"]);
    copy(parent, "photo/photo.png", "a.png");
    for arguments in verbs {
        let said = refused(parent, arguments);
        let csv = if arguments.concat().contains("a-flown") { "a-flown.csv" } else { "a.csv" };
        assert!(said.contains(&format!("error: {csv}: found a file with digest")), "{said}");
        let scene = csv.replace(".csv", ".scene.toml");
        assert!(said.contains(&scene) && said.contains("hint: write both files again"), "{said}");
    }
    // Files that are renamed together remain valid.
    for (from, to) in [("b.csv", "c.csv"), ("b.scene.toml", "c.scene.toml")] {
        copy(parent, from, to);
    }
    let (_, checked, said) = run(parent, &["check", "c.csv"]);
    assert_eq!(checked["profile"]["room_m"], json!([6.0, 8.0, 3.0]));
    assert!(!said.contains("warning"), "{said}");
    std::fs::remove_file(parent.join("a.scene.toml")).unwrap();
    let (_, checked, _) = run(parent, &["check", "a.csv"]);
    assert_eq!(checked["profile"]["room_m"], json!(null));
}

#[test]
fn a_scene_is_edited_freely_and_a_plan_with_a_word_of_its_author() {
    let folder = tempfile::tempdir().unwrap();
    let parent = folder.path();
    let wanted = |room_m: [f64; 3], arguments: &[&str]| {
        let (_, checked, said) = run(parent, &[&["check"], arguments].concat());
        assert_eq!(checked["profile"]["room_m"], json!(room_m), "{arguments:?}: {said}");
        said
    };
    run_json(parent, &[&FIRST[..], &["-o", "a.csv"]].concat());
    edit(&parent.join("a.scene.toml"), "room_m = [4.0, 6.0, 2.5]", "room_m = [5.0, 6.0, 2.5]");
    assert!(!wanted([5.0, 6.0, 2.5], &["a.csv"]).contains("warning"));

    // The edit preserves the number's value but changes the bytes of the file.
    edit(&parent.join("a.csv"), "\n0,", "\n0.0,");
    let said = refused(parent, &["check", "a.csv"]);
    assert!(said.contains("a.scene.toml is right only if you edited a.csv"), "{said}");
    let said = wanted([5.0, 6.0, 2.5], &["a.csv", "--scene", "a.scene.toml"]);
    assert!(said.contains("warning: a.csv: found a file with digest"), "{said}");
    // The room of a scene that belongs to another plan is not used.
    let (_, checked, said) = run(parent, &["check", "a.csv", "--scene", "pid"]);
    assert_eq!(checked["profile"]["room_m"], json!(null));
    assert!(said.contains("warning: a.csv: found a file with digest"), "{said}");
    // A preview of the edited plan rewrites both files.
    preview(parent, &["a.csv", "--scene", "a.scene.toml", "-o", "out"]);
    assert!(!wanted([5.0, 6.0, 2.5], &["out/plan.csv"]).contains("warning"));

    for broken in ["sha256 = 7", "[sha256]\na = 7", "[sha256]\n\"a.csv\" = \"12\""] {
        std::fs::write(parent.join("a.scene.toml"), format!("word = \"HI\"\n{broken}\n")).unwrap();
        let said = refused(parent, &["check", "a.csv"]);
        assert!(said.contains("a.scene.toml:2: sha256: found"), "{said}");
    }
}

#[test]
fn of_a_scene_without_a_digest_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let parent = folder.path();
    run_json(parent, &[&FIRST[..], &["-o", "a.csv"]].concat());
    let scene = parent.join("a.scene.toml");
    let (before, _) = text(&scene).split_once("\n# SHA-256 of the files").map(own).unwrap();
    std::fs::write(&scene, &before).unwrap();
    for verb in [&["check", "a.csv"][..], &["export", "a.csv", "--to", "cflib", "-o", "a.py"]] {
        let (code, _, said) = run(parent, verb);
        assert_eq!(code, 0, "{said}");
        assert!(
            said.contains("warning: a.scene.toml: the scene contains no digest"),
            "{verb:?}: {said}"
        );
    }
    // A scene that is passed with --scene is accepted without a warning.
    let (_, _, said) = run(parent, &["check", "a.csv", "--scene", "a.scene.toml"]);
    assert!(!said.contains("no digest"), "{said}");
    let (_, _, said) = run(parent, &["check", "a.csv", "--scene", "pid"]);
    assert!(said.contains("no digest"), "its room is kept: {said}");
    // A scene without a digest has the same effect as a scene with one.
    let bound = format!("{before}\n[sha256]\n\"a.csv\" = \"{}\"\n", "0".repeat(64));
    std::fs::write(parent.join("bound.toml"), bound).unwrap();
    let printed = |name| noctograph(parent).args(["scene", "--scene", name]).output().unwrap();
    assert_eq!(printed("bound.toml").stdout, printed("a.scene.toml").stdout);
}

fn own((before, after): (&str, &str)) -> (String, String) {
    (before.to_owned(), after.to_owned())
}

#[test]
fn a_folder_is_read_with_the_files_that_it_was_written_with() {
    let folder = tempfile::tempdir().unwrap();
    let parent = folder.path();
    let plan = |word: &str, n: &str, folder: &str| {
        let room = ["--room", "6x8x3", "-o", folder];
        run_json(parent, &[&["plan", word, "--drones", n], &room[..]].concat());
    };
    plan("HI", "2", "both");
    plan("NO", "2", "other");
    let (_, checked, said) = run(parent, &["check", "both"]);
    assert_eq!(checked["drones"], json!(2), "{said}");
    run_json(parent, &["fly", "both/plan-1.csv", "both/plan-2.csv", "-o", "both"]);
    let said = refused(parent, &["check", "both"]);
    assert!(
        said.contains("the files with which both/scene.toml was written, flight-1.csv"),
        "{said}"
    );

    // The plan of one drone is replaced by that of another word, and then removed.
    plan("HI", "2", "both");
    copy(parent, "other/plan-2.csv", "both/plan-2.csv");
    let said = refused(parent, &["check", "both"]);
    assert!(said.contains("both/plan-2.csv: found a file with digest"), "{said}");
    std::fs::remove_file(parent.join("both/plan-2.csv")).unwrap();
    let said = refused(parent, &["check", "both"]);
    assert!(said.contains("both: found no plan-2.csv"), "{said}");
    assert_eq!(run(parent, &["check", "both/plan-1.csv"]).1["drones"], json!(1), "named alone");

    // Writing plans for fewer drones removes the surplus plans of an earlier set, but no other
    // plans.
    plan("NO", "3", "three");
    plan("HI", "2", "three");
    assert_eq!(names_in(&parent.join("three")), ["plan-1.csv", "plan-2.csv", "scene.toml"]);
    assert_eq!(run(parent, &["check", "three"]).1["drones"], json!(2));
    copy(parent, "other/plan-1.csv", "three/plan-3.csv");
    let before = text(&parent.join("three/scene.toml"));
    let said = refused(parent, &["plan", "OH", "--drones", "2", "-o", "three"]);
    assert!(
        said.contains("three: found plan-3.csv, wanted plan files of at most 2 drones"),
        "{said}"
    );
    assert_eq!(text(&parent.join("three/scene.toml")), before, "nothing is written");
    preview(parent, &["HI", "--drones", "2", "-o", "less"]);
    preview(parent, &["I", "-o", "less"]);
    let numbered = names_in(&parent.join("less")).into_iter().filter(|name| name.contains('-'));
    assert_eq!(numbered.count(), 0, "plans and flights of two drones");

    preview(parent, &["I", "-o", "out"]);
    for name in ["plan.csv", "flight.csv"] {
        let name = format!("out/{name}");
        let before = text(&parent.join(&name));
        std::fs::write(parent.join(&name), text(&parent.join("both/plan-1.csv"))).unwrap();
        let said = refused(parent, &["fly", &name]);
        assert!(said.contains(&format!("{name}: found a file with digest")), "{said}");
        std::fs::write(parent.join(&name), before).unwrap();
    }
    run_json(parent, &["check", "out/plan.csv"]);
}

/// A limit on the file size simulates a disk that is full when the scene is written, but not yet
/// when its plan is written.
#[test]
fn a_full_disk_leaves_the_pair_of_before() {
    let folder = flown();
    let parent = folder.path();
    // The limit, in blocks of 512 bytes, is more than the plan and less than the scene.
    let size = |name: &str| std::fs::metadata(parent.join(name)).unwrap().len();
    assert!(size("b.csv") < 64 * 512 && size("b.scene.toml") > 64 * 512, "{}", size("b.csv"));
    let before = ["a.csv", "a.scene.toml"].map(|name| text(&parent.join(name)));
    let limited = "trap '' XFSZ; ulimit -f 64; exec \"$0\" \"$@\"";
    let full = Command::new("sh")
        .args(["-c", limited])
        .arg(assert_cmd::cargo::cargo_bin("noctograph"))
        .args(OTHER)
        .args(["-o", "a.csv"])
        .current_dir(parent)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&full.stderr).into_owned();
    assert_eq!(full.status.code(), Some(2), "{said}");
    assert!(said.contains("a.scene.toml") && said.contains("File too large"), "{said}");
    let names = names_in(parent);
    assert!(names.iter().all(|name| !name.starts_with('.')), "nothing half-written: {names:?}");
    let after = ["a.csv", "a.scene.toml"].map(|name| text(&parent.join(name)));
    assert!(before == after, "the pair of before");
}

/// Separate file systems of several sizes fill up, if the test is allowed to mount them.
#[test]
fn a_disk_that_fills_up_leaves_whole_sets() {
    let folder = flown();
    let script = r#"
        mkdir disk && mount -t tmpfs -o size=600k tmpfs disk || { echo skipped; exit; }
        new() { case $1 in
            pair) "$0" plan HI --room 4x6x2.5 -o disk/p.csv;;
            fleet) "$0" plan NO --drones 2 --room 6x8x3 -o disk/p;;
            flown) "$0" import b-flown.csv -o disk/p.csv;;
        esac; }
        for kind in pair fleet flown; do for left in 8 24 48 56 72 96 144; do
            rm -rf disk/*
            case $kind in
                fleet) "$0" plan HI --drones 2 --room 4x6x2.5 -o disk/p;;
                *) cp b.csv disk/p.csv; sed s/'"b.csv"'/'"p.csv"'/ b.scene.toml > disk/p.scene.toml;;
            esac
            before=$(find disk -type f | sort | xargs sha256sum)
            free=$(df --output=avail -k disk | tail -1)
            head -c $(((free - left) * 1024)) /dev/zero > disk/fill
            new $kind; code=$?
            rm disk/fill
            [ "$before" = "$(find disk -type f | sort | xargs sha256sum)" ] && same=old || same=new
            echo "$kind $left $code $same" >&3
        done; done"#;
    let run = Command::new("unshare")
        .args([
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            &format!("{{ {script}\n}} 3>&1 >/dev/null"),
        ])
        .arg(assert_cmd::cargo::cargo_bin("noctograph"))
        .current_dir(folder.path())
        .output();
    let Ok(run) = run else { return };
    let told = String::from_utf8(run.stdout).unwrap();
    let rows: Vec<Vec<&str>> = told.lines().map(|row| row.split(' ').collect()).collect();
    assert!(rows.is_empty() || rows.len() == 21, "{told}{}", String::from_utf8_lossy(&run.stderr));
    for row in &rows {
        assert!(matches!(row[2..], ["2", "old"] | ["0", "new"]), "{row:?}");
    }
    let has = |code: &str| rows.iter().any(|row| row[2] == code);
    assert!(rows.is_empty() || has("0") && has("2"), "full for some and not for all: {told}");
}

/// Returns `plan` as a separate process without output.
fn plan(folder: &Path, word: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("noctograph"));
    command.current_dir(folder).args(word).args(["-o", "p.csv"]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// True if `p.csv` and its scene form one of the complete pairs. Checks that the pair is accepted
/// if and only if it is complete.
fn check_pair(folder: &Path, whole: &[[String; 2]]) -> bool {
    let pair = ["p.csv", "p.scene.toml"].map(|name| text(&folder.join(name)));
    let is_whole = whole.contains(&pair);
    let carried = CarriedScene::read(&folder.join("p.csv"));
    let is_bound = carried.is_ok_and(|carried| carried.unwrap().is_bound);
    assert_eq!(is_bound, is_whole, "its digest tells");
    is_whole
}

/// Returns the pairs of both plans, of which the second one remains in the folder.
fn both_pairs(folder: &Path) -> [[String; 2]; 2] {
    [FIRST, OTHER].map(|word| {
        assert!(plan(folder, &word).status().unwrap().success(), "planned");
        ["p.csv", "p.scene.toml"].map(|name| text(&folder.join(name)))
    })
}

#[test]
fn a_kill_leaves_a_pair_or_one_that_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = both_pairs(folder.path());
    let begun = std::time::Instant::now();
    plan(folder.path(), &FIRST).status().unwrap();
    let run = begun.elapsed();
    for point in 0..30 {
        let mut child =
            plan(folder.path(), &if point % 2 == 0 { OTHER } else { FIRST }).spawn().unwrap();
        std::thread::sleep(run * (10 + 4 * point) / 100 + Duration::from_micros(137));
        let _ = child.kill();
        child.wait().unwrap();
        check_pair(folder.path(), &whole);
    }
    // A kill between the two renames leaves the new scene beside the old plan, or vice versa.
    for (csv, scene) in [(0, 1), (1, 0)] {
        std::fs::write(folder.path().join("p.csv"), &whole[csv][0]).unwrap();
        std::fs::write(folder.path().join("p.scene.toml"), &whole[scene][1]).unwrap();
        assert!(!check_pair(folder.path(), &whole));
        refused(folder.path(), &["check", "p.csv"]);
    }
}

#[test]
fn two_writers_of_one_name_leave_the_pair_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let whole = both_pairs(folder.path());
    for round in 0..12 {
        let mut writers = [FIRST, OTHER].map(|word| plan(folder.path(), &word).spawn().unwrap());
        for writer in &mut writers {
            assert!(writer.wait().unwrap().success());
        }
        assert!(check_pair(folder.path(), &whole), "round {round}");
    }
}
