//! Converts an SVG file to the lines that a browser would show.
//!
//! usvg resolves styles, `use`, basic shapes, nested viewports and paints, and kurbo applies
//! dashes. Clips, masks, the page's edge and occlusion are handled in [`visibility`]. Warnings name
//! unsupported features ([`notes`]), and files with text are rejected.
//!
//! [`visibility`]: super::visibility
//! [`notes`]: super::notes

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

#[cfg(not(target_family = "wasm"))]
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};
use kurbo::{Affine, BezPath, PathEl, Point, Shape};
use usvg::tiny_skia_path::{self, PathSegment};
use usvg::{ImageHrefResolver, Node, Options, Tree, roxmltree};

use super::super::curves::{on_grid, polylines, subpaths};
use super::super::smooth::simplified;
use super::layers::{Color, Cut, FLATNESS, Painted, Scale};
use super::notes::{Notes, RULES, SIGN_X, SVG, in_words_of_usvg};
use super::once::Front;
use super::styles::{Named, Styles, check_text};
use super::visibility::{OPAQUE, Page, Visible};
use super::{ColoredLine, LIMIT, MAX_POINTS, size, too_many};
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, file_name};
use noctograph_core::geometry;

/// Maximum number of elements and attributes of a file before `use` is resolved.
const MAX_NODES: u32 = 200_000;

/// Length of the line that represents a point of light, relative to the page's larger side.
const POINT: f64 = 2e-5;

/// Length given to zero-length dashes, which may be points, relative to their pattern's period.
const DASH: f64 = 1e-5;

/// Opacity of a gradient, which covers what is beneath it but does not have a single color.
const GRADIENT: f64 = 0.95;

/// Hint for a file that contains text.
const TEXT: &str = "convert text to paths in the SVG editor (Inkscape: Path > Object to Path; \
                    Illustrator: Type > Create Outlines)";

/// A drawing in the units of its file, with y up.
pub(super) struct Drawing {
    items: Vec<Item>,
}

/// An element that is drawn.
enum Item {
    /// The whole path of the element.
    Whole(BezPath, Color),
    /// A visible part of the path.
    Part(Vec<[f64; 2]>, Color),
}

/// Reads the drawing in a file, and returns it with warnings. Fails if the file is broken or too
/// large, contains text, or has no extent.
pub(super) fn read(bytes: &[u8], file: &str) -> Result<Warned<Drawing>> {
    let text = in_words_of_usvg(decoded(bytes).map_err(|cause| refused(file, cause))?);
    let budget = Budget::new(file, LIMIT.hint);
    let document = parse_document(&text, &budget, file)?;
    let root = document.root_element();
    let mut named = Named::default();
    for node in document.root().children() {
        if node.pi().is_some_and(|pi| pi.target == "xml-stylesheet") {
            named.add("a style sheet in another file (`xml-stylesheet`)", "not followed", node);
        }
    }
    // The work of all elements, including repetitions by usvg, is counted. Features that usvg does
    // not support are then removed.
    let styles = Styles::new(&document, &budget, &mut named)?;
    let too_large = |cause| refused(file, cause).coded(super::LARGE);
    size::check(root, &styles, &budget).map_err(too_large)?;
    budget.check()?;
    let mut notes = Notes { styles: &styles, named: &mut named, signs: vec![], edits: vec![] };
    notes.element(root).map_err(too_large)?;
    let (signs, edited) = (std::mem::take(&mut notes.signs), notes.edited(&text));
    let tree = parse_tree(&edited).map_err(|cause| refused(file, cause))?;
    let size = [tree.size().width(), tree.size().height()].map(f64::from);
    let scale = Scale { size: size[0].max(size[1]), budget: &budget };
    // The tree becomes areas and strokes, from back to front.
    let mut walk = Walk { cuts: Vec::new(), signs_seen: BTreeSet::new(), scale, in_mask: false };
    let painted = walk.page(&tree, has_edge(root, &styles));
    let signs = walk.signs_seen.iter().filter_map(|index| signs.get(*index).copied());
    name_signs(signs, &document, &mut named, file)?;
    // Only the visible parts of each element are kept.
    let page = Page::new(&painted, &walk.cuts, size, scale);
    let (items, n_alike) = visible(&painted, &page, scale, file)?;
    let drawing = Drawing { items: uncovered(items, scale) };
    budget.check()?;
    let mut warnings = named.warnings(&document, &file_name(file));
    warnings.extend((n_alike > 0).then(|| alike_warning(n_alike)));
    let [left, bottom, right, top] = drawing.bounds();
    // A drawing that is a single point of light has the extent of the line that represents it.
    if left <= right && (right - left).max(top - bottom) <= 1.5 * POINT * scale.size {
        let empty = refused(file, "a drawing without extent".into());
        return Err(super::with_reasons(empty, &warnings));
    }
    Ok(Warned { product: drawing, warnings })
}

