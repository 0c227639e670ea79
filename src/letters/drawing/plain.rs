//! An SVG file reduced to what is drawn, so that reading it costs bounded work.
//!
//! Written are the resolved attributes ([`style`]), without filters. Gradients refer to no others,
//! and a pattern becomes a gradient of one black stop that covers nothing. Text, pictures and what
//! else holds foreign content become a sign: a path by which it is known whether it would be seen.
//! What is left grows by `use`, clips, masks and markers alone, which are counted ([`elements`]);
//! a marker within a marker is not drawn.
//!
//! [`elements`]: super::elements

use std::collections::HashMap;
use std::fmt::Write as _;

use kurbo::{BezPath, Shape as _};
use usvg::roxmltree::{Document, Node, NodeId};

use super::elements::{Ids, check, target, value};
use super::style::{Attributes, Named, XLINK};
use super::xml::Rows;

/// Most stops of a gradient that are looked at.
const MAX_STOPS: usize = 16;

/// Where signs begin, and how many there may be: numbers that are exact in single precision.
pub(super) const SIGN_X: f32 = 7_777_777.0;
const MAX_SIGNS: usize = 10_000;

const SVG: &str = "http://www.w3.org/2000/svg";

/// A document as it is drawn.
pub(super) struct Plain {
    pub(super) text: String,
    /// What signs stand for, and its line.
    pub(super) signs: Vec<(String, u32)>,
}

/// The document that is drawn.
///
/// # Errors
///
/// What was found instead of a drawing of bounded work.
pub(super) fn plain(
    document: &Document<'_>,
    attributes: &HashMap<NodeId, Attributes>,
    named: &mut Named,
) -> Result<Plain, String> {
    let mut ids = HashMap::new();
    for node in document.descendants() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
    }
    check(document.root_element(), attributes, &ids)?;
    let (text, signs, rows) = (String::new(), Vec::new(), &Rows::of(document));
    let mut writer = Writer { rows, ids: &ids, attributes, named, text, signs, in_marker: false };
    writer.element(document.root_element())?;
    Ok(Plain { text: writer.text, signs: writer.signs })
}

/// Elements that are drawn, or hold what is; others in the namespace of SVG are not drawn by
/// anybody.
const DRAWN: &[&str] = &[
    "a", "circle", "clipPath", "defs", "ellipse", "g", "line", "marker", "mask", "path", "polygon",
    "polyline", "rect", "stop", "svg", "switch", "symbol", "use",
];

/// Elements whose content is drawn by browsers and not here.
const FOREIGN: &[&str] =
    &["text", "image", "foreignObject", "video", "iframe", "canvas", "mesh", "solidcolor"];

/// Writes a document.
struct Writer<'a, 'input> {
    rows: &'a Rows,
    ids: &'a Ids<'a, 'input>,
    attributes: &'a HashMap<NodeId, Attributes>,
    named: &'a mut Named,
    text: String,
    signs: Vec<(String, u32)>,
    in_marker: bool,
}

impl<'a, 'input> Writer<'a, 'input> {
    /// Writes an element as it is drawn.
    fn element(&mut self, node: Node<'a, 'input>) -> Result<(), String> {
        let name = node.tag_name().name();
        if !matches!(node.tag_name().namespace(), None | Some(SVG)) {
            return Ok(());
        }
        let row = self.rows.at(node);
        if FOREIGN.contains(&name) {
            return self.sign(node, row);
        }
        match name {
            "animate" | "animateTransform" | "animateMotion" | "animateColor" | "set" => {
                self.named.add("an animation, drawn as it begins", row);
                return Ok(());
            }
            "script" => {
                self.named.add("a script", row);
                return Ok(());
            }
            "switch" => {
                self.named.add("a switch, drawn in its first part that asks for nothing", row)
            }
            _ => {}
        }
        if matches!(name, "linearGradient" | "radialGradient" | "pattern") {
            if let Some(id) = node.attribute("id") {
                self.gradient(node, id);
            }
            self.text.push_str("<defs>");
            return self.content(node, "defs");
        }
        let tag = if name == "filter" { "defs" } else { name };
        if !DRAWN.contains(&tag) {
            return Ok(());
        }
        self.text.push('<');
        self.text.push_str(tag);
        if node.parent_element().is_none() {
            let _ = write!(self.text, " xmlns=\"{SVG}\" xmlns:xlink=\"{XLINK}\"");
        }
        if tag == name {
            self.own_attributes(node, row);
        }
        self.text.push('>');
        let outside = self.in_marker;
        self.in_marker |= tag == "marker";
        self.content(node, tag)?;
        self.in_marker = outside;
        Ok(())
    }

