//! Logs of one made-up flight in every format must give that flight.
#![expect(clippy::cast_possible_truncation, reason = "a few thousand small numbers")]

use std::fmt::Write as _;

use super::recording::Recording;
use super::*;
use crate::flight::{FlightSample, Quantity, airborne};

mod broken;
mod team_data;

/// Time of sample `i` of a block with a phase of its own.
fn stamp_ms(i: u32, phase_ms: u32) -> u32 {
    40_000 + 10 * i + phase_ms
}

/// The made-up flight on the drone's clock: all straight lines, so that lines between samples
/// are exact.
fn x_m(ms: u32) -> f64 {
    0.2e-3 * f64::from(ms - 40_000)
}

fn yaw_rad(ms: u32) -> f64 {
    3.0 + 0.1e-3 * f64::from(ms - 40_000)
}

const PITCH_RAD: f64 = 0.1;
const ROLL_RAD: f64 = -0.05;
const N: u32 = 400;

/// Variables of the firmware with the block they are logged in, in the units of the firmware.
fn firmware(ms: u32) -> [(&'static str, u32, f64); 16] {
    [
        ("stateEstimate.x", 0, x_m(ms)),
        ("stateEstimate.y", 0, -0.25),
        ("stateEstimate.z", 0, 0.5),
        ("stateEstimate.yaw", 1, (yaw_rad(ms).to_degrees() + 180.0).rem_euclid(360.0) - 180.0),
        ("stateEstimate.pitch", 1, -PITCH_RAD.to_degrees()),
        ("stateEstimate.roll", 1, ROLL_RAD.to_degrees()),
        ("gyro.x", 1, 90.0),
        ("gyro.y", 1, 0.0),
        ("gyro.z", 1, -180.0),
        ("ctrltarget.x", 2, (x_m(ms) * 10.0).floor() / 10.0),
        ("ctrltarget.y", 2, 0.0),
        ("ctrltarget.z", 2, 0.5),
        ("motor.m1", 3, 41_000.0),
        ("motor.m2", 3, 42_000.0),
        ("motor.m3", 3, 43_000.0),
        ("motor.m4", 3, 44_000.0),
    ]
}

fn block_of(block: u32) -> impl Iterator<Item = (&'static str, Vec<f64>, Vec<u32>)> {
    let names = firmware(40_000).into_iter().enumerate().filter(move |(_, row)| row.1 == block);
    names.map(move |(k, (name, ..))| {
        let stamps: Vec<u32> = (0..N).map(|i| stamp_ms(i, 3 * block)).collect();
        (name, stamps.iter().map(|&ms| firmware(ms)[k].2).collect(), stamps)
    })
}

fn json_variables(unit_s: f64) -> String {
    let mut text = String::new();
    for block in 0..4 {
        for (name, values, stamps) in block_of(block) {
            let time: Vec<String> = stamps
                .iter()
                .map(|&ms| {
                    if unit_s == 1.0 {
                        format!("{:.3}", f64::from(ms) / 1e3)
                    } else {
                        ms.to_string()
                    }
                })
                .collect();
            let data: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            let (time, data) = (time.join(","), data.join(", "));
            let _ = write!(text, "\"{name}\": {{\"time\": [{time}], \"data\": [{data}]}},");
        }
    }
    text.pop();
    text
}

fn cfclient_block(block: u32) -> String {
    let columns: Vec<_> = block_of(block).collect();
    let names: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
    let mut text = format!("Timestamp,{}\n", names.join(","));
    for (row, ms) in columns[0].2.iter().enumerate() {
        let cells: Vec<String> =
            columns.iter().map(|(_, values, _)| values[row].to_string()).collect();
        let _ = writeln!(text, "{ms},{}", cells.join(","));
    }
    text
}

/// A µSD log with one event a block, all floats but the motors, which are u16.
fn usd_log(version: u16, clock: f64) -> Vec<u8> {
    let mut bytes = vec![0xBC];
    bytes.extend(version.to_le_bytes());
    bytes.extend(4_u16.to_le_bytes());
    for block in 0..4 {
        let columns: Vec<_> = block_of(block).collect();
        bytes.extend(u16::try_from(block).unwrap().to_le_bytes());
        bytes.extend(format!("block{block}\0").as_bytes());
        bytes.extend(u16::try_from(columns.len()).unwrap().to_le_bytes());
        for (name, ..) in columns {
            bytes.extend(format!("{name}({})\0", if block == 3 { 'H' } else { 'f' }).as_bytes());
        }
    }
    let columns: Vec<Vec<_>> = (0..4).map(|block| block_of(block).collect()).collect();
    for row in 0..N as usize {
        for (block, columns) in columns.iter().enumerate() {
            bytes.extend(u16::try_from(block).unwrap().to_le_bytes());
            let us = f64::from(columns[0].2[row]) * 1e3 * clock;
            if version == 1 {
                bytes.extend(((us / 1e3).round() as u32).to_le_bytes());
            } else {
                bytes.extend((us.round() as u64).to_le_bytes());
            }
            for (_, values, _) in columns {
                if block == 3 {
                    bytes.extend((values[row] as u16).to_le_bytes());
                } else {
                    bytes.extend((values[row] as f32).to_le_bytes());
                }
            }
        }
    }
    let crc = crc32fast::hash(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

fn imported(bytes: &[u8]) -> Flight {
    parse(bytes, "log", &ImportOptions::default()).unwrap()
}

/// Holds a flight to the made-up one; `tolerance` covers the format's own rounding.
fn is_the_made_up_flight(flight: &Flight, tolerance: f64, format: &str) {
    assert!(flight.samples.len() > 390, "{format}: {} samples", flight.samples.len());
    assert!(
        flight.gaps.is_empty() && flight.warnings.len() <= 1,
        "{format}: {:?}",
        flight.warnings
    );
    // Time zero is the first attitude, 3 ms after the first position.
    let zero_ms = 3.0;
    for sample in &flight.samples {
        let s = sample.time_s + zero_ms / 1e3;
        let yaw_rad = 3.0 + 0.1 * s;
        let yaw_rad =
            if yaw_rad > std::f64::consts::PI { yaw_rad - std::f64::consts::TAU } else { yaw_rad };
        let a = sample.attitude;
        let pairs = [
            ("x", sample.position_m.x, 0.2 * s),
            ("y", sample.position_m.y, -0.25),
            ("z", sample.position_m.z, 0.5),
            ("yaw", a.yaw_rad, yaw_rad),
            ("pitch", a.pitch_rad, PITCH_RAD),
            ("roll", a.roll_rad, ROLL_RAD),
            ("x rate", sample.rate_body_rad_s.x, std::f64::consts::FRAC_PI_2),
            ("z rate", sample.rate_body_rad_s.z, -std::f64::consts::PI),
            ("estimate", sample.estimate_m.x, sample.position_m.x),
            ("m3", sample.motors[2], 43_000.0),
        ];
        for (name, found, wanted) in pairs {
            assert!(
                (found - wanted).abs() < tolerance,
                "{format}: {name} {found} for {wanted}, {s} s"
            );
        }
        let tenths = sample.design_m.x * 10.0;
        assert!((tenths - tenths.round()).abs() < 1e-4, "{format}: setpoints are held, not joined");
    }
    assert_eq!(flight.unlogged, [Quantity::Velocity].into(), "{format}");
    assert_eq!(airborne(flight), Some(0..flight.samples.len()), "{format}");
}

#[test]
fn every_format_gives_the_same_flight() {
    let json = format!("{{{}}}", json_variables(1e-3));
    is_the_made_up_flight(&imported(json.as_bytes()), 1e-5, "2022 JSON");
    let json = format!("{{{}, \"start_time\": 4.5, \"end_time\": 9}}", json_variables(1e-3));
    is_the_made_up_flight(&imported(json.as_bytes()), 1e-5, "2021 JSON");
    let json = format!("{{\"drone\": {{{}}}, \"mocap\": {{}}}}", json_variables(1.0));
    is_the_made_up_flight(&imported(json.as_bytes()), 1e-5, "2024 JSON");
    is_the_made_up_flight(&imported(&usd_log(1, 1.0)), 1e-5, "µSD 1");
    is_the_made_up_flight(&imported(&usd_log(2, 1.0)), 1e-5, "µSD 2");
    let folder = tempfile::tempdir().unwrap();
    for block in 0..4 {
        let name = format!("block{block}-20221214T12-00-00.csv");
        std::fs::write(folder.path().join(name), cfclient_block(block)).unwrap();
    }
    std::fs::write(folder.path().join("notes.csv"), "a,b\n").unwrap();
    let flight = import(folder.path(), &ImportOptions::default()).unwrap();
    is_the_made_up_flight(&flight, 1e-5, "cfclient");
}

#[test]
fn one_file_of_cfclient_is_a_flight_of_what_it_holds() {
    let flight = imported(cfclient_block(0).as_bytes());
    assert!(flight.unlogged.contains(&Quantity::Attitude), "{:?}", flight.unlogged);
    assert!(flight.warnings.iter().any(|text| text.contains("attitude")), "{:?}", flight.warnings);
    assert!((flight.samples[100].position_m.x - 0.2).abs() < 1e-6, "1 s at 0.2 m/s");
}

#[test]
fn a_slow_clock_is_said_and_undone_on_demand() {
    let log = usd_log(2, SLOW_CLOCK_RATIO);
    let flight = imported(&log);
    assert!(flight.warnings.iter().any(|text| text.contains("84/85")), "{:?}", flight.warnings);
    let options = ImportOptions { clock_ratio: SLOW_CLOCK_RATIO, ..ImportOptions::default() };
    is_the_made_up_flight(&parse(&log, "log", &options).unwrap(), 1e-5, "slow µSD");
}

#[test]
fn a_cut_off_usd_log_is_recovered_and_a_damaged_one_refused() {
    let log = usd_log(2, 1.0);
    let cut = &log[..log.len() / 2];
    let flight = imported(cut);
    assert!(flight.samples.len() > 190, "{}", flight.samples.len());
    assert!(flight.warnings.iter().any(|text| text.contains("cut off")), "{:?}", flight.warnings);
    let mut damaged = log.clone();
    let byte = log.len() - 10;
    damaged[byte] ^= 1;
    let error = parse(&damaged, "log00", &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains(&format!("log00: byte {}", log.len() - 4)), "{error}");
    let options = ImportOptions { damaged: Damaged::Recover, ..ImportOptions::default() };
    let flight = parse(&damaged, "log00", &options).unwrap();
    assert!(flight.warnings.iter().any(|text| text.contains("CRC")), "{:?}", flight.warnings);
    for n in [1, 3, 5, 8, 40] {
        let error = parse(&log[..n], "log00", &options).unwrap_err().to_string();
        assert!(error.contains("log00: byte"), "a header of {n} bytes: {error}");
    }
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

#[test]
fn nothing_is_made_up_across_a_gap() {
    let rows = |from: u32, to: u32| -> String {
        (from..to).map(|i| format!("{},{},0,1\n", f64::from(i) * 0.02, f64::from(i))).collect()
    };
    let flight = imported(format!("t,x,y,z\n{}{}", rows(0, 50), rows(100, 150)).as_bytes());
    assert_eq!(flight.gaps, [[0.98, 2.0]]);
    let inside = |sample: &&FlightSample| sample.time_s > 0.98 && sample.time_s < 2.0;
    assert_eq!(flight.samples.iter().filter(inside).count(), 0);
    let mut file = Vec::new();
    flight.write_csv(&mut file).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.csv");
    std::fs::write(&path, file).unwrap();
    let back = Flight::read_csv(&path).unwrap();
    let quiet = |flight: Flight| Flight { warnings: vec![], ..flight };
    assert_eq!(quiet(back), quiet(flight), "holes survive the file");
}

#[test]
fn motion_capture_is_laid_over_the_drones_clock_and_believed() {
    let wave = |s: f64, rate: f64| 0.8 * libm::sin(rate * s) + 0.2 * libm::sin(0.2 * s * s);
    let list = |n: u32, value: &dyn Fn(f64) -> f64| {
        let cells: Vec<String> = (0..n).map(|i| format!("{:.6}", value(f64::from(i)))).collect();
        format!("[{}]", cells.join(","))
    };
    let (drone, mocap) = (|i: f64| 0.02 * i, |i: f64| 0.01 * i - 1.0);
    let variable = |name: &str, rate: f64, error: f64| {
        let time = list(600, &|i| 223.0 + drone(i));
        let data = list(600, &|i| wave(drone(i), rate) + error);
        format!("\"{name}\": {{\"time\": {time}, \"data\": {data}}}")
    };
    let text = format!(
        "{{\"drone\": {{{}, {}, {}, {}, {}, {}}}, \"mocap\": {{\"time\": {}, \"x\": {}, \"y\": {}, \
         \"z\": {}}}}}",
        variable("stateEstimate.x", 0.5, 0.03),
        variable("stateEstimate.y", 0.9, 0.0),
        variable("stateEstimate.z", 0.3, 0.0),
        variable("ae483log.p_x_mocap", 0.5, 0.0),
        variable("ae483log.p_y_mocap", 0.9, 0.0),
        variable("ae483log.p_z_mocap", 0.3, 0.0),
        list(1400, &|i| 4097.0 + mocap(i)),
        list(1400, &|i| wave(mocap(i), 0.5)).replace("0.1234", "NaN"),
        list(1400, &|i| wave(mocap(i), 0.9)),
        list(1400, &|i| wave(mocap(i), 0.3)),
    );
    let flight = imported(text.as_bytes());
    let errors = flight.samples.iter().map(|s| (s.estimate_m - s.position_m).x - 0.03);
    let worst_m = errors.map(f64::abs).fold(0.0, f64::max);
    assert!(worst_m < 0.005, "clocks to some ms: {worst_m} m");
    assert!(flight.extra.contains_key("ae483log.p_x_mocap"), "the echo is kept");
    let options = ImportOptions { position: PositionSource::Firmware, ..ImportOptions::default() };
    let flight = parse(text.as_bytes(), "log", &options).unwrap();
    assert_eq!(
        flight.samples[7].position_m, flight.samples[7].estimate_m,
        "asked for the firmware"
    );
}

#[test]
fn a_range_log_keeps_its_rows() {
    let flight = imported(
        b"row,timestamp,ranging.distance0,ranging.distance2\n\
        0,2023-05-04 12:00:00.1,2.4,3.1\n1,2023-05-04 12:00:00.25,2.3,3.1\n",
    );
    assert_eq!(flight.extra["ranging.distance0"], [2.4, 2.3]);
    assert!((flight.samples[1].time_s - 0.15).abs() < 1e-5, "{}", flight.samples[1].time_s);
    assert!(flight.unlogged.contains(&Quantity::Position), "ranges are no position");
}

#[test]
fn what_is_no_log_is_named() {
    let cases: [(&[u8], &str); 6] = [
        (b"", "empty"),
        (b"PK\x03\x04zip", "begins with"),
        (b"[1, 2]", "column of times"),
        (b"{\"a\": {\"time\": [1], \"data\": [2]}}", "columns a"),
        (b"t,colour\n0,1\n", "columns colour"),
        (b"{\"a\": ", "EOF"),
    ];
    for (bytes, wanted) in cases {
        let error = parse(bytes, "log", &ImportOptions::default()).unwrap_err();
        assert!(error.to_string().contains(wanted) && !error.hint().is_empty(), "{error}");
    }
    let far = b"t,x,y,z\n0.5,0,0,0\n1e10,0,0,0\n";
    assert!(parse(far, "log", &ImportOptions::default()).is_err(), "a flight of eons");
}

#[test]
fn a_recording_without_samples_is_an_error() {
    assert!(flight(Recording::default(), &ImportOptions::default()).is_err());
}

#[test]
fn a_range_flight_and_our_own_flight_file_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.csv");
    let json = format!("{{{}}}", json_variables(1e-3));
    let ranges = "i,timestamp,ranging.distance0\n0,12:00:00,1.5\n1,12:00:01,2\n";
    for log in [json.as_bytes(), ranges.as_bytes()] {
        let mut file = Vec::new();
        let flight = Flight { warnings: vec![], ..imported(log) };
        flight.write_csv(&mut file).unwrap();
        std::fs::write(&path, file).unwrap();
        let back = Flight::read_csv(&path).unwrap();
        assert_eq!(Flight { warnings: vec![], ..back }, flight);
    }
    std::fs::write(
        &path,
        "time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad,m1,m2,m3,m4\n0,1,2,3,4,5,6,7,8,9,0\n",
    )
    .unwrap();
    let flight = import(&path, &ImportOptions::default()).unwrap();
    assert_eq!(flight.samples[0].attitude.pitch_rad, 5.0, "our own radians, no guess of degrees");
}

#[test]
fn half_a_quantity_stays_a_column_and_levels_become_lights() {
    let flight =
        imported(b"t,x,y,z,light.headlights,light.odd,m1\n0,0,0,0,0,7,9\n0.1,0,0,1,1,0,9\n");
    assert_eq!(flight.lights["headlights"].last(), Some(&1.0));
    assert!(flight.extra.contains_key("log.light.odd"), "no level: {:?}", flight.extra.keys());
    assert!(
        flight.unlogged.contains(&Quantity::Motors) && flight.extra.contains_key("log.m1"),
        "m1 alone"
    );
}
