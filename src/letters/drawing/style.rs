//! Styles: what an element's attributes are once style sheets, `style`, custom properties and the
//! geometry and transforms of CSS are resolved; and the closed list of what is understood of them.
//!
//! Selectors are matched by simplecss, which asks the elements within the drawing's budget. What
//! may change the picture and is not understood is named.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt::Write as _;
use std::rc::Rc;
use std::str::FromStr as _;
use std::sync::LazyLock;

use simplecss::{AttributeOperator, Element, PseudoClass, Selector};
use usvg::roxmltree::{Document, Node, NodeId};

use super::transform;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Budget;

pub(super) const XLINK: &str = "http://www.w3.org/1999/xlink";
const XML: &str = "http://www.w3.org/XML/1998/namespace";

/// Properties that are followed, here or by usvg.
const FOLLOWED: &str = "clip-path clip-rule color cx cy d display fill fill-opacity fill-rule \
    height marker-end marker-mid marker-start mask mask-type opacity overflow r rx ry stop-color \
    stop-opacity stroke stroke-dasharray stroke-dashoffset stroke-linecap stroke-opacity \
    stroke-width transform transform-origin visibility width x y";

/// Properties that change nothing of a line's place and color, or belong to text, which is refused.
const WITHOUT_EFFECT: &str = "align-items alignment-baseline all-space-treatment aria-label \
    background background-color baseline-shift block-progression border bottom box-sizing clip \
    color-interpolation color-interpolation-filters color-profile color-rendering color-scheme \
    contain content cursor direction dominant-baseline enable-background flex float flood-color \
    flood-opacity hyphens image-rendering isolation justify-content kerning left letter-spacing \
    lighting-color line-height margin max-height max-width outline overflow-x overflow-y padding \
    paint-order pointer-events position right shape-inside shape-margin shape-padding \
    shape-rendering solid-color solid-opacity stroke-linejoin stroke-miterlimit tab-size top \
    touch-action transition unicode-bidi user-select vertical-align white-space will-change \
    word-spacing writing-mode z-index";

/// Properties of CSS that are neither, and are meant where they stand as attributes, too.
const OTHERS: &str = "animation animation-name backdrop-filter background-image clip-path-box \
    mask-border mask-clip mask-image mask-mode mask-position mask-size offset-distance \
    offset-path perspective perspective-origin shape-outside stroke-alignment zoom \
    content-visibility rotate";

/// The three lists, in which every attribute is looked up.
static LISTS: LazyLock<[HashSet<&str>; 3]> =
    LazyLock::new(|| [FOLLOWED, WITHOUT_EFFECT, OTHERS].map(|list| list.split(' ').collect()));

/// Properties of geometry, which are attributes of some elements alone.
const GEOMETRY: [&str; 10] = ["cx", "cy", "d", "height", "r", "rx", "ry", "width", "x", "y"];

/// Values by which a property that is not followed has no effect.
const NEUTRAL: &[&str] = &["", "none", "normal", "auto", "0", "1", "visible"];

/// Longest value once its custom properties are put in, and how often these refer to others.
const LONGEST: usize = 1 << 20;
const MAX_VARIABLES: usize = 32;

/// Steps of asking an element whether a rule is for it, of going on to one around it, of writing a
/// declaration into it, and of a byte of a value.
const STEPS: [usize; 4] = [10, 50, 100, 5];

/// Memory of a rule or a declaration besides its text, in bytes.
const RULE: usize = 120;

/// Most `@media` within each other.
const MAX_MEDIA: usize = 4;

/// Attribute that stands for `:root`, which simplecss does not know.
const ROOT: &str = "noctograph-root";

/// Whether a list of words, of which there are few, has one.
pub(super) fn has(words: &str, word: &str) -> bool {
    words.split(' ').any(|other| other == word)
}

/// What is not followed, by its name: how many elements, and the line of the first.
pub(super) struct Named {
    /// Bytes of the document's line ends: its parser counts them from the beginning for each place.
    line_ends: Vec<usize>,
    found: BTreeMap<String, (usize, u32)>,
}

impl Named {
    pub(super) fn of(document: &Document<'_>) -> Self {
        let line_ends = document.input_text().match_indices('\n').map(|(at, _)| at).collect();
        Self { line_ends, found: BTreeMap::new() }
    }

    /// The row in which a node begins, from 1.
    pub(super) fn row(&self, node: Node<'_, '_>) -> u32 {
        let before = self.line_ends.partition_point(|end| *end < node.range().start);
        u32::try_from(before + 1).unwrap_or(u32::MAX)
    }

