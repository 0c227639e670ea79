//! The drawing of a plan: what is lit, what is dark, how fast, and when.

use super::canvas::{Pen, Rgb};
use super::figure::{Curve, Mark};
use super::flights::View;
use noctograph_plan::Plan;

/// Lit speeds as shares of the fastest, and their colors from slow to fast.
const SPEEDS: [(f64, Rgb); 4] = [
    (0.25, [204, 51, 17]),
    (0.5, [238, 153, 51]),
    (0.9, [51, 160, 120]),
    (f64::INFINITY, [0, 84, 160]),
];
const LIT_PX: f64 = 4.5;
const DARK: Pen = Pen::new([120, 120, 120], 1.5);
/// A dash and the gap after it, together; a dark way is drawn in its first half.
const DASH_M: f64 = 0.03;
/// Strokes beyond this number have no times beside them: nobody could read them.
const MOST_TIMES: usize = 80;

/// The plans of one word from the front: lit strokes colored by speed, dark ways dashed, the time
/// at which each stroke begins, and where drones start and land; and the numbers of the strokes of
/// a drawing. SVG.
///
/// # Panics
///
/// If there is no setpoint.
pub fn plan_view(plans: &[Plan], word: &str, numbers: &[(usize, [f64; 2])]) -> String {
    assert!(plans.iter().any(|plan| !plan.setpoints.is_empty()), "a plan to draw");
    let lines: Vec<Line> = plans.iter().flat_map(lines).collect();
    let lit_speeds = lines.iter().filter(|line| line.lit).map(|line| line.speed_m_s);
    let fastest_m_s = lit_speeds.fold(1e-9, f64::max);
    let dashed = |line: &&Line| !line.lit && line.along_m.rem_euclid(DASH_M) < 0.5 * DASH_M;
    let mut curves = vec![Curve { pen: DARK, pieces: pieces(lines.iter().filter(dashed)) }];
    let mut legend = vec![("dark".to_owned(), DARK)];
    let mut slower = 0.0;
    for (share, color) in SPEEDS {
        let (from, to) = (slower * fastest_m_s, share * fastest_m_s);
        slower = share;
        let of_speed =
            |line: &&Line| line.lit && (from..to).contains(&(line.speed_m_s * (1.0 - 1e-9)));
        let pieces = pieces(lines.iter().filter(of_speed));
        if pieces.is_empty() {
            continue;
        }
        let pen = Pen::new(color, LIT_PX);
        let name = match to.is_finite() {
            true => format!("below {to:.2} m/s"),
            false => format!("to {fastest_m_s:.2} m/s"),
        };
        legend.push((name, pen));
        curves.push(Curve { pen, pieces });
    }
    let longest_s = plans.iter().map(|plan| plan.duration_s()).fold(0.0, f64::max);
    let marks = plans.iter().enumerate().flat_map(|(i, plan)| marks(plan, i, plans.len()));
    let shown = if numbers.len() <= MOST_TIMES { numbers } else { &[] };
    let number = |(number, [x, y]): &(usize, [f64; 2])| Mark {
        place: (*x, *y),
        text: format!("no. {number}"),
    };
    let marks = marks.chain(shown.iter().map(number)).collect();
    View { curves, marks, legend }.svg_from_front(&format!("{word}, planned: {longest_s:.1} s"))
}

/// Where a plan's setpoint is seen from the front.
fn place(plan: &Plan, row: usize) -> (f64, f64) {
    let position_m = plan.setpoints[row].position_m;
    (position_m.x, position_m.z)
}

/// Length of the line that shows a point of light, and largest extent of one.
const DOT_M: f64 = 0.008;

/// A short piece of the design.
struct Line {
    from: (f64, f64),
    to: (f64, f64),
    lit: bool,
    speed_m_s: f64,
    /// Way since take-off.
    along_m: f64,
}

/// Lit strokes and dark transits of a plan as lines.
fn lines(plan: &Plan) -> Vec<Line> {
    let lit = plan.lit();
    let mut lines: Vec<Line> = Vec::new();
    let mut along_m = 0.0;
    for (row, pair) in plan.setpoints.windows(2).enumerate() {
        let (from, to, lit) = (place(plan, row), place(plan, row + 1), lit[row] > 0.0);
        let length_m = libm::hypot(to.0 - from.0, to.1 - from.1);
        let speed_m_s = length_m / (pair[1].time_s - pair[0].time_s);
        let n = if lit { 1.0 } else { (length_m / DASH_M * 2.0).ceil() };
        let point = |part: f64| (from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part);
        let mut part = 0.0;
        while part < n && length_m > 1e-9 {
            let (from, to) = (point(part / n), point((part + 1.0) / n));
            let along_m = along_m + length_m * part / n;
            lines.push(Line { from, to, lit, speed_m_s, along_m });
            part += 1.0;
        }
        along_m += length_m;
    }
    // A short line for each stroke that has no length to be seen: a point of light.
    let rows: Vec<usize> = (0..lit.len()).filter(|row| lit[*row] > 0.0).collect();
    for stroke in rows.chunk_by(|a, b| a + 1 == *b) {
        let (x, z) = place(plan, stroke[0]);
        let is_near = |(other_x, other_z)| libm::hypot(other_x - x, other_z - z) < DOT_M;
        if stroke.iter().all(|row| is_near(place(plan, *row))) {
            let (from, to) = ((x - 0.5 * DOT_M, z), (x + 0.5 * DOT_M, z));
            lines.push(Line { from, to, lit: true, speed_m_s: 1e-6, along_m: 0.0 });
        }
    }
    lines
}

/// Lines that follow each other, as pieces of a curve.
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

/// When each stroke begins, and where the drone starts and lands.
fn marks(plan: &Plan, index: usize, n_plans: usize) -> Vec<Mark> {
    let lit = plan.lit();
    let mark = |row: usize, text: String| Mark { place: place(plan, row), text };
    let whose = if n_plans > 1 { format!("{}: ", index + 1) } else { String::new() };
    let begins = (0..lit.len()).filter(|row| lit[*row] > 0.0 && (*row == 0 || lit[row - 1] == 0.0));
    let times = begins.map(|row| mark(row, format!("{:.1} s", plan.setpoints[row].time_s)));
    let mut marks: Vec<Mark> = times.collect();
    if marks.len() > MOST_TIMES {
        marks.clear();
    }
    if let Some(last) = plan.setpoints.len().checked_sub(1) {
        marks.push(mark(0, format!("{whose}start")));
        marks.push(mark(last, format!("{whose}end {:.1} s", plan.duration_s())));
    }
    marks
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
        let long = |line: &&Line| line.lit && (line.to.0 - line.from.0 - DOT_M).abs() < 1e-9;
        assert_eq!(lines(&plan).iter().filter(long).count(), 1, "the dot of the i");
    }
}
