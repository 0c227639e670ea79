//! A bias of ranges, and which ranges have it.

use serde::Serialize;

use super::Link;

/// The ranges that a bias belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BiasOf {
    /// One link.
    Link(Link),
    /// All ranges of a drone to anchors, as by its antenna's delay.
    Drone(usize),
}

impl BiasOf {
    pub(super) fn covers(self, link: Link) -> bool {
        match self {
            Self::Link(own) => own == link,
            Self::Drone(own) => matches!(link, Link::Anchor { drone, .. } if drone == own),
        }
    }
}

impl std::fmt::Display for BiasOf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Link(link) => link.fmt(f),
            Self::Drone(drone) => write!(f, "all anchors of drone {}", drone + 1),
        }
    }
}

impl Serialize for BiasOf {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// A bias that was found and taken off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bias {
    /// Of which ranges.
    pub of: BiasOf,
    /// Measured minus true distance.
    pub bias_m: f64,
    /// Its standard deviation.
    pub sigma_m: f64,
    /// Whether another bias in the list would explain the log as well without this one.
    pub in_doubt: bool,
}

/// What biases add to the ranges of a link.
pub(super) fn bias_m(biases: &[Bias], link: Link) -> f64 {
    biases.iter().filter(|bias| bias.of.covers(link)).map(|bias| bias.bias_m).sum()
}
