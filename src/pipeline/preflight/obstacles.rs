//! Checks how close a flight comes to people and objects in the room.
//!
//! Products in: a [`Shoot`] and its flights. Products out: the distance of an audience, and the
//! findings `people` and `obstacles`. People must be farther away than a drone can travel without
//! commands. The distance to objects must be at least the margin of a wall plus the drone's radius.
//! The distance to an object on the floor is horizontal, because a drone descends vertically in an
//! emergency landing. Doors, cables and other objects that the scene does not describe are not
//! checked.

use std::f64::consts::SQRT_2;

use nalgebra::Vector3;

use super::checked_export::bounds_m;
use super::plans::greatest_speed_m_s;
use super::profile::ROOM_MARGIN_M;
use super::{GRAVITY_M_S2, Profile, at_time, stop_if};
use crate::scene::Scene;
use crate::shoot::Shoot;
use noctograph_core::crazyflie::MOTORS_STOP_S;
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::flight::Flight;
use noctograph_core::geometry::{Solid, segment_distance};
use noctograph_core::plan::{Plan, Setpoint};
use noctograph_export::safety::{LEAST_PEOPLE_M, START_RADIUS_M};
use noctograph_sim::sensors::Positioning;
use noctograph_sim::vehicle::FloorStep;

/// Assumed radius of a tripod with its camera, at flight height. A smaller radius would ignore a
/// long lens. A larger radius would leave no room for a camera in the smallest room.
const TRIPOD_M: f64 = 0.15;

/// Assumed radius of a base station or an anchor with its stand. A station is 75 mm wide.
const BEACON_M: f64 = 0.05;

/// Minimum vertical component of a plane's unit normal at which the plane counts as a floor.
const LEVEL_COS: f64 = 0.7;

/// Paths of all drones, as planned and, if there are flights, as flown.
pub(super) struct Paths {
    /// Straight segments of the paths, each with its start time.
    pieces: Vec<([Vector3<f64>; 2], f64)>,
    /// Minimum distance of an audience, as in [`super::ShotPlan::audience_from_m`].
    pub(super) audience_from_m: f64,
}

impl Paths {
    /// Returns the paths of a shoot's plans and flights.
    pub(super) fn new<'a>(shoot: &Shoot, flights: impl IntoIterator<Item = &'a Flight>) -> Self {
        // A plan's speed is computed from positions, because the velocities in a file may belong to
        // a different flight.
        let plans = shoot.plans.iter().map(|planned| &planned.plan);
        let mut speed_m_s = plans.clone().map(greatest_speed_m_s).fold(0.0, f64::max);
        let mut pieces: Vec<_> = plans.flat_map(pieces).collect();
        for sample in flights.into_iter().flat_map(|flight| &flight.samples) {
            let velocity_m_s = sample.attitude.world_from_body() * sample.velocity_body_m_s;
            speed_m_s = speed_m_s.max(velocity_m_s.xy().norm());
            pieces.push(([sample.position_m; 2], sample.time_s));
        }
        let word_m = shoot.strokes.as_ref().map_or(0.0, |strokes| strokes.bounds_m()[3]);
        let top_m = pieces.iter().map(|([from_m, _], _)| from_m.z).fold(word_m, f64::max);
        // A drone without commands flies on until its motors stop, and then falls from its maximum
        // height: v (t + √(2 h / g)).
        let reach_m = speed_m_s * (MOTORS_STOP_S + (2.0 * top_m / GRAVITY_M_S2).sqrt());
        // The distance is rounded up to the printed precision, so that message and check agree.
        Self { pieces, audience_from_m: ((10.0 * reach_m).ceil() / 10.0).max(LEAST_PEOPLE_M) }
    }

    /// Returns the minimum y of the paths, m, at most 0. The camera is at negative y.
    pub(super) fn front_m(&self) -> f64 {
        let points = self.pieces.iter().flat_map(|(points, _)| points);
        points.map(|point| point.y).fold(0.0, f64::min)
    }
}

/// Returns the straight segments between a plan's setpoints, each with its start time.
fn pieces(plan: &Plan) -> impl Iterator<Item = ([Vector3<f64>; 2], f64)> {
    let pairs = plan.setpoints.windows(2);
    pairs.map(|pair| ([pair[0].position_m, pair[1].position_m], pair[0].time_s))
}

