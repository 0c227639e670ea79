//! A photo that a visitor asks for: a word or a drawing, and settings.
//!
//! No path comes from the network: a drawing is a text, which is whose file has a name of ours,
//! and only keys that name no file can be set.

use std::collections::BTreeMap;
use std::io::Cursor;

use base64::prelude::{BASE64_STANDARD, Engine};
use image::{ImageFormat, ImageReader};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::messages::{Key, Message};
use noctograph_core::error::{Error, Result};
use noctograph_letters::plain;

/// Most characters of a word, and of the name of a visitor.
pub const MAX_WORD: usize = 24;
const MAX_VISITOR: usize = 40;

/// Most bytes of a setting's value: the longest lists the strokes that are left out.
const MAX_VALUE: usize = 4096;

/// Name of a log's file.
pub(crate) const LOG: &str = "log";

/// Most pixels of a picture's side.
const MAX_SIDE: u32 = 2000;

/// Keys that can be set: those of the page's controls and those that advice sets; all of a table
/// that ends with a dot.
const KEYS: &str = "camera.body camera.f_number camera.focus_m camera.framing camera.framing.fill_frac \
    camera.iso camera.lens camera.metering camera.shutter_close_s camera.shutter_open_s \
    controller. letters.canvas_m letters.cap_height_m letters.corners_px \
    letters.font letters.ink letters.pace letters.spacing_m \
    letters.trace letters.without light.color_led_wrgb light.deck light.led_bitmask \
    light.letters_wrgb light.ring photo.ambient_cd_m2 plan.drones plan.light_clock \
    plan.lights plan.reference plan.stroke_speed_m_s plan.style preset seed";

/// Those of them that the page of a kiosk sets: the lamp's color, and the pad.
const KIOSK_KEYS: &str = "camera.framing.fill_frac letters.canvas_m letters.pace light.deck \
    light.letters_wrgb plan.lights";

/// Proportions of a photo that a page may ask for, width by height.
const ASPECTS: std::ops::RangeInclusive<f64> = 0.4..=2.5;

/// The page that asks for a photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asker {
    /// Without a server: the logs of flights are photographed, too.
    Alone,
    /// Of a server: what is asked for can be flown.
    Served,
    /// Of a kiosk: with no settings but those of its controls.
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

/// A photo that a visitor asks for.
#[derive(Debug)]
pub struct PhotoRequest {
    /// Random name of the page that asks.
    pub visitor: String,
    /// Rises with each change, so that a request that arrives late is known.
    pub number: Option<u64>,
    /// Whether changes are flown where a word does not read.
    pub advice: bool,
    /// Whether the large photo comes with its files.
    pub files: bool,
    /// What is written or drawn.
    pub subject: Subject,
}

/// What is written or drawn, and how: equal subjects make equal photos.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Subject {
    /// The word; that of a drawing is empty.
    pub word: String,
    drawing: Option<Drawing>,
    /// The log of a flight, in base64; the word is the one that was flown, or empty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) log: Option<String>,
    /// Width, depth and height in meters, as `--room` takes them.
    pub room: Option<String>,
    /// Keys of the scene with their values.
    pub settings: BTreeMap<String, String>,
    /// Width of the photo by its height.
    aspect: Option<f64>,
}

/// What can be made of a subject.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Product {
    /// The photo while one types, with its verdict.
    Live,
    /// The large photo, its verdict explained and what stops its flight.
    Large {
        /// Whether there is advice where it does not read, which takes some thirty flights.
        advice: bool,
        /// Whether its files are there: photo, scene and plans.
        files: bool,
    },
    /// The scripts that fly it, with what they need.
    Script,
}

/// A drawing in place of a word. A picture's text is base64.
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
    /// What its file holds.
    fn bytes(&self) -> Result<Vec<u8>> {
        if !matches!(self.kind, Kind::Jpg) {
            return Ok(self.text.clone().into_bytes());
        }
        let refused = |actual: String| {
            let wanted = format!("a JPEG of at most {MAX_SIDE} pixels a side, in base64");
            Error::input("drawing", actual, wanted, "reload the page")
        };
        let bytes = BASE64_STANDARD.decode(&self.text).map_err(|e| refused(e.to_string()))?;
        // The page makes pictures smaller; a small file can hold a huge one.
        let reader = ImageReader::with_format(Cursor::new(&bytes), ImageFormat::Jpeg);
        let (width, height) = reader.into_dimensions().map_err(|e| refused(e.to_string()))?;
        if width.max(height) > MAX_SIDE {
            return Err(refused(format!("{width} × {height} pixels")));
        }
        Ok(bytes)
    }
}

