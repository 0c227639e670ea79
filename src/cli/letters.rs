//! Flags of the letters: font or drawing, colors, and the room that they are fitted to.

use std::fmt::Display;

use super::{Args, Corners, Setting, numbers};
use crate::light::{ColorLedLevels, color_led_wrgb};
use crate::preflight::Profile;

/// The word as it is drawn.
#[derive(Debug, Args)]
pub(super) struct LetterFlags {
    /// Font of a word: ae483, ae483-fixed, simplex, or a file *.strokes, *.ttf or *.otf
    #[arg(long, value_name = "NAME|FILE")]
    font: Option<String>,
    /// Fonts of the letters that the font lacks, such as a typeface of another script: the first
    /// that has one
    #[arg(long, value_name = "NAME|FILE,...", value_delimiter = ',')]
    fallback: Vec<String>,
    /// Drawing instead of a word: *.svg, a picture *.png, *.jpg, *.webp, *.gif or *.bmp (lines on
    /// paper, a logo), or handwriting as *.json; the color LED deck and the ring write in its
    /// colors
    #[arg(long, value_name = "FILE")]
    drawing: Option<String>,
    /// Detail of a drawing, from 0 (a sketch of the longest strokes) to 1 (every stroke) [default:
    /// 1]
    #[arg(long, value_name = "0..1")]
    detail: Option<f64>,
    /// Colors and numbers of the strokes of a drawing that are drawn, such as red or 2,5-7; `plan
    /// -o x.svg` shows the numbers [default: all]
    #[arg(long, value_name = "COLOR|N,...")]
    ink: Option<String>,
    /// Strokes of a drawing that are left out, in the same way [default: none]
    #[arg(long, value_name = "COLOR|N,...")]
    without: Option<String>,
    /// Corners of the sheet of paper in a picture, in its pixels: "X,Y X,Y X,Y X,Y", clockwise
    /// from the upper left; it is cut out and seen square on [default: those of a sheet that is
    /// seen as a whole]
    #[arg(long, value_name = "CORNERS", requires = "drawing")]
    corners: Option<Corners>,
    /// Colors of the letters in turn, as #rrggbb or names of CSS: the color LED deck writes (the
    /// ring writes in colors that the scene names)
    #[arg(long, value_name = "COLOR,...", value_delimiter = ',', value_parser = color)]
    color: Vec<[u8; 4]>,
    /// Width, depth and height of the room in meters, such as 4x3x2.5, its middle at x = y = 0: a
    /// word is as large as it allows, half a meter from the walls, 0.7 m below the ceiling, within
    /// the 4 m that two Lighthouse stations serve, and shown whole by a camera that stands in the
    /// room; stations hang in its corners where no scene places them, and safety checks keep any
    /// plan 0.2 m from its walls
    #[arg(long, value_name = "WxDxH", value_parser = room)]
    pub(super) room: Option<[f64; 3]>,
}

/// Without the firmware's correction of brightness, dim colors have twice as many steps.
const LEVELS: ColorLedLevels = ColorLedLevels::Plain;

/// A color as CSS writes it, as the bytes of the color LED deck that show it.
fn color(text: &str) -> Result<[u8; 4], String> {
    let wanted = "wanted #rrggbb or a color of CSS, such as red, orange or hotpink";
    let color: svgtypes::Color =
        text.parse().map_err(|error: svgtypes::Error| format!("{wanted} ({error})"))?;
    if [color.red, color.green, color.blue] == [0; 3] {
        return Err("black is no light: name the color that the lamp shall shine in".to_owned());
    }
    Ok(color_led_wrgb([color.red, color.green, color.blue], LEVELS))
}

/// Least distance of the word from the sides of the volume that a drone may fly in, and from its
/// top: a base station 0.1 m higher then sees the word's top from as far as it reaches, 6 m.
const FROM_SIDES_M: f64 = 0.3;
const FROM_TOP_M: f64 = 0.5;

/// Width that two base stations serve (Bitcraze, "Getting started with the Lighthouse system":
/// about 4 m by 4 m).
const SERVED_M: f64 = 4.0;

