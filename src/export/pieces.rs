//! Pieces of a trajectory: a plan's design path as polynomials of time.
//!
//! A plan has a setpoint every few hundredths of a second, too many for a drone's memory. Both
//! trajectory forms of the Crazyflie take longer pieces: [`super::compressed`] cubics, and
//! [`super::poly4d`] polynomials of degree 7. [`longest`] finds the pieces greedily: each is the
//! longest that keeps to the design, found by bisection between setpoints.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use crate::error::{Error, Result};
use crate::plan::{Plan, Setpoint};

/// Times between two setpoints at which a piece is held against the design.
const CHECKS_PER_SETPOINT: u32 = 4;

/// Time in which a trajectory on board comes from rest to the speed of the first letter, and from
/// that of the last one to rest, s: 0.4 m/s² at 0.2 m/s.
const RUN_S: f64 = 0.5;

/// The part of a plan that flies as a trajectory: a run-up from rest, all letters, and a run-out to
/// rest. Take-off and landing are commands of their own.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    setpoints: Vec<Setpoint>,
}

impl Stretch {
    /// The stretch of a plan.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a plan without letters.
    pub(super) fn new(plan: &Plan) -> Result<Self> {
        let writes = |setpoint: &Setpoint| setpoint.letter.is_some();
        let first = plan.setpoints.iter().position(writes);
        let last = plan.setpoints.iter().rposition(writes);
        let Some((first, last)) = first.zip(last).filter(|(first, last)| first < last) else {
            let hint = "plan a word, not only a take-off";
            return Err(Error::input("plan", "no letter", "setpoints that write a letter", hint));
        };
        // The last stroke ends at the setpoint after the last one of a letter.
        let end = (last + 1).min(plan.setpoints.len() - 1);
        let (start, stop) = (&plan.setpoints[first], &plan.setpoints[end]);
        let run_up = Setpoint {
            time_s: start.time_s - RUN_S,
            position_m: start.position_m - start.velocity_m_s * (RUN_S / 2.0),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: start.velocity_m_s / RUN_S,
            letter: None,
        };
        let run_out =
            Setpoint { acceleration_m_s2: -stop.velocity_m_s / RUN_S, letter: None, ..*stop };
        let rest = Setpoint {
            time_s: stop.time_s + RUN_S,
            position_m: run_out.design_m(stop.time_s + RUN_S),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: None,
        };
        let letters = plan.setpoints[first..end].iter().copied();
        let setpoints = [run_up].into_iter().chain(letters).chain([run_out, rest]).collect();
        Ok(Self { setpoints })
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

    /// Largest distance of a trajectory from the design, m.
    pub(super) fn worst_m(&self, position_m: impl Fn(f64) -> Vector3<f64>) -> f64 {
        let off_m = |t: f64| (position_m(t) - self.position_m(t)).norm();
        self.check_times_s(0, self.last()).map(off_m).fold(0.0, f64::max)
    }

    /// A trajectory that is longer than the drone's memory: how many letters fit before `until_s`.
    pub(super) fn too_long(&self, until_s: f64, found: &str, hint: &str) -> Error {
        let letters = |until_s: f64| {
            let flown = self.setpoints.iter().filter(|s| s.time_s - self.start_s() < until_s);
            flown.filter_map(|setpoint| setpoint.letter).collect::<BTreeSet<_>>().len()
        };
        // The letter that does not end in time does not fit.
        let (fit, all) = (letters(until_s).saturating_sub(1), letters(f64::INFINITY));
        let what = format!("{found}: {fit} of {all} letters fit");
        Error::Infeasible { what, hint: hint.to_owned() }
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
