//! Tuning: searches for the values of a scene's knobs at which words are read most reliably.
//!
//! 1. Search: each candidate flies the training words with the training seeds. The objective is the
//!    candidate's mean merit ([`Outcome::merit`](super::Outcome::merit)), less a penalty for
//!    exceeded limits. A candidate that is below the median of the others after half of its flights
//!    is abandoned (median rule: Golovin et al., "Google Vizier", KDD 2017).
//! 2. Finals: the best few candidates and the original scene fly again with new seeds, because the
//!    best result of a search is partly due to luck.
//! 3. Test: the winner's lead is partly due to luck as well, so the winner is compared with the
//!    original scene on further seeds. It becomes the result only if it is distinguishably better.

use std::collections::BTreeMap;

use serde::Serialize;

use super::experiment::{FINALS, TESTS, evaluate};
use super::knobs::{Knob, settings, turned, without_effect};
use super::search::Search;
use super::statistics::{Estimate, mean, median, proportion};
use super::{Conditions, Flown, Ranking, Record, Store, Study, Trial, least_flights, rank};
use noctograph_core::error::{Error, Result};
use noctograph_core::input_error;
use noctograph_pipeline::scene::{NamedScene, Scene};
use noctograph_pipeline::shoot::Stop;
use noctograph_plan::tracking::CORRIDOR_M;
use noctograph_sim::Law;
use noctograph_sim::gain_design::{MOTOR_LAG_S, design};

/// Number of finalists, including the original scene.
const FINALISTS: usize = 6;
/// Number of a finalist's flights, as a multiple of a candidate's flights in the search.
const FINAL_TIMES: u32 = 4;
/// Name of the tuned scene in the final test.
const TUNED: &str = "tuned";
/// Minimum number of costs for which a median is computed.
const LEAST_COSTS: usize = 5;
/// Minimum number of candidates in a search.
const LEAST_CANDIDATES: usize = 10;
/// Penalty, in units of merit, for a figure that is twice its limit.
const PENALTY: f64 = 20.0;

/// Limits for the mean figures of a candidate's flights. Maximum root mean square error against the
/// design along x, y and z, m: twice the values in the team's Table 1.
const MAX_RMSE_M: [f64; 3] = [0.166, 0.116, 0.136];
/// Maximum distance from the word's plane: the team's safety corridor.
const MAX_DRIFT_Y_M: f64 = CORRIDOR_M;
/// Maximum tilt at which the Lighthouse deck can still see its stations.
const MAX_TILT_RAD: f64 = 30.0_f64.to_radians();
/// Maximum fraction of the time during which a motor is saturated.
const MAX_SATURATED_FRAC: f64 = 0.05;

/// Options of a tuning run.
#[derive(Clone, Debug, PartialEq)]
pub struct TuneOptions {
    /// The knobs to tune.
    pub knobs: Vec<Knob>,
    /// Training words, each with the number of seeds for every candidate.
    pub words: Vec<(String, u32)>,
    /// Maximum number of flights in the search and the finals, excluding the test.
    pub budget: usize,
    /// Number of seeds per word in the test, at least six, the fewest that distinguish two scenes.
    pub test_seeds: u32,
    /// Maximum duration of a candidate's flight. `None` stands for that of the original scene.
    pub longest_s: Option<f64>,
    /// Conditions that determine how flights differ from their scene.
    pub conditions: Conditions,
    /// Seed of the search, from which the seeds of all flights are derived.
    pub seed: u64,
}

impl TuneOptions {
    /// Returns the number of flights per candidate in the search.
    fn n_each(&self) -> usize {
        self.words.iter().map(|(_, n)| *n as usize).sum()
    }

    /// Returns the number of flights in the finals.
    fn n_final(&self) -> usize {
        FINALISTS * self.n_each() * FINAL_TIMES as usize
    }

    /// Returns the smallest budget, for the original scene, nine more candidates and the finals.
    pub fn least_budget(&self) -> usize {
        self.n_final() + LEAST_CANDIDATES * self.n_each()
    }

