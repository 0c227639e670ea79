//! A reader under libFuzzer: the target's name is the reader's.
#![no_main]

use std::sync::LazyLock;

#[path = "../../readers.rs"]
#[allow(dead_code, reason = "seeds are the stable mutator's")]
mod readers;

static READER: LazyLock<readers::Reader> = LazyLock::new(|| {
    let name = env!("CARGO_BIN_NAME");
    readers::all().into_iter().find(|reader| reader.name == name).expect("a reader of this name")
});

static FOLDER: LazyLock<tempfile::TempDir> =
    LazyLock::new(|| tempfile::tempdir().expect("a temporary folder"));

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = FOLDER.path().join(READER.file);
    std::fs::write(&path, bytes).expect("a file in the temporary folder");
    let _ = (READER.read)(&path, bytes);
});
