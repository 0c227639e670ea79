//! Design model for gains, which is the reference team's nonlinear model with 12 states and 4
//! inputs. The model has instantaneous motors, no drag and no floor.

use nalgebra::{SVector, Vector3, Vector4};

use super::VehicleOptions;
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::geometry::Attitude;

/// State `[o_x o_y o_z ψ θ φ v_x v_y v_z w_x w_y w_z]`, which is the position in the world frame,
/// yaw, pitch and roll, and velocity and angular velocity in the body frame.
pub(crate) type State = SVector<f64, N_STATES>;
/// First nine rows of `State`, which are the motion for a given body rate.
pub type Motion = SVector<f64, RATE>;
/// Number of rows of a [`State`].
pub(crate) const N_STATES: usize = 12;
/// Row of the yaw in a [`State`] and in a [`Motion`].
pub(crate) const YAW: usize = 3;
/// First row of the velocity in a [`State`] and in a [`Motion`].
pub(crate) const VELOCITY: usize = 6;
/// First row of the angular velocity in a [`State`].
pub(crate) const RATE: usize = 9;
/// Torques and thrust `[τ_x τ_y τ_z f_z]` on the body.
pub(crate) type Wrench = Vector4<f64>;
/// Number of rows of a [`Wrench`].
pub(crate) const N_INPUTS: usize = 4;

impl VehicleOptions {
    /// Returns the wrench at hover, which is a thrust equal to the weight, without torque.
    pub(crate) fn hover(&self) -> Wrench {
        Wrench::new(0.0, 0.0, 0.0, self.mass_kg * GRAVITY_M_S2)
    }

    /// Returns the time derivative `ṡ` of the state in the design model. `wrench` contains the
    /// torques in N·m and the thrust in N.
    pub(crate) fn derivative(&self, state: &State, wrench: &Wrench) -> State {
        let (rate, j) = (rate(state), Vector3::from(self.inertia_kg_m2));
        let motion = state.fixed_rows::<RATE>(0).into_owned();
        let moved = motion_derivative(&motion, &rate, wrench[3] / self.mass_kg);
        // Euler's equations are J ω̇ = τ + J ω × ω.
        let acceleration = (j.component_mul(&rate).cross(&rate) + wrench.xyz()).component_div(&j);
        let mut derivative = State::zeros();
        derivative.fixed_rows_mut::<RATE>(0).copy_from(&moved);
        derivative.fixed_rows_mut::<3>(RATE).copy_from(&acceleration);
        derivative
    }
}

/// Returns the derivative of the motion (the first nine rows of `ṡ`) for a body rate in rad/s and a
/// specific force in m/s² along body z (thrust per unit mass, which is also the accelerometer's
/// reading).
pub(crate) fn motion_derivative(
    motion: &Motion,
    rate: &Vector3<f64>,
    specific_force_z: f64,
) -> Motion {
    let (sin_yaw, cos_yaw) = libm::sincos(motion[3]);
    let (sin_pitch, cos_pitch) = libm::sincos(motion[4]);
    let (sin_roll, cos_roll) = libm::sincos(motion[5]);
    let v = Vector3::new(motion[6], motion[7], motion[8]);
    // The velocity is rotated by roll, pitch and yaw in turn, which is faster than the matrix.
    let across = cos_roll * v.y - sin_roll * v.z;
    let down = sin_roll * v.y + cos_roll * v.z;
    let ahead = cos_pitch * v.x + sin_pitch * down;
    // The rates of the Euler angles follow from the body rate, which also rotates the velocity.
    let yaw_rate = (rate.y * sin_roll + rate.z * cos_roll) / cos_pitch;
    let coriolis = v.cross(rate);
    Motion::from([
        cos_yaw * ahead - sin_yaw * across,
        sin_yaw * ahead + cos_yaw * across,
        cos_pitch * down - sin_pitch * v.x,
        yaw_rate,
        rate.y * cos_roll - rate.z * sin_roll,
        rate.x + yaw_rate * sin_pitch,
        GRAVITY_M_S2 * sin_pitch + coriolis.x,
        -GRAVITY_M_S2 * sin_roll * cos_pitch + coriolis.y,
        specific_force_z - GRAVITY_M_S2 * cos_roll * cos_pitch + coriolis.z,
    ])
}

/// Returns the twelve states of a body from its position and attitude in the world frame, and its
/// velocity and rate in the body frame.
pub(crate) fn state(
    position_m: &Vector3<f64>,
    attitude: Attitude,
    velocity_m_s: &Vector3<f64>,
    rate_rad_s: &Vector3<f64>,
) -> State {
    let (p, v, w) = (position_m, velocity_m_s, rate_rad_s);
    let Attitude { yaw_rad, pitch_rad, roll_rad } = attitude;
    State::from([p.x, p.y, p.z, yaw_rad, pitch_rad, roll_rad, v.x, v.y, v.z, w.x, w.y, w.z])
}

