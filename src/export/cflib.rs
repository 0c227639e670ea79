//! A Python script that flies a plan with cflib, switches its lights and records the flight.
//!
//! The script is `cflib.py`. The plan is inserted as JSON text in a string literal, so that no word
//! can become code. The script sends positions or full states (position, velocity and acceleration)
//! by radio, or starts a compressed trajectory on board.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::compressed::{Compressed, START_BYTES, YAW_BYTES};
use super::lights::{Command, commands, dark, preparation, timing};
use super::log_config::{BLOCKS, OBSERVER_BLOCKS, WATCH_BLOCKS, python};
use super::pieces::Stretch;
use super::safety::{self, OLDEST_CFLIB};
use super::timeline::{Timeline, zero_s};
use super::{Job, ascii, gains, stem, with_caution};
use noctograph_core::crazyflie::{Feature, RING_TIMING_ENTRIES, Release, SLOW_CLOCK};
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::bounds;
use noctograph_core::lamps::Channel;
use noctograph_core::settings::settings;
use noctograph_plan::Plan;
use noctograph_sim::sensors::Positioning;
use noctograph_sim::{ControllerKind, Law};

/// Template of the script. Its placeholders are `@DATA@` for the plan, `@LOG@`, `@OPTIONAL@` and
/// `@WATCH@` for the log variables, and `@CFLIB@` for the oldest supported cflib.
const SCRIPT: &str = include_str!("cflib.py");
/// Template of the launcher for several drones, with `@SCRIPTS@` for the names of their scripts.
const LAUNCHER: &str = include_str!("launcher.py");

/// Minimum time between two setpoints sent by radio, s.
const MIN_INTERVAL_S: f64 = 0.02;
/// Maximum distance at which one of two setpoints is redundant, m.
const SAME_M: f64 = 2e-5;
/// Duration of the flight after the last light command, s.
pub(super) const AFTERGLOW_S: f64 = 0.2;
/// Number of the Kalman filter in `stabilizer.estimator` (firmware `estimator.h`).
pub(super) const KALMAN_ESTIMATOR: u32 = 2;
/// Last byte of a drone's factory radio address.
const FACTORY_ADDRESS: usize = 0xE7;
/// Tolerance for rounded times, s.
const TIME_ROUNDING_S: f64 = 1e-6;

settings! {
    /// What a script sends while the drone writes.
    pub enum Mode {
        /// Positions, as in the plan.
        "position" => Position,
        /// Position, velocity and acceleration of the design.
        "full-state" => FullState,
        /// The command that starts a compressed trajectory on board.
        "trajectory" => Trajectory,
    }
}

/// Returns the script for the drone with index `drone`. `first_start_s` is the time, by the plans'
/// clock, at which the first of all drones starts its trajectory.
pub(super) fn script(job: &Job<'_>, drone: usize, first_start_s: f64) -> Result<String> {
    let data = script_data(job, drone, first_start_s)?;
    // JSON text encoded as a JSON string is also a valid Python string literal.
    let literal = serde_json::to_string(&ascii(&data)).expect("text is serializable");
    let script = SCRIPT.replace("@LOG@", &python(&BLOCKS));
    let script = script.replace("@OPTIONAL@", &python(&OBSERVER_BLOCKS));
    let script = script.replace("@WATCH@", &python(&WATCH_BLOCKS)).replace("@CFLIB@", OLDEST_CFLIB);
    Ok(with_caution(job, script.replace("@DATA@", &literal)))
}

/// Returns the script that starts the scripts of several drones.
pub(super) fn launcher(job: &Job<'_>, scripts: &[String]) -> String {
    let names = serde_json::to_string(scripts).expect("names are serializable");
    with_caution(job, LAUNCHER.replace("@SCRIPTS@", &names))
}

