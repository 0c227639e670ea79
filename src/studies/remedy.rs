//! Remedies: changes to settings that make a scene's word easier to read.
//!
//! Product in: a shoot whose word is illegible. Product out: at most three [`Remedy`]s. Every
//! candidate change is planned, flown, exposed on the scene's film and read, all with the scene's
//! seed. Changes that help are flown with two more seeds, and dropped if either of these shows a
//! loss. Settings that nobody can choose, such as gusts or the radio's delay, are not changed.

use rayon::prelude::*;

use super::statistics::mean;
use noctograph_core::camera::{CameraOptions, Framing, Metering};
use noctograph_core::diagnostic::Change;
use noctograph_core::error::Result;
use noctograph_picture::expose::BackendChoice;
use noctograph_picture::light::{Deck, RingEffect};
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::{Judging, Shoot, Shot};
use noctograph_plan::{LightClock, PlanOptions, ReferenceKind, Style};
use noctograph_sim::ControllerKind;

/// A change to a scene that makes its word easier to read.
#[derive(Clone, Debug, PartialEq)]
pub struct Remedy {
    /// Changed keys with their new values.
    pub changes: Vec<Change>,
    /// Mean increase in the probability of being read, over [`SEEDS`] flights.
    pub gain: f64,
}

/// Number of seeds with which the original scene and each remedy are flown.
pub const SEEDS: u64 = 3;
/// Maximum number of remedies.
const MAX_REMEDIES: usize = 3;
/// Minimum gain for which a change is recommended.
const LEAST_GAIN: f64 = 0.02;
/// Recommended cap height and room luminance, which are those of the default scene.
const GOOD_CAP_HEIGHT_M: f64 = 0.5;
const DARK_ROOM_CD_M2: f64 = 0.008;
/// Lowest stroke speed that is recommended.
const SLOWEST_M_S: f64 = 0.05;

/// Returns remedies for a shot. The list is empty if the word is legible, or if the plans were
/// given or exported instead of computed here.
pub fn remedies_for(shot: &Shot) -> Result<Vec<Remedy>> {
    let is_read = shot.verdict.as_ref().is_none_or(|verdict| verdict.legible);
    if is_read || !shot.shoot.is_planned || !shot.shoot.designs.is_empty() {
        return Ok(Vec::new());
    }
    remedies(&shot.shoot)
}

/// Returns the changes with the largest gains, in descending order.
///
/// # Errors
///
/// Returns the errors of the stages for the unchanged scene. A change that fails is ignored.
pub fn remedies(shoot: &Shoot) -> Result<Vec<Remedy>> {
    let scene = &shoot.scene;
    let first_before = read_probability(scene, scene.seed)?;
    let sensible = writing(scene).into_iter().chain(pictures(shoot)?).flatten();
    let candidates = sensible.map(|changes| Ok((changed(scene, &changes)?, changes)));
    let candidates: Vec<_> = candidates.collect::<Result<_>>()?;
    // Candidates that improve the result with the scene's seed are sorted by gain, largest first.
    let gainful = candidates.into_par_iter().filter_map(|(scene, changes)| {
        let gain = read_probability(&scene, scene.seed).ok()? - first_before;
        (gain >= LEAST_GAIN).then_some((gain, changes, scene))
    });
    let mut gainful: Vec<_> = gainful.collect();
    gainful.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
    // The best candidates are kept if they also improve the result with further seeds, because the
    // winner of a single flight owes part of its lead to luck.
    let further: Vec<u64> = (1..SEEDS).map(|k| scene.seed.wrapping_add(k)).collect();
    let before: Vec<f64> =
        further.par_iter().map(|seed| read_probability(scene, *seed)).collect::<Result<_>>()?;
    let mut remedies: Vec<Remedy> = Vec::new();
    for (first_gain, changes, scene) in gainful {
        let after = further.par_iter().map(|seed| read_probability(&scene, *seed));
        let Ok(after) = after.collect::<Result<Vec<f64>>>() else { continue };
        let mut gains: Vec<f64> = after.iter().zip(&before).map(|(a, b)| a - b).collect();
        gains.push(first_gain);
        let gain = mean(&gains);
        if gain >= LEAST_GAIN && gains.iter().all(|gain| *gain >= 0.0) {
            remedies.push(Remedy { changes, gain });
        }
        if remedies.len() == MAX_REMEDIES {
            break;
        }
    }
    remedies.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Ok(remedies)
}

/// Returns the probability from 0 to 1 that the scene's word is read with a seed. Returns 0 if
/// nothing is read, and an error if the scene cannot be flown.
fn read_probability(scene: &Scene, seed: u64) -> Result<f64> {
    let mut shoot = Shoot::new(Scene { seed, ..scene.clone() })?;
    (shoot.judging, shoot.backend) = (Judging::Scored, BackendChoice::Cpu);
    let verdict = shoot.take(&|_, _| {})?.verdict;
    Ok(verdict.map_or(0.0, |verdict| verdict.read_probability()))
}

/// Returns a scene with changes applied. A change to the plan's style also resets the rest of the
/// plan, except its lamps, to that style's defaults. Returns an error if the changed scene is
/// invalid.
fn changed(scene: &Scene, changes: &[Change]) -> Result<Scene> {
    let mut scene = scene.clone();
    if changes.iter().any(|change| change.key == "plan.style") {
        scene.plan = PlanOptions { lights: scene.plan.lights, ..PlanOptions::even() };
    }
    let values = changes.iter().filter_map(|change| Some((&*change.key, change.value.as_deref()?)));
    Scene::parse_with(&scene.to_toml(), "scene", &values.collect::<Vec<_>>())
}

