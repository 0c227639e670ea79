//! Sets `NOCTOGRAPH_SOURCE` to a digest of the source that determines a flight's outcome. Builds of
//! the same source have the same digest, whether from a clone or an archive, on every system.

#![expect(clippy::disallowed_methods, reason = "the source")]

use std::path::{Path, PathBuf};

/// Folders that determine an outcome, relative to this crate: crates, fonts and shaders.
const FOLDERS: [&str; 10] = [
    "../core",
    "../letters",
    "../logs",
    "../picture",
    "../pipeline",
    "../plan",
    "../score",
    "../sim",
    "../../fonts",
    "../../shaders",
];

/// Sets `NOCTOGRAPH_SOURCE` for the compiler to a hash of the names and the contents of all files
/// of the source, 16 hexadecimal digits. Records of flights state it, so that flights of different
/// sources are not mixed.
fn main() {
    let mut files = Vec::new();
    for folder in FOLDERS.into_iter().chain(["."]) {
        println!("cargo::rerun-if-changed={folder}");
        walk(Path::new(folder), &mut files);
    }
    files.sort();
    // The hash is 64-bit FNV-1a, which detects mistakes but not attacks.
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    for path in files {
        let name = path.to_string_lossy().replace('\\', "/");
        let bytes = std::fs::read(&path).expect("a file of the source can be read");
        // Git on Windows may have changed the line endings to CR LF.
        for byte in name.bytes().chain(bytes).filter(|byte| *byte != b'\r') {
            digest = (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    println!("cargo::rustc-env=NOCTOGRAPH_SOURCE={digest:016x}");
}

/// Appends the files in a folder and its subfolders, except Cargo.toml and hidden files of editors.
fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).expect("a folder of the source can be read");
    for path in entries.map(|entry| entry.expect("an entry can be read").path()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            walk(&path, files);
        } else if !name.starts_with('.') && !name.ends_with('~') && name != "Cargo.toml" {
            files.push(path);
        }
    }
}