/// Returns the data of one drone for its script, as JSON. Times are in s by the plan's clock,
/// lengths in m, and angles in rad. In mode `trajectory`, returns the error of a trajectory that
/// the drone cannot fly.
fn script_data(job: &Job<'_>, drone: usize, first_start_s: f64) -> Result<Value> {
    let plan = &job.plans[drone];
    let stretch = Stretch::new(plan)?;
    let lights = commands(plan, job.light)?;
    let setpoints_end_s = end_s(plan, &stretch, &lights);
    // A script that sends setpoints works without a trajectory, and refuses that mode.
    let (trajectory, refusal) = trajectory_data(job, drone, &stretch, first_start_s)?;
    let mut refused = job.refused.to_vec();
    match refusal {
        Some(error) if job.mode == Mode::Trajectory => return Err(error),
        Some(error) => refused.push((Mode::Trajectory.name(), error.to_string())),
        None => {}
    }
    let start_m = plan.setpoints[0].position_m;
    let heights = plan.setpoints.iter().map(|setpoint| setpoint.position_m.z);
    // A log is matched to its plan by the digest of the file that `noctograph plan` writes.
    let mut csv = Vec::new();
    plan.write_csv(&mut csv).expect("memory takes it");
    // The script resets the lamps once the shutter is closed.
    let lamps = preparation(plan, job.light)?;
    let lamp_names: Vec<String> = lamps.iter().map(|(name, _)| name.clone()).collect();
    let mut parameters = vec![("stabilizer.estimator".to_owned(), KALMAN_ESTIMATOR)];
    parameters.extend(lamps);
    Ok(json!({
        "word": job.word,
        "origin": {
            "scene_sha256": job.checks.scene_sha256,
            "plan_sha256": sha256(&csv),
            "scene": job.checks.scene_toml,
        },
        "limits": limits(job, drone),
        "room_m": job.checks.room_m,
        "corners_m": corners_m(job.plans),
        "uri": uri(job, drone),
        "mode": job.mode.name(),
        "refused": BTreeMap::from_iter(refused),
        "controller": firmware_controller(job.sim.controller.kind),
        "gains": gains::parameters(job.sim),
        "log": format!("{}_flight{}.json", stem(job.word), job.number_suffix(drone)),
        "start_m": [start_m.x, start_m.y],
        "yaw_rad": plan.yaw_rad,
        "top_m": heights.fold(0.0, f64::max),
        "end_s": setpoints_end_s,
        "channels": plan.lamps().map(|(channel, _)| channel).collect::<Vec<_>>(),
        "colors": colors(plan),
        "parameters": parameters,
        "lamps": lamp_names,
        "dark": dark(plan, job.light)?.iter()
            .map(|c| json!([c.parameter, c.value, c.channel, c.level])).collect::<Vec<_>>(),
        "lights": command_rows(&lights),
        "setpoints": setpoints(plan, setpoints_end_s)?,
        "trajectory": trajectory,
    }))
}

/// Returns the color channels of a plan's lamps that have colors, whose levels the script logs.
fn colors(plan: &Plan) -> BTreeMap<&str, &'static [&'static str]> {
    let named = plan.lamps().filter_map(|(channel, _)| Channel::named(channel));
    named.filter(|channel| !channel.colors.is_empty()).map(|c| (c.name, c.colors)).collect()
}

/// Returns the radio address of a drone: the factory address for a single drone, otherwise an
/// address that ends with the drone's number.
fn uri(job: &Job<'_>, drone: usize) -> String {
    let last_byte = if job.plans.len() > 1 { drone + 1 } else { FACTORY_ADDRESS };
    format!("radio://0/80/2M/E7E7E7E7{last_byte:02X}")
}

/// Returns the script's data for an onboard flight. If the drone cannot fly it, the data contain no
/// bytes, and the error is also returned.
fn trajectory_data(
    job: &Job<'_>,
    drone: usize,
    stretch: &Stretch,
    first_start_s: f64,
) -> Result<(Value, Option<Error>)> {
    let plan = &job.plans[drone];
    let lights = job.trajectory_lights(drone)?;
    let trajectory_end_s = end_s(plan, stretch, &lights);
    let flight = trajectory(job, drone).and_then(|trajectory| {
        let timeline = Timeline::new(plan, stretch, first_start_s, trajectory.ends_m());
        let over_s = trajectory_end_s - stretch.start_s() - trajectory.duration_s();
        trajectory.flight(&timeline, over_s)
    });
    let (bytes, refusal) = match flight {
        Ok(bytes) => (bytes, None),
        Err(error) => (Vec::new(), Some(error)),
    };
    // A refused flight has no bytes, and therefore contains no heading to turn to.
    let data = json!({
        "hex": bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>(),
        "start_bytes": START_BYTES,
        "turns": bytes.get(YAW_BYTES).is_some_and(|yaw| yaw != [0; 2]),
        "start_s": zero_s(first_start_s),
        "lights": command_rows(&lights),
        "timing": timing_data(plan, &lights),
        "end_s": trajectory_end_s,
    });
    Ok((data, refusal))
}

/// Returns the ring's timing memory and the light changes that it plays. Each entry is a duration
/// in units of 40 ms and three color bytes. Returns `None` if another lamp is lit, or if the memory
/// is too small.
fn timing_data(plan: &Plan, lights: &[Command]) -> Option<Value> {
    let timing = timing(plan, lights).filter(|t| t.entries.len() <= RING_TIMING_ENTRIES)?;
    let entries = timing.entries.iter().map(|(units, [r, g, b])| json!([units, r, g, b]));
    let changes = timing.changes.iter();
    let changes = changes.map(|(time_s, level, value)| json!([time_s, "ring", level, value]));
    Some(json!({ "entries": Vec::from_iter(entries), "changes": Vec::from_iter(changes) }))
}

