//! Localization of drones from ranges, apart from any controller: the observer of two drones with a
//! common anchor as its authors left it ([`SharedAnchorObserver`]) with its local region
//! ([`fraction_left`], [`observability`]), and the filter without a local region that they wished
//! for ([`Augmented`], handed over to [`Positions`]). Both need the motion ([`locate_shared`],
//! [`locate_augmented`]). [`locate`] turns the ranges of a log into positions without it.
//!
//! The filter that flies is the estimator `cooperative`.

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

/// What a range is measured between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Link {
    /// A drone and an anchor.
    Anchor {
        /// Index of the drone.
        drone: usize,
        /// Index of the anchor.
        anchor: usize,
    },
    /// Two drones, the lower index first.
    Drones(usize, usize),
}

impl Link {
    /// The link between two drones.
    pub fn between(one: usize, other: usize) -> Self {
        Self::Drones(one.min(other), one.max(other))
    }

    /// The vector along it to its first drone, with the drones at these places.
    pub fn away_m(
        self,
        anchors_m: &[Vector3<f64>],
        place_m: impl Fn(usize) -> Vector3<f64>,
    ) -> Vector3<f64> {
        match self {
            Self::Anchor { drone, anchor } => place_m(drone) - anchors_m[anchor],
            Self::Drones(i, j) => place_m(i) - place_m(j),
        }
    }

    /// The drones at the ends of this link.
    pub fn drones(self) -> impl Iterator<Item = usize> {
        let (first, second) = match self {
            Self::Anchor { drone, .. } => (drone, None),
            Self::Drones(i, j) => (i, Some(j)),
        };
        std::iter::once(first).chain(second)
    }
}

impl std::fmt::Display for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // The firmware and the file of cfclient count anchors from 0.
            Self::Anchor { drone, anchor } => {
                write!(f, "drone {} to anchor {} (distance{anchor})", drone + 1, anchor + 1)
            }
            Self::Drones(i, j) => write!(f, "drones {} and {}", i + 1, j + 1),
        }
    }
}

/// One range of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeSample {
    /// When.
    pub time_s: f64,
    /// Between what.
    pub link: Link,
    /// Measured distance.
    pub distance_m: f64,
}

impl RangeSample {
    /// True if its numbers can be a measurement.
    fn is_measurement(&self) -> bool {
        self.distance_m > 0.0 && self.distance_m < 1e4 && self.time_s.is_finite()
    }
}

/// A box that holds all drones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Its least coordinates.
    pub low_m: Vector3<f64>,
    /// Its greatest coordinates.
    pub high_m: Vector3<f64>,
}

impl Room {
    /// True if a place is inside.
    pub fn holds(&self, place_m: &Vector3<f64>) -> bool {
        (0..3).all(|k| (self.low_m[k]..=self.high_m[k]).contains(&place_m[k]))
    }

    /// True if every place, three coordinates each, is inside.
    fn holds_all(&self, places_m: &DVector<f64>) -> bool {
        places_m.as_slice().chunks(3).all(|place_m| self.holds(&Vector3::from_row_slice(place_m)))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{LocateOptions, Located, RangeSample, Track};
    use noctograph_core::random::split_mix;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{EvenStyle, PlanOptions, Style, fleet};

    /// Each drone's own anchor, then the shared one.
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

    /// The designs of two drones that write NOOR.
    pub(super) fn path() -> impl Fn(usize, f64) -> Vector3<f64> {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        // With the default hover, 58 of 60 starts are found from anchors in a line, not 59.
        let style = Style::Even(EvenStyle { hover_s: 0.5, ..EvenStyle::default() });
        let plans = fleet(&strokes, &PlanOptions { drones: 2, style, ..PlanOptions::even() });
        let plans = plans.unwrap();
        move |drone, time_s| plans[drone].design_m(time_s)
    }

    /// Random numbers of a seed.
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

    /// Anchors, motion along the word, and ranges of the five links in turn, 200 a second.
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
