//! Fleet: several drones share the strokes of one word, apart from each other in space and time.
//!
//! Each drone takes a stretch of the word from left to right with about as much light as the
//! others. Where two would come too close, the later one waits on the floor until they do not.

use super::pen::PenStroke;
use super::{EvenStyle, Order, Plan, PlanOptions, Setpoint, Style, even, in_order, paced};
use crate::error::{Error, Result};
use crate::letters::{self, Strokes};

/// Drones keep this far apart sideways, unless they are [`UPWARD_M`] above each other: the radii of
/// the firmware's collision avoidance (`collision_avoidance.c`, 0.3, 0.3 and 0.9 m).
pub const SIDEWAYS_M: f64 = 0.3;
/// Below a drone its downwash reaches this far.
pub const UPWARD_M: f64 = 0.9;
/// Steps in which a drone's start is put off, and between two looks at the distance.
const PUT_OFF_S: f64 = 0.5;
const LOOK_S: f64 = 0.05;

/// Two drones too close to each other, at the moment when they are closest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// When.
    pub time_s: f64,
    /// Distance sideways.
    pub sideways_m: f64,
    /// Difference in height.
    pub upward_m: f64,
}

/// Plans of the drones that write a word together, `options.drones` of them; fewer where there are
/// not as many strokes.
///
/// # Errors
///
/// As [`super::plan()`]; [`Error::Input`] for several drones in the reference team's style, and
/// [`Error::Infeasible`] where they cannot keep apart.
pub fn fleet(strokes: &Strokes, options: &PlanOptions) -> Result<Vec<Plan>> {
    if options.drones <= 1 {
        return Ok(vec![super::plan(strokes, options)?]);
    }
    options.check()?;
    if matches!(options.style, Style::Team(_)) {
        let hint = "set plan.style = \"even\"";
        let found = format!("{} drones in style team", options.drones);
        return Err(Error::input("plan.drones", found, "one, or style even", hint));
    }
    let mut plans: Vec<Plan> = Vec::new();
    for share in shares(strokes, options)? {
        plans.push(paced(apart_from(&plans, &share, options)?, options));
    }
    Ok(plans)
}

/// The strokes from left to right, in stretches of about equal length, each in its own order.
fn shares(strokes: &Strokes, options: &PlanOptions) -> Result<Vec<Vec<PenStroke>>> {
    let drawn = Order::Drawn;
    let in_turn = Style::Even(EvenStyle { order: drawn, ..options.even_style().clone() });
    let mut all = in_order(strokes, &PlanOptions { style: in_turn, ..options.clone() })?;
    let middle = |stroke: &PenStroke| {
        let x = || stroke.points_m.iter().map(|p| p.x);
        x().fold(f64::INFINITY, f64::min) + x().fold(f64::NEG_INFINITY, f64::max)
    };
    let kept = options.even_style().order == drawn || strokes.order == letters::Order::Kept;
    if !kept {
        all.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
    }
    let whole_m: f64 = all.iter().map(PenStroke::length_m).sum();
    let each_m = whole_m / f64::from(options.drones);
    let mut shares: Vec<Vec<PenStroke>> = vec![Vec::new()];
    let mut drawn_m = 0.0;
    for stroke in all {
        let length_m = stroke.length_m();
        #[expect(clippy::cast_precision_loss, reason = "at most 16 drones")]
        let full_m = each_m * shares.len() as f64;
        if drawn_m + 0.5 * length_m > full_m && shares.last().is_some_and(|s| !s.is_empty()) {
            shares.push(Vec::new());
        }
        drawn_m += length_m;
        shares.last_mut().expect("one at least").push(stroke);
    }
    let share = |share: Vec<PenStroke>| {
        if kept { share } else { super::ordered(&share, options) }
    };
    Ok(shares.into_iter().map(share).collect())
}

