//! How a word is flown: the reference team's way, or evenly at the limits.

use serde::{Deserialize, Serialize};

use crate::error::{Result, within};

/// How a word is flown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlanOptions {
    /// Whose way of flying. In a scene file it also settles the default of every other key here.
    pub style: Style,
    /// Which part of the flight is planned.
    pub extent: Extent,
    /// Light channels that a lit stroke switches on: `headlights`, `ring`, `color-led`, or what the
    /// scene's lamps listen to.
    pub lights: Vec<String>,
    /// Speed along every leg; `even`: along lit strokes.
    pub stroke_speed_m_s: f64,
    /// Time between two setpoints on a leg; the drone holds each until the next.
    pub setpoint_interval_s: f64,
    /// `team`: step to the right of a letter's box when it is done.
    pub step_m: f64,
    /// `team`: wait after that step, in the dark.
    pub letter_wait_s: f64,
    /// Wait on the floor with motors off, before take-off and after landing.
    pub floor_wait_s: f64,
    /// `team`: height of the first setpoint in the air.
    pub lift_off_height_m: f64,
    /// `team`: height at which the way to the first letter ends.
    pub approach_height_m: f64,
    /// Height to which the drone sinks after the last letter, and at which it returns (`team`) or
    /// switches its motors off (`even`).
    pub landing_height_m: f64,
    /// `even`: in which order strokes are drawn.
    pub order: Order,
    /// `even`: greatest speed in the dark.
    pub dark_speed_m_s: f64,
    /// `even`: greatest acceleration of the design.
    pub acceleration_m_s2: f64,
    /// `even`: greatest jerk of the design. More takes corners faster and asks for quicker tilts.
    pub jerk_m_s3: f64,
    /// `even`: how far a rounded corner may lie from the drawn one.
    pub corner_error_m: f64,
    /// `even`: what keeps the exposure even where the drone must slow down.
    pub exposure: LightLevel,
    /// Drones that share the strokes.
    pub drones: u32,
    /// What is sent to controllers.
    pub reference: ReferenceKind,
    /// Mean of `flown − design` per world axis in an earlier flight: setpoints are moved against
    /// it.
    pub mean_error_m: [f64; 3],
    /// Whose time the light commands follow.
    pub light_clock: LightClock,
    /// Rate of the clock that paces the setpoints, in true seconds per second: 1 for a host that
    /// sends them, 84/85 for a trajectory on board of firmware before August 2026 (`usec_time.c`),
    /// while light commands from the host keep true time.
    pub trajectory_clock: f64,
}

/// Whose way of flying.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// The reference team's: letter by letter at one speed, with waits, lights with the setpoints.
    #[default]
    Team,
    /// Evenly exposed strokes in the shortest order, dark ways at the limits, light where the
    /// strokes are.
    Even,
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

/// Order and direction of strokes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// With the least time in the dark: exact for ten strokes, 2-opt and Or-opt beyond.
    #[default]
    Shortest,
    /// As drawn: handwriting keeps its order and its directions.
    Drawn,
}

/// What happens to the light where a lit stroke is flown slower than the rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightLevel {
    /// It is dimmed with the speed, so that every millimetre gets as much light.
    #[default]
    Dimmed,
    /// It is only switched, as the headlights of the LED-ring deck must be: corners get brighter.
    Switched,
}

/// What is sent as the position of a setpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReferenceKind {
    /// The design, which a controller of held positions trails.
    #[default]
    Design,
    /// What leads such a controller along the design: the design through the inverse of the closed
    /// loop. Controllers that follow the design's motion get the design.
    Inverse,
}

/// Whose time the light commands follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightClock {
    /// The setpoints': the light changes when the setpoint is sent, wherever the drone is.
    #[default]
    Setpoint,
    /// The light's: each command is sent so that after radio, lamp timer and ramp the light changes
    /// where the flown drone is at the stroke's end.
    Light,
}

impl Default for PlanOptions {
    /// The reference flight of 2022.
    fn default() -> Self {
        Self {
            style: Style::Team,
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
            order: Order::Shortest,
            dark_speed_m_s: 1.0,
            acceleration_m_s2: 2.0,
            jerk_m_s3: 30.0,
            corner_error_m: 0.01,
            exposure: LightLevel::Dimmed,
            drones: 1,
            reference: ReferenceKind::Design,
            mean_error_m: [0.0; 3],
            light_clock: LightClock::Setpoint,
            trajectory_clock: 1.0,
        }
    }
}

impl PlanOptions {
    /// Evenly exposed strokes at the limits of a Crazyflie indoors: 0.2 m/s while lit, 1 m/s and
    /// 2 m/s² (whoenig's conservative figures in firmware issue 882 are 0.5 m/s and 2 m/s²), 30 m/s³
    /// (a tilt of 11.5° in 0.07 s, a third of what its attitude loop does), setpoints at 20 Hz.
    #[must_use]
    pub fn even() -> Self {
        Self {
            style: Style::Even,
            setpoint_interval_s: 0.05,
            floor_wait_s: 0.3,
            landing_height_m: 0.03,
            reference: ReferenceKind::Inverse,
            light_clock: LightClock::Light,
            ..Self::default()
        }
    }

    /// The defaults of a style.
    #[must_use]
    pub fn of(style: Style) -> Self {
        match style {
            Style::Team => Self::default(),
            Style::Even => Self::even(),
        }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`crate::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("plan.stroke_speed_m_s", self.stroke_speed_m_s, 0.001, 100.0)?;
        within("plan.setpoint_interval_s", self.setpoint_interval_s, 0.001, 10.0)?;
        within("plan.step_m", self.step_m, 0.0, 10.0)?;
        within("plan.letter_wait_s", self.letter_wait_s, 0.0, 600.0)?;
        within("plan.floor_wait_s", self.floor_wait_s, 0.0, 600.0)?;
        within("plan.lift_off_height_m", self.lift_off_height_m, 0.001, 1000.0)?;
        within("plan.approach_height_m", self.approach_height_m, 0.001, 1000.0)?;
        within("plan.landing_height_m", self.landing_height_m, 0.001, 1000.0)?;
        within("plan.dark_speed_m_s", self.dark_speed_m_s, 0.01, 100.0)?;
        within("plan.acceleration_m_s2", self.acceleration_m_s2, 0.01, 100.0)?;
        within("plan.jerk_m_s3", self.jerk_m_s3, 0.1, 10_000.0)?;
        within("plan.corner_error_m", self.corner_error_m, 0.0001, 1.0)?;
        within("plan.drones", f64::from(self.drones), 1.0, 16.0)?;
        for error_m in self.mean_error_m {
            within("plan.mean_error_m", error_m, -10.0, 10.0)?;
        }
        within("plan.trajectory_clock", self.trajectory_clock, 0.9, 1.1)
    }
}
