//! How a film is developed: effects of lens and sensor, and the tone curve.

use super::tone::Tone;
use noctograph_core::camera::Camera;
use noctograph_core::settings::settings;

settings! {
    /// Lens and sensor effects, and the tone curve. Each effect has a value that turns it off.
    pub struct PhotoOptions {
        /// Tone curve from the light on the sensor to the levels of the picture.
        tone: Tone = Tone::Camera;
        /// Fraction of the light that the lens scatters into glare and halo. 0 turns both off.
        ///
        /// ISO 9358 measurements of usual lenses give 1 to 5 %.
        glare_frac: f64 = 0.045, in 0.0..=0.5;
        /// Exponent s of the scatter.
        ///
        /// Measured next to the clipped trail in the reference team's photograph, 0.24 to 1 mm from
        /// its edge on a full-frame sensor: values of 1.3 to 1.5 with 3.4 to 5.9 % scattered fit
        /// within 4 % of the level, 1.1 with any fraction within 14 %, and 2 within 22 %.
        glare_exponent: f64 = 1.4, in 1.01..=4.0, for "photo.glare_frac";
        /// Luminance of the room. 0 means a dark room.
        ambient_cd_m2: f64 = 0.02, in 0.0..=1e6;
        /// Position where half of the room's light enters, such as the gap of a door. In a room
        /// with walls, surfaces near this position and facing it are brighter. The room's light is
        /// even if this position is left out.
        ambient_from_m: Option<[f64; 3]> = None, in -1e3..=1e3;
        /// Photograph (PNG or JPEG) of the room without the flight, which replaces the room's
        /// light. The photograph is cropped to the photo's aspect ratio. A photograph taken at the
        /// same exposure keeps its brightness. In each channel, the photograph's brightness serves
        /// as the relative albedo of floor and walls (`expose.room_m`). Empty for none.
        background: String = String::new();
        /// Noise of the sensor.
        noise: Noise = Noise::default();
        fixed {
            /// Number of iris blades. An even number makes as many spikes at bright points, and an
            /// odd number twice as many. 0 turns the starburst off.
            aperture_blades: u32 = 7;
            /// Core radius r0 of the scatter `1 / (1 + (r/r0)²)^s` on the sensor.
            glare_radius_m: f64 = 40e-6;
            /// Color of the room's light in linear sRGB. The color's luminance is scaled to 1.
            ambient_rgb: [f64; 3] = [1.25, 0.95, 0.75];
            /// Exposure of the background in stops. At 0, white in the background saturates the
            /// sensor.
            background_stops: f64 = 0.0;
            /// Lets light of one color reach the photosites of the other colors, as through a
            /// camera's filters. Overexposed blue lamps then have cyan centers.
            crosstalk: bool = true;
        }
    }

    /// Noise of the sensor.
    pub enum Noise tagged {
        /// Photon shot noise, dark current, read noise, PRNU and hot pixels (EMVA 1288).
        "emva1288" => Emva1288(SensorNoise),
        /// No noise: every pixel reads its mean.
        "off" => Off,
    }

    /// Noise of a 24-megapixel full-frame sensor, per pixel, with the PRNU of JPEG XL's noise
    /// model.
    pub struct SensorNoise {
        /// Number of electrons that fill a pixel. Smaller numbers give more noise.
        full_well_e: f64 = 50_000.0, in 100.0..=1e9;
        /// Electrons of red, green and blue photosites in white light, relative to the largest of
        /// the three: quantum efficiency times filter transmission. White balance divides by these
        /// values.
        response: [f64; 3] = [0.55, 1.0, 0.7], in 0.01..=1.0;
        /// Standard deviation of a pixel's read noise.
        read_noise_e: f64 = 3.0, in 0.0..=1e4;
        /// Dark current of a pixel.
        dark_current_e_s: f64 = 0.1, in 0.0..=1e4;
        /// Photo response non-uniformity: the standard deviation of the pixels' gain.
        prnu_frac: f64 = 0.005, in 0.0..=0.2;
        /// Fraction of pixels with a hot photosite, which are white after demosaicing.
        ///
        /// Counted in eight public JPEGs of 10 to 98 s at base sensitivity (Canon EOS 80D and
        /// 1200D, Nikon D40, a compact camera): at most 4e-7, and none in four of them.
        hot_pixel_frac: f64 = 3e-7, in 0.0..=0.01;
    }
}

impl SensorNoise {
    /// Returns the noise of a picture in which each pixel is the sum of `n` independent photosites
    /// of this sensor. Enlarged pixels (n below 1) have the noise of a finer sensor. The results
    /// are limited to the ranges of their keys.
    #[must_use]
    pub fn resampled(&self, n: f64) -> Self {
        Self {
            full_well_e: (self.full_well_e * n).clamp(100.0, 1e9),
            read_noise_e: (self.read_noise_e * n.sqrt()).min(1e4),
            dark_current_e_s: (self.dark_current_e_s * n).min(1e4),
            prnu_frac: (self.prnu_frac / n.sqrt()).min(0.2),
            hot_pixel_frac: (self.hot_pixel_frac * n).min(0.01),
            ..self.clone()
        }
    }
}

impl PhotoOptions {
    /// Returns options without any effects, for measurements: the sensor clips at saturation, and
    /// the sRGB curve encodes the light.
    pub fn plain() -> Self {
        Self {
            tone: Tone::Linear,
            glare_frac: 0.0,
            aperture_blades: 0,
            ambient_cd_m2: 0.0,
            crosstalk: false,
            noise: Noise::Off,
            ..Self::default()
        }
    }

    /// Returns the light of the room in the middle of the picture, in stops relative to saturation,
    /// or `None` in a dark room or with a background.
    pub fn ambient_stops(&self, camera: &Camera) -> Option<f64> {
        let ambient_lx_s = self.ambient_cd_m2 * camera.lx_s_of_luminance();
        let is_lit = ambient_lx_s > 0.0 && self.background.is_empty();
        is_lit.then(|| libm::log2(ambient_lx_s / camera.saturation_lx_s()))
    }
}
