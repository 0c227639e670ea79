//! The size of an SVG file as it is drawn: its elements, with those that `use`, clips, masks and
//! markers repeat, are counted before they are read.

use std::collections::HashMap;

use usvg::roxmltree::Node;

use super::style::Styled;

/// Most elements with those of `use`, clips, masks and markers; usvg keeps some 500 bytes of each.
const MAX_ELEMENTS: f64 = 1e5;

/// Most bytes of their attributes.
const MAX_BYTES: f64 = (16 << 20) as f64;

/// Most elements within elements, those of `use` included.
const MAX_DEPTH: usize = 128;

/// Most user units of curves in all, their coordinates added up. usvg outlines every stroke to know
/// its box: curves of 10³ take 5 µs each, of 10⁶ 0.4 ms, and arcs become more of them.
const MAX_CURVES: f64 = 1e9;

/// Commands of a path that draw curves.
const CURVES: [char; 10] = ['C', 'c', 'S', 's', 'Q', 'q', 'T', 't', 'A', 'a'];

/// Checks that the elements of a document cost bounded work; the error is what was found instead.
pub(super) fn check<'a, 'input>(
    root: Node<'a, 'input>,
    styled: &'a Styled<'a, 'input>,
) -> Result<(), String> {
    let mut counting = Counting { styled, known: HashMap::new(), marker: Size::default() };
    let all = counting.size(root, 0)?;
    let marker = counting.marker;
    // Each vertex may have a marker, and a path's ends one more each.
    let n_markers = if marker.elements > 0.0 { all.vertices + 2.0 * all.elements } else { 0.0 };
    let elements = all.elements + n_markers * marker.elements;
    if elements > MAX_ELEMENTS || all.bytes + n_markers * marker.bytes > MAX_BYTES {
        let what = if n_markers > 0.0 { "markers" } else { "<use>, clips and masks" };
        return Err(format!("{elements} elements, those of {what} counted"));
    }
    let curves = all.curves + n_markers * marker.curves;
    if curves > MAX_CURVES {
        return Err(format!("curves of {curves:.1e} user units in all, at most {MAX_CURVES:e}"));
    }
    Ok(())
}

/// What an element becomes. Numbers that multiply without end are infinite.
#[derive(Clone, Copy, Default)]
struct Size {
    elements: f64,
    bytes: f64,
    /// Vertices of its paths, at most.
    vertices: f64,
    /// Elements within each other.
    depth: usize,
    /// Coordinates of its curves, added up.
    curves: f64,
}

struct Counting<'a, 'input> {
    styled: &'a Styled<'a, 'input>,
    /// `None` while an element is being counted.
    known: HashMap<Node<'a, 'input>, Option<Size>>,
    /// The largest marker.
    marker: Size,
}

impl<'a, 'input> Counting<'a, 'input> {
    fn size(&mut self, node: Node<'a, 'input>, depth: usize) -> Result<Size, String> {
        let too_deep = || Err(format!("more than {MAX_DEPTH} elements within each other"));
        match self.known.get(&node) {
            Some(Some(size)) => return Ok(*size),
            Some(None) => return Err("elements that use each other without end".into()),
            None if depth > MAX_DEPTH => return too_deep(),
            None => {}
        }
        self.known.insert(node, None);
        let styled = self.styled;
        let length = |name| styled.value(node, name).map_or(0, str::len);
        let mut size = Size {
            elements: 1.0,
            bytes: styled.attributes(node).map(|(_, value)| value.len()).sum::<usize>() as f64,
            vertices: (10 + (length("d") + length("points")) / 2) as f64,
            depth: 1,
            curves: self.curves(node)?,
        };
        let tag = node.tag_name().name();
        let clips = ["clip-path", "mask"].map(|name| styled.target(styled.value(node, name)?));
        let used = styled.linked(node).filter(|_| tag == "use");
        let children = node.children().filter(Node::is_element);
        for part in children.chain(used).chain(clips.into_iter().flatten()) {
            let part = self.size(part, depth + 1)?;
            size.elements += part.elements;
            size.bytes += part.bytes;
            size.vertices += part.vertices;
            size.depth = size.depth.max(part.depth + 1);
            size.curves += part.curves;
        }
        if size.depth > MAX_DEPTH {
            return too_deep();
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

    /// The coordinates of an element's curves, added up without their signs.
    fn curves(&self, node: Node<'_, '_>) -> Result<f64, String> {
        let names: &[&str] = match node.tag_name().name() {
            "path" => &["d"],
            "circle" | "ellipse" | "rect" => &["r", "rx", "ry"],
            _ => &[],
        };
        let mut sum = 0.0;
        for name in names {
            let value = self.styled.value(node, name).unwrap_or("");
            if ["em", "ex", "%"].iter().any(|unit| value.ends_with(unit)) {
                return Err(format!("{name} of {value}, wanted user units"));
            }
            if *name != "d" || value.contains(CURVES) {
                sum += magnitudes(value).sum::<f64>();
            }
        }
        Ok(sum)
    }
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
