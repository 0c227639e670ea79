//! The reader of one word: prepared once, it reads one photo after another in some milliseconds.

use super::align::Finder;
use super::calibration::{CALIBRATION, readability};
use super::color;
use super::ink::Page;
use super::level;
use super::light::{Light, Rgb, luminance};
use super::net;
use super::page::LetterPage;
use super::plane::{Grid, Placed};
use super::raster::{Raster, whole};
use super::sequence::{Choice, Classes, Columns, classes_of};
use super::strip::{CAP_PX, HEAD_ROW, HEIGHT, MARGIN_PX, Strip};
use super::verdict::{LetterVerdict, Placement, Reason, Rival, RivalWord, Verdict};
use super::view::View;
use super::{
    BLUR_H, MAX_ROTATION_RAD, MAX_SHIFT_H, MIN_CAP_HEIGHT_PX, PEN_H, PX_PER_H, SCALES,
    ScoreOptions, cap_height_m, check, check_size,
};
use crate::error::Result;
use crate::letters::{Glyph, Strokes};
use crate::photo::Photo;

/// Share of the word's intended ink whose mean is the color of its ink. Much more takes in the dark
/// beside letters that are half missing.
const INK_SHARE: f64 = 0.5;

/// Shares below this are left out of a letter's row of confusions.
const LEAST_SHARE: f64 = 0.001;

/// Rivals that a letter names.
const N_RIVALS: usize = 3;

/// Reads photos of one word.
pub struct Reader {
    options: ScoreOptions,
    pub(super) strokes: Strokes,
    pub(super) home: Placed,
    finder: Finder,
    /// The classes of the net that count as each letter.
    expected: Vec<Classes>,
    /// Where each line of the word is cut out.
    pub(super) lines: Vec<Grid>,
    /// One for each letter.
    pub(super) pages: Vec<LetterPage>,
    /// Pixels of a page that each letter's ink should cover.
    pub(super) ink_px: Vec<f64>,
}

/// A word as it is seen.
pub(super) struct Sight {
    pub(super) verdict: Verdict,
    /// `None` where the photo does not show the word, or nothing shines there.
    pub(super) seen: Option<Seen>,
}

/// The light of a word.
pub(super) struct Seen {
    pub(super) light: Light,
    pub(super) placed: Placed,
    /// Level of light that counts as fully lit.
    pub(super) full_light: f32,
    /// The same by the least light that stands out.
    pub(super) contrast: f32,
    /// One for each line of the word.
    pub(super) strips: Vec<Strip>,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader").field("word", &self.strokes.word).finish_non_exhaustive()
    }
}

impl Reader {
    /// Prepares for a word.
    ///
    /// # Errors
    ///
    /// [`Error::Input`](crate::error::Error::Input) for an empty word or a drawing, a character that
    /// leaves no light, letters too narrow or too wide, or an option out of range.
    pub fn new(strokes: &Strokes, options: &ScoreOptions) -> Result<Self> {
        options.check()?;
        check(strokes)?;
        let home = Placed::home(strokes);
        let ink_px = |glyph: &Glyph| {
            let length_h = lit_length_m(glyph) / glyph.cell.cap_height_m;
            length_h * PEN_H * f64::from(PX_PER_H) * f64::from(PX_PER_H)
        };
        let same_line = |a: &Glyph, b: &Glyph| a.cell.baseline_m == b.cell.baseline_m;
        Ok(Self {
            options: options.clone(),
            strokes: strokes.clone(),
            home,
            finder: Finder::new(strokes, home),
            expected: strokes.glyphs.iter().map(|glyph| classes_of(glyph.character)).collect(),
            lines: strokes.glyphs.chunk_by(same_line).map(line).collect(),
            pages: strokes.glyphs.iter().map(|glyph| LetterPage::new(&glyph.cell)).collect(),
            ink_px: strokes.glyphs.iter().map(ink_px).collect(),
        })
    }

    /// Reads a photo.
    ///
    /// # Errors
    ///
    /// [`Error::Input`](crate::error::Error::Input) for a photo whose size is not the view's.
    ///
    /// # Panics
    ///
    /// If the photo has not three bytes a pixel.
    pub fn score(&self, photo: &Photo, view: &View) -> Result<Verdict> {
        Ok(self.sight(photo, view)?.verdict)
    }

    /// The strips that a photo shows, for the training of the net: of each line of the word, its
    /// columns and the bytes of 40 rows of them, two channels a pixel; none where nothing shines.
    ///
    /// # Errors
    ///
    /// As [`Self::score`].
    pub fn strips(&self, photo: &Photo, view: &View) -> Result<Vec<(usize, Vec<u8>)>> {
        let seen = self.see(photo, view)?;
        let strips = seen.iter().flat_map(|seen| &seen.strips);
        Ok(strips.map(|strip| (strip.width, strip.bytes().collect())).collect())
    }

