//! Judges a word's columns: choices for the letters, likeliest other word, and readability.

use std::ops::Range;

use super::alphabet::{
    BLANK, Classes, NO_LETTER, classes_of, is_untrained, ligature, names, seen_as, spells,
    with_case_of,
};
use super::calibration::readability;
use super::lattice::{Choice, Columns};
use super::raster::whole;
use super::search::search;
use super::spelling;
use super::verdict::{LetterVerdict, Rival, RivalWord};
use noctograph_core::statistics::sort_by_number;
use noctograph_core::strokes::Strokes;

/// Minimum probability of a letter in the list of confusions.
const LEAST_CONFUSION: f64 = 0.001;

/// Maximum number of rivals in the verdict on a letter.
const N_RIVALS: usize = 3;

/// Minimum probability of a class in an untrained letter's drawing to count as that letter.
const LEAST_TAKEN: f64 = 0.02;

/// Number of letters on each side that influence the choice for a letter.
const NEAR: usize = 4;

/// Maximum readability if a word of another length is likelier.
const MOST_OF_OTHER_LENGTH: f64 = 0.5;

/// Number of unconstrained readings that are tried as rivals.
const N_FREE: usize = 2;

/// The word that the columns should show, without punctuation.
pub(super) struct Expected {
    /// Index of each judged character in the word, twice for a ligature that is read as two
    /// letters.
    pub(super) indices: Vec<usize>,
    characters: Vec<char>,
    /// The classes that count as each judged character.
    classes: Vec<Classes>,
    /// Mean natural logarithm of the probabilities of the word's letters, from the spelling model.
    ln_p_of_spelling: f64,
    /// Number of judged characters before the start and end of each line, without duplicates.
    line_ends: Vec<usize>,
}

/// The evidence that columns give for a word.
pub(super) struct Judgment {
    /// One choice for each judged character.
    pub(super) choices: Vec<Choice>,
    pub(super) rival: Option<RivalWord>,
    pub(super) readability: f64,
}

/// Another word, and the natural logarithm of its odds against the expected word.
pub(super) struct Odds {
    word: String,
    ln_odds: f64,
}

impl Odds {
    /// Returns a word with the natural logarithm of its odds against the expected word.
    fn new(word: Vec<char>, ln_odds: f64) -> Self {
        Self { word: word.into_iter().collect(), ln_odds }
    }

    /// Returns the likeliest word (the first among equals), or `None` if there is none.
    fn likeliest(odds: impl IntoIterator<Item = Self>) -> Option<Self> {
        odds.into_iter().reduce(|a, b| if b.ln_odds > a.ln_odds { b } else { a })
    }
}

/// The letters near one end of a line, and the columns that show them.
struct LineEnd {
    /// Number of judged characters before this end of the line.
    index: usize,
    letters: Range<usize>,
    columns: Columns,
    /// Natural logarithm of the probability of the expected letters.
    ln_p: f64,
}

impl LineEnd {
    /// Returns the natural logarithm of the odds of other letters against the expected ones.
    fn ln_odds(&self, classes: &[Classes]) -> f64 {
        self.columns.ln_p(classes) - self.ln_p
    }
}

impl Judgment {
    /// Replaces the rival with `other` if the latter is likelier. A rival that is likelier than the
    /// word and has another length limits the readability.
    pub(super) fn against(mut self, other: Option<Odds>) -> Self {
        let other = other.map(|odds| (1.0 / (1.0 + libm::exp(-odds.ln_odds)), odds.word));
        let words =
            self.rival.take().into_iter().chain(other.map(|(p, word)| RivalWord { word, p }));
        self.rival = words.reduce(|a, b| if b.p > a.p { b } else { a });
        if self.has_other_length() {
            self.readability = self.readability.min(MOST_OF_OTHER_LENGTH);
        }
        self
    }

    /// True if a word of another length is likelier than the expected one.
    pub(super) fn has_other_length(&self) -> bool {
        let rival = self.rival.as_ref().filter(|rival| rival.p > 0.5);
        rival.is_some_and(|rival| rival.word.chars().count() != self.choices.len())
    }
}

impl Expected {
    /// Lists the judged characters and the line ends of a word from its strokes.
    pub(super) fn new(strokes: &Strokes) -> Self {
        let characters = strokes.glyphs.iter().map(|glyph| glyph.character).enumerate();
        let judged = characters.filter_map(|(index, c)| Some((index, (c, classes_of(c)?))));
        let (indices, (characters, classes)): (Vec<usize>, (_, _)) = judged.unzip();
        let glyph_ends = strokes.lines().into_iter().map(|line| line.end);
        let ends = glyph_ends.map(|end| indices.iter().filter(|index| **index < end).count());
        let mut line_ends: Vec<usize> = [0].into_iter().chain(ends).collect();
        line_ends.dedup();
        let ln_p_of_spelling = spelling::mean_ln_p(&strokes.word);
        Self { indices, characters, classes, ln_p_of_spelling, line_ends }
    }

