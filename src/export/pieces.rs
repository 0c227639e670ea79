//! Pieces of a trajectory: a plan's design path as polynomials of time.
//!
//! A plan has a setpoint every few hundredths of a second, too many for a drone's memory. Both
//! trajectory forms of the Crazyflie take longer pieces: [`super::compressed`] cubics, and
//! [`super::poly4d`] polynomials of degree 7. [`pieces`] finds them greedily: each is the longest
//! that keeps to the design and to its limits.

use std::collections::BTreeSet;
use std::ops::Range;

use nalgebra::Vector3;

use noctograph_core::error::{Error, Result};
use noctograph_plan::{Plan, Setpoint};

/// Least number of times between two setpoints at which a piece is compared with the design, and
/// the longest time between two of them, s: a run-up is 0.5 s without a setpoint.
const CHECKS_PER_SETPOINT: f64 = 4.0;
const CHECK_INTERVAL_S: f64 = 0.02;

/// Time in which a trajectory on board comes from rest to the speed of the first letter, and from
/// that of the last one to rest, s: 0.4 m/s² at 0.2 m/s.
const RUN_S: f64 = 0.5;

/// Largest speed and acceleration of a piece at the times of comparison, relative to those of the
/// design. Between these times they are up to a twentieth over.
const OVER_LIMITS: f64 = 1.04;

/// Step of the drone's evaluator, s (`stabilizer.c`).
const STEP_S: f64 = 0.001;

/// Shorter pieces that are tried before one is left over the limits.
const RETRIES: u32 = 200;

/// The part of a plan that flies as a trajectory: a run-up from rest, all letters, and a run-out to
/// rest. Take-off and landing are separate commands.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) setpoints: Vec<Setpoint>,
    /// Acceleration at the end of the letters, where the run-out begins, m/s².
    stop_m_s2: Vector3<f64>,
    /// Heading of its plan.
    pub(super) yaw_rad: f64,
}

impl Stretch {
    pub(super) fn new(plan: &Plan) -> Result<Self> {
        let first = plan.setpoints.iter().position(|setpoint| setpoint.letter.is_some());
        let last = plan.setpoints.iter().rposition(|setpoint| setpoint.letter.is_some());
        let Some((first, last)) = first.zip(last).filter(|(first, last)| first < last) else {
            let hint = "plan a word, not only a take-off";
            return Err(Error::input("plan", "no letter", "setpoints that write a letter", hint));
        };
        // The last stroke ends at the setpoint after the last one of a letter.
        let end = (last + 1).min(plan.setpoints.len() - 1);
        let (start, stop) = (&plan.setpoints[first], &plan.setpoints[end]);
        // Even acceleration over RUN_S to the speed of the first letter, and from the last one's.
        let run_up = Setpoint {
            time_s: start.time_s - RUN_S,
            position_m: start.position_m - start.velocity_m_s * (RUN_S / 2.0),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: start.velocity_m_s / RUN_S,
            letter: None,
        };
        let run_out =
            Setpoint { acceleration_m_s2: -stop.velocity_m_s / RUN_S, letter: None, ..*stop };
        let rest = Setpoint {
            time_s: stop.time_s + RUN_S,
            position_m: run_out.design_m(stop.time_s + RUN_S),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: None,
        };
        let letters = plan.setpoints[first..end].iter().copied();
        let setpoints: Vec<_> =
            [run_up].into_iter().chain(letters).chain([run_out, rest]).collect();
        if let Some(low) = setpoints.iter().find(|setpoint| setpoint.on_floor()) {
            let (z_m, time_s) = (low.position_m.z, low.time_s);
            let what = format!(
                "the letters or the run-up to them reach down to {z_m:.2} m at {time_s:.1} s"
            );
            let hint = "write higher (letters.baseline_m) or slower (plan.stroke_speed_m_s)";
            return Err(Error::infeasible(what, hint));
        }
        let stop_m_s2 = stop.acceleration_m_s2;
        Ok(Self { setpoints, stop_m_s2, yaw_rad: plan.yaw_rad })
    }

