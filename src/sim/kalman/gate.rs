//! Gates, which determine the measurements that a filter rejects.
//!
//! A measurement far beyond its expected spread (χ²) is rejected. A filter with a wrong estimate
//! would reject correct measurements forever. After [`MOST_REFUSALS`] consecutive rejections, the
//! next measurement from the same source is therefore accepted, with a variance as large as its
//! squared innovation. A filter would also mistake a step of the floor for a motion of the drone.
//! The second consecutive range beyond the gate of a [`StepTest`] therefore counts as a step, and
//! the floor moves by the mean of both innovations.

use std::collections::BTreeMap;

use super::normal::{Innovation, Measurement, Normal, Part};

/// Number of consecutive rejections after which a source is accepted again.
const MOST_REFUSALS: u32 = 5;
/// Number of consecutive ranges beyond the gate that count as a step.
const STEP_READINGS: usize = 2;

/// Gate that rejects outliers from each source, and reopens after consecutive rejections.
#[derive(Clone, Debug)]
pub struct Gate<K> {
    /// Threshold in squared standard deviations.
    gate_sq: f64,
    /// Number of consecutive rejections of each source.
    refused: BTreeMap<K, u32>,
}

impl<K: Ord> Gate<K> {
    /// Creates a gate with this threshold, in standard deviations of the innovation.
    pub fn new(sigmas: f64) -> Self {
        Self { gate_sq: sigmas * sigmas, refused: BTreeMap::new() }
    }

    /// Corrects the states with a measurement from a source. Returns the innovation, or `None` if
    /// the measurement was rejected. After five rejections in a row, the source's next
    /// measurement is used with a larger variance.
    pub fn correct(
        &mut self,
        normal: &mut Normal,
        source: K,
        measurement: &Measurement<'_>,
    ) -> Option<Innovation> {
        let n_refused = self.refused.entry(source).or_default();
        // After consecutive rejections, the innovation itself serves as the standard deviation of
        // the noise, with which the measurement passes any gate.
        let mut measurement = *measurement;
        if *n_refused >= MOST_REFUSALS {
            let error = normal.innovation(&measurement).value;
            measurement.variance = measurement.variance.max(error * error);
        }
        let mut accepted = None;
        normal.correct(&measurement, |innovation| {
            accepted = (!innovation.is_beyond(self.gate_sq)).then_some(*innovation);
            accepted.is_some()
        });
        *n_refused = if accepted.is_some() { 0 } else { *n_refused + 1 };
        accepted
    }
}

/// Test for steps in the floor below a ranger. The floor's height is one of the states.
#[derive(Clone, Debug)]
pub struct StepTest {
    gate_sigmas: f64,
    least_m: f64,
    sigma_m: f64,
    /// Innovations in m beyond the gate since the last one within it.
    beyond_m: Vec<f64>,
}

/// Result of testing a range to the floor for a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Floor {
    /// No step. The range is used.
    Still,
    /// Not decided yet. The range is not used.
    Open,
    /// Step in the distance to the floor by this length in m. The range is not used.
    Stepped(f64),
}

impl StepTest {
    /// Creates a test with a gate in standard deviations of the innovation. Innovations below
    /// `least_m` are not a step. A step adds `sigma_m` to the uncertainty of the floor's height.
    pub fn new(gate_sigmas: f64, least_m: f64, sigma_m: f64) -> Self {
        Self { gate_sigmas, least_m, sigma_m, beyond_m: Vec::new() }
    }

    /// Corrects the states with a range to the floor, and returns what the range says about the
    /// floor. The last part of the Jacobian is with respect to the floor's state. If the floor has
    /// a step, its state and variance are changed instead. A range whose squared normalized
    /// innovation exceeds `gate_sq` is ignored.
    ///
    /// # Panics
    ///
    /// Panics if the last part of the Jacobian does not belong to one state.
    pub fn correct(
        &mut self,
        normal: &mut Normal,
        measurement: &Measurement<'_>,
        gate_sq: f64,
    ) -> Floor {
        let mut floor = Floor::Still;
        normal.correct(measurement, |innovation| {
            floor = self.classify(innovation);
            floor == Floor::Still && !innovation.is_beyond(gate_sq)
        });
        // A step in the range divided by the Jacobian is a step in the floor's height.
        if let Floor::Stepped(step_m) = floor {
            let Some(Part::One(state, per_m)) = measurement.jacobian.last() else {
                panic!("the floor is last")
            };
            normal.mean[*state] += step_m / per_m;
            normal.covariance[(*state, *state)] += self.sigma_m * self.sigma_m;
        }
        floor
    }

    /// Classifies a range. [`STEP_READINGS`] consecutive ranges beyond the gate are a step by the
    /// mean of their innovations. Ranges up to the gate, and innovations below the least step, are
    /// no step.
    fn classify(&mut self, innovation: &Innovation) -> Floor {
        let is_within = innovation.sigmas() <= self.gate_sigmas;
        if is_within || innovation.value.abs() < self.least_m {
            self.beyond_m.clear();
            return Floor::Still;
        }
        self.beyond_m.push(innovation.value);
        if self.beyond_m.len() < STEP_READINGS {
            return Floor::Open;
        }
        let n = self.beyond_m.len() as f64;
        Floor::Stepped(self.beyond_m.drain(..).sum::<f64>() / n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_refusals_in_a_row_widen_the_variance_and_fewer_do_not() {
        let mut gate = Gate::new(4.0);
        let mut accepted = |source, value| {
            let mut normal = Normal::independent(&[0.1]);
            let jacobian = &[Part::One(0, 1.0)];
            gate.correct(&mut normal, source, &Measurement { jacobian, value, variance: 0.01 })
        };
        for refusals in 0..5 {
            assert_eq!(accepted(1, 3.0), None, "after {refusals}");
        }
        assert_eq!(accepted(2, 3.0), None, "another source");
        assert_eq!(accepted(1, 3.0).map(|innovation| innovation.variance), Some(9.0 + 0.1 * 0.1));
        assert_eq!(accepted(1, 3.0), None, "in a row");
    }

    #[test]
    fn one_outlier_is_left_out_and_two_in_a_row_are_a_step() {
        let mut test = StepTest::new(4.0, 0.1, 0.5);
        let mut classify = |value: f64| test.classify(&Innovation { value, variance: 0.0025 });
        assert_eq!([0.19, 0.5, 0.1].map(&mut classify), [Floor::Still, Floor::Open, Floor::Still]);
        assert_eq!([0.5, 0.6].map(&mut classify), [Floor::Open, Floor::Stepped(0.55)]);
        assert_eq!(classify(-0.5), Floor::Open, "the count begins anew");
        let mut sharp = StepTest::new(4.0, 0.1, 0.5);
        assert_eq!(
            sharp.classify(&Innovation { value: 0.09, variance: 1e-6 }),
            Floor::Still,
            "small"
        );
    }
}
