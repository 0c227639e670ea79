//! Draws the bound on position errors as SVG: colored strokes, and the room as seen from above.

use std::ops::Range;

use kurbo::{Point, Rect, Vec2};

use super::canvas::{Anchor, Canvas, Pen, Surface, Window};
use super::coverage::viridis;
use super::figure::{BLUE, VERMILION, range};
use noctograph_core::geometry;
use noctograph_plan::Plan;
use noctograph_sim::Bound;
use noctograph_sim::sensors::UwbOptions;

/// Side of a square view, width of a margin, and width of the legend.
const VIEW_PX: f64 = 420.0;
const MARGIN_PX: f64 = 56.0;
const LEGEND_PX: f64 = 130.0;
/// Cap height.
const CAP_PX: f64 = 9.0;
/// Radius of an anchor's dot, and width of a lit stroke.
const ANCHOR_PX: f64 = 6.0;
const STROKE_PX: f64 = 6.0;
/// Distance of anchors below which their labels would overlap, and distance of stacked labels.
const NEAR_PX: f64 = 80.0;
const LINE_PX: f64 = 16.0;
/// Time step along the drawn path.
const STEP_S: f64 = 0.05;

/// Returns a square window around points in m, whose left edge is at `left_px`. All windows have
/// the same size in pixels.
fn view(points: impl IntoIterator<Item = [f64; 2]>, left_px: f64) -> Window {
    let [left, bottom, right, top] = geometry::bounds(points);
    // The window spans at least 0.1 m, because a single point has no extent.
    let span_m = (right - left).max(top - bottom).max(0.1);
    let middle_m = Point::new(0.5 * (left + right), 0.5 * (bottom + top));
    let corner_m = middle_m + 0.5 * span_m * Vec2::new(-1.0, 1.0);
    Window { corner_px: Point::new(left_px, MARGIN_PX), corner_m, px_per_m: VIEW_PX / span_m }
}

/// Returns the alignment that keeps a label at `x_px` within its view.
fn anchor(view: &Window, x_px: f64) -> Anchor {
    if x_px > view.corner_px.x + 0.5 * VIEW_PX { Anchor::End } else { Anchor::Start }
}

/// Returns an SVG of all drones' strokes colored by the bound, beside a top view of the anchors.
/// The top view marks `one_more_m`, the best position for an additional anchor.
pub fn bound_map(
    plans: &[&Plan],
    bounds: &[Bound],
    uwb: &UwbOptions,
    one_more_m: [f64; 3],
) -> String {
    // One view shows the plans as seen from the front, and the other shows plans and anchors as
    // seen from above.
    let flown_m = plans.iter().flat_map(|plan| &plan.setpoints).map(|s| s.position_m);
    let anchors_m = uwb.anchors_m.iter().chain([&one_more_m]).map(|[x, y, _]| [*x, *y]);
    let front = view(flown_m.clone().map(|p| [p.x, p.z]), MARGIN_PX);
    let from_above_m = flown_m.map(|p| [p.x, p.y]).chain(anchors_m);
    let above = view(from_above_m, 2.0 * MARGIN_PX + VIEW_PX);
    let width_px = 3.0 * MARGIN_PX + 2.0 * VIEW_PX + LEGEND_PX;
    let mut canvas = Canvas::white([width_px, 2.0 * MARGIN_PX + VIEW_PX]);
    let front_title = "best possible estimate along the strokes, seen from the front";
    label(&mut canvas, Point::new(MARGIN_PX, 30.0), front_title);
    let above_title = "anchors and flight, seen from above";
    label(&mut canvas, Point::new(above.corner_px.x, 30.0), above_title);
    let lit_m = lit_m(bounds);
    for (plan, bound) in plans.iter().zip(bounds) {
        draw_strokes(&mut canvas, &front, plan, bound, &lit_m);
        let path_m = plan.setpoints.iter().map(|s| Point::new(s.position_m.x, s.position_m.y));
        canvas.line(path_m.map(|point_m| above.px(point_m)), Pen::new([136; 3], 1.0));
    }
    draw_anchors(&mut canvas, &above, uwb, plans.len());
    let [x_m, y_m, z_m] = one_more_m;
    let center = above.px(Point::new(x_m, y_m));
    canvas.ring(center, 7.0, Pen::new(VERMILION, 3.0));
    let (text, below) = (format!("one more here: z {z_m:.1} m"), center + Vec2::new(0.0, 22.0));
    canvas.text(text, below, anchor(&above, center.x), CAP_PX, VERMILION);
    draw_legend(&mut canvas, &lit_m);
    canvas.svg()
}

