//! Plane vectors, as kurbo's types and as pairs of coordinates.

use kurbo::{Point, Vec2};
use noctograph_core::geometry::distance;

/// Polylines.
pub(super) type Lines = Vec<Vec<Point>>;

/// Returns the length of a vector, computed by libm like [`distance`]. kurbo rounds differently.
pub(super) fn length(vector: Vec2) -> f64 {
    libm::hypot(vector.x, vector.y)
}

/// Returns the unit vector in the direction of a vector, or zero for a zero vector.
pub(super) fn unit(vector: Vec2) -> Vec2 {
    let length = length(vector).max(f64::MIN_POSITIVE);
    Vec2::new(vector.x / length, vector.y / length)
}

/// Converts a pair of coordinates to a point.
pub(super) fn point([x, y]: [f64; 2]) -> Point {
    Point::new(x, y)
}

/// Converts a point to a pair of coordinates.
pub(super) fn coordinates(point: Point) -> [f64; 2] {
    [point.x, point.y]
}

/// Converts the points of polylines to pairs of coordinates.
pub(super) fn pairs(lines: Lines) -> Vec<Vec<[f64; 2]>> {
    lines.into_iter().map(|line| line.into_iter().map(coordinates).collect()).collect()
}

/// Returns the unit vector from one point to another, or zero if the points are equal.
pub(super) fn direction(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    let length = distance(from, to).max(f64::MIN_POSITIVE);
    [0, 1].map(|i| (to[i] - from[i]) / length)
}

/// Returns the sum of a point and `length` times a direction. For a unit vector, this is the point
/// at that distance.
pub(super) fn ahead(from: [f64; 2], direction: [f64; 2], length: f64) -> [f64; 2] {
    [0, 1].map(|i| from[i] + length * direction[i])
}

/// Returns the point at a given fraction of the way from one point to another.
pub(super) fn between(from: [f64; 2], to: [f64; 2], fraction: f64) -> [f64; 2] {
    [0, 1].map(|i| from[i] + fraction * (to[i] - from[i]))
}

/// Returns the vector from `b` to `a`.
pub(super) fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Returns the dot product.
pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Returns the cross product, which is twice the signed area between two vectors. The product is
/// positive if `b` is to the left of `a`.
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Returns the mean of points, of which there must be at least one.
pub(super) fn mean(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|i| points.iter().map(|point| point[i]).sum::<f64>() / points.len() as f64)
}

/// Returns the segments of a line, from each of its points to the next.
pub(super) fn segments(line: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    line.windows(2).map(|pair| [pair[0], pair[1]])
}

/// Returns the integers 0, 1, 2 and so on below `n`, as floats.
pub(super) fn integers_below(n: f64) -> impl Iterator<Item = f64> {
    (0_u32..).map(f64::from).take_while(move |k| *k < n)
}

/// True if the ends of a line coincide.
pub(super) fn is_closed(line: &[[f64; 2]]) -> bool {
    line.first() == line.last()
}
