//! Radio: the times at which the commands of a plan reach the firmware, and the firmware's timer.
//! This file also contains the lamps' random numbers: named streams from one seed, addressed by
//! index.

use super::LightOptions;
use noctograph_core::flight::FlightSample;
use noctograph_core::random::{GOLDEN, poisson, split_mix};

/// A change of a lamp to a level at `time_s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Change {
    pub(super) time_s: f64,
    pub(super) level: f64,
}

/// A stream of random numbers. The numbers depend only on the seed, the drone, the name and their
/// index, so that an additional lamp or drone does not change the light of the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chance {
    key: u64,
}

impl Chance {
    /// Returns the stream with the given name for a drone.
    pub(super) fn new(seed: u64, drone: u64, name: &str) -> Self {
        let name = name.bytes().fold(0, |hash, byte| split_mix(hash ^ u64::from(byte)));
        Self { key: split_mix(split_mix(split_mix(seed) ^ drone) ^ name) }
    }

    /// Returns a number that is uniformly distributed in `[0, 1)`.
    pub(super) fn uniform(&self, index: u64) -> f64 {
        // Divides the upper 53 bits by 2^53.
        let bits = (split_mix(self.key.wrapping_add(index.wrapping_mul(GOLDEN))) >> 11) as f64;
        bits / 9_007_199_254_740_992.0
    }

    /// Returns a Poisson-distributed number with the given mean.
    pub(super) fn poisson(&self, index: u64, mean: f64) -> u32 {
        poisson(mean, self.uniform(index))
    }
}

/// Returns the times at which commands arrive, in order. A command is sent at each sample whose
/// level differs from that of the previous sample, which is `initial_level` for the first sample.
/// The command arrives after the radio's delay and a random jitter.
pub(super) fn arrivals(
    samples: &[FlightSample],
    levels: &[f64],
    initial_level: f64,
    options: &LightOptions,
    chance: &Chance,
) -> Vec<Change> {
    let mut arrivals: Vec<Change> = Vec::new();
    let (mut commanded, mut n) = (initial_level, 0);
    for (sample, &level) in samples.iter().zip(levels) {
        if level == commanded {
            continue;
        }
        commanded = level;
        let delay_s = options.radio_delay_s + options.radio_jitter_s * chance.uniform(n);
        n += 1;
        // A command never overtakes another one.
        let earliest_s = arrivals.last().map_or(f64::NEG_INFINITY, |last| last.time_s);
        arrivals.push(Change { time_s: (sample.time_s + delay_s).max(earliest_s), level });
    }
    arrivals
}

/// Tolerance for the time of a tick, in periods.
const TICK_TOLERANCE: f64 = 1e-9;

/// A timer of the firmware.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timer {
    /// Period of the timer, or 0 for a timer that reacts immediately.
    pub(super) period_s: f64,
    pub(super) phase_s: f64,
}

impl Timer {
    /// Returns the number of the first tick at or after `time_s`. For a period of 0 the number is
    /// not finite.
    pub(super) fn next(self, time_s: f64) -> f64 {
        // The tolerance keeps a command that arrives on a tick from missing that tick.
        ((time_s - self.phase_s) / self.period_s - TICK_TOLERANCE).ceil()
    }

    /// Returns the time in s of the tick with a given number.
    pub(super) fn tick_s(self, number: f64) -> f64 {
        self.phase_s + number * self.period_s
    }

    /// Returns the changes of a lamp that obeys commands at the next tick. If several commands
    /// arrive before the same tick, the last one is used.
    pub(super) fn hold(self, arrivals: &[Change]) -> Vec<Change> {
        let mut changes: Vec<Change> = Vec::new();
        for arrival in arrivals {
            // Without a period, the lamp obeys a command when it arrives.
            let tick_s = self.tick_s(self.next(arrival.time_s));
            let time_s = if self.period_s == 0.0 { arrival.time_s } else { tick_s };
            changes.pop_if(|last| last.time_s >= time_s);
            changes.push(Change { time_s, level: arrival.level });
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_seed_drone_and_name() {
        let first = |seed, drone, name| Chance::new(seed, drone, name).uniform(0);
        let all = [first(0, 0, "a"), first(1, 0, "a"), first(0, 1, "a"), first(0, 0, "b")];
        for (i, a) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|b| a != b), "{all:?}");
        }
    }

    #[test]
    fn uniform_and_poisson_have_their_means_and_variances() {
        let chance = Chance::new(3, 0, "test");
        let n = 20_000;
        let mean = (0..n).map(|i| chance.uniform(i)).sum::<f64>() / 20_000.0;
        // The mean of the numbers has a standard deviation of 0.2887 / √20000 = 0.002.
        assert!((mean - 0.5).abs() < 0.008, "uniform mean {mean}");
        for wanted in [0.5, 20.0] {
            let counts: Vec<f64> = (0..n).map(|i| chance.poisson(i, wanted).into()).collect();
            let mean = counts.iter().sum::<f64>() / 20_000.0;
            let variance = counts.iter().map(|c| (c - mean) * (c - mean)).sum::<f64>() / 20_000.0;
            let sigma = libm::sqrt(wanted / 20_000.0);
            assert!((mean - wanted).abs() < 4.0 * sigma, "Poisson mean {mean} for {wanted}");
            assert!((variance / wanted - 1.0).abs() < 0.06, "variance {variance} for {wanted}");
        }
    }
}
