//! Typefaces: a TrueType or OpenType face's outlines become strokes.
//!
//! Center lines end half a stroke's width before the outline. So a face's capitals are measured
//! between the center lines of a horizontal stroke at the top and one at the bottom: these are a
//! cap height apart, the lower one on the baseline.
//!
//! Text of joined letters, with marks or from right to left is shaped ([`super::shaping`]); glyphs
//! that touch are traced together, so that joined letters are one line. A face for plotters and
//! engravers, whose contours are strokes ([`super::stored`]), is drawn as it is stored. A glyph
//! that is an area, such as a heart, is its outline. Not read: variations, and in text that is not
//! shaped ligatures and kerning outside the table `kern`.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use ab_glyph::{Font as _, FontRef};
use harfrust::{Font, GlyphId};
use kurbo::{Affine, BezPath};
use read_fonts::{TableProvider as _, tables::kern::SubtableKind};

use super::Trace;
use super::center_line::{CenterLines, center_lines, outlines};
use super::curves::polylines;
use super::glyph::{MAX_POINTS, outline};
use super::outline::Contour;
use super::shape::{Run, Shape};
use super::shaping::{Placed, Unset, shaped};
use super::stored;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Budget;
use noctograph_core::geometry::{distance, polyline_length_m};

/// Most parts of the table of pairs that are looked at: each is searched for every pair.
const MAX_SUBTABLES: usize = 64;

/// Steps of looking for the nearest of two strokes.
const NEAREST: usize = 5;

/// Most characters that are searched for an outline in a face without letters that are known.
const SEARCHED: usize = 300;

/// Largest coordinate of an outline, in cap heights.
const MAX_COORDINATE: f64 = 100.0;

/// Largest distance of an outline's polyline from its curves, in cap heights.
const CURVES: f64 = 2e-4;

/// A glyph is an area where it is so many times as thick as the face's letters, and its center
/// lines are shorter than so many of its thicknesses: a bold I has 4, but it is as thick as a
/// letter.
const THICK: f64 = 2.5;
const LONG: f64 = 6.0;

/// A face, and the characters traced so far.
pub(super) struct Typeface {
    face: Font,
    trace: Trace,
    /// Font units of a capital's height.
    cap: f64,
    /// Half the width of its strokes in cap heights; 0 where outlines are traced.
    half_width: f64,
    /// Whether the width is that of letters, with which other glyphs are compared.
    has_stems: bool,
    /// Whether its contours are strokes.
    is_stored: bool,
    traced: Mutex<Traced>,
}

/// The glyphs traced so far, alone and together, and the work that is left to the others.
struct Traced {
    shapes: BTreeMap<Vec<Part>, Option<Arc<Shape>>>,
    budget: Budget,
}

/// A glyph, and its place in font units.
type Part = (GlyphId, [i32; 2]);

/// Letters that touch, as one shape: the byte of its first character in the line, its left edge and
/// its strokes, in cap heights.
pub(super) type Joined = (usize, f64, Arc<Shape>);

/// Letters of a line, or why it cannot be set.
pub(super) type Line = std::result::Result<Vec<Joined>, Unset>;

/// Largest gap between the boxes of two glyphs that touch, in cap heights: joined letters of some
/// faces meet at a common edge.
const TOUCHING: f64 = 0.005;

/// Characters whose height is that of capitals; the first that a face has counts.
const CAPITALS: &str = "HIExo\u{5d0}\u{627}\u{915}\u{e01}0";

/// Characters whose strokes are as wide as those of the others.
const STEMS: &str = "HIlxo\u{5d0}\u{627}\u{915}\u{e01}0";

