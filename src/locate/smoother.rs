//! Locates whole flights from range logs, without motion sensors.
//!
//! The input is anchors and ranges, and the output is [`Located`]. A filter runs forward and a
//! smoother backward. Both are repeated with Jacobians at the smoothed positions until they
//! converge. The method is Gauss–Newton on the whole flight (Bell, SIAM J. Optimization 4(3),
//! 1994), as in factor-graph solvers. The first iteration starts at the positions that best fit the
//! ranges in each drone's first second.
//!
//! After the gate has rejected five ranges of a link in a row, the link is accepted again, as in
//! flight. Biases are not estimated, but they appear in the residuals of each link.

use nalgebra::{Matrix3, Vector3};

use super::pairs::{remove_before_both_logs, without_duplicates};
use super::pass::{Model, STEP_S, work};
use super::residuals::LinkResidual;
use super::solve::solve;
use super::start::start;
use super::{Link, RangeSample, Room};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};

/// Minimum standard deviation assigned to a range for the initial position.
const START_SIGMA_M: f64 = 0.05;

/// Maximum number of ranges in all logs, enough for half an hour of eight anchors at 100 Hz.
const MOST_RANGES: usize = 1_500_000;
/// Maximum number of multiplications in a pass, [`work`], which take a few seconds. Ten minutes of
/// three drones with eight anchors at 50 Hz require 2.4·10⁹.
const MOST_WORK: f64 = 4e9;
const FEWER: &str = "cut the logs to one flight, reduce the logging rate, or locate fewer drones \
                     at a time: drones without ranges between them can be located one by one";

/// Options of [`locate`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocateOptions {
    /// Standard deviation of a range.
    pub range_sigma_m: f64,
    /// Density of the drones' acceleration, (m/s²)/√Hz. A lower density smooths the path, which
    /// then lags in curves.
    pub acceleration_m_s2_sqrt_hz: f64,
    /// True if later ranges improve earlier positions, false for positions as computed in flight.
    pub smooth: bool,
    /// Box that contains all drones, if known. It resolves mirror images.
    pub room: Option<Room>,
}

/// Positions of all drones over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Located {
    /// Increasing times of the positions.
    pub time_s: Vec<f64>,
    /// Positions of each drone, one for each time.
    pub position_m: Vec<Vec<Vector3<f64>>>,
    /// Covariances of the positions. Empty for an observer without a noise model.
    pub covariance_m2: Vec<Vec<Matrix3<f64>>>,
    /// Times of each drone's first and last range. Outside this interval, positions are held.
    pub heard_s: Vec<[f64; 2]>,
    /// Mean normalized innovation squared of the filter, which is 1 if the assumed noise and motion
    /// are correct. `None` for an observer without a covariance.
    pub nis: Option<f64>,
    /// Number of ranges without duplicates.
    pub ranges: usize,
    /// Fraction of the ranges that the gate rejected.
    pub refused_frac: f64,
    /// Residuals of every link.
    pub links: Vec<LinkResidual>,
    /// Warnings about suspect ranges.
    pub warnings: Vec<Diagnostic>,
}

/// Computes the positions of `n_drones` from their ranges.
///
/// # Errors
///
/// Returns [`Error::Input`] for a range that is not a distance, for an unlisted drone or anchor,
/// and for more ranges than one core can process in minutes. Returns [`Error::Infeasible`] for
/// fewer links than coordinates, and for links that leave a direction unobservable.
pub fn locate(
    anchors_m: &[Vector3<f64>],
    n_drones: usize,
    samples: &[RangeSample],
    options: &LocateOptions,
) -> Result<Located> {
    check_count(samples.len())?;
    let mut samples = checked(anchors_m, n_drones, samples)?;
    remove_before_both_logs(&mut samples);
    check_work(n_drones, &samples)?;
    // The initial state is computed from each drone's first second.
    let heard_s = heard_s(n_drones, &samples);
    let model = Model::new(anchors_m, &heard_s, options);
    let sigma_m = options.range_sigma_m.max(START_SIGMA_M);
    let start = start(anchors_m, &heard_s, &samples, sigma_m, options.room.as_ref())?;
    let solved = solve(&model, &samples, &start, options.smooth)?;
    let located = Located {
        covariance_m2: solved.covariances_m2(n_drones),
        position_m: solved.positions_m(n_drones),
        heard_s,
        time_s: solved.time_s,
        ..Located::default()
    };
    Ok(located.with_residuals(anchors_m, &samples, &solved.innovations, options.range_sigma_m))
}

