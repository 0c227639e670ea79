//! Learning: reference and light schedule are corrected by the errors of earlier flights of the
//! same word (iterative learning control).
//!
//! Each round flies the plan with the same seeds and corrects it ([`correct`]). The best plan is
//! kept, not the last: the one that is read with the highest probability, and of equals the one
//! closest to the path, both as they are printed. Learning stops when rounds no longer find a
//! better one. Whether the best is better than the design beyond chance is told pair by pair of
//! flights.
//!
//! Sources: Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE Control
//! Systems 26 (2006); for quadrotors Schoellig, Mueller, D'Andrea, "Optimization-based iterative
//! learning for precise quadrocopter trajectory tracking", Autonomous Robots 33 (2012).
//!
//! Not done: a model of the drone that learns, too; learning of one word for another.

use rayon::prelude::*;

use super::correct::{LearnOptions, correct};
use super::statistics::{Estimate, mean, mean_of_strata, share};
use super::trial::or_lost;
use super::{Outcome, Prepared, Store};
use noctograph_core::digest::fnv_1a;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_core::settings::Described;
use noctograph_plan::Plan;

/// Rounds that may fail in a row before learning stops.
const PATIENCE: u32 = 3;

/// A round of learning: the figures of its flights.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Round {
    /// Mean probability of being read.
    pub legibility: f64,
    /// Share of flights whose photo is legible.
    pub legible: Estimate,
    /// Mean distance from the path, m.
    pub contour_m: f64,
    /// Root mean square error in the word's plane, m.
    pub rmse_m: f64,
    /// Lag, s.
    pub lag_s: f64,
    /// Whether it is the best so far.
    pub kept: bool,
    /// Whether it is significantly better than the design (95 %).
    pub significant: bool,
}

/// The result of learning.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The plans to send, one for each drone.
    pub plans: Vec<Plan>,
    /// Every round; the first flew the design.
    pub rounds: Vec<Round>,
}

impl Learned {
    /// Number of the round whose plans these are: the best one.
    #[must_use]
    pub fn best(&self) -> usize {
        self.rounds.iter().rposition(|round| round.kept).unwrap_or(0)
    }

    /// Whether the best round is significantly better than the design.
    #[must_use]
    pub fn helped(&self) -> bool {
        self.rounds.get(self.best()).is_some_and(|round| round.significant)
    }
}

/// A round's plans, its flights by seed and drone, and their outcomes.
type Tried = (Vec<Plan>, Vec<Vec<Flight>>, Vec<Outcome>);

/// Learns in the simulator. `watch` is called after every round.
///
/// # Errors
///
/// Those of the flights and the store; [`Error::Infeasible`] where every flight of the first round
/// loses the drone.
pub fn learn(
    ready: &Prepared,
    options: &LearnOptions,
    store: Option<&Store>,
    watch: &mut dyn FnMut(&Round),
) -> Result<Learned> {
    options.check("", None)?;
    let seeds: Vec<u64> = (0..options.flights.max(2)).map(|index| seed(options, index)).collect();
    let mut sent = ready.plans();
    let (mut best, mut design): (Option<Tried>, Option<Vec<Outcome>>) = (None, None);
    let (mut rounds, mut failed) = (Vec::new(), 0);
    for _ in 0..=options.rounds {
        let trying = ready.sending(&sent);
        let flown = seeds.par_iter().map(|seed| fly(&trying, *seed, store));
        let flown: Vec<(Vec<Flight>, Outcome)> = flown.collect::<Result<_>>()?;
        let (mut flights, outcomes): (Vec<_>, Vec<_>) = flown.into_iter().unzip();
        flights.retain(|flights| !flights.is_empty());
        let design = design.get_or_insert_with(|| outcomes.clone());
        let kept = best.as_ref().is_none_or(|(_, _, before)| as_read(&outcomes) > as_read(before));
        let round = Round { kept, significant: helped(design, &outcomes), ..round(&outcomes) };
        watch(&round);
        rounds.push(round);
        if kept {
            best = Some((sent.clone(), flights, outcomes));
            failed = 0;
        } else {
            failed += 1;
        }
        // Again from the best plan, with less gain where the last round did not help.
        let (from, flights, _) = best.as_ref().expect("the first round is kept");
        if failed == PATIENCE || flights.is_empty() {
            break;
        }
        let gain = options.gain / f64::from(1 + failed * failed);
        let options = LearnOptions { gain, ..options.clone() };
        let corrected = |(drone, plan): (usize, &Plan)| {
            let of_drone: Vec<_> = flights.iter().map(|flights| flights[drone].clone()).collect();
            correct(plan, ready.scene(), &of_drone, &options)
        };
        sent = from.iter().enumerate().map(corrected).collect::<Result<_>>()?;
    }
    let (plans, _, outcomes) = best.expect("the first round is kept");
    if outcomes.iter().all(|outcome| outcome.lost.is_some()) {
        return Err(Error::Infeasible {
            what: "every flight of the first round loses the drone".into(),
            hint: "tune the scene first".into(),
        });
    }
    Ok(Learned { plans, rounds })
}

