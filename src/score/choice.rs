//! Choices: the probability that columns spell a word, and the shares of all letters in each place.

use super::alphabet::{Classes, NO_LETTER, in_case_of, names};
use super::columns::Columns;
use super::lattice::Lattice;

/// What is seen in the place of one letter, the other letters being right.
pub(super) struct Choice {
    /// Share of the expected letter.
    pub(super) p: f64,
    /// Share of light that is no letter, or of nothing.
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
            other.map_or((expected, self.p), |(letter, p)| (in_case_of(*letter, expected), *p));
        if self.none > most { (None, self.none) } else { (Some(letter), most) }
    }
}

impl Columns {
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

    /// For each letter of a word, what is seen in its place; `digits` says which of them are
    /// digits.
    pub(super) fn choices(&self, word: &[Classes], digits: &[bool]) -> Vec<Choice> {
        let lattice = Lattice::new(self, word);
        let own = lattice.total();
        let choice = |index: usize| {
            let expected = word[index];
            let replaced = |set| lattice.replaced(index, &self.shares(set), set);
            let none = replaced(NO_LETTER & !expected) + lattice.without(index);
            let others = names(expected, digits[index]).into_iter();
            let mut others: Vec<(char, f64)> =
                others.map(|(name, set)| (name, replaced(set))).collect();
            let sum = own + none + others.iter().map(|(_, p)| p).sum::<f64>();
            if sum <= 0.0 {
                // Every way through the columns is too unlikely for a number.
                return Choice { p: 0.0, none: 1.0, others: Vec::new() };
            }
            others.iter_mut().for_each(|(_, p)| *p /= sum);
            others.sort_by(|a, b| b.1.total_cmp(&a.1));
            Choice { p: own / sum, none: none / sum, others }
        };
        (0..word.len()).map(choice).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::alphabet::{BLANK, class_of, classes_of};
    use super::super::net::N_CLASSES;
    use super::*;

    /// Columns that show a character each, ' ' the blank, with a share of 0.9; the rest is spread.
    fn columns(text: &str) -> Columns {
        let column = |c: char| {
            let mut column = [0.1 / (N_CLASSES - 1) as f64; N_CLASSES];
            column[class_of(c).unwrap_or(0)] = 0.9;
            column
        };
        Columns(text.chars().map(column).collect())
    }

    fn word(text: &str) -> Vec<Classes> {
        text.chars().map(|c| classes_of(c).unwrap()).collect()
    }

    /// The probability of a word by trying all sequences of its symbols, column by column.
    fn by_trial(columns: &Columns, word: &[Classes]) -> f64 {
        let symbols = |code: usize| -> Vec<usize> {
            let n = word.len() + 1;
            (0..columns.0.len()).map(|at| code / n.pow(u32::try_from(at).unwrap()) % n).collect()
        };
        let spells = |path: &[usize]| {
            let mut read = Vec::new();
            for (at, symbol) in path.iter().enumerate() {
                if *symbol > 0 && (at == 0 || path[at - 1] != *symbol) {
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
            .map(|path| path.iter().enumerate().map(|(at, s)| shares[*s][at]).product::<f64>())
            .sum()
    }

    #[test]
    fn the_lattice_sums_all_ways_that_spell_a_word() {
        let columns = columns("N  OR");
        for text in ["NOR", "NO", "OR", "N"] {
            let (found, wanted) = (columns.ln_p(&word(text)), by_trial(&columns, &word(text)));
            assert!(
                (found - libm::log(wanted)).abs() < 1e-9,
                "{text}: {found}, {}",
                libm::log(wanted)
            );
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
                let found = libm::log(replaced / lattice.total());
                assert!((found - wanted).abs() < 1e-9, "{text:?}: {found}, {wanted}");
            }
        }
    }

    #[test]
    fn shares_of_a_place_add_up_and_name_what_is_there() {
        let columns = columns("N O O P ");
        let choices = columns.choices(&word("NOOR"), &[false; 4]);
        for choice in &choices {
            let sum = choice.p + choice.none + choice.others.iter().map(|(_, p)| p).sum::<f64>();
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
        }
        let last = &choices[3];
        assert!(last.others[0].0 == 'P' && last.others[0].1 > 0.9, "{:?}", last.others);
        assert!(choices[0].p > 0.9);
    }
}
