//! Firmware's outlier filter for Lighthouse sweeps.
//!
//! The input is the error of a sweep at the deck in m, that is, the error of its angle times the
//! distance from the rotor's axis. The output is true if the Kalman filter uses the sweep. Each
//! sweep closes the filter for a time that increases by 4 ms with every good sweep, up to 40 ms,
//! and decreases by 8 ms with every bad sweep. While the filter is closed, only good sweeps are
//! used. A wrong estimate therefore follows the sweeps again after about five bad sweeps, but may
//! also follow a reflection.
//!
//! The source is `outlierFilterLighthouse.c`, the same in every release of the firmware from
//! 2023.11 to 2026.08, called by `mm_sweep_angles.c`.

/// Minimum error of a bad sweep in m (`lhMaxError`).
const BAD_M: f64 = 0.05;
/// Bounds in ms of the time for which a sweep closes the filter. If negative, the filter stays
/// open.
const WINDOW_MS: [f64; 2] = [-16.0, 40.0];
/// Changes of the closing time in ms after a good and after a bad sweep.
const GOOD_MS: f64 = 4.0;
const BAD_MS: f64 = -8.0;
/// Tolerance in ms for comparisons of times.
const TOLERANCE_MS: f64 = 1e-6;

/// Outlier filter, which is open initially.
#[derive(Clone, Copy, Debug)]
pub(super) struct SweepFilter {
    window_ms: f64,
    /// Time in ms until the filter opens.
    closed_ms: f64,
}

impl Default for SweepFilter {
    fn default() -> Self {
        Self { window_ms: WINDOW_MS[0], closed_ms: 0.0 }
    }
}

impl SweepFilter {
    /// Advances the filter's clock by a time in s.
    pub(super) fn wait(&mut self, time_s: f64) {
        self.closed_ms -= 1e3 * time_s;
    }

    /// Returns true if a sweep with this error is used. Each call also widens the window after a
    /// good sweep or narrows it after a bad one, and the filter stays closed for the length of that
    /// window.
    pub(super) fn accepts(&mut self, error_m: f64) -> bool {
        let is_good = error_m.abs() < BAD_M;
        let change_ms = if is_good { GOOD_MS } else { BAD_MS };
        let [least_ms, most_ms] = WINDOW_MS;
        self.window_ms = (self.window_ms + change_ms).clamp(least_ms, most_ms);
        let is_closed = self.closed_ms > TOLERANCE_MS;
        self.closed_ms = self.window_ms;
        is_good || !is_closed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decisions_are_those_of_the_firmwares_own_code() {
        let recorded = include_str!("recorded/outliers.txt");
        let row = recorded.lines().find(|line| !line.starts_with('#')).unwrap();
        let (mut filter, mut number) = (SweepFilter::default(), 1_u32);
        for (k, want) in row.chars().enumerate() {
            number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let dice = number >> 24;
            let passed_ms = if dice.is_multiple_of(7) { 40 } else { dice % 3 };
            filter.wait(1e-3 * f64::from(passed_ms));
            let bad = dice < if k / 50 % 2 == 1 { 160 } else { 40 };
            let error_m = if bad { 0.6 } else { 0.002 * f64::from(dice % 20) };
            assert_eq!(filter.accepts(error_m), want == '1', "sweep {k}");
        }
    }

    #[test]
    fn good_sweeps_close_it_and_bad_ones_open_it_again() {
        let mut filter = SweepFilter::default();
        assert!(filter.accepts(3.0), "open at first");
        (0..20).for_each(|_| assert!(filter.accepts(0.049)));
        assert_eq!(
            [0; 7].map(|_| filter.accepts(0.05)),
            [false, false, false, false, false, true, true]
        );
        (0..20).for_each(|_| assert!(filter.accepts(0.0)));
        filter.wait(0.0398);
        assert!(!filter.accepts(-0.3), "closed for 40 ms");
        filter.wait(0.032);
        assert!(filter.accepts(-0.3), "and for 32 ms after a bad one");
    }
}
