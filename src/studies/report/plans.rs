//! Draws plans: lit strokes, dark transits, speeds and times.

use super::canvas::{Pen, Rgb};
use super::figure::{Curve, Mark};
use super::flights::View;
use noctograph_plan::Plan;

/// Colors of speed ranges, with their upper ends as fractions of the maximum lit speed.
const SPEEDS: [(f64, Rgb); 4] = [
    (0.25, [204, 51, 17]),
    (0.5, [238, 153, 51]),
    (0.9, [51, 160, 120]),
    (f64::INFINITY, [0, 84, 160]),
];
const LIT_PX: f64 = 4.5;
const DARK: Pen = Pen::new([120, 120, 120], 1.5);
/// Length of a dash of a dark path, including the gap that follows.
const DASH_M: f64 = 0.03;
/// Maximum number of strokes that are labeled with times. More labels would be illegible.
const MOST_TIMES: usize = 80;

/// Returns an SVG of a word's plans as seen from the front. Lit strokes are colored by speed, dark
/// paths are dashed, and marks show the start time of each stroke, and the take-offs and landings.
/// `numbers` contains a drawing's stroke numbers and their positions. Panics without setpoints.
pub fn plan_view(plans: &[Plan], word: &str, numbers: &[(usize, [f64; 2])]) -> String {
    assert!(plans.iter().any(|plan| !plan.setpoints.is_empty()), "a plan to draw");
    let lines: Vec<Line> = plans.iter().flat_map(lines).collect();
    let lit_m_s = lines.iter().filter(|line| line.lit).map(|line| line.speed_m_s);
    // The initial value is positive, so that the slowest range is never empty.
    let fastest_m_s = lit_m_s.fold(1e-9, f64::max);
    // Dark paths are drawn first, followed by one curve for each range of lit speeds that occurs.
    let dashes = lines.iter().filter(|l| !l.lit && l.along_m.rem_euclid(DASH_M) < 0.5 * DASH_M);
    let mut curves = vec![Curve { pen: DARK, pieces: pieces(dashes) }];
    let mut legend = vec![("dark".to_owned(), DARK)];
    let mut low_m_s = 0.0;
    for (fraction, color) in SPEEDS {
        let range_m_s = low_m_s..fraction * fastest_m_s;
        low_m_s = range_m_s.end;
        // The factor makes each range include its upper end.
        let in_range = lines
            .iter()
            .filter(|line| line.lit && range_m_s.contains(&(line.speed_m_s * (1.0 - 1e-9))));
        let pieces = pieces(in_range);
        if pieces.is_empty() {
            continue;
        }
        let pen = Pen::new(color, LIT_PX);
        let name = if range_m_s.end.is_finite() {
            format!("below {:.2} m/s", range_m_s.end)
        } else {
            format!("to {fastest_m_s:.2} m/s")
        };
        legend.push((name, pen));
        curves.push(Curve { pen, pieces });
    }
    let longest_s = plans.iter().map(|plan| plan.duration_s()).fold(0.0, f64::max);
    let marks = plans.iter().enumerate().flat_map(|(i, plan)| marks(plan, i, plans.len()));
    let shown = if numbers.len() <= MOST_TIMES { numbers } else { &[] };
    let numbers = shown
        .iter()
        .map(|(number, [x, y])| Mark { place: (*x, *y), text: format!("no. {number}") });
    View { curves, marks: marks.chain(numbers).collect(), legend }
        .svg_from_front(&format!("{word}, planned: {longest_s:.1} s"))
}

/// Returns x and z of one of a plan's setpoints.
fn place(plan: &Plan, row: usize) -> (f64, f64) {
    let position_m = plan.setpoints[row].position_m;
    (position_m.x, position_m.z)
}

/// Length of the line drawn for a point of light, and maximum size of such a point.
const DOT_M: f64 = 0.008;

/// A straight segment of the design as seen from the front.
#[derive(Clone)]
struct Line {
    from: (f64, f64),
    to: (f64, f64),
    lit: bool,
    speed_m_s: f64,
    /// Path length from take-off to this line, which determines the dashes.
    along_m: f64,
}

/// Returns the lines of a plan: its lit strokes, its dark transits, and its points of light.
fn lines(plan: &Plan) -> Vec<Line> {
    let lit = plan.lit();
    [segment_lines(plan, &lit), dots(plan, &lit)].concat()
}

