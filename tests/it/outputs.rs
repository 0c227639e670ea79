//! Tests of output files if another object exists at a file's path, or if writing is interrupted.
#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::cli::{names_in, noctograph};

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// Returns the program as a separate process with redirected standard streams.
fn process(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("noctograph"));
    command.current_dir(folder).args(arguments).stdin(Stdio::null());
    command
}

#[test]
fn standard_output_takes_a_file_and_the_table_goes_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["plan", "I"]).assert().success();
    let wanted = text(&folder.path().join("plan.csv"));
    for name in ["-", "/dev/stdout"] {
        let run = noctograph(folder.path()).args(["plan", "I", "-o", name]).assert().success();
        let output = run.get_output();
        assert!(output.stdout == wanted.as_bytes(), "{name}: the plan and nothing else");
        assert!(String::from_utf8_lossy(&output.stderr).contains("setpoints"), "{name}");
    }
    assert_eq!(names_in(folder.path()), ["plan.csv", "plan.scene.toml"]);
    let run = noctograph(folder.path()).args(["preview", "I", "-o", "-"]).assert().code(2);
    assert!(String::from_utf8_lossy(&run.get_output().stderr).contains("a folder"));
}

#[test]
fn what_is_refused_leaves_nothing_and_names_stay_in_their_folder() {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["plan", "HI"]).assert().success();
    let refusals: [(&[&str], &[&str], &str); 3] = [
        (&["export", "HI", "--to", "poly4d"], &["--word", "NO"], "wanted HI"),
        (&["hold", "--runs", "1"], &["--scenario", "all,clam"], "calm"),
        (&["locate", "--region"], &["--observer", "filter"], "--observer"),
    ];
    for (command, more, wanted) in refusals {
        let run = noctograph(folder.path()).args(command).args(more).assert().code(2);
        let error = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        assert!(error.contains(wanted), "{command:?}: {error}");
        assert_eq!(names_in(folder.path()), ["plan.csv", "plan.scene.toml"], "{command:?}");
    }
    let export = ["export", "../X", "--to", "crazyswarm2", "--unchecked"];
    noctograph(folder.path()).args(export).assert().success();
    let hold = ["hold", "--runs", "1", "--model", "scalar", "--scenario", "step,step"];
    noctograph(folder.path()).args(hold).output().unwrap();
    let names = ["X-export", "noctograph-hold", "plan.csv", "plan.scene.toml"];
    assert_eq!(names_in(folder.path()), names);
    let held = names_in(&folder.path().join("noctograph-hold"));
    assert_eq!(held, ["hold.html", "hold.json", "step-scalar.csv", "step-scalar.svg"]);
}

#[test]
fn devices_pipes_and_links_stay_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let kind = |path: &str| std::fs::metadata(path).unwrap().file_type();
    noctograph(folder.path()).args(["plan", "I", "-o", "/dev/null"]).assert().success();
    assert!(kind("/dev/null").is_char_device(), "still a device");

    assert!(Command::new("mkfifo").arg(at("pipe.csv")).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = at("pipe.csv");
        move || text(&pipe)
    });
    noctograph(folder.path()).args(["plan", "I", "-o", "pipe.csv"]).assert().success();
    let piped = reader.join().unwrap();
    assert!(piped.starts_with("time_s,") && piped.ends_with('\n'), "all of it came through");
    assert!(std::fs::metadata(at("pipe.csv")).unwrap().file_type().is_fifo());

    std::fs::write(at("far.csv"), "old").unwrap();
    std::os::unix::fs::symlink("far.csv", at("link.csv")).unwrap();
    noctograph(folder.path()).args(["plan", "I", "-o", "link.csv"]).assert().success();
    assert!(at("link.csv").is_symlink() && text(&at("far.csv")) == piped);
}

