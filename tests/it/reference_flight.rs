//! Compares the reference flight, in which "NOOR" is flown as the team planned it, with an
//! independent simulation.

use nalgebra::Vector3;

use noctograph::flight::{Flight, FlightSample};
use noctograph::letters::{LetterOptions, write};
use noctograph::plan::{Extent, Plan, PlanData, PlanOptions, Setpoint, plan};
use noctograph::sensors::SensorOptions;
use noctograph::sim::{Drone, RateOptions, SimOptions, fly};
use noctograph::tracking::{Part, track};
use noctograph::vehicle::{Gusts, VehicleOptions};

/// Returns the team's plan for NOOR from the first stroke to the end of the last wait.
fn noor() -> Plan {
    let strokes = write("NOOR", &LetterOptions::default()).unwrap();
    plan(&strokes, &PlanOptions { extent: Extent::Letters, ..Default::default() }).unwrap()
}

/// Returns the design's position at a time of a plan.
fn design_m(plan: &Plan, time_s: f64) -> Vector3<f64> {
    let next = plan.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s + 1e-9);
    plan.setpoints[next.max(1) - 1].design_m(time_s)
}

/// Returns the same path with setpoints on one grid of 0.1 s throughout the flight, as in the
/// independent simulation. The team's script, and this program, restart the grid with every move.
fn noor_on_one_grid() -> Plan {
    let noor = noor();
    let grid_s = (0..).map(|k| f64::from(k) * 0.1).take_while(|s| *s < noor.duration_s());
    let times_s = grid_s.chain([noor.duration_s()]);
    let setpoints: Vec<Setpoint> = times_s
        .map(|time_s| Setpoint {
            time_s,
            position_m: design_m(&noor, time_s),
            velocity_m_s: Vector3::zeros(),
            letter: Some(0),
            ..noor.setpoints[0]
        })
        .collect();
    let lights = [("headlights".to_owned(), vec![0.0; setpoints.len()])].into();
    Plan::made(PlanData { setpoints, lights, ..PlanData::default() })
}

/// Returns options with ideal sensors and the center of mass in the middle of the motors.
fn undisturbed() -> SimOptions {
    SimOptions {
        vehicle: VehicleOptions { center_of_mass_m: [0.0, 0.0], ..Default::default() },
        sensors: SensorOptions::ideal(),
        ..Default::default()
    }
}

fn flown(options: &SimOptions, seed: u64) -> Flight {
    fly(&noor(), &Drone::new(options, seed), &mut |_| {}).unwrap()
}

/// Checks that the figures are within 2 % of those of an independent simulation (in SciPy, without
/// noise and with held setpoints).
fn assert_agrees(found: Vector3<f64>, want: [f64; 3]) {
    for (found, want) in found.iter().zip(want) {
        assert!((found - want).abs() <= 0.02 * want.abs() + 1e-6, "{found} against {want}");
    }
}

/// Flies the plan on one grid, and returns the errors relative to the design's continuous path.
fn errors_on_one_grid(options: &SimOptions) -> (Vector3<f64>, Vector3<f64>) {
    let mut flight = fly(&noor_on_one_grid(), &Drone::new(options, 0), &mut |_| {}).unwrap();
    let noor = noor();
    let against_design = |sample: &FlightSample| FlightSample {
        design_m: design_m(&noor, sample.time_s),
        ..*sample
    };
    flight.edit(|flight| flight.samples = flight.samples.iter().map(against_design).collect());
    let tracking = track(&flight, Part::Letters).unwrap();
    (tracking.rmse_m, tracking.mean_error_m)
}

#[test]
fn lag_is_that_of_an_independent_simulation() {
    let (rmse_m, mean_m) = errors_on_one_grid(&undisturbed());
    assert_agrees(rmse_m, [0.0582, 0.0, 0.0693]);
    assert!((mean_m.x / -0.0179 - 1.0).abs() < 0.02, "mean error in x {}", mean_m.x);
}

