//! Light timing, which sends light commands early enough that the light changes at strokes' ends.
//!
//! The input is a [`Plan`], a rehearsed or real flight of it, and the lamp's delays. The output is
//! the plan with shifted commands, and the remaining error at each stroke's end. For each change of
//! the design's light, the flight gives the time at which the drone passed the position of this
//! change. The light changes at the nearest tick of the lamp timer.

use super::lamp::LampTiming;
use super::light_letters::drawn_rows;
use super::stroke_ends::{Aligned, Edge, StrokeEnd};
use super::{Plan, PlanData, Setpoint};
use noctograph_core::error::Result;
use noctograph_core::flight::Flight;
use noctograph_core::flight::table::on_grid;

/// Reference that a controller follows between two setpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Between {
    /// Sent position, which is held until the next setpoint.
    Held,
    /// Position of the design, which moves between setpoints.
    Design,
}

/// Maximum time in s between a command and a setpoint that are sent together.
const SAME_S: f64 = 1e-4;
/// Minimum time in s between two light commands.
const LEAST_APART_S: f64 = 0.001;

/// Moves the light commands of a plan to the times at which `flight` passes the strokes' ends.
/// Returns the plan, whose [`PlanData::lit`] contains the design's light, and the errors at the
/// strokes' ends that remain. `between` selects the position that rows added for commands send.
///
/// # Errors
///
/// Returns [`noctograph_core::error::Error::Input`] for a flight without samples or design.
pub fn time_lights(
    plan: &Plan,
    flight: &Flight,
    lamp: &LampTiming,
    between: Between,
) -> Result<(Plan, Vec<StrokeEnd>)> {
    let flown = Aligned::new(flight)?;
    let lit = plan.lit();
    let mut commands: Vec<(f64, f64)> = Vec::new();
    let mut last_tick = f64::NEG_INFINITY;
    let mut lag_s = flown.lag_s;
    for row in 0..lit.len() {
        let before = row.checked_sub(1).map_or(0.0, |row| lit[row]);
        if lit[row] == before {
            continue;
        }
        let [was_on, is_on] = [before > 0.0, lit[row] > 0.0];
        let edge = Edge::new(plan, row, is_on);
        // The drone stays at a dot, so its light ends with the same lag with which it begins.
        if was_on != is_on && (is_on || edge.moves()) {
            lag_s = flown.lag_at_s(&edge, lag_s);
        }
        let (light_s, tick) = lamp.tick(edge.time_s + lag_s, last_tick);
        // Of two levels at one tick, only the later is kept. Switching on or off is never dropped.
        if tick == last_tick && was_on == is_on {
            commands.pop();
        }
        last_tick = tick;
        let earliest_s = commands.last().map_or(0.0, |last| last.0 + LEAST_APART_S);
        commands.push((lamp.sent_s(light_s).max(earliest_s), lit[row]));
    }
    let timed = with_commands(plan, lit, &commands, between);
    let ends = flown.stroke_ends(&timed, lamp);
    Ok((timed, ends))
}

/// Scales a plan to the clock of an onboard trajectory, which advances by `rate` seconds per true
/// second, while light commands keep true time.
pub(super) fn on_trajectory_clock(plan: Plan, rate: f64) -> Plan {
    let lit = plan.lit();
    let changes = (0..lit.len()).filter(|row| *row == 0 || lit[*row] != lit[row - 1]);
    let commands: Vec<(f64, f64)> =
        changes.map(|row| (plan.setpoints[row].time_s, lit[row])).collect();
    with_commands(&Plan::made(plan.into_data().paced(rate)), lit, &commands, Between::Design)
}

