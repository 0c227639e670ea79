//! Places of all drones that fit a few ranges, by the method of Levenberg and Marquardt.

use nalgebra::{DMatrix, DVector, Vector3};

use super::Link;
use super::positions::range_jacobian;
use noctograph_sim::kalman::Part;

const FIT_STEPS: usize = 40;

#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    pub(super) link: Link,
    pub(super) distance_m: f64,
}

/// Jacobian of the ranges over the places, and the residuals of the ranges.
pub(super) fn residuals(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    places_m: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut jacobian = DMatrix::zeros(ranges.len(), places_m.len());
    let mut left = DVector::zeros(ranges.len());
    for (row, range) in ranges.iter().enumerate() {
        let (parts, expected_m) = range_jacobian(range.link, anchors_m, places_m.as_slice(), 3);
        // ∂d/∂p is the unit vector from the other end.
        for part in parts {
            let Part::Three(column, direction) = part else { continue };
            jacobian.fixed_view_mut::<1, 3>(row, column).tr_copy_from(&direction);
        }
        left[row] = range.distance_m - expected_m;
    }
    (jacobian, left)
}

/// The sum of squared residuals, and the places with the best fit.
pub(super) fn fit(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    places_m: DVector<f64>,
) -> (f64, DVector<f64>) {
    let (cost, places_m, _) =
        descend(|places_m| residuals(anchors_m, ranges, places_m), |_| 1.0, places_m);
    (cost, places_m)
}

/// Least squares from a start by the method of Levenberg (1944) and Marquardt (1963). `problem`
/// gives Jacobian and residuals at a state, `unit` scales the damping of a diagonal element of the
/// normal matrix. Returns the sum of squares, the solution, and the Jacobian there.
pub(super) fn descend(
    problem: impl Fn(&DVector<f64>) -> (DMatrix<f64>, DVector<f64>),
    unit: impl Fn(f64) -> f64,
    mut solution: DVector<f64>,
) -> (f64, DVector<f64>, DMatrix<f64>) {
    let (mut jacobian, mut left) = problem(&solution);
    let mut damping = 1e-2;
    for _ in 0..FIT_STEPS {
        // (JᵀJ + damping) step = Jᵀ residuals. A better state is taken with less damping, a worse
        // one is refused with more.
        let mut normal = jacobian.transpose() * &jacobian;
        (0..solution.len()).for_each(|i| normal[(i, i)] += damping * unit(normal[(i, i)]));
        let right = jacobian.transpose() * &left;
        let Some(step) = normal.cholesky().map(|normal| normal.solve(&right)) else { break };
        let next = &solution + step;
        let (next_jacobian, next_left) = problem(&next);
        if next_left.norm_squared() < left.norm_squared() {
            (solution, jacobian, left) = (next, next_jacobian, next_left);
            damping = (damping * 0.2).max(1e-12);
        } else {
            damping *= 5.0;
        }
    }
    (left.norm_squared(), solution, jacobian)
}
