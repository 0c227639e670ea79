//! Probabilities of the net's classes along a strip, and of words given these probabilities.
//!
//! A sequence of columns spells a word if it shows the word's letters in order, each in one or more
//! columns, with or without blanks between them (connectionist temporal classification, Graves and
//! others 2006). Sums over all such paths, from the left and from the right, give the probability
//! of the word and of the word with one letter replaced or left out.

use std::ops::Range;

use noctograph_core::parallel::prelude::*;

use super::alphabet::{BLANK, Classes, NO_LETTER, names, with_case_of};
use super::net::{self, N_CLASSES};
use super::strip::Strip;
use noctograph_core::statistics::sort_by_number;

/// Minimum probability of a class at a column. Lower outputs of the net are training noise.
const LEAST: f64 = 1e-6;

/// Probabilities of the classes at each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Columns(pub(super) Vec<[f64; N_CLASSES]>);

impl Columns {
    /// Computes the class probabilities along a strip with the net.
    pub(super) fn along(strip: &Strip) -> Self {
        Self(net::logits(strip).iter().map(softmax).collect())
    }

    /// Averages the probabilities with those of shifted, scaled and darkened copies of the strip.
    pub(super) fn agreed(mut self, strip: &Strip) -> Self {
        let neighbors: Vec<Self> = strip.neighbors().par_iter().map(Self::along).collect();
        let weight = 1.0 / (neighbors.len() + 1) as f64;
        for (index, column) in self.0.iter_mut().enumerate() {
            for (class, p) in column.iter_mut().enumerate() {
                let sum = neighbors.iter().map(|columns| columns.0[index][class]).sum::<f64>();
                *p = weight * (*p + sum);
            }
        }
        self
    }

    /// Recomputes the probabilities that depend on the given columns of a strip.
    pub(super) fn replace(&mut self, strip: &Strip, part: Range<usize>) {
        let (first, logits) = net::logits_around(strip, part);
        for (column, logits) in self.0[first..].iter_mut().zip(&logits) {
            *column = softmax(logits);
        }
    }

    /// Counts unexplained light as blank, because every word has trails to the floor beside it.
    pub(super) fn unexplained_as_dark(mut self) -> Self {
        for column in &mut self.0 {
            column[0] += std::mem::replace(&mut column[N_CLASSES - 1], LEAST) - LEAST;
        }
        self
    }

    /// Returns the probabilities in a range of columns.
    pub(super) fn part(&self, columns: Range<usize>) -> Self {
        Self(self.0[columns].to_vec())
    }

    /// Concatenates the columns of several lines.
    pub(super) fn joined(lines: impl IntoIterator<Item = Self>) -> Self {
        Self(lines.into_iter().flat_map(|line| line.0).collect())
    }

    /// Returns the total probability of a set of classes at each column.
    pub(super) fn of_set(&self, set: Classes) -> Vec<f64> {
        let members: Vec<usize> = (0..N_CLASSES).filter(|class| set >> class & 1 == 1).collect();
        self.0.iter().map(|column| members.iter().map(|class| column[*class]).sum()).collect()
    }

    /// Returns the natural logarithm of the probability that the columns spell a word.
    pub(super) fn ln_p(&self, word: &[Classes]) -> f64 {
        let lattice = Lattice::new(self, word);
        libm::log(lattice.total()) + lattice.ln_scale()
    }

    /// Returns the mean position, as a column, of each letter of a word.
    pub(super) fn middles(&self, word: &[Classes]) -> Vec<f64> {
        let lattice = Lattice::new(self, word);
        (0..word.len()).map(|index| lattice.middle(index, &self.of_set(word[index]))).collect()
    }

