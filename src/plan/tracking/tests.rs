//! Tests with flights whose errors are known.

use noctograph_core::flight::FlightData;
use std::f64::consts::TAU;

use super::constructed::{flight, square, still};
use super::*;

fn near(actual: f64, wanted: f64, within: f64, what: &str) {
    assert!((actual - wanted).abs() <= within, "{what}: {actual} instead of {wanted}");
}

#[test]
fn a_pure_delay_is_all_lag_and_no_contour_error() {
    for lag_s in [0.0, 0.137, 0.58, 1.21] {
        let tracking =
            track(&flight(0.004, 20.0, |t| square(t - lag_s), square), Part::All).unwrap();
        near(tracking.lag_s, lag_s, 2e-6, "lag");
        near(tracking.in_plane_rmse_after_lag_m(), 0.0, 2e-5, "after lag");
        near(tracking.contour.max_m, 0.0, 3e-6, "contour");
        assert!(tracking.in_plane_rmse_m() >= 0.1 * lag_s, "late is wrong at the instant");
    }
}

#[test]
fn a_pure_lead_is_a_negative_lag_and_no_contour_error() {
    // The flight follows a plan that leads its controller, and the design moves throughout.
    for lead_s in [0.02, 0.1, 0.4, 1.2] {
        let mut flown = flight(0.004, 20.0, |t| square(t + lead_s), square);
        flown.edit(|flown| {
            for sample in &mut flown.samples {
                sample.letter = (1.0..18.0).contains(&sample.time_s).then_some(0);
            }
        });
        let ahead = track(&flown, Part::Letters).unwrap();
        near(ahead.lag_s, -lead_s, 2e-6, "lead");
        near(ahead.in_plane_rmse_after_lag_m(), 0.0, 2e-5, "without it");
        near(ahead.contour.max_m, 0.0, 3e-6, "contour");
        assert!(ahead.in_plane_rmse_m() >= 0.1 * lead_s, "early is wrong at the instant");
    }
}

#[test]
fn a_constant_offset_is_no_lag() {
    let aside = Vector3::new(0.0, 0.03, -0.02);
    // The design moves only along x, so its path is 0.02 m away everywhere.
    let design = |t: f64| Vector3::new(0.2 * t, 0.0, 0.5);
    let tracking = track(&flight(0.01, 5.0, |t| design(t) + aside, design), Part::All).unwrap();
    // The search finds a lag of zero as accurately as any other lag within its range.
    near(tracking.lag_s, 0.0, 1e-6, "lag");
    near((tracking.rmse_m - aside.abs()).norm(), 0.0, 1e-12, "RMSE");
    near((tracking.mean_error_m - aside).norm(), 0.0, 1e-12, "mean");
    let ContourError { mean_m, rms_m, p95_m, max_m } = tracking.contour;
    for actual in [mean_m, rms_m, p95_m, max_m] {
        near(actual, 0.02, 1e-9, "contour");
    }
}

#[test]
fn a_lag_is_found_beside_the_path_of_a_word_that_ends_elsewhere() {
    // The design is an L, down and to the right, flown 0.2 s late, and beside and above it.
    let design =
        |t: f64| Vector3::new(0.2 * (t - 2.5).clamp(0.0, 1.5), 0.0, 1.0 - 0.2 * t.min(2.5));
    for aside in [Vector3::zeros(), Vector3::new(0.03, 0.0, 0.02), Vector3::new(-0.05, 0.0, 0.04)] {
        let flown = flight(0.004, 4.0, |t| design((t - 0.2).max(0.0)) + aside, design);
        let tracking = track(&flown, Part::All).unwrap();
        near(tracking.lag_s, 0.2, 2e-3, "lag");
    }
}

#[test]
fn a_wider_circle_flown_late_has_its_radial_error_as_contour_error() {
    fn round(radius_m: f64) -> impl Fn(f64) -> Vector3<f64> {
        move |t: f64| {
            let (sin, cos) = libm::sincos(TAU * t / 8.0);
            Vector3::new(radius_m * cos, 0.0, 1.0 + radius_m * sin)
        }
    }
    let flown = flight(0.004, 16.0, |t| round(0.31)(t - 0.3), round(0.3));
    // The letter begins at 1 s, after the drone has begun to follow its delayed design.
    let late =
        flown.samples.iter().map(|s| FlightSample { letter: (s.time_s >= 1.0).then_some(0), ..*s });
    let flown = Flight::made(FlightData { samples: late.collect(), ..FlightData::default() });
    let tracking = track(&flown, Part::Letters).unwrap();
    near(tracking.lag_s, 0.3, 1e-4, "lag");
    near(tracking.in_plane_rmse_after_lag_m(), 0.01, 1e-5, "after lag");
    near(tracking.contour.mean_m, 0.01, 1e-5, "contour");
    near(tracking.contour.max_m, 0.01, 1e-5, "contour");
}

