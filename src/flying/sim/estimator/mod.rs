//! Estimators: the drone's motion from its measurements. One file each.
//!
//! In: the [`Readings`] of a tick. Out: all twelve states, the controller's input.

mod altitude;
mod altitude_filter;
#[cfg(test)]
mod as_compiled;
mod bound;
mod cooperative;
mod deck;
mod ekf;
mod firmware;
#[cfg(test)]
mod in_flight;
mod luenberger;
mod past;
mod sweep_filter;
mod tdoa_filter;

use nalgebra::Vector3;

use self::altitude::Altitude;
pub use self::altitude_filter::{AltitudeFilter, AltitudeSensor, AltitudeState, HeightReading};
pub use self::bound::{Bound, bounds, one_more_anchor, writing_sigma_m};
use self::cooperative::Cooperative;
use self::ekf::Ekf;
use self::firmware::Firmware;
use self::luenberger::Observer;
use super::options::{EstimatorKind, SimOptions};
use crate::estimate::{Inertial, angles};
use crate::sensors::{Fleet, Positioning, Readings};
use crate::vehicle::{RigidBody, State};
use noctograph_core::error::Result;
use noctograph_core::random::Noise;

/// An estimator of the drone's motion.
#[derive(Debug)]
pub(super) enum Estimator {
    Luenberger(Box<Observer>),
    Firmware(Box<Firmware>),
    Ekf(Box<Ekf>),
    Altitude(Box<Altitude>),
    Cooperative(Box<Cooperative>),
    /// Cheats, for telling the controller's error from the estimator's: the true motion.
    Truth(RigidBody),
}

impl Estimator {
    /// Sets the initial yaw, from world x toward y, before the first update.
    pub(super) fn set_yaw(&mut self, yaw_rad: f64) {
        match self {
            Self::Luenberger(observer) => observer.set_yaw(yaw_rad),
            Self::Firmware(filter) => filter.set_yaw(yaw_rad),
            Self::Ekf(filter) => filter.set_yaw(yaw_rad),
            Self::Altitude(filters) => filters.set_yaw(yaw_rad),
            Self::Cooperative(filter) => filter.set_yaw(yaw_rad),
            Self::Truth(body) => *body = body.facing(yaw_rad),
        }
    }

    /// Updates the estimate by the readings at the end of a tick of `tick_s`.
    pub(super) fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        match self {
            Self::Luenberger(observer) => observer.update(readings, tick_s),
            Self::Firmware(filter) => filter.update(readings, tick_s),
            Self::Ekf(filter) => filter.update(readings, tick_s),
            Self::Altitude(filters) => filters.update(readings, tick_s),
            Self::Cooperative(filter) => filter.update(readings, tick_s),
            Self::Truth(body) => *body = *readings.truth,
        }
    }

    /// All twelve states.
    pub(super) fn state(&self) -> State {
        match self {
            Self::Luenberger(observer) => observer.state(),
            Self::Firmware(filter) => filter.state(),
            Self::Ekf(filter) => filter.state(),
            Self::Altitude(filters) => filters.state(),
            Self::Cooperative(filter) => filter.state(),
            Self::Truth(body) => body.state(),
        }
    }
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
/// along world x. The seed is that of the sweeps that it drops by chance.
///
/// # Errors
///
/// [`noctograph_core::error::Error::Infeasible`] where the observer's weights have no gain.
pub(super) fn estimator(
    options: &SimOptions,
    position_m: Vector3<f64>,
    fleet: &Fleet,
    seed: u64,
) -> Result<Estimator> {
    let SimOptions { observer, sensors, .. } = options;
    let ekf = || Ekf::new(&observer.ekf, sensors, position_m);
    Ok(match observer.kind {
        EstimatorKind::Luenberger => {
            Estimator::Luenberger(Box::new(Observer::new(&observer.luenberger, position_m)?))
        }
        EstimatorKind::Ekf => {
            let drone = fleet.members[fleet.place].index;
            let noise = Noise::new(seed, drone, "lighthouse deck");
            Estimator::Firmware(Box::new(Firmware::new(observer, sensors, position_m, noise)))
        }
        EstimatorKind::EkfImproved => Estimator::Ekf(Box::new(ekf())),
        EstimatorKind::Altitude => {
            let hover = options.believed_hover_throttle();
            Estimator::Altitude(Box::new(Altitude {
                horizontal: ekf(),
                vertical: AltitudeFilter::new(&observer.altitude, hover, position_m.z),
                has_satellites: sensors.positioning == Positioning::Gnss,
            }))
        }
        EstimatorKind::Cooperative => {
            Estimator::Cooperative(Box::new(Cooperative::new(observer, sensors, fleet)))
        }
        EstimatorKind::Truth => Estimator::Truth(RigidBody::at(position_m)),
    })
}
