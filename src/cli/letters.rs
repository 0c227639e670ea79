//! Flags for the font or drawing, the colors, and the room into which the letters are fitted.

use std::fmt::Display;

use super::names::{Corners, Setting};
use crate::light::{ColorLedLevels, color_led_wrgb};
use crate::preflight::{letters_within, parse_room};
use clap::Args;

/// Flags of the letters or the drawing.
#[derive(Debug, Args)]
pub(super) struct LetterFlags {
    /// Font of a word: ae483, ae483-fixed, simplex, or a file *.strokes, *.ttf or *.otf
    #[arg(long, value_name = "NAME|FILE")]
    font: Option<String>,
    /// Fonts for letters that the font lacks, such as a typeface of another script. The first font
    /// that contains a letter is used
    #[arg(long, value_name = "NAME|FILE,...", value_delimiter = ',')]
    fallback: Vec<String>,
    /// Drawing instead of a word: *.svg, a picture *.png, *.jpg, *.webp, *.gif or *.bmp (lines on
    /// paper, a logo), or handwriting as *.json. The color LED deck and the ring reproduce the
    /// drawing's colors
    #[arg(long, value_name = "FILE")]
    drawing: Option<String>,
    /// Detail of a drawing, from 0 (a sketch of the longest strokes) to 1 (every stroke) [default:
    /// 1]
    #[arg(long, value_name = "0..1")]
    detail: Option<f64>,
    /// Strokes to draw, by their colors or numbers, such as red or 2,5-7 (`plan -o x.svg` shows the
    /// numbers) [default: all]
    #[arg(long, value_name = "COLOR|N,...")]
    ink: Option<String>,
    /// Strokes to leave out, by their colors or numbers [default: none]
    #[arg(long, value_name = "COLOR|N,...")]
    without: Option<String>,
    /// Corners of the sheet of paper in a picture, in pixels: "X,Y X,Y X,Y X,Y", clockwise from the
    /// upper left. The picture is cropped to the sheet and rectified [default: the whole picture]
    #[arg(long, value_name = "CORNERS", requires = "drawing")]
    corners: Option<Corners>,
    /// Colors in which the color LED deck writes the letters in turn, as #rrggbb or CSS names
    /// (colors of the ring are set in the scene)
    #[arg(long, value_name = "COLOR,...", value_delimiter = ',', value_parser = color)]
    color: Vec<[u8; 4]>,
    /// Width, depth and height of the room in meters, such as 4x3x2.5, with its middle at x = y =
    /// 0. A word is as large as the room allows: half a meter from the walls, 0.7 m below the
    /// ceiling, within the 4 m that two Lighthouse stations serve, and completely visible to a
    /// camera in the room. Stations hang in the corners of the room unless a scene places them.
    /// Safety checks keep every plan 0.2 m from the walls. A unit may follow, as in 13x20x8ft. A
    /// ceiling of 7.5 or more without a unit is refused, with a question about the unit
    #[arg(long, value_name = "WxDxH", value_parser = parse_room)]
    pub(super) room: Option<[f64; 3]>,
}

/// Source of the size of a scene's letters.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum LetterSize {
    /// Letters that are as large as the room allows.
    Fitted,
    /// Height that was typed.
    Typed,
    /// Letters of finished plans, which keep their size.
    Kept,
}

/// Levels of the color LED deck without the firmware's brightness correction, which give dim colors
/// twice as many steps.
const LEVELS: ColorLedLevels = ColorLedLevels::Plain;

/// Parses a CSS color. Returns the bytes white, red, green and blue with which the color LED deck
/// shows it, or a message. The transparency of a color is ignored.
fn color(text: &str) -> Result<[u8; 4], String> {
    let wanted = "wanted #rrggbb or a CSS color, such as red, orange or hotpink";
    let color: svgtypes::Color =
        text.parse().map_err(|error: svgtypes::Error| format!("{wanted} ({error})"))?;
    if [color.red, color.green, color.blue] == [0; 3] {
        return Err("a lamp cannot show black: choose another color".to_owned());
    }
    Ok(color_led_wrgb([color.red, color.green, color.blue], LEVELS))
}

impl LetterFlags {
    /// Returns the scene settings that were typed, as keys and values. With a room, the letters are
    /// also given the settings of `size`. A drawing replaces the word and any earlier drawing,
    /// whose digest is cleared.
    pub(super) fn settings(&self, size: LetterSize) -> Vec<Setting> {
        let mut settings = Vec::new();
        let mut set = |key: &str, value: &dyn Display| {
            settings.push((key.to_owned(), value.to_string()));
        };
        self.font.iter().for_each(|font| set("letters.font", font));
        if let Some(file) = &self.drawing {
            set("letters.drawing", file);
            set("letters.drawing_sha256", &"");
            set("word", &"");
        }
        self.ink.iter().for_each(|list| set("letters.ink", list));
        self.without.iter().for_each(|list| set("letters.without", list));
        if !self.fallback.is_empty() {
            set("letters.fallback", &format!("{:?}", self.fallback));
        }
        self.detail.iter().for_each(|detail| set("letters.detail", detail));
        if let Some(Corners(corners_px)) = &self.corners {
            set("letters.corners_px", &format!("{:?}", corners_px.as_flattened()));
        }
        // Only the color LED deck writes in these colors, so it becomes the writing lamp.
        if !self.color.is_empty() {
            set("light.letters_wrgb", &format!("{:?}", self.color));
            set("light.deck", &"color-led");
            set("plan.lights", &"[\"color-led\"]");
            set("light.color_led_levels", &LEVELS.name());
        }
        if let Some(room_m) = self.room {
            set("expose.room_m", &format!("{room_m:?}"));
            let is_typed = size == LetterSize::Typed;
            if size != LetterSize::Kept {
                settings.extend(letters_within(room_m, self.drawing.is_some(), is_typed));
            }
        }
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_is_no_color_of_a_lamp() {
        for black in ["black", "#000", "rgb(0, 0, 0)"] {
            assert!(color(black).is_err_and(|error| error.contains("show black")), "{black}");
        }
        assert!(color("red").is_ok_and(|[_, r, g, b]| r > 4 * g.max(b)), "{:?}", color("red"));
    }
}
