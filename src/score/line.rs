//! Lines of writing in a photo, located only by their ink.
//!
//! Ink is light that stands out from the sky, either in the color of the brightest pixels or in any
//! color. A line of writing is located at the rows of pixels that cross the most strokes.

use std::sync::Arc;

use super::color;
use super::light::{Light, luminance, map, median_abs};
use super::raster::{Raster, narrow, whole};
use super::strip::{CAP_PX, HEAD_ROW, HEIGHT, MARGIN_PX, Strip};
use noctograph_core::photo::Photo;
use noctograph_core::statistics::sort_by_number;

/// Maximum side of the searched picture, in pixels. Letters of half this height still have hundreds
/// of pixels.
const MAX_SIDE: u32 = 1200;

/// Assumed height of the letters when the sky is subtracted, as a fraction of the photo's height.
const LETTER_PART: f64 = 0.3;

/// Minimum light of ink above the sky, in standard deviations of the sky.
const LIT_SIGMAS: f32 = 5.0;

/// Minimum number of lit pixels in a photo with writing.
const MIN_LIT_PX: usize = 16;

/// Quantiles of the lit pixels' levels that are tried as full light. The first one suits photos
/// with dim streaks, and the second one photos with uneven strokes.
const FULL_RANKS: [f64; 2] = [0.95, 0.6];

/// Minimum level of ink, as a fraction of full light.
const INK_LEVEL: f32 = 0.3;

/// Minimum number of strokes that a row through the letters crosses, as a fraction of the maximum
/// over all rows. A streak to the landing place adds only one or two crossings.
const MIN_CROSSINGS: f64 = 0.4;

/// Maximum distance of a letter's ink above and below the line, in line heights.
const SLACK_H: f64 = 0.25;

/// Minimum fraction of a line's height at which a part in the ink's color is the whole letter.
const WHOLE_LETTER: f64 = 0.7;

/// Minimum height of a single letter, in stroke widths. A horizontal bar without a letter is lower.
const BAR: f64 = 3.0;

/// Maximum number of lines that are read in a photo, and of bands of rows that are searched for
/// lines.
const MAX_LINES: usize = 4;
const MOST_BANDS: usize = 8;

/// Minimum number of rows of a line.
pub(super) const LEAST_PX: usize = 8;

/// Maximum ratio between the letter heights of two lines of one text.
const MAX_RATIO: f64 = 1.8;

/// Minimum height ratio of two lines at which the smaller one counts as a credit line.
const LARGER: f64 = 3.0;

/// Maximum height of a line beside a credit line, as a fraction of the photo's height.
const ROOM: f64 = 0.6;

/// The light of a photo in which lines are searched.
#[derive(Clone)]
pub(super) struct Ink {
    /// Number of photo pixels per pixel of the rasters, along each axis.
    step: f64,
    /// The light of any color, and the light in the brightest pixels' color, where 1 is fully lit.
    light: [Arc<Raster>; 2],
    /// Index of the raster in `light` that is the ink.
    which: usize,
}

/// A line of writing. Lengths are in pixels of the searched picture.
pub(super) struct Line {
    ink: Ink,
    /// Height of most letters, measured between the centers of their strokes.
    pub(super) letter_px: f64,
    /// Width of a stroke.
    stroke_px: f64,
    /// Top and bottom of most letters, at the centers of their strokes.
    extent: [f64; 2],
    /// Range of rows that the ink of the letters may reach.
    rows: [usize; 2],
    /// First column of the ink, and the column after its last one.
    columns: [usize; 2],
}

