//! What a strip shows: the shares of the net's classes along it, the ways through these columns
//! that spell a word, and the choice among all letters in each place.
//!
//! A word is spelled by every sequence of columns that shows its letters in order, each for one or
//! more columns, with or without blanks between them (connectionist temporal classification, Graves
//! and others 2006). Sums over all ways from the left and from the right give the probability of
//! the word, and of the word with one letter replaced or left out.

use std::ops::Range;

use rayon::prelude::*;

use super::alphabet::{BLANK, Classes, NO_LETTER, names, with_case_of};
use super::net::{self, N_CLASSES};
use super::strip::Strip;

/// Least share of a class at a column: below it, shares are noise of the training.
const LEAST: f64 = 1e-6;

/// Shares of the classes at each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Columns(pub(super) Vec<[f64; N_CLASSES]>);

impl Columns {
    /// Shares along a strip.
    pub(super) fn along(strip: &Strip) -> Self {
        Self(net::logits(strip).iter().map(shares).collect())
    }

    /// The mean of the shares along a strip, its own, and along its neighbors: of letters that they
    /// disagree on, one is there all the same.
    pub(super) fn agreed(mut self, strip: &Strip) -> Self {
        let beside: Vec<Self> = strip.neighbors().par_iter().map(Self::along).collect();
        let part = 1.0 / (beside.len() + 1) as f64;
        for (index, column) in self.0.iter_mut().enumerate() {
            for (class, share) in column.iter_mut().enumerate() {
                let sum = beside.iter().map(|columns| columns.0[index][class]).sum::<f64>();
                *share = part * (*share + sum);
            }
        }
        self
    }

    /// Takes the shares anew that depend on some columns of a strip.
    pub(super) fn replace(&mut self, strip: &Strip, part: Range<usize>) {
        let (first, logits) = net::logits_around(strip, part);
        for (column, logits) in self.0[first..].iter_mut().zip(&logits) {
            *column = shares(logits);
        }
    }

    /// Columns in which light that no letter explains counts as darkness: trails from the take-off
    /// and to the landing pass beside every word.
    pub(super) fn unexplained_as_dark(mut self) -> Self {
        for shares in &mut self.0 {
            shares[0] += std::mem::replace(&mut shares[N_CLASSES - 1], LEAST) - LEAST;
        }
        self
    }

    /// Some of the columns.
    pub(super) fn part(&self, columns: Range<usize>) -> Self {
        Self(self.0[columns].to_vec())
    }

    /// Several lines, one after another.
    pub(super) fn joined(lines: impl IntoIterator<Item = Self>) -> Self {
        Self(lines.into_iter().flat_map(|line| line.0).collect())
    }

    /// Share of a set of classes at each column.
    pub(super) fn shares(&self, set: Classes) -> Vec<f64> {
        let members: Vec<usize> = (0..N_CLASSES).filter(|class| set >> class & 1 == 1).collect();
        self.0.iter().map(|column| members.iter().map(|class| column[*class]).sum()).collect()
    }

    /// ln of the probability that the columns spell a word.
    pub(super) fn ln_p(&self, word: &[Classes]) -> f64 {
        let lattice = Lattice::new(self, word);
        libm::log(lattice.total()) + lattice.ln_scale()
    }

    /// The mean column of each letter of a word.
    pub(super) fn middles(&self, word: &[Classes]) -> Vec<f64> {
        let lattice = Lattice::new(self, word);
        (0..word.len()).map(|index| lattice.middle(index, &self.shares(word[index]))).collect()
    }

    /// For each letter of a word, given with its classes, what is seen in its place.
    pub(super) fn choices(&self, word: &[Classes], letters: &[char]) -> Vec<Choice> {
        let lattice = Lattice::new(self, word);
        let own = lattice.total();
        let choices = (0..word.len()).map(|index| {
            let expected = word[index];
            let replaced = |set| lattice.replaced(index, &self.shares(set), set);
            let none = replaced(NO_LETTER & !expected) + lattice.without(index);
            let others = names(expected, letters[index].is_ascii_digit()).into_iter();
            let mut others: Vec<_> = others.map(|(name, set)| (name, replaced(set))).collect();
            let sum = own + none + others.iter().map(|(_, p)| p).sum::<f64>();
            if sum <= 0.0 {
                // Every way through the columns is too unlikely for a number.
                return Choice { p: 0.0, none: 1.0, others: Vec::new() };
            }
            others.iter_mut().for_each(|(_, p)| *p /= sum);
            others.sort_by(|a, b| b.1.total_cmp(&a.1));
            Choice { p: own / sum, none: none / sum, others }
        });
        choices.collect()
    }
}

