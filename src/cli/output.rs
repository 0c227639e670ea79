//! Output files of a verb.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::scene::{CarriedScene, Scene, SceneFiles};
pub(super) use noctograph_core::files::{Output, OutputFolder};
use noctograph_core::files::{WholeFile, ending, file_name, files_in};

/// True if a path has the extension of an SVG file.
pub(super) fn is_svg(path: &Path) -> bool {
    ending(path) == "svg"
}

/// Name of the scene file in an output folder.
pub(super) const SCENE: &str = "scene.toml";

/// True if a path has the extension of a plan or a flight.
pub(super) fn is_csv(path: &Path) -> bool {
    ending(path) == "csv"
}

/// Output files of one kind with their scene, which are a file with the scene beside it, or a
/// folder with the scene and a numbered file for each drone.
#[derive(Debug)]
pub(super) enum Outputs {
    One(Output, Option<Output>),
    Several(PathBuf, OutputFolder, &'static str),
}

impl Outputs {
    /// Opens `path` for the files of `n_drones` drones. For one drone, `path` is a table
    /// (`kind.csv` by default) with its scene beside it, and for several drones a folder (`kinds`
    /// by default). Returns [`Error::Input`] for a single table of several drones.
    pub(super) fn create(path: Option<&Path>, kind: &'static str, n_drones: usize) -> Result<Self> {
        if let Some(path) = path.filter(|path| n_drones > 1 && is_csv(path) && !path.is_dir()) {
            let (actual, hint) = (format!("a single file for {n_drones} drones"), "leave out .csv");
            let place = path.display().to_string();
            return Err(Error::input(
                place,
                actual,
                "a folder, because each drone has its own file",
                hint,
            ));
        }
        let path_or = |default: String| path.map_or_else(|| default.into(), Path::to_owned);
        // Files are opened before the long computation, to refuse an unwritable path early.
        Ok(match n_drones {
            1 => {
                let path = path_or(format!("{kind}.csv"));
                let file = Output::create(&path)?;
                // No scene is written beside a device or a pipe.
                let scene =
                    file.is_staged().then(|| Output::create(&CarriedScene::path_beside(&path)));
                Self::One(file, scene.transpose()?)
            }
            _ => {
                let path = path_or(format!("{kind}s"));
                let folder = OutputFolder::create(&path)?;
                Self::Several(path, folder, kind)
            }
        })
    }

    /// Writes the table of each drone with `write`, together with the scene. Without a scene,
    /// removes an earlier scene beside a single table. In a folder, removes the tables of an
    /// earlier set with more drones. Returns the paths.
    pub(super) fn keep<T>(
        self,
        items: &[T],
        scene: Option<&Scene>,
        write: impl Fn(&T, &mut dyn Write) -> std::io::Result<()>,
    ) -> Result<Vec<PathBuf>> {
        // A file and its scene are renamed together, so that they always match.
        match self {
            Self::One(file, beside) => {
                let file = file.write_with(|out| write(&items[0], out))?;
                let may_have_scene = beside.is_some();
                if let Some((beside, scene)) = beside.zip(scene) {
                    return CarriedScene::keep_with(file, beside, scene);
                }
                let file = file.keep()?;
                if may_have_scene {
                    forget_scene(&file);
                }
                Ok(vec![file])
            }
            Self::Several(path, mut folder, kind) => {
                let mut digests = Vec::new();
                for (number, item) in (1..).zip(items) {
                    let name = format!("{kind}-{number}.csv");
                    let sha256 = folder.write_with(&name, |out| write(item, out))?;
                    digests.push((name, sha256));
                }
                folder.replaces(leftovers(&path, kind, items.len())?);
                if let Some(scene) = scene {
                    write_scene(scene, &path, &mut folder, digests)?;
                }
                folder.keep()
            }
        }
    }
}

/// Returns the drone's number in the name of a file of a kind, such as 2 for `plan-2.csv`, or
/// `None` for other names.
pub(super) fn drone_number(path: &Path, kind: &str) -> Option<usize> {
    let name = file_name(path).to_lowercase();
    name.strip_prefix(kind)?.strip_prefix('-')?.strip_suffix(".csv")?.parse().ok()
}

/// Returns the files in a folder with numbers above `n_drones`, which belong to an earlier, larger
/// set. The caller removes them, because they would otherwise be flown together with the new files.
///
/// # Errors
///
/// [`Error::Input`] for such files that do not belong to the folder's scene, because they may be
/// the user's.
pub(super) fn leftovers(folder: &Path, kind: &str, n_drones: usize) -> Result<Vec<PathBuf>> {
    let files = files_in(folder)?.into_iter();
    let left = files.filter(|path| drone_number(path, kind).is_some_and(|n| n > n_drones));
    let (former, others): (Vec<_>, Vec<_>) = left.partition(|path| CarriedScene::binds(path));
    if others.is_empty() {
        return Ok(former);
    }
    let names: Vec<String> = others.iter().map(file_name).collect();
    let hint = "remove the files, or name another folder, because all files in a folder are flown \
         together";
    let wanted = format!("{kind} files of at most {n_drones} drones");
    Err(Error::input(folder.display(), names.join(", "), wanted, hint))
}

/// Writes a scene into a folder, with the digests of its plans or flights by their names, and with
/// copies of the files that it names. `path` is the folder's final path.
pub(super) fn write_scene(
    scene: &Scene,
    path: &Path,
    folder: &mut OutputFolder,
    digests: Vec<(String, String)>,
) -> Result<()> {
    let files = scene.in_folder(path, "")?;
    for (name, bytes) in &files.copies {
        folder.write(name, bytes)?;
    }
    folder.write_first(SCENE, CarriedScene::text(&files.toml, digests))
}

/// Copies the files that a scene names into the folder of the scene's file `path`. Returns the
/// paths of the copies.
pub(super) fn keep_copies(path: &Path, scene: &SceneFiles) -> Result<Vec<PathBuf>> {
    WholeFile::keep_all(scene.write_copies(path)?)
}

/// Removes the scene beside a flight or plan, which does not belong to the new file. A failure to
/// remove it is ignored, because its digest then shows that it belongs to another file.
pub(super) fn forget_scene(path: &Path) {
    let _ = std::fs::remove_file(CarriedScene::path_beside(path));
}
