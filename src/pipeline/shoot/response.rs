//! Measures the step response of the closed loop.
//!
//! The response is the difference between two simulated flights, with and without a small step of
//! the setpoint. Offsets and noise common to both cancel, which leaves the linear response of
//! controller, observer, rotors and sampling.

use nalgebra::Vector3;

use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_core::parallel;
use noctograph_core::plan::PlanData;
use noctograph_plan::response::StepResponse;
use noctograph_plan::{Plan, Setpoint};
use noctograph_sim::{Drone, SimOptions, fly};

/// Size of the step. It is small enough for the drone to remain linear (1.5° of tilt with the
/// reference gains), and large compared with a micrometer, the grid of a flight's positions.
const STEP_M: f64 = 0.05;
/// Time before the step, in which the drone comes to rest. Loops settle in two to four seconds.
const BEFORE_S: f64 = 4.0;
/// Duration of the response.
const AFTER_S: f64 = 6.0;
/// Height at which the floor does not affect the drone.
const HEIGHT_M: f64 = 1.5;
/// Maximum error after the response, as a fraction of the step.
const MAX_ERROR_FRAC: f64 = 0.05;

/// Returns the responses of the drone's position to a step of the setpoint along world x, y and z.
///
/// # Errors
///
/// Returns the errors of [`fly`], and [`Error::Infeasible`] if the loop does not settle in 6 s.
pub fn step_responses(options: &SimOptions) -> Result<[StepResponse; 3]> {
    let options = options.rehearsal();
    let (still, stepped) =
        parallel::join(|| fly_step(&options, 0.0), || fly_step(&options, STEP_M));
    let (still, stepped) = (still?, stepped?);
    // The response is normalized by the size of the step.
    let pairs = still.samples.iter().zip(&stepped.samples);
    let response: Vec<Vector3<f64>> = pairs
        .filter(|(still, _)| still.time_s >= BEFORE_S)
        .map(|(still, stepped)| (stepped.position_m - still.position_m) / STEP_M)
        .collect();
    // A loop that does not reach the setpoint has no inverse.
    let end = response.last().copied().unwrap_or_default();
    if let Some(axis) = (0..3).find(|axis| (end[*axis] - 1.0).abs() > MAX_ERROR_FRAC) {
        let after = format!("{AFTER_S} s after a step of the setpoint along axis {axis}");
        return Err(Error::infeasible(
            format!("{after} the drone has moved by {:.0} % of it", 100.0 * end[axis]),
            "set plan.reference = \"design\", or choose gains that follow",
        ));
    }
    let interval_s = 1.0 / f64::from(options.rates.log_hz);
    Ok([0, 1, 2].map(|axis| {
        let values = response.iter().map(|position| position[axis]).collect();
        StepResponse { interval_s, values }
    }))
}

/// Simulates a hovering drone whose setpoint steps by `step_m` along all axes at once.
fn fly_step(options: &SimOptions, step_m: f64) -> Result<Flight> {
    let times_and_steps = [(0.0, 0.0), (BEFORE_S, step_m), (BEFORE_S + AFTER_S, step_m)];
    let setpoints = times_and_steps.map(|(time_s, step_m)| Setpoint {
        time_s,
        position_m: Vector3::new(step_m, step_m, HEIGHT_M + step_m),
        velocity_m_s: Vector3::zeros(),
        acceleration_m_s2: Vector3::zeros(),
        letter: None,
    });
    let plan = Plan::made(PlanData { setpoints: setpoints.into(), ..PlanData::default() });
    fly(&plan, &Drone::new(options, 0), &mut |_| {})
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_sim::ControllerKind;

    #[test]
    fn the_reference_loop_answers_as_its_linear_model_does() {
        // The lag behind a ramp is K_v / K_p, which equals the area above the step response.
        let responses = step_responses(&SimOptions::default()).unwrap();
        for (response, lag_s) in responses.iter().zip([0.461, 0.495, 0.454]) {
            let area_s: f64 = response.values.iter().map(|v| (1.0 - v) * response.interval_s).sum();
            assert!((area_s - lag_s).abs() < 0.03, "{area_s} s instead of {lag_s} s");
            assert!((1.0..4.0).contains(&response.settled_s()), "{}", response.settled_s());
        }
    }

    #[test]
    fn every_controller_comes_to_its_setpoint() {
        for &kind in ControllerKind::ALL {
            let mut options = SimOptions::default();
            options.controller.kind = kind;
            for response in step_responses(&options).unwrap() {
                let most = response.values.iter().copied().fold(0.0, f64::max);
                assert!((1.0..1.6).contains(&most), "{kind:?} overshoots to {most}");
            }
        }
    }
}
