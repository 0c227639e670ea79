//! Alignment: shift, scale and rotation at which the intended word correlates most with the photo.
//!
//! The place of a word does not matter to a viewer, so within limits it costs nothing. It is a
//! measure of the flight. Not modeled: shear and perspective (the camera is known).

use std::sync::{Arc, Mutex, PoisonError};

use kurbo::Vec2;

use super::plane::{Grid, Placed, SEARCH_H, SEARCH_SCALE};
use super::raster::{Page, Raster, dots, whole};
use super::{PEN_H, PX_PER_H};
use noctograph_core::strokes::Strokes;

/// Scales tried first, from the smallest to the largest.
const N_SCALES: i32 = 7;

/// First step of the search for the rotation. Its halves lead to twice as much.
const ROTATION_STEP_RAD: f64 = 5.0 * core::f64::consts::PI / 180.0;

/// Blur of both pictures: 0.1 H, so that a coarse grid of shifts catches the peak, then 0.05 H as
/// the reader's. More would let a wrong letter pull the word toward the next letter.
const BLURS_PX: [f32; 2] = [3.2, 1.6];

/// Pixels of words at scales and rotations that are kept: 1 MB, some dozens of a short word.
const MAX_KEPT_PX: usize = 1 << 18;

/// Width of the pen, in pixels.
#[expect(clippy::cast_possible_truncation, reason = "a constant")]
const PEN_PX: f32 = PEN_H as f32 * PX_PER_H as f32;

/// Search for one word.
pub(super) struct Finder {
    /// The grid that pictures must have.
    pub(super) grid: Grid,
    strokes: Strokes,
    home: Placed,
    /// The word at each of the scales tried first, at quarter resolution.
    coarse: Vec<(f64, Raster)>,
    /// The word at the first scales and rotations that were tried: most photos try the same.
    kept: Mutex<Vec<([f64; 2], Arc<Raster>)>>,
}

/// The picture that is searched for the word.
pub(super) struct Target {
    /// Less its mean.
    raster: Raster,
    norm: f32,
}

impl Finder {
    /// Prepares the search on a grid around the intended word.
    pub(super) fn new(strokes: &Strokes, home: Placed) -> Self {
        let grid = Grid::around(strokes, &home);
        let (coarse, kept) = (Vec::new(), Mutex::default());
        let mut finder = Self { grid, strokes: strokes.clone(), home, coarse, kept };
        finder.coarse = (0..N_SCALES)
            .map(|index| libm::pow(scale_step(), f64::from(index - N_SCALES / 2)))
            .map(|scale| (scale, finder.word(scale, 0.0, BLURS_PX[0]).half()))
            .collect();
        finder
    }

    /// Finds the word in a picture on the grid.
    pub(super) fn place(&self, picture: &Raster) -> Placed {
        // First all scales and shifts at quarter resolution, without rotation.
        let picture = picture.half();
        let coarse = Target::new(picture.blur(0.5 * BLURS_PX[0]).half());
        let half = Target::new(picture.blur(0.5 * BLURS_PX[1]));
        let mut best = (f32::NEG_INFINITY, 1.0, [0, 0]);
        let reach = whole(SEARCH_H * f64::from(PX_PER_H) / 4.0).cast_signed();
        for (scale, word) in &self.coarse {
            let (similarity, [dx, dy]) = coarse.seek(word, [0, 0], reach);
            if similarity > best.0 {
                best = (similarity, *scale, [2 * dx, 2 * dy]);
            }
        }

        // From the best of them at half resolution, pattern search (Hooke and Jeeves 1961): a step
        // to either side in scale and in rotation, each with its best shift, then half the step.
        let (mut scale, mut rotation_rad) = (best.1, 0.0);
        let word = self.word_to_try([scale, 0.0]);
        let (mut similarity, mut shift, mut between) =
            half.peak(&word, half.seek(&word, best.2, 2).1);
        let (mut ratio, mut turn_rad) = (scale_step(), 2.0 * ROTATION_STEP_RAD);
        // Until the ends of the word move by less than a pixel.
        while (ratio - 1.0).max(turn_rad) * 0.5 * self.grid.width as f64 > 1.0 {
            (ratio, turn_rad) = (ratio.sqrt(), 0.5 * turn_rad);
            let scales = [scale / ratio, scale * ratio].map(|scale| [scale, rotation_rad]);
            let turns = [-turn_rad, turn_rad].map(|turn_rad| [scale, rotation_rad + turn_rad]);
            for step in scales.into_iter().chain(turns) {
                let peak = half.peak(&self.word_to_try(step), shift);
                if peak.0 > similarity {
                    (similarity, shift, between) = peak;
                    [scale, rotation_rad] = step;
                }
            }
        }
        let [right, down] = [0, 1]
            .map(|axis| 2.0 * (shift[axis] as f64 + f64::from(between[axis])) * self.grid.pitch_m);
        Placed { shift_m: Vec2::new(right, -down), scale, rotation_rad, ..self.home }
    }

