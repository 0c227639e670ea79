//! Runs the reader named by `NOCTOGRAPH_FUZZ_ONLY` under libFuzzer, starting from the same seeds as
//! the stable mutator.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

#[path = "../../readers.rs"]
#[allow(dead_code, reason = "names and kinds of seeds are the stable mutator's")]
mod readers;

static READER: LazyLock<readers::Reader> = LazyLock::new(|| {
    let name = std::env::var("NOCTOGRAPH_FUZZ_ONLY").unwrap_or_default();
    let names: Vec<_> = readers::all().iter().map(|reader| reader.name).collect();
    let reader = readers::all().into_iter().find(|reader| reader.name == name);
    reader
        .unwrap_or_else(|| panic!("NOCTOGRAPH_FUZZ_ONLY: found {name:?}, wanted one of {names:?}"))
});

static FOLDER: LazyLock<tempfile::TempDir> =
    LazyLock::new(|| tempfile::tempdir().expect("a temporary folder"));

/// Copies the seeds into the reader's corpus.
fn sow() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(READER.name);
    std::fs::create_dir_all(&corpus).expect("a folder of the corpus");
    for (number, seed) in READER.seeds().iter().enumerate() {
        std::fs::write(corpus.join(format!("seed-{number}")), &seed.bytes).expect("a seed");
    }
}

libfuzzer_sys::fuzz_target!(init: sow(), |bytes: &[u8]| {
    let path = FOLDER.path().join(READER.file);
    std::fs::write(&path, bytes).expect("a file in the temporary folder");
    let _ = (READER.read)(&path, bytes);
});
