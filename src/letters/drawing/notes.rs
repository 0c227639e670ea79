//! Notes on features of an SVG file that usvg does not support. Warnings name such features, and
//! the file is edited so that none of them is drawn incorrectly.
//!
//! An element that would be drawn in the wrong position is left out. Text, pictures and other
//! foreign content are replaced by a sign: a shape that reveals whether the content would be
//! visible. Other unsupported features affect the appearance of a line but not its position.

use std::ops::Range;
use std::str::FromStr as _;

use usvg::roxmltree::Node;

use super::styles::{Declaration, Named, Styles, has_escapes};

/// Properties that are supported, only affect text, or do not change a line's position and color.
const KNOWN: &str = "align-items alignment-baseline all-space-treatment aria-label background \
    background-color baseline-shift block-progression border bottom box-sizing clip clip-path \
    clip-rule color color-interpolation color-interpolation-filters color-profile color-rendering \
    color-scheme contain content cursor direction display dominant-baseline enable-background fill \
    fill-opacity fill-rule filter flex float flood-color flood-opacity hyphens image-rendering \
    isolation justify-content kerning left letter-spacing lighting-color line-height margin marker \
    marker-end marker-mid marker-start mask mask-type max-height max-width min-height min-width \
    mix-blend-mode opacity outline overflow overflow-x overflow-y padding paint-order \
    pointer-events position right shape-inside shape-margin shape-padding shape-rendering \
    solid-color solid-opacity stop-color stop-opacity stroke stroke-dasharray stroke-dashoffset \
    stroke-linecap stroke-linejoin stroke-miterlimit stroke-opacity stroke-width tab-size top \
    touch-action transform transform-box transform-origin transition unicode-bidi user-select \
    vector-effect vertical-align visibility white-space will-change word-spacing writing-mode \
    z-index";

/// Unsupported CSS properties that also exist as XML attributes.
const OTHERS: &str = "animation animation-name backdrop-filter background-image clip-path-box \
    content-visibility mask-border mask-clip mask-image mask-mode mask-position mask-size \
    offset-distance offset-path perspective perspective-origin rotate scale shape-outside \
    stroke-alignment translate zoom";

/// Geometry properties, which usvg reads only as attributes, and unsupported transforms.
const PLACES: &str = "cx cy d height r rx ry width x y translate rotate scale";

/// Values with which an unsupported property has no effect.
const NEUTRAL: &str = "none normal auto 0 1 visible";

/// Values that refer to another value.
const WORDS: &str = "inherit currentColor currentcolor";

/// Elements that are drawn and have a position.
const SHAPES: &str = "circle ellipse g line path polygon polyline rect svg symbol use";

/// Elements whose content only browsers can draw.
pub(super) const FOREIGN: &str = "text image foreignObject video iframe canvas mesh solidcolor";

/// Elements whose content is not drawn. Patterns are drawn as a uniform shade.
pub(super) const EMPTIED: &str = "pattern filter";

/// Elements that only have an effect if other elements refer to them.
const REFERRED: &str = "clipPath mask linearGradient radialGradient pattern marker symbol filter";

const ANIMATIONS: &str = "animate animateTransform animateMotion animateColor set";

/// Maximum number of stops of a gradient that are read.
const MAX_STOPS: usize = 16;

/// The x coordinate of signs, and the maximum number of signs. Both numbers are exact in single
/// precision.
pub(super) const SIGN_X: f32 = 7_777_777.0;
const MAX_SIGNS: usize = 10_000;

/// Style rules that are passed to usvg in addition to those of the file.
pub(super) const RULES: &str = "*{filter:none!important}marker *{marker:none!important}\
    [pathLength]{stroke-dasharray:none!important}\
    [noctograph]{fill:#000!important;stroke:none!important;clip-path:none!important;\
    mask:none!important}";

/// True if a list of words, separated by white space, contains a word.
pub(super) fn has(words: &str, word: &str) -> bool {
    words.split_ascii_whitespace().any(|other| other == word)
}

/// The XML namespace of drawings.
pub(super) const SVG: &str = "http://www.w3.org/2000/svg";

/// Rewrites the text of a file in terms that usvg knows: replaces https in namespaces, `:root` and
/// `background:`, and removes units from CSS transforms.
pub(super) fn in_words_of_usvg(mut text: String) -> String {
    for namespace in ["2000/svg", "1999/xlink"] {
        for quote in ['"', '\''] {
            let [with_https, with_http] =
                ["https", "http"].map(|scheme| format!("{quote}{scheme}://www.w3.org/{namespace}"));
            text = text.replace(&with_https, &with_http);
        }
    }
    let text = text.replace("svg:root", "svg").replace(":root", "svg");
    let text = text.replace("background:", "background-color:");
    // Transforms have units in CSS but not in attributes, and usvg reads only attributes.
    let mut parts = text.split("transform:");
    let mut written = parts.next().unwrap_or("").to_owned();
    for part in parts {
        let (value, rest) = part.split_at(part.find([';', '"', '\'', '}']).unwrap_or(part.len()));
        written += "transform:";
        written += &value.replace("px", "").replace("deg", "");
        written += rest;
    }
    written
}

