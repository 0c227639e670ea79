//! The flight of a trajectory on board as a plan, so that the simulator flies what was exported.
//!
//! Scripts upload one trajectory from the floor to the floor ([`Timeline`]): take-off, the way to
//! the first letter, the letters, and a landing for a drone that hears nothing more. The script's
//! own landing comes before that one. Legs from rest to rest are polynomials of degree 7, as those
//! of the firmware's high-level commander.

use nalgebra::Vector3;

use super::compressed::Compressed;
use super::pieces::{Polynomials, Stretch, motion};
use super::poly4d::Poly4d;
use super::safety::SINK_M_S;
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;
use noctograph_flying::plan::{Plan, Setpoint, conflict};

/// Duration of the take-off, and of the way to the first letter, s; as in `cflib.py`.
const TAKE_OFF_S: f64 = 3.5;
/// Hover before the script lands, s.
const HOVER_S: f64 = 0.5;
/// Hover after the time at which the script lands, s: then the trajectory lands by itself.
const ALONE_S: f64 = 3.0;
/// Depth below the floor at which that landing ends, which keeps the drone there, m.
const BELOW_FLOOR_M: f64 = 0.1;
/// Shortest landing, s.
const MIN_LAND_S: f64 = 2.0;
/// Time between two setpoints of the plan, s: the commander on board computes as often.
const STEP_S: f64 = 0.01;
/// Step of the differences for velocity and acceleration, s.
const DIFFERENCE_S: f64 = 5e-4;

settings! {
    /// A trajectory that is stored on board.
    pub enum Form {
        /// Bézier curves of whole millimeters.
        "compressed" => Compressed,
        /// Polynomials of degree 7.
        "poly4d" => Poly4d,
    }
}

impl Form {
    /// Distance from the design that each form is exported within, unless another is asked for, m:
    /// polynomials of degree 7 need more memory for the same.
    #[must_use]
    pub fn tolerance_m(self) -> f64 {
        match self {
            Self::Compressed => 0.002,
            Self::Poly4d => 0.005,
        }
    }
}

/// Length of trajectories.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// Up to what the memory on board holds.
    OnBoard,
    /// Any, for drones with more memory.
    Any,
}

/// Plans as they are flown with trajectories that all start together. Time zero is the command to
/// take off.
///
/// # Errors
///
/// As [`Compressed::encode`] and [`Poly4d::fit`]; [`Error::Infeasible`] where a drone that hovers
/// at its beginning is in another one's way, of trajectories on board.
pub fn flown(plans: &[Plan], form: Form, tolerance_m: f64, length: Length) -> Result<Vec<Plan>> {
    let before_s = earliest_s(plans)?;
    let flown = plans.iter().map(|plan| {
        let pieces = pieces(plan, form, tolerance_m, length)?;
        flown_alone(plan, before_s, |time_s| motion(&pieces, time_s)[0])
    });
    let flown: Vec<Plan> = flown.collect::<Result<_>>()?;
    let mut pairs =
        flown.iter().enumerate().flat_map(|(i, a)| flown[i + 1..].iter().map(move |b| (a, b)));
    let near = pairs.find_map(|(a, b)| conflict(a, b)).filter(|_| length == Length::OnBoard);
    let Some(near) = near else { return Ok(flown) };
    Err(Error::Infeasible {
        what: format!(
            "with trajectories on board two drones come within {:.2} m at {:.1} s, as one waits \
             for its turn in the air",
            near.horizontal_m, near.time_s
        ),
        hint: "send setpoints, or share the word among fewer drones".into(),
    })
}

/// The pieces of a plan's trajectory.
pub(super) fn pieces(
    plan: &Plan,
    form: Form,
    tolerance_m: f64,
    length: Length,
) -> Result<Vec<Polynomials>> {
    Ok(match (form, length) {
        (Form::Compressed, Length::OnBoard) => Compressed::encode(plan, tolerance_m)?.polynomials(),
        (Form::Compressed, Length::Any) => {
            Compressed::of_any_length(&Stretch::new(plan)?, tolerance_m)?.polynomials()
        }
        (Form::Poly4d, Length::OnBoard) => Poly4d::fit(plan, tolerance_m)?.pieces,
        (Form::Poly4d, Length::Any) => Poly4d::fit_any_length(plan, tolerance_m)?.pieces,
    })
}

/// The command to take off before trajectories of which the first starts at a time, in the time of
/// their plans, s.
pub(super) fn zero_s(before_s: f64) -> f64 {
    before_s - 2.0 * TAKE_OFF_S
}

