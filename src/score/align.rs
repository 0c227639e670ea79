//! Aligns the intended word with a photo: finds the shift, scale and rotation with the highest
//! correlation.
//!
//! Within limits, a displaced word is not penalized, because readers do not mind displacement.
//! Shear and perspective are not modeled, because the camera is known.

use std::sync::{Arc, Mutex, PoisonError};

use kurbo::Vec2;

use super::plane::{Grid, Placed, SEARCH_H, SEARCH_SCALE};
use super::raster::{Page, Raster, dots, whole};
use super::{PEN_H, PX_PER_H};
use noctograph_core::strokes::Strokes;

/// Number of scales in the coarse search.
const N_SCALES: i32 = 7;

/// Initial step of the rotation search. The steps are halved, so their sum is twice the first one.
const ROTATION_STEP_RAD: f64 = 5.0 * core::f64::consts::PI / 180.0;

/// Blur of both pictures: first 0.1 cap heights, so that a coarse grid of shifts hits the peak, and
/// then the reader's 0.05. With more blur, the next letter could attract the word.
const BLURS_PX: [f32; 2] = [3.2, 1.6];

/// Maximum size of the cache of drawn words, in pixels. 1 MB is enough for dozens of short words.
const MAX_CACHED_PX: usize = 1 << 18;

/// Width of the pen, in pixels.
#[expect(clippy::cast_possible_truncation, reason = "a constant")]
const PEN_PX: f32 = PEN_H as f32 * PX_PER_H as f32;

/// A search for one word.
pub(super) struct Finder {
    /// Pixel grid of every picture that is searched.
    pub(super) grid: Grid,
    strokes: Strokes,
    home: Placed,
    /// The word at each scale of the coarse search, at quarter resolution.
    coarse: Vec<(f64, Raster)>,
    /// Cache of drawn words by scale and rotation, because most photos need the same drawings.
    cache: Mutex<Vec<([f64; 2], Arc<Raster>)>>,
}

/// A picture that is searched for the word.
pub(super) struct Target {
    /// The picture after its mean was subtracted.
    raster: Raster,
    norm: f32,
}

impl Finder {
    /// Prepares the search on a grid around the intended word.
    pub(super) fn new(strokes: &Strokes, home: Placed) -> Self {
        let grid = Grid::around(strokes, &home);
        let (coarse, cache) = (Vec::new(), Mutex::default());
        let mut finder = Self { grid, strokes: strokes.clone(), home, coarse, cache };
        finder.coarse = (0..N_SCALES)
            .map(|index| libm::pow(scale_step(), f64::from(index - N_SCALES / 2)))
            .map(|scale| (scale, finder.word(scale, 0.0, BLURS_PX[0]).half()))
            .collect();
        finder
    }

    /// Returns the placement at which the word correlates most with a picture of the grid, whose
    /// pixels are the light from 0 to 1.
    pub(super) fn place(&self, picture: &Raster) -> Placed {
        let picture = picture.half();
        let coarse = Target::new(picture.blur(0.5 * BLURS_PX[0]).half());
        let (mut scale, coarse_shift) = self.coarse_placement(&coarse);
        let half = Target::new(picture.blur(0.5 * BLURS_PX[1]));
        // Pattern search (Hooke and Jeeves 1961) at half resolution: it tries a step to either side
        // in scale and rotation, finds the best shift for each, and halves the step.
        let mut rotation_rad = 0.0;
        let word = self.word_to_try([scale, rotation_rad]);
        let (mut similarity, mut shift, mut fraction_px) =
            half.peak(&word, half.best_shift(&word, coarse_shift, 2).1);
        let (mut scale_ratio, mut rotation_step_rad) = (scale_step(), 2.0 * ROTATION_STEP_RAD);
        // The search ends when a step would move the ends of the word by less than a pixel.
        while (scale_ratio - 1.0).max(rotation_step_rad) * 0.5 * self.grid.width as f64 > 1.0 {
            (scale_ratio, rotation_step_rad) = (scale_ratio.sqrt(), 0.5 * rotation_step_rad);
            let scales =
                [scale / scale_ratio, scale * scale_ratio].map(|scale| [scale, rotation_rad]);
            let rotations =
                [-rotation_step_rad, rotation_step_rad].map(|step| [scale, rotation_rad + step]);
            for pose in scales.into_iter().chain(rotations) {
                let peak = half.peak(&self.word_to_try(pose), shift);
                if peak.0 > similarity {
                    (similarity, shift, fraction_px) = peak;
                    [scale, rotation_rad] = pose;
                }
            }
        }
        // One pixel at half resolution is two pixels of the grid.
        let [right, down] = [0, 1].map(|axis| {
            2.0 * (shift[axis] as f64 + f64::from(fraction_px[axis])) * self.grid.pitch_m
        });
        Placed { shift_m: Vec2::new(right, -down), scale, rotation_rad, ..self.home }
    }

    /// Returns the best scale without rotation, and its shift to the right and down in pixels at
    /// half resolution. `quarter` is the picture at quarter resolution.
    fn coarse_placement(&self, quarter: &Target) -> (f64, [isize; 2]) {
        let mut best = (f32::NEG_INFINITY, 1.0, [0, 0]);
        // Maximum shift in pixels at quarter resolution.
        let reach = whole(SEARCH_H * f64::from(PX_PER_H) / 4.0).cast_signed();
        for (scale, word) in &self.coarse {
            let (similarity, [dx, dy]) = quarter.best_shift(word, [0, 0], reach);
            if similarity > best.0 {
                best = (similarity, *scale, [2 * dx, 2 * dy]);
            }
        }
        (best.1, best.2)
    }

