//! Camera bodies and lenses: by name, or by their figures.

use crate::settings::settings;

settings! {
    /// Camera body.
    ///
    /// Sensor sizes are the makers' (Sony ILCE-6400: 23.5 mm wide; Sony DSC-RX100M7, 1-inch type:
    /// 13.2 mm; Canon EOS 2000D: 22.3 mm; a phone's 1/1.56-inch type: 8.2 mm). Full wells are 2500 electrons per µm² of
    /// pixel, as usual for CMOS sensors of these years, and read noises 2 to 4 electrons:
    /// assumptions of the right size, not measurements of one camera.
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
        /// Main camera of a telephone.
        "phone" => Phone,
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

impl BodyModel {
    /// The body of a model name in EXIF.
    #[must_use]
    pub fn from_exif_model(model: &str) -> Option<Self> {
        match model.trim() {
            "ILCE-6400" => Some(Self::A6400),
            "Canon EOS 2000D" | "Canon EOS 1500D" | "Canon EOS REBEL T7" => {
                Some(Self::CanonEos2000D)
            }
            "DSC-RX100M7" => Some(Self::OneInch),
            _ => None,
        }
    }

    /// Width of the sensor.
    #[must_use]
    pub fn sensor_width_m(&self) -> f64 {
        match self {
            Self::Custom(body) => body.sensor_width_m,
            Self::FullFrame24Mp => 0.036,
            Self::A6400 => 0.0235,
            Self::CanonEos2000D => 0.0223,
            Self::OneInch => 0.0132,
            Self::Phone => 0.0082,
        }
    }

    /// Full well and read noise of a pixel at base ISO, in electrons, where they are known.
    #[must_use]
    pub fn full_well_and_read_noise_e(&self) -> Option<[f64; 2]> {
        match self {
            Self::Custom(_) => None,
            Self::FullFrame24Mp => Some([90_000.0, 4.0]),
            Self::A6400 => Some([38_000.0, 3.0]),
            Self::CanonEos2000D => Some([34_500.0, 3.0]),
            Self::OneInch => Some([14_500.0, 2.5]),
            Self::Phone => Some([10_000.0, 2.0]),
        }
    }
}

impl LensModel {
    /// Focal length.
    #[must_use]
    pub fn focal_length_m(&self) -> f64 {
        match self {
            Self::Custom(lens) => lens.focal_length_m,
            Self::Wide28 => 0.028,
            Self::Normal35 => 0.035,
            Self::Normal50 => 0.050,
            Self::Kit16 => 0.016,
        }
    }

    /// Aperture number of the widest aperture.
    #[must_use]
    pub fn min_f_number(&self) -> f64 {
        match self {
            Self::Custom(_) => 0.5,
            Self::Wide28 => 2.8,
            Self::Normal35 => 2.0,
            Self::Normal50 => 1.8,
            Self::Kit16 => 3.5,
        }
    }

    /// Distortion k1, k2, p1, p2 (see [`super::Camera::distortion`]).
    #[must_use]
    pub fn distortion(&self) -> [f64; 4] {
        match self {
            Self::Custom(lens) => lens.distortion,
            Self::Kit16 => [-0.026, 0.0, 0.0, 0.0],
            Self::Wide28 | Self::Normal35 | Self::Normal50 => [0.0; 4],
        }
    }
}
