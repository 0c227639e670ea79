//! The sensor converts the light on its pixels to a readout, as in EMVA 1288.
//!
//! 1. Light leaks between the color channels and then becomes electrons. Electron counts are
//!    Poisson-distributed, with a mean equal to the light times the channel's response. Dark
//!    current and hot photosites add more electrons.
//! 2. The well or the converter clips each channel, and reading adds noise.
//! 3. The camera subtracts the mean dark current, clips all channels at the same light, and undoes
//!    the leak by a matrix. This restores the color of unclipped light, and shifts that of clipped
//!    light toward its neighbor's and toward white. Then the camera balances white and clips again.
//!    Balancing white before the matrix would tint every gray.
//!
//! Green photosites receive a fourth of a blue LED's light ([`SENSITIVITY`]), which makes the
//! center of an overexposed blue lamp cyan.
//!
//! White is [`Camera::saturation_lx_s`]. A single picture does not show which part of its noise is
//! a fixed pattern, so PRNU is part of the variance. The model omits rounding by the converter, the
//! color filter mosaic, banding and cosmic rays.

use super::noise::{NORMAL, Normal, POISSON, POISSON_BELOW, Poisson, Source, Stream};
use super::options::{Noise, PhotoOptions, SensorNoise};
use crate::narrow;
use noctograph_core::camera::Camera;
use noctograph_core::random::poisson;

/// The sensor of a camera.
#[derive(Debug)]
pub(super) struct Sensor {
    pub(super) white_lx_s: f64,
    /// Matrix of the crosstalk between the channels, and the inverse of that matrix.
    crosstalk: Option<[[[f32; 3]; 3]; 2]>,
    white_balance: [f32; 3],
    noise: Option<Noisy>,
}

/// The noise of a sensor. Numbers of electrons are those of one channel of a pixel.
#[derive(Debug)]
struct Noisy {
    seed: u64,
    normal: &'static Normal,
    poisson: &'static Poisson,
    /// Number of electrons in each channel at white.
    at_white: [f32; 3],
    /// Number of electrons at which a channel clips.
    clip: f32,
    /// Mean number of electrons from dark current.
    dark: f32,
    /// Variance of the read noise, in electrons squared.
    read_variance: f32,
    /// Variance of the gain from pixel to pixel, relative to the squared gain.
    prnu_squared: f32,
    /// Mean number of hot pixels per row, and mean number of electrons from a hot pixel.
    hot_in_row: f64,
    hot: f64,
}

/// Mean dark current of a hot pixel, which is exponentially distributed.
pub(super) const HOT_PIXEL_E_S: f64 = 100.0;
/// Seed of the hot pixels, which are the same in all pictures from a camera.
const HOT_PIXEL_SEED: u64 = 0;

/// Number of pixels whose electrons are computed together.
const LANES: usize = 16;

/// Buffers for a row: random bits for each use, and hot pixels.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    bits: Vec<u32>,
    read_bits: Vec<u32>,
    hot: Vec<(usize, f32)>,
}

impl Sensor {
    /// Prepares the sensor of a camera, whose random numbers depend on the seed.
    pub(super) fn new(camera: &Camera, options: &PhotoOptions, seed: u64) -> Self {
        let noise = match &options.noise {
            Noise::Emva1288(noise) => Some(Noisy::new(camera, noise, seed)),
            Noise::Off => None,
        };
        Self {
            white_lx_s: camera.saturation_lx_s(),
            crosstalk: options.crosstalk.then(crosstalk),
            white_balance: camera.white_balance.map(narrow),
            noise,
        }
    }

    /// Reads row `y`: replaces the light relative to white by the camera's readout, which is 1 at
    /// saturation. Noise and the matrix may make it slightly negative. No multiplication is fused
    /// with an addition, so that registers of any width give the same bits.
    pub(super) fn read(&self, y: usize, rows: &mut [Vec<f32>; 3], scratch: &mut Scratch) {
        // Applies the crosstalk of the color filters, then noise and clipping, then the matrix that
        // undoes the crosstalk, and finally the white balance.
        noctograph_core::dispatch!(|| {
            if let Some([crosstalk, _]) = &self.crosstalk {
                multiply(crosstalk, rows);
            }
            match &self.noise {
                Some(noise) => noise.read(y, rows, scratch),
                None => rows.iter_mut().flatten().for_each(|light| *light = light.min(1.0)),
            }
            if let Some([_, inverse]) = &self.crosstalk {
                multiply(inverse, rows);
            }
            for (row, &gain) in rows.iter_mut().zip(&self.white_balance) {
                row.iter_mut().for_each(|light| *light = (*light * gain).min(1.0));
            }
        });
    }
}

