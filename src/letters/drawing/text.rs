//! Text of an SVG file, written with the font of the scene: its own typeface is not in the file.
//!
//! Product in: the document. Product out: for each `<text>`, groups and paths that take its place, so that
//! transforms, colors and `use` go on as they are. Read are x, y, dx, dy (the first of each), font-size and
//! text-anchor, from attributes or `style`; capitals are 0.7 of the font size high. Not read: text along
//! paths, rotated letters, and rules of style sheets for `text` and `tspan`.

use std::fmt::Write as _;

use svgtypes::{Length, LengthUnit};
use usvg::roxmltree::{Document, Node};

use super::super::layout::{MAX_LETTERS, line};
use super::plain::{MAX_DEPTH, Texts, too_deep, write_attributes_of};
use crate::error::{Error, Result};
use crate::files::Budget;
use crate::letters::{Font, LetterOptions};

/// Height of capitals by the font size, as most typefaces have it.
const CAPITALS: f64 = 0.7;

/// Font size where none is given, user units.
const FONT_SIZE: f64 = 16.0;

/// Steps of a byte of a style.
const STEPS: usize = 5;

/// Writes all texts of a document.
///
/// # Errors
///
/// [`Error::Letter`] for a letter that the font lacks; [`Error::Input`] for more than 256 letters, and for a
/// length in a unit that depends on others.
pub(super) fn written(
    document: &Document<'_>,
    options: &LetterOptions,
    budget: &Budget,
    file: &str,
) -> Result<Texts> {
    let hint = "convert it to paths in the SVG editor (Inkscape: Path > Object to Path)";
    let refuse = |node: Node<'_, '_>, found: String, wanted: &str| {
        let row = document.text_pos_at(node.range().start).row;
        Error::input(format!("{file}:{row}"), found, wanted, hint)
    };
    let is_text = |node: &Node<'_, '_>| node.tag_name().name() == "text";
    let is_outermost =
        |node: &Node<'_, '_>| !node.ancestors().skip(1).take(MAX_DEPTH).any(|node| is_text(&node));
    let texts = document.descendants().filter(is_text).filter(is_outermost);
    let texts: Vec<_> = texts.filter(|text| n_letters(*text) > 0).collect();
    let n: usize = texts.iter().map(|text| n_letters(*text)).sum();
    let Some(first) = texts.first() else { return Ok(Texts::new()) };
    if n > MAX_LETTERS {
        let wanted = format!("at most {MAX_LETTERS}");
        return Err(refuse(*first, format!("{n} letters of text"), &wanted));
    }
    let font = Font::open(&options.font, options.trace)?;
    let write = |node: Node<'_, '_>| {
        let depth = |node: Node<'_, '_>| node.ancestors().take(MAX_DEPTH + 1).count();
        if node.descendants().any(|node| depth(node) > MAX_DEPTH) {
            return Err(refuse(node, too_deep(), "text of a few levels"));
        }
        let (font, place) =
            (&font, format!("{file}:{}", document.text_pos_at(node.range().start).row));
        let (pen, after_space, markup) = ([0.0; 2], true, String::new());
        let mut text = Text { font, options, budget, place, pen, after_space, markup };
        text.element(node)?;
        Ok((node.id(), text.markup))
    };
    texts.into_iter().map(write).collect()
}

fn n_letters(text: Node<'_, '_>) -> usize {
    let parts = text.descendants().filter(Node::is_text).filter_map(|node| node.text());
    parts.flat_map(str::chars).filter(|c| !c.is_whitespace()).count()
}

/// A text that is being written.
struct Text<'a> {
    font: &'a Font,
    options: &'a LetterOptions,
    budget: &'a Budget,
    /// Its place in the file, for messages.
    place: String,
    /// Where the next letter stands, y down.
    pen: [f64; 2],
    after_space: bool,
    markup: String,
}

