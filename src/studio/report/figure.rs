//! A figure: panels under each other, with a title and a legend above them, as SVG.

use std::ops::Range;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

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
/// plotters draws on whole pixels; a canvas this many times as fine, shown smaller, is smooth.
const FINENESS: f64 = 8.0;
/// Height of the words at places.
const MARK_PX: f64 = 12.0;
/// Points of a curve nearer to each other than this are one.
const THINNEST_PX: f64 = 0.4;

pub(super) const BLACK: RGBColor = RGBColor(0, 0, 0);
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
pub(super) const VERMILION: RGBColor = RGBColor(213, 94, 0);
pub(super) const GRAY: RGBColor = RGBColor(186, 186, 186);
const INK: RGBColor = RGBColor(64, 64, 64);
const GRID: RGBColor = RGBColor(232, 232, 232);

/// How a curve looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) color: RGBColor,
    pub(super) width_px: f64,
}

impl Pen {
    fn style(self) -> ShapeStyle {
        ShapeStyle { color: self.color.to_rgba(), filled: false, stroke_width: fine(self.width_px) }
    }
}

/// A line through points, in pieces where it is interrupted.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) pen: Pen,
    pub(super) pieces: Vec<Vec<(f64, f64)>>,
}

/// Curves over a pair of axes.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) x: Range<f64>,
    pub(super) y: Range<f64>,
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
        Self { x, y, height_px, y_name, curves, marks: Vec::new() }
    }
}

/// A word at a place, on its upper right.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) at: (f64, f64),
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
        let height_px = self.head_px()
            + BELOW_PX[1]
            + EDGE_PX
            + self.panels.iter().map(|panel| panel.height_px + BELOW_PX[0]).sum::<f64>();
        let size = (fine(WIDTH_PX), fine(height_px));
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
            self.draw(&root).expect("drawing into memory cannot fail");
        }
        let drawn = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
        let shown = format!("width=\"{WIDTH_PX}\" height=\"{height_px}\"");
        text.replacen(&drawn, &shown, 1)
    }

    fn draw<B: DrawingBackend>(&self, root: &DrawingArea<B, Shift>) -> Drawn<B> {
        root.fill(&WHITE)?;
        let lines: Vec<&str> = self.title.split('\n').collect();
        let title = lines.join(" / ");
        // A long word is written smaller, so that it is not cut off.
        let wide_em = 0.5 * title.chars().count() as f64;
        let style = text_style((PANEL_WIDTH_PX / wide_em).clamp(2.0, 20.0), INK, HPos::Left);
        root.draw_text(&title, &style, at(SIDES_PX[0], 24.0))?;
        self.draw_legend(root)?;
        let mut top_px = self.head_px();
        for (index, panel) in self.panels.iter().enumerate() {
            let last = index + 1 == self.panels.len();
            let below_px = if last { BELOW_PX[0] + BELOW_PX[1] } else { BELOW_PX[0] };
            let area = root.clone().shrink(
                at(EDGE_PX, top_px),
                at(WIDTH_PX - EDGE_PX - SIDES_PX[1], panel.height_px + below_px),
            );
            panel.draw(&area, below_px, if last { self.x_name } else { "" })?;
            top_px += panel.height_px + below_px;
        }
        root.present()
    }

    fn draw_legend<B: DrawingBackend>(&self, root: &DrawingArea<B, Shift>) -> Drawn<B> {
        let (places, n_rows) = self.legend_places();
        // One row is in the middle of the room of two closer ones.
        let first_px = if n_rows > 1 { 44.0 } else { 50.0 };
        for ((name, pen), (left_px, row)) in self.legend.iter().zip(places) {
            let high_px = first_px + f64::from(row) * LEGEND_ROW_PX;
            let sample = [at(left_px, high_px), at(left_px + LEGEND_LINE_PX, high_px)];
            root.draw(&PathElement::new(sample, pen.style()))?;
            let from = at(left_px + LEGEND_LINE_PX + 8.0, high_px);
            root.draw_text(name, &text_style(15.0, INK, HPos::Left), from)?;
        }
        Ok(())
    }

    /// Where the entries of the legend begin, with their rows; and the number of rows.
    fn legend_places(&self) -> (Vec<(f64, u32)>, u32) {
        let (mut left_px, mut row) = (SIDES_PX[0], 0);
        let place = |(name, _): &(String, Pen)| {
            let wide_px = LEGEND_LINE_PX + 32.0 + name.chars().count() as f64 * 8.0;
            if left_px + wide_px > SIDES_PX[0] + PANEL_WIDTH_PX + 24.0 && left_px > SIDES_PX[0] {
                (left_px, row) = (SIDES_PX[0], row + 1);
            }
            let at = (left_px, row);
            left_px += wide_px;
            at
        };
        (self.legend.iter().map(place).collect(), row + 1)
    }

    /// Height of the title and the legend.
    fn head_px(&self) -> f64 {
        HEAD_PX + LEGEND_ROW_PX * f64::from(self.legend_places().1.saturating_sub(2))
    }
}

