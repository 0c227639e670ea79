//! Flight of a plan whose light commands were timed after the plan was flown.
//!
//! Timed light commands add rows to a plan. A drone that holds the positions of setpoints moves the
//! same with these rows, so that only design, letters and lights of its flight differ. The flight
//! can therefore be simulated while another one is simulated to time the commands.

use super::avionics::TIME_TOLERANCE_S;
use super::fly::check_plan;
use super::options::{Drone, SetpointKind};
use super::recorder::grounded;
use crate::vehicle::FloorOptions;
use noctograph_core::flight::Flight;
use noctograph_core::flight::table::on_grid;
use noctograph_core::plan::{Plan, Setpoint};

/// True if light commands between two setpoints do not affect a drone's motion. This requires that
/// its controller holds the position of each setpoint, and that no radio delays setpoints.
pub fn holds_positions(drone: &Drone<'_>) -> bool {
    let controller = &drone.believed.controller;
    !controller.kind.follows_reference()
        && controller.setpoints == SetpointKind::Position
        && drone.actual.radio.drones == 0
}

/// Converts a simulated flight of the plan `flown` to the same drone's flight of `plan`, which
/// differs only in its light commands. The result is bit for bit that of [`fly`](crate::fly).
/// Returns `None` if the commands could affect the motion or a warning.
pub fn relit(before: Flight, flown: &Plan, plan: &Plan, drone: &Drone<'_>) -> Option<Flight> {
    let floor = &drone.actual.floor;
    let is_alike = holds_positions(drone) && adds_held_rows(flown, plan, floor);
    if !is_alike || check_plan(plan, floor).is_err() {
        return None;
    }
    let grounded_before = grounded(&before.samples);
    let mut flight = before.into_data();
    let channels = plan.lights.keys().cloned();
    flight.lights = channels.map(|name| (name, Vec::with_capacity(flight.samples.len()))).collect();
    let rates = &drone.actual.rates;
    let ticks = (0_u32..).step_by((rates.control_hz / rates.log_hz) as usize);
    let mut row = 0;
    for (tick, sample) in ticks.zip(&mut flight.samples) {
        let time_s = f64::from(tick) / f64::from(rates.control_hz);
        let later = plan.setpoints[row + 1..].iter();
        row += later.take_while(|later| later.time_s <= time_s + TIME_TOLERANCE_S).count();
        let setpoint = &plan.setpoints[row];
        (sample.design_m, sample.letter) =
            (setpoint.design_m(time_s).map(on_grid), setpoint.letter);
        for (column, levels) in flight.lights.values_mut().zip(plan.lights.values()) {
            column.push(on_grid(levels[row]));
        }
    }
    // The warning that a drone stays on the floor depends on the height of the design.
    (grounded(&flight.samples) == grounded_before).then(|| Flight::made(flight))
}

/// True if a plan has the rows of another one and, between them, rows with the same position, floor
/// and letter as the row before.
fn adds_held_rows(flown: &Plan, plan: &Plan, floor: &FloorOptions) -> bool {
    let is_on_floor = |setpoint: &Setpoint| {
        let position_m = setpoint.position_m;
        position_m.z <= floor.height_m(position_m.x, position_m.y)
    };
    let mut n_flown = 0;
    for (row, setpoint) in plan.setpoints.iter().enumerate() {
        let is_same = |other: usize| {
            flown.setpoints.get(other) == Some(setpoint) && flown.sent_m(other) == plan.sent_m(row)
        };
        if is_same(n_flown) {
            n_flown += 1;
            continue;
        }
        // An additional row is compared with the row that precedes it in `flown`.
        let Some(before) = n_flown.checked_sub(1) else { return false };
        let held = &flown.setpoints[before];
        let is_held = setpoint.letter == held.letter
            && is_on_floor(setpoint) == is_on_floor(held)
            && plan.sent_m(row) == flown.sent_m(before);
        if !is_held {
            return false;
        }
    }
    n_flown == flown.setpoints.len() && flown.yaw_rad == plan.yaw_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fly::tests::flown;
    use crate::tests::written;
    use crate::{ControllerKind, SimOptions};
    use noctograph_core::plan::PlanData;
    use noctograph_plan::{Between, LampTiming, PlanOptions, time_lights};

    /// Returns a plan that sends its positions, and the same plan with timed lights.
    fn plans(options: &SimOptions) -> [Plan; 2] {
        let mut plan = written("NO", &PlanOptions::even());
        plan.edit(|plan| {
            plan.sent_m = plan.setpoints.iter().map(|s| s.position_m.map(on_grid)).collect()
        });
        let flight = flown(&plan, options, 0).unwrap();
        let lamp = LampTiming { delay_s: 0.013, tick_s: 0.001 };
        let timed = time_lights(&plan, &flight, &lamp, Between::Held).unwrap().0;
        [plan, timed]
    }

    #[test]
    fn a_relit_flight_has_the_bits_of_a_flight_with_the_lights() {
        for mut options in [SimOptions::default(), SimOptions::cf21()] {
            for kind in [ControllerKind::Lqr, ControllerKind::Pid] {
                options.controller.kind = kind;
                let [plan, timed] = plans(&options);
                assert!(timed.setpoints.len() > plan.setpoints.len(), "rows are added");
                let wanted = flown(&timed, &options, 7).unwrap();
                let dark = flown(&plan, &options, 7).unwrap();
                assert!(dark != wanted);
                let relit = relit(dark, &plan, &timed, &Drone::new(&options, 7));
                assert!(relit == Some(wanted), "{kind:?}");
            }
        }
    }

    #[test]
    fn a_flight_that_the_rows_could_change_is_flown_again() {
        let mut options = SimOptions::default();
        let [plan, timed] = plans(&options);
        let relit = |options: &SimOptions, timed: &Plan| {
            let flight = flown(&plan, options, 7).unwrap();
            relit(flight, &plan, timed, &Drone::new(options, 7)).is_some()
        };
        assert!(relit(&options, &timed));
        let changed = |change: fn(&mut PlanData)| {
            let mut plan = timed.clone();
            plan.edit(change);
            plan
        };
        assert!(!relit(&options, &changed(|plan| plan.sent_m[50].x += 1e-6)), "position");
        assert!(!relit(&options, &changed(|plan| plan.setpoints[50].letter = Some(9))), "letter");
        assert!(!relit(&options, &changed(|plan| plan.yaw_rad = 0.1)), "heading");
        options.radio.drones = 1;
        assert!(!relit(&options, &timed), "each row is a packet");
        options.radio.drones = 0;
        options.controller.kind = ControllerKind::LqrFeedforward;
        assert!(!relit(&options, &timed), "follows the design");
    }
}
