//! The bank of references: every character that could stand in a place, in the flown font and in a
//! typeface, at several scales, drawn with the trail's pen and blurred as the photo is.

use tiny_skia::Transform;

use super::ink::Page;
use super::partial::parts;
use super::raster::Raster;
use super::typeface::Typeface;
use super::window::{Layout, Level, REACH_PX};
use super::{BLUR_PX, PEN_PX, PX_PER_H, References};
use crate::letters::{Cell, Font, Glyph, Move};

/// Scales tried in each direction (study).
const SCALES: [f64; 3] = [0.85, 1.0, 1.17];

/// Largest ratio of the two scales, either way (study).
const MAX_ASPECT: f64 = 1.28;

/// What a shift of one cap height costs in similarity (study). Without a cost, letters
/// are looked for in their neighbours; too high a cost punishes a drone that drifts.
const SHIFT_COST: f32 = 0.15;

/// What a stretch by e costs beside a shift of one cap height (study).
const STRETCH_COST: f64 = 0.3;

/// What a letter less a stroke costs in similarity: who reads fills in a stroke that is half there.
/// With 0.03 words whose letters lack 8, 15, 25, 35 and 50 % of their ink have P 0.90, 0.67, 0.23,
/// 0.10 and 0.03 on average (measured here); the strict reader read 100, 71, 57, 14 and 14 % of
/// seven each (study). Without a cost every gap is fatal; with 0.2 an I passes for L.
const PART_COST: f32 = 0.03;

/// What no reader tells apart once it is a line of light, each under the first one's name.
const ALIKE: [&str; 3] = ["O0", "I1l|", "-_"];

/// Punctuation that joins the bank where the word has any: nobody expects a bracket in a name.
const PUNCTUATION: &str = "!\"#$%&'()*+,-./:;<=>?@[\\]^_{|}~";

/// Characters that can be told apart.
#[derive(Clone, Debug)]
pub(super) struct Classes {
    /// Each class by its first name.
    names: Vec<char>,
    /// All that are drawn.
    drawn: Vec<char>,
}

/// All references for cells of one aspect.
pub(super) struct Bank {
    pub(super) layout: Layout,
    /// The window at full, half and quarter resolution.
    pub(super) levels: [Level; 3],
    pub(super) templates: Vec<Template>,
    /// Shifts within reach at quarter resolution: right, down.
    pub(super) shifts: Vec<[isize; 2]>,
}

/// What a reference shows: a class by its index, the same less a stroke, or a cell full of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shows {
    Whole(usize),
    Part(usize),
    Blot,
}

/// A reference at one scale.
pub(super) struct Template {
    pub(super) shows: Shows,
    /// Width and height by the intended ones.
    pub(super) scale: [f64; 2],
    /// What its scale costs in similarity.
    pub(super) cost: f32,
    /// The page at full, half and quarter resolution.
    pub(super) pages: [Raster; 3],
}

impl Classes {
    /// A to Z and 0 to 9; a to z and punctuation too, where the word has some.
    pub(super) fn of(word: impl Iterator<Item = char> + Clone) -> Self {
        let mut drawn: Vec<char> = ('A'..='Z').chain('0'..='9').collect();
        if word.clone().any(char::is_lowercase) {
            drawn.extend('a'..='z');
        }
        if word.clone().any(|character| PUNCTUATION.contains(character)) {
            drawn.extend(PUNCTUATION.chars());
        }
        for character in word {
            if !drawn.contains(&character) {
                drawn.push(character);
            }
        }
        let mut names = Vec::new();
        for &character in &drawn {
            if !names.contains(&folded(character)) {
                names.push(folded(character));
            }
        }
        Self { names, drawn }
    }

    pub(super) fn len(&self) -> usize {
        self.names.len()
    }

    /// A class's name; where it is the expected character's, that character.
    pub(super) fn name(&self, class: usize, expected: Option<char>) -> char {
        let name = self.names[class];
        expected.filter(|expected| folded(*expected) == name).unwrap_or(name)
    }

    /// The class of one of the characters.
    pub(super) fn class_of(&self, character: char) -> usize {
        let name = folded(character);
        self.names.iter().position(|class| *class == name).expect("a character of the bank")
    }
}

