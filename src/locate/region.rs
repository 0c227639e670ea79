//! Determines the published observer's region of convergence, and the observability of a flight.
//!
//! Two questions are answered before a flight. What fraction of an initial error remains with the
//! observer? How well do the ranges determine the initial positions if the motion is known exactly?
//! The first answer assumes no noise, and the second one assumes noise-free motion.

use nalgebra::{DVector, Matrix3, Matrix6, SMatrix, Vector3};

use super::Link;
use super::fit::{Observation, residuals};
use super::shared_anchor::SharedAnchorObserver;
use noctograph_core::random::split_mix;
use noctograph_core::statistics::median;

/// Five links: drone 0 to its own anchor 0 and to the common anchor 2, drone 1 to its own anchor 1
/// and to the common anchor 2, and drone 0 to drone 1.
pub(super) const FIVE_LINKS: [Link; 5] = [
    Link::Anchor { drone: 0, anchor: 0 },
    Link::Anchor { drone: 0, anchor: 2 },
    Link::Anchor { drone: 1, anchor: 1 },
    Link::Anchor { drone: 1, anchor: 2 },
    Link::Drones(0, 1),
];

/// Rate of the observer's steps, equal to that on board.
const RATE_HZ: f64 = 100.0;
/// Ratio of final to initial error above which an observer counts as diverged.
const DIVERGED: f64 = 3.0;
/// Maximum eigenvalue of the information along an unobservable direction, relative to the largest.
const UNOBSERVABLE: f64 = 1e-9;
/// Seed of the random initial errors.
const SEED: u64 = 0x5eed;

/// Fraction of an initial error of `error_m` that remains with an observer.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct FractionLeft {
    /// Norm of the initial position error of both drones together.
    pub error_m: f64,
    /// Median of the final error over the starts, as a fraction of `error_m`.
    pub median: f64,
    /// Minimum and maximum fraction over the starts.
    pub range: [f64; 2],
    /// Fraction of starts whose error more than tripled.
    pub diverged_frac: f64,
}

/// Observability of the six initial coordinates of a flight.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Observability {
    /// Number of directions, out of six, that are observable.
    pub rank: usize,
    /// Standard deviations along the principal directions, ascending, infinite if unobservable.
    pub sigmas_m: [f64; 6],
    /// Least certain direction: three coordinates of the first drone, then three of the second.
    pub worst: [f64; 6],
}

/// Measurements available at each instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outputs {
    /// All five ranges.
    Ranges,
    /// The three outputs of the observer.
    Three,
}

/// Runs the observer along `path` without noise, from `n` random starts with an error of `error_m`.
/// Returns statistics of the fraction of the error that remains after `duration_s`. `path` returns
/// the true positions of both drones in m at a time in s.
pub fn fraction_left(
    observer: &SharedAnchorObserver,
    path: impl Fn(f64) -> [Vector3<f64>; 2],
    duration_s: f64,
    error_m: f64,
    n: u32,
) -> FractionLeft {
    let mut random = SEED;
    let mut fractions = Vec::new();
    for _ in 0..n {
        let direction = random_direction(&mut random);
        let errors_m = [0, 3].map(|k| direction.fixed_rows::<3>(k) * error_m);
        fractions.push(final_error_m(observer, &path, duration_s, errors_m) / error_m);
    }
    fractions.sort_by(f64::total_cmp);
    let diverged = fractions.iter().filter(|frac| **frac > DIVERGED || frac.is_nan()).count();
    let diverged_frac = diverged as f64 / f64::from(n.max(1));
    FractionLeft {
        error_m,
        median: median(fractions.iter().copied()).unwrap_or(0.0),
        range: [fractions.first(), fractions.last()].map(|frac| frac.copied().unwrap_or(0.0)),
        diverged_frac,
    }
}