    pub(super) fn add(&mut self, what: impl Into<String>, node: Node<'_, '_>) {
        // So that a file of many odd names has a short list of them.
        let mut what: String = what.into().chars().take(80).collect();
        if !self.found.contains_key(&what) && self.found.len() >= 20 {
            what = "other properties".into();
        }
        let row = self.row(node);
        self.found.entry(what).or_insert((0, row)).0 += 1;
    }

    /// One sentence for each.
    pub(super) fn sentences(&self, file: &str) -> Vec<String> {
        let sentence = |(what, (n, row)): (&String, &(usize, u32))| {
            let s = if *n == 1 { ("element uses", "at ") } else { ("elements use", "first at ") };
            format!("{n} {} {what}: not followed ({}{file}:{row})", s.0, s.1)
        };
        self.found.iter().map(sentence).collect()
    }
}

/// Attributes of an element as they are drawn, by their names, `xlink:` and `xml:` included.
type Attributes = BTreeMap<String, String>;

/// A document whose styles are resolved.
pub(super) struct Styled<'a, 'input> {
    attributes: HashMap<NodeId, Attributes>,
    ids: HashMap<&'a str, Node<'a, 'input>>,
}

impl<'a, 'input> Styled<'a, 'input> {
    pub(super) fn attributes(&self, node: Node<'_, '_>) -> impl Iterator<Item = (&str, &str)> {
        let own = self.attributes.get(&node.id()).into_iter().flatten();
        own.map(|(name, value)| (&**name, &**value))
    }

    pub(super) fn value(&self, node: Node<'_, '_>, name: &str) -> Option<&str> {
        self.attributes.get(&node.id())?.get(name).map(|value| &**value)
    }

    /// The element that an element refers to by its links.
    pub(super) fn linked(&self, node: Node<'_, '_>) -> Option<Node<'a, 'input>> {
        let links = ["href", "xlink:href"].map(|name| self.value(node, name));
        let mut ids = links.into_iter().flatten().filter_map(|link| link.trim().strip_prefix('#'));
        ids.find_map(|id| self.ids.get(id).copied())
    }

    /// The element that `url(#name)` names.
    pub(super) fn target(&self, value: &str) -> Option<Node<'a, 'input>> {
        let (link, _) = value.trim().strip_prefix("url(")?.split_once(')')?;
        self.ids.get(link.trim().trim_matches(['"', '\'']).strip_prefix('#')?).copied()
    }
}

/// Resolves the styles of a document; `refuse` makes an error of what was found instead.
pub(super) fn styled<'a, 'input>(
    document: &'a Document<'input>,
    budget: &Budget,
    named: &mut Named,
    refuse: impl Fn(String) -> Error,
) -> Result<Styled<'a, 'input>> {
    let elements = || document.descendants().filter(Node::is_element);
    let sheets = elements().filter(|node| node.tag_name().name() == "style").map(|node| {
        let text: String = node.children().filter_map(|child| child.text()).collect();
        (node, without_comments(&text))
    });
    let sheets: Vec<(Node<'_, '_>, String)> = sheets.collect();
    let mut rules: Vec<Rule<'_>> = Vec::new();
    for (node, sheet) in &sheets {
        budget.bytes(RULE * sheet.matches(['{', ',', ';']).count())?;
        parse_rules(sheet, *node, 0, &mut rules, named);
    }
    rules.sort_by_key(|(selector, _)| selector.specificity());
    let (mut attributes, mut ids) = (HashMap::new(), HashMap::new());
    let mut scopes: HashMap<NodeId, Rc<Variables>> = HashMap::new();
    for node in elements() {
        if let Some(id) = node.attribute("id") {
            ids.entry(id).or_insert(node);
        }
        let mut declared = Declared::new();
        budget.steps(STEPS[0] * rules.len())?;
        let element = Matched(node, budget);
        for (_, declarations) in rules.iter().filter(|(selector, _)| selector.matches(&element)) {
            declare(declarations, budget, &mut declared)?;
        }
        let style = node.attribute("style").map(without_comments).unwrap_or_default();
        declare(&declarations(&style), budget, &mut declared)?;
        let parent = node.parent_element().and_then(|parent| scopes.get(&parent.id()).cloned());
        let mut scope = parent.unwrap_or_default();
        let (own, declared): (Declared, Declared) =
            declared.into_iter().partition(|(name, _)| name.starts_with("--"));
        if !own.is_empty() {
            let scope = Rc::make_mut(&mut scope);
            scope.extend(own.into_iter().map(|(name, (value, _))| (name, value)));
            budget.bytes(scope.values().map(|value| value.len() + 100).sum())?;
        }
        let mut values = Attributes::new();
        for attribute in node.attributes() {
            let name = match (attribute.namespace(), attribute.name()) {
                (None, "style" | "class") => continue,
                (None, name) => name.to_owned(),
                (Some(XLINK), name) => format!("xlink:{name}"),
                (Some(XML), name) => format!("xml:{name}"),
                (Some(_), _) => continue,
            };
            values.insert(name, attribute.value().to_owned());
        }
        for (name, (value, _)) in &declared {
            let names: &[&str] = match &**name {
                "marker" => &["marker-start", "marker-mid", "marker-end"],
                name => &[name],
            };
            values.extend(names.iter().map(|name| ((*name).to_owned(), value.clone())));
        }
        for value in values.values_mut().filter(|value| value.contains("var(")) {
            *value = substituted(value, &scope, budget).ok_or_else(|| {
                let short: String = value.chars().take(60).collect();
                refuse(format!("custom properties without end: `{short}`"))
            })?;
        }
        scopes.insert(node.id(), scope);
        if node.parent_element().is_none()
            && let Some(color) = values.get("background").cloned()
            && color.parse::<svgtypes::Color>().is_ok()
        {
            values.insert("background-color".into(), color);
        }
        geometry(node, &mut values);
        transforms(node, &mut values, named);
        check(node, &values, &declared, named);
        attributes.insert(node.id(), values);
    }
    Ok(Styled { attributes, ids })
}

