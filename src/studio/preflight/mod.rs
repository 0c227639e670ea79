//! Preflight: what speaks against a flight, before it is flown.
//!
//! Products in: a [`Shoot`], and the limits of a [`Profile`], within a room where its size is
//! known. Product out: a [`Row`] for each check of letters, plans, simulated flights, lamps, base
//! stations and picture: its numbers, its sentences, and advice as keys of the scene. Problems of
//! the picture are the shoot's own ([`crate::shoot::Problem`]), found where its light meets its
//! camera. Not checked: obstacles in the room.

use crate::scene::Scene;
use crate::shoot::{Shoot, ends};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_core::geometry::bounds;
use noctograph_flying::plan::{Approach, Plan, Style};
use noctograph_flying::sensors::coverage;
use noctograph_flying::vehicle::Downwash;
use noctograph_letters::Strokes;

mod checks;
mod flown;
mod letters;
mod memory;
mod picture;
mod placement;
mod plans;
mod profile;
mod row;
mod written;

pub use checks::{checks, platform};
pub(crate) use flown::MAX_SATURATED_S;
use flown::{Flown, check_flown};
use letters::check_letters;
pub use memory::LED_MEMORY;
use memory::{check_led_memory, check_memory};
pub use picture::PICTURE;
use picture::{Picture, check_picture, evener, painted};
pub use placement::{CAMERA_PLACE, CameraPlace, ShotPlan, canvas_within, frame_within, place};
use placement::{camera_place, outside_of};
use plans::{check_plan, check_separation};
pub use profile::Profile;
pub use row::{Checked, Row, Severity};
use row::{Peak, at, largest, stop_if, warn_if};
pub use written::check_written;

/// Distance between two places at which the view of the base stations is checked.
const COVERAGE_STEP_M: f64 = 0.1;

/// Error of a position that letters bear, in cap heights, and their cap height where there is no
/// word.
const MAX_ERROR_H: f64 = 0.05;
const CAP_HEIGHT_M: f64 = 0.5;

/// What speaks against flights, and where things stand in their room.
#[derive(Clone, Debug)]
pub struct Preflight {
    /// Every check that was made.
    pub findings: Vec<Checked>,
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
) -> Result<Preflight> {
    let mut findings = check_design(shoot, profile);
    findings.extend(numbered(shoot, None, check_wakes(shoot, &flown)));
    let picture = Picture::of(shoot, &flown);
    for (drone, flight) in flown.into_iter().enumerate().take(shoot.plans.len()) {
        let mut checks = vec![check_memory(shoot, drone), check_led_memory(shoot, drone)];
        match flight {
            Ok(flight) => {
                checks.extend(check_flight(shoot, drone, &flight, picture.as_ref(), profile)?);
            }
            Err(Error::Infeasible { what, .. }) => checks.push(lost(what)),
            Err(error) => return Err(error),
        }
        checks.push(check_coverage(&shoot.plans[drone].plan, &shoot.scene)?);
        findings.extend(numbered(shoot, Some(drone), checks));
    }
    let stands = room_of(shoot, profile)?;
    let nowhere = stands.iter().any(|row| row.severity != Severity::Fine);
    // No picture is taken from a place outside of the room.
    let shown = |row: &Row| !(nowhere && row.severity == Severity::Fine);
    let pictures = check_picture(shoot, picture.as_ref());
    findings.extend(numbered(shoot, None, pictures.into_iter().filter(shown)));
    findings.extend(numbered(shoot, None, stands));
    let lit = picture.as_ref().and_then(|picture| picture.lit.as_ref());
    let placement = match lit.filter(|_| profile.room_m.is_some()) {
        Some((trace, camera)) => place(shoot, trace, camera.shutter_close_s, profile)?,
        None => None,
    };
    Ok(Preflight { findings, placement })
}

/// A flight that does not reach its end.
fn lost(how: String) -> Row {
    let row = Row::of("flight", Severity::Stop, None);
    let advice = "see the message; tune the controller";
    Row { detail: how.clone(), ..row }.say(how, "a flight to its end", advice)
}

/// Of a room: what stands outside of it, and whether the camera has a place.
fn room_of(shoot: &Shoot, profile: &Profile) -> Result<Vec<Row>> {
    let Some(room_m) = profile.room_m else {
        let why = "no room is named";
        let wanted = "the room's size, its middle at x = y = 0";
        return Ok(vec![Row::unchecked("frame", why, wanted, "name the room: {expose.room_m}")]);
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
        let mut checks = check_flight(shoot, drone, flight, None, profile)?;
        checks.push(check_coverage(&planned.plan, &shoot.scene)?);
        findings.extend(numbered(shoot, Some(drone), checks));
    }
    Ok(findings)
}

/// The findings of one drone, or of all.
fn numbered(
    shoot: &Shoot,
    drone: Option<usize>,
    rows: impl IntoIterator<Item = Row>,
) -> impl Iterator<Item = Checked> {
    let drone = drone.filter(|_| shoot.plans.len() > 1).map(DroneIndex);
    rows.into_iter().map(move |row| Checked { drone, row })
}

