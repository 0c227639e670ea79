//! Trial: a scene made ready for a word, and what one flight of it is worth.

use std::num::NonZero;
use std::sync::{Arc, Mutex};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{Conditions, Contender};
use crate::camera::{Camera, CameraOptions};
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::expose;
use crate::flight::tracking::{Part, track};
use crate::flight::{ENERGY_J, Flight, FlightSample, SATURATED_S};
use crate::letters::{Strokes, write};
use crate::light::light;
use crate::photo::{Noise, Photo, PhotoOptions, develop};
use crate::plan::{Plan, Setpoint};
use crate::scene::Scene;
use crate::score::{Reader, ScoreOptions, Verdict, View};
use crate::sim::{Drone, SimOptions, fly};

/// Height of a capital on the film that is read; the reader resamples it to 32. Fewer pixels blur
/// the trail, more cost time. Against 1920 × 1080 NOOR is read up to 0.03 off, and HI, whose
/// capitals have 540 pixels there, 0.09 more: a fine picture of two letters shows the board's faint
/// trails crisper. Contenders are compared on equal films.
const CAP_HEIGHT_PX: f64 = 48.0;

/// Log-odds are kept within ± this: a word that cannot be read at all has none.
pub(super) const MAX_LOG_ODDS: f64 = 10.0;

/// What one flight was worth. A line of a [`super::Store`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What was read, letter by letter.
    pub read: String,
    /// Whether every letter was read as it should.
    pub all_read: bool,
    /// Whether the word counts as legible.
    pub legible: bool,
    /// Probability that a strict reader reads the word, 0 to 1.
    pub probability: f64,
    /// Its log-odds, −10 to 10: where the probability is flat, these still have a slope.
    pub log_odds: f64,
    /// Mean similarity of the letters with what they should be, up to 1.
    pub similarity: f64,
    /// How it was flown; `None` where the drone was lost.
    #[serde(flatten)]
    pub flown: Option<Flown>,
    /// How the drone was lost; `None` where it was not.
    pub lost: Option<String>,
}

/// How a flight was flown; over the letters, where nothing else is said.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flown {
    /// Mean distance from the path in the word's plane.
    pub contour_m: f64,
    /// Lag behind the design.
    pub lag_s: f64,
    /// Root mean square error against the design along x.
    pub rmse_x_m: f64,
    /// Along y.
    pub rmse_y_m: f64,
    /// Along z.
    pub rmse_z_m: f64,
    /// Farthest from the word's plane.
    pub drift_y_m: f64,
    /// Largest tilt: roll or pitch.
    pub tilt_rad: f64,
    /// Share of the time in which a motor is at its limit.
    pub saturated_frac: f64,
    /// Whole flight.
    pub duration_s: f64,
    /// Whole flight: current of the thrust and of the electronics at the open-circuit voltage.
    pub energy_j: f64,
}

impl Outcome {
    /// What a search climbs: log-odds of the word, and where these are flat the mean similarity of its
    /// letters (ten for a perfect one, to be of the same size).
    #[must_use]
    pub fn merit(&self) -> f64 {
        self.log_odds + MAX_LOG_ODDS * self.similarity
    }

    fn of(verdict: &Verdict, flown: Option<Flown>, lost: Option<String>) -> Self {
        let p = verdict.readability;
        let log_odds = libm::log(p / (1.0 - p)).clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS);
        let letters = &verdict.letters;
        #[expect(clippy::cast_precision_loss, reason = "at most 256 letters")]
        let n = letters.len().max(1) as f64;
        Self {
            read: verdict.read.clone(),
            all_read: letters.iter().all(|letter| letter.best == Some(letter.expected)),
            legible: verdict.legible,
            probability: p,
            log_odds,
            similarity: letters.iter().map(|letter| letter.p).sum::<f64>() / n,
            flown,
            lost,
        }
    }

    fn lost(word: &str, how: String) -> Self {
        Self {
            read: "?".repeat(word.chars().count()),
            all_read: false,
            legible: false,
            probability: 0.0,
            log_odds: -MAX_LOG_ODDS,
            similarity: 0.0,
            flown: None,
            lost: Some(how),
        }
    }
}

/// A scene made ready to fly a word again and again.
#[derive(Clone, Debug)]
pub struct Prepared {
    scene: Scene,
    believed: SimOptions,
    conditions: Conditions,
    strokes: Strokes,
    /// What should be flown.
    design: Plan,
    /// What is sent: the design, or what was learned.
    sent: Plan,
    reader: Arc<Reader>,
    digest: String,
}

