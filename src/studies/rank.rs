//! Ranking: orders contenders by legibility, and determines which of them are distinguishable.

use serde::Serialize;

use super::statistics::{
    Estimate, LEVEL, center, least_for_center, mean, mean_of_probabilities, mean_of_strata,
    proportion, worst_decile,
};
use super::{Acuity, Flown, Record, Study};

/// Contenders ordered by their mean probability of being read, with the best first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranking {
    /// Measures of each ranked contender.
    pub measures: Vec<Measures>,
    /// Comparisons of all pairs of contenders.
    pub pairs: Vec<Pair>,
    /// Minimum number of flights per contender for two contenders to be distinguishable.
    pub least_flights: u32,
    /// Contenders that are not ranked.
    pub unranked: Vec<Unranked>,
    /// Smallest letters of the contenders, if they were measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acuity: Option<Acuity>,
}

/// A contender that is not ranked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unranked {
    /// Name of the contender.
    pub contender: String,
    /// Reason: `refused: ...` before the flights, or `failed: ...` during a flight.
    pub note: String,
}

/// Results of a contender over all its flights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measures {
    /// Name of the contender.
    pub contender: String,
    /// Rank, 1 for the best. Contenders that cannot be distinguished from the first contender of a
    /// rank have the same rank. `None` if no flight was read, for example because every drone was
    /// lost.
    pub place: Option<usize>,
    /// Number of flights.
    pub n_flights: usize,
    /// Number of flights in which a drone was lost.
    pub n_lost: usize,
    /// Mean probability that a viewer reads the word, and no other word, at first sight
    /// ([`Verdict::read_probability`](noctograph_score::Verdict::read_probability)).
    pub legibility: Estimate,
    /// Fraction of flights with a legible photo.
    pub legible: Estimate,
    /// Mean probability of being read in the worst tenth of the flights.
    pub worst_decile: Estimate,
    /// Fraction of flights in which every letter was read as intended.
    pub all_read: Estimate,
    /// Mean figures of the flights that were not lost. `None` if every flight was lost.
    pub flown: Option<Flown<Estimate>>,
    /// Name of an earlier contender whose flights are exactly the same.
    pub equal_to: Option<String>,
    /// Indices of the records with the median and the worst photo.
    #[serde(skip)]
    pub median_and_worst: [usize; 2],
}

/// Comparison of two contenders, paired by word and seed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// Name of the contender with the higher mean probability.
    pub better: String,
    /// Name of the other contender.
    pub worse: String,
    /// Mean difference in the probability of being read. The level of the interval applies to all
    /// pairs jointly (Bonferroni). With too few flights the interval is from -1 to 1.
    pub difference: Estimate,
    /// True if the two contenders differ at a level that applies to all pairs jointly (Holm,
    /// Scandinavian Journal of Statistics 6, 1979).
    pub distinguishable: bool,
}

/// Minimum probability of being read for a rank. Smaller values are printed as 0.000.
const LEAST_READ: f64 = 0.0005;

/// Ranks the contenders of a study. `records` contains one record per trial, in the order of the
/// trials. Panics if the numbers differ.
pub fn rank(study: &Study, records: &[Record]) -> Ranking {
    assert_eq!(records.len(), study.n_trials(), "a record for every trial");
    let n_each = (records.len() / study.contenders.len().max(1)).max(1);
    let by_contender: Vec<&[Record]> = records.chunks(n_each).collect();
    let mut ranked: Vec<(Measures, Vec<f64>)> = Vec::new();
    for (index, records) in by_contender.iter().enumerate() {
        let mut measures = measure(study, records, index * n_each);
        if measures.flown.is_some() {
            let equal = by_contender[..index].iter().find(|earlier| flew_alike(earlier, records));
            measures.equal_to = equal.map(|earlier| earlier[0].contender.clone());
        }
        let probabilities = records.iter().map(|record| record.outcome.probability);
        ranked.push((measures, probabilities.collect()));
    }
    ranked.sort_by(|(a, _), (b, _)| b.legibility.value.total_cmp(&a.legibility.value));
    let named: Vec<_> = ranked.iter().map(|(m, values)| (&*m.contender, &values[..])).collect();
    let pairs = pairs(&named);
    let mut measures: Vec<Measures> = ranked.into_iter().map(|(measures, _)| measures).collect();
    // A new rank begins with the first contender that differs from the one that began the last
    // rank.
    let mut first_of_place = 0;
    for index in 0..measures.len() {
        let [first, next] = [first_of_place, index].map(|index| &measures[index].contender);
        let mut distinguishable = pairs.iter().filter(|pair| pair.distinguishable);
        if distinguishable.any(|pair| (&pair.better, &pair.worse) == (first, next)) {
            first_of_place = index;
        }
        let is_read = measures[index].legibility.value >= LEAST_READ;
        measures[index].place = is_read.then_some(first_of_place + 1);
    }
    let least_flights = least_flights(measures.len());
    Ranking { measures, pairs, least_flights, unranked: Vec::new(), acuity: None }
}

