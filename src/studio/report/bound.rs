//! The bound of estimated positions as SVG: the word colored by it, and the room from above.

use nalgebra::Vector3;

use super::canvas::{Anchor, Canvas, Pen, Rgb};
use super::coverage::viridis;
use noctograph_core::geometry;
use noctograph_flying::plan::Plan;
use noctograph_flying::sensors::UwbOptions;
use noctograph_flying::sim::Bound;

/// Width of each of the two views, their margin, and the width of the legend.
const VIEW_PX: f64 = 420.0;
const MARGIN_PX: f64 = 56.0;
const LEGEND_PX: f64 = 130.0;
/// Height of capitals.
const CAP_PX: f64 = 9.0;
const BLUE: Rgb = [0, 114, 178];
const VERMILION: Rgb = [213, 94, 0];
/// Between two points of the drawn path.
const STEP_S: f64 = 0.05;

/// A view of the world along one axis.
struct View {
    left_px: f64,
    top_px: f64,
    px_per_m: f64,
    /// Least horizontal and greatest vertical coordinate.
    corner_m: [f64; 2],
}

impl View {
    /// A view of these points, its upper left corner at `left_px`.
    fn new(points: &[[f64; 2]], left_px: f64, top_px: f64) -> Self {
        let [left, bottom, right, top] = geometry::bounds(points.iter().copied());
        let span_m = (right - left).max(top - bottom).max(0.1);
        let corner_m = [0.5 * (left + right) - 0.5 * span_m, 0.5 * (bottom + top) + 0.5 * span_m];
        Self { left_px, top_px, px_per_m: VIEW_PX / span_m, corner_m }
    }

    fn px(&self, [across, up]: [f64; 2]) -> [f64; 2] {
        [
            self.left_px + (across - self.corner_m[0]) * self.px_per_m,
            self.top_px + (self.corner_m[1] - up) * self.px_per_m,
        ]
    }

    /// The end at which a label is anchored so that it stays within the view.
    fn anchor(&self, x_px: f64) -> Anchor {
        if x_px > self.left_px + 0.5 * VIEW_PX { Anchor::End } else { Anchor::Start }
    }
}

/// Draws the strokes of all drones colored by the bound, and beside them the anchors from above
/// with the best place of one more.
#[must_use]
pub fn bound_map(
    plans: &[&Plan],
    bounds: &[Bound],
    uwb: &UwbOptions,
    one_more_m: [f64; 3],
) -> String {
    let flown_m = plans.iter().flat_map(|plan| &plan.setpoints).map(|s| s.position_m);
    let flown_m: Vec<Vector3<f64>> = flown_m.collect();
    let front: Vec<[f64; 2]> = flown_m.iter().map(|p| [p.x, p.z]).collect();
    let flown_m = flown_m.iter().map(|p| [p.x, p.y]);
    let anchors_m = uwb.anchors_m.iter().chain([&one_more_m]).map(|[x, y, _]| [*x, *y]);
    let above: Vec<[f64; 2]> = flown_m.chain(anchors_m).collect();
    let front = View::new(&front, MARGIN_PX, MARGIN_PX);
    let above = View::new(&above, 2.0 * MARGIN_PX + VIEW_PX, MARGIN_PX);

    let width = 3.0 * MARGIN_PX + 2.0 * VIEW_PX + LEGEND_PX;
    let height = 2.0 * MARGIN_PX + VIEW_PX;
    let mut canvas = Canvas::white([width, height]);
    let title = "best possible estimate along the strokes, seen from the front";
    label(&mut canvas, [MARGIN_PX, 30.0], title);
    label(&mut canvas, [above.left_px, 30.0], "anchors and flight, seen from above");
    let scale = Scale::new(bounds);
    for (plan, bound) in plans.iter().zip(bounds) {
        draw_strokes(&mut canvas, &front, plan, bound, &scale);
        let points = plan.setpoints.iter().map(|s| above.px([s.position_m.x, s.position_m.y]));
        canvas.line(points, Pen::new([136; 3], 1.0));
    }
    draw_anchors(&mut canvas, &above, uwb, plans.len());
    let [x_m, y_m, z_m] = one_more_m;
    let [x, y] = above.px([x_m, y_m]);
    canvas.ring([x, y], 7.0, Pen::new(VERMILION, 3.0));
    let text = format!("one more here: z {z_m:.1} m");
    canvas.text(text, [x, y + 22.0], above.anchor(x), CAP_PX, VERMILION);
    draw_legend(&mut canvas, &scale);
    canvas.svg()
}

