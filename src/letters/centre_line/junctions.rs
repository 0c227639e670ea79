//! Junctions: where strokes meet, the medial axis leaves each stroke's middle line before they do;
//! here the lines are followed straight on until they meet.

use super::super::outline::Ink;
use super::axis::{Axis, Branch};
use crate::statistics::median;

/// Two junctions nearer than this by the larger radius are one: a crossing shows as two.
const ONE_JUNCTION: f64 = 1.0;
const ONE_BEND: f64 = 2.5;

/// A branch is trusted from where its radius has come down to this, by its usual radius.
const SETTLED: f64 = 1.06;

/// How far from the junction it is trusted at the earliest and at the latest, by the junction's
/// radius, and at most which share of a branch is distrusted.
const TRUST: [f64; 2] = [0.7, 2.2];
const TRUST_SHARE: f64 = 0.4;

/// Cosine of the angle by which a stroke that goes through a junction may turn there: 75°, since a
/// bowl turns on; and at a bend of a single stroke, 25°.
const THROUGH: f64 = 0.26;
const THROUGH_BEND: f64 = 0.906;

/// A limb is straight where its chord is this share of its length.
const STRAIGHT: f64 = 0.94;

/// Sine of the angle off the upright or level within which an arm counts as such: 3°.
const UPRIGHT: f64 = 0.05;

/// Farthest that lines may cross from their junction, by its radius; they cross beyond a tip that is
/// cut off flat.
const FAR: f64 = 10.0;

/// Farthest that a meeting point may lie from its junction, by the junction's radius.
const REACH: f64 = 3.0;

/// A point of a line, and whether the line has a corner there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Knot {
    pub(super) at: [f64; 2],
    pub(super) corner: bool,
}

/// A branch's end at a junction.
#[derive(Debug)]
struct Arm {
    branch: usize,
    /// Whether it is the branch's end, not its beginning.
    tail: bool,
    /// Where its middle line is trusted from, and the direction from there away from the junction.
    from: [f64; 2],
    away: [f64; 2],
    /// Its usual radius.
    radius: f64,
}

/// A branch while its ends are mended.
struct Limb {
    points: Vec<[f64; 2]>,
    /// Radius at each point.
    radii: Vec<f64>,
    /// What is put before its first and after its last point.
    ends: [Joined; 2],
    used: bool,
}

/// The way from a limb's end to where it meets others, and the limb that goes on there: whether by
/// its tail.
#[derive(Default)]
struct Joined {
    knots: Vec<Knot>,
    next: Option<(usize, bool)>,
}

/// Lines through the junctions of an axis, straight strokes joined.
pub(super) fn lines(axis: &Axis, bends: &[bool], ink: &Ink) -> Vec<Vec<Knot>> {
    let is_key = |node: usize| {
        let degree = axis.degree(node);
        degree != 2 && degree != 0 || degree == 2 && bends[node]
    };
    let branches = axis.branches(&is_key);
    let (cluster_of, inner) = clusters(axis, &branches);
    let mut limbs: Vec<Limb> = Vec::new();
    let mut arms: Vec<Vec<Arm>> = (0..axis.middles.len()).map(|_| Vec::new()).collect();
    for (branch, _) in branches.iter().zip(&inner).filter(|(_, inner)| !**inner) {
        let index = limbs.len();
        limbs.push(Limb {
            points: branch.iter().map(|node| axis.middles[*node]).collect(),
            radii: branch.iter().map(|node| axis.radii[*node]).collect(),
            ends: Default::default(),
            used: false,
        });
        let closed = branch[0] == branch[branch.len() - 1] && !is_key(branch[0]);
        if !closed {
            for (node, tail) in [(branch[0], false), (branch[branch.len() - 1], true)] {
                let arm = Arm { branch: index, tail, from: [0.0; 2], away: [0.0; 2], radius: 0.0 };
                arms[cluster_of[node]].push(arm);
            }
        }
    }
    for (cluster, mut arms) in arms.into_iter().enumerate().filter(|(_, arms)| arms.len() > 1) {
        let members = (0..axis.middles.len()).filter(|node| cluster_of[*node] == cluster);
        let members: Vec<usize> = members.filter(|node| is_key(*node)).collect();
        let n = members.len() as f64;
        let middle = [0, 1].map(|i| members.iter().map(|m| axis.middles[*m][i]).sum::<f64>() / n);
        let radius = members.iter().map(|m| axis.radii[*m]).fold(0.0, f64::max);
        for arm in &mut arms {
            limbs[arm.branch].trim(arm, radius);
        }
        meet(&mut limbs, &arms, &Joint { middle, radius, ink });
    }
    chain(&mut limbs)
}