impl Text<'_> {
    /// Refuses letters that do not stand in a row as the font spaces them.
    fn check_row(&self, node: Node<'_, '_>) -> Result<()> {
        let is_list = |name: &&str| node.attribute(*name).is_some_and(|v| values(v).count() > 1);
        let lists = ["x", "y", "dx", "dy"].into_iter().filter(is_list);
        let lists = lists.filter(|_| n_letters(node) > 1);
        let others = ["rotate", "textLength"].into_iter().filter(|name| node.has_attribute(*name));
        let spacing = self.property(node, "letter-spacing")?;
        let number = |s: &str| s.trim_end_matches(|c: char| c.is_alphabetic() || c == '%').parse();
        let is_wide = spacing.is_some_and(|s| s != "normal" && number(s) != Ok(0.0));
        let Some(name) = lists.chain(others).chain(is_wide.then_some("letter-spacing")).next()
        else {
            return Ok(());
        };
        let hint = "convert the text to paths";
        Err(Error::input(&self.place, name, "letters in a row, spaced by the font", hint))
    }

    fn element(&mut self, node: Node<'_, '_>) -> Result<()> {
        self.check_row(node)?;
        let [x, y, dx, dy] = ["x", "y", "dx", "dy"].map(|name| self.length(node, name));
        if let Some(x) = x? {
            self.pen[0] = x;
        }
        if let Some(y) = y? {
            self.pen[1] = y;
        }
        self.pen = [self.pen[0] + dx?.unwrap_or(0.0), self.pen[1] + dy?.unwrap_or(0.0)];
        if begins(node) {
            let before = match self.property(node, "text-anchor")? {
                Some("middle") => 0.5,
                Some("end") => 1.0,
                _ => 0.0,
            };
            let after_space = self.after_space;
            self.pen[0] -= before * self.width(node)?;
            self.after_space = after_space;
        }
        self.markup.push_str("<g");
        write_attributes_of(node, &mut self.markup);
        self.markup.push('>');
        for child in node.children() {
            match child.text().filter(|_| child.is_text()) {
                Some(text) => self.letters(node, text)?,
                None if n_letters(child) > 0 => self.element(child)?,
                None => {}
            }
        }
        self.markup.push_str("</g>");
        Ok(())
    }

    /// Writes letters of an element.
    fn letters(&mut self, node: Node<'_, '_>, text: &str) -> Result<()> {
        let text = self.without_gaps(text);
        let cap = CAPITALS * self.font_size(node)?;
        let (strokes, advance) = line(&text, self.font, self.options)?;
        if strokes.is_empty() {
            self.pen[0] += advance * cap;
            return Ok(());
        }
        self.markup.push_str("<path d=\"");
        for stroke in strokes {
            for (index, [x, y]) in stroke.into_iter().enumerate() {
                let command = if index == 0 { 'M' } else { 'L' };
                let (x, y) = (self.pen[0] + x * cap, self.pen[1] - y * cap);
                let _ = write!(self.markup, "{command}{x:.6e} {y:.6e}");
            }
        }
        self.markup.push_str("\"/>");
        self.pen[0] += advance * cap;
        Ok(())
    }

    /// Width of an element's letters up to those with a place of their own.
    fn width(&mut self, node: Node<'_, '_>) -> Result<f64> {
        let mut width = 0.0;
        for child in node.children() {
            width += match child.text().filter(|_| child.is_text()) {
                Some(text) => {
                    let text = self.without_gaps(text);
                    let cap = CAPITALS * self.font_size(node)?;
                    cap * line(&text, self.font, self.options)?.1
                }
                None if child.is_element() && !begins(child) => self.width(child)?,
                None => 0.0,
            };
        }
        Ok(width)
    }

    /// The text with one space for a run of them, and none at the beginning.
    fn without_gaps(&mut self, text: &str) -> String {
        let mut kept = String::new();
        for c in text.chars() {
            if !(c.is_whitespace() && self.after_space) {
                kept.push(if c.is_whitespace() { ' ' } else { c });
            }
            self.after_space = c.is_whitespace();
        }
        kept
    }

    fn font_size(&self, node: Node<'_, '_>) -> Result<f64> {
        let size = self.property(node, "font-size")?;
        size.map_or(Ok(FONT_SIZE), |size| self.user_units("font-size", size))
    }

    /// The first length of an attribute.
    fn length(&self, node: Node<'_, '_>, name: &str) -> Result<Option<f64>> {
        let value = node.attribute(name).and_then(|value| values(value).next());
        value.map(|value| self.user_units(name, value)).transpose()
    }

    fn user_units(&self, name: &str, value: &str) -> Result<f64> {
        let inch = 96.0;
        let per_unit = |unit| match unit {
            LengthUnit::None | LengthUnit::Px => Some(1.0),
            LengthUnit::In => Some(inch),
            LengthUnit::Cm => Some(inch / 2.54),
            LengthUnit::Mm => Some(inch / 25.4),
            LengthUnit::Pt => Some(inch / 72.0),
            LengthUnit::Pc => Some(inch / 6.0),
            LengthUnit::Em | LengthUnit::Ex | LengthUnit::Percent => None,
        };
        let length = value.trim().parse::<Length>().ok();
        let found = length.and_then(|length| Some(length.number * per_unit(length.unit)?));
        found.filter(|units| units.abs() < 1e9).ok_or_else(|| {
            let hint = "write lengths of text as numbers, or convert it to paths";
            Error::input(&self.place, format!("{name} of {value}"), "user units, such as 12", hint)
        })
    }

    /// A property of an element or of those around it, by its style or its attribute.
    fn property<'n>(&self, node: Node<'n, '_>, name: &str) -> Result<Option<&'n str>> {
        for node in node.ancestors() {
            let style = node.attribute("style").unwrap_or("");
            self.budget.steps(STEPS * (style.len() + 10))?;
            let mut parts = style.split(';').filter_map(|part| part.split_once(':'));
            let styled = parts.find(|(of, _)| of.trim() == name).map(|(_, value)| value.trim());
            if let Some(value) = styled.or_else(|| node.attribute(name)) {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }
}

/// The values of a list.
fn values(list: &str) -> impl Iterator<Item = &str> {
    list.split([' ', ',', '\n', '\t']).filter(|part| !part.is_empty())
}

/// Whether an element's letters begin at a place of their own.
fn begins(node: Node<'_, '_>) -> bool {
    node.tag_name().name() == "text" || node.has_attribute("x")
}
