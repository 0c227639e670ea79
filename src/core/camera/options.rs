//! Settings of the camera, and its pose in front of the word.

use nalgebra::{Matrix3, Vector3};

use super::{BodyModel, Camera, LensModel, WhiteBalance};
use crate::error::{Error, Result};
use crate::geometry::{camera_from_orientation, camera_from_world};
use crate::input_error;
use crate::settings::{Described, settings};

/// Maximum width and height of a picture in pixels.
const MAX_SIDE_PX: u32 = 16_384;

/// Maximum number of pixels in a picture. At 12 bytes per pixel, its film takes 768 MiB.
pub const MAX_PIXELS: u64 = 1 << 26;

/// Width of a full-frame sensor in m.
const FULL_FRAME_WIDTH_M: f64 = 0.036;

/// Minimum distance in m to a word at which the camera is focused on it by default.
const LEAST_FOCUS_M: f64 = 0.1;

/// Distance in m below which a target coincides with the camera.
const LEAST_DISTANCE_M: f64 = 1e-9;

/// Range of lengths that a unit quaternion may have after its components have been rounded.
const UNIT_LENGTH: std::ops::RangeInclusive<f64> = 0.95..=1.05;

settings! {
    /// Settings of the camera.
    ///
    /// The default is a full-frame camera with a 35 mm lens at f/8 and ISO 100, which is the usual
    /// starting point for light painting. The default blur is half the usual 30 µm circle of
    /// confusion.
    pub struct CameraOptions {
        /// Automatic exposure. The meter is off if `f_number` or `iso` is set without this key.
        metering: Metering = Metering::default();
        /// Width of the picture in pixels.
        width_px: u32 = 1920, in 1.0..=16_384.0;
        /// Height of the picture in pixels.
        height_px: u32 = 1080, in 1.0..=16_384.0;
        /// Print resolution in dots per inch, written into the picture's file if set.
        dots_per_inch: Option<f64> = None, in 1.0..=10_000.0;
        /// Aperture number, unless the meter sets it.
        f_number: f64 = 8.0, in 0.5..=256.0, unless "camera.metering" = "trail";
        /// Sensitivity. A pixel saturates at 78 / ISO lx s, or at 78 / `base_iso` lx s if ISO is
        /// below the base sensitivity.
        iso: f64 = 100.0, in 1.0..=1e7, unless "camera.metering" = "trail";
        /// Sensitivity at which a full well is rendered as white. At a higher sensitivity, the
        /// converter clips before the well is full.
        base_iso: f64 = 100.0, in 1.0..=1e5;
        /// Time of flight at which the shutter opens.
        shutter_open_s: f64 = 0.0, in 0.0..=1e6;
        /// Time of flight at which the shutter closes, or the end of the flight if left out.
        shutter_close_s: Option<f64> = None, in 0.0..=1e6;
        /// Distance at which the camera is focused. If left out, a named lens is focused at the
        /// middle of the word, and a custom lens renders everything sharp.
        focus_m: Option<f64> = None, in 0.01..=1e6;
        /// Standard deviation of the lens blur on the sensor, without diffraction. For a phone, the
        /// value is scaled from full frame to the phone's sensor.
        blur_m: f64 = 15e-6, in 0.0..=0.01;
        /// Fraction of the light that the lens transmits.
        transmission: f64 = 0.9, in 0.001..=1.0;
        /// Fraction of the light that vignetting removes at the corner of the picture, in addition
        /// to the natural cos⁴ falloff. If left out, the lens determines it from its aperture.
        vignetting: Option<f64> = None, in 0.0..=1.0;
        /// White balance, as gains of red, green and blue or as a color temperature in kelvin.
        white_balance: WhiteBalance = WhiteBalance::default();
        /// Position and direction of the camera.
        framing: Framing = Framing::default();
        /// Camera body. The body sets the sensor.
        body: BodyModel = BodyModel::default();
        /// Lens. The lens sets focal length, distortion and vignetting.
        lens: LensModel = LensModel::default();
    }

    /// Automatic exposure.
    pub enum Metering tagged {
        /// Off: the photographer sets `f_number` and `iso`.
        "off" => Off,
        /// A light meter with steps of a third of a stop. It makes the brightest lamp's trail white
        /// and glowing, and keeps the room dark regardless of the flight's duration.
        "trail" => Trail(TrailMetering),
    }

    /// Exposures that the light meter aims at, in stops over saturation.
    pub struct TrailMetering {
        /// Exposure at the middle of the brightest trail.
        trail_stops: f64 = 1.0, in -10.0..=10.0;
        /// Exposure at the middle of a colored lamp's trail, in its strongest color channel.
        ///
        /// The color error of an orange trail (CIEDE2000, at equal lightness) is 10 at saturation,
        /// 7 at half a stop below it, and 27 at two stops above it.
        color_stops: f64 = -0.5, in -10.0..=10.0;
        /// Maximum exposure from the room's light, which accumulates while the shutter is open. In
        /// a brighter room the trail is exposed less, down to `least_stops`.
        room_stops: f64 = -7.0, in -20.0..=0.0;
        /// Minimum exposure at the middle of the brightest trail.
        least_stops: f64 = -1.0, in -10.0..=10.0;
    }

    /// Position and direction of the camera.
    pub enum Framing tagged {
        /// Camera in front of the middle of the word, at the distance at which the word fills
        /// `fill_frac` of the picture.
        "word" => Word(WordFraming),
        /// Camera at a given position and orientation.
        "fixed" => Fixed(FixedPose),
    }

    /// A camera in front of the word.
    pub struct WordFraming {
        /// Fraction of the picture's width or height that the word fills, whichever is reached
        /// first.
        fill_frac: f64 = 0.5, in 0.01..=1.0;
        /// Height of the camera, which is aimed at the middle of the word. If left out, the camera
        /// is at the height of the word's middle. The LED ring and the color LED deck appear
        /// brighter from below, and are hidden by the drone from above.
        height_m: Option<f64> = None, in 0.0..=1000.0;
    }

    /// A camera at a given position and orientation.
    pub struct FixedPose {
        /// Position of the entrance pupil in the world frame.
        position_m: [f64; 3] = [0.15, -3.0, 0.75], in -1e4..=1e4;
        /// Point in the world frame that appears at the middle of the picture. If left out, the
        /// middle of the word appears there.
        target_m: Option<[f64; 3]> = None, in -1e4..=1e4;
        /// Orientation in the world frame, instead of a target, as a unit quaternion w, x, y, z. As
        /// in a .skyc file, a camera without rotation looks along -z with x to its right.
        orientation_wxyz: Option<[f64; 4]> = None, in -1.05..=1.05;
    }
}

