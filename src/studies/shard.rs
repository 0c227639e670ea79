//! Shard: a part of a study's flights, which any process on any machine can fly.
//!
//! The file name of a shard depends only on the study and the part, and the file appears whole or
//! not at all. A shard may therefore be flown twice, or killed and restarted, and the study may be
//! divided differently the next time.

use std::path::{Path, PathBuf};

use super::experiment::evaluate;
use super::{Prepared, Store, Study, Trial};
use noctograph_core::digest::Digest;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::files_in;
use noctograph_pipeline::shoot::Stop;

/// Part number `index` out of `count`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the part, 1 to `count`.
    pub index: usize,
    /// Total number of parts.
    pub count: usize,
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

impl Shard {
    /// Flies every `count`th trial of a study and writes the records to a file in `folder`, unless
    /// the file exists already. Returns the file's path and the number of its flights. Calls `done`
    /// as [`evaluate`] does. Returns the errors of [`evaluate`] and of [`Store::write`].
    pub fn fly(
        self,
        study: &Study,
        folder: &Path,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<(PathBuf, usize)> {
        let prepared = study.prepare()?;
        // Every `count`th trial is taken, so that each part includes all contenders and words.
        let trials: Vec<Trial> = study.trials().skip(self.index - 1).step_by(self.count).collect();
        let name = format!("{}-{}-of-{}.jsonl", digest(study, &prepared), self.index, self.count);
        let path = folder.join(name);
        if !path.exists() {
            std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
            let stop = Stop::default();
            Store::write(&path, &evaluate(study, &prepared, &trials, None, &stop, done)?)?;
        }
        Ok((path, trials.len()))
    }
}

/// Returns the files of a study's shards in a folder, for [`Store::take`], regardless of how the
/// study was divided. `prepared` is the result of [`Study::prepare`].
pub fn shards(study: &Study, prepared: &[Prepared], folder: &Path) -> Result<Vec<PathBuf>> {
    let (mut files, stem) = (files_in(folder)?, digest(study, prepared));
    files.retain(|path| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(&stem)));
    Ok(files)
}

/// Returns a digest of a study's scenes, words, conditions and seeds, and of this build, as 16
/// hexadecimal digits. Parts of a study with different digests cannot be merged.
fn digest(study: &Study, prepared: &[Prepared]) -> String {
    let mut digest = Digest::default();
    prepared.iter().for_each(|scene| digest.add(scene.digest()));
    study.trials().for_each(|trial| digest.add(trial.seed.to_le_bytes()));
    digest.hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Conditions;
    use noctograph_pipeline::scene::{NamedScene, Preset, Scene};

    fn study() -> Study {
        let contenders = vec![NamedScene::new("team", Scene::preset(Preset::Ae4832022))];
        let words = vec![("I".to_owned(), 5)];
        Study { contenders, words, conditions: Conditions::default(), seed: 1 }
    }

    #[test]
    fn a_shard_is_a_part_of_all() {
        assert_eq!("3/20".parse::<Shard>().unwrap(), Shard { index: 3, count: 20 });
        for wrong in ["0/3", "4/3", "1", "x/2", "1/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_of_any_cut_hold_the_flights_of_one_process() {
        let study = study();
        let trials: Vec<Trial> = study.trials().collect();
        let ready = study.prepare().unwrap();
        let stop = Stop::default();
        let alone = evaluate(&study, &ready, &trials, None, &stop, &|_| {}).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let flown = [(1, 3), (2, 2), (3, 3)].map(|(index, count)| {
            Shard { index, count }.fly(&study, folder.path(), &|_| {}).unwrap()
        });
        let n: usize = flown.iter().map(|(_, n)| n).sum();
        assert_eq!(n, 5, "2/2 shares a flight with 1/3, and the last flight is in none");
        let other = Study { seed: 2, ..study.clone() };
        Shard { index: 1, count: 5 }.fly(&other, folder.path(), &|_| {}).unwrap();

        let store = tempfile::tempdir().unwrap();
        let mut store = Store::open(store.path()).unwrap();
        let paths = shards(&study, &ready, folder.path()).unwrap();
        paths.iter().for_each(|path| store.take(path).unwrap());
        let known = alone.iter().filter_map(|record| store.get(&record.scene, record.seed));
        assert_eq!(known.count(), store.n_known(), "of this study only");
        let stored = evaluate(&study, &ready, &trials, Some(&store), &stop, &|_| {}).unwrap();
        assert_eq!(stored, alone);

        let path = &flown[2].0;
        let line = std::fs::read_to_string(path).unwrap();
        std::fs::write(path, line.replacen("\"probability\":0.", "\"probability\":0.1", 1))
            .unwrap();
        let error = store.take(path).unwrap_err().to_string();
        assert!(error.contains("two outcomes of I"), "{error}");
    }
}