/// When the first of several trajectories starts, in the time of their plans, s.
///
/// # Errors
///
/// As [`Stretch::new`].
pub(super) fn earliest_s(plans: &[Plan]) -> Result<f64> {
    let starts = plans.iter().map(|plan| Ok(Stretch::new(plan)?.start_s()));
    Ok(starts.collect::<Result<Vec<f64>>>()?.into_iter().fold(f64::INFINITY, f64::min))
}

/// A leg from rest to rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// The axes that move.
    pub(super) axes: &'static [usize],
    pub(super) duration_s: f64,
    pub(super) ends_m: [Vector3<f64>; 2],
}

const UP: &[usize] = &[2];
/// Both, even where the plan's ends are the same: a drone that stands beside the plan's start flies
/// there.
const LEVEL: &[usize] = &[0, 1];
const HOVER: &[usize] = &[];

/// When a drone with a trajectory on board is where; time zero is the start of the trajectory.
pub(super) struct Timeline {
    /// That command in the time of the plan, s.
    pub(super) zero_s: f64,
    /// Rest to rest before the trajectory, and after it: end, s, and place.
    pub(super) before: [(f64, Vector3<f64>); 4],
    pub(super) after: [(f64, Vector3<f64>); 2],
}

impl Timeline {
    /// The flight around a trajectory from `first_m` to `last_m`.
    pub(super) fn new(
        plan: &Plan,
        stretch: &Stretch,
        before_s: f64,
        [first_m, last_m]: [Vector3<f64>; 2],
    ) -> Self {
        let home_m = plan.setpoints[0].position_m;
        let above_m = Vector3::new(home_m.x, home_m.y, first_m.z);
        let zero_s = zero_s(before_s);
        let start_s = stretch.start_s() - zero_s;
        let hover_s = start_s + stretch.duration_s() + HOVER_S;
        let land_s = (last_m.z / SINK_M_S).max(MIN_LAND_S);
        Self {
            zero_s,
            before: [
                (0.0, Vector3::new(home_m.x, home_m.y, 0.0)),
                (TAKE_OFF_S, above_m),
                (2.0 * TAKE_OFF_S, first_m),
                (start_s, first_m),
            ],
            after: [(hover_s, last_m), (hover_s + land_s, Vector3::new(last_m.x, last_m.y, 0.0))],
        }
    }

    /// The legs from the floor to the beginning of the trajectory.
    pub(super) fn legs_before(&self) -> [Leg; 3] {
        [(0, UP), (1, LEVEL), (2, HOVER)].map(|(index, axes)| {
            let [from, to] = [self.before[index], self.before[index + 1]];
            Leg { axes, duration_s: to.0 - from.0, ends_m: [from.1, to.1] }
        })
    }

    /// The legs after the trajectory of a drone that is told nothing more, where the script lands
    /// `over_s` after the trajectory's end.
    pub(super) fn legs_alone(&self, over_s: f64) -> [Leg; 2] {
        let last_m = self.after[0].1;
        let below_m = Vector3::new(last_m.x, last_m.y, -BELOW_FLOOR_M);
        let sinks_s = ((last_m.z + BELOW_FLOOR_M) / SINK_M_S).max(MIN_LAND_S);
        let hovers_s = over_s.max(0.0) + ALONE_S;
        [
            Leg { axes: HOVER, duration_s: hovers_s, ends_m: [last_m; 2] },
            Leg { axes: UP, duration_s: sinks_s, ends_m: [last_m, below_m] },
        ]
    }

    fn position_m(&self, time_s: f64, trajectory_m: impl Fn(f64) -> Vector3<f64>) -> Vector3<f64> {
        let start_s = self.before[3].0;
        if (start_s..self.after[0].0).contains(&time_s) {
            return trajectory_m(time_s - start_s);
        }
        let legs: &[_] = if time_s < start_s { &self.before } else { &self.after };
        let leg = legs.windows(2).find(|leg| time_s < leg[1].0).unwrap_or(&legs[legs.len() - 2..]);
        let [(from_s, from_m), (to_s, to_m)] = [leg[0], leg[1]];
        if time_s >= to_s {
            return to_m;
        }
        Polynomials::from_rest_to_rest([from_m, to_m], to_s - from_s).at(time_s - from_s)[0]
    }
}

