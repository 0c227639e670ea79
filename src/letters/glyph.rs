//! Glyphs of a TrueType or OpenType face as Bézier paths, within a budget.
//!
//! read-fonts stops endlessly nested glyphs and charstrings. The code that a CFF or CFF2 face runs
//! is counted here, because a kilobyte of subroutines can do much work without drawing a point.

use std::cell::Cell;

use harfrust::{Font, GlyphId};
use kurbo::{BezPath, PathEl};
use read_fonts::model::Error;
use read_fonts::model::glyph::outline::{
    DrawMemory, DrawOptions, OutlineGlyph, PathContourStart, PathElement, cff::CffGlyph,
};
use read_fonts::model::glyph::{GlyphSource, GlyphSourceOrder};
use read_fonts::ps::cff::{blend::BlendState, index::Index};
use read_fonts::ps::charstring::{CharstringContext, CharstringKind, TransformSink, evaluate};

use super::shaping::MAX_POINTS;
use noctograph_core::files::Budget;

/// Tables of outlines in order of preference.
const SOURCES: GlyphSourceOrder =
    GlyphSourceOrder::new(&[GlyphSource::Glyf, GlyphSource::Cff, GlyphSource::Cff2]);

/// Maximum size of a glyph's charstring with its subroutines, in bytes. A Chinese glyph takes a few
/// thousand bytes.
const MAX_CHARSTRING_BYTES: usize = 100_000;

/// Budget steps for an outline, and for each of its points or bytes of code.
const STEPS_PER_OUTLINE: usize = 20_000;
const STEPS_PER_POINT: usize = 100;

/// Returns the outline of a glyph in font units (y up), with every contour closed. Returns `None`
/// if the glyph has none or too many points, or if the budget is spent.
pub(super) fn outline(face: &Font, glyph: GlyphId, budget: &Budget) -> Option<BezPath> {
    spend(budget, STEPS_PER_OUTLINE)?;
    let mut elements: Vec<PathElement> = Vec::new();
    match face.outline_glyphs_with(SOURCES).get(glyph)? {
        OutlineGlyph::Cff(cff) => {
            // The size is known only after drawing. A charstring that fails counts as longest.
            let n_bytes = draw_charstring(&cff, &mut elements);
            spend(budget, STEPS_PER_POINT * n_bytes.unwrap_or(MAX_CHARSTRING_BYTES))?;
            n_bytes?;
        }
        // The number of points of a composite glyph is known before it is drawn.
        OutlineGlyph::Glyf(glyf) if glyf.plan().num_points as usize <= MAX_POINTS => {
            spend(budget, STEPS_PER_POINT * glyf.plan().num_points as usize)?;
            let options = DrawOptions::new().with_contour_start(PathContourStart::ScanForward);
            OutlineGlyph::Glyf(glyf).draw(&options, DrawMemory::Scratch, &mut elements).ok()?;
        }
        _ => return None,
    }
    let path = BezPath::from_iter(elements.into_iter().map(to_kurbo));
    let n_elements = path.elements().len();
    ((1..=MAX_POINTS).contains(&n_elements) && path.is_finite()).then_some(path)
}

/// Charges steps to a budget. Returns `None` if the budget is spent.
fn spend(budget: &Budget, n_steps: usize) -> Option<()> {
    budget.spend_steps(n_steps).then_some(())
}

/// Draws a glyph's charstring into `elements`, and returns how many bytes of code it ran, including
/// called subroutines. Returns `None` if it is malformed or longer than [`MAX_CHARSTRING_BYTES`].
fn draw_charstring(glyph: &CffGlyph<'_>, elements: &mut Vec<PathElement>) -> Option<usize> {
    let (face, subfont) = (glyph.cff_font(), glyph.subfont());
    let local = match subfont.subrs_offset() as usize {
        0 => Index::Empty,
        offset => Index::new(face.data().get(offset..)?, face.version() == 2).ok()?,
    };
    let charstring = face.charstrings().get(glyph.glyph().to_u32() as usize)?;
    let global = face.global_subrs();
    let subroutines = Subroutines { global, local, n_bytes: Cell::new(charstring.len()) };
    let store = face.var_store().cloned();
    let blend = store.and_then(|store| BlendState::new(store, &[], subfont.vs_index()).ok());
    let mut sink = TransformSink::new(elements, face.transform(subfont, None));
    evaluate(&subroutines, blend, charstring, &mut sink).ok()?;
    Some(subroutines.n_bytes.get())
}

/// The subroutines of a face, and the number of bytes of code that were run so far.
struct Subroutines<'a> {
    global: &'a Index<'a>,
    local: Index<'a>,
    n_bytes: Cell<usize>,
}

