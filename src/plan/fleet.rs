//! Fleet: several drones share the strokes of one word, and keep apart in space and time.
//!
//! Each drone takes a stretch of the word from left to right with about as much light as the
//! others. Where two would come too close, the later one waits on the floor until they do not.

use super::order::{as_drawn, is_kept, shortest};
use super::pen::PenStroke;
use super::{EvenStyle, Plan, PlanOptions, Setpoint, Style, adjusted, even};
use crate::error::{Error, Result};
use crate::geometry::bounds;
use crate::letters::Strokes;

/// Least horizontal distance of two drones, unless they are [`MIN_VERTICAL_M`] above each other:
/// the radii of the firmware's collision avoidance (`collision_avoidance.c`: 0.3, 0.3 and 0.9 m).
pub const MIN_HORIZONTAL_M: f64 = 0.3;
/// Reach of the downwash below a drone.
pub const MIN_VERTICAL_M: f64 = 0.9;
/// Steps by which a drone's start is delayed.
const DELAY_STEP_S: f64 = 0.5;
/// Time between two checks of the distance.
const CHECK_STEP_S: f64 = 0.05;

/// Two drones at the moment when they are closest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// When.
    pub time_s: f64,
    /// Horizontal distance.
    pub horizontal_m: f64,
    /// Difference in height.
    pub vertical_m: f64,
}

/// Plans of the drones that write a word together, `options.drones` of them; fewer where there are
/// not as many strokes.
///
/// # Errors
///
/// As [`super::plan()`]; [`Error::Input`] for several drones in style `team`, and
/// [`Error::Infeasible`] where they cannot keep apart.
pub fn fleet(strokes: &Strokes, options: &PlanOptions) -> Result<Vec<Plan>> {
    if options.drones <= 1 {
        return Ok(vec![super::plan(strokes, options)?]);
    }
    options.check()?;
    let Style::Even(style) = &options.style else {
        let found = format!("{} drones in style team", options.drones);
        let hint = "set plan.style = \"even\"";
        return Err(Error::input("plan.drones", found, "one, or style even", hint));
    };
    let mut plans: Vec<Plan> = Vec::new();
    for share in shares(strokes, options, style)? {
        plans.push(adjusted(apart_from(&plans, &share, options, style)?, options));
    }
    Ok(plans)
}

/// The strokes from left to right, in stretches of about equal length, each in its own order.
fn shares(
    strokes: &Strokes,
    options: &PlanOptions,
    style: &EvenStyle,
) -> Result<Vec<Vec<PenStroke>>> {
    let mut all = as_drawn(strokes, options.stroke_speed_m_s)?;
    let kept = is_kept(strokes, style);
    if !kept {
        let sides = |stroke: &PenStroke| extent_x_m(std::slice::from_ref(stroke));
        let middle = |stroke: &PenStroke| sides(stroke)[0] + sides(stroke)[1];
        all.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
    }
    let whole_m: f64 = all.iter().map(PenStroke::length_m).sum();
    let each_m = whole_m / f64::from(options.drones);
    let mut shares: Vec<Vec<PenStroke>> = vec![Vec::new()];
    let mut drawn_m = 0.0;
    for stroke in all {
        let length_m = stroke.length_m();
        let full_m = each_m * shares.len() as f64;
        if drawn_m + 0.5 * length_m > full_m && shares.last().is_some_and(|s| !s.is_empty()) {
            shares.push(Vec::new());
        }
        drawn_m += length_m;
        shares.last_mut().expect("one at least").push(stroke);
    }
    let in_order = |share: Vec<PenStroke>| {
        if kept { share } else { shortest(&share, options.stroke_speed_m_s, style) }
    };
    Ok(shares.into_iter().map(in_order).collect())
}

/// Least and greatest x of strokes.
fn extent_x_m(strokes: &[PenStroke]) -> [f64; 2] {
    let points = strokes.iter().flat_map(|stroke| &stroke.points_m);
    let [left, _, right, _] = bounds(points.map(|point| [point.x, point.y]));
    [left, right]
}

/// The plan of a share, started as soon as it keeps apart from the plans before. The drone starts
/// and lands below the middle of its share, clear of the others.
fn apart_from(
    plans: &[Plan],
    share: &[PenStroke],
    options: &PlanOptions,
    style: &EvenStyle,
) -> Result<Plan> {
    let [left_m, right_m] = extent_x_m(share);
    let home_x_m = 0.5 * (left_m + right_m);
    let longest_s = plans.iter().map(Plan::duration_s).fold(0.0, f64::max);
    let mut delay_s = 0.0;
    loop {
        let later = PlanOptions { floor_wait_s: options.floor_wait_s + delay_s, ..options.clone() };
        let plan = even::plan(share, &later, style, Some(home_x_m))?;
        let Some(closest) = plans.iter().find_map(|other| conflict(&plan, other)) else {
            return Ok(plan);
        };
        delay_s += DELAY_STEP_S;
        if delay_s > longest_s + DELAY_STEP_S {
            return Err(Error::Infeasible {
                what: format!(
                    "two drones come within {:.2} m of each other at {:.1} s, however long one waits",
                    closest.horizontal_m, closest.time_s
                ),
                hint: "share the word among fewer drones, or write it larger".into(),
            });
        }
    }
}