/// Junctions that are one, by their smallest node; and which branches lie within one.
fn clusters(axis: &Axis, branches: &[Branch]) -> (Vec<usize>, Vec<bool>) {
    let mut cluster_of: Vec<usize> = (0..axis.middles.len()).collect();
    let root = |cluster_of: &[usize], mut node: usize| {
        while cluster_of[node] != node {
            node = cluster_of[node];
        }
        node
    };
    let mut inner = vec![false; branches.len()];
    for (branch, inner) in branches.iter().zip(&mut inner) {
        let (a, b) = (branch[0], branch[branch.len() - 1]);
        let joints = axis.degree(a) > 1 && axis.degree(b) > 1 && a != b;
        let radius = axis.radii[a].max(axis.radii[b]);
        // Two bends are one where a tip is cut off flat (v, M).
        let reach = if axis.degree(a) + axis.degree(b) == 4 { ONE_BEND } else { ONE_JUNCTION };
        if joints && axis.length(branch) < reach * radius {
            *inner = true;
            let (a, b) = (root(&cluster_of, a), root(&cluster_of, b));
            cluster_of[a.max(b)] = a.min(b);
        }
    }
    let all = (0..cluster_of.len()).map(|node| root(&cluster_of, node)).collect();
    (all, inner)
}

impl Limb {
    /// Cuts the points that a junction draws aside, and tells where the rest comes from.
    fn trim(&mut self, arm: &mut Arm, radius: f64) {
        if arm.tail {
            self.points.reverse();
            self.radii.reverse();
        }
        let mut along = vec![0.0];
        for step in self.points.windows(2) {
            along.push(
                along[along.len() - 1]
                    + libm::hypot(step[1][0] - step[0][0], step[1][1] - step[0][1]),
            );
        }
        let length = along[along.len() - 1];
        let usual = median(self.radii.iter().copied()).expect("a line has points");
        let latest = (TRUST[1] * radius).min(TRUST_SHARE * length);
        let earliest = (TRUST[0] * radius).min(latest);
        let n = self.points.len();
        let settled = (0..n).find(|i| along[*i] >= earliest && self.radii[*i] <= SETTLED * usual);
        let first = settled.filter(|i| along[*i] <= latest);
        let first = first.unwrap_or_else(|| along.partition_point(|s| *s < latest).min(n - 2));
        // The direction over about a radius.
        let until = along[first] + radius.min(0.5 * (length - along[first])).max(1e-9);
        let last = along.partition_point(|s| *s < until).clamp(first + 1, n - 1);
        let (from, to) = (self.points[first], self.points[last]);
        let reach = libm::hypot(to[0] - from[0], to[1] - from[1]).max(f64::MIN_POSITIVE);
        arm.from = from;
        arm.radius = usual;
        arm.away = [(to[0] - from[0]) / reach, (to[1] - from[1]) / reach];
        self.points.drain(..first);
        self.radii.drain(..first);
        if arm.tail {
            self.points.reverse();
            self.radii.reverse();
        }
    }
}

impl Limb {
    /// Turns a straight limb about its other end, so that it leads to another point than it did.
    fn aim(&mut self, tail: bool, from: [f64; 2], to: [f64; 2]) {
        let points: Box<dyn DoubleEndedIterator<Item = &mut [f64; 2]>> =
            Box::new(self.points.iter_mut());
        let points: Vec<&mut [f64; 2]> =
            if tail { points.rev().collect() } else { points.collect() };
        let mut along = Vec::new();
        let (mut gone, mut before) = (0.0, from);
        for point in &points {
            gone += libm::hypot(point[0] - before[0], point[1] - before[1]);
            before = **point;
            along.push(gone);
        }
        let chord =
            points.last().map_or(0.0, |last| libm::hypot(last[0] - from[0], last[1] - from[1]));
        if chord < STRAIGHT * gone {
            return;
        }
        for (point, along) in points.into_iter().zip(along) {
            let share = 1.0 - along / gone.max(f64::MIN_POSITIVE);
            for axis in 0..2 {
                point[axis] += share * (to[axis] - from[axis]);
            }
        }
    }
}

/// Where arms meet.
struct Joint<'a> {
    middle: [f64; 2],
    radius: f64,
    ink: &'a Ink,
}

