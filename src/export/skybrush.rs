//! Exports Skybrush shows (`.skyc`), with the photographer's camera.
//!
//! Format: the JSON schema of `.skyc` (`@skybrush/file-formats-doc`). Coordinates are the plan's,
//! in meters. Lights are programs for Skybrush's light player, in steps of 20 ms.

use base64::prelude::{BASE64_STANDARD, Engine};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

use super::compressed::Compressed;
use super::lights::{commands, screen_rgb};
use super::pieces::Stretch;
use super::timeline::{Rest, Timeline, earliest_s};
use super::zip::zip;
use super::{File, Job, ascii, stem};
use noctograph_core::camera::Camera;
use noctograph_core::error::Result;
use noctograph_plan::{MIN_HORIZONTAL_M, Plan};

/// Rate of the steps in a light program.
const LIGHT_HZ: f64 = 50.0;
/// Minimum duration of a trajectory's segment, s. The first drone does not wait for its turn.
const MIN_SEGMENT_S: f64 = 1e-6;
/// Distance of the show's altitude limit above the drones, m.
const HEADROOM_M: f64 = 0.5;
// Commands of a light program.
const END: u8 = 0;
const COLOR: u8 = 4;
const BLACK: u8 = 6;
const WHITE: u8 = 7;
/// Width of the film to which Skybrush's focal lengths refer, mm.
const FILM_MM: f64 = 36.0;

/// Returns the `.skyc` file of a job, which is a zip archive with `show.json`.
pub(super) fn show(job: &Job<'_>) -> Result<File> {
    let first_start_s = earliest_s(job.plans)?;
    let drones =
        job.plans.iter().enumerate().map(|(index, plan)| drone(job, index, plan, first_start_s));
    // The limits for validating the show are such that no drone exceeds them.
    let setpoints = job.plans.iter().flat_map(|plan| &plan.setpoints);
    let level_m_s = setpoints.clone().map(|s| s.velocity_m_s.xy().norm());
    let vertical_m_s = setpoints.clone().map(|s| s.velocity_m_s.z.abs());
    let heights = setpoints.map(|s| s.position_m.z);
    let show = json!({
        "version": 1,
        "environment": { "type": "indoor", "cameras": [camera(job.camera)] },
        "settings": {
            "cues": { "version": 1, "items": [] },
            "validation": {
                "maxAltitude": (heights.fold(0.0, f64::max) + HEADROOM_M).ceil(),
                "maxVelocityXY": level_m_s.fold(1.0, f64::max),
                "maxVelocityZ": vertical_m_s.fold(1.0, f64::max),
                "minDistance": MIN_HORIZONTAL_M,
            },
        },
        "swarm": { "drones": drones.collect::<Result<Vec<_>>>()? },
        "meta": { "title": job.word },
    });
    let file = File::new("show.json", format!("{}\n", ascii(&show)));
    Ok(File { name: format!("{}.skyc", stem(job.word)), bytes: zip(&[file]) })
}

/// Returns a segment from rest to rest in the form of Skybrush: its end's time in s, its end in m,
/// and its control points in m. It has two control points, or none without motion.
fn segment(from_m: Vector3<f64>, to: Rest) -> Value {
    let to_m = to.position_m;
    let control_m = if from_m == to_m { vec![] } else { vec![from_m.as_slice(), to_m.as_slice()] };
    json!([to.time_s, to_m.as_slice(), control_m])
}

/// Returns a drone of a Skybrush show, with trajectory, lights and home. Returns the errors of a
/// trajectory of any length.
fn drone(job: &Job<'_>, index: usize, plan: &Plan, first_start_s: f64) -> Result<Value> {
    let stretch = Stretch::new(plan)?;
    let trajectory = Compressed::of_any_length(&stretch, job.tolerance_m)?;
    let [first_m, last_m] = trajectory.ends_m();
    let timeline = Timeline::new(plan, &stretch, first_start_s, [first_m, last_m]);
    let home_m = timeline.before[0].position_m;
    // The trajectory's Bézier curves are the path to the letters, letters, a hover and the landing.
    let mut points = vec![json!([0.0, home_m.as_slice(), []])];
    let segments =
        timeline.before.windows(2).filter(|ends| ends[1].time_s - ends[0].time_s > MIN_SEGMENT_S);
    points.extend(segments.map(|ends| segment(ends[0].position_m, ends[1])));
    let mut time_s = timeline.before[3].time_s;
    for (duration_s, [_, b, c, d]) in trajectory.curves() {
        time_s += duration_s;
        points.push(json!([time_s, d.as_slice(), [b.as_slice(), c.as_slice()]]));
    }
    points.extend(timeline.after.map(|rest| segment(last_m, rest)));
    // Lights are timed by the flight of the trajectory.
    let lights = commands(&job.flown[index], job.light)?;
    let colors: Vec<(f64, [u8; 3])> =
        lights.iter().map(|command| (command.time_s, screen_rgb(command, job.light))).collect();
    Ok(json!({
        "type": "generic",
        "settings": {
            "name": format!("Drone {}", index + 1),
            "home": home_m.as_slice(),
            "landAt": timeline.after[1].position_m.as_slice(),
            "trajectory": { "version": 1, "points": points, "takeoffTime": 0.0 },
            "lights": { "version": 1, "data": BASE64_STANDARD.encode(program(&colors)) },
            // The heading is in degrees, clockwise from above, starting at the x-axis of the show.
            "yawControl": { "version": 1, "setpoints": [[0.0, -plan.yaw_rad.to_degrees()]] },
        },
    }))
}

