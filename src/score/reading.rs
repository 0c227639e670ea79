//! Blind recognition: the text of a photo, without knowledge of the word.
//!
//! Lines of writing are found by their ink, cut out as strips at several sizes, and read by the net
//! as capitals, small letters, capitalized, digits, or capitals mixed with digits; the likeliest
//! wins, and is read again with its neighbors, a little larger, smaller, higher, lower and darker:
//! what they agree on hangs less on how the photo was scaled, exposed and compressed. Accents and
//! punctuation are not read.

use rayon::prelude::*;
use serde::Serialize;

use super::alphabet::{Classes, alike, class_of, seen_as, with_case_of};
use super::lattice::Columns;
use super::line::{self, Line};
use super::net;
use super::search::{Symbols, search};
use super::spelling::likeliest;
use super::strip::CAP_PX;
use noctograph_core::photo::Photo;

/// Sizes at which a line is tried: cap height by the height of most letters. Small letters are two
/// thirds of a capital.
const SIZES: [f64; 3] = [1.0, 1.2, 1.5];

/// ln of the frequency of words by kind of characters against words of capitals: capitals, small
/// letters, capitalized, digits, capitals and digits.
const LN_FREQUENCY: [f64; 5] = [0.0, -0.5, -0.5, -1.0, -2.5];

/// Mean share of the letters from which a line is clear.
const LEAST_SHARE: f64 = 0.6;

/// Gap between two letters from which there is a space, in cap heights: a space of the shipped
/// fonts leaves more, two letters leave less.
const SPACE_H: f64 = 0.65;

/// Mean of ln p over the letters from which a line is sure: then other rules for ink are tried only
/// where they find more of it.
const SURE: f64 = -0.1;

/// Share of a letter from which reading it says more than leaving it out.
const EVEN: f64 = 0.5;

/// Columns of strips that are read at most, all tries together: two tries of the longest word, or a
/// second on one core. What is noise has many lines of many columns.
const MOST_COLUMNS: usize = 12_000;

/// Least mean share of the letters of writing, and least share of a letter alone: a heart is read
/// as letters of less, a paw as 0990 of 0.69, a face as an O of 0.87.
const LEAST_WRITING: f64 = 0.72;
const LEAST_LETTER: f64 = 0.9;

/// Text of a photo.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Reading {
    /// The text, line by line, with spaces where the gaps are wide; empty where nothing is written.
    pub text: String,
    /// Letter by letter, from left to right and line by line.
    pub letters: Vec<ReadLetter>,
    /// Much smaller writing beside it, such as a credit or a date, that is passed over.
    #[serde(skip)]
    pub smaller: String,
    /// What the lines show, one after another, each at the size at which it was read.
    #[serde(skip)]
    pub(super) columns: Columns,
}

/// A letter that was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadLetter {
    /// The letter.
    pub letter: char,
    /// Its share in the choice among all, 0 to 1.
    pub p: f64,
    /// Its box along the middles of its strokes: left, top, right, bottom, in pixels of the photo.
    pub box_px: [f64; 4],
}

impl ReadLetter {
    /// Its share; `None` for light that no letter explains.
    fn share(&self) -> f64 {
        if self.letter == '?' { 0.0 } else { self.p }
    }
}

impl Reading {
    /// The same where it is clear enough to be writing, and nothing else.
    #[must_use]
    pub fn of_writing(self) -> Self {
        let least = if self.letters.len() == 1 { LEAST_LETTER } else { LEAST_WRITING };
        if self.mean_share() >= least { self } else { Self::default() }
    }

    /// Mean share of its letters; 0 without any.
    pub(super) fn mean_share(&self) -> f64 {
        let sum: f64 = self.letters.iter().map(ReadLetter::share).sum();
        sum / self.letters.len().max(1) as f64
    }
}

/// Whether letters are read, and read clearly on average.
pub(super) fn is_clear(letters: &[ReadLetter]) -> bool {
    let sum: f64 = letters.iter().map(|letter| letter.p).sum();
    !letters.is_empty() && sum >= LEAST_SHARE * letters.len() as f64
}

