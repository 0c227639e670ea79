//! Free reading of a strip: the likeliest words, none being expected.

use std::collections::BTreeMap;

use super::alphabet::{BLANK, Classes, NO_LETTER};
use super::columns::Columns;

/// Prefixes that are followed at once. More find no other words.
const N_PREFIXES: usize = 12;

/// Share of a character at a column from which it is tried there.
const LEAST_STEP: f64 = 0.003;

/// Characters that a place may have, each with its classes.
pub(super) type Symbols = [(char, Classes)];

/// Probabilities that the columns so far spell a prefix.
#[derive(Clone, Copy, Default)]
struct Ends {
    in_blank: f64,
    in_letter: f64,
}

/// Names of some symbols and their shares at each column.
struct Table {
    names: Vec<char>,
    shares: Vec<Vec<f64>>,
}

impl Table {
    fn new(columns: &Columns, symbols: &Symbols) -> Self {
        let all = || symbols.iter().copied().chain([('?', NO_LETTER)]);
        Self {
            names: all().map(|(name, _)| name).collect(),
            shares: all().map(|(_, set)| columns.shares(set)).collect(),
        }
    }

    /// Shares of a name, at each column.
    fn shares_of(&self, name: char) -> Option<&[f64]> {
        self.names.iter().position(|known| *known == name).map(|at| &self.shares[at][..])
    }
}

/// The likeliest words whose first character is of `first` and whose others are of `rest`, with ln of
/// their probability, the likeliest first; `?` is light that is no letter (prefix beam search, Hannun
/// and others 2014).
pub(super) fn search(columns: &Columns, first: &Symbols, rest: &Symbols) -> Vec<(String, f64)> {
    let [first, rest] = [first, rest].map(|symbols| Table::new(columns, symbols));
    let blanks = columns.shares(BLANK);
    let mut prefixes = vec![(String::new(), Ends { in_blank: 1.0, in_letter: 0.0 })];
    let mut ln_scale = 0.0;
    for (at, blank) in blanks.iter().enumerate() {
        let mut next: BTreeMap<String, Ends> = BTreeMap::new();
        for (prefix, Ends { in_blank, in_letter }) in &prefixes {
            let both = in_blank + in_letter;
            let last = prefix.chars().next_back();
            let is_first = prefix.chars().nth(1).is_none();
            let of_last = if is_first { &first } else { &rest };
            let again = last.and_then(|last| of_last.shares_of(last)).map_or(0.0, |own| own[at]);
            let same = next.entry(prefix.clone()).or_default();
            same.in_blank += both * blank;
            same.in_letter += in_letter * again;
            let table = if last.is_none() { &first } else { &rest };
            for (name, shares) in table.names.iter().zip(&table.shares) {
                if shares[at] <= LEAST_STEP {
                    continue;
                }
                // A letter follows itself after a blank only.
                let from = if last == Some(*name) { *in_blank } else { both };
                let longer = format!("{prefix}{name}");
                next.entry(longer).or_default().in_letter += from * shares[at];
            }
        }
        let sum = |ends: &Ends| ends.in_blank + ends.in_letter;
        prefixes = next.into_iter().collect();
        prefixes.sort_by(|a, b| sum(&b.1).total_cmp(&sum(&a.1)));
        prefixes.truncate(N_PREFIXES);
        let most = prefixes.first().map_or(1.0, |(_, ends)| sum(ends));
        for (_, ends) in &mut prefixes {
            (ends.in_blank, ends.in_letter) = (ends.in_blank / most, ends.in_letter / most);
        }
        ln_scale += libm::log(most);
    }
    let ln_p = |ends: Ends| libm::log(ends.in_blank + ends.in_letter) + ln_scale;
    prefixes.into_iter().map(|(text, ends)| (text, ln_p(ends))).collect()
}