type Variables = BTreeMap<String, String>;

/// The declarations of an element: values by name, and whether they are important.
type Declared = BTreeMap<String, (String, bool)>;

/// Name, value, and whether it is important.
type Declaration = (String, String, bool);

type Rule<'a> = (Selector<'a>, Rc<Vec<Declaration>>);

/// A text without its comments, and without the marks by which old browsers skip it.
fn without_comments(text: &str) -> String {
    let text = text.replace("<!--", " ").replace("-->", " ").replace(":root", &format!("[{ROOT}]"));
    let mut kept = String::new();
    let mut rest = &text[..];
    while let Some((before, after)) = rest.split_once("/*") {
        kept.push_str(before);
        kept.push(' ');
        rest = after.split_once("*/").map_or("", |(_, after)| after);
    }
    kept + rest
}

/// Where one of some signs stands outside of quotation marks and brackets.
fn find_outside(text: &str, signs: &[char]) -> Option<usize> {
    let (mut depth, mut quote) = (0_usize, None);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            (Some(q), c) if c == q => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, c) if depth == 0 && signs.contains(&c) => return Some(at),
            (None, '(') => depth += 1,
            (None, ')') => depth = depth.saturating_sub(1),
            (None, _) => {}
        }
    }
    None
}

fn parse_rules<'a>(
    sheet: &'a str,
    node: Node<'_, '_>,
    depth: usize,
    rules: &mut Vec<Rule<'a>>,
    named: &mut Named,
) {
    let mut rest = sheet.trim();
    while !rest.is_empty() {
        let end = find_outside(rest, &['{', ';']).unwrap_or(rest.len());
        let (prelude, after) = rest.split_at(end);
        let prelude = prelude.trim();
        let Some(block) = after.strip_prefix('{') else {
            if prelude.starts_with("@import") {
                named.add(prelude, node);
            }
            rest = after.get(1..).unwrap_or("").trim_start();
            continue;
        };
        let mut open = 1_usize;
        let closes = |c: char| {
            open = open + usize::from(c == '{') - usize::from(c == '}');
            open == 0
        };
        let close = block.find(closes).unwrap_or(block.len());
        let body = &block[..close];
        rest = block.get(close + 1..).unwrap_or("").trim_start();
        if let Some(at_rule) = prelude.strip_prefix('@') {
            let name = at_rule.split(|c: char| !c.is_alphanumeric() && c != '-').next();
            match name.unwrap_or("") {
                "font-face" | "keyframes" | "-webkit-keyframes" | "namespace" | "charset" => {}
                "media" if depth < MAX_MEDIA && matches!(at_rule[5..].trim(), "all" | "screen") => {
                    parse_rules(body, node, depth + 1, rules, named);
                }
                "media" if at_rule[5..].trim() == "print" => {}
                _ => named.add(format!("@{at_rule}"), node),
            }
            continue;
        }
        let declarations = Rc::new(declarations(body));
        for text in prelude.split(',').map(str::trim) {
            match Some(text).filter(|text| is_followed(text)).and_then(Selector::parse) {
                Some(selector) => rules.push((selector, Rc::clone(&declarations))),
                None => named.add(format!("the selector `{text}`"), node),
            }
        }
    }
}

