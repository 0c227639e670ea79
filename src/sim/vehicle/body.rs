//! Rigid body, with its state and the integration of its motion.

use nalgebra::{Matrix3, Quaternion, SVector, UnitQuaternion, Vector3};

use super::VehicleOptions;
use super::model::{State, state};
use super::rotors::Load;
use crate::kalman::rotation;
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::geometry::Attitude;

/// Position, velocity, quaternion (w x y z) and body rate in one vector, for the integrator.
pub(super) type Row = SVector<f64, 13>;

/// Pose and motion of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody {
    /// Position of the body's origin in the world frame in m.
    pub position_m: Vector3<f64>,
    /// Velocity in the world frame in m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Rotation from body vectors to world vectors.
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular velocity in the body frame in rad/s.
    pub rate_rad_s: Vector3<f64>,
}

impl RigidBody {
    /// Creates a level body at rest whose nose points along world x.
    pub fn resting_at(position_m: Vector3<f64>) -> Self {
        Self {
            position_m,
            velocity_m_s: Vector3::zeros(),
            world_from_body: UnitQuaternion::identity(),
            rate_rad_s: Vector3::zeros(),
        }
    }

    /// Returns a body at the same position, level and at rest, with a heading from x toward y.
    pub fn facing(&self, yaw_rad: f64) -> Self {
        let half_yaw = 0.5 * yaw_rad;
        let level = Quaternion::new(libm::cos(half_yaw), 0.0, 0.0, libm::sin(half_yaw));
        let world_from_body = UnitQuaternion::new_unchecked(level);
        Self { world_from_body, ..Self::resting_at(self.position_m) }
    }

    /// True if pitch or roll has reached a quarter turn, at which the thrust provides no lift.
    pub(crate) fn is_on_its_back(&self) -> bool {
        // The cosine of the tilt is the product of the cosines of roll and pitch.
        let q = &self.world_from_body;
        let (cos_tilt, sin_pitch) =
            (1.0 - 2.0 * (q.i * q.i + q.j * q.j), 2.0 * (q.w * q.j - q.k * q.i));
        cos_tilt <= 0.0 || sin_pitch.abs() >= 1.0
    }

    /// Returns a body with the same x, y and yaw, level and at rest at the height `floor_m`.
    pub(super) fn on_floor(&self, floor_m: f64) -> Self {
        let [y, x] = self.yaw_direction();
        Self::resting_at(Vector3::new(self.position_m.x, self.position_m.y, floor_m))
            .facing(libm::atan2(y, x))
    }

    /// Returns the rotation matrix from the body frame to the world frame.
    #[inline]
    pub fn matrix(&self) -> Matrix3<f64> {
        self.world_from_body.to_rotation_matrix().into_inner()
    }

    /// Returns a vector `[y, x]` in the direction of the yaw, for `atan2(y, x)`.
    fn yaw_direction(&self) -> [f64; 2] {
        let q = &self.world_from_body;
        [2.0 * (q.w * q.k + q.i * q.j), 1.0 - 2.0 * (q.j * q.j + q.k * q.k)]
    }

    /// Returns the twelve states of the design model, with yaw and roll in ±π, and pitch in ±π/2.
    pub fn state(&self) -> State {
        let q = &self.world_from_body;
        let sin_pitch = (2.0 * (q.w * q.j - q.k * q.i)).clamp(-1.0, 1.0);
        let [y, x] = self.yaw_direction();
        let roll_rad =
            libm::atan2(2.0 * (q.w * q.i + q.j * q.k), 1.0 - 2.0 * (q.i * q.i + q.j * q.j));
        let attitude =
            Attitude { yaw_rad: libm::atan2(y, x), pitch_rad: libm::asin(sin_pitch), roll_rad };
        state(&self.position_m, attitude, &self.velocity_body_m_s(), &self.rate_rad_s)
    }

    /// Returns the velocity in the body frame.
    pub fn velocity_body_m_s(&self) -> Vector3<f64> {
        self.world_from_body.inverse_transform_vector(&self.velocity_m_s)
    }

    /// Returns the body as a vector for the integrator: position and velocity in the world frame,
    /// quaternion w x y z, and body rate.
    #[inline(always)]
    pub(super) fn row(&self) -> Row {
        let (p, v, w) = (&self.position_m, &self.velocity_m_s, &self.rate_rad_s);
        let q = &self.world_from_body;
        Row::from([p.x, p.y, p.z, v.x, v.y, v.z, q.w, q.i, q.j, q.k, w.x, w.y, w.z])
    }

    /// Creates a body from an integrator's vector with a unit quaternion.
    #[inline(always)]
    pub(super) fn from_row(s: &Row) -> Self {
        Self {
            position_m: Vector3::new(s[0], s[1], s[2]),
            velocity_m_s: Vector3::new(s[3], s[4], s[5]),
            world_from_body: UnitQuaternion::new_unchecked(Quaternion::new(s[6], s[7], s[8], s[9])),
            rate_rad_s: Vector3::new(s[10], s[11], s[12]),
        }
    }
}

