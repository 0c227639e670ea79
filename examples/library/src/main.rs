//! Photographs a flight from your own simulator, here a drone that follows the letters exactly.

use noctograph::error::Result;
use noctograph::flight::{Flight, FlightData, FlightSample};
use noctograph::lamps::HEADLIGHTS;
use noctograph::nalgebra::Vector3;
use noctograph::scene::{Preset, Scene};
use noctograph::shoot::{Recording, Shoot};

const SPEED_M_S: f64 = 0.2;
const STEP_S: f64 = 0.02;

fn main() -> Result<()> {
    let mut scene = Scene { word: "NO".to_owned(), ..Scene::preset(Preset::Cf21) };
    (scene.camera.width_px, scene.camera.height_px) = (960, 540);

    // The path is sampled every 20 ms along the pen's moves, and dark between strokes.
    let (mut samples, mut levels) = (Vec::new(), Vec::new());
    let mut end_m = Vector3::new(0.0, 0.0, 0.5);
    for step in scene.strokes()?.glyphs.iter().flat_map(|glyph| &glyph.moves) {
        let [from_m, to_m] = [step.from_m, step.to_m].map(|[x, z]| Vector3::new(x, 0.0, z));
        for (begin_m, goal_m, lit) in [(end_m, from_m, false), (from_m, to_m, step.lit)] {
            let n = ((goal_m - begin_m).norm() / SPEED_M_S / STEP_S).ceil() as usize;
            for k in 1..=n {
                let time_s = samples.len() as f64 * STEP_S;
                let position_m = begin_m.lerp(&goal_m, k as f64 / n as f64);
                samples.push(FlightSample { time_s, position_m, ..FlightSample::default() });
                levels.push(f64::from(lit));
            }
        }
        end_m = to_m;
    }
    let lights = [(HEADLIGHTS.to_owned(), levels)].into();
    let flight = Flight::new(FlightData { samples, lights, ..FlightData::default() })?;

    let shoot = Shoot::with_recordings(scene, vec![Recording::Flight(flight)])?;
    let shot = shoot.take(&|_stage, _done| {})?;
    if let Some(verdict) = &shot.verdict {
        println!("{} reads as {} ({:.2})", verdict.word, verdict.read, verdict.readability);
    }
    Ok(())
}
