//! Objects that block or reflect the base stations' light: people, other drones, mirrors and panes.
//!
//! A person is modeled as an upright cylinder and a drone as a ball, both of which block the light.
//! With a mirror, the deck also receives the sweep that hits the deck's image behind the mirror,
//! with the angle of that image. The estimator's filter accepts or rejects such sweeps. A pane of
//! glass reflects visibly if the light is strong enough. If a deck can receive a station's direct
//! light from 6 m, it can receive a fraction R of that light from 6 m times √R. Both surfaces of
//! the pane reflect according to Fresnel's equations for unpolarized light and a refractive index
//! of 1.52.
//!
//! Mirror edges, light reflected by two mirrors, people who block reflected light, and the delay of
//! a reflection, because of which the firmware drops some sweeps, are not modeled.

use nalgebra::{Matrix3, Vector3};

use super::LighthouseOptions;
use super::station::{RANGE_M, StationPose};

/// Height of a person in m.
const PERSON_M: f64 = 1.8;
/// Radius of a drone in m, which is half the distance of 92 mm between opposite motors.
const DRONE_M: f64 = 0.046;

/// Refractive index of glass.
const GLASS: f64 = 1.52;

/// People, mirrors and outages of a room.
#[derive(Debug)]
pub(super) struct Room {
    /// Position of the axis in x and y, and radius, in m.
    people_m: Vec<[f64; 3]>,
    pub(super) mirrors: Vec<Mirror>,
    silent: Vec<[f64; 3]>,
}

/// Plane that reflects light on one side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mirror {
    point_m: Vector3<f64>,
    facing: Vector3<f64>,
    is_glass: bool,
}

impl Room {
    /// Creates the room that the options describe. A mirror without a normal is left out.
    pub(super) fn new(options: &LighthouseOptions) -> Self {
        let opaque = options.mirrors_m.iter().map(|plane| (plane, false));
        let planes = opaque.chain(options.panes_m.iter().map(|plane| (plane, true)));
        let mirrors = planes.filter_map(|([point_m, facing], is_glass)| {
            let facing = Vector3::from(*facing).try_normalize(0.0)?;
            Some(Mirror { point_m: Vector3::from(*point_m), facing, is_glass })
        });
        Self {
            people_m: options.people_m.clone(),
            mirrors: mirrors.collect(),
            silent: options.silent.clone(),
        }
    }

    /// True if a station is silent at a time, according to the list of silent periods.
    pub(super) fn is_silent(&self, station: usize, time_s: f64) -> bool {
        self.silent.iter().any(|[silent, from_s, to_s]| {
            *silent == station as f64 && (*from_s..*to_s).contains(&time_s)
        })
    }

    /// True if a person or a drone is between a station and a deck. The deck's own drone, which may
    /// be among `drones_m`, does not hide the deck. Positions are in the world frame.
    pub(super) fn hides(
        &self,
        station_m: &Vector3<f64>,
        deck_m: &Vector3<f64>,
        drones_m: &[Vector3<f64>],
    ) -> bool {
        let path_m = deck_m - station_m;
        // A person blocks the light if the point of the path nearest to the cylinder's axis is
        // within the cylinder and below its top.
        let by_person = self.people_m.iter().any(|[x, y, radius]| {
            let axis_m = (Vector3::new(*x, *y, 0.0) - station_m).xy();
            let level_m = path_m.xy();
            let fraction = (axis_m.dot(&level_m) / level_m.norm_squared()).clamp(0.0, 1.0);
            (axis_m - level_m * fraction).norm() < *radius
                && station_m.z + path_m.z * fraction < PERSON_M
        });
        // A drone blocks the light if the path's point nearest to the ball's center is within the
        // ball.
        let by_drone = drones_m.iter().any(|drone_m| {
            let to_m = drone_m - station_m;
            let fraction = to_m.dot(&path_m) / path_m.norm_squared();
            (drone_m - deck_m).norm() > DRONE_M
                && (0.0..1.0).contains(&fraction)
                && (to_m - path_m * fraction).norm() < DRONE_M
        });
        by_person || by_drone
    }
}

impl Mirror {
    /// True if the mirror reflects the light of a station to a deck.
    pub(super) fn shows(&self, station_m: &Vector3<f64>, deck_m: &Vector3<f64>) -> bool {
        // Both must be in front of the mirror, and a pane must reflect enough at this angle.
        if ![station_m, deck_m].iter().all(|m| (*m - self.point_m).dot(&self.facing) > 0.0) {
            return false;
        }
        let path_m = self.image_m(deck_m) - station_m;
        let cosine = -path_m.dot(&self.facing) / path_m.norm();
        !self.is_glass || path_m.norm() <= RANGE_M * reflected_frac(cosine).sqrt()
    }

