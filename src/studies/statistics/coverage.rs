//! Tests how often the intervals of a study contain the true value. The tests with distributions
//! that resemble those of flights are fast. Simulated flights are used by ignored tests, whose
//! table `docs/figures coverage` prints.

use std::cmp::Ordering;

use noctograph_core::random::split_mix;
use noctograph_pipeline::scene::{NamedScene, Preset, Scene};
use noctograph_pipeline::shoot::Stop;
use noctograph_sim::ControllerKind;
use rayon::prelude::*;

use super::*;
use crate::rank::pairs;
use crate::{Conditions, Record, Study, Trial, evaluate};

/// Function that returns the interval for a study's values.
type Interval<'a> = &'a (dyn Fn(&[Vec<f64>]) -> Estimate + Sync);

/// Returns the fractions of studies whose interval contains the true value, lies below it, or lies
/// above it. Each study draws `n` values by `law`, the quantile function of a distribution, which
/// must be finite at 0 and is never called with 1.
fn coverage_of(
    law: &(dyn Fn(f64) -> f64 + Sync),
    truth: f64,
    n: u32,
    n_studies: u32,
    interval: Interval<'_>,
) -> [f64; 3] {
    let sides = (0..n_studies).into_par_iter().map(|study| {
        let keys = (0..n).map(|k| u64::from(study) << 32 | u64::from(k));
        // The upper 53 bits of a random number, divided by 2⁵³, are from 0 to just below 1.
        let uniform = keys.map(|key| (split_mix(key) >> 11) as f64 / (1_u64 << 53) as f64);
        let estimate = interval(&[uniform.map(law).collect()]);
        match (estimate.high < truth, estimate.low > truth) {
            (true, _) => Ordering::Less,
            (_, true) => Ordering::Greater,
            _ => Ordering::Equal,
        }
    });
    let sides: Vec<Ordering> = sides.collect();
    [Ordering::Equal, Ordering::Less, Ordering::Greater]
        .map(|wanted| mean(sides.iter().map(|side| f64::from(*side == wanted))))
}

#[test]
fn intervals_of_skewed_probabilities_hold_their_mean_as_often_as_they_say() {
    // Log-odds have logistic tails, `middle + scale ln(u / (1 - u))`. The scales range from good
    // flights (0.25) to small letters (0.8).
    for (middle, scale) in [(3.5, 0.25), (2.5, 0.3), (1.0, 0.8), (-1.0, 0.8), (-3.0, 0.6)] {
        let law = |u: f64| {
            let odds = libm::log(u.max(1e-12) / (1.0 - u));
            1.0 / (1.0 + libm::exp(-middle - scale * odds))
        };
        let points = 100_000;
        let quantiles = (0..points).map(|k| law((f64::from(k) + 0.5) / f64::from(points)));
        let truth = quantiles.sum::<f64>() / f64::from(points);
        for n in [6, 10, 20, 50, 100] {
            let [inside, below, above] = coverage_of(&law, truth, n, 1000, &mean_of_probabilities);
            println!("{middle} {scale} {n}: {inside:.3} {below:.3} {above:.3}");
            assert!((0.94..=0.99).contains(&inside), "{middle} {scale} {n}: {inside}");
        }
    }
}

/// Returns a scene whose difficulty is set by cap height and stroke speed. Smaller and faster
/// letters are harder to read.
fn contender(name: &str, kind: ControllerKind, cap_height_m: f64, speed_m_s: f64) -> NamedScene {
    let mut scene = Scene::preset(Preset::CfBrushless);
    scene.controller.kind = kind;
    scene.letters.cap_height_m = cap_height_m;
    scene.plan.stroke_speed_m_s = speed_m_s;
    NamedScene::new(name, scene)
}

/// Returns the flights of contenders with the same seeds.
fn flights(contenders: Vec<NamedScene>, word: &str, n: u32) -> Vec<Vec<Record>> {
    let words = vec![(word.to_owned(), n)];
    let study = Study { contenders, words, conditions: Conditions::default(), seed: 11 };
    let trials: Vec<Trial> = study.trials().collect();
    let ready = study.prepare().unwrap();
    let records = evaluate(&study, &ready, &trials, None, &Stop::default(), &|_| {}).unwrap();
    records.chunks(n as usize).map(<[Record]>::to_vec).collect()
}

