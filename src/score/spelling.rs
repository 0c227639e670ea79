//! Spelling model: viewers who know words and names can guess a word that is only partly visible.
//!
//! The model is not a dictionary. It gives the probability of a letter after the preceding four in
//! words and names, interpolated over shorter sequences (Witten and Bell 1991). Its table contains
//! the sequences that matter most (`examples/readings/spelling.py`).

use std::sync::LazyLock;

use super::alphabet::{class_of, latin, with_case_of};
use super::lattice::Choice;
use noctograph_core::statistics::sort_by_number;

/// Number of symbols: one for the start or end of a word, and the 26 letters of the Latin alphabet.
const N_SYMBOLS: usize = 27;

/// Number of preceding letters on which the probability of a letter depends.
const N_BEFORE: usize = 4;

/// Natural logarithm of the backoff factor for each letter dropped from an unlisted sequence.
const LN_BACKOFF: f64 = -0.916;

/// Natural logarithm of probability that corresponds to a cost of 1 in the table.
const LN_UNIT: f64 = -0.05;

/// Weight of the spelling relative to the light, and assumed fraction of randomly spelled words.
const WEIGHT: f64 = 0.6;
const RANDOM: f64 = 0.2;

/// Minimum probability of a letter that is tried.
const LEAST: f64 = 0.001;

/// Probability of "no letter" above which `?` is read, because any letter would be a guess.
const GAP: f64 = 0.75;

/// Width of the search's beam, in words.
const N_WORDS: usize = 64;

/// Natural logarithm of probability per character of a word with a digit: 1 in 36.
const WITH_DIGIT: f64 = -3.58;

/// Natural logarithm of probability assumed for a lone character: the mean over words and names.
const AVERAGE: f64 = -2.2;

/// Letter sequences as sorted numbers in base 27, and their costs.
struct Runs {
    numbers: Vec<usize>,
    costs: &'static [u8],
}

/// The costs of all sequences of three letters, and of the listed sequences of four and of five.
static TABLE: LazyLock<(&[u8], [Runs; 2])> = LazyLock::new(|| {
    let bytes: &'static [u8] = include_bytes!("spelling.bin");
    let (triples, mut bytes) = bytes.split_at(N_SYMBOLS * N_SYMBOLS * N_SYMBOLS);
    let runs = [(), ()].map(|()| {
        let (n, rest) = bytes.split_first_chunk().expect("the table has two lists of runs");
        let n = u32::from_le_bytes(*n) as usize;
        bytes = rest;
        // Each number is stored as its distance from the one before.
        let mut number = 0;
        let numbers = std::iter::repeat_with(|| {
            number += variable_length(&mut bytes);
            number
        });
        let numbers = numbers.take(n).collect();
        let (costs, rest) = bytes.split_at(n);
        bytes = rest;
        Runs { numbers, costs }
    });
    (triples, runs)
});

/// Takes a number from the front of the bytes. Each byte has seven bits of the number, the lowest
/// first, and a bit that is set if another byte follows (LEB128).
fn variable_length(bytes: &mut &[u8]) -> usize {
    let (byte, rest) = bytes.split_first().expect("the table is whole");
    *bytes = rest;
    let low = usize::from(byte & 0x7f);
    if byte & 0x80 == 0 { low } else { low + (variable_length(bytes) << 7) }
}

impl Runs {
    /// Returns the cost of a sequence of symbols in units of [`LN_UNIT`], or `None` if the table
    /// lacks it.
    fn cost(&self, number: usize) -> Option<u8> {
        Some(self.costs[self.numbers.binary_search(&number).ok()?])
    }
}

/// Returns the natural logarithm of the probability of the symbol `next` after four other symbols.
fn ln_p(before: [usize; N_BEFORE], next: usize) -> f64 {
    fn number(run: &[usize]) -> usize {
        run.iter().fold(0, |number, symbol| N_SYMBOLS * number + symbol)
    }
    // The longest sequence in the table is used. Each dropped letter costs a backoff factor.
    let [a, b, c, d] = before;
    let run = [a, b, c, d, next];
    let (triples, [fours, fives]) = &*TABLE;
    let (cost, backoffs) = match (fives.cost(number(&run)), fours.cost(number(&run[1..]))) {
        (Some(cost), _) => (cost, 0.0),
        (None, Some(cost)) => (cost, 1.0),
        (None, None) => (triples[number(&run[2..])], 2.0),
    };
    LN_UNIT * f64::from(cost) + LN_BACKOFF * backoffs
}