    pub(super) fn sight(&self, photo: &Photo, view: &View) -> Result<Sight> {
        let cap_height_px = self.cap_height_px(view);
        let verdict = match (self.see(photo, view)?, cap_height_px) {
            (Ok(seen), _) => {
                let verdict = self.judge(&seen, cap_height_px);
                return Ok(Sight { verdict, seen: Some(seen) });
            }
            (Err(reason), px) => Verdict::unseen(&self.strokes, reason, px),
        };
        Ok(Sight { verdict, seen: None })
    }

    /// Finds the word's light.
    fn see(&self, photo: &Photo, view: &View) -> Result<std::result::Result<Seen, Reason>> {
        check_size(photo, view)?;
        let grid = self.finder.grid();
        let frame = grid.frame(view, &self.home);
        let decoded =
            grid.pixel_px(view, &self.home).and_then(|px| Light::decode(photo, frame, px));
        let Some(light) = decoded else { return Ok(Err(Reason::NotInPhoto)) };
        let colors = grid.resample(&light, view, &self.home);
        let bright = brightness(grid, &colors);
        let ink_px = self.ink_px.iter().sum();
        let Some((full_light, contrast)) = level::full_light(&bright, light.sky, ink_px) else {
            return Ok(Err(Reason::NoLight));
        };
        let placed = self.finder.place(&bright.exposed(full_light));
        let color = color::of_brightest(&colors, whole(INK_SHARE * ink_px));
        let cut = |grid| Strip::cut(grid, &light, view, &placed, color, full_light);
        let strips = self.lines.iter().map(cut).collect();
        Ok(Ok(Seen { light, placed, full_light, contrast, strips }))
    }

    /// Height of a capital in the photo; `None` where the photo cannot show it.
    fn cap_height_px(&self, view: &View) -> Option<f64> {
        self.finder.grid().pixel_px(view, &self.home).map(|px| f64::from(PX_PER_H) * px)
    }

    /// The shares at each column of some strips.
    pub(super) fn columns(strips: &[Strip]) -> Columns {
        Columns::joined(strips.iter().map(|strip| Columns::from_logits(&net::logits(strip))))
    }

    /// What stands in the place of each letter.
    pub(super) fn choices(&self, strips: &[Strip]) -> Vec<Choice> {
        Self::columns(strips).choices(&self.expected)
    }

    fn judge(&self, seen: &Seen, cap_height_px: Option<f64>) -> Verdict {
        let columns = Self::columns(&seen.strips);
        let choices = columns.choices(&self.expected);
        let readability = readability(&choices);
        let rival = self.rival(&columns, &choices);
        let letters: Vec<LetterVerdict> = choices
            .iter()
            .zip(&self.strokes.glyphs)
            .map(|(choice, glyph)| letter(choice, glyph))
            .collect();

        let Placed { shift_m, scale, rotation_rad, .. } = seen.placed;
        let reach_m = MAX_SHIFT_H * cap_height_m(&self.strokes);
        let in_range = libm::hypot(shift_m[0], shift_m[1]) <= reach_m
            && (SCALES[0]..=SCALES[1]).contains(&scale)
            && rotation_rad.abs() <= MAX_ROTATION_RAD;
        let is_likeliest = rival.as_ref().is_none_or(|rival| rival.p <= 0.5);
        let legible = is_likeliest && readability >= self.options.legible_probability;
        let reason = match () {
            () if legible => None,
            () if !in_range => Some(Reason::OutOfRange),
            () if cap_height_px.is_some_and(|px| px < MIN_CAP_HEIGHT_PX) => Some(Reason::TooSmall),
            () => Some(Reason::Misread),
        };
        Verdict {
            word: self.strokes.word.clone(),
            read: letters.iter().map(|letter| letter.best.unwrap_or('?')).collect(),
            legible,
            readability,
            rival,
            faithfulness: None,
            calibration: CALIBRATION,
            placement: Some(Placement { shift_m, scale, rotation_rad }),
            cap_height_px,
            letters,
            reason,
            second_opinion: None,
            causes: Vec::new(),
            advice: Vec::new(),
        }
    }

    /// The likeliest other word: with another letter in one place, or as a free reading has it.
    fn rival(&self, columns: &Columns, choices: &[Choice]) -> Option<RivalWord> {
        let word: Vec<char> = self.strokes.glyphs.iter().map(|glyph| glyph.character).collect();
        let own = columns.ln_p(&self.expected);
        let by_letter = choices.iter().enumerate().filter_map(|(index, choice)| {
            let &(letter, p) = choice.others.first()?;
            let mut rival = word.clone();
            rival[index] = letter_like(letter, word[index]);
            Some((rival.into_iter().collect::<String>(), libm::log(p / choice.p.max(1e-300))))
        });
        let is_word = |text: &str| {
            let sets: Vec<Classes> = text.chars().map(classes_of).collect();
            sets.len() == word.len() && sets.iter().zip(&self.expected).all(|(a, b)| a & b != 0)
        };
        let free = columns.freely().into_iter().map(|(text, _)| text);
        let free = free.filter(|text| !is_word(text) && !text.is_empty());
        let free = free.take(2).map(|text| {
            let sets: Vec<Classes> = text.chars().map(classes_of).collect();
            let like = |(at, c): (usize, char)| letter_like(c, word[at.min(word.len() - 1)]);
            (text.chars().enumerate().map(like).collect(), columns.ln_p(&sets) - own)
        });
        let best = by_letter.chain(free).reduce(|a, b| if b.1 > a.1 { b } else { a });
        best.map(|(word, ln_odds)| RivalWord { word, p: 1.0 / (1.0 + libm::exp(-ln_odds)) })
    }
}