/// Number of studies for a table cell. Worst tenths and pairs use fewer studies, because the
/// subsets of a hundred pairs take a second.
const STUDIES: u32 = 4000;
const FEWER_STUDIES: u32 = 500;

const NUMBERS: [u32; 7] = [6, 10, 20, 50, 100, 200, 500];

/// Returns the cells of a row, one per number of flights in [`NUMBERS`]: how often, in percent, an
/// interval contains the true value, lies below it, or lies above it.
fn cells(values: &[f64], truth: f64, n_studies: u32, interval: Interval<'_>) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let law = |u: f64| values[(u * values.len() as f64) as usize];
    let cells = NUMBERS.map(|n| {
        let [inside, below, above] =
            coverage_of(&law, truth, n, n_studies, interval).map(|part| 100.0 * part);
        format!("{inside:.1} ({below:.1}, {above:.1})")
    });
    cells.join(" | ")
}

/// Prints a row of a table: the name, the true value, the standard deviation, and the [`cells`].
fn row(name: &str, values: &[f64], truth: f64, n_studies: u32, interval: Interval<'_>) {
    let sigma = standard_error(values) * (values.len() as f64).sqrt();
    println!(
        "| {name} | {truth:.3} | {sigma:.3} | {} |",
        cells(values, truth, n_studies, interval)
    );
}

fn proportion_of_hits(strata: &[Vec<f64>]) -> Estimate {
    proportion(strata.iter().flatten().map(|value| *value > 0.5))
}

/// Returns the pairs that are distinguished, as numbers of the better and the worse contender.
/// `pool` contains the probabilities of each contender, and `flights` contains indices into them.
fn distinguished(pool: &[Vec<f64>], flights: &[Vec<f64>]) -> Vec<[usize; 2]> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let drawn = pool.iter().map(|values| flights.iter().flatten().map(|k| values[*k as usize]));
    let names = (0..pool.len()).map(|index| index.to_string());
    let mut drawn: Vec<(Vec<f64>, String)> = drawn.map(Iterator::collect).zip(names).collect();
    drawn.sort_by(|(a, _), (b, _)| mean(b).total_cmp(&mean(a)));
    let named: Vec<_> = drawn.iter().map(|(values, name)| (name.as_str(), &values[..])).collect();
    let distinguished = pairs(&named).into_iter().filter(|pair| pair.distinguishable);
    let numbers =
        distinguished.map(|pair| [pair.better, pair.worse].map(|name| name.parse().unwrap()));
    numbers.collect()
}

/// Returns the interval of a contender's rank, from one more than the number of contenders found to
/// be better, to the number of all contenders less those found to be worse (Mohamad, Goeman, van
/// Zwet, arXiv:1708.02729).
fn rank_among(pool: &[Vec<f64>], contender: usize, flights: &[Vec<f64>]) -> Estimate {
    let [mut low, mut high] = [1.0, pool.len() as f64];
    for [better, worse] in distinguished(pool, flights) {
        low += f64::from(worse == contender);
        high -= f64::from(better == contender);
    }
    Estimate { value: low, low, high }
}

/// Returns contenders that are equal: the flights of `pool`, whose probabilities are assigned to
/// the contenders in each of the four cyclic orders and their reverses.
fn equals(pool: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = pool.len();
    let contenders = (0..n).map(|contender| {
        let sources = (0..n).flat_map(|turn| [(contender + turn) % n, (turn + n - contender) % n]);
        sources.flat_map(|source| pool[source].iter().copied()).collect()
    });
    contenders.collect()
}

fn center_of_differences(strata: &[Vec<f64>]) -> Estimate {
    center(&strata.concat(), LEVEL).unwrap()
}

/// Returns the mean of the lowest tenth of many values. A value that is only partly within the
/// tenth counts by that part.
fn tail(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let n_lowest = 0.1 * sorted.len() as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let whole = n_lowest as usize;
    let rest = (n_lowest - whole as f64) * sorted.get(whole).copied().unwrap_or(0.0);
    (sorted[..whole].iter().sum::<f64>() + rest) / n_lowest
}

