//! Pieces of a trajectory: the design path of a plan as polynomials in time.
//!
//! A plan has a setpoint every few hundredths of a second, which is too many for a drone's memory.
//! The two trajectory forms of the Crazyflie use longer pieces: cubics ([`super::compressed`]), and
//! polynomials of degree 7 ([`super::poly4d`]). [`pieces`] determines them greedily: each is the
//! longest that stays close to the design and within its limits.

use std::collections::BTreeSet;
use std::ops::Range;

use nalgebra::Vector3;

use noctograph_core::error::{Error, Result};
use noctograph_plan::{Plan, Setpoint};

/// Minimum number of times between two setpoints at which a piece is compared with the design, and
/// the maximum interval between these times, s. A run-up of 0.5 s contains no setpoint.
const CHECKS_PER_SETPOINT: f64 = 4.0;
const CHECK_INTERVAL_S: f64 = 0.02;

/// Time in s that a trajectory takes to accelerate from rest to the speed of the first letter, or
/// to brake to rest from the speed of the last one. At 0.2 m/s the acceleration is 0.4 m/s².
const RUN_S: f64 = 0.5;

/// Maximum speed and acceleration of a piece at the times of comparison, relative to those of the
/// design. Between these times they exceed the design's by up to a twentieth.
const OVER_LIMITS: f64 = 1.04;

/// Time step of the drone's evaluator, s (`stabilizer.c`).
const STEP_S: f64 = 0.001;

/// Maximum number of times that the search backtracks before a piece may exceed the limits.
const RETRIES: u32 = 200;

/// Part of a plan that is flown as a trajectory: a run-up from rest, all letters, and a run-out to
/// rest. Take-off and landing are separate commands.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    pub(super) setpoints: Vec<Setpoint>,
    /// Acceleration at the end of the letters, where the run-out begins, m/s².
    stop_m_s2: Vector3<f64>,
    /// Heading of the plan.
    pub(super) yaw_rad: f64,
}

