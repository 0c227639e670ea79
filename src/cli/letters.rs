//! Flags of the letters: font or drawing, colors, and the room that they are fitted to.

use clap::Args;

use super::names::numbers;
use super::set::{Setting, owned};
use crate::light::{ColorLedLevels, color_led_wrgb};
use crate::preflight::Profile;

/// The word as it is drawn.
#[derive(Debug, Args)]
pub(super) struct LetterFlags {
    /// Font of a word: ae483, ae483-fixed, simplex, or a file *.strokes, *.ttf or *.otf
    #[arg(long, value_name = "NAME|FILE")]
    font: Option<String>,
    /// Drawing instead of a word: *.svg, a picture *.png or *.jpg (lines on paper, a
    /// logo, a photograph), or handwriting as *.json; the color LED deck and the ring write in its
    /// colors
    #[arg(long, value_name = "FILE")]
    drawing: Option<String>,
    /// Detail of a drawing, from 0 (a sketch of the longest strokes) to 1 (every stroke) [default: 1; 0.5 for
    /// a photograph]
    #[arg(long, value_name = "0..1")]
    detail: Option<f64>,
    /// Colors of the letters in turn, as #rrggbb or names of CSS: the color LED deck writes (the ring
    /// writes in colors that the scene names)
    #[arg(long, value_name = "COLOR,...", value_delimiter = ',', value_parser = color)]
    color: Vec<[u8; 4]>,
    /// Width, depth and height of the room in meters, such as 4x3x2.5, its middle at x = y = 0: a
    /// word is as large as it allows, half a meter from the walls, 0.7 m below the ceiling and
    /// within the 4 m that two Lighthouse stations serve; these hang in its corners where no scene
    /// places them, and safety checks keep any plan 0.2 m from its walls
    #[arg(long, value_name = "WxDxH", value_parser = room)]
    room: Option<[f64; 3]>,
}

/// Without the firmware's correction of brightness, dim colors have twice as many steps.
const LEVELS: ColorLedLevels = ColorLedLevels::Plain;

/// A color as CSS writes it, as the bytes of the color LED deck that show it.
fn color(text: &str) -> Result<[u8; 4], String> {
    let wanted = "wanted #rrggbb or a color of CSS, such as red, orange or hotpink";
    let found: svgtypes::Color =
        text.parse().map_err(|error: svgtypes::Error| format!("{wanted} ({error})"))?;
    Ok(color_led_wrgb([found.red, found.green, found.blue], LEVELS))
}

/// Least distance of the word from the sides of the volume that a drone may fly in, and from its
/// top: a base station 0.1 m higher then sees the word's top from as far as it reaches, 6 m.
const FROM_SIDES_M: f64 = 0.3;
const FROM_TOP_M: f64 = 0.5;

/// Width that two base stations serve (Bitcraze, "Getting started with the Lighthouse system":
/// about 4 m by 4 m).
const SERVED_M: f64 = 4.0;

fn room(text: &str) -> Result<[f64; 3], String> {
    let sides = numbers(text, &['x', 'X', '×']);
    let wanted = "wanted WIDTHxDEPTHxHEIGHT in meters, at least 1.5x1.5x1, such as 4x3x2.5";
    let fits = |[w, d, h]: &[f64; 3]| *w >= 1.5 && *d >= 1.5 && *h >= 1.0;
    sides.filter(fits).filter(|sides| sides.iter().all(|m| *m <= 1000.0)).ok_or(wanted.to_owned())
}

impl LetterFlags {
    /// The room that was typed.
    pub(super) fn room_m(&self) -> Option<[f64; 3]> {
        self.room
    }

    /// The keys of the scene that were typed.
    pub(super) fn settings(&self) -> Vec<Setting> {
        let font = self.font.iter().map(|font| ("letters.font", font.as_str()));
        let drawing = self.drawing.iter();
        let drawing = drawing.flat_map(|file| {
            [("letters.drawing", file.as_str()), ("letters.drawing_sha256", ""), ("word", "")]
        });
        let mut settings = owned(font.chain(drawing));
        settings
            .extend(self.detail.map(|detail| ("letters.detail".to_owned(), detail.to_string())));
        if !self.color.is_empty() {
            let colors = self.color.iter().map(|wrgb| format!("{wrgb:?}"));
            let colors = format!("[{}]", colors.collect::<Vec<_>>().join(", "));
            settings.push(("light.letters_wrgb".to_owned(), colors));
            let lamp = [
                ("light.deck", "color-led"),
                ("plan.lights", "[\"color-led\"]"),
                ("light.color_led_levels", LEVELS.name()),
            ];
            settings.extend(owned(lamp.into_iter()));
        }
        if let Some(room_m) = self.room {
            settings.push(("expose.room_m".to_owned(), format!("{room_m:?}")));
            let [low, high] = Profile::indoor().in_room(room_m).volume_m;
            let wide_m = (high[0] - low[0] - 2.0 * FROM_SIDES_M).min(SERVED_M);
            // A low room has the word nearer to its floor.
            let baseline_m = (0.25 * room_m[2]).min(0.5);
            let high_m = high[2] - FROM_TOP_M - baseline_m;
            let key = |(key, value): (&str, String)| (format!("letters.{key}"), value);
            settings.extend(
                [
                    ("canvas_m", format!("[{wide_m}, {high_m}]")),
                    ("baseline_m", baseline_m.to_string()),
                    ("fit", "fill".to_owned()),
                    ("align", "center".to_owned()),
                ]
                .map(key),
            );
        }
        settings
    }
}
