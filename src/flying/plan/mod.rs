//! Plan: strokes become setpoints with time stamps and a light schedule.
//!
//! Product in: [`Strokes`]. Product out: [`Plan`], everything that is sent to one drone. The plane
//! of the word is the world's x-z plane at y = 0.
//!
//! Method: the strokes are shared out among the drones ([`fleet`]), and each share becomes a design
//! path ([`plan()`]). For a known drone, setpoints are then fed through the inverse of its position
//! loop ([`feedforward`]), and light commands are timed on a rehearsed flight ([`time_lights`]).
//!
//! There are two styles of flying. `team`: letter by letter with waits, as the reference flight of
//! 2022 went. `even`: strokes in the order with the least dark time (Held–Karp, 2-opt), corners
//! rounded within a stated error, constant speed where the limits permit, light dimmed with the
//! speed where they do not, and time-optimal jerk-limited transits in the dark (Ruckig).

use std::collections::BTreeMap;

use nalgebra::Vector3;

use noctograph_core::error::Result;
use noctograph_core::flight::table::on_grid;
use noctograph_core::strokes::Strokes;

pub mod csv;
mod even;
pub mod feedforward;
mod fleet;
mod lamp;
mod light_letters;
mod light_timing;
mod motion;
mod options;
mod order;
mod pen;
mod relight;
mod replay;
mod smoothing;
mod speed;
mod stroke_ends;
mod team;
mod transit;

pub use fleet::{Approach, MIN_HORIZONTAL_M, MIN_VERTICAL_M, closest, conflict, fleet, wake};
pub use lamp::LampTiming;
pub use light_timing::{Between, time_lights};
pub use noctograph_core::lamps::HEADLIGHTS;
pub use options::{
    EvenStyle, Extent, LightClock, LightLevel, Order, PlanOptions, ReferenceKind, Style, TeamStyle,
};
pub use relight::relight;
pub use replay::{Replay, replay};
pub use stroke_ends::{StrokeEnd, stroke_ends};

/// Everything that is sent to one drone, in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Setpoints; each is held until the next. A setpoint at or below the floor (z ≤ 0) asks for
    /// motors off.
    pub setpoints: Vec<Setpoint>,
    /// Light commands sent with each setpoint: one column per channel, 0 (off) to 1, each as long
    /// as `setpoints`.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// Light level of the design at each setpoint, where commands are sent ahead of it
    /// ([`time_lights`]); as long as `setpoints`, or empty where it equals `lights`. See
    /// [`Plan::lit()`].
    pub lit: Vec<f64>,
    /// Positions that are sent in place of the setpoints' own ([`feedforward`]); as long as
    /// `setpoints`, or empty. See [`Plan::sent_m()`].
    pub sent_m: Vec<Vector3<f64>>,
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
    /// Index of the letter that is being written; `None` during take-off and landing.
    pub letter: Option<usize>,
}

impl Plan {
    /// When the last setpoint is sent: the end of the plan.
    pub fn duration_s(&self) -> f64 {
        self.setpoints.last().map_or(0.0, |last| last.time_s)
    }

    /// The plan, lights and all, by a clock of a rate, in true seconds a second.
    #[must_use]
    pub fn paced(mut self, rate: f64) -> Self {
        for setpoint in &mut self.setpoints {
            setpoint.time_s = on_grid(setpoint.time_s / rate);
            setpoint.velocity_m_s = (setpoint.velocity_m_s * rate).map(on_grid);
            setpoint.acceleration_m_s2 = (setpoint.acceleration_m_s2 * (rate * rate)).map(on_grid);
        }
        self
    }

    /// The position that is sent with a setpoint.
    pub fn sent_m(&self, row: usize) -> Vector3<f64> {
        self.sent_m.get(row).copied().unwrap_or_else(|| self.setpoints[row].position_m)
    }

    /// Row of the setpoint in force at a time; before the first one, its row.
    pub fn row_at(&self, time_s: f64) -> usize {
        self.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s).saturating_sub(1)
    }

    /// The setpoint in force at a time; before the first one, that one.
    pub fn setpoint_at(&self, time_s: f64) -> Option<&Setpoint> {
        self.setpoints.get(self.row_at(time_s))
    }

    /// Position of the design at a time; before the first setpoint, at it. The origin for a plan
    /// without any.
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        match self.setpoint_at(time_s) {
            Some(setpoint) => setpoint.design_m(time_s.max(setpoint.time_s)),
            None => Vector3::zeros(),
        }
    }

    /// Channels that switch lamps. `ring.red` is no lamp but the color of one where there is a
    /// channel `ring`.
    pub fn lamps(&self) -> impl Iterator<Item = (&String, &Vec<f64>)> {
        let is_color = |channel: &str| {
            let lamp = channel.rsplit_once('.').map(|(lamp, _)| lamp);
            lamp.is_some_and(|lamp| self.lights.contains_key(lamp))
        };
        self.lights.iter().filter(move |(channel, _)| !is_color(channel))
    }

    /// Level that is commanded from each setpoint on: the highest of all lamps.
    pub fn commanded(&self) -> Vec<f64> {
        let lamps: Vec<&Vec<f64>> = self.lamps().map(|(_, levels)| levels).collect();
        let highest = |row: usize| lamps.iter().map(|levels| levels[row]).fold(0.0, f64::max);
        (0..self.setpoints.len()).map(highest).collect()
    }

    /// Light level of the design from each setpoint on: that of the commands where these are not
    /// sent ahead of it.
    pub fn lit(&self) -> Vec<f64> {
        if self.lit.is_empty() { self.commanded() } else { self.lit.clone() }
    }

    /// Time at full light that the design asks for: levels below 1 count in proportion.
    pub fn full_light_s(&self) -> f64 {
        let lit = self.lit();
        let rows = self.setpoints.windows(2).zip(&lit);
        rows.map(|(pair, level)| level * (pair[1].time_s - pair[0].time_s)).sum()
    }

    /// An empty plan with its light channels.
    fn with_channels(channels: &[String]) -> Self {
        let lights = channels.iter().map(|channel| (channel.clone(), Vec::new())).collect();
        Self { lights, ..Self::default() }
    }

    /// Adds a setpoint with one level for all channels.
    fn push(&mut self, setpoint: Setpoint, level: f64) {
        self.setpoints.push(setpoint);
        self.lights.values_mut().for_each(|levels| levels.push(level));
    }
}

