//! The light of a photo: linear light minus the sky's, and the level that counts as fully lit.

use std::ops::Range;

use super::raster::{Raster, narrow, overlaps, whole};
use noctograph_core::photo::Photo;
use noctograph_core::srgb::linear_from_level;
/// Brightness as a human reader sees it. In an unweighted mean of the channels, the blue power
/// LEDs, which shine during every transit, would count as much as the strokes.
pub(super) use noctograph_core::srgb::luminance_f32 as luminance;
use noctograph_core::statistics::median;

/// Minimum number of photo pixels per plane pixel after the photo is downscaled by a whole factor.
const SAMPLES_PER_PIXEL: f64 = 2.0;

/// Maximum downscaling factor. The sum of 128² values of 16 bits each still fits into 32 bits.
const MAX_STEP: f64 = 128.0;

/// Side of a block in which the sky is measured, in plane pixels: one eighth of a cap height.
const BLOCK_PLANE_PX: f64 = 4.0;

/// Maximum number of sky blocks. Only a word that the camera sees nearly edge-on has more.
const MAX_BLOCKS: f64 = 131_072.0;

/// Number of blocks on each side over which the sky is measured, together about one cap height. A
/// letter's strokes cover less than half of this area, but the glow of a floor covers more.
const BLOCKS_AROUND: usize = 4;

/// Quantile of the surrounding blocks' light that is taken as a block's sky. The median would
/// include a bold letter's own light. A much lower quantile would leave half of a glow's gradient.
const SKY_RANK: f64 = 0.4;

/// Maximum sky level for which white stays white when the position of the word is known.
const MAX_SKY: f32 = 0.9;

/// Maximum sky level for which white stays white when the whole photo is read. At a larger value, a
/// floor's glow would be amplified until it counts as ink.
const MAX_SKY_OF_WHOLE: f32 = 0.3;

/// Minimum visible light above the sky, in standard deviations of the sky's noise.
const LIGHT_SIGMAS: f32 = 5.0;

/// Fraction of the intended ink's area that is brighter than the fully lit level. With a smaller
/// fraction, a single glaring spot would darken the rest of the word.
const GLARE_RANK: f64 = 0.1;

/// Fraction of the intended ink's area that must stand out from the sky. Hot pixels cover less than
/// this.
const MIN_INK_RANK: f64 = 0.05;

/// Linear light minus that of the sky, in red, green and blue, where 1 is white.
pub(super) type Rgb = [f32; 3];

/// The part of a photo that shows the word, in linear light above the sky. Everything outside
/// counts as sky.
pub(super) struct Light {
    /// Number of photo pixels along the side of one pixel of this picture.
    step: usize,
    /// Position of the picture's first column and row in the photo, in pixels of this picture.
    origin: [usize; 2],
    pub(super) width: usize,
    pub(super) height: usize,
    /// Light of all pixels, row by row.
    pub(super) values: Vec<Rgb>,
}

/// A rectangle of a photo in pixels: left, top, right and bottom.
pub(super) type Frame = [f64; 4];

impl Light {
    /// Decodes a part of the photo, and returns its light and the median luminance of its sky, or
    /// `None` if `frame` is outside the photo. A plane pixel is `pixel_px` photo pixels wide.
    pub(super) fn decode(
        photo: &Photo,
        frame: Option<Frame>,
        pixel_px: f64,
    ) -> Option<(Self, f32)> {
        let step = whole((pixel_px / SAMPLES_PER_PIXEL).clamp(1.0, MAX_STEP));
        let whole_photo = frame_of(photo);
        let [left, top, right, bottom] = frame.unwrap_or(whole_photo);
        let (left, top) = (left.max(0.0), top.max(0.0));
        let (right, bottom) = (right.min(whole_photo[2]), bottom.min(whole_photo[3]));
        if left >= right || top >= bottom {
            return None;
        }
        let area = (right - left) * (bottom - top) / (step * step) as f64;
        let least = (area / MAX_BLOCKS).sqrt().ceil().max(1.0);
        let block = whole((BLOCK_PLANE_PX * pixel_px / step as f64).max(least));
        let mut light = Self::with_sky(photo, [left, top, right, bottom], step);
        let sky = median_abs(&map(&light.values, luminance));
        light.subtract_sky(block, MAX_SKY);
        Some((light, sky))
    }

