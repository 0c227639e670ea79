//! Plan: everything that is sent to one drone, as plain data.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::error::Result;
use crate::flight::table::on_grid;
use crate::product::{
    Rules, Valid, check_length, check_levels, check_times, is_number, odd_number,
};

pub mod csv;

/// Everything that is sent to one drone, in order of time.
pub type Plan = Valid<PlanData>;

/// The data of a [`Plan`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanData {
    /// Setpoints, each held until the next. One at or below the floor (z ≤ 0) asks for motors off.
    pub setpoints: Vec<Setpoint>,
    /// Light commands sent with each setpoint: one column per channel, 0 (off) to 1.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// Light level of the design at each setpoint, if commands are sent ahead of it (light timing),
    /// or empty if it equals `lights`. See [`PlanData::lit()`].
    pub lit: Vec<f64>,
    /// Positions that are sent in place of the setpoints' own (feedforward), or empty. See
    /// [`PlanData::sent_m()`].
    pub sent_m: Vec<Vector3<f64>>,
    /// Jerk of a trajectory on board at each setpoint, m/s³, or empty: setpoints that are sent
    /// carry none. See [`PlanData::jerk_m_s3()`].
    pub jerk_m_s3: Vec<Vector3<f64>>,
    /// Heading of the nose over the whole flight, from world x toward y.
    pub yaw_rad: f64,
}

/// One packet to the drone: where it should be now, and how the design moves on from there.
///
/// Until the next setpoint the design position is
/// `position + velocity Δt + acceleration Δt² / 2`. A controller that reads positions only holds
/// `position` instead, and lags.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Since the first setpoint.
    pub time_s: f64,
    /// World frame.
    pub position_m: Vector3<f64>,
    /// World frame.
    pub velocity_m_s: Vector3<f64>,
    /// World frame.
    pub acceleration_m_s2: Vector3<f64>,
    /// Index of the letter that is being written, or `None` during take-off and landing.
    pub letter: Option<usize>,
}

impl PlanData {
    /// Time of the last setpoint, or 0 for an empty plan.
    pub fn duration_s(&self) -> f64 {
        self.setpoints.last().map_or(0.0, |last| last.time_s)
    }

    /// The plan as a clock runs it that counts `rate` true seconds a second. Times are divided by
    /// the rate, and derivatives scaled to match.
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

    /// Returns the position that is sent for a setpoint: the feedforward position if there is one,
    /// else the setpoint's own.
    pub fn sent_m(&self, row: usize) -> Vector3<f64> {
        self.sent_m.get(row).copied().unwrap_or_else(|| self.setpoints[row].position_m)
    }

    /// The jerk of the trajectory on board at a setpoint, or zero without one.
    pub fn jerk_m_s3(&self, row: usize) -> Vector3<f64> {
        self.jerk_m_s3.get(row).copied().unwrap_or_default()
    }

    /// Row of the setpoint in force at a time, or 0 before the first.
    pub fn row_at(&self, time_s: f64) -> usize {
        self.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s).saturating_sub(1)
    }

    /// The setpoint in force at a time, or the first one before it. `None` for an empty plan.
    pub fn setpoint_at(&self, time_s: f64) -> Option<&Setpoint> {
        self.setpoints.get(self.row_at(time_s))
    }

    /// Position of the design at a time, or the origin for an empty plan.
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        match self.setpoint_at(time_s) {
            Some(setpoint) => setpoint.design_m(time_s.max(setpoint.time_s)),
            None => Vector3::zeros(),
        }
    }

    /// Names and levels of the channels that switch lamps. A channel `ring.red` only sets a color
    /// if there is a channel `ring`.
    pub fn lamps(&self) -> impl Iterator<Item = (&String, &Vec<f64>)> {
        self.lights.iter().filter(|(channel, _)| {
            let lamp = channel.rsplit_once('.').map(|(lamp, _)| lamp);
            !lamp.is_some_and(|lamp| self.lights.contains_key(lamp))
        })
    }

    /// Light level that is commanded at each setpoint: the highest of all lamps.
    pub fn commanded(&self) -> Vec<f64> {
        let mut highest = vec![0.0; self.setpoints.len()];
        for (_, levels) in self.lamps() {
            highest
                .iter_mut()
                .zip(levels)
                .for_each(|(most, level)| *most = f64::max(*most, *level));
        }
        highest
    }

    /// Light level of the design at each setpoint, held until the next.
    pub fn lit(&self) -> Vec<f64> {
        if self.lit.is_empty() { self.commanded() } else { self.lit.clone() }
    }

    /// Time at full light in the design, s. Levels below 1 count in proportion.
    pub fn full_light_s(&self) -> f64 {
        let lit = self.lit();
        let rows = self.setpoints.windows(2).zip(&lit);
        rows.map(|(pair, level)| level * (pair[1].time_s - pair[0].time_s)).sum()
    }

    /// An empty plan with its light channels.
    pub fn with_channels(channels: &[String]) -> Self {
        let lights = channels.iter().map(|channel| (channel.clone(), Vec::new())).collect();
        Self { lights, ..Self::default() }
    }

    /// Adds a setpoint with one level for all channels.
    pub fn push(&mut self, setpoint: Setpoint, level: f64) {
        self.setpoints.push(setpoint);
        self.lights.values_mut().for_each(|levels| levels.push(level));
    }
}

impl Rules for PlanData {
    /// Checks times, numbers, lights, and the lengths of optional columns.
    fn check(&self) -> Result<()> {
        // Setpoints by row, then columns beside them.
        let n = self.setpoints.len();
        check_times(self.setpoints.iter().map(|setpoint| setpoint.time_s))?;
        for (row, setpoint) in self.setpoints.iter().enumerate() {
            let Setpoint { position_m, velocity_m_s, acceleration_m_s2, .. } = setpoint;
            let vectors = [position_m, velocity_m_s, acceleration_m_s2];
            let mut numbers = vectors.into_iter().flatten().copied();
            if let Some(odd) = numbers.clone().position(|value| !is_number(value)) {
                let value = numbers.nth(odd).expect("it was there");
                return Err(odd_number(csv::COLUMNS[1 + odd], row, value));
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
        match is_number(self.yaw_rad) {
            true => Ok(()),
            false => Err(odd_number("yaw_rad", 0, self.yaw_rad)),
        }
    }
}

impl Setpoint {
    /// Position of the design at `time_s`, at or after this setpoint.
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        let dt = time_s - self.time_s;
        self.position_m + self.velocity_m_s * dt + self.acceleration_m_s2 * (0.5 * dt * dt)
    }

    /// True if the setpoint asks for motors off.
    pub fn on_floor(&self) -> bool {
        self.position_m.z <= 0.0
    }
}
