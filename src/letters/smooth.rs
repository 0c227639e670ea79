//! Smooths a wobbling line by penalized least squares.
//!
//! The line z through evenly spaced points p minimizes Σ |z − p|² + λ Σ |z″|² (Whittaker 1923,
//! Eilers 2003). λ is the largest value tried that moves no point farther than the error allows.

use super::vector::{ahead, between, integers_below};
use noctograph_core::geometry::{arc_lengths, distance, simplify};

/// Values of λ that are tried, from stiff to loose.
const STIFFNESS: [f64; 9] = [1e7, 1e6, 1e5, 1e4, 1e3, 1e2, 1e1, 1.0, 0.1];

/// Maximum number of pieces into which a line is divided.
pub(super) const MAX_POINTS: usize = 4000;

/// Returns the line resampled at `spacing`, and smoothed as much as possible without moving a point
/// by more than `error`. `spacing` and `error` are in the line's unit. The ends of the line do not
/// move, and a closed line stays closed.
pub(super) fn smooth(line: &[[f64; 2]], spacing: f64, error: f64) -> Vec<[f64; 2]> {
    let even = evenly(line, spacing);
    // A line with fewer than five points has no bend to smooth.
    if even.len() < 5 {
        return even;
    }
    let closed = line.len() > 2 && line[0] == line[line.len() - 1];
    for stiffness in STIFFNESS {
        let smoothed =
            if closed { smooth_loop(&even, stiffness) } else { smooth_open(&even, stiffness) };
        let moved = smoothed.iter().zip(&even).map(|(a, b)| distance(*a, *b));
        if moved.fold(0.0, f64::max) <= error {
            return smoothed;
        }
    }
    even
}

/// Returns evenly spaced points along a line, including both ends. The points are at most `spacing`
/// apart, in the line's unit, unless this would require more than [`MAX_POINTS`] pieces.
pub(super) fn evenly(line: &[[f64; 2]], spacing: f64) -> Vec<[f64; 2]> {
    let along = arc_lengths(line);
    let (Some(&length), Some(&last)) = (along.last(), line.last()) else { return Vec::new() };
    let n_pieces = (length / spacing).ceil().clamp(1.0, MAX_POINTS as f64);
    let mut points = Vec::new();
    let mut index = 0;
    for k in integers_below(if line.len() > 1 { n_pieces } else { 0.0 }) {
        // Arc lengths increase, so a point's segment is never before that of the previous point.
        let arc_length = length * k / n_pieces;
        while index + 2 < line.len() && along[index + 1] < arc_length {
            index += 1;
        }
        let (begin, end) = (along[index], along[index + 1]);
        let fraction = (arc_length - begin) / (end - begin).max(f64::MIN_POSITIVE);
        points.push(between(line[index], line[index + 1], fraction.min(1.0)));
    }
    points.push(last);
    points
}

/// Returns a line without the points that are within `error` of the line through the others.
/// `error` is in the line's unit.
pub(super) fn simplified(line: &[[f64; 2]], error: f64) -> Vec<[f64; 2]> {
    simplify(line, error).into_iter().map(|index| line[index]).collect()
}

/// Returns the minimizer z of Σ |z − p|² + λ Σ |z″|² for evenly spaced points p and a stiffness λ,
/// with fixed ends.
fn smooth_open(points: &[[f64; 2]], stiffness: f64) -> Vec<[f64; 2]> {
    let n = points.len();
    let mut matrix = Banded::normal_matrix(n, stiffness);
    let mut z = [&[[0.0; 2]; 2], points, &[[0.0; 2]; 2]].concat();
    /// Weight that fixes the ends, as a multiple of all other weights.
    const PINNED: f64 = 1e9;
    let pin = PINNED * (1.0 + stiffness);
    for end in [2, n + 1] {
        matrix.diagonal[end] += pin;
        z[end] = z[end].map(|x| x * (1.0 + pin));
    }
    matrix.solve(&mut z);
    // The weight causes rounding errors at the ends, which are therefore set exactly.
    let mut z = z[2..n + 2].to_vec();
    (z[0], z[n - 1]) = (points[0], points[n - 1]);
    z
}

