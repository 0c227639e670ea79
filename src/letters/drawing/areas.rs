//! Areas and lines: which patches of ink are drawn along their rim, and which along their center.
//!
//! A patch is a line if it is thin for its size, or if a pen along its center lines would leave the
//! same ink in one stroke. A patch of several strokes, or a ring, is a line if the drawing has such
//! a pen: that of its thin lines, or of writing in a row. Other patches are areas, or points if
//! they are tiny.

use std::cell::OnceCell;

use crate::center_line::{CenterLines, center_lines, outlines};
use crate::outline::{Contour, Filled, mean_stroke_width};
use crate::vector::legs;
use noctograph_core::files::Budget;
use noctograph_core::geometry::{bounds, segment_distance};
use noctograph_core::statistics::median;

/// Mean width of a line, by the larger side of its patch.
const THIN: f64 = 0.1;
/// Greatest mean width of a patch that may be a pen's line.
const SOLID: f64 = 0.3;
/// A patch that is smaller than this share of the drawing is a point.
const POINT: f64 = 0.025;
/// Greatest thickness of a line and of a dot, in pens.
const PENS: f64 = 2.0;
const DOTS: f64 = 1.5;
/// A pen's line is longer than so many of its thicknesses.
const LONG: f64 = 2.0;
/// Ink that a pen along the center lines shares with a patch, by that of both: threshold for a
/// line, and for a line of the drawing's pen or a letter beside others; and the grid for its
/// estimate.
const PENNED: [f64; 2] = [0.82, 0.65];
const GRID: u32 = 40;
/// Largest ratio of heights and of thicknesses of letters in a row, largest gap between two, by
/// their height, and the least number of neighbors of a letter.
const ALIKE: f64 = 1.6;
const GAP: f64 = 2.5;
const LETTERS: usize = 2;

/// Steps of measuring the distance from a leg.
const STEPS: usize = 10;

/// Pixels of a small patch's unit of length. Center lines are smoothed by 0.004 of it, about what
/// a rim between pixels is off; those of a larger patch by its size, and at most by that of a
/// letter.
const SMALL_PX: f64 = 100.0;

/// A patch of ink: a contour and its holes.
pub(super) struct Patch<'a> {
    /// In the patch's own unit.
    contours: Vec<Contour>,
    /// In pixels.
    unit_px: f64,
    /// In pixels.
    bounds: [f64; 4],
    /// By its larger side.
    width: f64,
    center: Option<CenterLines>,
    penned: OnceCell<f64>,
    budget: &'a Budget,
}

impl<'a> Patch<'a> {
    /// A patch, in pixels, of a drawing whose larger side and cap height are given.
    pub(super) fn new(
        mut contours: Vec<Contour>,
        [larger_px, cap_height_px]: [f64; 2],
        budget: &'a Budget,
    ) -> Self {
        let bounds = bounds(contours[0].iter().copied());
        let size_px = size(bounds);
        let width = mean_stroke_width(&contours) / size_px;
        let unit_px = size_px.max(SMALL_PX).min(cap_height_px);
        let points = contours.iter_mut().flatten().flatten();
        points.for_each(|x| *x /= unit_px);
        let may_be_line = width < SOLID || size_px < THIN * larger_px;
        let center = may_be_line.then(|| center_lines(&contours, budget));
        Self { contours, unit_px, bounds, width, center, penned: OnceCell::new(), budget }
    }

    /// Its outline, in pixels.
    pub(super) fn outline(&self) -> impl Iterator<Item = Vec<[f64; 2]>> {
        outlines(&self.contours, self.budget).into_iter().map(|line| self.in_pixels(line))
    }

    fn in_pixels(&self, line: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
        line.into_iter().map(|point| point.map(|x| x * self.unit_px)).collect()
    }

    /// Half of its width, and half of its greatest width, in pixels; 0 without center lines.
    fn pen_px(&self) -> [f64; 2] {
        let center = self.center.as_ref();
        center.map_or([0.0; 2], |it| [it.half_width, it.thickest].map(|x| x * self.unit_px))
    }