#[test]
fn a_full_disk_and_a_closed_pipe_are_errors_or_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let run = noctograph(folder.path()).args(["plan", "I", "-o", "/dev/full"]).assert().code(2);
    let error = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(error.contains("/dev/full") && error.contains("hint: "), "{error}");
    for arguments in [&["--help"][..], &["--version"], &["plan", "I", "-o", "-"], &["scene"]] {
        let status =
            process(folder.path(), arguments).stdout(full()).stderr(Stdio::null()).status();
        assert_eq!(status.unwrap().code(), Some(2), "{arguments:?} on a full disk");
    }
    let mut child = process(folder.path(), &["plan", "I", "-o", "-"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let mut error = String::new();
    child.stderr.take().unwrap().read_to_string(&mut error).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "a reader that went away: {error}");
}

/// A limit on the file size simulates a disk that fills up while a file is written.
#[test]
fn a_disk_that_fills_up_leaves_the_old_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    let files = ["flight.csv", "out/photo.png", "out/scene.toml"];
    files.iter().for_each(|name| std::fs::write(folder.path().join(name), "old").unwrap());
    noctograph(folder.path()).args(["plan", "I"]).assert().success();
    // The file size is limited to 8 blocks of 512 bytes, and the signal of the limit is ignored, so
    // that the write fails.
    let limited = "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\"";
    let small = ["preview", "I", "--backend", "cpu", "--size", "320x180", "-o", "out"];
    for arguments in [&["fly", "plan.csv"][..], &small] {
        let run = Command::new("sh")
            .args(["-c", limited])
            .arg(assert_cmd::cargo::cargo_bin("noctograph"))
            .args(arguments)
            .current_dir(folder.path())
            .output()
            .unwrap();
        let error = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains("File too large") && error.contains("hint: "), "{error}");
    }
    assert!(files.iter().all(|name| text(&folder.path().join(name)) == "old"));
    let names = ["flight.csv", "out", "plan.csv", "plan.scene.toml"];
    assert_eq!(names_in(folder.path()), names, "nothing half-written");
    assert_eq!(names_in(&out), ["photo.png", "scene.toml"], "nothing half-written");
}

/// A limit on the file size, a command and its further arguments, and the files that the command
/// writes.
type Fills<'a> = (&'a str, &'a [&'a str], &'a [&'a str], &'a [&'a str]);

/// A limit on the file size simulates a disk that fills up between two files of a run. In a second
/// case, a folder exists under the name of the last file.
#[test]
fn the_files_of_a_study_are_of_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let limited = "trap '' XFSZ; ulimit -f $1; shift; exec \"$0\" \"$@\"";
    let rank = ["rank", "cf21", "--words", "I:2"];
    let tune = ["tune", "cf21", "--words", "I:1", "--budget", "34", "--test-seeds", "0"];
    // Each limit, in blocks of 512 bytes, allows the first files but not the last.
    let cases: [Fills<'_>; 2] = [
        ("16", &rank, &[], &["ranking.csv", "ranking.json", "flights.csv", "photos.png"]),
        ("8", &tune, &[], &["candidates.csv", "pareto.svg", "scene.toml"]),
    ];
    for (blocks, command, more, names) in cases {
        let out = folder.path().join(command[0]);
        std::fs::create_dir(&out).unwrap();
        names.iter().for_each(|name| std::fs::write(out.join(name), "old").unwrap());
        let run = |shell: &mut Command| {
            let all = [command, more, &["-o", command[0]]].concat();
            shell.args(all).current_dir(folder.path()).output().unwrap()
        };
        let program = assert_cmd::cargo::cargo_bin("noctograph");
        let full = run(Command::new("sh").args(["-c", limited]).arg(&program).arg(blocks));
        let error = String::from_utf8_lossy(&full.stderr).into_owned();
        assert_eq!(full.status.code(), Some(2), "{command:?}: {error}");
        assert!(error.contains("File too large"), "{command:?}: {error}");
        for name in names {
            assert_eq!(text(&out.join(name)), "old", "{command:?}: {name}");
        }
        let last = out.join(names[names.len() - 1]);
        std::fs::remove_file(&last).unwrap();
        std::fs::create_dir(&last).unwrap();
        let taken = run(&mut Command::new(&program));
        assert_eq!(taken.status.code(), Some(2), "{command:?} with a folder in the way");
        for name in &names[..names.len() - 1] {
            assert_eq!(text(&out.join(name)), "old", "{command:?}: {name}");
        }
        std::fs::remove_dir(&last).unwrap();
        let whole = run(&mut Command::new(&program));
        let error = String::from_utf8_lossy(&whole.stderr).into_owned();
        assert_eq!(whole.status.code(), Some(0), "{command:?}: {error}");
        assert!(names.iter().all(|name| read(&out.join(name)) != b"old"), "{command:?}");
    }
    std::fs::create_dir_all(folder.path().join("out/report.html")).unwrap();
    std::fs::write(folder.path().join("out/photo.png"), "old").unwrap();
    let small = ["preview", "I", "--report", "--backend", "cpu", "--size", "320x180", "-o", "out"];
    noctograph(folder.path()).args(small).assert().code(2);
    assert_eq!(text(&folder.path().join("out/photo.png")), "old", "the page is one of the set");
}

