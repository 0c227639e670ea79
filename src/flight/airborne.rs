//! The part of a flight that is flown, told from what the flight itself says.

use std::ops::Range;

use super::{Flight, FlightSample, Quantity};

/// Every motor command of a flying Crazyflie stands above this, of 65535: it hovers at about
/// 43,000 (reference flight) and idles below 10,000. Too low a limit counts the spinning up on the
/// floor, too high a one cuts fast descents.
pub const FLYING_MOTOR_COMMAND: f64 = 20_000.0;

/// A setpoint or a position higher than this above the floor means flight where motor commands
/// are not logged.
const FLYING_HEIGHT_M: f64 = 0.05;

/// Shorter breaks do not end a flight: a mixer that saturates takes one motor down for some
/// periods of its loop.
const LONGEST_BREAK_S: f64 = 0.5;

/// The samples between take-off and landing; `None` where the drone never leaves the floor.
///
/// A sample counts as flown where every motor command is above [`FLYING_MOTOR_COMMAND`]. Where
/// motors are not logged, the setpoint's height decides; without setpoints, the height above the
/// lowest sample; 0.05 m is the limit for both. Half a second of other samples ends a stretch (a
/// hole in the log does not), and the longest stretch is the flight: what was logged while the
/// drone was carried or dragged along the floor afterwards stays outside.
#[must_use]
pub fn airborne(flight: &Flight) -> Option<Range<usize>> {
    let told = |quantity| !flight.unlogged.contains(&quantity);
    let heights_m = flight.samples.iter().map(|sample| sample.position_m.z);
    let floor_m = heights_m.fold(f64::INFINITY, f64::min);
    let flown = |sample: &FlightSample| {
        if told(Quantity::Motors) {
            sample.motors.iter().all(|command| *command > FLYING_MOTOR_COMMAND)
        } else if told(Quantity::Design) {
            sample.design_m.z > FLYING_HEIGHT_M
        } else {
            sample.position_m.z - floor_m > FLYING_HEIGHT_M
        }
    };
    let mut longest = Stretch::default();
    let (mut stretch, mut landed_s) = (Stretch::default(), None);
    for (index, sample) in flight.samples.iter().enumerate() {
        if !flown(sample) {
            let since_s = *landed_s.get_or_insert(sample.time_s);
            if sample.time_s - since_s >= LONGEST_BREAK_S {
                stretch = Stretch::default();
            }
            continue;
        }
        landed_s = None;
        if stretch.samples.is_empty() {
            stretch = Stretch { samples: index..index, start_s: sample.time_s, lasts_s: 0.0 };
        }
        stretch.samples.end = index + 1;
        stretch.lasts_s = sample.time_s - stretch.start_s;
        if stretch.lasts_s >= longest.lasts_s {
            longest = stretch.clone();
        }
    }
    (!longest.samples.is_empty()).then_some(longest.samples)
}

/// Samples from the first to the last flown one.
#[derive(Clone, Debug, Default)]
struct Stretch {
    samples: Range<usize>,
    start_s: f64,
    lasts_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;
    use nalgebra::Vector3;

    fn flight(command: impl Fn(usize) -> f64, height_m: impl Fn(usize) -> f64) -> Flight {
        let sample = |i: usize| FlightSample {
            time_s: i as f64 * 0.1,
            position_m: Vector3::new(0.0, 0.0, height_m(i)),
            attitude: Attitude::default(),
            velocity_body_m_s: Vector3::zeros(),
            rate_body_rad_s: Vector3::zeros(),
            estimate_m: Vector3::zeros(),
            design_m: Vector3::zeros(),
            motors: [command(i); 4],
            letter: None,
        };
        Flight { samples: (0..100).map(sample).collect(), ..Flight::default() }
    }

    #[test]
    fn short_breaks_belong_to_the_flight_and_later_twitches_do_not() {
        let on = |i: usize| (20..60).contains(&i) && !(30..33).contains(&i) || i > 95;
        let flight = flight(|i| if on(i) { 40_000.0 } else { 3_000.0 }, |_| 0.0);
        assert_eq!(airborne(&flight), Some(20..60));
    }

    #[test]
    fn a_hole_in_the_log_is_no_landing() {
        let mut flight = flight(|i| if (20..60).contains(&i) { 40_000.0 } else { 0.0 }, |_| 0.0);
        flight.samples.drain(30..45);
        flight.gaps = vec![[2.9, 4.5]];
        assert_eq!(airborne(&flight), Some(20..45));
    }

    #[test]
    fn height_decides_where_nothing_else_is_told() {
        let mut flight = flight(|_| 0.0, |i| if (10..90).contains(&i) { 0.8 } else { 0.3 });
        assert_eq!(airborne(&flight), None, "motors off");
        flight.unlogged = [Quantity::Motors, Quantity::Design].into();
        assert_eq!(airborne(&flight), Some(10..90));
    }
}
