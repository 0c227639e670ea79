//! Names of files: their endings, and the names with which a file refers to another file.

use std::path::{Path, PathBuf};

/// Endings of files that the program reads or writes, and of those that are taken for them.
const ENDINGS: [&str; 27] = [
    "bmp", "csv", "exr", "gif", "heic", "html", "jpeg", "jpg", "json", "jsonl", "lst", "otc",
    "otf", "png", "skyc", "strokes", "svg", "toml", "traj", "tsv", "ttc", "ttf", "txt", "vviz",
    "webp", "yaml", "zip",
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
    match !name.contains('\\') || path.exists() {
        true => path,
        false => folder.join(name.replace('\\', "/")),
    }
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
        assert!(is_file_name("PLAN.CSV") && is_file_name("a.txt") && !is_file_name("U.S.A."));
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
}
