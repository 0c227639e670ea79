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

impl Ends {
    fn sum(self) -> f64 {
        self.in_blank + self.in_letter
    }
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
}

/// All prefixes that were tried, each as the one before it and the index of its last symbol in its
/// table: a step takes the same time however long the prefixes are. 0 is the empty one.
struct Prefixes {
    nodes: Vec<(usize, usize)>,
    longer: BTreeMap<(usize, usize), usize>,
}

impl Prefixes {
    fn and(&mut self, prefix: usize, symbol: usize) -> usize {
        let nodes = &mut self.nodes;
        *self.longer.entry((prefix, symbol)).or_insert_with(|| {
            nodes.push((prefix, symbol));
            nodes.len() - 1
        })
    }

    /// The symbol that a prefix ends with, and whether it is the first.
    fn last(&self, prefix: usize) -> Option<(usize, bool)> {
        let (before, symbol) = self.nodes[prefix];
        (prefix != 0).then_some((symbol, before == 0))
    }

    fn text(&self, mut prefix: usize, first: &Table, rest: &Table) -> String {
        let mut reversed = Vec::new();
        while let Some((symbol, is_first)) = self.last(prefix) {
            reversed.push(if is_first { first } else { rest }.names[symbol]);
            prefix = self.nodes[prefix].0;
        }
        reversed.into_iter().rev().collect()
    }
}

/// The likeliest words whose first character is of `first` and whose others are of `rest`, with ln of
/// their probability, the likeliest first; `?` is light that is no letter (prefix beam search, Hannun
/// and others 2014).
pub(super) fn search(columns: &Columns, first: &Symbols, rest: &Symbols) -> Vec<(String, f64)> {
    let [first, rest] = [first, rest].map(|symbols| Table::new(columns, symbols));
    let blanks = columns.shares(BLANK);
    let mut tried = Prefixes { nodes: vec![(0, 0)], longer: BTreeMap::new() };
    let mut beam = vec![(0, Ends { in_blank: 1.0, in_letter: 0.0 })];
    let mut ln_scale = 0.0;
    for (at, blank) in blanks.iter().enumerate() {
        let mut next: BTreeMap<usize, Ends> = BTreeMap::new();
        for (prefix, ends) in &beam {
            let last = tried.last(*prefix);
            let own = last.map(|(symbol, is_first)| {
                let table = if is_first { &first } else { &rest };
                (table.names[symbol], table.shares[symbol][at])
            });
            let same = next.entry(*prefix).or_default();
            same.in_blank += ends.sum() * blank;
            same.in_letter += ends.in_letter * own.map_or(0.0, |(_, share)| share);
            let table = if last.is_none() { &first } else { &rest };
            for (symbol, (name, shares)) in table.names.iter().zip(&table.shares).enumerate() {
                if shares[at] <= LEAST_STEP {
                    continue;
                }
                // A letter follows itself after a blank only.
                let again = own.is_some_and(|(own, _)| own == *name);
                let from = if again { ends.in_blank } else { ends.sum() };
                next.entry(tried.and(*prefix, symbol)).or_default().in_letter += from * shares[at];
            }
        }
        beam = next.into_iter().collect();
        beam.sort_by(|a, b| b.1.sum().total_cmp(&a.1.sum()));
        beam.truncate(N_PREFIXES);
        let most = beam.first().map_or(1.0, |(_, ends)| ends.sum());
        for (_, ends) in &mut beam {
            (ends.in_blank, ends.in_letter) = (ends.in_blank / most, ends.in_letter / most);
        }
        ln_scale += libm::log(most);
    }
    let found = beam.into_iter().map(|(prefix, ends)| {
        (tried.text(prefix, &first, &rest), libm::log(ends.sum()) + ln_scale)
    });
    found.collect()
}