    fn is_thin(&self) -> bool {
        self.width <= THIN
    }

    /// Ink that a pen along its center lines would share with it, by that of both.
    fn penned(&self) -> f64 {
        *self.penned.get_or_init(|| self.center.as_ref().map_or(0.0, |it| self.penned_along(it)))
    }

    fn penned_along(&self, center: &CenterLines) -> f64 {
        let legs: Vec<[[f64; 2]; 2]> = center.lines.iter().flat_map(|line| legs(line)).collect();
        if center.length() < 2.0 * LONG * center.thickest
            || !self.budget.spend_steps(STEPS * legs.len() * (GRID * GRID) as usize)
        {
            return 0.0;
        }
        let ink = Filled::new(&self.contours, self.budget);
        let [left, bottom, right, top] = self.bounds.map(|x| x / self.unit_px);
        let [mut both, mut any] = [0; 2];
        for (x, y) in (0..GRID * GRID).map(|k| (k % GRID, k / GRID)) {
            let place = [(x, left, right), (y, bottom, top)]
                .map(|(k, from, to)| from + (to - from) * (f64::from(k) + 0.5) / f64::from(GRID));
            let penned = legs.iter().any(|leg| segment_distance(place, *leg) <= center.half_width);
            let inked = ink.holds(place);
            both += u32::from(penned && inked);
            any += u32::from(penned || inked);
        }
        f64::from(both) / f64::from(any.max(1))
    }

    /// Whether two patches are letters of one line of writing.
    fn is_beside(&self, other: &Self) -> bool {
        let ([l, b, r, t], [left, bottom, right, top]) = (self.bounds, other.bounds);
        let overlap = t.min(top) - b.max(bottom);
        let gap = left.max(l) - right.min(r);
        let pairs = [[t - b, top - bottom], [self.pen_px()[0], other.pen_px()[0]]];
        pairs.iter().all(|[a, b]| a.max(*b) <= ALIKE * a.min(*b))
            && overlap > 0.5 * (t - b).min(top - bottom)
            && gap < GAP * (t - b).max(top - bottom)
    }
}

fn size([left, bottom, right, top]: [f64; 4]) -> f64 {
    (right - left).max(top - bottom)
}

/// The lines of the patches of a drawing whose larger side is given, in pixels.
pub(super) fn lines(patches: Vec<Patch<'_>>, larger_px: f64) -> Vec<Vec<[f64; 2]>> {
    let letters = Vec::from_iter(patches.iter().map(|patch| {
        if patch.is_thin() || patch.penned() < PENNED[1] {
            return false;
        }
        let mut beside: Vec<&Patch<'_>> = patches.iter().collect();
        beside.retain(|other| !std::ptr::eq(patch, *other) && patch.is_beside(other));
        beside.len() >= LETTERS && beside.iter().any(|other| other.penned() > PENNED[0])
    }));
    let thin = patches.iter().filter(|patch| patch.is_thin());
    let pen = median(thin.map(|patch| patch.pen_px()[0])).unwrap_or(0.0);
    let written = patches.iter().zip(&letters).filter(|(_, is_letter)| **is_letter);
    let letter_pen = median(written.map(|(patch, _)| patch.pen_px()[0])).unwrap_or(0.0);
    let mut lines = Vec::new();
    for (patch, is_letter) in patches.iter().zip(&letters) {
        let line = patch.center.as_ref().filter(|center| {
            let thickest = patch.pen_px()[1];
            let is_point = size(patch.bounds) < POINT * larger_px;
            let is_dot =
                center.length() < center.thickest && thickest <= DOTS * letter_pen.max(pen);
            let is_single = patch.contours.len() == 1 && center.lines.len() == 1;
            patch.is_thin()
                || is_single && patch.penned() > PENNED[0]
                || *is_letter
                || is_point
                || is_dot
                || thickest <= PENS * pen && patch.penned() > PENNED[1]
        });
        match line {
            Some(center) => {
                lines.extend(center.lines.iter().map(|line| patch.in_pixels(line.clone())));
            }
            None => lines.extend(patch.outline()),
        }
    }
    lines
}