    /// Compares a tuned scene with the original one, on seeds that neither the search nor the
    /// finals used. Returns the study and its ranking.
    pub fn test(
        &self,
        [original, tuned]: [&Scene; 2],
        words: Vec<(String, u32)>,
        store: Option<&Store>,
        stop: &Stop,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<(Study, Ranking)> {
        let scenes = [("as it was", original), (TUNED, tuned)];
        let named = scenes.map(|(name, scene)| NamedScene::new(name, scene.clone()));
        let (contenders, conditions) = (named.into(), self.conditions.clone());
        // `TESTS` makes the seeds differ from those of the search and the finals.
        let study = Study { contenders, words, conditions, seed: self.seed ^ TESTS };
        let trials: Vec<Trial> = study.trials().collect();
        let records = evaluate(&study, &study.prepare()?, &trials, store, stop, done)?;
        let ranking = rank(&study, &records);
        Ok((study, ranking))
    }

    /// Checks that there are knobs, words, and a budget that is large enough for them.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that states the smallest budget for these words and seeds.
    pub fn check(&self) -> Result<()> {
        let (n_each, least, n_knobs) = (self.n_each(), self.least_budget(), self.knobs.len());
        if n_each > 0 && n_knobs > 0 && self.budget >= least {
            return Ok(());
        }
        let (budget, n_final) = (self.budget, n_each * FINAL_TIMES as usize);
        Err(input_error!(
            "budget",
            "{budget} flights and {n_knobs} knobs",
            "at least {least} flights and one parameter: {LEAST_CANDIDATES} candidates with {n_each} \
             flights each, and {FINALISTS} finalists with {n_final} flights each",
            "raise the budget, or train on fewer words and seeds",
        ))
    }
}

/// A point of the search space, and the figures of its flights.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Candidate {
    /// Index of the candidate in the order of the search.
    pub number: usize,
    /// Position of each knob within its range, 0 to 1. Empty for the original scene.
    #[serde(skip)]
    pub point: Vec<f64>,
    /// Values of the scene's keys that the knobs set, in the units of the keys.
    pub settings: BTreeMap<String, toml::Value>,
    /// Number of flights from which the figures were computed.
    pub n_flights: usize,
    /// Mean merit.
    pub merit: f64,
    /// Mean probability that the photo is read correctly.
    pub legibility: f64,
    /// Fraction of flights whose photo is legible.
    pub legible: Estimate,
    /// Mean duration of a flight. `None` if every drone was lost.
    pub duration_s: Option<f64>,
    /// Penalty before its weight: the sum of the excesses over the limits, each as a fraction of
    /// its limit, plus the fraction of flights with a lost drone. 0 if no limit is exceeded.
    pub broken: f64,
    /// True if the candidate was abandoned after half of its flights.
    pub given_up: bool,
}

impl Candidate {
    /// Returns the cost that the search minimizes: [`PENALTY`] times the excess over limits, minus
    /// the merit.
    fn cost(&self) -> f64 {
        PENALTY * self.broken - self.merit
    }
}

/// The result of tuning.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// Scene with the best knobs if they won the test, otherwise the original scene.
    pub scene: Scene,
    /// Test of the finals' winner against the original scene. `None` if the original scene won.
    pub test: Option<(Study, Ranking)>,
    /// Figures of the finals' winner in the finals.
    pub best: Candidate,
    /// Figures of the original scene in the finals.
    pub before: Candidate,
    /// All candidates in the order of the search. The first candidate is the original scene.
    pub candidates: Vec<Candidate>,
    /// Pareto front: numbers of the candidates that exceed no limit and that no other candidate
    /// beats in both flight time and legibility, the fastest first.
    pub front: Vec<usize>,
    /// Total number of flights.
    pub n_flights: usize,
}

impl Tuned {
    /// Returns true if the tuned scene won the test against the original scene.
    pub fn helped(&self) -> bool {
        self.test.as_ref().is_some_and(|(_, ranking)| {
            ranking.measures[0].contender == TUNED && ranking.pairs[0].distinguishable
        })
    }
}

