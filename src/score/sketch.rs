//! A letter on its page: its light as lines, and its strokes moved onto that light.

use super::align::Target;
use super::bend::{Bent, Segment};
use super::plane::REACH_PX;
use super::raster::Raster;
use super::reader::{Reader, Seen, draw, pure_ink};
use super::trace::LightLines;
use super::view::View;
use super::{BLUR_H, PX_PER_H};
use noctograph_core::strokes::Move;

/// A letter on its page: its light, and its strokes in pixels.
pub(super) struct Sketch {
    /// Its light in the color of the strokes.
    pub(super) ink: Raster,
    pub(super) trace: LightLines,
    /// Offset from its place, right and down.
    pub(super) shift: [isize; 2],
    /// The runs of the pen, as intended and where their light is.
    pub(super) bent: Bent,
    /// The runs of the pen on their light, as segments.
    pub(super) own: Vec<Segment>,
    /// Strokes of the letters beside.
    pub(super) beside: Vec<Segment>,
    /// Moves with the light off.
    pub(super) ways: Vec<Segment>,
}

impl Reader {
    /// A letter's light and its strokes where that light is, and what is around.
    pub(super) fn sketch(&self, index: usize, seen: &Seen, view: &View) -> Sketch {
        let (page, glyphs) = (&self.pages[index], &self.strokes.glyphs);
        let ink = pure_ink(page, self.ink_px[index], seen, view);
        let drawn = draw(&page.grid, &self.home, &glyphs[index..=index], f32::from(PX_PER_H));
        let target = Target::new(ink.blur(BLUR_H * f32::from(PX_PER_H)));
        let (_, shift) = target.seek(&drawn, [0, 0], REACH_PX.cast_signed());
        let on_page = |from_m, to_m| [from_m, to_m].map(|m| page.page_from_plane(m));
        let lit = glyphs[index].moves.iter().filter(|step| step.lit && step.from_m != step.to_m);
        let strokes: Vec<&Move> = lit.collect();
        let [right, down] = shift.map(|px| px as f64);
        let runs = strokes.chunk_by(|a, b| a.to_m == b.from_m).map(|run| {
            let segments = run.iter().map(|step| on_page(step.from_m, step.to_m));
            segments.map(|ends| ends.map(|[x, y]| [x + right, y + down])).collect()
        });
        let runs: Vec<Vec<Segment>> = runs.collect();
        let trace = LightLines::new(&ink);
        let bent = trace.bend(&runs);
        let around = &glyphs[index.saturating_sub(1)..(index + 2).min(glyphs.len())];
        let between = around.windows(2).filter_map(|pair| {
            Some(on_page(pair[0].moves.last()?.to_m, pair[1].moves.first()?.from_m))
        });
        let dark = around.iter().flat_map(|glyph| &glyph.moves).filter(|step| !step.lit);
        let ways = between.chain(dark.map(|step| on_page(step.from_m, step.to_m))).collect();
        // On two lines, letters above and below are as near as those on both sides.
        let near = glyphs.iter().enumerate().filter(|(other, _)| *other != index);
        let near = near.filter(|(_, other)| page.is_near(&other.cell));
        let lit = near.flat_map(|(_, other)| &other.moves).filter(|step| step.lit);
        let beside = lit.map(|step| on_page(step.from_m, step.to_m)).collect();
        Sketch { ink, trace, shift, own: bent.segments(), bent, beside, ways }
    }
}