/// Returns true if two contenders have exactly the same outcomes.
fn flew_alike(a: &[Record], b: &[Record]) -> bool {
    a.iter().map(|record| &record.outcome).eq(b.iter().map(|record| &record.outcome))
}

/// Returns the minimum number of flights per contender for two contenders to be distinguishable.
pub fn least_flights(n_contenders: usize) -> u32 {
    least_for_center(level(n_contenders * n_contenders.saturating_sub(1) / 2))
}

/// Returns the confidence level at which `n_pairs` intervals are jointly valid (Bonferroni).
fn level(n_pairs: usize) -> f64 {
    1.0 - (1.0 - LEVEL) / n_pairs.max(1) as f64
}

/// Compares all pairs of `contenders`, which are sorted by mean probability, the highest first.
/// Each is a name with the probabilities of its flights, in the same order for all contenders.
pub(super) fn pairs(contenders: &[(&str, &[f64])]) -> Vec<Pair> {
    let (mut pairs, mut differences_by_pair) = (Vec::new(), Vec::new());
    for (index, (better, a)) in contenders.iter().enumerate() {
        for (worse, b) in &contenders[index + 1..] {
            let differences: Vec<f64> = a.iter().zip(*b).map(|(a, b)| a - b).collect();
            pairs.push(Pair {
                better: (*better).to_owned(),
                worse: (*worse).to_owned(),
                difference: Estimate { value: mean(&differences), low: -1.0, high: 1.0 },
                distinguishable: false,
            });
            differences_by_pair.push(differences);
        }
    }
    // Holm's procedure: distinguishable pairs lower the level required of the remaining pairs,
    // round by round, until a round adds no pair. The first round, Bonferroni's, gives the
    // intervals.
    let (n_pairs, mut n_before) = (pairs.len(), 0);
    loop {
        let n_open = pairs.iter().filter(|pair| !pair.distinguishable).count();
        if n_open == n_before {
            return pairs;
        }
        n_before = n_open;
        let open = pairs.iter_mut().zip(&differences_by_pair);
        for (pair, differences) in open.filter(|(pair, _)| !pair.distinguishable) {
            let Some(interval) = center(differences, level(n_open)) else { continue };
            pair.distinguishable = interval.low > 0.0 || interval.high < 0.0;
            if n_open == n_pairs {
                pair.difference = interval;
            }
        }
    }
}

/// Returns `value` of a contender's records, one list per word of the study. Records for which it
/// is `None` are left out, so a list may be shorter than the word's number of flights. `records`
/// are in the order of the study's words.
fn strata(
    study: &Study,
    mut records: &[Record],
    value: impl Fn(&Record) -> Option<f64>,
) -> Vec<Vec<f64>> {
    let words = study.words.iter().map(|(_, n)| {
        let of_word = records.split_off(..*n as usize).unwrap_or_default();
        of_word.iter().filter_map(&value).collect()
    });
    words.collect()
}

