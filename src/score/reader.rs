//! The reader for one word. Once prepared, the reader judges each photo in a few milliseconds.

use noctograph_core::parallel;
use noctograph_core::parallel::prelude::*;

use super::align::Finder;
use super::alphabet::{classes_of, spells};
use super::judge::{Expected, Judgment, letter_verdict};
use super::lattice::{Choice, Columns};
use super::light::{Frame, Light, Rgb, full_light, luminance, map};
use super::plane::{Grid, LetterPage, Placed};
use super::raster::{Page, Raster, narrow, whole};
use super::reading::{Reading, is_clear, read};
use super::spelling::likeliest;
use super::strip::{CAP_PX, HEAD_ROW, HEIGHT, MARGIN_PX, SIDE_PX, Strip};
use super::verdict::{LetterVerdict, Placement, Reason, Verdict};
use super::view::View;
use super::{
    BLUR_H, MAX_SHIFT_H, MIN_CAP_HEIGHT_PX, PEN_H, PX_PER_H, ScoreOptions, cap_height_m, check,
    check_size, color,
};
use noctograph_core::error::Result;
use noctograph_core::geometry::{bounds, distance};
use noctograph_core::photo::Photo;
use noctograph_core::settings::Described;
use noctograph_core::strokes::{Glyph, Strokes};

/// Fraction of the ink's area from whose brightest pixels the mean color is computed. Even with
/// half of its letters missing, a word has this much ink.
const INK_PART: f64 = 0.5;

/// Minimum fraction of the light in a letter's cell that must have the color of its page. With a
/// smaller fraction, the letter is assumed to differ in color. White light beside an overexposed
/// blue line has 0.5.
const LEAST_OF_COLOR: f32 = 0.25;

/// Minimum probability at which a letter that is read outside the word is taken seriously.
const CLEAR_P: f64 = 0.6;

/// Ratio between the odds in the blindly located line and at the word's position above which the
/// two contradict each other. For example, only one of them reads a white patch as an O.
const CONTRADICTION: f64 = 20.0;

/// Minimum number of letters at which a blind reading is unlikely to match the word by chance.
const MANY_LETTERS: usize = 3;

/// A reader for photos of one word.
pub struct Reader {
    options: ScoreOptions,
    pub(super) strokes: Strokes,
    pub(super) home: Placed,
    finder: Finder,
    pub(super) expected: Expected,
    /// The grid of the strip for each line of the word.
    pub(super) lines: Vec<Grid>,
    /// Index of each letter's line in the word.
    pub(super) line_of: Vec<usize>,
    /// The page of each letter.
    pub(super) pages: Vec<LetterPage>,
    /// Number of page pixels that the ink of each letter should cover.
    pub(super) ink_px: Vec<f64>,
}

/// The light of a word in one photo.
pub(super) struct Seen {
    pub(super) light: Light,
    pub(super) placed: Placed,
    /// Light level that counts as fully lit.
    pub(super) full_light: f32,
    /// Ratio of the fully lit level to the lowest visible level.
    pub(super) contrast: f32,
    /// One strip for each line of the word.
    pub(super) strips: Vec<Strip>,
    /// The class probabilities of each strip.
    pub(super) columns: Vec<Columns>,
    /// The class probabilities of all lines together, including the light beside the word.
    around: Columns,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader").field("word", &self.strokes.word).finish_non_exhaustive()
    }
}

impl Reader {
    /// Creates a reader for a word.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`](noctograph_core::error::Error::Input) for an empty word, a drawing,
    /// a letter that the reader cannot read or that has no lit stroke, a letter that is too narrow
    /// or too wide, or an option out of range.
    pub fn new(strokes: &Strokes, options: &ScoreOptions) -> Result<Self> {
        options.check("score", None)?;
        check(strokes)?;
        let home = Placed::home(strokes);
        // The ink's area is the strokes' total length multiplied by the pen's width.
        let ink_px = strokes.glyphs.iter().map(|glyph| {
            let lit = glyph.moves.iter().filter(|step| step.lit);
            let length_m: f64 = lit.map(|step| distance(step.from_m, step.to_m)).sum();
            let length_h = length_m / glyph.cell.cap_height_m;
            length_h * PEN_H * f64::from(PX_PER_H) * f64::from(PX_PER_H)
        });
        let lines = strokes.lines();
        let line_of = lines.iter().enumerate().flat_map(|(n, line)| line.clone().map(move |_| n));
        let mut reader = Self {
            options: options.clone(),
            strokes: strokes.clone(),
            home,
            finder: Finder::new(strokes, home),
            expected: Expected::new(strokes),
            line_of: line_of.collect(),
            lines: lines.into_iter().map(|line| strip_grid(&strokes.glyphs[line])).collect(),
            pages: strokes.glyphs.iter().map(|glyph| LetterPage::new(&glyph.cell)).collect(),
            ink_px: ink_px.collect(),
        };
        if reader.expected.is_untrained() {
            let drawn = reader.drawn_columns();
            reader.expected.learn(&drawn);
        }
        Ok(reader)
    }

