//! Ranges between drones, which two logs may hold.

use std::collections::BTreeMap;

use super::{Link, RangeSample};

/// Stamps of one range in two logs, s, and its distances, m: logs round to millimeters.
const SAME_S: f64 = 0.1;
const SAME_M: f64 = 5.1e-4;

/// The samples with every range between two drones once. `Link::Drones(i, j)` is a range in the log
/// of drone i; where the log of drone j has it too, that one is left out. Two ranges that differ
/// are two measurements.
pub(super) fn counted_once(samples: &[RangeSample]) -> Vec<RangeSample> {
    let mut first_logs: BTreeMap<(usize, usize), Vec<(f64, f64)>> = BTreeMap::new();
    for sample in samples {
        if let Link::Drones(i, j) = sample.link
            && i < j
        {
            first_logs.entry((i, j)).or_default().push((sample.time_s, sample.distance_m));
        }
    }
    first_logs.values_mut().for_each(|ranges| ranges.sort_by(|a, b| a.0.total_cmp(&b.0)));
    let is_copy = |sample: &RangeSample| {
        let Link::Drones(i, j) = sample.link else { return false };
        let Some(ranges) = first_logs.get(&(j, i)) else { return false };
        let from = ranges.partition_point(|(time_s, _)| *time_s < sample.time_s - SAME_S);
        let near = ranges[from..].iter().take_while(|(t, _)| *t <= sample.time_s + SAME_S);
        near.into_iter().any(|(_, distance_m)| (distance_m - sample.distance_m).abs() <= SAME_M)
    };
    let link = |link: Link| match link {
        Link::Drones(i, j) => Link::between(i, j),
        to_anchor @ Link::Anchor { .. } => to_anchor,
    };
    let kept = samples.iter().filter(|sample| !is_copy(sample));
    kept.map(|sample| RangeSample { link: link(sample.link), ..*sample }).collect()
}

/// Leaves out the ranges of a pair before the log of either drone begins with a range to an anchor:
/// the other drone's log may be longer.
pub(super) fn since_both_are_logged(samples: &mut Vec<RangeSample>) {
    let mut begins_s: BTreeMap<usize, f64> = BTreeMap::new();
    for sample in &*samples {
        if let Link::Anchor { drone, .. } = sample.link {
            let begin_s = begins_s.entry(drone).or_insert(f64::INFINITY);
            *begin_s = begin_s.min(sample.time_s);
        }
    }
    let begun =
        |drone: usize, time_s| begins_s.get(&drone).is_none_or(|begin_s| time_s >= *begin_s);
    let is_kept = |sample: &RangeSample| match sample.link {
        Link::Drones(i, j) => begun(i, sample.time_s) && begun(j, sample.time_s),
        Link::Anchor { .. } => true,
    };
    samples.retain(is_kept);
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
        let kept = counted_once(&all);
        let left: Vec<(f64, f64)> = kept.iter().map(|s| (s.time_s, s.distance_m)).collect();
        assert_eq!(left, [(1.0, 2.3456), (1.0, 2.3456), (1.0, 2.36), (1.5, 2.3456)]);
        let drones = kept.iter().filter(|s| s.link == Link::Drones(0, 1)).count();
        assert_eq!(drones, 3, "one link, whatever the log: {kept:?}");
    }
}
