//! Typefaces of this machine: one that has letters which a font lacks.

use std::path::{Path, PathBuf};

use crate::letters::has_outline;
use noctograph_core::files::{Limit, ending, entries_in};

/// Folders of typefaces; `~` is the user's own folder.
const FOLDERS: &[&str] = if cfg!(windows) {
    &["C:\\Windows\\Fonts", "~\\AppData\\Local\\Microsoft\\Windows\\Fonts"]
} else if cfg!(target_vendor = "apple") {
    &["/Library/Fonts", "/System/Library/Fonts", "~/Library/Fonts"]
} else {
    &["/usr/share/fonts", "/usr/local/share/fonts", "~/.fonts", "~/.local/share/fonts"]
};

/// Deepest folders, most files that are looked at, and the most bytes that are read of all.
const DEEPEST: usize = 5;
const MAX_FILES: usize = 2000;
const MAX_BYTES: usize = 1 << 30;

/// Largest file that is looked at.
const LIMIT: Limit =
    Limit { bytes: 64 << 20, what: "a typeface", hint: "name a smaller font file" };

/// File of an upright typeface with all of some characters, from the system's folders; light ones
/// first, whose center lines are nearest to their strokes.
pub(super) fn with(characters: &[char]) -> Option<PathBuf> {
    let home = std::env::home_dir().unwrap_or_default();
    let folders = FOLDERS.iter().map(|folder| match folder.strip_prefix('~') {
        Some(own) => home.join(own.trim_start_matches(['/', '\\'])),
        None => folder.into(),
    });
    first_with(&folders.collect::<Vec<PathBuf>>(), characters)
}

/// The first file of folders with some characters, light and upright ones before others by their
/// names.
fn first_with(folders: &[PathBuf], characters: &[char]) -> Option<PathBuf> {
    let mut files = Vec::new();
    for folder in folders {
        gather(folder, DEEPEST, &mut files);
    }
    files.sort_by_cached_key(|path| (rank(path), path.clone()));
    let mut n_bytes = 0;
    files.into_iter().find(|path| {
        // Unreadable files are skipped in this hint.
        let file = if n_bytes < MAX_BYTES { LIMIT.read(path).ok() } else { None };
        n_bytes += file.as_ref().map_or(0, Vec::len);
        file.is_some_and(|file| characters.iter().all(|c| has_outline(&file, *c)))
    })
}

/// Adds the files of typefaces in a folder and those below it.
fn gather(folder: &Path, deepest: usize, files: &mut Vec<PathBuf>) {
    let known = |path: &Path| ["ttf", "otf", "ttc"].contains(&&*ending(path));
    for path in entries_in(folder).unwrap_or_default() {
        if files.len() == MAX_FILES {
            return;
        }
        if path.is_dir() && deepest > 0 {
            gather(&path, deepest - 1, files);
        } else if known(&path) && path.is_file() {
            files.push(path);
        }
    }
}

/// Slanted typefaces after upright ones, and each from light to heavy, as their files are named.
fn rank(path: &Path) -> (bool, usize) {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let any = |words: &[&str]| words.iter().any(|word| name.contains(word));
    let weight = match (any(&["thin", "light"]), any(&["bold", "black", "heavy", "medium"])) {
        (true, _) => 0,
        (_, true) => 2,
        _ => 1,
    };
    (any(&["italic", "oblique"]), weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lightest_upright_typeface_with_a_letter_is_found() {
        let roboto = concat!(env!("CARGO_MANIFEST_DIR"), "/fonts/Roboto-Thin.ttf");
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("a/b");
        std::fs::create_dir_all(&below).unwrap();
        for name in ["X-Regular.ttf", "X-LightItalic.ttf", "X-Bold.ttf"] {
            std::fs::copy(roboto, below.join(name)).unwrap();
        }
        std::fs::write(below.join("Broken-Light.ttf"), "no typeface").unwrap();
        std::fs::write(below.join("Light.txt"), "no typeface").unwrap();
        let folders = [folder.path().to_owned(), folder.path().join("nowhere")];
        assert_eq!(first_with(&folders, &['Q']), Some(below.join("X-Regular.ttf")));
        std::fs::copy(roboto, folder.path().join("Y-LIGHT.TTF")).unwrap();
        assert_eq!(first_with(&folders, &['Q', 'R']), Some(folder.path().join("Y-LIGHT.TTF")));
        assert_eq!(first_with(&folders, &['Q', '漢']), None);
    }
}
