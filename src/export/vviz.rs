//! Exports VVIZ 1.0, the interchange format for viewing drone shows (Verge Aero, Finale 3D).
//!
//! The file contains steps of position in meters at 10 Hz from each drone's home, with x to the
//! right, y up and z forward, and a color for each frame at 20 Hz. Sources: docs.verge.aero ("VVIZ
//! format") for the header and the axes, finale3d.com ("vviz file format") for the home and the
//! steps, and public exporters to Finale 3D for `Light`. The attribute `frames` of a color is
//! omitted, because no document states whether it counts from the previous color or to the next
//! one. With one color per frame, both interpretations agree.

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::lights::{commands, screen_rgb};
use super::{File, Job, ascii, stem};
use noctograph_core::error::{Error, Result};
use noctograph_plan::Plan;

/// Rates of the positions and of the color frames.
const POSITION_HZ: f64 = 10.0;
const COLOR_HZ: f64 = 20.0;
/// Number of rounding steps per meter, each 0.1 mm.
const ROUNDING_PER_M: f64 = 1e4;

/// Returns the `.vviz` file of a job. Returns [`Error::Input`] for a plan with a heading.
pub(super) fn show(job: &Job<'_>) -> Result<File> {
    if let Some(plan) = job.plans.iter().find(|plan| plan.yaw_rad != 0.0) {
        let wanted =
            "0 for VVIZ, because no document defines the zero and the direction of its headings";
        let hint = "export a show for Skybrush, which has headings, or plan with 0";
        return Err(Error::input("plan.yaw_rad", plan.yaw_rad, wanted, hint));
    }
    // The y-axis points up in the show, and the z-axis in the plan.
    let drones = job.plans.iter().zip(job.flown).enumerate().map(|(index, (plan, flown))| {
        let home = plan.setpoints[0].position_m;
        Ok(json!({
            "id": index,
            "agentDescription": {
                "airframe": "Crazyflie",
                "homeX": home.x, "homeY": 0.0, "homeZ": home.y,
                "agentTraversal": steps(flown),
            },
            "payloadDescription": [{
                "id": 0, "type": "Light", "payloadActions": colors(job, flown)?,
            }],
        }))
    });
    let show = json!({
        "version": "1.0",
        "performanceName": job.word,
        "coordinateFrame": "ogl",
        "defaultPositionRate": POSITION_HZ,
        "defaultColorRate": COLOR_HZ,
        "timeOffsetSecs": 0.0,
        "performances": drones.collect::<Result<Vec<_>>>()?,
    });
    Ok(File::new(format!("{}.vviz", stem(job.word)), format!("{}\n", ascii(&show))))
}

/// Returns a drone's steps from each sampled position to the next in m, beginning with a zero step.
/// In the show, y points up.
fn steps(flown: &Plan) -> Vec<Value> {
    // The steps are differences of rounded positions, so that rounding errors do not accumulate.
    let positions_m = samples(flown, POSITION_HZ).map(|(_, position_m)| position_m);
    let rounded: Vec<_> =
        positions_m.map(|position_m| (position_m * ROUNDING_PER_M).map(f64::round)).collect();
    let previous = rounded.first().into_iter().chain(&rounded);
    let steps = previous.zip(&rounded).map(|(a, b)| (b - a) / ROUNDING_PER_M);
    steps.map(|step| json!({ "dx": step.x, "dy": step.z, "dz": step.y })).collect()
}

/// Returns the sRGB color of a drone in each frame, 20 times a second.
fn colors(job: &Job<'_>, flown: &Plan) -> Result<Vec<Value>> {
    let lights = commands(flown, job.light)?;
    let colors = samples(flown, COLOR_HZ).map(|(time_s, _)| {
        // A change is shown by the nearest frame, within half a period.
        let latest = lights.iter().rfind(|c| c.time_s <= time_s + 0.5 / COLOR_HZ);
        let [r, g, b] = latest.map_or([0; 3], |command| screen_rgb(command, job.light));
        json!({ "r": r, "g": g, "b": b })
    });
    Ok(colors.collect())
}

/// Returns the times in s and positions in m of a plan, sampled at `hz` until its end.
fn samples(plan: &Plan, hz: f64) -> impl Iterator<Item = (f64, Vector3<f64>)> {
    #[expect(clippy::cast_possible_truncation, reason = "an hour at most")]
    let n = (plan.duration_s() * hz).ceil() as u32;
    (0..=n).map(move |sample| {
        let time_s = f64::from(sample) / hz;
        (time_s, plan.design_m(time_s.min(plan.duration_s())))
    })
}