/// Notes on the unsupported features of a document.
pub(super) struct Notes<'a, 'b, 'input> {
    pub(super) styles: &'b Styles<'a, 'input>,
    pub(super) named: &'b mut Named,
    /// The elements that have been replaced by signs.
    pub(super) signs: Vec<Node<'a, 'input>>,
    /// The ranges of the text that are replaced, in order, with their new text.
    pub(super) edits: Vec<(Range<usize>, String)>,
}

impl<'a, 'input> Notes<'a, '_, 'input> {
    /// Returns the text with all edits applied, which usvg then reads.
    pub(super) fn edited(&self, text: &str) -> String {
        let (mut edited, mut end) = (String::with_capacity(text.len()), 0);
        for (range, new) in &self.edits {
            edited += &text[end..range.start];
            edited += new;
            end = range.end;
        }
        edited + &text[end..]
    }

    /// Notes the unsupported features of an element and of its descendants. The error names a kind
    /// of element of which there are too many.
    pub(super) fn element(&mut self, node: Node<'a, 'input>) -> Result<(), String> {
        let tag = node.tag_name().name();
        if matches!(node.tag_name().namespace(), None | Some(SVG)) {
            // The edit of a replaced or omitted element includes its descendants.
            let before = node.prev_siblings().filter(|sibling| sibling.has_tag_name(tag));
            match tag {
                "script" => self.named.add("a script", "not followed", node),
                "style" if has_escapes(node) => self.edits.push((node.range(), String::new())),
                "stop" if before.count() >= MAX_STOPS => {
                    self.edits.push((node.range(), String::new()));
                    self.named.add("a gradient of many stops", "cut to 16", node);
                    return Ok(());
                }
                tag if has(FOREIGN, tag) => return self.sign(node),
                tag if has(ANIMATIONS, tag) => {
                    self.named.add("an animation", "drawn in its initial state", node);
                }
                tag if has(EMPTIED, tag) => {
                    self.only_first(node);
                    self.empty(node);
                    return Ok(());
                }
                _ if self.note_declarations(node) => {
                    self.edits.push((node.range(), String::new()));
                    return Ok(());
                }
                _ => self.only_first(node),
            }
        }
        node.children().filter(Node::is_element).try_for_each(|child| self.element(child))
    }

    /// Removes an id that an earlier element already has. Browsers resolve an id to its first
    /// element, but usvg resolves it to the last one.
    fn only_first(&mut self, node: Node<'a, 'input>) {
        let Some(id) = node.attribute_node("id").filter(|_| !self.styles.is_first(node)) else {
            return;
        };
        if self.styles.has_rule_of(id.value()) {
            let what = format!("the id {:?} a second time, with a style", id.value());
            self.named.add(what, "references may use this element", node);
            return;
        }
        self.edits.push((id.range(), String::new()));
        if has(REFERRED, node.tag_name().name()) {
            let what = format!("the id {:?} again", id.value());
            self.named.add(what, "references use the first one, as in browsers", node);
        }
    }

    /// Replaces an element by a sign: a polyline with the element's attributes, whose points encode
    /// the element's index. usvg transforms or hides the sign as it would the element. Fails if
    /// there are too many signs.
    fn sign(&mut self, node: Node<'a, 'input>) -> Result<(), String> {
        let name = node.tag_name().name();
        let mut texts = node.descendants().filter_map(|part| part.text());
        let is_borrowed = node.children().any(|part| part.tag_name().name() == "tref");
        // A text of only white space is invisible, unless it borrows the text of another element.
        if name == "text" && !is_borrowed && texts.all(|text| text.trim().is_empty()) {
            return Ok(());
        }
        let index = self.signs.len();
        if index == MAX_SIGNS {
            return Err(format!("more than {MAX_SIGNS} elements <{name}>"));
        }
        self.signs.push(node);
        // The sign keeps the element's prefix and attributes as written, so that its namespace and
        // style are the same.
        let text = node.document().input_text();
        let qualified = text[node.range().start + 1..].split(|c: char| "/> \t\r\n".contains(c));
        let prefix = qualified.map(|name| name.rsplit_once(':')).next().flatten();
        let prefix = prefix.map_or(String::new(), |(prefix, _)| format!("{prefix}:"));
        let mut sign =
            format!("<{prefix}polyline noctograph=\"\" points=\"{SIGN_X} {index} {SIGN_X} 0 0 0\"");
        let (is_first, left_out) = (self.styles.is_first(node), "points noctograph");
        let kept = |name| !has(left_out, name) && (is_first || name != "id");
        for attribute in node.attributes().filter(|attribute| kept(attribute.name())) {
            sign += " ";
            sign += &text[attribute.range()];
        }
        self.edits.push((node.range(), sign + "/>"));
        Ok(())
    }

    /// Removes the content of a pattern or a filter. If a pattern contains shapes, a square
    /// replaces them, because usvg drops patterns without shapes.
    fn empty(&mut self, node: Node<'a, 'input>) {
        let (Some(first), Some(last)) = (node.first_child(), node.last_child()) else { return };
        let range = first.range().start..last.range().end;
        let is_pattern = node.tag_name().name() == "pattern";
        // The square is in the namespace of the pattern, regardless of its prefix.
        let shape =
            node.children().find(|child| is_pattern && has(SHAPES, child.tag_name().name()));
        let shape = shape.map_or(String::new(), |_| "<path d=\"M0 0h1v1z\"/>".to_owned());
        self.edits.push((range, shape));
    }

    /// Notes the unsupported declarations of an element. Returns true if one of them would misplace
    /// the element, which must then be left out.
    fn note_declarations(&mut self, node: Node<'a, 'input>) -> bool {
        let mut is_left_out = false;
        for declared in self.styles.declared(node).iter().copied() {
            let declared = Declaration { value: declared.value.trim(), ..declared };
            let Declaration { name, value, of_css } = declared;
            // Only the effective value matters. CSS variables by themselves have no effect.
            if of_css && name.starts_with("--") || self.styles.value(node, name) != Some(value) {
                continue;
            }
            let note = if self.is_misplaced(node, declared) {
                is_left_out = true;
                Some((shown(name, value), "left out"))
            } else {
                self.note(node, declared)
            };
            if let Some((what, how)) = note {
                self.named.add(what, how, node);
            }
        }
        is_left_out
    }

    /// True if a declaration moves an element in a way that is not supported.
    fn is_misplaced(&self, node: Node<'a, 'input>, declared: Declaration<'a>) -> bool {
        let Declaration { name, value, of_css } = declared;
        let tag = node.tag_name().name();
        let is_page = tag == "svg" && node.parent_element().is_none();
        match name {
            "transform" => !is_neutral(value) && svgtypes::Transform::from_str(value).is_err(),
            "transform-box" => {
                let is_moved = self.styles.value(node, "transform").is_some();
                is_moved && !has("view-box border-box", value)
            }
            _ => {
                let is_place = of_css && has(PLACES, name) && !has("none auto", value);
                is_place && !is_page && has(SHAPES, tag)
            }
        }
    }

    /// Returns the name of a declaration that is not drawn as in a browser, and how it is drawn.
    /// Returns `None` if it is drawn as in a browser.
    fn note(
        &self,
        node: Node<'a, 'input>,
        declared: Declaration<'a>,
    ) -> Option<(String, &'static str)> {
        let Declaration { name, value, of_css } = declared;
        let tag = node.tag_name().name();
        let target = self.styles.target(value).map_or("", |target| target.tag_name().name());
        if let Some(note) = paint_note(name, value, target) {
            return Some(note);
        }
        Some(match name {
            // The first declarations refer to other elements.
            "marker-start" | "marker-mid" | "marker-end" | "marker"
                if target == "marker"
                    && node.ancestors().any(|node| node.tag_name().name() == "marker") =>
            {
                ("a marker within a marker".into(), "not drawn")
            }
            "href" if tag == "use" && !value.starts_with('#') => {
                ("another file (`use`)".into(), "not followed")
            }
            // The next declarations are those of paths.
            "d" if !of_css
                && tag == "path"
                && svgtypes::PathParser::from(value).any(|part| part.is_err()) =>
            {
                ("incomplete path data".into(), "drawn up to the error")
            }
            "pathLength"
                if node
                    .ancestors()
                    .any(|node| self.styles.value(node, "stroke-dasharray").is_some()) =>
            {
                (name.to_owned(), "its dashes are drawn as a line")
            }
            "systemLanguage" => (name.to_owned(), "taken for English"),
            "filter" | "mix-blend-mode" if !is_neutral(value) => (name.to_owned(), "not followed"),
            _ if self.is_ignored(node, declared) => (shown(name, value), "not followed"),
            _ => return None,
        })
    }

    /// True if a declaration has an effect in browsers but not here.
    fn is_ignored(&self, node: Node<'a, 'input>, declared: Declaration<'a>) -> bool {
        let Declaration { name, value, of_css } = declared;
        let is_shape = has(SHAPES, node.tag_name().name());
        let is_reset = has("initial unset revert revert-layer", value);
        match name {
            _ if is_unreadable(name, value) => true,
            "clip-path" | "mask" if !is_neutral(value) && !has(WORDS, value) => {
                !value.starts_with("url(") || !value.ends_with(')')
            }
            "vector-effect" => {
                let dashes = self.styles.value(node, "stroke-dasharray");
                let is_dashed = dashes.is_some_and(|dashes| dashes != "none");
                is_reset || value == "fixed-position" || is_dashed && value == "non-scaling-stroke"
            }
            _ if of_css && has(PLACES, name) => false,
            _ if !of_css && is_shape && has("cx cy height r rx ry width x y", name) => {
                value != "auto" && svgtypes::Length::from_str(value).is_err()
            }
            _ if has(KNOWN, name) => is_reset,
            // Properties that affect only text are not ignored features.
            _ if ["font", "text-", "-"].iter().any(|begin| name.starts_with(begin)) => false,
            // Browsers also ignore attributes that are not properties.
            _ => !is_neutral(value) && (of_css || has(OTHERS, name)),
        }
    }
}

