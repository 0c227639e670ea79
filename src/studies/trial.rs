//! Trial: a scene made ready for a word, flown and read again and again.

use std::num::NonZero;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;

use super::outcome::{Flown, Outcome};
use super::{Conditions, Record, SOURCE};
use noctograph_core::digest::Digest;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_letters::Strokes;
use noctograph_picture::photo::{Noise, Photo};
use noctograph_pipeline::scene::{NamedScene, Scene};
use noctograph_pipeline::shoot::{Judging, Recording, Shoot};
use noctograph_plan::Plan;
use noctograph_score::{CALIBRATION, Reader, ScoreOptions};

/// Height of a capital on the film that is read. The reader resamples it to 32. Fewer pixels blur
/// the trail, more cost time. For 20 words, each flown twice, the probability differs on average by
/// 0.017 from that at 1920 × 1080, and by 0.21 at most, for Illi. Scenes are compared on equal
/// films.
const CAP_HEIGHT_PX: f64 = 48.0;

/// A scene made ready to fly a word again and again.
#[derive(Clone, Debug)]
pub struct Prepared {
    scene: Scene,
    /// With a small film.
    shoot: Shoot,
    conditions: Conditions,
    digest: String,
    /// Why there is no plan, and advice: the drone is lost in the rehearsal, or would fly for
    /// hours.
    unplanned: Option<[String; 2]>,
}

impl Prepared {
    /// Makes a scene ready for a word. If it cannot be planned, as with a gain that loses the
    /// drone, every outcome is a lost drone: one bad candidate ends no study.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a word that the font cannot write or a setting out of range.
    pub fn new(named: &NamedScene, word: &str, conditions: &Conditions) -> Result<Self> {
        conditions.check()?;
        let mut scene = Scene { seed: 0, ..named.scene.clone() };
        scene.set_word(word);
        scene.check()?;
        // A scene without a plan still gets a shoot, which gives every seed the same outcome.
        let (mut shoot, unplanned) = match Shoot::new(scene.clone()) {
            Err(Error::Infeasible { what, hint, .. }) => {
                (Shoot::with_plans(scene.clone(), Vec::new())?, Some([what, hint]))
            }
            shoot => (shoot?, None),
        };
        // One core a flight: the flights of a study run side by side.
        (shoot.judging, shoot.keeps_film) = (Judging::Scored, false);
        shoot.cores = Some(NonZero::<usize>::MIN);
        if let Some(strokes) = &shoot.strokes {
            shoot.reader = Some(reader(strokes, &scene.score)?);
        }
        shrink(&mut shoot, CAP_HEIGHT_PX)?;
        let digest = digest(&scene, conditions);
        Ok(Self { scene, shoot, conditions: conditions.clone(), digest, unplanned })
    }

    /// The word.
    pub fn word(&self) -> &str {
        self.shoot.strokes.as_ref().map_or("", |strokes| &strokes.word)
    }

    /// The plans that are sent, one for each drone.
    pub fn plans(&self) -> Vec<Plan> {
        self.shoot.plans.iter().map(|planned| planned.plan.clone()).collect()
    }

