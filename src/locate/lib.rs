//! Localization of drones from ranges, independent of any controller.
//!
//! [`SharedAnchorObserver`] is the published observer of two drones with a common anchor. It only
//! converges from starts close to the true positions ([`fraction_left`], [`observability`]).
//! [`Augmented`] converges from any start, and continues as [`Positions`]. Both observers require
//! the motion ([`locate_shared`], [`locate_augmented`]). [`locate`] only requires ranges.
//!
//! The filter that runs in flight is the estimator `cooperative`.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

mod augmented;
mod fit;
mod pairs;
mod pass;
mod positions;
mod reference;
mod region;
mod residuals;
mod shared_anchor;
mod smoother;
mod solve;
mod start;
mod track;

use nalgebra::{DVector, Vector3};

pub use augmented::{Augmented, locate_augmented};
pub use positions::Positions;
pub use reference::{LinkError, PositionError, Reference, link_errors, position_error};
pub use region::{FractionLeft, Observability, Outputs, fraction_left, observability};
pub use residuals::{LinkResidual, nis_interval};
pub use shared_anchor::{FiveRanges, SharedAnchorObserver, locate_shared, shared_anchor};
pub use smoother::{LocateOptions, Located, check_count, locate};
pub use track::Track;

/// Link, given by the two ends of a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Link {
    /// A drone and an anchor.
    Anchor {
        /// Index of the drone.
        drone: usize,
        /// Index of the anchor.
        anchor: usize,
    },
    /// Indices of two drones, the lower index first.
    Drones(usize, usize),
}

impl Link {
    /// Returns the link between two drones, given in any order.
    pub fn between(one: usize, other: usize) -> Self {
        Self::Drones(one.min(other), one.max(other))
    }

    /// Returns the vector from the other end of the link to its first drone. `position_m` returns
    /// the position of a drone.
    pub fn away_m(
        self,
        anchors_m: &[Vector3<f64>],
        position_m: impl Fn(usize) -> Vector3<f64>,
    ) -> Vector3<f64> {
        match self {
            Self::Anchor { drone, anchor } => position_m(drone) - anchors_m[anchor],
            Self::Drones(i, j) => position_m(i) - position_m(j),
        }
    }

    /// Returns the drones at the ends of the link.
    pub fn drones(self) -> impl Iterator<Item = usize> {
        let (first, second) = match self {
            Self::Anchor { drone, .. } => (drone, None),
            Self::Drones(i, j) => (i, Some(j)),
        };
        std::iter::once(first).chain(second)
    }
}

impl std::fmt::Display for Link {
    /// Writes the names of the drones and of the anchor, counted from 1, and the anchor's log
    /// variable.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // The firmware's variables and cfclient's files count anchors from 0.
            Self::Anchor { drone, anchor } => {
                write!(f, "drone {} to anchor {} (distance{anchor})", drone + 1, anchor + 1)
            }
            Self::Drones(i, j) => write!(f, "drones {} and {}", i + 1, j + 1),
        }
    }
}

/// Maximum plausible range, 10 km.
const MOST_DISTANCE_M: f64 = 1e4;

/// A single range in a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeSample {
    /// Time of the measurement.
    pub time_s: f64,
    /// The two ends of the range.
    pub link: Link,
    /// Measured distance.
    pub distance_m: f64,
}

impl RangeSample {
    /// True if the values are plausible for a measurement.
    fn is_measurement(&self) -> bool {
        self.distance_m > 0.0 && self.distance_m < MOST_DISTANCE_M && self.time_s.is_finite()
    }
}

/// A box that contains all drones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Minimum coordinates of the box.
    pub low_m: Vector3<f64>,
    /// Maximum coordinates of the box.
    pub high_m: Vector3<f64>,
}

impl Room {
    /// True if a position is inside the box.
    pub fn holds(&self, position_m: &Vector3<f64>) -> bool {
        (0..3).all(|k| (self.low_m[k]..=self.high_m[k]).contains(&position_m[k]))
    }

