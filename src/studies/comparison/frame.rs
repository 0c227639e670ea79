//! Aligns the coordinate frames of two flights, which may differ if a flight lacks setpoints.

use nalgebra::{Rotation3, Vector3};
use serde::Serialize;

use super::{ComparisonOptions, mean, pairs};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, FlightSample, Quantity};
use noctograph_core::input_error;

/// Minimum root mean square distance at which two flights may be in different frames.
const TWO_FRAMES_M: f64 = 0.15;
/// Maximum root mean square distance between two logs of the same flight after alignment.
const MAX_RESIDUAL_M: f64 = 0.05;
/// Maximum fraction of the distance that remains after alignment if the frames differ.
const RESIDUAL_FRAC: f64 = 0.3;
/// Number of rotations that are tried.
const TURNS: u32 = 24;
/// Minimum size of a path whose rotation can be determined.
const NARROW_M: f64 = 0.05;

/// Transform from flight B's frame to that of A.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrameAlignment {
    /// Rotation about the vertical axis, applied first.
    pub turn_rad: f64,
    /// Translation after the rotation.
    pub shift_m: Vector3<f64>,
    /// Root mean square distance between the flights after the transform.
    pub left_m: f64,
}

impl FrameAlignment {
    /// Returns the rotation about the vertical axis as a matrix.
    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), self.turn_rad)
    }

    /// Returns a copy of a flight with every sample transformed.
    fn placed(&self, flight: &Flight) -> Flight {
        let mut placed = flight.clone();
        placed.edit(|placed| placed.samples.iter_mut().for_each(|sample| self.place(sample)));
        placed
    }

    /// Transforms a sample of B to the frame of A: its position, its estimate and its heading. The
    /// heading is wrapped to ±π.
    pub fn place(&self, sample: &mut FlightSample) {
        for position_m in [&mut sample.position_m, &mut sample.estimate_m] {
            *position_m = self.rotation() * *position_m + self.shift_m;
        }
        let yaw_rad = sample.attitude.yaw_rad + self.turn_rad;
        sample.attitude.yaw_rad = libm::remainder(yaw_rad, std::f64::consts::TAU);
    }
}

/// Returns the seconds to add to B's clock, and the transform of B's frame if it differs from A's.
/// The frames are assumed to differ if a flight lacks setpoints and a rotation and a translation
/// reduce the distance from decimeters to centimeters. Returns an error if they reduce it
/// considerably, but not to centimeters. `clock` returns the seconds for a transformed copy of B.
pub(super) fn place(
    a: &Flight,
    b: &Flight,
    options: &ComparisonOptions,
    offset_s: f64,
    clock: &dyn Fn(&Flight) -> Result<f64>,
) -> Result<(f64, Option<FrameAlignment>)> {
    if [a, b].iter().all(|flight| flight.has(Quantity::Design)) {
        return Ok((offset_s, None));
    }
    let fitted = fit_at([a, b], options, offset_s)?;
    let Some((apart_m, mut best)) = fitted.filter(|(apart_m, _)| *apart_m >= TWO_FRAMES_M) else {
        return Ok((offset_s, None));
    };
    let mut best_s = offset_s;
    // The clock cannot be aligned well in another frame, and is aligned again per rotation. The
    // search ends early if the frames clearly agree.
    for step in 1..TURNS {
        if best.left_m <= 0.5 * MAX_RESIDUAL_M {
            break;
        }
        let turn_rad = std::f64::consts::TAU * f64::from(step) / f64::from(TURNS);
        let turn = FrameAlignment { turn_rad, shift_m: Vector3::zeros(), left_m: 0.0 };
        let turned = turn.placed(b);
        let turned_s = clock(&turned)?;
        let fitted = fit_at([a, &turned], options, turned_s)?;
        if let Some((_, further)) = fitted.filter(|(_, frame)| frame.left_m < best.left_m) {
            best = FrameAlignment { turn_rad: turn_rad + further.turn_rad, ..further };
            best_s = turned_s;
        }
    }
    // The clock offset belongs to a coarse rotation, so it is computed once more.
    let again_s = clock(&best.placed(b))?;
    let fitted = fit_at([a, b], options, again_s)?;
    if let Some((_, whole)) = fitted.filter(|(_, frame)| frame.left_m < best.left_m) {
        (best, best_s) = (whole, again_s);
    }
    best.turn_rad = libm::remainder(best.turn_rad, std::f64::consts::TAU);
    if best.left_m <= MAX_RESIDUAL_M {
        return Ok((best_s, Some(best)));
    }
    if best.left_m < RESIDUAL_FRAC * apart_m {
        let left_m = best.left_m;
        return Err(input_error!(
            "flights A and B",
            "paths {apart_m:.2} m apart, and {left_m:.2} m after the best rotation and shift",
            "paths in one frame",
            "the paths use two frames, so convert one log, or compare flights that have setpoints",
        ));
    }
    Ok((offset_s, None))
}

/// Returns the result of [`fit`] for the pairs of two flights after adding `offset_s` to B's
/// timestamps. Returns an error if a flight has no samples in the compared part.
fn fit_at(
    [a, b]: [&Flight; 2],
    options: &ComparisonOptions,
    offset_s: f64,
) -> Result<Option<(f64, FrameAlignment)>> {
    let [a, mut b] = [options.part.samples(a)?, options.part.samples(b)?];
    b.iter_mut().for_each(|sample| sample.time_s += offset_s);
    Ok(fit(&pairs(&a, &b, options.max_gap_s)))
}

/// Returns the root mean square distance of pairs in m, and the rotation and translation of B that
/// minimize it (orthogonal Procrustes problem about the vertical axis: Schönemann, Psychometrika
/// 31, 1966). Returns `None` for fewer than ten pairs, which determine a rotation poorly.
fn fit(pairs: &[[FlightSample; 2]]) -> Option<(f64, FrameAlignment)> {
    if pairs.len() < 10 {
        return None;
    }
    let n = pairs.len() as f64;
    // The rotation is about the centroids, by the angle atan2(Σ b × a, Σ b · a).
    let [a_m, b_m] = [0, 1].map(|side| mean(pairs.iter().map(|pair| pair[side].position_m)));
    let (mut sin, mut cos, mut spread_m2) = (0.0, 0.0, 0.0);
    for [a, b] in pairs {
        let (a, b) = (a.position_m - a_m, b.position_m - b_m);
        sin += b.x * a.y - b.y * a.x;
        cos += b.x * a.x + b.y * a.y;
        spread_m2 += b.xy().norm_squared() / n;
    }
    let turn_rad = if spread_m2.sqrt() > NARROW_M { libm::atan2(sin, cos) } else { 0.0 };
    let mut placement = FrameAlignment { turn_rad, shift_m: Vector3::zeros(), left_m: 0.0 };
    placement.shift_m = a_m - placement.rotation() * b_m;
    let (turn, shift_m) = (placement.rotation(), placement.shift_m);
    let left = pairs.iter().map(|[a, b]| a.position_m - (turn * b.position_m + shift_m));
    placement.left_m = (left.map(|left_m| left_m.norm_squared()).sum::<f64>() / n).sqrt();
    let apart_m2 = pairs.iter().map(|[a, b]| (a.position_m - b.position_m).norm_squared());
    Some(((apart_m2.sum::<f64>() / n).sqrt(), placement))
}
