//! Preflight: what speaks against a flight, before it is flown.
//!
//! Products in: a [`Shoot`], and the limits of a [`Profile`], within a room where its size is
//! known. Product out: [`Finding`]s on letters, plans, simulated flights, lamps, base stations and
//! picture, each with its numbers, a sentence and advice as keys of the scene ([`Row`]). Problems
//! of the picture are the shoot's own ([`crate::shoot::Problem`]), found where its light meets its
//! camera. Not checked: obstacles in the room.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use crate::scene::Scene;
use crate::shoot::{Lighting, Problem, Recording, Shoot, ends, writing};
use noctograph_core::camera::Camera;
use noctograph_core::crazyflie::RING_TIMING_ENTRIES;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_core::geometry::bounds;
use noctograph_export::lights::timing_entries;
use noctograph_export::{Form, Length, memory};
use noctograph_flying::plan::{Approach, Plan};
use noctograph_flying::sensors::coverage;
use noctograph_flying::vehicle::Downwash;
use noctograph_letters::Strokes;
use noctograph_picture::expose::meter::{LampReading, meter};
use noctograph_picture::light::{Lamp, LightTrace};

mod checks;
mod finding;
mod flown;
mod letters;
mod placement;
mod plans;
mod profile;
mod row;
mod written;

pub use checks::{checks, platform};
use finding::largest;
pub use finding::{Finding, OutOfRoom, Peak, Severity};
pub(crate) use flown::MAX_SATURATED_S;
use flown::{Flown, check_flown};
use letters::check_letters;
pub use placement::{CameraPlace, ShotPlan, frame_within, place};
use placement::{camera_place, outside_of};
use plans::{check_plan, check_separation};
pub use profile::Profile;
pub use row::{Checked, Row};
pub use written::check_written;

/// Duration of the pieces over which light along the path is summed: 1 cm at 0.2 m/s. A piece as
/// long as the lamp's blur tells hot spots from trembling.
const PIECE_S: f64 = 0.05;

/// Distance between two places at which the view of the base stations is checked.
const COVERAGE_STEP_M: f64 = 0.1;

/// Error of a position that letters bear, in cap heights, and their cap height where there is no
/// word.
const MAX_ERROR_H: f64 = 0.05;
const CAP_HEIGHT_M: f64 = 0.5;

/// Checks letters, plans, simulated flights, light and base stations against a profile.
///
/// # Errors
///
/// Those of the stages, except that of an infeasible flight: it is a finding.
pub fn preflight(shoot: &Shoot, profile: &Profile) -> Result<Vec<Checked>> {
    of_flights(shoot, flown(shoot)?, profile)
}

/// Flies every plan, for [`of_flights`].
///
/// # Errors
///
/// As [`preflight`]; an infeasible flight's is in its place.
pub fn flown(shoot: &Shoot) -> Result<Vec<Result<Flight>>> {
    let n = shoot.plans.len();
    Ok(match shoot.in_step() {
        false => (0..n).map(|drone| shoot.fly_drone(drone, &mut |_| {})).collect(),
        true => match shoot.fly(&|_, _| {}) {
            Ok(flights) => flights.into_iter().map(Ok).collect(),
            Err(Error::Infeasible { what, hint }) => {
                let lost = |_| Err(Error::Infeasible { what: what.clone(), hint: hint.clone() });
                (0..n).map(lost).collect()
            }
            Err(error) => return Err(error),
        },
    })
}

/// The same of flights that were flown already.
///
/// # Errors
///
/// As [`preflight`].
pub fn of_flights(
    shoot: &Shoot,
    flown: Vec<Result<Flight>>,
    profile: &Profile,
) -> Result<Vec<Checked>> {
    let mut findings = check_design(shoot, profile);
    findings.extend(numbered(shoot, None, check_wakes(shoot, &flown)));
    let picture = Picture::of(shoot, &flown);
    for (drone, flight) in flown.into_iter().enumerate().take(shoot.plans.len()) {
        let mut found = vec![check_memory(shoot, drone), check_led_memory(shoot, drone)];
        match flight {
            Ok(flight) => {
                found.extend(check_flight(shoot, drone, &flight, picture.as_ref(), profile)?);
            }
            Err(Error::Infeasible { what, .. }) => found.push(Finding::Flight(what)),
            Err(error) => return Err(error),
        }
        found.push(check_coverage(&shoot.plans[drone].plan, &shoot.scene)?);
        findings.extend(numbered(shoot, Some(drone), found));
    }
    let stands = room_of(shoot, profile)?;
    let nowhere = stands.iter().any(|it| it.row(&shoot.scene.plan).severity != Severity::Fine);
    let picture = check_picture(shoot, picture);
    // No picture is taken from a place outside of the room.
    let shown = |finding: &Finding| !(nowhere && matches!(finding, Finding::Picture(None)));
    findings.extend(numbered(shoot, None, picture.into_iter().filter(shown)));
    findings.extend(numbered(shoot, None, stands));
    Ok(findings)
}

