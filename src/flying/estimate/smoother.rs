//! The backward pass over the steps of a filter, of Rauch, Tung and Striebel (AIAA Journal 3(8),
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

/// The states of all steps as all measurements have them; where the covariance of a step is not
/// positive, its index.
///
/// # Errors
///
/// That index.
pub fn smoothed(steps: &[Step]) -> Result<Vec<Normal>, usize> {
    let mut found: Vec<Normal> = Vec::with_capacity(steps.len());
    for (k, step) in steps.iter().enumerate().rev() {
        let Some((smooth, after)) = found.last().zip(steps.get(k + 1)) else {
            found.push(step.updated.clone());
            continue;
        };
        let (updated, predicted) = (&step.updated, &after.predicted);
        let Some(inverse) = predicted.covariance.clone().cholesky() else { return Err(k + 1) };
        let mut carried = updated.covariance.clone();
        for &(row, column, value) in &after.transition {
            (0..carried.ncols()).for_each(|i| carried[(row, i)] += value * carried[(column, i)]);
        }
        let gain = inverse.solve(&carried).transpose();
        let mean = &updated.mean + &gain * (&smooth.mean - &predicted.mean);
        let change = &gain * (&smooth.covariance - &predicted.covariance) * gain.transpose();
        found.push(Normal::new(mean, &updated.covariance + change));
    }
    found.reverse();
    Ok(found)
}