impl Stretch {
    /// Returns the stretch of a plan. Returns [`Error::Input`] for a plan without letters, and
    /// [`Error::Infeasible`] for one that descends to the floor between take-off and landing.
    pub(super) fn new(plan: &Plan) -> Result<Self> {
        let first = plan.setpoints.iter().position(|setpoint| setpoint.letter.is_some());
        let last = plan.setpoints.iter().rposition(|setpoint| setpoint.letter.is_some());
        let Some((first, last)) = first.zip(last).filter(|(first, last)| first < last) else {
            let hint = "plan a word, not only a take-off";
            return Err(Error::input("plan", "no letter", "setpoints that write a letter", hint));
        };
        // The last stroke ends at the setpoint after the last lettered one.
        let end = (last + 1).min(plan.setpoints.len() - 1);
        let (start, stop) = (&plan.setpoints[first], &plan.setpoints[end]);
        // The acceleration over RUN_S is constant, up to the speed of the first letter, and down
        // from that of the last one.
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
                "the letters or the approach to them reach down to {z_m:.2} m at {time_s:.1} s"
            );
            let hint = "write higher (letters.baseline_m) or slower (plan.stroke_speed_m_s)";
            return Err(Error::infeasible(what, hint));
        }
        let stop_m_s2 = stop.acceleration_m_s2;
        Ok(Self { setpoints, stop_m_s2, yaw_rad: plan.yaw_rad })
    }

    /// Returns the start time by the plan's clock, s.
    pub(super) fn start_s(&self) -> f64 {
        self.setpoints[0].time_s
    }

    /// Returns the duration including run-up and run-out, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.time_s(self.last())
    }

    /// Returns the index of the last setpoint.
    pub(super) fn last(&self) -> usize {
        self.setpoints.len() - 1
    }

    /// Returns the time of a setpoint since the start of the stretch, s.
    pub(super) fn time_s(&self, index: usize) -> f64 {
        self.setpoints[index].time_s - self.start_s()
    }

    /// Returns the acceleration just before a setpoint, m/s². It differs from the setpoint's own at
    /// the ends of run-up and run-out, where the acceleration changes abruptly.
    pub(super) fn acceleration_before_m_s2(&self, index: usize) -> Vector3<f64> {
        match self.last() - index {
            1 => self.stop_m_s2,
            0 => self.setpoints[index - 1].acceleration_m_s2,
            _ if index == 1 => self.setpoints[0].acceleration_m_s2,
            _ => self.setpoints[index].acceleration_m_s2,
        }
    }

    /// Returns the position of the design at a time in s since the start of the stretch, m.
    pub(super) fn position_m(&self, time_s: f64) -> Vector3<f64> {
        self.position_after_m(self.n_until(time_s), time_s)
    }

    /// Returns the number of setpoints up to a time in s since the start of the stretch.
    fn n_until(&self, time_s: f64) -> usize {
        let plan_time_s = time_s + self.start_s();
        self.setpoints.partition_point(|setpoint| setpoint.time_s <= plan_time_s)
    }

    /// Returns the position of the design at a time in s since the start of the stretch, m, given
    /// the number of setpoints up to that time.
    fn position_after_m(&self, n_until: usize, time_s: f64) -> Vector3<f64> {
        let setpoint = &self.setpoints[n_until.saturating_sub(1)];
        setpoint.design_m((time_s + self.start_s()).max(setpoint.time_s))
    }

    /// Returns the maximum speed of the design, m/s, and its maximum acceleration, m/s².
    pub(super) fn limits(&self) -> [f64; 2] {
        let speeds = self.setpoints.iter().map(|s| s.velocity_m_s.norm());
        let accelerations = self.setpoints.iter().map(|s| s.acceleration_m_s2.norm());
        [speeds.fold(0.0, f64::max), accelerations.fold(0.0, f64::max)]
    }

    /// Returns the maximum distance of a trajectory from the design over the drone's time steps, m.
    /// The maximum occurs between the times of comparison, just before a setpoint.
    pub(super) fn worst_m(&self, pieces: &[Polynomials]) -> f64 {
        let (mut worst_m, mut start_s) = (0.0, 0.0);
        for piece in pieces {
            let steps = (piece.duration_s / STEP_S).ceil().max(1.0);
            let times_s = (0..).map(f64::from).take_while(|step| *step <= steps);
            let distances_m = times_s.map(|step| {
                let t = piece.duration_s * step / steps;
                (piece.position_m(t) - self.position_m(start_s + t)).norm()
            });
            worst_m = distances_m.fold(worst_m, f64::max);
            start_s += piece.duration_s;
        }
        worst_m
    }

    /// Returns [`Error::Infeasible`] for a trajectory that exceeds the drone's memory. It states
    /// the number of letters that end before `until_s`, in s since the start. `needs` states the
    /// memory required.
    pub(super) fn too_long(&self, until_s: f64, needs: &str, hint: &str) -> Error {
        let [begun, total] = [until_s, f64::INFINITY].map(|until_s| {
            let flown = self.setpoints.iter().filter(|s| s.time_s - self.start_s() < until_s);
            flown.filter_map(|setpoint| setpoint.letter).collect::<BTreeSet<_>>().len()
        });
        // The last letter that begins in time does not end in time.
        let what = format!("{needs}: {} of {total} letters fit", begun.saturating_sub(1));
        Error::infeasible(what, hint)
    }

    /// Returns the times at which a piece from one setpoint to another is compared with the design,
    /// in s since the start of the stretch.
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

    /// Returns the times of [`Self::check_times_s`], each with the position of the design, m.
    pub(super) fn checks(
        &self,
        from: usize,
        to: usize,
    ) -> impl Iterator<Item = (f64, Vector3<f64>)> {
        // Because times ascend, only the first setpoint is searched for.
        let mut n_until = self.n_until(self.time_s(from));
        self.check_times_s(from, to).map(move |time_s| {
            let later = self.setpoints[n_until..].iter();
            let plan_time_s = time_s + self.start_s();
            n_until += later.take_while(|setpoint| setpoint.time_s <= plan_time_s).count();
            (time_s, self.position_after_m(n_until, time_s))
        })
    }
}

/// Coefficients of an axis in ascending powers of time in s.
pub(super) type Polynomial = [f64; 8];

/// Motion of a piece, given for each axis as a polynomial in the time since its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Polynomials {
    pub(super) duration_s: f64,
    pub(super) axes: [Polynomial; 3],
}

