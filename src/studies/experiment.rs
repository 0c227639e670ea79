//! Study design: which contender flies which word with which seed. [`evaluate`] flies its trials.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::{Conditions, Prepared, Record, Store};
use noctograph_core::digest::{fnv_1a, hmac_sha256};
use noctograph_core::error::{Error, Result};
use noctograph_core::random::PUBLIC_SEEDS;
use noctograph_pipeline::scene::NamedScene;
use noctograph_pipeline::shoot::Stop;

/// Maximum number of flights in a study: about a week of computing time on one core.
pub(super) const MAX_TRIALS: usize = 500_000;

/// Mask that is combined with the search's seed by exclusive-or to give the seed of its finals.
/// [`TESTS`] does the same for the tests.
pub(super) const FINALS: u64 = u64::MAX;
pub(super) const TESTS: u64 = 0x5eed << 48;

/// A study in which every contender flies every word with the same seeds. The order of the trials
/// is fixed, so that any part of them can be flown on any machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// Scenes to compare.
    pub contenders: Vec<NamedScene>,
    /// Words, each with its number of seeds.
    pub words: Vec<(String, u32)>,
    /// Conditions that determine how flights differ from their scene.
    pub conditions: Conditions,
    /// Seed from which the flights' seeds are derived.
    pub seed: u64,
}

/// One flight of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trial {
    /// Index of the contender that flies.
    pub contender: usize,
    /// Index of the word that is flown.
    pub word: usize,
    /// Seed of the flight, which is the same for every contender.
    pub seed: u64,
}

impl Study {
    /// Checks that the number of flights is neither zero nor too large, that names and words are
    /// unique, and that the conditions are valid.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that names the missing or invalid part.
    pub fn check(&self) -> Result<()> {
        let (contenders, n_trials) = (&self.contenders, self.n_trials());
        if n_trials == 0 {
            let counts = format!("{} scenes, {} words", contenders.len(), self.words.len());
            let hint = if contenders.is_empty() {
                "name scenes, or a folder that contains scenes"
            } else {
                "name words, each with its number of seeds: NOOR:50"
            };
            return Err(Error::input("study", counts, "a scene, a word and a seed", hint));
        }
        // Results are listed by contender and stratified by word, so both must be unique.
        let mut names = HashSet::new();
        if let Some(duplicate) = contenders.iter().find(|contender| !names.insert(&contender.name))
        {
            let wanted = "scenes with different names";
            return Err(Error::input("study", &duplicate.name, wanted, "rename the file"));
        }
        let mut words = HashSet::new();
        if let Some((duplicate, _)) = self.words.iter().find(|(word, _)| !words.insert(word)) {
            let hint = "name each word once, with its number of seeds: NOOR:200";
            return Err(Error::input("words", duplicate, "each word once", hint));
        }
        // A store cannot hold more flights.
        if n_trials > MAX_TRIALS {
            let wanted = format!("at most {MAX_TRIALS} flights");
            return Err(Error::input("study", n_trials, wanted, "fewer words or seeds"));
        }
        self.conditions.check()
    }

    /// Returns the total number of flights.
    pub fn n_trials(&self) -> usize {
        let n_each: usize = self.words.iter().map(|(_, n)| *n as usize).sum();
        n_each.saturating_mul(self.contenders.len())
    }

    /// Returns all trials, ordered by contender, then by word, then by seed.
    pub fn trials(&self) -> impl Iterator<Item = Trial> + '_ {
        (0..self.contenders.len()).flat_map(move |contender| {
            self.words.iter().enumerate().flat_map(move |(word, (name, n))| {
                let seeds = (0..*n).map(move |index| self.trial_seed(name, index));
                seeds.map(move |seed| Trial { contender, word, seed })
            })
        })
    }

    /// Returns the seed of flight number `index` of a word. If the study's seed is public, the
    /// result is below 2^31, as in every release. If the seed is secret, the result is a keyed hash
    /// of 63 bits, the most that a scene file can hold, so seeds cannot be found by trial or from
    /// each other.
    fn trial_seed(&self, word: &str, index: u32) -> u64 {
        // The word is part of the hashed bytes, so different words are flown in different gusts.
        let bytes = index.to_le_bytes().into_iter().chain(word.bytes());
        if self.is_secret() {
            let hash = hmac_sha256(&self.seed.to_le_bytes(), bytes);
            let first = u64::from_le_bytes(*hash.first_chunk().expect("32 bytes"));
            return (first >> 1).max(PUBLIC_SEEDS);
        }
        fnv_1a(self.seed.to_le_bytes().into_iter().chain(bytes)) >> 33
    }

    /// Returns true unless the seed is small enough to be typed or guessed, or derived from such a
    /// seed.
    fn is_secret(&self) -> bool {
        let origins = [self.seed, FINALS ^ self.seed, TESTS ^ self.seed];
        origins.iter().all(|seed| *seed >= PUBLIC_SEEDS)
    }

    /// Prepares every contender for every word. The results are ordered by contender, then by word.
    pub fn prepare(&self) -> Result<Vec<Prepared>> {
        let prepared = self.contenders.par_iter().flat_map(|contender| {
            let words = self.words.par_iter();
            words.map(move |(word, _)| Prepared::new(contender, word, &self.conditions))
        });
        prepared.collect()
    }
}