/// A change to one or more keys, or `None` if the change makes no sense for the scene.
type Candidate = Option<Vec<Change>>;

/// Returns the candidate that sets a single key, or `None` unless the change makes sense for the
/// scene.
fn set(makes_sense: bool, key: &'static str, value: impl ToString) -> Candidate {
    makes_sense.then(|| vec![Change::new(key, value)])
}

/// Returns candidates that change the letters, the plan, the drone or the lamps.
fn writing(scene: &Scene) -> Vec<Candidate> {
    let Scene { plan, letters, light, controller, .. } = scene;
    // The slower speed is half the plan's, rounded to centimeters per second.
    let slower_m_s = (50.0 * plan.stroke_speed_m_s).round() / 100.0;
    let is_slower = slower_m_s >= SLOWEST_M_S && slower_m_s < plan.stroke_speed_m_s;
    let is_word = letters.drawing.is_empty();
    let is_low = is_word && letters.cap_height_m < GOOD_CAP_HEIGHT_M;
    let other_lights = plan.lights != ["headlights"] && light.deck == Deck::LedRing;
    vec![
        set(matches!(plan.style, Style::Team(_)), "plan.style", "even"),
        set(plan.light_clock == LightClock::Setpoint, "plan.light_clock", "light"),
        set(plan.reference == ReferenceKind::Design, "plan.reference", "inverse"),
        set(is_slower, "plan.stroke_speed_m_s", slower_m_s),
        set(is_word && letters.font != "simplex", "letters.font", "simplex"),
        set(letters.spacing_m < 0.0, "letters.spacing_m", 0),
        set(is_low, "letters.cap_height_m", GOOD_CAP_HEIGHT_M),
        set(controller.kind == ControllerKind::Lqr, "controller.kind", "lqr-integral"),
        set(other_lights, "plan.lights", "[\"headlights\"]"),
        set(light.ring != RingEffect::Off, "light.ring", "off"),
        // With only bit 7 set, the LEDs of the board are off.
        set(light.led_bitmask != 128, "light.led_bitmask", 128),
    ]
}

/// Returns candidates that change the camera or the room. Returns an error if the scene's camera is
/// invalid.
fn pictures(shoot: &Shoot) -> Result<Vec<Candidate>> {
    let Scene { camera, photo, .. } = &shoot.scene;
    let good = CameraOptions::default();
    let ends_s = shoot.plans.iter().map(|planned| planned.plan.duration_s());
    // The shutter stays open for the flight, in whole seconds. The lens is focused on the word.
    let end_s = ends_s.fold(0.0, f64::max).ceil();
    let bounds_m = shoot.strokes.as_ref().map_or([0.0; 4], |strokes| strokes.bounds_m());
    let distance_m = camera.camera(bounds_m, end_s)?.position_m.y.abs();
    let focus_m = (100.0 * distance_m).round() / 100.0;
    let is_unfocused = camera.focus_m.is_some_and(|set_m| set_m != focus_m) && focus_m > 0.0;
    let shutter =
        vec![Change::new("camera.shutter_open_s", 0), Change::new("camera.shutter_close_s", end_s)];
    let size = vec![
        Change::new("camera.width_px", good.width_px),
        Change::new("camera.height_px", good.height_px),
    ];
    let is_bright = photo.background.is_empty() && photo.ambient_cd_m2 > DARK_ROOM_CD_M2;
    Ok(vec![
        set(!matches!(camera.framing, Framing::Word(_)), "camera.framing", "word"),
        set(camera.metering == Metering::Off, "camera.metering", "trail"),
        (camera.shutter_open_s > 0.0 || camera.shutter_close_s.is_some()).then_some(shutter),
        set(is_unfocused, "camera.focus_m", focus_m),
        (camera.width_px < good.width_px).then_some(size),
        set(is_bright, "photo.ambient_cd_m2", DARK_ROOM_CD_M2),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::Preset;

    fn remedies_after(change: impl FnOnce(&mut Scene)) -> Vec<Remedy> {
        let mut scene = Scene { word: "HI".into(), seed: 1, ..Scene::preset(Preset::default()) };
        (scene.camera.width_px, scene.camera.height_px) = (480, 270);
        change(&mut scene);
        remedies(&Shoot::new(scene).unwrap()).unwrap()
    }

    #[test]
    fn a_shutter_that_closes_early_and_a_camera_that_looks_away_are_mended() {
        let shutter = remedies_after(|scene| scene.camera.shutter_close_s = Some(4.0));
        assert_eq!(shutter[0].changes[0], Change::new("camera.shutter_open_s", 0), "{shutter:?}");
        assert!(shutter[0].gain > 0.3, "{shutter:?}");
        let away = remedies_after(|scene| {
            let pose = noctograph_core::camera::FixedPose {
                position_m: [1.5, -3.0, 0.75],
                target_m: Some([4.0, 0.0, 0.75]),
                ..Default::default()
            };
            scene.camera.framing = Framing::Fixed(pose);
        });
        assert_eq!(away[0].changes, [Change::new("camera.framing", "word")]);
    }

    #[test]
    fn a_scene_that_reads_needs_none() {
        let remedies = remedies_after(|_| {});
        assert!(
            remedies.len() <= MAX_REMEDIES && remedies.iter().all(|r| r.gain >= LEAST_GAIN),
            "{remedies:?}"
        );
        let scene = Scene { word: "HI".into(), seed: 1, ..Scene::preset(Preset::default()) };
        let most = 1.2 - read_probability(&scene, 1).unwrap();
        assert!(remedies.iter().all(|remedy| remedy.gain < most), "{remedies:?}");
    }
}
