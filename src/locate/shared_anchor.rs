//! Implements the published observer of two drones with a common anchor.
//!
//! Drone i measures the ranges to an anchor `a_i` and to the common anchor `a_3`. The range between
//! the drones is q. With `C_i` = `a_3` − `a_i`, the squared ranges give the outputs and the
//! observer:
//!
//! ```text
//! y_1i = d_ii² − d_i3² + |a_3|² − |a_i|² = 2 C_iᵀ p_i
//! y_2  = d_13² + d_23² − q² − 2 |a_3|²   = 2 p_1ᵀ p_2 − 2 a_3ᵀ (p_1 + p_2)
//! dp̂_i/dt = v_i + γ_i C_i (y_1i − 2 C_iᵀ p̂_i)
//!     + γ_i (p̂_j − a_3) (y_2 + 2 a_3ᵀ(p̂_1 + p̂_2) − 2 p̂_1ᵀ p̂_2)
//! ```
//!
//! The rate of V = `½|p̃_1|²` + `½μ|p̃_2|²` is a quadratic form, at best negative semidefinite,
//! plus cubic terms. The observer performs gradient descent on three squared residuals. At any
//! instant these determine only three of the six coordinates, although there are five ranges.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::pass::{Innovations, time_steps};
use super::smoother::{checked, heard_s};
use super::track::moved_m;
use super::{Link, Located, RangeSample, Track};
use noctograph_core::error::{Error, Result};

/// Gain of the authors' observer, 1/(m² s).
const GAIN: f64 = 0.03;

/// Observer of two drones with a common anchor.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedAnchorObserver {
    /// Position of the anchor that only one drone receives, for each drone.
    pub own_m: [Vector3<f64>; 2],
    /// Position of the anchor that both drones receive.
    pub shared_m: Vector3<f64>,
    /// Gains `γ_i`, 1/(m² s).
    pub gains: [f64; 2],
}

/// Five ranges of two drones with a shared anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiveRanges {
    /// Distance between each drone and the anchor that only it receives.
    pub own_m: [f64; 2],
    /// Distance between each drone and the shared anchor.
    pub shared_m: [f64; 2],
    /// Distance between the drones.
    pub between_m: f64,
}

/// Returns the indices of the anchor that only the first drone receives, of the one that only the
/// second drone receives, and of the shared one. Returns `None` unless each of two drones receives
/// two anchors, of which exactly one is shared.
pub fn shared_anchor(heard: &[Vec<usize>]) -> Option<[usize; 3]> {
    let [one, two] = heard else { return None };
    if one.len() != 2 || two.len() != 2 {
        return None;
    }
    let shared = *one.iter().find(|anchor| two.contains(anchor))?;
    let [own1, own2] =
        [one, two].map(|heard| heard.iter().copied().find(|anchor| *anchor != shared));
    Some([own1?, own2?, shared]).filter(|[a, b, _]| a != b)
}

impl SharedAnchorObserver {
    /// Returns the true ranges in m of drones at `positions_m`.
    pub fn ranges(&self, positions_m: &[Vector3<f64>; 2]) -> FiveRanges {
        FiveRanges {
            own_m: [0, 1].map(|i| (positions_m[i] - self.own_m[i]).norm()),
            shared_m: positions_m.map(|p| (p - self.shared_m).norm()),
            between_m: (positions_m[0] - positions_m[1]).norm(),
        }
    }

    /// Returns the outputs `y_11`, `y_12` and `y_2` in m², which are linear in the positions except
    /// for the product of both.
    pub fn outputs(&self, ranges: &FiveRanges) -> [f64; 3] {
        let [own_m2, common_m2] = [ranges.own_m, ranges.shared_m].map(|pair| pair.map(|d| d * d));
        let between_m2 = ranges.between_m * ranges.between_m;
        let shared_sq = self.shared_m.norm_squared();
        let [one, two] =
            [0, 1].map(|i| own_m2[i] - common_m2[i] + shared_sq - self.own_m[i].norm_squared());
        [one, two, common_m2[0] + common_m2[1] - between_m2 - 2.0 * shared_sq]
    }

