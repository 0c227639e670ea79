//! Test for steps of the floor below a ranger.
//!
//! A filter takes a step of the floor for motion of the drone. A range far beyond its expected spread is
//! therefore left out, and the second in a row is a step: the floor moves by the mean of both
//! innovations.

use crate::control::Innovation;

/// Consecutive ranges beyond the gate that are a step.
const STEP_READINGS: usize = 2;

/// The test.
#[derive(Clone, Debug)]
pub(super) struct StepTest {
    gate_sigmas: f64,
    least_m: f64,
    /// Innovations beyond the gate, since the last one within.
    beyond_m: Vec<f64>,
}

/// What a range says about the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Floor {
    /// The floor is where it was: the range is taken in.
    Still,
    /// Not decided yet: the range is left out.
    Open,
    /// The distance to the floor stepped by this much: the range is left out.
    Stepped(f64),
}

impl StepTest {
    /// A test with a gate in standard deviations; smaller innovations than `least_m` are no step.
    pub(super) fn new(gate_sigmas: f64, least_m: f64) -> Self {
        Self { gate_sigmas, least_m, beyond_m: Vec::new() }
    }

    /// Looks at the next range.
    pub(super) fn look(&mut self, innovation: &Innovation) -> Floor {
        let within = innovation.sigmas() <= self.gate_sigmas;
        if within || innovation.value.abs() < self.least_m {
            self.beyond_m.clear();
            return Floor::Still;
        }
        self.beyond_m.push(innovation.value);
        if self.beyond_m.len() < STEP_READINGS {
            return Floor::Open;
        }
        #[expect(clippy::cast_precision_loss, reason = "two")]
        let n = self.beyond_m.len() as f64;
        Floor::Stepped(self.beyond_m.drain(..).sum::<f64>() / n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_stray_range_is_left_out_and_two_in_a_row_are_a_step() {
        let mut test = StepTest::new(4.0, 0.1);
        let mut look = |value: f64| test.look(&Innovation { value, variance: 0.0025 });
        assert_eq!([0.19, 0.5, 0.1].map(&mut look), [Floor::Still, Floor::Open, Floor::Still]);
        assert_eq!([0.5, 0.6].map(&mut look), [Floor::Open, Floor::Stepped(0.55)]);
        assert_eq!(look(-0.5), Floor::Open, "the count begins anew");
        let mut sharp = StepTest::new(4.0, 0.1);
        assert_eq!(sharp.look(&Innovation { value: 0.09, variance: 1e-6 }), Floor::Still, "small");
    }
}
