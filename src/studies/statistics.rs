//! Statistics of flights: means, proportions, tails and their confidence intervals.
//!
//! | figure | interval |
//! |---|---|
//! | mean | Student's t, within strata (the flights of a word) if each has two values |
//! | mean of probabilities | Dirichlet weights and a part of a flight at each end (`Posterior`) |
//! | proportion | Agresti, Coull (1998); Brown, Cai, `DasGupta`, Statistical Science 16 (2001) |
//! | difference of pairs | typical values: Hartigan, Journal of the ASA 64 (1969) |
//! | worst tenth | the same, of its influence function (`worst_decile`) |
//! | other figures | percentile bootstrap: Efron, Tibshirani, "An Introduction to the Bootstrap" (1993) |
//!
//! The random numbers have a fixed seed, so that an interval depends only on its values.
//!
//! The means of all subsets of n differences divide the real line into 2ⁿ intervals. For any
//! symmetric distribution, each interval contains the center with equal probability, so the
//! confidence interval is exact even for few values. The method corresponds to the randomization
//! test of Fisher and Pitman. A level of 95 % requires at least six values.

use std::borrow::Borrow;

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

/// Number of bootstrap samples, of which 50 lie beyond each end of a 95 % interval.
const RESAMPLES: usize = 2000;
/// Number of subsets that are drawn at random if there are too many to enumerate. At a level of 1 -
/// 0.05 / 45, used for ten contenders, 11 subsets lie beyond each end.
const SUBSETS: usize = 20_000;
/// Maximum number of values for which all subsets are enumerated.
const MAX_ENUMERATED: usize = 14;

/// Weight, in flights, of hypothetical values 0 and 1 that were never observed. At a lower weight,
/// the intervals from few flights miss rare failures: at 0.25, only 89 % of them contain the mean
/// of a hundred flights of which 3 % fail. At a higher weight the intervals are too wide.
const UNSEEN: f64 = 0.5;
/// Number of bisections on the logarithm of a distance.
const BISECTIONS: u32 = 40;

/// A figure and its confidence interval at a stated level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Figure computed from all values.
    pub value: f64,
    /// Lower end of the confidence interval.
    pub low: f64,
    /// Upper end of the confidence interval.
    pub high: f64,
}

/// Confidence level of all intervals except those of `center`.
pub(super) const LEVEL: f64 = 0.95;

/// Returns the mean, which is 0 without values.
pub(super) fn mean(values: impl IntoIterator<Item: Borrow<f64>>) -> f64 {
    let mut n = 0.0_f64;
    let sum: f64 = values.into_iter().inspect(|_| n += 1.0).map(|value| *value.borrow()).sum();
    sum / n.max(1.0)
}

/// Returns the standard error of the mean, which is 0 for fewer than two values.
pub(super) fn standard_error(values: &[f64]) -> f64 {
    let (n, middle) = (values.len() as f64, mean(values));
    let variance = mean(values.iter().map(|value| (value - middle) * (value - middle)));
    if n < 2.0 { 0.0 } else { (variance / (n - 1.0)).sqrt() }
}

