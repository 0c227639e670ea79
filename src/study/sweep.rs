//! Sweep: a study flown in shards, by any number of processes and machines, in any order.
//!
//! A shard is a range of the study's trials. Its file is a function of the plan and the range
//! alone and appears whole or not at all, so a shard may be run twice, be killed and run again, or
//! be cut otherwise the next time: the merged flights are the same bytes.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Prepared, Record, Store, Study, Trial, evaluate};
use crate::error::{Error, Result};
use crate::files::{Limit, files_in};
use crate::shoot::Stop;

/// Largest plan file that is read.
const LIMIT: Limit = Limit { bytes: 20 << 20, what: "a sweep's plan", hint: REPLAN };
/// Most times that shards may hold a flight, on the mean: some lie within others.
const MAX_TIMES: usize = 4;

const REPLAN: &str = "plan the sweep again";

/// A study on paper, for workers that know nothing else.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Version of the program that it is for.
    pub noctograph: String,
    /// SHA-256 of the study: two plans of one study are equal.
    pub sha256: String,
    /// Flights in all.
    pub flights: usize,
    /// The study.
    pub study: Study,
}

/// Part `index` of `count`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, 1 to `count`.
    pub index: usize,
    /// Of how many.
    pub count: usize,
}

impl Shard {
    /// The trials of this part, of `n` in all.
    fn range(self, n: usize) -> std::ops::Range<usize> {
        let cut = |index: usize| {
            usize::try_from(index as u128 * n as u128 / self.count as u128).expect("at most n")
        };
        cut(self.index - 1)..cut(self.index)
    }
}

impl std::str::FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts =
            text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err(Error::input("shard", text, "I/N with I from 1 to N", "such as 3/20")),
        }
    }
}

impl Sweep {
    /// Plans a study.
    ///
    /// # Errors
    ///
    /// As [`Study::check`] and [`Study::prepare`].
    pub fn new(study: Study) -> Result<Self> {
        study.check()?;
        study.prepare()?;
        let flights = study.n_trials();
        let noctograph = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Self { noctograph, sha256: sha256(&study), flights, study })
    }

    /// Reads a plan file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Input`] where it is no plan, is of another version, or was changed by
    /// hand.
    pub fn read(path: &Path) -> Result<Self> {
        let (place, hint) = (path.display().to_string(), REPLAN);
        let text = LIMIT.read(path)?;
        let sweep: Self = serde_json::from_slice(&text)
            .map_err(|error| Error::input(&place, error.to_string(), "a sweep's plan", hint))?;
        if sweep.noctograph != env!("CARGO_PKG_VERSION") {
            let found = format!("a plan for noctograph {}", sweep.noctograph);
            return Err(Error::input(place, found, env!("CARGO_PKG_VERSION"), hint));
        }
        if sweep.sha256 != sha256(&sweep.study) || sweep.flights != sweep.study.n_trials() {
            let found = "a study that is not the one it was made for";
            return Err(Error::input(place, found, "the plan as it was written", hint));
        }
        sweep.study.check()?;
        Ok(sweep)
    }

    /// The plan as a file's text.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a plan is plain data") + "\n"
    }

    /// Flies a shard into a folder, unless it lies there already. Returns its file, and whether it was
    /// flown now.
    ///
    /// # Errors
    ///
    /// Those of the flights, and [`Error::Io`]; then nothing is left.
    pub fn run(
        &self,
        shard: Shard,
        folder: &Path,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<(PathBuf, bool)> {
        std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
        let range = shard.range(self.flights);
        let path = folder.join(format!("part-{:08}-{:08}.jsonl", range.start, range.end));
        let trials: Vec<Trial> = self.study.trials().skip(range.start).take(range.len()).collect();
        if path.exists() {
            let prepared = self.study.prepare()?;
            let there = Store::read(&path)?;
            let expected = trials.iter().map(|trial| (self.scene(*trial, &prepared), trial.seed));
            if there.iter().map(|record| (&*record.scene, record.seed)).eq(expected) {
                return Ok((path, false));
            }
            let hint = "name another folder: flights are never overwritten";
            let place = path.display().to_string();
            return Err(Error::input(place, "flights of another plan", "those of this plan", hint));
        }
        let records = evaluate(&self.study, &trials, None, &Stop::default(), done)?;
        Store::write(&path, &records)?;
        Ok((path, true))
    }

    /// Gathers the shards of a folder, however they were cut: the records of all trials, in order.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] where flights are missing or two shards disagree; as [`Store::read`].
    pub fn merge(&self, folder: &Path) -> Result<Vec<Record>> {
        let prepared = self.study.prepare()?;
        let trials = self.study.trials().enumerate();
        let places: HashMap<(&str, u64), usize> =
            trials.map(|(n, trial)| ((self.scene(trial, &prepared), trial.seed), n)).collect();
        let mut records: Vec<Option<Record>> = vec![None; self.flights];
        let mut left = MAX_TIMES * self.flights.max(1);
        for path in parts(folder)? {
            Store::each(&path, |record| {
                left = left.checked_sub(1).ok_or_else(|| {
                    let found = format!("more than {MAX_TIMES} flights for each of the plan's");
                    let hint = "take out the shards that lie in others";
                    Error::input(folder.display().to_string(), found, "its shards", hint)
                })?;
                let Some(place) = places.get(&(&*record.scene, record.seed)) else {
                    return Ok(());
                };
                match &mut records[*place] {
                    Some(known) if *known != record => Err(Error::Infeasible {
                        what: format!(
                            "{}: {} with seed {} came out otherwise than in another shard",
                            path.display(),
                            record.word,
                            record.seed
                        ),
                        hint: "fly all shards with the same build of noctograph".into(),
                    }),
                    Some(_) => Ok(()),
                    empty => {
                        *empty = Some(record);
                        Ok(())
                    }
                }
            })?;
        }
        // Two trials of one scene and seed are one flight.
        for (n, trial) in self.study.trials().enumerate() {
            let place = places[&(self.scene(trial, &prepared), trial.seed)];
            if place != n {
                records[n] = records[place].clone();
            }
        }
        let missing: Vec<usize> = (0..records.len()).filter(|n| records[*n].is_none()).collect();
        if let (Some(first), Some(last)) = (missing.first(), missing.last()) {
            let n = missing.len();
            return Err(Error::Infeasible {
                what: format!(
                    "{}: {n} of {} flights are missing, between number {first} and {last}",
                    folder.display(),
                    self.flights
                ),
                hint: "run the shards that are missing; those that are there are not flown again"
                    .into(),
            });
        }
        Ok(records.into_iter().flatten().collect())
    }

    /// The digest of a trial's scene.
    fn scene<'a>(&self, trial: Trial, prepared: &'a [Prepared]) -> &'a str {
        prepared[trial.contender * self.study.words.len() + trial.word].digest()
    }
}

