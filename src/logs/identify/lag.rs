//! Estimates the rotors' lag from the roll and pitch response of the body to the motors: `J Δ²w = k
//! Δ(∫ torque of motors that lag by τ)`, over spans of equal length.
//!
//! Uneven air rotates a drone, and its controller responds. A plain least-squares fit confuses
//! response and cause, and overestimates the lag by 20 to 70 ms. Both sides are therefore projected
//! onto the design's acceleration at nearby times, which is independent of air and gyroscope
//! (two-stage least squares: Söderström, Stoica, Instrumental Variable Methods for System
//! Identification, 1983, and in closed loop Gilson, Van den Hof, Automatica 41, 2005). The estimate
//! is the lag with the best fit. Its confidence interval is computed by leaving out each stretch of
//! the flight in turn (jackknife over groups: Efron, Stein 1981), which is robust to gusts that
//! last longer than a span.
//!
//! Not done: estimating the lag if the design never moves, as in a hover.

use nalgebra::{DMatrix, DVector};

use super::rotors::impulses;
use super::{runs, signed_sum};
use noctograph_core::flight::{Flight, FlightSample};

/// Number of stretches of the flight that are left out in turn.
const STRETCHES: usize = 20;
/// 97.5 % quantile of Student's t with nineteen degrees of freedom, for a 95 % interval.
pub const T_95: f64 = 2.093;
/// Length of a span, which is at least two samples of a 50 Hz log but shorter than the lag.
const SPAN_S: f64 = 0.04;
/// Maximum lag that is tried, twice the longest published one, and the step between lags.
const LONGEST_S: f64 = 0.35;
const STEP_S: f64 = 0.005;
/// Numbers of spans before and after a time of the design in which the drone responds to it: 0.4 s,
/// by which a plan leads its controller, and 0.8 s, in which a slow controller settles.
const SPANS_BEFORE: usize = 10;
const SPANS_AFTER: usize = 20;
/// Minimum number of pairs of spans for a fit, ten per stretch.
const FEWEST: usize = 10 * STRETCHES;
/// Maximum half width of a usable confidence interval, equal to the spread of published lags.
const LARGEST_DOUBT_S: f64 = 0.1;
/// Minimum fraction of the changes in rotation that the motors must explain.
const LEAST_EXPLAINED: f64 = 0.1;

/// Lag of the rotors, as estimated from a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorLag {
    /// Time constant of a motor's response to its command: the time to 63 % of a step.
    pub lag_s: f64,
    /// Half the width of the 95 % confidence interval of the lag.
    pub half_width_s: f64,
    /// Fraction of the changes in rotation that the motors explain, 0 to 1.
    pub explained: f64,
}

impl RotorLag {
    /// True if the flight determines the lag to within 100 ms and to within the lag itself, and if
    /// the motors explain a tenth of the changes in rotation. Slow logs do not, nor do those with
    /// many gaps.
    pub fn is_identifiable(&self) -> bool {
        self.half_width_s < LARGEST_DOUBT_S.min(self.lag_s) && self.explained > LEAST_EXPLAINED
    }
}

/// Fits the lag of the rotors in s behind their commands. Returns `None` if the flight is too short
/// or its design does not move.
pub(super) fn lag(flight: &Flight, samples: &[FlightSample]) -> Option<RotorLag> {
    let runs: Vec<(&[FlightSample], Vec<[usize; 3]>)> =
        runs(flight, samples).map(|run| (run, pairs(run).collect())).collect();
    let n: usize = runs.iter().map(|(_, pairs)| pairs.len()).sum();
    if n < FEWEST {
        return None;
    }
    // The fit uses instruments, the response, and a regressor for each lag.
    let designs = instruments(&runs)?;
    let turns = changes(&runs, |run| run.iter().map(|s| s.rate_body_rad_s.xy().into()).collect());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "70 is in range")]
    let tries = (LONGEST_S / STEP_S).round() as u32;
    let lags_s = (0..=tries).map(|step| f64::from(step) * STEP_S);
    let pushes: Vec<Changes> =
        lags_s.map(|lag_s: f64| changes(&runs, |run| torques(run, lag_s))).collect();
    let stretches: Vec<Stretch> =
        (0..STRETCHES).map(|index| Stretch::new(index, &designs, &turns, &pushes)).collect();
    // The estimate is the best lag for the whole flight. The jackknife gives its confidence
    // interval (Efron, Stein 1981).
    let fit = explained(&stretches, None)?;
    let lag_s = peak(&fit.curve);
    let others = (0..STRETCHES).map(|index| Some(peak(&explained(&stretches, Some(index))?.curve)));
    let half_width_s = T_95 * jackknife_sigma(&others.collect::<Option<Vec<_>>>()?);
    Some(RotorLag { lag_s, half_width_s, explained: fit.fraction })
}

