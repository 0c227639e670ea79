//! Draws figures as SVG: stacked panels below a title and a legend.

use std::ops::Range;

use kurbo::{Point, Rect, Vec2};

use super::canvas::{Anchor, CAP_RATIO, Canvas, Pen, Rgb, Surface};

/// Width of a figure.
pub(super) const WIDTH_PX: f64 = 800.0;
/// Left and right margins of a panel, which contain the labels of its axis.
const SIDES_PX: [f64; 2] = [72.0, 24.0];
/// Width of the outer part of the margin, which is left empty.
const EDGE_PX: f64 = 12.0;
/// Width of a panel.
pub(super) const PANEL_WIDTH_PX: f64 = WIDTH_PX - SIDES_PX[0] - SIDES_PX[1];
/// Height of the space above the first panel, enough for two legend rows.
const HEAD_PX: f64 = 72.0;
/// Height of a legend row, and width of its line samples.
const LEGEND_ROW_PX: f64 = 18.0;
const LEGEND_LINE_PX: f64 = 28.0;
/// Height of the space below each panel, and of that below the last one for the axis name.
const BELOW_PX: [f64; 2] = [28.0, 18.0];
/// Font sizes of numbers, names, titles and marks, and the height reserved for a mark.
const NUMBER_EM_PX: f64 = 11.3;
const NAME_EM_PX: f64 = 12.1;
const TITLE_EM_PX: f64 = 16.1;
const MARK_EM_PX: f64 = 9.7;
const MARK_PX: f64 = 12.0;
/// Heights of the middle and the top of a text above its lower edge, relative to the font size.
const MIDDLE_RATIO: f64 = 0.26;
const ASCENT_RATIO: f64 = 0.76;
/// Length of a tick, and distance between an axis and its numbers.
const TICK_PX: f64 = 4.0;
const LABEL_PX: f64 = 8.0;
/// Axis length needed for each number, and the minimum number of ticks.
const ROOM_PX: f64 = 60.0;
const LEAST_NUMBERS: f64 = 4.0;
/// Minimum distance between two consecutive points of a curve.
const THINNEST_PX: f64 = 0.4;
/// Step along the curves in the test for overlaps with marks.
const STEP_PX: f64 = 3.0;

pub(super) const BLACK: Rgb = [0, 0, 0];
pub(super) const BLUE: Rgb = [0, 114, 178];
pub(super) const VERMILION: Rgb = [213, 94, 0];
pub(super) const GRAY: Rgb = [186, 186, 186];
const INK: Rgb = [64, 64, 64];
const GRID: Rgb = [232, 232, 232];

/// A line through points, possibly in several pieces.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) pen: Pen,
    pub(super) pieces: Vec<Vec<(f64, f64)>>,
}

impl Curve {
    /// Creates a curve with one piece.
    pub(super) fn whole(pen: Pen, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { pen, pieces: vec![points.into_iter().collect()] }
    }

    /// Returns the points `(x, y)` of all pieces, in the units of the axes.
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, f64)> + Clone {
        self.pieces.iter().flatten().copied()
    }
}

/// A pair of axes with curves.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) x: Range<f64>,
    pub(super) y: Range<f64>,
    /// True if the horizontal axis shows only whole numbers.
    pub(super) counts: bool,
    pub(super) height_px: f64,
    pub(super) y_name: &'static str,
    pub(super) curves: Vec<Curve>,
    pub(super) marks: Vec<Mark>,
}

impl Panel {
    /// Creates a panel without marks. `x` and `y` are the ranges of its axes, in the units of its
    /// curves.
    pub(super) fn new(
        [x, y]: [Range<f64>; 2],
        height_px: f64,
        y_name: &'static str,
        curves: Vec<Curve>,
    ) -> Self {
        Self { x, y, counts: false, height_px, y_name, curves, marks: Vec::new() }
    }
}

/// A text next to a data point.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) place: (f64, f64),
    pub(super) text: String,
}

/// Panels below a title and a legend.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) title: String,
    pub(super) legend: Vec<(String, Pen)>,
    /// Name of the horizontal axis of all panels.
    pub(super) x_name: &'static str,
    pub(super) panels: Vec<Panel>,
}

