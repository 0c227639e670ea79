//! Vectors in a plane, as pairs.

use noctograph_core::geometry::distance;

/// Unit vector from one point to another; zero where they are one.
pub(super) fn direction(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let length = distance(from, to).max(f64::MIN_POSITIVE);
    [0, 1].map(|i| (to[i] - from[i]) / length)
}

/// The point a length ahead of another in a direction.
pub(super) fn ahead(from: [f64; 2], direction: [f64; 2], length: f64) -> [f64; 2] {
    [0, 1].map(|i| from[i] + length * direction[i])
}

/// The point at a share of the way from one point to another.
pub(super) fn between(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    [0, 1].map(|i| from[i] + share * (to[i] - from[i]))
}

pub(super) fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Twice the area of the triangle that two vectors span, positive where the second is to the left.
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn mean(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| points.iter().map(|point| point[i]).sum::<f64>() / points.len() as f64)
}

/// The legs of a line: from each of its points to the next.
pub(super) fn legs(line: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    line.windows(2).map(|leg| [leg[0], leg[1]])
}

/// 0, 1, 2 and so on, as long as they are less than a number.
pub(super) fn counts(n: f64) -> impl Iterator<Item = f64> {
    (0_u32..).map(f64::from).take_while(move |k| *k < n)
}

/// Whether a closed line: one whose ends meet.
pub(super) fn is_closed(line: &[[f64; 2]]) -> bool {
    line.first() == line.last()
}
