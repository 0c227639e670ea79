//! Submissions: reads the scenes that students submit for a task, and reports refused ones.

use std::path::{Path, PathBuf};

use super::Unranked;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{ending, entries_in, file_name};
use noctograph_pipeline::scene::{NamedScene, SceneTask};

/// Submissions for a task, sorted into accepted and refused ones.
#[derive(Debug, Default)]
pub struct Submissions {
    /// Accepted scenes, with their names in the results.
    pub scenes: Vec<NamedScene>,
    /// Submissions that are invalid or change forbidden keys, and other entries of folders.
    pub refused: Vec<Unranked>,
    /// Messages about ignored hidden files, one for each folder that contains any.
    pub passed_over: Vec<String>,
}

/// A file or a folder entry, with its name in the results.
struct Submitted {
    path: PathBuf,
    name: String,
    /// Reason for refusal, if the entry is not a submission.
    refused: Option<&'static str>,
}

/// Reads submissions: files (TOML), folders of files, and folders with a folder for each student,
/// as learning platforms export them. A result is named after the student's folder and the file. If
/// two results would have the same name, each is named after the shortest end of its path that is
/// unique. Every other entry of a folder is listed with the reason for refusal, except hidden
/// files, which are only mentioned.
///
/// # Errors
///
/// Returns the errors of [`entries_in`]. Returns [`Error::Input`] if there are no files.
pub fn submissions(task: &SceneTask, named: &[String]) -> Result<Submissions> {
    let (mut submitted, mut passed_over) = (Vec::new(), Vec::new());
    for path in named.iter().map(PathBuf::from) {
        if path.is_dir() {
            gather(&path, None, &mut submitted, &mut passed_over)?
        } else {
            let refused = path.is_symlink().then_some(LINK);
            submitted.push(Submitted { name: stem(&path), path, refused });
        }
    }
    if submitted.is_empty() {
        let (folders, hint) = (named.join(", "), "name the folder that contains the files *.toml");
        return Err(Error::input("submissions", folders + ": no files", "at least one", hint));
    }
    let mut read = Submissions { passed_over, ..Submissions::default() };
    for Submitted { path, name, refused } in &submitted {
        // The longer name is used only if two files have the same name, so that names stay short.
        let is_shared = submitted.iter().filter(|other| other.name == *name).count() > 1;
        let name = if is_shared { distinct_name(path, &submitted) } else { name.clone() };
        let scene = match refused {
            Some(why) => Err((*why).to_owned()),
            None => task.submission(path).map_err(|error| format!("{error} ({})", error.hint())),
        };
        match scene {
            Ok(scene) => read.scenes.push(NamedScene::new(&name, scene)),
            Err(why) => {
                let note = format!("refused: {why}");
                read.refused.push(Unranked { contender: name, note });
            }
        }
    }
    Ok(read)
}

/// Appends the entries of a folder to `submitted`, and a message about its hidden files to
/// `passed_over`. `student` is the student's name if the folder is a student's.
fn gather(
    folder: &Path,
    student: Option<&str>,
    submitted: &mut Vec<Submitted>,
    passed_over: &mut Vec<String>,
) -> Result<()> {
    let (mut hidden, n_before) = (Vec::new(), submitted.len());
    let prefix = student.map_or(String::new(), |student| format!("{student}/"));
    for path in entries_in(folder)? {
        let name = file_name(&path);
        if name.starts_with('.') {
            hidden.push(name);
            continue;
        }
        let refused = refusal(&path, student.is_some());
        if refused.is_none() && path.is_dir() {
            gather(&path, Some(&name), submitted, passed_over)?;
        } else {
            // The name of a refused entry keeps its extension, which is often the reason.
            let name = prefix.clone() + &if refused.is_none() { stem(&path) } else { name };
            submitted.push(Submitted { path, name, refused });
        }
    }
    // A student without a file is also listed.
    if let Some(student) = student.filter(|_| submitted.len() == n_before) {
        let (path, name) = (folder.to_owned(), student.to_owned());
        submitted.push(Submitted { path, name, refused: Some("the folder has no file *.toml") });
    }
    if !hidden.is_empty() {
        let names = hidden.join(", ");
        passed_over.push(format!("{}: hidden files are not read: {names}", folder.display()));
    }
    Ok(())
}

const LINK: &str = "a link, which is not followed";

/// Returns the reason why an entry of a folder is not a submission, or `None` if it may be one.
/// `is_in_student` is true in a student's own folder, which has no folders.
fn refusal(path: &Path, is_in_student: bool) -> Option<&'static str> {
    Some(match &*ending(path) {
        _ if path.is_symlink() => LINK,
        _ if path.is_dir() && is_in_student => "a folder in a student's folder",
        _ if path.is_dir() => return None,
        _ if !path.is_file() => "no regular file",
        "toml" => return None,
        "zip" | "7z" | "rar" | "gz" | "tar" | "tgz" | "xz" => "an archive: unpack it",
        "py" => "a controller in Python: python -m noctograph.grade flies it",
        _ => "not called *.toml",
    })
}

