//! Plan: strokes become setpoints with time stamps and a light schedule.
//!
//! Product in: [`Strokes`]. Product out: [`Plan`], the list of what is sent to the drone.
//! The plane of the word becomes the world's x-z plane at y = 0.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use crate::geometry::polyline_length_m;
use crate::letters::Strokes;

pub mod csv;
mod relight;
mod replay;
mod tour;

pub use relight::relight;
pub use replay::{Replay, replay};

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

/// How a word is flown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanOptions {
    /// Which part of the flight is planned.
    pub extent: Extent,
    /// Light channels that a lit stroke switches on: `headlights`, `ring`, `color-led`, or what the
    /// scene's lamps listen to.
    pub lights: Vec<String>,
    /// Speed along every leg.
    pub stroke_speed_m_s: f64,
    /// Time between two setpoints on a leg; the drone holds each until the next.
    pub setpoint_interval_s: f64,
    /// Step to the right of a letter's box when it is done.
    pub step_m: f64,
    /// Wait after that step, in the dark.
    pub letter_wait_s: f64,
    /// Wait on the floor with motors off, before take-off and after landing.
    pub floor_wait_s: f64,
    /// Height of the first setpoint in the air.
    pub lift_off_height_m: f64,
    /// Height at which the way to the first letter ends.
    pub approach_height_m: f64,
    /// Height to which the drone sinks after the last letter, and at which it returns.
    pub landing_height_m: f64,
}

/// Part of a flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Extent {
    /// From the floor to the floor.
    #[default]
    Whole,
    /// From rest at the first letter to the end of the last wait.
    Letters,
}

impl Default for PlanOptions {
    /// The reference flight of 2022.
    fn default() -> Self {
        Self {
            extent: Extent::Whole,
            lights: vec!["headlights".to_owned()],
            stroke_speed_m_s: 0.2,
            setpoint_interval_s: 0.1,
            step_m: 0.1,
            letter_wait_s: 2.0,
            floor_wait_s: 1.1,
            lift_off_height_m: 0.1,
            approach_height_m: 0.3,
            landing_height_m: 0.15,
        }
    }
}

impl PlanOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("plan.stroke_speed_m_s", self.stroke_speed_m_s, 0.001, 100.0)?;
        within("plan.setpoint_interval_s", self.setpoint_interval_s, 0.001, 10.0)?;
        within("plan.step_m", self.step_m, 0.0, 10.0)?;
        within("plan.letter_wait_s", self.letter_wait_s, 0.0, 600.0)?;
        within("plan.floor_wait_s", self.floor_wait_s, 0.0, 600.0)?;
        within("plan.lift_off_height_m", self.lift_off_height_m, 0.001, 1000.0)?;
        within("plan.approach_height_m", self.approach_height_m, 0.001, 1000.0)?;
        within("plan.landing_height_m", self.landing_height_m, 0.001, 1000.0)
    }
}

/// Longest flight that is planned: an hour, twelve times a Crazyflie's battery.
const MAX_DURATION_S: f64 = 3600.0;

/// Plans the flight that writes a word, as the reference team flew it.
///
/// # Errors
///
/// [`Error::Input`] for an option out of range, [`Error::Infeasible`] for a flight longer than an
/// hour.
pub fn plan(strokes: &Strokes, options: &PlanOptions) -> Result<Plan> {
    options.check()?;
    let duration_s = longest_duration_s(strokes, options);
    if duration_s > MAX_DURATION_S {
        return Err(Error::Infeasible {
            what: format!("the flight would take up to {duration_s:.0} s, more than an hour"),
            hint: "raise plan.stroke_speed_m_s, or write a shorter or smaller word".into(),
        });
    }
    Ok(tour::tour(strokes, options))
}

/// No flight of these strokes lasts longer: all strokes, waits and ways to and from the word.
fn longest_duration_s(strokes: &Strokes, options: &PlanOptions) -> f64 {
    let moves = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves);
    let strokes_m: f64 = moves.map(|m| polyline_length_m(&[m.from_m, m.to_m])).sum();
    let [left, bottom, right, top] = strokes.bounds_m();
    let ways_m = 2.0 * (left.abs() + right.abs() + bottom.abs() + top.abs() + options.step_m)
        + options.approach_height_m
        + options.landing_height_m;
    let waits_s: f64 = strokes.glyphs.iter().map(|_| options.letter_wait_s).sum();
    (strokes_m + ways_m) / options.stroke_speed_m_s + waits_s + 2.0 * options.floor_wait_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};

    fn noor(extent: Extent) -> Plan {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        plan(&strokes, &PlanOptions { extent, ..PlanOptions::default() }).unwrap()
    }

    #[test]
    fn the_letters_of_noor_take_as_long_as_the_teams() {
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
        let lit_s: f64 = plan
            .setpoints
            .windows(2)
            .zip(&plan.lights["headlights"])
            .map(|(p, level)| (p[1].time_s - p[0].time_s) * level)
            .sum();
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
