//! The scene that came with a file: in the head of an exported script's log, or in a scene file
//! beside a plan or a flight. Room, camera and drone go with a flight so.

use std::path::{Path, PathBuf};

use super::{LIMIT, Scene};
use noctograph_core::error::Result;
use noctograph_logs::scene_in;

/// Ending of the scene file of a plan or a flight, in the place of theirs.
const ENDING: &str = "scene.toml";

/// Name of the scene file of a folder, and beginnings of the files in it that have that scene.
const OF_FOLDER: &str = "scene.toml";
const FOLDERS_FILES: [&str; 2] = ["plan", "flight"];

/// The text of a scene that came with a file.
#[derive(Clone, Debug)]
pub struct CarriedScene {
    /// TOML.
    pub toml: String,
    /// Where it was found, in messages.
    pub file: String,
    /// Whether it is in a log, which may come from anywhere.
    pub is_in_log: bool,
}

impl CarriedScene {
    /// The scene of a log, a plan or a flight; `None` where none came with it.
    ///
    /// # Errors
    ///
    /// [`Io`](noctograph_core::error::Error::Io) for a scene file that cannot be read.
    pub fn of(path: &Path) -> Result<Option<Self>> {
        // A pipe can be read once.
        if !path.is_file() {
            return Ok(None);
        }
        if let Some(toml) = scene_in(path) {
            let file = format!("{} (scene)", path.display());
            return Ok(Some(Self { toml, file, is_in_log: true }));
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let is_folders = FOLDERS_FILES.iter().any(|name| {
            let number = stem.strip_prefix(name).map(|rest| rest.trim_start_matches('-'));
            number.is_some_and(|number| number.bytes().all(|digit| digit.is_ascii_digit()))
        });
        let of_folder = is_folders.then(|| path.with_file_name(OF_FOLDER));
        let files = std::iter::once(Self::place(path)).chain(of_folder);
        let Some(file) = files.into_iter().find(|file| file.is_file()) else { return Ok(None) };
        let toml = LIMIT.read_text(&file)?;
        Ok(Some(Self { toml, file: file.display().to_string(), is_in_log: false }))
    }

    /// Where the scene of a plan or a flight is written.
    #[must_use]
    pub fn place(path: &Path) -> PathBuf {
        path.with_extension(ENDING)
    }

    /// The scene with settings laid over it, see [`Scene::parse_with`].
    ///
    /// # Errors
    ///
    /// As [`Scene::parse_with`].
    pub fn scene(&self, settings: &[(&str, &str)]) -> Result<Scene> {
        Scene::parse_with(&self.toml, &self.file, settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_comes_with_a_log_a_file_of_its_own_or_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [
            ("NO_flight.json", r#"{"noctograph": {"uri": "", "scene": "word = \"NO\""}, "a": {}}"#),
            ("other.json", r#"{"noctograph": {"scene": 7}}"#),
            ("own.csv", ""),
            ("own.scene.toml", "word = \"OWN\""),
            ("scene.toml", "word = \"ALL\""),
            ("plan-12.csv", ""),
            ("flight.csv", ""),
            ("planned.csv", ""),
        ] {
            std::fs::write(at(name), text).unwrap();
        }
        let word = |name: &str| {
            let carried = CarriedScene::of(&at(name)).unwrap()?;
            Some(carried.scene(&[]).unwrap().word)
        };
        let words = ["NO_flight.json", "own.csv", "plan-12.csv", "flight.csv"].map(word);
        assert_eq!(words.map(Option::unwrap), ["NO", "OWN", "ALL", "ALL"]);
        let none = ["other.json", "planned.csv", "missing.csv", "."].map(word);
        assert_eq!(none, [const { None }; 4]);
        // `--scene` takes them as well.
        let named = |name: &str| Scene::read(&at(name)).map(|scene| scene.word);
        assert_eq!(named("NO_flight.json").unwrap(), "NO");
        assert!(
            named("planned.csv").is_err_and(|error| error.to_string().contains("without a scene"))
        );
    }
}
