//! The camera of a scene: its settings, and where it must stand to frame the word.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::{BodyName, Camera, LensName, WhiteBalance};
use crate::error::{Error, Result, within};
use crate::geometry::{camera_from_orientation, camera_from_world};

/// Largest width and height of a picture.
pub const MAX_SIDE_PX: u32 = 16_384;

/// Most pixels of a picture: 768 MiB of film at 12 bytes a pixel.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Settings of the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CameraOptions {
    /// Who places the camera.
    pub framing: Framing,
    /// Share of the picture's width or height that the word fills, whichever is reached first,
    /// where the word frames.
    pub fill_frac: f64,
    /// Entrance pupil in the world, where the framing is fixed.
    pub position_m: [f64; 3],
    /// Point of the world in the middle of the picture, where the framing is fixed.
    pub target_m: [f64; 3],
    /// Attitude in the world as a quaternion w, x, y, z, where the framing is fixed; goes before
    /// the target. As in a `.skyc` file, the unturned camera looks along -z with x to its right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation_wxyz: Option<[f64; 4]>,
    /// A body by name; its sensor goes before `sensor_width_m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyName>,
    /// A lens by name; its focal length and distortion go before those below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<LensName>,
    /// Focal length.
    pub focal_length_m: f64,
    /// Width of the sensor.
    pub sensor_width_m: f64,
    /// Distance in focus; everything is where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focus_m: Option<f64>,
    /// k1, k2, p1, p2: see [`Camera::distortion`].
    pub distortion: [f64; 4],
    /// Share of the light that the barrel takes away at the corner.
    pub vignetting: f64,
    /// What the camera takes for white: gains, or the light's temperature.
    pub white_balance: WhiteBalance,
    /// Aperture number.
    pub f_number: f64,
    /// Share of light that the lens lets through.
    pub transmission: f64,
    /// Standard deviation of the lens's blur on the sensor, without diffraction.
    pub blur_m: f64,
    /// Sensitivity.
    pub iso: f64,
    /// When the shutter opens, in flight time.
    pub shutter_open_s: f64,
    /// When the shutter closes, in flight time; at the end of the flight where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shutter_close_s: Option<f64>,
    /// Width of the picture.
    pub width_px: u32,
    /// Height of the picture.
    pub height_px: u32,
}

/// Who places the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Framing {
    /// The word: the camera stands square in front of its middle, as far away as it must.
    #[default]
    Word,
    /// `position_m` and `target_m`.
    Fixed,
}

impl Default for CameraOptions {
    /// A full-frame camera with a 35 mm lens at f/8 and ISO 100, as photographers of light
    /// paintings begin; blur is half the usual circle of confusion of 30 µm.
    fn default() -> Self {
        Self {
            framing: Framing::Word,
            fill_frac: 0.5,
            position_m: [0.15, -3.0, 0.75],
            target_m: [0.15, 0.0, 0.75],
            orientation_wxyz: None,
            body: None,
            lens: None,
            focal_length_m: 0.035,
            sensor_width_m: 0.036,
            focus_m: None,
            distortion: [0.0; 4],
            vignetting: 0.0,
            white_balance: WhiteBalance::default(),
            f_number: 8.0,
            transmission: 0.9,
            blur_m: 15e-6,
            iso: 100.0,
            shutter_open_s: 0.0,
            shutter_close_s: None,
            width_px: 1920,
            height_px: 1080,
        }
    }
}

