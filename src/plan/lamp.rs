//! Lamp: light commands on the light's own clock.
//!
//! Product in: a [`Plan`], the flight that it leads to (rehearsed or real), and how a command
//! becomes light. Products out: the plan with its commands moved, and what is left at each stroke's
//! end. A command waits for the radio, then for the lamps' timer (50 ms), then for the ramp, while
//! the drone is late by its loop's lag. Each edge of the wanted light is looked up in the flight:
//! when was the drone where the design wanted the edge? The nearest tick to that time gets the
//! light, and the command goes out so that it arrives in the middle between two ticks.

use nalgebra::Vector3;

use super::{Plan, Setpoint};
use crate::error::Result;
use crate::flight::table::on_grid;
use crate::flight::tracking::{Part, track};
use crate::flight::{Flight, FlightSample};

/// From a command to its light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampClock {
    /// From sending to arriving, on average.
    pub delay_s: f64,
    /// Period of the timer that a change waits for; 0: none.
    pub tick_s: f64,
    /// When that timer first ticks.
    pub phase_s: f64,
    /// From dark to full.
    pub rise_s: f64,
    /// From full to dark.
    pub decay_s: f64,
}

/// What the controller makes of a setpoint between two others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Follows {
    /// Nothing: it holds what was sent.
    Held,
    /// It follows the design.
    Design,
}

/// What is left at an end of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeEnd {
    /// When the light changes, in the middle of its ramp.
    pub time_s: f64,
    /// Where the design wants it to change.
    pub at_m: Vector3<f64>,
    /// Whether the light goes on.
    pub on: bool,
    /// Light beyond the end of the stroke, along it; negative where the stroke falls short.
    pub streak_m: f64,
}

/// Around the flight's lag, an edge is looked for this long.
const SEARCH_S: f64 = 0.3;
/// What a second away from the flight's lag counts as, m/s: the drone may wait at an edge.
const PATIENCE_M_S: f64 = 0.03;
/// Samples of a flight that are looked at for its lag.
const MAX_LOOKS: usize = 2000;
/// Light commands are at least this far apart.
const LEAST_APART_S: f64 = 0.001;

/// Moves the light commands of a plan so that light begins and ends at the strokes' ends as `flight`
/// flew them. What light the design wants is kept in [`Plan::lit`].
///
/// # Errors
///
/// [`crate::error::Error::Input`] for a flight without samples or without a design.
pub fn on_the_lights_clock(
    plan: &Plan,
    flight: &Flight,
    clock: &LampClock,
    follows: Follows,
) -> Result<(Plan, Vec<StrokeEnd>)> {
    let flown = Flown::new(flight)?;
    let lit = plan.lit();
    let mut commands: Vec<(f64, f64)> = Vec::new();
    let mut last_tick = f64::NEG_INFINITY;
    let mut late_s = flown.lag_s;
    for row in 0..lit.len() {
        let before = row.checked_sub(1).map_or(0.0, |row| lit[row]);
        if lit[row] == before {
            continue;
        }
        let [was, is] = [before > 0.0, lit[row] > 0.0];
        let edge = Edge::of(plan, row, is);
        if was != is {
            late_s = flown.late_s(edge.time_s, &edge.at_m, late_s);
        }
        let ramp_s = if lit[row] > before { clock.rise_s } else { clock.decay_s };
        let half_ramp_s = 0.5 * ramp_s * (lit[row] - before).abs();
        let (light_s, tick) = clock.tick(edge.time_s + late_s - half_ramp_s, last_tick);
        let sent_s = clock.sent_s(light_s);
        // Of two levels that meet on a tick the later one counts, but an edge always does.
        if tick == last_tick && was == is {
            commands.pop();
        }
        last_tick = tick;
        let earliest_s = commands.last().map_or(0.0, |last| last.0 + LEAST_APART_S);
        commands.push((sent_s.max(earliest_s), lit[row]));
    }
    let aimed = with_commands(plan, lit, &commands, follows);
    let ends = ends(&aimed, &flown, clock);
    Ok((aimed, ends))
}

/// What the light commands of a plan leave at its strokes' ends in a flight of it.
///
/// # Errors
///
/// [`crate::error::Error::Input`] for a flight without samples or without a design.
pub fn stroke_ends(plan: &Plan, flight: &Flight, clock: &LampClock) -> Result<Vec<StrokeEnd>> {
    Ok(ends(plan, &Flown::new(flight)?, clock))
}