/// Of a room: what stands outside of it, and whether the camera has a place.
fn room_of(shoot: &Shoot, profile: &Profile) -> Result<Vec<Finding>> {
    let Some(room_m) = profile.room_m else {
        let why = "no room is named";
        let wanted = "the room's size, its middle at x = y = 0";
        return Ok(vec![Finding::unchecked(
            "frame",
            why,
            wanted,
            "name the room: {expose.room_m}",
        )]);
    };
    let camera = camera_place(shoot, room_m)?;
    Ok([Some(outside_of(shoot, room_m)), camera].into_iter().flatten().collect())
}

/// What speaks against a real flight, of flights that were flown already: the checks that can
/// stop one, without memory and picture.
///
/// # Errors
///
/// As [`preflight`].
pub fn inspect(shoot: &Shoot, flights: &[Flight], profile: &Profile) -> Result<Vec<Checked>> {
    let mut findings = check_design(shoot, profile);
    findings.extend(numbered(shoot, None, profile.room_m.map(|room_m| outside_of(shoot, room_m))));
    for (drone, (planned, flight)) in shoot.plans.iter().zip(flights).enumerate() {
        let mut found = check_flight(shoot, drone, flight, None, profile)?.to_vec();
        found.push(check_coverage(&planned.plan, &shoot.scene)?);
        findings.extend(numbered(shoot, Some(drone), found));
    }
    Ok(findings)
}

/// The findings of one drone, or of all.
fn numbered(
    shoot: &Shoot,
    drone: Option<usize>,
    findings: impl IntoIterator<Item = Finding>,
) -> impl Iterator<Item = Checked> {
    let drone = drone.filter(|_| shoot.plans.len() > 1).map(DroneIndex);
    let checked =
        move |finding: Finding| Checked { drone, row: finding.row(&shoot.scene.plan), finding };
    findings.into_iter().map(checked)
}

/// Letters and plans.
fn check_design(shoot: &Shoot, profile: &Profile) -> Vec<Checked> {
    let letters = match &shoot.strokes {
        Some(strokes) => check_letters(strokes, &shoot.scene.plan.style),
        None => vec![Finding::unchecked(
            "doubled stroke",
            "no word is named for the plans",
            "the word that the plans write",
            "name it: {word}",
        )],
    };
    let mut findings: Vec<Checked> = numbered(shoot, None, letters).collect();
    for (drone, design) in shoot.designs().iter().enumerate() {
        findings.extend(numbered(shoot, Some(drone), check_plan(design, profile)));
    }
    // Drones with trajectories on board wait for their turn in the air.
    let flown: Vec<Plan> = shoot.plans.iter().map(|planned| planned.plan.clone()).collect();
    findings.extend(numbered(shoot, None, check_separation(&flown)));
    findings
}

fn check_flight(
    shoot: &Shoot,
    drone: usize,
    flight: &Flight,
    picture: Option<&Picture>,
    profile: &Profile,
) -> Result<[Finding; 8]> {
    let scene = &shoot.scene;
    let ends = ends(scene, &shoot.plans[drone].plan, flight).unwrap_or_default();
    let trace = shoot.light_drone(drone, flight)?;
    let trail = picture.and_then(|picture| Some((&picture.camera, picture.trail(drone)?)));
    let flown = Flown {
        flight,
        ends: &ends,
        painted: &painted(flight, &trace, scene),
        evenness_stops: trail.map(|(_, reading)| reading.evenness_stops()),
        evener: match trail {
            Some((Some(camera), now)) => evener(shoot, drone, flight, camera, now)?,
            _ => None,
        },
        cap_height_m: shoot.strokes.as_ref().and_then(cap_height_m),
        is_drawing: shoot.strokes.as_ref().is_some_and(|strokes| strokes.font.is_none()),
        motor_max: scene.vehicle.motor_max,
        battery: &scene.battery,
        low_battery_v: platform(scene)
            .map_or(scene.battery.cut_off_v, |platform| platform.low_battery_v()),
    };
    Ok(check_flown(&flown, profile))
}

