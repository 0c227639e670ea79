//! A figure: panels under each other, with a title and a legend above them, as SVG.

use std::ops::Range;

use super::canvas::{Anchor, Canvas, Pen, Rgb, Surface};
use noctograph_core::geometry::distance;

/// Width of a figure.
pub(super) const WIDTH_PX: f64 = 800.0;
/// Room left and right of a panel; the axis labels stand in it.
const SIDES_PX: [f64; 2] = [72.0, 24.0];
/// Of the left side, what stays empty.
const EDGE_PX: f64 = 12.0;
/// Width of a panel.
pub(super) const PANEL_WIDTH_PX: f64 = WIDTH_PX - SIDES_PX[0] - SIDES_PX[1];
/// Room above the first panel, with one row or two of the legend.
const HEAD_PX: f64 = 72.0;
/// Height of a row of the legend, and width of its samples.
const LEGEND_ROW_PX: f64 = 18.0;
const LEGEND_LINE_PX: f64 = 28.0;
/// Room below each panel, and more below the last for the name of its axis.
const BELOW_PX: [f64; 2] = [28.0, 18.0];
/// Sizes of the letters of numbers, names and titles, and the height kept free for words at places.
const NUMBER_EM_PX: f64 = 11.3;
const NAME_EM_PX: f64 = 12.1;
const TITLE_EM_PX: f64 = 16.1;
const MARK_EM_PX: f64 = 9.7;
const MARK_PX: f64 = 12.0;
/// Height of capitals, and depth of the lower edge of a text below its middle, by its size.
const CAP_SHARE: f64 = 0.7;
const MIDDLE_SHARE: f64 = 0.26;
/// Height of a line of text above its lower edge, by its size.
const ASCENT_SHARE: f64 = 0.76;
/// Length of the marks of an axis, and the room between axis and numbers.
const TICK_PX: f64 = 4.0;
const LABEL_PX: f64 = 8.0;
/// Room along an axis for each of its numbers, and how many it has room for at least.
const ROOM_PX: f64 = 60.0;
const LEAST_NUMBERS: f64 = 4.0;
/// Points of a curve nearer to each other than this are one.
const THINNEST_PX: f64 = 0.4;

pub(super) const BLACK: Rgb = [0, 0, 0];
pub(super) const BLUE: Rgb = [0, 114, 178];
pub(super) const VERMILION: Rgb = [213, 94, 0];
pub(super) const GRAY: Rgb = [186, 186, 186];
const INK: Rgb = [64, 64, 64];
const GRID: Rgb = [232, 232, 232];

/// A line through points, in pieces where it is interrupted.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) pen: Pen,
    pub(super) pieces: Vec<Vec<(f64, f64)>>,
}

impl Curve {
    /// A line without interruption.
    pub(super) fn whole(pen: Pen, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { pen, pieces: vec![points.into_iter().collect()] }
    }

    pub(super) fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.pieces.iter().flatten().copied()
    }
}

/// Curves over a pair of axes.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) x: Range<f64>,
    pub(super) y: Range<f64>,
    /// Whether the axis below counts: its numbers are whole.
    pub(super) counts: bool,
    pub(super) height_px: f64,
    pub(super) y_name: &'static str,
    pub(super) curves: Vec<Curve>,
    pub(super) marks: Vec<Mark>,
}

impl Panel {
    /// A panel without words.
    pub(super) fn new(
        [x, y]: [Range<f64>; 2],
        height_px: f64,
        y_name: &'static str,
        curves: Vec<Curve>,
    ) -> Self {
        Self { x, y, counts: false, height_px, y_name, curves, marks: Vec::new() }
    }
}

/// A word at a place, on its upper right.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) place: (f64, f64),
    pub(super) text: String,
}

/// Everything that a figure shows.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) title: String,
    pub(super) legend: Vec<(String, Pen)>,
    /// The axis that all panels share.
    pub(super) x_name: &'static str,
    pub(super) panels: Vec<Panel>,
}

