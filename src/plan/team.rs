//! Style `team`, which takes off, writes letter by letter at constant speed, and lands.
//!
//! On every segment, setpoints are sent at the start and then at fixed intervals. Each step between
//! letters is sent as a single setpoint. The style follows the reference team's flight script,
//! whose setpoints are in the log of their 2022 flight.

use nalgebra::Vector3;

use super::pen::{DOT_M, dot_s};
use super::{Extent, Plan, PlanData, PlanOptions, Setpoint, TeamStyle};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::table::{FLIGHT_LONG, MAX_DURATION_S, on_grid};
use noctograph_core::geometry::distance;
use noctograph_core::strokes::{Glyph, Strokes};

/// Time in s before the end of a segment in which no further setpoint is sent.
const LEAST_LEFT_S: f64 = 1e-6;

/// Plans the flight that writes strokes letter by letter, or returns an error if it is too long.
pub(super) fn plan(strokes: &Strokes, options: &PlanOptions, style: &TeamStyle) -> Result<Plan> {
    // A flight that is too long is refused before any of it is planned.
    let duration_s = longest_duration_s(strokes, options, style);
    if duration_s > MAX_DURATION_S {
        return Err(Error::infeasible(
            format!("the flight would take up to {duration_s:.0} s, more than an hour"),
            "raise plan.stroke_speed_m_s, or write a shorter or smaller word",
        )
        .coded(FLIGHT_LONG));
    }
    let plan = PlanData::with_channels(&options.lights);
    let mut script = Script { options, style, plan, time_s: 0.0, letter: None };
    if options.extent == Extent::Whole {
        script.take_off(strokes);
    }
    for (index, glyph) in strokes.glyphs.iter().enumerate() {
        script.letter = Some(index);
        script.write(glyph);
    }
    script.letter = None;
    match options.extent {
        Extent::Whole => script.land(),
        Extent::Letters => script.send(script.position_m(), Vector3::zeros(), false),
    }
    Plan::new(script.plan)
}

/// Returns an upper bound in s for the flight's duration, including strokes, waits, take-off and
/// landing.
fn longest_duration_s(strokes: &Strokes, options: &PlanOptions, style: &TeamStyle) -> f64 {
    let moves = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves);
    let strokes_m: f64 = moves.map(|m| distance(m.from_m, m.to_m)).sum();
    let [left, bottom, right, top] = strokes.bounds_m();
    let paths_m = 2.0 * (left.abs() + right.abs() + bottom.abs() + top.abs() + style.step_m)
        + style.approach_height_m
        + options.landing_height_m;
    let waits_s: f64 = strokes.glyphs.iter().map(|_| style.letter_wait_s).sum();
    (strokes_m + paths_m) / options.stroke_speed_m_s + waits_s + 2.0 * options.floor_wait_s
}

/// Flight script that is being written, up to a time in s.
struct Script<'a> {
    options: &'a PlanOptions,
    style: &'a TeamStyle,
    plan: PlanData,
    time_s: f64,
    letter: Option<usize>,
}

impl Script<'_> {
    /// Sends a wait on the floor below the middle of the word, and the flight below its first
    /// letter.
    fn take_off(&mut self, strokes: &Strokes) {
        let x_start_m = strokes.glyphs.first().map_or(0.0, |glyph| glyph.cell.left_m);
        self.wait(Vector3::zeros(), self.options.floor_wait_s);
        let lift_off = Vector3::new(0.0, 0.0, self.style.lift_off_height_m);
        let approach = Vector3::new(x_start_m, 0.0, self.style.approach_height_m);
        self.fly(lift_off, approach, false);
    }

    /// Sends the moves of one letter, then a step to the right of its box and a dark wait there.
    fn write(&mut self, glyph: &Glyph) {
        let mut last = self.position_m();
        for (index, step) in glyph.moves.iter().enumerate() {
            let [from, to] = [step.from_m, step.to_m].map(|[x, up]| Vector3::new(x, 0.0, up));
            // An empty dark move at the beginning means that the drone flies to the letter first.
            if index == 0 && !step.lit && from == to {
                self.fly(last, to, false);
            }
            last = to;
            self.fly(from, to, step.lit);
        }
        let cell = glyph.cell;
        let beside_m = cell.left_m + cell.width_m + self.style.step_m;
        let beside = Vector3::new(beside_m, 0.0, last.z.min(cell.baseline_m));
        self.wait(beside, self.style.letter_wait_s);
    }

    /// Sends the vertical descent, the return below the middle of the word, and the stop of the
    /// motors.
    fn land(&mut self) {
        let above = self.position_m();
        let down = Vector3::new(above.x, 0.0, self.options.landing_height_m);
        self.fly(above, down, false);
        self.fly(down, Vector3::new(0.0, 0.0, down.z), false);
        self.wait(Vector3::zeros(), self.options.floor_wait_s);
        self.send(Vector3::zeros(), Vector3::zeros(), false);
    }

    /// Sends a straight segment at the stroke speed, with the light on if `lit`. A short lit
    /// segment takes as long as a dot.
    fn fly(&mut self, from: Vector3<f64>, to: Vector3<f64>, lit: bool) {
        let (length_m, speed_m_s) = ((to - from).norm(), self.options.stroke_speed_m_s);
        if length_m > 0.0 {
            let least_s = if lit && length_m < DOT_M { dot_s(speed_m_s) } else { 0.0 };
            let lasts_s = (length_m / speed_m_s).max(least_s);
            self.segment(from, (to - from) / lasts_s, lasts_s, lit);
        }
    }

    /// Waits at a position in the dark.
    fn wait(&mut self, position_m: Vector3<f64>, duration_s: f64) {
        self.segment(position_m, Vector3::zeros(), duration_s, false);
    }

    /// Sends setpoints with the light `lit` at fixed intervals for `duration_s`, which move from a
    /// position in m at a constant velocity in m/s.
    fn segment(&mut self, from: Vector3<f64>, velocity: Vector3<f64>, duration_s: f64, lit: bool) {
        let start_s = self.time_s;
        let offsets_s = (0..).map(|n| f64::from(n) * self.options.setpoint_interval_s);
        // A setpoint just before the end would only repeat the first one of the next segment.
        for offset_s in offsets_s.take_while(|offset_s| *offset_s < duration_s - LEAST_LEFT_S) {
            self.time_s = start_s + offset_s;
            self.send(from + velocity * offset_s, velocity, lit);
        }
        self.time_s = start_s + duration_s;
    }

    /// Adds a setpoint at the current time to the plan, with the position in m, the velocity in m/s
    /// and the light `lit`.
    fn send(&mut self, position: Vector3<f64>, velocity: Vector3<f64>, lit: bool) {
        let setpoint = Setpoint {
            time_s: on_grid(self.time_s),
            position_m: position.map(on_grid),
            velocity_m_s: velocity.map(on_grid),
            letter: self.letter,
            ..Setpoint::default()
        };
        self.plan.push(setpoint, f64::from(lit));
    }

    /// Returns the position that was sent last, or the origin.
    fn position_m(&self) -> Vector3<f64> {
        self.plan.setpoints.last().map_or_else(Vector3::zeros, |last| last.position_m)
    }
}
