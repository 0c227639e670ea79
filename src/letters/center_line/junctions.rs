//! At junctions of strokes, the medial axis deviates from the strokes' center lines. The lines are
//! therefore extended straight from outside the junction until they meet.

use super::super::outline::Filled;
use super::super::vector::{ahead, cross, dot, mean, minus, segments};
use super::axis::{Axis, Path};
use super::branches::{Arm, Branch, Connection, Knot, chain};
use noctograph_core::geometry::distance;

/// Maximum distance between two junctions that count as one, relative to the larger radius. The
/// medial axis of a crossing has two junctions. The second value is for two bends, as at a flat tip
/// (v, M).
const ONE_JUNCTION: f64 = 1.0;
const ONE_BEND: f64 = 2.5;

/// Cosine of the maximum turn of a stroke that continues through a junction (75°, because a bowl
/// turns further), and through a bend of a single stroke (25°).
const THROUGH: f64 = 0.26;
const THROUGH_BEND: f64 = 0.906;

/// Limit that is less than the cosine of any turn.
const ANY_TURN: f64 = -2.0;

/// Sine of the maximum angle between an upright arm and the vertical or horizontal: 3°.
const UPRIGHT: f64 = 0.05;

/// Minimum determinant of the normal equations of lines that cross.
const PARALLEL: f64 = 1e-3;

/// Maximum distance between the crossing of lines and their junction, relative to the junction's
/// radius. The limit exceeds the distance at flat tips.
const FAR: f64 = 10.0;

/// Maximum distance between a meeting point and its junction, in radii of the junction.
const REACH: f64 = 3.0;

/// Budget steps for comparing a pair of arms.
const STEPS_PER_PAIR: usize = 3;

/// Returns the lines of an axis as knots: its branches, extended at junctions until they meet, with
/// straight strokes joined. `bends` says for each node whether a line has a corner there.
pub(super) fn lines(axis: &Axis, bends: &[bool], ink: &Filled<'_>) -> Vec<Vec<Knot>> {
    let is_key = Vec::from_iter((0..axis.middles.len()).map(|node| match axis.degree(node) {
        2 => bends[node],
        degree => degree != 0,
    }));
    // Branches are the paths between clusters of junctions.
    let paths = axis.paths(&|node| is_key[node]);
    let (cluster_of, is_inner) = clusters(axis, &paths);
    let mut branches: Vec<Branch> = Vec::new();
    // At each cluster, a branch is listed with true if it ends there, and with false if it starts
    // there.
    let mut branch_ends: Vec<Vec<(usize, bool)>> = vec![Vec::new(); axis.middles.len()];
    for (path, _) in paths.iter().zip(&is_inner).filter(|(_, is_inner)| !**is_inner) {
        let (first, last) = (path[0], path[path.len() - 1]);
        if first != last || is_key[first] {
            branch_ends[cluster_of[first]].push((branches.len(), false));
            branch_ends[cluster_of[last]].push((branches.len(), true));
        }
        let points = path.iter().map(|node| axis.middles[*node]).collect();
        branches.push(Branch::new(points, path.iter().map(|node| axis.radii[*node]).collect()));
    }
    // At each junction, the branches are cut back and reconnected.
    let mut members_of: Vec<Vec<usize>> = vec![Vec::new(); axis.middles.len()];
    for node in (0..axis.middles.len()).filter(|node| is_key[*node]) {
        members_of[cluster_of[node]].push(node);
    }
    for (cluster, ends) in branch_ends.into_iter().enumerate().filter(|(_, ends)| ends.len() > 1) {
        // The search for arms that continue each other compares all pairs each time it is repeated.
        let n_pairs = ends.len() * ends.len();
        if !ink.budget().spend_steps(STEPS_PER_PAIR * n_pairs * (ends.len() / 2 + 1)) {
            break;
        }
        let members = &members_of[cluster];
        let middles: Vec<[f64; 2]> = members.iter().map(|node| axis.middles[*node]).collect();
        let radius = members.iter().map(|m| axis.radii[*m]).fold(0.0, f64::max);
        let arms = ends.iter().map(|(branch, tail)| branches[*branch].trim(*branch, *tail, radius));
        let arms: Vec<Arm> = arms.collect();
        meet(&mut branches, &arms, &Joint { middle: mean(&middles), radius, ink });
    }
    chain(&mut branches)
}

/// Returns the smallest node of a node's cluster (union-find).
fn root(cluster_of: &[usize], mut node: usize) -> usize {
    while cluster_of[node] != node {
        node = cluster_of[node];
    }
    node
}

