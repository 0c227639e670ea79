//! Letters: a word becomes [`Strokes`] in the plane of the word.
//!
//! Product in: a word. Product out: placed glyphs, each a list of moves of the pen, lit or dark.
//! The plane of the word has x to the viewer's right and y up, in metres; y = 0 is the floor.
//!
//! Letters know no speed and no drone.

use serde::{Deserialize, Serialize};

use crate::error::Result;

/// The drawing of a word: glyphs from left to right.
#[derive(Clone, Debug, PartialEq)]
pub struct Strokes {
    /// The word as it is drawn, after lower case was turned to upper case where the font has none.
    pub word: String,
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
/// [`crate::error::Error::Input`] for an unknown font.
pub fn glyph(_character: char, _cell: Cell, _font: &str) -> Result<Option<Glyph>> {
    unimplemented!("main session writes this")
}

/// Lays out a word.
///
/// # Errors
///
/// [`crate::error::Error::Input`] for an empty word, an unknown font, or a character that the
/// font lacks, with its position.
pub fn write(_word: &str, _options: &LetterOptions) -> Result<Strokes> {
    unimplemented!("main session writes this")
}
