//! What a visitor wishes to see: a word or a drawing, and settings. It becomes the arguments of a
//! verb, so that the page can do what the command line does and nothing else.
//!
//! No path comes from the network: a drawing is a text, which is written into the job's own folder,
//! and only keys that name no file can be set.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::{Cursor, Write};
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine};
use clap::Parser;
use image::{ImageFormat, ImageReader};
use serde::{Deserialize, Serialize};

use super::super::preview::PreviewArgs;
use super::said::{Key, Said};
use super::{CommandLine, Error, Output, Result, Verb, json, refused};
use crate::letters::LetterOptions;

/// Most characters of a word, and of the name of a visitor.
pub(super) const MAX_WORD: usize = 24;
const MAX_VISITOR: usize = 40;

/// Most bytes of a setting's value: the longest lists the strokes that are left out.
const MAX_VALUE: usize = 4096;

/// Most pixels of a picture's side.
const MAX_SIDE: u32 = 2000;

/// Keys that can be set: those of the page's controls and those that advice sets.
const KEYS: &str = "camera.body camera.f_number camera.focus_m camera.framing camera.framing.fill_frac \
    camera.iso camera.lens camera.metering camera.shutter_close_s camera.shutter_open_s \
    controller.kind letters.canvas_m letters.cap_height_m letters.corners_px \
    letters.font letters.ink letters.pace letters.spacing_m \
    letters.trace letters.without light.color_led_wrgb light.deck light.led_bitmask \
    light.letters_wrgb light.ring photo.ambient_cd_m2 plan.drones plan.light_clock \
    plan.lights plan.reference plan.stroke_speed_m_s plan.style preset seed";

/// Proportions of a photo that a page may ask for, width by height.
const ASPECTS: std::ops::RangeInclusive<f64> = 0.4..=2.5;

/// A request of the page.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    visitor: String,
    number: Option<u64>,
    #[serde(default = "yes")]
    advice: bool,
    #[serde(default)]
    word: String,
    drawing: Option<Drawing>,
    room: Option<String>,
    #[serde(default)]
    settings: BTreeMap<String, String>,
    aspect: Option<f64>,
}

fn yes() -> bool {
    true
}

/// What a visitor wishes to see.
#[derive(Debug)]
pub(super) struct Wish {
    /// Random name of the page that asks.
    pub(super) visitor: String,
    /// Rises with each change, so that a wish that arrives late is known.
    pub(super) number: Option<u64>,
    /// Whether changes are flown where a word does not read.
    pub(super) advice: bool,
    pub(super) subject: Subject,
}

/// What is written or drawn, and how: equal subjects make equal photos.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Subject {
    pub(super) word: String,
    drawing: Option<Drawing>,
    /// Width, depth and height in meters, as `--room` takes them.
    room: Option<String>,
    settings: BTreeMap<String, String>,
    /// Width of the photo by its height.
    aspect: Option<f64>,
}

/// What can be made.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Task {
    /// The photo while one types.
    Live(Subject),
    /// The large photo, with advice or without.
    Large(Subject, bool),
    /// The drawing of the plans (SVG).
    Plan(Subject),
    /// The report (HTML).
    Report(Subject),
    /// The scripts that fly it, with what they need.
    Script(Subject),
}

