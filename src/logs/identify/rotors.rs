//! Computes the motors' thrust from logged commands, which the rotor speeds follow with a lag.

use std::ops::Range;

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
    let targets = target_speeds(run);
    let Some(mut speed) = targets.first().copied() else { return Vec::new() };
    Vec::from_iter(run.windows(2).zip(targets.windows(2)).map(|(pair, ends)| {
        let dt_s = pair[1].time_s - pair[0].time_s;
        // The target speed is taken as constant during the interval: that of the interval's
        // midpoint, or earlier by the mean delay of held commands.
        let fraction = (0.5 - HELD_S / dt_s).max(0.0);
        let stays = if lag_s > 0.0 { libm::exp(-dt_s / lag_s) } else { 0.0 };
        [0, 1, 2, 3].map(|motor| {
            let target = ends[0][motor] + (ends[1][motor] - ends[0][motor]) * fraction;
            let behind = speed[motor] - target;
            speed[motor] = target + behind * stays;
            // The sum is ∫ (target + behind e^(−t/lag))² dt over the interval.
            target * target * dt_s
                + 2.0 * target * behind * lag_s * (1.0 - stays)
                + 0.5 * behind * behind * lag_s * (1.0 - stays * stays)
        })
    }))
}

/// Returns the speed that each motor approaches at each sample: the square root of its command,
/// interpolated linearly between changes of the commands.
fn target_speeds(run: &[FlightSample]) -> Vec<[f64; 4]> {
    let mut line = Vec::with_capacity(run.len());
    for held in run.chunk_by(|a, b| a.motors == b.motors) {
        let (from, next) = (&held[0], run.get(line.len() + held.len()));
        // A command that is held for a long time is not interpolated.
        let to = next.filter(|next| next.time_s - from.time_s < LONGEST_STEP_S).unwrap_or(from);
        let [first, last] =
            [from, to].map(|sample| sample.motors.map(|command| command.max(0.0).sqrt()));
        // Without a next command, both ends are equal, and the divisor only has to be positive.
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
    let free = free_range(flight, samples);
    let VehicleOptions { mass_kg, motor_rise_s, motor_fall_s, .. } = assumed;
    let motor_lag_s = 0.5 * (motor_rise_s + motor_fall_s);
    let (mut product, mut square) = (0.0, 0.0);
    // The sums are taken over runs of samples without a gap in free air.
    let mut start = 0;
    for run in runs(flight, samples) {
        let [from, to] = [free.start, free.end].map(|index| index.saturating_sub(start));
        let inside = from..to.min(run.len() - 1);
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

/// Returns the samples between the first and the last one without ground effect, or all of them if
/// ground effect covers half of the flight. The last sample is excluded, because it has no next
/// one.
fn free_range(flight: &Flight, samples: &[FlightSample]) -> Range<usize> {
    // Without heights, no sample is excluded.
    let has_position = flight.has(Quantity::Position);
    let floor_m = flight.samples.iter().map(|s| s.position_m.z).fold(f64::INFINITY, f64::min);
    let free =
        (0..samples.len()).filter(|&i| !has_position || samples[i].position_m.z - floor_m > FREE_M);
    let ends = free.clone().min().zip(free.max());
    let (from, to) =
        ends.filter(|(from, to)| to - from > samples.len() / 2).unwrap_or((0, samples.len() - 1));
    from..to
}

/// Returns the climb rate around the sample `index`, m/s.
fn climb_m_s(run: &[FlightSample], index: usize) -> f64 {
    let (before, after) = (index.saturating_sub(CLIMB), (index + CLIMB).min(run.len() - 1));
    let lasts_s = run[after].time_s - run[before].time_s;
    if lasts_s > 0.0 { (run[after].position_m.z - run[before].position_m.z) / lasts_s } else { 0.0 }
}
