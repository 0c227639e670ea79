//! Removes duplicate ranges between drones, which both drones may log.

use std::collections::BTreeMap;

use super::{Link, RangeSample};

/// Maximum differences between two logs of the same range, in s and m. Logs round to millimeters.
const SAME_S: f64 = 0.1;
const SAME_M: f64 = 5.1e-4;

/// Returns the samples with each range between two drones only once. `Link::Drones(i, j)` is a
/// range in the log of drone i. The copy in drone j's log is dropped if time and distance agree.
pub(super) fn without_duplicates(samples: &[RangeSample]) -> Vec<RangeSample> {
    let mut first_logs: BTreeMap<(usize, usize), Vec<(f64, f64)>> = BTreeMap::new();
    for sample in samples {
        // Ranges in the log of the drone with the lower index are kept.
        if let Link::Drones(i, j) = sample.link
            && i < j
        {
            first_logs.entry((i, j)).or_default().push((sample.time_s, sample.distance_m));
        }
    }
    first_logs.values_mut().for_each(|ranges| ranges.sort_by(|a, b| a.0.total_cmp(&b.0)));
    let mut kept = Vec::new();
    for sample in samples {
        // The other log contains the same range if time and distance agree within rounding.
        let Link::Drones(i, j) = sample.link else {
            kept.push(*sample);
            continue;
        };
        let ranges = first_logs.get(&(j, i)).map_or(&[][..], Vec::as_slice);
        let from = ranges.partition_point(|(time_s, _)| *time_s < sample.time_s - SAME_S);
        let mut near = ranges[from..].iter().take_while(|(t, _)| *t <= sample.time_s + SAME_S);
        if !near.any(|(_, distance_m)| (distance_m - sample.distance_m).abs() <= SAME_M) {
            kept.push(RangeSample { link: Link::between(i, j), ..*sample });
        }
    }
    kept
}

/// Removes the ranges between two drones from before both have a range to an anchor, because one
/// log may start earlier.
pub(super) fn remove_before_both_logs(samples: &mut Vec<RangeSample>) {
    let mut begins_s: BTreeMap<usize, f64> = BTreeMap::new();
    for sample in &*samples {
        if let Link::Anchor { drone, .. } = sample.link {
            let begin_s = begins_s.entry(drone).or_insert(f64::INFINITY);
            *begin_s = begin_s.min(sample.time_s);
        }
    }
    // A pair's ranges are kept from the start of the later log.
    samples.retain(|sample| {
        let mut begins_s = sample.link.drones().filter_map(|drone| begins_s.get(&drone));
        begins_s.all(|begin_s| sample.time_s >= *begin_s)
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_in_both_logs_counts_once_and_two_measurements_twice() {
        let sample = |time_s, link, distance_m| RangeSample { time_s, link, distance_m };
        let there = sample(1.0, Link::Drones(0, 1), 2.3456);
        let back = |time_s, distance_m| sample(time_s, Link::Drones(1, 0), distance_m);
        let anchor = sample(1.0, Link::Anchor { drone: 1, anchor: 0 }, 2.3456);
        let all = [back(1.02, 2.346), there, anchor, back(1.0, 2.36), back(1.5, 2.3456)];
        let kept = without_duplicates(&all);
        let left: Vec<(f64, f64)> = kept.iter().map(|s| (s.time_s, s.distance_m)).collect();
        assert_eq!(left, [(1.0, 2.3456), (1.0, 2.3456), (1.0, 2.36), (1.5, 2.3456)]);
        let drones = kept.iter().filter(|s| s.link == Link::Drones(0, 1)).count();
        assert_eq!(drones, 3, "one link, whatever the log: {kept:?}");
    }
}
