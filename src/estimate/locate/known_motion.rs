//! Positions from a log whose motion is known, by the observers that need it.
//!
//! In: anchors, ranges, and the motion of all drones. Out: [`Located`] as in flight: no later range
//! improves an earlier position. [`locate_enlarged`] needs no start: it begins anywhere among the
//! anchors, and after five seconds hands over to an extended Kalman filter. [`locate_shared`] is the
//! observer of two drones that share an anchor as its authors left it: from a start of its own, and
//! without a covariance.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};

use super::mirror::ambiguities_of_motion;
use super::pass::together;
use super::smoother::{checked, heard_s};
use super::{
    Enlarged, FiveRanges, Link, LocateOptions, Located, Positions, RangeSample,
    SharedAnchorObserver, shared_anchor,
};
use crate::error::{Error, Result};

/// Time of the hand-over.
const HAND_OVER_S: f64 = 5.0;
/// Walk of the error of the known motion, m/√s: velocities of an on-board estimate.
const MOTION_SIGMA_M_SQRT_S: f64 = 0.05;
/// Gain of the authors' observer, 1/(m² s).
const GAIN: f64 = 0.03;

/// The motion of a drone: where it has moved since its log began.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    time_s: Vec<f64>,
    moved_m: Vec<Vector3<f64>>,
}

impl Track {
    /// The motion with velocities in the world at rising times.
    pub fn new(velocities_m_s: impl IntoIterator<Item = (f64, Vector3<f64>)>) -> Self {
        let (mut track, mut before) = (Self::default(), None);
        for (time_s, velocity_m_s) in velocities_m_s {
            let step_m = before.map_or(Vector3::zeros(), |(then_s, then_m_s)| {
                (velocity_m_s + then_m_s) * (0.5 * (time_s - then_s))
            });
            let last_m = track.moved_m.last().copied().unwrap_or_default();
            track.time_s.push(time_s);
            track.moved_m.push(last_m + step_m);
            before = Some((time_s, velocity_m_s));
        }
        track
    }

    /// Between two velocities on a line; before the first and after the last at rest.
    fn moved_m(&self, time_s: f64) -> Vector3<f64> {
        let after = self.time_s.partition_point(|t| *t <= time_s);
        let Some(before) = after.checked_sub(1) else { return Vector3::zeros() };
        let (a_m, a_s) = (self.moved_m[before], self.time_s[before]);
        let Some((b_m, b_s)) = self.moved_m.get(after).zip(self.time_s.get(after)) else {
            return a_m;
        };
        a_m + (b_m - a_m) * ((time_s - a_s) / (b_s - a_s))
    }
}

/// Motion of all drones between two times.
fn moved_m(tracks: &[Track], from_s: f64, to_s: f64) -> Vec<Vector3<f64>> {
    tracks.iter().map(|track| track.moved_m(to_s) - track.moved_m(from_s)).collect()
}

/// The linear filter before the hand-over, the extended Kalman filter after it.
enum Stage {
    First(Enlarged),
    Second(Positions),
}

impl Stage {
    fn at(&self, drone: usize) -> (Vector3<f64>, Matrix3<f64>) {
        match self {
            Self::First(filter) => filter.at(drone),
            Self::Second(filter) => filter.at(drone),
        }
    }
}

