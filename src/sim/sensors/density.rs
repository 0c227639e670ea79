//! Noise densities of recorded series at several time scales, for tests of the sensors.

/// Lengths in samples of the compared blocks, of which the longest is 128 times the shortest.
const BLOCKS: [usize; 3] = [1, 16, 128];

/// Returns the one-sided density (unit/√Hz) of white noise at three time scales, from the Allan
/// variance of means over blocks of length T, `σ²(T) = n²/2T`. `rate_hz` is the rate of the values.
pub(super) fn white_density(values: &[f64], rate_hz: f64) -> [f64; 3] {
    BLOCKS.map(|block| {
        let length = block as f64;
        let means: Vec<f64> =
            values.chunks_exact(block).map(|b| b.iter().sum::<f64>() / length).collect();
        (variance_of_steps(&means) * length / rate_hz).sqrt()
    })
}

/// Returns the one-sided density of the derivative (unit/s/√Hz) of a random walk at three time
/// scales, because the change over a time T has the variance `b² T/2`.
pub(super) fn random_walk_density(values: &[f64], rate_hz: f64) -> [f64; 3] {
    BLOCKS.map(|block| {
        let length = block as f64;
        let thinned: Vec<f64> = values.iter().copied().step_by(block).collect();
        (2.0 * variance_of_steps(&thinned) * rate_hz / length).sqrt()
    })
}

/// Returns the increase per second in the variance of a series' integral around its mean. White
/// noise of the density n gathers n²/2.
pub(super) fn gathered(values: &[f64], rate_hz: f64) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / n / rate_hz
}

/// Returns the mean square of the differences between consecutive values.
fn variance_of_steps(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]));
    let n = (values.len() - 1) as f64;
    steps.sum::<f64>() / n
}
