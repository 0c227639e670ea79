//! Two passes over a log of ranges: a Kalman filter forward, a smoother backward.
//!
//! State: position and velocity of each drone, then the biases of the ranges, which are constant.
//! Each drone moves with a constant velocity but for white acceleration noise. The backward pass is
//! that of Rauch, Tung and Striebel (AIAA Journal 3(8), 1965).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3};

use super::positions::slope;
use super::{BiasOf, Link, LocateOptions, RangeSample};
use crate::control::LockOut;
use crate::error::{Error, Result};

/// Ranges closer in time share one state.
pub(super) const STEP_S: f64 = 0.01;

/// A drone whose first range comes this much later than the first of all stands until then.
pub(super) const LATE_S: f64 = 0.25;

/// A state and its covariance.
pub(super) type Estimate = (DVector<f64>, DMatrix<f64>);

/// What the passes know of a log.
pub(super) struct Model<'a> {
    pub(super) anchors_m: &'a [Vector3<f64>],
    pub(super) options: &'a LocateOptions,
    /// Biases in the order of their states.
    pub(super) biases: Vec<BiasOf>,
    /// Standard deviations of its innovation beyond which a range is refused.
    pub(super) gate_sigmas: f64,
    /// Ranges that are left out, one flag each; empty: none.
    pub(super) left_out: Vec<bool>,
    /// Until when each drone stands: its first range, where that comes late.
    stands_until_s: Vec<f64>,
}

/// One step of the filter: its prediction, and the update by its ranges.
pub(super) struct Step {
    pub(super) time_s: f64,
    predicted: Estimate,
    pub(super) updated: Estimate,
}

/// What the filter found of its ranges.
#[derive(Debug, Default)]
pub(super) struct Innovations {
    /// Sum of the normalized innovations squared of the ranges that were taken, and their number.
    pub(super) sum: f64,
    pub(super) taken: usize,
    /// Ranges that the gate refused, by link.
    pub(super) refused: BTreeMap<Link, usize>,
}

impl Innovations {
    /// Mean normalized innovation squared; `None` without a range.
    pub(super) fn nis(&self) -> Option<f64> {
        #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
        (self.taken > 0).then(|| self.sum / self.taken as f64)
    }
}

/// Ranges that share one state, in order.
pub(super) fn together(samples: &[RangeSample]) -> impl Iterator<Item = &[RangeSample]> {
    let mut left = samples;
    std::iter::from_fn(move || {
        let first = left.first()?;
        let n = left.partition_point(|s| s.time_s < first.time_s + STEP_S);
        let (step, rest) = left.split_at(n.max(1));
        left = rest;
        Some(step)
    })
}

impl<'a> Model<'a> {
    pub(super) fn new(
        anchors_m: &'a [Vector3<f64>],
        heard_s: &[[f64; 2]],
        options: &'a LocateOptions,
    ) -> Self {
        let first_s = heard_s.iter().map(|heard| heard[0]).fold(f64::INFINITY, f64::min);
        let until = |heard: &[f64; 2]| if heard[0] > first_s + LATE_S { heard[0] } else { first_s };
        Self {
            anchors_m,
            options,
            biases: Vec::new(),
            gate_sigmas: options.gate_sigmas,
            left_out: Vec::new(),
            stands_until_s: heard_s.iter().map(until).collect(),
        }
    }

    /// The same log with other biases.
    pub(super) fn with_biases(&self, biases: Vec<BiasOf>) -> Self {
        let (left_out, stands_until_s) = (self.left_out.clone(), self.stands_until_s.clone());
        Self { biases, left_out, stands_until_s, ..*self }
    }

    pub(super) fn n_drones(&self) -> usize {
        self.stands_until_s.len()
    }

    /// Slope of a range over the whole state, and the range that is expected at a state.
    pub(super) fn slope(&self, link: Link, at: &DVector<f64>) -> (DVector<f64>, f64) {
        let n = 3 * self.n_drones();
        let places = DVector::from_fn(n, |i, _| at[6 * (i / 3) + i % 3]);
        let (short, mut expected_m) = slope(link, self.anchors_m, &places);
        let mut h = DVector::zeros(at.len());
        for i in 0..n {
            h[6 * (i / 3) + i % 3] = short[i];
        }
        for (k, bias) in self.biases.iter().enumerate().filter(|(_, bias)| bias.covers(link)) {
            let place = 2 * n + k;
            debug_assert!(place < at.len(), "{bias} has a state");
            h[place] = 1.0;
            expected_m += at[place];
        }
        (h, expected_m)
    }

