//! Firmware's outlier filter for differences of ultra-wideband ranges.
//!
//! The input is the error of a range difference and its standard deviation. The output is true if
//! the Kalman filter uses the difference. The elapsed time is added to an integrator at a good
//! difference (within 2 σ), and subtracted at any other. When the integrator is nearly full, the
//! filter closes and rejects differences beyond 2.5 σ, until the integrator is nearly empty.
//!
//! The source is `outlierFilterTdoa.c`, firmware 2026.08.

/// Size of the integrator, and the levels at which the filter opens and closes, in ms.
const SIZE_MS: f64 = 300.0;
const OPENS_MS: f64 = 0.1 * SIZE_MS;
const CLOSES_MS: f64 = 0.9 * SIZE_MS;
/// Maximum change of the integrator by one difference, in ms.
const LONGEST_MS: f64 = 0.1 * SIZE_MS;
/// Maximum errors, in standard deviations, of good differences and of those a closed filter
/// accepts.
const GOOD_SIGMAS: f64 = 2.0;
const ACCEPTED_SIGMAS: f64 = 2.5;

/// Outlier filter, which is open initially.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TdoaFilter {
    integrator_ms: f64,
    closed: bool,
    /// Time since the last difference in ms.
    since_ms: f64,
}

impl TdoaFilter {
    /// Advances the filter's clock by a time in s.
    pub(super) fn wait(&mut self, time_s: f64) {
        self.since_ms += 1e3 * time_s;
    }

    /// Returns true if a difference with this error is used. `sigma_m` is the standard deviation of
    /// the measurement. Each call also fills the integrator by the time since the last call if the
    /// error is good, and drains it if not.
    pub(super) fn accepts(&mut self, error_m: f64, sigma_m: f64) -> bool {
        let passed_ms = std::mem::take(&mut self.since_ms).min(LONGEST_MS);
        let is_good = error_m.abs() < GOOD_SIGMAS * sigma_m;
        let added_ms = if is_good { passed_ms } else { -passed_ms };
        self.integrator_ms = (self.integrator_ms + added_ms).clamp(0.0, SIZE_MS);
        let is_accepted = !self.closed || error_m.abs() < ACCEPTED_SIGMAS * sigma_m;
        // The filter has hysteresis, because its opening level is below its closing level.
        self.closed = if self.closed {
            self.integrator_ms >= OPENS_MS
        } else {
            self.integrator_ms > CLOSES_MS
        };
        is_accepted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_closes_after_good_differences_and_opens_after_bad_ones() {
        let mut filter = TdoaFilter::default();
        let mut accepts = |error_m: f64| {
            filter.wait(0.01);
            filter.accepts(error_m, 0.15)
        };
        assert!(accepts(5.0), "open at first");
        let closes = (0..60).position(|_| {
            accepts(0.0);
            !accepts(5.0) || !accepts(5.0)
        });
        assert_eq!(closes, None, "as many bad ones as good ones keep it open");
        (0..28).for_each(|_| assert!(accepts(0.29)));
        assert!(accepts(0.37) && !accepts(0.38), "closed: 2.5 standard deviations");
        let opens = (0..60).position(|_| accepts(5.0));
        assert!((20..30).contains(&opens.unwrap()), "open again: {opens:?}");
    }
}
