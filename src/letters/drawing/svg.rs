//! SVG: what a browser shows of a file, as lines.
//!
//! Styles are resolved in [`style`], `use`, basic shapes, nested viewports and paints by usvg;
//! clips, masks, the page's edge and what covers what in [`shown`]; dashes by kurbo. What is not
//! followed is named in the warnings; text is refused.

use std::panic::{AssertUnwindSafe, catch_unwind};

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};
use kurbo::{Affine, BezPath, PathEl, Point, Shape};
use usvg::tiny_skia_path::{self, PathSegment};
use usvg::{ImageHrefResolver, Node, Options, Tree, roxmltree};

use super::super::curves::polylines;
use super::super::smooth::simplified;
use super::gradient::{Gradient, Paint, affine};
use super::layers::{Cut, Painted};
use super::plain::{Plain, SIGN_X, plain};
use super::shown::{Page, Shown};
use super::style::{Named, resolved};
use super::{ColoredLine, LIMIT, MAX_POINTS, css, too_many, xml};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Budget;
use noctograph_core::geometry;

/// Most elements and attributes of a file, before `use`.
const MAX_NODES: u32 = 200_000;

/// Length of the line that stands for a point of light, by the page's larger side.
const POINT: f64 = 2e-5;

/// Least dash, by the period of its pattern: a dash of no length is a point where its caps are not
/// butt.
const DASH: f64 = 1e-5;

/// Hint where a text is found.
const TEXT: &str = "convert it to paths in the SVG editor (Inkscape: Path > Object to Path; \
                    Illustrator: Type > Create Outlines)";

/// A drawing in its own units, y up.
#[derive(Default)]
pub(super) struct Drawing {
    items: Vec<Item>,
    pub(super) gradients: Vec<Gradient>,
    /// What of the file is not followed, a sentence each.
    pub(super) warnings: Vec<String>,
}

/// An element that is drawn.
enum Item {
    /// All of its path.
    Whole(BezPath, Paint),
    /// What is seen of it.
    Part(Vec<[f64; 2]>, Paint),
}

/// Reads a file.
pub(super) fn read(bytes: &[u8], file: &str) -> Result<Drawing> {
    let refuse = |found: String| {
        let hint = "open the file in an SVG editor, and save it as plain SVG";
        Error::input(file, found, "an SVG drawing", hint)
    };
    let text = decoded(bytes).map_err(refuse)?;
    let budget = Budget::of(file, LIMIT.hint);
    xml::check_entities(&text, &budget, refuse)?;
    xml::check_tags(&text, &budget)?;
    let limits =
        roxmltree::ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(&text, limits);
    let document = document.map_err(|broken| refuse(broken.to_string()))?;
    css::check(&document, &budget)?;
    let mut named = Named::default();
    for node in document.root().children().filter(roxmltree::Node::is_pi) {
        if node.pi().is_some_and(|pi| pi.target == "xml-stylesheet") {
            named.add(
                "another file (`xml-stylesheet`)",
                document.text_pos_at(node.range().start).row,
            );
        }
    }
    let attributes = resolved(&document, &budget, &mut named).map_err(refuse)?;
    budget.check()?;
    let Plain { text: plain, signs } = plain(&document, &attributes, &mut named).map_err(refuse)?;
    // Pictures are not drawn, so that none is opened.
    let image_href_resolver = ImageHrefResolver {
        resolve_data: Box::new(|_, _, _| None),
        resolve_string: Box::new(|_, _| None),
    };
    let reading = Options { image_href_resolver, ..Options::default() };
    // usvg may panic on broken files.
    let tree = catch_unwind(AssertUnwindSafe(|| Tree::from_str(&plain, &reading)));
    let Ok(tree) = tree else { return Err(refuse("a drawing on which usvg fails".into())) };
    let tree = tree.map_err(|broken| refuse(broken.to_string()))?;
    let size = [tree.size().width(), tree.size().height()].map(f64::from);
    let mut walk =
        Walk { signs: vec![false; signs.len()], size: size[0].max(size[1]), ..Walk::default() };
    let root = document.root_element();
    let value = |name: &str| {
        let own = attributes.get(&root.id()).into_iter().flatten();
        own.filter(|(prefix, ..)| prefix.is_empty()).find(|(_, own, _)| own == name)
    };
    let absolute = |name| value(name).is_some_and(|(.., value)| !value.ends_with('%'));
    let has_edge = value("viewBox").is_some() || absolute("width") && absolute("height");
    let overflows = value("overflow").is_some_and(|(.., value)| value == "visible");
    let mut cuts = Vec::new();
    if has_edge && !overflows {
        let page = kurbo::Rect::new(0.0, -size[1], size[0], 0.0);
        walk.cuts.push(Cut::Page(page.to_path(1e-9)));
        cuts.push(0);
    }
    let mut painted = Vec::new();
    walk.group(tree.root(), Affine::IDENTITY, &cuts, 1.0, &mut painted);
    let seen = signs.iter().zip(&walk.signs).filter(|(_, seen)| **seen).map(|(sign, _)| sign);
    let (texts, others): (Vec<_>, Vec<_>) = seen.partition(|(what, _)| what == "<text>");
    if let Some((_, row)) = texts.first() {
        let found = if texts.len() == 1 { "text".into() } else { format!("{} texts", texts.len()) };
        return Err(Error::input("", found, "paths in place of text", TEXT).at(file, *row as u64));
    }
    others.into_iter().for_each(|(what, row)| named.add(what, *row));
    let gradients = std::mem::take(&mut walk.gradients);
    let mut drawing = Drawing { warnings: named.sentences(file), ..Drawing::default() };
    let page = Page::new(&painted, &walk.cuts, &gradients, size, &budget);
    budget.check()?;
    let (mut left, mut n_alike) = (MAX_POINTS as f64, 0);
    for (index, mut item) in painted.into_iter().enumerate() {
        if item.stroke.is_none() && is_paper(&item.path, size) || !item.path.is_finite() {
            continue;
        }
        let style = item.stroke.and(item.stroke_area.clone());
        let whole = item.path.clone();
        if let Some(style) = style {
            item.path = dashed(item.path, &style, item.placed, &mut left, file)?;
            item.path = with_points(&item.path, style.start_cap, walk.size);
        }
        let (shown, is_alike) = page.shown(index, &item);
        budget.check()?;
        n_alike += usize::from(is_alike);
        match shown {
            Shown::Whole(paint) => {
                // Its rim, without dashes.
                let is_rim = Some(paint) != item.stroke.map(|(paint, _)| paint);
                let path = if is_rim { whole } else { item.path };
                drawing.items.push(Item::Whole(path, paint));
            }
            Shown::Parts(parts) => {
                drawing
                    .items
                    .extend(parts.into_iter().map(|(line, paint)| Item::Part(line, paint)));
            }
        }
    }
    if n_alike > 0 {
        let (n, s) = (n_alike, if n_alike == 1 { " has" } else { "s have" });
        drawing.warnings.push(format!(
            "{n} line{s} the color of what is beneath, and shows nothing there: not drawn \
             (fill=\"none\" keeps a shape from being filled)"
        ));
    }
    drawing.gradients = gradients;
    let [left, bottom, right, top] = drawing.bounds();
    if left <= right && (right - left).max(top - bottom) <= 1.5 * POINT * walk.size {
        return Err(refuse("a drawing without extent".into()));
    }
    Ok(drawing)
}