/// Returns the name of a paint that is not a single color, and how it is drawn, or `None` for any
/// other declaration. `target` is the tag of the element to which it refers.
fn paint_note(name: &str, value: &str, target: &str) -> Option<(String, &'static str)> {
    const TRANSPARENT: &str = "drawn even where it is transparent";
    Some(match name {
        "fill" | "stroke" if target.ends_with("Gradient") => {
            (format!("{name} by a gradient"), "in the color of its middle stop")
        }
        "fill" | "stroke" if target == "pattern" => {
            (format!("{name} by a pattern"), "drawn as a shade")
        }
        "fill" if is_unreadable(name, value) => (shown(name, value), "drawn in black instead"),
        "stop-color" if svgtypes::Color::from_str(value).is_ok_and(|color| color.alpha < 255) => {
            ("a transparent stop-color".into(), TRANSPARENT)
        }
        "stop-opacity"
            if svgtypes::Number::from_str(value).map_or(0.0, |number| number.0) < 1.0 =>
        {
            (name.to_owned(), TRANSPARENT)
        }
        _ => return None,
    })
}

/// Returns a declaration as shown in a warning: its name and the start of its value.
fn shown(name: &str, value: &str) -> String {
    /// Maximum number of characters of the value that are shown.
    const MAX_SHOWN: usize = 40;
    format!("{name} `{}`", value.chars().take(MAX_SHOWN).collect::<String>())
}