/// A symmetric matrix with two bands beside its diagonal. Two rows of the identity at either end
/// avoid special cases.
struct Banded {
    diagonal: Vec<f64>,
    /// Entries one and two columns before the diagonal, respectively.
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Banded {
    /// Returns the matrix of the normal equations (I + λ D'D) z = p for n points with second
    /// differences D and the stiffness λ. D'D has rows 1 −4 6 −4 1. Two rows without a point are
    /// added at each end.
    fn normal_matrix(n: usize, stiffness: f64) -> Self {
        let mut diagonal = vec![1.0; n + 4];
        let (mut first, mut second) = (vec![0.0; n + 4], vec![0.0; n + 4]);
        for k in 2..n {
            for (i, a) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                diagonal[k + i] += stiffness * a * a;
            }
            first[k + 1] -= 2.0 * stiffness;
            first[k + 2] -= 2.0 * stiffness;
            second[k + 2] += stiffness;
        }
        Self { diagonal, first, second }
    }

    /// Solves the equations for a right-hand side `z`, which is replaced by the solution.
    fn solve(self, z: &mut [[f64; 2]]) {
        let Self { mut diagonal, mut first, mut second } = self;
        let inner = 2..z.len() - 2;
        // The matrix is factored as L D L' in place, while L is solved row by row.
        for k in inner.clone() {
            second[k] /= diagonal[k - 2];
            first[k] = (first[k] - second[k] * diagonal[k - 2] * first[k - 1]) / diagonal[k - 1];
            diagonal[k] -= first[k] * first[k] * diagonal[k - 1];
            diagonal[k] -= second[k] * second[k] * diagonal[k - 2];
            z[k] = ahead(z[k], z[k - 1], -first[k]);
            z[k] = ahead(z[k], z[k - 2], -second[k]);
        }
        // D is solved next, followed by L' backward.
        for k in inner.clone() {
            z[k] = z[k].map(|x| x / diagonal[k]);
        }
        for k in inner.rev() {
            z[k] = ahead(z[k], z[k + 1], -first[k + 1]);
            z[k] = ahead(z[k], z[k + 2], -second[k + 2]);
        }
    }
}

/// Returns the smooth line through closed points for a stiffness λ, as in [`smooth_open`]. The loop
/// is solved as two rounds, of which the middle half is kept because the ends hardly affect it.
fn smooth_loop(points: &[[f64; 2]], stiffness: f64) -> Vec<[f64; 2]> {
    let n = points.len() - 1;
    let half = n / 2;
    let two_rounds: Vec<_> = (0..2 * n + 1).map(|k| points[(k + n - half) % n]).collect();
    let mut smoothed = smooth_open(&two_rounds, stiffness)[half..half + n].to_vec();
    smoothed.push(smoothed[0]);
    smoothed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smooth_line_solves_its_equations() {
        let points: Vec<[f64; 2]> =
            (0..30).map(|k| [f64::from(k), libm::sin(f64::from(k * k))]).collect();
        let stiffness = 7.0;
        let z = smooth_open(&points, stiffness);
        assert_eq!((z[0], z[29]), (points[0], points[29]), "the ends stay");
        let curve = |k: usize| z[k - 1][1] - 2.0 * z[k][1] + z[k + 1][1];
        for k in 2..28 {
            let gradient =
                z[k][1] - points[k][1] + stiffness * (curve(k - 1) - 2.0 * curve(k) + curve(k + 1));
            assert!(gradient.abs() < 1e-9, "row {k}: {gradient}");
        }
    }

    #[test]
    fn a_wobbling_circle_becomes_smooth_within_the_error() {
        let circle: Vec<[f64; 2]> = (0..=200)
            .map(|k| {
                let (sin, cos) = libm::sincos(f64::from(k % 200) * std::f64::consts::TAU / 200.0);
                let r = 1.0 + 0.002 * f64::from((k % 200) % 2);
                [r * cos, r * sin]
            })
            .collect();
        let smoothed = smooth(&circle, 0.03, 0.01);
        assert_eq!(smoothed[0], smoothed[smoothed.len() - 1], "closed");
        for [x, y] in smoothed {
            assert!((libm::hypot(x, y) - 1.001).abs() < 0.01, "{x} {y}");
        }
    }
}