/// Returns for each node the smallest node in its cluster of junctions. Also returns for each path
/// whether it is inside a cluster.
fn clusters(axis: &Axis, paths: &[Path]) -> (Vec<usize>, Vec<bool>) {
    let mut cluster_of: Vec<usize> = (0..axis.middles.len()).collect();
    let mut is_inner = vec![false; paths.len()];
    for (path, is_inner) in paths.iter().zip(&mut is_inner) {
        let (a, b) = (path[0], path[path.len() - 1]);
        // A path shorter than the width of its junctions merges their clusters.
        let are_junctions = axis.degree(a) > 1 && axis.degree(b) > 1 && a != b;
        let radius = axis.radii[a].max(axis.radii[b]);
        let reach = if axis.degree(a) + axis.degree(b) == 4 { ONE_BEND } else { ONE_JUNCTION };
        if are_junctions && axis.length(path) < reach * radius {
            *is_inner = true;
            let (a, b) = (root(&cluster_of, a), root(&cluster_of, b));
            cluster_of[a.max(b)] = a.min(b);
        }
    }
    let roots = (0..cluster_of.len()).map(|node| root(&cluster_of, node)).collect();
    (roots, is_inner)
}

/// A junction: its center, and the radius of its largest disc.
struct Joint<'a> {
    middle: [f64; 2],
    radius: f64,
    ink: &'a Filled<'a>,
}

impl Joint<'_> {
    /// True if a point is within `reach` times the radius from the junction's center.
    fn is_near(&self, point: [f64; 2], reach: f64) -> bool {
        distance(point, self.middle) <= reach * self.radius
    }

    /// Returns the point where arms meet. Each arm is extended toward the crossing of their lines
    /// as far as a pen of its width stays in the ink, and the ends are averaged. If any arms are
    /// vertical or horizontal, only these are averaged, so that they stay straight.
    fn meeting_point(&self, arms: &[Arm], crossing: [f64; 2]) -> [f64; 2] {
        /// Number of steps in which an arm is extended to the crossing.
        const STEPS: u32 = 40;
        let mut upright: Vec<&Arm> = arms.iter().collect();
        upright.retain(|arm| arm.away[0].abs().min(arm.away[1].abs()) < UPRIGHT);
        if upright.is_empty() {
            upright.extend(arms);
        }
        let ends = upright.iter().map(|arm| {
            // The reach is negative, because the crossing lies opposite to the arm's direction. The
            // arm ends at the farthest step at which the tip of the pen is still in the ink.
            let reach = dot(minus(crossing, arm.from), arm.away).min(0.0);
            let mut steps = (0..=STEPS).rev().map(|k| reach * f64::from(k) / f64::from(STEPS));
            let inked = steps.find(|s| self.ink.holds(ahead(arm.from, arm.away, s - arm.radius)));
            ahead(arm.from, arm.away, inked.unwrap_or(0.0))
        });
        let meeting_point = mean(&ends.collect::<Vec<_>>());
        if self.is_near(meeting_point, REACH) { meeting_point } else { self.middle }
    }
}

/// Connects the arms of a junction. Arms that continue straight through are joined by a curve, on
/// which the others end. If there are none, all arms meet in a point.
fn meet(branches: &mut [Branch], arms: &[Arm], joint: &Joint<'_>) {
    // The straightest pair is joined first. Each arm of a pair receives half of the curve between
    // them.
    let mut free: Vec<usize> = (0..arms.len()).collect();
    let mut through: Vec<Vec<[f64; 2]>> = Vec::new();
    let limit = if arms.len() == 2 { THROUGH_BEND } else { THROUGH };
    while let Some((a, b)) = straightest(arms, &free, limit) {
        let path = curve(&arms[a], &arms[b]);
        let knots = path.iter().map(|point| Knot { position: *point, corner: false });
        let knots: Vec<Knot> = knots.collect();
        let half = knots.len() / 2;
        let back = knots[half..].iter().rev().copied().collect();
        join(branches, [&arms[a], &arms[b]], [knots[..=half].to_vec(), back]);
        through.push(path);
        free.retain(|arm| *arm != a && *arm != b);
    }
    if through.is_empty() {
        return meet_in_point(branches, arms, joint);
    }
    for arm in free.into_iter().map(|arm| &arms[arm]) {
        let hits = through.iter().filter_map(|path| first_hit(arm, path));
        let hit = hits.min_by(|a, b| distance(arm.from, *a).total_cmp(&distance(arm.from, *b)));
        let point = hit.filter(|p| joint.is_near(*p, REACH)).unwrap_or(joint.middle);
        branches[arm.branch].ends[usize::from(arm.tail)].knots = corner(point);
    }
}

