//! Style `even`, with strokes in the shortest order at one speed, and time-optimal transits.
//!
//! Every stroke begins and ends at a 50 ms tick of the lamp timer, so that light commands can
//! coincide with its ends. All setpoints are on one time grid. A controller that holds positions
//! therefore acts on them as a linear filter.

use nalgebra::{Vector2, Vector3};

use super::motion::{Motion, SLACK_TICKS, State};
use super::order::TOO_LONG_HINT;
use super::pen::{PenStroke, dot_s};
use super::transit::Transit;
use super::{EvenStyle, Extent, LightLevel, Plan, PlanData, PlanOptions, Setpoint};
use noctograph_core::crazyflie::RING_TICK_S;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::table::{FLIGHT_LONG, MAX_DURATION_S, on_grid};

/// Number of levels of a dimmed light. Finer levels would be invisible and need more commands.
const LEVEL_STEPS: f64 = 50.0;
/// Minimum light level, which keeps a slow corner from becoming dark.
const LEAST_LEVEL: f64 = 0.04;
/// Height in m above its home to which each of several drones climbs first.
const OVER_HOME_M: f64 = 0.3;
/// Acceleration of the take-off as a fraction of that of other transits. A climb that saturates the
/// motors winds up a PID controller's integrators. The drone would then write the first letter too
/// high.
const TAKE_OFF_FRACTION: f64 = 0.5;
/// Run-in of the first stroke, in s of flight at stroke speed from the hover to its beginning.
const RUN_IN_S: f64 = 0.3;
/// Delay in s of the light relative to a loop's beginning and end, so that the drone is equally far
/// off the curve when the light goes on and off.
const LEAD_S: f64 = 0.4;
/// Shortest loop that has a run-in, in lengths of the run-in.
const LEAST_LEADS: f64 = 3.0;
/// Length in m by which a loop's light overlaps itself. The light's beginning and end are each
/// uncertain by half a tick of the lamp timer (5 mm at 0.2 m/s), and the drone's position along the
/// curve is uncertain by as much.
const OVERLAP_M: f64 = 0.015;
/// Wait in s at the first letter if only the letters are planned.
const LETTERS_WAIT_S: f64 = 0.5;
/// Tolerance in s for rounding in sums of times.
const SLACK_S: f64 = 1e-6;
/// Minimum time in s between two setpoints.
const LEAST_INTERVAL_S: f64 = 1e-4;
/// Hover in s at a dot before its light goes on, so that the drone comes to rest.
const SETTLE_S: f64 = 0.2;

/// Part of the flight with one kind of path.
#[derive(Debug)]
struct Segment {
    start_s: f64,
    letter: Option<usize>,
    path: Path,
}

impl Segment {
    /// True if the light is on along the segment.
    fn is_lit(&self) -> bool {
        matches!(self.path, Path::Lit(_) | Path::Dot(_))
    }
}

/// Path of a segment, in the plane of the word.
#[derive(Debug)]
enum Path {
    /// Position in m at which the drone waits or hovers in the dark.
    Still(Vector2<f64>),
    /// Beginning of a motion before its light goes on.
    RunIn(Motion),
    /// Lit stroke.
    Lit(Motion),
    /// Position in m at which the drone hovers with its light on.
    Dot(Vector2<f64>),
    /// Flight in the dark.
    Dark(Transit),
}

impl Path {
    /// Returns the state at a time in s after the path's beginning, in the plane of the word.
    fn state_at(&self, time_s: f64) -> State {
        match self {
            Self::Still(position_m) | Self::Dot(position_m) => {
                State { position_m: *position_m, ..State::default() }
            }
            Self::RunIn(motion) | Self::Lit(motion) => motion.state_at(time_s),
            Self::Dark(transit) => transit.state_at(time_s),
        }
    }
}

/// Plans strokes in their order. The drone takes off and lands at `home_x_m`, or below its first
/// and last stroke if that is `None`. Returns an error for a flight that is too long or has no
/// transit between two strokes.
pub(super) fn plan(
    drawn: &[PenStroke],
    options: &PlanOptions,
    style: &EvenStyle,
    home_x_m: Option<f64>,
) -> Result<Plan> {
    let home_x_m = home_x_m.filter(|_| options.extent == Extent::Whole);
    let mut course = Course {
        options,
        style,
        home_x_m,
        n_strokes: drawn.len(),
        segments: Vec::new(),
        end_s: 0.0,
        state: State::default(),
    };
    // Each segment begins in the final state of the previous one.
    course.begin(drawn)?;
    for stroke in drawn {
        course.draw(stroke)?;
    }
    course.finish()?;
    Ok(course.sampled())
}

/// Flight that is being planned, with the time and the state at its end so far.
struct Course<'a> {
    options: &'a PlanOptions,
    style: &'a EvenStyle,
    home_x_m: Option<f64>,
    n_strokes: usize,
    segments: Vec<Segment>,
    end_s: f64,
    state: State,
}

