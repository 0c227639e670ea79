//! The bound of estimated positions as SVG: the word colored by it, and the room from above.

use std::fmt::Write;

use nalgebra::Vector3;

use super::coverage::viridis;
use crate::plan::Plan;
use crate::sim::{Bound, UwbOptions};

/// Width of each of the two views, their margin, and the width of the legend.
const VIEW_PX: f64 = 420.0;
const MARGIN_PX: f64 = 56.0;
const LEGEND_PX: f64 = 130.0;
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
        let fold = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
            points.iter().map(|p| p[axis]).fold(start, pick)
        };
        let low = [0, 1].map(|axis| fold(axis, f64::min, f64::INFINITY));
        let high = [0, 1].map(|axis| fold(axis, f64::max, f64::NEG_INFINITY));
        let span_m = (high[0] - low[0]).max(high[1] - low[1]).max(0.1);
        let middle = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
        let corner_m = [middle[0] - 0.5 * span_m, middle[1] + 0.5 * span_m];
        Self { left_px, top_px, px_per_m: VIEW_PX / span_m, corner_m }
    }

    fn px(&self, [across, up]: [f64; 2]) -> [f64; 2] {
        [
            self.left_px + (across - self.corner_m[0]) * self.px_per_m,
            self.top_px + (self.corner_m[1] - up) * self.px_per_m,
        ]
    }
}

/// Draws the strokes of all drones colored by the bound, and beside them the anchors from above with
/// the best place of one more.
#[must_use]
pub fn bound_map(
    plans: &[&Plan],
    bounds: &[Bound],
    uwb: &UwbOptions,
    one_more_m: [f64; 3],
) -> String {
    let lit = |bound: &Bound| -> Vec<f64> {
        let pairs = bound.sigma_m.iter().zip(&bound.letter);
        pairs.filter(|(_, letter)| letter.is_some()).map(|(sigma_m, _)| *sigma_m).collect()
    };
    let mut sigmas_m: Vec<f64> = bounds.iter().flat_map(lit).collect();
    sigmas_m.sort_by(f64::total_cmp);
    let least_m = sigmas_m.first().copied().unwrap_or(0.0);
    let most_m = sigmas_m.last().copied().unwrap_or(1.0);
    let color = |sigma_m: f64| viridis((sigma_m - least_m) / (most_m - least_m).max(1e-6));
    let paths = plans.iter().flat_map(|plan| &plan.setpoints).map(|s| s.position_m);
    let paths: Vec<Vector3<f64>> = paths.collect();
    let anchors: Vec<Vector3<f64>> = uwb.anchors_m.iter().map(|a| Vector3::from(*a)).collect();
    let more = Vector3::from(one_more_m);
    let front: Vec<[f64; 2]> = paths.iter().map(|p| [p.x, p.z]).collect();
    let above = paths.iter().chain(&anchors).chain([&more]).map(|p| [p.x, p.y]);
    let front = View::new(&front, MARGIN_PX, MARGIN_PX);
    let above = View::new(&above.collect::<Vec<_>>(), 2.0 * MARGIN_PX + VIEW_PX, MARGIN_PX);

    let width = 3.0 * MARGIN_PX + 2.0 * VIEW_PX + LEGEND_PX;
    let height = 2.0 * MARGIN_PX + VIEW_PX;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let label =
        |x: f64, y: f64, text: &str| format!("<text x=\"{x:.1}\" y=\"{y:.1}\">{text}</text>\n");
    svg += &label(MARGIN_PX, 30.0, "best possible estimate along the strokes, seen from the front");
    svg += &label(above.left_px, 30.0, "anchors and flight, seen from above");
    for (plan, bound) in plans.iter().zip(bounds) {
        let mut shown_s = f64::NEG_INFINITY;
        let mut before: Option<[f64; 2]> = None;
        for ((time_s, sigma_m), letter) in
            bound.time_s.iter().zip(&bound.sigma_m).zip(&bound.letter)
        {
            if time_s - shown_s < STEP_S {
                continue;
            }
            shown_s = *time_s;
            let place_m = plan.design_m(*time_s);
            let at = front.px([place_m.x, place_m.z]);
            if let Some(from) = before {
                let (stroke, width_px) = match letter {
                    Some(_) => (color(*sigma_m), 6.0),
                    None => ("#dddddd".to_owned(), 1.0),
                };
                let _ = writeln!(
                    svg,
                    "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{stroke}\" \
                     stroke-width=\"{width_px}\" stroke-linecap=\"round\"/>",
                    from[0], from[1], at[0], at[1]
                );
            }
            before = Some(at);
        }
        let ends = plan.setpoints.iter().map(|s| above.px([s.position_m.x, s.position_m.y]));
        let line: Vec<String> = ends.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"#888888\"/>",
            line.join(" ")
        );
    }
    for (index, anchor) in anchors.iter().enumerate() {
        let [x, y] = above.px([anchor.x, anchor.y]);
        let heard = |list: &&Vec<usize>| list.contains(&index);
        let n =
            if uwb.heard.is_empty() { plans.len() } else { uwb.heard.iter().filter(heard).count() };
        let by = if n == plans.len() { "all".to_owned() } else { n.to_string() };
        let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\" fill=\"#0072b2\"/>");
        let text = format!("{index}: z {:.1} m, heard by {by}", anchor.z);
        let anchored = if x > above.left_px + 0.5 * VIEW_PX { "end" } else { "start" };
        // Anchors on one pole have a line each.
        let near = |other: &&Vector3<f64>| (other.xy() - anchor.xy()).norm() * above.px_per_m < 80.0;
        let line = anchors[..index].iter().filter(near).count();
        #[expect(clippy::cast_precision_loss, reason = "a few anchors")]
        let down_px = if line == 0 { -10.0 } else { 4.0 + 16.0 * line as f64 };
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"{anchored}\">{text}</text>",
            y + down_px
        );
    }
    let [x, y] = above.px([more.x, more.y]);
    let anchored = if x > above.left_px + 0.5 * VIEW_PX { "end" } else { "start" };
    let _ = writeln!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"7\" fill=\"none\" stroke=\"#d55e00\" \
         stroke-width=\"3\"/>\n<text x=\"{x:.1}\" y=\"{:.1}\" fill=\"#d55e00\" \
         text-anchor=\"{anchored}\">one more here: z {:.1} m</text>",
        y + 22.0,
        more.z
    );
    let x = 3.0 * MARGIN_PX + 2.0 * VIEW_PX - 20.0;
    svg += &label(x, MARGIN_PX, "1 \u{3c3} over 3 axes");
    for step in 0..=5 {
        let share = f64::from(step) / 5.0;
        let (y, sigma_m) =
            (MARGIN_PX + 14.0 + 20.0 * f64::from(step), least_m + share * (most_m - least_m));
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"18\" height=\"20\" fill=\"{}\"/>",
            viridis(share)
        );
        svg += &label(x + 26.0, y + 15.0, &format!("{:.1} cm", 100.0 * sigma_m));
    }
    svg + "</svg>\n"
}
