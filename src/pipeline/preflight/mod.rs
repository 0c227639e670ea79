//! Preflight: checks of a flight before it is flown.
//!
//! Products in: a [`Shoot`], and the limits of a [`Profile`], within a room where its size is
//! known. Product out: a [`Diagnostic`] for each check of letters, plans, simulated flights, lamps,
//! base stations and picture: its figures, its sentences, and help as keys of the scene. Problems
//! of the picture are the shoot's own ([`crate::shoot::problems`]), found where its light meets its
//! camera. Not known: what no key of the scene names, such as doors.

use crate::scene::{Preset, Scene};
use crate::shoot::{Shoot, Shot};
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_export::safety::{Battery, Checks, Platform};
use noctograph_letters::Strokes;
use noctograph_plan::{Approach, Plan, Style};
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

pub use checked_export::{CheckedExport, ExportOptions, ExportedFiles, make_exportable};
pub use flown::MAX_SATURATED_S;
use flown::check_flight;
use letters::check_letters;
pub use memory::LED_MEMORY;
use memory::{check_led_memory, check_memory};
pub use obstacles::stations;
use obstacles::{Ways, check_obstacles, check_people};
pub use picture::PICTURE;
use picture::{Picture, check_picture};
pub use placement::{CAMERA_PLACE, CameraPlace, ShotPlan, canvas_within, frame_within};
use placement::{camera_place, outside_of, place};
pub use plans::check_written;
use plans::{check_plan, check_separation};
pub use profile::Profile;
pub use room::{fit_within, hang_stations, letters_within, parse_room};
use surroundings::{check_coverage, check_surroundings};

/// Error of a position that letters bear, in cap heights, and their cap height where there is no
/// word.
const MAX_ERROR_H: f64 = 0.05;
const CAP_HEIGHT_M: f64 = 0.5;

/// Findings of flights, and the placement of things in their room.
#[derive(Clone, Debug)]
pub struct Preflight {
    /// Every check that was made.
    pub findings: Vec<Diagnostic>,
    /// `None` without a room or a picture.
    pub placement: Option<ShotPlan>,
}