    /// Returns the choice for each letter of a word, given both as classes and as characters.
    pub(super) fn choices(&self, word: &[Classes], letters: &[char]) -> Vec<Choice> {
        let lattice = Lattice::new(self, word);
        let total = lattice.total();
        let mut choices = Vec::with_capacity(word.len());
        for (index, &expected) in word.iter().enumerate() {
            // Computes the word's probabilities with other letters here, in the lattice's unit.
            let no_letter = NO_LETTER & !expected;
            let none = lattice.replaced(index, &self.of_set(no_letter), no_letter)
                + lattice.without(index);
            let named = names(expected, letters[index].is_ascii_digit()).into_iter();
            let replaced =
                named.map(|(name, set)| (name, lattice.replaced(index, &self.of_set(set), set)));
            let mut others: Vec<(char, f64)> = replaced.collect();
            let sum = total + none + others.iter().map(|(_, p)| p).sum::<f64>();
            if sum <= 0.0 {
                // The probabilities of all paths have underflowed to 0.
                choices.push(Choice { p: 0.0, none: 1.0, others: Vec::new() });
                continue;
            }
            others.iter_mut().for_each(|(_, p)| *p /= sum);
            sort_by_number(&mut others, |(_, p)| -p);
            choices.push(Choice { p: total / sum, none: none / sum, others });
        }
        choices
    }
}

/// Converts logits to probabilities, each of which is at least [`LEAST`].
fn softmax(logits: &[f64; N_CLASSES]) -> [f64; N_CLASSES] {
    let most = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights = logits.map(|logit| libm::exp(logit - most));
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| (weight / sum).max(LEAST))
}

/// Probabilities of what one position may show, given that all other letters are right. Their sum
/// is 1.
pub(super) struct Choice {
    /// Probability of the expected letter.
    pub(super) p: f64,
    /// Probability of light that no letter explains, or of darkness.
    pub(super) none: f64,
    /// Probabilities of all other letters and digits, in descending order.
    pub(super) others: Vec<(char, f64)>,
}

impl Choice {
    /// Combines the choices for two letters that must both be right. The other letters are taken
    /// from the less certain choice.
    pub(super) fn and(&self, second: &Self) -> Self {
        let worse = if self.p <= second.p { self } else { second };
        Self { p: self.p * second.p, none: worse.none, others: worse.others.clone() }
    }

    /// Returns the likeliest letter, or `None` if "no letter" is likelier, and its probability.
    pub(super) fn best(&self, expected: char) -> (Option<char>, f64) {
        let other = self.others.first().filter(|(_, p)| *p > self.p);
        let (letter, most) =
            other.map_or((expected, self.p), |(letter, p)| (with_case_of(*letter, expected), *p));
        if self.none > most { (None, self.none) } else { (Some(letter), most) }
    }
}

/// Sums over all paths to each state from the left and from the right (forward and backward
/// variables).
pub(super) struct Lattice<'a> {
    word: &'a [Classes],
    /// Sums by column and state. The states are blank, first letter, blank, second letter, …,
    /// blank. Both sums include the probability of the state itself.
    forward: Vec<Vec<f64>>,
    backward: Vec<Vec<f64>>,
    /// Divisor of the probabilities in each column, which keeps their products in range.
    scales: Vec<f64>,
}

impl<'a> Lattice<'a> {
    /// Computes the sums for a word, given as the set of classes of each letter.
    pub(super) fn new(columns: &Columns, word: &'a [Classes]) -> Self {
        // The probabilities in each column are divided by the greatest one among the states.
        let mut letters: Vec<Vec<f64>> = word.iter().map(|set| columns.of_set(*set)).collect();
        let mut blanks = columns.of_set(BLANK);
        let mut scales = blanks.clone();
        for letter in &letters {
            scales.iter_mut().zip(letter).for_each(|(scale, p)| *scale = scale.max(*p));
        }
        for probabilities in letters.iter_mut().chain([&mut blanks]) {
            probabilities.iter_mut().zip(&scales).for_each(|(p, scale)| *p /= scale);
        }
        let states: Vec<&[f64]> =
            letters.iter().flat_map(|letter| [&blanks[..], letter]).chain([&blanks[..]]).collect();
        let forward = path_sums(word, &states, 0..blanks.len());
        // The sums from the right are computed with the word spelled backward.
        let word_back: Vec<Classes> = word.iter().rev().copied().collect();
        let states_back: Vec<&[f64]> = states.into_iter().rev().collect();
        let mut backward = path_sums(&word_back, &states_back, (0..blanks.len()).rev());
        backward.reverse();
        backward.iter_mut().for_each(|sums| sums.reverse());
        Self { word, forward, backward, scales }
    }

    /// Returns the probability of the word, in the unit whose logarithm is [`Self::ln_scale`].
    pub(super) fn total(&self) -> f64 {
        self.ends(2 * self.word.len())
    }

