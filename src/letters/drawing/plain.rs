//! An SVG file reduced to what is drawn, so that reading it costs bounded work.
//!
//! Written are the resolved attributes ([`style`]), without filters. Gradients refer to no others,
//! and a pattern becomes a gradient of one black stop that covers nothing. Text, pictures and what
//! else holds foreign content become a sign: a path by which it is known whether it would be seen.
//! What is left grows by `use`, clips, masks and markers alone, which are counted ([`elements`]);
//! a marker within a marker is not drawn.
//!
//! [`elements`]: super::elements

use std::fmt::Write as _;

use kurbo::{BezPath, Shape as _};
use usvg::roxmltree::{Document, Node};

use super::elements::check;
use super::style::{Named, Styled, XLINK, has};

/// Most stops of a gradient that are looked at.
const MAX_STOPS: usize = 16;

/// Most gradients, each of which refers to the next, that are looked at.
const MAX_CHAIN: usize = 8;

/// Where signs begin, and how many there may be: numbers that are exact in single precision.
pub(super) const SIGN_X: f32 = 7_777_777.0;
const MAX_SIGNS: usize = 10_000;

const SVG: &str = "http://www.w3.org/2000/svg";

/// Elements that are drawn, or hold what is; others in the namespace of SVG are not drawn by
/// anybody.
const DRAWN: &str = "a circle clipPath defs ellipse g line marker mask path polygon polyline rect \
    stop svg switch symbol use";

/// Elements whose content is drawn by browsers and not here.
const FOREIGN: &str = "text image foreignObject video iframe canvas mesh solidcolor";

const ANIMATIONS: &str = "animate animateTransform animateMotion animateColor set";

/// Attributes of a gradient and of a stop.
const GRADIENT: &str = "x1 y1 x2 y2 cx cy r fx fy fr gradientUnits gradientTransform spreadMethod";
const STOP: &str = "offset stop-color stop-opacity color";

/// The document that is drawn, and the elements in whose place it has signs.
///
/// # Errors
///
/// What was found instead of a drawing of bounded work.
pub(super) fn plain<'a, 'input>(
    document: &'a Document<'input>,
    styled: &Styled<'a, 'input>,
    named: &mut Named,
) -> Result<(String, Vec<Node<'a, 'input>>), String> {
    check(document.root_element(), styled)?;
    let (text, signs, in_marker) = (String::new(), Vec::new(), false);
    let mut writer = Writer { styled, named, text, signs, in_marker };
    writer.element(document.root_element())?;
    Ok((writer.text, writer.signs))
}

/// Writes a document.
struct Writer<'a, 'b, 'input> {
    styled: &'b Styled<'a, 'input>,
    named: &'b mut Named,
    text: String,
    signs: Vec<Node<'a, 'input>>,
    in_marker: bool,
}