impl Prepared {
    /// Makes a contender ready for a word.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a word that its font cannot write or a setting out of range,
    /// [`Error::Infeasible`] for a flight longer than an hour.
    pub fn new(contender: &Contender, word: &str, conditions: &Conditions) -> Result<Self> {
        conditions.check()?;
        let scene = Scene { word: word.to_owned(), seed: 0, ..contender.scene.clone() };
        scene.check()?;
        let strokes = write(word, &scene.letters)?;
        let design = crate::shoot::plan(&scene, &strokes)?.swap_remove(0).plan;
        let sent = contender.plans.get(&strokes.word).unwrap_or(&design).clone();
        let digest = digest(&scene, conditions, (sent != design).then_some(&sent));
        let believed = scene.sim();
        let reader = reader(&strokes, &scene.score)?;
        let conditions = conditions.clone();
        Ok(Self { scene, believed, conditions, strokes, design, sent, reader, digest })
    }

    /// The word.
    #[must_use]
    pub fn word(&self) -> &str {
        &self.strokes.word
    }

    /// What should be flown.
    #[must_use]
    pub fn design(&self) -> &Plan {
        &self.design
    }

    /// What is sent to the drone.
    #[must_use]
    pub fn sent(&self) -> &Plan {
        &self.sent
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The same with another plan sent.
    #[must_use]
    pub fn sending(&self, sent: Plan) -> Self {
        let digest = digest(&self.scene, &self.conditions, Some(&sent));
        Self { sent, digest, ..self.clone() }
    }

    /// Names everything that decides an outcome but the seed: program, scene, word, conditions and
    /// what is sent. 16 hexadecimal digits.
    #[must_use]
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Flies once, exposes and reads.
    ///
    /// # Errors
    ///
    /// What the stages say, but for a drone that is lost: that is an outcome.
    pub fn outcome(&self, seed: u64) -> Result<Outcome> {
        self.worth(self.fly(seed), seed)
    }

    /// What became of the flight of a seed: exposed and read, or lost.
    ///
    /// # Errors
    ///
    /// As [`Self::outcome`].
    pub fn worth(&self, flight: Result<Flight>, seed: u64) -> Result<Outcome> {
        match flight {
            Ok(flight) => self.judge(&flight, seed),
            Err(Error::Infeasible { what, .. }) => Ok(self.lost(what)),
            Err(error) => Err(error),
        }
    }

    /// What a flight of a seed is worth: exposed and read.
    ///
    /// # Errors
    ///
    /// What the stages say.
    pub fn judge(&self, flight: &Flight, seed: u64) -> Result<Outcome> {
        let (_, verdict) = self.read(flight, seed, CAP_HEIGHT_PX)?;
        let flown = self.flown(flight)?;
        Ok(Outcome::of(&verdict, Some(flown), None))
    }

    /// The outcome of a drone that was lost.
    pub(super) fn lost(&self, how: String) -> Outcome {
        Outcome::lost(self.word(), how)
    }

    /// The flight of one seed.
    ///
    /// # Errors
    ///
    /// What [`crate::sim::fly`] says.
    pub fn fly(&self, seed: u64) -> Result<Flight> {
        let (actual, _) = self.conditions.draw(seed).apply(&self.scene);
        let drone = Drone { believed: &self.believed, actual: &actual, seed, index: 0 };
        fly(&self.sent, &drone, &mut |_| {})
    }

    /// Gives a real flight of what is sent the design that should have been flown, and its letters.
    /// Returns the mean distance of its logged setpoints from those of the plan while letters are
    /// written, m.
    pub fn redesign(&self, flight: &mut Flight) -> f64 {
        let (plan, mut at, mut apart) = (&self.sent, 0, Vec::new());
        for sample in &mut flight.samples {
            let due = |s: &Setpoint| s.time_s <= sample.time_s + 1e-6;
            while plan.setpoints.get(at + 1).is_some_and(due) {
                at += 1;
            }
            let setpoint = &plan.setpoints[at];
            if setpoint.letter.is_some() {
                apart.push((sample.design_m - plan.sent_m(at)).norm());
            }
            sample.design_m = setpoint.design_m(sample.time_s.max(setpoint.time_s));
            sample.letter = setpoint.letter;
        }
        super::statistics::mean(&apart)
    }

    /// The photo of one seed with capitals of so many pixels, at most as large as the scene's own.
    ///
    /// # Errors
    ///
    /// What the stages say.
    pub fn photo(&self, seed: u64, cap_height_px: f64) -> Result<Photo> {
        Ok(self.read(&self.fly(seed)?, seed, cap_height_px)?.0)
    }

    fn read(&self, flight: &Flight, seed: u64, cap_height_px: f64) -> Result<(Photo, Verdict)> {
        let (_, lamps) = self.conditions.draw(seed).apply(&self.scene);
        let (camera, options) = self.camera(cap_height_px)?;
        let trace = light(flight, &lamps, seed, 0)?;
        let latent = expose::project(&trace, &camera, &self.scene.expose)?;
        let film = latent.develop_on(NonZero::<usize>::MIN);
        let photo = develop(&film, &camera, &options, seed)?;
        let verdict = self.reader.score(&photo, &View::Camera(Box::new(camera)))?;
        Ok((photo, verdict))
    }

    /// The scene's camera with fewer pixels. One of them is then the mean of many of the scene's, in
    /// which the sensor's noise is lost: it is switched off.
    fn camera(&self, cap_height_px: f64) -> Result<(Camera, PhotoOptions)> {
        let (own, end_s) = (&self.scene.camera, self.design.duration_s());
        let bounds_m = self.strokes.bounds_m();
        let camera = own.camera(bounds_m, end_s)?;
        let Some(found_px) = cap_height(&camera, bounds_m) else {
            return Ok((camera, self.scene.photo.clone()));
        };
        let shrink = cap_height_px / found_px;
        if shrink >= 1.0 {
            return Ok((camera, self.scene.photo.clone()));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "smaller")]
        let smaller = |side_px: u32| (f64::from(side_px) * shrink).round().max(1.0) as u32;
        let (width_px, height_px) = (smaller(own.width_px), smaller(own.height_px));
        let options = CameraOptions { width_px, height_px, ..own.clone() };
        let photo = PhotoOptions { noise: Noise::Off, ..self.scene.photo.clone() };
        Ok((options.camera(bounds_m, end_s)?, photo))
    }

