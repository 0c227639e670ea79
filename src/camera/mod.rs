//! The camera: a description without pixels. Pose, lens, shutter, sensitivity.
//!
//! Camera frame: x right, y down, z forward. Image: origin top left, pixel centres at +0.5.
//! Not modelled: rolling shutter, field curvature, chromatic aberration.

use nalgebra::{Matrix3, Vector3};

pub use bodies::{Body, BodyName, Lens, LensName};
pub(crate) use framing::check_size;
pub use framing::{CameraOptions, Framing, MAX_PIXELS, MAX_SIDE_PX};
pub use outside::Outside;
pub use white_balance::WhiteBalance;

mod bodies;
mod exif;
mod framing;
mod outside;
mod white_balance;

/// A camera on a tripod, its shutter open once.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Entrance pupil, in the world.
    pub position_m: Vector3<f64>,
    /// Turns world vectors into camera vectors (x right, y down, z forward).
    pub camera_from_world: Matrix3<f64>,
    /// Focal length of the lens.
    pub focal_length_m: f64,
    /// Width of the sensor; its height follows from the picture's aspect, pixels are square.
    pub sensor_width_m: f64,
    /// Aperture number N.
    pub f_number: f64,
    /// Share of the light that the lens lets through, 0 to 1.
    pub transmission: f64,
    /// Standard deviation of the lens's blur on the sensor (aberrations and focus, without
    /// diffraction).
    pub blur_m: f64,
    /// Distance that is in focus, along the optical axis; `None` where everything is.
    pub focus_m: Option<f64>,
    /// Distortion k1, k2 (radial) and p1, p2 (tangential), of Brown and Conrady as `OpenCV` has it:
    /// with x, y the tangents off the axis and r² = x² + y², the lens draws
    /// `x (1 + k1 r² + k2 r⁴) + 2 p1 x y + p2 (r² + 2 x²)` and
    /// `y (1 + k1 r² + k2 r⁴) + p1 (r² + 2 y²) + 2 p2 x y`.
    pub distortion: [f64; 4],
    /// Share of the light that the barrel takes away at the corner of the picture; it grows with
    /// the square of the distance from the middle. The fall by cos⁴ comes on top by itself.
    pub vignetting: f64,
    /// Gains of red, green and blue after the sensor and before the tone curve: what the camera
    /// takes for white.
    pub white_balance: [f64; 3],
    /// Sensitivity: `H_sat` = 78 / ISO lx s (ISO 12232).
    pub iso: f64,
    /// When the shutter opens, in flight time.
    pub shutter_open_s: f64,
    /// When the shutter closes, in flight time.
    pub shutter_close_s: f64,
    /// Width of the picture.
    pub width_px: u32,
    /// Height of the picture.
    pub height_px: u32,
}

/// A point in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImagePoint {
    /// From the left edge.
    pub x_px: f64,
    /// From the top edge.
    pub y_px: f64,
    /// Along the optical axis.
    pub depth_m: f64,
}

impl Camera {
    /// Edge of a pixel on the sensor.
    #[must_use]
    pub fn pixel_pitch_m(&self) -> f64 {
        self.sensor_width_m / f64::from(self.width_px)
    }

    /// Focal length in pixels.
    #[must_use]
    pub fn focal_length_px(&self) -> f64 {
        self.focal_length_m / self.pixel_pitch_m()
    }

    /// Where a point of the world falls in the picture; `None` behind the entrance pupil or on it,
    /// and where the distortion folds back, so far outside the picture that the lens has no image.
    #[must_use]
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

    /// Direction in the world, of length 1, that falls on a place in the picture: the inverse of
    /// [`Self::image_from_world`], by fixed-point iteration to 1e-12; `None` where the distortion
    /// is so strong that no direction does.
    #[must_use]
    pub fn world_from_image(&self, x_px: f64, y_px: f64) -> Option<Vector3<f64>> {
        let f = self.focal_length_px();
        let wanted = [
            (x_px - f64::from(self.width_px) / 2.0) / f,
            (y_px - f64::from(self.height_px) / 2.0) / f,
        ];
        let mut at = wanted;
        for _ in 0..200 {
            let found = self.distorted(at)?;
            let off = [wanted[0] - found[0], wanted[1] - found[1]];
            at = [at[0] + off[0], at[1] + off[1]];
            if off[0].abs().max(off[1].abs()) < 1e-12 {
                let ray = Vector3::new(at[0], at[1], 1.0).normalize();
                return Some(self.camera_from_world.transpose() * ray);
            }
        }
        None
    }

    /// Tangents off the axis as the lens draws them; `None` beyond the radius where it folds back.
    fn distorted(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let [k1, k2, p1, p2] = self.distortion;
        if self.distortion == [0.0; 4] {
            return Some([x, y]);
        }
        let r2 = x * x + y * y;
        if 1.0 + r2 * (3.0 * k1 + r2 * 5.0 * k2) <= 0.0 {
            return None;
        }
        let radial = 1.0 + r2 * (k1 + r2 * k2);
        Some([
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ])
    }

    /// Share of the light that the barrel lets through to a place in the picture, 0 to 1.
    #[must_use]
    pub fn unvignetted(&self, x_px: f64, y_px: f64) -> f64 {
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        let (x, y) = (x_px - width / 2.0, y_px - height / 2.0);
        let corner_sq = 0.25 * (width * width + height * height);
        (1.0 - self.vignetting * (x * x + y * y) / corner_sq).max(0.0)
    }

    /// Diameter on the sensor of a point's image at a depth, by lack of focus:
    /// `f² / N · |d - d_f| / (d d_f)`.
    #[must_use]
    pub fn defocus_m(&self, depth_m: f64) -> f64 {
        let f = self.focal_length_m;
        self.focus_m.map_or(0.0, |focus_m| {
            f * f / self.f_number * (depth_m - focus_m).abs() / (depth_m * focus_m)
        })
    }

    /// Luminous exposure in lx s in the picture's middle of a surface of 1 cd/m², `π τ t / (4 N²)`.
    #[must_use]
    pub fn lx_s_of_luminance(&self) -> f64 {
        let exposure_s = self.shutter_close_s - self.shutter_open_s;
        std::f64::consts::FRAC_PI_4 * self.transmission * exposure_s
            / (self.f_number * self.f_number)
    }

    /// Luminous exposure in lx s at which the sensor saturates (ISO 12232, saturation based).
    #[must_use]
    pub fn saturation_lx_s(&self) -> f64 {
        78.0 / self.iso
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        CameraOptions::default().camera([-0.6, 0.5, 0.9, 1.0], 57.0).unwrap()
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
