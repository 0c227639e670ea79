//! Altitude hold in the full simulator: a slow level flight controlled by the altitude filter.

use nalgebra::Vector3;

use super::scenario::{HoldScenario, SPEED_M_S};
use super::{Hold, HoldSample, SAMPLES_HZ, SET_M};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::error::Result;
use noctograph_plan::{Plan, PlanData, Setpoint};
use noctograph_sim::vehicle::Plant;
use noctograph_sim::{Avionics, Drone, SimOptions, fly_watched};

/// Flies a scenario in the full simulator, as described at [`super::hold()`]. Returns an error if
/// the options are invalid or the drone is lost.
pub(super) fn hold(
    believed: &SimOptions,
    scenario: HoldScenario,
    duration_s: f64,
    seed: u64,
) -> Result<Hold> {
    let actual = scenario.applied(believed, seed);
    let plan = level_flight(duration_s);
    let rate_hz = actual.rates.control_hz;
    let ticks_per_sample = (rate_hz / SAMPLES_HZ).max(1);
    let (mut samples, mut readings, mut n_steps) = (Vec::new(), Vec::new(), 0);
    let drone = Drone { believed, ..Drone::new(&actual, seed) };
    let watch = &mut |tick: u32, plant: &Plant, avionics: &Avionics| {
        let Some(filter) = avionics.altitude() else { return };
        // A sample contains the readings of all ticks since the previous one.
        readings.extend_from_slice(filter.readings());
        if tick.is_multiple_of(ticks_per_sample) {
            let throttle = avionics.motors().iter().sum::<f64>() / (4.0 * actual.vehicle.motor_max);
            let truth = truth(plant, &actual, avionics.sensors().barometer_bias_m());
            let time_s = f64::from(tick) / f64::from(rate_hz);
            let readings = std::mem::take(&mut readings);
            samples.push(HoldSample::new(time_s, truth, filter, throttle, readings));
            n_steps = filter.steps();
        }
    };
    fly_watched(&[(&plan, drone)], watch, &mut |_| {})?;
    Ok(Hold { set_m: SET_M, samples, steps: n_steps })
}

/// Returns the true states, in the order and the units of
/// [`AltitudeState`](noctograph_sim::AltitudeState). The floor is taken where the tilted ranger
/// points. A steady draft is part of α⁰. `barometer_m` is the true bias of the barometer.
fn truth(plant: &Plant, actual: &SimOptions, barometer_m: f64) -> [f64; 6] {
    let (body, vehicle) = (plant.body(), &actual.vehicle);
    let (position_m, down) = (body.position_m, -body.matrix().column(2));
    let ranger_m = -actual.floor.distance_m(&position_m, &down) * down.z - position_m.z;
    let draft_m_s2 = vehicle.body_drag_n_s_m[2] / vehicle.mass_kg * actual.air.wind_m_s[2];
    let offset_m_s2 = draft_m_s2 - GRAVITY_M_S2;
    let velocity_m_s = body.velocity_m_s.z;
    [position_m.z, velocity_m_s, offset_m_s2, plant.gain_m_s2(), ranger_m, barometer_m]
}

/// Returns a plan along x at [`SPEED_M_S`] and the altitude [`SET_M`], with one setpoint per second
/// and one at the end.
fn level_flight(duration_s: f64) -> Plan {
    let seconds = (0..3600).map(f64::from).take_while(|time_s| *time_s < duration_s);
    let setpoints = seconds.chain([duration_s]).map(|time_s| Setpoint {
        time_s,
        position_m: Vector3::new(SPEED_M_S * time_s, 0.0, SET_M),
        velocity_m_s: Vector3::x() * SPEED_M_S,
        acceleration_m_s2: Vector3::zeros(),
        letter: None,
    });
    Plan::made(PlanData { setpoints: setpoints.collect(), ..PlanData::default() })
}
