//! Plan: strokes become setpoints with time stamps and a light schedule.
//!
//! Product in: [`Strokes`]. Product out: [`Plan`], the list of what is sent to the drone.
//! The plane of the word becomes the world's x-z plane at y = 0.
//!
//! Two styles: `team`, letter by letter with waits as the reference flight went, and `even`: strokes
//! in the order with the least dark time (Held–Karp, 2-opt), corners rounded within a stated error
//! by two moving averages over time, one speed where the limits permit and light dimmed with the
//! speed where they do not, time-optimal jerk-limited ways in the dark (Ruckig).

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::error::{Error, Result};
use crate::geometry::polyline_length_m;
use crate::letters::{self, Strokes};
use pen::PenStroke;

pub mod check;
pub mod csv;
mod even;
mod fleet;
pub mod lamp;
pub mod lead;
mod motion;
mod options;
mod order;
mod pen;
mod relight;
mod replay;
mod speed;
mod tour;
mod transit;

pub use fleet::{Meeting, SIDEWAYS_M, UPWARD_M, fleet, nearest_meeting};
pub use options::{
    EvenStyle, Exposure, Extent, LightClock, Order, PlanOptions, ReferenceKind, Style, TeamStyle,
};
pub use relight::relight;
pub use replay::{Replay, replay};

/// What is sent to the drone, in order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Setpoints; each is held until the next. A setpoint at or below the floor (z ≤ 0) asks for
    /// motors off.
    pub setpoints: Vec<Setpoint>,
    /// Light commands sent with each setpoint: one column per channel, 0 (off) to 1, each as long
    /// as `setpoints`.
    pub lights: BTreeMap<String, Vec<f64>>,
    /// What the design wants lit, where commands are sent ahead of it ([`lamp`]); as long as
    /// `setpoints`, or empty where `lights` are it. See [`Plan::lit()`].
    pub lit: Vec<f64>,
    /// Positions that are sent instead of the setpoints' own, to lead a slow loop or against a mean
    /// error ([`lead`]); as long as `setpoints`, or empty. See [`Plan::sent_m()`].
    pub sent_m: Vec<Vector3<f64>>,
}

/// One packet to the drone: where it should be now, and how the design moves on from there.
///
/// Until the next setpoint the design position is
/// `position + velocity Δt + acceleration Δt² / 2`; a controller that knows only positions holds
/// `position` instead, and trails.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Since the first setpoint.
    pub time_s: f64,
    /// World frame.
    pub position_m: Vector3<f64>,
    /// World frame.
    pub velocity_m_s: Vector3<f64>,
    /// World frame.
    pub acceleration_m_s2: Vector3<f64>,
    /// Index of the letter that is being written; `None` during take-off and landing.
    pub letter: Option<usize>,
}

impl Plan {
    /// When the last setpoint is sent: the end of the plan.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.setpoints.last().map_or(0.0, |last| last.time_s)
    }
}

impl Setpoint {
    /// Where the design is at `time_s`, at or after this setpoint.
    #[must_use]
    pub fn design_m(&self, time_s: f64) -> Vector3<f64> {
        let dt = time_s - self.time_s;
        self.position_m + self.velocity_m_s * dt + self.acceleration_m_s2 * (0.5 * dt * dt)
    }
}

/// Longest flight that is planned: an hour, twelve times a Crazyflie's battery.
const MAX_DURATION_S: f64 = 3600.0;

/// Most strokes of a drawing. Its order is looked for among all pairs.
const MAX_STROKES: usize = 10_000;

/// Plans the flight of one drone that writes a word, in the style that the options name.
///
/// # Errors
///
/// [`Error::Input`] for an option out of range or a drawing without light, [`Error::Infeasible`]
/// for a flight longer than an hour and a drawing of more than 10 000 strokes.
pub fn plan(strokes: &Strokes, options: &PlanOptions) -> Result<Plan> {
    options.check()?;
    let plan = match options.style {
        Style::Team(_) => plan_as_the_team(strokes, options)?,
        Style::Even(_) => even::even(&in_order(strokes, options)?, options, None)?,
    };
    Ok(paced(plan, options))
}

