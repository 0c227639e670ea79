//! Lighthouse base station, with pose, field of view, and the angles of its light planes at a
//! point.
//!
//! In a station's frame, x points forward (out of the front), y left and z up. Angles are those
//! that the firmware computes with the factory calibration, so the calibrations in a configuration
//! file have no effect. The remaining error is modeled by `sweep_distortion_rad`. The model is that
//! of the firmware's `lighthouse_position_est.c` and `lighthouse_geometry.c`. The fields of view
//! are from Bitcraze's documentation of the Lighthouse deck.

use nalgebra::{Matrix3, Vector3};

use super::{Generation, Station};
use noctograph_core::geometry::Attitude;

/// Tangent of the slant of a second-generation station's planes, tan(π/6).
const TAN_TILT: f64 = 0.577_350_269_189_625_8;
/// Tangents of half the width and half the height of the field of view, which are 60° and 60° in
/// the first generation, and 75° and 55° in the second.
const TAN_HALF_VIEW_V1: [f64; 2] = [1.732_050_807_568_877_2, 1.732_050_807_568_877_2];
const TAN_HALF_VIEW_V2: [f64; 2] = [3.732_050_807_568_877, 1.428_148_006_742_114_7];
/// Documented distance in m beyond which the deck no longer detects a sweep.
pub(super) const RANGE_M: f64 = 6.0;
/// Sine of the lowest elevation of a station above the deck's plane at which the deck's sensors,
/// which look up, still see it. The elevation of 6° is an assumption. Bitcraze recommends at least
/// half a meter of height above the drone.
const LOWEST_SINE: f64 = 0.1;
/// Maximum sine of a slanted plane's lead, reached only outside the station's field of view.
const LARGEST_LEAD: f64 = 0.99;

/// Pose of a base station, prepared for computation.
#[derive(Clone, Debug)]
pub(crate) struct StationPose {
    pub generation: Generation,
    pub position_m: Vector3<f64>,
    pub(crate) world_from_station: Matrix3<f64>,
}

/// Crossing of a light plane with a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// Angle of the rotor in rad, which is 0 straight ahead.
    pub angle_rad: f64,
    /// Distance of the point from the rotor's axis in m.
    pub radius_m: f64,
    /// Gradient of the angle with respect to the point, in the world frame.
    pub(crate) gradient_rad_m: Vector3<f64>,
}

impl StationPose {
    /// Creates the pose of a station, with its rotation as a matrix.
    pub(crate) fn new(station: &Station) -> Self {
        let Station { yaw_rad, pitch_rad, roll_rad, .. } = *station;
        Self {
            generation: station.generation,
            position_m: station.position_m.into(),
            world_from_station: Attitude { yaw_rad, pitch_rad, roll_rad }.world_from_body(),
        }
    }

    /// Converts a point from the world frame to the station's frame.
    pub(crate) fn station_from_world(&self, point_m: &Vector3<f64>) -> Vector3<f64> {
        self.world_from_station.tr_mul(&(point_m - self.position_m))
    }

    /// True if a deck at `deck_m` that faces `up` sees this station's sweeps, which requires that
    /// the deck is within range and field of view, and that the station is above the deck. Walls
    /// are not modeled.
    pub(crate) fn sees(&self, deck_m: &Vector3<f64>, up: &Vector3<f64>) -> bool {
        let u = self.station_from_world(deck_m);
        let distance_m = u.norm();
        let [tan_half_width, tan_half_height] = match self.generation {
            Generation::V1 => TAN_HALF_VIEW_V1,
            Generation::V2 => TAN_HALF_VIEW_V2,
        };
        distance_m > 0.0
            && distance_m <= RANGE_M
            && u.y.abs() <= tan_half_width * u.x
            && u.z.abs() <= tan_half_height * (u.x * u.x + u.y * u.y).sqrt()
            && (self.position_m - deck_m).dot(up) >= LOWEST_SINE * distance_m
    }

