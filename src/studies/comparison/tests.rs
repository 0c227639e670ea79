//! Tests of the comparison with flights whose difference is known.

use super::constructed::{flight, square, still};
use super::*;

fn near(value: f64, wanted: f64, within: f64, what: &str) {
    assert!((value - wanted).abs() <= within, "{what}: {value} instead of {wanted}");
}

/// Returns a flight that waits and then flies the square 2 cm further to the right.
fn aside(wait_s: f64, step_s: f64) -> Flight {
    let design = |t: f64| square(t - wait_s);
    flight(step_s, 12.0 + wait_s, |t| design(t) + Vector3::new(0.02, 0.0, 0.0), design)
}

#[test]
fn two_clocks_and_two_rates_are_brought_together_by_the_design() {
    let (a, mut b) = (aside(1.0, 0.004), aside(2.7, 0.011));
    b.edit(|b| {
        for sample in &mut b.samples {
            sample.time_s += 523.25;
            sample.position_m += Vector3::new(0.0, 0.01, -0.03);
        }
    });
    let options = ComparisonOptions { part: Part::All, ..Default::default() };
    let comparison = compare(&a, &b, &options).unwrap();
    near(comparison.offset_s, -524.95, 2e-4, "offset");
    // Interpolation cuts corners by at most half a sample interval of B, which is 1.1 mm.
    near(comparison.rmse_m.x, 0.0, 1e-3, "x");
    near(comparison.rmse_m.y, 0.01, 1e-9, "y");
    near(comparison.mean_m.y, -0.01, 1e-9, "mean y");
    near(comparison.rmse_m.z, 0.03, 1e-3, "z");
    near(comparison.max_m, libm::hypot(0.01, 0.03), 3e-3, "farthest");
}

#[test]
fn flown_paths_set_the_clocks_if_setpoints_lead() {
    let (a, mut b) = (aside(1.0, 0.004), aside(1.0, 0.01));
    b.edit(|b| {
        for sample in &mut b.samples {
            sample.design_m = square(sample.time_s - 0.5);
            sample.time_s += 40.0;
        }
    });
    let by = |alignment| {
        let options = ComparisonOptions { alignment, ..Default::default() };
        compare(&a, &b, &options).unwrap()
    };
    near(by(Alignment::Flown).offset_s, -40.0, 2e-3, "by what was flown");
    near(by(Alignment::Flown).max_m, 0.0, 2e-3, "the same flight");
    near(by(Alignment::Design).offset_s, -39.5, 2e-3, "by the setpoints");
}

#[test]
fn equal_clocks_are_not_touched() {
    let (a, b) = (aside(1.0, 0.004), aside(1.0, 0.01));
    let comparison = compare(&a, &b, &ComparisonOptions::default()).unwrap();
    assert_eq!(comparison.offset_s, 0.0);
    near(comparison.max_m, 0.0, 1e-3, "same flight");
}

#[test]
fn gaps_are_not_interpolated() {
    let (a, mut b) = (aside(0.0, 0.01), aside(0.0, 0.01));
    let whole = compare(&a, &b, &ComparisonOptions::default()).unwrap();
    assert_eq!(whole.n_samples, 1201);
    // B lacks samples for 0.7 s, during which it jumps.
    b.edit(|b| b.samples.retain(|sample| sample.time_s <= 3.0 || sample.time_s >= 3.7));
    let options = ComparisonOptions::default();
    let gapped = compare(&a, &b, &options).unwrap();
    assert_eq!((gapped.n_samples, gapped.max_m), (1201 - 69, 0.0), "the gap is left out");
    let trusting = ComparisonOptions { max_gap_s: 1.0, ..options };
    assert_eq!(compare(&a, &b, &trusting).unwrap().n_samples, 1201, "up to the limit");
}

#[test]
fn attitude_is_compared_the_short_way_round() {
    let (mut a, mut b) = (aside(0.0, 0.01), aside(0.0, 0.02));
    a.edit(|a| a.samples.iter_mut().for_each(|sample| sample.attitude.yaw_rad = 3.1));
    b.edit(|b| {
        for (k, sample) in b.samples.iter_mut().enumerate() {
            let turn = if k % 2 == 0 { 0.0 } else { std::f64::consts::TAU };
            sample.attitude.yaw_rad = -3.1 + turn;
        }
    });
    let comparison = compare(&a, &b, &ComparisonOptions::default()).unwrap();
    let turned = comparison.attitude_rmse.unwrap();
    near(turned.yaw_rad, std::f64::consts::TAU - 6.2, 1e-9, "yaw");
    b.edit(|b| b.unlogged = [Quantity::Attitude].into());
    let comparison = compare(&a, &b, &ComparisonOptions::default()).unwrap();
    assert_eq!(comparison.attitude_rmse, None, "not logged");
}

