//! Columns: the shares of the net's classes along a strip.

use std::ops::Range;

use super::alphabet::Classes;
use super::net::{self, COLUMN_PX, N_CLASSES};
use super::strip::{MARGIN_PX, SIDE_PX, Strip};

/// Least share of a class at a column: below it, shares are noise of the training.
const LEAST: f64 = 1e-6;

/// Shares of the classes at each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Columns(pub(super) Vec<[f64; N_CLASSES]>);

impl Columns {
    /// Shares from logits.
    pub(super) fn from_logits(logits: &[[f64; N_CLASSES]]) -> Self {
        Self(logits.iter().map(shares).collect())
    }

    /// Shares along the strip of an expected word. Light far beside the word is nothing unless it is a
    /// letter: trails lead to and from every word.
    pub(super) fn of_word(strip: &Strip) -> Self {
        let mut dark = [LEAST; N_CLASSES];
        dark[0] = 1.0;
        let mut columns = Self(vec![dark; strip.width / COLUMN_PX]);
        columns.replace(strip, 0..strip.width);
        columns
    }

    /// Takes the shares anew that depend on some columns of the strip of an expected word.
    pub(super) fn replace(&mut self, strip: &Strip, part: Range<usize>) {
        let (first, logits) = net::logits_around(strip, part);
        let (n_columns, aside) = (self.0.len(), (SIDE_PX - MARGIN_PX) / COLUMN_PX);
        for (at, logits) in (first..).zip(&logits) {
            let mut shares = shares(logits);
            if at < aside || at + aside >= n_columns {
                shares[0] += std::mem::replace(&mut shares[N_CLASSES - 1], LEAST) - LEAST;
            }
            self.0[at] = shares;
        }
    }

    /// Some of the columns.
    pub(super) fn part(&self, columns: Range<usize>) -> Self {
        Self(self.0[columns].to_vec())
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

fn shares(logits: &[f64; N_CLASSES]) -> [f64; N_CLASSES] {
    let most = logits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares = logits.map(|logit| libm::exp(logit - most));
    let sum: f64 = shares.iter().sum();
    shares.map(|share| (share / sum).max(LEAST))
}
