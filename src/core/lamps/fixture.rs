//! Fixtures, the rows of the emitter table, which give the position, beam and drive of each lamp.

use serde::{Deserialize, Serialize};

use super::{COLOR_LED, Channel, RING};
use crate::error::{Error, Result, within};
use crate::settings::{Described, joined, settings};

settings! {
    /// A lamp on the drone, which is one row of the emitter table.
    pub struct Fixture {
        /// Name of the lamp in tables and messages.
        name: String = "lamp".to_owned();
        /// Condition that turns the lamp on.
        drive: Drive = Drive::Always;
        /// Position on the body, with x forward, y left, z up.
        position_body_m: [f64; 3] = [0.0; 3], in -10.0..=10.0;
        /// Axis of the beam in the body frame.
        axis_body: [f64; 3] = [1.0, 0.0, 0.0], in -1e3..=1e3;
        /// Light-emitting dies, either one or several of different colors with separate drives.
        dies: Vec<Die> = vec![Die::default()];
        /// Exponent m of the beam shape, in which intensity falls as cosᵐ of the angle from the
        /// axis. An exponent of 1 is a Lambertian lamp.
        beam_exponent: f64 = 1.0, in 0.0..=1000.0;
        /// Isotropic fraction, the intensity in all directions relative to that on the axis.
        spill: f64 = 0.0, in 0.0..=1.0;
        /// Cosine of the angle from the axis beyond which the body hides the lamp, which is −1 if
        /// no angle is hidden, and 0 for a right angle.
        visible_cos: f64 = -1.0, in -1.0..=1.0;
        /// Diameter of the luminous disc.
        diameter_m: f64 = 0.003, in 0.0..=1.0;
        /// Depth along the axis of a luminous cylinder of that diameter, such as a diffuser, whose
        /// width and height are those that the camera sees. If left out, the lamp is a disc that
        /// faces the camera.
        depth_m: Option<f64> = None, in 0.0..=1.0;
        /// Bit of the lamp in the firmware parameter led.bitmask, if the lamp has one.
        ///
        /// Source: `led.c`.
        bitmask_bit: Option<u8> = None, in 0.0..=6.0;
        /// Firmware parameter of the lamp's light channel, such as `deckled.level`. The parameters
        /// of lamps on Bitcraze's decks are fixed.
        parameter: Option<String> = None;
        /// Value of the parameter at full level, or 1 for a switch.
        parameter_max: u32 = 1, in 1.0..=4_294_967_295.0;
    }

    /// A light-emitting die of a lamp.
    pub struct Die {
        /// Luminous intensity along the axis at full level.
        intensity_cd: f64 = 1.0, in 0.0..=1e6;
        /// Chromaticity x, y (CIE 1931, 2°).
        chromaticity: [f64; 2] = [0.3127, 0.329], in 0.0..=0.9;
    }
}

/// Source that drives a lamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Drive {
    /// Light channel of the plan that commands the lamp. A change of its level takes effect after
    /// the radio delay and the firmware's next lamp tick.
    Command(String),
    /// Supply voltage, which means that the lamp is always on.
    Always,
    /// LED sequence of the firmware (`ledseq.c`).
    Blink {
        /// Duration of a flash in s.
        on_s: f64,
        /// Time from one flash to the next in s.
        period_s: f64,
        /// Start of the first flash in s.
        phase_s: f64,
    },
    /// Random flashes too short to distinguish. Their number in each 0.1 s determines the level.
    Flicker {
        /// Mean number of flashes per second.
        flashes_hz: f64,
        /// Duration of a flash in s.
        flash_s: f64,
    },
    /// Effect of the LED ring, for the LED with this index from 0 to 11 (`ledring12.c`).
    Ring(usize),
    /// Color LED deck, whose four dies are white, red, green and blue (`color_led_deck.c`).
    ColorLed,
}

/// Shortest period of a blink in s, and its longest period and phase.
const LEAST_PERIOD_S: f64 = 0.001;
const MAX_S: f64 = 1e6;
/// Highest rate of a flicker in Hz.
const MAX_FLASHES_HZ: f64 = 1e4;
/// Smallest and largest squared length of an axis.
const AXIS_LENGTH_SQ: [f64; 2] = [1e-6, 1e6];
/// Smallest and largest chromaticity y. The XYZ color divides by y, and no light is beyond 0.9.
const CHROMATICITY_Y: [f64; 2] = [0.001, 0.9];