/// A plan as it is flown with a trajectory, with the trajectory as a function of the time since its
/// start.
fn flown_alone(
    plan: &Plan,
    before_s: f64,
    position_m: impl Fn(f64) -> Vector3<f64>,
) -> Result<Plan> {
    let stretch = Stretch::new(plan)?;
    let ends_m = [position_m(0.0), position_m(stretch.duration_s())];
    let timeline = Timeline::new(plan, &stretch, before_s, ends_m);
    let (zero_s, end_s) = (timeline.zero_s, timeline.after[1].0);
    let way = |time_s: f64| timeline.position_m(time_s, &position_m);
    let mut changes_s: Vec<f64> = plan.setpoints.iter().map(|s| s.time_s - zero_s).collect();
    changes_s.retain(|time_s| *time_s > 0.0 && *time_s < end_s);
    #[expect(clippy::cast_possible_truncation, reason = "an hour at most")]
    let steps = (end_s / STEP_S).ceil() as u32;
    let mut times_s: Vec<f64> = (0..=steps).map(|step| f64::from(step) * STEP_S).collect();
    times_s.extend(changes_s);
    times_s.sort_by(f64::total_cmp);
    times_s.dedup_by(|b, a| *b - *a < 1e-6);
    let lit = plan.lit();
    let mut out = Plan { yaw_rad: plan.yaw_rad, ..Plan::default() };
    for time_s in times_s {
        let row = plan.setpoints.partition_point(|s| s.time_s <= time_s + zero_s + 1e-6);
        let row = row.checked_sub(1);
        out.lit.push(row.map_or(0.0, |row| lit[row]));
        for (channel, levels) in &plan.lights {
            let level = row.map_or(0.0, |row| levels[row]);
            out.lights.entry(channel.clone()).or_default().push(level);
        }
        // Derivatives to the right: a piece may begin here.
        let h = DIFFERENCE_S;
        let [a, b, c] = [time_s, time_s + h, time_s + 2.0 * h].map(way);
        out.setpoints.push(Setpoint {
            time_s,
            position_m: a,
            velocity_m_s: (4.0 * b - 3.0 * a - c) / (2.0 * h),
            acceleration_m_s2: (a - 2.0 * b + c) / (h * h),
            letter: row.and_then(|row| plan.setpoints[row].letter),
        });
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_flying::plan::{PlanOptions, plan};
    use noctograph_letters::{LetterOptions, write};

    fn planned(word: &str) -> Plan {
        plan(&write(word, &LetterOptions::default()).unwrap(), &PlanOptions::even()).unwrap()
    }

    /// A plan that begins later and stands farther to the right.
    fn moved(plan: &Plan, later_s: f64, right_m: f64) -> Plan {
        let mut plan = plan.clone();
        for setpoint in &mut plan.setpoints {
            setpoint.time_s += later_s;
            setpoint.position_m.x += right_m;
        }
        plan
    }

    fn flown_of(plans: &[Plan]) -> Vec<Plan> {
        flown(plans, Form::Compressed, 0.002, Length::OnBoard).unwrap()
    }

    /// The setpoint of a plan at a time.
    fn setpoint_at(plan: &Plan, time_s: f64) -> usize {
        plan.setpoints.partition_point(|s| s.time_s <= time_s + 1e-6) - 1
    }

    #[test]
    fn a_flown_plan_moves_as_its_velocities_and_accelerations_say() {
        for plan in flown_of(&[planned("NO")]) {
            let mut mean_off_m_s = 0.0;
            for pair in plan.setpoints.windows(2) {
                let step_s = pair[1].time_s - pair[0].time_s;
                // An acceleration of 2 m/s² may begin within a step.
                let off_m = (pair[0].design_m(pair[1].time_s) - pair[1].position_m).norm();
                assert!(off_m <= 2.5 * step_s * step_s, "{off_m} m at {} s", pair[0].time_s);
                let off_m_s = (pair[0].velocity_m_s + pair[0].acceleration_m_s2 * step_s
                    - pair[1].velocity_m_s)
                    .norm();
                assert!(off_m_s <= 0.3, "{off_m_s} m/s at {} s", pair[0].time_s);
                mean_off_m_s += off_m_s / plan.setpoints.len() as f64;
            }
            // Where no piece begins they agree: an acceleration of the other sign is 8 mm/s off.
            assert!(mean_off_m_s < 0.002, "{mean_off_m_s} m/s");
        }
    }

    #[test]
    fn a_flown_plan_writes_the_letters_with_their_lights_between_take_off_and_landing() {
        let plan = planned("NO");
        let stretch = Stretch::new(&plan).unwrap();
        let flown = &flown_of(std::slice::from_ref(&plan))[0];
        let zero_s = stretch.start_s() - 7.0;
        let (lit, flown_lit) = (plan.lit(), flown.lit());
        for (row, setpoint) in plan.setpoints.iter().enumerate().filter(|(_, s)| s.letter.is_some())
        {
            let there = setpoint_at(flown, setpoint.time_s - zero_s);
            let off_m = (flown.setpoints[there].position_m - setpoint.position_m).norm();
            assert!(off_m < 0.004, "{off_m} m at {} s", setpoint.time_s);
            assert_eq!(flown.setpoints[there].letter, setpoint.letter);
            assert_eq!(flown_lit[there], lit[row], "lit at {} s", setpoint.time_s);
            for (channel, levels) in &plan.lights {
                assert_eq!(flown.lights[channel][there], levels[row], "{channel}");
            }
        }
        assert!(flown_lit.iter().any(|lit| *lit > 0.0) && flown_lit[0] == 0.0);
        let [first, last] = [0, flown.setpoints.len() - 1].map(|row| flown.setpoints[row]);
        let home_m = plan.setpoints[0].position_m;
        assert_eq!(first.position_m, Vector3::new(home_m.x, home_m.y, 0.0));
        let end_m = stretch.setpoints[stretch.last()].position_m;
        assert!((last.position_m - Vector3::new(end_m.x, end_m.y, 0.0)).norm() < 0.001, "{last:?}");
        assert_eq!(last.position_m.z, 0.0, "on the floor");
        let lasts_s = 7.0 + stretch.duration_s() + 0.5 + f64::max(end_m.z / 0.3, 2.0);
        assert!((last.time_s - lasts_s).abs() < 0.02, "{} s instead of {lasts_s} s", last.time_s);
        let hovers = &flown.setpoints[setpoint_at(flown, 7.0 + stretch.duration_s() + 0.45)];
        assert!((hovers.position_m - end_m).norm() < 0.001, "it hovers before it lands");
    }

    #[test]
    fn drones_take_off_together_and_each_waits_for_its_turn() {
        let one = planned("I");
        let two = moved(&one, 3.0, 1.5);
        let both = flown_of(&[two.clone(), one.clone()]);
        let first_m = Stretch::new(&two).unwrap().setpoints[0].position_m;
        let there_m = |time_s: f64| both[0].setpoints[setpoint_at(&both[0], time_s)].position_m;
        assert!((there_m(7.0) - first_m).norm() < 0.001 && (there_m(9.9) - first_m).norm() < 0.001);
        assert!((there_m(11.0) - first_m).norm() > 0.05, "and writes from 10 s on");
        assert!(both[1].duration_s() + 2.9 < both[0].duration_s(), "the other one has not waited");
        let near = [one.clone(), moved(&one, 3.0, 0.2)];
        let error = flown(&near, Form::Compressed, 0.002, Length::OnBoard).unwrap_err();
        assert!(error.to_string().contains("two drones come within 0."), "{error}");
        assert!(error.hint().contains("fewer drones"), "{}", error.hint());
        assert!(flown(&near, Form::Compressed, 0.002, Length::Any).is_ok(), "a show is not flown");
    }

    #[test]
    fn without_a_link_a_drone_hovers_and_lands_where_it_is_below_the_floor() {
        let plan = planned("I");
        let stretch = Stretch::new(&plan).unwrap();
        let [first_m, last_m] = [Vector3::new(0.0, 0.0, 0.9), Vector3::new(1.0, 0.2, 1.1)];
        let timeline = Timeline::new(&plan, &stretch, stretch.start_s(), [first_m, last_m]);
        let [hover, descent] = timeline.legs_alone(0.5);
        assert_eq!((hover.duration_s, hover.ends_m), (3.5, [last_m; 2]));
        assert_eq!(descent.ends_m, [last_m, Vector3::new(1.0, 0.2, -0.1)]);
        assert!((descent.duration_s - 4.0).abs() < 1e-9, "1.2 m at 0.3 m/s: {descent:?}");
        assert_eq!(timeline.legs_alone(-9.0)[0].duration_s, 3.0, "the script lands before the end");
        let low = Timeline::new(&plan, &stretch, 0.0, [first_m, Vector3::new(0.0, 0.0, 0.2)]);
        assert_eq!(low.legs_alone(0.0)[1].duration_s, 2.0, "no faster than any landing");
        assert_eq!(low.after[1].0 - low.after[0].0, 2.0);
    }
}
