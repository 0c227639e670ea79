//! Tuning: a scene's knobs are turned until its words read as surely as they can.
//!
//! 1. Search: a candidate flies the training words with the training seeds. The objective is its
//!    mean merit ([`Outcome::merit`](super::Outcome::merit)), less a penalty for broken limits.
//!    Half of its flights come first, and a candidate below the median of the others is then given
//!    up (median rule: Golovin et al., "Google Vizier", KDD 2017).
//! 2. Finals: the best few and the scene as it was fly again with fresh seeds, since the luckiest
//!    of many is not the best.
//! 3. Test: the winner, the luckiest of a few, meets the scene as it was on further seeds. It is
//!    the result only if it is distinguishably better.

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

/// Candidates that fly again at the end.
const FINALISTS: usize = 6;
/// Flights of a finalist, as a multiple of the training flights.
const FINAL_TIMES: u32 = 4;
/// Name of a tuned scene in its test.
const TUNED: &str = "tuned";
/// Least candidates of a search.
const LEAST_CANDIDATES: usize = 10;
/// Penalty for exceeding a limit by its own size, in merit.
const PENALTY: f64 = 20.0;

/// Limits of a candidate, for the mean of its flights. Error against the design along x, y, z, root
/// mean square: twice the team's Table 1.
const MAX_RMSE_M: [f64; 3] = [0.166, 0.116, 0.136];
/// Farthest from the word's plane: the team's corridor, for visitors.
const MAX_DRIFT_Y_M: f64 = CORRIDOR_M;
/// Largest tilt: the Lighthouse deck still sees its stations.
const MAX_TILT_RAD: f64 = 30.0_f64.to_radians();
/// Fraction of the time with a motor at its limit.
const MAX_SATURATED_FRAC: f64 = 0.05;

/// How to tune.
#[derive(Clone, Debug, PartialEq)]
pub struct TuneOptions {
    /// The knobs.
    pub knobs: Vec<Knob>,
    /// Words that are trained on, each with its number of seeds for a candidate.
    pub words: Vec<(String, u32)>,
    /// Flights of search and finals. Those of the test come on top.
    pub budget: usize,
    /// Seeds of each word in the test: at least six, which can tell two apart.
    pub test_seeds: u32,
    /// Longest flight of a candidate. `None`: as long as the flight of the scene as it was.
    pub longest_s: Option<f64>,
    /// How flights differ from their scene.
    pub conditions: Conditions,
    /// Seed of the search and of all seeds.
    pub seed: u64,
}

impl TuneOptions {
    /// Flights of a candidate.
    fn n_each(&self) -> usize {
        self.words.iter().map(|(_, n)| *n as usize).sum()
    }

    /// Flights of the finals.
    fn finals(&self) -> usize {
        FINALISTS * self.n_each() * FINAL_TIMES as usize
    }

    /// Least budget: the scene as it was and nine more candidates, and the finals.
    pub fn least_budget(&self) -> usize {
        self.finals() + LEAST_CANDIDATES * self.n_each()
    }

    /// Ranks a scene (`tuned`) and the one that it was made of, on seeds that neither the search
    /// nor the finals had.
    pub fn test(
        &self,
        [start, tuned]: [&Scene; 2],
        words: Vec<(String, u32)>,
        store: Option<&Store>,
        stop: &Stop,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<(Study, Ranking)> {
        // Further seeds, which neither search nor finals had a chance to fit.
        let contenders = [("as it was", start), (TUNED, tuned)];
        let contenders = contenders.map(|(name, scene)| NamedScene::new(name, scene.clone()));
        let (contenders, conditions) = (contenders.into(), self.conditions.clone());
        let study = Study { contenders, words, conditions, seed: self.seed ^ TESTS };
        let trials: Vec<Trial> = study.trials().collect();
        let records = evaluate(&study, &study.prepare()?, &trials, store, stop, done)?;
        let ranking = rank(&study, &records);
        Ok((study, ranking))
    }

    /// Checks that there are knobs, words and a budget for them.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the least budget for these words and seeds.
    pub fn check(&self) -> Result<()> {
        let (n_each, least, n_knobs) = (self.n_each(), self.least_budget(), self.knobs.len());
        if n_each > 0 && n_knobs > 0 && self.budget >= least {
            return Ok(());
        }
        let (budget, n_final) = (self.budget, n_each * FINAL_TIMES as usize);
        Err(input_error!(
            "budget",
            "{budget} flights, {n_knobs} knobs",
            "at least {least} flights and a knob: {LEAST_CANDIDATES} candidates of {n_each} flights, \
             and {FINALISTS} finalists of {n_final}",
            "raise the budget, or train on fewer words and seeds",
        ))
    }
}

/// One setting of the knobs with its figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Candidate {
    /// Its number, in the order of asking.
    pub number: usize,
    /// Setting of each knob, 0 to 1. Empty for the scene as it was.
    #[serde(skip)]
    pub point: Vec<f64>,
    /// The scene's values of the keys that the knobs turn, in their own units.
    pub settings: BTreeMap<String, toml::Value>,
    /// Flights that it was judged by.
    pub n_flights: usize,
    /// Mean merit.
    pub merit: f64,
    /// Mean probability of being read.
    pub legibility: f64,
    /// Fraction of flights whose photo is legible.
    pub legible: Estimate,
    /// Mean time of a flight. `None` if every drone was lost.
    pub duration_s: Option<f64>,
    /// Excess over its limits, in limits: 0 keeps to all of them.
    pub broken: f64,
    /// Given up after half of its flights.
    pub given_up: bool,
}

