//! The bank of references: every letter and digit, in the flown font and in a typeface, at several
//! scales, drawn with the trail's pen and blurred as the photo is.

use super::ink::Page;
use super::raster::{Raster, dots};
use super::typeface::Typeface;
use super::window::{Layout, Level, REACH_PX};
use super::{BLUR_PX, PEN_PX, PX_PER_H, References};
use crate::error::Result;
use crate::letters::{self, Cell};

/// What can be told apart. 0 and 1 are missing: as strokes of light they are O and I.
pub(super) const CLASSES: [char; 34] = [
    'A', 'B', 'C', 'D', 'E', 'F', 'G', 'H', 'I', 'J', 'K', 'L', 'M', 'N', 'O', 'P', 'Q', 'R', 'S',
    'T', 'U', 'V', 'W', 'X', 'Y', 'Z', '2', '3', '4', '5', '6', '7', '8', '9',
];

/// Scales tried in each direction (legibility.md 6.2).
const SCALES: [f64; 3] = [0.85, 1.0, 1.17];

/// Largest ratio of the two scales, either way (legibility.md 6.2).
const MAX_ASPECT: f64 = 1.28;

/// What a shift of one cap height costs in similarity (legibility.md 6.2). Without a cost, letters
/// are looked for in their neighbours; too high a cost punishes a drone that drifts.
const SHIFT_COST: f32 = 0.15;

/// What a stretch by e costs beside a shift of one cap height (legibility.md 6.2).
const STRETCH_COST: f64 = 0.3;

/// All references for cells of one aspect.
pub(super) struct Bank {
    pub(super) layout: Layout,
    /// The window at full and at half resolution.
    pub(super) levels: [Level; 2],
    pub(super) templates: Vec<Template>,
    /// Shifts within reach at half resolution: right, down.
    pub(super) shifts: Vec<[isize; 2]>,
}

/// A reference at one scale.
pub(super) struct Template {
    /// Index into [`CLASSES`].
    pub(super) class: usize,
    /// What its scale costs in similarity.
    pub(super) cost: f32,
    /// The page at full and at half resolution.
    pub(super) pages: [Raster; 2],
    /// For each of the bank's shifts: sum and sum of squares of what lies in the window.
    pub(super) sums: Vec<[f32; 2]>,
}

impl Bank {
    /// Draws the references for cells of one aspect (width by cap height).
    ///
    /// # Errors
    ///
    /// If there is no stroke font of that name.
    pub(super) fn draw(aspect: f64, font: &str, references: References) -> Result<Self> {
        let layout = Layout::new(aspect);
        let levels = layout.levels();
        let reach = REACH_PX.cast_signed() / 2;
        let square =
            (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |right| [right, down]));
        let shifts: Vec<_> = square.filter(|[dx, dy]| dx * dx + dy * dy <= reach * reach).collect();

        let typeface = Typeface::load();
        let rim_px = PEN_PX - typeface.stem() * PX_PER_H as f32;
        let unit = Cell { left_m: 0.0, baseline_m: 0.0, width_m: 1.0, cap_height_m: 1.0 };
        let mut templates = Vec::new();
        for character in CLASSES.into_iter().chain(['0', '1']) {
            let flown = match references {
                References::Typeface => None,
                References::Flown | References::Both => letters::glyph(character, unit, font)?,
            };
            let set = match references {
                References::Flown => None,
                References::Typeface | References::Both => typeface.outline(character, aspect),
            };
            for (scale, cost) in scales() {
                let page_from_box = layout.page_from_box(scale);
                let flown = flown.as_ref().map(|glyph| {
                    let mut page = Page::blank(layout.width, layout.height);
                    page.stroke(&glyph.moves, PEN_PX, page_from_box);
                    page
                });
                let set = set.as_ref().map(|outline| {
                    let mut page = Page::blank(layout.width, layout.height);
                    let transform = page_from_box.pre_concat(outline.box_from_outline);
                    page.fill(&outline.path, rim_px, transform);
                    page
                });
                for page in flown.into_iter().chain(set) {
                    let full = page.dry().blur(BLUR_PX);
                    let half = full.half();
                    let sums = sums(&half, &levels[1], &shifts);
                    let (class, pages) = (class_of(character), [full, half]);
                    templates.push(Template { class, cost, pages, sums });
                }
            }
        }
        Ok(Self { layout, levels, templates, shifts })
    }

    /// Whether a shift by pixels of full resolution is within reach.
    pub(super) fn reaches([right, down]: [isize; 2]) -> bool {
        right * right + down * down <= (REACH_PX * REACH_PX).cast_signed()
    }
}

/// Whether the reader knows a character.
pub(super) fn is_known(character: char) -> bool {
    character.is_ascii_uppercase() || character.is_ascii_digit()
}

/// Index of a known character's class.
pub(super) fn class_of(character: char) -> usize {
    let folded = match character {
        '0' => 'O',
        '1' => 'I',
        other => other,
    };
    CLASSES.iter().position(|class| *class == folded).expect("the front door refuses others")
}

/// What a shift by pixels of full resolution costs in similarity.
pub(super) fn shift_cost([right, down]: [isize; 2]) -> f32 {
    SHIFT_COST * ((right * right + down * down) as f32).sqrt() / PX_PER_H as f32
}

/// The scales of a template and what each costs.
fn scales() -> impl Iterator<Item = ([f64; 2], f32)> {
    let pairs = SCALES.into_iter().flat_map(|sx| SCALES.map(|sy| [sx, sy]));
    pairs.filter(|[sx, sy]| (sx / sy).max(sy / sx) <= MAX_ASPECT).map(|[sx, sy]| {
        let stretch = libm::log(sx).abs() + libm::log(sy).abs();
        #[expect(clippy::cast_possible_truncation, reason = "a similarity from 0 to 1")]
        let cost = SHIFT_COST * (STRETCH_COST * stretch) as f32;
        ([sx, sy], cost)
    })
}

fn sums(page: &Raster, level: &Level, shifts: &[[isize; 2]]) -> Vec<[f32; 2]> {
    let squares = Raster { values: page.values.iter().map(|v| v * v).collect(), ..*page };
    let sums = |shift| dots([level.rows(page, shift), level.rows(&squares, shift)], &level.mask);
    shifts.iter().map(|&shift| sums(shift)).collect()
}
