//! Computes the range residuals of each link, and detects suspect links.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Serialize;

use super::pass::{Innovations, time_steps};
use super::{Link, Located, RangeSample};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::statistics::median;
use noctograph_core::units::CM_PER_M;

/// Standard deviation of a normal distribution divided by its median absolute deviation.
const SIGMA_PER_MAD: f64 = 1.4826;
/// Standard error of a median relative to that of a mean, for a normal distribution: √(π/2).
const MEDIAN_ERROR: f64 = 1.2533;
/// Number of standard errors beyond which a median is not zero (by chance once in two million).
const SURE_SIGMAS: f64 = 5.0;
/// Minimum relevant median, in standard deviations of a range.
const LEAST_BIAS_SIGMAS: f64 = 0.25;
/// Maximum fraction and number of outliers on a link. Ultra-wideband ranging has about 2 %
/// outliers.
const MOST_REFUSED_FRAC: f64 = 0.05;
const MOST_REFUSED: usize = 5;
/// Bounds of the mean normalized innovation squared if the assumed noise and motion are correct to
/// within 15 %, and the standard deviations by which few ranges widen the bounds.
const NIS_BOUNDS: [f64; 2] = [0.7, 1.4];
const NIS_SIGMAS: f64 = 3.0;

/// Residuals of a link, which are the measured distances minus those between located positions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkResidual {
    /// Name of the link.
    pub link: String,
    /// Number of ranges of the link.
    pub ranges: usize,
    /// Number of ranges of the link that the gate rejected.
    pub refused: usize,
    /// Median of the measured minus the located distance.
    pub median_m: f64,
    /// Standard deviation about the median, computed from the median absolute deviation.
    pub scatter_m: f64,
    /// True if outliers do not explain the number of rejected ranges, or if the median is not zero.
    pub suspect: bool,
}

/// Returns the minimum and maximum plausible mean normalized innovation squared of `n` ranges.
pub fn nis_interval(n: usize) -> [f64; 2] {
    let chance = NIS_SIGMAS * (2.0 / n.max(1) as f64).sqrt();
    [NIS_BOUNDS[0] - chance, NIS_BOUNDS[1] + chance]
}

/// Spread of a link's residuals.
pub(super) struct Spread {
    pub(super) median_m: f64,
    /// Standard deviation about the median, computed from the median absolute deviation.
    pub(super) scatter_m: f64,
    /// Number of residuals.
    pub(super) n: usize,
}

/// Returns the median and the scatter in m of each link's residuals.
pub(super) fn spread_by_link(
    samples: &[RangeSample],
    residuals_m: &[f64],
) -> BTreeMap<Link, Spread> {
    let mut by_link: BTreeMap<Link, Vec<f64>> = BTreeMap::new();
    for (sample, residual_m) in samples.iter().zip(residuals_m) {
        by_link.entry(sample.link).or_default().push(*residual_m);
    }
    let spreads = by_link.into_iter().filter_map(|(link, residuals_m)| {
        // The median absolute deviation is robust to outliers (Rousseeuw, Croux 1993).
        let median_m = median(residuals_m.iter().copied())?;
        let deviations_m = residuals_m.iter().map(|residual_m| (residual_m - median_m).abs());
        let scatter_m = SIGMA_PER_MAD * median(deviations_m)?;
        Some((link, Spread { median_m, scatter_m, n: residuals_m.len() }))
    });
    spreads.collect()
}

impl Located {
    /// Adds the residuals of all links, and warnings about suspect links. `sigma_m` is the standard
    /// deviation of a range. It is zero for an observer without a noise model, in which case each
    /// link's own scatter is the scale, and there are no warnings.
    pub(super) fn with_residuals(
        mut self,
        anchors_m: &[Vector3<f64>],
        samples: &[RangeSample],
        innovations: &Innovations,
        sigma_m: f64,
    ) -> Self {
        // The residual of every range is the measured minus the located distance.
        let mut residuals_m = Vec::new();
        for (k, step) in time_steps(samples).enumerate() {
            residuals_m.extend(step.iter().map(|sample| {
                let away_m = sample.link.away_m(anchors_m, |drone| self.position_m[drone][k]);
                sample.distance_m - away_m.norm()
            }));
        }
        // A link is suspect because of its median relative to its error, or because of rejected
        // ranges.
        let links = spread_by_link(samples, &residuals_m).into_iter();
        self.links =
            Vec::from_iter(links.map(|(link, Spread { median_m, scatter_m, n: ranges })| {
                let refused = innovations.refused.get(&link).copied().unwrap_or(0);
                let (n, n_refused) = (ranges as f64, refused as f64);
                let error_m = MEDIAN_ERROR * sigma_m.max(scatter_m) / n.sqrt();
                let is_biased =
                    median_m.abs() > (SURE_SIGMAS * error_m).max(LEAST_BIAS_SIGMAS * sigma_m);
                let suspect =
                    is_biased || refused > MOST_REFUSED && n_refused > MOST_REFUSED_FRAC * n;
                LinkResidual {
                    link: link.to_string(),
                    ranges,
                    refused,
                    median_m,
                    scatter_m,
                    suspect,
                }
            }));
        self.ranges = samples.len();
        let n_refused = innovations.refused.values().sum::<usize>();
        self.refused_frac = n_refused as f64 / samples.len().max(1) as f64;
        self.nis = innovations.nis();
        if sigma_m > 0.0 {
            self.warnings = self.range_warnings(sigma_m);
        }
        self
    }

    /// Returns a warning for each suspect link, and one for an implausible NIS. `sigma_m` is the
    /// standard deviation of a range.
    fn range_warnings(&self, sigma_m: f64) -> Vec<Diagnostic> {
        let suspects = self.links.iter().filter(|link| link.suspect);
        let suspects = suspects.map(|link| {
            let refused_percent = 100.0 * link.refused as f64 / link.ranges as f64;
            let [median_cm, scatter_cm] = [link.median_m, link.scatter_m].map(|m| CM_PER_M * m);
            format!(
                "{}: {refused_percent:.0} % of the ranges are refused, and the residuals have a \
                 median of {median_cm:+.1} cm and a scatter of {scatter_cm:.1} cm: the range is \
                 biased, its error changes, an anchor is not at its position in the file, or the \
                 clocks do not agree",
                link.link
            )
        });
        Diagnostic::warnings("ranges", suspects.chain(nis_warning(self.nis, self.ranges, sigma_m)))
    }
}

/// Returns a warning if the mean normalized innovation squared of `n` ranges is outside its
/// interval. `sigma_m` is the assumed standard deviation of a range.
fn nis_warning(nis: Option<f64>, n: usize, sigma_m: f64) -> Option<String> {
    let (nis, [least, most]) = (nis?, nis_interval(n));
    let cm = CM_PER_M * sigma_m;
    // Above the interval the covariance is too small, and below it the assumed noise is too large.
    if nis > most {
        Some(format!(
            "NIS {nis:.2} is above {most:.2}: the errors are larger than the covariance says, because the \
             ranges are noisier than {cm:.1} cm, links are biased, or the drones accelerate more"
        ))
    } else if nis < least {
        let scatter_cm = cm * nis.sqrt();
        Some(format!(
            "NIS {nis:.2} is below {least:.2}: the errors are smaller than the covariance says; the \
             ranges scatter by about {scatter_cm:.1} cm, not {cm:.1} cm"
        ))
    } else {
        None
    }
}
