//! Reading without being told: what word a photo shows.
//!
//! Each run of ink between two places where a letter may end is compared with the bank of
//! references; of all ways to cut the line, the one whose letters explain the most ink wins.

use rayon::prelude::*;
use serde::Serialize;

use super::bank::{Bank, Classes};
use super::calibration::ln_share;
use super::line::{InkColor, InkRule, Line};
use super::matching::{Match, Surroundings};
use super::raster::{Raster, narrow};
use super::{BLUR_PX, PX_PER_H, References};
use crate::error::Result;
use crate::letters::{Font, Trace};
use crate::photo::Photo;

/// Width by height of the cells that letters are stretched into: the team's.
const ASPECT: f64 = 0.6;

/// Narrower letters than this, by their height, keep their shape.
const MIN_ASPECT: f64 = 0.3;

/// Widest letter, by its height, and least ink, by a letter's height of stroke.
const MAX_WIDTH_H: f64 = 1.7;

/// Similarity from which ink is a letter at all; what is less like any is passed over.
const LEAST_SIMILARITY: f64 = 0.5;

/// What one more letter must explain better, in strokes as long as a letter is high. Too little
/// makes I of every stroke of an O, too much leaves out a true I.
const LETTER_COST: f64 = 0.3;

/// What a letter costs more whose ink hangs together with the one before it.
const TOUCH_COST: f64 = 0.1;

/// Letters higher or lower than most by more than this are measured by the line instead.
const HEIGHTS: [f64; 2] = [0.75, 1.3];

/// The fonts, beside the typeface, whose letters are known.
const FONTS: [&str; 3] = ["ae483", "ae483-fixed", "simplex"];

/// What a gap through a letter costs: no capital or digit has one.
const GAP_COST: f64 = 0.3;

/// What a cap height of stroke more is worth in similarity: light is lost more often than it strays,
/// so that an R that lost its leg is rather R than P.
const MORE_INK: f32 = 0.01;

/// How much more of the ink digits must explain: words are more common.
const DIGITS_COST: f64 = 0.02;

/// What a photo was read as.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reading {
    /// The word; empty where nothing is written.
    pub text: String,
    /// Letter by letter, from left to right.
    pub letters: Vec<ReadLetter>,
}

/// A letter that was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadLetter {
    /// The letter.
    pub letter: char,
    /// Its share in the choice among all, 0 to 1.
    pub p: f64,
    /// Correlation less what shift and stretch cost, up to 1.
    pub similarity: f64,
    /// Its box along the middles of its strokes: left, top, right, bottom, in pixels of the photo.
    pub box_px: [f64; 4],
}

/// A run of ink, compared with the bank.
struct Look {
    matches: Vec<Match>,
    /// The columns that it was cut out between.
    columns: [usize; 2],
    /// Left, top, right and bottom along the middles of its strokes.
    extent: [f64; 4],
    /// Its ink.
    mass: f64,
}

/// Reads a photo.
///
/// # Errors
///
/// None but what a broken font would cause.
pub fn read(photo: &Photo) -> Result<Reading> {
    let classes = Classes::of("".chars());
    let rules = [0.95, 0.6]
        .map(|full_rank| [InkColor::Own, InkColor::Any].map(|color| InkRule { color, full_rank }));
    let lines = rules.into_iter().flat_map(|rules| {
        let [own, any] = rules.map(|rule| Line::find(photo, rule));
        let alike = own.as_ref().zip(any.as_ref()).is_some_and(|(own, any)| own.is_like(any));
        [own, any.filter(|_| !alike)].into_iter().flatten()
    });
    let lines: Vec<Line> = lines.collect();
    // A word is written in one font, or in print.
    let in_font = |name: &&str| {
        let fonts = [Font::open(name, Trace::CenterLine)?];
        let mut bank = Bank::draw(ASPECT, &classes, &fonts, References::Both, &[]);
        // The ink's box says where a letter is.
        bank.shifts.retain(|[right, down]| right.abs() + down.abs() <= 1);
        Ok(lines.par_iter().flat_map_iter(|line| read_line(line, &bank, &classes)).collect())
    };
    let tried: Vec<Vec<(f64, Reading)>> = FONTS.par_iter().map(in_font).collect::<Result<_>>()?;
    // The first of the best, for any number of threads.
    let best = tried.into_iter().flatten().reduce(|a, b| if b.0 > a.0 { b } else { a });
    Ok(best.map_or(Reading { text: String::new(), letters: Vec::new() }, |(_, reading)| reading))
}

/// What a line says in letters and in digits (a word has not both), each with its score.
fn read_line(line: &Line, bank: &Bank, classes: &Classes) -> [(f64, Reading); 2] {
    let blank = Raster::dark(bank.layout.width, bank.layout.height);
    let surroundings = Surroundings::new(bank, &blank, None);
    let glance = |picture: &Raster| surroundings.glance(bank, picture, classes.len());
    let mut looks = parse(line, bank, &glance);
    for look in &mut looks {
        let picture = cell_picture(line, bank, look.columns, look.extent);
        look.matches = surroundings.compare(bank, &picture.blur(BLUR_PX), classes.len());
        for found in &mut look.matches {
            found.similarity += MORE_INK * bank.templates[found.template].ink_h();
        }
    }
    [false, true].map(|digits| spell(line, &looks, classes, digits))
}

