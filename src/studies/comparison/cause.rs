//! Finds the cause that explains most of the difference between two flights.

use nalgebra::Vector3;

use super::{FlightSample, mean};
use noctograph_plan::tracking::{DesignPath, MAX_LAG_S, minimize, spread_m2};

/// Averaging time for noise. A path error remains, because a 0.1 m stroke takes this long.
const SMOOTH_S: f64 = 0.5;

/// Maximum scale error of a positioning system. A larger value means that B flies a different path.
const MAX_SCALE: f64 = 0.5;

/// A cause of the difference of flight B from flight A, with its amount.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Discrepancy {
    /// Delay of B relative to A, s.
    Lag(f64),
    /// Displacement of B from A, m.
    Offset(Vector3<f64>),
    /// Fraction by which B is larger than A, about their common center.
    Scale(f64),
    /// Root mean square of B's slow deviation from A's path, m.
    Path(f64),
    /// Root mean square amplitude of B's fast oscillation about its path, m.
    Noise(f64),
}

/// Returns the single cause that explains the largest fraction of the mean square distance, and
/// that fraction. Returns `None` if the flights do not differ.
pub(super) fn main_cause(pairs: &[[FlightSample; 2]]) -> Option<(Discrepancy, f64)> {
    let differences: Vec<_> = pairs.iter().map(|[a, b]| b.position_m - a.position_m).collect();
    let total = power(&differences);
    if total == 0.0 {
        return None;
    }
    // The offset is the mean difference. The scale is fitted to the remaining differences as a
    // function of A's distance from its center.
    let middle = mean(pairs.iter().map(|[a, _]| a.position_m));
    let from_middle: Vec<_> = pairs.iter().map(|[a, _]| a.position_m - middle).collect();
    let offset = mean(differences.iter().copied());
    let centered: Vec<_> = differences.iter().map(|d| d - offset).collect();
    let (lag_s, moved) = lag(pairs);
    let scale =
        Some(fit(&centered, &from_middle)).filter(|by| by.abs() <= MAX_SCALE).unwrap_or(0.0);
    // After offset, lag and scale, the slow residual is the path error, and the fast one is noise.
    let mean_moved = mean(moved.iter().copied());
    let parts = centered.iter().zip(moved.iter().zip(&from_middle));
    let residuals: Vec<_> =
        parts.map(|(d, (moved, arm))| d - (moved - mean_moved) - arm * scale).collect();
    let slow = smoothed(pairs, &residuals);
    let fast: Vec<_> = residuals.iter().zip(&slow).map(|(d, slow)| d - slow).collect();
    let causes = [
        (Discrepancy::Lag(lag_s), power(&moved)),
        (Discrepancy::Offset(offset), offset.norm_squared()),
        (Discrepancy::Scale(scale), scale * scale * power(&from_middle)),
        (Discrepancy::Path(power(&slow).sqrt()), power(&slow)),
        (Discrepancy::Noise(power(&fast).sqrt()), power(&fast)),
    ];
    let fractions = causes.map(|(cause, power)| (cause, power / total));
    let largest = fractions.into_iter().max_by(|(_, a), (_, b)| a.total_cmp(b));
    largest.map(|(cause, fraction)| (cause, fraction.min(1.0)))
}

/// Returns the mean square length of vectors.
fn power(vectors: &[Vector3<f64>]) -> f64 {
    mean(vectors.iter().map(|v| v.component_mul(v))).sum()
}

/// Returns the factor without unit by which `along` best approximates `vectors` in the
/// least-squares sense, or 0 if all of `along` are 0.
fn fit(vectors: &[Vector3<f64>], along: &[Vector3<f64>]) -> f64 {
    // The factor is Σ v · a / Σ a².
    let (dot, square) = vectors
        .iter()
        .zip(along)
        .fold((0.0, 0.0), |(dot, square), (v, a)| (dot + v.dot(a), square + a.norm_squared()));
    if square > 0.0 { dot / square } else { 0.0 }
}

/// Returns the lag of B in s, positive if B is late, and A's displacement in m during that lag at
/// each pair. The lag is the time shift of A that best matches B except for a constant offset, as
/// with `--align flown`. It is 0 if no shift within [`MAX_LAG_S`] is a minimum.
fn lag(pairs: &[[FlightSample; 2]]) -> (f64, Vec<Vector3<f64>>) {
    let a = DesignPath::through(pairs.iter().map(|[a, _]| (a.time_s, a.position_m)));
    fn cost(a: &DesignPath, pairs: &[[FlightSample; 2]], lag_s: f64) -> f64 {
        let both = pairs.iter().zip(shifted(a, pairs, lag_s));
        spread_m2(both.map(|([_, b], a_m)| b.position_m - a_m))
    }
    let range_s = [-MAX_LAG_S, MAX_LAG_S];
    let best_s = minimize(range_s, |s| cost(&a, pairs, s));
    // At rest, every shift has the same cost. A shift within 1 ms of an end of the range is no
    // minimum.
    let is_best = best_s.abs() < MAX_LAG_S - 1e-3 && cost(&a, pairs, best_s) < cost(&a, pairs, 0.0);
    let lag_s = if is_best { best_s } else { 0.0 };
    let moved = pairs.iter().zip(shifted(&a, pairs, lag_s));
    (lag_s, moved.map(|([a, _], a_m)| a_m - a.position_m).collect())
}