    /// Returns the class probabilities of a drawing of the word without any fault.
    pub(super) fn drawn_columns(&self) -> Columns {
        let drawn = self.lines.iter().map(|grid| {
            let light = draw(grid, &self.home, &self.strokes.glyphs, CAP_PX as f32).values;
            // The light is doubled because the blur halves the light of thin strokes.
            let light: Vec<f32> = light.iter().map(|value| (2.0 * value).min(1.0)).collect();
            Columns::along(&Strip::drawn(grid.width, light))
        });
        Columns::joined(drawn)
    }

    /// Returns the verdict on a photo, without causes.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`](noctograph_core::error::Error::Input) for a photo whose size
    /// differs from the view's.
    pub fn score(&self, photo: &Photo, view: &View) -> Result<Verdict> {
        Ok(self.score_with_light(photo, view)?.0)
    }

    /// Returns the strips of a photo's lines as training data for the net: the number of columns of
    /// each strip, and its 40 rows of pixels with two bytes per pixel.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Self::score`].
    pub fn strips(&self, photo: &Photo, view: &View) -> Result<Vec<(usize, Vec<u8>)>> {
        check_size(photo, view)?;
        let seen = self.find_light(photo, view);
        let strips = seen.iter().flat_map(|seen| &seen.strips);
        Ok(strips.map(|strip| (strip.width, strip.bytes(0..strip.width))).collect())
    }

    /// Returns the verdict without causes, and the light at the word's position if there is any.
    pub(super) fn score_with_light(
        &self,
        photo: &Photo,
        view: &View,
    ) -> Result<(Verdict, Option<Seen>)> {
        check_size(photo, view)?;
        let (reading, seen) = parallel::join(|| read(photo), || self.find_light(photo, view));
        // `None` means that the camera cannot see where the word should be.
        let pixel_px = self.finder.grid.pixel_px(view, &self.home);
        let cap_height_px = pixel_px.map(|px| f64::from(PX_PER_H) * px);
        let seen = match seen {
            Ok(seen) => seen,
            Err(reason) => {
                let verdict = Verdict::unseen(&self.strokes, Some(reason), cap_height_px);
                let second_opinion = Some(reading.text);
                return Ok((Verdict { second_opinion, ..verdict }, None));
            }
        };
        // The word is judged both at its expected position and in the lines that blind recognition
        // locates. The judgment with the better odds is used, unless the two contradict each other.
        let in_place = (!self.has_letters_elsewhere(&reading, &seen, view))
            .then(|| Columns::joined(seen.columns.iter().cloned()));
        let blind = (!reading.letters.is_empty()).then(|| reading.columns.clone());
        let evidence = [in_place, blind].into_iter().flatten();
        let judgments = evidence.map(|columns| self.expected.judge(&columns));
        let n_letters = reading.letters.len();
        let is_spelled = n_letters >= MANY_LETTERS && spells(&reading.text, &self.strokes.word);
        let most = if is_spelled { f64::INFINITY } else { CONTRADICTION };
        let better = judgments.reduce(|place, line| {
            let [odds, blind_odds] =
                [&place, &line].map(|one| one.readability / (1.0 - one.readability));
            if (1.0..most).contains(&(blind_odds / odds)) { line } else { place }
        });
        let chosen = better.expect("letters beside the word were read");
        let judgment = chosen.against(self.expected.at_ends(&seen.around));
        Ok((self.verdict(judgment, &seen, cap_height_px, &reading), Some(seen)))
    }

    /// True if blind recognition clearly reads letters outside the strips of the word.
    fn has_letters_elsewhere(&self, reading: &Reading, seen: &Seen, view: &View) -> bool {
        let frames: Vec<Frame> =
            self.lines.iter().filter_map(|grid| around(grid).frame(view, &seen.placed)).collect();
        is_clear(&reading.letters)
            && reading.letters.iter().any(|letter| {
                let [left, top, right, bottom] = letter.box_px;
                let (x, y) = (0.5 * (left + right), 0.5 * (top + bottom));
                letter.p >= CLEAR_P
                    && !frames.iter().any(|[left, top, right, bottom]| {
                        (*left..=*right).contains(&x) && (*top..=*bottom).contains(&y)
                    })
            })
    }

