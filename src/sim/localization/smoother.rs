//! Whole flights from range logs: a filter forward, a smoother backward, relinearized until it
//! converges.
//!
//! In: anchors, ranges. Out: [`Located`]. Each drone moves with a constant velocity but for white
//! acceleration noise; no motion sensor is needed. The forward pass is an extended Kalman filter
//! (position and velocity of all drones), the backward pass that of Rauch, Tung and Striebel (AIAA
//! Journal 3(8), 1965); repeated with slopes at the smoothed places it is the Gauss–Newton method
//! on the whole flight (Bell, SIAM J. Optimization 4(3), 1994), what factor-graph solvers compute.
//! It starts from the position that best fits the ranges of the first second ([`start`]).
//!
//! A link that the gate refuses five times in a row is believed again, as in flight.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::positions::slope;
use super::start::start;
use super::{Link, RangeSample};
use crate::control::LockOut;
use crate::error::{Error, Result};

/// Ranges closer in time share one state.
const STEP_S: f64 = 0.01;
/// Most passes.
const MAX_PASSES: usize = 8;
/// Change of a position between two passes at which they end.
const CONVERGED_M: f64 = 1e-4;
/// Thickness of a set of anchors below which it counts as a plane.
const PLANE_M: f64 = 0.05;

/// How a log is turned into positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocateOptions {
    /// Standard deviation of a range.
    pub range_sigma_m: f64,
    /// Density of the drones' acceleration, (m/s²)/√Hz: less is smoother and lags in curves.
    pub acceleration_m_s2_sqrt_hz: f64,
    /// Standard deviations of its innovation beyond which a range is rejected.
    pub gate_sigmas: f64,
    /// Whether later ranges improve earlier positions; otherwise as in flight.
    pub smooth: bool,
}

impl Default for LocateOptions {
    fn default() -> Self {
        Self { range_sigma_m: 0.1, acceleration_m_s2_sqrt_hz: 1.0, gate_sigmas: 4.0, smooth: true }
    }
}

/// Positions of all drones over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Times, rising.
    pub time_s: Vec<f64>,
    /// Positions: for each drone one at each time.
    pub position_m: Vec<Vec<Vector3<f64>>>,
    /// Their covariances; empty for an observer without.
    pub covariance_m2: Vec<Vec<Matrix3<f64>>>,
    /// Mean normalized innovation squared of the filter: 1 where noise and motion are right; `None`
    /// for an observer without a covariance.
    pub nis: Option<f64>,
    /// Share of ranges that the gate refused.
    pub refused_frac: f64,
    /// What the ranges leave open.
    pub warnings: Vec<String>,
}

