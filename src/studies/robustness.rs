//! Robustness: which of the things that differ from flight to flight breaks the word first.
//!
//! Each factor by itself, and all together, is made wider step by step, in multiples of the usual
//! ([`Conditions::default`]), while all others stay as the scene has them. A word breaks where half
//! of the photos are no longer legible.

use serde::Serialize;

use super::design::MAX_TRIALS;
use super::statistics::{Estimate, mean_of_probabilities, share};
use super::{Conditions, Factor, Record, Store, Study, Trial, evaluate};
use noctograph_core::error::{Error, Result};
use noctograph_pipeline::scene::NamedScene;
use noctograph_pipeline::shoot::Stop;

/// Share of photos that must be legible.
const HALF: f64 = 0.5;

/// Options of [`robustness`].
#[derive(Clone, Debug, PartialEq)]
pub struct RobustnessOptions {
    /// The scene.
    pub contender: NamedScene,
    /// Words, each with its number of seeds.
    pub words: Vec<(String, u32)>,
    /// The usual width of every factor, which counts as once.
    pub usual: Conditions,
    /// Multiples of it, rising from 0.
    pub times: Vec<f64>,
    /// Seed of all seeds.
    pub seed: u64,
}

/// Endurance of the word under one factor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Endurance {
    /// The factor; `None`: all of them together.
    pub factor: Option<Factor>,
    /// At each multiple.
    pub levels: Vec<Level>,
    /// Multiple of the usual at which half of the photos are legible, between two levels on the
    /// straight line; `None` where more than half are at all levels.
    pub breaks_at: Option<f64>,
    /// The same of the lower and of the upper ends of the levels' 95 % intervals: it lies between.
    pub breaks_between: [Option<f64>; 2],
    /// 1 plus the number of factors that break the word before, as far as the intervals tell.
    pub place: usize,
}

/// Flights at one multiple of the usual.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// The multiple.
    pub times: f64,
    /// Mean probability of being read.
    pub legibility: Estimate,
    /// Share of flights whose photo is legible.
    pub legible: Estimate,
    /// Share of flights in which every letter was read.
    pub all_read: Estimate,
}

impl RobustnessOptions {
    /// Checks the multiples, and the study of them.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for multiples that do not rise, conditions out of range times the largest,
    /// and more flights than a study may have.
    pub fn check(&self) -> Result<()> {
        let rises = self.times.windows(2).all(|pair| pair[0] < pair[1]);
        if self.times.len() < 2 || !rises || self.times.iter().any(|t| !(0.0..=1e3).contains(t)) {
            let wanted = "at least two numbers from 0 to 1000, each above the one before";
            let found = format!("{:?}", self.times);
            return Err(Error::input("times", found, wanted, "for example 0, 1, 2, 4, 8"));
        }
        self.usual.times(self.times[self.times.len() - 1]).check()?;
        if self.n_flights() > MAX_TRIALS {
            let (found, wanted) = (self.n_flights(), format!("at most {MAX_TRIALS}"));
            return Err(Error::input("flights", found, wanted, "name fewer seeds or multiples"));
        }
        self.study(&self.usual).check()
    }

    /// Checks all, and that the scene can write its words, before the first flight.
    ///
    /// # Errors
    ///
    /// Those of [`Self::check`] and [`Study::prepare`].
    pub fn prepare(&self) -> Result<()> {
        self.check()?;
        self.study(&self.usual).prepare()?;
        Ok(())
    }

    /// Flights of all factors and multiples; equal ones are flown once.
    #[must_use]
    pub fn n_flights(&self) -> usize {
        let n_each: usize = self.words.iter().map(|(_, n)| *n as usize).sum();
        n_each * self.times.len() * (Factor::all().len() + 1)
    }

    /// The study of one level.
    fn study(&self, conditions: &Conditions) -> Study {
        Study {
            contenders: vec![self.contender.clone()],
            words: self.words.clone(),
            conditions: conditions.clone(),
            seed: self.seed,
        }
    }
}

