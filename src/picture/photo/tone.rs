//! Tone curves from the light on the sensor to the levels of the picture.

use std::sync::OnceLock;

use noctograph_core::settings::settings;
use noctograph_core::srgb;

settings! {
    /// Tone curve from light on the sensor to levels of the picture. A light of 1 saturates the
    /// sensor.
    pub enum Tone {
        /// An S-curve of the logarithm of light in each channel, as cameras use for JPEGs.
        ///
        /// Middle gray, 10/78 of saturation (ISO 12232), becomes level 118. The contrast there is
        /// 0.2 per stop, 1.4 times that of sRGB. Saturation becomes white over a soft shoulder, and
        /// 11 stops below it is black.
        "camera" => Camera,
        /// Khronos PBR Neutral with the sRGB curve, which keeps hues, for verification.
        "neutral" => Neutral,
        /// The sRGB curve (IEC 61966-2-1) and nothing else, for measurement.
        "linear" => Linear,
    }
}

/// Middle gray relative to saturation. ISO 12232 defines them as 10/S and 78/S lx s, respectively.
const GRAY: f64 = 10.0 / 78.0;

/// Encoded value of middle gray, which is level 118.
const GRAY_LEVEL: f64 = 118.0 / 255.0;

/// Change of the encoded value per stop at middle gray.
const CONTRAST: f64 = 0.2;

/// Difference between middle gray and black, in stops.
const BLACK_STOPS: f64 = 8.0;

/// Sharpness of the bends to white and to black, where 1 is the softest.
const SHOULDER: f64 = 2.0;
const TOE: f64 = 1.5;

/// Minimum light of the camera's curve, at which it is black. The limit keeps the logarithm finite.
const MIN_LIGHT: f64 = 1e-9;

impl Tone {
    /// Applies the part of the tone curve that combines the three channels of a pixel.
    pub(super) fn mixed(self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Neutral => neutral(rgb),
            Self::Camera | Self::Linear => rgb,
        }
    }

    /// Applies [`mixed`](Self::mixed) to all pixels of a row.
    pub(super) fn mix(self, [red, green, blue]: &mut [Vec<f32>; 3]) {
        if self == Self::Neutral {
            for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
                [*r, *g, *b] = neutral([*r, *g, *b]);
            }
        }
    }

    /// Returns the encoded value, 0 to 1, of a channel's light, 0 to 1.
    pub fn encode(self, light: f64) -> f64 {
        match self {
            Self::Camera => camera(light),
            Self::Neutral | Self::Linear => srgb::encoded_from_linear(light),
        }
    }

    /// Returns the light of an encoded value, both 0 to 1. This is the inverse of
    /// [`encode`](Self::encode), and 0 at 0.
    pub(super) fn decode(self, encoded: f64) -> f64 {
        match self {
            Self::Camera if encoded > 0.0 => {
                // Bisects until the last bit is determined.
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..f64::MANTISSA_DIGITS {
                    let middle = 0.5 * (low + high);
                    if camera(middle) < encoded { low = middle } else { high = middle }
                }
                high
            }
            Self::Camera => 0.0,
            Self::Neutral | Self::Linear => srgb::linear_from_encoded(encoded),
        }
    }
}

/// Returns the encoded value of light by the curve of [`Tone::Camera`].
fn camera(light: f64) -> f64 {
    // The curve is g + s u / (1 + |s u / l|^b)^(1/b), with u in stops from middle gray. The limit l
    // makes the curve reach white at saturation, and black at BLACK_STOPS below middle gray.
    let stops = libm::log2(light.max(MIN_LIGHT) / GRAY);
    let (end_stops, end_level, bend) = if stops > 0.0 {
        (-libm::log2(GRAY), 1.0 - GRAY_LEVEL, SHOULDER)
    } else {
        (BLACK_STOPS, GRAY_LEVEL, TOE)
    };
    let rise = CONTRAST * stops.abs();
    let straight_end = CONTRAST * end_stops;
    let limit =
        straight_end / libm::pow(libm::pow(straight_end / end_level, bend) - 1.0, 1.0 / bend);
    let bent = rise / libm::pow(1.0 + libm::pow(rise / limit, bend), 1.0 / bend);
    (GRAY_LEVEL + if stops > 0.0 { bent } else { -bent }).clamp(0.0, 1.0)
}

