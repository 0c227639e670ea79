//! Rulings of paper in a picture: straight lines from edge to edge that are paler than the pen.

use super::ink::Field;
use super::patches::FAINT;

/// Minimum number of rulings on a page, and on a page with further rulings too faint to be ink.
const LEAST: [usize; 2] = [4, 1];
/// Maximum slope of a ruling.
const SLOPE: f64 = 0.02;
/// Minimum inked fraction of a ruling's length, and minimum contrast along it relative to its ends.
const ALONG: f64 = 0.97;
const INKED: f64 = 0.6;
/// Maximum contrast of a ruling relative to that of the drawing, and minimum fraction of the
/// picture that the drawing's ink covers.
const PALE: f64 = 0.6;
const DRAWING: f64 = 5e-4;
/// Maximum contrast of the pixels that are dropped, relative to that of the ruling.
const RULED: f64 = 1.6;
/// Quantile of the contrast along a ruling that is taken as the ruling's contrast. A slanted ruling
/// is paler where it lies between two rows of pixels, and darker where a pen's line follows it.
const QUANTILE: f64 = 0.25;
/// Minimum contrast across a mark, relative to its maximum. Compression and sharpening leave some
/// contrast beside a mark.
const HALF: f64 = 0.5;
/// Distance in pixels from a picture's edge within which the ends of rulings are detected. At
/// the edge itself, another ruling may hide these ends.
const FRAME: usize = 8;
/// Maximum width of a ruling, relative to the side that it crosses.
const WIDTH: f64 = 0.012;

/// A ruling.
struct Ruling {
    /// True for a vertical ruling.
    is_upright: bool,
    /// Rows of the ruling's two ends, or columns if it is vertical.
    ends: [f64; 2],
    width: usize,
    contrast: f64,
}

impl Field {
    /// Drops the ink of rulings. A pen's line on a ruling stays because its ink is darker. Returns
    /// the number of rulings, or 0 if there are too few or if the remaining ink is not darker.
    pub(super) fn drop_rulings(&mut self) -> usize {
        let rulings: Vec<Ruling> =
            [false, true].into_iter().flat_map(|is_upright| self.rulings(is_upright)).collect();
        let darkest = rulings.iter().map(|ruling| ruling.contrast).fold(0.0, f64::max);
        let n_dark = self.contrast.iter().filter(|contrast| PALE * **contrast > darkest).count();
        // A few straight lines from edge to edge may belong to the drawing, unless faint ink shows
        // further rulings. Without enough darker ink, the lines are the drawing itself.
        if rulings.len() < LEAST[usize::from(self.faint > FAINT)]
            || (n_dark as f64) < DRAWING * self.contrast.len() as f64
        {
            return 0;
        }
        // The width of a ruling is that of its dark part, so pixels beside that part may have ink.
        for ruling in &rulings {
            let places = 1..=self.length(ruling.is_upright);
            let pixels = places.flat_map(|along| self.near(ruling, along, ruling.width / 2 + 2));
            let pale = pixels.filter(|pixel| self.contrast[*pixel] < RULED * ruling.contrast);
            for pixel in pale.collect::<Vec<usize>>() {
                (self.ink[pixel], self.contrast[pixel]) = (0.0, 0.0);
            }
        }
        rulings.len()
    }

    /// Returns the number of the picture's pixels along a row, or along a column if `is_upright`.
    fn length(&self, is_upright: bool) -> usize {
        (if is_upright { self.height } else { self.width }) - 2
    }

    /// Returns the index of a pixel, given its positions along and across a ruling, which is a
    /// column if `is_upright` is true, and a row otherwise. Returns `None` outside the picture.
    fn pixel_across(&self, is_upright: bool, along: usize, across: usize) -> Option<usize> {
        let [x, y] = if is_upright { [across, along] } else { [along, across] };
        (x < self.width && y < self.height).then(|| y * self.width + x)
    }

