//! The reader of one word: prepared once, it reads one photo after another in some milliseconds.

use rayon::prelude::*;

use super::align::Finder;
use super::alphabet::{classes_of, spells};
use super::color;
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
    check_size,
};
use noctograph_core::error::Result;
use noctograph_core::geometry::{bounds, distance};
use noctograph_core::photo::Photo;
use noctograph_core::settings::Described;
use noctograph_core::strokes::{Glyph, Strokes};

/// Fraction of the word's ink whose mean is its color. Half-missing letters have no more ink.
const INK_PART: f64 = 0.5;

/// Least fraction of a cell's light that has the color of its page. With less, the letter has
/// another color. White tinted by an overexposed blue line has 0.5.
const LEAST_OF_COLOR: f32 = 0.25;

/// Probability from which a letter that is read beside the word counts.
const CLEAR_P: f64 = 0.6;

/// Ratio of the odds in the line found blindly to those at the word's position from which the two
/// views contradict each other. The outline of a white patch is an O in only one of them.
const CONTRADICTION: f64 = 20.0;

/// Number of letters from which a word is not read blindly by chance.
const MANY_LETTERS: usize = 3;

/// Reads photos of one word.
pub struct Reader {
    options: ScoreOptions,
    pub(super) strokes: Strokes,
    pub(super) home: Placed,
    finder: Finder,
    pub(super) expected: Expected,
    /// The grid of each line's strip.
    pub(super) lines: Vec<Grid>,
    /// The line of each letter.
    pub(super) line_of: Vec<usize>,
    /// One page for each letter.
    pub(super) pages: Vec<LetterPage>,
    /// Pixels of a page that each letter's ink should cover.
    pub(super) ink_px: Vec<f64>,
}

/// The light of a word.
pub(super) struct Seen {
    pub(super) light: Light,
    pub(super) placed: Placed,
    /// Level of light that counts as fully lit.
    pub(super) full_light: f32,
    /// Ratio of that level to the least visible light.
    pub(super) contrast: f32,
    /// One strip for each line of the word.
    pub(super) strips: Vec<Strip>,
    /// The columns of each strip.
    pub(super) columns: Vec<Columns>,
    /// The columns of all lines, with those beside them.
    around: Columns,
}

impl std::fmt::Debug for Reader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader").field("word", &self.strokes.word).finish_non_exhaustive()
    }
}

