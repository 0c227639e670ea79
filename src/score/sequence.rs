//! From logits to letters: how likely a strip of light says a word, and what it says otherwise.
//!
//! The net gives at every column the shares of the characters and of the blank between them. A word
//! is said by every sequence of columns that shows its letters in order, each for one or more columns,
//! blanks between them (connectionist temporal classification, Graves and others 2006). Characters that
//! differ in case only, and O and 0, I, l and 1, count as one.

use std::collections::BTreeMap;

use super::net::N_CLASSES;

/// The net's characters, from class 1 on.
const CHARACTERS: &[u8; 62] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

/// Least share of a class at a column: below it, shares are noise of the training.
const LEAST: f64 = 1e-6;

/// Prefixes that are followed at once when a strip is read freely. More find no other words.
const N_PREFIXES: usize = 12;

/// Share of a character at a column from which a free reading tries it there.
const LEAST_STEP: f64 = 0.003;

/// A set of classes, one bit for each.
pub(super) type Classes = u64;

/// Letters that count as one, by the set of their classes.
pub(super) const NAMES: &[u8; 36] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";

/// Shares of the classes at each column.
pub(super) struct Columns(Vec<[f64; N_CLASSES]>);

/// How likely each letter of a word is the one that is seen.
pub(super) struct Choice {
    /// Share of the expected letter.
    pub(super) p: f64,
    /// Share of what is no letter, or is missing.
    pub(super) none: f64,
    /// Shares of all other letters of [`NAMES`], the likeliest first.
    pub(super) others: Vec<(char, f64)>,
}

/// The class of a character that the net knows.
pub(super) fn class_of(character: char) -> Option<usize> {
    CHARACTERS.iter().position(|known| char::from(*known) == character).map(|at| at + 1)
}

/// The classes that count as a character: all characters for those that the net does not know.
pub(super) fn classes_of(character: char) -> Classes {
    let alike: &[char] = match character {
        'O' | 'o' | '0' => &['O', 'o', '0'],
        'I' | '1' => &['I', 'i', 'l', '1'],
        'l' => &['l', 'L', 'I', '1'],
        _ => &[character.to_ascii_uppercase(), character.to_ascii_lowercase()],
    };
    let classes = alike.iter().filter_map(|character| class_of(*character));
    match classes.fold(0, |set, class| set | 1 << class) {
        0 => ((1 << 62) - 1) << 1,
        set => set,
    }
}

impl Columns {
    /// Shares from logits.
    pub(super) fn from_logits(logits: &[[f64; N_CLASSES]]) -> Self {
        let shares = logits.iter().map(|logits| {
            let most = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let shares = logits.map(|logit| libm::exp(logit - most));
            let sum: f64 = shares.iter().sum();
            shares.map(|share| (share / sum).max(LEAST))
        });
        Self(shares.collect())
    }

    /// Several lines, one after another.
    pub(super) fn joined(lines: impl IntoIterator<Item = Self>) -> Self {
        Self(lines.into_iter().flat_map(|line| line.0).collect())
    }

    /// Share of a set of classes at each column.
    fn shares(&self, set: Classes) -> Vec<f64> {
        let members: Vec<usize> = (0..N_CLASSES).filter(|class| set >> class & 1 == 1).collect();
        self.0.iter().map(|column| members.iter().map(|class| column[*class]).sum()).collect()
    }

    /// ln of the probability that the columns say a word.
    pub(super) fn ln_p(&self, word: &[Classes]) -> f64 {
        let lattice = Lattice::new(self, word);
        libm::log(lattice.total()) + lattice.ln_scale
    }

    /// The likeliest words in the names of [`NAMES`], nothing being known; `?` is what is no letter.
    pub(super) fn freely(&self) -> Vec<(String, f64)> {
        let names = NAMES.iter().map(|name| char::from(*name));
        let symbols: Vec<(char, Classes)> = names.map(|name| (name, classes_of(name))).collect();
        // Classes that two names share are counted with the first.
        let mut taken = 0;
        let symbols: Vec<(char, Classes)> = symbols
            .into_iter()
            .map(|(name, set)| {
                let own = set & !taken;
                taken |= own;
                (name, own)
            })
            .filter(|(_, set)| *set != 0)
            .collect();
        self.search(&symbols, &symbols)
    }