impl CameraOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        check_size(self.width_px, self.height_px)?;
        within("camera.fill_frac", self.fill_frac, 0.01, 1.0)?;
        for value in self.position_m.iter().chain(&self.target_m) {
            within("camera.position_m and camera.target_m", *value, -1e4, 1e4)?;
        }
        if let Some(orientation) = self.orientation_wxyz {
            let squares: f64 = orientation.iter().map(|value| value * value).sum();
            within("camera.orientation_wxyz (length squared)", squares, 0.9, 1.1)?;
        }
        for value in self.distortion {
            within("camera.distortion", value, -10.0, 10.0)?;
        }
        self.white_balance.check()?;
        within("camera.vignetting", self.vignetting, 0.0, 1.0)?;
        if let Some(focus_m) = self.focus_m {
            within("camera.focus_m", focus_m, 0.01, 1e6)?;
        }
        if let Some(lens) = self.lens {
            let key = "camera.f_number (of this camera.lens)";
            within(key, self.f_number, lens.lens().min_f_number, 256.0)?;
        }
        let aimed = self.orientation_wxyz.is_none();
        if self.framing == Framing::Fixed && aimed && self.position_m == self.target_m {
            let hint = "put the camera some metres in front of its target";
            let found = format!("{:?}, the camera's own place", self.target_m);
            return Err(Error::input("camera.target_m", found, "a point away from it", hint));
        }
        within("camera.focal_length_m", self.focal_length_m, 1e-4, 10.0)?;
        within("camera.sensor_width_m", self.sensor_width_m, 1e-4, 1.0)?;
        within("camera.f_number", self.f_number, 0.5, 256.0)?;
        within("camera.transmission", self.transmission, 0.001, 1.0)?;
        within("camera.blur_m", self.blur_m, 0.0, 0.01)?;
        within("camera.iso", self.iso, 1.0, 1e7)?;
        within("camera.shutter_open_s", self.shutter_open_s, 0.0, 1e6)?;
        if let Some(close_s) = self.shutter_close_s {
            within("camera.shutter_close_s", close_s, self.shutter_open_s, 1e6)?;
        }
        Ok(())
    }

    /// The camera that these settings make for a word within `bounds_m` (`[left, bottom, right,
    /// top]` in the plane of the word) and a flight that ends at `end_s`.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn camera(&self, bounds_m: [f64; 4], end_s: f64) -> Result<Camera> {
        self.check()?;
        let (position_m, target_m) = match self.framing {
            Framing::Word => self.in_front_of(bounds_m),
            Framing::Fixed => (self.position_m.into(), self.target_m.into()),
        };
        let camera_from_world = match (self.framing, self.orientation_wxyz) {
            (Framing::Fixed, Some(orientation)) => camera_from_orientation(orientation),
            _ => camera_from_world(target_m - position_m),
        };
        let mut distortion = self.distortion;
        if let Some(lens) = self.lens {
            distortion = [lens.lens().k1, 0.0, 0.0, 0.0];
        }
        Ok(Camera {
            position_m,
            camera_from_world,
            focal_length_m: self.focal_length_m(),
            sensor_width_m: self.sensor_width_m(),
            focus_m: self.focus_m,
            distortion,
            vignetting: self.vignetting,
            white_balance: self.white_balance.gains(),
            f_number: self.f_number,
            transmission: self.transmission,
            blur_m: self.blur_m,
            iso: self.iso,
            shutter_open_s: self.shutter_open_s,
            shutter_close_s: self.shutter_close_s.unwrap_or(end_s).max(self.shutter_open_s),
            width_px: self.width_px,
            height_px: self.height_px,
        })
    }

    /// Takes place, attitude and focal length from a camera of a `.skyc` file.
    #[must_use]
    pub fn at_pose(
        self,
        position_m: [f64; 3],
        orientation_wxyz: [f64; 4],
        focal_length_mm: f64,
    ) -> Self {
        Self {
            framing: Framing::Fixed,
            position_m,
            orientation_wxyz: Some(orientation_wxyz),
            focal_length_m: focal_length_mm / 1000.0,
            lens: None,
            ..self
        }
    }

    fn focal_length_m(&self) -> f64 {
        self.lens.map_or(self.focal_length_m, |lens| lens.lens().focal_length_m)
    }

    fn sensor_width_m(&self) -> f64 {
        self.body.map_or(self.sensor_width_m, |body| body.body().sensor_width_m)
    }

    /// Place and target of a camera square in front of a word, which fills `fill_frac`.
    fn in_front_of(&self, [left, bottom, right, top]: [f64; 4]) -> (Vector3<f64>, Vector3<f64>) {
        let aspect = f64::from(self.width_px) / f64::from(self.height_px);
        let width_m = (right - left).max((top - bottom) * aspect) / self.fill_frac;
        let distance_m = width_m * self.focal_length_m() / self.sensor_width_m();
        let middle = Vector3::new(0.5 * (left + right), 0.0, 0.5 * (bottom + top));
        (middle - Vector3::y() * distance_m, middle)
    }
}

