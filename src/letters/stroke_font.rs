//! Stroke fonts: letters as runs of the pen, stored as text.
//!
//! Each line defines a letter: the character or its code point (`U+0023` for `#`), followed by its
//! runs, each `+` (lit) or `-` (dark) and its points `x,y` (y up from the baseline). A line that
//! starts with `#` is a comment. There are two kinds of fonts:
//! - The letters of a box font fill their boxes: 0,0 is the lower left corner and 1,1 the upper
//!   right one. Every move of the pen is listed, including jumps.
//! - A font with a line `cap 21`, the height of a capital in the font's units, keeps its
//!   proportions. An advance follows the character, x = 0 is the pen's position before the
//!   character, and the pen moves in the dark between lit runs. Points that turn by less than 60°
//!   are samples of a curve ([`super::arcs`]), and a run too short to be visible, such as `5,1.005
//!   5,0.995`, is a dot. `Á = A ´` composes a character: the mark is centered over the base, a mark
//!   above it is raised by the height of the base over a small letter, and `dx,dy` moves the mark.

use std::collections::BTreeMap;
use std::sync::Arc;

use kurbo::{Point, Vec2};
use unicode_normalization::UnicodeNormalization;

use super::arcs::with_arcs;
use super::face::Face;
use super::shape::{CAP_HEIGHTS, Fit, Run, Shape};
use noctograph_core::error::Result;
use noctograph_core::input_error;

/// Maximum coordinate of a point, in boxes or cap heights.
const MAX_COORDINATE: f64 = 100.0;

/// Maximum number of points of a letter. Composing could double it from line to line.
const MAX_POINTS: usize = 20_000;

/// Maximum number of points of a font.
const MAX_FONT_POINTS: usize = 1_000_000;

/// Height of a lowercase letter, for which marks are designed, relative to a capital.
const SMALL_LETTER: f64 = 14.0 / 21.0;

/// Combining marks, and the characters that store their shapes. Other marks are stored under their
/// own code.
const MARKS: &str = "\u{300}\u{301}\u{302}\u{303}\u{304}\u{306}\u{307}\u{308}\u{30a}\u{30b}\
    \u{30c}\u{327}\u{328}";
const SIGNS: &str = "`´ˆ˜¯˘˙¨˚˝ˇ¸˛";

/// The words of a line, separated by white space.
type Words<'a> = std::iter::Peekable<std::str::SplitAsciiWhitespace<'a>>;

/// Font whose letters are stored as strokes.
#[derive(Debug)]
pub(super) struct StrokeFont {
    fit: Fit,
    /// Number of the font's units in a capital's height.
    units: f64,
    letters: BTreeMap<char, Arc<Shape>>,
    /// Number of points of all parsed letters.
    n_points: usize,
    /// Lines of letters that are parsed when they are drawn.
    lines: BTreeMap<char, &'static str>,
}

impl Default for StrokeFont {
    fn default() -> Self {
        let (letters, lines) = (BTreeMap::new(), BTreeMap::new());
        Self { fit: Fit::Box, units: 1.0, letters, n_points: 0, lines }
    }
}

impl StrokeFont {
    /// Parses a font from its text. The error names the line that is malformed.
    pub(super) fn parse(text: &str, file: &str) -> Result<Self> {
        /// Maximum number of characters of a line that the error shows.
        const MAX_SHOWN: usize = 60;
        let mut font = Self::default();
        for (number, line) in lines(text) {
            // The line with the height of a capital precedes all letters.
            let read = match line.strip_prefix("cap ").filter(|_| font.letters.is_empty()) {
                Some(height) => font.parse_units(height),
                None => font.parse_letter(line),
            };
            read.ok_or_else(|| {
                let start: String = line.chars().take(MAX_SHOWN).collect();
                let error = input_error!(
                    "",
                    "`{start}`",
                    "a letter and its runs, such as `L + 0,1 0,0 1,0`, of at most {MAX_POINTS} \
                     points, {MAX_FONT_POINTS} in all",
                    "compare with fonts/ae483.strokes and fonts/simplex.strokes",
                );
                error.in_file(file, number)
            })?;
        }
        Ok(font)
    }

    /// Returns a font that the program contains. A word needs few of its letters, so a letter is
    /// parsed when it is drawn. A test parses all of them.
    pub(super) fn shipped(text: &'static str) -> Self {
        let mut font = Self::default();
        for (_, line) in lines(text) {
            if let Some(height) = line.strip_prefix("cap ") {
                font.parse_units(height);
            } else if let Some(name) = line.split_ascii_whitespace().next().and_then(parse_name) {
                font.lines.insert(name, line);
            }
        }
        font
    }

    /// Parses the height of a capital. Returns `None` if it is malformed or out of range.
    fn parse_units(&mut self, height: &str) -> Option<()> {
        self.fit = Fit::Proportional;
        self.units = height.parse().unwrap_or(f64::NAN);
        CAP_HEIGHTS.contains(&self.units).then_some(())
    }

