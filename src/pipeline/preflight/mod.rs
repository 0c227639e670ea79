//! Preflight: checks a flight before takeoff.
//!
//! Products in: a [`Shoot`], and the limits of a [`Profile`], within a room if its size is known.
//! Product out: a [`Diagnostic`] for each check of letters, plans, simulated flights, lamps, base
//! stations and picture. Problems of the picture are those of [`crate::shoot::problems`]. Objects
//! that no key of the scene describes, such as doors, are not checked.

use crate::scene::{Preset, Scene};
use crate::shoot::{Recording, Shoot, Shot};
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_core::parallel::prelude::*;
use noctograph_export::safety::{Battery, Checks, Platform};
use noctograph_letters::Strokes;
use noctograph_plan::{Approach, Style};
use noctograph_sim::vehicle::Downwash;

mod checked_export;
mod flown;
mod letters;
mod memory;
mod obstacles;
mod picture;
mod placement;
mod plans;
mod profile;
mod room;
mod surroundings;

use checked_export::plans_of;
pub use checked_export::{CheckedExport, ExportOptions, ExportedFiles, make_exportable};
pub use flown::MAX_SATURATED_S;
use flown::check_flight;
use letters::check_letters;
pub use memory::LED_MEMORY;
use memory::{check_led_memory, check_memory};
pub use obstacles::stations;
use obstacles::{Paths, check_obstacles, check_people};
pub use picture::PICTURE;
use picture::{Picture, check_picture};
pub use placement::{CAMERA_PLACE, CameraPlace, ShotPlan, fit_within, frame_within};
use placement::{check_camera_place, check_frame, plan_shot};
use plans::{check_plan, check_separation};
pub use plans::{check_written, longer_than_battery};
pub use profile::Profile;
pub use room::{hang_stations, letters_within, parse_room};
use surroundings::{check_coverage, check_surroundings};

/// Maximum position error for readable letters, in cap heights.
const MAX_ERROR_H: f64 = 0.05;
/// Cap height that is assumed for plans without a word.
const CAP_HEIGHT_M: f64 = 0.5;

/// Standard gravity, m/s².
const GRAVITY_M_S2: f64 = 9.806_65;

/// Findings about flights, and the positions of objects in the room.
#[derive(Clone, Debug)]
pub struct Preflight {
    /// Results of all checks.
    pub findings: Vec<Diagnostic>,
    /// Positions in the room. `None` without a room or a picture.
    pub placement: Option<ShotPlan>,
}

/// Simulates flights, and checks letters, plans, flights, light and stations against a profile.
///
/// # Errors
///
/// Returns the errors of the stages. An infeasible flight is a finding instead.
pub fn preflight(shoot: &Shoot, profile: &Profile) -> Result<Preflight> {
    preflight_flights(shoot, fly_plans(shoot)?, profile)
}

/// Checks a shoot like [`preflight`], with the flight that was simulated while it was planned
/// ([`Shoot::flown`]).
///
/// # Errors
///
/// Returns the errors of [`preflight`].
pub fn preflight_flown(mut shoot: Shoot, profile: &Profile) -> Result<(Shoot, Preflight)> {
    let recordings = std::mem::take(&mut shoot.recordings).into_iter();
    let flights = recordings.filter_map(|recording| match recording {
        Recording::Flight(flight) => Some(Ok(flight)),
        Recording::Light(_) => None,
    });
    let flights: Vec<Result<Flight>> = flights.collect();
    let flights = if flights.is_empty() { fly_plans(&shoot)? } else { flights };
    let preflight = preflight_flights(&shoot, flights, profile)?;
    Ok((shoot, preflight))
}

/// Simulates the flights of all plans, for [`preflight_flights`].
///
/// # Errors
///
/// Returns the errors of [`preflight`]. An infeasible flight is an error within the list.
pub fn fly_plans(shoot: &Shoot) -> Result<Vec<Result<Flight>>> {
    let drones = 0..shoot.plans.len();
    if !shoot.is_one_simulation() {
        return Ok(drones.map(|drone| shoot.fly_drone(drone, &mut |_| {})).collect());
    }
    match shoot.fly(&|_, _| {}) {
        Ok(flights) => Ok(flights.into_iter().map(Ok).collect()),
        // Drones that affect each other are simulated together, and fail together.
        Err(Error::Infeasible { what, hint, .. }) => {
            Ok(drones.map(|_| Err(Error::infeasible(what.clone(), hint.clone()))).collect())
        }
        Err(error) => Err(error),
    }
}