impl Drawing {
    /// The box of all that is drawn: left, bottom, right, top; inverted where that is nothing.
    pub(super) fn bounds(&self) -> [f64; 4] {
        geometry::bounds(self.items.iter().flat_map(|item| match item {
            Item::Whole(path, _) => {
                let bounds = path.bounding_box();
                [[bounds.x0, bounds.y0], [bounds.x1, bounds.y1]]
            }
            Item::Part(line, _) => {
                let [left, bottom, right, top] = geometry::bounds(line.iter().copied());
                [[left, bottom], [right, top]]
            }
        }))
    }

    /// Polylines no farther from what is drawn than a tolerance, with their paints.
    pub(super) fn flatten(&self, tolerance: f64, file: &str) -> Result<Vec<ColoredLine>> {
        let mut lines = Vec::new();
        let mut left = MAX_POINTS;
        for item in &self.items {
            let (some, paint) = match item {
                Item::Whole(path, paint) => (polylines(path, tolerance, left), paint),
                Item::Part(line, paint) => (Some(vec![simplified(line, tolerance)]), paint),
            };
            let some = some.ok_or_else(|| too_many(file))?;
            left = left.saturating_sub(some.iter().map(Vec::len).sum());
            lines.extend(some.into_iter().map(|line| (line, *paint)));
        }
        Ok(lines)
    }
}

