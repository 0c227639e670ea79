//! Starts of strokes on a grid, so that the next one is found without asking all others.

use nalgebra::Vector2;

use super::Way;

/// Starts of strokes that are still to be drawn, by the cells of a grid.
pub(super) struct Starts {
    origin_m: Vector2<f64>,
    cell_m: f64,
    n_cells: [usize; 2],
    /// Stroke and way of each start.
    cells: Vec<Vec<(usize, usize)>>,
}

impl Starts {
    /// All starts of some strokes, about one a cell.
    pub(super) fn new(ways: &[Vec<Way>]) -> Self {
        let starts = || ways.iter().flatten().map(|way| way.start_m);
        let first = starts().next().unwrap_or_default();
        let (low, high) =
            starts().fold((first, first), |(low, high), start| (low.inf(&start), high.sup(&start)));
        let size_m = high - low;
        let n = ways.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        // A row of strokes has no height: its cells are as long as they would be in a square.
        let cell_m = (size_m.x.max(size_m.y) / n.sqrt()).max(f64::MIN_POSITIVE);
        #[expect(clippy::cast_possible_truncation, reason = "at most the root of the starts")]
        let n_cells = [size_m.x, size_m.y].map(|side_m| (side_m / cell_m) as usize + 1);
        let mut grid = Self { origin_m: low, cell_m, n_cells, cells: Vec::new() };
        grid.cells.resize(n_cells[0] * n_cells[1], Vec::new());
        for (stroke, ways) in ways.iter().enumerate() {
            for (way, Way { start_m, .. }) in ways.iter().enumerate() {
                let [column, row] = grid.cell_of(*start_m);
                grid.cells[row * n_cells[0] + column].push((stroke, way));
            }
        }
        grid
    }

    /// The cell that holds a place, or the nearest one.
    fn cell_of(&self, place_m: Vector2<f64>) -> [usize; 2] {
        [0, 1].map(|axis| {
            #[expect(clippy::cast_possible_truncation, reason = "cut to the cells")]
            let cell = ((place_m[axis] - self.origin_m[axis]) / self.cell_m) as usize;
            cell.min(self.n_cells[axis] - 1)
        })
    }

    /// Takes a stroke that was drawn off the grid.
    pub(super) fn remove(&mut self, stroke: usize, ways: &[Way]) {
        for way in ways {
            let [column, row] = self.cell_of(way.start_m);
            self.cells[row * self.n_cells[0] + column].retain(|(other, _)| *other != stroke);
        }
    }

    /// Shows `look` all starts, ring by ring of cells around a place, until no farther one can be
    /// nearer than the distance that it returned last.
    pub(super) fn around(
        &self,
        place_m: Vector2<f64>,
        mut look: impl FnMut(&[(usize, usize)]) -> f64,
    ) {
        let [column, row] = self.cell_of(place_m);
        let [n_columns, n_rows] = self.n_cells;
        let mut nearest_m = f64::INFINITY;
        for ring in 0..n_columns.max(n_rows) {
            // A place on the grid is at least this far from every cell of the ring; the place of a
            // stroke's end may lie off the grid, and is then farther still.
            if ring.saturating_sub(1) as f64 * self.cell_m > nearest_m {
                return;
            }
            for y in row.saturating_sub(ring)..=(row + ring).min(n_rows - 1) {
                let is_edge = y.abs_diff(row) == ring;
                let step = if is_edge || ring == 0 { 1 } else { 2 * ring };
                let left =
                    column.checked_sub(ring).unwrap_or(if step == 1 { 0 } else { column + ring });
                for x in (left..=(column + ring).min(n_columns - 1)).step_by(step) {
                    let cell = &self.cells[y * n_columns + x];
                    if !cell.is_empty() {
                        nearest_m = look(cell);
                    }
                }
            }
        }
    }
}