/// Checks flights that have already been simulated, as [`preflight`] does. `flown` contains a
/// flight or the error for each drone. An infeasible flight becomes a finding, and other errors are
/// returned.
pub fn preflight_flights(
    shoot: &Shoot,
    flown: Vec<Result<Flight>>,
    profile: &Profile,
) -> Result<Preflight> {
    // First the design is checked: letters, plans, their distance from people and objects, and the
    // drones' memories. In parallel, the picture is computed, and each flight is checked in it.
    let paths = Paths::new(shoot, flown.iter().flatten());
    let ((picture, checked), (mut findings, memories)) = noctograph_core::parallel::join(
        || {
            let picture = Picture::new(shoot, &flown);
            let flights = flown.par_iter().enumerate();
            let checked = flights.map(|(drone, flight)| {
                let flight = flight.as_ref().ok();
                flight.map(|flight| check_flight(shoot, drone, flight, picture.as_ref(), profile))
            });
            let checked: Vec<_> = checked.collect();
            (picture, checked)
        },
        || {
            let mut findings = check_design(shoot, profile, &paths);
            findings.extend(check_downwash(shoot, &flown));
            let memories = (0..shoot.plans.len())
                .into_par_iter()
                .map(|drone| [check_memory(shoot, drone), check_led_memory(shoot, drone)]);
            (findings, memories.collect::<Vec<_>>())
        },
    );
    // The findings about each drone are on its memories, its flight and its view of the base
    // stations.
    let drones = flown.into_iter().zip(checked).zip(memories);
    for (drone, ((flight, checked), memories)) in drones.enumerate() {
        let mut checks = Vec::from(memories);
        checks.extend(checked.transpose()?.into_iter().flatten());
        match flight {
            Ok(_) => {}
            Err(Error::Infeasible { what, .. }) => {
                let row = Diagnostic::check("flight", Severity::Stop, None).detailed(what.as_str());
                let advice = "follow the message, or tune the controller";
                checks.push(row.say(what, "a flight that reaches its end", advice));
            }
            Err(error) => return Err(error),
        }
        checks.push(check_coverage(&shoot.plans[drone].plan, &shoot.scene)?);
        findings.extend(numbered(shoot, drone, checks));
    }
    // Finally the room is checked. A picture cannot pass if its camera would be outside the room.
    let in_room = check_room(shoot, profile)?;
    let is_inside = in_room.iter().all(|row| row.severity == Severity::Fine);
    let mut pictures = check_picture(shoot, picture.as_ref());
    pictures.retain(|row| is_inside || row.severity != Severity::Fine);
    findings.extend(pictures.into_iter().chain(in_room));
    let lit = picture.as_ref().and_then(|picture| picture.lit.as_ref());
    let placement =
        lit.map(|(trace, camera)| plan_shot(shoot, trace, camera.shutter_close_s, profile, &paths));
    Ok(Preflight { findings, placement: placement.transpose()?.flatten() })
}

/// Checks that objects are inside the profile's room, and that the room has space for the camera.
/// Without a room, the check is reported as not made.
fn check_room(shoot: &Shoot, profile: &Profile) -> Result<Vec<Diagnostic>> {
    let Some(room_m) = profile.room_m else {
        let wanted = "the room's size, with its middle at x = y = 0";
        let help = "name the room: {expose.room_m}";
        return Ok(vec![Diagnostic::unchecked("frame", "no room is named", wanted, help)]);
    };
    let camera = check_camera_place(shoot, room_m)?;
    Ok([Some(check_frame(shoot, room_m)), camera].into_iter().flatten().collect())
}

impl Shot {
    /// Performs the checks that can stop a flight, except those of memory and picture.
    pub fn findings(&self, profile: &Profile) -> Result<Vec<Diagnostic>> {
        let shoot = &self.shoot;
        let mut findings = check_design(shoot, profile, &Paths::new(shoot, &self.flights));
        findings.extend(profile.room_m.map(|room_m| check_frame(shoot, room_m)));
        for (drone, (planned, flight)) in shoot.plans.iter().zip(&self.flights).enumerate() {
            let mut checks = check_flight(shoot, drone, flight, None, profile)?;
            checks.push(check_coverage(&planned.plan, &shoot.scene)?);
            findings.extend(numbered(shoot, drone, checks));
        }
        Ok(findings)
    }

    /// Performs all checks of the flights. Returns the errors of [`preflight_flights`].
    pub fn preflight(&self, profile: &Profile) -> Result<Preflight> {
        preflight_flights(&self.shoot, self.flights.iter().cloned().map(Ok).collect(), profile)
    }