/// Checks that `n` ranges are no more than [`locate`] accepts, for callers that collect ranges.
///
/// # Errors
///
/// Returns [`Error::Input`] that states the maximum number.
pub fn check_count(n: usize) -> Result<()> {
    if n <= MOST_RANGES {
        return Ok(());
    }
    let wanted = format!("at most {:.1} million ranges of all drones", MOST_RANGES as f64 / 1e6);
    Err(Error::input("ranges", "more ranges", wanted, FEWER))
}

/// Checks that a pass over the ranges requires at most [`MOST_WORK`] multiplications.
fn check_work(n_drones: usize, samples: &[RangeSample]) -> Result<()> {
    let work = work(n_drones, samples);
    if work <= MOST_WORK {
        return Ok(());
    }
    let (n, [work, most]) = (samples.len(), [work, MOST_WORK].map(|work| work / 1e6));
    let actual =
        format!("{n} of {n_drones} drones, {work:.0} million multiplications for each pass");
    Err(Error::input("ranges", actual, format!("at most {most:.0} million"), FEWER))
}

/// Returns the times in s of each drone's first and last range, or `[∞, −∞]` for a drone without
/// ranges.
pub(super) fn heard_s(n_drones: usize, samples: &[RangeSample]) -> Vec<[f64; 2]> {
    let mut heard_s = vec![[f64::INFINITY, f64::NEG_INFINITY]; n_drones];
    for sample in samples {
        for drone in sample.link.drones() {
            let [from_s, to_s] = heard_s[drone];
            heard_s[drone] = [from_s.min(sample.time_s), to_s.max(sample.time_s)];
        }
    }
    heard_s
}

impl Located {
    /// Returns an empty result with space for the positions of `n_drones`.
    pub(super) fn empty(n_drones: usize) -> Self {
        Self {
            position_m: vec![Vec::new(); n_drones],
            covariance_m2: vec![Vec::new(); n_drones],
            ..Self::default()
        }
    }

    /// Appends a time, with the position (m) and covariance (m²) that `estimate` returns for each
    /// drone.
    pub(super) fn push(
        &mut self,
        time_s: f64,
        estimate: impl Fn(usize) -> (Vector3<f64>, Matrix3<f64>),
    ) {
        self.time_s.push(time_s);
        for drone in 0..self.position_m.len() {
            let (position_m, covariance_m2) = estimate(drone);
            self.position_m[drone].push(position_m);
            self.covariance_m2[drone].push(covariance_m2);
        }
    }

    /// Returns the indices of the times from a drone's first range to its last.
    pub fn heard(&self, drone: usize) -> std::ops::Range<usize> {
        let [from_s, to_s] = self.heard_s[drone];
        // The time of a step is that of its first range. Others may follow up to `STEP_S` later.
        self.time_s.partition_point(|t| *t + STEP_S <= from_s)
            ..self.time_s.partition_point(|t| *t <= to_s)
    }
}

