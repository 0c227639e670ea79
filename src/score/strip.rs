//! A strip is the net's input: one line of writing, upright and of fixed height.

use std::ops::Range;

use kurbo::Point;

use super::color;
use super::light::{Light, Rgb, luminance};
use super::plane::{Grid, Placed};
use super::raster::{Raster, narrow, whole};
use super::view::View;

/// Cap height in a strip, in pixels.
pub(super) const CAP_PX: usize = 22;

/// Number of rows in a strip.
pub(super) const HEIGHT: usize = 40;

/// Row at the top of capitals. The baseline is at row 30.
pub(super) const HEAD_ROW: usize = 8;

/// Number of columns before the first letter and after the last one, as in most strips on which the
/// net was trained.
pub(super) const MARGIN_PX: usize = 13;

/// Number of columns on each side of a word in which extra letters are searched: the widest letter.
pub(super) const SIDE_PX: usize = 33;

/// Width of the light removed beside punctuation, in pixels: 0.1 cap heights, a pen's width.
const BESIDE_PX: f64 = 2.2;

/// Relative height, downward shift in pixels, and relative exposure of each neighbor of a strip.
const NEIGHBORS: [(f64, f64, f32); 4] =
    [(1.1, -1.0, 0.7), (0.9, 1.0, 0.7), (1.05, 0.0, 0.45), (0.95, 0.0, 1.0)];

/// Minimum level of a lit pixel, and minimum number of such pixels in a lit column.
/// One pixel is not enough, because it may be a hot pixel.
const LIT: (f32, usize) = (0.15, 2);

/// Minimum level at which a pixel is used to measure the stroke width.
const STROKE_LIT: f32 = 0.4;

/// Quantile of the widths at lit pixels that is taken as stroke width. Corners and spots are wider.
const STROKE_RANK: f64 = 0.2;

/// Half-width of the opening's square, in stroke widths, and its minimum in pixels.
const SOFT_REACH: (f64, usize) = (1.5, 3);

/// Factor by which soft light is multiplied before it is subtracted. The factor exceeds 1 because
/// part of that light was already subtracted with the sky.
const SUBTRACTED: f32 = 3.0;

/// A line of writing, as light from 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    /// Number of columns, which is even.
    pub(super) width: usize,
    /// Luminance of each pixel, row by row.
    pub(super) bright: Vec<f32>,
    /// Light in the color of the strokes, row by row.
    pub(super) pure: Vec<f32>,
    /// The columns that are read. Both limits of the range are even.
    pub(super) read: Range<usize>,
}

impl Strip {
    /// Returns the luminance and the light in the color of the strokes of each pixel.
    pub(super) fn channels(light: &Light, ink_color: Rgb) -> Light {
        let in_color = color::pure(ink_color);
        light.measured(|light| [luminance(light), in_color(light), 0.0])
    }

    /// Cuts out the strip at a grid of [`HEIGHT`] rows, from the [`Self::channels`] of a photo's
    /// light. Light is relative to the fully lit level `full_light`.
    pub(super) fn cut(
        grid: &Grid,
        channels: &Light,
        view: &View,
        placed: &Placed,
        full_light: f32,
    ) -> Self {
        let both = grid.resample(channels, view, placed, |light| light);
        let [bright, pure] = [0, 1].map(|channel| {
            both.iter().map(|light| (light[channel] / full_light).clamp(0.0, 1.0)).collect()
        });
        Self::of_light(grid.width, bright, pure)
    }

    /// Creates a strip from light, and subtracts soft light from it.
    pub(super) fn of_light(width: usize, mut bright: Vec<f32>, mut pure: Vec<f32>) -> Self {
        subtract_soft_light(width, [&mut bright, &mut pure]);
        Self { width, bright, pure, read: 0..width }
    }

    /// Creates a strip from drawn light, which contains no soft light.
    pub(super) fn drawn(width: usize, light: Vec<f32>) -> Self {
        Self { width, bright: light.clone(), pure: light, read: 0..width }
    }

    /// Limits reading to lit columns and a margin, because the net sees letters in wide dark areas.
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

    /// Removes the light between two positions in the word's plane, and slightly beyond them.
    pub(super) fn darken(&mut self, grid: &Grid, [left_m, _, right_m, _]: [f64; 4]) {
        let beside_m = BESIDE_PX * grid.pitch_m;
        let [first, end] = [left_m - beside_m, right_m + beside_m]
            .map(|x_m| whole(((x_m - grid.left_m) / grid.pitch_m).max(0.0)).min(self.width));
        for channel in [&mut self.bright, &mut self.pure] {
            for row in channel.chunks_exact_mut(self.width) {
                row[first..end].fill(0.0);
            }
        }
    }