/// Parses the XML of a drawing after charging its work to the budget.
fn parse_document<'text>(
    text: &'text str,
    budget: &Budget,
    file: &str,
) -> Result<roxmltree::Document<'text>> {
    check_text(text, budget).map_err(|cause| refused(file, cause))?;
    budget.check()?;
    let limits =
        roxmltree::ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(text, limits);
    let document = document.map_err(|broken| refused(file, broken.to_string()))?;
    check_root(document.root_element()).map_err(|cause| refused(file, cause))?;
    Ok(document)
}

/// Returns the warning about lines that have the color of what is beneath them.
fn alike_warning(n_alike: usize) -> Diagnostic {
    let lines = if n_alike == 1 { "line has" } else { "lines have" };
    let message = format!(
        "{n_alike} {lines} the color of what is beneath, so nothing is drawn there: use \
         fill=\"none\" for a shape that is not meant to be filled"
    );
    Diagnostic::warning("drawing-alike", message)
}

/// True if the page of a root element cuts off what lies beyond its edge.
fn has_edge(root: roxmltree::Node<'_, '_>, styles: &Styles<'_, '_>) -> bool {
    let sides = ["width", "height"].map(|name| root.attribute(name));
    let has_size = sides.iter().all(|side| side.is_some_and(|value| !value.ends_with('%')));
    (root.has_attribute("viewBox") || has_size) && styles.value(root, "overflow") != Some("visible")
}

/// Adds the visible foreign elements to the warnings. Fails if one of them is text.
fn name_signs<'a, 'input: 'a>(
    seen: impl Iterator<Item = roxmltree::Node<'a, 'input>>,
    document: &roxmltree::Document<'_>,
    named: &mut Named,
    file: &str,
) -> Result<()> {
    let (texts, others): (Vec<_>, Vec<_>) = seen.partition(|node| node.tag_name().name() == "text");
    if let Some(text) = texts.first() {
        let count = if texts.len() == 1 { "text".into() } else { format!("{} texts", texts.len()) };
        let line = u64::from(document.text_pos_at(text.range().start).row);
        let error = Error::input("", count, "a drawing that contains paths instead of text", TEXT);
        return Err(error.coded("drawing-text").in_file(file, line));
    }
    for node in others {
        named.add(format!("<{}>", node.tag_name().name()), "not followed", node);
    }
    Ok(())
}

/// An element's index, half the width of its stroke if this is opaque, and a part of the element.
type Reaching = (usize, f64, Item);

/// Returns the visible parts of elements from back to front, and the number of elements that do not
/// stand out from what is beneath them.
fn visible(
    painted: &[Painted],
    page: &Page<'_>,
    scale: Scale<'_>,
    file: &str,
) -> Result<(Vec<Reaching>, usize)> {
    scale.budget.check()?;
    let (mut items, mut n_points_left, mut n_alike) = (Vec::new(), MAX_POINTS as f64, 0);
    for (index, item) in painted.iter().enumerate() {
        if !item.path.is_finite() || page.is_paper(index, item) {
            continue;
        }
        // A stroke is drawn as its line, including dashes. Dashes of zero length become points.
        let (mut line, mut reach) = (item.path.clone(), 0.0);
        if let Some((_, alpha, style)) = &item.stroke {
            let (dashes, shortest) = dashed(line, style, item.placed, &mut n_points_left, file)?;
            line = with_points(&dashes, shortest, style.start_cap, scale.size);
            if *alpha >= OPAQUE {
                reach = 0.5 * style.width * item.placed.determinant().abs().sqrt();
            }
        }
        let (visible_part, is_alike) = page.visible(index, item, &line);
        scale.budget.check()?;
        n_alike += usize::from(is_alike);
        // Only the parts that clips, masks and later elements leave visible are kept.
        let parts = match visible_part {
            Visible::Stroke(color) => vec![Item::Whole(line, color)],
            Visible::Outline(color) => vec![Item::Whole(item.closed(), color)],
            Visible::Parts(parts) => {
                parts.into_iter().map(|(line, color)| Item::Part(line, color)).collect()
            }
        };
        items.extend(parts.into_iter().map(|part| (index, reach, part)));
    }
    Ok((items, n_alike))
}

