//! The content of an SVG page: colored areas, and the clips and masks that cut them.

use kurbo::{Affine, BezPath, PathEl, Point};

use super::super::curves::{on_grid, polylines, subpaths};
use super::super::outline::{self, Filled};
use super::MAX_POINTS;
use noctograph_core::files::Budget;
use noctograph_core::geometry::bounds;

/// A color as red, green and blue (sRGB).
pub(super) type Color = [u8; 3];

/// Maximum distance between an area's edge and its curves, relative to the page's larger side.
pub(super) const FLATNESS: f64 = 2e-4;

/// Maximum relative difference between a rectangle's area and that of its box, caused by rounding.
const ROUNDING: f64 = 1e-6;

/// Maximum distance between a flat subpath's points and a line, relative to its largest coordinate.
const FLAT: f64 = 1e-6;

/// Budget steps per point of an area.
const STEPS_PER_POINT: usize = 200;

/// An element that is painted, with its colors and their opacities.
pub(super) struct Painted {
    /// Path of the element (y up).
    pub(super) path: BezPath,
    pub(super) even_odd: bool,
    pub(super) fill: Option<(Color, f64)>,
    pub(super) stroke: Option<(Color, f64, kurbo::Stroke)>,
    pub(super) placed: Affine,
    pub(super) cuts: Vec<usize>,
}

impl Painted {
    /// Returns the path with every subpath closed, as for a fill, except flat subpaths.
    pub(super) fn closed(&self) -> BezPath {
        let mut closed = BezPath::new();
        let subpaths = subpaths(&self.path).into_iter();
        for (first, elements) in subpaths.filter(|(first, elements)| !is_flat(*first, elements)) {
            closed.move_to(first);
            let is_closed = elements.last() == Some(&PathEl::ClosePath);
            closed.extend(elements);
            if !is_closed {
                closed.close_path();
            }
        }
        closed
    }

    /// Returns the layer of the fill, if any. `element` is the element's index on the page.
    pub(super) fn fill_layer<'a>(&self, element: usize, scale: Scale<'a>) -> Option<Layer<'a>> {
        let (color, alpha) = self.fill?;
        let area = scale.area(&self.path, self.even_odd);
        Some(Layer { element, area, color, alpha, cuts: self.cuts.clone(), is_stroke: false })
    }

    /// Returns the layer of the stroke, if any: the outline of a pen of the stroke's width.
    pub(super) fn stroke_layer<'a>(&self, element: usize, scale: Scale<'a>) -> Option<Layer<'a>> {
        let (color, alpha, style) = self.stroke.as_ref()?;
        // The pen is round in the units of the element, and its transform may stretch it.
        let path = self.placed.inverse() * &self.path;
        let scale_factor = self.placed.determinant().abs().sqrt().max(f64::MIN_POSITIVE);
        let tolerance = FLATNESS * scale.size / scale_factor;
        let outline = kurbo::stroke(path.iter(), style, &kurbo::StrokeOpts::default(), tolerance);
        let area = scale.area(&(self.placed * outline), false);
        let (color, alpha, cuts) = (*color, *alpha, self.cuts.clone());
        Some(Layer { element, area, color, alpha, cuts, is_stroke: true })
    }
}

/// True if all points of a subpath, which begins at `first`, are on one line, apart from rounding.
fn is_flat(first: Point, elements: &[PathEl]) -> bool {
    let points = elements.iter().flat_map(|element| match *element {
        PathEl::MoveTo(p) | PathEl::LineTo(p) => vec![p],
        PathEl::QuadTo(a, p) => vec![a, p],
        PathEl::CurveTo(a, b, p) => vec![a, b, p],
        PathEl::ClosePath => Vec::new(),
    });
    let points: Vec<Point> = points.collect();
    let largest = points.iter().map(|p| p.x.abs().max(p.y.abs())).fold(0.0, f64::max);
    let offsets = points.iter().map(|point| *point - first);
    let farthest = offsets.clone().max_by(|a, b| a.hypot2().total_cmp(&b.hypot2()));
    let along = farthest.unwrap_or_default();
    offsets.into_iter().all(|p| along.cross(p).abs() <= FLAT * largest * along.hypot())
}

