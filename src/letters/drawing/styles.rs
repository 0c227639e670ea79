//! Styles: the declarations of an SVG file's elements as usvg reads them, and the work of reading.
//!
//! usvg resolves style sheets with simplecss, which silently skips parts that it does not know.
//! simplecss runs here before usvg, so that skipped parts are named and the work is bounded.

use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};

use simplecss::{AttributeOperator, DeclarationTokenizer, Element, PseudoClass, Selector};
use usvg::roxmltree::{Document, Node, NodeId};

use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::Result;
use noctograph_core::files::Budget;
use noctograph_core::place::{Place, Segment};

/// Budget steps for comparing two names, for expanding an entity, and for matching a rule with an
/// element, and maximum number of steps for a match.
const STEPS_PER_NAME: usize = 4;
const STEPS_PER_ENTITY: usize = 200;
const STEPS_PER_MATCH: usize = 50;
const MAX_MATCH_STEPS: usize = 2_000_000_000;

/// Maximum number of entities that the parser expands for one reference, and maximum total size of
/// all entities, in bytes.
const MOST_WITHIN: usize = 256;
const MAX_ENTITY_BYTES: usize = 16 << 20;

/// Memory that a declaration and a selector need, in bytes.
const DECLARATION: usize = 48;
const SELECTOR: usize = 200;

/// Rules starting with `@` that do not affect a still picture on a screen.
const WITHOUT_EFFECT: [&str; 6] =
    ["charset", "font-face", "keyframes", "-webkit-keyframes", "namespace", "media print"];

/// Maximum number of names in a list of unsupported features, and maximum length of a name.
const MAX_NAMES: usize = 20;
const MAX_NAME_LENGTH: usize = 80;

/// Help text for an unsupported feature.
const HELP: &str = "convert the element to plain paths in the drawing's editor";