/// Returns the parts of items that no stroke in front of them covers.
fn uncovered(mut items: Vec<Reaching>, Scale { size, budget }: Scale<'_>) -> Vec<Item> {
    let [left, bottom, right, top] = bounds_of(items.iter().map(|(.., item)| item));
    let mut front = Front::new((right - left).max(top - bottom), budget);
    let mut visible_items = Vec::new();
    while let Some((element, reach, item)) = items.pop() {
        // Items are taken from the front to the back, and compared with those in front of them.
        let (lines, color) = match &item {
            Item::Whole(path, color) => {
                (polylines(path, FLATNESS * size, MAX_POINTS).map(crate::vector::pairs), *color)
            }
            Item::Part(line, color) => (Some(vec![line.clone()]), *color),
        };
        match lines.and_then(|lines| front.uncovered(&lines, color, element, reach)) {
            None => visible_items.push(item),
            Some(parts) => {
                visible_items
                    .extend(parts.into_iter().rev().map(|(line, color)| Item::Part(line, color)));
            }
        }
    }
    visible_items.reverse();
    visible_items
}

/// Returns the error for a file that is not a drawing, with the cause.
fn refused(file: &str, cause: String) -> Error {
    let hint = "open the file in an SVG editor, and save it as plain SVG";
    Error::input(file, cause, "an SVG drawing", hint)
}

/// Checks that a root element is that of an SVG drawing. The error names the cause.
fn check_root(root: roxmltree::Node<'_, '_>) -> std::result::Result<(), String> {
    let (name, namespace) = (root.tag_name().name(), root.tag_name().namespace());
    match namespace {
        _ if name != "svg" => Err(format!("a document of <{name}>, not of <svg>")),
        Some(namespace) if namespace != SVG => {
            Err(format!("<svg> with xmlns={namespace:?} in place of {SVG:?}"))
        }
        _ => Ok(()),
    }
}

/// Parses the element tree of an edited file. The error names the cause.
fn parse_tree(edited: &str) -> std::result::Result<Tree, String> {
    // Pictures are not drawn, so they are not opened.
    let image_href_resolver = ImageHrefResolver {
        resolve_data: Box::new(|_, _, _| None),
        resolve_string: Box::new(|_, _| None),
    };
    let style_sheet = Some(RULES.to_owned());
    let reading = Options { image_href_resolver, style_sheet, ..Options::default() };
    // usvg may panic on broken files.
    let tree = catch_unwind(AssertUnwindSafe(|| Tree::from_str(edited, &reading)));
    let tree = tree.map_err(|_panic| "a drawing that usvg cannot read".to_owned())?;
    tree.map_err(|broken| broken.to_string())
}

impl Drawing {
    /// Returns the bounding box of all items: left, bottom, right and top. The box is inverted if
    /// there are no items.
    pub(super) fn bounds(&self) -> [f64; 4] {
        bounds_of(self.items.iter())
    }

    /// Returns polylines within a tolerance of the curves, with colors. Fails for too many points.
    pub(super) fn flatten(&self, tolerance: f64, file: &str) -> Result<Vec<ColoredLine>> {
        let mut lines = Vec::new();
        let mut n_points_left = MAX_POINTS;
        for item in &self.items {
            let (item_lines, color) = match item {
                Item::Whole(path, color) => {
                    let lines = polylines(path, tolerance, n_points_left);
                    (lines.map(|lines| on_grid(lines, path, tolerance)), color)
                }
                Item::Part(line, color) => (Some(vec![simplified(line, tolerance)]), color),
            };
            let item_lines = item_lines.ok_or_else(|| too_many(file))?;
            n_points_left = n_points_left.saturating_sub(item_lines.iter().map(Vec::len).sum());
            lines.extend(item_lines.into_iter().map(|line| (line, *color)));
        }
        Ok(lines)
    }
}

/// Returns the bounding box of items: left, bottom, right and top. The box is inverted if there are
/// none.
fn bounds_of<'a>(items: impl Iterator<Item = &'a Item>) -> [f64; 4] {
    let bounds = items.map(|item| match item {
        Item::Whole(path, _) => {
            let bounds = path.bounding_box();
            [bounds.x0, bounds.y0, bounds.x1, bounds.y1]
        }
        Item::Part(line, _) => geometry::bounds(line.iter().copied()),
    });
    geometry::bounds(bounds.flat_map(|[x0, y0, x1, y1]| [[x0, y0], [x1, y1]]))
}