/// Checks the size of a picture.
///
/// # Errors
///
/// [`Error::Input`] saying what is possible.
pub(crate) fn check_size(width_px: u32, height_px: u32) -> Result<()> {
    let sides = [width_px, height_px];
    let pixels = u64::from(width_px) * u64::from(height_px);
    if sides.iter().all(|side| (1..=MAX_SIDE_PX).contains(side)) && pixels <= MAX_PIXELS {
        return Ok(());
    }
    Err(Error::input(
        "camera.width_px and camera.height_px",
        format!("{width_px}x{height_px}"),
        format!("sides from 1 to {MAX_SIDE_PX} and at most {MAX_PIXELS} pixels"),
        "choose a size such as --size 1920x1080; a film takes 12 bytes a pixel",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOOR_M: [f64; 4] = [-0.6, 0.5, 0.9, 1.0];

    #[test]
    fn the_word_fills_its_share_of_the_picture() {
        let camera = CameraOptions::default().camera(NOOR_M, 57.0).unwrap();
        let left = camera.image_from_world(Vector3::new(-0.6, 0.0, 0.75)).unwrap();
        let right = camera.image_from_world(Vector3::new(0.9, 0.0, 0.75)).unwrap();
        assert!((left.x_px - 480.0).abs() < 1e-9 && (right.x_px - 1440.0).abs() < 1e-9);
        assert!((left.y_px - 540.0).abs() < 1e-9, "the middle of the word is in the middle");
        let tall = [0.0, 0.0, 0.1, 1.0];
        let camera = CameraOptions::default().camera(tall, 57.0).unwrap();
        let top = camera.image_from_world(Vector3::new(0.05, 0.0, 1.0)).unwrap();
        assert!((top.y_px - 270.0).abs() < 1e-9, "a tall word fills its share of the height");
    }

    #[test]
    fn sizes_that_cannot_be_are_refused() {
        for (width_px, height_px) in [(0, 0), (0, 1080), (100_000, 100_000), (16_384, 16_384)] {
            let options = CameraOptions { width_px, height_px, ..CameraOptions::default() };
            let error = options.camera(NOOR_M, 57.0).unwrap_err();
            assert!(error.to_string().contains(&format!("{width_px}x{height_px}")), "{error}");
        }
    }

    #[test]
    fn a_shutter_that_closes_before_it_opens_is_refused() {
        let options = CameraOptions {
            shutter_open_s: 5.0,
            shutter_close_s: Some(3.0),
            ..CameraOptions::default()
        };
        let error = options.check().unwrap_err().to_string();
        assert!(error.contains("camera.shutter_close_s"), "{error}");
    }

    #[test]
    fn a_camera_of_a_skyc_file_looks_where_its_quaternion_says() {
        // A quarter turn about x raises the view from down (-z) to along y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let posed =
            CameraOptions::default().at_pose([0.15, -3.0, 0.75], [half, half, 0.0, 0.0], 35.0);
        let aimed = CameraOptions { framing: Framing::Fixed, ..CameraOptions::default() };
        let [posed, aimed] = [posed, aimed].map(|options| options.camera(NOOR_M, 1.0).unwrap());
        let off = (posed.camera_from_world - aimed.camera_from_world).norm();
        assert!(off < 1e-12, "{}", posed.camera_from_world);
        assert_eq!(posed.focal_length_m, aimed.focal_length_m);
    }

    #[test]
    fn bodies_and_lenses_go_before_the_numbers() {
        let options = CameraOptions {
            body: Some(BodyName::A6400),
            lens: Some(LensName::Kit16),
            ..CameraOptions::default()
        };
        let camera = options.camera(NOOR_M, 1.0).unwrap();
        assert_eq!((camera.sensor_width_m, camera.focal_length_m), (0.0235, 0.016));
        let wide_open = CameraOptions { f_number: 2.0, ..options };
        assert!(wide_open.check().unwrap_err().to_string().contains("camera.f_number"));
    }
}
