//! Outlines: closed contours that are filled by the nonzero rule, as in typefaces.

use std::ops::RangeInclusive;

use super::vector::{between, cross, integers_below, minus};
use noctograph_core::files::Budget;
use noctograph_core::geometry::{bounds, distance};

/// A closed contour, whose first point is not repeated.
pub(super) type Contour = Vec<[f64; 2]>;

/// Budget steps for testing an edge, and number of edges whose test costs as much as finding a bin.
const STEPS_PER_EDGE: usize = 2;
const EDGES_PER_BIN: usize = 10;

/// Slack for rounding at the ends of segments that cross, as a fraction of their length.
const END_SLACK: f64 = 1e-9;

/// Maximum number of samples of an outline. A longer outline is sampled more coarsely.
const MAX_SAMPLES: f64 = 6000.0;

/// The filled area. Edges are sorted into bins by height, so that a query tests only a few edges.
#[derive(Debug)]
pub(super) struct Filled<'a> {
    budget: &'a Budget,
    bottom: f64,
    bin_height: f64,
    edges: Vec<[[f64; 2]; 2]>,
    /// Indices of edges in each bin. An edge as tall as the outline is in every bin.
    bins: Vec<Vec<u32>>,
}

impl<'a> Filled<'a> {
    /// Returns the area inside contours. If the budget is spent, the area lacks some edges.
    pub(super) fn new(contours: &[Contour], budget: &'a Budget) -> Self {
        let [_, bottom, _, top] = bounds(contours.iter().flatten().copied());
        let edges: Vec<_> = contours.iter().flat_map(|contour| edges(contour)).collect();
        // About four edges start in each bin, unless the outline has more than 4096 edges.
        let n_bins = (edges.len() / 4).clamp(1, 1024);
        let bin_height = ((top - bottom) / n_bins as f64).max(f64::MIN_POSITIVE);
        let mut ink = Self { budget, bottom, bin_height, edges, bins: vec![Vec::new(); n_bins] };
        for (index, edge) in (0..).zip(&ink.edges) {
            let bins = ink.bins_of(*edge);
            if !budget.spend_steps(STEPS_PER_EDGE * bins.clone().count()) {
                break;
            }
            ink.bins[bins].iter_mut().for_each(|bin| bin.push(index));
        }
        ink
    }

    /// Returns the budget to which queries charge their steps.
    pub(super) fn budget(&self) -> &Budget {
        self.budget
    }

    /// True if a point is inside the area. Returns false if the budget is spent.
    pub(super) fn holds(&self, point: [f64; 2]) -> bool {
        self.winding(point) != 0
    }

    /// Returns the winding number of the contours about a point, or 0 if the budget is spent.
    pub(super) fn winding(&self, [x, y]: [f64; 2]) -> i32 {
        let mut winding = 0;
        let bin = &self.bins[self.bin(y)];
        if !self.budget.spend_steps(STEPS_PER_EDGE * (bin.len() + EDGES_PER_BIN)) {
            return 0;
        }
        // The winding number is the count of edges that cross the ray to the right, with upward
        // edges positive and downward edges negative (Sunday 2001).
        for index in bin {
            let [[ax, ay], [bx, by]] = &self.edges[*index as usize];
            if (*ay <= y) != (*by <= y) {
                let crossing_x = ax + (y - ay) / (by - ay) * (bx - ax);
                if crossing_x > x {
                    winding += if by > ay { 1 } else { -1 };
                }
            }
        }
        winding
    }

    /// Appends the crossings of edges with a segment, as fractions of its length from 0 to 1. An
    /// edge in several bins appends its crossing several times.
    pub(super) fn crossings(&self, segment: [[f64; 2]; 2], fractions: &mut Vec<f64>) {
        let along = minus(segment[1], segment[0]);
        let bins = &self.bins[self.bins_of(segment)];
        let n_edges: usize = bins.iter().map(|bin| bin.len() + EDGES_PER_BIN).sum();
        if !self.budget.spend_steps(STEPS_PER_EDGE * n_edges) {
            return;
        }
        for index in bins.iter().flatten() {
            let [a, b] = self.edges[*index as usize];
            // Cramer's rule for `segment[0] + t along = a + u edge`.
            let (edge, gap) = (minus(b, a), minus(a, segment[0]));
            let area = cross(along, edge);
            let (t, u) = (cross(gap, edge) / area, cross(gap, along) / area);
            if [t, u].iter().all(|fraction| (-END_SLACK..=1.0 + END_SLACK).contains(fraction)) {
                fractions.push(t.clamp(0.0, 1.0));
            }
        }
    }

    /// Returns the indices of the bins that a segment spans.
    fn bins_of(&self, [from, to]: [[f64; 2]; 2]) -> RangeInclusive<usize> {
        self.bin(from[1].min(to[1]))..=self.bin(from[1].max(to[1]))
    }

    /// Returns the index of the bin at a height, or of the nearest bin if the height is outside.
    #[expect(clippy::cast_possible_truncation, reason = "bins are few")]
    fn bin(&self, y: f64) -> usize {
        (((y - self.bottom) / self.bin_height).max(0.0) as usize).min(self.bins.len() - 1)
    }
}

