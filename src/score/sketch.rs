//! Sketch of a letter: its light as lines, and its strokes moved onto that light.

use kurbo::{Line, Point, Vec2};

use super::align::Target;
use super::bend::Bent;
use super::plane::{LetterPage, REACH_PX};
use super::raster::Raster;
use super::reader::{Reader, Seen, draw, pure_ink};
use super::trace::LightLines;
use super::view::View;
use super::{BLUR_H, PX_PER_H};
use noctograph_core::strokes::{Glyph, Move};

/// The sketch of a letter. Lengths are in pixels of the letter's page.
pub(super) struct Sketch {
    /// Light in the color of the strokes.
    pub(super) ink: Raster,
    pub(super) trace: LightLines,
    /// Offset of the letter's light from its intended position: right and down.
    pub(super) shift: [isize; 2],
    /// The runs of the pen, both as intended and as shifted to match their light.
    pub(super) bent: Bent,
    /// The moved runs of the pen, as segments.
    pub(super) own: Vec<Line>,
    /// Strokes of other letters whose cells are partly on the page.
    pub(super) beside: Vec<Line>,
    /// Moves with the lamp off, within this letter and its neighbors and between them.
    pub(super) dark_moves: Vec<Line>,
}

impl Reader {
    /// Moves the strokes of the letter `index` onto its light, and adds the strokes and dark moves
    /// around it.
    pub(super) fn sketch(&self, index: usize, seen: &Seen, view: &View) -> Sketch {
        let (page, glyphs) = (&self.pages[index], &self.strokes.glyphs);
        // First shifts the whole letter onto its light, and then moves it stroke by stroke.
        let ink = pure_ink(page, self.ink_px[index], seen, view);
        let drawn = draw(&page.grid, &self.home, &glyphs[index..=index], f32::from(PX_PER_H));
        let target = Target::new(ink.blur(BLUR_H * f32::from(PX_PER_H)));
        let (_, shift) = target.best_shift(&drawn, [0, 0], REACH_PX.cast_signed());
        let trace = LightLines::new(&ink);
        let bent = trace.bend(&runs_on_page(&glyphs[index], page, shift));
        let (beside, dark_moves) = (self.strokes_beside(index), self.dark_moves_around(index));
        Sketch { ink, trace, shift, own: bent.segments(), bent, beside, dark_moves }
    }

    /// Returns the dark moves in and between a letter and its two neighbors, on the letter's page.
    fn dark_moves_around(&self, index: usize) -> Vec<Line> {
        let (page, glyphs) = (&self.pages[index], &self.strokes.glyphs);
        let around = &glyphs[index.saturating_sub(1)..(index + 2).min(glyphs.len())];
        let between = around.windows(2).filter_map(|pair| {
            Some(on_page(page, pair[0].moves.last()?.to_m, pair[1].moves.first()?.from_m))
        });
        let dark = around.iter().flat_map(|glyph| &glyph.moves).filter(|step| !step.lit);
        between.chain(dark.map(|step| on_page(page, step.from_m, step.to_m))).collect()
    }

    /// Returns the strokes of the other letters whose cells are partly on a letter's page. Other
    /// letters include those of the lines above and below.
    fn strokes_beside(&self, index: usize) -> Vec<Line> {
        let page = &self.pages[index];
        let others = self.strokes.glyphs.iter().enumerate().filter(|(other, _)| *other != index);
        let near = others.filter(|(_, glyph)| page.overlaps_page(&glyph.cell));
        let lit = near.flat_map(|(_, glyph)| &glyph.moves).filter(|step| step.lit);
        lit.map(|step| on_page(page, step.from_m, step.to_m)).collect()
    }
}

/// Returns the runs of the pen in a letter, moved by a shift in pixels of its page.
fn runs_on_page(glyph: &Glyph, page: &LetterPage, shift: [isize; 2]) -> Vec<Vec<Line>> {
    let [right, down] = shift.map(|px| px as f64);
    let lit = glyph.moves.iter().filter(|step| step.lit && step.from_m != step.to_m);
    let strokes: Vec<&Move> = lit.collect();
    let runs = strokes.chunk_by(|a, b| a.to_m == b.from_m).map(|run| {
        let segments = run.iter().map(|step| on_page(page, step.from_m, step.to_m));
        segments.map(|segment| segment + Vec2::new(right, down)).collect()
    });
    runs.collect()
}

/// Converts a segment from the word's plane to a letter's page.
fn on_page(page: &LetterPage, from_m: [f64; 2], to_m: [f64; 2]) -> Line {
    let [from, to] = [from_m, to_m].map(|[x, y]| page.grid.page_from_plane(Point::new(x, y)));
    Line::new(from, to)
}