/// Returns the state of a level drone at rest.
pub fn at_rest(position_m: Vector3<f64>, yaw_rad: f64) -> State {
    let (still, level) = (Vector3::zeros(), Attitude::default());
    state(&position_m, Attitude { yaw_rad, ..level }, &still, &still)
}

/// Returns the position in the world frame in m.
pub fn position(state: &State) -> Vector3<f64> {
    state.fixed_rows::<3>(0).into_owned()
}

/// Returns the attitude of the body in the world frame.
pub fn attitude(state: &State) -> Attitude {
    Attitude { yaw_rad: state[3], pitch_rad: state[4], roll_rad: state[5] }
}

/// Returns the velocity in the body frame in m/s.
pub fn velocity(state: &State) -> Vector3<f64> {
    state.fixed_rows::<3>(VELOCITY).into_owned()
}

/// Returns the angular velocity in the body frame in rad/s.
pub fn rate(state: &State) -> Vector3<f64> {
    state.fixed_rows::<3>(RATE).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    impl VehicleOptions {
        /// Returns the motors' wrench about the center of mass, where the thrust's lever is `−(x,
        /// y)`.
        pub(crate) fn about_center_of_mass(&self, motors: &Wrench) -> Wrench {
            let ([x, y], f) = (self.center_of_mass_m, motors[3]);
            motors + Wrench::new(-y * f, x * f, 0.0, 0.0)
        }

        /// Returns the state after `dt_s` under a constant wrench, by a classical Runge–Kutta step.
        pub(crate) fn step(&self, state: &State, wrench: &Wrench, dt_s: f64) -> State {
            let k1 = self.derivative(state, wrench);
            let k2 = self.derivative(&(state + k1 * (0.5 * dt_s)), wrench);
            let k3 = self.derivative(&(state + k2 * (0.5 * dt_s)), wrench);
            let k4 = self.derivative(&(state + k3 * dt_s), wrench);
            state + (k1 + (k2 + k3) * 2.0 + k4) * (dt_s / 6.0)
        }
    }

    fn tumbling() -> State {
        let mut state = at_rest(Vector3::new(0.1, -0.2, 50.0), 0.4);
        for (i, value) in [0.2, -0.3, 1.0, -2.0, 0.5, 1.5, -1.0, 2.0].into_iter().enumerate() {
            state[4 + i] = value;
        }
        state
    }

    #[test]
    fn velocity_turns_with_the_attitude() {
        let state = tumbling();
        let slope = VehicleOptions::default().derivative(&state, &Wrench::zeros());
        let world = attitude(&state).world_from_body() * velocity(&state);
        assert!((position(&slope) - world).norm() < 1e-15, "ȯ = R v");
    }

    #[test]
    fn attitude_turns_with_the_body_rate() {
        // The test checks Ṙ = R [w]× by a difference of world_from_body along the angles'
        // derivative.
        let state = tumbling();
        let slope = VehicleOptions::default().derivative(&state, &Wrench::zeros());
        let ahead = attitude(&(state + slope * 1e-6)).world_from_body();
        let behind = attitude(&(state - slope * 1e-6)).world_from_body();
        let want = attitude(&state).world_from_body() * rate(&state).cross_matrix();
        assert!(((ahead - behind) / 2e-6 - want).norm() < 1e-9, "Ṙ = R [w]×");
    }

    #[test]
    fn gravity_and_thrust_alone_change_the_velocity_in_the_world() {
        let vehicle = VehicleOptions::default();
        let (state, wrench) = (tumbling(), Wrench::new(0.0, 0.0, 0.0, 0.5));
        let slope = vehicle.derivative(&state, &wrench);
        let [ahead, behind] = [state + slope * 1e-6, state - slope * 1e-6]
            .map(|s| attitude(&s).world_from_body() * velocity(&s));
        let change = (ahead - behind) / 2e-6;
        let thrust = attitude(&state).world_from_body() * Vector3::z() * (0.5 / 0.0351);
        let want = thrust - Vector3::z() * 9.81;
        assert!((change - want).norm() < 1e-7, "{change} against {want}");
    }

    #[test]
    fn thrust_beside_the_center_of_mass_turns_the_drone() {
        let options = VehicleOptions::default();
        let wrench = options.about_center_of_mass(&options.hover());
        assert!((wrench[0] + 1.3e-4).abs() < 1e-6, "τ_x {}", wrench[0]);
        assert!((wrench[1] + 3.3e-4).abs() < 1e-6, "τ_y {}", wrench[1]);
    }
}