/// One step of the filter: its prediction, and the update by its ranges.
struct Step {
    time_s: f64,
    predicted: (DVector<f64>, DMatrix<f64>),
    state: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// Turns the ranges of `n_drones` into positions.
///
/// # Errors
///
/// [`Error::Input`] for a range that is no distance, and for a link without its end;
/// [`Error::Infeasible`] for fewer links than coordinates, and where they leave a direction open.
pub fn locate(
    anchors_m: &[Vector3<f64>],
    n_drones: usize,
    samples: &[RangeSample],
    options: &LocateOptions,
) -> Result<Located> {
    let samples = checked(anchors_m, n_drones, samples)?;
    let (start_m, start_m2) = start(anchors_m, n_drones, &samples, options.range_sigma_m)?;
    let (mut steps, nis, refused) =
        forward(anchors_m, &samples, options, (&start_m, &start_m2), None);
    let mut smoothed = None;
    if options.smooth {
        for _ in 0..MAX_PASSES {
            let next = backward(&steps)?;
            let moved_m = smoothed.as_ref().map_or(f64::INFINITY, |before: &Vec<_>| {
                let pairs = before.iter().zip(&next);
                let moved = |(a, b): (&(DVector<f64>, _), &(DVector<f64>, _))| (&a.0 - &b.0).amax();
                pairs.map(moved).fold(0.0, f64::max)
            });
            smoothed = Some(next);
            if moved_m < CONVERGED_M {
                break;
            }
            let about: Vec<DVector<f64>> =
                smoothed.iter().flatten().map(|(state, _)| state.clone()).collect();
            let start = (&start_m, &start_m2);
            (steps, ..) = forward(anchors_m, &samples, options, start, Some(&about));
        }
    }
    let ends: Vec<(DVector<f64>, DMatrix<f64>)> = smoothed.unwrap_or_else(|| {
        steps.iter().map(|step| (step.state.clone(), step.covariance.clone())).collect()
    });
    let position = |drone: usize| {
        let place = |(state, _): &(DVector<f64>, _)| state.fixed_rows::<3>(6 * drone).into_owned();
        ends.iter().map(place).collect()
    };
    let covariance = |drone: usize| {
        let block =
            |(_, p): &(_, DMatrix<f64>)| p.fixed_view::<3, 3>(6 * drone, 6 * drone).into_owned();
        ends.iter().map(block).collect()
    };
    Ok(Located {
        time_s: steps.iter().map(|step| step.time_s).collect(),
        position_m: (0..n_drones).map(position).collect(),
        covariance_m2: (0..n_drones).map(covariance).collect(),
        nis,
        refused_frac: refused,
        warnings: plane_warning(anchors_m).into_iter().collect(),
    })
}

impl Located {
    /// No position yet.
    pub(super) fn empty(n_drones: usize) -> Self {
        Self {
            time_s: Vec::new(),
            position_m: vec![Vec::new(); n_drones],
            covariance_m2: vec![Vec::new(); n_drones],
            nis: None,
            refused_frac: 0.0,
            warnings: Vec::new(),
        }
    }