impl Typeface {
    /// Reads a face; `file` is its name in messages. Of a collection it is the first.
    pub(super) fn read(bytes: Vec<u8>, trace: Trace, file: &str) -> Result<Self> {
        let refuse = |found: String| {
            let wanted = "a TrueType or OpenType face with outlines";
            let hint = "name another font file";
            Error::input(file, found, wanted, hint)
        };
        let budget = Budget::of(file, "name another font file, or a font of the program");
        let face = Font::new(bytes, 0).ok_or_else(|| refuse("another file".into()))?;
        let traced = Mutex::new(Traced { shapes: BTreeMap::new(), budget });
        let (cap, half_width, has_stems, is_stored) = (1.0, 0.0, false, false);
        let mut typeface = Self { face, trace, cap, half_width, has_stems, is_stored, traced };
        // Of a face without any of them, such as one of emoji, it is the first that has an outline.
        let outline = |c| outline(&typeface.face, typeface.glyph(c)?, &typeface.traced().budget);
        let known = CAPITALS.chars().chain(typeface.characters().take(SEARCHED)).find_map(outline);
        let is_stored = stored::SIGNS.iter().any(|signs| {
            stored::are_strokes(&signs.chars().filter_map(outline).collect::<Vec<BezPath>>())
        });
        typeface.is_stored = is_stored;
        typeface.cap = known.map_or(0.0, |path| path.control_box().y1);
        if !(1e-3..=1e6).contains(&typeface.cap) {
            return Err(refuse("no letters".into()));
        }
        if trace == Trace::CenterLine && !typeface.is_stored {
            let traced = typeface.traced();
            let stems = STEMS.chars().map(|c| (true, c));
            let stems = stems.chain(typeface.characters().take(SEARCHED).map(|c| (false, c)));
            let widths = stems.filter_map(|(is_stem, c)| {
                let contours =
                    typeface.contours(&[(typeface.glyph(c)?, [0; 2])], &traced.budget)?;
                Some((is_stem, center_lines(&contours, &traced.budget).half_width))
            });
            let width = widths.into_iter().find(|(_, width)| (1e-4..=0.4).contains(width));
            traced.budget.check()?;
            drop(traced);
            let found = width.ok_or_else(|| refuse("no strokes".into()))?;
            (typeface.has_stems, typeface.half_width) = found;
        }
        Ok(typeface)
    }

    /// Its characters in the Basic Multilingual Plane, and emoji.
    pub(super) fn characters(&self) -> impl Iterator<Item = char> {
        let all =
            ('!'..='\u{ffff}').chain('\u{1f000}'..='\u{1faff}').filter(|c| !c.is_whitespace());
        all.filter(|c| self.glyph(*c).is_some())
    }

    fn glyph(&self, character: char) -> Option<GlyphId> {
        self.face.charmap().map_unicode(character)
    }

    /// A character's strokes; `None` where the face lacks it.
    pub(super) fn shape(&self, character: char) -> Option<Arc<Shape>> {
        let glyph = self.glyph(character)?;
        if character.is_whitespace() {
            let advance = self.advance(self.face.glyph_metrics().h_advance(glyph));
            return Some(Arc::new(Shape { advance, ..Shape::default() }));
        }
        self.joined(&[(glyph, [0; 2])])
    }

    /// The strokes of glyphs together.
    fn joined(&self, parts: &[Part]) -> Option<Arc<Shape>> {
        let Traced { shapes, budget } = &mut *self.traced();
        let shape = || self.draw(parts, budget).filter(|_| budget.check().is_ok());
        shapes.entry(parts.to_vec()).or_insert_with(|| shape().map(Arc::new)).clone()
    }

    /// A line of letters that are shaped, from left to right.
    ///
    /// # Errors
    ///
    /// [`Unset`].
    pub(super) fn line(&self, line: &str, space: f64) -> Line {
        let unit = self.advance(1.0);
        let own = self.glyph(' ').map(|glyph| self.face.glyph_metrics().h_advance(glyph).into());
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let mut glyphs = shaped(&self.face, line, own.unwrap_or(space / unit) as i32)?;
        let side = |placed: &Placed| {
            let path = outline(&self.face, placed.glyph, &self.traced().budget)?;
            let bounds = path.control_box();
            Some([bounds.x0, bounds.x1].map(|x| x + f64::from(placed.at[0])))
        };
        let mut sided: Vec<([f64; 2], Placed)> =
            glyphs.drain(..).filter_map(|placed| Some((side(&placed)?, placed))).collect();
        sided.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
        let mut groups: Vec<(f64, Vec<Placed>)> = Vec::new();
        for ([left, right], placed) in sided {
            match groups.last_mut().filter(|(end, _)| left <= *end + TOUCHING / unit) {
                Some((end, group)) => {
                    *end = end.max(right);
                    group.push(placed);
                }
                None => groups.push((right, vec![placed])),
            }
        }
        let joined = groups.iter().map(|(_, group)| {
            let byte = group.iter().map(|placed| placed.byte).min().expect("not empty");
            let start = group[0].at[0];
            let part = |placed: &Placed| (placed.glyph, [placed.at[0] - start, placed.at[1]]);
            let shape = self.joined(&group.iter().map(part).collect::<Vec<_>>());
            let missing = |placed: &&Placed| self.joined(&[(placed.glyph, [0; 2])]).is_none();
            let unset = || match group.iter().find(missing) {
                Some(placed) => Unset::Missing(placed.byte),
                None => Unset::TooLarge(byte, group.len()),
            };
            Ok((byte, unit * f64::from(start), shape.ok_or_else(unset)?))
        });
        joined.collect()
    }