/// Returns the trajectory of a drone's letters, encoded for its memory. Returns [`Error::Input`]
/// for a plan made for a different clock, [`Error::Infeasible`] for an unsafe flight, and the
/// errors of [`Compressed::encode`].
fn trajectory(job: &Job<'_>, drone: usize) -> Result<Compressed> {
    if job.trajectory_clock != 1.0 {
        let wanted = "a clock ratio of 1 for a trajectory on board";
        let hint = "plan with 1, because the script measures the drone's clock";
        return Err(Error::input("plan.trajectory_clock", job.trajectory_clock, wanted, hint));
    }
    let (plan, release) = (&job.plans[drone], job.sim.vehicle.firmware);
    let trajectory = Compressed::encode(release, plan, job.tolerance_m)?;
    if drone >= job.flown.len() {
        let what = "the flight is not safe as a trajectory on board";
        return Err(Error::infeasible(what, "export the trajectory to see why"));
    }
    Ok(trajectory)
}

/// Returns light commands as rows `[time, parameter, value, channel, level]`.
fn command_rows(commands: &[Command]) -> Vec<Value> {
    commands.iter().map(|c| json!([c.time_s, c.parameter, c.value, c.channel, c.level])).collect()
}

/// Returns the limits of [`safety`] that the script applies to a drone, as JSON in m, rad, s and V.
fn limits(job: &Job<'_>, drone: usize) -> Value {
    let checks = job.checks;
    let platform = checks.platform;
    let variance_m2 = safety::variance_m2(checks.positioning);
    let battery = checks.batteries.get(drone).copied().flatten();
    let rest_v = battery.map_or(Some(safety::REST_V), |battery| battery.least_rest_v);
    // The fence encloses the checked volume, and its corners are rounded to whole micrometers.
    let [low_m, high_m] = checks.volume_m;
    let fence_m = [low_m.map(|m| m - safety::FENCE_M), high_m.map(|m| m + safety::FENCE_M)]
        .map(|corner_m| corner_m.map(|m| (1e6 * m).round() / 1e6));
    json!({
        "oldest_cflib": OLDEST_CFLIB,
        "oldest_firmware": Release::OLDEST.name(),
        "platforms": platform.map_or(&[] as &[_], safety::Platform::names),
        "decks": decks(&job.plans[drone], checks.positioning),
        "slow_release": Feature::CLOCK.last_without().name(),
        "heading_release": Feature::HEADING.since.name(),
        "slow_clock": SLOW_CLOCK,
        "start_radius_m": safety::START_RADIUS_M,
        "nose_rad": safety::NOSE_RAD,
        "level_rad": safety::LEVEL_RAD,
        "corner_m": safety::CORNER_M,
        "variance_m2": variance_m2,
        "lost_m2": safety::LOST_FACTOR * variance_m2,
        "rest_v": rest_v,
        "low_v": platform.map_or(0.0, safety::Platform::low_battery_v),
        "low_s": safety::LOW_BATTERY_S,
        "critical_v": platform.map_or(0.0, |_| safety::CRITICAL_BATTERY_V),
        "wrong_s": safety::WRONG_S,
        "fence_m": fence_m,
        "stray_m": safety::MAX_POSITION_ERROR_M,
    })
}

/// Returns the decks that a flight requires. Each has a name, and the parameters of the group
/// `deck` of which one is 1 if the deck is attached (firmware `lighthouse.c`, `locodeck.c`,
/// `gtgps.c`, `ledring12.c`, `color_led_deck.c`).
fn decks(plan: &Plan, positioning: Positioning) -> Vec<(&'static str, Vec<&'static str>)> {
    let positioning_parameters = match positioning {
        Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => {
            vec!["bcLighthouse4"]
        }
        Positioning::UwbTwr | Positioning::UwbTdoa => vec!["bcLoco", "bcDWM1000"],
        Positioning::Gnss => vec!["bcGTGPS"],
    };
    // A lamp deck is listed only once, even with several channels.
    let mut decks = vec![("positioning", positioning_parameters)];
    for channel in plan.lamps().filter_map(|(name, _)| Channel::named(name)) {
        let (name, parameters) = channel.deck;
        if decks.iter().all(|(other, _)| *other != name) {
            decks.push((name, parameters.to_vec()));
        }
    }
    decks
}

