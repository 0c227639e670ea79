//! Tracking: errors of a flight against its design.
//!
//! Product in: [`Flight`]. Product out: [`Tracking`], figures over a stated [`Part`] of it.
//!
//! Method: the error at an instant mixes lag and distance from the path. The lag is the shift of
//! the design in time that brings it closest to the flight in the word's plane (x-z), except for a
//! constant offset. The error after that shift, and the distance to the path (the contour error),
//! are visible in a photograph.
//!
//! All samples have equal weight: a log whose rate varies is resampled when it is imported.
//!
//! Sources: Table 1 of the reference flight (RMSE), `NanoBench` (arXiv 2603.09908: lag, RMSE after
//! lag and cross-track error).

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

/// Longest lag and longest lead in the search. Crazyflies trail by 0.5 to 0.6 s without velocity
/// feed-forward.
pub const MAX_LAG_S: f64 = 1.5;

/// The contour error is measured to the design from this long before to this long after the
/// lag-shifted time. A shorter window counts lag at a corner as distance, a longer window finds a
/// neighboring stroke: at 0.2 m/s it is 0.1 m of path to either side, the gap between two letters.
const CONTOUR_WINDOW_S: f64 = 0.5;

/// Largest root-mean-square error of the height at which letters are legible, in their cap heights:
/// at 3 cm, letters of 0.5 m read with probability 0.90, at 5 cm with 0.5 to 0.85.
const HEIGHT_ERROR_FRAC: f64 = 0.05;

/// The safety corridor for visitors: y within plus or minus this.
pub const CORRIDOR_M: f64 = 0.2;

/// Tracking errors, flown minus design, in the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tracking {
    /// Part of the flight that the figures cover.
    pub part: Part,
    /// Samples in that part.
    #[serde(rename = "samples")]
    pub n_samples: usize,
    /// First and last sample of that part.
    pub span_s: [f64; 2],
    /// Root mean square per axis.
    pub rmse_m: Vector3<f64>,
    /// Mean per axis.
    pub mean_error_m: Vector3<f64>,
    /// Shift of the design in time, up to [`MAX_LAG_S`] either way, that leaves the least error in
    /// the x-z plane about a constant offset. Negative if the drone is ahead of its design. 0 if
    /// the design does not move.
    pub lag_s: f64,
    /// Root mean square per axis against the design shifted by the lag.
    pub rmse_after_lag_m: Vector3<f64>,
    /// Distance in the x-z plane from the flown position to the path of the design.
    pub contour: ContourError,
    /// Root mean square of `estimate − position` per axis, if an estimate is logged.
    pub observer_rmse_m: Option<Vector3<f64>>,
    /// Departure from the word's plane.
    pub drift: Drift,
    /// Attitude over the flight, if it is logged.
    pub attitude: Option<AttitudeSpread>,
}

/// Distance from the flown position to the path of the design, in the x-z plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContourError {
    /// Mean.
    pub mean_m: f64,
    /// Root mean square.
    pub rms_m: f64,
    /// 95th percentile.
    pub p95_m: f64,
    /// Maximum.
    pub max_m: f64,
}

/// Position across the word's plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// Minimum.
    pub min_y_m: f64,
    /// Maximum.
    pub max_y_m: f64,
    /// Fraction of the samples within ±[`CORRIDOR_M`].
    pub in_corridor_frac: f64,
}

/// Yaw, pitch and roll over a flight, each by itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AttitudeSpread {
    /// Mean.
    #[serde(rename = "mean_rad")]
    pub mean: Attitude,
    /// Standard deviation.
    #[serde(rename = "sigma_rad")]
    pub sigma: Attitude,
    /// Maximum of the absolute value.
    #[serde(rename = "max_rad")]
    pub max: Attitude,
}

impl Tracking {
    /// Root mean square in the x-z plane.
    pub fn in_plane_rmse_m(&self) -> f64 {
        self.rmse_m.xz().norm()
    }

    /// Cap height of the lowest letters that the drone holds its height well enough to write:
    /// twenty times the error of the height after the lag.
    pub fn least_cap_height_m(&self) -> f64 {
        self.rmse_after_lag_m.z / HEIGHT_ERROR_FRAC
    }

    /// Root mean square in the x-z plane against the design shifted by the lag.
    pub fn in_plane_rmse_after_lag_m(&self) -> f64 {
        self.rmse_after_lag_m.xz().norm()
    }
}

