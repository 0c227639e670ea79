//! Center lines: the strokes with which a pen would draw the ink inside an outline.
//!
//! The medial axis of the ink is computed ([`axis`]), and its spurs into corners are removed
//! ([`prune`]). At junctions the center lines are extended straight until they meet, and two nearly
//! collinear lines become one stroke ([`junctions`]). Between corners, lines are smoothed within a
//! given error. A blob without a line, such as a full stop, becomes a dot.

use super::outline::{Contour, Filled, ink_edges, mean_stroke_width};
use super::smooth::{MAX_POINTS, simplified, smooth};
use super::vector::segments;
use axis::Axis;
use branches::Knot;
use noctograph_core::files::Budget;
use noctograph_core::geometry::{distance, polyline_length_m, segment_distance};
use noctograph_core::statistics::median;

mod axis;
mod branches;
mod junctions;
mod prune;

/// Maximum distance by which smoothing moves a line, in cap heights: 2 mm for letters of 0.5 m.
const SMOOTHING_ERROR: f64 = 0.004;

/// Maximum distance between the final polyline and the smoothed line, in cap heights.
const FLATNESS: f64 = 0.0015;

/// Spacing of points for smoothing, in cap heights.
const SPACING: f64 = 0.008;

/// Spacing of the outline's samples in mean stroke widths, and limits in cap heights.
const SAMPLE_SPACING: f64 = 0.15;
const SAMPLING: [f64; 2] = [1e-3, 0.01];

/// Maximum length, relative to its radius, of a part of the axis that becomes a dot.
const BLOB: f64 = 0.8;

/// Minimum radius of a dot, relative to the median half width of the strokes.
const LEAST_DOT: f64 = 0.1;

/// Minimum length of a part of the axis without a line, in half widths, that counts as a lost
/// stroke. In the corner of a stroke's end the length is 0.9, and in a serif less than 2.
const LOST: f64 = 3.0;

/// Length in cap heights of the line that represents a dot, as in the stroke fonts.
const DOT: f64 = 0.01 / 21.0;

/// Center lines, and measures of the strokes.
#[derive(Debug, Default)]
pub(super) struct CenterLines {
    pub(super) lines: Vec<Vec<[f64; 2]>>,
    pub(super) half_width: f64,
    /// Half width of the thickest ink.
    pub(super) thickest: f64,
    /// Length in cap heights of the longest part of the axis that no line touches, that is, of a
    /// lost stroke.
    pub(super) lost_length: f64,
}

impl CenterLines {
    /// Returns the length of all lines.
    pub(super) fn length(&self) -> f64 {
        self.lines.iter().map(|line| polyline_length_m(line)).sum()
    }
}

/// Budget steps for triangulating a sample, smoothing a point, and measuring a distance.
const STEPS_PER_SAMPLE: usize = 2000;
const STEPS_PER_POINT: usize = 500;
const STEPS_PER_DISTANCE: usize = 5;

/// Returns the center lines of an outline in cap heights. Some lines are missing if the budget is
/// spent.
pub(super) fn center_lines(contours: &[Contour], budget: &Budget) -> CenterLines {
    // Thin strokes need denser samples of the outline.
    let ink = Filled::new(contours, budget);
    let spacing = (SAMPLE_SPACING * mean_stroke_width(contours)).clamp(SAMPLING[0], SAMPLING[1]);
    let ink_edges = ink_edges(contours, &ink, spacing);
    if !budget.spend_steps(STEPS_PER_SAMPLE * ink_edges.iter().map(Vec::len).sum::<usize>()) {
        return CenterLines::default();
    }
    // The spurs of the medial axis are removed before junctions are examined.
    let mut axis = Axis::new(&ink_edges, &ink);
    let parts = parts(&axis.neighbors);
    let unpruned = axis.neighbors.clone();
    let bends = prune::prune(&mut axis, budget);
    let lines = junctions::lines(&axis, &bends, &ink);
    let mut lines: Vec<Vec<[f64; 2]>> = lines.iter().map(|line| fit(line, budget)).collect();
    let kept = (0..axis.radii.len()).filter(|node| axis.degree(*node) > 0);
    let half_width = median(kept.map(|node| axis.radii[node])).unwrap_or(0.0);
    for part in parts {
        replace_blob(&part, &axis, half_width, &mut lines, budget);
    }
    // The unpruned axis shows which strokes no line draws.
    let n_segments = lines.iter().map(Vec::len).sum::<usize>();
    let lost_length = if budget.spend_steps(STEPS_PER_DISTANCE * n_segments * unpruned.len()) {
        lost_length(&axis, &unpruned, &lines, half_width)
    } else {
        0.0
    };
    let thickest = axis.radii.iter().copied().fold(0.0, f64::max);
    CenterLines { lines, half_width, thickest, lost_length }
}