    fn content(&mut self, node: Node<'a, 'input>, tag: &str) -> Result<(), String> {
        for child in node.children().filter(Node::is_element) {
            self.element(child)?;
        }
        let _ = write!(self.text, "</{tag}>");
        Ok(())
    }

    fn own_attributes(&mut self, node: Node<'_, '_>, row: u32) {
        let own = self.attributes.get(&node.id()).map_or(&[][..], |own| &own[..]);
        let dashes = self.scaled_dashes(node, own, row);
        for (prefix, name, value) in own {
            let linked = || self.ids.get(target(value)?).map(|node| node.tag_name().name());
            match &**name {
                "filter" | "pathLength" => continue,
                // Properties of CSS may have names that attributes cannot have.
                name if !is_name(name) => continue,
                "stroke-dasharray" | "stroke-dashoffset" if dashes.is_some() => continue,
                "marker-start" | "marker-mid" | "marker-end" if self.in_marker => {
                    if linked() == Some("marker") {
                        self.named.add("a marker within a marker", row);
                    }
                    continue;
                }
                "fill" | "stroke" if linked() == Some("pattern") => {
                    self.named.add(format!("{name} by a pattern"), row);
                }
                "href" if node.tag_name().name() == "use" && !value.trim().starts_with('#') => {
                    self.named.add("another file (`use`)", row);
                }
                "clip-path" | "mask" if value.trim().starts_with("url(") => {
                    // Without the words of a shorthand.
                    let link = value.trim().split_inclusive(')').next().unwrap_or("");
                    write_attribute(prefix, name, link, &mut self.text);
                    continue;
                }
                _ => {}
            }
            write_attribute(prefix, name, value, &mut self.text);
        }
        for (name, value) in dashes.into_iter().flatten() {
            write_attribute("", name, &value, &mut self.text);
        }
    }