/// Tries every factor and all together; the factor that breaks the word first comes first.
/// `done` is called with the number of flights that are done.
///
/// # Errors
///
/// Those of [`RobustnessOptions::check`], the flights and the store.
pub fn robustness(
    options: &RobustnessOptions,
    store: Option<&Store>,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Endurance>> {
    options.check()?;
    let (mut before, mut endurances) = (0, Vec::new());
    // Without disturbance, and where the usual one of a factor is zero, conditions are equal.
    let mut flown: Vec<(Conditions, Level)> = Vec::new();
    for factor in Factor::all().map(Some).chain([None]) {
        let widest = factor.map_or(options.usual.clone(), |factor| options.usual.only(factor));
        let mut levels = Vec::new();
        for &times in &options.times {
            let study = options.study(&widest.times(times));
            let trials: Vec<Trial> = study.trials().collect();
            let equal = flown.iter().find(|(conditions, _)| *conditions == study.conditions);
            let level = match equal {
                Some((_, level)) => Level { times, ..*level },
                None => {
                    let done = |n| done(before + n);
                    let (ready, stop) = (study.prepare()?, Stop::default());
                    level(times, &evaluate(&study, &ready, &trials, store, &stop, &done)?)
                }
            };
            before += trials.len();
            done(before);
            flown.push((study.conditions, level));
            levels.push(level);
        }
        endurances.push(endurance(factor, levels));
    }
    endurances.sort_by(|a, b| {
        let [(a_at, a_last), (b_at, b_last)] = [a, b].map(|endurance: &Endurance| {
            let last = endurance.levels.last().map_or(0.0, |level| level.legible.value);
            (endurance.breaks_at.unwrap_or(f64::INFINITY), last)
        });
        a_at.total_cmp(&b_at).then(a_last.total_cmp(&b_last))
    });
    for index in 0..endurances.len() {
        let earlier = endurances.iter().filter(|other| breaks_before(other, &endurances[index]));
        endurances[index].place = 1 + earlier.count();
    }
    Ok(endurances)
}

fn endurance(factor: Option<Factor>, levels: Vec<Level>) -> Endurance {
    Endurance {
        factor,
        breaks_at: breaks_at(&levels, |share| share.value),
        breaks_between: [|share: &Estimate| share.low, |share: &Estimate| share.high]
            .map(|end| breaks_at(&levels, end)),
        place: 1,
        levels,
    }
}

/// Whether one factor breaks the word before another: their intervals do not overlap.
fn breaks_before(one: &Endurance, other: &Endurance) -> bool {
    let [_, latest] = one.breaks_between;
    let [earliest, _] = other.breaks_between;
    latest.is_some_and(|latest| earliest.is_none_or(|earliest| latest < earliest))
}

fn level(times: f64, records: &[Record]) -> Level {
    let read = records.iter().map(|r| r.outcome.probability).collect();
    Level {
        times,
        legibility: mean_of_probabilities(&[read]),
        legible: share(records.iter().map(|r| r.outcome.legible)),
        all_read: share(records.iter().map(|r| r.outcome.all_read)),
    }
}

/// Where the share of legible photos, or an end of its interval, first falls to a half: 0 where it
/// is there without any disturbance.
fn breaks_at(levels: &[Level], of: fn(&Estimate) -> f64) -> Option<f64> {
    let legible = |level: &Level| of(&level.legible);
    let first = levels.first()?;
    if legible(first) <= HALF {
        return Some(first.times);
    }
    let mut pairs = levels.iter().zip(&levels[1..]);
    let (from, to) = pairs.find(|(_, to)| legible(to) <= HALF)?;
    let share = (legible(from) - HALF) / (legible(from) - legible(to));
    Some(from.times + share * (to.times - from.times))
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::{NamedScene, Preset, Scene};

    #[test]
    fn a_word_breaks_where_half_of_its_photos_are_no_longer_legible() {
        assert_eq!(of(&[20, 18, 10, 2]).breaks_at, Some(2.0));
        assert_eq!(of(&[20, 15, 5, 2]).breaks_at, Some(1.5));
        assert_eq!(of(&[20, 18, 16, 12]).breaks_at, None);
        assert_eq!(of(&[4, 18, 16, 12]).breaks_at, Some(0.0));
    }

    /// Twenty flights at each of four levels, of which so many are legible.
    fn of(n_legible: &[usize]) -> Endurance {
        let estimate = Estimate { value: 0.5, low: 0.4, high: 0.6 };
        let level = |(times, &n)| {
            let legible = share((0..20).map(|flight| flight < n));
            Level { times, legibility: estimate, legible, all_read: estimate }
        };
        endurance(None, [0.0, 1.0, 2.0, 4.0].into_iter().zip(n_legible).map(level).collect())
    }

    #[test]
    fn only_what_breaks_first_beyond_its_interval_comes_first() {
        let (weak, middling, strong) =
            (of(&[20, 6, 0, 0]), of(&[20, 12, 4, 0]), of(&[20, 20, 20, 19]));
        let [early, late] = weak.breaks_between.map(Option::unwrap);
        assert!(early < weak.breaks_at.unwrap() && weak.breaks_at.unwrap() < late, "{weak:?}");
        let is_first = [(&weak, &strong), (&middling, &strong), (&strong, &weak)];
        assert_eq!(is_first.map(|(one, other)| breaks_before(one, other)), [true, true, false]);
        assert!(!breaks_before(&weak, &middling), "{weak:?} and {middling:?} overlap");
        assert_eq!(strong.breaks_between, [None, None]);
    }

    #[test]
    fn gusts_break_an_l_before_late_lamps_do() {
        let options = RobustnessOptions {
            contender: NamedScene::new("team", Scene::preset(Preset::Ae4832022)),
            words: vec![("L".into(), 2)],
            usual: Conditions::default(),
            times: vec![0.0, 10.0],
            seed: 0,
        };
        let found = robustness(&options, None, &|_| {}).unwrap();
        assert_eq!(found.len(), Factor::all().len() + 1, "each, and all together");
        let at = |factor| found.iter().position(|e| e.factor == Some(factor)).unwrap();
        assert!(at(Factor::Gusts) < at(Factor::LedDelay), "{found:?}");
        let scene = found[0].levels[0];
        assert!(found.iter().all(|e| e.levels[0] == scene), "0 times is the scene: {found:?}");
        let wide = RobustnessOptions {
            usual: Conditions { inertia_frac: 0.3, ..options.usual.clone() },
            ..options.clone()
        };
        let counted = std::sync::atomic::AtomicUsize::new(0);
        let count = |n| counted.store(n, std::sync::atomic::Ordering::Relaxed);
        let error = robustness(&wide, None, &count).unwrap_err().to_string();
        assert!(
            error.starts_with("inertia_frac") && counted.into_inner() == 0,
            "before any flight: {error}"
        );
        let evening = Conditions::evening().times(8.0);
        assert!(evening.check().is_ok(), "the command's own multiples of its own conditions");
        let wrong = RobustnessOptions { times: vec![1.0, 1.0], ..options };
        assert!(robustness(&wrong, None, &|_| {}).unwrap_err().to_string().starts_with("times"));
    }
}