type Shift = plotters::coord::Shift;
type Drawn<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

impl Panel {
    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        below_px: f64,
        x_name: &str,
    ) -> Drawn<B> {
        let mut chart = ChartBuilder::on(area)
            .x_label_area_size(fine(below_px))
            .y_label_area_size(fine(SIDES_PX[0] - EDGE_PX))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        #[expect(clippy::cast_possible_truncation, reason = "a few")]
        let n_labels = |length_px: f64| (length_px / 60.0).max(4.0) as usize;
        chart
            .configure_mesh()
            .x_labels(n_labels(PANEL_WIDTH_PX))
            .y_labels(n_labels(self.height_px))
            .max_light_lines(0)
            .bold_line_style(Pen { color: GRID, width_px: 1.0 }.style())
            .axis_style(Pen { color: INK, width_px: 1.0 }.style())
            .set_all_tick_mark_size(fine(4.0))
            .label_style(text_style(14.0, INK, HPos::Center))
            .axis_desc_style(text_style(15.0, INK, HPos::Center))
            .x_label_formatter(&|x| number(*x))
            .y_label_formatter(&|y| number(*y))
            .x_desc(x_name)
            .y_desc(self.y_name)
            .draw()?;
        let per_px = [PANEL_WIDTH_PX, self.height_px];
        let per_px = [(&self.x, per_px[0]), (&self.y, per_px[1])]
            .map(|(range, length_px)| (range.end - range.start) / length_px);
        for curve in &self.curves {
            for piece in &curve.pieces {
                let points = thinned(piece, per_px);
                chart.draw_series([PathElement::new(points, curve.pen.style())])?;
            }
        }
        for (mark, (right_px, down_px)) in self.marks.iter().zip(self.places(per_px)) {
            let style = text_style(MARK_PX, INK, HPos::Left);
            let text = Text::new(mark.text.clone(), (whole(right_px), whole(down_px)), style);
            chart.draw_series([EmptyElement::at(mark.at) + text])?;
        }
        Ok(())
    }

    /// Where the words of the marks begin, right of and below their places: each at the nearest of
    /// several places within the panel that is free of other words, and of curves if there is one.
    fn places(&self, [x_per_px, y_per_px]: [f64; 2]) -> Vec<(f64, f64)> {
        let drawn = self.drawn_px([x_per_px, y_per_px]);
        let mut taken: Vec<[f64; 4]> = Vec::new();
        let place = |mark: &Mark| {
            let x_px = (mark.at.0 - self.x.start) / x_per_px;
            let y_px = (self.y.end - mark.at.1) / y_per_px;
            let wide_px = 0.6 * MARK_PX * mark.text.chars().count() as f64;
            let rows = (1..=6).map(|row| f64::from(row) * 1.2 * MARK_PX - 0.45 * MARK_PX);
            let sides = [4.0, -4.0 - wide_px, -0.5 * wide_px];
            let around = rows.flat_map(|row| {
                sides.into_iter().flat_map(move |side| [(side, -row), (side, row)])
            });
            let around: Vec<(f64, f64)> = around.collect();
            let corners = |(right, down): (f64, f64)| {
                let (left, middle) = (x_px + right, y_px + down);
                [left, middle - 0.55 * MARK_PX, left + wide_px, middle + 0.55 * MARK_PX]
            };
            let free = |place: &&(f64, f64)| {
                let [left, top, right, bottom] = corners(**place);
                let height_px = self.height_px;
                let within =
                    left >= 0.0 && right <= PANEL_WIDTH_PX && top >= 0.0 && bottom <= height_px;
                within
                    && taken
                        .iter()
                        .all(|[l, t, r, b]| right < *l || *r < left || bottom < *t || *b < top)
            };
            let clear = |place: &&(f64, f64)| {
                let [left, top, right, bottom] = corners(**place);
                let across =
                    |[x, y]: &[f64; 2]| (left..=right).contains(x) && (top..=bottom).contains(y);
                free(place) && !drawn.iter().any(across)
            };
            let found = around.iter().find(clear).or_else(|| around.iter().find(free));
            let found = found.copied().unwrap_or(around[0]);
            taken.push(corners(found));
            found
        };
        self.marks.iter().map(place).collect()
    }

    /// Points of all curves from the panel's upper left corner, a few pixels apart.
    fn drawn_px(&self, [x_per_px, y_per_px]: [f64; 2]) -> Vec<[f64; 2]> {
        const STEP_PX: f64 = 3.0;
        let place =
            |(x, y): (f64, f64)| [(x - self.x.start) / x_per_px, (self.y.end - y) / y_per_px];
        let lines = self.curves.iter().flat_map(|curve| &curve.pieces).flat_map(|p| p.windows(2));
        let mut points = Vec::new();
        for line in lines {
            let [from, to] = [line[0], line[1]].map(place);
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
fn thinned(points: &[(f64, f64)], [x_per_px, y_per_px]: [f64; 2]) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for point in points {
        let near = kept.last().is_some_and(|last| {
            let (dx, dy) = ((point.0 - last.0) / x_per_px, (point.1 - last.1) / y_per_px);
            dx * dx + dy * dy < THINNEST_PX * THINNEST_PX
        });
        if !near {
            kept.push(*point);
        }
    }
    if let (Some(end), false) = (points.last(), kept.last() == points.last()) {
        kept.push(*end);
    }
    kept
}

fn text_style(size_px: f64, color: RGBColor, across: HPos) -> TextStyle<'static> {
    let font = ("sans-serif", fine(size_px)).into_font();
    font.color(&color).pos(Pos::new(across, VPos::Center))
}

