//! Free reading of a strip: the likeliest words, none being expected.

use super::alphabet::{BLANK, Classes, NO_LETTER};
use super::lattice::Columns;

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
    /// The symbols that are tried at each column.
    tried: Vec<Vec<usize>>,
}

impl Table {
    fn new(columns: &Columns, symbols: &Symbols) -> Self {
        let all = symbols.iter().copied().chain([('?', NO_LETTER)]);
        let (names, shares): (_, Vec<Vec<f64>>) =
            all.map(|(name, set)| (name, columns.shares(set))).unzip();
        let tried = (0..columns.0.len()).map(|column| {
            (0..shares.len()).filter(|symbol| shares[*symbol][column] > LEAST_STEP).collect()
        });
        Self { names, tried: tried.collect(), shares }
    }
}

/// A prefix that was tried.
#[derive(Default)]
struct Prefix {
    /// The one without its last symbol.
    before: usize,
    /// Index of its last symbol in its table.
    symbol: usize,
    /// The newest of those that are longer by one, and the next older one beside it; 0 for none.
    longer: usize,
    beside: usize,
}

/// All prefixes that were tried: a step takes the same time however long they are. 0 is the empty
/// one.
struct Prefixes(Vec<Prefix>);

impl Prefixes {
    fn and(&mut self, before: usize, symbol: usize) -> usize {
        let mut known = self.0[before].longer;
        while known != 0 && self.0[known].symbol != symbol {
            known = self.0[known].beside;
        }
        if known == 0 {
            known = self.0.len();
            let beside = std::mem::replace(&mut self.0[before].longer, known);
            self.0.push(Prefix { before, symbol, longer: 0, beside });
        }
        known
    }

    /// The symbol that a prefix ends with, and whether it is the first.
    fn last(&self, prefix: usize) -> Option<(usize, bool)> {
        let Prefix { before, symbol, .. } = self.0[prefix];
        (prefix != 0).then_some((symbol, before == 0))
    }

    fn text(&self, mut prefix: usize, first: &Table, rest: &Table) -> String {
        let mut reversed = Vec::new();
        while let Some((symbol, is_first)) = self.last(prefix) {
            reversed.push(if is_first { first } else { rest }.names[symbol]);
            prefix = self.0[prefix].before;
        }
        reversed.into_iter().rev().collect()
    }
}

/// The likeliest words whose first character is of `first` and whose others are of `rest`, with ln
/// of their probability, the likeliest first; `?` is light beside letters (prefix beam search,
/// Hannun and others 2014).
pub(super) fn search(columns: &Columns, first: &Symbols, rest: &Symbols) -> Vec<(String, f64)> {
    let [first, rest] = [first, rest].map(|symbols| Table::new(columns, symbols));
    let blanks = columns.shares(BLANK);
    let mut tried = Prefixes(vec![Prefix::default()]);
    let mut beam = vec![(0, Ends { in_blank: 1.0, in_letter: 0.0 })];
    let mut ln_scale = 0.0;
    let mut steps: Vec<(usize, Ends)> = Vec::new();
    for (column, blank) in blanks.iter().enumerate() {
        steps.clear();
        for (prefix, ends) in &beam {
            let last = tried.last(*prefix);
            let own = last.map(|(symbol, is_first)| {
                let table = if is_first { &first } else { &rest };
                (table.names[symbol], table.shares[symbol][column])
            });
            let in_letter = ends.in_letter * own.map_or(0.0, |(_, share)| share);
            steps.push((*prefix, Ends { in_blank: ends.sum() * blank, in_letter }));
            let table = if last.is_none() { &first } else { &rest };
            for &symbol in &table.tried[column] {
                // A letter follows itself after a blank only.
                let again = own.is_some_and(|(own, _)| own == table.names[symbol]);
                let from = if again { ends.in_blank } else { ends.sum() };
                let in_letter = from * table.shares[symbol][column];
                steps.push((tried.and(*prefix, symbol), Ends { in_blank: 0.0, in_letter }));
            }
        }
        // Stable, so that sums are always taken in the same order.
        steps.sort_by_key(|(prefix, _)| *prefix);
        beam.clear();
        for &(prefix, ends) in &steps {
            match beam.last_mut() {
                Some((last, sum)) if *last == prefix => {
                    sum.in_blank += ends.in_blank;
                    sum.in_letter += ends.in_letter;
                }
                _ => beam.push((prefix, ends)),
            }
        }
        beam.sort_by(|a, b| b.1.sum().total_cmp(&a.1.sum()));
        beam.truncate(N_PREFIXES);
        let most = beam.first().map_or(1.0, |(_, ends)| ends.sum());
        for (_, ends) in &mut beam {
            (ends.in_blank, ends.in_letter) = (ends.in_blank / most, ends.in_letter / most);
        }
        ln_scale += libm::log(most);
    }
    let words = beam.iter().map(|(prefix, _)| tried.text(*prefix, &first, &rest));
    words.zip(beam.iter().map(|(_, ends)| libm::log(ends.sum()) + ln_scale)).collect()
}
