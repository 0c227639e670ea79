//! The ways through the columns of a strip that spell a word.
//!
//! A word is spelled by every sequence of columns that shows its letters in order, each for one or
//! more columns, with or without blanks between them (connectionist temporal classification, Graves
//! and others 2006). Sums over all ways from the left and from the right give the probability of
//! the word, and of the word with one letter replaced or left out.

use super::alphabet::{BLANK, Classes};
use super::columns::Columns;

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
        let scales: Vec<f64> = (0..n_columns)
            .map(|at| letters.iter().map(|shares| shares[at]).fold(blanks[at], f64::max))
            .collect();
        for shares in letters.iter_mut().chain([&mut blanks]) {
            shares.iter_mut().zip(&scales).for_each(|(share, scale)| *share /= scale);
        }
        let share = |at: usize, state: usize| {
            if state.is_multiple_of(2) { blanks[at] } else { letters[state / 2][at] }
        };
        let n_states = 2 * word.len() + 1;
        // Two equal letters have a blank between them.
        let may_follow = |state: usize| {
            state % 2 == 1 && state >= 3 && word[state / 2] & word[state / 2 - 1] == 0
        };
        let mut forward = vec![vec![0.0; n_states]; n_columns];
        let mut backward = forward.clone();
        for at in 0..n_columns {
            for state in 0..n_states {
                let ways = match at.checked_sub(1).map(|before| &forward[before]) {
                    None => f64::from(u8::from(state < 2)),
                    Some(before) => {
                        let step = |back: usize| state.checked_sub(back).map_or(0.0, |s| before[s]);
                        step(0) + step(1) + if may_follow(state) { step(2) } else { 0.0 }
                    }
                };
                forward[at][state] = ways * share(at, state);
            }
        }
        for at in (0..n_columns).rev() {
            for state in 0..n_states {
                let ways = match backward.get(at + 1) {
                    None => f64::from(u8::from(state + 2 >= n_states)),
                    Some(after) => {
                        let step = |on: usize| after.get(state + on).copied().unwrap_or(0.0);
                        let skips = state + 2 < n_states && may_follow(state + 2);
                        step(0) + step(1) + if skips { step(2) } else { 0.0 }
                    }
                };
                backward[at][state] = ways * share(at, state);
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
        let differs = |at: Option<&Classes>| at.is_some_and(|letter| letter & set == 0);
        let from_letter = index > 0 && differs(self.word.get(index - 1));
        let to_letter = differs(self.word.get(index + 1));
        let (mut letter, mut total) = (0.0, 0.0);
        for at in 0..self.scales.len() {
            let ways = match at.checked_sub(1).map(|column| &self.forward[column]) {
                None => f64::from(u8::from(index == 0)),
                Some(left) => {
                    letter + left[before] + if from_letter { left[before - 1] } else { 0.0 }
                }
            };
            letter = ways * shares[at] / self.scales[at];
            total += letter
                * match self.backward.get(at + 1) {
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
        for at in 0..self.scales.len() {
            let weight =
                self.forward[at][state] * self.backward[at][state] * self.scales[at] / shares[at];
            (sum, moment) = (sum + weight, moment + weight * at as f64);
        }
        if sum > 0.0 { moment / sum } else { 0.0 }
    }

    /// Ways that end in a blank or in the letter before it.
    fn ends(&self, blank: usize) -> f64 {
        let last = self.forward.last().expect("a strip has columns");
        last[blank] + blank.checked_sub(1).map_or(0.0, |letter| last[letter])
    }
}
