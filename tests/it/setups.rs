//! Setups of a flight with the expected results of `check`. A dangerous setup causes a stop or a
//! warning in the row that concerns it, and an ordinary setup causes neither.

use serde_json::Value;

use crate::cli::{json, noctograph};

/// Arguments of a check and its expected result, which is `stop ROW`, `warn ROW`, `error` with a
/// part of its text, or nothing.
type Setup = (&'static str, &'static str);

/// Flights that come close to an object.
const OBSTACLES: &[Setup] = &[
    // The tables stand on the take-off mark, below and through the word, low below it, beside it,
    // and at its end.
    (
        r#"HI --room 4x6x2.5 --set floor.steps=[{x_m=[0.3,0.9],y_m=[-0.3,0.3],height_m=0.75}]"#,
        "error found a height of 0.5 m",
    ),
    (
        r#"HI --room 4x6x2.5 --set floor.steps=[{x_m=[0.3,0.9],y_m=[-0.3,0.3],height_m=0.4}]"#,
        "stop obstacles",
    ),
    (
        r#"HI --room 4x6x2.5 --set floor.steps=[{x_m=[-0.3,0.3],y_m=[-1,1],height_m=0.6}]"#,
        "error found a height of 0.6 m",
    ),
    (
        r#"HI --room 4x6x2.5 --set floor.steps=[{x_m=[-0.3,0.3],y_m=[-1,1],height_m=0.2}]"#,
        "stop obstacles",
    ),
    (
        r#"HI --room 4x6x2.5 --set floor.steps=[{x_m=[-2,2],y_m=[0.2,0.8],height_m=0.75}]"#,
        "stop obstacles",
    ),
    (
        r#"HI --room 4x6x2.5 --set floor.steps=[{x_m=[-1.2,-0.9],y_m=[-0.3,0.3],height_m=0.1}]"#,
        "stop obstacles",
    ),
    (
        r#"NO --drones 2 --room 4x6x2.5 --set floor.steps=[{x_m=[-0.9,-0.5],y_m=[-0.3,0.3],height_m=0.3}]"#,
        "stop obstacles",
    ),
    // The camera stands on the take-off mark, in front of and behind the word, beside the landing,
    // and below the word.
    ("I --room 4x6x2.5 --camera-at 0,0,0", "stop obstacles"),
    ("I --room 4x6x2.5 --camera-at 0,-0.3,1.15", "stop obstacles"),
    ("I --room 4x6x2.5 --camera-at 0,-0.4,0.3", "stop obstacles"),
    ("HI --room 4x6x2.5 --camera-at=-0.78,0.3,1.15", "stop obstacles"),
    ("HI --room 4x6x2.5 --camera-at=0.1,-0.1,0.05", "stop obstacles"),
    ("I --camera-at=0.1,-0.35,1 --set letters.canvas_m=[1,1]", "stop obstacles"),
    // The objects are a station on a stand, a station that hangs low, an anchor, a mirror across
    // the word, and a window.
    (
        r#"HI --room 4x6x2.5 --set sensors.lighthouse.stations=[{generation="v2",position_m=[0.2,0,1.1],yaw_rad=0,pitch_rad=0,roll_rad=0},{generation="v2",position_m=[2,2.5,2.4],yaw_rad=-2.4,pitch_rad=0.4,roll_rad=0}]"#,
        "stop obstacles",
    ),
    (
        r#"HI --room 4x6x2.5 --set sensors.lighthouse.stations=[{generation="v2",position_m=[-0.7,0.1,1.9],yaw_rad=0,pitch_rad=0,roll_rad=0},{generation="v2",position_m=[2,2.5,2.4],yaw_rad=-2.4,pitch_rad=0.4,roll_rad=0}]"#,
        "stop obstacles",
    ),
    (
        "HI --room 6x6x2.5 --set sensors.positioning=uwb-tdoa --set sensors.uwb.anchors_m=[[0,0.2,0.2],[-2.5,-2.5,2.4],[2.5,2.5,0.2],[2.5,-2.5,2.4],[-2.5,2.5,2.4],[2.5,2.5,2.4]]",
        "stop obstacles",
    ),
    ("HI --room 4x6x2.5 --set sensors.lighthouse.mirrors_m=[[[0,0,1],[1,0,0]]]", "stop obstacles"),
    ("HI --room 4x6x2.5 --set sensors.lighthouse.panes_m=[[[0,0.2,1],[0,-1,0]]]", "stop obstacles"),
];