    pub(super) fn start_s(&self) -> f64 {
        self.setpoints[0].time_s
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.time_s(self.last())
    }

    pub(super) fn last(&self) -> usize {
        self.setpoints.len() - 1
    }

    /// Time of a setpoint since the start of the stretch, s.
    pub(super) fn time_s(&self, index: usize) -> f64 {
        self.setpoints[index].time_s - self.start_s()
    }

    /// Acceleration just before a setpoint, m/s²: run-up and run-out begin and end with a jump.
    pub(super) fn acceleration_before_m_s2(&self, index: usize) -> Vector3<f64> {
        match self.last() - index {
            1 => self.stop_m_s2,
            0 => self.setpoints[index - 1].acceleration_m_s2,
            _ if index == 1 => self.setpoints[0].acceleration_m_s2,
            _ => self.setpoints[index].acceleration_m_s2,
        }
    }

    /// Position of the design at a time since the start, m.
    pub(super) fn position_m(&self, time_s: f64) -> Vector3<f64> {
        let time_s = time_s + self.start_s();
        let after = self.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s);
        let setpoint = &self.setpoints[after.saturating_sub(1)];
        setpoint.design_m(time_s.max(setpoint.time_s))
    }

    /// Largest speed of the design, m/s, and its largest acceleration, m/s².
    pub(super) fn limits(&self) -> [f64; 2] {
        let speeds = self.setpoints.iter().map(|s| s.velocity_m_s.norm());
        let accelerations = self.setpoints.iter().map(|s| s.acceleration_m_s2.norm());
        [speeds.fold(0.0, f64::max), accelerations.fold(0.0, f64::max)]
    }

    /// Largest distance of a trajectory from the design at any of the drone's milliseconds, m. Just
    /// before a setpoint a design of constant accelerations is the farthest off.
    pub(super) fn worst_m(&self, pieces: &[Polynomials]) -> f64 {
        let (mut worst_m, mut start_s) = (0.0, 0.0);
        for piece in pieces {
            let steps = (piece.duration_s / STEP_S).ceil().max(1.0);
            let times_s = (0..).map(f64::from).take_while(|step| *step <= steps);
            let distances_m = times_s.map(|step| {
                let t = piece.duration_s * step / steps;
                (piece.evaluate(t)[0] - self.position_m(start_s + t)).norm()
            });
            worst_m = distances_m.fold(worst_m, f64::max);
            start_s += piece.duration_s;
        }
        worst_m
    }

    /// The error for a trajectory that `needs` more than the drone's memory, with the number of
    /// letters that fit before `until_s`.
    pub(super) fn too_long(&self, until_s: f64, needs: &str, hint: &str) -> Error {
        let [begun, total] = [until_s, f64::INFINITY].map(|until_s| {
            let flown = self.setpoints.iter().filter(|s| s.time_s - self.start_s() < until_s);
            flown.filter_map(|setpoint| setpoint.letter).collect::<BTreeSet<_>>().len()
        });
        // The last letter that begins in time does not end in time.
        let what = format!("{needs}: {} of {total} letters fit", begun.saturating_sub(1));
        Error::infeasible(what, hint)
    }

    /// Times at which a piece between two setpoints is compared with the design.
    pub(super) fn check_times_s(&self, from: usize, to: usize) -> impl Iterator<Item = f64> {
        (from..to).flat_map(move |index| {
            let (start_s, end_s) = (self.time_s(index), self.time_s(index + 1));
            let n = ((end_s - start_s) / CHECK_INTERVAL_S).ceil().max(CHECKS_PER_SETPOINT);
            (1..)
                .map(f64::from)
                .take_while(move |check| *check <= n)
                .map(move |check| start_s + (end_s - start_s) * check / n)
        })
    }
}

/// Coefficients of an axis in ascending powers of the time in s.
pub(super) type Polynomial = [f64; 8];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Polynomials {
    pub(super) duration_s: f64,
    pub(super) axes: [Polynomial; 3],
}

