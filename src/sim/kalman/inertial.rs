//! Motion of a drone computed from its gyroscope and accelerometer, with nine small errors.
//!
//! The errors are those of position and velocity in the world frame, and a rotation in the body
//! frame. A [`Normal`] contains the errors of one drone after the other, followed by other states.
//! The covariance is propagated in 3×3 blocks, which avoids products with zeros.
//!
//! Source: J. Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv 1711.02508.
//!
//! Biases of the inertial sensors are not estimated.

use nalgebra::{Matrix3, Vector3};

use super::attitude::Turned;
use super::normal::Normal;

pub use noctograph_core::crazyflie::GRAVITY_M_S2;

/// Number of errors per drone, of which the first three are those of the position.
pub const ERRORS: usize = 9;
/// Index of the three errors of the velocity.
pub const VELOCITY: usize = 3;
/// Index of the three errors of the rotation.
pub const TURN: usize = 6;

/// Maximum time in s between two propagations of the covariance.
const LONGEST_SPAN_S: f64 = 0.01;

/// Position, velocity and attitude from inertial sensors.
#[derive(Clone, Debug)]
pub struct Inertial {
    /// Position in the world frame in m.
    pub position_m: Vector3<f64>,
    /// Velocity in the world frame in m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Attitude of the body.
    pub attitude: Turned,
    /// Attitude as a matrix, at the last propagation of the covariance.
    pub world_from_body: Matrix3<f64>,
    /// Body rate at the end of the last tick in rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Time in s and rotation in rad since the last propagation of the covariance.
    span_s: f64,
    turn_rad: Vector3<f64>,
}

/// Span over which a covariance is propagated.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Duration of the span in s.
    pub span_s: f64,
    /// Matrix `−R [f]×` of the specific force f.
    pub lever: Matrix3<f64>,
    /// Rotation of the body in rad.
    pub turn_rad: Vector3<f64>,
}

/// Returns the increase per second in the variance of integrated white noise, which is the noise's
/// two-sided spectral density. `per_sqrt_hz` is the one-sided density, as in data sheets and scene
/// keys.
pub fn variance_rate(per_sqrt_hz: f64) -> f64 {
    0.5 * (per_sqrt_hz * per_sqrt_hz)
}

/// Variance rates ([`variance_rate`]) of the inertial sensors' noise.
#[derive(Clone, Copy, Debug)]
pub struct Density {
    /// Variance rates of the acceleration along world x, y and z in (m/s²)²/Hz.
    pub acceleration: [f64; 3],
    /// Variance rate of the body rate in (rad/s)²/Hz.
    pub rate: f64,
}

impl Inertial {
    /// Creates a level drone at rest with a heading from world x toward y.
    pub fn level_at(position_m: Vector3<f64>, yaw_rad: f64) -> Self {
        let attitude = Turned::facing(yaw_rad);
        Self {
            position_m,
            velocity_m_s: Vector3::zeros(),
            attitude,
            world_from_body: attitude.matrix(),
            rate_rad_s: Vector3::zeros(),
            span_s: 0.0,
            turn_rad: Vector3::zeros(),
        }
    }

    /// Advances the state by a tick, with the mean of the body rates at its start and end, and the
    /// specific force (m/s², body frame) during the tick. Returns the acceleration in m/s² in the
    /// world frame.
    pub fn predict(
        &mut self,
        rate_rad_s: &Vector3<f64>,
        force_m_s2: &Vector3<f64>,
        tick_s: f64,
    ) -> Vector3<f64> {
        // The force is rotated to the world frame by the attitude in the middle of the tick, and
        // the acceleration is constant over the tick.
        let turn_rad = (self.rate_rad_s + rate_rad_s) * (0.5 * tick_s);
        let [midway, after] = self.attitude.halfway_and_by(&turn_rad);
        let acceleration = midway.matrix() * force_m_s2 - Vector3::z() * GRAVITY_M_S2;
        self.position_m += (self.velocity_m_s + acceleration * (0.5 * tick_s)) * tick_s;
        self.velocity_m_s += acceleration * tick_s;
        self.attitude = after;
        self.rate_rad_s = *rate_rad_s;
        self.span_s += tick_s;
        self.turn_rad += turn_rad;
        acceleration
    }

