//! Statistics of flights: means, tails and how sure they are.
//!
//! Method: percentile bootstrap within strata (a word's flights are drawn anew among themselves),
//! with a fixed seed, so that an interval is a function of its values alone. Source: Efron,
//! Tibshirani, "An Introduction to the Bootstrap" (1993), chapters 6, 8 and 13.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Serialize;

/// Samples that are drawn anew. The ends of a 95 % interval then rest on 50 of them.
const RESAMPLES: usize = 2000;

/// A figure and the interval in which it lies at a stated level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The figure of all values.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimate {
    /// Whether nothing lies in the interval.
    #[must_use]
    pub fn is_not_zero(&self) -> bool {
        self.low > 0.0 || self.high < 0.0
    }
}

/// Mean; 0 of nothing.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
    let n = values.len().max(1) as f64;
    values.iter().sum::<f64>() / n
}

/// Standard error of the mean; 0 of fewer than two values.
#[must_use]
pub fn standard_error(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: Vec<f64> = values.iter().map(|v| (v - middle) * (v - middle)).collect();
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
    let n = values.len() as f64;
    if n < 2.0 { 0.0 } else { (mean(&squares) / (n - 1.0)).sqrt() }
}

/// Mean of the lowest tenth, at least of one value; 0 of nothing. Sorts the values.
#[must_use]
pub fn worst_decile(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    mean(&values[..values.len().div_ceil(10)])
}

/// The middle value of those in order; 0 of nothing. Sorts the values.
#[must_use]
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// A statistic of all values together, with its interval at `level` (0.95: two and a half percent lie
/// beyond either end).
#[must_use]
pub fn bootstrap(
    strata: &[Vec<f64>],
    level: f64,
    statistic: impl Fn(&mut [f64]) -> f64,
) -> Estimate {
    let mut values: Vec<f64> = strata.concat();
    let value = statistic(&mut values);
    if values.len() < 2 {
        return Estimate { value, low: value, high: value };
    }
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut drawn: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            values.clear();
            for stratum in strata {
                values.extend(stratum.iter().map(|_| stratum[rng.random_range(0..stratum.len())]));
            }
            statistic(&mut values)
        })
        .collect();
    drawn.sort_unstable_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        reason = "within the samples"
    )]
    let at = |share: f64| drawn[((share * RESAMPLES as f64) as usize).min(RESAMPLES - 1)];
    let beyond = 0.5 * (1.0 - level);
    Estimate { value, low: at(beyond), high: at(1.0 - beyond) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_and_middles_are_those_of_the_values() {
        let mut values: Vec<f64> = (1..=20).map(f64::from).rev().collect();
        assert_eq!((worst_decile(&mut values), median(&mut values)), (1.5, 10.5));
        assert_eq!((mean(&values), mean(&[]), median(&mut [])), (10.5, 0.0, 0.0));
        assert_eq!(worst_decile(&mut [3.0]), 3.0);
    }

    #[test]
    fn the_interval_of_a_mean_is_that_of_the_normal_law() {
        // Standard error of 0 … 399: 115.47 / 20 = 5.77, times 1.96.
        let values: Vec<f64> = (0..400).map(f64::from).collect();
        let found = bootstrap(&[values], 0.95, |v| mean(v));
        assert_eq!(found.value, 199.5);
        assert!((found.high - found.value - 11.3).abs() < 0.7, "{found:?}");
        assert!((found.value - found.low - 11.3).abs() < 0.7, "{found:?}");
    }

    #[test]
    fn what_differs_between_words_alone_does_not_widen_the_interval() {
        let strata = [vec![1.0; 50], vec![5.0; 50]];
        let found = bootstrap(&strata, 0.95, |v| mean(v));
        assert_eq!((found.low, found.value, found.high), (3.0, 3.0, 3.0));
    }

    #[test]
    fn intervals_hold_what_they_promise() {
        // 300 samples of 30 uniform numbers: 95 % of the intervals hold the true mean, within what
        // the bootstrap's known shortness and chance allow.
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let hits = (0..300)
            .filter(|_| {
                let values: Vec<f64> = (0..30).map(|_| rng.random()).collect();
                let found = bootstrap(&[values], 0.95, |v| mean(v));
                found.low <= 0.5 && 0.5 <= found.high
            })
            .count();
        assert!((270..=297).contains(&hits), "{hits} of 300");
    }
}
