//! Letters: a word becomes [`Strokes`] in the plane of the word.
//!
//! Product in: a word. Product out: placed glyphs, each a list of moves of the pen, lit or dark.
//! The plane of the word has x to the viewer's right and y up, in metres; y = 0 is the floor.
//!
//! Letters know no speed and no drone.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use stroke_font::StrokeFont;

mod stroke_font;

/// Fonts by name.
const FONTS: [(&str, &str); 1] = [("ae483", include_str!("../../fonts/ae483.strokes"))];

/// Longest word. At 14 s a letter this is an hour of flight; a Crazyflie's battery ends at 16.
const MAX_LETTERS: usize = 256;

/// The drawing of a word: glyphs from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Strokes {
    /// The word as it is drawn, after lower case was turned to upper case where the font has none.
    pub word: String,
    /// The stroke font it is drawn with.
    pub font: String,
    /// One per drawn character.
    pub glyphs: Vec<Glyph>,
}

/// One character, placed.
#[derive(Clone, Debug, PartialEq)]
pub struct Glyph {
    /// The character.
    pub character: char,
    /// Its box.
    pub cell: Cell,
    /// What the pen does, in order. Where a move does not begin at the end of the one before, the
    /// pen jumps.
    pub moves: Vec<Move>,
}

/// The box of a character in the plane of the word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Left edge.
    pub left_m: f64,
    /// Lower edge, on which capitals stand.
    pub baseline_m: f64,
    /// Width without the gap to the next letter.
    pub width_m: f64,
    /// Height of a capital.
    pub cap_height_m: f64,
}

/// One straight move of the pen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Where it begins: x, y in the plane of the word.
    pub from_m: [f64; 2],
    /// Where it ends.
    pub to_m: [f64; 2],
    /// Whether the lights are on.
    pub lit: bool,
}

/// How a word is laid out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LetterOptions {
    /// Name of the stroke font: `ae483` is the reference team's own 26 letters.
    pub font: String,
    /// Height of a capital.
    pub cap_height_m: f64,
    /// Width of a letter's box.
    pub width_m: f64,
    /// Gap between two boxes.
    pub gap_m: f64,
    /// Height of the baseline above the floor.
    pub baseline_m: f64,
}

impl Default for LetterOptions {
    /// The reference flight: boxes of 0.30 m by 0.50 m from 0.5 m above the floor, 0.1 m apart.
    fn default() -> Self {
        Self { font: "ae483".into(), cap_height_m: 0.5, width_m: 0.3, gap_m: 0.1, baseline_m: 0.5 }
    }
}

/// Draws one character of a font into a cell; `None` where the font lacks it.
///
/// Used by whoever needs a letter apart from its word, such as the reader's glyph bank.
///
/// # Errors
///
/// [`Error::Input`] for an unknown font.
pub fn glyph(character: char, cell: Cell, font: &str) -> Result<Option<Glyph>> {
    Ok(find_font(font)?.glyph(character, cell))
}

/// Lays out a word: boxes from left to right with equal gaps, the first one beginning at
/// x = −n·width/2 for n letters, as the reference team did (so a word hangs right of the middle by
/// half its gaps).
///
/// # Errors
///
/// [`Error::Input`] for an empty or overlong word, an unknown font, or a character that the font
/// lacks, with its position.
pub fn write(word: &str, options: &LetterOptions) -> Result<Strokes> {
    let font = find_font(&options.font)?;
    let characters: Vec<char> = word.chars().collect();
    if characters.is_empty() {
        let hint = "name the word to write, for example: noctograph preview NOOR";
        return Err(Error::input("word", "an empty word", "at least one letter", hint));
    }
    if characters.len() > MAX_LETTERS {
        return Err(Error::input(
            "word",
            format!("{} characters", characters.len()),
            format!("at most {MAX_LETTERS}"),
            "split the text into several words; one flight cannot write so many",
        ));
    }
    #[expect(clippy::cast_precision_loss, reason = "word lengths are below MAX_LETTERS")]
    let cell = |index: usize| Cell {
        left_m: -0.5 * options.width_m * characters.len() as f64
            + (options.width_m + options.gap_m) * index as f64,
        baseline_m: options.baseline_m,
        width_m: options.width_m,
        cap_height_m: options.cap_height_m,
    };
    let glyphs = characters.iter().enumerate().map(|(index, &typed)| {
        let upper = typed.to_ascii_uppercase();
        let drawn = font.glyph(typed, cell(index)).or_else(|| font.glyph(upper, cell(index)));
        drawn.ok_or_else(|| {
            Error::input(
                format!("word, position {}", index + 1),
                format!("{typed:?}"),
                format!("one of {}", String::from_iter(font.characters())),
                format!("write the word with letters that the font {} has", options.font),
            )
        })
    });
    let glyphs = glyphs.collect::<Result<Vec<_>>>()?;
    let word = glyphs.iter().map(|glyph| glyph.character).collect();
    Ok(Strokes { word, font: options.font.clone(), glyphs })
}

