//! Assignment of commanded light to letters, for each lit stretch.
//!
//! Light is commanded before its stroke begins, to compensate for the lamp's delays, and lasts
//! longer than the stroke if the drone lags. The light has the color of its stroke throughout.

use std::ops::Range;

use super::Plan;

/// Tolerance in s for rounding errors of a time within a stretch.
const ROUNDING_S: f64 = 1e-6;

/// Returns the index of the letter that the commanded light draws at each setpoint, or `None` in
/// the dark and for light that belongs to no letter.
pub fn light_letters(plan: &Plan) -> Vec<Option<usize>> {
    let letter = |row: usize| plan.setpoints[row].letter;
    let drawn_rows = drawn_rows((plan, &plan.commanded()), (plan, &plan.lit()));
    let letters = drawn_rows.into_iter().map(|rows| {
        // The letter is the last one that begins in the stretch or, if none does, the next one.
        let rows = rows?;
        let after = rows.end..plan.setpoints.len();
        rows.rev().chain(after).find_map(letter)
    });
    letters.collect()
}

/// Returns, for each lit setpoint of `sent`, the rows of `design` from the beginning of the lit
/// stretch up to the drawn row. Both are plans of the same strokes, with a light level per
/// setpoint.
pub(super) fn drawn_rows(
    (sent, commanded): (&Plan, &[f64]),
    (design, lit): (&Plan, &[f64]),
) -> Vec<Option<Range<usize>>> {
    let mut rows = vec![None; commanded.len()];
    let (commanded, mut strokes) = (stretches(commanded), stretches(lit));
    if strokes.len() != commanded.len() {
        // If the plans have different strokes, the drawn row is that at the same time.
        strokes = vec![0..design.setpoints.len(); commanded.len()];
    }
    // The stretches of both plans correspond in order. Within a stretch, rows correspond by the
    // time since its beginning.
    for (sent_rows, stroke) in commanded.into_iter().zip(strokes) {
        let is_whole_plan = stroke.len() == design.setpoints.len();
        let begin_s = sent.setpoints[sent_rows.start].time_s;
        let drawn_s = design.setpoints[stroke.start].time_s;
        let later_s = if is_whole_plan { 0.0 } else { begin_s - drawn_s };
        for row in sent_rows {
            let time_s = sent.setpoints[row].time_s - later_s + ROUNDING_S;
            let passed = design.setpoints[stroke.clone()].partition_point(|s| s.time_s <= time_s);
            rows[row] = Some(stroke.start..stroke.start + passed.max(1));
        }
    }
    rows
}

/// Returns the ranges of consecutive rows whose level is above zero.
pub(super) fn stretches(levels: &[f64]) -> Vec<Range<usize>> {
    let lit: Vec<usize> = (0..levels.len()).filter(|row| levels[*row] > 0.0).collect();
    let runs = lit.chunk_by(|row, next| row + 1 == *next);
    runs.map(|run| run[0]..run[run.len() - 1] + 1).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{PlanData, Setpoint};

    #[test]
    fn light_that_lags_its_stroke_keeps_the_strokes_letter() {
        // A dark segment of the second letter separates the first two strokes, and the third stroke
        // follows without a gap. The light is commanded two rows late.
        let letters = [None, Some(0), Some(0), Some(0), Some(1), Some(1), Some(2), Some(2), None];
        let lit = [0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0];
        fn late(rows: usize, values: &[f64]) -> Vec<f64> {
            let dark = std::iter::repeat_n(0.0, rows);
            dark.chain(values.iter().copied()).take(values.len() + 2).collect::<Vec<f64>>()
        }
        let letters = letters.into_iter().chain([None, None]);
        let setpoint = |(row, letter): (u32, Option<usize>)| Setpoint {
            time_s: 0.1 * f64::from(row),
            position_m: Vector3::z(),
            letter,
            ..Setpoint::default()
        };
        let mut plan = Plan::made(PlanData {
            setpoints: (0..).zip(letters).map(setpoint).collect(),
            lights: [("color-led".to_owned(), late(2, &lit))].into(),
            lit: [&lit[..], &[0.0, 0.0]].concat(),
            ..PlanData::default()
        });
        let (n, a, b, c) = (None, Some(0), Some(1), Some(2));
        assert_eq!(light_letters(&plan), [n, n, n, a, a, a, n, b, c, c, n]);
        plan.edit(|plan| plan.lit.clear());
        let by_command = light_letters(&plan);
        assert_eq!(by_command[3..6], [a, b, b], "without the design's light, that of the setpoint");
        plan.edit(|plan| plan.lit = lit.iter().map(|_| 0.0).chain([0.0, 0.0]).collect());
        assert_eq!(light_letters(&plan), by_command, "the design of another plan");
    }
}
