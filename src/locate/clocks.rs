//! The seconds between two clocks, from what was measured on both.
//!
//! Method: the mean square of what disagrees, over offsets on a grid and then by golden section.

use nalgebra::Vector3;

use super::{Located, Reference};
use noctograph_core::statistics::median;

/// Step of the search, s: drones turn within a second.
const STEP_S: f64 = 0.1;
/// Golden section: ratio, and steps to below 10 µs.
const RATIO: f64 = 0.618_033_988_75;
const SECTIONS: usize = 22;
/// Most comparisons at one offset of the grid.
const MOST: usize = 500;
/// Share of the shorter recording that the two must have in common.
const LEAST_SHARE: f64 = 0.5;
/// Least fall of the mean square, from the median of all offsets, that an offset must show.
const LEAST_FALL: f64 = 0.5;

/// Seconds to add to the clock of the second of two drones, each located by its own log alone, so
/// that the ranges between them fit; `None` where these do not tell.
///
/// `between`: ranges between the drones: whether the log of the second holds it (`true`) or that of
/// the first, its time on the clock of that log, s, and its distance, m.
pub fn log_offset_s(
    first: &Located,
    second: &Located,
    between: &[(bool, f64, f64)],
) -> Option<f64> {
    let span_s = |located: &Located| Some([*located.time_s.first()?, *located.time_s.last()?]);
    let ([first_from_s, first_to_s], [second_from_s, second_to_s]) =
        (span_s(first)?, span_s(second)?);
    let left_m2 = |offset_s: f64, step: usize| {
        let square = |(of_second, time_s, distance_m): &(bool, f64, f64)| {
            let on_first_s = if *of_second { time_s + offset_s } else { *time_s };
            let first_m = position_m(first, on_first_s)?;
            let left_m = (first_m - position_m(second, on_first_s - offset_s)?).norm() - distance_m;
            Some(left_m * left_m)
        };
        mean(between.iter().step_by(step).map(square))
    };
    best(left_m2, between.len(), [first_from_s - second_to_s, first_to_s - second_from_s])
}

/// Seconds to add to a reference's clock so that the located positions of a drone lie nearest to
/// it; `None` where these do not tell.
pub fn reference_offset_s(
    located: &Located,
    drone: usize,
    reference: Reference<'_>,
) -> Option<f64> {
    let heard = located.heard(drone);
    let samples = &reference.flight.samples;
    let (first, last) = samples.first().zip(samples.last())?;
    let times_s = located.time_s.get(heard.clone()).filter(|times_s| !times_s.is_empty())?;
    let [from_s, to_s] = [times_s[0] - last.time_s, times_s[times_s.len() - 1] - first.time_s];
    let left_m2 = |offset_s: f64, step: usize| {
        let reference = Reference { offset_s, ..reference };
        let square = |k: usize| {
            let true_m = reference.position_m(located.time_s[k])?;
            Some((located.position_m[drone][k] - true_m).norm_squared())
        };
        mean(heard.clone().step_by(step).map(square))
    };
    best(left_m2, heard.len(), [from_s, to_s])
}

/// Position of the one drone that was located, between two times.
fn position_m(located: &Located, time_s: f64) -> Option<Vector3<f64>> {
    let after = located.time_s.partition_point(|t| *t < time_s);
    let before = after.checked_sub(1)?;
    let (a_s, b_s) = (located.time_s[before], *located.time_s.get(after)?);
    let share = (time_s - a_s) / (b_s - a_s).max(1e-9);
    let places_m = &located.position_m[0];
    Some(places_m[before] + (places_m[after] - places_m[before]) * share)
}

/// Mean of the squares that there are, and their number.
fn mean(squares: impl Iterator<Item = Option<f64>>) -> (f64, f64) {
    let (mut sum, mut n) = (0.0, 0.0);
    for square in squares.flatten() {
        (sum, n) = (sum + square, n + 1.0);
    }
    (sum / f64::max(n, 1.0), n)
}

/// The offset within bounds with the least mean square, given the mean and the number of
/// comparisons at an offset and a stride over `n` of them.
fn best(
    left: impl Fn(f64, usize) -> (f64, f64),
    n: usize,
    [from_s, to_s]: [f64; 2],
) -> Option<f64> {
    let stride = n.div_ceil(MOST).max(1);
    #[expect(clippy::cast_possible_truncation, reason = "hours")]
    let steps = ((to_s - from_s) / STEP_S).ceil().clamp(0.0, 1e6) as u32;
    let offset_s = |k: u32| from_s + STEP_S * f64::from(k);
    let at = |k: u32| (offset_s(k), left(offset_s(k), stride));
    let tried: Vec<(f64, (f64, f64))> = (0..=steps).map(at).collect();
    let most = tried.iter().map(|(_, (_, n))| *n).fold(0.0, f64::max);
    if most < 10.0 {
        return None;
    }
    let enough = tried.iter().filter(|(_, (_, n))| *n >= LEAST_SHARE * most);
    let (near_s, (least, _)) = enough.clone().min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let usual = median(enough.map(|(_, (square, _))| *square))?;
    if *least > LEAST_FALL * usual {
        return None;
    }
    let (mut low_s, mut high_s) = (near_s - STEP_S, near_s + STEP_S);
    for _ in 0..SECTIONS {
        let (a_s, b_s) = (high_s - RATIO * (high_s - low_s), low_s + RATIO * (high_s - low_s));
        if left(a_s, 1).0 < left(b_s, 1).0 { high_s = b_s } else { low_s = a_s }
    }
    Some(0.5 * (low_s + high_s))
}
