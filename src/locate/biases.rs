//! Which links of a log are wrong: a bias is estimated, a link whose error changes is left out.
//!
//! In: a log that contradicts itself. Out: the log located anew. Method: detection, identification
//! and adaptation (Teunissen, "Quality control in integrated navigation systems", IEEE AES Magazine
//! 5(7), 1990; for one link Baarda's test of 1968). A filter with one constant bias for every link
//! gives the log's information on all biases at once, the positions taken out: N(b̂, P) with a
//! prior of σ² is information Λ = P⁻¹ − I/σ² and vector λ = P⁻¹ b̂. With the biases C b and all
//! others zero, χ² falls by λᵀC (CᵀΛC)⁻¹ Cᵀλ. Biases are added one by one, the greatest fall first,
//! and the positions are found anew with them.
//!
//! Two links whose biases explain the log as well as each other both get one: the covariance then
//! holds the doubt. Where the log still contradicts itself, links with large residuals are left
//! out, as long as this helps.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};

use super::bias::bias_m;
use super::pass::{Innovations, Model, STATES, together, work};
use super::residuals::{LEAST_BIAS_SIGMAS, nis_interval, residuals_m, spread_by_link};
use super::solve::{Solved, solve};
use super::start::start;
use super::{Bias, BiasOf, Link, LocateOptions, RangeSample};
use noctograph_core::error::Result;
use noctograph_sim::estimate::Normal;

/// σ of a bias before the log: antenna delays that nobody measured are some 0.5 m, paths around an
/// obstacle less than a meter longer.
const PRIOR_SIGMA_M: f64 = 1.0;
/// Least fall of χ² for one more bias: five standard deviations.
const LEAST_GAIN: f64 = 25.0;
/// Fall of χ² by which a bias must be better than another to be told from it: 1000 times as likely.
const TOLD_APART: f64 = 13.8;
/// Most rounds of identification and adaptation.
const ROUNDS: usize = 6;
/// Links that are tried at most, those with the largest residuals first.
const MOST_TRIED: usize = 6;
/// Most multiplications of the first passes of all tries to leave a link out: each try takes some
/// ten passes. Five minutes of two drones with eight anchors at 100 Hz may take 28 tries.
const MOST_WORK: f64 = 2e10;
/// Share of the mean normalized innovation squared that is left at most where leaving out helps.
const HELPS: f64 = 0.7;

/// The information of a log on the biases of all links.
struct Evidence {
    links: Vec<Link>,
    information: DMatrix<f64>,
    vector: DVector<f64>,
    /// Mean normalized innovation squared, at least 1: noisier ranges tell less.
    dispersion: f64,
}

impl Evidence {
    /// From a filter with a bias for every link, linearized about located positions.
    fn new(
        model: &Model<'_>,
        samples: &[RangeSample],
        repaired: &Repaired,
        start: &Normal,
    ) -> Self {
        let links: BTreeSet<Link> = samples.iter().map(|sample| sample.link).collect();
        let is_used = |link: &Link| !repaired.left_out.contains(link);
        let links: Vec<Link> = links.into_iter().filter(is_used).collect();
        let all = model.with_biases(links.iter().copied().map(BiasOf::Link).collect());
        let (n, size) = (STATES * model.n_drones(), links.len());
        let (mut filter, mut found) =
            (all.filter(&with_prior(start, n, size)), Innovations::default());
        let mut here = vec![0.0; n + size];
        for (k, step) in together(samples).enumerate() {
            here[..n].copy_from_slice(&repaired.solved.path.states(k)[..n]);
            all.advance(&mut filter, step, Some(&here), &mut found);
        }
        let Normal { mean, covariance, .. } = &filter.normal;
        let of_biases = covariance.view((n, n), (size, size)).into_owned();
        let (information, vector) = match of_biases.try_inverse() {
            Some(inverse) => (&inverse - prior(size), inverse * mean.rows(n, size)),
            None => (DMatrix::zeros(size, size), DVector::zeros(size)),
        };
        Self { links, information, vector, dispersion: found.nis().unwrap_or(1.0).max(1.0) }
    }

    /// Fall of χ² by these biases, and their values.
    fn fit(&self, chosen: &[BiasOf]) -> (f64, DVector<f64>) {
        let c = DMatrix::from_fn(self.links.len(), chosen.len(), |row, column| {
            f64::from(u8::from(chosen[column].covers(self.links[row])))
        });
        let right = c.transpose() * &self.vector;
        let normal = c.transpose() * &self.information * &c + prior(chosen.len());
        let values = normal.cholesky().map_or_else(|| right.clone() * 0.0, |c| c.solve(&right));
        (right.dot(&values) / self.dispersion, values)
    }

