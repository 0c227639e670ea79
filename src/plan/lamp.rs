//! Delays between a light command and the response of a lamp.

/// Tolerance in s for rounding on the time grid of setpoints.
const GRID_S: f64 = 1e-5;

/// Delays between a light command and the change of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampTiming {
    /// Mean time in s from sending to arrival.
    pub delay_s: f64,
    /// Period in s of the timer whose next tick changes the light, or 0 for a lamp without a timer.
    pub tick_s: f64,
}

impl LampTiming {
    /// Returns the time in s of the lamp's tick nearest to a time, and the tick's number. The tick
    /// is not before `last_tick`, that of the last change. A lamp without a timer can change
    /// whenever a command can arrive, and its tick is the time itself.
    pub(super) fn tick(&self, time_s: f64, last_tick: f64) -> (f64, f64) {
        if self.tick_s == 0.0 {
            return (time_s.max(self.delay_s), time_s);
        }
        // No command can be sent before the flight begins.
        let first = (self.delay_s / self.tick_s + 0.5).ceil();
        let nearest = (time_s / self.tick_s).round();
        let tick = nearest.max(first).max(last_tick);
        (tick * self.tick_s, tick)
    }

    /// Returns the time at which to send a command whose light changes at a tick. The command
    /// arrives half a tick before that tick.
    pub(super) fn sent_s(&self, light_s: f64) -> f64 {
        (light_s - 0.5 * self.tick_s - self.delay_s).max(0.0)
    }

    /// Returns the time in s at which a command sent at `sent_s` changes the light, which is the
    /// next tick after the command arrives.
    pub(super) fn light_s(&self, sent_s: f64) -> f64 {
        let arrives_s = sent_s + self.delay_s;
        if self.tick_s == 0.0 {
            return arrives_s;
        }
        ((arrives_s - GRID_S) / self.tick_s).ceil() * self.tick_s
    }
}
