//! Medians, quantiles, and values in the order of a number.

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
    sort_by_number(pairs, |pair| pair.0);
    let threshold = fraction * pairs.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut cumulative = 0.0;
    for (value, weight) in pairs {
        cumulative += *weight;
        if cumulative >= threshold {
            return Some(*value);
        }
    }
    None
}

/// Sorts values by a number, in the total order of IEEE 754. Equal numbers keep their order.
///
/// Values of all types are sorted by the same code, because a separate sort for each type would
/// enlarge the page's module by a fiftieth.
pub fn sort_by_number<T>(values: &mut [T], number: impl Fn(&T) -> f64) {
    let numbers = values.iter().enumerate().map(|(index, value)| (number(value), index));
    let mut order: Vec<(f64, usize)> = numbers.collect();
    sort_pairs(&mut order);
    for place in 0..values.len() {
        // If an earlier swap took the value from its index, the entry at this index says where the
        // value went.
        let mut index = order[place].1;
        while index < place {
            index = order[index].1;
        }
        order[place].1 = index;
        values.swap(place, index);
    }
}

/// Sorts pairs of a number and an index by their numbers. Equal numbers keep their order.
#[inline(never)]
fn sort_pairs(pairs: &mut [(f64, usize)]) {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
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

    #[test]
    fn values_are_sorted_as_by_a_stable_sort() {
        // Numbers with repetitions, in an order without one, and an order that moves all by one.
        let mixed = (0..200_u32).map(|n| (f64::from(n * n * 7919 % 101 % 23) - 9.0, n));
        let moved = (0..200_u32).map(|n| (f64::from((n + 199) % 200), n));
        for values in [
            mixed.collect::<Vec<_>>(),
            moved.collect(),
            vec![(f64::NAN, 0), (-0.0, 1), (0.0, 2), (-0.0, 3)],
        ] {
            let (mut actual, mut wanted) = (values.clone(), values);
            sort_by_number(&mut actual, |value| -value.0);
            wanted.sort_by(|a, b| b.0.total_cmp(&a.0));
            assert_eq!(format!("{actual:?}"), format!("{wanted:?}"));
        }
    }
}