impl Figure {
    /// The figure as an SVG file's text, [`WIDTH_PX`] wide.
    pub(super) fn svg(&self) -> String {
        let (places, n_rows) = self.legend_places();
        let mut top_px = HEAD_PX + LEGEND_ROW_PX * f64::from(n_rows.saturating_sub(2));
        let panels_px: f64 = self.panels.iter().map(|panel| panel.height_px + BELOW_PX[0]).sum();
        let mut canvas = Canvas::white([WIDTH_PX, top_px + panels_px + BELOW_PX[1] + EDGE_PX]);
        self.draw_title(&mut canvas);
        // One row is in the middle of the room of two closer ones.
        let first_px = if n_rows > 1 { 44.0 } else { 50.0 };
        for ((name, pen), (left_px, row)) in self.legend.iter().zip(places) {
            let high_px = first_px + f64::from(row) * LEGEND_ROW_PX;
            let right_px = left_px + LEGEND_LINE_PX;
            canvas.line([[left_px, high_px], [right_px, high_px]], *pen);
            let place_px = [right_px + 8.0, high_px + MIDDLE_SHARE * NAME_EM_PX];
            text(&mut canvas, name, place_px, Anchor::Start, NAME_EM_PX);
        }
        for panel in &self.panels {
            panel.draw(&mut canvas, top_px);
            top_px += panel.height_px + BELOW_PX[0];
        }
        let bottom_px = top_px + BELOW_PX[1] - MIDDLE_SHARE * NAME_EM_PX;
        let middle = [SIDES_PX[0] + 0.5 * PANEL_WIDTH_PX, bottom_px];
        text(&mut canvas, self.x_name, middle, Anchor::Middle, NAME_EM_PX);
        canvas.svg()
    }

    fn draw_title(&self, canvas: &mut Canvas) {
        let title = self.title.replace('\n', " / ");
        // A long word is written smaller, so that it is not cut off.
        let narrow_px = 1.6 * PANEL_WIDTH_PX / title.chars().count().max(1) as f64;
        let em_px = narrow_px.clamp(1.6, TITLE_EM_PX);
        let place_px = [SIDES_PX[0], 24.0 + MIDDLE_SHARE * em_px];
        text(canvas, &title, place_px, Anchor::Start, em_px);
    }

    /// Where the entries of the legend begin, with their rows; and the number of rows.
    fn legend_places(&self) -> (Vec<(f64, u32)>, u32) {
        let (mut left_px, mut row) = (SIDES_PX[0], 0);
        let place = |(name, _): &(String, Pen)| {
            let wide_px = LEGEND_LINE_PX + 32.0 + name.chars().count() as f64 * 8.0;
            if left_px + wide_px > SIDES_PX[0] + PANEL_WIDTH_PX + 24.0 && left_px > SIDES_PX[0] {
                (left_px, row) = (SIDES_PX[0], row + 1);
            }
            let place_px = (left_px, row);
            left_px += wide_px;
            place_px
        };
        (self.legend.iter().map(place).collect(), row + 1)
    }
}

impl Panel {
    fn draw(&self, canvas: &mut Canvas, top_px: f64) {
        let place = |[right, down]: [f64; 2]| [SIDES_PX[0] + right, top_px + down];
        self.draw_axes(canvas, top_px);
        for curve in &self.curves {
            for piece in &curve.pieces {
                let points = thinned(piece.iter().map(|point| self.px(*point)));
                canvas.line(points.into_iter().map(place), curve.pen);
            }
        }
        for (mark, [right_px, down_px]) in self.marks.iter().zip(self.places()) {
            let [x, y] = place(self.px(mark.place));
            let place_px = [x + right_px, y + down_px + MIDDLE_SHARE * MARK_EM_PX];
            text(canvas, &mark.text, place_px, Anchor::Start, MARK_EM_PX);
        }
    }

    /// A point from the panel's upper left corner.
    fn px(&self, (x, y): (f64, f64)) -> [f64; 2] {
        let per_px = |range: &Range<f64>, length_px: f64| (range.end - range.start) / length_px;
        let right = (x - self.x.start) / per_px(&self.x, PANEL_WIDTH_PX);
        [right, (self.y.end - y) / per_px(&self.y, self.height_px)]
    }