impl Candidate {
    fn cost(&self) -> f64 {
        PENALTY * self.broken - self.merit
    }
}

/// The result of tuning.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// The scene with the best knobs if they won the test, else the scene as it was.
    pub scene: Scene,
    /// The winner of the finals against the scene as it was, on new seeds. `None` if that won.
    pub test: Option<(Study, Ranking)>,
    /// Figures of the winner in the finals.
    pub best: Candidate,
    /// Figures of the scene as it was in the same finals.
    pub before: Candidate,
    /// Every candidate in the order of asking. The first is the scene as it was.
    pub candidates: Vec<Candidate>,
    /// Numbers of the candidates within the limits that no other beats in both flight time and
    /// legibility, the fastest first.
    pub front: Vec<usize>,
    /// Flights in all.
    pub n_flights: usize,
}

impl Tuned {
    /// True if a candidate won the test against the scene as it was.
    pub fn helped(&self) -> bool {
        self.test.as_ref().is_some_and(|(_, ranking)| {
            ranking.measures[0].contender == TUNED && ranking.pairs[0].distinguishable
        })
    }
}

/// Tunes a scene. After each candidate `watch` gets the number of flights and the best candidate so
/// far, and returns false to go on to the finals. `stop` ends it between two flights.
///
/// # Errors
///
/// [`Error::Input`] for knobs that the scene lacks or that have no effect in it, for no word and
/// for too small a budget. Those of the flights and the store.
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
        return Err(Error::input("knob", unused, "a key that has one in this scene", hint));
    }
    let (n_each, finals, training) = (options.n_each(), options.finals(), (options.seed, 1));
    let mut tuning =
        Tuning { base, options, store, longest_s: options.longest_s, stop, n_flights: 0 };
    // The scene as it was comes first: its duration is the limit of the others.
    let as_it_was = tuning.candidate(0, &[], training, Some(f64::INFINITY))?;
    tuning.longest_s = tuning.longest_s.or(as_it_was.duration_s);
    let mut search = Search::new(options.knobs.len(), options.seed);
    let (mut candidates, mut best) = (vec![as_it_was], 0);
    while tuning.n_flights + n_each + finals <= options.budget {
        let point = search.ask();
        // Median rule, once there is a median to speak of.
        let mut costs: Vec<f64> =
            candidates.iter().filter(|c| !c.given_up).map(Candidate::cost).collect();
        let bar = if costs.len() < 5 { f64::INFINITY } else { median(&mut costs) };
        let candidate = tuning.candidate(candidates.len(), &point, training, Some(bar))?;
        search.tell(&point, candidate.cost());
        if !candidate.given_up && candidate.cost() < candidates[best].cost() {
            best = candidates.len();
        }
        candidates.push(candidate);
        if !watch(tuning.n_flights, &candidates[best]) {
            break;
        }
    }
    let [before, best] = tuning.finals(&candidates)?;
    let (scene, front) = (turned(base, &options.knobs, &best.point)?, front(&candidates));
    // The winner of the finals is tested unless it is the scene as it was.
    let n_seeds = options.test_seeds.max(least_flights(2));
    let words = options.words.iter().map(|(word, _)| (word.clone(), n_seeds)).collect();
    let test = match best.number == before.number {
        true => None,
        false => Some(options.test([base, &scene], words, store, stop, &|_| {})?),
    };
    let n_flights = tuning.n_flights;
    let mut tuned = Tuned { scene, test, best, before, front, n_flights, candidates };
    if !tuned.helped() {
        tuned.scene = base.clone();
    }
    Ok(tuned)
}

