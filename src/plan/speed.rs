//! Speed of the pen along a polyline, which is the stroke speed times each segment's pace, but
//! lower near corners that are too sharp for it.
//!
//! The pen slows at corners that turn the velocity by more than the smoothing permits. Two passes
//! along the path enforce the acceleration limit.

use nalgebra::Vector2;

use super::pen::PenStroke;
use super::smoothing::Smoothing;

/// Point of the path, and the speed there. The acceleration is constant between two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) position_m: Vector2<f64>,
    pub(super) speed_m_s: f64,
}

/// Maximum distance in m between nodes on a path whose speed changes, and their maximum number.
const STEP_M: f64 = 0.005;
const MAX_NODES: f64 = 100_000.0;
/// Maximum distance between nodes, relative to the length for which the slowest corner slows the
/// drone.
const NODES_STEP: f64 = 0.25;
/// Multiple of the longer average's duration for which a corner's speed is held before and after
/// it, because nothing else may change the velocity within the average.
const NEAR: f64 = 1.05;
/// Factor by which each step slows a corner, and maximum number of steps (down to 1 %).
const SLOWDOWN: f64 = 0.95;
const MAX_SLOWDOWNS: usize = 90;
/// Relative tolerance of the permitted turn, for rounding errors.
const ROUNDING: f64 = 1e-9;

/// Returns nodes along a stroke with their speeds, which respect corners, paces and the
/// acceleration limit. The nodes are its corners if the speed is constant, and are closely spaced
/// otherwise.
pub(super) fn profile(
    stroke: &PenStroke,
    smoothing: &Smoothing,
    stroke_speed_m_s: f64,
) -> Vec<Node> {
    let PenStroke { points_m, paces, .. } = stroke;
    let corners = Corners::new(points_m);
    let caps_m_s = corners.caps_m_s(stroke_speed_m_s, smoothing);
    let node = |position_m, pace: f64| Node { position_m, speed_m_s: pace * stroke_speed_m_s };
    // Most strokes have a constant speed, and therefore need no nodes between their corners.
    if caps_m_s.iter().all(|cap| *cap >= stroke_speed_m_s) && paces.iter().all(|p| *p == 1.0) {
        return points_m.iter().map(|point| node(*point, 1.0)).collect();
    }
    // The nodes are so close together that a slow corner affects only its neighborhood.
    let slowest_m_s = caps_m_s.iter().copied().fold(stroke_speed_m_s, f64::min);
    let near_s = NEAR * smoothing.long_s;
    let total_m = corners.distances_m[corners.distances_m.len() - 1];
    let step_m = (NODES_STEP * slowest_m_s * near_s).min(STEP_M).max(total_m / MAX_NODES);
    let mut nodes: Vec<Node> = Vec::new();
    let mut distances_m: Vec<f64> = Vec::new();
    for (index, ends) in points_m.windows(2).enumerate() {
        let length_m = corners.distances_m[index + 1] - corners.distances_m[index];
        let n_pieces = (length_m / step_m).ceil().max(1.0);
        for k in (0..).map(f64::from).take_while(|k| *k < n_pieces) {
            nodes.push(node(ends[0].lerp(&ends[1], k / n_pieces), paces[index]));
            distances_m.push(corners.distances_m[index] + length_m * k / n_pieces);
        }
    }
    nodes.push(node(points_m[points_m.len() - 1], paces[paces.len() - 1]));
    distances_m.push(total_m);
    corners.slow_down(&mut nodes, &distances_m, &caps_m_s, near_s);
    limit_acceleration(smoothing.acceleration_m_s2(), &mut nodes, &distances_m);
    nodes
}

/// Corners of a path, with their distances along it in m.
struct Corners {
    distances_m: Vec<f64>,
    /// Change of the unit tangent at each corner, from 0 to 2, which is 0 at both ends of the path.
    turn: Vec<f64>,
}

impl Corners {
    /// Measures the distance of each corner of a polyline from its beginning in m, and the change
    /// of direction there (the length of the difference of the unit vectors).
    fn new(points_m: &[Vector2<f64>]) -> Self {
        let along = |pair: &[Vector2<f64>]| (pair[1] - pair[0]).normalize();
        let (mut distances_m, mut turn) = (vec![0.0], vec![0.0]);
        for pair in points_m.windows(2) {
            distances_m.push(distances_m[distances_m.len() - 1] + (pair[1] - pair[0]).norm());
        }
        let corners = points_m.windows(3);
        turn.extend(corners.map(|three| (along(&three[1..]) - along(three)).norm()));
        turn.push(0.0);
        Self { distances_m, turn }
    }