impl Polynomials {
    /// From rest to rest without jerk at the ends, as the firmware's take-off and landing
    /// (`pptraj.c`, `poly7_nojerk`).
    pub(super) fn from_rest_to_rest([from_m, to_m]: [Vector3<f64>; 2], duration_s: f64) -> Self {
        let path_m = to_m - from_m;
        let axes = [0, 1, 2].map(|axis| {
            // The smoothstep 35 s⁴ - 84 s⁵ + 70 s⁶ - 20 s⁷ of s = t/T.
            let mut power = 1.0;
            let mut polynomial = [0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0].map(|factor| {
                let coefficient = path_m[axis] * factor / power;
                power *= duration_s;
                coefficient
            });
            polynomial[0] = from_m[axis];
            polynomial
        });
        Self { duration_s, axes }
    }

    /// Position, velocity and acceleration at a time since its start, in m and s.
    pub(super) fn evaluate(&self, t: f64) -> [Vector3<f64>; 3] {
        // Horner's scheme for the value, the first derivative and half the second one.
        let axes = self.axes.map(|c| {
            c.iter().rev().fold([0.0; 3], |[p, v, a], c| [p * t + c, v * t + p, a * t + v])
        });
        let [p, v, a] = [0, 1, 2].map(|k| Vector3::from(axes.map(|axis| axis[k])));
        [p, v, 2.0 * a]
    }
}

/// Position, velocity and acceleration of pieces in order at a time since their start. After the
/// last one they are at rest at its end.
pub(super) fn motion(pieces: &[Polynomials], time_s: f64) -> [Vector3<f64>; 3] {
    let (mut left_s, mut end) = (time_s.max(0.0), [Vector3::zeros(); 3]);
    for piece in pieces {
        if left_s < piece.duration_s {
            return piece.evaluate(left_s);
        }
        left_s -= piece.duration_s;
        end[0] = piece.evaluate(piece.duration_s)[0];
    }
    end
}

/// How the numbers of a piece are rounded to those of its form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rounding {
    /// To the nearest.
    Nearest,
    /// To the neighbors with the least acceleration.
    Gentlest,
}

/// The pieces of a stretch, found greedily with backtracking. Each is the longest that stays within
/// `tolerance_m` of the design, within `max_piece_s`, and within the speed and acceleration of the
/// design. If no piece can follow it, a shorter one is taken. `piece` makes the piece between two
/// setpoints after the pieces so far. If the design states no acceleration, only the distance
/// decides, and the piece to the next setpoint is taken in any case.
pub(super) fn pieces<P>(
    stretch: &Stretch,
    tolerance_m: f64,
    max_piece_s: f64,
    piece: impl Fn(usize, usize, &[P], Rounding) -> P,
    polynomials: impl Fn(&P) -> Polynomials,
) -> Vec<P> {
    let fit = Fit {
        stretch,
        limits: stretch.limits(),
        tolerance_m,
        max_piece_s,
        motion: &|from, to, before, rounding| polynomials(&piece(from, to, before, rounding)),
    };
    // The pieces, and for each its first setpoint and the ends that were not tried.
    let (mut done, mut tried): (Vec<P>, Vec<(usize, Range<usize>)>) = (Vec::new(), Vec::new());
    let (mut start, mut stuck_start, mut retries) = (0, 0, 0);
    let mut untried = fit.ends(0, &done);
    while start < stretch.last() {
        let mut next = fit.longest(start, &mut untried, &done);
        if next.is_none() {
            (stuck_start, retries) =
                if start > stuck_start { (start, 1) } else { (stuck_start, retries + 1) };
            // Back to the last piece that can be shorter. Those after it are made again.
            let other =
                (0..done.len()).rev().filter(|_| retries <= RETRIES).find_map(|index: usize| {
                    let (from, untried) = &mut tried[index];
                    Some((index, fit.longest(*from, untried, &done[..index])?))
                });
            if let Some((index, to)) = other {
                done.truncate(index);
                (start, untried) = tried.swap_remove(index);
                tried.truncate(index);
                next = Some(to);
            }
        }
        // The retries are used up: the piece with the least effort, over the limits or not.
        let next = next.map(|to| (to, Rounding::Nearest)).or_else(|| fit.gentlest(start, &done));
        let (to, rounding) = next.expect("the next setpoint");
        let made = piece(start, to, &done, rounding);
        done.push(made);
        tried.push((start, untried));
        start = to;
        untried = fit.ends(start, &done);
    }
    done
}

