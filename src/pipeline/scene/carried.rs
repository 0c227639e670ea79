//! The scene that came with a file: in the header of a script's log, or in a scene file next to a
//! plan or a flight. The scene defines the room, the camera and the drone of the flight.
//!
//! A scene file contains the digests of the files with which it was written. Only this module
//! compares them, so that no plan is checked against the scene of another plan.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Scene, folder_of, text};
use noctograph_core::digest::Digest;
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::{Limit, Output, WholeFile, as_spelled};
use noctograph_logs::scene_in;

/// Extension of a scene file next to a plan or a flight, and name of a folder's scene file.
const SCENE: &str = "scene.toml";

/// Size limit for plans and flights next to a scene, equal to that of their reader.
const FILE: Limit = Limit {
    bytes: 128 << 20,
    what: "a plan or a flight",
    hint: "shorten the file, or remove some of its rows",
};

/// Text of a scene that came with a file.
#[derive(Clone, Debug)]
pub struct CarriedScene {
    /// Text of the scene as TOML.
    pub toml: String,
    /// Name of the scene's file, to show in messages.
    pub file: String,
    /// Folder to which file names in the scene are relative.
    pub folder: PathBuf,
    /// True if the scene comes from a log, which is not trusted.
    is_in_log: bool,
    /// True if the scene certainly belongs to its file, because it is in a log or contains the
    /// file's digest. Scenes written by earlier versions or by hand contain no digests.
    pub is_bound: bool,
}

