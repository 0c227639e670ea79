//! Determines the initial positions in a log from each drone's first second only.
//!
//! The input is anchors and ranges, and the output is a state of positions and velocities with its
//! covariance. The mean range of each link is fitted by the method of Levenberg and Marquardt from
//! 27 starting points around the anchors, because mirror images fit a few ranges as well.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3};

use super::fit::{Observation, fit, residuals};
use super::pass::{LATE_S, STATES};
use super::positions::extent_m;
use super::{Link, RangeSample, Room};
use noctograph_core::error::{Error, Result};
use noctograph_sim::kalman::Normal;

/// Time after the first range during which ranges determine the initial position.
const START_S: f64 = 1.0;
/// Standard deviation of each initial velocity.
const START_SPEED_M_S: f64 = 0.5;
/// Starting points of the fit on each axis relative to the anchors' center, and distance between
/// the drones at each, as fractions of the anchors' extent.
const AROUND: [f64; 3] = [-0.6, 0.1, 0.7];
const APART: f64 = 0.05;
/// Additional cost, m², of positions outside the room, which exceeds the cost of any fit inside it.
const OUTSIDE_M2: f64 = 1e9;
/// Minimum decrease in cost, m², for another start to count as better.
const LEAST_DECREASE_M2: f64 = 1e-9;
/// Maximum eigenvalue of the information along an unobservable direction, relative to the largest.
const UNOBSERVABLE: f64 = 1e-4;

/// Returns the state that best fits the ranges of each drone's first second, with zero velocities.
/// Its covariance assumes ranges with a standard deviation of `sigma_m`. Returns
/// [`Error::Infeasible`] if the ranges do not determine the positions.
pub(super) fn start(
    anchors_m: &[Vector3<f64>],
    heard_s: &[[f64; 2]],
    samples: &[RangeSample],
    sigma_m: f64,
    room: Option<&Room>,
) -> Result<Normal> {
    let (n_drones, n) = (heard_s.len(), 3 * heard_s.len());
    // If two logs start at different times, a range between the drones does not apply to both
    // starts.
    let mut ranges = means(heard_s, samples);
    let simultaneous = Vec::from_iter(ranges.iter().copied().filter(|mean| {
        let begins_s: Vec<f64> = mean.link.drones().map(|drone| heard_s[drone][0]).collect();
        begins_s.iter().all(|begin_s| (begin_s - begins_s[0]).abs() <= LATE_S)
    }));
    if simultaneous.len() >= n {
        ranges = simultaneous;
    }
    if ranges.len() < n {
        return Err(Error::infeasible(
            format!(
                "{} links in the first second for {n} coordinates of {n_drones} drones: ranges \
                 do not determine the positions",
                ranges.len()
            ),
            "three anchors per drone, or more drones that range to each other, are needed; a drone \
             that flies with its motion sensors needs fewer",
        ));
    }
    // A small eigenvalue of JᵀJ indicates a direction that the ranges do not determine.
    let positions_m = best_fit(anchors_m, n, &ranges, room);
    let jacobian = residuals(anchors_m, &ranges, &positions_m).0;
    let information = jacobian.transpose() * jacobian;
    let eigen = information.clone().symmetric_eigen();
    if eigen.eigenvalues.min() < UNOBSERVABLE * eigen.eigenvalues.max() {
        return Err(Error::infeasible(
            "the links leave one direction undetermined at the start: the anchors lie on a line, \
             or in a plane with the drone",
            "place an anchor off that line or plane",
        ));
    }
    let variance = sigma_m * sigma_m;
    let inverse = information.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n));
    Ok(at_rest(&positions_m, &(inverse * variance)))
}

/// Returns the state of drones at rest, given their positions in m and the covariance of the
/// positions. The velocities' standard deviation is [`START_SPEED_M_S`].
fn at_rest(positions_m: &DVector<f64>, covariance_m2: &DMatrix<f64>) -> Normal {
    let n = positions_m.len();
    // Each drone has three position states followed by three velocity states.
    let (mut state, mut covariance) = (DVector::zeros(2 * n), DMatrix::zeros(2 * n, 2 * n));
    let rows: Vec<usize> = (0..n).map(|i| STATES * (i / 3) + i % 3).collect();
    for (i, row) in rows.iter().enumerate() {
        state[*row] = positions_m[i];
        covariance[(row + 3, row + 3)] = START_SPEED_M_S * START_SPEED_M_S;
        for (j, column) in rows.iter().enumerate() {
            covariance[(*row, *column)] = covariance_m2[(i, j)];
        }
    }
    Normal::new(state, covariance)
}

/// Returns the mean range of each link over the first second in which both drones have ranges.
fn means(heard_s: &[[f64; 2]], samples: &[RangeSample]) -> Vec<Observation> {
    let mut sums: BTreeMap<Link, (f64, f64)> = BTreeMap::new();
    for sample in samples {
        // A range between drones is used from the later of their first ranges onward.
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

/// Returns the positions in m with the lowest cost among fits from 27 starts around the anchors.
/// `n` is the number of coordinates, and `means` contains the links' mean ranges.
fn best_fit(
    anchors_m: &[Vector3<f64>],
    n: usize,
    means: &[Observation],
    room: Option<&Room>,
) -> DVector<f64> {
    let [low_m, high_m] = extent_m(anchors_m);
    let (middle_m, reach_m) = ((low_m + high_m) * 0.5, (high_m - low_m).max().max(1.0));
    let mut best = (f64::INFINITY, DVector::zeros(n));
    // Each k selects a different combination of the three offsets on the three axes.
    for k in 0..AROUND.len().pow(3) {
        let around = [AROUND[k % 3], AROUND[k / 3 % 3], AROUND[k / 9]];
        let start_m = DVector::from_fn(n, |i, _| {
            // The drones start apart from each other, because otherwise the direction of the range
            // between them would be undefined.
            let apart = APART * (i / 3) as f64;
            middle_m[i % 3] + reach_m * (around[i % 3] + apart)
        });
        let (mut cost, positions_m) = fit(anchors_m, means, start_m);
        // A fit outside the room is only used if there is none inside.
        if room.is_some_and(|room| !room.holds_all(&positions_m)) {
            cost += OUTSIDE_M2;
        }
        if cost < best.0 - LEAST_DECREASE_M2 {
            best = (cost, positions_m);
        }
    }
    best.1
}