/// Returns the range in m of the bound over lit strokes, which the colors represent. Returns 0 to 1
/// if nothing is lit.
fn lit_m(bounds: &[Bound]) -> Range<f64> {
    let samples = bounds.iter().flat_map(|bound| bound.sigma_m.iter().zip(&bound.letter));
    let lit_m = range(samples.filter_map(|(sigma_m, letter)| letter.and(Some(*sigma_m))));
    if lit_m.start > lit_m.end { 0.0..1.0 } else { lit_m }
}

/// Writes black text with its lower left corner at `left`.
fn label(canvas: &mut Canvas, left: Point, text: &str) {
    canvas.text(text, left, Anchor::Start, CAP_PX, [0; 3]);
}

/// Draws a drone's path as seen from the front. Lit strokes have the color of their bound, and the
/// rest is a thin line.
fn draw_strokes(
    canvas: &mut Canvas,
    front: &Window,
    plan: &Plan,
    bound: &Bound,
    lit_m: &Range<f64>,
) {
    // Samples are thinned to a time step that remains visible.
    let (mut last_s, mut last) = (f64::NEG_INFINITY, None);
    for ((time_s, sigma_m), letter) in bound.time_s.iter().zip(&bound.sigma_m).zip(&bound.letter) {
        if time_s - last_s < STEP_S {
            continue;
        }
        last_s = *time_s;
        let design_m = plan.design_m(*time_s);
        let point = front.px(Point::new(design_m.x, design_m.z));
        if let Some(from) = last {
            let fraction = (sigma_m - lit_m.start) / (lit_m.end - lit_m.start).max(1e-6);
            let pen = match letter {
                Some(_) => Pen::new(viridis(fraction), STROKE_PX),
                None => Pen::new([221; 3], 1.0),
            };
            canvas.line([from, point], pen);
        }
        last = Some(point);
    }
}

/// Draws the anchors from above, each with the number of drones that receive it and its height in
/// m.
fn draw_anchors(canvas: &mut Canvas, above: &Window, uwb: &UwbOptions, n_drones: usize) {
    let mut drawn: Vec<Point> = Vec::new();
    for (index, [x_m, y_m, z_m]) in uwb.anchors_m.iter().enumerate() {
        let center = above.px(Point::new(*x_m, *y_m));
        let n_hear = uwb.heard.iter().filter(|heard| heard.contains(&index)).count();
        let is_heard_by_all = uwb.heard.is_empty() || n_hear == n_drones;
        let by = if is_heard_by_all { "all".to_owned() } else { n_hear.to_string() };
        // Labels of anchors near each other, such as those on one pole, are stacked. The first is
        // above the dot, and the others are below it.
        let is_near = |other: &&Point| (**other - center).hypot2() < NEAR_PX * NEAR_PX;
        let line = drawn.iter().filter(is_near).count();
        let down_px = if line == 0 { -10.0 } else { 4.0 + LINE_PX * line as f64 };
        canvas.dot(center, ANCHOR_PX, BLUE);
        let text = format!("{index}: z {z_m:.1} m, heard by {by}");
        let label = center + Vec2::new(0.0, down_px);
        canvas.text(text, label, anchor(above, center.x), CAP_PX, [0; 3]);
        drawn.push(center);
    }
}

/// Draws the legend, which lists six colors with their σ in centimeters. `lit_m` is the range that
/// the colors represent.
fn draw_legend(canvas: &mut Canvas, lit_m: &Range<f64>) {
    let x = 3.0 * MARGIN_PX + 2.0 * VIEW_PX - 20.0;
    label(canvas, Point::new(x, MARGIN_PX), "1 \u{3c3} over 3 axes");
    for step in 0..=5 {
        let fraction = f64::from(step) / 5.0;
        let y = MARGIN_PX + 14.0 + 20.0 * f64::from(step);
        let sigma_m = lit_m.start + fraction * (lit_m.end - lit_m.start);
        canvas.cell(Rect::new(x, y, x + 18.0, y + 20.0), viridis(fraction));
        label(canvas, Point::new(x + 26.0, y + 15.0), &format!("{:.1} cm", 100.0 * sigma_m));
    }
}
