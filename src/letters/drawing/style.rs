//! Styles: what an element's attributes are once style sheets, `style`, custom properties and the
//! geometry and transforms of CSS are resolved; and the closed list of what is understood of them.
//!
//! Selectors are matched by simplecss. What may change the picture and is not understood is named.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::rc::Rc;

use simplecss::{AttributeOperator, Element, PseudoClass, Selector};
use usvg::roxmltree::{Document, Node, NodeId};

use super::transform;
use super::xml::Rows;
use noctograph_core::files::Budget;

pub(super) const XLINK: &str = "http://www.w3.org/1999/xlink";
pub(super) const XML: &str = "http://www.w3.org/XML/1998/namespace";

/// Properties that are followed, here or by usvg.
#[rustfmt::skip]
const FOLLOWED: &[&str] = &[
    "clip-path", "clip-rule", "color", "cx", "cy", "d", "display", "fill", "fill-opacity",
    "fill-rule", "height", "marker-end", "marker-mid", "marker-start", "mask", "mask-type",
    "opacity", "overflow", "r", "rx", "ry", "stop-color", "stop-opacity", "stroke",
    "stroke-dasharray", "stroke-dashoffset", "stroke-linecap", "stroke-opacity", "stroke-width",
    "transform", "transform-origin", "visibility", "width", "x", "y",
];

/// Properties that change nothing of a line's place and color, or belong to text, which is refused.
#[rustfmt::skip]
const WITHOUT_EFFECT: &[&str] = &[
    "align-items", "alignment-baseline", "all-space-treatment", "aria-label", "background",
    "background-color", "baseline-shift", "block-progression", "border", "bottom", "box-sizing",
    "clip", "color-interpolation", "color-interpolation-filters", "color-profile",
    "color-rendering", "color-scheme", "contain", "content", "cursor", "direction",
    "dominant-baseline", "enable-background", "flex", "float", "flood-color", "flood-opacity",
    "hyphens", "image-rendering", "isolation", "justify-content", "kerning", "left",
    "letter-spacing", "lighting-color", "line-height", "margin", "max-height", "max-width",
    "outline", "overflow-x", "overflow-y", "padding", "paint-order", "pointer-events", "position",
    "right", "shape-inside", "shape-margin", "shape-padding", "shape-rendering", "solid-color",
    "solid-opacity", "stroke-linejoin", "stroke-miterlimit", "tab-size", "top", "touch-action",
    "transition", "unicode-bidi", "user-select", "vertical-align", "white-space", "will-change",
    "word-spacing", "writing-mode", "z-index",
];

/// Values by which a property that is not followed has no effect.
const NEUTRAL: &[&str] = &["", "none", "normal", "auto", "0", "1", "visible"];

/// Properties of CSS that are no attributes of every element, and those of geometry.
const GEOMETRY: &[&str] = &["cx", "cy", "d", "height", "r", "rx", "ry", "width", "x", "y"];

/// Longest value once its custom properties are put in, and how often these refer to others.
const LONGEST: usize = 1 << 20;
const MAX_VARIABLES: usize = 32;

/// Steps of a byte of a value.
const STEPS: usize = 5;

/// Most `@media` within each other.
const MAX_MEDIA: usize = 4;

/// Attribute that stands for `:root`, which simplecss does not know.
const ROOT: &str = "noctograph-root";

