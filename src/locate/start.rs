//! The places at the start of a log, from only the first second of each drone.
//!
//! In: anchors, ranges. Out: a state of positions and velocities with its covariance. The mean
//! range of each link is fitted by Levenberg's and Marquardt's method from 27 places around the
//! anchors, since a few ranges have mirror images.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3};

use super::fit::{Observation, fit, residuals};
use super::pass::{LATE_S, STATES};
use super::positions::extent_m;
use super::{Link, RangeSample, Room};
use noctograph_core::error::{Error, Result};
use noctograph_sim::kalman::Normal;

/// Ranges of this time after the first give the place at the start.
const START_S: f64 = 1.0;
const START_SPEED_M_S: f64 = 0.5;
/// Starts of the fit, around the middle of the anchors, in fractions of their extent.
const AROUND: [f64; 3] = [-0.6, 0.1, 0.7];
/// Sum of squares, m², of places outside the room: more than any fit within.
const OUTSIDE_M2: f64 = 1e9;

/// The state that best fits the ranges of each drone's first second, drones at rest, and its
/// covariance for ranges with a standard deviation of `sigma_m`.
pub(super) fn start(
    anchors_m: &[Vector3<f64>],
    heard_s: &[[f64; 2]],
    samples: &[RangeSample],
    sigma_m: f64,
    room: Option<&Room>,
) -> Result<Normal> {
    let (n_drones, n) = (heard_s.len(), 3 * heard_s.len());
    // A range between drones that begin at different times fits no one pair of starts.
    let mut means = means(heard_s, samples);
    let at_once = Vec::from_iter(means.iter().copied().filter(|mean| {
        let begins_s: Vec<f64> = mean.link.drones().map(|drone| heard_s[drone][0]).collect();
        begins_s.iter().all(|begin_s| (begin_s - begins_s[0]).abs() <= LATE_S)
    }));
    if at_once.len() >= n {
        means = at_once;
    }
    if means.len() < n {
        return Err(Error::infeasible(
            format!(
                "{} links in the first second for {n} coordinates of {n_drones} drones: ranges alone \
                 leave the places open",
                means.len()
            ),
            "three anchors a drone, or more drones that range to each other, are needed; a \
                   drone that flies with its motion sensors does with fewer",
        ));
    }
    // The fit, and its information JᵀJ: a small eigenvalue is a direction that the ranges leave
    // open.
    let p = best_fit(anchors_m, n, &means, room);
    let jacobian = residuals(anchors_m, &means, &p).0;
    let information = jacobian.transpose() * jacobian;
    let eigen = information.clone().symmetric_eigen();
    if eigen.eigenvalues.min() < 1e-4 * eigen.eigenvalues.max() {
        return Err(Error::infeasible(
            "the links leave a direction open at the start: the anchors lie in a line, or in a \
                   plane with the drone",
            "place an anchor off that line or plane",
        ));
    }
    // Positions with the covariance of the fit, velocities at rest.
    let variance = sigma_m * sigma_m;
    let places = information.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n)) * variance;
    let (mut state, mut covariance) = (DVector::zeros(2 * n), DMatrix::zeros(2 * n, 2 * n));
    let rows: Vec<usize> = (0..n).map(|i| STATES * (i / 3) + i % 3).collect();
    for (i, row) in rows.iter().enumerate() {
        state[*row] = p[i];
        covariance[(row + 3, row + 3)] = START_SPEED_M_S * START_SPEED_M_S;
        for (j, column) in rows.iter().enumerate() {
            covariance[(*row, *column)] = places[(i, j)];
        }
    }
    Ok(Normal::new(state, covariance))
}

/// Mean range of each link in the first second in which its drones are heard.
fn means(heard_s: &[[f64; 2]], samples: &[RangeSample]) -> Vec<Observation> {
    let mut sums: BTreeMap<Link, (f64, f64)> = BTreeMap::new();
    for sample in samples {
        // A range between drones counts from the later beginning on.
        let begins_s = sample.link.drones().map(|drone| heard_s[drone][0]);
        let since_s = begins_s.fold(f64::NEG_INFINITY, f64::max);
        if (since_s..=since_s + START_S).contains(&sample.time_s) {
            let (sum_m, count) = sums.entry(sample.link).or_default();
            (*sum_m, *count) = (*sum_m + sample.distance_m, *count + 1.0);
        }
    }
    let sums = sums.into_iter();
    sums.map(|(link, (sum_m, count))| Observation { link, distance_m: sum_m / count }).collect()
}

fn best_fit(
    anchors_m: &[Vector3<f64>],
    n: usize,
    means: &[Observation],
    room: Option<&Room>,
) -> DVector<f64> {
    let [low_m, high_m] = extent_m(anchors_m);
    let (middle_m, reach_m) = ((low_m + high_m) * 0.5, (high_m - low_m).max().max(1.0));
    let mut best = (f64::INFINITY, DVector::zeros(n));
    for k in 0..27_usize {
        let around = [AROUND[k % 3], AROUND[k / 3 % 3], AROUND[k / 9]];
        let from = DVector::from_fn(n, |i, _| {
            // Drones apart from each other, or their range has no direction.
            let apart = 0.05 * (i / 3) as f64;
            middle_m[i % 3] + reach_m * (around[i % 3] + apart)
        });
        let (mut cost, places_m) = fit(anchors_m, means, from);
        if room.is_some_and(|room| !room.holds_all(&places_m)) {
            cost += OUTSIDE_M2;
        }
        if cost < best.0 - 1e-9 {
            best = (cost, places_m);
        }
    }
    best.1
}
