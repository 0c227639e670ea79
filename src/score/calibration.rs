//! The probability that a viewer reads the word at first sight, computed by logistic regression.

use serde::Serialize;

use super::lattice::Choice;

/// Range to which the log-odds of a letter are limited, so that no single letter dominates.
const LOG_ODDS: [f64; 2] = [-9.0, 8.0];

/// Minimum total probability of the other letters, so that log-odds stay finite.
const LEAST_REST: f64 = 5e-4;

/// Maximum magnitude of the word's log-odds against the rival word.
const MOST_RIVAL: f64 = 9.0;

/// Minimum of a spelling's mean log-probability, and the mean of that value over words and names.
const LEAST_SPELLING: f64 = -4.0;
const MEAN_SPELLING: f64 = -2.2;

/// `m` is the mean log-odds of the letters, and `r` the log-odds of the word against its rival. `s`
/// measures how common the spelling is: the mean natural logarithm of the probability of each
/// letter after the preceding four, plus 2.2, multiplied by 1 − m / 8 for m from 0 to 8.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// The human readers whose success the regression predicts.
    pub reader: &'static str,
    /// Constant of the regression.
    pub constant: f64,
    /// Weight of the letters' mean log-odds, each within −9 and 8.
    pub mean_log_odds: f64,
    /// Weight of the log-odds of the word against the likeliest other word, within ±9.
    pub rival: f64,
    /// Weight of the spelling, `s` above.
    pub spelling: f64,
}

/// The calibration of all verdicts. `examples/readings/fit.py` fitted it to the `choose` half of
/// `examples/readings/readings.tsv` and to clean photographs (docs/calibration.md).
pub const CALIBRATION: Calibration = Calibration {
    reader: "two at first sight",
    constant: -0.081,
    mean_log_odds: 0.286,
    rival: 0.296,
    spelling: 1.192,
};

/// Returns the probability that a viewer reads a word with these `choices` for its letters.
/// `ln_odds_of_word` is the logarithm of its odds against the likeliest other word.
/// `ln_p_of_spelling` is the mean logarithm of the probability of its letters in English.
pub(super) fn readability(choices: &[Choice], ln_odds_of_word: f64, ln_p_of_spelling: f64) -> f64 {
    let odds = choices.iter().map(|choice| choice.p / (1.0 - choice.p).max(LEAST_REST));
    let log_odds = odds.map(|odds| libm::log(odds).clamp(LOG_ODDS[0], LOG_ODDS[1]));
    let mean = log_odds.sum::<f64>() / choices.len().max(1) as f64;
    let rival_log_odds = ln_odds_of_word.clamp(-MOST_RIVAL, MOST_RIVAL);
    // The spelling has no weight if letters are clear, because people then read even unusual words.
    let unclear = 1.0 - mean.clamp(0.0, LOG_ODDS[1]) / LOG_ODDS[1];
    let usualness = unclear * (ln_p_of_spelling.max(LEAST_SPELLING) - MEAN_SPELLING);
    let Calibration { constant, mean_log_odds, rival, spelling, .. } = CALIBRATION;
    let sum = constant + mean_log_odds * mean + rival * rival_log_odds + spelling * usualness;
    1.0 / (1.0 + libm::exp(-sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choices(letters_p: &[f64]) -> Vec<Choice> {
        letters_p.iter().map(|&p| Choice { p, none: 1.0 - p, others: Vec::new() }).collect()
    }

    fn read(letters_p: &[f64], rival: f64) -> f64 {
        readability(&choices(letters_p), rival, -2.5)
    }

    #[test]
    fn readability_rises_with_letters_and_spelling_and_falls_with_the_rival() {
        let (sure, bad) = (read(&[1.0; 4], 9.0), read(&[1.0, 1.0, 1.0, 0.1], -2.0));
        assert!(sure > 0.9 && bad < sure - 0.2, "{sure}, {bad}");
        assert!(read(&[0.9; 4], 2.0) > read(&[0.8, 0.9, 0.9, 0.9], 2.0), "a worse letter");
        assert!(read(&[0.9; 4], 2.0) > read(&[0.9; 4], 1.0), "a likelier rival");
        assert!(read(&[0.0; 2], f64::NEG_INFINITY).is_finite(), "bounded");
        assert!(readability(&[], 2.0, -2.5) > readability(&[], 2.0, -4.0), "unusual spelling");
        assert!(readability(&choices(&[0.9999]), 9.0, -4.0) > 0.9, "unusual and clear");
    }
}