fn ends(plan: &Plan, flown: &Flown<'_>, clock: &LampClock) -> Vec<StrokeEnd> {
    let commanded: Vec<f64> = (0..plan.setpoints.len())
        .map(|row| plan.lights.values().map(|levels| levels[row]).fold(0.0, f64::max))
        .collect();
    let wanted = plan.lit();
    let pairs = switches(&wanted).zip(switches(&commanded));
    pairs
        .map(|((row, on), (sent, _))| {
            let ramp_s = if on { clock.rise_s } else { clock.decay_s };
            let time_s = clock.light_s(plan.setpoints[sent].time_s) + 0.5 * ramp_s;
            let edge = Edge::of(plan, row, on);
            let streak_m = flown.streak_m(time_s, &edge, on);
            StrokeEnd { time_s, at_m: edge.at_m, on, streak_m }
        })
        .collect()
}

/// The rows at which light goes on or off.
fn switches(levels: &[f64]) -> impl Iterator<Item = (usize, bool)> {
    (0..levels.len()).filter_map(|row| {
        let was = row > 0 && levels[row - 1] > 0.0;
        let is = levels[row] > 0.0;
        (was != is).then_some((row, is))
    })
}

/// Where and how the design passes an end of a stroke.
struct Edge {
    time_s: f64,
    at_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
}

impl Edge {
    /// The beginning of a stroke is that of its first setpoint; its end that of the setpoint before
    /// the first dark one, which may go elsewhere or be elsewhere already.
    fn of(plan: &Plan, row: usize, on: bool) -> Self {
        let time_s = plan.setpoints[row].time_s;
        let drawing = &plan.setpoints[if on { row } else { row.max(1) - 1 }];
        Self { time_s, at_m: drawing.design_m(time_s), velocity_m_s: drawing.velocity_m_s }
    }
}

impl LampClock {
    /// The tick nearest to a time, after the last one that was used where something changed.
    fn tick(&self, time_s: f64, last_tick: f64) -> (f64, f64) {
        if self.tick_s == 0.0 {
            return (time_s.max(self.delay_s), time_s);
        }
        // A command cannot be sent before the flight.
        let first = ((self.delay_s - self.phase_s) / self.tick_s + 0.5).ceil();
        let nearest = ((time_s - self.phase_s) / self.tick_s).round();
        let tick = nearest.max(first).max(last_tick);
        (self.phase_s + tick * self.tick_s, tick)
    }

    fn sent_s(&self, light_s: f64) -> f64 {
        (light_s - 0.5 * self.tick_s - self.delay_s).max(0.0)
    }

    /// When a command that is sent at a time begins to show.
    fn light_s(&self, sent_s: f64) -> f64 {
        let arrives_s = sent_s + self.delay_s;
        if self.tick_s == 0.0 {
            return arrives_s;
        }
        // The slack is a setpoint's grid in time.
        let tick = ((arrives_s - self.phase_s - 1e-5) / self.tick_s).ceil();
        self.phase_s + tick * self.tick_s
    }
}

/// A flight as seen from its plan.
struct Flown<'a> {
    samples: &'a [FlightSample],
    lag_s: f64,
    /// Mean of `flown − design` after the lag: the whole picture is off by that.
    off_m: Vector3<f64>,
}

impl<'a> Flown<'a> {
    fn new(flight: &'a Flight) -> Result<Self> {
        // The samples' own part says what is wrong with a flight that cannot be aimed by.
        track(flight, Part::Letters)?;
        let mut flown = Self { samples: &flight.samples, lag_s: 0.0, off_m: Vector3::zeros() };
        let writing: Vec<&FlightSample> =
            flight.samples.iter().filter(|sample| sample.letter.is_some()).collect();
        let some = || writing.iter().step_by(writing.len().div_ceil(MAX_LOOKS)).copied();
        let best = |flown: &Self, lags_s: &mut dyn Iterator<Item = f64>| {
            let spread = |lag_s: f64| flown.off_and_spread_m(some(), lag_s).1;
            lags_s.map(|lag_s| (spread(lag_s), lag_s)).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut coarse = (-5..=60).map(|step| f64::from(step) * 0.025);
        let about_s = best(&flown, &mut coarse).map_or(0.0, |(_, lag_s)| lag_s);
        let mut fine = (-25..=25).map(|step| about_s + f64::from(step) * 0.001);
        flown.lag_s = best(&flown, &mut fine).map_or(about_s, |(_, lag_s)| lag_s);
        flown.off_m = flown.off_and_spread_m(some(), flown.lag_s).0;
        Ok(flown)
    }

    /// Mean of `flown − design` after a lag, and its variance in the word's plane.
    fn off_and_spread_m<'s>(
        &self,
        samples: impl Iterator<Item = &'s FlightSample>,
        lag_s: f64,
    ) -> (Vector3<f64>, f64) {
        let (mut n, mut sum, mut squares) = (0.0, Vector3::zeros(), 0.0);
        for sample in samples {
            let off_m = self.at_m(sample.time_s + lag_s) - sample.design_m;
            n += 1.0;
            sum += off_m;
            squares += off_m.xz().norm_squared();
        }
        let mean_m = sum / f64::max(n, 1.0);
        (mean_m, squares / f64::max(n, 1.0) - mean_m.xz().norm_squared())
    }

