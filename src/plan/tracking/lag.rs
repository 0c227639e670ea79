//! Lag or lead of a flight relative to its design.

use nalgebra::SVector;

use super::path::DesignPath;
use noctograph_core::flight::FlightSample;

/// Step in s of the search over a range of shifts. A letter's strokes last a second or more, so
/// that the error has a single minimum within a step.
const STEP_S: f64 = 0.02;
/// Resolution of the shift in s, which at 0.2 m/s is 0.2 µm of path.
const RESOLUTION_S: f64 = 1e-6;
/// Maximum number of samples for the first search. The refinement uses all samples.
const COARSE_SAMPLES: usize = 2000;

/// Weight of the squared mean error relative to the variance around it. For an L flown 6 cm beside
/// its design with a lag of 0.2 s, a weight of 1 would give a lag of 0.4 s, and this weight gives
/// 0.2005 s. A weight of 0 would give no lag for a straight stroke at constant speed, because its
/// lag is an offset along it.
const OFFSET_WEIGHT: f64 = 1e-3;

/// Returns the time shift of the design in s, within a range, that leaves the least spread of the
/// error in the word's plane. The shifted design at time t is the design at t − shift.
pub(super) fn best_shift_s(
    samples: &[FlightSample],
    design: &DesignPath,
    range_s: [f64; 2],
) -> f64 {
    let cost = |stride: usize, shift_s: f64| {
        let mut walk = design.walk();
        let sampled = samples.iter().step_by(stride);
        spread_m2(sampled.map(|s| (s.position_m - walk.at_m(s.time_s - shift_s)).xz()))
    };
    let stride = samples.len().div_ceil(COARSE_SAMPLES).max(1);
    minimize(range_s, |shift_s| cost(stride, shift_s), |shift_s| cost(1, shift_s))
}

/// Returns the variance of errors plus a small part of their squared mean, which prefers a shift in
/// time to an offset in space. The result is 0 without errors.
pub fn spread_m2<const D: usize>(errors_m: impl Iterator<Item = SVector<f64, D>>) -> f64 {
    let (n, sum, squares) = errors_m.fold((0.0, SVector::zeros(), 0.0), |(n, sum, squares), e| {
        (n + 1.0, sum + e, squares + e.norm_squared())
    });
    if n == 0.0 {
        return 0.0;
    }
    squares / n - (1.0 - OFFSET_WEIGHT) * (sum / n).norm_squared()
}

/// Returns the minimum of a function over a range, by a grid search with `coarse`, followed by a
/// golden-section search (Kiefer 1953) with `fine` around the best point of the grid.
pub fn minimize(
    [low, high]: [f64; 2],
    mut coarse: impl FnMut(f64) -> f64,
    mut fine: impl FnMut(f64) -> f64,
) -> f64 {
    // The best point of the grid is the nearest to zero of equally good points.
    #[expect(clippy::cast_possible_truncation, reason = "small")]
    let n_steps = ((high - low) / STEP_S).ceil() as u32;
    let grid = (0..=n_steps).map(|k| (low + f64::from(k) * STEP_S).min(high));
    let costs = grid.map(|shift_s| (coarse(shift_s), shift_s));
    let best = costs.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.abs().total_cmp(&b.1.abs())));
    let (_, best) = best.expect("a grid has a point");

    // Two inner points a and b lie between the neighbors of that point. The part beyond the worse
    // one is dropped, and the better one becomes an inner point of the rest.
    let (mut left, mut right) = ((best - STEP_S).max(low), (best + STEP_S).min(high));
    let golden = 0.5 * (f64::sqrt(5.0) - 1.0);
    let reach = golden * (right - left);
    let (mut a, mut b) = (right - reach, left + reach);
    let (mut cost_a, mut cost_b) = (fine(a), fine(b));
    while right - left > RESOLUTION_S {
        if cost_a <= cost_b {
            right = b;
            (b, cost_b) = (a, cost_a);
            a = right - golden * (right - left);
            cost_a = fine(a);
        } else {
            left = a;
            (a, cost_a) = (b, cost_b);
            b = left + golden * (right - left);
            cost_b = fine(b);
        }
    }
    let middle = 0.5 * (left + right);
    if fine(middle) < fine(best) { middle } else { best }
}
