//! The rigid body: where it is, and one step of its motion.

#[cfg(test)]
use nalgebra::Rotation3;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use super::model::{GRAVITY_M_S2, State};
#[cfg(test)]
use super::model::{attitude, rate, velocity};
use super::options::VehicleOptions;
use super::rotors::Load;
use crate::sim::lanes::euler_angles;
use crate::sim::wide::{Each, Real};

/// Position, velocity, quaternion (w x y z) and body rate in one row, for the integrator.
pub(super) type Row<T> = [T; 13];

/// Where a rigid body is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Body origin, world frame.
    pub position_m: Vector3<f64>,
    /// World frame.
    pub velocity_m_s: Vector3<f64>,
    /// Attitude: turns body vectors into world vectors.
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular velocity, body frame.
    pub rate_rad_s: Vector3<f64>,
}

impl Body {
    /// A level body at rest that looks along world x.
    #[must_use]
    pub fn at(position_m: Vector3<f64>) -> Self {
        Self {
            position_m,
            velocity_m_s: Vector3::zeros(),
            world_from_body: UnitQuaternion::identity(),
            rate_rad_s: Vector3::zeros(),
        }
    }

    /// The body in a state of the design model.
    #[cfg(test)]
    pub(in crate::sim) fn of(state: &State) -> Self {
        let turn = Rotation3::from_matrix_unchecked(attitude(state).world_from_body());
        let world_from_body = UnitQuaternion::from_rotation_matrix(&turn);
        Self {
            position_m: state.fixed_rows::<3>(0).into(),
            velocity_m_s: world_from_body * velocity(state),
            world_from_body,
            rate_rad_s: rate(state),
        }
    }

    /// Whether the pitch or the roll has come to a quarter turn, where the thrust no longer lifts.
    pub(in crate::sim) fn is_on_its_back(&self) -> bool {
        let q = &self.world_from_body;
        let (cos_of_roll, sin_pitch) =
            (1.0 - 2.0 * (q.i * q.i + q.j * q.j), 2.0 * (q.w * q.j - q.k * q.i));
        cos_of_roll <= 0.0 || sin_pitch.abs() >= 1.0
    }

    /// The same place and yaw on the floor, level and at rest.
    pub(super) fn on_floor(&self) -> Self {
        let [y, x] = self.yaw();
        let half_yaw = 0.5 * libm::atan2(y, x);
        let level = Quaternion::new(libm::cos(half_yaw), 0.0, 0.0, libm::sin(half_yaw));
        Self {
            world_from_body: UnitQuaternion::new_unchecked(level),
            ..Self::at(Vector3::new(self.position_m.x, self.position_m.y, 0.0))
        }
    }

    /// Attitude as a matrix.
    #[inline]
    pub(in crate::sim) fn matrix(&self) -> Matrix3<f64> {
        self.world_from_body.to_rotation_matrix().into_inner()
    }

    /// A point `(y, x)` in the direction of the yaw.
    fn yaw(&self) -> [f64; 2] {
        let q = &self.world_from_body;
        [2.0 * (q.w * q.k + q.i * q.j), 1.0 - 2.0 * (q.j * q.j + q.k * q.k)]
    }

    /// The twelve states of the design model: yaw and roll within ±π, pitch within ±π/2.
    pub(in crate::sim) fn state(&self) -> State {
        let q = &self.world_from_body;
        let sin_pitch = (2.0 * (q.w * q.j - q.k * q.i)).clamp(-1.0, 1.0);
        let roll = [2.0 * (q.w * q.i + q.j * q.k), 1.0 - 2.0 * (q.i * q.i + q.j * q.j)];
        let (p, v, w) = (&self.position_m, self.velocity_body_m_s(), &self.rate_rad_s);
        let a = euler_angles(self.yaw(), sin_pitch, roll);
        let turn = [a.yaw_rad, a.pitch_rad, a.roll_rad];
        State::from([p.x, p.y, p.z, turn[0], turn[1], turn[2], v.x, v.y, v.z, w.x, w.y, w.z])
    }

