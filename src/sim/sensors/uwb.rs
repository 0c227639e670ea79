//! Ultra-wideband ranges, which are either two-way ranges or differences between two anchors.
//!
//! The errors of ranges are white noise, a bias of each link that depends on the drone's position,
//! and outliers. Anchors take turns, and a difference is between an anchor and the next one
//! received. In a fleet, all links take turns, beginning with the links of each drone to its
//! anchors, followed by the pairs of drones. Both drones of a pair receive the same range. Walls,
//! antenna patterns and collisions of packets are not modeled.

use nalgebra::Vector3;

use super::streams::{Clock, Streams};
use super::{Fleet, Positioning, SensorOptions, UwbOptions};
use noctograph_core::error::Result;
use noctograph_core::random::{Field, Noise};

/// Correlation length in m of a link's bias, assumed to be the size of furniture.
const BIAS_LENGTH_M: f64 = 1.5;
/// Mean magnitude in m of an outlier's error, which is positive for two-way ranges and has either
/// sign for differences.
const OUTLIER_M: f64 = 1.0;

/// Measured distance to an anchor, or difference of two distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Index of the anchor.
    pub anchor: usize,
    /// Index of the anchor whose distance was subtracted, if the range is a difference.
    pub minus: Option<usize>,
    /// Distance `|p − a|`, or difference `|p − a| − |p − b|`, in m.
    pub distance_m: f64,
}

/// Measured distance to another drone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PeerRange {
    /// Place of the other drone in the fleet.
    pub drone: usize,
    pub distance_m: f64,
}

/// Link that is measured in one turn. Drones are given by their places in the fleet.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Turn {
    /// Link to an anchor and, for a difference, to another anchor whose distance is subtracted.
    Anchor {
        drone: usize,
        anchor: usize,
        minus: Option<usize>,
    },
    Drones(usize, usize),
}

/// Returns the links of drones with these indices in the order of their turns. The links of each
/// drone to its anchors are followed by the pairs of drones. Returns an error for a drone without a
/// list of anchors.
pub(crate) fn turns(options: &SensorOptions, indices: &[u64]) -> Result<Vec<Turn>> {
    let differences = options.positioning == Positioning::UwbTdoa;
    // The links are ordered by index, so that the order of the drones has no effect.
    let mut drones: Vec<usize> = (0..indices.len()).collect();
    drones.sort_by_key(|drone| indices[*drone]);
    let mut turns = Vec::new();
    for &drone in &drones {
        let heard = options.uwb.heard_by(indices[drone])?;
        let next = heard.iter().cycle().skip(1);
        turns.extend(heard.iter().zip(next).map(|(&anchor, &next)| {
            let minus = differences.then_some(next);
            Turn::Anchor { drone, anchor, minus }
        }));
    }
    for (k, &first) in drones.iter().enumerate().filter(|_| options.peers.ranging) {
        turns.extend(drones[k + 1..].iter().map(|second| Turn::Drones(first, *second)));
    }
    Ok(turns)
}

/// White noise and outliers of ranges.
#[derive(Debug)]
struct Errors {
    noise: Noise,
    outliers: Noise,
}

impl Errors {
    /// Returns a distance in m with white noise and outliers added. Outliers are exponentially
    /// distributed, and have either sign for differences.
    fn add_to(&mut self, distance_m: f64, options: &UwbOptions, differences: bool) -> f64 {
        // A Laplace distribution is drawn from its quantile. The lower half uses 1 − 2 q, which has
        // the same distribution as 2 q but is never zero. Each range takes two numbers, whether or
        // not it is an outlier.
        let white_m = self.noise.normal() * options.noise_m;
        let [chance, uniform] = [self.outliers.uniform(), self.outliers.uniform()];
        let quantile = if differences { uniform } else { 0.5 + 0.5 * uniform };
        let outlier_m = if chance >= options.outlier_frac {
            0.0
        } else if quantile < 0.5 {
            OUTLIER_M * libm::log(1.0 - 2.0 * quantile)
        } else {
            -OUTLIER_M * libm::log(2.0 * (1.0 - quantile))
        };
        distance_m + white_m + outlier_m
    }
}

/// Anchors, and the tag on the drone.
#[derive(Debug)]
pub(super) struct Uwb {
    options: UwbOptions,
    differences: bool,
    /// Place of the drone in the fleet.
    place: usize,
    anchors_m: Vec<Vector3<f64>>,
    turns: Vec<Turn>,
    clock: Clock,
    /// Bias of each link to an anchor, or to the pair of anchors that begins with it.
    biases: Vec<Field<1>>,
    errors: Errors,
    /// Bias and errors of the link to each drone of the fleet.
    peers: Vec<(Field<1>, Errors)>,
    ranges: Vec<Range>,
    peer_ranges: Vec<PeerRange>,
}

impl Uwb {
    /// Creates the tag of a drone in a fleet, before its first reading.
    pub(super) fn new(options: &SensorOptions, fleet: &Fleet, streams: &Streams) -> Self {
        let indices: Vec<u64> = fleet.members.iter().map(|member| member.index).collect();
        let uwb = &options.uwb;
        let bias = |mut noise: Noise| Field::new(&mut noise, uwb.bias_m, BIAS_LENGTH_M);
        // Both drones of a pair draw from the same streams, so their readings are equal.
        let index = indices[fleet.place];
        let peers = indices.iter().map(|other| {
            let (first, second) = (index.min(*other), index.max(*other));
            let [noise, outliers, link] = ["noise", "strays", "link"]
                .map(|what| streams.noise_of(first, &format!("uwb peer {second} {what}")));
            (bias(link), Errors { noise, outliers })
        });
        let anchors_m = uwb.anchors();
        let links = 0..anchors_m.len();
        Self {
            differences: options.positioning == Positioning::UwbTdoa,
            place: fleet.place,
            turns: turns(options, &indices).expect("checked before"),
            clock: Clock::new(uwb.rate_hz),
            biases: links.map(|i| bias(streams.room_noise(&format!("uwb link {i}")))).collect(),
            errors: Errors {
                noise: streams.drone_noise("uwb noise"),
                outliers: streams.drone_noise("uwb strays"),
            },
            peers: peers.collect(),
            // This capacity in ranges suffices for 2000 ranges per second and a loop of 50 Hz.
            ranges: Vec::with_capacity(64),
            peer_ranges: Vec::new(),
            anchors_m,
            options: uwb.clone(),
        }
    }