/// Returns the ink of a photo according to each rule, or an empty list if too few pixels are lit.
pub(super) fn inks(photo: &Photo) -> Vec<Ink> {
    let step = photo.width_px.max(photo.height_px).div_ceil(MAX_SIDE).max(1) as usize;
    let light = Light::of_whole(photo, step, LETTER_PART * f64::from(photo.height_px));
    let bright = map(&light.values, luminance);
    // A photo without noise, such as a drawing, has a sky of zero deviation.
    let lit = LIT_SIGMAS * (1.4826 * median_abs(&bright)).max(1e-4);
    let mut levels: Vec<f32> = bright.iter().copied().filter(|value| *value > lit).collect();
    let mut inks = Vec::new();
    if levels.len() < MIN_LIT_PX {
        return inks;
    }
    let Light { width, height, ref values, .. } = light;
    for full_rank in FULL_RANKS {
        let rank = whole(full_rank * levels.len() as f64);
        let n_brightest = levels.len() - rank;
        let full = *levels.select_nth_unstable_by(rank, f32::total_cmp).1;
        let pure = map(values, color::pure(color::of_brightest(values, n_brightest)));
        let lights = [bright.clone(), pure].map(|values| Raster { width, height, values });
        let exposed = lights.map(|light| Arc::new(light.exposed(full)));
        inks.extend([1, 0].map(|which| Ink { step: step as f64, light: exposed.clone(), which }));
    }
    inks
}

impl Ink {
    /// Returns the raster that is the ink.
    fn raster(&self) -> &Raster {
        &self.light[self.which]
    }

    /// Returns a mask that is true for pixels with ink.
    fn mask(&self) -> Vec<bool> {
        self.raster().values.iter().map(|value| *value > INK_LEVEL).collect()
    }

    /// Returns the lines of writing in order of decreasing crossings. The rows of each line are
    /// blanked before the next line is searched. `None` stands for rows that are too low for a
    /// line, such as those of a small credit.
    fn by_crossings(&self) -> impl Iterator<Item = Option<Line>> {
        let mut mask = self.mask();
        let width = self.raster().width;
        (0..MOST_BANDS).map_while(move |_| {
            let rows = band(&mask, width, Band::OfMost)?;
            let line = Line::from_mask(self, &mask, Band::OfMost);
            let [top, bottom] = line.as_ref().map_or(rows, |line| line.rows);
            mask[top * width..bottom * width].fill(false);
            Some(line)
        })
    }

    /// Returns the lines of one text, from top to bottom.
    pub(super) fn lines(&self) -> Vec<Line> {
        let mut lines: Vec<Line> = Vec::new();
        for line in self.by_crossings().map_while(|line| line).take(MAX_LINES) {
            if lines.first().is_some_and(|first| !line.has_height_of(first)) {
                break;
            }
            lines.push(line);
        }
        sort_by_number(&mut lines, |line| line.extent[0]);
        lines
    }

    /// Returns a single line with all of the ink, for single letters, which have too few crossings
    /// to reveal a line.
    pub(super) fn line_of_any(&self) -> Option<Line> {
        Line::from_mask(self, &self.mask(), Band::OfAny)
    }

    /// Returns the line with the most crossings among those that are at least [`LARGER`] times as
    /// high as `than_px`. A credit or a date often has more crossings than the larger writing
    /// beside it.
    pub(super) fn larger(&self, than_px: f64) -> Option<Line> {
        let least_px = LARGER * than_px;
        if least_px > ROOM * self.raster().height as f64 {
            return None;
        }
        self.by_crossings().flatten().find(|line| line.letter_px >= least_px)
    }
}

impl Line {
    /// Returns the line of writing in a mask of ink. Returns `None` if the line's height minus a
    /// stroke width is less than a pixel.
    fn from_mask(ink: &Ink, mask: &[bool], by: Band) -> Option<Self> {
        let Raster { width, height, .. } = *ink.raster();
        let [top, bottom] =
            band(mask, width, by).filter(|[top, bottom]| bottom - top >= LEAST_PX)?;
        let stroke_px = stroke_width(mask, width);
        if by == Band::OfAny && ((bottom - top) as f64) < BAR * stroke_px {
            return None;
        }
        let mut inked = (0..width).filter(|x| (top..bottom).any(|y| mask[y * width + x]));
        let first = inked.next()?;
        let columns = [first, inked.next_back().unwrap_or(first) + 1];
        let slack = whole(SLACK_H * (bottom - top) as f64);
        let rows = [top.saturating_sub(slack), (bottom + slack).min(height)];
        let extent = [top as f64 + 0.5 * stroke_px, bottom as f64 - 0.5 * stroke_px];
        let letter_px = extent[1] - extent[0];
        let ink = ink.clone();
        (letter_px >= 1.0).then_some(Self { ink, letter_px, stroke_px, extent, rows, columns })
    }