    /// Checks that there is a plan.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] with the reason.
    pub fn planned(&self) -> Result<()> {
        match self.unplanned.clone() {
            None => Ok(()),
            Some([what, hint]) => Err(Error::infeasible(what, hint)),
        }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Digest of everything that decides an outcome except the seed: program, reader, scene, word
    /// and conditions. 16 hexadecimal digits.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// The shoot of one seed, with drones and lamps as the conditions change them.
    pub fn shoot(&self, seed: u64) -> Shoot {
        let mut shoot = self.shoot.clone();
        shoot.scene.seed = seed;
        let departures = (0..).map(|drone| self.conditions.draw(&self.scene, seed, drone));
        shoot.actual = departures.take(shoot.plans.len()).collect();
        shoot
    }

    /// Flies once, exposes and reads.
    ///
    /// # Errors
    ///
    /// Those of the stages, except that of a lost drone: that is an outcome.
    pub fn outcome(&self, seed: u64) -> Result<Outcome> {
        self.judge(self.fly(seed), seed)
    }

    /// The flights of one seed, one for each drone.
    pub fn fly(&self, seed: u64) -> Result<Vec<Flight>> {
        self.planned()?;
        self.shoot(seed).fly(&|_, _| {})
    }

    /// The outcome of the flights of a seed, exposed and read. A lamp that passes before the lens
    /// leaves no photo: its drone counts as lost.
    pub fn judge(&self, flights: Result<Vec<Flight>>, seed: u64) -> Result<Outcome> {
        let shot = flights.and_then(|flights| {
            let recordings = flights.into_iter().map(Recording::Flight).collect();
            Shoot { recordings, ..self.shoot(seed) }.take(&|_, _| {})
        });
        let shot = match or_lost(shot)? {
            Ok(shot) => shot,
            Err(how) => return Ok(Outcome::lost(self.word(), how)),
        };
        let verdict = shot.verdict.expect("a word is read");
        Ok(Outcome::new(&verdict, Flown::new(&shot.flights, &self.scene.sim())?))
    }

    /// An outcome as a line of a store.
    pub(super) fn record(&self, contender: &str, seed: u64, outcome: Outcome) -> Record {
        let (scene, contender) = (self.digest.clone(), contender.to_owned());
        Record { scene, contender, word: self.word().to_owned(), seed, outcome }
    }

    /// The photo of one seed with capitals of a height in pixels, at most as large as the scene's.
    pub fn photo(&self, seed: u64, cap_height_px: f64) -> Result<Photo> {
        let mut shoot = Shoot { judging: Judging::Skipped, ..self.shoot(seed) };
        shoot.scene.camera = self.scene.camera.clone();
        shoot.scene.photo = self.scene.photo.clone();
        shrink(&mut shoot, cap_height_px)?;
        Ok(shoot.take(&|_, _| {})?.photo)
    }
}

/// The product of a flight, or how a drone was lost.
pub(super) fn or_lost<T>(flown: Result<T>) -> Result<std::result::Result<T, String>> {
    match flown {
        Ok(flown) => Ok(Ok(flown)),
        Err(Error::Infeasible { what, .. }) => Ok(Err(what)),
        Err(error) => Err(error),
    }
}

/// Takes pixels from the camera until capitals are as high as wanted. A pixel is then the mean of
/// many, which leaves no noise of the sensor: it is switched off.
pub(super) fn shrink(shoot: &mut Shoot, cap_height_px: f64) -> Result<()> {
    let Some(strokes) = &shoot.strokes else { return Ok(()) };
    let end_s = shoot.plans.iter().map(|planned| planned.plan.duration_s()).fold(0.0, f64::max);
    let (bounds_m @ [left, bottom, right, top], scene) = (strokes.bounds_m(), &mut shoot.scene);
    scene.camera.shutter_close_s.get_or_insert(end_s);
    // The height of the word's middle, from edge to edge, in pixels.
    let camera = scene.camera.camera(bounds_m, end_s)?;
    let ends_m = [bottom, top].map(|z_m| Vector3::new(0.5 * (left + right), 0.0, z_m));
    // Out of sight there is nothing to shrink.
    let [Some(low), Some(high)] = ends_m.map(|m| camera.image_from_world(m)) else { return Ok(()) };
    let factor = cap_height_px / libm::hypot(low.x_px - high.x_px, low.y_px - high.y_px);
    if factor >= 1.0 {
        return Ok(());
    }
    #[expect(clippy::cast_possible_truncation, reason = "smaller")]
    for side_px in [&mut scene.camera.width_px, &mut scene.camera.height_px] {
        *side_px = (f64::from(*side_px) * factor).round().max(1.0) as u32;
    }
    scene.photo.noise = Noise::Off;
    Ok(())
}

/// Readers that are kept for the next scene: preparing one takes as long as reading ten photos.
const MAX_READERS: usize = 64;

/// The reader of a word, made once for all its scenes.
pub(super) fn reader(strokes: &Strokes, options: &ScoreOptions) -> Result<Arc<Reader>> {
    type Made = (Strokes, ScoreOptions, Arc<Reader>);
    static MADE: Mutex<Vec<Made>> = Mutex::new(Vec::new());
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, _, reader)) = made.iter().find(|(s, o, _)| s == strokes && o == options) {
        return Ok(reader.clone());
    }
    let reader = Arc::new(Reader::new(strokes, options)?);
    if made.len() >= MAX_READERS {
        made.remove(0);
    }
    made.push((strokes.clone(), options.clone(), reader.clone()));
    Ok(reader)
}