impl PhotoRequest {
    /// Reads and checks a request.
    ///
    /// # Errors
    ///
    /// The message to its visitor.
    pub fn parse(body: &[u8], asker: Asker) -> std::result::Result<Self, Message> {
        let refused = |actual: String| Err(Message::of_old_page(&actual));
        let posted: Posted = match serde_json::from_slice(body) {
            Ok(posted) => posted,
            Err(broken) => return refused(broken.to_string()),
        };
        let Posted { visitor, number, advice, files, word, drawing, log, room, settings, aspect } =
            posted;
        if log.is_some() && (asker != Asker::Alone || drawing.is_some()) {
            return refused("the log of a flight".into());
        }
        // What a title is made of runs as it is written.
        let word = plain(&word);
        let n_letters = word.chars().count();
        if n_letters > MAX_WORD {
            return Err(Message::new(
                Key::WordLong,
                json!({ "letters": n_letters, "most": MAX_WORD }),
                format!("{n_letters} letters, wanted at most {MAX_WORD}"),
                "write a shorter word",
            ));
        }
        if word.trim().is_empty() && drawing.is_none() && log.is_none() {
            return Err(Key::WordEmpty.into());
        }
        if !is_name(&visitor) {
            return refused(format!("a visitor of {} bytes", visitor.len()));
        }
        let lacks = |keys: &str| settings.keys().find(|key| !lists(keys, key));
        if let Some(key) = lacks(KEYS) {
            let values = json!({ "setting": key });
            return Err(Message::of_old_page(&format!("the setting {key}")).with_values(values));
        }
        if asker == Asker::Kiosk && (advice || room.is_some() || lacks(KIOSK_KEYS).is_some()) {
            return Err(Key::NotHere.into());
        }
        if let Some((key, value)) = settings.iter().find(|(_, value)| value.len() > MAX_VALUE) {
            return refused(format!("{key} of {} bytes, wanted at most {MAX_VALUE}", value.len()));
        }
        // A name with a dot is a file's.
        if let Some(font) = settings.get("letters.font").filter(|it| it.contains(['.', '/', '\\']))
        {
            return refused(format!("letters.font={font}"));
        }
        if let Some(aspect) = aspect.filter(|aspect| !ASPECTS.contains(aspect)) {
            return refused(format!("the proportions {aspect}"));
        }
        let subject = Subject { word, drawing, log, room, settings, aspect };
        Ok(Self { visitor, number, advice, files, subject })
    }
}

/// Whether keys have one, or its table.
fn lists(keys: &str, key: &str) -> bool {
    keys.split(' ').any(|it| it == key || it.ends_with('.') && key.starts_with(it))
}

/// Whether a visitor may be called so.
pub fn is_name(visitor: &str) -> bool {
    (1..=MAX_VISITOR).contains(&visitor.len())
        && visitor.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

impl Subject {
    /// The word; `None` for a drawing.
    pub fn title(&self) -> Option<&str> {
        self.drawing.is_none().then_some(&*self.word)
    }

    /// Whether it is a picture, whose lines are looked for.
    pub fn is_picture(&self) -> bool {
        self.drawing.as_ref().is_some_and(|drawing| drawing.kind == Kind::Jpg)
    }

    /// The size of a photo of about as many pixels.
    pub fn size_px(&self, pixels: f64) -> [u32; 2] {
        let aspect = self.aspect.unwrap_or(16.0 / 9.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
        let even = |side: f64| 2 * (side / 2.0).round() as u32;
        let width = (pixels * aspect).sqrt();
        [even(width), even(width / aspect)]
    }

    /// Name and content of the drawing's file; `None` of a word.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a picture that is none, or too large.
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