impl CameraOptions {
    /// Checks that all settings are within their ranges and agree with each other.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        // Single settings are checked first, followed by combinations of settings.
        check_size(self.width_px, self.height_px)?;
        Described::check(self, "camera", None)?;
        let least = self.lens.figures().min_f_number;
        if self.body.fixed_lens().is_none() && self.f_number < least {
            let hint = "choose a larger f-number, or a faster lens";
            let wanted = format!("at least {least} with this lens");
            return Err(Error::input("camera.f_number", self.f_number, wanted, hint));
        }
        let open_s = self.shutter_open_s;
        if let Some(close_s) = self.shutter_close_s.filter(|close_s| *close_s < open_s) {
            let wanted = format!("a time not before camera.shutter_open_s, {open_s}");
            let hint = "set camera.shutter_close_s to a time after camera.shutter_open_s";
            return Err(Error::input("camera.shutter_close_s", close_s, wanted, hint));
        }
        if let Framing::Fixed(pose) = &self.framing {
            // The middle of the word is not known yet. A point beside the camera stands in for it,
            // so that only the pose's own settings can be refused.
            pose.camera_from_world(Vector3::from(pose.position_m) + Vector3::y())?;
        }
        Ok(())
    }

    /// Returns the fraction of the light, 0 to 1, that vignetting removes at the picture's corner
    /// at an aperture number.
    pub fn vignetting_at(&self, f_number: f64) -> f64 {
        let aspect = f64::from(self.height_px) / f64::from(self.width_px);
        let corner_m = 0.5 * self.body.figures().sensor_width_m * (1.0 + aspect * aspect).sqrt();
        self.vignetting.unwrap_or_else(|| self.lens.vignetting(f_number, corner_m))
    }

    /// Returns the focal length of the lens in m.
    pub fn focal_length_m(&self) -> f64 {
        self.body
            .fixed_lens()
            .map_or(self.lens.figures().focal_length_m, |lens| lens.focal_length_m)
    }

    /// Returns the distance in m at which a word within `[left, bottom, right, top]` fills a
    /// fraction of the picture's width or height. Returns an error for an empty word.
    fn distance_m(&self, [left, bottom, right, top]: [f64; 4], fill_frac: f64) -> Result<f64> {
        let aspect = f64::from(self.width_px) / f64::from(self.height_px);
        let width_m = (right - left).max((top - bottom) * aspect) / fill_frac;
        let distance_m = width_m * self.focal_length_m() / self.body.figures().sensor_width_m;
        if distance_m.is_finite() && distance_m > 0.0 {
            return Ok(distance_m);
        }
        let hint = "name a word, or set camera.framing to fixed";
        let wanted = "a word in front of which the camera can be placed";
        Err(Error::input("camera.framing", "nothing written", wanted, hint))
    }

    /// Returns the camera's position in m and the rotation from the world to the camera frame, for
    /// a word within `bounds_m` (left, bottom, right, top) whose center is `middle`. Returns the
    /// errors of the framing.
    fn pose(
        &self,
        bounds_m: [f64; 4],
        middle: Vector3<f64>,
    ) -> Result<(Vector3<f64>, Matrix3<f64>)> {
        match &self.framing {
            Framing::Word(framing) => {
                let distance_m = self.distance_m(bounds_m, framing.fill_frac)?;
                let mut position_m = middle - Vector3::y() * distance_m;
                position_m.z = framing.height_m.unwrap_or(middle.z);
                Ok((position_m, camera_from_world(middle - position_m)))
            }
            Framing::Fixed(pose) => Ok((pose.position_m.into(), pose.camera_from_world(middle)?)),
        }
    }

    /// Returns the camera for a word in the box `[left, bottom, right, top]` in m and a flight that
    /// ends at `end_s`, at which the shutter closes unless a time is set.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with the key that is out of range.
    pub fn camera(&self, bounds_m: [f64; 4], end_s: f64) -> Result<Camera> {
        self.check()?;
        let (body, lens) = (self.body.figures(), self.lens.figures());
        let [left, bottom, right, top] = bounds_m;
        let middle = Vector3::new(0.5 * (left + right), 0.0, 0.5 * (bottom + top));
        let (position_m, camera_from_world) = self.pose(bounds_m, middle)?;
        // A phone has a fixed lens with a single aperture, and its pictures have no distortion.
        let fixed = body.fixed_lens;
        let depth_m = (camera_from_world * (middle - position_m)).z;
        let is_focused = !matches!(self.lens, LensModel::Custom(_)) && depth_m > LEAST_FOCUS_M;
        Ok(Camera {
            position_m,
            camera_from_world,
            focal_length_m: self.focal_length_m(),
            sensor_width_m: body.sensor_width_m,
            focus_m: self.focus_m.or(is_focused.then_some(depth_m)),
            distortion: fixed.map_or(lens.distortion, |_| [0.0; 4]),
            vignetting: self.vignetting_at(self.f_number),
            white_balance: self.white_balance.gains(),
            f_number: fixed.map_or(self.f_number, |lens| lens.f_number),
            transmission: self.transmission,
            blur_m: self.blur_m * fixed.map_or(1.0, |_| body.sensor_width_m / FULL_FRAME_WIDTH_M),
            iso: self.iso,
            base_iso: fixed.map_or(self.base_iso, |lens| lens.iso[0]),
            shutter_open_s: self.shutter_open_s,
            shutter_close_s: self.shutter_close_s.unwrap_or(end_s).max(self.shutter_open_s),
            width_px: self.width_px,
            height_px: self.height_px,
        })
    }
}

