//! Sensor: from light on its pixels to what it reads, after EMVA 1288.
//!
//! Light leaks between the colours, becomes electrons in Poisson numbers with a mean of the light
//! times the colour's response, dark current and hot photosites add theirs, the well or the
//! converter clips each colour, and reading adds noise. Then the camera takes the mean dark current
//! off, balances white, clips all colours at the same light, and undoes the leak by its matrix: what
//! was not clipped has its own colour back, what was is nearer to its neighbour's and to white.
//!
//! A filter leaks most into its neighbour in the spectrum: red and blue into green, green into both,
//! and a tenth of that from red to blue. So an overexposed blue lamp has a cyan heart.
//!
//! White is `78 / ISO` lx s (ISO 12232) from the base sensitivity on; below it the full well is.
//! A picture shows noise and pattern in one: PRNU joins the variance. Not modelled: rounding of the
//! converter, the mosaic of colours, banding, cosmic rays.

use super::noise::{NORMAL, Normal, POISSON, POISSON_BELOW, Poisson, Source, Stream, poisson};
use super::options::{Noise, PhotoOptions};
use crate::camera::Camera;

/// A sensor at its settings for one picture.
#[derive(Debug)]
pub(super) struct Sensor {
    /// Luminous exposure that is white.
    pub(super) white_lx_s: f64,
    /// How the colours leak, and what undoes it; nothing where they do not.
    leak: Option<[[[f32; 3]; 3]; 2]>,
    /// Gains of the colours.
    white_balance: [f32; 3],
    noise: Option<Noisy>,
}

/// A noisy sensor; numbers in electrons.
#[derive(Debug)]
struct Noisy {
    seed: u64,
    normal: &'static Normal,
    poisson: &'static Poisson,
    /// Electrons of each colour at white.
    at_white: [f32; 3],
    /// Where each pixel clips.
    clip: f32,
    dark: f32,
    read_variance: f32,
    prnu_squared: f32,
    /// Hot photosites of a row, mean; of an exposure, mean electrons.
    hot_in_row: f64,
    hot: f64,
}

/// Rows that are filled anew for every row of the picture.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    bits: Vec<u32>,
    reading: Vec<u32>,
    hot: Vec<(usize, usize, f32)>,
}

impl Sensor {
    #[expect(clippy::cast_possible_truncation, reason = "electrons are f32")]
    pub(super) fn new(camera: &Camera, options: &PhotoOptions, seed: u64) -> Self {
        let gain = (camera.iso / options.base_iso).max(1.0);
        let white_lx_s = 78.0 / (options.base_iso * gain);
        let exposure_s = camera.shutter_close_s - camera.shutter_open_s;
        let largest = options.response.into_iter().fold(0.0, f64::max);
        let clip = options.full_well_e / gain;
        let dark = (options.dark_current_e_s * exposure_s).min(0.5 * clip);
        let noisy = || Noisy {
            seed,
            normal: &NORMAL,
            poisson: &POISSON,
            at_white: options.response.map(|r| ((clip - dark) * r / largest) as f32),
            clip: clip as f32,
            dark: dark as f32,
            read_variance: (options.read_noise_e * options.read_noise_e) as f32,
            prnu_squared: (options.prnu_frac * options.prnu_frac) as f32,
            hot_in_row: options.hot_pixel_frac * 3.0 * f64::from(camera.width_px),
            hot: options.hot_pixel_e_s * exposure_s,
        };
        Self {
            white_lx_s,
            leak: (options.crosstalk_frac > 0.0).then(|| leak(options.crosstalk_frac)),
            white_balance: camera.white_balance.map(|gain| gain as f32),
            noise: (options.noise == Noise::Emva1288).then(noisy),
        }
    }

    /// Reads row `y`: light in shares of white becomes what the camera makes of it, 1 where it
    /// saturates (and a little off 0 to 1 where the matrix leads there). The widest registers of this
    /// processor do it; no product is fused with a sum, so all leave the same bits.
    pub(super) fn read(&self, y: usize, rows: &mut [Vec<f32>; 3], scratch: &mut Scratch) {
        pulp::Arch::new().dispatch(Reading { sensor: self, y, rows, scratch });
    }
}

/// A row while it is read.
struct Reading<'a> {
    sensor: &'a Sensor,
    y: usize,
    rows: &'a mut [Vec<f32>; 3],
    scratch: &'a mut Scratch,
}