    /// True if the net was not trained on one of the word's letters.
    pub(super) fn is_untrained(&self) -> bool {
        self.characters.iter().any(|character| is_untrained(*character))
    }

    /// Adds, to each Latin letter that the net was not trained on, the classes that the net reads
    /// in a faultless drawing of it. `drawn` are the columns of that drawing.
    pub(super) fn learn(&mut self, drawn: &Columns) {
        for place in (0..self.characters.len()).rev() {
            if let Some(pair) = ligature(self.characters[place]) {
                self.split(place, pair, drawn);
            }
        }
        let choices = self.choices(drawn);
        for ((character, classes), choice) in
            self.characters.iter().zip(&mut self.classes).zip(choices)
        {
            if is_untrained(*character) {
                let taken = choice.others.iter().filter(|(_, p)| *p >= LEAST_TAKEN);
                *classes |= taken.fold(0, |set, (other, _)| set | seen_as(*other));
            }
        }
    }

    /// Replaces the ligature at `place` with its two letters if these are likelier in its drawing.
    fn split(&mut self, place: usize, pair: [char; 2], drawn: &Columns) {
        let mut separate = self.classes.clone();
        separate.splice(place..=place, pair.map(seen_as));
        if drawn.ln_p(&separate) > drawn.ln_p(&self.classes) {
            self.classes = separate;
            self.characters.splice(place..=place, pair);
            self.indices.insert(place, self.indices[place]);
            self.line_ends.iter_mut().filter(|end| **end > place).for_each(|end| *end += 1);
        }
    }

    /// Merges the choices for the two letters of a ligature, both of which must be right, so that
    /// each judged character has one choice.
    pub(super) fn by_character(&self, choices: Vec<Choice>) -> Vec<Choice> {
        let mut merged: Vec<(usize, Choice)> = Vec::new();
        for (index, choice) in self.indices.iter().zip(choices) {
            match merged.last_mut().filter(|(last, _)| last == index) {
                Some((_, first)) => *first = first.and(&choice),
                None => merged.push((*index, choice)),
            }
        }
        merged.into_iter().map(|(_, choice)| choice).collect()
    }

    /// Judges columns. Returns the choices, the likeliest other word, and the readability from 0 to
    /// 1.
    pub(super) fn judge(&self, columns: &Columns) -> Judgment {
        let choices = self.choices(columns);
        let rival = self.rival(columns, &choices);
        let ln_odds = rival.as_ref().map_or(f64::INFINITY, |rival| -rival.ln_odds);
        let readability = readability(&choices, ln_odds, self.ln_p_of_spelling);
        Judgment { choices, rival: None, readability }.against(rival)
    }

    /// Returns the choice for each letter. In a long word each choice depends only on nearby
    /// letters, because the time would otherwise grow with the square of the length.
    pub(super) fn choices(&self, columns: &Columns) -> Vec<Choice> {
        if self.is_short() {
            return columns.choices(&self.classes, &self.characters);
        }
        let middles = self.middles(columns);
        (0..self.classes.len()).map(|place| self.choice_near(columns, &middles, place)).collect()
    }

    /// Returns the choice for the letter at `place`, given the letters around it. `middles` are the
    /// mean columns of all letters, as positions in the strip.
    pub(super) fn choice_near(&self, columns: &Columns, middles: &[f64], place: usize) -> Choice {
        let letters = self.near(place);
        let part = columns_of(columns, middles, &letters);
        let (classes, start) = (&self.classes[letters.clone()], letters.start);
        part.choices(classes, &self.characters[letters]).swap_remove(place - start)
    }

    /// True if the word is so short that its middle letter influences all other letters.
    fn is_short(&self) -> bool {
        self.classes.len() <= 2 * NEAR + 1
    }

    /// Returns the range of letters that influence the letter at a place.
    fn near(&self, place: usize) -> Range<usize> {
        place.saturating_sub(NEAR)..(place + NEAR + 1).min(self.classes.len())
    }

    /// Returns the mean column of each letter.
    pub(super) fn middles(&self, columns: &Columns) -> Vec<f64> {
        columns.middles(&self.classes)
    }

    /// Returns all letters and digits with their classes. If the word is a number, ambiguous
    /// classes count as digits.
    fn names(&self) -> Vec<(char, Classes)> {
        names(0, self.characters.iter().all(char::is_ascii_digit))
    }

