//! Light of a photo: sRGB is decoded, and the sky is taken off.

use super::plane::{Grid, Placed};
use super::raster::Raster;
use crate::camera::Camera;
use crate::photo::Photo;
use crate::photo::srgb::linear_from_level;

/// Photo pixels to one pixel of the plane that are left after the photo was made smaller by whole
/// steps. Fewer would soften the picture; more only cost time.
const SAMPLES_PER_PIXEL: f64 = 2.0;

/// Largest step. Its sums fit into 32 bits: 128² pixels of 16 bits.
const MAX_STEP: f64 = 128.0;

/// The sky is found for blocks this large, in pixels of the plane: an eighth of a cap height.
const BLOCK_PLANE_PX: f64 = 4.0;

/// Blocks to either side that a block's sky is judged by: about a cap height in all, so that a
/// letter's strokes are a minority and the glow of a floor or a window is not.
const BLOCKS_AROUND: usize = 4;

/// Luminance of red, green and blue (linear sRGB, IEC 61966-2-1): how bright they look to a reader.
/// An even mean of the channels (legibility.md 6.1) makes the blue power LEDs, which shine on every
/// transit, as much a part of a letter as its strokes.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Which share of the blocks around is darker than the sky. Half would take off a bold letter's own
/// light; much less would leave half of a glow's slope.
const SKY_SHARE: f64 = 0.4;

/// The part of a photo that shows the word, in linear light above the sky: luminance, 1 is white. What lies outside is sky.
pub(super) struct Light {
    /// Photo pixels to one of ours.
    step: usize,
    /// Our first column and row, in our pixels.
    origin: [usize; 2],
    raster: Raster,
    /// Median of the part as it was.
    pub(super) sky: f32,
}

/// A rectangle of the photo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) left_px: f64,
    pub(super) top_px: f64,
    pub(super) right_px: f64,
    pub(super) bottom_px: f64,
}

impl Light {
    /// Decodes the part of the photo that shows a grid in its place; `None` where the photo does
    /// not show it.
    pub(super) fn decode(
        photo: &Photo,
        camera: &Camera,
        grid: &Grid,
        placed: &Placed,
    ) -> Option<Self> {
        let pixel_px = grid.pixel_px(camera, placed)?;
        let step = whole((pixel_px / SAMPLES_PER_PIXEL).clamp(1.0, MAX_STEP));
        let whole_photo = Frame {
            left_px: 0.0,
            top_px: 0.0,
            right_px: f64::from(photo.width_px),
            bottom_px: f64::from(photo.height_px),
        };
        // Where a corner lies behind the camera, the frame cannot be told from the corners.
        let frame = grid.frame(camera, placed).unwrap_or(whole_photo).within(&whole_photo)?;
        let [left, top] = [frame.left_px, frame.top_px].map(|px| whole(px) / step);
        let sides = [frame.right_px, frame.bottom_px].map(|px| whole(px.ceil()).div_ceil(step));
        let [width, height] = [sides[0] - left, sides[1] - top];

        let luminance = luminance_of_level();
        let mut values = Vec::with_capacity(width * height);
        let row_bytes = 3 * photo.width_px as usize;
        for row in top..top + height {
            let rows = photo.rgb8.chunks_exact(row_bytes).skip(row * step).take(step);
            let n_rows = rows.len();
            let mut sums = vec![0_u32; width];
            for bytes in rows {
                let pixels = bytes[3 * left * step..].chunks(3 * step);
                for (sum, pixels) in sums.iter_mut().zip(pixels) {
                    for pixel in pixels.chunks_exact(3) {
                        let shares = luminance.iter().zip(pixel);
                        *sum +=
                            shares.map(|(share, level)| share[usize::from(*level)]).sum::<u32>();
                    }
                }
            }
            values.extend(sums.iter().enumerate().map(|(column, sum)| {
                let n_columns = step.min(photo.width_px as usize - (left + column) * step);
                *sum as f32 / (65535 * n_columns * n_rows) as f32
            }));
        }
        let sky = median(&mut values.clone());
        let mut raster = Raster { width, height, values };
        take_off_sky(&mut raster, whole((BLOCK_PLANE_PX * pixel_px / step as f64).max(1.0)));
        Some(Self { step, origin: [left, top], raster, sky })
    }

    /// Mean light in a rectangle of the photo.
    pub(super) fn mean(&self, frame: &Frame) -> f32 {
        let step = self.step as f64;
        let [left, top] = self.origin.map(|origin| origin as f64);
        let [x0, x1] = [frame.left_px, frame.right_px].map(|px| px / step - left);
        let [y0, y1] = [frame.top_px, frame.bottom_px].map(|px| px / step - top);
        let (columns, rows) =
            (overlaps(x0, x1, self.raster.width), overlaps(y0, y1, self.raster.height));
        let area = (x1 - x0) * (y1 - y0);
        if area <= 0.0 {
            return 0.0;
        }
        let sum: f64 = rows
            .map(|(y, high)| {
                let row = &self.raster.values[y * self.raster.width..][..self.raster.width];
                high * columns.clone().map(|(x, wide)| wide * f64::from(row[x])).sum::<f64>()
            })
            .sum();
        narrow(sum / area)
    }
}

