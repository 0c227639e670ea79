//! Photo: film becomes a picture, with all that is needed to make it again.
//!
//! Product in: [`Film`]. Product out: [`Photo`], or the sensor's [`Readout`] in linear light.
//!
//! Light takes the way of a camera: the lens scatters some of it ([`PhotoOptions::glare_frac`]) and
//! diffracts some into spikes, room and background join, the sensor makes electrons with their
//! noise, clips and reads them (EMVA 1288, ISO 12232), and a tone curve makes levels. Whatever of
//! this is switched off leaves the light as it was.
//!
//! Counts stay integers through the lens; what follows is f32 in `+ - × ÷ √` only, pixel by pixel,
//! with noise that depends on seed, pixel, channel and source: the same bytes on every machine and
//! number of threads.
//!
//! Not modelled: ghosts, glare of the background (a photo
//! has its own), the mosaic of colours, JPEG.

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::expose::Film;

pub use metadata::Metadata;
pub use options::{Noise, PhotoOptions};
pub use tone::Tone;

use backdrop::Backdrop;
use glare::Glare;
use sensor::Sensor;
use starburst::Change;
use tone::{Levels8, Levels16};

mod backdrop;
mod bands;
pub mod exr;
pub mod flip;
mod glare;
mod metadata;
mod noise;
mod open;
mod options;
pub mod png;
pub mod register;
mod sensor;
mod spread;
pub mod srgb;
mod starburst;
#[cfg(test)]
mod tests;
mod tone;

/// A photograph. A rendered one and a real one meet here; the judge can't tell them apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photo {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Red, green, blue by pixel, row by row from the top left, sRGB-encoded.
    pub rgb8: Vec<u8>,
    /// The scene file that made it, where the picture carries one.
    pub scene_toml: Option<String>,
}

/// What the sensor read, before the tone curve: scene-linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Readout {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Red, green, blue by pixel, row by row from the top left: linear sRGB, 1 where the sensor
    /// saturates. Noise and matrix lead below 0 and a little above 1.
    pub rgb: Vec<f32>,
    /// Luminous exposure that 1 stands for.
    pub white_lx_s: f64,
}

/// Develops a film.
///
/// The same film, camera, options and seed make the same photo, to the bit.
///
/// # Errors
///
/// [`Error::Input`] where an option is out of range or camera and film differ in size; what
/// [`Photo::read_png`] says about the background.
pub fn develop(film: &Film, camera: &Camera, options: &PhotoOptions, seed: u64) -> Result<Photo> {
    let levels = Levels8::new(options.tone);
    let (_, rgb8) = take(film, camera, options, seed, |rows, out: &mut [u8]| {
        for_pixels(rows, out, |rgb| options.tone.mix(rgb).map(|light| levels.of(light)));
    })?;
    Ok(Photo { width_px: film.width_px, height_px: film.height_px, rgb8, scene_toml: None })
}

/// What the sensor reads of a film, as [`develop`] has it before the tone curve.
///
/// # Errors
///
/// As [`develop`].
pub fn read_out(
    film: &Film,
    camera: &Camera,
    options: &PhotoOptions,
    seed: u64,
) -> Result<Readout> {
    let (white_lx_s, rgb) = take(film, camera, options, seed, |rows, out: &mut [f32]| {
        for_pixels(rows, out, |rgb| rgb);
    })?;
    Ok(Readout { width_px: film.width_px, height_px: film.height_px, rgb, white_lx_s })
}

impl Readout {
    /// The picture at 16 bits a channel, as [`develop`] makes it at 8.
    #[must_use]
    pub fn rgb16(&self, tone: Tone) -> Vec<u16> {
        let levels = Levels16::new(tone);
        let pixels = self.rgb.chunks_exact(3);
        pixels.flat_map(|p| tone.mix([p[0], p[1], p[2]]).map(|light| levels.of(light))).collect()
    }
}

