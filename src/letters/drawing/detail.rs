//! Reduces a drawing to fewer, longer and smoother strokes.

use super::super::smooth::{simplified, smooth};
use super::super::vector::{direction, dot};
use super::ColoredLine;
use super::layers::Color;
use crate::LeftOut;
use noctograph_core::error::Result;
use noctograph_core::files::Budget;
use noctograph_core::geometry::{distance, polyline_length_m};

/// Limits for the least detail, relative to the drawing's larger side: minimum length of a stroke,
/// maximum gap between joined strokes, and maximum distance by which smoothing moves a line.
const SHORTEST: f64 = 0.25;
const GAP: f64 = 0.03;
const BEND: f64 = 0.01;

/// Maximum distance between the resulting polyline and a smoothed line, relative to the smoothing
/// distance.
const FLATNESS: f64 = 0.1;

/// Cosine of the maximum turn between two strokes that are joined: 60°.
const STRAIGHT: f64 = 0.5;

/// Number of smoothed points along the larger side.
const POINTS: f64 = 200.0;

/// Budget steps for comparing a pair of lines, and for smoothing a point.
const STEPS_PER_PAIR: usize = 10;
const STEPS_PER_POINT: usize = 500;

/// Returns less detailed lines of a drawing whose larger side is `size`, and the amount that is
/// left out. Lines that continue each other are joined, short lines are dropped, and the rest is
/// smoothed. A `detail` of 1 keeps everything, and 0 keeps the least.
pub(super) fn reduced(
    lines: Vec<ColoredLine>,
    detail: f64,
    size: f64,
    file: &str,
) -> Result<(Vec<ColoredLine>, LeftOut)> {
    let roughness = (1.0 - detail) * size;
    if roughness <= 0.0 {
        return Ok((lines, LeftOut::default()));
    }
    // Lines are joined before short ones are dropped, because many short lines may form a long one.
    let total: f64 = lines.iter().map(|(line, _)| polyline_length_m(line)).sum();
    let budget = Budget::new(file, "draw less, or raise letters.detail");
    budget.steps(STEPS_PER_PAIR.saturating_mul(lines.len().saturating_mul(lines.len())))?;
    let lines = joined(lines, GAP * roughness);
    let longest = lines.iter().map(|(line, _)| polyline_length_m(line)).fold(0.0, f64::max);
    // The longest line is kept, whatever its length.
    let shortest = (SHORTEST * roughness).min(longest);
    let (mut lines, short): (Vec<_>, Vec<_>) =
        lines.into_iter().partition(|(line, _)| polyline_length_m(line) >= shortest);
    let dropped: f64 = short.iter().map(|(line, _)| polyline_length_m(line)).sum();
    for (line, _) in &mut lines {
        budget.steps(STEPS_PER_POINT * line.len())?;
        *line =
            simplified(&smooth(line, size / POINTS, BEND * roughness), FLATNESS * BEND * roughness);
    }
    let dropped_fraction = if total > 0.0 { dropped / total } else { 0.0 };
    Ok((lines, LeftOut { strokes: short.len(), length_fraction: dropped_fraction }))
}

/// Joins lines of one color that continue each other across less than `gap`, in the lines' unit.
fn joined(lines: Vec<ColoredLine>, gap: f64) -> Vec<ColoredLine> {
    let mut remaining: Vec<Option<ColoredLine>> = lines.into_iter().map(Some).collect();
    let mut joined = Vec::new();
    for start in 0..remaining.len() {
        let Some((mut line, color)) = remaining[start].take() else { continue };
        // The line is extended from its end, and then, after it is reversed, from its start.
        for _ in 0..2 {
            while line[0] != line[line.len() - 1]
                && let Some((index, is_backward)) = next_line(&line, color, &remaining, gap)
            {
                let (mut next, _) = remaining[index].take().expect("it was found");
                if is_backward {
                    next.reverse();
                }
                line.extend(next);
            }
            line.reverse();
        }
        joined.push((line, color));
    }
    joined
}

/// Returns the index of the nearest remaining line that continues another one at its end, and true
/// if it does so backward, from its end. Returns `None` if no line is within the gap, in the lines'
/// unit.
fn next_line(
    line: &[[f64; 2]],
    color: Color,
    remaining: &[Option<ColoredLine>],
    gap: f64,
) -> Option<(usize, bool)> {
    let end = line[line.len() - 1];
    let ahead = direction(line[line.len() - 2], end);
    let mut best = None;
    let mut nearest = gap;
    for (index, next) in remaining.iter().enumerate() {
        let Some((next, _)) = next.as_ref().filter(|(_, ink)| *ink == color) else { continue };
        let last = next.len() - 1;
        // The next line is used from its start, or backward from its end.
        for (is_backward, ends) in [(false, [0, 1]), (true, [last, last - 1])] {
            let [near, then] = ends.map(|end| next[end]);
            let is_open = next[0] != next[last];
            let apart = distance(end, near);
            if is_open && apart < nearest && dot(ahead, direction(near, then)) > STRAIGHT {
                (best, nearest) = (Some((index, is_backward)), apart);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[[f64; 2]]) -> ColoredLine {
        (points.to_vec(), [0; 3])
    }

    #[test]
    fn strokes_in_line_become_one_and_short_ones_are_left_out_and_counted() {
        let lines = vec![
            line(&[[0.0, 0.0], [40.0, 0.0]]),
            line(&[[100.0, 0.0], [41.0, 0.0]]),
            line(&[[41.0, 0.5], [41.0, 50.0]]),
            line(&[[60.0, 60.0], [62.0, 60.0]]),
        ];
        let (all, nothing) = reduced(lines.clone(), 1.0, 100.0, "a").unwrap();
        assert_eq!((all, nothing), (lines.clone(), LeftOut::default()));
        let (some, left_out) = reduced(lines.clone(), 0.5, 100.0, "a").unwrap();
        let ends: Vec<_> = some.iter().map(|(line, _)| (line[0], line[line.len() - 1])).collect();
        assert_eq!(ends, [([0.0, 0.0], [100.0, 0.0]), ([41.0, 0.5], [41.0, 50.0])]);
        let whole = 40.0 + 1.0 + 59.0 + 49.5 + 2.0;
        assert!(
            left_out.strokes == 1 && (left_out.length_fraction - 2.0 / (whole - 1.0)).abs() < 1e-12
        );
        let (few, left_out) = reduced(lines, 0.0, 400.0, "a").unwrap();
        assert_eq!((few.len(), left_out.strokes), (1, 2), "the longest stays");
    }

    #[test]
    fn less_detail_is_smoother() {
        let wobble = |k: i32| [f64::from(k), if k % 2 == 0 { 0.3 } else { -0.3 }];
        let wobbly = line(&(0..100).map(wobble).collect::<Vec<_>>());
        let n = |detail| reduced(vec![wobbly.clone()], detail, 100.0, "a").unwrap().0[0].0.len();
        assert!(n(1.0) == 100 && n(0.2) < 20, "{}", n(0.2));
    }
}