/// Checks the horizontal distance between people and a flight, because a failed drone falls.
/// Returns `None` if the scene contains no people.
pub(super) fn check_people(shoot: &Shoot, paths: &Paths) -> Option<Diagnostic> {
    // A person is modeled as a circle on the floor.
    let people = &shoot.scene.sensors.lighthouse.people_m;
    let distances_m = people.iter().enumerate().flat_map(|(person, [x, y, radius_m])| {
        paths.pieces.iter().map(move |([from, to], time_s)| {
            let beside_m = segment_distance([*x, *y], [[from.x, from.y], [to.x, to.y]]);
            ((beside_m - radius_m).max(0.0), person + 1, *time_s)
        })
    });
    let (least_m, person, time_s) = distances_m.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let wanted_m = paths.audience_from_m;
    let row = Diagnostic::check("people", stop_if(least_m < wanted_m), least_m).within(wanted_m);
    Some(row.timed(time_s).say(
        format!(
            "person {person} is {least_m:.2} m away from the flight sideways{}",
            at_time(time_s)
        ),
        format!("{wanted_m:.1} m or more, which a drone without commands can cover"),
        "move people farther away ({sensors.lighthouse.people_m}), or fly slower \
         ({plan.style.dark_speed_m_s})",
    ))
}

/// An object in the room that a drone must not touch.
struct Thing {
    name: String,
    shape: Solid,
    /// True for the floor step from which the drone takes off.
    is_stand: bool,
    advice: &'static str,
}

/// Checks the distance of the plans from the camera and from objects in the scene.
pub(super) fn check_obstacles(shoot: &Shoot, profile: &Profile) -> Diagnostic {
    // The motors are at the corners of a square. Propellers do not overlap, so they extend at most
    // half a side of the square beyond the motors.
    let limit_m = ROOM_MARGIN_M + (1.0 + SQRT_2) * shoot.scene.vehicle.arm_m;
    let wanted =
        format!("{limit_m:.2} m or more from take-off to landing, and straight down from there");
    let (mut least_m, mut nearest) = (f64::INFINITY, None);
    for plan in shoot.plans.iter().map(|planned| &planned.plan) {
        let away = pieces_away_from_mark(&plan.setpoints);
        for thing in things(shoot, plan, profile) {
            for (row, (piece, time_s)) in pieces(plan).enumerate() {
                // A drone may be close to its stand during take-off and landing.
                if thing.is_stand && !away.contains(&row) {
                    continue;
                }
                if let Some(nearer_m) = thing.shape.nearer_m(piece, least_m) {
                    least_m = nearer_m;
                    nearest = Some((thing.name.clone(), time_s, thing.advice));
                }
            }
        }
    }
    let Some((name, time_s, advice)) = nearest else {
        let row = Diagnostic::check("obstacles", Severity::Fine, None);
        return row.say("none is named", wanted, "");
    };
    let row = Diagnostic::check("obstacles", stop_if(least_m < limit_m), least_m).within(limit_m);
    let (row, when) = (row.timed(time_s).detailed(name.as_str()), at_time(time_s));
    row.say(format!("{name} is {least_m:.2} m from the flight, nearest{when}"), wanted, advice)
}

/// Returns the indices of the segments between take-off and landing. Segment i begins at setpoint
/// i.
fn pieces_away_from_mark(setpoints: &[Setpoint]) -> std::ops::Range<usize> {
    let (rise, descent) = (n_above_mark(setpoints.iter()), n_above_mark(setpoints.iter().rev()));
    rise.saturating_sub(1)..setpoints.len() - descent
}

/// Returns the number of initial setpoints without a letter that are directly above the first one.
fn n_above_mark<'a>(mut setpoints: impl Iterator<Item = &'a Setpoint> + Clone) -> usize {
    let Some(mark) = setpoints.clone().next() else { return 0 };
    let above = setpoints.by_ref().take_while(|s| {
        s.letter.is_none() && (s.position_m - mark.position_m).xy().norm() <= START_RADIUS_M
    });
    above.count()
}

