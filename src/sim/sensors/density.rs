//! Noise densities of recorded series at several time scales, for the tests of the sensors.

/// Lengths of the blocks that are compared, in samples: the slowest is 128 times the fastest.
const BLOCKS: [usize; 3] = [1, 16, 128];

/// One-sided density (unit/√Hz) of white noise, seen at three time scales by the Allan variance of
/// means over blocks of length T: `σ²(T) = n²/2T`.
pub(super) fn white_density(values: &[f64], rate_hz: f64) -> [f64; 3] {
    BLOCKS.map(|block| {
        let length = block as f64;
        let means: Vec<f64> =
            values.chunks_exact(block).map(|b| b.iter().sum::<f64>() / length).collect();
        (variance_of_steps(&means) * length / rate_hz).sqrt()
    })
}

/// One-sided density of the derivative (unit/s/√Hz) of a random walk, at three time scales: a step
/// over T has the variance `b² T/2`.
pub(super) fn random_walk_density(values: &[f64], rate_hz: f64) -> [f64; 3] {
    BLOCKS.map(|block| {
        let length = block as f64;
        let thinned: Vec<f64> = values.iter().copied().step_by(block).collect();
        (2.0 * variance_of_steps(&thinned) * rate_hz / length).sqrt()
    })
}

/// Variance that the integral of a series about its mean gains in a second.
pub(super) fn gathered(values: &[f64], rate_hz: f64) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / n / rate_hz
}

fn variance_of_steps(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]));
    let n = (values.len() - 1) as f64;
    steps.sum::<f64>() / n
}
