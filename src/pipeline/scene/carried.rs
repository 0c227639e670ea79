//! The scene that came with a file: in the head of an exported script's log, or in a scene file
//! beside a plan or a flight. Room, camera and drone go with a flight so.
//!
//! A scene file names the files that it was written with by their digests. Here is the one place
//! that compares them: a plan beside the scene of another one would be checked in another room.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Scene, folder_of, text};
use noctograph_core::digest::Digest;
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::{Limit, Output, WholeFile};
use noctograph_logs::scene_in;

/// Ending of the scene file of a plan or a flight, in the place of theirs, and name of the one of
/// all plans and flights in a folder.
const SCENE: &str = "scene.toml";

/// Largest plan or flight beside a scene: as large as their reader takes.
const FILE: Limit =
    Limit { bytes: 128 << 20, what: "a plan or a flight", hint: "cut it, or thin it out" };

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
    /// Whether it is the scene of its file beyond doubt: in a log, or with the file's digest, which
    /// scenes of earlier versions and scenes written by hand have not.
    pub is_bound: bool,
}

impl CarriedScene {
    /// The scene of a log, a plan or a flight; `None` where none came with it.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] for a file that cannot be read; [`Error::Input`] for a scene that was written
    /// with other files.
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
        let toml = text::of_file(&file)?;
        let (folder, file) = (folder_of(&file), file.display().to_string());
        let digests = text::digests(&toml, &file)?;
        let is_bound = !digests.is_empty();
        let carried = Self { toml, file, folder, is_in_log: false, is_bound };
        if carried.is_bound {
            carried.check_digest(path, &digests)?;
        }
        Ok(Some(carried))
    }

    /// Whether a plan or a flight is of the set that the scene beside it was written with.
    pub fn binds(path: &Path) -> bool {
        Self::read(path).is_ok_and(|carried| carried.is_some_and(|it| it.is_bound))
    }

    /// Checks that a file is one of those that the scene was written with.
    fn check_digest(&self, path: &Path, digests: &BTreeMap<String, String>) -> Result<()> {
        let mut digest = Digest::default();
        std::io::copy(&mut FILE.open(path)?, &mut digest)
            .map_err(|source| Error::read(path, source))?;
        let actual = digest.hex();
        if digests.values().any(|known| *known == actual) {
            return Ok(());
        }
        let (scene, names) = (&self.file, digests.keys().cloned().collect::<Vec<_>>().join(", "));
        let wanted = match digests.get(name(path)).or(digests.values().next()) {
            Some(known) if digests.len() == 1 || digests.contains_key(name(path)) => {
                format!("the one that {scene} was written with, of digest {known}")
            }
            _ => format!("one of those that {scene} was written with, {names}"),
        };
        let hint = format!(
            "write both again, or name the scene: {scene} is the right one only if you edited {} \
             yourself",
            name(path)
        );
        Err(Error::input(path.display(), format!("a file of digest {actual}"), wanted, hint))
    }

    /// Checks that the scene still is that of files, which were read after it: another program may
    /// have written both anew meanwhile.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] where it is not; as [`Self::of_all`].
    pub fn check_still(&self, files: &[PathBuf]) -> Result<()> {
        if Self::of_all(files)?.is_some_and(|now| now.toml == self.toml) {
            return Ok(());
        }
        let (actual, wanted) = ("a scene that has just changed", "a scene and files at rest");
        Err(Error::input(&*self.file, actual, wanted, "try again"))
    }

    /// Checks that a folder has all plans that its scene was written with.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the plan that is missing.
    pub fn check_folder(&self, folder: &Path) -> Result<()> {
        let digests = text::digests(&self.toml, &self.file)?;
        let mut plans = digests.keys().filter(|name| name.starts_with("plan-"));
        let Some(name) = plans.find(|name| !folder.join(name).is_file()) else { return Ok(()) };
        let hint = "plan again, or name the plans one by one to fly without that drone";
        let wanted = format!("all plans that {} was written with", self.file);
        Err(Error::input(folder.display(), format!("no {name}"), wanted, hint))
    }

    /// The scene in a log's head.
    pub fn in_log(path: &Path) -> Option<Self> {
        let file = format!("{} (scene)", path.display());
        let (toml, folder) = (scene_in(path)?, folder_of(path));
        Some(Self { toml, file, folder, is_in_log: true, is_bound: true })
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
        let is_bound = all.iter().all(|carried| carried.is_bound);
        Ok(all.into_iter().next().map(|first| Self { is_bound, ..first }))
    }

    /// Where the scene of a plan or a flight is written.
    pub fn place(path: &Path) -> PathBuf {
        path.with_extension(SCENE)
    }

    /// The text of a scene file beside files of these names and digests.
    pub fn text(toml: &str, files: impl IntoIterator<Item = (String, String)>) -> String {
        toml.to_owned() + &text::of_digests(files.into_iter().collect())
    }

    /// Gives a plan or a flight, its scene and what that names their names, the plan first.
    ///
    /// # Errors
    ///
    /// As [`Scene::beside`] and [`WholeFile::keep_all`].
    pub fn keep_with(file: WholeFile, beside: Output, scene: &Scene) -> Result<Vec<PathBuf>> {
        let scene = scene.beside(file.path())?;
        let toml = Self::text(&scene.toml, [(file.name(), file.sha256().to_owned())]);
        let mut files = scene.write_copies(file.path())?;
        files.push(beside.write_with(|out| out.write_all(toml.as_bytes()))?);
        files.push(file);
        // A kill between the names leaves the new scene, which no other plan fits: never a plan
        // without the scene that it has.
        let mut files = WholeFile::keep_all(files)?;
        files.reverse();
        Ok(files)
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

fn name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::digest::sha256;

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
        std::fs::write(path("planned.scene.toml"), "\n").unwrap();
        assert!(CarriedScene::read(&path("planned.csv")).is_err(), "a scene that was cut off");
        std::fs::remove_file(path("planned.scene.toml")).unwrap();
        // `--scene` takes them as well.
        let named = |name: &str| Scene::read(&path(name)).map(|scene| scene.word);
        assert_eq!(named("NO_flight.json").unwrap(), "NO");
        assert!(
            named("planned.csv").is_err_and(|error| error.to_string().contains("without a scene"))
        );
    }

    #[test]
    fn a_scene_with_digests_is_that_of_its_files_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let scene = Scene::parse("word = \"NO\"", "scene").unwrap();
        let files = [("plan.csv", "1"), ("flight.csv", "2")];
        let digests = files.map(|(name, text)| (name.to_owned(), sha256(text.as_bytes())));
        let text = CarriedScene::text(&scene.to_toml(), digests);
        assert!(text.starts_with(&scene.to_toml()), "settings as they are");
        std::fs::write(path("scene.toml"), text).unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(path(name), text).unwrap());
        std::fs::write(path("plan-2.csv"), "3").unwrap();
        for (name, _) in files {
            let carried = CarriedScene::read(&path(name)).unwrap().unwrap();
            assert!(carried.is_bound && carried.scene(&[]).unwrap() == scene, "{name}");
            carried.check_still(&[path(name)]).unwrap();
        }
        let error = CarriedScene::read(&path("plan-2.csv")).unwrap_err().to_string();
        assert!(error.contains(&sha256(b"3")) && error.contains("flight.csv, plan.csv"), "{error}");
        assert!(Scene::read(&path("plan-2.csv")).is_err(), "named as the scene, too");
        // Another program writes both anew between the scene and its plan.
        let carried = CarriedScene::read(&path("plan.csv")).unwrap().unwrap();
        std::fs::write(path("plan.csv"), "4").unwrap();
        let digests = [("plan.csv".to_owned(), sha256(b"4"))];
        std::fs::write(path("scene.toml"), CarriedScene::text(&scene.to_toml(), digests)).unwrap();
        let error = carried.check_still(&[path("plan.csv")]).unwrap_err().to_string();
        assert!(error.contains("has just changed"), "{error}");
    }
}