/// Whether a selector is one that simplecss matches whole. The states that a pointer leads to are
/// those of no element of a picture.
fn is_followed(selector: &str) -> bool {
    let known = |part: &str| {
        let name = part.split(|c: char| !c.is_alphanumeric() && c != '-').next();
        has("first-child hover active focus link visited", name.unwrap_or(""))
    };
    !selector.contains(['~', '|', '&', '\\'])
        && !["*=", "^=", "$="].iter().any(|sign| selector.contains(sign))
        && selector.split(':').skip(1).all(known)
}

fn declarations(text: &str) -> Vec<Declaration> {
    let mut found = Vec::new();
    let mut rest = text;
    while !rest.trim().is_empty() {
        let end = find_outside(rest, &[';']).unwrap_or(rest.len());
        if let Some((name, value)) = rest[..end].split_once(':') {
            let important = value.trim().rsplit_once('!');
            let important =
                important.filter(|(_, word)| word.trim().eq_ignore_ascii_case("important"));
            let (value, is_important) =
                important.map_or((value, false), |(value, _)| (value, true));
            let name = name.trim();
            let name = if name.starts_with("--") { name.into() } else { name.to_ascii_lowercase() };
            found.push((name, value.trim().to_owned(), is_important));
        }
        rest = rest.get(end + 1..).unwrap_or("");
    }
    found
}

fn declare(list: &[Declaration], budget: &Budget, declared: &mut Declared) -> Result<()> {
    for (name, value, important) in list {
        budget.steps(STEPS[2])?;
        budget.bytes(name.len() + value.len())?;
        if *important || !declared.get(name).is_some_and(|(_, important)| *important) {
            declared.insert(name.clone(), (value.clone(), *important));
        }
    }
    Ok(())
}

/// A value with its custom properties, or their fallbacks, put in; `None` where that has no end.
fn substituted(value: &str, scope: &Variables, budget: &Budget) -> Option<String> {
    let mut text = value.to_owned();
    for _ in 0..MAX_VARIABLES {
        let Some(at) = text.rfind("var(") else { return Some(text) };
        let inner = &text[at + 4..];
        let end = find_outside(inner, &[')']).or_else(|| inner.find(')'))?;
        let (name, fallback) = inner[..end].split_once(',').unwrap_or((&inner[..end], ""));
        let put = scope.get(name.trim()).map_or(fallback.trim(), |value| value);
        text = format!("{}{put}{}", &text[..at], &inner[end + 1..]);
        if !budget.spend_steps(STEPS[3] * text.len()) || text.len() > LONGEST {
            return None;
        }
    }
    None
}

/// Geometry as attributes: lengths in pixels are user units, `auto` is what is left out.
fn geometry(node: Node<'_, '_>, values: &mut Attributes) {
    let is_path = node.tag_name().name() == "path";
    values.retain(|name, value| {
        let is_geometry = GEOMETRY.contains(&&**name);
        if let Some(number) = value.trim().strip_suffix("px").filter(|_| is_geometry) {
            *value = number.trim().to_owned();
        } else if name == "d" && value.trim_start().starts_with("path(") {
            let quoted = value.trim().trim_start_matches("path(").trim_end_matches(')').trim();
            *value = quoted.trim_matches(['"', '\'']).to_owned();
        }
        !(is_geometry && value == "auto" || name == "d" && is_path && value == "none")
    });
}

/// Transforms of CSS as those of SVG.
fn transforms(node: Node<'_, '_>, values: &mut Attributes, named: &mut Named) {
    let tag = node.tag_name().name();
    let is_gradient = tag.ends_with("Gradient");
    let is_page = tag == "svg" && node.parent_element().is_none();
    let name = if is_gradient { "gradientTransform" } else { "transform" };
    let mut text = String::new();
    for function in ["translate", "rotate", "scale"] {
        let part = values.remove(function).filter(|part| part != "none");
        if let Some(part) = part.filter(|_| !is_gradient && !is_page) {
            let list = part.split_ascii_whitespace().collect::<Vec<_>>().join(", ");
            let _ = write!(text, "{function}({list}) ");
        }
    }
    text += values.remove(name).filter(|own| own.trim() != "none").as_deref().unwrap_or("");
    match transform::to_svg(&text) {
        None => named.add(format!("transform `{text}`"), node),
        Some(converted) if converted.is_empty() => {}
        Some(converted) => {
            values.insert(name.to_owned(), converted);
        }
    }
}