/// Letters and plans.
fn check_design(shoot: &Shoot, profile: &Profile) -> Vec<Checked> {
    let letters = match &shoot.strokes {
        Some(strokes) => check_letters(strokes, &shoot.scene.plan.style),
        None => vec![Row::unchecked(
            "doubled stroke",
            "no word is named for the plans",
            "the word that the plans write",
            "name it: {word}",
        )],
    };
    let mut findings: Vec<Checked> = numbered(shoot, None, letters).collect();
    let is_even = matches!(shoot.scene.plan.style, Style::Even(_));
    let lamps = shoot.lamps();
    for (drone, design) in shoot.designs().iter().enumerate() {
        findings.extend(numbered(shoot, Some(drone), check_plan(design, &lamps, is_even, profile)));
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
) -> Result<Vec<Row>> {
    let scene = &shoot.scene;
    let ends = ends(scene, &shoot.plans[drone].plan, flight).unwrap_or_default();
    let trace = match picture.and_then(|picture| picture.light_of(drone)) {
        Some(trace) => trace,
        None => shoot.light_drone(drone, flight)?,
    };
    let trail = picture.and_then(|picture| Some((picture.camera(), picture.trail(drone)?)));
    let flown = Flown {
        flight,
        plan: &scene.plan,
        ends: &ends,
        painted: &painted(flight, &trace, scene),
        evenness_stops: trail.map(|(_, reading)| reading.evenness_stops()),
        evener: match trail {
            Some((Some(camera), now)) => evener(shoot, drone, flight, &trace, camera, now),
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
fn check_wakes(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Row> {
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
    // A drone is flown alone once, however many are above it: by the nearest of them.
    let mut wakes = shoot.wakes();
    wakes.sort_by(|([_, a], above_a), ([_, b], above_b)| {
        a.cmp(b).then(above_a.vertical_m.abs().total_cmp(&above_b.vertical_m.abs()))
    });
    wakes.dedup_by_key(|([_, lower], _)| *lower);
    let costs = wakes.into_iter().map(cost);
    let worst = costs.max_by(|(_, a), (_, b)| a.0.total_cmp(&b.0)).unwrap_or_default();
    let (place, (value, time_s)) = worst;
    let time_s = place.map(|_| time_s);
    let found = place.map_or("no drone is planned into another's wake".into(), |(lower, it)| {
        format!(
            "drone {lower} comes {:.2} m below and {:.2} m beside another at {:.1} s; off by up to \
             {value:.3} m{}",
            it.vertical_m.abs(),
            it.horizontal_m,
            it.time_s,
            at(time_s)
        )
    });
    Some(Peak { value, most, time_s }.row("wake", warn_if(value > most)).say(
        found,
        format!("off by up to {most} m, a twentieth of the letters"),
        "plan the drones together with {plan.drones}, or fly the lower drone first",
    ))
}

/// Cap height of a word's letters; `None` of a drawing.
fn cap_height_m(strokes: &Strokes) -> Option<f64> {
    let letter = strokes.font.as_ref().and(strokes.glyphs.first())?;
    Some(letter.cell.cap_height_m)
}

/// Whether two base stations see the box of the whole flight.
fn check_coverage(plan: &Plan, scene: &Scene) -> Result<Row> {
    let unchecked = |why| {
        let wanted = "base stations, and a flight for them to see";
        let advice = "name the stations: {sensors.lighthouse.stations}";
        Ok(Row::unchecked("coverage", why, wanted, advice))
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
    let seen_frac = coverage(&scene.sensors, bounds_m, 0.0, COVERAGE_STEP_M)?.seen_frac();
    let row = Row::of("coverage", stop_if(seen_frac < 1.0), seen_frac);
    Ok(Row { limit: 1.0, ..row }.say(
        format!("{:.1} % of the flight's box is seen by two base stations", 100.0 * seen_frac),
        "two Lighthouse stations see every place",
        "write smaller or lower ({letters.canvas_m}, {letters.baseline_m}), or move the stations \
         (see `coverage`)",
    ))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::scene::Preset;

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
        assert!(wake.found.starts_with("drone 2 comes 0.50 m below"), "{wake:?}");
        assert!(wake.value > Some(wake.limit), "{wake:?}");
        assert_eq!(wake.severity, Severity::Warning);

        let mut beside = upper.clone();
        beside.setpoints.iter_mut().for_each(|setpoint| setpoint.position_m.x += 0.3);
        let none = found(&scene, vec![beside, lower.clone()]).unwrap();
        assert_eq!((none.value, none.time_s), (Some(0.0), None), "{none:?}");
        scene.air.downwash = Downwash::None;
        assert_eq!(found(&scene, vec![upper, lower]), None, "without a model");
    }
}