    /// Decodes the whole photo, downscaled by `step`. The photo's letters are assumed to be
    /// `letter_px` high.
    pub(super) fn of_whole(photo: &Photo, step: usize, letter_px: f64) -> Self {
        let plane_px = letter_px / f64::from(super::PX_PER_H);
        let block = whole((BLOCK_PLANE_PX * plane_px / step as f64).max(1.0));
        let mut light = Self::with_sky(photo, frame_of(photo), step);
        light.subtract_sky(block, MAX_SKY_OF_WHOLE);
        light
    }

    /// Decodes a part of the photo, downscaled by `step`, without subtracting the sky.
    fn with_sky(photo: &Photo, [left, top, right, bottom]: Frame, step: usize) -> Self {
        let origin = [left, top].map(|px| whole(px) / step);
        let [right, bottom] = [right, bottom].map(|px| whole(px.ceil()).div_ceil(step));
        let (width, height) = (right - origin[0], bottom - origin[1]);
        // The compiler generates faster code if the step is a constant.
        let values = match step {
            1 => means::<1>(photo, origin, [width, height], 1),
            2 => means::<2>(photo, origin, [width, height], 2),
            step => means::<0>(photo, origin, [width, height], step),
        };
        Self { step, origin, width, height, values }
    }

    /// Returns the picture with a measure of each pixel in place of its light.
    pub(super) fn measured(&self, measure: impl Fn(Rgb) -> Rgb) -> Self {
        let mut values = self.values.clone();
        noctograph_core::dispatch!(|| {
            values.iter_mut().for_each(|value| *value = measure(*value));
        });
        Self { values, ..*self }
    }

    /// Averages `measure` over the light in a rectangle of the photo, in photo pixels. Parts
    /// outside the photo count as 0, and so does an empty rectangle.
    pub(super) fn mean_of(&self, frame: Frame, measure: impl Fn(Rgb) -> Rgb) -> Rgb {
        let per_px = 1.0 / self.step as f64;
        let [left, top] = self.origin.map(|origin| origin as f64);
        let [x0, x1] = [frame[0], frame[2]].map(|px| px * per_px - left);
        let [y0, y1] = [frame[1], frame[3]].map(|px| px * per_px - top);
        let area = (x1 - x0) * (y1 - y0);
        let mut sum = [0.0; 3];
        if area <= 0.0 {
            return sum;
        }
        // Each pixel is weighted by its area inside the rectangle.
        let across = overlaps(x0, x1, self.width);
        for (y, high) in overlaps(y0, y1, self.height) {
            let row = &self.values[y * self.width..][..self.width];
            for (x, wide) in across.clone() {
                let (weight, value) = (wide * high, measure(row[x]));
                for channel in 0..3 {
                    sum[channel] += weight * value[channel];
                }
            }
        }
        let per_area = narrow(1.0 / area);
        sum.map(|sum| sum * per_area)
    }

    /// Returns the light of all cells in a rectangle, which is in pixels of the photo. The part of
    /// the rectangle outside the photo is ignored.
    pub(super) fn within(&self, [left, top, right, bottom]: Frame) -> Vec<Rgb> {
        let sides = [(left, 0), (right, 0), (top, 1), (bottom, 1)].map(|(px, axis)| {
            let place = px / self.step as f64 - self.origin[axis] as f64;
            whole(place.max(0.0)).min([self.width, self.height][axis])
        });
        let [left, right, top, bottom] = sides;
        (top..bottom).flat_map(|y| &self.values[y * self.width..][left..right]).copied().collect()
    }

