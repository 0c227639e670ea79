//! Camera model, which describes pose, lens, shutter and sensitivity, but contains no pixel values.
//!
//! In the camera frame, x points right, y down and z forward. In the image, the origin is at the
//! top left, and pixel centers are at half-integer coordinates. Rolling shutter, field curvature
//! and chromatic aberration are not modeled.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::geometry::bounds;

pub use bodies::{
    BodyFigures, BodyModel, CustomBody, CustomLens, FixedLens, LensFigures, LensModel,
};
pub use options::{CameraOptions, FixedPose, Framing, MAX_PIXELS, Metering};
pub use options::{TrailMetering, WordFraming, check_size};
pub use white_balance::WhiteBalance;

mod bodies;
mod options;
mod outside;
mod white_balance;

/// Focus distance in m that represents infinity, the largest distance that a scene can set.
pub const INFINITY_M: f64 = 1e6;

/// Stationary camera whose shutter opens once.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Position of the entrance pupil in the world frame.
    pub position_m: Vector3<f64>,
    /// Rotation from the world to the camera frame (x right, y down, z forward).
    pub camera_from_world: Matrix3<f64>,
    /// Focal length of the lens in m.
    pub focal_length_m: f64,
    /// Width of the sensor in m. The pixels are square.
    pub sensor_width_m: f64,
    /// Aperture number N.
    pub f_number: f64,
    /// Fraction of the light that the lens transmits, 0 to 1.
    pub transmission: f64,
    /// Standard deviation in m of the lens blur on the sensor, from aberrations only.
    pub blur_m: f64,
    /// Focus distance in m along the optical axis, or `None` if everything is sharp.
    pub focus_m: Option<f64>,
    /// Distortion coefficients k1, k2 (radial) and p1, p2 (tangential) of the Brown–Conrady model
    /// as in `OpenCV`. If x and y are the tangents of the angles from the axis, and r² = x² + y²,
    /// the lens maps them to `x (1 + k1 r² + k2 r⁴) + 2 p1 x y + p2 (r² + 2 x²)` and
    /// `y (1 + k1 r² + k2 r⁴) + p1 (r² + 2 y²) + 2 p2 x y`.
    pub distortion: [f64; 4],
    /// Fraction of the light that vignetting removes at the corner of the picture, in addition to
    /// the natural cos⁴ falloff. It increases with the square of the distance from the center.
    pub vignetting: f64,
    /// White balance, as gains for red, green and blue that are applied before the tone curve.
    pub white_balance: [f64; 3],
    /// ISO sensitivity. [`Self::saturation_lx_s`] converts it to an exposure.
    pub iso: f64,
    /// Sensitivity at and below which a full well is rendered as white.
    pub base_iso: f64,
    /// Time of flight at which the shutter opens.
    pub shutter_open_s: f64,
    /// Time of flight at which the shutter closes.
    pub shutter_close_s: f64,
    /// Width of the picture.
    pub width_px: u32,
    /// Height of the picture.
    pub height_px: u32,
}

/// Point in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImagePoint {
    /// Distance from the left edge in px.
    pub x_px: f64,
    /// Distance from the top edge in px.
    pub y_px: f64,
    /// Distance from the camera along the optical axis in m.
    pub depth_m: f64,
}

/// Largest distance in m of a point in the word's plane that a corner of the picture shows.
const MAX_PLANE_M: f64 = 1000.0;
/// Maximum number of fixed-point iterations that invert the distortion.
const MAX_ITERATIONS: u32 = 200;
/// Largest error in the tangents of a ray's angles at which the iteration has converged.
const CONVERGED: f64 = 1e-12;
/// Exposure in lx s at which a sensor of ISO 1 saturates (saturation-based speed, ISO 12232).
const SATURATION_LX_S: f64 = 78.0;

impl Camera {
    /// Returns the same camera with another picture width. The height is scaled in proportion and
    /// rounded up.
    pub fn at_width(&self, width_px: u32) -> Self {
        let area_px = u64::from(self.height_px) * u64::from(width_px);
        let height_px = area_px.div_ceil(u64::from(self.width_px.max(1))).max(1);
        Self { width_px, height_px: u32::try_from(height_px).unwrap_or(u32::MAX), ..self.clone() }
    }

