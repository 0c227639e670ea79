//! The map of a coverage as SVG: color for the error, gray where fewer than two stations see.

use super::canvas::{Anchor, Canvas, Pen, Rgb, Surface, Window};
use super::figure::BLACK;
use noctograph_sim::sensors::{Coverage, CoveredPlace};

/// Longer side of the map, pixels.
const SIDE_PX: f64 = 720.0;
/// Margins for axes (left), title (above), axes (below) and legend (right), pixels.
const MARGINS_PX: [f64; 4] = [60.0, 56.0, 52.0, 190.0];
/// Least width of the whole: that of its title.
const TITLE_PX: f64 = 580.0;
/// Height of capitals.
const CAP_PX: f64 = 9.0;
/// Five stops of the viridis map (van der Walt, Smith 2015), small to large error.
const VIRIDIS: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];
const ONE_STATION: Rgb = [184; 3];
const NO_STATION: Rgb = [90; 3];

/// Draws a coverage, with a frame around the word if there is one.
pub fn coverage_map(grid: &Coverage, word_m: Option<[f64; 4]>) -> String {
    let map = Map::new(grid);
    let [left, above, below, beside] = MARGINS_PX;
    let [right, bottom] = map.window.px([grid.x_m[grid.x_m.len() - 1], grid.z_m[0]]);
    // The legend may be higher than the map.
    let size_px = [(right + beside).max(TITLE_PX), (bottom + below).max(above + 220.0)];
    let mut canvas = Canvas::white(size_px);
    let title = format!(
        "Lighthouse coverage at y = {:.2} m: {:.1} % seen by two or more",
        grid.y_m,
        100.0 * grid.seen_frac()
    );
    canvas.text(title, [left, 26.0], Anchor::Start, 11.0, BLACK);
    map.draw_cells(&mut canvas);
    if let Some(word_m) = word_m {
        let pen = Pen { dashed: true, ..Pen::new([255; 3], 2.0) };
        canvas.frame(map.sides_px(word_m), pen);
    }
    map.draw_axes(&mut canvas, [left, above, right, bottom]);
    map.draw_legend(&mut canvas, right + 24.0, above);
    canvas.svg()
}

struct Map<'a> {
    grid: &'a Coverage,
    window: Window,
    /// Errors of the first and the last color: the smallest, and the 95th percentile, so that a few
    /// distant places do not use up the colors.
    errors_m: [f64; 2],
}

impl<'a> Map<'a> {
    fn new(grid: &'a Coverage) -> Self {
        let span = |places_m: &[f64]| places_m[places_m.len() - 1] - places_m[0];
        let errors_m = grid.errors_m();
        let ends = errors_m.first().zip(errors_m.get(errors_m.len() * 95 / 100));
        let window = Window {
            corner_px: [MARGINS_PX[0], MARGINS_PX[1]],
            corner_m: [grid.x_m[0], grid.z_m[grid.z_m.len() - 1]],
            px_per_m: SIDE_PX / span(&grid.x_m).max(span(&grid.z_m)),
        };
        Self { grid, window, errors_m: ends.map_or([0.0, 1.0], |(least, most)| [*least, *most]) }
    }

    /// The pixels of a rectangle in meters: left, bottom, right, top.
    fn sides_px(&self, [left, bottom, right, top]: [f64; 4]) -> [f64; 4] {
        let corners = [[left, top], [right, bottom]].map(|corner| self.window.px(corner));
        [corners[0][0], corners[0][1], corners[1][0], corners[1][1]]
    }

    /// One rectangle per run of places of one color in a row, from midway to midway.
    fn draw_cells(&self, canvas: &mut Canvas) {
        let grid = self.grid;
        for (row, colors) in grid.places.chunks_exact(grid.x_m.len()).enumerate() {
            let colors: Vec<Rgb> = colors.iter().map(|place| self.color(place)).collect();
            let [low_m, high_m] = edges_m(&grid.z_m, row, row);
            let mut from = 0;
            for run in colors.chunk_by(|a, b| a == b) {
                let [start_m, end_m] = edges_m(&grid.x_m, from, from + run.len() - 1);
                canvas.cell(self.sides_px([start_m, low_m, end_m, high_m]), run[0]);
                from += run.len();
            }
        }
    }

    fn color(&self, place: &CoveredPlace) -> Rgb {
        match (place.n_stations, place.error_m) {
            (0, _) => NO_STATION,
            (1, _) | (_, None) => ONE_STATION,
            (_, Some(error_m)) => {
                let [least, most] = self.errors_m;
                viridis((error_m - least) / (most - least).max(f64::MIN_POSITIVE))
            }
        }
    }

