//! A line of writing in a photo, found from its ink alone: which pixels are ink, how high the
//! letters are, and where one may end.
//!
//! Ink is what stands out from the sky, in the color of the brightest pixels or in any color. The
//! line is where rows of pixels cross the most strokes. Letters may end where a column of pixels
//! holds less ink than those beside it.

use super::color;
use super::light::{Light, luminance};
use super::raster::{Raster, whole};
use crate::photo::Photo;
use crate::statistics::median;

/// Longest side that a photo is searched at. Letters of half its height have hundreds of pixels.
const MAX_SIDE: u32 = 1200;

/// Height of letters, of the photo's height, that its sky is judged by.
const LETTER_SHARE: f64 = 0.3;

/// How far above the sky ink must be, in standard deviations of the sky.
const LIT_SIGMAS: f32 = 5.0;

/// Ink is what has this share of the light that most of the lit pixels do not reach.
const INK_LEVEL: f32 = 0.3;

/// Rows that cross the letters have at least this share of the most crossings that a row has. A
/// streak to the landing place has one or two.
const MIN_CROSSINGS: f64 = 0.4;

/// How far above and below the line a letter's ink may reach, in its height.
const SLACK_H: f64 = 0.25;

/// A letter may end where a column holds less ink than those beside it, and at most this share of
/// the letters' height.
const MAX_CUT_H: f64 = 0.5;

/// Two ends are at least this far apart, in letters' heights.
const MIN_LETTER_H: f64 = 0.08;

/// Where ink goes on for longer than this, of the letters' height, a letter may end anyway.
const MAX_RUN_H: f64 = 0.16;

/// Two pictures of ink are the same where this little of the light differs.
const SAME_INK: f64 = 0.1;

/// Most places where a letter may end.
const MAX_CUTS: usize = 400;

/// What counts as ink.
#[derive(Clone, Copy, Debug)]
pub(super) struct InkRule {
    pub(super) color: InkColor,
    /// Share of the lit pixels that is darker than full light: high where bright strokes lie among
    /// dim streaks, low where strokes differ in brightness.
    pub(super) full_rank: f64,
}

/// Ink in the photo's color of ink, or in any.
#[derive(Clone, Copy, Debug)]
pub(super) enum InkColor {
    Own,
    Any,
}

/// A line of writing. Lengths are pixels of the searched picture.
pub(super) struct Line {
    /// Photo pixels to one.
    pub(super) step: f64,
    /// Light of the ink, 1 is fully lit.
    pub(super) ink: Raster,
    /// Height of most letters, along the middles of their strokes.
    pub(super) letter_px: f64,
    /// Width of a stroke.
    pub(super) stroke_px: f64,
    /// Upper and lower end of most letters, along the middles of their strokes.
    pub(super) extent: [f64; 2],
    /// Rows that the letters' ink may take.
    pub(super) rows: [usize; 2],
    /// Columns between which letters lie, from left to right.
    pub(super) cuts: Vec<usize>,
}

impl Line {
    /// Finds the line in a photo; `None` where nothing shines.
    pub(super) fn find(photo: &Photo, rule: InkRule) -> Option<Self> {
        let step = photo.width_px.max(photo.height_px).div_ceil(MAX_SIDE).max(1) as usize;
        let light = Light::of_whole(photo, step, LETTER_SHARE * f64::from(photo.height_px));
        let [width, height] = light.size();
        let bright: Vec<f32> = light.values().iter().map(|light| luminance(*light)).collect();
        let deviations = bright.iter().map(|value| value.abs());
        let noise: f32 = 1.4826 * median(deviations).expect("a photo has pixels");
        let lit = LIT_SIGMAS * noise.max(1e-4);
        let mut levels: Vec<f32> = bright.iter().copied().filter(|value| *value > lit).collect();
        if levels.len() < 16 {
            return None;
        }
        let rank = whole(rule.full_rank * levels.len() as f64);
        let n_brightest = levels.len() - rank;
        let full = *levels.select_nth_unstable_by(rank, f32::total_cmp).1;
        let values = match rule.color {
            InkColor::Any => bright,
            InkColor::Own => {
                color::held(light.values(), color::of_brightest(light.values(), n_brightest))
            }
        };
        let ink = Raster { width, height, values }.exposed(full);
        let mask: Vec<bool> = ink.values.iter().map(|value| *value > INK_LEVEL).collect();
        Self::of_mask(step, ink, &mask)
    }