/// Sensitivity of red, green and blue photosites (rows) to red, green and blue LEDs of 622, 525 and
/// 466 nm, relative to the photosites of the LED's own color, with white balanced.
///
/// The values are medians over 32 cameras, whose spectral sensitivities were measured by Jiang and
/// others 2013 and by contributors of github.com/butcherg/ssf-data.
const SENSITIVITY: [[f64; 3]; 3] = [[1.0, 0.19, 0.05], [0.05, 1.0, 0.23], [0.0, 0.3, 1.0]];

/// Returns the matrix of the crosstalk, and its inverse. The matrix contains the fractions of red,
/// green and blue light that each kind of photosite receives. White light is equal in all channels.
fn crosstalk() -> [[[f32; 3]; 3]; 2] {
    let fractions = SENSITIVITY.map(|row| row.map(|light| light / row.iter().sum::<f64>()));
    let crosstalk = nalgebra::Matrix3::from_fn(|i, j| fractions[i][j]);
    let inverse = crosstalk.try_inverse().expect("each photosite receives most of its own color");
    [crosstalk, inverse]
        .map(|m| std::array::from_fn(|i| std::array::from_fn(|j| narrow(m[(i, j)]))))
}

/// Multiplies the red, green and blue values of each pixel in a row by a matrix.
#[inline(always)]
fn multiply(matrix: &[[f32; 3]; 3], rows: &mut [Vec<f32>; 3]) {
    let [red, green, blue] = rows;
    for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
        let [new_r, new_g, new_b] =
            std::array::from_fn(|i| matrix[i][0] * *r + matrix[i][1] * *g + matrix[i][2] * *b);
        (*r, *g, *b) = (new_r, new_g, new_b);
    }
}

impl Noisy {
    /// Computes the constants of a sensor.
    fn new(camera: &Camera, noise: &SensorNoise, seed: u64) -> Self {
        let gain = (camera.iso / camera.base_iso).max(1.0);
        let exposure_s = camera.shutter_close_s - camera.shutter_open_s;
        let largest = noise.response.into_iter().fold(0.0, f64::max);
        // If there is gain, the converter clips before the well is full.
        let clip = noise.full_well_e / gain;
        // In a long exposure, dark current could fill the well. It is limited so that half of the
        // range is left to light, because readouts are divided by that part.
        let dark = (noise.dark_current_e_s * exposure_s).min(0.5 * clip);
        Self {
            seed,
            normal: &NORMAL,
            poisson: &POISSON,
            at_white: noise.response.map(|r| narrow((clip - dark) * r / largest)),
            clip: narrow(clip),
            dark: narrow(dark),
            read_variance: narrow(noise.read_noise_e * noise.read_noise_e),
            prnu_squared: narrow(noise.prnu_frac * noise.prnu_frac),
            hot_in_row: noise.hot_pixel_frac * f64::from(camera.width_px),
            hot: HOT_PIXEL_E_S * exposure_s,
        }
    }

    /// Replaces the light of row `y` by its noisy readout, which is 1 at saturation.
    #[inline(always)]
    fn read(&self, y: usize, rows: &mut [Vec<f32>; 3], scratch: &mut Scratch) {
        let Scratch { bits, read_bits, hot } = scratch;
        let width = rows[0].len();
        bits.resize(width, 0);
        read_bits.resize(width, 0);
        self.hot_pixels(y, width, hot);
        for (channel, row) in rows.iter_mut().enumerate() {
            // Computes each pixel's mean electrons from photons, dark current and hot photosites.
            let (at_white, dark, clip) = (self.at_white[channel], self.dark, self.clip);
            let mut n_dark = 0;
            for light in row.iter_mut() {
                *light = *light * at_white + dark;
                n_dark |= u32::from(*light < POISSON_BELOW);
            }
            // The number of electrons is that of a green photosite.
            for &(x, electrons) in &*hot {
                row[x] += electrons * self.at_white[channel] / self.at_white[1].max(1.0);
            }
            // A row without dark pixels needs no Poisson-distributed numbers.
            Stream::new(self.seed, y, channel, Source::Shot).fill(bits);
            if n_dark > 0 {
                Stream::new(self.seed, y, channel, Source::Read).fill(read_bits);
                self.add_noise(row, bits, read_bits);
            } else {
                for (mean, &bits) in row.iter_mut().zip(&*bits) {
                    *mean = self.bright(*mean, bits);
                }
            }
            // The well clips, and then the camera subtracts the mean dark current.
            let per_electron = 1.0 / at_white;
            for electrons in row.iter_mut() {
                *electrons = ((electrons.min(clip) - dark) * per_electron).min(1.0);
            }
        }
    }

