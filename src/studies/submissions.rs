//! Submissions: the scenes of a course under a task, and those that are refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::Unranked;
use noctograph_core::error::Result;
use noctograph_core::files::files_in;
use noctograph_pipeline::scene::{NamedScene, SceneTask};

/// The scenes of submissions, which are files (TOML) or folders of them, under the names of their
/// files; a name that two of them have is the whole path. One that is broken or changes what it may
/// not is refused, and leaves the others as they are.
///
/// # Errors
///
/// As [`files_in`].
pub fn submissions(task: &SceneTask, named: &[String]) -> Result<(Vec<NamedScene>, Vec<Unranked>)> {
    let mut files = Vec::new();
    for path in named.iter().map(PathBuf::from) {
        let is_toml = |file: &PathBuf| file.extension().is_some_and(|end| end == "toml");
        match path.is_dir() {
            true => files.extend(files_in(&path)?.into_iter().filter(is_toml)),
            false => files.push(path),
        }
    }
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut n_named = BTreeMap::new();
    files.iter().for_each(|path| *n_named.entry(stem(path)).or_insert(0) += 1);
    let (mut scenes, mut refused) = (Vec::new(), Vec::new());
    for path in files {
        let stem = stem(&path);
        let name = if n_named[&stem] == 1 { stem } else { path.display().to_string() };
        match task.submission(&path) {
            Ok(scene) => scenes.push(NamedScene::new(&name, scene)),
            Err(error) => {
                let note = format!("refused: {error} ({})", error.hint());
                refused.push(Unranked { contender: name, note });
            }
        }
    }
    Ok((scenes, refused))
}
