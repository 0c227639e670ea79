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

pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn mean(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| points.iter().map(|point| point[i]).sum::<f64>() / points.len() as f64)
}
