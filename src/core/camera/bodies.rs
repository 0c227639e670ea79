//! Camera bodies and lenses, given by name or by their specifications.

use crate::settings::settings;

/// Distance in m from the optical axis to the corner of a full-frame sensor (36 mm by 24 mm).
const FULL_FRAME_CORNER_M: f64 = 0.021_63;

settings! {
    /// A camera body.
    ///
    /// Sensor widths are the makers' specifications: 23.5 mm for the Sony ILCE-6400, 13.2 mm for
    /// the Sony DSC-RX100M7 (1-inch type), 22.3 mm for the Canon EOS 2000D, 8.2 mm for a phone's
    /// 1/1.56-inch type, 9.8 mm for the Pixel 8 Pro, and 4032 pixels of 2.44 µm for the iPhone 15
    /// Pro. Full wells of 2500 electrons per µm² of pixel area, usual for CMOS sensors of that
    /// time, and read noises of 2 to 4 electrons are plausible assumptions, not measurements.
    ///
    /// A phone has the fixed lens of its main camera ([`FixedLens`]).
    pub enum BodyModel tagged {
        /// Any body, given by its sensor.
        "custom" => Custom(CustomBody),
        /// Any full-frame camera with 24 million pixels.
        "full-frame-24mp" => FullFrame24Mp,
        /// Sony α6400, APS-C.
        "a6400" => A6400,
        /// Canon EOS 2000D (1500D, Rebel T7), APS-C.
        "canon-eos-2000d" => CanonEos2000D,
        /// A compact camera with a 1-inch type sensor.
        "one-inch" => OneInch,
        /// Main camera of a typical phone, such as the Galaxy S24, with its lens.
        "phone" => Phone,
        /// Main camera of the iPhone 15 Pro, with its lens.
        "iphone-15-pro" => IPhone15Pro,
        /// Main camera of the Pixel 8 Pro, with its lens.
        "pixel-8-pro" => Pixel8Pro,
        /// Main camera of the Galaxy S24, with its lens.
        "galaxy-s24" => GalaxyS24,
    }

    /// A body, given by its sensor.
    pub struct CustomBody {
        /// Width of the sensor.
        sensor_width_m: f64 = 0.036, in 1e-4..=1.0;
    }

    /// A lens.
    pub enum LensModel tagged {
        /// Any lens, given by its specifications.
        "custom" => Custom(CustomLens),
        /// 28 mm, from f/2.8.
        "28mm" => Wide28,
        /// 35 mm, from f/2.
        "35mm" => Normal35,
        /// 50 mm, from f/1.8.
        "50mm" => Normal50,
        /// A kit zoom at its 16 mm end, from f/3.5, with the typical barrel distortion of -2 % at
        /// the corner of an APS-C sensor.
        "kit-16mm" => Kit16,
    }

    /// A lens, given by its specifications.
    pub struct CustomLens {
        /// Focal length.
        focal_length_m: f64 = 0.035, in 1e-4..=10.0;
        /// Distortion coefficients k1, k2, p1, p2 of the Brown–Conrady model.
        distortion: [f64; 4] = [0.0; 4], in -10.0..=10.0;
    }
}

/// Built-in lens with a fixed aperture, and the camera's limits of sensitivity and exposure time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedLens {
    /// Focal length in m.
    pub focal_length_m: f64,
    /// Aperture number.
    pub f_number: f64,
    /// Minimum and maximum ISO sensitivity.
    pub iso: [f64; 2],
    /// Maximum exposure time in s.
    pub longest_s: f64,
}

/// Specifications of a camera body.
#[derive(Debug)]
pub struct BodyFigures {
    /// Width of the sensor in m.
    pub sensor_width_m: f64,
    /// Default width of pictures in pixels.
    pub width_px: f64,
    /// Built-in lens, or `None` if the lens can be changed.
    pub fixed_lens: Option<FixedLens>,
    /// Model names that appear in EXIF metadata.
    exif: &'static [&'static str],
}

/// Specifications of a lens.
#[derive(Debug)]
pub struct LensFigures {
    /// Focal length in m.
    pub focal_length_m: f64,
    /// Aperture number of the widest aperture.
    pub min_f_number: f64,
    /// Distortion coefficients k1, k2, p1, p2, as in [`super::Camera::distortion`].
    pub distortion: [f64; 4],
    /// Light loss in stops at the corner of a full-frame sensor at the widest aperture, as in
    /// [`LensModel::vignetting`].
    wide_open_stops: f64,
}

/// Minimum and maximum ISO sensitivity of a phone. [`BodyModel::figures`] names the sources.
const PHONE_ISO: [f64; 2] = [50.0, 3200.0];

/// Camera bodies that are recognized by their EXIF model names.
const NAMED_IN_EXIF: [BodyModel; 3] =
    [BodyModel::A6400, BodyModel::CanonEos2000D, BodyModel::OneInch];