/// Checks letters, plans, simulated flights, light and base stations against a profile.
///
/// # Errors
///
/// Those of the stages, except that of an infeasible flight: it is a finding.
pub fn preflight(shoot: &Shoot, profile: &Profile) -> Result<Preflight> {
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
            Err(Error::Infeasible { what, hint, .. }) => {
                (0..n).map(|_| Err(Error::infeasible(what.clone(), hint.clone()))).collect()
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
) -> Result<Preflight> {
    let ways = Ways::new(shoot, flown.iter().flatten());
    let mut findings = check_design(shoot, profile, &ways);
    findings.extend(numbered(shoot, None, check_wakes(shoot, &flown)));
    let picture = Picture::new(shoot, &flown);
    for (drone, flight) in flown.into_iter().enumerate().take(shoot.plans.len()) {
        let mut checks = vec![check_memory(shoot, drone), check_led_memory(shoot, drone)];
        match flight {
            Ok(flight) => {
                checks.extend(check_flight(shoot, drone, &flight, picture.as_ref(), profile)?);
            }
            Err(Error::Infeasible { what, .. }) => {
                let row = Diagnostic::check("flight", Severity::Stop, None).detailed(what.as_str());
                let advice = "see the message; tune the controller";
                checks.push(row.say(what, "a flight to its end", advice));
            }
            Err(error) => return Err(error),
        }
        checks.push(check_coverage(&shoot.plans[drone].plan, &shoot.scene)?);
        findings.extend(numbered(shoot, Some(drone), checks));
    }
    let stands = room_of(shoot, profile)?;
    let nowhere = stands.iter().any(|row| row.severity != Severity::Fine);
    // No picture is taken from a place outside of the room.
    let shown = |row: &Diagnostic| !(nowhere && row.severity == Severity::Fine);
    let pictures = check_picture(shoot, picture.as_ref());
    findings.extend(numbered(shoot, None, pictures.into_iter().filter(shown)));
    findings.extend(numbered(shoot, None, stands));
    let lit = picture.as_ref().and_then(|picture| picture.lit.as_ref());
    let placement =
        lit.map(|(trace, camera)| place(shoot, trace, camera.shutter_close_s, profile, &ways));
    Ok(Preflight { findings, placement: placement.transpose()?.flatten() })
}

/// Findings of a room: things outside of it, and the place of the camera.
fn room_of(shoot: &Shoot, profile: &Profile) -> Result<Vec<Diagnostic>> {
    let Some(room_m) = profile.room_m else {
        let why = "no room is named";
        let wanted = "the room's size, its middle at x = y = 0";
        return Ok(vec![Diagnostic::unchecked(
            "frame",
            why,
            wanted,
            "name the room: {expose.room_m}",
        )]);
    };
    let camera = camera_place(shoot, room_m)?;
    Ok([Some(outside_of(shoot, room_m)), camera].into_iter().flatten().collect())
}

impl Shot {
    /// Findings of its flights by the checks that can stop one, without memory and picture.
    ///
    /// # Errors
    ///
    /// As [`preflight`].
    pub fn findings(&self, profile: &Profile) -> Result<Vec<Diagnostic>> {
        let shoot = &self.shoot;
        let mut findings = check_design(shoot, profile, &Ways::new(shoot, &self.flights));
        let outside = profile.room_m.map(|room_m| outside_of(shoot, room_m));
        findings.extend(numbered(shoot, None, outside));
        for (drone, (planned, flight)) in shoot.plans.iter().zip(&self.flights).enumerate() {
            let mut checks = check_flight(shoot, drone, flight, None, profile)?;
            checks.push(check_coverage(&planned.plan, &shoot.scene)?);
            findings.extend(numbered(shoot, Some(drone), checks));
        }
        Ok(findings)
    }

    /// Every check of its flights.
    ///
    /// # Errors
    ///
    /// As [`preflight`].
    pub fn preflight(&self, profile: &Profile) -> Result<Preflight> {
        of_flights(&self.shoot, self.flights.iter().cloned().map(Ok).collect(), profile)
    }

    /// Where everything stands in the room; `None` without a room or without strokes.
    ///
    /// # Errors
    ///
    /// As [`preflight`].
    pub fn placement(&self, profile: &Profile) -> Result<Option<ShotPlan>> {
        let ways = Ways::new(&self.shoot, &self.flights);
        place(&self.shoot, &self.trace, self.camera.shutter_close_s, profile, &ways)
    }
}

/// The findings of one drone, or of all.
fn numbered(
    shoot: &Shoot,
    drone: Option<usize>,
    rows: impl IntoIterator<Item = Diagnostic>,
) -> impl Iterator<Item = Diagnostic> {
    let drone = drone.filter(|_| shoot.plans.len() > 1).map(DroneIndex);
    rows.into_iter().map(move |row| row.of_drone(drone))
}

/// Letters and plans, and what their ways come near to.
fn check_design(shoot: &Shoot, profile: &Profile, ways: &Ways) -> Vec<Diagnostic> {
    let letters = match &shoot.strokes {
        Some(strokes) => check_letters(strokes, &shoot.scene.plan.style),
        None => vec![Diagnostic::unchecked(
            "doubled stroke",
            "no word is named for the plans",
            "the word that the plans write",
            "name it: {word}",
        )],
    };
    let mut findings: Vec<Diagnostic> = numbered(shoot, None, letters).collect();
    let is_even = matches!(shoot.scene.plan.style, Style::Even(_));
    let lamps = shoot.lamps();
    for (drone, design) in shoot.designs().iter().enumerate() {
        let checks = check_plan(design, &lamps, is_even, profile);
        findings.extend(numbered(shoot, Some(drone), checks));
    }
    // Drones with trajectories on board wait for their turn in the air.
    let flown: Vec<Plan> = shoot.plans.iter().map(|planned| planned.plan.clone()).collect();
    findings.extend(numbered(shoot, None, check_separation(&flown)));
    findings.extend(numbered(shoot, None, check_people(shoot, ways)));
    findings.extend(numbered(shoot, None, [check_obstacles(shoot, profile)]));
    findings.extend(numbered(shoot, None, check_surroundings(&shoot.scene, profile)));
    findings
}

/// The largest of some values, with its time; zeros where there are none.
fn largest(values: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    values.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

/// A time in a sentence.
fn at_time(time_s: impl Into<Option<f64>>) -> String {
    time_s.into().map_or(String::new(), |time_s| format!(" at {time_s:.1} s"))
}

fn warn_if(bad: bool) -> Severity {
    if bad { Severity::Warning } else { Severity::Fine }
}

fn stop_if(bad: bool) -> Severity {
    if bad { Severity::Stop } else { Severity::Fine }
}

/// Position error by the wakes of other drones; `None` for a single drone.
fn check_wakes(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Diagnostic> {
    if shoot.plans.len() < 2 || shoot.scene.air.downwash == Downwash::None {
        return None;
    }
    let most_m =
        MAX_ERROR_H * shoot.strokes.as_ref().and_then(cap_height_m).unwrap_or(CAP_HEIGHT_M);
    // A drone is flown alone once, however many are above it: by the nearest of them.
    let mut wakes = shoot.wakes();
    wakes.sort_by(|([_, a], above_a), ([_, b], above_b)| {
        a.cmp(b).then(above_a.vertical_m.abs().total_cmp(&above_b.vertical_m.abs()))
    });
    wakes.dedup_by_key(|([_, lower], _)| *lower);
    let costs = wakes.into_iter().map(|([_, lower], nearest)| {
        let off_m_and_time = match (shoot.fly_drone(lower, &mut |_| {}), &flown[lower]) {
            (Ok(alone), Ok(flown)) => {
                let both = alone.samples.iter().zip(&flown.samples);
                largest(both.map(|(a, b)| ((a.position_m - b.position_m).norm(), b.time_s)))
            }
            // How it is lost is a finding of its own.
            _ => (f64::INFINITY, nearest.time_s),
        };
        (off_m_and_time, lower + 1, nearest)
    });
    let worst = costs.max_by(|(a, ..), (b, ..)| a.0.total_cmp(&b.0));
    let off_m = worst.map_or(0.0, |((off_m, _), ..)| off_m);
    let row = Diagnostic::check("wake", warn_if(off_m > most_m), off_m).within(most_m);
    Some(row.timed(worst.map(|((_, time_s), ..)| time_s)).say(
        match worst {
            None => "no drone is planned into another's wake".to_owned(),
            Some(((_, time_s), lower, Approach { vertical_m, horizontal_m, time_s: near_s })) => {
                format!(
                    "drone {lower} comes {:.2} m below and {horizontal_m:.2} m beside another at \
                     {near_s:.1} s; off by up to {off_m:.3} m{}",
                    vertical_m.abs(),
                    at_time(time_s)
                )
            }
        },
        format!("off by up to {most_m} m, a twentieth of the letters"),
        "plan the drones together with {plan.drones}, or fly the lower drone first",
    ))
}

/// Cap height of a word's letters; `None` of a drawing.
fn cap_height_m(strokes: &Strokes) -> Option<f64> {
    let letter = strokes.font.as_ref().and(strokes.glyphs.first())?;
    Some(letter.cell.cap_height_m)
}

/// The firmware's name of the scene's drone; `None` for other makers' drones.
pub fn platform(scene: &Scene) -> Option<Platform> {
    match scene.preset {
        Preset::Cf21 | Preset::Cf21ThrustKit | Preset::Ae4832022 => Some(Platform::Crazyflie2),
        Preset::CfBrushless => Some(Platform::Brushless),
        Preset::Bzzz => None,
    }
}

/// The facts behind the checks of flights within a profile.
pub fn checks(shoot: &Shoot, flown: &[Result<Flight>], profile: &Profile) -> Checks {
    let (scene, platform) = (&shoot.scene, platform(&shoot.scene));
    let battery = |flight: &Result<Flight>| {
        let low_v = platform?.low_battery_v();
        Battery::new(&scene.battery, flight.as_ref().ok()?, low_v)
    };
    Checks {
        platform,
        positioning: scene.sensors.positioning,
        volume_m: profile.volume_m,
        room_m: profile.room_m,
        batteries: flown.iter().map(battery).collect(),
        scene_sha256: sha256(scene.portable().to_toml().as_bytes()),
        scene_toml: scene.to_portable_toml(),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_drone_that_is_planned_through_a_wake_is_told_what_it_costs() {
        let mut scene = Scene { word: "O".to_owned(), ..Scene::preset(Preset::Cf21) };
        let lower = Shoot::new(scene.clone()).unwrap().plans.remove(0).plan;
        let mut upper = lower.clone();
        upper.edit(|upper| {
            for setpoint in upper.setpoints.iter_mut().filter(|setpoint| !setpoint.on_floor()) {
                // Across the word at its middle, and above it.
                setpoint.position_m += Vector3::new(0.05, 0.0, 0.5);
            }
        });
        fn wake_of(scene: &Scene, plans: Vec<Plan>) -> Option<Diagnostic> {
            let shoot = Shoot::with_plans(scene.clone(), plans).unwrap();
            let flown = shoot.fly(&|_, _| {}).unwrap().into_iter().map(Ok);
            check_wakes(&shoot, &flown.collect::<Vec<_>>())
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
