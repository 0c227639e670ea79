//! Camera bodies and lenses: by name, or by their figures.

use crate::settings::settings;

/// Distance of the corner of a full-frame sensor, 36 mm by 24 mm, from the axis.
const FULL_FRAME_CORNER_M: f64 = 0.021_63;

settings! {
    /// Camera body.
    ///
    /// Sensor sizes are the makers' (Sony ILCE-6400: 23.5 mm wide, Sony DSC-RX100M7, 1-inch type:
    /// 13.2 mm, Canon EOS 2000D: 22.3 mm, a phone's 1/1.56-inch type: 8.2 mm, the Pixel 8 Pro's:
    /// 9.8 mm, and the iPhone 15 Pro's, 4032 pixels of 2.44 µm). Full wells are 2500 electrons per
    /// µm² of pixel, as usual for CMOS sensors of these years, and read noises 2 to 4 electrons:
    /// assumptions of the right size, not measurements of one camera.
    ///
    /// Telephones have a fixed lens, the main camera's ([`FixedLens`]).
    pub enum BodyModel tagged {
        /// Any body, by its sensor.
        "custom" => Custom(CustomBody),
        /// Any full-frame camera of 24 million pixels.
        "full-frame-24mp" => FullFrame24Mp,
        /// Sony α6400, APS-C.
        "a6400" => A6400,
        /// Canon EOS 2000D (1500D, Rebel T7), APS-C.
        "canon-eos-2000d" => CanonEos2000D,
        /// A compact camera with a sensor of the 1-inch type.
        "one-inch" => OneInch,
        /// Main camera of a typical telephone, such as the Galaxy S24, with its lens.
        "phone" => Phone,
        /// Main camera of the iPhone 15 Pro, with its lens.
        "iphone-15-pro" => IPhone15Pro,
        /// Main camera of the Pixel 8 Pro, with its lens.
        "pixel-8-pro" => Pixel8Pro,
        /// Main camera of the Galaxy S24, with its lens.
        "galaxy-s24" => GalaxyS24,
    }

    /// A body, by its sensor.
    pub struct CustomBody {
        /// Width of the sensor.
        sensor_width_m: f64 = 0.036, in 1e-4..=1.0;
    }

    /// Lens.
    pub enum LensModel tagged {
        /// Any lens, by its figures.
        "custom" => Custom(CustomLens),
        /// 28 mm, from f/2.8.
        "28mm" => Wide28,
        /// 35 mm, from f/2.
        "35mm" => Normal35,
        /// 50 mm, from f/1.8.
        "50mm" => Normal50,
        /// A kit zoom at its 16 mm end, from f/3.5, with the barrel distortion of its kind (-2 % at
        /// the corner of an APS-C sensor).
        "kit-16mm" => Kit16,
    }

    /// A lens, by its figures.
    pub struct CustomLens {
        /// Focal length.
        focal_length_m: f64 = 0.035, in 1e-4..=10.0;
        /// Distortion k1, k2, p1, p2 of Brown and Conrady.
        distortion: [f64; 4] = [0.0; 4], in -10.0..=10.0;
    }
}

/// A fixed lens with a fixed aperture, and the limits of sensitivity and shutter time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedLens {
    /// Focal length.
    pub focal_length_m: f64,
    /// Aperture number.
    pub f_number: f64,
    /// Least and greatest sensitivity.
    pub iso: [f64; 2],
    /// Longest exposure.
    pub longest_s: f64,
}

/// Figures of a body.
#[derive(Debug)]
pub struct BodyFigures {
    /// Width of the sensor.
    pub sensor_width_m: f64,
    /// Pixels along its width, as its pictures have them by default.
    pub width_px: f64,
    /// The lens that comes with it, or `None` if it can be changed.
    pub fixed_lens: Option<FixedLens>,
    /// Its model's names in EXIF.
    exif: &'static [&'static str],
}

/// Figures of a lens.
#[derive(Debug)]
pub struct LensFigures {
    /// Focal length.
    pub focal_length_m: f64,
    /// Aperture number of the widest aperture.
    pub min_f_number: f64,
    /// Distortion k1, k2, p1, p2 (see [`super::Camera::distortion`]).
    pub distortion: [f64; 4],
    /// Stops of the falloff at the corner of full frame wide open: see [`LensModel::vignetting`].
    wide_open_stops: f64,
}

/// Least and greatest sensitivity of a telephone: see [`BodyModel::figures`].
const PHONE_ISO: [f64; 2] = [50.0, 3200.0];

/// Bodies that EXIF may name.
const NAMED_IN_EXIF: [BodyModel; 3] =
    [BodyModel::A6400, BodyModel::CanonEos2000D, BodyModel::OneInch];