#[test]
fn a_crossing_stroke_does_not_reduce_the_contour_error() {
    // The design moves right along z = 0.5, and later left along z = 0.55. A drone that is 0.05 m
    // too high on its way right is on the later stroke, and a drone that is 0.05 m too low on its
    // way left is on the earlier one.
    fn design(t: f64) -> Vector3<f64> {
        match t {
            t if t < 3.0 => Vector3::new(0.2 * t, 0.0, 0.5),
            t if t < 4.0 => Vector3::new(0.6, 0.0, 0.5 + 0.05 * (t - 3.0)),
            t => Vector3::new(0.6 - 0.2 * (t - 4.0), 0.0, 0.55),
        }
    }
    fn wrong(t: f64) -> Vector3<f64> {
        let up_m = if t < 3.5 { 0.05 } else { -0.05 };
        design(t) + Vector3::z() * up_m
    }
    let mut flown = flight(0.01, 7.0, wrong, design);
    flown.edit(|flown| {
        for sample in &mut flown.samples {
            let straight = sample.time_s < 2.0 || sample.time_s > 5.0;
            sample.letter = straight.then_some(0);
        }
    });
    let tracking = track(&flown, Part::Letters).unwrap();
    near(tracking.contour.mean_m, 0.05, 1e-6, "the other stroke does not count");
}

#[test]
fn p95_bounds_19_of_20_samples() {
    let design = |t: f64| Vector3::new(0.2 * t, 0.0, 0.5);
    let up = |t: f64| design(t) + Vector3::z() * if t < 0.945 { 0.001 } else { 0.1 };
    let mut flown = flight(0.01, 0.99, up, design);
    let contour = |flown: &Flight| track(flown, Part::All).unwrap().contour;
    near(contour(&flown).p95_m, 0.001, 1e-9, "95 of 100");
    flown.edit(|flown| flown.samples[94].position_m.z = 0.6);
    near(contour(&flown).p95_m, 0.1, 1e-9, "94 of 100");
    near(contour(&flown).max_m, 0.1, 1e-9, "the farthest");
}

#[test]
fn drift_observer_error_and_attitude_are_measured() {
    let design = |_| Vector3::z();
    let mut flown =
        flight(0.01, 1.99, |t| Vector3::new(0.0, if t < 1.0 { -0.1 } else { 0.3 }, 1.0), design);
    flown.edit(|flown| {
        for (k, sample) in flown.samples.iter_mut().enumerate() {
            sample.estimate_m.x += 0.004;
            sample.attitude.pitch_rad = if k % 2 == 0 { 0.1 } else { -0.3 };
        }
    });
    let tracking = track(&flown, Part::All).unwrap();
    let drift = Drift { min_y_m: -0.1, max_y_m: 0.3, in_corridor_frac: 0.5 };
    assert_eq!(tracking.drift, drift);
    near((tracking.observer_rmse_m.unwrap() - Vector3::x() * 0.004).norm(), 0.0, 1e-12, "observer");
    let AttitudeSpread { mean, sigma, max } = tracking.attitude.unwrap();
    near(mean.pitch_rad, -0.1, 1e-12, "mean");
    near(sigma.pitch_rad, 0.2, 1e-12, "sigma");
    assert_eq!((max.pitch_rad, max.yaw_rad), (0.3, 0.0));
    assert_eq!(tracking.lag_s, 0.0, "a design that does not move has no lag");
    flown.edit(|flown| flown.unlogged = [Quantity::Attitude, Quantity::Estimate].into());
    let tracking = track(&flown, Part::All).unwrap();
    assert_eq!((tracking.attitude, tracking.observer_rmse_m), (None, None), "not logged");
}

#[test]
fn a_part_holds_its_samples() {
    let mut flown = flight(0.1, 1.0, square, square);
    flown.edit(|flown| {
        for (k, sample) in flown.samples.iter_mut().enumerate() {
            sample.letter = (k > 4).then_some(0);
            sample.motors = [if (2..9).contains(&k) { 40_000.0 } else { 3_000.0 }; 4];
        }
    });
    flown.edit(|flown| flown.samples[5].motors[2] = 0.0);
    let n = |flown: &Flight, part| track(flown, part).unwrap().n_samples;
    assert_eq!(n(&flown, Part::All), 11);
    assert_eq!(n(&flown, Part::Letters), 6);
    assert_eq!(n(&flown, Part::Airborne), 7, "a motor that stops for a moment ends no flight");
    assert_eq!(Part::from_flight(&flown), Part::Letters);
    flown.edit(|flown| flown.samples.iter_mut().for_each(|s| s.letter = None));
    assert_eq!(Part::from_flight(&flown), Part::Airborne);
}

#[test]
fn a_flight_without_samples_letters_air_or_design_is_refused() {
    let refused = |flight: &Flight, part| track(flight, part).unwrap_err().to_string();
    assert!(refused(&Flight::default(), Part::All).contains("no sample"));
    let mut flown = flight(0.1, 1.0, square, still);
    assert!(refused(&flown, Part::All).contains("no design position"));
    flown.edit(|flown| {
        flown.samples.iter_mut().for_each(|s| (s.motors, s.letter) = ([9.0; 4], None))
    });
    assert!(refused(&flown, Part::Letters).contains("part of a letter"));
    assert!(refused(&flown, Part::Airborne).contains("in the air"));
    flown.edit(|flown| flown.unlogged = [Quantity::Position].into());
    assert!(refused(&flown, Part::All).contains("no position"));
}