impl Course<'_> {
    /// Adds the wait on the floor, the take-off, and the hover before the first stroke. With
    /// [`Extent::Letters`], only a wait at the stroke's beginning is added.
    fn begin(&mut self, drawn: &[PenStroke]) -> Result<()> {
        let first = match drawn[0].dot_m() {
            Some(dot_m) => rest(dot_m.x, dot_m.y),
            None => self.motion(&drawn[0]).state_at(0.0),
        };
        let below = Vector2::new(self.home_x_m.unwrap_or(first.position_m.x), 0.0);
        match self.options.extent {
            Extent::Whole => self.push(None, Path::Still(below), self.options.floor_wait_s)?,
            Extent::Letters => self.push(None, Path::Still(first.position_m), LETTERS_WAIT_S)?,
        }
        let acceleration_m_s2 = TAKE_OFF_FRACTION * self.style.acceleration_m_s2;
        let gentle = EvenStyle { acceleration_m_s2, ..self.style.clone() };
        if let Some(home_x_m) = self.home_x_m {
            self.go_by(&gentle, None, &rest(home_x_m, OVER_HOME_M))?;
        }
        // The hover is behind the stroke's beginning, where the drone reaches the stroke speed.
        if self.options.extent == Extent::Whole && self.style.hover_s > 0.0 {
            let before_m = first.position_m - first.velocity_m_s * RUN_IN_S;
            self.go_by(&gentle, None, &rest(before_m.x, before_m.y))?;
            self.push(None, Path::Still(before_m), self.style.hover_s)?;
        }
        Ok(())
    }

    /// Adds the transit to a stroke, and the lit path along it. A dot is lit while the drone stays
    /// there.
    fn draw(&mut self, stroke: &PenStroke) -> Result<()> {
        // The transit to the first stroke belongs to no letter.
        let letter = self.segments.iter().any(Segment::is_lit).then_some(stroke.letter);
        if let Some(dot_m) = stroke.dot_m() {
            self.go(letter, &rest(dot_m.x, dot_m.y))?;
            self.push(letter, Path::Still(dot_m), SETTLE_S)?;
            let lit_s = dot_s(self.options.stroke_speed_m_s);
            return self.push(Some(stroke.letter), Path::Dot(dot_m), lit_s);
        }
        let mut motion = self.motion(stroke);
        self.go(letter, &motion.state_at(0.0))?;
        if self.lead_m(stroke) > 0.0 {
            self.push(letter, Path::RunIn(motion.clone()), LEAD_S)?;
            motion = motion.after(LEAD_S);
        }
        let duration_s = motion.duration_s();
        self.push(Some(stroke.letter), Path::Lit(motion), duration_s)
    }

    /// Adds the flight home and the landing, or with [`Extent::Letters`] the stop after the
    /// letters.
    fn finish(&mut self) -> Result<()> {
        let (x, y) = (self.state.position_m.x, self.state.position_m.y);
        if self.options.extent == Extent::Letters {
            return self.go(None, &rest(x, y));
        }
        if let Some(home_x_m) = self.home_x_m {
            self.go(None, &rest(home_x_m, OVER_HOME_M))?;
        }
        let home = Vector2::new(self.home_x_m.unwrap_or(x), 0.0);
        self.go(None, &rest(home.x, self.options.landing_height_m))?;
        self.push(None, Path::Still(home), self.options.floor_wait_s)
    }

    /// Returns the motion along a stroke. A loop continues past its end and overlaps its beginning.
    fn motion(&self, stroke: &PenStroke) -> Motion {
        let more_m = if stroke.is_loop() { OVERLAP_M + self.lead_m(stroke) } else { 0.0 };
        let stroke = stroke.overlapped(more_m);
        Motion::new(&stroke, self.options.stroke_speed_m_s, self.style, RING_TICK_S)
    }

    /// Returns the length in m of a loop's run-in, which is 0 for other strokes, and for loops that
    /// are shorter than [`LEAST_LEADS`] run-ins.
    fn lead_m(&self, stroke: &PenStroke) -> f64 {
        let lead_m = LEAD_S * self.options.stroke_speed_m_s;
        if stroke.is_loop() && stroke.length_m() > LEAST_LEADS * lead_m { lead_m } else { 0.0 }
    }

    /// Adds a transit to a state in the style of the course.
    fn go(&mut self, letter: Option<usize>, to: &State) -> Result<()> {
        self.go_by(self.style, letter, to)
    }

    /// Adds a transit to a state, with the limits of `style`. If Ruckig finds none, the
    /// acceleration at both ends is set to zero. Returns [`Error::Infeasible`] if there is still no
    /// transit.
    fn go_by(&mut self, style: &EvenStyle, letter: Option<usize>, to: &State) -> Result<()> {
        let unaccelerated = |state: &State| State { acceleration_m_s2: Vector2::zeros(), ..*state };
        let transit = Transit::new(&self.state, to, style, RING_TICK_S).or_else(|| {
            Transit::new(&unaccelerated(&self.state), &unaccelerated(to), style, RING_TICK_S)
        });
        let transit = transit.ok_or_else(|| {
            Error::infeasible(
                format!("no transit was found after {:.2} s", self.end_s),
                "raise plan.style.dark_speed_m_s above plan.stroke_speed_m_s, or raise \
                 plan.style.jerk_m_s3",
            )
        })?;
        let duration_s = transit.duration_s();
        self.push(letter, Path::Dark(transit), duration_s)
    }

    /// Adds a segment whose duration is rounded up to whole ticks of the light. Returns
    /// [`Error::Infeasible`] if the flight becomes too long.
    fn push(&mut self, letter: Option<usize>, path: Path, duration_s: f64) -> Result<()> {
        let n_ticks = (duration_s / RING_TICK_S - SLACK_TICKS).ceil();
        let rounded_s = n_ticks * RING_TICK_S;
        self.state = path.state_at(rounded_s);
        self.segments.push(Segment { start_s: self.end_s, letter, path });
        self.end_s += rounded_s;
        // The flight is refused here, before more of it is planned or sampled.
        if self.end_s <= MAX_DURATION_S {
            return Ok(());
        }
        let n_drawn = self.segments.iter().filter(|segment| segment.is_lit()).count();
        let problem = format!(
            "{n_drawn} of {} strokes take more than {MAX_DURATION_S} s, the limit of a flight",
            self.n_strokes
        );
        Err(Error::infeasible(problem, TOO_LONG_HINT).coded(FLIGHT_LONG))
    }

    /// Returns the plan with setpoints on the grid and at the ends of segments.
    fn sampled(&self) -> Plan {
        let interval_s = self.options.setpoint_interval_s;
        let starts_s = self.segments.iter().map(|segment| segment.start_s);
        let on_grid_s = (0..).map(|n| f64::from(n) * interval_s);
        let on_grid_s = on_grid_s.take_while(|time_s| *time_s < self.end_s);
        let mut times_s: Vec<f64> = starts_s.chain([self.end_s]).chain(on_grid_s).collect();
        times_s.sort_unstable_by(f64::total_cmp);
        times_s.dedup_by(|later, earlier| *later - *earlier < LEAST_INTERVAL_S);
        let mut plan = PlanData::with_channels(&self.options.lights);
        // The last setpoint ends the flight, without light and without a letter.
        let later_s = times_s.iter().skip(1).copied().map(Some).chain([None]);
        for (time_s, next_s) in times_s.iter().copied().zip(later_s) {
            let n_begun =
                self.segments.partition_point(|segment| segment.start_s <= time_s + SLACK_S);
            let segment = &self.segments[n_begun.max(1) - 1];
            let State { position_m, velocity_m_s, acceleration_m_s2 } =
                segment.path.state_at(time_s - segment.start_s);
            let setpoint = Setpoint {
                time_s: on_grid(time_s),
                position_m: world(position_m),
                velocity_m_s: world(velocity_m_s),
                acceleration_m_s2: world(acceleration_m_s2),
                letter: segment.letter.filter(|_| next_s.is_some()),
            };
            let level = next_s.map_or(0.0, |next_s| self.level(segment, time_s, next_s));
            plan.push(setpoint, level);
        }
        Plan::made(plan)
    }

    /// Returns the light level, 0 to 1, from a setpoint at `from_s` up to the next one at `next_s`.
    /// A dimmed light has the ratio of the mean speed to the stroke speed, so that a slow corner is
    /// not brighter.
    fn level(&self, segment: &Segment, from_s: f64, next_s: f64) -> f64 {
        let motion = match &segment.path {
            Path::Lit(motion) => motion,
            Path::Dot(_) => return 1.0,
            Path::Still(_) | Path::RunIn(_) | Path::Dark(_) => return 0.0,
        };
        if self.style.exposure == LightLevel::Switched {
            return 1.0;
        }
        // The mean speed is computed by the midpoint rule with four points.
        let speeds = [1.0, 3.0, 5.0, 7.0].map(|eighth| {
            let time_s = from_s + (next_s - from_s) * eighth / 8.0 - segment.start_s;
            motion.state_at(time_s).velocity_m_s.norm()
        });
        let level = speeds.iter().sum::<f64>() / 4.0 / self.options.stroke_speed_m_s;
        ((level * LEVEL_STEPS).round() / LEVEL_STEPS).clamp(LEAST_LEVEL, 1.0)
    }
}