    /// The likeliest words of some characters, the first of which is one of others, the likeliest first
    /// (prefix beam search, Hannun and others 2014).
    pub(super) fn search(
        &self,
        first: &[(char, Classes)],
        rest: &[(char, Classes)],
    ) -> Vec<(String, f64)> {
        let shares = |symbols: &[(char, Classes)]| -> Vec<Vec<f64>> {
            let none = ('?', 1 << (N_CLASSES - 1));
            symbols.iter().chain([&none]).map(|(_, set)| self.shares(*set)).collect()
        };
        let names = |symbols: &[(char, Classes)]| -> Vec<char> {
            symbols.iter().map(|(name, _)| *name).chain(['?']).collect()
        };
        let tables = [(names(first), shares(first)), (names(rest), shares(rest))];
        let blanks = self.shares(1);
        // By prefix: the probability that it ends in a blank, and in its last letter.
        let mut prefixes = vec![(String::new(), [1.0_f64, 0.0])];
        let mut ln_scale = 0.0;
        for at in 0..self.0.len() {
            let mut next: BTreeMap<String, [f64; 2]> = BTreeMap::new();
            for (prefix, [blank, letter]) in &prefixes {
                let both = blank + letter;
                next.entry(prefix.clone()).or_default()[0] += both * blanks[at];
                let last = prefix.chars().next_back();
                let own = &tables[usize::from(prefix.chars().nth(1).is_some())];
                if let Some(index) = own.0.iter().position(|name| Some(*name) == last) {
                    next.entry(prefix.clone()).or_default()[1] += letter * own.1[index][at];
                }
                let (names, shares) = &tables[usize::from(!prefix.is_empty())];
                for (name, shares) in
                    names.iter().zip(shares).filter(|(_, shares)| shares[at] > LEAST_STEP)
                {
                    let from = if last == Some(*name) { *blank } else { both };
                    let mut longer = prefix.clone();
                    longer.push(*name);
                    next.entry(longer).or_default()[1] += from * shares[at];
                }
            }
            prefixes = next.into_iter().collect();
            prefixes.sort_by(|a, b| (b.1[0] + b.1[1]).total_cmp(&(a.1[0] + a.1[1])));
            prefixes.truncate(N_PREFIXES);
            let most = prefixes.first().map_or(1.0, |(_, [blank, letter])| blank + letter);
            prefixes.iter_mut().flat_map(|(_, p)| p).for_each(|p| *p /= most);
            ln_scale += libm::log(most);
        }
        let ln_p = |[blank, letter]: [f64; 2]| libm::log(blank + letter) + ln_scale;
        prefixes.into_iter().map(|(text, p)| (text, ln_p(p))).collect()
    }

    /// The mean column of each letter of a word.
    pub(super) fn middles(&self, word: &[Classes]) -> Vec<f64> {
        let lattice = Lattice::new(self, word);
        let middle = |index: usize| {
            let shares = self.shares(word[index]);
            let weights = lattice.forward.iter().zip(&lattice.backward).zip(&shares);
            let weights = weights
                .map(|((left, right), share)| left[2 * index + 1] * right[2 * index + 1] / share);
            let (sum, moment) =
                weights.enumerate().fold((0.0, 0.0), |(sum, moment), (at, weight)| {
                    (
                        sum + weight * lattice.scales[at],
                        moment + weight * lattice.scales[at] * at as f64,
                    )
                });
            moment / sum
        };
        (0..word.len()).map(middle).collect()
    }

    /// For each letter of a word, what stands in its place, all others being right.
    pub(super) fn choices(&self, word: &[Classes]) -> Vec<Choice> {
        let lattice = Lattice::new(self, word);
        let own = lattice.total();
        (0..word.len())
            .map(|index| {
                let rest: Vec<Classes> = word
                    .iter()
                    .enumerate()
                    .filter(|(at, _)| *at != index)
                    .map(|(_, set)| *set)
                    .collect();
                let without = Lattice::new(self, &rest);
                let without_p = without.total() * libm::exp(without.ln_scale - lattice.ln_scale);
                let no_letter = lattice.substituted(
                    index,
                    &self.shares(1 << (N_CLASSES - 1)),
                    1 << (N_CLASSES - 1),
                );
                let mut others: Vec<(char, f64)> = NAMES
                    .iter()
                    .map(|name| char::from(*name))
                    .map(|name| (name, classes_of(name)))
                    .filter(|(_, set)| set & word[index] == 0)
                    .map(|(name, set)| (name, lattice.substituted(index, &self.shares(set), set)))
                    .collect();
                let none = no_letter + without_p;
                let sum = own + none + others.iter().map(|(_, p)| p).sum::<f64>();
                others.iter_mut().for_each(|(_, p)| *p /= sum);
                others.sort_by(|a, b| b.1.total_cmp(&a.1));
                Choice { p: own / sum, none: none / sum, others }
            })
            .collect()
    }
}

