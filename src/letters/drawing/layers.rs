//! What lies on a page of an SVG file: areas in colors, and what cuts them.

use kurbo::{Affine, BezPath, PathEl, Point};

use super::super::curves::{on_grid, polylines, subpaths};
use super::super::outline::{self, Filled};
use super::MAX_POINTS;
use noctograph_core::files::Budget;
use noctograph_core::geometry::bounds;

/// Red, green and blue (sRGB).
pub(super) type Color = [u8; 3];

/// Largest distance of an area's edge from its curves, by the page's larger side.
pub(super) const FLATNESS: f64 = 2e-4;

/// Largest difference of a rectangle's area from that of its box, as a fraction, for rounding.
const ROUNDING: f64 = 1e-6;

/// Largest distance of a subpath's points from a line by its largest coordinate, for rounding.
const FLAT: f64 = 1e-6;

/// Budget steps of a point of an area.
const STEPS_PER_POINT: usize = 200;

/// An element that is painted: its colors have their opacities.
pub(super) struct Painted {
    /// Its path, y up.
    pub(super) path: BezPath,
    pub(super) even_odd: bool,
    pub(super) fill: Option<(Color, f64)>,
    pub(super) stroke: Option<(Color, f64, kurbo::Stroke)>,
    pub(super) placed: Affine,
    pub(super) cuts: Vec<usize>,
}

impl Painted {
    /// Its path with every subpath closed, as a fill closes it, without those that enclose nothing.
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

    /// The layer of its fill, if it has one. `element` is its index on the page.
    pub(super) fn fill_layer<'a>(&self, element: usize, scale: Scale<'a>) -> Option<Layer<'a>> {
        let (color, alpha) = self.fill?;
        let area = scale.area(&self.path, self.even_odd);
        Some(Layer { element, area, color, alpha, cuts: self.cuts.clone(), is_stroke: false })
    }

    /// The layer of its stroke, if it has one: the outline of a pen of the stroke's width.
    pub(super) fn stroke_layer<'a>(&self, element: usize, scale: Scale<'a>) -> Option<Layer<'a>> {
        let (color, alpha, style) = self.stroke.as_ref()?;
        // A pen is round in the units of the element, which its transform may stretch.
        let path = self.placed.inverse() * &self.path;
        let scale_factor = self.placed.determinant().abs().sqrt().max(f64::MIN_POSITIVE);
        let tolerance = FLATNESS * scale.size / scale_factor;
        let outline = kurbo::stroke(path.iter(), style, &kurbo::StrokeOpts::default(), tolerance);
        let area = scale.area(&(self.placed * outline), false);
        let (color, alpha, cuts) = (*color, *alpha, self.cuts.clone());
        Some(Layer { element, area, color, alpha, cuts, is_stroke: true })
    }
}

/// True if all points of a subpath lie on one line, but for rounding.
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

/// An area with an even-odd or a nonzero rule.
pub(super) struct Area<'a> {
    pub(super) contours: Vec<Vec<[f64; 2]>>,
    pub(super) filled: Filled<'a>,
    even_odd: bool,
    pub(super) bounds: [f64; 4],
}

/// The larger side of a page, which sets the tolerance of areas, and the budget of their work.
#[derive(Clone, Copy)]
pub(super) struct Scale<'a> {
    pub(super) size: f64,
    pub(super) budget: &'a Budget,
}

impl<'a> Scale<'a> {
    /// The area of a path. Empty if it has too many points, or the budget is spent.
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
    /// True if a point is in the area.
    pub(super) fn holds(&self, [x, y]: [f64; 2]) -> bool {
        if !self.meets([x, y, x, y]) {
            return false;
        }
        let winding = self.filled.winding([x, y]);
        if self.even_odd { winding % 2 != 0 } else { winding != 0 }
    }

    /// True if it is a rectangle that covers a page, within a slack.
    pub(super) fn is_page(&self, [width, height]: [f64; 2], slack: f64) -> bool {
        let [left, bottom, right, top] = self.bounds;
        let is_as_wide = left <= slack && right >= width - slack;
        let is_as_high = top >= -slack && bottom <= slack - height;
        let area = self.contours.iter().map(|contour| outline::area(contour)).sum::<f64>();
        let box_ = (right - left) * (top - bottom);
        is_as_wide && is_as_high && (area.abs() - box_).abs() < ROUNDING * box_
    }

    /// True if its bounds meet a box: left, bottom, right, top.
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
    pub(super) color: Color,
    pub(super) alpha: f64,
    pub(super) cuts: Vec<usize>,
    pub(super) is_stroke: bool,
}

/// What limits where an element shows.
pub(super) enum Cut<'a> {
    /// The edge of the page.
    Page(Area<'a>),
    /// The areas of a clip path, each with the cuts of its own.
    Clip(Vec<Layer<'a>>),
    /// A mask: its elements, true if only their opacity counts, and its rectangle.
    Mask(Vec<Layer<'a>>, bool, Area<'a>),
}

impl<'a> Cut<'a> {
    /// The area that bounds it, if any, and the layers that it is made of.
    pub(super) fn parts(&self) -> (Option<&Area<'a>>, &[Layer<'a>]) {
        match self {
            Self::Page(edge) => (Some(edge), &[]),
            Self::Clip(layers) => (None, layers),
            Self::Mask(layers, _, edge) => (Some(edge), layers),
        }
    }
}