/// Converts a vector in the plane of the word to one in the world, rounded to multiples of 1e-6.
fn world(vector: Vector2<f64>) -> Vector3<f64> {
    Vector3::new(vector.x, 0.0, vector.y).map(on_grid)
}

/// Returns the state of a drone at rest at a position.
fn rest(x_m: f64, height_m: f64) -> State {
    State { position_m: Vector2::new(x_m, height_m), ..State::default() }
}

#[cfg(test)]
mod tests {
    use crate::tests::written;
    use crate::{EvenStyle, LightLevel, Plan, PlanOptions, plan};
    use noctograph_letters::{LetterOptions, write};

    fn noor(options: &PlanOptions) -> Plan {
        written("NOOR", options)
    }

    #[test]
    fn noor_at_the_reference_speed_takes_less_than_seven_tenths_of_the_time() {
        // The reference flight's setpoints lasted 56.9 s, and its plan lasts 58.2 s.
        let even_s = noor(&PlanOptions::even()).duration_s();
        assert!(even_s < 0.7 * 56.9, "{even_s} s");
    }

    #[test]
    fn noor_at_half_a_meter_a_second_takes_less_than_four_tenths() {
        // The corners may deviate by 3 cm in letters of 50 cm. With 1 cm, the flight takes 23.95 s.
        // The hover before the first stroke is left out.
        let fast = PlanOptions {
            stroke_speed_m_s: 0.5,
            ..PlanOptions::even_with(EvenStyle {
                dark_speed_m_s: 0.5,
                corner_error_m: 0.03,
                hover_s: 0.0,
                ..EvenStyle::default()
            })
        };
        let fast_s = noor(&fast).duration_s();
        assert!(fast_s < 0.4 * 56.9, "{fast_s} s");
    }

