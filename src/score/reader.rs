//! The prepared reader: all that can be known of a word before its photo is seen. One photo after
//! another is then read in some milliseconds.

use super::align::Finder;
use super::bank::{Bank, Classes};
use super::calibration::{CALIBRATION, ln_share, loss, probability};
use super::color;
use super::grid::{Grid, Placed};
use super::ink::Page;
use super::level;
use super::light::{Light, Rgb, luminance};
use super::matching::{Match, Surroundings};
use super::raster::{Raster, whole};
use super::verdict::{LetterVerdict, Placement, Reason, Rival, Verdict};
use super::view::View;
use super::{
    BLUR_PX, FAINT, MAX_ROTATION_RAD, MAX_SHIFT_H, MIN_CAP_HEIGHT_PX, PEN_PX, PX_PER_H, SCALES,
    ScoreOptions, cap_height_m, check, check_size,
};
use crate::error::Result;
use crate::letters::{Glyph, Strokes};
use crate::photo::Photo;

/// Share of a letter's intended ink whose mean is the color of its ink. Much more takes in the dark
/// beside a letter that is half missing.
const INK_SHARE: f64 = 0.5;

/// Change of a letter's picture, of its light, from which its ink's color is worth a second look.
const COLOR_MATTERS: f32 = 0.05;

/// Pens that a faultless photo may be drawn with: 0.05, 0.07 and 0.10 H. How wide a trail glows,
/// the references do not know, and it is no fault.
const PHOTO_PENS_PX: [f32; 3] = [0.05 * 32.0, PEN_PX, 0.10 * 32.0];

/// Reads photos of one word.
pub struct Reader {
    options: ScoreOptions,
    pub(super) strokes: Strokes,
    pub(super) home: Placed,
    finder: Finder,
    pub(super) classes: Classes,
    pub(super) banks: Vec<Bank>,
    pub(super) cells: Vec<Cell>,
}

/// The place of one letter.
pub(super) struct Cell {
    /// Index of its bank.
    pub(super) bank: usize,
    pub(super) class: usize,
    pub(super) grid: Grid,
    /// Pixels that its ink should cover.
    ink_px: f64,
    pub(super) surroundings: Surroundings,
    /// ln p of its faultless drawing.
    pub(super) ln_faultless: f64,
}

/// A word as it is seen.
pub(super) struct Sight {
    pub(super) verdict: Verdict,
    /// One for each letter; none where the word was not found.
    pub(super) looks: Vec<Look>,
    pub(super) placed: Option<Placed>,
    /// Full light by the least light that stands out.
    pub(super) contrast: Option<f32>,
}

/// A letter as it is seen.
pub(super) struct Look {
    pub(super) verdict: LetterVerdict,
    pub(super) loss: f64,
    /// Its light on the page, 1 is fully lit; `None` where there is none.
    pub(super) picture: Option<Raster>,
    /// Of this, what has the color of its ink and no other.
    pub(super) ink: Option<Raster>,
    pub(super) matches: Vec<Match>,
    /// Where the letter is found beside its place: right and down, in pixels of the page.
    pub(super) shift: [isize; 2],
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
    /// [`Error::Input`](crate::error::Error::Input) for an empty word or a drawing, a character that neither
    /// the font nor the typeface has, letters too narrow or too wide to be letters, or an option out
    /// of range.
    pub fn new(strokes: &Strokes, options: &ScoreOptions) -> Result<Self> {
        options.check()?;
        check(strokes)?;
        let home = Placed::home(strokes);
        let mut reader = Self {
            options: options.clone(),
            strokes: strokes.clone(),
            home,
            finder: Finder::new(strokes, home),
            classes: Classes::of(strokes.glyphs.iter().map(|glyph| glyph.character)),
            banks: Vec::new(),
            cells: Vec::new(),
        };
        for index in 0..strokes.glyphs.len() {
            let cell = reader.prepare(index);
            reader.cells.push(cell);
        }
        Ok(reader)
    }

