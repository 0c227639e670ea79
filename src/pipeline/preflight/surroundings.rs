//! Checks a scene's drone and surroundings: base stations, estimator, weight and wind.

use nalgebra::Vector3;

use super::room::from_feet;
use super::{Profile, stop_if, warn_if};
use crate::scene::Scene;
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_core::geometry::bounds;
use noctograph_plan::Plan;
use noctograph_sim::EstimatorKind;
use noctograph_sim::sensors::{Positioning, coverage};
use noctograph_sim::vehicle::Gusts;

/// Grid spacing at which the view of the base stations is checked.
const COVERAGE_STEP_M: f64 = 0.1;

/// Checks that two base stations see the whole box of a plan in the plane of the word. The value is
/// the fraction that they see.
pub(super) fn check_coverage(plan: &Plan, scene: &Scene) -> Result<Diagnostic> {
    const WANTED: &str = "at least one base station, and a flight in the air";
    if !is_by_lighthouse(scene) {
        let unused = Diagnostic::check("coverage", Severity::Fine, None).within(1.0);
        return Ok(unused.say("not used, because the drone does not fly by Lighthouse", "", ""));
    }
    if scene.sensors.lighthouse.stations.is_empty() {
        let advice = "name the stations: {sensors.lighthouse.stations}";
        let why = "the scene has no base stations";
        return Ok(Diagnostic::unchecked("coverage", why, WANTED, advice));
    }
    let in_the_air = plan.setpoints.iter().filter(|setpoint| !setpoint.on_floor());
    let [left, bottom, right, top] = bounds(in_the_air.map(|s| [s.position_m.x, s.position_m.z]));
    if left > right {
        let why = "the plan never leaves the floor";
        return Ok(Diagnostic::unchecked("coverage", why, WANTED, "plan a flight"));
    }
    // The box around a straight path, such as an I, is widened by one grid step.
    let [wide_m, high_m] = [right - left, top - bottom]
        .map(|side_m| if side_m < COVERAGE_STEP_M { 0.5 * COVERAGE_STEP_M } else { 0.0 });
    let bounds_m = [left - wide_m, bottom - high_m, right + wide_m, top + high_m];
    let silent = silent_stations(plan, scene);
    let seen_frac = seen_frac(scene, &silent, bounds_m)?;
    let names: Vec<String> = silent.iter().map(|station| (station + 1).to_string()).collect();
    let without = if names.is_empty() {
        String::new()
    } else {
        format!(", without station {}, which is silent", names.join(", "))
    };
    let seen_percent = 100.0 * seen_frac;
    Ok(Diagnostic::check("coverage", stop_if(seen_frac < 1.0), seen_frac).within(1.0).say(
        format!("{seen_percent:.1} % of the flight's box is seen by two base stations{without}"),
        "two Lighthouse stations see every position",
        // Advice to remove a cause takes precedence over advice to write a smaller word.
        match (silent.is_empty(), scene.sensors.lighthouse.people_m.is_empty()) {
            (false, _) => "make sure that every station transmits ({sensors.lighthouse.silent})",
            (true, false) => "move people out of the light ({sensors.lighthouse.people_m})",
            (true, true) => {
                "write smaller or lower ({letters.canvas_m}, {letters.baseline_m}), or move the \
                 stations (see `coverage`)"
            }
        },
    ))
}

/// Returns the fraction, 0 to 1, of a box (left, bottom, right, top in m) that two base stations
/// see, without the stations in `silent`.
fn seen_frac(scene: &Scene, silent: &[usize], bounds_m: [f64; 4]) -> Result<f64> {
    let mut sensors = scene.sensors.clone();
    let stations = scene.sensors.lighthouse.stations.iter().enumerate();
    let heard = stations.filter(|(station, _)| !silent.contains(station));
    sensors.lighthouse.stations = heard.map(|(_, station)| station.clone()).collect();
    // The other stations count as always transmitting, because short outages are bridged.
    sensors.lighthouse.silent.clear();
    if sensors.lighthouse.stations.is_empty() {
        Ok(0.0)
    } else {
        Ok(coverage(&sensors, bounds_m, 0.0, COVERAGE_STEP_M)?.seen_frac())
    }
}