    /// True if all positions, with three coordinates each, are inside the box.
    fn holds_all(&self, positions_m: &DVector<f64>) -> bool {
        positions_m
            .as_slice()
            .chunks(3)
            .all(|position_m| self.holds(&Vector3::from_row_slice(position_m)))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{LocateOptions, Located, RangeSample, Track};
    use noctograph_core::random::split_mix;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{EvenStyle, PlanOptions, Style, fleet};

    /// Anchors in different geometries: first those that one drone receives, then the shared one.
    pub(super) const GEOMETRIES: [(&str, [[f64; 3]; 3]); 4] = [
        ("good", [[-2.5, -2.5, 2.4], [2.5, -2.5, 0.2], [0.5, 2.5, 2.4]]),
        ("wall", [[-2.5, 2.5, 0.2], [2.5, 2.5, 0.4], [0.0, 2.5, 2.4]]),
        ("line", [[-2.5, 2.5, 2.0], [2.5, 2.5, 2.0], [0.0, 2.5, 2.0]]),
        ("huddle", [[-0.5, 2.5, 1.5], [0.5, 2.5, 1.7], [0.0, 2.2, 2.2]]),
    ];

    pub(super) use super::region::FIVE_LINKS;

    impl Default for LocateOptions {
        fn default() -> Self {
            Self { range_sigma_m: 0.1, acceleration_m_s2_sqrt_hz: 1.0, smooth: true, room: None }
        }
    }

    /// Returns the designed positions of two drones while they write NOOR.
    pub(super) fn path() -> impl Fn(usize, f64) -> Vector3<f64> {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        // With the default hover and collinear anchors, 58 of 60 starts converge instead of 59.
        let style = Style::Even(EvenStyle { hover_s: 0.5, ..EvenStyle::default() });
        let plans = fleet(&strokes, &PlanOptions { drones: 2, style, ..PlanOptions::even() });
        let plans = plans.unwrap();
        move |drone, time_s| plans[drone].design_m(time_s)
    }

    /// Random number generator whose state starts as the seed.
    pub(super) struct Random(pub(super) u64);

    impl Random {
        fn uniform(&mut self) -> f64 {
            self.0 = split_mix(self.0);
            (self.0 >> 11) as f64 / 9_007_199_254_740_992.0
        }

        pub(super) fn normal(&mut self) -> f64 {
            let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
            radius * libm::cos(std::f64::consts::TAU * self.uniform())
        }

        pub(super) fn vector(&mut self) -> Vector3<f64> {
            Vector3::from_fn(|_, _| self.normal())
        }
    }

    /// Returns anchors, motion along the word, and ranges of the five links in turn, at 200 Hz.
    pub(super) fn flight(sigma_m: f64) -> ([Vector3<f64>; 3], [Track; 2], Vec<RangeSample>) {
        let (anchors_m, place, mut random) =
            (GEOMETRIES[0].1.map(Vector3::from), path(), Random(3));
        let track = |drone: usize| {
            Track::new((0..2000).map(|k: u32| {
                let time_s = f64::from(k) * 0.01;
                (time_s, (place(drone, time_s + 1e-4) - place(drone, time_s - 1e-4)) / 2e-4)
            }))
        };
        let tracks = [track(0), track(1)];
        let sample = |k: u32| {
            let (time_s, link) = (f64::from(k) * 0.005, FIVE_LINKS[k as usize % 5]);
            let true_m = link.away_m(&anchors_m, |drone| place(drone, time_s)).norm();
            RangeSample { time_s, link, distance_m: true_m + sigma_m * random.normal() }
        };
        (anchors_m, tracks, (0..4000).map(sample).collect())
    }

    pub(super) fn off_m(located: &Located, place: impl Fn(usize, f64) -> Vector3<f64>) -> f64 {
        let last = located.time_s.len() - 1;
        let errors_m =
            [0, 1].map(|d| (located.position_m[d][last] - place(d, located.time_s[last])).norm());
        errors_m[0].max(errors_m[1])
    }
}
