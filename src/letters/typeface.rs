//! Typefaces: converts the outlines of a TrueType or OpenType face to strokes.
//!
//! A center line ends half a stroke's width inside the outline. A face's capitals are therefore
//! measured between the center lines of a horizontal stroke at the top and one at the bottom, which
//! are one cap height apart, with the lower one on the baseline.
//!
//! Glyphs that touch are traced together, so that joined letters become one line. A glyph that is
//! an area, such as a heart, becomes its outline. Font variations are not supported. In text that
//! is not shaped, ligatures and kerning outside the table `kern` are not supported either.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, MutexGuard};

use ab_glyph::{Font as _, FontRef};
use harfrust::{Font, GlyphId};
use kurbo::{Affine, BezPath, Point};
use read_fonts::{TableProvider as _, tables::kern::SubtableKind};

use super::center_line::{CenterLines, center_lines, outlines};
use super::curves::polylines;
use super::face::{Face, Joined, ShapedLine};
use super::glyph::outline;
use super::outline::Contour;
use super::shape::{CAP_HEIGHTS, Run, Shape};
use super::shaping::{MAX_POINTS, Placed, Unset, shape_line};
use super::vector::{Lines, length, pairs, point};
use super::{Trace, stored};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Budget;
use noctograph_core::statistics::sort_by_number;

/// Maximum number of subtables of the kerning table that are read. Every pair of letters is looked
/// up in all of these.
const MAX_SUBTABLES: usize = 64;

/// Budget steps for comparing two strokes to find the nearest.
const STEPS_PER_PAIR: usize = 5;

/// Maximum number of characters that are searched for an outline in a face without known letters.
const MAX_SEARCHED: usize = 300;

/// Maximum coordinate of an outline, in cap heights.
const MAX_COORDINATE: f64 = 100.0;

/// Maximum distance between an outline's polyline and its curves, in cap heights.
const FLATNESS: f64 = 2e-4;

/// Minimum thickness of an area relative to the face's letters, and maximum length of its center
/// lines relative to its own thickness. A bold I has a length of 4, but not this thickness.
const AREA_THICKNESS: f64 = 2.5;
const AREA_LENGTH: f64 = 6.0;

/// Maximum gap between the boxes of two glyphs that touch, in cap heights. In some faces, joined
/// letters meet at a common edge.
const TOUCHING: f64 = 0.005;

/// Plausible half widths of strokes.
const HALF_WIDTHS: RangeInclusive<f64> = 1e-4..=0.4;

/// Characters as high as capitals. The first of these characters that a face has is used.
const CAPITALS: &str = "HIExo\u{5d0}\u{627}\u{915}\u{e01}0";

/// Characters whose stroke width is typical of their script.
const STEMS: &str = "HIlxo\u{5d0}\u{627}\u{915}\u{e01}0";

/// A face, with a cache of its traced characters.
pub(super) struct Typeface {
    face: Font,
    trace: Trace,
    /// Cap height in font units.
    cap: f64,
    /// Half the width of the strokes in cap heights, or 0 if outlines are traced.
    half_width: f64,
    /// True if the width was measured on known letters.
    has_stems: bool,
    /// True if the face's contours are strokes.
    is_stored: bool,
    traced: Mutex<Traced>,
}

/// The glyphs and groups of glyphs traced so far, and the remaining budget.
struct Traced {
    shapes: BTreeMap<Vec<Part>, Option<Arc<Shape>>>,
    budget: Budget,
}

/// A glyph, and its position in font units.
type Part = (GlyphId, [i32; 2]);

impl Typeface {
    /// Reads a face. In a collection, the first face is read. Returns an error for another kind of
    /// file, and for a face without letters or strokes.
    pub(super) fn read(bytes: Vec<u8>, trace: Trace, file: &str) -> Result<Self> {
        let budget = Budget::new(file, "name another font file, or a built-in font");
        let face = Font::new(bytes, 0).ok_or_else(|| refused(file, "another file"))?;
        let traced = Mutex::new(Traced { shapes: BTreeMap::new(), budget });
        // The measures of the face are replaced below.
        let (cap, half_width, has_stems, is_stored) = (1.0, 0.0, false, false);
        let mut typeface = Self { face, trace, cap, half_width, has_stems, is_stored, traced };
        typeface.is_stored = stored::SIGNS.iter().any(|signs| {
            let outlines = signs.chars().filter_map(|character| typeface.outline(character));
            stored::are_strokes(&outlines.collect::<Vec<BezPath>>())
        });
        // The cap height is computed first, because it is the unit of the stroke width.
        typeface.cap = typeface.known_outline().map_or(0.0, |path| path.control_box().y1);
        if !CAP_HEIGHTS.contains(&typeface.cap) {
            return Err(refused(file, "no letters"));
        }
        if trace == Trace::CenterLine && !typeface.is_stored {
            let stem = typeface.stem_half_width()?;
            (typeface.has_stems, typeface.half_width) =
                stem.ok_or_else(|| refused(file, "no strokes"))?;
        }
        Ok(typeface)
    }

