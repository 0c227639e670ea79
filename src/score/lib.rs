//! Score turns a photo into a verdict on whether its word is read at first sight.
//!
//! Input: a [`Photo`], the [`Strokes`] of the expected word, and the [`View`] of the camera.
//! Output: a [`Verdict`] from a [`Reader`].
//!
//! 1. The photo's linear light is resampled into the plane of the word. The word is located near
//!    its expected position, and each of its lines is cut out as a strip of fixed height.
//! 2. A small convolutional net with integer weights gives the probabilities of all characters
//!    along the strip. The net was trained on drawn and simulated words of random letters
//!    (`examples/readings`).
//! 3. These probabilities determine the probability of each letter, the likeliest other word, and
//!    the readability, which is calibrated on human readers (docs/calibration.md).
//! 4. The light is compared with the intended strokes to find the faithfulness, causes and advice.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use noctograph_core::error::{Error, Result, within};
use noctograph_core::photo::{Photo, PhotoData};
use noctograph_core::settings::settings;
use noctograph_core::strokes::Strokes;

use alphabet::{classes_of, is_foreign};

pub use calibration::{CALIBRATION, Calibration};
pub use causes::{Advice, Cause, CauseKind, Known, LogGap, MissingRun};
pub use explain::Marks;
pub use find_word::find_word;
pub use reader::Reader;
pub use reading::{ReadLetter, Reading, read};
pub use turn::{has_bright_edge, mirrored, quarter_turned, read_any_way_up, read_mirrored};
pub use verdict::{LetterVerdict, Placement, Reason, Rival, RivalWord, Verdict};
pub use view::{Homography, View};

mod align;
mod alphabet;
mod bend;
mod calibration;
mod causes;
mod color;
mod explain;
mod faults;
mod find_word;
mod judge;
mod lattice;
mod light;
mod line;
mod net;
mod plane;
mod raster;
mod reader;
mod reading;
mod search;
mod sketch;
mod spelling;
mod strip;
mod trace;
mod turn;
mod verdict;
mod view;

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "pixels and codes of test photos")]
mod tests;

/// Resolution at which strokes and light are compared, in pixels per cap height.
const PX_PER_H: u8 = 32;

/// Width of the pen that draws strokes for the comparison, in cap heights.
const PEN_H: f64 = 0.07;

/// Blur of photo and drawing for the comparison, in cap heights.
const BLUR_H: f32 = 0.05;

/// Maximum shift of the word from its expected position, in cap heights.
const MAX_SHIFT_H: f64 = 0.6;

/// Minimum and maximum scale of the word, relative to the intended size.
const SCALES: [f64; 2] = [0.85, 1.17];

/// Maximum rotation of the word in either direction: 8 degrees.
const MAX_ROTATION_RAD: f64 = 8.0 * core::f64::consts::PI / 180.0;

/// Cap height in the photo, in pixels, below which the reason is [`Reason::TooSmall`].
const MIN_CAP_HEIGHT_PX: f64 = 20.0;

/// Minimum and maximum ratio of cell width to cap height. In the team's font the ratio is 0.6.
const ASPECTS: [f64; 2] = [0.05, 5.0];

/// Maximum length of a word, in cap heights. 256 letters of the team's font, with spaces, need 400.
const MAX_LENGTH_H: f64 = 1000.0;

settings! {
    /// Options that determine when a word counts as read.
    pub struct ScoreOptions {
        /// Minimum readability of a legible word.
        legible_probability: f64 = 0.7, in 0.0..=1.0;
    }
}

/// True if strokes can be judged: they contain letters or digits, and the reader knows these.
pub fn is_judged(strokes: &Strokes) -> bool {
    let mut characters = strokes.glyphs.iter().map(|glyph| glyph.character);
    strokes.font.is_some()
        && !characters.clone().any(is_foreign)
        && characters.any(|character| classes_of(character).is_some())
}

/// Returns [`Error::Input`] unless the reader knows each of the word's letters and each one leaves
/// light.
fn check(strokes: &Strokes) -> Result<()> {
    let hint = "write the word with Latin letters and digits, or judge the photo by eye";
    if strokes.glyphs.is_empty() {
        return Err(Error::input("word", "an empty word", "at least one letter", hint));
    }
    if strokes.font.is_none() {
        let hint = "judge the photo by eye, because only words can be read";
        return Err(Error::input("word", "a drawing", "a word", hint));
    }
    let refuse = |index: usize, wanted: &str| {
        let character = strokes.glyphs[index].character;
        let place = format!("word, letter {}", index + 1);
        Err(Error::input(place, format!("{character:?}"), wanted, hint))
    };
    // Checks each letter by itself, and then the word as a whole.
    for (index, glyph) in strokes.glyphs.iter().enumerate() {
        if is_foreign(glyph.character) {
            return refuse(index, "a letter or digit that the reader knows: Latin letters, 0-9");
        }
        if !glyph.moves.iter().any(|step| step.lit) {
            return refuse(index, "a character with at least one lit stroke");
        }
        let aspect = glyph.cell.width_m / glyph.cell.cap_height_m;
        within("width of a letter divided by its height", aspect, ASPECTS[0], ASPECTS[1])?;
    }
    if strokes.glyphs.iter().all(|glyph| classes_of(glyph.character).is_none()) {
        return refuse(0, "at least one letter or digit, since punctuation is not judged");
    }
    let [left, _, right, _] = strokes.bounds_m();
    let length = (right - left) / cap_height_m(strokes);
    within("length of the word divided by its height", length, 0.0, MAX_LENGTH_H)
}

/// Returns [`Error::Input`] if a photo's size differs from that of the view's camera.
fn check_size(photo: &Photo, view: &View) -> Result<()> {
    let PhotoData { width_px, height_px, .. } = **photo;
    let [width, height] = view.size_px();
    if [width_px, height_px] != [width, height] {
        let hint = "name the scene that the photo was taken with";
        let wanted = format!("{width} x {height} pixels, the size of the camera's photos");
        let size = format!("{width_px} x {height_px} pixels");
        return Err(Error::input("photo", size, wanted, hint));
    }
    Ok(())
}

/// Returns the cap height of a word's first letter.
fn cap_height_m(strokes: &Strokes) -> f64 {
    strokes.glyphs[0].cell.cap_height_m
}
