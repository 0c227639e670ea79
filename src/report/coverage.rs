//! The map of a coverage as SVG: color for the error, gray where fewer than two stations see.

use std::fmt::Write;

use crate::sim::Coverage;

/// Longer side of the map, pixels.
const SIDE_PX: f64 = 720.0;
/// Margins for axes (left), title (above), axes (below) and legend (right), pixels.
const MARGINS_PX: [f64; 4] = [60.0, 44.0, 52.0, 190.0];
/// Least width of the whole: that of its title.
const TITLE_PX: f64 = 580.0;
/// Five stops of the viridis map (van der Walt, Smith 2015), small to large error.
const VIRIDIS: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];
const ONE_STATION: &str = "#b8b8b8";
const NO_STATION: &str = "#5a5a5a";

/// Draws a coverage, with a frame around the word if there is one.
#[must_use]
pub fn coverage_map(grid: &Coverage, word_m: Option<[f64; 4]>) -> String {
    Map::new(grid).draw(word_m)
}

struct Map<'a> {
    grid: &'a Coverage,
    px_per_m: f64,
    /// Errors of the first and the last color: the smallest, and the 95th percentile, so that a few
    /// distant places do not use up the colors.
    errors_m: [f64; 2],
    text: String,
}

impl<'a> Map<'a> {
    fn new(grid: &'a Coverage) -> Self {
        let [width_m, height_m] = [&grid.x_m, &grid.z_m].map(|places| span(places));
        let errors_m = grid.errors_m();
        let ends = errors_m.first().zip(errors_m.get(errors_m.len() * 95 / 100));
        Self {
            grid,
            px_per_m: SIDE_PX / width_m.max(height_m),
            errors_m: ends.map_or([0.0, 1.0], |(least, most)| [*least, *most]),
            text: String::new(),
        }
    }

