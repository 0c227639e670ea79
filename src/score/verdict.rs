//! The verdict: what was read, how surely, and where the word hangs. `verdict.json` is this, with the
//! flight's digest.

use serde::Serialize;

use super::calibration::{CALIBRATION, Calibration};
use super::causes::{Advice, Cause};

/// Whether a photo's word is legible, and why not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The word that should be there.
    pub word: String,
    /// What is there, letter by letter: the best match, `?` where there is no light or no
    /// letter, such as one that lacks a stroke.
    pub read: String,
    /// Whether it reads: every letter is the best match of its cell, and the probability reaches
    /// [`super::ScoreOptions::legible_probability`].
    pub legible: bool,
    /// Probability that the reader of `calibration` reads the word, 0 to 1.
    pub probability: f64,
    /// How the probability was made.
    pub calibration: Calibration,
    /// Where the word hangs; `None` where there is no light.
    pub placement: Option<Placement>,
    /// Height of a capital in the photo, pixels; `None` where the photo does not show the place.
    pub cap_height_px: Option<f64>,
    /// One for each letter of the word, in its order.
    pub letters: Vec<LetterVerdict>,
    /// Why the word is not legible; `None` where it is.
    pub reason: Option<Reason>,
    /// What is read where nobody says what should be there; `None` where it was not asked for.
    pub second_opinion: Option<String>,
    /// What is wrong, the most costly first; empty where it was not asked for.
    pub causes: Vec<Cause>,
    /// What to do, the most gainful first; empty where it was not asked for.
    pub advice: Vec<Advice>,
}

/// Where the word hangs, against where it was intended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Placement {
    /// To the right and up, in the plane of the word.
    pub shift_m: [f64; 2],
    /// Size by intended size, about the middle of the word.
    pub scale: f64,
    /// Anticlockwise, about the middle of the word.
    pub rotation_rad: f64,
}

/// What is seen in the place of one letter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LetterVerdict {
    /// The letter that should be there.
    pub expected: char,
    /// The letter that fits best; `None` where there is no light, or where the expected letter less
    /// a stroke, or a blot, fits better than any.
    pub best: Option<char>,
    /// The letter that fits second best.
    pub runner_up: Option<char>,
    /// Similarity of the best less that of the runner-up, 0 to 2.
    pub margin: f64,
    /// Similarity of the expected letter: correlation less what shift and stretch cost, up to 1.
    pub similarity: f64,
    /// Share of the expected letter in the choice among all, 0 to 1.
    pub p: f64,
    /// Share of what is no letter: the expected one less a stroke, or a blot, 0 to 1.
    pub no_letter: f64,
    /// The three likeliest other letters, the likeliest first: it looks like them.
    pub rivals: Vec<Rival>,
    /// Where the letter stands against its place in the word, to the right and up.
    pub shift_m: [f64; 2],
    /// Width and height by the intended ones: the nearest of the scales that are tried.
    pub scale: [f64; 2],
    /// Share of the intended strokes that has light within 0.1 cap heights, the letter put where
    /// it was found; this and the next four are left out where they were not asked for.
    pub recall: Option<f64>,
    /// Share of the light's lines that is within 0.1 cap heights of an intended stroke.
    pub precision: Option<f64>,
    /// Length of the intended strokes without light.
    pub missing_mm: Option<f64>,
    /// Length of the light's lines away from the intended strokes.
    pub stray_mm: Option<f64>,
    /// Shares of all letters in the choice, the likeliest first, down to a thousandth.
    pub confusion: Vec<Rival>,
}

/// Another letter that a place resembles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rival {
    /// The letter.
    pub letter: char,
    /// Its share in the choice among all, 0 to 1.
    pub p: f64,
}

/// Why a word is not legible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The place of the word is not in the photo.
    NotInPhoto,
    /// Nothing in the place of the word is brighter than the sky.
    NoLight,
    /// A letter is misread, and capitals are less than 20 pixels high in the photo.
    TooSmall,
    /// The word hangs farther than 0.6 cap heights from its place, or is larger or smaller than
    /// intended by more than a sixth, or turned by more than 8 degrees.
    OutOfRange,
    /// A letter looks like another one, like nothing, or too much like both.
    Misread,
}

impl Verdict {
    /// A word of which nothing can be seen.
    pub(super) fn unseen(word: &str, reason: Reason, cap_height_px: Option<f64>) -> Self {
        let letters: Vec<_> = word.chars().map(LetterVerdict::unseen).collect();
        Self {
            word: word.to_owned(),
            read: "?".repeat(letters.len()),
            legible: false,
            probability: 0.0,
            calibration: CALIBRATION,
            placement: None,
            cap_height_px,
            letters,
            reason: Some(reason),
            second_opinion: None,
            causes: Vec::new(),
            advice: Vec::new(),
        }
    }
}

impl LetterVerdict {
    /// A letter without light.
    pub(super) fn unseen(expected: char) -> Self {
        Self {
            expected,
            best: None,
            runner_up: None,
            margin: 0.0,
            similarity: 0.0,
            p: 0.0,
            no_letter: 0.0,
            rivals: Vec::new(),
            shift_m: [0.0; 2],
            scale: [1.0; 2],
            recall: None,
            precision: None,
            missing_mm: None,
            stray_mm: None,
            confusion: Vec::new(),
        }
    }
}
