//! An SVG file reduced to what is drawn, so that reading it costs bounded work.
//!
//! Clips, masks and filters become `defs`: they are not drawn, but elements within them may be used
//! elsewhere. Gradients refer to no others, and a pattern becomes a gradient of one black stop. What is
//! left grows by `use` and by markers alone, which are counted here; a marker within a marker is not drawn.

use std::collections::HashMap;
use std::fmt::Write as _;

use usvg::roxmltree::{Document, Node, NodeId};

/// Most elements with those of `use` and of markers; usvg keeps some 500 bytes of each.
const MAX_ELEMENTS: usize = 100_000;

/// Most bytes of their attributes.
const MAX_BYTES: usize = 16 << 20;

/// Most elements within elements, those of `use` included.
pub(super) const MAX_DEPTH: usize = 128;

/// Most user units of curves in all, their coordinates added up. usvg outlines every stroke to know
/// its box: curves of 10³ take 5 µs each, of 10⁶ 0.4 ms, and arcs become more of them.
const MAX_CURVES: f64 = 1e9;

/// Most stops of a gradient that are looked at.
const MAX_STOPS: usize = 16;

/// Commands of a path that draw curves.
const CURVES: [char; 10] = ['C', 'c', 'S', 's', 'Q', 'q', 'T', 't', 'A', 'a'];

/// Style sheet that turns off what is not drawn.
pub(super) const STYLE: &str = "*{clip-path:none!important;mask:none!important;\
    filter:none!important}marker *{marker:none!important}stop{stop-opacity:1!important}";

const SVG: &str = "http://www.w3.org/2000/svg";
const XLINK: &str = "http://www.w3.org/1999/xlink";
const XML: &str = "http://www.w3.org/XML/1998/namespace";

/// Markup in place of the text elements that have any.
pub(super) type Texts = HashMap<NodeId, String>;

/// The document that is drawn, and how many elements it has with those of `use` and of markers.
///
/// # Errors
///
/// What was found instead of a drawing of bounded work.
pub(super) fn plain(document: &Document<'_>, texts: &Texts) -> Result<(String, usize), String> {
    let mut ids = HashMap::new();
    for node in document.descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    let mut counting = Counting { ids, texts, known: HashMap::new(), marker: Size::default() };
    let all = counting.size(document.root_element(), 0)?;
    // Each vertex may have a marker, and a path's ends one more each.
    let n_markers = if counting.marker.elements == 0 { 0 } else { all.vertices + 2 * all.elements };
    let elements = all.elements.saturating_add(n_markers.saturating_mul(counting.marker.elements));
    let bytes = all.bytes.saturating_add(n_markers.saturating_mul(counting.marker.bytes));
    if elements > MAX_ELEMENTS || bytes > MAX_BYTES {
        let what = if n_markers > 0 { "markers" } else { "<use>" };
        return Err(format!("{elements} elements, those of {what} counted"));
    }
    let curves = all.curves + n_markers as f64 * counting.marker.curves;
    if curves > MAX_CURVES {
        return Err(format!("curves of {curves:.1e} user units in all, at most {MAX_CURVES:e}"));
    }
    let mut text = String::new();
    write_element(document.root_element(), &counting.ids, texts, &mut text);
    Ok((text, elements))
}

/// What an element becomes.
#[derive(Clone, Copy, Default)]
struct Size {
    elements: usize,
    bytes: usize,
    /// Vertices of its paths, at most.
    vertices: usize,
    /// Elements within each other.
    depth: usize,
    /// Coordinates of its curves, added up.
    curves: f64,
}

/// Elements by their names.
type Ids<'a, 'input> = HashMap<&'a str, Node<'a, 'input>>;

struct Counting<'a, 'input> {
    ids: Ids<'a, 'input>,
    texts: &'a Texts,
    /// `None` while an element is being counted.
    known: HashMap<Node<'a, 'input>, Option<Size>>,
    /// The largest marker.
    marker: Size,
}