impl Figure {
    /// Returns the figure as an SVG document with a width of [`WIDTH_PX`].
    pub(super) fn svg(&self) -> String {
        let (entries, n_rows) = self.legend_entries();
        let mut top_px = HEAD_PX + LEGEND_ROW_PX * f64::from(n_rows.saturating_sub(2));
        let panels_px: f64 = self.panels.iter().map(|panel| panel.height_px + BELOW_PX[0]).sum();
        let mut canvas = Canvas::white([WIDTH_PX, top_px + panels_px + BELOW_PX[1] + EDGE_PX]);
        self.draw_title(&mut canvas);
        // A single row is centered in the space for two rows.
        let first_px = if n_rows > 1 { 44.0 } else { 50.0 };
        for ((name, pen), (left_px, row)) in self.legend.iter().zip(entries) {
            let left = Point::new(left_px, first_px + f64::from(row) * LEGEND_ROW_PX);
            let right = left + Vec2::new(LEGEND_LINE_PX, 0.0);
            canvas.line([left, right], *pen);
            let name_px = right + Vec2::new(8.0, MIDDLE_RATIO * NAME_EM_PX);
            text(&mut canvas, name, name_px, Anchor::Start, NAME_EM_PX);
        }
        for panel in &self.panels {
            panel.draw(&mut canvas, Vec2::new(SIDES_PX[0], top_px));
            top_px += panel.height_px + BELOW_PX[0];
        }
        let bottom_px = top_px + BELOW_PX[1] - MIDDLE_RATIO * NAME_EM_PX;
        let middle = Point::new(SIDES_PX[0] + 0.5 * PANEL_WIDTH_PX, bottom_px);
        text(&mut canvas, self.x_name, middle, Anchor::Middle, NAME_EM_PX);
        canvas.svg()
    }

    /// Draws the title, with a smaller font if the title is long.
    fn draw_title(&self, canvas: &mut Canvas) {
        let title = self.title.replace('\n', " / ");
        // At this font size the title is as wide as the panel, assuming characters 0.6 em wide.
        let narrow_px = 1.6 * PANEL_WIDTH_PX / title.chars().count().max(1) as f64;
        let em_px = narrow_px.clamp(1.6, TITLE_EM_PX);
        let left = Point::new(SIDES_PX[0], 24.0 + MIDDLE_RATIO * em_px);
        text(canvas, &title, left, Anchor::Start, em_px);
    }

    /// Returns the left end in pixels and the row of each legend entry, counted from 0, and the
    /// total number of rows.
    fn legend_entries(&self) -> (Vec<(f64, u32)>, u32) {
        let (mut left_px, mut row) = (SIDES_PX[0], 0);
        let mut entries = Vec::new();
        for (name, _) in &self.legend {
            // An entry consists of a line, spaces, and characters that are assumed to be 8 px wide.
            let wide_px = LEGEND_LINE_PX + 32.0 + name.chars().count() as f64 * 8.0;
            if left_px + wide_px > SIDES_PX[0] + PANEL_WIDTH_PX + 24.0 && left_px > SIDES_PX[0] {
                (left_px, row) = (SIDES_PX[0], row + 1);
            }
            entries.push((left_px, row));
            left_px += wide_px;
        }
        (entries, row + 1)
    }
}

impl Panel {
    /// Draws the panel with its upper left corner at `corner`.
    fn draw(&self, canvas: &mut Canvas, corner: Vec2) {
        self.draw_axes(canvas, corner);
        for curve in &self.curves {
            for piece in &curve.pieces {
                let points = thinned(piece.iter().map(|point| self.px(*point)));
                canvas.line(points.into_iter().map(|point| point + corner), curve.pen);
            }
        }
        for (mark, place) in self.marks.iter().zip(self.mark_places()) {
            let middle_px = place.center().y + MIDDLE_RATIO * MARK_EM_PX;
            let left = Point::new(place.x0, middle_px) + corner;
            text(canvas, &mark.text, left, Anchor::Start, MARK_EM_PX);
        }
    }

