//! Arcs: the curve behind the sampled points of a stroke font.
//!
//! A font of straight moves shows its corners where it is written large. Between corners, a vertex
//! has the tangent of the circle through it and its neighbors, and two vertices are joined by a
//! cubic with these tangents (Hermite), cut into short moves.

use super::vector::{ahead, counts, direction, dot, legs};
use noctograph_core::geometry::distance;

/// Cosine of the turn from which a vertex is a corner. The curves of the Hershey fonts turn by up
/// to 53° at a vertex (s), their corners by 63° (?) and more.
const CORNER_COS: f64 = 0.5;

/// Length of a move, in cap heights, from which it is a stem, not a piece of a curve, if it is
/// `STEM` times as long as a neighbor: the stem of J. The longest pieces of a curve are 0.24 (O).
const LONG: f64 = 5.5 / 21.0;
const STEM: f64 = 1.8;

/// Largest turn between two moves of a curve: one of the O lies within 0.3 mm a meter of its
/// height.
const STEP_RAD: f64 = 7.5 * std::f64::consts::PI / 180.0;

/// A run of points with its curves; a closed one stays closed, and all its points stay on it.
pub(super) fn rounded(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let (n, closed) = (points.len() - 1, points[0] == points[points.len() - 1]);
    let along: Vec<[f64; 2]> = legs(points).map(|[from, to]| direction(from, to)).collect();
    let lengths: Vec<f64> = legs(points).map(|[from, to]| distance(from, to)).collect();
    if n < 2 || lengths.contains(&0.0) {
        return points.to_vec();
    }
    let neighbors = Vec::from_iter((0..n).map(|leg| {
        let before = (leg > 0 || closed).then_some((leg + n - 1) % n);
        [before, (leg + 1 < n || closed).then_some((leg + 1) % n)]
    }));
    let stems = Vec::from_iter((0..n).map(|leg| {
        let beside = neighbors[leg].into_iter().flatten().map(|leg| lengths[leg]);
        lengths[leg] >= LONG && lengths[leg] >= STEM * beside.fold(f64::INFINITY, f64::min)
    }));
    // The tangent at the end of a leg; `None` at a corner, or where the run ends.
    let tangents = Vec::from_iter((0..n).map(|leg| {
        let next = neighbors[leg][1]?;
        let corner = dot(along[leg], along[next]) <= CORNER_COS
            || (lengths[leg] >= LONG && lengths[next] >= LONG);
        match (stems[leg], stems[next]) {
            _ if corner => None,
            (true, true) => None,
            (true, false) => Some(along[leg]),
            (false, true) => Some(along[next]),
            (false, false) => {
                let sum = ahead([0.0; 2], along[leg], lengths[next]);
                Some(direction([0.0; 2], ahead(sum, along[next], lengths[leg])))
            }
        }
    }));
    let mut curve = vec![points[0]];
    for leg in 0..n {
        let (from, to, chord) = (points[leg], points[leg + 1], along[leg]);
        // An arc of a circle begins as it ends, mirrored at its chord.
        let (begin, end) = (neighbors[leg][0].and_then(|leg| tangents[leg]), tangents[leg]);
        let [mirrored_begin, mirrored_end] = [begin, end]
            .map(|tangent| tangent.map(|t| ahead(t.map(|x| -x), chord, 2.0 * dot(t, chord))));
        let ends = begin.or(mirrored_end).zip(end.or(mirrored_begin));
        if let Some((begin, end)) = ends.filter(|_| !stems[leg]) {
            let halves = [begin, end].map(|t| libm::acos(dot(t, chord).clamp(-1.0, 1.0)));
            let turn = halves[0] + halves[1];
            let pieces = (turn / STEP_RAD - 1e-6).ceil();
            // With tangents of this length its middle is that of an arc.
            let reach = lengths[leg] / libm::pow(libm::cos(0.25 * turn), 2.0);
            for t in counts(pieces).skip(1).map(|k| k / pieces) {
                let (rise, from_rise, to_rise) =
                    (t * t * (3.0 - 2.0 * t), t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0));
                let point = ahead(from, chord, rise * lengths[leg]);
                let point = ahead(point, begin, from_rise * reach);
                curve.push(ahead(point, end, to_rise * reach));
            }
        }
        curve.push(to);
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_circle_become_the_circle() {
        let run = Vec::from_iter((0..=12).map(|k: i32| {
            let (sin, cos) = libm::sincos(f64::from(k % 12) * std::f64::consts::TAU / 12.0);
            [0.4 * cos, 0.4 * sin]
        }));
        let curve = rounded(&run);
        assert_eq!((curve[0], curve.len()), (curve[curve.len() - 1], 12 * 4 + 1), "closed");
        let radial_error = |p: &[f64; 2]| (libm::hypot(p[0], p[1]) - 0.4).abs();
        assert!(curve.iter().map(radial_error).fold(0.0, f64::max) < 1e-5, "0.01 mm a meter");
        // Four of its points are an arc: an open end goes on as the curve does.
        assert!(rounded(&run[..4]).iter().map(radial_error).fold(0.0, f64::max) < 1e-5);
    }

    #[test]
    fn corners_stems_and_dots_stay() {
        let seven = [[0.7, 1.0], [0.2, 0.0], [0.9, 0.0]];
        assert_eq!(rounded(&seven), seven, "a corner");
        let y = [[0.0, 1.0], [0.38, 0.52], [0.38, 0.0]];
        assert_eq!(rounded(&y), y, "a bend of two long strokes");
        let dot = [[0.1, 0.01], [0.1, 0.0]];
        assert_eq!(rounded(&dot), dot);
        // J: a straight stem, then a hook.
        let j = [[0.57, 1.0], [0.57, 0.24], [0.52, 0.1], [0.48, 0.05], [0.38, 0.0]];
        let curve = rounded(&j);
        assert_eq!(curve[..2], j[..2], "the stem");
        assert!(curve.len() > j.len() + 3 && curve[2][0] > 0.565, "tangent to it: {curve:?}");
        assert!(j.iter().all(|point| curve.contains(point)), "through all points");
    }
}
