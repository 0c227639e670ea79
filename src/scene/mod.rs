//! Scene: the one TOML file that fixes a photo.
//!
//! Every key has the value of a preset (`ae483-2022`, if the scene names no other), so a scene names
//! only what it changes.
//! Unknown keys and values out of range are refused with line and key.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::camera::CameraOptions;
use crate::error::{Error, Result};
use crate::expose::ExposeOptions;
use crate::letters::LetterOptions;
use crate::light::LightOptions;
use crate::photo::PhotoOptions;
use crate::plan::PlanOptions;
use crate::score::ScoreOptions;
use crate::sim::{
    AirOptions, BatteryOptions, ControllerOptions, ObserverOptions, RateOptions, SensorOptions,
    SimOptions, VehicleOptions,
};

mod planned;
mod preset;
mod text;

pub use preset::Preset;

/// Everything that a photo depends on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scene {
    /// Where the defaults come from.
    pub preset: Preset,
    /// The word to write.
    pub word: String,
    /// Seed of all noise.
    pub seed: u64,
    /// How the word is laid out.
    pub letters: LetterOptions,
    /// How it is flown.
    pub plan: PlanOptions,
    /// The drone.
    pub vehicle: VehicleOptions,
    /// What drives its motors.
    pub battery: BatteryOptions,
    /// The air it flies in.
    pub air: AirOptions,
    /// Clocks of the simulation.
    pub rates: RateOptions,
    /// What steers it.
    pub controller: ControllerOptions,
    /// What tells it where it is.
    pub observer: ObserverOptions,
    /// What it measures.
    pub sensors: SensorOptions,
    /// Its lamps.
    pub light: LightOptions,
    /// The camera.
    pub camera: CameraOptions,
    /// How finely the exposure is computed.
    pub expose: ExposeOptions,
    /// How lens and sensor treat the light, and the tone curve.
    pub photo: PhotoOptions,
    /// When a word counts as read.
    pub score: ScoreOptions,
}

