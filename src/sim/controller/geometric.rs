//! Geometric tracking on SE(3): no Euler angles, no small-angle model.
//!
//! Source: Lee, Leok, `McClamroch`, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC
//! 2010, with the integral terms of Goodarzi, Lee, Leok, "Geometric nonlinear PID control of a
//! quadrotor UAV on SE(3)", ECC 2013, as the firmware's `controller_lee.c` has them. The wanted
//! body rate is taken as zero: a setpoint carries no jerk.

use nalgebra::{Matrix3, Vector3};

use super::{Command, Controller, Reference};
use crate::options::{GeometricOptions, SimOptions};
use crate::vehicle::{Mixer, State, Wrench, attitude, position, rate, velocity};
use noctograph_core::crazyflie::GRAVITY_M_S2;

/// Bound of the integral of the position error per axis, m s (`Kpos_I_limit` of the firmware).
const MAX_POSITION_SUM: f64 = 2.0;
/// Bound of the integral of the attitude error per axis, s. The reference flight's center of mass
/// needs 0.04.
const MAX_ATTITUDE_SUM: f64 = 0.5;
/// Least upward part of the wanted force, in weights, and most sideways part relative to it: the
/// drone is never asked to tilt by more than 45° or to fall freely.
const LEAST_LIFT: f64 = 0.25;

/// Thrust and torque from the errors of position and attitude.
#[derive(Clone, Debug)]
pub(super) struct Geometric {
    gains: GeometricOptions,
    mass_kg: f64,
    inertia_kg_m2: Vector3<f64>,
    mixer: Mixer,
    tick_s: f64,
    /// Integral of the position error, m s.
    position_sum: Vector3<f64>,
    /// Integral of the attitude error, s.
    attitude_sum: Vector3<f64>,
}

impl Geometric {
    pub(super) fn new(options: &SimOptions) -> Self {
        Self {
            gains: options.controller.geometric.clone(),
            mass_kg: options.vehicle.mass_kg,
            inertia_kg_m2: options.vehicle.inertia_kg_m2.into(),
            mixer: Mixer::new(&options.vehicle),
            tick_s: 1.0 / f64::from(options.rates.attitude_hz()),
            position_sum: Vector3::zeros(),
            attitude_sum: Vector3::zeros(),
        }
    }

    /// Wanted force per mass: the design's acceleration and gravity, corrected by the errors.
    fn force_m_s2(
        &self,
        error_m: &Vector3<f64>,
        error_m_s: Vector3<f64>,
        a: Vector3<f64>,
    ) -> Vector3<f64> {
        let mut force = a + Vector3::z() * GRAVITY_M_S2
            - error_m * self.gains.k_position
            - error_m_s * self.gains.k_velocity
            - self.position_sum * self.gains.k_position_integral;
        force.z = force.z.max(LEAST_LIFT * GRAVITY_M_S2);
        let sideways = libm::hypot(force.x, force.y);
        if sideways > force.z {
            (force.x, force.y) = (force.x * force.z / sideways, force.y * force.z / sideways);
        }
        force
    }
}

impl Controller for Geometric {
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        let world_from_body = attitude(estimate).world_from_body();
        let error_m = position(estimate) - reference.position_m;
        let error_m_s = world_from_body * velocity(estimate) - reference.velocity_m_s;
        let force = self.force_m_s2(&error_m, error_m_s, reference.acceleration_m_s2);
        let error = attitude_error(&wanted_attitude(&force), &world_from_body);

        let w = rate(estimate);
        let GeometricOptions { k_attitude, k_rate, k_attitude_integral, .. } = self.gains;
        let turning = -error.component_mul(&Vector3::from(k_attitude))
            - w.component_mul(&Vector3::from(k_rate))
            - self.attitude_sum.component_mul(&Vector3::from(k_attitude_integral));
        let j = &self.inertia_kg_m2;
        let torque = j.component_mul(&turning) + w.cross(&j.component_mul(&w));
        let thrust = self.mass_kg * force.dot(&world_from_body.column(2));
        let (motors, saturated) =
            self.mixer.motors(&Wrench::new(torque.x, torque.y, torque.z, thrust));
        if !saturated {
            let bounded = |sum: Vector3<f64>, max: f64| sum.map(|s| s.clamp(-max, max));
            self.position_sum =
                bounded(self.position_sum + error_m * self.tick_s, MAX_POSITION_SUM);
            self.attitude_sum = bounded(self.attitude_sum + error * self.tick_s, MAX_ATTITUDE_SUM);
        }
        Command { motors, saturated }
    }

    fn rest(&mut self, _: &State) {
        self.position_sum = Vector3::zeros();
        self.attitude_sum = Vector3::zeros();
    }

    fn memory(&mut self) -> Vec<&mut f64> {
        let position =
            self.position_sum.iter_mut().filter(|_| self.gains.k_position_integral != 0.0);
        let attitude = self.attitude_sum.iter_mut().zip(&self.gains.k_attitude_integral);
        let attitude = attitude.filter(|(_, gain)| **gain != 0.0).map(|(sum, _)| sum);
        position.chain(attitude).collect()
    }
}

/// The attitude without yaw whose z axis lies along a force.
fn wanted_attitude(force: &Vector3<f64>) -> Matrix3<f64> {
    let up = force.normalize();
    let ahead = Vector3::y().cross(&up).normalize();
    Matrix3::from_columns(&[ahead, up.cross(&ahead), up])
}

/// `½ (R_dᵀ R − Rᵀ R_d)^∨`: for a small turn, the turn from the wanted attitude in body axes, rad.
fn attitude_error(wanted: &Matrix3<f64>, actual: &Matrix3<f64>) -> Vector3<f64> {
    let turn = wanted.transpose() * actual;
    Vector3::new(
        turn[(2, 1)] - turn[(1, 2)],
        turn[(0, 2)] - turn[(2, 0)],
        turn[(1, 0)] - turn[(0, 1)],
    ) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::geometry::Attitude;

    #[test]
    fn attitude_error_is_the_turn_in_body_axes() {
        let attitude = Attitude { yaw_rad: 1e-4, pitch_rad: -2e-4, roll_rad: 3e-4 };
        let error = attitude_error(&Matrix3::identity(), &attitude.world_from_body());
        assert!((error - Vector3::new(3e-4, -2e-4, 1e-4)).norm() < 1e-7, "{error}");
    }

    #[test]
    fn on_its_design_the_drone_is_asked_for_the_designs_force_alone() {
        let mut controller = Geometric::new(&SimOptions::default());
        let reference = Reference {
            held_m: Vector3::zeros(),
            position_m: Vector3::new(0.1, 0.0, 0.8),
            velocity_m_s: Vector3::new(0.3, 0.1, -0.2),
            acceleration_m_s2: Vector3::new(1.0, -0.5, 0.3),
        };
        let (state, thrust_m_s2) = reference.trim();
        let motors = controller.command(&state, &reference).motors;
        let want = 0.0351 * thrust_m_s2 / 4.0 / 1.95e-6;
        assert!(motors.iter().all(|m| (m - want).abs() < 0.2), "{motors} against {want}");
    }

    #[test]
    fn the_wanted_tilt_is_bounded() {
        let controller = Geometric::new(&SimOptions::default());
        let far = Vector3::new(-50.0, 20.0, 30.0);
        let force = controller.force_m_s2(&far, Vector3::zeros(), Vector3::zeros());
        assert!((force.z - 0.25 * 9.81).abs() < 1e-12, "still lifts: {force}");
        assert!((force.xy().norm() - force.z).abs() < 1e-12, "45°: {force}");
    }
}