impl Joint<'_> {
    /// Where the arms' lines meet, but no farther than a pen as wide as they stays in the ink: a tip
    /// that is cut off flat is not drawn out to a point. There an upright or level arm keeps its
    /// line, and others share what they have to turn.
    fn meeting_point(&self, arms: &[Arm], led_to: [f64; 2]) -> [f64; 2] {
        let ends = arms.iter().map(|arm| {
            let reach = dot(minus(led_to, arm.from), arm.away).min(0.0);
            let inked = |s: f64| {
                let ahead = s - arm.radius;
                let [x, y] = [0, 1].map(|i| arm.from[i] + ahead * arm.away[i]);
                self.ink.holds([x, y])
            };
            let steps = (0..=40).rev().map(|k| reach * f64::from(k) / 40.0);
            let s = steps.into_iter().find(|s| inked(*s)).unwrap_or(0.0);
            [0, 1].map(|i| arm.from[i] + s * arm.away[i])
        });
        let ends: Vec<[f64; 2]> = ends.collect();
        let straight = |arm: &Arm| arm.away[0].abs().min(arm.away[1].abs()) < UPRIGHT;
        let kept: Vec<[f64; 2]> =
            ends.iter().zip(arms).filter(|(_, arm)| straight(arm)).map(|(end, _)| *end).collect();
        let of = if kept.is_empty() { &ends } else { &kept };
        let mean = [0, 1].map(|i| of.iter().map(|end| end[i]).sum::<f64>() / of.len() as f64);
        if near(mean, self.middle, REACH * self.radius) { mean } else { self.middle }
    }
}

/// Brings the arms of a junction together.
fn meet(limbs: &mut [Limb], arms: &[Arm], joint: &Joint<'_>) {
    let middle = joint.middle;
    let mut free: Vec<usize> = (0..arms.len()).collect();
    let mut through: Vec<Vec<[f64; 2]>> = Vec::new();
    let limit = if arms.len() == 2 { THROUGH_BEND } else { THROUGH };
    while let Some((a, b)) = straightest(arms, &free, limit) {
        let way = curve(&arms[a], &arms[b]);
        let half = way.len() / 2;
        let knots =
            |way: &[[f64; 2]]| way.iter().map(|at| Knot { at: *at, corner: false }).collect();
        let back: Vec<[f64; 2]> = way[half..].iter().rev().copied().collect();
        join(limbs, [&arms[a], &arms[b]], [knots(&way[..=half]), knots(&back)]);
        through.push(way);
        free.retain(|arm| *arm != a && *arm != b);
    }
    let corner = |at| vec![Knot { at, corner: true }];
    if through.is_empty() {
        let led_to = crossing(arms).filter(|p| {
            let onward = |arm: &Arm| dot(minus(*p, arm.from), arm.away) < 0.0;
            near(*p, middle, FAR * joint.radius) && arms.iter().all(onward)
        });
        let point = led_to.map_or(middle, |led_to| joint.meeting_point(arms, led_to));
        for arm in arms {
            limbs[arm.branch].aim(arm.tail, led_to.unwrap_or(point), point);
        }
        // The two that turn least go on as one stroke with a corner.
        if let Some((a, b)) = straightest(arms, &free, -2.0) {
            join(limbs, [&arms[a], &arms[b]], [corner(point), corner(point)]);
            free.retain(|arm| *arm != a && *arm != b);
        }
        for arm in free {
            limbs[arms[arm].branch].ends[usize::from(arms[arm].tail)].knots = corner(point);
        }
    } else {
        for arm in free {
            let arm = &arms[arm];
            let hit = through.iter().filter_map(|way| first_hit(arm, way)).min_by(|a, b| {
                let off = |p: &[f64; 2]| libm::hypot(p[0] - arm.from[0], p[1] - arm.from[1]);
                off(a).total_cmp(&off(b))
            });
            let point = hit.filter(|p| near(*p, middle, REACH * joint.radius)).unwrap_or(middle);
            limbs[arm.branch].ends[usize::from(arm.tail)].knots = corner(point);
        }
    }
}

/// Two arms become one line: each is led on by its knots and goes on in the other.
fn join(limbs: &mut [Limb], arms: [&Arm; 2], knots: [Vec<Knot>; 2]) {
    for ((arm, other), knots) in [(arms[0], arms[1]), (arms[1], arms[0])].into_iter().zip(knots) {
        let next = Some((other.branch, other.tail));
        limbs[arm.branch].ends[usize::from(arm.tail)] = Joined { knots, next };
    }
}

