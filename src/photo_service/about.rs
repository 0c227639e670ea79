//! Facts that a page needs before its first request.

use std::collections::BTreeMap;

use noctograph_picture::light::{Deck, LightOptions, color_led_wrgb, ring_rgb};
use noctograph_pipeline::scene::Scene;
use serde::{Deserialize, Serialize};

/// The user of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Writes and draws.
    Visitor,
    /// Flies.
    Operator,
    /// Looks at one photo, to take home.
    Entry,
}

/// Which photos the wall shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WallRule {
    /// The photos that the operator approved.
    Approved,
    /// All photos that are sent.
    Open,
}

/// Facts for the pages of all roles.
#[derive(Debug, Serialize)]
pub struct Host<'a> {
    /// The user of the page.
    pub role: Role,
    /// Name of this run of the program.
    pub boot: &'a str,
    /// The host's words.
    pub brand: &'a Brand,
    /// True if other machines are served, and can reach this machine.
    pub network: bool,
}

/// Facts for the pages of visitors and of the operator.
#[derive(Debug, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that do not exclude each other")]
pub struct About<'a> {
    /// Facts for all pages.
    #[serde(flatten)]
    pub host: Host<'a>,
    /// True if the page has no server.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub alone: bool,
    /// True on the host's machine.
    pub home: bool,
    /// True on a public screen in the hall.
    pub kiosk: bool,
    /// True if no entries are accepted at the moment.
    pub paused: bool,
    /// Which photos the wall shows.
    pub wall: WallRule,
    /// Limits of requests.
    pub limits: Limits,
    /// Colors that the page offers.
    pub colors: Vec<OfferedColor>,
    /// The scene's deck of lights.
    pub deck: Deck,
    /// The text of the scene, if the visitors' browsers make photos.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<&'a str>,
    /// The scene that the controls show at the start, on the host's machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<&'a Scene>,
}

/// Limits of a page's requests.
#[derive(Debug, Serialize)]
pub struct Limits {
    /// Greatest number of characters in a word.
    pub letters: usize,
    /// Greatest number of bytes in a request.
    pub body_bytes: usize,
}

/// The words of a host.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Brand {
    /// Name of the evening.
    pub title: Option<String>,
    /// Description of the evening, by language.
    pub sentence: BTreeMap<String, String>,
    /// Terms that a visitor accepts by sending a photo, by language.
    pub consent: BTreeMap<String, String>,
    /// True if there is a logo.
    #[serde(skip_deserializing)]
    pub logo: bool,
}

/// A color that the page offers, on the screen and for each lamp.
#[derive(Debug, Serialize)]
pub struct OfferedColor {
    /// Its name.
    pub name: &'static str,
    /// Red, green and blue on the screen (sRGB).
    pub screen: [u8; 3],
    /// White, red, green and blue for the color deck.
    #[serde(rename = "color-led")]
    pub color_led: [u8; 4],
    /// White, red, green and blue for the ring.
    pub ring: [u8; 4],
}

/// Returns the colors that the page offers.
pub fn colors() -> Vec<OfferedColor> {
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
    // A lamp needs other bytes than a screen for the same color.
    let offered = colors.map(|(name, screen)| {
        let color_led = color_led_wrgb(screen, LightOptions::default().color_led_levels);
        let [r, g, b] = ring_rgb(screen);
        OfferedColor { name, screen, color_led, ring: [0, r, g, b] }
    });
    offered.into()
}