/// Flights with people who stand too close.
const PEOPLE: &[Setup] = &[
    ("HI --room 4x6x2.5 --set sensors.lighthouse.people_m=[[0.58,0,0.25]]", "stop people"),
    ("NOOR --room 4x6x2.5 --set sensors.lighthouse.people_m=[[1.5,-1.04,0.25]]", "stop people"),
    (
        "HI --room 4x6x2.5 --set sensors.positioning=uwb-tdoa --set sensors.lighthouse.people_m=[[1.6,0.8,0.25]]",
        "stop people",
    ),
    (
        "HI --room 4x6x2.5 --set sensors.positioning=gnss --set sensors.lighthouse.people_m=[[1.6,0.8,0.25]]",
        "stop people",
    ),
    (
        "LOG --room 5x5x2.7 --scene ae483-2022 --set sensors.lighthouse.people_m=[[0,-1.2,0.25]]",
        "stop people",
    ),
    (
        "I --room 4x6x2.5 --profile careful --set plan.style.dark_speed_m_s=0.21 --set sensors.lighthouse.people_m=[[0.4,-1.1,0.25]]",
        "stop people",
    ),
];

/// Rooms whose size is probably in another unit.
const ROOMS: &[Setup] = &[
    ("HI --room 13x20x8", "error is this in feet, a room of 3.96x6.1x2.44 m"),
    ("HI --room 30x40x9", "error is this in feet"),
    ("HI --room 50x84x24", "error is this in feet"),
    ("HI --room 400x600x250", "error is this in centimeters"),
    ("HI --set expose.room_m=[13,20,8]", "warn room"),
    ("HI --room 15x28x7", "warn room"),
    ("HI --room 20x20x8m", "warn room"),
];

