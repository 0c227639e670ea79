//! Altitude hold, in which the collective thrust comes from an estimated thrust map, and everything
//! else from the regulator around the moving reference.
//!
//! The throttle is `τ = (a − α⁰)/α¹` with `a = a_ref − k_z e_z − k_v e_v`. No integral is needed,
//! because the estimates of α⁰ and α¹ adapt to the battery and the load.

use nalgebra::{DMatrix, Vector3};

use super::lqr::Lqr;
use super::{Command, Controller, Reference};
use crate::control::lqr;
use crate::options::{AltitudeHoldOptions, SimOptions};
use crate::vehicle::{State, attitude, position, velocity};
use noctograph_core::crazyflie::{GRAVITY_M_S2, N_MOTORS};
use noctograph_core::error::Result;

/// Minimum acceleration per unit throttle in m/s². A gain of 0 or less would destabilize the
/// loop.
const LEAST_GAIN_M_S2: f64 = 1.0;
/// Vertical velocity error in m/s that costs as much as an error of `controller.altitude.error_m`.
const ERROR_M_S: f64 = 1.0;
/// Cosine of the largest tilt, 60°, for which the throttle compensates. Beyond it, full throttle
/// would mainly accelerate the drone sideways.
const LEAST_COS_TILT: f64 = 0.5;
/// Maximum horizontal error in m that the regulator receives. When satellite fixes return after 10
/// s, the estimate jumps by meters. Without this limit, the regulator would flip the drone over.
const REACH_M: f64 = 0.5;

/// Map from a throttle, 0 to 1, to the vertical acceleration, `z̈ = α⁰ + α¹ τ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThrustMap {
    /// Vertical acceleration at zero throttle, α⁰.
    pub(crate) offset_m_s2: f64,
    /// Vertical acceleration per unit throttle, α¹.
    pub(crate) gain_m_s2: f64,
}

impl ThrustMap {
    /// Returns the throttle, 0 to 1, for a vertical acceleration.
    pub fn throttle(&self, acceleration_m_s2: f64) -> f64 {
        let gain = self.gain_m_s2.max(LEAST_GAIN_M_S2);
        ((acceleration_m_s2 - self.offset_m_s2) / gain).clamp(0.0, 1.0)
    }
}

/// Returns the gains of altitude (1/s²) and vertical velocity (1/s), by a linear-quadratic
/// regulator of the double integrator.
///
/// # Errors
///
/// Weights within their ranges cause no error.
pub fn altitude_gains(options: &AltitudeHoldOptions) -> Result<[f64; 2]> {
    // By Bryson's rule, a weight is 1 / deviation².
    let deviations = [options.error_m, ERROR_M_S, options.acceleration_m_s2];
    let [q_z, q_v, r] = deviations.map(|deviation| 1.0 / (deviation * deviation));
    let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
    let b = DMatrix::from_row_slice(2, 1, &[0.0, 1.0]);
    let q = DMatrix::from_row_slice(2, 2, &[q_z, 0.0, 0.0, q_v]);
    let k = lqr(&a, &b, &q, &DMatrix::from_element(1, 1, r))?;
    Ok([k[0], k[1]])
}

#[derive(Debug)]
pub(super) struct AltitudeHold {
    regulator: Lqr,
    gains: [f64; 2],
    map: ThrustMap,
    full_thrust_n: f64,
}

impl AltitudeHold {
    /// Creates the controller of the options, with the vehicle's thrust map until one is given.
    /// Returns an error if the weights give no gain.
    pub(super) fn new(options: &SimOptions) -> Result<Self> {
        let gain_m_s2 = GRAVITY_M_S2 / options.vehicle.hover_throttle();
        Ok(Self {
            regulator: Lqr::new(options)?,
            gains: altitude_gains(&options.controller.altitude)?,
            map: ThrustMap { offset_m_s2: -GRAVITY_M_S2, gain_m_s2 },
            full_thrust_n: N_MOTORS * options.vehicle.full_thrust_n(),
        })
    }
}

/// Returns the estimate with its horizontal distance from the reference limited to [`REACH_M`], so
/// that the regulator never commands a larger tilt than it was designed for.
fn within_reach(estimate: &State, reference_m: &Vector3<f64>) -> State {
    let error_m = (position(estimate) - reference_m).xy();
    let mut bounded = *estimate;
    if error_m.norm() > REACH_M {
        let near_m = reference_m.xy() + error_m * (REACH_M / error_m.norm());
        bounded.fixed_rows_mut::<2>(0).copy_from(&near_m);
    }
    bounded
}

impl Controller for AltitudeHold {
    /// Returns the motor commands for the throttle of the thrust map and the torques of the
    /// regulator.
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        // The desired vertical acceleration follows from altitude and vertical velocity.
        let up = attitude(estimate).world_from_body().row(2).into_owned();
        let velocity_m_s = (up * velocity(estimate))[0];
        let error_m = position(estimate).z - reference.position_m.z;
        let [k_z, k_v] = self.gains;
        let acceleration_m_s2 = reference.acceleration_m_s2.z
            - k_z * error_m
            - k_v * (velocity_m_s - reference.velocity_m_s.z);
        // The throttle follows from the thrust map, and increases with the tilt. The regulator
        // commands the torques.
        let cos_tilt = up[2].max(LEAST_COS_TILT);
        let throttle = (self.map.throttle(acceleration_m_s2) / cos_tilt).min(1.0);
        let bounded = within_reach(estimate, &reference.position_m);
        self.regulator.command_with_thrust(&bounded, reference, Some(throttle * self.full_thrust_n))
    }

    fn rest(&mut self, estimate: &State) {
        self.regulator.rest(estimate);
    }

    fn set_thrust_map(&mut self, map: ThrustMap) {
        self.map = map;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::at_rest;

    #[test]
    fn gains_are_those_of_the_double_integrator() {
        // The gains are k_z = √(q_z/r) and k_v = √(q_v/r + 2 k_z).
        let [k_z, k_v] = altitude_gains(&AltitudeHoldOptions::default()).unwrap();
        assert!((k_z - 8.0).abs() < 1e-9 && (k_v - f64::sqrt(2.56 + 16.0)).abs() < 1e-9);
    }

    #[test]
    fn the_motors_carry_the_drone_by_the_map_that_was_estimated() {
        let options = SimOptions::bzzz();
        let mut controller = AltitudeHold::new(&options).unwrap();
        let place_m = Vector3::new(0.0, 0.0, 1.5);
        let reference = Reference::holding(place_m);
        let throttle = |controller: &mut AltitudeHold| {
            controller.rest(&at_rest(place_m, 0.0));
            let motors = controller.command(&at_rest(place_m, 0.0), &reference).motors;
            motors.mean() / options.vehicle.motor_max
        };
        let hover = options.vehicle.hover_throttle();
        assert!((throttle(&mut controller) - hover).abs() < 1e-12, "the vehicle's");
        controller.set_thrust_map(ThrustMap { offset_m_s2: -9.0, gain_m_s2: 30.0 });
        assert!((throttle(&mut controller) - 0.3).abs() < 1e-12, "the estimated one");
    }

    #[test]
    fn a_position_that_jumps_by_meters_tilts_no_more_than_half_a_meter_does() {
        let design_m = Vector3::new(1.0, 2.0, 1.5);
        for (x_m, seen_m) in [(0.3, 0.3), (-8.0, -0.5)] {
            let [there, seen] =
                [x_m, seen_m].map(|x_m| at_rest(design_m + Vector3::x() * x_m, 0.0));
            assert_eq!(within_reach(&there, &design_m), seen);
        }
    }
}
