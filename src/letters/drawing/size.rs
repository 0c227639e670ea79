//! The size of an SVG file including all repetitions by `use`, clips, masks, gradients and markers,
//! computed before usvg expands these.

use std::collections::HashMap;

use usvg::roxmltree::Node;

use super::notes::{EMPTIED, FOREIGN, has};
use super::styles::Styles;
use noctograph_core::files::Budget;

/// Maximum number of elements with repetitions. usvg keeps about 500 bytes for each.
const MAX_ELEMENTS: f64 = 1e5;

/// Maximum total size of these elements' attributes, in bytes.
const MAX_BYTES: f64 = (16 << 20) as f64;

/// Maximum depth of nested elements, including those of `use`.
const MAX_DEPTH: usize = 128;

/// Maximum sum of the coordinates of all curves in user units. To compute bounding boxes, usvg
/// outlines strokes: 5 µs for a curve of 10³, 0.4 ms for one of 10⁶. Arcs become several curves.
const MAX_CURVES: f64 = 1e9;

/// Path commands that draw curves.
const CURVES: [char; 10] = ['C', 'c', 'S', 's', 'Q', 'q', 'T', 't', 'A', 'a'];

/// Work of an element with all repetitions: number of elements, bytes of attributes, vertices of
/// paths, sum of curve coordinates, and steps to match style rules.
type Work = [f64; 5];
const ELEMENTS: usize = 0;
const VERTICES: usize = 2;

/// Checks that the elements of a document take a bounded amount of work, and charges the matching
/// of styles to the budget. The error names the cause.
pub(super) fn check<'a, 'input>(
    root: Node<'a, 'input>,
    styles: &Styles<'a, 'input>,
    budget: &Budget,
) -> Result<(), String> {
    // Percentages are relative to the width and height of a page.
    let pages = root.descendants().filter(|node| has("svg symbol use", node.tag_name().name()));
    let lengths =
        pages.flat_map(|node| ["viewBox", "width", "height"].map(|name| node.attribute(name)));
    let page = lengths.flatten().flat_map(magnitudes).fold(100.0, f64::max);
    let mut counting = Counting { styles, page, known: HashMap::new(), marker: [0.0; 5] };
    let (work, _) = counting.count(root, 0)?;
    // Upper bound: each vertex has the largest marker, and each end of a path has another one.
    let has_marker = counting.marker[ELEMENTS] > 0.0;
    let n_markers = if has_marker { work[VERTICES] + 2.0 * work[ELEMENTS] } else { 0.0 };
    let [elements, bytes, _, curves, steps] =
        std::array::from_fn(|kind| work[kind] + n_markers * counting.marker[kind]);
    let what = if has_marker { "markers" } else { "<use>, clips and masks" };
    if elements > MAX_ELEMENTS {
        let most = format!("at most {MAX_ELEMENTS}");
        return Err(format!("{elements} elements including those of {what}, {most}"));
    }
    if bytes > MAX_BYTES {
        let mb = bytes / 1e6;
        return Err(format!(
            "{mb:.0} MB of attributes including those of {what}, more than an input may contain"
        ));
    }
    if curves > MAX_CURVES {
        return Err(format!("curves of {curves:.1e} user units in total, at most {MAX_CURVES:e}"));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    budget.spend_steps(steps as usize);
    Ok(())
}

/// A counter for the work that elements cause.
struct Counting<'a, 'b, 'input> {
    styles: &'b Styles<'a, 'input>,
    page: f64,
    /// Work and depth of each element counted so far, or `None` while it is being counted.
    known: HashMap<Node<'a, 'input>, Option<(Work, usize)>>,
    /// Maximum work of each kind in a marker.
    marker: Work,
}

