//! QR codes: their three finder patterns, a square within a square ring.

use super::ink::{Field, RIM};
use noctograph_core::geometry::distance;
use noctograph_core::statistics::median;

/// Runs of ink and paper through the middle of a finder pattern, in modules, and how far one may be
/// off, in modules.
const RUNS: [f64; 5] = [1.0, 1.0, 3.0, 1.0, 1.0];
const OFF: f64 = 0.5;

/// Least pixels of a module that are seen.
const MODULE_PX: f64 = 2.0;

/// Rows of pixels that cross a pattern as it should be, by the height of its inner square.
const ROWS: f64 = 0.6;

/// Pixels of a module of the code that a picture shows by three finder patterns.
pub(super) fn module_px(field: &Field) -> Option<f64> {
    // Patterns: middle, modules' size and rows.
    let mut patterns: Vec<([f64; 2], f64, f64)> = Vec::new();
    for (y, row) in field.ink.chunks(field.width).enumerate() {
        let mut edges: Vec<usize> =
            (1..row.len()).filter(|x| (row[*x] > RIM) != (row[*x - 1] > RIM)).collect();
        edges.push(row.len());
        for six in edges.windows(6) {
            if row[six[0]] <= RIM || six[5] == row.len() {
                continue;
            }
            let module = (six[5] - six[0]) as f64 / RUNS.iter().sum::<f64>();
            let fits = |(ends, run): (&[usize], &f64)| {
                ((ends[1] - ends[0]) as f64 / module - run).abs() < OFF
            };
            if module < MODULE_PX || !six.windows(2).zip(&RUNS).all(fits) {
                continue;
            }
            let middle = [0.5 * (six[0] + six[5]) as f64, y as f64];
            let near = |it: &&mut ([f64; 2], f64, f64)| distance(it.0, middle) < 4.0 * module;
            match patterns.iter_mut().find(near) {
                Some(pattern) => pattern.2 += 1.0,
                None => patterns.push((middle, module, 1.0)),
            }
        }
    }
    patterns.retain(|(_, module, rows)| *rows > ROWS * 3.0 * module);
    median(patterns.iter().map(|(_, module, _)| *module)).filter(|_| patterns.len() >= 3)
}