    /// Returns the outline of a capital, or of the first character of a face without letters.
    fn known_outline(&self) -> Option<BezPath> {
        let mut candidates = CAPITALS.chars().chain(self.characters().take(MAX_SEARCHED));
        candidates.find_map(|character| self.outline(character))
    }

    /// Returns half the width of strokes in cap heights, and true if it was measured on a letter of
    /// [`STEMS`]. Returns `None` for a face without strokes. Fails if the budget is spent.
    fn stem_half_width(&self) -> Result<Option<(bool, f64)>> {
        let budget = &self.traced().budget;
        let stems = STEMS.chars().map(|c| (true, c));
        let others = self.characters().take(MAX_SEARCHED).map(|c| (false, c));
        let mut half_widths = stems.chain(others).filter_map(|(is_stem, c)| {
            let contours = self.contours(&[(self.glyph(c)?, [0; 2])], budget)?;
            Some((is_stem, center_lines(&contours, budget).half_width))
        });
        let stem = half_widths.find(|(_, half_width)| HALF_WIDTHS.contains(half_width));
        budget.check()?;
        Ok(stem)
    }

    /// Returns the glyph of a character, or `None` if the face lacks it.
    fn glyph(&self, character: char) -> Option<GlyphId> {
        self.face.charmap().map_unicode(character)
    }

    /// Returns the outline of a character in font units, or `None` if the face lacks it.
    fn outline(&self, character: char) -> Option<BezPath> {
        outline(&self.face, self.glyph(character)?, &self.traced().budget)
    }

    /// Returns the strokes of glyphs that are traced together, from the cache if they were traced
    /// before. Returns `None` if they cannot be traced or the budget is spent.
    fn traced_shape(&self, parts: &[Part]) -> Option<Arc<Shape>> {
        let Traced { shapes, budget } = &mut *self.traced();
        let shape = shapes.entry(parts.to_vec()).or_insert_with(|| {
            self.trace_glyphs(parts, budget).filter(|_| budget.check().is_ok()).map(Arc::new)
        });
        shape.clone()
    }

    /// Shapes a text into letters, from left to right in cap heights. `space` is the advance of a
    /// space in a face without one, in cap heights.
    pub(super) fn shape_line(&self, text: &str, space: f64) -> ShapedLine {
        let unit = self.advance(1.0);
        let space_units =
            self.glyph(' ').map(|glyph| self.face.glyph_metrics().h_advance(glyph).into());
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let glyphs = shape_line(&self.face, text, space_units.unwrap_or(space / unit) as i32)?;
        self.touching(glyphs, unit).iter().map(|group| self.joined(group, unit)).collect()
    }

    /// Returns groups of touching glyphs from left to right. `unit` is a font unit in cap heights.
    fn touching(&self, glyphs: Vec<Placed>, unit: f64) -> Vec<Vec<Placed>> {
        let mut boxes = Vec::from_iter(glyphs.into_iter().filter_map(|placed| {
            let bounds = outline(&self.face, placed.glyph, &self.traced().budget)?.control_box();
            Some(([bounds.x0, bounds.x1].map(|x| x + f64::from(placed.units[0])), placed))
        }));
        // The boxes are sorted from left to right, so only the last group can touch the next box.
        sort_by_number(&mut boxes, |([left, _], _)| *left);
        let mut groups: Vec<Vec<Placed>> = Vec::new();
        let mut group_right = f64::NEG_INFINITY;
        for ([left, right], placed) in boxes {
            match groups.last_mut().filter(|_| left <= group_right + TOUCHING / unit) {
                Some(group) => group.push(placed),
                None => groups.push(vec![placed]),
            }
            group_right = group_right.max(right);
        }
        groups
    }

