//! The places at the start of a log, from its first second alone.
//!
//! In: anchors, ranges. Out: a state of positions and velocities with its covariance. The mean range
//! of each link is fitted by Levenberg's and Marquardt's method from 27 places around the anchors,
//! since a few ranges have mirror images.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3};

use super::positions::slope;
use super::{Link, RangeSample};
use crate::error::{Error, Result};

/// Ranges of this time after the first give the place at the start.
const START_S: f64 = 1.0;
/// σ of the velocity at the start, and least σ of the place.
const START_SPEED_M_S: f64 = 0.5;
const START_SIGMA_M: f64 = 0.05;
/// Starts of the fit, around the middle of the anchors, in shares of their extent.
const AROUND: [f64; 3] = [-0.6, 0.1, 0.7];
const FIT_STEPS: usize = 40;

/// Mean range of each link in the first second.
type Means = BTreeMap<Link, f64>;

/// The state that best fits the ranges of the first second, drones at rest, and its covariance.
pub(super) fn start(
    anchors_m: &[Vector3<f64>],
    n_drones: usize,
    samples: &[RangeSample],
    sigma_m: f64,
) -> Result<(DVector<f64>, DMatrix<f64>)> {
    let n = 3 * n_drones;
    let means = means(samples);
    if means.len() < n {
        return Err(Error::Infeasible {
            what: format!(
                "{} links in the first second for {n} coordinates of {n_drones} drones: ranges alone \
                 leave the places open",
                means.len()
            ),
            hint: "three anchors a drone, or more drones that range to each other, are needed; a \
                   drone that flies with its motion sensors does with fewer"
                .into(),
        });
    }
    let p = best_fit(anchors_m, n, &means);
    let slopes = residuals(anchors_m, &means, &p).0;
    let information = slopes.transpose() * slopes;
    let eigen = information.clone().symmetric_eigen();
    if eigen.eigenvalues.min() < 1e-4 * eigen.eigenvalues.max() {
        return Err(Error::Infeasible {
            what:
                "the links leave a direction open at the start: the anchors lie in a line, or in a \
                   plane with the drone"
                    .into(),
            hint: "place an anchor off that line or plane".into(),
        });
    }
    let variance = (sigma_m * sigma_m).max(START_SIGMA_M * START_SIGMA_M);
    let places = information.try_inverse().unwrap_or_else(|| DMatrix::identity(n, n)) * variance;
    let (mut state, mut covariance) = (DVector::zeros(2 * n), DMatrix::zeros(2 * n, 2 * n));
    let at = |i: usize| 6 * (i / 3) + i % 3;
    for i in 0..n {
        state[at(i)] = p[i];
        covariance[(at(i) + 3, at(i) + 3)] = START_SPEED_M_S * START_SPEED_M_S;
        for j in 0..n {
            covariance[(at(i), at(j))] = places[(i, j)];
        }
    }
    Ok((state, covariance))
}

fn means(samples: &[RangeSample]) -> Means {
    let first_s = samples.first().map_or(0.0, |first| first.time_s);
    let mut sums: BTreeMap<Link, (f64, f64)> = BTreeMap::new();
    for sample in samples.iter().filter(|s| s.time_s <= first_s + START_S) {
        let link = match sample.link {
            Link::Drones(i, j) => Link::Drones(i.min(j), i.max(j)),
            to_anchor @ Link::Anchor { .. } => to_anchor,
        };
        let (sum_m, count) = sums.entry(link).or_default();
        (*sum_m, *count) = (*sum_m + sample.distance_m, *count + 1.0);
    }
    sums.into_iter().map(|(link, (sum_m, count))| (link, sum_m / count)).collect()
}

/// Slopes of the ranges over the coordinates, and what the places leave of them.
fn residuals(
    anchors_m: &[Vector3<f64>],
    means: &Means,
    p: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut slopes = DMatrix::zeros(means.len(), p.len());
    let mut left = DVector::zeros(means.len());
    for (row, (link, mean_m)) in means.iter().enumerate() {
        let (h, expected_m) = slope(*link, anchors_m, p);
        slopes.set_row(row, &h.transpose());
        left[row] = mean_m - expected_m;
    }
    (slopes, left)
}

/// The best of the fits from places around the anchors.
fn best_fit(anchors_m: &[Vector3<f64>], n: usize, means: &Means) -> DVector<f64> {
    let low = |axis: usize| anchors_m.iter().map(|a| a[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| anchors_m.iter().map(|a| a[axis]).fold(f64::NEG_INFINITY, f64::max);
    let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (low(axis) + high(axis)));
    let reach_m = (0..3).map(|axis| high(axis) - low(axis)).fold(1.0, f64::max);
    let mut best = (f64::INFINITY, DVector::zeros(n));
    for k in 0..27_usize {
        let share = [AROUND[k % 3], AROUND[k / 3 % 3], AROUND[k / 9]];
        let from = DVector::from_fn(n, |i, _| {
            // Drones apart from each other, or their range has no direction.
            #[expect(clippy::cast_precision_loss, reason = "a few drones")]
            let apart = 0.05 * (i / 3) as f64;
            middle[i % 3] + reach_m * (share[i % 3] + apart)
        });
        let found = fit(anchors_m, means, from);
        if found.0 < best.0 - 1e-9 {
            best = found;
        }
    }
    best.1
}

/// Steps of Gauss and Newton with Levenberg's damping: cost and places.
fn fit(anchors_m: &[Vector3<f64>], means: &Means, mut p: DVector<f64>) -> (f64, DVector<f64>) {
    let mut damping = 1e-2;
    let mut cost = residuals(anchors_m, means, &p).1.norm_squared();
    for _ in 0..FIT_STEPS {
        let (slopes, left) = residuals(anchors_m, means, &p);
        let mut normal = slopes.transpose() * &slopes;
        for i in 0..p.len() {
            normal[(i, i)] += damping;
        }
        let Some(step) = normal.cholesky().map(|c| c.solve(&(slopes.transpose() * left))) else {
            break;
        };
        let next = &p + step;
        let next_cost = residuals(anchors_m, means, &next).1.norm_squared();
        if next_cost < cost {
            (p, cost, damping) = (next, next_cost, (damping * 0.2).max(1e-12));
        } else {
            damping *= 5.0;
        }
    }
    (cost, p)
}
