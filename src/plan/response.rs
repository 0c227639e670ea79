//! Step response of a control loop, and its inverse, which gives the inputs for a desired output.

/// Output of a stable loop, initially at rest, after its input steps from 0 to 1. The values are at
/// equal intervals, and the output stays constant after the last one.
#[derive(Clone, Debug, PartialEq)]
pub struct StepResponse {
    /// Time between two values in s.
    pub interval_s: f64,
    /// Values of the output, beginning with the value at the step itself.
    pub values: Vec<f64>,
}

/// Remaining change of a response, as a fraction of the step, below which it is neglected.
const SETTLED: f64 = 1e-3;
/// Tolerance in s for rounding errors of an input's time.
const ROUNDING_S: f64 = 1e-9;
/// Number of comparisons between output and target per input. The additional comparison between two
/// inputs prevents oscillation.
const OUTPUTS_PER_INPUT: usize = 2;

impl StepResponse {
    /// Returns the output at a time in s after a unit step of the input, interpolated linearly, or
    /// 0 before the step.
    pub fn value_at(&self, time_s: f64) -> f64 {
        let intervals = time_s / self.interval_s;
        let Some(last) = self.values.len().checked_sub(1).filter(|_| intervals >= 0.0) else {
            return 0.0;
        };
        if intervals >= last as f64 {
            return self.values[last];
        }
        #[expect(clippy::cast_possible_truncation, reason = "0 to the number of values")]
        let index = intervals as u32;
        let [here, next] = [0, 1].map(|step| self.values[index as usize + step]);
        here + (next - here) * (intervals - f64::from(index))
    }

    /// Returns the time in s after which the response stays within `SETTLED` of its last value.
    pub fn settled_s(&self) -> f64 {
        let end = self.values.last().copied().unwrap_or_default();
        let unsettled = self.values.iter().rposition(|v| (v - end).abs() > SETTLED);
        unsettled.map_or(0, |index| index + 1) as f64 * self.interval_s
    }

    /// Returns the approximate number of multiplications in [`Self::inverse`] for `n_inputs`
    /// equally spaced inputs.
    pub fn inverse_cost(&self, n_inputs: usize, interval_s: f64) -> f64 {
        // Each output and each row of the factorization updates half of a square of the band.
        let (n, per_input) = (n_inputs as f64, OUTPUTS_PER_INPUT as f64);
        let width = (self.settled_s() / interval_s).min(n) + 2.0;
        n * (per_input + 1.0) * 0.5 * width * width
    }

    /// Returns the inverse of the loop for inputs at ascending times, each held until the next.
    ///
    /// `ridge` weights the square of `input − wanted` relative to the square of the output's error
    /// (Tikhonov regularization). A ridge of 0.01 reproduces corners sharply, whereas a ridge of 1
    /// hardly reproduces them.
    ///
    /// The method is a Cholesky decomposition of the normal equations, which are banded because the
    /// response settles.
    ///
    /// # Panics
    ///
    /// Panics if the times do not ascend.
    pub fn inverse(&self, times_s: Vec<f64>, ridge: f64) -> Inverse<'_> {
        assert!(times_s.windows(2).all(|pair| pair[0] < pair[1]), "times rise");
        let settled_s = self.settled_s();
        // An input has an effect from its time until the response to its end has settled.
        let width = times_s.iter().enumerate().map(|(k, time_s)| {
            k - times_s.partition_point(|other| other + settled_s < *time_s) + 2
        });
        let (n, width) = (times_s.len(), width.max().unwrap_or(1));
        let (upper, pivots) = (vec![0.0; n * width], Vec::with_capacity(n));
        let mut inverse =
            Inverse { response: self, settled_s, times_s, ridge, width, upper, pivots };
        noctograph_core::dispatch!(|| inverse.factor());
        inverse
    }
}

/// Zero-phase inverse of a loop for inputs at given times. The inputs are ahead of the target.
#[derive(Debug)]
pub struct Inverse<'a> {
    response: &'a StepResponse,
    settled_s: f64,
    times_s: Vec<f64>,
    ridge: f64,
    /// Number of entries in a row of the band, beginning at the diagonal.
    width: usize,
    /// Rows of the upper triangular Cholesky factor, and the divisor of each row.
    upper: Vec<f64>,
    pivots: Vec<f64>,
}