/// The plan of a share, begun as soon as it keeps apart from the plans before. The drone starts and
/// lands below the middle of its share, where it is in nobody's way.
fn apart_from(plans: &[Plan], share: &[PenStroke], options: &PlanOptions) -> Result<Plan> {
    let x_m = || share.iter().flat_map(|stroke| stroke.points_m.iter().map(|point| point.x));
    let home_x_m =
        0.5 * (x_m().fold(f64::INFINITY, f64::min) + x_m().fold(f64::NEG_INFINITY, f64::max));
    let longest_s = plans.iter().map(Plan::duration_s).fold(0.0, f64::max);
    let mut put_off_s = 0.0;
    loop {
        let later =
            PlanOptions { floor_wait_s: options.floor_wait_s + put_off_s, ..options.clone() };
        let plan = even::even(share, &later, Some(home_x_m))?;
        let Some(meeting) = plans.iter().find_map(|other| nearest_meeting(&plan, other)) else {
            return Ok(plan);
        };
        put_off_s += PUT_OFF_S;
        if put_off_s > longest_s + PUT_OFF_S {
            return Err(Error::Infeasible {
                what: format!(
                    "two drones come within {:.2} m of each other at {:.1} s, however long one waits",
                    meeting.sideways_m, meeting.time_s
                ),
                hint: "share the word among fewer drones, or write it larger".into(),
            });
        }
    }
}

/// Where two plans are too close to each other, if anywhere: within [`SIDEWAYS_M`] sideways and
/// [`UPWARD_M`] in height, or [`SIDEWAYS_M`] in height where one stands on the floor with its motors
/// off. Of all such moments the one with the least distance sideways.
#[must_use]
pub fn nearest_meeting(a: &Plan, b: &Plan) -> Option<Meeting> {
    let end_s = a.duration_s().max(b.duration_s());
    let mut nearest: Option<Meeting> = None;
    let mut time_s = 0.0;
    while time_s <= end_s {
        let apart_m = a.design_until_end_m(time_s) - b.design_until_end_m(time_s);
        let meeting =
            Meeting { time_s, sideways_m: apart_m.xy().norm(), upward_m: apart_m.z.abs() };
        let stands = [a, b].map(|plan| plan.setpoint_at(time_s).is_some_and(Setpoint::on_floor));
        let reach_m = if stands.contains(&true) { SIDEWAYS_M } else { UPWARD_M };
        let close = meeting.sideways_m < SIDEWAYS_M - 1e-9 && meeting.upward_m < reach_m;
        if close && nearest.is_none_or(|n| meeting.sideways_m < n.sideways_m) {
            nearest = Some(meeting);
        }
        time_s += LOOK_S;
    }
    nearest
}

impl Plan {
    /// Where the design is; after the last setpoint it stays there.
    fn design_until_end_m(&self, time_s: f64) -> nalgebra::Vector3<f64> {
        self.design_m(time_s.min(self.duration_s()))
    }
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
        assert_eq!(nearest_meeting(&plans[0], &plans[1]), None);
        let alone = super::super::plan(&strokes("NOOR"), &options).unwrap();
        let lit_s = |plan: &Plan| {
            let rows = plan.setpoints.windows(2).zip(&plan.lights["headlights"]);
            rows.map(|(pair, level)| level * (pair[1].time_s - pair[0].time_s)).sum::<f64>()
        };
        let together: f64 = plans.iter().map(lit_s).sum();
        assert!((together - lit_s(&alone)).abs() < 0.2, "all of the word, once");
        let longest_s = plans.iter().map(Plan::duration_s).fold(0.0, f64::max);
        assert!(longest_s < 0.7 * alone.duration_s(), "{longest_s} s");
    }

    #[test]
    fn drones_that_would_meet_wait() {
        // Neighbouring letters: the second drone may not begin beside the first one's end.
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let plans = fleet(&strokes("OO"), &options).unwrap();
        assert_eq!(nearest_meeting(&plans[0], &plans[1]), None);
        let alone = |plan: &Plan| nearest_meeting(plan, plan).is_some();
        assert!(alone(&plans[0]), "a drone meets itself");
    }

    #[test]
    fn the_teams_style_knows_one_drone() {
        let options = PlanOptions { drones: 2, ..PlanOptions::default() };
        assert!(fleet(&strokes("NO"), &options).is_err());
    }
}