    /// The grid, both axes with their marks and numbers, and the name of the vertical one.
    fn draw_axes(&self, canvas: &mut Canvas, top_px: f64) {
        let [left, right] = [SIDES_PX[0], SIDES_PX[0] + PANEL_WIDTH_PX];
        let (bottom, middle) = (top_px + self.height_px, top_px + 0.5 * self.height_px);
        let (grid, ink) = (Pen::new(GRID, 1.0), Pen::new(INK, 1.0));
        let mut x_places = ticks(&self.x, PANEL_WIDTH_PX);
        x_places.retain(|x| !self.counts || x.fract() == 0.0);
        let x_places = x_places.into_iter().map(|x| (x, left + self.px((x, self.y.start))[0]));
        let y_places = ticks(&self.y, self.height_px);
        let y_places = y_places.into_iter().map(|y| (y, top_px + self.px((self.x.start, y))[1]));
        for (_, x_px) in x_places.clone() {
            canvas.line([[x_px, top_px], [x_px, bottom]], grid);
        }
        for (_, y_px) in y_places.clone() {
            canvas.line([[left, y_px], [right, y_px]], grid);
        }
        canvas.line([[left, top_px], [left, bottom], [right, bottom]], ink);
        for (x, x_px) in x_places {
            canvas.line([[x_px, bottom], [x_px, bottom + TICK_PX]], ink);
            let place_px = [x_px, bottom + LABEL_PX + ASCENT_SHARE * NUMBER_EM_PX];
            text(canvas, &number(x), place_px, Anchor::Middle, NUMBER_EM_PX);
        }
        for (y, y_px) in y_places {
            canvas.line([[left - TICK_PX, y_px], [left, y_px]], ink);
            let place_px = [left - LABEL_PX, y_px + MIDDLE_SHARE * NUMBER_EM_PX];
            text(canvas, &number(y), place_px, Anchor::End, NUMBER_EM_PX);
        }
        let place_px = [EDGE_PX + ASCENT_SHARE * NAME_EM_PX, middle];
        text(canvas, self.y_name, place_px, Anchor::Upward, NAME_EM_PX);
    }

    /// Where the words of the marks begin, right of and below their places: each at the nearest of
    /// several places within the panel that is free of other words, and of curves if there is one.
    fn places(&self) -> Vec<[f64; 2]> {
        let drawn = self.drawn_px();
        let mut taken: Vec<[f64; 4]> = Vec::new();
        let places = self.marks.iter().map(|mark| {
            let [x_px, y_px] = self.px(mark.place);
            let wide_px = 0.6 * MARK_PX * mark.text.chars().count() as f64;
            let rows = (1..=6).map(|row| f64::from(row) * 1.2 * MARK_PX - 0.45 * MARK_PX);
            let around = rows.flat_map(|row| {
                let sides = [4.0, -4.0 - wide_px, -0.5 * wide_px];
                sides.into_iter().flat_map(move |side| [[side, -row], [side, row]])
            });
            let around: Vec<[f64; 2]> = around.collect();
            let corners = |[right, down]: [f64; 2]| {
                let (left, middle) = (x_px + right, y_px + down);
                [left, middle - 0.55 * MARK_PX, left + wide_px, middle + 0.55 * MARK_PX]
            };
            let is_free = |place: &&[f64; 2]| {
                let [left, top, right, bottom] = corners(**place);
                let beside =
                    |[l, t, r, b]: &[f64; 4]| right < *l || *r < left || bottom < *t || *b < top;
                (left >= 0.0 && right <= PANEL_WIDTH_PX && top >= 0.0)
                    && bottom <= self.height_px
                    && taken.iter().all(beside)
            };
            let free: Vec<&[f64; 2]> = around.iter().filter(is_free).collect();
            let is_clear = |place: &&&[f64; 2]| {
                let [left, top, right, bottom] = corners(***place);
                let mut points = drawn.iter();
                !points.any(|[x, y]| (left..=right).contains(x) && (top..=bottom).contains(y))
            };
            let label = *free.iter().find(is_clear).or(free.first()).copied().unwrap_or(&around[0]);
            taken.push(corners(label));
            label
        });
        places.collect()
    }

