//! Timing of a flight with an onboard trajectory, from take-off to landing.
//!
//! The flight consists of take-off, the path to the first letter, a hover until the drone's turn,
//! the letters, and a hover and a landing in case the radio link is lost. Otherwise the script
//! lands earlier. Segments from rest to rest are polynomials of degree 7, like those of the
//! firmware's high-level commander.

use nalgebra::Vector3;

use super::pieces::{Polynomials, Stretch};
use super::safety::SINK_M_S;
use noctograph_core::error::Result;
use noctograph_plan::Plan;

/// Duration of the take-off, and of the path to the first letter, s, as in `cflib.py`.
const TAKE_OFF_S: f64 = 3.5;
/// Duration of the hover before the script lands, s.
const HOVER_S: f64 = 0.5;
/// Duration of the hover after the script's landing time, s, after which the trajectory lands by
/// itself.
const WITHOUT_LINK_S: f64 = 3.0;
/// Depth below the floor at which a landing without a script ends, m. A goal below the floor keeps
/// the drone on the floor.
const BELOW_FLOOR_M: f64 = 0.1;
/// Minimum duration of a landing, s.
const MIN_LAND_S: f64 = 2.0;

/// Returns the time of the take-off command if the first trajectory starts at `first_start_s`, both
/// by the plans' clock, s.
pub(super) fn zero_s(first_start_s: f64) -> f64 {
    first_start_s - 2.0 * TAKE_OFF_S
}

/// Returns the time, by the plans' clock, at which the first of several trajectories starts, s.
pub(super) fn earliest_s(plans: &[Plan]) -> Result<f64> {
    let starts = plans.iter().map(|plan| Ok(Stretch::new(plan)?.start_s()));
    Ok(starts.collect::<Result<Vec<f64>>>()?.into_iter().fold(f64::INFINITY, f64::min))
}

/// A motion from rest to rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// Indices of the axes that move.
    pub(super) axes: &'static [usize],
    pub(super) duration_s: f64,
    pub(super) ends_m: [Vector3<f64>; 2],
}

/// Axis of a vertical motion.
const UP: &[usize] = &[2];
/// Both horizontal axes move even if the ends are equal, so that a drone slightly away from the
/// plan's start flies there.
const LEVEL: &[usize] = &[0, 1];
/// A hovering drone moves on no axis.
const HOVER: &[usize] = &[];

/// Time and position at which a drone is at rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// Time since the take-off command, s.
    pub(super) time_s: f64,
    pub(super) position_m: Vector3<f64>,
}

/// Times and positions of a drone with an onboard trajectory. Time zero is the take-off command.
pub(super) struct Timeline {
    /// Time of the take-off command by the plan's clock, s.
    pub(super) zero_s: f64,
    /// Positions of rest before the trajectory: floor, hover above it, first letter, trajectory's
    /// start.
    pub(super) before: [Rest; 4],
    /// Positions of rest after the trajectory: the end of a hover, and the floor.
    pub(super) after: [Rest; 2],
}

impl Timeline {
    /// Computes the timeline around a trajectory from `first_m` to `last_m`. `first_start_s` is the
    /// start of the first of all drones' trajectories by the plans' clock.
    pub(super) fn new(
        plan: &Plan,
        stretch: &Stretch,
        first_start_s: f64,
        [first_m, last_m]: [Vector3<f64>; 2],
    ) -> Self {
        // The drone flies straight up, then level to the first letter, and hovers until its turn.
        let home_m = plan.setpoints[0].position_m;
        let above_m = Vector3::new(home_m.x, home_m.y, first_m.z);
        let zero_s = zero_s(first_start_s);
        let start_s = stretch.start_s() - zero_s;
        let hover_s = start_s + stretch.duration_s() + HOVER_S;
        let land_s = (last_m.z / SINK_M_S).max(MIN_LAND_S);
        let rest = |time_s, position_m| Rest { time_s, position_m };
        Self {
            zero_s,
            before: [
                rest(0.0, Vector3::new(home_m.x, home_m.y, 0.0)),
                rest(TAKE_OFF_S, above_m),
                rest(2.0 * TAKE_OFF_S, first_m),
                rest(start_s, first_m),
            ],
            after: [
                rest(hover_s, last_m),
                rest(hover_s + land_s, Vector3::new(last_m.x, last_m.y, 0.0)),
            ],
        }
    }

