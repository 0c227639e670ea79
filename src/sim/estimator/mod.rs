//! Estimators: the drone's motion from its measurements. One file each.
//!
//! In: the [`Readings`] of a tick. Out: all twelve states, the controller's input.

mod attitude;
mod bound;
mod cooperative;
mod covariance;
mod ekf;
#[cfg(test)]
mod in_flight;
mod joint;
mod luenberger;
mod truth;

use nalgebra::{Matrix3, Vector3};

pub use self::bound::{Bound, bounds, one_more_anchor, writing_sigma_m};
use self::cooperative::Cooperative;
use self::ekf::Ekf;
use self::luenberger::Observer;
use self::truth::Truth;
use super::options::{EstimatorKind, ObserverOptions, SensorOptions};
use super::peers::{Fleet, Message};
use super::sensors::Readings;
use super::vehicle::State;
use crate::error::Result;

/// An estimator of the drone's motion.
pub(super) trait Estimator: std::fmt::Debug {
    /// Updates the estimate by the readings at the end of a tick of `tick_s`.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64);

    /// All twelve states.
    fn state(&self) -> State;

    /// Covariance of the estimated position, where it is logged.
    fn covariance_m2(&self) -> Option<Matrix3<f64>> {
        None
    }

    /// A message to the other drones of the fleet.
    fn tell(&mut self) -> Option<Message> {
        None
    }

    /// Hears a message of another drone of the fleet.
    fn hear(&mut self, _told: &Message) {}
}

/// The estimator of a flight, which starts with a level drone at rest at `position_m` that looks
/// along world x.
///
/// # Errors
///
/// [`crate::error::Error::Infeasible`] where the observer's weights have no gain.
pub(super) fn estimator(
    options: &ObserverOptions,
    sensors: &SensorOptions,
    position_m: Vector3<f64>,
    fleet: &Fleet,
) -> Result<Box<dyn Estimator>> {
    Ok(match options.kind {
        EstimatorKind::Luenberger => Box::new(Observer::new(&options.luenberger, position_m)?),
        EstimatorKind::Ekf => Box::new(Ekf::new(&options.ekf, sensors, position_m)),
        EstimatorKind::Cooperative => Box::new(Cooperative::new(options, sensors, fleet)),
        EstimatorKind::Truth => Box::new(Truth::new(position_m)),
    })
}
