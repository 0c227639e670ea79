//! Removes lines that are not visible separately: parts of lines under a stroke that covers them,
//! or along a line that is already drawn.
//!
//! Lines are compared from the front to the back, each with those near it in front. Thus the edge
//! between two colors becomes one line, as does a color's edge under its outline. A line that only
//! crosses a stroke stays whole.

use std::collections::{BTreeMap, HashMap};

use super::super::vector::{between, cross, dot, integers_below, is_closed, minus, segments};
use super::layers::Color;
use super::visibility::Part;
use noctograph_core::files::Budget;
use noctograph_core::geometry::{distance, polyline_length_m, segment_distance};

/// Maximum distance between two lines that count as one, relative to the drawing's larger side: 1
/// mm for a drawing of 1 m. A larger distance would merge lines that a photograph resolves.
const NEAR: f64 = 1e-3;

/// Number of cells of the finest index along the drawing's larger side.
const CELLS: f64 = 128.0;

/// Maximum length, in half widths of a stroke, of the part of a line that the stroke merely
/// crosses. At this length, the lines cross at 20°.
const CROSSING: f64 = 6.0;

/// Budget steps for visiting a cell, and for comparing with a piece in it.
const STEPS_PER_CELL: usize = 20;
const STEPS_PER_PIECE: usize = 8;

/// Slack for rounding at a piece's ends, as a fraction of its length.
const END_SLACK: f64 = 1e-6;

/// Number of bisection steps to locate the point where a line goes under another line.
const HALVINGS: usize = 5;

/// Sine of the largest angle at which two zero-width lines still count as one.
const SLANT: f64 = 0.3;

/// A piece of a line that is in front.
struct Piece {
    element: usize,
    /// Half the width of the piece's stroke, or 0 if the stroke is not opaque.
    reach: f64,
    ends: [[f64; 2]; 2],
}

/// The lines in front, indexed by cells. Wide strokes are stored in levels with larger cells.
pub(super) struct Front<'a> {
    budget: &'a Budget,
    near: f64,
    cell: f64,
    pieces: Vec<Piece>,
    cells: HashMap<(i32, i64, i64), Vec<usize>>,
    /// Maximum reach of the pieces in each level.
    levels: BTreeMap<i32, f64>,
}

/// A stretch of a line, and the reach of the piece that covers it, if any.
type Stretch = (Vec<[f64; 2]>, Option<f64>);

impl<'a> Front<'a> {
    /// Returns an empty index for a drawing with a given larger side, in user units.
    pub(super) fn new(size: f64, budget: &'a Budget) -> Self {
        let (near, cell) = (NEAR * size, size / CELLS);
        let (cells, levels) = (HashMap::new(), BTreeMap::new());
        Self { budget, near, cell, pieces: Vec::new(), cells, levels }
    }

    /// Adds an element's lines to those in front. Returns the parts that nothing in front covers,
    /// or `None` if nothing is covered. `reach` is half the width of the element's strokes, in user
    /// units.
    pub(super) fn uncovered(
        &mut self,
        lines: &[Vec<[f64; 2]>],
        color: Color,
        element: usize,
        reach: f64,
    ) -> Option<Vec<Part>> {
        let (mut parts, mut is_whole) = (Vec::new(), true);
        for line in lines {
            let stretches = self.stretches(line, element);
            let visible: Vec<Vec<[f64; 2]>> = match &stretches[..] {
                [(_, None)] => vec![line.clone()],
                _ => visible_parts(stretches, line, self.near),
            };
            is_whole &= visible.len() == 1 && visible[0] == *line;
            // Covered parts are not drawn, so they do not cover other lines either.
            visible.iter().for_each(|part| self.add(part, element, reach));
            parts.extend(visible.into_iter().map(|part| (part, color)));
        }
        (!is_whole).then_some(parts)
    }

    /// Returns the column and the row of the cell that contains a position in user units, on the
    /// grid of a level.
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    fn key(&self, level: i32, place: [f64; 2]) -> [i64; 2] {
        place.map(|x| (x / self.cell_of(level)).floor() as i64)
    }

    /// Returns the side of the cells of a level, in user units.
    fn cell_of(&self, level: i32) -> f64 {
        self.cell * libm::exp2(f64::from(level))
    }