fn shares(logits: &[f64; N_CLASSES]) -> [f64; N_CLASSES] {
    let most = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares = logits.map(|logit| libm::exp(logit - most));
    let sum: f64 = shares.iter().sum();
    shares.map(|share| (share / sum).max(LEAST))
}

/// What is seen in the place of one letter, the other letters being right.
pub(super) struct Choice {
    /// Share of the expected letter.
    pub(super) p: f64,
    /// Share of light that no letter explains, or of darkness.
    pub(super) none: f64,
    /// Shares of the other letters and digits, the likeliest first.
    pub(super) others: Vec<(char, f64)>,
}

impl Choice {
    /// The choice between a pair of letters and others: that of its less certain one.
    pub(super) fn and(&self, second: &Self) -> Self {
        let worse = if self.p <= second.p { self } else { second };
        Self { p: self.p * second.p, none: worse.none, others: worse.others.clone() }
    }

    /// What is likeliest in the place, and its share; `None`: no letter.
    pub(super) fn best(&self, expected: char) -> (Option<char>, f64) {
        let other = self.others.first().filter(|(_, p)| *p > self.p);
        let (letter, most) =
            other.map_or((expected, self.p), |(letter, p)| (with_case_of(*letter, expected), *p));
        if self.none > most { (None, self.none) } else { (Some(letter), most) }
    }
}

/// Sums over the ways to each state from the left and from the right.
pub(super) struct Lattice<'a> {
    word: &'a [Classes],
    /// By column and state: blank, first letter, blank, second letter … blank. Both sums include
    /// the share of the state itself.
    forward: Vec<Vec<f64>>,
    backward: Vec<Vec<f64>>,
    /// What the shares of each column were divided by, so that products stay in range.
    scales: Vec<f64>,
}

impl<'a> Lattice<'a> {
    pub(super) fn new(columns: &Columns, word: &'a [Classes]) -> Self {
        let mut letters: Vec<Vec<f64>> = word.iter().map(|set| columns.shares(*set)).collect();
        let mut blanks = columns.shares(BLANK);
        let n_columns = blanks.len();
        let mut scales = blanks.clone();
        for shares in &letters {
            scales.iter_mut().zip(shares).for_each(|(scale, share)| *scale = scale.max(*share));
        }
        for shares in letters.iter_mut().chain([&mut blanks]) {
            shares.iter_mut().zip(&scales).for_each(|(share, scale)| *share /= scale);
        }
        let n_states = 2 * word.len() + 1;
        let shares = (0..n_states)
            .map(|state| if state.is_multiple_of(2) { &blanks } else { &letters[state / 2] });
        let shares: Vec<&Vec<f64>> = shares.collect();
        // Two equal letters have a blank between them.
        let may_follow = (0..n_states).map(|state| {
            state % 2 == 1 && state >= 3 && word[state / 2] & word[state / 2 - 1] == 0
        });
        let may_follow: Vec<bool> = may_follow.collect();
        let mut forward = vec![vec![0.0; n_states]; n_columns];
        let mut backward = forward.clone();
        for column in 0..n_columns {
            for state in 0..n_states {
                let ways = match column.checked_sub(1).map(|before| &forward[before]) {
                    None => f64::from(u8::from(state < 2)),
                    Some(before) => {
                        let ways = before[state] + if state > 0 { before[state - 1] } else { 0.0 };
                        ways + if may_follow[state] { before[state - 2] } else { 0.0 }
                    }
                };
                forward[column][state] = ways * shares[state][column];
            }
        }
        for column in (0..n_columns).rev() {
            for state in 0..n_states {
                let ways = match backward.get(column + 1) {
                    None => f64::from(u8::from(state + 2 >= n_states)),
                    Some(after) => {
                        let ways = after[state] + after.get(state + 1).copied().unwrap_or(0.0);
                        let skips = may_follow.get(state + 2) == Some(&true);
                        ways + if skips { after[state + 2] } else { 0.0 }
                    }
                };
                backward[column][state] = ways * shares[state][column];
            }
        }
        Self { word, forward, backward, scales }
    }

    /// Probability of the word, in units of [`Self::ln_scale`].
    pub(super) fn total(&self) -> f64 {
        self.ends(2 * self.word.len())
    }

    /// ln of the unit of all probabilities here.
    pub(super) fn ln_scale(&self) -> f64 {
        self.scales.iter().map(|scale| libm::log(*scale)).sum()
    }