/// Takes the picture row by row; `finish` makes of each row's channels what the product wants.
/// Returns the luminous exposure that is white, too.
fn take<T: Copy + Default + Send>(
    film: &Film,
    camera: &Camera,
    options: &PhotoOptions,
    seed: u64,
    finish: impl Fn(&[Vec<f32>; 3], &mut [T]) + Sync,
) -> Result<(f64, Vec<T>)> {
    options.check()?;
    if [film.width_px, film.height_px] != [camera.width_px, camera.height_px] {
        let found = format!("{}x{}", film.width_px, film.height_px);
        let wanted = format!("the camera's {}x{}", camera.width_px, camera.height_px);
        return Err(Error::input("film", found, wanted, "develop with the camera that exposed"));
    }
    let sensor = Sensor::new(camera, options, seed);
    let backdrop = Backdrop::new(camera, options, sensor.white_lx_s)?;
    let glare = Glare::new(film, camera, options.glare_frac, options.glare_radius_m);
    let spikes = match options.aperture_blades {
        0 => Vec::new(),
        blades => {
            let cells = glare::cells(film, glare::WHOLE);
            starburst::starburst(film, camera, blades, &cells, glare::WHOLE)
        }
    };

    let (width, height) = (film.width_px as usize, film.height_px as usize);
    let lens = Lens { film, glare, spikes };
    #[expect(clippy::cast_possible_truncation, reason = "light of a photo is f32 from here on")]
    let of_count = (libm::exp2(f64::from(film.scale_log2)) / sensor.white_lx_s) as f32;
    let mut out = vec![T::default(); 3 * width * height];
    bands::rows(width * height, 3 * width, &mut out, |rows, out| {
        let mut light: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; width]);
        let mut counts = vec![0; width];
        let mut scattered = glare::Scratch::default();
        let mut reading = sensor::Scratch::default();
        for (y, out) in rows.zip(out.chunks_exact_mut(3 * width)) {
            for (channel, light) in light.iter_mut().enumerate() {
                lens.row(channel, y, &mut scattered, &mut counts);
                for (light, &count) in light.iter_mut().zip(&counts) {
                    *light = count as f32 * of_count;
                }
            }
            backdrop.add(y, &mut light);
            sensor.read(y, &mut light, &mut reading);
            finish(&light, out);
        }
    });
    Ok((sensor.white_lx_s, out))
}

/// A film behind its lens.
struct Lens<'a> {
    film: &'a Film,
    glare: Option<Glare>,
    spikes: Vec<Change>,
}

impl Lens<'_> {
    /// Counts of a row once the lens has scattered and diffracted.
    fn row(&self, channel: usize, y: usize, scratch: &mut glare::Scratch, out: &mut [u32]) {
        let width = out.len();
        let first = y * width;
        let film = &self.film.counts[channel * self.film.counts.len() / 3 + first..][..width];
        match &self.glare {
            Some(glare) => glare.row(channel, y, film, scratch, out),
            None => out.copy_from_slice(film),
        }
        let start = self.spikes.partition_point(|change| change.index < first);
        let changes = self.spikes[start..].iter();
        for change in changes.take_while(|change| change.index < first + width) {
            let count = &mut out[change.index - first];
            let sum = i64::from(*count) + change.counts[channel];
            *count = u32::try_from(sum.max(0)).unwrap_or(u32::MAX);
        }
    }
}

/// Makes the pixels of a row from its channels.
#[inline(always)]
fn for_pixels<T>(rows: &[Vec<f32>; 3], out: &mut [T], pixel: impl Fn([f32; 3]) -> [T; 3]) {
    let [red, green, blue] = rows;
    let channels = red.iter().zip(green).zip(blue);
    for (out, ((&r, &g), &b)) in out.chunks_exact_mut(3).zip(channels) {
        for (out, value) in out.iter_mut().zip(pixel([r, g, b])) {
            *out = value;
        }
    }
}