impl Reader {
    /// Prepares the reading of a word.
    ///
    /// # Errors
    ///
    /// [`Error::Input`](noctograph_core::error::Error::Input) for an empty word or a drawing, a
    /// letter that the reader cannot read or that is not lit, letters too narrow or too wide, or an
    /// option out of range.
    pub fn new(strokes: &Strokes, options: &ScoreOptions) -> Result<Self> {
        options.check("score", None)?;
        check(strokes)?;
        let home = Placed::home(strokes);
        // Area of the ink: length of the strokes by width of the pen.
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

    /// Returns the columns of a faultless drawing of the word.
    pub(super) fn drawn_columns(&self) -> Columns {
        let drawn = self.lines.iter().map(|grid| {
            let light = draw(grid, &self.home, &self.strokes.glyphs, CAP_PX as f32).values;
            // The blur halves the light of thin strokes.
            let light: Vec<f32> = light.iter().map(|value| (2.0 * value).min(1.0)).collect();
            Columns::along(&Strip::drawn(grid.width, light))
        });
        Columns::joined(drawn)
    }

    /// Returns the verdict on a photo, without causes.
    ///
    /// # Errors
    ///
    /// [`Error::Input`](noctograph_core::error::Error::Input) for a photo of another size.
    pub fn score(&self, photo: &Photo, view: &View) -> Result<Verdict> {
        Ok(self.score_with_light(photo, view)?.0)
    }

    /// Returns the strip of each line for training the net: its number of columns, and the bytes
    /// of its 40 rows with two channels per pixel.
    ///
    /// # Errors
    ///
    /// As [`Self::score`].
    pub fn strips(&self, photo: &Photo, view: &View) -> Result<Vec<(usize, Vec<u8>)>> {
        check_size(photo, view)?;
        let seen = self.find_light(photo, view);
        let strips = seen.iter().flat_map(|seen| &seen.strips);
        Ok(strips.map(|strip| (strip.width, strip.bytes(0..strip.width))).collect())
    }

    /// Returns the verdict without causes, and the light at the position of the word, if any.
    pub(super) fn score_with_light(
        &self,
        photo: &Photo,
        view: &View,
    ) -> Result<(Verdict, Option<Seen>)> {
        check_size(photo, view)?;
        let (reading, seen) = rayon::join(|| read(photo), || self.find_light(photo, view));
        // `None` if the photo cannot show a capital.
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
        // The word is judged at its position and in the lines that blind recognition finds. The
        // view with the better odds counts, unless it contradicts the other.
        let in_place = (!self.has_letters_elsewhere(&reading, &seen, view))
            .then(|| Columns::joined(seen.columns.iter().cloned()));
        let blind = (!reading.letters.is_empty()).then(|| reading.columns.clone());
        let views = [in_place, blind].into_iter().flatten();
        let judgments = views.map(|columns| self.expected.judge(&columns));
        let n_letters = reading.letters.len();
        let is_spelled = n_letters >= MANY_LETTERS && spells(&reading.text, &self.strokes.word);
        let most = if is_spelled { f64::INFINITY } else { CONTRADICTION };
        let judgment = judgments.reduce(|place, line| {
            let [odds, blind_odds] =
                [&place, &line].map(|one| one.readability / (1.0 - one.readability));
            if (1.0..most).contains(&(blind_odds / odds)) { line } else { place }
        });
        let judgment = judgment.expect("letters beside the word were read");
        let judgment = judgment.against(self.expected.at_ends(&seen.around));
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

    /// Finds the word's light in a photo of the view's size, or returns why there is none.
    fn find_light(&self, photo: &Photo, view: &View) -> std::result::Result<Seen, Reason> {
        // The part of the photo that may show the word, and its exposure.
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

        // A strip of each line, then a wider one that includes what is beside it.
        let placed = self.finder.place(&bright.exposed(full_light));
        let wide: Vec<Grid> = self.lines.iter().map(around).collect();
        let grids = self.lines.iter().enumerate().chain(wide.iter().enumerate());
        let strips = grids.map(|(line, grid)| {
            let mut strip = Strip::cut(grid, &light, view, &placed, color, full_light);
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

    /// Words a judgment as a verdict, with its reason.
    fn verdict(
        &self,
        judgment: Judgment,
        seen: &Seen,
        cap_height_px: Option<f64>,
        reading: &Reading,
    ) -> Verdict {
        let has_other_length = judgment.has_other_length();
        let Judgment { choices, rival, readability } = judgment;
        let reads_other_length =
            is_clear(&reading.letters) && reading.letters.len() != choices.len();
        let choices = self.expected.by_character(choices);
        let read = self.spelled(&choices);
        let mut choices = choices.iter();
        let letters = self.strokes.glyphs.iter().map(|glyph| match classes_of(glyph.character) {
            None => LetterVerdict::not_judged(glyph.character),
            Some(_) => letter_verdict(choices.next().expect("one a letter"), glyph.character),
        });
        let letters: Vec<LetterVerdict> = letters.collect();
        let placement = Placement::from(&seen.placed);
        let reach_m = MAX_SHIFT_H * cap_height_m(&self.strokes);
        let has_few_px = cap_height_px.is_some_and(|px| px < MIN_CAP_HEIGHT_PX);
        let is_likeliest = rival.as_ref().is_none_or(|rival| rival.p <= 0.5);
        let is_read = letters.iter().all(|letter| letter.best == Some(letter.expected));
        // If letters are joined in one glyph, the others were not judged.
        let is_whole = !self.is_joined();
        let legible = is_whole && is_likeliest && readability >= self.options.legible_probability;
        // The first reason that applies. Reasons of the photo come before those of letters.
        let reason = match () {
            () if legible => None,
            () if has_few_px => Some(Reason::TooSmall),
            () if has_other_length || reads_other_length || !is_whole => Some(Reason::OtherLength),
            () if !placement.overlaps_page(reach_m) => Some(Reason::OutOfRange),
            () if is_read && is_likeliest => Some(Reason::Unsure),
            () => Some(Reason::Misread),
        };
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

    /// True if letters that touch, for example by a bar through them, are one glyph.
    fn is_joined(&self) -> bool {
        let glyphs = self.strokes.glyphs.iter().map(|glyph| glyph.character);
        judged_characters(glyphs).len() != judged_characters(self.strokes.word.chars()).len()
    }

    /// Returns the likeliest spelling of each word, with the spaces, line ends and punctuation of
    /// the expected text.
    fn spelled(&self, choices: &[Choice]) -> String {
        if self.is_joined() {
            let glyphs = self.strokes.glyphs.iter().map(|glyph| glyph.character);
            return likeliest(choices, &judged_characters(glyphs)).into_iter().collect();
        }
        let mut rest = choices;
        let mut read = String::new();
        for word in self.strokes.word.split_inclusive(char::is_whitespace) {
            let expected = judged_characters(word.chars());
            let choices;
            (choices, rest) = rest.split_at(expected.len());
            // Letters that are read as expected without the spelling stay as they are.
            let is_read =
                choices.iter().zip(&expected).all(|(choice, c)| choice.best(*c).0 == Some(*c));
            let letters = if is_read { expected } else { likeliest(choices, &expected) };
            let mut letters = letters.into_iter();
            read.extend(
                word.chars().map(|c| classes_of(c).and_then(|_| letters.next()).unwrap_or(c)),
            );
        }
        read
    }
}

/// Returns the characters that are letters or digits.
fn judged_characters(characters: impl Iterator<Item = char>) -> Vec<char> {
    characters.filter(|character| classes_of(*character).is_some()).collect()
}

/// Returns the grid of a line together with its sides.
fn around(line: &Grid) -> Grid {
    line.widened(SIDE_PX - MARGIN_PX)
}

/// Returns the grid of a line of letters in the word's plane.
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

/// Returns the box of the lit moves of letters: left, bottom, right, top.
pub(super) fn lit_bounds_m(glyphs: &[Glyph]) -> [f64; 4] {
    let lit = glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
    bounds(lit.flat_map(|step| [step.from_m, step.to_m]))
}

/// Returns the light on a letter's page that has the color of the strokes.
pub(super) fn pure_ink(page: &LetterPage, ink_px: f64, seen: &Seen, view: &View) -> Raster {
    let grid = &page.grid;
    // The color comes from the photo's pixels. A pixel of the page may contain both a stroke and
    // the status light beside it.
    let [mut color, cell_color] = [grid, &page.columns_of_cell()].map(|part| {
        let frame = part.frame(view, &seen.placed);
        let pixels = frame.map_or(Vec::new(), |frame| seen.light.within(frame));
        let fraction = INK_PART * ink_px / (part.width * part.height) as f64;
        let n_brightest = whole(fraction * pixels.len() as f64);
        if pixels.is_empty() { [0.0; 3] } else { color::of_brightest(&pixels, n_brightest) }
    });
    // Neighboring letters may be brighter and of another color.
    if color::pure(color)(cell_color) < LEAST_OF_COLOR * luminance(cell_color) {
        color = cell_color;
    }
    let pure = color::pure(color);
    let pure = grid.resample(&seen.light, view, &seen.placed, |light| [pure(light); 3]);
    let pure = brightness(grid, &pure);
    // Thin strokes fill half of a pixel, so that full light is at most the median of the ink.
    let mut levels = pure.values.clone();
    let rank = whole(INK_PART * ink_px).min(levels.len() - 1);
    let level = *levels.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1;
    pure.exposed(seen.full_light.min(level))
}

/// Returns the luminance at each pixel of a grid.
fn brightness(grid: &Grid, light: &[Rgb]) -> Raster {
    Raster { width: grid.width, height: grid.height, values: map(light, luminance) }
}

/// Draws intended letters, blurred, on a grid of `cap_px` pixels per cap height.
pub(super) fn draw(grid: &Grid, home: &Placed, glyphs: &[Glyph], cap_px: f32) -> Raster {
    let mut page = Page::blank(grid.width, grid.height);
    for glyph in glyphs {
        page.stroke(&glyph.moves, narrow(PEN_H) * cap_px, grid.transform(home));
    }
    page.into_raster().blur(BLUR_H * cap_px)
}
