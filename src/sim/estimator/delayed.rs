//! Delayed states, which are positions of drones in the past as functions of their present errors.
//! A message that arrives late contains a measurement of such a past position. The motion between
//! the measurement and the present is integrated from the inertial messages received. Stochastic
//! cloning (Roumeliotis and Burdick, ICRA 2002) keeps a copy of the state instead.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};

use crate::kalman::{ERRORS, Part, TURN, VELOCITY};
use crate::sensors::{Reckoning, Segment};

/// Maximum time in s between messages for interpolation of motion. Over longer times, strokes are
/// too curved.
const LONGEST_GAP_S: f64 = 0.3;
/// Time in s from a message within which the motion is interpolated in any case.
const NEAR_S: f64 = 0.05;

/// Position in the past as a function of a drone's present errors.
pub(super) struct DelayedState {
    pub(super) position_m: Vector3<f64>,
    /// Time in s since that position.
    span_s: f64,
    /// Integral of the specific force since that position in the world frame in m/s.
    force_m_s: Vector3<f64>,
}

impl DelayedState {
    /// Returns the Jacobian, with respect to the present errors of drone `drone`, of a measurement
    /// along a direction at this position. This drone's tilt is in its body frame
    /// (`world_from_body`), and those of other drones are in the world frame.
    pub(super) fn jacobian(
        &self,
        drone: usize,
        direction: Vector3<f64>,
        world_from_body: Option<&Matrix3<f64>>,
    ) -> [Part; 3] {
        // Because p(then) = p − v τ + …, a tilt error θ, which rotates the force, shifts the
        // position by ½ τ (θ × ∫f).
        let turn = self.force_m_s.cross(&direction) * (0.5 * self.span_s);
        let turn = world_from_body.map_or(turn, |r| r.tr_mul(&turn));
        let first = ERRORS * drone;
        [
            Part::Three(first, direction),
            Part::Three(first + TURN, turn),
            Part::Three(first + VELOCITY, direction * -self.span_s),
        ]
    }
}

/// Returns the state at `then` of a drone that has the given position, velocity and tilt at `now`.
/// The integrated force is taken to be spread evenly over the time between.
pub(super) fn delayed(
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    tilt_rad: Vector3<f64>,
    now: &Reckoning,
    then: &Reckoning,
) -> DelayedState {
    let Segment { span_s, gained_m_s, accelerated_m, force_m_s } = now.since(then);
    // The tilt of the dead reckoning rotates the force that it has integrated.
    let turned_m_s = tilt_rad.cross(&force_m_s);
    let velocity_then_m_s = velocity_m_s - gained_m_s - turned_m_s;
    let since_m = velocity_then_m_s * span_s + accelerated_m + turned_m_s * (0.5 * span_s);
    DelayedState { position_m: position_m - since_m, span_s, force_m_s }
}

/// Returns the motion between two messages, by cubic Hermite interpolation. Returns `None` up to
/// the first message, after the last one, and in a gap longer than [`LONGEST_GAP_S`] unless a
/// message is within [`NEAR_S`]. The result contains position and velocity at `time_s`.
pub(super) fn interpolated(motions: &VecDeque<Reckoning>, time_s: f64) -> Option<Reckoning> {
    let after = motions.partition_point(|motion| motion.time_s < time_s);
    let (a, b) = (motions.get(after.checked_sub(1)?)?, motions.get(after)?);
    let gap_s = b.time_s - a.time_s;
    let to_nearest_s = (time_s - a.time_s).min(b.time_s - time_s);
    if gap_s > LONGEST_GAP_S && to_nearest_s > NEAR_S {
        return None;
    }
    // The polynomial is a + v_a s + c₂ s² + c₃ s³ for s from 0 to 1, with velocities per unit of s.
    let s = (time_s - a.time_s) / gap_s;
    let step_m = b.position_m - a.position_m;
    let (va, vb) = (a.velocity_m_s * gap_s, b.velocity_m_s * gap_s);
    let (c2, c3) = (step_m * 3.0 - va * 2.0 - vb, va + vb - step_m * 2.0);
    Some(Reckoning {
        time_s,
        position_m: a.position_m + (va + (c2 + c3 * s) * s) * s,
        velocity_m_s: (va + (c2 * 2.0 + c3 * (3.0 * s)) * s) / gap_s,
    })
}
