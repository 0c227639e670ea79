//! How a film is developed: what the lens and the sensor do to the light, and the tone curve.

use serde::{Deserialize, Serialize};

use super::tone::Tone;
use crate::camera::Camera;
use crate::error::{Result, within};

/// Settings of the photograph. Every effect has a value that switches it off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoOptions {
    /// From the sensor's light to the picture's levels.
    pub tone: Tone,
    /// Share of the light that the lens scatters: veiling glare and halo. 0: none. ISO 9358 measures
    /// 1 to 5 % on usual lenses; more drowns the dark in fog.
    pub glare_frac: f64,
    /// Core of the scatter `1 / (1 + (r/r0)²)^1.1`, r0 on the sensor. Less draws the halo tighter.
    pub glare_radius_m: f64,
    /// Blades of the iris: an even number makes as many spikes at bright points, an odd one twice as
    /// many. 0: no starburst.
    pub aperture_blades: u32,
    /// Luminance of the room. 0: dark.
    pub ambient_cd_m2: f64,
    /// Colour of that light, linear sRGB; its luminance is scaled to 1.
    pub ambient_rgb: [f64; 3],
    /// PNG picture behind the light, relative to the current folder; it covers the photo and is cut
    /// to its aspect. Empty: none.
    pub background: String,
    /// How much brighter than its file the background is; at 0 its white saturates the sensor.
    pub background_stops: f64,
    /// Share of a colour's light that the photosites of its neighbour in the spectrum see. 0: none.
    /// Real filters leak 8 to 15 %, which gives overexposed blue lamps cyan hearts and, over more,
    /// white ones.
    pub crosstalk_frac: f64,
    /// Whether the sensor is noisy.
    pub noise: Noise,
    /// Electrons that fill a pixel. Fewer are noisier.
    pub full_well_e: f64,
    /// Sensitivity at which the full well is white; above, the converter clips earlier.
    pub base_iso: f64,
    /// Electrons of red, green and blue photosites in white light, in shares of the largest: quantum
    /// efficiency times filter. White balance divides by it again.
    pub response: [f64; 3],
    /// Noise of reading a pixel, σ.
    pub read_noise_e: f64,
    /// Electrons that gather in a pixel without light.
    pub dark_current_e_s: f64,
    /// Photo response non-uniformity, σ of a pixel's gain.
    pub prnu_frac: f64,
    /// Share of photosites that are hot.
    pub hot_pixel_frac: f64,
    /// Mean dark current of a hot photosite; it is distributed exponentially.
    pub hot_pixel_e_s: f64,
}

/// Whether the sensor is noisy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Noise {
    /// Photon shot noise, dark current, read noise, PRNU and hot pixels (EMVA 1288).
    #[default]
    Emva1288,
    /// Every pixel reads its mean.
    Off,
}

impl Default for PhotoOptions {
    /// A lens of 4.5 % glare and 7 blades in a dark room, a full-frame sensor of 24 megapixels looked at
    /// pixel by pixel (full well, read noise), PRNU as in JPEG XL's noise model.
    fn default() -> Self {
        Self {
            tone: Tone::Camera,
            glare_frac: 0.045,
            glare_radius_m: 40e-6,
            aperture_blades: 7,
            ambient_cd_m2: 0.02,
            ambient_rgb: [1.25, 0.95, 0.75],
            background: String::new(),
            background_stops: 0.0,
            crosstalk_frac: 0.1,
            noise: Noise::Emva1288,
            full_well_e: 50_000.0,
            base_iso: 100.0,
            response: [0.55, 1.0, 0.7],
            read_noise_e: 3.0,
            dark_current_e_s: 0.1,
            prnu_frac: 0.005,
            hot_pixel_frac: 3e-5,
            hot_pixel_e_s: 100.0,
        }
    }
}

impl PhotoOptions {
    /// Every effect off: the sensor clips at saturation, the sRGB curve encodes what is below. For
    /// measuring.
    #[must_use]
    pub fn plain() -> Self {
        Self {
            tone: Tone::Linear,
            glare_frac: 0.0,
            aperture_blades: 0,
            ambient_cd_m2: 0.0,
            crosstalk_frac: 0.0,
            noise: Noise::Off,
            ..Self::default()
        }
    }

    /// Light of the room in the picture's middle, in stops over saturation; `None` in the dark.
    #[must_use]
    pub fn ambient_stops(&self, camera: &Camera) -> Option<f64> {
        let ambient_lx_s = self.ambient_cd_m2 * camera.lx_s_of_luminance();
        (ambient_lx_s > 0.0).then(|| libm::log2(ambient_lx_s / camera.saturation_lx_s()))
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`](crate::error::Error::Input) with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("photo.glare_frac", self.glare_frac, 0.0, 0.5)?;
        within("photo.glare_radius_m", self.glare_radius_m, 1e-7, 0.1)?;
        within("photo.aperture_blades", f64::from(self.aperture_blades), 0.0, 32.0)?;
        within("photo.ambient_cd_m2", self.ambient_cd_m2, 0.0, 1e6)?;
        for value in self.ambient_rgb {
            within("photo.ambient_rgb", value, 1e-3, 1e3)?;
        }
        within("photo.background_stops", self.background_stops, -20.0, 20.0)?;
        within("photo.crosstalk_frac", self.crosstalk_frac, 0.0, 0.3)?;
        within("photo.full_well_e", self.full_well_e, 100.0, 1e9)?;
        within("photo.base_iso", self.base_iso, 1.0, 1e5)?;
        for value in self.response {
            within("photo.response", value, 0.01, 1.0)?;
        }
        within("photo.read_noise_e", self.read_noise_e, 0.0, 1e4)?;
        within("photo.dark_current_e_s", self.dark_current_e_s, 0.0, 1e4)?;
        within("photo.prnu_frac", self.prnu_frac, 0.0, 0.2)?;
        within("photo.hot_pixel_frac", self.hot_pixel_frac, 0.0, 0.01)?;
        within("photo.hot_pixel_e_s", self.hot_pixel_e_s, 0.0, 1e6)
    }
}
