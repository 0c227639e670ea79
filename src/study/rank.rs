//! Ranking: contenders in order of legibility, and which of them are indistinguishable.

use serde::Serialize;

use super::statistics::{Estimate, bootstrap, mean, worst_decile};
use super::{Flown, Record, Study};

/// Level of all intervals.
const LEVEL: f64 = 0.95;

/// Contenders in order of their mean probability of being read, the best first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranking {
    /// One a contender.
    pub measures: Vec<Measures>,
    /// Every two of them.
    pub pairs: Vec<Pair>,
}

/// How a contender did over all its flights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measures {
    /// Its name.
    pub contender: String,
    /// 1 for the best; those indistinguishable from a better one share its place.
    pub place: usize,
    /// Flights.
    pub n_flights: usize,
    /// Flights in which the drone was lost.
    pub n_lost: usize,
    /// Mean probability that a strict reader reads the word.
    pub legibility: Estimate,
    /// Mean of its worst tenth.
    pub worst_decile: Estimate,
    /// Share of flights in which every letter was read as it should.
    pub all_read: Estimate,
    /// Mean of the figures of the flights that were not lost; `None` where all were.
    pub flown: Option<Flown<Estimate>>,
    /// Index among the study's contenders.
    #[serde(skip)]
    pub index: usize,
    /// Trials whose photo is the median and the worst, as indices into the records.
    #[serde(skip)]
    pub median_and_worst: [usize; 2],
}

/// Two contenders, flight against flight of the same word and seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// The better one.
    pub better: String,
    /// The other.
    pub worse: String,
    /// Mean difference of probability, with an interval at a level that holds for all pairs
    /// together (Bonferroni).
    pub difference: Estimate,
    /// Whether the interval excludes zero.
    pub distinguishable: bool,
}

/// Ranks the contenders of a study by its records, which are those of all its trials in order.
///
/// # Panics
///
/// If there is not a record for every trial.
#[must_use]
pub fn rank(study: &Study, records: &[Record]) -> Ranking {
    assert_eq!(records.len(), study.n_trials(), "a record for every trial");
    let per_contender = records.len() / study.contenders.len().max(1);
    let of = |contender: usize| &records[contender * per_contender..][..per_contender];
    let probabilities = |contender: usize| strata(study, of(contender), |r| r.outcome.probability);

    let mut measures: Vec<Measures> = (0..study.contenders.len())
        .map(|index| measure(study, index, of(index), index * per_contender))
        .collect();
    measures.sort_by(|a, b| b.legibility.value.total_cmp(&a.legibility.value));

    let n_pairs = measures.len() * measures.len().saturating_sub(1) / 2;
    #[expect(clippy::cast_precision_loss, reason = "few")]
    let level = 1.0 - (1.0 - LEVEL) / n_pairs.max(1) as f64;
    let mut pairs = Vec::with_capacity(n_pairs);
    for (place, better) in measures.iter().enumerate() {
        for worse in &measures[place + 1..] {
            let (a, b) = (probabilities(better.index), probabilities(worse.index));
            let apart: Vec<Vec<f64>> = a
                .iter()
                .zip(&b)
                .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect())
                .collect();
            let difference = bootstrap(&apart, level, |values| mean(values));
            pairs.push(Pair {
                better: better.contender.clone(),
                worse: worse.contender.clone(),
                difference,
                distinguishable: difference.is_not_zero(),
            });
        }
    }
    for index in 0..measures.len() {
        let surely_worse = |better: &Measures| {
            let of_both = |pair: &&Pair| {
                pair.better == better.contender && pair.worse == measures[index].contender
            };
            pairs.iter().find(of_both).is_some_and(|pair| pair.distinguishable)
        };
        measures[index].place =
            1 + measures[..index].iter().filter(|better| surely_worse(better)).count();
    }
    Ranking { measures, pairs }
}

/// The values of one contender's records, word by word.
fn strata<T>(study: &Study, records: &[Record], value: impl Fn(&Record) -> T) -> Vec<Vec<T>> {
    let mut rest = records;
    let words = study.words.iter().map(|(_, n)| {
        let (of_word, others) = rest.split_at(*n as usize);
        rest = others;
        of_word.iter().map(&value).collect()
    });
    words.collect()
}

