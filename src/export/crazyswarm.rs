//! Exports to Crazyswarm2: a CSV file for each drone, `crazyflies.yaml` and a Python script.
//!
//! The CSV has the format of `uav_trajectories` ([`super::poly4d`]). The server uploads it to the
//! drone's memory at an offset counted in pieces. The script uses Crazyswarm2's Python interface
//! (`crazyflie_py`): `uploadTrajectory`, `startTrajectory`, `setParam`, `land`. The script checks
//! the drones against the limits of the check ([`super::safety`]), through the topics that
//! `crazyflies.yaml` requests from the server: pose, status and a custom one. By default the server
//! reads no parameter values, so the operator is asked for the decks and the firmware's release.

use serde_json::json;

use super::cflib::{AFTERGLOW_S, KALMAN_ESTIMATOR, firmware_controller};
use super::lights::{dark, preparation};
use super::pieces::Stretch;
use super::poly4d::Poly4d;
use super::safety::{
    CRITICAL_BATTERY_V, FENCE_M, LEVEL_RAD, LOST_FACTOR, NOSE_RAD, Platform, REST_V,
    START_RADIUS_M, WRONG_S, variance_m2,
};
use super::timeline::{Timeline, earliest_s, zero_s};
use super::{File, Job, ascii, gains, per_drone, stem, with_caution};
use noctograph_core::crazyflie::{Feature, MOTORS_STOP_S, SLOW_CLOCK};
use noctograph_core::error::{Error, Result};
use noctograph_plan::Plan;

/// Template of the script, with `@DATA@` for the checks and the drones' data.
const SCRIPT: &str = include_str!("crazyswarm.py");

/// Variables in the script's custom topic, in its order. They take 24 of the 26 bytes in a block.
const LOGGED: &str = "\"kalman.varPX\", \"kalman.varPY\", \"kalman.varPZ\", \
                      \"stateEstimate.roll\", \"stateEstimate.pitch\", \"stateEstimate.yaw\"";

/// Returns all files for Crazyswarm2: a trajectory for each drone, `crazyflies.yaml`, and the
/// script. Returns [`Error::Input`] for a drone or controller that it cannot fly, and the errors of
/// [`Poly4d::fit`].
pub(super) fn files(job: &Job<'_>) -> Result<Vec<File>> {
    let (controller, platform) = firmware(job)?;
    // Each drone has a trajectory and an entry. All trajectories start together.
    let first_start_s = earliest_s(job.plans)?;
    let mut files = per_drone(job, "csv", |drone, plan| {
        let stretch = Stretch::new(plan)?;
        let over_s = end_s(job, drone, &stretch)? - stretch.start_s() - stretch.duration_s();
        let trajectory = Poly4d::fit(job.sim.vehicle.firmware, plan, job.tolerance_m)?;
        let timeline = Timeline::new(plan, &stretch, first_start_s, trajectory.ends_m());
        Ok(trajectory.flight(&timeline, over_s)?.to_csv().into_bytes())
    })?;
    let drones = job.plans.iter().zip(&files).enumerate().map(|(index, (plan, csv))| {
        entry(job, index, plan, &csv.name, controller, zero_s(first_start_s))
    });
    let drones = drones.collect::<Result<Vec<_>>>()?;
    let checks = job.checks;
    let data = json!({
        "word": job.word,
        "scene_sha256": checks.scene_sha256,
        "platform": platform.names().join(" or "),
        "volume_m": checks.volume_m,
        "room_m": checks.room_m,
        "variance_m2": variance_m2(checks.positioning),
        "lost_m2": LOST_FACTOR * variance_m2(checks.positioning),
        "start_radius_m": START_RADIUS_M,
        "nose_rad": NOSE_RAD,
        "level_rad": LEVEL_RAD,
        "critical_v": CRITICAL_BATTERY_V,
        "fence_m": FENCE_M,
        "wrong_s": WRONG_S,
        // The time is that of the firmware's setpoint timeout.
        "silent_s": MOTORS_STOP_S,
        "slow_clock": SLOW_CLOCK,
        "last_slow_release": Feature::CLOCK.last_without().name(),
        "drones": drones,
    });
    let literal = serde_json::to_string(&ascii(&data)).expect("text is serializable");
    files.push(File::new("crazyflies.yaml", yaml(job, controller, platform)));
    let script = with_caution(job, SCRIPT.replace("@DATA@", &literal));
    files.push(File::new(format!("fly_{}.py", stem(job.word)), script));
    Ok(files)
}

