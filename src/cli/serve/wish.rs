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
use serde::Deserialize;

use super::super::output::Output;
use super::super::preview::PreviewArgs;
use super::super::{Args, Verb};
use crate::error::{Error, Result};
use crate::letters::LetterOptions;

/// Most characters of a word, and of the name of a visitor.
const MAX_WORD: usize = 24;
const MAX_VISITOR: usize = 40;

/// Most pixels of a picture's side.
const MAX_SIDE: u32 = 2000;

/// Keys that can be set: those of the page's controls and those that advice sets.
const KEYS: [&str; 30] = [
    "camera.body",
    "camera.f_number",
    "camera.focus_m",
    "camera.framing",
    "camera.iso",
    "camera.lens",
    "camera.metering",
    "camera.shutter_close_s",
    "camera.shutter_open_s",
    "controller.kind",
    "letters.canvas_m",
    "letters.cap_height_m",
    "letters.font",
    "letters.pace",
    "letters.spacing_m",
    "letters.trace",
    "light.color_led_wrgb",
    "light.deck",
    "light.led_bitmask",
    "light.letters_wrgb",
    "light.ring",
    "photo.ambient_cd_m2",
    "plan.drones",
    "plan.light_clock",
    "plan.lights",
    "plan.reference",
    "plan.stroke_speed_m_s",
    "plan.style",
    "preset",
    "seed",
];

/// A request of the page.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wish {
    /// Random name of the page that asks.
    pub(super) visitor: String,
    #[serde(default)]
    word: String,
    drawing: Option<Drawing>,
    /// Width, depth and height in meters, as `--room` takes them.
    room: Option<String>,
    #[serde(default)]
    settings: BTreeMap<String, String>,
}

/// A drawing in place of a word. A picture's text is base64.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Drawing {
    kind: Kind,
    text: String,
}

#[derive(Clone, Copy, Debug, Deserialize)]
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
    pub(super) fn parse(body: &[u8]) -> Result<Self> {
        let refused = |place: &str, found: String, wanted: &str| {
            Err(Error::input(place, found, wanted, "reload the page"))
        };
        let wish: Self = match serde_json::from_slice(body) {
            Ok(wish) => wish,
            Err(broken) => return refused("request", broken.to_string(), "JSON of the page"),
        };
        let n_letters = wish.word.chars().count();
        if n_letters > MAX_WORD {
            let wanted = format!("at most {MAX_WORD}");
            let hint = "write a shorter word";
            return Err(Error::input("word", format!("{n_letters} letters"), wanted, hint));
        }
        if wish.word.trim().is_empty() && wish.drawing.is_none() {
            return Err(Error::input("word", "nothing", "a word", "type or draw something"));
        }
        if wish.visitor.len() > MAX_VISITOR {
            let (found, most) = (wish.visitor.len(), format!("at most {MAX_VISITOR}"));
            return refused("visitor", format!("{found} bytes"), &most);
        }
        if let Some(key) = wish.settings.keys().find(|key| !KEYS.contains(&key.as_str())) {
            return refused("settings", key.clone(), "a key of the page's controls");
        }
        if let Some(font) = wish.settings.get("letters.font") {
            let letters = LetterOptions { font: font.clone(), ..LetterOptions::default() };
            if letters.files().next().is_some() {
                return refused("letters.font", font.clone(), "a font by its name");
            }
        }
        Ok(wish)
    }

    /// The word, or `drawing`.
    pub(super) fn title(&self) -> &str {
        if self.drawing.is_some() { "drawing" } else { &self.word }
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
    match Args::try_parse_from(typed).map(|args| args.verb) {
        Ok(Verb::Preview(args)) => Ok(args),
        Ok(_) => unreachable!("the verb is preview"),
        Err(error) => {
            let text = error.to_string();
            let first = text.lines().next().unwrap_or_default().trim_start_matches("error: ");
            Err(Error::input(
                "settings",
                first,
                "values that the controls offer",
                "reload the page",
            ))
        }
    }
}
