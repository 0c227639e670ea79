//! Lead: setpoints run ahead of the design so that a controller of held positions flies the design.
//!
//! Product in: [`Plan`] and the loop's step responses. Product out: the plan with the positions to
//! send. Method: the zero-phase inverse of [`StepResponse`] over the whole flight, per axis. What
//! is known to stand off (a mean error) is taken off every setpoint; what a flight missed is sent
//! through the inverse once more ([`learn`]).

use nalgebra::Vector3;

use super::{Plan, Setpoint};
use crate::control::StepResponse;
use crate::flight::Flight;
use crate::flight::table::on_grid;

/// Weight of what is sent against what comes out. Less asks the drone for tilts it does not reach.
const RIDGE: f64 = 0.02;

/// Sends what makes the loop fly the plan's design: each axis through the inverse of its response.
///
/// Setpoints on the floor, where motors are off, stay as they are; an offset stays, too.
///
/// # Panics
///
/// If the plan's times do not rise.
#[must_use]
pub fn lead(plan: &Plan, responses: &[StepResponse; 3]) -> Plan {
    let times_s: Vec<f64> = plan.setpoints.iter().map(|setpoint| setpoint.time_s).collect();
    let axes: Vec<Vec<f64>> = (0..3)
        .map(|axis| {
            let design = |time_s: f64| plan.design_m(time_s)[axis];
            let first = plan.setpoints.first().map_or(0.0, |setpoint| setpoint.position_m[axis]);
            if plan.setpoints.iter().all(|setpoint| setpoint.position_m[axis] == first) {
                return vec![first; times_s.len()];
            }
            responses[axis].inverse(&times_s, design, RIDGE)
        })
        .collect();
    let sent = plan.setpoints.iter().enumerate().map(|(row, setpoint)| {
        if setpoint.on_floor() {
            return setpoint.position_m;
        }
        let sent = Vector3::new(axes[0][row], axes[1][row], axes[2][row].max(0.0));
        let already = plan.sent_m(row) - setpoint.position_m;
        (sent + already).map(on_grid)
    });
    Plan { sent_m: sent.collect(), ..plan.clone() }
}

/// Corrects what is sent by what a flight of it missed: adds the inverse of `design − flown`, per
/// axis. It is what a controller that follows the design's motion still needs, and one step of
/// learning from flight to flight for any.
///
/// # Panics
///
/// If the plan's times do not rise.
#[must_use]
pub fn learn(plan: &Plan, flight: &Flight, responses: &[StepResponse; 3]) -> Plan {
    let times_s: Vec<f64> = plan.setpoints.iter().map(|setpoint| setpoint.time_s).collect();
    let axes: Vec<Vec<f64>> = (0..3)
        .map(|axis| {
            let missed = |time_s: f64| {
                let next = flight.samples.partition_point(|sample| sample.time_s <= time_s);
                let on_floor = plan.setpoint_at(time_s).is_none_or(Setpoint::on_floor);
                let sample = flight.samples.get(next.max(1) - 1).filter(|_| !on_floor);
                sample.map_or(0.0, |sample| (sample.design_m - sample.position_m)[axis])
            };
            responses[axis].inverse(&times_s, missed, RIDGE)
        })
        .collect();
    let sent = plan.setpoints.iter().enumerate().map(|(row, setpoint)| {
        let more = Vector3::new(axes[0][row], axes[1][row], axes[2][row]);
        let more = if setpoint.on_floor() { Vector3::zeros() } else { more };
        (plan.sent_m(row) + more).map(on_grid)
    });
    Plan { sent_m: sent.collect(), ..plan.clone() }
}

/// Moves what is sent against a mean error of earlier flights: `flown − design`.
#[must_use]
pub fn offset(plan: &Plan, mean_error_m: Vector3<f64>) -> Plan {
    let sent = plan.setpoints.iter().enumerate().map(|(row, setpoint)| {
        let shift = if setpoint.on_floor() { Vector3::zeros() } else { mean_error_m };
        (plan.sent_m(row) - shift).map(on_grid)
    });
    Plan { sent_m: sent.collect(), ..plan.clone() }
}

impl Plan {
    /// The position that is sent with a setpoint.
    #[must_use]
    pub fn sent_m(&self, row: usize) -> Vector3<f64> {
        self.sent_m.get(row).copied().unwrap_or_else(|| self.setpoints[row].position_m)
    }

    /// The setpoint in force at a time; before the first one, that one.
    #[must_use]
    pub fn setpoint_at(&self, time_s: f64) -> Option<&Setpoint> {
        let next = self.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s);
        self.setpoints.get(next.max(1) - 1)
    }

    /// Where the design is at a time; before the first setpoint, at it. The origin for a plan
    /// without any.
    #[must_use]
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        match self.setpoint_at(time_s) {
            Some(setpoint) => setpoint.design_m(time_s.max(setpoint.time_s)),
            None => Vector3::zeros(),
        }
    }
}

impl Setpoint {
    /// Whether it asks for motors off.
    #[must_use]
    pub fn on_floor(&self) -> bool {
        self.position_m.z <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::plan::{PlanOptions, plan};

    fn noor() -> Plan {
        let strokes = write("NO", &LetterOptions::default()).unwrap();
        plan(&strokes, &PlanOptions::even()).unwrap()
    }

    #[test]
    fn a_loop_that_obeys_at_once_is_sent_the_design() {
        // A held setpoint is right in its middle: that is all that is led by.
        let at_once = StepResponse { interval_s: 0.001, values: vec![1.0; 3] };
        let led = lead(&noor(), &[at_once.clone(), at_once.clone(), at_once]);
        for (row, setpoint) in led.setpoints.iter().enumerate() {
            assert!((led.sent_m(row) - setpoint.position_m).norm() < 0.06, "row {row}");
        }
    }

    #[test]
    fn an_offset_leaves_the_floor_and_the_design_alone() {
        let plan = noor();
        let moved = offset(&plan, Vector3::new(-0.07, 0.02, 0.0));
        assert_eq!(moved.setpoints, plan.setpoints);
        for (row, setpoint) in plan.setpoints.iter().enumerate() {
            let shift = moved.sent_m(row) - setpoint.position_m;
            let want = if setpoint.on_floor() { 0.0 } else { 0.07 };
            assert!((shift.x - want).abs() < 2e-6, "row {row}: {shift}");
        }
    }
}