    /// Checks that all characters so far were traced within the face's budget.
    pub(super) fn check_work(&self) -> Result<()> {
        self.traced().budget.check()
    }

    fn traced(&self) -> MutexGuard<'_, Traced> {
        self.traced.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Kerning of two characters in the table `kern`, in cap heights between center lines.
    pub(super) fn kern(&self, pair: [char; 2]) -> f64 {
        self.advance(self.kern_units(pair).unwrap_or(0) as f32)
    }

    fn kern_units(&self, [left, right]: [char; 2]) -> Option<i32> {
        let (left, right) = (self.glyph(left)?, self.glyph(right)?);
        let table = self.face.tables().kern().ok()?;
        let parts = table.subtables().take(MAX_SUBTABLES).flatten();
        let mut level = parts.filter(|part| part.is_horizontal() && !part.is_variable());
        level.find_map(|part| match part.kind().ok()? {
            SubtableKind::Format0(pairs) => pairs.kerning(left, right),
            SubtableKind::Format1(_) => None,
            SubtableKind::Format2(classes) => classes.kerning(left, right),
            SubtableKind::Format3(classes) => classes.kerning(left, right),
        })
    }

    fn draw(&self, parts: &[Part], budget: &Budget) -> Option<Shape> {
        let advance = self.advance(self.face.glyph_metrics().h_advance(parts[0].0));
        if !(0.0..=MAX_COORDINATE).contains(&advance) {
            return None;
        }
        if self.is_stored {
            let lines = stored::strokes(&self.path(parts, budget)?, CURVES, MAX_POINTS)?;
            let runs: Vec<Run> =
                lines.into_iter().map(|points| Run { lit: true, points }).collect();
            return (!runs.is_empty()).then_some(Shape { advance, runs, lost: 0.0 });
        }
        let contours = self.contours(parts, budget)?;
        let mut lost = 0.0;
        let lines = match self.trace {
            Trace::CenterLine => {
                let found = center_lines(&contours, budget);
                if self.is_area(&found) {
                    outlines(&contours, budget)
                } else {
                    lost = found.lost;
                    found.lines
                }
            }
            Trace::Outline => outlines(&contours, budget),
        };
        budget.spend_steps(NEAREST * lines.len() * lines.len()).then_some(())?;
        let scale = 1.0 / (1.0 - 2.0 * self.half_width);
        let place = |[x, y]: [f64; 2]| [x * scale, (y - self.half_width) * scale];
        let runs = in_reading_order(lines)
            .into_iter()
            .map(|line| Run { lit: true, points: line.into_iter().map(place).collect() });
        let shape = Shape { advance, runs: runs.collect(), lost };
        (!shape.runs.is_empty()).then_some(shape)
    }

    /// Whether a glyph is an area and no stroke: thicker than the face's letters, and short for its
    /// thickness.
    fn is_area(&self, found: &CenterLines) -> bool {
        let length: f64 = found.lines.iter().map(|line| polyline_length_m(line)).sum();
        let is_thick = !self.has_stems || found.thickest > THICK * self.half_width;
        is_thick && length < 2.0 * LONG * found.thickest
    }

    /// Font units in cap heights between center lines.
    fn advance(&self, units: f32) -> f64 {
        f64::from(units) / self.cap / (1.0 - 2.0 * self.half_width)
    }

    /// The outline of glyphs in cap heights; `None` where they have none.
    fn contours(&self, parts: &[Part], budget: &Budget) -> Option<Vec<Contour>> {
        let mut contours = polylines(&self.path(parts, budget)?, CURVES, MAX_POINTS)?;
        for contour in &mut contours {
            if contour[0] == contour[contour.len() - 1] {
                contour.pop();
            }
        }
        contours.retain(|contour| contour.len() > 2);
        (!contours.is_empty()).then_some(contours)
    }

    /// The path of glyphs in cap heights.
    fn path(&self, parts: &[Part], budget: &Budget) -> Option<BezPath> {
        let mut path = BezPath::new();
        for (id, at) in parts {
            let mut part = outline(&self.face, *id, budget)?;
            if *at != [0; 2] {
                part.apply_affine(Affine::translate((at[0].into(), at[1].into())));
            }
            path.extend(part);
        }
        path.apply_affine(Affine::scale(1.0 / self.cap));
        (size(&path) <= MAX_COORDINATE).then_some(path)
    }
}

