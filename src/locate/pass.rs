//! Runs the filter over a log of ranges.
//!
//! The state contains each drone's position and velocity. The acceleration is white noise.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::positions::{GATE_SIGMAS, range_jacobian};
use super::{Link, LocateOptions, RangeSample};
use noctograph_sim::kalman::{Entry, Gate, Measurement, Normal, Step, product, variance_rate};

/// Number of states per drone, for position and velocity.
pub(super) const STATES: usize = 6;

/// Maximum time between ranges that are assigned to the same state.
pub(super) const STEP_S: f64 = 0.01;

/// Minimum delay between the log's first range and a drone's first range which implies that the
/// drone was on the ground until then.
pub(super) const LATE_S: f64 = 0.25;

/// Common inputs of all passes over a log.
pub(super) struct Model<'a> {
    pub(super) anchors_m: &'a [Vector3<f64>],
    pub(super) options: &'a LocateOptions,
    /// Time until which each drone is on the ground: that of its first range, if that is late.
    stands_until_s: Vec<f64>,
}

/// Sum of the normalized innovations squared of accepted ranges, and the numbers of accepted and
/// rejected ranges.
#[derive(Debug, Default)]
pub(super) struct Innovations {
    pub(super) sum: f64,
    pub(super) accepted: usize,
    pub(super) refused: BTreeMap<Link, usize>,
}

impl Innovations {
    /// Counts a range. `nis` is its normalized innovation squared, or `None` if the range was
    /// rejected.
    pub(super) fn record(&mut self, link: Link, nis: Option<f64>) {
        match nis {
            Some(nis) => (self.sum, self.accepted) = (self.sum + nis, self.accepted + 1),
            None => *self.refused.entry(link).or_default() += 1,
        }
    }

    /// Returns the mean normalized innovation squared, or `None` if no range was accepted.
    pub(super) fn nis(&self) -> Option<f64> {
        (self.accepted > 0).then(|| self.sum / self.accepted as f64)
    }
}

/// State of the Kalman filter between two steps.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    pub(super) normal: Normal,
    gate: Gate<Link>,
    /// Time of the last step, or `None` before the first.
    last_s: Option<f64>,
    /// Number of ranges in all earlier steps.
    pub(super) ranges: usize,
}

/// Splits samples, sorted by time, into steps of up to [`STEP_S`], each of which has one state.
pub(super) fn time_steps(samples: &[RangeSample]) -> impl Iterator<Item = &[RangeSample]> {
    let mut remaining = samples;
    std::iter::from_fn(move || {
        let first = remaining.first()?;
        let n = remaining.partition_point(|s| s.time_s < first.time_s + STEP_S);
        let (step, rest) = remaining.split_at(n.max(1));
        remaining = rest;
        Some(step)
    })
}

/// Returns the approximate number of multiplications in a forward and a backward pass.
pub(super) fn work(n_drones: usize, samples: &[RangeSample]) -> f64 {
    let (states, steps) = ((STATES * n_drones) as f64, time_steps(samples).count() as f64);
    // A range takes n² multiplications. A step takes about six products of n by n matrices.
    samples.len() as f64 * states * states + steps * 6.0 * states * states * states
}

impl<'a> Model<'a> {
    /// Creates the model of a log. A drone is on the ground until its first range if that is late.
    pub(super) fn new(
        anchors_m: &'a [Vector3<f64>],
        heard_s: &[[f64; 2]],
        options: &'a LocateOptions,
    ) -> Self {
        let first_s = heard_s.iter().map(|heard| heard[0]).fold(f64::INFINITY, f64::min);
        let late_s = first_s + LATE_S;
        let until_s = heard_s.iter().map(|&[s, _]| if s > late_s { s } else { first_s });
        Self { anchors_m, options, stands_until_s: until_s.collect() }
    }

    /// Returns the number of drones.
    pub(super) fn n_drones(&self) -> usize {
        self.stands_until_s.len()
    }

    /// Creates the filter that starts from the given mean and covariance.
    pub(super) fn filter(&self, start: &Normal) -> Filter {
        let gate = Gate::new(GATE_SIGMAS);
        Filter { normal: start.clone(), gate, last_s: None, ranges: 0 }
    }

    /// Advances a filter by one step of ranges, and returns the step for the backward pass.
    /// Jacobians are evaluated at the states `linearized_about`, or at the filter's estimate if
    /// that is `None`. Innovations are recorded.
    pub(super) fn advance(
        &self,
        filter: &mut Filter,
        step: &[RangeSample],
        linearized_about: Option<&[f64]>,
        innovations: &mut Innovations,
    ) -> Step {
        let Filter { normal, gate, .. } = filter;
        let variance = self.options.range_sigma_m * self.options.range_sigma_m;
        let (time_s, mut transition) = (step[0].time_s, Vec::new());
        if let Some(last_s) = filter.last_s {
            let noise;
            (transition, noise) = self.motion(last_s, time_s);
            normal.predict(&transition, &noise);
        }
        let predicted = normal.clone();
        for sample in step {
            // The measurement is z = h(x₀) + H (x − x₀), linearized about x₀.
            let states = linearized_about.unwrap_or(normal.mean.as_slice());
            let (jacobian, expected_m) =
                range_jacobian(sample.link, self.anchors_m, states, STATES);
            let value = sample.distance_m - expected_m + product(&jacobian, states);
            let measurement = Measurement { jacobian: &jacobian, value, variance };
            let innovation = gate.correct(normal, sample.link, &measurement);
            innovations.record(sample.link, innovation.map(|innovation| innovation.nis()));
        }
        (filter.last_s, filter.ranges) = (Some(time_s), filter.ranges + step.len());
        Step { time_s, transition, predicted, updated: normal.clone() }
    }

    /// Returns the transition of the state between two times, without its identity, and the
    /// covariance of its noise. A drone on the ground does not move.
    fn motion(&self, from_s: f64, to_s: f64) -> (Vec<Entry>, Vec<Entry>) {
        let (mut transition, mut noise) = (Vec::new(), Vec::new());
        let q = variance_rate(self.options.acceleration_m_s2_sqrt_hz);
        for (drone, until_s) in self.stands_until_s.iter().enumerate() {
            let span_s = (to_s - from_s.max(*until_s)).max(0.0);
            // The noise is that of a white acceleration with density q (Bar-Shalom, Li, Kirubarajan
            // 2001, section 6.2.2): Q = q [t³/3, t²/2 | t²/2, t].
            for i in STATES * drone..STATES * drone + 3 {
                transition.push((i, i + 3, span_s));
                noise.push((i, i, q * span_s * span_s * span_s / 3.0));
                noise.push((i, i + 3, q * span_s * span_s / 2.0));
                noise.push((i + 3, i + 3, q * span_s));
            }
        }
        (transition, noise)
    }
}