    /// Subtracts from each pixel the sky, which is interpolated between block centers. A block is
    /// `block` pixels wide. Brightness is scaled so that white stays white, for a sky up to
    /// `max_sky`.
    fn subtract_sky(&mut self, block: usize, max_sky: f32) {
        let Self { width: n_columns, height: n_rows, ref mut values, .. } = *self;
        let size = [n_columns.div_ceil(block), n_rows.div_ceil(block)];
        let means = block_means(values, n_columns, block);
        let sky = [0, 1, 2].map(|channel| {
            let means: Vec<f32> = means.iter().map(|mean| mean[channel]).collect();
            sky_around(&means, size)
        });
        // Each row of blocks is interpolated along x once, and reused for all rows of pixels that
        // lie between two rows of blocks.
        let columns: Vec<_> = (0..n_columns).map(|x| blocks_beside(x, block, size[0])).collect();
        let mut rows = [(usize::MAX, Vec::new()), (usize::MAX, Vec::new())];
        for (y, values) in values.chunks_exact_mut(n_columns).enumerate() {
            let (above, below, down) = blocks_beside(y, block, size[1]);
            if rows[0].0 != above {
                rows.swap(0, 1);
            }
            for (cached, wanted) in rows.iter_mut().zip([above, below]) {
                if cached.0 != wanted {
                    let sky = sky.each_ref().map(|sky| &sky[wanted * size[0]..][..size[0]]);
                    let along_x = columns.iter().map(|(left, right, part)| {
                        sky.map(|sky| sky[*left] + part * (sky[*right] - sky[*left]))
                    });
                    *cached = (wanted, along_x.collect());
                }
            }
            let [above, below] = rows.each_ref().map(|(_, row): &(_, Vec<Rgb>)| row.as_flattened());
            let lights = values.as_flattened_mut().iter_mut();
            noctograph_core::dispatch!(|| {
                for (light, (above, below)) in lights.zip(above.iter().zip(below)) {
                    // White stays white: the sky behind a saturated pixel is unknown.
                    let sky = above + down * (below - above);
                    *light = (*light - sky) / (1.0 - sky.min(max_sky));
                }
            });
        }
    }
}

/// Returns the rectangle of the whole photo.
fn frame_of(photo: &Photo) -> Frame {
    [0.0, 0.0, photo.width_px.into(), photo.height_px.into()]
}

/// Returns the mean light, 0 to 1, over blocks of `step` × `step` pixels, row by row. Left, top,
/// width and height are in blocks. `STEP` is a constant `step`, or 0.
#[inline(always)]
fn means<const STEP: usize>(
    photo: &Photo,
    [left, top]: [usize; 2],
    [width, height]: [usize; 2],
    step: usize,
) -> Vec<Rgb> {
    let step = if STEP > 0 { STEP } else { step };
    let light_of_level = light_of_level();
    let mut values = Vec::with_capacity(width * height);
    let row_bytes = 3 * photo.width_px as usize;
    let mut sums = vec![[0_u32; 3]; width];
    for row in top..top + height {
        let rows = photo.rgb8.chunks_exact(row_bytes).skip(row * step).take(step);
        let n_rows = rows.len();
        sums.fill([0; 3]);
        for bytes in rows {
            // Blocks of full width, which may be a constant, come first, then the row's remainder.
            let blocks = bytes[3 * left * step..].chunks_exact(3 * step);
            let (rest, n) = (blocks.remainder(), blocks.len());
            sums.iter_mut().zip(blocks).for_each(|(sum, block)| add(sum, block, &light_of_level));
            sums.get_mut(n).into_iter().for_each(|sum| add(sum, rest, &light_of_level));
        }
        values.extend(sums.iter().enumerate().map(|(column, sum)| {
            let n_columns = step.min(photo.width_px as usize - (left + column) * step);
            let full = 1.0 / (65535 * n_columns * n_rows) as f32;
            sum.map(|sum| sum as f32 * full)
        }));
    }
    values
}

/// Adds the light of several pixels to `sum`, in units in which white is 65535.
#[inline(always)]
fn add(sum: &mut [u32; 3], pixels: &[u8], light_of_level: &[u32; 256]) {
    for pixel in pixels.as_chunks::<3>().0 {
        for channel in 0..3 {
            sum[channel] += light_of_level[usize::from(pixel[channel])];
        }
    }
}

/// Returns the mean light of each block of a picture, row by row.
fn block_means(values: &[Rgb], width: usize, block: usize) -> Vec<Rgb> {
    let mut means = Vec::new();
    for rows in values.chunks(block * width) {
        let mut sums = vec![([0.0_f32; 3], 0.0_f32); width.div_ceil(block)];
        for row in rows.chunks_exact(width) {
            for (sum, values) in sums.iter_mut().zip(row.chunks(block)) {
                for value in values {
                    (0..3).for_each(|channel| sum.0[channel] += value[channel]);
                }
                sum.1 += values.len() as f32;
            }
        }
        means.extend(sums.iter().map(|(sum, area)| sum.map(|sum| sum / area)));
    }
    means
}

