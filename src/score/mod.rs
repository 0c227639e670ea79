//! Score: a photo is read letter by letter.
//!
//! Product in: a [`Photo`], the [`Strokes`] of the word that it should show, and the [`Camera`]
//! that took it. Product out: a [`Verdict`].
//!
//! The photo's linear light is resampled into the plane of the word and the word is looked for
//! around its place. Then each letter's cell, blurred as the eye does, is compared with every
//! letter and digit standing in that place between the intended neighbours, in the flown font and
//! in a typeface, over small shifts and scales. How much better the true letter fits than its
//! rivals, against the same for a faultless drawing, gives the probability that the word is read;
//! its worst letter decides.
//!
//! Sources: Loomis 1990 (low-pass, template match, choice); the settings were fitted on 460
//! synthetic photos, see the constants. Not modelled: context (no dictionary), color,
//! lower case. Score knows no plan, no flight and no light.

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::error::{Error, Result, within};
use crate::letters::{Glyph, Strokes};
use crate::photo::Photo;
use bank::Bank;
use ink::Page;
use light::Light;
use plane::{Grid, Placed};
use raster::Raster;

mod align;
mod bank;
mod ink;
mod level;
mod light;
mod plane;
mod raster;
mod reader;
mod typeface;
mod verdict;
mod window;

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "pixels and codes of test photos")]
mod tests;

/// Resolution at which letters are read: pixels to a cap height (legibility.md 6.1).
const PX_PER_H: u8 = 32;

/// Width of the pen that references are drawn with: 0.07 H (legibility.md 6.2).
const PEN_PX: f32 = 0.07 * 32.0;

/// Blur of photo and references: 0.05 H (legibility.md 6.2). Less makes a reader of wanderings of
/// the stroke, more makes O of Q.
const BLUR_PX: f32 = 0.05 * 32.0;

/// Largest shift of the word that still counts as its place, in cap heights (legibility.md 6.1).
const MAX_SHIFT_H: f64 = 0.6;

/// Smallest and largest scale of the word that count as its own (legibility.md 6.1): a small O must
/// not become something else.
const SCALES: [f64; 2] = [0.85, 1.17];

/// Largest rotation of the word, either way: 8 degrees (legibility.md 6.1).
const MAX_ROTATION_RAD: f64 = 8.0 * core::f64::consts::PI / 180.0;

/// Cap height in the photo below which nothing is read, in pixels (legibility.md 6.3).
const MIN_CAP_HEIGHT_PX: f64 = 20.0;

/// Blurred light in a cell, of full light, below which the letter counts as missing. The middle of a
/// faultless stroke has 0.5; a tenth of it is what noise and a neighbour's glow leave.
const FAINT: f32 = 0.05;

/// Cells that can be read: width by cap height. The team's are 0.6 wide.
const ASPECTS: [f64; 2] = [0.05, 5.0];

/// Longest word, in cap heights: 256 of the team's letters with as much space again are 400. The
/// alignment's rasters grow with it.
const MAX_LENGTH_H: f64 = 1000.0;

/// How a photo is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScoreOptions {
    /// What letters are compared with.
    pub references: References,
    /// Probability of being read from which a word counts as legible, 0 to 1.
    pub legible_probability: f64,
}

/// What letters are compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum References {
    /// The font that the word is flown with: a reader who knows its shapes.
    Flown,
    /// Roboto Thin: a reader who doesn't.
    Typeface,
    /// Both, whichever fits better.
    #[default]
    Both,
}

/// Whether a photo's word is legible, and why not. `verdict.json` is this.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The word that should be there.
    pub word: String,
    /// What is there, letter by letter: the best match, `?` where a letter has no light.
    pub read: String,
    /// Whether it reads: every letter is the best match of its cell, and the probability reaches
    /// [`ScoreOptions::legible_probability`].
    pub legible: bool,
    /// Probability that a strict reader reads the word, 0 to 1.
    pub probability: f64,
    /// Where the word hangs; `None` where there is no light.
    pub placement: Option<Placement>,
    /// Height of a capital in the photo, pixels; `None` where the photo does not show the place.
    pub cap_height_px: Option<f64>,
    /// One for each letter of the word, in its order.
    pub letters: Vec<LetterVerdict>,
    /// Why the word is not legible; `None` where it is.
    pub reason: Option<Reason>,
}

