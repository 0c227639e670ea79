//! Files that a verb writes.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Error, Result};
use crate::scene::{CarriedScene, Scene};
use noctograph_core::files::WholeFile;
pub(super) use noctograph_core::files::{Output, OutputFolder};

/// Whether a path names an SVG drawing.
pub(super) fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("svg"))
}

/// Name of the scene file in a folder.
pub(super) const SCENE: &str = "scene.toml";

/// Whether a path names a plan or a flight.
pub(super) fn is_csv(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "csv")
}

/// Files of one kind, one for each drone, with their scene: a file and its scene's, or numbered
/// files in a folder.
#[derive(Debug)]
pub(super) enum Outputs {
    One(Output, Option<Output>),
    Several(OutputFolder, &'static str),
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
            _ => Self::Several(OutputFolder::create(&path(format!("{kind}s")))?, kind),
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
                let file = file.write_with(|out| write(&items[0], out))?;
                let has_place = beside.is_some();
                let Some((beside, scene)) = beside.zip(scene) else {
                    let file = file.keep()?;
                    if has_place {
                        forget_scene(&file);
                    }
                    return Ok(vec![file]);
                };
                let digest = (file.name(), file.sha256().to_owned());
                let toml = CarriedScene::text(scene, [digest]);
                let scene = beside.write_with(|out| out.write_all(toml.as_bytes()))?;
                // A kill between the names leaves the new scene, which no other plan fits: never a
                // plan without the scene that it has.
                let mut files = WholeFile::keep_all(vec![scene, file])?;
                files.reverse();
                Ok(files)
            }
            Self::Several(mut folder, kind) => {
                let mut digests = Vec::new();
                for (number, item) in (1..).zip(items) {
                    let name = format!("{kind}-{number}.csv");
                    let sha256 = folder.write_with(&name, |out| write(item, out))?;
                    digests.push((name, sha256));
                }
                if let Some(scene) = scene {
                    folder.write_first(SCENE, CarriedScene::text(scene, digests))?;
                }
                folder.keep()
            }
        }
    }
}

/// Removes the scene of a flight or plan that is written anew in another one.
pub(super) fn forget_scene(path: &Path) {
    let _ = std::fs::remove_file(CarriedScene::place(path));
}