    /// Velocity in the body frame.
    #[must_use]
    pub fn velocity_body_m_s(&self) -> Vector3<f64> {
        self.world_from_body.inverse_transform_vector(&self.velocity_m_s)
    }

    #[inline(always)]
    pub(super) fn row(&self) -> Row<f64> {
        let (p, v, w) = (&self.position_m, &self.velocity_m_s, &self.rate_rad_s);
        let q = &self.world_from_body;
        [p.x, p.y, p.z, v.x, v.y, v.z, q.w, q.i, q.j, q.k, w.x, w.y, w.z]
    }

    /// The body of a row, whose quaternion is a unit one.
    #[inline(always)]
    pub(super) fn from_row(s: &Row<f64>) -> Self {
        Self {
            position_m: Vector3::new(s[0], s[1], s[2]),
            velocity_m_s: Vector3::new(s[3], s[4], s[5]),
            world_from_body: UnitQuaternion::new_unchecked(Quaternion::new(s[6], s[7], s[8], s[9])),
            rate_rad_s: Vector3::new(s[10], s[11], s[12]),
        }
    }
}

/// What resists motion: mass, inertia, drag.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertia<T> {
    weight_n: T,
    /// Force per speed through the air along body x, y, z.
    drag_n_s_m: [T; 3],
    /// Moment per speed through the air, against the motion.
    airspeed_moment_n_s: T,
    /// Inverses, for a division costs as much as ten products.
    per_mass: T,
    per_moment: [T; 3],
    /// `(J_y − J_z) / J_x` and so on round.
    coupling: [T; 3],
}

impl<T: Real> Inertia<T> {
    pub(super) fn new(each: &Each<'_, VehicleOptions, T>) -> Self {
        Self {
            weight_n: each.figure(|o| o.mass_kg * GRAVITY_M_S2),
            drag_n_s_m: each.figures(|o| o.body_drag_n_s_m),
            airspeed_moment_n_s: each.figure(|o| o.airspeed_moment_n_s),
            per_mass: each.figure(|o| 1.0 / o.mass_kg),
            per_moment: each.figures(|o| o.inertia_kg_m2.map(|j| 1.0 / j)),
            coupling: each.figures(|o| {
                let [x, y, z] = o.inertia_kg_m2;
                [(y - z) / x, (z - x) / y, (x - y) / z]
            }),
        }
    }

    pub(super) fn weight_n(&self) -> T {
        self.weight_n
    }

    /// What an accelerometer reads in the air, along the body axes: thrust and drag per mass.
    #[inline(always)]
    pub(super) fn specific_force_m_s2(
        &self,
        s: &Row<T>,
        load: &Load<T>,
        wind_m_s: &[T; 3],
    ) -> [T; 3] {
        let air = [s[3] - wind_m_s[0], s[4] - wind_m_s[1], s[5] - wind_m_s[2]];
        let air = into_body(&[s[6], s[7], s[8], s[9]], &air);
        let [x, y, z] = self.drag_n(&air, load);
        [x * self.per_mass, y * self.per_mass, (z + load.thrust_n) * self.per_mass]
    }

    /// Drag along the body axes at an airspeed in the body frame.
    #[inline(always)]
    fn drag_n(&self, airspeed_m_s: &[T; 3], load: &Load<T>) -> [T; 3] {
        let [x, y, z] = self.drag_n_s_m;
        let across = load.drag_n_s_m;
        [
            -((x + across) * airspeed_m_s[0]),
            -((y + across) * airspeed_m_s[1]),
            -(z * airspeed_m_s[2]),
        ]
    }

