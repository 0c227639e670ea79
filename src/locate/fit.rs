//! Fits positions of all drones to a few ranges by the method of Levenberg and Marquardt.

use nalgebra::{DMatrix, DVector, Vector3};

use super::Link;
use super::positions::range_jacobian;
use noctograph_sim::kalman::Part;

/// Number of steps of a fit, accepted or not.
const FIT_STEPS: usize = 40;
/// Initial damping, its factors after an improvement and after a failure, and its minimum.
const DAMPING: f64 = 1e-2;
const DAMPING_FACTORS: [f64; 2] = [0.2, 5.0];
const LEAST_DAMPING: f64 = 1e-12;

/// A link and its measured range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observation {
    pub(super) link: Link,
    pub(super) distance_m: f64,
}

/// Returns the Jacobian of the ranges with respect to the positions (three coordinates for each
/// drone), and the residuals in m, which are the measured minus the expected ranges.
pub(super) fn residuals(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    positions_m: &DVector<f64>,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut jacobian = DMatrix::zeros(ranges.len(), positions_m.len());
    let mut residuals_m = DVector::zeros(ranges.len());
    for (row, range) in ranges.iter().enumerate() {
        let (parts, expected_m) = range_jacobian(range.link, anchors_m, positions_m.as_slice(), 3);
        // ∂d/∂p is the unit vector from the other end of the link.
        for part in parts {
            let Part::Three(column, direction) = part else { continue };
            jacobian.fixed_view_mut::<1, 3>(row, column).tr_copy_from(&direction);
        }
        residuals_m[row] = range.distance_m - expected_m;
    }
    (jacobian, residuals_m)
}

/// Returns the sum of squared residuals in m² and the best fit of the positions, starting at
/// `positions_m`.
pub(super) fn fit(
    anchors_m: &[Vector3<f64>],
    ranges: &[Observation],
    positions_m: DVector<f64>,
) -> (f64, DVector<f64>) {
    let (cost, positions_m, _) =
        descend(|positions_m| residuals(anchors_m, ranges, positions_m), |_| 1.0, positions_m);
    (cost, positions_m)
}

/// Minimizes a sum of squares, starting at `solution` (Levenberg 1944, Marquardt 1963). `problem`
/// returns the Jacobian and the residuals at a state. `unit` scales the damping of each diagonal
/// element of the normal matrix. Returns the sum of squares, the solution, and its Jacobian.
pub(super) fn descend(
    problem: impl Fn(&DVector<f64>) -> (DMatrix<f64>, DVector<f64>),
    unit: impl Fn(f64) -> f64,
    mut solution: DVector<f64>,
) -> (f64, DVector<f64>, DMatrix<f64>) {
    let (mut jacobian, mut residuals_m) = problem(&solution);
    let mut damping = DAMPING;
    for _ in 0..FIT_STEPS {
        // The step solves (JᵀJ + damping) step = Jᵀ residuals. An improved state is accepted and
        // lowers the damping. Any other state is rejected and raises it.
        let mut normal = jacobian.transpose() * &jacobian;
        (0..solution.len()).for_each(|i| normal[(i, i)] += damping * unit(normal[(i, i)]));
        let right = jacobian.transpose() * &residuals_m;
        let Some(step) = normal.cholesky().map(|normal| normal.solve(&right)) else { break };
        let next = &solution + step;
        let (next_jacobian, next_residuals_m) = problem(&next);
        if next_residuals_m.norm_squared() < residuals_m.norm_squared() {
            (solution, jacobian, residuals_m) = (next, next_jacobian, next_residuals_m);
            damping = (damping * DAMPING_FACTORS[0]).max(LEAST_DAMPING);
        } else {
            damping *= DAMPING_FACTORS[1];
        }
    }
    (residuals_m.norm_squared(), solution, jacobian)
}