/// Where the word hangs, against where it was intended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Placement {
    /// To the right and up, in the plane of the word.
    pub shift_m: [f64; 2],
    /// Size by intended size, about the middle of the word.
    pub scale: f64,
    /// Anticlockwise, about the middle of the word.
    pub rotation_rad: f64,
}

/// What is seen in the place of one letter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LetterVerdict {
    /// The letter that should be there.
    pub expected: char,
    /// The letter that fits best; `None` where there is no light.
    pub best: Option<char>,
    /// The letter that fits second best.
    pub runner_up: Option<char>,
    /// Similarity of the best less that of the runner-up, 0 to 2.
    pub margin: f64,
    /// Similarity of the expected letter: correlation less what shift and stretch cost, up to 1.
    pub similarity: f64,
    /// Share of the expected letter in the choice among all, 0 to 1.
    pub p: f64,
}

/// Why a word is not legible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The place of the word is not in the photo.
    NotInPhoto,
    /// Nothing in the place of the word is brighter than the sky.
    NoLight,
    /// Capitals are less than 20 pixels high in the photo.
    TooSmall,
    /// The word hangs farther than 0.6 cap heights from its place, or is larger or smaller than
    /// intended by more than a sixth, or turned by more than 8 degrees.
    OutOfRange,
    /// A letter looks like another one, like nothing, or too much like both.
    Misread,
}

/// Reads a photo.
///
/// # Errors
///
/// [`Error::Input`] for an empty word, a character other than A to Z and 0 to 9, letters too narrow or
/// too wide to be letters, a photo whose size is not the camera's, an option out of range, or an
/// unknown font.
///
/// # Panics
///
/// If the photo has not three bytes a pixel.
pub fn score(
    photo: &Photo,
    strokes: &Strokes,
    camera: &Camera,
    options: &ScoreOptions,
) -> Result<Verdict> {
    options.check()?;
    check(photo, strokes, camera)?;

    let home = Placed::home(strokes);
    let grid = Grid::around(strokes, &home);
    let Some(light) = Light::decode(photo, camera, &grid, &home) else {
        return Ok(Verdict::unseen(strokes, Reason::NotInPhoto, None));
    };
    let pixel_px = grid.pixel_px(camera, &home).unwrap_or(0.0);
    let cap_height_px = f64::from(PX_PER_H) * pixel_px;

    let seen = grid.resample(&light, camera, &home);
    let Some(full_light) = level::full_light(&seen, light.sky, strokes) else {
        return Ok(Verdict::unseen(strokes, Reason::NoLight, Some(cap_height_px)));
    };
    let exposed = |mut raster: Raster| {
        raster.values.iter_mut().for_each(|value| *value = (*value / full_light).clamp(0.0, 1.0));
        raster
    };
    let placed = align::place(&exposed(seen), &grid, strokes, &home);

    let mut banks: Vec<Bank> = Vec::new();
    let mut letters = Vec::new();
    let mut worst_loss = 0.0_f64;
    for (index, glyph) in strokes.glyphs.iter().enumerate() {
        let aspect = glyph.cell.width_m / glyph.cell.cap_height_m;
        // Equal cells differ in the last bits of their widths.
        let known = banks.iter().position(|bank| (bank.layout.aspect - aspect).abs() < 1e-6);
        let bank = match known {
            Some(known) => &banks[known],
            None => {
                banks.push(Bank::draw(aspect, &strokes.font, options.references)?);
                banks.last().expect("just pushed")
            }
        };
        let grid = bank.layout.grid(&glyph.cell);
        let picture = exposed(grid.resample(&light, camera, &placed)).blur(BLUR_PX);
        if bank.layout.brightest_in_cell(&picture) < FAINT {
            letters.push(verdict::unseen(glyph.character));
            worst_loss = f64::INFINITY;
            continue;
        }
        let beside = [index.checked_sub(1), Some(index + 1)].into_iter().flatten();
        let neighbours = draw(&grid, &home, beside.filter_map(|at| strokes.glyphs.get(at)));
        let faultless = draw(&grid, &home, [glyph].into_iter()).plus(&neighbours);
        let [photo, ideal] = reader::read(bank, [&picture, &faultless], &neighbours);
        let (letter, loss) = verdict::judge(glyph.character, &photo, &ideal);
        letters.push(letter);
        worst_loss = worst_loss.max(loss);
    }

    let Placed { shift_m, scale, rotation_rad, .. } = placed;
    let in_range = libm::hypot(shift_m[0], shift_m[1]) <= MAX_SHIFT_H * cap_height_m(strokes)
        && (SCALES[0]..=SCALES[1]).contains(&scale)
        && rotation_rad.abs() <= MAX_ROTATION_RAD;
    let probability = verdict::probability(worst_loss);
    let right = letters.iter().all(|letter| letter.best == Some(letter.expected));
    let reason = match () {
        () if cap_height_px < MIN_CAP_HEIGHT_PX => Some(Reason::TooSmall),
        () if !in_range => Some(Reason::OutOfRange),
        () if !right || probability < options.legible_probability => Some(Reason::Misread),
        () => None,
    };
    Ok(Verdict {
        word: strokes.word.clone(),
        read: letters.iter().map(|letter| letter.best.unwrap_or('?')).collect(),
        legible: reason.is_none(),
        probability: if matches!(reason, None | Some(Reason::Misread)) { probability } else { 0.0 },
        placement: Some(Placement { shift_m, scale, rotation_rad }),
        cap_height_px: Some(cap_height_px),
        letters,
        reason,
    })
}