/// Connects the arms of a junction in the point where their lines cross, or at its center if they
/// cross elsewhere. The two arms with the smallest turn become one stroke with a corner.
fn meet_in_point(branches: &mut [Branch], arms: &[Arm], joint: &Joint<'_>) {
    let crossing = crossing(arms).filter(|p| {
        joint.is_near(*p, FAR) && arms.iter().all(|arm| dot(minus(*p, arm.from), arm.away) < 0.0)
    });
    let point = crossing.map_or(joint.middle, |crossing| joint.meeting_point(arms, crossing));
    for arm in arms {
        branches[arm.branch].aim(arm.tail, crossing.unwrap_or(point), point);
    }
    // The straightest pair is joined. The other arms end in the point.
    let mut free: Vec<usize> = (0..arms.len()).collect();
    if let Some((a, b)) = straightest(arms, &free, ANY_TURN) {
        join(branches, [&arms[a], &arms[b]], [corner(point), corner(point)]);
        free.retain(|arm| *arm != a && *arm != b);
    }
    for arm in free {
        branches[arms[arm].branch].ends[usize::from(arms[arm].tail)].knots = corner(point);
    }
}

/// Returns a line of a single knot with a corner.
fn corner(position: [f64; 2]) -> Vec<Knot> {
    vec![Knot { position, corner: true }]
}

/// Joins two arms into one line: each arm is extended by its knots and continues in the other arm.
fn join(branches: &mut [Branch], arms: [&Arm; 2], knots: [Vec<Knot>; 2]) {
    for ((arm, other), knots) in [(arms[0], arms[1]), (arms[1], arms[0])].into_iter().zip(knots) {
        let next = Some((other.branch, other.tail));
        branches[arm.branch].ends[usize::from(arm.tail)] = Connection { knots, next };
    }
}

/// Returns the indices of the pair of free arms with the smallest turn from one into the other.
/// Returns `None` if the cosine of that turn does not exceed the limit.
fn straightest(arms: &[Arm], free: &[usize], limit: f64) -> Option<(usize, usize)> {
    let pairs = free.iter().enumerate().flat_map(|(i, a)| free[i + 1..].iter().map(|b| (*a, *b)));
    let turns = pairs.map(|(a, b)| ((a, b), -dot(arms[a].away, arms[b].away)));
    let best = turns.max_by(|x, y| x.1.total_cmp(&y.1));
    best.filter(|(_, cosine)| *cosine > limit).map(|(pair, _)| pair)
}

/// Returns the points of a cubic Bézier curve that continues arm `a` smoothly into arm `b`, from
/// the end of `a` to that of `b`.
fn curve(a: &Arm, b: &Arm) -> Vec<[f64; 2]> {
    /// Number of straight pieces of a curve.
    const PIECES: u32 = 16;
    // The control points extend each arm by a third of the distance between the arms.
    let third = distance(a.from, b.from) / 3.0;
    Vec::from_iter((0..=PIECES).map(|k| {
        let t = f64::from(k) / f64::from(PIECES);
        let s = 1.0 - t;
        [0, 1].map(|i| {
            let (c, d) = (a.from[i] - third * a.away[i], b.from[i] - third * b.away[i]);
            s * s * s * a.from[i]
                + 3.0 * s * s * t * c
                + 3.0 * s * t * t * d
                + t * t * t * b.from[i]
        })
    }))
}

/// Returns the point nearest to the lines of all arms in the least-squares sense, or `None` if they
/// are nearly parallel.
fn crossing(arms: &[Arm]) -> Option<[f64; 2]> {
    // These are the normal equations of least squares for n · p = offset over all normals n.
    let (mut a, mut b, mut c, mut d, mut e) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for arm in arms {
        let [nx, ny] = [-arm.away[1], arm.away[0]];
        let offset = nx * arm.from[0] + ny * arm.from[1];
        (a, b, c) = (a + nx * nx, b + nx * ny, c + ny * ny);
        (d, e) = (d + nx * offset, e + ny * offset);
    }
    let determinant = a * c - b * b;
    (determinant > PARALLEL).then(|| [(c * d - b * e) / determinant, (a * e - b * d) / determinant])
}

/// Returns the point where an arm, extended straight, first meets a line, or `None` if they miss.
fn first_hit(arm: &Arm, line: &[[f64; 2]]) -> Option<[f64; 2]> {
    let onward = arm.away.map(|x| -x);
    let hits = segments(line).filter_map(|[from, to]| {
        let (gap, segment) = (minus(from, arm.from), minus(to, from));
        // arm.from + t · onward = from + s · segment is solved by Cramer's rule.
        let area = cross(onward, segment);
        let (t, s) = (cross(gap, segment) / area, cross(gap, onward) / area);
        (t >= 0.0 && (0.0..=1.0).contains(&s)).then_some(t)
    });
    hits.min_by(f64::total_cmp).map(|t| ahead(arm.from, onward, t))
}