    /// The biases that explain the log, and those that cannot be told from them.
    fn choose(&self, least_m: f64) -> (Vec<BiasOf>, Vec<BiasOf>) {
        let drones: BTreeSet<usize> = self.links.iter().flat_map(|link| link.drones()).collect();
        let n_covered = |all: &BiasOf| self.links.iter().filter(|link| all.covers(**link)).count();
        let of_drones = drones.into_iter().map(BiasOf::Drone).filter(|all| n_covered(all) > 1);
        let of_links = self.links.iter().copied().map(BiasOf::Link);
        let candidates: Vec<BiasOf> = of_links.chain(of_drones).collect();
        let mut chosen: Vec<BiasOf> = Vec::new();
        for _ in 0..candidates.len() {
            let before = self.fit(&chosen).0;
            let more = candidates.iter().filter(|candidate| !chosen.contains(candidate));
            let with = |candidate: &BiasOf| {
                let more = [&chosen[..], &[*candidate]].concat();
                let (gain, values) = self.fit(&more);
                (gain, values[values.len() - 1].abs(), *candidate)
            };
            let mattering = more.map(with).filter(|(_, bias_m, _)| *bias_m >= least_m);
            let best = mattering.max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, _, best)) = best.filter(|(gain, ..)| gain - before >= LEAST_GAIN) else {
                break;
            };
            chosen.push(best);
            self.prune(&mut chosen, least_m);
        }
        let (gain, _) = self.fit(&chosen);
        let as_good = |candidate: &BiasOf| {
            (0..chosen.len()).any(|out| {
                let mut other = chosen.clone();
                other[out] = *candidate;
                gain - self.fit(&other).0 < TOLD_APART
            })
        };
        let doubtful: Vec<BiasOf> =
            candidates.iter().filter(|c| !chosen.contains(c) && as_good(c)).copied().collect();
        (chosen, doubtful)
    }

    /// Takes out again what later choices have explained.
    fn prune(&self, chosen: &mut Vec<BiasOf>, least_m: f64) {
        loop {
            let (gain, values) = self.fit(chosen);
            let is_idle = |k: &usize| {
                let mut others = chosen.clone();
                others.remove(*k);
                values[*k].abs() < least_m || gain - self.fit(&others).0 < LEAST_GAIN
            };
            let Some(idle) = (0..chosen.len()).find(is_idle) else { return };
            chosen.remove(idle);
        }
    }
}

/// Information on biases before the log.
fn prior(n_biases: usize) -> DMatrix<f64> {
    DMatrix::from_diagonal_element(n_biases, n_biases, 1.0 / (PRIOR_SIGMA_M * PRIOR_SIGMA_M))
}

/// The first `n` states, and as many biases of which nothing is known.
fn with_prior(start: &Normal, n: usize, n_biases: usize) -> Normal {
    let size = n + n_biases;
    let mean = start.mean.rows(0, n).into_owned().resize_vertically(size, 0.0);
    let places = start.covariance.view((0, 0), (n, n)).into_owned();
    let mut covariance = places.resize(size, size, 0.0);
    (n..size).for_each(|i| covariance[(i, i)] = PRIOR_SIGMA_M * PRIOR_SIGMA_M);
    Normal::new(mean, covariance)
}

/// A log located without the errors of its links.
pub(super) struct Repaired {
    pub(super) solved: Solved,
    pub(super) biases: Vec<Bias>,
    /// Links of which no range is used.
    pub(super) left_out: Vec<Link>,
    /// Whether links were not tried since the log is long.
    pub(super) cut_short: bool,
}

/// A log with the biases that explain it taken off, and without the links that none explains;
/// `None` where there are neither. Ranges far from their link's others are left out.
pub(super) fn repair<'a>(
    model: &Model<'a>,
    heard_s: &[[f64; 2]],
    samples: &[RangeSample],
    options: &'a LocateOptions,
) -> Result<Option<Repaired>> {
    let log = Log { model, heard_s, samples, sigma_m: options.range_sigma_m };
    let (mut best, mut start) = log.identified(Vec::new())?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
    let mut tries_left = (MOST_WORK / work(heard_s.len(), samples).max(1.0)) as usize;
    while let Some(next) = log.with_one_link_less(&best, &mut tries_left) {
        (best, start) = next;
    }
    best.cut_short = tries_left == 0;
    if best.biases.is_empty() && best.left_out.is_empty() {
        return Ok(None);
    }
    if !options.smooth {
        let own = log.adapted(&best);
        best.solved = solve(&own, samples, &start, false)?;
    }
    Ok(Some(best))
}

/// A log that contradicts itself.
struct Log<'m, 'a> {
    model: &'m Model<'a>,
    heard_s: &'m [[f64; 2]],
    samples: &'m [RangeSample],
    sigma_m: f64,
}

