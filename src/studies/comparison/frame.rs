//! Frames of two flights: a flight without setpoints may be in another frame.

use nalgebra::{Rotation3, Vector3};
use serde::Serialize;

use super::{ComparisonOptions, mean, pairs};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, FlightSample, Quantity};
use noctograph_core::input_error;

/// Flights that are this far apart, root mean square, may be in two frames.
const TWO_FRAMES_M: f64 = 0.15;
/// Most that a transform may leave between two flights that are one.
const MOST_LEFT_M: f64 = 0.05;
/// Largest fraction of the distance that a transform of two frames leaves.
const LEFT_FRAC: f64 = 0.3;
/// Turns that are tried.
const TURNS: u32 = 24;
/// A path that is narrower has no direction.
const NARROW_M: f64 = 0.05;

/// Transform of flight B's frame to that of A.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrameAlignment {
    /// Turn about the vertical.
    pub turn_rad: f64,
    /// Shift after it.
    pub shift_m: Vector3<f64>,
    /// Root mean square distance that is left.
    pub left_m: f64,
}

impl FrameAlignment {
    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), self.turn_rad)
    }

    /// A flight with every sample moved.
    fn placed(&self, flight: &Flight) -> Flight {
        let mut placed = flight.clone();
        placed.edit(|placed| placed.samples.iter_mut().for_each(|sample| self.place(sample)));
        placed
    }

    /// Moves a sample: its positions and its heading.
    pub fn place(&self, sample: &mut FlightSample) {
        for position_m in [&mut sample.position_m, &mut sample.estimate_m] {
            *position_m = self.rotation() * *position_m + self.shift_m;
        }
        let yaw_rad = sample.attitude.yaw_rad + self.turn_rad;
        sample.attitude.yaw_rad = libm::remainder(yaw_rad, std::f64::consts::TAU);
    }
}

/// The seconds to add to B's clock, and the transform of its frame if that differs from A's: one of
/// the two has no setpoints, they are decimeters apart, and a turn and a shift leave centimeters.
///
/// `clock` finds those seconds for a flight in place of B.
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
    // A turned path sets the clock wrong: the clock is set anew for each turn.
    for step in 1..TURNS {
        if best.left_m <= 0.5 * MOST_LEFT_M {
            break;
        }
        let turn_rad = std::f64::consts::TAU * f64::from(step) / f64::from(TURNS);
        let turn = FrameAlignment { turn_rad, shift_m: Vector3::zeros(), left_m: 0.0 };
        let turned = turn.placed(b);
        let offset_s = clock(&turned)?;
        let further = fit_at([a, &turned], options, offset_s)?;
        if let Some((_, further)) = further.filter(|(_, f)| f.left_m < best.left_m) {
            best = FrameAlignment { turn_rad: turn_rad + further.turn_rad, ..further };
            best_s = offset_s;
        }
    }
    // Once more with the complete turn: the best step had the rest of it after its clock was set.
    let again_s = clock(&best.placed(b))?;
    let further = fit_at([a, b], options, again_s)?;
    if let Some((_, further)) = further.filter(|(_, f)| f.left_m < best.left_m) {
        (best, best_s) = (further, again_s);
    }
    best.turn_rad = libm::remainder(best.turn_rad, std::f64::consts::TAU);
    if best.left_m <= MOST_LEFT_M {
        return Ok((best_s, Some(best)));
    }
    if best.left_m < LEFT_FRAC * apart_m {
        let left_m = best.left_m;
        return Err(input_error!(
            "flights A and B",
            "paths {apart_m:.2} m apart, and {left_m:.2} m after the best turn and shift",
            "paths in one frame",
            "they are in two frames: convert one log, or compare flights that have setpoints",
        ));
    }
    Ok((offset_s, None))
}

/// As [`fit`], of two flights with an offset of B's clock.
fn fit_at(
    [a, b]: [&Flight; 2],
    options: &ComparisonOptions,
    offset_s: f64,
) -> Result<Option<(f64, FrameAlignment)>> {
    let [a, mut b] = [options.part.samples(a)?, options.part.samples(b)?];
    b.iter_mut().for_each(|sample| sample.time_s += offset_s);
    Ok(fit(&pairs(&a, &b, options.max_gap_s)))
}

/// The distance of pairs, root mean square, and the turn and shift of B that make it least
/// (orthogonal Procrustes problem about the vertical: Schönemann, Psychometrika 31, 1966).
fn fit(pairs: &[[FlightSample; 2]]) -> Option<(f64, FrameAlignment)> {
    if pairs.len() < 10 {
        return None;
    }
    let n = pairs.len() as f64;
    // The turn is about the centroids: atan2(Σ b × a, Σ b · a).
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