    /// True if a deck that faces `up` receives the image of a station in the mirror.
    pub(super) fn shows_to(
        &self,
        station: &StationPose,
        deck_m: &Vector3<f64>,
        up: &Vector3<f64>,
    ) -> bool {
        self.shows(&station.position_m, deck_m)
            && station.sees(&self.image_m(deck_m), &(self.reflection() * up))
    }

    /// Returns the mirror image of a point.
    pub(super) fn image_m(&self, position_m: &Vector3<f64>) -> Vector3<f64> {
        self.point_m + self.reflection() * (position_m - self.point_m)
    }

    /// Returns the Householder matrix that reflects directions.
    pub(super) fn reflection(&self) -> Matrix3<f64> {
        Matrix3::identity() - 2.0 * self.facing * self.facing.transpose()
    }
}

/// Returns the fraction of the light that a pane reflects at a cosine of the angle to its normal.
fn reflected_frac(cosine: f64) -> f64 {
    // The reflectance of one surface follows from Fresnel's amplitudes for both polarizations. That
    // of the pane is the sum over all reflections between both surfaces.
    let inside = (1.0 - (1.0 - cosine * cosine) / (GLASS * GLASS)).sqrt();
    let across = (cosine - GLASS * inside) / (cosine + GLASS * inside);
    let along = (GLASS * cosine - inside) / (GLASS * cosine + inside);
    let surface = 0.5 * (across * across + along * along);
    2.0 * surface / (1.0 + surface)
}

#[cfg(test)]
mod tests {
    use super::super::StationPose;
    use super::*;

    #[test]
    fn people_and_drones_hide_what_is_behind_them() {
        let options = LighthouseOptions {
            people_m: vec![[1.0, 0.0, 0.25]],
            silent: vec![[1.0, 2.0, 3.0]],
            ..LighthouseOptions::default()
        };
        let room = Room::new(&options);
        let (station_m, deck_m) = (Vector3::new(3.0, 0.0, 2.4), Vector3::new(-1.0, 0.0, 0.5));
        assert!(room.hides(&station_m, &deck_m, &[]), "the path passes 1.45 m up, at the middle");
        let high_m = Vector3::new(-1.0, 0.0, 1.6);
        assert!(!room.hides(&station_m, &high_m, &[]), "over the head");
        let beside_m = Vector3::new(-1.0, 1.5, 0.5);
        assert!(!room.hides(&station_m, &beside_m, &[]));
        let between_m = station_m + (beside_m - station_m) * 0.7;
        assert!(room.hides(&station_m, &beside_m, &[between_m, beside_m]), "another drone");
        assert!(!room.hides(&station_m, &beside_m, &[beside_m]), "not the drone itself");
        assert!(room.is_silent(1, 2.5) && !room.is_silent(1, 3.0) && !room.is_silent(0, 2.5));
    }

    #[test]
    fn a_pane_shows_what_is_near_or_grazes_it() {
        // According to Hecht, Optics, a surface of glass reflects 4.3 % at normal incidence.
        assert!((reflected_frac(1.0) - 0.0817).abs() < 1e-4, "{}", reflected_frac(1.0));
        assert!(reflected_frac(0.1) > 0.6 && (reflected_frac(0.0) - 1.0).abs() < 1e-9);
        let pane = Mirror { point_m: Vector3::x() * 2.0, facing: -Vector3::x(), is_glass: true };
        let deck_m = Vector3::new(1.5, 0.0, 0.8);
        let shows = |x: f64, y: f64| pane.shows(&Vector3::new(x, y, 1.2), &deck_m);
        assert!(shows(1.4, 0.0) && !shows(0.0, 0.0), "straight on: 1.7 m");
        assert!(shows(1.9, 3.5), "grazing: 3.6 m");
    }

    #[test]
    fn a_mirror_shows_the_station_behind_it() {
        // A sweep that hits the deck's image is equivalent to one from the station's image to the
        // deck.
        let mirror = Mirror { point_m: Vector3::x() * 2.0, facing: -Vector3::x(), is_glass: false };
        let options = LighthouseOptions::default();
        let pose = StationPose::new(&options.stations[0]);
        let deck_m = Vector3::new(0.3, 0.1, 0.8);
        assert!(mirror.shows(&pose.position_m, &deck_m));
        assert!(!mirror.shows(&pose.position_m, &Vector3::new(2.1, 0.0, 0.8)), "behind it");
        let image_m = mirror.image_m(&deck_m);
        assert!((image_m - Vector3::new(3.7, 0.1, 0.8)).norm() < 1e-12);
        let direct = (pose.position_m - image_m).norm();
        let reflected = (mirror.image_m(&pose.position_m) - deck_m).norm();
        assert!((direct - reflected).abs() < 1e-12, "one length");
    }
}
