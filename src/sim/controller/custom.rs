//! A controller from outside the program.

use super::{Command, Controller, Reference};
use crate::vehicle::State;

/// A controller: the estimated state and the reference become the motor commands m1…m4, which are held
/// within 0 and the largest.
///
/// The state is position (m, world), yaw, pitch and roll (rad), velocity (m/s) and angular velocity
/// (rad/s) in the body frame; the reference is position (m), velocity (m/s) and acceleration (m/s²) of the
/// design at this instant, in the world. It is called `rates.attitude_hz` times a second while the motors
/// are on.
pub type ControlLaw = Box<dyn FnMut(&[f64; 12], &[f64; 9]) -> [f64; 4] + Send>;

pub(in crate::sim) struct Custom {
    law: ControlLaw,
    motor_max: f64,
}

impl Custom {
    pub(in crate::sim) fn new(law: ControlLaw, motor_max: f64) -> Self {
        Self { law, motor_max }
    }
}

impl std::fmt::Debug for Custom {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("Custom").finish_non_exhaustive()
    }
}

impl Controller for Custom {
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        let Reference { position_m, velocity_m_s, acceleration_m_s2, .. } = reference;
        let mut design = [0.0; 9];
        for (place, of) in [position_m, velocity_m_s, acceleration_m_s2].into_iter().enumerate() {
            design[3 * place..][..3].copy_from_slice(of.as_slice());
        }
        let wanted = (self.law)(&(*estimate).into(), &design);
        // What is no number stops a motor.
        let motors = wanted.map(|motor| motor.max(0.0).min(self.motor_max));
        Command { motors: motors.into(), saturated: motors != wanted }
    }

    fn rest(&mut self, _: &State) {}
}