/// Returns the samples sorted by time, without duplicates of ranges that two logs contain. Returns
/// an error for distances out of range, and for links of unlisted drones or anchors.
pub(super) fn checked(
    anchors_m: &[Vector3<f64>],
    n_drones: usize,
    samples: &[RangeSample],
) -> Result<Vec<RangeSample>> {
    for sample in samples {
        let RangeSample { time_s, link, distance_m } = sample;
        let place = format!("range at {time_s:.3} s, {link}");
        if !sample.is_measurement() {
            let wanted = "a distance from 0 m to 10 km";
            let n_broken = samples.iter().filter(|sample| !sample.is_measurement()).count();
            let hint =
                format!("remove values that are not measurements, {n_broken} of {}", samples.len());
            return Err(Error::input(place, distance_m, wanted, hint));
        }
        let is_listed = match *link {
            Link::Anchor { drone, anchor } => drone < n_drones && anchor < anchors_m.len(),
            Link::Drones(i, j) => i < n_drones && j < n_drones && i != j,
        };
        if !is_listed {
            let wanted =
                format!("{} anchors, numbered from 0, and {n_drones} drones", anchors_m.len());
            let hint = "list every anchor, and give a log of every drone";
            return Err(Error::input(place, link, wanted, hint));
        }
    }
    let mut samples = without_duplicates(samples);
    samples.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Random;

    fn anchors_m(n: usize) -> Vec<Vector3<f64>> {
        let corners = [
            [-2.5, -2.5, 2.4],
            [2.5, -2.5, 0.2],
            [0.5, 2.5, 2.4],
            [-2.5, 2.5, 0.2],
            [2.5, 2.5, 2.4],
            [0.0, -2.5, 0.2],
        ];
        corners[..n].iter().map(|a| Vector3::from(*a)).collect()
    }

    fn place(drone: usize, time_s: f64) -> Vector3<f64> {
        let phase = [0.0, 1.9][drone];
        let wave = |rate: f64| libm::sin(rate * time_s + phase);
        Vector3::new(0.8 * wave(0.7), 0.4 * wave(1.1), 1.0 + 0.4 * wave(0.9))
    }

    /// Returns ranges until `end_s` at 100 per second, with the links in turn.
    fn log(links: &[Link], n_anchors: usize, sigma_m: f64, end_s: u32) -> Vec<RangeSample> {
        let (anchors_m, mut random) = (anchors_m(n_anchors), Random(9));
        Vec::from_iter((0..end_s * 100).map(|k: u32| {
            let (time_s, link) = (f64::from(k) * 0.01, links[k as usize % links.len()]);
            let true_m = link.away_m(&anchors_m, |drone| place(drone, time_s)).norm();
            RangeSample { time_s, link, distance_m: true_m + sigma_m * random.normal() }
        }))
    }

    fn to_anchors(drone: usize, anchors: impl IntoIterator<Item = usize>) -> Vec<Link> {
        anchors.into_iter().map(|anchor| Link::Anchor { drone, anchor }).collect()
    }

    fn rmse_m(located: &Located) -> f64 {
        let (mut square, mut n) = (0.0, 0.0);
        for (drone, places) in located.position_m.iter().enumerate() {
            for (time_s, found_m) in located.time_s.iter().zip(places).filter(|(t, _)| **t > 1.0) {
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
        let located = locate(&anchors_m(3), 2, &log(&links, 3, 0.06, 40), &options).unwrap();
        assert!(rmse_m(&located) < 0.12, "{} m", rmse_m(&located));
    }

    #[test]
    fn strays_are_refused_and_a_moved_link_is_believed_again() {
        let mut samples = log(&to_anchors(0, 0..6), 6, 0.03, 30);
        samples.iter_mut().step_by(37).for_each(|s| s.distance_m += 2.0);
        let options = LocateOptions { range_sigma_m: 0.03, ..Default::default() };
        let located = locate(&anchors_m(6), 1, &samples, &options).unwrap();
        assert!(rmse_m(&located) < 0.06, "{} m", rmse_m(&located));
        assert!((0.02..0.05).contains(&located.refused_frac), "{}", located.refused_frac);
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
        assert!(refused(&line, 1, &three).contains("direction undetermined"), "a line");
        for distance_m in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            let mut broken = three.clone();
            broken[7].distance_m = distance_m;
            assert!(refused(&anchors_m(6), 1, &broken).contains("range at 0.070 s"));
        }
        let stranger = log(&to_anchors(0, 0..6), 6, 0.0, 2);
        assert!(refused(&anchors_m(4), 1, &stranger).contains("drone 1 to anchor 5 (distance4)"));
        assert!(refused(&anchors_m(4), 1, &[]).contains("0 links"));
    }
}
