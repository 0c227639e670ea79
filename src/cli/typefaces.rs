//! Finds a typeface on this machine that contains the letters that a font lacks.

use std::path::{Path, PathBuf};

use crate::letters::has_outline;
use noctograph_core::files::{Limit, ending, entries_in};

/// Folders that are searched for typefaces. `~` stands for the user's home folder.
const FOLDERS: &[&str] = if cfg!(windows) {
    &["C:\\Windows\\Fonts", "~\\AppData\\Local\\Microsoft\\Windows\\Fonts"]
} else if cfg!(target_vendor = "apple") {
    &["/Library/Fonts", "/System/Library/Fonts", "~/Library/Fonts"]
} else {
    &["/usr/share/fonts", "/usr/local/share/fonts", "~/.fonts", "~/.local/share/fonts"]
};

/// Maximum depth of the folders that are searched.
const DEEPEST: usize = 5;
/// Maximum number of files that are searched.
const MAX_FILES: usize = 2000;
/// Maximum number of bytes of all files together.
const MAX_BYTES: usize = 1 << 30;

/// Size limit for a file that is read.
const LIMIT: Limit =
    Limit { bytes: 64 << 20, what: "a typeface", hint: "name a smaller font file" };

/// Returns a typeface file on this machine that contains all of the characters, or `None` if none
/// of the files that are searched does. Upright and light typefaces are preferred, because their
/// center lines are closest to handwritten strokes.
pub(super) fn with(characters: &[char]) -> Option<PathBuf> {
    let home = std::env::home_dir().unwrap_or_default();
    let folders = FOLDERS.iter().map(|folder| match folder.strip_prefix('~') {
        Some(below) => home.join(below.trim_start_matches(['/', '\\'])),
        None => folder.into(),
    });
    first_with(&folders.collect::<Vec<PathBuf>>(), characters)
}

/// Returns the first file in the folders, in the order of [`rank`], that contains all of the
/// characters. The search ends after [`MAX_BYTES`], to limit its time.
fn first_with(folders: &[PathBuf], characters: &[char]) -> Option<PathBuf> {
    let mut files = Vec::new();
    for folder in folders {
        gather(folder, DEEPEST, &mut files);
    }
    // The best-ranked files are read first, because all files together may be gigabytes.
    files.sort_by_cached_key(|path| (rank(path), path.clone()));
    let mut n_bytes = 0;
    files.into_iter().find(|path| {
        // Unreadable files are skipped, because the result is only used for a hint.
        let file = if n_bytes < MAX_BYTES { LIMIT.read(path).ok() } else { None };
        n_bytes += file.as_ref().map_or(0, Vec::len);
        file.is_some_and(|file| characters.iter().all(|c| has_outline(&file, *c)))
    })
}

/// Adds the typeface files in a folder and its subfolders, down to `deepest` levels, up to
/// [`MAX_FILES`] files in total.
fn gather(folder: &Path, deepest: usize, files: &mut Vec<PathBuf>) {
    let is_typeface = |path: &Path| ["ttf", "otf", "ttc"].contains(&&*ending(path));
    for path in entries_in(folder).unwrap_or_default() {
        if files.len() == MAX_FILES {
            return;
        }
        if path.is_dir() && deepest > 0 {
            gather(&path, deepest - 1, files);
        } else if is_typeface(&path) && path.is_file() {
            files.push(path);
        }
    }
}

/// Returns the sort key of a typeface by its file name: true for slanted ones, and the weight from
/// 0 (light) to 2 (heavy). Upright and light ones are therefore first.
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
