//! Request for a photo, which consists of a word or a drawing, and settings.
//!
//! No file path is accepted from the network. A drawing arrives as text and is stored under a fixed
//! name, and keys that name a file cannot be set.

use std::collections::BTreeMap;
use std::io::Cursor;

use base64::prelude::{BASE64_STANDARD, Engine};
use image::{ImageFormat, ImageReader};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::messages::{Key, Message};
use noctograph_core::error::{Error, Result};
use noctograph_letters::plain;

/// Maximum number of characters in a word.
pub const MAX_WORD: usize = 24;
/// Maximum number of characters in the name of a visitor.
const MAX_VISITOR: usize = 40;

/// Maximum number of bytes in a setting's value. The longest value is the list of omitted strokes.
const MAX_VALUE: usize = 4096;

/// Name of the file in which a log is stored.
pub(crate) const LOG: &str = "log";

/// Longest side of a picture, in pixels.
const MAX_SIDE: u32 = 2000;

/// Keys that the page's controls and advice can set. An entry that ends with a dot stands for all
/// keys of a table.
const KEYS: &str = "camera.body camera.f_number camera.focus_m camera.framing camera.framing.fill_frac \
    camera.iso camera.lens camera.metering camera.shutter_close_s camera.shutter_open_s \
    controller. letters.canvas_m letters.cap_height_m letters.corners_px \
    letters.font letters.ink letters.pace letters.spacing_m \
    letters.trace letters.without light.color_led_wrgb light.deck light.led_bitmask \
    light.letters_wrgb light.ring photo.ambient_cd_m2 plan.drones plan.light_clock \
    plan.lights plan.reference plan.stroke_speed_m_s plan.style preset seed";

/// Keys that a kiosk's page can set, for the lamp's color and for the drawing pad.
const KIOSK_KEYS: &str = "camera.framing.fill_frac letters.canvas_m letters.pace light.deck \
    light.letters_wrgb plan.lights";

/// Range of aspect ratios (width to height) that a page may request.
const ASPECTS: std::ops::RangeInclusive<f64> = 0.4..=2.5;

/// Kind of page that requests a photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asker {
    /// Page without a server, which also photographs the logs of flights.
    Alone,
    /// Page of a server, to which visitors can send photos to be flown.
    Served,
    /// Page of a kiosk, which can set only the keys of its controls.
    Kiosk,
}

/// A request as the page sends it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Posted {
    visitor: String,
    number: Option<u64>,
    #[serde(default)]
    advice: bool,
    #[serde(default)]
    files: bool,
    #[serde(default)]
    word: String,
    drawing: Option<Drawing>,
    log: Option<String>,
    room: Option<String>,
    #[serde(default)]
    settings: BTreeMap<String, String>,
    aspect: Option<f64>,
}

/// A checked request.
#[derive(Debug)]
pub struct PhotoRequest {
    /// Random name of the page that sends the request.
    pub visitor: String,
    /// Number that increases with each change, by which the page recognizes an outdated answer.
    pub number: Option<u64>,
    /// True if the page asks for advice on an unreadable word.
    pub advice: bool,
    /// True if the large photo's files are requested.
    pub files: bool,
    /// The word or drawing.
    pub subject: Subject,
}

/// A word or drawing with its settings. Equal subjects yield equal photos.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Subject {
    /// The word to write, or an empty text for a drawing.
    pub word: String,
    drawing: Option<Drawing>,
    /// Log of a flight, in base64. In that case, the word is the one that was flown, or empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) log: Option<String>,
    /// Width, depth and height of the room in meters, as `--room` accepts them.
    pub room: Option<String>,
    /// Keys of the scene with their values.
    pub settings: BTreeMap<String, String>,
    /// Ratio of the photo's width to its height.
    aspect: Option<f64>,
}

/// A product that can be made from a subject.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Product {
    /// The photo that is shown while a visitor types, with its verdict.
    Live,
    /// The large photo, with an explained verdict and the checks that stop its flight.
    Large {
        /// True if advice on an unreadable word is wanted, which takes about thirty flights.
        advice: bool,
        /// True if files of the photo, the scene and the plans are also made.
        files: bool,
    },
    /// The scripts that fly the subject, and the files that they need.
    Script,
}

/// A drawing in place of a word. For a picture, the text is the file in base64.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
struct Drawing {
    kind: Kind,
    text: String,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Svg,
    Json,
    Jpg,
}

impl Drawing {
    /// Returns the content of the drawing's file. Refuses a picture that is broken or too large.
    fn bytes(&self) -> Result<Vec<u8>> {
        if self.kind != Kind::Jpg {
            return Ok(self.text.clone().into_bytes());
        }
        let bytes = BASE64_STANDARD.decode(&self.text).map_err(not_a_picture)?;
        // The page scales pictures down, but another sender's small file may contain a huge one.
        let reader = ImageReader::with_format(Cursor::new(&bytes), ImageFormat::Jpeg);
        let (width, height) = reader.into_dimensions().map_err(not_a_picture)?;
        if width.max(height) > MAX_SIDE {
            return Err(not_a_picture(format!("{width} × {height} pixels")));
        }
        Ok(bytes)
    }
}

