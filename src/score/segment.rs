//! Straight strokes on a page, in pixels.

use super::raster::whole;
use noctograph_core::geometry::segment_distance;

/// Turns sharper than this end a stroke: 40 degrees. Polygons for round letters turn by less.
pub(super) const CORNER_RAD: f64 = 40.0 * core::f64::consts::PI / 180.0;

/// From a point to a point.
pub(super) type Segment = [[f64; 2]; 2];

/// Distance of a point from the nearest of some segments.
pub(super) fn distance(point: [f64; 2], segments: &[Segment]) -> f64 {
    let from_one = |segment: &Segment| segment_distance(point, *segment);
    segments.iter().map(from_one).fold(f64::INFINITY, f64::min)
}

/// Points of a segment, a pixel apart.
pub(super) fn walk([from, to]: Segment) -> impl Iterator<Item = [f64; 2]> {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let n_steps = whole(libm::hypot(dx, dy).ceil());
    (0..n_steps).map(move |step| {
        let part = (step as f64 + 0.5) / n_steps as f64;
        [from[0] + part * dx, from[1] + part * dy]
    })
}

/// Angle between two segments of a run of the pen, 0 to π.
pub(super) fn turn(a: Segment, b: Segment) -> f64 {
    let [a, b] = [a, b].map(|[from, to]| [to[0] - from[0], to[1] - from[1]]);
    libm::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]).abs()
}

/// Unit vector across a segment, to its left on the page.
pub(super) fn normal([from, to]: Segment) -> [f64; 2] {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let length = libm::hypot(dx, dy);
    [-dy / length, dx / length]
}
