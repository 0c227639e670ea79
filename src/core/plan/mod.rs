//! Plan, which contains everything that is sent to one drone.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::error::Result;
use crate::flight::table::on_grid;
use crate::product::{
    Rules, Valid, check_length, check_levels, check_times, is_number, odd_number,
};

pub mod csv;

/// Everything that is sent to one drone, in chronological order.
pub type Plan = Valid<PlanData>;

/// Data of a [`Plan`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanData {
    /// Setpoints, each of which is held until the next. A setpoint at or below the floor (z ≤ 0)
    /// turns the motors off.
    pub setpoints: Vec<Setpoint>,
    /// Light commands sent with each setpoint, in one column per channel, from 0 (off) to 1.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// Light level of the design at each setpoint if commands are sent ahead of it (light timing),
    /// or empty if it equals `lights`. [`PlanData::lit()`] resolves the empty case.
    pub lit: Vec<f64>,
    /// Positions that are sent in place of the setpoints' positions (feedforward), or empty.
    /// [`PlanData::sent_m()`] resolves the empty case.
    pub sent_m: Vec<Vector3<f64>>,
    /// Jerk of an onboard trajectory at each setpoint in m/s³, or empty because streamed setpoints
    /// have none. [`PlanData::jerk_m_s3()`] resolves the empty case.
    pub jerk_m_s3: Vec<Vector3<f64>>,
    /// Heading of the nose during the whole flight in rad, from world x toward y.
    pub yaw_rad: f64,
}

/// Packet sent to the drone, which contains the desired state and defines the design that follows.
///
/// Until the next setpoint, the design position is `position + velocity Δt + acceleration Δt² / 2`.
/// A controller that reads only positions aims at `position` instead, and lags behind the design.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Time since the first setpoint in s.
    pub time_s: f64,
    /// Position in the world frame in m.
    pub position_m: Vector3<f64>,
    /// Velocity in the world frame in m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Acceleration in the world frame in m/s².
    pub acceleration_m_s2: Vector3<f64>,
    /// Index of the letter that is being written, or `None` outside letters.
    pub letter: Option<usize>,
}

impl PlanData {
    /// Returns the time of the last setpoint in s, or 0 for an empty plan.
    pub fn duration_s(&self) -> f64 {
        self.setpoints.last().map_or(0.0, |last| last.time_s)
    }

    /// Returns the plan as executed by a clock that advances by `rate` seconds per true second.
    /// Times are divided by the rate, and derivatives are scaled to match.
    #[must_use]
    pub fn paced(mut self, rate: f64) -> Self {
        for setpoint in &mut self.setpoints {
            setpoint.time_s = on_grid(setpoint.time_s / rate);
            setpoint.velocity_m_s = (setpoint.velocity_m_s * rate).map(on_grid);
            setpoint.acceleration_m_s2 = (setpoint.acceleration_m_s2 * (rate * rate)).map(on_grid);
        }
        for jerk_m_s3 in &mut self.jerk_m_s3 {
            *jerk_m_s3 = (*jerk_m_s3 * (rate * rate * rate)).map(on_grid);
        }
        self
    }

    /// Returns the position that is sent for a setpoint, which is the feedforward position, or the
    /// setpoint's position if there is none.
    pub fn sent_m(&self, row: usize) -> Vector3<f64> {
        self.sent_m.get(row).copied().unwrap_or_else(|| self.setpoints[row].position_m)
    }

    /// Returns the jerk of the onboard trajectory at a setpoint, or zero if there is none.
    pub fn jerk_m_s3(&self, row: usize) -> Vector3<f64> {
        self.jerk_m_s3.get(row).copied().unwrap_or_default()
    }