/// Returns the mean of the lowest tenth (at least one) of values from 0 to 1, with its 95 %
/// interval. Without values the mean is 0. The interval of a single value is from 0 to 1.
///
/// The mean of the worst tenth is the maximum over q of the mean of `q + min(x - q, 0) n / k`, for
/// the k lowest of n values x (Rockafellar, Uryasev, Journal of Risk 2, 2000). Each end of the
/// interval is therefore the maximum of the corresponding ends of such means, by
/// [`Posterior::ends`]. A percentile bootstrap is not used, because it never draws below the lowest
/// value.
pub(super) fn worst_decile(strata: &[Vec<f64>]) -> Estimate {
    let mut values = strata.concat();
    values.sort_unstable_by(f64::total_cmp);
    let n_lowest = values.len().div_ceil(10);
    let value = mean(&values[..n_lowest]);
    if values.len() < 2 {
        return Estimate { value, low: 0.0, high: 1.0 };
    }
    let per_value = values.len() as f64 / n_lowest as f64;
    // Candidates for q lie around the k-th value, because with few flights the worst tenth of all
    // possible flights may extend beyond the k-th observed value.
    let ends = [2, 3, 4, 6, 8, 12, 16].map(|quarters| {
        let q = values[(quarters * n_lowest / 4).min(values.len() - 1)];
        let influences = values.iter().map(|x| q + (x - q).min(0.0) * per_value).collect();
        Posterior::ends(influences, [(q - q * per_value, UNSEEN), (q, 0.0)])
    });
    let [low, high] = [0, 1].map(|end| ends.iter().map(|ends| ends[end]).fold(0.0, f64::max));
    Estimate { value, low: low.min(value), high: high.clamp(value, 1.0) }
}

/// Sorts the values and returns their median, which is 0 without values.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// Returns the mean of all values with its 95 % interval by Student's t. The variance is that
/// within strata, or of all values if a stratum has one value. The interval of a single value is
/// unbounded.
pub(super) fn mean_of_strata(strata: &[Vec<f64>]) -> Estimate {
    let value = mean(strata.iter().flatten());
    let n = strata.iter().map(Vec::len).sum::<usize>() as f64;
    if n < 2.0 {
        return Estimate { value, low: f64::NEG_INFINITY, high: f64::INFINITY };
    }
    let freedom = n - pooled(strata).iter().filter(|values| !values.is_empty()).count() as f64;
    let half_width = student_t(freedom) * standard_error(&about(value, strata));
    Estimate { value, low: value - half_width, high: value + half_width }
}

/// Returns the mean of values from 0 to 1 with its 95 % interval, computed by [`Posterior::ends`]
/// and limited to 0 to 1. The interval of a single value is from 0 to 1.
///
/// Probabilities of being read are skewed: most flights are alike, and a few are far worse. Small
/// samples often lack these few. The interval therefore allows for unseen flights at 0 and at 1
/// (`coverage`, docs/benchmark.md).
pub(super) fn mean_of_probabilities(strata: &[Vec<f64>]) -> Estimate {
    let value = mean(strata.iter().flatten());
    let values = about(value, strata);
    if values.len() < 2 {
        return Estimate { value, low: 0.0, high: 1.0 };
    }
    // Good flights have probabilities close to 1, so further values close to 1 would change little.
    let [lowest, highest] =
        [value, 1.0 - value].map(|distance| UNSEEN * (2.0 * distance).clamp(0.0, 1.0).sqrt());
    let [low, high] = Posterior::ends(values, [(0.0, lowest), (1.0, highest)]);
    // The mean lies within the interval, except for rounding errors when all values are equal.
    Estimate { value, low: low.clamp(0.0, value), high: high.clamp(value, 1.0) }
}

/// Posterior distribution of a mean: the mean of values with random weights from a Dirichlet
/// distribution, with a parameter of 1 for each value (Rubin's Bayesian bootstrap, Annals of
/// Statistics 9, 1981) and a separate parameter for a hypothetical unseen value.
///
/// If the parameter of the unseen value is also 1, the end on its side is Gaffke's bound (preprint,
/// Magdeburg 2005, and Learned-Miller, Thomas, arXiv:1905.06208). This bound is conjectured to hold
/// for any distribution. For proportions it equals the bound of Clopper and Pearson.
struct Posterior {
    values: Vec<f64>,
    /// Unseen value and its parameter.
    unseen: (f64, f64),
}