/// The closest moment of two plans that are too close to each other, if they ever are: within
/// [`MIN_HORIZONTAL_M`] horizontally, and not above each other ([`closest`]).
#[must_use]
pub fn conflict(a: &Plan, b: &Plan) -> Option<Approach> {
    closest(a, b).filter(|closest| closest.horizontal_m < MIN_HORIZONTAL_M - 1e-9)
}

/// The moment of least horizontal distance of two plans while they are not above each other: within
/// [`MIN_VERTICAL_M`] in height, or [`MIN_HORIZONTAL_M`] where one stands on the floor with its
/// motors off. `None`: they are always above each other.
#[must_use]
pub fn closest(a: &Plan, b: &Plan) -> Option<Approach> {
    let end_s = a.duration_s().max(b.duration_s());
    let design_m = |plan: &Plan, time_s: f64| plan.design_m(time_s.min(plan.duration_s()));
    let mut closest: Option<Approach> = None;
    let mut time_s = 0.0;
    while time_s <= end_s {
        let apart_m = design_m(a, time_s) - design_m(b, time_s);
        let (horizontal_m, vertical_m) = (apart_m.xy().norm(), apart_m.z.abs());
        let parked = |plan: &Plan| plan.setpoint_at(time_s).is_some_and(Setpoint::on_floor);
        let reach_m = if parked(a) || parked(b) { MIN_HORIZONTAL_M } else { MIN_VERTICAL_M };
        let closer = closest.is_none_or(|closest| horizontal_m < closest.horizontal_m);
        if vertical_m < reach_m && closer {
            closest = Some(Approach { time_s, horizontal_m, vertical_m });
        }
        time_s += CHECK_STEP_S;
    }
    closest
}

/// The moment of least difference in height of two plans while both fly, one within
/// [`MIN_HORIZONTAL_M`] of the axis of the other's wake; `None`: they keep out of it. The drone of the
/// first plan is then `vertical_m` above the other one's, or below it where that is negative.
#[must_use]
pub fn wake(a: &Plan, b: &Plan) -> Option<Approach> {
    let (mut nearest, mut time_s): (Option<Approach>, f64) = (None, 0.0);
    while time_s <= a.duration_s().min(b.duration_s()) {
        let flies = |plan: &Plan| plan.setpoint_at(time_s).is_some_and(|s| !s.on_floor());
        let apart_m = a.design_m(time_s) - b.design_m(time_s);
        let (horizontal_m, vertical_m) = (apart_m.xy().norm(), apart_m.z);
        let nearer = nearest.is_none_or(|n| vertical_m.abs() < n.vertical_m.abs());
        if horizontal_m < MIN_HORIZONTAL_M - 1e-9 && nearer && flies(a) && flies(b) {
            nearest = Some(Approach { time_s, horizontal_m, vertical_m });
        }
        time_s += CHECK_STEP_S;
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};

    fn strokes(word: &str) -> Strokes {
        write(word, &LetterOptions::default()).unwrap()
    }

    #[test]
    fn two_drones_write_the_whole_word_apart_and_in_less_time() {
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let plans = fleet(&strokes("NOOR"), &options).unwrap();
        assert_eq!(plans.len(), 2);
        assert_eq!(conflict(&plans[0], &plans[1]), None);
        let alone = super::super::plan(&strokes("NOOR"), &options).unwrap();
        let together: f64 = plans.iter().map(Plan::full_light_s).sum();
        assert!((together - alone.full_light_s()).abs() < 0.2, "all of the word, once");
        let longest_s = plans.iter().map(Plan::duration_s).fold(0.0, f64::max);
        assert!(longest_s < 0.7 * alone.duration_s(), "{longest_s} s");
    }

    #[test]
    fn a_drone_waits_until_its_way_is_clear() {
        // Neighboring letters: the second drone may not begin beside the first one's end.
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let plans = fleet(&strokes("OO"), &options).unwrap();
        assert_eq!(conflict(&plans[0], &plans[1]), None);
        assert!(conflict(&plans[0], &plans[0]).is_some(), "two drones in one place");
    }

    #[test]
    fn style_team_is_for_one_drone() {
        let options = PlanOptions { drones: 2, ..PlanOptions::default() };
        assert!(fleet(&strokes("NO"), &options).is_err());
    }
}
