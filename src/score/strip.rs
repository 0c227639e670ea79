//! A strip: one line of writing, upright and of fixed size, as the net reads it.

use std::ops::Range;

use super::color;
use super::light::{Light, Rgb, luminance};
use super::plane::{Grid, Placed};
use super::raster::{Raster, narrow, whole};
use super::view::View;

/// Pixels to a cap height.
pub(super) const CAP_PX: usize = 22;

/// Rows of a strip.
pub(super) const HEIGHT: usize = 40;

/// Row of the capitals' upper ends; their feet are at row 30.
pub(super) const HEAD_ROW: usize = 8;

/// Columns beside the first and the last letter, as in most strips that the net was trained on.
pub(super) const MARGIN_PX: usize = 13;

/// Columns beside the first and the last letter of a word where more letters are looked for: 1.5 H,
/// so that one more of any width is seen.
pub(super) const SIDE_PX: usize = 33;

/// Light that is darkened beside punctuation: 0.1 H, as wide as a pen.
const BESIDE_PX: f64 = 2.2;

/// Neighbors of a strip: height by its own, rows farther down, and exposure.
const NEIGHBORS: [(f64, f64, f32); 4] =
    [(1.1, -1.0, 0.7), (0.9, 1.0, 0.7), (1.05, 0.0, 0.45), (0.95, 0.0, 1.0)];

/// Light of a pixel from which a column of a strip may show a part of a letter, and so many pixels
/// of it: hot pixels are single ones.
const LIT: (f32, usize) = (0.15, 2);

/// Light from which a pixel shows a stroke, where the width of strokes is measured.
const STROKE_LIT: f32 = 0.4;

/// Share of the lit pixels that is narrower than a stroke: corners, blots and a wall are wider.
const STROKE_RANK: f64 = 0.2;

/// Half of the square of the opening, in widths of a stroke, and at least this many pixels.
const SOFT_REACH: (f64, usize) = (1.5, 3);

/// Factor at which light wider than the strokes is taken off: the top of a soft light is less wide
/// than its foot, and the foot was taken off with the sky.
const TAKEN: f32 = 3.0;

/// A line of writing: light from 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    /// Columns: an even number.
    pub(super) width: usize,
    /// How bright the light looks.
    pub(super) bright: Vec<f32>,
    /// Light in the color of the strokes.
    pub(super) pure: Vec<f32>,
    /// The columns that are read, from an even one to an even one.
    pub(super) read: Range<usize>,
}

impl Strip {
    /// The strip that a photo shows at a grid of [`HEIGHT`] rows.
    pub(super) fn cut(
        grid: &Grid,
        light: &Light,
        view: &View,
        placed: &Placed,
        ink_color: Rgb,
        full_light: f32,
    ) -> Self {
        let pure = color::pure(ink_color);
        let both = grid.resample(light, view, placed, |light| [luminance(light), pure(light), 0.0]);
        let [bright, pure] = [0, 1].map(|channel| {
            both.iter().map(|light| (light[channel] / full_light).clamp(0.0, 1.0)).collect()
        });
        Self::of_light(grid.width, bright, pure)
    }

    /// A strip of light that was seen, without its soft part.
    pub(super) fn of_light(width: usize, mut bright: Vec<f32>, mut pure: Vec<f32>) -> Self {
        take_off_soft_light(width, [&mut bright, &mut pure]);
        Self { width, bright, pure, read: 0..width }
    }

    /// A strip of drawn light.
    pub(super) fn drawn(width: usize, light: Vec<f32>) -> Self {
        Self { width, bright: light.clone(), pure: light, read: 0..width }
    }

    /// The same, read from the first to the last column with light alone, and the margin that the
    /// net knows: it knows no wide darkness, and sees letters in it.
    pub(super) fn where_lit(mut self) -> Self {
        let mut lit = (0..self.width).filter(|x| {
            let column = self.bright.iter().skip(*x).step_by(self.width);
            column.filter(|light| **light >= LIT.0).count() >= LIT.1
        });
        if let Some(first) = lit.next() {
            let last = lit.next_back().unwrap_or(first);
            let end = (last + 1 + MARGIN_PX).next_multiple_of(2).min(self.width);
            self.read = first.saturating_sub(MARGIN_PX) / 2 * 2..end;
        }
        self
    }

