//! Decides which patches of ink are areas, drawn along their outline, and which are lines, drawn
//! along their center.
//!
//! A patch is a line if it is thin for its size, or if a single pen stroke along its center would
//! leave the same ink. A patch of several strokes, or a ring, is a line if thin lines or letters in
//! a row show that the drawing was made with such a pen. Other patches are areas, or points if they
//! are tiny.

use crate::center_line::{CenterLines, center_lines, outlines};
use crate::outline::{Contour, Filled, mean_stroke_width};
use crate::vector::segments;
use noctograph_core::files::Budget;
use noctograph_core::geometry::{bounds, segment_distance};
use noctograph_core::statistics::median;

/// Maximum mean width of a line, relative to the larger side of its patch.
const THIN: f64 = 0.1;
/// Maximum mean width of a patch that may be a pen's line, relative to its larger side.
const SOLID: f64 = 0.3;
/// Maximum side of a patch that counts as a point, relative to the drawing's larger side.
const POINT: f64 = 0.025;
/// Maximum thickness of a line and of a dot, in pen widths.
const PENS: f64 = 2.0;
const DOTS: f64 = 1.5;
/// Minimum length of a pen stroke, relative to half its maximum thickness.
const LONG: f64 = 4.0;
/// Minimum intersection over union of a patch and a pen's line along its center: for a line on its
/// own, and for a letter beside others or a line of the drawing's pen.
const PENNED: [f64; 2] = [0.82, 0.65];
/// Number of points along a side of the grid on which the overlap is estimated.
const GRID: u32 = 40;
/// Maximum ratio of heights, and of thicknesses, between letters in a row.
const ALIKE: f64 = 1.6;
/// Maximum gap between two letters, relative to their height.
const GAP: f64 = 2.5;
/// Minimum number of neighboring letters for a patch to be a letter.
const LETTERS: usize = 2;

/// Budget steps for measuring the distance from a point to a segment.
const STEPS_PER_DISTANCE: usize = 10;

/// Number of pixels in a small patch's unit of length. Smoothing has a tolerance of 0.004 units,
/// about the subpixel error of an edge. The unit of a larger patch is its size, up to that of a
/// letter.
const SMALL_PX: f64 = 100.0;

/// A patch of ink: an outer contour and its holes.
pub(super) struct Patch<'a> {
    /// Contours in the patch's unit of length.
    contours: Vec<Contour>,
    unit_px: f64,
    bounds_px: [f64; 4],
    /// Mean width of the patch, relative to its larger side.
    width: f64,
    center: Option<CenterLines>,
    /// Half the pen's mean width and half its maximum width in pixels, or 0 without center lines.
    pen_px: [f64; 2],
    /// Intersection over union of patch and pen's line along its center, or 0 for a thin patch.
    penned: f64,
    budget: &'a Budget,
}

impl<'a> Patch<'a> {
    /// Creates a patch from contours in pixels. `larger_px` is the larger side of the drawing, and
    /// `cap_height_px` the cap height on its scale.
    pub(super) fn new(
        mut contours: Vec<Contour>,
        [larger_px, cap_height_px]: [f64; 2],
        budget: &'a Budget,
    ) -> Self {
        let bounds_px = bounds(contours[0].iter().copied());
        let size_px = size(bounds_px);
        let width = mean_stroke_width(&contours) / size_px;
        let unit_px = size_px.max(SMALL_PX).min(cap_height_px);
        contours.iter_mut().flatten().flatten().for_each(|x| *x /= unit_px);
        // Center lines are only computed for a patch that may be a line.
        let may_be_line = width < SOLID || size_px < THIN * larger_px;
        let center = may_be_line.then(|| center_lines(&contours, budget));
        let pen = center.as_ref().map_or([0.0; 2], |center| [center.half_width, center.thickest]);
        let penned = match &center {
            Some(center) if width > THIN => pen_overlap(&contours, center, budget),
            _ => 0.0,
        };
        let pen_px = pen.map(|x| x * unit_px);
        Self { contours, unit_px, bounds_px, width, center, pen_px, penned, budget }
    }

    /// Returns the edges of the patch's ink in pixels, each a polyline.
    pub(super) fn outline(&self) -> Vec<Vec<[f64; 2]>> {
        self.in_pixels(outlines(&self.contours, self.budget))
    }

    /// Converts lines from the patch's unit to pixels.
    fn in_pixels(&self, mut lines: Vec<Vec<[f64; 2]>>) -> Vec<Vec<[f64; 2]>> {
        lines.iter_mut().flatten().flatten().for_each(|x| *x *= self.unit_px);
        lines
    }

