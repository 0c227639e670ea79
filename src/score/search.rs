//! Free reading of a strip: the likeliest words, none being expected.

use super::alphabet::{BLANK, Classes, NO_LETTER};
use super::lattice::Columns;

/// Prefixes that are followed at once. More find no other words.
const N_PREFIXES: usize = 12;

/// Probability of a character at a column from which it is tried there.
const LEAST_STEP: f64 = 0.003;

/// Characters that a place may have, each with its classes.
pub(super) type Symbols = [(char, Classes)];

/// Probabilities that the columns so far spell a prefix, by what the last of them shows.
#[derive(Clone, Copy, Default)]
struct Ends {
    p_blank: f64,
    p_nonblank: f64,
}

impl Ends {
    fn sum(self) -> f64 {
        self.p_blank + self.p_nonblank
    }
}

/// Names of some symbols and their probabilities at each column.
struct Table {
    names: Vec<char>,
    probabilities: Vec<Vec<f64>>,
    /// The symbols that are tried at each column.
    likely: Vec<Vec<usize>>,
}

impl Table {
    fn new(columns: &Columns, symbols: &Symbols) -> Self {
        let symbols = symbols.iter().copied().chain([('?', NO_LETTER)]);
        let (names, probabilities): (_, Vec<Vec<f64>>) =
            symbols.map(|(name, set)| (name, columns.of_set(set))).unzip();
        let likely = (0..columns.0.len()).map(|column| {
            let symbols = 0..probabilities.len();
            symbols.filter(|symbol| probabilities[*symbol][column] > LEAST_STEP).collect()
        });
        Self { names, likely: likely.collect(), probabilities }
    }
}

/// A node of the tree of prefixes.
#[derive(Default)]
struct Prefix {
    /// The one without its last symbol.
    parent: usize,
    /// Index of its last symbol in its table.
    symbol: usize,
    /// Its newest child, and the next older child of its parent, or 0 for none.
    child: usize,
    sibling: usize,
}

/// The tree of all prefixes that were tried. 0 is the empty one.
struct Prefixes(Vec<Prefix>);

impl Prefixes {
    /// A prefix with one more symbol.
    fn child(&mut self, parent: usize, symbol: usize) -> usize {
        let mut child = self.0[parent].child;
        while child != 0 && self.0[child].symbol != symbol {
            child = self.0[child].sibling;
        }
        if child == 0 {
            child = self.0.len();
            let sibling = std::mem::replace(&mut self.0[parent].child, child);
            self.0.push(Prefix { parent, symbol, child: 0, sibling });
        }
        child
    }

    /// The symbol that a prefix ends with, and true if it is the first.
    fn last(&self, prefix: usize) -> Option<(usize, bool)> {
        let Prefix { parent, symbol, .. } = self.0[prefix];
        (prefix != 0).then_some((symbol, parent == 0))
    }

    fn text(&self, mut prefix: usize, first: &Table, rest: &Table) -> String {
        let mut reversed = Vec::new();
        while let Some((symbol, is_first)) = self.last(prefix) {
            reversed.push(if is_first { first } else { rest }.names[symbol]);
            prefix = self.0[prefix].parent;
        }
        reversed.into_iter().rev().collect()
    }
}

/// The likeliest words whose first character is of `first` and whose others are of `rest`, with ln
/// of their probability, the likeliest first. `?` is light beside letters.
///
/// Prefix beam search (Hannun and others 2014).
pub(super) fn search(columns: &Columns, first: &Symbols, rest: &Symbols) -> Vec<(String, f64)> {
    let [first, rest] = [first, rest].map(|symbols| Table::new(columns, symbols));
    let mut prefixes = Prefixes(vec![Prefix::default()]);
    let mut beam = vec![(0, Ends { p_blank: 1.0, p_nonblank: 0.0 })];
    let mut ln_scale = 0.0;
    let mut steps: Vec<(usize, Ends)> = Vec::new();
    for (column, p_blank) in columns.of_set(BLANK).into_iter().enumerate() {
        steps.clear();
        for (prefix, ends) in &beam {
            // The prefix stays what it is by a blank, or by its last symbol once more.
            let last = prefixes.last(*prefix).map(|(symbol, is_first)| {
                let table = if is_first { &first } else { &rest };
                (table.names[symbol], table.probabilities[symbol][column])
            });
            let stay = Ends {
                p_blank: ends.sum() * p_blank,
                p_nonblank: ends.p_nonblank * last.map_or(0.0, |(_, p)| p),
            };
            steps.push((*prefix, stay));
            // It grows by a symbol. Its last one only follows after a blank.
            let table = if last.is_none() { &first } else { &rest };
            for &symbol in &table.likely[column] {
                let repeats = last.is_some_and(|(name, _)| name == table.names[symbol]);
                let before = if repeats { ends.p_blank } else { ends.sum() };
                let p_nonblank = before * table.probabilities[symbol][column];
                let grown = prefixes.child(*prefix, symbol);
                steps.push((grown, Ends { p_blank: 0.0, p_nonblank }));
            }
        }
        merge(&mut steps, &mut beam);
        // The likeliest prefixes stay, divided by the first so that products stay in range.
        beam.sort_by(|a, b| b.1.sum().total_cmp(&a.1.sum()));
        beam.truncate(N_PREFIXES);
        let most = beam.first().map_or(1.0, |(_, ends)| ends.sum());
        for (_, ends) in &mut beam {
            (ends.p_blank, ends.p_nonblank) = (ends.p_blank / most, ends.p_nonblank / most);
        }
        ln_scale += libm::log(most);
    }
    let words = beam.iter().map(|(prefix, _)| prefixes.text(*prefix, &first, &rest));
    words.zip(beam.iter().map(|(_, ends)| libm::log(ends.sum()) + ln_scale)).collect()
}

/// Adds up the steps to the same prefix.
fn merge(steps: &mut [(usize, Ends)], beam: &mut Vec<(usize, Ends)>) {
    steps.sort_by_key(|(prefix, _)| *prefix);
    beam.clear();
    for &(prefix, ends) in &*steps {
        match beam.last_mut() {
            Some((last, sum)) if *last == prefix => {
                sum.p_blank += ends.p_blank;
                sum.p_nonblank += ends.p_nonblank;
            }
            _ => beam.push((prefix, ends)),
        }
    }
}