/// Returns the encoding that a file's XML declaration names, or `None` without a declaration.
#[cfg(not(target_family = "wasm"))]
fn declared_encoding(bytes: &[u8]) -> Option<String> {
    /// Number of bytes in which the declaration must end.
    const HEAD_BYTES: usize = 200;
    let head: String = bytes.iter().take(HEAD_BYTES).map(|byte| char::from(*byte)).collect();
    let (_, value) = head.strip_prefix("<?xml")?.split_once("?>")?.0.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next()?;
    Some(value[1..].split_once(quote)?.0.to_owned())
}

/// Decodes a file by the encoding that its first bytes or its declaration indicate, or as UTF-8.
/// The error names the cause.
fn decoded(bytes: &[u8]) -> std::result::Result<String, String> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Err("a compressed drawing (svgz)".into());
    }
    // Browsers decode all encodings and pass on UTF-8, so the web module needs no tables.
    #[cfg(not(target_family = "wasm"))]
    if let Some(encoding) = foreign_encoding(bytes)? {
        let (text, _, is_broken) = encoding.decode(bytes);
        return if is_broken {
            Err(format!("bytes that are invalid in the encoding {}", encoding.name()))
        } else {
            Ok(text.into_owned())
        };
    }
    let text = std::str::from_utf8(bytes).map_err(|broken| broken.to_string())?;
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}

/// Returns the encoding that a file's first bytes or its declaration indicate, or `None` for UTF-8.
/// The error names an encoding that is not supported.
#[cfg(not(target_family = "wasm"))]
fn foreign_encoding(bytes: &[u8]) -> std::result::Result<Option<&'static Encoding>, String> {
    let encoding = match bytes {
        [0, 0, 0xfe, 0xff, ..] | [0xff, 0xfe, 0, 0, ..] | [0, 0, 0, b'<', ..] => {
            return Err("a drawing in UTF-32".into());
        }
        [b'<', 0, ..] => UTF_16LE,
        [0, b'<', ..] => UTF_16BE,
        _ => match (Encoding::for_bom(bytes), declared_encoding(bytes)) {
            (Some((encoding, _)), _) => encoding,
            (None, None) => UTF_8,
            (None, Some(name)) => match Encoding::for_label(name.as_bytes()) {
                // UTF-16 would be evident from the bytes, so this declaration is wrong.
                Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => UTF_8,
                Some(encoding) => encoding,
                None => return Err(format!("a drawing in the encoding {name}")),
            },
        },
    };
    Ok((encoding != UTF_8).then_some(encoding))
}

/// A walk through the tree of a drawing.
struct Walk<'a> {
    /// All clips and masks so far, and the page's edge.
    cuts: Vec<Cut<'a>>,
    /// Indices of the signs that would be visible.
    signs_seen: BTreeSet<usize>,
    scale: Scale<'a>,
    /// True while the content of a mask is converted.
    in_mask: bool,
}

impl<'a> Walk<'a> {
    /// Returns the elements of a page from back to front, limited by its edge if `has_edge` is
    /// true.
    fn page(&mut self, tree: &Tree, has_edge: bool) -> Vec<Painted> {
        let (mut cuts, mut painted) = (Vec::new(), Vec::new());
        if has_edge {
            let [width, height] = [tree.size().width(), tree.size().height()].map(f64::from);
            let page = kurbo::Rect::new(0.0, -height, width, 0.0).to_path(1e-9);
            self.cut(Cut::Page(self.scale.area(&page, false)), &mut cuts);
        }
        self.group(tree.root(), Affine::IDENTITY, &cuts, 1.0, &mut painted);
        painted
    }

    /// Adds a cut to the list of all cuts, and its index to `cuts`.
    fn cut(&mut self, cut: Cut<'a>, cuts: &mut Vec<usize>) {
        cuts.push(self.cuts.len());
        self.cuts.push(cut);
    }

