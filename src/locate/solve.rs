//! Runs forward and backward passes over a log of ranges until the positions converge.
//!
//! A forward and a backward pass require the covariances of every step, whose size is quadratic in
//! the number of states. Therefore only one window of steps is kept in memory. For each earlier
//! window, the filter at its start is kept, from which the backward pass recomputes the window's
//! steps. The means of all steps and the covariances of the positions are always kept.

use nalgebra::{Matrix3, Vector3};

use super::RangeSample;
use super::pass::{Filter, Innovations, Model, STATES, time_steps};
use noctograph_core::error::{Error, Result};
use noctograph_sim::kalman::{Normal, Step};

/// Maximum number of backward passes.
const MAX_PASSES: usize = 8;
/// Change of a state between two passes below which iteration ends.
const CONVERGED: f64 = 1e-4;
/// Maximum memory for a window's steps. A smaller limit costs little time, because each window is
/// recomputed only once per pass. One window holds a minute of three drones.
const WINDOW_BYTES: usize = 16 << 20;

/// States at all steps: their means, and the covariances of the positions by step and drone.
#[derive(Debug, Default)]
pub(super) struct Path {
    states: usize,
    means: Vec<f64>,
    covariances_m2: Vec<Matrix3<f64>>,
}

impl Path {
    /// Returns the means of the states of all drones at a step, in m and m/s.
    pub(super) fn states(&self, step: usize) -> &[f64] {
        &self.means[step * self.states..][..self.states]
    }

    /// Replaces the states of a step. Returns the largest change in a mean, in m or m/s.
    fn store(&mut self, step: usize, n_drones: usize, normal: &Normal) -> f64 {
        let stored = self.means[step * self.states..].iter_mut();
        let mut largest_change = 0.0_f64;
        for (stored, mean) in stored.zip(&normal.mean) {
            largest_change = largest_change.max((*stored - mean).abs());
            *stored = *mean;
        }
        // Velocities are the last three states of a drone. Their covariance is dropped.
        for drone in 0..n_drones {
            let first = STATES * drone;
            self.covariances_m2[step * n_drones + drone] = normal.block(first, first);
        }
        largest_change
    }
}

/// States after the last pass, and innovations of the first one.
pub(super) struct Solution {
    pub(super) time_s: Vec<f64>,
    pub(super) path: Path,
    pub(super) innovations: Innovations,
}

impl Solution {
    /// Returns the positions in m of each drone at all steps.
    pub(super) fn positions_m(&self, n_drones: usize) -> Vec<Vec<Vector3<f64>>> {
        Vec::from_iter((0..n_drones).map(|drone| {
            let steps = 0..self.time_s.len();
            let states = steps.map(|step| &self.path.states(step)[STATES * drone..]);
            states.map(|states| Vector3::from_column_slice(&states[..3])).collect()
        }))
    }

    /// Returns the position covariances of each drone at all steps.
    pub(super) fn covariances_m2(&self, n_drones: usize) -> Vec<Vec<Matrix3<f64>>> {
        let all = self.path.covariances_m2.iter().copied();
        (0..n_drones).map(|drone| all.clone().skip(drone).step_by(n_drones).collect()).collect()
    }
}

/// Runs passes over a log until the states converge, or one forward pass if `smooth` is false.
/// Returns [`Error::Infeasible`] if a covariance becomes singular.
pub(super) fn solve(
    model: &Model<'_>,
    samples: &[RangeSample],
    start: &Normal,
    smooth: bool,
) -> Result<Solution> {
    Passes { model, samples, start, window: window(start.mean.len()) }.solve(smooth)
}

/// Returns the number of steps that fit in [`WINDOW_BYTES`], at least one.
fn window(n_states: usize) -> usize {
    // A step contains two means, two covariances, and the entries of its transition.
    let numbers = 2 * n_states * (n_states + 2) + 3 * n_states;
    (WINDOW_BYTES / size_of::<f64>() / numbers).max(1)
}

/// Common inputs of all passes. `window` is a number of steps.
struct Passes<'m, 'a> {
    model: &'m Model<'a>,
    samples: &'m [RangeSample],
    start: &'m Normal,
    window: usize,
}

/// Results of a forward pass. `steps` contains those of the last window.
struct Forward {
    /// State of the filter at the start of each window.
    window_starts: Vec<Filter>,
    steps: Vec<Step>,
    innovations: Innovations,
}

