//! People and things in the room: how near a flight comes to them.
//!
//! In: a [`Shoot`], and its flights. Out: the distance of an audience, and the rows `people` and
//! `obstacles`. People keep as far off as a drone without commands may come. Things keep from the
//! design what a wall does, and the drone's reach. What stands on the floor keeps it at any height:
//! a drone that lands in an emergency comes straight down. Not known: doors, cables, and all that
//! no key of the scene names.

use std::f64::consts::SQRT_2;

use nalgebra::Vector3;

use super::Profile;
use super::checked_export::bounds_m;
use super::placement::stations;
use super::plans::greatest_speed_m_s;
use super::profile::ROOM_MARGIN_M;
use super::row::{Row, at_time, stop_if};
use crate::scene::Scene;
use crate::shoot::Shoot;
use noctograph_core::crazyflie::MOTORS_STOP_S;
use noctograph_core::flight::Flight;
use noctograph_core::geometry::segment_distance;
use noctograph_core::plan::{Plan, Setpoint};
use noctograph_export::safety::{LEAST_PEOPLE_M, START_RADIUS_M};
use noctograph_sim::vehicle::FloorStep;

/// Standard gravity, m/s².
const GRAVITY_M_S2: f64 = 9.806_65;

/// Radius of a tripod with its camera at the height of a flight, an assumption: less hides a long
/// lens or a leg, more leaves no place for a camera in the smallest room.
const TRIPOD_M: f64 = 0.15;

/// Radius of a base station or an anchor with its stand, an assumption: a station is 75 mm wide.
const BEACON_M: f64 = 0.05;

/// Least slope of the normal of a plane that is no wall: a floor that reflects is flown above.
const LEVEL_COS: f64 = 0.7;

/// The ways of all drones: as planned and, where they are known, as flown.
pub(super) struct Ways {
    /// Straight pieces, with their beginning's time.
    pieces: Vec<([Vector3<f64>; 2], f64)>,
    /// See [`super::ShotPlan::audience_from_m`].
    pub(super) audience_from_m: f64,
}

impl Ways {
    /// The plans of a shoot, and flights of them.
    pub(super) fn new<'a>(shoot: &Shoot, flights: impl IntoIterator<Item = &'a Flight>) -> Self {
        let plans = || shoot.plans.iter().map(|planned| &planned.plan);
        // A file's columns of velocities are not asked: they may be of another flight.
        let mut speed_m_s = plans().map(greatest_speed_m_s).fold(0.0, f64::max);
        let mut pieces: Vec<_> = plans().flat_map(|plan| pieces(plan)).collect();
        for sample in flights.into_iter().flat_map(|flight| &flight.samples) {
            let velocity_m_s = sample.attitude.world_from_body() * sample.velocity_body_m_s;
            speed_m_s = speed_m_s.max(velocity_m_s.xy().norm());
            pieces.push(([sample.position_m; 2], sample.time_s));
        }
        let word_m = shoot.strokes.as_ref().map_or(0.0, |strokes| strokes.bounds_m()[3]);
        let top_m = pieces.iter().map(|([from_m, _], _)| from_m.z).fold(word_m, f64::max);
        let comes_m = speed_m_s * (MOTORS_STOP_S + (2.0 * top_m / GRAVITY_M_S2).sqrt());
        // Rounded up to what is printed, so that sentence and check agree.
        Self { pieces, audience_from_m: ((10.0 * comes_m).ceil() / 10.0).max(LEAST_PEOPLE_M) }
    }

    /// Least y: nearest to the camera.
    pub(super) fn front_m(&self) -> f64 {
        let ends = self.pieces.iter().flat_map(|(ends, _)| ends);
        ends.map(|end| end.y).fold(0.0, f64::min)
    }
}

/// The straight pieces between the setpoints of a plan.
fn pieces(plan: &Plan) -> impl Iterator<Item = ([Vector3<f64>; 2], f64)> {
    let pairs = plan.setpoints.windows(2);
    pairs.map(|pair| ([pair[0].position_m, pair[1].position_m], pair[0].time_s))
}