    /// The word at a scale and a rotation, kept if there is room.
    fn word_to_try(&self, pose: [f64; 2]) -> Arc<Raster> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().find(|(known, _)| *known == pose).map(|(_, word)| word.clone());
        // Other threads go on while this one draws.
        drop(kept);
        known.unwrap_or_else(|| {
            let word = Arc::new(self.word(pose[0], pose[1], BLURS_PX[1]));
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if (kept.len() + 1) * word.values.len() <= MAX_KEPT_PX {
                kept.push((pose, word.clone()));
            }
            word
        })
    }

    /// The intended word at half the grid's resolution, blurred by some of its pixels.
    fn word(&self, scale: f64, rotation_rad: f64, blur_px: f32) -> Raster {
        let mut page = Page::blank(self.grid.width / 2, self.grid.height / 2);
        let placed = Placed { scale, rotation_rad, ..self.home };
        let page_from_plane = self.grid.transform(&placed).post_scale(0.5, 0.5);
        for glyph in &self.strokes.glyphs {
            page.stroke(&glyph.moves, 0.5 * PEN_PX, page_from_plane);
        }
        page.dry().blur(0.5 * blur_px)
    }
}

/// Ratio of the scales tried first.
fn scale_step() -> f64 {
    libm::pow(SEARCH_SCALE, 2.0 / f64::from(N_SCALES - 1))
}

impl Target {
    pub(super) fn new(mut raster: Raster) -> Self {
        let mean = raster.values.iter().sum::<f32>() / raster.values.len() as f32;
        raster.values.iter_mut().for_each(|value| *value -= mean);
        let norm = dots([&raster.values], &raster.values)[0].sqrt();
        Self { raster, norm }
    }

    /// The best correlation and its shift, within a square around a shift.
    pub(super) fn seek(
        &self,
        word: &Raster,
        around: [isize; 2],
        reach: isize,
    ) -> (f32, [isize; 2]) {
        let per_norms = self.per_norms(word);
        // Normalized cross-correlation at each shift.
        let mut best = (f32::NEG_INFINITY, around);
        for down in around[1] - reach..=around[1] + reach {
            for right in around[0] - reach..=around[0] + reach {
                let similarity = self.product(word, [right, down]) * per_norms;
                if similarity > best.0 {
                    best = (similarity, [right, down]);
                }
            }
        }
        best
    }

    /// The peak of the correlation within a pixel around a shift, by a parabola along each axis.
    fn peak(&self, word: &Raster, around: [isize; 2]) -> (f32, [isize; 2], [f32; 2]) {
        let (similarity, shift) = self.seek(word, around, 1);
        let per_norms = self.per_norms(word);
        let mut top = similarity;
        let between = std::array::from_fn(|axis| {
            let beside = [-1, 1].map(|step| {
                let mut beside = shift;
                beside[axis] += step;
                self.product(word, beside) * per_norms
            });
            // Twice the first difference, and minus the second one, at the best shift.
            let (slope, bend) = (beside[1] - beside[0], 2.0 * similarity - beside[0] - beside[1]);
            if bend <= 0.0 {
                return 0.0;
            }
            let offset = (0.5 * slope / bend).clamp(-0.5, 0.5);
            top += 0.25 * offset * slope;
            offset
        });
        (top, shift, between)
    }

    /// 1 over the norms of picture and word, or 0 if nothing varies.
    fn per_norms(&self, word: &Raster) -> f32 {
        // The picture has mean 0. The word's norm is that of its deviations: Σw² − (Σw)² / n.
        let ones = vec![1.0; word.values.len()];
        let [sum, squares] = dots([&ones, &word.values], &word.values);
        let norm = (squares - sum * sum / word.values.len() as f32).max(0.0).sqrt() * self.norm;
        if norm > 0.0 { 1.0 / norm } else { 0.0 }
    }

    /// Sum of products with the word moved right and down. Parts off the page are lost.
    fn product(&self, word: &Raster, [right, down]: [isize; 2]) -> f32 {
        // On each axis: first pixel of the picture, first pixel of the word, number of pixels.
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
