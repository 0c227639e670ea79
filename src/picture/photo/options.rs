//! How a film is developed: effects of lens and sensor, and the tone curve.

use super::tone::Tone;
use noctograph_core::camera::Camera;
use noctograph_core::settings::settings;

settings! {
    /// Lens and sensor effects, and the tone curve. Every effect has a value that turns it off.
    pub struct PhotoOptions {
        /// Tone curve, from the light on the sensor to the levels of the picture.
        tone: Tone = Tone::Camera;
        /// Fraction of the light that the lens scatters into veiling glare and halo. 0 for none.
        ///
        /// ISO 9358 measures 1 to 5 % on usual lenses.
        glare_frac: f64 = 0.045, in 0.0..=0.5;
        /// Exponent s of the scatter.
        ///
        /// Measured beside the clipped trail of the reference team's photograph, 0.24 to 1 mm from
        /// its edge on a full-frame sensor: 1.3 to 1.5 with 3.4 to 5.9 % scattered fits within 4 %
        /// of the level, 1.1 with any fraction within 14 %, 2 within 22 %.
        glare_exponent: f64 = 1.4, in 1.01..=4.0, for "photo.glare_frac";
        /// Luminance of the room. 0: dark.
        ambient_cd_m2: f64 = 0.02, in 0.0..=1e6;
        /// Where half of the room's light falls in, such as the gap of a door: what is near it and
        /// faces it is brighter, in a room with walls. Even light if left out.
        ambient_from_m: Option<[f64; 3]> = None, in -1e3..=1e3;
        /// Photograph (PNG or JPEG) of the room without the flight, relative to the current folder,
        /// in place of the room's light. It covers the photo and is cut to its aspect. Taken at the
        /// same exposure, it is as bright as it will be. Its brightness, channel by channel, is the
        /// relative albedo of floor and walls (`expose.room_m`) for the lamps' light. Empty for
        /// none.
        background: String = String::new();
        /// Noise of the sensor.
        noise: Noise = Noise::default();
        fixed {
            /// Blades of the iris: an even number makes as many spikes at bright points, an odd
            /// number twice as many. 0 for no starburst.
            aperture_blades: u32 = 7;
            /// Core radius r0 of the scatter `1 / (1 + (r/r0)²)^s` on the sensor.
            glare_radius_m: f64 = 40e-6;
            /// Color of the light of the room, linear sRGB. Its luminance is scaled to 1.
            ambient_rgb: [f64; 3] = [1.25, 0.95, 0.75];
            /// Exposure of the background in stops. At 0 its white saturates the sensor.
            background_stops: f64 = 0.0;
            /// Light of a color reaches the photosites of the others, too, as it does through the
            /// filters of a camera: overexposed blue lamps have cyan centers.
            crosstalk: bool = true;
        }
    }

    /// Noise of the sensor.
    pub enum Noise tagged {
        /// Photon shot noise, dark current, read noise, PRNU and hot pixels (EMVA 1288).
        "emva1288" => Emva1288(SensorNoise),
        /// None: every pixel reads its mean.
        "off" => Off,
    }

    /// Noise of a full-frame sensor of 24 megapixels, viewed pixel by pixel, with PRNU as in the
    /// noise model of JPEG XL.
    pub struct SensorNoise {
        /// Electrons that fill a pixel. Fewer are noisier.
        full_well_e: f64 = 50_000.0, in 100.0..=1e9;
        /// Electrons of red, green and blue photosites in white light, relative to the largest:
        /// quantum efficiency times filter. White balance divides by it.
        response: [f64; 3] = [0.55, 1.0, 0.7], in 0.01..=1.0;
        /// Read noise of a pixel, σ.
        read_noise_e: f64 = 3.0, in 0.0..=1e4;
        /// Dark current of a pixel.
        dark_current_e_s: f64 = 0.1, in 0.0..=1e4;
        /// Photo response non-uniformity, σ of the gain of a pixel.
        prnu_frac: f64 = 0.005, in 0.0..=0.2;
        /// Fraction of pixels with a hot photosite, white after demosaicing.
        ///
        /// Counted in eight public JPEGs of 10 to 98 s at base sensitivity (Canon EOS 80D and
        /// 1200D, Nikon D40, a compact): at most 4e-7, none in four of them.
        hot_pixel_frac: f64 = 3e-7, in 0.0..=0.01;
    }
}

impl SensorNoise {
    /// The noise of a picture whose pixels each cover `n` pixels of this sensor, as sums of
    /// independent photosites. Enlarged pixels (n below 1) have the noise of a finer sensor.
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
    /// Every effect off, for measuring: the sensor clips at saturation, the sRGB curve encodes the
    /// rest.
    #[must_use]
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

    /// Light of the room in the middle of the picture, in stops relative to saturation. `None` in a
    /// dark room, and with a background.
    #[must_use]
    pub fn ambient_stops(&self, camera: &Camera) -> Option<f64> {
        let ambient_lx_s = self.ambient_cd_m2 * camera.lx_s_of_luminance();
        let is_lit = ambient_lx_s > 0.0 && self.background.is_empty();
        is_lit.then(|| libm::log2(ambient_lx_s / camera.saturation_lx_s()))
    }
}
