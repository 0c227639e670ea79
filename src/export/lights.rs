//! Light commands as firmware parameters.
//!
//! Lamps listen to parameters (firmware `ledring12.c`, `color_led_deck.c`): the headlights to
//! `ring.headlightEnable` (on or off), the ring to `ring.fadeColor` under effect 14 with
//! `ring.fadeTime` 0 (one write for three colors), the color LED deck to `colorLedBot.wrgb8888`.

use crate::error::{Error, Result};
use crate::plan::Plan;

/// Level from which a lamp that can only be switched is on.
const ON: f64 = 0.5;
/// `ring.effect` that shows `ring.fadeColor`.
const RING_FADE: u32 = 14;

/// One write of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Write {
    /// Time since the plan's start, s.
    pub time_s: f64,
    /// Firmware parameter.
    pub parameter: &'static str,
    /// Its value, a whole number.
    pub value: u32,
}

/// Colors of the lamps at full level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LampColors {
    /// Red, green, blue of the ring, 0 to 255.
    pub ring_rgb: [u8; 3],
    /// White, red, green, blue of the color LED deck, 0 to 255.
    pub color_led_wrgb: [u8; 4],
}

/// The parameter of a light channel, and its value at a level from 0 to 1.
fn parameter(channel: &str, level: f64, colors: LampColors) -> Result<(&'static str, u32)> {
    match channel {
        "headlights" => Ok(("ring.headlightEnable", u32::from(level >= ON))),
        "ring" => Ok(("ring.fadeColor", packed(&colors.ring_rgb, level))),
        "color-led" => Ok(("colorLedBot.wrgb8888", packed(&colors.color_led_wrgb, level))),
        other => {
            let hint = "light the strokes with headlights, ring or color-led";
            Err(Error::input("plan.lights", other, "a lamp with a firmware parameter", hint))
        }
    }
}

/// Bytes at a level, the first one in the highest place.
fn packed(bytes: &[u8], level: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let dimmed = |byte: u8| (f64::from(byte) * level.clamp(0.0, 1.0)).round() as u32;
    bytes.iter().fold(0, |word, byte| word << 8 | dimmed(*byte))
}

/// All changes of a plan's lights, in order of time.
///
/// # Errors
///
/// [`Error::Input`] for a channel that no deck listens to.
pub fn writes(plan: &Plan, colors: LampColors) -> Result<Vec<Write>> {
    let mut writes = Vec::new();
    for (channel, levels) in &plan.lights {
        let mut before = None;
        for (setpoint, level) in plan.setpoints.iter().zip(levels) {
            let (parameter, value) = parameter(channel, *level, colors)?;
            if before != Some(value) {
                writes.push(Write { time_s: setpoint.time_s, parameter, value });
                before = Some(value);
            }
        }
    }
    writes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(writes)
}

/// Writes before the flight: the lamps that the plan switches are dark, all others off.
#[must_use]
pub fn preparation(plan: &Plan) -> Vec<(&'static str, u32)> {
    let ring = plan.lights.contains_key("ring");
    let effect = if ring { RING_FADE } else { 0 };
    let mut parameters = vec![("led.bitmask", 128), ("ring.headlightEnable", 0)];
    if ring {
        parameters.extend([("ring.fadeTime", 0), ("ring.fadeColor", 0)]);
    }
    parameters.push(("ring.effect", effect));
    parameters
}