/// How near a flight comes to people, from take-off to landing, at any height: a drone that fails
/// falls; `None` where the scene has none.
pub(super) fn check_people(shoot: &Shoot, ways: &Ways) -> Option<Row> {
    let people = &shoot.scene.sensors.lighthouse.people_m;
    let distances_m = people.iter().enumerate().flat_map(|(person, [x, y, radius_m])| {
        ways.pieces.iter().map(move |([from, to], time_s)| {
            let beside_m = segment_distance([*x, *y], [[from.x, from.y], [to.x, to.y]]);
            ((beside_m - radius_m).max(0.0), person + 1, *time_s)
        })
    });
    let (least_m, person, time_s) = distances_m.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let wanted_m = ways.audience_from_m;
    let row = Row::new("people", stop_if(least_m < wanted_m), least_m).within(wanted_m);
    Some(row.timed(time_s).say(
        format!("person {person} is {least_m:.2} m beside the flight{}", at_time(time_s)),
        format!("{wanted_m:.1} m or more, as far as a drone without commands may come"),
        "let people stand farther off ({sensors.lighthouse.people_m}), or fly slower \
         ({plan.style.dark_speed_m_s})",
    ))
}

/// The shape of a thing. Each is convex, so that its distance has one minimum along a piece.
enum Shape<'a> {
    /// On the floor, around an axis.
    Pillar([f64; 2], f64),
    /// On the floor.
    Step(&'a FloorStep),
    /// The one on which a drone takes off, which may fly above it.
    Stand(&'a FloorStep),
    /// Around a place in the air.
    Ball(Vector3<f64>, f64),
    /// A point and the normal of a wall.
    Wall(Vector3<f64>, Vector3<f64>),
}

impl Shape<'_> {
    fn distance_m(&self, place_m: &Vector3<f64>) -> f64 {
        let beside_m = |FloorStep { x_m, y_m, .. }: &FloorStep| {
            let beyond_m = |[low, high]: [f64; 2], m: f64| (low - m).max(m - high).max(0.0);
            libm::hypot(beyond_m(*x_m, place_m.x), beyond_m(*y_m, place_m.y))
        };
        match self {
            Self::Pillar([x, y], radius_m) => libm::hypot(place_m.x - x, place_m.y - y) - radius_m,
            Self::Step(step) => beside_m(step),
            Self::Stand(step) => libm::hypot(beside_m(step), (place_m.z - step.height_m).max(0.0)),
            Self::Ball(middle_m, radius_m) => (place_m - middle_m).norm() - radius_m,
            Self::Wall(point_m, normal) => (place_m - point_m).dot(normal).abs(),
        }
        .max(0.0)
    }

    /// The least distance along a piece, by ternary search; `None` if it is not below `most_m`.
    fn nearer_m(&self, [from_m, to_m]: [Vector3<f64>; 2], most_m: f64) -> Option<f64> {
        let along_m = |share: f64| self.distance_m(&from_m.lerp(&to_m, share));
        if along_m(0.0) - (to_m - from_m).norm() >= most_m {
            return None;
        }
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            if along_m(a) < along_m(b) { high = b } else { low = a }
        }
        let least_m = [0.0, low, 1.0].map(along_m).into_iter().fold(f64::INFINITY, f64::min);
        (least_m < most_m).then_some(least_m)
    }
}

/// A thing in the room: its name, its shape, and advice.
type Thing<'a> = (String, Shape<'a>, &'static str);

/// How near the plans come to the camera and to the things that the scene names.
pub(super) fn check_obstacles(shoot: &Shoot, profile: &Profile) -> Row {
    // Motors are at the corners of a square, and propellers that do not overlap reach half of its
    // side beyond them.
    let limit_m = ROOM_MARGIN_M + (1.0 + SQRT_2) * shoot.scene.vehicle.arm_m;
    let (mut least_m, mut nearest) = (f64::INFINITY, None);
    for plan in shoot.plans.iter().map(|planned| &planned.plan) {
        let ramps = ramps(&plan.setpoints);
        for (name, shape, advice) in things(shoot, plan, profile) {
            let is_stand = matches!(shape, Shape::Stand(_));
            let clear = pieces(plan).enumerate().filter(|(row, _)| !is_stand || !ramps(*row));
            for (piece, time_s) in clear.map(|(_, piece)| piece) {
                if let Some(m) = shape.nearer_m(piece, least_m) {
                    (least_m, nearest) = (m, Some((name.clone(), time_s, advice)));
                }
            }
        }
    }
    let wanted = format!(
        "{limit_m:.2} m or more from take-off to landing, and where a drone comes straight down"
    );
    let Some((name, time_s, advice)) = nearest else {
        return Row::new("obstacles", stop_if(false), None).say("none is named", wanted, "");
    };
    let is_near = least_m < limit_m;
    let row = Row::new("obstacles", stop_if(is_near), least_m).within(limit_m).timed(time_s);
    let row = row.detailed(name.as_str());
    let when = at_time(time_s);
    row.say(format!("{name} is {least_m:.2} m from the flight, nearest{when}"), wanted, advice)
}