impl<'a, 'input> Counting<'a, 'input> {
    fn size(&mut self, node: Node<'a, 'input>, depth: usize) -> Result<Size, String> {
        match self.known.get(&node) {
            Some(Some(size)) => return Ok(*size),
            Some(None) => return Err("elements that use each other without end".into()),
            None if depth > MAX_DEPTH => return Err(too_deep()),
            None => {}
        }
        self.known.insert(node, None);
        let length = |name| node.attribute(name).map_or(0, str::len);
        let written = self.texts.get(&node.id()).map_or(0, String::len);
        let attributes: usize = node.attributes().map(|attribute| attribute.value().len()).sum();
        let mut size = Size {
            elements: 1,
            bytes: attributes + written,
            vertices: 10 + (length("d") + length("points") + written) / 2,
            depth: 1,
            curves: curves(node)?,
        };
        let tag = node.tag_name().name();
        let mut parts: Vec<_> = node.children().filter(Node::is_element).collect();
        if tag == "use" {
            let links = node.attributes().filter(|attribute| attribute.name() == "href");
            let used =
                links.filter_map(|link| self.ids.get(link.value().trim().strip_prefix('#')?));
            parts.extend(used);
        }
        for part in parts {
            let part = self.size(part, depth + 1)?;
            size.elements = size.elements.saturating_add(part.elements);
            size.bytes = size.bytes.saturating_add(part.bytes);
            size.vertices = size.vertices.saturating_add(part.vertices);
            size.depth = size.depth.max(part.depth + 1);
            size.curves += part.curves;
        }
        if size.depth > MAX_DEPTH {
            return Err(too_deep());
        }
        if tag == "marker" {
            if node.descendants().any(|node| node.tag_name().name() == "use") {
                return Err("a marker with <use>".into());
            }
            self.marker.elements = self.marker.elements.max(size.elements);
            self.marker.bytes = self.marker.bytes.max(size.bytes);
            self.marker.curves = self.marker.curves.max(size.curves);
        }
        self.known.insert(node, Some(size));
        Ok(size)
    }
}

pub(super) fn too_deep() -> String {
    format!("more than {MAX_DEPTH} elements within each other")
}

/// The coordinates of an element's curves, added up without their signs.
fn curves(node: Node<'_, '_>) -> Result<f64, String> {
    let names: &[&str] = match node.tag_name().name() {
        "path" => &["d"],
        "circle" | "ellipse" | "rect" => &["r", "rx", "ry"],
        _ => &[],
    };
    let mut sum = 0.0;
    for (name, value) in names.iter().filter_map(|name| Some((name, node.attribute(*name)?))) {
        if ["em", "ex", "%"].iter().any(|unit| value.ends_with(unit)) {
            return Err(format!("{name} of {value}, wanted user units"));
        }
        if *name != "d" || value.contains(CURVES) {
            sum += magnitudes(value).sum::<f64>();
        }
    }
    Ok(sum)
}

/// The numbers of an attribute, without their signs.
fn magnitudes(mut text: &str) -> impl Iterator<Item = f64> {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    std::iter::from_fn(move || {
        text = &text[text.find(|c: char| c.is_ascii_digit() || c == '.')?..];
        let mut end = digits(text);
        if text[end..].starts_with('.') {
            end += 1 + digits(&text[end + 1..]);
        }
        if let Some(exponent) = text[end..].strip_prefix(['e', 'E']) {
            let sign = usize::from(exponent.starts_with(['+', '-']));
            let n = digits(&exponent[sign..]);
            end += if n > 0 { 1 + sign + n } else { 0 };
        }
        let number = text[..end].parse().unwrap_or(0.0);
        text = &text[end..];
        Some(number)
    })
}

/// Writes an element as it is drawn.
fn write_element(node: Node<'_, '_>, ids: &Ids<'_, '_>, texts: &Texts, text: &mut String) {
    let name = node.tag_name().name();
    if !matches!(node.tag_name().namespace(), None | Some(SVG)) {
        return;
    }
    if let Some(written) = texts.get(&node.id()) {
        text.push_str(written);
        return;
    }
    let tag = match name {
        "linearGradient" | "radialGradient" | "pattern" => {
            if let Some(id) = node.attribute("id") {
                write_gradient(node, id, ids, text);
            }
            "defs"
        }
        "clipPath" | "mask" | "filter" => "defs",
        name => name,
    };
    text.push('<');
    text.push_str(tag);
    if node.parent_element().is_none() {
        let _ = write!(text, " xmlns=\"{SVG}\" xmlns:xlink=\"{XLINK}\"");
    }
    if tag == name {
        write_attributes_of(node, text);
    }
    text.push('>');
    for child in node.children() {
        match child.text().filter(|_| child.is_text()) {
            Some(content) => escape(content, text),
            None if child.is_element() => write_element(child, ids, texts, text),
            None => {}
        }
    }
    let _ = write!(text, "</{tag}>");
}