impl Polynomials {
    /// Returns the motion that the firmware uses for take-off and landing (`pptraj.c`,
    /// `poly7_nojerk`). It leads from rest to rest between two positions, with zero jerk at its
    /// ends.
    pub(super) fn from_rest_to_rest([from_m, to_m]: [Vector3<f64>; 2], duration_s: f64) -> Self {
        let path_m = to_m - from_m;
        let axes = [0, 1, 2].map(|axis| {
            // The polynomial is the smoothstep 35 s⁴ - 84 s⁵ + 70 s⁶ - 20 s⁷ with s = t/T. `scale`
            // is T to the power of each term.
            let mut scale = 1.0;
            let mut polynomial = [0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0].map(|factor| {
                let coefficient = path_m[axis] * factor / scale;
                scale *= duration_s;
                coefficient
            });
            polynomial[0] = from_m[axis];
            polynomial
        });
        Self { duration_s, axes }
    }

    /// Returns position in m, velocity in m/s and acceleration in m/s² at `t` s since the start of
    /// the piece.
    pub(super) fn evaluate(&self, t: f64) -> [Vector3<f64>; 3] {
        // Horner's scheme yields the value, the first derivative and half of the second derivative.
        let axes = self.axes.map(|c| {
            c.iter().rev().fold([0.0; 3], |[p, v, a], c| [p * t + c, v * t + p, a * t + v])
        });
        let [p, v, a] = [0, 1, 2].map(|k| Vector3::from(axes.map(|axis| axis[k])));
        [p, v, 2.0 * a]
    }

    /// Returns the position in m of [`Self::evaluate`].
    pub(super) fn position_m(&self, t: f64) -> Vector3<f64> {
        Vector3::from(self.axes.map(|c| c.iter().rev().fold(0.0, |p, c| p * t + c)))
    }
}

/// Returns position in m, velocity in m/s and acceleration in m/s² of consecutive pieces at a time
/// since their start. After the last piece the drone rests at its end.
pub(super) fn motion(pieces: &[Polynomials], time_s: f64) -> [Vector3<f64>; 3] {
    let (mut since_start_s, mut end) = (time_s.max(0.0), [Vector3::zeros(); 3]);
    for piece in pieces {
        if since_start_s < piece.duration_s {
            return piece.evaluate(since_start_s);
        }
        since_start_s -= piece.duration_s;
        end[0] = piece.evaluate(piece.duration_s)[0];
    }
    end
}

/// Rounding of a piece's numbers to those of its form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rounding {
    /// Rounds to the nearest number.
    Nearest,
    /// Rounds to the neighboring numbers with the least acceleration.
    Gentlest,
}

/// Divides a stretch into pieces, greedily with backtracking. Each piece is the longest that stays
/// within `tolerance_m` of the design, within `max_piece_s`, and within the speed and acceleration
/// of the design. If no piece can follow it, it is replaced by a shorter one.
///
/// `piece` computes the piece between two setpoints, given the previous pieces. If the design
/// contains no acceleration, only the distance matters, and the shortest piece is always accepted.
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
        motion: &|from, to, previous, rounding| polynomials(&piece(from, to, previous, rounding)),
    };
    let (mut pieces, mut choices): (Vec<P>, Vec<Choice>) = (Vec::new(), Vec::new());
    let (mut stuck_start, mut retries) = (0, 0);
    let mut choice = fit.choice(0, &pieces);
    while choice.start < stretch.last() {
        let mut end = fit.longest(&mut choice, &pieces);
        if end.is_none() {
            // Retries are counted anew once the search has come farther than ever before.
            (stuck_start, retries) = if choice.start > stuck_start {
                (choice.start, 1)
            } else {
                (stuck_start, retries + 1)
            };
            // The search returns to the last piece that can be shortened, and recomputes later
            // ones.
            if retries <= RETRIES
                && let Some((index, shorter_end)) = fit.backtrack(&mut choices, &pieces)
            {
                pieces.truncate(index);
                choice = choices.drain(index..).next().expect("a choice for each piece");
                end = Some(shorter_end);
            }
        }
        // After the last retry, the piece with the least effort is used, even beyond the limits.
        let next = end.map(|end| (end, Rounding::Nearest));
        let next = next.or_else(|| fit.gentlest(choice.start, &pieces));
        let (end, rounding) = next.expect("the next setpoint");
        let next_piece = piece(choice.start, end, &pieces, rounding);
        pieces.push(next_piece);
        choices.push(choice);
        choice = fit.choice(end, &pieces);
    }
    pieces
}

/// Start of a piece, and the setpoints that have not been tried as its end.
struct Choice {
    start: usize,
    untried_ends: Range<usize>,
}

/// Function that returns the motion of the piece between two setpoints, given the previous pieces.
type Motion<'a, P> = dyn Fn(usize, usize, &[P], Rounding) -> Polynomials + 'a;

