//! Compares located positions and measured ranges with a reference, such as motion capture.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::residuals::{Spread, spread_by_link};
use super::{Link, Located, RangeSample};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;

/// Maximum gap in s over which the reference is interpolated.
const LONGEST_GAP_S: f64 = 0.2;
/// Span in s by which samples at the same time are considered apart, to avoid a division by zero.
const LEAST_SPAN_S: f64 = 1e-9;

/// True positions of a drone, measured on a different clock.
#[derive(Clone, Copy, Debug)]
pub struct Reference<'a> {
    /// Flight that contains the positions.
    pub flight: &'a Flight,
    /// Seconds to add to the flight's clock.
    pub offset_s: f64,
}

impl Reference<'_> {
    /// Returns the reference's position in m at a time of the ranges, interpolated between the two
    /// nearest samples. Returns `None` up to the first sample, after the last one, and in gaps.
    pub fn position_m(&self, time_s: f64) -> Option<Vector3<f64>> {
        let (samples, clock_s) = (&self.flight.samples, time_s - self.offset_s);
        let after = samples.partition_point(|s| s.time_s < clock_s);
        let (a, b) = (samples.get(after.checked_sub(1)?)?, samples.get(after)?);
        let fraction = (clock_s - a.time_s) / (b.time_s - a.time_s).max(LEAST_SPAN_S);
        (b.time_s - a.time_s <= LONGEST_GAP_S)
            .then(|| a.position_m + (b.position_m - a.position_m) * fraction)
    }
}

/// Errors of a drone's located positions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PositionError {
    /// Root mean square error on each axis.
    pub rmse_m: [f64; 3],
    /// Root mean square distance.
    pub rmse_3d_m: f64,
    /// Mean normalized squared error per axis. `None` without a covariance.
    pub nees: Option<f64>,
    /// Number of positions that were compared.
    pub samples: usize,
}

/// Compares the located positions of a drone with a reference, at the times of the ranges.
///
/// # Errors
///
/// Returns [`Error::Input`] if the two do not overlap in time.
pub fn position_error(
    located: &Located,
    drone: usize,
    reference: Reference<'_>,
) -> Result<PositionError> {
    let (mut sum_of_squares, mut nees_sum, mut n_compared) = (Vector3::zeros(), 0.0, 0_u32);
    for k in located.heard(drone) {
        let Some(true_m) = reference.position_m(located.time_s[k]) else { continue };
        // Both the squared error on each axis and, given a covariance, εᵀP⁻¹ε / 3 are accumulated.
        let error_m = located.position_m[drone][k] - true_m;
        sum_of_squares += error_m.component_mul(&error_m);
        if let Some(covariances) = located.covariance_m2.get(drone) {
            let inverse: Matrix3<f64> = covariances[k].try_inverse().unwrap_or_default();
            nees_sum += error_m.dot(&(inverse * error_m)) / 3.0;
        }
        n_compared += 1;
    }
    if n_compared == 0 {
        let hint = "set the difference of the two clocks in seconds";
        return Err(Error::input("offset", reference.offset_s, "clocks that overlap", hint));
    }
    let mean_square = sum_of_squares / f64::from(n_compared);
    Ok(PositionError {
        rmse_m: mean_square.map(f64::sqrt).into(),
        rmse_3d_m: mean_square.sum().sqrt(),
        nees: (!located.covariance_m2.is_empty()).then_some(nees_sum / f64::from(n_compared)),
        samples: n_compared as usize,
    })
}

/// Statistics of a link's range errors, which are measured minus true distances.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkError {
    /// Name of the link.
    pub link: String,
    /// Median error, a bias that may result from an antenna delay.
    pub median_m: f64,
    /// Standard deviation about the median, computed from the median absolute deviation.
    pub scatter_m: f64,
    /// Number of ranges that were compared.
    pub ranges: usize,
}

/// Returns the errors of the ranges of every link, relative to the distances from the references,
/// one for each drone. A link whose ends have no reference at any range is left out.
pub fn link_errors(
    samples: &[RangeSample],
    anchors_m: &[Vector3<f64>],
    references: &[Reference<'_>],
) -> Vec<LinkError> {
    let errors = samples.iter().filter_map(|sample| {
        let mut drones_m =
            sample.link.drones().map(|drone| references.get(drone)?.position_m(sample.time_s));
        // A link connects a drone to an anchor or to another drone.
        let first_m = drones_m.next()??;
        let second_m = match sample.link {
            Link::Anchor { anchor, .. } => *anchors_m.get(anchor)?,
            Link::Drones(..) => drones_m.next()??,
        };
        Some((*sample, sample.distance_m - (first_m - second_m).norm()))
    });
    let (compared, errors_m): (Vec<RangeSample>, Vec<f64>) = errors.unzip();
    let links = spread_by_link(&compared, &errors_m).into_iter();
    Vec::from_iter(links.map(|(link, Spread { median_m, scatter_m, n: ranges })| {
        let link = link.to_string();
        LinkError { link, median_m, scatter_m, ranges }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::FlightData;
    use noctograph_core::flight::FlightSample;

    #[test]
    fn a_bias_and_a_scatter_are_told_apart_and_gaps_are_left_out() {
        // The drone moves along x at 1 m/s, and the reference has a gap from 1 to 2 s.
        let times_s = (0..=300).map(|k| f64::from(k) / 100.0).filter(|t| !(1.0..2.0).contains(t));
        let sample = |time_s: f64| FlightSample {
            time_s,
            position_m: Vector3::new(time_s, 0.0, 0.0),
            ..FlightSample::default()
        };
        let flight = Flight::made(FlightData {
            samples: times_s.map(sample).collect(),
            ..FlightData::default()
        });
        // The reference's clock is half a second behind.
        let reference = Reference { flight: &flight, offset_s: 0.5 };
        let anchors_m = [Vector3::new(10.0, 0.0, 0.0)];
        fn range(k: u32) -> RangeSample {
            let time_s = f64::from(k) / 10.0;
            let off_m = [-0.1, 0.0, 0.1][k as usize % 3];
            RangeSample {
                time_s,
                link: Link::Anchor { drone: 0, anchor: 0 },
                distance_m: 10.0 - (time_s - 0.5) + 0.4 + off_m,
            }
        }
        let samples: Vec<RangeSample> = (0..36).map(range).collect();
        let [error] = link_errors(&samples, &anchors_m, &[reference]).try_into().unwrap();
        assert_eq!((error.link.as_str(), error.ranges), ("drone 1 to anchor 1 (distance0)", 19));
        assert!((error.median_m - 0.4).abs() < 1e-9, "{} m", error.median_m);
        assert!((error.scatter_m - 0.14826).abs() < 1e-9, "{} m", error.scatter_m);
        assert!(reference.position_m(9.0).is_none());
    }
}
