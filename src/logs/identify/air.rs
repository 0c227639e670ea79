//! Estimates the torque caused by uneven air from the motor torque that balances it over seconds.
//!
//! An airborne body does not keep rotating. Over a second, the motors' torque balances the torque
//! of the air, that of the displaced center of mass, and a torque proportional to the velocity. The
//! latter two are fitted, and the residuals of the mean torques are attributed to the air.

use nalgebra::Vector2;

use super::{runs, signed_sum};
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_sim::vehicle::TORQUE_TIME_S;

/// Length of a window, and the minimum fraction of it that samples must cover.
const WINDOW_S: f64 = 1.0;
const LEAST_COVERED: f64 = 0.8;
/// Time that is ignored after take-off, while the controller finds its trim, and before landing.
const ENDS_S: f64 = 2.0;
/// Minimum number of windows, of which the fit of mean and slope uses two degrees of freedom.
const FEWEST: usize = 6;

/// Torque of uneven air, and the resulting error of a flight's mean torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnevenAir {
    /// Standard deviation of the torque about body x and y, N m.
    pub torque_sigma_n_m: [f64; 2],
    /// Standard deviation of the flight's mean torque, N m.
    pub mean_sigma_n_m: [f64; 2],
}

/// Means over one window.
struct Window {
    torque_n_m: Vector2<f64>,
    /// Velocity along body y and x, along which a moving drone is rotated about x and y.
    moving_m_s: Vector2<f64>,
}

/// Estimates uneven air from the airborne samples: the torque in N m by which the air turns the
/// drone. `torque_per_command_n_m` converts motor commands. Returns `None` if the flight has fewer
/// than [`FEWEST`] windows.
pub(super) fn uneven_air(
    flight: &Flight,
    samples: &[FlightSample],
    torque_per_command_n_m: f64,
) -> Option<UnevenAir> {
    let windows = windows(flight, samples, torque_per_command_n_m);
    if windows.len() < FEWEST {
        return None;
    }
    // The spread about each axis is the part that the velocity does not explain. The mean over a
    // window varies less than the torque itself.
    #[expect(clippy::cast_precision_loss, reason = "seconds of a flight")]
    let n = windows.len() as f64;
    let torque_n_m = windows.iter().map(|window| window.torque_n_m).sum::<Vector2<f64>>() / n;
    let moving_m_s = windows.iter().map(|window| window.moving_m_s).sum::<Vector2<f64>>() / n;
    let torque_sigma_n_m = [0, 1].map(|axis| {
        let deviations = windows.iter().map(|window| {
            let torque_n_m = window.torque_n_m[axis] - torque_n_m[axis];
            [torque_n_m, window.moving_m_s[axis] - moving_m_s[axis]]
        });
        let [tt, tm, mm] = deviations
            .fold([0.0; 3], |sum, [t, m]| [sum[0] + t * t, sum[1] + t * m, sum[2] + m * m]);
        let explained = if mm > 0.0 { tm * tm / mm } else { 0.0 };
        // The fit of mean and slope uses two degrees of freedom.
        ((tt - explained).max(0.0) / (n - 2.0)).sqrt() / mean_variance_frac(WINDOW_S).sqrt()
    });
    let mean_sigma_n_m =
        torque_sigma_n_m.map(|sigma| sigma * mean_variance_frac(n * WINDOW_S).sqrt());
    Some(UnevenAir { torque_sigma_n_m, mean_sigma_n_m })
}

/// Returns the torque and the velocity averaged over one-second windows, none of which spans a gap.
/// The first and the last seconds of the flight are left out.
fn windows(flight: &Flight, samples: &[FlightSample], torque_per_command_n_m: f64) -> Vec<Window> {
    let [Some(first), Some(last)] = [samples.first(), samples.last()] else { return Vec::new() };
    let steady_s = first.time_s + ENDS_S..last.time_s - ENDS_S;
    let steady: Vec<FlightSample> =
        samples.iter().filter(|s| steady_s.contains(&s.time_s)).copied().collect();
    let mut windows = Vec::new();
    for run in runs(flight, &steady) {
        let start_s = run[0].time_s;
        let window_number = |s: &FlightSample| libm::floor((s.time_s - start_s) / WINDOW_S);
        for part in run.chunk_by(|a, b| window_number(a) == window_number(b)) {
            let lasts_s = part[part.len() - 1].time_s - part[0].time_s;
            if lasts_s < LEAST_COVERED * WINDOW_S {
                continue;
            }
            #[expect(clippy::cast_precision_loss, reason = "samples of a second")]
            let n = part.len() as f64;
            let torques =
                part.iter().map(|s| Vector2::from_fn(|axis, _| signed_sum(axis, &s.motors)));
            let torque_n_m = torques.sum::<Vector2<f64>>() * torque_per_command_n_m / n;
            // Air rotates a drone that moves along x about y, and one that moves along y about x.
            let sum_m_s: Vector2<f64> = part.iter().map(|s| s.velocity_body_m_s.yx()).sum();
            windows.push(Window { torque_n_m, moving_m_s: sum_m_s / n });
        }
    }
    windows
}

/// Returns the variance of an Ornstein–Uhlenbeck process averaged over `time_s`, relative to the
/// variance of the process.
fn mean_variance_frac(time_s: f64) -> f64 {
    let ratio = TORQUE_TIME_S / time_s;
    2.0 * ratio * (1.0 - ratio * (1.0 - libm::exp(-1.0 / ratio)))
}
