//! Conversions between poses and frames, and geometry of polylines and solids. No other module
//! converts between frames.
//!
//! In the world frame, z points up, x to the viewer's right along the word, and y into the scene.
//! The word is in the x-z plane. In the body frame, x points forward, y left and z up. Attitudes
//! consist of yaw ψ, pitch θ and roll φ with `world_from_body = Rz(ψ) Ry(θ) Rx(φ)`, the convention
//! of the reference flight.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

mod polyline;
mod solid;

pub use polyline::{Chords, arc_lengths, bounds, distance};
pub use polyline::{polyline_length_m, segment_distance, simplify};
pub use solid::Solid;

/// Attitude of a body as yaw, pitch and roll. In JSON, it is an array of these three angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(into = "[f64; 3]")]
pub struct Attitude {
    /// Yaw ψ about world z in rad.
    pub yaw_rad: f64,
    /// Pitch θ about the yawed y axis in rad, positive with the nose down.
    pub pitch_rad: f64,
    /// Roll φ about body x in rad.
    pub roll_rad: f64,
}

impl From<Attitude> for [f64; 3] {
    fn from(attitude: Attitude) -> Self {
        [attitude.yaw_rad, attitude.pitch_rad, attitude.roll_rad]
    }
}

impl Attitude {
    /// Returns the rotation from body to world vectors, `Rz(ψ) Ry(θ) Rx(φ)`.
    pub fn world_from_body(&self) -> Matrix3<f64> {
        // The matrix is the product of the three rotations.
        let (sy, cy) = libm::sincos(self.yaw_rad);
        let (sp, cp) = libm::sincos(self.pitch_rad);
        let (sr, cr) = libm::sincos(self.roll_rad);
        Matrix3::new(
            cy * cp,
            cy * sp * sr - sy * cr,
            cy * sp * cr + sy * sr,
            sy * cp,
            sy * sp * sr + cy * cr,
            sy * sp * cr - cy * sr,
            -sp,
            cp * sr,
            cp * cr,
        )
    }
}

/// Returns the rotation from world vectors to camera vectors (x right, y down, z forward) for a
/// camera that looks along `forward` with a level horizon. The length of `forward` does not matter.
///
/// If the camera looks straight up or down, the horizon is undefined, and right is world x.
///
/// # Panics
///
/// Panics if `forward` is zero.
pub fn camera_from_world(forward: Vector3<f64>) -> Matrix3<f64> {
    assert!(forward.norm() > 0.0, "a camera must look somewhere");
    let forward = forward.normalize();
    // The rows are the axes of the camera in the world frame.
    let side = forward.cross(&Vector3::z());
    let right = if side.norm() > 1e-9 { side.normalize() } else { Vector3::x() };
    let down = forward.cross(&right);
    Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()])
}

/// Returns the rotation from world vectors to camera vectors (x right, y down, z forward) for a
/// camera with the orientation quaternion `w, x, y, z`. Without rotation, the camera looks along -z
/// with x to its right and y up (Blender, Skybrush's `.skyc`, glTF).
///
/// # Panics
///
/// Panics if the quaternion is zero.
pub fn camera_from_orientation([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    let quaternion = nalgebra::Quaternion::new(w, x, y, z);
    assert!(quaternion.norm() > 0.0, "a quaternion of zeros is not an attitude");
    let world_from_viewer = nalgebra::UnitQuaternion::from_quaternion(quaternion);
    let camera_from_viewer = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    camera_from_viewer * world_from_viewer.to_rotation_matrix().matrix().transpose()
}

/// Returns a vector rotated about the vertical axis, from x toward y. A rotation by zero returns
/// exactly the same bits.
#[inline]
pub fn turned(vector: &Vector3<f64>, angle_rad: f64) -> Vector3<f64> {
    if angle_rad == 0.0 {
        return *vector;
    }
    let (sin, cos) = libm::sincos(angle_rad);
    Vector3::new(cos * vector.x - sin * vector.y, sin * vector.x + cos * vector.y, vector.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attitude_is_a_rotation_and_yaw_turns_x_to_y() {
        let attitude = Attitude { yaw_rad: 0.3, pitch_rad: -0.2, roll_rad: 0.1 };
        let r = attitude.world_from_body();
        assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-15, "orthonormal");
        assert!((r.determinant() - 1.0).abs() < 1e-15, "right-handed");
        let quarter = Attitude { yaw_rad: std::f64::consts::FRAC_PI_2, ..Default::default() }
            .world_from_body();
        assert!((quarter * Vector3::x() - Vector3::y()).norm() < 1e-15, "x becomes y");
    }

    #[test]
    fn a_camera_looking_into_the_scene_sees_x_right_and_z_up() {
        let r = camera_from_world(Vector3::y() * 2.0);
        assert_eq!(r * Vector3::x(), Vector3::x(), "world x is right");
        assert_eq!(r * Vector3::z(), -Vector3::y(), "world up is up in the picture");
        assert_eq!(r * Vector3::y(), Vector3::z(), "world y is depth");
        assert!((r.determinant() - 1.0).abs() < 1e-15, "right-handed");
    }
}