    /// Adds the difference between two pictures of grid `part`. Returns the changed columns.
    pub(super) fn change(
        &mut self,
        grid: &Grid,
        part: &Grid,
        before: &Raster,
        after: &Raster,
    ) -> Range<usize> {
        // Computes corner and pixel size of the strip's grid, in pixels of the pictures.
        let ratio = grid.pitch_m / part.pitch_m;
        let Point { x: left, y: top } = part.page_from_plane(Point::new(grid.left_m, grid.top_m));
        let per_area = narrow(1.0 / (ratio * ratio));
        let mut change = after.clone();
        change.values.iter_mut().zip(&before.values).for_each(|(after, before)| *after -= before);
        // Selects the columns of the strip that overlap the pictures.
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

    /// True if the columns have no lit pixel.
    pub(super) fn is_dark(&self, columns: Range<usize>) -> bool {
        let columns = columns.start..columns.end.min(self.width);
        let mut rows = self.bright.chunks_exact(self.width);
        rows.all(|row| row[columns.clone()].iter().all(|light| *light < LIT.0))
    }

    /// Returns copies of the strip that are slightly scaled, shifted or darkened.
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

    /// Returns the net's input for some columns: the square roots of the channels, as bytes.
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

/// Stretches light vertically by the factor `height` about the middle of the capitals, and moves it
/// down by `down_px`. Rows from outside the strip are dark.
fn stretched(light: &[f32], width: usize, height: f64, down_px: f64) -> Vec<f32> {
    let middle = HEAD_ROW as f64 + 0.5 * CAP_PX as f64 - 0.5;
    let mut moved = vec![0.0; light.len()];
    for (y, row) in moved.chunks_exact_mut(width).enumerate() {
        let from = (y as f64 - middle - down_px) / height + middle;
        let below = narrow(from - from.floor());
        for (near, weight) in [(from.floor(), 1.0 - below), (from.floor() + 1.0, below)] {
            if (0.0..HEIGHT as f64).contains(&near) {
                let near = &light[whole(near) * width..][..width];
                row.iter_mut().zip(near).for_each(|(to, from)| *to += weight * from);
            }
        }
    }
    moved
}

/// Subtracts soft light, such as from a lit wall or a glow. Both channels are row by row in rows of
/// `width`. The first channel must be luminance.
fn subtract_soft_light(width: usize, channels: [&mut Vec<f32>; 2]) {
    // An opening (Serra 1982) computes the minimum over squares and then the maximum of these
    // minima. Opening keeps light that is wider than the square, but not strokes.
    let reach = whole((SOFT_REACH.0 * stroke_px(channels[0], width)).ceil()).max(SOFT_REACH.1);
    for light in channels {
        let soft = noctograph_core::dispatch!(|| {
            let least = over_squares(light, width, reach, f32::min);
            over_squares(&least, width, reach, f32::max)
        });
        for (light, soft) in light.iter_mut().zip(soft) {
            *light = (*light - SUBTRACTED * soft).max(0.0);
        }
    }
}

/// Returns the width of strokes in pixels. The width is a low quantile, over all lit pixels, of the
/// shorter of the two lit runs through the pixel, along its row and along its column.
fn stroke_px(light: &[f32], width: usize) -> f64 {
    let height = light.len() / width;
    // Visits the pixels of each row, and then those of each column.
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

/// Combines the values in each pixel's square with `pick`, which selects the minimum or maximum.
/// The square extends `reach` pixels to each side.
#[inline(always)]
fn over_squares(
    light: &[f32],
    width: usize,
    reach: usize,
    pick: impl Fn(f32, f32) -> f32,
) -> Vec<f32> {
    let pick_neighbors = |values: &mut [f32], near: &[f32]| {
        values.iter_mut().zip(near).for_each(|(value, near)| *value = pick(*value, *near));
    };
    // Squares are separable, so rows are combined first and columns second.
    let mut rows = light.to_vec();
    for (row, light) in rows.chunks_exact_mut(width).zip(light.chunks_exact(width)) {
        for away in 1..(reach + 1).min(width) {
            pick_neighbors(&mut row[away..], light);
            pick_neighbors(row, &light[away..]);
        }
    }
    let mut squares = rows.clone();
    for away in (1..=reach).map(|rows| rows * width).take_while(|away| *away < light.len()) {
        pick_neighbors(&mut squares[away..], &rows);
        pick_neighbors(&mut squares, &rows[away..]);
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
