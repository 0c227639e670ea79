//! Tests of complete imports. `tests/it/dialects.rs` reads complete, truncated and broken files in
//! every dialect, and `tests/fuzz` damages them. The tests here concern rules that apply to all
//! dialects.

use noctograph_core::flight::{FlightData, FlightSample, Quantity};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::Vector3;

use super::import_bytes as parse;
use super::recording::Recording;
use super::*;
use noctograph_core::files::Budget;

mod foreign;
mod generated;
mod team_data;

/// Returns all warnings of a recording.
pub(super) fn said(log: &Recording) -> String {
    log.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn imported(bytes: &[u8]) -> Flight {
    parse(bytes, "log", &ImportOptions::default()).unwrap()
}

/// Name, phase of the block in ms, and value as a function of the time after 40 s.
type Variable = (&'static str, u32, fn(f64) -> f64);

/// Returns a four-second JSON log that starts at 40 s, with variables sampled at 100 Hz.
fn json(variables: &[Variable]) -> String {
    let list = |cells: Vec<String>| cells.join(",");
    let variable = |(name, phase_ms, value): &Variable| {
        let stamps = || (0..400).map(|i| 10 * i + phase_ms);
        let time = list(stamps().map(|ms| (40_000 + ms).to_string()).collect());
        let data = list(stamps().map(|ms| value(f64::from(ms) / 1e3).to_string()).collect());
        format!("\"{name}\": {{\"time\": [{time}], \"data\": [{data}]}}")
    };
    format!("{{{}}}", list(variables.iter().map(variable).collect()))
}

/// Returns a log of straight lines, for which interpolation is exact, in the firmware's units.
fn straight_flight() -> String {
    fn degrees(rad: f64) -> f64 {
        (rad.to_degrees() + 180.0).rem_euclid(360.0) - 180.0
    }
    json(&[
        ("stateEstimate.x", 0, |s| 0.2 * s),
        ("stateEstimate.y", 0, |_| -0.25),
        ("stateEstimate.z", 0, |_| 0.5),
        ("stateEstimate.yaw", 3, |s| degrees(3.0 + 0.1 * s)),
        ("stateEstimate.pitch", 3, |_| degrees(-0.1)),
        ("stateEstimate.roll", 3, |_| degrees(-0.05)),
        ("gyro.x", 3, |_| 90.0),
        ("gyro.y", 3, |s| s),
        ("gyro.z", 3, |_| -180.0),
        ("ctrltarget.x", 6, |s| (2.0 * s).floor() / 10.0),
        ("ctrltarget.y", 6, |_| 0.0),
        ("ctrltarget.z", 6, |_| 0.5),
        ("motor.m1", 9, |s| 41_000.0 + s.floor()),
        ("motor.m2", 9, |s| 42_000.0 + s.floor()),
        ("motor.m3", 9, |s| 43_000.0 + s.floor()),
        ("motor.m4", 9, |s| 44_000.0 + s.floor()),
    ])
}

#[test]
fn blocks_with_stamps_of_their_own_become_one_flight() {
    let flight = imported(straight_flight().as_bytes());
    assert!(flight.samples.len() > 390 && flight.gaps.is_empty(), "{}", flight.samples.len());
    for sample in &flight.samples {
        // Time zero is the time of the first attitude, 3 ms after the first position.
        let s = sample.time_s + 0.003;
        let yaw_rad = 3.0 + 0.1 * s;
        let (a, rate) = (sample.attitude, sample.rate_body_rad_s);
        for (name, actual, wanted) in [
            ("x", sample.position_m.x, 0.2 * s),
            ("y", sample.position_m.y, -0.25),
            ("z", sample.position_m.z, 0.5),
            ("yaw", a.yaw_rad, if yaw_rad > PI { yaw_rad - TAU } else { yaw_rad }),
            ("pitch", a.pitch_rad, 0.1),
            ("roll", a.roll_rad, -0.05),
            ("x rate", rate.x, FRAC_PI_2),
            ("z rate", rate.z, -PI),
            ("estimate", sample.estimate_m.x, sample.position_m.x),
            (
                "m3",
                sample.motors[2] - 43_000.0,
                (sample.motors[2] - 43_000.0).clamp(0.0, 4.0).floor(),
            ),
        ] {
            assert!((actual - wanted).abs() < 1e-5, "{name} {actual} for {wanted}, {s} s");
        }
        let tenths = sample.design_m.x * 10.0;
        assert!((tenths - tenths.round()).abs() < 1e-4, "setpoints are held, not interpolated");
    }
    assert_eq!(flight.unlogged, [Quantity::Velocity].into());
}

#[test]
fn a_wrap_of_the_radio_clock_leaves_no_trace() {
    let row = |ms: u32| format!("{},{},0,1\n", ms % (1 << 24), f64::from(ms) * 1e-6);
    let rows: String = (0..200).map(|i| row((1 << 24) - 1000 + 10 * i)).collect();
    let flight = imported(
        format!("Timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z\n{rows}").as_bytes(),
    );
    assert_eq!((flight.samples.len(), flight.gaps.len()), (200, 0), "{:?}", flight.warnings);
}

/// Writes a flight to a file, and returns what is read back. There must be no warnings.
fn read_back(flight: &Flight) -> Flight {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.csv");
    let mut file = Vec::new();
    flight.write_csv(&mut file).unwrap();
    std::fs::write(&path, file).unwrap();
    Flight::made(FlightData { warnings: vec![], ..Flight::read_csv(&path).unwrap().into_data() })
}

#[test]
fn gaps_are_not_interpolated() {
    fn rows(from: u32, to: u32) -> String {
        (from..to)
            .map(|i| format!("{},{},0,1\n", f64::from(i) * 0.02, f64::from(i) * 0.1))
            .collect()
    }
    let flight = imported(format!("t,x,y,z\n{}{}", rows(0, 50), rows(100, 150)).as_bytes());
    assert_eq!(flight.gaps, [[0.98, 2.0]]);
    let inside = |sample: &&FlightSample| sample.time_s > 0.98 && sample.time_s < 2.0;
    assert_eq!(flight.samples.iter().filter(inside).count(), 0);
    assert_eq!(
        read_back(&flight),
        Flight::made(FlightData { warnings: vec![], ..flight.into_data() }),
        "gaps survive the file"
    );
}

#[test]
fn motion_capture_is_aligned_with_the_drones_clock_and_preferred() {
    let wave = |s: f64, rate: f64| 0.8 * libm::sin(rate * s) + 0.2 * libm::sin(0.2 * s * s);
    fn list(n: u32, value: &dyn Fn(f64) -> f64) -> String {
        let cells: Vec<String> = (0..n).map(|i| format!("{:.6}", value(f64::from(i)))).collect();
        format!("[{}]", cells.join(","))
    }
    let (drone, mocap) = (|i: f64| 0.02 * i, |i: f64| 0.01 * i - 1.0);
    let variable = |name: &str, rate: f64, error: f64| {
        let time = list(600, &|i| 223.0 + drone(i));
        let data = list(600, &|i| wave(drone(i), rate) + error);
        format!("\"{name}\": {{\"time\": {time}, \"data\": {data}}}")
    };
    let echo = ["x", "y", "z"].map(|axis| format!("ae483log.p_{axis}_mocap"));
    let variables = [
        variable("stateEstimate.x", 0.5, 0.03),
        variable("stateEstimate.y", 0.9, 0.0),
        variable("stateEstimate.z", 0.3, 0.0),
        variable(&echo[0], 0.5, 0.0),
        variable(&echo[1], 0.9, 0.0),
        variable(&echo[2], 0.3, 0.0),
    ];
    let axis = |rate: f64| list(1400, &|i| wave(mocap(i), rate));
    let text = format!(
        "{{\"drone\": {{{}}}, \"mocap\": {{\"time\": {}, \"x\": {}, \"y\": {}, \"z\": {}}}}}",
        variables.join(", "),
        list(1400, &|i| 4097.0 + mocap(i)),
        axis(0.5).replace("0.1234", "NaN"),
        axis(0.9),
        axis(0.3),
    );
    let flight = imported(text.as_bytes());
    let errors = flight.samples.iter().map(|s| (s.estimate_m - s.position_m).x - 0.03);
    let worst_m = errors.map(f64::abs).fold(0.0, f64::max);
    assert!(worst_m < 0.005, "clocks to some ms: {worst_m} m");
    assert!(flight.extra.contains_key("ae483log.p_x_mocap"), "the echo is kept");
    let options = ImportOptions { position: PositionSource::Firmware, ..ImportOptions::default() };
    let flight = parse(text.as_bytes(), "log", &options).unwrap();
    let sample = flight.samples[7];
    assert_eq!(sample.position_m, sample.estimate_m, "the firmware's position");
}

#[test]
fn a_file_that_is_no_log_is_refused() {
    let cases: [(&[u8], &str); 6] = [
        (b"", "empty"),
        (b"no log at all", "begins with"),
        (b"[1, 2]", "a list of rows"),
        (b"{\"a\": {\"time\": [1], \"data\": [2]}}", "columns a"),
        (b"t,colour\n0,1\n", "columns colour"),
        (b"{\"a\": ", "EOF"),
    ];
    for (bytes, wanted) in cases {
        let error = parse(bytes, "log", &ImportOptions::default()).unwrap_err();
        assert!(error.to_string().contains(wanted) && !error.hint().is_empty(), "{error}");
    }
    let far = b"t,x,y,z\n0.5,0,0,0\n1e10,0,0,0\n";
    assert!(parse(far, "log", &ImportOptions::default()).is_err(), "300 years");
    let (options, budget) = (&ImportOptions::default(), &Budget::new("log", HINT));
    let job = Job { file: "log", options, budget };
    assert!(flight(Recording::default(), job).is_err(), "no sample");
}

#[test]
fn a_range_log_and_our_own_flight_file_read_back() {
    let ranges = "row,timestamp,ranging.distance0\n0,2023-05-04 12:00:00.1,2.4\n1,2023-05-04 12:00:00.25,2.3\n";
    let flight = imported(ranges.as_bytes());
    assert_eq!(flight.extra["ranging.distance0"], [2.4, 2.3]);
    assert!((flight.samples[1].time_s - 0.15).abs() < 1e-5, "{}", flight.samples[1].time_s);
    assert!(flight.unlogged.contains(&Quantity::Position), "ranges are no position");
    for flight in [flight, imported(straight_flight().as_bytes())] {
        assert_eq!(
            read_back(&flight),
            Flight::made(FlightData { warnings: vec![], ..flight.into_data() })
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.csv");
    let own = "time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad,m1,m2,m3,m4\n0,1,2,3,4,5,6,7,8,9,0\n";
    std::fs::write(&path, own).unwrap();
    let flight = import(&path, &ImportOptions::default()).unwrap();
    assert_eq!(flight.samples[0].attitude.pitch_rad, 5.0, "radians, never taken as degrees");
}

#[test]
fn half_a_quantity_stays_a_column_and_levels_become_lights() {
    let flight =
        imported(b"t,x,y,z,light.headlights,light.odd,m1\n0,0,0,0,0,7,9\n0.5,0,0,1,1,0,9\n");
    assert_eq!(flight.lights["headlights"].last(), Some(&1.0));
    assert!(flight.extra.contains_key("log.light.odd"), "no level: {:?}", flight.extra.keys());
    assert!(flight.unlogged.contains(&Quantity::Motors), "m1 alone");
    assert!(flight.extra.contains_key("log.m1"), "{:?}", flight.extra.keys());
}

/// Returns a version 2 µSD log with two event types: one that never occurred, and one with the
/// crossing beams of a flight.
fn event_log(events: u32) -> Vec<u8> {
    let mut log = b"\xbc\x02\0\x02\0\x03\0estPose\0\x03\0lighthouse.x(f)\0lighthouse.y(f)\0\
        lighthouse.z(f)\0\x07\0estPosition\0\x03\0lighthouse.x(f)\0lighthouse.y(f)\0lighthouse.z(f)\0"
        .to_vec();
    for i in 1..=events {
        log.extend(7_u16.to_le_bytes());
        log.extend((u64::from(i) * 20_000).to_le_bytes());
        for value in [0.01, 0.0, 0.005_f32] {
            #[expect(clippy::cast_precision_loss, reason = "small")]
            log.extend((value * i as f32).to_le_bytes());
        }
    }
    log
}

#[test]
fn crossing_beams_of_an_event_log_are_positions_and_zeros_after_it_are_damage() {
    let whole = event_log(100);
    let with_crc = [&whole[..], &crc32fast::hash(&whole).to_le_bytes()].concat();
    let flight = imported(&with_crc);
    assert!(
        (flight.samples.last().unwrap().position_m.x - 1.0).abs() < 1e-5,
        "{:?}",
        flight.warnings
    );
    let zeros = imported(&[&whole[..], &[0; 4096]].concat());
    assert_eq!(zeros.samples, flight.samples);
    let said: String = zeros.warnings.iter().map(ToString::to_string).collect();
    assert!(said.contains("zeros up to the end") && said.contains("100 records"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_pipe_in_a_folder_of_logs_is_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("a.csv");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let rows: String = (0..100).map(|i| format!("{},0,0,1\n", 10 * i)).collect();
    let log = format!("Timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z\n{rows}");
    std::fs::write(folder.path().join("b.csv"), log).unwrap();
    let flight = import(folder.path(), &ImportOptions::default()).unwrap();
    assert_eq!(flight.samples.len(), 100);
}

#[test]
fn the_files_of_a_folder_share_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let row = "0".to_owned() + &",0".repeat(100) + "\n";
    for k in 0..12 {
        let names: String = (0..100).map(|n| format!(",a{k}.x{n}")).collect();
        let text = format!("Timestamp{names}\n{}", row.repeat(20_000));
        std::fs::write(folder.path().join(format!("{k}.csv")), text).unwrap();
    }
    let error = import(folder.path(), &ImportOptions::default()).unwrap_err().to_string();
    assert!(error.contains("than an input may") || error.contains("variables"), "{error}");
}