impl Posterior {
    /// Returns the ends of the 95 % interval of the mean, given an unseen value on each side.
    ///
    /// Each side is allotted half of the error probability. If an unseen value moves an end far
    /// outward, the interval rarely misses on that side, so the other end receives the unused part.
    fn ends(values: Vec<f64>, unseen: [(f64, f64); 2]) -> [f64; 2] {
        let half = 0.5 * (1.0 - LEVEL);
        let mirrored = values.iter().map(|x| -x).collect();
        let [bottom, (top, weight)] = unseen;
        let sides = [(values, bottom), (mirrored, (-top, weight))];
        let mut sides = sides.map(|(values, unseen)| Self { values, unseen });
        let unused = sides.each_mut().map(|side| {
            let (end, _) = side.solve(|_, tail| tail < half);
            let weight = std::mem::take(&mut side.unseen.1);
            let (_, tail) = side.solve(|point, _| point < end);
            side.unseen.1 = weight;
            half - tail.min(half)
        });
        let [low, high] = [(0, unused[1]), (1, unused[0])]
            .map(|(side, added)| sides[side].solve(|_, tail| tail < half + added).0);
        [low, -high]
    }

    /// Returns a point, and the probability that the mean lies below the point. The point belongs
    /// to the saddle that is nearest to the values among those for which `is_beyond` is false.
    /// `is_beyond` must be true near the values and false far from them.
    fn solve(&self, is_beyond: impl Fn(f64, f64) -> bool) -> (f64, f64) {
        let least = self.weighted().map(|(x, _)| x).fold(f64::INFINITY, f64::min);
        // Natural logarithms of the saddle's distances from the lowest value.
        let (mut near, mut far) = (-30.0, 8.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (near + far);
            let (point, probability) = self.tail(least - libm::exp(middle));
            if is_beyond(point, probability) {
                near = middle;
            } else {
                far = middle;
            }
        }
        self.tail(least - libm::exp(far))
    }

    /// Returns the point whose saddle is at `saddle`, below all values, and the probability of a
    /// mean below the point. The method is that of Lugannani and Rice, Advances in Applied
    /// Probability 12 (1980), in the form of Barndorff-Nielsen. For proportions the ends agree with
    /// the exact ones to within 0.005.
    ///
    /// The mean is below c if `Σ γ (x - c) < 0`, with gamma-distributed γ. The cumulants of this
    /// sum have a saddle, whose pole u determines the point: c - u is the harmonic mean of x - u.
    fn tail(&self, saddle: f64) -> (f64, f64) {
        let (mut total, mut inverses) = (0.0, 0.0);
        for (x, weight) in self.weighted() {
            total += weight;
            inverses += weight / (x - saddle);
        }
        let point = saddle + total / inverses;
        // Twice the log-likelihood ratio, and the second cumulant at the saddle.
        let (mut ratio, mut curvature) = (0.0, 0.0);
        for (x, weight) in self.weighted() {
            let distance = x - saddle;
            let slope = (x - point) / distance;
            ratio += 2.0 * weight * libm::log(distance * inverses / total);
            curvature += weight * slope * slope;
        }
        let (r, q) = (ratio.max(0.0).sqrt(), curvature.sqrt());
        // There is no spread if all values are equal.
        let z = if r.min(q) < 1e-7 { 0.0 } else { r + libm::log(q / r) / r };
        (point, 0.5 * libm::erfc(z * std::f64::consts::FRAC_1_SQRT_2))
    }

    /// Returns the values, each with its Dirichlet parameter.
    fn weighted(&self) -> impl Iterator<Item = (f64, f64)> {
        let unseen = Some(self.unseen).filter(|(_, weight)| *weight > 0.0);
        self.values.iter().map(|x| (*x, 1.0)).chain(unseen)
    }
}

/// Returns the values, shifted so that every stratum has the mean `value`, and scaled so that their
/// variance about that mean is the variance within strata.
fn about(value: f64, strata: &[Vec<f64>]) -> Vec<f64> {
    let strata = pooled(strata);
    let n = strata.iter().map(Vec::len).sum::<usize>() as f64;
    let values = strata.iter().flat_map(|values| {
        // Bessel's correction of each stratum, divided by that of a single stratum with all values.
        let (n_values, middle) = (values.len() as f64, mean(values));
        let bessel = n_values / (n_values - 1.0).max(1.0) * (n - 1.0) / n;
        values.iter().map(move |x| value + bessel.sqrt() * (x - middle))
    });
    values.collect()
}