    /// Converts a data point to pixels relative to the panel's upper left corner.
    fn px(&self, (x, y): (f64, f64)) -> Point {
        // Data units per pixel.
        let [x_per_px, y_per_px] = [(&self.x, PANEL_WIDTH_PX), (&self.y, self.height_px)]
            .map(|(range, length_px)| (range.end - range.start) / length_px);
        Point::new((x - self.x.start) / x_per_px, (self.y.end - y) / y_per_px)
    }

    /// Draws the grid, both axes with ticks and numbers, and the name of the vertical axis.
    fn draw_axes(&self, canvas: &mut Canvas, corner: Vec2) {
        let (grid, ink) = (Pen::new(GRID, 1.0), Pen::new(INK, 1.0));
        let [right, down] = [Vec2::new(PANEL_WIDTH_PX, 0.0), Vec2::new(0.0, self.height_px)];
        let mut x_ticks = ticks(&self.x, PANEL_WIDTH_PX);
        x_ticks.retain(|x| !self.counts || x.fract() == 0.0);
        // Each grid line ends at the axis, where its number is written.
        let x_ends = x_ticks.into_iter().map(|x| (x, self.px((x, self.y.start)) + corner));
        let y_ticks = ticks(&self.y, self.height_px).into_iter();
        let y_ends = y_ticks.map(|y| (y, self.px((self.x.start, y)) + corner));
        for (_, end) in x_ends.clone() {
            canvas.line([end - down, end], grid);
        }
        for (_, end) in y_ends.clone() {
            canvas.line([end, end + right], grid);
        }
        let origin = corner.to_point() + down;
        canvas.line([origin - down, origin, origin + right], ink);
        for (x, end) in x_ends {
            canvas.line([end, end + Vec2::new(0.0, TICK_PX)], ink);
            let below = end + Vec2::new(0.0, LABEL_PX + ASCENT_RATIO * NUMBER_EM_PX);
            text(canvas, &number(x), below, Anchor::Middle, NUMBER_EM_PX);
        }
        for (y, end) in y_ends {
            canvas.line([end - Vec2::new(TICK_PX, 0.0), end], ink);
            let beside = end + Vec2::new(-LABEL_PX, MIDDLE_RATIO * NUMBER_EM_PX);
            text(canvas, &number(y), beside, Anchor::End, NUMBER_EM_PX);
        }
        let middle = Point::new(EDGE_PX + ASCENT_RATIO * NAME_EM_PX, origin.y - 0.5 * down.y);
        text(canvas, self.y_name, middle, Anchor::Upward, NAME_EM_PX);
    }

    /// Returns the rectangles of the marks' texts, in pixels relative to the panel's upper left
    /// corner. Each mark is placed at the nearest position inside the panel that no earlier mark
    /// covers and, if possible, that no curve crosses.
    fn mark_places(&self) -> Vec<Rect> {
        let (drawn, panel) = (self.drawn_px(), Rect::new(0.0, 0.0, PANEL_WIDTH_PX, self.height_px));
        let mut taken: Vec<Rect> = Vec::new();
        for mark in &self.marks {
            let point = self.px(mark.place);
            let wide_px = 0.6 * MARK_PX * mark.text.chars().count() as f64;
            // Candidates lie above and below the point, in six rows each: to the right of the
            // point, to its left, and centered.
            let mut candidates = Vec::new();
            for row in 1..=6 {
                let row_px = f64::from(row) * 1.2 * MARK_PX - 0.45 * MARK_PX;
                for side_px in [4.0, -4.0 - wide_px, -0.5 * wide_px] {
                    for down_px in [-row_px, row_px] {
                        let left = point + Vec2::new(side_px, down_px);
                        let half = Vec2::new(0.0, 0.55 * MARK_PX);
                        let right = left + Vec2::new(wide_px, 0.0);
                        candidates.push(Rect::from_points(left - half, right + half));
                    }
                }
            }
            let free = candidates.iter().filter(|place| {
                panel.contains_rect(**place) && !taken.iter().any(|other| place.overlaps(*other))
            });
            let is_clear = |place: &&Rect| !drawn.iter().any(|point| place.contains(*point));
            let place =
                free.clone().find(is_clear).or(free.clone().next()).unwrap_or(&candidates[0]);
            taken.push(*place);
        }
        taken
    }

