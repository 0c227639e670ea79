//! Lighthouse coverage, which is the number of base stations seen from a point, and the accuracy of
//! a position measured there.
//!
//! The input is the stations and their errors, and a rectangle in the writing plane (x-z, at one
//! y). The output is a [`Coverage`] grid. Each light plane of each station that sees a level drone
//! measures `hᵀ δp = δα`. The smallest error of the position is `√tr (Σ h hᵀ/σ²)⁻¹` (Cramér and
//! Rao). σ is the total error of an angle, from its white noise, its distortion, and the station's
//! pose error. The distortion common to all stations is added. People and mirrors are included.
//! Walls, the tilt of the drone, and errors from reflections are not modeled.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::room::Room;
use crate::sensors::{Generation, LighthouseOptions, SensorOptions, StationPose};
use crate::vehicle::MAX_COORDINATE_M;
use noctograph_core::error::{Error, Result, within};
use noctograph_core::settings::Described;

/// Minimum and maximum grid spacing in m.
const STEPS_M: [f64; 2] = [0.001, 10.0];
/// Maximum number of points in a grid.
const MAX_POINTS: f64 = 1e6;

/// Grid of visibility and accuracy over a rectangle in the writing plane.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Coverage {
    /// Coordinates of the columns in m, in ascending order.
    pub x_m: Vec<f64>,
    /// Depth of the plane in m.
    pub y_m: f64,
    /// Coordinates of the rows in m, in ascending order.
    pub z_m: Vec<f64>,
    /// Points of the grid, row by row from the lowest, left to right.
    pub places: Vec<CoveredPoint>,
}

/// Visibility and accuracy at one point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoveredPoint {
    /// Number of stations that see a level drone there.
    pub n_stations: usize,
    /// Number of stations whose image in a mirror the drone sees.
    pub n_reflected: usize,
    /// Expected position error (1 σ) over all three axes in m, or `None` if the angles of the
    /// stations that see the drone leave a direction undetermined.
    pub error_m: Option<f64>,
}

