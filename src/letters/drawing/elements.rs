//! The size of an SVG file as it is drawn: its elements, with those that `use`, clips, masks and
//! markers repeat, are counted before they are read.

use std::collections::HashMap;

use usvg::roxmltree::{Node, NodeId};

use super::style::Attributes;

/// Most elements with those of `use`, clips, masks and markers; usvg keeps some 500 bytes of each.
const MAX_ELEMENTS: usize = 100_000;

/// Most bytes of their attributes.
const MAX_BYTES: usize = 16 << 20;

/// Most elements within elements, those of `use` included.
pub(super) const MAX_DEPTH: usize = 128;

/// Most user units of curves in all, their coordinates added up. usvg outlines every stroke to know
/// its box: curves of 10³ take 5 µs each, of 10⁶ 0.4 ms, and arcs become more of them.
const MAX_CURVES: f64 = 1e9;

/// Commands of a path that draw curves.
const CURVES: [char; 10] = ['C', 'c', 'S', 's', 'Q', 'q', 'T', 't', 'A', 'a'];

/// Checks that the elements of a document cost bounded work.
///
/// # Errors
///
/// What was found instead.
pub(super) fn check<'a, 'input>(
    root: Node<'a, 'input>,
    attributes: &'a HashMap<NodeId, Attributes>,
    ids: &'a Ids<'a, 'input>,
) -> Result<(), String> {
    let mut counting = Counting { ids, attributes, known: HashMap::new(), marker: Size::default() };
    let all = counting.size(root, 0)?;
    // Each vertex may have a marker, and a path's ends one more each.
    let n_markers = if counting.marker.elements == 0 { 0 } else { all.vertices + 2 * all.elements };
    let elements = all.elements.saturating_add(n_markers.saturating_mul(counting.marker.elements));
    let bytes = all.bytes.saturating_add(n_markers.saturating_mul(counting.marker.bytes));
    if elements > MAX_ELEMENTS || bytes > MAX_BYTES {
        let what = if n_markers > 0 { "markers" } else { "<use>, clips and masks" };
        return Err(format!("{elements} elements, those of {what} counted"));
    }
    let curves = all.curves + n_markers as f64 * counting.marker.curves;
    if curves > MAX_CURVES {
        return Err(format!("curves of {curves:.1e} user units in all, at most {MAX_CURVES:e}"));
    }
    Ok(())
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
pub(super) type Ids<'a, 'input> = HashMap<&'a str, Node<'a, 'input>>;

struct Counting<'a, 'input> {
    ids: &'a Ids<'a, 'input>,
    attributes: &'a HashMap<NodeId, Attributes>,
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
        let own = self.attributes.get(&node.id()).map_or(&[][..], |own| &own[..]);
        let length = |name| value(own, name).map_or(0, str::len);
        let mut size = Size {
            elements: 1,
            bytes: own.iter().map(|(.., value)| value.len()).sum(),
            vertices: 10 + (length("d") + length("points")) / 2,
            depth: 1,
            curves: curves(node, own)?,
        };
        let tag = node.tag_name().name();
        let mut parts: Vec<_> = node.children().filter(Node::is_element).collect();
        if tag == "use" {
            let links = own.iter().filter(|(_, name, _)| name == "href");
            parts.extend(
                links.filter_map(|(.., link)| self.ids.get(link.trim().strip_prefix('#')?)),
            );
        }
        let linked = ["clip-path", "mask"].iter().filter_map(|name| value(own, name));
        parts.extend(linked.filter_map(|link| self.ids.get(target(link)?)));
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
fn curves(node: Node<'_, '_>, own: &[(&'static str, String, String)]) -> Result<f64, String> {
    let names: &[&str] = match node.tag_name().name() {
        "path" => &["d"],
        "circle" | "ellipse" | "rect" => &["r", "rx", "ry"],
        _ => &[],
    };
    let mut sum = 0.0;
    for (name, value) in names.iter().filter_map(|name| Some((name, value(own, name)?))) {
        if ["em", "ex", "%"].iter().any(|unit| value.ends_with(unit)) {
            return Err(format!("{name} of {value}, wanted user units"));
        }
        if *name != "d" || value.contains(CURVES) {
            sum += magnitudes(value).sum::<f64>();
        }
    }
    Ok(sum)
}

/// The value of an attribute without a prefix.
pub(super) fn value<'a>(own: &'a [(&'static str, String, String)], name: &str) -> Option<&'a str> {
    let found = own.iter().find(|(prefix, other, _)| prefix.is_empty() && other == name);
    found.map(|(.., value)| &**value)
}

/// The element that `url(#name)` names.
pub(super) fn target(value: &str) -> Option<&str> {
    let (link, _) = value.trim().strip_prefix("url(")?.split_once(')')?;
    link.trim().trim_matches(['"', '\'']).strip_prefix('#')
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

#[cfg(test)]
mod tests {
    #[test]
    fn numbers_are_found_as_paths_run_them_together() {
        let found: Vec<f64> = super::magnitudes("M1.5.5e1-3e-2A1,1e+3 0 016.7e.e9mm5e").collect();
        assert_eq!(found, [1.5, 5.0, 0.03, 1.0, 1000.0, 0.0, 16.7, 0.0, 5.0]);
    }
}