impl<'a> Subroutines<'a> {
    /// Returns the code of a subroutine by its number, to which a bias is added (Adobe Technical
    /// Note 5177). Fails if there is no such subroutine or if too much code was run.
    fn call(&self, index: &Index<'a>, number: i32) -> Result<&[u8], Error> {
        let place = number.checked_add(index.subr_bias());
        let place = place.and_then(|place| usize::try_from(place).ok());
        let code = place.and_then(|place| index.get(place)).ok_or(Error::Malformed)?;
        self.n_bytes.set(self.n_bytes.get() + code.len());
        if self.n_bytes.get() > MAX_CHARSTRING_BYTES { Err(Error::LimitExceeded) } else { Ok(code) }
    }
}

impl CharstringContext for Subroutines<'_> {
    fn kind(&self) -> CharstringKind {
        CharstringKind::Type2
    }

    /// Fails, because letters composed by the obsolete `endchar` with four numbers are not drawn.
    fn seac_components(&self, _base: i32, _accent: i32) -> Result<[&[u8]; 2], Error> {
        Err(Error::InvalidOperation)
    }

    fn global_subr(&self, number: i32) -> Result<&[u8], Error> {
        self.call(self.global, number)
    }

    fn subr(&self, number: i32) -> Result<&[u8], Error> {
        self.call(&self.local, number)
    }
}

/// Converts an element of a path to kurbo's type.
fn to_kurbo(element: PathElement) -> PathEl {
    match element {
        PathElement::MoveTo { x, y } => PathEl::MoveTo((x, y).into()),
        PathElement::LineTo { x, y } => PathEl::LineTo((x, y).into()),
        PathElement::QuadTo { cx0, cy0, x, y } => PathEl::QuadTo((cx0, cy0).into(), (x, y).into()),
        PathElement::CurveTo { cx0, cy0, cx1, cy1, x, y } => {
            PathEl::CurveTo((cx0, cy0).into(), (cx1, cy1).into(), (x, y).into())
        }
        PathElement::Close => PathEl::ClosePath,
    }
}

#[cfg(test)]
mod tests {
    use super::super::face_tests::{face_of, words};
    use super::*;

    /// A face in which A calls subroutines endlessly, H is made of lines, and O of curves.
    const CALLS: &[u8] = include_bytes!("../../tests/fuzz/seeds/typeface/calls.otf");
    const POINTS: &[u8] = include_bytes!("../../tests/fuzz/seeds/typeface/points.otf");

    fn drawn(face: &Font, glyph: GlyphId) -> Option<BezPath> {
        outline(face, glyph, &Budget::new("face.otf", "none"))
    }

    #[test]
    fn charstrings_are_drawn_and_those_without_end_are_not() {
        for file in [CALLS, POINTS] {
            let face = Font::new(file, 0).unwrap();
            let glyph = |c: char| drawn(&face, face.charmap().map_unicode(c).unwrap());
            assert_eq!(glyph('A'), None, "a hundred billion calls");
            let lines = "M60 0H120V700H60ZM480 0H540V700H480ZM120 330H480V390H120Z";
            let wanted = BezPath::from_svg(lines).unwrap();
            assert_eq!(glyph('H').unwrap().to_svg(), wanted.to_svg());
            assert!(glyph('O').unwrap().to_svg().contains('C'));
            // Each takes a hundredth of the budget, of which ten are left.
            let budget = Budget::new("face.otf", "none");
            let a = face.charmap().map_unicode('A').unwrap();
            assert!(budget.spend_steps(900_000_000) && budget.check().is_ok());
            (0..10).for_each(|_| assert_eq!(outline(&face, a, &budget), None));
            assert!(budget.check().is_err(), "what leads to no letter is work, too");
        }
    }

    /// Tests a face of 12 composite glyphs, each with ten copies of the next, and a simple glyph.
    #[test]
    fn composites_within_composites_end() {
        let mut glyf: Vec<u8> = Vec::new();
        let mut loca: Vec<u32> = vec![0];
        for level in 0_u16..12 {
            glyf.extend([0xff, 0xff, 0, 0, 0, 0, 0, 0, 0, 0]);
            for part in 0..10 {
                let flags: u16 = if part < 9 { 0x22 } else { 2 };
                glyf.extend(words([flags, level + 1, 0]));
            }
            loca.push(u32::try_from(glyf.len()).unwrap());
        }
        glyf.extend([0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 1, 1, 1]);
        glyf.extend([0, 9, 0, 9, 0, 9, 0, 0, 0, 9, 0, 9]);
        loca.push(u32::try_from(glyf.len()).unwrap());
        let mut head = vec![0; 54];
        (head[18], head[51]) = (4, 1);
        let face = face_of(&[
            (b"glyf", glyf),
            (b"head", head),
            (b"hhea", vec![0; 36]),
            (b"loca", loca.into_iter().flat_map(u32::to_be_bytes).collect()),
            (b"maxp", vec![0, 1, 0, 0, 0, 13]),
        ]);
        let face = Font::new(face, 0).unwrap();
        assert_eq!([0, 8].map(|id| drawn(&face, GlyphId::new(id))), [None, None], "a trillion");
        let n = [12, 11, 10].map(|id| drawn(&face, GlyphId::new(id)).unwrap().segments().count());
        assert_eq!(n, [3, 30, 300]);
    }
}