/// Returns the error for a picture that cannot be used.
fn not_a_picture(actual: impl ToString) -> Error {
    let wanted = format!("a JPEG of at most {MAX_SIDE} pixels a side, in base64");
    Error::input("drawing", actual.to_string(), wanted, "reload the page")
}

impl PhotoRequest {
    /// Parses and checks a request. Returns a message to the visitor if it is refused.
    pub fn parse(body: &[u8], asker: Asker) -> std::result::Result<Self, Message> {
        let posted: Posted = serde_json::from_slice(body)
            .map_err(|broken| Message::of_old_page(&broken.to_string()))?;
        let Posted { visitor, number, advice, files, word, drawing, log, room, settings, aspect } =
            posted;
        if log.is_some() && (asker != Asker::Alone || drawing.is_some()) {
            return Err(Message::of_old_page("the log of a flight"));
        }
        // The word is checked first, because a visitor can correct errors in it. No page of this
        // version sends an invalid name or invalid settings.
        let word = plain(&word);
        check_word(&word)?;
        // A log may have an empty word.
        if word.trim().is_empty() && drawing.is_none() && log.is_none() {
            return Err(Key::WordEmpty.into());
        }
        if !is_name(&visitor) {
            return Err(Message::of_old_page(&format!("a visitor of {} bytes", visitor.len())));
        }
        if let Some(key) = unlisted(&settings, KEYS) {
            let values = json!({ "setting": key });
            return Err(Message::of_old_page(&format!("the setting {key}")).with_values(values));
        }
        let exceeds_kiosk = advice || room.is_some() || unlisted(&settings, KIOSK_KEYS).is_some();
        if asker == Asker::Kiosk && exceeds_kiosk {
            return Err(Key::NotHere.into());
        }
        check_values(&settings)?;
        if let Some(aspect) = aspect.filter(|aspect| !ASPECTS.contains(aspect)) {
            return Err(Message::of_old_page(&format!("the proportions {aspect}")));
        }
        let subject = Subject { word, drawing, log, room, settings, aspect };
        Ok(Self { visitor, number, advice, files, subject })
    }
}

/// Checks that a word has at most [`MAX_WORD`] characters.
fn check_word(word: &str) -> std::result::Result<(), Message> {
    let n_letters = word.chars().count();
    if n_letters <= MAX_WORD {
        return Ok(());
    }
    let values = json!({ "letters": n_letters, "most": MAX_WORD });
    let text = format!("{n_letters} letters, wanted at most {MAX_WORD}");
    Err(Message::new(Key::WordLong, values, text, "write a shorter word"))
}

/// Checks that no value is too long and that none names a file, because a visitor must not read the
/// server's files. Returns the message for a page that sends such a value.
fn check_values(settings: &BTreeMap<String, String>) -> std::result::Result<(), Message> {
    if let Some((key, value)) = settings.iter().find(|(_, value)| value.len() > MAX_VALUE) {
        let actual = format!("{key} of {} bytes, wanted at most {MAX_VALUE}", value.len());
        return Err(Message::of_old_page(&actual));
    }
    // A font name with a dot or a slash would be a file path.
    let font = settings.get("letters.font");
    match font.filter(|font| font.contains(['.', '/', '\\'])) {
        Some(font) => Err(Message::of_old_page(&format!("letters.font={font}"))),
        None => Ok(()),
    }
}

/// Returns a key of the settings that is neither in the list `keys` nor in one of its tables, or
/// `None` if there is no such key.
fn unlisted<'a>(settings: &'a BTreeMap<String, String>, keys: &str) -> Option<&'a String> {
    settings.keys().find(|key| {
        !keys
            .split(' ')
            .any(|listed| listed == *key || listed.ends_with('.') && key.starts_with(listed))
    })
}

/// Returns true if a string is a valid name of a visitor: up to 40 ASCII letters and
/// digits.
pub fn is_name(visitor: &str) -> bool {
    (1..=MAX_VISITOR).contains(&visitor.len())
        && visitor.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

impl Subject {
    /// Returns the word, or `None` for a drawing.
    pub fn title(&self) -> Option<&str> {
        self.drawing.is_none().then_some(&*self.word)
    }

    /// Returns true for a picture (JPEG), in which lines must be detected.
    pub fn is_picture(&self) -> bool {
        self.drawing.as_ref().is_some_and(|drawing| drawing.kind == Kind::Jpg)
    }

    /// Returns the width and height, both even, of a photo with about `pixels` pixels in all.
    /// Without an aspect in the request, the photo is 16:9.
    pub fn size_px(&self, pixels: f64) -> [u32; 2] {
        let aspect = self.aspect.unwrap_or(16.0 / 9.0);
        let width = (pixels * aspect).sqrt();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
        [width, width / aspect].map(|side| 2 * (side / 2.0).round() as u32)
    }

    /// Returns the name and the content of the drawing's file, or `None` for a word.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a picture that cannot be read or is too large.
    pub fn drawing(&self) -> Result<Option<(&'static str, Vec<u8>)>> {
        let Some(drawing) = &self.drawing else { return Ok(None) };
        let name = match drawing.kind {
            Kind::Svg => "drawing.svg",
            Kind::Json => "drawing.json",
            Kind::Jpg => "drawing.jpg",
        };
        Ok(Some((name, drawing.bytes()?)))
    }
}