/// A line as it was read.
struct ReadLine {
    text: String,
    letters: Vec<ReadLetter>,
    /// Mean of ln p over the letters.
    ln_p: f64,
    columns: Columns,
}

/// How much lines say: a rule that leaves out letters reads the others as clearly.
fn worth(lines: &[ReadLine]) -> f64 {
    let letters = lines.iter().flat_map(|line| &line.letters);
    letters.map(|letter| letter.share() - EVEN).sum()
}

/// Reads a photo.
pub fn read(photo: &Photo) -> Reading {
    let search = line::Search::new(photo);
    let mut lines: Vec<ReadLine> = Vec::new();
    let mut known: Vec<Line> = Vec::new();
    let mut budget = MOST_COLUMNS;
    let exposed = [0.95, 0.6].into_iter().filter_map(|full_rank| search.exposed(full_rank));
    // Ink has the color of the brightest light, or any.
    let inks = exposed.flat_map(|light| [1, 0].map(|ink| search.lines(&light, &light[ink])));
    for inked in inks {
        let is_sure = lines.iter().any(|line| line.ln_p > SURE);
        let mut new = inked.iter().filter(|line| !known.iter().any(|k| line.adds_nothing_to(k)));
        if is_sure && new.next().is_none() {
            continue;
        }
        let sizes: Vec<Vec<f64>> = inked.iter().map(|line| sizes_px(line, &mut budget)).collect();
        let read = inked.par_iter().zip(sizes);
        let read: Vec<ReadLine> = read.filter_map(|(line, sizes)| read_line(line, sizes)).collect();
        if lines.is_empty() || worth(&read) > worth(&lines) {
            (lines, known) = (read, inked);
        }
    }
    if lines.iter().map(|line| line.letters.len()).sum::<usize>() <= 1
        && let Some(letter) = read_letter(&search, &mut budget)
        && worth(std::slice::from_ref(&letter)) > worth(&lines)
    {
        lines = vec![letter];
    }
    if lines.len() > 1 {
        let top = lines.iter().map(|line| line.ln_p).fold(f64::NEG_INFINITY, f64::max);
        lines.retain(|line| line.ln_p >= top || line.letters.len() > 1 && is_clear(&line.letters));
    }
    let small = known.iter().map(|line| line.letter_px).fold(0.0, f64::max);
    let may_be_larger = !known.is_empty() && search.has_room_for_larger(small);
    let larger = may_be_larger.then(|| read_larger(&search, small, &mut budget)).flatten();
    let text =
        |lines: &[ReadLine]| lines.iter().map(|line| &line.text[..]).collect::<Vec<_>>().join("\n");
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

/// The clearest single letter of all ink.
fn read_letter(search: &line::Search, budget: &mut usize) -> Option<ReadLine> {
    let exposed = [0.95, 0.6].into_iter().filter_map(|full_rank| search.exposed(full_rank));
    let lines = exposed.flat_map(|light| [1, 0].map(|ink| search.of_any(&light, &light[ink])));
    let read = lines.flatten().filter_map(|line| {
        let sizes_px = sizes_px(&line, budget);
        read_line(&line, sizes_px)
    });
    let single = read.filter(|line| line.letters.len() == 1);
    single.reduce(|a, b| if b.ln_p > a.ln_p { b } else { a })
}

/// The clearest line of letters several times as high as some, if it is sure to be writing.
fn read_larger(search: &line::Search, than_px: f64, budget: &mut usize) -> Option<ReadLine> {
    let exposed = [0.95, 0.6].into_iter().filter_map(|full_rank| search.exposed(full_rank));
    let larger =
        exposed.flat_map(|light| [1, 0].map(|ink| search.larger(&light, &light[ink], than_px)));
    let read = larger.flatten().filter_map(|line| {
        let sizes_px = sizes_px(&line, budget);
        read_line(&line, sizes_px)
    });
    let sure = read.filter(|line| line.letters.len() > 1 && line.ln_p > SURE);
    sure.reduce(|a, b| if b.ln_p > a.ln_p { b } else { a })
}

/// Heights of capitals at which a line is read, as far as the columns that are left suffice.
fn sizes_px(line: &Line, columns_left: &mut usize) -> Vec<f64> {
    let sizes_px = SIZES.iter().map(|size| size * line.letter_px);
    let affordable = sizes_px.filter(|cap_px| {
        let left = columns_left.checked_sub(line.strip_width(*cap_px));
        *columns_left = left.unwrap_or(*columns_left);
        left.is_some()
    });
    affordable.collect()
}

/// Reads a line at the size at which it is clearest, and by its neighbors; `None` where it has no
/// letters.
fn read_line(line: &Line, sizes_px: Vec<f64>) -> Option<ReadLine> {
    let tries = sizes_px.into_par_iter().filter_map(|cap_px| {
        let (strip, left_px, pitch_px) = line.strip(cap_px);
        let columns = Columns::along(&strip);
        let (_, ln_p) = spell(&columns)?;
        Some((strip, ln_p, columns, left_px, pitch_px))
    });
    let best = tries.collect::<Vec<_>>().into_iter().reduce(|a, b| if b.1 > a.1 { b } else { a });
    let (strip, _, own, left_px, pitch_px) = best?;
    let columns = own.agreed(&strip);
    let (text, ln_p) = spell(&columns)?;
    let seen: Vec<char> = text.chars().collect();
    let word: Vec<Classes> = seen.iter().map(|letter| seen_as(*letter)).collect();
    let choices = columns.choices(&word, &seen);
    let mut middles_px = columns.middles(&word);
    for middle in &mut middles_px {
        *middle = left_px + (*middle + 0.5) * net::COLUMN_PX as f64 * pitch_px;
    }
    let letters = likeliest(&choices, &seen).into_iter().zip(line.boxes(&middles_px));
    let letters = letters.zip(choices.iter().zip(&seen));
    let letters = letters.map(|((letter, box_px), (choice, seen))| {
        let other = choice.others.iter().find(|(other, _)| with_case_of(*other, *seen) == letter);
        let p = if letter == *seen { choice.p } else { other.map_or(0.0, |(_, p)| *p) };
        ReadLetter { letter, p, box_px }
    });
    let letters: Vec<ReadLetter> = letters.collect();
    let text = spaced(&letters, SPACE_H * CAP_PX as f64 * pitch_px);
    Some(ReadLine { text, letters, ln_p, columns })
}

/// The letters of a line, with spaces where there are wide gaps.
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

/// The likeliest text of some columns, and the mean of ln p over its letters.
fn spell(columns: &Columns) -> Option<(String, f64)> {
    // In a word of one kind, each character stands for those of its shape.
    let [capitals, small, digits] = ['A'..='Z', 'a'..='z', '0'..='9']
        .map(|kind| kind.map(|c| (c, alike(c))).collect::<Vec<(char, Classes)>>());
    let mixed = ('A'..='Z').chain('0'..='9').filter_map(|c| Some((c, 1 << class_of(c)?)));
    let mixed: Vec<_> = mixed.collect();
    let kinds: [(&Symbols, &Symbols); 5] = [
        (&capitals, &capitals),
        (&small, &small),
        (&capitals, &small),
        (&digits, &digits),
        (&mixed, &mixed),
    ];
    let tried = kinds.iter().zip(LN_FREQUENCY).filter_map(|((first, rest), ln_frequency)| {
        let (text, ln_p) = search(columns, first, rest).into_iter().next()?;
        let n_letters = text.chars().count() as f64;
        let has_letter = text.chars().any(|c| c != '?');
        has_letter.then(|| (text, (ln_p + ln_frequency) / n_letters))
    });
    tried.reduce(|a, b| if b.1 > a.1 { b } else { a })
}