impl BodyModel {
    /// The body's sensor, lens and EXIF names. The focal length of a fixed lens gives the maker's
    /// angle of view over the sensor's diagonal (4:3).
    pub fn figures(&self) -> BodyFigures {
        fn body(sensor_width_m: f64, width_px: f64, exif: &'static [&'static str]) -> BodyFigures {
            BodyFigures { sensor_width_m, width_px, fixed_lens: None, exif }
        }
        fn phone(
            sensor_width_m: f64,
            focal_length_m: f64,
            f_number: f64,
            longest_s: f64,
        ) -> BodyFigures {
            let fixed_lens =
                Some(FixedLens { focal_length_m, f_number, iso: PHONE_ISO, longest_s });
            BodyFigures { fixed_lens, ..body(sensor_width_m, 4000.0, &[]) }
        }
        match self {
            Self::Custom(custom) => body(custom.sensor_width_m, 6000.0, &[]),
            Self::FullFrame24Mp => body(0.036, 6000.0, &[]),
            Self::A6400 => body(0.0235, 6000.0, &["ILCE-6400"]),
            Self::CanonEos2000D => {
                let exif = &["Canon EOS 2000D", "Canon EOS 1500D", "Canon EOS REBEL T7"];
                body(0.0223, 6000.0, exif)
            }
            Self::OneInch => body(0.0132, 5472.0, &["DSC-RX100M7"]),
            // 24 mm equivalent, f/1.78, night mode up to 30 s on a tripod (ijunkie.com, "How to use
            // Night mode on iPhone 11"). Its camera sets ISO itself. The range is an assumption.
            Self::IPhone15Pro => phone(0.0098, 0.0068, 1.78, 30.0),
            // 82°, f/1.68 (dpreview.com, "Google Pixel 8 and Pixel 8 Pro: Camera deep-dive"), 16 s
            // (androidauthority.com/google-pixel-pro-camera-controls-3374272). ISO as Samsung's, an
            // assumption.
            Self::Pixel8Pro => phone(0.0098, 0.007_06, 1.68, 16.0),
            // 85°, f/1.8 (androidauthority.com/samsung-galaxy-s24-cameras-3403863). ISO 50 to 3200
            // and 30 s in Pro mode (r2.community.samsung.com, "Samsung's Pro Mode explained").
            Self::Phone | Self::GalaxyS24 => phone(0.0082, 0.0056, 1.8, 30.0),
        }
    }

    /// The lens that comes with the body, or `None` if it can be changed.
    pub fn fixed_lens(&self) -> Option<FixedLens> {
        self.figures().fixed_lens
    }

    /// The body with this model name in EXIF, or `None` for any other.
    pub fn from_exif_model(model: &str) -> Option<Self> {
        NAMED_IN_EXIF.into_iter().find(|body| body.figures().exif.contains(&model.trim()))
    }
}

impl LensModel {
    /// The lens's focal length, widest aperture, distortion and vignetting.
    pub fn figures(&self) -> LensFigures {
        const NONE: [f64; 4] = [0.0; 4];
        let (focal_length_m, min_f_number, wide_open_stops, distortion) = match self {
            Self::Custom(custom) => (custom.focal_length_m, 0.5, 0.0, custom.distortion),
            Self::Wide28 => (0.028, 2.8, 1.54, NONE),
            Self::Normal35 => (0.035, 2.0, 1.27, NONE),
            Self::Normal50 => (0.050, 1.8, 2.21, NONE),
            Self::Kit16 => (0.016, 3.5, 0.0, [-0.026, 0.0, 0.0, 0.0]),
        };
        LensFigures { focal_length_m, min_f_number, distortion, wide_open_stops }
    }

    /// Fraction of light that the edges of the lens keep from a point of the sensor, on top of the
    /// natural falloff by cos⁴. It grows with the square of the distance from the axis.
    ///
    /// The stops at the corner of full frame wide open are from tests, less the natural falloff:
    /// 2.7 in all for Canon's EF 50/1.8 II (`dpreview.com/lensreviews/canon_50_1p8_ii_c16/4`), 2.2
    /// for their EF 35/2 (`photozone.de/canon_eos_ff/428-canon_35_2_5d`). 1 at the corner of APS-C
    /// for their EF 28/2.8 IS (`photozone.de/canon-eos/777-canon28f28apsc`). A zoom such as
    /// `kit-16mm` loses no more than cos⁴ (1.9 stops for Tokina's 16-50 at f/2.8,
    /// `lenstip.com/248.8`). Stopped down, the stops beyond those at f/5.6 fall with the power 2.4
    /// of the aperture number, within 0.45 stops for Canon's EF 50/1.4, Nikon's 28/1.4 and Zeiss's
    /// Otus 28 from their widest aperture on (`lenstip.com/216.8`, `lenstip.com/504.8`,
    /// `optyczne.pl/398.8`).
    pub fn vignetting(&self, f_number: f64, off_axis_m: f64) -> f64 {
        let lens = self.figures();
        let stops = lens.wide_open_stops * libm::pow(lens.min_f_number / f_number, 2.4);
        let radius = off_axis_m / FULL_FRAME_CORNER_M;
        ((1.0 - libm::exp2(-stops)) * radius * radius).min(1.0)
    }
}