/// Flies trials on rayon's threads. Returns their records, which depend only on the study, in the
/// order of `trials`. `prepared` is the result of [`Study::prepare`].
///
/// Trials in the store are not flown again, and new ones are stored at once. `done` is called with
/// the number of finished trials, from any thread. `stop` takes effect between flights.
///
/// # Errors
///
/// Returns the errors of the flights and the store, and [`Error::Stopped`]. Trials finished before
/// the error remain in the store.
pub fn evaluate(
    study: &Study,
    prepared: &[Prepared],
    trials: &[Trial],
    store: Option<&Store>,
    stop: &Stop,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Record>> {
    let count = counter(done);
    // A record is stored before it is counted, so that no counted flight can be lost.
    let records = trials.par_iter().map(|trial| {
        stop.check()?;
        let scene = &prepared[trial.contender * study.words.len() + trial.word];
        let stored = store.and_then(|store| store.get(scene.digest(), trial.seed));
        let outcome = stored.clone().map_or_else(|| scene.outcome(trial.seed), Ok)?;
        let record = scene.record(&study.contenders[trial.contender].name, trial.seed, outcome);
        if let Some(store) = store.filter(|_| stored.is_none()) {
            store.put(&record)?;
        }
        count();
        Ok(record)
    });
    records.collect()
}

/// Returns a function that passes the number of its calls to `done`, from any thread.
pub(super) fn counter(done: &(dyn Fn(usize) + Sync)) -> impl Fn() + Sync {
    let finished = AtomicUsize::new(0);
    move || done(finished.fetch_add(1, Ordering::Relaxed) + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::{Preset, Scene};

    fn study() -> Study {
        Study {
            contenders: vec![
                NamedScene::new("team", Scene::preset(Preset::Ae4832022)),
                Scene::find("geometric", &[]).unwrap(),
            ],
            words: vec![("I".to_owned(), 2), ("L".to_owned(), 1)],
            conditions: Conditions::default(),
            seed: 0,
        }
    }

    #[test]
    fn contenders_share_their_seeds_and_words_do_not() {
        let study = study();
        let trials: Vec<Trial> = study.trials().collect();
        assert_eq!((trials.len(), study.n_trials()), (6, 6));
        let [mut all, others] = [0, 1].map(|contender| {
            let trials = trials.iter().filter(|trial| trial.contender == contender);
            trials.map(|trial| trial.seed).collect::<Vec<u64>>()
        });
        assert_eq!(all, others);
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 3);
        assert!(all.iter().all(|seed| *seed < 1 << 31));
    }

    #[test]
    fn flights_of_a_secret_seed_cannot_be_counted_through() {
        fn drawn(seed: u64) -> Vec<u64> {
            let words = vec![("I".to_owned(), 200), ("L".to_owned(), 200)];
            let trials = Study { seed, words, ..study() };
            trials.trials().map(|trial| trial.seed).collect()
        }
        for secret in [1 << 47, 211_106_232_532_992, u64::MAX / 3] {
            let seeds = drawn(secret);
            for bit in 0..63 {
                let n_set = seeds.iter().filter(|seed| *seed >> bit & 1 == 1).count();
                // There are 400 seeds, each flown by both scenes. Six standard deviations are 60
                // seeds.
                assert!(n_set.abs_diff(400) < 2 * 60, "bit {bit}: {n_set}");
            }
            assert!(seeds.iter().all(|seed| i64::try_from(*seed).is_ok()), "for a scene file");
            let both: HashSet<u64> = seeds.iter().chain(&drawn(secret + 1)).copied().collect();
            assert_eq!(both.len(), 800, "no two alike, and none of another seed");
        }
        for public in [0, 7, 90210, !7, 7 ^ TESTS] {
            assert!(drawn(public).iter().all(|seed| *seed < 1 << 31), "{public}");
        }
        // These seeds are recorded, because the figures in course.md come from them.
        assert_eq!(drawn(90210)[..2], [153990008, 260383757]);
    }

    #[test]
    fn any_number_of_threads_leaves_the_same_records() {
        let study = study();
        let trials: Vec<Trial> = study.trials().collect();
        let [by_one, by_three] = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (ready, stop) = (study.prepare().unwrap(), Stop::default());
            let records =
                pool.install(|| evaluate(&study, &ready, &trials, None, &stop, &|_| {})).unwrap();
            serde_json::to_string(&records).unwrap()
        });
        assert_eq!(by_one, by_three);
    }

    #[test]
    fn studies_that_compare_nothing_are_refused() {
        type Change = fn(&mut Study);
        let cases: [(Change, &str); 4] = [
            (|s| s.contenders.clear(), "0 scenes"),
            (|s| s.words.push(("I".into(), 5)), "each word once"),
            (|s| s.contenders.push(s.contenders[0].clone()), "team"),
            (|s| s.words[0].1 = u32::MAX, "at most"),
        ];
        for (change, wanted) in cases {
            let mut study = study();
            change(&mut study);
            let error = study.check().unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
        study().check().unwrap();
    }
}
