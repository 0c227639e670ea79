//! Light of a picture above its surroundings, to register it by, from coarse to fine.

use crate::photo::Photo;
use crate::{narrow, whole};
use noctograph_core::srgb;

/// Longer side of the coarsest and of the finest picture.
const COARSE_PX: usize = 64;
const FINE_PX: usize = 1024;

/// Light that does not count: a third of level 1, more than rounding leaves of an even picture.
const LEAST_INK: f32 = 1e-4;

/// Light above that of its surroundings.
#[derive(Clone, Debug)]
pub(super) struct LightMap {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

/// A picture's light from [`COARSE_PX`] to [`FINE_PX`], each twice as fine as the one before.
pub(super) struct Levels {
    pub(super) levels: Vec<LightMap>,
    /// Pixels of the picture per pixel of the finest.
    pub(super) finest: f64,
}

impl Levels {
    pub(super) fn new(photo: &Photo) -> Self {
        let (width, height) = (photo.width_px as usize, photo.height_px as usize);
        let finest = width.max(height) as f64 / FINE_PX as f64;
        let size = [width, height].map(|side| whole((side as f64 / finest).round()).max(1));
        let mut ink = LightMap::new(photo, size);
        let mut levels = vec![ink.blurred(1)];
        while ink.width.max(ink.height) > COARSE_PX {
            ink = ink.halved();
            levels.push(ink.blurred(1));
        }
        levels.reverse();
        Self { levels, finest }
    }

    /// Pixels of the picture per pixel of a level.
    pub(super) fn factor(&self, level: usize) -> f64 {
        self.finest * libm::exp2((self.levels.len() - 1 - level) as f64)
    }
}

impl LightMap {
    /// Luminance of a photo, in linear light, above that of its surroundings.
    fn new(photo: &Photo, [width, height]: [usize; 2]) -> Self {
        let light = srgb::linear_from_level();
        let full = [photo.width_px as usize, photo.height_px as usize];
        let luminance = |p: &[u8]| srgb::luminance_f32([0, 1, 2].map(|c| light[usize::from(p[c])]));
        // Means over the pixels within each pixel; those of a small picture are repeated.
        let range = |i: usize, n: usize, all: usize| {
            let first = i * all / n;
            first..((i + 1) * all / n).max(first + 1)
        };
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let rows = range(y, height, full[1]);
            for x in 0..width {
                let columns = range(x, width, full[0]);
                let n = (rows.len() * columns.len()) as f32;
                let pixels = rows.clone().flat_map(|y| {
                    let row = &photo.rgb8[3 * y * full[0]..][3 * columns.start..3 * columns.end];
                    row.chunks_exact(3).map(luminance)
                });
                values.push(pixels.sum::<f32>() / n);
            }
        }
        let mut ink = Self { width, height, values };
        let around = ink.blurred(width.max(height) / 32).blurred(width.max(height) / 32);
        for (value, around) in ink.values.iter_mut().zip(around.values) {
            *value = (*value - around - LEAST_INK).max(0.0);
        }
        ink
    }

    /// Means over squares of `2 radius + 1` pixels, without those outside.
    fn blurred(&self, radius: usize) -> Self {
        let along = |ink: &Self| {
            // Blurs along rows, and transposes.
            let mut values = vec![0.0; ink.values.len()];
            for (y, row) in ink.values.chunks_exact(ink.width).enumerate() {
                let mut sum: f64 = row.iter().take(radius).map(|v| f64::from(*v)).sum();
                for x in 0..ink.width {
                    let get = |x: usize| row.get(x).map_or(0.0, |v| f64::from(*v));
                    sum += get(x + radius);
                    if x > radius {
                        sum -= get(x - radius - 1);
                    }
                    let inside = (x + radius).min(ink.width - 1) - x.saturating_sub(radius) + 1;
                    values[x * ink.height + y] = narrow(sum / inside as f64);
                }
            }
            Self { width: ink.height, height: ink.width, values }
        };
        along(&along(self))
    }

    /// Means of 2 × 2 pixels; an odd last row or column is left out.
    fn halved(&self) -> Self {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let at = |x: usize, y: usize| {
            self.values[y.min(self.height - 1) * self.width + x.min(self.width - 1)]
        };
        let quad =
            |x: usize, y: usize| 0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1));
        let row = |y: usize| (0..width).map(move |x| quad(2 * x, 2 * y));
        Self { width, height, values: (0..height).flat_map(row).collect() }
    }

    /// The middle of a pixel.
    pub(super) fn middle(&self, index: usize) -> [f64; 2] {
        [(index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5]
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
