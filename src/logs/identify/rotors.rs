//! Computes the motors' thrust from logged commands, which the rotor speeds follow with a lag.

use super::runs;
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::flight::{Flight, FlightSample, Quantity};
use noctograph_sim::vehicle::VehicleOptions;

/// Half the time for which the firmware holds a command (500 Hz), which is the mean delay of the
/// held commands relative to a straight line between logged ones.
const HELD_S: f64 = 0.001;
/// Maximum interval that is interpolated. In longer intervals the first command is held.
const LONGEST_STEP_S: f64 = 0.04;
/// Minimum height above the floor that is free of ground effect.
const FREE_M: f64 = 0.15;
/// Number of samples on each side over which the climb rate is measured.
const CLIMB: usize = 10;

/// Returns each motor's thrust integrated from each sample to the next, in units of commands times
/// s. Rotor speeds follow the square root of the command with the lag, and thrust is the square of
/// the speed.
pub(super) fn impulses(run: &[FlightSample], lag_s: f64) -> Vec<[f64; 4]> {
    let wanted = roots(run);
    let Some(mut speed) = wanted.first().copied() else { return Vec::new() };
    Vec::from_iter(run.windows(2).zip(wanted.windows(2)).map(|(pair, roots)| {
        let dt_s = pair[1].time_s - pair[0].time_s;
        // During the interval, the wanted speed is taken as constant. It is that of the middle,
        // less the mean delay of held commands.
        let middle = (0.5 - HELD_S / dt_s).max(0.0);
        let stays = if lag_s > 0.0 { libm::exp(-dt_s / lag_s) } else { 0.0 };
        [0, 1, 2, 3].map(|motor| {
            let target = roots[0][motor] + (roots[1][motor] - roots[0][motor]) * middle;
            let behind = speed[motor] - target;
            speed[motor] = target + behind * stays;
            // The sum is ∫ (target + behind e^(−t/lag))² dt over the interval.
            target * target * dt_s
                + 2.0 * target * behind * lag_s * (1.0 - stays)
                + 0.5 * behind * behind * lag_s * (1.0 - stays * stays)
        })
    }))
}

/// Returns the square root of each motor's command at each sample, interpolated between commands.
fn roots(run: &[FlightSample]) -> Vec<[f64; 4]> {
    let mut line = Vec::with_capacity(run.len());
    for held in run.chunk_by(|a, b| a.motors == b.motors) {
        let (from, next) = (&held[0], run.get(line.len() + held.len()));
        // A command that is held for a long time is not interpolated.
        let to = next.filter(|next| next.time_s - from.time_s < LONGEST_STEP_S).unwrap_or(from);
        let [first, last] =
            [from, to].map(|sample| sample.motors.map(|command| command.max(0.0).sqrt()));
        line.extend(held.iter().map(|s| {
            let part = (s.time_s - from.time_s) / (to.time_s - from.time_s).max(1e-9);
            [0, 1, 2, 3].map(|motor| first[motor] + (last[motor] - first[motor]) * part)
        }));
    }
    line
}

/// Returns the thrust per command, N, given the motors' lag, from samples without ground effect.
/// The thrust is fitted to the accelerations by least squares of `m a = k ΣM` or, without
/// accelerations, to gravity and the climb over the whole time.
pub(super) fn thrust_per_command_n(
    flight: &Flight,
    samples: &[FlightSample],
    accelerations: Option<&[f64]>,
    assumed: &VehicleOptions,
) -> f64 {
    let [has_position, has_attitude] =
        [Quantity::Position, Quantity::Attitude].map(|quantity| flight.has(quantity));
    let floor_m = flight.samples.iter().map(|s| s.position_m.z).fold(f64::INFINITY, f64::min);
    let free =
        (0..samples.len()).filter(|&i| !has_position || samples[i].position_m.z - floor_m > FREE_M);
    let ends_of_free = free.clone().min().zip(free.max());
    // If ground effect covers half of the flight, the whole flight is used.
    let (from, to) = ends_of_free
        .filter(|(from, to)| to - from > samples.len() / 2)
        .unwrap_or((0, samples.len() - 1));
    let VehicleOptions { mass_kg, motor_rise_s, motor_fall_s, .. } = assumed;
    let motor_lag_s = 0.5 * (motor_rise_s + motor_fall_s);
    let (mut product, mut square) = (0.0, 0.0);
    // The sums are taken over runs of samples without a gap in free air.
    let mut start = 0;
    for run in runs(flight, samples) {
        let inside = from.saturating_sub(start)..to.saturating_sub(start).min(run.len() - 1);
        let impulses = impulses(run, motor_lag_s);
        for index in inside.clone() {
            let dt_s = run[index + 1].time_s - run[index].time_s;
            let commands = impulses[index].iter().sum::<f64>() / dt_s;
            match accelerations {
                Some(column) => {
                    product += mass_kg * column[start + index] * commands * dt_s;
                    square += commands * commands * dt_s;
                }
                None => {
                    let attitude = run[index].attitude;
                    let tilt = libm::cos(attitude.pitch_rad) * libm::cos(attitude.roll_rad);
                    product += mass_kg * GRAVITY_M_S2 * dt_s;
                    square += if has_attitude { tilt } else { 1.0 } * commands * dt_s;
                }
            }
        }
        if accelerations.is_none() && has_position && !inside.is_empty() {
            let climb_m_s = climb_m_s(run, inside.end - 1) - climb_m_s(run, inside.start);
            product += mass_kg * climb_m_s;
        }
        start += run.len();
    }
    product / square
}

/// Returns the climb rate around the sample `index`, m/s.
fn climb_m_s(run: &[FlightSample], index: usize) -> f64 {
    let (before, after) = (index.saturating_sub(CLIMB), (index + CLIMB).min(run.len() - 1));
    let lasts_s = run[after].time_s - run[before].time_s;
    if lasts_s > 0.0 { (run[after].position_m.z - run[before].position_m.z) / lasts_s } else { 0.0 }
}
