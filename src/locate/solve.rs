//! Passes over a log of ranges, forward and backward, until the positions rest.

use nalgebra::{Matrix3, Vector3};

use super::pass::{Innovations, Model, STATES};
use super::{Bias, RangeSample};
use noctograph_core::error::{Error, Result};
use noctograph_flying::estimate::{Normal, smoothed};

/// Most passes.
const MAX_PASSES: usize = 8;
/// Change of a position between two passes at which they end.
const CONVERGED_M: f64 = 1e-4;
/// A log after the last pass.
pub(super) struct Solved {
    pub(super) time_s: Vec<f64>,
    /// State and covariance at each time.
    pub(super) ends: Vec<Normal>,
    pub(super) innovations: Innovations,
}

impl Solved {
    /// Positions: for each drone one at each time.
    pub(super) fn positions_m(&self, n_drones: usize) -> Vec<Vec<Vector3<f64>>> {
        let places = |drone| self.ends.iter().map(|end| end.three(STATES * drone)).collect();
        (0..n_drones).map(places).collect()
    }

    /// Covariances of the positions.
    pub(super) fn covariances_m2(&self, n_drones: usize) -> Vec<Vec<Matrix3<f64>>> {
        let block = |drone: usize| {
            let at = STATES * drone;
            self.ends.iter().map(|end| end.block(at, at)).collect()
        };
        (0..n_drones).map(block).collect()
    }

    /// The biases of the model, as the whole log has them.
    pub(super) fn biases(&self, model: &Model<'_>) -> Vec<Bias> {
        let Some(end) = self.ends.last() else { return Vec::new() };
        let bias = |(k, of)| {
            let state = STATES * model.n_drones() + k;
            Bias { of, bias_m: end.mean[state], sigma_m: end.sigma(state), in_doubt: false }
        };
        model.biases.iter().copied().enumerate().map(bias).collect()
    }
}

/// Passes over a log from a start until the positions rest.
pub(super) fn solve(
    model: &Model<'_>,
    samples: &[RangeSample],
    start: &Normal,
    smooth: bool,
) -> Result<Solved> {
    // The innovations are those of the filter, which knows no later range.
    let (mut steps, innovations) = model.forward(samples, start, None);
    let mut ends: Option<Vec<Normal>> = None;
    for _ in 0..if smooth { MAX_PASSES } else { 0 } {
        let next = smoothed(&steps).map_err(|lost| Error::Infeasible {
            what: format!("the filter has lost its covariance at {:.2} s", steps[lost].time_s),
            hint: "raise the noise of the ranges or the acceleration".into(),
        })?;
        let moved_m = ends.as_ref().map_or(f64::INFINITY, |before| {
            let pairs = before.iter().zip(&next);
            pairs.map(|(a, b)| (&a.mean - &b.mean).amax()).fold(0.0, f64::max)
        });
        let about = ends.insert(next);
        if moved_m < CONVERGED_M {
            break;
        }
        (steps, _) = model.forward(samples, start, Some(about));
    }
    let time_s = steps.iter().map(|step| step.time_s).collect();
    let ends = ends.unwrap_or_else(|| steps.into_iter().map(|step| step.updated).collect());
    Ok(Solved { time_s, ends, innovations })
}
