//! Fixtures: rows of the emitter table, with position, beam and drive of each lamp.

use serde::{Deserialize, Serialize};

use super::{COLOR_LED, Channel, RING};
use crate::error::{Error, Result, within};
use crate::settings::{Described, joined, settings};

settings! {
    /// A lamp on the drone: one row of the emitter table.
    pub struct Fixture {
        /// Name in tables and messages.
        name: String = "lamp".to_owned();
        /// The condition that turns the lamp on.
        drive: Drive = Drive::Always;
        /// Position on the body: x forward, y left, z up.
        position_body_m: [f64; 3] = [0.0; 3], in -10.0..=10.0;
        /// Axis of its beam, in the body frame.
        axis_body: [f64; 3] = [1.0, 0.0, 0.0], in -1e3..=1e3;
        /// Light-emitting dies: one, or several of different colors with separate drives.
        dies: Vec<Die> = vec![Die::default()];
        /// Exponent m of the beam shape: intensity falls as cosᵐ of the angle off axis. 1 is a
        /// Lambertian lamp.
        beam_exponent: f64 = 1.0, in 0.0..=1000.0;
        /// Isotropic fraction: intensity in all directions relative to that on the axis.
        spill: f64 = 0.0, in 0.0..=1.0;
        /// Cosine of the angle off axis beyond which the body hides the lamp: −1 for nowhere, 0
        /// beyond a right angle.
        visible_cos: f64 = -1.0, in -1.0..=1.0;
        /// Diameter of the luminous disc.
        diameter_m: f64 = 0.003, in 0.0..=1.0;
        /// Depth along its axis of a luminous cylinder of that diameter, such as a diffuser, which
        /// is as wide and as high as it looks from the camera, or a disc that faces the camera if
        /// left out.
        depth_m: Option<f64> = None, in 0.0..=1.0;
        /// Bit in the parameter led.bitmask of the firmware, if it has one.
        ///
        /// `led.c`.
        bitmask_bit: Option<u8> = None, in 0.0..=6.0;
        /// Firmware parameter of its light channel, such as `deckled.level`. Lamps of Bitcraze's
        /// decks have fixed parameters.
        parameter: Option<String> = None;
        /// Value of that parameter at full level, or 1 for a switch.
        parameter_max: u32 = 1, in 1.0..=4_294_967_295.0;
    }

    /// A die of a lamp.
    pub struct Die {
        /// Luminous intensity along the axis at full level.
        intensity_cd: f64 = 1.0, in 0.0..=1e6;
        /// Chromaticity x, y (CIE 1931, 2°).
        chromaticity: [f64; 2] = [0.3127, 0.329], in 0.0..=0.9;
    }
}

/// Drive of a lamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Drive {
    /// A light channel of the plan. Changes wait for the radio and the lamp timer of the firmware.
    Command(String),
    /// Power: always on.
    Always,
    /// A sequence of the firmware (`ledseq.c`).
    Blink {
        /// Duration of a flash.
        on_s: f64,
        /// Time from one flash to the next.
        period_s: f64,
        /// Start of the first flash.
        phase_s: f64,
    },
    /// Random flashes too short to be distinguished: the mean level of every 0.1 s is their number.
    Flicker {
        /// Mean number of flashes per second.
        flashes_hz: f64,
        /// Duration of a flash.
        flash_s: f64,
    },
    /// The effect of the LED ring at this LED, 0 to 11 (`ledring12.c`).
    Ring(usize),
    /// The color LED deck: four dies white, red, green, blue (`color_led_deck.c`).
    ColorLed,
}

impl Described for Drive {
    /// Checks the numbers of a blink or a flicker.
    fn check(&self, place: &str, _: Option<[f64; 2]>) -> Result<()> {
        // Key, value and range of each number.
        let ranges = match *self {
            Self::Blink { on_s, period_s, phase_s } => vec![
                ("blink.period_s", period_s, 0.001, 1e6),
                ("blink.on_s", on_s, 0.0, period_s),
                ("blink.phase_s", phase_s, -1e6, 1e6),
            ],
            Self::Flicker { flashes_hz, flash_s } => vec![
                ("flicker.flashes_hz", flashes_hz, 0.0, 1e4),
                ("flicker.flash_s", flash_s, 0.0, 1.0),
            ],
            Self::Ring(_) | Self::ColorLed | Self::Command(_) | Self::Always => Vec::new(),
        };
        let mut ranges = ranges.into_iter();
        ranges.try_for_each(|(key, value, min, max)| within(&joined(place, key), value, min, max))
    }
}

impl Drive {
    /// The light channel of a plan that the lamp follows, or `None` if it follows none.
    pub fn channel(&self) -> Option<&str> {
        match self {
            Self::Command(channel) => Some(channel),
            Self::Ring(_) => Some(RING.name),
            Self::ColorLed => Some(COLOR_LED.name),
            Self::Always | Self::Blink { .. } | Self::Flicker { .. } => None,
        }
    }
}

/// LEDs of the ring.
pub const RING_LEDS: usize = 12;

impl Fixture {
    /// Checks that axis, dies and drive fit together. `key` names the table.
    pub(super) fn check_drive(&self, key: &str) -> Result<()> {
        // Ranges beyond those of single settings, then the parameter, then what the drive needs.
        let place = |field: &str| format!("{key} `{}`: {field}", self.name);
        let length_sq: f64 = self.axis_body.iter().map(|value| value * value).sum();
        within(&place("axis_body (length squared)"), length_sq, 1e-6, 1e6)?;
        for Die { chromaticity: [x, y], .. } in &self.dies {
            within(&place("chromaticity y"), *y, 0.001, 0.9)?;
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
        let hint = "the printed scene has the rows of every known deck";
        Err(Error::input(place("drive and dies"), actual, wanted, hint))
    }

    /// Checks that the parameter, if there is one, is a full name, and of a lamp with a channel
    /// that is not a deck's: exports set no other.
    fn check_parameter(&self, key: &str) -> Result<()> {
        let Some(parameter) = &self.parameter else { return Ok(()) };
        fn is_name(part: &str) -> bool {
            !part.is_empty() && part.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
        }
        let is_full_name =
            parameter.split_once('.').is_some_and(|(group, name)| is_name(group) && is_name(name));
        let (wanted, hint) = match self.drive.channel() {
            _ if !is_full_name => {
                ("group.name of letters, digits and _", "the firmware's list of parameters has it")
            }
            None => ("no parameter: nothing commands this lamp", "set drive.command"),
            Some(channel) if Channel::named(channel).is_some() => (
                "no parameter: the channel belongs to a deck",
                "give the lamp a separate channel: drive.command",
            ),
            Some(_) => return Ok(()),
        };
        let place = format!("{key} `{}`: parameter", self.name);
        Err(Error::input(place, parameter, wanted, hint))
    }
}