/// Replaces a plan's light commands with others, given as times in s and levels in chronological
/// order. `lit` contains the design's level of each row. A command between two setpoints adds a
/// row.
fn with_commands(plan: &Plan, lit: Vec<f64>, commands: &[(f64, f64)], between: Between) -> Plan {
    let mut out = PlanData { yaw_rad: plan.yaw_rad, ..PlanData::default() };
    let has_sent = !plan.sent_m.is_empty();
    let mut commands = commands.iter().copied().peekable();
    let mut level = 0.0;
    let mut levels: Vec<f64> = Vec::new();
    for (row, setpoint) in plan.setpoints.iter().enumerate() {
        // Commands that are due are sent together with the setpoint. The last setpoint is dark.
        let due_s = setpoint.time_s + SAME_S;
        while let Some(due) = commands.next_if(|command| command.0 <= due_s) {
            level = due.1;
        }
        let next = plan.setpoints.get(row + 1);
        let (mut sent, mut sent_m) = (*setpoint, plan.sent_m(row));
        level = next.map_or(0.0, |_| level);
        loop {
            out.setpoints.push(sent);
            out.lit.push(lit[row]);
            levels.push(level);
            out.sent_m.extend(has_sent.then_some(sent_m));
            out.jerk_m_s3.extend(plan.jerk_m_s3.get(row));
            // Commands before the next setpoint receive separate rows.
            let is_before =
                |command: &(f64, f64)| next.is_some_and(|s| command.0 < s.time_s - SAME_S);
            let Some(due) = commands.next_if(is_before) else { break };
            level = due.1;
            sent = moved_on(setpoint, on_grid(due.0));
            let moved_m = match between {
                Between::Held => plan.sent_m(row),
                Between::Design => sent.position_m + plan.sent_m(row) - setpoint.position_m,
            };
            sent_m = moved_m.map(on_grid);
        }
    }
    with_levels(Plan::made(out), plan, &levels)
}

/// Sets the levels of a plan's lamps to `levels`, one for each row. Colors change with the strokes
/// of the design.
fn with_levels(mut plan: Plan, design: &Plan, levels: &[f64]) -> Plan {
    let drawn_rows = drawn_rows((&plan, levels), (design, &design.commanded()));
    let lights = design.lights.iter().map(|(channel, colors)| {
        let column = if design.lamps().any(|(lamp, _)| lamp == channel) {
            levels.to_vec()
        } else {
            let drawn_rows = drawn_rows.iter();
            drawn_rows.map(|rows| rows.as_ref().map_or(0.0, |rows| colors[rows.end - 1])).collect()
        };
        (channel.clone(), column)
    });
    let lights = lights.collect();
    plan.edit(|plan| plan.lights = lights);
    plan
}

