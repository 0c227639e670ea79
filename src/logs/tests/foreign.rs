//! Tests tables of other programs: one flight in all notations, refused tables, and warnings.

use std::fmt::Write;

use proptest::prelude::*;

use super::*;
use noctograph_core::flight::airborne;

/// Returns the position on a synthetic flight, which goes up from 1 to 3 s, to the right, into the
/// scene, and down again until 11 s.
pub(super) fn place(t: f64) -> [f64; 3] {
    let up = (0.5 * (t - 1.0)).min(0.5 * (11.0 - t)).clamp(0.0, 1.0);
    [(0.5 * (t - 3.0)).clamp(0.0, 1.0), (0.25 * (t - 5.0)).clamp(0.0, 0.5), up]
}

/// Constant yaw of the flight, as a rotation about the vertical axis.
const YAW_RAD: f64 = std::f64::consts::FRAC_PI_6;

/// Returns a table of the flight's samples at 10 Hz, with each row from its time and position.
fn rows(head: &str, row: impl Fn(f64, [f64; 3]) -> String) -> String {
    let mut text = head.to_owned();
    for i in 0..=120 {
        let t = 0.1 * f64::from(i);
        writeln!(text, "{}", row(t, place(t))).unwrap();
    }
    text
}

fn plain() -> String {
    rows("t,x,y,z\n", |t, [x, y, z]| format!("{t:.3},{x:.4},{y:.4},{z:.4}"))
}