/// The verdict on one letter.
fn letter(choice: &Choice, glyph: &Glyph) -> LetterVerdict {
    let expected = glyph.character;
    let rival = |(letter, p): &(char, f64)| Rival { letter: letter_like(*letter, expected), p: *p };
    let best_other = choice.others.first();
    let best = match best_other {
        _ if choice.none > choice.p && best_other.is_none_or(|other| choice.none > other.1) => None,
        Some((other, p)) if *p > choice.p => Some(letter_like(*other, expected)),
        _ => Some(expected),
    };
    let likely = choice.others.iter().filter(|other| other.1 >= LEAST_SHARE).map(rival);
    let mut confusion: Vec<Rival> =
        [Rival { letter: expected, p: choice.p }].into_iter().chain(likely).collect();
    confusion.sort_by(|a, b| b.p.total_cmp(&a.p));
    LetterVerdict {
        best,
        p: choice.p,
        no_letter: choice.none,
        rivals: choice.others.iter().take(N_RIVALS).map(rival).collect(),
        confusion,
        ..LetterVerdict::unseen(expected)
    }
}

/// A letter in the case of another one.
fn letter_like(letter: char, like: char) -> char {
    if like.is_lowercase() { letter.to_ascii_lowercase() } else { letter }
}

/// Where a line of letters is cut out of the word's plane.
fn line(glyphs: &[Glyph]) -> Grid {
    let cell = glyphs[0].cell;
    let pitch_m = cell.cap_height_m / CAP_PX as f64;
    let lit = glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
    let ends = lit.flat_map(|step| [step.from_m[0], step.to_m[0]]);
    let (left, right) = ends
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(left, right), x| (left.min(x), right.max(x)));
    let width = whole(((right - left) / pitch_m).ceil()) + 2 * MARGIN_PX;
    Grid {
        left_m: left - MARGIN_PX as f64 * pitch_m,
        top_m: cell.baseline_m + cell.cap_height_m + HEAD_ROW as f64 * pitch_m,
        pitch_m,
        width: width.next_multiple_of(2),
        height: HEIGHT,
    }
}

/// Length of what a letter's lit moves draw.
fn lit_length_m(glyph: &Glyph) -> f64 {
    let lit = glyph.moves.iter().filter(|step| step.lit);
    lit.map(|step| libm::hypot(step.to_m[0] - step.from_m[0], step.to_m[1] - step.from_m[1])).sum()
}

/// Light in the color of the strokes alone, on a letter's page. The color is taken from the photo's own
/// pixels: one of ours holds a stroke and the status light beside it.
pub(super) fn pure_ink(page: &LetterPage, ink_px: f64, seen: &Seen, view: &View) -> Raster {
    let grid = &page.grid;
    let frame = grid.frame(view, &seen.placed);
    let pixels = frame.map_or(Vec::new(), |frame| seen.light.within(&frame));
    let share = INK_SHARE * ink_px / (grid.width * grid.height) as f64;
    let n_brightest = whole(share * pixels.len() as f64);
    let color =
        if pixels.is_empty() { [0.0; 3] } else { color::of_brightest(&pixels, n_brightest) };
    let pure = color::pure(color);
    let pure = grid.resample_of(&seen.light, view, &seen.placed, |light| [pure(light); 3]);
    let pure = brightness(grid, &pure);
    // Thin strokes fill our pixels by half: half of the ink is full light, whatever the word's is.
    let mut levels = pure.values.clone();
    let rank = whole(INK_SHARE * ink_px).min(levels.len() - 1);
    let level = *levels.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1;
    pure.exposed(seen.full_light.min(level))
}

fn brightness(grid: &Grid, light: &[Rgb]) -> Raster {
    let values = light.iter().map(|light| luminance(*light)).collect();
    Raster { width: grid.width, height: grid.height, values }
}

/// Letters as the trail should draw them on a grid of `cap_px` pixels to a cap height, blurred.
pub(super) fn draw<'a>(
    grid: &Grid,
    home: &Placed,
    glyphs: impl Iterator<Item = &'a Glyph>,
    cap_px: f32,
) -> Raster {
    let mut page = Page::blank(grid.width, grid.height);
    for glyph in glyphs {
        page.stroke(&glyph.moves, PEN_H as f32 * cap_px, grid.page_from_plane(home));
    }
    page.dry().blur(BLUR_H * cap_px)
}