/// Returns the indices of the two blocks, out of `n_blocks`, whose centers are nearest to a pixel,
/// and the pixel's position between these centers, 0 to 1.
fn blocks_beside(pixel: usize, block: usize, n_blocks: usize) -> (usize, usize, f32) {
    let position = ((pixel as f32 + 0.5) / block as f32 - 0.5).clamp(0.0, (n_blocks - 1) as f32);
    let first = whole(f64::from(position));
    (first, (first + 1).min(n_blocks - 1), position - first as f32)
}

/// Returns the sky of each block, which is a quantile of the mean light of the blocks around it.
///
/// The window slides along each row of blocks (Huang, Yang and Tang 1979). It contains the ranks of
/// its blocks among all blocks of the picture. No two blocks have the same rank.
fn sky_around(means: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    fn near(place: usize, end: usize) -> Range<usize> {
        place.saturating_sub(BLOCKS_AROUND)..(place + BLOCKS_AROUND + 1).min(end)
    }
    let mut in_order: Vec<usize> = (0..means.len()).collect();
    in_order.sort_unstable_by(|a, b| means[*a].total_cmp(&means[*b]));
    let mut ranks = vec![0; means.len()];
    in_order.iter().enumerate().for_each(|(rank, block)| ranks[*block] = rank);
    let mut sky = Vec::with_capacity(means.len());
    for y in 0..height {
        let rows = near(y, height);
        let mut window = Window::new(means.len());
        let column = |x: usize| rows.clone().map(move |row| row * width + x);
        // The window begins left of the row. Each step adds one column and removes another.
        (0..width.min(BLOCKS_AROUND)).flat_map(column).for_each(|k| window.add(ranks[k]));
        for x in 0..width {
            let columns = near(x, width);
            if x + BLOCKS_AROUND < width {
                column(x + BLOCKS_AROUND).for_each(|block| window.add(ranks[block]));
            }
            if x > BLOCKS_AROUND {
                column(x - BLOCKS_AROUND - 1).for_each(|block| window.remove(ranks[block]));
            }
            let n_darker = whole(SKY_RANK * (rows.len() * columns.len()) as f64);
            sky.push(means[in_order[window.nth(n_darker)]]);
        }
    }
    sky
}

/// A set of numbers, stored as a bitmap. Finding the n-th smallest number is fast if n is close to
/// that of the previous search.
struct Window {
    words: Vec<u64>,
    /// Index of the bitmap word that contains the last number found, and number of elements before
    /// it.
    word: usize,
    n_before: usize,
}

impl Window {
    /// Returns an empty set of numbers below `end`, with one bit for each number.
    fn new(end: usize) -> Self {
        Self { words: vec![0; end.div_ceil(64)], word: 0, n_before: 0 }
    }

    /// Adds a number that the set does not contain.
    fn add(&mut self, number: usize) {
        self.words[number / 64] |= 1 << (number % 64);
        self.n_before += usize::from(number / 64 < self.word);
    }

    /// Removes a number that the set contains.
    fn remove(&mut self, number: usize) {
        self.words[number / 64] &= !(1 << (number % 64));
        self.n_before -= usize::from(number / 64 < self.word);
    }

    /// Returns the number that is greater than exactly `n_less` others. The set must have more than
    /// `n_less` elements.
    fn nth(&mut self, n_less: usize) -> usize {
        let n_in = |word: u64| word.count_ones() as usize;
        while self.n_before > n_less {
            self.word -= 1;
            self.n_before -= n_in(self.words[self.word]);
        }
        while self.n_before + n_in(self.words[self.word]) <= n_less {
            self.n_before += n_in(self.words[self.word]);
            self.word += 1;
        }
        let mut bits = self.words[self.word];
        // Clears the lowest set bits, one by one.
        (self.n_before..n_less).for_each(|_| bits &= bits - 1);
        64 * self.word + bits.trailing_zeros() as usize
    }
}

