//! Sim: a plan is flown.
//!
//! Product in: [`Plan`]. Product out: [`Flight`], which a real flight's log gives as well.
//!
//! Method: at every tick (500 Hz) the sensors are read, the estimator takes them in, a controller
//! answers the estimate with four motor commands, which it may hold for some ticks; these move the
//! drone ([`Plant`]): rotors, rigid body, battery, air and floor. The drone starts at rest at the
//! first setpoint, and a setpoint at or below the floor switches the motors off. The controller of
//! the default, a linear-quadratic regulator, holds a setpoint as it was sent: a position with no
//! velocity, which the drone trails by about half a second; [`ControllerKind`] names four others.
//! [`design`] makes the gains without a flight. [`fly_together`] flies one plan with many seeds.
//!
//! Sources: equations, weights and figures of the reference flight (AE483, 2022; preset
//! `ae483-2022`, the default of [`SimOptions`]); Lighthouse errors from Bitcraze's
//! `positioning_dataset` (arXiv 2104.11523); IMU noise from the data sheet of the BMI088; the other
//! sensors and the Kalman filter after the Crazyflie's firmware.
//!
//! Not modelled: lag of the radio, lost packets, downwash between drones; whole-number motor
//! commands; filters and offsets of the inertial sensors, reflections and people in the
//! Lighthouse's light; sliding, bouncing and tipping on the floor.

mod controller;
mod coverage;
pub mod design;
mod estimator;
pub mod identify;
mod lanes;
mod mixer;
mod noise;
mod normals;
mod options;
mod presets;
mod recorder;
#[cfg(test)]
mod reference_flight;
mod response;
mod rig;
mod sensors;
mod together;
mod vehicle;
mod wide;

pub use coverage::{Coverage, Place, coverage};
pub use estimator::{EstimatorKind, ObserverOptions};
pub use options::{ControllerKind, ControllerOptions, MotorLag, RateOptions, SimOptions};
pub use response::step_responses;
pub use sensors::{
    Generation, HeightSensor, LighthouseConfig, Positioning, SensorOptions, Station,
    read_lighthouse_config,
};
pub use vehicle::{
    AirOptions, BatteryOptions, Body, Compensation, GroundEffect, Gusts, Plant, VehicleOptions,
};

use self::rig::{LOST, TIME_TOLERANCE_S};
use self::together::{Together, fly_lanes};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::plan::Plan;

/// Longest plan that is flown. A battery lasts for a tenth of it.
const MAX_DURATION_S: f64 = 3600.0;
/// Drones that fill the widest registers that processors have, those of AVX-512.
pub const FLY_TOGETHER: usize = 8;
/// Ticks between two reports of progress.
const TICKS_PER_REPORT: u32 = 250;

/// Flies a plan: where the drone would go, with the noise of `seed`.
///
/// The flight runs from 0 to the time of the last setpoint. The same plan, options and seed give
/// the same bytes on every machine. `progress` is called with the fraction done, 0 to 1.
///
/// # Errors
///
/// What [`SimOptions::check`] finds; [`Error::Input`] for a plan without setpoints or
/// with figures that no drone can reach;
/// [`Error::Infeasible`] for one longer than an hour, for weights that have no gain, and for a
/// drone that turns over or flies away.
///
/// # Panics
///
/// If a column of `plan.lights` is not as long as `plan.setpoints`.
pub fn fly(
    plan: &Plan,
    options: &SimOptions,
    seed: u64,
    progress: &mut dyn FnMut(f64),
) -> Result<Flight> {
    fly_unlike(plan, options, options, seed, progress)
}

/// Flies a plan with a drone that is not as its controller believes: controller and estimator are
/// made for `believed`, while body, motors, battery, air and sensors are those of `actual`.
///
/// # Errors
///
/// As [`fly`], for either.
///
/// # Panics
///
/// As [`fly`], and if the two have other [`RateOptions`].
pub fn fly_unlike(
    plan: &Plan,
    believed: &SimOptions,
    actual: &SimOptions,
    seed: u64,
    progress: &mut dyn FnMut(f64),
) -> Result<Flight> {
    let n_ticks = check(plan, believed, actual)?;
    let flights = fly_lanes::<f64>((), plan, believed, &[(actual, seed)], n_ticks, progress);
    progress(1.0);
    flights.into_iter().next().expect("one drone, one flight")
}

/// Flies a plan many times, each with a drone and a seed of its own: the same flights as
/// [`fly_unlike`] makes one by one, bit for bit and in the same order, with its errors in their
/// places, in less time. Where the processor has registers for several numbers, as many drones share
/// the work of their physics, if their options differ in figures alone; so give them by the dozen,
/// or [`FLY_TOGETHER`] at once.
///
/// # Panics
///
/// As [`fly_unlike`].
#[must_use]
pub fn fly_together(
    plan: &Plan,
    believed: &SimOptions,
    drones: &[(&SimOptions, u64)],
) -> Vec<Result<Flight>> {
    pulp::Arch::new().dispatch(Together { plan, believed, drones })
}