/// Replaces a connected part's lines with a dot if the part is short relative to its radius, and
/// not much thinner than the strokes. Does nothing if the budget is spent. `half_width` is half the
/// usual width of strokes, in cap heights.
fn replace_blob(
    part: &[usize],
    axis: &Axis,
    half_width: f64,
    lines: &mut Vec<Vec<[f64; 2]>>,
    budget: &Budget,
) {
    let widest = part.iter().max_by(|a, b| axis.radii[**a].total_cmp(&axis.radii[**b]));
    let widest = *widest.expect("a part has nodes");
    let (middle, radius) = (axis.middles[widest], axis.radii[widest]);
    let is_blob = axis_length(axis, part, &axis.neighbors) < BLOB * radius;
    if is_blob
        && radius > LEAST_DOT * half_width
        && budget.spend_steps(STEPS_PER_DISTANCE * lines.len())
    {
        lines.retain(|line| !line.iter().all(|point| distance(middle, *point) < radius));
        lines.push(dot(middle, DOT));
    }
}

/// Returns the total length in cap heights of the links between nodes. Each link is listed at both
/// of its nodes.
fn axis_length(axis: &Axis, nodes: &[usize], links: &[Vec<usize>]) -> f64 {
    let pairs = nodes.iter().flat_map(|node| links[*node].iter().map(|other| (*node, *other)));
    pairs.map(|(a, b)| 0.5 * axis.distance(a, b)).sum()
}

/// Returns the edges of the ink inside contours in cap heights, simplified within [`FLATNESS`].
pub(super) fn outlines(contours: &[Contour], budget: &Budget) -> Vec<Vec<[f64; 2]>> {
    let ink_edges = ink_edges(contours, &Filled::new(contours, budget), SAMPLING[1]);
    ink_edges.iter().map(|run| simplified(run, FLATNESS)).collect()
}

/// Returns a vertical line of `length` with its middle at a point. The line is too short to be
/// seen, and represents a dot.
pub(super) fn dot([x, y]: [f64; 2], length: f64) -> Vec<[f64; 2]> {
    vec![[x, y + 0.5 * length], [x, y - 0.5 * length]]
}

/// Returns the length in cap heights of the axis's longest part whose discs no line enters, or 0 if
/// it is short. `unpruned` contains the neighbors of each node before pruning, and `half_width` is
/// half the width of the strokes.
fn lost_length(
    axis: &Axis,
    unpruned: &[Vec<usize>],
    lines: &[Vec<[f64; 2]>],
    half_width: f64,
) -> f64 {
    let segments: Vec<[[f64; 2]; 2]> = lines.iter().flat_map(|line| segments(line)).collect();
    let untouched = Vec::from_iter((0..unpruned.len()).map(|node| {
        segments.iter().all(|ends| segment_distance(axis.middles[node], *ends) > axis.radii[node])
    }));
    // Only links between untouched nodes are kept. The connected parts are then measured.
    let mut links = unpruned.to_vec();
    for (node, links) in links.iter_mut().enumerate() {
        links.retain(|other| untouched[node] && untouched[*other]);
    }
    let lengths = parts(&links).into_iter().map(|part| axis_length(axis, &part, &links));
    let longest = lengths.fold(0.0, f64::max);
    if longest > LOST * half_width { longest } else { 0.0 }
}

/// Returns the connected components of a graph as lists of nodes (breadth-first search).
fn parts(neighbors: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; neighbors.len()];
    let mut parts = Vec::new();
    for start in 0..neighbors.len() {
        let mut part = if seen[start] { Vec::new() } else { vec![start] };
        seen[start] = true;
        let mut next = 0;
        while next < part.len() {
            // Neighbors that are seen for the first time are appended to the queue.
            let links = &neighbors[part[next]];
            part.extend(links.iter().filter(|node| !std::mem::replace(&mut seen[**node], true)));
            next += 1;
        }
        if !part.is_empty() {
            parts.push(part);
        }
    }
    parts
}

