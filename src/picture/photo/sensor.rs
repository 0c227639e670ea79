//! Sensor: from the light on its pixels to its readout, after EMVA 1288.
//!
//! 1. Light leaks between the color channels and becomes electrons: Poisson numbers with a mean of
//!    the light times the response of the channel. Dark current and hot photosites add some.
//! 2. The well or the converter clips each channel, and reading adds noise.
//! 3. The camera subtracts the mean dark current, clips all channels at the same light, and inverts
//!    the leak by its matrix: unclipped light has its own color again, clipped light a color nearer
//!    to its neighbor's and to white. Then it balances white and clips again: gains before the
//!    matrix would tint every gray.
//!
//! Green photosites receive a fourth of a blue LED's light ([`SEEN`]): hence the cyan center of an
//! overexposed blue lamp.
//!
//! White is [`Camera::saturation_lx_s`].
//! A single picture does not distinguish noise from pattern: PRNU is part of the variance. Not
//! modeled: rounding of the converter, the color filter mosaic, banding, cosmic rays.

use super::noise::{NORMAL, Normal, POISSON, POISSON_BELOW, Poisson, Source, Stream};
use super::options::{Noise, PhotoOptions, SensorNoise};
use crate::narrow;
use noctograph_core::camera::Camera;
use noctograph_core::random::poisson;

#[derive(Debug)]
pub(super) struct Sensor {
    pub(super) white_lx_s: f64,
    /// Matrix of the leak between the channels, and its inverse.
    leak: Option<[[[f32; 3]; 3]; 2]>,
    white_balance: [f32; 3],
    noise: Option<Noisy>,
}

/// A noisy sensor, in electrons.
#[derive(Debug)]
struct Noisy {
    seed: u64,
    normal: &'static Normal,
    poisson: &'static Poisson,
    /// Electrons of each channel at white.
    at_white: [f32; 3],
    clip: f32,
    dark: f32,
    read_variance: f32,
    prnu_squared: f32,
    /// Mean number of hot pixels in a row, and mean electrons of one.
    hot_in_row: f64,
    hot: f64,
}

/// Mean dark current of a hot pixel, which is distributed exponentially.
pub(super) const HOT_PIXEL_E_S: f64 = 100.0;
/// Which pixels are hot: the same in all pictures of the camera.
const HOT_PIXEL_SEED: u64 = 0;

/// Pixels whose electrons are drawn at once.
const LANES: usize = 16;

#[derive(Debug, Default)]
pub(super) struct Scratch {
    bits: Vec<u32>,
    reading: Vec<u32>,
    hot: Vec<(usize, f32)>,
}

impl Sensor {
    pub(super) fn new(camera: &Camera, options: &PhotoOptions, seed: u64) -> Self {
        let noise = match &options.noise {
            Noise::Emva1288(noise) => Some(Noisy::new(camera, noise, seed)),
            Noise::Off => None,
        };
        Self {
            white_lx_s: camera.saturation_lx_s(),
            leak: options.crosstalk.then(leak),
            white_balance: camera.white_balance.map(narrow),
            noise,
        }
    }

    /// Reads row `y`: light relative to white becomes the readout of the camera, 1 at saturation (a
    /// little below 0 by noise or the matrix). It runs in the widest registers of
    /// this processor, with the same bits in all, since no product is fused with a sum.
    pub(super) fn read(&self, y: usize, rows: &mut [Vec<f32>; 3], scratch: &mut Scratch) {
        // Crosstalk of the color filters, noise and clipping, the matrix that undoes the crosstalk,
        // white balance.
        noctograph_core::dispatch!(|| {
            if let Some([leak, _]) = &self.leak {
                mix(leak, rows);
            }
            match &self.noise {
                Some(noise) => noise.read(y, rows, scratch),
                None => rows.iter_mut().flatten().for_each(|light| *light = light.min(1.0)),
            }
            if let Some([_, undo]) = &self.leak {
                mix(undo, rows);
            }
            for (row, &gain) in rows.iter_mut().zip(&self.white_balance) {
                row.iter_mut().for_each(|light| *light = (*light * gain).min(1.0));
            }
        });
    }
}

/// Light of a red, a green and a blue LED (622, 525, 466 nm) that red, green and blue photosites
/// receive, relative to that of the photosites of the LED's own color, with white balanced: medians
/// of 32 cameras (spectral sensitivities measured by Jiang and others 2013 and by contributors of
/// github.com/butcherg/ssf-data).
const SEEN: [[f64; 3]; 3] = [[1.0, 0.19, 0.05], [0.05, 1.0, 0.23], [0.0, 0.3, 1.0]];

/// Fractions of red, green and blue light that the red, green and blue photosites receive, and the
/// inverse. All see white alike.
fn leak() -> [[[f32; 3]; 3]; 2] {
    let fractions = SEEN.map(|seen| seen.map(|light| light / seen.iter().sum::<f64>()));
    let leak = nalgebra::Matrix3::from_fn(|i, j| fractions[i][j]);
    let undo = leak.try_inverse().expect("each photosite receives most of its own color");
    [leak, undo].map(|m| std::array::from_fn(|i| std::array::from_fn(|j| narrow(m[(i, j)]))))
}

