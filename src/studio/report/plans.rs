//! The drawing of a plan: what is lit, what is dark, how fast, and when.

use super::canvas::{Pen, Rgb};
use super::figure::{Curve, Mark};
use super::flights::View;
use noctograph_flying::plan::Plan;

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
#[must_use]
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
        let name = if to.is_finite() {
            format!("below {to:.2} m/s")
        } else {
            format!("to {fastest_m_s:.2} m/s")
        };
        legend.push((name, pen));
        curves.push(Curve { pen, pieces });
    }
    let longest_s = plans.iter().map(Plan::duration_s).fold(0.0, f64::max);
    let marks = plans.iter().enumerate().flat_map(|(i, plan)| marks(plan, i, plans.len()));
    let shown = if numbers.len() <= MOST_TIMES { numbers } else { &[] };
    let number =
        |(number, [x, y]): &(usize, [f64; 2])| Mark { at: (*x, *y), text: format!("no. {number}") };
    let view = View::of(curves, legend, marks.chain(shown.iter().map(number)).collect());
    let ranges = view.ranges();
    view.svg(&format!("{word}, planned: {longest_s:.1} s"), "z (m)", ranges)
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

fn lines(plan: &Plan) -> Vec<Line> {
    let lit = plan.lit();
    let mut lines: Vec<Line> = Vec::new();
    let mut along_m = 0.0;
    for (pair, lit) in plan.setpoints.windows(2).zip(&lit) {
        let [from, to] = [&pair[0], &pair[1]].map(|s| (s.position_m.x, s.position_m.z));
        let length_m = libm::hypot(to.0 - from.0, to.1 - from.1);
        let n = if *lit > 0.0 { 1.0 } else { (length_m / DASH_M * 2.0).ceil() };
        let at = |part: f64| (from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part);
        let mut part = 0.0;
        while part < n && length_m > 1e-9 {
            lines.push(Line {
                from: at(part / n),
                to: at((part + 1.0) / n),
                lit: *lit > 0.0,
                speed_m_s: length_m / (pair[1].time_s - pair[0].time_s),
                along_m: along_m + length_m * part / n,
            });
            part += 1.0;
        }
        along_m += length_m;
    }
    lines.extend(dots(plan, &lit));
    lines
}

/// A short line for each stroke that has no length to be seen: a point of light.
fn dots<'a>(plan: &'a Plan, lit: &'a [f64]) -> impl Iterator<Item = Line> + 'a {
    let rows: Vec<usize> = (0..lit.len()).filter(|row| lit[*row] > 0.0).collect();
    let runs: Vec<Vec<usize>> = rows.chunk_by(|a, b| a + 1 == *b).map(<[usize]>::to_vec).collect();
    runs.into_iter().filter_map(|run| {
        let place =
            |row: &usize| (plan.setpoints[*row].position_m.x, plan.setpoints[*row].position_m.z);
        let (x, z) = place(&run[0]);
        let is_still = |row: &usize| libm::hypot(place(row).0 - x, place(row).1 - z) < DOT_M;
        let (half, speed_m_s) = (0.5 * DOT_M, 1e-6);
        run.iter().all(is_still).then_some(Line {
            from: (x - half, z),
            to: (x + half, z),
            lit: true,
            speed_m_s,
            along_m: 0.0,
        })
    })
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
    let at = |row: usize| (plan.setpoints[row].position_m.x, plan.setpoints[row].position_m.z);
    let whose = if n_plans > 1 { format!("{}: ", index + 1) } else { String::new() };
    let begins = (0..lit.len()).filter(|row| lit[*row] > 0.0 && (*row == 0 || lit[row - 1] == 0.0));
    let begins: Vec<usize> = begins.collect();
    let mut marks = Vec::new();
    if begins.len() <= MOST_TIMES {
        marks.extend(
            begins.into_iter().map(|row| Mark {
                at: at(row),
                text: format!("{:.1} s", plan.setpoints[row].time_s),
            }),
        );
    }
    if let Some(last) = plan.setpoints.len().checked_sub(1) {
        let end_s = plan.duration_s();
        marks.push(Mark { at: at(0), text: format!("{whose}start") });
        marks.push(Mark { at: at(last), text: format!("{whose}end {end_s:.1} s") });
    }
    marks
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_flying::plan::{PlanOptions, plan};
    use noctograph_letters::{LetterOptions, write};

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
