//! Robustness: which of the things that differ from flight to flight breaks the word first.
//!
//! Each factor by itself, and all together, is made wider step by step, in multiples of the usual
//! ([`Conditions::default`]), while all others stay as the scene has them. A word breaks where half of
//! the flights no longer read letter by letter.

use serde::Serialize;

use super::statistics::{Estimate, bootstrap, mean};
use super::{Conditions, Factor, Record, Store, Study, Trial, evaluate};
use crate::error::{Error, Result};
use crate::scene::NamedScene;

/// Share of flights that must read.
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
    /// Multiple of the usual at which half of the flights read, between two levels on the straight
    /// line; `None` where more than half read at all levels.
    pub breaks_at: Option<f64>,
}

/// Flights at one multiple of the usual.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// The multiple.
    pub times: f64,
    /// Mean probability of being read.
    pub legibility: Estimate,
    /// Share of flights in which every letter was read.
    pub all_read: f64,
}

/// Tries every factor and all together; the factor that breaks the word first comes first.
/// `done` is called with the number of flights that are done.
///
/// # Errors
///
/// [`Error::Input`] for multiples that do not rise; those of the flights and the store.
pub fn robustness(
    options: &RobustnessOptions,
    store: Option<&Store>,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Endurance>> {
    let rises = options.times.windows(2).all(|pair| pair[0] < pair[1]);
    if options.times.len() < 2 || !rises || options.times.iter().any(|t| !(0.0..=1e3).contains(t)) {
        let wanted = "at least two numbers from 0 to 1000, each above the one before";
        let hint = "for example 0, 1, 2, 4, 8";
        return Err(Error::input("times", format!("{:?}", options.times), wanted, hint));
    }
    let mut before = 0;
    let mut endurances = Vec::new();
    for factor in Factor::ALL.map(Some).into_iter().chain([None]) {
        let widest = factor.map_or(options.usual.clone(), |factor| options.usual.only(factor));
        let mut levels = Vec::new();
        for &times in &options.times {
            let study = Study {
                contenders: vec![options.contender.clone()],
                words: options.words.clone(),
                conditions: widest.times(times),
                seed: options.seed,
            };
            study.check()?;
            let trials: Vec<Trial> = study.trials().collect();
            let records = evaluate(&study, &trials, store, &|n| done(before + n))?;
            before += trials.len();
            levels.push(level(times, &records));
        }
        endurances.push(Endurance { factor, breaks_at: breaks_at(&levels), levels });
    }
    let order = |e: &Endurance| {
        let last = e.levels.last().map_or(0.0, |level| level.all_read);
        (e.breaks_at.unwrap_or(f64::INFINITY), last)
    };
    endurances.sort_by(|a, b| {
        let ((a_at, a_last), (b_at, b_last)) = (order(a), order(b));
        a_at.total_cmp(&b_at).then(a_last.total_cmp(&b_last))
    });
    Ok(endurances)
}

fn level(times: f64, records: &[Record]) -> Level {
    let read: Vec<f64> = records.iter().map(|r| r.outcome.probability).collect();
    let all: Vec<f64> = records.iter().map(|r| f64::from(u8::from(r.outcome.all_read))).collect();
    Level {
        times,
        legibility: bootstrap(&[read], 0.95, |values| mean(values)),
        all_read: mean(&all),
    }
}

/// Where the share of flights that read first falls below a half.
fn breaks_at(levels: &[Level]) -> Option<f64> {
    if levels.first()?.all_read < HALF {
        return Some(levels[0].times);
    }
    let fall = levels.windows(2).find(|pair| pair[1].all_read < HALF)?;
    let [from, to] = [fall[0], fall[1]];
    let share = (from.all_read - HALF) / (from.all_read - to.all_read);
    Some(from.times + share * (to.times - from.times))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{NamedScene, Scene};

    #[test]
    fn a_word_breaks_where_half_of_its_flights_no_longer_read() {
        let levels = |shares: &[f64]| -> Vec<Level> {
            let estimate = Estimate { value: 0.5, low: 0.4, high: 0.6 };
            let level = |(times, &all_read)| Level { times, legibility: estimate, all_read };
            [0.0, 1.0, 2.0, 4.0].into_iter().zip(shares).map(level).collect()
        };
        assert_eq!(breaks_at(&levels(&[1.0, 0.9, 0.5, 0.1])), Some(2.0));
        assert_eq!(breaks_at(&levels(&[1.0, 0.75, 0.25, 0.1])), Some(1.5));
        assert_eq!(breaks_at(&levels(&[1.0, 0.9, 0.8, 0.6])), None);
        assert_eq!(breaks_at(&levels(&[0.2, 0.9, 0.8, 0.6])), Some(0.0));
    }

    #[test]
    fn gusts_break_an_l_before_late_lamps_do() {
        let options = RobustnessOptions {
            contender: NamedScene::new("team", Scene::default()),
            words: vec![("L".into(), 2)],
            usual: Conditions::default(),
            times: vec![0.0, 10.0],
            seed: 0,
        };
        let found = robustness(&options, None, &|_| {}).unwrap();
        assert_eq!(found.len(), 7);
        let at = |factor| found.iter().position(|e| e.factor == Some(factor)).unwrap();
        assert!(at(Factor::Gusts) < at(Factor::LedDelay), "{found:?}");
        let scene = found[0].levels[0];
        assert!(found.iter().all(|e| e.levels[0] == scene), "0 times is the scene: {found:?}");
        let wrong = RobustnessOptions { times: vec![1.0, 1.0], ..options };
        assert!(robustness(&wrong, None, &|_| {}).unwrap_err().to_string().starts_with("times"));
    }
}