/// Maximum total outage of a station that the other one and the gyroscope bridge (an assumption).
const MAX_SILENT_S: f64 = 1.0;

/// Returns the indices of the stations that are silent for too long while a plan is in the air. The
/// time of overlapping outages counts twice, which errs on the side of safety.
fn silent_stations(plan: &Plan, scene: &Scene) -> Vec<usize> {
    let mut in_air = plan.setpoints.iter().filter(|setpoint| !setpoint.on_floor());
    let start_s = in_air.clone().next().map_or(0.0, |setpoint| setpoint.time_s);
    let end_s = in_air.next_back().map_or(0.0, |setpoint| setpoint.time_s);
    let lighthouse = &scene.sensors.lighthouse;
    let mut silent_s = vec![0.0; lighthouse.stations.len()];
    for (station, silent_s) in silent_s.iter_mut().enumerate() {
        let outages = lighthouse.silent.iter().filter(|[number, ..]| *number == station as f64);
        *silent_s =
            outages.map(|[_, from_s, to_s]| (to_s.min(end_s) - from_s.max(start_s)).max(0.0)).sum();
    }
    (0..silent_s.len()).filter(|station| silent_s[*station] > MAX_SILENT_S).collect()
}

/// Checks the drone and its surroundings. Returns only the checks that did not pass.
pub(super) fn check_surroundings(scene: &Scene, profile: &Profile) -> Vec<Diagnostic> {
    let rows = [
        estimator(scene),
        weight(scene, profile),
        wind(scene, profile),
        baseline(scene),
        sunlight(scene, profile),
        ceiling(profile),
    ];
    rows.into_iter().filter(|row| row.severity != Severity::Fine).collect()
}

/// Checks that the drone does not use its true state for control.
fn estimator(scene: &Scene) -> Diagnostic {
    let cheats = scene.observer.kind == EstimatorKind::Truth;
    Diagnostic::check("estimator", stop_if(cheats), None).say(
        "the simulated drone knows its true position",
        "an estimator that a real drone can have",
        "choose the estimator of the drone: {observer.kind=ekf}",
    )
}

/// Checks that the drone's mass in kg is within the profile's limit.
fn weight(scene: &Scene, profile: &Profile) -> Diagnostic {
    let (mass_kg, most_kg) = (scene.vehicle.mass_kg, profile.mass_kg);
    Diagnostic::check("weight", stop_if(mass_kg > most_kg), mass_kg).within(most_kg).say(
        format!("{:.0} g", 1e3 * mass_kg),
        format!("up to {:.0} g in the profile {}", 1e3 * most_kg, profile.name),
        "fly a lighter drone, or outdoors (--profile outdoor)",
    )
}

/// Checks the steady wind plus two standard deviations of gusts, in m/s. Light drones have a lower
/// limit.
fn wind(scene: &Scene, profile: &Profile) -> Diagnostic {
    let steady_m_s = Vector3::from(scene.air.wind_m_s).norm();
    let gusts_m_s = match &scene.air.gusts {
        Gusts::OrnsteinUhlenbeck(gusts) => 2.0 * Vector3::from(gusts.sigma_m_s).amax(),
        Gusts::None | Gusts::Dryden => 0.0,
    };
    let (wind_m_s, is_light) = (steady_m_s + gusts_m_s, scene.vehicle.mass_kg < LIGHT_KG);
    let most_m_s = if is_light { profile.wind_m_s.min(LIGHT_WIND_M_S) } else { profile.wind_m_s };
    Diagnostic::check("wind", stop_if(wind_m_s > most_m_s), wind_m_s).within(most_m_s).say(
        format!("up to {wind_m_s:.1} m/s of wind and gusts"),
        format!("up to {most_m_s} m/s for a drone of {:.0} g", 1e3 * scene.vehicle.mass_kg),
        "wait until the air is calmer ({air.wind_m_s}, {air.gusts})",
    )
}

