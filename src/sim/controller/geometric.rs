//! Geometric tracking control on SE(3), without Euler angles or small-angle approximations.
//!
//! The sources are Lee, Leok, `McClamroch`, "Geometric tracking control of a quadrotor UAV on
//! SE(3)", CDC 2010, and for the integral terms Goodarzi, Lee, Leok, "Geometric nonlinear PID
//! control of a quadrotor UAV on SE(3)", ECC 2013, as in the firmware's `controller_lee.c` and
//! `power_distribution_quadrotor.c`, releases 2024.10 to 2026.08. A test compares the commands with
//! those of its compiled C code. Neither the force nor the integrals are bounded, and the integrals
//! continue while motors are saturated.
//!
//! Limits of the errors (100 m, 100 m/s) and a changing yaw are not modeled.

use nalgebra::{Matrix3, Vector3};

use super::{Command, Controller, Reference};
use crate::options::{GeometricOptions, SimOptions};
use crate::vehicle::{Mixer, State, Wrench, attitude, position, rate, velocity};
use noctograph_core::crazyflie::GRAVITY_M_S2;

/// Thrust in N below which both integrals are reset, for example on the floor or in a fall.
const LEAST_THRUST_N: f64 = 0.01;

/// Controller that computes thrust and torque from the errors of position and attitude.
#[derive(Clone, Debug)]
pub(super) struct Geometric {
    gains: GeometricOptions,
    mass_kg: f64,
    inertia_kg_m2: Vector3<f64>,
    mixer: Mixer,
    /// Maximum motor command, unless battery compensation imposes a lower limit.
    most: f64,
    tick_s: f64,
    /// Integral of the position error in m s.
    position_sum: Vector3<f64>,
    /// Integral of the attitude error in s.
    attitude_sum: Vector3<f64>,
}

impl Geometric {
    /// Creates a controller whose integrals are zero. The gains are per unit mass and per unit
    /// moment of inertia, so the drone's mass and inertia are stored to compute thrust and torque.
    pub(super) fn new(options: &SimOptions) -> Self {
        Self {
            gains: options.controller.geometric.clone(),
            mass_kg: options.vehicle.mass_kg,
            inertia_kg_m2: options.vehicle.inertia_kg_m2.into(),
            mixer: Mixer::new(&options.vehicle),
            most: options.most_command(),
            tick_s: 1.0 / f64::from(options.rates.attitude_hz()),
            position_sum: Vector3::zeros(),
            attitude_sum: Vector3::zeros(),
        }
    }

    /// Adds a tick's position error to its integral, and returns the desired force per unit mass.
    /// This force is the reference acceleration plus gravity compensation, minus feedback of the
    /// position error, the velocity error, and the integral.
    fn force_m_s2(
        &mut self,
        velocity_m_s: &Vector3<f64>,
        error_m: &Vector3<f64>,
        reference: &Reference,
    ) -> Vector3<f64> {
        self.position_sum += error_m * self.tick_s;
        reference.acceleration_m_s2 + Vector3::z() * GRAVITY_M_S2
            - error_m * self.gains.k_position
            - (velocity_m_s - reference.velocity_m_s) * self.gains.k_velocity
            - self.position_sum * self.gains.k_position_integral
    }

    fn reset_integrals(&mut self) {
        self.position_sum = Vector3::zeros();
        self.attitude_sum = Vector3::zeros();
    }
}

impl Controller for Geometric {
    /// Returns the motor commands by the control law of Lee, Leok and `McClamroch` 2010, and
    /// advances the integrals of both errors. Below [`LEAST_THRUST_N`], both integrals are reset
    /// before that of the attitude advances.
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        // The thrust is the component of the desired force along the body's present z axis.
        let world_from_body = attitude(estimate).world_from_body();
        let error_m = position(estimate) - reference.position_m;
        let force = self.force_m_s2(&(world_from_body * velocity(estimate)), &error_m, reference);
        let thrust_n = self.mass_kg * force.dot(&world_from_body.column(2));
        if thrust_n < LEAST_THRUST_N {
            self.reset_integrals();
        }
        // The desired attitude aligns the body's z axis with the desired force. A drone that would
        // have to thrust downward is held level.
        let desired = wanted_attitude(&if thrust_n > 0.0 { force } else { Vector3::z() });
        let error = attitude_error(&desired, &world_from_body);
        self.attitude_sum += error * self.tick_s;

