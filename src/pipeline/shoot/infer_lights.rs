//! Infers letters and lights for a real flight's log from the word and the setpoints.

use std::path::Path;

use super::{Recording, Shoot};
use crate::scene::{Preset, Scene};
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, Quantity, airborne};
use noctograph_logs::ImportOptions;
use noctograph_plan::infer_lights;

impl Shoot {
    /// Prepares the photograph of a flight, a log or a light trace, and returns it with the log's
    /// warnings. A log without lights is lit by the scene's word, or from take-off to landing.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Recording::read`], [`infer_lights_if_dark`] and
    /// [`Self::with_recordings`].
    pub fn of_log(mut scene: Scene, path: &Path) -> Result<Warned<Self>> {
        let firmware = Some(scene.vehicle.firmware);
        let options = ImportOptions { firmware, ..ImportOptions::default() };
        let Warned { product: mut recording, mut warnings } = Recording::read(path, &options)?;
        if let Recording::Flight(flight) = &mut recording {
            if let Some(preset) = infer_lights_if_dark(flight, &mut scene)? {
                let message = format!("the letters are taken from {}", preset.name());
                warnings.push(Diagnostic::warning("log", message));
            }
            if flight.lights.is_empty() {
                // Without a word in the scene, light throughout is what the user requested.
                if scene.has_strokes() {
                    let message =
                        "lit throughout, because no setpoints show where the lights were on";
                    warnings.push(Diagnostic::warning("log", message));
                }
                light_while_airborne(flight, &scene);
            }
        }
        Ok(Warned { product: Self::with_recordings(scene, vec![recording])?, warnings })
    }
}

/// Adds the letters of the scene's word, if it has one, and their lights to a flight without
/// lights. If the setpoints do not follow the scene's letters, and these are a preset's, those of
/// the other presets are tried. The scene is given the letters that fit, and their preset is
/// returned.
pub fn infer_lights_if_dark(flight: &mut Flight, scene: &mut Scene) -> Result<Option<Preset>> {
    // Lights can only be inferred from setpoints.
    let is_unlit = flight.lights.is_empty() && flight.has(Quantity::Design);
    if !is_unlit || !scene.has_strokes() {
        return Ok(None);
    }
    let Err(error) = infer_lights(flight, &scene.strokes()?) else { return Ok(None) };
    if !Preset::ALL.iter().any(|preset| Scene::preset(*preset).letters == scene.letters) {
        return Err(error);
    }
    for preset in Preset::ALL {
        let candidate = Scene { letters: Scene::preset(*preset).letters, ..scene.clone() };
        let Ok(strokes) = candidate.strokes() else { continue };
        if infer_lights(flight, &strokes).is_ok() {
            scene.letters = candidate.letters;
            return Ok(Some(*preset));
        }
    }
    Err(error)
}

/// Switches on the scene's writing lamps from take-off to landing, for a flight without letters.
pub fn light_while_airborne(flight: &mut Flight, scene: &Scene) {
    let in_air = airborne(flight).unwrap_or_default();
    let levels: Vec<f64> =
        (0..flight.samples.len()).map(|i| f64::from(u8::from(in_air.contains(&i)))).collect();
    for channel in &scene.plan.lights {
        flight.edit(|flight| flight.lights.insert(channel.clone(), levels.clone()));
    }
}