/// The plan in true time, and against the mean error of earlier flights.
fn paced(plan: Plan, options: &PlanOptions) -> Plan {
    let plan = match options.trajectory_clock {
        1.0 => plan,
        clock => lamp::on_a_skewed_clock(plan, clock),
    };
    match Vector3::from(options.mean_error_m) {
        none if none == Vector3::zeros() => plan,
        mean_error_m => lead::offset(&plan, mean_error_m),
    }
}

/// The strokes of a drawing in the order and direction in which they are flown; those that a writer
/// drew keep the writer's.
fn in_order(strokes: &Strokes, options: &PlanOptions) -> Result<Vec<PenStroke>> {
    let drawn = pen::pen_strokes(strokes);
    if drawn.is_empty() {
        let hint = "write letters that leave light";
        return Err(Error::input("drawing", "no lit stroke", "at least one", hint));
    }
    let lit_s = drawn.iter().map(PenStroke::length_m).sum::<f64>() / options.stroke_speed_m_s;
    if lit_s > MAX_DURATION_S || drawn.len() > MAX_STROKES {
        return Err(Error::Infeasible {
            what: format!(
                "{} strokes of {lit_s:.0} s in all are too much for a flight",
                drawn.len()
            ),
            hint: "raise plan.stroke_speed_m_s, or draw less, or smaller".into(),
        });
    }
    let kept = strokes.order == letters::Order::Kept;
    Ok(if kept { drawn } else { ordered(&drawn, options) })
}

/// Strokes in the order and direction in which they are flown.
fn ordered(drawn: &[PenStroke], options: &PlanOptions) -> Vec<PenStroke> {
    if options.even_style().order == Order::Drawn {
        return drawn.to_vec();
    }
    let ways: Vec<_> = drawn.iter().map(|stroke| stroke.ways(options)).collect();
    let flown = order::shortest(&ways, options).into_iter().map(|(stroke, way)| PenStroke {
        letter: drawn[stroke].letter,
        points_m: drawn[stroke].drawn(way),
    });
    flown.collect()
}

fn plan_as_the_team(strokes: &Strokes, options: &PlanOptions) -> Result<Plan> {
    let duration_s = longest_duration_s(strokes, options);
    if duration_s > MAX_DURATION_S {
        return Err(Error::Infeasible {
            what: format!("the flight would take up to {duration_s:.0} s, more than an hour"),
            hint: "raise plan.stroke_speed_m_s, or write a shorter or smaller word".into(),
        });
    }
    Ok(tour::tour(strokes, options))
}