/// The ways through the columns that say a word, from the left and from the right.
struct Lattice<'a> {
    word: &'a [Classes],
    /// Shares of the blank at each column.
    blanks: Vec<f64>,
    /// By column and state: blank, first letter, blank, second letter ... blank.
    forward: Vec<Vec<f64>>,
    backward: Vec<Vec<f64>>,
    /// ln of what all shares were divided by, so that no product vanishes.
    ln_scale: f64,
    scales: Vec<f64>,
}

impl<'a> Lattice<'a> {
    fn new(columns: &Columns, word: &'a [Classes]) -> Self {
        let mut letters: Vec<Vec<f64>> = word.iter().map(|set| columns.shares(*set)).collect();
        let mut blanks = columns.shares(1);
        let n_columns = blanks.len();
        let scales: Vec<f64> = (0..n_columns)
            .map(|at| letters.iter().map(|shares| shares[at]).fold(blanks[at], f64::max))
            .collect();
        for shares in letters.iter_mut().chain([&mut blanks]) {
            shares.iter_mut().zip(&scales).for_each(|(share, scale)| *share /= scale);
        }
        let share = |at: usize, state: usize| {
            if state % 2 == 0 { blanks[at] } else { letters[state / 2][at] }
        };
        let n_states = 2 * word.len() + 1;
        let may_skip = |state: usize| {
            state % 2 == 1 && state >= 3 && word[state / 2] & word[state / 2 - 1] == 0
        };
        let mut forward = vec![vec![0.0; n_states]; n_columns];
        let mut backward = forward.clone();
        for at in 0..n_columns {
            for state in 0..n_states {
                let ways = if at == 0 {
                    f64::from(u8::from(state < 2))
                } else {
                    let before = &forward[at - 1];
                    before[state]
                        + if state > 0 { before[state - 1] } else { 0.0 }
                        + if may_skip(state) { before[state - 2] } else { 0.0 }
                };
                forward[at][state] = ways * share(at, state);
            }
        }
        for at in (0..n_columns).rev() {
            for state in 0..n_states {
                let ways = if at + 1 == n_columns {
                    f64::from(u8::from(state + 2 >= n_states))
                } else {
                    let after = &backward[at + 1];
                    after[state]
                        + if state + 1 < n_states { after[state + 1] } else { 0.0 }
                        + if state + 2 < n_states && may_skip(state + 2) {
                            after[state + 2]
                        } else {
                            0.0
                        }
                };
                backward[at][state] = ways * share(at, state);
            }
        }
        let ln_scale = scales.iter().map(|scale| libm::log(*scale)).sum();
        Self { word, blanks, forward, backward, ln_scale, scales }
    }

    /// Probability of the word, in units of the scale.
    fn total(&self) -> f64 {
        let last = self.forward.last().expect("a strip has columns");
        last[last.len() - 1] + if last.len() > 1 { last[last.len() - 2] } else { 0.0 }
    }

    /// Probability of the word with another letter in one place, in units of the scale.
    fn substituted(&self, index: usize, shares: &[f64], set: Classes) -> f64 {
        let (before, after) = (2 * index, 2 * index + 2);
        let other = |at: Option<&Classes>| at.is_some_and(|letter| letter & set == 0);
        let from_letter = index > 0 && other(self.word.get(index - 1));
        let to_letter = other(self.word.get(index + 1));
        let (mut letter, mut total) = (0.0, 0.0);
        for at in 0..self.blanks.len() {
            let ways = if at == 0 {
                f64::from(u8::from(index == 0))
            } else {
                let left = &self.forward[at - 1];
                letter + left[before] + if from_letter { left[before - 1] } else { 0.0 }
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
}
