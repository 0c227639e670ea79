//! Ultra-wideband ranges: two-way, or differences between two anchors.
//!
//! White noise, an error of each link that depends on the drone's place, and strays. Anchors are
//! asked in turn; a difference is taken between an anchor and the next one that is heard. In a
//! fleet all links take turns: those of each drone to its anchors, then the pairs of drones, both
//! of which read the same range. Walls, antennas' patterns and collisions of packets are not
//! modeled.

use nalgebra::Vector3;

use super::streams::Streams;
use super::{Fleet, PeerOptions, UwbOptions};
use noctograph_core::random::{Field, Noise};

/// Distance over which a link's error changes: an assumption, of the size of the furniture.
const BIAS_LENGTH_M: f64 = 1.5;

/// One measured distance, or difference of two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Index of the anchor.
    pub anchor: usize,
    /// Index of the anchor whose distance was subtracted, for a difference.
    pub minus: Option<usize>,
    /// `|p − a|`, or `|p − a| − |p − b|`.
    pub distance_m: f64,
}

/// One measured distance to another drone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PeerRange {
    /// Place of the other drone in the fleet.
    pub drone: usize,
    pub distance_m: f64,
}

/// A turn in the round of all links.
#[derive(Clone, Copy, Debug)]
enum Turn {
    /// To an anchor, and the one whose distance is subtracted from a difference.
    Anchor(usize, usize),
    /// To a drone: its place, and the index of the link.
    Drone(usize, usize),
    /// Of other drones.
    Others,
}

/// The link to another drone.
#[derive(Debug)]
struct PeerLink {
    bias: Field<1>,
    noise: Noise,
    strays: Noise,
}

/// The anchors and the tag on the drone.
#[derive(Debug)]
pub(super) struct Uwb {
    anchors_m: Vec<Vector3<f64>>,
    turns: Vec<Turn>,
    peers: Vec<PeerLink>,
    differences: bool,
    rate_hz: f64,
    noise_m: f64,
    outlier_frac: f64,
    outlier_m: f64,
    /// One per link: an anchor, or the pair that begins with it.
    biases: Vec<Field<1>>,
    noise: Noise,
    strays: Noise,
    measured: u32,
    ranges: Vec<Range>,
    peer_ranges: Vec<PeerRange>,
}

impl Uwb {
    /// The tag of a drone.
    ///
    /// # Panics
    ///
    /// If the options leave out the anchors of the drone, see [`UwbOptions::heard_by`].
    pub(super) fn new(
        options: &UwbOptions,
        differences: bool,
        peers: &PeerOptions,
        fleet: &Fleet,
        streams: &Streams,
    ) -> Self {
        let own = fleet.members[fleet.place].index;
        let bias = |i: usize| {
            let mut noise = streams.shared_by_room(&format!("uwb link {i}"));
            Field::new(&mut noise, options.bias_m, BIAS_LENGTH_M)
        };
        let link = |other: u64| {
            let (first, second) = (own.min(other), own.max(other));
            let stream = |what: &str| streams.of_drone(first, &format!("uwb peer {second} {what}"));
            let bias = Field::new(&mut stream("link"), options.bias_m, BIAS_LENGTH_M);
            PeerLink { bias, noise: stream("noise"), strays: stream("strays") }
        };
        let anchors_m = options.anchors();
        let (turns, linked) = turns(options, peers.ranging, fleet);
        Self {
            turns,
            peers: linked.into_iter().map(link).collect(),
            differences,
            rate_hz: options.rate_hz,
            noise_m: options.noise_m,
            outlier_frac: options.outlier_frac,
            outlier_m: options.outlier_m,
            biases: (0..anchors_m.len()).map(bias).collect(),
            noise: streams.own("uwb noise"),
            strays: streams.own("uwb strays"),
            measured: 0,
            // A rate of 2 kHz on a control loop of 50 Hz.
            ranges: Vec::with_capacity(64),
            peer_ranges: Vec::new(),
            anchors_m,
        }
    }

    /// The ranges that are due by `time_s`, to anchors and to the drones of the fleet at `fleet_m`.
    pub(super) fn read(
        &mut self,
        position_m: &Vector3<f64>,
        fleet_m: &[Vector3<f64>],
        time_s: f64,
    ) -> (&[Range], &[PeerRange]) {
        self.ranges.clear();
        self.peer_ranges.clear();
        while f64::from(self.measured) <= time_s * self.rate_hz {
            let turn = self.turns[self.measured as usize % self.turns.len()];
            self.measured += 1;
            match turn {
                Turn::Anchor(anchor, next) => {
                    let range = self.range(anchor, next, position_m);
                    self.ranges.push(range);
                }
                Turn::Drone(drone, link) => {
                    let distance_m = self.peer_m(link, position_m, &fleet_m[drone]);
                    self.peer_ranges.push(PeerRange { drone, distance_m });
                }
                Turn::Others => {}
            }
        }
        (&self.ranges, &self.peer_ranges)
    }

