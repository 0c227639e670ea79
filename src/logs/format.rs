//! Recognizes the format of a log from its contents.

use super::cfclient_csv::is_cfclient;
use super::mocap_csv::{Capture, capture};
use super::{unknown, usd};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, Text};

/// Titles of the first columns of a flight file.
const FLIGHT: [&str; 5] = ["time_s", "x_m", "y_m", "z_m", "yaw_rad"];

/// Format of a log, with the text and header that were parsed to recognize it.
pub(super) enum Format<'a> {
    Card,
    Json(Text<'a>),
    Flight(Text<'a>, Head),
    Cfclient(Text<'a>, Head),
    /// Any other table, possibly from motion capture.
    Table(Text<'a>, Head, Option<Capture>),
}

impl<'a> Format<'a> {
    /// Recognizes the format of a log from its first bytes and its header. Known formats of other
    /// programs, some of which look like tables, are rejected first. Returns [`Error::Input`] for
    /// an unknown format.
    pub(super) fn recognized(bytes: &'a [u8], file: &str) -> Result<Self> {
        /// Number of bytes of an unknown file that the error shows.
        const SHOWN: usize = 24;
        refuse_foreign(bytes, file)?;
        if bytes.first() == Some(&usd::MAGIC) {
            return Ok(Self::Card);
        }
        // JSON begins with a bracket, and a table with a header.
        let text = Text::decode(bytes);
        let content = text.bytes.trim_ascii_start();
        if content.starts_with(b"{") || content.starts_with(b"[") {
            return Ok(Self::Json(text));
        }
        if content.is_empty() {
            return Err(unknown(file, "an empty file"));
        }
        if let Some((head, captured)) = capture(&text.bytes, file)? {
            return Ok(Self::Table(text, head, Some(captured)));
        }
        let head = Head::find(&text.bytes);
        let is_odd = |c: char| c.is_control() || c == '\u{fffd}';
        if is_flight(&head) {
            Ok(Self::Flight(text, head))
        } else if head.n_columns < 2 || head.titles.iter().any(|title| title.contains(is_odd)) {
            let start = String::from_utf8_lossy(&content[..content.len().min(SHOWN)]);
            Err(unknown(file, format_args!("a file that begins with {start:?}")))
        } else if is_cfclient(&head) {
            Ok(Self::Cfclient(text, head))
        } else {
            Ok(Self::Table(text, head, None))
        }
    }
}

/// True for a flight file. Its first columns are a pose, or its first column is the time and
/// another column contains letters. A table with ranges is an imported log instead.
fn is_flight(head: &Head) -> bool {
    let begins = head.titles.first().is_some_and(|title| title == FLIGHT[0]);
    head.titles.starts_with(&FLIGHT.map(str::to_owned))
        || begins && head.has("letter") && !has_ranges(head)
}

/// True if a table has columns of ranges.
fn has_ranges(head: &Head) -> bool {
    head.titles.iter().any(|title| title.starts_with("ranging."))
}

/// Returns true for a flight file with ranges, an imported log that no longer uses the log's clock.
pub(super) fn is_imported(head: &Head) -> bool {
    head.has(FLIGHT[0]) && head.has("letter") && has_ranges(head)
}

const BY_CAPTURE: &str =
    "export the rigid body as CSV in the motion capture's program, with a header t,x,y,z";
const BY_PLOTJUGGLER: &str = "open the file in PlotJuggler, export the pose as CSV, and import \
                              the CSV file";
const BY_MAVLOGDUMP: &str = "convert the log with `mavlogdump.py --types XKF1 --format csv FILE` \
                             (of pymavlink), rename PN, PE and PD to x, y and z, and import the \
                             result";

const BY_NAME: &str =
    "write a table with the time, x, y and z of each state in columns, below a header t,x,y,z";
const BY_POLYNOMIAL: &str = "this is a plan, not a flight: evaluate the polynomials at 100 Hz, \
                             and write t,x,y,z,yaw";

/// First bytes of foreign formats, with the name of each format and advice.
const FORMATS: [(&[u8], &str, &str); 31] = [
    (
        b"ULog\x01\x12\x35",
        "a PX4 ULog",
        "import the vehicle_local_position file that `ulog2csv FILE` writes",
    ),
    (b"\xa3\x95", "a DataFlash log of ArduPilot", BY_MAVLOGDUMP),
    (b"FMT, 128,", "an ArduPilot DataFlash log, as text", BY_MAVLOGDUMP),
    (b"#ROSBAG V", "a ROS 1 rosbag", "import the output of `rostopic echo -b FILE -p /TOPIC`"),
    (b"SQLite format 3\0", "an SQLite file, such as a ROS 2 rosbag", BY_PLOTJUGGLER),
    (b"\x89MCAP", "an MCAP file, such as a ROS 2 rosbag", BY_PLOTJUGGLER),
    (b"PAR1", "a Parquet file", "write CSV: pandas.read_parquet(FILE).to_csv(\"log.csv\")"),
    (b"\x89HDF", "an HDF5 file", "write the series as CSV with a header t,x,y,z"),
    (b"MATLAB 5.0", "a MATLAB file", "write CSV with writetable(T, \"log.csv\"), and import it"),
    (b"\x93NUMPY", "a NumPy file", "write the log with numpy.savetxt, and a header t,x,y,z"),
    (b"PK\x03\x04", "a zip file or a spreadsheet", "unpack the file, or save the sheet as CSV"),
    (b"\x1f\x8b", "a gzip file", "unpack the file with `gunzip FILE`"),
    (b"\x02P", "a C3D file", BY_CAPTURE),
    (b"NO_OF_FRAMES", "a Qualisys TSV file", BY_CAPTURE),
    (b"PathFileType", "a TRC file with markers", BY_CAPTURE),
    (b"HIERARCHY", "a BVH file with a skeleton", BY_CAPTURE),
    (b"\x80", "a Python pickle", "write the log as CSV with a header t,x,y,z"),
    (b"<", "a file in XML or HTML", "write the track as CSV with a header t,x,y,z"),
    (b"\xd0\xcf\x11\xe0", "an old spreadsheet", "save the sheet as CSV"),
    (b"\xfd\x09\0\0", "a MAVLink telemetry log", "convert it with `mavlogdump.py --format csv`"),
    (
        b"H Product:Blackbox",
        "a Betaflight log",
        "log the position as well, because this log contains none",
    ),
    (b"LabVIEW Measurement", "a LabVIEW file", "keep only the table, with a header t,x,y,z"),
    (b"% program", "an RTKLIB solution", "write east, north, up in meters as t,x,y,z"),
    (b"$G", "sentences of NMEA", "write east, north, up in meters as t,x,y,z"),
    (b"%PDF", "a PDF file", "import the log itself"),
    (b"pitch:", "the state of a Tello, as names and values", BY_NAME),
    (b"mid:", "the state of a Tello, as names and values", BY_NAME),
    (b"Duration,x^0", "a polynomial trajectory (uav_trajectories)", BY_POLYNOMIAL),
    (b"duration,x^0", "a polynomial trajectory (uav_trajectories)", BY_POLYNOMIAL),
    (b"Frame #", "a NatNet printout", BY_CAPTURE),
    (b"{\\rtf", "an RTF document", "save the log as plain text, with a header t,x,y,z"),
];

/// Returns [`Error::Input`] for a file in one of [`FORMATS`], with a hint on converting it to a
/// table.
fn refuse_foreign(bytes: &[u8], file: &str) -> Result<()> {
    let foreign = FORMATS.iter().find(|(first_bytes, ..)| bytes.starts_with(first_bytes));
    foreign.map_or(Ok(()), |(_, what, hint)| {
        Err(Error::input(file, *what, "a supported log: text, JSON or a µSD log", *hint))
    })
}