/// No flight of these strokes lasts longer: all strokes, waits and ways to and from the word.
fn longest_duration_s(strokes: &Strokes, options: &PlanOptions) -> f64 {
    let style = options.team_style();
    let moves = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves);
    let strokes_m: f64 = moves.map(|m| polyline_length_m(&[m.from_m, m.to_m])).sum();
    let [left, bottom, right, top] = strokes.bounds_m();
    let ways_m = 2.0 * (left.abs() + right.abs() + bottom.abs() + top.abs() + style.step_m)
        + style.approach_height_m
        + options.landing_height_m;
    let waits_s: f64 = strokes.glyphs.iter().map(|_| style.letter_wait_s).sum();
    (strokes_m + ways_m) / options.stroke_speed_m_s + waits_s + 2.0 * options.floor_wait_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};

    fn noor(extent: Extent) -> Plan {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        plan(&strokes, &PlanOptions { extent, ..PlanOptions::default() }).unwrap()
    }

    #[test]
    fn the_letters_of_noor_take_as_long_as_the_teams() {
        let duration_s = noor(Extent::Letters).duration_s();
        assert!((duration_s - 46.118_038).abs() < 1e-5, "{duration_s} s instead of 46.118 s");
    }

    #[test]
    fn the_whole_flight_starts_and_ends_on_the_floor_in_the_dark() {
        let plan = noor(Extent::Whole);
        let (first, last) = (plan.setpoints[0], plan.setpoints[plan.setpoints.len() - 1]);
        assert_eq!((first.position_m, last.position_m), (Vector3::zeros(), Vector3::zeros()));
        let lit = &plan.lights["headlights"];
        assert_eq!((lit[0], lit[lit.len() - 1]), (0.0, 0.0), "dark at both ends");
        assert!(plan.setpoints.windows(2).all(|p| p[0].time_s < p[1].time_s), "time rises");
    }

    #[test]
    fn the_design_is_continuous_within_a_leg_and_steps_between_letters() {
        let plan = noor(Extent::Letters);
        let jumps: Vec<f64> = plan
            .setpoints
            .windows(2)
            .map(|p| (p[1].position_m - p[0].design_m(p[1].time_s)).norm())
            .filter(|jump| *jump > 1e-5)
            .collect();
        assert_eq!(jumps.len(), 4, "one step after each letter: {jumps:?}");
        assert!(jumps.iter().all(|jump| (jump - 0.1).abs() < 1e-5), "of 0.1 m: {jumps:?}");
    }

    #[test]
    fn headlights_are_lit_along_lit_strokes_only() {
        let plan = noor(Extent::Letters);
        let lit_s: f64 = plan
            .setpoints
            .windows(2)
            .zip(&plan.lights["headlights"])
            .map(|(p, level)| (p[1].time_s - p[0].time_s) * level)
            .sum();
        // N 1.583 m, O 1.6 m twice, R 0.5 + 0.3 + 0.25 + 0.3 + 0.391 m, at 0.2 m/s.
        let wanted_s = (1.583_095 + 2.0 * 1.6 + 1.740_512) / 0.2;
        assert!((lit_s - wanted_s).abs() < 1e-3, "{lit_s} s lit instead of {wanted_s} s");
    }

    #[test]
    fn an_endless_flight_is_refused() {
        let options = LetterOptions { cap_height_m: 100.0, ..LetterOptions::default() };
        let strokes = write("NOOR", &options).unwrap();
        let error = plan(&strokes, &PlanOptions { stroke_speed_m_s: 0.01, ..Default::default() });
        assert!(matches!(error, Err(Error::Infeasible { .. })), "{error:?}");
    }

    /// 100 letters are to take 50 ms at most, a drawing of 2000 strokes or corners a second. CPU time
    /// measured: 20 ms, 0.39 s and 0.01 s (the last two with their SVG read and their plan written).
    #[test]
    #[ignore = "times are the machine's; run by hand with --nocapture"]
    fn long_words_and_drawings_are_planned_at_once() {
        let options = PlanOptions { stroke_speed_m_s: 1.0, ..PlanOptions::even() };
        let timed = |what: &str, strokes: &Strokes, most_s: f64| {
            let start = std::time::Instant::now();
            let n = plan(strokes, &options).unwrap().setpoints.len();
            let took_s = start.elapsed().as_secs_f64();
            println!("{what}: {took_s:.3} s, {n} setpoints");
            assert!(took_s < most_s, "{what}: {took_s} s");
        };
        let word: String = "NOCTOGRAPH".repeat(10);
        timed("100 letters", &write(&word, &LetterOptions::default()).unwrap(), 0.05);
        let mut drawing = write("N", &LetterOptions::default()).unwrap();
        let place = |k: u32| {
            let turned = f64::from(k) * 2.399_963;
            let (sin, cos) = libm::sincos(turned);
            let radius_m = 0.02 * f64::from(k).sqrt();
            [radius_m * cos, 1.0 + radius_m * sin]
        };
        let stroke = |from_m, to_m| letters::Move { from_m, to_m, lit: true };
        let apart = (0..2000).map(|k| {
            let from_m = place(k);
            stroke(from_m, [from_m[0] + 0.03, from_m[1] + 0.01])
        });
        drawing.glyphs[0].moves = apart.collect();
        timed("2000 strokes", &drawing, 1.0);
        let line = (0..2000).map(|k| {
            let at = |k: u32| {
                let (sin, cos) = libm::sincos(f64::from(k) * 0.02);
                [0.3 * cos + 1e-4 * f64::from(k), 1.0 + 0.3 * sin]
            };
            stroke(at(k), at(k + 1))
        });
        drawing.glyphs[0].moves = line.collect();
        timed("a line of 2000", &drawing, 1.0);
    }
}
