//! Crazyswarm2: a CSV of polynomials for each drone, `crazyflies.yaml` and a Python script.
//!
//! The CSV is that of `uav_trajectories` ([`super::poly4d`]). The server uploads to the drone's
//! memory with an offset in pieces; the script follows Crazyswarm2's Python interface
//! (`crazyflie_py`): `uploadTrajectory`, `takeoff`, `goTo`, `startTrajectory`, `setParam`, `land`.

use serde_json::json;

use super::cflib::with_caution;
use super::lights::{dark, preparation};
use super::pieces::Stretch;
use super::poly4d::Poly4d;
use super::{File, Job, numbered, stem};
use crate::error::Result;

/// The script, with `@DATA@` in place of the drones' data.
const SCRIPT: &str = include_str!("crazyswarm.py");

/// All files for Crazyswarm2.
pub(super) fn files(job: &Job<'_>) -> Result<Vec<File>> {
    let csv = |(drone, plan)| {
        let name = numbered(&stem(job.word), drone, job.plans.len(), "csv");
        Ok(File::new(name, Poly4d::fit(plan, job.tolerance_m)?.to_csv()))
    };
    let mut files = job.plans.iter().enumerate().map(csv).collect::<Result<Vec<_>>>()?;
    let mut drones = Vec::new();
    for (drone, (plan, csv)) in job.plans.iter().zip(&files).enumerate() {
        let stretch = Stretch::new(plan)?;
        let first_m = stretch.setpoint(0).position_m;
        let lights = job.trajectory_lights(drone)?;
        let dark = dark(plan)?;
        drones.push(json!({
            "csv": csv.name,
            "start_s": stretch.start_s(),
            "end_s": lights.last().map_or(0.0, |c| c.time_s).max(stretch.start_s() + stretch.duration_s()),
            "top_m": plan.setpoints.iter().map(|s| s.position_m.z).fold(0.0, f64::max),
            "yaw_rad": plan.yaw_rad,
            "first_m": first_m,
            "parameters": preparation(plan, job.light),
            "lights": lights.iter().map(|c| json!([c.time_s, c.parameter, c.value])).collect::<Vec<_>>(),
            "dark": dark.iter().map(|c| json!([c.parameter, c.value])).collect::<Vec<_>>(),
        }));
    }
    let literal = serde_json::to_string(&json!(drones).to_string()).expect("text is serializable");
    files.push(File::new("crazyflies.yaml", yaml(job)));
    let script = with_caution(job, &SCRIPT.replace("@DATA@", &literal));
    files.push(File::new(format!("fly_{}.py", stem(job.word)), script));
    Ok(files)
}

fn yaml(job: &Job<'_>) -> String {
    let mut text = "fileversion: 3\nrobots:\n".to_owned();
    for (drone, plan) in job.plans.iter().enumerate() {
        let start_m = plan.setpoints[0].position_m;
        text += &format!(
            "  cf{0}:\n    enabled: true\n    uri: radio://0/80/2M/E7E7E7E7{0:02X}\n    \
             initial_position: [{1:?}, {2:?}, 0.0]\n    type: cf21\n",
            drone + 1,
            start_m.x,
            start_m.y,
        );
    }
    text + "robot_types:\n  cf21:\n    motion_capture:\n      tracking: \"none\"  # Lighthouse; or \
            librigidbodytracker, vendor\n    big_quad: false\n    battery:\n      voltage_warning: \
            3.8\n      voltage_critical: 3.7\nall:\n  firmware_params:\n    commander:\n      \
            enHighLevel: 1\n    stabilizer:\n      estimator: 2\n      controller: 2\n"
}
