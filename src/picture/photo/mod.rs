//! Photo develops a film into a picture.
//!
//! Input: [`Film`]. Output: [`Photo`], or the [`Readout`] of the sensor in linear light.
//!
//! Light passes through a camera in several steps. The lens scatters part of it
//! ([`PhotoOptions::glare_frac`]) and diffracts part into spikes. The light of the room is added.
//! The sensor converts light to noisy electrons, clips and reads them (EMVA 1288, ISO 12232). A
//! background is added, which already contains its room's light and its sensor's noise. A tone
//! curve converts light to levels. An effect that is turned off leaves the light unchanged.
//!
//! Counts stay integers through the lens. The later steps use only `+ - × ÷ √` in f32, pixel by
//! pixel, with noise that depends on seed, pixel, channel and source. The bytes are therefore the
//! same on every machine and with any number of threads.
//!
//! Ghosts, glare of the background (a photo already contains it), the color filter mosaic, and JPEG
//! are not modeled.

use image::ImageEncoder;
use noctograph_core::parallel::prelude::*;

use crate::expose::{ExposeOptions, Film};
use crate::narrow;
use noctograph_core::camera::Camera;
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::Described;

pub use backdrop::reflectance;
pub use camera_exif::taken_as;
pub use noctograph_core::photo::{Photo, PhotoData};

pub use metadata::Metadata;
pub use open::{read, read_with_notes};
pub use options::{Noise, PhotoOptions, SensorNoise};
pub use png::encode_png;
pub use tone::Tone;

use backdrop::Backdrop;
use glare::Glare;
use sensor::Sensor;
use starburst::{Change, starburst};
use tone::{Levels8, Levels16};

mod backdrop;
mod camera_exif;
#[cfg(not(target_family = "wasm"))]
pub mod exr;
pub mod flip;
mod glare;
mod kernel;
mod metadata;
mod noise;
mod open;
mod options;
pub mod png;
mod raw_file;
mod sensor;
mod starburst;
mod strips;
#[cfg(test)]
mod tests;
mod tone;

/// Scene-linear light from the sensor, before the tone curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Readout {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Red, green and blue of each pixel, row by row from the top left, in linear sRGB with 1 at
    /// saturation. Noise and the color matrix make some values slightly negative.
    pub rgb: Vec<f32>,
    /// Luminous exposure that a value of 1 represents.
    pub white_lx_s: f64,
}

/// Develops a film that was exposed in a room. The photo has the same bytes for the same film,
/// camera, options and seed.
///
/// # Errors
///
/// Returns [`Error::Input`] if an option is out of range or camera and film differ in size, and the
/// errors of [`read`] for the background.
pub fn develop(
    film: &Film,
    camera: &Camera,
    room: &ExposeOptions,
    options: &PhotoOptions,
    seed: u64,
) -> Result<Photo> {
    let levels = Levels8::cached(options.tone);
    let (_, rgb8) = process(film, camera, room, options, seed, |light, out| {
        options.tone.mix(light);
        levels.write_row(light, out);
    })?;
    let (width_px, height_px) = (film.width_px, film.height_px);
    Photo::new(PhotoData { width_px, height_px, rgb8, scene_toml: None })
}

/// Returns the readout of the sensor, which is [`develop`] without the tone curve.
///
/// # Errors
///
/// Returns the same errors as [`develop`].
pub fn read_out(
    film: &Film,
    camera: &Camera,
    room: &ExposeOptions,
    options: &PhotoOptions,
    seed: u64,
) -> Result<Readout> {
    let (white_lx_s, rgb) = process(film, camera, room, options, seed, |light, out| {
        for (channel, light) in light.iter().enumerate() {
            out[channel..].iter_mut().step_by(3).zip(light).for_each(|(out, light)| *out = *light);
        }
    })?;
    Ok(Readout { width_px: film.width_px, height_px: film.height_px, rgb, white_lx_s })
}