    /// Parses the line of a letter and adds the letter. Returns `None` if the line is malformed,
    /// the letter already exists, or there are too many points.
    fn parse_letter(&mut self, line: &str) -> Option<()> {
        let character = parse_name(line.split_ascii_whitespace().next()?)?;
        let shape = self.parse_shape(line)?;
        self.n_points += shape.n_points();
        if shape.n_points() > MAX_POINTS || self.n_points > MAX_FONT_POINTS {
            return None;
        }
        self.letters.insert(character, Arc::new(shape)).is_none().then_some(())
    }

    /// Parses the shape in the line of a letter. Returns `None` if the line is malformed.
    fn parse_shape(&self, line: &str) -> Option<Shape> {
        let mut words = line.split_ascii_whitespace().peekable();
        words.next()?;
        match words.next_if_eq(&"=") {
            Some(_) => self.parse_composed(words),
            None => self.parse_runs(words),
        }
    }

    /// Returns a letter that has a line of its own.
    fn letter(&self, character: char) -> Option<Arc<Shape>> {
        let parse = |line: &&str| self.parse_shape(line).map(Arc::new);
        self.letters.get(&character).cloned().or_else(|| self.lines.get(&character).and_then(parse))
    }

    /// Parses a composed letter from the words after `=`: base, mark, and optionally `dx,dy`.
    /// Returns `None` if the words are malformed or have too many points.
    fn parse_composed(&self, mut words: Words<'_>) -> Option<Shape> {
        let base = self.letter(parse_name(words.next()?)?)?;
        let mark = self.letter(parse_name(words.next()?)?)?;
        let offset =
            words.next().map_or(Some(Point::ZERO), |word| parse_point(word, self.units))?;
        // The size is checked before the letter is composed, so that memory use is bounded.
        let is_small = base.n_points() + mark.n_points() <= MAX_POINTS;
        (is_small && words.next().is_none()).then(|| compose(&base, &mark, offset.to_vec2()))
    }

    /// Parses a letter's shape from words: the advance (omitted in box fonts), followed by the
    /// runs, each a `+` (lit) or `-` (dark) and its points. Returns `None` if the words are
    /// malformed.
    fn parse_runs(&self, mut words: Words<'_>) -> Option<Shape> {
        let units = self.units;
        let advance = match self.fit {
            Fit::Box => 1.0,
            Fit::Proportional => parse_number(words.next()?, units)?,
        };
        let mut runs: Vec<Run> = Vec::new();
        for word in words {
            match word {
                "+" | "-" => runs.push(Run { lit: word == "+", points: Vec::new() }),
                point => runs.last_mut()?.points.push(parse_point(point, units)?),
            }
        }
        if runs.iter().any(|run| run.points.len() < 2) {
            return None;
        }
        // In a proportional font, points are samples of curves. In a box font, they are corners.
        if self.fit == Fit::Proportional {
            runs.iter_mut().for_each(|run| run.points = with_arcs(&run.points));
        }
        Some(Shape { advance, runs, lost_length: 0.0 })
    }
}

impl Face for StrokeFont {
    fn characters(&self) -> Box<dyn Iterator<Item = char> + '_> {
        // Only one of the two maps has letters.
        Box::new(self.letters.keys().chain(self.lines.keys()).copied())
    }

    /// Returns a stored letter, or one composed of a letter and its marks.
    fn shape(&self, character: char) -> Option<Arc<Shape>> {
        let mut signs = MARKS.chars().zip(SIGNS.chars());
        let sign = signs.find(|(mark, _)| *mark == character).map_or(character, |(_, sign)| sign);
        self.letter(sign).or_else(|| {
            // Canonical decomposition (NFD): the base, followed by the marks from the inside out.
            let mut parts = std::iter::once(character).nfd();
            let base = parts.next().filter(|base| *base != character)?;
            // A mark above i or j replaces its dot.
            let base = match base {
                'i' => 'ı',
                'j' => 'ȷ',
                base => base,
            };
            let base = self.letter(base)?;
            parts.try_fold(base, |base, mark| self.with_mark(&base, mark))
        })
    }

    fn fit(&self) -> Fit {
        self.fit
    }

    fn with_mark(&self, base: &Shape, mark: char) -> Option<Arc<Shape>> {
        Some(Arc::new(compose(base, &*self.shape(mark)?, Vec2::ZERO)))
    }
}

/// Returns the shape of a base with a mark centered over it and moved by an offset. A mark designed
/// for small letters is raised by the extra height of the base.
fn compose(base: &Shape, mark: &Shape, offset: Vec2) -> Shape {
    let ([left, _, right, top], [mark_left, mark_bottom, mark_right, _]) =
        (base.ink_bounds(), mark.ink_bounds());
    let lift = if mark_bottom >= SMALL_LETTER { top - SMALL_LETTER } else { 0.0 };
    let across = 0.5 * (left + right) - 0.5 * (mark_left + mark_right);
    let mut runs = base.runs.clone();
    runs.extend(mark.runs.iter().map(|run| {
        let points = run.points.iter().map(|point| *point + Vec2::new(across, lift) + offset);
        Run { lit: run.lit, points: points.collect() }
    }));
    Shape { advance: base.advance, runs, lost_length: 0.0 }
}