    /// True if the covariance must be propagated, because a measurement follows (`measured`) or
    /// 10 ms have passed since the last propagation.
    pub fn is_due(&self, measured: bool) -> bool {
        measured || self.span_s >= LONGEST_SPAN_S
    }

    /// Returns the span since the last covariance propagation. The next span begins at this tick.
    pub fn span(&mut self, force_m_s2: &Vector3<f64>) -> Span {
        self.world_from_body = self.attitude.matrix();
        Span {
            span_s: std::mem::take(&mut self.span_s),
            lever: -self.world_from_body * force_m_s2.cross_matrix(),
            turn_rad: std::mem::take(&mut self.turn_rad),
        }
    }

    /// Adds the mean errors of a drone to its motion, and sets them to zero.
    pub fn settle(&mut self, normal: &mut Normal, drone: usize) {
        let [position_m, velocity_m_s, turn_rad] = normal.take_errors(drone);
        self.position_m += position_m;
        self.velocity_m_s += velocity_m_s;
        self.attitude = self.attitude.by(&turn_rad);
    }
}

impl Normal {
    /// Creates independent errors of drones with the standard deviations of position (m), velocity
    /// (m/s) and rotation (rad), and further states with theirs.
    pub fn of_drones(n_drones: usize, [p, v, t]: [f64; 3], further: &[f64]) -> Self {
        let mut sigmas = [p, p, p, v, v, v, t, t, t].repeat(n_drones);
        sigmas.extend(further);
        Self::independent(&sigmas)
    }

    /// Returns the mean errors of a drone (position in m, velocity in m/s, rotation in rad), and
    /// sets them to zero.
    pub fn take_errors(&mut self, drone: usize) -> [Vector3<f64>; 3] {
        let first = ERRORS * drone;
        let errors = [0, VELOCITY, TURN].map(|row| self.three(first + row));
        self.mean.rows_mut(first, ERRORS).fill(0.0);
        errors
    }

    /// Propagates the errors of a drone over a span by `P ← Φ P Φᵀ + Q` with `ṗ = v`, `v̇ = −R [f]×
    /// θ`, `θ̇ = −[ω]× θ`. The other states are constant.
    #[inline(always)]
    pub fn carry(&mut self, drone: usize, span: &Span, density: &Density) {
        // For position, velocity and rotation, `Φ = [1 τ c; 0 1 b; 0 0 T]`.
        let first = ERRORS * drone;
        let Span { span_s, lever, turn_rad } = *span;
        let b = lever * span_s;
        let c = b * (0.5 * span_s);
        let cross = turn_rad.cross_matrix();
        let t_transposed = Matrix3::identity() + cross + cross * cross * 0.5;

        // The rows of Φ P are computed in blocks, without those below the diagonal.
        let rows = [first, first + VELOCITY, first + TURN];
        let [pp, pv, pt] = rows.map(|column| self.block(rows[0], column));
        let [vv, vt] = [rows[1], rows[2]].map(|column| self.block(rows[1], column));
        let tt = self.block(rows[2], rows[2]);
        let b_tt = b * tt;
        let row_pt = pt + vt * span_s + b_tt * (0.5 * span_s);
        let row_vt = vt + b_tt;
        let row_pv = pv + vv * span_s + c * vt.transpose();
        let row_pp = pp + pv.transpose() * span_s + c * pt.transpose();

        // The columns of (Φ P) Φᵀ are computed next.
        let mut pp = row_pp + row_pv * span_s + row_pt * c.transpose();
        let mut pv = row_pv + row_pt * b.transpose();
        let mut vv = vv + (b * vt.transpose() + row_vt * b.transpose());
        let pt = row_pt * t_transposed;
        let vt = row_vt * t_transposed;
        let mut tt = t_transposed.transpose() * tt * t_transposed;

        // White acceleration noise q contributes q τ³/3, q τ²/2 and q τ to Q. White rate noise
        // affects only the rotation.
        for (i, density_m_s2) in density.acceleration.into_iter().enumerate() {
            let velocity = density_m_s2 * span_s;
            pp[(i, i)] += velocity * span_s * span_s / 3.0;
            pv[(i, i)] += velocity * span_s / 2.0;
            vv[(i, i)] += velocity;
            tt[(i, i)] += density.rate * span_s;
        }
        // The blocks are made exactly symmetric, and written back to P.
        for (k, block) in [pp, vv, tt].iter().enumerate() {
            self.set(rows[k], rows[k], &((block + block.transpose()) * 0.5));
        }
        for (row, column, block) in [(0, 1, &pv), (0, 2, &pt), (1, 2, &vt)] {
            self.set(rows[row], rows[column], block);
            self.set(rows[column], rows[row], &block.transpose());
        }

        self.carry_others(first, span_s, &[b, c, t_transposed.transpose()]);
    }