/// Whether the first face of a file has an outline of a character.
pub fn has_outline(file: &[u8], character: char) -> bool {
    let Ok(face) = FontRef::try_from_slice(file) else { return false };
    let id = face.glyph_id(character);
    id.0 != 0 && face.outline(id).is_some()
}

/// Largest coordinate of a path.
fn size(path: &BezPath) -> f64 {
    let bounds = path.control_box();
    [bounds.x0, bounds.x1, bounds.y0, bounds.y1].into_iter().map(f64::abs).fold(0.0, f64::max)
}

/// Lines in the order of handwriting: from the upper left, each next the nearest, from its upper
/// left end.
fn in_reading_order(mut lines: Vec<Vec<[f64; 2]>>) -> Vec<Vec<[f64; 2]>> {
    for line in &mut lines {
        let late = |[x, y]: [f64; 2]| x - 2.0 * y;
        let last = line[line.len() - 1];
        if late(last) < late(line[0]) {
            line.reverse();
        }
    }
    let mut ordered: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut pen = [0.0, 1.0];
    while !lines.is_empty() {
        let far = |line: &Vec<[f64; 2]>| distance(pen, line[0]);
        let next = (0..lines.len()).min_by(|a, b| far(&lines[*a]).total_cmp(&far(&lines[*b])));
        let line = lines.remove(next.expect("not empty"));
        pen = line[line.len() - 1];
        ordered.push(line);
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOTO: &[u8] = include_bytes!("../../fonts/Roboto-Thin.ttf");

    fn roboto(trace: Trace) -> Typeface {
        Typeface::read(ROBOTO.to_vec(), trace, "Roboto-Thin.ttf").unwrap()
    }

    /// Strokes and closed strokes of a character.
    fn strokes(face: &Typeface, character: char) -> (usize, usize) {
        let shape = face.shape(character).unwrap();
        let closed =
            shape.runs.iter().filter(|run| run.points[0] == run.points[run.points.len() - 1]);
        (shape.runs.len(), closed.count())
    }

    #[test]
    fn center_lines_are_the_strokes_of_handwriting() {
        let face = roboto(Trace::CenterLine);
        let open = [("CGIJLMNSUVWZ", 1), ("BDPTXQ", 2), ("AEFHRY", 3), ("1257", 1)];
        let mut wrong = String::new();
        for (characters, most) in open {
            for character in characters.chars() {
                if strokes(&face, character).0 > most {
                    wrong.push(character);
                }
            }
        }
        assert_eq!(wrong, "", "more strokes than a hand would need");
        assert_eq!([strokes(&face, 'O'), strokes(&face, '0'), strokes(&face, 'o')], [(1, 1); 3]);
        assert_eq!(strokes(&face, 'i').0, 2, "a stem and a dot");
    }

    #[test]
    fn capitals_are_a_cap_height_high_on_the_baseline() {
        let face = roboto(Trace::CenterLine);
        for character in ('A'..='Z').chain('0'..='9') {
            let [_, bottom, _, top] = face.shape(character).unwrap().ink();
            let tail = if character == 'Q' { 0.2 } else { 0.03 };
            assert!((top - 1.0).abs() < 0.03, "{character}: top at {top}");
            assert!(bottom.abs() < tail, "{character}: bottom at {bottom}");
        }
        let shape = face.shape('L').unwrap();
        assert_eq!(shape.runs.len(), 1);
        let corner =
            shape.runs[0].points.iter().min_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1])));
        assert_eq!(shape.runs[0].points.len(), 3, "two straight strokes and a sharp corner");
        assert!(corner.unwrap()[1].abs() < 0.005, "{corner:?}");
    }

    #[test]
    fn center_lines_stay_in_the_ink() {
        let face = roboto(Trace::CenterLine);
        for character in ('A'..='Z').chain('a'..='z').chain('0'..='9').chain("äßØ&@".chars()) {
            let budget = Budget::of("Roboto-Thin.ttf", "none");
            let ink = super::super::outline::Filled::new(
                &face.contours(&[(face.glyph(character).unwrap(), [0; 2])], &budget).unwrap(),
                &budget,
            );
            let shape = face.shape(character).unwrap();
            let (mut inside, mut all) = (0, 0);
            for run in
                shape.runs.iter().filter(|run| run.points[0] != run.points[run.points.len() - 1])
            {
                for [x, y] in super::super::smooth::evenly(&run.points, 0.01) {
                    let scale = 1.0 - 2.0 * face.half_width;
                    all += 1;
                    inside += usize::from(ink.holds([x * scale, y * scale + face.half_width]));
                }
            }
            assert!(inside as f64 >= 0.93 * f64::from(all), "{character}: {inside} of {all}");
        }
    }

    #[test]
    fn flat_tips_are_not_extended_and_stems_stay_upright() {
        let face = roboto(Trace::CenterLine);
        for character in "MN".chars() {
            let shape = face.shape(character).unwrap();
            let points = &shape.runs[0].points;
            let n = points.len();
            for (foot, tip) in [(0, 1), (n - 1, n - 2)] {
                let lean = (points[foot][0] - points[tip][0]).abs();
                assert!(lean < 0.01, "{character}: {points:?}");
            }
        }
        for character in "AMNVW4".chars() {
            let [_, bottom, _, top] = face.shape(character).unwrap().ink();
            assert!(top < 1.02 && bottom > -0.02, "{character}: {bottom} to {top}");
        }
    }

    #[test]
    fn an_outline_goes_around_the_ink() {
        let face = roboto(Trace::Outline);
        assert_eq!(strokes(&face, 'I'), (1, 1));
        assert_eq!(strokes(&face, 'O'), (2, 2), "within and without");
        assert_eq!(face.shape('I').unwrap().runs[0].points.len(), 5, "four corners");
    }

    /// A face of glyphs of straight contours, in units of 1/700 of a capital.
    fn face(glyphs: &[(char, &[&[[i16; 2]]])]) -> Typeface {
        let half = |n: usize| u16::try_from(n).unwrap();
        let (mut glyf, mut loca, mut hmtx) = (Vec::new(), vec![0_u32; 2], vec![0; 4]);
        let mut groups = Vec::new();
        for (index, (c, contours)) in glyphs.iter().enumerate() {
            let points: Vec<[i16; 2]> = contours.iter().copied().flatten().copied().collect();
            let side = |of: fn(i16, i16) -> i16, axis: usize| {
                points.iter().map(|point| point[axis]).reduce(of).unwrap()
            };
            let box_ = [side(i16::min, 0), side(i16::min, 1), side(i16::max, 0), side(i16::max, 1)];
            glyf.extend(i16::try_from(contours.len()).unwrap().to_be_bytes());
            glyf.extend(box_.into_iter().flat_map(i16::to_be_bytes));
            let mut end = 0;
            for contour in *contours {
                end += contour.len();
                glyf.extend(half(end - 1).to_be_bytes());
            }
            glyf.extend([0, 0]);
            glyf.extend(vec![1; points.len()]);
            for axis in 0..2 {
                let mut last = 0;
                for point in &points {
                    glyf.extend((point[axis] - last).to_be_bytes());
                    last = point[axis];
                }
            }
            glyf.resize(glyf.len().next_multiple_of(4), 0);
            loca.push(u32::try_from(glyf.len()).unwrap());
            hmtx.extend([500_u16, 0].into_iter().flat_map(u16::to_be_bytes));
            let glyph = u32::try_from(index + 1).unwrap();
            groups.push([u32::from(*c), u32::from(*c), glyph]);
        }
        groups.sort_unstable();
        let n = half(glyphs.len() + 1);
        let n_groups = u32::try_from(groups.len()).unwrap();
        let mut cmap: Vec<u8> =
            [0_u16, 1, 3, 10, 0, 12, 12, 0].into_iter().flat_map(u16::to_be_bytes).collect();
        let head = [16 + 12 * n_groups, 0, n_groups];
        cmap.extend(head.iter().chain(groups.iter().flatten()).flat_map(|n| n.to_be_bytes()));
        let mut head = vec![0; 54];
        (head[18], head[19], head[51]) = (3, 232, 1);
        let mut hhea = vec![0; 36];
        hhea[34..].copy_from_slice(&n.to_be_bytes());
        let maxp = [&[0, 1, 0, 0][..], &n.to_be_bytes()].concat();
        let loca = loca.into_iter().flat_map(u32::to_be_bytes).collect();
        let tables = [
            (b"cmap", cmap),
            (b"glyf", glyf),
            (b"head", head),
            (b"hhea", hhea),
            (b"hmtx", hmtx),
            (b"loca", loca),
            (b"maxp", maxp),
        ];
        let bytes = super::super::glyph::face_of(&tables);
        Typeface::read(bytes, Trace::CenterLine, "face.ttf").unwrap()
    }

    /// The points of a character's strokes, in units of 1/700 of a capital.
    fn drawn(face: &Typeface, character: char) -> Vec<Vec<[i64; 2]>> {
        #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
        let round = |point: &[f64; 2]| point.map(|x| (700.0 * x).round() as i64);
        let shape = face.shape(character).unwrap();
        shape.runs.iter().map(|run| run.points.iter().map(round).collect()).collect()
    }

    #[test]
    fn a_face_of_open_contours_is_drawn_as_it_is_stored() {
        let face = face(&[
            ('L', &[&[[0, 700], [0, 0], [400, 0]]]),
            ('E', &[&[[400, 0], [0, 0], [0, 700], [400, 700]], &[[0, 350], [350, 350]]]),
            ('H', &[&[[0, 700], [0, 0]], &[[0, 350], [400, 350]], &[[400, 700], [400, 0]]]),
            ('T', &[&[[0, 700], [400, 700]], &[[200, 700], [200, 0]]]),
            ('D', &[&[[0, 0], [0, 700], [400, 500], [400, 200], [0, 0]]]),
        ]);
        assert_eq!(drawn(&face, 'L'), [[[0, 700], [0, 0], [400, 0]]], "one, and not closed");
        assert_eq!("EHTD".chars().map(|c| drawn(&face, c).len()).collect::<Vec<_>>(), [2, 3, 2, 1]);
        assert_eq!(drawn(&face, 'E')[0][0], [400, 0]);
        let d = drawn(&face, 'D');
        assert_eq!((d[0][0], d[0].len()), (d[0][4], 5), "closed where it is stored so");
    }

    #[test]
    fn a_face_of_lines_there_and_back_is_drawn_once() {
        let face = face(&[
            ('V', &[&[[0, 700], [200, 0], [400, 700], [200, 0]]]),
            ('H', &[&[[0, 700], [0, 0]], &[[0, 350], [400, 350]], &[[400, 700], [400, 0]]]),
            ('L', &[&[[0, 700], [0, 0], [400, 0], [0, 0]]]),
        ]);
        assert_eq!(drawn(&face, 'V'), [[[0, 700], [200, 0], [400, 700]]]);
        assert_eq!(drawn(&face, 'L'), [[[0, 700], [0, 0], [400, 0]]]);
        assert_eq!(drawn(&face, 'H').len(), 3);
    }

    #[test]
    fn a_solid_glyph_is_its_outline_and_a_stroke_its_center_line() {
        let star: Vec<[i16; 2]> = (0..10)
            .map(|k| {
                let r = if k % 2 == 0 { 350.0 } else { 140.0 };
                let (sin, cos) = libm::sincos(f64::from(k) * std::f64::consts::PI / 5.0);
                #[expect(clippy::cast_possible_truncation, reason = "font units")]
                [350.0 + r * sin, 350.0 + r * cos].map(|x| x.round() as i16)
            })
            .collect();
        let h: &[[i16; 2]] = &[
            [0, 0],
            [0, 700],
            [70, 700],
            [70, 385],
            [400, 385],
            [400, 700],
            [470, 700],
            [470, 0],
            [400, 0],
            [400, 315],
            [70, 315],
            [70, 0],
        ];
        let face = face(&[
            ('H', &[h]),
            ('I', &[&[[0, 0], [0, 700], [80, 700], [80, 0]]]),
            ('.', &[&[[0, 0], [0, 90], [90, 90], [90, 0]]]),
            ('\u{2665}', &[&[[350, 0], [0, 420], [100, 650], [350, 500], [600, 650], [700, 420]]]),
            ('\u{2605}', &[&star]),
            ('\u{25a0}', &[&[[0, 0], [0, 600], [600, 600], [600, 0]]]),
        ]);
        let is_closed = |c: char| {
            let shape = face.shape(c).unwrap();
            shape.runs.len() == 1 && shape.runs[0].points.first() == shape.runs[0].points.last()
        };
        assert!("\u{2665}\u{2605}\u{25a0}".chars().all(is_closed), "areas");
        assert!(!"HI.".chars().any(is_closed), "lines and a dot");
        assert_eq!(face.shape('\u{2605}').unwrap().runs[0].points.len(), 11, "ten corners");
        // Without letters to compare with, as a face of emoji.
        let alone = self::face(&[('\u{2605}', &[&star])]);
        assert_eq!(alone.shape('\u{2605}').unwrap().runs[0].points.len(), 11);
    }
}
