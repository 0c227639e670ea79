//! Path of a lamp while it is lit, from its levels and the flight.
//!
//! Poses are thinned once for all lamps (swinging-door thinning, Bristol 1990).

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};

use super::radio::Change;
use super::{Fixture, LightSample};
use noctograph_core::flight::FlightSample;
use noctograph_core::geometry::Chords;

/// Pose of the drone's body at one sample of the flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    time_s: f64,
    position_m: Vector3<f64>,
    world_from_body: Matrix3<f64>,
}

/// Minimum tolerance of the path of a lamp that cycles through colors, such as a spinner's LED.
pub(super) const COARSE_M: f64 = 60e-6;

/// Lever arm of a lamp on the body: the sum of its distances from the center along the three axes.
const ARM_M: f64 = 0.07;

/// Returns the poses of each stretch of a flight, thinned within a tolerance. The motion between
/// two poses is straight and at constant speed.
pub(super) fn stretches(samples: &[Cow<'_, [FlightSample]>], tolerance_m: f64) -> Vec<Vec<Pose>> {
    samples.iter().map(|stretch| poses(stretch, tolerance_m)).collect()
}

/// Reduces the poses of a stretch to the ends of segments that are straight within a tolerance.
fn poses(samples: &[FlightSample], tolerance_m: f64) -> Vec<Pose> {
    let mut kept: Vec<Pose> = Vec::new();
    let mut run: Option<Straight> = None;
    for sample in samples {
        let pose = Pose {
            time_s: sample.time_s,
            position_m: sample.position_m,
            world_from_body: sample.attitude.world_from_body(),
        };
        let Some(current) = &mut run else {
            kept.push(pose);
            run = Some(Straight::new(pose, pose));
            continue;
        };
        // The last pose of a run ends it and starts the next one.
        if !current.extend(&pose, tolerance_m) {
            kept.push(current.last);
            *current = Straight::new(current.last, pose);
        }
    }
    kept.extend(run.filter(|run| run.last.time_s > run.first.time_s).map(|run| run.last));
    kept
}

/// The poses that one straight segment has replaced so far.
struct Straight {
    first: Pose,
    last: Pose,
    chords: Chords<12>,
}

impl Straight {
    /// Starts a run with two poses, between which the motion is always straight.
    fn new(first: Pose, last: Pose) -> Self {
        Self { first, last, chords: Chords::ALL }
    }

    /// Extends the run to the next pose. If the run would not stay straight within `tolerance_m`,
    /// returns false and leaves it unchanged.
    fn extend(&mut self, next: &Pose, tolerance_m: f64) -> bool {
        // On each of 3 axes, half of the tolerance is for the position and half for the rotation.
        let slack_m = 0.5 * tolerance_m / 3.0_f64.sqrt();
        let skipped_s = self.last.time_s - self.first.time_s;
        if skipped_s > 0.0 {
            // If the run continues, its last pose is skipped and limits the chord's rates.
            let skipped_m = self.last.lengths_from(&self.first);
            let [low, high] = [-slack_m, slack_m].map(|m| skipped_m.map(|length_m| length_m + m));
            self.chords.keep_between(low, high, skipped_s);
            let offset_m = next.lengths_from(&self.first);
            if !self.chords.contain(offset_m, next.time_s - self.first.time_s) {
                return false;
            }
        }
        self.last = *next;
        true
    }
}

impl Pose {
    /// Returns the differences from another pose in m: three coordinates, followed by the nine
    /// entries of the rotation matrix times the lever arm.
    fn lengths_from(&self, other: &Self) -> [f64; 12] {
        std::array::from_fn(|i| match i.checked_sub(3) {
            None => self.position_m[i] - other.position_m[i],
            Some(k) => self.world_from_body[k] * ARM_M - other.world_from_body[k] * ARM_M,
        })
    }
}

/// Returns the samples of a lamp over a flight. Each lit run starts and ends at level 0. The lamp
/// is dark between two stretches, because its path is unknown in between.
pub(super) fn shine(
    stretches: &[Vec<Pose>],
    fixture: &Fixture,
    changes: &[Change],
) -> Vec<LightSample> {
    let knots = knots(changes);
    let mount = Mount::new(fixture);
    let mut samples = Vec::new();
    // Knots before index `next` are in the past.
    let mut next = 0;
    for poses in stretches {
        let start = samples.len();
        shine_along(poses, &mount, &knots, &mut next, &mut samples);
        if let Some(first) = samples.get(start).copied().filter(|first| first.level > 0.0) {
            samples.insert(start, LightSample { level: 0.0, ..first });
        }
        if let Some(last) = samples.last().copied().filter(|last| last.level > 0.0) {
            samples.push(LightSample { level: 0.0, ..last });
        }
    }
    samples
}

/// Appends the samples of a lamp over one stretch. Knots in the gap before the stretch take effect
/// at its start. `next` is the index of the first knot that is not in the past, and is advanced.
fn shine_along(
    poses: &[Pose],
    mount: &Mount,
    knots: &[Change],
    next: &mut usize,
    samples: &mut Vec<LightSample>,
) {
    let mut previous: Option<&Pose> = None;
    for pose in poses {
        let first = *next;
        while knots.get(*next).is_some_and(|knot| knot.time_s <= pose.time_s) {
            *next += 1;
        }
        // Adds a sample at each knot since the previous pose, and then one at this pose.
        if first < *next {
            let end = mount.dark_sample(pose);
            let start = previous.map_or(end, |previous| mount.dark_sample(previous));
            for index in first..*next {
                // Skips knots unless the lamp is lit at, just before or just after them.
                let neighbors = &knots[index.saturating_sub(1)..(index + 2).min(knots.len())];
                if neighbors.iter().any(|knot| knot.level > 0.0) {
                    let Change { time_s, level } = knots[index];
                    samples.push(LightSample { level, ..between(start, end, time_s) });
                }
            }
        }
        let level = level_at(knots, *next, pose.time_s);
        let is_at_knot = *next > 0 && knots[*next - 1].time_s == pose.time_s;
        if level > 0.0 && !is_at_knot {
            samples.push(LightSample { level, ..mount.dark_sample(pose) });
        }
        previous = Some(pose);
    }
}

/// Returns the changes of a level as knots with linear interpolation. Every change is a step, made
/// of two knots at the same time, because LEDs switch in less than 1 µs.
fn knots(changes: &[Change]) -> Vec<Change> {
    let mut level = 0.0;
    let mut knots: Vec<Change> = Vec::with_capacity(2 * changes.len());
    for change in changes {
        if change.level != level {
            knots.extend([Change { level, ..*change }, *change]);
            level = change.level;
        }
    }
    knots
}

/// Returns the level, 0 to 1, at `time_s`, which is between the knots before `next` and the others.
fn level_at(knots: &[Change], next: usize, time_s: f64) -> f64 {
    let Some(last) = next.checked_sub(1).map(|index| knots[index]) else { return 0.0 };
    match knots.get(next) {
        Some(after) if after.level != last.level => {
            let fraction = (time_s - last.time_s) / (after.time_s - last.time_s);
            last.level + (after.level - last.level) * fraction
        }
        _ => last.level,
    }
}

/// Position and axis of a lamp in the body frame.
struct Mount {
    position_m: Vector3<f64>,
    axis: Vector3<f64>,
}

impl Mount {
    /// Returns the position and the normalized axis of a fixture in the body frame.
    fn new(fixture: &Fixture) -> Self {
        let axis = Vector3::from(fixture.axis_body).normalize();
        Self { position_m: fixture.position_body_m.into(), axis }
    }

    /// Returns the position and axis of the lamp at a pose, with a level of 0.
    fn dark_sample(&self, pose: &Pose) -> LightSample {
        LightSample {
            time_s: pose.time_s,
            position_m: pose.position_m + pose.world_from_body * self.position_m,
            axis: pose.world_from_body * self.axis,
            level: 0.0,
        }
    }
}

/// Returns the position and axis of a lamp, interpolated at `time_s`, with a level of 0. The time
/// is clamped to those of the samples.
fn between(a: LightSample, b: LightSample, time_s: f64) -> LightSample {
    let span_s = b.time_s - a.time_s;
    let fraction = if span_s > 0.0 { ((time_s - a.time_s) / span_s).clamp(0.0, 1.0) } else { 1.0 };
    LightSample {
        time_s: time_s.clamp(a.time_s, b.time_s),
        position_m: a.position_m.lerp(&b.position_m, fraction),
        axis: a.axis.lerp(&b.axis, fraction).normalize(),
        level: 0.0,
    }
}