    /// Forward Kalman pass, linearized about its own estimates or about `about`.
    pub(super) fn forward(
        &self,
        samples: &[RangeSample],
        (state, covariance): &Estimate,
        about: Option<&[Estimate]>,
    ) -> (Vec<Step>, Innovations) {
        let (mut x, mut p) = (state.clone(), covariance.clone());
        let variance = self.options.range_sigma_m * self.options.range_sigma_m;
        let gate = self.gate_sigmas * self.gate_sigmas;
        let mut gates: BTreeMap<Link, LockOut> = BTreeMap::new();
        let (mut steps, mut found) = (Vec::<Step>::new(), Innovations::default());
        let mut left_out = self.left_out.iter().chain(std::iter::repeat(&false));
        for step in together(samples) {
            let time_s = step[0].time_s;
            if let Some(last) = steps.last() {
                let (phi, noise) = self.motion(last.time_s, time_s, x.len());
                x = &phi * x;
                p = &phi * p * phi.transpose() + noise;
            }
            let predicted = (x.clone(), p.clone());
            let here = about.and_then(|about| about.get(steps.len()));
            for sample in step {
                let at = here.map_or(&x, |(state, _)| state);
                let (h, expected_m) = self.slope(sample.link, at);
                let innovation = sample.distance_m - expected_m - h.dot(&(&x - at));
                let a = &p * &h;
                let spread = h.dot(&a);
                let link_gate = gates.entry(sample.link).or_default();
                let s = spread + link_gate.variance(variance, innovation);
                let is_stray = left_out.next().is_some_and(|stray| *stray);
                let taken = !is_stray && innovation * innovation <= gate * s;
                link_gate.note(taken);
                if !taken {
                    *found.refused.entry(sample.link).or_default() += 1;
                    continue;
                }
                found.sum += innovation * innovation / s;
                found.taken += 1;
                x.axpy(innovation / s, &a, 1.0);
                p.ger(-1.0 / s, &a, &a, 1.0);
            }
            steps.push(Step { time_s, predicted, updated: (x.clone(), p.clone()) });
        }
        (steps, found)
    }

    /// Transition of the state between two times, and the covariance of its noise.
    fn motion(&self, from_s: f64, to_s: f64, size: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let (mut phi, mut noise) = (DMatrix::identity(size, size), DMatrix::zeros(size, size));
        let density = self.options.acceleration_m_s2_sqrt_hz;
        let q = 0.5 * density * density;
        for (drone, until_s) in self.stands_until_s.iter().enumerate() {
            let span_s = (to_s - from_s.max(*until_s)).max(0.0);
            for i in 6 * drone..6 * drone + 3 {
                phi[(i, i + 3)] = span_s;
                noise[(i, i)] = q * span_s * span_s * span_s / 3.0;
                noise[(i, i + 3)] = q * span_s * span_s / 2.0;
                noise[(i + 3, i)] = noise[(i, i + 3)];
                noise[(i + 3, i + 3)] = q * span_s;
            }
        }
        (phi, noise)
    }

    /// Smoothed states and covariances.
    pub(super) fn backward(&self, steps: &[Step]) -> Result<Vec<Estimate>> {
        let mut found: Vec<Estimate> = Vec::with_capacity(steps.len());
        for (k, step) in steps.iter().enumerate().rev() {
            let (state, covariance) = &step.updated;
            let Some(((x_after, p_after), after)) = found.last().zip(steps.get(k + 1)) else {
                found.push(step.updated.clone());
                continue;
            };
            let (phi, _) = self.motion(step.time_s, after.time_s, state.len());
            let (x_predicted, p_predicted) = &after.predicted;
            let Some(inverse) = p_predicted.clone().cholesky() else {
                return Err(Error::Infeasible {
                    what: format!("the filter has lost its covariance at {:.2} s", after.time_s),
                    hint: "raise the noise of the ranges or the acceleration".into(),
                });
            };
            let gain = inverse.solve(&(phi * covariance)).transpose();
            let x = state + &gain * (x_after - x_predicted);
            let p = covariance + &gain * (p_after - p_predicted) * gain.transpose();
            found.push((x, p));
        }
        found.reverse();
        Ok(found)
    }
}