    /// Replaces the mean electrons of a row, in which some pixels are dark, with random numbers.
    /// Each pixel has 32 random bits of each kind.
    #[inline(always)]
    fn add_noise(&self, row: &mut [f32], bits: &[u32], read_bits: &[u32]) {
        // Processes whole groups of pixels first, and then the remaining pixels.
        let (groups, rest) = row.as_chunks_mut();
        let (bits, rest_bits) = bits.as_chunks();
        let (read_bits, rest_read_bits) = read_bits.as_chunks();
        for (means, (bits, read_bits)) in groups.iter_mut().zip(bits.iter().zip(read_bits)) {
            self.draw_group::<LANES>(means, *bits, *read_bits);
        }
        let rest = rest.as_chunks_mut::<1>().0.iter_mut();
        for (mean, (bits, read_bits)) in rest.zip(rest_bits.iter().zip(rest_read_bits)) {
            self.draw_group(mean, [*bits], [*read_bits]);
        }
    }

    /// Replaces the mean electrons of a group of pixels with random numbers: Poisson-distributed
    /// photons plus normally distributed noise of all other sources. Pixels with a mean of at least
    /// [`POISSON_BELOW`] are computed as bright pixels.
    ///
    /// The function is inlined, like all that [`Sensor::read`] calls for each pixel, so that it is
    /// compiled for this processor's registers.
    #[inline(always)]
    fn draw_group<const N: usize>(
        &self,
        electrons: &mut [f32; N],
        bits: [u32; N],
        read_bits: [u32; N],
    ) {
        let photons = self.poisson.numbers(*electrons, bits);
        let normals = self.normal.numbers(read_bits);
        let means = *electrons;
        for (n, number) in electrons.iter_mut().enumerate() {
            let variance = self.read_variance + self.prnu_squared * *number * *number;
            *number = photons[n] + variance.sqrt() * normals[n];
        }
        // All pixels are computed as dark ones above, and the bright ones of a group that has any
        // are computed again.
        if means.iter().any(|mean| *mean >= POISSON_BELOW) {
            for n in (0..N).filter(|n| means[*n] >= POISSON_BELOW) {
                electrons[n] = self.bright(means[n], bits[n]);
            }
        }
    }

    /// Returns the electrons of a pixel with the expected number `mean`, drawn by `bits`. The pixel
    /// is bright, so that all its noise is one normal number.
    #[inline(always)]
    fn bright(&self, mean: f32, bits: u32) -> f32 {
        let variance = mean + self.read_variance + self.prnu_squared * mean * mean;
        mean + variance.sqrt() * self.normal.numbers([bits])[0]
    }

    /// Writes the column and the electrons of each hot pixel in row `y` to `out`.
    fn hot_pixels(&self, y: usize, width: usize, out: &mut Vec<(usize, f32)>) {
        out.clear();
        let stream = Stream::new(HOT_PIXEL_SEED, y, 0, Source::Hot);
        // (bits + 1/2) / 2^32 is between 0 and 1, and never equal to either.
        let uniform = |bits: u32| (f64::from(bits) + 0.5) * (1.0 / 4_294_967_296.0);
        // The number of hot pixels is Poisson-distributed, their columns are uniform, and their
        // electrons exponentially distributed.
        let number = poisson(self.hot_in_row, uniform(stream.bits(0)));
        for index in 0..number {
            let scaled = u64::from(stream.bits(1 + 2 * index)) * width as u64;
            let column = usize::try_from(scaled >> 32).expect("a column of the row");
            let electrons = narrow(-self.hot * libm::log(uniform(stream.bits(2 + 2 * index))));
            out.push((column, electrons));
        }
    }
}