    /// Adds the paths of a group, limited by cuts. The transforms of the groups are multiplied
    /// here, because the product that usvg gives lacks the transform of a symbol. `alpha` is the
    /// opacity of the groups around it, 0 to 1.
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
        // A group's clips and masks, including nested ones, apply to everything in the group.
        let mut cuts = cuts.to_vec();
        let placed = base * affine(group.transform());
        for clip in std::iter::successors(group.clip_path(), |clip| clip.clip_path()) {
            let mut parts = Vec::new();
            self.group(clip.root(), placed * affine(clip.transform()), &[], 1.0, &mut parts);
            let layers = parts.iter().filter_map(|part| part.fill_layer(0, self.scale));
            let clip = Cut::Clip(layers.collect());
            self.cut(clip, &mut cuts);
        }
        for mask in std::iter::successors(group.mask(), |mask| mask.mask()) {
            let mask = self.mask(mask, placed);
            self.cut(mask, &mut cuts);
        }
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, placed, &cuts, alpha, painted),
                Node::Path(path) if path.is_visible() => {
                    painted.extend(self.path(path, placed, &cuts, alpha));
                }
                Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
            }
        }
    }

    /// Returns the mask of a transformed group. Strokes count in masks, but not in clips.
    fn mask(&mut self, mask: &usvg::Mask, placed: Affine) -> Cut<'a> {
        let scale = self.scale;
        let mut parts = Vec::new();
        let was_in_mask = std::mem::replace(&mut self.in_mask, true);
        self.group(mask.root(), placed, &[], 1.0, &mut parts);
        self.in_mask = was_in_mask;
        let layers =
            parts.iter().flat_map(|part| [part.fill_layer(0, scale), part.stroke_layer(0, scale)]);
        let layers = layers.flatten().collect();
        let rect = mask.rect();
        let [x0, y0, x1, y1] =
            [rect.left(), rect.top(), rect.right(), rect.bottom()].map(f64::from);
        // A rectangle has no curves, so the tolerance has no effect.
        let edge = kurbo::Rect::new(x0, y0, x1, y1).to_path(1e-9);
        let edge = scale.area(&(Affine::FLIP_Y * placed * edge), false);
        Cut::Mask(layers, mask.kind() == usvg::MaskType::Alpha, edge)
    }

    /// Returns a visible path of the tree as a painted element. Returns `None` for a path without
    /// visible paint, and for a sign, which is recorded. `alpha` is the opacity of the groups
    /// around it, 0 to 1.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    fn path(
        &mut self,
        path: &usvg::Path,
        placed: Affine,
        cuts: &[usize],
        alpha: f64,
    ) -> Option<Painted> {
        let first = path.data().points().first().copied().unwrap_or_default();
        // A sign represents an element, whose index is the sign's y coordinate.
        if first.x == SIGN_X {
            self.signs_seen.insert(first.y as usize);
            return None;
        }
        let placed = Affine::FLIP_Y * placed;
        let even_odd = path.fill().is_some_and(|fill| fill.rule() == usvg::FillRule::EvenOdd);
        let fill = path.fill().map(|fill| {
            let (color, opacity) = self.paint(fill.paint());
            (color, alpha * opacity * f64::from(fill.opacity().get()))
        });
        let stroke = path.stroke().map(|stroke| {
            let (color, opacity) = self.paint(stroke.paint());
            (color, alpha * opacity * f64::from(stroke.opacity().get()), style(stroke))
        });
        let (fill, stroke) =
            (fill.filter(|fill| fill.1 > 0.0), stroke.filter(|stroke| stroke.1 > 0.0));
        let (path, cuts) = (convert(path.data(), placed), cuts.to_vec());
        let is_painted = fill.is_some() || stroke.is_some();
        is_painted.then_some(Painted { path, even_odd, fill, stroke, placed, cuts })
    }

    /// Returns the color and the opacity of a paint, 0 to 1. A gradient is represented by the color
    /// of its middle visible stop and about its mean opacity. In a mask it counts as its lightest
    /// stop.
    fn paint(&self, paint: &usvg::Paint) -> (Color, f64) {
        let stops = match paint {
            usvg::Paint::Color(color) => return (rgb(*color), 1.0),
            // A pattern is treated as visible but half transparent.
            usvg::Paint::Pattern(_) => return ([0; 3], 0.5),
            usvg::Paint::LinearGradient(gradient) => gradient.stops(),
            usvg::Paint::RadialGradient(gradient) => gradient.stops(),
        };
        let stops = stops.iter();
        let stops = stops.map(|stop| (rgb(stop.color()), f64::from(stop.opacity().get())));
        let mut stops: Vec<(Color, f64)> = stops.collect();
        if self.in_mask {
            let lightest = stops.into_iter().max_by(|a, b| {
                let [a, b] = [a, b]
                    .map(|(color, opacity)| opacity * color.map(f64::from).iter().sum::<f64>());
                a.total_cmp(&b)
            });
            return lightest.unwrap_or_default();
        }
        let mean = stops.iter().map(|stop| stop.1).sum::<f64>() / stops.len() as f64;
        stops.retain(|stop| stop.1 > 0.0);
        stops.get(stops.len() / 2).map_or(([0; 3], 0.0), |stop| (stop.0, GRADIENT * mean))
    }
}