/// Returns the shortest unique end of a path, or the whole path if it is given twice.
fn distinct_name(path: &Path, submitted: &[Submitted]) -> String {
    for n in 1..=path.components().count() {
        // The end without the file's extension is tried first.
        for has_extension in [false, true] {
            let end = path_end(path, n, has_extension);
            let ends = submitted.iter().map(|other| path_end(&other.path, n, has_extension));
            if ends.filter(|other| *other == end).count() == 1 {
                return end;
            }
        }
    }
    path.display().to_string()
}

/// Returns the last `n` parts of a path, joined by slashes. The file's extension is kept if
/// `has_extension` is true.
fn path_end(path: &Path, n: usize, has_extension: bool) -> String {
    let path = if has_extension { path.to_owned() } else { path.with_extension("") };
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    parts[parts.len().saturating_sub(n)..].join("/")
}

/// Returns the name of a file without its extension.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::Scene;

    #[test]
    fn every_entry_of_a_folder_has_a_row() {
        let folder = tempfile::tempdir().unwrap();
        let lqr = "[controller]\nkind = \"lqr\"\n";
        let deep = "bo_12/more";
        std::fs::create_dir_all(folder.path().join(deep)).unwrap();
        for student in ["eve_13", "ida_14"] {
            std::fs::create_dir(folder.path().join(student)).unwrap();
        }
        let rows = ["BEN.TOML", "anna.toml", "bo_12/gains.toml"];
        let others =
            ["cy.toml.txt", "dora.zip", ".ed.toml", "eve_13/gains.py", "bo_12/more/x.toml"];
        for name in rows.iter().chain(&others) {
            std::fs::write(folder.path().join(name), lqr).unwrap();
        }
        #[cfg(unix)]
        for (name, target) in [("fay.toml", "gone.toml"), ("gus.toml", "anna.toml"), ("h", "bo_12")]
        {
            std::os::unix::fs::symlink(target, folder.path().join(name)).unwrap();
        }
        let task = SceneTask::new(Scene::find("cf21", &[]).unwrap().scene, &[]).unwrap();
        let read = submissions(&task, &[folder.path().display().to_string()]).unwrap();
        let names: Vec<&str> = read.scenes.iter().map(|scene| &*scene.name).collect();
        assert_eq!(names, ["BEN", "anna", "bo_12/gains"]);
        let rows = read.refused.iter().map(|row| format!("{} {}", row.contender, row.note));
        let rows: Vec<String> = rows.collect();
        for wanted in [
            "cy.toml.txt refused: not called *.toml",
            "dora.zip refused: an archive: unpack it",
            "eve_13/gains.py refused: a controller in Python: python -m noctograph.grade flies it",
            "ida_14 refused: the folder has no file *.toml",
            "bo_12/more refused: a folder in a student's folder",
        ] {
            assert!(rows.iter().any(|row| row == wanted), "{wanted}: {rows:?}");
        }
        for link in ["fay.toml", "gus.toml", "h"] {
            let wanted = format!("{link} refused: {LINK}");
            assert!(cfg!(not(unix)) || rows.contains(&wanted), "{link}: {rows:?}");
        }
        let [hidden] = &read.passed_over[..] else { panic!("{:?}", read.passed_over) };
        assert!(hidden.ends_with("hidden files are not read: .ed.toml"), "{hidden}");
    }

    #[test]
    fn a_name_that_two_submissions_have_is_the_end_of_the_path_that_tells_them_apart() {
        fn names<const N: usize>(paths: [&str; N]) -> [String; N] {
            let name = String::new;
            let submitted =
                paths.map(|path| Submitted { path: path.into(), name: name(), refused: None });
            submitted.each_ref().map(|file| distinct_name(&file.path, &submitted))
        }
        let paths =
            ["/c/x/ada/gains.toml", "/c/x/bo/gains.toml", "/c/y/bo/gains.toml", "a.toml", "a.TOML"];
        assert_eq!(names(paths), ["ada/gains", "x/bo/gains", "y/bo/gains", "a.toml", "a.TOML"]);
        assert_eq!(names(["/c/a.toml"; 2]), ["/c/a.toml"; 2]);
    }

    #[test]
    fn nothing_handed_in_is_an_error() {
        let (folder, cf21) = (tempfile::tempdir().unwrap(), Scene::find("cf21", &[]).unwrap());
        let task = SceneTask::new(cf21.scene, &[]).unwrap();
        let error = submissions(&task, &[folder.path().display().to_string()]).unwrap_err();
        assert!(error.to_string().contains("no files"), "{error}");
    }
}