/// Names what of an element is not followed.
fn check(node: Node<'_, '_>, values: &Attributes, declared: &Declared, named: &mut Named) {
    let tag = node.tag_name().name();
    if matches!(tag, "style" | "script" | "font" | "glyph" | "font-face" | "namedview") {
        return;
    }
    let [followed, without_effect, others] = &*LISTS;
    let is_shape = matches!(tag, "circle" | "ellipse" | "rect" | "use" | "svg" | "symbol" | "line");
    let own = |name: &str| values.get(name).map_or("", |value| value.trim());
    for (name, value) in values.iter().filter(|(name, _)| !name.contains(':')) {
        let (name, value) = (&**name, value.trim());
        let is_neutral = NEUTRAL.contains(&value);
        let is_word = matches!(value, "inherit" | "currentColor" | "currentcolor");
        let is_broken = match name {
            "fill" | "stroke" if matches!(value, "context-fill" | "context-stroke") => false,
            "fill" | "stroke" => !is_word && svgtypes::Paint::from_str(value).is_err(),
            "stop-color" | "color" => !is_word && svgtypes::Color::from_str(value).is_err(),
            "clip-path" | "mask" => !value.starts_with("url(") && !is_neutral && !is_word,
            "d" => tag == "path" && svgtypes::PathParser::from(value).any(|part| part.is_err()),
            name if is_shape && GEOMETRY.contains(&name) => {
                svgtypes::Length::from_str(value).is_err()
            }
            "stroke-width" | "stroke-dashoffset" => {
                !is_word && svgtypes::Length::from_str(value).is_err()
            }
            "vector-effect" => {
                value == "non-scaling-stroke" && !matches!(own("stroke-dasharray"), "" | "none")
                    || value == "fixed-position"
            }
            "transform-box" => {
                !own("transform").is_empty() && !matches!(value, "view-box" | "border-box")
            }
            "systemLanguage" | "requiredExtensions" => true,
            "requiredFeatures" => false,
            "filter" | "mix-blend-mode" => !is_neutral,
            name if followed.contains(name) || without_effect.contains(name) => false,
            // Of text.
            name if ["font", "text-", "-"].iter().any(|begin| name.starts_with(begin)) => false,
            // An attribute that is no property is none to a browser, either.
            name => !is_neutral && (declared.contains_key(name) || others.contains(name)),
        };
        let is_reset = matches!(value, "initial" | "unset" | "revert" | "revert-layer");
        if is_broken || is_reset && followed.contains(name) {
            let short: String = value.chars().take(40).collect();
            let what = match name {
                "filter" | "mix-blend-mode" | "systemLanguage" => name.to_owned(),
                "d" => "path data that breaks off".to_owned(),
                _ => format!("{name} `{short}`"),
            };
            named.add(what, node);
        }
    }
}

/// An element to simplecss. What that asks is taken off a budget; once it is spent, there are no
/// elements around.
struct Matched<'a, 'input>(Node<'a, 'input>, &'a Budget);

impl Element for Matched<'_, '_> {
    fn parent_element(&self) -> Option<Self> {
        let parent = self.0.parent_element()?;
        self.1.spend_steps(STEPS[1]).then_some(Matched(parent, self.1))
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        let sibling = self.0.prev_sibling_element()?;
        self.1.spend_steps(STEPS[1]).then_some(Matched(sibling, self.1))
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.0.tag_name().name() == name
    }

    fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
        if name == ROOT {
            return self.0.parent_element().is_none();
        }
        let value = self.0.attribute(name);
        self.1.spend_steps(self.0.attributes().len() + value.map_or(0, str::len) / 8);
        value.is_some_and(|value| match operator {
            AttributeOperator::Contains(part) => value.split_ascii_whitespace().any(|v| v == part),
            _ => operator.matches(value),
        })
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        matches!(class, PseudoClass::FirstChild) && self.0.prev_sibling_element().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_those_of_the_parser() {
        let document = Document::parse("<a>\n<b/><c\n/>\n\n<d/></a>\n").unwrap();
        let named = Named::of(&document);
        for node in document.descendants() {
            let wanted = document.text_pos_at(node.range().start).row;
            assert_eq!(named.row(node), wanted, "{node:?}");
        }
    }
}