    #[test]
    fn the_design_is_smooth_and_within_the_limits() {
        let plan = noor(&PlanOptions::even());
        for pair in plan.setpoints.windows(2) {
            let [now, next] = [&pair[0], &pair[1]];
            assert!((next.time_s - now.time_s - 0.05).abs() < 2e-6, "one grid: {}", now.time_s);
            assert!(now.velocity_m_s.norm() < 1.0 + 1e-5, "{now:?}");
            assert!(now.acceleration_m_s2.norm() < 2.0 * 1.04, "{now:?}");
            if next.position_m.z > 0.0 && now.position_m.z > 0.0 {
                // Within a setpoint's time t, the jerk j moves the design by j t³ / 6.
                let jump_m = (next.position_m - now.design_m(next.time_s)).norm();
                assert!(jump_m < 30.0 * 0.05 * 0.05 * 0.05 / 6.0 * 1.5, "{jump_m} m at {now:?}");
            }
        }
    }

    #[test]
    fn a_dot_is_a_lit_hover() {
        let simplex = LetterOptions { font: "simplex".into(), ..LetterOptions::default() };
        let roboto = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fonts/Roboto-Thin.ttf");
        for (font, word, dots) in [("simplex", "Äi:", 5), (roboto, "ij", 2)] {
            let options = LetterOptions { font: font.into(), ..simplex.clone() };
            let even = plan(&write(word, &options).unwrap(), &PlanOptions::even()).unwrap();
            let rows = even.setpoints.windows(2).zip(&even.lights["headlights"]);
            let still = rows.filter(|(pair, level)| {
                **level > 0.0 && pair.iter().all(|setpoint| setpoint.velocity_m_s.norm() == 0.0)
            });
            let still_s: f64 = still.map(|(pair, _)| pair[1].time_s - pair[0].time_s).sum();
            // The first dark setpoint after the stroke is also at rest, so the whole stroke counts.
            let wanted_s = 0.2 * f64::from(dots);
            assert!((still_s - wanted_s).abs() < 1e-4, "{word} in {font}: {still_s} s");
        }
        let team = plan(&write("i", &simplex).unwrap(), &PlanOptions::default()).unwrap();
        let stem_s = 14.0 / 21.0 * 0.5 / 0.2;
        let lit_s = team.full_light_s();
        assert!((lit_s - stem_s - 0.2).abs() < 1e-3, "in style team, too: {lit_s} s");
    }

    #[test]
    fn the_light_covers_the_length_of_the_word() {
        let style = EvenStyle { exposure: LightLevel::Dimmed, ..EvenStyle::default() };
        let plan = noor(&PlanOptions::even_with(style));
        let painted_m = 0.2 * plan.full_light_s();
        assert!((painted_m - (1.583_095 + 3.2 + 1.740_512)).abs() < 0.12, "{painted_m} m");
        let lit = plan.lights["headlights"].iter().zip(&plan.setpoints);
        for (_, setpoint) in lit.filter(|(level, _)| **level > 0.0) {
            assert!(setpoint.velocity_m_s.norm() > 0.03, "no lit dwell: {setpoint:?}");
        }
    }
}