/// Returns the camera and the objects in the scene: beacons, floor steps, mirrors and panes.
fn things(shoot: &Shoot, plan: &Plan, profile: &Profile) -> Vec<Thing> {
    let scene = &shoot.scene;
    let ceiling_m = profile.room_m.map_or(profile.volume_m[1][2], |room_m| room_m[2]);
    let mark_m = plan.setpoints.first().map_or(Vector3::zeros(), |first| first.position_m);
    let stand_m = scene.floor.height_m(mark_m.x, mark_m.y);
    let mut things = Vec::new();
    if let Ok(camera) = scene.camera.camera(bounds_m(shoot), 0.0) {
        let shape = Solid::pillar([camera.position_m.x, camera.position_m.y], TRIPOD_M);
        let advice = "move the camera farther away ({camera.framing})";
        let name = "the camera on its tripod".to_owned();
        things.push(Thing { name, shape, is_stand: false, advice });
    }
    things.extend(beacons(scene, ceiling_m));
    for (number, FloorStep { x_m, y_m, height_m }) in scene.floor.steps.iter().enumerate() {
        // A drone may fly above the step with its take-off mark, but not above other steps.
        let is_stand = *height_m == stand_m;
        let top_m = if is_stand { *height_m } else { f64::INFINITY };
        let ends_m = [*x_m, *y_m, [f64::NEG_INFINITY, top_m]];
        let advice = "move it out of the flight's way ({floor.steps}), or write smaller or higher \
                      ({letters.canvas_m}, {letters.baseline_m})";
        let shape = Solid::Block { ends_m, radius_m: 0.0 };
        things.push(Thing { name: format!("floor.steps[{number}]"), shape, is_stand, advice });
    }
    things.extend(reflectors(scene));
    things
}

/// Returns the base stations or anchors as objects.
fn beacons(scene: &Scene, ceiling_m: f64) -> Vec<Thing> {
    let beacons = stations(scene).into_iter().map(|(name, [x, y, z])| {
        // Beacons in the lower half of a room stand on the floor, and those in the upper half hang.
        let shape = if z < 0.5 * ceiling_m {
            Solid::pillar([x, y], BEACON_M)
        } else {
            Solid::Block { ends_m: [[x; 2], [y; 2], [z; 2]], radius_m: BEACON_M }
        };
        let advice = "put it elsewhere ({sensors.lighthouse.stations}, {sensors.uwb.anchors_m})";
        Thing { name, shape, is_stand: false, advice }
    });
    beacons.collect()
}

/// Returns mirrors and panes as obstacles, except horizontal ones, over which drones fly.
fn reflectors(scene: &Scene) -> Vec<Thing> {
    let mut things = Vec::new();
    let lighthouse = &scene.sensors.lighthouse;
    for (key, planes) in [("mirrors_m", &lighthouse.mirrors_m), ("panes_m", &lighthouse.panes_m)] {
        for (number, [point_m, normal]) in planes.iter().enumerate() {
            // A normal of zero length becomes NaN, which fails the comparison below.
            let normal = Vector3::from(*normal).normalize();
            if normal.z.abs() < LEVEL_COS {
                let name = format!("sensors.lighthouse.{key}[{number}]");
                let shape = Solid::Plane(Vector3::from(*point_m), normal);
                let advice = "fly in front of it ({sensors.lighthouse.mirrors_m})";
                things.push(Thing { name, shape, is_stand: false, advice });
            }
        }
    }
    things
}

/// Returns the names, such as `anchor 1` or `station 2`, and the positions of the beacons that the
/// drone uses for positioning. The list is empty for satellite positioning.
pub fn stations(scene: &Scene) -> Vec<(String, [f64; 3])> {
    let (kind, positions_m) = match scene.sensors.positioning {
        Positioning::UwbTwr | Positioning::UwbTdoa => {
            ("anchor", scene.sensors.uwb.anchors_m.clone())
        }
        Positioning::Gnss => return Vec::new(),
        Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => {
            let stations = scene.sensors.lighthouse.stations.iter();
            ("station", stations.map(|station| station.position_m).collect())
        }
    };
    let positions_m = positions_m.into_iter().enumerate();
    positions_m.map(|(index, position_m)| (format!("{kind} {}", index + 1), position_m)).collect()
}
