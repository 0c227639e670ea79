//! Feedforward, which sends setpoints ahead of the design so that a lagging drone follows it.
//!
//! The input is a [`Plan`] and the step responses of the position loop. The output is the plan with
//! the positions to send. The method is the loop's zero-phase [`Inverse`] over the flight, per
//! axis.

use nalgebra::Vector3;

use super::{Plan, PlanData, Setpoint};
use crate::response::{Inverse, StepResponse};
use noctograph_core::flight::Flight;
use noctograph_core::flight::table::on_grid;
use noctograph_core::parallel;

/// Weight of the input relative to the output error. A smaller weight would require tilts that the
/// drone cannot reach.
const RIDGE: f64 = 0.02;

/// Returns the inverses of the position loop at the times of a plan's setpoints, one for each axis.
///
/// # Panics
///
/// Panics if the plan's times do not ascend.
pub fn inverse<'a>(plan: &Plan, responses: &'a [StepResponse; 3]) -> [Inverse<'a>; 3] {
    for_axes(|axis| {
        let times_s = plan.setpoints.iter().map(|setpoint| setpoint.time_s);
        responses[axis].inverse(times_s.collect(), RIDGE)
    })
}

/// Returns the plan that sends, on each axis, the inputs whose output is the design. The offset of
/// the sent positions from the design is preserved.
pub fn feedforward(plan: &Plan, inverse: &[Inverse<'_>; 3]) -> Plan {
    let inputs = for_axes(|axis| {
        // An axis that never moves needs no inverse.
        let first = plan.setpoints.first().map_or(0.0, |setpoint| setpoint.position_m[axis]);
        if plan.setpoints.iter().all(|setpoint| setpoint.position_m[axis] == first) {
            return vec![first; plan.setpoints.len()];
        }
        inverse[axis].inputs(|time_s| plan.design_m(time_s)[axis])
    });
    sending(plan, |row| {
        let input = Vector3::new(inputs[0][row], inputs[1][row], inputs[2][row].max(0.0));
        input + (plan.sent_m(row) - plan.setpoints[row].position_m)
    })
}

/// Adds the inverse of a flight's `design − flown` to the sent positions of a plan, which is one
/// step of iterative learning control (Arimoto 1984).
pub fn corrected(plan: &Plan, flight: &Flight, inverse: &[Inverse<'_>; 3]) -> Plan {
    let inputs = for_axes(|axis| {
        inverse[axis].inputs(|time_s| {
            let next = flight.samples.partition_point(|sample| sample.time_s <= time_s);
            // On the floor, there is no error to correct.
            let on_floor = plan.setpoint_at(time_s).is_none_or(Setpoint::on_floor);
            let sample = flight.samples.get(next.max(1) - 1).filter(|_| !on_floor);
            sample.map_or(0.0, |sample| (sample.design_m - sample.position_m)[axis])
        })
    });
    sending(plan, |row| {
        plan.sent_m(row) + Vector3::new(inputs[0][row], inputs[1][row], inputs[2][row])
    })
}

/// Subtracts a mean error `flown − design` from the positions that a plan sends.
pub fn offset(plan: &Plan, mean_error_m: Vector3<f64>) -> Plan {
    sending(plan, |row| plan.sent_m(row) - mean_error_m)
}

/// Returns the values of a function for the three axes, computed in parallel.
fn for_axes<T: Send>(axis: impl Fn(usize) -> T + Sync) -> [T; 3] {
    let (x, (y, z)) = parallel::join(|| axis(0), || parallel::join(|| axis(1), || axis(2)));
    [x, y, z]
}

/// Returns the plan that sends the position `sent_m` of each row at which the drone flies, and its
/// previous positions on the floor.
fn sending(plan: &Plan, sent_m: impl Fn(usize) -> Vector3<f64>) -> Plan {
    let sent = |(row, setpoint): (usize, &Setpoint)| {
        if setpoint.on_floor() { plan.sent_m(row) } else { sent_m(row).map(on_grid) }
    };
    let sent_m = plan.setpoints.iter().enumerate().map(sent).collect();
    Plan::made(PlanData { sent_m, ..plan.clone().into_data() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PlanOptions;
    use crate::tests::written;

    fn noor() -> Plan {
        written("NO", &PlanOptions::even())
    }

    #[test]
    fn a_loop_without_lag_is_sent_the_design() {
        // A held setpoint is exact halfway through its interval, so half an interval of lead
        // remains.
        let at_once = StepResponse { interval_s: 0.001, values: vec![1.0; 3] };
        let responses = [at_once.clone(), at_once.clone(), at_once];
        let sent = feedforward(&noor(), &inverse(&noor(), &responses));
        for (row, setpoint) in sent.setpoints.iter().enumerate() {
            assert!((sent.sent_m(row) - setpoint.position_m).norm() < 0.06, "row {row}");
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
