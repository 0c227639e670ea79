//! Blind recognition: the text of a photo, without knowledge of the word.
//!
//! Lines of writing are found by their ink, cut out as strips at several sizes, and read by the net as
//! capitals, small letters, capitalized, digits, or capitals mixed with digits; the likeliest wins.

use serde::Serialize;

use super::line::{InkColor, InkRule, Line};
use super::net;
use super::sequence::{Classes, Columns, class_of, classes_of};
use crate::error::Result;
use crate::photo::Photo;

/// Sizes at which a line is tried: cap height by the height of most letters. Small letters are two
/// thirds of a capital.
const SIZES: [f64; 3] = [1.0, 1.2, 1.5];

/// ln of how much rarer words of one kind of characters are than of capitals or of small letters.
const RARER: [f64; 5] = [0.0, -0.5, -0.5, -1.0, -2.5];

/// Mean share of the letters from which a second line of writing is believed.
const LEAST_SHARE: f64 = 0.6;

/// ln of the probability, by letter, from which other ways to find ink are not tried.
const CLEAR: f64 = -0.1;

/// Text of a photo.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reading {
    /// The text, line by line; empty where nothing is written.
    pub text: String,
    /// Letter by letter, from left to right and line by line.
    pub letters: Vec<ReadLetter>,
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

/// A line as it was read.
struct ReadLine {
    letters: Vec<ReadLetter>,
    /// ln of its probability, by letter.
    ln_p: f64,
}

/// Reads a photo.
///
/// # Errors
///
/// None so far.
pub fn read(photo: &Photo) -> Result<Reading> {
    let rules = [0.95, 0.6].into_iter().flat_map(|full_rank| {
        [InkColor::Own, InkColor::Any].map(|color| InkRule { color, full_rank })
    });
    let worth =
        |lines: &[ReadLine]| lines.iter().map(|line| line.ln_p).fold(f64::NEG_INFINITY, f64::max);
    let mut lines: Vec<ReadLine> = Vec::new();
    for rule in rules {
        let found = Line::find_all(photo, rule);
        let read: Vec<ReadLine> = found.iter().filter_map(read_line).collect();
        if lines.is_empty() || worth(&read) > worth(&lines) {
            lines = read;
        }
        if worth(&lines) > CLEAR {
            break;
        }
    }
    let clear = |line: &ReadLine| {
        let n = line.letters.len() as f64;
        line.letters.iter().map(|letter| letter.p).sum::<f64>() >= LEAST_SHARE * n
    };
    if lines.len() > 1 {
        let top = worth(&lines);
        lines.retain(|line| line.ln_p >= top || (line.letters.len() > 1 && clear(line)));
    }
    let texts: Vec<String> = lines
        .iter()
        .map(|line| line.letters.iter().map(|letter| letter.letter).collect())
        .collect();
    let letters = lines.into_iter().flat_map(|line| line.letters).collect();
    Ok(Reading { text: texts.join("\n"), letters })
}

/// Reads a line at the size at which it is clearest; `None` where it has no letters.
fn read_line(line: &Line) -> Option<ReadLine> {
    let tried = SIZES.iter().filter_map(|size| {
        let cap_px = size * line.letter_px;
        let (strip, left_px, pitch_px) = line.strip(cap_px);
        let columns = Columns::from_logits(&net::logits(&strip));
        let (text, ln_p) = spell(&columns)?;
        Some((text, ln_p, columns, left_px, pitch_px))
    });
    let best = tried.reduce(|a, b| if b.1 > a.1 { b } else { a });
    let (text, ln_p, columns, left_px, pitch_px) = best?;
    let word: Vec<Classes> = text.chars().map(classes_of).collect();
    let choices = columns.choices(&word);
    let middles: Vec<f64> = columns
        .middles(&word)
        .into_iter()
        .map(|column| left_px + (column + 0.5) * net::COLUMN_PX as f64 * pitch_px)
        .collect();
    let letters = text.chars().zip(line.boxes(&middles)).zip(choices);
    let letters =
        letters.map(|((letter, box_px), choice)| ReadLetter { letter, p: choice.p, box_px });
    Some(ReadLine { letters: letters.collect(), ln_p })
}

/// The likeliest text of some columns, and ln of its probability by its letters.
fn spell(columns: &Columns) -> Option<(String, f64)> {
    let set = |from: char, to: char| -> Vec<(char, Classes)> {
        (from..=to).filter_map(|c| Some((c, 1 << class_of(c)?))).collect()
    };
    let [mut capitals, mut small, mut digits] = [set('A', 'Z'), set('a', 'z'), set('0', '9')];
    let mixed = [capitals.clone(), digits.clone()].concat();
    // In a word of one kind, each character stands for those that look the same.
    for (character, classes) in capitals.iter_mut().chain(&mut small).chain(&mut digits) {
        *classes |= alike(*character);
    }
    let kinds = [
        (&capitals, &capitals),
        (&small, &small),
        (&capitals, &small),
        (&digits, &digits),
        (&mixed, &mixed),
    ];
    let tried = kinds.iter().zip(RARER).filter_map(|((first, rest), rarer)| {
        let (text, ln_p) = columns.search(first, rest).into_iter().next()?;
        let n = text.chars().count();
        (n > 0 && !text.chars().all(|c| c == '?')).then(|| (text, (ln_p + rarer) / n as f64))
    });
    tried.reduce(|a, b| if b.1 > a.1 { b } else { a })
}

/// Classes of other characters that look like one.
fn alike(character: char) -> Classes {
    let others = match character {
        'O' | '0' => "Oo0",
        'o' => "oO0",
        'I' => "Il1",
        'l' => "lI1",
        '1' => "1Il",
        'i' => "i",
        _ if "CcKkPpSsUuVvWwXxZz".contains(character) => {
            return 1 << class_of(character.to_ascii_lowercase()).unwrap_or(0)
                | 1 << class_of(character.to_ascii_uppercase()).unwrap_or(0);
        }
        _ => "",
    };
    others.chars().filter_map(class_of).fold(0, |set, class| set | 1 << class)
}
