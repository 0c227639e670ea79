//! Tests of logs in every dialect, made from simulated flights of several letters. The logs are
//! intact, truncated, or corrupt in typical ways. Each import yields the logged flight, a warning,
//! or an error with a hint, but never a panic or wrong numbers.

use std::fmt::Write;

use nalgebra::UnitQuaternion;
use noctograph::error::Error;
use noctograph::flight::{Flight, FlightSample};
use noctograph::letters::{LetterOptions, write};
use noctograph::logs::{Damaged, ImportOptions, import};
use noctograph::plan::{PlanOptions, plan};
use noctograph::sim::{Drone, SimOptions, fly};

/// Returns the flight of a word, sampled at 100 Hz.
pub(crate) fn flown(word: &str) -> Flight {
    let strokes = write(word, &LetterOptions::default()).unwrap();
    let plan = plan(&strokes, &PlanOptions::default()).unwrap();
    let mut options = SimOptions::default();
    options.rates.log_hz = 100;
    fly(&plan, &Drone::new(&options, 3), &mut |_| {}).unwrap()
}

/// Truncates a flight to its first `n` samples.
fn shorten(flight: &mut Flight, n: usize) {
    flight.edit(|flight| {
        flight.samples.truncate(n);
        let columns = flight.lights.values_mut().chain(flight.extra.values_mut());
        columns.for_each(|column| column.truncate(n));
    });
}