/// Conditions for the pieces of a stretch.
struct Fit<'a, P> {
    stretch: &'a Stretch,
    limits: [f64; 2],
    tolerance_m: f64,
    max_piece_s: f64,
    motion: &'a Motion<'a, P>,
}

impl<P> Fit<'_, P> {
    /// True if a piece between two setpoints is short enough and close enough to the design.
    fn is_near(&self, from: usize, to: usize, motion: &Polynomials) -> bool {
        let start_s = self.stretch.time_s(from);
        self.stretch.time_s(to) - start_s < self.max_piece_s
            && self.stretch.checks(from, to).all(|(t, design_m)| {
                let position_m = motion.position_m((t - start_s).min(motion.duration_s));
                (position_m - design_m).norm() <= self.tolerance_m
            })
    }

    /// Returns the last setpoint of the longest piece from `from` that follows the design.
    fn farthest(&self, from: usize, previous: &[P]) -> usize {
        let last = self.stretch.last();
        gallop(from + 1, last, |to| {
            self.is_near(from, to, &(self.motion)(from, to, previous, Rounding::Nearest))
        })
    }

    /// Returns the maximum speed or acceleration of a piece, as a multiple of the design's maximum.
    fn effort(&self, from: usize, to: usize, motion: &Polynomials) -> f64 {
        let [max_m_s, max_m_s2] = self.limits;
        let start_s = self.stretch.time_s(from);
        let times_s = self.stretch.check_times_s(from, to).map(|t| t - start_s);
        let efforts = [0.0].into_iter().chain(times_s).map(|t| {
            let [_, v, a] = motion.evaluate(t);
            f64::max(v.norm() / max_m_s, a.norm() / max_m_s2)
        });
        efforts.fold(0.0, f64::max)
    }

    /// Returns the possible ends of a piece from a setpoint. If the design contains no
    /// acceleration, this is only the farthest one.
    fn choice(&self, start: usize, previous: &[P]) -> Choice {
        if start == self.stretch.last() {
            return Choice { start, untried_ends: 0..0 };
        }
        let farthest = self.farthest(start, previous);
        let nearest = if self.limits[1] > 0.0 { start + 1 } else { farthest };
        Choice { start, untried_ends: nearest..farthest + 1 }
    }

    /// Returns the end of the longest piece that stays within the limits, or `None` if there is
    /// none. Removes this end and those beyond it from the choice.
    fn longest(&self, choice: &mut Choice, previous: &[P]) -> Option<usize> {
        let (start, rounding) = (choice.start, Rounding::Nearest);
        choice.untried_ends.rfind(|end| {
            self.limits[1] == 0.0 || {
                let motion = (self.motion)(start, *end, previous, rounding);
                self.effort(start, *end, &motion) <= OVER_LIMITS
                    && self.is_near(start, *end, &motion)
            }
        })
    }

    /// Returns the index of the last piece that can be shortened, and the index of the setpoint at
    /// its new end. Returns `None` if no piece can be shortened.
    fn backtrack(&self, choices: &mut [Choice], pieces: &[P]) -> Option<(usize, usize)> {
        (0..pieces.len())
            .rev()
            .find_map(|index| Some((index, self.longest(&mut choices[index], &pieces[..index])?)))
    }

    /// Returns the setpoint at the end and the rounding of the piece with the least effort among
    /// those that are close enough. A piece to the next setpoint is always accepted.
    fn gentlest(&self, from: usize, previous: &[P]) -> Option<(usize, Rounding)> {
        let candidates = (from + 1..=self.farthest(from, previous))
            .flat_map(|to| [Rounding::Nearest, Rounding::Gentlest].map(|rounding| (to, rounding)));
        let efforts = candidates.filter_map(|(to, rounding)| {
            let motion = (self.motion)(from, to, previous, rounding);
            let is_allowed =
                (to, rounding) == (from + 1, Rounding::Nearest) || self.is_near(from, to, &motion);
            is_allowed.then(|| ((to, rounding), self.effort(from, to, &motion)))
        });
        efforts.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(candidate, _)| candidate)
    }
}

/// Returns the largest number up to `last` that fits, by a galloping search (Bentley and Yao 1976),
/// provided that all smaller numbers fit. `first` always fits.
fn gallop(first: usize, last: usize, fits: impl Fn(usize) -> bool) -> usize {
    // The step is doubled until a number does not fit, and then halved.
    let (mut good, mut step) = (first, 1);
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