/// Colors from the least to the greatest bound of a lit stroke.
struct Scale {
    least_m: f64,
    most_m: f64,
}

impl Scale {
    fn new(bounds: &[Bound]) -> Self {
        let samples = bounds.iter().flat_map(|bound| bound.sigma_m.iter().zip(&bound.letter));
        let lit_m = samples.filter(|(_, letter)| letter.is_some()).map(|(sigma_m, _)| *sigma_m);
        let (least_m, most_m) = lit_m
            .fold((f64::INFINITY, 0.0_f64), |(least_m, most_m), sigma_m| {
                (least_m.min(sigma_m), most_m.max(sigma_m))
            });
        if least_m > most_m { Self { least_m: 0.0, most_m: 1.0 } } else { Self { least_m, most_m } }
    }

    fn color(&self, sigma_m: f64) -> Rgb {
        viridis((sigma_m - self.least_m) / (self.most_m - self.least_m).max(1e-6))
    }
}

fn label(canvas: &mut Canvas<'_>, at: [f64; 2], text: &str) {
    canvas.text(text, at, Anchor::Start, CAP_PX, [0; 3]);
}

/// A drone's way from the front: lit strokes in the color of their bound, the rest thin.
fn draw_strokes(canvas: &mut Canvas<'_>, front: &View, plan: &Plan, bound: &Bound, scale: &Scale) {
    let mut shown_s = f64::NEG_INFINITY;
    let mut before: Option<[f64; 2]> = None;
    for ((time_s, sigma_m), letter) in bound.time_s.iter().zip(&bound.sigma_m).zip(&bound.letter) {
        if time_s - shown_s < STEP_S {
            continue;
        }
        shown_s = *time_s;
        let place_m = plan.design_m(*time_s);
        let at = front.px([place_m.x, place_m.z]);
        if let Some(from) = before {
            let pen = match letter {
                Some(_) => Pen::new(scale.color(*sigma_m), 6.0),
                None => Pen::new([221; 3], 1.0),
            };
            canvas.line([from, at], pen);
        }
        before = Some(at);
    }
}

/// The anchors from above, each with its height and the number of drones that hear it.
fn draw_anchors(canvas: &mut Canvas<'_>, above: &View, uwb: &UwbOptions, n_drones: usize) {
    for (index, [x_m, y_m, z_m]) in uwb.anchors_m.iter().enumerate() {
        let [x, y] = above.px([*x_m, *y_m]);
        let hears = |list: &&Vec<usize>| list.contains(&index);
        let n = match uwb.heard.is_empty() {
            true => n_drones,
            false => uwb.heard.iter().filter(hears).count(),
        };
        let by = if n == n_drones { "all".to_owned() } else { n.to_string() };
        // Anchors on one pole have a line each.
        let near = |[other_x_m, other_y_m, _]: &&[f64; 3]| {
            libm::hypot(other_x_m - x_m, other_y_m - y_m) * above.px_per_m < 80.0
        };
        let line = uwb.anchors_m[..index].iter().filter(near).count();
        let down_px = if line == 0 { -10.0 } else { 4.0 + 16.0 * line as f64 };
        canvas.dot([x, y], 6.0, BLUE);
        let text = format!("{index}: z {z_m:.1} m, heard by {by}");
        canvas.text(text, [x, y + down_px], above.anchor(x), CAP_PX, [0; 3]);
    }
}

fn draw_legend(canvas: &mut Canvas<'_>, scale: &Scale) {
    let x = 3.0 * MARGIN_PX + 2.0 * VIEW_PX - 20.0;
    label(canvas, [x, MARGIN_PX], "1 \u{3c3} over 3 axes");
    for step in 0..=5 {
        let share = f64::from(step) / 5.0;
        let y = MARGIN_PX + 14.0 + 20.0 * f64::from(step);
        let sigma_m = scale.least_m + share * (scale.most_m - scale.least_m);
        canvas.cell([x, y, x + 18.0, y + 20.0], viridis(share));
        label(canvas, [x + 26.0, y + 15.0], &format!("{:.1} cm", 100.0 * sigma_m));
    }
}
