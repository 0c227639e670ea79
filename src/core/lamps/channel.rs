//! Light channels: their names in a plan, and their firmware parameters.

use super::{COLOR_LED_COLORS, RING_COLORS};

/// A light channel that a deck of Bitcraze's listens to. A custom lamp names its parameter in its
/// row of the emitter table ([`super::Fixture::parameter`]).
#[derive(Debug, PartialEq)]
pub struct Channel {
    /// Name of the channel and of its column in a plan.
    pub name: &'static str,
    /// The firmware parameter that it sets.
    pub parameter: &'static str,
    /// Channels of a plan for its color, as bytes of the parameter from the last one on, or a pin's
    /// none.
    pub colors: &'static [&'static str],
    /// The channel's deck, and parameters `deck.*`, one of which is set if it is attached.
    pub deck: (&'static str, &'static [&'static str]),
    /// Parameters that make it ready and dark before a flight that it lights.
    pub ready: &'static [(&'static str, u32)],
    /// Parameters that keep it dark in a flight that it does not light.
    pub idle: &'static [(&'static str, u32)],
}

const RING_DECK: (&str, &[&str]) = ("the ring", &["bcLedRing"]);

/// The light channels of Bitcraze's decks (firmware `ledring12.c`, `color_led_deck.c`): the
/// headlights are a pin. The ring shows `ring.fadeColor` under effect 14, one write for three
/// colors. The color LED deck has four dies.
pub const CHANNELS: [Channel; 3] = [
    Channel {
        name: "headlights",
        parameter: "ring.headlightEnable",
        colors: &[],
        deck: RING_DECK,
        ready: &[("ring.headlightEnable", 0)],
        idle: &[("ring.headlightEnable", 0)],
    },
    Channel {
        name: "ring",
        parameter: "ring.fadeColor",
        colors: &RING_COLORS,
        deck: RING_DECK,
        ready: &[("ring.fadeTime", 0), ("ring.fadeColor", 0), ("ring.effect", 14)],
        idle: &[("ring.effect", 0)],
    },
    Channel {
        name: "color-led",
        parameter: "colorLedBot.wrgb8888",
        colors: &COLOR_LED_COLORS,
        deck: ("the color LED", &["bcColorLedBot"]),
        ready: &[("colorLedBot.brightCorr", 1), ("colorLedBot.wrgb8888", 0)],
        idle: &[("colorLedBot.wrgb8888", 0)],
    },
];

/// The channel of the ring.
pub const RING: &Channel = &CHANNELS[1];
/// The channel of the color LED deck.
pub const COLOR_LED: &Channel = &CHANNELS[2];
/// The channel that the reference team's letters drive.
pub const HEADLIGHTS: &str = CHANNELS[0].name;

impl Channel {
    /// The channel of a deck with this name, or `None` for the channel of a custom lamp.
    pub fn named(name: &str) -> Option<&'static Self> {
        CHANNELS.iter().find(|channel| channel.name == name)
    }
}
