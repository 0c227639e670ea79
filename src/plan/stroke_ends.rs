//! Errors of the light at the beginnings and ends of a flight's strokes.
//!
//! The flight's lag and mean error are removed first. The error of the light relative to the drone
//! remains.

use nalgebra::Vector3;

use super::Plan;
use super::lamp::LampTiming;
use super::light_letters::stretches;
use crate::tracking::{DesignPath, Part, no_design};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_core::parallel::prelude::*;

/// Error of the light at one end of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeEnd {
    /// Time in s at which the light changes, in the middle of its ramp.
    pub time_s: f64,
    /// Position in m at which the design's light changes.
    pub at_m: Vector3<f64>,
    /// True if the light goes on.
    pub on: bool,
    /// Length in m by which the light extends beyond the stroke's end, along the stroke. The length
    /// is negative if the light falls short of the end.
    pub streak_m: f64,
}

/// Maximum difference in s between the lag at an edge and the flight's lag.
const SEARCH_S: f64 = 0.3;
/// Number of search steps to either side.
const N_STEPS: i32 = 75;
/// Cost in m per second of difference from the flight's lag, since a drone may wait at an edge.
const LAG_COST_M_S: f64 = 0.03;
/// Speed in m/s below which a stroke has no direction.
const AT_REST_M_S: f64 = 1e-9;
/// Maximum number of samples that determine the lag of a flight.
const MAX_SAMPLES: usize = 2000;

/// Measures the errors of a plan's light commands at the ends of its strokes in a flight.
///
/// # Errors
///
/// Returns [`noctograph_core::error::Error::Input`] for a flight without samples or design.
pub fn stroke_ends(plan: &Plan, flight: &Flight, lamp: &LampTiming) -> Result<Vec<StrokeEnd>> {
    Ok(Aligned::new(flight)?.stroke_ends(plan, lamp))
}

/// Returns the rows at which the light switches, each with true if it switches on.
fn switches(levels: &[f64]) -> impl Iterator<Item = (usize, bool)> {
    let rows = stretches(levels).into_iter().flat_map(|lit| [(lit.start, true), (lit.end, false)]);
    rows.filter(|(row, _)| *row < levels.len())
}

/// State of the design at one end of a stroke.
pub(super) struct Edge {
    pub(super) time_s: f64,
    pub(super) at_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
}

impl Edge {
    /// Creates the edge of the light at a row. A stroke begins (`on`) at its first lit setpoint,
    /// and ends at its last lit one, because the first dark setpoint may already be elsewhere.
    pub(super) fn new(plan: &Plan, row: usize, on: bool) -> Self {
        let time_s = plan.setpoints[row].time_s;
        let drawing = &plan.setpoints[if on { row } else { row.max(1) - 1 }];
        Self { time_s, at_m: drawing.design_m(time_s), velocity_m_s: drawing.velocity_m_s }
    }

    /// True for the end of a stroke, false for the end of a dot.
    pub(super) fn moves(&self) -> bool {
        self.velocity_m_s != Vector3::zeros()
    }
}

/// Flight, with its lag and mean error.
pub(super) struct Aligned<'a> {
    samples: &'a [FlightSample],
    pub(super) lag_s: f64,
    /// Mean of `flown − design` in m after removal of the lag, which shifts the whole picture.
    offset_m: Vector3<f64>,
}

impl<'a> Aligned<'a> {
    /// Measures a flight's lag and mean error over the samples within letters. Returns an error
    /// without samples or a design.
    pub(super) fn new(flight: &'a Flight) -> Result<Self> {
        let writing = Part::Letters.selected(flight)?;
        DesignPath::exists(flight).ok_or_else(no_design)?;
        let mut aligned = Self { samples: &flight.samples, lag_s: 0.0, offset_m: Vector3::zeros() };
        let (stride, mut offset_m) = (writing.len().div_ceil(MAX_SAMPLES), Vector3::zeros());
        // The lag with the least variance is found in steps of 25 ms from -0.125 s to 1.5 s, and
        // around it in steps of 1 ms.
        for (first, last, step_s) in [(-5, 60, 0.025), (-25, 25, 0.001)] {
            let lags_s = (first..=last).map(|step| aligned.lag_s + f64::from(step) * step_s);
            let lags_s: Vec<f64> = lags_s.collect();
            let fits = lags_s.into_par_iter().map(|lag_s| {
                let sampled = writing.iter().step_by(stride).copied();
                let (mean_m, variance_m2) = aligned.offset_and_variance(sampled, lag_s);
                (variance_m2, lag_s, mean_m)
            });
            let fits: Vec<_> = fits.collect();
            let best = fits.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("a lag at least");
            (aligned.lag_s, offset_m) = (best.1, best.2);
        }
        aligned.offset_m = offset_m;
        Ok(aligned)
    }