    /// Returns the side length in m of a pixel on the sensor.
    pub fn pixel_pitch_m(&self) -> f64 {
        self.sensor_width_m / f64::from(self.width_px)
    }

    /// Returns the focal length in pixels.
    pub fn focal_length_px(&self) -> f64 {
        self.focal_length_m / self.pixel_pitch_m()
    }

    /// Returns the image of a point in the world frame, or `None` if the point is behind the
    /// camera, or so far off the axis that the distorted image folds back on itself.
    pub fn image_from_world(&self, position_m: Vector3<f64>) -> Option<ImagePoint> {
        let p = self.camera_from_world * (position_m - self.position_m);
        if p.z <= 0.0 {
            return None;
        }
        let [x, y] = self.distorted([p.x / p.z, p.y / p.z])?;
        let f = self.focal_length_px();
        Some(ImagePoint {
            x_px: f64::from(self.width_px) / 2.0 + f * x,
            y_px: f64::from(self.height_px) / 2.0 + f * y,
            depth_m: p.z,
        })
    }

    /// Returns the unit vector in the world frame toward a point of the picture. Inverts
    /// [`Self::image_from_world`] by fixed-point iteration. Returns `None` if that does not
    /// converge within 200 iterations.
    pub fn world_from_image(&self, x_px: f64, y_px: f64) -> Option<Vector3<f64>> {
        let middle_px = Vector2::new(f64::from(self.width_px), f64::from(self.height_px)) / 2.0;
        let image = (Vector2::new(x_px, y_px) - middle_px) / self.focal_length_px();
        // tangents ← tangents + (image − distorted(tangents)) converges for weak distortion.
        let mut tangents = image;
        for _ in 0..MAX_ITERATIONS {
            let error = image - Vector2::from(self.distorted(tangents.into())?);
            tangents += error;
            if error.amax() < CONVERGED {
                return Some(self.camera_from_world.transpose() * tangents.push(1.0).normalize());
            }
        }
        None
    }

    /// Returns the tangents of a ray's angles to the optical axis after the distortion, or `None`
    /// if the image folds back there.
    fn distorted(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let [k1, k2, p1, p2] = self.distortion;
        if self.distortion == [0.0; 4] {
            return Some([x, y]);
        }
        // The image folds back beyond the radius r at which d(r (1 + k₁ r² + k₂ r⁴))/dr = 0.
        let r2 = x * x + y * y;
        if 1.0 + r2 * (3.0 * k1 + r2 * 5.0 * k2) <= 0.0 {
            return None;
        }
        // The radial and tangential terms are those of Conrady (1919) and Brown (1966).
        let radial = 1.0 + r2 * (k1 + r2 * k2);
        Some([
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ])
    }

    /// Returns the box `[left, bottom, right, top]` in m in the word's plane (y = 0) that contains
    /// the points seen at the picture's four corners. Returns `None` if a corner sees no point
    /// within 1 km.
    pub fn plane_bounds_m(&self) -> Option<[f64; 4]> {
        let [right, bottom] = [self.width_px, self.height_px].map(f64::from);
        let corners = [[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]];
        let on_plane = corners.into_iter().map(|[x_px, y_px]| {
            let ray = self.world_from_image(x_px, y_px)?;
            let distance_m = -self.position_m.y / ray.y;
            let point_m = self.position_m + ray * distance_m;
            (distance_m > 0.0 && distance_m < MAX_PLANE_M).then_some([point_m.x, point_m.z])
        });
        Some(bounds(on_plane.collect::<Option<Vec<_>>>()?))
    }

    /// Returns the fraction of the light, 0 to 1, that remains after vignetting at a point of the
    /// picture.
    pub fn unvignetted(&self, x_px: f64, y_px: f64) -> f64 {
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let (x, y) = (x_px - width / 2.0, y_px - height / 2.0);
        // Distances are relative to half of the picture's diagonal.
        let corner_sq = 0.25 * (width * width + height * height);
        (1.0 - self.vignetting * (x * x + y * y) / corner_sq).max(0.0)
    }