impl CarriedScene {
    /// Reads the scene of a log, a plan or a flight. Returns `None` if no scene came with the file.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] for an unreadable file, and [`Error::Input`] for a scene that was
    /// written together with a different set of files.
    pub fn read(path: &Path) -> Result<Option<Self>> {
        // A named pipe can be read only once, and its plan or flight must still be read.
        if !path.is_file() {
            return Ok(None);
        }
        if let Some(carried) = Self::in_log(path) {
            return Ok(Some(carried));
        }
        // The scene of a folder belongs to those plans and flights in it that have numbered names.
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let number = stem.strip_prefix("plan").or_else(|| stem.strip_prefix("flight"));
        let is_numbered =
            number.is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit() || b == b'-'));
        let in_folder = is_numbered.then(|| path.with_file_name(SCENE));
        let named = std::iter::once(Self::path_beside(path)).chain(in_folder);
        let mut files = named.map(|file| as_spelled(&file));
        let Some(file) = files.find(|file| file.is_file()) else { return Ok(None) };
        let toml = text::read_file(&file)?;
        let (folder, file) = (folder_of(&file), file.display().to_string());
        let digests = text::digests(&toml, &file)?;
        let is_bound = !digests.is_empty();
        let carried = Self { toml, file, folder, is_in_log: false, is_bound };
        if carried.is_bound {
            carried.check_digest(path, &digests)?;
        }
        Ok(Some(carried))
    }

    /// Returns true if the scene next to a plan or flight was written together with that file.
    pub fn binds(path: &Path) -> bool {
        Self::read(path).is_ok_and(|carried| carried.is_some_and(|carried| carried.is_bound))
    }

    /// Checks that the digest of a file is one of those with which the scene was written. Returns
    /// [`Error::Input`] otherwise.
    fn check_digest(&self, path: &Path, digests: &BTreeMap<String, String>) -> Result<()> {
        let mut digest = Digest::default();
        std::io::copy(&mut FILE.open(path)?, &mut digest)
            .map_err(|source| Error::read(path, source))?;
        let actual = digest.hex();
        if digests.values().any(|digest| *digest == actual) {
            return Ok(());
        }
        // The message states the digest of the file with this name, or the names of all files.
        let (scene, names) = (&self.file, digests.keys().cloned().collect::<Vec<_>>().join(", "));
        let wanted = match digests.get(name(path)).or(digests.values().next()) {
            Some(digest) if digests.len() == 1 || digests.contains_key(name(path)) => {
                format!("the file with digest {digest}, with which {scene} was written")
            }
            _ => format!("one of the files with which {scene} was written, {names}"),
        };
        let hint = format!(
            "write both files again, or name the scene: {scene} is right only if you edited {} \
             yourself",
            name(path)
        );
        Err(Error::input(path.display(), format!("a file with digest {actual}"), wanted, hint))
    }

    /// Checks, after files have been read, that they still belong to this scene. Another program
    /// may have rewritten the scene and the files in the meantime.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::of_all`], and [`Error::Input`] if the scene is different.
    pub fn check_still(&self, files: &[PathBuf]) -> Result<()> {
        if Self::of_all(files)?.is_some_and(|now| now.toml == self.toml) {
            return Ok(());
        }
        let actual = "a scene that has just changed";
        let wanted = "a scene and files that do not change while they are read";
        Err(Error::input(&*self.file, actual, wanted, "try again"))
    }

    /// Checks that a folder contains all plans with which its scene was written.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that names the missing plan.
    pub fn check_folder(&self, folder: &Path) -> Result<()> {
        let digests = text::digests(&self.toml, &self.file)?;
        let mut plans = digests.keys().filter(|name| name.starts_with("plan-"));
        let missing = plans.find(|name| !as_spelled(&folder.join(name)).is_file());
        let Some(name) = missing else { return Ok(()) };
        let hint = "plan again, or name the plans one by one to fly without that drone";
        let wanted = format!("all plans with which {} was written", self.file);
        Err(Error::input(folder.display(), format!("no {name}"), wanted, hint))
    }

    /// Returns the scene in the header of a log, or `None` for a file without one.
    pub fn in_log(path: &Path) -> Option<Self> {
        let file = format!("{} (scene)", path.display());
        let (toml, folder) = (scene_in(path)?, folder_of(path));
        Some(Self { toml, file, folder, is_in_log: true, is_bound: true })
    }

    /// Returns the scene that came with the files. Files without a scene are ignored, and the
    /// scenes may differ in their seed.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::read`], and [`Error::Input`] for two different scenes.
    pub fn of_all(files: &[PathBuf]) -> Result<Option<Self>> {
        let mut scenes = Vec::new();
        for path in files {
            scenes.extend(Self::read(path)?);
        }
        // One file whose scene may not belong to it makes the common scene uncertain.
        let is_bound = scenes.iter().all(|carried| carried.is_bound);
        let Some((first, others)) = scenes.split_first() else { return Ok(None) };
        for other in others {
            if other.toml == first.toml {
                continue;
            }
            let [scene, first_scene] =
                [other, first].map(|carried| carried.scene(&[("seed", "0")]));
            if scene.ok() != first_scene.ok() {
                let hint = "name the scene, or the files one at a time";
                let actual = format!("another scene than {}", first.file);
                let place = Place::file(&other.file);
                return Err(Error::input(place, actual, "one scene for all files", hint));
            }
        }
        Ok(Some(Self { is_bound, ..first.clone() }))
    }

    /// Returns the path of the scene file next to a plan or a flight.
    pub fn path_beside(path: &Path) -> PathBuf {
        path.with_extension(SCENE)
    }

    /// Returns the text of a scene file that lists the names and digests of the files next to it.
    pub fn text(toml: &str, files: impl IntoIterator<Item = (String, String)>) -> String {
        toml.to_owned() + &text::digest_table(files.into_iter().collect())
    }

    /// Moves a completely written plan or flight to its final name, with its scene and the files
    /// named in the scene. Returns their paths, the plan first.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Scene::beside`] and [`WholeFile::keep_all`].
    pub fn keep_with(file: WholeFile, beside: Output, scene: &Scene) -> Result<Vec<PathBuf>> {
        let scene = scene.beside(file.path())?;
        let toml = Self::text(&scene.toml, [(file.name(), file.sha256().to_owned())]);
        let mut files = scene.write_copies(file.path())?;
        files.push(beside.write_with(|out| out.write_all(toml.as_bytes()))?);
        files.push(file);
        // The plan is moved last. If the program is killed before that, the new scene does not
        // match the old plan, so no plan is ever accepted with the scene of another.
        let mut kept = WholeFile::keep_all(files)?;
        kept.reverse();
        Ok(kept)
    }

    /// Returns the scene with settings that override its keys, as in [`Scene::parse_with`].
    pub fn scene(&self, settings: &[(&str, &str)]) -> Result<Scene> {
        Scene::parse_in(&self.toml, &self.file, &self.folder, settings)
    }

    /// Returns the scene with settings that override its keys. Returns an error if the scene comes
    /// from a log and names files, because its author would choose which files this machine opens.
    /// The settings may name files.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::scene`], and [`Error::Input`] with the key that names a file.
    pub fn distrusted_scene(&self, settings: &[(&str, &str)]) -> Result<Scene> {
        let scene = self.scene(settings)?;
        // These keys name a file and are not overridden by the user's settings.
        let background = Some("photo.background").filter(|_| !scene.photo.background.is_empty());
        let keys = scene.letters.files().map(|(key, _)| key).chain(background);
        let refused: Vec<&str> =
            keys.filter(|key| settings.iter().all(|(set, _)| set != key)).collect();
        match refused.first().filter(|_| self.is_in_log) {
            None => Ok(scene),
            Some(key) => {
                let wanted =
                    "no file, because the scene of a log may name any file on this machine";
                let hint = "name the log as the scene as well, if you know who made it";
                let refused = Error::input(*key, "the path of a file", wanted, hint);
                Err(refused.in_file(&self.file, None))
            }
        }
    }
}