    /// Returns the natural logarithm of the unit in which this lattice gives probabilities.
    pub(super) fn ln_scale(&self) -> f64 {
        self.scales.iter().map(|scale| libm::log(*scale)).sum()
    }

    /// Returns the probability of the word, in the lattice's unit, if the letter at `index` is
    /// replaced by the classes `set`, whose probability at each column is `p`.
    #[expect(clippy::needless_range_loop, reason = "the columns before and after")]
    pub(super) fn replaced(&self, index: usize, p: &[f64], set: Classes) -> f64 {
        let (before, after) = (2 * index, 2 * index + 2);
        // Two equal letters in a row must have a blank between them.
        let [from_letter, to_letter] = [index.checked_sub(1), Some(index + 1)].map(|near| {
            near.and_then(|near| self.word.get(near)).is_some_and(|letter| letter & set == 0)
        });
        // At each column, a path in the letter was already in it, or comes from the blank or letter
        // before. Each path is counted only once, when it leaves the letter.
        let (mut letter, mut total) = (0.0, 0.0);
        for column in 0..self.scales.len() {
            let paths = match column.checked_sub(1).map(|before| &self.forward[before]) {
                None => f64::from(u8::from(index == 0)),
                Some(left) => {
                    letter + left[before] + if from_letter { left[before - 1] } else { 0.0 }
                }
            };
            letter = paths * p[column] / self.scales[column];
            total += letter
                * match self.backward.get(column + 1) {
                    None => f64::from(u8::from(index + 1 == self.word.len())),
                    Some(right) => right[after] + if to_letter { right[after + 1] } else { 0.0 },
                };
        }
        total
    }

    /// Returns the probability of the word with the letter at `index` left out, in the lattice's
    /// unit.
    pub(super) fn without(&self, index: usize) -> f64 {
        let blank = 2 * index;
        let Some(next) = self.word.get(index + 1) else { return self.ends(blank) };
        // A path enters the next letter from the blank before the missing letter or from the letter
        // before that blank. If the first letter is missing, a path may also start there.
        let from_letter = index > 0 && self.word[index - 1] & next == 0;
        let first = if index == 0 { self.backward[0][blank + 3] } else { 0.0 };
        let later = self.forward.iter().zip(&self.backward[1..]).map(|(left, right)| {
            let paths = left[blank] + if from_letter { left[blank - 1] } else { 0.0 };
            paths * right[blank + 3]
        });
        first + later.sum::<f64>()
    }

    /// Returns the mean column of a letter whose probability at each column is `p`, weighted by the
    /// paths through the letter.
    #[expect(clippy::needless_range_loop, reason = "one index for four tables")]
    pub(super) fn middle(&self, index: usize, p: &[f64]) -> f64 {
        let state = 2 * index + 1;
        let (mut sum, mut moment) = (0.0, 0.0);
        for column in 0..self.scales.len() {
            // Both sums include the letter's own probability, so one of them is divided by it.
            let paths = self.forward[column][state] * self.backward[column][state];
            let weight = paths * self.scales[column] / p[column];
            (sum, moment) = (sum + weight, moment + weight * column as f64);
        }
        if sum > 0.0 { moment / sum } else { 0.0 }
    }

    /// Returns the sum over the paths that end in a blank or in the letter before it.
    fn ends(&self, blank: usize) -> f64 {
        let last = self.forward.last().expect("a strip has columns");
        last[blank] + blank.checked_sub(1).map_or(0.0, |letter| last[letter])
    }
}

