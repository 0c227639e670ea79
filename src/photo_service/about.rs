//! Facts that a page receives before its first request.

use std::collections::BTreeMap;

use noctograph_picture::light::{Deck, LightOptions, color_led_wrgb, ring_rgb};
use noctograph_pipeline::scene::Scene;
use serde::{Deserialize, Serialize};

/// Role of the person who uses a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Visitor, who writes and draws.
    Visitor,
    /// Operator, who flies the entries.
    Operator,
    /// Owner of one entry, who views its photo and downloads it.
    Entry,
}

/// Rule that selects the photos on the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WallRule {
    /// Only photos that the operator has approved.
    Approved,
    /// All photos that visitors have sent.
    Open,
}

/// Facts for the pages of all roles.
#[derive(Debug, Serialize)]
pub struct Host<'a> {
    /// Role of the page's user.
    pub role: Role,
    /// Random name of this run of the program.
    pub boot: &'a str,
    /// The host's own texts.
    pub brand: &'a Brand,
    /// True if the server accepts other machines, and they can reach it.
    pub network: bool,
}

/// Facts for the pages of visitors and of the operator.
#[derive(Debug, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that do not exclude each other")]
pub struct About<'a> {
    /// Facts for the pages of all roles.
    #[serde(flatten)]
    pub host: Host<'a>,
    /// True if the page works without a server.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub alone: bool,
    /// True if the page runs on the host's machine.
    pub home: bool,
    /// True if the page runs on a public screen in the hall.
    pub kiosk: bool,
    /// True if the operator has paused accepting entries.
    pub paused: bool,
    /// Rule that selects the photos on the wall.
    pub wall: WallRule,
    /// Limits of requests.
    pub limits: Limits,
    /// Colors in which a visitor can write.
    pub colors: Vec<OfferedColor>,
    /// Light deck of the scene.
    pub deck: Deck,
    /// Text of the scene's file, if the visitors' browsers make photos.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<&'a str>,
    /// Scene that the controls show at the start, on the host's machine.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<&'a Scene>,
}

/// Limits of a page's requests.
#[derive(Debug, Serialize)]
pub struct Limits {
    /// Maximum number of characters in a word.
    pub letters: usize,
    /// Maximum number of bytes in the body of a request.
    pub body_bytes: usize,
}

/// Texts that the host of an evening provides.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Brand {
    /// Name of the evening.
    pub title: Option<String>,
    /// Description of the evening, by language.
    pub sentence: BTreeMap<String, String>,
    /// Terms that a visitor accepts by sending a photo, by language.
    pub consent: BTreeMap<String, String>,
    /// True if the host provides a logo.
    #[serde(skip_deserializing)]
    pub logo: bool,
}

/// A color that the page offers, with its values on the screen and for each lamp.
#[derive(Debug, Serialize)]
pub struct OfferedColor {
    /// Name of the color.
    pub name: &'static str,
    /// Red, green and blue on the screen (sRGB).
    pub screen: [u8; 3],
    /// Levels of white, red, green and blue for the color LED deck.
    #[serde(rename = "color-led")]
    pub color_led: [u8; 4],
    /// Levels of white, red, green and blue for the LED ring.
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
    // To show the same color, a lamp and a screen need different bytes.
    let offered = colors.map(|(name, screen)| {
        let color_led = color_led_wrgb(screen, LightOptions::default().color_led_levels);
        let [r, g, b] = ring_rgb(screen);
        OfferedColor { name, screen, color_led, ring: [0, r, g, b] }
    });
    offered.into()
}
