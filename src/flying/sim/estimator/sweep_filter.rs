//! The firmware's outlier filter of Lighthouse sweeps.
//!
//! In: the error of a sweep at the deck, m: that of its angle times the distance from the rotor's
//! axis. Out: whether the Kalman filter takes it in. A sweep off by less than 0.2 m is good, and
//! closes the filter for 100 ms, in which none but good ones are taken; without a good one for so
//! long all are, so that an estimate that strayed finds back, to a reflection if that is all it sees.
//!
//! Source: bitcraze/crazyflie-firmware, `outlierFilterLighthouse.c` (commit 8c973af, lines 35, 36 and
//! 44 to 64), called by `mm_sweep_angles.c`. Before it (commit 9efb0eb, lines 34 to 39 and 47 to 76) the
//! bound was 0.05 m, and the time grew with good sweeps and shrank with bad ones.

/// Least error of a bad sweep (`lhMaxError`).
const BAD_M: f64 = 0.2;
/// Time for which a good sweep closes the filter (`lhValidityTimeMs`).
const CLOSED_S: f64 = 0.1;

/// Open at first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SweepFilter {
    /// Time until it opens.
    closed_s: f64,
}

impl SweepFilter {
    /// Lets a time pass.
    pub(super) fn wait(&mut self, time_s: f64) {
        self.closed_s -= time_s;
    }

    /// Whether a sweep is taken in.
    pub(super) fn takes(&mut self, error_m: f64) -> bool {
        let is_good = error_m.abs() < BAD_M;
        if is_good {
            self.closed_s = CLOSED_S;
        }
        is_good || self.closed_s <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_sweeps_are_taken_when_no_good_one_came_for_a_tenth_of_a_second() {
        let mut filter = SweepFilter::default();
        assert!(filter.takes(3.0), "open at first");
        assert!(filter.takes(-0.199) && !filter.takes(-0.2), "closed by a good one");
        filter.wait(0.098);
        assert!(!filter.takes(0.3), "a bad one neither opens nor closes");
        filter.wait(0.004);
        assert!(filter.takes(0.3) && filter.takes(0.3), "open until the next good one");
        assert!(filter.takes(0.1) && !filter.takes(0.3));
    }
}
