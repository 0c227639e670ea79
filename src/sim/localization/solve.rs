//! Passes over a log of ranges, forward and backward, until the positions rest.

use nalgebra::{DVector, Matrix3, Vector3};

use super::pass::{Estimate, Innovations, Model};
use super::{Bias, RangeSample};
use crate::error::Result;

/// Most passes.
const MAX_PASSES: usize = 8;
/// Change of a position between two passes at which they end.
const CONVERGED_M: f64 = 1e-4;
/// A log after the last pass.
pub(super) struct Solved {
    pub(super) time_s: Vec<f64>,
    /// State and covariance at each time.
    pub(super) ends: Vec<Estimate>,
    pub(super) innovations: Innovations,
}

impl Solved {
    /// Positions: for each drone one at each time.
    pub(super) fn positions_m(&self, n_drones: usize) -> Vec<Vec<Vector3<f64>>> {
        let place =
            |drone: usize, state: &DVector<f64>| state.fixed_rows::<3>(6 * drone).into_owned();
        let places = |drone| self.ends.iter().map(|(state, _)| place(drone, state)).collect();
        (0..n_drones).map(places).collect()
    }

    /// Covariances of the positions.
    pub(super) fn covariances_m2(&self, n_drones: usize) -> Vec<Vec<Matrix3<f64>>> {
        let block = |drone: usize| {
            let at = (6 * drone, 6 * drone);
            self.ends.iter().map(|(_, p)| p.fixed_view::<3, 3>(at.0, at.1).into_owned()).collect()
        };
        (0..n_drones).map(block).collect()
    }

    /// The biases of the model, as the whole log has them.
    pub(super) fn biases(&self, model: &Model<'_>) -> Vec<Bias> {
        let Some((state, covariance)) = self.ends.last() else { return Vec::new() };
        let bias = |(k, of)| {
            let place = 6 * model.n_drones() + k;
            let sigma_m = covariance[(place, place)].max(0.0).sqrt();
            Bias { of, bias_m: state[place], sigma_m, in_doubt: false }
        };
        model.biases.iter().copied().enumerate().map(bias).collect()
    }
}

/// Passes over a log from a start until the positions rest.
pub(super) fn solve(
    model: &Model<'_>,
    samples: &[RangeSample],
    start: &Estimate,
    smooth: bool,
) -> Result<Solved> {
    // The innovations are those of the filter, which knows no later range.
    let (mut steps, innovations) = model.forward(samples, start, None);
    let mut smoothed: Option<Vec<Estimate>> = None;
    for _ in 0..if smooth { MAX_PASSES } else { 0 } {
        let next = model.backward(&steps)?;
        let moved_m = smoothed.as_ref().map_or(f64::INFINITY, |before| {
            let pairs = before.iter().zip(&next);
            pairs.map(|(a, b)| (&a.0 - &b.0).amax()).fold(0.0, f64::max)
        });
        let about = smoothed.insert(next);
        if moved_m < CONVERGED_M {
            break;
        }
        (steps, _) = model.forward(samples, start, Some(about));
    }
    let time_s = steps.iter().map(|step| step.time_s).collect();
    let ends = smoothed.unwrap_or_else(|| steps.into_iter().map(|step| step.updated).collect());
    Ok(Solved { time_s, ends, innovations })
}