/// Attributes of an element as they are drawn: prefix, name and value.
pub(super) type Attributes = Vec<(&'static str, String, String)>;

/// What is not followed, by its name: how many elements, and the line of the first.
#[derive(Debug, Default)]
pub(super) struct Named(BTreeMap<String, (usize, u32)>);

impl Named {
    pub(super) fn add(&mut self, what: impl Into<String>, row: u32) {
        // So that a file of many odd names has a short list of them.
        let what: String = what.into().chars().take(80).collect();
        let known = self.0.len();
        let entry = match self.0.contains_key(&what) || known < 20 {
            true => self.0.entry(what),
            false => self.0.entry("other properties".into()),
        };
        entry.or_insert((0, row)).0 += 1;
    }

    /// One sentence for each.
    pub(super) fn sentences(&self, file: &str) -> Vec<String> {
        let sentence = |(what, (n, row)): (&String, &(usize, u32))| {
            let s = if *n == 1 { ("element uses", "at ") } else { ("elements use", "first at ") };
            format!("{n} {} {what}: not followed ({}{file}:{row})", s.0, s.1)
        };
        self.0.iter().map(sentence).collect()
    }
}

/// Attributes of all elements of a document.
pub(super) fn resolved(
    document: &Document<'_>,
    budget: &Budget,
    named: &mut Named,
) -> Result<HashMap<NodeId, Attributes>, String> {
    let rows = Rows::of(document);
    let row = |node: Node<'_, '_>| rows.at(node);
    let sheets: Vec<(u32, String)> = document
        .descendants()
        .filter(|node| node.tag_name().name() == "style" && node.is_element())
        .map(|node| {
            let text: String = node.children().filter_map(|child| child.text()).collect();
            (row(node), without_comments(&text))
        })
        .collect();
    let mut rules: Vec<Rule<'_>> = Vec::new();
    for (row, sheet) in &sheets {
        parse_rules(sheet, *row, 0, &mut rules, named);
    }
    rules.sort_by_key(|rule| rule.selector.specificity());
    let mut all = HashMap::new();
    let mut variables: HashMap<NodeId, Rc<Variables>> = HashMap::new();
    for node in document.descendants().filter(Node::is_element) {
        let mut declared: BTreeMap<String, (String, bool)> = BTreeMap::new();
        for rule in rules.iter().filter(|rule| rule.selector.matches(&Matched(node))) {
            declare(&rule.declarations, &mut declared);
        }
        let style = node.attribute("style").map(without_comments).unwrap_or_default();
        declare(&declarations(&style), &mut declared);
        let parent = node.parent_element().and_then(|parent| variables.get(&parent.id()).cloned());
        let own: Vec<_> = declared.iter().filter(|(name, _)| name.starts_with("--")).collect();
        let scope = match (parent, own.is_empty()) {
            (Some(parent), true) => parent,
            (parent, _) => {
                let mut scope = parent.map_or_else(Variables::default, |parent| (*parent).clone());
                scope.extend(own.iter().map(|(name, (value, _))| ((*name).clone(), value.clone())));
                let size: usize = scope.values().map(|value| value.len() + 100).sum();
                budget.bytes(size).map_err(|error| error.to_string())?;
                Rc::new(scope)
            }
        };
        let mut values: Vec<(&'static str, String, String)> = Vec::new();
        for attribute in node.attributes() {
            let prefix = match attribute.namespace() {
                None => "",
                Some(XLINK) => "xlink:",
                Some(XML) => "xml:",
                Some(_) => continue,
            };
            if prefix.is_empty() && matches!(attribute.name(), "style" | "class") {
                continue;
            }
            values.push((prefix, attribute.name().to_owned(), attribute.value().to_owned()));
        }
        declared.retain(|name, _| !name.starts_with("--"));
        let of_css: Vec<String> = declared.keys().cloned().collect();
        for (name, (value, _)) in declared {
            let names: &[&str] = match &*name {
                "marker" => &["marker-start", "marker-mid", "marker-end"],
                name => &[name],
            };
            for name in names {
                values.retain(|(prefix, other, _)| !prefix.is_empty() || other != name);
                values.push(("", (*name).to_owned(), value.clone()));
            }
        }
        for (_, _, value) in &mut values {
            if value.contains("var(") {
                *value = substituted(value, &scope, budget)?;
            }
        }
        variables.insert(node.id(), scope);
        for (_, name, value) in &mut values {
            let is_root = node.parent_element().is_none();
            if is_root && name == "background" && value.parse::<svgtypes::Color>().is_ok() {
                *name = "background-color".into();
            }
        }
        geometry(node, &mut values);
        transforms(node, &mut values, row(node), named);
        check(node, &values, &of_css, row(node), named);
        all.insert(node.id(), values);
    }
    Ok(all)
}

type Variables = BTreeMap<String, String>;

struct Rule<'a> {
    selector: Selector<'a>,
    declarations: Rc<Vec<Declaration>>,
}

/// Name, value, and whether it is important.
type Declaration = (String, String, bool);

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
    row: u32,
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
                named.add(prelude, row);
            }
            rest = after.get(1..).unwrap_or("").trim_start();
            continue;
        };
        let (mut open, mut close) = (1_usize, block.len());
        for (at, c) in block.char_indices() {
            open = match c {
                '{' => open + 1,
                '}' => open - 1,
                _ => open,
            };
            if open == 0 {
                close = at;
                break;
            }
        }
        let body = &block[..close];
        rest = block.get(close + 1..).unwrap_or("").trim_start();
        if let Some(at_rule) = prelude.strip_prefix('@') {
            let name = at_rule.split(|c: char| !c.is_alphanumeric() && c != '-').next();
            match name.unwrap_or("") {
                "font-face" | "keyframes" | "-webkit-keyframes" | "namespace" | "charset" => {}
                "media" if depth < MAX_MEDIA && matches!(at_rule[5..].trim(), "all" | "screen") => {
                    parse_rules(body, row, depth + 1, rules, named);
                }
                "media" if at_rule[5..].trim() == "print" => {}
                _ => named.add(format!("@{at_rule}"), row),
            }
            continue;
        }
        let declarations = Rc::new(declarations(body));
        for text in prelude.split(',').map(str::trim) {
            match Some(text).filter(|text| is_followed(text)).and_then(Selector::parse) {
                Some(selector) => {
                    rules.push(Rule { selector, declarations: Rc::clone(&declarations) });
                }
                None => named.add(format!("the selector `{text}`"), row),
            }
        }
    }
}

