//! Correction of a plan by the errors of its flights.
//!
//! 1. The repeating error: the mean over flights of `flown − design` while letters are written,
//!    shrunk where flights disagree (positive-part James–Stein), smoothed without phase.
//! 2. The reference moves against a share of it, through the inverse of the scene's loop
//!    ([`feedforward::learn`]).
//! 3. The light commands are moved to the strokes' ends of such a flight ([`aim`]).

use nalgebra::Vector3;

use super::Prepared;
use super::statistics::{mean, standard_error};
use crate::comparison::{ComparisonOptions, compare};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_core::geometry::distance;
use noctograph_core::settings::settings;
use noctograph_letters::Move;
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::{aim, rehearse, step_responses};
use noctograph_plan::{Plan, feedforward, relight};

/// Grid on which errors are averaged.
const STEP_S: f64 = 0.02;
/// Largest error that is corrected at once, along each axis: larger ones are steps between letters.
const MAX_ERROR_M: f64 = 0.08;

settings! {
    /// How to learn.
    pub struct LearnOptions {
        /// Largest number of rounds.
        rounds: u32 = 12;
        /// Flights of a round.
        flights: u32 = 8, in 1.0..=10_000.0;
        /// Share of the error that a round removes. More learns faster, and noise with it.
        gain: f64 = 0.6, in 0.0..=1.0;
        /// Smoothing of the error, σ. Less follows corners closer, and is unstable below about the
        /// response time of the drone.
        smooth_s: f64 = 0.08, in 0.0..=10.0;
        /// Seed of all seeds.
        seed: u64 = 0;
    }
}

/// Corrects a plan by its flights, simulated or real, whose clocks begin with the plan's.
///
/// # Errors
///
/// [`Error::Input`] where no flight writes letters; as [`step_responses`].
///
/// # Panics
///
/// If there is no flight.
pub fn correct(
    sent: &Plan,
    scene: &Scene,
    flights: &[Flight],
    options: &LearnOptions,
) -> Result<Plan> {
    assert!(!flights.is_empty(), "something to learn from");
    let seen = repeating(flights);
    let limited: Vec<_> = seen.iter().map(limited).collect();
    let [seen, limited] = [seen, limited].map(|errors| smoothed(&errors, options.smooth_s));
    let at = |errors: &[Vector3<f64>], time_s: f64| {
        #[expect(clippy::cast_possible_truncation, reason = "clamped")]
        let index = (time_s / STEP_S).round().max(0.0) as usize;
        errors.get(index).copied().unwrap_or_default()
    };
    // A flight with the error that is corrected, and one with the error that is left.
    let mut missed = rehearse(scene, sent)?;
    let mut typical = missed.clone();
    for (missed, typical) in missed.samples.iter_mut().zip(&mut typical.samples) {
        let corrected_m = at(&limited, missed.time_s) * options.gain;
        missed.position_m = missed.design_m + corrected_m;
        if typical.letter.is_some() {
            typical.position_m = typical.design_m + at(&seen, typical.time_s) - corrected_m;
        }
    }
    let responses = step_responses(&scene.sim())?;
    let inverse = feedforward::inverse(sent, &responses);
    let mut next = feedforward::learn(sent, &missed, &inverse);
    // Take-off and landing stay as they were sent.
    for (row, setpoint) in sent.setpoints.iter().enumerate() {
        if setpoint.letter.is_none() {
            next.sent_m[row] = sent.sent_m(row);
        }
    }
    Ok(aim(scene, &scene.light, &next, &typical)?.plan)
}

/// Largest mean distance of a log's setpoints from those of the plan that it is a flight of.
const MAX_APART_M: f64 = 0.2;

const WHICH_PLAN: &str = "name the plan that was sent, and the word that it wrote";

/// Largest mean distance of a word's strokes from the setpoints of a plan that writes it, relative
/// to the height of its letters.
const MAX_OFF_FRAC: f64 = 0.1;

