//! A letter on its page: its light as lines, and its strokes moved onto that light.

use super::align::Target;
use super::bend::Bent;
use super::page::REACH_PX;
use super::raster::Raster;
use super::reader::{Reader, Seen, draw, pure_ink};
use super::segment::Segment;
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
        let (page, glyph) = (&self.pages[index], &self.strokes.glyphs[index]);
        let ink = pure_ink(page, self.ink_px[index], seen, view);
        let drawn = draw(&page.grid, &self.home, [glyph].into_iter(), f32::from(PX_PER_H));
        let target = Target::new(ink.blur(BLUR_H * f32::from(PX_PER_H)));
        let (_, shift) = target.seek(&drawn, [0, 0], REACH_PX.cast_signed());
        let found = |point: [f64; 2]| {
            let at = page.page_from_plane(point);
            [0, 1].map(|axis| at[axis] + shift[axis] as f64)
        };
        let lit = |step: &&Move| step.lit && step.from_m != step.to_m;
        let mut runs: Vec<Vec<Segment>> = Vec::new();
        let mut pen_at = None;
        for step in glyph.moves.iter().filter(lit) {
            let segment = [found(step.from_m), found(step.to_m)];
            match runs.last_mut().filter(|_| pen_at == Some(step.from_m)) {
                Some(run) => run.push(segment),
                None => runs.push(vec![segment]),
            }
            pen_at = Some(step.to_m);
        }
        let trace = LightLines::new(&ink);
        let bent = trace.bend(&runs);
        let own = bent.segments();
        let (mut beside, mut ways) = (Vec::new(), Vec::new());
        let around = index.saturating_sub(1)..(index + 2).min(self.strokes.glyphs.len());
        let mut last: Option<[f64; 2]> = None;
        for at in around {
            let other = &self.strokes.glyphs[at];
            if let (Some(from), Some(step)) = (last, other.moves.first()) {
                ways.push([page.page_from_plane(from), page.page_from_plane(step.from_m)]);
            }
            last = other.moves.last().map(|step| step.to_m);
            for step in &other.moves {
                let segment = [page.page_from_plane(step.from_m), page.page_from_plane(step.to_m)];
                if !step.lit {
                    ways.push(segment);
                }
            }
        }
        // On two lines, letters above and below are as near as those on both sides.
        for (at, other) in self.strokes.glyphs.iter().enumerate() {
            if at != index && page.is_near(&other.cell) {
                let lit = other.moves.iter().filter(|step| step.lit);
                let ends =
                    lit.map(|step| [step.from_m, step.to_m].map(|m| page.page_from_plane(m)));
                beside.extend(ends);
            }
        }
        Sketch { ink, trace, shift, bent, own, beside, ways }
    }
}