        // The desired body rate is that of the desired attitude, and zero without thrust.
        let w = rate(estimate);
        let wanted_rate = match thrust_n {
            0.0 => Vector3::zeros(),
            _ => wanted_rate(&desired, &reference.jerk_m_s3, thrust_n / self.mass_kg),
        };
        let error_rad_s = w - world_from_body.tr_mul(&(desired * wanted_rate));
        let GeometricOptions { k_attitude, k_rate, k_attitude_integral, .. } = self.gains;
        let turning_rad_s2 = -error.component_mul(&Vector3::from(k_attitude))
            - error_rad_s.component_mul(&Vector3::from(k_rate))
            - self.attitude_sum.component_mul(&Vector3::from(k_attitude_integral));
        // The torque is τ = J α + ω × J ω.
        let j = &self.inertia_kg_m2;
        let torque = j.component_mul(&turning_rad_s2) + w.cross(&j.component_mul(&w));
        let wrench = Wrench::new(torque.x, torque.y, torque.z, thrust_n);
        let (motors, saturated) = self.mixer.distributed(&wrench, self.most);
        Command { motors, saturated }
    }

    fn rest(&mut self, _: &State) {
        self.reset_integrals();
    }

    /// Sets the estimated heading to zero. The firmware's supervisor also resets the setpoint modes
    /// of x and y, but this controller ignores the modes and follows the last setpoint.
    fn level_out(&self, estimate: &mut State, _: &mut Reference) {
        estimate[3] = 0.0;
    }

    /// Returns the integrals whose gain is not zero, position before attitude.
    fn memory(&mut self) -> Vec<&mut f64> {
        let position =
            self.position_sum.iter_mut().filter(|_| self.gains.k_position_integral != 0.0);
        let sums = self.attitude_sum.iter_mut().zip(&self.gains.k_attitude_integral);
        let attitude = sums.filter(|(_, gain)| **gain != 0.0).map(|(sum, _)| sum);
        position.chain(attitude).collect()
    }
}

/// Returns the attitude (world from body) whose z axis is along a force and whose x axis is in the
/// vertical plane of world x. For a force along world x, the y axis is along world y.
fn wanted_attitude(force: &Vector3<f64>) -> Matrix3<f64> {
    let up = force.normalize();
    let left = up.cross(&Vector3::x()).try_normalize(0.0).unwrap_or(Vector3::y());
    Matrix3::from_columns(&[left.cross(&up), left, up])
}

/// Returns the angular rate of the desired attitude in the frame of that attitude. The rate follows
/// from the jerk, because the z axis follows the force.
fn wanted_rate(wanted: &Matrix3<f64>, jerk_m_s3: &Vector3<f64>, thrust_m_s2: f64) -> Vector3<f64> {
    let turn = wanted.tr_mul(jerk_m_s3) / thrust_m_s2;
    Vector3::new(-turn.y, turn.x, 0.0)
}

