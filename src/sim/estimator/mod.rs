//! Estimators: the drone's motion from its measurements. One file each.
//!
//! In: the [`Readings`] of a tick. Out: all twelve states, the controller's input.

mod altitude;
mod altitude_filter;
mod bound;
mod cooperative;
mod ekf;
#[cfg(test)]
mod in_flight;
mod luenberger;
mod past;
mod truth;

use nalgebra::{Matrix3, Vector3};

use self::altitude::Altitude;
pub use self::altitude_filter::{AltitudeFilter, AltitudeSensor, AltitudeState, HeightReading};
pub use self::bound::{Bound, bounds, one_more_anchor, writing_sigma_m};
use self::cooperative::Cooperative;
use self::ekf::Ekf;
use self::luenberger::Observer;
use self::truth::Truth;
use super::options::{EstimatorKind, SimOptions};
use crate::error::Result;
use crate::estimate::{Inertial, angles};
use crate::sensors::{Fleet, Message, Positioning, Readings};
use crate::vehicle::State;

/// An estimator of the drone's motion.
pub(super) trait Estimator: std::fmt::Debug + Send {
    /// Updates the estimate by the readings at the end of a tick of `tick_s`.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64);

    /// Learns how its nose was put down, from world x toward y, before the first update.
    fn face(&mut self, yaw_rad: f64);

    /// Learns that the drone stands on the floor with its motors off.
    fn rest(&mut self) {}

    /// All twelve states.
    fn state(&self) -> State;

    /// The altitude filter, where there is one.
    fn altitude(&self) -> Option<&AltitudeFilter> {
        None
    }

    /// Covariance of the estimated position, where it is logged.
    fn covariance_m2(&self) -> Option<Matrix3<f64>> {
        None
    }

    /// A message to the other drones of the fleet.
    fn message(&mut self) -> Option<Message> {
        None
    }

    /// Receives a message of another drone of the fleet.
    fn receive(&mut self, _message: &Message) {}
}

/// All twelve states of a motion, at another velocity in the world.
fn state_at(motion: &Inertial, velocity_m_s: &Vector3<f64>) -> State {
    let (p, w) = (&motion.position_m, &motion.rate_rad_s);
    let world_from_body = motion.attitude.matrix();
    let a = angles(&world_from_body);
    let v = world_from_body.tr_mul(velocity_m_s);
    let turn = [a.yaw_rad, a.pitch_rad, a.roll_rad];
    State::from([p.x, p.y, p.z, turn[0], turn[1], turn[2], v.x, v.y, v.z, w.x, w.y, w.z])
}

/// The estimator of a flight, which starts with a level drone at rest at `position_m` that looks
/// along world x.
///
/// # Errors
///
/// [`crate::error::Error::Infeasible`] where the observer's weights have no gain.
pub(super) fn estimator(
    options: &SimOptions,
    position_m: Vector3<f64>,
    fleet: &Fleet,
) -> Result<Box<dyn Estimator>> {
    let SimOptions { observer, sensors, .. } = options;
    let ekf = || Ekf::new(&observer.ekf, sensors, position_m);
    Ok(match observer.kind {
        EstimatorKind::Luenberger => Box::new(Observer::new(&observer.luenberger, position_m)?),
        EstimatorKind::Ekf => Box::new(ekf()),
        EstimatorKind::Altitude => {
            let hover = options.believed_hover_throttle();
            Box::new(Altitude {
                horizontal: ekf(),
                vertical: AltitudeFilter::new(&observer.altitude, hover, position_m.z),
                has_satellites: sensors.positioning == Positioning::Gnss,
            })
        }
        EstimatorKind::Cooperative => Box::new(Cooperative::new(observer, sensors, fleet)),
        EstimatorKind::Truth => Box::new(Truth::new(position_m)),
    })
}
