//! Flight: where the drone was, what it believed, what it was told, and its motors.
//!
//! A simulated flight and a real flight's log meet here; below nobody can tell them apart.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::geometry::Attitude;

pub mod comparison;
pub mod csv;
pub mod table;
pub mod tracking;

/// A flight of one drone, sampled over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    /// Samples in rising order of time.
    pub samples: Vec<FlightSample>,
    /// Light commands in force at each sample, as received over the radio: one column per
    /// channel, 0 (off) to 1, each as long as `samples`.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// What whoever reads the flight should know.
    pub warnings: Vec<String>,
}

/// One instant of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightSample {
    /// Since the first setpoint.
    pub time_s: f64,
    /// Body origin in the world.
    pub position_m: Vector3<f64>,
    /// Attitude of the body in the world.
    pub attitude: Attitude,
    /// Velocity in the body frame.
    pub velocity_body_m_s: Vector3<f64>,
    /// Angular velocity in the body frame.
    pub rate_body_rad_s: Vector3<f64>,
    /// Position that the estimator believed in.
    pub estimate_m: Vector3<f64>,
    /// Where the design wanted the drone at this instant (continuous, not held).
    pub design_m: Vector3<f64>,
    /// Motor commands m1…m4, 0…65535.
    pub motors: [f64; 4],
    /// Index of the letter that is being written; `None` during take-off and landing.
    pub letter: Option<usize>,
}

/// Root mean square of `position − design` per world axis, over the samples that write letters.
///
/// `None` where no sample writes a letter.
#[must_use]
pub fn rmse_m(flight: &Flight) -> Option<Vector3<f64>> {
    error_over_letters(flight, |e| e.component_mul(&e)).map(|mean_sq| mean_sq.map(f64::sqrt))
}

/// Mean of `position − design` per world axis, over the samples that write letters.
///
/// `None` where no sample writes a letter.
#[must_use]
pub fn mean_error_m(flight: &Flight) -> Option<Vector3<f64>> {
    error_over_letters(flight, |e| e)
}

fn error_over_letters(
    flight: &Flight,
    term: impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Option<Vector3<f64>> {
    let writing = || flight.samples.iter().filter(|sample| sample.letter.is_some());
    let n = writing().count();
    let sum: Vector3<f64> = writing().map(|s| term(s.position_m - s.design_m)).sum();
    #[expect(clippy::cast_precision_loss, reason = "sample counts are far below 2^53")]
    (n > 0).then(|| sum / n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rmse_counts_only_the_letters() {
        let sample = |error: f64, letter| FlightSample {
            time_s: 0.0,
            position_m: Vector3::new(error, 0.0, 1.0),
            attitude: Attitude::default(),
            velocity_body_m_s: Vector3::zeros(),
            rate_body_rad_s: Vector3::zeros(),
            estimate_m: Vector3::zeros(),
            design_m: Vector3::new(0.0, 0.0, 1.0),
            motors: [0.0; 4],
            letter,
        };
        let samples = vec![sample(9.0, None), sample(3.0, Some(0)), sample(-4.0, Some(1))];
        let flight = Flight { samples, ..Flight::default() };
        assert_eq!(rmse_m(&flight), Some(Vector3::new(12.5_f64.sqrt(), 0.0, 0.0)));
        assert_eq!(mean_error_m(&flight), Some(Vector3::new(-0.5, 0.0, 0.0)));
        assert_eq!(rmse_m(&Flight::default()), None, "no letter, no figure");
    }
}