/// Unsupported features by name and treatment, with the number of elements and the first one's
/// position.
#[derive(Default)]
pub(super) struct Named(BTreeMap<(String, &'static str), (usize, usize)>);

impl Named {
    /// Counts an element with a feature, under the name and the treatment of the feature. A long
    /// name is cut. Once the list is full, features with new names are counted as `other
    /// properties`.
    pub(super) fn add(&mut self, what: impl Into<String>, how: &'static str, node: Node<'_, '_>) {
        // A file may contain any number of unusual names, but the list must remain readable.
        let mut key = (what.into().chars().take(MAX_NAME_LENGTH).collect(), how);
        if !self.0.contains_key(&key) && self.0.len() >= MAX_NAMES {
            key = ("other properties".to_owned(), "not followed");
        }
        self.0.entry(key).or_insert((0, node.range().start)).0 += 1;
    }

    /// Returns a warning for each feature, with the line of its first element.
    pub(super) fn warnings(&self, document: &Document<'_>, file: &str) -> Vec<Diagnostic> {
        Vec::from_iter(self.0.iter().map(|((what, how), (n, start))| {
            let uses = if *n == 1 { "element uses" } else { "elements use" };
            let message = format!("{n} {uses} {what}: {how}");
            let line = Segment::Line(document.text_pos_at(*start).row.into());
            let place = Place(vec![Segment::File(file.to_owned()), line]);
            Diagnostic { place, ..Diagnostic::warning("drawing-part", message) }.helped(HELP)
        }))
    }
}

/// Charges the entities, attributes and namespaces of a file to a budget. The parser compares each
/// attribute with all others of its tag, each prefix with all namespaces in scope, and each
/// reference with all entities. The error names entities that expand too much.
pub(super) fn check_text(xml: &str, budget: &Budget) -> std::result::Result<(), String> {
    // Each reference is looked up among all entities, and replaced by the entity's text.
    let (mut n_entities, mut longest, mut references) = (0, 0, xml.matches('&').count());
    for declaration in xml.split("<!ENTITY").skip(1) {
        let Some(start) = declaration.find(['"', '\'']) else { continue };
        let quote = &declaration[start..=start];
        let value = declaration[start + 1..].split(quote).next().unwrap_or("");
        if value.contains('<') {
            return Err("an entity that contains elements".into());
        }
        if value.contains('&') {
            references = references.saturating_mul(MOST_WITHIN);
        }
        (n_entities, longest) = (n_entities + 1, longest.max(value.len()));
    }
    if n_entities > 0 {
        let bytes = references.saturating_mul(longest);
        if bytes > MAX_ENTITY_BYTES.max(xml.len()) {
            return Err(format!("entities that expand to up to {} MiB", bytes >> 20));
        }
        budget.spend_steps(
            references.saturating_mul(STEPS_PER_NAME.saturating_mul(n_entities) + STEPS_PER_ENTITY),
        );
    }
    // A tag's attributes are compared with each other, and prefixes with the namespaces in scope.
    let (mut prefixes, mut n_names, mut n_declared) = (HashSet::new(), 0_usize, 0_usize);
    for tag in xml.split('<') {
        let n_attributes = tag.matches('=').count();
        budget
            .spend_steps(n_attributes.saturating_mul(n_attributes).saturating_mul(STEPS_PER_NAME));
        n_names += n_attributes + 1;
        for declaration in tag.split("xmlns").skip(1) {
            prefixes.insert(declaration.split('=').next());
            n_declared += 1;
        }
    }
    let n = prefixes.len();
    let compared = n_names.saturating_add(n_declared.saturating_mul(n));
    budget.spend_steps(n.saturating_mul(compared).saturating_mul(STEPS_PER_NAME));
    Ok(())
}

/// Declaration of an element. If a name is declared several times, its last value applies.
#[derive(Clone, Copy)]
pub(super) struct Declaration<'a> {
    pub(super) name: &'a str,
    pub(super) value: &'a str,
    /// True in a style or a style sheet, false for an attribute.
    pub(super) of_css: bool,
}

/// The declarations of all elements, and the number of steps to match the rules with each element.
pub(super) struct Styles<'a, 'input> {
    declared: HashMap<NodeId, (Vec<Declaration<'a>>, usize)>,
    ids: HashMap<&'a str, Node<'a, 'input>>,
    /// Text of all style sheets.
    sheets: String,
}

impl<'a, 'input> Styles<'a, 'input> {
    /// Reads the style sheets and the declarations of all elements, and names unsupported parts.
    /// Fails if the budget is spent.
    pub(super) fn new(
        document: &'a Document<'input>,
        budget: &Budget,
        named: &mut Named,
    ) -> Result<Self> {
        let elements = document.descendants().filter(Node::is_element);
        let (mut sheet, mut sheets) = (simplecss::StyleSheet::new(), String::new());
        for node in elements.clone().filter(|node| node.tag_name().name() == "style") {
            if !matches!(node.attribute("type"), None | Some("text/css")) {
                continue;
            }
            // usvg only reads the first text of a style sheet.
            if node.children().filter_map(|child| child.text()).count() > 1 || has_escapes(node) {
                named.add("a style sheet with XML escapes or comments", "not followed", node);
            }
            let text = node.text().filter(|_| !has_escapes(node)).unwrap_or("");
            check_sheet(text, node, budget, named)?;
            sheet.parse_more(text);
            sheets += text;
        }
        let (mut all_declared, mut ids) = (HashMap::new(), HashMap::new());
        for node in elements {
            if let Some(id) = node.attribute("id") {
                ids.entry(id).or_insert(node);
            }
            all_declared.insert(node.id(), declarations(node, &sheet, budget, named)?);
        }
        Ok(Self { declared: all_declared, ids, sheets })
    }

    /// Returns the declarations of an element, in ascending order of precedence.
    pub(super) fn declared(&self, node: Node<'_, '_>) -> &[Declaration<'a>] {
        self.declared.get(&node.id()).map_or(&[], |(declared, _)| declared)
    }

    /// Returns the number of steps to match the rules with an element.
    pub(super) fn steps(&self, node: Node<'_, '_>) -> usize {
        self.declared.get(&node.id()).map_or(0, |(_, steps)| *steps)
    }

    /// Returns the effective value of an element's property or attribute, if it is declared.
    pub(super) fn value(&self, node: Node<'_, '_>, name: &str) -> Option<&'a str> {
        let declared = self.declared(node).iter().rev();
        { declared }.find(|declared| declared.name == name).map(|declared| declared.value.trim())
    }

    /// True if an element is the first with its id, or has no id.
    pub(super) fn is_first(&self, node: Node<'_, '_>) -> bool {
        let first = node.attribute("id").and_then(|id| self.ids.get(id));
        first.is_none_or(|first| first.id() == node.id())
    }

    /// True if a style sheet may contain a rule for an id.
    pub(super) fn has_rule_of(&self, id: &str) -> bool {
        let is_name = |sign: char| sign.is_alphanumeric() || sign == '-' || sign == '_';
        let name = format!("#{id}");
        let mut parts = self.sheets.split(&name).peekable();
        std::iter::from_fn(|| Some((parts.next()?, *parts.peek()?))).any(|(before, after)| {
            !before.ends_with(['(', '"', '\'']) && !after.starts_with(is_name)
        })
    }

    /// Returns the element to which `#name` or `url(#name)` refers, or `None` if there is none.
    pub(super) fn target(&self, link: &str) -> Option<Node<'a, 'input>> {
        let link = link.trim();
        let link =
            link.strip_prefix("url(").map_or(link, |url| url.split(')').next().unwrap_or(""));
        self.ids.get(link.trim().trim_matches(['"', '\'']).strip_prefix('#')?).copied()
    }
}

/// Returns the declarations of an element in ascending order of precedence, and the number of steps
/// to match a style sheet's rules with it. Fails if the budget is spent.
fn declarations<'a>(
    node: Node<'a, '_>,
    sheet: &simplecss::StyleSheet<'a>,
    budget: &Budget,
    named: &mut Named,
) -> Result<(Vec<Declaration<'a>>, usize)> {
    // Attributes come first, followed by the rules and the style, sorted by importance. The last
    // declaration of a name applies.
    let attributes = node.attributes().filter(|attribute| {
        matches!(attribute.namespace(), None | Some("http://www.w3.org/1999/xlink"))
            && !matches!(attribute.name(), "style" | "class")
    });
    let declaration = |name, value, of_css| Declaration { name, value, of_css };
    let attributes = attributes.map(|a| declaration(a.name(), a.value(), false));
    let mut declared: Vec<Declaration<'a>> = attributes.collect();
    // Each rule costs ten steps, in addition to the steps of matching.
    let n_steps = Cell::new(10 * sheet.rules.len());
    let element = Matched { node, n_steps: &n_steps };
    let rules = sheet.rules.iter().filter(|rule| rule.selector.matches(&element));
    let from_rules = rules.flat_map(|rule| rule.declarations.iter().copied());
    let style = node.attribute("style").unwrap_or("");
    budget.steps(tokenizing_steps(style))?;
    let mut css: Vec<_> = from_rules.chain(DeclarationTokenizer::from(style)).collect();
    if breaks_off(style) {
        named.add("an incomplete style", "not followed", node);
    }
    css.sort_by_key(|declaration| declaration.important);
    declared.extend(css.iter().map(|rule| declaration(rule.name, rule.value, true)));
    budget.steps(n_steps.get())?;
    budget.bytes(DECLARATION * declared.len())?;
    Ok((declared, n_steps.get()))
}