impl Default for ScoreOptions {
    /// Both references; legible from 0.7, where 85 of 100 synthetic photos were read
    /// (legibility.md 6.4).
    fn default() -> Self {
        Self { references: References::Both, legible_probability: 0.7 }
    }
}

impl ScoreOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("score.legible_probability", self.legible_probability, 0.0, 1.0)
    }
}

impl Verdict {
    fn unseen(strokes: &Strokes, reason: Reason, cap_height_px: Option<f64>) -> Self {
        let letters: Vec<_> =
            strokes.glyphs.iter().map(|glyph| verdict::unseen(glyph.character)).collect();
        Self {
            word: strokes.word.clone(),
            read: "?".repeat(letters.len()),
            legible: false,
            probability: 0.0,
            placement: None,
            cap_height_px,
            letters,
            reason: Some(reason),
        }
    }
}

fn check(photo: &Photo, strokes: &Strokes, camera: &Camera) -> Result<()> {
    let hint = "write the word with the letters A to Z and the digits 0 to 9";
    if strokes.glyphs.is_empty() {
        return Err(Error::input("word", "an empty word", "at least one letter", hint));
    }
    let stranger = strokes.glyphs.iter().position(|glyph| !bank::is_known(glyph.character));
    if let Some(position) = stranger {
        let character = strokes.glyphs[position].character;
        return Err(Error::input(
            format!("word, position {}", position + 1),
            format!("{character:?}"),
            "a character that the reader knows: A to Z, 0 to 9",
            hint,
        ));
    }
    for glyph in &strokes.glyphs {
        let aspect = glyph.cell.width_m / glyph.cell.cap_height_m;
        within("width of a letter by its height", aspect, ASPECTS[0], ASPECTS[1])?;
    }
    let [left, _, right, _] = strokes.bounds_m();
    let length = (right - left) / cap_height_m(strokes);
    within("length of the word by its height", length, 0.0, MAX_LENGTH_H)?;
    let [found, wanted] = [(photo.width_px, photo.height_px), (camera.width_px, camera.height_px)];
    if found != wanted {
        return Err(Error::input(
            "photo",
            format!("{} x {} pixels", found.0, found.1),
            format!("{} x {} pixels, as the camera has", wanted.0, wanted.1),
            "name the scene that the photo was taken with",
        ));
    }
    let bytes = 3 * photo.width_px as usize * photo.height_px as usize;
    assert_eq!(photo.rgb8.len(), bytes, "three bytes a pixel");
    Ok(())
}

fn cap_height_m(strokes: &Strokes) -> f64 {
    strokes.glyphs[0].cell.cap_height_m
}

/// Letters as the trail should draw them, blurred.
fn draw<'a>(grid: &Grid, home: &Placed, glyphs: impl Iterator<Item = &'a Glyph>) -> Raster {
    let mut page = Page::blank(grid.width, grid.height);
    for glyph in glyphs {
        page.stroke(&glyph.moves, PEN_PX, grid.page_from_plane(home));
    }
    page.dry().blur(BLUR_PX)
}
