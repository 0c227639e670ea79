//! Returns the flight of an onboard trajectory as a plan for the simulator.
//!
//! Scripts upload one trajectory from floor to floor ([`Timeline`]), and land at its end.

use nalgebra::Vector3;

use super::compressed::Compressed;
use super::pieces::{Polynomials, Stretch, motion};
use super::poly4d::Poly4d;
use super::timeline::{Timeline, earliest_s};
use noctograph_core::crazyflie::Release;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::table::on_grid;
use noctograph_core::settings::settings;
use noctograph_plan::{Plan, PlanData, Setpoint, conflict};

/// Time step of the plan, s, equal to the period of the onboard commander.
const STEP_S: f64 = 0.01;
/// Maximum difference between times that count as equal, s.
const SAME_TIME_S: f64 = 1e-6;
/// Steps of the finite differences for velocity and acceleration, and for the jerk, s. All points
/// are then within a millisecond, because pieces end at whole milliseconds.
const DIFFERENCE_S: f64 = 5e-4;
const JERK_DIFFERENCE_S: f64 = 1e-3 / 3.0;

settings! {
    /// Form of an onboard trajectory.
    pub enum Form {
        /// Bézier curves in whole millimeters.
        "compressed" => Compressed,
        /// Polynomials of degree 7.
        "poly4d" => Poly4d,
    }
}

impl Form {
    /// Returns the default distance from the design, m. It is larger for polynomials of degree 7,
    /// which require more memory for the same accuracy.
    pub fn tolerance_m(self) -> f64 {
        match self {
            Self::Compressed => 0.002,
            Self::Poly4d => 0.005,
        }
    }
}

/// Maximum length of trajectories.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// Up to the capacity of the memory on board.
    OnBoard,
    /// Any length, for drones with more memory.
    Any,
}

/// Returns the plans that a release flies with onboard trajectories, which all start together. Time
/// zero is the take-off command.
///
/// # Errors
///
/// Returns the errors of [`Compressed::encode`] and [`Poly4d::fit`]. Returns [`Error::Infeasible`]
/// if, with onboard trajectories, a drone hovering at its start is too close to another's path.
pub fn flown(
    release: Release,
    plans: &[Plan],
    form: Form,
    tolerance_m: f64,
    length: Length,
) -> Result<Vec<Plan>> {
    let first_start_s = earliest_s(plans)?;
    let flown = plans.iter().map(|plan| {
        let pieces = pieces(release, plan, form, tolerance_m, length)?;
        flown_alone(plan, first_start_s, |time_s| motion(&pieces, time_s)[0])
    });
    let flown: Vec<Plan> = flown.collect::<Result<_>>()?;
    // In the plans no drone waits in the air, so the distances have to be checked again.
    let mut pairs =
        flown.iter().enumerate().flat_map(|(i, a)| flown[i + 1..].iter().map(move |b| (a, b)));
    let near = pairs.find_map(|(a, b)| conflict(a, b)).filter(|_| length == Length::OnBoard);
    let Some(near) = near else { return Ok(flown) };
    Err(Error::infeasible(
        format!(
            "with trajectories on board, two drones come within {:.2} m at {:.1} s, because one of \
             them waits for its turn in the air",
            near.horizontal_m, near.time_s
        ),
        "send setpoints, or divide the word among fewer drones",
    ))
}

/// Checks that plans' trajectories fit in the onboard memory, and that a release can fly them.
///
/// # Errors
///
/// Returns the errors of [`Compressed::encode`] and [`Poly4d::fit`].
pub fn check_memory(release: Release, plans: &[Plan], form: Form, tolerance_m: f64) -> Result<()> {
    let fits = |plan| pieces(release, plan, form, tolerance_m, Length::OnBoard).map(drop);
    plans.iter().try_for_each(fits)
}

/// Returns the pieces of a plan's trajectory, each at most `tolerance_m` from the design. Returns
/// the errors of [`Compressed::encode`] or [`Poly4d::fit`].
pub(super) fn pieces(
    release: Release,
    plan: &Plan,
    form: Form,
    tolerance_m: f64,
    length: Length,
) -> Result<Vec<Polynomials>> {
    Ok(match (form, length) {
        (Form::Compressed, Length::OnBoard) => {
            Compressed::encode(release, plan, tolerance_m)?.polynomials()
        }
        (Form::Compressed, Length::Any) => {
            Compressed::of_any_length(&Stretch::new(plan)?, tolerance_m)?.polynomials()
        }
        (Form::Poly4d, Length::OnBoard) => Poly4d::fit(release, plan, tolerance_m)?.pieces,
        (Form::Poly4d, Length::Any) => Poly4d::fit_any_length(plan, tolerance_m)?.pieces,
    })
}