/// Smooths a line between its corners and simplifies it, in cap heights. If the budget is spent,
/// only its start is returned.
fn fit(line: &[Knot], budget: &Budget) -> Vec<[f64; 2]> {
    let closed = line.len() > 3 && line[0].position == line[line.len() - 1].position;
    let mut line = line.to_vec();
    if closed {
        // A closed line is rotated to start at a corner if it has one.
        line.pop();
        if let Some(corner) = line.iter().position(|knot| knot.corner) {
            line.rotate_left(corner);
        }
        line.push(line[0]);
    }
    // Each span between two corners is smoothed with fixed ends.
    let corners = (1..line.len() - 1).filter(|i| line[*i].corner);
    let cuts: Vec<usize> = std::iter::once(0).chain(corners).chain([line.len() - 1]).collect();
    let mut fitted: Vec<[f64; 2]> = Vec::new();
    for span in cuts.windows(2) {
        let points: Vec<[f64; 2]> =
            line[span[0]..=span[1]].iter().map(|knot| knot.position).collect();
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let n_smoothed = (polyline_length_m(&points) / SPACING) as usize;
        if !budget.spend_steps(STEPS_PER_POINT * (n_smoothed.min(MAX_POINTS) + points.len())) {
            break;
        }
        let piece = simplified(&smooth(&points, SPACING, SMOOTHING_ERROR), FLATNESS);
        fitted.extend(piece.iter().skip(usize::from(!fitted.is_empty())));
    }
    fitted
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget() -> Budget {
        Budget::new("face.ttf", "none")
    }

    /// Returns the sorted center lines of rectangles (left, bottom, right, top), in hundredths.
    fn traced(rectangles: &[[f64; 4]]) -> Vec<Vec<[i64; 2]>> {
        let contour = |[l, b, r, t]: &[f64; 4]| vec![[*l, *b], [*r, *b], [*r, *t], [*l, *t]];
        let contours: Vec<Contour> = rectangles.iter().map(contour).collect();
        let mut lines: Vec<Vec<[i64; 2]>> = Vec::new();
        for line in center_lines(&contours, &budget()).lines {
            #[expect(clippy::cast_possible_truncation, reason = "hundredths")]
            let mut line: Vec<[i64; 2]> =
                line.iter().map(|point| point.map(|x| (100.0 * x).round() as i64)).collect();
            line.dedup();
            if line[0] == line[line.len() - 1] {
                line.pop();
                let least = (0..line.len()).min_by_key(|i| line[*i]).unwrap();
                line.rotate_left(least);
                if line[1] > line[line.len() - 1] {
                    line[1..].reverse();
                }
                line.push(line[0]);
            } else if line[0] > line[line.len() - 1] {
                line.reverse();
            }
            lines.push(line);
        }
        lines.sort();
        lines
    }

    #[test]
    fn strokes_end_half_their_width_before_the_edge() {
        assert_eq!(traced(&[[0.0, 0.0, 0.2, 1.0]]), [[[10, 10], [10, 90]]]);
        assert_eq!(traced(&[[0.0, 0.0, 1.0, 0.06]]), [[[3, 3], [97, 3]]]);
    }

    #[test]
    fn overlapping_strokes_meet_where_their_center_lines_do() {
        let stem = [0.0, 0.0, 0.2, 1.0];
        let foot = [0.0, 0.0, 0.8, 0.2];
        assert_eq!(traced(&[stem, foot]), [[[10, 90], [10, 10], [70, 10]]], "L: a sharp corner");
        let tee = traced(&[[0.4, 0.0, 0.6, 1.0], [0.0, 0.8, 1.0, 1.0]]);
        assert_eq!(
            tee,
            [[[10, 90], [90, 90]], [[50, 10], [50, 90]]],
            "T: the bar runs straight on"
        );
        let cross = traced(&[[0.4, 0.0, 0.6, 1.0], [0.0, 0.4, 1.0, 0.6]]);
        assert_eq!(cross, [[[10, 50], [90, 50]], [[50, 10], [50, 90]]], "+: two strokes, not four");
        let sides = [stem, foot, [0.6, 0.0, 0.8, 1.0], [0.0, 0.8, 0.8, 1.0]];
        let around = [[10, 10], [10, 90], [70, 90], [70, 10], [10, 10]];
        assert_eq!(traced(&sides), [around], "a frame is one closed line with four corners");
    }

    #[test]
    fn a_stroke_that_no_line_touches_is_lost() {
        let tee = [[0.4, 0.0, 0.6, 1.0], [0.0, 0.8, 1.0, 1.0]]
            .map(|[l, b, r, t]| vec![[l, b], [r, b], [r, t], [l, t]]);
        assert_eq!(center_lines(&tee, &budget()).lost_length, 0.0);
        let budget = budget();
        let ink = Filled::new(&tee, &budget);
        let axis = Axis::new(&ink_edges(&tee, &ink, 0.01), &ink);
        let stem = [vec![[0.5, 0.1], [0.5, 0.9]]];
        let length = lost_length(&axis, &axis.neighbors, &stem, 0.1);
        assert!((0.2..0.6).contains(&length), "half the bar: {length}");
    }

    #[test]
    fn a_dot_becomes_a_point_and_no_ink_no_line() {
        let square = vec![[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]];
        let lines = center_lines(&[square], &budget()).lines;
        let [from, to] = &lines[0][..] else { panic!("{lines:?}") };
        assert_eq!(lines.len(), 1);
        assert!(distance(*from, [0.5, 0.5]) < 0.01 && distance(*from, *to) < 0.001, "{lines:?}");
        assert!(center_lines(&[], &budget()).lines.is_empty());
        assert!(
            center_lines(&[vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]], &budget()).lines.is_empty(),
            "no ink"
        );
    }
}