    /// Returns the segments from the floor to the start of the trajectory.
    pub(super) fn segments_before(&self) -> [Segment; 3] {
        [(0, UP), (1, LEVEL), (2, HOVER)].map(|(index, axes)| {
            let [from, to] = [self.before[index], self.before[index + 1]];
            let ends_m = [from.position_m, to.position_m];
            Segment { axes, duration_s: to.time_s - from.time_s, ends_m }
        })
    }

    /// Returns the segments after the trajectory for a drone without a radio link: a hover and a
    /// landing. With a link, the script lands before them, `over_s` after the trajectory's end.
    pub(super) fn segments_without_link(&self, over_s: f64) -> [Segment; 2] {
        let last_m = self.after[0].position_m;
        let below_m = Vector3::new(last_m.x, last_m.y, -BELOW_FLOOR_M);
        let landing_s = ((last_m.z + BELOW_FLOOR_M) / SINK_M_S).max(MIN_LAND_S);
        let hover_s = over_s.max(0.0) + WITHOUT_LINK_S;
        [
            Segment { axes: HOVER, duration_s: hover_s, ends_m: [last_m; 2] },
            Segment { axes: UP, duration_s: landing_s, ends_m: [last_m, below_m] },
        ]
    }

    /// Returns the position in m at `time_s` after the take-off command. `trajectory_m` takes the
    /// time in s since the trajectory's start.
    pub(super) fn position_m(
        &self,
        time_s: f64,
        trajectory_m: impl Fn(f64) -> Vector3<f64>,
    ) -> Vector3<f64> {
        let start_s = self.before[3].time_s;
        if (start_s..self.after[0].time_s).contains(&time_s) {
            return trajectory_m(time_s - start_s);
        }
        // Before and after the trajectory the drone flies from rest to rest, or is at rest.
        let rests: &[_] = if time_s < start_s { &self.before } else { &self.after };
        let segment = rests
            .windows(2)
            .find(|segment| time_s < segment[1].time_s)
            .unwrap_or(&rests[rests.len() - 2..]);
        let (from, to) = (segment[0], segment[1]);
        if time_s >= to.time_s {
            return to.position_m;
        }
        let ends_m = [from.position_m, to.position_m];
        Polynomials::from_rest_to_rest(ends_m, to.time_s - from.time_s)
            .evaluate(time_s - from.time_s)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};

    #[test]
    fn without_a_link_a_drone_hovers_and_lands_where_it_is_below_the_floor() {
        let strokes = write("I", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::even()).unwrap();
        let stretch = Stretch::new(&plan).unwrap();
        let [first_m, last_m] = [Vector3::new(0.0, 0.0, 0.9), Vector3::new(1.0, 0.2, 1.1)];
        let timeline = Timeline::new(&plan, &stretch, stretch.start_s(), [first_m, last_m]);
        let [hover, descent] = timeline.segments_without_link(0.5);
        assert_eq!((hover.duration_s, hover.ends_m), (3.5, [last_m; 2]));
        assert_eq!(descent.ends_m, [last_m, Vector3::new(1.0, 0.2, -0.1)]);
        assert!((descent.duration_s - 4.0).abs() < 1e-9, "1.2 m at 0.3 m/s: {descent:?}");
        assert_eq!(
            timeline.segments_without_link(-9.0)[0].duration_s,
            3.0,
            "the script lands before the end"
        );
        let low = Timeline::new(&plan, &stretch, 0.0, [first_m, Vector3::new(0.0, 0.0, 0.2)]);
        assert_eq!(low.segments_without_link(0.0)[1].duration_s, 2.0, "no faster than any landing");
        assert_eq!(low.after[1].time_s - low.after[0].time_s, 2.0);
    }
}
