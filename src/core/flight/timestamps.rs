//! Detection of the unit of timestamps from their steps, for a log that does not state the unit.

use crate::statistics::median;

/// Period in s of the firmware's slowest log block, which is stored in one byte in units of 10 ms.
pub const SLOWEST_PERIOD_S: f64 = 2.55;

/// Shortest step in s of any log.
const FASTEST_PERIOD_S: f64 = 0.9e-4;
/// Shortest usual step in s. The firmware logs over the radio at 100 Hz at most.
const USUAL_PERIOD_S: f64 = 9.5e-3;

/// Minimum duration in s of a flight. A 1 Hz log whose timestamps are mistaken for milliseconds
/// would be shorter than this.
const SHORTEST_FLIGHT_S: f64 = 0.5;

/// Ranges of present-day dates as day numbers of spreadsheets, MATLAB and the Julian calendar
/// count.
const DAY_NUMBERS: [std::ops::Range<f64>; 3] = [3e4..8e4, 7e5..8e5, 2.4e6..2.5e6];

/// Detected unit of timestamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundUnit {
    /// Unit in s.
    pub unit_s: f64,
    /// Median step between timestamps, in that unit.
    pub step: f64,
    /// True if another unit is also plausible.
    pub in_doubt: bool,
}

/// Guesses the unit of timestamps from the step between them. A Crazyflie log has a period from 0.1
/// ms to 2.55 s. A larger step is assumed to be in ms, in µs if it is at least 1000, or in ns if it
/// is at least a million. A smaller step is assumed to be in the first of minutes, hours and days
/// that makes it a usual step, or in days if the timestamps are present-day dates. Whole-number
/// steps of 1 or 2 are assumed to be in ms. A step of 1 is nevertheless assumed to be in seconds if
/// several rows have the same timestamp, or if the log in ms would be shorter than a flight. Any
/// other step is assumed to be in seconds.
pub fn unit_of(timestamps: &[f64]) -> FoundUnit {
    // The unit follows from the median step and the limits of logs and flights.
    let steps = timestamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let step = median(steps).unwrap_or(0.0);
    let are_whole = timestamps.iter().filter(|t| t.is_finite()).all(|t| t.fract() == 0.0);
    let is_rising = timestamps.windows(2).all(|pair| pair[1] > pair[0]);
    let is_flight_in_ms =
        timestamps.last().is_some_and(|last| last - timestamps[0] > 1e3 * SHORTEST_FLIGHT_S);
    let unit_s = match step {
        // A step above the slowest period in ns fits no unit, so seconds are assumed.
        step if step > 1e9 * SLOWEST_PERIOD_S => 1.0,
        step if step >= 1e6 => 1e-9,
        step if step >= 1e3 => 1e-6,
        step if step > SLOWEST_PERIOD_S => 1e-3,
        step if step > 0.0 && step < FASTEST_PERIOD_S => {
            let is_day = DAY_NUMBERS.iter().any(|days| days.contains(&timestamps[0]));
            let mut units = [60.0, 3600.0, 86_400.0].into_iter().skip(if is_day { 2 } else { 0 });
            let usual = USUAL_PERIOD_S..=SLOWEST_PERIOD_S;
            units.find(|unit_s| usual.contains(&(step * unit_s))).unwrap_or(1.0)
        }
        step if are_whole && step > 0.0 && (step > 1.0 || is_rising && is_flight_in_ms) => 1e-3,
        _ => 1.0,
    };
    // The step is rounded so that messages are short.
    let per_unit = if step < 1e-3 { 1e10 } else { 1e6 };
    let step = (step * per_unit).round() / per_unit;
    // Steps of 0.5 s to 2.55 s are those of a slow log in seconds or of a fast one in ms.
    let in_doubt = unit_s == 1.0 && step > 0.5 && (!are_whole || is_rising && !is_flight_in_ms);
    FoundUnit { unit_s, step, in_doubt }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_s(from: f64, step: f64) -> f64 {
        unit_of(&(0..600).map(|i| from + f64::from(i) * step).collect::<Vec<_>>()).unit_s
    }

    #[test]
    fn a_step_that_no_crazyflie_logs_is_no_step() {
        let cases =
            [(0.02, 1.0), (2.5, 1.0), (3.3, 1e-3), (20.512, 1e-3), (1.0, 1e-3), (100.0, 1e-3)];
        for (step, wanted) in cases {
            assert_eq!(unit_s(0.25 * f64::from(u8::from(step != 1.0)), step), wanted, "{step}");
        }
        for (step, wanted) in
            [(5000.0, 1e-6), (3333.3, 1e-6), (4e6, 1e-9), (1e7, 1e-9), (1e10, 1.0)]
        {
            assert_eq!(unit_s(1.7e9, step), wanted, "{step}");
        }
        for (step, wanted) in
            [(0.1 / 86_400.0, 86_400.0), (0.05 / 3600.0, 3600.0), (0.01 / 86_400.0, 86_400.0)]
        {
            assert_eq!(unit_s(0.25, step), wanted, "{step}");
        }
        assert_eq!(unit_s(46_023.5, 1.0 / 86_400.0), 86_400.0, "no hours, 1 Hz");
        assert_eq!(unit_s(0.25, 1e-4), 1.0, "10 kHz");
        let hertz = unit_of(&[7.0, 8.0, 9.0, 10.0]);
        assert!(hertz.unit_s == 1.0 && hertz.in_doubt, "1 Hz: no flight of 3 ms");
        assert!(unit_of(&[0.25, 1.5, 2.75]).in_doubt, "seconds of a slow log, or ms of a fast one");
    }
}
