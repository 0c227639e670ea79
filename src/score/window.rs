//! The window through which a letter is read: its cell and a margin, on a page with room for shifts.

use tiny_skia::Transform;

use super::PX_PER_H;
use super::grid::Grid;
use super::raster::Raster;
use crate::letters::Cell;

/// Farthest that a letter is looked for beside its place, in pixels: 0.25 H (study).
pub(super) const REACH_PX: usize = 8;

/// Window beside the cell: 0.15 H (study), rounded up.
const BESIDE_PX: f64 = 5.0;

/// Window above and below the cell: 0.35 H (study), rounded up.
const ABOVE_PX: usize = 12;

/// Where a cell, its window and the room for shifts lie on a page.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// The cell's width by its cap height.
    pub(super) aspect: f64,
    /// The page. Its width is a multiple of 16, so that it can be halved twice.
    pub(super) width: usize,
    pub(super) height: usize,
    /// The window's size; its upper left corner is `REACH_PX` from the page's edges.
    window: [usize; 2],
}

/// The window at one resolution.
pub(super) struct Level {
    /// The page's width.
    width: usize,
    /// The page's rows that the window takes.
    first_row: usize,
    n_rows: usize,
    /// These rows, 1 in the window and 0 beside it.
    pub(super) mask: Vec<f32>,
    /// Pixels of the window.
    pub(super) n_pixels: f32,
}

impl Layout {
    /// The layout for cells of one aspect, width by cap height.
    pub(super) fn new(aspect: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "some dozen pixels")]
        #[expect(clippy::cast_sign_loss, reason = "a width")]
        let half_width = (0.5 * aspect * f64::from(PX_PER_H) + BESIDE_PX).ceil() as usize;
        let window = [2 * half_width, PX_PER_H as usize + 2 * ABOVE_PX];
        let width = (window[0] + 2 * REACH_PX).next_multiple_of(16);
        Self { aspect, width, height: window[1] + 2 * REACH_PX, window }
    }

    /// The window at full, half and quarter resolution.
    pub(super) fn levels(&self) -> [Level; 3] {
        [1, 2, 4].map(|step| {
            let [width, first_row, n_rows] =
                [self.width, REACH_PX, self.window[1]].map(|side| side / step);
            let columns = first_row..first_row + self.window[0].div_ceil(step);
            let row = (0..width).map(|x| if columns.contains(&x) { 1.0 } else { 0.0 });
            let mask: Vec<f32> = row.cycle().take(width * n_rows).collect();
            let n_pixels = mask.iter().sum();
            Level { width, first_row, n_rows, mask, n_pixels }
        })
    }

    /// Brings a unit box (y up) onto the cell, stretched about the cell's middle.
    pub(super) fn page_from_box(&self, [sx, sy]: [f64; 2]) -> Transform {
        let px_per_h = f64::from(PX_PER_H);
        let (width, height) = (sx * self.aspect * px_per_h, sy * px_per_h);
        let [x, y] = self.middle_px();
        #[expect(clippy::cast_possible_truncation, reason = "a raster needs no more")]
        Transform::from_row(
            width as f32,
            0.0,
            0.0,
            -height as f32,
            (x - 0.5 * width) as f32,
            (y + 0.5 * height) as f32,
        )
    }

    /// The page as a grid in the plane of the word, for one of its cells.
    pub(super) fn grid(&self, cell: &Cell) -> Grid {
        let pitch_m = cell.cap_height_m / f64::from(PX_PER_H);
        let [x, y] = self.middle_px();
        Grid {
            left_m: cell.left_m + 0.5 * cell.width_m - x * pitch_m,
            top_m: cell.baseline_m + 0.5 * cell.cap_height_m + y * pitch_m,
            pitch_m,
            width: self.width,
            height: self.height,
        }
    }

    /// The brightest pixel of a page within the cell itself.
    pub(super) fn brightest_in_cell(&self, page: &Raster) -> f32 {
        let above = REACH_PX + ABOVE_PX;
        let rows = page.values.chunks_exact(self.width).skip(above).take(PX_PER_H as usize);
        #[expect(clippy::cast_possible_truncation, reason = "some dozen pixels")]
        #[expect(clippy::cast_sign_loss, reason = "a width")]
        let beside = REACH_PX + BESIDE_PX as usize;
        rows.flat_map(|row| &row[beside..REACH_PX * 2 + self.window[0] - beside])
            .copied()
            .fold(0.0, f32::max)
    }

    /// The cell on the page: left, top, right, bottom.
    pub(super) fn cell_px(&self) -> [f64; 4] {
        let [x, y] = self.middle_px();
        let half = [0.5 * self.aspect * f64::from(PX_PER_H), 0.5 * f64::from(PX_PER_H)];
        [x - half[0], y - half[1], x + half[0], y + half[1]]
    }

    /// Whether the window holds a point of the page.
    pub(super) fn holds(&self, point: [f64; 2]) -> bool {
        (0..2).all(|axis| {
            let from = REACH_PX as f64;
            (from..=from + self.window[axis] as f64).contains(&point[axis])
        })
    }

    /// The middle of the cell.
    pub(super) fn middle_px(&self) -> [f64; 2] {
        self.window.map(|side| REACH_PX as f64 + 0.5 * side as f64)
    }
}

impl Level {
    /// A page in the window, 0 beside it.
    pub(super) fn masked(&self, page: &Raster) -> Vec<f32> {
        self.rows(page, [0, 0]).iter().zip(&self.mask).map(|(value, mask)| value * mask).collect()
    }

    /// What the window's rows hold once a page's picture was moved by `right` and `down` pixels.
    /// Beside the window the rows hold what lies there, so the other factor must be 0 there.
    pub(super) fn rows<'a>(&self, page: &'a Raster, [right, down]: [isize; 2]) -> &'a [f32] {
        let start = (self.first_row * self.width)
            .checked_add_signed(-(down * self.width.cast_signed() + right))
            .expect("shifts are shorter than the margin");
        &page.values[start..start + self.n_rows * self.width]
    }
}