/// Draws a unit vector of six coordinates, uniformly over all directions.
fn random_direction(random: &mut u64) -> SMatrix<f64, 6, 1> {
    loop {
        // Points in a cube have uniformly distributed directions only within its inscribed ball.
        let drawn = SMatrix::<f64, 6, 1>::from_fn(|_, _| {
            *random = split_mix(*random);
            // The upper 53 bits divided by 2⁵³ are uniform from 0 to 1.
            2.0 * ((*random >> 11) as f64 / 9_007_199_254_740_992.0) - 1.0
        });
        // A point near the center would have a direction with large rounding errors.
        if (1e-3..=1.0).contains(&drawn.norm()) {
            return drawn.normalize();
        }
    }
}

/// Returns the observer's error in m over both drones (root of the sum of squares) at the end of a
/// path, if its estimates start with the errors `start_errors_m`. `path` returns the true positions
/// of both drones in m at a time in s.
fn final_error_m(
    observer: &SharedAnchorObserver,
    path: impl Fn(f64) -> [Vector3<f64>; 2],
    duration_s: f64,
    start_errors_m: [Vector3<f64>; 2],
) -> f64 {
    let mut true_m = path(0.0);
    let mut estimates_m = [0, 1].map(|i| true_m[i] + start_errors_m[i]);
    #[expect(clippy::cast_possible_truncation, reason = "minutes")]
    let ticks = (duration_s * RATE_HZ) as u32;
    // The estimates follow the exact motion plus the observer's corrections, in Euler steps.
    for tick in 1..=ticks {
        let outputs = observer.outputs(&observer.ranges(&true_m));
        let rates = observer.corrections(&estimates_m, &outputs);
        let next_m = path(f64::from(tick) / RATE_HZ);
        for i in 0..2 {
            estimates_m[i] += next_m[i] - true_m[i] + rates[i] / RATE_HZ;
        }
        true_m = next_m;
    }
    (0..2).map(|i| (estimates_m[i] - true_m[i]).norm_squared()).sum::<f64>().sqrt()
}

/// Returns how well the measurements of the first `span_s` determine the initial positions. `path`
/// returns the true positions of both drones in m at a time in s. The five links are measured in
/// turn, at `rate_hz` ranges per second in total, with a standard deviation of `sigma_m`.
pub fn observability(
    observer: &SharedAnchorObserver,
    outputs: Outputs,
    path: impl Fn(f64) -> [Vector3<f64>; 2],
    span_s: f64,
    rate_hz: f64,
    sigma_m: f64,
) -> Observability {
    // Because the motion between rounds is known, the information JᵀR⁻¹J is summed over all rounds.
    let mut information = Matrix6::zeros();
    let rounds_hz = rate_hz / FIVE_LINKS.len() as f64;
    #[expect(clippy::cast_possible_truncation, reason = "minutes")]
    let rounds = (span_s * rounds_hz) as u32;
    for round in 0..=rounds {
        information +=
            information_of_round(observer, outputs, &path(f64::from(round) / rounds_hz), sigma_m);
    }
    // The eigenvalues are the inverse variances along the principal directions.
    let eigen = information.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let mut order = [0, 1, 2, 3, 4, 5];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let sigmas_m = order.map(|k| {
        if eigen.eigenvalues[k] > UNOBSERVABLE * largest {
            1.0 / eigen.eigenvalues[k].sqrt()
        } else {
            f64::INFINITY
        }
    });
    Observability {
        rank: sigmas_m.iter().filter(|sigma_m| sigma_m.is_finite()).count(),
        sigmas_m,
        worst: std::array::from_fn(|i| eigen.eigenvectors[(i, order[5])]),
    }
}