    fn flown(&self, flight: &Flight) -> Result<Flown> {
        let tracking = track(flight, Part::Letters)?;
        let tilt_rad =
            tracking.attitude.map_or(0.0, |a| a.max.pitch_rad.abs().max(a.max.roll_rad.abs()));
        Ok(Flown {
            contour_m: tracking.contour.mean_m,
            lag_s: tracking.lag_s,
            rmse_x_m: tracking.rmse_m.x,
            rmse_y_m: tracking.rmse_m.y,
            rmse_z_m: tracking.rmse_m.z,
            drift_y_m: tracking.drift.max_y_m.max(-tracking.drift.min_y_m),
            tilt_rad,
            saturated_frac: saturated_frac(flight),
            duration_s: flight.samples.last().map_or(0.0, |last| last.time_s),
            energy_j: energy(flight, &self.believed),
        })
    }
}

/// Readers that are kept for the next contender: making one costs as much as reading ten photos.
const READERS: usize = 64;

/// The reader of a word, made once for all contenders and candidates that share it.
fn reader(strokes: &Strokes, options: &ScoreOptions) -> Result<Arc<Reader>> {
    type Made = (Strokes, ScoreOptions, Arc<Reader>);
    static MADE: Mutex<Vec<Made>> = Mutex::new(Vec::new());
    let mut made = MADE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some((_, _, reader)) = made.iter().find(|(s, o, _)| s == strokes && o == options) {
        return Ok(reader.clone());
    }
    let reader = Arc::new(Reader::new(strokes, options)?);
    if made.len() >= READERS {
        made.remove(0);
    }
    made.push((strokes.clone(), options.clone(), reader.clone()));
    Ok(reader)
}

/// Height of the word in the camera's picture, in pixels; `None` where it is out of sight.
fn cap_height(camera: &Camera, [left, bottom, right, top]: [f64; 4]) -> Option<f64> {
    let at = |z| camera.image_from_world(Vector3::new(0.5 * (left + right), 0.0, z));
    let (low, high) = (at(bottom)?, at(top)?);
    Some(libm::hypot(low.x_px - high.x_px, low.y_px - high.y_px))
}

/// Share of the time over the letters in which a motor was asked for more or less than it has.
fn saturated_frac(flight: &Flight) -> f64 {
    let Some(so_far_s) = flight.extra.get(SATURATED_S) else { return 0.0 };
    let (mut written_s, mut saturated_s) = (0.0, 0.0);
    for (pair, so_far_s) in flight.samples.windows(2).zip(so_far_s.windows(2)) {
        if pair[0].letter.is_some() {
            written_s += pair[1].time_s - pair[0].time_s;
            saturated_s += so_far_s[1] - so_far_s[0];
        }
    }
    if written_s > 0.0 { saturated_s / written_s } else { 0.0 }
}

