//! Names of files: their endings, and the names with which a file refers to another file.

use std::path::{Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

use super::entries_in;

/// Endings of files that the program reads or writes, and of those that are taken for them.
const ENDINGS: [&str; 47] = [
    "avif", "bag", "bin", "bmp", "csv", "dng", "eps", "exr", "gif", "heic", "heif", "html", "jpeg",
    "jpg", "json", "jsonl", "log", "lst", "mcap", "npy", "npz", "ods", "otc", "otf", "pdf", "png",
    "py", "skyc", "strokes", "svg", "tif", "tiff", "toml", "traj", "tsv", "ttc", "ttf", "txt",
    "ulg", "usda", "vviz", "webp", "xlsx", "xml", "yaml", "yml", "zip",
];

/// The ending of a file's name, in lower case and without its point, or empty if it has none.
pub fn ending(path: impl AsRef<Path>) -> String {
    path.as_ref().extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// True if a text ends as a file that the program reads or writes.
pub fn is_file_name(text: &str) -> bool {
    ENDINGS.contains(&&*ending(text))
}

/// The name of a file without its folders. Bytes that are not Unicode are replaced.
pub fn file_name(path: impl AsRef<Path>) -> String {
    path.as_ref().file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The path that a name in a file refers to, relative to the file's folder. Its folders are
/// separated by `/`, or by the `\` of Windows unless a file has a `\` in its name.
pub fn path_from(folder: &Path, name: &str) -> PathBuf {
    let path = folder.join(name);
    as_spelled(&match !name.contains('\\') || path.exists() {
        true => path,
        false => folder.join(name.replace('\\', "/")),
    })
}

/// The path as its folders spell it. Windows and macOS take two names for one if they differ only
/// in case or in how accents are composed, and copies to other systems keep either.
///
/// A path is returned as it is if it is there, if nothing is, or if several files match.
pub fn as_spelled(path: &Path) -> PathBuf {
    spelled(path).unwrap_or_else(|| path.to_owned())
}

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

/// The path of a file relative to a folder above it, separated by `/`, or `None` elsewhere.
pub fn relative_name(folder: &Path, path: &Path) -> Option<String> {
    // Only the file's folder is made canonical: a file that is a link keeps its name.
    // An empty folder is the current one, `.`.
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
        // macOS may write an umlaut as its letter and two points.
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
            // A system that takes both for one name has no other spelling.
            assert!(there == path(spelled) || path(name).exists(), "{name}: {}", there.display());
        }
        assert_eq!(as_spelled(&path("missing.csv")), path("missing.csv"));
        assert!(path("B.CSV").exists() || as_spelled(&path("B.CSV")) == path("B.CSV"), "which?");
        // Unit tests run in the folder of their crate.
        assert!(as_spelled(Path::new("CARGO.TOML")).is_file());
    }
}