    fn draw(mut self, word_m: Option<[f64; 4]>) -> String {
        let [left, above, below, beside] = MARGINS_PX;
        let [width, height] =
            [&self.grid.x_m, &self.grid.z_m].map(|places| span(places) * self.px_per_m);
        let whole_width = (left + width + beside).max(TITLE_PX);
        // The legend may be higher than the map.
        let whole_height = (above + height + below).max(above + 220.0);
        self.put(&format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{whole_width:.0}\" \
             height=\"{whole_height:.0}\" font-family=\"sans-serif\" font-size=\"13\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{left}\" y=\"26\" font-size=\"16\">Lighthouse coverage at y = {:.2} m: \
             {:.1} % seen by two or more</text>",
            self.grid.y_m,
            100.0 * self.grid.seen_frac(),
        ));
        self.cells();
        if let Some([l, b, r, t]) = word_m {
            let (x, y) = (self.x_px(l), self.y_px(t));
            let (w, h) = ((r - l) * self.px_per_m, (t - b) * self.px_per_m);
            self.put(&format!(
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" fill=\"none\" \
                 stroke=\"white\" stroke-width=\"2\" stroke-dasharray=\"6 4\"/>"
            ));
        }
        self.axes(width, height);
        self.legend(left + width + 24.0, above);
        self.put("</svg>");
        self.text
    }

    fn put(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn x_px(&self, x_m: f64) -> f64 {
        MARGINS_PX[0] + (x_m - self.grid.x_m[0]) * self.px_per_m
    }

    fn y_px(&self, z_m: f64) -> f64 {
        let top_m = self.grid.z_m.last().expect("a grid has rows");
        MARGINS_PX[1] + (top_m - z_m) * self.px_per_m
    }

    /// One rectangle per run of places of one color in a row, from midway to midway.
    fn cells(&mut self) {
        let grid = self.grid;
        self.put("<g shape-rendering=\"crispEdges\">");
        for (row, colors) in grid.places.chunks_exact(grid.x_m.len()).enumerate() {
            let colors: Vec<String> = colors.iter().map(|place| self.color(place)).collect();
            let [low, high] = edges_m(&grid.z_m, row, row);
            let (y, height) = (self.y_px(high), (high - low) * self.px_per_m);
            let mut from = 0;
            for run in colors.chunk_by(|a, b| a == b) {
                let [start, end] = edges_m(&grid.x_m, from, from + run.len() - 1);
                let (x, width) = (self.x_px(start), (end - start) * self.px_per_m);
                let _ = writeln!(
                    self.text,
                    "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
                     fill=\"{}\"/>",
                    run[0]
                );
                from += run.len();
            }
        }
        self.put("</g>");
    }

    fn color(&self, place: &crate::sim::Place) -> String {
        match (place.n_stations, place.error_m) {
            (0, _) => NO_STATION.to_owned(),
            (1, _) | (_, None) => ONE_STATION.to_owned(),
            (_, Some(error_m)) => {
                let [least, most] = self.errors_m;
                viridis((error_m - least) / (most - least).max(f64::MIN_POSITIVE))
            }
        }
    }

    fn axes(&mut self, width: f64, height: f64) {
        let grid = self.grid;
        let [left, above, ..] = MARGINS_PX;
        let bottom = above + height;
        self.put(&format!(
            "<rect x=\"{left}\" y=\"{above}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             fill=\"none\" stroke=\"black\"/>"
        ));
        for x_m in ticks(&grid.x_m) {
            let (x, end, label) = (self.x_px(x_m), bottom + 5.0, bottom + 19.0);
            self.put(&format!(
                "<path d=\"M{x:.1} {bottom:.1}V{end:.1}\" stroke=\"black\"/><text x=\"{x:.1}\" \
                 y=\"{label:.1}\" text-anchor=\"middle\">{x_m:.1}</text>"
            ));
        }
        for z_m in ticks(&grid.z_m) {
            let (y, end, label) = (self.y_px(z_m), left - 5.0, left - 9.0);
            self.put(&format!(
                "<path d=\"M{left} {y:.1}H{end}\" stroke=\"black\"/><text x=\"{label}\" \
                 y=\"{:.1}\" text-anchor=\"end\">{z_m:.1}</text>",
                y + 4.5
            ));
        }
        let (x, y) = (left + 0.5 * width, bottom + 40.0);
        self.put(&format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">x (m)</text><text x=\"16\" \
             y=\"{0:.1}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {0:.1})\">z (m)</text>",
            above + 0.5 * height
        ));
    }

    fn legend(&mut self, x: f64, above: f64) {
        let swatch = |y: f64, color: &str, text: &str| {
            format!(
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"18\" height=\"18\" fill=\"{color}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\">{text}</text>",
                x + 26.0,
                y + 14.0
            )
        };
        self.put(&format!("<text x=\"{x:.1}\" y=\"{:.1}\">error, 1 σ</text>", above + 12.0));
        let [least, most] = self.errors_m;
        for step in 0..=6 {
            let share = f64::from(step) / 6.0;
            let error_mm = 1e3 * (least + share * (most - least));
            let and_more = if step == 6 { " and more" } else { "" };
            let y = above + 22.0 + 18.0 * f64::from(step);
            self.put(&swatch(y, &viridis(share), &format!("{error_mm:.1} mm{and_more}")));
        }
        self.put(&swatch(above + 160.0, ONE_STATION, "one station"));
        self.put(&swatch(above + 184.0, NO_STATION, "no station"));
    }
}

/// From first to last.
fn span(places_m: &[f64]) -> f64 {
    places_m[places_m.len() - 1] - places_m[0]
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
pub(super) fn viridis(fraction: f64) -> String {
    let place = fraction.clamp(0.0, 1.0) * 4.0;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 3")]
    let i = (place as usize).min(3);
    #[expect(clippy::cast_precision_loss, reason = "0 to 3")]
    let part = place - i as f64;
    let [r, g, b] = [0, 1, 2].map(|c| VIRIDIS[i][c] + part * (VIRIDIS[i + 1][c] - VIRIDIS[i][c]));
    format!("#{:02x}{:02x}{:02x}", byte(r), byte(g), byte(b))
}

fn byte(value: f64) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let byte = value.round() as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{SensorOptions, coverage};

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
        let (_, cells) = map.split_once("crispEdges\">").unwrap();
        let (cells, _) = cells.split_once("</g>").unwrap();
        let filled: f64 = cells.lines().filter(|line| line.starts_with("<rect")).map(area).sum();
        assert!((filled / (720.0 * 360.0) - 1.0).abs() < 1e-3, "{filled} of {}", 720.0 * 360.0);
        assert!(cells.contains(NO_STATION), "above the stations nothing is seen");
        assert!(cells.contains("#440154") && cells.contains("#fde725"), "best and worst");
        assert!(map.contains("stroke-dasharray"), "the word's frame");
        assert_eq!(map, coverage_map(&grid, Some([-0.5, 0.5, 0.5, 1.0])), "same grid, same bytes");
    }

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(ticks(&[-1.0, 1.0]), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(ticks(&[0.05, 0.38]).len(), 3, "0.1, 0.2, 0.3");
    }
}