impl Task {
    pub(super) fn subject(&self) -> &Subject {
        match self {
            Self::Live(subject)
            | Self::Large(subject, _)
            | Self::Plan(subject)
            | Self::Report(subject)
            | Self::Script(subject) => subject,
        }
    }
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
        let refused = |found: String| {
            let wanted = format!("a JPEG of at most {MAX_SIDE} pixels a side, in base64");
            Error::input("drawing", found, wanted, "reload the page")
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

impl Wish {
    /// Reads and checks a request.
    pub(super) fn parse(body: &[u8]) -> std::result::Result<Self, Said> {
        let refused = |found: String| Err(Said::of_old_page(&found));
        let request: Request = match serde_json::from_slice(body) {
            Ok(request) => request,
            Err(broken) => return refused(broken.to_string()),
        };
        let Request { visitor, number, advice, word, drawing, room, settings, aspect } = request;
        let n_letters = word.chars().count();
        if n_letters > MAX_WORD {
            return Err(Said::new(
                Key::WordLong,
                json!({ "letters": n_letters, "most": MAX_WORD }),
                format!("{n_letters} letters, wanted at most {MAX_WORD}"),
                "write a shorter word",
            ));
        }
        if word.trim().is_empty() && drawing.is_none() {
            let hint = "type or draw something";
            return Err(Said::new(Key::WordEmpty, json!({}), "there is no word".into(), hint));
        }
        if !is_name(&visitor) {
            return refused(format!("a visitor of {} bytes", visitor.len()));
        }
        if let Some(key) = settings.keys().find(|key| KEYS.split(' ').all(|known| known != *key)) {
            return refused(format!("the setting {key}"));
        }
        if let Some((key, value)) = settings.iter().find(|(_, value)| value.len() > MAX_VALUE) {
            return refused(format!("{key} of {} bytes, wanted at most {MAX_VALUE}", value.len()));
        }
        if let Some(font) = settings.get("letters.font") {
            let letters = LetterOptions { font: font.clone(), ..LetterOptions::default() };
            if letters.files().next().is_some() {
                return refused(format!("letters.font={font}"));
            }
        }
        if let Some(aspect) = aspect.filter(|aspect| !ASPECTS.contains(aspect)) {
            return refused(format!("the proportions {aspect}"));
        }
        let subject = Subject { word, drawing, room, settings, aspect };
        Ok(Self { visitor, number, advice, subject })
    }
}

/// Whether a visitor may be called so.
pub(super) fn is_name(visitor: &str) -> bool {
    (1..=MAX_VISITOR).contains(&visitor.len())
        && visitor.bytes().all(|byte| byte.is_ascii_alphanumeric())
}

impl Subject {
    /// The word; `None` for a drawing.
    pub(super) fn title(&self) -> Option<&str> {
        self.drawing.is_none().then_some(&*self.word)
    }

    /// Whether it is a picture, whose lines are looked for.
    pub(super) fn is_picture(&self) -> bool {
        self.drawing.as_ref().is_some_and(|drawing| drawing.kind == Kind::Jpg)
    }

    /// The size of a photo of about as many pixels: `--size=960x540`.
    pub(super) fn size(&self, pixels: f64) -> String {
        let aspect = self.aspect.unwrap_or(16.0 / 9.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
        let even = |side: f64| 2 * (side / 2.0).round() as u32;
        let width = (pixels * aspect).sqrt();
        format!("--size={}x{}", even(width), even(width / aspect))
    }

    /// Arguments for a verb that takes a subject; a drawing is written into a folder.
    pub(super) fn arguments(&self, folder: &Path) -> Result<Vec<OsString>> {
        let mut arguments = Vec::new();
        let mut flag = |name: &str, value: &str| arguments.push(format!("{name}={value}").into());
        for (key, value) in &self.settings {
            flag("--set", &format!("{key}={value}"));
        }
        if let Some(room) = &self.room {
            flag("--room", room);
        }
        match &self.drawing {
            None => flag("--word", &self.word),
            Some(drawing) => {
                let name = match drawing.kind {
                    Kind::Svg => "drawing.svg",
                    Kind::Json => "drawing.json",
                    Kind::Jpg => "drawing.jpg",
                };
                let (path, bytes) = (folder.join(name), drawing.bytes()?);
                Output::create(&path)?.keep(|out| out.write_all(&bytes))?;
                arguments.extend(["--drawing".into(), path.into()]);
            }
        }
        Ok(arguments)
    }
}

/// The arguments of a preview, parsed as the command line's.
pub(super) fn preview_args(arguments: Vec<OsString>) -> Result<PreviewArgs> {
    let typed = ["noctograph", "preview"].map(OsString::from).into_iter().chain(arguments);
    match CommandLine::try_parse_from(typed).map(|args| args.verb) {
        Ok(Verb::Preview(args)) => Ok(args),
        Ok(_) => unreachable!("the verb is preview"),
        Err(error) => {
            let wanted = "values that the controls offer";
            Err(Error::input("settings", refused(&error), wanted, "reload the page"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn subject(wish: &Value) -> Subject {
        let mut wish = wish.clone();
        wish["visitor"] = "me".into();
        Wish::parse(wish.to_string().as_bytes()).unwrap().subject
    }

    #[test]
    fn every_refusal_has_a_key_and_a_sentence_without_a_path() {
        let folder = tempfile::tempdir().unwrap();
        let of = |wish: Value| {
            let subject = subject(&wish);
            let typed = subject.arguments(folder.path());
            let error = typed.and_then(preview_args).and_then(|it| it.shoot());
            let said = Said::of_error(&error.unwrap_err(), subject.is_picture());
            let temporary = folder.path().to_str().unwrap();
            assert!(!said.text.contains(temporary) && !said.hint.contains(temporary), "{said:?}");
            said.key
        };
        let svg = |text: &str| json!({ "drawing": { "kind": "svg", "text": text } });
        let json = |text: &str| json!({ "drawing": { "kind": "json", "text": text } });
        assert_eq!(of(json!({ "word": "A\u{1f600}" })), "letter-missing");
        assert_eq!(of(svg("<svg xmlns='http://www.w3.org/2000/svg'/>")), "drawing-empty");
        assert_eq!(of(svg("no")), "drawing-broken");
        assert_eq!(of(json("{\"strokes\": 3}")), "drawing-broken");
        assert_eq!(of(json("{\"strokes\": []}")), "drawing-empty");
        let jpg = json!({ "drawing": { "kind": "jpg", "text": "AAAA" } });
        assert_eq!(of(jpg), "drawing-broken");
        let far: Vec<_> = (0..3000).map(|n| [[0, n], [1000, n]]).collect();
        let long = json!({ "strokes": far }).to_string();
        assert!(["flight-long", "drawing-large"].contains(&&*of(json(&long))));
        assert_eq!(of(json!({ "word": "A", "room": "--help" })), "page-old");
        assert_eq!(of(json!({ "word": "A", "settings": { "seed": "x" } })), "not-possible");
    }
}
