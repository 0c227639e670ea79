//! Places of all drones that fit a few ranges, by the method of Levenberg and Marquardt.

use nalgebra::{DMatrix, DVector, Vector3};

use super::Link;
use super::positions::slope;
use noctograph_sim::estimate::Part;

const FIT_STEPS: usize = 40;

/// A range, or the mean of several.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    pub(super) link: Link,
    pub(super) distance_m: f64,
    /// One over its standard deviation, 1/m; 1 for a fit without a scale.
    pub(super) weight: f64,
    /// Where its first and its second drone were then, relative to the place that is fitted.
    pub(super) moved_m: [Vector3<f64>; 2],
}

impl Observation {
    pub(super) fn new(link: Link, distance_m: f64, weight: f64) -> Self {
        Self { link, distance_m, weight, moved_m: [Vector3::zeros(); 2] }
    }
}

/// Weighted slopes of the ranges over the places, and what the places leave of the ranges.
pub(super) fn residuals(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    places_m: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut slopes = DMatrix::zeros(ranges.len(), places_m.len());
    let mut left = DVector::zeros(ranges.len());
    for (row, range) in ranges.iter().enumerate() {
        let mut then_m = places_m.clone();
        for (drone, moved_m) in range.link.drones().zip(range.moved_m) {
            let mut at = then_m.fixed_rows_mut::<3>(3 * drone);
            at += moved_m;
        }
        let (slope, expected_m) = slope(range.link, anchors_m, then_m.as_slice(), 3);
        for part in slope {
            let Part::Three(at, h) = part else { continue };
            slopes.fixed_view_mut::<1, 3>(row, at).tr_copy_from(&(h * range.weight));
        }
        left[row] = (range.distance_m - expected_m) * range.weight;
    }
    (slopes, left)
}

/// The places that fit some ranges, and the sum of squares that they leave.
pub(super) fn fit(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    places_m: DVector<f64>,
) -> (f64, DVector<f64>) {
    // In the units of the slopes' squares; drones without a range have none.
    let scale = ranges.iter().map(|range| range.weight * range.weight).fold(0.0, f64::max);
    let residuals = |places_m: &DVector<f64>| residuals(anchors_m, ranges, places_m);
    let (cost, places_m, _) = descend(residuals, |_| scale, places_m);
    (cost, places_m)
}

/// Steps of Gauss and Newton from a start, given the slopes of a problem and what it leaves there:
/// the sum of squares, the solution, and the slopes at it. `unit` is that of Levenberg's damping,
/// for a diagonal element of the normal matrix.
pub(super) fn descend(
    problem: impl Fn(&DVector<f64>) -> (DMatrix<f64>, DVector<f64>),
    unit: impl Fn(f64) -> f64,
    mut at: DVector<f64>,
) -> (f64, DVector<f64>, DMatrix<f64>) {
    let (mut slopes, mut left) = problem(&at);
    let mut damping = 1e-2;
    for _ in 0..FIT_STEPS {
        let mut normal = slopes.transpose() * &slopes;
        (0..at.len()).for_each(|i| normal[(i, i)] += damping * unit(normal[(i, i)]));
        let right = slopes.transpose() * &left;
        let Some(step) = normal.cholesky().map(|normal| normal.solve(&right)) else { break };
        let next = &at + step;
        let (next_slopes, next_left) = problem(&next);
        if next_left.norm_squared() < left.norm_squared() {
            (at, slopes, left) = (next, next_slopes, next_left);
            damping = (damping * 0.2).max(1e-12);
        } else {
            damping *= 5.0;
        }
    }
    (left.norm_squared(), at, slopes)
}

/// Puts a drone behind a plane, as in a mirror.
pub(super) fn reflect(
    places_m: &mut DVector<f64>,
    drone: usize,
    on_plane_m: &Vector3<f64>,
    normal: &Vector3<f64>,
) {
    let mut place_m = places_m.fixed_rows_mut::<3>(3 * drone);
    let beyond_m = (place_m.clone_owned() - on_plane_m).dot(normal);
    place_m -= normal * (2.0 * beyond_m);
}