/// Refuses a plan that does not write the word.
///
/// # Errors
///
/// [`Error::Input`] for a plan of another word; as [`noctograph_pipeline::scene::Scene::strokes`].
pub fn check_writes(sent: &Plan, ready: &Prepared, file: &str) -> Result<()> {
    let strokes = ready.scene().strokes()?;
    let written = |letter: usize| {
        let of_letter = sent.setpoints.iter().filter(move |s| s.letter == Some(letter));
        of_letter.map(|setpoint| [setpoint.position_m.x, setpoint.position_m.z])
    };
    let mut off_m = Vec::new();
    for (letter, glyph) in strokes.glyphs.iter().enumerate() {
        // One drone of several writes some of the letters.
        let lit = glyph.moves.iter().filter(|leg| leg.lit && written(letter).next().is_some());
        for Move { from_m, to_m, .. } in lit {
            for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let at = [0, 1].map(|axis| from_m[axis] + share * (to_m[axis] - from_m[axis]));
                off_m.push(written(letter).map(|p| distance(p, at)).fold(f64::INFINITY, f64::min));
            }
        }
    }
    let (off_m, most_m) = (mean(&off_m), MAX_OFF_FRAC * ready.scene().letters.cap_height_m);
    let is_beyond = written(strokes.glyphs.len()).next().is_some();
    if off_m > most_m || is_beyond {
        let found = format!("a plan {off_m:.2} m from the strokes of {}", strokes.word);
        return Err(Error::input(file, found, "a plan that writes this word", WHICH_PLAN));
    }
    Ok(())
}

/// Gives a real flight of a plan the plan's clock, letters and design; `file` is its name in
/// messages.
///
/// # Errors
///
/// [`Error::Input`] for a flight of another plan; as [`relight`] and [`compare`].
pub fn align(mut flight: Flight, sent: &Plan, ready: &Prepared, file: &str) -> Result<Flight> {
    let writes = |sample: &FlightSample| sample.letter.is_some();
    // A log with lights of its own may be of a plan in any order of strokes.
    if flight.lights.is_empty() && !flight.samples.iter().any(writes) {
        relight(&mut flight, &ready.scene().strokes()?)?;
    }
    let row_at = |time_s: f64| sent.row_at(time_s + 1e-6);
    // A log's design is what was sent; that of a flight of this program is what was to be flown.
    let planned = rehearse(ready.scene(), sent)?;
    let mut as_sent = planned.clone();
    for sample in &mut as_sent.samples {
        sample.design_m = sent.sent_m(row_at(sample.time_s));
    }
    let clock = |planned: &Flight| -> Result<(f64, f64)> {
        let offset_s = compare(planned, &flight, &ComparisonOptions::default())?.offset_s;
        let apart_m = flight.samples.iter().filter_map(|sample| {
            let at = planned.samples.partition_point(|p| p.time_s <= sample.time_s + offset_s);
            let of_plan = &planned.samples[at.saturating_sub(1)];
            let writes = sent.setpoints[row_at(sample.time_s + offset_s)].letter.is_some();
            writes.then(|| (sample.design_m - of_plan.design_m).norm())
        });
        Ok((mean(apart_m), offset_s))
    };
    let (apart_m, offset_s) = match (clock(&as_sent), clock(&planned)) {
        (Ok(log), Ok(own)) if log.0 <= own.0 => log,
        (log, own) => own.or(log)?,
    };
    for sample in &mut flight.samples {
        sample.time_s += offset_s;
        let setpoint = &sent.setpoints[row_at(sample.time_s)];
        sample.design_m = setpoint.design_m(sample.time_s.max(setpoint.time_s));
        sample.letter = setpoint.letter;
    }
    if apart_m > MAX_APART_M {
        let found = format!("setpoints {apart_m:.2} m from those of the plan");
        return Err(Error::input(file, found, "a flight of this plan", WHICH_PLAN));
    }
    Ok(flight)
}