/// Returns the attitude error `½ (R_dᵀ R − Rᵀ R_d)^∨`, which for a small rotation is the rotation
/// vector in rad from the desired attitude, in body axes.
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
    use crate::avionics::turned_ahead;
    use crate::tests::Numbers;
    use crate::vehicle::{Plant, state};
    use noctograph_core::geometry::Attitude;

    #[test]
    fn attitude_error_is_the_turn_in_body_axes() {
        let attitude = Attitude { yaw_rad: 1e-4, pitch_rad: -2e-4, roll_rad: 3e-4 };
        let error = attitude_error(&Matrix3::identity(), &attitude.world_from_body());
        assert!((error - Vector3::new(3e-4, -2e-4, 1e-4)).norm() < 1e-7, "{error}");
    }

    #[test]
    fn without_errors_the_drone_is_asked_for_the_references_force_only() {
        let mut controller = Geometric::new(&SimOptions::default());
        let reference = Reference {
            held_m: Vector3::zeros(),
            position_m: Vector3::new(0.1, 0.0, 0.8),
            velocity_m_s: Vector3::new(0.3, 0.1, -0.2),
            acceleration_m_s2: Vector3::new(1.0, 0.0, 0.3),
            jerk_m_s3: Vector3::zeros(),
        };
        let (state, thrust_m_s2) = reference.trim();
        let motors = controller.command(&state, &reference).motors;
        let want = 0.0351 * thrust_m_s2 / 4.0 / 1.95e-6;
        assert!(motors.iter().all(|m| (m - want).abs() < 0.2), "{motors} against {want}");
    }

    /// Returns the largest difference in N between a motor's thrust and that of the firmware's
    /// code, and the fraction of compared states in which the firmware limits a motor.
    fn compared(options: &SimOptions, recorded: &str) -> (f64, f64) {
        let mut options = options.clone();
        options.battery.resistance_ohm = 0.0;
        options.controller.geometric = GeometricOptions {
            k_position: 9.0,
            k_velocity: 7.0,
            k_position_integral: 5.0,
            k_attitude: [331.9, 330.2, 341.7],
            k_rate: [78.4, 78.1, 68.3],
            k_attitude_integral: [724.0, 1081.0, 513.0],
        };
        let [a, b, c, d] = options.battery.thrust_from_v_n;
        let mut plants = [4.15, 3.8, 3.4, 3.0].map(|volt_v| {
            options.battery.open_circuit_v = [volt_v; 11];
            (Plant::new(options.plant(), 0.002, 0, 0, Vector3::z()), volt_v)
        });
        let mut controller = Geometric::new(&options);
        let mut rows = recorded.lines().filter(|line| !line.starts_with('#'));
        let mut row = rows.next();
        let (mut numbers, mut worst_n, mut cut, mut n) = (Numbers(1), 0.0_f64, 0.0, 0.0);
        for k in 0..4000_usize {
            let single = k < 2000;
            let size = if single { [0.03, 0.1, 0.3, 1.0][k % 4] } else { 0.1 };
            let mut within = |size: f64| size * (2.0 * numbers.uniform() - 1.0);
            let heading_rad = if single { within(3.0) } else { 0.6 };
            let yaw_rad = within(0.5 * size) + heading_rad;
            let mut vector = |x: f64, y: f64, z: f64| {
                let x = within(x);
                let y = within(y);
                Vector3::new(x, y, within(z))
            };
            let acceleration_m_s2 = vector(4.0 * size, 4.0 * size, 8.0 * size);
            let jerk_m_s3 = vector(20.0 * size, 20.0 * size, 20.0 * size);
            let mut place_m = vector(0.5 * size, 0.5 * size, 0.5 * size);
            let mut moving_m_s = vector(size, size, size);
            let t = if single { 0.0 } else { (k - 2000) as f64 * 0.002 };
            if !single {
                place_m.x += 0.8;
                moving_m_s.x -= 0.8 * (9.0 + 5.0 * t) / 7.0;
            }
            place_m.z += if k >= 3800 { 1.6 } else { 0.0 };
            let roll_rad = within(0.8 * size);
            let pitch_rad = within(0.8 * size) + if single { 0.0 } else { 0.15 };
            let mut rate_rad_s = Vector3::new(within(5.0 * size), within(5.0 * size), 0.0);
            rate_rad_s.z = within(3.0 * size);
            if !single {
                rate_rad_s.y -= 0.15 * (330.2 + 1081.0 * t) / 78.1;
            }
            if single || k == 2000 {
                controller.reset_integrals();
            }
            let attitude = Attitude { yaw_rad, pitch_rad, roll_rad };
            let moving_m_s = attitude.world_from_body().tr_mul(&moving_m_s);
            let estimate = state(&place_m, attitude, &moving_m_s, &rate_rad_s);
            let reference = Reference {
                acceleration_m_s2,
                jerk_m_s3: if k % 2 == 1 { jerk_m_s3 } else { Vector3::zeros() },
                ..Reference::holding(Vector3::zeros())
            };
            let reference = reference.turned(-heading_rad);
            let command = controller.command(&turned_ahead(&estimate, heading_rad), &reference);
            let (plant, volt_v) = &mut plants[k / 4 % 4];
            let thrusts_n = plant.thrusts_n(&command.motors.into());
            let duties: Vec<f64> =
                row.unwrap_or("-1").split(' ').map(|value| value.parse().unwrap()).collect();
            if duties[0] != k as f64 {
                continue;
            }
            for (thrust_n, duty) in thrusts_n.iter().zip(&duties[1..]) {
                let v = duty / 65_535.0 * *volt_v;
                let want_n = (a + v * (b + v * (c + v * d))).max(0.0);
                worst_n = worst_n.max((thrust_n - want_n).abs());
            }
            let is_cut = duties[1..].iter().any(|duty| *duty <= 7000.0 || *duty >= 65_534.0);
            (cut, n, row) = (cut + f64::from(u8::from(is_cut)), n + 1.0, rows.next());
        }
        assert_eq!(row, None, "every row is compared");
        (worst_n, cut / n)
    }

    #[test]
    fn motors_are_those_of_the_firmwares_own_code_saturated_too() {
        for (options, recorded) in [
            (SimOptions::cf21(), include_str!("recorded/lee.txt")),
            (SimOptions::cf_brushless(), include_str!("recorded/lee_brushless.txt")),
        ] {
            let (worst_n, cut) = compared(&options, recorded);
            println!("{worst_n:.6} N, {:.0} % of the states cut", 100.0 * cut);
            assert!(worst_n < 1e-3, "{worst_n} N");
            assert!((0.1..0.9).contains(&cut), "both kinds are compared: {cut}");
        }
    }
}
