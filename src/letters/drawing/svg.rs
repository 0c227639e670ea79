//! SVG: visible paths, with `use`, transforms, basic shapes, styles and dashes resolved by usvg and
//! kurbo. Text is written with the scene's font; clips, masks and pictures are ignored.

use std::panic::{AssertUnwindSafe, catch_unwind};

use kurbo::{Affine, BezPath, Point, Shape};
use usvg::tiny_skia_path::{self, PathSegment};
use usvg::{ImageHrefResolver, Node, Options, Tree, roxmltree};

use super::super::curves::polylines;
use super::gradient::{Gradient, Paint, affine};
use super::plain::{STYLE, plain};
use super::{ColoredLine, LIMIT, LetterOptions, MAX_POINTS, css, text, too_many, xml};
use crate::error::{Error, Result};
use crate::files::Budget;
use crate::geometry;

/// Most elements and attributes of a file, before `use`.
const MAX_NODES: u32 = 200_000;

/// A path with its paint.
type Drawn = (BezPath, Paint);

/// The paths of an SVG file in its user units, y up, and the gradients of their paints.
pub(super) fn read(
    bytes: &[u8],
    options: &LetterOptions,
    file: &str,
) -> Result<(Vec<Drawn>, Vec<Gradient>)> {
    let refuse = |found: String| {
        let hint = "open the file in an SVG editor, and save it as plain SVG";
        Error::input(file, found, "an SVG drawing", hint)
    };
    let text = std::str::from_utf8(bytes).map_err(|broken| refuse(broken.to_string()))?;
    let budget = Budget::of(file, LIMIT.hint);
    xml::check_entities(text, &budget, refuse)?;
    xml::check_tags(text, &budget)?;
    let limits =
        roxmltree::ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(text, limits);
    let document = document.map_err(|broken| refuse(broken.to_string()))?;
    let texts = text::written(&document, options, &budget, file)?;
    // Pictures are not drawn, so that none is opened.
    let image_href_resolver = ImageHrefResolver {
        resolve_data: Box::new(|_, _, _| None),
        resolve_string: Box::new(|_, _| None),
    };
    let style_sheet = Some(STYLE.to_owned());
    let reading = Options { image_href_resolver, style_sheet, ..Options::default() };
    let (plain, n_elements) = plain(&document, &texts).map_err(refuse)?;
    css::check(&document, n_elements, &budget)?;
    // usvg may panic on broken files.
    let tree = catch_unwind(AssertUnwindSafe(|| Tree::from_str(&plain, &reading)));
    let Ok(tree) = tree else { return Err(refuse("a drawing on which usvg fails".into())) };
    let tree = tree.map_err(|broken| refuse(broken.to_string()))?;
    let size = tree.size();
    let paper = [f64::from(size.width()), f64::from(size.height())];
    let (mut paths, mut gradients) = (Vec::new(), Vec::new());
    let mut left = MAX_POINTS as f64;
    let mut nodes: Vec<&Node> = tree.root().children().iter().rev().collect();
    while let Some(node) = nodes.pop() {
        match node {
            Node::Group(group) if group.opacity().get() > 0.0 => {
                nodes.extend(group.children().iter().rev());
            }
            Node::Path(path) if path.is_visible() && is_opaque(path) => {
                let drawn = convert(path.data(), path.abs_transform());
                let filled = path.stroke().is_none();
                if drawn.is_finite() && !(filled && is_paper(&drawn, paper)) {
                    let paint = paint(path, &mut gradients);
                    paths.push((dashed(drawn, path, &mut left, file)?, paint));
                }
            }
            Node::Group(_) | Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
        }
    }
    Ok((paths, gradients))
}

/// Whether the stroke or the fill of a path shows at all.
fn is_opaque(path: &usvg::Path) -> bool {
    path.stroke().is_some_and(|stroke| stroke.opacity().get() > 0.0)
        || path.fill().is_some_and(|fill| fill.opacity().get() > 0.0)
}