/// Mass, inertia and drag of the rigid body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertia {
    pub(super) weight_n: f64,
    /// Drag force per unit airspeed along body x, y, z in N/(m/s).
    drag_n_s_m: [f64; 3],
    /// Moment per unit airspeed in N m/(m/s), which pitches the body up against its motion.
    airspeed_moment_n_s: f64,
    /// Inverse of the mass, because a division takes as long as ten multiplications.
    per_mass: f64,
    per_moment: [f64; 3],
    /// Inertia ratio `(J_y − J_z) / J_x` and its cyclic permutations.
    coupling: [f64; 3],
}

impl Inertia {
    /// Returns the constants of the equations of motion, computed once for all steps.
    pub(super) fn new(options: &VehicleOptions) -> Self {
        let [x, y, z] = options.inertia_kg_m2;
        Self {
            weight_n: options.mass_kg * GRAVITY_M_S2,
            drag_n_s_m: options.body_drag_n_s_m,
            airspeed_moment_n_s: options.airspeed_moment_n_s,
            per_mass: 1.0 / options.mass_kg,
            per_moment: options.inertia_kg_m2.map(|j| 1.0 / j),
            coupling: [(y - z) / x, (z - x) / y, (x - y) / z],
        }
    }

    /// Returns an accelerometer's reading in flight, which is thrust and drag per unit mass in the
    /// body frame.
    #[inline(always)]
    pub(super) fn specific_force_m_s2(
        &self,
        body: &RigidBody,
        load: &Load,
        wind_m_s: &Vector3<f64>,
    ) -> Vector3<f64> {
        let airspeed_m_s = body.velocity_m_s - wind_m_s;
        let mut force_n =
            self.drag_n(&body.world_from_body.inverse_transform_vector(&airspeed_m_s), load);
        force_n.z += load.thrust_n;
        force_n * self.per_mass
    }

    /// Returns the drag in N along the body axes for an airspeed in the body frame. Body and rotors
    /// contribute.
    #[inline(always)]
    fn drag_n(&self, airspeed_m_s: &Vector3<f64>, load: &Load) -> Vector3<f64> {
        let [x, y, z] = self.drag_n_s_m;
        let across = load.drag_n_s_m;
        -Vector3::new(x + across, y + across, z).component_mul(airspeed_m_s)
    }

    /// Returns the body after a step of `dt_s` by the classical Runge–Kutta method, with loads at
    /// the step's start, middle and end.
    #[inline(always)]
    pub(super) fn step(
        &self,
        s: &Row,
        loads: &[Load; 3],
        wind_m_s: &Vector3<f64>,
        dt_s: f64,
    ) -> Row {
        let k1 = self.derivative(s, &loads[0], wind_m_s);
        let k2 = self.derivative(&(s + k1 * (0.5 * dt_s)), &loads[1], wind_m_s);
        let k3 = self.derivative(&(s + k2 * (0.5 * dt_s)), &loads[1], wind_m_s);
        let k4 = self.derivative(&(s + k3 * dt_s), &loads[2], wind_m_s);
        let mut end = s + (k1 + (k2 + k3) * 2.0 + k4) * (dt_s / 6.0);
        // The quaternion after a step deviates slightly from unit length.
        let [w, x, y, z] = [end[6], end[7], end[8], end[9]];
        let size = ((x * x + z * z) + (y * y + w * w)).sqrt();
        (6..10).for_each(|i| end[i] /= size);
        end
    }