impl Frame {
    /// The smallest rectangle around points.
    pub(super) fn around(points: [[f64; 2]; 4]) -> Self {
        let min = |axis: usize| points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        let max = |axis: usize| points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        Self { left_px: min(0), top_px: min(1), right_px: max(0), bottom_px: max(1) }
    }

    /// The part that lies in another one, `None` where there is none.
    fn within(&self, other: &Self) -> Option<Self> {
        let part = Self {
            left_px: self.left_px.max(other.left_px),
            top_px: self.top_px.max(other.top_px),
            right_px: self.right_px.min(other.right_px),
            bottom_px: self.bottom_px.min(other.bottom_px),
        };
        (part.left_px < part.right_px && part.top_px < part.bottom_px).then_some(part)
    }
}

/// Subtracts the sky around each pixel: a quantile of the means of blocks, between their middles.
fn take_off_sky(raster: &mut Raster, block: usize) {
    let (width, height) = (raster.width.div_ceil(block), raster.height.div_ceil(block));
    let mut means = Vec::with_capacity(width * height);
    for rows in raster.values.chunks(block * raster.width) {
        let mut sums = vec![(0.0_f32, 0.0_f32); width];
        for row in rows.chunks_exact(raster.width) {
            for (sum, values) in sums.iter_mut().zip(row.chunks(block)) {
                sum.0 += values.iter().sum::<f32>();
                sum.1 += values.len() as f32;
            }
        }
        means.extend(sums.iter().map(|(sum, area)| sum / area));
    }

    let mut sky = Vec::with_capacity(width * height);
    let mut around = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let columns = x.saturating_sub(BLOCKS_AROUND)..(x + BLOCKS_AROUND + 1).min(width);
            let rows = y.saturating_sub(BLOCKS_AROUND)..(y + BLOCKS_AROUND + 1).min(height);
            around.clear();
            rows.for_each(|row| around.extend_from_slice(&means[row * width..][columns.clone()]));
            let rank = whole(SKY_SHARE * around.len() as f64);
            sky.push(*around.select_nth_unstable_by(rank, f32::total_cmp).1);
        }
    }

    // Bilinear between the middles of blocks.
    let between = |at: usize, n_blocks: usize| {
        let place = (at as f32 + 0.5) / block as f32 - 0.5;
        let place = place.clamp(0.0, (n_blocks - 1) as f32);
        let first = whole(f64::from(place));
        (first, (first + 1).min(n_blocks - 1), place - first as f32)
    };
    let columns: Vec<_> = (0..raster.width).map(|x| between(x, width)).collect();
    for (y, row) in raster.values.chunks_exact_mut(raster.width).enumerate() {
        let (above, below, down) = between(y, height);
        for (value, &(left, right, share)) in row.iter_mut().zip(&columns) {
            let along = |row: usize| {
                let (a, b) = (sky[row * width + left], sky[row * width + right]);
                a + share * (b - a)
            };
            let (above, below) = (along(above), along(below));
            *value -= above + down * (below - above);
        }
    }
}

/// Step of an 8-bit sRGB code at a light level, in linear light: what one code more would add.
pub(super) fn code_step(level: f32) -> f32 {
    let linear = linear_from_level();
    let code = linear.partition_point(|value| *value < level).clamp(1, 255);
    linear[code] - linear[code - 1]
}

/// Median; sorts half.
pub(super) fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Luminance that each sRGB level of red, green and blue gives, 65535 is white. Integers add up to the same
/// sum in any order.
fn luminance_of_level() -> [[u32; 256]; 3] {
    LUMINANCE.map(|share| {
        linear_from_level().map(|linear| {
            #[expect(clippy::cast_possible_truncation, reason = "0 to 65535")]
            #[expect(clippy::cast_sign_loss, reason = "0 to 65535")]
            let luminance = (65535.0 * share * f64::from(linear)).round() as u32;
            luminance
        })
    })
}

/// The pixels that an interval touches, each with the length of what it touches.
fn overlaps(
    from: f64,
    to: f64,
    n_pixels: usize,
) -> impl ExactSizeIterator<Item = (usize, f64)> + Clone {
    let first = whole(from.clamp(0.0, n_pixels as f64));
    let end = whole(to.ceil().clamp(first as f64, n_pixels as f64));
    (first..end).map(move |pixel| {
        let (left, right) = (pixel as f64, (pixel + 1) as f64);
        (pixel, (right.min(to) - left.max(from)).max(0.0))
    })
}

#[expect(clippy::cast_possible_truncation, reason = "pixels of a photo, rounded down")]
#[expect(clippy::cast_sign_loss, reason = "callers keep it from falling below 0")]
fn whole(pixels: f64) -> usize {
    pixels as usize
}

#[expect(clippy::cast_possible_truncation, reason = "light needs no more than f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}
