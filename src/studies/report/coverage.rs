//! Draws a coverage map as SVG, with colors for the error and grays for fewer than two stations.

use kurbo::{Point, Rect, Vec2};

use super::canvas::{Anchor, Canvas, Pen, Rgb, Surface, Window};
use super::figure::{BLACK, number, ticks};
use noctograph_sim::sensors::{Coverage, CoveredPoint};

/// Length of the map's longer side.
const SIDE_PX: f64 = 720.0;
/// Axis length assumed for choosing ticks, which gives at most nine numbers.
const AXIS_PX: f64 = 540.0;
/// Margins: axis at the left, title above, axis below, and legend at the right.
const MARGINS_PX: [f64; 4] = [60.0, 56.0, 52.0, 190.0];
/// Minimum width of the drawing, which the title requires.
const TITLE_PX: f64 = 580.0;
/// Cap height of labels, and that of the title.
const CAP_PX: f64 = 9.0;
const TITLE_CAP_PX: f64 = 11.0;
/// Distance of the title's baseline from the upper edge.
const TITLE_DOWN_PX: f64 = 26.0;
/// Height of the legend with its margin below, and its distance from the map.
const LEGEND_PX: f64 = 220.0;
const LEGEND_GAP_PX: f64 = 24.0;
/// Length of a tick.
const TICK_PX: f64 = 5.0;
/// Side of a color's square in the legend.
const SWATCH_PX: f64 = 18.0;
/// Five colors of the viridis map (van der Walt, Smith 2015), from small to large errors.
const VIRIDIS: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];
const ONE_STATION: Rgb = [184; 3];
const NO_STATION: Rgb = [90; 3];

/// Returns an SVG of a coverage map, with a frame around the word. `word_m` contains the word's
/// bounds (left, bottom, right, top).
pub fn coverage_map(grid: &Coverage, word_m: Option<[f64; 4]>) -> String {
    let map = Map::new(grid);
    let frame = map.window.rect_px(map.extent_m);
    let [left, above, below, beside] = MARGINS_PX;
    // The legend may be taller than the map.
    let size_px = [(frame.x1 + beside).max(TITLE_PX), (frame.y1 + below).max(above + LEGEND_PX)];
    let mut canvas = Canvas::white(size_px);
    let title = format!(
        "Lighthouse coverage at y = {:.2} m: {:.1} % seen by two or more stations",
        grid.y_m,
        100.0 * grid.seen_frac()
    );
    canvas.text(title, Point::new(left, TITLE_DOWN_PX), Anchor::Start, TITLE_CAP_PX, BLACK);
    map.draw_cells(&mut canvas);
    if let Some([left, bottom, right, top]) = word_m {
        let pen = Pen { dashed: true, ..Pen::new([255; 3], 2.0) };
        canvas.frame(map.window.rect_px(Rect::new(left, bottom, right, top)), pen);
    }
    map.draw_axes(&mut canvas, frame);
    map.draw_legend(&mut canvas, Point::new(frame.x1 + LEGEND_GAP_PX, above));
    canvas.svg()
}

/// A coverage map with its window and its color scale.
struct Map<'a> {
    grid: &'a Coverage,
    /// Extent of the grid in x and z.
    extent_m: Rect,
    window: Window,
    /// Errors at the first and the last color: the smallest error and the 95th percentile, so that
    /// a few distant points do not use up the color range.
    errors_m: [f64; 2],
}

impl<'a> Map<'a> {
    /// Creates the map below the title and to the right of the axis. Without errors, the colors
    /// range from 0 to 1 m.
    fn new(grid: &'a Coverage) -> Self {
        let sorted_m = grid.errors_m();
        let color_ends_m = sorted_m.first().zip(sorted_m.get(sorted_m.len() * 95 / 100));
        let [right_m, top_m] = [&grid.x_m, &grid.z_m].map(|places_m| places_m[places_m.len() - 1]);
        let extent_m = Rect::new(grid.x_m[0], grid.z_m[0], right_m, top_m);
        let window = Window {
            corner_px: Point::new(MARGINS_PX[0], MARGINS_PX[1]),
            corner_m: Point::new(extent_m.x0, extent_m.y1),
            px_per_m: SIDE_PX / extent_m.width().max(extent_m.height()),
        };
        let errors_m = color_ends_m.map_or([0.0, 1.0], |(least, most)| [*least, *most]);
        Self { grid, extent_m, window, errors_m }
    }

    /// Draws a rectangle for each run of equal colors in a row. The edges of each rectangle lie
    /// midway between neighboring points.
    fn draw_cells(&self, canvas: &mut Canvas) {
        let grid = self.grid;
        for (row, colors) in grid.places.chunks_exact(grid.x_m.len()).enumerate() {
            // Neighbors of equal color are merged into one rectangle, which keeps the file small.
            let colors: Vec<Rgb> = colors.iter().map(|place| self.color(place)).collect();
            let [low_m, high_m] = edges_m(&grid.z_m, row, row);
            let mut first = 0;
            for run in colors.chunk_by(|a, b| a == b) {
                let [start_m, end_m] = edges_m(&grid.x_m, first, first + run.len() - 1);
                let cell_m = Rect::new(start_m, low_m, end_m, high_m);
                canvas.cell(self.window.rect_px(cell_m), run[0]);
                first += run.len();
            }
        }
    }