/// Whether the piece after a setpoint is of the take-off or the landing: before and after the
/// letters, above the mark.
fn ramps(setpoints: &[Setpoint]) -> impl Fn(usize) -> bool + use<> {
    fn length<'a>(mut setpoints: impl Iterator<Item = &'a Setpoint> + Clone) -> usize {
        let Some(mark) = setpoints.clone().next() else { return 0 };
        let above = |s: &&Setpoint| (s.position_m - mark.position_m).xy().norm() <= START_RADIUS_M;
        setpoints.by_ref().take_while(|s| s.letter.is_none() && above(s)).count()
    }
    let (rise, sink) = (length(setpoints.iter()), length(setpoints.iter().rev()));
    let n = setpoints.len();
    move |row| row + 1 < rise || row + sink >= n
}

/// The camera, and what the scene puts into the room of a plan.
fn things<'a>(shoot: &'a Shoot, plan: &Plan, profile: &Profile) -> Vec<Thing<'a>> {
    let scene = &shoot.scene;
    let mut things = Vec::new();
    if let Ok(camera) = scene.camera.camera(bounds_m(shoot), 0.0) {
        let shape = Shape::Pillar([camera.position_m.x, camera.position_m.y], TRIPOD_M);
        let advice = "stand the camera farther off ({camera.framing})";
        things.push(("the camera on its tripod".to_owned(), shape, advice));
    }
    things.extend(beacons(scene, profile));
    let mark_m = plan.setpoints.first().map_or(Vector3::zeros(), |first| first.position_m);
    let stand_m = scene.floor.height_m(mark_m.x, mark_m.y);
    things.extend(scene.floor.steps.iter().enumerate().map(|(number, step)| {
        let is_stand = step.height_m == stand_m;
        let shape = if is_stand { Shape::Stand(step) } else { Shape::Step(step) };
        let advice = "move it out of the flight's way ({floor.steps}), or write smaller or higher \
                      ({letters.canvas_m}, {letters.baseline_m})";
        (format!("floor.steps[{number}]"), shape, advice)
    }));
    let lighthouse = &scene.sensors.lighthouse;
    for (key, planes) in [("mirrors_m", &lighthouse.mirrors_m), ("panes_m", &lighthouse.panes_m)] {
        things.extend(planes.iter().enumerate().filter_map(|(number, [point_m, normal])| {
            let normal = Vector3::from(*normal).try_normalize(0.0)?;
            let shape = Shape::Wall(Vector3::from(*point_m), normal);
            let advice = "fly in front of it ({sensors.lighthouse.mirrors_m})";
            (normal.z.abs() < LEVEL_COS)
                .then(|| (format!("sensors.lighthouse.{key}[{number}]"), shape, advice))
        }));
    }
    things
}

/// Base stations or anchors: in the lower half of the room they stand, above it they hang.
fn beacons<'a>(scene: &Scene, profile: &Profile) -> impl Iterator<Item = Thing<'a>> {
    let ceiling_m = profile.room_m.map_or(profile.volume_m[1][2], |room_m| room_m[2]);
    let (name, places_m) = stations(scene);
    places_m.into_iter().enumerate().map(move |(index, place_m)| {
        let [x, y, z] = place_m;
        let shape = match z < 0.5 * ceiling_m {
            true => Shape::Pillar([x, y], BEACON_M),
            false => Shape::Ball(place_m.into(), BEACON_M),
        };
        let advice = "put it elsewhere ({sensors.lighthouse.stations}, {sensors.uwb.anchors_m})";
        (format!("{name} {}", index + 1), shape, advice)
    })
}