    /// Returns the correction of each estimate's rate, m/s, which is added to the drone's velocity.
    /// `outputs` are those of [`Self::outputs`] for the measured ranges, m².
    pub fn corrections(
        &self,
        estimates_m: &[Vector3<f64>; 2],
        outputs: &[f64; 3],
    ) -> [Vector3<f64>; 2] {
        // The corrections are gradient descent on the squared residuals, as in the formula above.
        let [p1, p2] = estimates_m;
        let shared_residual = outputs[2] + 2.0 * self.shared_m.dot(&(p1 + p2)) - 2.0 * p1.dot(p2);
        [0, 1].map(|i| {
            let c = self.shared_m - self.own_m[i];
            let residual = outputs[i] - 2.0 * c.dot(&estimates_m[i]);
            let other = estimates_m[1 - i] - self.shared_m;
            (c * residual + other * shared_residual) * self.gains[i]
        })
    }
}

/// Locates two drones with [`SharedAnchorObserver`], from starts close to the true positions. The
/// last range of each link is held until the next one.
///
/// # Errors
///
/// Returns the errors of [`super::locate_augmented`]. Returns [`Error::Input`] unless each drone
/// receives two anchors, of which one is shared, and there are ranges between the drones.
pub fn locate_shared(
    anchors_m: &[Vector3<f64>],
    tracks: &[Track; 2],
    starts_m: [Vector3<f64>; 2],
    samples: &[RangeSample],
) -> Result<Located> {
    let samples = checked(anchors_m, 2, samples)?;
    let [own1, own2, shared] = anchors_of_links(&samples)?;
    let own_m = [anchors_m[own1], anchors_m[own2]];
    let observer = SharedAnchorObserver { own_m, shared_m: anchors_m[shared], gains: [GAIN; 2] };
    // The last range of each link is kept, in the order of the observer's inputs: each drone to its
    // own anchor, each drone to the common anchor, and between the drones. Corrections begin once
    // all five links have a range.
    let mut last_ranges_m = [None; 5];
    let mut positions_m = starts_m;
    let mut before_s = samples.first().map_or(0.0, |first| first.time_s);
    let mut located = Located::empty(2);
    for step in time_steps(&samples) {
        let time_s = step[0].time_s;
        let moved_m = moved_m(tracks, before_s, time_s);
        for sample in step {
            let slot = match sample.link {
                Link::Drones(..) => 4,
                Link::Anchor { drone, anchor } if anchor == shared => 2 + drone,
                Link::Anchor { drone, .. } => drone,
            };
            last_ranges_m[slot] = Some(sample.distance_m);
        }
        let corrections = match last_ranges_m {
            [Some(a), Some(b), Some(c), Some(d), Some(between_m)] => {
                let ranges = FiveRanges { own_m: [a, b], shared_m: [c, d], between_m };
                observer.corrections(&positions_m, &observer.outputs(&ranges))
            }
            _ => [Vector3::zeros(); 2],
        };
        for drone in 0..2 {
            positions_m[drone] += moved_m[drone] + corrections[drone] * (time_s - before_s);
        }
        before_s = time_s;
        located.push(time_s, |drone| (positions_m[drone], Matrix3::zeros()));
    }
    located.covariance_m2.clear();
    located.heard_s = heard_s(2, &samples);
    Ok(located.with_residuals(anchors_m, &samples, &Innovations::default(), 0.0))
}

