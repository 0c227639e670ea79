//! Columns: the shares of the net's classes along a strip.

use super::alphabet::Classes;
use super::net::N_CLASSES;

/// Least share of a class at a column: below it, shares are noise of the training.
const LEAST: f64 = 1e-6;

/// Shares of the classes at each column.
pub(super) struct Columns(pub(super) Vec<[f64; N_CLASSES]>);

impl Columns {
    /// Shares from logits.
    pub(super) fn from_logits(logits: &[[f64; N_CLASSES]]) -> Self {
        let shares = logits.iter().map(|logits| {
            let most = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let shares = logits.map(|logit| libm::exp(logit - most));
            let sum: f64 = shares.iter().sum();
            shares.map(|share| (share / sum).max(LEAST))
        });
        Self(shares.collect())
    }

    /// Several lines, one after another.
    pub(super) fn joined(lines: impl IntoIterator<Item = Self>) -> Self {
        Self(lines.into_iter().flat_map(|line| line.0).collect())
    }

    /// Share of a set of classes at each column.
    pub(super) fn shares(&self, set: Classes) -> Vec<f64> {
        let members: Vec<usize> = (0..N_CLASSES).filter(|class| set >> class & 1 == 1).collect();
        self.0.iter().map(|column| members.iter().map(|class| column[*class]).sum()).collect()
    }
}