/// Writes the attributes of an element.
pub(super) fn write_attributes_of(node: Node<'_, '_>, text: &mut String) {
    for attribute in node.attributes() {
        let prefix = match attribute.namespace() {
            None => "",
            Some(XLINK) => "xlink:",
            Some(XML) => "xml:",
            Some(_) => continue,
        };
        write_attribute(prefix, attribute.name(), attribute.value(), text);
    }
}

/// Attributes of a gradient and of a stop.
const GRADIENT: [&str; 13] = [
    "x1",
    "y1",
    "x2",
    "y2",
    "cx",
    "cy",
    "r",
    "fx",
    "fy",
    "fr",
    "gradientUnits",
    "gradientTransform",
    "spreadMethod",
];
const STOP: [&str; 4] = ["offset", "stop-color", "style", "class"];

/// Most gradients, each of which refers to the next, that are looked at.
const MAX_CHAIN: usize = 8;

/// Writes a gradient with what it has from those that it refers to; a pattern as one of a black stop.
fn write_gradient(node: Node<'_, '_>, id: &str, ids: &Ids<'_, '_>, text: &mut String) {
    let next = |node: &Node<'_, '_>| {
        let links = node.attributes().filter(|attribute| attribute.name() == "href");
        links.filter_map(|link| ids.get(link.value().trim().strip_prefix('#')?)).next().copied()
    };
    let is_stop = |child: &Node<'_, '_>| child.tag_name().name() == "stop";
    let is_pattern = node.tag_name().name() == "pattern";
    let tag = if is_pattern { "linearGradient" } else { node.tag_name().name() };
    let chain: Vec<_> = std::iter::successors(Some(node), next).take(MAX_CHAIN).collect();
    let _ = write!(text, "<{tag} id=\"");
    escape(id, text);
    text.push('"');
    let from_chain = |name| chain.iter().find_map(|node| Some((name, node.attribute(name)?)));
    write_attributes(GRADIENT.into_iter().filter_map(from_chain), text);
    text.push('>');
    let with_stops = chain.iter().find(|node| node.children().any(|child| is_stop(&child)));
    let stops = with_stops.into_iter().flat_map(Node::children).filter(is_stop).take(MAX_STOPS);
    for stop in stops.filter(|_| !is_pattern) {
        text.push_str("<stop");
        write_attributes(
            STOP.iter().filter_map(|name| Some((*name, stop.attribute(*name)?))),
            text,
        );
        text.push_str("/>");
    }
    let _ = write!(text, "{}</{tag}>", if is_pattern { "<stop/>" } else { "" });
}

fn write_attributes<'a>(attributes: impl Iterator<Item = (&'a str, &'a str)>, text: &mut String) {
    attributes.for_each(|(name, value)| write_attribute("", name, value, text));
}

fn write_attribute(prefix: &str, name: &str, value: &str, text: &mut String) {
    let _ = write!(text, " {prefix}{name}=\"");
    escape(value, text);
    text.push('"');
}