    fn at_m(&self, time_s: f64) -> Vector3<f64> {
        let next = self.samples.partition_point(|sample| sample.time_s <= time_s);
        let (before, after) = (next.max(1) - 1, next.min(self.samples.len() - 1));
        let [a, b] = [&self.samples[before], &self.samples[after]];
        let span_s = b.time_s - a.time_s;
        let part = if span_s > 0.0 { ((time_s - a.time_s) / span_s).clamp(0.0, 1.0) } else { 0.0 };
        a.position_m.lerp(&b.position_m, part) - self.off_m
    }

    /// How late the drone was at a place of the design.
    fn late_s(&self, design_s: f64, place_m: &Vector3<f64>, about_s: f64) -> f64 {
        let cost = |late_s: f64| {
            let off_m = (self.at_m(design_s + late_s) - place_m).xz().norm_squared();
            let patience_m = PATIENCE_M_S * (late_s - self.lag_s);
            off_m + patience_m * patience_m
        };
        let around_s = 0.5 * (about_s + self.lag_s);
        let steps = (-75..=75).map(|step| around_s + f64::from(step) / 75.0 * SEARCH_S);
        steps.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(about_s)
    }

    /// How far beyond a stroke's end the drone was at a time, along the stroke.
    fn streak_m(&self, time_s: f64, edge: &Edge, on: bool) -> f64 {
        let along = edge.velocity_m_s.try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
        let beyond_m = (self.at_m(time_s) - edge.at_m).dot(&along);
        if on { -beyond_m } else { beyond_m }
    }
}

/// The plan with other light commands: `(sent at, level)` in rising order. Rows are put in where a
/// command is sent between two setpoints.
pub(super) fn with_commands(
    plan: &Plan,
    lit: Vec<f64>,
    commands: &[(f64, f64)],
    follows: Follows,
) -> Plan {
    let mut out = Plan::default();
    let has_sent = !plan.sent_m.is_empty();
    let (mut level, mut next) = (0.0, 0);
    let mut levels: Vec<f64> = Vec::new();
    for (row, setpoint) in plan.setpoints.iter().enumerate() {
        let until_s = plan.setpoints.get(row + 1).map_or(f64::INFINITY, |s| s.time_s);
        while commands.get(next).is_some_and(|c| c.0 <= setpoint.time_s + 1e-4) {
            level = commands[next].1;
            next += 1;
        }
        let mut push = |setpoint: Setpoint, sent_m: Vector3<f64>, level: f64| {
            out.setpoints.push(setpoint);
            out.lit.push(lit[row]);
            levels.push(level);
            if has_sent {
                out.sent_m.push(sent_m);
            }
        };
        let last = row + 1 == plan.setpoints.len();
        push(*setpoint, plan.sent_m(row), if last { 0.0 } else { level });
        while !last && commands.get(next).is_some_and(|c| c.0 < until_s - 1e-4) {
            let time_s = on_grid(commands[next].0);
            level = commands[next].1;
            next += 1;
            let between = setpoint.moved_on(time_s);
            let sent_m = match follows {
                Follows::Held => plan.sent_m(row),
                Follows::Design => between.position_m + plan.sent_m(row) - setpoint.position_m,
            };
            push(between, sent_m.map(on_grid), level);
        }
    }
    out.lights = plan.lights.keys().map(|channel| (channel.clone(), levels.clone())).collect();
    out
}

impl Setpoint {
    /// The setpoint that says the same from a later time on.
    fn moved_on(&self, time_s: f64) -> Self {
        let since_s = time_s - self.time_s;
        Self {
            time_s,
            position_m: self.design_m(time_s).map(on_grid),
            velocity_m_s: (self.velocity_m_s + self.acceleration_m_s2 * since_s).map(on_grid),
            ..*self
        }
    }
}

impl Plan {
    /// What the design wants lit from each setpoint on: the highest level of all channels where
    /// commands are not ahead of it.
    #[must_use]
    pub fn lit(&self) -> Vec<f64> {
        if !self.lit.is_empty() {
            return self.lit.clone();
        }
        let highest = |row: usize| self.lights.values().map(|l| l[row]).fold(0.0, f64::max);
        (0..self.setpoints.len()).map(highest).collect()
    }
}