/// Whether a selector is one that simplecss matches whole. The states that a pointer leads to are
/// those of no element of a picture.
fn is_followed(selector: &str) -> bool {
    let states = ["first-child", "hover", "active", "focus", "link", "visited"];
    let known = |part: &str| {
        let name = part.split(|c: char| !c.is_alphanumeric() && c != '-').next();
        name.is_some_and(|name| states.contains(&name))
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
            let (value, important) = match value.trim().rsplit_once('!') {
                Some((value, word)) if word.trim().eq_ignore_ascii_case("important") => {
                    (value, true)
                }
                _ => (value, false),
            };
            let name = name.trim();
            let name = if name.starts_with("--") { name.into() } else { name.to_ascii_lowercase() };
            found.push((name, value.trim().to_owned(), important));
        }
        rest = rest.get(end + 1..).unwrap_or("");
    }
    found
}

fn declare(declarations: &[Declaration], declared: &mut BTreeMap<String, (String, bool)>) {
    for (name, value, important) in declarations {
        if *important || !declared.get(name).is_some_and(|(_, important)| *important) {
            declared.insert(name.clone(), (value.clone(), *important));
        }
    }
}

/// A value with its custom properties, or their fallbacks, put in.
fn substituted(value: &str, scope: &Variables, budget: &Budget) -> Result<String, String> {
    let mut text = value.to_owned();
    for _ in 0..MAX_VARIABLES {
        let Some(at) = text.rfind("var(") else { return Ok(text) };
        let inner = &text[at + 4..];
        let Some(end) = find_outside(inner, &[')']).or_else(|| inner.find(')')) else { break };
        let (name, fallback) = inner[..end].split_once(',').unwrap_or((&inner[..end], ""));
        let put = scope.get(name.trim()).map_or(fallback.trim(), |value| value);
        let whole = format!("{}{put}{}", &text[..at], &inner[end + 1..]);
        budget.steps(STEPS * whole.len()).map_err(|error| error.to_string())?;
        if whole.len() > LONGEST {
            break;
        }
        text = whole;
    }
    Err(format!("custom properties without end: `{}`", value.chars().take(60).collect::<String>()))
}