    /// Returns the word in a pose `[scale, rotation in rad]`, either from the cache or newly drawn,
    /// at half the grid's resolution.
    fn word_to_try(&self, pose: [f64; 2]) -> Arc<Raster> {
        let cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        let cached = cache.iter().find(|(cached, _)| *cached == pose).map(|(_, word)| word.clone());
        // The lock is released while this thread draws, so that other threads continue.
        drop(cache);
        cached.unwrap_or_else(|| {
            let word = Arc::new(self.word(pose[0], pose[1], BLURS_PX[1]));
            let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
            if (cache.len() + 1) * word.values.len() <= MAX_CACHED_PX {
                cache.push((pose, word.clone()));
            }
            word
        })
    }

    /// Draws the intended word at half the grid's resolution, blurred by `blur_px` grid pixels.
    fn word(&self, scale: f64, rotation_rad: f64, blur_px: f32) -> Raster {
        let mut page = Page::blank(self.grid.width / 2, self.grid.height / 2);
        let placed = Placed { scale, rotation_rad, ..self.home };
        let page_from_plane = self.grid.transform(&placed).post_scale(0.5, 0.5);
        for glyph in &self.strokes.glyphs {
            page.stroke(&glyph.moves, 0.5 * PEN_PX, page_from_plane);
        }
        page.into_raster().blur(0.5 * blur_px)
    }
}

/// Returns the ratio between neighboring scales of the coarse search.
fn scale_step() -> f64 {
    libm::pow(SEARCH_SCALE, 2.0 / f64::from(N_SCALES - 1))
}

impl Target {
    /// Prepares a picture for the search by subtracting its mean.
    pub(super) fn new(mut raster: Raster) -> Self {
        let mean = raster.values.iter().sum::<f32>() / raster.values.len() as f32;
        raster.values.iter_mut().for_each(|value| *value -= mean);
        let norm = dots([&raster.values], &raster.values)[0].sqrt();
        Self { raster, norm }
    }

    /// Returns the greatest correlation, up to 1, and its shift to the right and down, at most
    /// `reach` pixels from `around` on each axis.
    pub(super) fn best_shift(
        &self,
        word: &Raster,
        around: [isize; 2],
        reach: isize,
    ) -> (f32, [isize; 2]) {
        let inverse_norms = self.inverse_norms(word);
        // Normalized cross-correlation at each shift.
        let mut best = (f32::NEG_INFINITY, around);
        for down in around[1] - reach..=around[1] + reach {
            for right in around[0] - reach..=around[0] + reach {
                let similarity = self.sum_of_products(word, [right, down]) * inverse_norms;
                if similarity > best.0 {
                    best = (similarity, [right, down]);
                }
            }
        }
        best
    }

    /// Returns the peak of the correlation within one pixel of a shift: its height up to 1, its
    /// shift in whole pixels, and the fraction of a pixel at the vertex of a parabola along each
    /// axis.
    fn peak(&self, word: &Raster, around: [isize; 2]) -> (f32, [isize; 2], [f32; 2]) {
        let (similarity, shift) = self.best_shift(word, around, 1);
        let inverse_norms = self.inverse_norms(word);
        let mut top = similarity;
        let fraction_px = std::array::from_fn(|axis| {
            let beside = [-1, 1].map(|step| {
                let mut shifted = shift;
                shifted[axis] += step;
                self.sum_of_products(word, shifted) * inverse_norms
            });
            // `slope` is twice the central difference, and `bend` is minus the second difference.
            let (slope, bend) = (beside[1] - beside[0], 2.0 * similarity - beside[0] - beside[1]);
            if bend <= 0.0 {
                return 0.0;
            }
            let offset = (0.5 * slope / bend).clamp(-0.5, 0.5);
            top += 0.25 * offset * slope;
            offset
        });
        (top, shift, fraction_px)
    }

    /// Returns 1 divided by the product of both norms, or 0 if picture or word is uniform. Times
    /// the sum of products, this is the correlation.
    fn inverse_norms(&self, word: &Raster) -> f32 {
        // The picture's mean is 0. The squared norm of the word's deviations is Σw² − (Σw)² / n.
        let ones = vec![1.0; word.values.len()];
        let [sum, squares] = dots([&ones, &word.values], &word.values);
        let norm = (squares - sum * sum / word.values.len() as f32).max(0.0).sqrt() * self.norm;
        if norm > 0.0 { 1.0 / norm } else { 0.0 }
    }

    /// Returns the sum of the products of the picture and the shifted word where they overlap. The
    /// shift is to the right and down in pixels.
    fn sum_of_products(&self, word: &Raster, [right, down]: [isize; 2]) -> f32 {
        // The overlap on each axis: first pixel in the picture, first pixel in the word, and size.
        let width = word.width;
        let overlaps = [(right, width), (down, word.height)].map(|(shift, side)| {
            let length = side.saturating_sub(shift.unsigned_abs());
            (shift.max(0).unsigned_abs(), shift.min(0).unsigned_abs(), length)
        });
        let [(x, word_x, n_columns), (y, word_y, n_rows)] = overlaps;
        (0..n_rows)
            .map(|row| {
                let here = &self.raster.values[(y + row) * width + x..][..n_columns];
                let there = &word.values[(word_y + row) * width + word_x..][..n_columns];
                dots([here], there)[0]
            })
            .sum()
    }
}