    fn draw_axes(&self, canvas: &mut Canvas, [left, above, right, bottom]: [f64; 4]) {
        let pen = Pen::new(BLACK, 1.0);
        canvas.frame([left, above, right, bottom], pen);
        for x_m in ticks(&self.grid.x_m) {
            let [x, _] = self.window.px([x_m, 0.0]);
            canvas.line([[x, bottom], [x, bottom + 5.0]], pen);
            canvas.text(format!("{x_m:.1}"), [x, bottom + 19.0], Anchor::Middle, CAP_PX, BLACK);
        }
        for z_m in ticks(&self.grid.z_m) {
            let [_, y] = self.window.px([0.0, z_m]);
            canvas.line([[left, y], [left - 5.0, y]], pen);
            canvas.text(format!("{z_m:.1}"), [left - 9.0, y + 4.5], Anchor::End, CAP_PX, BLACK);
        }
        let middle = 0.5 * (left + right);
        canvas.text("x (m)", [middle, bottom + 40.0], Anchor::Middle, CAP_PX, BLACK);
        canvas.text("z (m)", [left - 9.0, above - 12.0], Anchor::End, CAP_PX, BLACK);
    }

    fn draw_legend(&self, canvas: &mut Canvas, x: f64, above: f64) {
        canvas.text("error, 1 σ", [x, above + 12.0], Anchor::Start, CAP_PX, BLACK);
        let mut swatch = |y: f64, color: Rgb, text: String| {
            canvas.cell([x, y, x + 18.0, y + 18.0], color);
            canvas.text(text, [x + 26.0, y + 14.0], Anchor::Start, CAP_PX, BLACK);
        };
        let [least, most] = self.errors_m;
        for step in 0..=6 {
            let share = f64::from(step) / 6.0;
            let error_mm = 1e3 * (least + share * (most - least));
            let and_more = if step == 6 { " and more" } else { "" };
            let y = above + 22.0 + 18.0 * f64::from(step);
            swatch(y, viridis(share), format!("{error_mm:.1} mm{and_more}"));
        }
        swatch(above + 160.0, ONE_STATION, "one station".into());
        swatch(above + 184.0, NO_STATION, "no station".into());
    }
}

/// Where the cells from `first` to `last` begin and end: midway to their neighbors.
fn edges_m(places_m: &[f64], first: usize, last: usize) -> [f64; 2] {
    let midway = |i: usize, j: usize| 0.5 * (places_m[i] + places_m[j.min(places_m.len() - 1)]);
    [midway(first.saturating_sub(1), first), midway(last, last + 1)]
}

/// Round numbers from end to end, four to nine of them.
fn ticks(places_m: &[f64]) -> Vec<f64> {
    let (from, to) = (places_m[0], places_m[places_m.len() - 1]);
    let steps = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 50.0, 200.0, 1000.0];
    let step = steps.into_iter().find(|step| (to - from) / step <= 9.0).unwrap_or(1e4);
    #[expect(clippy::cast_possible_truncation, reason = "at most ten of them")]
    let (first, last) = ((from / step - 1e-9).ceil() as i32, (to / step + 1e-9).floor() as i32);
    (first..=last).map(|i| f64::from(i) * step).collect()
}

/// A color from dark (0) to light (1).
pub(super) fn viridis(fraction: f64) -> Rgb {
    let place = fraction.clamp(0.0, 1.0) * 4.0;
    #[expect(clippy::cast_possible_truncation, reason = "0 to 3")]
    let i = (place as usize).min(3);
    let part = place - i as f64;
    #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
    [0, 1, 2].map(|c| (VIRIDIS[i][c] + part * (VIRIDIS[i + 1][c] - VIRIDIS[i][c])).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_sim::sensors::SensorOptions;
    use noctograph_sim::sensors::coverage;

    #[test]
    fn the_cells_fill_the_frame_and_take_their_colors() {
        let grid = coverage(&SensorOptions::default(), [-3.0, 0.0, 3.0, 3.0], 0.0, 0.5).unwrap();
        let map = coverage_map(&grid, Some([-0.5, 0.5, 0.5, 1.0]));
        let area = |line: &str| -> f64 {
            let value = |key: &str| -> f64 {
                let (_, rest) = line.split_once(&format!(" {key}=\"")).unwrap();
                rest.split_once('"').unwrap().0.parse().unwrap()
            };
            value("width") * value("height")
        };
        // Those of the legend are 18 pixels wide.
        let cells = map.lines().filter(|line| line.contains("crispEdges"));
        let cells: Vec<&str> = cells.filter(|line| !line.contains("width=\"18.0\"")).collect();
        let filled: f64 = cells.iter().map(|line| area(line)).sum();
        assert!((filled / (720.0 * 360.0) - 1.0).abs() < 1e-3, "{filled} of {}", 720.0 * 360.0);
        let has = |color: &str| cells.iter().any(|cell| cell.contains(color));
        assert!(has("#5a5a5a"), "above the stations nothing is seen");
        assert!(has("#440154") && has("#fde725"), "best and worst");
        assert!(map.contains("stroke-dasharray"), "the word's frame");
        assert_eq!(map, coverage_map(&grid, Some([-0.5, 0.5, 0.5, 1.0])), "same grid, same bytes");
    }

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(ticks(&[-1.0, 1.0]), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(ticks(&[0.05, 0.38]).len(), 3, "0.1, 0.2, 0.3");
    }
}
