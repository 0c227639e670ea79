//! The verdict on a photo: the content of `verdict.json`.

use serde::{Deserialize, Serialize};

use super::alphabet::spells;
use super::calibration::{CALIBRATION, Calibration};
use super::causes::{Advice, Cause};
use super::plane::Placed;
use super::{MAX_ROTATION_RAD, SCALES};
use noctograph_core::strokes::Strokes;

/// Legibility of the word in a photo, with reasons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The expected word.
    pub word: String,
    /// The likeliest letter for each expected one, or `?` for no letter. Punctuation is copied.
    pub read: String,
    /// True if no other word is likelier and the readability reaches
    /// [`super::ScoreOptions::legible_probability`].
    pub legible: bool,
    /// Probability that a viewer reads the word at first sight, 0 to 1.
    pub readability: f64,
    /// The likeliest other word, or `None` if nothing is visible.
    pub rival: Option<RivalWord>,
    /// Agreement of the light with the intended strokes, 0 to 1: the harmonic mean of the fraction
    /// of strokes with light and the fraction of light near strokes. The value is `None` if it was
    /// not computed.
    pub faithfulness: Option<f64>,
    /// The regression from which the readability was computed.
    pub calibration: Calibration,
    /// Placement of the word, or `None` if the photo does not show the word's light.
    pub placement: Option<Placement>,
    /// Height of a capital in the photo in pixels, or `None` if the word is outside the photo.
    pub cap_height_px: Option<f64>,
    /// The verdict on each letter, in the order of the word.
    pub letters: Vec<LetterVerdict>,
    /// The reason why the word is not legible, or `None` if it is.
    pub reason: Option<Reason>,
    /// The text that blind recognition reads in the photo, or `None` if nothing is visible.
    pub second_opinion: Option<String>,
    /// Faults, in order of decreasing gain. The list is empty if faults were not computed.
    pub causes: Vec<Cause>,
    /// Advice on at most three changes, in order of decreasing gain. Empty if not computed.
    pub advice: Vec<Advice>,
}

/// Another word that a photo may be read as.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RivalWord {
    /// The word.
    pub word: String,
    /// Probability, 0 to 1, that a viewer who must choose prefers this word to the expected one.
    pub p: f64,
}

/// Placement of the word relative to the intended one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Placement {
    /// Shift in the plane of the word: x to the right and y upward.
    pub shift_m: [f64; 2],
    /// Ratio of the size to the intended size.
    pub scale: f64,
    /// Counterclockwise rotation about the center of the word.
    pub rotation_rad: f64,
}

/// The verdict on one letter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LetterVerdict {
    /// The expected letter.
    pub expected: char,
    /// The likeliest letter, or `None` if it is likelier that no letter is there.
    pub best: Option<char>,
    /// Probability of the expected letter among all letters, 0 to 1, if the other letters of the
    /// word are right. `None` for punctuation, which is not judged.
    pub p: Option<f64>,
    /// Probability that no letter is there, 0 to 1. `None` for punctuation.
    pub no_letter: Option<f64>,
    /// The three likeliest other letters, in descending order of probability.
    #[serde(default)]
    pub rivals: Vec<Rival>,
    /// Offset of the letter from its position in the word (right, up). This field and the next four
    /// are `None` if they were not computed.
    pub shift_m: Option<[f64; 2]>,
    /// Fraction of the moved intended strokes that have light within 0.1 cap heights.
    pub recall: Option<f64>,
    /// Fraction of the lines of light that is within 0.1 cap heights of an intended stroke.
    pub precision: Option<f64>,
    /// Length of the intended strokes that have no light.
    pub missing_mm: Option<f64>,
    /// Length of the lines of light that are away from the intended strokes.
    pub stray_mm: Option<f64>,
    /// Probabilities of all letters that have a probability of at least 0.001, in descending order.
    #[serde(default)]
    pub confusion: Vec<Rival>,
}

/// Another letter that this one resembles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// The letter.
    pub letter: char,
    /// Probability of this letter among all letters, 0 to 1.
    pub p: f64,
}