/// Unsuitable drones, flights or surroundings.
const UNFIT: &[Setup] = &[
    ("HI --room 4x6x2.5 --set letters.baseline_m=2.2", "stop volume"),
    ("HI --room 4x6x2.5 --set plan.stroke_speed_m_s=1.2", "stop speed"),
    ("HI --room 4x6x2.5 --set plan.style.acceleration_m_s2=6", "stop acceleration"),
    ("HI --room 4x6x2.5 --set vehicle.mass_kg=0.042", "warn thrust"),
    ("HI --room 4x6x2.5 --set battery.charge_frac=0.1", "stop battery"),
    ("HI --room 4x6x2.5 --set air.wind_m_s=[2,0,0]", "stop wind"),
    ("HI --room 4x6x2.5 --set observer.kind=truth", "stop estimator"),
    ("HI --room 4x6x2.5 --set sensors.lighthouse.silent=[[0,0,1000]]", "stop coverage"),
    ("I --room 4x6x2.5 --set sensors.lighthouse.silent=[[1,0,1000]]", "stop coverage"),
    ("HI --room 4x6x2.5 --set plan.yaw_rad=1.57", "stop picture"),
    ("HI --room 4x6x2.5 --camera-at=0,-9,1", "warn frame"),
    ("HI --profile outdoor", "warn sunlight"),
    ("HELLO --room 4x6x2.5 --set plan.stroke_speed_m_s=0.02", "stop flight time"),
    // A camera at this height sees the letters' bars from above, where the ring's light is hidden
    // along their whole length.
    (r#"TEA --room 4x6x2.5 --set plan.lights=["ring"] --camera-at 0,-2.5,2.2"#, "warn picture"),
];

/// Setups of an ordinary evening.
const ORDINARY: &[Setup] = &[
    ("I --room 4x6x2.5", ""),
    ("HI --room 4x6x2.5", ""),
    ("TEA --room 4x6x2.5", ""),
    ("NOOR --room 5x7x2.6", ""),
    ("LOG --room 5x5x2.7", ""),
    ("HI --room 3x4x2.4", ""),
    ("HI --room 2x2x2", ""),
    ("YES --room 12x20x6", ""),
    ("ART --room 10x15x4", ""),
    ("HI --room 13x20x8ft", ""),
    (r#"HI --room 4x6x2.5 --set plan.lights=["ring"]"#, ""),
    (r#"I --room 4x6x2.5 --set plan.lights=["ring"]"#, ""),
    ("HI --room 4x6x2.5 --set light.deck=color-led --color red", ""),
    ("HI --room 4x6x2.5 --set camera.body=galaxy-s24", ""),
    ("HI --room 4x6x2.5 --camera-at=0.3,-2.8,1.15", ""),
    ("HI --room 4x6x2.5 --profile careful", ""),
    ("NO --room 5x6x2.5 --drones 2", ""),
    ("HI --room 4x6x2.5 --scene cf-brushless", ""),
    ("HI --room 6x8x3 --set sensors.lighthouse.people_m=[[0,-3.6,0.25]]", ""),
    // The objects are a table at the wall, a stage below everything, and a window beside a glass
    // floor.
    ("HI --room 4x6x2.5 --set floor.steps=[{x_m=[1.3,2],y_m=[1,2.4],height_m=0.75}]", ""),
    ("HI --room 4x6x2.5 --set floor.steps=[{x_m=[-2,2],y_m=[-1,3],height_m=0.15}]", ""),
    (
        "HI --room 4x6x2.5 --set sensors.lighthouse.panes_m=[[[2,0,1],[-1,0,0]],[[0,0,0],[0,0,1]]]",
        "",
    ),
    ("HI --set camera.framing=fixed", ""),
    // This is the only ordinary setup with a warning, because the headlights' beams are visible in
    // such a small room.
    ("NO --room 3x3x2.5", "warn evenness"),
];

/// Returns the error of a check, or all of its rows that stop or warn.
fn said(setup: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let arguments: Vec<&str> = std::iter::once("check").chain(setup.split(' ')).collect();
    let output = noctograph(folder.path()).args(arguments).arg("--json").output().unwrap();
    let (code, warnings) = (output.status.code(), String::from_utf8(output.stderr).unwrap());
    if code == Some(2) {
        return vec![format!("error {warnings}")];
    }
    let report = json(&output.stdout);
    let severity = |row: &Value| match row["severity"].as_str().unwrap() {
        "stop" => Some("stop"),
        "warning" => Some("warn"),
        _ => None,
    };
    let rows = report["findings"].as_array().unwrap().iter();
    let rows =
        rows.filter_map(|row| Some(format!("{} {}", severity(row)?, row["check"].as_str()?)));
    let rows: Vec<String> = rows.collect();
    let stops = rows.iter().any(|row| row.starts_with("stop"));
    assert_eq!(code, Some(i32::from(stops)), "{setup}");
    rows.into_iter().chain((!warnings.is_empty()).then_some(warnings)).collect()
}

/// Returns the setups whose check differs from the expected result.
fn faults(setups: &[Setup]) -> Vec<String> {
    let unlike = |(setup, wanted): &Setup| {
        let said = said(setup);
        let text = wanted.strip_prefix("error ");
        let is_said = |said: &String| match text {
            Some(text) => said.starts_with("error") && said.contains(text),
            None => said == wanted,
        };
        let is_right = if wanted.is_empty() { said.is_empty() } else { said.iter().any(is_said) };
        (!is_right).then(|| format!("{setup}: wanted {wanted:?}, said {said:?}"))
    };
    setups.iter().filter_map(unlike).collect()
}

#[test]
fn what_a_flight_would_meet_stops() {
    assert_eq!(faults(OBSTACLES), [""; 0]);
}

#[test]
fn people_who_stand_too_near_stop() {
    assert_eq!(faults(PEOPLE), [""; 0]);
}

#[test]
fn people_beside_ultra_wideband_take_no_light_and_have_an_effect() {
    let folder = tempfile::tempdir().unwrap();
    let setup = "check HI --room 4x6x2.5 --set sensors.positioning=uwb-tdoa --set";
    let person = "sensors.lighthouse.people_m=[[1.6,0.8,0.25]]";
    let arguments: Vec<&str> = setup.split(' ').chain([person]).collect();
    let output = noctograph(folder.path()).args(arguments).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!((output.status.code(), output.stderr), (Some(1), Vec::new()), "{said}");
    assert!(!said.contains("the light (sensors"), "{said}");
}

#[test]
fn rooms_in_another_unit_are_asked_about() {
    assert_eq!(faults(ROOMS), [""; 0]);
}

#[test]
fn what_is_not_fit_stops_or_warns_by_its_row() {
    assert_eq!(faults(UNFIT), [""; 0]);
}

#[test]
fn what_is_ordinary_neither_stops_nor_warns() {
    assert_eq!(faults(ORDINARY), [""; 0]);
}
