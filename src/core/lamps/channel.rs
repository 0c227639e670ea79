//! Light channels, with their names in a plan and their firmware parameters.

use super::{COLOR_LED_COLORS, RING_COLORS};

/// Light channel to which one of Bitcraze's decks responds. For a custom lamp, its row of the
/// emitter table names the parameter ([`super::Fixture::parameter`]).
#[derive(Debug, PartialEq)]
pub struct Channel {
    /// Name of the channel and of its column in a plan.
    pub name: &'static str,
    /// Firmware parameter that the channel sets.
    pub parameter: &'static str,
    /// Channels of a plan that set the color, in the order of the parameter's bytes, or empty for a
    /// lamp that is switched by a pin.
    pub colors: &'static [&'static str],
    /// Name of the deck, and the firmware parameters `deck.*`, one of which shows that it is
    /// present.
    pub deck: (&'static str, &'static [&'static str]),
    /// Parameters that enable the lamp, but keep it dark, before a flight in which it is used.
    pub ready: &'static [(&'static str, u32)],
    /// Parameters that keep the lamp dark in a flight in which it is not used.
    pub idle: &'static [(&'static str, u32)],
}

const RING_DECK: (&str, &[&str]) = ("the ring", &["bcLedRing"]);

/// Light channels of Bitcraze's decks (firmware `ledring12.c`, `color_led_deck.c`), of which the
/// headlights are switched by a pin. With effect 14, the ring shows `ring.fadeColor`, which a
/// single write changes. The color LED deck has four dies.
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

/// Channel of the ring.
pub const RING: &Channel = &CHANNELS[1];
/// Channel of the color LED deck.
pub const COLOR_LED: &Channel = &CHANNELS[2];
/// Name of the channel that the reference team used for its letters.
pub const HEADLIGHTS: &str = CHANNELS[0].name;

impl Channel {
    /// Returns the channel of a deck with this name, or `None` for the channel of a custom lamp.
    pub fn named(name: &str) -> Option<&'static Self> {
        CHANNELS.iter().find(|channel| channel.name == name)
    }
}