/// Returns the coverage of the rectangle `[left, bottom, right, top]` in m at the depth `y_m`, on a
/// grid of `step_m`.
///
/// # Errors
///
/// Returns [`Error::Input`] without base stations, or if rectangle and step define no valid grid.
pub fn coverage(
    options: &SensorOptions,
    bounds_m: [f64; 4],
    y_m: f64,
    step_m: f64,
) -> Result<Coverage> {
    Described::check(&options.lighthouse, "sensors.lighthouse", None)?;
    within("step", step_m, STEPS_M[0], STEPS_M[1])?;
    within("depth_m", y_m, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
    for bound in bounds_m {
        within("bounds", bound, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
    }
    check_grid(bounds_m, step_m)?;
    if options.lighthouse.stations.is_empty() {
        let hint = "list the room's base stations";
        return Err(Error::input("sensors.lighthouse.stations", "none", "at least one", hint));
    }
    // The rows are ordered from bottom to top, and each row from left to right.
    let [left, bottom, right, top] = bounds_m;
    let (x_m, z_m) = (grid_m(left, right, step_m), grid_m(bottom, top, step_m));
    let points_m = z_m.iter().flat_map(|z| x_m.iter().map(move |x| Vector3::new(*x, y_m, *z)));
    let places = points_m.map(|point_m| covered_point(&options.lighthouse, &point_m)).collect();
    Ok(Coverage { x_m, y_m, z_m, places })
}

/// Checks that a rectangle is not empty, and that its grid has at most [`MAX_POINTS`] points.
fn check_grid([left, bottom, right, top]: [f64; 4], step_m: f64) -> Result<()> {
    if left >= right || bottom >= top {
        let bounds = format!("{left},{bottom},{right},{top}");
        let hint = "give left, bottom, right and top in meters, such as -1,0,1,2";
        return Err(Error::input(
            "bounds",
            bounds,
            "left less than right, and bottom less than top",
            hint,
        ));
    }
    if (right - left) / step_m * (top - bottom) / step_m > MAX_POINTS {
        let wanted = format!("a step that results in at most {MAX_POINTS} points");
        return Err(Error::input("step", format!("{step_m} m"), wanted, "use a larger step"));
    }
    Ok(())
}

impl Coverage {
    /// Returns the fraction of the points that at least two stations see.
    pub fn seen_frac(&self) -> f64 {
        self.seen().count() as f64 / self.places.len() as f64
    }

    /// Returns the errors in m at the points that at least two stations see, in ascending order.
    pub fn errors_m(&self) -> Vec<f64> {
        let mut errors_m: Vec<f64> = self.seen().filter_map(|place| place.error_m).collect();
        errors_m.sort_by(f64::total_cmp);
        errors_m
    }

    /// Returns the points that at least two stations see.
    fn seen(&self) -> impl Iterator<Item = &CoveredPoint> {
        self.places.iter().filter(|place| place.n_stations >= 2)
    }
}

/// Returns equally spaced coordinates from one end to the other, both included, at most `step_m`
/// apart.
fn grid_m(from_m: f64, to_m: f64, step_m: f64) -> Vec<f64> {
    // The tolerance prevents an additional step due to rounding, because 1.1 / 0.1 exceeds 11.
    #[expect(clippy::cast_possible_truncation, reason = "at most 2e7")]
    let n = ((to_m - from_m) / step_m - 1e-9).ceil() as u32;
    (0..=n).map(|i| from_m + (to_m - from_m) * f64::from(i) / f64::from(n)).collect()
}

/// Returns the numbers of stations whose sweeps reach a level drone at a point directly and by a
/// mirror, and the standard deviation of the position there in m.
fn covered_point(options: &LighthouseOptions, point_m: &Vector3<f64>) -> CoveredPoint {
    let room = Room::new(options);
    let (mut n_stations, mut n_reflected, mut information) = (0, 0, Matrix3::zeros());
    for station in &options.stations {
        let pose = StationPose::new(station);
        let up = Vector3::z();
        let mut mirrors = room.mirrors.iter();
        n_reflected += usize::from(mirrors.any(|mirror| mirror.shows_to(&pose, point_m, &up)));
        if !pose.sees(point_m, &up) || room.hides(&pose.position_m, point_m, &[]) {
            continue;
        }
        n_stations += 1;
        // The errors of an angle are independent, and station position errors matter less at a
        // distance.
        let distance_m = (point_m - pose.position_m).norm();
        let sigmas_rad = [
            options.sweep_noise_rad[usize::from(station.generation == Generation::V2)],
            options.sweep_distortion_rad,
            options.station_rotation_error_rad,
            options.station_position_error_m / distance_m,
        ];
        let variance = sigmas_rad.iter().fold(0.0, |sum, sigma_rad| sum + sigma_rad * sigma_rad);
        // The Fisher information from both planes is Σ h hᵀ / σ².
        for plane in 0..2 {
            let gradient = pose.crossing(plane, point_m).gradient_rad_m;
            information += gradient * gradient.transpose() / variance.max(f64::MIN_POSITIVE);
        }
    }
    // The two angles of one station, or of two stations in line with the point, leave the distance
    // undetermined. In that case, the information matrix has no inverse.
    let scale = information.trace() / 3.0;
    let inverse = (information / scale).try_inverse().filter(|_| n_stations >= 2);
    let common_m2 = 3.0 * (options.distortion_m * options.distortion_m);
    let error_m = inverse.map(|inverse| (inverse.trace() / scale + common_m2).sqrt());
    CoveredPoint { n_stations, n_reflected, error_m: error_m.filter(|error_m| error_m.is_finite()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::Station;

    /// Returns two stations 3 m from (0, 0, 0) at right angles, each of them 0.6 m above it.
    fn square_stations() -> LighthouseOptions {
        let height = 0.6;
        let stations = [[-3.0, 0.0, height], [0.0, -3.0, height]]
            .map(|place| Station::looking(Generation::V1, place, [0.0, 0.0, height]));
        LighthouseOptions {
            stations: stations.into(),
            sweep_noise_rad: [1e-3, 1e-3],
            ..SensorOptions::ideal().lighthouse
        }
    }

    #[test]
    fn error_is_that_of_geometry_by_hand() {
        // At 3 m, an angular error of 1 mrad causes an error of 3 mm across each beam. One beam is
        // along x, one along y, and both determine z. The stations are 0.6 m above the point, which
        // tilts each line of sight by atan(0.2).
        let place = covered_point(&square_stations(), &Vector3::zeros());
        assert_eq!(place.n_stations, 2);
        let level = covered_point(&square_stations(), &Vector3::new(0.0, 0.0, 0.0));
        let error_m = level.error_m.unwrap();
        let want = 3e-3 * f64::sqrt(1.0 + 1.0 + 0.5);
        assert!((error_m / want - 1.0).abs() < 0.04, "{error_m} m against {want} m");
    }

    #[test]
    fn one_station_leaves_the_place_open_and_none_sees_behind_itself() {
        let mut options = square_stations();
        options.stations.pop();
        let place = covered_point(&options, &Vector3::zeros());
        assert_eq!(place, CoveredPoint { n_stations: 1, n_reflected: 0, error_m: None });
        let behind = covered_point(&options, &Vector3::new(-4.0, 0.0, 0.0));
        assert_eq!(behind, CoveredPoint { n_stations: 0, n_reflected: 0, error_m: None });
    }

    #[test]
    fn a_person_hides_a_station_and_a_mirror_shows_one_twice() {
        let mut options = square_stations();
        options.people_m = vec![[-1.0, 0.0, 0.25]];
        options.mirrors_m = vec![[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]];
        let place = covered_point(&options, &Vector3::zeros());
        assert_eq!((place.n_stations, place.error_m), (1, None), "the first is behind a person");
        assert_eq!(place.n_reflected, 2, "the images of both look at it");
        options.mirrors_m[0][1] = [1.0, 0.0, 0.0];
        assert_eq!(
            covered_point(&options, &Vector3::zeros()).n_reflected,
            0,
            "the back of the mirror"
        );
    }

    #[test]
    fn the_default_stations_cover_the_default_word() {
        let grid = coverage(&SensorOptions::default(), [-0.6, 0.0, 0.9, 1.2], 0.0, 0.1).unwrap();
        assert_eq!((grid.x_m.len(), grid.z_m.len(), grid.places.len()), (16, 13, 208));
        assert_eq!(grid.seen_frac(), 1.0, "two stations see every place");
        let errors_m = grid.errors_m();
        assert!(errors_m[0] > 0.005 && errors_m[207] < 0.03, "{errors_m:?}");
    }

    #[test]
    fn what_makes_no_grid_is_refused() {
        let options = SensorOptions::default();
        let refused =
            |bounds_m, step_m| coverage(&options, bounds_m, 0.0, step_m).unwrap_err().to_string();
        assert!(refused([0.0, 0.0, 0.0, 1.0], 0.1).starts_with("bounds"));
        assert!(refused([0.0, 0.0, 100.0, 100.0], 0.01).starts_with("step"));
        assert!(refused([0.0, 0.0, 1.0, 1.0], 0.0).starts_with("step"));
        assert!(refused([0.0, 0.0, f64::NAN, 1.0], 0.1).starts_with("bounds"));
        let mut none = SensorOptions::default();
        none.lighthouse.stations.clear();
        assert!(coverage(&none, [0.0, 0.0, 1.0, 1.0], 0.0, 0.1).is_err(), "no stations");
    }
}
