//! Step response of a loop, and its inverse: the inputs for a wanted output.

/// Output of a stable loop from rest after its input stepped from 0 to 1, at even times from the
/// step on; afterwards it stays at the last value.
#[derive(Clone, Debug, PartialEq)]
pub struct StepResponse {
    /// Time between two values.
    pub interval_s: f64,
    /// The values, the first at the step itself.
    pub values: Vec<f64>,
}

/// Share of the step below which the rest of a response is neglected.
const SETTLED: f64 = 1e-3;
/// Times at which the output is compared with the wanted one, per input: one between two inputs
/// keeps the loop from swinging there.
const OUTPUTS_PER_INPUT: usize = 2;

impl StepResponse {
    /// The response at a time after the step; 0 before it.
    #[must_use]
    pub fn at(&self, time_s: f64) -> f64 {
        let place = time_s / self.interval_s;
        let Some(last) = self.values.len().checked_sub(1).filter(|_| place >= 0.0) else {
            return 0.0;
        };
        #[expect(clippy::cast_possible_truncation, reason = "0 or more")]
        let index = (place as usize).min(last);
        let next = self.values[(index + 1).min(last)];
        let part = (place - place.floor()).clamp(0.0, 1.0);
        self.values[index] + (next - self.values[index]) * part
    }

    /// Time after which the response stays within 0.1 % of the step from its end.
    #[must_use]
    pub fn settled_s(&self) -> f64 {
        let end = self.values.last().copied().unwrap_or_default();
        let unsettled = self.values.iter().rposition(|v| (v - end).abs() > SETTLED);
        unsettled.map_or(0, |index| index + 1) as f64 * self.interval_s
    }

    /// Output at a time of a loop that rests at `rest` until the first of its inputs, `(time,
    /// value)`, which are each held until the next.
    #[must_use]
    pub fn output(&self, rest: f64, inputs: &[(f64, f64)], time_s: f64) -> f64 {
        let (mut output, mut held) = (rest, rest);
        for (at_s, input) in inputs.iter().take_while(|(at_s, _)| *at_s <= time_s) {
            output += (input - held) * self.at(time_s - at_s);
            held = *input;
        }
        output
    }

    /// Multiplications of [`Self::inverse`] for so many inputs, an interval apart.
    #[must_use]
    pub fn inverse_cost(&self, n_inputs: usize, interval_s: f64) -> f64 {
        let (n, per_input) = (n_inputs as f64, OUTPUTS_PER_INPUT as f64);
        let width = (self.settled_s() / interval_s).min(n) + 2.0;
        n * (per_input + 1.0) * 0.5 * width * width
    }

    /// Inputs, each held from its time in `times_s` until the next, that make the loop put out
    /// `wanted`, in the sense of least squares over the whole span, after a rest at its first
    /// value: the zero-phase inverse, which begins to act before it is due.
    ///
    /// `ridge` weighs the square of `input − wanted` against that of the error of the output:
    /// motions that the loop cannot follow are left out. 0.01 asks for corners sharply, 1 hardly at
    /// all.
    ///
    /// Method: normal equations, banded since the response settles, by Cholesky's factors. Time
    /// and memory grow with the number of inputs times those within the response.
    ///
    /// # Panics
    ///
    /// If the times do not rise.
    #[must_use]
    pub fn inverse(&self, times_s: &[f64], wanted: impl Fn(f64) -> f64, ridge: f64) -> Vec<f64> {
        assert!(times_s.windows(2).all(|pair| pair[0] < pair[1]), "times rise");
        let (Some(start_s), Some(end_s)) = (times_s.first(), times_s.last()) else {
            return Vec::new();
        };
        let settled_s = self.settled_s();
        let rest = wanted(*start_s);
        // An input counts from its time until it and the response to its end have settled.
        let width = times_s.iter().enumerate().map(|(k, time_s)| {
            k - times_s.partition_point(|other| other + settled_s < *time_s) + 2
        });
        let mut normal = Banded::new(times_s.len(), width.max().unwrap_or(1));
        for (k, time_s) in times_s.iter().enumerate() {
            normal.add(k, ridge, &[1.0]);
            normal.right[k] += ridge * (wanted(*time_s) - rest);
        }
        let (n, per_input) = (times_s.len() as f64, OUTPUTS_PER_INPUT as f64);
        let step_s = (end_s - start_s) / (n * per_input).max(1.0);
        let mut time_s = *start_s;
        let mut weights: Vec<f64> = Vec::new();
        while step_s > 0.0 && time_s <= end_s + 0.5 * step_s {
            let until = times_s.partition_point(|t| *t <= time_s + 1e-9);
            let from =
                times_s[..until].partition_point(|t| t + settled_s < time_s).saturating_sub(1);
            weights.clear();
            weights.extend((from..until).map(|k| {
                let after = times_s.get(k + 1).map_or(0.0, |next| self.at(time_s - next));
                // Everything before the window has settled and counts with the window's first
                // input.
                if k == from && from > 0 {
                    1.0 - after
                } else {
                    self.at(time_s - times_s[k]) - after
                }
            }));
            let target = wanted(time_s) - rest;
            for (i, weight) in weights.iter().enumerate() {
                normal.right[from + i] += weight * target;
                normal.add(from + i, *weight, &weights[i..]);
            }
            time_s += step_s;
        }
        normal.solve().into_iter().map(|input| input + rest).collect()
    }
}