/// The pair of arms that are most nearly opposite, where they are nearly enough.
fn straightest(arms: &[Arm], free: &[usize], limit: f64) -> Option<(usize, usize)> {
    let straight = |a: usize, b: usize| -dot(arms[a].away, arms[b].away);
    let pairs = free.iter().enumerate().flat_map(|(i, a)| free[i + 1..].iter().map(|b| (*a, *b)));
    let best = pairs.max_by(|x, y| straight(x.0, x.1).total_cmp(&straight(y.0, y.1)));
    best.filter(|(a, b)| straight(*a, *b) > limit)
}

/// A smooth way from one arm into another: a cubic in their directions.
fn curve(a: &Arm, b: &Arm) -> Vec<[f64; 2]> {
    let chord = libm::hypot(b.from[0] - a.from[0], b.from[1] - a.from[1]);
    let point = |t: f64| {
        let (s, third) = (1.0 - t, chord / 3.0);
        [0, 1].map(|i| {
            let (c, d) = (a.from[i] - third * a.away[i], b.from[i] - third * b.away[i]);
            s * s * s * a.from[i]
                + 3.0 * s * s * t * c
                + 3.0 * s * t * t * d
                + t * t * t * b.from[i]
        })
    };
    (0..=16).map(|k| point(f64::from(k) / 16.0)).collect()
}

/// The point nearest to the lines of all arms.
fn crossing(arms: &[Arm]) -> Option<[f64; 2]> {
    let (mut a, mut b, mut c, mut d, mut e) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for arm in arms {
        let [nx, ny] = [-arm.away[1], arm.away[0]];
        let off = nx * arm.from[0] + ny * arm.from[1];
        (a, b, c) = (a + nx * nx, b + nx * ny, c + ny * ny);
        (d, e) = (d + nx * off, e + ny * off);
    }
    let determinant = a * c - b * b;
    (determinant > 1e-3).then(|| [(c * d - b * e) / determinant, (a * e - b * d) / determinant])
}

/// Where an arm, led on straight, first meets a line.
fn first_hit(arm: &Arm, line: &[[f64; 2]]) -> Option<[f64; 2]> {
    let [ux, uy] = [-arm.away[0], -arm.away[1]];
    let hits = line.windows(2).filter_map(|leg| {
        let [px, py] = [leg[0][0] - arm.from[0], leg[0][1] - arm.from[1]];
        let [dx, dy] = [leg[1][0] - leg[0][0], leg[1][1] - leg[0][1]];
        let cross = ux * dy - uy * dx;
        let (t, s) = ((px * dy - py * dx) / cross, (px * uy - py * ux) / cross);
        (t >= 0.0 && (0.0..=1.0).contains(&s)).then_some(t)
    });
    let t = hits.min_by(f64::total_cmp)?;
    Some([arm.from[0] + t * ux, arm.from[1] + t * uy])
}

/// Follows limbs from end to end.
fn chain(limbs: &mut [Limb]) -> Vec<Vec<Knot>> {
    let mut lines = Vec::new();
    // From loose ends first; what is left are closed lines.
    for from_loose in [true, false] {
        for begin in 0..limbs.len() {
            for tail in [false, true] {
                let loose = limbs[begin].ends[usize::from(tail)].next.is_none();
                if !limbs[begin].used && (loose || !from_loose) {
                    lines.push(follow(limbs, begin, tail));
                }
            }
        }
    }
    lines
}

fn follow(limbs: &mut [Limb], begin: usize, tail: bool) -> Vec<Knot> {
    let mut line: Vec<Knot> = Vec::new();
    let (mut at, mut enters_by_tail) = (begin, tail);
    loop {
        let limb = &mut limbs[at];
        limb.used = true;
        let (entry, exit) = (usize::from(enters_by_tail), usize::from(!enters_by_tail));
        line.extend(limb.ends[entry].knots.iter().rev());
        let mut inner: Vec<Knot> =
            limb.points.iter().map(|at| Knot { at: *at, corner: false }).collect();
        if enters_by_tail {
            inner.reverse();
        }
        line.extend(inner);
        line.extend(limb.ends[exit].knots.iter());
        let next = limb.ends[exit].next;
        if let Some((next, by_tail)) = next.filter(|(next, _)| !limbs[*next].used) {
            (at, enters_by_tail) = (next, by_tail);
            continue;
        }
        line.dedup_by(|a, b| {
            let same = near(a.at, b.at, 1e-9);
            b.corner |= same && a.corner;
            same
        });
        return line;
    }
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn near(a: [f64; 2], b: [f64; 2], reach: f64) -> bool {
    libm::hypot(a[0] - b[0], a[1] - b[1]) <= reach
}