/// Returns the corners in m of the rectangle around all letters, counterclockwise from the lower
/// left. The list is empty if the plans have no letters. All letters are in one plane of constant
/// y.
fn corners_m(plans: &[Plan]) -> Vec<[f64; 3]> {
    let setpoints = plans.iter().flat_map(|plan| &plan.setpoints);
    let mut written = setpoints.filter(|setpoint| setpoint.letter.is_some()).peekable();
    let Some(y) = written.peek().map(|first| first.position_m.y) else { return Vec::new() };
    let [left, low, right, high] = bounds(written.map(|s| [s.position_m.x, s.position_m.z]));
    [[left, low], [right, low], [right, high], [left, high]].map(|[x, z]| [x, y, z]).into()
}

/// Returns a controller's number in the firmware (`controller.h`), or `None` if the firmware lacks
/// it.
pub(super) fn firmware_controller(kind: ControllerKind) -> Option<u32> {
    match kind.law() {
        Law::Cascade => Some(1),
        Law::Geometric => Some(5),
        Law::StateFeedback { .. } | Law::Own => None,
    }
}

/// Returns the time in the plan, s, after which all letters have been flown and all lights are off.
fn end_s(plan: &Plan, stretch: &Stretch, lights: &[Command]) -> f64 {
    let letters_s = stretch.start_s() + stretch.duration_s();
    let dark_s = lights.last().map_or(0.0, |command| command.time_s + AFTERGLOW_S);
    let last_airborne = plan.setpoints.iter().rfind(|setpoint| !setpoint.on_floor());
    // The run-out may extend beyond the landing. The flight waits for the lights in any case.
    letters_s.min(last_airborne.map_or(0.0, |setpoint| setpoint.time_s)).max(dark_s)
}

/// True if a plan's setpoints are far enough apart to be sent one by one.
pub(super) fn fits_the_radio(plan: &Plan) -> bool {
    setpoints(plan, f64::INFINITY).is_ok_and(|rows| !rows.is_empty())
}

/// True if setpoint `to` is redundant after setpoint `from`, because it sends the same position, or
/// because its position is on the path that starts at `from`.
fn continues(plan: &Plan, from: usize, to: usize) -> bool {
    let (a, b) = (&plan.setpoints[from], &plan.setpoints[to]);
    let sends_same = (plan.sent_m(from) - plan.sent_m(to)).norm() < SAME_M;
    sends_same || (a.design_m(b.time_s) - b.position_m).norm() < SAME_M
}