/// Applies the Khronos PBR Neutral tone mapper, with the constants of its specification.
fn neutral(rgb: [f32; 3]) -> [f32; 3] {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let darkest = rgb[0].min(rgb[1]).min(rgb[2]);
    let offset = if darkest < 0.08 { darkest - 6.25 * darkest * darkest } else { 0.04 };
    let rgb = rgb.map(|value| value - offset);
    let peak = rgb[0].max(rgb[1]).max(rgb[2]);
    if peak < START {
        return rgb;
    }
    let d = 1.0 - START;
    let new_peak = 1.0 - d * d / (peak + d - START);
    let keep = 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    rgb.map(|value| value * (new_peak / peak) * keep + new_peak * (1.0 - keep))
}

/// Light at which the tables start, 2^-14, which is black in every tone.
const DARK: f32 = 1.0 / 16384.0;

/// Tables of a tone curve for 8 bits.
#[derive(Debug)]
pub(super) struct Levels8 {
    /// Minimum light of each of the levels 1 to 255, followed by infinity.
    least: [f32; 256],
    /// Level at the start of each 1024th of an octave.
    start: Vec<u8>,
}

/// Number of low bits of a float that one entry of [`Levels8`] spans.
const BIN_BITS: u32 = 13;

impl Levels8 {
    /// Returns the tables of a tone, which are computed at the first call.
    pub(super) fn cached(tone: Tone) -> &'static Self {
        static MADE: [OnceLock<Levels8>; 3] = [const { OnceLock::new() }; 3];
        MADE[tone as usize].get_or_init(|| Self::new(tone))
    }

    /// Computes the tables of a tone.
    fn new(tone: Tone) -> Self {
        // Finds the minimum light that rounds to each level, by bisection over the bits of a float.
        let mut least = [f32::INFINITY; 256];
        let mut low = DARK.to_bits();
        for (level, least) in least.iter_mut().enumerate().take(255) {
            let wanted = (level as f64 + 0.5) / 255.0;
            let mut high = 1.0_f32.to_bits();
            while low < high {
                let middle = low + (high - low) / 2;
                if tone.encode(f64::from(f32::from_bits(middle))) < wanted {
                    low = middle + 1;
                } else {
                    high = middle;
                }
            }
            *least = f32::from_bits(low);
        }
        // A bin spans at most one step between levels, so a single comparison determines the level.
        let bins = ((1.0_f32.to_bits() - DARK.to_bits()) >> BIN_BITS) + 1;
        let mut level = 0;
        let start = (0..bins).map(|bin| {
            let light = f32::from_bits(DARK.to_bits() + (bin << BIN_BITS));
            while least[usize::from(level)] <= light {
                level += 1;
            }
            level
        });
        Self { start: start.collect(), least }
    }

    /// Writes the nearest levels of a row of pixels, after clamping the light in `channels` to the
    /// range of the levels.
    pub(super) fn write_row(&self, channels: &mut [Vec<f32>; 3], out: &mut [u8]) {
        noctograph_core::dispatch!(|| {
            channels.iter_mut().flatten().for_each(|light| *light = light.clamp(DARK, 1.0));
        });
        let [red, green, blue] = &*channels;
        let pixels = out.as_chunks_mut::<3>().0.iter_mut();
        for ([r_out, g_out, b_out], ((r, g), b)) in pixels.zip(red.iter().zip(green).zip(blue)) {
            (*r_out, *g_out, *b_out) = (self.level(*r), self.level(*g), self.level(*b));
        }
    }

    /// Returns the level nearest to light from [`DARK`] to 1.
    #[inline(always)]
    fn level(&self, light: f32) -> u8 {
        let start = self.start[((light.to_bits() - DARK.to_bits()) >> BIN_BITS) as usize];
        start + u8::from(light >= self.least[usize::from(start)])
    }
}

/// Table of a tone curve for 16 bits, interpolated linearly between 256 points per octave.
#[derive(Debug)]
pub(super) struct Levels16 {
    nodes: Vec<f64>,
}

/// Number of low bits of a float between two nodes of [`Levels16`].
const NODE_BITS: u32 = 15;