fn measure(study: &Study, index: usize, records: &[Record], first: usize) -> Measures {
    let probabilities = strata(study, records, |r| r.outcome.probability);
    let read = strata(study, records, |r| f64::from(u8::from(r.outcome.all_read)));
    let mut order: Vec<usize> = (0..records.len()).collect();
    let outcome = |at: usize| &records[at].outcome;
    order.sort_by(|a, b| {
        let legible = outcome(*a).probability.total_cmp(&outcome(*b).probability);
        legible.then(outcome(*a).similarity.total_cmp(&outcome(*b).similarity))
    });
    // A lost drone leaves no photo.
    order.retain(|at| outcome(*at).flown.is_some());
    let photo = |at: usize| order.get(at).map_or(first, |at| first + at);
    Measures {
        contender: study.contenders[index].name.clone(),
        place: 0,
        n_flights: records.len(),
        n_lost: records.iter().filter(|record| record.outcome.lost.is_some()).count(),
        legibility: bootstrap(&probabilities, LEVEL, |values| mean(values)),
        worst_decile: bootstrap(&probabilities, LEVEL, worst_decile),
        all_read: bootstrap(&read, LEVEL, |values| mean(values)),
        flown: flown(study, records),
        index,
        median_and_worst: [photo(order.len() / 2), photo(0)],
    }
}

fn flown(study: &Study, records: &[Record]) -> Option<Flown<Estimate>> {
    records.iter().find(|record| record.outcome.flown.is_some())?;
    let values = strata(study, records, |r| r.outcome.flown.map(|flown| flown.values()));
    let figure = |index: usize| {
        let of_word = |word: &Vec<Option<[f64; 10]>>| {
            word.iter().flatten().map(|values| values[index]).collect()
        };
        bootstrap(&values.iter().map(of_word).collect::<Vec<_>>(), LEVEL, |values| mean(values))
    };
    Some(Flown::from_values(std::array::from_fn(figure)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{NamedScene, Scene};
    use crate::study::{Conditions, Outcome};

    /// A ranking of made-up probabilities: one list a contender, one word.
    fn ranked(probabilities: &[&[f64]]) -> Ranking {
        let names = ["a", "b", "c"];
        let contenders = (0..probabilities.len())
            .map(|index| NamedScene::new(names[index], Scene::default()))
            .collect();
        let n = u32::try_from(probabilities[0].len()).unwrap();
        let words = vec![("I".to_owned(), n)];
        let study = Study { contenders, words, conditions: Conditions::still(), seed: 0 };
        let values = probabilities.iter().flat_map(|list| list.iter());
        let records: Vec<Record> = study
            .trials()
            .zip(values)
            .map(|(trial, &probability)| Record {
                scene: String::new(),
                contender: study.contenders[trial.contender].name.clone(),
                word: "I".into(),
                seed: trial.seed,
                outcome: Outcome::example(probability),
            })
            .collect();
        rank(&study, &records)
    }

    #[test]
    fn a_small_steady_difference_is_distinguishable_and_a_large_random_one_is_not() {
        let steps: Vec<f64> = (0..40).map(|k| 0.3 + 0.01 * f64::from(k)).collect();
        let steadily_better: Vec<f64> = steps.iter().map(|p| p + 0.004).collect();
        let ranking = ranked(&[&steps, &steadily_better]);
        assert_eq!(ranking.measures[0].contender, "b", "paired, 0.004 is enough");
        assert!(ranking.pairs[0].distinguishable, "{:?}", ranking.pairs);
        assert_eq!((ranking.measures[0].place, ranking.measures[1].place), (1, 2));

        let shuffled: Vec<f64> = (0..40).map(|k| 0.306 + 0.01 * f64::from(k * 7 % 40)).collect();
        let ranking = ranked(&[&steps, &shuffled]);
        assert!(ranking.pairs[0].difference.value > 0.005);
        assert!(!ranking.pairs[0].distinguishable, "{:?}", ranking.pairs);
        assert_eq!((ranking.measures[0].place, ranking.measures[1].place), (1, 1));
    }

    #[test]
    fn figures_are_those_of_the_flights() {
        let values: Vec<f64> = (0..20).map(|k| 0.05 * f64::from(k)).collect();
        let ranking = ranked(&[&values]);
        let found = &ranking.measures[0];
        assert!((found.legibility.value - 0.475).abs() < 1e-12);
        assert!((found.worst_decile.value - 0.025).abs() < 1e-12, "mean of 0 and 0.05");
        assert!((found.all_read.value - 0.45).abs() < 1e-12, "nine are above a half");
        assert!(ranking.pairs.is_empty() && found.place == 1);
    }
}
