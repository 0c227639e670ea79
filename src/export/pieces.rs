//! Pieces of a trajectory: a plan's design path as polynomials of time.
//!
//! A plan has a setpoint every few hundredths of a second, too many for a drone's memory. Both
//! trajectory forms of the Crazyflie take longer pieces: [`super::compressed`] cubics, and
//! [`super::poly4d`] polynomials of degree 7. [`longest`] finds the pieces greedily: each is the
//! longest that keeps to the design, found by bisection between setpoints.

use nalgebra::Vector3;

use crate::error::{Error, Result};
use crate::plan::{Plan, Setpoint};

/// Times between two setpoints at which a piece is held against the design.
const CHECKS_PER_SETPOINT: u32 = 4;

/// The part of a plan that flies as a trajectory: from the first letter's first setpoint to the last
/// letter's last one. Take-off and landing are commands of their own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch<'a> {
    setpoints: &'a [Setpoint],
}

impl<'a> Stretch<'a> {
    /// The stretch of a plan.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a plan without letters.
    pub(super) fn new(plan: &'a Plan) -> Result<Self> {
        let written = |setpoint: &Setpoint| setpoint.letter.is_some();
        let first = plan.setpoints.iter().position(written);
        let last = plan.setpoints.iter().rposition(written);
        match first.zip(last) {
            Some((first, last)) if first < last => {
                // Up to the setpoint after the last, where the last stroke ends.
                let end = (last + 1).min(plan.setpoints.len() - 1);
                Ok(Self { setpoints: &plan.setpoints[first..=end] })
            }
            _ => {
                let hint = "plan a word, not only a take-off";
                Err(Error::input("plan", "no letter", "setpoints that write a letter", hint))
            }
        }
    }

    /// Time of the first setpoint in the plan, s.
    pub(super) fn start_s(&self) -> f64 {
        self.setpoints[0].time_s
    }

    /// Duration, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.time_s(self.last())
    }

    /// Index of the last setpoint.
    pub(super) fn last(&self) -> usize {
        self.setpoints.len() - 1
    }

    /// Time of a setpoint since the start of the stretch, s.
    pub(super) fn time_s(&self, index: usize) -> f64 {
        self.setpoints[index].time_s - self.start_s()
    }

    /// One of its setpoints.
    pub(super) fn setpoint(&self, index: usize) -> &Setpoint {
        &self.setpoints[index]
    }

    /// Position of the design at a time since the start, m.
    pub(super) fn position_m(&self, time_s: f64) -> Vector3<f64> {
        let time_s = time_s + self.start_s();
        let after = self.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s);
        let setpoint = &self.setpoints[after.saturating_sub(1)];
        setpoint.design_m(time_s.max(setpoint.time_s))
    }

    /// Times at which a piece between two setpoints is held against the design.
    pub(super) fn check_times_s(&self, from: usize, to: usize) -> impl Iterator<Item = f64> {
        (from..to).flat_map(move |index| {
            let (start_s, end_s) = (self.time_s(index), self.time_s(index + 1));
            (1..=CHECKS_PER_SETPOINT).map(move |check| {
                start_s + (end_s - start_s) * f64::from(check) / f64::from(CHECKS_PER_SETPOINT)
            })
        })
    }
}

/// The setpoint at which the longest piece from `from` ends. `fits` says whether a piece to a
/// setpoint keeps to the design; the piece to the next setpoint is taken in any case.
pub(super) fn longest(from: usize, last: usize, fits: impl Fn(usize) -> bool) -> usize {
    let (mut good, mut step) = (from + 1, 1);
    // Doubles the length until a piece fails, then halves the step.
    while good + step <= last && fits(good + step) {
        good += step;
        step *= 2;
    }
    while step > 0 {
        if good + step <= last && fits(good + step) {
            good += step;
        }
        step /= 2;
    }
    good
}
