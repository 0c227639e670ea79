//! Plan: strokes become setpoints with time stamps and a light schedule.
//!
//! Product in: [`Strokes`]. Product out: [`Plan`], the list of what is sent to the drone.
//! The plane of the word becomes the world's x-z plane at y = 0.

use std::collections::BTreeMap;

use nalgebra::Vector3;

/// What is sent to the drone, in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Setpoints; each is held until the next. A setpoint at or below the floor (z ≤ 0) asks for
    /// motors off.
    pub setpoints: Vec<Setpoint>,
    /// Light commands sent with each setpoint: one column per channel, 0 (off) to 1, each as long
    /// as `setpoints`.
    pub lights: BTreeMap<String, Vec<f64>>,
}

/// One packet to the drone: where it should be now, and how the design moves on from there.
///
/// Until the next setpoint the design position is
/// `position + velocity Δt + acceleration Δt² / 2`; a controller that knows only positions holds
/// `position` instead, and trails.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Since the first setpoint.
    pub time_s: f64,
    /// World frame.
    pub position_m: Vector3<f64>,
    /// World frame.
    pub velocity_m_s: Vector3<f64>,
    /// World frame.
    pub acceleration_m_s2: Vector3<f64>,
    /// Index of the letter that is being written; `None` during take-off and landing.
    pub letter: Option<usize>,
}

impl Plan {
    /// When the last setpoint is sent: the end of the plan.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.setpoints.last().map_or(0.0, |last| last.time_s)
    }
}

impl Setpoint {
    /// Where the design is at `time_s`, at or after this setpoint.
    #[must_use]
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        let dt = time_s - self.time_s;
        self.position_m + self.velocity_m_s * dt + self.acceleration_m_s2 * (0.5 * dt * dt)
    }
}