/// Motion of the piece between two setpoints after the pieces so far.
type Motion<'a, P> = dyn Fn(usize, usize, &[P], Rounding) -> Polynomials + 'a;

struct Fit<'a, P> {
    stretch: &'a Stretch,
    limits: [f64; 2],
    tolerance_m: f64,
    max_piece_s: f64,
    motion: &'a Motion<'a, P>,
}

impl<P> Fit<'_, P> {
    fn is_near(&self, from: usize, to: usize, before: &[P], rounding: Rounding) -> bool {
        let made = (self.motion)(from, to, before, rounding);
        let start_s = self.stretch.time_s(from);
        self.stretch.time_s(to) - start_s < self.max_piece_s
            && self.stretch.check_times_s(from, to).all(|t| {
                let position_m = made.evaluate((t - start_s).min(made.duration_s))[0];
                (position_m - self.stretch.position_m(t)).norm() <= self.tolerance_m
            })
    }

    fn farthest(&self, from: usize, before: &[P]) -> usize {
        longest(from, self.stretch.last(), |to| self.is_near(from, to, before, Rounding::Nearest))
    }

    /// Largest speed or acceleration relative to the design's.
    fn effort(&self, from: usize, to: usize, before: &[P], rounding: Rounding) -> f64 {
        let made = (self.motion)(from, to, before, rounding);
        let [max_m_s, max_m_s2] = self.limits;
        let start_s = self.stretch.time_s(from);
        let times_s = self.stretch.check_times_s(from, to).map(|t| t - start_s);
        let efforts = [0.0].into_iter().chain(times_s).map(|t| {
            let [_, v, a] = made.evaluate(t);
            f64::max(v.norm() / max_m_s, a.norm() / max_m_s2)
        });
        efforts.fold(0.0, f64::max)
    }

    /// Ends of pieces from a setpoint to be tried.
    fn ends(&self, from: usize, before: &[P]) -> Range<usize> {
        if from == self.stretch.last() {
            return 0..0;
        }
        let farthest = self.farthest(from, before);
        let shortest = if self.limits[1] > 0.0 { from + 1 } else { farthest };
        shortest..farthest + 1
    }

    /// The end of the longest piece that keeps to the limits. Removes it and those beyond it from
    /// `ends`.
    fn longest(&self, from: usize, ends: &mut Range<usize>, before: &[P]) -> Option<usize> {
        let rounding = Rounding::Nearest;
        ends.rfind(|to| {
            self.limits[1] == 0.0
                || self.effort(from, *to, before, rounding) <= OVER_LIMITS
                    && self.is_near(from, *to, before, rounding)
        })
    }

    /// End and rounding of the piece with the least effort. One to the next setpoint always counts.
    fn gentlest(&self, from: usize, before: &[P]) -> Option<(usize, Rounding)> {
        let ends = (from + 1..=self.farthest(from, before))
            .flat_map(|to| [Rounding::Nearest, Rounding::Gentlest].map(|rounding| (to, rounding)));
        let allowed = ends.filter(|(to, rounding)| {
            (*to, *rounding) == (from + 1, Rounding::Nearest)
                || self.is_near(from, *to, before, *rounding)
        });
        let efforts = allowed.map(|end| (end, self.effort(from, end.0, before, end.1)));
        efforts.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(end, _)| end)
    }
}

/// The setpoint at which the longest piece from `from` ends: doubles the length until a piece
/// fails, then halves the step.
fn longest(from: usize, last: usize, fits: impl Fn(usize) -> bool) -> usize {
    let (mut good, mut step) = (from + 1, 1);
    while good + step <= last && fits(good + step) {
        good += step;
        step *= 2;
    }
    while step > 0 {
        if good + step <= last && fits(good + step) {
            good += step;
        }
        step /= 2;
    }
    good
}