#[test]
fn disturbed_error_is_that_of_an_independent_simulation() {
    let options = SimOptions { sensors: SensorOptions::ideal(), ..Default::default() };
    assert_agrees(errors_on_one_grid(&options).0, [0.1016, 0.0324, 0.0693]);
}

#[test]
fn setpoints_that_begin_anew_with_every_move_change_the_error_little() {
    let flight = flown(&undisturbed(), 0);
    assert_agrees(track(&flight, Part::Letters).unwrap().rmse_m, [0.0582, 0.0, 0.0693]);
    assert!(flight.warnings.is_empty(), "{:?}", flight.warnings);
}

#[test]
fn half_the_step_moves_the_flight_by_less_than_a_micrometer() {
    let coarse = flown(&undisturbed(), 0);
    let fine = flown(
        &SimOptions {
            rates: RateOptions { steps_per_tick: 2, ..Default::default() },
            ..undisturbed()
        },
        0,
    );
    for (a, b) in coarse.samples.iter().zip(&fine.samples) {
        let apart_m = (a.position_m - b.position_m).norm();
        assert!(apart_m < 1e-6, "{apart_m} m apart at {} s", a.time_s);
    }
}

#[test]
fn the_seed_decides_the_flight() {
    let options = SimOptions::default();
    let flight = flown(&options, 1);
    assert_eq!(flight, flown(&options, 1), "same seed, same flight");
    assert_ne!(flight, flown(&options, 2), "another seed, another flight");
}

/// Returns the RMS error of the whole simulated flight over eight seeds, computed as for the team's
/// log, in the air and relative to the current setpoint.
fn error_as_logged_m(options: &SimOptions, plan_options: &PlanOptions) -> Vector3<f64> {
    let strokes = write("NOOR", &LetterOptions::default()).unwrap();
    let plan = plan(&strokes, plan_options).unwrap();
    let held_m = |time_s: f64| {
        let next = plan.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s + 1e-6);
        plan.setpoints[next.max(1) - 1].position_m
    };
    let mean_sq = (0..8).map(|seed| {
        let mut flight = fly(&plan, &Drone::new(options, seed), &mut |_| {}).unwrap();
        flight.edit(|flight| {
            flight.samples.iter_mut().for_each(|sample| sample.design_m = held_m(sample.time_s))
        });
        let rmse_m = track(&flight, Part::Airborne).unwrap().rmse_m;
        rmse_m.component_mul(&rmse_m)
    });
    (mean_sq.sum::<Vector3<f64>>() / 8.0).map(f64::sqrt)
}

/// RMS difference between the team's observer and its setpoints in the air, in m.
const REAL_ERROR_M: [f64; 3] = [0.097, 0.046, 0.059];

#[test]
fn gusts_leave_the_error_of_the_real_flight_within_a_tenth() {
    let mut options = SimOptions::default();
    options.air.gusts = Gusts::room();
    let found_m = error_as_logged_m(&options, &PlanOptions::default());
    for (found_m, real_m) in found_m.iter().zip(REAL_ERROR_M) {
        assert!((found_m / real_m - 1.0).abs() < 0.1, "{found_m} m of {real_m} m");
    }
}

#[test]
fn the_real_pace_and_speed_stability_leave_it_within_a_sixteenth() {
    // The team's script slept 0.1 s between setpoints and worked for 9 ms, which resulted in a
    // speed of 0.18 m/s.
    let pace =
        PlanOptions { stroke_speed_m_s: 0.18, setpoint_interval_s: 0.109, ..Default::default() };
    let mut options = SimOptions::default();
    options.air.gusts = Gusts::room();
    options.vehicle.airspeed_moment_n_s = 4.7e-4;
    let found_m = error_as_logged_m(&options, &pace);
    for (found_m, real_m) in found_m.iter().zip(REAL_ERROR_M) {
        assert!((found_m / real_m - 1.0).abs() < 0.0625, "{found_m} m of {real_m} m");
    }
}