/// The text of a file in the encoding that its first bytes or its declaration name, or else in
/// UTF-8.
fn decoded(bytes: &[u8]) -> std::result::Result<String, String> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Err("a compressed drawing (svgz)".into());
    }
    let declared = || {
        let head: String = bytes.iter().take(200).map(|byte| char::from(*byte)).collect();
        let declaration = head.strip_prefix("<?xml")?.split_once("?>")?.0.to_owned();
        let (_, value) = declaration.split_once("encoding")?;
        let value = value.trim_start().strip_prefix('=')?.trim_start();
        let quote = value.chars().next()?;
        Some(value[1..].split_once(quote)?.0.to_owned())
    };
    let encoding = match bytes {
        [0, 0, 0xfe, 0xff, ..] | [0xff, 0xfe, 0, 0, ..] | [0, 0, 0, b'<', ..] => {
            return Err("a drawing in UTF-32".into());
        }
        [b'<', 0, ..] => UTF_16LE,
        [0, b'<', ..] => UTF_16BE,
        _ => match (Encoding::for_bom(bytes), declared()) {
            (Some((encoding, _)), _) => encoding,
            (None, None) => UTF_8,
            (None, Some(name)) => match Encoding::for_label(name.as_bytes()) {
                // Of UTF-16 the bytes would say so.
                Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => UTF_8,
                Some(encoding) => encoding,
                None => return Err(format!("a drawing in the encoding {name}")),
            },
        },
    };
    if encoding == UTF_8 {
        let text = std::str::from_utf8(bytes).map_err(|broken| broken.to_string())?;
        return Ok(text.trim_start_matches('\u{feff}').to_owned());
    }
    let (text, _, is_broken) = encoding.decode(bytes);
    if is_broken {
        return Err(format!("bytes that are not in the encoding {}", encoding.name()));
    }
    Ok(text.into_owned())
}

/// A walk through the tree of a drawing.
#[derive(Default)]
struct Walk {
    cuts: Vec<Cut>,
    gradients: Vec<Gradient>,
    /// Whether each sign is seen.
    signs: Vec<bool>,
    size: f64,
}

impl Walk {
    /// Adds what a group paints, within cuts.
    fn group(
        &mut self,
        group: &usvg::Group,
        base: Affine,
        cuts: &[usize],
        alpha: f64,
        painted: &mut Vec<Painted>,
    ) {
        let alpha = alpha * f64::from(group.opacity().get());
        if alpha <= 0.0 {
            return;
        }
        let mut cuts = cuts.to_vec();
        let placed = base * affine(group.abs_transform());
        let mut clip = group.clip_path();
        while let Some(one) = clip {
            let mut parts = Vec::new();
            self.group(one.root(), placed * affine(one.transform()), &[], 1.0, &mut parts);
            cuts.push(self.cuts.len());
            self.cuts.push(Cut::Clip(parts));
            clip = one.clip_path();
        }
        let mut mask = group.mask();
        while let Some(one) = mask {
            let mut parts = Vec::new();
            self.group(one.root(), placed, &[], 1.0, &mut parts);
            let rect = one.rect();
            let [x0, y0, x1, y1] =
                [rect.left(), rect.top(), rect.right(), rect.bottom()].map(f64::from);
            let rectangle = kurbo::Rect::new(x0, y0, x1, y1).to_path(1e-9);
            cuts.push(self.cuts.len());
            let by_alpha = one.kind() == usvg::MaskType::Alpha;
            let rectangle = Affine::FLIP_Y * placed * rectangle;
            self.cuts.push(Cut::Mask(parts, by_alpha, rectangle));
            mask = one.mask();
        }
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, base, &cuts, alpha, painted),
                Node::Path(path) if path.is_visible() => {
                    self.path(path, base, &cuts, alpha, painted);
                }
                Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    fn path(
        &mut self,
        path: &usvg::Path,
        base: Affine,
        cuts: &[usize],
        alpha: f64,
        painted: &mut Vec<Painted>,
    ) {
        let first = path.data().points().first().copied().unwrap_or_default();
        if first.x == SIGN_X {
            if let Some(sign) = self.signs.get_mut(first.y as usize) {
                *sign = true;
            }
            return;
        }
        let placed = Affine::FLIP_Y * base * affine(path.abs_transform());
        let fill = path.fill().filter(|fill| fill.opacity().get() > 0.0);
        let stroke = path.stroke().filter(|stroke| stroke.opacity().get() > 0.0);
        if fill.is_none() && stroke.is_none() {
            return;
        }
        let even_odd = fill.is_some_and(|fill| fill.rule() == usvg::FillRule::EvenOdd);
        let fill = fill.map(|fill| {
            let opacity = alpha * f64::from(fill.opacity().get());
            (self.paint(fill.paint(), placed), opacity * opacity_of(fill.paint()))
        });
        let style = stroke.map(style);
        let stroke = stroke.map(|stroke| {
            let opacity = alpha * f64::from(stroke.opacity().get());
            (self.paint(stroke.paint(), placed), opacity)
        });
        let (path, cuts) = (convert(path.data(), placed), cuts.to_vec());
        painted.push(Painted { path, even_odd, fill, stroke, stroke_area: style, placed, cuts });
    }

    fn paint(&mut self, server: &usvg::Paint, placed: Affine) -> Paint {
        if let usvg::Paint::Color(color) = server {
            return Paint::Plain([color.red, color.green, color.blue]);
        }
        Gradient::new(server, placed).map_or(Paint::Plain([0; 3]), |gradient| {
            self.gradients.push(gradient);
            Paint::Gradient(self.gradients.len() - 1)
        })
    }
}