/// Returns the plan that a drone flies with an onboard trajectory, regardless of other drones.
/// `first_start_s` is the start of the first of all trajectories by the plans' clock.
/// `trajectory_m` returns the trajectory's position at a time in s since its start.
fn flown_alone(
    plan: &Plan,
    first_start_s: f64,
    trajectory_m: impl Fn(f64) -> Vector3<f64>,
) -> Result<Plan> {
    let stretch = Stretch::new(plan)?;
    let ends_m = [trajectory_m(0.0), trajectory_m(stretch.duration_s())];
    let timeline = Timeline::new(plan, &stretch, first_start_s, ends_m);
    let lit = plan.lit();
    let mut out = PlanData { yaw_rad: plan.yaw_rad, ..PlanData::default() };
    for time_s in sample_times_s(plan, &timeline) {
        // Lights and letter are those of the plan's last setpoint. Before the first, lights are
        // dark.
        let plan_time_s = time_s + timeline.zero_s + SAME_TIME_S;
        let row = plan.setpoints.partition_point(|s| s.time_s <= plan_time_s).checked_sub(1);
        out.lit.push(row.map_or(0.0, |row| lit[row]));
        for (channel, levels) in &plan.lights {
            let level = row.map_or(0.0, |row| levels[row]);
            out.lights.entry(channel.clone()).or_default().push(level);
        }
        let [position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3] =
            derivatives(time_s, |time_s| timeline.position_m(time_s, &trajectory_m));
        out.jerk_m_s3.push(jerk_m_s3.map(on_grid));
        let letter = row.and_then(|row| plan.setpoints[row].letter);
        let setpoint = Setpoint { time_s, position_m, velocity_m_s, acceleration_m_s2, letter };
        out.setpoints.push(setpoint);
    }
    Plan::new(out)
}

/// Returns the times of a flown plan in s since take-off: uniform steps, and the times of light
/// changes.
fn sample_times_s(plan: &Plan, timeline: &Timeline) -> Vec<f64> {
    let end_s = timeline.after[1].time_s;
    #[expect(clippy::cast_possible_truncation, reason = "an hour at most")]
    let steps = (end_s / STEP_S).ceil() as u32;
    let mut times_s: Vec<f64> = (0..=steps).map(|step| f64::from(step) * STEP_S).collect();
    let changes_s = plan.setpoints.iter().map(|setpoint| setpoint.time_s - timeline.zero_s);
    times_s.extend(changes_s.filter(|time_s| *time_s > 0.0 && *time_s < end_s));
    times_s.sort_by(f64::total_cmp);
    times_s.dedup_by(|b, a| *b - *a < SAME_TIME_S);
    times_s
}

/// Returns position in m, velocity in m/s, acceleration in m/s² and jerk in m/s³ of a path at
/// `time_s`.
fn derivatives(time_s: f64, position_m: impl Fn(f64) -> Vector3<f64>) -> [Vector3<f64>; 4] {
    // Forward differences are used, because a piece may begin here. The velocity is (4b - 3a - c) /
    // 2h, of second order, the acceleration (a - 2b + c) / h², and the jerk the third difference.
    let [h, k] = [DIFFERENCE_S, JERK_DIFFERENCE_S];
    let [a, b, c] = [time_s, time_s + h, time_s + 2.0 * h].map(&position_m);
    let [j0, j1, j2, j3] = [0.0, 1.0, 2.0, 3.0].map(|step| position_m(time_s + step * k));
    let jerk_m_s3 = (3.0 * (j1 - j2) + j3 - j0) / (k * k * k);
    [a, (4.0 * b - 3.0 * a - c) / (2.0 * h), (a - 2.0 * b + c) / (h * h), jerk_m_s3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};

    fn planned(word: &str) -> Plan {
        plan(&write(word, &LetterOptions::default()).unwrap(), &PlanOptions::even()).unwrap()
    }

    /// Returns a plan shifted in time and to the right.
    fn moved(plan: &Plan, later_s: f64, right_m: f64) -> Plan {
        let mut plan = plan.clone();
        plan.edit(|plan| {
            for setpoint in &mut plan.setpoints {
                setpoint.time_s += later_s;
                setpoint.position_m.x += right_m;
            }
        });
        plan
    }

    fn flown_of(plans: &[Plan]) -> Vec<Plan> {
        flown(Release::MODELED, plans, Form::Compressed, 0.002, Length::OnBoard).unwrap()
    }

    /// Returns the index of a plan's setpoint at a time.
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
            // Within a piece they agree. A wrong sign of the acceleration would add 8 mm/s.
            assert!(mean_off_m_s < 0.002, "{mean_off_m_s} m/s");
        }
    }

    #[test]
    fn the_jerk_of_a_flown_plan_is_how_its_acceleration_changes() {
        for plan in flown_of(&[planned("NO")]) {
            assert_eq!(plan.jerk_m_s3.len(), plan.setpoints.len());
            let (mut changes, mut n) = (Vec::new(), 0.0);
            for (row, pair) in plan.setpoints.windows(2).enumerate() {
                let step_s = pair[1].time_s - pair[0].time_s;
                let changed = pair[1].acceleration_m_s2 - pair[0].acceleration_m_s2;
                let told = (plan.jerk_m_s3[row] + plan.jerk_m_s3[row + 1]) * (0.5 * step_s);
                changes.push((changed - told).norm());
                n += f64::from(u8::from(changed.norm() > 0.01));
            }
            changes.sort_by(f64::total_cmp);
            // The changes are compared within a piece.
            let most = changes[changes.len() * 8 / 10];
            assert!(most < 2e-3 && n > 100.0, "{most} m/s2, {n}");
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
        let of_length = |length| flown(Release::MODELED, &near, Form::Compressed, 0.002, length);
        let error = of_length(Length::OnBoard).unwrap_err();
        assert!(error.to_string().contains("two drones come within 0."), "{error}");
        assert!(error.hint().contains("fewer drones"), "{}", error.hint());
        assert!(of_length(Length::Any).is_ok(), "a show is not flown");
    }
}