    /// Returns the pixels across a ruling within `reach` of its middle, at a position along it.
    fn near(&self, ruling: &Ruling, along: usize, reach: usize) -> impl Iterator<Item = usize> {
        let middle = self.middle(ruling, along);
        let across = middle.saturating_sub(reach)..=middle + reach;
        across.filter_map(move |across| self.pixel_across(ruling.is_upright, along, across))
    }

    /// Returns the position of a ruling's middle across the ruling.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the picture")]
    fn middle(&self, ruling: &Ruling, along: usize) -> usize {
        let part = (along - 1) as f64 / (self.length(ruling.is_upright) - 1) as f64;
        (ruling.ends[0] + part * (ruling.ends[1] - ruling.ends[0])).round().max(0.0) as usize
    }

    /// Returns the lines that have ink from edge to edge: columns if `is_upright` is true, and rows
    /// otherwise.
    fn rulings(&self, is_upright: bool) -> Vec<Ruling> {
        let length = self.length(is_upright);
        // Finds narrow marks near both edges, then pairs those with ink all the way between them.
        let from_edge = |along: &dyn Fn(usize) -> usize| {
            let mut marks = (0..FRAME.min(length)).map(|k| self.marks(is_upright, along(k)));
            marks.find(|marks| !marks.is_empty()).unwrap_or_default()
        };
        let [first, last] = [from_edge(&|k| 1 + k), from_edge(&|k| length - k)];
        let pairs = first.iter().filter_map(|(start, width, contrast)| {
            let ends = last.iter().filter(|mark| (mark.0 - start).abs() <= SLOPE * length as f64);
            ends.map(|mark| Ruling {
                is_upright,
                ends: [*start, mark.0],
                width: (*width).max(mark.1),
                contrast: contrast.min(mark.2),
            })
            .find_map(|ruling| self.inked(ruling))
        });
        pairs.collect()
    }

    /// Returns a ruling with its contrast, or `None` if too much of its length has no ink.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the picture")]
    fn inked(&self, ruling: Ruling) -> Option<Ruling> {
        let length = self.length(ruling.is_upright);
        let along = (1..=length).map(|along| {
            let near = self.near(&ruling, along, 1).map(|pixel| self.contrast[pixel]);
            near.fold(0.0, f64::max)
        });
        let mut along: Vec<f64> = along.collect();
        along.sort_by(f64::total_cmp);
        let [least, contrast] =
            [1.0 - ALONG, QUANTILE].map(|quantile| along[(quantile * length as f64) as usize]);
        let contrast = contrast.max(ruling.contrast);
        (least >= INKED * ruling.contrast).then_some(Ruling { contrast, ..ruling })
    }

    /// Returns the middle in pixels, the width in pixels and the contrast of each narrow mark of
    /// ink on a line across the picture. Rulings are upright if `is_upright` is true.
    fn marks(&self, is_upright: bool, along: usize) -> Vec<(f64, usize, f64)> {
        let side = self.length(!is_upright);
        let contrast = |across: usize| {
            let pixel = self.pixel_across(is_upright, along, across);
            pixel.filter(|pixel| self.ink[*pixel] > 0.0).map_or(0.0, |pixel| self.contrast[pixel])
        };
        let contrasts: Vec<f64> = (0..=side + 1).map(contrast).collect();
        let mut start = 0;
        let mut marks = Vec::new();
        for run in contrasts.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0)) {
            // Selects the dark part of the run, which ends at the picture's margin of paper.
            let most = run.iter().copied().fold(0.0, f64::max);
            let dark = |contrast: &f64| *contrast >= HALF * most;
            let (from, to) = (run.iter().position(dark), run.iter().rposition(dark));
            let (from, to) = (from.unwrap_or(0), to.unwrap_or(0));
            let width = to + 1 - from;
            if most > 0.0 && width as f64 <= (WIDTH * side as f64).max(6.0) {
                marks.push(((start + from) as f64 + 0.5 * (width - 1) as f64, width, most));
            }
            start += run.len();
        }
        marks
    }
}