impl FixedPose {
    /// Returns the rotation from the world to the camera frame. The camera has the orientation that
    /// is set, or otherwise points at the target, or otherwise at `middle`. Returns
    /// [`Error::Input`] if the target coincides with the camera, or if the quaternion's length is
    /// not 1.
    fn camera_from_world(&self, middle: Vector3<f64>) -> Result<Matrix3<f64>> {
        let Some(orientation) = self.orientation_wxyz else {
            let forward =
                self.target_m.map_or(middle, Vector3::from) - Vector3::from(self.position_m);
            if forward.norm() > LEAST_DISTANCE_M {
                return Ok(camera_from_world(forward));
            }
            let position_m = self.position_m;
            return Err(input_error!(
                "camera.framing.target_m",
                "{position_m:?}, the position of the camera",
                "a different point",
                "place the camera some meters in front of its target",
            ));
        };
        // The length of a rounded quaternion may differ slightly from 1.
        let length = orientation.iter().map(|value| value * value).sum::<f64>().sqrt();
        if UNIT_LENGTH.contains(&length) {
            return Ok(camera_from_orientation(orientation));
        }
        Err(input_error!(
            "camera.framing.orientation_wxyz",
            "a quaternion of length {length}",
            "a unit quaternion",
            "divide the quaternion by its length",
        ))
    }
}

