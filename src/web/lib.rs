//! Web: what a page asks for becomes a photograph with its verdict, JSON in and JSON out.
//!
//! A [`request`] is read and checked, its subject prepared as a scene, flown and photographed
//! ([`answer`]); where it is refused, a message says why ([`messages`]). The crate `serve` answers
//! the requests of its visitors so. Compiled to WebAssembly, it answers them in the browser: `door`
//! has the functions that a page's worker calls, and `src/web/build` writes the page around it.

#![deny(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use noctograph_picture::light::{LightOptions, color_led_wrgb, ring_rgb};
use noctograph_pipeline::preflight::Profile;
use noctograph_pipeline::scene::Scene;
use serde_json::{Value, json};

pub mod answer;
#[cfg(target_family = "wasm")]
mod door;
pub mod messages;
mod replay;
pub mod request;
mod subject;

/// A scene that is ready to be planned, and what its flight is checked against.
#[derive(Clone, Debug)]
pub struct PreparedScene {
    /// The scene, with its word or drawing.
    pub scene: Scene,
    /// Limits of the flight.
    pub profile: Profile,
}

/// Colors that the page offers: of the screen, and the bytes of each lamp that show them.
pub fn colors() -> Value {
    let colors = [
        ("white", [255, 255, 255]),
        ("red", [255, 0, 0]),
        ("orange", [255, 165, 0]),
        ("yellow", [255, 255, 0]),
        ("green", [0, 255, 0]),
        ("cyan", [0, 255, 255]),
        ("blue", [0, 0, 255]),
        ("magenta", [255, 0, 255]),
    ];
    let entry = |(name, screen): (&str, [u8; 3])| {
        let deck = color_led_wrgb(screen, LightOptions::default().color_led_levels);
        let [r, g, b] = ring_rgb(screen);
        json!({ "name": name, "screen": screen, "color-led": deck, "ring": [0, r, g, b] })
    };
    colors.map(entry).into_iter().collect()
}