    fn range(&mut self, anchor: usize, next: usize, position_m: &Vector3<f64>) -> Range {
        let distance = |i: usize| (position_m - self.anchors_m[i]).norm();
        let minus = self.differences.then_some(next);
        let true_m = distance(anchor) - minus.map_or(0.0, distance);
        let bias_m = self.biases[anchor].component(0, position_m);
        let white_m = self.noise.normal() * self.noise_m;
        let luck = [self.strays.uniform(), self.strays.uniform()];
        let astray_m = self.astray_m(luck);
        Range { anchor, minus, distance_m: true_m + bias_m + white_m + astray_m }
    }

    /// Distance to another drone. Its bias depends on the place midway, so that both ends read the
    /// same.
    fn peer_m(&mut self, link: usize, own_m: &Vector3<f64>, other_m: &Vector3<f64>) -> f64 {
        let peer = &mut self.peers[link];
        let bias_m = peer.bias.component(0, &((own_m + other_m) * 0.5));
        let white_m = peer.noise.normal() * self.noise_m;
        let luck = [peer.strays.uniform(), peer.strays.uniform()];
        (own_m - other_m).norm() + bias_m + white_m + self.astray_m(luck)
    }

    /// Error of an outlier, exponential; a difference strays either way.
    fn astray_m(&self, [luck, size]: [f64; 2]) -> f64 {
        let either = if self.differences { size } else { 0.5 + 0.5 * size };
        match luck < self.outlier_frac {
            true if either < 0.5 => self.outlier_m * libm::log(1.0 - 2.0 * either),
            true => -self.outlier_m * libm::log(2.0 * (1.0 - either)),
            false => 0.0,
        }
    }
}

/// The turns of a round as one drone sees them, and the indices of the drones that it ranges to.
fn turns(options: &UwbOptions, peer_ranging: bool, fleet: &Fleet) -> (Vec<Turn>, Vec<u64>) {
    // In the order of the indices: the names of the drones do not matter.
    let mut places: Vec<usize> = (0..fleet.members.len()).collect();
    places.sort_by_key(|place| fleet.members[*place].index);
    let (mut turns, mut linked) = (Vec::new(), Vec::new());
    for &place in &places {
        let heard = options.heard_by(fleet.members[place].index).expect("checked before");
        for (i, anchor) in heard.iter().enumerate() {
            let next = heard[(i + 1) % heard.len()];
            let own = place == fleet.place;
            turns.push(if own { Turn::Anchor(*anchor, next) } else { Turn::Others });
        }
    }
    for (k, &first) in places.iter().enumerate() {
        for &second in places[k + 1..].iter().filter(|_| peer_ranging) {
            let other = match fleet.place {
                place if place == first => second,
                place if place == second => first,
                _ => {
                    turns.push(Turn::Others);
                    continue;
                }
            };
            turns.push(Turn::Drone(other, linked.len()));
            linked.push(fleet.members[other].index);
        }
    }
    (turns, linked)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::density::{Series, white_density};

    const PLACE_M: Vector3<f64> = Vector3::new(0.3, -0.2, 0.8);

    /// Errors of ten minutes at rest, by link.
    fn errors(options: &UwbOptions, differences: bool) -> Vec<Vec<f64>> {
        let peers = PeerOptions::default();
        let mut uwb = Uwb::new(options, differences, &peers, &Fleet::alone(0), &Streams::alone(4));
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
                let mut series = Series::new(180.0 / 8.0);
                link.iter().for_each(|error| series.push(*error));
                for density in white_density(&series) {
                    let want = 0.06 / f64::sqrt(0.5 * 180.0 / 8.0);
                    assert!((density / want - 1.0).abs() < 0.3, "{density} m/√Hz of {want}");
                }
                bias_sq += bias * bias / 8.0;
            }
            // Eight draws: between half and one and a half of 0.2 m in all but a few per cent.
            assert!((0.1..0.3).contains(&bias_sq.sqrt()), "bias {}", bias_sq.sqrt());
        }
    }

    #[test]
    fn strays_are_as_many_and_as_large_as_stated() {
        let options = UwbOptions {
            noise_m: 0.0,
            bias_m: 0.0,
            outlier_frac: 0.14,
            outlier_m: 2.0,
            ..UwbOptions::default()
        };
        for differences in [false, true] {
            let all: Vec<f64> = errors(&options, differences).concat();
            let strays: Vec<f64> = all.iter().copied().filter(|e| e.abs() > 1e-9).collect();
            let share = strays.len() as f64 / all.len() as f64;
            assert!((share - 0.14).abs() < 0.005, "share {share}");
            let size = mean(strays.iter().map(|e| e.abs()));
            assert!((size / 2.0 - 1.0).abs() < 0.05, "mean size {size}");
            let shorter = strays.iter().filter(|e| **e < 0.0).count();
            let want = if differences { strays.len() / 2 } else { 0 };
            assert!(shorter.abs_diff(want) < strays.len() / 50, "{shorter} of {}", strays.len());
        }
    }
}
