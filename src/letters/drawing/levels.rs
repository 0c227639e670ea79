//! Levels of a picture: values pixel by pixel, averaged, closed, and their quantiles.

/// Each pixel averaged with its neighbors, 1 2 1 in both directions, against contours around noise.
pub(super) fn softened(values: &[f64], width: usize) -> Vec<f64> {
    let mut values = values.to_vec();
    for (step, n) in [(1, width), (width, values.len() / width)] {
        let means = (0..values.len()).map(|pixel| {
            let place = pixel / step % n;
            let before = if place > 0 { values[pixel - step] } else { values[pixel] };
            let after = if place + 1 < n { values[pixel + step] } else { values[pixel] };
            0.25 * (before + after) + 0.5 * values[pixel]
        });
        values = means.collect();
    }
    values
}

/// A morphological closing: dark marks narrower than `steps` to both sides go, and edges stay.
pub(super) fn closed(values: &[f64], width: usize, steps: usize) -> Vec<f64> {
    let brightest = extremes(values, width, steps, f64::max);
    extremes(&brightest, width, steps, f64::min)
}

/// The extreme in a square of `steps` to both sides (van Herk, Pattern Recognition Letters 13,
/// 1992).
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

/// A quantile of values from 0 to 255. 0 without values.
pub(super) fn quantile(values: impl IntoIterator<Item = f64>, rank: f64) -> f64 {
    let mut counts = [0_usize; 256];
    values.into_iter().for_each(|value| counts[level(value)] += 1);
    let wanted = rank * counts.iter().sum::<usize>() as f64;
    let mut passed = 0;
    let reached = counts.iter().position(|n| {
        passed += n;
        passed as f64 >= wanted
    });
    reached.unwrap_or(255) as f64
}

/// A value as one of 256 levels.
#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
pub(super) fn level(value: f64) -> usize {
    (value as usize).min(255)
}