    /// Returns the strokes of glyphs that touch as one shape, with its first byte in the text and
    /// its position in cap heights. `unit` is a font unit in cap heights.
    fn joined(&self, group: &[Placed], unit: f64) -> std::result::Result<Joined, Unset> {
        let byte = group.iter().map(|placed| placed.byte).min().expect("not empty");
        let start = group[0].units[0];
        let parts = group.iter().map(|placed| {
            let [x, y] = placed.units;
            (placed.glyph, [x - start, y])
        });
        let shape = self.traced_shape(&parts.collect::<Vec<_>>()).ok_or_else(|| {
            // The error names the first glyph that cannot be traced by itself. If there is none,
            // the glyphs are too large together.
            let mut glyphs = group.iter();
            match glyphs.find(|placed| self.traced_shape(&[(placed.glyph, [0; 2])]).is_none()) {
                Some(placed) => Unset::Missing(placed.byte),
                None => Unset::TooLarge(byte, group.len()),
            }
        });
        Ok(Joined { byte, pen: unit * f64::from(start), shape: shape? })
    }

    /// Returns the cache and the budget, locked.
    fn traced(&self) -> MutexGuard<'_, Traced> {
        self.traced.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Returns a letter pair's kerning in the table `kern`, in font units, if there is any.
    fn kern_units(&self, [left, right]: [char; 2]) -> Option<i32> {
        let (left, right) = (self.glyph(left)?, self.glyph(right)?);
        let table = self.face.tables().kern().ok()?;
        let subtables = table.subtables().take(MAX_SUBTABLES).flatten();
        let mut horizontal = subtables.filter(|part| part.is_horizontal() && !part.is_variable());
        horizontal.find_map(|part| match part.kind().ok()? {
            SubtableKind::Format0(pairs) => pairs.kerning(left, right),
            SubtableKind::Format1(_) => None,
            SubtableKind::Format2(classes) => classes.kerning(left, right),
            SubtableKind::Format3(classes) => classes.kerning(left, right),
        })
    }

    /// Returns the shape of a single glyph, or of glyphs that touch. Panics without glyphs. Returns
    /// `None` if they have no strokes or are too large. The advance is that of the first glyph: it
    /// is used only for single glyphs, because shaping places touching ones.
    fn trace_glyphs(&self, parts: &[Part], budget: &Budget) -> Option<Shape> {
        let (first, _) = parts[0];
        let advance = self.advance(self.face.glyph_metrics().h_advance(first));
        if !(0.0..=MAX_COORDINATE).contains(&advance) {
            return None;
        }
        let (lines, lost_length) = if self.is_stored {
            (stored::strokes(&self.path(parts, budget)?, FLATNESS, MAX_POINTS)?, 0.0)
        } else {
            self.lines(parts, budget)?
        };
        let runs: Vec<Run> = lines.into_iter().map(|points| Run { lit: true, points }).collect();
        (!runs.is_empty()).then_some(Shape { advance, runs, lost_length })
    }

    /// Returns the center lines or outlines of glyphs in reading order, in cap heights between
    /// center lines, and a lost stroke's length. Returns `None` if there is no outline or the
    /// budget is spent.
    fn lines(&self, parts: &[Part], budget: &Budget) -> Option<(Lines, f64)> {
        let contours = self.contours(parts, budget)?;
        let center = match self.trace {
            Trace::CenterLine => Some(center_lines(&contours, budget)),
            Trace::Outline => None,
        };
        let (lines, lost_length) = match center.filter(|center| !self.is_area(center)) {
            Some(center) => (center.lines, center.lost_length),
            None => (outlines(&contours, budget), 0.0),
        };
        budget.spend_steps(STEPS_PER_PAIR * lines.len() * lines.len()).then_some(())?;
        let lines = lines.into_iter().map(|line| line.into_iter().map(point).collect());
        let mut lines = in_reading_order(lines.collect());
        // Cap heights of the outline are converted to cap heights between center lines.
        let scale = 1.0 / (1.0 - 2.0 * self.half_width);
        for point in lines.iter_mut().flatten() {
            *point = Point::new(point.x * scale, (point.y - self.half_width) * scale);
        }
        Some((lines, lost_length))
    }

    /// True for an area, which is thicker than the face's letters and short for its thickness.
    fn is_area(&self, center: &CenterLines) -> bool {
        let is_thick = !self.has_stems || center.thickest > AREA_THICKNESS * self.half_width;
        is_thick && center.length() < 2.0 * AREA_LENGTH * center.thickest
    }

