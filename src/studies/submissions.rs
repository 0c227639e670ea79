//! Submissions: the scenes of a course under a task, and those that are refused.

use std::path::{Path, PathBuf};

use super::Unranked;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{ending, entries_in, file_name};
use noctograph_pipeline::scene::{NamedScene, SceneTask};

/// What a task makes of its submissions.
#[derive(Debug, Default)]
pub struct Submissions {
    /// Scenes under the names of their rows.
    pub scenes: Vec<NamedScene>,
    /// Submissions that are broken or change what they may not, and other entries of folders.
    pub refused: Vec<Unranked>,
    /// Hidden files of folders, by folder.
    pub passed_over: Vec<String>,
}

/// An entry of a folder or a named file, and the name of its row.
struct Handed {
    path: PathBuf,
    name: String,
    /// Why it is no submission.
    refused: Option<&'static str>,
}

/// Reads submissions: files (TOML), folders of them, and folders of a folder for each student, as
/// learning platforms hand them out. A row has the name of its file, behind that of the student's
/// folder. If two files have that name, the row has as much of the path as tells them apart. Every
/// other entry of a folder has a row with the reason, except hidden files, which are only named.
///
/// # Errors
///
/// As [`entries_in`]. [`Error::Input`] if nothing is handed in.
pub fn submissions(task: &SceneTask, named: &[String]) -> Result<Submissions> {
    let (mut handed, mut passed_over) = (Vec::new(), Vec::new());
    for path in named.iter().map(PathBuf::from) {
        match path.is_dir() {
            true => gather(&path, None, &mut handed, &mut passed_over)?,
            false => {
                let refused = path.is_symlink().then_some(LINK);
                handed.push(Handed { name: stem(&path), path, refused });
            }
        }
    }
    if handed.is_empty() {
        let (folders, hint) = (named.join(", "), "name the folder that has the files *.toml");
        return Err(Error::input("submissions", folders + ": no files", "at least one", hint));
    }
    let mut read = Submissions { passed_over, ..Submissions::default() };
    for Handed { path, name, refused } in &handed {
        // The longer name only for files of one name, so that rows stay short.
        let is_shared = handed.iter().filter(|other| other.name == *name).count() > 1;
        let name = if is_shared { distinct(path, &handed) } else { name.clone() };
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

/// Adds the entries of a folder, and of a student's folders of it.
fn gather(
    folder: &Path,
    student: Option<&str>,
    handed: &mut Vec<Handed>,
    passed_over: &mut Vec<String>,
) -> Result<()> {
    let (mut hidden, before) = (Vec::new(), handed.len());
    let prefix = student.map_or(String::new(), |student| format!("{student}/"));
    for path in entries_in(folder)? {
        let name = file_name(&path);
        if name.starts_with('.') {
            hidden.push(name);
            continue;
        }
        let refused = why_not(&path, student.is_some());
        if refused.is_none() && path.is_dir() {
            gather(&path, Some(&name), handed, passed_over)?;
        } else {
            // A refused entry is named with its ending, which is often the reason.
            let name = prefix.clone() + &if refused.is_none() { stem(&path) } else { name };
            handed.push(Handed { path, name, refused });
        }
    }
    // A student who handed nothing in has a row, too.
    if let Some(student) = student.filter(|_| handed.len() == before) {
        let (path, name) = (folder.to_owned(), student.to_owned());
        handed.push(Handed { path, name, refused: Some("no file *.toml is in it") });
    }
    if !hidden.is_empty() {
        let names = hidden.join(", ");
        passed_over.push(format!("{}: not read, as hidden: {names}", folder.display()));
    }
    Ok(())
}

const LINK: &str = "a link, which is not followed";

/// The reason why an entry of a folder is no submission.
fn why_not(path: &Path, is_in_student: bool) -> Option<&'static str> {
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

/// The shortest end of a path that no other submission has. The whole path if it is named twice.
fn distinct(path: &Path, handed: &[Handed]) -> String {
    for n in 1..=path.components().count() {
        // Without the ending of the name first.
        for has_ending in [false, true] {
            let end = end(path, n, has_ending);
            if handed.iter().filter(|other| self::end(&other.path, n, has_ending) == end).count()
                == 1
            {
                return end;
            }
        }
    }
    path.display().to_string()
}

/// The last `n` parts of a path.
fn end(path: &Path, n: usize, has_ending: bool) -> String {
    let path = if has_ending { path.to_owned() } else { path.with_extension("") };
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    parts[parts.len().saturating_sub(n)..].join("/")
}

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
            "ida_14 refused: no file *.toml is in it",
            "bo_12/more refused: a folder in a student's folder",
        ] {
            assert!(rows.iter().any(|row| row == wanted), "{wanted}: {rows:?}");
        }
        for link in ["fay.toml", "gus.toml", "h"] {
            let wanted = format!("{link} refused: {LINK}");
            assert!(cfg!(not(unix)) || rows.contains(&wanted), "{link}: {rows:?}");
        }
        let [hidden] = &read.passed_over[..] else { panic!("{:?}", read.passed_over) };
        assert!(hidden.ends_with("not read, as hidden: .ed.toml"), "{hidden}");
    }

    #[test]
    fn a_name_that_two_submissions_have_is_the_end_of_the_path_that_tells_them_apart() {
        fn names<const N: usize>(paths: [&str; N]) -> [String; N] {
            let name = String::new;
            let handed =
                paths.map(|path| Handed { path: path.into(), name: name(), refused: None });
            handed.each_ref().map(|file| distinct(&file.path, &handed))
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
