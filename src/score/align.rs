//! Where the word hangs: the shift, scale and rotation at which the intended word resembles the
//! photo most.
//!
//! A reader does not care where a word hangs, so its place costs nothing within the limits and is
//! reported for the flight's sake. Not sought: shear and perspective (the camera is known).

use super::ink::Page;
use super::plane::{Grid, Placed};
use super::raster::{Raster, dots};
use super::{PEN_PX, PX_PER_H};
use crate::letters::Strokes;

/// Farthest that the word is sought from its place, in cap heights: a little beyond what counts as
/// in range, so that a word out of range is seen to be there.
pub(super) const SEARCH_H: f64 = 0.75;

/// Largest scale that is tried; the smallest is its inverse.
pub(super) const SEARCH_SCALE: f64 = 1.25;

/// Scales tried first, from the smallest to the largest.
const N_SCALES: i32 = 7;

/// First step of the search for the rotation; halved until the ends of the word hardly move, it
/// leads to twice as much.
const ROTATION_STEP_RAD: f64 = 5.0 * core::f64::consts::PI / 180.0;

/// Blur of both pictures: 0.1 H, twice the reader's, so that a coarse grid of shifts catches the
/// peak.
const BLUR_PX: f32 = 3.2;

/// The picture that the word is sought in.
struct Target {
    /// Less its mean.
    raster: Raster,
    norm: f32,
}

/// Finds the word in a picture that a grid around the intended word shows.
pub(super) fn place(picture: &Raster, grid: &Grid, strokes: &Strokes, home: &Placed) -> Placed {
    let full = Target::new(picture.blur(BLUR_PX));
    let coarse = Target::new(full.raster.half().half());
    let word = |scale: f64, rotation_rad: f64| {
        let mut page = Page::blank(grid.width, grid.height);
        let page_from_plane = grid.page_from_plane(&Placed { scale, rotation_rad, ..*home });
        for glyph in &strokes.glyphs {
            page.stroke(&glyph.moves, PEN_PX, page_from_plane);
        }
        page.dry().blur(BLUR_PX)
    };

    let step = libm::pow(SEARCH_SCALE, 2.0 / f64::from(N_SCALES - 1));
    let mut best = (f32::NEG_INFINITY, 1.0, [0, 0]);
    #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
    let reach = (SEARCH_H * f64::from(PX_PER_H) / 4.0) as isize;
    for index in 0..N_SCALES {
        let scale = libm::pow(step, f64::from(index - N_SCALES / 2));
        let (similarity, [dx, dy]) = coarse.seek(&word(scale, 0.0).half().half(), [0, 0], reach);
        if similarity > best.0 {
            best = (similarity, scale, [4 * dx, 4 * dy]);
        }
    }

    let (mut scale, mut rotation_rad) = (best.1, 0.0);
    let (mut similarity, mut shift) = full.seek(&word(scale, 0.0), best.2, 3);
    let (mut ratio, mut turn_rad) = (step, 2.0 * ROTATION_STEP_RAD);
    // Finer until the ends of the word move by less than a pixel.
    while (ratio - 1.0).max(turn_rad) * 0.5 * grid.width as f64 > 1.0 {
        (ratio, turn_rad) = (ratio.sqrt(), 0.5 * turn_rad);
        let at = (scale, rotation_rad);
        let tries = [
            (at.0 / ratio, at.1),
            (at.0 * ratio, at.1),
            (at.0, at.1 - turn_rad),
            (at.0, at.1 + turn_rad),
        ];
        for tried in tries {
            let found = full.seek(&word(tried.0, tried.1), shift, 1);
            if found.0 > similarity {
                (similarity, shift) = found;
                (scale, rotation_rad) = tried;
            }
        }
    }
    let [right, down] = shift.map(|pixels| pixels as f64 * grid.pitch_m);
    Placed { shift_m: [right, -down], scale, rotation_rad, ..*home }
}

impl Target {
    fn new(mut raster: Raster) -> Self {
        let mean = raster.values.iter().sum::<f32>() / raster.values.len() as f32;
        raster.values.iter_mut().for_each(|value| *value -= mean);
        let norm = dots([&raster.values], &raster.values)[0].sqrt();
        Self { raster, norm }
    }

    /// The best correlation and its shift, within a square around a shift.
    fn seek(&self, word: &Raster, around: [isize; 2], reach: isize) -> (f32, [isize; 2]) {
        let [sum, squares] = {
            let ones = vec![1.0; word.values.len()];
            dots([&ones, &word.values], &word.values)
        };
        let norm = (squares - sum * sum / word.values.len() as f32).max(0.0).sqrt() * self.norm;
        let mut best = (f32::NEG_INFINITY, around);
        for down in around[1] - reach..=around[1] + reach {
            for right in around[0] - reach..=around[0] + reach {
                let product = self.product(word, [right, down]);
                let similarity = if norm > 0.0 { product / norm } else { 0.0 };
                if similarity > best.0 {
                    best = (similarity, [right, down]);
                }
            }
        }
        best
    }

    /// Sum of products with the word moved right and down; what leaves the page is lost.
    fn product(&self, word: &Raster, [right, down]: [isize; 2]) -> f32 {
        let (width, height) = (word.width, word.height);
        let overlap = |shift: isize, side: usize| {
            let length = side.saturating_sub(shift.unsigned_abs());
            (shift.max(0).unsigned_abs(), shift.min(0).unsigned_abs(), length)
        };
        let (x, word_x, n_columns) = overlap(right, width);
        let (y, word_y, n_rows) = overlap(down, height);
        (0..n_rows)
            .map(|row| {
                let here = &self.raster.values[(y + row) * width + x..][..n_columns];
                let there = &word.values[(word_y + row) * width + word_x..][..n_columns];
                dots([here], there)[0]
            })
            .sum()
    }
}
