//! One step backward over those of a filter, of Rauch, Tung and Striebel (AIAA Journal 3(8),
//! 1965).

use super::normal::{Entry, Normal};

/// One step that a filter recorded.
#[derive(Clone, Debug)]
pub struct Step {
    /// When.
    pub time_s: f64,
    /// Transition from the step before, as [`Normal::predict`] takes it.
    pub transition: Vec<Entry>,
    /// Before the measurements of this step.
    pub predicted: Normal,
    /// After them.
    pub updated: Normal,
}

impl Step {
    /// The states of this step as all measurements have them, given the step after it and what
    /// these make of that one; `None` where its predicted covariance is not positive.
    #[must_use]
    pub fn smoothed(&self, after: &Self, smooth: &Normal) -> Option<Normal> {
        let (updated, predicted) = (&self.updated, &after.predicted);
        let inverse = predicted.covariance.clone().cholesky()?;
        let mut carried = updated.covariance.clone();
        for &(row, column, value) in &after.transition {
            (0..carried.ncols()).for_each(|i| carried[(row, i)] += value * carried[(column, i)]);
        }
        let gain = inverse.solve(&carried).transpose();
        let mean = &updated.mean + &gain * (&smooth.mean - &predicted.mean);
        let change = &gain * (&smooth.covariance - &predicted.covariance) * gain.transpose();
        Some(Normal::new(mean, &updated.covariance + change))
    }
}