impl Setpoint {
    /// Position of the design at `time_s`, at or after this setpoint.
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        let dt = time_s - self.time_s;
        self.position_m + self.velocity_m_s * dt + self.acceleration_m_s2 * (0.5 * dt * dt)
    }

    /// Whether it asks for motors off.
    pub fn on_floor(&self) -> bool {
        self.position_m.z <= 0.0
    }
}

/// Plans the flight of one drone that writes all strokes, in the style of the options.
///
/// # Errors
///
/// [`Input`](noctograph_core::error::Error::Input) for an option out of range or a drawing without
/// light, [`Infeasible`](noctograph_core::error::Error::Infeasible) for a flight longer than an
/// hour and a drawing of more than 10 000 strokes.
pub fn plan(strokes: &Strokes, options: &PlanOptions) -> Result<Plan> {
    options.check()?;
    let plan = match &options.style {
        Style::Team(style) => team::plan(strokes, options, style)?,
        Style::Even(style) => {
            let strokes = order::in_order(strokes, options.stroke_speed_m_s, style)?;
            even::plan(&strokes, options, style, None)?
        }
    };
    Ok(adjusted(plan, options))
}

/// The plan with its heading, on the clock that will pace it, moved against the mean error of
/// earlier flights.
fn adjusted(plan: Plan, options: &PlanOptions) -> Plan {
    let plan = Plan { yaw_rad: options.yaw_rad, ..plan };
    let plan = match options.trajectory_clock {
        None | Some(1.0) => plan,
        Some(rate) => light_timing::on_trajectory_clock(plan, rate),
    };
    match Vector3::from(options.mean_error_m) {
        none if none == Vector3::zeros() => plan,
        mean_error_m => feedforward::offset(&plan, mean_error_m),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::written;
    use noctograph_core::error::Error;
    use noctograph_letters::{LetterOptions, write};

    fn noor(extent: Extent) -> Plan {
        written("NOOR", &PlanOptions { extent, ..PlanOptions::default() })
    }

    #[test]
    fn the_letters_of_noor_take_as_long_as_in_the_reference_flight() {
        let duration_s = noor(Extent::Letters).duration_s();
        assert!((duration_s - 46.118_038).abs() < 1e-5, "{duration_s} s instead of 46.118 s");
    }

    #[test]
    fn the_whole_flight_starts_and_ends_on_the_floor_in_the_dark() {
        let plan = noor(Extent::Whole);
        let (first, last) = (plan.setpoints[0], plan.setpoints[plan.setpoints.len() - 1]);
        assert_eq!((first.position_m, last.position_m), (Vector3::zeros(), Vector3::zeros()));
        let lit = &plan.lights["headlights"];
        assert_eq!((lit[0], lit[lit.len() - 1]), (0.0, 0.0), "dark at both ends");
        assert!(plan.setpoints.windows(2).all(|p| p[0].time_s < p[1].time_s), "time rises");
    }

    #[test]
    fn the_design_is_continuous_within_a_leg_and_steps_between_letters() {
        let plan = noor(Extent::Letters);
        let jumps: Vec<f64> = plan
            .setpoints
            .windows(2)
            .map(|p| (p[1].position_m - p[0].design_m(p[1].time_s)).norm())
            .filter(|jump| *jump > 1e-5)
            .collect();
        assert_eq!(jumps.len(), 4, "one step after each letter: {jumps:?}");
        assert!(jumps.iter().all(|jump| (jump - 0.1).abs() < 1e-5), "of 0.1 m: {jumps:?}");
    }

    #[test]
    fn headlights_are_lit_along_lit_strokes_only() {
        let plan = noor(Extent::Letters);
        let lit_s = plan.full_light_s();
        // N 1.583 m, O 1.6 m twice, R 0.5 + 0.3 + 0.25 + 0.3 + 0.391 m, at 0.2 m/s.
        let wanted_s = (1.583_095 + 2.0 * 1.6 + 1.740_512) / 0.2;
        assert!((lit_s - wanted_s).abs() < 1e-3, "{lit_s} s lit instead of {wanted_s} s");
    }

    #[test]
    fn an_endless_flight_is_refused() {
        let options = LetterOptions { cap_height_m: 100.0, ..LetterOptions::default() };
        let strokes = write("NOOR", &options).unwrap();
        let error = plan(&strokes, &PlanOptions { stroke_speed_m_s: 0.01, ..Default::default() });
        assert!(matches!(error, Err(Error::Infeasible { .. })), "{error:?}");
    }
}
