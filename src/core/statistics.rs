//! Medians and quantiles.

use std::cmp::Ordering;

/// Returns the median of values, or `None` without values. For an even number of values, the median
/// is the upper of the two middle values.
pub fn median<T: Copy + PartialOrd>(values: impl IntoIterator<Item = T>) -> Option<T> {
    let mut values: Vec<T> = values.into_iter().collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let (_, median, _) =
        values.select_nth_unstable_by(middle, |a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    Some(*median)
}

/// Sorts pairs of a value and its weight, and returns the weighted quantile in the unit of the
/// values, which is the smallest value at which the cumulative weight reaches a fraction of the
/// total. Returns `None` without pairs.
pub fn weighted_quantile(pairs: &mut [(f64, f64)], fraction: f64) -> Option<f64> {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let wanted = fraction * pairs.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut cumulative = 0.0;
    for (value, weight) in pairs {
        cumulative += *weight;
        if cumulative >= wanted {
            return Some(*value);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_is_the_upper_middle_and_quantiles_follow_the_weight() {
        assert_eq!(median([3, 1, 4, 2]), Some(3));
        assert_eq!(median::<f64>([]), None);
        let mut pairs = [(2.0, 1.0), (5.0, 6.0), (1.0, 3.0)];
        let actual = [0.2, 0.4, 0.5].map(|share| weighted_quantile(&mut pairs, share));
        assert_eq!(actual, [Some(1.0), Some(2.0), Some(5.0)]);
    }
}