#[inline(always)]
fn mix(by: &[[f32; 3]; 3], rows: &mut [Vec<f32>; 3]) {
    let [red, green, blue] = rows;
    for ((r, g), b) in red.iter_mut().zip(green).zip(blue) {
        let [mixed_r, mixed_g, mixed_b] =
            std::array::from_fn(|i| by[i][0] * *r + by[i][1] * *g + by[i][2] * *b);
        (*r, *g, *b) = (mixed_r, mixed_g, mixed_b);
    }
}

impl Noisy {
    fn new(camera: &Camera, noise: &SensorNoise, seed: u64) -> Self {
        let gain = (camera.iso / camera.base_iso).max(1.0);
        let exposure_s = camera.shutter_close_s - camera.shutter_open_s;
        let largest = noise.response.into_iter().fold(0.0, f64::max);
        // At a gain the converter clips before the well does.
        let clip = noise.full_well_e / gain;
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

    #[inline(always)]
    fn read(&self, y: usize, rows: &mut [Vec<f32>; 3], scratch: &mut Scratch) {
        let Scratch { bits, reading, hot } = scratch;
        let width = rows[0].len();
        bits.resize(width, 0);
        reading.resize(width, 0);
        self.hot_pixels(y, width, hot);
        for (channel, row) in rows.iter_mut().enumerate() {
            // Mean electrons of each pixel: photons, dark current, hot photosites.
            let (at_white, dark, clip) = (self.at_white[channel], self.dark, self.clip);
            let mut few = 0;
            for light in row.iter_mut() {
                *light = *light * at_white + dark;
                few |= u32::from(*light < POISSON_BELOW);
            }
            for &(x, electrons) in &*hot {
                row[x] += electrons * self.at_white[channel] / self.at_white[1].max(1.0);
            }
            // A row without dark pixels needs no Poisson numbers.
            Stream::new(self.seed, y, channel, Source::Shot).fill(bits);
            if few > 0 {
                Stream::new(self.seed, y, channel, Source::Read).fill(reading);
                let (means, rest) = row.as_chunks_mut();
                let (each_bits, rest_bits) = bits.as_chunks();
                let (each_reading, rest_reading) = reading.as_chunks();
                for (means, (bits, reading)) in
                    means.iter_mut().zip(each_bits.iter().zip(each_reading))
                {
                    self.dark::<LANES>(means, *bits, *reading);
                }
                let rest = rest.as_chunks_mut::<1>().0.iter_mut();
                for (mean, (bits, reading)) in rest.zip(rest_bits.iter().zip(rest_reading)) {
                    self.dark(mean, [*bits], [*reading]);
                }
            } else {
                for (mean, &bits) in row.iter_mut().zip(&*bits) {
                    *mean = self.bright(*mean, bits);
                }
            }
            // The well clips. The camera subtracts the mean dark current.
            let undo = 1.0 / at_white;
            for electrons in row.iter_mut() {
                *electrons = ((electrons.min(clip) - dark) * undo).min(1.0);
            }
        }
    }

    /// Electrons of pixels, some of them dark.
    #[inline(always)]
    fn dark<const N: usize>(&self, means: &mut [f32; N], bits: [u32; N], reading: [u32; N]) {
        let photons = self.poisson.numbers(*means, bits);
        let others = self.normal.numbers(reading);
        let before = *means;
        for (n, mean) in means.iter_mut().enumerate() {
            let variance = self.read_variance + self.prnu_squared * *mean * *mean;
            *mean = photons[n] + variance.sqrt() * others[n];
        }
        if before.iter().any(|mean| *mean >= POISSON_BELOW) {
            for n in (0..N).filter(|n| before[*n] >= POISSON_BELOW) {
                means[n] = self.bright(before[n], bits[n]);
            }
        }
    }

    /// Electrons of a bright pixel: all sources add up to one normal number.
    #[inline(always)]
    fn bright(&self, mean: f32, bits: u32) -> f32 {
        let variance = mean + self.read_variance + self.prnu_squared * mean * mean;
        mean + variance.sqrt() * self.normal.numbers([bits])[0]
    }

    /// The hot pixels of a row, by column and electrons.
    fn hot_pixels(&self, y: usize, width: usize, out: &mut Vec<(usize, f32)>) {
        out.clear();
        let stream = Stream::new(HOT_PIXEL_SEED, y, 0, Source::Hot);
        let uniform = |bits: u32| (f64::from(bits) + 0.5) * (1.0 / 4_294_967_296.0);
        // A Poisson number of pixels, each at a uniform column with exponential electrons.
        let number = poisson(self.hot_in_row, uniform(stream.bits(0)));
        for index in 0..number {
            let place = u64::from(stream.bits(1 + 2 * index)) * width as u64;
            let column = usize::try_from(place >> 32).expect("a column of the row");
            let electrons = narrow(-self.hot * libm::log(uniform(stream.bits(2 + 2 * index))));
            out.push((column, electrons));
        }
    }
}