/// Returns the sums over the paths to each state, one row per column, in the order of `columns`.
/// `states` contains the probability of each state at each column. A word of n letters has 2 n + 1
/// states.
fn path_sums(
    word: &[Classes],
    states: &[&[f64]],
    columns: impl Iterator<Item = usize>,
) -> Vec<Vec<f64>> {
    // A path may skip the blank between two letters, unless these letters are equal.
    let may_skip: Vec<bool> = (0..states.len())
        .map(|state| state % 2 == 1 && state >= 3 && word[state / 2] & word[state / 2 - 1] == 0)
        .collect();
    let mut sums: Vec<Vec<f64>> = Vec::with_capacity(states[0].len());
    for column in columns {
        let next = (0..states.len()).map(|state| {
            let paths = match sums.last() {
                // A path starts at a blank or at the word's first letter.
                None => f64::from(u8::from(state < 2)),
                Some(before) => {
                    let paths = before[state] + if state > 0 { before[state - 1] } else { 0.0 };
                    paths + if may_skip[state] { before[state - 2] } else { 0.0 }
                }
            };
            paths * states[state][column]
        });
        let next = next.collect();
        sums.push(next);
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::super::alphabet::{class_of, classes_of};
    use super::*;

    /// Returns columns that each show one character of `text` with a probability of 0.9, where ' '
    /// is the blank. The other classes share the rest equally.
    fn columns(text: &str) -> Columns {
        let columns = text.chars().map(|c| {
            let mut column = [0.1 / (N_CLASSES - 1) as f64; N_CLASSES];
            column[class_of(c).unwrap_or(0)] = 0.9;
            column
        });
        Columns(columns.collect())
    }

    fn word(text: &str) -> Vec<Classes> {
        text.chars().map(|c| classes_of(c).unwrap()).collect()
    }

    /// Computes the probability of a word by trying all sequences of its symbols, column by column.
    fn by_trial(columns: &Columns, word: &[Classes]) -> f64 {
        let symbols = |code: usize| -> Vec<usize> {
            let n = word.len() + 1;
            let powers = std::iter::successors(Some(1), |power| Some(power * n));
            powers.take(columns.0.len()).map(|power| code / power % n).collect()
        };
        let spells = |path: &[usize]| {
            let mut read = Vec::new();
            for (index, symbol) in path.iter().enumerate() {
                if *symbol > 0 && (index == 0 || path[index - 1] != *symbol) {
                    read.push(*symbol);
                }
            }
            read == (1..=word.len()).collect::<Vec<_>>()
        };
        let probabilities: Vec<Vec<f64>> =
            [BLANK].iter().chain(word).map(|set| columns.of_set(*set)).collect();
        let n_paths = (word.len() + 1).pow(u32::try_from(columns.0.len()).unwrap());
        let paths = (0..n_paths).map(symbols).filter(|path| spells(path));
        paths
            .map(|path| {
                path.iter()
                    .enumerate()
                    .map(|(column, s)| probabilities[*s][column])
                    .product::<f64>()
            })
            .sum()
    }

    #[test]
    fn the_lattice_sums_all_ways_that_spell_a_word() {
        let columns = columns("N  OR");
        for text in ["NOR", "NO", "OR", "N"] {
            let wanted = libm::log(by_trial(&columns, &word(text)));
            let ln_p = columns.ln_p(&word(text));
            assert!((ln_p - wanted).abs() < 1e-9, "{text}: {ln_p}, {wanted}");
        }
    }

    #[test]
    fn a_replaced_and_a_missing_letter_are_as_likely_as_those_words() {
        let columns = columns(" N OP R ");
        let (word_noor, noor) = (word("NOOR"), columns.ln_p(&word("NOOR")));
        let lattice = Lattice::new(&columns, &word_noor);
        let rest = ["OOR", "NOR", "NOR", "NOO"];
        for (index, rest) in rest.iter().enumerate() {
            let without = libm::log(lattice.without(index) / lattice.total());
            let wanted = columns.ln_p(&word(rest)) - noor;
            assert!((without - wanted).abs() < 1e-9, "{rest}: {without}, {wanted}");
            for other in "PXN".chars() {
                let mut text: Vec<char> = "NOOR".chars().collect();
                text[index] = other;
                let set = classes_of(other).unwrap();
                let replaced = lattice.replaced(index, &columns.of_set(set), set);
                let wanted = columns.ln_p(&word(&text.iter().collect::<String>())) - noor;
                let ln_odds = libm::log(replaced / lattice.total());
                assert!((ln_odds - wanted).abs() < 1e-9, "{text:?}: {ln_odds}, {wanted}");
            }
        }
    }

    #[test]
    fn probabilities_of_a_place_add_up_and_name_what_is_there() {
        let columns = columns("N O O P ");
        let choices = columns.choices(&word("NOOR"), &['N', 'O', 'O', 'R']);
        for choice in &choices {
            let sum = choice.p + choice.none + choice.others.iter().map(|(_, p)| p).sum::<f64>();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
        let last = &choices[3];
        assert!(last.others[0].0 == 'P' && last.others[0].1 > 0.9, "{:?}", last.others);
        assert!(choices[0].p > 0.9);
    }
}