    /// Takes away the light between the sides of a box in the plane of the word, and a little
    /// beside them: punctuation is not read.
    pub(super) fn darken(&mut self, own: &Grid, [left_m, _, right_m, _]: [f64; 4]) {
        let beside_m = BESIDE_PX * own.pitch_m;
        let [first, end] = [left_m - beside_m, right_m + beside_m]
            .map(|x_m| whole(((x_m - own.left_m) / own.pitch_m).max(0.0)).min(self.width));
        for channel in [&mut self.bright, &mut self.pure] {
            for row in channel.chunks_exact_mut(self.width) {
                row[first..end].fill(0.0);
            }
        }
    }

    /// Adds to the light what a picture of a part of the same plane has more than another, or less;
    /// returns the columns of that part.
    pub(super) fn change(
        &mut self,
        own: &Grid,
        part: &Grid,
        before: &Raster,
        after: &Raster,
    ) -> Range<usize> {
        let ratio = own.pitch_m / part.pitch_m;
        let [left, top] =
            [(own.left_m - part.left_m) / part.pitch_m, (part.top_m - own.top_m) / part.pitch_m];
        let per_area = narrow(1.0 / (ratio * ratio));
        let mut change = after.clone();
        change.values.iter_mut().zip(&before.values).for_each(|(after, before)| *after -= before);
        let [first, last] =
            [0.0, part.width as f64].map(|x| whole(((x - left) / ratio).max(0.0)).min(self.width));
        let columns = first..(last + 1).min(self.width);
        let more = change.sums([left, top], ratio, columns.clone(), HEIGHT);
        for (row, more) in more.chunks(columns.len().max(1)).enumerate() {
            for channel in [&mut self.bright, &mut self.pure] {
                let lights = &mut channel[row * self.width..][columns.clone()];
                for (light, more) in lights.iter_mut().zip(more) {
                    *light = (*light + more * per_area).clamp(0.0, 1.0);
                }
            }
        }
        columns
    }

    /// Whether no pixel of some columns is lit.
    pub(super) fn is_dark(&self, columns: Range<usize>) -> bool {
        let columns = columns.start..columns.end.min(self.width);
        let mut rows = self.bright.chunks_exact(self.width);
        rows.all(|row| row[columns.clone()].iter().all(|light| *light < LIT.0))
    }

    /// What the strip would be a little larger or smaller, higher or lower, and exposed less: the
    /// same light, for which one reading is expected.
    pub(super) fn neighbors(&self) -> [Self; 4] {
        NEIGHBORS.map(|(height, down_px, exposure)| {
            let [bright, pure] = [&self.bright, &self.pure].map(|light| {
                let mut moved = stretched(light, self.width, height, down_px);
                moved.iter_mut().for_each(|light| *light *= exposure);
                moved
            });
            Self { bright, pure, ..self.clone() }
        })
    }

    /// The net's input, of some columns: both channels of each pixel, as square roots.
    #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
    pub(super) fn bytes(&self, columns: Range<usize>) -> Vec<u8> {
        let rows = self.bright.chunks_exact(self.width).zip(self.pure.chunks_exact(self.width));
        let mut bytes = Vec::with_capacity(columns.len() * HEIGHT);
        noctograph_core::dispatch!(|| for (bright, pure) in rows {
            let pixels = bright[columns.clone()].iter().zip(&pure[columns.clone()]);
            bytes.extend(pixels.map(|(bright, pure)| {
                [bright, pure].map(|light| (255.0 * light.sqrt()).round() as u8)
            }));
        });
        bytes.into_flattened()
    }
}

/// Light stretched about the middle of the capitals and moved down, between the middles of rows;
/// outside is dark.
fn stretched(light: &[f32], width: usize, height: f64, down_px: f64) -> Vec<f32> {
    let middle = HEAD_ROW as f64 + 0.5 * CAP_PX as f64 - 0.5;
    let mut moved = vec![0.0; light.len()];
    for (y, row) in moved.chunks_exact_mut(width).enumerate() {
        let from = (y as f64 - middle - down_px) / height + middle;
        let below = narrow(from - from.floor());
        for (near, share) in [(from.floor(), 1.0 - below), (from.floor() + 1.0, below)] {
            if (0.0..HEIGHT as f64).contains(&near) {
                let near = &light[whole(near) * width..][..width];
                row.iter_mut().zip(near).for_each(|(to, from)| *to += share * from);
            }
        }
    }
    moved
}

