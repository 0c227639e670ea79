//! Letters and lights of a real flight's log, which holds neither, inferred from the flown word and
//! the setpoints.

use std::path::Path;

use super::{Error, Result, message, shell_word};
use crate::flight::{Flight, Quantity, airborne};
use crate::plan::relight;
use crate::scene::{Preset, Scene};

/// Gives a flight what [`relit`] infers, if it lacks its lights and the scene has a word.
pub(super) fn relit_where_dark(flight: &mut Flight, scene: &mut Scene, path: &Path) -> Result<()> {
    if is_unlit(flight) && scene.has_strokes() { relit(flight, scene, path) } else { Ok(()) }
}

/// Gives a flight the light of its lamps in the air, from take-off to landing, in the place of
/// letters.
pub(super) fn light_all_along(flight: &mut Flight, scene: &Scene) {
    let air = airborne(flight).unwrap_or_default();
    let levels = (0..flight.samples.len()).map(|i| f64::from(u8::from(air.contains(&i)))).collect();
    let levels: Vec<f64> = levels;
    for channel in &scene.plan.lights {
        flight.lights.insert(channel.clone(), levels.clone());
    }
}

/// Whether a flight lacks its lights, and has the setpoints that they can be inferred from.
fn is_unlit(flight: &Flight) -> bool {
    flight.lights.is_empty() && flight.has(Quantity::Design)
}

/// Gives a flight the letters of the scene's word and its lights. Where the setpoints are not on
/// the scene's letters, and these are those of a preset, the other presets' are tried: font, size
/// and place; the scene then has them.
///
/// # Errors
///
/// As [`relight`], with the command that names the letters.
fn relit(flight: &mut Flight, scene: &mut Scene, path: &Path) -> Result<()> {
    let Err(error) = relight(flight, &scene.strokes()?) else { return Ok(()) };
    let presets = || Preset::ALL.iter().map(|p| (p.name(), Scene::preset(*p).letters));
    let is_preset = presets().any(|(_, letters)| letters == scene.letters);
    for (name, letters) in presets().filter(|_| is_preset) {
        let tried = Scene { letters, ..scene.clone() };
        let Ok(strokes) = tried.strokes() else { continue };
        if relight(flight, &strokes).is_ok() {
            let text = format!(
                "{}: its setpoints are on the letters of {name}, which are used; `--scene {name}` \
                 has that drone and its lamps, too",
                path.display()
            );
            message("note: ", &text);
            scene.letters = tried.letters;
            return Ok(());
        }
    }
    match error {
        Error::Input { place, found, wanted, .. } => {
            let hint = format!(
                "name the scene whose letters were flown: `noctograph import {} --word {} --scene \
                 SCENE.toml`; style even flies strokes in another order, which only a log with lights \
                 tells",
                shell_word(path),
                shell_word(scene.word.as_ref()),
            );
            Err(Error::Input { place, found, wanted, hint })
        }
        other => Err(other),
    }
}
