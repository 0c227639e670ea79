//! Lag or lead of a flight relative to its design.

use nalgebra::SVector;

use super::path::DesignPath;
use noctograph_core::flight::FlightSample;

/// Step in s of the search over a range of shifts. A letter's strokes last a second or more, so the
/// error has a single minimum within a step.
const STEP_S: f64 = 0.02;
/// Resolution of the shift in s, which corresponds to 0.2 µm of path at 0.2 m/s.
const RESOLUTION_S: f64 = 1e-6;
/// Maximum numbers of samples, spread over the flight, in the rough search and in the first search.
/// The refinement uses all samples.
const ROUGH_SAMPLES: usize = 250;
const COARSE_SAMPLES: usize = 2000;
/// Maximum ratio of a shift's rough spread to the least one for which the first search tries the
/// shift. At the next shift of the grid, the spread of a moving flight is several times the least.
const NEAR: f64 = 2.0;

/// Weight of the squared mean error relative to the variance around it. For an L flown 6 cm beside
/// its design with a lag of 0.2 s, a weight of 1 would give a lag of 0.4 s, whereas this weight
/// gives 0.2005 s. With a weight of 0, the lag on a straight stroke at constant speed would be
/// undetermined, because it equals an offset along the stroke.
const OFFSET_WEIGHT: f64 = 1e-3;

/// Returns the time shift of the design in s, within a range, that minimizes the spread of the
/// error in the word's plane. The shifted design at time t is the design at t − shift.
///
/// Three searches with increasing numbers of samples cover the whole grid, the nearly best shifts
/// of the grid, and the interval between the neighbors of the best shift.
pub(super) fn best_shift_s(
    samples: &[FlightSample],
    design: &DesignPath,
    range_s: [f64; 2],
) -> f64 {
    let places: Vec<_> = samples.iter().map(|s| (s.time_s, s.position_m.xz())).collect();
    let cost = |stride: usize, shift_s: f64| {
        let mut walk = design.walk();
        let sampled = places.iter().step_by(stride);
        spread_m2(sampled.map(|(time_s, m)| m - walk.at_in_plane_m(time_s - shift_s)))
    };
    let [rough_stride, coarse_stride] =
        [ROUGH_SAMPLES, COARSE_SAMPLES].map(|most| places.len().div_ceil(most).max(1));
    let rough: Vec<(f64, f64)> = grid(range_s).map(|s| (cost(rough_stride, s), s)).collect();
    let least = rough.iter().map(|(cost, _)| *cost).fold(f64::INFINITY, f64::min);
    let near = rough.into_iter().filter(|(cost, _)| *cost <= NEAR * least);
    let best_s = best(near.map(|(_, shift_s)| (cost(coarse_stride, shift_s), shift_s)));
    refined(range_s, best_s, |shift_s| cost(1, shift_s))
}

/// Returns the variance in m² of errors plus a small part of their squared mean, so that a shift in
/// time is preferred to an offset in space. The result is 0 for an empty list.
pub fn spread_m2<const D: usize>(errors_m: impl Iterator<Item = SVector<f64, D>>) -> f64 {
    let (n, sum, squares) = errors_m.fold((0.0, SVector::zeros(), 0.0), |(n, sum, squares), e| {
        (n + 1.0, sum + e, squares + e.norm_squared())
    });
    if n == 0.0 {
        return 0.0;
    }
    squares / n - (1.0 - OFFSET_WEIGHT) * (sum / n).norm_squared()
}

/// Returns the shift in s at which `cost` is least, within a range from its start to its end, by a
/// grid search, followed by a golden-section search around the best point of the grid.
pub fn minimize(range: [f64; 2], mut cost: impl FnMut(f64) -> f64) -> f64 {
    let best_s = best(grid(range).map(|shift_s| (cost(shift_s), shift_s)));
    refined(range, best_s, cost)
}

/// Returns the shifts in s of a grid over a range, with steps of [`STEP_S`] and both ends.
fn grid([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    #[expect(clippy::cast_possible_truncation, reason = "small")]
    let n_steps = ((high - low) / STEP_S).ceil() as u32;
    (0..=n_steps).map(move |k| (low + f64::from(k) * STEP_S).min(high))
}

/// Returns the shift with the least cost. Of equally good shifts, returns the one nearest to zero.
fn best(costs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let best = costs.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.abs().total_cmp(&b.1.abs())));
    best.expect("a grid has a point").1
}

/// Returns the argument in s at which a function is least, by golden-section search (Kiefer 1953)
/// between the neighbors of the grid point `best`.
fn refined([low, high]: [f64; 2], best: f64, mut fine: impl FnMut(f64) -> f64) -> f64 {
    // Two inner points a and b divide the interval. The part beyond the worse one is dropped, and
    // the better one becomes an inner point of the remaining interval.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::constructed::{flight, square};
    use nalgebra::Vector3;

    #[test]
    fn the_rough_search_leaves_the_shift_of_the_whole_grid() {
        let range_s = [-1.5, 1.5];
        for (lag_s, sway_m, end_s) in
            [(0.0, 0.0, 4.0), (0.011, 0.01, 20.0), (0.56, 0.03, 60.0), (-0.4, 0.08, 30.0)]
        {
            let flown = flight(
                0.005,
                end_s,
                |t| square(t - lag_s) + Vector3::new(libm::sin(7.0 * t), 0.0, 0.3) * sway_m,
                square,
            );
            let design = DesignPath::new(&flown).unwrap();
            let wanted_s = minimize(range_s, |shift_s| {
                let mut walk = design.walk();
                let errors =
                    flown.samples.iter().map(|s| s.position_m - walk.at_m(s.time_s - shift_s));
                spread_m2(errors.map(|error_m| error_m.xz()))
            });
            let actual_s = best_shift_s(&flown.samples, &design, range_s);
            assert_eq!(actual_s.to_bits(), wanted_s.to_bits(), "{actual_s} for {wanted_s}");
        }
    }
}
