//! The camera: a description without pixels. Pose, lens, shutter, sensitivity.
//!
//! Camera frame: x right, y down, z forward. Image: origin top left, pixel centres at +0.5.
//! Not modelled: distortion, vignetting beyond cos⁴, rolling shutter.

use nalgebra::{Matrix3, Vector3};

pub(crate) use framing::check_size;
pub use framing::{CameraOptions, Framing, MAX_PIXELS, MAX_SIDE_PX};

mod framing;

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

    /// Where a point of the world falls in the picture; `None` behind the entrance pupil or on it.
    #[must_use]
    pub fn image_from_world(&self, position_m: Vector3<f64>) -> Option<ImagePoint> {
        let p = self.camera_from_world * (position_m - self.position_m);
        if p.z <= 0.0 {
            return None;
        }
        let f = self.focal_length_px();
        Some(ImagePoint {
            x_px: f64::from(self.width_px) / 2.0 + f * p.x / p.z,
            y_px: f64::from(self.height_px) / 2.0 + f * p.y / p.z,
            depth_m: p.z,
        })
    }

    /// Luminous exposure in lx s at which the sensor saturates (ISO 12232, saturation based).
    #[must_use]
    pub fn saturation_lx_s(&self) -> f64 {
        78.0 / self.iso
    }
}
