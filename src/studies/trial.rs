//! Trial: prepares a scene for a word, then flies and reads it with many seeds.

use std::num::NonZero;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;

use super::outcome::{Flown, Outcome};
use super::{Conditions, Record, SOURCE};
use noctograph_core::digest::Digest;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_letters::Strokes;
use noctograph_picture::expose::Detail;
use noctograph_picture::photo::{Noise, Photo};
use noctograph_pipeline::scene::{NamedScene, Scene};
use noctograph_pipeline::shoot::{Judging, Recording, Shoot};
use noctograph_plan::Plan;
use noctograph_score::{CALIBRATION, Reader, ScoreOptions};

/// Cap height on the film that is read. The reader resamples capitals to a height of 32 pixels.
/// Fewer pixels blur the trail, and more pixels take longer. For 20 words, each flown twice, the
/// probability differs from that at 1920 × 1080 by 0.017 on average, and by at most 0.21, which
/// occurs for the word Illi. All scenes are compared at this resolution.
const CAP_HEIGHT_PX: f64 = 48.0;

/// Maximum distance, in pixels of the small film, of a lamp from its path, and of the path from its
/// segments: a twentieth of a pixel of the reader's strips. With the tolerances of a full film, a
/// shaking drone leaves a segment per sample.
const TOLERANCE_PX: f64 = 0.1;

/// A scene that is prepared for flying a word with many seeds.
#[derive(Clone, Debug)]
pub struct Prepared {
    scene: Scene,
    /// Shoot of the scene, with a small film.
    shoot: Shoot,
    conditions: Conditions,
    digest: String,
    /// Reason why there is no plan, and advice. Either the drone is lost during planning, or the
    /// plan would take hours.
    unplanned: Option<[String; 2]>,
}

impl Prepared {
    /// Prepares a scene for a word. If the scene cannot be planned, for example because its gain
    /// loses the drone, every outcome is a lost drone, so a bad candidate does not end a study.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for a word that the font cannot write or a setting out of range.
    pub fn new(named: &NamedScene, word: &str, conditions: &Conditions) -> Result<Self> {
        conditions.check()?;
        let mut scene = Scene { seed: 0, ..named.scene.clone() };
        scene.set_word(word);
        scene.check()?;
        // A scene without a plan has a shoot as well, and all of its seeds have the same outcome.
        let (mut shoot, unplanned) = match Shoot::new(scene.clone()) {
            Err(Error::Infeasible { what, hint, .. }) => {
                (Shoot::with_plans(scene.clone(), Vec::new())?, Some([what, hint]))
            }
            shoot => (shoot?, None),
        };
        // Each flight uses one core, because the flights of a study run in parallel.
        (shoot.judging, shoot.keeps_film) = (Judging::Scored, false);
        shoot.cores = Some(NonZero::<usize>::MIN);
        if let Some(strokes) = &shoot.strokes {
            shoot.reader = Some(reader(strokes, &scene.score)?);
        }
        shrink(&mut shoot, CAP_HEIGHT_PX)?;
        coarsen(&mut shoot);
        let digest = digest(&scene, conditions);
        Ok(Self { scene, shoot, conditions: conditions.clone(), digest, unplanned })
    }

    /// Returns the word.
    pub fn word(&self) -> &str {
        self.shoot.strokes.as_ref().map_or("", |strokes| &strokes.word)
    }

    /// Returns the plans, one for each drone. The list is empty if there is no plan.
    pub fn plans(&self) -> Vec<Plan> {
        self.shoot.plans.iter().map(|planned| planned.plan.clone()).collect()
    }

    /// Checks that there is a plan.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Infeasible`] with the reason why there is no plan.
    pub fn planned(&self) -> Result<()> {
        match self.unplanned.clone() {
            None => Ok(()),
            Some([what, hint]) => Err(Error::infeasible(what, hint)),
        }
    }

    /// Returns the scene, which has seed 0 and contains the word.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Returns a digest of everything that determines an outcome except the seed: program, reader,
    /// scene, word and conditions. The digest consists of 16 hexadecimal digits.
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Returns the shoot for one seed, with drones and lamps drawn from the conditions.
    pub fn shoot(&self, seed: u64) -> Shoot {
        self.drawn(self.shoot.clone(), seed)
    }

    /// Returns a shoot of this scene with the seed, and with drones and lamps drawn for it.
    fn drawn(&self, mut shoot: Shoot, seed: u64) -> Shoot {
        shoot.scene.seed = seed;
        let actual = (0..).map(|drone| self.conditions.draw(&shoot.scene, seed, drone));
        shoot.actual = actual.take(shoot.plans.len()).collect();
        shoot
    }

    /// Flies, exposes and reads the word with one seed, and returns the outcome.
    ///
    /// # Errors
    ///
    /// Returns the errors of the stages, except for a lost drone, which is an outcome.
    pub fn outcome(&self, seed: u64) -> Result<Outcome> {
        self.judge(self.fly(seed), seed)
    }

    /// Flies with one seed, and returns a flight for each drone.
    pub fn fly(&self, seed: u64) -> Result<Vec<Flight>> {
        self.planned()?;
        self.shoot(seed).fly(&|_, _| {})
    }