/// True if a style sheet may contain escaped quotation marks. A sheet with escapes is not passed to
/// usvg.
pub(super) fn has_escapes(node: Node<'_, '_>) -> bool {
    node.text().is_some_and(|text| text.contains('\\'))
}

/// Returns the number of steps to tokenize declarations. simplecss ends each value and each broken
/// block with an error that counts lines and columns from the start of the text.
fn tokenizing_steps(css: &str) -> usize {
    css.matches([':', '{']).count().saturating_mul(2 * css.len())
}

/// Names the unsupported parts of a style sheet, and charges its work and memory to a budget. Each
/// selector in a list gets the declarations of its rule.
fn check_sheet(sheet: &str, node: Node<'_, '_>, budget: &Budget, named: &mut Named) -> Result<()> {
    budget.steps(tokenizing_steps(sheet))?;
    // The part before a block contains its selectors, preceded by rules that start with @.
    for block in without_strings(sheet).split('}') {
        let (head, body) = block.rsplit_once('{').unwrap_or((block, ""));
        for part in head.split(['{', ';']).map(str::trim).filter(|part| !part.is_empty()) {
            if let Some(rule) = part.strip_prefix('@') {
                if !WITHOUT_EFFECT.iter().any(|known| rule.starts_with(known)) {
                    named.add(format!("@{rule}"), "not followed", node);
                }
                continue;
            }
            for selector in part.split(',').map(str::trim) {
                if Selector::parse(selector).is_none() && !selector.ends_with('%') {
                    named.add(format!("the selector `{selector}`"), "not followed", node);
                }
            }
        }
        let (n_selectors, n_declared) = (head.matches(',').count() + 1, body.matches(';').count());
        budget.bytes(n_selectors.saturating_mul(SELECTOR + DECLARATION * (n_declared + 1)))?;
        if breaks_off(body) {
            named.add("an incomplete style", "not followed", node);
        }
    }
    Ok(())
}