/// Returns the standard deviation of an estimate, in its unit, from estimates that leave out one
/// stretch each (jackknife).
fn jackknife_sigma(estimates: &[f64]) -> f64 {
    let n = estimates.len() as f64;
    let mean = estimates.iter().sum::<f64>() / n;
    let square: f64 = estimates.iter().map(|x| (x - mean) * (x - mean)).sum();
    (square * (n - 1.0) / n).sqrt()
}

/// Changes between consecutive spans, with a row per pair of spans and a column per axis.
type Changes = DMatrix<f64>;

/// Products over one stretch of the flight: the design's columns with the rotation, with the torque
/// for each lag, and with themselves.
struct Stretch {
    design: DMatrix<f64>,
    turn: [DVector<f64>; 2],
    pushes: Vec<[DVector<f64>; 2]>,
    /// Squared torque, torque times rotation, and squared rotation, summed for each lag.
    plain: Vec<[[f64; 3]; 2]>,
    rows: usize,
}

/// Measures of how well the motors explain the rotation for each lag.
struct Explained {
    /// Log-likelihood as a function of the lag, up to a constant.
    curve: Vec<f64>,
    /// Maximum fraction of the changes in rotation that the motors explain, 0 to 1.
    fraction: f64,
}

impl Stretch {
    /// Sums the products over one stretch: instruments (designs), response (turns), regressors
    /// (pushes).
    fn new(index: usize, designs: &Changes, turns: &Changes, pushes: &[Changes]) -> Self {
        let [from, to] = [index, index + 1].map(|index| index * turns.nrows() / STRETCHES);
        let rows = to - from;
        let [z, y] = [designs, turns].map(|changes| changes.rows(from, rows));
        // The first stage needs Zᵀy and Zᵀx.
        let mut projected = std::iter::once(turns)
            .chain(pushes)
            .map(|changes| [0, 1].map(|axis| z.tr_mul(&changes.column(axis).rows(from, rows))));
        // The explained fraction needs xᵀx, xᵀy and yᵀy without the projection.
        let plain = pushes.iter().map(|push| {
            [0, 1].map(|axis| {
                let (x, y) = (push.column(axis), y.column(axis));
                let x = x.rows(from, rows);
                [x.norm_squared(), x.dot(&y), y.norm_squared()]
            })
        });
        Self {
            design: z.tr_mul(&z),
            turn: projected.next().expect("the turns"),
            pushes: projected.collect(),
            plain: plain.collect(),
            rows,
        }
    }
}

/// Returns how well each lag explains the rotation, optionally without the stretch with an index.
/// Returns `None` if the columns of the design are linearly dependent.
fn explained(stretches: &[Stretch], without: Option<usize>) -> Option<Explained> {
    let kept = stretches.iter().enumerate().filter(|(index, _)| Some(*index) != without);
    let kept: Vec<&Stretch> = kept.map(|(_, stretch)| stretch).collect();
    let mut square: DMatrix<f64> = kept.iter().map(|stretch| &stretch.design).sum();
    let columns = square.nrows();
    #[expect(clippy::cast_precision_loss, reason = "dozens and thousands")]
    let (rows, mean) = (
        kept.iter().map(|stretch| stretch.rows).sum::<usize>() as f64,
        square.trace() / columns as f64,
    );
    /// Fraction of the mean that is added, so that nearly dependent columns remain invertible.
    const RIDGE: f64 = 1e-9;
    for k in 0..columns {
        square[(k, k)] += RIDGE * mean;
    }
    // First stage: the response is projected onto the instruments, with ZᵀZ = L Lᵀ.
    let factor = square.cholesky()?;
    let turns = [0, 1].map(|axis| kept.iter().map(|part| &part.turn[axis]).sum::<DVector<f64>>());
    let solved = [0, 1].map(|axis| factor.solve(&turns[axis]));
    let (mut curve, mut most) = (Vec::new(), 0.0_f64);
    // Second stage: for each lag, the projected response is regressed on the projected torque.
    for lag in 0..stretches[0].plain.len() {
        let (mut likelihood, mut fraction) = (0.0, 0.0);
        for axis in 0..2 {
            let push: DVector<f64> = kept.iter().map(|stretch| &stretch.pushes[lag][axis]).sum();
            let (xx, xy) = (push.dot(&factor.solve(&push)), push.dot(&solved[axis]));
            let [pxx, pxy, yy] = kept.iter().fold([0.0; 3], |sum: [f64; 3], stretch| {
                [0, 1, 2].map(|k| sum[k] + stretch.plain[lag][axis][k])
            });
            // Torque in the direction opposite to the rotation explains nothing.
            let shared = if xy > 0.0 && xx > 0.0 { xy * xy / xx } else { 0.0 };
            let noise = (yy - turns[axis].dot(&solved[axis])) / rows;
            likelihood += if noise > 0.0 { shared / noise } else { 0.0 };
            fraction += if pxy > 0.0 && pxx * yy > 0.0 { pxy * pxy / (pxx * yy) } else { 0.0 };
        }
        // The fractions of both axes are averaged.
        curve.push(likelihood);
        most = most.max(0.5 * fraction);
    }
    Some(Explained { curve, fraction: most })
}