    /// Dashes in user units where they are given by a `pathLength` that is not that of the path.
    fn scaled_dashes(
        &mut self,
        node: Node<'_, '_>,
        own: &[(&'static str, String, String)],
        row: u32,
    ) -> Option<[(&'static str, String); 2]> {
        let stated = value(own, "pathLength")?.trim().parse::<f64>().ok();
        let inherited = |name: &str| {
            let own = |node: Node<'_, '_>| value(self.attributes.get(&node.id())?, name);
            node.ancestors().find_map(own)
        };
        let dashes = inherited("stroke-dasharray").filter(|dashes| *dashes != "none")?;
        let numbers = |list: &str| -> Option<Vec<f64>> {
            let parts = list.split([',', ' ', '\n', '\t', '\r']).filter(|part| !part.is_empty());
            parts.map(|part| part.trim_end_matches("px").parse().ok()).collect()
        };
        let length = shape_length(node, own);
        let scale = stated.filter(|stated| *stated > 0.0).and_then(|stated| Some(length? / stated));
        let offset = numbers(inherited("stroke-dashoffset").unwrap_or("0"));
        let (Some(scale), Some(dashes), Some(offset)) = (scale, numbers(dashes), offset) else {
            self.named.add("pathLength", row);
            return None;
        };
        let scaled = |values: Vec<f64>| {
            let values = values.into_iter().map(|value| (value * scale).to_string());
            values.collect::<Vec<_>>().join(" ")
        };
        Some([("stroke-dasharray", scaled(dashes)), ("stroke-dashoffset", scaled(offset))])
    }

    /// A sign in place of an element: transformed and hidden as it is.
    fn sign(&mut self, node: Node<'_, '_>, row: u32) -> Result<(), String> {
        let name = node.tag_name().name();
        let parts = node.descendants().filter_map(|part| part.text());
        if name == "text" && parts.flat_map(str::chars).all(char::is_whitespace) {
            return Ok(());
        }
        if self.signs.len() == MAX_SIGNS {
            return Err(format!("more than {MAX_SIGNS} elements <{name}>"));
        }
        let index = self.signs.len();
        self.signs.push((format!("<{name}>"), row));
        let _ =
            write!(self.text, "<path d=\"M{SIGN_X} {index}h1v1z\" fill=\"#000\" stroke=\"none\"");
        let own = self.attributes.get(&node.id()).map_or(&[][..], |own| &own[..]);
        for (_, name, value) in own {
            if matches!(&**name, "display" | "visibility" | "opacity" | "id") {
                write_attribute("", name, value, &mut self.text);
            }
        }
        self.text.push_str("/>");
        Ok(())
    }

    /// Writes a gradient with what it has from those that it refers to; a pattern as one of a black
    /// stop.
    fn gradient(&mut self, node: Node<'a, 'input>, id: &str) {
        let own =
            |node: &Node<'_, '_>| self.attributes.get(&node.id()).map_or(&[][..], |own| &own[..]);
        let next = |node: &Node<'a, 'input>| {
            let links = own(node).iter().filter(|(_, name, _)| name == "href");
            let mut linked =
                links.filter_map(|(.., link)| self.ids.get(link.trim().strip_prefix('#')?));
            linked.next().copied()
        };
        let is_stop = |child: &Node<'_, '_>| child.tag_name().name() == "stop";
        let is_pattern = node.tag_name().name() == "pattern";
        let tag = if is_pattern { "linearGradient" } else { node.tag_name().name() };
        let chain: Vec<_> = std::iter::successors(Some(node), next).take(MAX_CHAIN).collect();
        let mut text = format!("<{tag} id=\"");
        escape(id, &mut text);
        text.push('"');
        for name in GRADIENT {
            if let Some(value) = chain.iter().find_map(|node| value(own(node), name)) {
                write_attribute("", name, value, &mut text);
            }
        }
        text.push('>');
        let with_stops = chain.iter().find(|node| node.children().any(|child| is_stop(&child)));
        let stops = with_stops.into_iter().flat_map(Node::children).filter(is_stop).take(MAX_STOPS);
        for stop in stops.filter(|_| !is_pattern) {
            text.push_str("<stop");
            for name in STOP {
                if let Some(value) = value(own(&stop), name) {
                    write_attribute("", name, value, &mut text);
                }
            }
            text.push_str("/>");
        }
        let stop = if is_pattern { "<stop stop-opacity=\"0.5\"/>" } else { "" };
        let _ = write!(text, "{stop}</{tag}>");
        self.text += &text;
    }
}

fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.'))
}

/// Length of a shape's path in user units.
fn shape_length(node: Node<'_, '_>, own: &[(&'static str, String, String)]) -> Option<f64> {
    let number = |name: &str| value(own, name).map_or(Some(0.0), |text| text.trim().parse().ok());
    let points = |close: bool| {
        let numbers: Vec<f64> = svgtypes_numbers(value(own, "points")?);
        let mut path = BezPath::new();
        for (index, point) in numbers.chunks_exact(2).enumerate() {
            let point = (point[0], point[1]);
            if index == 0 { path.move_to(point) } else { path.line_to(point) }
        }
        if close && !path.is_empty() {
            path.close_path();
        }
        Some(path.perimeter(1e-3))
    };
    match node.tag_name().name() {
        "path" => Some(BezPath::from_svg(value(own, "d")?).ok()?.perimeter(1e-3)),
        "circle" => Some(std::f64::consts::TAU * number("r")?),
        "ellipse" => Some(
            kurbo::Ellipse::new((0.0, 0.0), (number("rx")?, number("ry")?), 0.0).perimeter(1e-3),
        ),
        "line" => Some(libm::hypot(number("x2")? - number("x1")?, number("y2")? - number("y1")?)),
        "rect" if value(own, "rx").is_none() && value(own, "ry").is_none() => {
            Some(2.0 * (number("width")? + number("height")?))
        }
        "polyline" => points(false),
        "polygon" => points(true),
        _ => None,
    }
}

fn svgtypes_numbers(text: &str) -> Vec<f64> {
    svgtypes::NumberListParser::from(text).map_while(Result::ok).collect()
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
const STOP: [&str; 4] = ["offset", "stop-color", "stop-opacity", "color"];

/// Most gradients, each of which refers to the next, that are looked at.
const MAX_CHAIN: usize = 8;

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
    use noctograph_core::error::Result;

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
        for (tag, property) in [("pattern", "fill"), ("filter", "filter")] {
            let open = format!("<{tag} id='THIS' width='1' height='1'>");
            let part = shape.replace("PROPERTY", property);
            let all = levels(&open, &part, &format!("</{tag}>"));
            let tried = tried.replace("fill='url(#e0)' PROPERTY", property);
            assert_eq!(n_lit(&(all + &tried)), 2, "{tag}");
        }
        let long = format!("M0 0{}", "h1v1".repeat(20_000));
        let levels_of = |tag: &str, property: &str| {
            let open = format!("<{tag} id='THIS' width='1' height='1'>");
            let part = shape.replace("PROPERTY", property);
            levels(&open, &part, &format!("</{tag}>")) + &tried.replace("PROPERTY", property)
        };
        let refused = [
            levels_of("clipPath", "clip-path"),
            levels_of("mask", "mask"),
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
    fn what_is_not_drawn_changes_nothing_else() {
        let line = "<path id='p' d='M0 0h9' stroke='red'/>";
        let clipped = line.replace("/>", " clip-path='url(#c)' mask='url(#gone)'/>");
        assert_eq!(n_lit(&clipped), 1, "by what is not there");
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