    /// Returns the color of a point: gray for fewer than two stations, otherwise that of its error.
    fn color(&self, place: &CoveredPoint) -> Rgb {
        match (place.n_stations, place.error_m) {
            (0, _) => NO_STATION,
            (1, _) | (_, None) => ONE_STATION,
            (_, Some(error_m)) => {
                let [least, most] = self.errors_m;
                viridis((error_m - least) / (most - least).max(f64::MIN_POSITIVE))
            }
        }
    }

    /// Draws the frame, both axes with ticks and numbers, and their names.
    fn draw_axes(&self, canvas: &mut Canvas, frame: Rect) {
        let (pen, Rect { x0: left, y0: above, y1: bottom, .. }) = (Pen::new(BLACK, 1.0), frame);
        canvas.frame(frame, pen);
        // Ticks are drawn outside the frame so that they do not cover any cell.
        let Rect { x0, y0, x1, y1 } = self.extent_m;
        for x_m in ticks(&(x0..x1), AXIS_PX) {
            let end = Point::new(self.window.px(Point::new(x_m, 0.0)).x, bottom);
            canvas.line([end, end + Vec2::new(0.0, TICK_PX)], pen);
            let label = end + Vec2::new(0.0, 19.0);
            canvas.text(number(x_m), label, Anchor::Middle, CAP_PX, BLACK);
        }
        for z_m in ticks(&(y0..y1), AXIS_PX) {
            let end = Point::new(left, self.window.px(Point::new(0.0, z_m)).y);
            canvas.line([end, end - Vec2::new(TICK_PX, 0.0)], pen);
            canvas.text(number(z_m), end + Vec2::new(-9.0, 4.5), Anchor::End, CAP_PX, BLACK);
        }
        let [below, beside] =
            [(frame.center().x, bottom + 40.0), (left - 9.0, above - 12.0)].map(Point::from);
        canvas.text("x (m)", below, Anchor::Middle, CAP_PX, BLACK);
        canvas.text("z (m)", beside, Anchor::End, CAP_PX, BLACK);
    }

    /// Draws the legend with its upper left corner at `corner`.
    fn draw_legend(&self, canvas: &mut Canvas, corner: Point) {
        let title = corner + Vec2::new(0.0, 12.0);
        canvas.text("error, 1 σ", title, Anchor::Start, CAP_PX, BLACK);
        // Seven steps of the color map are followed by the two grays.
        let [least, most] = self.errors_m;
        let errors = (0..=6).map(|step| {
            let fraction = f64::from(step) / 6.0;
            let error_mm = 1e3 * (least + fraction * (most - least));
            let and_more = if step == 6 { " and more" } else { "" };
            let down_px = 22.0 + SWATCH_PX * f64::from(step);
            (down_px, viridis(fraction), format!("{error_mm:.1} mm{and_more}"))
        });
        let stations = [(160.0, ONE_STATION, "one station"), (184.0, NO_STATION, "no station")];
        let stations = stations.map(|(down_px, color, text)| (down_px, color, text.to_owned()));
        for (down_px, color, text) in errors.chain(stations) {
            let swatch = corner + Vec2::new(0.0, down_px);
            canvas.cell(Rect::from_origin_size(swatch, (SWATCH_PX, SWATCH_PX)), color);
            let label = swatch + Vec2::new(26.0, 14.0);
            canvas.text(text, label, Anchor::Start, CAP_PX, BLACK);
        }
    }
}

/// Returns the outer edges of the cells from `first` to `last`, midway between neighbors.
fn edges_m(places_m: &[f64], first: usize, last: usize) -> [f64; 2] {
    [(first.saturating_sub(1), first), (last, (last + 1).min(places_m.len() - 1))]
        .map(|(i, j)| 0.5 * (places_m[i] + places_m[j]))
}

/// Returns the sRGB color of the viridis map at a fraction, from dark (0) to light (1). A fraction
/// out of range is limited to it.
pub(super) fn viridis(fraction: f64) -> Rgb {
    // Colors between two of the five are interpolated linearly.
    let position = fraction.clamp(0.0, 1.0) * 4.0;
    #[expect(clippy::cast_possible_truncation, reason = "0 to 3")]
    let i = (position as usize).min(3);
    let part = position - i as f64;
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
        fn value(line: &str, key: &str) -> f64 {
            let (_, rest) = line.split_once(&format!(" {key}=\"")).unwrap();
            rest.split_once('"').unwrap().0.parse().unwrap()
        }
        // The legend's cells, which are 18 pixels wide, are excluded.
        let cells = map.lines().filter(|line| line.contains("crispEdges"));
        let cells: Vec<&str> = cells.filter(|line| !line.contains("width=\"18.0\"")).collect();
        let filled: f64 = cells.iter().map(|c| value(c, "width") * value(c, "height")).sum();
        assert!((filled / (720.0 * 360.0) - 1.0).abs() < 1e-3, "{filled} of {}", 720.0 * 360.0);
        // The colors stand for points without stations, and for the smallest and the largest error.
        for color in ["#5a5a5a", "#440154", "#fde725"] {
            assert!(cells.iter().any(|cell| cell.contains(color)), "{color}");
        }
        assert!(map.contains("stroke-dasharray"), "the word's frame");
        assert_eq!(map, coverage_map(&grid, Some([-0.5, 0.5, 0.5, 1.0])), "same grid, same bytes");
    }
}