    /// Returns the row of the setpoint in force at a time, or 0 before the first.
    pub fn row_at(&self, time_s: f64) -> usize {
        self.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s).saturating_sub(1)
    }

    /// Returns the setpoint in force at a time, or the first one at an earlier time. Returns `None`
    /// for an empty plan.
    pub fn setpoint_at(&self, time_s: f64) -> Option<&Setpoint> {
        self.setpoints.get(self.row_at(time_s))
    }

    /// Returns the position of the design in m at a time, or the origin for an empty plan. Before
    /// the first setpoint, this is its position.
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        match self.setpoint_at(time_s) {
            Some(setpoint) => setpoint.design_m(time_s.max(setpoint.time_s)),
            None => Vector3::zeros(),
        }
    }

    /// Returns the names and levels of the channels that switch lamps. A channel such as `ring.red`
    /// is not a lamp if there is also a channel `ring`.
    pub fn lamps(&self) -> impl Iterator<Item = (&String, &Vec<f64>)> {
        self.lights.iter().filter(|(channel, _)| {
            let lamp = channel.rsplit_once('.').map(|(lamp, _)| lamp);
            !lamp.is_some_and(|lamp| self.lights.contains_key(lamp))
        })
    }

    /// Returns the light level, 0 to 1, commanded at each setpoint, which is the highest of all
    /// lamps.
    pub fn commanded(&self) -> Vec<f64> {
        let mut highest = vec![0.0; self.setpoints.len()];
        for (_, levels) in self.lamps() {
            for (most, level) in highest.iter_mut().zip(levels) {
                *most = f64::max(*most, *level);
            }
        }
        highest
    }

    /// Returns the light level of the design at each setpoint, which is held until the next.
    pub fn lit(&self) -> Vec<f64> {
        if self.lit.is_empty() { self.commanded() } else { self.lit.clone() }
    }

    /// Returns the duration of full light in the design in s. Lower levels count in proportion.
    pub fn full_light_s(&self) -> f64 {
        let lit = self.lit();
        let rows = self.setpoints.windows(2).zip(&lit);
        rows.map(|(pair, level)| level * (pair[1].time_s - pair[0].time_s)).sum()
    }

    /// Creates an empty plan with the given light channels.
    pub fn with_channels(channels: &[String]) -> Self {
        let lights = channels.iter().map(|channel| (channel.clone(), Vec::new())).collect();
        Self { lights, ..Self::default() }
    }

    /// Adds a setpoint with the same level for all channels.
    pub fn push(&mut self, setpoint: Setpoint, level: f64) {
        self.setpoints.push(setpoint);
        self.lights.values_mut().for_each(|levels| levels.push(level));
    }
}

impl Rules for PlanData {
    /// Checks that times do not decrease, that numbers are finite, and that lights and optional
    /// columns suit the setpoints.
    fn check(&self) -> Result<()> {
        // Setpoints are checked row by row, followed by the columns beside them.
        let n = self.setpoints.len();
        check_times(self.setpoints.iter().map(|setpoint| setpoint.time_s))?;
        for (row, setpoint) in self.setpoints.iter().enumerate() {
            let Setpoint { position_m, velocity_m_s, acceleration_m_s2, .. } = setpoint;
            // The columns of these vectors follow that of the time.
            let vectors = [position_m, velocity_m_s, acceleration_m_s2];
            let numbers = vectors.into_iter().flatten().zip(&csv::COLUMNS[1..]);
            if let Some((value, column)) = { numbers }.find(|(value, _)| !is_number(**value)) {
                return Err(odd_number(column, row, *value));
            }
        }
        for (channel, levels) in &self.lights {
            check_levels(&format!("light.{channel}"), levels, n)?;
        }
        if !self.lit.is_empty() {
            check_levels("lit", &self.lit, n)?;
        }
        for (name, vectors) in [("sent_m", &self.sent_m), ("jerk_m_s3", &self.jerk_m_s3)] {
            if !vectors.is_empty() {
                check_length(name, vectors.len(), n)?;
            }
            for (row, vector) in vectors.iter().enumerate() {
                if let Some(value) = vector.iter().find(|value| !is_number(**value)) {
                    return Err(odd_number(name, row, *value));
                }
            }
        }
        if is_number(self.yaw_rad) { Ok(()) } else { Err(odd_number("yaw_rad", 0, self.yaw_rad)) }
    }
}

impl Setpoint {
    /// Returns the position of the design at `time_s`, which must not precede this setpoint.
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        let dt = time_s - self.time_s;
        self.position_m + self.velocity_m_s * dt + self.acceleration_m_s2 * (0.5 * dt * dt)
    }

    /// True if the setpoint turns the motors off.
    pub fn on_floor(&self) -> bool {
        self.position_m.z <= 0.0
    }
}
