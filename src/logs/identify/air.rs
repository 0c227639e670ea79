//! Uneven air, from the torque with which the motors answer it over seconds.
//!
//! A body in flight has no lasting rotation, so that over a second the motors' torque is the
//! opposite of the air's, of the displaced center of mass and of a moment that goes with the
//! velocity. Means of the first are what is left when the last two are fitted.

use nalgebra::Vector2;

use super::{runs, signed_sum};
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_sim::vehicle::TORQUE_TIME_S;

/// Length of a window, s.
const WINDOW_S: f64 = 1.0;
/// Time after take-off in which the controller finds its trim, and before landing.
const ENDS_S: f64 = 2.0;
/// Fewest windows.
const FEWEST: usize = 6;

/// Torque of uneven air, and what it makes of a flight's mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnevenAir {
    /// Standard deviation about body x and y, N m.
    pub torque_sigma_n_m: [f64; 2],
    /// That of the flight's mean torque, N m: the doubt of the center of mass.
    pub mean_sigma_n_m: [f64; 2],
}

/// Finds it from the samples in the air and the torque of a motor's unit of command; `None` for a
/// flight too short.
pub(super) fn uneven_air(
    flight: &Flight,
    samples: &[FlightSample],
    torque_per_command_n_m: f64,
) -> Option<UnevenAir> {
    let [from_s, to_s] = [samples.first()?.time_s + ENDS_S, samples.last()?.time_s - ENDS_S];
    let middle: Vec<FlightSample> =
        samples.iter().filter(|s| (from_s..to_s).contains(&s.time_s)).copied().collect();
    let mut windows: Vec<[Vector2<f64>; 2]> = Vec::new();
    for run in runs(flight, &middle) {
        let start_s = run[0].time_s;
        let window = |s: &FlightSample| libm::floor((s.time_s - start_s) / WINDOW_S);
        for part in run.chunk_by(|a, b| window(a) == window(b)) {
            let lasts_s = part[part.len() - 1].time_s - part[0].time_s;
            if lasts_s < 0.8 * WINDOW_S {
                continue;
            }
            #[expect(clippy::cast_precision_loss, reason = "samples of a second")]
            let n = part.len() as f64;
            let torque = |s: &FlightSample| Vector2::from_fn(|axis, _| signed_sum(axis, &s.motors));
            let torque_n_m = part.iter().map(torque).sum::<Vector2<f64>>() * torque_per_command_n_m;
            // Moving along x the air turns the drone about y, and the other way around.
            let moving_m_s: Vector2<f64> = part.iter().map(|s| s.velocity_body_m_s.yx()).sum();
            windows.push([torque_n_m / n, moving_m_s / n]);
        }
    }
    if windows.len() < FEWEST {
        return None;
    }
    #[expect(clippy::cast_precision_loss, reason = "seconds of a flight")]
    let n = windows.len() as f64;
    let mean = |of: usize| windows.iter().map(|window| window[of]).sum::<Vector2<f64>>() / n;
    let [torque_n_m, moving_m_s] = [mean(0), mean(1)];
    let residual = |axis: usize| {
        let off = windows.iter().map(|[torque, moving]| {
            [torque[axis] - torque_n_m[axis], moving[axis] - moving_m_s[axis]]
        });
        let [tt, tm, mm] =
            off.fold([0.0; 3], |sum, [t, m]| [sum[0] + t * t, sum[1] + t * m, sum[2] + m * m]);
        let explained = if mm > 0.0 { tm * tm / mm } else { 0.0 };
        // Two figures are fitted beside the spread.
        ((tt - explained).max(0.0) / (n - 2.0)).sqrt()
    };
    // Of an Ornstein–Uhlenbeck process, the variance that is left in the mean over a time.
    let left = |time_s: f64| {
        let share = TORQUE_TIME_S / time_s;
        2.0 * share * (1.0 - share * (1.0 - libm::exp(-1.0 / share)))
    };
    let torque_sigma_n_m = [0, 1].map(|axis| residual(axis) / left(WINDOW_S).sqrt());
    let mean_sigma_n_m = torque_sigma_n_m.map(|sigma| sigma * left(n * WINDOW_S).sqrt());
    Some(UnevenAir { torque_sigma_n_m, mean_sigma_n_m })
}
