//! The scene that came with a file: in the head of an exported script's log, or in a scene file
//! beside a plan or a flight. Room, camera and drone go with a flight so.

use std::path::{Path, PathBuf};

use super::{LIMIT, Scene, folder_of};
use noctograph_core::error::{Error, Place, Result};
use noctograph_logs::scene_in;

/// Ending of the scene file of a plan or a flight, in the place of theirs, and name of the one of
/// all plans and flights in a folder.
const SCENE: &str = "scene.toml";

/// The text of a scene that came with a file.
#[derive(Clone, Debug)]
pub struct CarriedScene {
    /// TOML.
    pub toml: String,
    /// Where it was found, in messages.
    pub file: String,
    /// The folder from which it names files.
    pub folder: PathBuf,
    /// Whether it is in a log, which may come from anywhere.
    pub is_in_log: bool,
}

impl CarriedScene {
    /// The scene of a log, a plan or a flight; `None` where none came with it.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] for a scene file that cannot be read.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        // A pipe can be read once.
        if !path.is_file() {
            return Ok(None);
        }
        if let Some(carried) = Self::in_log(path) {
            return Ok(Some(carried));
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let number = stem.strip_prefix("plan").or_else(|| stem.strip_prefix("flight"));
        let is_number = |text: &str| text.bytes().all(|it| it.is_ascii_digit() || it == b'-');
        let of_folder = number.is_some_and(is_number).then(|| path.with_file_name(SCENE));
        let mut files = std::iter::once(Self::place(path)).chain(of_folder);
        let Some(file) = files.find(|file| file.is_file()) else { return Ok(None) };
        let toml = LIMIT.read_text(&file)?;
        let (folder, file) = (folder_of(&file), file.display().to_string());
        Ok(Some(Self { toml, file, folder, is_in_log: false }))
    }

    /// The scene in a log's head.
    pub fn in_log(path: &Path) -> Option<Self> {
        let file = format!("{} (scene)", path.display());
        Some(Self { toml: scene_in(path)?, file, folder: folder_of(path), is_in_log: true })
    }

    /// The one scene that came with some of several files; seeds may differ.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] where two came; as [`Self::read`].
    pub fn of_all(files: &[PathBuf]) -> Result<Option<Self>> {
        let all = files.iter().map(|path| Self::read(path)).collect::<Result<Vec<_>>>()?;
        let all: Vec<Self> = all.into_iter().flatten().collect();
        let unseeded = |carried: &Self| carried.scene(&[("seed", "0")]).ok();
        let differs =
            |other: &&Self| other.toml != all[0].toml && unseeded(other) != unseeded(&all[0]);
        if let Some(other) = all.iter().find(differs) {
            let hint = "name the scene, or the files one at a time";
            let actual = format!("another scene than {}", all[0].file);
            return Err(Error::input(
                Place::file(&other.file),
                actual,
                "one scene of all files",
                hint,
            ));
        }
        Ok(all.into_iter().next())
    }

    /// Where the scene of a plan or a flight is written.
    pub fn place(path: &Path) -> PathBuf {
        path.with_extension(SCENE)
    }

    /// The scene with settings laid over it, see [`Scene::parse_with`].
    ///
    /// # Errors
    ///
    /// As [`Scene::parse_with`].
    pub fn scene(&self, settings: &[(&str, &str)]) -> Result<Scene> {
        Scene::parse_in(&self.toml, &self.file, &self.folder, settings)
    }

    /// The same; of a log, without files other than those that settings name, since its author
    /// would choose the files opened on this machine.
    ///
    /// # Errors
    ///
    /// As [`Self::scene`], and [`Error::Input`] with the key of a file.
    pub fn distrusted_scene(&self, settings: &[(&str, &str)]) -> Result<Scene> {
        let scene = self.scene(settings)?;
        let background = Some("photo.background").filter(|_| !scene.photo.background.is_empty());
        let unset = |key: &&str| self.is_in_log && settings.iter().all(|(set, _)| set != key);
        let key = scene.letters.files().map(|(key, _)| key).chain(background).find(unset);
        if let Some(key) = key {
            let wanted = "no file: the scene of a log may name any on this machine";
            let hint = "name the log as the scene as well, if you know who made it";
            return Err(
                Error::input(key, "the path of a file", wanted, hint).in_file(&self.file, None)
            );
        }
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_comes_with_a_log_a_file_of_its_own_or_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
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
            std::fs::write(path(name), text).unwrap();
        }
        let word = |name: &str| {
            let carried = CarriedScene::read(&path(name)).unwrap()?;
            Some(carried.scene(&[]).unwrap().word)
        };
        let words = ["NO_flight.json", "own.csv", "plan-12.csv", "flight.csv"].map(word);
        assert_eq!(words.map(Option::unwrap), ["NO", "OWN", "ALL", "ALL"]);
        let none = ["other.json", "planned.csv", "missing.csv", "."].map(word);
        assert_eq!(none, [const { None }; 4]);
        // `--scene` takes them as well.
        let named = |name: &str| Scene::read(&path(name)).map(|scene| scene.word);
        assert_eq!(named("NO_flight.json").unwrap(), "NO");
        assert!(
            named("planned.csv").is_err_and(|error| error.to_string().contains("without a scene"))
        );
    }
}