/// Returns the lines of a font that are neither empty nor comments, with their numbers.
fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    let lines = (1..).zip(text.lines().map(str::trim_end));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Parses a character or its code point (`U+0023`). Returns `None` for any other word.
fn parse_name(word: &str) -> Option<char> {
    if let Some(code) = word.strip_prefix("U+").filter(|code| !code.is_empty()) {
        return u32::from_str_radix(code, 16).ok().and_then(char::from_u32);
    }
    let mut characters = word.chars();
    let (character, None) = (characters.next()?, characters.next()) else { return None };
    Some(character)
}

/// Parses a point `x,y`, and divides it by the font's units. Returns `None` if it is malformed or
/// too far away.
fn parse_point(word: &str, units: f64) -> Option<Point> {
    let (x, y) = word.split_once(',')?;
    Some(Point::new(parse_number(x, units)?, parse_number(y, units)?))
}

/// Parses a number and divides it by the font's units. Returns `None` if it is malformed or too
/// large.
fn parse_number(word: &str, units: f64) -> Option<f64> {
    let value = word.parse::<f64>().ok()? / units;
    (value.abs() <= MAX_COORDINATE).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::super::vector::coordinates;
    use super::*;

    #[test]
    fn a_broken_line_is_refused_with_its_number() {
        let broken = [
            "A 0,0 1,1",
            "A + 0,0",
            "AB + 0,0 1,1",
            "A + 0;0 1,1",
            "A + 0,x 1,1",
            "A + 0,nan 1,1",
            "A + 0,1e9 1,1",
            "A = B C",
            "U+D800 + 0,0 1,1",
            "A + 0,0 1,1\nA + 0,0 1,1",
            "A + 0,0 1,1\ncap 21",
        ];
        for broken in broken {
            let text = format!("# note\n{broken}\n");
            let error = StrokeFont::parse(&text, "my.strokes").expect_err(broken).to_string();
            let line = 2 + broken.matches('\n').count();
            assert!(error.contains(&format!("my.strokes:{line}: ")), "{broken:?}: {error}");
        }
        assert!(
            StrokeFont::parse("# note\n\nA + 0,0 1,1\n", "").is_ok(),
            "a good line is accepted"
        );
    }

    #[test]
    fn a_letter_that_the_font_lacks_is_composed_of_its_base_and_marks() {
        let text = include_str!("../../fonts/simplex.strokes");
        let font = StrokeFont::parse(text, "simplex.strokes").unwrap();
        let ink = |letter: char| font.shape(letter).unwrap().ink_bounds();
        let [both, dots, base] = ['ǚ', 'ü', 'u'].map(ink);
        assert!(
            both[3] > dots[3] && dots[3] > base[3] && both[1] == base[1],
            "dots and caron stand one on the other"
        );
        assert!(ink('ṣ')[1] < ink('s')[1] && ink('ṣ')[3] == ink('s')[3], "a dot below");
        assert_eq!(font.shape('字').map(|_| ()), None, "no letter of the font");
        let marked = font.with_mark(&font.shape('ọ').unwrap(), '\u{300}').unwrap();
        assert!(marked.ink_bounds()[3] > ink('o')[3] && marked.ink_bounds()[1] == ink('ọ')[1]);
    }

    #[test]
    fn letters_composed_of_letters_do_not_grow_without_end() {
        let mut text = "cap 21\nA 8 + 4,21 4,0\n".to_owned();
        for code in 0x4e00..0x4e40 {
            let before = if code == 0x4e00 { "A".into() } else { format!("U+{:X}", code - 1) };
            text += &format!("U+{code:X} = {before} {before}\n");
        }
        let error = StrokeFont::parse(&text, "my.strokes").unwrap_err().to_string();
        assert!(error.contains("my.strokes:16") && error.contains("20000 points"), "{error}");
    }

    #[test]
    fn a_mark_is_centered_over_its_base() {
        let text = "cap 21\nI 8 + 4,21 4,0\nı 8 + 4,14 4,0\n´ 10 + 4,16 7,20\n\
                    Í = I ´\ní = ı ´\nì = ı ´ -1,2\n";
        let font = StrokeFont::parse(text, "").unwrap();
        let mark = |c| {
            coordinates(font.shape(c).unwrap().runs[1].points[0]).map(|x| (x * 42.0).round() / 2.0)
        };
        assert_eq!(mark('í'), [2.5, 16.0], "its middle, 5.5, stands over the base's, 4");
        assert_eq!(mark('Í'), [2.5, 23.0], "7 higher over a capital");
        assert_eq!(mark('ì'), [1.5, 18.0], "moved");
        assert_eq!(font.shape('Í').unwrap().advance, 8.0 / 21.0, "as wide as its base");
    }
}
