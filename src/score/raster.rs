//! Rasters with one value per pixel: strokes, blur, halving, and sums of products.
//!
//! The center of pixel `x, y` is at `x + 0.5, y + 0.5`, with y down. Strokes are given in the plane
//! of the word (meters, y up), together with the transform from there to the raster.

use std::ops::Range;

use tiny_skia::{FillRule, LineCap, LineJoin, Mask, Path, PathBuilder, Stroke, Transform};

use noctograph_core::strokes::Move;

/// One value per pixel, row by row from the top left.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

impl Raster {
    /// Returns a raster of zeros.
    pub(super) fn dark(width: usize, height: usize) -> Self {
        Self { width, height, values: vec![0.0; width * height] }
    }

    /// Returns the light relative to the fully lit level `full_light`, clamped to 0 to 1.
    pub(super) fn exposed(&self, full_light: f32) -> Self {
        let values = self.values.iter().map(|value| (value / full_light).clamp(0.0, 1.0));
        Self { values: values.collect(), ..*self }
    }

    /// Returns the sum of the light in each square of a grid. Its upper left corner is at `left`
    /// and `top`, and its squares have a side of `side` pixels.
    pub(super) fn sums(
        &self,
        [left, top]: [f64; 2],
        side: f64,
        columns: Range<usize>,
        n_rows: usize,
    ) -> Vec<f32> {
        // The pixels that each column and each row of squares overlaps are computed only once.
        let columns = overlaps_of_squares(left, side, columns, self.width);
        let mut sums = Vec::with_capacity(n_rows * columns.len());
        for rows in overlaps_of_squares(top, side, 0..n_rows, self.height) {
            for columns in &columns {
                let mut sum = 0.0;
                for (y, high) in &rows {
                    let row = &self.values[y * self.width..][..self.width];
                    sum += columns.iter().map(|(x, wide)| high * wide * row[*x]).sum::<f32>();
                }
                sums.push(sum);
            }
        }
        sums
    }

    /// Blurs by a Gaussian that is truncated at 3 σ. Everything outside the raster is dark.
    pub(super) fn blur(&self, sigma_px: f32) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
        let reach = (3.0 * sigma_px).ceil() as usize;
        let mut kernel: Vec<f32> = (0..=2 * reach)
            .map(|tap| (tap as f32 - reach as f32) / sigma_px)
            .map(|z| libm::expf(-0.5 * z * z))
            .collect();
        let sum: f32 = kernel.iter().sum();
        kernel.iter_mut().for_each(|weight| *weight /= sum);

        // A Gaussian is separable, so each row is blurred first, and then each column.
        let mut rows = Self::dark(self.width, self.height);
        let mut padded = vec![0.0; self.width + 2 * reach];
        for (from, to) in
            self.values.chunks_exact(self.width).zip(rows.values.chunks_exact_mut(self.width))
        {
            padded[reach..reach + self.width].copy_from_slice(from);
            for (tap, weight) in kernel.iter().enumerate() {
                add_scaled(to, &padded[tap..tap + self.width], *weight);
            }
        }
        let mut blurred = Self::dark(self.width, self.height);
        for (y, to) in blurred.values.chunks_exact_mut(self.width).enumerate() {
            for (tap, weight) in kernel.iter().enumerate() {
                if let Some(from) = (y + tap).checked_sub(reach).filter(|y| *y < self.height) {
                    add_scaled(to, &rows.values[from * self.width..][..self.width], *weight);
                }
            }
        }
        blurred
    }

    /// Returns the raster at half resolution: means of 2 × 2 pixels. Both sides must be even.
    pub(super) fn half(&self) -> Self {
        assert_eq!([self.width % 2, self.height % 2], [0; 2], "even sides can be halved");
        let (width, height) = (self.width / 2, self.height / 2);
        let mut values = Vec::with_capacity(width * height);
        for pair in self.values.chunks_exact(2 * self.width) {
            let (upper, lower) = pair.split_at(self.width);
            let columns = upper.chunks_exact(2).zip(lower.chunks_exact(2));
            values.extend(columns.map(|(u, l)| 0.25 * (u[0] + u[1] + l[0] + l[1])));
        }
        Self { width, height, values }
    }
}

/// A page on which strokes are drawn, as coverage from 0 to 1.
pub(super) struct Page(Mask);

impl Page {
    /// Returns an empty page whose sides are in pixels.
    pub(super) fn blank(width: usize, height: usize) -> Self {
        let [width, height] = [width, height]
            .map(|side| u32::try_from(side).expect("pages are some hundred pixels wide"));
        Self(Mask::new(width, height).expect("a page has pixels"))
    }

