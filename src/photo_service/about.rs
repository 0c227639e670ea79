//! What a page has to know before it asks for anything.

use std::collections::BTreeMap;

use noctograph_picture::light::{Deck, LightOptions, color_led_wrgb, ring_rgb};
use noctograph_pipeline::scene::Scene;
use serde::{Deserialize, Serialize};

/// Whose page it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Of those who write and draw.
    Visitor,
    /// Of the operator, who flies.
    Operator,
    /// Of one photo, to take home.
    Entry,
}

/// What the wall shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WallRule {
    /// What the operator approved.
    Approved,
    /// All that is sent.
    Open,
}

/// What the pages of all roles have to know.
#[derive(Debug, Serialize)]
pub struct Host<'a> {
    /// Whose page it is.
    pub role: Role,
    /// Name of this run of the program.
    pub boot: &'a str,
    /// The host's words.
    pub brand: &'a Brand,
    /// Whether other machines are served, and can reach this one.
    pub network: bool,
}

/// What the pages of visitors and of the operator have to know.
#[derive(Debug, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that do not exclude each other")]
pub struct About<'a> {
    /// What every page has to know.
    #[serde(flatten)]
    pub host: Host<'a>,
    /// Whether the page has no server.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub alone: bool,
    /// Whether it is shown on the host's machine.
    pub home: bool,
    /// Whether it is shown on a screen that stands in the hall.
    pub kiosk: bool,
    /// Whether nothing is taken at the moment.
    pub paused: bool,
    /// What the wall shows.
    pub wall: WallRule,
    /// Limits of what is asked for.
    pub limits: Limits,
    /// Colors that the page offers.
    pub colors: Vec<OfferedColor>,
    /// The scene's deck of lights.
    pub deck: Deck,
    /// The text of the scene, where visitors' browsers make photos.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<&'a str>,
    /// The scene that the controls begin with, on the host's machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<&'a Scene>,
}

/// Limits of what a page asks for.
#[derive(Debug, Serialize)]
pub struct Limits {
    /// Most characters of a word.
    pub letters: usize,
    /// Most bytes of a request.
    pub body_bytes: usize,
}

/// The words of a host.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Brand {
    /// Name of the evening.
    pub title: Option<String>,
    /// What is said of it, by language.
    pub sentence: BTreeMap<String, String>,
    /// What one agrees to who sends a photo, by language.
    pub consent: BTreeMap<String, String>,
    /// Whether there is a logo.
    #[serde(skip_deserializing)]
    pub logo: bool,
}

/// A color that the page offers: that of the screen, and the bytes of each lamp that show it.
#[derive(Debug, Serialize)]
pub struct OfferedColor {
    /// Its name.
    pub name: &'static str,
    /// That of the screen (sRGB).
    pub screen: [u8; 3],
    /// White, red, green and blue of the color deck.
    #[serde(rename = "color-led")]
    pub color_led: [u8; 4],
    /// The same of the ring.
    pub ring: [u8; 4],
}

/// Colors that the page offers.
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
    let offered = |(name, screen): (&'static str, [u8; 3])| {
        let color_led = color_led_wrgb(screen, LightOptions::default().color_led_levels);
        let [r, g, b] = ring_rgb(screen);
        OfferedColor { name, screen, color_led, ring: [0, r, g, b] }
    };
    colors.map(offered).into()
}