    /// Adds a line to those in front, in pieces of at most half a cell. Its level is the one whose
    /// cells are at least twice as wide as its reach. Stops if the budget is spent.
    fn add(&mut self, line: &[[f64; 2]], element: usize, reach: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "at most the exponent of a float")]
        let level = libm::log2(2.0 * reach / self.cell).ceil().max(0.0) as i32;
        let farthest = self.levels.entry(level).or_insert(self.near);
        *farthest = farthest.max(reach);
        let longest = 0.5 * self.cell_of(level);
        // A piece is indexed by the cell of its middle.
        for segment in segments(line) {
            for ends in cut(segment, longest) {
                if self.budget.bytes(2 * size_of::<Piece>()).is_err() {
                    return;
                }
                let [x, y] = self.key(level, between(ends[0], ends[1], 0.5));
                self.cells.entry((level, x, y)).or_default().push(self.pieces.len());
                self.pieces.push(Piece { element, reach, ends });
            }
        }
    }

    /// Returns the maximum reach in user units of the pieces that cover a position of an element on
    /// a line with direction `along`, or `None` if nothing covers it.
    fn cover(&self, place: [f64; 2], along: [f64; 2], element: usize) -> Option<f64> {
        let mut most: Option<f64> = None;
        for (level, farthest) in &self.levels {
            // The middle of a piece is at most a quarter of a cell from the piece's ends.
            let range = 0.25 * self.cell_of(*level) + farthest;
            let [low, high] =
                [-range, range].map(|offset| self.key(*level, place.map(|x| x + offset)));
            let cells = (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| (x, y)));
            for (x, y) in cells {
                let pieces = self.cells.get(&(*level, x, y)).map_or(&[][..], Vec::as_slice);
                self.budget.spend_steps(STEPS_PER_CELL + STEPS_PER_PIECE * pieces.len());
                let reaches =
                    pieces.iter().filter_map(|piece| self.reach(*piece, place, along, element));
                most = reaches.fold(most, |most, reach| Some(most.unwrap_or(0.0).max(reach)));
            }
        }
        most
    }

    /// Returns the reach of a piece in user units if it covers a position of an element. Returns
    /// `None` if the position is beyond the piece's ends or reach, or if a piece without width only
    /// crosses. Within one element, no piece has width.
    fn reach(
        &self,
        piece: usize,
        place: [f64; 2],
        direction: [f64; 2],
        element: usize,
    ) -> Option<f64> {
        let Piece { element: other, reach, ends } = &self.pieces[piece];
        let reach = if *other == element { self.near } else { reach.max(self.near) };
        // The position is projected onto the piece.
        let along = minus(ends[1], ends[0]);
        let fraction = dot(minus(place, ends[0]), along) / dot(along, along);
        let is_beside = (-END_SLACK..=1.0 + END_SLACK).contains(&fraction);
        let [length, other_length] = [along, direction].map(|[x, y]| libm::hypot(x, y));
        let is_crossed =
            reach <= self.near && cross(along, direction).abs() > SLANT * length * other_length;
        (is_beside && !is_crossed && segment_distance(place, *ends) <= reach).then_some(reach)
    }

    /// Splits a line into stretches that are covered or not, each with the reach of what covers it.
    fn stretches(&self, line: &[[f64; 2]], element: usize) -> Vec<Stretch> {
        if self.pieces.is_empty() {
            return vec![(line.to_vec(), None)];
        }
        let mut stretches: Vec<Stretch> = Vec::new();
        for [from, to] in segments(line).flat_map(|ends| cut(ends, 0.5 * self.cell)) {
            // Each piece of half a cell is tested once. If the results of neighboring pieces
            // differ, the change is located by bisection.
            let along = minus(to, from);
            let here = self.cover(between(from, to, 0.5), along, element);
            match stretches.last_mut() {
                Some((points, cover)) if cover.is_some() == here.is_some() => {
                    points.push(to);
                    *cover = cover.zip(here).map(|(a, b)| a.max(b));
                }
                None => stretches.push((vec![from, to], here)),
                Some((points, _)) => {
                    let is_before =
                        |place| self.cover(place, along, element).is_some() == here.is_none();
                    // The result changes either before or after the point between the two pieces.
                    let ends = [between(points[points.len() - 2], from, 0.5), from];
                    let is_later = is_before(from);
                    let ends = if is_later { [from, between(from, to, 0.5)] } else { ends };
                    let change = change(ends, is_before);
                    let next = if is_later { vec![change, to] } else { vec![change, from, to] };
                    if !is_later {
                        points.pop();
                    }
                    points.push(change);
                    stretches.push((next, here));
                }
            }
        }
        stretches
    }
}

