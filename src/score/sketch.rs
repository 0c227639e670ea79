//! A letter on its page, its cell and a margin: its light as lines, and its strokes moved onto that
//! light.

use super::align::Target;
use super::bend::{Bent, Segment};
use super::plane::Grid;
use super::raster::{Raster, whole};
use super::reader::{Reader, Seen, draw, pure_ink};
use super::trace::LightLines;
use super::view::View;
use super::{BLUR_H, PX_PER_H};
use noctograph_core::strokes::{Cell, Move};

/// Farthest shift of a letter that is searched, in pixels: a quarter of a cap height.
const REACH_PX: usize = 8;

/// Margin beside the cell, and above and below it, in pixels.
const MARGIN_PX: [f64; 2] = [5.0, 12.0];

/// Width of the pen and of its blur, in pixels.
const PEN_PX: f64 = 3.0;

/// A grid around a letter's cell.
#[derive(Clone, Debug)]
pub(super) struct LetterPage {
    pub(super) grid: Grid,
    /// Width and height of the cell, in pixels; it is in the middle of the page.
    cell_px: [f64; 2],
}

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

impl LetterPage {
    pub(super) fn new(cell: &Cell) -> Self {
        let pitch_m = cell.cap_height_m / f64::from(PX_PER_H);
        let cell_px = [cell.width_m / pitch_m, f64::from(PX_PER_H)];
        let side = |axis: usize| {
            #[expect(clippy::cast_possible_truncation, reason = "some dozen pixels")]
            let half = (0.5 * cell_px[axis] + MARGIN_PX[axis]).ceil() as usize;
            2 * (half + REACH_PX)
        };
        let (width, height) = (side(0), side(1));
        let grid = Grid {
            left_m: cell.left_m + 0.5 * cell.width_m - 0.5 * width as f64 * pitch_m,
            top_m: cell.baseline_m + 0.5 * cell.cap_height_m + 0.5 * height as f64 * pitch_m,
            pitch_m,
            width,
            height,
        };
        Self { grid, cell_px }
    }

    /// The cell on the page: left, top, right, bottom.
    pub(super) fn cell(&self) -> [f64; 4] {
        let [x, y] = [self.grid.width, self.grid.height].map(|side| 0.5 * side as f64);
        let [half_width, half_height] = self.cell_px.map(|side| 0.5 * side);
        [x - half_width, y - half_height, x + half_width, y + half_height]
    }

    /// The page without what is beside the cell, where other letters may shine brighter.
    pub(super) fn columns_of_cell(&self) -> Grid {
        let [left, _, right, _] = self.cell();
        let [from, to] = [(left - PEN_PX).floor(), (right + PEN_PX).ceil()];
        let left_m = self.grid.left_m + from * self.grid.pitch_m;
        Grid { left_m, width: whole(to - from), ..self.grid.clone() }
    }

    /// Whether a point is within the cell and its margin.
    pub(super) fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let [left, top, right, bottom] = self.cell();
        (left - MARGIN_PX[0]..=right + MARGIN_PX[0]).contains(&x)
            && (top - MARGIN_PX[1]..=bottom + MARGIN_PX[1]).contains(&y)
    }

    /// Whether a cell has a part on the page.
    pub(super) fn is_near(&self, cell: &Cell) -> bool {
        let Cell { left_m, baseline_m, width_m, cap_height_m } = *cell;
        let [left, bottom] = self.page_from_plane([left_m, baseline_m]);
        let [right, top] = self.page_from_plane([left_m + width_m, baseline_m + cap_height_m]);
        let [wide, high] = [self.grid.width, self.grid.height].map(|side| side as f64);
        right > 0.0 && left < wide && bottom > 0.0 && top < high
    }

    /// A point of the word's plane on the page.
    pub(super) fn page_from_plane(&self, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        [(x_m - self.grid.left_m) / self.grid.pitch_m, (self.grid.top_m - y_m) / self.grid.pitch_m]
    }

    /// A point of the page in the word's plane.
    pub(super) fn plane_from_page(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.grid.left_m + x * self.grid.pitch_m, self.grid.top_m - y * self.grid.pitch_m]
    }
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
        let shifted = |step: &&Move| {
            let ends = on_page(step.from_m, step.to_m);
            ends.map(|end| [0, 1].map(|axis| end[axis] + shift[axis] as f64))
        };
        let is_stroke = |step: &&Move| step.lit && step.from_m != step.to_m;
        let steps: Vec<&Move> = glyphs[index].moves.iter().filter(is_stroke).collect();
        let runs = steps.chunk_by(|a, b| a.to_m == b.from_m);
        let runs: Vec<Vec<Segment>> = runs.map(|run| run.iter().map(shifted).collect()).collect();
        let trace = LightLines::new(&ink);
        let bent = trace.bend(&runs);
        let around = &glyphs[index.saturating_sub(1)..(index + 2).min(glyphs.len())];
        let between = around.windows(2).filter_map(|pair| {
            Some(on_page(pair[0].moves.last()?.to_m, pair[1].moves.first()?.from_m))
        });
        let dark = around.iter().flat_map(|glyph| &glyph.moves).filter(|step| !step.lit);
        let ways = between.chain(dark.map(|step| on_page(step.from_m, step.to_m))).collect();
        // On two lines, letters above and below are as near as those on both sides.
        let near = glyphs.iter().enumerate().filter(|(at, _)| *at != index);
        let near = near.filter(|(_, other)| page.is_near(&other.cell));
        let lit = near.flat_map(|(_, other)| &other.moves).filter(|step| step.lit);
        let beside = lit.map(|step| on_page(step.from_m, step.to_m)).collect();
        Sketch { ink, trace, shift, own: bent.segments(), bent, beside, ways }
    }
}