    /// True if the line is a part of another line, or if its letters have another height.
    pub(super) fn adds_nothing_to(&self, other: &Self) -> bool {
        let slack = whole(self.stroke_px.ceil());
        let [first, last] = other.columns;
        let is_within = self.columns[0] + slack >= first && self.columns[1] <= last + slack;
        is_within || !self.has_height_of(other)
    }

    /// True if the letter heights of two lines are similar enough for one text.
    fn has_height_of(&self, other: &Self) -> bool {
        (1.0 / MAX_RATIO..=MAX_RATIO).contains(&(self.letter_px / other.letter_px))
    }

    /// Returns the number of columns of the line's strip if capitals are `cap_px` high.
    pub(super) fn strip_width(&self, cap_px: f64) -> usize {
        let [first, last] = self.columns.map(|column| column as f64);
        (whole((last - first) * CAP_PX as f64 / cap_px) + 2 * MARGIN_PX).next_multiple_of(2)
    }

    /// Cuts out the line as a strip for capitals of height `cap_px`. Returns the strip, the
    /// position of its left edge, and the size of its pixels, both in photo pixels.
    pub(super) fn strip(&self, cap_px: f64) -> (Strip, f64, f64) {
        let pitch = cap_px / CAP_PX as f64;
        let left = self.columns[0] as f64 - MARGIN_PX as f64 * pitch;
        let top = self.extent[1] - (CAP_PX + HEAD_ROW) as f64 * pitch;
        let width = self.strip_width(cap_px);
        let per_area = narrow(1.0 / (pitch * pitch));
        let [bright, pure] = self.ink.light.each_ref().map(|light| {
            let sums = light.sums([left, top], pitch, 0..width, HEIGHT);
            sums.into_iter().map(|sum| (sum * per_area).clamp(0.0, 1.0)).collect()
        });
        (Strip::of_light(width, bright, pure), left * self.ink.step, pitch * self.ink.step)
    }

    /// Returns the boxes of the letters with the given centers: left, top, right and bottom, in
    /// pixels of the photo.
    pub(super) fn boxes(&self, middles_px: &[f64]) -> Vec<[f64; 4]> {
        let [first, end] = self.columns;
        let middles = middles_px.iter().map(|px| whole((px / self.ink.step).max(0.0)));
        let middles: Vec<usize> = middles.map(|column| column.clamp(first, end - 1)).collect();
        let Raster { width, ref values, .. } = *self.ink.raster();
        let column = |x| (self.rows[0]..self.rows[1]).map(|y| values[y * width + x]).sum();
        let ink: Vec<f32> = (0..width).map(column).collect();
        // Neighboring letters are separated at the column with the least ink between their centers.
        let between = middles.windows(2).map(|pair| {
            let (from, to) = (pair[0], pair[1].max(pair[0] + 1));
            (from..to).min_by(|a, b| ink[*a].total_cmp(&ink[*b])).unwrap_or(to)
        });
        let mut ends: Vec<usize> = [first].into_iter().chain(between).chain([end]).collect();
        ends.sort_unstable();
        let [left, right] = self.columns.map(|column| column as f64);
        let whole_line = [left, self.extent[0], right, self.extent[1]];
        let boxes =
            ends.windows(2).map(|ends| self.ink_box(ends[0], ends[1]).unwrap_or(whole_line));
        boxes.map(|sides| sides.map(|side| side * self.ink.step)).collect()
    }

    /// Returns the box (left, top, right, bottom) of the ink between two columns, at the centers of
    /// its outer strokes, in pixels of the ink. Returns `None` if there is no ink.
    fn ink_box(&self, from: usize, to: usize) -> Option<[f64; 4]> {
        // Only the ink's color determines the box, because other lamps' trails may lead to it.
        let colored = self.box_of(&self.ink.light[1], from, to);
        let whole =
            colored.filter(|[_, top, _, bottom]| bottom - top >= WHOLE_LETTER * self.letter_px);
        whole.or_else(|| self.box_of(self.ink.raster(), from, to))
    }