impl<'a, 'input> Counting<'a, '_, 'input> {
    /// Returns the work of an element at a depth of nested elements, including that of its parts.
    /// Also returns the number of levels below and including it. The error names the cause.
    fn count(&mut self, node: Node<'a, 'input>, depth: usize) -> Result<(Work, usize), String> {
        let too_deep = format!("more than {MAX_DEPTH} levels of nested elements");
        match self.known.get(&node) {
            Some(Some(counted)) => return Ok(*counted),
            Some(None) => return Err("elements that use each other in a cycle".into()),
            None if depth > MAX_DEPTH => return Err(too_deep),
            None => {}
        }
        self.known.insert(node, None);
        // The work of an element includes that of the parts that usvg would repeat with it.
        let mut work = self.single(node)?;
        let mut n_levels = 1;
        for part in self.parts(node) {
            let (part_work, levels) = self.count(part, depth + 1)?;
            (0..work.len()).for_each(|kind| work[kind] += part_work[kind]);
            n_levels = n_levels.max(levels + 1);
        }
        if n_levels > MAX_DEPTH {
            return Err(too_deep);
        }
        if node.tag_name().name() == "marker" {
            if node.descendants().any(|node| node.tag_name().name() == "use") {
                return Err("a marker with <use>".into());
            }
            (0..work.len()).for_each(|kind| self.marker[kind] = self.marker[kind].max(work[kind]));
        }
        self.known.insert(node, Some((work, n_levels)));
        Ok((work, n_levels))
    }

    /// Returns the work of an element without its parts. The error names the cause.
    fn single(&self, node: Node<'a, 'input>) -> Result<Work, String> {
        let declared = self.styles.declared(node);
        let n_bytes: usize = declared.iter().map(|declared| declared.value.len()).sum();
        // Basic shapes have up to ten vertices. A path command takes at least two bytes.
        let paths = ["d", "points"].map(|name| self.styles.value(node, name).map_or(0, str::len));
        let n_vertices = 10 + (paths[0] + paths[1]) / 2;
        let steps = self.styles.steps(node) as f64;
        Ok([1.0, n_bytes as f64, n_vertices as f64, self.curves(node)?, steps])
    }

    /// Returns the elements inside an element and those that it refers to, if its content is drawn.
    fn parts(&self, node: Node<'a, 'input>) -> Vec<Node<'a, 'input>> {
        let tag = node.tag_name().name();
        if has(FOREIGN, tag) || has(EMPTIED, tag) {
            return Vec::new();
        }
        let declared = self.styles.declared(node).iter();
        let linked =
            declared.filter_map(|declared| self.linked(tag, declared.name, declared.value));
        node.children().filter(Node::is_element).chain(linked).collect()
    }

    /// Returns the element that usvg repeats because of a declaration of another element, or `None`
    /// if there is none.
    fn linked(&self, tag: &str, name: &str, value: &str) -> Option<Node<'a, 'input>> {
        // The link of an `a` element leads to another page. Among paints, usvg repeats gradients
        // but not patterns, whose content was removed.
        let is_paint = matches!(name, "fill" | "stroke");
        if !is_paint && !matches!(name, "clip-path" | "mask") && (name != "href" || tag == "a") {
            return None;
        }
        let target = self.styles.target(value)?;
        (!is_paint || target.tag_name().name().ends_with("Gradient")).then_some(target)
    }

    /// Returns the sum of the absolute coordinates of an element's curves, in user units. The error
    /// is a length in em or ex.
    fn curves(&self, node: Node<'_, '_>) -> Result<f64, String> {
        let names: &[&str] = match node.tag_name().name() {
            "path" => &["d"],
            "circle" | "ellipse" | "rect" => &["r", "rx", "ry"],
            _ => &[],
        };
        let mut sum = 0.0;
        for name in names {
            let value = node.attribute(*name).unwrap_or("");
            if ["em", "ex"].iter().any(|unit| value.ends_with(unit)) {
                return Err(format!("{name}=\"{value}\""));
            }
            if *name != "d" || value.contains(CURVES) {
                let unit = if value.ends_with('%') { 0.01 * self.page } else { 1.0 };
                sum += unit * magnitudes(value).sum::<f64>();
            }
        }
        Ok(sum)
    }
}

/// Returns the absolute values of the numbers in an attribute.
fn magnitudes(mut text: &str) -> impl Iterator<Item = f64> {
    fn digits(text: &str) -> usize {
        text.bytes().take_while(u8::is_ascii_digit).count()
    }
    std::iter::from_fn(move || {
        text = &text[text.find(|c: char| c.is_ascii_digit() || c == '.')?..];
        // Parses digits, a fraction and an exponent. A sign before them is skipped.
        let mut end = digits(text);
        if text[end..].starts_with('.') {
            end += 1 + digits(&text[end + 1..]);
        }
        if let Some(exponent) = text[end..].strip_prefix(['e', 'E']) {
            let sign = usize::from(exponent.starts_with(['+', '-']));
            let n_digits = digits(&exponent[sign..]);
            end += if n_digits > 0 { 1 + sign + n_digits } else { 0 };
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
        let numbers: Vec<f64> = super::magnitudes("M1.5.5e1-3e-2A1,1e+3 0 016.7e.e9mm5e").collect();
        assert_eq!(numbers, [1.5, 5.0, 0.03, 1.0, 1000.0, 0.0, 16.7, 0.0, 5.0]);
    }
}
