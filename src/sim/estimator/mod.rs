//! Estimators, which determine the drone's motion from measurements. Each is in a separate file.
//!
//! The input is the [`Readings`] of a tick. The output is all twelve states, which are the
//! controller's input.

mod altitude;
mod altitude_filter;
#[cfg(test)]
mod as_compiled;
mod bound;
mod cooperative;
mod deck;
mod delayed;
mod ekf;
mod firmware;
#[cfg(test)]
mod in_flight;
mod luenberger;
mod sweep_filter;
mod tdoa_filter;

use nalgebra::{Matrix3, Vector3};

use self::altitude::Altitude;
pub use self::altitude_filter::{AltitudeFilter, AltitudeSensor, AltitudeState, HeightReading};
pub use self::bound::{Bound, bounds, one_more_anchor, writing_sigma_m};
use self::cooperative::Cooperative;
use self::ekf::Ekf;
use self::firmware::Firmware;
use self::luenberger::Observer;
pub(super) use self::luenberger::{hover_model, observer_gain, without_yaw};
use super::options::{EstimatorKind, SimOptions};
use crate::kalman::{Inertial, angles};
use crate::sensors::{Fleet, Positioning, Readings};
use crate::vehicle::{RigidBody, State, state};
use noctograph_core::error::Result;
use noctograph_core::random::Noise;

/// Update function of an external estimator. From the readings of a tick and its duration in s, the
/// function returns the states in the order of [`STATES`](crate::gain_design::STATES).
pub type Update = Box<dyn FnMut(&Readings<'_>, f64) -> [f64; 12] + Send>;

/// External estimator, and its last estimate.
pub(super) struct Outside {
    pub(super) update: Update,
    pub(super) state: State,
}

impl std::fmt::Debug for Outside {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.debug_struct("Outside").field("state", &self.state).finish_non_exhaustive()
    }
}

impl Estimator for Outside {
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        self.state = (self.update)(readings, tick_s).into();
    }

    fn state(&self) -> State {
        self.state
    }
}

/// Estimator of the drone's motion.
pub(super) trait Estimator: std::fmt::Debug + Send {
    /// Updates the estimate with the readings at the end of a tick of `tick_s`.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64);

    /// Returns the estimated state, in the order and the units of [`State`].
    fn state(&self) -> State;

    /// Returns the covariance of the estimated position in the world frame, if there is one.
    fn covariance_m2(&self) -> Option<Matrix3<f64>> {
        None
    }

    /// Returns the altitude filter, if the estimator has one.
    fn altitude(&self) -> Option<&AltitudeFilter> {
        None
    }

    /// Returns the estimator as a filter over a fleet, if it is one.
    fn fleet_filter(&mut self) -> Option<&mut Cooperative> {
        None
    }
}

/// Uses the true motion as the estimate, so that all errors are due to the controller.
impl Estimator for RigidBody {
    fn update(&mut self, readings: &Readings<'_>, _: f64) {
        *self = *readings.truth;
    }

    fn state(&self) -> State {
        Self::state(self)
    }
}

/// Returns all twelve states of a motion, but with the given velocity in the world frame, which is
/// converted to the body frame.
fn state_at(motion: &Inertial, velocity_m_s: &Vector3<f64>) -> State {
    let world_from_body = motion.attitude.matrix();
    let velocity_m_s = world_from_body.tr_mul(velocity_m_s);
    state(&motion.position_m, angles(&world_from_body), &velocity_m_s, &motion.rate_rad_s)
}

/// Creates the estimator that the options select, for a drone that starts level and at rest with
/// the given heading from world x toward y. The seed determines which sweeps are dropped at random.
/// Returns an error if the options give no gain.
pub(super) fn estimator(
    options: &SimOptions,
    position_m: Vector3<f64>,
    yaw_rad: f64,
    fleet: &Fleet,
    seed: u64,
) -> Result<Box<dyn Estimator>> {
    let SimOptions { observer, sensors, .. } = options;
    Ok(match observer.kind {
        EstimatorKind::Luenberger => {
            Box::new(Observer::new(&observer.luenberger, position_m, yaw_rad)?)
        }
        EstimatorKind::Ekf => {
            let drone = fleet.members[fleet.place].index;
            let noise = Noise::new(seed, drone, "lighthouse deck");
            Box::new(Firmware::new(observer, sensors, position_m, yaw_rad, noise))
        }
        EstimatorKind::EkfImproved => {
            Box::new(Ekf::new(&observer.ekf, sensors, position_m, yaw_rad))
        }
        EstimatorKind::Altitude => {
            let hover = options.believed_hover_throttle();
            Box::new(Altitude {
                horizontal: Ekf::new(&observer.ekf, sensors, position_m, yaw_rad),
                vertical: AltitudeFilter::new(&observer.altitude, hover, position_m.z),
                has_satellites: sensors.positioning == Positioning::Gnss,
            })
        }
        EstimatorKind::Cooperative => Box::new(Cooperative::new(observer, sensors, fleet, yaw_rad)),
        EstimatorKind::Truth => Box::new(RigidBody::resting_at(position_m).facing(yaw_rad)),
    })
}
