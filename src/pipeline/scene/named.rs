//! Finds scenes by name.

use std::path::Path;

use super::{Preset, Scene};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::as_spelled;
use noctograph_core::settings::suggestion;

/// Scenes shipped with the program, as TOML.
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

/// A scene with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedScene {
    /// Name of the scene in tables.
    pub name: String,
    /// The scene.
    pub scene: Scene,
}

impl NamedScene {
    /// Creates a scene with a name.
    pub fn new(name: &str, scene: Scene) -> Self {
        Self { name: name.to_owned(), scene }
    }
}

impl Scene {
    /// Finds a scene by `name`, and reads it with individual settings that override keys, as in
    /// [`Scene::parse_with`]. The name is that of a shipped scene (team, pid, geometric, tuned,
    /// two-drones-three-anchors and the same with -and-floor), a preset, a scene file, or a folder
    /// with `scene.toml`.
    ///
    /// Scene names take precedence over files, so a folder `tuned` must be given as `./tuned`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Scene::parse_with`], and [`Error::Input`] for any other name.
    pub fn find(name: &str, settings: &[(&str, &str)]) -> Result<NamedScene> {
        if let Some(toml) = text_of_name(name) {
            return Ok(NamedScene::new(name, Self::parse_with(&toml, name, settings)?));
        }
        let path = Path::new(name);
        // The scene is named after the folder, or after the file without its extension.
        if path.exists() {
            let (short, file) = if path.is_dir() {
                (path.file_name(), as_spelled(&path.join("scene.toml")))
            } else {
                (path.file_stem(), path.to_owned())
            };
            let short = short.unwrap_or_default().to_string_lossy();
            return Ok(NamedScene::new(&short, Self::read_with(&file, settings)?));
        }
        let shipped = SHIPPED.iter().map(|(name, _)| *name);
        let names: Vec<&str> =
            shipped.chain(Preset::ALL.iter().map(|preset| preset.name())).collect();
        let hint = suggestion(name, names.iter().copied(), || {
            "print a scene to a file as a starting point".into()
        });
        let wanted =
            format!("a scene file, a folder with scene.toml, or one of {}", names.join(", "));
        Err(Error::input(name, "neither a file nor a known name", wanted, hint))
    }

    /// Returns the text of the scene that [`Scene::find`] finds by `name`.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] for a file that cannot be read.
    pub fn text_of(name: &str) -> Result<String> {
        let path = Path::new(name);
        let file =
            if path.is_dir() { as_spelled(&path.join("scene.toml")) } else { path.to_owned() };
        text_of_name(name).map_or_else(|| super::LIMIT.read_text(&file), Ok)
    }
}

/// Returns the text of a shipped scene or of a preset's name, or `None` for a file name.
fn text_of_name(name: &str) -> Option<String> {
    if let Some((_, toml)) = SHIPPED.iter().find(|(shipped, _)| *shipped == name) {
        return Some((*toml).to_owned());
    }
    name.parse::<Preset>().is_ok().then(|| format!("preset = \"{name}\""))
}

#[cfg(test)]
mod tests {
    use super::*;
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
}