fn seed(options: &LearnOptions, index: u32) -> u64 {
    let bytes = options.seed.to_le_bytes().into_iter().chain(index.to_le_bytes());
    fnv_1a(b"learn:".iter().copied().chain(bytes)) >> 33
}

/// Flights of a seed and their outcome; no flights where a drone was lost.
fn fly(ready: &Prepared, seed: u64, store: Option<&Store>) -> Result<(Vec<Flight>, Outcome)> {
    let flights = match or_lost(ready.fly(seed))? {
        Ok(flights) => flights,
        Err(how) => return Ok((Vec::new(), Outcome::lost(ready.word(), how))),
    };
    if let Some(known) = store.and_then(|store| store.get(ready.digest(), seed)) {
        return Ok((flights, known));
    }
    let (outcome, flights) = ready.judge(flights, seed)?;
    let record = ready.record("learning", seed, outcome);
    store.map_or(Ok(()), |store| store.put(&record))?;
    Ok((flights, record.outcome))
}

/// What the best round is chosen by, more being better: the probability of being read, and of equal
/// ones the distance from the path, negative; to the digits that are printed, in their last one.
fn as_read(outcomes: &[Outcome]) -> (f64, f64) {
    let Round { legibility, contour_m, .. } = round(outcomes);
    let contour_m = if outcomes.iter().any(|o| o.flown.is_some()) { contour_m } else { 1e3 };
    ((1e3 * legibility).round(), -(1e4 * contour_m).round())
}

/// Whether flights are significantly better than earlier ones of the same seeds: they read better,
/// or they read no worse and are closer to the path.
fn helped(before: &[Outcome], now: &[Outcome]) -> bool {
    let gain = |value: fn(&Outcome) -> f64| -> Vec<f64> {
        before.iter().zip(now).map(|(before, now)| value(now) - value(before)).collect()
    };
    let off = |o: &Outcome| o.flown.map_or(-1.0, |flown| -flown.contour_m);
    let (reads, near) = (gain(Outcome::merit), gain(off));
    lower_limit(&reads) > 0.0 || (lower_limit(&near) > 0.0 && mean(&reads) > -0.05)
}

/// Lower end of the mean's 95 % interval.
fn lower_limit(values: &[f64]) -> f64 {
    mean_of_strata(&[values.to_vec()]).low
}