/// Mass below which a drone counts as light, and the maximum wind for it (assumptions).
const LIGHT_KG: f64 = 0.1;
const LIGHT_WIND_M_S: f64 = 4.0;

/// Minimum distance between two base stations (an assumption). At 10 cm, their beams are so
/// nearly parallel that the depth error is 0.18 m, almost the full width of the corridor, 0.2 m.
const BASELINE_M: f64 = 1.0;

/// Checks the largest distance in m between any two base stations.
fn baseline(scene: &Scene) -> Diagnostic {
    let stations = &scene.sensors.lighthouse.stations;
    let positions_m = stations.iter().map(|station| Vector3::from(station.position_m));
    let distances_m =
        positions_m.clone().flat_map(|a| positions_m.clone().map(move |b| (a - b).norm()));
    let widest_m = distances_m.fold(0.0, f64::max);
    let is_near = is_by_lighthouse(scene) && stations.len() > 1 && widest_m < BASELINE_M;
    Diagnostic::check("baseline", warn_if(is_near), widest_m).within(BASELINE_M).say(
        format!("base stations are {widest_m:.2} m apart"),
        format!("{BASELINE_M} m or more between two stations"),
        "mount the stations in opposite corners of the room ({sensors.lighthouse.stations})",
    )
}

/// Checks that a drone does not rely on Lighthouse outdoors.
fn sunlight(scene: &Scene, profile: &Profile) -> Diagnostic {
    let is_blind = is_by_lighthouse(scene) && profile.is_outdoors;
    Diagnostic::check("sunlight", warn_if(is_blind), None).say(
        "an outdoor flight with Lighthouse, whose infrared receivers are blinded by sunlight",
        "darkness, or positioning that sunlight does not disturb",
        "fly after dusk, or with {sensors.positioning=uwb-twr}",
    )
}

/// Returns true if the drone's positioning system is Lighthouse.
fn is_by_lighthouse(scene: &Scene) -> bool {
    match scene.sensors.positioning {
        Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => true,
        Positioning::UwbTwr | Positioning::UwbTdoa | Positioning::Gnss => false,
    }
}

/// Ceiling height from which the size of a room may be in feet: few rooms are lower than 6.5 feet,
/// and few halls are higher than 6.5 m.
const FEET_FROM: f64 = 6.5;

