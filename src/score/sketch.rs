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
use noctograph_core::strokes::Move;

/// A letter on its page: its light, and its strokes in pixels.
pub(super) struct Sketch {
    /// Light in the color of the strokes.
    pub(super) ink: Raster,
    pub(super) trace: LightLines,
    /// Offset from the intended position, right and down.
    pub(super) shift: [isize; 2],
    /// The runs of the pen, as intended and on their light.
    pub(super) bent: Bent,
    /// The runs of the pen on their light, as segments.
    pub(super) own: Vec<Line>,
    /// Strokes of neighboring letters.
    pub(super) beside: Vec<Line>,
    /// Moves with the light off.
    pub(super) dark_moves: Vec<Line>,
}

impl Reader {
    /// Finds a letter's light, moves its strokes onto it, and adds the strokes and moves around it.
    pub(super) fn sketch(&self, index: usize, seen: &Seen, view: &View) -> Sketch {
        let (page, glyphs) = (&self.pages[index], &self.strokes.glyphs);
        // The letter is shifted as a whole onto its light, then its strokes one by one.
        let ink = pure_ink(page, self.ink_px[index], seen, view);
        let drawn = draw(&page.grid, &self.home, &glyphs[index..=index], f32::from(PX_PER_H));
        let target = Target::new(ink.blur(BLUR_H * f32::from(PX_PER_H)));
        let (_, shift) = target.best_shift(&drawn, [0, 0], REACH_PX.cast_signed());
        let [right, down] = shift.map(|px| px as f64);
        let lit = glyphs[index].moves.iter().filter(|step| step.lit && step.from_m != step.to_m);
        let strokes: Vec<&Move> = lit.collect();
        let runs = strokes.chunk_by(|a, b| a.to_m == b.from_m).map(|run| {
            let segments = run.iter().map(|step| on_page(page, step.from_m, step.to_m));
            segments.map(|segment| segment + Vec2::new(right, down)).collect()
        });
        let runs: Vec<Vec<Line>> = runs.collect();
        let trace = LightLines::new(&ink);
        let bent = trace.bend(&runs);

        // Dark moves within this letter and its neighbors, and from one to the next.
        let around = &glyphs[index.saturating_sub(1)..(index + 2).min(glyphs.len())];
        let between = around.windows(2).filter_map(|pair| {
            Some(on_page(page, pair[0].moves.last()?.to_m, pair[1].moves.first()?.from_m))
        });
        let dark = around.iter().flat_map(|glyph| &glyph.moves).filter(|step| !step.lit);
        let dark = dark.map(|step| on_page(page, step.from_m, step.to_m));
        let dark_moves = between.chain(dark).collect();
        // With several lines, letters above and below are neighbors as well.
        let near = glyphs.iter().enumerate().filter(|(other, _)| *other != index);
        let near = near.filter(|(_, other)| page.overlaps_page(&other.cell));
        let lit = near.flat_map(|(_, other)| &other.moves).filter(|step| step.lit);
        let beside = lit.map(|step| on_page(page, step.from_m, step.to_m)).collect();
        Sketch { ink, trace, shift, own: bent.segments(), bent, beside, dark_moves }
    }
}

/// Converts a segment of the word's plane to a letter's page.
fn on_page(page: &LetterPage, from_m: [f64; 2], to_m: [f64; 2]) -> Line {
    let [from, to] = [from_m, to_m].map(|[x, y]| page.grid.page_from_plane(Point::new(x, y)));
    Line::new(from, to)
}
