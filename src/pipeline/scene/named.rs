//! Scenes by name, with learned plans.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Preset, Scene};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::files_in;
use noctograph_core::settings::suggestion;
use noctograph_plan::Plan;

/// Scenes that ship with the program, as TOML.
const SHIPPED: [(&str, &str); 6] = [
    ("team", include_str!("shipped/team.toml")),
    ("pid", include_str!("shipped/pid.toml")),
    ("geometric", include_str!("shipped/geometric.toml")),
    ("tuned", include_str!("shipped/tuned.toml")),
    ("two-drones-three-anchors", include_str!("shipped/two-drones-three-anchors.toml")),
    (
        "two-drones-three-anchors-and-floor",
        include_str!("shipped/two-drones-three-anchors-and-floor.toml"),
    ),
];

/// A scene with a name, and learned plans.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedScene {
    /// Name in tables.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// Plans that are sent for a word instead of the scene's own, one for each drone.
    pub plans: BTreeMap<String, Vec<Plan>>,
}

impl NamedScene {
    /// A scene without learned plans.
    #[must_use]
    pub fn new(name: &str, scene: Scene) -> Self {
        Self { name: name.to_owned(), scene, plans: BTreeMap::new() }
    }

    /// File of a learned plan in a folder: of the drone `drone`, from 0, of `n_drones`.
    #[must_use]
    pub fn plan_file(word: &str, drone: usize, n_drones: usize) -> String {
        let number = if n_drones > 1 { (drone + 1).to_string() } else { String::new() };
        format!("plan{number}-{}.csv", file_name(word))
    }
}

impl Scene {
    /// Finds a scene and lays single settings over it, see [`Scene::parse_with`]: a shipped scene
    /// (team, pid, geometric, tuned, two-drones-three-anchors and the same with -and-floor), a
    /// preset, a scene file, or a folder with `scene.toml` and learned plans, `plan-WORD.csv` for
    /// one drone, `plan1-WORD.csv` and so on for several.
    ///
    /// Names go before files: write `./tuned` for a folder of that name.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a name that is none of these; as [`Scene::parse_with`] and
    /// [`Plan::read_csv`].
    pub fn find(name: &str, settings: &[(&str, &str)]) -> Result<NamedScene> {
        let parse = |toml: &str| Self::parse_with(toml, name, settings);
        if let Some((_, toml)) = SHIPPED.iter().find(|(shipped, _)| *shipped == name) {
            return Ok(NamedScene::new(name, parse(toml)?));
        }
        if name.parse::<Preset>().is_ok() {
            return Ok(NamedScene::new(name, parse(&format!("preset = \"{name}\""))?));
        }
        let path = Path::new(name);
        let text = |name: Option<&std::ffi::OsStr>| {
            name.unwrap_or_default().to_string_lossy().into_owned()
        };
        if path.is_dir() {
            let scene = Self::read_with(&path.join("scene.toml"), settings)?;
            return Ok(NamedScene { name: text(path.file_name()), scene, plans: plans_in(path)? });
        }
        if path.exists() {
            return Ok(NamedScene::new(&text(path.file_stem()), Self::read_with(path, settings)?));
        }
        let shipped = SHIPPED.iter().map(|(name, _)| *name);
        let names: Vec<&str> =
            shipped.chain(Preset::ALL.iter().map(|preset| preset.name())).collect();
        let otherwise = || "print a scene into a file to begin with".into();
        let hint = suggestion(name, names.iter().copied(), otherwise);
        let wanted = format!("a scene file, a learned folder, or one of {}", names.join(", "));
        Err(Error::input(name, "neither a file nor a known name", wanted, hint))
    }
}

/// Characters of a word that a file's name cannot hold, as `%` and their code: a word is never a
/// path.
fn file_name(word: &str) -> String {
    let held = |c: char| !matches!(c, '/' | '\\' | ':' | '%') && !c.is_control();
    let name = |c: char| if held(c) { c.to_string() } else { format!("%{:02X}", u32::from(c)) };
    word.chars().map(name).collect()
}

/// The word of a file's name.
fn word_of(name: &str) -> String {
    let mut parts = name.split('%');
    let mut word = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let code = part.get(..2).and_then(|code| u32::from_str_radix(code, 16).ok());
        match code.and_then(char::from_u32) {
            Some(character) => word = word + &character.to_string() + &part[2..],
            None => word = word + "%" + part,
        }
    }
    word
}

