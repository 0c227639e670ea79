//! Controllers: an estimate and a setpoint become motor commands.
//!
//! Five of them behind one trait, chosen by [`ControllerKind`]. The rig asks one
//! `rates.attitude_hz` times a second, and holds its answer in between as the firmware does.

mod geometric;
mod integral;
mod lqr;
pub(super) mod options;
mod pid;
mod reference;
mod rotor_model;
#[cfg(test)]
mod tests;

use nalgebra::Vector4;

use self::geometric::Geometric;
use self::integral::IntegralLqr;
pub(super) use self::integral::{augmented, augmented_gain};
pub(super) use self::lqr::lqr_gain;
use self::lqr::{Follows, Lqr};
use self::options::ControllerKind;
use self::pid::PidCascade;
pub(super) use self::reference::Reference;
pub(super) use self::rotor_model::{Gain, known_lag_s};
use super::options::SimOptions;
use super::vehicle::State;
use crate::error::Result;

/// What steers the drone.
pub(super) trait Controller: std::fmt::Debug + Send {
    /// Motor commands for where the drone believes to be and where it should be.
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command;

    /// The motors are off: forgets what it has summed up.
    fn rest(&mut self, estimate: &State);
}

/// What the motors are told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Command {
    /// m1…m4, from 0 to `vehicle.motor_max`.
    pub(super) motors: Vector4<f64>,
    /// Whether a motor could not do what was wanted of it.
    pub(super) saturated: bool,
}

/// The controller that the options name.
///
/// # Errors
///
/// [`crate::error::Error::Infeasible`] where a regulator's weights have no gain.
pub(super) fn controller(options: &SimOptions) -> Result<Box<dyn Controller>> {
    Ok(match options.controller.kind {
        ControllerKind::Lqr => Box::new(Lqr::new(options, Follows::Setpoint)?),
        ControllerKind::LqrFeedforward => Box::new(Lqr::new(options, Follows::Design)?),
        ControllerKind::LqrIntegral => Box::new(IntegralLqr::new(options)?),
        ControllerKind::Pid => Box::new(PidCascade::new(options)),
        ControllerKind::Geometric => Box::new(Geometric::new(options)),
    })
}