/// Largest scene file that is read.
const MAX_FILE_BYTES: u64 = 1 << 20;

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where it cannot be read, [`Error::Input`] with line and key where it is
    /// broken, holds an unknown key or a value out of range.
    pub fn read(path: &Path) -> Result<Self> {
        let unreadable = |source| Error::read(path, source);
        let length = std::fs::metadata(path).map_err(unreadable)?.len();
        if length > MAX_FILE_BYTES {
            let found = format!("{length} bytes");
            let wanted = format!("a scene file of at most {MAX_FILE_BYTES} bytes");
            return Err(Error::input(path.display().to_string(), found, wanted, text::HINT));
        }
        let toml = std::fs::read_to_string(path).map_err(unreadable)?;
        Self::parse(&toml, &path.display().to_string())
    }

    /// Reads the text of a scene; `file` is its name in messages.
    ///
    /// # Errors
    ///
    /// [`Error::Input`], as [`Self::read`].
    pub fn parse(toml: &str, file: &str) -> Result<Self> {
        let alone: Self = toml::from_str(toml).map_err(|e| text::syntax_error(&e, toml, file))?;
        let mut scene = alone.preset.under(toml, alone.plan.style);
        scene.light.fixtures = Some(scene.light.fixtures());
        scene.check().map_err(|error| text::with_line(error, toml, file))?;
        Ok(scene)
    }

    /// The whole scene as a TOML file: every key with its value, its unit and what it means.
    #[must_use]
    pub fn to_toml(&self) -> String {
        text::document(self)
    }

    /// A scene that is the preset and nothing else.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let sim = preset.sim();
        Self {
            preset,
            vehicle: sim.vehicle,
            battery: sim.battery,
            air: sim.air,
            rates: sim.rates,
            controller: sim.controller,
            observer: sim.observer,
            sensors: sim.sensors,
            ..Self::default()
        }
    }

    /// What the simulator needs of it.
    #[must_use]
    pub fn sim(&self) -> SimOptions {
        SimOptions {
            rates: self.rates.clone(),
            vehicle: self.vehicle.clone(),
            battery: self.battery.clone(),
            air: self.air.clone(),
            controller: self.controller.clone(),
            observer: self.observer.clone(),
            sensors: self.sensors.clone(),
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        if i64::try_from(self.seed).is_err() {
            let wanted = format!("a whole number from 0 to {}", i64::MAX);
            return Err(Error::input("seed", self.seed, wanted, "choose a smaller seed"));
        }
        self.letters.check()?;
        self.plan.check()?;
        self.sim().check()?;
        self.light.check()?;
        self.camera.check()?;
        self.expose.check()?;
        self.photo.check()?;
        self.score.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_default_is_the_default() {
        let text = Scene::default().to_toml();
        assert_eq!(Scene::parse(&text, "scene.toml").unwrap(), Scene::default());
    }

    #[test]
    fn a_scene_reads_back_bit_by_bit() {
        let mut scene = Scene { word: "Ä \"x\"\\".into(), seed: 7, ..Scene::default() };
        scene.camera.shutter_close_s = Some(0.1 + 0.2);
        scene.vehicle.mass_kg = 0.1 / 3.0;
        scene.light.fixtures.as_mut().unwrap().pop();
        assert_eq!(Scene::parse(&scene.to_toml(), "scene.toml").unwrap(), scene);
    }

    #[test]
    fn a_scene_keeps_what_its_preset_says_and_changes_what_it_names() {
        let toml = "preset = \"cf21\"\n[vehicle]\nmass_kg = 0.0351\n[air]\ngusts = \"dryden\"\n";
        let mut want = Scene::preset(Preset::Cf21);
        want.vehicle.mass_kg = 0.0351;
        want.air.gusts = crate::sim::Gusts::Dryden;
        assert_eq!(Scene::parse(toml, "my.toml").unwrap(), want);
        assert_ne!(want.controller, Scene::default().controller, "its own gains");
    }

    #[test]
    fn every_preset_reads_back_as_it_is_printed() {
        for preset in Preset::ALL {
            let scene = Scene::preset(preset);
            scene.check().unwrap();
            assert_eq!(Scene::parse(&scene.to_toml(), "my.toml").unwrap(), scene, "{preset:?}");
            let name = format!("preset = \"{}\"\n", preset.name());
            assert_eq!(Scene::parse(&name, "my.toml").unwrap(), scene, "{preset:?} alone");
        }
        assert_eq!(Scene::preset(Preset::default()), Scene::default());
    }

    #[test]
    fn what_is_wrong_is_named_with_line_and_key() {
        let cases = [
            ("seed = 1\n[vehicle]\nmass_kg = -0.03\n", ":3: vehicle.mass_kg", "-0.03"),
            ("[vehicle]\nmas_kg = 0.03\n", ":2", "mas_kg"),
            ("seed = 1\nlettres = 3\n", ":2", "lettres"),
            ("seed = -1\n", ":1", "-1"),
            ("seed = 1\npreset = \"cf22\"\n", ":2", "`cf21-thrust-kit`"),
            ("preset = \"bzzz\"\n[vehicle]\nmass_kg = -1\n", ":3: vehicle.mass_kg", "-1"),
            ("[camera]\niso = \"high\"\n", ":2", "string"),
            ("[camera]\n\niso = nan\n", ":3: camera.iso", "NaN"),
            ("[camera]\nwidth_px = 0\n", ":2: camera.width_px", "0x1080"),
            ("[letters]\nfont = \"comic\"\n", ":2: letters.font", "comic"),
            ("word = \n", ":1", "string values must be quoted"),
        ];
        for (toml, place, found) in cases {
            let error = Scene::parse(toml, "my.toml").unwrap_err();
            let message = error.to_string();
            assert!(message.contains(&format!("my.toml{place}")), "{toml:?}: {message}");
            assert!(message.contains(found), "{toml:?}: {message}");
            assert!(!error.hint().is_empty(), "{toml:?} leaves the reader alone");
        }
    }
}