fn escape(value: &str, text: &mut String) {
    for c in value.chars() {
        match c {
            '&' => text.push_str("&amp;"),
            '<' => text.push_str("&lt;"),
            '"' => text.push_str("&quot;"),
            '\n' | '\r' | '\t' => {
                let _ = write!(text, "&#{};", u32::from(c));
            }
            c => text.push(c),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{LetterOptions, Strokes};
    use super::super::{Ink, draw};
    use crate::error::Result;

    fn drawn(inner: &str) -> Result<Strokes> {
        let file = tempfile::Builder::new().suffix(".svg").tempfile().unwrap();
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 99 99' fill='none'>{inner}</svg>"
        );
        std::fs::write(file.path(), text).unwrap();
        draw(file.path(), &LetterOptions::default(), Ink::Alike)
    }

    fn n_lit(inner: &str) -> usize {
        let strokes = drawn(inner).unwrap();
        strokes.glyphs[0].moves.iter().filter(|step| step.lit).count()
    }

    /// Six levels of an element, each of ten that refer to the next.
    fn levels(open: &str, part: &str, close: &str) -> String {
        let level = |n: usize| {
            let part = part.replace("NEXT", &format!("e{}", n + 1)).repeat(10);
            open.replace("THIS", &format!("e{n}")) + &part + close
        };
        (0..12).map(level).collect()
    }

    #[test]
    fn references_that_multiply_cost_little_or_are_refused() {
        let shape = "<rect width='9' height='9' PROPERTY='url(#NEXT)'/>";
        let tried = "<path d='M0 0h9v9' stroke='red' fill='url(#e0)' PROPERTY='url(#e0)'/>";
        for (tag, property) in
            [("clipPath", "clip-path"), ("mask", "mask"), ("pattern", "fill"), ("filter", "filter")]
        {
            let open = format!("<{tag} id='THIS' width='1' height='1'>");
            let part = shape.replace("PROPERTY", property);
            let all = levels(&open, &part, &format!("</{tag}>"));
            let tried = tried.replace("fill='url(#e0)' PROPERTY", property);
            assert_eq!(n_lit(&(all + &tried)), 2, "{tag}");
        }
        let long = format!("M0 0{}", "h1v1".repeat(20_000));
        let refused = [
            levels("<g id='THIS'>", "<use href='#NEXT'/>", "</g>") + "<g id='e12'/>",
            format!("<path id='p' d='{long}'/>") + &"<use href='#p'/>".repeat(5000),
            "<marker id='m'>".to_owned()
                + &"<path d='M0 0h1' stroke='red'/>".repeat(100)
                + &format!("</marker><path d='{long}' stroke='red' marker-mid='url(#m)'/>"),
            "<g id='a'><use href='#b'/></g><g id='b'><use href='#a'/></g>".to_owned(),
            "<g>".repeat(200) + &"</g>".repeat(200),
            (0..300).map(|n| format!("<g id='g{}'><use href='#g{n}'/></g>", n + 1)).collect(),
            "<style>q * * * * * *{fill:red}</style>".to_owned()
                + &"<g>".repeat(100)
                + &"</g>".repeat(100),
            "<path d='M0 0h90' stroke='red' stroke-dasharray='0.001'/>".repeat(100),
            "<path d='M0 0A5 6 30 0 1 1e30 9' stroke='red'/>".to_owned(),
            "<rect width='1e30' height='1e30' rx='1e30' stroke='red'/>".to_owned(),
            "<g id='g'><circle r='1e6' stroke='red'/></g>".to_owned()
                + &"<use href='#g'/>".repeat(1000),
            "<circle r='1em' font-size='1e30' stroke='red'/>".to_owned(),
        ];
        for (n, inner) in refused.iter().enumerate() {
            let error = drawn(inner).unwrap_err().to_string();
            assert!(!error.contains("nothing drawn"), "{n}: {error}");
        }
    }

    #[test]
    fn numbers_are_found_as_paths_run_them_together() {
        let found: Vec<f64> = super::magnitudes("M1.5.5e1-3e-2A1,1e+3 0 016.7e.e9mm5e").collect();
        assert_eq!(found, [1.5, 5.0, 0.03, 1.0, 1000.0, 0.0, 16.7, 0.0, 5.0]);
    }

    #[test]
    fn what_is_not_drawn_changes_nothing_else() {
        let line = "<path id='p' d='M0 0h9' stroke='red'/>";
        let clipped = line.replace("/>", " clip-path='url(#c)' mask='url(#gone)'/>");
        assert_eq!(n_lit(&format!("<clipPath id='c'/>{clipped}")), 1, "clipped");
        let within = format!("<clipPath id='c'>{line}</clipPath><use href='#p'/>");
        assert_eq!(n_lit(&within), 1, "used from within a clip");
        let filled = "<path d='M0 0h9v9z' fill='url(#g)'/>";
        for server in ["linearGradient", "radialGradient", "pattern"] {
            let filled = format!("<{server} id='g'><stop/></{server}>{filled}");
            assert_eq!(n_lit(&filled), 3, "{server}");
        }
        let arrow = "<marker id='m' overflow='visible'><path d='M0 0l-2 1' stroke='red'/></marker>\
                     <path d='M0 0h9' stroke='red' marker-end='url(#m)'/>";
        assert_eq!(n_lit(arrow), 2, "an arrow and its head");
        let styled = "<style>.a > path, #b{stroke:red}</style><g class='a'><path d='M0 0h9'/></g>\
                      <path id='b' d='M0 5h9'/><path d='M0 7h9'/>";
        assert_eq!(n_lit(styled), 2, "two of three have a style");
    }
}