/// Tunes a scene. Calls `watch` after each candidate with the number of flights and the best
/// candidate so far. If `watch` returns false, the search ends and the finals begin. A request
/// through `stop` takes effect between two flights.
///
/// # Errors
///
/// Returns [`Error::Input`] if the scene lacks a knob or a knob has no effect, if there is no word,
/// and if the budget is too small. Returns the errors of the flights and the store.
pub fn tune(
    base: &Scene,
    options: &TuneOptions,
    store: Option<&Store>,
    stop: &Stop,
    watch: &mut dyn FnMut(usize, &Candidate) -> bool,
) -> Result<Tuned> {
    options.check()?;
    if let Some((key, why)) = without_effect(base, &options.knobs).into_iter().next() {
        let (unused, hint) = (format!("{key}, which has no effect: {why}"), "leave it out");
        return Err(Error::input("knob", unused, "a key that has an effect in this scene", hint));
    }
    let longest_s = options.longest_s;
    let mut tuning = Tuning { base, options, store, longest_s, stop, n_flights: 0 };
    // The original scene flies first, because its duration limits that of the other candidates.
    let original = tuning.candidate(0, &[], (options.seed, 1), Some(f64::INFINITY))?;
    tuning.longest_s = longest_s.or(original.duration_s);
    let candidates = tuning.search(original, watch)?;
    let [before, best] = tuning.finals(&candidates)?;
    let (scene, front) = (turned(base, &options.knobs, &best.point)?, front(&candidates));
    // The finals' winner is tested unless it is the original scene.
    let n_seeds = options.test_seeds.max(least_flights(2));
    let words = options.words.iter().map(|(word, _)| (word.clone(), n_seeds)).collect();
    let test = if best.number == before.number {
        None
    } else {
        Some(options.test([base, &scene], words, store, stop, &|_| {})?)
    };
    let n_flights = tuning.n_flights;
    let mut tuned = Tuned { scene, test, best, before, front, n_flights, candidates };
    if !tuned.helped() {
        tuned.scene = base.clone();
    }
    Ok(tuned)
}

/// A search in progress, and its number of flights so far.
struct Tuning<'a> {
    base: &'a Scene,
    options: &'a TuneOptions,
    store: Option<&'a Store>,
    stop: &'a Stop,
    longest_s: Option<f64>,
    n_flights: usize,
}

impl Tuning<'_> {
    /// Flies candidates with the training seeds until the budget only suffices for the finals, or
    /// until `watch` returns false. Returns all candidates, beginning with the original scene.
    fn search(
        &mut self,
        original: Candidate,
        watch: &mut dyn FnMut(usize, &Candidate) -> bool,
    ) -> Result<Vec<Candidate>> {
        let options = self.options;
        let mut search = Search::new(options.knobs.len(), options.seed);
        let (mut candidates, mut best) = (vec![original], 0);
        while self.n_flights + options.n_each() + options.n_final() <= options.budget {
            let point = search.ask();
            // The median rule applies once there are enough costs.
            let mut costs: Vec<f64> =
                candidates.iter().filter(|c| !c.given_up).map(Candidate::cost).collect();
            let max_cost =
                if costs.len() < LEAST_COSTS { f64::INFINITY } else { median(&mut costs) };
            let candidate =
                self.candidate(candidates.len(), &point, (options.seed, 1), Some(max_cost))?;
            search.tell(&point, candidate.cost());
            if !candidate.given_up && candidate.cost() < candidates[best].cost() {
                best = candidates.len();
            }
            candidates.push(candidate);
            if !watch(self.n_flights, &candidates[best]) {
                break;
            }
        }
        Ok(candidates)
    }

    /// Flies a candidate with `times` as many seeds as in training, drawn from `seed`. The
    /// candidate is abandoned if its cost after half of the flights exceeds `max_cost`. Without
    /// `max_cost` it completes all flights.
    fn candidate(
        &mut self,
        number: usize,
        point: &[f64],
        (seed, times): (u64, u32),
        max_cost: Option<f64>,
    ) -> Result<Candidate> {
        let TuneOptions { knobs, words, conditions, .. } = self.options;
        let scene = turned(self.base, knobs, point)?;
        let unflown = Candidate {
            number,
            point: point.to_vec(),
            settings: settings(&scene, knobs)?,
            broken: margin_broken(&scene),
            ..Candidate::default()
        };
        let words = words.iter().map(|(word, n)| (word.clone(), n * times)).collect();
        let contenders = vec![NamedScene::new("candidate", scene)];
        let study = Study { contenders, words, conditions: conditions.clone(), seed };
        study.check()?;
        let prepared = study.prepare()?;
        let trials: Vec<Trial> = study.trials().collect();
        // The first of two parts contains every other flight, so that it includes all words.
        let n_parts = if max_cost.is_some() { 2 } else { 1 };
        let (mut records, mut candidate) = (Vec::new(), unflown.clone());
        for part in 0..n_parts {
            let trials: Vec<Trial> = trials.iter().skip(part).step_by(n_parts).copied().collect();
            records.extend(evaluate(&study, &prepared, &trials, self.store, self.stop, &|_| {})?);
            candidate = self.with_figures(&unflown, &records);
            candidate.given_up = part == 0 && max_cost.is_some_and(|max| candidate.cost() > max);
            if candidate.given_up {
                break;
            }
        }
        self.n_flights += records.len();
        Ok(candidate)
    }

    /// Flies the best candidates and the original scene with new seeds. Returns the original scene
    /// and the winner, in this order.
    fn finals(&mut self, candidates: &[Candidate]) -> Result<[Candidate; 2]> {
        let (original, others) = candidates.split_first().expect("the original scene");
        let mut by_cost: Vec<&Candidate> = others.iter().filter(|c| !c.given_up).collect();
        by_cost.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        by_cost.insert(0, original);
        let flights = (self.options.seed ^ FINALS, FINAL_TIMES);
        by_cost.truncate(FINALISTS);
        let flown = by_cost.iter().map(|c| self.candidate(c.number, &c.point, flights, None));
        let mut finalists = flown.collect::<Result<Vec<_>>>()?;
        // `min_by` returns the first of several equal minima, which may be the original scene.
        let cheapest = finalists.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
        let best = cheapest.expect("the original scene").clone();
        Ok([finalists.swap_remove(0), best])
    }

    /// Returns a candidate with the figures from `records`. In `unflown`, `broken` contains only
    /// those violations of the controller that are known without a flight.
    fn with_figures(&self, unflown: &Candidate, records: &[Record]) -> Candidate {
        let flown: Vec<Flown> = records.iter().filter_map(|record| record.outcome.flown).collect();
        let means = std::array::from_fn(|i| mean(flown.iter().map(|flown| flown.values()[i])));
        let figures = Flown::<f64>::from_values(means);
        // The excesses over the limits and the fraction of flights with a lost drone are summed. If
        // every drone was lost, the figures are 0 and exceed no limit, but that fraction is 1.
        let limits = [
            (figures.rmse_x_m, MAX_RMSE_M[0]),
            (figures.rmse_y_m, MAX_RMSE_M[1]),
            (figures.rmse_z_m, MAX_RMSE_M[2]),
            (figures.drift_y_m, MAX_DRIFT_Y_M),
            (figures.tilt_rad, MAX_TILT_RAD),
            (figures.saturated_frac, MAX_SATURATED_FRAC),
            (figures.duration_s, self.longest_s.unwrap_or(f64::INFINITY)),
        ];
        let lost = mean(records.iter().map(|record| f64::from(record.outcome.lost.is_some())));
        let excess = limits.iter().map(|(figure, limit)| (figure / limit - 1.0).max(0.0));
        Candidate {
            n_flights: records.len(),
            merit: mean(records.iter().map(|record| record.outcome.merit())),
            legibility: mean(records.iter().map(|record| record.outcome.probability)),
            legible: proportion(records.iter().map(|record| record.outcome.legible)),
            duration_s: (!flown.is_empty()).then_some(figures.duration_s),
            broken: excess.fold(lost, |sum, excess| sum + excess) + unflown.broken,
            ..unflown.clone()
        }
    }
}