/// The least opacity of a paint.
fn opacity_of(server: &usvg::Paint) -> f64 {
    let stops = match server {
        usvg::Paint::LinearGradient(gradient) => gradient.stops(),
        usvg::Paint::RadialGradient(gradient) => gradient.stops(),
        usvg::Paint::Color(_) | usvg::Paint::Pattern(_) => return 1.0,
    };
    stops.iter().map(|stop| f64::from(stop.opacity().get())).fold(1.0, f64::min)
}

/// A stroke as kurbo has it.
fn style(stroke: &usvg::Stroke) -> kurbo::Stroke {
    let cap = match stroke.linecap() {
        usvg::LineCap::Butt => kurbo::Cap::Butt,
        usvg::LineCap::Round => kurbo::Cap::Round,
        usvg::LineCap::Square => kurbo::Cap::Square,
    };
    let mut style = kurbo::Stroke::new(f64::from(stroke.width().get())).with_caps(cap);
    if let Some(dashes) = stroke.dasharray() {
        style.dash_pattern = dashes.iter().map(|dash| f64::from(*dash)).collect();
        style.dash_offset = f64::from(stroke.dashoffset());
    }
    style
}

/// A path with y up, transformed in full precision.
fn convert(path: &tiny_skia_path::Path, placed: Affine) -> BezPath {
    let place = |p: tiny_skia_path::Point| placed * Point::new(f64::from(p.x), f64::from(p.y));
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
fn dashed(
    drawn: BezPath,
    style: &kurbo::Stroke,
    placed: Affine,
    left: &mut f64,
    file: &str,
) -> Result<BezPath> {
    if style.dash_pattern.is_empty() {
        return Ok(drawn);
    }
    let scale = placed.determinant().abs().sqrt();
    let period: f64 = style.dash_pattern.iter().map(|dash| scale * dash).sum();
    let least = DASH * period;
    let mut dashes: Vec<f64> = style.dash_pattern.iter().map(|dash| scale * dash).collect();
    for index in 0..dashes.len() {
        let longer = (least - dashes[index]).max(0.0);
        dashes[index] += longer;
        let next = (index + 1) % dashes.len();
        dashes[next] = (dashes[next] - longer).max(0.0);
    }
    dashes.iter_mut().for_each(|dash| *dash = dash.max(least));
    let n_dashes = drawn.perimeter(1e-3 * period) / period * dashes.len() as f64;
    *left -= n_dashes;
    if left.is_nan() || *left < 0.0 {
        return Err(too_many(file));
    }
    let offset = scale * style.dash_offset;
    let dashes: BezPath = kurbo::dash(drawn.iter(), offset, &dashes).collect();
    // Those of no length become points, or nothing.
    let is_shorter = |from: Point, to: Point| from.distance(to) <= 1.5 * least;
    let mut kept = BezPath::new();
    for (first, elements) in subpaths(&dashes) {
        match elements[..] {
            [PathEl::LineTo(to)] if is_shorter(first, to) => {
                kept.move_to(first);
                kept.line_to(first);
            }
            _ => {
                kept.move_to(first);
                kept.extend(elements);
            }
        }
    }
    Ok(kept)
}

/// A path whose subpaths without length are points of light where their caps show, or else nothing.
fn with_points(path: &BezPath, cap: kurbo::Cap, size: f64) -> BezPath {
    let mut kept = BezPath::new();
    for (first, elements) in subpaths(path) {
        let stays = |element: &PathEl| match element {
            PathEl::MoveTo(p) | PathEl::LineTo(p) => *p == first,
            PathEl::QuadTo(a, p) => *a == first && *p == first,
            PathEl::CurveTo(a, b, p) => *a == first && *b == first && *p == first,
            PathEl::ClosePath => true,
        };
        if !elements.iter().all(stays) {
            kept.move_to(first);
            kept.extend(elements);
        } else if cap != kurbo::Cap::Butt && !elements.is_empty() {
            let half = 0.5 * POINT * size;
            kept.move_to((first.x, first.y + half));
            kept.line_to((first.x, first.y - half));
        }
    }
    kept
}

/// The subpaths of a path: where each begins, and its other elements. After one that is closed the
/// next begins at the same place.
fn subpaths(path: &BezPath) -> Vec<(Point, Vec<PathEl>)> {
    let mut found: Vec<(Point, Vec<PathEl>)> = Vec::new();
    for element in path.elements() {
        match (*element, found.last_mut()) {
            (PathEl::MoveTo(p), _) => found.push((p, Vec::new())),
            (element, Some((first, elements))) if elements.last() == Some(&PathEl::ClosePath) => {
                let first = *first;
                found.push((first, vec![element]));
            }
            (element, Some((_, elements))) => elements.push(element),
            (_, None) => {}
        }
    }
    found
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
