//! Branches of the medial axis, repair of their ends at junctions, and chains of branches.

use noctograph_core::geometry::{arc_lengths, distance};
use noctograph_core::statistics::median;

use super::super::vector::{ahead, direction, minus};

/// Maximum ratio of radius to the branch's median radius at which the branch starts to be used.
const SETTLED: f64 = 1.06;

/// Minimum and maximum length skipped at a junction's end of a branch, in radii of the junction,
/// and maximum fraction of the branch that is skipped.
const SKIPPED: [f64; 2] = [0.7, 2.2];
const SKIPPED_FRACTION: f64 = 0.4;

/// Minimum ratio of a straight branch's chord to its length.
const STRAIGHT: f64 = 0.94;

/// A point of a line, with a flag that is true if the line has a corner at this point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub(super) position: [f64; 2],
    pub(super) corner: bool,
}

/// The end of a branch at a junction.
#[derive(Debug)]
pub(super) struct Arm {
    pub(super) branch: usize,
    /// True for the end of the branch, false for its start.
    pub(super) tail: bool,
    /// First usable point of the arm's center line, and its direction away from the junction.
    pub(super) from: [f64; 2],
    pub(super) away: [f64; 2],
    /// Median radius of the arm's branch.
    pub(super) radius: f64,
}

/// A branch while its ends are repaired.
#[derive(Default)]
pub(super) struct Branch {
    pub(super) points: Vec<[f64; 2]>,
    /// Radius at each point.
    pub(super) radii: Vec<f64>,
    /// Connections at the first and the last point.
    pub(super) ends: [Connection; 2],
    used: bool,
}

/// The points from a branch's end to where it meets other branches, and the branch that follows.
#[derive(Default)]
pub(super) struct Connection {
    pub(super) knots: Vec<Knot>,
    /// The next branch, with a flag that is true if the branch is entered at its tail.
    pub(super) next: Option<(usize, bool)>,
}

impl Branch {
    /// Returns a branch through points with their radii, without connections.
    pub(super) fn new(points: Vec<[f64; 2]>, radii: Vec<f64>) -> Self {
        Self { points, radii, ..Self::default() }
    }

    /// Reverses the branch if `tail` is true, so that its last point comes first. A second call
    /// restores the order.
    fn turn(&mut self, tail: bool) {
        if tail {
            self.points.reverse();
            self.radii.reverse();
        }
    }

    /// Cuts off the points near an end that a junction of the given radius in cap heights
    /// displaces. The end is the last point if `tail` is true. Returns the arm that starts at the
    /// first remaining point.
    pub(super) fn trim(&mut self, branch: usize, tail: bool, radius: f64) -> Arm {
        self.turn(tail);
        // The axis bulges at a junction, so the branch is used only after its radius has settled.
        let along = arc_lengths(&self.points);
        let n = self.points.len();
        let length = along[n - 1];
        let median_radius = median(self.radii.iter().copied()).unwrap_or(0.0);
        let latest = (SKIPPED[1] * radius).min(SKIPPED_FRACTION * length);
        let earliest = (SKIPPED[0] * radius).min(latest);
        let settled =
            (0..n).find(|i| along[*i] >= earliest && self.radii[*i] <= SETTLED * median_radius);
        let first = settled.filter(|i| along[*i] <= latest);
        let first = first.unwrap_or_else(|| along.partition_point(|s| *s < latest).min(n - 2));
        // The arm's direction is measured over about one radius of the junction.
        let until = along[first] + radius.min(0.5 * (length - along[first])).max(1e-9);
        let last = along.partition_point(|s| *s < until).clamp(first + 1, n - 1);
        let from = self.points[first];
        let away = direction(from, self.points[last]);
        self.points.drain(..first);
        self.radii.drain(..first);
        self.turn(tail);
        Arm { branch, tail, from, away, radius: median_radius }
    }

    /// Turns a straight branch about its other end, so that it ends at `to` instead of `from`. The
    /// end is the last point if `tail` is true.
    pub(super) fn aim(&mut self, tail: bool, from: [f64; 2], to: [f64; 2]) {
        self.turn(tail);
        let along = arc_lengths(&[&[from][..], &self.points].concat());
        let length = along[along.len() - 1];
        let chord = self.points.last().map_or(0.0, |last| distance(from, *last));
        if chord >= STRAIGHT * length {
            for (point, along) in self.points.iter_mut().zip(&along[1..]) {
                let fraction_left = 1.0 - along / length.max(f64::MIN_POSITIVE);
                *point = ahead(*point, minus(to, from), fraction_left);
            }
        }
        self.turn(tail);
    }
}

/// Returns the lines that follow connected branches from end to end. Every branch belongs to
/// exactly one line.
pub(super) fn chain(branches: &mut [Branch]) -> Vec<Vec<Knot>> {
    let mut lines = Vec::new();
    // Lines from loose ends are followed first. The branches that then remain form closed lines.
    for from_loose in [true, false] {
        for begin in 0..branches.len() {
            for tail in [false, true] {
                let loose = branches[begin].ends[usize::from(tail)].next.is_none();
                if !branches[begin].used && (loose || !from_loose) {
                    lines.push(follow(branches, begin, tail));
                }
            }
        }
    }
    lines
}

/// Follows connected branches from an end of one of them, marks them as used, and returns their
/// line without repeated knots. The end is the last point of the branch `begin` if `tail` is true.
fn follow(branches: &mut [Branch], begin: usize, tail: bool) -> Vec<Knot> {
    let mut line: Vec<Knot> = Vec::new();
    let (mut index, mut enters_by_tail) = (begin, tail);
    loop {
        // Appends a branch in the direction of travel, with the knots at both of its ends.
        let branch = &mut branches[index];
        branch.used = true;
        let (entry, exit) = (usize::from(enters_by_tail), usize::from(!enters_by_tail));
        line.extend(branch.ends[entry].knots.iter().rev());
        if enters_by_tail {
            branch.points.reverse();
        }
        line.extend(branch.points.iter().map(|point| Knot { position: *point, corner: false }));
        line.extend(branch.ends[exit].knots.iter());
        match branch.ends[exit].next.filter(|(next, _)| !branches[*next].used) {
            Some(next) => (index, enters_by_tail) = next,
            None => break,
        }
    }
    /// Distance in cap heights up to which two knots differ only by rounding.
    const SAME: f64 = 1e-9;
    line.dedup_by(|a, b| {
        let same = distance(a.position, b.position) <= SAME;
        b.corner |= same && a.corner;
        same
    });
    line
}
