//! Shape: the strokes of a character before it has a place or a size.

use super::vector::legs;
use super::{Cell, Glyph, Move};
use noctograph_core::geometry::bounds;

/// Narrowest cell of a character that keeps its proportions, in cap heights: a single stroke, such
/// as I, gets room on both sides, so that a reader has an area to look at.
const NARROWEST: f64 = 0.3;

/// How characters are placed in their cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// They fill it: x in cell widths, y in cap heights.
    Box,
    /// They keep their proportions and stand in its middle: x and y in cap heights.
    Proportional,
}

/// A run of the pen.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) lit: bool,
    /// At least two; y up from the baseline.
    pub(super) points: Vec<[f64; 2]>,
}

/// A character as its font has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Shape {
    /// Distance from the pen's place before it to the pen's place after it.
    pub(super) advance: f64,
    /// None for a space.
    pub(super) runs: Vec<Run>,
    /// Length of a stroke of the face that the center lines lost, in cap heights; 0: none.
    pub(super) lost: f64,
}

impl Shape {
    /// The box of its points: left, bottom, right, top; the advance where there are none.
    pub(super) fn ink(&self) -> [f64; 4] {
        let ink = bounds(self.runs.iter().flat_map(|run| &run.points).copied());
        if ink[0] <= ink[2] { ink } else { [0.0, 0.0, self.advance, 0.0] }
    }

    pub(super) fn n_points(&self) -> usize {
        self.runs.iter().map(|run| run.points.len()).sum()
    }

    /// Left edge and width of a proportional character's cell, in cap heights.
    pub(super) fn cell(&self) -> (f64, f64) {
        let [left, _, right, _] = self.ink();
        let width = (right - left).max(NARROWEST);
        (0.5 * (left + right - width), width)
    }

    /// Draws it into a cell.
    pub(super) fn glyph(&self, character: char, cell: Cell, fit: Fit) -> Glyph {
        let moves = match fit {
            Fit::Box => Vec::from_iter(self.runs.iter().flat_map(|run| {
                moves(run, |[x, y]| {
                    [cell.left_m + x * cell.width_m, cell.baseline_m + y * cell.cap_height_m]
                })
            })),
            Fit::Proportional => {
                let [left, _, right, _] = self.ink();
                let (middle, size_m) = (0.5 * (left + right), cell.cap_height_m);
                let middle_m = cell.left_m + 0.5 * cell.width_m;
                pen_moves(&self.runs, |[x, y]| {
                    [middle_m + (x - middle) * size_m, cell.baseline_m + y * size_m]
                })
            }
        };
        Glyph { character, cell, moves }
    }
}

/// The moves of lit runs: the pen goes to the first, and from each to the next, in the dark.
pub(super) fn pen_moves(runs: &[Run], place: impl Fn([f64; 2]) -> [f64; 2]) -> Vec<Move> {
    let mut all: Vec<Move> = Vec::new();
    for run in runs {
        let to_m = place(run.points[0]);
        let from_m = all.last().map_or(to_m, |last| last.to_m);
        if all.is_empty() || from_m != to_m {
            all.push(Move { from_m, to_m, lit: false, pace: 1.0 });
        }
        all.extend(moves(run, &place));
    }
    all
}

fn moves(run: &Run, place: impl Fn([f64; 2]) -> [f64; 2]) -> impl Iterator<Item = Move> {
    let lit = run.lit;
    legs(&run.points).map(move |leg| {
        let [from_m, to_m] = leg.map(&place);
        Move { from_m, to_m, lit, pace: 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(points: &[[f64; 2]]) -> Run {
        Run { lit: true, points: points.to_vec() }
    }

    #[test]
    fn a_box_letter_fills_its_cell() {
        let dark = Run { lit: false, points: vec![[0.0, 1.0], [0.0, 1.0]] };
        let lit = run(&[[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
        let shape = Shape { advance: 1.0, runs: vec![dark, lit], lost: 0.0 };
        let cell = Cell { left_m: 2.0, baseline_m: 0.5, width_m: 0.3, cap_height_m: 0.4 };
        let glyph = shape.glyph('L', cell, Fit::Box);
        assert_eq!(glyph.moves.len(), 3, "one dark and two lit moves");
        assert_eq!(glyph.moves[1].from_m, [2.0, 0.9], "upper left corner");
        assert_eq!(glyph.moves[2].to_m, [2.3, 0.5], "lower right corner");
        assert!(!glyph.moves[0].lit && glyph.moves[2].lit, "the signs are kept");
    }

    #[test]
    fn a_proportional_letter_stands_in_the_middle_and_is_reached_in_the_dark() {
        let shape = Shape {
            lost: 0.0,
            advance: 0.4,
            runs: vec![run(&[[0.2, 1.0], [0.2, 0.0]]), run(&[[0.2, 0.5], [0.2, 0.6]])],
        };
        assert_eq!(shape.cell(), (0.5 * (0.4 - NARROWEST), NARROWEST), "room on both sides");
        let cell = Cell { left_m: 1.0, baseline_m: 0.0, width_m: 0.6, cap_height_m: 2.0 };
        let moves = shape.glyph('I', cell, Fit::Proportional).moves;
        let want = [([1.3, 2.0], [1.3, 2.0], false), ([1.3, 2.0], [1.3, 0.0], true)];
        assert_eq!(moves[..2].iter().map(|m| (m.from_m, m.to_m, m.lit)).collect::<Vec<_>>(), want);
        assert_eq!((moves[2].lit, moves[2].to_m), (false, [1.3, 1.0]), "to the next in the dark");
        assert_eq!(moves.len(), 4);
    }
}