/// Returns the edges of a contour, including the one from its last point to its first.
fn edges(contour: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    (0..contour.len()).map(|i| [contour[i], contour[(i + 1) % contour.len()]])
}

/// Returns the edges of the ink, which are runs of samples along the contours, at most `spacing`
/// apart, that have ink on only one side. Closed runs repeat their first point.
pub(super) fn ink_edges(
    contours: &[Contour],
    ink: &Filled<'_>,
    spacing: f64,
) -> Vec<Vec<[f64; 2]>> {
    let spacing = spacing.max(length(contours) / MAX_SAMPLES);
    let mut runs = Vec::new();
    for contour in contours {
        let mut samples = sampled(contour, spacing);
        if samples.len() < 3 {
            continue;
        }
        // Edges inside the ink, where contours overlap, are dropped.
        let n = samples.len();
        let is_edge = Vec::from_iter(edges(&samples).map(|edge| has_ink_on_one_side(edge, ink)));
        let Some(first_gap) = is_edge.iter().position(|is_edge| !is_edge) else {
            samples.push(samples[0]);
            runs.push(samples);
            continue;
        };
        // The cycle starts at a gap, so that no run crosses the start of the contour.
        let cycle: Vec<usize> = (first_gap..first_gap + n).map(|edge| edge % n).collect();
        for run in cycle.chunk_by(|a, b| is_edge[*a] == is_edge[*b]).filter(|run| is_edge[run[0]]) {
            let indices = run.iter().copied().chain([run[run.len() - 1] + 1]);
            runs.push(indices.map(|index| samples[index % n]).collect());
        }
    }
    runs
}

/// Returns points along a closed contour, at most `spacing` apart, without repeating the first one.
fn sampled(contour: &[[f64; 2]], spacing: f64) -> Vec<[f64; 2]> {
    let pieces = edges(contour).filter(|[a, b]| a != b).flat_map(|[a, b]| {
        let n_pieces = (distance(a, b) / spacing).ceil().max(1.0);
        integers_below(n_pieces).map(move |k| between(a, b, k / n_pieces))
    });
    pieces.collect()
}

/// True if only one side of an edge has ink, a hundredth of its length away from its middle.
fn has_ink_on_one_side([a, b]: [[f64; 2]; 2], ink: &Filled<'_>) -> bool {
    let (x, y) = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]));
    /// Distance from the edge's middle, as a fraction of its length.
    const BESIDE: f64 = 0.01;
    let (dx, dy) = (BESIDE * (b[0] - a[0]), BESIDE * (b[1] - a[1]));
    ink.holds([x - dy, y + dx]) != ink.holds([x + dy, y - dx])
}

/// Returns the length of all contours in their unit, including their closing edges.
fn length(contours: &[Contour]) -> f64 {
    contours.iter().flat_map(|contour| edges(contour)).map(|[a, b]| distance(a, b)).sum()
}

/// Returns the area inside a closed contour, in its unit squared. The area is negative if the
/// contour runs clockwise.
pub(super) fn area(contour: &[[f64; 2]]) -> f64 {
    edges(contour).map(|[a, b]| 0.5 * cross(a, b)).sum()
}

/// Returns the mean width of an outline's strokes in the outline's unit: twice its area divided by
/// its length.
pub(super) fn mean_stroke_width(contours: &[Contour]) -> f64 {
    let edges = contours.iter().flat_map(|contour| edges(contour));
    let area: f64 = edges.map(|[a, b]| 0.5 * cross(a, b)).sum();
    2.0 * area.abs() / length(contours).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::geometry::polyline_length_m;

    fn square(left: f64, side: f64) -> Contour {
        vec![[left, 0.0], [left + side, 0.0], [left + side, side], [left, side]]
    }

    fn budget() -> Budget {
        Budget::new("face.ttf", "none")
    }

    #[test]
    fn an_overlap_is_ink_and_a_hole_is_not() {
        let mut hole = square(1.0, 1.0);
        hole.iter_mut().for_each(|point| point[1] += 1.0);
        hole.reverse();
        let budget = budget();
        let ink = Filled::new(&[square(0.0, 3.0), hole], &budget);
        assert!(ink.holds([0.5, 0.5]) && !ink.holds([1.5, 1.5]) && !ink.holds([3.5, 1.0]));
        let ink = Filled::new(&[square(0.0, 3.0), square(2.0, 3.0)], &budget);
        assert!(ink.holds([2.5, 1.0]), "wound about twice");
    }

    #[test]
    fn the_rim_leaves_out_contours_within_the_ink() {
        let contours = [square(0.0, 3.0), square(2.0, 3.0)];
        let ink_edges = ink_edges(&contours, &Filled::new(&contours, &budget()), 0.1);
        let length: f64 = ink_edges.iter().map(|run| polyline_length_m(run)).sum();
        // The outline consists of two squares of side 12, each without 3 of one side. The bottom
        // and top that they have in common count twice.
        assert!((length - 18.0).abs() < 0.5, "{length}");
        assert_eq!(mean_stroke_width(&[square(0.0, 2.0)]), 1.0);
    }
}