    /// Probability of the word with another letter in one place; `shares` are those of the letter.
    #[expect(clippy::needless_range_loop, reason = "the columns before and after")]
    pub(super) fn replaced(&self, index: usize, shares: &[f64], set: Classes) -> f64 {
        let (before, after) = (2 * index, 2 * index + 2);
        let [from_letter, to_letter] = [index.checked_sub(1), Some(index + 1)].map(|beside| {
            beside.and_then(|beside| self.word.get(beside)).is_some_and(|letter| letter & set == 0)
        });
        let (mut letter, mut total) = (0.0, 0.0);
        for column in 0..self.scales.len() {
            let ways = match column.checked_sub(1).map(|before| &self.forward[before]) {
                None => f64::from(u8::from(index == 0)),
                Some(left) => {
                    letter + left[before] + if from_letter { left[before - 1] } else { 0.0 }
                }
            };
            letter = ways * shares[column] / self.scales[column];
            total += letter
                * match self.backward.get(column + 1) {
                    None => f64::from(u8::from(index + 1 == self.word.len())),
                    Some(right) => right[after] + if to_letter { right[after + 1] } else { 0.0 },
                };
        }
        total
    }

    /// Probability of the word without one letter.
    pub(super) fn without(&self, index: usize) -> f64 {
        let blank = 2 * index;
        let Some(next) = self.word.get(index + 1) else { return self.ends(blank) };
        let from_letter = index > 0 && self.word[index - 1] & next == 0;
        let first = if index == 0 { self.backward[0][blank + 3] } else { 0.0 };
        let later = self.forward.iter().zip(&self.backward[1..]).map(|(left, right)| {
            let ways = left[blank] + if from_letter { left[blank - 1] } else { 0.0 };
            ways * right[blank + 3]
        });
        first + later.sum::<f64>()
    }

    /// The mean column of a letter, weighted with the ways through it; `shares` are those of the
    /// letter. 0 where there is no way.
    #[expect(clippy::needless_range_loop, reason = "one index for four tables")]
    pub(super) fn middle(&self, index: usize, shares: &[f64]) -> f64 {
        let state = 2 * index + 1;
        let (mut sum, mut moment) = (0.0, 0.0);
        for column in 0..self.scales.len() {
            let ways = self.forward[column][state] * self.backward[column][state];
            let weight = ways * self.scales[column] / shares[column];
            (sum, moment) = (sum + weight, moment + weight * column as f64);
        }
        if sum > 0.0 { moment / sum } else { 0.0 }
    }

    /// Ways that end in a blank or in the letter before it.
    fn ends(&self, blank: usize) -> f64 {
        let last = self.forward.last().expect("a strip has columns");
        last[blank] + blank.checked_sub(1).map_or(0.0, |letter| last[letter])
    }
}

#[cfg(test)]
mod tests {
    use super::super::alphabet::{class_of, classes_of};
    use super::*;

    /// Columns that show a character each, ' ' the blank, with a share of 0.9; the rest is spread.
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

    /// The probability of a word by trying all sequences of its symbols, column by column.
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
        let shares: Vec<Vec<f64>> =
            [BLANK].iter().chain(word).map(|set| columns.shares(*set)).collect();
        let n_paths = (word.len() + 1).pow(u32::try_from(columns.0.len()).unwrap());
        let paths = (0..n_paths).map(symbols).filter(|path| spells(path));
        paths
            .map(|path| {
                path.iter().enumerate().map(|(column, s)| shares[*s][column]).product::<f64>()
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
        let (own, noor) = (word("NOOR"), columns.ln_p(&word("NOOR")));
        let lattice = Lattice::new(&columns, &own);
        let rest = ["OOR", "NOR", "NOR", "NOO"];
        for (index, rest) in rest.iter().enumerate() {
            let without = libm::log(lattice.without(index) / lattice.total());
            let wanted = columns.ln_p(&word(rest)) - noor;
            assert!((without - wanted).abs() < 1e-9, "{rest}: {without}, {wanted}");
            for other in "PXN".chars() {
                let mut text: Vec<char> = "NOOR".chars().collect();
                text[index] = other;
                let set = classes_of(other).unwrap();
                let replaced = lattice.replaced(index, &columns.shares(set), set);
                let wanted = columns.ln_p(&word(&text.iter().collect::<String>())) - noor;
                let ln_odds = libm::log(replaced / lattice.total());
                assert!((ln_odds - wanted).abs() < 1e-9, "{text:?}: {ln_odds}, {wanted}");
            }
        }
    }

    #[test]
    fn shares_of_a_place_add_up_and_name_what_is_there() {
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