/// Takes soft light off the channels of a strip, whose first one is how bright the light looks: a
/// lit wall or a glow, which is wider than the strokes.
///
/// An opening, the maximum over squares of the minimum in each, keeps what is wider than the square
/// and loses the strokes: it is taken off the light.
fn take_off_soft_light(width: usize, channels: [&mut Vec<f32>; 2]) {
    let reach = whole((SOFT_REACH.0 * stroke_px(channels[0], width)).ceil()).max(SOFT_REACH.1);
    for light in channels {
        let soft = noctograph_core::dispatch!(|| {
            let least = over_squares(light, width, reach, f32::min);
            over_squares(&least, width, reach, f32::max)
        });
        for (light, soft) in light.iter_mut().zip(soft) {
            *light = (*light - TAKEN * soft).max(0.0);
        }
    }
}

/// Width of most strokes: the shorter of the lit runs along the row and the column of a pixel.
fn stroke_px(light: &[f32], width: usize) -> f64 {
    let height = light.len() / width;
    let mut run = vec![usize::MAX; light.len()];
    let rows = (0..height).map(|y| (y * width..(y + 1) * width).step_by(1));
    for line in rows.chain((0..width).map(|x| (x..light.len()).step_by(width))) {
        let mut current: Vec<usize> = Vec::new();
        for pixel in line.map(Some).chain([None]) {
            match pixel.filter(|pixel| light[*pixel] >= STROKE_LIT) {
                Some(pixel) => current.push(pixel),
                None => {
                    let length = current.len();
                    current.drain(..).for_each(|pixel| run[pixel] = run[pixel].min(length));
                }
            }
        }
    }
    let mut runs: Vec<usize> = run.into_iter().filter(|length| *length < usize::MAX).collect();
    if runs.is_empty() {
        return 0.0;
    }
    let rank = whole(STROKE_RANK * runs.len() as f64);
    *runs.select_nth_unstable(rank).1 as f64
}

/// The least or the greatest of the pixels in the square around each.
#[inline(always)]
fn over_squares(
    light: &[f32],
    width: usize,
    reach: usize,
    pick: impl Fn(f32, f32) -> f32,
) -> Vec<f32> {
    let take = |values: &mut [f32], near: &[f32]| {
        values.iter_mut().zip(near).for_each(|(value, near)| *value = pick(*value, *near));
    };
    let mut rows = light.to_vec();
    for (row, light) in rows.chunks_exact_mut(width).zip(light.chunks_exact(width)) {
        for away in 1..(reach + 1).min(width) {
            take(&mut row[away..], light);
            take(row, &light[away..]);
        }
    }
    let mut squares = rows.clone();
    for away in (1..=reach).map(|rows| rows * width).take_while(|away| *away < light.len()) {
        take(&mut squares[away..], &rows);
        take(&mut squares, &rows[away..]);
    }
    squares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbors_show_the_same_light_elsewhere() {
        let middle = HEAD_ROW + CAP_PX / 2;
        let [row, below] = [middle, middle + 1].map(|lit| {
            (0..2 * HEIGHT)
                .map(|pixel| if pixel / 2 == lit { 1.0 } else { 0.0 })
                .collect::<Vec<f32>>()
        });
        assert_eq!(stretched(&row, 2, 1.0, 0.0), row, "as it is");
        assert_eq!(stretched(&row, 2, 1.0, 1.0), below, "a row lower");
        let larger = stretched(&row, 2, 1.1, 0.0);
        assert!((larger.iter().sum::<f32>() - 2.2).abs() < 0.1, "a tenth higher: {larger:?}");
        let light = [0.8; 2 * HEIGHT].to_vec();
        let strip = Strip::drawn(2, light);
        let least = strip.neighbors().map(|strip| strip.bright[2 * middle]);
        assert!(least.iter().all(|light| (0.3..=0.8).contains(light)), "{least:?}");
    }
}
