//! Reference for a controller at one instant.

use nalgebra::Vector3;

use crate::vehicle::{State, VELOCITY};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::geometry::{Attitude, turned};
use noctograph_core::plan::Setpoint;

/// Reference at one instant, with the setpoint's position as sent, and its motion since then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reference {
    /// Position as sent in m, held until the next setpoint.
    pub(super) held_m: Vector3<f64>,
    /// Present reference position in m, including the sent position's offset from the setpoint.
    pub(crate) position_m: Vector3<f64>,
    pub(crate) velocity_m_s: Vector3<f64>,
    /// Reference acceleration in m/s².
    pub(crate) acceleration_m_s2: Vector3<f64>,
    /// Jerk of an onboard trajectory in m/s³. Streamed setpoints have no jerk.
    pub(crate) jerk_m_s3: Vector3<f64>,
}

impl Reference {
    /// Returns the reference at `time_s` on the motion that begins at a setpoint with constant
    /// acceleration. `sent_m` is the position sent for the setpoint, which shifts the motion. The
    /// jerk is zero.
    pub(crate) fn from_setpoint(setpoint: &Setpoint, sent_m: Vector3<f64>, time_s: f64) -> Self {
        let since_s = time_s - setpoint.time_s;
        Self {
            held_m: sent_m,
            position_m: setpoint.design_m(time_s) + (sent_m - setpoint.position_m),
            velocity_m_s: setpoint.velocity_m_s + setpoint.acceleration_m_s2 * since_s,
            acceleration_m_s2: setpoint.acceleration_m_s2,
            jerk_m_s3: Vector3::zeros(),
        }
    }

    /// Returns a reference at rest at a position.
    pub(crate) fn holding(position_m: Vector3<f64>) -> Self {
        let setpoint = Setpoint { position_m, ..Setpoint::default() };
        Self::from_setpoint(&setpoint, position_m, 0.0)
    }

    /// Rotates all vectors about the vertical axis, counter-clockwise seen from above.
    pub(crate) fn turned(self, angle_rad: f64) -> Self {
        let Self { held_m, position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3 } = self;
        let [held_m, position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3] =
            [held_m, position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3]
                .map(|v| turned(&v, angle_rad));
        Self { held_m, position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3 }
    }

    /// Returns the state and the thrust per mass (m/s²) with which a drone whose nose points along
    /// x would follow the reference without any error, since a quadrotor is differentially flat
    /// (Mellinger, Kumar, ICRA 2011).
    pub(super) fn trim(&self) -> (State, f64) {
        // The attitude aligns the thrust with the sum of acceleration and gravity compensation. The
        // body does not rotate, because the acceleration is constant between two setpoints.
        let force = self.acceleration_m_s2 + Vector3::z() * GRAVITY_M_S2;
        let thrust_m_s2 = force.norm();
        let pitch_rad = libm::atan2(force.x, force.z);
        let roll_rad = libm::asin(-force.y / thrust_m_s2);
        let world_from_body = Attitude { yaw_rad: 0.0, pitch_rad, roll_rad }.world_from_body();
        let mut state = State::zeros();
        state.fixed_rows_mut::<3>(0).copy_from(&self.position_m);
        (state[4], state[5]) = (pitch_rad, roll_rad);
        let velocity_body_m_s = world_from_body.transpose() * self.velocity_m_s;
        state.fixed_rows_mut::<3>(VELOCITY).copy_from(&velocity_body_m_s);
        (state, thrust_m_s2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::{VehicleOptions, Wrench, attitude, velocity};

    #[test]
    fn the_trim_moves_and_accelerates_as_the_reference_does() {
        let setpoint = Setpoint {
            time_s: 1.0,
            position_m: Vector3::new(0.1, 0.2, 0.7),
            velocity_m_s: Vector3::new(0.3, -0.2, 0.1),
            acceleration_m_s2: Vector3::new(2.0, -1.0, 0.5),
            letter: None,
        };
        let reference = Reference::from_setpoint(&setpoint, setpoint.position_m, 1.1);
        let (state, thrust) = reference.trim();
        assert_eq!(reference.held_m, setpoint.position_m);
        let options = VehicleOptions::default();
        let wrench = Wrench::new(0.0, 0.0, 0.0, thrust * options.mass_kg);
        let slope = options.derivative(&state, &wrench);
        let [now, ahead] =
            [state, state + slope * 1e-6].map(|s| attitude(&s).world_from_body() * velocity(&s));
        let wanted = Vector3::new(0.5, -0.3, 0.15);
        assert!((now - wanted).norm() < 1e-12, "velocity {now}");
        let change = (ahead - now) / 1e-6;
        assert!((change - setpoint.acceleration_m_s2).norm() < 1e-5, "acceleration {change}");
    }
}