/// Returns the symbol of a letter regardless of its marks and case, or `None` for other characters.
fn symbol(letter: char) -> Option<usize> {
    class_of(latin(letter)?.to_ascii_uppercase()).filter(|class| *class < N_SYMBOLS)
}

/// Returns the mean natural logarithm of the probability of the letters and word ends of a text.
pub(super) fn mean_ln_p(text: &str) -> f64 {
    let words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    let (sum, n) = words.fold((0.0, 0.0), |(sum, n), word| {
        // Words with digits have no symbols. The end of a word counts as a letter.
        let symbols: Option<Vec<usize>> = word.chars().map(symbol).collect();
        let n_letters = word.chars().count() as f64 + 1.0;
        let ln_p = match symbols {
            Some(symbols) if symbols.len() > 1 => {
                let ended = symbols.into_iter().chain([0]);
                ended.fold(Spelled::default(), |word, symbol| word.and(symbol, 0.0)).spelling
            }
            Some(_) => n_letters * AVERAGE,
            None => n_letters * if n_letters > 2.0 { WITH_DIGIT } else { AVERAGE },
        };
        (sum + ln_p, n + n_letters)
    });
    sum / n.max(1.0)
}

/// The start of a word: its symbols, and ln p (log probability) of its light and its spelling.
#[derive(Clone, Default)]
struct Spelled {
    symbols: Vec<usize>,
    light: f64,
    spelling: f64,
}

impl Spelled {
    /// Returns the logarithm of the probability of light and spelling together.
    fn ln_p(&self) -> f64 {
        self.light + WEIGHT * self.spelling
    }

    /// Returns the word with one more symbol, which is 0 for the end of the word. `ln_light` is the
    /// logarithm of the symbol's probability in the light.
    fn and(&self, symbol: usize, ln_light: f64) -> Self {
        let n = self.symbols.len();
        let before = std::array::from_fn(|place| {
            (place + n).checked_sub(N_BEFORE).map_or(0, |index| self.symbols[index])
        });
        let mut symbols = self.symbols.clone();
        symbols.push(symbol);
        Self {
            symbols,
            light: self.light + ln_light,
            spelling: self.spelling + ln_p(before, symbol),
        }
    }
}

/// Returns the likeliest word given the choices for its letters: either the likeliest letter at
/// each position, or a common word that fits the light. `?` is light that no letter explains.
pub(super) fn likeliest(choices: &[Choice], expected: &[char]) -> Vec<char> {
    let seen: Vec<(Option<char>, f64)> =
        choices.iter().zip(expected).map(|(choice, expected)| choice.best(*expected)).collect();
    let light = seen.iter().map(|(letter, _)| letter.unwrap_or('?')).collect();
    let Some(spelled) = spell(choices, expected).filter(|_| choices.len() > 1) else {
        return light;
    };
    // Compares the best spelling with random letters (1 in 36 each), judged only by light.
    let n_letters = choices.len() as f64;
    let ln_p_of_light: f64 = seen.iter().map(|(_, p)| libm::log(p.max(LEAST))).sum();
    let as_light = libm::log(RANDOM) + ln_p_of_light - WEIGHT * n_letters * libm::log(36.0);
    if libm::log(1.0 - RANDOM) + spelled.ln_p() <= as_light {
        return light;
    }
    let symbols = spelled.symbols.iter().zip(expected).zip(choices);
    let letters = symbols.map(|((symbol, expected), choice)| {
        let letter = char::from(b"ABCDEFGHIJKLMNOPQRSTUVWXYZ"[symbol - 1]);
        match self::symbol(*expected) {
            _ if choice.none > GAP => '?',
            Some(wanted) if wanted == *symbol => *expected,
            _ => with_case_of(letter, *expected),
        }
    });
    letters.collect()
}