/// Computes a contender's measures, except its place, which depends on the other contenders.
/// `first` is the index of its first record among those of the study.
fn measure(study: &Study, records: &[Record], first: usize) -> Measures {
    let probabilities = strata(study, records, |record| Some(record.outcome.probability));
    // Photos are sorted from worst to best. A flight with a lost drone has no photo. Without any
    // photo, the first record stands for both the median and the worst.
    let mut photos: Vec<usize> =
        (0..records.len()).filter(|index| records[*index].outcome.flown.is_some()).collect();
    photos.sort_by(|a, b| {
        let [a, b] = [a, b].map(|index| &records[*index].outcome);
        a.probability.total_cmp(&b.probability).then(a.similarity.total_cmp(&b.similarity))
    });
    let [worst, median] = [0, photos.len() / 2].map(|index| photos.get(index).unwrap_or(&0));
    let figures = std::array::from_fn(|index| {
        let values = strata(study, records, |r| Some(r.outcome.flown?.values()[index]));
        mean_of_strata(&values)
    });
    Measures {
        contender: records[0].contender.clone(),
        place: None,
        n_flights: records.len(),
        n_lost: records.iter().filter(|record| record.outcome.lost.is_some()).count(),
        legibility: mean_of_probabilities(&probabilities),
        legible: proportion(records.iter().map(|record| record.outcome.legible)),
        worst_decile: worst_decile(&probabilities),
        all_read: proportion(records.iter().map(|record| record.outcome.all_read)),
        flown: (!photos.is_empty()).then(|| Flown::from_values(figures)),
        equal_to: None,
        median_and_worst: [first + median, first + worst],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Conditions, Outcome};
    use noctograph_pipeline::scene::{NamedScene, Preset, Scene};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};
    use rayon::prelude::*;

    /// Ranks contenders with made-up probabilities for one word, with one list per contender.
    fn ranked(probabilities: &[&[f64]]) -> Ranking {
        let names = ["a", "b", "c"];
        let contenders = (0..probabilities.len())
            .map(|index| NamedScene::new(names[index], Scene::preset(Preset::Ae4832022)))
            .collect();
        let n = u32::try_from(probabilities[0].len()).unwrap();
        let words = vec![("I".to_owned(), n)];
        let study = Study { contenders, words, conditions: Conditions::still(), seed: 0 };
        rank(&study, &records(&study, probabilities.concat().into_iter().map(Outcome::example)))
    }

    /// Returns records with these outcomes for a single-word study.
    fn records(study: &Study, outcomes: impl Iterator<Item = Outcome>) -> Vec<Record> {
        let records = study.trials().zip(outcomes).map(|(trial, outcome)| Record {
            scene: String::new(),
            contender: study.contenders[trial.contender].name.clone(),
            word: "I".into(),
            seed: trial.seed,
            outcome,
        });
        records.collect()
    }

    #[test]
    fn a_small_steady_difference_is_distinguishable_and_a_large_random_one_is_not() {
        let steps: Vec<f64> = (0..40).map(|k| 0.3 + 0.01 * f64::from(k)).collect();
        let steadily_better: Vec<f64> = steps.iter().map(|p| p + 0.004).collect();
        let ranking = ranked(&[&steps, &steadily_better]);
        assert_eq!(ranking.measures[0].contender, "b", "paired, 0.004 is enough");
        assert!(ranking.pairs[0].distinguishable, "{:?}", ranking.pairs);
        assert_eq!(places(&ranking), [Some(1), Some(2)]);

        let shuffled: Vec<f64> = (0..40).map(|k| 0.306 + 0.01 * f64::from(k * 7 % 40)).collect();
        let ranking = ranked(&[&steps, &shuffled]);
        assert!(ranking.pairs[0].difference.value > 0.005);
        assert!(!ranking.pairs[0].distinguishable, "{:?}", ranking.pairs);
        assert_eq!(places(&ranking), [Some(1), Some(1)]);
    }

    fn places(ranking: &Ranking) -> Vec<Option<usize>> {
        ranking.measures.iter().map(|measures| measures.place).collect()
    }

    #[test]
    fn places_follow_the_order_and_ties_share_the_place_of_their_first() {
        // Contender b is always slightly worse than a. Contender c is worse on average, but the
        // best in some flights.
        let a: Vec<f64> = (0..20).map(|k| 0.9 - 0.001 * f64::from(k)).collect();
        let b: Vec<f64> = a.iter().map(|p| p - 0.01).collect();
        let c: Vec<f64> = (0..20).map(|k| if k % 3 == 0 { 0.95 } else { 0.8 }).collect();
        let ranking = ranked(&[&c, &b, &a]);
        let names: Vec<&str> = ranking.measures.iter().map(|m| m.contender.as_str()).collect();
        assert_eq!(names, ["c", "b", "a"], "by P(read)");
        let [of_b, of_c] = [("c", "b"), ("c", "a")].map(|(better, worse)| {
            let pair = ranking.pairs.iter().find(|p| p.better == better && p.worse == worse);
            pair.unwrap().distinguishable
        });
        assert_eq!((of_b, of_c), (true, false));
        assert_eq!(places(&ranking), [Some(1), Some(2), Some(2)]);
    }

    #[test]
    fn a_controller_that_lost_every_drone_has_no_place() {
        let study = Study {
            contenders: vec![NamedScene::new("a", Scene::preset(Preset::Ae4832022))],
            words: vec![("I".to_owned(), 2)],
            conditions: Conditions::still(),
            seed: 0,
        };
        let lost = std::iter::repeat_with(|| Outcome::lost("I", "it turns over".into()));
        assert_eq!(places(&rank(&study, &records(&study, lost))), [None]);
    }

    #[test]
    fn what_is_told_apart_leaves_a_milder_level_for_the_others() {
        // Contender b is far worse in all flights. Contender c is slightly worse than a in all
        // flights but one. Of the 1023 subset means of a - c, ten are below zero. The
        // limit is 8 for three pairs, and 25 for one pair.
        let a = [0.9; 10];
        let mut c = [0.89; 10];
        c[0] = 0.915;
        let ranking = ranked(&[&a, &[0.1; 10], &c]);
        let pair = ranking.pairs.iter().find(|p| p.better == "a" && p.worse == "c").unwrap();
        assert!(pair.distinguishable, "by Holm: {pair:?}");
        assert!(pair.difference.low <= 0.0, "not by Bonferroni: {pair:?}");
    }

    /// Returns the pairs for contenders with these probabilities.
    fn pairs_of(contenders: &[Vec<f64>]) -> Vec<Pair> {
        pairs(&contenders.iter().map(|values| ("x", &values[..])).collect::<Vec<_>>())
    }

    /// Draws an approximately normal number as the sum of twelve uniform numbers.
    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Returns the fraction of studies in which equal contenders are found distinguishable.
    fn family_wise_error(n_contenders: u32, n_flights: u32, n_studies: u32) -> f64 {
        let wrong = (0..n_studies).into_par_iter().filter(|study| {
            let rng = &mut ChaCha8Rng::seed_from_u64(u64::from(*study));
            // Probabilities near 0.9 resemble those of flights, skewed and correlated by seed.
            let seeds: Vec<f64> = (0..n_flights).map(|_| 2.0 + normal(rng)).collect();
            let contenders = (0..n_contenders)
                .map(|_| seeds.iter().map(|s| 1.0 / (1.0 + libm::exp(-s - normal(rng)))).collect());
            pairs_of(&contenders.collect::<Vec<_>>()).iter().any(|pair| pair.distinguishable)
        });
        wrong.count() as f64 / f64::from(n_studies)
    }

    #[test]
    fn equal_contenders_are_told_apart_in_at_most_six_of_a_hundred_studies() {
        for (n_contenders, n_studies) in [(2, 2000), (5, 400), (10, 150)] {
            // Subsets of twenty flights are drawn, which takes most of the time.
            for (n_flights, n_studies) in [(5, n_studies), (10, n_studies), (20, n_studies / 4)] {
                let error = family_wise_error(n_contenders, n_flights, n_studies);
                assert!(error <= 0.06, "{n_contenders} contenders, {n_flights} flights: {error}");
            }
        }
    }

    #[test]
    fn thirty_six_contenders_are_told_apart_and_equal_ones_are_not() {
        fn pairs_apart(step: f64) -> Vec<Pair> {
            let contenders = (0..36_u32).map(|k| {
                let mut rng = ChaCha8Rng::seed_from_u64(u64::from(k));
                let noise = std::iter::repeat_with(|| 0.01 * rng.random::<f64>()).take(60);
                noise.map(|noise| 0.9 - step * f64::from(k) + noise).collect()
            });
            pairs_of(&contenders.collect::<Vec<_>>())
        }
        // The step is twelve standard errors of a difference.
        assert!(pairs_apart(0.0065).iter().all(|pair| pair.distinguishable));
        let alike = pairs_apart(0.0);
        assert!(alike.iter().all(|pair| !pair.distinguishable && pair.difference.high < 0.01));
    }

    #[test]
    fn too_few_flights_tell_nothing_apart_and_the_number_wanted_is_known() {
        let ranking = ranked(&[&[0.9; 5], &[0.1; 5]]);
        assert_eq!((ranking.least_flights, ranking.pairs[0].distinguishable), (6, false));
        assert_eq!(ranking.pairs[0].difference.low, -1.0);
        assert!(ranked(&[&[0.9; 6], &[0.1; 6]]).pairs[0].distinguishable);
    }

    #[test]
    fn figures_are_those_of_the_flights() {
        let values: Vec<f64> = (0..20).map(|k| 0.05 * f64::from(k)).collect();
        let ranking = ranked(&[&values]);
        let actual = &ranking.measures[0];
        assert!((actual.legibility.value - 0.475).abs() < 1e-12);
        assert!((actual.worst_decile.value - 0.025).abs() < 1e-12, "mean of 0 and 0.05");
        assert!((actual.legible.value - 0.3).abs() < 1e-12, "six are above 0.7: {actual:?}");
        assert!((actual.all_read.value - 0.45).abs() < 1e-12, "nine are above a half");
        assert!(ranking.pairs.is_empty() && actual.place == Some(1));
    }
}
