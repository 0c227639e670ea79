//! Positions from crossing beams, which are the points nearest to the rays from all stations
//! received recently.
//!
//! For each sensor of the deck, the point solves `Σ (I − d dᵀ) p = Σ (I − d dᵀ) o` over the rays
//! from `o` along `d`. For two rays, this is the middle of their shortest connection, as in the
//! firmware (`lighthouse_position_est.c`, `estimatePositionCrossingBeams`). The deck's middle is
//! the mean of its sensors.

use nalgebra::{Matrix3, Vector3};

use super::Station;
use super::lighthouse::{DECK_SENSORS_M, Sweep};
use super::station::StationPose;

/// Maximum age of an angle in s, 1.5 turns of the slowest rotor. A lost sweep costs one fix.
const FRESH_S: f64 = 0.03;

/// Combination of sweeps to positions.
#[derive(Debug)]
pub(super) struct CrossingBeams {
    stations: Vec<Heard>,
}

#[derive(Debug)]
struct Heard {
    pose: StationPose,
    angles_rad: [[f64; 4]; 2],
    times_s: [f64; 2],
}

impl Heard {
    /// True if both planes' angles are recent.
    fn is_fresh(&self, time_s: f64) -> bool {
        self.times_s.iter().all(|t| time_s - t <= FRESH_S)
    }
}

impl CrossingBeams {
    /// Creates the state of the stations before any sweep is received.
    pub(super) fn new(stations: &[Station]) -> Self {
        let stations = stations.iter().map(|station| Heard {
            pose: StationPose::new(station),
            angles_rad: [[0.0; 4]; 2],
            times_s: [f64::NEG_INFINITY; 2],
        });
        Self { stations: stations.collect() }
    }

    /// Returns the position of the deck's center after the sweeps of this tick. Returns `None`
    /// unless a second plane has passed in this tick and both planes of at least two stations have
    /// been received recently.
    pub(super) fn fix_m(&mut self, sweeps: &[Sweep], time_s: f64) -> Option<Vector3<f64>> {
        for sweep in sweeps {
            let heard = &mut self.stations[sweep.station];
            heard.angles_rad[sweep.plane] = sweep.angles_rad;
            heard.times_s[sweep.plane] = time_s;
        }
        if !sweeps.iter().any(|sweep| sweep.plane == 1) {
            return None;
        }
        let fresh = self.stations.iter().filter(|heard| heard.is_fresh(time_s));
        if fresh.clone().count() < 2 {
            return None;
        }
        let mut middle = Vector3::zeros();
        for sensor in 0..DECK_SENSORS_M.len() {
            // The normal equations N p = r give the least-squares point nearest to all rays.
            let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
            for heard in fresh.clone() {
                let [first, second] = heard.angles_rad;
                let ray = heard.pose.ray([first[sensor], second[sensor]]);
                let across = Matrix3::identity() - ray * ray.transpose();
                normal += across;
                right += across * heard.pose.position_m;
            }
            middle += normal.try_inverse()? * right;
        }
        Some(middle / DECK_SENSORS_M.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::lighthouse::Lighthouse;
    use crate::sensors::streams::Streams;
    use crate::sensors::{Generation, LighthouseOptions, SensorOptions};
    use noctograph_core::geometry::Attitude;

    /// Returns the fixes during a second at rest.
    fn fixes(options: &LighthouseOptions, position_m: Vector3<f64>) -> Vec<Vector3<f64>> {
        let attitude = Attitude { yaw_rad: 0.3, pitch_rad: 0.05, roll_rad: -0.1 }.world_from_body();
        let mut lighthouse = Lighthouse::new(options, &Streams::alone(1));
        let mut beams = CrossingBeams::new(&options.stations);
        let times = (1..=500).map(|tick| f64::from(tick) / 500.0);
        times
            .filter_map(|t| beams.fix_m(lighthouse.read(&position_m, || attitude, t, &[]), t))
            .collect()
    }

    #[test]
    fn position_is_exact_without_noise() {
        let place = Vector3::new(-0.3, 0.1, 0.6);
        for generation in [Generation::V1, Generation::V2] {
            let mut options = SensorOptions::ideal().lighthouse;
            options.stations.iter_mut().for_each(|s| s.generation = generation);
            let fixes = fixes(&options, place);
            assert!(fixes.len() > 50, "{} fixes in a second", fixes.len());
            let worst = fixes.iter().map(|fix| (fix - place).norm()).fold(0.0, f64::max);
            assert!(worst < 1e-12, "{generation:?}: {worst:e} m");
        }
    }

    #[test]
    fn one_station_makes_no_fix() {
        let mut options = SensorOptions::ideal().lighthouse;
        options.stations[1].yaw_rad += 3.0;
        assert!(fixes(&options, Vector3::z()).is_empty(), "the second looks away");
    }
}