/// Returns the airborne setpoints to send until `end_s`, each as `[time, position sent, velocity,
/// acceleration]` in SI units. A setpoint less than [`MIN_INTERVAL_S`] after another one is omitted
/// if one of the two is redundant. Otherwise [`Error::Infeasible`] is returned.
fn setpoints(plan: &Plan, end_s: f64) -> Result<Vec<Value>> {
    let mut kept: Vec<usize> = Vec::new();
    for (row, setpoint) in plan.setpoints.iter().enumerate() {
        if setpoint.on_floor() || setpoint.time_s > end_s {
            continue;
        }
        let interval_s = kept.last().map(|last| setpoint.time_s - plan.setpoints[*last].time_s);
        let Some(interval_s) = interval_s.filter(|s| *s < MIN_INTERVAL_S - TIME_ROUNDING_S) else {
            kept.push(row);
            continue;
        };
        // If two setpoints are closer than the radio can send, the redundant one is dropped.
        let previous_row = kept[kept.len() - 1];
        let previous = &plan.setpoints[previous_row];
        let earlier_row = kept.len().checked_sub(2).map(|index| kept[index]);
        if earlier_row.is_some_and(|earlier_row| continues(plan, earlier_row, previous_row)) {
            *kept.last_mut().expect("a setpoint") = row;
        } else if !continues(plan, previous_row, row) || setpoint.letter != previous.letter {
            let (hz, time_s) = (1.0 / interval_s, previous.time_s);
            return Err(Error::infeasible(
                format!(
                    "{hz:.0} setpoints per second at {time_s:.2} s, but the radio carries 50 \
                     per second"
                ),
                "raise plan.setpoint_interval_s, or fly a trajectory on board",
            ));
        }
    }
    let rows = kept.into_iter().map(|row| {
        let s = &plan.setpoints[row];
        let [sent, v, a] = [plan.sent_m(row), s.velocity_m_s, s.acceleration_m_s2]
            .map(|vector| [vector.x, vector.y, vector.z]);
        json!([s.time_s, sent, v, a])
    });
    Ok(rows.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::safety::{Battery, Checks, Platform};
    use nalgebra::Vector3;
    use noctograph_core::camera::CameraOptions;
    use noctograph_core::lamps::{Drive, Fixture, LightOptions};
    use noctograph_core::plan::PlanData;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, Setpoint, plan};
    use noctograph_sim::SimOptions;
    use noctograph_sim::sensors::Positioning;

    /// Returns the script for NO, named after a given word, and the data in it.
    fn exported(word: &str, checks: &Checks) -> (String, Plan, Value) {
        exported_with(word, checks, &PlanOptions::even(), &LightOptions::default())
    }

    fn exported_with(
        word: &str,
        checks: &Checks,
        options: &PlanOptions,
        light: &LightOptions,
    ) -> (String, Plan, Value) {
        let strokes = write("NO", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, options).unwrap();
        let (script, data) = exported_plan(word, checks, &plan, light);
        (script, plan, data)
    }

    fn exported_plan(
        word: &str,
        checks: &Checks,
        plan: &Plan,
        light: &LightOptions,
    ) -> (String, Value) {
        let job = Job {
            plans: std::slice::from_ref(plan),
            flown: std::slice::from_ref(plan),
            unsafe_because: Some("volume (1 m outside)\nimport os"),
            word,
            light,
            sim: &SimOptions::default(),
            camera: &CameraOptions::default().camera([-1.0, 0.5, 1.0, 1.5], 1.0).unwrap(),
            tolerance_m: 0.002,
            mode: Mode::Position,
            refused: &[],
            trajectory_clock: 1.0,
            checks,
        };
        let script = script(&job, 0, 0.0).unwrap();
        let line = script.lines().find_map(|line| line.strip_prefix("DATA = json.loads(")).unwrap();
        let text: String = serde_json::from_str(line.strip_suffix(')').unwrap()).unwrap();
        let data = serde_json::from_str(&text).unwrap();
        (script, data)
    }

    fn checks() -> Checks {
        Checks {
            platform: Some(Platform::Crazyflie2),
            positioning: Positioning::Sweeps,
            volume_m: [[-2.5, -2.5, 0.0], [2.5, 2.5, 2.5]],
            room_m: None,
            batteries: Vec::new(),
            scene_sha256: String::new(),
            scene_toml: "word = \"NO\"\n".to_owned(),
        }
    }

    #[test]
    fn a_script_judges_by_the_limits_of_the_checks() {
        let battery = Battery { rest_v: 4.1, least_rest_v: Some(3.77), sag_v: 0.6 };
        let checks = Checks {
            platform: Some(Platform::Brushless),
            positioning: Positioning::UwbTwr,
            volume_m: [[-1.8, -1.3, 0.0], [1.8, 1.3, 2.3]],
            room_m: Some([4.0, 3.0, 2.5]),
            batteries: vec![Some(battery)],
            ..checks()
        };
        let (_, plan, data) = exported("NO", &checks);
        let limits = &data["limits"];
        assert_eq!(limits["platforms"], json!(["Crazyflie 2.1 Brushless"]));
        assert_eq!([&limits["low_v"], &limits["rest_v"]], [3.35, 3.77]);
        assert_eq!(limits["fence_m"], json!([[-1.9, -1.4, -0.1], [1.9, 1.4, 2.4]]));
        assert_eq!(limits["variance_m2"], 0.01);
        assert_eq!(limits["decks"][0], json!(["positioning", ["bcLoco", "bcDWM1000"]]));
        assert_eq!(data["room_m"], json!([4.0, 3.0, 2.5]));
        let mut csv = Vec::new();
        plan.write_csv(&mut csv).unwrap();
        assert_eq!(data["origin"]["plan_sha256"], sha256(&csv), "as sha256sum tells of plan.csv");
        let full =
            Checks { batteries: vec![Some(Battery { least_rest_v: None, ..battery })], ..checks };
        assert_eq!(exported("NO", &full).2["limits"]["rest_v"], Value::Null, "no charge is enough");
    }

    #[test]
    fn a_lamp_of_ones_own_goes_back_with_the_lamps_and_its_parameter_is_demanded() {
        let laser = Fixture {
            drive: Drive::Command("laser".to_owned()),
            parameter: Some("laser.power".to_owned()),
            parameter_max: 255,
            ..Fixture::default()
        };
        let light = LightOptions { fixtures: Some(vec![laser]), ..LightOptions::default() };
        let options = PlanOptions { lights: vec!["laser".to_owned()], ..PlanOptions::even() };
        let (script, _, data) = exported_with("NO", &checks(), &options, &light);
        assert_eq!(data["lamps"], json!(["led.bitmask", "laser.power"]));
        assert_eq!(data["dark"], json!([["laser.power", 0, "laser", 0.0]]), "`names_missing`");
        assert!(script.contains("(name in DATA[\"lamps\"]) == lamps"), "and nothing by its prefix");
        let (_, _, data) = exported("NO", &checks());
        let deck = ["led.bitmask", "ring.headlightEnable", "ring.effect"];
        assert_eq!(data["lamps"], json!(deck), "all that a lamp is set by before the flight");
    }

    #[test]
    fn a_trajectory_begins_at_the_command_that_starts_it_and_ends_without_a_goal() {
        let (_, plan, data) = exported("NO", &checks());
        let trajectory = &data["trajectory"];
        let hex = trajectory["hex"].as_str().unwrap();
        let letters = Compressed::encode(Release::MODELED, &plan, 0.002).unwrap().to_bytes();
        let letters: String = letters.iter().map(|byte| format!("{byte:02x}")).collect();
        let (before, after) = hex.split_once(&letters[16..letters.len() - 6]).unwrap();
        assert_eq!((before.len() / 2, &after[after.len() - 10..]), (59, "1000000000"));
        // In `exported` another drone starts at 0 s of the plan's time, so this drone has to wait.
        assert_eq!(trajectory["start_s"], -7.0);
        // The hover lasts until 3 s after the script's landing.
        let stretch = Stretch::new(&plan).unwrap();
        let over_s =
            trajectory["end_s"].as_f64().unwrap() - stretch.start_s() - stretch.duration_s();
        let hover_ms = u16::from_str_radix(&after[2..4], 16).unwrap()
            + 256 * u16::from_str_radix(&after[4..6], 16).unwrap();
        assert!((f64::from(hover_ms) - 1e3 * (over_s + 3.0)).abs() < 2.0, "{hover_ms} ms");
        #[expect(clippy::cast_possible_truncation, reason = "a place in a room")]
        let home_mm = |axis: usize| (1e3 * plan.setpoints[0].position_m[axis]).round() as i16;
        for (axis, places) in trajectory["start_bytes"].as_array().unwrap().iter().enumerate() {
            for place in places.as_array().unwrap() {
                let place = usize::try_from(place.as_u64().unwrap()).unwrap();
                let [low, high] = home_mm(axis).to_le_bytes();
                assert_eq!(hex[2 * place..2 * place + 4], format!("{low:02x}{high:02x}"));
            }
        }
    }

    #[test]
    fn of_setpoints_that_are_too_near_the_one_that_merely_goes_on_is_left_out() {
        let setpoint = |time_s: f64, x: f64, vx: f64| Setpoint {
            time_s,
            position_m: Vector3::new(x, 0.0, 1.0),
            velocity_m_s: Vector3::new(vx, 0.0, 0.0),
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(0),
        };
        fn times_s(rows: &[Setpoint]) -> Result<Vec<f64>> {
            let plan = Plan::made(PlanData { setpoints: rows.to_vec(), ..PlanData::default() });
            let rows = setpoints(&plan, 9.0)?;
            Ok(rows.iter().map(|row| row[0].as_f64().unwrap()).collect())
        }
        // The setpoints follow a straight line at 1 m/s, turn at 1.01 s, and continue straight.
        let [a, b, c] =
            [setpoint(0.5, 0.5, 1.0), setpoint(1.0, 1.0, 1.0), setpoint(1.01, 1.01, -1.0)];
        let d = setpoint(1.5, 0.52, -1.0);
        assert_eq!(times_s(&[a, b, c, d]).unwrap(), [0.5, 1.01, 1.5], "the one before the corner");
        let [corner, late] = [setpoint(1.0, 1.2, -1.0), setpoint(1.01, 1.19, -1.0)];
        assert_eq!(times_s(&[a, corner, late, d]).unwrap(), [0.5, 1.0, 1.5], "the one after it");
        let held = setpoint(1.01, 1.2, 1.0);
        assert_eq!(times_s(&[a, corner, held, d]).unwrap(), [0.5, 1.0, 1.5], "sent is the same");
        let other = Setpoint { letter: Some(1), ..late };
        assert!(times_s(&[a, corner, other, d]).is_err(), "the next letter begins");
        let turns = setpoint(1.0, 1.3, 0.5);
        let error = times_s(&[a, turns, setpoint(1.01, 1.2, 0.0), d]).unwrap_err().to_string();
        assert!(error.contains("100 setpoints per second at 1.00 s"), "{error}");
        let apart = [a, setpoint(0.52, 0.7, 0.0), setpoint(0.54, 0.6, 0.0)];
        assert_eq!(times_s(&apart).unwrap(), [0.5, 0.52, 0.54], "50 a second are sent");
        assert_eq!(times_s(&[a, setpoint(9.5, 1.0, 0.0)]).unwrap(), [0.5], "to the end");
    }

    #[test]
    fn a_ring_with_few_changes_is_played_on_board_and_one_with_many_is_not() {
        let options = PlanOptions { lights: vec!["ring".to_owned()], ..PlanOptions::even() };
        let timing = |strokes: usize| {
            let light = LightOptions::default();
            let (_, mut plan, _) = exported_with("NO", &checks(), &options, &light);
            let n = plan.setpoints.len();
            let is_lit = |row: usize| 2 * strokes * row / n % 2 == 1 && row + 9 < n;
            let levels = (0..n).map(|row| f64::from(u8::from(is_lit(row)))).collect();
            plan.edit(|plan| plan.lights = [("ring".to_owned(), levels)].into());
            exported_plan("NO", &checks(), &plan, &light).1["trajectory"]["timing"].clone()
        };
        let four = timing(4);
        assert_eq!(four["entries"].as_array().unwrap().len(), 8, "{four}");
        assert_eq!(timing(9), Value::Null, "more than the memory holds");
    }

    #[test]
    fn writing_ends_after_the_letters_and_the_lights_and_before_the_floor() {
        let (_, plan, _) = exported("NO", &checks());
        let stretch = Stretch::new(&plan).unwrap();
        let letters_s = stretch.start_s() + stretch.duration_s();
        let light = |time_s: f64| {
            let lights = commands(&plan, &LightOptions::default()).unwrap();
            [Command { time_s, ..lights[0].clone() }]
        };
        assert_eq!(end_s(&plan, &stretch, &[]), letters_s);
        assert_eq!(end_s(&plan, &stretch, &light(letters_s - 1.0)), letters_s);
        assert_eq!(end_s(&plan, &stretch, &light(letters_s + 1.0)), letters_s + 1.2);
        let mut low = plan.clone();
        low.edit(|low| {
            low.setpoints
                .retain(|setpoint| setpoint.time_s < letters_s - 0.3 || setpoint.on_floor());
            low.lights.clear();
            low.lit.clear();
            low.sent_m.clear();
        });
        let in_the_air = low.setpoints.iter().rfind(|setpoint| !setpoint.on_floor()).unwrap();
        assert_eq!(end_s(&low, &stretch, &[]), in_the_air.time_s);
    }

    #[test]
    fn every_controller_of_the_firmware_has_its_number_there() {
        let number = |kind: &ControllerKind| Some((kind.name(), firmware_controller(*kind)?));
        let numbers: Vec<_> = ControllerKind::ALL.iter().filter_map(number).collect();
        assert_eq!(numbers, [("pid", 1), ("geometric", 5)], "`controller.h`");
    }

    #[test]
    fn the_drones_of_a_fleet_have_numbers_and_their_own_limits() {
        let strokes = write("I", &LetterOptions::default()).unwrap();
        let one = plan(&strokes, &PlanOptions::even()).unwrap();
        let plans = [one.clone(), one.clone()];
        let camera = CameraOptions::default().camera(strokes.bounds_m(), 1.0).unwrap();
        let battery = Battery { rest_v: 4.1, least_rest_v: Some(3.9), sag_v: 0.6 };
        let checks = Checks { batteries: vec![None, Some(battery)], ..checks() };
        let job = Job {
            plans: &plans,
            flown: &[],
            unsafe_because: None,
            word: "I",
            light: &LightOptions::default(),
            sim: &SimOptions::default(),
            camera: &camera,
            tolerance_m: 0.002,
            mode: Mode::Position,
            refused: &[],
            trajectory_clock: 1.0,
            checks: &checks,
        };
        let [first, second] = [0, 1].map(|drone| script_data(&job, drone, 0.0).unwrap());
        assert_eq!(first["uri"], "radio://0/80/2M/E7E7E7E701");
        assert_eq!(second["uri"], "radio://0/80/2M/E7E7E7E702");
        assert_eq!([&first["log"], &second["log"]], ["I_flight-1.json", "I_flight-2.json"]);
        assert_eq!([&first["limits"]["rest_v"], &second["limits"]["rest_v"]], [3.8, 3.9]);
        assert_eq!(first["limits"]["lost_m2"], 0.01, "ten times the variance that has settled");
        assert_eq!([&first["limits"]["low_v"], &first["limits"]["critical_v"]], [3.2, 3.0]);
        let heights = one.setpoints.iter().map(|setpoint| setpoint.position_m.z);
        assert_eq!(first["top_m"], heights.fold(f64::NEG_INFINITY, f64::max));
        assert_eq!(
            first["start_m"],
            json!([one.setpoints[0].position_m.x, one.setpoints[0].position_m.y])
        );
        // The flight is unsafe as a trajectory, which must therefore be refused. A plan for a slow
        // clock must be refused as a trajectory, too.
        let refused = |data: &Value| data["refused"]["trajectory"].as_str().unwrap().to_owned();
        assert!(refused(&first).contains("not safe") && first["trajectory"]["hex"] == "");
        let slow =
            script_data(&Job { trajectory_clock: 0.99, flown: &plans, ..job }, 0, 0.0).unwrap();
        assert!(refused(&slow).contains("trajectory_clock"), "{}", refused(&slow));
        let asked = Job { mode: Mode::Trajectory, ..job };
        assert!(
            script_data(&asked, 0, 0.0).is_err(),
            "and where it is asked for, nothing is written"
        );
        let alone = Job { plans: &plans[..1], ..job };
        assert_eq!(script_data(&alone, 0, 0.0).unwrap()["uri"], "radio://0/80/2M/E7E7E7E7E7");
        let unknown = Checks { platform: None, ..checks.clone() };
        let unknown = script_data(&Job { checks: &unknown, ..job }, 0, 0.0).unwrap();
        assert_eq!([&unknown["limits"]["low_v"], &unknown["limits"]["critical_v"]], [0.0, 0.0]);
        assert_eq!(unknown["limits"]["platforms"], json!([]));
    }

    #[test]
    fn every_positioning_and_lamp_demands_its_deck() {
        for positioning in Positioning::ALL {
            let (name, values) = decks(&Plan::default(), *positioning).remove(0);
            let wanted = match positioning {
                Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => {
                    "bcLighthouse4"
                }
                Positioning::UwbTwr | Positioning::UwbTdoa => "bcLoco",
                Positioning::Gnss => "bcGTGPS",
            };
            assert_eq!((name, values[0]), ("positioning", wanted), "{}", positioning.name());
        }
        let mut both = exported("NO", &checks()).1;
        let dark = vec![0.0; both.setpoints.len()];
        for channel in &noctograph_core::lamps::CHANNELS {
            both.edit(|both| both.lights = [(channel.name.to_owned(), dark.clone())].into());
            let decks = decks(&both, Positioning::Sweeps);
            assert_eq!(decks[1..], [(channel.deck.0, channel.deck.1.to_vec())], "{}", channel.name);
        }
        both.edit(|both| both.lights.insert("ring".to_owned(), dark.clone()));
        both.edit(|both| both.lights.insert("headlights".to_owned(), dark));
        let names: Vec<&str> =
            decks(&both, Positioning::Sweeps).iter().map(|(name, _)| *name).collect();
        assert_eq!(names.iter().filter(|name| **name == "the ring").count(), 1, "{names:?}");
    }

    #[test]
    fn the_corners_of_the_canvas_are_those_of_the_letters_of_all_drones() {
        let setpoint = |x: f64, z: f64, letter| Setpoint {
            time_s: 0.0,
            position_m: Vector3::new(x, 0.3, z),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter,
        };
        let plan = |setpoints: &[Setpoint]| {
            Plan::made(PlanData { setpoints: setpoints.to_vec(), ..PlanData::default() })
        };
        let one = plan(&[
            setpoint(-3.0, 0.0, None),
            setpoint(-1.0, 0.5, Some(0)),
            setpoint(-0.5, 1.5, Some(0)),
        ]);
        let two = plan(&[
            setpoint(1.0, 1.0, Some(1)),
            setpoint(0.0, 0.4, Some(1)),
            setpoint(9.0, 9.0, None),
        ]);
        let want = [[-1.0, 0.3, 0.4], [1.0, 0.3, 0.4], [1.0, 0.3, 1.5], [-1.0, 0.3, 1.5]];
        assert_eq!(corners_m(&[one, two]), want);
        assert_eq!(corners_m(&[plan(&[setpoint(0.0, 0.0, None)])]), [[0.0; 3]; 0]);
    }

    #[test]
    fn no_character_of_a_word_hides_or_turns_a_line_of_the_script() {
        for c in ['\u{202e}', '\u{2066}', '\u{2028}', '\u{200f}', '\u{feff}', '\u{e0041}', '\u{7f}']
        {
            let word = format!("A{c}B");
            let (script, _, data) = exported(&word, &checks());
            assert_eq!(data["word"], word, "it is still the word");
            assert!(!script.contains(c), "{c:?}");
            assert!(script.lines().find(|line| line.starts_with("DATA")).unwrap().is_ascii());
        }
    }

    #[test]
    fn a_word_never_becomes_code() {
        let word = "\"); import os\nimport os #'\\";
        let (script, _, data) = exported(word, &checks());
        assert_eq!(data["word"], word);
        assert_eq!(data["log"], "importosimportos_flight.json");
        let caution = script.lines().nth(1).unwrap();
        assert_eq!(
            caution,
            "# EXPORTED UNCHECKED, NOT SAFE TO FLY: volume (1 m outside) import os"
        );
        assert!(script.lines().nth(2).unwrap().starts_with("\"\"\"Writes"), "{script}");
    }
}
