//! Logs of one made-up flight in every format must give that flight; the team's real log must give
//! the figures known of it; broken logs must give errors or warnings, never a panic.

use std::fmt::Write as _;

use proptest::prelude::*;

use super::recording::Recording;
use super::*;
use crate::flight::{FlightSample, Quantity, airborne, mean_error_over_m, rmse_over_m};

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
    let far = b"t,x,y,z\n0,0,0,0\n1e300,0,0,0\n";
    assert!(parse(far, "log", &ImportOptions::default()).is_err(), "a flight of eons");
}

/// The team's log of NOOR, where it stands: never part of the product.
fn noor() -> Option<Vec<u8>> {
    let shared = std::env::var_os("NOCTOGRAPH_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), Into::into);
    let bytes = std::fs::read(shared.join("data/ae483/noor_flight.json")).ok();
    if bytes.is_none() {
        println!("skipped: no noor_flight.json under {} (set NOCTOGRAPH_SHARED)", shared.display());
    }
    bytes
}

#[test]
fn the_teams_flight_gives_the_figures_known_of_it() {
    let Some(bytes) = noor() else { return };
    let flight = imported(&bytes);
    println!("{}", flight.warnings.join("\n"));
    let flown = &flight.samples[airborne(&flight).unwrap()];
    let (rmse_m, mean_m) = (rmse_over_m(flown).unwrap(), mean_error_over_m(flown).unwrap());
    let n = flown.len() as f64;
    let pitch_rad = flown.iter().map(|s| s.attitude.pitch_rad).sum::<f64>() / n;
    let roll_rad = flown.iter().map(|s| s.attitude.roll_rad).sum::<f64>() / n;
    println!("RMSE {rmse_m}, mean {mean_m}, theta {pitch_rad}, phi {roll_rad}, {n} samples");
    // data/ae483/README.md; there setpoints are joined by lines and gaps bridged, here setpoints
    // are held and gaps left out, which takes up to 6 mm off. The next test does as the README.
    for (found, wanted, tolerance) in [
        (rmse_m.x, 0.099, 0.007),
        (rmse_m.y, 0.046, 0.003),
        (rmse_m.z, 0.064, 0.007),
        (mean_m.x, -0.063, 0.005),
        (mean_m.y, 0.033, 0.003),
        (mean_m.z, -0.004, 0.006),
        (pitch_rad, -0.001, 0.002),
        (roll_rad, 0.002, 0.002),
    ] {
        assert!((found - wanted).abs() < tolerance, "{found} for {wanted}");
    }
    assert!(flight.unlogged.is_empty(), "{:?}", flight.unlogged);
    assert_eq!(flight.extra["ae483log.lh_x"].len(), flight.samples.len(), "raw fixes are kept");
}

#[test]
fn joined_like_the_readme_the_teams_flight_gives_its_figures() {
    let Some(bytes) = noor() else { return };
    let log = ae483_json::read(&bytes, "noor").unwrap();
    let line = |name: &str, s: f64| log.channel(name).unwrap().linear(s, f64::INFINITY);
    let stamps: Vec<f64> = (0..5_862).map(|i| 40.514 + f64::from(i) * 0.01).collect();
    let column = |name: &str| -> Vec<f64> {
        let channel = log.channel(name).unwrap();
        stamps
            .iter()
            .map(|&s| channel.linear(s, f64::INFINITY).unwrap_or(channel.held(s)))
            .collect()
    };
    assert!(line("motor.m1", 50.0).unwrap() > 20_000.0, "seconds, not milliseconds");
    let motors = ["motor.m1", "motor.m2", "motor.m3", "motor.m4"].map(column);
    let flown: Vec<usize> =
        (0..stamps.len()).filter(|&i| motors.iter().all(|m| m[i] > 20_000.0)).collect();
    let n = flown.len() as f64;
    for (axis, rmse_m, mean_m) in [("x", 0.099, -0.063), ("y", 0.046, 0.033), ("z", 0.064, -0.004)]
    {
        let (at, to) =
            (column(&format!("ae483log.o_{axis}")), column(&format!("ae483log.o_{axis}_des")));
        let errors = flown.iter().map(|&i| at[i] - to[i]);
        let mean = errors.clone().sum::<f64>() / n;
        let rmse = (errors.map(|e| e * e).sum::<f64>() / n).sqrt();
        assert!((rmse - rmse_m).abs() < 0.0015, "RMSE {axis} {rmse} for {rmse_m}");
        assert!((mean - mean_m).abs() < 0.0015, "mean {axis} {mean} for {mean_m}");
    }
}

#[test]
fn the_firmwares_signs_and_units_agree_with_the_teams_observer() {
    let Some(bytes) = noor() else { return };
    let own = imported(&bytes);
    // Without the custom observer the firmware's must say the same.
    let text = String::from_utf8(bytes).unwrap();
    let text = ["o_x\"", "psi\"", "v_x\""].iter().fold(text, |text, name| {
        text.replace(&format!("ae483log.{name}"), &format!("other.{name}"))
    });
    let firmware = imported(text.as_bytes());
    let apart = |part: &dyn Fn(&FlightSample) -> f64| {
        let flown = own.samples.iter().filter(|s| s.motors.iter().all(|m| *m > 20_000.0));
        let find = |s: &FlightSample| {
            let i = firmware.samples.partition_point(|other| other.time_s < s.time_s - 0.006);
            firmware.samples.get(i).filter(|other| (other.time_s - s.time_s).abs() < 0.007).copied()
        };
        let errors: Vec<f64> =
            flown.filter_map(|s| Some((part(s) - part(&find(s)?)).abs())).collect();
        let n = errors.len() as f64;
        assert!(n > 3000.0, "{n} samples in common");
        recording::median(errors).unwrap()
    };
    // The other sign would put pitch and roll 0.05 rad apart, degrees far more.
    for (name, median, bound) in [
        ("pitch", apart(&|s| s.attitude.pitch_rad), 0.01),
        ("roll", apart(&|s| s.attitude.roll_rad), 0.01),
        ("yaw", apart(&|s| s.attitude.yaw_rad), 0.01),
        ("x", apart(&|s| s.position_m.x), 0.01),
        ("forward velocity", apart(&|s| s.velocity_body_m_s.x), 0.05),
        ("upward velocity", apart(&|s| s.velocity_body_m_s.z), 0.05),
    ] {
        println!("{name}: {median:.4} apart");
        assert!(median < bound, "{name}: {median} apart");
    }
}

/// The formats of one short log, for breaking.
fn valid_logs() -> Vec<Vec<u8>> {
    let mut json =
        format!("{{\"drone\": {{{}}}, \"mocap\": {{}}}}", json_variables(1.0)).into_bytes();
    json.truncate(30_000);
    let ranges = b"i,timestamp,ranging.distance0\n0,2023-05-04 12:00:00,1\n1,12:00:01,2\n".to_vec();
    let mut usd = usd_log(2, 1.0);
    usd.truncate(3_000);
    let mut usd1 = usd_log(1, 1.0);
    usd1.truncate(3_000);
    let csv = cfclient_block(0)[..4_000].as_bytes().to_vec();
    let mocap = br#"{"drone": {"stateEstimate.x": {"time": [1, 2, 3], "data": [1, 2, 3]}},
        "mocap": {"time": [5, 6, 7], "x": [1, NaN, 3], "y": [1, 2, 3], "z": [0, 0, 1]}}"#;
    let plain = b"t,x,y,z,yaw,r\n0,1,2,3,4,5\n0.1,2,3,4,5,6\n".to_vec();
    vec![json, ranges, usd, usd1, csv, mocap.to_vec(), plain]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_bytes_are_a_flight_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = parse(&bytes, "fuzz", &ImportOptions::default()).map(|flight| flight.samples.len());
    }

    #[test]
    fn a_mutated_log_is_a_flight_or_an_error(
        which in 0..7_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut log = valid_logs().swap_remove(which);
        for (place, byte) in changes {
            let at = place.index(log.len());
            log[at] = byte;
        }
        for damaged in [Damaged::Refuse, Damaged::Recover] {
            let options = ImportOptions { damaged, sample_rate_hz: 10.0, ..Default::default() };
            let _ = parse(&log, "fuzz", &options).map(|flight| flight.samples.len());
        }
        log.truncate(cut.index(log.len()));
        if let Ok(flight) = parse(&log, "fuzz", &ImportOptions::default()) {
            prop_assert!(flight.samples.windows(2).all(|p| p[0].time_s <= p[1].time_s), "time rises");
            let finite = |s: &FlightSample| s.position_m.iter().all(|value| value.is_finite());
            prop_assert!(flight.samples.iter().all(finite), "numbers only");
        }
    }
}

#[test]
fn a_recording_without_samples_is_an_error() {
    assert!(flight(Recording::default(), &ImportOptions::default()).is_err());
}