    /// Locates the word's light in a photo of the view's size. The error is the reason for its
    /// absence.
    fn find_light(&self, photo: &Photo, view: &View) -> std::result::Result<Seen, Reason> {
        // Crops the photo to the part that may show the word, and measures its exposure.
        let grid = &self.finder.grid;
        let frame = grid.widened(SIDE_PX * usize::from(PX_PER_H) / CAP_PX).frame(view, &self.home);
        let decoded =
            grid.pixel_px(view, &self.home).and_then(|px| Light::decode(photo, frame, px));
        let (light, sky) = decoded.ok_or(Reason::NotInPhoto)?;
        let colors = grid.resample(&light, view, &self.home, |light| light);
        let bright = brightness(grid, &colors);
        let ink_px = self.ink_px.iter().sum();
        let (full_light, contrast) = full_light(&bright, sky, ink_px).ok_or(Reason::NoLight)?;
        let color = color::of_brightest(&colors, whole(INK_PART * ink_px));

        // Cuts out a strip for each line, and then a wider one with the light beside it.
        let placed = self.finder.place(&bright.exposed(full_light));
        let wide: Vec<Grid> = self.lines.iter().map(around).collect();
        let channels = Strip::channels(&light, color);
        let grids = self.lines.iter().enumerate().chain(wide.iter().enumerate());
        let strips = grids.map(|(line, grid)| {
            let mut strip = Strip::cut(grid, &channels, view, &placed, full_light);
            for (glyph, glyph_line) in self.strokes.glyphs.iter().zip(&self.line_of) {
                if *glyph_line == line && classes_of(glyph.character).is_none() {
                    strip.darken(grid, lit_bounds_m(std::slice::from_ref(glyph)));
                }
            }
            strip
        });
        let mut strips: Vec<Strip> = strips.collect();
        let around: Vec<Strip> =
            strips.split_off(wide.len()).into_iter().map(Strip::where_lit).collect();
        let every_strip = strips.par_iter().chain(&around);
        let mut columns: Vec<Columns> = every_strip.map(Columns::along).collect();
        let around = Columns::joined(columns.split_off(strips.len())).unexplained_as_dark();
        Ok(Seen { light, placed, full_light, contrast, strips, columns, around })
    }

    /// Turns a judgment into a verdict, with the reason if the word is not legible. `cap_height_px`
    /// is the height of a capital in the photo, if the camera sees the word.
    fn verdict(
        &self,
        judgment: Judgment,
        seen: &Seen,
        cap_height_px: Option<f64>,
        reading: &Reading,
    ) -> Verdict {
        let reads_other_length =
            is_clear(&reading.letters) && reading.letters.len() != judgment.choices.len();
        let has_other_length = judgment.has_other_length() || reads_other_length;
        let Judgment { choices, rival, readability } = judgment;
        let judged = self.expected.by_character(choices);
        let read = self.spelled(&judged);
        let mut next_judged = judged.iter();
        let letters = self.strokes.glyphs.iter().map(|glyph| match classes_of(glyph.character) {
            None => LetterVerdict::not_judged(glyph.character),
            Some(_) => letter_verdict(next_judged.next().expect("one per letter"), glyph.character),
        });
        let letters: Vec<LetterVerdict> = letters.collect();
        let placement = Placement::from(&seen.placed);
        let reach_m = MAX_SHIFT_H * cap_height_m(&self.strokes);
        let has_few_px = cap_height_px.is_some_and(|px| px < MIN_CAP_HEIGHT_PX);
        let is_likeliest = rival.as_ref().is_none_or(|rival| rival.p <= 0.5);
        let is_read = letters.iter().all(|letter| letter.best == Some(letter.expected));
        // If touching letters form one glyph, not every letter was judged.
        let is_whole = !self.is_joined();
        let legible = is_whole && is_likeliest && readability >= self.options.legible_probability;
        // Selects the first reason that applies. Reasons that concern the photo come before those
        // that concern its letters.
        let reasons = [
            (has_few_px, Reason::TooSmall),
            (has_other_length || !is_whole, Reason::OtherLength),
            (!placement.is_in_range(reach_m), Reason::OutOfRange),
            (is_read && is_likeliest, Reason::Unsure),
        ];
        let first = reasons.into_iter().find(|(applies, _)| *applies);
        let reason = (!legible).then(|| first.map_or(Reason::Misread, |(_, reason)| reason));
        Verdict {
            read,
            legible,
            readability,
            rival,
            placement: Some(placement),
            letters,
            reason,
            second_opinion: Some(reading.text.clone()),
            ..Verdict::unseen(&self.strokes, None, cap_height_px)
        }
    }

    /// True if some letters of the word are joined into one glyph, such as by a bar through them.
    fn is_joined(&self) -> bool {
        let glyphs = self.strokes.glyphs.iter().map(|glyph| glyph.character);
        judged_characters(glyphs).len() != judged_characters(self.strokes.word.chars()).len()
    }

