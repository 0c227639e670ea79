//! Noise densities of recorded series at several time scales, for the tests of the sensors.

/// Values at a steady rate.
pub(super) struct Series {
    rate_hz: f64,
    values: Vec<f64>,
}

/// Lengths of the blocks that are compared, in samples: the slowest is 128 times the fastest.
const BLOCKS: [usize; 3] = [1, 16, 128];

impl Series {
    pub(super) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, values: Vec::new() }
    }

    pub(super) fn push(&mut self, value: f64) {
        self.values.push(value);
    }
}

/// One-sided density (unit/√Hz) of white noise, seen at three time scales by the Allan variance of
/// means over blocks of length T: `σ²(T) = n²/2T`.
pub(super) fn white_density(series: &Series) -> [f64; 3] {
    BLOCKS.map(|block| {
        let length = block as f64;
        let means: Vec<f64> =
            series.values.chunks_exact(block).map(|b| b.iter().sum::<f64>() / length).collect();
        (variance_of_steps(&means) * length / series.rate_hz).sqrt()
    })
}

/// One-sided density of the derivative (unit/s/√Hz) of a random walk, at three time scales: a step
/// over T has the variance `b² T/2`.
pub(super) fn random_walk_density(series: &Series) -> [f64; 3] {
    BLOCKS.map(|block| {
        let length = block as f64;
        let thinned: Vec<f64> = series.values.iter().copied().step_by(block).collect();
        (2.0 * variance_of_steps(&thinned) * series.rate_hz / length).sqrt()
    })
}

/// Variance that the integral of a series about its mean gains in a second.
pub(super) fn gathered(series: &Series) -> f64 {
    let n = series.values.len() as f64;
    let mean = series.values.iter().sum::<f64>() / n;
    series.values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>()
        / n
        / series.rate_hz
}

fn variance_of_steps(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]));
    let n = (values.len() - 1) as f64;
    steps.sum::<f64>() / n
}
