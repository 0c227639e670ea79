//! Attitude that rotates in small steps, as a unit quaternion. The exponential of `nalgebra` calls
//! the platform's sine, whose last bits differ between machines.

use nalgebra::{Matrix3, Quaternion, Vector3};

use noctograph_core::geometry::Attitude;

/// Attitude, as the rotation from the body to the world frame.
#[derive(Clone, Copy, Debug)]
pub struct Turned(Quaternion<f64>);

impl Turned {
    /// Creates a level attitude with a heading from world x toward y.
    pub fn facing(yaw_rad: f64) -> Self {
        let half_yaw = 0.5 * yaw_rad;
        Self(Quaternion::new(libm::cos(half_yaw), 0.0, 0.0, libm::sin(half_yaw)))
    }

    /// Returns the attitude after a rotation by a small rotation vector in the body frame. The
    /// error is proportional to the vector's fifth power, and below 1e-9 rad for 0.1 rad.
    #[inline(always)]
    pub fn by(&self, turn_rad: &Vector3<f64>) -> Self {
        Self(unit(self.0 * small(turn_rad)))
    }

    /// Returns the attitudes halfway through and after a rotation (rotation vector in rad, body
    /// axes), which is applied in two equal steps.
    #[inline(always)]
    pub fn halfway_and_by(&self, turn_rad: &Vector3<f64>) -> [Self; 2] {
        // The length of `half` differs from 1 by the sixth power of its angle, so only the attitude
        // that is kept is scaled to length 1.
        let half = small(&(turn_rad * 0.5));
        let midway = self.0 * half;
        [Self(midway), Self(unit(midway * half))]
    }

    /// Returns the rotation matrix from the body frame to the world frame.
    #[inline(always)]
    pub fn matrix(&self) -> Matrix3<f64> {
        rotation([self.0.w, self.0.i, self.0.j, self.0.k])
    }
}

/// Returns the matrix of a unit quaternion.
#[inline(always)]
pub(crate) fn rotation([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    Matrix3::new(
        (y * y + z * z) * -2.0 + 1.0,
        (x * y - w * z) * 2.0,
        (x * z + w * y) * 2.0,
        (x * y + w * z) * 2.0,
        (x * x + z * z) * -2.0 + 1.0,
        (y * z - w * x) * 2.0,
        (x * z - w * y) * 2.0,
        (y * z + w * x) * 2.0,
        (x * x + y * y) * -2.0 + 1.0,
    )
}

/// Returns the quaternion of a small rotation vector in rad, by the first terms of the sine and
/// cosine.
#[inline(always)]
fn small(turn_rad: &Vector3<f64>) -> Quaternion<f64> {
    // The terms are sin(θ/2)/θ = 1/2 − θ²/48 and cos(θ/2) = 1 − θ²/8 + θ⁴/384.
    let square = turn_rad.norm_squared();
    let vector = turn_rad * (0.5 - square / 48.0);
    Quaternion::from_parts(1.0 - square / 8.0 + square * square / 384.0, vector)
}

/// Returns the quaternion scaled to length 1. The argument is not zero.
#[inline(always)]
fn unit(q: Quaternion<f64>) -> Quaternion<f64> {
    let square = q.norm_squared();
    // Near a length of 1, a step of Newton's method squares the error without a square root. From
    // 1e-8, only rounding remains.
    let is_near_one = (square - 1.0).abs() < 1e-8;
    q * if is_near_one { 1.5 - 0.5 * square } else { 1.0 / square.sqrt() }
}

/// Returns yaw, pitch and roll of a rotation matrix.
pub fn angles(world_from_body: &Matrix3<f64>) -> Attitude {
    let r = world_from_body;
    Attitude {
        yaw_rad: libm::atan2(r[(1, 0)], r[(0, 0)]),
        pitch_rad: libm::asin(-r[(2, 0)].clamp(-1.0, 1.0)),
        roll_rad: libm::atan2(r[(2, 1)], r[(2, 2)]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_turns_add_up_to_a_large_one() {
        let mut turned = Turned::facing(0.0);
        for _ in 0..100 {
            turned = turned.by(&(Vector3::z() * 0.01));
        }
        let want = Attitude { yaw_rad: 1.0, ..Default::default() }.world_from_body();
        assert!((turned.matrix() - want).norm() < 1e-11, "{}", turned.matrix());
    }

    #[test]
    fn angles_are_those_of_the_matrix() {
        let attitude = Attitude { yaw_rad: 2.0, pitch_rad: -0.7, roll_rad: 0.4 };
        let turned_angles = angles(&attitude.world_from_body());
        let apart = (turned_angles.yaw_rad - 2.0).abs()
            + (turned_angles.pitch_rad + 0.7).abs()
            + (turned_angles.roll_rad - 0.4).abs();
        assert!(apart < 1e-14, "{turned_angles:?}");
    }
}
