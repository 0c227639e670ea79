//! Passes over a log of ranges, forward and backward, until the positions rest.
//!
//! A pass forward and backward needs the covariances of every step, and their size grows with the
//! square of the states. Only the steps of one window are kept. For earlier windows a pass keeps
//! the filter at their start and recomputes their steps on the way back. The means of all steps and
//! the covariances of the positions are kept.

use nalgebra::{Matrix3, Vector3};

use super::RangeSample;
use super::pass::{Filter, Innovations, Model, STATES, together};
use noctograph_core::error::{Error, Result};
use noctograph_sim::kalman::{Normal, Step};

const MAX_PASSES: usize = 8;
/// Change of a position between two passes at which they end.
const CONVERGED_M: f64 = 1e-4;
/// Most memory of the steps of a window: less costs little time, since windows are made again once
/// each pass, and a minute of three drones is one window.
const WINDOW_BYTES: usize = 16 << 20;

#[derive(Debug, Default)]
pub(super) struct Path {
    states: usize,
    means: Vec<f64>,
    covariances_m2: Vec<Matrix3<f64>>,
}

impl Path {
    pub(super) fn states(&self, step: usize) -> &[f64] {
        &self.means[step * self.states..][..self.states]
    }

    /// Puts the states of a step in their place. Returns by how much they moved.
    fn put(&mut self, step: usize, n_drones: usize, normal: &Normal) -> f64 {
        let places = self.means[step * self.states..].iter_mut();
        let mut moved_m = 0.0_f64;
        for (place, mean) in places.zip(&normal.mean) {
            moved_m = moved_m.max((*place - mean).abs());
            *place = *mean;
        }
        // Of the covariance only that of the positions is kept.
        for drone in 0..n_drones {
            let first = STATES * drone;
            self.covariances_m2[step * n_drones + drone] = normal.block(first, first);
        }
        moved_m
    }
}

pub(super) struct Solved {
    pub(super) time_s: Vec<f64>,
    pub(super) path: Path,
    pub(super) innovations: Innovations,
}

impl Solved {
    pub(super) fn positions_m(&self, n_drones: usize) -> Vec<Vec<Vector3<f64>>> {
        Vec::from_iter((0..n_drones).map(|drone| {
            let steps = 0..self.time_s.len();
            let states = steps.map(|step| &self.path.states(step)[STATES * drone..]);
            states.map(|states| Vector3::from_column_slice(&states[..3])).collect()
        }))
    }

    pub(super) fn covariances_m2(&self, n_drones: usize) -> Vec<Vec<Matrix3<f64>>> {
        let every = self.path.covariances_m2.iter().copied();
        (0..n_drones).map(|drone| every.clone().skip(drone).step_by(n_drones).collect()).collect()
    }
}

/// Passes over a log from a start until the positions rest.
pub(super) fn solve(
    model: &Model<'_>,
    samples: &[RangeSample],
    start: &Normal,
    smooth: bool,
) -> Result<Solved> {
    Passes { model, samples, start, window: window(start.mean.len()) }.solve(smooth)
}

fn window(n_states: usize) -> usize {
    let numbers = 2 * n_states * (n_states + 2) + 3 * n_states;
    (WINDOW_BYTES / size_of::<f64>() / numbers).max(1)
}

struct Passes<'m, 'a> {
    model: &'m Model<'a>,
    samples: &'m [RangeSample],
    start: &'m Normal,
    window: usize,
}

struct Forward {
    /// The filter at the begin of each window.
    begins: Vec<Filter>,
    steps: Vec<Step>,
    innovations: Innovations,
}

impl Passes<'_, '_> {
    fn solve(&self, smooth: bool) -> Result<Solved> {
        let time_s: Vec<f64> = together(self.samples).map(|step| step[0].time_s).collect();
        let (n, states) = (time_s.len(), self.start.mean.len());
        let covariances_m2 = vec![Matrix3::zeros(); n * self.model.n_drones()];
        let mut path = Path { states, means: vec![0.0; n * states], covariances_m2 };
        if !smooth {
            let forward = self.forward(None, Some(&mut path));
            return Ok(Solved { time_s, path, innovations: forward.innovations });
        }
        // The innovations are those of the filter, which knows no later range.
        let first = self.forward(None, None);
        let (mut begins, mut steps) = (first.begins, first.steps);
        // Gauss–Newton: each pass is linearized about the smoothed path of the one before.
        for pass in 0..MAX_PASSES {
            let moved_m = self.backward(&begins, steps, pass > 0, &mut path)?;
            if pass > 0 && moved_m < CONVERGED_M || pass + 1 == MAX_PASSES {
                break;
            }
            Forward { begins, steps, .. } = self.forward(Some(&path), None);
        }
        Ok(Solved { time_s, path, innovations: first.innovations })
    }

    /// A pass forward, linearized about its estimates or about a path. `into` takes its states.
    fn forward(&self, about: Option<&Path>, mut into: Option<&mut Path>) -> Forward {
        let (mut begins, mut steps) = (Vec::new(), Vec::new());
        let (mut filter, mut innovations) = (self.model.filter(self.start), Innovations::default());
        for (k, ranges) in together(self.samples).enumerate() {
            if k.is_multiple_of(self.window) {
                begins.push(filter.clone());
                steps.clear();
            }
            // The filter at the beginning of a window is enough to make its steps again.
            let here = about.map(|about| about.states(k));
            let step = self.model.advance(&mut filter, ranges, here, &mut innovations);
            if let Some(path) = &mut into {
                path.put(k, self.model.n_drones(), &step.updated);
            }
            steps.push(step);
        }
        Forward { begins, steps, innovations }
    }

    /// The steps of a window, made again from the filter at its begin.
    fn again(&self, index: usize, begin: &Filter, about: Option<&Path>) -> Vec<Step> {
        let (mut filter, mut unused) = (begin.clone(), Innovations::default());
        let ranges = together(&self.samples[begin.ranges..]).take(self.window).enumerate();
        Vec::from_iter(ranges.map(|(k, ranges)| {
            let here = about.map(|about| about.states(index * self.window + k));
            self.model.advance(&mut filter, ranges, here, &mut unused)
        }))
    }

    /// A pass backward over the steps of a pass forward, which was linearized about the path or
    /// not. The smoothed states replace those of the path. Returns by how much the states moved.
    fn backward(
        &self,
        begins: &[Filter],
        last: Vec<Step>,
        linearized: bool,
        path: &mut Path,
    ) -> Result<f64> {
        let (mut last, mut moved_m) = (Some(last), 0.0_f64);
        let mut after: Option<(Step, Normal)> = None;
        for (index, begin) in begins.iter().enumerate().rev() {
            // The steps of the last window are still there. Those of earlier ones are made again.
            let about = linearized.then_some(&*path);
            let steps = last.take().unwrap_or_else(|| self.again(index, begin, about));
            for (k, step) in steps.into_iter().enumerate().rev() {
                let smooth = match &after {
                    None => step.updated.clone(),
                    Some((after, smooth)) => {
                        step.smoothed(after, smooth).ok_or_else(|| lost(after.time_s))?
                    }
                };
                let place = index * self.window + k;
                moved_m = moved_m.max(path.put(place, self.model.n_drones(), &smooth));
                after = Some((step, smooth));
            }
        }
        Ok(moved_m)
    }
}

fn lost(time_s: f64) -> Error {
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