    /// True if two patches may be neighbors in a line of writing, that is, have about the same
    /// height and thickness, overlap in height, and have a small gap between them.
    fn is_beside(&self, other: &Self) -> bool {
        let ([left_a, bottom_a, right_a, top_a], [left_b, bottom_b, right_b, top_b]) =
            (self.bounds_px, other.bounds_px);
        let (height_a, height_b) = (top_a - bottom_a, top_b - bottom_b);
        let overlap = top_a.min(top_b) - bottom_a.max(bottom_b);
        let gap = left_b.max(left_a) - right_b.min(right_a);
        let pairs = [[height_a, height_b], [self.pen_px[0], other.pen_px[0]]];
        pairs.iter().all(|[a, b]| a.max(*b) <= ALIKE * a.min(*b))
            && overlap > 0.5 * height_a.min(height_b)
            && gap < GAP * height_a.max(height_b)
    }

    /// True if the patch is a letter beside others, one of which is clearly a pen stroke.
    fn is_letter(&self, patches: &[Self]) -> bool {
        let is_beside = |other: &&Self| !std::ptr::eq(self, *other) && self.is_beside(other);
        let beside: Vec<&Self> = patches.iter().filter(is_beside).collect();
        let is_written = beside.iter().any(|other| other.penned > PENNED[0]);
        self.penned >= PENNED[1] && beside.len() >= LETTERS && is_written
    }
}

/// Returns the larger side of a box.
fn size([left, bottom, right, top]: [f64; 4]) -> f64 {
    (right - left).max(top - bottom)
}

/// Estimates, on a grid, the intersection over union of the ink inside contours and of a pen along
/// their center lines, 0 to 1. Returns 0 if the lines are short or the budget is spent.
fn pen_overlap(contours: &[Contour], center: &CenterLines, budget: &Budget) -> f64 {
    let segments: Vec<[[f64; 2]; 2]> =
        center.lines.iter().flat_map(|line| segments(line)).collect();
    if center.length() < LONG * center.thickest
        || !budget.spend_steps(STEPS_PER_DISTANCE * segments.len() * (GRID * GRID) as usize)
    {
        return 0.0;
    }
    // A grid point is penned if it lies within half a pen's width of a center line.
    let ink = Filled::new(contours, budget);
    let [left, bottom, right, top] = bounds(contours[0].iter().copied());
    let [mut n_both, mut n_any] = [0; 2];
    for (x, y) in (0..GRID * GRID).map(|k| (k % GRID, k / GRID)) {
        let point = [(x, left, right), (y, bottom, top)]
            .map(|(k, from, to)| from + (to - from) * (f64::from(k) + 0.5) / f64::from(GRID));
        let penned =
            segments.iter().any(|ends| segment_distance(point, *ends) <= center.half_width);
        let inked = ink.holds(point);
        n_both += u32::from(penned && inked);
        n_any += u32::from(penned || inked);
    }
    f64::from(n_both) / f64::from(n_any.max(1))
}

/// Returns the lines of all patches in pixels: center lines of pen strokes, and outlines of areas.
/// `larger_px` is the larger side of the drawing.
pub(super) fn lines(patches: &[Patch<'_>], larger_px: f64) -> Vec<Vec<[f64; 2]>> {
    let letters = Vec::from_iter(patches.iter().map(|patch| patch.is_letter(patches)));
    // The drawing's pen is measured on its thin lines and on its letters.
    let thin = patches.iter().filter(|patch| patch.width <= THIN);
    let pen_px = median(thin.map(|patch| patch.pen_px[0])).unwrap_or(0.0);
    let written = patches.iter().zip(&letters).filter(|(_, is_letter)| **is_letter);
    let letter_px = median(written.map(|(patch, _)| patch.pen_px[0])).unwrap_or(0.0);
    let lines = patches.iter().zip(&letters).flat_map(|(patch, is_letter)| {
        let line = patch.center.as_ref().filter(|center| {
            // A patch counts as a line because of its shape, its neighbors, or the drawing's pen.
            let thickest_px = patch.pen_px[1];
            let is_point = size(patch.bounds_px) < POINT * larger_px;
            let is_dot =
                center.length() < center.thickest && thickest_px <= DOTS * letter_px.max(pen_px);
            let is_single = patch.contours.len() == 1 && center.lines.len() == 1;
            patch.width <= THIN
                || is_single && patch.penned > PENNED[0]
                || *is_letter
                || is_point
                || is_dot
                || thickest_px <= PENS * pen_px && patch.penned > PENNED[1]
        });
        line.map_or_else(|| patch.outline(), |center| patch.in_pixels(center.lines.clone()))
    });
    lines.collect()
}