    /// Points of all curves from the panel's upper left corner, a few pixels apart.
    fn drawn_px(&self) -> Vec<[f64; 2]> {
        const STEP_PX: f64 = 3.0;
        let pieces = self.curves.iter().flat_map(|curve| &curve.pieces);
        let mut points = Vec::new();
        for line in pieces.flat_map(|piece| piece.windows(2)) {
            let [from, to] = [line[0], line[1]].map(|point| self.px(point));
            let [x, y] = [to[0] - from[0], to[1] - from[1]];
            let n = (libm::hypot(x, y) / STEP_PX).ceil().max(1.0);
            let mut part = 0.0;
            while part < n {
                points.push([from[0] + x * part / n, from[1] + y * part / n]);
                part += 1.0;
            }
        }
        points
    }
}

/// Leaves out points that a pixel cannot tell from the one before.
fn thinned(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let (mut kept, mut end): (Vec<[f64; 2]>, _) = (Vec::new(), None);
    for point in points {
        end = Some(point);
        if kept.last().is_none_or(|last| distance(*last, point) >= THINNEST_PX) {
            kept.push(point);
        }
    }
    if kept.last() != end.as_ref() {
        kept.extend(end);
    }
    kept
}

fn text(canvas: &mut Canvas, text: &str, place_px: [f64; 2], anchor: Anchor, em_px: f64) {
    canvas.text(text, place_px, anchor, CAP_SHARE * em_px, INK);
}

/// From the least to the largest value.
pub(super) fn range(values: impl IntoIterator<Item = f64>) -> Range<f64> {
    let nothing = f64::INFINITY..f64::NEG_INFINITY;
    values.into_iter().fold(nothing, |range, x| range.start.min(x)..range.end.max(x))
}

/// Round numbers within a range, as many as there is room for along its axis: multiples of 1, 2 or
/// 5 times a power of ten.
fn ticks(range: &Range<f64>, length_px: f64) -> Vec<f64> {
    let most = (length_px / ROOM_PX).floor().max(LEAST_NUMBERS);
    let decade = libm::floor(libm::log10((range.end - range.start) / most));
    for step in [1.0, 2.0, 5.0, 10.0] {
        // Tenths and hundredths as quotients of whole numbers, so that they are rounded once.
        let [times, parts] = match decade < 0.0 {
            true => [step, libm::pow(10.0, -decade)],
            false => [step * libm::pow(10.0, decade), 1.0],
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

/// A number with as many decimals as it needs, and a proper minus.
fn number(value: f64) -> String {
    let rounded = (value * 1000.0).round() / 1000.0 + 0.0;
    rounded.to_string().replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_both_ends_and_every_corner() {
        let along = (0..=1000).map(|k| [f64::from(k) * 0.01, 0.0]);
        let up = (1..=1000).map(|k| [10.0, f64::from(k) * 0.01]);
        let points: Vec<_> = along.chain(up).collect();
        let thin = thinned(points.into_iter());
        assert!(thin.len() < 55, "{} points over 20 pixels", thin.len());
        assert_eq!((thin[0], thin[thin.len() - 1]), ([0.0, 0.0], [10.0, 10.0]));
        let beside = |[x, y]: &[f64; 2]| (y.min(10.0 - x)).abs();
        assert!(thin.iter().all(|p| beside(p) < 1e-9), "on the line");
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
        let panel = Panel { marks: marks.clone(), ..square(Vec::new()) };
        let corners = |(mark, [right, down]): (&Mark, [f64; 2])| {
            let [x, y] = panel.px(mark.place);
            let (left, middle) = (x + right, y + down);
            [left, middle - 6.0, left + 6.0 * 7.2, middle + 6.0]
        };
        let boxes: Vec<[f64; 4]> = marks.iter().zip(panel.places()).map(corners).collect();
        for (i, [left, top, right, bottom]) in boxes.iter().enumerate() {
            assert!(*left >= 0.0 && *right <= PANEL_WIDTH_PX && *top >= 0.0 && *bottom <= 400.0);
            for [l, t, r, b] in &boxes[..i] {
                assert!(right < l || r < left || bottom < t || b < top, "{boxes:?}");
            }
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