    /// Appends the position of each drone with its covariance.
    pub(super) fn push(&mut self, time_s: f64, at: impl Fn(usize) -> (Vector3<f64>, Matrix3<f64>)) {
        self.time_s.push(time_s);
        for drone in 0..self.position_m.len() {
            let (position_m, covariance_m2) = at(drone);
            self.position_m[drone].push(position_m);
            self.covariance_m2[drone].push(covariance_m2);
        }
    }
}

/// Ranges that share one state, in order.
pub(super) fn together(samples: &[RangeSample]) -> impl Iterator<Item = &[RangeSample]> {
    let mut left = samples;
    std::iter::from_fn(move || {
        let first = left.first()?;
        let n = left.partition_point(|s| s.time_s < first.time_s + STEP_S);
        let (step, rest) = left.split_at(n.max(1));
        left = rest;
        Some(step)
    })
}

/// The samples in the order of time.
pub(super) fn checked(
    anchors_m: &[Vector3<f64>],
    n_drones: usize,
    samples: &[RangeSample],
) -> Result<Vec<RangeSample>> {
    let measured = |sample: &RangeSample| {
        sample.distance_m > 0.0 && sample.distance_m < 1e4 && sample.time_s.is_finite()
    };
    let n_broken = samples.iter().filter(|sample| !measured(sample)).count();
    for sample in samples {
        let RangeSample { time_s, link, distance_m } = sample;
        let place = format!("range at {time_s:.3} s, {link}");
        if !measured(sample) {
            let wanted = "a distance from 0 m to 10 km";
            let hint = format!("leave out what is no measurement, {n_broken} of {}", samples.len());
            return Err(Error::input(place, distance_m, wanted, hint));
        }
        let known = match *link {
            Link::Anchor { drone, anchor } => drone < n_drones && anchor < anchors_m.len(),
            Link::Drones(i, j) => i < n_drones && j < n_drones && i != j,
        };
        if !known {
            let wanted = format!("{} anchors, from 0, and {n_drones} drones", anchors_m.len());
            let hint = "list every anchor, and give a log of every drone";
            return Err(Error::input(place, link, wanted, hint));
        }
    }
    let mut samples = samples.to_vec();
    samples.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(samples)
}

/// What anchors in a plane leave open.
pub(super) fn plane_warning(anchors_m: &[Vector3<f64>]) -> Option<String> {
    let flat = !anchors_m.is_empty() && thickness_m(anchors_m) < PLANE_M;
    flat.then(|| "the anchors lie in a plane: the mirror image behind it fits as well".to_owned())
}

/// The distance of the farthest anchor from the plane that fits best.
fn thickness_m(anchors_m: &[Vector3<f64>]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a few anchors")]
    let middle_m = anchors_m.iter().sum::<Vector3<f64>>() / anchors_m.len().max(1) as f64;
    let spread: Matrix3<f64> =
        anchors_m.iter().map(|a| (a - middle_m) * (a - middle_m).transpose()).sum();
    let eigen = spread.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    anchors_m.iter().map(|a| (a - middle_m).dot(&normal).abs()).fold(0.0, f64::max)
}

/// Forward Kalman pass, linearized about its own estimates or about `about`; also returns the mean
/// normalized innovation squared and the share of refused ranges.
fn forward(
    anchors_m: &[Vector3<f64>],
    samples: &[RangeSample],
    options: &LocateOptions,
    (state, covariance): (&DVector<f64>, &DMatrix<f64>),
    about: Option<&[DVector<f64>]>,
) -> (Vec<Step>, Option<f64>, f64) {
    let (mut x, mut p) = (state.clone(), covariance.clone());
    let n_drones = x.len() / 6;
    let variance = options.range_sigma_m * options.range_sigma_m;
    let gate = options.gate_sigmas * options.gate_sigmas;
    let mut gates: BTreeMap<Link, LockOut> = BTreeMap::new();
    let (mut steps, mut nis, mut used, mut refused) = (Vec::<Step>::new(), 0.0, 0.0, 0.0);
    for step in together(samples) {
        let time_s = step[0].time_s;
        let span_s = steps.last().map_or(0.0, |last| time_s - last.time_s);
        let (phi, noise) = motion(n_drones, span_s, options.acceleration_m_s2_sqrt_hz);
        x = &phi * x;
        p = &phi * p * phi.transpose() + noise;
        let predicted = (x.clone(), p.clone());
        let here = about.and_then(|about| about.get(steps.len()));
        for sample in step {
            let places =
                |x: &DVector<f64>| DVector::from_fn(3 * n_drones, |i, _| x[6 * (i / 3) + i % 3]);
            let at = here.unwrap_or(&x);
            let (short, expected_m) = slope(sample.link, anchors_m, &places(at));
            let mut h = DVector::zeros(x.len());
            for i in 0..3 * n_drones {
                h[6 * (i / 3) + i % 3] = short[i];
            }
            let innovation = sample.distance_m - expected_m - h.dot(&(&x - at));
            let a = &p * &h;
            let spread = h.dot(&a);
            let link_gate = gates.entry(sample.link).or_default();
            let s = spread + link_gate.variance(variance, innovation);
            let taken = innovation * innovation <= gate * s;
            link_gate.note(taken);
            if !taken {
                refused += 1.0;
                continue;
            }
            nis += innovation * innovation / s;
            used += 1.0;
            x.axpy(innovation / s, &a, 1.0);
            p.ger(-1.0 / s, &a, &a, 1.0);
        }
        steps.push(Step { time_s, predicted, state: x.clone(), covariance: p.clone() });
    }
    (steps, (used > 0.0).then(|| nis / used), refused / (used + refused))
}

/// Transition of positions and velocities over a span, and the covariance of its noise.
fn motion(n_drones: usize, span_s: f64, density: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = 6 * n_drones;
    let (mut phi, mut noise) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
    let q = 0.5 * density * density;
    for i in (0..n).filter(|i| i % 6 < 3) {
        phi[(i, i + 3)] = span_s;
        noise[(i, i)] = q * span_s * span_s * span_s / 3.0;
        noise[(i, i + 3)] = q * span_s * span_s / 2.0;
        noise[(i + 3, i)] = noise[(i, i + 3)];
        noise[(i + 3, i + 3)] = q * span_s;
    }
    (phi, noise)
}

/// Smoothed states and covariances.
fn backward(steps: &[Step]) -> Result<Vec<(DVector<f64>, DMatrix<f64>)>> {
    let mut found: Vec<(DVector<f64>, DMatrix<f64>)> = Vec::with_capacity(steps.len());
    for (k, step) in steps.iter().enumerate().rev() {
        let Some(((x_after, p_after), after)) = found.last().zip(steps.get(k + 1)) else {
            found.push((step.state.clone(), step.covariance.clone()));
            continue;
        };
        let (phi, _) = motion(step.state.len() / 6, after.time_s - step.time_s, 0.0);
        let (x_predicted, p_predicted) = &after.predicted;
        let Some(inverse) = p_predicted.clone().cholesky() else {
            return Err(Error::Infeasible {
                what: format!("the filter has lost its covariance at {:.2} s", after.time_s),
                hint: "raise the noise of the ranges or the acceleration".into(),
            });
        };
        let gain = inverse.solve(&(phi * &step.covariance)).transpose();
        let x = &step.state + &gain * (x_after - x_predicted);
        let p = &step.covariance + &gain * (p_after - p_predicted) * gain.transpose();
        found.push((x, p));
    }
    found.reverse();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::localization::tests::Random;

    fn anchors_m(n: usize) -> Vec<Vector3<f64>> {
        let all = [
            [-2.5, -2.5, 2.4],
            [2.5, -2.5, 0.2],
            [0.5, 2.5, 2.4],
            [-2.5, 2.5, 0.2],
            [2.5, 2.5, 2.4],
            [0.0, -2.5, 0.2],
        ];
        all[..n].iter().map(|a| Vector3::from(*a)).collect()
    }

    fn place(drone: usize, time_s: f64) -> Vector3<f64> {
        let phase = [0.0, 1.9][drone];
        let wave = |rate: f64| libm::sin(rate * time_s + phase);
        Vector3::new(0.8 * wave(0.7), 0.4 * wave(1.1), 1.0 + 0.4 * wave(0.9))
    }

    /// Ranges of `end_s` at 100 a second over the links in turn.
    fn log(links: &[Link], n_anchors: usize, sigma_m: f64, end_s: u32) -> Vec<RangeSample> {
        let (anchors_m, mut random) = (anchors_m(n_anchors), Random(9));
        let sample = |k: u32| {
            let (time_s, link) = (f64::from(k) * 0.01, links[k as usize % links.len()]);
            let true_m = match link {
                Link::Anchor { drone, anchor } => (place(drone, time_s) - anchors_m[anchor]).norm(),
                Link::Drones(i, j) => (place(i, time_s) - place(j, time_s)).norm(),
            };
            RangeSample { time_s, link, distance_m: true_m + sigma_m * random.normal() }
        };
        (0..end_s * 100).map(sample).collect()
    }

    fn to_anchors(drone: usize, anchors: impl IntoIterator<Item = usize>) -> Vec<Link> {
        anchors.into_iter().map(|anchor| Link::Anchor { drone, anchor }).collect()
    }

    fn rmse_m(found: &Located) -> f64 {
        let (mut square, mut n) = (0.0, 0.0);
        for (drone, places) in found.position_m.iter().enumerate() {
            for (time_s, found_m) in found.time_s.iter().zip(places).filter(|(t, _)| **t > 1.0) {
                square += (found_m - place(drone, *time_s)).norm_squared();
                n += 1.0;
            }
        }
        f64::sqrt(square / n)
    }

    #[test]
    fn smoothing_halves_the_error_of_filtering_and_both_know_their_own() {
        let samples = log(&to_anchors(0, 0..6), 6, 0.06, 40);
        let run = |smooth| {
            let options = LocateOptions { range_sigma_m: 0.06, smooth, ..Default::default() };
            locate(&anchors_m(6), 1, &samples, &options).unwrap()
        };
        let (filtered, smoothed) = (run(false), run(true));
        let (filtered_m, smoothed_m) = (rmse_m(&filtered), rmse_m(&smoothed));
        assert!(smoothed_m < 0.7 * filtered_m && filtered_m < 0.08, "{smoothed_m} {filtered_m}");
        assert!(
            filtered.nis.is_some_and(|nis| (0.7..1.2).contains(&nis)),
            "NIS {:?}",
            filtered.nis
        );
        let sigma_m = smoothed.covariance_m2[0][2000].trace().sqrt();
        assert!((0.5..2.0).contains(&(smoothed_m / sigma_m)), "{smoothed_m} m, σ {sigma_m} m");
    }

    #[test]
    fn two_drones_with_three_anchors_each_and_their_range_are_located_together() {
        let mut links = to_anchors(0, 0..3);
        links.extend(to_anchors(1, 0..3));
        links.push(Link::Drones(0, 1));
        let options = LocateOptions { range_sigma_m: 0.06, ..Default::default() };
        let found = locate(&anchors_m(3), 2, &log(&links, 3, 0.06, 40), &options).unwrap();
        assert!(rmse_m(&found) < 0.12, "{} m", rmse_m(&found));
    }

    #[test]
    fn strays_are_refused_and_a_moved_link_is_believed_again() {
        let mut samples = log(&to_anchors(0, 0..6), 6, 0.03, 30);
        samples.iter_mut().step_by(37).for_each(|s| s.distance_m += 2.0);
        let options = LocateOptions { range_sigma_m: 0.03, ..Default::default() };
        let found = locate(&anchors_m(6), 1, &samples, &options).unwrap();
        assert!(rmse_m(&found) < 0.06, "{} m", rmse_m(&found));
        assert!((0.02..0.05).contains(&found.refused_frac), "{}", found.refused_frac);
    }

    #[test]
    fn logs_that_leave_places_open_are_refused_with_the_reason() {
        let options = LocateOptions::default();
        let refused = |anchors: &[Vector3<f64>], n, samples: &[RangeSample]| {
            locate(anchors, n, samples, &options).unwrap_err().to_string()
        };
        let two = log(&to_anchors(0, 0..2), 6, 0.0, 2);
        assert!(refused(&anchors_m(6), 1, &two).contains("2 links"), "too few");
        let mut line = anchors_m(3);
        (line[0], line[1], line[2]) = (Vector3::x(), Vector3::x() * 2.0, Vector3::x() * 3.0);
        let three = log(&to_anchors(0, 0..3), 6, 0.0, 2);
        assert!(refused(&line, 1, &three).contains("direction open"), "a line");
        for distance_m in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            let mut broken = three.clone();
            broken[7].distance_m = distance_m;
            assert!(refused(&anchors_m(6), 1, &broken).contains("range at 0.070 s"));
        }
        let stranger = log(&to_anchors(0, 0..6), 6, 0.0, 2);
        assert!(refused(&anchors_m(4), 1, &stranger).contains("anchor 4 of drone 1"));
        assert!(refused(&anchors_m(4), 1, &[]).contains("0 links"));
        let flat: Vec<Vector3<f64>> =
            anchors_m(6).iter().map(|a| Vector3::new(a.x, a.y, 2.4)).collect();
        let warned = locate(&flat, 1, &log(&to_anchors(0, 0..6), 6, 0.0, 2), &options);
        assert!(warned.is_ok_and(|found| found.warnings[0].contains("mirror image")));
    }
}