/// Returns the lines between consecutive setpoints. `lit` contains the lamp level of each setpoint.
/// A lit segment becomes one line, and a dark one is divided into lines that are half as long as a
/// dash with its gap. A drone at rest draws nothing.
fn segment_lines(plan: &Plan, lit: &[f64]) -> Vec<Line> {
    let (mut lines, mut segment_along_m) = (Vec::new(), 0.0);
    for (row, pair) in plan.setpoints.windows(2).enumerate() {
        let (from, to, lit) = (place(plan, row), place(plan, row + 1), lit[row] > 0.0);
        let length_m = libm::hypot(to.0 - from.0, to.1 - from.1);
        let speed_m_s = length_m / (pair[1].time_s - pair[0].time_s);
        // A segment during which the drone rests has no line.
        if length_m > 1e-9 {
            #[expect(clippy::cast_possible_truncation, reason = "kilometers")]
            let n = if lit { 1 } else { (length_m / DASH_M * 2.0).ceil() as u32 };
            lines.extend((0..n).map(|part| {
                let [from, to] = [part, part + 1]
                    .map(|end| f64::from(end) / f64::from(n))
                    .map(|t| (from.0 + (to.0 - from.0) * t, from.1 + (to.1 - from.1) * t));
                let along_m = segment_along_m + length_m * f64::from(part) / f64::from(n);
                Line { from, to, lit, speed_m_s, along_m }
            }));
        }
        segment_along_m += length_m;
    }
    lines
}

/// Returns a short line for each point of light, which is a lit stroke too short to be visible.
fn dots(plan: &Plan, lit: &[f64]) -> Vec<Line> {
    let mut lines = Vec::new();
    let rows: Vec<usize> = (0..lit.len()).filter(|row| lit[*row] > 0.0).collect();
    for stroke in rows.chunk_by(|a, b| a + 1 == *b) {
        let (x, z) = place(plan, stroke[0]);
        let mut others = stroke.iter().map(|row| place(plan, *row));
        if others.all(|(other_x, other_z)| libm::hypot(other_x - x, other_z - z) < DOT_M) {
            let (from, to) = ((x - 0.5 * DOT_M, z), (x + 0.5 * DOT_M, z));
            // Points are drawn in the color of the lowest speed.
            lines.push(Line { from, to, lit: true, speed_m_s: 1e-6, along_m: 0.0 });
        }
    }
    lines
}

/// Joins lines into the pieces of a curve, each a list of points `(x, z)` in m. A line that does
/// not begin where the last one ended begins a new piece.
fn pieces<'a>(lines: impl Iterator<Item = &'a Line>) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    for line in lines {
        match pieces.last_mut().filter(|piece| piece.last() == Some(&line.from)) {
            Some(piece) => piece.push(line.to),
            None => pieces.push(vec![line.from, line.to]),
        }
    }
    pieces
}

/// Returns marks with the start times of strokes, and marks at the start and end of the flight.
/// `index` is that of the drone among `n_plans`, and is shown if there are several.
fn marks(plan: &Plan, index: usize, n_plans: usize) -> Vec<Mark> {
    let lit = plan.lit();
    let drone = if n_plans > 1 { format!("{}: ", index + 1) } else { String::new() };
    let begins = (0..lit.len()).filter(|row| lit[*row] > 0.0 && (*row == 0 || lit[row - 1] == 0.0));
    let mut texts: Vec<(usize, String)> =
        begins.map(|row| (row, format!("{:.1} s", plan.setpoints[row].time_s))).collect();
    if texts.len() > MOST_TIMES {
        texts.clear();
    }
    if let Some(last) = plan.setpoints.len().checked_sub(1) {
        texts.push((0, format!("{drone}start")));
        texts.push((last, format!("{drone}end {:.1} s", plan.duration_s())));
    }
    texts.into_iter().map(|(row, text)| Mark { place: place(plan, row), text }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};

    #[test]
    fn the_drawing_says_when_each_stroke_begins_and_how_fast_it_is() {
        let strokes = write("NE", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::even()).unwrap();
        let svg = plan_view(std::slice::from_ref(&plan), "NE", &[]);
        assert!(svg.contains("start") && svg.contains("to 0.20 m/s"), "legend and marks");
        let lit = plan.lit();
        let first = (0..lit.len()).find(|row| lit[*row] > 0.0).unwrap();
        assert!(svg.contains(&format!("{:.1} s", plan.setpoints[first].time_s)));
        let lit_m: f64 = lines(&plan)
            .iter()
            .filter(|line| line.lit)
            .map(|line| libm::hypot(line.to.0 - line.from.0, line.to.1 - line.from.1))
            .sum();
        assert!((lit_m - (1.583_095 + 1.1 + 0.3)).abs() < 0.06, "{lit_m} m of light");
    }

    #[test]
    fn a_point_of_light_is_drawn_as_long_as_can_be_seen() {
        let options = LetterOptions { font: "simplex".into(), ..LetterOptions::default() };
        let plan = plan(&write("i", &options).unwrap(), &PlanOptions::even()).unwrap();
        let lit = lines(&plan).into_iter().filter(|line| line.lit);
        let dots = lit.filter(|line| (line.to.0 - line.from.0 - DOT_M).abs() < 1e-9);
        assert_eq!(dots.count(), 1, "the dot of the i");
    }
}
