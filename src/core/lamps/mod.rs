//! Description of a drone's decks, lamps and light channels, without pixels.

mod channel;
mod fixture;
mod options;
pub mod tables;

pub use channel::{CHANNELS, COLOR_LED, Channel, HEADLIGHTS, RING};
pub use fixture::{Die, Drive, Fixture, RING_LEDS};
pub use options::{ColorLedLevels, LightOptions, RingColor, RingEffect, RingFade};
pub use tables::Deck;

/// Channels of a plan that set the color of the ring.
pub const RING_COLORS: [&str; 3] = ["ring.red", "ring.green", "ring.blue"];
/// Channels of a plan that set the color of the color LED deck. Without these channels, the deck
/// shows the color of the letter.
pub const COLOR_LED_COLORS: [&str; 4] =
    ["color-led.white", "color-led.red", "color-led.green", "color-led.blue"];

/// Returns up to four bytes of a color, each dimmed to a level from 0 to 1, as one number whose
/// first byte is the most significant. This is the format of the decks' parameters.
pub fn packed(bytes: &[u8], level: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
    let dimmed = |byte: u8| (f64::from(byte) * level.clamp(0.0, 1.0)).round() as u32;
    bytes.iter().fold(0, |word, byte| word << 8 | dimmed(*byte))
}

/// Returns a color as the ring shows it from its LED memory or timing memory. cflib packs the color
/// into 5, 6 and 5 bits (`led_driver_memory.py`, `led_timings_driver_memory.py`), and the firmware
/// expands it again.
pub fn ring_memory_rgb([red, green, blue]: [u8; 3]) -> [u8; 3] {
    // The integer constants are those of cflib and the firmware.
    let five_bits = |byte: u8| expanded(((u32::from(byte) * 249 + 1014) >> 11) * 527 + 23);
    let six_bits = |byte: u8| expanded(((u32::from(byte) * 253 + 505) >> 10) * 259 + 33);
    [five_bits(red), six_bits(green), five_bits(blue)]
}

/// Returns the byte for a color value of the firmware's expansion, which is scaled by 64.
fn expanded(scaled: u32) -> u8 {
    u8::try_from(scaled >> 6).unwrap_or(u8::MAX)
}