#[test]
#[ignore = "1,160 flights: docs/figures coverage prints the table"]
fn coverage_of_intervals_on_flights() {
    use ControllerKind::{Geometric, Lqr, Pid};
    let plain = Scene::preset(Preset::CfBrushless);
    let (height_m, speed_m_s) = (plain.letters.cap_height_m, plain.plan.stroke_speed_m_s);
    let of_tea = vec![
        contender("geometric, TEA", Geometric, height_m, speed_m_s),
        contender("pid, TEA", Pid, height_m, speed_m_s),
        contender("lqr, TEA", Lqr, height_m, speed_m_s),
        contender("lqr, TEA, 20 cm capitals", Lqr, 0.2, speed_m_s),
        contender("lqr, TEA, 10 cm capitals", Lqr, 0.1, speed_m_s),
        contender("lqr, TEA, 7 cm capitals", Lqr, 0.07, speed_m_s),
    ];
    let of_noor = vec![
        contender("lqr, NOOR", Lqr, height_m, speed_m_s),
        contender("lqr, NOOR at 0.8 m/s", Lqr, height_m, 0.8),
    ];
    let pool = [flights(of_tea, "TEA", 160), flights(of_noor, "NOOR", 100)].concat();
    fn probabilities(records: &[Record]) -> Vec<f64> {
        records.iter().map(|record| record.outcome.probability).collect()
    }
    println!("| flights | truth | spread | {} |", NUMBERS.map(|n| n.to_string()).join(" | "));
    println!("|---|---|---{}|", "|---".repeat(NUMBERS.len()));
    for records in &pool {
        let (name, values) = (&records[0].contender, probabilities(records));
        let name = format!("P(read): {name}");
        row(&name, &values, mean(&values), STUDIES, &mean_of_probabilities);
    }
    for records in [&pool[2], &pool[3], &pool[6]] {
        let (name, values) = (&records[0].contender, probabilities(records));
        let name = format!("worst tenth: {name}");
        row(&name, &values, tail(&values), FEWER_STUDIES, &worst_decile);
    }
    for records in [&pool[3], &pool[4], &pool[6]] {
        let values: Vec<f64> =
            records.iter().map(|record| f64::from(record.outcome.legible)).collect();
        let name = format!("legible: {}", records[0].contender);
        row(&name, &values, mean(&values), STUDIES, &proportion_of_hits);
    }
    for [better, worse] in [[0, 1], [1, 2], [2, 3]] {
        let [a, b] = [better, worse].map(|index: usize| probabilities(&pool[index]));
        let values: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let names = [better, worse].map(|index: usize| pool[index][0].contender.as_str());
        let name = format!("pair: {} and {}", names[0], names[1]);
        row(&name, &values, mean(&values), FEWER_STUDIES, &center_of_differences);
    }
    // Ranks of the first four contenders, ordered by their means.
    let four: Vec<Vec<f64>> = pool[..4].iter().map(|records| probabilities(records)).collect();
    let flights: Vec<f64> = (0..four[0].len()).map(|k| k as f64).collect();
    for (contender, rank) in [(1, 2.0), (2, 3.0)] {
        let interval = |flights: &[Vec<f64>]| rank_among(&four, contender, flights);
        let cells = cells(&flights, rank, FEWER_STUDIES, &interval);
        println!("| rank of four: {} | {rank} | | {cells} |", pool[contender][0].contender);
    }
    // All ranks of equal contenders are wrong if any pair is distinguished.
    let equals = equals(&four);
    let flights: Vec<f64> = (0..equals[0].len()).map(|k| k as f64).collect();
    let interval = |flights: &[Vec<f64>]| {
        let low = distinguished(&equals, flights).len() as f64;
        Estimate { value: low, low, high: f64::INFINITY }
    };
    let cells = cells(&flights, 0.0, FEWER_STUDIES, &interval);
    println!("| ranks of four equal contenders, together | 1 to 4 | | {cells} |");
}