/// Checks the height of the room in m, which reveals a room measured in feet.
fn ceiling(profile: &Profile) -> Diagnostic {
    let room_m = profile.room_m.unwrap_or_default();
    let height_m = room_m[2];
    Diagnostic::check("room", warn_if(height_m >= FEET_FROM), height_m).within(FEET_FROM).say(
        format!(
            "a ceiling at {height_m} m: if these are feet, the ceiling is at {} m",
            from_feet(room_m)
        ),
        "the room's true size in meters, because the fence follows its walls",
        "measure a wall, or give feet as in 13x20x8ft ({expose.room_m})",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preflight::preflight;
    use crate::scene::Preset;
    use crate::shoot::Shoot;

    #[test]
    fn ordinary_scenes_have_no_row_and_bad_ones_their_own() {
        let [indoor, _, outdoor] = Profile::all();
        let named = |set: &[(&str, &str)], profile: &Profile| {
            let scene = Scene::parse_with("", "scene", set).unwrap();
            let rows = check_surroundings(&scene, profile).into_iter();
            rows.map(|row| (row.code, row.severity)).collect::<Vec<_>>()
        };
        for preset in [Preset::Cf21, Preset::Cf21ThrustKit, Preset::CfBrushless] {
            assert_eq!(check_surroundings(&Scene::preset(preset), &indoor), [], "{preset:?}");
        }
        let stop = |check| [(check, Severity::Stop)];
        let sun = ("sunlight", Severity::Warning);
        assert_eq!(named(&[("observer.kind", "truth")], &indoor), stop("estimator"));
        assert_eq!(named(&[("preset", "bzzz")], &indoor)[0], stop("weight")[0]);
        assert!(named(&[("preset", "bzzz")], &outdoor).iter().all(|row| *row == sun));
        assert_eq!(named(&[("air.wind_m_s", "[3, 0, 0]")], &indoor), stop("wind"));
        let windy = named(&[("air.wind_m_s", "[0, 6, 0]")], &outdoor);
        assert_eq!(windy, [("wind", Severity::Stop), sun]);
        let mut near = Scene::preset(Preset::Cf21);
        let stations = &mut near.sensors.lighthouse.stations;
        let mut second = stations[0].clone();
        second.position_m[0] += 0.1;
        stations.splice(1.., [second]);
        let rows = check_surroundings(&near, &indoor);
        assert_eq!(rows[0].message, "base stations are 0.10 m apart");
    }

    #[test]
    fn people_and_silent_stations_stop_a_flight() {
        fn verdict(set: &[(&str, &str)], check: &str) -> Option<Severity> {
            let scene = Scene::parse_with("word = \"L\"", "scene", set).unwrap();
            let shot = Shoot::new(scene).unwrap().take(&|_, _| {}).unwrap();
            let rows = shot.findings(&Profile::indoor()).unwrap();
            let row = rows.into_iter().find(|row| row.code == check);
            row.map(|row| row.severity)
        }
        let silent = |span: &str| verdict(&[("sensors.lighthouse.silent", span)], "coverage");
        assert_eq!(silent("[[0, 0, 1000]]"), Some(Severity::Stop));
        assert_eq!(silent("[[0, 5, 5.5]]"), Some(Severity::Fine));
        let person = |place: &str| verdict(&[("sensors.lighthouse.people_m", place)], "people");
        assert_eq!(person("[[0.5, -1.0, 0.25]]"), Some(Severity::Stop));
        assert_eq!(person("[[0.5, -4.0, 0.25]]"), Some(Severity::Fine));
        assert_eq!(person("[]"), None);
    }

    #[test]
    fn a_picture_without_its_word_stops() {
        fn picture(set: &[(&str, &str)]) -> (Severity, String) {
            let scene = Scene::parse_with("word = \"L\"", "scene", set).unwrap();
            let rows = preflight(&Shoot::new(scene).unwrap(), &Profile::indoor()).unwrap();
            let mut rows = rows.findings.into_iter().filter(|row| row.code == "picture");
            // Without a room, there is no row for a picture that passes.
            rows.next().map_or_else(Default::default, |row| (row.severity, row.message))
        }
        assert_eq!(picture(&[]).0, Severity::Fine);
        assert_eq!(picture(&[("plan.yaw_rad", "1.57")]).0, Severity::Stop);
        fn camera(place_m: &str, target_m: &str) -> (Severity, String) {
            let key = "camera.framing";
            let keys = [".position_m", ".target_m"].map(|end| key.to_owned() + end);
            let set = [(key, "fixed"), (&*keys[0], place_m), (&*keys[1], target_m)];
            picture(&set)
        }
        assert_eq!(camera("[0, -4, 0.9]", "[0, 0, 0.9]").0, Severity::Fine);
        let (severity, actual) = camera("[0, -4, 0.9]", "[0, -9, 0.9]");
        assert!(severity == Severity::Stop && actual.contains("no light of the word"), "{actual}");
        let (severity, actual) = camera("[0, 4, 0.9]", "[0, 0, 0.9]");
        assert!(severity == Severity::Stop && actual.contains("mirrored"), "{actual}");
    }
}
