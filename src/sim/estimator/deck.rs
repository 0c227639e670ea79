//! Driver of the Lighthouse deck, which determines the sweeps that reach the Kalman filter.
//!
//! Both sweeps of a rotation are passed on when the second one arrives. A rotation that lacks a
//! sweep is dropped. About 50 rotations per second from all second-generation stations are kept at
//! random.
//!
//! The sources are `pulse_processor_v2.c` (pairing of sweeps), `lighthouse_core.c` (use of the
//! second sweep) and `lighthouse_throttle.c` of firmware 2026.08.
//!
//! The case that the driver mistakes a sweep and its reflection for one rotation is not modeled.

use crate::options::FirmwareOptions;
use crate::sensors::{Generation, SensorOptions, Sweep};
use noctograph_core::random::Noise;

/// Maximum time in s between the two sweeps of a rotation, which are 6.7 ms or 8.3 ms apart and are
/// received in ticks of up to 2 ms.
const LONGEST_PAIR_S: f64 = 0.0115;
/// Time in s after which the dropped fraction is recomputed.
const EVALUATION_S: f64 = 0.1;

/// Sweeps that are used together, which are either both sweeps of a rotation or one of them.
#[derive(Clone, Debug)]
pub(super) struct Rotation {
    pub(super) station: usize,
    /// Angles of both planes in rad, if both are known.
    pub(super) both_rad: Option<[[f64; 4]; 2]>,
    /// Planes that are used, with their angles in rad.
    pub(super) planes: Vec<(usize, [f64; 4])>,
}

#[derive(Debug)]
pub(super) struct Deck {
    pairs: bool,
    /// True for second-generation stations, which are throttled.
    throttled: Vec<bool>,
    rotations_hz: f64,
    noise: Noise,
    /// Sweeps of the first plane, for each station, that have not been paired yet.
    first: Vec<Option<(f64, [f64; 4])>>,
    /// Number of rotations since the dropped fraction was computed.
    counted: f64,
    /// Time in s at which the dropped fraction was computed.
    evaluated_s: f64,
    dropped_frac: f64,
}

impl Deck {
    /// Creates a deck that has received no sweep. `noise` determines which rotations are dropped.
    pub(super) fn new(options: &FirmwareOptions, sensors: &SensorOptions, noise: Noise) -> Self {
        let stations = &sensors.lighthouse.stations;
        // Without pairing, each of the two sweeps of a rotation counts as a rotation.
        let counts_per_rotation = if options.paired_sweeps { 1.0 } else { 2.0 };
        Self {
            pairs: options.paired_sweeps,
            throttled: stations.iter().map(|s| s.generation == Generation::V2).collect(),
            rotations_hz: options.rotations_hz * counts_per_rotation,
            noise,
            first: vec![None; stations.len()],
            counted: 0.0,
            evaluated_s: 0.0,
            dropped_frac: 0.0,
        }
    }

    /// Pairs the sweeps that arrived at `time_s` into rotations, and returns those that are kept. A
    /// rotation contains one plane if the options do not pair sweeps.
    pub(super) fn receive(&mut self, sweeps: &[Sweep], time_s: f64) -> Vec<Rotation> {
        let mut rotations = Vec::new();
        for sweep in sweeps {
            let Sweep { station, plane, angles_rad } = *sweep;
            // The angles of both planes serve for the yaw even if the sweeps are used separately.
            let both_rad = self.pair(sweep, time_s);
            let planes = match both_rad {
                _ if !self.pairs => vec![(plane, angles_rad)],
                Some([first, second]) => vec![(0, first), (1, second)],
                None => continue,
            };
            if !self.throttled[station] || self.keeps(time_s) {
                rotations.push(Rotation { station, both_rad, planes });
            }
        }
        rotations
    }