    /// Converts a length in font units to cap heights between center lines.
    fn advance(&self, units: f32) -> f64 {
        f64::from(units) / self.cap / (1.0 - 2.0 * self.half_width)
    }

    /// Returns the contours of glyphs in cap heights. Returns `None` if there are none or they have
    /// too many points.
    fn contours(&self, parts: &[Part], budget: &Budget) -> Option<Vec<Contour>> {
        let mut contours = pairs(polylines(&self.path(parts, budget)?, FLATNESS, MAX_POINTS)?);
        for contour in &mut contours {
            if contour[0] == contour[contour.len() - 1] {
                contour.pop();
            }
        }
        contours.retain(|contour| contour.len() > 2);
        (!contours.is_empty()).then_some(contours)
    }

    /// Returns the outlines of glyphs as one path in cap heights, or `None` if one of them has none
    /// or is too large.
    fn path(&self, parts: &[Part], budget: &Budget) -> Option<BezPath> {
        let mut path = BezPath::new();
        for (id, [x, y]) in parts {
            let part = outline(&self.face, *id, budget)?;
            path.extend(Affine::translate(((*x).into(), (*y).into())) * part);
        }
        path.apply_affine(Affine::scale(1.0 / self.cap));
        let bounds = path.control_box();
        let mut sides = [bounds.x0, bounds.x1, bounds.y0, bounds.y1].into_iter();
        sides.all(|side| side.abs() <= MAX_COORDINATE).then_some(path)
    }
}

impl Face for Typeface {
    /// Returns the face's characters in the Basic Multilingual Plane, and its emoji.
    fn characters(&self) -> Box<dyn Iterator<Item = char> + '_> {
        let codes = ('!'..='\u{ffff}').chain('\u{1f000}'..='\u{1faff}');
        Box::new(codes.filter(|c| !c.is_whitespace() && self.has(*c)))
    }

    /// Returns the shape of a letter. A space only has an advance.
    fn shape(&self, character: char) -> Option<Arc<Shape>> {
        let glyph = self.glyph(character)?;
        if character.is_whitespace() {
            let advance = self.advance(self.face.glyph_metrics().h_advance(glyph));
            return Some(Arc::new(Shape { advance, ..Shape::default() }));
        }
        self.traced_shape(&[(glyph, [0; 2])])
    }

    fn has(&self, character: char) -> bool {
        self.glyph(character).is_some()
    }

    /// Returns the shaped letters of a text, as [`Typeface::shape_line`] does.
    fn shaped_line(&self, text: &str, space: f64) -> Option<ShapedLine> {
        Some(self.shape_line(text, space))
    }

    fn kern(&self, pair: [char; 2]) -> f64 {
        self.advance(self.kern_units(pair).unwrap_or(0) as f32)
    }

    fn check_work(&self) -> Result<()> {
        self.traced().budget.check()
    }
}

/// Returns the error for a file that contains `content` instead of letters.
fn refused(file: &str, content: &str) -> Error {
    let wanted = "a TrueType or OpenType face with outlines";
    Error::input(file, content, wanted, "name another font file")
}

/// True if the first face of a file has an outline for a character.
pub fn has_outline(file: &[u8], character: char) -> bool {
    let Ok(face) = FontRef::try_from_slice(file) else { return false };
    let id = face.glyph_id(character);
    id.0 != 0 && face.outline(id).is_some()
}

/// Sorts lines in the order of handwriting. Each line starts at its upper left end. The first line
/// is nearest to the upper left, and each next line is nearest to the end of the previous one.
fn in_reading_order(mut lines: Lines) -> Lines {
    for line in &mut lines {
        // The vertical distance counts twice as much as the horizontal distance.
        let [first, last] = [line[0], line[line.len() - 1]].map(|p| p.x - 2.0 * p.y);
        if last < first {
            line.reverse();
        }
    }
    // The pen starts at the upper left corner of a capital.
    let mut ordered = Lines::new();
    let mut pen = Point::new(0.0, 1.0);
    while !lines.is_empty() {
        let next = (0..lines.len()).min_by(|a, b| {
            let [a, b] = [a, b].map(|index| length(lines[*index][0] - pen));
            a.total_cmp(&b)
        });
        let line = lines.remove(next.expect("not empty"));
        pen = line[line.len() - 1];
        ordered.push(line);
    }
    ordered
}

#[cfg(test)]
mod tests;
