//! Submissions: the scenes of a course under a task, and those that are refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::Unranked;
use noctograph_core::error::Result;
use noctograph_core::files::{ending, entries_in, file_name};
use noctograph_pipeline::scene::{NamedScene, SceneTask};

/// What a task makes of its submissions.
#[derive(Debug, Default)]
pub struct Submissions {
    /// Scenes under the names of their rows.
    pub scenes: Vec<NamedScene>,
    /// Submissions that are broken, or change what they may not; the others are as they are.
    pub refused: Vec<Unranked>,
    /// Entries of folders that are no submissions, with the reason, by folder.
    pub passed_over: Vec<String>,
}

/// A file of a submission, and the name of its row.
struct Handed {
    path: PathBuf,
    name: String,
}

/// Reads submissions: files (TOML), folders of them, and folders of a folder for each student, as
/// learning platforms hand them out. A row has the name of its file, behind that of the student's
/// folder; a name that two of them have is as much of the path as tells them apart. Every other
/// entry of a folder is named.
///
/// # Errors
///
/// As [`entries_in`].
pub fn submissions(task: &SceneTask, named: &[String]) -> Result<Submissions> {
    let (mut handed, mut passed_over) = (Vec::new(), Vec::new());
    for path in named.iter().map(PathBuf::from) {
        match path.is_dir() {
            true => gather(&path, None, &mut handed, &mut passed_over)?,
            false => handed.push(Handed { name: stem(&path), path }),
        }
    }
    let mut n_named = BTreeMap::new();
    handed.iter().for_each(|it| *n_named.entry(it.name.clone()).or_insert(0) += 1);
    let mut read = Submissions { passed_over, ..Submissions::default() };
    for Handed { path, name } in &handed {
        let name = if n_named[name] == 1 { name.clone() } else { distinct(path, &handed) };
        match task.submission(path) {
            Ok(scene) => read.scenes.push(NamedScene::new(&name, scene)),
            Err(error) => {
                let note = format!("refused: {error} ({})", error.hint());
                read.refused.push(Unranked { contender: name, note });
            }
        }
    }
    Ok(read)
}

/// Adds the submissions in a folder, and in a student's folders of it, and the entries that are
/// none.
fn gather(
    folder: &Path,
    student: Option<&str>,
    handed: &mut Vec<Handed>,
    passed_over: &mut Vec<String>,
) -> Result<()> {
    let (mut others, before) = (Vec::new(), handed.len());
    for path in entries_in(folder)? {
        let name = file_name(&path);
        match why_not(&path, &name, student.is_some()) {
            Some(why) => others.push(format!("{name} ({why})")),
            None if path.is_dir() => gather(&path, Some(&name), handed, passed_over)?,
            None => {
                let stem = stem(&path);
                let name = student.map_or(stem.clone(), |student| format!("{student}/{stem}"));
                handed.push(Handed { path, name });
            }
        }
    }
    if student.is_some() && handed.len() == before {
        others.push("no file *.toml is in it".to_owned());
    }
    if !others.is_empty() {
        passed_over.push(format!("{}: not read: {}", folder.display(), others.join(", ")));
    }
    Ok(())
}

/// The reason why an entry of a folder is no submission.
fn why_not(path: &Path, name: &str, is_in_student: bool) -> Option<&'static str> {
    Some(match &*ending(path) {
        _ if name.starts_with('.') => "a hidden file",
        _ if !path.exists() => "a link to nothing",
        _ if path.is_dir() && is_in_student => "a folder in a student's folder",
        _ if path.is_dir() => return None,
        _ if !path.is_file() => "no regular file",
        "toml" => return None,
        "zip" | "7z" | "rar" | "gz" | "tar" | "tgz" | "xz" => "an archive: unpack it",
        _ => "not called *.toml",
    })
}

/// The end of a path that no other submission has, as short as may be; all of a path that is named
/// twice.
fn distinct(path: &Path, all: &[Handed]) -> String {
    let end = |path: &Path, n: usize, has_ending: bool| {
        let path = if has_ending { path.to_owned() } else { path.with_extension("") };
        let parts: Vec<_> =
            path.components().map(|it| it.as_os_str().to_string_lossy().into_owned()).collect();
        parts[parts.len().saturating_sub(n)..].join("/")
    };
    let ends = (1..=path.components().count()).flat_map(|n| [(n, false), (n, true)]);
    let is_distinct = |&(n, has_ending): &(usize, bool)| {
        let wanted = end(path, n, has_ending);
        all.iter().filter(|it| end(&it.path, n, has_ending) == wanted).count() == 1
    };
    let shortest = ends.into_iter().find(is_distinct);
    shortest.map_or_else(|| path.display().to_string(), |(n, ends)| end(path, n, ends))
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::Scene;

    #[test]
    fn every_entry_of_a_folder_has_a_row_or_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let lqr = "[controller]\nkind = \"lqr\"\n";
        let deep = "bo_12/more";
        std::fs::create_dir_all(folder.path().join(deep)).unwrap();
        std::fs::create_dir(folder.path().join("eve_13")).unwrap();
        let rows = ["BEN.TOML", "anna.toml", "bo_12/gains.toml"];
        let others =
            ["cy.toml.txt", "dora.zip", ".ed.toml", "eve_13/gains.py", "bo_12/more/x.toml"];
        for name in rows.iter().chain(&others) {
            std::fs::write(folder.path().join(name), lqr).unwrap();
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink("gone.toml", folder.path().join("fay.toml")).unwrap();
        let task = SceneTask::new(Scene::find("cf21", &[]).unwrap().scene, &[]).unwrap();
        let read = submissions(&task, &[folder.path().display().to_string()]).unwrap();
        let names: Vec<&str> = read.scenes.iter().map(|it| &*it.name).collect();
        assert_eq!(names, ["BEN", "anna", "bo_12/gains"]);
        let said = read.passed_over.join("\n");
        for named in [
            "cy.toml.txt (not called *.toml)",
            "dora.zip (an archive: unpack it)",
            ".ed.toml (a hidden file)",
            "eve_13: not read: gains.py (not called *.toml), no file *.toml is in it",
            "bo_12: not read: more (a folder in a student's folder)",
        ] {
            assert!(said.contains(named), "{named}: {said}");
        }
        assert!(cfg!(not(unix)) || said.contains("fay.toml (a link to nothing)"), "{said}");
    }

    #[test]
    fn a_name_that_two_submissions_have_is_the_end_of_the_path_that_tells_them_apart() {
        let all =
            ["/c/x/ada/gains.toml", "/c/x/bo/gains.toml", "/c/y/bo/gains.toml", "a.toml", "a.TOML"];
        let all = all.map(|path| Handed { path: path.into(), name: String::new() });
        let names = all.each_ref().map(|it| distinct(&it.path, &all));
        assert_eq!(names, ["ada/gains", "x/bo/gains", "y/bo/gains", "a.toml", "a.TOML"]);
        let twice = [0, 0].map(|_| Handed { path: "/c/a.toml".into(), name: String::new() });
        assert_eq!(distinct(&twice[0].path, &twice), "/c/a.toml");
    }
}