    /// Returns the positions of all objects in the room, or `None` without a room or strokes.
    pub fn placement(&self, profile: &Profile) -> Result<Option<ShotPlan>> {
        let paths = Paths::new(&self.shoot, &self.flights);
        plan_shot(&self.shoot, &self.trace, self.camera.shutter_close_s, profile, &paths)
    }
}

/// Returns findings of drone `drone`, counted from 0, with its number if there are several drones.
fn numbered(
    shoot: &Shoot,
    drone: usize,
    findings: Vec<Diagnostic>,
) -> impl Iterator<Item = Diagnostic> {
    let number = (shoot.plans.len() > 1).then_some(DroneIndex(drone));
    findings.into_iter().map(move |finding| finding.of_drone(number))
}

/// Checks letters and plans without a flight, and the distance of the paths from people and
/// objects.
fn check_design(shoot: &Shoot, profile: &Profile, paths: &Paths) -> Vec<Diagnostic> {
    let mut findings = match &shoot.strokes {
        Some(strokes) => check_letters(strokes, &shoot.scene.plan.style),
        None => vec![Diagnostic::unchecked(
            "doubled stroke",
            "no word is named for the plans",
            "the word that the plans write",
            "name it: {word}",
        )],
    };
    let is_even = matches!(shoot.scene.plan.style, Style::Even(_));
    let lamps = shoot.lamps();
    for (drone, design) in shoot.designs().iter().enumerate() {
        let checks = check_plan(design, &lamps, is_even, profile);
        findings.extend(numbered(shoot, drone, checks));
    }
    // Drones with onboard trajectories wait in the air for their turn, which only the plans show.
    findings.extend(check_separation(&plans_of(shoot)));
    findings.extend(check_people(shoot, paths));
    findings.push(check_obstacles(shoot, profile));
    findings.extend(check_surroundings(&shoot.scene, profile));
    findings
}

