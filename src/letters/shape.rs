//! The shape of a character: its strokes before they have a position or a size.

use std::ops::RangeInclusive;

use kurbo::Point;

use super::vector::coordinates;
use super::{Cell, Glyph, Move};
use noctograph_core::geometry::bounds;

/// Minimum width of the cell of a proportional character, in cap heights. A single stroke, such as
/// I, gets room on both sides, so that readers have an area to look at.
const NARROWEST: f64 = 0.3;

/// Plausible heights of a capital, in the units of a font.
pub(super) const CAP_HEIGHTS: RangeInclusive<f64> = 1e-3..=1e6;

/// How characters are placed in their cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    /// Characters fill their cell: x is in cell widths, and y in cap heights.
    Box,
    /// Characters keep their proportions, centered in their cell: x and y are in cap heights.
    Proportional,
}

/// A run of the pen: a polyline, lit or dark.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) lit: bool,
    /// At least two points, with y up from the baseline.
    pub(super) points: Vec<Point>,
}

/// A character as its font stores it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Shape {
    /// Distance between the pen's positions before and after the character.
    pub(super) advance: f64,
    /// Runs of the pen. A space has no runs.
    pub(super) runs: Vec<Run>,
    /// Length in cap heights of a stroke of the face that the center lines lost, or 0.
    pub(super) lost_length: f64,
}

impl Shape {
    /// Returns the bounds of the points, or of a space's advance: left, bottom, right and top.
    pub(super) fn ink_bounds(&self) -> [f64; 4] {
        let ink = bounds(self.runs.iter().flat_map(|run| &run.points).copied().map(coordinates));
        if ink[0] <= ink[2] { ink } else { [0.0, 0.0, self.advance, 0.0] }
    }

    /// Returns the number of points of all runs.
    pub(super) fn n_points(&self) -> usize {
        self.runs.iter().map(|run| run.points.len()).sum()
    }

    /// Returns the left edge and the width of a proportional character's cell, in cap heights.
    pub(super) fn cell(&self) -> (f64, f64) {
        let [left, _, right, _] = self.ink_bounds();
        let width = (right - left).max(NARROWEST);
        (0.5 * (left + right - width), width)
    }

    /// Returns the glyph of the character in a cell. In a box font the shape is stretched to the
    /// cell, and otherwise it is centered there and scaled by the cap height.
    pub(super) fn glyph(&self, character: char, cell: Cell, fit: Fit) -> Glyph {
        let Cell { left_m, baseline_m, width_m, cap_height_m } = cell;
        let y_m = |p: Point| baseline_m + p.y * cap_height_m;
        let moves = match fit {
            // A box font also contains dark moves.
            Fit::Box => {
                let place = |p: Point| Point::new(left_m + p.x * width_m, y_m(p));
                self.runs.iter().flat_map(|run| moves(run, place)).collect()
            }
            Fit::Proportional => {
                let [left, _, right, _] = self.ink_bounds();
                let (middle, middle_m) = (0.5 * (left + right), left_m + 0.5 * width_m);
                let x_m = |p: Point| middle_m + (p.x - middle) * cap_height_m;
                pen_moves(&self.runs, |p| Point::new(x_m(p), y_m(p)))
            }
        };
        Glyph { character, cell, moves }
    }
}

/// Returns the moves along lit runs, with dark moves to the first run and between runs. `place`
/// maps a point of a run to the plane of the word.
pub(super) fn pen_moves(runs: &[Run], place: impl Fn(Point) -> Point) -> Vec<Move> {
    let mut all_moves: Vec<Move> = Vec::new();
    for run in runs {
        let to_m = coordinates(place(run.points[0]));
        let from_m = all_moves.last().map_or(to_m, |last| last.to_m);
        if all_moves.is_empty() || from_m != to_m {
            all_moves.push(Move { from_m, to_m, lit: false, pace: 1.0 });
        }
        all_moves.extend(moves(run, &place));
    }
    all_moves
}

/// Returns the moves in m along one run, which are lit or dark like the run. `place` maps a point
/// of the run to the plane of the word.
fn moves(run: &Run, place: impl Fn(Point) -> Point) -> impl Iterator<Item = Move> {
    run.points.windows(2).map(move |pair| {
        let [from_m, to_m] = [pair[0], pair[1]].map(|point| coordinates(place(point)));
        Move { from_m, to_m, lit: run.lit, pace: 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(points: &[(f64, f64)]) -> Run {
        Run { lit: true, points: points.iter().map(|p| Point::from(*p)).collect() }
    }

    #[test]
    fn a_box_letter_fills_its_cell() {
        let dark = Run { lit: false, ..run(&[(0.0, 1.0), (0.0, 1.0)]) };
        let lit = run(&[(0.0, 1.0), (0.0, 0.0), (1.0, 0.0)]);
        let shape = Shape { advance: 1.0, runs: vec![dark, lit], lost_length: 0.0 };
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
            lost_length: 0.0,
            advance: 0.4,
            runs: vec![run(&[(0.2, 1.0), (0.2, 0.0)]), run(&[(0.2, 0.5), (0.2, 0.6)])],
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
