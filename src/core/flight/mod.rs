//! Flights, with motion, estimate, setpoints, motor commands and lights of one drone over time.
//!
//! Both the simulator and the log readers produce flights, and later stages treat both alike.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use crate::diagnostic::Diagnostic;
use crate::error::{Error, Result};
use crate::geometry::Attitude;
use crate::product::{
    Rules, Valid, check_length, check_levels, check_times, is_number, odd_number,
};

mod airborne;
pub mod csv;
pub mod table;
pub mod timestamps;
pub mod warning;

pub use crate::place::DroneIndex;
pub use airborne::{airborne, on_floor, rests_on_floor, saturated_s};

/// Name of a simulated flight's column with the total time so far, in s, during which a motor or
/// the battery was at its limit.
pub const SATURATED_S: &str = "saturated_s";
/// Name of a simulated flight's column with the battery voltage under load, in V.
pub const BATTERY_V: &str = "battery_v";
/// Name of a simulated flight's column with the energy drawn from the battery so far, in J.
pub const ENERGY_J: &str = "energy_j";
/// Name of the column with the estimator's standard deviation of the position over all three axes
/// in m, for a flight simulated with the estimator `cooperative`.
pub const ESTIMATE_SIGMA_M: &str = "estimate_sigma_m";
/// Name of the column with the normalized squared error of the estimated position (NEES), for a
/// flight simulated with the estimator `cooperative`. The value is 1 on average if the estimator's
/// covariance is correct.
pub const ESTIMATE_NEES: &str = "estimate_nees";

/// Flight of one drone, sampled over time.
pub type Flight = Valid<FlightData>;

/// Data of a [`Flight`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlightData {
    /// Samples in chronological order.
    pub samples: Vec<FlightSample>,
    /// Light commands in force at each sample, as received over the radio, in one column per
    /// channel with levels from 0 (off) to 1, each as long as `samples`.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// Further columns, each as long as `samples`. For a real log, the columns have the names and
    /// units of the log, and each value is held until the column's next one. A simulated flight has
    /// [`SATURATED_S`] and, if the drone has a battery, [`BATTERY_V`] and [`ENERGY_J`].
    pub extra: BTreeMap<String, Vec<f64>>,
    /// Gaps in a real log, as the times of the last sample before and the first sample after each,
    /// in ascending order. Because nothing is known about a gap, it contains no line and no light.
    pub gaps: Vec<[f64; 2]>,
    /// Quantities that the log lacks, and that are zero in the samples.
    pub unlogged: BTreeSet<Quantity>,
    /// Warnings about the flight.
    pub warnings: Vec<Diagnostic>,
}

impl FlightData {
    /// True if the flight contains a quantity.
    pub fn has(&self, quantity: Quantity) -> bool {
        !self.unlogged.contains(&quantity)
    }

    /// Returns the last value of a further column, or `None` if the flight lacks it.
    pub fn at_end(&self, column: &str) -> Option<f64> {
        self.extra.get(column)?.last().copied()
    }
}

impl Rules for FlightData {
    /// Checks times, numbers, lights, lengths of further columns, and gaps.
    fn check(&self) -> Result<()> {
        check_times(self.samples.iter().map(|sample| sample.time_s))?;
        for (row, sample) in self.samples.iter().enumerate() {
            // The times are checked separately, and a letter is always a valid number.
            let numbers = sample.numbers();
            if let Some(odd) = numbers[1..].iter().position(|value| !is_number(*value)) {
                let mut names = Quantity::TABLE.iter().flat_map(|(.., columns)| columns.iter());
                let name = names.nth(odd).expect("a letter is a number");
                return Err(odd_number(name, row, numbers[1 + odd]));
            }
        }
        for (channel, levels) in &self.lights {
            check_levels(&format!("light.{channel}"), levels, self.samples.len())?;
        }
        for (name, column) in &self.extra {
            check_length(name, column.len(), self.samples.len())?;
        }
        let ends_s = self.gaps.as_flattened();
        let is_wrong = |pair: &&[f64]| pair[0] > pair[1] || !(pair[0] + pair[1]).is_finite();
        match ends_s.windows(2).find(is_wrong) {
            None => Ok(()),
            Some(pair) => {
                let actual = format!("{} before {}", pair[0], pair[1]);
                let hint = "give each gap its beginning and its end";
                Err(Error::input("gaps", actual, "finite times in ascending order", hint))
            }
        }
    }
}

/// Quantity of a sample, which a log may lack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Position of the drone, [`FlightSample::position_m`].
    Position,
    /// Attitude of the drone, [`FlightSample::attitude`].
    Attitude,
    /// Velocity in the body frame, [`FlightSample::velocity_body_m_s`].
    Velocity,
    /// Angular velocity in the body frame, [`FlightSample::rate_body_rad_s`].
    Rate,
    /// Estimated position, [`FlightSample::estimate_m`].
    Estimate,
    /// Position of the design, [`FlightSample::design_m`].
    Design,
    /// Motor commands, [`FlightSample::motors`].
    Motors,
}

impl Quantity {
    /// Each quantity with its name in messages and its columns, in the order of a flight file.
    pub const TABLE: [(Self, &str, &[&str]); 7] = [
        (Self::Position, "position", &["x_m", "y_m", "z_m"]),
        (Self::Attitude, "attitude", &["yaw_rad", "pitch_rad", "roll_rad"]),
        (Self::Velocity, "velocity", &["vx_body_m_s", "vy_body_m_s", "vz_body_m_s"]),
        (Self::Rate, "body rate", &["wx_body_rad_s", "wy_body_rad_s", "wz_body_rad_s"]),
        (Self::Estimate, "estimated position", &["x_estimate_m", "y_estimate_m", "z_estimate_m"]),
        (Self::Design, "design position", &["x_design_m", "y_design_m", "z_design_m"]),
        (Self::Motors, "motor commands", &["m1", "m2", "m3", "m4"]),
    ];

    /// Returns the name of the quantity in messages.
    pub fn name(self) -> &'static str {
        Self::TABLE[self as usize].1
    }
}

/// Sample of a flight at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlightSample {
    /// Time in s since the first setpoint, or since the first sample of a real log.
    pub time_s: f64,
    /// Position of the body's origin in the world frame in m.
    pub position_m: Vector3<f64>,
    /// Attitude of the body in the world frame.
    pub attitude: Attitude,
    /// Velocity in the body frame in m/s.
    pub velocity_body_m_s: Vector3<f64>,
    /// Angular velocity in the body frame in rad/s.
    pub rate_body_rad_s: Vector3<f64>,
    /// Estimated position in m.
    pub estimate_m: Vector3<f64>,
    /// Position of the design at this instant in m. In a simulation, this position is continuous.
    /// In a real log, it is that of the held setpoint.
    pub design_m: Vector3<f64>,
    /// Motor commands m1…m4, from 0 to 65535.
    pub motors: [f64; 4],
    /// Index of the letter that is being written, or `None` outside letters, such as during
    /// take-off and landing.
    pub letter: Option<usize>,
}
