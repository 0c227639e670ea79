//! Prunes spurs: branches of the medial axis into corners and ripples, which no pen would draw.

use super::super::vector::{direction, dot};
use super::axis::{Axis, Path};
use noctograph_core::files::Budget;
use noctograph_core::statistics::median;

/// Budget steps for visiting a node.
const STEPS_PER_NODE: usize = 10;

/// Protrusions of a spur, relative to the radius at its root, below which the spur is a ripple of
/// the outline and a stroke's end, respectively. It is 0.41 in a square end and 0 in a round one.
const RIPPLE: f64 = 0.02;
const BLUNT: f64 = 0.46;

/// Fraction of the radius at its root below which a spur's final radius indicates a corner.
const SHARP: f64 = 0.45;

/// Maximum length of a spur into a corner, relative to the radius at its root: 1 / sin of half the
/// corner's angle. The value 3.6 corresponds to 32°, which is sharper than the flat end of a
/// slanted stroke (K, X: 35° to 50°) and blunter than a tapering stroke.
const LONGEST: f64 = 3.6;

/// Maximum final radius, relative to the radius at its root, of a longer spur that belongs to a
/// corner. The arm of a cross drawn by a fine pen is blunter.
const POINTED: f64 = 0.25;
const ARM: f64 = 0.6;

/// Minimum protrusion of a spur into a corner at which the line bends: that of a 130° corner.
const BENDS: f64 = 0.1;

/// Ratios to a path's median radius. An end whose radius is below the first ratio is a tip, and is
/// cut off up to where the radius reaches the second ratio.
const TIP: [f64; 2] = [0.6, 0.92];

/// Maximum length of a stub from a crotch to the tip above it (A, M, N, V, W), in radii at its
/// root: a factor for the value computed from the angle of its arms, and an addend.
const STUB: [f64; 2] = [1.3, 1.4];
/// Limits for sharp tips: if the cosine between stub and arm exceeds the first value, the limit is
/// at least the second. It grows by the third per unit of the cosine, up to the last.
const SHARP_STUB: [f64; 4] = [0.82, 2.4, 21.0, 4.5];
/// Length over which the direction of an arm is measured, in radii at its root.
const HEADING: f64 = 2.5;
/// Cosine of the maximum angle between the arms of a crotch, 75°, and maximum difference of the
/// cosines between the stub and its arms. At wider angles, an arch branches off a stem (n, u). A
/// stub in line with one arm is the end of a stem.
const CROTCH: f64 = 0.26;
const ASKEW: f64 = 0.2;

/// Cuts off all spurs. Returns true for each node at which a line bends because the node's spur
/// belonged to a corner.
pub(super) fn prune(axis: &mut Axis, budget: &Budget) -> Vec<bool> {
    let mut bends = vec![false; axis.middles.len()];
    // Ripples are cut first because they split branches. Spurs of each kind are cut until none is
    // left.
    let kinds: [fn(&Axis, &Path) -> bool; 3] =
        [|axis, spur| protrusion(axis, spur) < RIPPLE, is_spur, is_stub];
    for is_unwanted in kinds {
        while spend_walks(axis, budget) && cut_spurs(axis, &mut bends, is_unwanted) {}
    }
    cut_tips(axis);
    bends
}

/// Charges the walks from all loose ends to the budget. Returns false if the budget is spent. A
/// walk stops at the first junction, so all walks together visit each node about once. Each walk
/// costs as much as ten further nodes.
fn spend_walks(axis: &Axis, budget: &Budget) -> bool {
    let ends = (0..axis.middles.len()).filter(|node| axis.degree(*node) == 1);
    budget.spend_steps(STEPS_PER_NODE * (axis.middles.len() + 10 * ends.count()))
}

/// Cuts off the tapering ends of paths, up to where the width is nearly typical.
fn cut_tips(axis: &mut Axis) {
    let ends = (0..axis.middles.len()).filter(|node| axis.degree(*node) == 1);
    let tips = ends.filter_map(|end| {
        let path = axis.path(end, axis.neighbors[end][0], &|node| axis.degree(node) != 2);
        let median_radius = median(path.iter().map(|node| axis.radii[*node]))?;
        let wide = path.iter().position(|node| axis.radii[*node] >= TIP[1] * median_radius)?;
        let tip = path[..=wide].to_vec();
        let is_tip =
            axis.radii[end] < TIP[0] * median_radius && axis.length(&tip) < LONGEST * median_radius;
        (is_tip && wide + 1 < path.len()).then_some(tip)
    });
    for tip in tips.collect::<Vec<Path>>() {
        axis.cut(&tip);
    }
}

/// Cuts off the unwanted paths from a junction to a loose end. Returns true if there were any.
fn cut_spurs(axis: &mut Axis, bends: &mut [bool], unwanted: impl Fn(&Axis, &Path) -> bool) -> bool {
    let ends = (0..axis.middles.len()).filter(|node| axis.degree(*node) == 1);
    let spurs = Vec::from_iter(ends.filter_map(|end| {
        let mut path = axis.path(end, axis.neighbors[end][0], &|node| axis.degree(node) != 2);
        path.reverse();
        (axis.degree(path[0]) > 2 && unwanted(axis, &path)).then_some(path)
    }));
    for spur in &spurs {
        bends[spur[0]] |= protrusion(axis, spur) > BENDS;
        axis.cut(spur);
    }
    !spurs.is_empty()
}

/// Returns the length by which the disc at a spur's end protrudes from the disc at its root,
/// relative to the root's radius.
fn protrusion(axis: &Axis, spur: &Path) -> f64 {
    let [root, end] = [spur[0], spur[spur.len() - 1]].map(|node| axis.radii[node]);
    (axis.length(spur) + end - root) / root
}

/// True for a spur into a corner of the outline or into the blunt end of a stroke.
fn is_spur(axis: &Axis, spur: &Path) -> bool {
    let [root, end] = [spur[0], spur[spur.len() - 1]].map(|node| axis.radii[node]);
    let is_corner = end < SHARP * root && axis.length(spur) < LONGEST * root;
    let protrusion = protrusion(axis, spur);
    is_corner && (end < POINTED * root || protrusion < ARM) || protrusion < BLUNT
}

/// True for a stub: a short spur from the crotch of two arms to the tip above it.
fn is_stub(axis: &Axis, spur: &Path) -> bool {
    let (root, radius) = (spur[0], axis.radii[spur[0]]);
    let tip = spur[spur.len() - 1];
    let end_radius = axis.radii[tip];
    let arms = axis.neighbors[root].iter().filter(|node| **node != spur[1]);
    let arms: Vec<[f64; 2]> = arms.map(|arm| axis.heading(root, *arm, HEADING * radius)).collect();
    let [a, b] = &arms[..] else { return false };
    let cosine = dot(*a, *b);
    let away = direction(axis.middles[root], axis.middles[tip]);
    let askew = (dot(away, *a) - dot(away, *b)).abs();
    // `sine` is that of half the angle between the arms, and is limited for parallel arms. The disc
    // in the crotch touches the inner corner and both outer sides.
    let sine = ((1.0 - cosine) / 2.0).max(0.01).sqrt();
    let by_angle = STUB[0] * (1.0 - sine) / (2.0 * sine) + STUB[1];
    let [least_cosine, least, slope, most] = SHARP_STUB;
    let excess = -dot(away, *a).max(dot(away, *b)) - least_cosine;
    let by_direction = if excess > 0.0 { (least + slope * excess).min(most) } else { 0.0 };
    let longest = by_angle.max(by_direction);
    end_radius < radius && axis.length(spur) < longest * radius && cosine > CROTCH && askew < ASKEW
}
