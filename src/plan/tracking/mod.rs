//! Tracking errors of a flight relative to its design.
//!
//! The input is a [`Flight`], and the output is the [`Tracking`] figures for a [`Part`] of it.
//!
//! The error at an instant combines lag and distance from the path. The lag is the time shift of
//! the design that brings it closest to the flight in the word's plane (x-z), except for a constant
//! offset. Only the error after that shift and the distance from the path (contour error) are
//! visible in a photograph.
//!
//! All samples have equal weight, since logs with a varying rate are resampled on import.
//!
//! The figures follow Table 1 of the reference flight (RMSE) and `NanoBench` (arXiv 2603.09908, for
//! the lag, the RMSE after the lag, and the cross-track error).

use nalgebra::{Vector2, Vector3};
use serde::Serialize;

use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{Flight, FlightSample, Quantity};
use noctograph_core::geometry::Attitude;

#[cfg(test)]
pub(crate) mod constructed;
mod lag;
mod letters;
mod part;
mod path;
#[cfg(test)]
mod tests;

pub use letters::{letters_by_plan, on_plan_s, track_letters};
pub use part::Part;

pub use lag::{minimize, spread_m2};
pub use path::{DesignPath, Walk};

/// Maximum lag and maximum lead in s that the search considers. Crazyflies lag by 0.5 to 0.6 s
/// without velocity feedforward.
pub const MAX_LAG_S: f64 = 1.5;

/// Time in s before and after the lag-shifted time within which the design's path determines the
/// contour error. At 0.2 m/s, this covers 0.1 m of path to either side, the gap between two
/// letters. A shorter window would count lag at a corner as distance, and a longer one would
/// include neighboring strokes.
const CONTOUR_WINDOW_S: f64 = 0.5;

/// Maximum root-mean-square height error in cap heights at which letters are legible. Letters of
/// 0.5 m are read with a probability of 0.90 with 3 cm of error, and of 0.5 to 0.85 with 5 cm.
const HEIGHT_ERROR_FRAC: f64 = 0.05;

/// Half the width in m, along y, of the corridor that keeps visitors safe.
pub const CORRIDOR_M: f64 = 0.2;

/// Tracking errors (flown minus design) in the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tracking {
    /// Part of the flight that the figures cover.
    pub part: Part,
    /// Number of samples in that part.
    #[serde(rename = "samples")]
    pub n_samples: usize,
    /// Times in s of the first and the last sample of that part.
    pub span_s: [f64; 2],
    /// Root-mean-square error for each axis in m.
    pub rmse_m: Vector3<f64>,
    /// Mean error for each axis in m.
    pub mean_error_m: Vector3<f64>,
    /// Time shift of the design in s, within ±[`MAX_LAG_S`], that minimizes the error in the x-z
    /// plane apart from a constant offset. The lag is negative if the drone is ahead of its design,
    /// and 0 if the design does not move.
    pub lag_s: f64,
    /// Root-mean-square error for each axis in m, relative to the design shifted by the lag.
    pub rmse_after_lag_m: Vector3<f64>,
    /// Distance in the x-z plane from the flown position to the path of the design.
    pub contour: ContourError,
    /// Root mean square of `estimate − position` for each axis in m, if an estimate is logged.
    pub observer_rmse_m: Option<Vector3<f64>>,
    /// Deviation from the word's plane.
    pub drift: Drift,
    /// Spread of the attitude, if it is logged.
    pub attitude: Option<AttitudeSpread>,
}

/// Distance from the flown position to the path of the design, in the x-z plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContourError {
    /// Mean distance in m.
    pub mean_m: f64,
    /// Root-mean-square distance in m.
    pub rms_m: f64,
    /// 95th percentile of the distance in m.
    pub p95_m: f64,
    /// Maximum distance in m.
    pub max_m: f64,
}

/// Position across the word's plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// Minimum y in m.
    pub min_y_m: f64,
    /// Maximum y in m.
    pub max_y_m: f64,
    /// Fraction of the samples within ±[`CORRIDOR_M`].
    pub in_corridor_frac: f64,
}

/// Statistics of yaw, pitch and roll over a flight, each taken separately.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AttitudeSpread {
    /// Mean angles in rad.
    #[serde(rename = "mean_rad")]
    pub mean: Attitude,
    /// Standard deviations of the angles in rad.
    #[serde(rename = "sigma_rad")]
    pub sigma: Attitude,
    /// Maximum absolute values of the angles in rad.
    #[serde(rename = "max_rad")]
    pub max: Attitude,
}

impl Tracking {
    /// Returns the root-mean-square error in the x-z plane in m.
    pub fn in_plane_rmse_m(&self) -> f64 {
        self.rmse_m.xz().norm()
    }

    /// Returns the minimum cap height in m for which the drone holds its height accurately enough,
    /// which is twenty times the height error after the lag.
    pub fn least_cap_height_m(&self) -> f64 {
        self.rmse_after_lag_m.z / HEIGHT_ERROR_FRAC
    }

    /// Returns the root-mean-square error in the x-z plane in m from the design shifted by the lag.
    pub fn in_plane_rmse_after_lag_m(&self) -> f64 {
        self.rmse_after_lag_m.xz().norm()
    }
}

/// Measures the tracking errors over a part of a flight.
///
/// # Errors
///
/// Returns [`Error::Input`] if the flight has no sample in that part, or no design.
pub fn track(flight: &Flight, part: Part) -> Result<Tracking> {
    track_sparsely(flight, part, 1)
}

/// Works as [`track`], with the contour error of every `stride`-th sample only, which takes less
/// time.
///
/// # Errors
///
/// Returns the errors of [`track`].
pub fn track_sparsely(flight: &Flight, part: Part, stride: usize) -> Result<Tracking> {
    let (samples, design) = designed(flight, part)?;
    Ok(measure(flight, part, &samples, &design, stride))
}