/// The repeating error of flights, `flown − design` on the grid; zero outside letters.
fn repeating(flights: &[Flight]) -> Vec<Vector3<f64>> {
    let ends = flights.iter().filter_map(|flight| flight.samples.last());
    let end_s = ends.map(|last| last.time_s).fold(0.0, f64::max);
    #[expect(clippy::cast_possible_truncation, reason = "an hour at most")]
    let n = (end_s / STEP_S) as usize + 1;
    let mut errors: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); n];
    for flight in flights {
        let mut next = 0;
        for sample in flight.samples.iter().filter(|sample| sample.letter.is_some()) {
            while next < n && (next as f64) * STEP_S < sample.time_s - STEP_S {
                next += 1;
            }
            if next < n && (next as f64) * STEP_S <= sample.time_s {
                errors[next].push(sample.position_m - sample.design_m);
                next += 1;
            }
        }
    }
    errors.iter().map(|seen| shrunk(seen)).collect()
}

/// The mean of errors, shrunk by its uncertainty; of one error, the error itself.
fn shrunk(errors: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let values: Vec<f64> = errors.iter().map(|error| error[axis]).collect();
        let (middle, error) = (mean(&values), standard_error(&values));
        let trust = if middle == 0.0 { 0.0 } else { 1.0 - (error / middle) * (error / middle) };
        middle * trust.max(0.0)
    })
}

/// What is corrected of an error at once.
fn limited(error_m: &Vector3<f64>) -> Vector3<f64> {
    error_m.map(|error_m| error_m.clamp(-MAX_ERROR_M, MAX_ERROR_M))
}

/// Gaussian smoothing without phase; ends are held.
fn smoothed(values: &[Vector3<f64>], sigma_s: f64) -> Vec<Vector3<f64>> {
    let sigma = (sigma_s / STEP_S).max(1e-3);
    #[expect(clippy::cast_possible_truncation, reason = "some seconds")]
    let reach = (3.0 * sigma).ceil() as isize;
    let z = (-reach..=reach).map(|tap| tap as f64 / sigma);
    let weights: Vec<f64> = z.map(|z| libm::exp(-0.5 * z * z)).collect();
    let sum: f64 = weights.iter().sum();
    let last = values.len().cast_signed() - 1;
    let at = |index: isize| values[index.clamp(0, last).cast_unsigned()];
    (0..=last)
        .map(|middle| {
            let taps = (-reach..=reach).zip(&weights);
            taps.map(|(tap, weight)| at(middle + tap) * *weight).sum::<Vector3<f64>>() / sum
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Conditions;

    #[test]
    fn a_flight_of_this_program_keeps_the_plans_clock_and_so_does_its_log() {
        let cf21 = Scene::find("cf21", &[]).unwrap();
        let ready = Prepared::new(&cf21, "L", &Conditions::still()).unwrap();
        let sent = ready.plans().remove(0);
        let flight = ready.fly(3).unwrap().remove(0);
        let mut log = flight.clone();
        for sample in &mut log.samples {
            sample.design_m = sent.sent_m(sent.row_at(sample.time_s + 1e-6));
            sample.time_s += 7.0;
        }
        for (given, clock_s) in [(flight.clone(), 0.0), (log, 7.0)] {
            let aligned = align(given.clone(), &sent, &ready, "log").unwrap();
            let moved_s = given.samples[0].time_s - aligned.samples[0].time_s;
            assert!((moved_s - clock_s).abs() < 0.02, "{moved_s} s instead of {clock_s} s");
        }
    }

    #[test]
    fn an_error_that_does_not_repeat_is_not_learned() {
        let one = [Vector3::new(0.02, 0.01, 0.0)];
        assert_eq!(shrunk(&one), one[0], "of a single flight");
        let agree = [Vector3::x() * 0.02, Vector3::x() * 0.021, Vector3::x() * 0.019];
        assert!((shrunk(&agree).x - 0.02).abs() < 1e-4);
        let differ = [Vector3::x() * 0.05, Vector3::x() * -0.045, Vector3::x() * 0.001];
        assert_eq!(shrunk(&differ), Vector3::zeros());
        let wild = [Vector3::x(); 3];
        assert_eq!(limited(&shrunk(&wild)).x, MAX_ERROR_M, "limited");
    }
}