/// Learned plans of a folder by their word, one for each drone.
fn plans_in(folder: &Path) -> Result<BTreeMap<String, Vec<Plan>>> {
    let mut paths = BTreeMap::new();
    for path in files_in(folder)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let rest = name.strip_prefix("plan").and_then(|rest| rest.strip_suffix(".csv"));
        let Some((number, word)) = rest.and_then(|rest| rest.split_once('-')) else { continue };
        if number.is_empty() || number.parse::<u32>().is_ok() {
            paths.insert((word_of(word), number.parse::<u32>().ok()), path);
        }
    }
    let mut plans: BTreeMap<String, Vec<Plan>> = BTreeMap::new();
    for ((word, number), path) in paths {
        let read = plans.entry(word).or_default();
        // `plan-` sorts before `plan1-`, so that a word with both fails at the second.
        if number.is_some_and(|number| number as usize != read.len() + 1) {
            let wanted = "plan-WORD.csv alone, or plan1-WORD.csv, plan2-WORD.csv and so on";
            let found = path.display().to_string();
            return Err(Error::input("plans", found, wanted, "remove or rename the file"));
        }
        read.push(Plan::read_csv(&path)?);
    }
    Ok(plans)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_never_a_path() {
        for word in ["../../A/B", "A\nB", "50 %", "C:\\X", "ÄÖ"] {
            let name = NamedScene::plan_file(word, 0, 1);
            assert!(!name.contains(['/', '\\', '\n']), "{name}");
            assert_eq!(word_of(&name["plan-".len()..name.len() - 4]), word);
        }
        assert_eq!(NamedScene::plan_file("NOOR", 1, 2), "plan2-NOOR.csv");
    }
    use noctograph_sim::ControllerKind;

    #[test]
    fn shipped_scenes_presets_files_and_folders_are_found() {
        let find = |name| Scene::find(name, &[]).unwrap().scene;
        assert_eq!(find("team"), Scene::preset(Preset::Ae4832022));
        assert_eq!(find("ae483-2022"), find("team"));
        assert_eq!(find("cf21"), Scene::preset(Preset::default()));
        assert_eq!(find("pid").controller.kind, ControllerKind::Pid);
        assert_eq!(find("geometric").controller.kind, ControllerKind::Geometric);
        assert_eq!(find("tuned").controller.kind, ControllerKind::LqrIntegral);
        let heavy = Scene::find("cf21", &[("vehicle.mass_kg", "0.04")]).unwrap().scene;
        assert_eq!(heavy.vehicle.mass_kg, 0.04);
        let error = Scene::find("unknown", &[]).unwrap_err();
        assert!(error.to_string().contains("team, pid, geometric"), "{error}");
        assert_eq!(Scene::find("tunes", &[]).unwrap_err().hint(), "did you mean tuned?");
    }

    #[test]
    fn a_folder_of_learned_plans_reads_back() {
        let strokes =
            noctograph_letters::write("I", &Scene::preset(Preset::default()).letters).unwrap();
        let plan = noctograph_plan::plan(&strokes, &Scene::preset(Preset::default()).plan).unwrap();
        let mut csv = Vec::new();
        plan.write_csv(&mut csv).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for name in ["plan-I.csv", "plan1-ON.csv", "plan2-ON.csv"] {
            std::fs::write(folder.path().join(name), &csv).unwrap();
        }
        std::fs::write(
            folder.path().join("scene.toml"),
            Scene::preset(Preset::default()).to_toml(),
        )
        .unwrap();
        let learned = Scene::find(folder.path().to_str().unwrap(), &[]).unwrap();
        assert_eq!((learned.plans["I"].len(), learned.plans["ON"].len()), (1, 2));
        for extra in ["plan-ON.csv", "plan4-ON.csv"] {
            let extra = folder.path().join(extra);
            std::fs::write(&extra, &csv).unwrap();
            let error = Scene::find(folder.path().to_str().unwrap(), &[]).unwrap_err();
            assert!(error.to_string().contains("plan1-WORD.csv, plan2-WORD.csv"), "{error}");
            std::fs::remove_file(extra).unwrap();
        }
        assert!(Scene::find("tuned", &[]).unwrap().plans.is_empty());
    }
}