/// An area filled by the even-odd or the nonzero rule.
pub(super) struct Area<'a> {
    pub(super) contours: Vec<Vec<[f64; 2]>>,
    pub(super) filled: Filled<'a>,
    even_odd: bool,
    pub(super) bounds: [f64; 4],
}

/// The larger side of a page, which determines the tolerance of areas, and the budget for work.
#[derive(Clone, Copy)]
pub(super) struct Scale<'a> {
    pub(super) size: f64,
    pub(super) budget: &'a Budget,
}

impl<'a> Scale<'a> {
    /// Returns the area of a path, by the even-odd rule if `even_odd` is true, and otherwise by the
    /// nonzero rule. The area is empty if there are too many points or the budget is spent.
    pub(super) fn area(self, path: &BezPath, even_odd: bool) -> Area<'a> {
        let Self { size, budget } = self;
        let max_points = if budget.spend_steps(1) { MAX_POINTS } else { 0 };
        let tolerance = FLATNESS * size;
        let contours = polylines(path, tolerance, max_points).unwrap_or_default();
        let mut contours = on_grid(contours, path, tolerance);
        contours.retain(|contour| contour.len() > 2);
        budget.spend_steps(STEPS_PER_POINT * contours.iter().map(Vec::len).sum::<usize>());
        let bounds = bounds(contours.iter().flatten().copied());
        Area { filled: Filled::new(&contours, budget), contours, even_odd, bounds }
    }
}

impl Area<'_> {
    /// True if a point is inside the area.
    pub(super) fn holds(&self, [x, y]: [f64; 2]) -> bool {
        if !self.meets([x, y, x, y]) {
            return false;
        }
        let winding = self.filled.winding([x, y]);
        if self.even_odd { winding % 2 != 0 } else { winding != 0 }
    }

    /// True if the area is a rectangle that covers a page with a width and a height, within
    /// `slack`. These lengths are in user units, and the page lies below y = 0.
    pub(super) fn is_page(&self, [width, height]: [f64; 2], slack: f64) -> bool {
        let [left, bottom, right, top] = self.bounds;
        let is_as_wide = left <= slack && right >= width - slack;
        let is_as_high = top >= -slack && bottom <= slack - height;
        let area = self.contours.iter().map(|contour| outline::area(contour)).sum::<f64>();
        let box_area = (right - left) * (top - bottom);
        is_as_wide && is_as_high && (area.abs() - box_area).abs() < ROUNDING * box_area
    }

    /// True if the bounds of the area overlap a box (left, bottom, right and top).
    pub(super) fn meets(&self, other: [f64; 4]) -> bool {
        let [left, bottom, right, top] = self.bounds;
        left <= other[2] && other[0] <= right && bottom <= other[3] && other[1] <= top
    }
}

/// An area with a color.
pub(super) struct Layer<'a> {
    /// Index of the layer's element.
    pub(super) element: usize,
    pub(super) area: Area<'a>,
    pub(super) color: Color,
    pub(super) alpha: f64,
    pub(super) cuts: Vec<usize>,
    pub(super) is_stroke: bool,
}

/// A restriction of the area in which an element is visible.
pub(super) enum Cut<'a> {
    /// The edge of the page.
    Page(Area<'a>),
    /// The areas of a clip path, each with its own cuts.
    Clip(Vec<Layer<'a>>),
    /// A mask: its elements, whether only their opacity counts, and its rectangle.
    Mask(Vec<Layer<'a>>, bool, Area<'a>),
}

impl<'a> Cut<'a> {
    /// Returns the area that bounds the cut, if any, and the layers that form the cut.
    pub(super) fn parts(&self) -> (Option<&Area<'a>>, &[Layer<'a>]) {
        match self {
            Self::Page(edge) => (Some(edge), &[]),
            Self::Clip(layers) => (None, layers),
            Self::Mask(layers, _, edge) => (Some(edge), layers),
        }
    }
}
