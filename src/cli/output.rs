//! Files that a verb writes.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Error, Result};
use crate::scene::{CarriedScene, Scene, SceneFiles};
use noctograph_core::files::ending;
pub(super) use noctograph_core::files::{Output, OutputFolder};

/// Whether a path names an SVG drawing.
pub(super) fn is_svg(path: &Path) -> bool {
    ending(path) == "svg"
}

/// Name of the scene file in a folder.
pub(super) const SCENE: &str = "scene.toml";

/// Whether a path names a plan or a flight.
pub(super) fn is_csv(path: &Path) -> bool {
    ending(path) == "csv"
}

/// Files of one kind, one for each drone, with their scene: a file and its scene's, or numbered
/// files in a folder.
#[derive(Debug)]
pub(super) enum Outputs {
    One(Output, Option<Output>),
    Several(PathBuf, OutputFolder, &'static str),
}

impl Outputs {
    /// Opens `path`, or by default `kind.csv` or the folder `kinds`.
    pub(super) fn create(path: Option<&Path>, kind: &'static str, n: usize) -> Result<Self> {
        let named = path.filter(|path| n > 1 && is_csv(path));
        if let Some(path) = named.filter(|path| !path.is_dir()) {
            let (actual, hint) = (format!("a file for {n} drones"), "leave out .csv");
            let place = path.display().to_string();
            return Err(Error::input(place, actual, "a folder for a file of each", hint));
        }
        let path = |default: String| path.map_or_else(|| default.into(), Path::to_owned);
        Ok(match n {
            1 => {
                let path = path(format!("{kind}.csv"));
                let file = Output::create(&path)?;
                // Nothing stands beside a device or a pipe.
                let scene = file.is_staged().then(|| Output::create(&CarriedScene::place(&path)));
                Self::One(file, scene.transpose()?)
            }
            _ => {
                let path = path(format!("{kind}s"));
                let folder = OutputFolder::create(&path)?;
                Self::Several(path, folder, kind)
            }
        })
    }

    /// Writes one table a drone into the file or the folder, and keeps them.
    pub(super) fn keep<T>(
        self,
        items: &[T],
        scene: Option<&Scene>,
        write: impl Fn(&T, &mut dyn Write) -> std::io::Result<()>,
    ) -> Result<Vec<PathBuf>> {
        match self {
            Self::One(file, beside) => {
                let mut files = vec![file.keep_with(|out| write(&items[0], out))?];
                match (beside, scene) {
                    (Some(beside), Some(scene)) => {
                        let scene = scene.beside(&files[0])?;
                        files.extend(keep_copies(&files[0], &scene)?);
                        files.push(beside.keep(scene.toml)?);
                    }
                    (Some(_), None) => forget_scene(&files[0]),
                    (None, _) => {}
                }
                Ok(files)
            }
            Self::Several(path, mut folder, kind) => {
                for (number, item) in (1..).zip(items) {
                    folder.write_with(&format!("{kind}-{number}.csv"), |out| write(item, out))?;
                }
                if let Some(scene) = scene {
                    write_scene(scene, &path, &mut folder)?;
                }
                folder.keep()
            }
        }
    }
}

/// Writes a scene into a folder, with the files that it names.
pub(super) fn write_scene(scene: &Scene, path: &Path, folder: &mut OutputFolder) -> Result<()> {
    let files = scene.in_folder(path, "")?;
    files.copies.iter().try_for_each(|(name, bytes)| folder.write(name, bytes))?;
    folder.write(SCENE, files.toml)
}

/// Writes the files that a scene beside a file names.
pub(super) fn keep_copies(path: &Path, scene: &SceneFiles) -> Result<Vec<PathBuf>> {
    let copies = scene.copies.iter();
    copies.map(|(name, bytes)| Output::create(&path.with_file_name(name))?.keep(bytes)).collect()
}

/// Removes the scene of a flight or plan that is written anew in another one.
pub(super) fn forget_scene(path: &Path) {
    let _ = std::fs::remove_file(CarriedScene::place(path));
}
