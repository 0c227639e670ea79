//! Learning: the reference and the light schedule are corrected by what earlier flights of the same
//! word missed (iterative learning control).
//!
//! 1. The error that repeats: the mean over flights of `flown − design` while letters are written,
//!    shrunk where flights disagree (positive-part James–Stein), smoothed without phase.
//! 2. The reference moves against a share of it, through the inverse of the scene's loop
//!    ([`feedforward::learn`]): what is sent now must answer for what is flown later.
//! 3. The light commands are aimed at where strokes begin and end on such a flight
//!    ([`aim`]).
//! 4. Learning stops when a round does not help beyond chance: flights of the same seeds, pair by
//!    pair. The best reference is kept, not the last.
//!
//! Sources: Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE Control
//! Systems 26 (2006); for quadrotors Schoellig, Mueller, D'Andrea, "Optimization-based iterative learning for
//! precise quadrocopter trajectory tracking", Autonomous Robots 33 (2012).
//!
//! Not done: a model of the drone that learns, too; learning of one word for another.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::statistics::mean;
use super::{Outcome, Prepared, Record, Store};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::plan::{Plan, feedforward};
use crate::scene::Scene;
use crate::shoot::{aim, rehearse};
use crate::sim::step_responses;

/// Grid on which errors are averaged.
const STEP_S: f64 = 0.02;
/// Largest error that is learned from at once: what is beyond is a step between letters.
const MOST_M: f64 = 0.08;
/// A round helped when its mean gain is so many standard errors above nothing.
const SURE: f64 = 2.0;
/// Rounds that may fail in a row before learning stops.
const PATIENCE: u32 = 3;

/// How to learn.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnOptions {
    /// Most rounds.
    pub rounds: u32,
    /// Flights of a round.
    pub flights: u32,
    /// Share of the error that a round takes off, 0 to 1. More learns faster, and noise with it.
    pub gain: f64,
    /// Smoothing of the error, σ. Less follows corners closer, and is unstable from about the time in
    /// which the drone answers.
    pub smooth_s: f64,
    /// Seed of all seeds.
    pub seed: u64,
}

impl Default for LearnOptions {
    fn default() -> Self {
        Self { rounds: 12, flights: 8, gain: 0.6, smooth_s: 0.08, seed: 0 }
    }
}

/// A round of learning: what its flights were worth with what had been learned before.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// Mean probability of being read.
    pub legibility: f64,
    /// Mean merit.
    pub merit: f64,
    /// Mean distance from the path, m.
    pub contour_m: f64,
    /// Root mean square error in the plane, m.
    pub rmse_m: f64,
    /// Lag, s.
    pub lag_s: f64,
    /// Whether it is the best so far, beyond chance.
    pub kept: bool,
}

/// What was learned.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The plan to send.
    pub plan: Plan,
    /// Every round; the first flew the design.
    pub rounds: Vec<Round>,
}

/// Learns in the simulator. `watch` hears of every round.
///
/// # Errors
///
/// What the flights and the store say; [`Error::Infeasible`] where every flight of the first round
/// loses the drone.
pub fn learn(
    ready: &Prepared,
    options: &LearnOptions,
    store: Option<&Store>,
    watch: &mut dyn FnMut(&Round),
) -> Result<Learned> {
    let seeds: Vec<u64> = (0..options.flights.max(2)).map(|index| seed(options, index)).collect();
    let mut sent = ready.sent().clone();
    let mut best: Option<(Plan, Vec<Flight>, Vec<Outcome>)> = None;
    let (mut rounds, mut failed) = (Vec::new(), 0);
    for _ in 0..=options.rounds {
        let trying = ready.sending(sent.clone());
        let flown = seeds.par_iter().map(|seed| fly(&trying, *seed, store));
        let flown: Vec<(Option<Flight>, Outcome)> = flown.collect::<Result<_>>()?;
        let (flights, outcomes): (Vec<_>, Vec<_>) = flown.into_iter().unzip();
        let flights: Vec<Flight> = flights.into_iter().flatten().collect();
        let kept = best.as_ref().is_none_or(|(_, _, before)| helped(before, &outcomes));
        let round = round(&outcomes, kept);
        watch(&round);
        rounds.push(round);
        if kept {
            best = Some((sent.clone(), flights, outcomes));
            failed = 0;
        } else {
            failed += 1;
        }
        // From the best again, and less of it, where the last round did not help.
        let (from, flights, _) = best.as_ref().expect("the first round is kept");
        if failed == PATIENCE || flights.is_empty() {
            break;
        }
        let gain = options.gain / f64::from(1 + failed * failed);
        sent = correct(from, ready.scene(), flights, &LearnOptions { gain, ..options.clone() })?;
    }
    let (plan, _, outcomes) = best.expect("the first round is kept");
    if outcomes.iter().all(|outcome| outcome.lost.is_some()) {
        return Err(Error::Infeasible {
            what: "every flight of the first round loses the drone".into(),
            hint: "tune the scene first: noctograph tune".into(),
        });
    }
    Ok(Learned { plan, rounds })
}