#[test]
fn a_folder_that_may_not_be_written_is_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let closed = folder.path().join("closed");
    std::fs::create_dir(&closed).unwrap();
    std::fs::write(closed.join("plan.csv"), "old").unwrap();
    let mode = |path: &Path, mode| {
        std::fs::set_permissions(path, PermissionsExt::from_mode(mode)).unwrap();
    };
    mode(folder.path(), 0o755);
    mode(&closed, 0o555);
    // The superuser can write anywhere, so the program runs as the user `nobody`, from a folder
    // that this user can access.
    let superuser = std::fs::write(closed.join("probe"), "").is_ok();
    let program = folder.path().join("program");
    if superuser {
        std::fs::remove_file(closed.join("probe")).unwrap();
        std::fs::copy(assert_cmd::cargo::cargo_bin("noctograph"), &program).unwrap();
    }
    for arguments in [["plan", "I", "-o", "closed/plan.csv"], ["preview", "I", "-o", "closed"]] {
        let mut command = process(folder.path(), &arguments);
        if superuser {
            command = Command::new(&program);
            command.uid(65534).current_dir(folder.path()).args(arguments);
        }
        let run = command.output().unwrap();
        let error = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains("closed") && error.contains("hint: "), "{error}");
    }
    mode(&closed, 0o755);
    assert_eq!(names_in(&closed), ["plan.csv"]);
    assert_eq!(text(&closed.join("plan.csv")), "old");
}

/// Returns the command of a small preview into a folder, without output.
fn preview(folder: &Path, out: &str, seed: &str) -> Command {
    let small = ["preview", "I", "--backend", "cpu", "--size", "320x180", "--seed", seed];
    let mut command = process(folder, &[&small[..], &["-o", out]].concat());
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// A preview that is killed at any of ten times leaves either the files of the previous run or its
/// own. The next run removes its temporary files.
#[test]
fn a_signal_at_any_point_leaves_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let begun = std::time::Instant::now();
    preview(folder.path(), "out", "1").status().unwrap();
    let whole_run = begun.elapsed();
    preview(folder.path(), "new", "2").status().unwrap();
    let names = names_in(&at("out"));
    let old: Vec<Vec<u8>> = names.iter().map(|name| read(&at("out").join(name))).collect();
    for point in 0..10 {
        let mut child = preview(folder.path(), "out", "2").spawn().unwrap();
        std::thread::sleep(whole_run * point / 10 + Duration::from_millis(5));
        let signal = ["KILL", "TERM", "INT", "HUP"][point as usize % 4];
        let pid = child.id().to_string();
        // A run that has already ended receives no signal.
        let _ = Command::new("kill").args(["-s", signal, &pid]).stderr(Stdio::null()).status();
        child.wait().unwrap();
        for (name, old) in names.iter().zip(&old) {
            let now = read(&at("out").join(name));
            let whole = now == *old || now == read(&at("new").join(name));
            assert!(whole, "{name} is neither old nor new after {signal} at point {point}");
        }
    }
    preview(folder.path(), "out", "2").status().unwrap();
    assert_eq!(names_in(&at("out")), names, "nothing is left of the ten");
    assert!(same(&at("out"), &at("new"), &names));
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

fn same(one: &Path, other: &Path, names: &[impl AsRef<Path>]) -> bool {
    names.iter().all(|name| read(&one.join(name)) == read(&other.join(name)))
}

/// Creates folders `old` and `new` of previews with seeds 1 and 2, and `out`, a copy of `old` with
/// a pipe in place of its second file. A preview into `out` waits between two renames until the
/// pipe is read.
fn with_a_pipe(folder: &Path) -> std::fs::File {
    for (out, seed) in [("old", "1"), ("new", "2"), ("out", "1")] {
        preview(folder, out, seed).status().unwrap();
    }
    let pipe = folder.join("out/flight.csv");
    std::fs::remove_file(&pipe).unwrap();
    let made = Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success(), "a pipe in the folder");
    // The pipe is also opened for writing, so that opening it does not wait for the preview, and so
    // that it does not end when the preview closes it.
    std::fs::OpenOptions::new().read(true).write(true).open(&pipe).unwrap()
}

