//! Task: a scene in which submissions may change some keys, such as the controller's.
//!
//! Product in: the text of a submission, either a complete scene or a few keys. Product out: the
//! task's scene with the submission's values for the allowed keys.

use std::path::Path;

use super::{LIMIT, Scene, text};
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::{Described, paths, suggestion};

/// Keys that a submission may change by default.
const MAY: [&str; 3] = ["controller.*", "observer.luenberger.*", "observer.ekf.*"];
/// Keys that name files, which submissions never change.
const FILES: [&str; 5] = [
    "letters.font",
    "letters.fallback",
    "letters.drawing",
    "letters.drawing_sha256",
    "photo.background",
];
/// Maximum number of differences that a message lists with their values.
const MAX_NAMED: usize = 3;
/// Maximum number of characters of a listed value.
const MAX_CHARACTERS: usize = 40;

/// A scene, and the keys that submissions may change.
#[derive(Clone, Debug)]
pub struct SceneTask {
    scene: Scene,
    may: Vec<String>,
}

impl SceneTask {
    /// Creates a task whose submissions may change the keys and tables in `may`, such as
    /// `controller.lqr.q` and `controller.*`. If `may` is empty, the controller and the weights of
    /// the observers may be changed.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for a key that does not exist or that names a file.
    pub fn new(scene: Scene, may: &[String]) -> Result<Self> {
        let may = if may.is_empty() { MAY.map(str::to_owned).to_vec() } else { may.to_vec() };
        let mut keys = paths(Scene::SHAPE.settings());
        keys.retain(|key| !FILES.contains(&key.as_str()));
        for named in &may {
            if !keys.iter().any(|key| covers(named, key)) {
                let wanted = "a scene key that names no file, or all keys of a table, such as \
                              controller.*";
                let hint = suggestion(named, keys.iter().map(String::as_str), || text::HINT.into());
                return Err(Error::input("may", named, wanted, hint));
            }
        }
        Ok(Self { scene, may })
    }

    /// Returns the task's scene with a submission's keys (TOML), but with the task's word and seed.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Scene::read`], and [`Error::Infeasible`] that lists forbidden keys.
    pub fn submission(&self, path: &Path) -> Result<Scene> {
        let (toml, file) = (LIMIT.read_text(path)?, path.display().to_string());
        if toml.trim().is_empty() {
            return Err(Error::input(file, "an empty file", "keys of a scene", text::HINT));
        }
        let mut values = self.scene.to_table();
        text::overlay(&mut values, text::read(&toml, &file)?, Scene::SHAPE.settings());
        let mut scene =
            Scene::checked(values).map_err(|error| text::with_line(error, &toml, &file))?;
        // Word and seed are always those of the task.
        let mut task = self.scene.clone();
        scene.seed = task.seed;
        scene.word.clone_from(&task.word);
        // A file of the task may have a different path on a student's machine.
        for (theirs, ours) in scene.files_mut().zip(task.files_mut()) {
            let [name, wanted] = [&*theirs, &*ours].map(|path| Path::new(path).file_name());
            if name.is_some() && name == wanted {
                theirs.clone_from(ours);
            }
        }
        let mut refused = text::changes(&scene, &self.scene);
        refused.retain(|[key, value, _]| !self.allows(key, value));
        if refused.is_empty() {
            return Ok(scene);
        }
        let hint = format!("a submission may change {}", self.may.join(", "));
        Err(Error::infeasible(sentence(&refused), hint))
    }

    /// Returns true if a submission may set a key to a value. No submission may use the true state.
    fn allows(&self, key: &str, value: &str) -> bool {
        let is_truth = (key, value) == ("observer.kind", "\"truth\"");
        !is_truth && !FILES.contains(&key) && self.may.iter().any(|named| covers(named, key))
    }
}

/// Returns true if a name is the key itself or, with `.*`, a table that contains the key.
fn covers(named: &str, key: &str) -> bool {
    let table = named.strip_suffix(".*").unwrap_or(named);
    key.strip_prefix(table).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Returns a sentence that lists the keys that differ, with the submission's and the task's values
/// of the first [`MAX_NAMED`]. Each change consists of the key and these two values.
fn sentence(changes: &[[String; 3]]) -> String {
    let mut parts = Vec::new();
    for [key, value, task] in changes.iter().take(MAX_NAMED) {
        let [value, task] =
            [value, task].map(|text| text.chars().take(MAX_CHARACTERS).collect::<String>());
        parts.push(format!("{key} differs from the task's: {value} for {task}"));
    }
    if changes.len() > MAX_NAMED {
        parts.push(format!("and {} more keys", changes.len() - MAX_NAMED));
    }
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn submitted(toml: &str, may: &[&str]) -> Result<Scene> {
        let scene = Scene::find("cf-brushless", &[("photo.background", "/task/night.png")]);
        let may: Vec<String> = may.iter().map(|key| (*key).to_owned()).collect();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), toml).unwrap();
        SceneTask::new(scene.unwrap().scene, &may)?.submission(file.path())
    }

    #[test]
    fn the_task_is_flown_with_the_keys_that_are_allowed() {
        let scene = submitted("[controller]\nkind = \"lqr\"\nlqr.r = [1e6, 1e6, 1e7, 500]", &[]);
        let scene = scene.unwrap();
        assert_eq!(scene.controller.lqr.r, [1e6, 1e6, 1e7, 500.0]);
        assert_eq!(scene.photo.background, "/task/night.png");
        let printed = scene.to_toml().replace("/task/", "/home/student/");
        assert_eq!(submitted(&printed, &[]).unwrap(), scene, "a whole scene, printed elsewhere");
        let other = "word = \"HI\"\nseed = 3\n";
        assert_eq!(submitted(other, &[]).unwrap().word, "", "the ranking has its own");
        let even = submitted("[plan]\nstroke_speed_m_s = 0.1", &["plan"]).unwrap();
        assert_eq!(even.plan.stroke_speed_m_s, 0.1);
    }

    #[test]
    fn what_is_not_allowed_is_named_and_files_and_the_truth_never_are() {
        let refused = |toml: &str, may: &[&str]| submitted(toml, may).unwrap_err().to_string();
        let mass = refused("[vehicle]\nmass_kg = 0.02", &[]);
        assert!(mass.starts_with("vehicle.mass_kg differs from the task's: 0.02 for 0."), "{mass}");
        let picture = refused("[photo]\nbackground = \"tea.png\"", &["photo.*", "controller.*"]);
        assert!(picture.contains("\"tea.png\" for \"/task/night.png\""), "{picture}");
        let truth = refused("[observer]\nkind = \"truth\"", &["observer.*"]);
        assert!(truth.starts_with("observer.kind differs"), "{truth}");
        let preset = refused("preset = \"cf21\"", &[]);
        assert!(preset.contains("preset differs"), "{preset}");
        let many = refused("[camera]\niso = 1\nf_number = 9\nwidth_px = 9\nheight_px = 9", &[]);
        assert!(many.ends_with("; and 1 more keys"), "{many}");
        let font = refused("", &["letters.font"]);
        assert!(font.contains("a scene key that names no file"), "{font}");
        assert!(refused("", &["controller.kinds"]).contains("may: found controller.kinds"));
    }
}