impl LetterOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        find_font(&self.font)?;
        within("letters.cap_height_m", self.cap_height_m, 0.01, 100.0)?;
        within("letters.width_m", self.width_m, 0.01, 100.0)?;
        within("letters.gap_m", self.gap_m, 0.0, 100.0)?;
        within("letters.baseline_m", self.baseline_m, 0.0, 1000.0)
    }
}

impl Strokes {
    /// The box that holds all cells: `[left, bottom, right, top]` in the plane of the word.
    ///
    /// # Panics
    ///
    /// If there is no glyph; [`write()`] always makes one.
    #[must_use]
    pub fn bounds_m(&self) -> [f64; 4] {
        let (first, last) = (self.glyphs.first(), self.glyphs.last());
        let (first, last) = (&first.expect("a word has letters").cell, &last.expect("same").cell);
        let top = self.glyphs.iter().map(|glyph| glyph.cell.baseline_m + glyph.cell.cap_height_m);
        let bottom = self.glyphs.iter().map(|glyph| glyph.cell.baseline_m);
        [
            first.left_m,
            bottom.fold(f64::INFINITY, f64::min),
            last.left_m + last.width_m,
            top.fold(f64::NEG_INFINITY, f64::max),
        ]
    }
}

fn find_font(name: &str) -> Result<StrokeFont> {
    let text = FONTS.iter().find(|(n, _)| *n == name).map(|(_, text)| *text).ok_or_else(|| {
        let names: Vec<&str> = FONTS.iter().map(|(name, _)| *name).collect();
        Error::input("letters.font", format!("{name:?}"), names.join(", "), "choose a font we have")
    })?;
    Ok(StrokeFont::parse(text).expect("the fonts under fonts/ are read by a test"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_font_under_fonts_is_readable() {
        for (name, _) in FONTS {
            find_font(name).unwrap();
        }
        let all: String = find_font("ae483").unwrap().characters().collect();
        assert_eq!(all, "ABCDEFGHIJKLMNOPQRSTUVWXYZ", "the team's letters");
    }

    #[test]
    fn boxes_stand_where_the_team_put_them() {
        let strokes = write("noor", &LetterOptions::default()).unwrap();
        assert_eq!(strokes.word, "NOOR", "lower case becomes upper case");
        let left: Vec<f64> = strokes.glyphs.iter().map(|glyph| glyph.cell.left_m).collect();
        for (left, wanted) in left.iter().zip([-0.6, -0.2, 0.2, 0.6]) {
            assert!((left - wanted).abs() < 1e-12, "{left} for {wanted}");
        }
        let n = &strokes.glyphs[0].moves;
        assert_eq!((n[0].from_m, n[0].to_m, n[0].lit), ([-0.6, 0.5], [-0.6, 1.0], true));
        assert!(!n[3].lit, "N comes back to the lower right corner in the dark");
        let [left, bottom, right, top] = strokes.bounds_m();
        assert!((left + 0.6).abs() + (right - 0.9).abs() < 1e-12 && (bottom, top) == (0.5, 1.0));
    }

    #[test]
    fn an_unknown_character_is_named_with_its_position() {
        let text = write("NOÖR", &LetterOptions::default()).unwrap_err().to_string();
        assert!(text.contains("position 3") && text.contains('Ö'), "{text}");
        assert!(write("", &LetterOptions::default()).is_err(), "an empty word");
        assert!(
            write(&"A".repeat(MAX_LETTERS + 1), &LetterOptions::default()).is_err(),
            "too long"
        );
    }

    #[test]
    fn i_jumps_as_the_team_let_it_jump() {
        let strokes = write("I", &LetterOptions::default()).unwrap();
        let moves = &strokes.glyphs[0].moves;
        assert_eq!(moves[0].from_m, moves[0].to_m, "the empty first move");
        assert_ne!(moves[0].to_m, moves[1].from_m, "the jump to the other corner");
    }
}