/// Returns the fraction of a Crazyflie's motor lag that a regulator does not tolerate. Returns 0 if
/// the regulator tolerates the whole lag, or if the controller is not a regulator.
fn margin_broken(scene: &Scene) -> f64 {
    if !matches!(scene.controller.kind.law(), Law::StateFeedback { .. }) {
        return 0.0;
    }
    let longest_s = match design(&scene.sim(), MOTOR_LAG_S) {
        Ok(design) => design.longest_lag_s.unwrap_or(f64::INFINITY),
        Err(_no_gain) => 0.0,
    };
    (1.0 - longest_s / MOTOR_LAG_S).max(0.0)
}

/// Returns the numbers of the candidates on the Pareto front described at [`Tuned::front`].
fn front(candidates: &[Candidate]) -> Vec<usize> {
    let mut allowed: Vec<(f64, &Candidate)> = candidates
        .iter()
        .filter(|c| !c.given_up && c.broken == 0.0)
        .filter_map(|c| Some((c.duration_s?, c)))
        .collect();
    allowed.sort_by(|(a_s, a), (b_s, b)| {
        a_s.total_cmp(b_s).then(b.legibility.total_cmp(&a.legibility))
    });
    // The candidates are visited from fastest to slowest. A candidate joins the front if it is more
    // legible than all faster ones.
    let (mut front, mut best) = (Vec::new(), f64::NEG_INFINITY);
    for (_, candidate) in allowed {
        if candidate.legibility > best {
            best = candidate.legibility;
            front.push(candidate.number);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::Preset;

    fn options(budget: usize) -> TuneOptions {
        TuneOptions {
            knobs: vec!["plan.stroke_speed_m_s=0.2..2.0".parse().unwrap()],
            words: vec![("L".to_owned(), 2)],
            budget,
            test_seeds: 8,
            longest_s: None,
            conditions: Conditions::default(),
            seed: 3,
        }
    }

    fn tuned(scene: &Scene, options: &TuneOptions) -> Result<Tuned> {
        tune(scene, options, None, &Stop::default(), &mut |_, _| true)
    }

    #[test]
    fn tuning_finds_the_speed_that_reads_and_says_what_it_flew() {
        let mut base = Scene::preset(Preset::Ae4832022);
        base.plan.stroke_speed_m_s = 1.5;
        let (mut n_seen, mut options) = (0, options(48 + 40));
        options.longest_s = Some(60.0);
        let tuned = tune(&base, &options, None, &Stop::default(), &mut |n_flights, _| {
            n_seen = n_flights;
            true
        })
        .unwrap();
        assert!(tuned.n_flights <= 88 && n_seen > 20, "{} flights, {n_seen}", tuned.n_flights);
        assert!(tuned.scene.plan.stroke_speed_m_s < 0.6, "{}", tuned.scene.plan.stroke_speed_m_s);
        assert!(tuned.best.merit > tuned.candidates[0].merit + 1.0, "{:?}", tuned.best);
        assert!(tuned.candidates.iter().any(|c| c.given_up), "some were given up");
        assert!(!tuned.front.is_empty());
        assert!(tuned.helped(), "{:?}", tuned.test);
    }

    #[test]
    fn a_candidate_that_is_only_lucky_in_the_finals_leaves_the_scene_as_it_was() {
        // Speeds that differ by 2 % are equally legible, so the finals' winner is not truly better.
        let base = Scene::preset(Preset::Ae4832022);
        let knobs = vec!["plan.stroke_speed_m_s*=0.98..1.0".parse().unwrap()];
        let mut tested = (1..7).map(|seed| {
            tuned(&base, &TuneOptions { knobs: knobs.clone(), seed, ..options(70) }).unwrap()
        });
        let tested = tested.find(|tuned| tuned.test.is_some() && !tuned.helped());
        let tested = tested.expect("a candidate won the finals, and did not help");
        assert!(tested.best.cost() < tested.before.cost());
        assert_eq!(tested.scene, base);
    }

    #[test]
    fn what_a_store_knows_is_not_flown_again_and_comes_to_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let options = TuneOptions { words: vec![("I".to_owned(), 2)], ..options(70) };
        let scene = Scene::preset(Preset::default());
        let [_interrupted, (resumed, known)] = [3, 1000].map(|n| {
            let (store, mut left) = (Store::open(folder.path()).unwrap(), n);
            let tuned = tune(&scene, &options, Some(&store), &Stop::default(), &mut |_, _| {
                left -= 1;
                left > 0
            });
            (tuned.unwrap(), store.n_known())
        });
        assert!(known > 20, "{known} flights were known");
        let alone = tuned(&scene, &options).unwrap();
        assert_eq!(resumed.candidates, alone.candidates);
        assert_eq!(resumed.scene, alone.scene);
    }

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let figures = [
            (0, 60.0, 0.8, 0.0),
            (1, 40.0, 0.7, 0.0),
            (2, 50.0, 0.6, 0.0),
            (3, 30.0, 0.9, 0.5),
            (4, 70.0, 0.8, 0.0),
        ];
        let candidates = figures.map(|(number, duration_s, legibility, broken)| {
            let duration_s = Some(duration_s);
            Candidate { number, legibility, duration_s, broken, ..Candidate::default() }
        });
        assert_eq!(front(&candidates), [1, 0]);
    }

    #[test]
    fn a_knob_without_effect_is_refused() {
        let knobs = vec!["observer.luenberger.q[0]*=0.1..10".parse().unwrap()];
        let options = TuneOptions { knobs, ..options(88) };
        let error = tuned(&Scene::preset(Preset::default()), &options).unwrap_err().to_string();
        assert!(error.contains("observer.luenberger.q[0], which has no effect"), "{error}");
    }

    #[test]
    fn a_budget_without_room_for_a_final_is_refused() {
        let error = tuned(&Scene::preset(Preset::Ae4832022), &options(20)).unwrap_err();
        assert!(error.to_string().contains("at least 68 flights"), "{error}");
    }
}