/// The reason why a word is not legible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The expected position of the word is outside the photo.
    NotInPhoto,
    /// Nothing at the expected position of the word is brighter than the sky.
    NoLight,
    /// Capitals are less than 20 pixels high in the photo.
    TooSmall,
    /// The word is more than 0.6 cap heights from its expected position, more than a sixth larger
    /// or smaller than intended, or turned by more than 8 degrees.
    OutOfRange,
    /// The photo shows a word of another length.
    OtherLength,
    /// Another word is likelier, or a letter looks like another letter or like no letter at all.
    Misread,
    /// Every expected letter is the likeliest one, but the readability is too low.
    Unsure,
}

impl Verdict {
    /// Returns the probability that a viewer reads this word and no other: the readability, limited
    /// by the probability against a likelier rival. Studies use it to rank and tune.
    pub fn read_probability(&self) -> f64 {
        let likelier = self.rival.as_ref().filter(|rival| rival.p > 0.5);
        likelier.map_or(self.readability, |rival| self.readability.min(1.0 - rival.p))
    }

    /// Makes the word illegible, regardless of its letters.
    pub fn refuse(&mut self, reason: Reason) {
        (self.legible, self.readability, self.reason) = (false, 0.0, Some(reason));
    }

    /// True if blind recognition reads a different text. Characters that look alike count as equal.
    pub fn is_contradicted(&self) -> bool {
        self.second_opinion.as_deref().is_some_and(|read| !spells(read, &self.word))
    }

    /// Returns the verdict on a photo that does not show the word's light. `cap_height_px` is the
    /// height of a capital in the photo, if the camera sees the word.
    pub(super) fn unseen(
        strokes: &Strokes,
        reason: Option<Reason>,
        cap_height_px: Option<f64>,
    ) -> Self {
        let characters = strokes.glyphs.iter().map(|glyph| glyph.character);
        Self {
            word: strokes.word.clone(),
            read: "?".repeat(strokes.glyphs.len()),
            legible: false,
            readability: 0.0,
            rival: None,
            faithfulness: None,
            calibration: CALIBRATION,
            placement: None,
            cap_height_px,
            letters: characters.map(LetterVerdict::unseen).collect(),
            reason,
            second_opinion: None,
            causes: Vec::new(),
            advice: Vec::new(),
        }
    }
}

impl From<&Placed> for Placement {
    fn from(&Placed { shift_m, scale, rotation_rad, .. }: &Placed) -> Self {
        Self { shift_m: [shift_m.x, shift_m.y], scale, rotation_rad }
    }
}

impl Placement {
    /// True if the word is within `reach_m` of its position, and scale and rotation are in range.
    pub(super) fn is_in_range(&self, reach_m: f64) -> bool {
        libm::hypot(self.shift_m[0], self.shift_m[1]) <= reach_m
            && (SCALES[0]..=SCALES[1]).contains(&self.scale)
            && self.rotation_rad.abs() <= MAX_ROTATION_RAD
    }
}

impl LetterVerdict {
    /// Returns the verdict on punctuation, which is never judged and counts as read.
    pub(super) fn not_judged(expected: char) -> Self {
        Self { expected, best: Some(expected), ..Self::default() }
    }

    /// Returns the verdict on a letter without light.
    pub(super) fn unseen(expected: char) -> Self {
        Self { expected, p: Some(0.0), no_letter: Some(0.0), ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_letters::{LetterOptions, write};

    #[test]
    fn a_likelier_rival_caps_the_probability_of_being_read_by_the_words_share() {
        let strokes = write("PARIS", &LetterOptions::default()).unwrap();
        let unseen = Verdict::unseen(&strokes, None, None);
        for (readability, rival, wanted, case) in [
            (0.84, None, 0.84, "nothing else to read"),
            (0.84, Some(0.3), 0.84, "the rival is less likely"),
            (0.84, Some(0.5), 0.84, "as likely"),
            (0.84, Some(0.75), 0.25, "one in four reads the word"),
            (0.1, Some(0.75), 0.1, "the readability is lower yet"),
        ] {
            let rival = rival.map(|p| RivalWord { word: "ARIS".into(), p });
            let verdict = Verdict { readability, rival, ..unseen.clone() };
            assert_eq!(verdict.read_probability(), wanted, "{case}");
        }
    }
}
