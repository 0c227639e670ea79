//! A gate on innovations that cannot lock the truth out.
//!
//! A filter that is wrong refuses what is right. After [`MOST_REFUSALS`] refusals in a row the next
//! measurement of the same source is believed with the variance that it asks for.

/// Refusals in a row after which a source is believed again.
const MOST_REFUSALS: u32 = 5;

/// What the gate of a filter has done to one source of measurements.
#[derive(Clone, Copy, Debug, Default)]
pub struct LockOut {
    refused: u32,
}

impl LockOut {
    /// The variance to hold the next measurement of variance `variance` against.
    #[must_use]
    pub fn variance(&self, variance: f64, innovation: f64) -> f64 {
        match self.refused >= MOST_REFUSALS {
            true => variance.max(innovation * innovation),
            false => variance,
        }
    }

    /// Notes whether the gate took the measurement.
    pub fn note(&mut self, taken: bool) {
        self.refused = if taken { 0 } else { self.refused + 1 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_refusals_in_a_row_widen_the_variance_and_fewer_do_not() {
        let mut gate = LockOut::default();
        for refusals in 0..5 {
            assert_eq!(gate.variance(0.01, 3.0), 0.01, "after {refusals}");
            gate.note(false);
        }
        assert_eq!((gate.variance(0.01, 3.0), gate.variance(0.01, 0.001)), (9.0, 0.01));
        gate.note(true);
        assert_eq!(gate.variance(0.01, 3.0), 0.01, "in a row");
    }
}