/// Positions by the enlarged linear filter, handed over to an extended Kalman filter.
///
/// # Errors
///
/// [`Error::Input`] for a range that is no distance, and for a link without its end.
pub fn locate_enlarged(
    anchors_m: &[Vector3<f64>],
    tracks: &[Track],
    samples: &[RangeSample],
    options: &LocateOptions,
) -> Result<Located> {
    let samples = checked(anchors_m, tracks.len(), samples)?;
    let low_m = anchors_m.iter().fold(Vector3::repeat(f64::INFINITY), |a, b| a.inf(b));
    let high_m = anchors_m.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |a, b| a.sup(b));
    let Some(mut before_s) = samples.first().map(|first| first.time_s) else {
        return Err(Error::input("ranges", "none", "a range", "log the ranges of the flight"));
    };
    let hand_over_s = before_s + HAND_OVER_S;
    let starts_m = vec![(low_m + high_m) * 0.5; tracks.len()];
    let reach_m = (high_m - low_m).norm().max(1.0);
    let mut stage = Stage::First(Enlarged::new(anchors_m, &starts_m, reach_m));
    let mut located = Located::empty(tracks.len());
    let (mut nis, mut taken, mut refused) = (0.0, 0.0, BTreeMap::new());
    for step in together(&samples) {
        let time_s = step[0].time_s;
        let moved_m = moved_m(tracks, before_s, time_s);
        let variance_m2 = MOTION_SIGMA_M_SQRT_S * MOTION_SIGMA_M_SQRT_S * (time_s - before_s);
        before_s = time_s;
        match &mut stage {
            Stage::First(filter) => filter.advance(&moved_m, variance_m2),
            Stage::Second(filter) => filter.advance(&moved_m, variance_m2),
        }
        if let Stage::First(filter) = &stage
            && time_s >= hand_over_s
        {
            stage = Stage::Second(filter.positions(None, options.gate_sigmas));
        }
        for sample in step {
            let (link, distance_m, sigma_m) =
                (sample.link, sample.distance_m, options.range_sigma_m);
            match &mut stage {
                Stage::First(filter) => filter.correct(link, distance_m, sigma_m),
                Stage::Second(filter) => match filter.correct(link, distance_m, sigma_m) {
                    Some(one) => (nis, taken) = (nis + one, taken + 1.0),
                    None => *refused.entry(link).or_default() += 1,
                },
            }
        }
        located.push(time_s, |drone| stage.at(drone));
    }
    located.nis = (taken > 0.0).then(|| nis / taken);
    located.heard_s = heard_s(tracks.len(), &samples);
    let moved_m = |drone: usize, time_s| tracks[drone].moved_m(time_s);
    located.ambiguities = ambiguities_of_motion(anchors_m, &samples, &located, moved_m, options);
    located.note_residuals(anchors_m, &samples, &refused, options.range_sigma_m);
    located.warnings = located.contradictions(options.range_sigma_m);
    Ok(located)
}

