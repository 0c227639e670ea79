//! Outputs: whatever stands at the place of a file, and whatever interrupts its writing.
#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::cli::{names_in, noctograph};

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// The program as a process of its own, with its standard streams.
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
    assert_eq!(names_in(folder.path()), ["plan.csv"]);
    let run = noctograph(folder.path()).args(["preview", "I", "-o", "-"]).assert().code(2);
    assert!(String::from_utf8_lossy(&run.get_output().stderr).contains("a folder"));
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

#[test]
fn a_folder_that_may_not_be_written_is_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let closed = folder.path().join("closed");
    std::fs::create_dir(&closed).unwrap();
    std::fs::write(closed.join("plan.csv"), "old").unwrap();
    std::fs::set_permissions(&closed, PermissionsExt::from_mode(0o555)).unwrap();
    // The superuser may write everywhere.
    if std::fs::write(closed.join("probe"), "").is_err() {
        noctograph(folder.path()).args(["plan", "I", "-o", "closed/plan.csv"]).assert().code(2);
        noctograph(folder.path()).args(["preview", "I", "-o", "closed"]).assert().code(2);
        assert_eq!(text(&closed.join("plan.csv")), "old");
    }
    std::fs::set_permissions(&closed, PermissionsExt::from_mode(0o755)).unwrap();
}

/// Killed at ten points of its run, a preview leaves the files of the run before or its own; the
/// next run removes what is left of it.
#[test]
fn a_kill_at_any_point_leaves_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let preview = |seed: &str| {
        let small = ["--backend", "cpu", "--size", "320x180", "-o", "out", "--seed", seed];
        process(folder.path(), &[&["preview", "I"], &small[..]].concat())
    };
    let out = folder.path().join("out");
    let begun = std::time::Instant::now();
    let quiet = |mut command: Command| command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    quiet(preview("1")).unwrap().wait().unwrap();
    let whole_run = begun.elapsed();
    let names = names_in(&out);
    for point in 0..10 {
        let mut child = quiet(preview("2")).unwrap();
        std::thread::sleep(whole_run * point / 10 + Duration::from_millis(5));
        child.kill().unwrap();
        child.wait().unwrap();
        for name in names.iter().filter(|name| !name.starts_with('.')) {
            let bytes = std::fs::read(out.join(name)).unwrap();
            let ends: &[u8] = if name.ends_with("png") { b"IEND\xaeB`\x82" } else { b"\n" };
            assert!(bytes.ends_with(ends), "{name} is cut off at point {point}");
        }
    }
    quiet(preview("3")).unwrap().wait().unwrap();
    assert_eq!(names_in(&out), names, "nothing is left of the ten");
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
