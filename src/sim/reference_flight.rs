//! The reference flight: "NOOR" as the team planned it, against an independent simulation of it.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{RateOptions, SensorOptions, SimOptions, VehicleOptions, fly};
use crate::flight::{Flight, mean_error_m, rmse_m};
use crate::plan::{Plan, Setpoint};

const SPEED_M_S: f64 = 0.2;
const SETPOINT_PERIOD_S: f64 = 0.1;
const GAP_M: f64 = 0.1;
const WAIT_S: f64 = 2.0;
const BOX_M: [f64; 2] = [0.3, 0.5];
const BOX_BOTTOM_M: f64 = 0.5;

/// Corners of the team's letters in the unit box; each move starts where the last one ended.
const N: &[[f64; 2]] = &[[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [1.0, 0.0]];
const O: &[[f64; 2]] = &[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0], [1.0, 0.0]];
const R: &[[f64; 2]] = &[[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.5], [0.0, 0.5], [1.0, 0.0]];

/// The team's plan for NOOR from the first stroke to the end of the last wait, lights always on.
fn noor() -> Plan {
    let mut setpoints = Vec::new();
    let mut time_s = 0.0;
    let mut left_m = -0.3 * 4.0 / 2.0;
    for (letter, corners) in [N, O, O, R].into_iter().enumerate() {
        let place = |[x, z]: [f64; 2]| {
            Vector3::new(left_m + BOX_M[0] * x, 0.0, BOX_BOTTOM_M + BOX_M[1] * z)
        };
        for move_ in corners.windows(2) {
            let (from, to) = (place(move_[0]), place(move_[1]));
            let duration_s = (to - from).norm() / SPEED_M_S;
            let velocity_m_s = (to - from) / duration_s;
            leg(&mut setpoints, &mut time_s, letter, from, velocity_m_s, duration_s);
        }
        left_m += BOX_M[0] + GAP_M;
        let wait_at = Vector3::new(left_m, 0.0, BOX_BOTTOM_M);
        leg(&mut setpoints, &mut time_s, letter, wait_at, Vector3::zeros(), WAIT_S);
    }
    let last = Setpoint { time_s, ..*setpoints.last().unwrap() };
    setpoints.push(last);
    let lights = BTreeMap::from([("headlights".to_owned(), vec![1.0; setpoints.len()])]);
    Plan { setpoints, lights }
}

fn leg(
    setpoints: &mut Vec<Setpoint>,
    time_s: &mut f64,
    letter: usize,
    from: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
    duration_s: f64,
) {
    let mut since_s = 0.0;
    while since_s < duration_s - 1e-9 {
        setpoints.push(Setpoint {
            time_s: *time_s + since_s,
            position_m: from + velocity_m_s * since_s,
            velocity_m_s,
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(letter),
        });
        since_s += SETPOINT_PERIOD_S;
    }
    *time_s += duration_s;
}

/// Ideal sensors, the centre of mass in the middle of the motors.
fn undisturbed() -> SimOptions {
    SimOptions {
        vehicle: VehicleOptions { center_of_mass_m: [0.0, 0.0], ..Default::default() },
        sensors: SensorOptions::ideal(),
        ..Default::default()
    }
}

fn flown(options: &SimOptions, seed: u64) -> Flight {
    fly(&noor(), options, seed, &mut |_| {}).unwrap()
}

/// Within 2 % of the figures of an independent simulation (SciPy; no noise, setpoints held).
fn assert_agrees(found: Vector3<f64>, want: [f64; 3]) {
    for (found, want) in found.iter().zip(want) {
        assert!((found - want).abs() <= 0.02 * want.abs() + 1e-6, "{found} against {want}");
    }
}

#[test]
fn plan_lasts_as_long_as_the_teams() {
    assert!((noor().duration_s() - 46.118).abs() < 0.001, "{}", noor().duration_s());
}

#[test]
fn lag_is_that_of_an_independent_simulation() {
    let flight = flown(&undisturbed(), 0);
    assert_agrees(rmse_m(&flight).unwrap(), [0.0582, 0.0, 0.0693]);
    // −0.0179 with setpoints on one grid of 0.1 s through the whole flight; the team's, and ours,
    // start anew with every move, which takes half a period off each of the four jumps.
    let mean_x_m = mean_error_m(&flight).unwrap().x;
    assert!((mean_x_m + 0.0179).abs() < 0.0007, "{mean_x_m}");
    assert!(flight.warnings.is_empty(), "{:?}", flight.warnings);
}

#[test]
fn disturbed_error_is_that_of_an_independent_simulation() {
    let options = SimOptions { sensors: SensorOptions::ideal(), ..Default::default() };
    assert_agrees(rmse_m(&flown(&options, 0)).unwrap(), [0.1016, 0.0324, 0.0693]);
}

#[test]
fn half_the_step_moves_the_flight_by_less_than_a_micrometre() {
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