/// Returns the largest of several values and its time, or zeros if there are no values.
fn largest(values: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    values.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

/// Returns ` at 1.2 s`, which is appended to a value in a sentence, or an empty text for `None`.
fn at_time(time_s: impl Into<Option<f64>>) -> String {
    time_s.into().map_or(String::new(), |time_s| format!(" at {time_s:.1} s"))
}

/// Returns `Warning` if a limit is exceeded, and `Fine` otherwise.
fn warn_if(is_exceeded: bool) -> Severity {
    if is_exceeded { Severity::Warning } else { Severity::Fine }
}

/// Returns `Stop` if a limit is exceeded, and `Fine` otherwise.
fn stop_if(is_exceeded: bool) -> Severity {
    if is_exceeded { Severity::Stop } else { Severity::Fine }
}

/// A drone whose plan enters another drone's downwash.
struct LowerDrone {
    index: usize,
    /// Closest approach to the nearest drone above it.
    approach: Approach,
    /// Maximum position error due to the downwash, and the time at which it occurs.
    error_m: f64,
    time_s: f64,
}

/// Checks the position error in m due to other drones' downwash. Returns `None` for a single drone,
/// or without a downwash model.
fn check_downwash(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Diagnostic> {
    if shoot.plans.len() < 2 || shoot.scene.air.downwash == Downwash::None {
        return None;
    }
    let most_m =
        MAX_ERROR_H * shoot.strokes.as_ref().and_then(cap_height_m).unwrap_or(CAP_HEIGHT_M);
    let lower_drones = nearest_above_each_lower(shoot).into_iter().map(|(index, approach)| {
        // A failed flight has an infinite error.
        let error = downwash_error(shoot, index, &flown[index]);
        let (error_m, time_s) = error.unwrap_or((f64::INFINITY, approach.time_s));
        LowerDrone { index, approach, error_m, time_s }
    });
    let worst = lower_drones.max_by(|a, b| a.error_m.total_cmp(&b.error_m));
    let error_m = worst.as_ref().map_or(0.0, |lower| lower.error_m);
    let row = Diagnostic::check("wake", warn_if(error_m > most_m), error_m).within(most_m);
    Some(row.timed(worst.as_ref().map(|lower| lower.time_s)).say(
        match worst {
            None => "no drone is planned into another's downwash".to_owned(),
            Some(LowerDrone { index, approach, time_s, .. }) => format!(
                "drone {} comes {:.2} m below and {:.2} m beside another at {:.1} s; off by up to \
                 {error_m:.3} m{}",
                index + 1,
                approach.vertical_m,
                approach.horizontal_m,
                approach.time_s,
                at_time(time_s)
            ),
        },
        format!("off by up to {most_m} m, a twentieth of the letters' height"),
        "plan the drones together with {plan.drones}, or fly the lower drone first",
    ))
}

/// Returns the index, counted from 0, of each drone whose plan enters a downwash, with its closest
/// approach to the drone least far above it.
fn nearest_above_each_lower(shoot: &Shoot) -> Vec<(usize, Approach)> {
    let pairs = shoot.downwash_pairs().into_iter();
    let mut lower: Vec<_> = pairs.map(|([_, lower], approach)| (lower, approach)).collect();
    lower.sort_by(|(a, above_a), (b, above_b)| {
        a.cmp(b).then(above_a.vertical_m.total_cmp(&above_b.vertical_m))
    });
    lower.dedup_by_key(|(index, _)| *index);
    lower
}

/// Returns the maximum distance in m between a drone's flight below others and its flight without
/// them, and the time in s of the maximum. Returns `None` if a flight fails, which is a separate
/// finding.
fn downwash_error(shoot: &Shoot, drone: usize, flown: &Result<Flight>) -> Option<(f64, f64)> {
    let undisturbed = shoot.fly_drone(drone, &mut |_| {}).ok()?;
    let pairs = undisturbed.samples.iter().zip(&flown.as_ref().ok()?.samples);
    Some(largest(pairs.map(|(a, b)| ((a.position_m - b.position_m).norm(), b.time_s))))
}

/// Returns the cap height of a word, or `None` for a drawing.
fn cap_height_m(strokes: &Strokes) -> Option<f64> {
    let letter = strokes.font.as_ref().and(strokes.glyphs.first())?;
    Some(letter.cell.cap_height_m)
}

/// Returns the firmware platform of the scene's drone, or `None` for drones of other manufacturers.
pub fn platform(scene: &Scene) -> Option<Platform> {
    match scene.preset {
        Preset::Cf21 | Preset::Cf21ThrustKit | Preset::Ae4832022 => Some(Platform::Crazyflie2),
        Preset::CfBrushless => Some(Platform::Brushless),
        Preset::Bzzz => None,
    }
}

/// Returns the information about the checks that exported files contain: the limits of the profile,
/// the battery load of each flight, and the scene.
pub fn checks(shoot: &Shoot, flown: &[Result<Flight>], profile: &Profile) -> Checks {
    let (scene, platform) = (&shoot.scene, platform(&shoot.scene));
    let low_v = platform.map(|platform| platform.low_battery_v());
    let batteries = flown
        .iter()
        .map(|flight| Battery::new(&scene.battery, flight.as_ref().ok()?, low_v?))
        .collect();
    // The scene is copied to the script and its log, so it must not contain local paths.
    let portable = scene.portable();
    Checks {
        platform,
        positioning: scene.sensors.positioning,
        volume_m: profile.volume_m,
        room_m: profile.room_m,
        batteries,
        scene_sha256: sha256(portable.to_toml().as_bytes()),
        scene_toml: portable.to_table().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use noctograph_plan::Plan;

    #[test]
    fn a_drone_that_is_planned_into_a_downwash_has_its_error_measured() {
        let mut scene = Scene { word: "O".to_owned(), ..Scene::preset(Preset::Cf21) };
        let lower = Shoot::new(scene.clone()).unwrap().plans.remove(0).plan;
        let mut upper = lower.clone();
        upper.edit(|upper| {
            for setpoint in upper.setpoints.iter_mut().filter(|setpoint| !setpoint.on_floor()) {
                // The second drone flies above the word, slightly off its center.
                setpoint.position_m += Vector3::new(0.05, 0.0, 0.5);
            }
        });
        fn wake_of(scene: &Scene, plans: Vec<Plan>) -> Option<Diagnostic> {
            let shoot = Shoot::with_plans(scene.clone(), plans).unwrap();
            let flown = shoot.fly(&|_, _| {}).unwrap().into_iter().map(Ok);
            check_downwash(&shoot, &flown.collect::<Vec<_>>())
        }
        let wake = wake_of(&scene, vec![upper.clone(), lower.clone()]).unwrap();
        assert!(wake.message.starts_with("drone 2 comes 0.50 m below"), "{wake:?}");
        assert!(wake.number("value") > wake.number("limit"), "{wake:?}");
        assert_eq!(wake.severity, Severity::Warning);

        let mut beside = upper.clone();
        beside.edit(|beside| {
            beside.setpoints.iter_mut().for_each(|setpoint| setpoint.position_m.x += 0.3)
        });
        let none = wake_of(&scene, vec![beside, lower.clone()]).unwrap();
        assert_eq!((none.number("value"), none.number("time_s")), (Some(0.0), None), "{none:?}");
        scene.air.downwash = Downwash::None;
        assert_eq!(wake_of(&scene, vec![upper, lower]), None, "without a model");
    }
}