/// Returns the name of a file, or an empty text if the name is not Unicode.
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
        // `--scene` accepts these files as well.
        let named = |name: &str| Scene::read(&path(name)).map(|scene| scene.word);
        assert_eq!(named("NO_flight.json").unwrap(), "NO");
        assert!(
            named("planned.csv").is_err_and(|error| error.to_string().contains("without a scene"))
        );
    }

    #[test]
    fn a_plan_keeps_its_scene_in_capitals() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("ALL")).unwrap();
        let text = |file: &str| {
            let digest = (file.to_owned(), sha256(b"1"));
            CarriedScene::text("word = \"NO\"\n", [digest])
        };
        std::fs::write(path("A.SCENE.TOML"), text("a.csv")).unwrap();
        std::fs::write(path("ALL/SCENE.TOML"), text("plan-1.csv")).unwrap();
        for name in ["A.CSV", "ALL/PLAN-1.CSV"] {
            std::fs::write(path(name), "1").unwrap();
            let carried = CarriedScene::read(&path(name)).unwrap().expect(name);
            assert!(carried.is_bound && carried.scene(&[]).unwrap().word == "NO", "{name}");
            std::fs::write(path(name), "2").unwrap();
            assert!(CarriedScene::read(&path(name)).is_err(), "{name} was edited");
            carried.check_folder(path(name).parent().unwrap()).unwrap();
        }
        assert_eq!(Scene::find(path("ALL").to_str().unwrap(), &[]).unwrap().scene.word, "NO");
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
        // Another program rewrites both files after the scene is read but before the plan is.
        let carried = CarriedScene::read(&path("plan.csv")).unwrap().unwrap();
        std::fs::write(path("plan.csv"), "4").unwrap();
        let digests = [("plan.csv".to_owned(), sha256(b"4"))];
        std::fs::write(path("scene.toml"), CarriedScene::text(&scene.to_toml(), digests)).unwrap();
        let error = carried.check_still(&[path("plan.csv")]).unwrap_err().to_string();
        assert!(error.contains("has just changed"), "{error}");
    }
}