    /// Returns the maximum speed in m/s at each corner at which neighboring corners together do not
    /// turn the velocity too far. Speeds are lowered by [`SLOWDOWN`] until that is the case.
    fn caps_m_s(&self, fastest_m_s: f64, smoothing: &Smoothing) -> Vec<f64> {
        let n = self.distances_m.len();
        let mut caps_m_s = vec![fastest_m_s; n];
        for _ in 0..MAX_SLOWDOWNS {
            // The turns of corners within one averaging time of each other add up.
            let mut turns_too_far = vec![false; n];
            for first in 1..n {
                let speed_m_s = caps_m_s[first];
                let until_m = self.distances_m[first] + speed_m_s * smoothing.long_s;
                let end =
                    first + self.distances_m[first..].partition_point(|node_m| *node_m <= until_m);
                let turn: f64 = self.turn[first..end].iter().sum();
                if turn * speed_m_s > smoothing.turn_m_s * (1.0 + ROUNDING) {
                    turns_too_far[first..end].fill(true);
                }
            }
            if !turns_too_far.contains(&true) {
                break;
            }
            for (cap, _) in caps_m_s.iter_mut().zip(&turns_too_far).filter(|(_, too_far)| **too_far)
            {
                *cap *= SLOWDOWN;
            }
        }
        caps_m_s
    }

    /// Limits each node within the averaging time `near_s` of a corner to the corner's speed.
    fn slow_down(&self, nodes: &mut [Node], distances_m: &[f64], caps_m_s: &[f64], near_s: f64) {
        for (corner, cap_m_s) in caps_m_s.iter().enumerate().filter(|(i, _)| self.turn[*i] > 0.0) {
            let (corner_m, reach_m) = (self.distances_m[corner], cap_m_s * near_s);
            let first = distances_m.partition_point(|node_m| *node_m < corner_m - reach_m);
            let end = distances_m.partition_point(|node_m| *node_m <= corner_m + reach_m);
            for node in &mut nodes[first..end] {
                node.speed_m_s = node.speed_m_s.min(*cap_m_s);
            }
        }
    }
}

/// Lowers the speeds of nodes to the acceleration limit, forward and backward along the path.
/// `distances_m` contains the distance of each node from the stroke's beginning.
fn limit_acceleration(acceleration_m_s2: f64, nodes: &mut [Node], distances_m: &[f64]) {
    let n = nodes.len();
    let onward = (1..n).map(|i| (i - 1, i));
    let backward = (1..n).rev().map(|i| (i, i - 1));
    for (from, to) in onward.chain(backward) {
        // The speed after a length s is given by v² = v₀² + 2 a s.
        let (from_m_s, length_m) =
            (nodes[from].speed_m_s, (distances_m[to] - distances_m[from]).abs());
        let most_m_s = (from_m_s * from_m_s + 2.0 * acceleration_m_s2 * length_m).sqrt();
        nodes[to].speed_m_s = nodes[to].speed_m_s.min(most_m_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EvenStyle;

    #[test]
    fn only_a_corner_that_turns_too_far_is_slowed_and_no_more_than_needed() {
        let smoothing = Smoothing::new(0.5, &EvenStyle::default());
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.01], [0.0, 0.02]].map(Vector2::from);
        let caps = Corners::new(&points).caps_m_s(0.5, &smoothing);
        assert_eq!(caps[1], 0.5, "a degree and a half is no corner");
        let ideal = smoothing.turn_m_s / 2.0;
        assert!(caps[2] <= ideal && caps[2] > SLOWDOWN * ideal * 0.99, "{caps:?}, ideal {ideal}");
    }

    #[test]
    fn speeds_rise_and_fall_with_the_acceleration() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]].map(Vector2::from);
        let stroke = PenStroke::even(0, points.to_vec());
        let nodes = profile(&stroke, &Smoothing::new(0.5, &EvenStyle::default()), 0.5);
        let mut fastest = 0.0_f64;
        for pair in nodes.windows(2) {
            let length_m = (pair[1].position_m - pair[0].position_m).norm();
            let [from, to] = [pair[0], pair[1]].map(|node| node.speed_m_s * node.speed_m_s);
            assert!((to - from).abs() <= 2.0 * 2.0 * length_m + 1e-12, "{pair:?}");
            fastest = fastest.max(pair[0].speed_m_s);
        }
        assert_eq!(fastest, 0.5);
    }

    #[test]
    fn segments_keep_their_pace_but_for_the_way_to_speed_up() {
        let points = [0.0, 1.0, 2.0].map(|x| Vector2::new(x, 0.0)).to_vec();
        let mut stroke = PenStroke::even(0, points);
        stroke.paces[1] = 0.5;
        let nodes = profile(&stroke, &Smoothing::new(0.5, &EvenStyle::default()), 0.5);
        // At 2 m/s², the change from 0.25 to 0.5 m/s takes 47 mm.
        let speed_at = |x| nodes.iter().find(|node| node.position_m.x >= x).unwrap().speed_m_s;
        assert_eq!([0.0, 0.95, 1.0, 1.9].map(speed_at), [0.5, 0.5, 0.25, 0.25]);
        assert!(speed_at(0.98) < 0.4, "braked before the slow segment: {}", speed_at(0.98));
    }
}