/// A symmetric positive definite system whose entries lie near the diagonal.
struct Banded {
    width: usize,
    /// Row by row from the diagonal rightward.
    upper: Vec<f64>,
    right: Vec<f64>,
}

impl Banded {
    fn new(n: usize, width: usize) -> Self {
        Self { width, upper: vec![0.0; n * width], right: vec![0.0; n] }
    }

    /// Adds to a row, from the diagonal rightward.
    fn add(&mut self, row: usize, factor: f64, values: &[f64]) {
        let entries = &mut self.upper[row * self.width..(row + 1) * self.width];
        entries.iter_mut().zip(values).for_each(|(entry, value)| *entry += factor * value);
    }

    fn solve(mut self) -> Vec<f64> {
        let (n, width) = (self.right.len(), self.width);
        for i in 0..n {
            let pivot = self.upper[i * width].max(f64::MIN_POSITIVE).sqrt();
            self.upper[i * width..(i + 1) * width].iter_mut().for_each(|entry| *entry /= pivot);
            self.right[i] /= pivot;
            let row = self.upper[i * width..(i + 1) * width].to_vec();
            for k in 1..width.min(n - i) {
                if row[k] == 0.0 {
                    continue;
                }
                self.right[i + k] -= row[k] * self.right[i];
                let below = &mut self.upper[(i + k) * width..(i + k + 1) * width];
                for (entry, factor) in below.iter_mut().zip(&row[k..]) {
                    *entry -= row[k] * factor;
                }
            }
        }
        for i in (0..n).rev() {
            let row = &self.upper[i * width..(i + 1) * width];
            let known: f64 = (1..width.min(n - i)).map(|k| row[k] * self.right[i + k]).sum();
            self.right[i] = (self.right[i] - known) / row[0];
        }
        self.right
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `1 − e^(−t/τ)`.
    fn lag(tau_s: f64) -> StepResponse {
        let values = (0..4000).map(|k| 1.0 - libm::exp(-f64::from(k) * 0.004 / tau_s));
        StepResponse { interval_s: 0.004, values: values.collect() }
    }

    #[test]
    fn a_ramp_trails_by_the_lag_and_its_inverse_leads_by_it() {
        let loop_ = lag(0.5);
        assert!((loop_.settled_s() - 0.5 * libm::log(1000.0)).abs() < 0.01);
        let times_s: Vec<f64> = (0..200).map(|k| f64::from(k) * 0.05).collect();
        let ramp = |time_s: f64| 0.2 * time_s;
        let held: Vec<(f64, f64)> = times_s.iter().map(|t| (*t, ramp(*t))).collect();
        // The hold adds half an interval.
        assert!((loop_.output(0.0, &held, 8.0) - 0.2 * (8.0 - 0.525)).abs() < 1e-3);
        let sent = loop_.inverse(&times_s, ramp, 1e-4);
        let sent: Vec<(f64, f64)> = times_s.iter().copied().zip(sent).collect();
        assert!((sent[160].1 - 0.2 * (8.0 + 0.525)).abs() < 2e-3, "{}", sent[160].1);
        for k in 0..340 {
            let time_s = f64::from(k) * 0.025;
            let found = loop_.output(0.0, &sent, time_s);
            assert!((found - ramp(time_s)).abs() < 1e-3, "{found} at {time_s} s");
        }
    }

    #[test]
    fn the_inverse_acts_before_a_corner_is_due_and_rounds_it_little() {
        let loop_ = lag(0.3);
        let times_s: Vec<f64> = (0..120).map(|k| f64::from(k) * 0.05).collect();
        let corner = |time_s: f64| 0.3 * (time_s - 3.0).max(0.0);
        let sent = loop_.inverse(&times_s, corner, 0.01);
        let sent: Vec<(f64, f64)> = times_s.iter().copied().zip(sent).collect();
        let worst = (0..110).map(|k| {
            let time_s = f64::from(k) * 0.05;
            (loop_.output(0.0, &sent, time_s) - corner(time_s)).abs()
        });
        assert!(worst.fold(0.0, f64::max) < 0.006, "against 0.09 m of trail");
    }

    #[test]
    fn a_settled_response_is_inverted_over_any_span() {
        // Settled inputs leave the window: a long rest changes nothing.
        let loop_ = lag(0.1);
        let times_s: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.1).collect();
        let sent = loop_.inverse(&times_s, |time_s| if time_s < 20.0 { 1.0 } else { 2.0 }, 0.01);
        assert!((sent[50] - 1.0).abs() < 2e-3 && (sent[590] - 2.0).abs() < 2e-3, "{}", sent[590]);
        assert_eq!(loop_.inverse(&[], |_| 0.0, 1.0), [] as [f64; 0]);
        assert_eq!(loop_.inverse(&[1.0], |_| 3.0, 1.0), [3.0]);
    }
}