/// Files of shards in a folder, in order of their names.
fn parts(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = files_in(folder)?;
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_part = |name: String| name.starts_with("part-") && name.ends_with(".jsonl");
    paths.retain(|path| is_part(name(path)));
    Ok(paths)
}

fn sha256(study: &Study) -> String {
    let json = serde_json::to_vec(study).expect("a study is plain data");
    crate::digest::sha256(&json)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{NamedScene, Preset, Scene};
    use crate::study::Conditions;

    fn sweep() -> Sweep {
        let contenders = vec![NamedScene::new("team", Scene::preset(Preset::Ae4832022))];
        let words = vec![("I".to_owned(), 5)];
        let conditions = Conditions::default();
        Sweep::new(Study { contenders, words, conditions, seed: 1 }).unwrap()
    }

    #[test]
    fn shards_cover_every_flight_once() {
        for (n, count) in [(5, 3), (7, 7), (3, 5), (2400, 1), (0, 2)] {
            let ranges: Vec<_> = (1..=count).map(|index| Shard { index, count }.range(n)).collect();
            assert_eq!((ranges[0].start, ranges[count - 1].end), (0, n));
            assert!(ranges.windows(2).all(|pair| pair[0].end == pair[1].start), "{ranges:?}");
        }
        for wrong in ["0/3", "4/3", "1", "x/2", "1/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn any_cut_and_order_merges_to_the_same_flights() {
        let sweep = sweep();
        let merged = |cuts: &[(usize, usize)]| {
            let folder = tempfile::tempdir().unwrap();
            for &(index, count) in cuts {
                let (_, flown) = sweep.run(Shard { index, count }, folder.path(), &|_| {}).unwrap();
                assert!(flown, "{index}/{count} once");
            }
            let (index, count) = cuts[0];
            let again = sweep.run(Shard { index, count }, folder.path(), &|_| {}).unwrap();
            assert!(!again.1, "existing shards are not flown again");
            serde_json::to_string(&sweep.merge(folder.path()).unwrap()).unwrap()
        };
        let whole = merged(&[(1, 1)]);
        assert_eq!(merged(&[(3, 3), (1, 3), (2, 3)]), whole);
        assert_eq!(merged(&[(2, 2), (1, 3), (2, 3)]), whole, "cuts that overlap");
    }

    #[test]
    fn what_is_missing_changed_or_from_another_plan_is_named() {
        let sweep = sweep();
        let folder = tempfile::tempdir().unwrap();
        sweep.run(Shard { index: 2, count: 5 }, folder.path(), &|_| {}).unwrap();
        let error = sweep.merge(folder.path()).unwrap_err().to_string();
        assert!(error.contains("4 of 5 flights are missing, between number 0 and 4"), "{error}");

        let path = folder.path().join("part-00000001-00000002.jsonl");
        let line = std::fs::read_to_string(&path).unwrap();
        let other = line.replacen("\"probability\":0.", "\"probability\":0.1", 1);
        std::fs::write(folder.path().join("part-00000001-00000003.jsonl"), other).unwrap();
        let error = sweep.merge(folder.path()).unwrap_err().to_string();
        assert!(error.contains("came out otherwise"), "{error}");

        let plan = folder.path().join("sweep.json");
        std::fs::write(&plan, sweep.to_json()).unwrap();
        assert_eq!(Sweep::read(&plan).unwrap(), sweep);
        let changed = sweep.to_json().replace("\"gust_m_s\": 0.08", "\"gust_m_s\": 0.09");
        std::fs::write(&plan, changed).unwrap();
        assert!(
            Sweep::read(&plan).unwrap_err().to_string().contains("not the one it was made for")
        );
        let version = format!("\"noctograph\": \"{}\"", env!("CARGO_PKG_VERSION"));
        std::fs::write(&plan, sweep.to_json().replace(&version, "\"noctograph\": \"7\"")).unwrap();
        assert!(Sweep::read(&plan).unwrap_err().to_string().contains("noctograph 7"));
    }
}