fn seed(options: &LearnOptions, index: u32) -> u64 {
    let bytes = options.seed.to_le_bytes().into_iter().chain(index.to_le_bytes());
    super::fnv_1a(b"learn:".iter().copied().chain(bytes)) >> 33
}

/// A flight and what it was worth; no flight where the drone was lost.
fn fly(ready: &Prepared, seed: u64, store: Option<&Store>) -> Result<(Option<Flight>, Outcome)> {
    let flight = match ready.fly(seed) {
        Ok(flight) => flight,
        Err(Error::Infeasible { what, .. }) => return Ok((None, ready.lost(what))),
        Err(error) => return Err(error),
    };
    if let Some(known) = store.and_then(|store| store.get(ready.digest(), seed)) {
        return Ok((Some(flight), known));
    }
    let outcome = ready.judge(&flight, seed)?;
    let (scene, word) = (ready.digest().to_owned(), ready.word().to_owned());
    let contender = "learning".to_owned();
    let record = Record { scene, contender, word, seed, outcome };
    store.map_or(Ok(()), |store| store.put(&record))?;
    Ok((Some(flight), record.outcome))
}

/// Whether flights are better than those of the same seeds before: they read better beyond chance, or
/// no worse and are nearer to the path beyond chance.
fn helped(before: &[Outcome], now: &[Outcome]) -> bool {
    let gain = |value: fn(&Outcome) -> f64| -> Vec<f64> {
        before.iter().zip(now).map(|(before, now)| value(now) - value(before)).collect()
    };
    let off = |o: &Outcome| o.flown.map_or(-1.0, |flown| -flown.contour_m);
    let (reads, near) = (gain(Outcome::merit), gain(off));
    sure(&reads) > 0.0 || (sure(&near) > 0.0 && mean(&reads) > -0.05)
}

/// Lower end of what the mean surely is.
fn sure(values: &[f64]) -> f64 {
    mean(values) - SURE * standard_error(values)
}

fn standard_error(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: Vec<f64> = values.iter().map(|v| (v - middle) * (v - middle)).collect();
    #[expect(clippy::cast_precision_loss, reason = "a few flights")]
    let n = values.len() as f64;
    if n < 2.0 { 0.0 } else { (mean(&squares) / (n - 1.0)).sqrt() }
}

fn round(outcomes: &[Outcome], kept: bool) -> Round {
    let flown: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.flown).collect();
    let of = |value: fn(&super::Flown) -> f64| mean(&flown.iter().map(value).collect::<Vec<_>>());
    let read = |value: fn(&Outcome) -> f64| mean(&outcomes.iter().map(value).collect::<Vec<_>>());
    Round {
        legibility: read(|outcome| outcome.probability),
        merit: read(Outcome::merit),
        contour_m: of(|f| f.contour_m),
        rmse_m: of(|f| libm::hypot(f.rmse_x_m, f.rmse_z_m)),
        lag_s: of(|f| f.lag_s),
        kept,
    }
}

/// The plan to send next, after flights of `sent` by simulator or by hand, with clocks that begin
/// together with the plan's.
///
/// # Errors
///
/// [`Error::Input`] where no flight writes letters, and what the scene's loop says.
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
    let error = smoothed(&repeating(flights), options.smooth_s);
    let at = |time_s: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let index = (time_s / STEP_S).round().max(0.0) as usize;
        error.get(index).copied().unwrap_or_default()
    };
    // A flight with the error that repeats, and nothing else.
    let mut missed = rehearse(scene, sent)?;
    let mut typical = missed.clone();
    for (missed, typical) in missed.samples.iter_mut().zip(&mut typical.samples) {
        let error_m = at(missed.time_s);
        missed.position_m = missed.design_m + error_m * options.gain;
        if typical.letter.is_some() {
            typical.position_m = typical.design_m + error_m;
        }
    }
    let responses = step_responses(&scene.sim())?;
    let mut next = feedforward::learn(sent, &missed, &responses);
    // What is sent while nothing is written stays: take-off and landing are nobody's letters.
    for (row, setpoint) in sent.setpoints.iter().enumerate() {
        if setpoint.letter.is_none() {
            next.sent_m[row] = sent.sent_m(row);
        }
    }
    Ok(aim(scene, &next, &typical)?.plan)
}