/// Measures the samples of a part of a flight, at least one of which must exist.
fn measure(
    flight: &Flight,
    part: Part,
    samples: &[FlightSample],
    design: &DesignPath,
    stride: usize,
) -> Tracking {
    let (lag_s, rmse_after_lag_m) = after_lag(samples, design);
    let errors = || samples.iter().map(|sample| sample.position_m - sample.design_m);
    Tracking {
        part,
        n_samples: samples.len(),
        span_s: [samples[0].time_s, samples[samples.len() - 1].time_s],
        rmse_m: rms(errors()),
        mean_error_m: mean(errors()),
        lag_s,
        rmse_after_lag_m,
        contour: contour(samples.iter().step_by(stride), design, lag_s),
        observer_rmse_m: flight
            .has(Quantity::Estimate)
            .then(|| rms(samples.iter().map(|sample| sample.estimate_m - sample.position_m))),
        drift: drift(samples),
        attitude: flight.has(Quantity::Attitude).then(|| attitude_spread(samples)),
    }
}

/// Returns [`Tracking::least_cap_height_m`] of a part of a flight, without the other figures.
///
/// # Errors
///
/// Returns the errors of [`track`].
pub fn least_cap_height_m(flight: &Flight, part: Part) -> Result<f64> {
    let (samples, design) = designed(flight, part)?;
    Ok(after_lag(&samples, &design).1.z / HEIGHT_ERROR_FRAC)
}

/// Returns the lag in s, and the root-mean-square error in m relative to the design shifted by it.
fn after_lag(samples: &[FlightSample], design: &DesignPath) -> (f64, Vector3<f64>) {
    let lag_s = lag::best_shift_s(samples, design, [-MAX_LAG_S, MAX_LAG_S]);
    let mut walk = design.walk();
    (lag_s, rms(samples.iter().map(|s| s.position_m - walk.at_m(s.time_s - lag_s))))
}

/// Returns the samples of a part of a flight, and the path of its design. Returns [`Error::Input`]
/// if either is missing.
pub fn designed(flight: &Flight, part: Part) -> Result<(Vec<FlightSample>, DesignPath)> {
    let samples = part.samples(flight)?;
    let design = DesignPath::new(flight).ok_or_else(no_design)?;
    Ok((samples, design))
}

/// Returns the error for a flight without a design.
pub(crate) fn no_design() -> Error {
    let hint = "import a log with setpoints, or compare the flight with another flight";
    Error::input("flight", "no design position", "columns x_design_m … z_design_m", hint)
}

/// Returns statistics in m of the distances from the samples to the design's path around their
/// lag-shifted times.
fn contour<'a>(
    samples: impl Iterator<Item = &'a FlightSample>,
    design: &DesignPath,
    lag_s: f64,
) -> ContourError {
    let mut walk = design.walk();
    let mut distances_m = Vec::from_iter(samples.map(|sample| {
        let due_s = sample.time_s - lag_s;
        let around_s = [due_s - CONTOUR_WINDOW_S, due_s + CONTOUR_WINDOW_S];
        walk.distance_m(sample.position_m, around_s)
    }));
    distances_m.sort_unstable_by(f64::total_cmp);
    // The sums are those of the distances and of their squares.
    let n = distances_m.len();
    let sums: Vector2<f64> = distances_m.iter().map(|d| Vector2::new(*d, d * d)).sum();
    let means = sums / n as f64;
    ContourError {
        mean_m: means.x,
        rms_m: means.y.sqrt(),
        p95_m: distances_m[(n * 95).div_ceil(100) - 1],
        max_m: distances_m[n - 1],
    }
}

/// Returns the smallest and largest y of samples, and the fraction of samples inside the corridor.
fn drift(samples: &[FlightSample]) -> Drift {
    let y_m = || samples.iter().map(|sample| sample.position_m.y);
    Drift {
        min_y_m: y_m().fold(f64::INFINITY, f64::min),
        max_y_m: y_m().fold(f64::NEG_INFINITY, f64::max),
        in_corridor_frac: y_m().filter(|y| y.abs() <= CORRIDOR_M).count() as f64
            / samples.len() as f64,
    }
}

/// Returns the mean, standard deviation and maximum absolute value in rad of each attitude angle.
fn attitude_spread(samples: &[FlightSample]) -> AttitudeSpread {
    let angles = || samples.iter().map(|sample| angles_rad(&sample.attitude));
    let mean = mean(angles());
    let largest = angles().fold(Vector3::zeros(), |most: Vector3<f64>, a| most.sup(&a.abs()));
    AttitudeSpread {
        mean: attitude(mean),
        sigma: attitude(rms(angles().map(|a| a - mean))),
        max: attitude(largest),
    }
}

/// Returns the root mean square of each component of vectors. The result is zero without samples.
pub fn rms(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    mean(vectors.map(|v| v.component_mul(&v))).map(f64::sqrt)
}

/// Returns the mean of vectors. The mean is zero without samples.
pub fn mean(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let (n, sum) = vectors.fold((0, Vector3::zeros()), |(n, sum), v| (n + 1, sum + v));
    sum / n.max(1) as f64
}

/// Returns yaw, pitch and roll as a vector.
pub fn angles_rad(attitude: &Attitude) -> Vector3<f64> {
    Vector3::new(attitude.yaw_rad, attitude.pitch_rad, attitude.roll_rad)
}

/// Creates an attitude from a vector of yaw, pitch and roll.
pub fn attitude(angles_rad: Vector3<f64>) -> Attitude {
    let [yaw_rad, pitch_rad, roll_rad] = angles_rad.into();
    Attitude { yaw_rad, pitch_rad, roll_rad }
}