#[test]
fn a_kill_between_two_names_leaves_files_of_both_runs_all_of_them_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut pipe = with_a_pipe(folder.path());
    let mut child = preview(folder.path(), "out", "2").spawn().unwrap();
    // When the first byte of the flight arrives, the scene and the photo have been renamed.
    pipe.read_exact(&mut [0]).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(same(&at("out"), &at("new"), &["scene.toml", "photo.png"]), "the new scene and photo");
    assert!(same(&at("out"), &at("old"), &["plan.csv", "verdict.json"]), "and old files, whole");
    let names = names_in(&at("old"));
    assert!(names_in(&at("out")).len() > names.len(), "the killed run left its folder");
    std::fs::remove_file(at("out/flight.csv")).unwrap();
    preview(folder.path(), "out", "2").status().unwrap();
    assert_eq!(names_in(&at("out")), names, "the next run removes it");
    assert!(same(&at("out"), &at("new"), &names));
}

#[test]
fn the_second_of_two_writers_waits_until_the_first_has_named_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut pipe = with_a_pipe(folder.path());
    let mut first = preview(folder.path(), "out", "1").spawn().unwrap();
    let mut piped = vec![0];
    pipe.read_exact(&mut piped).unwrap();
    let mut second = preview(folder.path(), "out", "2").spawn().unwrap();
    let staged = |out: &str| {
        let names = names_in(&at(out)).into_iter().filter(|name| name.starts_with('.'));
        names.filter(|name| at(out).join(name).join("verdict.json").exists()).count()
    };
    let begun = std::time::Instant::now();
    while staged("out") < 2 {
        assert!(second.try_wait().unwrap().is_none(), "it ended before it wrote its files");
        assert!(begun.elapsed() < Duration::from_secs(300), "the first's files are gone");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(100));
    assert!(same(&at("out"), &at("old"), &["photo.png"]), "nothing of the second yet");
    let (old, new) = (read(&at("old/flight.csv")), read(&at("new/flight.csv")));
    piped.resize(old.len() + new.len(), 0);
    pipe.read_exact(&mut piped[1..]).unwrap();
    assert!(first.wait().is_ok() && second.wait().is_ok());
    assert!(piped == [old, new].concat(), "one flight after the other");
    let rest = ["photo.png", "plan.csv", "scene.toml", "verdict.json"];
    assert!(same(&at("out"), &at("new"), &rest), "all files of the second");
}

#[test]
fn inputs_are_read_once_so_that_pipes_will_do() {
    let folder = tempfile::tempdir().unwrap();
    noctograph(folder.path()).args(["plan", "I"]).assert().success();
    noctograph(folder.path()).args(["fly", "plan.csv"]).assert().success();
    let bytes = std::fs::read(folder.path().join("flight.csv")).unwrap();
    let small =
        ["--backend", "cpu", "--set", "camera.width_px=320", "--set", "camera.height_px=180"];
    for arguments in [
        &["import", "/dev/stdin", "-o", "again.csv"][..],
        &[&["expose", "/dev/stdin"], &small[..]].concat(),
    ] {
        let mut child = process(folder.path(), arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(&bytes).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments:?}");
    }
    assert_eq!(std::fs::read(folder.path().join("again.csv")).unwrap(), bytes);
}