    /// Exposes and reads the flights of a seed, and returns the outcome. If a lamp passes in front
    /// of the lens, there is no photo, and the drone is counted as lost.
    pub fn judge(&self, flights: Result<Vec<Flight>>, seed: u64) -> Result<Outcome> {
        let result = flights.and_then(|flights| {
            let recordings = flights.into_iter().map(Recording::Flight).collect();
            Shoot { recordings, ..self.shoot(seed) }.take(&|_, _| {})
        });
        let shot = match or_lost(result)? {
            Ok(shot) => shot,
            Err(how) => return Ok(Outcome::lost(self.word(), how)),
        };
        let verdict = shot.verdict.expect("a word is read");
        Ok(Outcome::new(&verdict, Flown::new(&shot.flights, &self.scene.sim())?))
    }

    /// Returns the record of an outcome for a store.
    pub(super) fn record(&self, contender: &str, seed: u64, outcome: Outcome) -> Record {
        let (scene, contender) = (self.digest.clone(), contender.to_owned());
        Record { scene, contender, word: self.word().to_owned(), seed, outcome }
    }

    /// Takes the photo for one seed, with the strokes `cap_height_px` high, or smaller if they are
    /// smaller on the scene's film.
    pub fn photo(&self, seed: u64, cap_height_px: f64) -> Result<Photo> {
        let scene = self.scene.clone();
        let mut shoot = Shoot { judging: Judging::Skipped, scene, ..self.shoot.clone() };
        shrink(&mut shoot, cap_height_px)?;
        Ok(self.drawn(shoot, seed).take(&|_, _| {})?.photo)
    }
}

/// Separates a lost drone from other errors. `Ok(Err)` contains the cause of the loss, which is an
/// outcome of the flight and not a failure of the program.
pub(super) fn or_lost<T>(flown: Result<T>) -> Result<std::result::Result<T, String>> {
    match flown {
        Ok(flown) => Ok(Ok(flown)),
        Err(Error::Infeasible { what, .. }) => Ok(Err(what)),
        Err(error) => Err(error),
    }
}

/// Makes lamp paths, segments and glow as exact as the reader needs on a small film. In the detail
/// of a picture, they take longer than the reader.
fn coarsen(shoot: &mut Shoot) {
    let Some(glyph) = shoot.strokes.as_ref().and_then(|strokes| strokes.glyphs.first()) else {
        return;
    };
    let (cap_height_m, scene) = (glyph.cell.cap_height_m, &mut shoot.scene);
    scene.light.path_tolerance_m = TOLERANCE_PX * cap_height_m / CAP_HEIGHT_PX;
    scene.expose.merge_tolerance_px = TOLERANCE_PX;
    scene.expose.detail = Detail::READING;
}

/// Reduces the camera's resolution until the strokes of all lines together are at most
/// `cap_height_px` high, which is the cap height if there is one line. Each pixel is then the mean
/// of many pixels with hardly any noise, so the noise is switched off. A missing closing time of
/// the shutter is set to the end of the plans.
pub(super) fn shrink(shoot: &mut Shoot, cap_height_px: f64) -> Result<()> {
    let Some(strokes) = &shoot.strokes else { return Ok(()) };
    let end_s = shoot.plans.iter().map(|planned| planned.plan.duration_s()).fold(0.0, f64::max);
    let (bounds_m @ [left, bottom, right, top], scene) = (strokes.bounds_m(), &mut shoot.scene);
    scene.camera.shutter_close_s.get_or_insert(end_s);
    // The height of the strokes in pixels is measured at the middle of their width.
    let camera = scene.camera.camera(bounds_m, end_s)?;
    let ends_m = [bottom, top].map(|z_m| Vector3::new(0.5 * (left + right), 0.0, z_m));
    // If the strokes are not in front of the camera, the resolution is not changed.
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

/// Maximum number of cached readers. Preparing a reader takes as long as reading ten photos.
const MAX_READERS: usize = 64;

/// Returns the reader of a word, which is shared by all scenes with the same strokes and options.
pub(super) fn reader(strokes: &Strokes, options: &ScoreOptions) -> Result<Arc<Reader>> {
    type Cached = (Strokes, ScoreOptions, Arc<Reader>);
    static CACHE: Mutex<Vec<Cached>> = Mutex::new(Vec::new());
    let mut cache = CACHE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, _, reader)) = cache.iter().find(|(s, o, _)| s == strokes && o == options) {
        return Ok(reader.clone());
    }
    let reader = Arc::new(Reader::new(strokes, options)?);
    // The oldest reader is dropped to make room.
    if cache.len() >= MAX_READERS {
        cache.remove(0);
    }
    cache.push((strokes.clone(), options.clone(), reader.clone()));
    Ok(reader)
}

/// Computes the value of [`Prepared::digest`], as 16 hexadecimal digits.
fn digest(scene: &Scene, conditions: &Conditions) -> String {
    let mut digest = Digest::default();
    // A different build gives a different digest.
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
            let shoot = Shoot { scene: ready.scene.clone(), ..ready.shoot.clone() };
            let shot = ready.drawn(shoot, seed).take(&|_, _| {}).unwrap();
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

        // The drone is lost while the plan is rehearsed, so there is no plan.
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
