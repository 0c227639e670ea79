//! Options for planning.

use noctograph_core::error::Result;
use noctograph_core::settings::{Described, settings};

settings! {
    /// The way in which a word is flown.
    pub struct PlanOptions {
        /// Light channels that are switched on along lit strokes: `headlights`, `ring`, `color-led`
        /// (the default if `light.deck` is set to it), or those of the lamps in `light.fixtures`.
        lights: Vec<String> = vec!["headlights".to_owned()];
        /// Speed along every segment. In style `even`, this speed applies only to lit strokes.
        stroke_speed_m_s: f64 = 0.2, in 0.001..=100.0;
        /// Time between two setpoints on a segment. The drone holds each setpoint until the next.
        setpoint_interval_s: f64 = 0.1, in 0.001..=10.0;
        /// Wait on the floor with the motors off, before take-off and after landing.
        floor_wait_s: f64 = 1.1, in 0.0..=600.0;
        /// Height after the last letter at which the drone returns (`team`) or stops its motors
        /// (`even`).
        landing_height_m: f64 = 0.15, in 0.001..=1000.0;
        /// Number of drones that write the strokes together. Only style `even` allows more than one
        /// drone.
        drones: u32 = 1, in 1.0..=16.0;
        /// Position that is sent to the controller.
        reference: ReferenceKind = ReferenceKind::Design;
        /// Mean difference between the flown and the designed position along each world axis in an
        /// earlier flight, which is subtracted from the setpoints.
        mean_error_m: [f64; 3] = [0.0; 3], in -10.0..=10.0;
        /// Clock of the light commands.
        light_clock: LightClock = LightClock::Setpoint;
        /// Heading of the nose from take-off to landing, from world x toward y. The drone must be
        /// placed with this heading. The headlights shine in this direction. At -π/2, the
        /// headlights face the audience side by side.
        yaw_rad: f64 = 0.0, in -3.15..=3.15;
        /// Style of flying. The style also sets the defaults of the other keys in this table.
        style: Style = Style::default();
        fixed {
            /// Rate, in clock seconds per true second, of the clock that times the setpoints. Light
            /// commands from the host keep true time. By default, the rate is 1 if the host sends
            /// the setpoints, and that of `vehicle.firmware` for an onboard trajectory
            /// (`radio.setpoints`), which is 84/85 up to release 2026.08 (`usec_time.c`).
            trajectory_clock: Option<f64> = None;
            /// Part of the flight that is planned.
            extent: Extent = Extent::Whole;
        }
    }

    /// Style of flying.
    pub enum Style tagged {
        /// The reference team's style: letter by letter at one speed, with waits, and lights sent
        /// with the setpoints.
        "team" => Team(TeamStyle),
        /// Evenly exposed strokes in the shortest order, fast dark transits, and light timed to the
        /// strokes.
        "even" => Even(EvenStyle),
    }

    /// The reference team's style of flying, with the values from their flight of December 2022.
    pub struct TeamStyle {
        /// Distance to the right of a letter's box to which the drone steps after the letter.
        step_m: f64 = 0.1, in 0.0..=10.0;
        /// Wait in the dark after that step.
        letter_wait_s: f64 = 2.0, in 0.0..=600.0;
        /// Height of the first setpoint in the air.
        lift_off_height_m: f64 = 0.1, in 0.001..=1000.0;
        /// Height at the end of the approach to the first letter.
        approach_height_m: f64 = 0.3, in 0.001..=1000.0;
    }

    /// Evenly exposed strokes, flown at the limits of a Crazyflie indoors.
    pub struct EvenStyle {
        /// Order and direction of strokes.
        order: Order = Order::Shortest;
        /// Duration of the hover before the first stroke, which settles the height after take-off.
        hover_s: f64 = 1.0, in 0.0..=600.0;
        /// Maximum speed in the dark.
        dark_speed_m_s: f64 = 1.0, in 0.01..=100.0;
        /// Maximum acceleration of the design.
        ///
        /// Firmware issue 882 (whoenig) calls 2 m/s² at 0.5 m/s conservative.
        acceleration_m_s2: f64 = 2.0, in 0.01..=100.0;
        /// Maximum jerk of the design. A higher jerk takes corners faster but requires fast tilts.
        ///
        /// For example, 30 m/s³ tilts the drone by 11.5° in 0.07 s, a third of the attitude loop's
        /// limit.
        jerk_m_s3: f64 = 30.0, in 0.1..=10_000.0;
        /// Maximum distance of a rounded corner from the drawn corner.
        corner_error_m: f64 = 0.01, in 0.0001..=1.0;
        /// Light level when the drone must slow down on a stroke.
        exposure: LightLevel = LightLevel::Switched;
    }

    /// A part of a flight.
    pub enum Extent {
        /// The whole flight, from the floor to the floor.
        "whole" => Whole,
        /// The letters only, from rest at the first letter to the end of the last wait.
        "letters" => Letters,
    }

    /// Order and direction of strokes.
    pub enum Order {
        /// The order with the least time in the dark, exact for up to ten strokes, else by 2-opt
        /// and Or-opt.
        "shortest" => Shortest,
        /// Letter by letter in reading order, if the flight takes at most a tenth longer.
        "reading" => Reading,
        /// The order and directions of the drawing, as for handwriting.
        "drawn" => Drawn,
    }

    /// Light level on a lit stroke that is flown more slowly than others.
    pub enum LightLevel {
        /// On or off only, as headlights of the LED-ring deck are, so that slow corners are
        /// brighter.
        "switched" => Switched,
        /// Dimmed in proportion to the speed, so that every millimeter receives the same light.
        /// Suitable for a ring or a color LED.
        "dimmed" => Dimmed,
    }

    /// Position that is sent to the controller.
    pub enum ReferenceKind {
        /// The design itself, behind which a controller that holds positions lags.
        "design" => Design,
        /// The design filtered by the inverse of the closed loop, minus the tracking error of a
        /// simulated rehearsal. For controllers with feedforward, the position is the design minus
        /// that error.
        "inverse" => Inverse,
    }

    /// Clock of the light commands.
    pub enum LightClock {
        /// The light changes when the setpoint is sent, regardless of the drone's position.
        "setpoint" => Setpoint,
        /// Each command is sent early enough that, after radio delay, lamp timer and ramp, the
        /// light changes when the flown drone is at the stroke's end.
        "light" => Light,
    }
}

impl PlanOptions {
    /// Returns the options for style `even`, with 20 Hz setpoints, feedforward, and light commands
    /// timed to the flight.
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

    /// Returns the options for style `even` with the given settings.
    pub fn even_with(style: EvenStyle) -> Self {
        Self { style: Style::Even(style), ..Self::even() }
    }

    /// Checks that all settings are within their ranges.
    ///
    /// # Errors
    ///
    /// Returns [`noctograph_core::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "plan", None)
    }
}