/// Cuts the line so that its letters explain the most ink.
fn parse(line: &Line, bank: &Bank, compare: &impl Fn(&Raster) -> Vec<Match>) -> Vec<Look> {
    let n_cuts = line.cuts.len();
    let letter_mass = line.letter_px * line.stroke_px * line.ink_level();
    let mut best: Vec<(f64, Option<usize>)> = vec![(0.0, None)];
    let mut found: Vec<Vec<Option<Look>>> = vec![Vec::new()];
    for end in 1..n_cuts {
        let mut here = (best[end - 1].0, None);
        let mut row = Vec::new();
        for (start, (before, _)) in best.iter().enumerate() {
            let [from, to] = [line.cuts[start], line.cuts[end]];
            let narrow = (to - from) as f64 <= MAX_WIDTH_H * line.letter_px + line.stroke_px;
            let look = narrow.then(|| look(line, bank, [from, to], compare)).flatten();
            if let Some(Look { matches, mass, .. }) = &look {
                let similarity = f64::from(top(matches, |_| true).1);
                let touch_cost = if line.touches(from) { TOUCH_COST } else { 0.0 };
                let gap_cost = if line.has_gap(from, to) { GAP_COST } else { 0.0 };
                let cost = (LETTER_COST + touch_cost + gap_cost) * letter_mass;
                let gain = before + mass * (similarity - LEAST_SIMILARITY) - cost;
                if gain > here.0 {
                    here = (gain, Some(start));
                }
            }
            row.push(look);
        }
        best.push(here);
        found.push(row);
    }
    let mut letters = Vec::new();
    let mut end = n_cuts - 1;
    while end > 0 {
        match best[end].1 {
            None => end -= 1,
            Some(start) => {
                letters.extend(found[end][start].take());
                end = start;
            }
        }
    }
    letters.reverse();
    letters
}

/// Compares the ink between two columns with the bank: its matches, box and ink.
fn look(
    line: &Line,
    bank: &Bank,
    [from, to]: [usize; 2],
    compare: &impl Fn(&Raster) -> Vec<Match>,
) -> Option<Look> {
    let ink_box = line.ink_box(from, to)?;
    let mass = line.mass(from, to);
    if mass < 0.5 * line.letter_px * line.stroke_px {
        return None;
    }
    let own = [ink_box[1], ink_box[3]];
    let likely = (HEIGHTS[0]..=HEIGHTS[1]).contains(&((own[1] - own[0]) / line.letter_px));
    let extents = [Some(line.extent), likely.then_some(own)];
    let looks = extents.into_iter().flatten().map(|[top, bottom]| {
        let extent = [ink_box[0], top, ink_box[2], bottom];
        let picture = cell_picture(line, bank, [from, to], extent);
        Look { matches: compare(&picture.blur(BLUR_PX)), columns: [from, to], extent, mass }
    });
    let similarity = |look: &Look| top(&look.matches, |_| true).1;
    looks.reduce(|a, b| if similarity(&b) > similarity(&a) { b } else { a })
}

/// The ink between two columns, its box stretched onto the bank's cell.
fn cell_picture(
    line: &Line,
    bank: &Bank,
    [from, to]: [usize; 2],
    [left, top, right, bottom]: [f64; 4],
) -> Raster {
    let cell_h = f64::from(PX_PER_H);
    let down = (bottom - top).max(1.0) / cell_h;
    let aspect = (right - left) / (bottom - top).max(1.0);
    let across = if aspect < MIN_ASPECT { down } else { (right - left) / (ASPECT * cell_h) };
    let [middle_x, middle_y] = bank.layout.middle_px();
    let (x, y) = (0.5 * (left + right), 0.5 * (top + bottom));
    let mut picture = Raster::dark(bank.layout.width, bank.layout.height);
    for (index, value) in picture.values.iter_mut().enumerate() {
        let column = (index % bank.layout.width) as f64 - middle_x;
        let row = (index / bank.layout.width) as f64 - middle_y;
        let clip = |at: f64| at.clamp(from as f64, to as f64);
        let columns = [clip(x + across * column), clip(x + across * (column + 1.0))];
        let rows = [y + down * row, y + down * (row + 1.0)];
        *value = line.ink.sum(columns, rows) / narrow(across * down);
    }
    picture
}

/// Names the letters of a cut line, from the letters or from the digits; and the share of the
/// line's ink that they explain.
fn spell(line: &Line, looks: &[Look], classes: &Classes, digits: bool) -> (f64, Reading) {
    let allowed = |class: usize| {
        let name = classes.name(class, None);
        name.is_ascii_digit() == digits || (digits && "OI".contains(name))
    };
    let mut explained = 0.0;
    let letters = looks.iter().map(|Look { matches, extent, mass, .. }| {
        let (class, similarity) = top(matches, allowed);
        explained += mass * f64::from(similarity);
        let letter = match classes.name(class, None) {
            'O' if digits => '0',
            'I' if digits => '1',
            name => name,
        };
        let box_px = extent.map(|px| px * line.step);
        let p = libm::exp(ln_share(matches, class));
        ReadLetter { letter, p, similarity: f64::from(similarity), box_px }
    });
    let letters: Vec<ReadLetter> = letters.collect();
    let total = line.mass(line.cuts[0], line.cuts[line.cuts.len() - 1]).max(1e-9);
    let text = letters.iter().map(|letter| letter.letter).collect();
    let rarity = if digits { DIGITS_COST } else { 0.0 };
    (explained / total - rarity, Reading { text, letters })
}

/// The most similar of some classes.
fn top(matches: &[Match], allowed: impl Fn(usize) -> bool) -> (usize, f32) {
    let mut best = (0, f32::NEG_INFINITY);
    for (class, found) in matches.iter().enumerate().filter(|(class, _)| allowed(*class)) {
        if found.similarity > best.1 {
            best = (class, found.similarity);
        }
    }
    best
}