/// What flights have in common of `flown − design`, on the grid; nothing outside letters.
fn repeating(flights: &[Flight]) -> Vec<Vector3<f64>> {
    let ends = flights.iter().filter_map(|flight| flight.samples.last());
    let end_s = ends.map(|last| last.time_s).fold(0.0, f64::max);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an hour at most")]
    let n = (end_s / STEP_S) as usize + 1;
    let mut errors: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); n];
    for flight in flights {
        let mut next = 0;
        for sample in flight.samples.iter().filter(|sample| sample.letter.is_some()) {
            #[expect(clippy::cast_precision_loss, reason = "an hour at most")]
            while next < n && (next as f64) * STEP_S < sample.time_s - STEP_S {
                next += 1;
            }
            #[expect(clippy::cast_precision_loss, reason = "an hour at most")]
            if next < n && (next as f64) * STEP_S <= sample.time_s {
                errors[next].push(sample.position_m - sample.design_m);
                next += 1;
            }
        }
    }
    errors.iter().map(|seen| shared(seen)).collect()
}

/// The mean of some errors, shrunk by how unsure it is; of one, the error itself.
fn shared(errors: &[Vector3<f64>]) -> Vector3<f64> {
    if errors.is_empty() {
        return Vector3::zeros();
    }
    Vector3::from_fn(|axis, _| {
        let values: Vec<f64> = errors.iter().map(|error| error[axis]).collect();
        let (middle, doubt) = (mean(&values), standard_error(&values));
        let trust = if middle == 0.0 { 0.0 } else { 1.0 - (doubt / middle) * (doubt / middle) };
        (middle * trust.max(0.0)).clamp(-MOST_M, MOST_M)
    })
}

/// Gaussian smoothing without phase; ends are held.
fn smoothed(values: &[Vector3<f64>], sigma_s: f64) -> Vec<Vector3<f64>> {
    let sigma = (sigma_s / STEP_S).max(1e-3);
    #[expect(clippy::cast_possible_truncation, reason = "some seconds")]
    let reach = (3.0 * sigma).ceil() as isize;
    let weight = |tap: isize| {
        #[expect(clippy::cast_precision_loss, reason = "some seconds")]
        let z = tap as f64 / sigma;
        libm::exp(-0.5 * z * z)
    };
    let weights: Vec<f64> = (-reach..=reach).map(weight).collect();
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
    use crate::scene::Scene;
    use crate::sim::ControllerKind;
    use crate::study::{Conditions, Contender};

    fn ready(kind: ControllerKind) -> Prepared {
        let mut scene = Scene::default();
        scene.controller.kind = kind;
        Prepared::new(&Contender::new("s", scene), "L", &Conditions::still()).unwrap()
    }

    #[test]
    fn learning_halves_the_distance_from_the_path() {
        let options = LearnOptions { rounds: 6, flights: 4, ..LearnOptions::default() };
        let ready = ready(ControllerKind::LqrFeedforward);
        let learned = learn(&ready, &options, None, &mut |_| {}).unwrap();
        let first = &learned.rounds[0];
        let best = learned.rounds.iter().rfind(|round| round.kept).unwrap();
        assert!(best.contour_m < 0.6 * first.contour_m, "{first:?} became {best:?}");
        assert!(best.rmse_m < 0.7 * first.rmse_m, "{first:?} became {best:?}");
        assert!(best.merit >= first.merit - 0.05, "{first:?} became {best:?}");
        let mut csv = Vec::new();
        learned.plan.write_csv(&mut csv).unwrap();
        assert_eq!(Plan::parse_csv(&csv, "plan.csv").unwrap(), learned.plan, "a file holds it");
    }

    #[test]
    fn what_does_not_repeat_is_not_learned() {
        let one = [Vector3::new(0.02, 0.01, 0.0)];
        assert_eq!(shared(&one), one[0], "a single flight is all there is");
        let agree = [Vector3::x() * 0.02, Vector3::x() * 0.021, Vector3::x() * 0.019];
        assert!((shared(&agree).x - 0.02).abs() < 1e-4);
        let differ = [Vector3::x() * 0.05, Vector3::x() * -0.045, Vector3::x() * 0.001];
        assert_eq!(shared(&differ), Vector3::zeros());
        let wild = [Vector3::x(); 3];
        assert_eq!(shared(&wild).x, MOST_M, "no step is learned at once");
    }

    #[test]
    fn a_round_that_is_only_luckier_is_no_help() {
        let outcome = |log_odds: f64| Outcome {
            read: "L".into(),
            all_read: true,
            legible: true,
            probability: 0.5,
            log_odds,
            similarity: 0.5,
            flown: None,
            lost: None,
        };
        let of = |values: [f64; 4]| values.map(outcome);
        let before = of([0.0, 1.0, 2.0, 3.0]);
        assert!(helped(&before, &of([0.2, 1.3, 2.2, 3.3])), "a little each time");
        assert!(!helped(&before, &of([2.0, 0.5, 1.6, 3.9])), "more on average, but by chance");
    }
}