/// Checks that each side of a picture is at least one pixel, and that it is not too large.
///
/// # Errors
///
/// Returns [`Error::Input`] with the limits for a picture that is too large or has no pixel.
pub fn check_size(width_px: u32, height_px: u32) -> Result<()> {
    let sides = [width_px, height_px];
    let pixels = u64::from(width_px) * u64::from(height_px);
    if sides.iter().all(|side| (1..=MAX_SIDE_PX).contains(side)) && pixels <= MAX_PIXELS {
        return Ok(());
    }
    Err(input_error!(
        "camera.width_px",
        "{width_px}x{height_px}",
        "sides of 1 to {MAX_SIDE_PX} pixels, and at most {MAX_PIXELS} pixels in total",
        "choose a size such as 1920x1080, or fewer dots per inch (a film takes 12 bytes per pixel)",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOOR_M: [f64; 4] = [-0.6, 0.5, 0.9, 1.0];

    #[test]
    fn the_word_fills_its_share_of_the_picture() {
        fn image(bounds_m: [f64; 4], x: f64, z: f64) -> [f64; 2] {
            let camera = CameraOptions::default().camera(bounds_m, 57.0).unwrap();
            let image = camera.image_from_world(Vector3::new(x, 0.0, z)).unwrap();
            [image.x_px, image.y_px].map(f64::round)
        }
        assert_eq!(image(NOOR_M, -0.6, 0.75), [480.0, 540.0], "left edge, middle of the height");
        assert_eq!(image(NOOR_M, 0.9, 0.75), [1440.0, 540.0], "right edge");
        assert_eq!(image([0.0, 0.0, 0.1, 1.0], 0.05, 1.0), [960.0, 270.0], "a tall word");
    }

    #[test]
    fn impossible_cameras_are_refused_by_key() {
        fn refused(change: &dyn Fn(&mut CameraOptions)) -> String {
            let mut options = CameraOptions::default();
            change(&mut options);
            options.camera(NOOR_M, 57.0).unwrap_err().to_string()
        }
        for size_px in [(0, 0), (0, 1080), (100_000, 100_000), (16_384, 16_384)] {
            let error = refused(&|c| (c.width_px, c.height_px) = size_px);
            assert!(error.contains(&format!("{}x{}", size_px.0, size_px.1)), "{error}");
        }
        let error = refused(&|c| (c.shutter_open_s, c.shutter_close_s) = (5.0, Some(3.0)));
        assert!(error.contains("camera.shutter_close_s"), "{error}");
        let error = refused(&|c| (c.lens, c.f_number) = (LensModel::Kit16, 2.0));
        assert!(error.contains("camera.f_number"), "{error}");
        let pose = FixedPose { target_m: Some([0.15, -3.0, 0.75]), ..FixedPose::default() };
        let error = refused(&|c| c.framing = Framing::Fixed(pose.clone()));
        assert!(error.contains("camera.framing.target_m"), "{error}");
    }

    #[test]
    fn a_low_camera_looks_up_at_the_middle_of_the_word() {
        let framing = Framing::Word(WordFraming { height_m: Some(0.1), ..Default::default() });
        let options = CameraOptions { framing, ..CameraOptions::default() };
        let camera = options.camera(NOOR_M, 57.0).unwrap();
        let image = camera.image_from_world(Vector3::new(0.15, 0.0, 0.75)).unwrap();
        let off_px = (image.x_px - 960.0).abs().max((image.y_px - 540.0).abs());
        assert!(off_px < 1e-9 && camera.position_m.z == 0.1, "{image:?}");
        let square = CameraOptions::default().camera(NOOR_M, 57.0).unwrap();
        assert_eq!(camera.position_m.xy(), square.position_m.xy());
    }

    #[test]
    fn a_quaternion_of_a_quarter_turn_about_x_looks_along_y() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let [turned, aimed] = [Some([half, half, 0.0, 0.0]), None].map(|orientation_wxyz| {
            let pose = FixedPose { orientation_wxyz, ..FixedPose::default() };
            let options =
                CameraOptions { framing: Framing::Fixed(pose), ..CameraOptions::default() };
            options.camera(NOOR_M, 1.0).unwrap().camera_from_world
        });
        assert!((turned - aimed).norm() < 1e-12, "{turned}");
    }

    #[test]
    fn a_camera_that_stands_aside_looks_at_the_middle_of_the_word() {
        let pose = FixedPose { position_m: [1.2, -3.5, 1.4], ..FixedPose::default() };
        let options = CameraOptions { framing: Framing::Fixed(pose), ..CameraOptions::default() };
        let camera = options.camera(NOOR_M, 57.0).unwrap();
        let image = camera.image_from_world(Vector3::new(0.15, 0.0, 0.75)).unwrap();
        let off_px = (image.x_px - 960.0).abs().max((image.y_px - 540.0).abs());
        assert!(off_px < 1e-9, "{image:?}");
        let inside = FixedPose { position_m: [0.0, 0.0, 0.75], ..FixedPose::default() };
        let options = CameraOptions { framing: Framing::Fixed(inside), ..options };
        let error = options.camera([-0.5, 0.5, 0.5, 1.0], 57.0).unwrap_err().to_string();
        assert!(error.contains("camera.framing.target_m"), "{error}");
    }

    #[test]
    fn lenses_darken_the_corner_as_measured() {
        // Returns the total light loss in stops at the corner of a full-frame sensor.
        fn lost(lens: LensModel, f_number: f64) -> f64 {
            let options = CameraOptions { lens, f_number, height_px: 1280, ..Default::default() };
            let camera = options.camera(NOOR_M, 1.0).unwrap();
            let ray = camera.world_from_image(0.0, 0.0).unwrap();
            let cos = (camera.camera_from_world * ray).z;
            -libm::log2(camera.unvignetted(0.0, 0.0) * cos * cos * cos * cos)
        }
        for (lens, f_number, wanted) in
            [(LensModel::Normal50, 1.8, 2.7), (LensModel::Normal35, 2.0, 2.2)]
        {
            let actual = lost(lens, f_number);
            assert!((actual - wanted).abs() < 0.05, "{actual} at f/{f_number}, wanted {wanted}");
        }
        assert!(lost(LensModel::Normal50, 3.5) < 1.0, "less than a stop from f/3.5 on");
        let natural = lost(LensModel::default(), 8.0);
        assert!((lost(LensModel::Normal35, 8.0) - natural).abs() < 0.06, "gone at f/8");
    }

    #[test]
    fn a_telephone_has_its_makers_angle_of_view_and_aperture() {
        fn camera_with(body: BodyModel) -> Camera {
            let options =
                CameraOptions { body, f_number: 5.0, height_px: 1440, ..Default::default() };
            options.camera(NOOR_M, 1.0).unwrap()
        }
        for (body, degrees, f_number) in [
            (BodyModel::IPhone15Pro, 84.0, 1.78),
            (BodyModel::Pixel8Pro, 82.0, 1.68),
            (BodyModel::GalaxyS24, 85.0, 1.8),
        ] {
            let camera = camera_with(body);
            // The picture's aspect ratio is 4:3, so its diagonal is 5/4 of its width.
            let actual = 2.0 * libm::atan(0.625 * camera.sensor_width_m / camera.focal_length_m);
            assert!((actual.to_degrees() - degrees).abs() < 0.7, "{:.1}°", actual.to_degrees());
            assert_eq!((camera.f_number, camera.base_iso), (f_number, 50.0));
        }
        let [phone, full] = [BodyModel::Phone, BodyModel::FullFrame24Mp].map(camera_with);
        let share = |camera: &Camera| camera.blur_m / camera.sensor_width_m;
        assert!((share(&phone) / share(&full) - 1.0).abs() < 1e-12, "as sharp for its sensor");
    }

    #[test]
    fn a_body_and_a_lens_by_name_set_sensor_and_focal_length() {
        let options = CameraOptions {
            body: BodyModel::A6400,
            lens: LensModel::Kit16,
            ..CameraOptions::default()
        };
        let camera = options.camera(NOOR_M, 1.0).unwrap();
        assert_eq!((camera.sensor_width_m, camera.focal_length_m), (0.0235, 0.016));
        assert_eq!(camera.distortion, [-0.026, 0.0, 0.0, 0.0]);
        // The word is 1.5 m wide and fills half of the picture's width.
        assert!((camera.focus_m.unwrap() - 3.0 * 0.016 / 0.0235).abs() < 1e-12, "at the word");
        assert_eq!(CameraOptions::default().camera(NOOR_M, 1.0).unwrap().focus_m, None);
    }
}