    /// Returns the likeliest spelling of each word, with spaces, line ends and punctuation copied
    /// from the expected text.
    fn spelled(&self, choices: &[Choice]) -> String {
        if self.is_joined() {
            let glyphs = self.strokes.glyphs.iter().map(|glyph| glyph.character);
            return likeliest(choices, &judged_characters(glyphs)).into_iter().collect();
        }
        let mut rest = choices;
        let mut read = String::new();
        for word in self.strokes.word.split_inclusive(char::is_whitespace) {
            let expected = judged_characters(word.chars());
            let in_word;
            (in_word, rest) = rest.split_at(expected.len());
            // A word whose letters are all read as expected needs no spelling model.
            let is_read =
                in_word.iter().zip(&expected).all(|(choice, c)| choice.best(*c).0 == Some(*c));
            let best = if is_read { expected } else { likeliest(in_word, &expected) };
            let mut letters = best.into_iter();
            read.extend(
                word.chars().map(|c| classes_of(c).and_then(|_| letters.next()).unwrap_or(c)),
            );
        }
        read
    }
}

/// Keeps only the letters and digits.
fn judged_characters(characters: impl Iterator<Item = char>) -> Vec<char> {
    characters.filter(|character| classes_of(*character).is_some()).collect()
}

/// Returns the grid of a line, widened by the margin in which extra letters are searched.
fn around(line: &Grid) -> Grid {
    line.widened(SIDE_PX - MARGIN_PX)
}

/// Returns the grid for the strip of one line of letters, in the word's plane.
fn strip_grid(glyphs: &[Glyph]) -> Grid {
    let cell = glyphs[0].cell;
    let pitch_m = cell.cap_height_m / CAP_PX as f64;
    let [left_m, _, right_m, _] = lit_bounds_m(glyphs);
    let width = whole(((right_m - left_m) / pitch_m).ceil()) + 2 * MARGIN_PX;
    Grid {
        left_m: left_m - MARGIN_PX as f64 * pitch_m,
        top_m: cell.baseline_m + cell.cap_height_m + HEAD_ROW as f64 * pitch_m,
        pitch_m,
        width: width.next_multiple_of(2),
        height: HEIGHT,
    }
}

/// Returns the bounding box of the lit moves of letters, in meters: left, bottom, right and top.
pub(super) fn lit_bounds_m(glyphs: &[Glyph]) -> [f64; 4] {
    let lit = glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
    bounds(lit.flat_map(|step| [step.from_m, step.to_m]))
}

/// Returns the light on a letter's page that has the color of the strokes, 0 to 1. `ink_px` is the
/// area of the letter's strokes in pixels of the page.
pub(super) fn pure_ink(page: &LetterPage, ink_px: f64, seen: &Seen, view: &View) -> Raster {
    let grid = &page.grid;
    // The color is measured in the photo's pixels, because a page pixel may mix the light of a
    // stroke with that of a status light beside it.
    let [mut color, cell_color] = [grid, &page.columns_of_cell()].map(|part| {
        let frame = part.frame(view, &seen.placed);
        let pixels = frame.map_or(Vec::new(), |frame| seen.light.within(frame));
        let fraction = INK_PART * ink_px / (part.width * part.height) as f64;
        let n_brightest = whole(fraction * pixels.len() as f64);
        if pixels.is_empty() { [0.0; 3] } else { color::of_brightest(&pixels, n_brightest) }
    });
    // The page also shows parts of other letters, which may be brighter or differ in color.
    if color::pure(color)(cell_color) < LEAST_OF_COLOR * luminance(cell_color) {
        color = cell_color;
    }
    let in_color = color::pure(color);
    let light = grid.resample(&seen.light, view, &seen.placed, |light| [in_color(light); 3]);
    let ink = brightness(grid, &light);
    // Thin strokes fill half a pixel. Therefore, the fully lit level is at most the ink's median.
    let mut levels = ink.values.clone();
    // A letter's page is never empty, so the index does not underflow.
    let rank = whole(INK_PART * ink_px).min(levels.len() - 1);
    let level = *levels.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1;
    ink.exposed(seen.full_light.min(level))
}

/// Returns the luminance at each pixel of a grid.
fn brightness(grid: &Grid, light: &[Rgb]) -> Raster {
    Raster { width: grid.width, height: grid.height, values: map(light, luminance) }
}

/// Draws the intended letters, blurred, on a grid with `cap_px` pixels per cap height. Light is
/// from 0 to 1.
pub(super) fn draw(grid: &Grid, home: &Placed, glyphs: &[Glyph], cap_px: f32) -> Raster {
    let mut page = Page::blank(grid.width, grid.height);
    for glyph in glyphs {
        page.stroke(&glyph.moves, narrow(PEN_H) * cap_px, grid.transform(home));
    }
    page.into_raster().blur(BLUR_H * cap_px)
}