/// Finds the likeliest spelling of the choices by beam search (Lowerre 1976). Spellings contain
/// only letters. Returns `None` if some choice has no likely letter.
fn spell(choices: &[Choice], expected: &[char]) -> Option<Spelled> {
    let mut words = vec![Spelled::default()];
    for (choice, expected) in choices.iter().zip(expected) {
        // Adds up the probability of each symbol. A letter with a mark counts as its base letter.
        let mut light = [0.0; N_SYMBOLS];
        for (letter, p) in choice.others.iter().chain([&(*expected, choice.p)]) {
            if let Some(symbol) = symbol(*letter) {
                light[symbol] += p;
            }
        }
        let likely: Vec<usize> = (1..N_SYMBOLS).filter(|symbol| light[*symbol] > LEAST).collect();
        // Extends every word by each likely symbol, and keeps the likeliest words.
        let longer = words.iter().flat_map(|word| {
            likely.iter().map(|&symbol| word.and(symbol, libm::log(light[symbol])))
        });
        words = longer.collect();
        sort_by_number(&mut words, |word| -word.ln_p());
        words.truncate(N_WORDS);
    }
    let ended =
        words.iter().map(|word| Spelled { symbols: word.symbols.clone(), ..word.and(0, 0.0) });
    ended.reduce(|a, b| if b.ln_p() > a.ln_p() { b } else { a })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the choices of a word whose letters have these probabilities. The remaining
    /// probability of each goes to the other letter, or to no letter for '?'.
    fn choices(letters: &[(char, f64, char)]) -> Vec<Choice> {
        let choices = letters.iter().map(|&(_, p, other)| match other {
            '?' => Choice { p, none: 1.0 - p, others: Vec::new() },
            _ => Choice { p, none: 0.0, others: vec![(other, 1.0 - p)] },
        });
        choices.collect()
    }

    fn read(letters: &[(char, f64, char)]) -> String {
        let expected: Vec<char> = letters.iter().map(|(letter, ..)| *letter).collect();
        likeliest(&choices(letters), &expected).into_iter().collect()
    }

    #[test]
    fn a_half_seen_letter_is_what_spells_a_word() {
        let [h, o, s, e] = ['H', 'O', 'S', 'E'].map(|c| (c, 0.99, 'Q'));
        let word = |third| [h, o, third, s, e];
        assert_eq!(read(&word(('U', 0.3, 'D'))), "HOUSE");
        assert_eq!(read(&word(('D', 0.7, 'U'))), "HOUSE", "expected or not");
        assert_eq!(read(&word(('U', 0.3, '?'))), "HOUSE", "a part is missing");
        assert_eq!(read(&word(('U', 0.1, '?'))), "HO?SE", "nothing is there");
        assert_eq!(read(&word(('D', 0.9999, 'U'))), "HODSE", "clear light is believed");
        let zoe = [('Z', 0.9, '2'), ('o', 0.9, 'D'), ('ë', 0.9, 'F')];
        assert_eq!(read(&zoe), "Zoë");
    }

    #[test]
    fn the_table_is_whole() {
        let (triples, runs) = &*TABLE;
        assert_eq!(triples.len(), 27_usize.pow(3));
        for (runs, (n, letters)) in runs.iter().zip([(24_000, 4), (44_000, 5)]) {
            assert_eq!((runs.numbers.len(), runs.costs.len()), (n, n));
            assert!(runs.numbers.is_sorted_by(|a, b| a < b));
            assert!(runs.numbers.last().is_some_and(|last| *last < 27_usize.pow(letters)));
        }
        let mut bytes: &[u8] = &[0x05, 0x80, 0x01, 0xff, 0xff, 0x03];
        let numbers: Vec<usize> = (0..3).map(|_| variable_length(&mut bytes)).collect();
        assert_eq!(numbers, [5, 128, 65_535]);
    }

    #[test]
    fn words_are_more_usual_than_letters_at_random() {
        let usual = mean_ln_p("HOUSE");
        assert!(usual > mean_ln_p("XKQJW") + 1.5);
        assert!(usual > mean_ln_p("4711") && mean_ln_p("4711") > mean_ln_p("XKQJW"));
        assert_eq!(mean_ln_p("Zoë"), mean_ln_p("ZOE"));
        let [both, first, second] = ["on air!", "on", "air"].map(mean_ln_p);
        assert!((both - (3.0 * first + 4.0 * second) / 7.0).abs() < 1e-12, "{both}");
        assert_eq!(mean_ln_p("C"), mean_ln_p("7"));
    }

    #[test]
    fn letters_and_digits_at_random_are_read_as_they_are() {
        for text in ["XKCD", "8052", "B52", "QZWJV"] {
            let clear: Vec<_> = text.chars().map(|c| (c, 0.97, 'E')).collect();
            assert_eq!(read(&clear), text);
        }
    }

    #[test]
    fn each_letter_has_a_probability_and_all_together_no_more_than_twice_one() {
        for before in [[0; 4], [0, 0, 0, 20], [0, 20, 8, 5], [17, 17, 26, 24]] {
            let sum: f64 = (0..N_SYMBOLS).map(|next| libm::exp(ln_p(before, next))).sum();
            assert!((0.1..2.0).contains(&sum), "{before:?}: {sum}");
        }
    }
}