/// Returns the visible parts of a line, from its stretches. A stroke that merely crosses a line
/// hides nothing, and a short gap between two covered stretches is hidden. `near` is the reach of a
/// line without width.
fn visible_parts(stretches: Vec<Stretch>, line: &[[f64; 2]], near: f64) -> Vec<Vec<[f64; 2]>> {
    let is_closed = is_closed(line);
    // First, gaps between covered stretches that are shorter than the strokes around them are wide
    // become covered.
    let mut stretches = joined(stretches, is_closed);
    let covers: Vec<Option<f64>> = stretches.iter().map(|stretch| stretch.1).collect();
    for (index, (points, cover)) in stretches.iter_mut().enumerate() {
        let around = neighbors(index, covers.len(), is_closed).map(|neighbor| covers[neighbor?]);
        if let (None, [Some(before), Some(after)]) = (*cover, around) {
            let widest = before.max(after).max(2.0 * near);
            *cover = (polyline_length_m(points) < 2.0 * widest).then_some(widest);
        }
    }
    // Then covered stretches that are short enough for a mere crossing become visible.
    let mut stretches = joined(stretches, is_closed);
    let n = stretches.len();
    for (index, (points, cover)) in stretches.iter_mut().enumerate() {
        let is_single = neighbors(index, n, is_closed) == [None; 2];
        *cover = cover.filter(|reach| is_single || polyline_length_m(points) > CROSSING * *reach);
    }
    if stretches.iter().all(|stretch| stretch.1.is_none()) {
        vec![line.to_vec()]
    } else {
        uncovered_lines(stretches, is_closed)
    }
}

/// Returns the indices of the stretches before and after one of n, cyclically in a closed line. An
/// index is `None` where there is none.
fn neighbors(index: usize, n: usize, is_closed: bool) -> [Option<usize>; 2] {
    if is_closed && n > 1 {
        [Some((index + n - 1) % n), Some((index + 1) % n)]
    } else {
        [index.checked_sub(1), Some(index + 1).filter(|next| *next < n)]
    }
}

/// Returns the uncovered stretches, with neighbors joined. In a closed line they are also joined
/// across its start.
fn uncovered_lines(stretches: Vec<Stretch>, is_closed: bool) -> Vec<Vec<[f64; 2]>> {
    let n = stretches.len();
    let goes_around = is_closed && stretches[0].1.is_none() && stretches[n - 1].1.is_none();
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut is_open = false;
    for (points, cover) in stretches {
        match lines.last_mut().filter(|_| is_open && cover.is_none()) {
            Some(before) => before.extend(&points[1..]),
            None if cover.is_none() => lines.push(points),
            None => {}
        }
        is_open = cover.is_none();
    }
    if lines.len() > 1 && goes_around {
        let first = lines.remove(0);
        lines.last_mut().expect("one is left").extend(&first[1..]);
    }
    lines
}

/// Joins neighboring stretches in the same state, across the start of a closed line as well.
fn joined(stretches: Vec<Stretch>, is_closed: bool) -> Vec<Stretch> {
    let widest = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a.max(b));
    let mut kept: Vec<Stretch> = Vec::new();
    for (points, cover) in stretches {
        match kept.last_mut().filter(|last| last.1.is_some() == cover.is_some()) {
            Some((before, last)) => {
                before.extend(&points[1..]);
                *last = widest(*last, cover);
            }
            None => kept.push((points, cover)),
        }
    }
    // The last stretch of a closed line continues in the first one.
    if is_closed
        && kept.len() > 1
        && kept[0].1.is_some() == kept[kept.len() - 1].1.is_some()
        && let Some((mut points, cover)) = kept.pop()
    {
        points.extend(&kept[0].0[1..]);
        kept[0] = (points, widest(cover, kept[0].1));
    }
    kept
}

/// Bisects the way between two positions, and returns the place at which a test changes. The test
/// holds at the first position and fails at the second.
fn change([mut same, mut other]: [[f64; 2]; 2], test: impl Fn([f64; 2]) -> bool) -> [f64; 2] {
    for _ in 0..HALVINGS {
        let middle = between(same, other, 0.5);
        *(if test(middle) { &mut same } else { &mut other }) = middle;
    }
    between(same, other, 0.5)
}

/// Splits a segment evenly into pieces of at most `longest`, up to 10⁵ pieces. Each piece is
/// given by its start and its end.
fn cut([from, to]: [[f64; 2]; 2], longest: f64) -> impl Iterator<Item = [[f64; 2]; 2]> {
    let n = (distance(from, to) / longest).ceil().clamp(1.0, 1e5);
    integers_below(n).map(move |k| [between(from, to, k / n), between(from, to, (k + 1.0) / n)])
}
