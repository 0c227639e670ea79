//! Score: a photo is read letter by letter.
//!
//! Product in: a [`Photo`], the [`Strokes`] of the word that it should show, and the [`Camera`]
//! that took it. Product out: a [`Verdict`].
//!
//! The photo's linear light is resampled into the plane of the word and the word is looked for
//! around its place. Then each letter's cell, blurred as the eye does, is compared with every
//! letter and digit standing in that place between the intended neighbours, in the flown font and
//! in a typeface, over small shifts and scales; and with what is no letter, the true one less a
//! stroke and a blot. How much better the true letter fits than its rivals, against the same for a
//! faultless drawing, gives the probability that the word is read; its worst letter decides.
//!
//! Sources: Loomis 1990 (low-pass, template match, choice); constants marked *study* were chosen on
//! 460 synthetic photos that an OCR program read. Not modelled: context (no dictionary). Score
//! knows no plan, no flight and no light.

use crate::camera::Camera;
use crate::error::{Error, Result, within};
use crate::letters::{Glyph, Strokes};
use crate::photo::Photo;
use crate::settings::{Described, settings};

pub use calibration::{CALIBRATION, Calibration};
pub use causes::{Advice, Cause, CauseKind, Known, MissingRun};
pub use locate::locate;
pub use overlay::Marks;
pub use reader::Reader;
pub use spell::{ReadLetter, Reading, read};
pub use verdict::{LetterVerdict, Placement, Reason, Rival, Verdict};
pub use view::{Homography, View};

mod align;
mod bank;
mod bend;
mod calibration;
mod causes;
mod color;
mod explain;
mod grid;
mod ink;
mod level;
mod light;
mod line;
mod locate;
mod matching;
mod overlay;
mod partial;
mod plane;
mod raster;
mod reader;
mod spell;
mod trace;
mod typeface;
mod verdict;
mod view;
mod window;

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "pixels and codes of test photos")]
mod tests;

/// Resolution at which letters are read: pixels to a cap height (study).
const PX_PER_H: u8 = 32;

/// Width of the pen that references are drawn with: 0.07 H (study).
const PEN_PX: f32 = 0.07 * 32.0;

/// Blur of photo and references: 0.05 H (study). Less makes a reader of wanderings of
/// the stroke, more makes O of Q.
const BLUR_PX: f32 = 0.05 * 32.0;

/// Largest shift of the word that still counts as its place, in cap heights (study).
const MAX_SHIFT_H: f64 = 0.6;

/// Smallest and largest scale of the word that count as its own (study): a small O must
/// not become something else.
const SCALES: [f64; 2] = [0.85, 1.17];

/// Largest rotation of the word, either way: 8 degrees (study).
const MAX_ROTATION_RAD: f64 = 8.0 * core::f64::consts::PI / 180.0;

/// Cap height in the photo, in pixels, below which few pixels are what makes a word illegible
/// (study; programs read words of 12, see docs/calibration.md).
const MIN_CAP_HEIGHT_PX: f64 = 20.0;

/// Blurred light in a cell, of full light, below which the letter counts as missing. The middle of a
/// faultless stroke has 0.5; a tenth of it is what noise and a neighbour's glow leave.
const FAINT: f32 = 0.05;

/// Cells that can be read: width by cap height. The team's are 0.6 wide.
const ASPECTS: [f64; 2] = [0.05, 5.0];

/// Longest word, in cap heights: 256 of the team's letters with as much space again are 400. The
/// alignment's rasters grow with it.
const MAX_LENGTH_H: f64 = 1000.0;

settings! {
    /// Reading of a photo.
    pub struct ScoreOptions {
        /// Letterforms that a photo's letters are compared with.
        references: References = References::Both;
        /// Probability of being read from which a word counts as legible.
        ///
        /// At 0.7, 85 of 100 synthetic photos were read by a strict reader.
        legible_probability: f64 = 0.7, in 0.0..=1.0;
    }

    /// Letterforms that a photo's letters are compared with.
    pub enum References {
        /// Both, whichever fits better.
        "both" => Both,
        /// The font that the word is flown with: a reader who knows its shapes.
        "flown" => Flown,
        /// Roboto Thin: a reader who does not know the font.
        "typeface" => Typeface,
    }
}

/// Reads a photo: prepares a [`Reader`] and uses it once.
///
/// # Errors
///
/// As [`Reader::new`] and [`Reader::score`].
///
/// # Panics
///
/// If the photo has not three bytes a pixel.
pub fn score(
    photo: &Photo,
    strokes: &Strokes,
    camera: &Camera,
    options: &ScoreOptions,
) -> Result<Verdict> {
    Reader::new(strokes, options)?.score(photo, &camera.into())
}

impl ScoreOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "score", None)
    }
}

fn check(strokes: &Strokes) -> Result<()> {
    let hint = "write the word with letters and digits that the font has";
    if strokes.glyphs.is_empty() {
        return Err(Error::input("word", "an empty word", "at least one letter", hint));
    }
    let Some(font) = &strokes.font else {
        let hint = "look at the photo: only words are read";
        return Err(Error::input("word", "a drawing", "a word", hint));
    };
    let typeface = typeface::Typeface::load();
    for (index, glyph) in strokes.glyphs.iter().enumerate() {
        let character = glyph.character;
        if lettering(glyph)
            && (font.glyph(character, glyph.cell).is_some()
                || typeface.outline(character, 1.0).is_some())
        {
            let aspect = glyph.cell.width_m / glyph.cell.cap_height_m;
            within("width of a letter by its height", aspect, ASPECTS[0], ASPECTS[1])?;
            continue;
        }
        return Err(Error::input(
            format!("word, position {}", index + 1),
            format!("{character:?}"),
            "a character that leaves light and that the reader knows",
            hint,
        ));
    }
    let [left, _, right, _] = strokes.bounds_m();
    let length = (right - left) / cap_height_m(strokes);
    within("length of the word by its height", length, 0.0, MAX_LENGTH_H)
}

fn check_size(photo: &Photo, view: &View) -> Result<()> {
    let [found, wanted] = [[photo.width_px, photo.height_px], view.size_px()];
    if found != wanted {
        return Err(Error::input(
            "photo",
            format!("{} x {} pixels", found[0], found[1]),
            format!("{} x {} pixels, as the camera has", wanted[0], wanted[1]),
            "name the scene that the photo was taken with",
        ));
    }
    let bytes = 3 * photo.width_px as usize * photo.height_px as usize;
    assert_eq!(photo.rgb8.len(), bytes, "three bytes a pixel");
    Ok(())
}

fn cap_height_m(strokes: &Strokes) -> f64 {
    strokes.glyphs[0].cell.cap_height_m
}

/// Whether a glyph leaves light.
fn lettering(glyph: &Glyph) -> bool {
    glyph.moves.iter().any(|step| step.lit)
}