    /// Returns the likeliest word with one letter more or less at an end of a line, or `None` if
    /// the expected word is likelier.
    pub(super) fn at_ends(&self, columns: &Columns) -> Option<Odds> {
        let n_letters = self.classes.len();
        let middles = self.middles(columns);
        let line_ends = self.line_ends.iter().map(|&index| {
            let near = self.near(index.min(n_letters - 1));
            let letters = if self.is_short() { 0..n_letters } else { near };
            let columns = columns_of(columns, &middles, &letters);
            let ln_p = columns.ln_p(&self.classes[letters.clone()]);
            LineEnd { index, letters, columns, ln_p }
        });
        let line_ends: Vec<LineEnd> = line_ends.collect();
        let names = self.names();
        let mut odds = Vec::new();
        // Tries words with one more letter. Single letters are tried only if any letter at all is
        // likelier than none.
        for end in &line_ends {
            let mut classes = self.classes[end.letters.clone()].to_vec();
            let added = end.index - end.letters.start;
            classes.insert(added, !(BLANK | NO_LETTER));
            let may_be_longer = end.ln_odds(&classes) > 0.0;
            for (letter, set) in names.iter().filter(|_| may_be_longer) {
                let mut word = self.characters.clone();
                word.insert(end.index, with_case_of(*letter, word[end.index.saturating_sub(1)]));
                classes[added] = *set;
                odds.push(Odds::new(word, end.ln_odds(&classes)));
            }
        }
        // Tries words without the first or the last letter of a line.
        for pair in line_ends.windows(2).filter(|_| n_letters > 1) {
            for (end, removed) in [(&pair[0], pair[0].index), (&pair[1], pair[1].index - 1)] {
                let mut word = self.characters.clone();
                let mut classes = self.classes[end.letters.clone()].to_vec();
                word.remove(removed);
                classes.remove(removed - end.letters.start);
                odds.push(Odds::new(word, end.ln_odds(&classes)));
            }
        }
        Odds::likeliest(odds).filter(|odds| odds.ln_odds > 0.0)
    }

    /// True if an unconstrained reading spells the word, or has classes that count as its letters.
    fn is_spelled(&self, text: &str, word: &str) -> bool {
        let same_length = text.chars().count() == self.characters.len();
        let letters = text.chars().zip(&self.characters).zip(&self.classes);
        let mut are_same = letters.map(|((read, character), classes)| {
            let is_taken = is_untrained(*character) && seen_as(read) & classes != 0;
            is_taken || spells(&read.to_string(), &character.to_string())
        });
        spells(text, word) || same_length && are_same.all(|is_same| is_same)
    }

    /// Returns the likeliest other word: one with another letter, or an unconstrained reading.
    fn rival(&self, columns: &Columns, choices: &[Choice]) -> Option<Odds> {
        let mut odds = Vec::new();
        for (index, choice) in choices.iter().enumerate() {
            if let Some(&(letter, p)) = choice.others.first() {
                let mut word = self.characters.clone();
                word[index] = with_case_of(letter, word[index]);
                // The lower bound keeps the odds finite if the letter's probability is 0.
                odds.push(Odds::new(word, libm::log(p / choice.p.max(1e-300))));
            }
        }
        let word: String = self.characters.iter().collect();
        let ln_p = columns.ln_p(&self.classes);
        let names = self.names();
        // Unexplained light beside a word does not turn it into another word.
        let readings = search(columns, &names, &names).into_iter();
        let texts = readings.map(|(text, _)| text.trim_matches('?').to_owned());
        let others = texts.filter(|text| !text.is_empty() && !self.is_spelled(text, &word));
        for text in others.take(N_FREE) {
            let ln_odds = columns.ln_p(&text.chars().map(seen_as).collect::<Vec<_>>()) - ln_p;
            let last = self.characters.len() - 1;
            let characters = text.chars().enumerate();
            let cased =
                characters.map(|(index, c)| with_case_of(c, self.characters[index.min(last)]));
            odds.push(Odds::new(cased.collect(), ln_odds));
        }
        Odds::likeliest(odds.into_iter().filter(|rival| !rival.ln_odds.is_nan()))
    }
}

/// Returns the columns of some letters, from halfway to the letter before them to halfway to the
/// one after them. `middles` are the mean columns of all letters.
fn columns_of(columns: &Columns, middles: &[f64], letters: &Range<usize>) -> Columns {
    let ends = [letters.start, letters.end];
    let [from, to] = ends.map(|letter| match (letter.checked_sub(1), middles.get(letter)) {
        (Some(before), Some(middle)) => whole(0.5 * (middles[before] + middle)),
        (None, _) => 0,
        (_, None) => columns.0.len(),
    });
    columns.part(from..to.max(from + 1))
}

/// Returns the verdict on one letter, from the choice for it.
pub(super) fn letter_verdict(choice: &Choice, expected: char) -> LetterVerdict {
    let others = choice.others.iter();
    let rivals = others.map(|(c, p)| Rival { letter: with_case_of(*c, expected), p: *p });
    let likely = rivals.clone().filter(|rival| rival.p >= LEAST_CONFUSION);
    let mut confusion: Vec<Rival> =
        [Rival { letter: expected, p: choice.p }].into_iter().chain(likely).collect();
    sort_by_number(&mut confusion, |rival| -rival.p);
    LetterVerdict {
        best: choice.best(expected).0,
        p: Some(choice.p),
        no_letter: Some(choice.none),
        rivals: rivals.take(N_RIVALS).collect(),
        confusion,
        ..LetterVerdict::unseen(expected)
    }
}
