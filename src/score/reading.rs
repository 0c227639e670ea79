//! Blind recognition reads the text of a photo without knowing the word.
//!
//! Lines of writing are located by their ink and cut out as strips at several sizes. The net reads
//! each strip as capitals, small letters, capitalized words, digits, or capitals mixed with digits.
//! The likeliest strip is read again together with its neighbors, which are slightly larger,
//! smaller, higher, lower and darker. The mean over the neighbors depends less on how the photo was
//! scaled, exposed and compressed. Accents and punctuation are not read.

use noctograph_core::parallel::prelude::*;
use serde::Serialize;

use super::alphabet::{Classes, alike, class_of, seen_as, with_case_of};
use super::lattice::Columns;
use super::line::{Ink, LEAST_PX, Line, inks};
use super::net;
use super::search::{Symbols, search};
use super::spelling::likeliest;
use super::strip::CAP_PX;
use noctograph_core::photo::Photo;

/// Ratios of cap height to letter height that are tried. Small letters are 2/3 as high as capitals.
const SIZES: [f64; 3] = [1.0, 1.2, 1.5];

/// Natural logarithms of the relative frequencies of words in capitals, small letters, capitalized
/// words, digits, and capitals mixed with digits.
const LN_FREQUENCY: [f64; 5] = [0.0, -0.5, -0.5, -1.0, -2.5];

/// Minimum mean probability of the letters in a line that counts as clear.
const LEAST_CLEAR: f64 = 0.6;

/// Minimum gap that is read as a space, in cap heights. The spaces of the shipped fonts are wider.
const SPACE_H: f64 = 0.65;

/// Minimum mean natural logarithm of the letters' probabilities in a line that counts as certain.
const SURE: f64 = -0.1;

/// Probability at which a letter neither increases nor decreases the score of a reading.
const NEUTRAL: f64 = 0.5;

/// Maximum number of columns in all strips that are read: twice as many as in the longest word,
/// which take about one second.
const MOST_COLUMNS: usize = 12_000;

/// Minimum mean probability of letters that count as writing, and minimum probability of a single
/// letter. A heart is below both, a paw is read as 0990 with 0.69, and a face as an O with 0.87.
const LEAST_WRITING: f64 = 0.72;
const LEAST_LETTER: f64 = 0.9;

/// The text that was read in a photo.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Reading {
    /// The text, with a line break between lines and a space for each wide gap. The text is empty
    /// if there is no writing.
    pub text: String,
    /// The letters, from left to right and line by line.
    pub letters: Vec<ReadLetter>,
    /// Text that was ignored because it is much smaller than the rest, such as a credit or a date.
    #[serde(skip)]
    pub smaller: String,
    /// The columns of all lines in order. Each line has the size at which it was read.
    #[serde(skip)]
    pub(super) columns: Columns,
}

/// A letter in a reading.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadLetter {
    /// The letter, or `?` for light that no letter explains.
    pub letter: char,
    /// Probability of the letter among all characters, 0 to 1.
    pub p: f64,
    /// Left, top, right and bottom of the letter, at the centers of its strokes, in photo pixels.
    pub box_px: [f64; 4],
}

impl ReadLetter {
    /// Returns the letter's probability, or 0 for `?`.
    fn letter_p(&self) -> f64 {
        if self.letter == '?' { 0.0 } else { self.p }
    }
}

impl Reading {
    /// Returns the reading if it is clear enough to be writing, or an empty reading otherwise.
    #[must_use]
    pub fn of_writing(self) -> Self {
        let least = if self.letters.len() == 1 { LEAST_LETTER } else { LEAST_WRITING };
        if self.mean_p() >= least { self } else { Self::default() }
    }

    /// Returns the mean probability of the letters, or 0 if there are none.
    pub(super) fn mean_p(&self) -> f64 {
        let sum: f64 = self.letters.iter().map(ReadLetter::letter_p).sum();
        sum / self.letters.len().max(1) as f64
    }
}

/// True if there are letters and their mean probability is high enough.
pub(super) fn is_clear(letters: &[ReadLetter]) -> bool {
    let sum: f64 = letters.iter().map(|letter| letter.p).sum();
    !letters.is_empty() && sum >= LEAST_CLEAR * letters.len() as f64
}