impl Passes<'_, '_> {
    /// Runs passes until they converge, or only the first forward pass if `smooth` is false. The
    /// path contains the states of the last pass.
    fn solve(&self, smooth: bool) -> Result<Solution> {
        let time_s: Vec<f64> = time_steps(self.samples).map(|step| step[0].time_s).collect();
        let (n, states) = (time_s.len(), self.start.mean.len());
        let covariances_m2 = vec![Matrix3::zeros(); n * self.model.n_drones()];
        let mut path = Path { states, means: vec![0.0; n * states], covariances_m2 };
        if !smooth {
            let forward = self.forward(None, Some(&mut path));
            return Ok(Solution { time_s, path, innovations: forward.innovations });
        }
        // The innovations are those of the first pass, before later ranges improve the path.
        let first = self.forward(None, None);
        let (mut window_starts, mut steps) = (first.window_starts, first.steps);
        // For Gauss–Newton, each pass is linearized about the smoothed path from the previous one.
        for pass in 0..MAX_PASSES {
            let largest_change = self.backward(&window_starts, steps, pass > 0, &mut path)?;
            if pass > 0 && largest_change < CONVERGED || pass + 1 == MAX_PASSES {
                break;
            }
            Forward { window_starts, steps, .. } = self.forward(Some(&path), None);
        }
        Ok(Solution { time_s, path, innovations: first.innovations })
    }

    /// Runs a forward pass, linearized about a path or, if that is `None`, about its own estimates.
    /// Stores the states in `into`. Returns the filters at the starts of the windows, and the steps
    /// of the last window.
    fn forward(&self, about: Option<&Path>, mut into: Option<&mut Path>) -> Forward {
        let (mut window_starts, mut steps) = (Vec::new(), Vec::new());
        let (mut filter, mut innovations) = (self.model.filter(self.start), Innovations::default());
        for (k, ranges) in time_steps(self.samples).enumerate() {
            if k.is_multiple_of(self.window) {
                window_starts.push(filter.clone());
                steps.clear();
            }
            // The steps of a window can be recomputed from the filter at its start.
            let linearized_about = about.map(|about| about.states(k));
            let step = self.model.advance(&mut filter, ranges, linearized_about, &mut innovations);
            if let Some(path) = &mut into {
                path.store(k, self.model.n_drones(), &step.updated);
            }
            steps.push(step);
        }
        Forward { window_starts, steps, innovations }
    }

    /// Returns the steps of window `index`, recomputed from the filter at its start. `about` is the
    /// path about which the forward pass was linearized.
    fn recomputed(&self, index: usize, window_start: &Filter, about: Option<&Path>) -> Vec<Step> {
        let (mut filter, mut unused) = (window_start.clone(), Innovations::default());
        let ranges = time_steps(&self.samples[window_start.ranges..]).take(self.window).enumerate();
        Vec::from_iter(ranges.map(|(k, ranges)| {
            let linearized_about = about.map(|about| about.states(index * self.window + k));
            self.model.advance(&mut filter, ranges, linearized_about, &mut unused)
        }))
    }

    /// Runs a backward pass, and stores the smoothed states in the path. `linearized` is true if
    /// the forward pass was linearized about that path. Returns the largest change in a state, or
    /// an error if a covariance is singular.
    fn backward(
        &self,
        window_starts: &[Filter],
        last: Vec<Step>,
        linearized: bool,
        path: &mut Path,
    ) -> Result<f64> {
        let (mut last, mut largest_change) = (Some(last), 0.0_f64);
        let mut next: Option<(Step, Normal)> = None;
        for (index, window_start) in window_starts.iter().enumerate().rev() {
            // The last window's steps are still in memory. Earlier windows are recomputed.
            let about = linearized.then_some(&*path);
            let steps = last.take().unwrap_or_else(|| self.recomputed(index, window_start, about));
            for (k, step) in steps.into_iter().enumerate().rev() {
                let smooth = match &next {
                    None => step.updated.clone(),
                    Some((next, smooth)) => {
                        step.smoothed(next, smooth).ok_or_else(|| covariance_lost(next.time_s))?
                    }
                };
                let step_index = index * self.window + k;
                largest_change =
                    largest_change.max(path.store(step_index, self.model.n_drones(), &smooth));
                next = Some((step, smooth));
            }
        }
        Ok(largest_change)
    }
}

/// Returns the error for a covariance at a time in s that cannot be inverted.
fn covariance_lost(time_s: f64) -> Error {
    Error::infeasible(
        format!("the filter has lost its covariance at {time_s:.2} s"),
        "raise the noise of the ranges or the acceleration",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LocateOptions;
    use crate::smoother::heard_s;
    use crate::tests::flight;

    #[test]
    fn windows_of_any_length_give_the_bits_of_the_whole_flight() {
        let (anchors_m, _, mut samples) = flight(0.06);
        samples.truncate(900);
        let (heard_s, options) = (heard_s(2, &samples), LocateOptions::default());
        let model = Model::new(&anchors_m, &heard_s, &options);
        let mut start = Normal::independent(&[0.3; 12]);
        start.mean.iter_mut().enumerate().for_each(|(k, x)| *x = [0.4, 0.0, 1.0][k % 3]);
        let solved_with = |window| {
            let passes = Passes { model: &model, samples: &samples, start: &start, window };
            let solved = passes.solve(true).unwrap();
            (solved.path.means, solved.path.covariances_m2, solved.innovations.sum)
        };
        let whole = solved_with(usize::MAX);
        assert!(whole.0.iter().all(|x| x.is_finite()));
        for window in [1, 7, 100, 449] {
            assert!(solved_with(window) == whole, "{window}");
        }
    }
}