/// The name that a character shares with those that look alike.
pub(super) fn folded(character: char) -> char {
    let alike = ALIKE.iter().find(|alike| alike.contains(character));
    alike.and_then(|alike| alike.chars().next()).unwrap_or(character)
}

impl Bank {
    /// Draws the references for cells of one aspect (width by cap height) in some fonts, and the
    /// parts of the characters that may have lost a stroke.
    pub(super) fn draw(
        aspect: f64,
        classes: &Classes,
        fonts: &[Font],
        references: References,
        may_lose: &[char],
    ) -> Self {
        let layout = Layout::new(aspect);
        let reach = REACH_PX.cast_signed() / 4;
        let square =
            (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |right| [right, down]));
        let shifts = square.filter(|[dx, dy]| dx * dx + dy * dy <= reach * reach).collect();

        let typeface = Typeface::load();
        let rim_px = PEN_PX - typeface.stem() * PX_PER_H as f32;
        let cell = Cell { left_m: 0.0, baseline_m: 0.0, width_m: aspect, cap_height_m: 1.0 };
        #[expect(clippy::cast_possible_truncation, reason = "a raster needs no more")]
        let box_from_cell = Transform::from_scale((1.0 / aspect) as f32, 1.0);
        let mut templates = Vec::new();
        for &character in &classes.drawn {
            let flown: Vec<Glyph> = match references {
                References::Typeface => Vec::new(),
                References::Flown | References::Both => {
                    fonts.iter().filter_map(|font| font.glyph(character, cell)).collect()
                }
            };
            let set = match references {
                References::Flown => None,
                References::Typeface | References::Both => typeface.outline(character, aspect),
            };
            let may_lose = may_lose.contains(&character);
            let lesser: Vec<_> = flown.iter().filter(|_| may_lose).flat_map(parts).collect();
            let class = classes.class_of(character);
            for (scale, cost) in scales() {
                let page_from_box = layout.page_from_box(scale);
                let stroke = |moves: &[Move]| {
                    let mut page = Page::blank(layout.width, layout.height);
                    page.stroke(moves, PEN_PX, page_from_box.pre_concat(box_from_cell));
                    page
                };
                let set = set.as_ref().map(|outline| {
                    let mut page = Page::blank(layout.width, layout.height);
                    let transform = page_from_box.pre_concat(outline.box_from_outline);
                    page.fill(&outline.path, rim_px, transform);
                    page
                });
                let whole = flown.iter().map(|glyph| stroke(&glyph.moves)).chain(set);
                let whole = whole.map(|page| (Shows::Whole(class), cost, page));
                let lesser = lesser.iter().map(|moves| stroke(moves));
                let lesser = lesser.map(|page| (Shows::Part(class), cost + PART_COST, page));
                templates.extend(whole.chain(lesser).map(|(shows, cost, page)| Template {
                    shows,
                    scale,
                    cost,
                    pages: page.dry().blur(BLUR_PX).pyramid(),
                }));
            }
        }
        templates.extend(scales().map(|(scale, cost)| {
            let [x, y] = layout.middle_px();
            let half =
                [0, 1].map(|axis| 0.5 * scale[axis] * f64::from(PX_PER_H) * [aspect, 1.0][axis]);
            let mut page = Raster::dark(layout.width, layout.height);
            page.fill([x - half[0], x + half[0]], [y - half[1], y + half[1]]);
            Template { shows: Shows::Blot, scale, cost, pages: page.blur(BLUR_PX).pyramid() }
        }));
        Self { levels: layout.levels(), layout, templates, shifts }
    }

    /// Whether a shift by pixels of full resolution is within reach.
    pub(super) fn reaches([right, down]: [isize; 2]) -> bool {
        right * right + down * down <= (REACH_PX * REACH_PX).cast_signed()
    }
}

impl Template {
    /// Length of its strokes, in cap heights.
    pub(super) fn ink_h(&self) -> f32 {
        let [_, _, quarter] = &self.pages;
        16.0 * quarter.values.iter().sum::<f32>() / (PEN_PX * f32::from(PX_PER_H))
    }
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