impl pulp::NullaryFnOnce for Reading<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { sensor, y, rows, scratch } = self;
        if let Some([leak, _]) = &sensor.leak {
            mix(leak, rows);
        }
        match &sensor.noise {
            Some(noise) => noise.read(y, rows, scratch),
            None => rows.iter_mut().flatten().for_each(|light| *light = light.min(1.0)),
        }
        for (row, &gain) in rows.iter_mut().zip(&sensor.white_balance) {
            if gain != 1.0 {
                row.iter_mut().for_each(|light| *light = (*light * gain).min(1.0));
            }
        }
        if let Some([_, undo]) = &sensor.leak {
            mix(undo, rows);
        }
    }
}

/// What the red, green and blue photosites see of red, green and blue light, and its inverse.
#[expect(clippy::cast_possible_truncation, reason = "electrons are f32")]
fn leak(crosstalk_frac: f64) -> [[[f32; 3]; 3]; 2] {
    let (near, far) = (crosstalk_frac, 0.1 * crosstalk_frac);
    let leak = nalgebra::Matrix3::new(
        1.0 - near - far,
        near,
        far,
        near,
        1.0 - 2.0 * near,
        near,
        far,
        near,
        1.0 - near - far,
    );
    let undo = leak.try_inverse().expect("less than a third leaks");
    [leak, undo].map(|m| std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)] as f32)))
}

/// Mixes the channels of each pixel.
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
    #[inline(always)]
    fn read(&self, y: usize, rows: &mut [Vec<f32>; 3], scratch: &mut Scratch) {
        let Scratch { bits, reading, hot } = scratch;
        let width = rows[0].len();
        bits.resize(width, 0);
        reading.resize(width, 0);
        self.hot_photosites(y, width, hot);
        for (channel, row) in rows.iter_mut().enumerate() {
            let (at_white, dark, clip) = (self.at_white[channel], self.dark, self.clip);
            let mut few = 0;
            for light in row.iter_mut() {
                *light = *light * at_white + dark;
                few |= u32::from(*light < POISSON_BELOW);
            }
            for &(_, x, electrons) in hot.iter().filter(|(hot, ..)| *hot == channel) {
                row[x] += electrons;
            }
            Stream::new(self.seed, y, channel, Source::Shot).fill(bits);
            if few > 0 {
                Stream::new(self.seed, y, channel, Source::Read).fill(reading);
                for (mean, (&bits, &reading)) in row.iter_mut().zip(bits.iter().zip(&*reading)) {
                    *mean = if *mean < POISSON_BELOW {
                        let spread = self.read_variance + self.prnu_squared * *mean * *mean;
                        self.poisson.of(*mean, bits) + spread.sqrt() * self.normal.of(reading)
                    } else {
                        self.bright(*mean, bits)
                    };
                }
            } else {
                for (mean, &bits) in row.iter_mut().zip(&*bits) {
                    *mean = self.bright(*mean, bits);
                }
            }
            let undo = 1.0 / at_white;
            for electrons in row.iter_mut() {
                *electrons = ((electrons.min(clip) - dark) * undo).min(1.0);
            }
        }
    }

    /// Electrons read where there are many: all sources add up to one normal number.
    #[inline(always)]
    fn bright(&self, mean: f32, bits: u32) -> f32 {
        let variance = mean + self.read_variance + self.prnu_squared * mean * mean;
        mean + variance.sqrt() * self.normal.of(bits)
    }

    /// The hot photosites of a row: channel, column, electrons.
    fn hot_photosites(&self, y: usize, width: usize, out: &mut Vec<(usize, usize, f32)>) {
        out.clear();
        let stream = Stream::new(self.seed, y, 0, Source::Hot);
        let number = poisson(self.hot_in_row, stream.bits(0));
        for index in 0..number {
            let place = u64::from(stream.bits(1 + 2 * index)) * (3 * width as u64);
            let place = usize::try_from(place >> 32).expect("a photosite of a row");
            let uniform = (f64::from(stream.bits(2 + 2 * index)) + 0.5) / 4_294_967_296.0;
            #[expect(clippy::cast_possible_truncation, reason = "electrons are f32")]
            let electrons = (-self.hot * libm::log(uniform)) as f32;
            out.push((place % 3, place / 3, electrons));
        }
    }
}