/// Positions of two drones by the observer of the shared anchor, from starts near the truth. Ranges
/// are held until the next one of their link.
///
/// # Errors
///
/// As [`locate_enlarged`], and [`Error::Input`] for other links than two anchors a drone, one of them
/// the same, and the range between the drones.
pub fn locate_shared(
    anchors_m: &[Vector3<f64>],
    tracks: &[Track; 2],
    starts_m: [Vector3<f64>; 2],
    samples: &[RangeSample],
) -> Result<Located> {
    let samples = checked(anchors_m, 2, samples)?;
    let mut heard = [BTreeSet::new(), BTreeSet::new()];
    let mut between = false;
    for sample in &samples {
        match sample.link {
            Link::Anchor { drone, anchor } => _ = heard[drone].insert(anchor),
            Link::Drones(..) => between = true,
        }
    }
    let heard = heard.map(|anchors| anchors.into_iter().collect::<Vec<_>>());
    let Some([own1, own2, shared]) = shared_anchor(&heard).filter(|_| between) else {
        let wanted = "two anchors a drone, one of them the same, and the range between the drones";
        let found = format!("anchors {:?} and {:?}", heard[0], heard[1]);
        return Err(Error::input("ranges", found, wanted, "take --observer smooth or enlarged"));
    };
    let own_m = [anchors_m[own1], anchors_m[own2]];
    let observer = SharedAnchorObserver { own_m, shared_m: anchors_m[shared], gains: [GAIN; 2] };
    let mut held = [None; 5];
    let mut at_m = starts_m;
    let mut before_s = samples.first().map_or(0.0, |first| first.time_s);
    let mut located = Located::empty(2);
    for step in together(&samples) {
        let time_s = step[0].time_s;
        let moved_m = moved_m(tracks, before_s, time_s);
        for sample in step {
            let slot = match sample.link {
                Link::Drones(..) => 4,
                Link::Anchor { drone, anchor } if anchor == shared => 2 + drone,
                Link::Anchor { drone, .. } => drone,
            };
            held[slot] = Some(sample.distance_m);
        }
        let corrections = match held {
            [Some(a), Some(b), Some(c), Some(d), Some(between_m)] => {
                let ranges = FiveRanges { own_m: [a, b], shared_m: [c, d], between_m };
                observer.corrections(&at_m, &observer.outputs(&ranges))
            }
            _ => [Vector3::zeros(); 2],
        };
        for drone in 0..2 {
            at_m[drone] += moved_m[drone] + corrections[drone] * (time_s - before_s);
        }
        before_s = time_s;
        located.push(time_s, |drone| (at_m[drone], Matrix3::zeros()));
    }
    located.covariance_m2.clear();
    located.heard_s = heard_s(2, &samples);
    // It knows no noise: each link's own scatter is the scale.
    located.note_residuals(anchors_m, &samples, &BTreeMap::new(), 0.0);
    Ok(located)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::locate::tests::{FIVE_LINKS, GEOMETRIES, Random, path};

    /// Anchors, motion along the word, and ranges of the five links in turn, 200 a second.
    fn flight(sigma_m: f64) -> ([Vector3<f64>; 3], [Track; 2], Vec<RangeSample>) {
        let (anchors_m, place, mut random) =
            (GEOMETRIES[0].1.map(Vector3::from), path(), Random(3));
        let track = |drone: usize| {
            let speed = |k: u32| {
                let time_s = f64::from(k) * 0.01;
                (time_s, (place(drone, time_s + 1e-4) - place(drone, time_s - 1e-4)) / 2e-4)
            };
            Track::new((0..2000).map(speed))
        };
        let tracks = [track(0), track(1)];
        let sample = |k: u32| {
            let (time_s, link) = (f64::from(k) * 0.005, FIVE_LINKS[k as usize % 5]);
            let true_m = link.away_m(&anchors_m, |drone| place(drone, time_s)).norm();
            RangeSample { time_s, link, distance_m: true_m + sigma_m * random.normal() }
        };
        (anchors_m, tracks, (0..4000).map(sample).collect())
    }

    fn off_m(found: &Located, place: impl Fn(usize, f64) -> Vector3<f64>) -> f64 {
        let last = found.time_s.len() - 1;
        let off = |d: usize| found.position_m[d][last] - place(d, found.time_s[last]);
        off(0).norm().max(off(1).norm())
    }

    #[test]
    fn five_links_and_the_motion_place_two_drones_without_a_start() {
        let (anchors_m, tracks, samples) = flight(0.06);
        let options = LocateOptions { range_sigma_m: 0.06, ..Default::default() };
        let found = locate_enlarged(&anchors_m, &tracks, &samples, &options).unwrap();
        let off_m = off_m(&found, path());
        assert!(off_m < 0.25, "{off_m} m");
        assert!(found.nis.is_some_and(|nis| (0.5..1.3).contains(&nis)), "NIS {:?}", found.nis);
        assert!(found.refused_frac < 0.01, "{}", found.refused_frac);
    }

    #[test]
    fn the_shared_anchor_observer_keeps_a_true_start_and_wants_its_five_links() {
        let (anchors_m, tracks, samples) = flight(0.0);
        let place = path();
        let starts_m = [place(0, 0.0), place(1, 0.0)];
        let found = locate_shared(&anchors_m, &tracks, starts_m, &samples).unwrap();
        // Ranges are held for up to 25 ms.
        let off_m = off_m(&found, place);
        assert!(off_m < 0.06, "{off_m} m");
        assert!(found.covariance_m2.is_empty());
        let no_range: Vec<_> =
            samples.into_iter().filter(|s| s.link != Link::Drones(0, 1)).collect();
        let error = locate_shared(&anchors_m, &tracks, starts_m, &no_range).unwrap_err();
        assert!(error.to_string().contains("the range between the drones"), "{error}");
    }
}