    fn of_mask(step: usize, ink: Raster, mask: &[bool]) -> Option<Self> {
        let (width, height) = (ink.width, ink.height);
        let [top, bottom] = band(mask, width)?;
        let high = bottom - top;
        let stroke_px = stroke_width(mask, width);
        let column = |x: usize| (top..bottom).filter(|y| mask[y * width + x]).count();
        let columns: Vec<usize> = (0..width).map(column).collect();
        let left = columns.iter().position(|n_ink| *n_ink > 0)?;
        let right = columns.iter().rposition(|n_ink| *n_ink > 0)? + 1;
        let gap = whole((MIN_LETTER_H * high as f64).max(2.0));
        let mut cuts = vec![left];
        for at in left + 1..right {
            let around = &columns[at.saturating_sub(gap)..(at + gap + 1).min(width)];
            let least = around.iter().min().copied().unwrap_or(0);
            let since = &columns[cuts[cuts.len() - 1]..at];
            let thin = columns[at] as f64 <= MAX_CUT_H * high as f64;
            if since.len() >= gap && columns[at] <= least && thin && since.iter().any(|n| *n > 0) {
                cuts.push(at);
            }
        }
        cuts.push(right);
        let cuts = filled(&cuts, whole((MAX_RUN_H * high as f64).max(4.0)));
        let slack = whole(SLACK_H * high as f64);
        let rows = [top.saturating_sub(slack), (bottom + slack).min(height)];
        let half = 0.5 * stroke_px;
        let extent = [top as f64 + half, (bottom as f64 - half).max(top as f64 + half + 1.0)];
        let letter_px = extent[1] - extent[0];
        let step = step as f64;
        let found = Self { step, ink, letter_px, stroke_px, extent, rows, cuts };
        (found.cuts.len() <= MAX_CUTS).then_some(found)
    }

    /// The box of the ink between two columns, along the middles of its strokes: left, top, right
    /// and bottom; `None` where there is none.
    pub(super) fn ink_box(&self, from: usize, to: usize) -> Option<[f64; 4]> {
        let width = self.ink.width;
        let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
        for y in self.rows[0]..self.rows[1] {
            let row = &self.ink.values[y * width..][from..to];
            let lit = |value: &f32| *value > INK_LEVEL;
            if let (Some(first), Some(last)) = (row.iter().position(lit), row.iter().rposition(lit))
            {
                (left, right) = (left.min(from + first), right.max(from + last + 1));
                (top, bottom) = (top.min(y), bottom.max(y + 1));
            }
        }
        let half = 0.5 * self.stroke_px;
        let shrunk = |low: usize, high: usize| {
            let (low, high) = (low as f64 + half, high as f64 - half);
            if low < high { [low, high] } else { [0.5 * (low + high); 2] }
        };
        (left < right).then(|| {
            let ([left, right], [top, bottom]) = (shrunk(left, right), shrunk(top, bottom));
            [left, top, right, bottom]
        })
    }

    /// Whether ink goes through a column.
    pub(super) fn touches(&self, column: usize) -> bool {
        let beside = column.saturating_sub(1)..(column + 1).min(self.ink.width);
        (self.rows[0]..self.rows[1]).any(|y| {
            self.ink.values[y * self.ink.width..][beside.clone()].iter().all(|v| *v > INK_LEVEL)
        }) && column > self.cuts[0]
    }

