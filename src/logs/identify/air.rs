//! Uneven air, from the torque with which the motors answer it over seconds.
//!
//! A body in flight does not keep turning: over a second the motors' torque balances that of the
//! air, of the displaced center of mass, and a moment proportional to the velocity. With the last
//! two fitted, the residual means are the air's torque.

use nalgebra::Vector2;

use super::{runs, signed_sum};
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_sim::vehicle::TORQUE_TIME_S;

const WINDOW_S: f64 = 1.0;
/// Time after take-off in which the controller finds its trim, and before landing.
const ENDS_S: f64 = 2.0;
const FEWEST: usize = 6;

/// Torque of uneven air, and the doubt that it causes in a flight's mean torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnevenAir {
    /// Standard deviation about body x and y, N m.
    pub torque_sigma_n_m: [f64; 2],
    /// That of the flight's mean torque, N m: the doubt of the center of mass.
    pub mean_sigma_n_m: [f64; 2],
}

/// Estimates it from the samples in the air and the torque of a motor's unit of command. `None` if
/// the flight is too short.
pub(super) fn uneven_air(
    flight: &Flight,
    samples: &[FlightSample],
    torque_per_command_n_m: f64,
) -> Option<UnevenAir> {
    let [from_s, to_s] = [samples.first()?.time_s + ENDS_S, samples.last()?.time_s - ENDS_S];
    let middle: Vec<FlightSample> =
        samples.iter().filter(|s| (from_s..to_s).contains(&s.time_s)).copied().collect();
    // Means of torque and velocity over windows of a second, none of them across a gap.
    let mut windows: Vec<[Vector2<f64>; 2]> = Vec::new();
    for run in runs(flight, &middle) {
        let start_s = run[0].time_s;
        for part in run.chunk_by(|a, b| {
            let [a, b] = [a, b].map(|s| libm::floor((s.time_s - start_s) / WINDOW_S));
            a == b
        }) {
            let lasts_s = part[part.len() - 1].time_s - part[0].time_s;
            if lasts_s < 0.8 * WINDOW_S {
                continue;
            }
            #[expect(clippy::cast_precision_loss, reason = "samples of a second")]
            let n = part.len() as f64;
            let torques =
                part.iter().map(|s| Vector2::from_fn(|axis, _| signed_sum(axis, &s.motors)));
            let torque_n_m = torques.sum::<Vector2<f64>>() * torque_per_command_n_m;
            // Moving along x the air turns the drone about y, and the other way around.
            let moving_m_s: Vector2<f64> = part.iter().map(|s| s.velocity_body_m_s.yx()).sum();
            windows.push([torque_n_m / n, moving_m_s / n]);
        }
    }
    if windows.len() < FEWEST {
        return None;
    }
    // About each axis: the spread that the velocity does not explain. A mean of a second varies
    // less than the torque itself.
    #[expect(clippy::cast_precision_loss, reason = "seconds of a flight")]
    let n = windows.len() as f64;
    let [torque_n_m, moving_m_s] =
        [0, 1].map(|k| windows.iter().map(|window| window[k]).sum::<Vector2<f64>>() / n);
    let torque_sigma_n_m = [0, 1].map(|axis| {
        let deviations = windows.iter().map(|[torque, moving]| {
            [torque[axis] - torque_n_m[axis], moving[axis] - moving_m_s[axis]]
        });
        let [tt, tm, mm] = deviations
            .fold([0.0; 3], |sum, [t, m]| [sum[0] + t * t, sum[1] + t * m, sum[2] + m * m]);
        let explained = if mm > 0.0 { tm * tm / mm } else { 0.0 };
        // Two figures are fitted beside the spread.
        ((tt - explained).max(0.0) / (n - 2.0)).sqrt() / mean_variance_frac(WINDOW_S).sqrt()
    });
    let mean_sigma_n_m =
        torque_sigma_n_m.map(|sigma| sigma * mean_variance_frac(n * WINDOW_S).sqrt());
    Some(UnevenAir { torque_sigma_n_m, mean_sigma_n_m })
}

/// Variance of the mean of an Ornstein–Uhlenbeck process over a time, relative to its variance.
fn mean_variance_frac(time_s: f64) -> f64 {
    let ratio = TORQUE_TIME_S / time_s;
    2.0 * ratio * (1.0 - ratio * (1.0 - libm::exp(-1.0 / ratio)))
}
