//! Ink of a picture, the light to register, from coarse to fine.

use image::imageops::{self, FilterType};
use image::{ImageBuffer, Luma};

use super::whole;
use crate::photo::{Photo, srgb};

type Plane = ImageBuffer<Luma<f32>, Vec<f32>>;

/// Longer side of the coarsest and of the finest picture.
const COARSE_PX: usize = 64;
const FINE_PX: usize = 1024;

/// Standard deviation of the blur that gives the surroundings, as a share of the longer side.
const AROUND: f32 = 1.0 / 40.0;

/// Standard deviation of the smoothing.
const SMOOTH_PX: f32 = 0.8;

/// Light that is not ink: a third of level 1, more than rounding leaves of an even picture.
const LEAST_INK: f32 = 1e-4;

/// Light above that of its surroundings.
#[derive(Clone, Debug)]
pub(super) struct Ink {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

/// A picture's ink from [`COARSE_PX`] to [`FINE_PX`], each twice as fine as the one before.
pub(super) struct Levels {
    pub(super) levels: Vec<Ink>,
    /// Pixels of the picture per pixel of the finest.
    pub(super) finest: f64,
}

impl Levels {
    pub(super) fn new(photo: &Photo) -> Self {
        let (width, height) = (photo.width_px as usize, photo.height_px as usize);
        let finest = width.max(height) as f64 / FINE_PX as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "to 1024")]
        let size = [width, height].map(|side| ((side as f64 / finest).round() as u32).max(1));
        let mut ink = Ink::new(photo, size);
        let mut levels = vec![ink.smoothed()];
        while ink.width.max(ink.height) > COARSE_PX {
            ink = ink.halved();
            levels.push(ink.smoothed());
        }
        levels.reverse();
        Self { levels, finest }
    }

    pub(super) fn at(&self, level: usize) -> &Ink {
        &self.levels[level]
    }

    pub(super) fn coarsest(&self) -> &Ink {
        &self.levels[0]
    }

    /// Pixels of the picture per pixel of a level.
    pub(super) fn factor(&self, level: usize) -> f64 {
        self.finest * libm::exp2((self.levels.len() - 1 - level) as f64)
    }
}

impl Ink {
    /// Luminance of a photo, in linear light, above that of its surroundings.
    fn new(photo: &Photo, [width, height]: [u32; 2]) -> Self {
        let light = srgb::linear_from_level();
        let luminance = |p: &[u8]| {
            let [r, g, b] = [0, 1, 2].map(|c| light[usize::from(p[c])]);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let values = photo.rgb8.chunks_exact(3).map(luminance).collect();
        let plane = Plane::from_raw(photo.width_px, photo.height_px, values);
        let plane = plane.expect("a photo has all of its pixels");
        let mut plane = imageops::resize(&plane, width, height, FilterType::Triangle);
        let around = imageops::blur(&plane, AROUND * width.max(height) as f32);
        for (value, around) in plane.iter_mut().zip(around.iter()) {
            *value = (*value - around - LEAST_INK).max(0.0);
        }
        Self::from_plane(&plane)
    }

    fn from_plane(plane: &Plane) -> Self {
        let [width, height] = [plane.width(), plane.height()].map(|side| side as usize);
        Self { width, height, values: plane.as_raw().clone() }
    }

    fn plane(&self) -> Plane {
        let [width, height] =
            [self.width, self.height].map(|side| u32::try_from(side).unwrap_or(1));
        Plane::from_raw(width, height, self.values.clone()).expect("all of its pixels")
    }

    /// Smoothed, for the slopes.
    fn smoothed(&self) -> Self {
        Self::from_plane(&imageops::blur(&self.plane(), SMOOTH_PX))
    }

    /// At half the size; an odd last row or column is left out.
    fn halved(&self) -> Self {
        let plane = self.plane();
        let [width, height] = [plane.width(), plane.height()].map(|side| (side / 2).max(1));
        let even = imageops::crop_imm(&plane, 0, 0, 2 * width, 2 * height).to_image();
        Self::from_plane(&imageops::resize(&even, width, height, FilterType::Triangle))
    }

    /// Value and slopes at a point, bilinear; `None` outside.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Option<[f64; 3]> {
        let (x, y) = (x - 0.5, y - 0.5);
        if !(x >= 0.0 && y >= 0.0) {
            return None;
        }
        let (i, j) = (whole(x), whole(y));
        if i + 1 >= self.width || j + 1 >= self.height {
            return None;
        }
        let (u, v) = (x - i as f64, y - j as f64);
        let first = j * self.width + i;
        let get = |index: usize| f64::from(self.values[index]);
        let (nw, ne) = (get(first), get(first + 1));
        let (sw, se) = (get(first + self.width), get(first + self.width + 1));
        let (north, south) = (nw + u * (ne - nw), sw + u * (se - sw));
        let slope_x = (1.0 - v) * (ne - nw) + v * (se - sw);
        Some([north + v * (south - north), slope_x, south - north])
    }
}