    fn prepare(&mut self, index: usize) -> Cell {
        let glyph = &self.strokes.glyphs[index];
        let aspect = glyph.cell.width_m / glyph.cell.cap_height_m;
        // Equal cells differ in the last bits of their widths.
        let known = self.banks.iter().position(|bank| (bank.layout.aspect - aspect).abs() < 1e-6);
        let index_of_bank = known.unwrap_or(self.banks.len());
        if known.is_none() {
            let fonts = self.strokes.font.as_slice();
            let references = self.options.references;
            let may_lose: Vec<char> = self.strokes.glyphs.iter().map(|g| g.character).collect();
            self.banks.push(Bank::draw(aspect, &self.classes, fonts, references, &may_lose));
        }
        let bank = &self.banks[index_of_bank];
        let grid = bank.layout.grid(&glyph.cell);
        let beside = [index.checked_sub(1), Some(index + 1)].into_iter().flatten();
        let beside = beside.filter_map(|at| self.strokes.glyphs.get(at));
        let neighbours = draw(&grid, &self.home, beside.clone(), PEN_PX);
        let class = self.classes.class_of(glyph.character);
        let surroundings = Surroundings::new(bank, &neighbours, Some(class));
        let n_classes = self.classes.len();
        let ln_faultless = PHOTO_PENS_PX.map(|pen_px| {
            let letters = beside.clone().chain([glyph]);
            let faultless = draw(&grid, &self.home, letters, pen_px);
            ln_share(&surroundings.compare(bank, &faultless, n_classes), class)
        });
        let ln_faultless = ln_faultless.into_iter().fold(f64::INFINITY, f64::min);
        let length_h = lit_length_m([glyph]) / glyph.cell.cap_height_m;
        let ink_px = length_h * f64::from(PX_PER_H) * f64::from(PEN_PX);
        Cell { bank: index_of_bank, class, grid, ink_px, surroundings, ln_faultless }
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

    pub(super) fn sight(&self, photo: &Photo, view: &View) -> Result<Sight> {
        check_size(photo, view)?;
        let grid = self.finder.grid();
        let unseen = |reason, cap_height_px| {
            let verdict = Verdict::unseen(&self.strokes.word, reason, cap_height_px);
            Ok(Sight { verdict, looks: Vec::new(), placed: None, contrast: None })
        };
        let Some(light) = Light::decode(photo, view, grid, &self.home) else {
            return unseen(Reason::NotInPhoto, None);
        };
        let pixel_px = grid.pixel_px(view, &self.home).unwrap_or(0.0);
        let cap_height_px = f64::from(PX_PER_H) * pixel_px;
        let seen = brightness(grid, &grid.resample(&light, view, &self.home));
        let Some((full_light, contrast)) = level::full_light(&seen, light.sky, self.ink_px())
        else {
            return unseen(Reason::NoLight, Some(cap_height_px));
        };
        let placed = self.finder.place(&seen.exposed(full_light));

        let looks: Vec<Look> = (0..self.cells.len())
            .map(|index| self.look(index, &light, view, &placed, full_light))
            .collect();
        let worst_loss = looks.iter().map(|look| look.loss).fold(0.0, f64::max);
        let letters: Vec<LetterVerdict> = looks.iter().map(|look| look.verdict.clone()).collect();

        let Placed { shift_m, scale, rotation_rad, .. } = placed;
        let reach_m = MAX_SHIFT_H * cap_height_m(&self.strokes);
        let in_range = libm::hypot(shift_m[0], shift_m[1]) <= reach_m
            && (SCALES[0]..=SCALES[1]).contains(&scale)
            && rotation_rad.abs() <= MAX_ROTATION_RAD;
        let probability = probability(worst_loss);
        let right = letters.iter().all(|letter| letter.best == Some(letter.expected));
        let reads = right && probability >= self.options.legible_probability;
        let reason = match () {
            () if !in_range => Some(Reason::OutOfRange),
            () if reads => None,
            // Few pixels lower the probability by themselves (docs/calibration.md).
            () if cap_height_px < MIN_CAP_HEIGHT_PX => Some(Reason::TooSmall),
            () => Some(Reason::Misread),
        };
        let verdict = Verdict {
            word: self.strokes.word.clone(),
            read: letters.iter().map(|letter| letter.best.unwrap_or('?')).collect(),
            legible: reason.is_none(),
            probability: if in_range { probability } else { 0.0 },
            calibration: CALIBRATION,
            placement: Some(Placement { shift_m, scale, rotation_rad }),
            cap_height_px: Some(cap_height_px),
            letters,
            reason,
            second_opinion: None,
            causes: Vec::new(),
            advice: Vec::new(),
        };
        Ok(Sight { verdict, looks, placed: Some(placed), contrast: Some(contrast) })
    }

    /// Looks at one letter.
    fn look(
        &self,
        index: usize,
        light: &Light,
        view: &View,
        placed: &Placed,
        full_light: f32,
    ) -> Look {
        let cell = &self.cells[index];
        let bank = &self.banks[cell.bank];
        let expected = self.strokes.glyphs[index].character;
        let colors = cell.grid.resample(light, view, placed);
        let bright = brightness(&cell.grid, &colors).exposed(full_light);
        let picture = bright.blur(BLUR_PX);
        if bank.layout.brightest_in_cell(&picture) < FAINT {
            return Look {
                verdict: LetterVerdict::unseen(expected),
                loss: f64::INFINITY,
                picture: None,
                ink: None,
                matches: Vec::new(),
                shift: [0, 0],
            };
        }
        let compare =
            |picture: &Raster| cell.surroundings.compare(bank, picture, self.classes.len());
        let mut matches = compare(&picture);
        let mut shown = bright.clone();
        let color = color::of_brightest(&colors, whole(INK_SHARE * cell.ink_px));
        let values = color::held(&colors, color);
        let ink = Raster { values, ..bright.clone() }.exposed(full_light);
        let total: f32 = bright.values.iter().sum();
        let change: f32 = ink.values.iter().zip(&bright.values).map(|(a, b)| (a - b).abs()).sum();
        if change > COLOR_MATTERS * total {
            let by_color = compare(&ink.blur(BLUR_PX));
            // Whichever shows some letter best, not whichever shows the right one.
            if best(&by_color) > best(&matches) {
                (matches, shown) = (by_color, ink.clone());
            }
        }
        let ink = pure_ink(cell, light, view, placed, full_light);
        let loss = loss(&matches, cell.class, cell.ln_faultless);
        let shift = matches[cell.class].shift;
        Look {
            verdict: self.judge(index, &matches),
            loss,
            picture: Some(shown),
            ink: Some(ink),
            matches,
            shift,
        }
    }

    fn judge(&self, index: usize, matches: &[Match]) -> LetterVerdict {
        let (cell, glyph) = (&self.cells[index], &self.strokes.glyphs[index]);
        let expected = glyph.character;
        let n_classes = self.classes.len();
        let mut order: Vec<usize> = (0..n_classes).collect();
        order.sort_by(|a, b| matches[*b].similarity.total_cmp(&matches[*a].similarity));
        let is_whole = matches[order[0]].similarity >= matches[n_classes].similarity;
        let name = |class: usize| self.classes.name(class, Some(expected));
        let p = |class: usize| libm::exp(ln_share(matches, class));
        let similarity = |class: usize| f64::from(matches[class].similarity);
        let rivals = order.iter().filter(|class| **class != cell.class).take(3);
        let own = &matches[cell.class];
        let [right, down] = own.shift.map(|px| px as f64 * cell.grid.pitch_m);
        LetterVerdict {
            expected,
            best: is_whole.then(|| name(order[0])),
            runner_up: Some(name(order[1])),
            margin: similarity(order[0]) - similarity(order[1]),
            similarity: similarity(cell.class),
            p: p(cell.class),
            no_letter: p(n_classes),
            rivals: rivals.map(|&class| Rival { letter: name(class), p: p(class) }).collect(),
            shift_m: [right, -down],
            scale: self.banks[cell.bank].templates[own.template].scale,
            ..LetterVerdict::unseen(expected)
        }
    }

    /// Pixels that the word's ink should cover.
    fn ink_px(&self) -> f64 {
        self.cells.iter().map(|cell| cell.ink_px).sum()
    }
}

/// Light in the color of the strokes alone, told by the photo's own pixels: one of ours holds a stroke
/// and the status light beside it.
fn pure_ink(cell: &Cell, light: &Light, view: &View, placed: &Placed, full_light: f32) -> Raster {
    let frame = cell.grid.frame(view, placed);
    let pixels = frame.map_or(Vec::new(), |frame| light.within(&frame));
    let share = INK_SHARE * cell.ink_px / (cell.grid.width * cell.grid.height) as f64;
    let n_brightest = whole(share * pixels.len() as f64);
    let color =
        if pixels.is_empty() { [0.0; 3] } else { color::of_brightest(&pixels, n_brightest) };
    let pure = color::pure(color);
    let pure = cell.grid.resample_of(light, view, placed, |light| [pure(light); 3]);
    let pure = brightness(&cell.grid, &pure);
    // Thin strokes fill our pixels by half: half of the ink is full light, whatever the word's is.
    let mut levels = pure.values.clone();
    let rank = whole(INK_SHARE * cell.ink_px).min(levels.len() - 1);
    let level = *levels.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1;
    pure.exposed(full_light.min(level))
}

/// Length of what the letters' lit moves draw.
fn lit_length_m<'a>(glyphs: impl IntoIterator<Item = &'a Glyph>) -> f64 {
    let moves = glyphs.into_iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
    moves
        .map(|step| libm::hypot(step.to_m[0] - step.from_m[0], step.to_m[1] - step.from_m[1]))
        .sum()
}

fn best(matches: &[Match]) -> f32 {
    matches.iter().map(|found| found.similarity).fold(f32::NEG_INFINITY, f32::max)
}

fn brightness(grid: &Grid, light: &[Rgb]) -> Raster {
    let values = light.iter().map(|light| luminance(*light)).collect();
    Raster { width: grid.width, height: grid.height, values }
}

/// Letters as the trail should draw them, blurred.
pub(super) fn draw<'a>(
    grid: &Grid,
    home: &Placed,
    glyphs: impl Iterator<Item = &'a Glyph>,
    pen_px: f32,
) -> Raster {
    let mut page = Page::blank(grid.width, grid.height);
    for glyph in glyphs {
        page.stroke(&glyph.moves, pen_px, grid.page_from_plane(home));
    }
    page.dry().blur(BLUR_PX)
}