/// A line of writing and its reading.
struct ReadLine {
    text: String,
    letters: Vec<ReadLetter>,
    /// Mean natural logarithm of the letters' probabilities.
    ln_p: f64,
    columns: Columns,
}

/// Computes a score that rises with the number of clear letters and falls with the number of
/// doubtful ones. The mean probability would not favor readings that contain all letters.
fn worth(lines: &[ReadLine]) -> f64 {
    let letters = lines.iter().flat_map(|line| &line.letters);
    letters.map(|letter| letter.letter_p() - NEUTRAL).sum()
}

/// Reads the text of a photo, without knowing its word. Small writing beside larger writing is
/// reported apart from the text.
pub fn read(photo: &Photo) -> Reading {
    let inks = inks(photo);
    let mut lines: Vec<ReadLine> = Vec::new();
    let mut best_lines: Vec<Line> = Vec::new();
    let mut budget = MOST_COLUMNS;
    // Keeps the lines of the ink whose reading has the highest score.
    for ink in &inks {
        let inked = ink.lines();
        let is_sure = lines.iter().any(|line| line.ln_p > SURE);
        let mut added =
            inked.iter().filter(|line| !best_lines.iter().any(|k| line.adds_nothing_to(k)));
        if is_sure && added.next().is_none() {
            continue;
        }
        let sizes: Vec<Vec<f64>> = inked.iter().map(|line| sizes_px(line, &mut budget)).collect();
        let read = inked.par_iter().zip(sizes);
        let new: Vec<ReadLine> = read.filter_map(|(line, sizes)| read_line(line, sizes)).collect();
        if lines.is_empty() || worth(&new) > worth(&lines) {
            (lines, best_lines) = (new, inked);
        }
    }
    // The rows of a single letter are selected by a different rule.
    let n_letters: usize = lines.iter().map(|line| line.letters.len()).sum();
    let any_ink = inks.iter().filter(|_| n_letters <= 1).filter_map(Ink::line_of_any);
    if let Some(letter) = clearest(any_ink, &mut budget, |line| line.letters.len() == 1)
        && worth(std::slice::from_ref(&letter)) > worth(&lines)
    {
        lines = vec![letter];
    }
    // Further lines with a single letter or doubtful letters are noise.
    if lines.len() > 1 {
        let top = lines.iter().map(|line| line.ln_p).fold(f64::NEG_INFINITY, f64::max);
        lines.retain(|line| line.ln_p >= top || line.letters.len() > 1 && is_clear(&line.letters));
    }
    // If the photo has much larger writing, the lines read so far are only its caption. Rows that
    // are too low for a line are captions as well.
    let small = best_lines.iter().map(|line| line.letter_px).fold(LEAST_PX as f64, f64::max);
    let larger = inks.iter().filter_map(|ink| ink.larger(small));
    let larger = clearest(larger, &mut budget, |line| line.letters.len() > 1 && line.ln_p > SURE);
    let mut smaller = String::new();
    if let Some(larger) = larger {
        smaller = text(&lines);
        lines = vec![larger];
    }
    Reading {
        text: text(&lines),
        smaller,
        letters: lines.iter().flat_map(|line| line.letters.clone()).collect(),
        columns: Columns::joined(lines.into_iter().map(|line| line.columns)),
    }
}

/// Joins the texts of lines with line breaks.
fn text(lines: &[ReadLine]) -> String {
    lines.iter().map(|line| &line.text[..]).collect::<Vec<_>>().join("\n")
}

/// Reads the lines, and returns the clearest reading for which `is_wanted` is true. `budget` is the
/// number of columns that may still be read.
fn clearest(
    lines: impl Iterator<Item = Line>,
    budget: &mut usize,
    is_wanted: fn(&ReadLine) -> bool,
) -> Option<ReadLine> {
    let read = lines.filter_map(|line| {
        let sizes_px = sizes_px(&line, budget);
        read_line(&line, sizes_px)
    });
    read.filter(is_wanted).reduce(|a, b| if b.ln_p > a.ln_p { b } else { a })
}

/// Returns the cap heights in pixels at which a line is read, and subtracts their columns from
/// `columns_left`. A size that needs more columns than are left is skipped.
fn sizes_px(line: &Line, columns_left: &mut usize) -> Vec<f64> {
    let mut sizes_px = Vec::new();
    for cap_px in SIZES.map(|size| size * line.letter_px) {
        if let Some(left) = columns_left.checked_sub(line.strip_width(cap_px)) {
            *columns_left = left;
            sizes_px.push(cap_px);
        }
    }
    sizes_px
}