/// What left the battery; where the scene has none, what a full one would have given.
fn energy(flight: &Flight, options: &SimOptions) -> f64 {
    let left_j = flight.extra.get(ENERGY_J).and_then(|column| column.last());
    left_j.copied().unwrap_or_else(|| energy_j(&flight.samples, options))
}

/// `∫ V (I_idle + I per N · thrust) dt` at the open-circuit voltage of the battery as charged.
fn energy_j(samples: &[FlightSample], options: &SimOptions) -> f64 {
    let battery = &options.battery;
    let volts = battery.open_circuit_v(battery.charge_frac);
    let power_w = |sample: &FlightSample| {
        let thrust_n = options.vehicle.k_f_n * sample.motors.iter().sum::<f64>();
        volts * (battery.idle_current_a + battery.current_a_per_n * thrust_n)
    };
    samples.windows(2).map(|pair| power_w(&pair[0]) * (pair[1].time_s - pair[0].time_s)).sum()
}

fn digest(scene: &Scene, conditions: &Conditions, sent: Option<&Plan>) -> String {
    let mut digest = Digest::default();
    digest.add(env!("CARGO_PKG_VERSION"));
    digest.add_numbers(&[CAP_HEIGHT_PX]);
    digest.add(scene.to_toml());
    digest.add(serde_json::to_vec(conditions).expect("plain data"));
    if let Some(sent) = sent {
        let mut csv = Vec::new();
        sent.write_csv(&mut csv).expect("writing into memory");
        digest.add(csv);
    }
    digest.hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::LetterOptions;
    use crate::plan::plan;

    fn prepared(word: &str, change: impl FnOnce(&mut Scene)) -> Prepared {
        let mut scene = Scene::default();
        change(&mut scene);
        let contender = Contender::new("team", scene);
        Prepared::new(&contender, word, &Conditions::still()).unwrap()
    }

    #[test]
    fn the_small_film_is_read_as_the_scenes_own() {
        let ready = prepared("NOOR", |_| {});
        for seed in 1..3 {
            let small = ready.outcome(seed).unwrap();
            let flight = ready.fly(seed).unwrap();
            let (photo, full) = ready.read(&flight, seed, f64::INFINITY).unwrap();
            assert_eq!((photo.width_px, photo.height_px), (1920, 1080), "the scene's own");
            assert_eq!(small.read, full.read);
            let off = small.probability - full.readability;
            assert!(off.abs() < 0.05, "seed {seed}: {} small, {off} more", small.probability);
        }
    }

    #[test]
    fn a_flight_of_still_conditions_is_that_of_preview() {
        let ready = prepared("HI", |_| {});
        let scene = Scene::default();
        let strokes = write("HI", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &scene.plan).unwrap();
        let flight = fly(&plan, &Drone::new(&scene.sim(), 5), &mut |_| {}).unwrap();
        assert_eq!(ready.fly(5).unwrap(), flight);
    }

    #[test]
    fn a_lost_drone_is_an_outcome() {
        let ready = prepared("I", |scene| scene.sensors.lighthouse.jitter_m = 1.0);
        let outcome = ready.outcome(0).unwrap();
        assert_eq!((outcome.probability, outcome.flown), (0.0, None));
        assert!(outcome.lost.is_some() && !outcome.all_read, "{outcome:?}");
    }

    #[test]
    fn errors_of_a_learned_plan_are_against_what_should_be_flown() {
        let ready = prepared("I", |_| {});
        let mut sent = ready.design().clone();
        let moved = sent.setpoints.iter().map(|s| s.position_m + Vector3::x() * 0.02);
        sent.sent_m = moved.collect();
        let moved = ready.sending(sent);
        let x_m = |ready: &Prepared| {
            let flight = ready.fly(1).unwrap();
            track(&flight, Part::Letters).unwrap().mean_error_m.x
        };
        assert!((x_m(&moved) - x_m(&ready) - 0.02).abs() < 2e-3);
        assert_ne!(moved.digest(), ready.digest());
    }

    #[test]
    fn energy_is_current_times_voltage_times_time() {
        let mut sample = prepared("I", |_| {}).fly(0).unwrap().samples[0];
        sample.motors = [10_000.0; 4];
        let later = FlightSample { time_s: sample.time_s + 2.0, ..sample };
        // 40 000 units of 1.95 µN draw 6.68 A/N; a full battery has 4.2 V.
        let want_j = 2.0 * 4.2 * (0.24 + 6.68 * 0.078);
        let found_j = energy_j(&[sample, later], &SimOptions::default());
        assert!((found_j - want_j).abs() < 1e-9, "{found_j} for {want_j}");
    }
}