#[test]
fn flights_of_different_words_are_refused() {
    // The flights are a 1 m sweep to the right, and the same word a quarter of a meter higher.
    fn sweep(z: f64) -> Flight {
        let sample = |i: i32| {
            let at_m = Vector3::new(f64::from(i) * 0.01, 0.0, z);
            FlightSample {
                time_s: f64::from(i) * 0.05,
                position_m: at_m,
                design_m: at_m,
                letter: Some(0),
                ..FlightSample::default()
            }
        };
        Flight::made(FlightData {
            samples: (0..100).map(sample).collect(),
            ..FlightData::default()
        })
    }
    let options = ComparisonOptions { part: Part::Letters, ..ComparisonOptions::default() };
    assert!(compare(&sweep(0.5), &sweep(0.52), &options).is_ok(), "2 cm");
    let error = compare(&sweep(0.5), &sweep(0.75), &options).unwrap_err().to_string();
    assert!(error.contains("0.25 m apart"), "{error}");
    let offset = ComparisonOptions { alignment: Alignment::Offset(0.0), ..options };
    assert!(compare(&sweep(0.5), &sweep(0.75), &offset).is_ok(), "if the clock is given");
}

#[test]
fn flights_that_cannot_be_compared_are_refused_with_their_reason() {
    fn refused(a: &Flight, b: &Flight, alignment: Alignment) -> String {
        let options = ComparisonOptions { alignment, ..Default::default() };
        compare(a, b, &options).unwrap_err().to_string()
    }
    let (a, empty) = (aside(0.0, 0.01), Flight::default());
    let undesigned = flight(0.01, 12.0, square, still);
    assert!(refused(&a, &empty, Alignment::Design).contains("flight B: found no design"));
    assert!(refused(&undesigned, &a, Alignment::Design).contains("flight A: found no design"));
    assert!(refused(&a, &empty, Alignment::Offset(0.0)).contains("no sample"));
    assert!(refused(&a, &a, Alignment::Offset(f64::NAN)).contains("offset_s"));
    let apart = refused(&a, &a, Alignment::Offset(50.0));
    assert!(apart.contains("A at 0.00 … 12.00 s, B at 50.00 … 62.00 s"), "{apart}");
    let alignment = Alignment::Offset(0.0);
    let options = ComparisonOptions { alignment, part: Part::All, ..Default::default() };
    assert!(compare(&undesigned, &a, &options).is_ok(), "only the clocks need a design");
}

/// Returns options for [`captured`], whose clock is 7 s behind.
fn seven_seconds_later() -> ComparisonOptions {
    let (part, alignment) = (Part::All, Alignment::Offset(-7.0));
    ComparisonOptions { part, alignment, ..Default::default() }
}

/// Returns the square as a motion capture system records it: only positions, rotated about the
/// vertical axis and translated.
fn captured(turn_rad: f64, shift_m: Vector3<f64>, noise_m: f64) -> Flight {
    let mut flight = aside(1.0, 0.01);
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), turn_rad);
    flight.edit(|flight| {
        for (index, sample) in flight.samples.iter_mut().enumerate() {
            sample.time_s += 7.0;
            let shake = noise_m * if index % 2 == 0 { 1.0 } else { -1.0 };
            sample.position_m = turn * (sample.position_m + Vector3::y() * shake) + shift_m;
            sample.design_m = Vector3::zeros();
        }
    });
    flight.edit(|flight| {
        flight.unlogged = [Quantity::Design, Quantity::Attitude, Quantity::Motors].into()
    });
    flight
}

#[test]
fn a_flight_in_another_frame_is_laid_onto_the_first_if_that_leaves_centimeters() {
    let (a, options) = (aside(1.0, 0.004), seven_seconds_later());
    for (turn_rad, shift_m) in [
        (0.0, Vector3::new(2.0, -1.0, 0.3)),
        (0.9, Vector3::new(0.5, 0.0, 0.0)),
        (-2.5, Vector3::new(-3.0, 2.0, 0.1)),
    ] {
        let comparison = compare(&a, &captured(turn_rad, shift_m, 0.0), &options).unwrap();
        assert!(comparison.rmse_m.norm() < 0.01, "{turn_rad}: {comparison:?}");
        let placement = comparison.placement.unwrap();
        let turned = libm::remainder(placement.turn_rad + turn_rad, std::f64::consts::TAU);
        near(turned, 0.0, 0.01, "the turn back");
    }
    let flown = ComparisonOptions { alignment: Alignment::Flown, part: Part::Airborne, ..options };
    let comparison = compare(&a, &captured(0.9, Vector3::new(0.5, 0.0, 0.0), 0.0), &flown).unwrap();
    assert!(
        comparison.rmse_m.norm() < 0.03,
        "with the clock set by what was flown: {comparison:?}"
    );
}

#[test]
fn one_frame_is_not_moved_and_two_that_no_transform_joins_are_refused() {
    let (a, options) = (aside(1.0, 0.004), seven_seconds_later());
    let near_by = compare(&a, &captured(0.0, Vector3::new(0.05, 0.0, 0.0), 0.0), &options).unwrap();
    assert_eq!(near_by.placement, None);
    near(near_by.mean_m.x, -0.05, 1e-3, "an error of centimeters is an error");
    let wild = captured(0.9, Vector3::new(2.0, 0.0, 0.0), 0.1);
    let error = compare(&a, &wild, &options).unwrap_err().to_string();
    assert!(error.contains("after the best rotation and shift"), "{error}");
    // Setpoints define the frame, so a flight elsewhere is an actual displacement.
    let mut elsewhere = aside(1.0, 0.01);
    elsewhere.edit(|elsewhere| {
        elsewhere.samples.iter_mut().for_each(|sample| sample.position_m.x += 1.0)
    });
    let comparison =
        compare(&a, &elsewhere, &ComparisonOptions { part: Part::All, ..Default::default() });
    assert_eq!(comparison.unwrap().placement, None);
}