/// Returns the information JᵀR⁻¹J in 1/m² about the six coordinates in one round of measurements
/// with both drones at `positions_m`.
fn information_of_round(
    observer: &SharedAnchorObserver,
    outputs: Outputs,
    positions_m: &[Vector3<f64>; 2],
    sigma_m: f64,
) -> Matrix6<f64> {
    let anchors_m = [observer.own_m[0], observer.own_m[1], observer.shared_m];
    let without_ranges = FIVE_LINKS.map(|link| Observation { link, distance_m: 0.0 });
    let places = DVector::from_iterator(6, positions_m.iter().flatten().copied());
    let (by_ranges, _) = residuals(&anchors_m, &without_ranges, &places);
    let by_ranges = by_ranges.fixed_view::<5, 6>(0, 0);
    if outputs == Outputs::Ranges {
        return by_ranges.transpose() * by_ranges / (sigma_m * sigma_m);
    }
    // The three outputs are sums of squared ranges. Each row contains an output's derivatives with
    // respect to the five ranges.
    let ranges = observer.ranges(positions_m);
    let [d11, d22] = ranges.own_m.map(|d| 2.0 * d);
    let [d13, d23] = ranges.shared_m.map(|d| 2.0 * d);
    let q = 2.0 * ranges.between_m;
    let squares = SMatrix::<f64, 3, 5>::from_row_slice(&[
        d11, -d13, 0.0, 0.0, 0.0, 0.0, 0.0, d22, -d23, 0.0, 0.0, d13, 0.0, d23, -q,
    ]);
    let covariance: Matrix3<f64> = squares * squares.transpose() * (sigma_m * sigma_m);
    let by_outputs = squares * by_ranges;
    let weight = covariance.try_inverse().unwrap_or_default();
    by_outputs.transpose() * weight * by_outputs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{GEOMETRIES, path};

    fn observer(gain: f64) -> SharedAnchorObserver {
        let [one, two, shared_m] = GEOMETRIES[0].1.map(Vector3::from);
        SharedAnchorObserver { own_m: [one, two], shared_m, gains: [gain; 2] }
    }

    fn writing() -> impl Fn(f64) -> [Vector3<f64>; 2] {
        let place = path();
        move |time_s| [place(0, time_s), place(1, time_s)]
    }

    #[test]
    fn five_ranges_see_five_directions_and_the_three_outputs_three() {
        let rank = |outputs, span_s| {
            observability(&observer(0.1), outputs, writing(), span_s, 200.0, 0.06).rank
        };
        assert_eq!((rank(Outputs::Ranges, 0.0), rank(Outputs::Three, 0.0)), (5, 3));
        assert_eq!((rank(Outputs::Ranges, 20.0), rank(Outputs::Three, 20.0)), (6, 6));
        let worst = |outputs| {
            observability(&observer(0.1), outputs, writing(), 20.0, 200.0, 0.06).sigmas_m[5]
        };
        let (ranges_m, three_m) = (worst(Outputs::Ranges), worst(Outputs::Three));
        println!("worst direction after 20 s: {ranges_m} m, {three_m} m");
        assert!(three_m > 2.0 * ranges_m, "{three_m} m against {ranges_m} m");
    }

    #[test]
    fn excitation_about_the_shared_anchor_decides() {
        let written = fraction_left(&observer(0.01), writing(), 21.0, 1.0, 30);
        // The shared anchor is at the center of figures 4 m in size.
        let around =
            SharedAnchorObserver { shared_m: Vector3::new(0.0, 0.0, 1.2), ..observer(0.1) };
        fn orbit(time_s: f64) -> [Vector3<f64>; 2] {
            [0.0, 2.1].map(|phase| {
                let wave = |rate: f64, more: f64| libm::sin(rate * time_s + phase + more);
                Vector3::new(2.0 * wave(0.9, 0.0), 2.0 * wave(0.7, 1.0), 1.2 + wave(1.1, 2.0))
            })
        }
        let orbited = fraction_left(&around, orbit, 60.0, 1.0, 30);
        println!("{written:?}\n{orbited:?}");
        assert!(written.median > 0.4, "{written:?}");
        assert!(orbited.median < 0.1, "{orbited:?}");
    }
}
