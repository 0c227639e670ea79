//! Levels of a picture: values pixel by pixel, averaged, closed, and the contours of one of them.

use std::collections::BTreeMap;

use crate::outline::Contour;

/// Closed contours of a level, y up, with the ink to their left: around a patch counterclockwise,
/// around a hole clockwise.
pub(super) fn contours(
    values: &[f64],
    [width, height]: [usize; 2],
    threshold: f64,
) -> Vec<Contour> {
    let value = |x: usize, y: usize| values[y * width + x] - threshold;
    // Where a contour crosses an edge of the grid, and at which edge it goes on. An edge has the
    // number of its upper or left pixel, and whether it runs downward.
    let mut next: BTreeMap<(usize, bool), (usize, bool)> = BTreeMap::new();
    for y in 0..height - 1 {
        for x in 0..width - 1 {
            let corners = [value(x, y), value(x + 1, y), value(x + 1, y + 1), value(x, y + 1)];
            let case = corners.map(|value| value > 0.0);
            if case == [false; 4] || case == [true; 4] {
                continue;
            }
            let at = y * width + x;
            let edges = [(at, false), (at + 1, true), (at + width, false), (at, true)];
            // Going clockwise around the cell, a contour enters before a corner with ink and leaves
            // after one, so that ink is to its left. Two corners with ink that face each other are
            // joined where the middle has ink.
            let joined = corners.iter().sum::<f64>() > 0.0;
            for enter in (0..4).filter(|k| !case[*k] && case[(k + 1) % 4]) {
                let turn = |step: usize| (enter + if joined { 4 - step } else { step }) % 4;
                let leave = (1..4).map(turn).find(|k| case[*k] && !case[(k + 1) % 4]);
                next.extend(leave.map(|leave| (edges[enter], edges[leave])));
            }
        }
    }
    let place = |(at, down): (usize, bool)| {
        let (x, y) = (at % width, at / width);
        let to = if down { value(x, y + 1) } else { value(x + 1, y) };
        let share = value(x, y) / (value(x, y) - to);
        let (dx, dy) = if down { (0.0, share) } else { (share, 0.0) };
        [x as f64 + dx, -(y as f64 + dy)]
    };
    let mut contours = Vec::new();
    while let Some((first, mut edge)) = next.pop_first() {
        let mut contour = vec![place(first)];
        while edge != first {
            contour.push(place(edge));
            let Some(onward) = next.remove(&edge) else { break };
            edge = onward;
        }
        contours.push(contour);
    }
    contours
}

/// Each pixel averaged with its neighbors, 1 2 1 in both directions: noise has no contours.
pub(super) fn softened(values: &[f64], width: usize) -> Vec<f64> {
    let pass = |values: &[f64], step: usize, n: usize| -> Vec<f64> {
        let means = (0..values.len()).map(|at: usize| {
            let place = at / step % n;
            let before = if place > 0 { values[at - step] } else { values[at] };
            let after = if place + 1 < n { values[at + step] } else { values[at] };
            0.25 * (before + after) + 0.5 * values[at]
        });
        means.collect()
    };
    pass(&pass(values, 1, width), width, values.len() / width)
}

/// Values without what is darker and narrower than so many steps to both sides; edges stay where
/// they are (a morphological closing).
pub(super) fn closed(values: &[f64], width: usize, steps: usize) -> Vec<f64> {
    let brightest = extremes(values, width, steps, f64::max);
    extremes(&brightest, width, steps, f64::min)
}

/// The extreme of what lies within so many steps of each value, in a square (van Herk, Pattern
/// Recognition Letters 13, 1992).
pub(super) fn extremes(
    values: &[f64],
    width: usize,
    steps: usize,
    extreme: impl Fn(f64, f64) -> f64,
) -> Vec<f64> {
    let size = 2 * steps + 1;
    let mut values = values.to_vec();
    let height = values.len() / width;
    let (mut line, mut onward) = (Vec::new(), vec![0.0; width.max(height)]);
    for (step, n, n_lines) in [(1, width, height), (width, height, width)] {
        for first in (0..n_lines).map(|line| line * if step == 1 { width } else { 1 }) {
            line.clear();
            line.extend(values[first..].iter().step_by(step).take(n));
            // The extremes from each place to the end of its span of the window's size, and from
            // the beginning.
            for place in (0..n).rev() {
                let ends = place + 1 == n || (place + 1) % size == 0;
                onward[place] =
                    if ends { line[place] } else { extreme(line[place], onward[place + 1]) };
            }
            for place in (0..n).filter(|place| place % size > 0) {
                line[place] = extreme(line[place], line[place - 1]);
            }
            for place in 0..n {
                let (from, to) = (place.saturating_sub(steps), (place + steps).min(n - 1));
                values[first + place * step] = if from / size < to / size {
                    extreme(onward[from], line[to])
                } else if from % size == 0 {
                    line[to]
                } else {
                    onward[from]
                };
            }
        }
    }
    values
}

/// The value of 0 to 255 below which a share of some values lies; 0 of none.
pub(super) fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut counts = [0_usize; 256];
    values.into_iter().for_each(|value| counts[level(value)] += 1);
    let wanted = share * counts.iter().sum::<usize>() as f64;
    let mut passed = 0;
    let reaches = |n: &usize| {
        passed += n;
        passed as f64 >= wanted
    };
    counts.iter().position(reaches).unwrap_or(255) as f64
}

/// A value as one of 256 levels.
#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
pub(super) fn level(value: f64) -> usize {
    (value as usize).min(255)
}
