//! Levels of a picture: smoothing, morphological closing and quantiles of pixel values.

/// Smooths values, row by row in rows of `width`, with the kernel 1 2 1 in both directions, so that
/// noise causes no contours.
pub(super) fn softened(values: &[f64], width: usize) -> Vec<f64> {
    let mut values = values.to_vec();
    for (step, n) in [(1, width), (width, values.len() / width)] {
        let means = (0..values.len()).map(|pixel| {
            let position = pixel / step % n;
            let before = if position > 0 { values[pixel - step] } else { values[pixel] };
            let after = if position + 1 < n { values[pixel + step] } else { values[pixel] };
            0.25 * (before + after) + 0.5 * values[pixel]
        });
        values = means.collect();
    }
    values
}

/// Returns the morphological closing, which removes dark marks narrower than `steps` on each side.
pub(super) fn closed(values: &[f64], width: usize, steps: usize) -> Vec<f64> {
    let brightest = extremes(values, width, steps, f64::max);
    extremes(&brightest, width, steps, f64::min)
}

/// Returns the minimum or maximum within `steps` of each pixel in a square (van Herk, Pattern
/// Recogn. Lett. 13, 1992). The values are row by row in rows of `width`.
pub(super) fn extremes(
    values: &[f64],
    width: usize,
    steps: usize,
    extreme: impl Fn(f64, f64) -> f64,
) -> Vec<f64> {
    let size = 2 * steps + 1;
    let mut values = values.to_vec();
    let height = values.len() / width;
    let (mut line, mut to_block_end) = (Vec::new(), vec![0.0; width.max(height)]);
    // Processes rows and then columns, in which neighboring pixels are `step` apart.
    for (step, n, n_lines) in [(1, width, height), (width, height, width)] {
        for first in (0..n_lines).map(|line| line * if step == 1 { width } else { 1 }) {
            line.clear();
            line.extend(values[first..].iter().step_by(step).take(n));
            // In blocks of the window's size, the extremes are computed from each pixel to the end
            // of its block and from the start of the block to the pixel. A window spans at most two
            // blocks.
            for index in (0..n).rev() {
                let ends_block = index + 1 == n || (index + 1) % size == 0;
                to_block_end[index] = if ends_block {
                    line[index]
                } else {
                    extreme(line[index], to_block_end[index + 1])
                };
            }
            for index in (0..n).filter(|index| index % size > 0) {
                line[index] = extreme(line[index], line[index - 1]);
            }
            for index in 0..n {
                let (from, to) = (index.saturating_sub(steps), (index + steps).min(n - 1));
                values[first + index * step] = if from / size < to / size {
                    extreme(to_block_end[from], line[to])
                } else if from % size == 0 {
                    line[to]
                } else {
                    to_block_end[from]
                };
            }
        }
    }
    values
}

/// Returns the quantile of values from 0 to 255 below which the fraction `rank` of them is, or 0 if
/// there are none.
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

/// Converts a value to one of 256 levels. Values beyond 0 to 255 become its ends.
#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
pub(super) fn level(value: f64) -> usize {
    (value as usize).min(255)
}