    /// Returns the time derivative of the body's state, in the order of [`RigidBody::row`],
    /// under a load and wind.
    #[inline(always)]
    fn derivative(&self, s: &Row, load: &Load, wind_m_s: &Vector3<f64>) -> Row {
        // The quaternion's matrix rotates the airspeed to the body frame.
        let [w, x, y, z] = [s[6], s[7], s[8], s[9]];
        let world_from_body = rotation([w, x, y, z]);
        let air = world_from_body.tr_mul(&(Vector3::new(s[3], s[4], s[5]) - wind_m_s));
        // The force consists of thrust along z and drag. The torque is due to the rotors and to the
        // air that flows across them.
        let mut force = self.drag_n(&air, load);
        force.z += load.thrust_n;
        let acceleration = world_from_body * force * self.per_mass;
        let (p, q, o) = (s[10], s[11], s[12]);
        let (c, per_j, torque) = (&self.coupling, &self.per_moment, &load.torque_n_m);
        let m_u = self.airspeed_moment_n_s;
        let (roll, pitch) = (torque.x + m_u * air.y, torque.y - m_u * air.x);
        // The equations are ẋ = v, v̇ = R f / m − g, q̇ = ½ q ω, and Euler's for the rate.
        Row::from([
            s[3],
            s[4],
            s[5],
            acceleration.x,
            acceleration.y,
            acceleration.z - GRAVITY_M_S2,
            (x * p + y * q + z * o) * -0.5,
            (w * p + y * o - z * q) * 0.5,
            (w * q + z * p - x * o) * 0.5,
            (w * o + x * q - y * p) * 0.5,
            // The rotors' angular momentum rotates with the body, which causes a gyroscopic torque.
            c[0] * q * o + (roll - q * load.spin_n_m_s) * per_j[0],
            c[1] * p * o + (pitch + p * load.spin_n_m_s) * per_j[1],
            c[2] * p * q + torque.z * per_j[2],
        ])
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;
    use crate::vehicle::model::Wrench;
    use crate::vehicle::{attitude, rate, velocity};

    impl RigidBody {
        /// Creates the body for a state of the design model.
        pub(crate) fn from_state(state: &State) -> Self {
            let turn = Rotation3::from_matrix_unchecked(attitude(state).world_from_body());
            let world_from_body = UnitQuaternion::from_rotation_matrix(&turn);
            Self {
                position_m: state.fixed_rows::<3>(0).into(),
                velocity_m_s: world_from_body * velocity(state),
                world_from_body,
                rate_rad_s: rate(state),
            }
        }
    }

    fn fly(
        options: &VehicleOptions,
        body: RigidBody,
        load: Load,
        dt_s: f64,
        n: usize,
    ) -> RigidBody {
        let (inertia, mut row) = (Inertia::new(options), body.row());
        for _ in 0..n {
            row = inertia.step(&row, &[load; 3], &Vector3::zeros(), dt_s);
        }
        RigidBody::from_row(&row)
    }

    fn tumbling() -> RigidBody {
        RigidBody {
            velocity_m_s: Vector3::new(1.0, -2.0, 0.5),
            world_from_body: UnitQuaternion::new(Vector3::new(0.2, -0.3, 0.4)),
            rate_rad_s: Vector3::new(1.5, -1.0, 2.0),
            ..RigidBody::resting_at(Vector3::new(0.1, -0.2, 50.0))
        }
    }

    #[test]
    fn free_fall_is_exact() {
        let end = fly(&VehicleOptions::default(), tumbling(), Load::default(), 0.002, 500);
        let start = tumbling();
        let want = start.position_m + start.velocity_m_s - Vector3::z() * (0.5 * 9.81);
        assert!((end.position_m - want).norm() < 1e-9, "falls by g t²/2");
        let want = start.velocity_m_s - Vector3::z() * 9.81;
        assert!((end.velocity_m_s - want).norm() < 1e-9, "gains g t");
    }

    #[test]
    fn torque_free_rotation_keeps_energy_and_momentum() {
        let options = VehicleOptions::default();
        let j = Vector3::from(options.inertia_kg_m2);
        let start = tumbling();
        let end = fly(&options, start, Load::default(), 0.001, 1000);
        assert!((end.rate_rad_s - start.rate_rad_s).norm() > 0.1, "it does tumble");
        let [before_j, after_j] =
            [start, end].map(|b| 0.5 * b.rate_rad_s.component_mul(&b.rate_rad_s).dot(&j));
        assert!((after_j / before_j - 1.0).abs() < 1e-9, "energy");
        let [before, after] =
            [start, end].map(|b| b.world_from_body * j.component_mul(&b.rate_rad_s));
        let drift = (after - before).norm() / before.norm();
        assert!(drift < 1e-9, "momentum drifts by {drift:e}");
    }

    #[test]
    fn a_free_spinning_top_precesses_as_the_closed_form() {
        // With two equal moments, w_z is constant, and (w_x, w_y) rotates at (J_z − J_x) w_z / J_x.
        let options =
            VehicleOptions { inertia_kg_m2: [1.2e-5, 1.2e-5, 3.3e-5], ..Default::default() };
        let end = fly(&options, tumbling(), Load::default(), 0.001, 1000);
        let angle = (3.3 - 1.2) / 1.2 * 2.0;
        let (sin, cos) = libm::sincos(angle);
        let (x, y) = (1.5, -1.0);
        let want = Vector3::new(cos * x - sin * y, sin * x + cos * y, 2.0);
        assert!((end.rate_rad_s - want).norm() < 1e-9, "{} against {want}", end.rate_rad_s);
    }

    #[test]
    fn quaternions_and_the_teams_euler_angles_agree() {
        let load =
            Load { thrust_n: 0.36, torque_n_m: Vector3::new(1e-6, -2e-6, 1e-6), ..Load::default() };
        let (body, dt_s, n) = (tumbling(), 2.5e-4, 4000);
        let wrench = Wrench::new(1e-6, -2e-6, 1e-6, 0.36);
        let vehicle = VehicleOptions::default();
        let mut state = body.state();
        for _ in 0..n {
            state = vehicle.step(&state, &wrench, dt_s);
        }
        let end = fly(&VehicleOptions::default(), body, load, dt_s, n);
        let simulated = end.state();
        assert!((rate(&simulated) - rate(&body.state())).norm() > 0.1, "a second with turns");
        let apart = attitude(&simulated).world_from_body() - attitude(&state).world_from_body();
        assert!(apart.norm() < 1e-9, "attitudes {:e} apart", apart.norm());
        for row in (0..3).chain(6..12) {
            let apart = simulated[row] - state[row];
            assert!(apart.abs() < 1e-9, "row {row}: {apart:e} apart");
        }
    }

    #[test]
    fn the_integrator_is_of_order_four() {
        let options =
            VehicleOptions { body_drag_n_s_m: [0.015, 0.015, 0.013], ..Default::default() };
        let load = Load {
            thrust_n: 0.4,
            torque_n_m: Vector3::new(1e-5, -2e-5, 1e-5),
            drag_n_s_m: 0.002,
            spin_n_m_s: 1e-5,
        };
        let [coarse, fine, exact] = [100, 200, 12_800]
            .map(|n: usize| fly(&options, tumbling(), load, 0.4 / n as f64, n).row());
        let order = libm::log2((coarse - exact).norm() / (fine - exact).norm());
        assert!((order - 4.0).abs() < 0.1, "order {order}");
    }

    #[test]
    fn a_falling_body_reaches_its_terminal_velocity() {
        let options = VehicleOptions { body_drag_n_s_m: [0.0, 0.0, 0.1], ..Default::default() };
        let end =
            fly(&options, RigidBody::resting_at(Vector3::zeros()), Load::default(), 0.01, 2000);
        let want = -options.mass_kg * 9.81 / 0.1;
        assert!((end.velocity_m_s.z / want - 1.0).abs() < 1e-9, "{}", end.velocity_m_s.z);
    }

    #[test]
    fn wind_carries_a_weightless_body_with_it() {
        let options = VehicleOptions { body_drag_n_s_m: [0.05; 3], ..Default::default() };
        let inertia = Inertia::new(&options);
        let hover = Load { thrust_n: inertia.weight_n, ..Load::default() };
        let wind = Vector3::new(0.3, -0.2, 0.0);
        let mut row = RigidBody::resting_at(Vector3::zeros()).row();
        for _ in 0..20_000 {
            row = inertia.step(&row, &[hover; 3], &wind, 0.002);
        }
        let velocity_m_s = RigidBody::from_row(&row).velocity_m_s;
        assert!((velocity_m_s - wind).norm() < 1e-9, "{velocity_m_s}");
    }

    #[test]
    fn a_moving_drone_rears_up_against_its_motion() {
        let options = VehicleOptions { airspeed_moment_n_s: 4.7e-4, ..Default::default() };
        let velocity_m_s = Vector3::new(0.2, 0.1, 0.3);
        let body = RigidBody { velocity_m_s, ..RigidBody::resting_at(Vector3::zeros()) };
        let wind_m_s = velocity_m_s * 0.5;
        let change = Inertia::new(&options).derivative(&body.row(), &Load::default(), &wind_m_s);
        // Nose up is a negative pitch, and left side up a positive roll. The wind is half as fast.
        let torque = Vector3::from_fn(|i, _| change[10 + i] * options.inertia_kg_m2[i]);
        let want = Vector3::new(4.7e-4 * 0.05, -4.7e-4 * 0.1, 0.0);
        assert!((torque - want).norm() < 1e-18, "{torque}");
    }

    #[test]
    fn spinning_rotors_answer_a_roll_with_a_pitch_torque() {
        let load = Load { spin_n_m_s: 1e-4, ..Load::default() };
        let body =
            RigidBody { rate_rad_s: Vector3::x(), ..RigidBody::resting_at(Vector3::zeros()) };
        let options = VehicleOptions::default();
        let change = Inertia::new(&options).derivative(&body.row(), &load, &Vector3::zeros());
        assert!((change[11] * options.inertia_kg_m2[1] - 1e-4).abs() < 1e-18, "−w × h");
    }

    #[test]
    fn on_the_floor_it_keeps_its_place_and_yaw() {
        let mut body = tumbling();
        body.world_from_body = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.7);
        let rest = body.on_floor(0.0).state();
        assert!((rest[3] - 0.7).abs() < 1e-12, "yaw {}", rest[3]);
        assert_eq!((rest[0], rest[1], rest[2]), (0.1, -0.2, 0.0));
        assert!(rest.fixed_rows::<8>(4).norm() < 1e-15, "level and at rest");
    }
}