/// Returns the setpoint that continues another setpoint's design from a later time in s.
fn moved_on(setpoint: &Setpoint, time_s: f64) -> Setpoint {
    let since_s = time_s - setpoint.time_s;
    let velocity_m_s = setpoint.velocity_m_s + setpoint.acceleration_m_s2 * since_s;
    Setpoint {
        time_s,
        position_m: setpoint.design_m(time_s).map(on_grid),
        velocity_m_s: velocity_m_s.map(on_grid),
        ..*setpoint
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::written;
    use crate::{PlanOptions, plan};
    use nalgebra::Vector3;
    use noctograph_core::flight::{FlightData, FlightSample};
    use noctograph_letters::{LetterOptions, write};

    const LAMP: LampTiming = LampTiming { delay_s: 0.025, tick_s: 0.05 };

    fn noor() -> Plan {
        written("NOE", &PlanOptions::even())
    }

    /// Creates a flight that follows the design exactly, but `lag_s` late and 0.1 m to the left.
    fn late(plan: &Plan, lag_s: f64) -> Flight {
        #[expect(clippy::cast_possible_truncation, reason = "a flight")]
        let n = (plan.duration_s() * 250.0) as u32;
        let sample = |k: u32| {
            let time_s = f64::from(k) / 250.0;
            FlightSample {
                time_s,
                position_m: plan.design_m((time_s - lag_s).max(0.0)) - Vector3::x() * 0.1,
                design_m: plan.design_m(time_s),
                letter: plan.setpoint_at(time_s).and_then(|setpoint| setpoint.letter),
                ..FlightSample::default()
            }
        };
        Flight::made(FlightData { samples: (0..=n).map(sample).collect(), ..FlightData::default() })
    }

    #[test]
    fn light_ends_with_the_strokes_at_any_lag() {
        let plan = noor();
        // The error is up to half a tick (25 ms), which at 0.2 m/s is 5 mm.
        for (lag_s, most_m) in [(0.0, 0.0016), (0.5, 0.0016), (0.533, 0.0066)] {
            let flight = late(&plan, lag_s);
            let (_, ends) = time_lights(&plan, &flight, &LAMP, Between::Held).unwrap();
            assert_eq!(ends.len(), 8, "N, O and the two strokes of E");
            for end in ends {
                assert!(end.streak_m.abs() < most_m, "lag {lag_s} s: {end:?}");
            }
        }
    }

    #[test]
    fn a_dot_is_lit_for_as_long_as_planned_at_any_lag() {
        let options = LetterOptions { font: "simplex".into(), ..LetterOptions::default() };
        let plan = plan(&write("i", &options).unwrap(), &PlanOptions::even()).unwrap();
        for lag_s in [0.0, 0.11, 0.533] {
            let (_, ends) = time_lights(&plan, &late(&plan, lag_s), &LAMP, Between::Held).unwrap();
            let lit_s: Vec<f64> =
                ends.chunks(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
            assert!(lit_s.iter().any(|lit_s| (lit_s - 0.2).abs() < 1e-6), "{lag_s} s: {lit_s:?}");
        }
    }

    #[test]
    fn commands_go_out_ahead_of_the_tick_by_the_radio_and_half_a_tick() {
        let plan = noor();
        let flight = late(&plan, 0.5);
        let (timed, ends) = time_lights(&plan, &flight, &LAMP, Between::Held).unwrap();
        let lights = &timed.lights["headlights"];
        let on = (1..lights.len()).find(|row| lights[*row] > 0.0).unwrap();
        assert!((timed.setpoints[on].time_s - (ends[0].time_s - 0.05)).abs() < 1e-5);
        assert!(timed.setpoints.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
        let (kept, wanted) = (timed.full_light_s(), plan.full_light_s());
        assert!((kept - wanted).abs() < 0.005, "the design's light: {kept} s of {wanted} s");
    }

    #[test]
    fn colors_move_with_their_strokes() {
        let mut plan = noor();
        let lit = plan.lights["headlights"].clone();
        let letters = crate::light_letters(&plan);
        let color = |letter: &Option<usize>| letter.map_or(0.0, |letter| 0.1 * (letter + 1) as f64);
        let reds = letters.iter().map(color).collect();
        let lights = [("ring".to_owned(), lit), ("ring.red".to_owned(), reds)].into();
        plan.edit(|plan| plan.lights = lights);
        let (timed, _) = time_lights(&plan, &late(&plan, 0.5), &LAMP, Between::Held).unwrap();
        let letters = crate::light_letters(&timed);
        let colors: Vec<f64> = letters.iter().map(color).collect();
        assert_eq!(timed.lights["ring.red"], colors);
        assert!(colors.iter().any(|color| *color > 0.0));
        let dark = timed.lights["ring"].iter().zip(&colors).all(|(l, c)| (*l > 0.0) == (*c > 0.0));
        assert!(dark, "no color without light, and no light without color");
    }

    #[test]
    fn with_an_old_clock_on_board_the_lights_run_ahead() {
        let clock = 84.0 / 85.0;
        let plan = noor();
        let paced = on_trajectory_clock(plan.clone(), clock);
        let late_s = paced.duration_s() - plan.duration_s();
        assert!((late_s - plan.duration_s() / 84.0).abs() < 1e-5, "0.71 s a minute: {late_s}");
        fn last_lit(plan: &Plan) -> f64 {
            let lights = &plan.lights["headlights"];
            plan.setpoints[lights.iter().rposition(|l| *l > 0.0).unwrap() + 1].time_s
        }
        assert!((last_lit(&paced) - last_lit(&plan)).abs() < 1e-5, "the host's clock is right");
        let (_, ends) = time_lights(&paced, &late(&paced, 0.0), &LAMP, Between::Design).unwrap();
        assert!(ends.iter().all(|end| end.streak_m.abs() < 0.006), "{ends:?}");
    }
}