/// Least and greatest room, m: a flight with its margins; a sports hall (three playing fields are
/// 27 m by 45 m, DIN 18032), with room to spare.
const LEAST_ROOM_M: [f64; 3] = [1.5, 1.5, 1.0];
const GREATEST_ROOM_M: [f64; 3] = [60.0, 60.0, 20.0];

/// Units that sizes of rooms are typed in by mistake, per meter.
const OTHER_UNITS: [(&str, f64); 3] =
    [("centimeters", 100.0), ("millimeters", 1000.0), ("inches", 39.37)];

fn room(text: &str) -> Result<[f64; 3], String> {
    let in_words = |room_m: [f64; 3]| room_m.map(|m| format!("{m}")).join("x");
    let wanted = format!(
        "wanted WIDTHxDEPTHxHEIGHT in meters, from {} to {}, such as 4x3x2.5",
        in_words(LEAST_ROOM_M),
        in_words(GREATEST_ROOM_M)
    );
    let Some(sides) = numbers::<3>(text, &['x', 'X', '×']) else { return Err(wanted) };
    let fits = |sides: [f64; 3]| {
        (0..3).all(|side| (LEAST_ROOM_M[side]..=GREATEST_ROOM_M[side]).contains(&sides[side]))
    };
    if fits(sides) {
        return Ok(sides);
    }
    let meant = OTHER_UNITS.into_iter().map(|(unit, per_m)| (unit, sides.map(|m| m / per_m)));
    Err(match meant.into_iter().find(|(_, room_m)| fits(*room_m)) {
        Some((unit, room_m)) => {
            let room_m = in_words(room_m.map(|m| (100.0 * m).round() / 100.0));
            format!("is this in {unit}, a room of {room_m} m? {wanted}")
        }
        None => wanted,
    })
}

impl LetterFlags {
    /// The keys of the scene that were typed. A room does not change letters that are planned.
    pub(super) fn settings(&self, is_planned: bool) -> Vec<Setting> {
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
        if !self.color.is_empty() {
            set("light.letters_wrgb", &format!("{:?}", self.color));
            set("light.deck", &"color-led");
            set("plan.lights", &"[\"color-led\"]");
            set("light.color_led_levels", &LEVELS.name());
        }
        if let Some(room_m) = self.room {
            set("expose.room_m", &format!("{room_m:?}"));
        }
        if let Some(room_m) = self.room.filter(|_| !is_planned) {
            let [low, high] = Profile::indoor().in_room(room_m).volume_m;
            let wide_m = (high[0] - low[0] - 2.0 * FROM_SIDES_M).min(SERVED_M);
            // A low room has the word nearer to its floor.
            let baseline_m = (0.25 * room_m[2]).min(0.5);
            let high_m = high[2] - FROM_TOP_M - baseline_m;
            set("letters.canvas_m", &format!("[{wide_m}, {high_m}]"));
            set("letters.baseline_m", &baseline_m);
            set("letters.align", &"center");
            // A drawing fills its canvas as it is.
            if self.drawing.is_none() {
                set("letters.fit", &"fill");
            }
        }
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_in_another_unit_is_asked_about_and_halls_are_bounded() {
        assert_eq!(room("4x3x2.5"), Ok([4.0, 3.0, 2.5]));
        assert_eq!(room("20 X 20 × 8"), Ok([20.0, 20.0, 8.0]));
        for (typed, question) in [
            ("400x300x250", "is this in centimeters, a room of 4x3x2.5 m?"),
            ("4000x3000x2500", "is this in millimeters, a room of 4x3x2.5 m?"),
            ("100x30x8", "wanted WIDTHxDEPTHxHEIGHT in meters, from 1.5x1.5x1 to 60x60x20"),
            ("1x3x2.5", "wanted"),
            ("4x3", "wanted"),
            ("nanx3x2", "wanted"),
        ] {
            let error = room(typed).unwrap_err();
            assert!(error.starts_with(question), "{typed}: {error}");
        }
    }

    #[test]
    fn black_is_no_color_of_a_lamp() {
        for black in ["black", "#000", "rgb(0, 0, 0)"] {
            assert!(color(black).is_err_and(|error| error.contains("no light")), "{black}");
        }
        assert!(color("red").is_ok_and(|[_, r, g, b]| r > g && g == b), "{:?}", color("red"));
    }
}
