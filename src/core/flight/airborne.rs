//! Detection of a flight between take-off and landing, from its motors, setpoints or heights.

use std::ops::Range;

use super::{Flight, FlightSample, Quantity};

/// Motor command, out of 65535, above which a drone counts as flying. A Crazyflie hovers at about
/// 43,000 (reference flight) and idles below 10,000. A lower limit would include the spin-up on the
/// floor, and a higher one would cut off fast descents.
const FLYING_MOTOR_COMMAND: f64 = 20_000.0;

/// Minimum height above the floor in m of a flying drone, or its setpoint, in logs without motors.
const FLYING_HEIGHT_M: f64 = 0.05;

/// Duration in s of a break that ends a flight. This is longer than the few control periods for
/// which a saturated mixer stops a motor.
const LONGEST_BREAK_S: f64 = 0.5;

/// Returns the samples between take-off and landing, or `None` if the drone never leaves the floor.
///
/// A sample counts as flight if every motor command exceeds 20,000 of 65535. In a log without motor
/// commands, the height of the setpoint decides, and without setpoints, the height above the lowest
/// sample. Both heights must exceed 0.05 m. A stretch of flight ends after half a second of other
/// samples, but not at a gap in the log. The longest stretch is the flight, so that carrying the
/// drone by hand afterward does not count.
pub fn airborne(flight: &Flight) -> Option<Range<usize>> {
    let heights_m = flight.samples.iter().map(|sample| sample.position_m.z);
    let floor_m = heights_m.fold(f64::INFINITY, f64::min);
    // The loop tracks the longest stretch so far and the current one.
    let (mut longest, mut longest_s) = (0..0, 0.0);
    let (mut stretch, mut break_s) = (0..0, None);
    for (index, sample) in flight.samples.iter().enumerate() {
        let is_flown = if flight.has(Quantity::Motors) {
            sample.motors.iter().all(|command| *command > FLYING_MOTOR_COMMAND)
        } else if flight.has(Quantity::Design) {
            sample.design_m.z > FLYING_HEIGHT_M
        } else {
            sample.position_m.z - floor_m > FLYING_HEIGHT_M
        };
        if !is_flown {
            // A long break ends the current stretch.
            let since_s = *break_s.get_or_insert(sample.time_s);
            if sample.time_s - since_s >= LONGEST_BREAK_S {
                stretch = 0..0;
            }
            continue;
        }
        break_s = None;
        let first = if stretch.is_empty() { index } else { stretch.start };
        stretch = first..index + 1;
        let lasts_s = sample.time_s - flight.samples[first].time_s;
        if lasts_s >= longest_s {
            (longest, longest_s) = (stretch.clone(), lasts_s);
        }
    }
    (!longest.is_empty()).then_some(longest)
}

impl FlightSample {
    /// True if a motor is at either end of its range while at least one motor turns. `motor_max` is
    /// the maximum command.
    pub fn is_saturated(&self, motor_max: f64) -> bool {
        let turns = self.motors.iter().any(|motor| *motor > 0.0);
        turns && self.motors.iter().any(|motor| *motor <= 0.0 || *motor >= motor_max)
    }
}

/// Returns the time in s during which a motor is at either end of its range, up to the command
/// `motor_max`. The state of a sample lasts until the next one.
pub fn saturated_s(samples: &[FlightSample], motor_max: f64) -> f64 {
    let pairs = samples.windows(2).filter(|pair| pair[0].is_saturated(motor_max));
    pairs.fold(0.0, |sum_s, pair| sum_s + pair[1].time_s - pair[0].time_s)
}

/// True if a drone's height changes by less than 0.05 m and stays within 0.1 m of the floor's
/// height, regardless of the motors. Without samples, the result is false.
pub fn rests_on_floor(samples: &[FlightSample], floor_m: f64) -> bool {
    let heights_m = samples.iter().map(|sample| sample.position_m.z);
    let [low_m, high_m] = heights_m
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
    high_m - low_m < FLYING_HEIGHT_M && (high_m - floor_m).abs() < 2.0 * FLYING_HEIGHT_M
}

/// Returns the reason why a drone counts as staying on the floor, with the deciding value. Returns
/// `None` if the drone flies, or if neither motors, setpoints nor heights are logged.
pub fn on_floor(flight: &Flight) -> Option<String> {
    if airborne(flight).is_some() {
        return None;
    }
    // The evidence and its order are the same as in `airborne`.
    let maximum = |value: fn(&FlightSample) -> f64| {
        flight.samples.iter().map(value).fold(f64::NEG_INFINITY, f64::max)
    };
    Some(if flight.samples.is_empty() {
        "no sample".to_owned()
    } else if flight.has(Quantity::Motors) {
        let weakest = |s: &FlightSample| s.motors.into_iter().fold(f64::INFINITY, f64::min);
        format!(
            "the weakest motor's command reaches {:.0} of 65535 (more than {FLYING_MOTOR_COMMAND} in flight)",
            maximum(weakest)
        )
    } else if flight.has(Quantity::Design) {
        format!(
            "setpoints reach {:.2} m (more than {FLYING_HEIGHT_M} m in flight)",
            maximum(|s| s.design_m.z)
        )
    } else if !flight.has(Quantity::Position) {
        return None;
    } else {
        let climb_m = maximum(|s| s.position_m.z) + maximum(|s| -s.position_m.z);
        format!("the height changes by {climb_m:.2} m (more than {FLYING_HEIGHT_M} m in flight)")
    })
}

#[cfg(test)]
mod tests {
    use super::super::FlightData;
    use super::*;
    use nalgebra::Vector3;

    fn flight(command: impl Fn(usize) -> f64, height_m: impl Fn(usize) -> f64) -> Flight {
        let sample = |i: usize| FlightSample {
            time_s: i as f64 * 0.1,
            position_m: Vector3::z() * height_m(i),
            motors: [command(i); 4],
            ..FlightSample::default()
        };
        let samples = (0..100).map(sample).collect();
        Flight::made(FlightData { samples, ..FlightData::default() })
    }

    #[test]
    fn short_breaks_belong_to_the_flight_and_later_twitches_do_not() {
        let on = |i: usize| (20..60).contains(&i) && !(30..33).contains(&i) || i > 95;
        let flight = flight(|i| if on(i) { 40_000.0 } else { 3_000.0 }, |_| 0.0);
        assert_eq!(airborne(&flight), Some(20..60));
    }

    #[test]
    fn a_gap_in_the_log_is_no_landing() {
        let mut flight = flight(|i| if (20..60).contains(&i) { 40_000.0 } else { 0.0 }, |_| 0.0);
        flight.edit(|data| {
            data.samples.drain(30..45);
            data.gaps = vec![[2.9, 4.5]];
        });
        assert_eq!(airborne(&flight), Some(20..45));
    }

    #[test]
    fn height_decides_where_nothing_else_is_logged() {
        let mut flight = flight(|_| 0.0, |i| if (10..90).contains(&i) { 0.8 } else { 0.3 });
        assert_eq!(airborne(&flight), None, "motors off");
        assert!(on_floor(&flight).unwrap().contains("command reaches 0 of 65535"));
        flight.edit(|data| data.unlogged = [Quantity::Motors, Quantity::Design].into());
        assert_eq!(airborne(&flight), Some(10..90));
        assert_eq!(on_floor(&flight), None);
    }
}