/// A number with as many decimals as it needs, and a proper minus.
fn number(value: f64) -> String {
    let rounded = (value * 1000.0).round() / 1000.0 + 0.0;
    rounded.to_string().replace('-', "−")
}

fn at(x_px: f64, y_px: f64) -> (i32, i32) {
    (whole(x_px), whole(y_px))
}

/// Pixels on the fine canvas, also to the left or above.
#[expect(clippy::cast_possible_truncation, reason = "a figure is a few thousand pixels")]
fn whole(px: f64) -> i32 {
    (px * FINENESS).round() as i32
}

/// A length on the fine canvas.
fn fine(px: f64) -> u32 {
    whole(px).unsigned_abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_both_ends_and_every_corner() {
        let along = (0..=1000).map(|k| (f64::from(k) * 0.01, 0.0));
        let up = (1..=1000).map(|k| (10.0, f64::from(k) * 0.01));
        let points: Vec<_> = along.chain(up).collect();
        let thin = thinned(&points, [1.0, 1.0]);
        assert!(thin.len() < 55, "{} points over 20 pixels", thin.len());
        assert_eq!((thin[0], thin[thin.len() - 1]), ((0.0, 0.0), (10.0, 10.0)));
        let beside = |p: &(f64, f64)| (p.1.min(10.0 - p.0)).abs();
        assert!(thin.iter().all(|p| beside(p) < 1e-9), "on the line");
    }

    fn square(curves: Vec<Curve>) -> Panel {
        Panel::new([0.0..10.0, 0.0..10.0], 400.0, "z", curves)
    }

    #[test]
    fn words_at_places_neither_collide_nor_leave_the_panel() {
        let corner = (0..6).map(|k| (9.99 + 0.001 * f64::from(k), 9.99));
        let middle = (0..12).map(|k| (5.0 + 0.05 * f64::from(k), 5.0));
        let marks = corner.chain(middle).map(|at| Mark { at, text: "12.3 s".to_owned() });
        let marks: Vec<Mark> = marks.collect();
        let panel = Panel { marks: marks.clone(), ..square(Vec::new()) };
        let per_px = [10.0 / PANEL_WIDTH_PX, 10.0 / 400.0];
        let boxes: Vec<[f64; 4]> = marks
            .iter()
            .zip(panel.places(per_px))
            .map(|(mark, (right, down))| {
                let left = mark.at.0 / per_px[0] + right;
                let middle = (10.0 - mark.at.1) / per_px[1] + down;
                [left, middle - 6.0, left + 6.0 * 7.2, middle + 6.0]
            })
            .collect();
        for (i, [left, top, right, bottom]) in boxes.iter().enumerate() {
            assert!(*left >= 0.0 && *right <= PANEL_WIDTH_PX && *top >= 0.0 && *bottom <= 400.0);
            for [l, t, r, b] in &boxes[..i] {
                assert!(right < l || r < left || bottom < t || b < top, "{boxes:?}");
            }
        }
    }

    #[test]
    fn words_stand_in_the_drawing_where_they_were_placed_beside_curves_and_not_on_them() {
        let mark = |text: &str| Mark { at: (5.0, 5.0), text: text.to_owned() };
        let pen = Pen { color: BLUE, width_px: 2.0 };
        let bar = Curve { pen, pieces: vec![vec![(5.0, 5.0), (9.0, 5.0)]] };
        let panel = Panel { marks: vec![mark("one"), mark("two")], ..square(vec![bar]) };
        let figure =
            Figure { title: "t".into(), legend: Vec::new(), x_name: "x", panels: vec![panel] };
        let svg = figure.svg();
        let y_of = |text: &str| -> f64 {
            let before = svg.split(&format!("\n{text}\n")).next().unwrap();
            let y = before.rsplit(" y=\"").next().unwrap().split('"').next().unwrap();
            y.parse::<f64>().unwrap() / FINENESS
        };
        let [one, two] = ["one", "two"].map(y_of);
        let bar_px = HEAD_PX + 200.0;
        assert!(one < bar_px - 5.0 && two > bar_px + 5.0, "{one} and {two} beside {bar_px}");
    }

    #[test]
    fn a_long_title_is_written_smaller_and_not_cut_off() {
        let size_px = |n: usize| {
            let title = "N".repeat(n);
            let figure = Figure { title, legend: Vec::new(), x_name: "x", panels: Vec::new() };
            let svg = figure.svg();
            let size = svg.split("font-size=\"").nth(1).unwrap().split('"').next().unwrap();
            size.parse::<f64>().unwrap() / FINENESS
        };
        assert_eq!(size_px(10), size_px(60), "as large as ever");
        assert!(size_px(200) * 200.0 * 0.6 < PANEL_WIDTH_PX, "{} px", size_px(200));
    }

    #[test]
    fn numbers_are_short_and_have_a_proper_minus() {
        assert_eq!([0.30000000000000004, -0.2, -0.0, 60.0].map(number), ["0.3", "−0.2", "0", "60"]);
    }
}
