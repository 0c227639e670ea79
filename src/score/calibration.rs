//! From shares of letters to the probability that a visitor reads the word: the fitted numbers.

use serde::Serialize;

use super::sequence::Choice;

/// Constant and weights of the logistic regression. Fitted by `examples/readings/fit.py` to the choosing
/// half of `examples/readings/readings.tsv`; docs/calibration.md has the result.
const CONSTANT: f64 = 3.0;
const WEIGHT_OF_WORST: f64 = 1.0;
const WEIGHT_OF_MEAN: f64 = 1.0;

/// How a verdict's readability was made: `1 / (1 + exp(−(constant + worst · w + mean · m)))`, w being ln p of
/// the least likely letter and m the mean of ln p.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Readers whose reading it predicts.
    pub reader: &'static str,
    /// See above.
    pub constant: f64,
    /// See above.
    pub worst: f64,
    /// See above.
    pub mean: f64,
}

/// The calibration that verdicts are made with.
pub const CALIBRATION: Calibration = Calibration {
    reader: "two at first sight",
    constant: CONSTANT,
    worst: WEIGHT_OF_WORST,
    mean: WEIGHT_OF_MEAN,
};

/// Probability that visitors read a word at first sight, from what stands in the place of each letter.
pub(super) fn readability(choices: &[Choice]) -> f64 {
    let ln_p: Vec<f64> = choices.iter().map(|choice| libm::log(choice.p.max(1e-9))).collect();
    let worst = ln_p.iter().copied().fold(0.0, f64::min);
    let mean = ln_p.iter().sum::<f64>() / ln_p.len() as f64;
    1.0 / (1.0 + libm::exp(-(CONSTANT + WEIGHT_OF_WORST * worst + WEIGHT_OF_MEAN * mean)))
}
