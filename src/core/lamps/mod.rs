//! Lamps: a description without pixels of what a drone carries: decks, lamps, their light channels.

mod fixture;
mod options;
pub mod tables;

pub use fixture::{Die, Drive, Fixture, RING_LEDS};
pub use options::{ColorLedLevels, Deck, LightOptions, RingColor, RingEffect, RingFade};

/// Channels of a plan for the color of the ring.
pub const RING_COLORS: [&str; 3] = ["ring.red", "ring.green", "ring.blue"];
/// Channels of a plan for the color of the color LED deck; without them it is that of the letter.
pub const COLOR_LED_COLORS: [&str; 4] =
    ["color-led.white", "color-led.red", "color-led.green", "color-led.blue"];

/// Bytes of a color at a level, the first one in the highest place, as decks are sent them.
#[must_use]
pub fn packed(bytes: &[u8], level: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
    let dimmed = |byte: u8| (f64::from(byte) * level.clamp(0.0, 1.0)).round() as u32;
    bytes.iter().fold(0, |word, byte| word << 8 | dimmed(*byte))
}