impl Inverse<'_> {
    /// Returns the inputs, in the unit of `wanted`, for which the loop's output is closest to
    /// `wanted` in the least-squares sense. `wanted` is a function of the time in s. The loop is
    /// initially at rest at the first wanted value.
    pub fn inputs(&self, wanted: impl Fn(f64) -> f64) -> Vec<f64> {
        let Some(start_s) = self.times_s.first() else { return Vec::new() };
        let rest = wanted(*start_s);
        let target = |time_s: f64| wanted(time_s) - rest;
        // The right-hand side is W'y + ridge y, where W has one row for each output.
        let mut right: Vec<f64> =
            self.times_s.iter().map(|time_s| self.ridge * target(*time_s)).collect();
        let mut weights = Vec::new();
        for time_s in self.outputs_s() {
            let output = target(time_s);
            let from = self.weigh(time_s, &mut weights);
            let weighted = right[from..].iter_mut().zip(&weights);
            weighted.for_each(|(sum, weight)| *sum += weight * output);
        }
        self.solve(&mut right);
        right.into_iter().map(|input| input + rest).collect()
    }

    /// Returns the equally spaced times in s at which the output is compared with the target,
    /// [`OUTPUTS_PER_INPUT`] for each input.
    fn outputs_s(&self) -> impl Iterator<Item = f64> + use<> {
        let ends_s = [self.times_s.first(), self.times_s.last()];
        let [start_s, end_s] = ends_s.map(|end_s| end_s.copied().unwrap_or_default());
        let (n, per_input) = (self.times_s.len() as f64, OUTPUTS_PER_INPUT as f64);
        let step_s = (end_s - start_s) / (n * per_input).max(1.0);
        let until_s = end_s + 0.5 * step_s;
        let times_s = std::iter::successors(Some(start_s), move |time_s| Some(time_s + step_s));
        times_s.take_while(move |time_s| step_s > 0.0 && *time_s <= until_s)
    }

    /// Sets `weights` to the weights of the inputs in the output at `time_s`, which are a row of
    /// the matrix W. Returns the index of the input to which the first weight belongs. All earlier
    /// weights are 0.
    #[inline(always)]
    fn weigh(&self, time_s: f64, weights: &mut Vec<f64>) -> usize {
        let Self { response, settled_s, times_s, .. } = self;
        let until = times_s.partition_point(|t| *t <= time_s + ROUNDING_S);
        let from = times_s[..until].partition_point(|t| t + settled_s < time_s).saturating_sub(1);
        let response_to = |input_s: &f64| response.value_at(time_s - input_s);
        // Earlier inputs have settled, so the weight of the window's first input includes theirs.
        let mut begun = if from > 0 { 1.0 } else { response_to(&times_s[0]) };
        weights.clear();
        weights.extend((from..until).map(|k| {
            let ended = times_s.get(k + 1).map_or(0.0, response_to);
            std::mem::replace(&mut begun, ended) - ended
        }));
        from
    }

    /// Computes the Cholesky factor of the normal equations in `upper` and `pivots`. The function
    /// is compiled for the widest registers, but no product is fused with a sum, so the bits are
    /// the same on every machine.
    #[inline(always)]
    fn factor(&mut self) {
        let width = self.width;
        let mut normal = std::mem::take(&mut self.upper);
        // The matrix is W'W + ridge I, where W has one row for each output. Only the upper half of
        // its band is stored.
        normal.iter_mut().step_by(width).for_each(|diagonal| *diagonal += self.ridge);
        let mut weights = Vec::new();
        for time_s in self.outputs_s() {
            let from = self.weigh(time_s, &mut weights);
            for (i, weight) in weights.iter().enumerate() {
                let row = &mut normal[(from + i) * width..][..width];
                row.iter_mut().zip(&weights[i..]).for_each(|(sum, other)| *sum += weight * other);
            }
        }
        // The Cholesky factorization proceeds row by row. Each finished row is subtracted from the
        // rows below it in the band.
        for i in 0..self.times_s.len() {
            let (rows, below) = normal[i * width..].split_at_mut(width);
            let pivot = rows[0].max(f64::MIN_POSITIVE).sqrt();
            self.pivots.push(pivot);
            rows.iter_mut().for_each(|entry| *entry /= pivot);
            for (k, row) in (1..width).zip(below.chunks_exact_mut(width)) {
                let factor = rows[k];
                if factor != 0.0 {
                    row.iter_mut().zip(&rows[k..]).for_each(|(sum, other)| *sum -= factor * other);
                }
            }
        }
        self.upper = normal;
    }

    /// Solves the factored system, replacing the right-hand side `right` with the solution.
    fn solve(&self, right: &mut [f64]) {
        let (n, width) = (right.len(), self.width);
        // Forward substitution with the transposed factor precedes back substitution with the
        // factor.
        for (i, row) in self.upper.chunks_exact(width).enumerate() {
            right[i] /= self.pivots[i];
            let (value, below) = right[i..].split_at_mut(1);
            below.iter_mut().zip(&row[1..]).for_each(|(sum, factor)| *sum -= factor * value[0]);
        }
        for (i, row) in self.upper.chunks_exact(width).enumerate().rev() {
            let solved: f64 = (1..width.min(n - i)).map(|k| row[k] * right[i + k]).sum();
            right[i] = (right[i] - solved) / row[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a first-order lag, `1 − e^(−t/τ)`.
    fn lag(tau_s: f64) -> StepResponse {
        let values = (0..4000).map(|k| 1.0 - libm::exp(-f64::from(k) * 0.004 / tau_s));
        StepResponse { interval_s: 0.004, values: values.collect() }
    }

    /// Returns a loop's output at a time. The loop is at rest until the first of its inputs `(time,
    /// value)`, each of which is held until the next.
    fn output(response: &StepResponse, inputs: &[(f64, f64)], time_s: f64) -> f64 {
        let (mut output, mut held) = (0.0, 0.0);
        for (at_s, input) in inputs.iter().take_while(|(at_s, _)| *at_s <= time_s) {
            output += (input - held) * response.value_at(time_s - at_s);
            held = *input;
        }
        output
    }

    #[test]
    fn a_ramp_trails_by_the_lag_and_its_inverse_leads_by_it() {
        let loop_ = lag(0.5);
        assert!((loop_.settled_s() - 0.5 * libm::log(1000.0)).abs() < 0.01);
        let times_s: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.05).collect();
        let ramp = |time_s: f64| 0.2 * time_s;
        let held: Vec<(f64, f64)> = times_s.iter().map(|t| (*t, ramp(*t))).collect();
        // Holding the inputs adds a lag of half an interval.
        assert!((output(&loop_, &held, 8.0) - 0.2 * (8.0 - 0.525)).abs() < 1e-3);
        let sent = loop_.inverse(times_s.clone(), 1e-4).inputs(ramp);
        let sent: Vec<(f64, f64)> = times_s.iter().copied().zip(sent).collect();
        assert!((sent[160].1 - 0.2 * (8.0 + 0.525)).abs() < 2e-3, "{}", sent[160].1);
        for k in 0..340 {
            let time_s = f64::from(k) * 0.025;
            let actual = output(&loop_, &sent, time_s);
            assert!((actual - ramp(time_s)).abs() < 1e-3, "{actual} at {time_s} s");
        }
    }

    #[test]
    fn the_inverse_acts_before_a_corner_is_due_and_rounds_it_little() {
        let loop_ = lag(0.3);
        let times_s: Vec<f64> = (0..120).map(|k| f64::from(k) * 0.05).collect();
        let corner = |time_s: f64| 0.3 * (time_s - 3.0).max(0.0);
        let sent = loop_.inverse(times_s.clone(), 0.01).inputs(corner);
        let sent: Vec<(f64, f64)> = times_s.iter().copied().zip(sent).collect();
        let worst = (0..110).map(|k| {
            let time_s = f64::from(k) * 0.05;
            (output(&loop_, &sent, time_s) - corner(time_s)).abs()
        });
        assert!(worst.fold(0.0, f64::max) < 0.006, "against 0.09 m of trail");
    }

    #[test]
    fn a_settled_response_is_inverted_over_any_span() {
        // Settled inputs leave the window, so a long rest has no effect.
        let loop_ = lag(0.1);
        let times_s: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.1).collect();
        let sent =
            loop_.inverse(times_s, 0.01).inputs(|time_s| if time_s < 20.0 { 1.0 } else { 2.0 });
        assert!((sent[50] - 1.0).abs() < 2e-3 && (sent[590] - 2.0).abs() < 2e-3, "{}", sent[590]);
        assert_eq!(loop_.inverse(Vec::new(), 1.0).inputs(|_| 0.0), [] as [f64; 0]);
        assert_eq!(loop_.inverse(vec![1.0], 1.0).inputs(|_| 3.0), [3.0]);
    }
}