    /// Returns the ranges that are due by `time_s`, first those to anchors, and then those to
    /// drones at `fleet_m` (true positions, in the order of the fleet).
    pub(super) fn read(
        &mut self,
        position_m: &Vector3<f64>,
        fleet_m: &[Vector3<f64>],
        time_s: f64,
    ) -> (&[Range], &[PeerRange]) {
        self.ranges.clear();
        self.peer_ranges.clear();
        while let Some(k) = self.clock.due(time_s) {
            match self.turns[k % self.turns.len()] {
                Turn::Anchor { drone, anchor, minus } if drone == self.place => {
                    let distance = |i: usize| (position_m - self.anchors_m[i]).norm();
                    let true_m = distance(anchor) - minus.map_or(0.0, distance);
                    let biased_m = true_m + self.biases[anchor].component(0, position_m);
                    let distance_m = self.errors.add_to(biased_m, &self.options, self.differences);
                    self.ranges.push(Range { anchor, minus, distance_m });
                }
                Turn::Drones(i, j) if i == self.place || j == self.place => {
                    let drone = if i == self.place { j } else { i };
                    let (bias, errors) = &mut self.peers[drone];
                    // The bias is that at the midpoint, so that both drones measure the same range.
                    let middle_m = (position_m + fleet_m[drone]) * 0.5;
                    let true_m = (position_m - fleet_m[drone]).norm();
                    let biased_m = true_m + bias.component(0, &middle_m);
                    let distance_m = errors.add_to(biased_m, &self.options, self.differences);
                    self.peer_ranges.push(PeerRange { drone, distance_m });
                }
                Turn::Anchor { .. } | Turn::Drones(..) => {}
            }
        }
        (&self.ranges, &self.peer_ranges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::density::white_density;

    const PLACE_M: Vector3<f64> = Vector3::new(0.3, -0.2, 0.8);

    /// Returns the errors during ten minutes at rest for each link.
    fn errors(options: &UwbOptions, differences: bool) -> Vec<Vec<f64>> {
        let positioning = [Positioning::UwbTwr, Positioning::UwbTdoa][usize::from(differences)];
        let options = SensorOptions { positioning, uwb: options.clone(), ..Default::default() };
        let mut uwb = Uwb::new(&options, &Fleet::alone(0), &Streams::alone(4));
        let anchors = uwb.anchors_m.clone();
        let mut errors = vec![Vec::new(); anchors.len()];
        for tick in 0..300_000 {
            for range in uwb.read(&PLACE_M, &[], f64::from(tick) / 500.0).0 {
                let distance = |i: usize| (PLACE_M - anchors[i]).norm();
                let truth = distance(range.anchor) - range.minus.map_or(0.0, distance);
                errors[range.anchor].push(range.distance_m - truth);
            }
        }
        errors
    }

    fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let n = values.len() as f64;
        values.sum::<f64>() / n
    }

    #[test]
    fn white_part_and_bias_have_their_size_and_links_their_turn() {
        for differences in [false, true] {
            let options = UwbOptions { outlier_frac: 0.0, ..UwbOptions::default() };
            let errors = errors(&options, differences);
            let mut bias_sq = 0.0;
            for link in &errors {
                assert!((13_499..13_502).contains(&link.len()), "{} of 108000 / 8", link.len());
                let bias = mean(link.iter().copied());
                let sigma = mean(link.iter().map(|e| (e - bias) * (e - bias))).sqrt();
                assert!((sigma / 0.06 - 1.0).abs() < 0.03, "white part {sigma}");
                for density in white_density(link, 180.0 / 8.0) {
                    let want = 0.06 / f64::sqrt(0.5 * 180.0 / 8.0);
                    assert!((density / want - 1.0).abs() < 0.3, "{density} m/√Hz of {want}");
                }
                bias_sq += bias * bias / 8.0;
            }
            // With eight draws, the value is almost always between 0.1 and 0.3 m.
            assert!((0.1..0.3).contains(&bias_sq.sqrt()), "bias {}", bias_sq.sqrt());
        }
    }

    #[test]
    fn outliers_are_as_many_and_as_large_as_stated() {
        let options =
            UwbOptions { noise_m: 0.0, bias_m: 0.0, outlier_frac: 0.14, ..UwbOptions::default() };
        for differences in [false, true] {
            let errors: Vec<f64> = errors(&options, differences).concat();
            let outliers: Vec<f64> = errors.iter().copied().filter(|e| e.abs() > 1e-9).collect();
            let n = outliers.len();
            let fraction = n as f64 / errors.len() as f64;
            assert!((fraction - 0.14).abs() < 0.005, "fraction {fraction}");
            let size = mean(outliers.iter().map(|e| e.abs()));
            assert!((size / OUTLIER_M - 1.0).abs() < 0.05, "mean size {size}");
            let shorter = outliers.iter().filter(|e| **e < 0.0).count();
            let want = if differences { n / 2 } else { 0 };
            assert!(shorter.abs_diff(want) < n / 50, "{shorter} of {n}");
        }
    }
}