/// Returns the changes of the design's velocity along world x and y between spans, m/s. A row
/// belongs to a pair of spans, and has a column for that pair and each of the pairs around it.
/// Returns `None` if the design never moves.
fn instruments(runs: &[(&[FlightSample], Vec<[usize; 3]>)]) -> Option<Changes> {
    /// Change of velocity up to which the design is at rest, m/s, which is above rounding errors.
    const AT_REST: f64 = 1e-9;
    let moves = changes(runs, |run| run.iter().map(|s| s.design_m.xy().into()).collect());
    let axes: Vec<usize> = (0..2).filter(|axis| moves.column(*axis).amax() > AT_REST).collect();
    let n_around = SPANS_BEFORE + SPANS_AFTER + 1;
    let mut columns = DMatrix::zeros(moves.nrows(), axes.len() * n_around);
    let mut first = 0;
    for (_, pairs) in runs {
        let run = first..first + pairs.len();
        for row in run.clone() {
            for (block, axis) in axes.iter().enumerate() {
                for around in 0..n_around {
                    // The response may precede the design, because a plan leads its controller.
                    let cause = (row + SPANS_BEFORE).checked_sub(around);
                    if let Some(cause) = cause.filter(|cause| run.contains(cause)) {
                        columns[(row, block * n_around + around)] = moves[(cause, *axis)];
                    }
                }
            }
        }
        first = run.end;
    }
    (!axes.is_empty()).then_some(columns)
}

/// Returns the changes in a quantity's mean rate between consecutive spans, in the quantity's unit
/// per s. Each row has the changes of its two components.
fn changes(
    runs: &[(&[FlightSample], Vec<[usize; 3]>)],
    quantity: impl Fn(&[FlightSample]) -> Vec<[f64; 2]>,
) -> Changes {
    let mut rows = Vec::new();
    for (run, pairs) in runs {
        let values = quantity(run);
        for [a, b, c] in pairs {
            // The second difference is the change in the mean rate between consecutive spans.
            let [before, after] = [(*a, *b), (*b, *c)].map(|(from, to)| {
                let span_s = run[to].time_s - run[from].time_s;
                [0, 1].map(|axis| (values[to][axis] - values[from][axis]) / span_s)
            });
            rows.extend([0, 1].map(|axis| after[axis] - before[axis]));
        }
    }
    DMatrix::from_row_slice(rows.len() / 2, 2, &rows)
}

/// Returns the integral of the roll and pitch torques up to each sample, in units of commands times
/// s, given the motor lag.
fn torques(run: &[FlightSample], lag_s: f64) -> Vec<[f64; 2]> {
    let mut sums = vec![[0.0; 2]];
    for impulse in impulses(run, lag_s) {
        let [roll, pitch] = sums[sums.len() - 1];
        sums.push([roll + signed_sum(0, &impulse), pitch + signed_sum(1, &impulse)]);
    }
    sums
}

/// Returns the lag in s at the peak of a curve, by a parabola through its highest three points. The
/// curve has a value for each multiple of [`STEP_S`].
fn peak(curve: &[f64]) -> f64 {
    let highest = (0..curve.len()).max_by(|a, b| curve[*a].total_cmp(&curve[*b])).unwrap_or(0);
    #[expect(clippy::cast_precision_loss, reason = "at most 70")]
    let index = highest as f64;
    let before = highest.checked_sub(1).map(|index| curve[index]);
    let shift = match (before, curve.get(highest + 1)) {
        (Some(before), Some(after)) => {
            // The result is shifted to the vertex of the parabola through the three points.
            let bend = before - 2.0 * curve[highest] + after;
            if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
        }
        _ => 0.0,
    };
    (index + shift) * STEP_S
}

/// Returns the pairs of consecutive spans, each as the indices of its three ends. Spans last at
/// least [`SPAN_S`], and each span but the first and the last belongs to two pairs.
fn pairs(run: &[FlightSample]) -> impl Iterator<Item = [usize; 3]> + '_ {
    /// Times in files are rounded to microseconds.
    const ROUNDING_S: f64 = 1e-6;
    // Each end is the first sample at least one span after the previous end.
    let ends = std::iter::successors((!run.is_empty()).then_some(0), |from: &usize| {
        let due_s = run[*from].time_s + SPAN_S - ROUNDING_S;
        let later = run[*from..].partition_point(|sample| sample.time_s < due_s);
        Some(from + later).filter(|end| *end < run.len())
    });
    let mut ends = ends.scan([0, 0], |before, end| {
        let three = [before[0], before[1], end];
        *before = [before[1], end];
        Some(three)
    });
    // The first two triples contain no complete pair.
    let _ = ends.by_ref().take(2).count();
    ends
}