    /// Returns points along all curves, at most [`STEP_PX`] apart, in pixels within the panel.
    fn drawn_px(&self) -> Vec<Point> {
        // Each line segment is divided into equal steps.
        let pieces = self.curves.iter().flat_map(|curve| &curve.pieces);
        let mut points = Vec::new();
        for line in pieces.flat_map(|piece| piece.windows(2)) {
            let [from, to] = [line[0], line[1]].map(|point| self.px(point));
            let n = (libm::hypot(to.x - from.x, to.y - from.y) / STEP_PX).ceil().max(1.0);
            #[expect(clippy::cast_possible_truncation, reason = "pixels of a figure")]
            let parts = 0..n as u32;
            points.extend(parts.map(|part| from.lerp(to, f64::from(part) / n)));
        }
        points
    }
}

/// Returns the points, omitting those closer than [`THINNEST_PX`] to the last point kept.
fn thinned(points: impl Iterator<Item = Point>) -> Vec<Point> {
    let (mut kept, mut last_point): (Vec<Point>, _) = (Vec::new(), None);
    for point in points {
        last_point = Some(point);
        if kept.last().is_none_or(|last| (point - *last).hypot2() >= THINNEST_PX * THINNEST_PX) {
            kept.push(point);
        }
    }
    // The last point is always kept, so that the curve retains its full length.
    if kept.last() != last_point.as_ref() {
        kept.extend(last_point);
    }
    kept
}

/// Draws text at the given font size in the color of the axes.
fn text(canvas: &mut Canvas, text: &str, point: Point, anchor: Anchor, em_px: f64) {
    canvas.text(text, point, anchor, CAP_RATIO * em_px, INK);
}

/// Returns the range from smallest to largest value. Without values its start exceeds its end.
pub(super) fn range(values: impl IntoIterator<Item = f64>) -> Range<f64> {
    let empty = f64::INFINITY..f64::NEG_INFINITY;
    values.into_iter().fold(empty, |range, x| range.start.min(x)..range.end.max(x))
}

/// Returns as many round numbers within a range as fit on an axis of `length_px`. The numbers are
/// multiples of 1, 2 or 5 times a power of ten.
pub(super) fn ticks(range: &Range<f64>, length_px: f64) -> Vec<f64> {
    let most = (length_px / ROOM_PX).floor().max(LEAST_NUMBERS);
    let decade = libm::floor(libm::log10((range.end - range.start) / most));
    for step in [1.0, 2.0, 5.0, 10.0] {
        // Ticks are computed as integer · times / parts, so that tenths are rounded only once. The
        // ends of the range may be missed by 1e-9 of a step, which allows for rounding errors.
        let [times, parts] = if decade < 0.0 {
            [step, libm::pow(10.0, -decade)]
        } else {
            [step * libm::pow(10.0, decade), 1.0]
        };
        let first = (range.start * parts / times - 1e-9).ceil();
        let n = (range.end * parts / times + 1e-9).floor() - first + 1.0;
        if n <= most {
            let mut ticks = Vec::new();
            while (ticks.len() as f64) < n {
                ticks.push((first + ticks.len() as f64) * times / parts);
            }
            return ticks;
        }
    }
    Vec::new()
}

