//! The judgment of a word's strips: what is seen in the place of each letter, the likeliest other
//! word, and the readability.

use super::alphabet::{Classes, classes_of, in_case_of, names, same_shapes, seen_as};
use super::calibration::readability;
use super::choice::Choice;
use super::columns::Columns;
use super::net;
use super::pairs;
use super::search::search;
use super::strip::Strip;
use super::verdict::{LetterVerdict, Rival, RivalWord};
use crate::letters::Strokes;

/// Shares below this are left out of a letter's row of confusions.
const LEAST_SHARE: f64 = 0.001;

/// Rivals that a letter names.
const N_RIVALS: usize = 3;

/// Free readings that are tried as rivals.
const N_FREE: usize = 2;

/// A word that strips are expected to show, without its punctuation.
pub(super) struct Expected {
    /// Index of each judged character in the word.
    pub(super) indices: Vec<usize>,
    characters: Vec<char>,
    /// The classes that count as each character.
    classes: Vec<Classes>,
    digits: Vec<bool>,
    /// Mean of ln p over its pairs of letters.
    ln_p_of_pairs: f64,
}

/// What strips show of a word.
pub(super) struct Judgment {
    /// By judged character.
    pub(super) choices: Vec<Choice>,
    pub(super) rival: Option<RivalWord>,
    pub(super) readability: f64,
}

impl Expected {
    pub(super) fn new(strokes: &Strokes) -> Self {
        let characters = || strokes.glyphs.iter().map(|glyph| glyph.character).enumerate();
        let known = || characters().filter_map(|(at, c)| Some((at, c, classes_of(c)?)));
        Self {
            indices: known().map(|(at, ..)| at).collect(),
            characters: known().map(|(_, c, _)| c).collect(),
            classes: known().map(|(.., classes)| classes).collect(),
            digits: known().map(|(_, c, _)| c.is_ascii_digit()).collect(),
            ln_p_of_pairs: pairs::mean_ln_p(&strokes.word),
        }
    }

    /// What is seen in the place of each judged character.
    pub(super) fn choices(&self, strips: &[Strip]) -> Vec<Choice> {
        columns(strips).choices(&self.classes, &self.digits)
    }

    pub(super) fn judge(&self, strips: &[Strip]) -> Judgment {
        let columns = columns(strips);
        let choices = columns.choices(&self.classes, &self.digits);
        let rival = self.rival(&columns, &choices);
        let against = rival.as_ref().map_or(f64::INFINITY, |(_, ln_odds)| -ln_odds);
        let readability = readability(&choices, against, self.ln_p_of_pairs);
        let rival =
            rival.map(|(word, ln_odds)| RivalWord { word, p: 1.0 / (1.0 + libm::exp(-ln_odds)) });
        Judgment { choices, rival, readability }
    }

    /// The likeliest other word, with one letter replaced or as a free reading has it, and ln of its
    /// odds against the expected one.
    fn rival(&self, columns: &Columns, choices: &[Choice]) -> Option<(String, f64)> {
        let by_letter = choices.iter().enumerate().filter_map(|(index, choice)| {
            let &(letter, p) = choice.others.first()?;
            let mut rival = self.characters.clone();
            rival[index] = in_case_of(letter, rival[index]);
            Some((rival.into_iter().collect::<String>(), libm::log(p / choice.p.max(1e-300))))
        });
        let own = columns.ln_p(&self.classes);
        let all = names(0, self.digits.iter().all(|digit| *digit));
        let free = search(columns, &all, &all).into_iter().map(|(text, _)| text);
        let free = free.filter(|text| !text.is_empty() && !self.spells(text)).take(N_FREE);
        let free = free.map(|text| {
            let ln_p = columns.ln_p(&text.chars().map(seen_as).collect::<Vec<_>>());
            let last = self.characters.len() - 1;
            let named = text.chars().enumerate();
            let named = named.map(|(at, c)| in_case_of(c, self.characters[at.min(last)]));
            (named.collect(), ln_p - own)
        });
        let all = by_letter.chain(free).filter(|(_, ln_odds)| !ln_odds.is_nan());
        all.reduce(|a, b| if b.1 > a.1 { b } else { a })
    }

    /// Whether a text is the word, equal shapes being equal.
    fn spells(&self, text: &str) -> bool {
        let read: Vec<Classes> = text.chars().map(seen_as).collect();
        same_shapes(&self.classes, &read)
    }
}

/// The shares at each column of some strips.
fn columns(strips: &[Strip]) -> Columns {
    Columns::joined(strips.iter().map(|strip| Columns::from_logits(&net::logits(strip))))
}

/// The verdict on one letter.
pub(super) fn letter_verdict(choice: &Choice, expected: char) -> LetterVerdict {
    let rival = |(letter, p): &(char, f64)| Rival { letter: in_case_of(*letter, expected), p: *p };
    let first = choice.others.first();
    let most = first.map_or(choice.p, |(_, p)| p.max(choice.p));
    let best = match first {
        _ if choice.none > most => None,
        Some((other, p)) if *p > choice.p => Some(in_case_of(*other, expected)),
        _ => Some(expected),
    };
    let likely = choice.others.iter().filter(|other| other.1 >= LEAST_SHARE).map(rival);
    let mut confusion: Vec<Rival> =
        [Rival { letter: expected, p: choice.p }].into_iter().chain(likely).collect();
    confusion.sort_by(|a, b| b.p.total_cmp(&a.p));
    LetterVerdict {
        best,
        p: Some(choice.p),
        no_letter: Some(choice.none),
        rivals: choice.others.iter().take(N_RIVALS).map(rival).collect(),
        confusion,
        ..LetterVerdict::unseen(expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};

    #[test]
    fn a_text_is_the_word_whatever_its_case_accents_and_punctuation() {
        let options = LetterOptions { font: "simplex".into(), ..LetterOptions::default() };
        let expected = Expected::new(&write("Zoë-10!", &options).unwrap());
        for same in ["Zoe10", "ZOElO", "zoeio", "Z0EI0"] {
            assert!(expected.spells(same), "{same}");
        }
        for other in ["Zoe", "Zoe1", "Zue10", "AZoe10", ""] {
            assert!(!expected.spells(other), "{other}");
        }
    }
}