/// Returns the firmware's number for the scene's controller, and the kind of drone. Returns
/// [`Error::Input`] for controllers and drones that the firmware does not support, and for a plan
/// made for a different clock.
fn firmware(job: &Job<'_>) -> Result<(u32, Platform)> {
    let (kind, clock) = (job.sim.controller.kind, job.trajectory_clock);
    // Lamps are timed under the scene's controller, so no other controller may be used.
    let Some(controller) = firmware_controller(kind) else {
        let wanted = "pid or geometric (Lee's), if the drone's firmware contains it";
        let hint = "choose one of these, or fly your own controller with the script for cflib";
        return Err(Error::input("controller.kind", kind.name(), wanted, hint));
    };
    let Some(platform) = job.checks.platform else {
        let drone = "a drone without Bitcraze's firmware";
        let hint = "name the preset of the drone";
        return Err(Error::input("preset", drone, "a Crazyflie", hint));
    };
    if clock != 1.0 {
        let hint = "plan with 1, because the script adapts the trajectory to the firmware's clock";
        return Err(Error::input("plan.trajectory_clock", clock, "1 for Crazyswarm2", hint));
    }
    Ok((controller, platform))
}

/// Returns the time, by the plan's clock, at which a drone lands after all letters have been flown
/// and all lamps are off, s.
fn end_s(job: &Job<'_>, drone: usize, stretch: &Stretch) -> Result<f64> {
    let dark_s = job.trajectory_lights(drone)?.last().map_or(0.0, |last| last.time_s);
    Ok(dark_s.max(stretch.start_s() + stretch.duration_s()) + AFTERGLOW_S)
}

/// Returns a drone's entry in the JSON that the script reads: parameters to set before and after
/// the estimator's reset, light commands, and commands that turn all lamps off. `csv` is the name
/// of its trajectory's file. `start_s` is the take-off's time by the plans' clock.
fn entry(
    job: &Job<'_>,
    index: usize,
    plan: &Plan,
    csv: &str,
    controller: u32,
    start_s: f64,
) -> Result<serde_json::Value> {
    let stretch = Stretch::new(plan)?;
    let lights = job.trajectory_lights(index)?;
    let dark = dark(plan, job.light)?;
    let start_m = plan.setpoints[0].position_m;
    let battery = job.checks.batteries.get(index).copied().flatten();
    // The Kalman filter restarts with the plan's heading.
    let before = json!([
        ["stabilizer.estimator", KALMAN_ESTIMATOR],
        ["kalman.initialYaw", plan.yaw_rad],
        ["kalman.resetEstimation", 1]
    ]);
    let mut parameters = vec![json!(["stabilizer.controller", controller])];
    parameters.extend(gains::parameters(job.sim).into_iter().map(|gain| json!(gain)));
    parameters.extend(preparation(plan, job.light)?.into_iter().map(|lamp| json!(lamp)));
    Ok(json!({
        "name": format!("cf{}", index + 1),
        "csv": csv,
        "start_m": [start_m.x, start_m.y],
        "start_s": start_s,
        "end_s": end_s(job, index, &stretch)?,
        "top_m": plan.setpoints.iter().map(|s| s.position_m.z).fold(0.0, f64::max),
        "yaw_rad": plan.yaw_rad,
        "least_rest_v": battery.and_then(|battery| battery.least_rest_v).unwrap_or(REST_V),
        "before": before,
        "parameters": parameters,
        "lights": lights.iter().map(|c| json!([c.time_s, c.parameter, c.value])).collect::<Vec<_>>(),
        "dark": dark.iter().map(|c| json!([c.parameter, c.value])).collect::<Vec<_>>(),
    }))
}

/// Returns Crazyswarm2's `crazyflies.yaml` for the drones of a job. `controller` is a number in the
/// firmware.
fn yaml(job: &Job<'_>, controller: u32, platform: Platform) -> String {
    let kind = match platform {
        Platform::Crazyflie2 => "cf21",
        Platform::Brushless => "cf21bl",
    };
    // The robots' entries are followed by their type and by the settings that apply to all of them.
    let mut text = "fileversion: 3\nrobots:\n".to_owned();
    for (drone, plan) in job.plans.iter().enumerate() {
        let start_m = plan.setpoints[0].position_m;
        text += &format!(
            "  cf{0}:\n    enabled: true\n    uri: radio://0/80/2M/E7E7E7E7{0:02X}\n    \
             initial_position: [{1:?}, {2:?}, 0.0]\n    type: {kind}\n",
            drone + 1,
            start_m.x,
            start_m.y,
        );
    }
    text + &format!(
        "robot_types:\n  {kind}:\n    motion_capture:\n      tracking: \"none\"  # Lighthouse; or \
         librigidbodytracker, vendor\n    big_quad: false\n    battery:\n      voltage_warning: \
         {low_v}\n      voltage_critical: {CRITICAL_BATTERY_V:.1}\nall:\n  firmware_logging:\n    enabled: \
         true\n    default_topics:\n      pose:\n        frequency: 10\n      status:\n        \
         frequency: 10\n    custom_topics:\n      noctograph:\n        frequency: 10\n        vars: \
         [{LOGGED}]\n  firmware_params:\n    stabilizer:\n      estimator: 2\n      controller: \
         {controller}\n",
        low_v = platform.low_battery_v(),
    )
}
