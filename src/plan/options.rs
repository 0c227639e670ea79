//! Options of planning.

use noctograph_core::error::Result;
use noctograph_core::settings::{Described, settings};

settings! {
    /// How a word is flown.
    pub struct PlanOptions {
        /// Light channels switched on along lit strokes: `headlights`, `ring`, `color-led` (the
        /// default if `light.deck` is set to it), or those of the lamps in `light.fixtures`.
        lights: Vec<String> = vec!["headlights".to_owned()];
        /// Speed along every segment. In style `even`, along lit strokes.
        stroke_speed_m_s: f64 = 0.2, in 0.001..=100.0;
        /// Time between two setpoints on a segment. The drone holds each until the next.
        setpoint_interval_s: f64 = 0.1, in 0.001..=10.0;
        /// Wait on the floor with motors off, before take-off and after landing.
        floor_wait_s: f64 = 1.1, in 0.0..=600.0;
        /// Height after the last letter at which the drone returns (`team`) or stops its motors
        /// (`even`).
        landing_height_m: f64 = 0.15, in 0.001..=1000.0;
        /// Number of drones that write the strokes together. More than one only in style `even`.
        drones: u32 = 1, in 1.0..=16.0;
        /// Position that is sent to the controller.
        reference: ReferenceKind = ReferenceKind::Design;
        /// Mean of `flown - design` per world axis in an earlier flight, subtracted from the
        /// setpoints.
        mean_error_m: [f64; 3] = [0.0; 3], in -10.0..=10.0;
        /// Clock of the light commands.
        light_clock: LightClock = LightClock::Setpoint;
        /// Heading of the nose from take-off to landing, from world x toward y. Place the drone
        /// with this heading. Headlights shine along it. At -π/2 they face the audience, one beside
        /// the other.
        yaw_rad: f64 = 0.0, in -3.15..=3.15;
        /// Way of flying. It also sets the defaults of the other keys of this table.
        style: Style = Style::default();
        fixed {
            /// Rate of the clock that paces the setpoints, in true seconds per second, while light
            /// commands from the host keep true time. By default 1 if the host sends them, and of a
            /// trajectory on board (`radio.setpoints`) that of `vehicle.firmware`: 84/85 up to and
            /// with release 2026.08 (`usec_time.c`).
            trajectory_clock: Option<f64> = None;
            /// Part of the flight that is planned.
            extent: Extent = Extent::Whole;
        }
    }

    /// Way of flying.
    pub enum Style tagged {
        /// The reference team's: letter by letter at one speed, with waits, lights with the
        /// setpoints.
        "team" => Team(TeamStyle),
        /// Evenly exposed strokes in the shortest order, fast transits in the dark, light timed on
        /// the strokes.
        "even" => Even(EvenStyle),
    }

    /// The reference team's way of flying, with the figures of their flight of December 2022.
    pub struct TeamStyle {
        /// Step to the right of a letter's box when it is done.
        step_m: f64 = 0.1, in 0.0..=10.0;
        /// Wait after that step, in the dark.
        letter_wait_s: f64 = 2.0, in 0.0..=600.0;
        /// Height of the first setpoint in the air.
        lift_off_height_m: f64 = 0.1, in 0.001..=1000.0;
        /// Height at the end of the way to the first letter.
        approach_height_m: f64 = 0.3, in 0.001..=1000.0;
    }

    /// Even strokes at the limits of a Crazyflie indoors.
    pub struct EvenStyle {
        /// Order and direction of strokes.
        order: Order = Order::Shortest;
        /// Hover before the first stroke, for the height to settle after take-off.
        hover_s: f64 = 1.0, in 0.0..=600.0;
        /// Greatest speed in the dark.
        dark_speed_m_s: f64 = 1.0, in 0.01..=100.0;
        /// Greatest acceleration of the design.
        ///
        /// Firmware issue 882 (whoenig) calls 2 m/s² at 0.5 m/s conservative.
        acceleration_m_s2: f64 = 2.0, in 0.01..=100.0;
        /// Greatest jerk of the design. More takes corners faster and asks for quicker tilts.
        ///
        /// 30 m/s³ is a tilt of 11.5° in 0.07 s, a third of the attitude loop's rate.
        jerk_m_s3: f64 = 30.0, in 0.1..=10_000.0;
        /// Greatest distance of a rounded corner from the drawn one.
        corner_error_m: f64 = 0.01, in 0.0001..=1.0;
        /// How the exposure is kept even when the drone must slow down.
        exposure: LightLevel = LightLevel::Switched;
    }

    /// Part of a flight.
    pub enum Extent {
        /// From the floor to the floor.
        "whole" => Whole,
        /// From rest at the first letter to the end of the last wait.
        "letters" => Letters,
    }

    /// Order and direction of strokes.
    pub enum Order {
        /// With the least time in the dark: exact for ten strokes, 2-opt and Or-opt beyond.
        "shortest" => Shortest,
        /// Letter by letter, as it is read, if the flight takes at most a tenth longer.
        "reading" => Reading,
        /// As drawn: handwriting keeps its order and its directions.
        "drawn" => Drawn,
    }

    /// Light on a lit stroke that is flown slower than the rest.
    pub enum LightLevel {
        /// Only switched, as the headlights of the LED-ring deck must be: corners get brighter.
        "switched" => Switched,
        /// Dimmed with the speed, so that every millimeter gets as much light: for a ring or a
        /// color LED.
        "dimmed" => Dimmed,
    }

    /// Position that is sent to the controller.
    pub enum ReferenceKind {
        /// The design. A controller that holds positions lags behind it.
        "design" => Design,
        /// The design through the inverse of the closed loop, less the tracking error of a
        /// simulated rehearsal. For controllers with feedforward, the design less that error.
        "inverse" => Inverse,
    }

    /// Clock of the light commands.
    pub enum LightClock {
        /// The light changes when the setpoint is sent, wherever the drone is.
        "setpoint" => Setpoint,
        /// Each command is sent so that after radio delay, lamp timer and ramp the light changes
        /// where the flown drone is at the stroke's end.
        "light" => Light,
    }
}

impl PlanOptions {
    /// Style `even`: setpoints at 20 Hz with feedforward, light commands timed on the flight.
    pub fn even() -> Self {
        Self {
            setpoint_interval_s: 0.05,
            floor_wait_s: 0.3,
            landing_height_m: 0.03,
            reference: ReferenceKind::Inverse,
            light_clock: LightClock::Light,
            style: Style::Even(EvenStyle::default()),
            ..Self::default()
        }
    }

    /// Style `even` with other settings.
    pub fn even_with(style: EvenStyle) -> Self {
        Self { style: Style::Even(style), ..Self::even() }
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`noctograph_core::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "plan", None)
    }
}