/// Checks all that can be checked before a flight: its number of ticks.
fn check(plan: &Plan, believed: &SimOptions, actual: &SimOptions) -> Result<u32> {
    assert_eq!(believed.rates, actual.rates, "one clock");
    believed.check()?;
    actual.check()?;
    check_plan(plan)?;
    n_ticks(plan, actual.rates.control_hz)
}

/// Checks that there is something to fly, and that it is made of numbers within a drone's world.
fn check_plan(plan: &Plan) -> Result<()> {
    let n = plan.setpoints.len();
    assert!(plan.lights.values().all(|column| column.len() == n), "a light for every setpoint");
    assert!([0, n].contains(&plan.sent_m.len()), "a position sent for every setpoint, or none");
    let hint = "make the plan anew from its word, or mend the file it was read from";
    if plan.setpoints.is_empty() {
        return Err(Error::input("plan", "no setpoint", "at least one setpoint", hint));
    }
    for (i, s) in plan.setpoints.iter().enumerate() {
        let sent_m = plan.sent_m(i);
        let moving = s.velocity_m_s.iter().chain(&s.acceleration_m_s2);
        for value in s.position_m.iter().chain(moving).chain(&sent_m) {
            if value.is_nan() || value.abs() >= LOST {
                let wanted = format!("a number within ±{LOST}");
                return Err(Error::input(format!("plan, setpoint {i}"), value, wanted, hint));
            }
        }
    }
    Ok(())
}

