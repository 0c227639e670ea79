//! What explains most of the difference between two flights.

use nalgebra::Vector3;

use super::{FlightSample, mean};
use noctograph_plan::tracking::{DesignPath, MAX_LAG_S, minimize, spread_m2};

/// Time over which noise averages out and an error along the path does not, s: a stroke of 0.1 m.
const SMOOTH_S: f64 = 0.5;

/// Larger changes of size are no error of a positioning system: B flies another path.
const MOST_SCALE: f64 = 0.5;

/// A cause of the difference, by how much flight B is apart from A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Discrepancy {
    /// B is this late, s.
    Lag(f64),
    /// B is beside A by this, m.
    Offset(Vector3<f64>),
    /// B is this many times as large as A, less 1, about the middle of both.
    Scale(f64),
    /// B leaves A's path by this, m (root mean square), slowly enough to repeat.
    Path(f64),
    /// B shakes about its own path by this, m (root mean square).
    Noise(f64),
}

/// The cause that explains the largest share of the mean square distance, each by itself, and that
/// share; `None` where the flights do not differ.
pub(super) fn first(pairs: &[[FlightSample; 2]]) -> Option<(Discrepancy, f64)> {
    let apart: Vec<_> = pairs.iter().map(|[a, b]| b.position_m - a.position_m).collect();
    let total = power(&apart);
    if total == 0.0 {
        return None;
    }
    let middle = mean(pairs.iter().map(|[a, _]| a.position_m));
    let arms: Vec<_> = pairs.iter().map(|[a, _]| a.position_m - middle).collect();
    let offset = mean(apart.iter().copied());
    let centered: Vec<_> = apart.iter().map(|d| d - offset).collect();
    let (late_s, late) = lag(pairs);
    let grown = Some(fit(&centered, &arms)).filter(|by| by.abs() <= MOST_SCALE).unwrap_or(0.0);
    // What neither a shift, a lag nor a scale explains: its slow and its fast part.
    let drift = mean(late.iter().copied());
    let rest: Vec<_> = centered
        .iter()
        .zip(late.iter().zip(&arms))
        .map(|(d, (late, arm))| d - (late - drift) - arm * grown)
        .collect();
    let slow = smoothed(pairs, &rest);
    let fast: Vec<_> = rest.iter().zip(&slow).map(|(d, slow)| d - slow).collect();
    let causes = [
        (Discrepancy::Lag(late_s), power(&late) / total),
        (Discrepancy::Offset(offset), offset.norm_squared() / total),
        (Discrepancy::Scale(grown), grown * grown * power(&arms) / total),
        (Discrepancy::Path(power(&slow).sqrt()), power(&slow) / total),
        (Discrepancy::Noise(power(&fast).sqrt()), power(&fast) / total),
    ];
    let largest = causes.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    largest.map(|(cause, share)| (cause, share.min(1.0)))
}

/// Mean square length.
fn power(vectors: &[Vector3<f64>]) -> f64 {
    mean(vectors.iter().map(|v| v.component_mul(v))).sum()
}

/// The factor of `along` that comes closest to `vectors`.
fn fit(vectors: &[Vector3<f64>], along: &[Vector3<f64>]) -> f64 {
    let (dot, square) = vectors
        .iter()
        .zip(along)
        .fold((0.0, 0.0), |(dot, square), (v, a)| (dot + v.dot(a), square + a.norm_squared()));
    if square > 0.0 { dot / square } else { 0.0 }
}

/// How late B is, found like `--align flown` and the lag of a flight: the shift of A that comes
/// closest to B but for a constant offset. Then, at each sample, how far A moves in that time.
fn lag(pairs: &[[FlightSample; 2]]) -> (f64, Vec<Vector3<f64>>) {
    let a = DesignPath::through(pairs.iter().map(|[a, _]| (a.time_s, a.position_m)));
    let shifted = |late_s: f64| {
        let mut walk = a.walk();
        pairs.iter().map(move |[a, _]| walk.at_m(a.time_s - late_s))
    };
    let cost = |late_s: f64| {
        let beside = pairs.iter().zip(shifted(late_s));
        spread_m2(beside.map(|([_, b], a_m)| b.position_m - a_m))
    };
    let found_s = minimize([-MAX_LAG_S, MAX_LAG_S], cost, cost);
    // For flights that do not move, any shift is as good; one at an end of the search is not best.
    let is_best = found_s.abs() < MAX_LAG_S - 1e-3 && cost(found_s) < cost(0.0);
    let late_s = if is_best { found_s } else { 0.0 };
    let moved = pairs.iter().zip(shifted(late_s)).map(|([a, _], a_m)| a_m - a.position_m);
    (late_s, moved.collect())
}

/// The mean over [`SMOOTH_S`] around each sample.
fn smoothed(pairs: &[[FlightSample; 2]], values: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
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

    /// The first cause where B flies the square with a change.
    fn first_cause(change: impl Fn(f64) -> Vector3<f64>) -> (Discrepancy, f64) {
        let a = flight(0.01, 16.0, square, square);
        let b = flight(0.01, 16.0, change, square);
        let (part, alignment) = (Part::All, Alignment::Offset(0.0));
        let options = ComparisonOptions { part, alignment, ..Default::default() };
        compare(&a, &b, &options).unwrap().first.unwrap()
    }

    #[test]
    fn each_cause_is_found_with_its_amount() {
        let (lag, share) = first_cause(|t| square((t - 0.1).max(0.0)));
        assert!(
            matches!(lag, Discrepancy::Lag(s) if (s - 0.1).abs() < 1e-3) && share > 0.99,
            "{lag:?}"
        );
        // Over whole strokes, where a delay differs from a step along the velocity.
        for late_s in [0.3, 0.5, 0.8, -0.5] {
            let (lag, share) = first_cause(|t| square((t - late_s).max(0.0)));
            assert!(
                matches!(lag, Discrepancy::Lag(s) if (s - late_s).abs() < 2e-3) && share > 0.97,
                "{late_s} s is {lag:?}, {share}"
            );
        }
        let aside = Vector3::new(0.03, 0.0, -0.04);
        let (offset, share) = first_cause(|t| square(t) + aside);
        assert!(
            matches!(offset, Discrepancy::Offset(m) if (m - aside).norm() < 1e-9),
            "{offset:?}"
        );
        assert!(share > 0.99, "{share}");
        let middle = Vector3::new(0.2, 0.0, 0.7);
        let (scale, share) = first_cause(|t| middle + (square(t) - middle) * 1.05);
        assert!(matches!(scale, Discrepancy::Scale(s) if (s - 0.05).abs() < 1e-3), "{scale:?}");
        assert!(share > 0.99, "{share}");
        let [(noise, share), (path, path_share)] = [0.05, 2.9].map(|period_s| {
            let rate_rad_s = std::f64::consts::TAU / period_s;
            first_cause(|t| square(t) + Vector3::z() * (0.02 * libm::sin(rate_rad_s * t)))
        });
        assert!(matches!(noise, Discrepancy::Noise(m) if (m - 0.0141).abs() < 1e-3), "{noise:?}");
        assert!(share > 0.9, "{share}");
        assert!(matches!(path, Discrepancy::Path(m) if (m - 0.0141).abs() < 2e-3), "{path:?}");
        assert!(path_share > 0.8, "{path_share}");
        // No positioning system has such a scale: B is half as large and turned by half a turn.
        let (path, share) = first_cause(|t| middle + (square(t) - middle) * -0.5);
        assert!(matches!(path, Discrepancy::Path(_)) && share > 0.8, "{path:?}, {share}");
    }

    /// An L, which ends elsewhere than it began.
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