    /// Mean light of the ink, 1 is fully lit.
    pub(super) fn ink_level(&self) -> f64 {
        let (left, right) = (self.cuts[0], self.cuts[self.cuts.len() - 1]);
        let rows = (self.rows[0]..self.rows[1])
            .flat_map(|y| &self.ink.values[y * self.ink.width..][left..right]);
        let (n, sum) = rows.fold((0.0, 0.0), |(n, sum), value| {
            (n + f64::from(u8::from(*value > INK_LEVEL)), sum + f64::from(*value))
        });
        sum / f64::max(n, 1.0)
    }

    /// Whether a column without ink lies between the inks of two columns.
    pub(super) fn has_gap(&self, from: usize, to: usize) -> bool {
        let lit = |x: &usize| {
            (self.rows[0]..self.rows[1])
                .any(|y| self.ink.values[y * self.ink.width + x] > INK_LEVEL)
        };
        let first = (from..to).find(lit).unwrap_or(to);
        let last = (from..to).rev().find(lit).unwrap_or(from);
        (first..last).any(|x| !lit(&x))
    }

    /// Whether another line of the same photo has the same ink, but for little of it.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let pairs = self.ink.values.iter().zip(&other.ink.values);
        let change: f64 = pairs.map(|(a, b)| f64::from((a - b).abs())).sum();
        let total: f64 = self.ink.values.iter().map(|value| f64::from(*value)).sum();
        change < SAME_INK * total
    }

    /// Ink between two columns.
    pub(super) fn mass(&self, from: usize, to: usize) -> f64 {
        let rows = self.rows[0]..self.rows[1];
        let row = |y: usize| &self.ink.values[y * self.ink.width..][from..to];
        rows.map(|y| row(y).iter().map(|value| f64::from(*value)).sum::<f64>()).sum()
    }
}

/// First and last row of the letters: around the row with the most crossings.
fn band(mask: &[bool], width: usize) -> Option<[usize; 2]> {
    let crossings = |row: &[bool]| {
        usize::from(row[0]) + row.windows(2).filter(|pair| !pair[0] && pair[1]).count()
    };
    let rows: Vec<usize> = mask.chunks_exact(width).map(crossings).collect();
    // Means over some rows: noise has crossings, too, but not for long.
    let reach = (rows.len() / 100).max(1);
    let smooth = |y: usize| {
        let around = &rows[y.saturating_sub(reach)..(y + reach + 1).min(rows.len())];
        around.iter().sum::<usize>() as f64 / around.len() as f64
    };
    let smooth: Vec<f64> = (0..rows.len()).map(smooth).collect();
    let most = smooth.iter().copied().fold(0.0, f64::max);
    let enough = |y: &usize| smooth[*y] >= MIN_CROSSINGS * most;
    let middle = (0..rows.len()).find(|y| smooth[*y] >= most).filter(|_| most > 0.0)?;
    let top = (0..=middle).rev().take_while(enough).last()?;
    let bottom = (middle..rows.len()).take_while(enough).last()? + 1;
    (bottom - top >= 8).then_some([top, bottom])
}

/// The cuts, and more between them where they are farther apart than `most`.
fn filled(cuts: &[usize], most: usize) -> Vec<usize> {
    let mut all = vec![cuts[0]];
    for pair in cuts.windows(2) {
        let n_parts = (pair[1] - pair[0]).div_ceil(most).max(1);
        all.extend((1..=n_parts).map(|part| pair[0] + (pair[1] - pair[0]) * part / n_parts));
    }
    all
}

/// Width of strokes: twice the area by the length of the edge.
fn stroke_width(mask: &[bool], width: usize) -> f64 {
    let area = mask.iter().filter(|ink| **ink).count();
    let beside = |a: bool, b: bool| usize::from(a != b);
    let across: usize = mask
        .chunks_exact(width)
        .map(|row| row.windows(2).map(|pair| beside(pair[0], pair[1])).sum::<usize>())
        .sum();
    let down: usize = mask.iter().zip(&mask[width..]).map(|(a, b)| beside(*a, *b)).sum();
    // Steps of a slanting edge are longer than the edge, by 4 / π on average.
    let edge = core::f64::consts::FRAC_PI_4 * (across + down) as f64;
    (2.0 * area as f64 / edge.max(1.0)).max(1.0)
}