impl Readout {
    /// Applies a tone curve. Returns the picture of [`develop`] with 16 bits per channel.
    pub fn rgb16(&self, tone: Tone) -> Vec<u16> {
        let levels = Levels16::new(tone);
        let pixels = self.rgb.as_chunks::<3>().0.iter();
        pixels.flat_map(|rgb| tone.mixed(*rgb).map(|light| levels.level(light))).collect()
    }
}

/// Encodes a photo as a JPEG file, with a quality from 1 to 100.
pub fn jpeg(photo: &Photo, quality: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality);
    encoder
        .write_image(&photo.rgb8, photo.width_px, photo.height_px, image::ExtendedColorType::Rgb8)
        .expect("a photo fits into a JPEG in memory");
    bytes
}

/// Minimum number of rows in a parallel task.
const TASK_ROWS: usize = 16;

/// Processes the picture row by row. `finish` converts the channels of a row, as light relative to
/// white, to the result. Returns the luminous exposure of white in lx s, and the result. Returns
/// the errors of [`develop`].
fn process<T: Copy + Default + Send>(
    film: &Film,
    camera: &Camera,
    room: &ExposeOptions,
    options: &PhotoOptions,
    seed: u64,
    finish: impl Fn(&mut [Vec<f32>; 3], &mut [T]) + Sync,
) -> Result<(f64, Vec<T>)> {
    options.check("photo", None)?;
    if [film.width_px, film.height_px] != [camera.width_px, camera.height_px] {
        let size = format!("{}x{}", film.width_px, film.height_px);
        let wanted = format!("the camera's {}x{}", camera.width_px, camera.height_px);
        return Err(Error::input("film", size, wanted, "use the camera that exposed the film"));
    }
    // Prepares the parts of the camera once for the whole picture.
    let sensor = Sensor::new(camera, options, seed);
    let backdrop = Backdrop::new(camera, room, options, sensor.white_lx_s)?;
    let glare = Glare::new(film, camera, options);
    let spikes = starburst(film, camera, options.aperture_blades);

    let (width, height) = (film.width_px as usize, film.height_px as usize);
    let lens = Lens { film, glare, spikes };
    let per_count = narrow(libm::exp2(f64::from(film.scale_log2)) / sensor.white_lx_s);
    let scratch = || {
        let light: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; width]);
        (light, vec![0; width], Vec::new(), sensor::Scratch::default())
    };
    let mut out = vec![T::default(); 3 * width * height];
    let rows = out.par_chunks_exact_mut(3 * width).enumerate().with_min_len(TASK_ROWS);
    rows.for_each_init(scratch, |(light, counts, scattered, reading), (y, out)| {
        // Values are counts up to the lens, and light relative to white after the lens.
        for (channel, light) in light.iter_mut().enumerate() {
            lens.row(channel, y, scattered, counts);
            noctograph_core::dispatch!(|| {
                for (light, &count) in light.iter_mut().zip(&*counts) {
                    *light = count as f32 * per_count;
                }
            });
        }
        backdrop.add_room(y, light);
        sensor.read(y, light, reading);
        backdrop.add_picture(y, light);
        finish(light, out);
    });
    Ok((sensor.white_lx_s, out))
}

/// A film as seen through its lens.
struct Lens<'a> {
    film: &'a Film,
    glare: Option<Glare>,
    spikes: Vec<Change>,
}

impl Lens<'_> {
    /// Writes the counts of row `y` of a channel, after scatter and diffraction, to `out`.
    /// `scratch` is a buffer.
    fn row(&self, channel: usize, y: usize, scratch: &mut Vec<u64>, out: &mut [u32]) {
        let width = out.len();
        let first = y * width;
        let film = &self.film.plane(channel)[first..][..width];
        match &self.glare {
            Some(glare) => glare.row(channel, y, film, scratch, out),
            None => out.copy_from_slice(film),
        }
        // The changes are sorted by pixel.
        let start = self.spikes.partition_point(|change| change.index < first);
        let changes = self.spikes[start..].iter();
        for change in changes.take_while(|change| change.index < first + width) {
            let count = &mut out[change.index - first];
            let sum = i64::from(*count) + change.counts[channel];
            *count = u32::try_from(sum.max(0)).unwrap_or(u32::MAX);
        }
    }
}
