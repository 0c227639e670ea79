//! Radio: arrival of the commands of a plan in the firmware, and its timer.

use super::LightOptions;
use super::chance::Chance;
use noctograph_core::flight::{Flight, FlightSample};

/// A level from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Change {
    pub(super) time_s: f64,
    pub(super) level: f64,
}

/// Arrivals of the commands of a channel that differ from the one before, the first from
/// `at_first`; none where the flight has no such channel.
///
/// Each takes the delay of the radio and a share of its jitter; none overtakes the one before.
pub(super) fn arrivals(
    flight: &Flight,
    channel: &str,
    at_first: f64,
    options: &LightOptions,
    chance: &Chance,
) -> Vec<Change> {
    let Some(levels) = flight.lights.get(channel) else { return Vec::new() };
    arrivals_of(&flight.samples, levels, at_first, options, chance)
}

/// The same of the values that are sent with samples.
pub(super) fn arrivals_of(
    samples: &[FlightSample],
    levels: &[f64],
    at_first: f64,
    options: &LightOptions,
    chance: &Chance,
) -> Vec<Change> {
    let mut arrivals: Vec<Change> = Vec::new();
    let (mut commanded, mut n) = (at_first, 0);
    for (sample, &level) in samples.iter().zip(levels) {
        if level == commanded {
            continue;
        }
        commanded = level;
        let late_s = options.radio_delay_s + options.radio_jitter_s * chance.uniform(n);
        n += 1;
        let earliest_s = arrivals.last().map_or(f64::NEG_INFINITY, |last| last.time_s);
        arrivals.push(Change { time_s: (sample.time_s + late_s).max(earliest_s), level });
    }
    arrivals
}

/// A timer of the firmware.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timer {
    /// 0 for a timer that reacts at once.
    pub(super) period_s: f64,
    pub(super) phase_s: f64,
}

impl Timer {
    /// Its first tick at or after `time_s`.
    pub(super) fn next_s(self, time_s: f64) -> f64 {
        if self.period_s == 0.0 { time_s } else { self.tick_s(self.next(time_s)) }
    }

    /// The number of its first tick at or after `time_s`.
    pub(super) fn next(self, time_s: f64) -> f64 {
        // The slack keeps a command that arrives on a tick from missing it by rounding.
        ((time_s - self.phase_s) / self.period_s - 1e-9).ceil()
    }

    /// Time of a tick.
    pub(super) fn tick_s(self, number: f64) -> f64 {
        self.phase_s + number * self.period_s
    }

    /// Changes of a lamp that follows `arrivals` on this timer. Of several commands within a tick
    /// the last one counts.
    pub(super) fn hold(self, arrivals: &[Change]) -> Vec<Change> {
        let mut changes: Vec<Change> = Vec::new();
        for arrival in arrivals {
            let time_s = self.next_s(arrival.time_s);
            changes.pop_if(|last| last.time_s >= time_s);
            changes.push(Change { time_s, level: arrival.level });
        }
        changes
    }
}
