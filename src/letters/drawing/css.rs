//! Style sheets: how much work it takes to match and apply them.
//!
//! Each rule is tried on each element, and the declarations of those that match are written into
//! it. That is taken off the drawing's budget beforehand, as an upper bound.

use std::collections::HashMap;

use usvg::roxmltree::{Document, Node};

use super::elements::MAX_DEPTH;
use noctograph_core::error::Result;
use noctograph_core::files::Budget;

/// Steps of asking an element, and of writing a declaration into it.
const STEPS: [usize; 2] = [10, 100];

/// Memory of a declaration besides its text, in bytes.
const DECLARATION: usize = 48;

/// What a selector asks the elements of a document for.
struct Elements {
    /// All of them.
    n: usize,
    depth: usize,
    /// Attributes and, in eights of bytes, classes; with all other values.
    classes: usize,
    values: usize,
    /// Elements of a name, of a `.class`, of an `#id`.
    named: HashMap<String, usize>,
}

/// Takes the style sheets of a document off a budget.
///
/// # Errors
///
/// Those of the budget.
pub(super) fn check(document: &Document<'_>, budget: &Budget) -> Result<()> {
    let sheets: Vec<String> = document
        .descendants()
        .filter(|node| node.tag_name().name() == "style")
        .flat_map(|sheet| sheet.descendants().filter_map(|node| node.text().map(plain)))
        .collect();
    let elements = Elements::of(document);
    let n_rules: usize = sheets.iter().map(|sheet| sheet.matches(['{', ',']).count()).sum();
    budget.steps(STEPS[1] * sheets.len().saturating_mul(n_rules))?;
    for sheet in &sheets {
        budget.steps(line_counts(sheet))?;
        for block in sheet.split('}') {
            let (selectors, declarations) = block.rsplit_once('{').unwrap_or((block, ""));
            let n_declarations = block.matches(';').count() + 1;
            let n_selectors = block.matches(',').count() + 1;
            let copies = n_declarations.saturating_mul(n_selectors);
            budget.bytes(DECLARATION.saturating_mul(copies))?;
            for selector in selectors.split([',', '{']) {
                let (asked, matched) = elements.asked(selector);
                budget.steps(asked)?;
                let written = STEPS[1] * n_declarations + declarations.len();
                budget.steps(matched.saturating_mul(written))?;
                budget.bytes(matched.saturating_mul(declarations.len()))?;
            }
        }
    }
    for node in document.descendants() {
        budget.steps(node.attribute("style").map_or(0, line_counts))?;
    }
    Ok(())
}

/// A sheet without its comments and what stands in quotation marks.
fn plain(sheet: &str) -> String {
    let mut kept = String::new();
    let mut rest = sheet;
    while let Some(at) = rest.find(['/', '"', '\'']) {
        let (before, from) = rest.split_at(at);
        kept.push_str(before);
        let (open, close) = match &from[..1] {
            "/" if from.starts_with("/*") => (2, "*/"),
            "/" => {
                kept.push('/');
                rest = &from[1..];
                continue;
            }
            quote => (1, quote),
        };
        rest = from[open..].split_once(close).map_or("", |(_, after)| after);
    }
    kept + rest
}

/// Steps of finding the lines and columns where values end: at most at each sign, from the
/// beginning of the text and of its line. Lines are counted sixteen bytes at a step.
fn line_counts(text: &str) -> usize {
    let n_signs = text.bytes().filter(|byte| !byte.is_ascii_alphabetic()).count();
    let longest = text.lines().map(str::len).max().unwrap_or(0);
    n_signs.saturating_mul(text.len() / 16 + longest)
}

impl Elements {
    fn of(document: &Document<'_>) -> Self {
        let mut all = Self { n: 0, depth: 0, classes: 0, values: 0, named: HashMap::new() };
        for node in document.descendants().filter(Node::is_element) {
            all.n += 1;
            all.depth = all.depth.max(node.ancestors().take(MAX_DEPTH).count());
            let class = node.attribute("class").unwrap_or_default();
            let id = node.attribute("id").unwrap_or_default();
            let attributes = node.attributes().len() + 1;
            let values: usize = node.attributes().map(|attribute| attribute.value().len()).sum();
            all.classes += attributes + (class.len() + id.len()) / 8;
            all.values += attributes + values / 8;
            let classes = class.split_ascii_whitespace().map(|class| format!(".{class}"));
            for name in classes.chain([format!("#{id}"), node.tag_name().name().to_owned()]) {
                *all.named.entry(name).or_default() += 1;
            }
        }
        all
    }

    /// Steps of trying a selector on all elements, and how many it matches at most.
    fn asked(&self, selector: &str) -> (usize, usize) {
        let parts = || selector.split([' ', '\t', '\n', '\r', '>', '+']).filter(|p| !p.is_empty());
        // Each part but the last is tried on all elements around.
        let n_ways = parts().skip(1).fold(1_usize, |n, _| n.saturating_mul(self.depth));
        let each = match selector {
            any if any.contains('[') => self.values,
            named if named.contains(['.', '#', ':']) => self.classes,
            _ => self.n,
        };
        let last = parts().next_back().unwrap_or("*");
        let end = |text: &str| text.find(['.', '#', '[', ':']).unwrap_or(text.len());
        let tag = &last[..end(last)];
        let names = last.match_indices(['.', '#']).map(|(at, _)| {
            let name = &last[at..];
            &name[..1 + end(&name[1..])]
        });
        let names = names.chain((!tag.is_empty() && tag != "*").then_some(tag));
        let found = names.map(|name| self.named.get(name).copied().unwrap_or(0)).min();
        let matched = found.map_or(self.n, |n| n.min(self.n));
        (STEPS[0].saturating_mul(n_ways).saturating_mul(each), matched)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_costs_the_elements_that_it_may_match() {
        let svg = "<svg><g class='a b'><path id='p'/><path class='a' d='M0 0'/></g></svg>";
        let document = Document::parse(svg).unwrap();
        let elements = Elements::of(&document);
        let matched = |selector: &str| elements.asked(selector).1;
        assert_eq!(
            [matched("path"), matched(".a"), matched("#p"), matched("g.b > path.a")],
            [2, 2, 1, 2]
        );
        assert_eq!(
            [matched("*"), matched("circle"), matched("[d]"), matched("path:hover")],
            [4, 0, 4, 2]
        );
        assert!(elements.asked("g path").0 > 2 * elements.asked("path").0, "tried on all around");
    }

    #[test]
    fn comments_and_quotations_hide_no_rule() {
        assert_eq!(plain("a/* } */{b:'}';c:\"{\"} d/e"), "a{b:;c:} d/e");
    }
}