    /// Returns the box (left, top, right, bottom) of one raster's ink between two columns of the
    /// line, in pixels of the ink, or `None` if there is none.
    fn box_of(&self, ink: &Raster, from: usize, to: usize) -> Option<[f64; 4]> {
        let width = ink.width;
        let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
        for y in self.rows[0]..self.rows[1] {
            let mut lit = (from..to).filter(|x| ink.values[y * width + x] > INK_LEVEL);
            if let Some(first) = lit.next() {
                let last = lit.next_back().unwrap_or(first);
                (left, right) = (left.min(first), right.max(last + 1));
                (top, bottom) = (top.min(y), bottom.max(y + 1));
            }
        }
        // Removes half a stroke on each side, so that the box runs through the strokes' centers.
        let half = 0.5 * self.stroke_px;
        (left < right).then(|| {
            let [[left, right], [top, bottom]] =
                [[left, right], [top, bottom]].map(|[low, high]| {
                    let (low, high) = (low as f64 + half, high as f64 - half);
                    if low < high { [low, high] } else { [0.5 * (low + high); 2] }
                });
            [left, top, right, bottom]
        })
    }
}

/// The rule that selects the rows of the letters.
#[derive(Clone, Copy, PartialEq)]
enum Band {
    /// Selects rows with nearly the maximum number of crossings.
    OfMost,
    /// Selects rows with any ink.
    OfAny,
}

/// Returns the letters' first row and the row after their last, around the row with most crossings.
/// Returns `None` for a mask without ink.
fn band(mask: &[bool], width: usize, by: Band) -> Option<[usize; 2]> {
    // Counts the strokes that each row crosses.
    let crossings = mask.chunks_exact(width).map(|row| {
        u32::from(row[0]) + row.iter().zip(&row[1..]).map(|(a, b)| u32::from(!a & b)).sum::<u32>()
    });
    let rows: Vec<u32> = noctograph_core::dispatch!(|| crossings.collect());
    // Averages the counts over neighboring rows, because noise adds crossings to only a few rows.
    let reach = (rows.len() / 100).max(1);
    let smooth = (0..rows.len()).map(|y| {
        let around = &rows[y.saturating_sub(reach)..(y + reach + 1).min(rows.len())];
        f64::from(around.iter().sum::<u32>()) / around.len() as f64
    });
    let smooth: Vec<f64> = smooth.collect();
    let most = smooth.iter().copied().fold(0.0, f64::max);
    let least = MIN_CROSSINGS * if by == Band::OfAny { most.min(1.0) } else { most };
    let enough: Vec<bool> = smooth.iter().map(|mean| *mean >= least).collect();
    let middle = (0..rows.len()).find(|y| smooth[*y] >= most).filter(|_| most > 0.0)?;
    let top = (0..=middle).rev().take_while(|y| enough[*y]).last()?;
    let bottom = (middle..rows.len()).take_while(|y| enough[*y]).last()? + 1;
    Some([top, bottom])
}

/// Returns the width of strokes in pixels, which is twice their area divided by the length of their
/// edge.
fn stroke_width(mask: &[bool], width: usize) -> f64 {
    let area = mask.iter().filter(|ink| **ink).count();
    let differing = |a: &[bool], b: &[bool]| -> u32 {
        noctograph_core::dispatch!(|| a.iter().zip(b).map(|(a, b)| u32::from(a != b)).sum())
    };
    let across: u32 = mask.chunks_exact(width).map(|row| differing(row, &row[1..])).sum();
    // On average, a slanted edge has 4 / π times as many pixel steps as its length in pixels.
    let edge = core::f64::consts::FRAC_PI_4 * f64::from(across + differing(mask, &mask[width..]));
    (2.0 * area as f64 / edge.max(1.0)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ragged_edge_of_a_level_stroke_is_no_line() {
        let (width, height) = (400, 300);
        let mut values = vec![0.0; width * height];
        for (index, value) in values.iter_mut().enumerate() {
            let (x, y) = (index % width, index / width);
            let is_ragged = y < 100 && x % 8 > 3;
            if (90..140).contains(&y) && (20..380).contains(&x) && !is_ragged {
                *value = 1.0;
            }
        }
        let light = Arc::new(Raster { width, height, values });
        let ink = Ink { step: 1.0, light: [light.clone(), light], which: 0 };
        for band in [Band::OfMost, Band::OfAny] {
            assert!(Line::from_mask(&ink, &ink.mask(), band).is_none());
        }
    }
}