    /// Returns the diameter in m on the sensor of the circle of confusion of a point at the depth
    /// `d = depth_m`, `f²/N · |d - d_f| / (d d_f)` with the focus distance `d_f`. The diameter is 0
    /// if no focus distance is set.
    pub fn defocus_m(&self, depth_m: f64) -> f64 {
        let f = self.focal_length_m;
        self.focus_m.map_or(0.0, |focus_m| {
            f * f / self.f_number * (depth_m - focus_m).abs() / (depth_m * focus_m)
        })
    }

    /// Returns the exposure in lx s per cd/m² at the center of the picture, `π τ t / (4 N²)`.
    pub fn lx_s_of_luminance(&self) -> f64 {
        let exposure_s = self.shutter_close_s - self.shutter_open_s;
        std::f64::consts::FRAC_PI_4 * self.transmission * exposure_s
            / (self.f_number * self.f_number)
    }

    /// Returns the luminous exposure in lx s at which the sensor saturates. At or above the base
    /// sensitivity, the converter clips at `78 / ISO` (saturation-based speed, ISO 12232). Below
    /// the base sensitivity, the well is full at `78 / base ISO`.
    pub fn saturation_lx_s(&self) -> f64 {
        SATURATION_LX_S / self.iso.max(self.base_iso)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        CameraOptions::default().camera([-0.6, 0.5, 0.9, 1.0], 57.0).unwrap()
    }

    #[test]
    fn the_picture_of_a_camera_square_in_front_shows_its_bounds_of_the_plane() {
        let camera = camera();
        let bounds_m = camera.plane_bounds_m().unwrap();
        // The word is 1.5 m wide and fills half of the picture's width.
        for (actual, wanted) in bounds_m.into_iter().zip([-1.35, -0.09375, 1.65, 1.59375]) {
            assert!((actual - wanted).abs() < 1e-9, "{bounds_m:?}");
        }
        let up = crate::geometry::camera_from_world(Vector3::new(0.0, 0.1, 1.0));
        assert_eq!(Camera { camera_from_world: up, ..camera }.plane_bounds_m(), None);
    }

    #[test]
    fn the_inverse_of_a_distorting_lens_finds_the_point_again() {
        for distortion in [[0.0; 4], [-0.12, 0.03, 0.002, -0.001], [0.08, 0.0, 0.0, 0.003]] {
            let camera = Camera { distortion, ..camera() };
            for point in [[0.15, 0.0, 0.75], [-0.6, 0.2, 1.0], [1.4, -0.3, 0.0]] {
                let point = Vector3::from(point);
                let image = camera.image_from_world(point).unwrap();
                let ray = camera.world_from_image(image.x_px, image.y_px).unwrap();
                let wanted = (point - camera.position_m).normalize();
                assert!((ray - wanted).norm() < 1e-10, "{point:?} with {distortion:?}");
            }
        }
    }

    #[test]
    fn a_barrel_draws_the_corner_nearer_and_folds_nothing_back() {
        let straight = camera();
        let barrel = Camera { distortion: [-0.2, 0.0, 0.0, 0.0], ..camera() };
        let corner = Vector3::new(1.5, 0.0, 1.4);
        let far = |camera: &Camera| camera.image_from_world(corner).unwrap().x_px;
        assert!(far(&barrel) < far(&straight), "{} and {}", far(&barrel), far(&straight));
        let aside = camera().position_m + Vector3::new(50.0, 1.0, 0.0);
        assert_eq!(barrel.image_from_world(aside), None, "an angle that the lens does not draw");
    }

    #[test]
    fn ten_metres_in_focus_blur_three_by_36_um() {
        let camera = Camera { focus_m: Some(10.0), ..camera() };
        assert!((camera.defocus_m(3.0) - 35.7e-6).abs() < 0.1e-6, "{}", camera.defocus_m(3.0));
        assert_eq!(camera.defocus_m(10.0), 0.0, "sharp where it is focused");
    }
}
