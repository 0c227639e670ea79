//! Bodies and lenses by name: what a scene says instead of six numbers.

use serde::{Deserialize, Serialize};

/// A camera body: its sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Width of the sensor.
    pub sensor_width_m: f64,
    /// Pixels of the sensor along x and y; a picture may have fewer.
    pub pixels: [u32; 2],
    /// Electrons that a pixel of the sensor holds at base ISO.
    pub full_well_e: f64,
    /// Noise of reading a pixel at base ISO, in electrons.
    pub read_noise_e: f64,
}

/// Bodies by name.
///
/// Sensor sizes and pixels are the makers' (Sony ILCE-6400: 23.5 × 15.6 mm, 6000 × 4000; Sony
/// DSC-RX100M7 1-inch type: 13.2 × 8.8 mm, 5472 × 3648; a phone's 1/1.56-inch type: 8.2 mm wide,
/// 4096 pixels after binning). Full wells are 2500 electrons per µm² of pixel, as usual for CMOS
/// sensors of these years, and read noises 2 to 4 electrons: assumptions of the right size, not
/// measurements of one camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BodyName {
    /// Any full-frame camera of 24 million pixels.
    #[serde(rename = "full-frame-24mp")]
    FullFrame24Mp,
    /// Sony α6400, APS-C.
    A6400,
    /// A compact camera with a sensor of the 1-inch type.
    #[serde(rename = "one-inch")]
    OneInch,
    /// A telephone's main camera.
    Phone,
}

impl BodyName {
    /// The body that a photograph's EXIF calls `model`.
    #[must_use]
    pub fn of_model(model: &str) -> Option<Self> {
        match model.trim() {
            "ILCE-6400" => Some(Self::A6400),
            "DSC-RX100M7" => Some(Self::OneInch),
            _ => None,
        }
    }

    /// The body's figures.
    #[must_use]
    pub fn body(self) -> Body {
        let row = |sensor_width_m, pixels, full_well_e, read_noise_e| Body {
            sensor_width_m,
            pixels,
            full_well_e,
            read_noise_e,
        };
        match self {
            Self::FullFrame24Mp => row(0.036, [6000, 4000], 90_000.0, 4.0),
            Self::A6400 => row(0.0235, [6000, 4000], 38_000.0, 3.0),
            Self::OneInch => row(0.0132, [5472, 3648], 14_500.0, 2.5),
            Self::Phone => row(0.0082, [4096, 3072], 10_000.0, 2.0),
        }
    }
}

/// A lens by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum LensName {
    /// 28 mm, from f/2.8.
    #[serde(rename = "28mm")]
    Wide28,
    /// 35 mm, from f/2.
    #[serde(rename = "35mm")]
    Normal35,
    /// 50 mm, from f/1.8.
    #[serde(rename = "50mm")]
    Normal50,
    /// A kit zoom at its 16 mm end, from f/3.5, with the barrel distortion of its kind (-2 % at the
    /// corner of an APS-C sensor).
    #[serde(rename = "kit-16mm")]
    Kit16,
}

/// A lens: what of a camera it settles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal length.
    pub focal_length_m: f64,
    /// Widest aperture.
    pub min_f_number: f64,
    /// Radial distortion k1 (see [`super::Camera::distortion`]).
    pub k1: f64,
}

impl LensName {
    /// The lens's figures.
    #[must_use]
    pub fn lens(self) -> Lens {
        let row = |focal_length_m, min_f_number, k1| Lens { focal_length_m, min_f_number, k1 };
        match self {
            Self::Wide28 => row(0.028, 2.8, 0.0),
            Self::Normal35 => row(0.035, 2.0, 0.0),
            Self::Normal50 => row(0.050, 1.8, 0.0),
            Self::Kit16 => row(0.016, 3.5, -0.026),
        }
    }
}
