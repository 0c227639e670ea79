//! Contenders: the scenes that are compared.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::plan::Plan;
use crate::scene::{Preset, Scene};
use crate::settings::similar;

/// Scenes that are known by name, as TOML: they lie in `src/scene/shipped/`.
pub const KNOWN: [(&str, &str); 4] = [
    ("team", include_str!("../scene/shipped/team.toml")),
    ("pid", include_str!("../scene/shipped/pid.toml")),
    ("geometric", include_str!("../scene/shipped/geometric.toml")),
    ("tuned", include_str!("../scene/shipped/tuned.toml")),
];

/// A scene under comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "File", into = "File")]
pub struct Contender {
    /// Name in tables.
    pub name: String,
    /// What it flies with. Word and seed of the scene do not matter.
    pub scene: Scene,
    /// What is sent for a word instead of the scene's own plan, such as what was learned.
    pub plans: BTreeMap<String, Plan>,
}

/// A contender as a file holds it: scene and plans as the files that they are elsewhere.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: String,
    scene_toml: String,
    #[serde(default)]
    plans_csv: BTreeMap<String, String>,
}

impl Contender {
    /// A scene that plans its own flights.
    #[must_use]
    pub fn new(name: &str, scene: Scene) -> Self {
        Self { name: name.to_owned(), scene, plans: BTreeMap::new() }
    }

    /// A scene by a name of [`KNOWN`], a preset, a scene file, or a folder with `scene.toml` and
    /// learned `plan-WORD.csv`. Names go before files: a folder called as a known scene is
    /// `./tuned`.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a name that is none of these, and the errors of reading the files.
    pub fn find(named: &str) -> Result<Self> {
        Self::find_with(named, &[])
    }

    /// The same with single settings laid over the scene, see [`Scene::parse_with`].
    ///
    /// # Errors
    ///
    /// As [`Self::find`] and [`Scene::parse_with`].
    pub fn find_with(named: &str, settings: &[(&str, &str)]) -> Result<Self> {
        let parse = |toml: &str| Scene::parse_with(toml, named, settings);
        if let Some((name, toml)) = KNOWN.iter().find(|(name, _)| *name == named) {
            return Ok(Self::new(name, parse(toml)?));
        }
        if named.parse::<Preset>().is_ok() {
            return Ok(Self::new(named, parse(&format!("preset = \"{named}\""))?));
        }
        let path = Path::new(named);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            let scene = Scene::read_with(&path.join("scene.toml"), settings)?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            return Ok(Self { name, scene, plans: plans_in(path)? });
        }
        if path.exists() {
            return Ok(Self::new(&stem, Scene::read_with(path, settings)?));
        }
        let names = KNOWN.iter().map(|(name, _)| *name);
        let names: Vec<&str> =
            names.chain(Preset::ALL.iter().map(|preset| preset.name())).collect();
        let hint = match similar(named, names.iter().copied()) {
            Some(similar) => format!("did you mean {similar}?"),
            None => "`noctograph scene > my.toml` writes a scene to begin with".into(),
        };
        Err(Error::input(
            named,
            "neither a file nor a known name",
            format!("a scene file, a learned folder, or one of {}", names.join(", ")),
            hint,
        ))
    }
}

/// Learned plans of a folder by their word.
fn plans_in(folder: &Path) -> Result<BTreeMap<String, Plan>> {
    let unreadable = |source| Error::read(folder, source);
    let mut plans = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let word = name.strip_prefix("plan-").and_then(|rest| rest.strip_suffix(".csv"));
        if let Some(word) = word {
            plans.insert(word.to_owned(), Plan::read_csv(&path)?);
        }
    }
    Ok(plans)
}

impl From<Contender> for File {
    fn from(contender: Contender) -> Self {
        let csv = |plan: &Plan| {
            let mut csv = Vec::new();
            plan.write_csv(&mut csv).expect("writing into memory");
            String::from_utf8(csv).expect("a plan is ASCII but for its channels' names")
        };
        let plans = contender.plans.iter();
        Self {
            name: contender.name,
            scene_toml: contender.scene.to_toml(),
            plans_csv: plans.map(|(word, plan)| (word.clone(), csv(plan))).collect(),
        }
    }
}

impl TryFrom<File> for Contender {
    type Error = Error;

    fn try_from(file: File) -> Result<Self> {
        let scene = Scene::parse(&file.scene_toml, &format!("scene {}", file.name))?;
        let plans = file.plans_csv.iter().map(|(word, csv)| {
            Ok((word.clone(), Plan::parse_csv(csv.as_bytes(), &format!("plan of {word}"))?))
        });
        Ok(Self { name: file.name, scene, plans: plans.collect::<Result<_>>()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::ControllerKind;

    #[test]
    fn known_names_presets_files_and_folders_are_found() {
        assert_eq!(Contender::find("team").unwrap().scene, Scene::default());
        let kind = |name| Contender::find(name).unwrap().scene.controller.kind;
        assert_eq!(kind("pid"), ControllerKind::Pid);
        assert_eq!(kind("geometric"), ControllerKind::Geometric);
        assert_eq!(kind("tuned"), ControllerKind::LqrIntegral);
        assert_eq!(Contender::find("cf21").unwrap().scene, Scene::preset(Preset::Cf21));
        let error = Contender::find("nobody").unwrap_err().to_string();
        assert!(error.contains("team, pid, geometric"), "{error}");
    }

    #[test]
    fn a_contender_with_a_learned_plan_reads_back() {
        let strokes = crate::letters::write("I", &Scene::default().letters).unwrap();
        let plan = crate::plan::plan(&strokes, &Scene::default().plan).unwrap();
        let mut csv = Vec::new();
        plan.write_csv(&mut csv).unwrap();
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("plan-I.csv"), &csv).unwrap();
        std::fs::write(folder.path().join("scene.toml"), Scene::default().to_toml()).unwrap();
        let learned = Contender::find(folder.path().to_str().unwrap()).unwrap();
        assert!(learned.plans.contains_key("I"));
        assert!(Contender::find("tuned").unwrap().plans.is_empty(), "the name, wherever one works");
        let json = serde_json::to_string(&learned).unwrap();
        assert_eq!(serde_json::from_str::<Contender>(&json).unwrap(), learned);
    }
}
