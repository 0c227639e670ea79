//! Strokes: the product of letters, placed glyphs in the plane of the word.
//!
//! The plane of the word has x to the viewer's right and y up, in meters. y = 0 is the floor.

use std::collections::BTreeMap;

use crate::diagnostic::Diagnostic;
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::geometry::{bounds, distance};
use crate::product::{Rules, Valid, is_number, odd_number};

/// Strokes of a word, glyph by glyph and line by line, or of a drawing: one glyph for each color.
pub type Strokes = Valid<StrokesData>;

/// The data of [`Strokes`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StrokesData {
    /// The word with spaces and line ends, as the font draws it. Empty for a drawing.
    pub word: String,
    /// Name of its font, or `None` for a drawing.
    pub font: Option<String>,
    /// Characters whose center lines lack a stroke of the typeface, and its length in cap heights.
    pub lost: BTreeMap<char, f64>,
    /// One per drawn character. Spaces and line ends have none.
    pub glyphs: Vec<Glyph>,
    /// Tells if the strokes may be reordered.
    pub order: StrokeOrder,
    /// Red, green and blue of each glyph of a drawing in its colors, or empty for any other.
    pub colors: Vec<[u8; 3]>,
    /// Strokes that the detail of a drawing leaves out (`letters.detail`).
    pub left_out: LeftOut,
    /// The number of each stroke of a drawing (`letters.ink`, `letters.without`), with one of its
    /// points.
    pub numbers: Vec<(usize, [f64; 2])>,
    /// The drawing in the file.
    pub source: Source,
    /// Unsupported or misleading parts of a drawing's file.
    pub warnings: Vec<Diagnostic>,
}

/// The drawing in the file, or empty for a word.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// Corners of the sheet of paper that is cut out of a picture, as in `letters.corners_px`.
    pub corners_px: Option<[[f64; 2]; 4]>,
    /// True for a bitmap, whose strokes are in pixels.
    pub is_bitmap: bool,
    /// All strokes in the order of their numbers, including omitted strokes.
    pub strokes: Vec<SourceStroke>,
}

/// A stroke in its file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceStroke {
    /// In pixels of the picture, or units of another drawing, y down.
    pub points: Vec<[f64; 2]>,
    /// The color whose name selects the stroke, or none if the file gives none.
    pub color: Option<&'static str>,
}

/// Strokes of a drawing that are not drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeftOut {
    /// Their number.
    pub strokes: usize,
    /// Their fraction of the length of all strokes, 0 to 1.
    pub length_fraction: f64,
}

/// Freedom to reorder strokes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StrokeOrder {
    /// They may be drawn in any order, and backward.
    #[default]
    Free,
    /// They are drawn in the writer's order and direction.
    Kept,
}

/// One character, placed.
#[derive(Clone, Debug, PartialEq)]
pub struct Glyph {
    /// The character.
    pub character: char,
    /// Its box.
    pub cell: Cell,
    /// Moves of the pen, in order. Where a move does not begin at the end of the one before, the
    /// pen jumps. A dark move of zero length at the beginning: the pen arrives in the dark.
    pub moves: Vec<Move>,
}

/// The box of a character in the plane of the word. Tails and accents may lie outside it.
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
    /// True if the lights are on.
    pub lit: bool,
    /// Speed relative to the stroke speed. 1 except for handwriting in its writer's pace
    /// (`letters.pace`).
    pub pace: f64,
}

impl Rules for StrokesData {
    /// Checks that there is a color for each glyph or none, that all numbers are finite, and that
    /// the pen moves.
    fn check(&self) -> Result<()> {
        let (n, colors) = (self.glyphs.len(), self.colors.len());
        if colors != 0 && colors != n {
            let (actual, wanted) = (format!("{colors} colors"), format!("{n}, one for each glyph"));
            return Err(Error::input("colors", actual, wanted, "give each glyph its color"));
        }
        // All numbers of each glyph.
        for (row, Glyph { cell, moves, .. }) in self.glyphs.iter().enumerate() {
            let Cell { left_m, baseline_m, width_m, cap_height_m } = *cell;
            let cell = [left_m, baseline_m, width_m, cap_height_m];
            let numbers = moves.iter().flat_map(|step| {
                let [from_m, to_m] = [step.from_m, step.to_m];
                [from_m[0], from_m[1], to_m[0], to_m[1], step.pace]
            });
            if let Some(value) = cell.into_iter().chain(numbers).find(|value| !is_number(*value)) {
                return Err(odd_number("glyphs", row, value));
            }
            if let Some(Move { pace, .. }) = moves.iter().find(|step| step.pace <= 0.0) {
                let actual = format!("a pace of {pace} in row {row}");
                return Err(Error::input("glyphs", actual, "paces above 0", "1 is the usual pace"));
            }
        }
        Ok(())
    }
}

impl StrokesData {
    /// SHA-256 of the word and all moves, in hexadecimal.
    pub fn sha256(&self) -> String {
        let mut digest = Digest::default();
        digest.add(&self.word);
        for step in self.glyphs.iter().flat_map(|glyph| &glyph.moves) {
            let Move { from_m, to_m, lit, pace } = step;
            let lit = f64::from(u8::from(*lit)) * pace;
            digest.add_numbers(&[from_m[0], from_m[1], to_m[0], to_m[1], lit]);
        }
        digest.hex()
    }

    /// Number of strokes. A stroke is a run of lit moves, each of which begins at the end of the
    /// move before.
    pub fn n_strokes(&self) -> usize {
        let n_runs = self.glyphs.iter().map(|glyph| {
            let runs = glyph.moves.chunk_by(|a, b| a.lit == b.lit && a.to_m == b.from_m);
            runs.filter(|run| run[0].lit).count()
        });
        n_runs.sum()
    }

    /// Total length of the lit moves.
    pub fn length_m(&self) -> f64 {
        let lit = self.glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
        lit.map(|step| distance(step.from_m, step.to_m)).sum()
    }

    /// The box `[left, bottom, right, top]` around all cells and lit moves.
    pub fn bounds_m(&self) -> [f64; 4] {
        let corners = self.glyphs.iter().flat_map(|glyph| {
            let Cell { left_m, baseline_m, width_m, cap_height_m } = glyph.cell;
            let cell = [[left_m, baseline_m], [left_m + width_m, baseline_m + cap_height_m]];
            let lit = glyph.moves.iter().filter(|step| step.lit);
            cell.into_iter().chain(lit.flat_map(|step| [step.from_m, step.to_m]))
        });
        bounds(corners)
    }

    /// Ranges of [`Self::glyphs`] that form the lines of text, from the top.
    pub fn lines(&self) -> Vec<std::ops::Range<usize>> {
        let mut begin = 0;
        let lines =
            self.glyphs.chunk_by(|a, b| a.cell.baseline_m == b.cell.baseline_m).map(|line| {
                begin += line.len();
                begin - line.len()..begin
            });
        lines.collect()
    }
}