/// True for a value that has no effect.
fn is_neutral(value: &str) -> bool {
    value.is_empty() || has(NEUTRAL, value)
}

/// True for a value that cannot be read as the paint, color or length that its property takes.
fn is_unreadable(name: &str, value: &str) -> bool {
    !has(WORDS, value)
        && match name {
            "fill" | "stroke" => svgtypes::Paint::from_str(value).is_err(),
            "stop-color" | "color" => svgtypes::Color::from_str(value).is_err(),
            "opacity" | "fill-opacity" | "stroke-opacity" | "stroke-width"
            | "stroke-dashoffset" => svgtypes::Length::from_str(value).is_err(),
            _ => false,
        }
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

    /// Returns six levels of an element, each with ten references to the next level.
    fn levels(open: &str, part: &str, close: &str) -> String {
        let levels = (0..12).map(|n: usize| {
            let part = part.replace("NEXT", &format!("e{}", n + 1)).repeat(10);
            open.replace("THIS", &format!("e{n}")) + &part + close
        });
        levels.collect()
    }

    #[test]
    fn references_that_multiply_cost_little_or_are_refused() {
        let shape = "<rect width='9' height='9' PROPERTY='url(#NEXT)'/>";
        let tried = "<path d='M0 0h9v9' stroke='red' fill='url(#e0)' PROPERTY='url(#e0)'/>";
        for (tag, property, n) in [("pattern", "fill", 3), ("filter", "filter", 2)] {
            let open = format!("<{tag} id='THIS' width='1' height='1'>");
            let part = shape.replace("PROPERTY", property);
            let all = levels(&open, &part, &format!("</{tag}>"));
            let tried = tried.replace("fill='url(#e0)' PROPERTY", property);
            assert_eq!(n_lit(&(all + &tried)), n, "{tag}: a fill closes its path");
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
            format!("<style>{}a{{{}}}</style>", "a,".repeat(9000), "x:y;".repeat(9000)),
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
            let filled = format!(
                "<{server} id='g' width='1' height='1'><stop/><path d='M0 0h1v1'/></{server}>\
                 {filled}"
            );
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