/// The figures of a round.
fn round(outcomes: &[Outcome]) -> Round {
    let flown: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.flown).collect();
    let of = |value: fn(&super::Flown) -> f64| mean(flown.iter().map(value));
    Round {
        legibility: mean(outcomes.iter().map(|outcome| outcome.probability)),
        legible: share(outcomes.iter().map(|outcome| outcome.legible)),
        contour_m: of(|f| f.contour_m),
        rmse_m: of(|f| libm::hypot(f.rmse_x_m, f.rmse_z_m)),
        lag_s: of(|f| f.lag_s),
        kept: false,
        significant: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Conditions, Flown};
    use noctograph_pipeline::scene::{NamedScene, Preset, Scene};
    use noctograph_plan::PlanOptions;
    use noctograph_sim::ControllerKind;

    fn ready(kind: ControllerKind) -> Prepared {
        let mut scene = Scene::preset(Preset::Ae4832022);
        scene.controller.kind = kind;
        Prepared::new(&NamedScene::new("s", scene), "L", &Conditions::still()).unwrap()
    }

    #[test]
    fn learning_halves_the_distance_from_the_path() {
        let options = LearnOptions { rounds: 6, flights: 4, ..LearnOptions::default() };
        let ready = ready(ControllerKind::LqrFeedforward);
        let learned = learn(&ready, &options, None, &mut |_| {}).unwrap();
        let first = &learned.rounds[0];
        let best = &learned.rounds[learned.best()];
        assert!(learned.helped());
        assert!(best.contour_m < 0.6 * first.contour_m, "{first:?} became {best:?}");
        assert!(best.rmse_m < 0.7 * first.rmse_m, "{first:?} became {best:?}");
        assert!(best.legibility >= first.legibility - 0.05, "{first:?} became {best:?}");
        let mut csv = Vec::new();
        learned.plans[0].write_csv(&mut csv).unwrap();
        assert_eq!(Plan::parse_csv(&csv, "plan.csv").unwrap(), learned.plans[0], "as a file");
    }

    #[test]
    fn learning_that_does_not_help_stops_and_says_so() {
        // Without gain every round flies the design again, with lights that are aimed already.
        let options = LearnOptions { rounds: 9, flights: 3, gain: 0.0, ..LearnOptions::default() };
        let mut scene = Scene { plan: PlanOptions::even(), ..Scene::preset(Preset::Ae4832022) };
        scene.controller.kind = ControllerKind::Geometric;
        let named = NamedScene::new("s", scene);
        let ready = Prepared::new(&named, "L", &Conditions::still()).unwrap();
        let learned = learn(&ready, &options, None, &mut |_| {}).unwrap();
        assert!(!learned.helped() && learned.rounds.len() < 9, "{:?}", learned.rounds);
        assert!(!learned.rounds.last().unwrap().kept);
    }

    #[test]
    fn the_round_that_is_read_best_is_kept() {
        let of = |probability: f64, contour_m: f64| {
            let flown = Flown { contour_m, ..Flown::from_values([0.0; 10]) };
            vec![Outcome { probability, flown: Some(flown), ..Outcome::example(0.5) }; 4]
        };
        let better = |now: &[Outcome], before: &[Outcome]| as_read(now) > as_read(before);
        assert!(!better(&of(0.944, 0.005), &of(0.951, 0.020)), "closer, and read worse");
        assert!(better(&of(0.951, 0.020), &of(0.944, 0.005)));
        assert!(better(&of(0.951, 0.005), &of(0.9512, 0.020)), "of equals the closer");
        assert!(!better(&of(0.951, 0.005), &of(0.951, 0.005)));
        // The best of the rounds is the learned one, and later ones are not.
        let round = |kept| Round { kept, ..round(&of(0.9, 0.01)) };
        let rounds = [true, true, false, false].map(round).to_vec();
        assert_eq!(Learned { plans: Vec::new(), rounds }.best(), 1);
    }

    #[test]
    fn a_round_that_is_only_luckier_is_no_help() {
        let outcome = |log_odds: f64| Outcome { log_odds, ..Outcome::example(0.5) };
        let of = |values: [f64; 4]| values.map(outcome);
        let before = of([0.0, 1.0, 2.0, 3.0]);
        assert!(helped(&before, &of([0.2, 1.3, 2.2, 3.3])), "a little each time");
        assert!(!helped(&before, &of([2.0, 0.5, 1.6, 3.9])), "more on average, but by chance");
    }
}