/// What the wakes of other drones cost, where plans lead into them; `None` for a single drone.
fn check_wakes(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Finding> {
    if shoot.plans.len() < 2 || shoot.scene.air.downwash == Downwash::None {
        return None;
    }
    let most = MAX_ERROR_H * shoot.strokes.as_ref().and_then(cap_height_m).unwrap_or(CAP_HEIGHT_M);
    let cost = |([_, lower], nearest): ([usize; 2], Approach)| {
        let alone = shoot.fly_drone(lower, &mut |_| {});
        let apart = match (&alone, &flown[lower]) {
            (Ok(alone), Ok(flown)) => {
                largest(alone.samples.iter().zip(&flown.samples).map(|(alone, flown)| {
                    ((alone.position_m - flown.position_m).norm(), flown.time_s)
                }))
            }
            // How it is lost is a finding of its own.
            _ => (f64::INFINITY, nearest.time_s),
        };
        (Some((lower + 1, nearest)), apart)
    };
    let costs = shoot.wakes().into_iter().map(cost);
    let worst = costs.max_by(|(_, a), (_, b)| a.0.total_cmp(&b.0)).unwrap_or_default();
    let (place, (value, time_s)) = worst;
    Some(Finding::Wake(place, Peak { value, most, time_s: place.map(|_| time_s) }))
}

/// What only a preview would show: the word in the picture, while the shutter is open, lit.
fn check_picture(shoot: &Shoot, picture: Option<Picture>) -> Vec<Finding> {
    let unchecked = |why| {
        let advice = "mend what stops the flight; plan a word";
        vec![Finding::unchecked("picture", why, "flights that end, and letters", advice)]
    };
    let Some(picture) = picture else { return unchecked("not every drone ends its flight") };
    let mut setpoints = shoot.plans.iter().flat_map(|planned| &planned.plan.setpoints);
    if shoot.strokes.is_none() && !setpoints.any(|setpoint| setpoint.letter.is_some()) {
        return unchecked("the plans write no letter");
    }
    match picture.problems.is_empty() {
        true => vec![Finding::Picture(None)],
        false => picture.problems.into_iter().map(|it| Finding::Picture(Some(it))).collect(),
    }
}

/// A check of a plan that the export refuses.
fn not_exported(check: &'static str, error: &Error) -> Finding {
    let wanted = "a plan that can be exported";
    Finding::unchecked(check, error, wanted, "change what the export refuses")
}

/// Whether the plan fits the memory on board as either trajectory and the radio as setpoints.
fn check_memory(shoot: &Shoot, drone: usize) -> Finding {
    match memory(&shoot.designs()[drone]) {
        Ok(memory) => Finding::Memory(memory),
        Err(error) => not_exported("memory", &error),
    }
}

/// Whether the LED timing memory plays the lights of the plan, where a ring alone writes: as they
/// are timed on the exported trajectory.
fn check_led_memory(shoot: &Shoot, drone: usize) -> Finding {
    let form = Form::Compressed;
    let flown = || match shoot.designs.is_empty() {
        true => shoot.as_exported(form, form.tolerance_m(), Length::Any),
        false => Ok(shoot.clone()),
    };
    let entries = || timing_entries(&flown()?.plans[drone].plan, &shoot.scene.light);
    let used = shoot.plans[drone].plan.lamps().map(|(lamp, _)| lamp).eq(["ring"]);
    match if used { entries() } else { Ok(None) } {
        Ok(entries) => Finding::LedMemory { entries, most: RING_TIMING_ENTRIES },
        Err(error) => not_exported("LED memory", &error),
    }
}

/// Lamps and camera of flights; `None` where one of them fails.
fn lighting(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Result<Lighting>> {
    let flights = flown.iter().map(|flight| flight.as_ref().ok().cloned());
    let recordings = flights.map(|f| f.map(Recording::Flight)).collect::<Option<Vec<_>>>()?;
    Some(Shoot { recordings, ..shoot.clone() }.lighting(&|_, _| {}))
}

/// Where things stand in the profile's room, for flights; `None` without a room or a picture.
///
/// # Errors
///
/// As [`place`].
pub fn placement(
    shoot: &Shoot,
    flown: &[Result<Flight>],
    profile: &Profile,
) -> Result<Option<ShotPlan>> {
    match lighting(shoot, flown).filter(|_| profile.room_m.is_some()) {
        Some(Ok(Lighting { trace, camera, .. })) => {
            place(shoot, &trace, camera.shutter_close_s, profile)
        }
        _ => Ok(None),
    }
}

/// What the light of all drones leaves in the picture.
struct Picture {
    /// `None` where there is no picture.
    camera: Option<Camera>,
    /// Of the lamps that write.
    readings: Vec<LampReading>,
    problems: Vec<Problem>,
}

impl Picture {
    /// The picture of flights; `None` where one of them fails.
    fn of(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Self> {
        Some(match lighting(shoot, flown)? {
            Ok(Lighting { trace, camera, writing, problems, .. }) => {
                let mut readings = meter(&trace, &camera).unwrap_or_default();
                readings.retain(|reading| writing.contains(&reading.name));
                Self { camera: Some(camera), readings, problems }
            }
            Err(error) => {
                let problems = vec![Problem::NoPicture(error.to_string())];
                Self { camera: None, readings: Vec::new(), problems }
            }
        })
    }

    /// The brightest trail of a drone's lamps.
    fn trail(&self, drone: usize) -> Option<&LampReading> {
        let own =
            self.readings.iter().filter(|reading| reading.drone.is_none_or(|of| of.0 == drone));
        brightest(own)
    }
}

fn brightest<'a>(readings: impl Iterator<Item = &'a LampReading>) -> Option<&'a LampReading> {
    readings.max_by(|a, b| a.median_stops.total_cmp(&b.median_stops))
}

/// Headings that are tried, in a turn.
const HEADINGS: u32 = 24;
/// Stops by which another heading is worth a turn of the nose.
const WORTH_STOPS: f64 = 0.5;

/// The heading at which the exposure along a flight's brightest trail varies least, rad, and by how
/// much, stops, where that is worth a turn and the trail is as bright and as long as now: the same
/// flight, lit with its nose turned.
fn evener(
    shoot: &Shoot,
    drone: usize,
    flight: &Flight,
    camera: &Camera,
    now: &LampReading,
) -> Result<Option<[f64; 2]>> {
    let mut best = None;
    for step in 0..HEADINGS {
        let yaw_rad = TAU * f64::from(step) / f64::from(HEADINGS) - PI;
        let mut turned = flight.clone();
        let turn_rad = yaw_rad - shoot.plans[drone].plan.yaw_rad;
        turned.samples.iter_mut().for_each(|sample| sample.attitude.yaw_rad += turn_rad);
        let trace = shoot.light_drone(drone, &turned)?;
        let lamps = writing(std::slice::from_ref(&turned), &trace, &shoot.scene.light);
        let trace = LightTrace { lamps: lamps.into_iter().cloned().collect() };
        let readings = meter(&trace, camera).unwrap_or_default();
        let Some(found) = brightest(readings.iter()) else { continue };
        let least = best.map_or(now.evenness_stops() - WORTH_STOPS, |[_, stops]: [f64; 2]| stops);
        let whole = found.median_stops >= now.median_stops && found.lit_s >= 0.99 * now.lit_s;
        if whole && found.evenness_stops() < least {
            best = Some([yaw_rad, found.evenness_stops()]);
        }
    }
    Ok(best)
}

/// Cap height of a word's letters; `None` of a drawing.
fn cap_height_m(strokes: &Strokes) -> Option<f64> {
    let letter = strokes.font.as_ref().and(strokes.glyphs.first())?;
    Some(letter.cell.cap_height_m)
}

/// Light of the first lamp that follows the plan, in pieces along its path: start time, length and
/// seconds of full light.
fn painted(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<(f64, f64, f64)> {
    let writing = writing(std::slice::from_ref(flight), trace, &scene.light);
    let name = writing.first().map(|lamp| &lamp.emitter.name);
    // A lamp that changes its color is several emitters.
    let emitters = writing.iter().filter(|lamp| Some(&lamp.emitter.name) == name);
    let mut pieces: Vec<(f64, f64, f64)> = emitters.flat_map(|lamp| pieces_of(lamp)).collect();
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    pieces
}

/// The same of one emitter, whose highest level counts as full light: the dies of a color LED are
/// balanced by their levels.
fn pieces_of(lamp: &Lamp) -> Vec<(f64, f64, f64)> {
    let full = lamp.samples.iter().map(|sample| sample.level).fold(0.0, f64::max);
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    let mut from: Option<(f64, Vector3<f64>)> = None;
    let mut light_s = 0.0;
    for pair in lamp.samples.windows(2) {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let lit = 0.5 * (pair[0].level + pair[1].level) / full.max(f64::MIN_POSITIVE);
        if lit <= 0.0 {
            (from, light_s) = (None, 0.0);
            continue;
        }
        let (start_s, start_m) = *from.get_or_insert((pair[0].time_s, pair[0].position_m));
        light_s += lit * lasts_s;
        if pair[1].time_s - start_s >= PIECE_S {
            pieces.push((start_s, (pair[1].position_m - start_m).xz().norm(), light_s));
            (from, light_s) = (None, 0.0);
        }
    }
    pieces
}

/// Whether two base stations see the box of the whole flight.
fn check_coverage(plan: &Plan, scene: &Scene) -> Result<Finding> {
    let unchecked = |why| {
        let wanted = "base stations, and a flight for them to see";
        let advice = "name the stations: {sensors.lighthouse.stations}";
        Ok(Finding::unchecked("coverage", why, wanted, advice))
    };
    if scene.sensors.lighthouse.stations.is_empty() {
        return unchecked("the scene has no base stations");
    }
    let in_the_air = plan.setpoints.iter().filter(|setpoint| !setpoint.on_floor());
    let places = in_the_air.map(|setpoint| setpoint.position_m);
    let bounds_m = bounds(places.map(|p| [p.x, p.z]));
    if bounds_m[0] >= bounds_m[2] || bounds_m[1] >= bounds_m[3] {
        return unchecked("the flight has no width or no height");
    }
    Ok(Finding::Coverage(coverage(&scene.sensors, bounds_m, 0.0, COVERAGE_STEP_M)?.seen_frac()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Preset;

    #[test]
    fn the_heading_at_which_a_wide_word_is_even_is_named_with_what_it_brings() {
        let mut scene = Scene { word: "IIIIIIII".to_owned(), ..Scene::preset(Preset::Cf21) };
        let evenness = |scene: &Scene| {
            let shoot = Shoot::new(scene.clone()).unwrap();
            let found = preflight(&shoot, &Profile::indoor()).unwrap();
            let even = |checked: &Checked| match checked.finding {
                Finding::Evenness(peak, evener) => Some((peak.value, evener)),
                _ => None,
            };
            found.iter().find_map(even).unwrap()
        };
        let (now_stops, evener) = evenness(&scene);
        let [yaw_rad, stops] = evener.expect("headlights along the word");
        assert!(stops < now_stops - 1.0, "{now_stops}, {stops}");
        scene.plan.yaw_rad = yaw_rad;
        let (then_stops, evener) = evenness(&scene);
        assert!((then_stops - stops).abs() < 0.2 && evener.is_none(), "{then_stops}, {evener:?}");
    }

    #[test]
    fn a_drone_that_is_planned_through_a_wake_is_told_what_it_costs() {
        let mut scene = Scene { word: "O".to_owned(), ..Scene::preset(Preset::Cf21) };
        let lower = Shoot::new(scene.clone()).unwrap().plans.remove(0).plan;
        let mut upper = lower.clone();
        for setpoint in upper.setpoints.iter_mut().filter(|setpoint| !setpoint.on_floor()) {
            // Across the word at its middle, and above it.
            setpoint.position_m += Vector3::new(0.05, 0.0, 0.5);
        }
        let found = |scene: &Scene, plans: Vec<Plan>| {
            let shoot = Shoot::with_plans(scene.clone(), plans).unwrap();
            check_wakes(
                &shoot,
                &shoot.fly(&|_, _| {}).unwrap().into_iter().map(Ok).collect::<Vec<_>>(),
            )
        };
        let wake = found(&scene, vec![upper.clone(), lower.clone()]).unwrap();
        let Finding::Wake(Some((2, nearest)), peak) = &wake else { panic!("{wake:?}") };
        assert!((nearest.vertical_m - 0.5).abs() < 1e-6 && peak.value > peak.most, "{wake:?}");
        assert_eq!(wake.row(&scene.plan).severity, Severity::Warning);

        let mut beside = upper.clone();
        beside.setpoints.iter_mut().for_each(|setpoint| setpoint.position_m.x += 0.3);
        let none = found(&scene, vec![beside, lower.clone()]).unwrap();
        assert!(matches!(none, Finding::Wake(None, Peak { value: 0.0, .. })), "{none:?}");
        scene.air.downwash = Downwash::None;
        assert_eq!(found(&scene, vec![upper, lower]), None, "without a model");
    }
}
