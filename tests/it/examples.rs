//! Runs the examples of `noctograph VERB --help` unchanged, in the order of the verbs, in one
//! folder with the files that a user must provide.

use std::path::Path;

use crate::cli::{noctograph, verbs};
use crate::cooperation::recorded;

/// Writes the files that the examples read but no example writes.
fn bring(folder: &Path) {
    for (name, text) in recorded().into_iter().filter(|(name, _)| *name != "flight.csv") {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let log = ["preview", "NOOR", "--backend", "cpu", "--size", "320x180", "-o", "flown"];
    noctograph(folder).args(log).assert().success();
    std::fs::copy(folder.join("flown/flight.csv"), folder.join("log.csv")).unwrap();
    let photo = ["preview", "HELLO", "--seed", "2", "-o", "real"];
    noctograph(folder).args(photo).assert().success();
    let real = image::open(folder.join("real/photo.png")).unwrap();
    real.to_rgb8().save(folder.join("real.jpg")).unwrap();
}

/// Returns the examples of a verb, which are the lines below "Example:" in its help.
fn examples(folder: &Path, verb: &str) -> Vec<String> {
    let help = noctograph(folder).args([verb, "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let (_, below) = help.split_once("Example:\n").unwrap_or_else(|| panic!("{verb}: {help}"));
    let lines = below.lines().map_while(|line| line.strip_prefix("  noctograph "));
    lines.map(str::to_owned).collect()
}

/// Returns a layout path that does not exist in the JSON object and is therefore printed unchanged.
fn unknown_path(printed: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(printed);
    let braces = text.split('{').skip(1).filter_map(|rest| Some(rest.split_once('}')?.0));
    let is_path = |text: &&str| {
        let letters = |c: char| c.is_ascii_alphanumeric() || "_.#".contains(c);
        text.starts_with(|c: char| c.is_ascii_lowercase()) && text.chars().all(letters)
    };
    braces.filter(is_path).map(str::to_owned).next()
}

#[test]
fn the_example_of_every_verb_runs() {
    let folder = tempfile::tempdir().unwrap();
    bring(folder.path());
    // `serve` is tested in tests/it/serve.rs, because it runs until it is terminated.
    for verb in verbs().iter().filter(|verb| *verb != "serve") {
        let examples = examples(folder.path(), verb);
        assert!(!examples.is_empty(), "{verb} has an example");
        for example in examples {
            let run = noctograph(folder.path()).args(example.split(' ')).output().unwrap();
            let said = String::from_utf8_lossy(&run.stderr);
            assert_eq!(run.status.code(), Some(0), "{example}: {said}");
            assert_eq!(unknown_path(&run.stdout), None, "{example}: it leads nowhere");
        }
    }
    assert_eq!(examples(folder.path(), "serve"), ["serve --open"]);
}
