//! Radio link of one drone, which determines the last setpoint received and its time.
//!
//! The host sends its newest setpoint at every turn of the drone, so a setpoint that was not
//! received is skipped in favor of a newer one. Transmissions fail independently at random, and
//! always during outages.
//!
//! Signal strength and its dependence on the position, broadcasts, and a host that blocks while its
//! queue is full (cflib's queue contains one packet) are not modeled.

use super::options::RadioOptions;
use noctograph_core::random::Noise;

/// Durations in s of a packet with its answer, and of a switch to another drone's address
/// (`crazyradio2-firmware` issue 9: 2.5 ms for the USB request that sets the address, 0.7 ms for
/// packet and answer).
const PACKET_S: f64 = 0.7e-3;
const SWITCH_S: f64 = 2.5e-3;

/// Setpoints that a drone receives.
#[derive(Debug)]
pub(super) struct Link {
    options: RadioOptions,
    chance: Noise,
    outages: Noise,
    /// Beginning and end in s of the present outage or, between outages, of the next one.
    outage: [f64; 2],
    turn_s: f64,
    round_s: f64,
    /// Index of the last setpoint received, and the first and last times at which it was received.
    heard: usize,
    since_s: f64,
    last_s: f64,
}

impl Link {
    /// Creates the link of the drone `index`, or returns `None` if commands arrive immediately.
    /// Drones use the radio in turns, in the order of their indices.
    pub(super) fn new(options: &RadioOptions, seed: u64, index: u64) -> Option<Self> {
        if options.drones == 0 {
            return None;
        }
        let n = f64::from(options.drones);
        let switch_s = if options.drones > 1 { SWITCH_S } else { 0.0 };
        let slot = (index % u64::from(options.drones)) as f64;
        let mut link = Self {
            options: options.clone(),
            chance: Noise::new(seed, index, "radio"),
            // Other transmitters disturb all drones in the same way.
            outages: Noise::new(seed, 0, "radio outages"),
            outage: [f64::INFINITY; 2],
            turn_s: slot * (PACKET_S + switch_s),
            round_s: n * (PACKET_S + switch_s),
            heard: 0,
            since_s: 0.0,
            last_s: 0.0,
        };
        if options.outage_every_s > 0.0 {
            link.outage = [0.0; 2];
            link.next_outage();
        }
        Some(link)
    }

    /// Returns the index of the last setpoint received by `time_s`, while the host sends the
    /// setpoint `newest`. Times must not decrease.
    pub(super) fn hear(&mut self, time_s: f64, newest: usize) -> usize {
        while self.turn_s <= time_s {
            while self.turn_s >= self.outage[1] {
                self.next_outage();
            }
            // A random number is drawn at every turn, so that outages do not shift the stream.
            let is_lost =
                self.chance.uniform() < self.options.loss_frac || self.turn_s >= self.outage[0];
            if !is_lost {
                if self.heard != newest {
                    self.since_s = self.turn_s;
                }
                (self.heard, self.last_s) = (newest, self.turn_s);
            }
            self.turn_s += self.round_s;
        }
        self.heard
    }

    /// Returns the time at which the setpoint that the drone follows was first received.
    pub(super) fn since_s(&self) -> f64 {
        self.since_s
    }

    /// Returns the time in s since the drone last received a setpoint.
    pub(super) fn silent_s(&self, time_s: f64) -> f64 {
        time_s - self.last_s
    }

    /// Draws the next outage, after the end of the present one. Both the time until it and its
    /// duration are exponentially distributed.
    fn next_outage(&mut self) {
        // Exponential times are drawn by inverting their distribution function.
        let [after_s, lasts_s] = [self.options.outage_every_s, self.options.outage_s]
            .map(|mean_s| -mean_s * libm::log(1.0 - self.outages.uniform()));
        let from_s = self.outage[1] + after_s;
        // An outage lasts at least one round, so that the search for the next outage ends.
        self.outage = [from_s, from_s + lasts_s.max(self.round_s)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(drones: u32, loss_frac: f64, outage_every_s: f64, outage_s: f64, index: u64) -> Link {
        let options =
            RadioOptions { drones, loss_frac, outage_every_s, outage_s, ..Default::default() };
        Link::new(&options, 3, index).unwrap()
    }

    /// Returns the time without a setpoint, sampled every 10 ms.
    fn silences_s(link: &mut Link, ticks: u32) -> Vec<f64> {
        let silences_s = (0..ticks).map(|tick| {
            let time_s = f64::from(tick) * 0.01;
            link.hear(time_s, tick as usize);
            link.silent_s(time_s)
        });
        silences_s.collect()
    }

    /// Returns the fraction of times that are longer than `least_s`.
    fn longer_frac(silences_s: &[f64], least_s: f64) -> f64 {
        silences_s.iter().filter(|s| **s > least_s).count() as f64 / silences_s.len() as f64
    }

    #[test]
    fn drones_take_turns_of_the_radio() {
        let mut alone = link(1, 0.0, 0.0, 0.1, 0);
        assert!(silences_s(&mut alone, 500).iter().all(|s| *s <= 0.7e-3 + 1e-9));
        let mut eighth = link(8, 0.0, 0.0, 0.1, 7);
        assert_eq!(eighth.hear(0.02, 5), 0, "seven turns of 3.2 ms come first");
        assert_eq!(eighth.hear(0.0225, 6), 6);
        let late_s = silences_s(&mut eighth, 500).iter().skip(5).copied().fold(0.0, f64::max);
        assert!((0.02..0.0256).contains(&late_s), "{late_s} s of a round of 25.6 ms");
        assert!(Link::new(&RadioOptions::default(), 3, 0).is_none(), "commands arrive at once");
    }

    #[test]
    fn losses_and_outages_have_their_fractions_and_outages_are_common_to_all() {
        // If a fraction p of packets is lost, a fraction p² of turns is the second loss in a row.
        let lossy = longer_frac(&silences_s(&mut link(1, 0.5, 0.0, 0.1, 0), 20_000), 1.4e-3);
        assert!((lossy - 0.25).abs() < 0.02, "{lossy}");
        let [one, other] =
            [0, 1].map(|index| silences_s(&mut link(1, 0.0, 10.0, 0.5, index), 200_000));
        let out: f64 = longer_frac(&one, 0.01);
        assert!((out / (0.49 / 10.5) - 1.0).abs() < 0.2, "{out}");
        let both = one.iter().zip(&other).filter(|(a, b)| (**a > 0.02) != (**b > 0.02)).count();
        assert_eq!(both, 0, "one band");
    }
}