    /// Propagates the covariances between a drone's errors and the other states, which are
    /// constant, by multiplying their columns by Φ. `first` is the row of the drone's first error,
    /// and `b`, `c` and `t` are the blocks of Φ.
    #[inline(always)]
    fn carry_others(&mut self, first: usize, span_s: f64, [b, c, t]: &[Matrix3<f64>; 3]) {
        let (n, states) = (self.mean.len(), self.covariance.as_mut_slice());
        for other in (0..first).chain(first + ERRORS..n) {
            let column = &states[other * n + first..][..ERRORS];
            let [p, v, turn] =
                [0, VELOCITY, TURN].map(|i| Vector3::new(column[i], column[i + 1], column[i + 2]));
            let propagated = [p + v * span_s + c * turn, v + b * turn, t * turn];
            for (i, covariance) in propagated.iter().flatten().enumerate() {
                states[other * n + first + i] = *covariance;
                states[(first + i) * n + other] = *covariance;
            }
        }
    }

    /// Sets a 3×3 block of the covariance.
    #[inline(always)]
    fn set(&mut self, row: usize, column: usize, block: &Matrix3<f64>) {
        self.covariance.fixed_view_mut::<3, 3>(row, column).copy_from(block);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::super::normal::{Measurement, Part};
    use super::*;

    #[test]
    fn blocks_are_propagated_as_the_whole_matrix_is() {
        // The states are the errors of two drones and the height of the floor.
        let mut normal = Normal::of_drones(2, [0.3, 0.2, 0.1], &[0.4]);
        let density = Density { acceleration: [0.3, 0.2, 0.1], rate: 0.04 };
        let mut p = normal.covariance.clone();
        for step in 0..60_usize {
            let (drone, phase) = (step % 2, 0.1 * f64::from(u8::try_from(step).unwrap()));
            let force = Vector3::new(libm::sin(phase), libm::cos(phase), 9.8);
            let turn_rad = Vector3::new(0.01, -0.02, libm::sin(3.0 * phase) * 0.03);
            let (span_s, lever, first) = (0.05, -force.cross_matrix(), ERRORS * drone);
            normal.carry(drone, &Span { span_s, lever, turn_rad }, &density);
            let (mut phi, one) = (DMatrix::identity(19, 19), Matrix3::identity());
            let cross = turn_rad.cross_matrix();
            for (row, column, block) in [
                (0, VELOCITY, one * span_s),
                (0, TURN, lever * (0.5 * span_s * span_s)),
                (VELOCITY, TURN, lever * span_s),
                (TURN, TURN, one - cross + cross * cross * 0.5),
            ] {
                phi.fixed_view_mut::<3, 3>(first + row, first + column).copy_from(&block);
            }
            p = &phi * p * phi.transpose();
            for (k, density) in density.acceleration.into_iter().enumerate() {
                p[(first + k, first + k)] += density * span_s * span_s * span_s / 3.0;
                p[(first + k, first + k + 3)] += density * span_s * span_s / 2.0;
                p[(first + k + 3, first + k)] += density * span_s * span_s / 2.0;
                p[(first + k + 3, first + k + 3)] += density * span_s;
                p[(first + k + 6, first + k + 6)] += 0.04 * span_s;
            }
            let apart = (&normal.covariance - &p).norm() / p.norm();
            assert!(apart < 1e-13, "{apart}");
            // The measurement correlates the drones and the floor.
            let jacobian =
                [Part::Three(0, force * 0.1), Part::Three(9, turn_rad), Part::One(18, -1.0)];
            let measurement = Measurement { jacobian: &jacobian, value: 0.0, variance: 0.01 };
            assert!(normal.correct(&measurement, |_| true));
            p.copy_from(&normal.covariance);
        }
    }
}
