//! The filter's pass over a log of ranges.
//!
//! State: position and velocity of each drone, which moves with a constant velocity but for white
//! acceleration noise.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::positions::{GATE_SIGMAS, range_jacobian};
use super::{Link, LocateOptions, RangeSample};
use noctograph_sim::kalman::{Entry, Gate, Measurement, Normal, Step, product, variance_rate};

pub(super) const STATES: usize = 6;

/// Ranges closer in time have one state.
pub(super) const STEP_S: f64 = 0.01;

/// A drone whose first range comes this much later than the first of all stands until then.
pub(super) const LATE_S: f64 = 0.25;

/// Inputs of every pass over a log.
pub(super) struct Model<'a> {
    pub(super) anchors_m: &'a [Vector3<f64>],
    pub(super) options: &'a LocateOptions,
    /// Until when each drone stands: its first range, if that comes late.
    stands_until_s: Vec<f64>,
}

#[derive(Debug, Default)]
pub(super) struct Innovations {
    /// Sum of the normalized innovations squared of the ranges that were taken, and their number.
    pub(super) sum: f64,
    pub(super) taken: usize,
    /// Ranges that the gate refused, by link.
    pub(super) refused: BTreeMap<Link, usize>,
}

impl Innovations {
    /// Counts a range: its normalized innovation squared, or none if it was refused.
    pub(super) fn note(&mut self, link: Link, nis: Option<f64>) {
        match nis {
            Some(nis) => (self.sum, self.taken) = (self.sum + nis, self.taken + 1),
            None => *self.refused.entry(link).or_default() += 1,
        }
    }

    /// Mean normalized innovation squared, `None` without a range.
    pub(super) fn nis(&self) -> Option<f64> {
        (self.taken > 0).then(|| self.sum / self.taken as f64)
    }
}

#[derive(Clone, Debug)]
pub(super) struct Filter {
    pub(super) normal: Normal,
    gate: Gate<Link>,
    last_s: Option<f64>,
    /// Ranges of all steps behind it.
    pub(super) ranges: usize,
}

/// Ranges of one state after another.
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

/// Multiplications of a pass forward and of one backward.
pub(super) fn work(n_drones: usize, samples: &[RangeSample]) -> f64 {
    let (states, steps) = ((STATES * n_drones) as f64, together(samples).count() as f64);
    samples.len() as f64 * states * states + steps * 6.0 * states * states * states
}

impl<'a> Model<'a> {
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

    pub(super) fn n_drones(&self) -> usize {
        self.stands_until_s.len()
    }

    pub(super) fn filter(&self, start: &Normal) -> Filter {
        let gate = Gate::new(GATE_SIGMAS);
        Filter { normal: start.clone(), gate, last_s: None, ranges: 0 }
    }

    /// Takes a filter one step on, linearized about its own estimate or about the states `here`.
    pub(super) fn advance(
        &self,
        filter: &mut Filter,
        step: &[RangeSample],
        here: Option<&[f64]>,
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
            // z = h(x₀) + H (x − x₀): linearized about x₀, the path of the pass before if given.
            let states = here.unwrap_or(normal.mean.as_slice());
            let (jacobian, expected_m) =
                range_jacobian(sample.link, self.anchors_m, states, STATES);
            let value = sample.distance_m - expected_m + product(&jacobian, states);
            let measurement = Measurement { jacobian: &jacobian, value, variance };
            let taken = gate.correct(normal, sample.link, &measurement);
            innovations.note(sample.link, taken.map(|innovation| innovation.nis()));
        }
        (filter.last_s, filter.ranges) = (Some(time_s), filter.ranges + step.len());
        Step { time_s, transition, predicted, updated: normal.clone() }
    }

    /// Transition of the state between two times, and the covariance of its noise.
    fn motion(&self, from_s: f64, to_s: f64) -> (Vec<Entry>, Vec<Entry>) {
        let (mut transition, mut noise) = (Vec::new(), Vec::new());
        let q = variance_rate(self.options.acceleration_m_s2_sqrt_hz);
        for (drone, until_s) in self.stands_until_s.iter().enumerate() {
            let span_s = (to_s - from_s.max(*until_s)).max(0.0);
            // White acceleration of density q (Bar-Shalom, Li, Kirubarajan 2001, section 6.2.2):
            // Q = q [t³/3, t²/2 | t²/2, t].
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