/// Returns the strata, or all values as one stratum if any stratum has only one value.
fn pooled(strata: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let has_single = strata.iter().any(|values| values.len() == 1);
    if has_single { vec![strata.concat()] } else { strata.to_vec() }
}

/// Returns the proportion of true values with its 95 % interval by Agresti and Coull, which is
/// Wilson's interval with the variance taken at its center. If about one flight in five studies
/// differs, Wilson's interval contains the true value in 84 % of cases, and this one in 90 to 99 %.
pub(super) fn proportion(values: impl IntoIterator<Item = bool>) -> Estimate {
    // 97.5 % quantile of the normal distribution.
    const Z: f64 = 1.959_964;
    let hits: Vec<f64> = values.into_iter().map(f64::from).collect();
    let (value, n) = (mean(&hits), hits.len() as f64 + Z * Z);
    let middle = (value * hits.len() as f64 + 0.5 * Z * Z) / n;
    let half_width = Z * (middle * (1.0 - middle) / n).sqrt();
    Estimate { value, low: (middle - half_width).max(0.0), high: (middle + half_width).min(1.0) }
}

/// Returns the mean of differences, with a confidence interval at `level` for the center of their
/// distribution, by Hartigan's typical values. Returns `None` if there are too few differences. At
/// levels that the drawn subsets cannot resolve, for example with more than thirty contenders, the
/// result is Hoeffding's wider bound (Journal of the ASA 58, 1963) on the means of all subsets.
pub(super) fn center(differences: &[f64], level: f64) -> Option<Estimate> {
    let (n, value) = (differences.len() as f64, mean(differences));
    let mut means = subset_means(differences);
    // Number of subset means beyond each end. The added 1e-9 allows for rounding errors.
    #[expect(clippy::cast_possible_truncation, reason = "within the subsets")]
    let beyond = (0.5 * (1.0 - level) * (means.len() + 1) as f64 + 1e-9) as usize;
    if beyond > 0 {
        let [low, high] = [beyond - 1, means.len() - beyond]
            .map(|end| *means.select_nth_unstable_by(end, f64::total_cmp).1);
        return Some(Estimate { value, low, high });
    }
    // Hoeffding's bound excludes a center c if 2 exp(-(Σ (d - c))² / (2 Σ (d - c)²)) < 1 - level.
    let bound = 2.0 * libm::log(2.0 / (1.0 - level));
    let half_width = standard_error(differences) * (bound * (n - 1.0) / (n - bound)).sqrt();
    let is_drawn = differences.len() > MAX_ENUMERATED && n > bound;
    is_drawn.then_some(Estimate { value, low: value - half_width, high: value + half_width })
}

/// Returns the minimum number of differences for which [`center`] has an interval at `level`.
#[expect(clippy::cast_possible_truncation, reason = "small")]
pub(super) fn least_for_center(level: f64) -> u32 {
    // The subtracted 1e-9 allows for rounding errors.
    libm::ceil(libm::log2(2.0 / (1.0 - level)) - 1e-9) as u32
}