fn read(bytes: &[u8]) -> Flight {
    parse(bytes, "log", &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn said(flight: &Flight) -> String {
    flight.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

fn says(flight: &Flight, text: &str) {
    assert!(said(flight).contains(text), "{text:?}: {}", said(flight));
}

pub(super) fn check(what: &str, flight: &Flight) {
    let last = flight.samples.last().unwrap();
    assert!((last.time_s - 12.0).abs() < 0.11, "{what}: ends at {}", last.time_s);
    for sample in &flight.samples {
        let wanted = Vector3::from(place(sample.time_s));
        // Interpolation between samples at 10 Hz cuts corners.
        let off_m = (sample.position_m - wanted).norm();
        assert!(off_m < 0.02, "{what}: {off_m} m at {} s", sample.time_s);
    }
    let air = airborne(flight).unwrap_or_else(|| panic!("{what}: never in the air"));
    let [from_s, to_s] = [air.start, air.end - 1].map(|i| flight.samples[i].time_s);
    assert!((from_s - 1.1).abs() < 0.05 && (to_s - 10.9).abs() < 0.05, "{what}: {from_s} {to_s}");
}

#[test]
fn a_column_light_is_that_of_the_headlights_unless_another_is_named_so() {
    let lit = |t: f64| f64::from(u8::from(t > 5.0));
    let table = |titles: &str| {
        rows(&format!("t,x,y,z,{titles}\n"), |t, [x, y, z]| {
            format!("{t:.3},{x:.4},{y:.4},{z:.4},{},0", lit(t))
        })
    };
    let flight = |titles: &str| read(table(titles).as_bytes());
    let alone = flight("light,seq");
    let alone = &alone.lights;
    assert_eq!(alone.keys().collect::<Vec<_>>(), ["headlights"]);
    assert!(alone["headlights"].contains(&1.0) && alone["headlights"].contains(&0.0));
    let named = flight("light,light.headlights");
    let levels = &named.lights["headlights"];
    assert!(levels.iter().all(|level| *level == 0.0), "the one that is named");
    assert!(named.extra.contains_key("log.light"), "kept: {:?}", named.extra.keys());
}

#[test]
fn one_flight_is_read_from_every_way_of_writing_a_table() {
    let comma = |text: &str| text.replace(',', ";").replace('.', ",");
    fn quoted(cell: &str) -> String {
        format!("\"{}\"", cell.replace('.', ","))
    }
    let (head, body) = plain().split_once('\n').map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap();
    let body = body.lines().map(|line| line.split(',').map(quoted).collect::<Vec<_>>().join(","));
    let twelve_hours = rows("timestamp,x,y,z\n", |t, [x, y, z]| {
        if t < 4.95 {
            format!("12:59:{:06.3},{x:.4},{y:.4},{z:.4}", 55.0 + t)
        } else {
            format!("01:00:{:06.3},{x:.4},{y:.4},{z:.4}", (t - 5.0).max(0.0))
        }
    });
    let big_endian = [0xfe, 0xff].into_iter();
    let big_endian = big_endian.chain(plain().encode_utf16().flat_map(u16::to_be_bytes)).collect();
    let tables = [
        ("quoted decimal commas", body.fold(head, |text, line| text + "\n" + &line) + "\n"),
        ("comments before the head", format!("# of May\n# drone 3\n{}", plain())),
        ("a head that is a comment", format!("% of May\n%{}", plain())),
        ("a preamble", format!("Flight 3\nDate;5 May\n\n{}", comma(&plain()))),
        ("a line of units", plain().replacen('\n', "\ns,m,m,m\n", 1)),
        ("units in brackets", plain().replacen("t,x,y,z", "Time (s),x [m],Y (m),z[m]", 1)),
        ("a clock of twelve hours", twelve_hours),
        ("fractions of ms", {
            rows("timestamp,x,y,z\n", |t, [x, y, z]| format!("{:.3},{x},{y},{z}", 1e3 * t + 0.125))
        }),
    ];
    let tables = tables.map(|(what, text)| (what, text.into_bytes()));
    for (what, bytes) in tables.into_iter().chain([("UTF-16, big-endian", big_endian)]) {
        check(what, &read(&bytes));
    }
}

/// Returns the quaternion x, y, z, w of the yaw about z.
fn quaternion() -> [f64; 4] {
    [0.0, 0.0, libm::sin(0.5 * YAW_RAD), libm::cos(0.5 * YAW_RAD)]
}

/// `tests/it/dialects.rs` reads the tables of further programs.
#[test]
fn poses_of_other_programs_are_read_with_their_axes_and_orders() {
    let [qx, qy, qz, qw] = quaternion();
    let pose = |separator: &str, [x, y, z]: [f64; 3]| {
        let cells = [x, y, z, qx, qy, qz, qw].map(|value| format!("{value:.5}"));
        cells.join(separator)
    };
    let nanoseconds = |t: f64| format!("{:.0}", 1.7e18 + (t * 1e9).round());
    let topic = |prefix: &str| {
        let axis = |group: &str, axes: &[&str]| {
            axes.iter().map(|axis| format!(",{prefix}{group}{axis}")).collect::<String>()
        };
        let dot = &prefix[prefix.len() - 1..];
        axis(&format!("position{dot}"), &["x", "y", "z"])
            + &axis(&format!("orientation{dot}"), &["x", "y", "z", "w"])
    };
    let tables = [
        (
            "rosbag",
            rows(
                &format!("%time,field.header.seq,field.header.frame_id{}\n", topic("field.pose.")),
                |t, place| format!("{},7,world,{}", nanoseconds(t), pose(",", place)),
            ),
        ),
        (
            "PlotJuggler",
            rows(&format!("__time{}\n", topic("/cf1/pose/pose/")), |t, place| {
                format!("{:.3},{}", 1.7e9 + t, pose(",", place))
            }),
        ),
        (
            "TUM without a head",
            rows("", |t, place| format!("{:.3} {}", 1.7e9 + t, pose(" ", place))),
        ),
        (
            "z down",
            rows("time (s), x (m), y (m), z (m), yaw (rad)\n", |t, [x, y, z]| {
                format!("{t:.3}, {x:.4}, {:.4}, {:.4}, {:.4}", -y, -z, -YAW_RAD)
            }),
        ),
    ];
    let inav = rows(
        "time (us),navPos[0],navPos[1],navPos[2],attitude[0],attitude[1],attitude[2],loop\n",
        |t, [x, y, z]| {
            let [x, y, z] = [100.0 * x, -100.0 * y, 100.0 * z];
            format!("{:.0},{x:.1},{y:.1},{z:.1},0,0,3300,7", 1e6 * t)
        },
    );
    for (what, text) in tables.into_iter().chain([("INAV", inav)]) {
        let flight = read(text.as_bytes());
        check(what, &flight);
        let middle = flight.samples[flight.samples.len() / 2].attitude;
        assert!((middle.yaw_rad - YAW_RAD).abs() < 1e-3, "{what}: {middle:?}\n{}", said(&flight));
        assert!(middle.pitch_rad.abs() + middle.roll_rad.abs() < 1e-3, "{what}: {middle:?}");
        assert!(!said(&flight).contains("navPos"), "{}", said(&flight));
        let is_turned = said(&flight).contains("axes are assumed to be");
        assert_eq!(is_turned, what == "z down", "{what}: {}", said(&flight));
    }
    // A column is known only if a quantity uses it.
    let half = rows("t,x,y,z,navPos[0],navPos[1]\n", |t, [x, y, z]| format!("{t},{x},{y},{z},1,2"));
    says(&read(half.as_bytes()), "kept unchanged: navPos[0] (column 5), navPos[1] (column 6)");
    let vicon =
        "Objects\n10\n,,cf1:cf1,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,rad,rad,rad,mm,mm,mm\n";
    let text = rows(vicon, |t, [x, y, z]| {
        format!("{:.0},0,0,0,0.5,{},{},{}", 10.0 * t + 1.0, 1e3 * x, 1e3 * y, 1e3 * z)
    });
    let flight = read(text.as_bytes());
    check("Vicon", &flight);
    says(&flight, "rotations of Vicon");
    let upright = rows("t,x,y,z\n", |t, [x, y, z]| format!("{t:.2},{x},{z},{:.4}", -y));
    let flight = read(upright.as_bytes());
    check("y up", &flight);
    says(&flight, "assumed to be y-up");
}

#[test]
fn an_option_says_what_a_table_does_not() {
    let bare = rows("x_estimate,y_estimate,z_estimate,battery\n", |_, [x, y, z]| {
        format!("{x},{y},{z},4.05")
    });
    let error = parse(bare.as_bytes(), "log", &ImportOptions::default()).unwrap_err();
    assert!(error.to_string().contains("seconds between two rows"), "{error}");
    let options = ImportOptions { period_s: Some(0.1), ..ImportOptions::default() };
    let flight = parse(bare.as_bytes(), "log", &options).unwrap();
    check("a period", &flight);
    says(&flight, "battery (column 4)");
    assert!(parse(plain().as_bytes(), "log", &options).is_err(), "a period beside times");
    let slow = rows("t,x,y,z\n", |t, [x, y, z]| format!("{:.3},{x},{y},{z}", 50.0 * t));
    let options = ImportOptions { time_unit: TimeUnit::Seconds, ..ImportOptions::default() };
    let flight = parse(slow.as_bytes(), "log", &options).unwrap();
    assert!((flight.samples.last().unwrap().time_s - 600.0).abs() < 0.1, "as told");
    let degrees = rows("t,x,y,z,yaw,pitch,roll\n", |t, [x, y, z]| {
        format!("{t:.2},{x},{y},{z},1,0.5,{}", 0.1 * t)
    });
    let options = ImportOptions { angle_unit: AngleUnit::Degrees, ..ImportOptions::default() };
    let flight = parse(degrees.as_bytes(), "log", &options).unwrap();
    assert!((flight.samples[0].attitude.yaw_rad - 1_f64.to_radians()).abs() < 1e-6, "as told");
}

#[test]
fn degrees_are_told_where_radians_are_impossible() {
    let wave = |t: f64, most: f64| most * libm::sin(3.0 * t);
    for (most, wanted, word) in [
        (2.5, 2.5_f64.to_radians(), "taken as degrees"),
        (0.6, 0.6_f64.to_radians(), "taken as degrees"),
        (0.06, 0.06, ""),
    ] {
        let text = rows("t,x,y,z,yaw,pitch,roll,wx,wy,wz\n", |t, [x, y, z]| {
            let turn = 3.0 * most * libm::cos(3.0 * t);
            format!(
                "{t:.2},{x},{y},{z},5,{:.4},{:.4},{turn:.4},{turn:.4},0",
                wave(t, most),
                wave(t, most)
            )
        });
        let flight = read(text.as_bytes());
        let steepest = flight.samples.iter().map(|s| s.attitude.roll_rad.abs()).fold(0.0, f64::max);
        assert!((steepest / wanted - 1.0).abs() < 0.02, "{most}: {steepest}\n{}", said(&flight));
        says(&flight, word);
        // Rates without a unit are treated in the same way as the angles.
        let fastest = flight.samples.iter().map(|s| s.rate_body_rad_s.x.abs()).fold(0.0, f64::max);
        assert!(
            (fastest / (3.0 * wanted) - 1.0).abs() < 0.05,
            "{most}: rates agree with the text's angles"
        );
    }
}

#[test]
fn other_files_are_refused_with_what_converts_them() {
    let cases: [(&[u8], &str); 19] = [
        (b"ULog\x01\x12\x35\x01\0\0", "ulog2csv"),
        (b"\xa3\x95\x80\x80\x59FMT", "mavlogdump.py"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type\n", "mavlogdump.py"),
        (b"#ROSBAG V2.0\n\x45\0", "rostopic echo"),
        (b"SQLite format 3\0\x10", "PlotJuggler"),
        (b"\x89MCAP0\r\n\x01", "PlotJuggler"),
        (b"PK\x03\x04zip", "CSV"),
        (b"PAR1\x15\0", "to_csv"),
        (b"NO_OF_FRAMES\t601\nNO_OF_CAMERAS\t8\n1\t2\t3\n", "motion capture"),
        (b"PathFileType\t4\t(X/Y/Z)\ttake.trc\n", "motion capture"),
        (b"HIERARCHY\nROOT Hips\n", "motion capture"),
        (b"{\\rtf1\\ansi t,x,y,z}", "plain text"),
        (b"\x80\x04\x95\x10\0", "t,x,y,z"),
        (b"<?xml version=\"1.0\"?>\n<kml/>\n", "t,x,y,z"),
        (b"\x02\x50\x0b\x00", "motion capture"),
        (b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n", "log the position"),
        (b"LabVIEW Measurement\t\nWriter_Version\t2\n***End_of_Header***\t\n", "the table"),
        (b"% program   : RTKLIB 2.4.3\n%  GPST  latitude(deg)\n", "east, north, up"),
        (b"$GPGGA,110000.00,4722.2,N,00832.4,E,1,12,0.7,400,M,,M,,*5B\n", "east, north"),
    ];
    for (bytes, program) in cases {
        let error = parse(bytes, "log", &ImportOptions::default()).unwrap_err();
        assert!(error.hint().contains(program), "{error}: {}", error.hint());
    }
    for (head, wanted) in [
        ("t,x [furlong],y,z,m\n", "furlong"),
        ("t,/a/position/x,/a/position/y,/a/position/z,/b/position/x\n", "two bodies"),
        (
            "Format Version,1.2,Length Units,Cubits\n\n,,Rigid Body\n,,a\n,,Position\nFrame,Time,X\n",
            "Cubits",
        ),
        ("Objects\nmany\n,,a\nFrame,Sub Frame,TX,TY,TZ\n,,mm,mm,mm\n", "frames per second"),
        (
            "Objects\n100\n,,a,,,b,,\nFrame,Sub Frame,TX,TY,TZ,TX,TY,TZ\n,,mm,mm,mm,mm,mm,mm\n",
            "a, b",
        ),
    ] {
        let text = rows(head, |t, _| format!("{t},0,0,1,1"));
        let error =
            parse(text.as_bytes(), "log", &ImportOptions::default()).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    }
    let mixed = "t;x;y;z\n0,1;0.5;0;1\n0,2;0.5;0;1,25\n";
    let error = parse(mixed.as_bytes(), "log", &ImportOptions::default()).unwrap_err().to_string();
    assert!(error.contains("\"0,1\""), "commas and points: {error}");
}

/// Returns a JSON log of the flight, with variables at 10 Hz and times in ms.
fn variables(values: &[(&str, &dyn Fn(f64) -> f64)]) -> String {
    fn list(cell: &dyn Fn(f64) -> f64) -> String {
        let cells: Vec<String> = (0..=120).map(|i| cell(0.1 * f64::from(i)).to_string()).collect();
        cells.join(",")
    }
    let time = list(&|t| (1e3 * t).round() + 9000.0);
    let variables = values.iter().map(|(name, value)| {
        format!("\"{name}\": {{\"time\": [{time}], \"data\": [{}]}}", list(*value))
    });
    format!("{{{}}}", variables.collect::<Vec<_>>().join(","))
}

const POSITION: [(&str, &dyn Fn(f64) -> f64); 3] = [
    ("stateEstimate.x", &|t| place(t)[0]),
    ("stateEstimate.y", &|t| place(t)[1]),
    ("stateEstimate.z", &|t| place(t)[2]),
];

#[test]
fn what_is_frozen_while_the_drone_moves_was_not_logged_whichever_it_is() {
    let constant: &dyn Fn(f64) -> f64 = &|_| 40_000.0;
    let lives: &dyn Fn(f64) -> f64 = &|t| 40_000.0 + 10.0 * t;
    let motors = |values: [&'static dyn Fn(f64) -> f64; 4]| {
        ["motor.m1", "motor.m2", "motor.m3", "motor.m4"].into_iter().zip(values).collect::<Vec<_>>()
    };
    let all = |dead: &'static dyn Fn(f64) -> f64| motors([dead; 4]);
    let logged = |names: [&'static str; 3], value: &'static dyn Fn(f64) -> f64| {
        names.map(|name| (name, value))
    };
    let zero: &dyn Fn(f64) -> f64 = &|_| 0.0;
    type Variables<'a> = Vec<(&'a str, &'a dyn Fn(f64) -> f64)>;
    let cases: Vec<(Quantity, Variables<'_>)> = vec![
        (Quantity::Motors, all(constant)),
        (Quantity::Motors, all(zero)),
        (Quantity::Motors, motors([lives, lives, constant, lives])),
        (
            Quantity::Attitude,
            logged(["stateEstimate.yaw", "stateEstimate.pitch", "stateEstimate.roll"], zero).into(),
        ),
        (
            Quantity::Attitude,
            logged(["stabilizer.yaw", "stabilizer.pitch", "stabilizer.roll"], &|_| 2.0).into(),
        ),
        (Quantity::Rate, logged(["gyro.x", "gyro.y", "gyro.z"], &|_| -0.3).into()),
        (
            Quantity::Velocity,
            logged(["stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz"], zero).into(),
        ),
        (Quantity::Design, logged(["ctrltarget.x", "ctrltarget.y", "ctrltarget.z"], zero).into()),
    ];
    for (quantity, dead) in cases {
        let flight = read(variables(&[&POSITION[..], &dead].concat()).as_bytes());
        assert!(flight.unlogged.contains(&quantity), "{quantity:?}: {}", said(&flight));
        let named = format!("{}: frozen at", quantity.name());
        says(&flight, &named);
        check(quantity.name(), &flight);
    }
    // A drone at rest retains its logged values, and a setpoint may be constant.
    let rests: [(&str, &dyn Fn(f64) -> f64); 3] =
        [("stateEstimate.x", zero), ("stateEstimate.y", zero), ("stateEstimate.z", &|t| 0.001 * t)];
    let flight = read(variables(&[&rests[..], &all(zero)].concat()).as_bytes());
    assert!(!flight.unlogged.contains(&Quantity::Motors), "{}", said(&flight));
    let hover = logged(["ctrltarget.x", "ctrltarget.y", "ctrltarget.z"], &|_| 0.5);
    let flight = read(variables(&[&POSITION[..], &hover].concat()).as_bytes());
    assert!(!flight.unlogged.contains(&Quantity::Design), "{}", said(&flight));
}

#[test]
fn a_dead_or_diverged_source_is_replaced_by_the_next() {
    let lives: &dyn Fn(f64) -> f64 =
        &|t| if (1.05..10.85).contains(&t) { 40_000.0 + 10.0 * t } else { 0.0 };
    let wild: &dyn Fn(f64) -> f64 = &|t| if t > 8.0 { 1e9 } else { t };
    let zero: &dyn Fn(f64) -> f64 = &|_| 0.0;
    let log = [
        &POSITION[..],
        &[
            ("ae483log.m_1", zero),
            ("ae483log.m_2", zero),
            ("ae483log.m_3", zero),
            ("ae483log.m_4", zero),
            ("pwm.m1_pwm", lives),
            ("pwm.m2_pwm", lives),
            ("pwm.m3_pwm", lives),
            ("pwm.m4_pwm", lives),
            ("ae483log.o_x", wild),
            ("ae483log.o_y", wild),
            ("ae483log.o_z", wild),
            ("ctrlLee.rpyx", &|t| 0.1 * libm::sin(t)),
            ("ctrlLee.rpyy", &|t| 0.05 * libm::sin(t)),
            ("ctrlLee.rpyz", &|_| 0.25),
            ("ctrlMel.r_roll", &|t| libm::cos(t)),
            ("ctrlMel.r_pitch", &|t| -0.5 * libm::cos(t)),
            ("ctrlMel.r_yaw", zero),
        ],
    ]
    .concat();
    let flight = read(variables(&log).as_bytes());
    check("the firmware's position", &flight);
    says(&flight, "ae483log.o_x, ae483log.o_y, ae483log.o_z exceeds");
    let sample = &flight.samples[500];
    assert!((sample.motors[2] - 40_050.0).abs() < 2.0, "{sample:?}");
    let (roll, pitch) = (0.1 * libm::sin(5.0), 0.05 * libm::sin(5.0));
    assert!((sample.attitude.roll_rad - roll).abs() < 1e-3, "{sample:?}");
    assert!(
        (sample.attitude.pitch_rad - pitch).abs() < 1e-3 && sample.attitude.yaw_rad == 0.25,
        "{sample:?}"
    );
    assert!(
        (sample.rate_body_rad_s.y - 0.5 * libm::cos(5.0)).abs() < 2e-3,
        "pitch is not inverted"
    );
    assert!(flight.unlogged.contains(&Quantity::Velocity), "{:?}", flight.unlogged);
    // An extra column that diverged does not prevent reading of the rest.
    let log =
        [&POSITION[..], &[("my.channel", &|t: f64| if t > 5.0 { 1e35 } else { 0.0 })]].concat();
    let flight = read(variables(&log).as_bytes());
    says(&flight, "my.channel (");
    check("a wild channel", &flight);
}

#[test]
fn zeros_of_a_body_that_was_lost_are_no_positions() {
    let lost = |t: f64| (6.0..6.5).contains(&t) || t > 11.5;
    let text = rows("t,x,y,z\n", |t, [x, y, z]| {
        if lost(t) { format!("{t:.2},0,0,0") } else { format!("{t:.2},{},{y},{z}", x + 0.5) }
    });
    let flight = read(text.as_bytes());
    says(&flight, "are 0, 0, 0, which the drone could only have reached");
    assert!(flight.samples.iter().all(|s| s.position_m.x > 0.4), "{}", said(&flight));
    assert!((flight.samples.last().unwrap().time_s - 11.5).abs() < 0.11, "the tail is left out");
}

#[test]
fn blocks_of_events_do_not_set_the_unit_of_the_clock() {
    let list = |n: u32, step: f64| {
        (0..n).map(|i| (10.0 + step * f64::from(i)).to_string()).collect::<Vec<_>>().join(",")
    };
    let (time, light) = (list(100, 0.02), list(3, 8.0));
    let data =
        |n: u32| (0..n).map(|i| (0.01 * f64::from(i)).to_string()).collect::<Vec<_>>().join(",");
    let variable = |name: &str, time: &str, n: u32| {
        format!("\"{name}\": {{\"time\": [{time}], \"data\": [{}]}}", data(n))
    };
    let body = ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z"]
        .map(|name| variable(name, &time, 100))
        .join(",");
    let text = format!("{{\"drone\": {{{}, {body}}}}}", variable("light.headlights", &light, 3));
    let flight = read(text.as_bytes());
    assert!((flight.samples.last().unwrap().time_s - 1.98).abs() < 0.02, "{}", said(&flight));
}

#[test]
fn a_cut_log_of_a_script_is_refused_wherever_it_is_cut() {
    let about = "{\"noctograph\": {\"word\": \"NO\"},";
    let log = variables(&POSITION).replacen('{', about, 1);
    read(log.as_bytes());
    for end in (about.len() - 5..log.trim_end().len()).step_by(97) {
        let error = parse(&log.as_bytes()[..end], "log", &ImportOptions::default()).unwrap_err();
        assert!(error.to_string().contains("ends too early"), "{end}: {error}");
    }
    // Other logs are read up to the point where they end.
    says(&read(&variables(&POSITION).as_bytes()[..log.len() - 100]), "ends too early");
}

#[test]
fn an_exported_scripts_log_has_its_words_without_a_warning() {
    let log = variables(&POSITION).replacen('{', "{\"noctograph\": {\"word\": \"NO\", \"uri\": \"radio://0/80/2M/E7E7E7E701\", \"plan_sha256\": \"ab\"},", 1);
    let flight = read(log.as_bytes());
    check("a script's", &flight);
    assert!(!said(&flight).contains("not read"), "{}", said(&flight));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Every text reader names, in a warning or an error, one unknown item that is added to a log
    /// that it understands.
    #[test]
    fn what_is_not_understood_is_named(name in "[a-z]{5,9}q", word in "[a-z]{3,8}", place in 1..3_usize) {
        let column = |value: &str, title: &str| {
            let text = plain();
            let lines = text.lines().enumerate().map(|(n, line)| {
                let mut cells: Vec<&str> = line.split(',').collect();
                cells.insert(place, if n == 0 { title } else { value });
                cells.join(",") + "\n"
            });
            lines.collect::<String>()
        };
        fn named(text: &str, file: &str, wanted: &str) -> bool {
            match parse(text.as_bytes(), file, &ImportOptions::default()) {
                Ok(flight) => said(&flight).contains(wanted),
                Err(error) => error.to_string().contains(wanted),
            }
        }
        prop_assert!(named(&column("7", &name), "log", &name), "a column");
        prop_assert!(named(&column(&word, &name), "log", &name), "a column of texts");
        prop_assert!(named(&column("7", &format!("x [{name}]")), "log", &name), "a unit");
        let member = |value: &str| variables(&POSITION).replacen('{', &format!("{{\"{name}\": {value},"), 1);
        prop_assert!(named(&member("7"), "log", &name), "a number");
        prop_assert!(named(&member(&format!("\"{word}\"")), "log", &name), "a text");
        prop_assert!(named(&member("[1, 2, 3]"), "log", &name), "a list");
        let cfclient = format!("Timestamp,stateEstimate.x,{name}\n0,1,{word}\n10,2,{word}\n");
        prop_assert!(named(&cfclient, "log", &name), "a cell of cfclient's");
        let half = plain().replacen("t,x,y,z", &format!("t,x,y,{name}"), 1);
        prop_assert!(named(&half, "log", "x_m") && named(&half, "log", &name), "half a position");
    }
}

fn refused(text: &str) -> String {
    let error = parse(text.as_bytes(), "log", &ImportOptions::default()).unwrap_err();
    format!("{error}; {}", error.hint())
}

#[test]
fn compass_directions_with_units_are_a_position_and_a_matrix_is_no_table_of_times() {
    let compass = rows("t,north_m,east_m,down_m,north_m_s,yaw_deg\n", |t, [x, y, z]| {
        format!("{t:.3},{x},{},{},0.1,{}", -y, -z, -YAW_RAD.to_degrees())
    });
    let flight = read(compass.as_bytes());
    check("north, east and down", &flight);
    let yaw_rad = flight.samples[60].attitude.yaw_rad;
    assert!((yaw_rad - YAW_RAD).abs() < 1e-6, "{yaw_rad}");
    let yaw = rows(
        "__time,/cf/pose/position/x,/cf/pose/position/y,/cf/pose/position/z,/cf/pose/orientation/yaw\n",
        |t, [x, y, z]| format!("{t:.3},{x},{y},{z},{YAW_RAD}"),
    );
    let flight = read(yaw.as_bytes());
    check("a yaw beside a position", &flight);
    assert!((flight.samples[60].attitude.yaw_rad - YAW_RAD).abs() < 1e-6);
    // KITTI poses are the first three rows of a matrix, without times.
    let kitti = rows("", |_, [x, y, z]| format!("1 0 0 {x} 0 1 0 {y} 0 0 1 {z}"));
    let turning =
        rows("", |t, [x, y, z]| format!("{:.6} 0 0 {x} 0 1 0 {y} 0 0 1 {z}", 0.01 * libm::sin(t)));
    for text in [kitti, turning] {
        assert!(refused(&text).contains("no header, and"), "{}", refused(&text));
    }
}

#[test]
fn days_without_a_clock_are_refused_and_another_encoding_is_named() {
    let stamped = |title: &str, stamp: &dyn Fn(f64) -> String| {
        rows(&format!("{title},x,y,z\n"), |t, [x, y, z]| format!("{},{x},{y},{z}", stamp(t)))
    };
    let days = stamped("time", &|t| format!("{:.10}", 46_023.4 + t / 86_400.0));
    says(&read(days.as_bytes()), "read in units of 86400 s");
    assert!(refused(&stamped("date", &|_| "2026-01-01".into())).contains("days alone"));
    let latin = rows("t,x,y,z,h\u{e9}\n", |t, [x, y, z]| format!("{t},{x},{y},{z},7"));
    let flight = read(&latin.chars().map(|c| c as u8).collect::<Vec<_>>());
    check("Windows-1252", &flight);
    says(&flight, "Windows-1252");
}

#[test]
fn heads_of_two_levels_dated_indices_and_true_positions_are_read() {
    fn seconds(t: f64) -> String {
        format!("{t:.3}")
    }
    fn clock(t: f64) -> String {
        format!("2026-03-03 12:00:{t:06.3}+01:00")
    }
    fn span(t: f64) -> String {
        format!("0 days 00:00:{t:09.6}")
    }
    type Stamp = fn(f64) -> String;
    let tables: [(&str, &str, f64, Stamp); 5] = [
        ("levels", ",position,position,position,attitude\n,x,y,z,yaw\ntime,,,,", 1.0, seconds),
        ("a dated index", ",x,y,z,yaw", 1.0, clock),
        ("an index of spans", ",x,y,z,yaw", 1.0, span),
        ("the true one", "t,x_true,y_true,z_true,x_est", 1.0, seconds),
        ("feet", "host_time_s,x_ft,y [feet],z (foot),yaw", 0.3048, seconds),
    ];
    for (what, head, unit_m, stamp) in tables {
        let text = rows(&format!("{head}\n"), |t, place| {
            let [x, y, z] = place.map(|value| value / unit_m);
            format!("{},{x},{y},{z},0.25", stamp(t))
        });
        let flight = read(text.as_bytes());
        check(what, &flight);
        let yaw_rad = flight.samples[500].attitude.yaw_rad;
        assert_eq!(yaw_rad, if what == "the true one" { 0.0 } else { 0.25 }, "{what}");
    }
    let two =
        rows(",cf1,cf1,cf1,cf2\n,x,y,z,x\nt,,,,\n", |t, [x, y, z]| format!("{t},{x},{y},{z},{x}"));
    assert!(refused(&two).contains("cf1/x, cf1/y, cf1/z, cf2/x"), "{}", refused(&two));
}

#[test]
fn values_without_a_column_of_their_own_are_named() {
    let dictionaries = rows("timestamp,data\n", |t, [x, y, z]| {
        format!("{t},\"{{'stateEstimate.x': {x}, 'stateEstimate.y': {y}, 'z': {z}}}\"")
    });
    assert!(refused(&dictionaries).contains("data (column 2, \"{'stateEstimate"));
    let tuples = rows("t,position\n", |t, [x, y, z]| format!("{t},\"({x}, {y}, {z})\""));
    assert!(refused(&tuples).contains("position (column 2, \"("), "{}", refused(&tuples));
    let printed = rows("", |t, [x, y, z]| format!("Time: {t} s, X: {x} m, Y: {y} m, Z: {z} m"));
    assert!(refused(&printed).contains("X: 0 m (column 2"), "{}", refused(&printed));
    let lists = rows("", |t, [x, y, z]| format!("[{t}, {x}, {y}, {z}]"));
    assert!(refused(&lists).contains("lists without names"), "{}", refused(&lists));
    let lists = format!("[{}]", lists.trim_end().replace('\n', ","));
    assert!(refused(&lists).contains("lists without names"), "{}", refused(&lists));
    let nested = rows("", |t, place| format!("{{\"t\": {t}, \"pos\": {place:?}}}"));
    assert!(refused(&nested).contains("not read: pos (\"a list\")"), "{}", refused(&nested));
    let show = r#"{"version": "1.0", "performances": [{"id": 1, "agentDescription": {}}]}"#;
    assert!(refused(show).contains("performances"), "{}", refused(show));
    let python = rows("", |t, [x, y, z]| format!("{{'t': {t:.2}, 'x': {x}, 'y': {y}, 'z': {z}}}"));
    check("dictionaries of Python", &read(python.as_bytes()));
}

#[test]
fn rows_of_several_drones_and_a_position_that_is_too_fast_are_refused() {
    fn owned(head: &str, owner: &dyn Fn(usize) -> String, apart_s: f64) -> String {
        let mut text = format!("t,{head},x,y,z\n");
        for i in 0..=240_u32 {
            let (t, second) = (0.1 * f64::from(i / 2), i % 2 == 1);
            let [x, y, z] = place(t);
            let (t, x) = if second { (t + apart_s, x + 1.5) } else { (t, x) };
            writeln!(text, "{t:.3},{},{x},{y},{z}", owner(usize::from(second))).unwrap();
        }
        text
    }
    let id = |which: usize| ["1", "2"][which].to_owned();
    assert!(refused(&owned("mode", &id, 0.04)).contains("faster than 15 m/s"));
    assert!(
        refused(&owned("mode", &id, 0.0))
            .contains("share their time with a row at another position")
    );
    let one = rows("t,drone_id,x,y,z\n", |t, [x, y, z]| format!("{t:.2},7,{x},{y},{z}"));
    check("one drone", &read(one.as_bytes()));
    fn scaled(head: &str, scale: f64) -> String {
        rows(head, |t, [x, y, z]| format!("{t:.2},{},{},{}", scale * x, scale * y, scale * z))
    }
    assert!(refused(&scaled("t,x,y,z\n", 100.0)).contains("x_cm"));
    check("named", &read(scaled("t,x_cm,y_cm,z_cm\n", 100.0).as_bytes()));
    let options = ImportOptions { max_speed_m_s: 60.0, ..ImportOptions::default() };
    assert!(parse(scaled("t,x,y,z\n", 100.0).as_bytes(), "log", &options).is_ok(), "as told");
    let long = rows("time,name,value\n", |t, [x, ..]| {
        format!("{t},stateEstimate.x,{x}\n{t},stateEstimate.z,1")
    });
    assert!(refused(&long).contains("pivot_table(index=\"time\""));
    let melted = rows(",variable,value,time\n", |t, [x, ..]| {
        format!("0,stateEstimate.x,{x},{t}\n1,stateEstimate.z,1,{t}")
    });
    assert!(refused(&melted).contains("columns=\"variable\""), "{}", refused(&melted));
    let rounded = rows("t,x,y,z\n", |_, [x, y, z]| format!("1.7e12,{x},{y},{z}"));
    assert!(refused(&rounded).contains("121 equal times"), "{}", refused(&rounded));
    let no_head = rows("", |t, [x, y, z]| format!("radio://0/80,{t},{x},{y},{z}"));
    assert!(
        refused(&no_head).contains("column t: found \"radio://0/80\""),
        "{}",
        refused(&no_head)
    );
}

#[test]
fn a_format_that_was_recognized_says_itself_why_it_is_not_read() {
    let take =
        "Format Version,1.23,Take Name,a,Length Units,Meters\n\nFrame,Time (Seconds)\n0,0.0\n";
    assert!(refused(take).contains("Marker: found none in the take"), "{}", refused(take));
    let cut = "Format Version,1.23,Take Name,a\n\n,Type\n";
    assert!(refused(cut).contains("begins with Frame"), "{}", refused(cut));
    let split = r#"{"columns":["t","x"],"index":[0],"data":[[0,1]]}"#;
    assert!(refused(split).contains("records"), "{}", refused(split));
}