/// Returns the text of a style sheet without comments and quoted strings.
fn without_strings(sheet: &str) -> String {
    let (mut kept, mut rest) = (String::new(), sheet);
    while let Some(start) = rest.find(['"', '\'', '/']) {
        let (before, after) = rest.split_at(start);
        kept += before;
        let (open, close) = match &after[..1] {
            "/" if after.starts_with("/*") => ("/*", "*/"),
            "/" => ("/", ""),
            quote => (quote, quote),
        };
        rest = after[open.len()..].split_once(close).map_or("", |(_, after)| after);
    }
    kept + rest
}

/// True if the parser stops before the last of the declarations.
fn breaks_off(declarations: &str) -> bool {
    let n_written = declarations.split(';').filter(|part| !part.trim().is_empty()).count();
    DeclarationTokenizer::from(declarations).count() < n_written && !declarations.contains("url(")
}

/// An element in the form that simplecss queries, and the number of steps of these queries.
struct Matched<'a, 'input, 's> {
    node: Node<'a, 'input>,
    n_steps: &'s Cell<usize>,
}

impl<'a, 'input> Matched<'a, 'input, '_> {
    /// Returns a related element, which counts as one match. Returns `None` if there is none, or if
    /// there were too many steps.
    fn related(&self, node: Option<Node<'a, 'input>>) -> Option<Self> {
        let n_steps = self.n_steps;
        n_steps.set(n_steps.get() + STEPS_PER_MATCH);
        node.filter(|_| n_steps.get() < MAX_MATCH_STEPS).map(|node| Self { node, n_steps })
    }
}

impl Element for Matched<'_, '_, '_> {
    fn parent_element(&self) -> Option<Self> {
        self.related(self.node.parent_element())
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.related(self.node.prev_sibling_element())
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.node.tag_name().name() == name
    }

    /// Charges the comparison with all attributes, and with the value in words of eight bytes.
    fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
        let value = self.node.attribute(name);
        let steps = self.node.attributes().len() + value.map_or(0, str::len) / 8;
        self.n_steps.set(self.n_steps.get() + steps);
        value.is_some_and(|value| operator.matches(value))
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        matches!(class, PseudoClass::FirstChild) && self.node.prev_sibling_element().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(xml: &str) -> std::result::Result<(), String> {
        let budget = Budget::new("a.svg", "none");
        check_text(xml, &budget)?;
        budget.check().map_err(|error| error.to_string())
    }

    #[test]
    fn entities_are_counted_where_they_are_put_in() {
        let small = "<!DOCTYPE svg [<!ENTITY ns 'http://ns.adobe.com/'>]><svg a='&ns;' b='&lt;'/>";
        check(small).unwrap();
        // Expanding these entities takes quadratic time, because 120 kB are inserted 40,000 times.
        let wide = format!(
            "<!DOCTYPE svg [<!ENTITY a '{}'>]><svg a='{}'/>",
            "x".repeat(120_000),
            "&a;".repeat(40_000)
        );
        assert!(check(&wide).unwrap_err().contains("4577 MiB"), "{:?}", check(&wide));
    }

    #[test]
    fn references_are_compared_with_all_entities() {
        let many: String = (0..30_000).map(|n| format!("<!ENTITY e{n} 'x'>")).collect();
        let used = |n| format!("<!DOCTYPE svg [{many}]><svg>{}</svg>", "&e29999;".repeat(n));
        check(&used(100)).unwrap();
        assert!(check(&used(20_000)).unwrap_err().contains("more work"));
        let markup = "<!DOCTYPE svg [<!ENTITY a '<g/>'>]><svg>&a;</svg>";
        assert!(check(markup).unwrap_err().contains("contains elements"));
    }

    #[test]
    fn attributes_of_a_tag_are_compared_with_each_other_and_prefixes_with_namespaces() {
        let tags = |xml: &str| check(xml).is_ok();
        fn list(n: usize, name: &str) -> String {
            (0..n).map(|k| format!(" {name}{k}='>'")).collect()
        }
        assert!(tags(&format!("<svg{}/>", list(5000, "a"))));
        assert!(!tags(&format!("<svg{}/>", list(20_000, "a"))));
        assert!(tags(&format!("<svg>{}</svg>", "<g a='1' b='2'/>".repeat(100_000))), "many tags");
        let own = "<g xmlns:x='y'/>".repeat(50_000);
        assert!(tags(&format!("<svg>{own}</svg>")), "the same prefix again and again");
        assert!(!tags(&format!("<svg{}>{own}</svg>", list(300, "xmlns:p"))));
    }
}