impl BodyModel {
    /// Returns the width of the body's sensor and picture, its fixed lens and its EXIF names. The
    /// focal length of a fixed lens matches the maker's diagonal angle of view on the 4:3 sensor.
    pub fn figures(&self) -> BodyFigures {
        fn body(sensor_width_m: f64, width_px: f64, exif: &'static [&'static str]) -> BodyFigures {
            BodyFigures { sensor_width_m, width_px, fixed_lens: None, exif }
        }
        /// Returns the figures of a phone, whose sensor has a 4:3 picture 4000 px wide.
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
            // The default picture of a custom body has as many pixels as that of a 24 MP camera.
            Self::Custom(custom) => body(custom.sensor_width_m, 6000.0, &[]),
            Self::FullFrame24Mp => body(0.036, 6000.0, &[]),
            Self::A6400 => body(0.0235, 6000.0, &["ILCE-6400"]),
            Self::CanonEos2000D => {
                let exif = &["Canon EOS 2000D", "Canon EOS 1500D", "Canon EOS REBEL T7"];
                body(0.0223, 6000.0, exif)
            }
            Self::OneInch => body(0.0132, 5472.0, &["DSC-RX100M7"]),
            // The lens is a 24 mm equivalent at f/1.78, and the night mode exposes for up to 30 s
            // on a tripod (ijunkie.com, "How to use Night mode on iPhone 11"). The ISO range is an
            // assumption, because the iPhone chooses the ISO sensitivity automatically.
            Self::IPhone15Pro => phone(0.0098, 0.0068, 1.78, 30.0),
            // The 82° angle of view and the aperture of f/1.68 are from dpreview.com, "Google Pixel
            // 8 and Pixel 8 Pro: Camera deep-dive". The maximum exposure time of 16 s is from
            // androidauthority.com/google-pixel-pro-camera-controls-3374272. The ISO range is
            // assumed to equal that of Samsung's phones.
            Self::Pixel8Pro => phone(0.0098, 0.007_06, 1.68, 16.0),
            // The 85° angle of view and the aperture of f/1.8 are from
            // androidauthority.com/samsung-galaxy-s24-cameras-3403863. Pro mode offers ISO 50 to
            // 3200 and exposure times of up to 30 s (r2.community.samsung.com, "Samsung's Pro Mode
            // explained").
            Self::Phone | Self::GalaxyS24 => phone(0.0082, 0.0056, 1.8, 30.0),
        }
    }

    /// Returns the built-in lens, or `None` if the lens can be changed.
    pub fn fixed_lens(&self) -> Option<FixedLens> {
        self.figures().fixed_lens
    }

    /// Returns the body with this EXIF model name, or `None` for any other name.
    pub fn from_exif_model(model: &str) -> Option<Self> {
        NAMED_IN_EXIF.into_iter().find(|body| body.figures().exif.contains(&model.trim()))
    }
}

impl LensModel {
    /// Returns the lens's focal length in m, its widest aperture number, its distortion
    /// coefficients, and its vignetting in stops at the corner of a full-frame sensor at that
    /// aperture.
    pub fn figures(&self) -> LensFigures {
        const NONE: [f64; 4] = [0.0; 4];
        // A custom lens may have any aperture and has no vignetting, unless the scene sets it.
        let (focal_length_m, min_f_number, wide_open_stops, distortion) = match self {
            Self::Custom(custom) => (custom.focal_length_m, 0.5, 0.0, custom.distortion),
            Self::Wide28 => (0.028, 2.8, 1.54, NONE),
            Self::Normal35 => (0.035, 2.0, 1.27, NONE),
            Self::Normal50 => (0.050, 1.8, 2.21, NONE),
            Self::Kit16 => (0.016, 3.5, 0.0, [-0.026, 0.0, 0.0, 0.0]),
        };
        LensFigures { focal_length_m, min_f_number, distortion, wide_open_stops }
    }

    /// Returns the fraction of the light that the edges of the lens block at a distance from the
    /// optical axis on the sensor, in addition to the natural cos⁴ falloff. The fraction increases
    /// with the square of this distance.
    ///
    /// The light losses at the corner of a full-frame sensor at the widest aperture come from lens
    /// tests, minus the natural falloff. The tests measured 2.7 stops in total for Canon's EF
    /// 50/1.8 II (`dpreview.com/lensreviews/canon_50_1p8_ii_c16/4`) and 2.2 for their EF 35/2
    /// (`photozone.de/canon_eos_ff/428-canon_35_2_5d`). They measured 1 stop at the corner of an
    /// APS-C sensor for Canon's EF 28/2.8 IS (`photozone.de/canon-eos/777-canon28f28apsc`). A zoom
    /// such as `kit-16mm` loses no more than the natural falloff (1.9 stops for Tokina's 16-50 at
    /// f/2.8, `lenstip.com/248.8`). When the lens is stopped down, the loss is inversely
    /// proportional to the 2.4th power of the aperture number. This law agrees to within 0.45 stops
    /// with the measured loss in excess of that at f/5.6 for Canon's EF 50/1.4, Nikon's 28/1.4 and
    /// Zeiss's Otus 28 (`lenstip.com/216.8`, `lenstip.com/504.8`, `optyczne.pl/398.8`).
    pub fn vignetting(&self, f_number: f64, off_axis_m: f64) -> f64 {
        let lens = self.figures();
        let stops = lens.wide_open_stops * libm::pow(lens.min_f_number / f_number, 2.4);
        let radius = off_axis_m / FULL_FRAME_CORNER_M;
        ((1.0 - libm::exp2(-stops)) * radius * radius).min(1.0)
    }
}