type Variable = (&'static str, fn(&FlightSample) -> f64);

/// Variables of the firmware by log block, with the firmware's units and sign conventions.
pub(crate) const FIRMWARE: [&[Variable]; 4] = [
    &[
        ("stateEstimate.x", |s| s.position_m.x),
        ("stateEstimate.y", |s| s.position_m.y),
        ("stateEstimate.z", |s| s.position_m.z),
    ],
    &[
        ("stateEstimate.yaw", |s| s.attitude.yaw_rad.to_degrees()),
        ("stateEstimate.pitch", |s| -s.attitude.pitch_rad.to_degrees()),
        ("stateEstimate.roll", |s| s.attitude.roll_rad.to_degrees()),
    ],
    &[
        ("ctrltarget.x", |s| s.design_m.x),
        ("ctrltarget.y", |s| s.design_m.y),
        ("ctrltarget.z", |s| s.design_m.z),
    ],
    &[
        ("motor.m1", |s| s.motors[0].round()),
        ("motor.m2", |s| s.motors[1].round()),
        ("motor.m3", |s| s.motors[2].round()),
        ("motor.m4", |s| s.motors[3].round()),
    ],
];

/// Variables of the course AE483, in which the names `o_x` and `p_x` come from different years.
const COURSE: [&[Variable]; 3] = [
    &[
        ("ae483log.p_x", |s| s.position_m.x),
        ("ae483log.p_y", |s| s.position_m.y),
        ("ae483log.p_z", |s| s.position_m.z),
    ],
    &[
        ("ae483log.psi", |s| s.attitude.yaw_rad),
        ("ae483log.theta", |s| s.attitude.pitch_rad),
        ("ae483log.phi", |s| s.attitude.roll_rad),
    ],
    &[
        ("ae483log.m_1", |s| s.motors[0].round()),
        ("ae483log.m_2", |s| s.motors[1].round()),
        ("ae483log.m_3", |s| s.motors[2].round()),
        ("ae483log.m_4", |s| s.motors[3].round()),
    ],
];

/// Returns the timestamp of a sample on the drone's clock, in ms.
fn stamp_ms(sample: &FlightSample) -> f64 {
    (sample.time_s * 1e3).round() + 40_000.0
}

/// Returns the members of a JSON log, each with a variable's samples that were not lost.
pub(crate) fn json(
    flight: &Flight,
    blocks: &[&[Variable]],
    stamp: fn(&FlightSample) -> String,
    is_lost: impl Fn(&str, &FlightSample) -> bool,
) -> String {
    let variable = |(name, value): &Variable| {
        let kept = flight.samples.iter().filter(|sample| !is_lost(name, sample));
        let (time, data): (Vec<_>, Vec<_>) =
            kept.map(|sample| (stamp(sample), format!("{:?}", value(sample)))).unzip();
        let (time, data) = (time.join(", "), data.join(", "));
        format!("\"{name}\": {{\"time\": [{time}], \"data\": [{data}]}}")
    };
    blocks.concat().iter().map(variable).collect::<Vec<_>>().join(",\n")
}

/// Returns a JSON log of the firmware's variables with times in milliseconds.
pub(crate) fn json_2022(flight: &Flight, is_lost: impl Fn(&str, &FlightSample) -> bool) -> String {
    format!("{{{}}}", json(flight, &FIRMWARE, |s| stamp_ms(s).to_string(), is_lost))
}

fn nothing(_: &str, _: &FlightSample) -> bool {
    false
}

fn plain(flight: &Flight) -> String {
    let mut text = "t,x,y,z,yaw,pitch,roll\n".to_owned();
    for s in &flight.samples {
        let (p, a) = (s.position_m, s.attitude);
        let row = [s.time_s, p.x, p.y, p.z, a.yaw_rad, a.pitch_rad, a.roll_rad];
        writeln!(text, "{}", row.map(|value| value.to_string()).join(",")).unwrap();
    }
    text
}

fn cfclient(flight: &Flight, block: &[Variable]) -> String {
    let names: Vec<&str> = block.iter().map(|(name, _)| *name).collect();
    let mut text = format!("Timestamp,{}\n", names.join(","));
    for s in &flight.samples {
        let cells: Vec<String> = block.iter().map(|(_, value)| value(s).to_string()).collect();
        writeln!(text, "{},{}", stamp_ms(s), cells.join(",")).unwrap();
    }
    text
}

/// Returns the header and the records of a µSD log, without its CRC.
#[expect(clippy::cast_possible_truncation, reason = "as the card has it")]
fn usd_body(flight: &Flight, version: u16) -> Vec<u8> {
    let mut bytes = vec![0xBC];
    bytes.extend(version.to_le_bytes());
    bytes.extend(4_u16.to_le_bytes());
    for (id, block) in (10_u16..).zip(FIRMWARE) {
        bytes.extend(id.to_le_bytes());
        bytes.extend(format!("event{id}\0").as_bytes());
        bytes.extend((block.len() as u16).to_le_bytes());
        for (name, _) in block {
            let kind = if name.starts_with("motor") { 'H' } else { 'f' };
            bytes.extend(format!("{name}({kind})\0").as_bytes());
        }
    }
    for s in &flight.samples {
        for (id, block) in (10_u16..).zip(FIRMWARE) {
            bytes.extend(id.to_le_bytes());
            match version {
                1 => bytes.extend((stamp_ms(s) as u32).to_le_bytes()),
                _ => bytes.extend((stamp_ms(s) as u64 * 1000).to_le_bytes()),
            }
            for (name, value) in block {
                if name.starts_with("motor") {
                    bytes.extend((value(s) as u16).to_le_bytes());
                } else {
                    bytes.extend((value(s) as f32).to_le_bytes());
                }
            }
        }
    }
    bytes
}

fn with_crc(mut bytes: Vec<u8>) -> Vec<u8> {
    let crc = crc32fast::hash(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// Returns the log that an exported script writes during the flight, with a line for each sample.
fn script_lines(flight: &Flight) -> String {
    let mut text = "{\"noctograph\": {\"firmware\": \"2026.08\"}}\n".to_owned();
    for s in &flight.samples {
        write!(text, "{{\"time\": {}", stamp_ms(s)).unwrap();
        for (name, value) in FIRMWARE.concat() {
            write!(text, ", \"{name}\": {:?}", value(s)).unwrap();
        }
        text.push_str("}\n");
    }
    text + "{\"end\": true}\n"
}

/// A time, a position, a quaternion (w, x, y, z) and a heading.
type Pose = (f64, [f64; 3], [f64; 4], f64);
/// Function that returns the cells of a pose in a program's units and axes.
type Cells = fn(Pose) -> Vec<f64>;
/// Tables of other programs: the name, the header, and the function for the cells.
const PROGRAMS: [(&str, &str, Cells); 7] = [
    ("TUM", "# timestamp tx ty tz qx qy qz qw", |(t, p, [w, x, y, z], _)| {
        vec![1.7e9 + t, p[0], p[1], p[2], x, y, z, w]
    }),
    (
        "EuRoC",
        "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []",
        |(t, p, [w, x, y, z], _)| vec![1e9 * (1.7e9 + t), p[0], p[1], p[2], w, x, y, z],
    ),
    (
        "ROS 2",
        "%time,field.pose.position.x,field.pose.position.y,field.pose.position.z,\
        field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,field.pose.orientation.w",
        |(t, p, [w, x, y, z], _)| vec![1e9 * (1.7e9 + t), p[0], p[1], p[2], x, y, z, w],
    ),
    ("AirSim, z down", "TimeStamp,POS_X,POS_Y,POS_Z,Q_W,Q_X,Q_Y,Q_Z", |(t, p, [w, x, y, z], _)| {
        vec![(1e3 * (1.7e9 + t)).round(), p[0], -p[1], -p[2], w, x, -y, -z]
    }),
    (
        "PX4, z down",
        "timestamp,timestamp_sample,ref_timestamp,x,y,z,vx,vy,vz,heading",
        |(t, p, _, yaw_rad)| {
            let stamp_us = (5e7 + 1e6 * t).round();
            vec![stamp_us, stamp_us, 0.0, p[0], -p[1], -p[2], 0.0, 0.0, 0.0, -yaw_rad]
        },
    ),
    (
        "Motive, y up",
        "Format Version,1.23,Take Name,T,Rotation Type,Quaternion,Length Units,Millimeters,\
        Coordinate Space,Global\n\n,,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,\
        Marker\n,,cf,cf,cf,cf,cf,cf,cf,m\n,,a,a,a,a,a,a,a,b\n,,Rotation,Rotation,Rotation,Rotation,Position,Position,\
        Position,Position\nFrame,Time (Seconds),X,Y,Z,W,X,Y,Z,X",
        |(t, p, [w, x, y, z], _)| {
            vec![(100.0 * t).round(), t, x, z, -y, w, 1e3 * p[0], 1e3 * p[2], -1e3 * p[1], 5.0]
        },
    ),
    ("Crazyswarm2", "time,x,y,z,qx,qy,qz,qw", |(t, p, [w, x, y, z], _)| {
        vec![t, p[0], p[1], p[2], x, y, z, w]
    }),
];

/// Returns a flight as the table of a program.
fn table(flight: &Flight, head: &str, cells: Cells) -> String {
    let separator = if head.contains(',') { "," } else { " " };
    let mut text = format!("{head}\n");
    for s in &flight.samples {
        let a = s.attitude;
        let turn = UnitQuaternion::from_euler_angles(a.roll_rad, a.pitch_rad, a.yaw_rad);
        let turn = [turn.w, turn.i, turn.j, turn.k];
        let cells = cells((s.time_s, s.position_m.into(), turn, a.yaw_rad));
        let cells: Vec<String> = cells.iter().map(ToString::to_string).collect();
        writeln!(text, "{}", cells.join(separator)).unwrap();
    }
    text
}

/// Writes files into a folder, and imports the folder or its only file.
fn imported(files: &[(&str, &[u8])], options: &ImportOptions) -> Result<Flight, Error> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    match files {
        [(name, _)] => import(&folder.path().join(name), options),
        _ => import(folder.path(), options),
    }
}

fn read(name: &str, bytes: &[u8]) -> Result<Flight, Error> {
    imported(&[(name, bytes)], &ImportOptions::default())
}

/// Checks that all numbers of an imported flight are finite, and returns its largest distance from
/// the logged flight in m.
fn farthest_m(found: &Flight, logged: &Flight) -> f64 {
    let start_s = logged.samples[0].time_s;
    assert!(found.samples.windows(2).all(|pair| pair[0].time_s < pair[1].time_s), "time rises");
    let off_m = found.samples.iter().map(|s| {
        let numbers = || s.position_m.iter().chain(&s.design_m);
        assert!(numbers().all(|value| value.is_finite()), "every number is finite");
        let at = logged.samples.partition_point(|l| l.time_s - start_s < s.time_s - 1e-4);
        let there = &logged.samples[at.min(logged.samples.len() - 1)];
        (s.position_m - there.position_m).norm()
    });
    off_m.fold(0.0, f64::max)
}

#[test]
fn letters_come_back_from_every_dialect() {
    for letter in ["A", "K", "S", "Q"] {
        let flight = flown(letter);
        let course = json(&flight, &COURSE, |s| (stamp_ms(s) / 1e3).to_string(), nothing);
        let of_2021 = format!(
            "{{{}, \"start_time\": 1.5, \"end_time\": 9, \"note\": \"{letter}\"}}",
            json(&flight, &FIRMWARE, |s| stamp_ms(s).to_string(), nothing)
        );
        let blocks = FIRMWARE.map(|block| cfclient(&flight, block).into_bytes());
        let names = ["pos-20221212T10-00-00.csv", "att.csv", "target.csv", "motors.csv"];
        let folder: Vec<(&str, &[u8])> =
            names.into_iter().zip(blocks.iter().map(Vec::as_slice)).collect();
        let dialects = [
            ("2021", imported(&[("log.json", of_2021.as_bytes())], &ImportOptions::default())),
            ("2022", read("log.json", json_2022(&flight, nothing).as_bytes())),
            (
                "2024",
                read("l.json", format!("{{\"drone\": {{{course}}}, \"mocap\": {{}}}}").as_bytes()),
            ),
            ("cfclient", imported(&folder, &ImportOptions::default())),
            ("µSD 1", read("log00", &with_crc(usd_body(&flight, 1)))),
            ("µSD 2", read("log01", &with_crc(usd_body(&flight, 2)))),
            ("plain", read("log.csv", plain(&flight).as_bytes())),
            ("a script's lines", read("log.jsonl", script_lines(&flight).as_bytes())),
        ];
        let programs = PROGRAMS.map(|(name, head, cells)| {
            (name, read("pose.csv", table(&flight, head, cells).as_bytes()))
        });
        for (dialect, found) in dialects.into_iter().chain(programs) {
            let found = found.unwrap_or_else(|error| panic!("{letter}, {dialect}: {error}"));
            assert!(found.samples.len() + 2 > flight.samples.len(), "{letter}, {dialect}");
            let off_m = farthest_m(&found, &flight);
            assert!(off_m < 1e-5, "{letter}, {dialect}: {off_m} m off");
            let said: String = found.warnings.iter().map(ToString::to_string).collect();
            let is_turned = said.contains("axes are taken as");
            assert_eq!(is_turned, dialect.contains(", "), "{letter}, {dialect}: {said}");
            for (s, logged) in found.samples.iter().zip(&flight.samples) {
                let (a, b) = (s.attitude, logged.attitude);
                let tilt = (a.pitch_rad - b.pitch_rad).abs() + (a.roll_rad - b.roll_rad).abs();
                let tilt = if dialect.starts_with("PX4") { 0.0 } else { tilt };
                let off = (a.yaw_rad - b.yaw_rad).abs() + tilt;
                assert!(off < 1e-5, "{letter}, {dialect}: {a:?}, {b:?}");
            }
        }
    }
}

/// A log truncated at any position is read with a warning, or refused with the place.
#[test]
fn logs_cut_off_anywhere_are_read_that_far_or_refused() {
    let mut flight = flown("K");
    shorten(&mut flight, 900);
    let logs = [
        ("log.json", json_2022(&flight, nothing).into_bytes()),
        ("log.csv", plain(&flight).into_bytes()),
        ("pos.csv", cfclient(&flight, FIRMWARE[0]).into_bytes()),
        ("log00", with_crc(usd_body(&flight, 1))),
        ("log01", with_crc(usd_body(&flight, 2))),
    ];
    for (name, whole) in &logs {
        let n = whole.len();
        let places = (0..60).map(|k| k * 4).chain((1..40).map(|k| n * k / 40)).chain(n - 12..n);
        let mut read_so_far = 0;
        for at in places {
            match read(name, &whole[..at]) {
                Ok(found) => {
                    read_so_far += 1;
                    let off_m = farthest_m(&found, &flight);
                    assert!(off_m < 1e-5, "{name} cut at {at}: {off_m} m off");
                    let warned = !found.warnings.is_empty() || name.ends_with("csv");
                    assert!(warned, "{name} cut at {at} of {n} without a warning");
                }
                Err(error) => {
                    let text = error.to_string();
                    assert!(text.contains(name) && !error.hint().is_empty(), "{at}: {text}");
                }
            }
        }
        assert!(read_so_far > 30, "{name}: {read_so_far} of 111 cuts are read that far");
    }
}

/// Expected result of importing a modified file.
enum Outcome {
    /// The unchanged flight.
    Same,
    /// The flight or a part of it, with a warning that contains this text.
    Warned(&'static str),
    /// An error that contains this text.
    Refused(&'static str),
}
use Outcome::{Refused, Same, Warned};

fn check(name: &str, what: &str, bytes: &[u8], wanted: &Outcome, logged: &Flight) {
    let found = read(name, bytes);
    match (wanted, found) {
        (Same, Ok(found)) => {
            assert!(farthest_m(&found, logged) < 1e-5, "{what}: {} m", farthest_m(&found, logged));
            assert_eq!(found.samples.len(), logged.samples.len(), "{what}");
        }
        (Warned(text), Ok(found)) => {
            let said = found.warnings.iter().any(|warning| warning.to_string().contains(text));
            assert!(said, "{what}: no {text:?} in {:?}", found.warnings);
            let finite = |s: &FlightSample| s.position_m.iter().all(|value| value.is_finite());
            assert!(found.samples.iter().all(finite), "{what}");
        }
        (Refused(text), Err(error)) => {
            let message = error.to_string();
            assert!(message.contains(text), "{what}: no {text:?} in {message}");
            assert!(message.contains(name) && !error.hint().is_empty(), "{what}: {message}");
        }
        (_, Ok(found)) => panic!("{what} is read: {:?}", found.warnings),
        (_, Err(error)) => panic!("{what} is refused: {error}"),
    }
}

/// Returns the text with a change of line `n`, counted from 0.
fn line(text: &str, n: usize, change: impl Fn(&str) -> String) -> String {
    let lines = text.lines().enumerate();
    let lines = lines.map(|(i, line)| if i == n { change(line) } else { line.to_owned() });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

/// Returns the text with a cell replaced. Line and column are counted from 0.
fn cell(text: &str, n: usize, column: usize, with: &str) -> String {
    line(text, n, |line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[column] = with;
        cells.join(",")
    })
}

#[test]
fn broken_tables_are_read_with_a_warning_or_refused() {
    let mut flight = flown("S");
    shorten(&mut flight, 600);
    let text = plain(&flight);
    let body: Vec<&str> = text.lines().skip(1).collect();
    let head = text.lines().next().unwrap();
    let put = |rows: &[&str]| format!("{head}\n{}\n", rows.join("\n"));
    let (first, second) = body.split_at(200);
    let reversed: Vec<&str> = body.iter().rev().copied().collect();
    let doubled: Vec<&str> = body.iter().flat_map(|row| [*row, *row]).collect();
    let far = format!("1e9{}", ",0".repeat(6));
    let cases = [
        ("a name in quotes", text.replacen("x,", "\"x\",", 1), Same),
        ("capitals", text.replacen(head, &head.to_uppercase(), 1), Same),
        ("empty lines", text.replace('\n', "\n\n"), Same),
        ("a comment", line(&text, 5, |row| format!("# gust\n{row}")), Same),
        ("separators at the end", text.replace('\n', ",\n"), Same),
        ("no last line end", text.trim_end().to_owned(), Warned("no line end")),
        (
            "an unknown column",
            text.replacen(head, &head.replace("roll", "roll,mood"), 1),
            Refused("7 of 8"),
        ),
        ("not a number", cell(&text, 9, 2, "NaN"), Warned("without a number")),
        ("an empty cell", cell(&text, 9, 2, ""), Warned("without a number")),
        ("infinity", cell(&text, 9, 3, "inf"), Warned("without a number")),
        ("a huge number", cell(&text, 9, 3, "1e300"), Warned("without a number")),
        ("a time that is none", cell(&text, 9, 0, "NaN"), Warned("does not rise")),
        ("each row twice", put(&doubled), Warned("does not rise")),
        ("rows in reverse", put(&reversed), Refused("earlier than in the row above")),
        ("parts exchanged", put(&[second, first].concat()), Warned("the clock restarts")),
        ("no height", text.replacen(",z,", ",depth,", 1), Warned("not in the log: position")),
        ("millimeters", scaled(&flight, 1000.0), Refused("faster than 15 m/s")),
        ("a word in a cell", cell(&text, 9, 2, "north"), Refused(":10: column y")),
        ("lines that end in CR", text.replace('\n', "\r"), Same),
        ("blanks", text.replace(',', " "), Same),
        (
            "a short row",
            line(&text, 9, |row| row[..row.rfind(',').unwrap()].into()),
            Refused(":10"),
        ),
        ("a long row", line(&text, 9, |row| format!("{row},1")), Refused(":10")),
        ("no time", text.replacen("t,", "moment,", 1), Refused("a column of times")),
        ("a year later", format!("{text}{far}\n"), Refused("of log")),
        ("zeros of a card", format!("{text}{}", "\0".repeat(4096)), Warned("cut off")),
        ("nothing known", text.replacen(head, "t,a,b,c,d,e,f", 1), Refused("columns")),
    ];
    for (what, changed, wanted) in cases {
        check("log.csv", what, changed.as_bytes(), &wanted, &flight);
    }
    check(
        "log.csv",
        "Latin 1",
        &[text.as_bytes(), b"# 20 \xb0C\n"].concat(),
        &Warned("Windows-1252"),
        &flight,
    );
}

/// Returns a table of positions in another unit, with column names that contain no unit.
fn scaled(flight: &Flight, factor: f64) -> String {
    let mut other = flight.clone();
    other.edit(|other| other.samples.iter_mut().for_each(|sample| sample.position_m *= factor));
    plain(&other)
}

#[test]
fn broken_json_is_read_with_a_warning_or_refused() {
    let mut flight = flown("S");
    shorten(&mut flight, 400);
    let text = json_2022(&flight, nothing);
    let first = format!("{:?}", flight.samples[0].position_m.x);
    let with = |from: &str, to: &str| text.replacen(from, to, 1);
    let data = format!("\"data\": [{first}, ");
    let nan = with(&data, "\"data\": [NaN, ");
    let cases = [
        ("lines of Windows", text.replace('\n', "\r\n"), Same),
        ("a byte order mark", format!("\u{feff}{text}"), Same),
        (
            "an unknown variable",
            with("{", "{\"pm.vbat\": {\"time\": [41000], \"data\": [3.7]}, "),
            Same,
        ),
        ("not a number", nan, Warned("without a number")),
        ("minus infinity", with(&data, "\"data\": [-Infinity, "), Warned("without a number")),
        ("nothing", with(&data, "\"data\": [null, "), Warned("without a number")),
        ("a value too many", with(&data, &format!("{data}{first}, ")), Warned("")),
        ("a text among numbers", with(&data, "\"data\": [\"north\", "), Refused("stateEstimate.x")),
        ("lists in lists", with(&data, "\"data\": [[1], "), Refused("stateEstimate.x")),
        (
            "a missing comma",
            with("}, \"stateEstimate.y\"", "} \"stateEstimate.y\"").replacen(
                "},\n\"stateEstimate.y\"",
                "}\n\"stateEstimate.y\"",
                1,
            ),
            Refused("log.json:2"),
        ),
        ("text after the end", format!("{text} and so on"), Refused("log.json")),
        ("a list", format!("[{text}]"), Refused("log.json")),
        ("no variable", "{}".into(), Refused("no column")),
        ("a number too large", with(&data, "\"data\": [1e999, "), Refused("log.json")),
        ("depth", format!("{{\"a\": {}", "[".repeat(100_000)), Refused("log.json")),
    ];
    for (what, changed, wanted) in cases {
        check("log.json", what, changed.as_bytes(), &wanted, &flight);
    }
}

#[test]
fn broken_usd_logs_are_refused_or_recovered() {
    let mut flight = flown("S");
    shorten(&mut flight, 400);
    let recover = ImportOptions { damaged: Damaged::Recover, ..ImportOptions::default() };
    for version in [1, 2] {
        let body = usd_body(&flight, version);
        let n_head = usd_body(&Flight::default(), version).len();
        let changed = |at: usize, bytes: &[u8]| {
            let mut log = body.clone();
            log[at..at + bytes.len()].copy_from_slice(bytes);
            with_crc(log)
        };
        check("log00", "whole", &with_crc(body.clone()), &Same, &flight);
        let mut wrong = with_crc(body.clone());
        *wrong.last_mut().unwrap() ^= 1;
        check("log00", "a wrong CRC", &wrong, &Refused("CRC"), &flight);
        let found = imported(&[("log00", &wrong)], &recover).unwrap();
        assert!(farthest_m(&found, &flight) < 1e-5, "recovered");
        assert!(
            found.warnings.iter().any(|w| w.to_string().contains("CRC")),
            "{:?}",
            found.warnings
        );

        // This is the offset of sample 200's first record. Each sample takes four record headers
        // and 44 bytes of values.
        let record = n_head + 200 * (4 * if version == 1 { 6 } else { 10 } + 44);
        let unknown = changed(record, &999_u16.to_le_bytes());
        check("log00", "an unknown event", &unknown, &Refused("999"), &flight);
        let found = imported(&[("log00", &unknown)], &recover).unwrap();
        assert!(found.samples.len() > 100 && farthest_m(&found, &flight) < 1e-5, "recovered");

        check("log00", "version 3", &changed(1, &[3, 0]), &Refused("version 3"), &flight);
        check("log00", "event types galore", &changed(3, &[255; 2]), &Refused("byte"), &flight);
        let at = body.windows(2).position(|two| two == b"(f").unwrap();
        check("log00", "an unknown type", &changed(at, b"(s"), &Refused("type"), &flight);
        check("log00", "half a name", &changed(at, b"\0\0"), &Refused("byte"), &flight);
        check(
            "log00",
            "a head alone",
            &with_crc(body[..n_head].to_vec()),
            &Refused("no column"),
            &flight,
        );
        check("log00", "one byte", &body[..1], &Refused("byte 1"), &flight);
    }
}
