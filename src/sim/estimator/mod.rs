//! Estimators: what the drone believes about its motion. One file each.
//!
//! In: the [`Readings`] of a tick. Out: all twelve states, which the controller answers to.

mod attitude;
mod covariance;
mod ekf;
#[cfg(test)]
mod in_flight;
mod luenberger;
mod options;
mod truth;

use nalgebra::Vector3;

use self::ekf::Ekf;
use self::luenberger::Observer;
use self::truth::Truth;
use super::options::SimOptions;
use super::sensors::Readings;
use super::vehicle::State;
use crate::error::Result;

pub use self::options::{EstimatorKind, ObserverOptions};

/// What the drone believes about its motion.
pub(super) trait Estimator: std::fmt::Debug {
    /// Takes in what arrived at the tick that ends a span of `tick_s`.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64);

    /// All twelve states.
    fn state(&self) -> State;
}

/// The estimator of a flight, which begins by believing in a level drone at rest at `position_m`
/// that looks along world x.
///
/// # Errors
///
/// [`crate::error::Error::Infeasible`] where the observer's weights have no gain.
pub(super) fn estimator(
    options: &SimOptions,
    position_m: Vector3<f64>,
) -> Result<Box<dyn Estimator>> {
    Ok(match options.observer.kind {
        EstimatorKind::Luenberger => Box::new(Observer::new(&options.observer, position_m)?),
        EstimatorKind::Ekf => Box::new(Ekf::new(&options.observer, &options.sensors, position_m)),
        EstimatorKind::Truth => Box::new(Truth::new(position_m)),
    })
}