/// Returns the anchors as [`shared_anchor`] does. Returns [`Error::Input`] with the anchors that
/// were received if a link is missing.
fn anchors_of_links(samples: &[RangeSample]) -> Result<[usize; 3]> {
    let mut heard = [BTreeSet::new(), BTreeSet::new()];
    let mut between = false;
    for sample in samples {
        match sample.link {
            Link::Anchor { drone, anchor } => _ = heard[drone].insert(anchor),
            Link::Drones(..) => between = true,
        }
    }
    let heard = heard.map(|anchors| anchors.into_iter().collect::<Vec<_>>());
    // Without the range between the drones, the observer cannot use the shared anchor.
    shared_anchor(&heard).filter(|_| between).ok_or_else(|| {
        let wanted =
            "two anchors per drone, one of which is common to both, and the range between the \
             drones";
        let anchors = format!("anchors {:?} and {:?}", heard[0], heard[1]);
        Error::input("ranges", anchors, wanted, "choose --observer smooth or enlarged")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Random, flight, off_m, path};

    #[test]
    fn outputs_are_linear_and_bilinear_in_the_places_to_rounding() {
        let mut random = Random(1);
        for _ in 0..100 {
            let mut place = || random.vector();
            let (own_m, shared_m) = ([place(), place()], place());
            let observer = SharedAnchorObserver { own_m, shared_m, gains: [0.3, 0.7] };
            let p = [place(), place()];
            let outputs = observer.outputs(&observer.ranges(&p));
            let want = [
                2.0 * (shared_m - own_m[0]).dot(&p[0]),
                2.0 * (shared_m - own_m[1]).dot(&p[1]),
                2.0 * p[0].dot(&p[1]) - 2.0 * shared_m.dot(&(p[0] + p[1])),
            ];
            for (outputs, want) in outputs.iter().zip(want) {
                assert!((outputs - want).abs() < 1e-12 * (1.0 + want.abs()), "{outputs} {want}");
            }
            let rates = observer.corrections(&p, &outputs);
            assert!(rates[0].norm() + rates[1].norm() < 1e-11, "the truth is at rest");
        }
    }

    /// Returns the rate of V = `½|p̃_1|²` + `½μ|p̃_2|²`: its quadratic form and its remaining
    /// terms, separately.
    fn lyapunov_rate(
        observer: &SharedAnchorObserver,
        positions_m: &[Vector3<f64>; 2],
        estimates_m: &[Vector3<f64>; 2],
        weight: f64,
    ) -> f64 {
        let error = [0, 1].map(|i| positions_m[i] - estimates_m[i]);
        let true_r = positions_m.map(|p| p - observer.shared_m);
        let believed_r = estimates_m.map(|p| p - observer.shared_m);
        let rate = |i: usize| {
            let j = 1 - i;
            let gain = 2.0 * observer.gains[i] * [1.0, weight][i];
            let own = (observer.shared_m - observer.own_m[i]).dot(&error[i]);
            let other = true_r[j].dot(&error[i]);
            let mixed = believed_r[j].dot(&error[i]) * believed_r[i].dot(&error[j]);
            let extra = error[0].dot(&error[1]) * other;
            gain * (extra - (own * own + other * other + mixed))
        };
        rate(0) + rate(1)
    }

    #[test]
    fn the_lyapunov_rate_is_the_difference_quotient() {
        let mut random = Random(2);
        for _ in 0..100 {
            let mut place = || random.vector();
            let (own_m, shared_m) = ([place(), place()], place());
            let observer = SharedAnchorObserver { own_m, shared_m, gains: [0.3, 0.7] };
            let (p, e, weight) = ([place(), place()], [place(), place()], 1.3);
            let rates = observer.corrections(&e, &observer.outputs(&observer.ranges(&p)));
            let function = |h: f64| {
                let square = |i: usize| (p[i] - e[i] - rates[i] * h).norm_squared();
                0.5 * square(0) + 0.5 * weight * square(1)
            };
            let want = (function(1e-5) - function(-1e-5)) / 2e-5;
            let rate = lyapunov_rate(&observer, &p, &e, weight);
            assert!((rate - want).abs() < 1e-6 * (1.0 + want.abs()), "{rate} {want}");
        }
    }

    #[test]
    fn the_shared_anchor_observer_keeps_a_true_start_and_wants_its_five_links() {
        let (anchors_m, tracks, samples) = flight(0.0);
        let place = path();
        let starts_m = [place(0, 0.0), place(1, 0.0)];
        let located = locate_shared(&anchors_m, &tracks, starts_m, &samples).unwrap();
        // The ranges are held for up to 25 ms.
        let off_m = off_m(&located, place);
        assert!(off_m < 0.06, "{off_m} m");
        assert!(located.covariance_m2.is_empty());
        let no_range: Vec<_> =
            samples.into_iter().filter(|s| s.link != Link::Drones(0, 1)).collect();
        let error = locate_shared(&anchors_m, &tracks, starts_m, &no_range).unwrap_err();
        assert!(error.to_string().contains("the range between the drones"), "{error}");
    }
}