/// Returns the means of all nonempty subsets, or of [`SUBSETS`] random ones if there are too many
/// to enumerate. The random ones are the same in every run.
fn subset_means(values: &[f64]) -> Vec<f64> {
    // Each table contains the sums for eight values, so a subset's mean takes a look-up per table.
    let tables: Vec<Vec<(f64, u32)>> = values.chunks(8).map(subset_sums).collect();
    if values.len() <= MAX_ENUMERATED {
        let masks = 0..1_usize << values.len();
        let means = masks.map(|mask| subset_mean(&tables, (0..).map(|byte| mask >> (8 * byte))));
        return means.flatten().collect();
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut bytes = std::iter::repeat_with(|| usize::from(rng.random::<u8>()));
    (0..SUBSETS).filter_map(|_| subset_mean(&tables, &mut bytes)).collect()
}

/// Returns the sum and the number of the values in every subset of up to eight values. Bit i of a
/// subset's index selects value i.
fn subset_sums(eight: &[f64]) -> Vec<(f64, u32)> {
    let subsets = (0..1_usize << eight.len()).map(|mask| {
        let chosen = eight.iter().enumerate().filter(|(i, _)| mask >> i & 1 == 1);
        chosen.fold((0.0, 0), |(sum, n), (_, value)| (sum + value, n + 1))
    });
    subsets.collect()
}

/// Returns the mean of the subset given by an index into each table, or `None` for an empty one.
/// Each table lists the sum and the number of values of every subset of eight values.
fn subset_mean(tables: &[Vec<(f64, u32)>], indices: impl Iterator<Item = usize>) -> Option<f64> {
    let sums = tables.iter().zip(indices).map(|(table, index)| table[index % table.len()]);
    let (sum, n) = sums.fold((0.0, 0), |(sum, n), (more, count)| (sum + more, n + count));
    (n > 0).then(|| sum / f64::from(n))
}

/// Returns the 97.5 % quantile of Student's t-distribution with `freedom` degrees of freedom (Hill,
/// Communications of the ACM 13, 1970, algorithm 396).
fn student_t(freedom: f64) -> f64 {
    // Probability of both tails together, and the normal quantile of one tail.
    const BEYOND: f64 = 0.05;
    const NORMAL: f64 = -1.959_964;
    // Student's distribution has closed forms for one and two degrees of freedom.
    if freedom < 2.0 {
        return 1.0 / libm::tan(0.5 * std::f64::consts::PI * BEYOND);
    }
    if freedom < 3.0 {
        return (2.0 / (BEYOND * (2.0 - BEYOND)) - 2.0).sqrt();
    }
    // The variable names are taken from Hill's algorithm.
    let a = 1.0 / (freedom - 0.5);
    let b = 48.0 / (a * a);
    let mut c = ((20_700.0 * a / b - 98.0) * a - 16.0) * a + 96.36;
    let d = ((94.5 / (b + c) - 3.0) / b + 1.0) * (0.5 * a * std::f64::consts::PI).sqrt() * freedom;
    let mut y = libm::pow(d * BEYOND, 2.0 / freedom);
    if y > 0.05 + a {
        // For many degrees of freedom, an asymptotic expansion about the normal quantile is used.
        let x = NORMAL;
        y = x * x;
        if freedom < 5.0 {
            c += 0.3 * (freedom - 4.5) * (x + 0.6);
        }
        c += (((0.05 * d * x - 5.0) * x - 7.0) * x - 2.0) * x + b;
        y = (((((0.4 * y + 6.3) * y + 36.0) * y + 94.5) / c - y - 3.0) / b + 1.0) * x;
        y = libm::expm1(a * y * y);
    } else {
        // For few degrees of freedom, an expansion in the tail is used.
        let tail = (1.0
            / (((freedom + 6.0) / (freedom * y) - 0.089 * d - 0.822) * (freedom + 2.0) * 3.0)
            + 0.5 / (freedom + 4.0))
            * y;
        y = (tail - 1.0) * (freedom + 1.0) / (freedom + 2.0) + 1.0 / y;
    }
    (freedom * y).sqrt()
}

/// Returns a statistic of all values, with its 95 % percentile bootstrap interval. `statistic` may
/// reorder the values that it receives.
pub(super) fn bootstrap(strata: &[Vec<f64>], statistic: impl Fn(&mut [f64]) -> f64) -> Estimate {
    let (mut values, strata) = (strata.concat(), pooled(strata));
    let value = statistic(&mut values);
    if values.len() < 2 {
        return Estimate { value, low: value, high: value };
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    // For each sample, as many values as a stratum contains are drawn from it with replacement.
    let samples = (0..RESAMPLES).map(|_| {
        values.clear();
        for stratum in &strata {
            values.extend(stratum.iter().map(|_| stratum[rng.random_range(0..stratum.len())]));
        }
        statistic(&mut values)
    });
    let mut statistics: Vec<f64> = samples.collect();
    statistics.sort_unstable_by(f64::total_cmp);
    let beyond = 0.5 * (1.0 - LEVEL);
    #[expect(clippy::cast_possible_truncation, reason = "within the samples")]
    let [low, high] = [beyond, 1.0 - beyond]
        .map(|quantile| statistics[((quantile * RESAMPLES as f64) as usize).min(RESAMPLES - 1)]);
    Estimate { value, low, high }
}

#[cfg(test)]
mod coverage;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_and_middles_are_those_of_the_values() {
        let mut values: Vec<f64> = (1..=20).map(f64::from).rev().collect();
        assert_eq!(median(&mut values), 10.5);
        let tenths: Vec<f64> = values.iter().map(|value| value / 20.0).collect();
        assert!((worst_decile(&[tenths]).value - 0.075).abs() < 1e-12, "the mean of two");
        assert_eq!((mean(&values), mean([0.0; 0]), median(&mut [])), (10.5, 0.0, 0.0));
        let single = worst_decile(&[vec![0.3]]);
        assert_eq!((single.low, single.value, single.high), (0.0, 0.3, 1.0));
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_the_normal_law() {
        // The standard error of 0 … 399 is 115.62 / 20 = 5.78, and its factor is 1.966.
        let values: Vec<f64> = (0..400).map(f64::from).collect();
        let by_t = mean_of_strata(std::slice::from_ref(&values));
        assert!((by_t.high - by_t.value - 11.365).abs() < 0.01, "{by_t:?}");
        let estimate = bootstrap(std::slice::from_ref(&values), |v| mean(&*v));
        assert_eq!(estimate.value, 199.5);
        for estimate in [estimate, center(&values, 0.95).unwrap()] {
            assert!((estimate.high - estimate.value - 11.3).abs() < 0.7, "{estimate:?}");
            assert!((estimate.value - estimate.low - 11.3).abs() < 0.7, "{estimate:?}");
        }
    }

    #[test]
    fn quantiles_and_proportions_are_those_of_the_tables() {
        let freedoms = [1.0, 2.0, 3.0, 4.0, 5.0, 10.0, 30.0, 1000.0];
        let wanted = [12.706, 4.303, 3.182, 2.776, 2.571, 2.228, 2.042, 1.962];
        for (freedom, wanted) in freedoms.into_iter().zip(wanted) {
            let t = student_t(freedom);
            assert!((t - wanted).abs() < 1e-3, "{freedom}: {t}");
        }
        // The expected values are from R's binom.confint(x, n, methods = "agresti-coull").
        for (hits, n, low, high) in [(0, 10, 0.0, 0.3209), (8, 10, 0.4794, 0.9541)] {
            let estimate = proportion((0..n).map(|i| i < hits));
            assert!(
                (estimate.low - low).abs() < 1e-4 && (estimate.high - high).abs() < 1e-4,
                "{estimate:?}"
            );
        }
    }

    #[test]
    fn ends_of_proportions_are_those_of_beta_distributions() {
        // The expected values are from R's qbeta(0.025, hits, 10 - hits + weight). A weight of 1
        // gives the interval of Clopper and Pearson.
        let wanted = [(8, 1.0, 0.4439), (8, 0.5, 0.4775), (10, 1.0, 0.6915), (10, 0.5, 0.7731)];
        for (hits, weight, wanted) in wanted {
            let values = (0..10).map(|k| f64::from(k < hits)).collect();
            let (low, tail) = Posterior { values, unseen: (0.0, weight) }.solve(|_, p| p < 0.025);
            assert!((low - wanted).abs() < 0.004 && (tail - 0.025).abs() < 1e-6, "{hits}: {low}");
        }
    }

    #[test]
    fn flights_that_were_not_seen_extend_the_interval_of_good_ones() {
        let good: Vec<f64> = (0..20).map(|k| 0.96 + 0.001 * f64::from(k)).collect();
        let estimate = mean_of_probabilities(std::slice::from_ref(&good));
        assert!((0.85..0.93).contains(&estimate.low), "one of twenty may fail: {estimate:?}");
        assert!((0.97..0.975).contains(&estimate.high), "{estimate:?}");
        let bad: Vec<f64> = good.iter().map(|p| 1.0 - p).collect();
        let mirrored = mean_of_probabilities(&[bad]);
        assert!((mirrored.high + estimate.low - 1.0).abs() < 1e-9, "{mirrored:?}");
        for equal in [0.0, 0.4, 1.0] {
            let Estimate { value, low, high } = mean_of_probabilities(&[vec![equal; 9]]);
            assert!((value - equal).abs() < 1e-12 && low <= value && value <= high);
            assert!(high - low > 0.1, "nine equal flights: {low} to {high}");
        }
    }

    #[test]
    fn differences_between_words_do_not_widen_the_interval() {
        let estimate = mean_of_strata(&[vec![1.0; 50], vec![5.0; 50]]);
        assert_eq!((estimate.low, estimate.value, estimate.high), (3.0, 3.0, 3.0));
        let once = mean_of_probabilities(&[vec![0.1], vec![0.5]]);
        assert!(
            once.value == 0.3 && once.low < 0.1 && once.high > 0.7,
            "one seed a word: {once:?}"
        );
    }

    #[test]
    fn subset_means_divide_the_line_and_few_values_say_nothing() {
        let mut means = subset_means(&[1.0, 2.0, 4.0]);
        means.sort_unstable_by(f64::total_cmp);
        assert_eq!(means, [1.0, 1.5, 2.0, 7.0 / 3.0, 2.5, 3.0, 4.0]);
        assert_eq!(least_for_center(0.95), 6);
        assert_eq!(center(&[1.0; 5], 0.95), None, "one of 32 is more than 2.5 %");
        let estimate = center(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0.95).unwrap();
        assert_eq!((estimate.low, estimate.high), (1.0, 6.0), "the first and the last of 63");
        assert_eq!(subset_means(&[2.0; 20]).len(), SUBSETS);
    }

    #[test]
    fn an_interval_beyond_the_drawn_subsets_is_wider_and_finite() {
        let values: Vec<f64> = (0..100).map(|k| 0.02 + 0.001 * f64::from(k % 10)).collect();
        let [few, many] = [300.0, 3000.0].map(|pairs| center(&values, 1.0 - 0.05 / pairs).unwrap());
        let [few_width, many_width] = [few, many].map(|interval| interval.high - interval.low);
        assert!(many_width > few_width && many_width < 2.0 * few_width, "{few:?} {many:?}");
        assert!(many.low > 0.0, "fifty contenders are told apart: {many:?}");
        assert_eq!(center(&values[..16], 1.0 - 0.05 / 3000.0), None, "16 are too few");
    }

    #[test]
    fn intervals_hold_what_they_promise() {
        // Of 300 samples of 30 uniform numbers, 95 % should have intervals with the true mean.
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let samples = (0..300).map(|_| (0..30).map(|_| rng.random()).collect());
        let estimates = samples.map(|values| mean_of_strata(&[values]));
        let hits = estimates.filter(|mean| (mean.low..=mean.high).contains(&0.5)).count();
        assert!((275..=297).contains(&hits), "{hits} of 300");
    }
}