/// The box of all paths: left, bottom, right, top; inverted where there are none.
pub(super) fn bounds(paths: &[Drawn]) -> [f64; 4] {
    let boxes = paths.iter().map(|(path, _)| path.bounding_box());
    geometry::bounds(boxes.flat_map(|b| [[b.x0, b.y0], [b.x1, b.y1]]))
}

/// Polylines no farther from the paths than a tolerance, with their paints.
pub(super) fn flatten(paths: &[Drawn], tolerance: f64, file: &str) -> Result<Vec<ColoredLine>> {
    let mut lines = Vec::new();
    let mut left = MAX_POINTS;
    for (path, paint) in paths {
        let some = polylines(path, tolerance, left).ok_or_else(|| too_many(file))?;
        left = left.saturating_sub(some.iter().map(Vec::len).sum());
        lines.extend(some.into_iter().map(|line| (line, *paint)));
    }
    Ok(lines)
}

/// The paint of a stroke, or else of a fill.
fn paint(path: &usvg::Path, gradients: &mut Vec<Gradient>) -> Paint {
    let fill = || path.fill().map(usvg::Fill::paint);
    let server = path.stroke().map(usvg::Stroke::paint).or_else(fill);
    let place_from_user = Affine::FLIP_Y * affine(path.abs_transform());
    match server {
        Some(usvg::Paint::Color(color)) => Paint::Plain([color.red, color.green, color.blue]),
        server => {
            let gradient = server.and_then(|server| Gradient::new(server, place_from_user));
            gradient.map_or(Paint::Plain([0; 3]), |gradient| {
                gradients.push(gradient);
                Paint::Gradient(gradients.len() - 1)
            })
        }
    }
}

/// A path with y up, transformed in full precision.
fn convert(path: &tiny_skia_path::Path, transform: tiny_skia_path::Transform) -> BezPath {
    let place_from_user = Affine::FLIP_Y * affine(transform);
    let place =
        |p: tiny_skia_path::Point| place_from_user * Point::new(f64::from(p.x), f64::from(p.y));
    let mut drawn = BezPath::new();
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(p) => drawn.move_to(place(p)),
            PathSegment::LineTo(p) => drawn.line_to(place(p)),
            PathSegment::QuadTo(c, p) => drawn.quad_to(place(c), place(p)),
            PathSegment::CubicTo(c, d, p) => drawn.curve_to(place(c), place(d), place(p)),
            PathSegment::Close => drawn.close_path(),
        }
    }
    drawn
}

/// The dashes of a path, or the path, while some of the points are left. Under an uneven transform
/// dashes have their mean length.
fn dashed(drawn: BezPath, path: &usvg::Path, left: &mut f64, file: &str) -> Result<BezPath> {
    let Some(stroke) = path.stroke() else { return Ok(drawn) };
    let Some(dashes) = stroke.dasharray() else { return Ok(drawn) };
    let transform = path.abs_transform();
    let scale = f64::from(transform.sx * transform.sy - transform.kx * transform.ky).abs().sqrt();
    let dashes: Vec<f64> = dashes.iter().map(|dash| scale * f64::from(*dash)).collect();
    let period: f64 = dashes.iter().sum();
    let n_dashes = drawn.perimeter(1e-3 * period) / period * dashes.len() as f64;
    *left -= n_dashes;
    if left.is_nan() || *left < 0.0 {
        return Err(too_many(file));
    }
    let offset = scale * f64::from(stroke.dashoffset());
    Ok(kurbo::dash(drawn.iter(), offset, &dashes).collect())
}

/// Whether a fill is a rectangle over the whole page.
fn is_paper(path: &BezPath, [width, height]: [f64; 2]) -> bool {
    let bounds = path.bounding_box();
    let slack = 1e-3 * width.max(height);
    let covers = bounds.x0 <= slack
        && bounds.y1 >= -slack
        && bounds.x1 >= width - slack
        && bounds.y0 <= slack - height;
    covers && (path.area().abs() - bounds.area()).abs() < 1e-6 * bounds.area()
}