impl<'a> Log<'_, 'a> {
    /// The model with the biases and without the ranges of a repaired log.
    fn adapted(&self, repaired: &Repaired) -> Model<'a> {
        let mut model = self.model.with_biases(repaired.biases.iter().map(|b| b.of).collect());
        model.gate_sigmas = f64::INFINITY;
        model.left_out = self.strays(repaired);
        model
    }

    /// The log without some links, with its biases; and the start of its passes.
    fn identified(&self, left_out: Vec<Link>) -> Result<(Repaired, Normal)> {
        let mut model = self.model.with_biases(Vec::new());
        model.gate_sigmas = f64::INFINITY;
        let is_out = |sample: &RangeSample| left_out.contains(&sample.link);
        model.left_out = self.samples.iter().map(is_out).collect();
        let mut start = self.wide_start(&model, &left_out, &[])?;
        let solved = solve(&model, self.samples, &start, true)?;
        let mut repaired = Repaired { solved, biases: Vec::new(), left_out, cut_short: false };
        for _ in 0..ROUNDS {
            model.left_out = self.strays(&repaired);
            let evidence = Evidence::new(&model, self.samples, &repaired, &start);
            let (chosen, doubtful) = evidence.choose(LEAST_BIAS_SIGMAS * self.sigma_m);
            let mut biases = [&chosen[..], &doubtful].concat();
            biases.sort_unstable();
            let settled = biases == model.biases;
            model = model.with_biases(biases);
            start = self.wide_start(&model, &repaired.left_out, &repaired.biases)?;
            repaired.solved = solve(&model, self.samples, &start, true)?;
            repaired.biases = repaired.solved.biases(&model);
            for bias in &mut repaired.biases {
                let others = model.biases.iter().filter(|of| **of != bias.of).copied();
                let others = evidence.fit(&others.collect::<Vec<_>>()).0;
                let all = evidence.fit(&model.biases).0;
                bias.in_doubt = !doubtful.is_empty() && all - others < TOLD_APART;
            }
            if settled {
                break;
            }
        }
        Ok((repaired, start))
    }

    /// The log without one more link, of those with the largest residuals the first without which
    /// it contradicts itself less; `None` where there is none, or no contradiction.
    fn with_one_link_less(
        &self,
        before: &Repaired,
        tries_left: &mut usize,
    ) -> Option<(Repaired, Normal)> {
        let innovations = &before.solved.innovations;
        let nis = innovations.nis()?;
        if nis <= nis_interval(innovations.taken)[1] {
            return None;
        }
        let mut squares: BTreeMap<Link, (f64, f64)> = BTreeMap::new();
        for (sample, left_m) in self.samples.iter().zip(self.residuals_m(before)) {
            let (sum, n) = squares.entry(sample.link).or_default();
            (*sum, *n) = (*sum + left_m * left_m, *n + 1.0);
        }
        squares.retain(|link, _| !before.left_out.contains(link));
        let means = squares.into_iter().map(|(link, (sum, n))| (link, sum / n));
        let mut links: Vec<(Link, f64)> = means.collect();
        links.sort_by(|a, b| b.1.total_cmp(&a.1));
        links.into_iter().take(MOST_TRIED).find_map(|(link, _)| {
            *tries_left = tries_left.checked_sub(1)?;
            // Too few links may be left.
            let without = [&before.left_out[..], &[link]].concat();
            let identified = self.identified(without).ok()?;
            let after = identified.0.solved.innovations.nis()?;
            (after < HELPS * nis).then_some(identified)
        })
    }

    fn residuals_m(&self, repaired: &Repaired) -> Vec<f64> {
        let positions_m = repaired.solved.positions_m(self.model.n_drones());
        residuals_m(self.model.anchors_m, self.samples, &positions_m, &repaired.biases)
    }

    /// Which ranges are far from the others of their link, or of a link that is left out.
    fn strays(&self, repaired: &Repaired) -> Vec<bool> {
        let left_m = self.residuals_m(repaired);
        let by_link = spread_by_link(self.samples, &left_m);
        let is_stray = |(sample, left_m): (&RangeSample, &f64)| {
            let (median_m, scatter_m, _) = by_link[&sample.link];
            let sigma_m = self.sigma_m.max(scatter_m);
            let is_far = (left_m - median_m).abs() > self.model.gate_sigmas * sigma_m;
            is_far || repaired.left_out.contains(&sample.link)
        };
        self.samples.iter().zip(&left_m).map(is_stray).collect()
    }

    /// A start that trusts no range to more than the prior of a bias.
    fn wide_start(&self, model: &Model<'_>, left_out: &[Link], biases: &[Bias]) -> Result<Normal> {
        let used = self.samples.iter().filter(|sample| !left_out.contains(&sample.link));
        let corrected = used.map(|sample| {
            let distance_m = sample.distance_m - bias_m(biases, sample.link);
            RangeSample { distance_m, ..*sample }
        });
        let corrected: Vec<RangeSample> = corrected.collect();
        let room = model.options.room.as_ref();
        let places = start(model.anchors_m, self.heard_s, &corrected, PRIOR_SIGMA_M, room)?;
        Ok(with_prior(&places, places.mean.len(), model.biases.len()))
    }
}
