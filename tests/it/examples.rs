//! The examples of `noctograph VERB --help`: they run as they stand, in the order of the verbs, in one
//! folder that holds the files which a user brings.

use std::path::Path;

use crate::cli::{noctograph, verbs};
use crate::cooperation::recorded;

/// Files that the examples name and no example writes.
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

/// Examples of a verb: the lines beneath "Example:" in its help.
fn examples(folder: &Path, verb: &str) -> Vec<String> {
    let help = noctograph(folder).args([verb, "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let (_, below) = help.split_once("Example:\n").unwrap_or_else(|| panic!("{verb}: {help}"));
    let lines = below.lines().map_while(|line| line.strip_prefix("  noctograph "));
    lines.map(str::to_owned).collect()
}

#[test]
fn the_example_of_every_verb_runs() {
    let folder = tempfile::tempdir().unwrap();
    bring(folder.path());
    // `serve` runs until it is ended (tests/it/serve.rs).
    for verb in verbs().iter().filter(|verb| *verb != "serve") {
        let examples = examples(folder.path(), verb);
        assert!(!examples.is_empty(), "{verb} has an example");
        for example in examples {
            let run = noctograph(folder.path()).args(example.split(' ')).output().unwrap();
            let said = String::from_utf8_lossy(&run.stderr);
            assert_eq!(run.status.code(), Some(0), "{example}: {said}");
        }
    }
    assert_eq!(examples(folder.path(), "serve"), ["serve --open"]);
}