/// Geometry as attributes: lengths in pixels are user units, `auto` is what is left out.
fn geometry(node: Node<'_, '_>, values: &mut Attributes) {
    let tag = node.tag_name().name();
    values.retain(|(prefix, name, value)| {
        let is_geometry = prefix.is_empty() && GEOMETRY.contains(&&**name);
        !(is_geometry && value == "auto" || (name == "d" && tag == "path" && value == "none"))
    });
    for (_, name, value) in values.iter_mut() {
        if GEOMETRY.contains(&&**name) {
            if let Some(number) = value.trim().strip_suffix("px") {
                *value = number.trim().to_owned();
            } else if name == "d" && value.trim_start().starts_with("path(") {
                let quoted = value.trim().trim_start_matches("path(").trim_end_matches(')').trim();
                *value = quoted.trim_matches(['"', '\'']).to_owned();
            }
        }
    }
}

/// Transforms of CSS as those of SVG.
fn transforms(node: Node<'_, '_>, values: &mut Attributes, row: u32, named: &mut Named) {
    let get = |name: &str, values: &Attributes| {
        let found = values.iter().find(|(prefix, own, _)| prefix.is_empty() && own == name);
        found.map(|(_, _, value)| value.clone())
    };
    let parts = ["translate", "rotate", "scale"].map(|name| get(name, values));
    let is_gradient = node.tag_name().name().ends_with("Gradient");
    let name = if is_gradient { "gradientTransform" } else { "transform" };
    let own = get(name, values);
    if own.is_none() && parts.iter().all(Option::is_none) {
        return;
    }
    let mut text = String::new();
    for (function, part) in ["translate", "rotate", "scale"].iter().zip(parts) {
        let Some(part) = part.filter(|part| part != "none") else { continue };
        if is_gradient || node.tag_name().name() == "svg" && node.parent_element().is_none() {
            continue;
        }
        let list = part.split_ascii_whitespace().collect::<Vec<_>>().join(", ");
        let _ = write!(text, "{function}({list}) ");
    }
    text += own.as_deref().filter(|own| own.trim() != "none").unwrap_or("");
    let converted = transform::to_svg(&text);
    if converted.is_none() {
        named.add(format!("transform `{text}`"), row);
    }
    values.retain(|(_, own, _)| !matches!(&**own, "translate" | "rotate" | "scale") && own != name);
    if let Some(converted) = converted.filter(|converted| !converted.is_empty()) {
        values.push(("", name.to_owned(), converted));
    }
}