/// A search and its flights so far.
struct Tuning<'a> {
    base: &'a Scene,
    options: &'a TuneOptions,
    store: Option<&'a Store>,
    stop: &'a Stop,
    longest_s: Option<f64>,
    n_flights: usize,
}

impl Tuning<'_> {
    /// Flies a candidate, `times` as often as in training, with seeds drawn from `seed`. With a
    /// bar, half of its flights come first, and the candidate is given up if they cost more.
    fn candidate(
        &mut self,
        number: usize,
        point: &[f64],
        (seed, times): (u64, u32),
        bar: Option<f64>,
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
        // With a bar every other flight first, so that half of each word's are among them.
        let n_parts = if bar.is_some() { 2 } else { 1 };
        let (mut records, mut candidate) = (Vec::new(), unflown.clone());
        for part in 0..n_parts {
            let trials: Vec<Trial> = trials.iter().skip(part).step_by(n_parts).copied().collect();
            records.extend(evaluate(&study, &prepared, &trials, self.store, self.stop, &|_| {})?);
            candidate = self.judged(&unflown, &records);
            candidate.given_up = part == 0 && bar.is_some_and(|bar| candidate.cost() > bar);
            if candidate.given_up {
                break;
            }
        }
        self.n_flights += records.len();
        Ok(candidate)
    }

    /// The scene as it was and the best of all candidates, by more flights with fresh seeds.
    fn finals(&mut self, candidates: &[Candidate]) -> Result<[Candidate; 2]> {
        let (as_it_was, others) = candidates.split_first().expect("the scene as it was is one");
        let mut by_cost: Vec<&Candidate> = others.iter().filter(|c| !c.given_up).collect();
        by_cost.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        by_cost.insert(0, as_it_was);
        let flights = (self.options.seed ^ FINALS, FINAL_TIMES);
        let finalists = by_cost.iter().take(FINALISTS);
        let finalists = finalists.map(|c| self.candidate(c.number, &c.point, flights, None));
        let mut finalists = finalists.collect::<Result<Vec<_>>>()?;
        // The first of equal ones: the scene as it was.
        let best = finalists.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
        let best = best.expect("the scene as it was is one").clone();
        Ok([finalists.swap_remove(0), best])
    }

    /// A candidate with the figures of its flights.
    fn judged(&self, candidate: &Candidate, records: &[Record]) -> Candidate {
        let flown: Vec<Flown> = records.iter().filter_map(|record| record.outcome.flown).collect();
        let means = std::array::from_fn(|i| mean(flown.iter().map(|flown| flown.values()[i])));
        let figures = Flown::<f64>::from_values(means);
        // Excess over each limit adds up, as does the fraction of lost drones.
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
            broken: excess.fold(lost, |sum, excess| sum + excess) + candidate.broken,
            ..candidate.clone()
        }
    }
}

/// Fraction of a Crazyflie's motor lag that the design of a regulator does not tolerate. 0 is good.
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

/// Candidates that keep to the limits and that no other beats in both time and legibility.
fn front(candidates: &[Candidate]) -> Vec<usize> {
    let mut kept: Vec<(f64, &Candidate)> = candidates
        .iter()
        .filter(|c| !c.given_up && c.broken == 0.0)
        .filter_map(|c| Some((c.duration_s?, c)))
        .collect();
    kept.sort_by(|(a_s, a), (b_s, b)| {
        a_s.total_cmp(b_s).then(b.legibility.total_cmp(&a.legibility))
    });
    // The fastest first: one that reads no better than a faster one is beaten.
    let (mut front, mut most) = (Vec::new(), f64::NEG_INFINITY);
    for (_, candidate) in kept {
        if candidate.legibility > most {
            most = candidate.legibility;
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
        // Speeds that differ by 2 % read alike: whichever wins the finals is no better.
        let base = Scene::preset(Preset::Ae4832022);
        let knobs = vec!["plan.stroke_speed_m_s*=0.98..1.0".parse().unwrap()];
        let mut tested = (0..6).map(|seed| {
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
        let [_interrupted, (resumed, known)] = [3, 1000].map(|n| {
            let store = Store::open(folder.path()).unwrap();
            let (scene, stop, mut left) = (Scene::preset(Preset::Ae4832022), Stop::default(), n);
            let tuned = tune(&scene, &options(70), Some(&store), &stop, &mut |_, _| {
                left -= 1;
                left > 0
            });
            (tuned.unwrap(), store.n_known())
        });
        assert!(known > 20, "{known} flights were known");
        let alone = tuned(&Scene::preset(Preset::Ae4832022), &options(70)).unwrap();
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
