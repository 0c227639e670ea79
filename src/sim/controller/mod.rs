//! Controllers, which convert an estimate and a setpoint to motor commands.
//!
//! The trait has four implementations, which [`ControllerKind`] selects. A controller runs
//! `rates.attitude_hz` times per second, and its command is held between runs.

mod altitude;
mod gain;
mod geometric;
mod linear;
mod lqr;
mod pid;
mod reference;
#[cfg(test)]
mod tests;

use nalgebra::{Vector3, Vector4};

use self::altitude::AltitudeHold;
pub use self::altitude::{ThrustMap, altitude_gains};
pub(super) use self::gain::{Gain, modeled_lag_s, with_integrals};
use self::geometric::Geometric;
pub(super) use self::linear::LinearController;
use self::lqr::Lqr;
use self::pid::PidCascade;
pub(super) use self::reference::Reference;
use super::options::{ControllerKind, SimOptions};
use crate::vehicle::{State, VELOCITY, attitude, velocity};
use noctograph_core::error::Result;

pub(super) trait Controller: std::fmt::Debug + Send {
    /// Returns the motor commands for the estimated state and the reference.
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command;

    /// Resets the integrals, and all else that is stored between two commands, while the motors are
    /// off.
    fn rest(&mut self, estimate: &State);

    /// Prepares for a change in the kind of setpoint, to level out, resume the flight or land.
    fn change_mode(&mut self, _: &State) {}

    /// Changes estimate and reference so that the drone flies level at the height of the last
    /// setpoint, as the firmware does when setpoints stop arriving.
    fn level_out(&self, estimate: &mut State, reference: &mut Reference) {
        // Without errors of position and velocity in x and y, the controller levels the drone.
        let held_m = Vector3::new(estimate[0], estimate[1], reference.position_m.z);
        *reference = Reference::holding(held_m);
        let world_from_body = attitude(estimate).world_from_body();
        let rising_m_s = Vector3::z() * (world_from_body * velocity(estimate)).z;
        estimate.fixed_rows_mut::<3>(VELOCITY).copy_from(&world_from_body.tr_mul(&rising_m_s));
    }

    /// Returns mutable references to the values that the controller stores between two commands.
    /// The regulators have no such memory, because their gains are known.
    fn memory(&mut self) -> Vec<&mut f64> {
        Vec::new()
    }

    /// Replaces the vehicle's thrust map with an estimate, in a controller that uses it.
    fn set_thrust_map(&mut self, _: ThrustMap) {}
}

/// Command to the motors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Command {
    /// Commands m1…m4, from 0 to `vehicle.motor_max`.
    pub(super) motors: Vector4<f64>,
    /// True if a motor was at its limit.
    pub(super) saturated: bool,
}

/// Creates the controller that the options select. Returns an error if the weights give no gain.
pub(super) fn controller(options: &SimOptions) -> Result<Box<dyn Controller>> {
    Ok(match options.controller.kind {
        ControllerKind::Lqr | ControllerKind::LqrFeedforward | ControllerKind::LqrIntegral => {
            Box::new(Lqr::new(options)?)
        }
        ControllerKind::Pid => Box::new(PidCascade::new(options)),
        ControllerKind::Geometric => Box::new(Geometric::new(options)),
        ControllerKind::Altitude => Box::new(AltitudeHold::new(options)?),
    })
}
