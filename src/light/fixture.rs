//! Fixtures: the rows of the emitter table. Where a lamp sits, what it sends where, what drives it.

use serde::{Deserialize, Serialize};

use super::{Emitter, color};
use crate::error::{Error, Result, within};

/// A lamp on the drone: one row of the emitter table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fixture {
    /// Name in tables and messages.
    pub name: String,
    /// What drives it.
    pub drive: Drive,
    /// Place on the body: x forward, y left, z up.
    pub position_body_m: [f64; 3],
    /// Where its beam points, in the body frame.
    pub axis_body: [f64; 3],
    /// Its light-emitting dies: one, or several of different colors that are driven apart.
    pub dies: Vec<Die>,
    /// Exponent m of the beam's shape: intensity falls as cosᵐ of the angle off axis; 1 is a
    /// Lambertian lamp.
    pub beam_exponent: f64,
    /// Share of the intensity on the axis that the lamp's package spills evenly in all
    /// directions, sideways and behind too, 0 to 1.
    pub spill: f64,
    /// Cosine of the angle off axis beyond which the body hides the lamp: −1 hides it nowhere, 0
    /// beyond a right angle.
    pub visible_cos: f64,
    /// Diameter of the shining disc.
    pub diameter_m: f64,
    /// Frequency of its pulse-width modulation; 0 where it has none.
    pub pwm_hz: f64,
    /// Its bit in the firmware's parameter `led.bitmask`, where it has one (`led.c`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bitmask_bit: Option<u8>,
}

/// One die of a lamp.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Die {
    /// Luminous intensity along the axis at full level.
    pub intensity_cd: f64,
    /// Chromaticity x, y (CIE 1931, 2°).
    pub chromaticity: [f64; 2],
}

/// What drives a lamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Drive {
    /// A light channel of the plan; changes wait for the radio and the firmware's lamp timer.
    Command(String),
    /// Power: always lit.
    Always,
    /// A sequence of the firmware (`ledseq.c`).
    Blink {
        /// How long it is lit.
        on_s: f64,
        /// From one flash to the next.
        period_s: f64,
        /// When the first flash begins.
        phase_s: f64,
    },
    /// Flashes too short to see apart, as many as packets come at random: the mean level of every
    /// 0.1 s follows their number.
    Flicker {
        /// Flashes per second in the mean.
        flashes_hz: f64,
        /// Length of a flash.
        flash_s: f64,
    },
    /// The LED ring's effect, seen at this LED of the ring, 0 to 11 (`ledring12.c`).
    Ring(usize),
    /// The color LED deck: four dies white, red, green, blue (`color_led_deck.c`).
    ColorLed,
}

/// LEDs on the ring.
pub(super) const RING_LEDS: usize = 12;

impl Fixture {
    /// Checks the ranges; `key` names the table.
    pub(super) fn check(&self, key: &str) -> Result<()> {
        let place = |field: &str| format!("{key} `{}`: {field}", self.name);
        let range = |field: &str, value, low, high| within(&place(field), value, low, high);
        for value in self.position_body_m {
            range("position_body_m", value, -10.0, 10.0)?;
        }
        let squares: f64 = self.axis_body.iter().map(|value| value * value).sum();
        range("axis_body (length squared)", squares, 1e-6, 1e6)?;
        for die in &self.dies {
            range("intensity_cd", die.intensity_cd, 0.0, 1e6)?;
            let [x, y] = die.chromaticity;
            range("chromaticity x", x, 0.0, 0.8)?;
            range("chromaticity y", y, 0.001, 0.9)?;
            range("chromaticity x + y", x + y, 0.0, 1.0)?;
        }
        range("beam_exponent", self.beam_exponent, 0.0, 1000.0)?;
        range("spill", self.spill, 0.0, 1.0)?;
        range("visible_cos", self.visible_cos, -1.0, 1.0)?;
        range("diameter_m", self.diameter_m, 0.0, 1.0)?;
        range("pwm_hz", self.pwm_hz, 0.0, 1e5)?;
        range("bitmask_bit", self.bitmask_bit.unwrap_or(0).into(), 0.0, 6.0)?;

        let (what, wanted) = match &self.drive {
            Drive::Blink { on_s, period_s, phase_s } => {
                range("drive.blink.period_s", *period_s, 0.001, 1e6)?;
                range("drive.blink.on_s", *on_s, 0.0, *period_s)?;
                return range("drive.blink.phase_s", *phase_s, -1e6, 1e6);
            }
            Drive::Flicker { flashes_hz, flash_s } => {
                range("drive.flicker.flashes_hz", *flashes_hz, 0.0, 1e4)?;
                return range("drive.flicker.flash_s", *flash_s, 0.0, 1.0);
            }
            Drive::Ring(led) if *led >= RING_LEDS => (led.to_string(), "an LED from 0 to 11"),
            Drive::Ring(_) => (self.dies.len().to_string(), "3 dies: red, green, blue"),
            Drive::ColorLed => (self.dies.len().to_string(), "4 dies: white, red, green, blue"),
            Drive::Command(_) | Drive::Always => return Ok(()),
        };
        if matches!(
            (&self.drive, self.dies.len()),
            (Drive::Ring(0..RING_LEDS), 3) | (Drive::ColorLed, 4)
        ) {
            return Ok(());
        }
        let hint = "`noctograph scene` prints the rows of the decks that Noctograph knows";
        Err(Error::input(place("drive and dies"), what, wanted, hint))
    }

    /// The source of light that the dies make together at these levels.
    pub(super) fn emitter(&self, levels: &[f64]) -> Emitter {
        let (mut intensity_cd, mut mixture) = (0.0, [0.0; 3]);
        for (die, level) in self.dies.iter().zip(levels) {
            let part_cd = level * die.intensity_cd;
            intensity_cd += part_cd;
            for (sum, part) in mixture.iter_mut().zip(color::xyz(die.chromaticity)) {
                *sum += part_cd * part;
            }
        }
        Emitter {
            name: self.name.clone(),
            intensity_cd,
            rgb: if intensity_cd > 0.0 { color::rgb(mixture) } else { [1.0; 3] },
            beam_exponent: self.beam_exponent,
            spill: self.spill,
            visible_cos: self.visible_cos,
            diameter_m: self.diameter_m,
        }
    }
}
