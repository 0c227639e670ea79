//! What lies on a page of an SVG file: areas in colors, and what cuts them.

use kurbo::{Affine, BezPath};

use super::super::curves::polylines;
use super::super::outline::Filled;
use super::MAX_POINTS;
use super::gradient::Paint;
use noctograph_core::files::Budget;
use noctograph_core::geometry::bounds;

/// Largest distance of an area's edge from its curves, by the page's larger side.
pub(super) const FLATNESS: f64 = 2e-4;

/// Steps of a point of an area.
const POINT_STEPS: usize = 200;

/// An element that is painted.
pub(super) struct Painted {
    /// Its path, y up.
    pub(super) path: BezPath,
    pub(super) even_odd: bool,
    pub(super) fill: Option<(Paint, f64)>,
    pub(super) stroke: Option<(Paint, f64)>,
    /// What the stroke covers where it has the color of the paper.
    pub(super) stroke_area: Option<kurbo::Stroke>,
    pub(super) placed: Affine,
    pub(super) cuts: Vec<usize>,
}

/// What limits where an element shows.
pub(super) enum Cut {
    /// The areas of a clip path, each with the cuts of its own.
    Clip(Vec<Painted>),
    /// A mask: its elements, whether it is by their opacity alone, and its rectangle.
    Mask(Vec<Painted>, bool, BezPath),
    /// The edge of the page.
    Page(BezPath),
}

/// An area with an even-odd or a nonzero rule.
pub(super) struct Area<'a> {
    pub(super) contours: Vec<Vec<[f64; 2]>>,
    pub(super) filled: Filled<'a>,
    even_odd: bool,
    pub(super) bounds: [f64; 4],
}

impl<'a> Area<'a> {
    pub(super) fn new(path: &BezPath, even_odd: bool, size: f64, budget: &'a Budget) -> Self {
        let most = if budget.spend_steps(1) { MAX_POINTS } else { 0 };
        let mut contours = polylines(path, FLATNESS * size, most).unwrap_or_default();
        contours.retain(|contour| contour.len() > 2);
        budget.spend_steps(POINT_STEPS * contours.iter().map(Vec::len).sum::<usize>());
        let bounds = bounds(contours.iter().flatten().copied());
        Self { filled: Filled::new(&contours, budget), contours, even_odd, bounds }
    }

    pub(super) fn holds(&self, place: [f64; 2]) -> bool {
        let [left, bottom, right, top] = self.bounds;
        let [x, y] = place;
        if !(left <= x && x <= right && bottom <= y && y <= top) {
            return false;
        }
        let winding = self.filled.winding(place);
        if self.even_odd { winding % 2 != 0 } else { winding != 0 }
    }

    pub(super) fn meets(&self, other: [f64; 4]) -> bool {
        let [left, bottom, right, top] = self.bounds;
        left <= other[2] && other[0] <= right && bottom <= other[3] && other[1] <= top
    }
}

/// An area in a color.
pub(super) struct Layer<'a> {
    /// The element that it is of.
    pub(super) element: usize,
    pub(super) area: Area<'a>,
    pub(super) paint: Paint,
    pub(super) alpha: f64,
    pub(super) cuts: Vec<usize>,
    pub(super) is_stroke: bool,
}

/// A cut as areas.
pub(super) enum Limit<'a> {
    Clip(Vec<(Area<'a>, Vec<usize>)>),
    Mask(Vec<Layer<'a>>, bool, Area<'a>),
    Page(Area<'a>),
}

pub(super) fn layer<'a>(
    element: usize,
    area: Area<'a>,
    paint: Paint,
    alpha: f64,
    of: &Painted,
) -> Layer<'a> {
    Layer { element, area, paint, alpha, cuts: of.cuts.clone(), is_stroke: false }
}

/// The area of a stroke.
pub(super) fn stroke_outline(item: &Painted, size: f64) -> BezPath {
    let Some(style) = &item.stroke_area else { return BezPath::new() };
    let user_from_place = item.placed.inverse();
    let path = user_from_place * &item.path;
    let scale = item.placed.determinant().abs().sqrt().max(f64::MIN_POSITIVE);
    let tolerance = FLATNESS * size / scale;
    item.placed * kurbo::stroke(path.iter(), style, &kurbo::StrokeOpts::default(), tolerance)
}
