//! When the ranges leave a second place for a drone.
//!
//! In: a log and its located positions. Out: [`Ambiguity`]s. At every second the ranges that would
//! be measured at the located places, over the links that are heard then, are fitted from mirror
//! images and from places along the direction that is seen worst. A fit that the noise cannot tell
//! from the located places and that lies elsewhere makes the drones that it moves ambiguous: three
//! anchors or fewer, anchors in a plane, two anchors and another drone. What was heard before is
//! not used: a drone that crosses the plane of its anchors may leave on either side.
//!
//! Where the motion is known, all ranges of the log are fitted at once.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DVector, Matrix3, Vector3};
use serde::Serialize;

use super::fit::{Observation, fit, reflect, residuals};
use super::{Link, LocateOptions, Located, RangeSample};
use noctograph_core::flight::DroneIndex;
use noctograph_core::statistics::median;

/// Span of the ranges that are looked at together; more where a link is measured less than three
/// times in it.
const SPAN_S: f64 = 1.0;
/// Largest χ² of an ambiguous solution: three standard deviations.
const MAX_CHI_SQUARED: f64 = 9.0;
/// Least distance between two solutions.
const MIN_SEPARATION_M: f64 = 0.25;
/// How far along the worst direction a fit starts.
const ALONG_M: f64 = 1.0;
/// Most spans of a log that are looked at.
const MOST_SPANS: f64 = 600.0;
/// Most ranges of a log whose motion is known that are looked at.
const MOST_RANGES: usize = 400;

/// A time in which the place of a drone cannot be told from another one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ambiguity {
    /// The drone.
    pub drone: DroneIndex,
    /// From when.
    pub from_s: f64,
    /// To when.
    pub to_s: f64,
    /// Distance of the other place, the greatest of that time.
    pub apart_m: f64,
}

/// The ambiguities of positions that only ranges tell.
pub(super) fn ambiguities(
    anchors_m: &[Vector3<f64>],
    samples: &[RangeSample],
    located: &Located,
    options: &LocateOptions,
) -> Vec<Ambiguity> {
    let Some((first, last)) = samples.first().zip(samples.last()) else { return Vec::new() };
    let span_s = span_s(samples).max((last.time_s - first.time_s) / MOST_SPANS);
    let mut ambiguities: Vec<Ambiguity> = Vec::new();
    let mut left = samples;
    while let Some(begin) = left.first() {
        let end_s = begin.time_s + span_s;
        let (span, rest) = left.split_at(left.partition_point(|s| s.time_s < end_s).max(1));
        left = rest;
        let to_s = rest.first().map_or(last.time_s, |next| next.time_s);
        // What is left at the end is too short to hold all links.
        if to_s - begin.time_s < 0.5 * span_s {
            break;
        }
        let middle_s = 0.5 * (begin.time_s + span[span.len() - 1].time_s);
        let after = located.time_s.partition_point(|t| *t < middle_s);
        let mut counts: BTreeMap<Link, f64> = BTreeMap::new();
        span.iter().for_each(|sample| *counts.entry(sample.link).or_default() += 1.0);
        let range =
            |(link, n): (Link, f64)| Observation::new(link, 0.0, n.sqrt() / options.range_sigma_m);
        let ranges = counts.into_iter().map(range);
        let (ranges, places_m) =
            expected(anchors_m, ranges, located, after.min(located.time_s.len() - 1));
        for (index, apart_m) in elsewhere(anchors_m, &ranges, &places_m, options) {
            let drone = DroneIndex(index);
            let before = ambiguities.iter_mut().rev().find(|a| a.drone == drone);
            match before.filter(|before| before.to_s >= begin.time_s) {
                Some(before) => {
                    (before.to_s, before.apart_m) = (to_s, before.apart_m.max(apart_m));
                }
                None => ambiguities.push(Ambiguity { drone, from_s: begin.time_s, to_s, apart_m }),
            }
        }
    }
    ambiguities
}

/// The ambiguities of positions whose changes are known.
pub(super) fn ambiguities_of_motion(
    anchors_m: &[Vector3<f64>],
    samples: &[RangeSample],
    located: &Located,
    track_m: impl Fn(usize, f64) -> Vector3<f64>,
    options: &LocateOptions,
) -> Vec<Ambiguity> {
    let Some((first, last)) = samples.first().zip(samples.last()) else { return Vec::new() };
    let Some(end) = located.time_s.len().checked_sub(1) else { return Vec::new() };
    let end_s = located.time_s[end];
    let step = samples.len().div_ceil(MOST_RANGES);
    let weight = (step as f64).sqrt() / options.range_sigma_m;
    let range = |sample: &RangeSample| {
        let mut moved_m = [Vector3::zeros(); 2];
        for (drone, moved) in sample.link.drones().zip(&mut moved_m) {
            *moved = track_m(drone, sample.time_s) - track_m(drone, end_s);
        }
        Observation { moved_m, ..Observation::new(sample.link, 0.0, weight) }
    };
    let ranges = samples.iter().step_by(step).map(range);
    let (ranges, places_m) = expected(anchors_m, ranges, located, end);
    let (from_s, to_s) = (first.time_s, last.time_s);
    let others_m = elsewhere(anchors_m, &ranges, &places_m, options).into_iter();
    let ambiguity =
        |(index, apart_m)| Ambiguity { drone: DroneIndex(index), from_s, to_s, apart_m };
    others_m.map(ambiguity).collect()
}

