//! Columns: the shares of the net's classes along a strip.

use std::ops::Range;

use rayon::prelude::*;

use super::alphabet::Classes;
use super::net::{self, N_CLASSES};
use super::strip::Strip;

/// Least share of a class at a column: below it, shares are noise of the training.
const LEAST: f64 = 1e-6;

/// Shares of the classes at each column.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Columns(pub(super) Vec<[f64; N_CLASSES]>);

impl Columns {
    /// Shares along a strip.
    pub(super) fn of(strip: &Strip) -> Self {
        Self::from_logits(&net::logits(strip))
    }

    /// The mean of the shares along a strip, its own, and along its neighbors: of letters that they
    /// disagree on, one is there all the same.
    pub(super) fn agreed(mut self, strip: &Strip) -> Self {
        let beside: Vec<Self> = strip.neighbors().par_iter().map(Self::of).collect();
        let part = 1.0 / (beside.len() + 1) as f64;
        for (at, column) in self.0.iter_mut().enumerate() {
            for (class, share) in column.iter_mut().enumerate() {
                let sum = beside.iter().map(|columns| columns.0[at][class]).sum::<f64>();
                *share = part * (*share + sum);
            }
        }
        self
    }

    /// Shares from logits.
    pub(super) fn from_logits(logits: &[[f64; N_CLASSES]]) -> Self {
        Self(logits.iter().map(shares).collect())
    }

    /// Takes the shares anew that depend on some columns of a strip.
    pub(super) fn replace(&mut self, strip: &Strip, part: Range<usize>) {
        let (first, logits) = net::logits_around(strip, part);
        for (column, logits) in self.0[first..].iter_mut().zip(&logits) {
            *column = shares(logits);
        }
    }

    /// The same with nothing where there is light that is no letter: trails lead to and from every
    /// word.
    pub(super) fn letters_alone(mut self) -> Self {
        for shares in &mut self.0 {
            shares[0] += std::mem::replace(&mut shares[N_CLASSES - 1], LEAST) - LEAST;
        }
        self
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