    /// One step of the classical Runge–Kutta method; `loads` at its start, middle and end.
    #[inline(always)]
    pub(super) fn step(
        &self,
        s: &Row<T>,
        loads: &[Load<T>; 3],
        wind_m_s: &[T; 3],
        dt_s: f64,
    ) -> Row<T> {
        let k1 = self.slope(s, &loads[0], wind_m_s);
        let k2 = self.slope(&ahead(s, &k1, 0.5 * dt_s), &loads[1], wind_m_s);
        let k3 = self.slope(&ahead(s, &k2, 0.5 * dt_s), &loads[1], wind_m_s);
        let k4 = self.slope(&ahead(s, &k3, dt_s), &loads[2], wind_m_s);
        let sixth_s = dt_s / 6.0;
        let mut end = *s;
        for (i, value) in end.iter_mut().enumerate() {
            *value = *value + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * sixth_s;
        }
        let [w, x, y, z] = [end[6], end[7], end[8], end[9]];
        let size = ((x * x + z * z) + (y * y + w * w)).root();
        for part in &mut end[6..10] {
            *part = *part / size;
        }
        end
    }

    #[inline(always)]
    fn slope(&self, s: &Row<T>, load: &Load<T>, wind_m_s: &[T; 3]) -> Row<T> {
        let [w, x, y, z] = [s[6], s[7], s[8], s[9]];
        // The columns of the matrix: body x, y and z in the world.
        let r_x = [(y * y + z * z) * -2.0 + 1.0, (x * y + w * z) * 2.0, (x * z - w * y) * 2.0];
        let r_y = [(x * y - w * z) * 2.0, (x * x + z * z) * -2.0 + 1.0, (y * z + w * x) * 2.0];
        let r_z = [(x * z + w * y) * 2.0, (y * z - w * x) * 2.0, (x * x + y * y) * -2.0 + 1.0];
        let air = [s[3] - wind_m_s[0], s[4] - wind_m_s[1], s[5] - wind_m_s[2]];
        let air = [dot(&r_x, &air), dot(&r_y, &air), dot(&r_z, &air)];
        let drag = self.drag_n(&air, load);
        let force = [drag[0], drag[1], drag[2] + load.thrust_n];
        let (p, q, o) = (s[10], s[11], s[12]);
        let (c, per_j, torque) = (&self.coupling, &self.per_moment, &load.torque_n_m);
        let m_u = self.airspeed_moment_n_s;
        let (roll, pitch) = (torque[0] + m_u * air[1], torque[1] - m_u * air[0]);
        [
            s[3],
            s[4],
            s[5],
            dot(&[r_x[0], r_y[0], r_z[0]], &force) * self.per_mass,
            dot(&[r_x[1], r_y[1], r_z[1]], &force) * self.per_mass,
            dot(&[r_x[2], r_y[2], r_z[2]], &force) * self.per_mass - GRAVITY_M_S2,
            (x * p + y * q + z * o) * -0.5,
            (w * p + y * o - z * q) * 0.5,
            (w * q + z * p - x * o) * 0.5,
            (w * o + x * q - y * p) * 0.5,
            // The rotors' own spin turns with the body: the gyroscopic torque.
            c[0] * q * o + (roll - q * load.spin_n_m_s) * per_j[0],
            c[1] * p * o + (pitch + p * load.spin_n_m_s) * per_j[1],
            c[2] * p * q + torque[2] * per_j[2],
        ]
    }
}

#[inline(always)]
fn ahead<T: Real>(s: &Row<T>, slope: &Row<T>, dt_s: f64) -> Row<T> {
    let mut row = *s;
    for (value, slope) in row.iter_mut().zip(slope) {
        *value = *value + *slope * dt_s;
    }
    row
}

/// A world vector along the body axes, for an attitude `world_from_body`: w x y z.
#[inline(always)]
fn into_body<T: Real>(q: &[T; 4], v: &[T; 3]) -> [T; 3] {
    let turn = [-q[1], -q[2], -q[3]];
    let [x, y, z] = cross(&turn, v);
    let twice = [x * 2.0, y * 2.0, z * 2.0];
    let [x, y, z] = cross(&turn, &twice);
    let w = q[0];
    [twice[0] * w + x + v[0], twice[1] * w + y + v[1], twice[2] * w + z + v[2]]
}