/// Names what of an element is not followed.
fn check(node: Node<'_, '_>, values: &Attributes, of_css: &[String], row: u32, named: &mut Named) {
    let tag = node.tag_name().name();
    if matches!(tag, "style" | "script" | "font" | "glyph" | "font-face" | "namedview") {
        return;
    }
    // An attribute that is no property is none to a browser, either.
    let is_attribute_only =
        |name: &str| !is_css(name) && !of_css.iter().any(|declared| declared == name);
    let own = |wanted: &str| {
        let found = values.iter().find(|(prefix, name, _)| prefix.is_empty() && name == wanted);
        found.map_or("", |(_, _, value)| value.trim())
    };
    for (prefix, name, value) in values {
        let (name, value) = (&**name, value.trim());
        if !prefix.is_empty() {
            continue;
        }
        let is_link = value.starts_with("url(");
        let is_broken = match name {
            "fill" | "stroke" => usvg_paint(value).is_none(),
            "stop-color" | "color" => !is_word(value) && value.parse::<svgtypes::Color>().is_err(),
            "clip-path" | "mask" => !is_link && !NEUTRAL.contains(&value) && !is_word(value),
            "cx" | "cy" | "height" | "r" | "rx" | "ry" | "width" | "x" | "y" if is_shape(tag) => {
                value.parse::<svgtypes::Length>().is_err()
            }
            "stroke-width" | "stroke-dashoffset" => {
                !is_word(value) && value.parse::<svgtypes::Length>().is_err()
            }
            "d" if tag == "path" => svgtypes::PathParser::from(value).any(|part| part.is_err()),
            "vector-effect" => {
                value == "non-scaling-stroke" && !matches!(own("stroke-dasharray"), "" | "none")
                    || value == "fixed-position"
            }
            "transform-box" => {
                !own("transform").is_empty() && !matches!(value, "view-box" | "border-box")
            }
            "systemLanguage" | "requiredExtensions" => true,
            "requiredFeatures" => false,
            "filter" | "mix-blend-mode" => !NEUTRAL.contains(&value),
            name if FOLLOWED.contains(&name) => false,
            name if WITHOUT_EFFECT.contains(&name) || is_of_text(name) => false,
            name if is_attribute_only(name) => false,
            _ => !NEUTRAL.contains(&value),
        };
        let is_reset = FOLLOWED.contains(&name)
            && matches!(value, "initial" | "unset" | "revert" | "revert-layer");
        if is_broken || is_reset {
            let short: String = value.chars().take(40).collect();
            let what = match name {
                "filter" | "mix-blend-mode" | "systemLanguage" => name.to_owned(),
                "d" => "path data that breaks off".to_owned(),
                _ => format!("{name} `{short}`"),
            };
            named.add(what, row);
        }
    }
}

/// The paint of a value: usvg takes others for black or none.
fn usvg_paint(value: &str) -> Option<()> {
    let is_contextual = matches!(value, "context-fill" | "context-stroke") || is_word(value);
    (is_contextual || svgtypes::Paint::from_str(value).is_ok()).then_some(())
}

fn is_word(value: &str) -> bool {
    matches!(value, "inherit" | "currentColor" | "currentcolor")
}

fn is_shape(tag: &str) -> bool {
    matches!(tag, "circle" | "ellipse" | "rect" | "use" | "svg" | "symbol" | "line")
}

fn is_of_text(name: &str) -> bool {
    name.starts_with("font") || name.starts_with("text-") || name.starts_with('-')
}

/// Whether a name that is neither followed nor without effect is a property of CSS that is meant
/// where it stands as an attribute, too.
fn is_css(name: &str) -> bool {
    const CSS: &[&str] = &[
        "animation",
        "animation-name",
        "backdrop-filter",
        "background-image",
        "clip-path-box",
        "mask-border",
        "mask-clip",
        "mask-image",
        "mask-mode",
        "mask-position",
        "mask-size",
        "offset-distance",
        "offset-path",
        "perspective",
        "perspective-origin",
        "shape-outside",
        "stroke-alignment",
        "zoom",
        "content-visibility",
        "rotate",
    ];
    CSS.contains(&name)
}

/// An element to simplecss.
struct Matched<'a, 'input>(Node<'a, 'input>);

impl Element for Matched<'_, '_> {
    fn parent_element(&self) -> Option<Self> {
        self.0.parent_element().map(Matched)
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.0.prev_sibling_element().map(Matched)
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.0.tag_name().name() == name
    }

    fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
        if name == ROOT {
            return self.0.parent_element().is_none();
        }
        self.0.attribute(name).is_some_and(|value| match operator {
            AttributeOperator::Contains(part) => value.split_ascii_whitespace().any(|v| v == part),
            _ => operator.matches(value),
        })
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        matches!(class, PseudoClass::FirstChild) && self.0.prev_sibling_element().is_none()
    }
}