/// Control ticks from the first setpoint to the last.
fn n_ticks(plan: &Plan, rate_hz: u32) -> Result<u32> {
    let duration_s = plan.duration_s();
    if !(0.0..=MAX_DURATION_S).contains(&duration_s) {
        return Err(Error::Infeasible {
            what: format!("the plan lasts {duration_s} s, the longest flight {MAX_DURATION_S} s"),
            hint: "write a shorter word, or draw faster".into(),
        });
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 7.2e6")]
    Ok(((duration_s + TIME_TOLERANCE_S) * f64::from(rate_hz)) as u32)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::flight::{BATTERY_V, ENERGY_J, FlightSample, SATURATED_S};
    use crate::plan::Setpoint;

    /// Setpoints `(time, x, z)` with a light on all of them.
    fn plan(points: &[(f64, f64, f64)]) -> Plan {
        let setpoint = |&(time_s, x, z): &(f64, f64, f64)| Setpoint {
            time_s,
            position_m: Vector3::new(x, 0.0, z),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(0),
        };
        let setpoints: Vec<_> = points.iter().map(setpoint).collect();
        let lights = [("headlights".to_owned(), vec![0.5; setpoints.len()])].into();
        Plan { setpoints, lights, ..Plan::default() }
    }

    fn fly_default(plan: &Plan) -> Result<Flight> {
        fly(plan, &SimOptions::default(), 1, &mut |_| {})
    }

    #[test]
    fn a_drone_takes_off_hovers_and_lands() {
        let up_and_down =
            plan(&[(0.0, 0.2, 0.0), (1.0, 0.2, 0.5), (6.0, 0.2, 0.0), (8.0, 0.2, 0.0)]);
        let flight = fly_default(&up_and_down).unwrap();
        let at = |time_s: f64| flight.samples.iter().find(|s| s.time_s >= time_s).unwrap();
        assert_eq!(at(0.9).position_m, Vector3::x() * 0.2, "waits on the floor");
        assert_eq!(at(0.9).motors, [0.0; 4]);
        assert!((at(5.9).position_m.z - 0.5).abs() < 0.03, "hovers: {:?}", at(5.9));
        let end = flight.samples.last().unwrap();
        assert_eq!((end.position_m.z, end.motors), (0.0, [0.0; 4]), "lies on the floor");
        assert_eq!(end.velocity_body_m_s, Vector3::zeros());
        assert_eq!((flight.samples.len(), end.time_s), (2001, 8.0), "250 Hz, both ends");
        assert_eq!(flight.lights["headlights"], vec![0.5; 2001]);
    }

    #[test]
    fn saturation_while_writing_is_reported() {
        let flight =
            fly_default(&plan(&[(0.0, 0.0, 0.5), (1.0, 0.0, 1.5), (3.0, 0.0, 1.5)])).unwrap();
        assert!(
            flight.warnings[0].starts_with("a motor was at its limit"),
            "{:?}",
            flight.warnings
        );
        let saturated_s = &flight.extra[SATURATED_S];
        let cut = |s: &FlightSample| s.motors.iter().any(|m| [0.0, 65_535.0].contains(m));
        let ticks = flight.samples.iter().filter(|s| cut(s)).count() as f64;
        // Samples are every second tick.
        let last_s = *saturated_s.last().unwrap();
        assert!(ticks > 10.0 && (last_s / (0.004 * ticks) - 1.0).abs() < 0.1, "{last_s} s");
        assert!(saturated_s.is_sorted() && saturated_s[0] == 0.0, "counts up from nought");
        assert_eq!(flight.extra.len(), 1, "no battery, no voltage");
    }

    #[test]
    fn a_battery_is_in_the_log_with_what_it_gave() {
        let hover = plan(&[(0.0, 0.0, 0.5), (10.0, 0.0, 0.5)]);
        let flight = fly(&hover, &SimOptions::cf21(), 1, &mut |_| {}).unwrap();
        let column = |name: &str| flight.extra[name].as_slice();
        let (volts, joules) = (column(BATTERY_V), column(ENERGY_J));
        assert_eq!((volts.len(), column(SATURATED_S).last()), (flight.samples.len(), Some(&0.0)));
        // In hover 0.24 A + 6.68 A/N · 0.3218 N = 2.39 A.
        let want_j: f64 = volts.iter().skip(1).map(|v| v * 2.39 * 0.004).sum();
        let found_j = joules.last().unwrap();
        assert!((found_j / want_j - 1.0).abs() < 0.01, "{found_j} J of {want_j} J");
        assert!(joules.is_sorted() && volts[0] > *volts.last().unwrap());
    }

    #[test]
    fn a_drone_heavier_than_its_controller_believes_hangs_low() {
        let hover = plan(&[(0.0, 0.0, 0.5), (6.0, 0.0, 0.5)]);
        let believed = SimOptions::default();
        let mut actual = believed.clone();
        actual.vehicle.mass_kg *= 1.02;
        let fly = |believed, actual| fly_unlike(&hover, believed, actual, 1, &mut |_| {}).unwrap();
        let last = |flight: Flight| flight.samples.last().unwrap().position_m.z;
        // What is lifted by position error alone: 2 % of the weight over K's 0.364 N/m.
        let sag_m = 0.02 * 0.0351 * 9.81 / 0.364;
        let low_m = last(fly(&believed, &believed)) - last(fly(&believed, &actual));
        assert!((low_m - sag_m).abs() < 0.002, "{low_m} m instead of {sag_m} m");
        let known_m = last(fly(&actual, &actual)) - last(fly(&believed, &believed));
        assert!(known_m.abs() < 0.002, "who knows the mass stays up: {known_m} m");
    }

    #[test]
    fn progress_rises_from_nought_to_one() {
        let mut seen = Vec::new();
        let hover = plan(&[(0.0, 0.0, 0.5), (3.0, 0.0, 0.5)]);
        fly(&hover, &SimOptions::default(), 1, &mut |done| seen.push(done)).unwrap();
        assert_eq!((seen[0], *seen.last().unwrap()), (0.0, 1.0));
        assert!(seen.is_sorted() && seen.len() > 5, "{seen:?}");
    }

    #[test]
    fn what_cannot_be_flown_is_refused_with_its_reason() {
        let refused = |points| fly_default(&plan(points)).unwrap_err().to_string();
        assert!(refused(&[]).contains("no setpoint"));
        assert!(refused(&[(0.0, 0.0, 0.5), (3601.0, 0.0, 0.5)]).contains("3601 s"));
        assert!(refused(&[(0.0, 0.0, 0.5), (f64::NAN, 0.0, 0.5)]).contains("NaN s"));
        assert!(refused(&[(0.0, 0.0, 0.5), (1.0, f64::NAN, 0.5)]).contains("setpoint 1"));
        let jump = refused(&[(0.0, 0.0, 0.5), (1.0, 9.0, 0.5), (5.0, 9.0, 0.5)]);
        assert!(jump.contains("turns over after 1."), "{jump}");
    }

    #[test]
    fn any_settings_give_a_finite_flight_or_an_error() {
        let hover = plan(&[(0.0, 0.0, 0.0), (0.1, 0.0, 0.5), (1.5, 0.3, 0.5), (2.0, 0.3, 0.5)]);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut flown = 0;
        for case in 0..300 {
            let mut factor = || libm::pow(10.0, rng.random_range(-1.5..1.5));
            let mut options = SimOptions::default();
            options.vehicle.inertia_kg_m2.iter_mut().for_each(|j| *j *= factor());
            options.vehicle.k_f_n *= factor();
            options.controller.q.iter_mut().for_each(|q| *q *= factor());
            options.controller.r.iter_mut().for_each(|r| *r *= factor());
            options.observer.q.iter_mut().for_each(|q| *q *= factor() * factor());
            options.observer.r.iter_mut().for_each(|r| *r *= factor() * factor());
            options.sensors.lighthouse_jitter_m *= factor();
            let Ok(flight) = fly(&hover, &options, case, &mut |_| {}) else { continue };
            flown += 1;
            for s in &flight.samples {
                let sum = s.position_m.sum() + s.velocity_body_m_s.sum() + s.rate_body_rad_s.sum();
                let rest = s.estimate_m.sum() + s.motors.iter().sum::<f64>();
                assert!((sum + rest).is_finite(), "case {case} at {} s", s.time_s);
            }
        }
        assert!((50..300).contains(&flown), "both ends are reached: {flown} of 300 flew");
    }
}