    /// Returns both planes' angles at the second sweep of a rotation, or `None` at the first one or
    /// if the first was missed. If a reflection causes two first sweeps, the smaller angle is used.
    /// The angles in rad are those of the deck's four sensors.
    fn pair(&mut self, sweep: &Sweep, time_s: f64) -> Option<[[f64; 4]; 2]> {
        let first = &mut self.first[sweep.station];
        let recent = first.filter(|(then_s, _)| time_s - then_s < LONGEST_PAIR_S);
        if sweep.plane == 1 {
            return recent.map(|(_, angles_rad)| [angles_rad, sweep.angles_rad]);
        }
        let earlier = recent.filter(|(_, angles_rad)| angles_rad[0] < sweep.angles_rad[0]);
        *first = earlier.or(Some((time_s, sweep.angles_rad)));
        None
    }

    /// True if a rotation is kept. The call also counts the rotation to measure their rate. A limit
    /// of 0 Hz keeps every rotation.
    fn keeps(&mut self, time_s: f64) -> bool {
        if self.rotations_hz == 0.0 {
            return true;
        }
        // The fraction by which the last interval exceeded the limit is dropped at random.
        self.counted += 1.0;
        let span_s = time_s - self.evaluated_s;
        if span_s > EVALUATION_S {
            let measured_hz = self.counted / span_s;
            self.dropped_frac = (1.0 - self.rotations_hz / measured_hz).max(0.0);
            (self.counted, self.evaluated_s) = (0.0, time_s);
        }
        self.noise.uniform() >= self.dropped_frac
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deck(options: &FirmwareOptions) -> Deck {
        Deck::new(options, &SensorOptions::default(), Noise::new(1, 0, "deck"))
    }

    fn sweep(plane: usize, angle_rad: f64) -> Sweep {
        Sweep { station: 0, plane, angles_rad: [angle_rad; 4] }
    }

    #[test]
    fn a_rotation_needs_both_its_sweeps_and_comes_at_the_second() {
        let mut deck = deck(&FirmwareOptions::default());
        assert!(deck.receive(&[sweep(0, 0.1)], 0.0).is_empty());
        let rotations = deck.receive(&[sweep(1, 0.2)], 0.008);
        assert_eq!(rotations[0].both_rad, Some([[0.1; 4], [0.2; 4]]));
        assert_eq!(rotations[0].planes.len(), 2);
        assert!(deck.receive(&[sweep(1, 0.2)], 0.028).is_empty(), "the first one was lost");
        assert!(deck.receive(&[sweep(0, 0.4), sweep(0, 0.3)], 0.04).is_empty());
        let rotations = deck.receive(&[sweep(1, 0.2)], 0.046);
        assert_eq!(rotations[0].both_rad.unwrap()[0], [0.3; 4], "the earlier one of two");
        let one_by_one = FirmwareOptions { paired_sweeps: false, ..FirmwareOptions::default() };
        let mut deck = self::deck(&one_by_one);
        assert_eq!(deck.receive(&[sweep(0, 0.1)], 0.0)[0].planes, [(0, [0.1; 4])]);
        assert_eq!(deck.receive(&[sweep(1, 0.2)], 0.006)[0].planes, [(1, [0.2; 4])]);
    }

    #[test]
    fn fifty_rotations_a_second_are_kept_of_any_number_and_fewer_are_all_kept() {
        let throttled = FirmwareOptions::default();
        let unlimited = FirmwareOptions { rotations_hz: 0.0, ..throttled.clone() };
        for (rotations_hz, options, wanted) in [
            (100, &throttled, 1900..2100),
            (160, &throttled, 1900..2100),
            (40, &throttled, 1600..1601),
            (100, &unlimited, 4000..4001),
        ] {
            let (mut deck, mut kept) = (deck(options), 0);
            for n in 0..40 * rotations_hz {
                let time_s = f64::from(n) / f64::from(rotations_hz);
                deck.receive(&[sweep(0, 0.1)], time_s);
                kept += deck.receive(&[sweep(1, 0.1)], time_s + 0.006).len();
            }
            assert!(wanted.contains(&kept), "{kept} of {rotations_hz} a second");
        }
    }
}