/// Formats a number with a typographic minus sign and as many decimals as needed, at most three.
pub(super) fn number(value: f64) -> String {
    let rounded = (value * 1000.0).round() / 1000.0 + 0.0;
    rounded.to_string().replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_both_ends_and_every_corner() {
        let along = (0..=1000).map(|k| Point::new(f64::from(k) * 0.01, 0.0));
        let up = (1..=1000).map(|k| Point::new(10.0, f64::from(k) * 0.01));
        let thin = thinned(along.chain(up));
        assert!(thin.len() < 55, "{} points over 20 pixels", thin.len());
        assert_eq!([thin[0], thin[thin.len() - 1]], [Point::ZERO, Point::new(10.0, 10.0)]);
        assert!(thin.iter().all(|p| p.y.min(10.0 - p.x).abs() < 1e-9), "on the line");
    }

    fn square(curves: Vec<Curve>) -> Panel {
        Panel::new([0.0..10.0, 0.0..10.0], 400.0, "z", curves)
    }

    #[test]
    fn words_at_places_neither_collide_nor_leave_the_panel() {
        let corner = (0..6).map(|k| (9.99 + 0.001 * f64::from(k), 9.99));
        let middle = (0..12).map(|k| (5.0 + 0.05 * f64::from(k), 5.0));
        let marks = corner.chain(middle).map(|place| Mark { place, text: "12.3 s".to_owned() });
        let marks: Vec<Mark> = marks.collect();
        let places = Panel { marks, ..square(Vec::new()) }.mark_places();
        for (i, place) in places.iter().enumerate() {
            assert!(place.width() > 6.0 * 7.0 && place.height() > 12.0, "{place}");
            assert!(place.x0 >= 0.0 && place.x1 <= PANEL_WIDTH_PX, "{place}");
            assert!(place.y0 >= 0.0 && place.y1 <= 400.0, "{place}");
            assert!(!places[..i].iter().any(|other| other.overlaps(*place)), "{places:?}");
        }
    }

    #[test]
    fn words_stand_in_the_drawing_where_they_were_placed_beside_curves_and_not_on_them() {
        let mark = |text: &str| Mark { place: (5.0, 5.0), text: text.to_owned() };
        let pen = Pen::new(BLUE, 2.0);
        let bar = Curve { pen, pieces: vec![vec![(5.0, 5.0), (9.0, 5.0)]] };
        let panel = Panel { marks: vec![mark("one"), mark("two")], ..square(vec![bar]) };
        let figure =
            Figure { title: "t".into(), legend: Vec::new(), x_name: "x", panels: vec![panel] };
        let svg = figure.svg();
        let [one, two] = ["one", "two"].map(|text: &str| -> f64 {
            let before = svg.split(&format!(">{text}</text>")).next().unwrap();
            let y = before.rsplit(" y=\"").next().unwrap().split('"').next().unwrap();
            y.parse::<f64>().unwrap()
        });
        let bar_px = HEAD_PX + 200.0;
        assert!(one < bar_px - 5.0 && two > bar_px + 5.0, "{one} and {two} beside {bar_px}");
    }

    #[test]
    fn a_long_title_is_written_smaller_and_not_cut_off() {
        fn size_px(n: usize) -> f64 {
            let title = "N".repeat(n);
            let figure = Figure { title, legend: Vec::new(), x_name: "x", panels: Vec::new() };
            let svg = figure.svg();
            let size = svg.split("font-size=\"").nth(1).unwrap().split('"').next().unwrap();
            size.parse::<f64>().unwrap()
        }
        assert_eq!(size_px(10), size_px(60), "as large as ever");
        assert!(size_px(200) * 200.0 * 0.6 < PANEL_WIDTH_PX, "{} px", size_px(200));
    }

    #[test]
    fn axes_have_round_numbers_within_them_and_room_for_each() {
        assert_eq!(ticks(&(-0.3..0.3), 150.0), [-0.2, 0.0, 0.2]);
        assert_eq!(ticks(&(0.0..2.95), 704.0), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]);
        assert_eq!(ticks(&(0.0..105.0), 150.0), [0.0, 50.0, 100.0]);
        assert_eq!(ticks(&(0.0..1000.0), 660.0).len(), 11, "both ends are within");
        assert_eq!(ticks(&(1.0..1.0), 150.0), [0.0; 0], "no length");
        for exponent in -6..6 {
            let length = libm::pow(10.0, f64::from(exponent));
            for start in [-3.3, 0.0, 7.1] {
                let range = start * length..(start + 1.7) * length;
                let n = ticks(&range, 300.0).len();
                assert!((2..=5).contains(&n), "{n} in {range:?}");
            }
        }
    }

    #[test]
    fn numbers_are_short_and_have_a_proper_minus() {
        assert_eq!([0.30000000000000004, -0.2, -0.0, 60.0].map(number), ["0.3", "−0.2", "0", "60"]);
    }
}