#[inline(always)]
fn dot<T: Real>(a: &[T; 3], b: &[T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<T: Real>(a: &[T; 3], b: &[T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::vehicle::model::{Vehicle, Wrench};
    use crate::sim::vehicle::{attitude, rate};

    /// The reference team's drone, whose drag is nought.
    fn plain() -> VehicleOptions {
        VehicleOptions::default()
    }

    fn inertia(options: &VehicleOptions) -> Inertia<f64> {
        Inertia::new(&Each::one(options))
    }

    fn fly(options: &VehicleOptions, body: Body, load: Load<f64>, dt_s: f64, n: usize) -> Body {
        let (inertia, mut row) = (inertia(options), body.row());
        for _ in 0..n {
            row = inertia.step(&row, &[load; 3], &[0.0; 3], dt_s);
        }
        Body::from_row(&row)
    }

    fn tumbling() -> Body {
        Body {
            velocity_m_s: Vector3::new(1.0, -2.0, 0.5),
            world_from_body: UnitQuaternion::new(Vector3::new(0.2, -0.3, 0.4)),
            rate_rad_s: Vector3::new(1.5, -1.0, 2.0),
            ..Body::at(Vector3::new(0.1, -0.2, 50.0))
        }
    }

    #[test]
    fn free_fall_is_exact() {
        let end = fly(&plain(), tumbling(), Load::default(), 0.002, 500);
        let start = tumbling();
        let want = start.position_m + start.velocity_m_s - Vector3::z() * (0.5 * 9.81);
        assert!((end.position_m - want).norm() < 1e-9, "falls by g t²/2");
        let want = start.velocity_m_s - Vector3::z() * 9.81;
        assert!((end.velocity_m_s - want).norm() < 1e-9, "gains g t");
    }

    #[test]
    fn torque_free_rotation_keeps_energy_and_momentum() {
        let options = plain();
        let j = Vector3::from(options.inertia_kg_m2);
        let energy = |b: &Body| 0.5 * b.rate_rad_s.component_mul(&b.rate_rad_s).dot(&j);
        let momentum = |b: &Body| b.world_from_body * j.component_mul(&b.rate_rad_s);
        let start = tumbling();
        let end = fly(&options, start, Load::default(), 0.001, 1000);
        assert!((end.rate_rad_s - start.rate_rad_s).norm() > 0.1, "it does tumble");
        assert!((energy(&end) / energy(&start) - 1.0).abs() < 1e-9, "energy");
        let drift = (momentum(&end) - momentum(&start)).norm() / momentum(&start).norm();
        assert!(drift < 1e-9, "momentum drifts by {drift:e}");
    }

    #[test]
    fn a_free_spinning_top_precesses_as_the_closed_form_says() {
        // Two equal moments: w_z stays, (w_x, w_y) turn by (J_z − J_x) w_z / J_x.
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
        let load = Load { thrust_n: 0.36, torque_n_m: [1e-6, -2e-6, 1e-6], ..Load::default() };
        let (body, dt_s, n) = (tumbling(), 2.5e-4, 4000);
        let wrench = Wrench::new(1e-6, -2e-6, 1e-6, 0.36);
        let vehicle = Vehicle::new(&VehicleOptions::default());
        let mut state = body.state();
        for _ in 0..n {
            state = vehicle.step(&state, &wrench, dt_s);
        }
        let end = fly(&plain(), body, load, dt_s, n);
        let found = end.state();
        assert!((rate(&found) - rate(&body.state())).norm() > 0.1, "a second with turns");
        let apart = attitude(&found).world_from_body() - attitude(&state).world_from_body();
        assert!(apart.norm() < 1e-9, "attitudes {:e} apart", apart.norm());
        for row in (0..3).chain(6..12) {
            let apart = found[row] - state[row];
            assert!(apart.abs() < 1e-9, "row {row}: {apart:e} apart");
        }
    }

    #[test]
    fn the_integrator_is_of_order_four() {
        let options =
            VehicleOptions { body_drag_n_s_m: [0.015, 0.015, 0.013], ..Default::default() };
        let load = Load {
            thrust_n: 0.4,
            torque_n_m: [1e-5, -2e-5, 1e-5],
            drag_n_s_m: 0.002,
            spin_n_m_s: 1e-5,
        };
        let end = |n: usize| {
            #[expect(clippy::cast_precision_loss, reason = "small")]
            fly(&options, tumbling(), load, 0.4 / n as f64, n)
        };
        let exact = end(12_800);
        let error = |n: usize| {
            let (a, b) = (end(n).row(), exact.row());
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        let order = libm::log2(error(100) / error(200));
        assert!((order - 4.0).abs() < 0.1, "order {order}");
    }

    #[test]
    fn a_falling_body_reaches_its_terminal_velocity() {
        let options = VehicleOptions { body_drag_n_s_m: [0.0, 0.0, 0.1], ..Default::default() };
        let end = fly(&options, Body::at(Vector3::zeros()), Load::default(), 0.01, 2000);
        let want = -options.mass_kg * 9.81 / 0.1;
        assert!((end.velocity_m_s.z / want - 1.0).abs() < 1e-9, "{}", end.velocity_m_s.z);
    }

    #[test]
    fn wind_carries_a_weightless_body_with_it() {
        let options = VehicleOptions { body_drag_n_s_m: [0.05; 3], ..Default::default() };
        let inertia = inertia(&options);
        let hover = Load { thrust_n: inertia.weight_n(), ..Load::default() };
        let wind = [0.3, -0.2, 0.0];
        let mut row = Body::at(Vector3::zeros()).row();
        for _ in 0..20_000 {
            row = inertia.step(&row, &[hover; 3], &wind, 0.002);
        }
        let velocity_m_s = Body::from_row(&row).velocity_m_s;
        assert!((velocity_m_s - Vector3::from(wind)).norm() < 1e-9, "{velocity_m_s}");
    }

    #[test]
    fn a_moving_drone_rears_up_against_its_motion() {
        let options = VehicleOptions { airspeed_moment_n_s: 4.7e-4, ..Default::default() };
        let velocity_m_s = Vector3::new(0.2, 0.1, 0.3);
        let body = Body { velocity_m_s, ..Body::at(Vector3::zeros()) };
        let wind_m_s = (velocity_m_s * 0.5).into();
        let slope = inertia(&options).slope(&body.row(), &Load::default(), &wind_m_s);
        // Nose up is a negative pitch, left side up a positive roll; half the speed is the wind's.
        let torque = Vector3::from_fn(|i, _| slope[10 + i] * options.inertia_kg_m2[i]);
        let want = Vector3::new(4.7e-4 * 0.05, -4.7e-4 * 0.1, 0.0);
        assert!((torque - want).norm() < 1e-18, "{torque}");
    }

    #[test]
    fn spinning_rotors_answer_a_roll_with_a_pitch_torque() {
        let load = Load { spin_n_m_s: 1e-4, ..Load::default() };
        let body = Body { rate_rad_s: Vector3::x(), ..Body::at(Vector3::zeros()) };
        let slope = inertia(&plain()).slope(&body.row(), &load, &[0.0; 3]);
        assert!((slope[11] * plain().inertia_kg_m2[1] - 1e-4).abs() < 1e-18, "−w × h");
    }

    #[test]
    fn on_the_floor_it_keeps_its_place_and_yaw() {
        let mut body = tumbling();
        body.world_from_body = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.7);
        let rest = body.on_floor().state();
        assert!((rest[3] - 0.7).abs() < 1e-12, "yaw {}", rest[3]);
        assert_eq!((rest[0], rest[1], rest[2]), (0.1, -0.2, 0.0));
        assert!(rest.fixed_rows::<8>(4).norm() < 1e-15, "level and at rest");
    }
}