/// Evaluates a measure at every pixel. Vector instructions of any width give equal results.
pub(super) fn map(light: &[Rgb], measure: impl Fn(Rgb) -> f32) -> Vec<f32> {
    let mut values = vec![0.0; light.len()];
    noctograph_core::dispatch!(|| {
        values.iter_mut().zip(light).for_each(|(value, light)| *value = measure(*light));
    });
    values
}

/// Returns the median absolute value. Comparing their bits gives the same order in less time.
pub(super) fn median_abs(values: &[f32]) -> f32 {
    let sizes = values.iter().map(|value| value.abs().to_bits());
    f32::from_bits(median(sizes).expect("a picture has pixels"))
}

/// Returns the fully lit level of a word whose ink should cover `ink_px` pixels, and the ratio of
/// that level to the lowest visible level. Levels are linear light relative to white, and `sky` is
/// the level of the sky. Returns `None` if too few pixels are visible.
pub(super) fn full_light(seen: &Raster, sky: f32, ink_px: f64) -> Option<(f32, f32)> {
    // In a normal distribution, the standard deviation is 1.4826 times the median absolute
    // deviation. The standard deviation of rounding to 8 bits is one step divided by √12.
    let noise = 1.4826 * median_abs(&seen.values);
    let sigma = noise.max(code_step(sky) / 12.0_f32.sqrt());
    let lit = LIGHT_SIGMAS * sigma;
    // The levels that are exceeded by the given fractions of the intended ink's area.
    let mut values = seen.values.clone();
    let [least, glare] = [MIN_INK_RANK, GLARE_RANK].map(|part| {
        let rank = whole(part * ink_px).min(values.len() - 1);
        *values.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1
    });
    let full = glare.max(lit);
    (least > lit).then_some((full, full / lit))
}

/// Returns the difference between neighboring 8-bit sRGB codes at a light level, in linear light
/// from 0 to 1.
fn code_step(level: f32) -> f32 {
    let linear = linear_from_level();
    let code = linear.partition_point(|value| *value < level).clamp(1, 255);
    linear[code] - linear[code - 1]
}

/// Returns the linear light of each sRGB code, where white is 65535. Sums of these integers are
/// exact.
#[expect(clippy::cast_possible_truncation, reason = "0 to 65535")]
fn light_of_level() -> [u32; 256] {
    linear_from_level().map(|linear| (65535.0 * linear).round() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::photo::PhotoData;

    #[test]
    fn the_sky_is_the_quantile_of_the_means_around() {
        // The means contain repeated values. The expected sky comes from a direct sort.
        let means = |n: usize| (0..n).map(|k| ((k * 7919) % 101) as f32 * 0.01 - 0.2).collect();
        for ([width, height], x, y) in [
            ([23, 17], 0, 0),
            ([23, 17], 22, 16),
            ([23, 17], 11, 8),
            ([23, 17], 3, 15),
            ([1, 30], 0, 7),
            ([30, 1], 29, 0),
            ([3, 2], 1, 1),
        ] {
            let means: Vec<f32> = means(width * height);
            let sky = sky_around(&means, [width, height]);
            let near = |a: usize, b: usize| a.abs_diff(b) <= BLOCKS_AROUND;
            let around = (0..width * height).filter(|k| near(k % width, x) && near(k / width, y));
            let mut around: Vec<f32> = around.map(|k| means[k]).collect();
            around.sort_by(f32::total_cmp);
            let darker = whole(SKY_RANK * around.len() as f64);
            assert_eq!(sky[y * width + x].to_bits(), around[darker].to_bits(), "{x}, {y}");
        }
    }

    #[test]
    fn a_word_seen_edge_on_has_no_more_blocks_than_any_other() {
        // The word's pixels have almost no width, and the search covers the whole photo.
        let [width_px, height_px] = [1920, 1080];
        let rgb8 = vec![90; 3 * 1920 * 1080];
        let photo = Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None });
        let start = std::time::Instant::now();
        let (light, _) = Light::decode(&photo, None, 1e-9).unwrap();
        assert!(light.values.iter().flatten().all(|light| light.abs() < 1e-6), "an even sky");
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }
}