/// Encodes the light program of a drone, which is initially dark. Each change consists of a time
/// since the take-off command, s, and the sRGB color from then on.
fn program(changes: &[(f64, [u8; 3])]) -> Vec<u8> {
    let mut colors = vec![(0, [0; 3])];
    for (time_s, color) in changes {
        #[expect(clippy::cast_possible_truncation, reason = "an hour")]
        let step = (time_s * LIGHT_HZ).round() as u64;
        colors.push((step, *color));
    }
    // A color lasts until the next one. If a step contains several colors, the last one is used.
    let mut bytes = Vec::new();
    for (index, &(from, color)) in colors.iter().enumerate() {
        let until = colors.get(index + 1).map_or(from + 1, |next| next.0);
        if until == from {
            continue;
        }
        match color {
            [0, 0, 0] => bytes.push(BLACK),
            [255, 255, 255] => bytes.push(WHITE),
            [r, g, b] => bytes.extend([COLOR, r, g, b]),
        }
        varuint(&mut bytes, until - from);
    }
    bytes.push(END);
    bytes
}

/// Appends a number in 7-bit bytes, the lowest first. If its highest bit is set, another byte
/// follows.
fn varuint(bytes: &mut Vec<u8>, mut value: u64) {
    while value > 127 {
        bytes.push((value & 127) as u8 | 128);
        value >>= 7;
    }
    #[expect(clippy::cast_possible_truncation, reason = "up to 127")]
    bytes.push(value as u8);
}

/// Returns the photographer's camera, with a focal length in mm of film 36 mm wide. An unrotated
/// camera in Skybrush looks along -z with +y up.
fn camera(camera: &Camera) -> Value {
    // This program's camera looks along +z with y down.
    let world_from_camera = camera.camera_from_world.transpose()
        * nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let rotation = Rotation3::from_matrix_unchecked(world_from_camera);
    let q = UnitQuaternion::from_rotation_matrix(&rotation);
    json!({
        "name": "Photographer", "type": "perspective", "default": true,
        "position": camera.position_m.as_slice(),
        "orientation": [q.w, q.i, q.j, q.k],
        "focalLength": FILM_MM * camera.focal_length_m / camera.sensor_width_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_of_lights_are_written_seven_bits_at_a_time() {
        fn bytes(value: u64) -> Vec<u8> {
            let mut bytes = Vec::new();
            varuint(&mut bytes, value);
            bytes
        }
        assert_eq!((bytes(5), bytes(127), bytes(300)), (vec![5], vec![127], vec![0xAC, 2]));
    }

    #[test]
    fn skybrushs_own_player_shows_the_colors() {
        let bytes = program(&[(3.0, [255; 3]), (6.0, [128; 3]), (9.0, [0; 3])]);
        // skybrush.js, packages/show-format/src/lights.ts (17b0cb7), run by Node.js 20, reads all
        // 15 bytes and shows these colors.
        let played = [6, 150, 1, 7, 150, 1, 4, 128, 128, 128, 150, 1, 6, 1, 0];
        assert_eq!(bytes, played);
    }

    #[test]
    fn the_camera_looks_at_the_word() {
        let camera = Camera {
            camera_from_world: nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
            ..noctograph_core::camera::CameraOptions::default()
                .camera([-1.0, 0.5, 1.0, 1.0], 1.0)
                .unwrap()
        };
        let photographer = super::camera(&camera);
        let part = |k: usize| photographer["orientation"][k].as_f64().unwrap();
        let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
            part(0),
            part(1),
            part(2),
            part(3),
        ));
        let ahead = q * -Vector3::z();
        assert!((ahead - Vector3::y()).norm() < 1e-12, "into the scene: {ahead}");
        assert!((q * Vector3::y() - Vector3::z()).norm() < 1e-12, "upright");
    }
}
