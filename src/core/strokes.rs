//! Strokes, the product of the letters stage, which consist of glyphs placed in the word's plane.
//!
//! The plane of the word has x to the viewer's right and y up, in meters, with the floor at y = 0.

use std::collections::BTreeMap;

use crate::diagnostic::Diagnostic;
use crate::digest::Digest;
use crate::error::{Error, Result};
use crate::geometry::{bounds, distance};
use crate::product::{Rules, Valid, is_number, odd_number};

/// Strokes of a word, glyph by glyph and line by line, or of a drawing with a glyph per color.
pub type Strokes = Valid<StrokesData>;

/// Data of [`Strokes`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StrokesData {
    /// The word with spaces and line ends, as the font draws it. The text is empty for a drawing.
    pub word: String,
    /// Name of the font, or `None` for a drawing.
    pub font: Option<String>,
    /// Characters whose center lines lack a stroke of the typeface, with its length in cap heights.
    pub lost: BTreeMap<char, f64>,
    /// Glyphs, one for each drawn character. Spaces and line ends have no glyph.
    pub glyphs: Vec<Glyph>,
    /// Freedom to reorder the strokes.
    pub order: StrokeOrder,
    /// Red, green and blue of each glyph of a drawing in colors, or empty otherwise.
    pub colors: Vec<[u8; 3]>,
    /// Strokes of a drawing that are left out because of its detail (`letters.detail`).
    pub left_out: LeftOut,
    /// Numbers of a drawing's strokes (`letters.ink`, `letters.without`), each with a point on it.
    pub numbers: Vec<(usize, [f64; 2])>,
    /// Drawing as the file contains it.
    pub source: Source,
    /// Warnings about unsupported or misleading parts of a drawing's file.
    pub warnings: Vec<Diagnostic>,
}

/// Drawing as its file contains it, or empty for a word.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// Corners of the paper that is cut out of a picture, in pixels as in `letters.corners_px`.
    pub corners_px: Option<[[f64; 2]; 4]>,
    /// True for a bitmap, whose strokes are in pixels.
    pub is_bitmap: bool,
    /// All strokes in the order of their numbers, including omitted strokes.
    pub strokes: Vec<SourceStroke>,
}

/// Stroke of a drawing as its file contains it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceStroke {
    /// Points in pixels of the picture, or in the units of another drawing, with y down.
    pub points: Vec<[f64; 2]>,
    /// Name of the color that selects the stroke, or `None` if the file gives none.
    pub color: Option<&'static str>,
}

/// Strokes of a drawing that are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LeftOut {
    /// Number of strokes that are left out.
    pub strokes: usize,
    /// Fraction of the total length of all strokes that is left out, 0 to 1.
    pub length_fraction: f64,
}

/// Freedom to reorder strokes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StrokeOrder {
    /// The strokes may be drawn in any order, and backward.
    #[default]
    Free,
    /// The strokes are drawn in the writer's order and direction.
    Kept,
}

/// Character placed in the plane of the word.
#[derive(Clone, Debug, PartialEq)]
pub struct Glyph {
    /// Character that the glyph shows.
    pub character: char,
    /// Box of the character.
    pub cell: Cell,
    /// Moves of the pen, in order. The pen jumps between two moves that do not meet. A dark move of
    /// zero length at the beginning means that the pen arrives in the dark.
    pub moves: Vec<Move>,
}

/// Box of a character in the plane of the word. Tails and accents may extend beyond the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Left edge in m.
    pub left_m: f64,
    /// Height in m of the lower edge, on which capitals stand.
    pub baseline_m: f64,
    /// Width in m, without the gap to the next letter.
    pub width_m: f64,
    /// Height of a capital in m.
    pub cap_height_m: f64,
}

/// Straight move of the pen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Beginning of the move, as x, y in the plane of the word in m.
    pub from_m: [f64; 2],
    /// End of the move, as x, y in the plane of the word in m.
    pub to_m: [f64; 2],
    /// True if the lights are on.
    pub lit: bool,
    /// Speed relative to the usual stroke speed. The value is 1 except for handwriting at its
    /// writer's pace (`letters.pace`).
    pub pace: f64,
}

impl Rules for StrokesData {
    /// Checks that all glyphs or none have a color, numbers are finite, and paces are positive.
    fn check(&self) -> Result<()> {
        let (n, colors) = (self.glyphs.len(), self.colors.len());
        if colors != 0 && colors != n {
            let (actual, wanted) = (format!("{colors} colors"), format!("{n}, one per glyph"));
            return Err(Error::input("colors", actual, wanted, "give one color per glyph"));
        }
        // The cell and the moves of each glyph are checked together.
        for (row, Glyph { cell, moves, .. }) in self.glyphs.iter().enumerate() {
            let Cell { left_m, baseline_m, width_m, cap_height_m } = *cell;
            let sizes_m = [left_m, baseline_m, width_m, cap_height_m];
            let numbers = moves.iter().flat_map(|step| {
                let [from_m, to_m] = [step.from_m, step.to_m];
                [from_m[0], from_m[1], to_m[0], to_m[1], step.pace]
            });
            if let Some(value) = sizes_m.into_iter().chain(numbers).find(|value| !is_number(*value))
            {
                return Err(odd_number("glyphs", row, value));
            }
            if let Some(Move { pace, .. }) = moves.iter().find(|step| step.pace <= 0.0) {
                let actual = format!("a pace of {pace} in row {row}");
                return Err(Error::input(
                    "glyphs",
                    actual,
                    "paces above 0",
                    "1 is the normal pace",
                ));
            }
        }
        Ok(())
    }
}

impl StrokesData {
    /// Returns the SHA-256 of the word and all moves, in hexadecimal.
    pub fn sha256(&self) -> String {
        let mut digest = Digest::default();
        digest.add(&self.word);
        for step in self.glyphs.iter().flat_map(|glyph| &glyph.moves) {
            // A dark move has the pace 0, which no lit move has.
            let Move { from_m, to_m, lit, pace } = step;
            let lit_pace = f64::from(u8::from(*lit)) * pace;
            digest.add_numbers(&[from_m[0], from_m[1], to_m[0], to_m[1], lit_pace]);
        }
        digest.hex()
    }

    /// Returns the number of strokes. A stroke is a sequence of lit moves, each of which begins at
    /// the end of the previous one.
    pub fn n_strokes(&self) -> usize {
        let n_runs = self.glyphs.iter().map(|glyph| {
            let runs = glyph.moves.chunk_by(|a, b| a.lit == b.lit && a.to_m == b.from_m);
            runs.filter(|run| run[0].lit).count()
        });
        n_runs.sum()
    }

    /// Returns the total length of the lit moves in m.
    pub fn length_m(&self) -> f64 {
        let lit = self.glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
        lit.map(|step| distance(step.from_m, step.to_m)).sum()
    }

    /// Returns the box `[left, bottom, right, top]` in m around all cells and lit moves.
    pub fn bounds_m(&self) -> [f64; 4] {
        let corners = self.glyphs.iter().flat_map(|glyph| {
            let Cell { left_m, baseline_m, width_m, cap_height_m } = glyph.cell;
            let cell = [[left_m, baseline_m], [left_m + width_m, baseline_m + cap_height_m]];
            let lit = glyph.moves.iter().filter(|step| step.lit);
            cell.into_iter().chain(lit.flat_map(|step| [step.from_m, step.to_m]))
        });
        bounds(corners)
    }

    /// Returns the ranges of [`Self::glyphs`] that form the lines of text, from the top. A line's
    /// glyphs have the same baseline.
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