/// The plan as a slow or fast clock on board paces it, while light commands keep their true time.
pub(super) fn on_a_skewed_clock(plan: Plan, clock: f64) -> Plan {
    let lit = plan.lit();
    let changes = (0..lit.len()).filter(|row| *row == 0 || lit[*row] != lit[row - 1]);
    let commands: Vec<(f64, f64)> =
        changes.map(|row| (plan.setpoints[row].time_s, lit[row])).collect();
    let paced = plan.setpoints.iter().map(|setpoint| Setpoint {
        time_s: on_grid(setpoint.time_s / clock),
        velocity_m_s: (setpoint.velocity_m_s * clock).map(on_grid),
        acceleration_m_s2: (setpoint.acceleration_m_s2 * (clock * clock)).map(on_grid),
        ..*setpoint
    });
    let paced = Plan { setpoints: paced.collect(), ..plan };
    with_commands(&paced, lit, &commands, Follows::Design)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::plan::{PlanOptions, plan};

    const CLOCK: LampClock =
        LampClock { delay_s: 0.025, tick_s: 0.05, phase_s: 0.0, rise_s: 0.0, decay_s: 0.0 };

    fn noor() -> Plan {
        let strokes = write("NOE", &LetterOptions::default()).unwrap();
        plan(&strokes, &PlanOptions::even()).unwrap()
    }

    /// A flight that follows the design exactly, late by `lag_s` and 0.1 m to the left.
    fn late(plan: &Plan, lag_s: f64) -> Flight {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a flight")]
        let n = (plan.duration_s() * 250.0) as u32;
        let sample = |k: u32| {
            let time_s = f64::from(k) / 250.0;
            let row = plan.setpoints.partition_point(|s| s.time_s <= time_s).max(1) - 1;
            FlightSample {
                time_s,
                position_m: plan.design_m((time_s - lag_s).max(0.0)) - Vector3::x() * 0.1,
                design_m: plan.design_m(time_s),
                letter: plan.setpoints[row].letter,
                ..FlightSample::default()
            }
        };
        Flight { samples: (0..=n).map(sample).collect(), ..Flight::default() }
    }

    #[test]
    fn light_meets_the_strokes_whatever_the_lag_of_the_flight() {
        let plan = noor();
        // The clock's grid leaves half a tick: 25 ms at 0.2 m/s are 5 mm.
        for (lag_s, most_m) in [(0.0, 0.0016), (0.5, 0.0016), (0.533, 0.0066)] {
            let flight = late(&plan, lag_s);
            let (_, ends) = on_the_lights_clock(&plan, &flight, &CLOCK, Follows::Held).unwrap();
            assert_eq!(ends.len(), 8, "N, O and the two strokes of E");
            for end in ends {
                assert!(end.streak_m.abs() < most_m, "lag {lag_s} s: {end:?}");
            }
        }
    }

    #[test]
    fn commands_go_out_ahead_of_the_tick_by_the_radio_and_half_a_tick() {
        let plan = noor();
        let flight = late(&plan, 0.5);
        let (aimed, ends) = on_the_lights_clock(&plan, &flight, &CLOCK, Follows::Held).unwrap();
        let lights = &aimed.lights["headlights"];
        let on = (1..lights.len()).find(|row| lights[*row] > 0.0).unwrap();
        assert!((aimed.setpoints[on].time_s - (ends[0].time_s - 0.05)).abs() < 1e-5);
        assert!(aimed.setpoints.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
        let wanted: f64 = plan.lit().iter().sum();
        let kept: f64 = aimed
            .lit
            .iter()
            .zip(aimed.setpoints.windows(2))
            .map(|(lit, pair)| lit * (pair[1].time_s - pair[0].time_s) / 0.05)
            .sum();
        assert!((kept - wanted).abs() < 0.1, "the wish is kept: {kept} of {wanted}");
    }

    #[test]
    fn an_old_clock_on_board_lets_the_lights_run_ahead() {
        let clock = 84.0 / 85.0;
        let plan = noor();
        let paced = on_a_skewed_clock(plan.clone(), clock);
        let late_s = paced.duration_s() - plan.duration_s();
        assert!((late_s - plan.duration_s() / 84.0).abs() < 1e-5, "0.71 s a minute: {late_s}");
        let last_lit = |plan: &Plan| {
            let lights = &plan.lights["headlights"];
            plan.setpoints[lights.iter().rposition(|l| *l > 0.0).unwrap() + 1].time_s
        };
        assert!((last_lit(&paced) - last_lit(&plan)).abs() < 1e-5, "the host's clock is right");
        let (_, ends) =
            on_the_lights_clock(&paced, &late(&paced, 0.0), &CLOCK, Follows::Design).unwrap();
        assert!(ends.iter().all(|end| end.streak_m.abs() < 0.006), "{ends:?}");
    }
}