/// Returns the positions in m on a path that is late by `lag_s`, at the times of the pairs.
fn shifted(
    path: &DesignPath,
    pairs: &[[FlightSample; 2]],
    lag_s: f64,
) -> impl Iterator<Item = Vector3<f64>> {
    let mut walk = path.walk();
    pairs.iter().map(move |[a, _]| walk.at_m(a.time_s - lag_s))
}

/// Returns the moving average of values over [`SMOOTH_S`], centered at each sample.
fn smoothed(pairs: &[[FlightSample; 2]], values: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    // The sum covers the samples `from..to` in the window, which moves forward.
    let (mut from, mut to, mut sum) = (0, 0, Vector3::zeros());
    let means = pairs.iter().map(|[middle, _]| {
        while to < values.len() && pairs[to][0].time_s <= middle.time_s + SMOOTH_S / 2.0 {
            sum += values[to];
            to += 1;
        }
        while pairs[from][0].time_s < middle.time_s - SMOOTH_S / 2.0 {
            sum -= values[from];
            from += 1;
        }
        sum / (to - from) as f64
    });
    means.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::constructed::{flight, square};
    use crate::comparison::{Alignment, ComparisonOptions, compare};
    use noctograph_plan::tracking::Part;

    /// Returns the main cause of the difference if B flies the square with a change.
    fn first_cause(change: impl Fn(f64) -> Vector3<f64>) -> (Discrepancy, f64) {
        let a = flight(0.01, 16.0, square, square);
        let b = flight(0.01, 16.0, change, square);
        let (part, alignment) = (Part::All, Alignment::Offset(0.0));
        let options = ComparisonOptions { part, alignment, ..Default::default() };
        compare(&a, &b, &options).unwrap().first.unwrap()
    }

    #[test]
    fn each_cause_is_found_with_its_amount() {
        // The longer lags span whole strokes, for which a delay differs from a displacement.
        for (late_s, within_s, least) in [
            (0.1, 1e-3, 0.99),
            (0.3, 2e-3, 0.97),
            (0.5, 2e-3, 0.97),
            (0.8, 2e-3, 0.97),
            (-0.5, 2e-3, 0.97),
        ] {
            let (lag, part) = first_cause(|t| square((t - late_s).max(0.0)));
            let is_right = matches!(lag, Discrepancy::Lag(s) if (s - late_s).abs() < within_s);
            assert!(is_right && part > least, "{late_s} s is {lag:?}, {part}");
        }
        let aside = Vector3::new(0.03, 0.0, -0.04);
        let (offset, part) = first_cause(|t| square(t) + aside);
        let is_right = matches!(offset, Discrepancy::Offset(m) if (m - aside).norm() < 1e-9);
        assert!(is_right && part > 0.99, "{offset:?}, {part}");
        let middle = Vector3::new(0.2, 0.0, 0.7);
        let (scale, part) = first_cause(|t| middle + (square(t) - middle) * 1.05);
        let is_right = matches!(scale, Discrepancy::Scale(s) if (s - 0.05).abs() < 1e-3);
        assert!(is_right && part > 0.99, "{scale:?}, {part}");
        let [(noise, noise_part), (path, path_part)] = [0.05, 2.9].map(|period_s| {
            let rate_rad_s = std::f64::consts::TAU / period_s;
            first_cause(|t| square(t) + Vector3::z() * (0.02 * libm::sin(rate_rad_s * t)))
        });
        assert!(matches!(noise, Discrepancy::Noise(m) if (m - 0.0141).abs() < 1e-3), "{noise:?}");
        assert!(matches!(path, Discrepancy::Path(m) if (m - 0.0141).abs() < 2e-3), "{path:?}");
        assert!(noise_part > 0.9 && path_part > 0.8, "{noise_part} {path_part}");
        // B is half as large and rotated by 180°, which no scale error explains.
        let (path, part) = first_cause(|t| middle + (square(t) - middle) * -0.5);
        assert!(matches!(path, Discrepancy::Path(_)) && part > 0.8, "{path:?}, {part}");
    }

    /// Returns the position on an L-shaped path, whose start and end differ.
    fn l(t: f64) -> Vector3<f64> {
        Vector3::new(0.2 * (t - 4.0).clamp(0.0, 2.0), 0.0, 1.0 - 0.2 * t.min(4.0))
    }

    #[test]
    fn a_lag_beside_the_path_has_its_own_amount() {
        for aside in
            [Vector3::zeros(), Vector3::new(0.03, 0.0, 0.02), Vector3::new(-0.02, 0.0, 0.0)]
        {
            let a = flight(0.01, 6.0, l, l);
            let b = flight(0.01, 6.0, |t| l((t - 0.2).max(0.0)) + aside, l);
            let options = ComparisonOptions {
                part: Part::All,
                alignment: Alignment::Offset(0.0),
                ..Default::default()
            };
            let cause = compare(&a, &b, &options).unwrap().first.unwrap().0;
            if let Discrepancy::Lag(s) = cause {
                assert!((s - 0.2).abs() < 3e-3, "{s} s beside by {aside}");
            } else {
                assert!(aside != Vector3::zeros(), "{cause:?}");
            }
        }
    }

    #[test]
    fn equal_flights_have_no_cause() {
        let a = flight(0.01, 4.0, square, square);
        assert_eq!(compare(&a, &a, &ComparisonOptions::default()).unwrap().first, None);
    }
}
