//! Unconstrained reading of a strip: the likeliest words, without an expected one.

use super::alphabet::{BLANK, Classes, NO_LETTER};
use super::lattice::Columns;

/// Width of the beam, in prefixes. A wider beam does not change the words that are found.
const N_PREFIXES: usize = 12;

/// Minimum probability of a character that is tried at a column.
const LEAST_STEP: f64 = 0.003;

/// The characters that are possible at a position, each with its classes.
pub(super) type Symbols = [(char, Classes)];

/// Probabilities that the columns so far spell a prefix and end in a blank and in a letter,
/// respectively.
#[derive(Clone, Copy, Default)]
struct PrefixP {
    p_blank: f64,
    p_nonblank: f64,
}

impl PrefixP {
    fn sum(self) -> f64 {
        self.p_blank + self.p_nonblank
    }
}

/// Characters of the symbols, and probabilities of the symbols at each column.
struct Table {
    names: Vec<char>,
    probabilities: Vec<Vec<f64>>,
    /// The symbols that are tried at each column.
    likely: Vec<Vec<usize>>,
}

impl Table {
    /// Computes the probabilities of symbols, including `?` for light that no letter explains, and
    /// lists the likely symbols of each column.
    fn new(columns: &Columns, symbols: &Symbols) -> Self {
        let extended = symbols.iter().copied().chain([('?', NO_LETTER)]);
        let (names, probabilities): (_, Vec<Vec<f64>>) =
            extended.map(|(name, set)| (name, columns.of_set(set))).unzip();
        // Less probable symbols are never tried, which keeps the search short.
        let likely = (0..columns.0.len()).map(|column| {
            let indices = 0..probabilities.len();
            indices.filter(|index| probabilities[*index][column] > LEAST_STEP).collect()
        });
        Self { names, likely: likely.collect(), probabilities }
    }
}

/// A node of the tree of prefixes.
#[derive(Default)]
struct Prefix {
    /// Index of the prefix without its last symbol.
    parent: usize,
    /// Index of the prefix's last symbol in its table.
    symbol: usize,
    /// Indices of the prefix's newest child and of its next older sibling, or 0 if there is none.
    child: usize,
    sibling: usize,
}

/// The tree of all prefixes that were tried. Index 0 is the empty prefix.
struct Prefixes(Vec<Prefix>);

impl Prefixes {
    /// Returns the prefix with one more symbol, which is added to the tree if it is new.
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

    /// Returns a prefix's last symbol, and whether it is also the first. Returns `None` for the
    /// empty prefix.
    fn last(&self, prefix: usize) -> Option<(usize, bool)> {
        let Prefix { parent, symbol, .. } = self.0[prefix];
        (prefix != 0).then_some((symbol, parent == 0))
    }

    /// Returns a prefix as text. The first symbol is in the table `first`, and the others are in
    /// `rest`.
    fn text(&self, mut prefix: usize, first: &Table, rest: &Table) -> String {
        let mut reversed = Vec::new();
        while let Some((symbol, is_first)) = self.last(prefix) {
            reversed.push(if is_first { first } else { rest }.names[symbol]);
            prefix = self.0[prefix].parent;
        }
        reversed.into_iter().rev().collect()
    }
}

/// Finds the likeliest words by prefix beam search (Hannun and others 2014). The words' first
/// character is from `first`, the others are from `rest`, and `?` stands for light that no letter
/// explains. Returns the words with the logarithms of their probabilities, likeliest first.
pub(super) fn search(columns: &Columns, first: &Symbols, rest: &Symbols) -> Vec<(String, f64)> {
    let [first, rest] = [first, rest].map(|symbols| Table::new(columns, symbols));
    let mut prefixes = Prefixes(vec![Prefix::default()]);
    let mut beam = vec![(0, PrefixP { p_blank: 1.0, p_nonblank: 0.0 })];
    let mut ln_scale = 0.0;
    let mut steps: Vec<(usize, PrefixP)> = Vec::new();
    for (column, p_blank) in columns.of_set(BLANK).into_iter().enumerate() {
        steps.clear();
        for (prefix, p) in &beam {
            // A blank, or a repetition of the last symbol, leaves the prefix unchanged.
            let last = prefixes.last(*prefix).map(|(symbol, is_first)| {
                let table = if is_first { &first } else { &rest };
                (table.names[symbol], table.probabilities[symbol][column])
            });
            let stay = PrefixP {
                p_blank: p.sum() * p_blank,
                p_nonblank: p.p_nonblank * last.map_or(0.0, |(_, p_symbol)| p_symbol),
            };
            steps.push((*prefix, stay));
            // A symbol extends the prefix. If it repeats the last one, a blank must separate them.
            let table = if last.is_none() { &first } else { &rest };
            for &symbol in &table.likely[column] {
                let repeats = last.is_some_and(|(name, _)| name == table.names[symbol]);
                let before = if repeats { p.p_blank } else { p.sum() };
                let p_nonblank = before * table.probabilities[symbol][column];
                let grown = prefixes.child(*prefix, symbol);
                steps.push((grown, PrefixP { p_blank: 0.0, p_nonblank }));
            }
        }
        // Unless a symbol is likely, every step leads to another prefix.
        if steps.len() == beam.len() {
            std::mem::swap(&mut steps, &mut beam);
        } else {
            merge(&mut steps, &mut beam);
        }
        // Keeps the likeliest prefixes, scaled by the first one so that products stay in range.
        beam.sort_by(|a, b| b.1.sum().total_cmp(&a.1.sum()).then(a.0.cmp(&b.0)));
        beam.truncate(N_PREFIXES);
        let most = beam.first().map_or(1.0, |(_, p)| p.sum());
        for (_, p) in &mut beam {
            (p.p_blank, p.p_nonblank) = (p.p_blank / most, p.p_nonblank / most);
        }
        ln_scale += libm::log(most);
    }
    let words = beam.iter().map(|(prefix, _)| prefixes.text(*prefix, &first, &rest));
    words.zip(beam.iter().map(|(_, p)| libm::log(p.sum()) + ln_scale)).collect()
}

/// Sums the probabilities of the steps that lead to each prefix, and stores the sums in the beam.
fn merge(steps: &mut [(usize, PrefixP)], beam: &mut Vec<(usize, PrefixP)>) {
    steps.sort_by_key(|(prefix, _)| *prefix);
    beam.clear();
    for &(prefix, p) in &*steps {
        match beam.last_mut() {
            Some((last, sum)) if *last == prefix => {
                sum.p_blank += p.p_blank;
                sum.p_nonblank += p.p_nonblank;
            }
            _ => beam.push((prefix, p)),
        }
    }
}
