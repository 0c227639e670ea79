//! What turns similarities into probabilities: the few fitted numbers of the reader, each with its
//! origin.

use serde::Serialize;

use super::matching::Match;

/// Sharpness of the choice between letters (study; from 20 to 50 it makes no
/// difference to the ranking). Too much calls every near miss misread, too little forgives all.
const SHARPNESS: f64 = 30.0;

/// Offset and slope that turn the worst letter's loss into a probability. The strict reader of
/// The study (340 synthetic photos, an OCR program) had 2.46 and 2.00. Held against 449 photos
/// of ours (docs/calibration.md), two programs out of three have a slope of 2.19. The pair here lies
/// where both ends are known: every clean preview of 60 words and 36 characters in two fonts, all of
/// which eyes read, has 0.9 and more (a simplex I the least), and every letter that lacks a fifth of
/// its ink less than 0.3 (an R without its leg the most).
const PLATT: [f64; 2] = [2.86, 2.24];

/// ln p of a faultless drawing below which its own confusability is no excuse: a letter that is read
/// every other time at best is not made legible by drawing it well.
const LEAST_EXCUSED: f64 = -core::f64::consts::LN_2;

/// Similarity below which a picture shows no letter, whichever it resembles most. Of words that
/// wandered by 0.02 to 0.2 H those with P of 0.5 and more had letters of 0.7 and more, scribbles and
/// filled boxes have 0.2 to 0.8 (measured here): this refuses only what is no writing at all.
pub(super) const MIN_SIMILARITY: f32 = 0.5;

/// How the probability of a verdict was made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Whose reading it predicts.
    pub reader: &'static str,
    /// `probability = 1 / (1 + exp(−(offset − slope · loss)))`.
    pub offset: f64,
    /// What one unit of loss, ln p of the worst letter below its faultless drawing's, costs.
    pub slope: f64,
}

/// The calibration that verdicts are made with.
pub const CALIBRATION: Calibration =
    Calibration { reader: "strict", offset: PLATT[0], slope: PLATT[1] };

/// Probability that a strict reader reads the word, from the largest loss of its letters.
pub(super) fn probability(worst_loss: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-(PLATT[0] - PLATT[1] * worst_loss)))
}

/// By how much ln p of a letter lies below that of its faultless drawing.
pub(super) fn loss(matches: &[Match], class: usize, ln_faultless: f64) -> f64 {
    if matches[class].similarity < MIN_SIMILARITY {
        return f64::INFINITY;
    }
    ln_faultless.max(LEAST_EXCUSED) - ln_share(matches, class)
}

/// Logarithm of a class's share in the choice (Luce's rule, as in Loomis 1990).
pub(super) fn ln_share(matches: &[Match], class: usize) -> f64 {
    let score = |found: &Match| SHARPNESS * f64::from(found.similarity);
    let best = matches.iter().map(score).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = matches.iter().map(|found| libm::exp(score(found) - best)).sum();
    score(&matches[class]) - best - libm::log(sum)
}