fn digest(scene: &Scene, conditions: &Conditions) -> String {
    let mut digest = Digest::default();
    // A store holds no flight of another build.
    digest.add(SOURCE);
    digest.add_numbers(&[CAP_HEIGHT_PX]);
    digest.add(serde_json::to_vec(&CALIBRATION).expect("plain data"));
    digest.add(scene.to_toml());
    digest.add(serde_json::to_vec(conditions).expect("plain data"));
    digest.hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::Preset;
    use noctograph_plan::PlanOptions;

    fn prepared(word: &str, change: impl FnOnce(&mut Scene)) -> Prepared {
        let mut scene = Scene::preset(Preset::Ae4832022);
        change(&mut scene);
        Prepared::new(&NamedScene::new("team", scene), word, &Conditions::still()).unwrap()
    }

    #[test]
    fn the_small_film_is_read_as_the_scenes_own() {
        let ready = prepared("NOOR", |_| {});
        for seed in 1..3 {
            let small = ready.outcome(seed).unwrap();
            let shoot = Shoot { scene: Scene { seed, ..ready.scene.clone() }, ..ready.shoot(seed) };
            let shot = shoot.take(&|_, _| {}).unwrap();
            assert_eq!((shot.photo.width_px, shot.photo.height_px), (1920, 1080), "its own");
            let full = shot.verdict.unwrap();
            assert_eq!(small.read, full.read);
            let more = small.probability - full.readability;
            assert!(more.abs() < 0.05, "seed {seed}: {} small, {more} more", small.probability);
        }
    }

    #[test]
    fn a_flight_of_still_conditions_is_that_of_preview() {
        let ready = prepared("HI", |_| {});
        let preview =
            Shoot::new(Scene { word: "HI".into(), seed: 5, ..Scene::preset(Preset::Ae4832022) })
                .unwrap();
        assert_eq!(ready.fly(5).unwrap(), preview.fly(&|_, _| {}).unwrap());
    }

    #[test]
    fn a_lost_drone_is_an_outcome() {
        let ready = prepared("I", |scene| scene.sensors.lighthouse.jitter_m = 1.0);
        let outcome = ready.outcome(0).unwrap();
        assert_eq!((outcome.probability, outcome.flown), (0.0, None));
        assert!(outcome.lost.is_some() && !outcome.all_read, "{outcome:?}");

        // Lost where the plan is rehearsed: there is no plan.
        let ready = prepared("I", |scene| {
            scene.plan = PlanOptions::even();
            scene.controller.lqr.q = [1e9; 12];
            scene.vehicle.motor_rise_s = 0.1;
        });
        assert!(ready.plans().is_empty());
        assert!(ready.outcome(0).unwrap().lost.unwrap().contains("the drone"));
    }

    #[test]
    fn two_drones_are_one_trial_with_departures_of_their_own() {
        let scene = Scene { plan: PlanOptions::even(), ..Scene::preset(Preset::Ae4832022) };
        let mut scene = NamedScene::new("pair", scene);
        scene.scene.plan.drones = 2;
        let ready = Prepared::new(&scene, "ON", &Conditions::default()).unwrap();
        let outcome = ready.outcome(3).unwrap();
        assert_eq!((outcome.read.as_str(), ready.plans().len()), ("ON", 2));
        let shoot = ready.shoot(3);
        assert_ne!(shoot.actual[0].sim.vehicle, shoot.actual[1].sim.vehicle);
    }
}