    /// Draws the lit moves with a round pen that is `pen_px` wide.
    pub(super) fn stroke(&mut self, moves: &[Move], pen_px: f32, page_from_plane: Transform) {
        let stroke = Stroke {
            width: pen_px,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        // The path is transformed before it is stroked, so that the pen stays round.
        let path = path_of(moves).and_then(|path| path.transform(page_from_plane));
        if let Some(line) = path.and_then(|path| path.stroke(&stroke, 1.0)) {
            self.0.fill_path(&line, FillRule::Winding, true, Transform::identity());
        }
    }

    /// Returns the coverage of each pixel, 0 to 1, as a raster.
    pub(super) fn into_raster(self) -> Raster {
        Raster {
            width: self.0.width() as usize,
            height: self.0.height() as usize,
            values: self.0.data().iter().map(|coverage| f32::from(*coverage) / 255.0).collect(),
        }
    }
}

/// Returns the lit moves as a path, or `None` if no move is lit.
fn path_of(moves: &[Move]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    let mut pen_at = None;
    for step in moves.iter().filter(|step| step.lit) {
        let [from, to] = [step.from_m, step.to_m].map(|point_m| point_m.map(narrow));
        if pen_at != Some(step.from_m) {
            builder.move_to(from[0], from[1]);
        }
        builder.line_to(to[0], to[1]);
        pen_at = Some(step.to_m);
    }
    builder.finish()
}

/// Adds the values of `from`, multiplied by `weight`, to those of `to`.
fn add_scaled(to: &mut [f32], from: &[f32], weight: f32) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += weight * from);
}

/// Returns the pixels, out of `n_pixels`, that each square of a row or column overlaps, and by how
/// much. Square 0 begins at `first`, and each has the length `side`, both in pixels.
fn overlaps_of_squares(
    first: f64,
    side: f64,
    squares: Range<usize>,
    n_pixels: usize,
) -> Vec<Vec<(usize, f32)>> {
    let starts = squares.map(|square| first + side * square as f64);
    starts.map(|from| overlaps(from, from + side, n_pixels).collect()).collect()
}

/// Returns the pixels, out of `n`, that an interval in pixels overlaps, with the length of each
/// overlap.
pub(super) fn overlaps(from: f64, to: f64, n: usize) -> impl Iterator<Item = (usize, f32)> + Clone {
    let first = whole(from.clamp(0.0, n as f64));
    let end = whole(to.ceil().clamp(first as f64, n as f64));
    (first..end).map(move |pixel| {
        let (left, right) = (pixel as f64, (pixel + 1) as f64);
        (pixel, narrow((right.min(to) - left.max(from)).max(0.0)))
    })
}

/// Rounds a nonnegative number of pixels down.
#[expect(clippy::cast_possible_truncation, reason = "pixels of a photo, rounded down")]
pub(super) fn whole(pixels: f64) -> usize {
    pixels as usize
}

/// Converts a value to the single precision of rasters.
#[expect(clippy::cast_possible_truncation, reason = "light needs no more than f32")]
pub(super) fn narrow(value: f64) -> f32 {
    value as f32
}

/// Returns the dot product of each row with `with`. The order of the additions is fixed, so that
/// the result has the same bits on every machine.
pub(super) fn dots<const N: usize>(rows: [&[f32]; N], with: &[f32]) -> [f32; N] {
    let (with, with_rest) = with.as_chunks::<8>();
    let rows = rows.map(|row| row.as_chunks::<8>());
    let mut lanes = [[0.0_f32; 8]; N];
    for (index, with) in with.iter().enumerate() {
        for (lanes, (row, _)) in lanes.iter_mut().zip(&rows) {
            let row = &row[index];
            for lane in 0..8 {
                lanes[lane] += row[lane] * with[lane];
            }
        }
    }
    std::array::from_fn(|n| {
        let rest: f32 = rows[n].1.iter().zip(with_rest).map(|(a, b)| a * b).sum();
        lanes[n].iter().sum::<f32>() + rest
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_keeps_the_light_and_spreads_it_by_sigma() {
        let mut spot = Raster::dark(31, 25);
        spot.values[12 * 31 + 15] = 1.0;
        let blurred = spot.blur(2.0);
        let sum: f32 = blurred.values.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "light is neither made nor lost: {sum}");
        for x in [true, false] {
            let moments = blurred.values.iter().enumerate().map(|(index, value)| {
                let d =
                    if x { index % 31 } else { index / 31 } as f32 - if x { 15.0 } else { 12.0 };
                value * (d * d)
            });
            let variance: f32 = moments.sum();
            assert!((variance - 4.0).abs() < 0.12, "σ² is 4, cut off at 3 σ: {variance}");
        }
    }

    #[test]
    fn halving_keeps_means_and_products_are_exact_on_integers() {
        let raster = Raster { width: 4, height: 2, values: (0..8_u8).map(f32::from).collect() };
        assert_eq!(raster.half().values, [2.5, 4.5], "means of 0 1 4 5 and 2 3 6 7");
        let a: Vec<f32> = (0..19_u8).map(f32::from).collect();
        assert_eq!(dots([&a, &[1.0; 19]], &a), [2109.0, 171.0], "squares and numbers up to 18");
    }
}
