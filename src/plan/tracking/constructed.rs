//! Flights computed from formulas, for tests.

use nalgebra::Vector3;

use noctograph_core::flight::{Flight, FlightData, FlightSample};

/// Creates a flight whose position and design are functions of time, sampled every `step_s` from 0
/// to `end_s`, with running motors and the estimate equal to the position.
pub(crate) fn flight(
    step_s: f64,
    end_s: f64,
    position_m: impl Fn(f64) -> Vector3<f64>,
    design_m: impl Fn(f64) -> Vector3<f64>,
) -> Flight {
    #[expect(clippy::cast_possible_truncation, reason = "a few hundred")]
    let n = (end_s / step_s).round() as u32;
    let samples = (0..=n).map(|k| {
        // Division gives 0.3, whereas multiplication would give 0.30000000000000004.
        let time_s = f64::from(k) / (1.0 / step_s).round();
        FlightSample {
            time_s,
            position_m: position_m(time_s),
            estimate_m: position_m(time_s),
            design_m: design_m(time_s),
            motors: [44_000.0; 4],
            letter: Some(0),
            ..FlightSample::default()
        }
    });
    Flight::made(FlightData { samples: samples.collect(), ..FlightData::default() })
}

/// Returns the origin at all times.
pub(crate) fn still(_time_s: f64) -> Vector3<f64> {
    Vector3::zeros()
}

/// Returns the position on a square with 0.4 m sides, flown repeatedly at 0.2 m/s, 0.5 m up.
pub(crate) fn square(time_s: f64) -> Vector3<f64> {
    let side = time_s.max(0.0) / 2.0;
    let (whole, part) = (side.floor(), 0.4 * (side - side.floor()));
    let (x, z) = match whole % 4.0 {
        0.0 => (part, 0.0),
        1.0 => (0.4, part),
        2.0 => (0.4 - part, 0.4),
        _ => (0.0, 0.4 - part),
    };
    Vector3::new(x, 0.0, 0.5 + z)
}
