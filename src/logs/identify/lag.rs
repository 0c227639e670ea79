//! The rotors' lag, from how the body's roll and pitch answer the motors:
//! `J Δ²w = k Δ(∫ torque asked of motors that follow in τ)`, over spans of equal length.
//!
//! Differences of neighboring spans, since uneven air turns a drone slowly (over seconds) and its
//! controller answers it: without them the answer looks like a lag of half the true one. The lag is
//! the one whose torque explains the most of both axes; its confidence comes from leaving out one
//! stretch of the flight after the other, as in [`super::yaw`].

use super::ends_at_hole;
use super::yaw::{STRETCHES, T_95};
use noctograph_core::crazyflie::MOTOR_SIGNS;
use noctograph_core::flight::{Flight, FlightSample};

/// Length of a span: two or more samples of a log of 50 Hz, short against the lag.
const SPAN_S: f64 = 0.04;
/// Lags that are tried: up to twice the longest published one, in steps.
const LONGEST_S: f64 = 0.3;
const STEP_S: f64 = 0.005;
/// Fewest pairs of spans of a fit: ten to a stretch.
const FEWEST: usize = 10 * STRETCHES;
/// Largest half width of the confidence interval of a usable result: half of the spread of
/// published lags, 0.02 to 0.14 s.
const LARGEST_DOUBT_S: f64 = 0.03;
/// Least share of the changes of rotation that the motors explain in a usable result.
const LEAST_EXPLAINED: f64 = 0.1;

/// Lag of the rotors, estimated from a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorLag {
    /// Time in which a motor follows its command: 63 % of a step.
    pub lag_s: f64,
    /// Half the width of the interval in which it repeats, 95 %. Its bias, 3 to 31 ms too long in
    /// simulated flights (docs/evening.md), is not in it.
    pub half_width_s: f64,
    /// Share of the changes of rotation that the motors explain, 0 to 1.
    pub explained: f64,
}

impl RotorLag {
    /// Whether the flight shows the lag to 30 ms. A log that is slow or full of holes does not.
    #[must_use]
    pub fn is_identifiable(&self) -> bool {
        self.half_width_s < LARGEST_DOUBT_S && self.explained > LEAST_EXPLAINED
    }
}

/// Sums over the pairs of spans of each stretch, for either axis: of x², x y and y².
type Sums = [[[f64; 3]; 2]; STRETCHES];

/// Fits the lag; `None` for a flight too short for a fit.
pub(super) fn lag(flight: &Flight, samples: &[FlightSample]) -> Option<RotorLag> {
    let runs = runs(flight, samples);
    let n: usize = runs.iter().map(|run| pairs(run).count()).sum();
    if n < FEWEST {
        return None;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "sixty")]
    let tries = (LONGEST_S / STEP_S).round() as u32;
    let lags_s = (0..=tries).map(|step| f64::from(step) * STEP_S);
    let tried: Vec<Sums> = lags_s.map(|lag_s| sums(&runs, lag_s, n)).collect();
    // Share of the change that is explained with each lag, without one stretch.
    let explained = |without: Option<usize>| -> Vec<f64> {
        let share = |sums: &Sums| -> f64 {
            let axis = |axis: usize| {
                let parts =
                    sums.iter().enumerate().filter(|(stretch, _)| Some(*stretch) != without);
                let [xx, xy, yy] = parts.fold([0.0; 3], |sum: [f64; 3], (_, part)| {
                    [0, 1, 2].map(|k| sum[k] + part[axis][k])
                });
                // Torque that turns the drone the other way explains nothing.
                if xy > 0.0 && xx * yy > 0.0 { xy * xy / (xx * yy) } else { 0.0 }
            };
            0.5 * (axis(0) + axis(1))
        };
        tried.iter().map(share).collect()
    };
    let all = explained(None);
    let lag_s = peak(&all);
    #[expect(clippy::cast_precision_loss, reason = "twenty")]
    let n = STRETCHES as f64;
    let others: Vec<f64> = (0..STRETCHES).map(|stretch| peak(&explained(Some(stretch)))).collect();
    let middle = others.iter().sum::<f64>() / n;
    let square: f64 = others.iter().map(|other| (other - middle) * (other - middle)).sum();
    let half_width_s = T_95 * (square * (n - 1.0) / n).sqrt();
    Some(RotorLag { lag_s, half_width_s, explained: all.into_iter().fold(0.0, f64::max) })
}