    /// Returns the crossing of plane 0 or 1 with a point in the world frame. The angle is `α =
    /// atan2(y, x) + asin(z tan t / √(x² + y²))` with `t = ∓π/6` for the second generation, and
    /// `atan2(y, x)` and `atan2(z, x)` for the first. The gradient is in the world frame.
    pub(crate) fn crossing(&self, plane: usize, point_m: &Vector3<f64>) -> Crossing {
        let u = self.station_from_world(point_m);
        let crossing = match (self.generation, plane) {
            (Generation::V1, plane) => upright(&u, 1 + plane),
            (Generation::V2, 0) => slanted(&u, -TAN_TILT),
            (Generation::V2, _) => slanted(&u, TAN_TILT),
        };
        let gradient_rad_m = self.world_from_station * crossing.gradient_rad_m;
        Crossing { gradient_rad_m, ..crossing }
    }

    /// Returns the world-frame unit vector along which both planes intersect at these angles.
    pub(crate) fn ray(&self, angles_rad: [f64; 2]) -> Vector3<f64> {
        let direction = match self.generation {
            Generation::V1 => Vector3::new(1.0, libm::tan(angles_rad[0]), libm::tan(angles_rad[1])),
            // The mean of both angles is the azimuth, and half of their difference is the lead.
            Generation::V2 => {
                let azimuth = 0.5 * (angles_rad[0] + angles_rad[1]);
                let lead = libm::sin(0.5 * (angles_rad[1] - angles_rad[0]));
                let (sin, cos) = libm::sincos(azimuth);
                Vector3::new(cos, sin, lead / TAN_TILT)
            }
        };
        self.world_from_station * direction.normalize()
    }
}

/// Returns the crossing of a point with an upright sweep plane, in the station's frame. The angle
/// is `atan2(y, x)` for axis 1 and `atan2(z, x)` for axis 2. `u` is the point.
fn upright(u: &Vector3<f64>, axis: usize) -> Crossing {
    let (ahead, aside) = (u.x, u[axis]);
    let square = ahead * ahead + aside * aside;
    let mut gradient_rad_m = Vector3::zeros();
    (gradient_rad_m.x, gradient_rad_m[axis]) = (-aside / square, ahead / square);
    Crossing { angle_rad: libm::atan2(aside, ahead), radius_m: square.sqrt(), gradient_rad_m }
}

