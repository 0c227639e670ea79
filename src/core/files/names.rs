//! Names of files, their extensions, and the names by which a file refers to another file.

use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

use super::entries_in;

/// Extensions of files that the program reads or writes, and of files that users mistake for them.
const ENDINGS: [&str; 47] = [
    "avif", "bag", "bin", "bmp", "csv", "dng", "eps", "exr", "gif", "heic", "heif", "html", "jpeg",
    "jpg", "json", "jsonl", "log", "lst", "mcap", "npy", "npz", "ods", "otc", "otf", "pdf", "png",
    "py", "skyc", "strokes", "svg", "tif", "tiff", "toml", "traj", "tsv", "ttc", "ttf", "txt",
    "ulg", "usda", "vviz", "webp", "xlsx", "xml", "yaml", "yml", "zip",
];

/// Returns the extension of a file's name in lower case, without its point, or "" if it has none.
pub fn ending(path: impl AsRef<Path>) -> String {
    path.as_ref().extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// True if a string has the extension of a file that the program reads or writes.
pub fn is_file_name(text: &str) -> bool {
    ENDINGS.contains(&&*ending(text))
}

/// Returns the name of a file without its folders. Bytes that are not Unicode are replaced.
pub fn file_name(path: impl AsRef<Path>) -> String {
    path.as_ref().file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the path of the file to which a name in another file refers, relative to that file's
/// folder. Folders in the name are separated by `/`, or by the Windows separator `\` unless a file
/// exists whose name contains the `\`.
pub fn path_from(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    as_spelled(&if !name.contains('\\') || path.exists() {
        path
    } else {
        folder.join(name.replace('\\', "/"))
    })
}

/// Returns a path as the file system spells it. Windows and macOS treat two names as the same if
/// they differ only in case or in how accents are composed, and copying files to another system may
/// preserve either form.
///
/// A path is returned unchanged if it exists, if nothing matches it, or if several files match it.
pub fn as_spelled(path: &Path) -> PathBuf {
    spelled(path).unwrap_or_else(|| path.to_owned())
}

/// Returns the only path with the same spelling apart from case and Unicode normalization, or
/// `None` if there is none or more than one. Folders are compared in the same way.
fn spelled(path: &Path) -> Option<PathBuf> {
    fn folded(path: &Path) -> String {
        file_name(path).nfc().collect::<String>().to_lowercase()
    }
    if path.exists() {
        return Some(path.to_owned());
    }
    let folder = match path.parent()? {
        parent if parent.as_os_str().is_empty() => ".".into(),
        parent => spelled(parent)?,
    };
    let mut same = entries_in(&folder).ok()?;
    same.retain(|entry| folded(entry) == folded(path));
    same.pop().filter(|_| same.is_empty())
}

/// Returns the path of a file relative to a folder that contains it, separated by `/`, or `None`
/// for a file elsewhere.
pub fn relative_name(folder: &Path, path: &Path) -> Option<String> {
    // Only the file's folder is resolved, so that a symbolic link to a file keeps its name. An
    // empty path means the current folder, `.`.
    let folder = folder.join(".").canonicalize().ok()?;
    let parent = std::path::absolute(path).ok()?.parent()?.canonicalize().ok()?;
    let path = parent.join(path.file_name()?);
    let parts = path.strip_prefix(folder).ok()?.components();
    let parts: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
    Some(parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_have_no_case() {
        let endings = ["a/PLAN.CSV", "b.Csv", "c.csv", "d", ".csv", "e.CSV.bak"].map(ending);
        assert_eq!(endings, ["csv", "csv", "csv", "", "", "bak"]);
        assert!(
            is_file_name("PLAN.CSV")
                && is_file_name("a.PDF")
                && is_file_name("a.txt")
                && !is_file_name("U.S.A.")
        );
    }

    #[test]
    fn a_file_is_named_from_a_folder_above_it_and_found_from_there() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("art/out")).unwrap();
        let path = folder.path().join("art/logo.svg");
        std::fs::write(&path, "").unwrap();
        assert_eq!(relative_name(folder.path(), &path).as_deref(), Some("art/logo.svg"));
        let roundabout = folder.path().join("art/out/../logo.svg");
        assert_eq!(relative_name(folder.path(), &roundabout).as_deref(), Some("art/logo.svg"));
        assert_eq!(relative_name(&folder.path().join("art/out"), &path), None, "it is not below");
        for name in ["art/logo.svg", r"art\logo.svg", &path.display().to_string()] {
            assert!(path_from(folder.path(), name).is_file(), "{name}");
        }
    }

    #[test]
    fn a_name_is_found_in_another_case_or_composition_unless_several_match() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("Bilder")).unwrap();
        // macOS may store an umlaut as a letter followed by a combining diaeresis.
        for name in ["Bilder/LOGO.SVG", "Bilder/gro\u{308}\u{df}e.svg", "a.csv", "B.csv", "b.CSV"] {
            std::fs::write(path(name), "").unwrap();
        }
        for (name, spelled) in [
            ("bilder/logo.svg", "Bilder/LOGO.SVG"),
            (r"BILDER\Logo.svg", "Bilder/LOGO.SVG"),
            ("Bilder/gr\u{f6}\u{df}e.svg", "Bilder/gro\u{308}\u{df}e.svg"),
            ("A.CSV", "a.csv"),
        ] {
            let there = path_from(folder.path(), name);
            assert!(there.is_file(), "{name}");
            // On a system that treats both names as the same, there is no other spelling to find.
            assert!(there == path(spelled) || path(name).exists(), "{name}: {}", there.display());
        }
        assert_eq!(as_spelled(&path("missing.csv")), path("missing.csv"));
        assert!(path("B.CSV").exists() || as_spelled(&path("B.CSV")) == path("B.CSV"), "which?");
        // Unit tests run in the folder of their crate, which contains `Cargo.toml`.
        assert!(as_spelled(Path::new("CARGO.TOML")).is_file());
    }
}