/// Where a curve over the lags is highest, by a parabola through the highest point and its
/// neighbors.
fn peak(curve: &[f64]) -> f64 {
    let highest = (0..curve.len()).max_by(|a, b| curve[*a].total_cmp(&curve[*b])).unwrap_or(0);
    let beside = |of: usize| curve.get(of).copied();
    #[expect(clippy::cast_precision_loss, reason = "sixty")]
    let at = highest as f64;
    let shift = match (highest.checked_sub(1).and_then(beside), beside(highest + 1)) {
        (Some(before), Some(after)) => {
            let bend = before - 2.0 * curve[highest] + after;
            if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
        }
        _ => 0.0,
    };
    (at + shift) * STEP_S
}

/// Stretches of samples without a hole.
fn runs<'a>(flight: &Flight, samples: &'a [FlightSample]) -> Vec<&'a [FlightSample]> {
    let together =
        |a: &FlightSample, b: &FlightSample| b.time_s > a.time_s && !ends_at_hole(flight, a.time_s);
    samples.chunk_by(together).collect()
}

/// Three samples each a span apart, by their indices.
fn pairs(run: &[FlightSample]) -> impl Iterator<Item = [usize; 3]> + '_ {
    let after = |from: usize| {
        let due_s = run[from].time_s + SPAN_S - 1e-6;
        let later = run[from..].partition_point(|sample| sample.time_s < due_s);
        (from + later < run.len()).then_some(from + later)
    };
    let ends = std::iter::successors((!run.is_empty()).then_some(0), move |from| after(*from));
    let mut ends = ends.scan([0, 0], |before, end| {
        let three = [before[0], before[1], end];
        *before = [before[1], end];
        Some(three)
    });
    let _ = ends.by_ref().take(2).count();
    ends
}

/// The sums with motors that follow in a time; the `n` pairs of spans are dealt to the stretches in
/// order.
fn sums(runs: &[&[FlightSample]], lag_s: f64, n: usize) -> Sums {
    let (mut sums, mut index) = ([[[0.0; 3]; 2]; STRETCHES], 0);
    for run in runs {
        let impulses = impulses(run, lag_s);
        for [a, b, c] in pairs(run) {
            let [before_s, after_s] = [[a, b], [b, c]].map(|[a, b]| run[b].time_s - run[a].time_s);
            let part = &mut sums[index * STRETCHES / n];
            for (axis, part) in part.iter_mut().enumerate() {
                let x = (impulses[c][axis] - impulses[b][axis]) / after_s
                    - (impulses[b][axis] - impulses[a][axis]) / before_s;
                let rate = |at: usize| run[at].rate_body_rad_s[axis];
                let y = (rate(c) - rate(b)) / after_s - (rate(b) - rate(a)) / before_s;
                for (sum, product) in part.iter_mut().zip([x * x, x * y, y * y]) {
                    *sum += product;
                }
            }
            index += 1;
        }
    }
    sums
}

/// Integral, up to each sample, of the roll and pitch that motors give which follow in a time.
fn impulses(run: &[FlightSample], lag_s: f64) -> Vec<[f64; 2]> {
    let asked = |sample: &FlightSample| {
        [0, 1].map(|axis| -> f64 {
            (0..4).map(|motor| MOTOR_SIGNS[(axis, motor)] * sample.motors[motor]).sum()
        })
    };
    // Between two logged commands the motors had others: on a straight line, not the first one
    // held.
    let mut line = Vec::with_capacity(run.len());
    for held in run.chunk_by(|a, b| a.motors == b.motors) {
        let (from, next) = (&held[0], run.get(line.len() + held.len()));
        let to = next.filter(|next| next.time_s - from.time_s < SPAN_S).unwrap_or(from);
        let [first, last] = [from, to].map(asked);
        let share =
            |s: &FlightSample| (s.time_s - from.time_s) / (to.time_s - from.time_s).max(1e-9);
        let between = |s: &FlightSample| [0, 1].map(|k| first[k] + (last[k] - first[k]) * share(s));
        line.extend(held.iter().map(between));
    }
    let (mut given, mut sum) = (line[0], [0.0; 2]);
    let mut sums = vec![sum];
    for (pair, line) in run.windows(2).zip(line.windows(2)) {
        let dt_s = pair[1].time_s - pair[0].time_s;
        let stays = if lag_s > 0.0 { libm::exp(-dt_s / lag_s) } else { 0.0 };
        let wanted = [0, 1].map(|axis| 0.5 * (line[0][axis] + line[1][axis]));
        for axis in 0..2 {
            let behind = given[axis] - wanted[axis];
            sum[axis] += wanted[axis] * dt_s + behind * lag_s * (1.0 - stays);
            given[axis] = wanted[axis] + behind * stays;
        }
        sums.push(sum);
    }
    sums
}
