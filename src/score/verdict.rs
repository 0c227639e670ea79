//! From similarities to a verdict: which letter is seen, how surely, and whether the word reads.

use super::LetterVerdict;
use super::bank::{CLASSES, class_of};
use super::reader::Similarities;

/// Sharpness of the choice between letters (legibility.md 4.2 and 6.2; from 20 to 50 it makes no
/// difference to the ranking). Too much calls every near miss misread, too little forgives all.
const SHARPNESS: f64 = 30.0;

/// Offset and slope that turn the worst letter's loss into a probability: the strict reader of
/// legibility.md 6.2, fitted there on 340 synthetic photos read by an OCR program. People read more.
const PLATT: [f64; 2] = [2.46, 2.00];

/// ln p of a faultless drawing below which its own confusability is no excuse: a letter that is read
/// every other time at best is not made legible by drawing it well.
const LEAST_EXCUSED: f64 = -core::f64::consts::LN_2;

/// Similarity below which a picture shows no letter, whichever it resembles most. Of words that
/// wandered by 0.02 to 0.2 H those with P of 0.5 and more had letters of 0.7 and more, scribbles and
/// filled boxes have 0.2 to 0.8 (measured here): this refuses only what is no writing at all.
const MIN_SIMILARITY: f32 = 0.5;

/// Judges a letter from the similarities of its photo and of its faultless drawing. Beside the
/// verdict stands the loss: by how much ln p lies below that of the faultless drawing.
pub(super) fn judge(
    expected: char,
    photo: &Similarities,
    faultless: &Similarities,
) -> (LetterVerdict, f64) {
    let class = class_of(expected);
    let mut order: [usize; CLASSES.len()] = std::array::from_fn(|index| index);
    order.sort_by(|a, b| photo[*b].total_cmp(&photo[*a]));
    // O is called 0, and I is called 1, where that is what is meant.
    let name = |index: usize| if index == class { expected } else { CLASSES[index] };
    let ln_p = ln_share(photo, class);
    let verdict = LetterVerdict {
        expected,
        best: Some(name(order[0])),
        runner_up: Some(name(order[1])),
        margin: f64::from(photo[order[0]] - photo[order[1]]),
        similarity: f64::from(photo[class]),
        p: libm::exp(ln_p),
    };
    if photo[class] < MIN_SIMILARITY {
        return (verdict, f64::INFINITY);
    }
    (verdict, ln_share(faultless, class).max(LEAST_EXCUSED) - ln_p)
}

/// A letter without light.
pub(super) fn unseen(expected: char) -> LetterVerdict {
    LetterVerdict { expected, best: None, runner_up: None, margin: 0.0, similarity: 0.0, p: 0.0 }
}

/// Probability that a strict reader reads the word, from the largest loss of its letters.
pub(super) fn probability(worst_loss: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-(PLATT[0] - PLATT[1] * worst_loss)))
}

/// Logarithm of a class's share in the choice (Luce's rule, as in Loomis 1990).
fn ln_share(similarities: &Similarities, class: usize) -> f64 {
    let scores = similarities.map(|similarity| SHARPNESS * f64::from(similarity));
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = scores.iter().map(|score| libm::exp(score - best)).sum();
    scores[class] - best - libm::log(sum)
}