/// Returns the red, green and blue values of a usvg color.
fn rgb(color: usvg::Color) -> Color {
    [color.red, color.green, color.blue]
}

/// Converts a transform to kurbo's type in full precision.
fn affine(t: usvg::Transform) -> Affine {
    Affine::new([t.sx, t.ky, t.kx, t.sy, t.tx, t.ty].map(f64::from))
}

/// Converts width, caps and dashes of a stroke to kurbo's type.
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

/// Converts a usvg path to kurbo's type, and transforms it in full precision.
fn convert(path: &tiny_skia_path::Path, placed: Affine) -> BezPath {
    fn point(p: tiny_skia_path::Point) -> Point {
        Point::new(f64::from(p.x), f64::from(p.y))
    }
    let mut drawn = BezPath::new();
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(p) => drawn.move_to(point(p)),
            PathSegment::LineTo(p) => drawn.line_to(point(p)),
            PathSegment::QuadTo(c, p) => drawn.quad_to(point(c), point(p)),
            PathSegment::CubicTo(c, d, p) => drawn.curve_to(point(c), point(d), point(p)),
            PathSegment::Close => drawn.close_path(),
        }
    }
    placed * drawn
}

/// Returns the dashes of a path, or the path itself if it has no pattern. Also returns the maximum
/// length of a dash that represents a point, in user units. If a transform is uneven, dashes get
/// their mean length. Returns an error if the drawing has too many points.
fn dashed(
    drawn: BezPath,
    style: &kurbo::Stroke,
    placed: Affine,
    n_points_left: &mut f64,
    file: &str,
) -> Result<(BezPath, f64)> {
    if style.dash_pattern.is_empty() {
        return Ok((drawn, 0.0));
    }
    // A point becomes a dash of length `least`, and the gap after it is shortened accordingly.
    let scale = placed.determinant().abs().sqrt();
    let mut dashes: Vec<f64> = style.dash_pattern.iter().map(|dash| scale * dash).collect();
    let period: f64 = dashes.iter().sum();
    let least = DASH * period;
    for index in 0..dashes.len() {
        let longer = (least - dashes[index]).max(0.0);
        dashes[index] += longer;
        let next = (index + 1) % dashes.len();
        dashes[next] = (dashes[next] - longer).max(0.0);
    }
    dashes.iter_mut().for_each(|dash| *dash = dash.max(least));
    *n_points_left -= drawn.perimeter(1e-3 * period) / period * dashes.len() as f64;
    if n_points_left.is_nan() || *n_points_left < 0.0 {
        return Err(too_many(file));
    }
    let offset = scale * style.dash_offset;
    Ok((kurbo::dash(drawn.iter(), offset, &dashes).collect(), 1.5 * least))
}

/// Replaces subpaths of zero length, and lines up to `max_dash`, with points of light if their caps
/// are visible, and removes them otherwise. `max_dash` and the page's larger side `size` are in
/// user units.
fn with_points(path: &BezPath, max_dash: f64, cap: kurbo::Cap, size: f64) -> BezPath {
    let mut kept = BezPath::new();
    for (first, elements) in subpaths(path) {
        let (n_elements, mut part) = (elements.len(), BezPath::new());
        part.move_to(first);
        part.extend(elements);
        // A dash is a single line. A subpath of zero length has an empty bounding box.
        let extent = part.bounding_box().size();
        let is_dash = matches!(part.elements(), [_, PathEl::LineTo(_)]);
        let max_point = if is_dash { max_dash } else { 0.0 };
        if libm::hypot(extent.width, extent.height) > max_point {
            kept.extend(part);
        } else if cap != kurbo::Cap::Butt && n_elements > 0 {
            // A point of light is a short stroke, because a stroke needs two points.
            let half = 0.5 * POINT * size;
            kept.move_to((first.x, first.y + half));
            kept.line_to((first.x, first.y - half));
        }
    }
    kept
}