/// The span in which every link is measured, as a rule.
fn span_s(samples: &[RangeSample]) -> f64 {
    let mut last_s: BTreeMap<Link, f64> = BTreeMap::new();
    let pauses = samples.iter().filter_map(|sample| {
        let before_s = last_s.insert(sample.link, sample.time_s)?;
        Some(sample.time_s - before_s)
    });
    median(pauses).map_or(SPAN_S, |pause_s| SPAN_S.max(3.0 * pause_s))
}

/// The ranges as they would be at the places that are located at an index, and these places.
fn expected(
    anchors_m: &[Vector3<f64>],
    ranges: impl Iterator<Item = Observation>,
    located: &Located,
    index: usize,
) -> (Vec<Observation>, DVector<f64>) {
    let places = located.position_m.iter().flat_map(|places_m| places_m[index].data.0[0]);
    let places_m = DVector::from_iterator(3 * located.position_m.len(), places);
    let mut ranges: Vec<Observation> = ranges.collect();
    let (_, missing) = residuals(anchors_m, &ranges, &places_m);
    for (range, missing) in ranges.iter_mut().zip(missing.iter()) {
        range.distance_m = -missing / range.weight;
    }
    (ranges, places_m)
}

/// The drones for which another place fits the ranges as well, and how far it is.
fn elsewhere(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    places_m: &DVector<f64>,
    options: &LocateOptions,
) -> BTreeMap<usize, f64> {
    let heard: BTreeSet<usize> = ranges.iter().flat_map(|range| range.link.drones()).collect();
    let mut farthest_m: BTreeMap<usize, f64> = BTreeMap::new();
    for from in others(anchors_m, ranges, places_m, &heard) {
        let (cost, other_m) = fit(anchors_m, ranges, from);
        let is_outside =
            options.room.is_some_and(|room| room.holds_all(places_m) && !room.holds_all(&other_m));
        if cost > MAX_CHI_SQUARED || is_outside {
            continue;
        }
        for drone in &heard {
            let at = |p: &DVector<f64>| p.fixed_rows::<3>(3 * drone).into_owned();
            let apart_m = (at(&other_m) - at(places_m)).norm();
            if apart_m > MIN_SEPARATION_M {
                let before_m = farthest_m.entry(*drone).or_default();
                *before_m = before_m.max(apart_m);
            }
        }
    }
    farthest_m
}

/// Places at which a fit may find another solution: the mirror images of each drone, alone behind
/// what it measures and together behind their anchors, and places along the worst direction.
fn others(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    places_m: &DVector<f64>,
    heard: &BTreeSet<usize>,
) -> Vec<DVector<f64>> {
    let at = |drone: usize| places_m.fixed_rows::<3>(3 * drone).into_owned();
    let mut starts_m = Vec::new();
    let mirrored = |drones: &[usize], ends_m: &[Vector3<f64>]| {
        let (middle_m, normal) = plane(ends_m)?;
        let mut p = places_m.clone();
        drones.iter().for_each(|drone| reflect(&mut p, *drone, &middle_m, &normal));
        Some(p)
    };
    let mut all_anchors = BTreeSet::new();
    for drone in heard {
        let (mut anchors, mut ends_m) = (Vec::new(), Vec::new());
        for range in ranges {
            match range.link {
                Link::Anchor { drone: own, anchor } if own == *drone => {
                    anchors.push(anchors_m[anchor]);
                    all_anchors.insert(anchor);
                }
                Link::Drones(i, j) if i == *drone => ends_m.push(at(j)),
                Link::Drones(i, j) if j == *drone => ends_m.push(at(i)),
                _ => {}
            }
        }
        starts_m.extend(mirrored(&[*drone], &anchors));
        ends_m.extend(anchors);
        starts_m.extend(mirrored(&[*drone], &ends_m));
    }
    if heard.len() > 1 {
        let ends_m: Vec<Vector3<f64>> = all_anchors.iter().map(|k| anchors_m[*k]).collect();
        let drones: Vec<usize> = heard.iter().copied().collect();
        starts_m.extend(mirrored(&drones, &ends_m));
    }
    // The drones that are not heard would be the worst direction.
    let slopes = residuals(anchors_m, ranges, places_m).0;
    let rows: Vec<usize> = heard.iter().flat_map(|d| 3 * d..3 * d + 3).collect();
    let slopes = slopes.select_columns(&rows);
    let eigen = (slopes.transpose() * &slopes).symmetric_eigen();
    let worst = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    for along_m in [-ALONG_M, ALONG_M] {
        let mut p = places_m.clone();
        rows.iter().zip(worst.iter()).for_each(|(row, part)| p[*row] += along_m * part);
        starts_m.push(p);
    }
    starts_m
}

/// A point and the normal of the plane nearest to three points or more.
fn plane(points_m: &[Vector3<f64>]) -> Option<(Vector3<f64>, Vector3<f64>)> {
    if points_m.len() < 3 {
        return None;
    }
    let middle_m = points_m.iter().sum::<Vector3<f64>>() / points_m.len() as f64;
    let away = points_m.iter().map(|point| point - middle_m);
    let spread: Matrix3<f64> = away.map(|away| away * away.transpose()).sum();
    let eigen = spread.symmetric_eigen();
    Some((middle_m, eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()))
}
