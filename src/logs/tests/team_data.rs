//! Compares the team's log of NOOR with the published figures. The log has no license and is
//! therefore not in the repository. `NOCTOGRAPH_SHARED` names the folder that contains `data/`.

use std::path::Path;

use super::imported;
use noctograph_core::flight::FlightSample;
use noctograph_core::statistics::median;
use noctograph_plan::tracking::{Part, track};

fn noor() -> Vec<u8> {
    let shared = std::env::var_os("NOCTOGRAPH_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"), Into::into);
    std::fs::read(shared.join("data/ae483/noor_flight.json")).unwrap()
}

#[test]
#[ignore = "needs ../shared/data"]
fn the_teams_flight_gives_the_figures_known_of_it() {
    let flight = imported(&noor());
    let tracking = track(&flight, Part::Airborne).unwrap();
    let (rmse_m, mean_m) = (tracking.rmse_m, tracking.mean_error_m);
    let mean = tracking.attitude.unwrap().mean;
    // The team interpolated setpoints and gaps. Here setpoints are held and gaps omitted, which
    // reduces the figures by up to 6 mm.
    for (actual, wanted, tolerance) in [
        (rmse_m.x, 0.099, 0.007),
        (rmse_m.y, 0.046, 0.003),
        (rmse_m.z, 0.064, 0.007),
        (mean_m.x, -0.063, 0.005),
        (mean_m.y, 0.033, 0.003),
        (mean_m.z, -0.004, 0.006),
        (mean.pitch_rad, -0.001, 0.002),
        (mean.roll_rad, 0.002, 0.002),
    ] {
        assert!((actual - wanted).abs() < tolerance, "{actual} for {wanted}");
    }
    assert!(flight.unlogged.is_empty(), "{:?}", flight.unlogged);
    assert_eq!(flight.extra["ae483log.lh_x"].len(), flight.samples.len(), "raw fixes are kept");
}

#[test]
#[ignore = "needs ../shared/data"]
fn the_firmwares_signs_and_units_agree_with_the_teams_observer() {
    let bytes = noor();
    let own = imported(&bytes);
    // Without the custom observer, the firmware's estimate is used, and must agree with it.
    let text = String::from_utf8(bytes).unwrap();
    let text = ["o_x\"", "psi\"", "v_x\""].iter().fold(text, |text, name| {
        text.replace(&format!("ae483log.{name}"), &format!("other.{name}"))
    });
    let firmware = imported(text.as_bytes());
    let median_apart = |part: fn(&FlightSample) -> f64| {
        let flown = own.samples.iter().filter(|s| s.motors.iter().all(|m| *m > 20_000.0));
        let same_time = |s: &FlightSample| {
            let i = firmware.samples.partition_point(|other| other.time_s < s.time_s - 0.006);
            firmware.samples.get(i).filter(|other| (other.time_s - s.time_s).abs() < 0.007)
        };
        let errors = flown.filter_map(|s| Some((part(s) - part(same_time(s)?)).abs()));
        let errors: Vec<f64> = errors.collect();
        assert!(errors.len() > 3000, "{} samples in common", errors.len());
        median(errors).unwrap()
    };
    // With the opposite sign, pitch and roll would differ by 0.05 rad, and in degrees by far more.
    type Number = fn(&FlightSample) -> f64;
    let parts: [(&str, Number, f64); 6] = [
        ("pitch", |s| s.attitude.pitch_rad, 0.01),
        ("roll", |s| s.attitude.roll_rad, 0.01),
        ("yaw", |s| s.attitude.yaw_rad, 0.01),
        ("x", |s| s.position_m.x, 0.01),
        ("forward velocity", |s| s.velocity_body_m_s.x, 0.05),
        ("upward velocity", |s| s.velocity_body_m_s.z, 0.05),
    ];
    for (name, part, bound) in parts {
        let median = median_apart(part);
        assert!(median < bound, "{name}: {median} apart");
    }
}
