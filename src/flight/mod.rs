//! Flight: where the drone was, what it believed, what it was told, and its motors.
//!
//! A simulated flight and a real flight's log meet here; below nobody can tell them apart.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use crate::geometry::Attitude;

mod airborne;
pub mod comparison;
pub mod csv;
pub mod table;
pub mod tracking;

pub use airborne::{FLYING_MOTOR_COMMAND, airborne};
pub use tracking::{mean_error_m, mean_error_over_m, rmse_m, rmse_over_m};

/// Column of a simulated flight: time so far, s, in which a motor was asked for more or less than
/// it has, by its range or by the battery.
pub const SATURATED_S: &str = "saturated_s";
/// Column of a simulated flight: voltage of the battery under load, V.
pub const BATTERY_V: &str = "battery_v";
/// Column of a simulated flight: energy that has left the battery so far, J.
pub const ENERGY_J: &str = "energy_j";

/// A flight of one drone, sampled over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    /// Samples in rising order of time.
    pub samples: Vec<FlightSample>,
    /// Light commands in force at each sample, as received over the radio: one column per
    /// channel, 0 (off) to 1, each as long as `samples`.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// Further columns, each as long as `samples`. Of a real log: under the names and in the units
    /// of the log, held between their own samples. Of a simulated flight: [`SATURATED_S`] and, where
    /// the drone has a battery, [`BATTERY_V`] and [`ENERGY_J`].
    pub extra: BTreeMap<String, Vec<f64>>,
    /// Holes in a real log: times of the last sample before and of the first sample after, in
    /// rising order. Nothing is known in between: no line is drawn and no lamp shines across one.
    pub gaps: Vec<[f64; 2]>,
    /// What the log does not tell: the samples hold zeros there.
    pub unlogged: BTreeSet<Quantity>,
    /// What whoever reads the flight should know.
    pub warnings: Vec<String>,
}

/// Something that a sample tells, and a log may not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// [`FlightSample::position_m`].
    Position,
    /// [`FlightSample::attitude`].
    Attitude,
    /// [`FlightSample::velocity_body_m_s`].
    Velocity,
    /// [`FlightSample::rate_body_rad_s`].
    Rate,
    /// [`FlightSample::estimate_m`].
    Estimate,
    /// [`FlightSample::design_m`].
    Design,
    /// [`FlightSample::motors`].
    Motors,
}

impl Quantity {
    /// All of them, in the order of the file's columns.
    pub const ALL: [Self; 7] = [
        Self::Position,
        Self::Attitude,
        Self::Velocity,
        Self::Rate,
        Self::Estimate,
        Self::Design,
        Self::Motors,
    ];

    /// Its name in messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Attitude => "attitude",
            Self::Velocity => "velocity",
            Self::Rate => "body rate",
            Self::Estimate => "estimated position",
            Self::Design => "design position",
            Self::Motors => "motor commands",
        }
    }
}

/// One instant of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightSample {
    /// Since the first setpoint; in a real log, since its first sample.
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
    /// Where the design wanted the drone at this instant (continuous, not held; in a real log the
    /// setpoint in force, held).
    pub design_m: Vector3<f64>,
    /// Motor commands m1…m4, 0…65535.
    pub motors: [f64; 4],
    /// Index of the letter that is being written; `None` during take-off and landing.
    pub letter: Option<usize>,
}