impl Described for Drive {
    /// Checks that the times of a blink and the rate and duration of a flicker are within their
    /// ranges. Other drives have no numbers to check.
    fn check(&self, place: &str, _: Option<[f64; 2]>) -> Result<()> {
        // Each entry contains a key, a value, a minimum and a maximum.
        let ranges = match *self {
            Self::Blink { on_s, period_s, phase_s } => vec![
                ("blink.period_s", period_s, LEAST_PERIOD_S, MAX_S),
                ("blink.on_s", on_s, 0.0, period_s),
                ("blink.phase_s", phase_s, -MAX_S, MAX_S),
            ],
            Self::Flicker { flashes_hz, flash_s } => vec![
                ("flicker.flashes_hz", flashes_hz, 0.0, MAX_FLASHES_HZ),
                ("flicker.flash_s", flash_s, 0.0, 1.0),
            ],
            Self::Ring(_) | Self::ColorLed | Self::Command(_) | Self::Always => Vec::new(),
        };
        let mut ranges = ranges.into_iter();
        ranges.try_for_each(|(key, value, min, max)| within(&joined(place, key), value, min, max))
    }
}

impl Drive {
    /// Returns the light channel of a plan that the lamp follows, or `None` if it follows none.
    pub fn channel(&self) -> Option<&str> {
        match self {
            Self::Command(channel) => Some(channel),
            Self::Ring(_) => Some(RING.name),
            Self::ColorLed => Some(COLOR_LED.name),
            Self::Always | Self::Blink { .. } | Self::Flicker { .. } => None,
        }
    }
}

/// Number of LEDs on the ring.
pub const RING_LEDS: usize = 12;

impl Fixture {
    /// Checks that the axis is not zero, that the chromaticities are valid, and that parameter and
    /// dies suit the drive. `key` names the table in messages. Returns [`Error::Input`] with the
    /// fixture's name.
    pub(super) fn check_drive(&self, key: &str) -> Result<()> {
        // Constraints across several numbers are checked first, followed by the parameter and the
        // number of dies that the drive requires.
        let place = |field: &str| format!("{key} `{}`: {field}", self.name);
        let length_sq: f64 = self.axis_body.iter().map(|value| value * value).sum();
        within(
            &place("axis_body (length squared)"),
            length_sq,
            AXIS_LENGTH_SQ[0],
            AXIS_LENGTH_SQ[1],
        )?;
        for Die { chromaticity: [x, y], .. } in &self.dies {
            within(&place("chromaticity y"), *y, CHROMATICITY_Y[0], CHROMATICITY_Y[1])?;
            within(&place("chromaticity x + y"), x + y, 0.0, 1.0)?;
        }
        self.check_parameter(key)?;
        let n_dies = self.dies.len();
        let (actual, wanted) = match self.drive {
            Drive::Ring(led) if led >= RING_LEDS => (led, "an LED from 0 to 11"),
            Drive::Ring(_) if n_dies != 3 => (n_dies, "3 dies: red, green, blue"),
            Drive::ColorLed if n_dies != 4 => (n_dies, "4 dies: white, red, green, blue"),
            Drive::Ring(_) | Drive::ColorLed | Drive::Command(_) | Drive::Always => return Ok(()),
            Drive::Blink { .. } | Drive::Flicker { .. } => return Ok(()),
        };
        let hint = "a printed scene contains the rows of every known deck";
        Err(Error::input(place("drive and dies"), actual, wanted, hint))
    }

    /// Checks that the parameter, if there is one, has a group and a name, and that the lamp has a
    /// channel that belongs to no deck. A deck's channel has fixed parameters.
    fn check_parameter(&self, key: &str) -> Result<()> {
        let Some(parameter) = &self.parameter else { return Ok(()) };
        fn is_name(part: &str) -> bool {
            !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        }
        let is_full_name =
            parameter.split_once('.').is_some_and(|(group, name)| is_name(group) && is_name(name));
        let (wanted, hint) = match self.drive.channel() {
            _ if !is_full_name => (
                "group.name of letters, digits and _",
                "choose a parameter from the firmware's list",
            ),
            None => ("no parameter, because nothing commands this lamp", "set drive.command"),
            Some(channel) if Channel::named(channel).is_some() => (
                "no parameter, because the channel belongs to a deck",
                "set drive.command to a channel that no deck uses",
            ),
            Some(_) => return Ok(()),
        };
        let place = format!("{key} `{}`: parameter", self.name);
        Err(Error::input(place, parameter, wanted, hint))
    }
}
