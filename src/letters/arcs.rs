//! Restores curves from their samples, the points of a stroke font.
//!
//! At a vertex that is not a corner, the tangent is that of the circle through it and its
//! neighbors. Neighboring vertices are joined by cubic Hermite curves, which are split into moves.

use kurbo::{Point, Vec2};

use super::vector::{integers_below, length, unit};

/// Cosine of the minimum turn at a corner. In the Hershey fonts, curves turn by up to 53° at a
/// vertex (in "s"), and corners by at least 63° (in "?").
const CORNER_COS: f64 = 0.5;

/// Minimum length of a stem (as in J), in cap heights and relative to the shorter neighboring
/// chord. The longest chords of a curve are 0.24 cap heights long (in O).
const STEM_LENGTH: f64 = 5.5 / 21.0;
const STEM_RATIO: f64 = 1.8;

/// Maximum turn between two moves of a curve. An O then deviates by less than 0.3 mm per meter of
/// its height.
const STEP_RAD: f64 = 7.5 * std::f64::consts::PI / 180.0;

/// A straight line between two points of the font.
struct Chord {
    direction: Vec2,
    length: f64,
    /// Indices of the previous and the next chord.
    neighbors: [Option<usize>; 2],
}

/// Returns the polyline of a run of samples with arcs inserted between them, except at corners and
/// along stems. The polyline passes through all samples, and is closed if the run is closed. A run
/// of two samples, or with a repeated sample, is returned unchanged.
pub(super) fn with_arcs(points: &[Point]) -> Vec<Point> {
    let (n, closed) = (points.len() - 1, points[0] == points[points.len() - 1]);
    let chords = Vec::from_iter((0..n).map(|index| {
        let along = points[index + 1] - points[index];
        let before = (index > 0 || closed).then_some((index + n - 1) % n);
        let after = (index + 1 < n || closed).then_some((index + 1) % n);
        Chord { direction: unit(along), length: length(along), neighbors: [before, after] }
    }));
    if n < 2 || chords.iter().any(|chord| chord.length == 0.0) {
        return points.to_vec();
    }
    let is_stem = Vec::from_iter(chords.iter().map(|chord| {
        let lengths = chord.neighbors.into_iter().flatten().map(|index| chords[index].length);
        let shorter = lengths.fold(f64::INFINITY, f64::min);
        chord.length >= STEM_LENGTH && chord.length >= STEM_RATIO * shorter
    }));
    let tangents = Vec::from_iter((0..n).map(|index| tangent(index, &chords, &is_stem)));
    let mut curve = vec![points[0]];
    for (index, chord) in chords.iter().enumerate() {
        // At a corner, the tangent at the chord's other end is mirrored about the chord, which
        // makes the curve a circular arc.
        let begin = chord.neighbors[0].and_then(|before| tangents[before]);
        let end = tangents[index];
        let mirrored = [begin, end]
            .map(|tangent| tangent.map(|t| -t + chord.direction * (2.0 * t.dot(chord.direction))));
        let end_tangents = begin.or(mirrored[1]).zip(end.or(mirrored[0]));
        if let Some(end_tangents) = end_tangents.filter(|_| !is_stem[index]) {
            add_arc(&mut curve, chord, end_tangents);
        }
        curve.push(points[index + 1]);
    }
    curve
}

/// Returns the unit tangent at the end of the chord `index`, or `None` at a corner and at the end
/// of the run. `is_stem` says for each chord whether it is a long straight side.
fn tangent(index: usize, chords: &[Chord], is_stem: &[bool]) -> Option<Vec2> {
    let (chord, after) = (&chords[index], chords[index].neighbors[1]?);
    let next = &chords[after];
    let is_corner = chord.direction.dot(next.direction) <= CORNER_COS
        || (chord.length >= STEM_LENGTH && next.length >= STEM_LENGTH);
    match (is_stem[index], is_stem[after]) {
        _ if is_corner => None,
        (true, true) => None,
        // A curve is tangent to a stem at both of its ends.
        (true, false) => Some(chord.direction),
        (false, true) => Some(next.direction),
        // The tangent of the circle through three points is the sum of the directions of both
        // chords, each weighted by the other chord's length.
        (false, false) => Some(unit(chord.direction * next.length + next.direction * chord.length)),
    }
}

/// Appends the inner points of the cubic that spans a chord, given the unit tangents at its ends.
/// Neighboring points differ in direction by at most [`STEP_RAD`].
fn add_arc(curve: &mut Vec<Point>, chord: &Chord, (begin, end): (Vec2, Vec2)) {
    let from = curve[curve.len() - 1];
    let turns = [begin, end].map(|t| libm::acos(t.dot(chord.direction).clamp(-1.0, 1.0)));
    let turn = turns[0] + turns[1];
    /// Fraction of a step that keeps rounding from creating an extra piece.
    const SLACK: f64 = 1e-6;
    let n_pieces = (turn / STEP_RAD - SLACK).ceil();
    // With tangents of this length, the cubic passes through the midpoint of a circular arc.
    let tangent_length = chord.length / libm::pow(libm::cos(0.25 * turn), 2.0);
    for t in integers_below(n_pieces).skip(1).map(|k| k / n_pieces) {
        // The Hermite basis functions: h01 for the end point, h10 and h11 for the tangents.
        let (h01, h10, h11) =
            (t * t * (3.0 - 2.0 * t), t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0));
        let on_chord = from + chord.direction * (h01 * chord.length);
        curve.push(on_chord + begin * (h10 * tangent_length) + end * (h11 * tangent_length));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_circle_become_the_circle() {
        let run = Vec::from_iter((0..=12).map(|k: i32| {
            let (sin, cos) = libm::sincos(f64::from(k % 12) * std::f64::consts::TAU / 12.0);
            Point::new(0.4 * cos, 0.4 * sin)
        }));
        let curve = with_arcs(&run);
        assert_eq!((curve[0], curve.len()), (curve[curve.len() - 1], 12 * 4 + 1), "closed");
        let radial_error = |p: &Point| (length(p.to_vec2()) - 0.4).abs();
        assert!(curve.iter().map(radial_error).fold(0.0, f64::max) < 1e-5, "0.01 mm a meter");
        // Four of the points form an open arc, which is circular up to its ends.
        assert!(with_arcs(&run[..4]).iter().map(radial_error).fold(0.0, f64::max) < 1e-5);
    }

    #[test]
    fn corners_stems_and_dots_stay() {
        let seven = [(0.7, 1.0), (0.2, 0.0), (0.9, 0.0)].map(Point::from);
        assert_eq!(with_arcs(&seven), seven, "a corner");
        let y = [(0.0, 1.0), (0.38, 0.52), (0.38, 0.0)].map(Point::from);
        assert_eq!(with_arcs(&y), y, "a bend of two long strokes");
        let dot = [(0.1, 0.01), (0.1, 0.0)].map(Point::from);
        assert_eq!(with_arcs(&dot), dot);
        // J has a straight stem followed by a hook.
        let j =
            [(0.57, 1.0), (0.57, 0.24), (0.52, 0.1), (0.48, 0.05), (0.38, 0.0)].map(Point::from);
        let curve = with_arcs(&j);
        assert_eq!(curve[..2], j[..2], "the stem");
        assert!(curve.len() > j.len() + 3 && curve[2].x > 0.565, "tangent to it: {curve:?}");
        assert!(j.iter().all(|point| curve.contains(point)), "through all points");
    }
}