impl Levels16 {
    /// Computes the table of a tone.
    pub(super) fn new(tone: Tone) -> Self {
        let nodes = ((1.0_f32.to_bits() - DARK.to_bits()) >> NODE_BITS) + 2;
        let lights = (0..nodes).map(|node| f32::from_bits(DARK.to_bits() + (node << NODE_BITS)));
        Self { nodes: lights.map(|light| tone.encode(f64::from(light).min(1.0))).collect() }
    }

    /// Returns the level nearest to some light, or a neighbor of that level.
    #[expect(clippy::cast_possible_truncation, reason = "0 to 65535")]
    pub(super) fn level(&self, light: f32) -> u16 {
        let encoded = if light < DARK {
            // The curve is linear from the first node to 0, as sRGB is.
            self.nodes[0] * f64::from(light.max(0.0) / DARK)
        } else {
            let bits = light.min(1.0).to_bits() - DARK.to_bits();
            let node = (bits >> NODE_BITS) as usize;
            let fraction = f64::from(bits & ((1 << NODE_BITS) - 1)) / f64::from(1 << NODE_BITS);
            self.nodes[node] + fraction * (self.nodes[node + 1] - self.nodes[node])
        };
        (encoded * 65535.0 + 0.5) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TONES: [Tone; 3] = [Tone::Camera, Tone::Neutral, Tone::Linear];

    #[test]
    fn tables_give_the_nearest_level_of_the_curve() {
        for tone in TONES {
            let (eight, sixteen) = (Levels8::cached(tone), Levels16::new(tone));
            for step in 0..200_000_u32 {
                let light = f32::from_bits(step.wrapping_mul(20_411) % 1.01_f32.to_bits());
                let wanted = tone.encode(f64::from(light).min(1.0));
                #[expect(clippy::cast_possible_truncation, reason = "a level")]
                let level = (wanted * 255.0 + 0.5) as u8;
                assert_eq!(eight.level(light.clamp(DARK, 1.0)), level, "{tone:?} {light}");
                let error = f64::from(sixteen.level(light)) - wanted * 65535.0;
                assert!(error.abs() < 1.5, "{tone:?} {light}: {error}");
            }
            let mut out = [9; 6];
            eight.write_row(&mut [-1.0, 7.0, 1.0].map(|light| vec![0.0, light]), &mut out);
            assert_eq!(out, [0, 0, 0, 0, 255, 255]);
            assert_eq!((sixteen.level(-1.0), sixteen.level(7.0)), (0, 65535));
        }
    }

    #[test]
    fn the_camera_curve_passes_gray_and_white_with_its_contrast() {
        assert_eq!((camera(GRAY), camera(1.0)), (GRAY_LEVEL, 1.0));
        assert_eq!(camera(GRAY / 256.0), 0.0);
        let per_stop = camera(GRAY * 1.01) - camera(GRAY / 1.01);
        let per_stop = per_stop / (2.0 * libm::log2(1.01));
        assert!((per_stop - CONTRAST).abs() < 2e-3, "{per_stop}");
        let steps = (0..3000).map(|i| camera(libm::exp2(f64::from(i) / 250.0 - 12.0)));
        let steps: Vec<f64> = steps.collect();
        assert!(steps.windows(2).all(|pair| pair[0] <= pair[1]), "monotonic");
    }

    #[test]
    fn neutral_is_the_published_formula() {
        // Values computed by hand from the specification (Khronos PBR Neutral Tone Mapper, 2024).
        let cases = [
            ([0.5, 0.5, 0.5], [0.46, 0.46, 0.46]),
            ([0.04, 0.2, 0.3], [0.01, 0.17, 0.27]),
            ([1.0, 1.0, 1.0], [0.869_091, 0.869_091, 0.869_091]),
            ([4.0, 0.0, 0.0], [0.983_448, 0.306_367, 0.306_367]),
        ];
        for (light, wanted) in cases {
            let actual = neutral(light);
            for (actual, wanted) in actual.into_iter().zip(wanted) {
                assert!((actual - wanted).abs() < 2e-6, "{light:?}: {actual}, wanted {wanted}");
            }
        }
    }
}
