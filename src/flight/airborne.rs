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
/// lowest sample; 0.05 m is the limit for both. Flown samples less than 0.5 s apart make one
/// stretch, and the longest stretch is the flight: what was logged while the drone was carried or
/// dragged along the floor afterwards stays outside.
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
    let time_s = |index: usize| flight.samples[index].time_s;
    let mut longest: Option<Range<usize>> = None;
    let mut stretch: Option<Range<usize>> = None;
    for (index, _) in flight.samples.iter().enumerate().filter(|(_, sample)| flown(sample)) {
        let goes_on = |s: &Range<usize>| time_s(index) - time_s(s.end - 1) < LONGEST_BREAK_S;
        let start = stretch.as_ref().filter(|s| goes_on(s)).map_or(index, |s| s.start);
        let now = start..index + 1;
        let lasts_s = |s: &Range<usize>| time_s(s.end - 1) - time_s(s.start);
        if longest.as_ref().is_none_or(|s| lasts_s(&now) >= lasts_s(s)) {
            longest = Some(now.clone());
        }
        stretch = Some(now);
    }
    longest
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
    fn height_decides_where_nothing_else_is_told() {
        let mut flight = flight(|_| 0.0, |i| if (10..90).contains(&i) { 0.8 } else { 0.3 });
        assert_eq!(airborne(&flight), None, "motors off");
        flight.unlogged = [Quantity::Motors, Quantity::Design].into();
        assert_eq!(airborne(&flight), Some(10..90));
    }
}