/// Reads a line at its clearest size, averaged with the readings of the strip's neighbors.
/// `sizes_px` contains the cap heights to try. Returns `None` if no letter is read.
fn read_line(line: &Line, sizes_px: Vec<f64>) -> Option<ReadLine> {
    let tries = sizes_px.into_par_iter().filter_map(|cap_px| {
        let (strip, left_px, pitch_px) = line.strip(cap_px);
        let columns = Columns::along(&strip);
        let (_, ln_p) = spell(&columns)?;
        Some((strip, ln_p, columns, left_px, pitch_px))
    });
    // On a tie the first size wins, so the result does not depend on the number of threads.
    let best = tries.collect::<Vec<_>>().into_iter().reduce(|a, b| if b.1 > a.1 { b } else { a });
    let (strip, _, columns, left_px, pitch_px) = best?;
    let columns = columns.agreed(&strip);
    let (text, ln_p) = spell(&columns)?;
    let seen: Vec<char> = text.chars().collect();
    let word: Vec<Classes> = seen.iter().map(|letter| seen_as(*letter)).collect();

    // The spelling model chooses the letters. Their probabilities and boxes are then added.
    let choices = columns.choices(&word, &seen);
    let mut middles_px = columns.middles(&word);
    for middle in &mut middles_px {
        *middle = left_px + (*middle + 0.5) * net::COLUMN_PX as f64 * pitch_px;
    }
    let boxed = likeliest(&choices, &seen).into_iter().zip(line.boxes(&middles_px));
    let chosen = boxed.zip(choices.iter().zip(&seen));
    let letters = chosen.map(|((letter, box_px), (choice, seen))| {
        let other = choice.others.iter().find(|(other, _)| with_case_of(*other, *seen) == letter);
        let p = if letter == *seen { choice.p } else { other.map_or(0.0, |(_, p)| *p) };
        ReadLetter { letter, p, box_px }
    });
    let letters: Vec<ReadLetter> = letters.collect();
    let text = spaced(&letters, SPACE_H * CAP_PX as f64 * pitch_px);
    Some(ReadLine { text, letters, ln_p, columns })
}

/// Returns the text of a line's letters, with a space for each gap wider than `space_px`.
fn spaced(letters: &[ReadLetter], space_px: f64) -> String {
    let mut text = String::new();
    let mut right_px = f64::INFINITY;
    for ReadLetter { letter, box_px, .. } in letters {
        if box_px[0] - right_px > space_px {
            text.push(' ');
        }
        text.push(*letter);
        right_px = box_px[2];
    }
    text
}

/// Returns the likeliest text of columns and the mean natural logarithm of its letters'
/// probabilities, or `None` if no letter is read. The frequency of each kind of word affects the
/// choice of the text but not these probabilities, because a clear single digit would otherwise
/// count as a doubtful letter of another size.
fn spell(columns: &Columns) -> Option<(String, f64)> {
    // In a word of one kind, each character represents all characters of its shape.
    let [capitals, small, digits] = ['A'..='Z', 'a'..='z', '0'..='9']
        .map(|kind| kind.map(|c| (c, alike(c))).collect::<Vec<(char, Classes)>>());
    let mixed = ('A'..='Z').chain('0'..='9').filter_map(|c| Some((c, 1 << class_of(c)?)));
    let mixed: Vec<_> = mixed.collect();
    // Each kind of word has symbols for its first character and for the others.
    let kinds: [(&Symbols, &Symbols); 5] = [
        (&capitals, &capitals),
        (&small, &small),
        (&capitals, &small),
        (&digits, &digits),
        (&mixed, &mixed),
    ];
    let texts = kinds.iter().zip(LN_FREQUENCY).filter_map(|((first, rest), ln_frequency)| {
        let (text, ln_p) = search(columns, first, rest).into_iter().next()?;
        let n_letters = text.chars().count() as f64;
        let has_letter = text.chars().any(|c| c != '?');
        has_letter.then(|| (text, ln_p / n_letters, (ln_p + ln_frequency) / n_letters))
    });
    let (text, ln_p, _) = texts.reduce(|a, b| if b.2 > a.2 { b } else { a })?;
    Some((text, ln_p))
}