/// Measures the tracking errors over a part of a flight.
///
/// # Errors
///
/// [`Error::Input`] if the flight has no sample in that part, or no design.
pub fn track(flight: &Flight, part: Part) -> Result<Tracking> {
    let (samples, design) = designed(flight, part)?;
    Ok(measure(flight, part, &samples, &design))
}

/// Measures samples of a part of a flight, of which there is at least one.
fn measure(flight: &Flight, part: Part, samples: &[FlightSample], design: &DesignPath) -> Tracking {
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
        contour: contour(samples, design, lag_s),
        observer_rmse_m: flight
            .has(Quantity::Estimate)
            .then(|| rms(samples.iter().map(|sample| sample.estimate_m - sample.position_m))),
        drift: drift(samples),
        attitude: flight.has(Quantity::Attitude).then(|| attitude_spread(samples)),
    }
}

/// [`Tracking::least_cap_height_m`] of a part of a flight, without the other figures.
///
/// # Errors
///
/// As [`track`].
pub fn least_cap_height_m(flight: &Flight, part: Part) -> Result<f64> {
    let (samples, design) = designed(flight, part)?;
    Ok(after_lag(&samples, &design).1.z / HEIGHT_ERROR_FRAC)
}

/// The lag, and the root mean square against the design shifted by it.
fn after_lag(samples: &[FlightSample], design: &DesignPath) -> (f64, Vector3<f64>) {
    let lag_s = lag::best_shift_s(samples, design, [-MAX_LAG_S, MAX_LAG_S]);
    let mut walk = design.walk();
    (lag_s, rms(samples.iter().map(|s| s.position_m - walk.at_m(s.time_s - lag_s))))
}

/// The samples of a part of a flight, and the path of its design. Fails without either.
pub fn designed(flight: &Flight, part: Part) -> Result<(Vec<FlightSample>, DesignPath)> {
    let samples = part.samples(flight)?;
    let design = DesignPath::new(flight).ok_or_else(|| {
        let hint = "import a log with setpoints, or compare the flight with another flight";
        Error::input("flight", "no design position", "columns x_design_m … z_design_m", hint)
    })?;
    Ok((samples, design))
}

/// The distances of samples from the design's path around their lag-shifted times.
fn contour(samples: &[FlightSample], design: &DesignPath, lag_s: f64) -> ContourError {
    let mut walk = design.walk();
    let mut distances_m = Vec::from_iter(samples.iter().map(|sample| {
        let due_s = sample.time_s - lag_s;
        let around_s = [due_s - CONTOUR_WINDOW_S, due_s + CONTOUR_WINDOW_S];
        walk.distance_m(sample.position_m, around_s)
    }));
    distances_m.sort_unstable_by(f64::total_cmp);
    // Means of the distances and of their squares.
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

/// The least and greatest y of samples, and the fraction of them inside the corridor.
fn drift(samples: &[FlightSample]) -> Drift {
    let y_m = || samples.iter().map(|sample| sample.position_m.y);
    Drift {
        min_y_m: y_m().fold(f64::INFINITY, f64::min),
        max_y_m: y_m().fold(f64::NEG_INFINITY, f64::max),
        in_corridor_frac: y_m().filter(|y| y.abs() <= CORRIDOR_M).count() as f64
            / samples.len() as f64,
    }
}

/// Mean, standard deviation and greatest absolute value of the attitude angles.
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

/// Root mean square of each component of vectors. Zero without any.
pub fn rms(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    mean(vectors.map(|v| v.component_mul(&v))).map(f64::sqrt)
}

/// Mean of vectors. Zero without any.
pub fn mean(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let (n, sum) = vectors.fold((0, Vector3::zeros()), |(n, sum), v| (n + 1, sum + v));
    sum / n.max(1) as f64
}

/// Yaw, pitch and roll as a vector.
pub fn angles_rad(attitude: &Attitude) -> Vector3<f64> {
    Vector3::new(attitude.yaw_rad, attitude.pitch_rad, attitude.roll_rad)
}

/// The attitude of a vector of yaw, pitch and roll.
pub fn attitude(angles_rad: Vector3<f64>) -> Attitude {
    let [yaw_rad, pitch_rad, roll_rad] = angles_rad.into();
    Attitude { yaw_rad, pitch_rad, roll_rad }
}