    /// Returns the mean in m of `flown − design` after removal of a lag, and its variance in m² in
    /// the word's plane. The samples must be in chronological order.
    fn offset_and_variance<'s>(
        &self,
        samples: impl Iterator<Item = &'s FlightSample>,
        lag_s: f64,
    ) -> (Vector3<f64>, f64) {
        let (mut n, mut sum, mut squares) = (0.0, Vector3::zeros(), 0.0);
        // Because times ascend, each search starts from the samples around the previous time.
        let mut next = 0;
        for sample in samples {
            let time_s = sample.time_s + lag_s;
            next += self.samples[next..].iter().take_while(|later| later.time_s <= time_s).count();
            let error_m = self.interpolated_m(next, time_s) - sample.design_m;
            n += 1.0;
            sum += error_m;
            squares += error_m.xz().norm_squared();
        }
        let mean_m = sum / f64::max(n, 1.0);
        (mean_m, squares / f64::max(n, 1.0) - mean_m.xz().norm_squared())
    }

    /// Returns the position of the drone at a time in m, minus the mean error.
    fn position_m(&self, time_s: f64) -> Vector3<f64> {
        self.interpolated_m(self.samples.partition_point(|sample| sample.time_s <= time_s), time_s)
    }

    /// Returns the position in m at a time, minus the mean error, interpolated between the sample
    /// before `next` and the sample `next`.
    fn interpolated_m(&self, next: usize, time_s: f64) -> Vector3<f64> {
        let (before, after) = (next.max(1) - 1, next.min(self.samples.len() - 1));
        let [a, b] = [&self.samples[before], &self.samples[after]];
        let span_s = b.time_s - a.time_s;
        let fraction =
            if span_s > 0.0 { ((time_s - a.time_s) / span_s).clamp(0.0, 1.0) } else { 0.0 };
        a.position_m.lerp(&b.position_m, fraction) - self.offset_m
    }

    /// Returns the lag in s with which the drone passes an edge of the design, given the lag at the
    /// previous edge. This lag minimizes the sum of the squared distance from the edge and the
    /// squared cost of its difference from the flight's lag.
    pub(super) fn lag_at_s(&self, edge: &Edge, previous_lag_s: f64) -> f64 {
        let cost = |lag_s: f64| {
            let error_m2 = (self.position_m(edge.time_s + lag_s) - edge.at_m).xz().norm_squared();
            let lag_cost_m = LAG_COST_M_S * (lag_s - self.lag_s);
            error_m2 + lag_cost_m * lag_cost_m
        };
        // The search uses a grid, because the cost may have several minima, as at a crossing.
        let middle_s = 0.5 * (previous_lag_s + self.lag_s);
        let steps = (-N_STEPS..=N_STEPS)
            .map(|step| middle_s + f64::from(step) / f64::from(N_STEPS) * SEARCH_S);
        steps.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(previous_lag_s)
    }

    /// Returns the errors of the light at both ends of each stroke. The drone's distance along the
    /// stroke beyond its end is positive if the light streaks, and negative if the light is
    /// missing.
    pub(super) fn stroke_ends(&self, plan: &Plan, lamp: &LampTiming) -> Vec<StrokeEnd> {
        let (wanted, commanded) = (plan.lit(), plan.commanded());
        let pairs = switches(&wanted).zip(switches(&commanded));
        // The error is the drone's distance along the stroke beyond its end when the light changes.
        let ends = pairs.map(|((row, on), (sent, _))| {
            let time_s = lamp.light_s(plan.setpoints[sent].time_s);
            let edge = Edge::new(plan, row, on);
            // A dot has no direction, so its ends have no error.
            let along = edge.velocity_m_s.try_normalize(AT_REST_M_S).unwrap_or_else(Vector3::zeros);
            let beyond_m = (self.position_m(time_s) - edge.at_m).dot(&along);
            let streak_m = if on { -beyond_m } else { beyond_m };
            StrokeEnd { time_s, at_m: edge.at_m, on, streak_m }
        });
        ends.collect()
    }
}
