//! Rulings of paper in a picture: straight lines from edge to edge that are paler than the pen.

use super::ink::Field;
use super::patches::FAINT;

/// Minimum number of rulings on a page. Fewer straight lines may belong to the drawing.
const LEAST: usize = 4;
/// Minimum number of rulings on a page that also has marks too faint to be ink, which are probably
/// further rulings.
const LEAST_BESIDE_FAINT: usize = 1;
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
/// Width in pixels of a blurred thin line, which is allowed in any picture.
const BLURRED_PX: f64 = 6.0;
/// Number of pixels on both sides of a ruling's dark part that may have some of its ink.
const BLUR: usize = 2;

/// Narrow mark of ink on a line across the picture.
struct Mark {
    /// Position of the mark's middle on the line, in pixels.
    middle: f64,
    /// Width of the mark's dark part in pixels.
    width: usize,
    contrast: f64,
}

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
    /// Drops the ink of the paper's rulings, and returns their number. If the straight lines from
    /// edge to edge belong to the drawing, nothing is dropped, and the number is 0.
    pub(super) fn drop_rulings(&mut self) -> usize {
        let rulings: Vec<Ruling> =
            [false, true].into_iter().flat_map(|is_upright| self.rulings(is_upright)).collect();
        if !self.are_of_paper(&rulings) {
            return 0;
        }
        rulings.iter().for_each(|ruling| self.erase(ruling));
        rulings.len()
    }

    /// True if lines from edge to edge are rulings of the paper: there are enough of them, and the
    /// drawing has darker ink. Without darker ink, the lines are the drawing itself.
    fn are_of_paper(&self, rulings: &[Ruling]) -> bool {
        let least = if self.faint > FAINT { LEAST_BESIDE_FAINT } else { LEAST };
        let darkest = rulings.iter().map(|ruling| ruling.contrast).fold(0.0, f64::max);
        let n_dark = self.contrast.iter().filter(|contrast| PALE * **contrast > darkest).count();
        rulings.len() >= least && n_dark as f64 >= DRAWING * self.contrast.len() as f64
    }

    /// Removes the ink of a ruling. A pen's line on the ruling remains because its ink is darker.
    fn erase(&mut self, ruling: &Ruling) {
        let places = 1..=self.length(ruling.is_upright);
        let pixels = places.flat_map(|along| self.near(ruling, along, ruling.width / 2 + BLUR));
        let pale = pixels.filter(|pixel| self.contrast[*pixel] < RULED * ruling.contrast);
        for pixel in pale.collect::<Vec<usize>>() {
            (self.ink[pixel], self.contrast[pixel]) = (0.0, 0.0);
        }
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
        // Narrow marks near both edges are paired if there is ink all the way between them.
        let from_edge = |along: &dyn Fn(usize) -> usize| {
            let mut marks = (0..FRAME.min(length)).map(|k| self.marks(is_upright, along(k)));
            marks.find(|marks| !marks.is_empty()).unwrap_or_default()
        };
        let [first, last] = [from_edge(&|k| 1 + k), from_edge(&|k| length - k)];
        let pairs = first.iter().filter_map(|start| {
            let is_level = |end: &&Mark| (end.middle - start.middle).abs() <= SLOPE * length as f64;
            let ends = last.iter().filter(is_level);
            ends.map(|end| Ruling {
                is_upright,
                ends: [start.middle, end.middle],
                width: start.width.max(end.width),
                contrast: start.contrast.min(end.contrast),
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

    /// Returns the narrow marks of ink on the line across the picture at the position `along` of
    /// the rulings. Rulings are upright if `is_upright` is true.
    fn marks(&self, is_upright: bool, along: usize) -> Vec<Mark> {
        let side = self.length(!is_upright);
        let contrast = |across: usize| {
            let pixel = self.pixel_across(is_upright, along, across);
            pixel.filter(|pixel| self.ink[*pixel] > 0.0).map_or(0.0, |pixel| self.contrast[pixel])
        };
        let contrasts: Vec<f64> = (0..=side + 1).map(contrast).collect();
        let mut start = 0;
        let mut marks = Vec::new();
        for run in contrasts.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0)) {
            // A mark is the dark part of a run. The margin of paper ends the runs at the edge.
            let most = run.iter().copied().fold(0.0, f64::max);
            let dark = |contrast: &f64| *contrast >= HALF * most;
            let (from, to) = (run.iter().position(dark), run.iter().rposition(dark));
            let (from, to) = (from.unwrap_or(0), to.unwrap_or(0));
            let width = to + 1 - from;
            if most > 0.0 && width as f64 <= (WIDTH * side as f64).max(BLURRED_PX) {
                let middle = (start + from) as f64 + 0.5 * (width - 1) as f64;
                marks.push(Mark { middle, width, contrast: most });
            }
            start += run.len();
        }
        marks
    }
}