impl<'a, 'input> Writer<'a, '_, 'input> {
    /// Writes an element as it is drawn.
    fn element(&mut self, node: Node<'a, 'input>) -> Result<(), String> {
        if !matches!(node.tag_name().namespace(), None | Some(SVG)) {
            return Ok(());
        }
        let tag = match node.tag_name().name() {
            name if has(FOREIGN, name) => return self.sign(node),
            name if has(ANIMATIONS, name) => {
                self.named.add("an animation, drawn as it begins", node);
                return Ok(());
            }
            "script" => {
                self.named.add("a script", node);
                return Ok(());
            }
            "linearGradient" | "radialGradient" | "pattern" => {
                self.gradient(node);
                "defs"
            }
            "filter" => "defs",
            name if has(DRAWN, name) => name,
            _ => return Ok(()),
        };
        if tag == "switch" {
            self.named.add("a switch, drawn in its first part that asks for nothing", node);
        }
        let _ = write!(self.text, "<{tag}");
        if node.parent_element().is_none() {
            let _ = write!(self.text, " xmlns=\"{SVG}\" xmlns:xlink=\"{XLINK}\"");
        }
        if tag == node.tag_name().name() {
            self.own_attributes(node);
        }
        self.text.push('>');
        let outside = self.in_marker;
        self.in_marker |= tag == "marker";
        for child in node.children().filter(Node::is_element) {
            self.element(child)?;
        }
        self.in_marker = outside;
        let _ = write!(self.text, "</{tag}>");
        Ok(())
    }

    fn own_attributes(&mut self, node: Node<'_, '_>) {
        let dashes = self.scaled_dashes(node);
        for (name, value) in self.styled.attributes(node) {
            let linked = || Some(self.styled.target(value)?.tag_name().name());
            match name {
                "filter" | "pathLength" => continue,
                // Properties of CSS may have names that attributes cannot have.
                name if !is_name(name) => continue,
                "stroke-dasharray" | "stroke-dashoffset" if dashes.is_some() => continue,
                "marker-start" | "marker-mid" | "marker-end" if self.in_marker => {
                    if linked() == Some("marker") {
                        self.named.add("a marker within a marker", node);
                    }
                    continue;
                }
                "fill" | "stroke" if linked() == Some("pattern") => {
                    self.named.add(format!("{name} by a pattern"), node);
                }
                "href" | "xlink:href"
                    if node.tag_name().name() == "use" && !value.trim().starts_with('#') =>
                {
                    self.named.add("another file (`use`)", node);
                }
                "clip-path" | "mask" if value.trim().starts_with("url(") => {
                    // Without the words of a shorthand.
                    let link = value.trim().split_inclusive(')').next().unwrap_or("");
                    write_attribute(name, link, &mut self.text);
                    continue;
                }
                _ => {}
            }
            write_attribute(name, value, &mut self.text);
        }
        for (name, value) in dashes.into_iter().flatten() {
            write_attribute(name, &value, &mut self.text);
        }
    }

    /// Dashes in user units where they are given by a `pathLength` that is not that of the path.
    fn scaled_dashes(&mut self, node: Node<'_, '_>) -> Option<[(&'static str, String); 2]> {
        let stated = self.styled.value(node, "pathLength")?.trim().parse::<f64>().ok();
        let inherited =
            |name: &str| node.ancestors().find_map(|node| self.styled.value(node, name));
        let dashes = inherited("stroke-dasharray").filter(|dashes| *dashes != "none")?;
        let stated = stated.filter(|stated| *stated > 0.0);
        let scale = stated.and_then(|stated| Some(shape_length(node, self.styled)? / stated));
        let scaled = |list: &str| {
            let scale = scale?;
            let parts = list.split([',', ' ', '\n', '\t', '\r']).filter(|part| !part.is_empty());
            let number = |part: &str| part.trim_end_matches("px").parse::<f64>().ok();
            let parts = parts.map(|part| Some((number(part)? * scale).to_string()));
            Some(parts.collect::<Option<Vec<String>>>()?.join(" "))
        };
        let offset = scaled(inherited("stroke-dashoffset").unwrap_or("0"));
        let scaled = scaled(dashes).zip(offset);
        if scaled.is_none() {
            self.named.add("pathLength", node);
        }
        let (dashes, offset) = scaled?;
        Some([("stroke-dasharray", dashes), ("stroke-dashoffset", offset)])
    }

    /// A sign in place of an element: transformed and hidden as it is.
    fn sign(&mut self, node: Node<'a, 'input>) -> Result<(), String> {
        let name = node.tag_name().name();
        let parts = node.descendants().filter_map(|part| part.text());
        if name == "text" && parts.flat_map(str::chars).all(char::is_whitespace) {
            return Ok(());
        }
        let index = self.signs.len();
        if index == MAX_SIGNS {
            return Err(format!("more than {MAX_SIGNS} elements <{name}>"));
        }
        self.signs.push(node);
        let _ =
            write!(self.text, "<path d=\"M{SIGN_X} {index}h1v1z\" fill=\"#000\" stroke=\"none\"");
        for name in ["display", "visibility", "opacity", "id"] {
            self.copy(node, name);
        }
        self.text.push_str("/>");
        Ok(())
    }

    /// Writes an attribute that an element has.
    fn copy(&mut self, node: Node<'_, '_>, name: &str) {
        if let Some(value) = self.styled.value(node, name) {
            write_attribute(name, value, &mut self.text);
        }
    }

    /// Writes a gradient with what it has from those that it refers to; a pattern as one of a black
    /// stop.
    fn gradient(&mut self, node: Node<'a, 'input>) {
        let Some(id) = node.attribute("id") else { return };
        let is_stop = |child: &Node<'_, '_>| child.tag_name().name() == "stop";
        let is_pattern = node.tag_name().name() == "pattern";
        let tag = if is_pattern { "linearGradient" } else { node.tag_name().name() };
        let next = |node: &Node<'a, 'input>| self.styled.linked(*node);
        let chain: Vec<_> = std::iter::successors(Some(node), next).take(MAX_CHAIN).collect();
        let _ = write!(self.text, "<{tag}");
        write_attribute("id", id, &mut self.text);
        for name in GRADIENT.split(' ') {
            if let Some(value) = chain.iter().find_map(|node| self.styled.value(*node, name)) {
                write_attribute(name, value, &mut self.text);
            }
        }
        self.text.push('>');
        let with_stops = chain.iter().find(|node| node.children().any(|child| is_stop(&child)));
        let stops = with_stops.into_iter().flat_map(Node::children).filter(is_stop).take(MAX_STOPS);
        for stop in stops.filter(|_| !is_pattern) {
            self.text.push_str("<stop");
            STOP.split(' ').for_each(|name| self.copy(stop, name));
            self.text.push_str("/>");
        }
        let stop = if is_pattern { "<stop stop-opacity=\"0.5\"/>" } else { "" };
        let _ = write!(self.text, "{stop}</{tag}>");
    }
}

fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | ':'))
}

/// Length of a shape's path in user units.
fn shape_length(node: Node<'_, '_>, styled: &Styled<'_, '_>) -> Option<f64> {
    let value = |name: &str| styled.value(node, name);
    let number = |name: &str| value(name).map_or(Some(0.0), |text| text.trim().parse().ok());
    let points = |close: &str| {
        let numbers = svgtypes::NumberListParser::from(value("points")?).map_while(|n| n.ok());
        let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
        let path = format!("M{}{close}", numbers[..numbers.len() / 2 * 2].join(" "));
        Some(BezPath::from_svg(&path).ok()?.perimeter(1e-3))
    };
    match node.tag_name().name() {
        "path" => Some(BezPath::from_svg(value("d")?).ok()?.perimeter(1e-3)),
        "circle" => Some(std::f64::consts::TAU * number("r")?),
        "ellipse" => {
            let radii = (number("rx")?, number("ry")?);
            Some(kurbo::Ellipse::new((0.0, 0.0), radii, 0.0).perimeter(1e-3))
        }
        "line" => Some(libm::hypot(number("x2")? - number("x1")?, number("y2")? - number("y1")?)),
        "rect" if value("rx").is_none() && value("ry").is_none() => {
            Some(2.0 * (number("width")? + number("height")?))
        }
        "polyline" => points(""),
        "polygon" => points("Z"),
        _ => None,
    }
}

fn write_attribute(name: &str, value: &str, text: &mut String) {
    let _ = write!(text, " {name}=\"");
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
    text.push('"');
}

#[cfg(test)]
mod tests {
    use super::super::super::{LetterOptions, Strokes};
    use super::super::{Ink, tests::drawn_in};
    use noctograph_core::error::Result;

    fn drawn(inner: &str) -> Result<Strokes> {
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 99 99' fill='none'>{inner}</svg>"
        );
        drawn_in("a.svg", text, &LetterOptions::default(), Ink::Alike)
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