/// Returns the crossing of a point `u` with a slanted plane, in the station's frame. `tan_tilt` is
/// the tangent of the plane's tilt from the rotor's axis.
fn slanted(u: &Vector3<f64>, tan_tilt: f64) -> Crossing {
    // The gradient follows from d asin(s) = ds / √(1 − s²) with the sine s = z tan t / r, which is
    // inversely proportional to the radius r.
    let square = u.x * u.x + u.y * u.y;
    let radius = square.sqrt();
    let lead = (u.z * tan_tilt / radius).clamp(-LARGEST_LEAD, LARGEST_LEAD);
    let root = (1.0 - lead * lead).sqrt();
    let outward = lead / (square * root);
    Crossing {
        angle_rad: libm::atan2(u.y, u.x) + libm::asin(lead),
        radius_m: radius,
        gradient_rad_m: Vector3::new(
            -u.y / square - u.x * outward,
            u.x / square - u.y * outward,
            tan_tilt / (radius * root),
        ),
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const BOTH: [Generation; 2] = [Generation::V1, Generation::V2];

    fn looking(generation: Generation, from_m: [f64; 3], at_m: [f64; 3]) -> StationPose {
        StationPose::new(&Station::looking(generation, from_m, at_m))
    }

    fn station(generation: Generation) -> StationPose {
        let level = Station::looking(generation, [-2.0, -1.5, 2.2], [0.2, 0.1, 0.7]);
        StationPose::new(&Station { roll_rad: 0.1, ..level })
    }

    #[test]
    fn angles_are_those_of_geometry_by_hand() {
        let [v1, v2] = [Generation::V1, Generation::V2]
            .map(|generation| looking(generation, [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]));
        // A point 2 m ahead and 2 m to the left at the same height is at 45° for each plane.
        let point = Vector3::new(2.0, 2.0, 1.0);
        for plane in [0, 1] {
            let angle_rad = v2.crossing(plane, &point).angle_rad;
            assert!((angle_rad - PI / 4.0).abs() < 1e-15, "plane {plane}: {angle_rad}");
        }
        // At a point 1 m ahead and √3/2 m up, a 30° plane leads by asin(√3/2 / √3) = 30°.
        let above = Vector3::new(1.0, 0.0, 1.0 + 0.75_f64.sqrt());
        for (plane, want) in [(0, -PI / 6.0), (1, PI / 6.0)] {
            let angle_rad = v2.crossing(plane, &above).angle_rad;
            assert!((angle_rad - want).abs() < 1e-15, "plane {plane}: {angle_rad}");
        }
        // In the first generation, a point 1 m ahead, 1 m left and 1 m down is at 45° and −45°.
        let corner = Vector3::new(1.0, 1.0, 0.0);
        for (plane, want) in [(0, PI / 4.0), (1, -PI / 4.0)] {
            let angle_rad = v1.crossing(plane, &corner).angle_rad;
            assert!((angle_rad - want).abs() < 1e-15, "plane {plane}: {angle_rad}");
        }
    }

    #[test]
    fn a_crossed_point_lies_in_the_plane_of_light() {
        // The plane through the rotor's axis at angle α, tilted by t about its forward direction,
        // has the normal (−sin α, cos α, 0) cos t − z sin t … up to sign.
        let station = looking(Generation::V2, [0.0; 3], [1.0, 0.0, 0.0]);
        let point = Vector3::new(2.0, -0.7, -1.1);
        for (plane, tilt) in [(0, -PI / 6.0), (1, PI / 6.0)] {
            let angle = station.crossing(plane, &point).angle_rad;
            let (sin, cos) = libm::sincos(angle);
            let (sin_tilt, cos_tilt) = libm::sincos(tilt);
            let normal = Vector3::new(-sin * cos_tilt, cos * cos_tilt, sin_tilt);
            assert!(normal.dot(&point).abs() < 1e-15, "plane {plane}");
        }
    }

    #[test]
    fn the_gradient_is_the_derivative() {
        let point = Vector3::new(0.3, -0.2, 0.9);
        for (generation, plane) in BOTH.into_iter().flat_map(|g| [(g, 0), (g, 1)]) {
            let station = station(generation);
            let gradient = station.crossing(plane, &point).gradient_rad_m;
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = 1e-5;
                let [ahead, behind] =
                    [point + step, point - step].map(|p| station.crossing(plane, &p).angle_rad);
                let want = (ahead - behind) / 2e-5;
                assert!((gradient[axis] - want).abs() < 1e-9, "{generation:?} {plane} {axis}");
            }
        }
    }

    #[test]
    fn two_angles_point_back_at_the_point() {
        let point = Vector3::new(0.3, -0.2, 0.9);
        for generation in BOTH {
            let station = station(generation);
            let angles = [0, 1].map(|plane| station.crossing(plane, &point).angle_rad);
            let want = (point - station.position_m).normalize();
            assert!((station.ray(angles) - want).norm() < 1e-14, "{generation:?}");
        }
    }

    #[test]
    fn a_deck_sees_what_is_near_in_front_and_above_it() {
        let station = looking(Generation::V2, [0.0, 0.0, 2.0], [1.0, 0.0, 2.0]);
        let up = Vector3::z();
        let sees = |x: f64, y: f64, z: f64| station.sees(&Vector3::new(x, y, z), &up);
        assert!(sees(3.0, 0.0, 1.0), "in front");
        assert!(!sees(6.1, 0.0, 1.0), "too far");
        assert!(!sees(-3.0, 0.0, 1.0), "behind");
        assert!(sees(1.0, 3.7, 1.0) && !sees(1.0, 3.8, 1.0), "75° to the side");
        assert!(sees(1.0, 0.0, 0.6) && !sees(1.0, 0.0, 0.5), "55° down");
        assert!(!sees(3.0, 0.0, 2.0), "level with the deck");
        let tipped = Attitude { pitch_rad: 0.5, ..Default::default() }.world_from_body() * up;
        let point = Vector3::new(3.0, 0.0, 1.0);
        assert!(!station.sees(&point, &tipped), "the deck faces away");
        let v1 = looking(Generation::V1, [0.0, 0.0, 2.0], [1.0, 0.0, 2.0]);
        assert!(!v1.sees(&Vector3::new(1.0, 2.0, 1.0), &up), "beyond 60° of the first generation");
        assert!(station.sees(&Vector3::new(1.0, 2.0, 1.0), &up), "within 75° of the second");
    }
}
