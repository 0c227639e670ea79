//! Places of all drones that fit a few ranges, by the method of Levenberg and Marquardt.

use nalgebra::{DMatrix, DVector, Vector3};

use super::Link;
use super::positions::slope;
use noctograph_flying::estimate::Part;

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

    /// Slope over the places, and the range that is expected at them.
    fn slope(&self, anchors_m: &[Vector3<f64>], places_m: &DVector<f64>) -> (Vec<Part>, f64) {
        let mut then_m = places_m.clone();
        let (first, second) = self.link.drones();
        for (drone, moved_m) in [Some(first), second].into_iter().flatten().zip(self.moved_m) {
            let mut at = then_m.fixed_rows_mut::<3>(3 * drone);
            at += moved_m;
        }
        slope(self.link, anchors_m, then_m.as_slice(), 3)
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
        let (slope, expected_m) = range.slope(anchors_m, places_m);
        for part in slope {
            let Part::Three(at, h) = part else { continue };
            slopes.fixed_view_mut::<1, 3>(row, at).tr_copy_from(&(h * range.weight));
        }
        left[row] = (range.distance_m - expected_m) * range.weight;
    }
    (slopes, left)
}

/// Steps of Gauss and Newton with Levenberg's damping: sum of squares and places.
pub(super) fn fit(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    mut places_m: DVector<f64>,
) -> (f64, DVector<f64>) {
    // In the units of the slopes' squares.
    let scale = ranges.iter().map(|range| range.weight * range.weight).fold(0.0, f64::max);
    let mut damping = 1e-2 * scale;
    let mut cost = residuals(anchors_m, ranges, &places_m).1.norm_squared();
    for _ in 0..FIT_STEPS {
        let (slopes, left) = residuals(anchors_m, ranges, &places_m);
        let mut normal = slopes.transpose() * &slopes;
        for i in 0..places_m.len() {
            normal[(i, i)] += damping;
        }
        let Some(step) = normal.cholesky().map(|c| c.solve(&(slopes.transpose() * left))) else {
            break;
        };
        let next = &places_m + step;
        let next_cost = residuals(anchors_m, ranges, &next).1.norm_squared();
        if next_cost < cost {
            (places_m, cost) = (next, next_cost);
            damping = (damping * 0.2).max(1e-12 * scale);
        } else {
            damping *= 5.0;
        }
    }
    (cost, places_m)
}
