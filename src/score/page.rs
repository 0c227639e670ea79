//! A letter's page: its cell and a margin, on which strokes and light are compared.

use super::PX_PER_H;
use super::plane::Grid;
use super::raster::whole;
use noctograph_core::strokes::Cell;

/// Farthest shift of a letter that is searched, in pixels: a quarter of a cap height.
pub(super) const REACH_PX: usize = 8;

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
