//! Parses the headers of motion capture tables in two formats.
//!
//! - Motive: the first line is `Format Version,…`, followed by lines of types, names and properties
//!   above `Frame,Time (Seconds)`. The y-axis points up.
//! - Vicon: `Objects`, `Segments` or `Trajectories`, the frame rate, names, `Frame,Sub Frame,…` and
//!   units. The z-axis points up, and rotations are ignored.
//!
//! The file must contain exactly one rigid body or, without bodies, exactly one marker.

use std::collections::BTreeSet;

use super::Axes;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, Separator};

/// Number of lines at the start of a file among which the line of titles is searched.
const HEAD_LINES: usize = 12;

/// Properties of a motion capture table, as given by its header.
#[derive(Debug)]
pub(super) struct Capture {
    pub(super) axes: Axes,
    pub(super) format: &'static str,
    /// Time between frames, if there is no column of times.
    pub(super) period_s: Option<f64>,
    pub(super) warnings: Vec<Diagnostic>,
}

/// Header lines, split into cells.
type Lines<'a> = [Vec<&'a str>];

/// Parses the header of a motion capture table. Returns `None` for other tables. Returns
/// [`Error::Input`] for a table that is recognized but not supported.
pub(super) fn capture(text: &[u8], file: &str) -> Result<Option<(Head, Capture)>> {
    /// Number of bytes in which the header must end.
    const HEAD_BYTES: usize = 1 << 16;
    let start = String::from_utf8_lossy(&text[..text.len().min(HEAD_BYTES)]);
    let cells = start.lines().take(HEAD_LINES).map(|line| line.split([',', ';', '\t']));
    let lines: Vec<Vec<&str>> =
        cells.map(|cells| cells.map(|cell| cell.trim().trim_matches('"')).collect()).collect();
    // The titles are in the line that begins with Frame.
    let head = lines.iter().position(|line| line[0] == "Frame");
    let read = match lines.first().map(|line| line[0]) {
        Some("Format Version") => motive,
        Some("Objects" | "Segments" | "Trajectories" | "Model Outputs") => vicon,
        _ => return Ok(None),
    };
    let Some(head) = head else {
        let wanted = "a line that begins with Frame, above the rows";
        let hint = "export the take again, with its header";
        return Err(Error::input(file, "only the header of a motion capture", wanted, hint));
    };
    let line = start.lines().nth(head).unwrap_or_default();
    read(file, &lines, head, Separator::most_in(line.as_bytes())).map(Some)
}

/// Reads a Motive header. `head` is the index of the line of titles. Returns the titles of this
/// program, and the capture's axes. Returns [`Error::Input`] for unsupported units and frames, and
/// for several bodies.
fn motive(
    file: &str,
    lines: &Lines<'_>,
    head: usize,
    separator: Separator,
) -> Result<(Head, Capture)> {
    let unit = motive_unit(file, &lines[0])?;
    // The lines above it contain types, names, numbers and properties.
    let above: Vec<&Vec<&str>> = lines[1..head].iter().filter(|line| line.len() > 2).collect();
    let [types_line, properties_line] =
        [&["Rigid Body", "Marker"][..], &["Position"]].map(|wanted| {
            above.iter().position(|line| line[2..].iter().any(|cell| wanted.contains(cell)))
        });
    let names_line = types_line.map(|line| line + 1);
    let [types, names, properties] = [types_line, names_line, properties_line]
        .map(|line| line.and_then(|line| above.get(line)).map_or(&[][..], |line| line));
    let kind = if types.contains(&"Rigid Body") { "Rigid Body" } else { "Marker" };
    let bodies = (2..lines[head].len()).filter(|index| types.get(*index) == Some(&kind));
    check_one(file, kind, bodies.map(|index| names.get(index).copied().unwrap_or_default()))?;
    let rotation = motive_setting(&lines[0], "Rotation Type");
    let are_quaternions = rotation.is_none_or(|kind| kind == "Quaternion");
    let (mut titles, mut others) = (vec!["index".to_owned(), "t_s".to_owned()], 0);
    for (index, axis) in lines[head].iter().enumerate().skip(2) {
        let (axis, is_meant) = (axis.to_lowercase(), types.get(index) == Some(&kind));
        titles.push(match properties.get(index) {
            Some(&"Position") if is_meant => format!("{axis}_{unit}"),
            Some(&"Rotation") if is_meant && are_quaternions => format!("q{axis}"),
            _ => {
                others += 1;
                format!("motive.column{}", index + 1)
            }
        });
    }
    let turns =
        "rotations are not read, because they are not quaternions: export them as quaternions";
    let kept = format!("{others} columns of Motive besides the pose are kept as motive.column…");
    let notes = [(!are_quaternions).then(|| turns.to_owned()), (others > 0).then_some(kept)];
    let warnings = Diagnostic::warnings("not-read", notes.into_iter().flatten());
    let head = Head::named(titles, separator, head + 1);
    Ok((head, Capture { axes: Axes::YUp, format: "Motive", period_s: None, warnings }))
}

/// Returns the unit of length that the first line of a Motive header states, or meters if it states
/// none. Returns [`Error::Input`] for another unit, and for a frame that is not the global one.
fn motive_unit(file: &str, header: &[&str]) -> Result<&'static str> {
    let space = motive_setting(header, "Coordinate Space");
    if let Some(space) = space.filter(|space| *space != "Global") {
        return Err(setting_error(file, &format!("Coordinate Space {space}"), "Global"));
    }
    match motive_setting(header, "Length Units") {
        None | Some("Meters") => Ok("m"),
        Some("Millimeters") => Ok("mm"),
        Some("Centimeters") => Ok("cm"),
        Some(other) => Err(setting_error(file, &format!("Length Units {other}"), "Meters")),
    }
}

/// Returns the cell after a key in the first line of a Motive header.
fn motive_setting<'a>(header: &[&'a str], key: &str) -> Option<&'a str> {
    let place = header.iter().position(|cell| *cell == key)?;
    header.get(place + 1).copied()
}

/// Reads a Vicon header. `head` is the index of the line of titles. Returns the titles of this
/// program, and the capture's axes and period. Returns [`Error::Input`] for a missing frame rate,
/// and for several bodies.
fn vicon(
    file: &str,
    lines: &Lines<'_>,
    head: usize,
    separator: Separator,
) -> Result<(Head, Capture)> {
    /// Plausible numbers of frames per second.
    const RATES_HZ: std::ops::RangeInclusive<f64> = 0.1..=1e5;
    let rate_hz = lines.get(1).and_then(|line| line[0].parse::<f64>().ok());
    let Some(rate_hz) = rate_hz.filter(|hz| RATES_HZ.contains(hz)) else {
        return Err(setting_error(file, "no frames per second in line 2", "a number of them"));
    };
    let above = head.checked_sub(1).and_then(|line| lines.get(line)).into_iter().flatten();
    let names = above.copied().filter(|name| !name.is_empty());
    check_one(file, lines[0][0], names)?;
    // The units in the line below are appended to the titles.
    let (mut titles, mut others) = (Vec::new(), 0);
    for (index, title) in lines[head].iter().enumerate() {
        let unit = lines.get(head + 1).and_then(|units| units.get(index));
        let unit = unit.filter(|unit| !unit.is_empty()).unwrap_or(&"mm");
        titles.push(match *title {
            "Frame" => "index".to_owned(),
            "X" | "TX" => format!("x [{unit}]"),
            "Y" | "TY" => format!("y [{unit}]"),
            "Z" | "TZ" => format!("z [{unit}]"),
            "Sub Frame" | "" => format!("vicon.column{}", index + 1),
            _ => {
                others += 1;
                format!("vicon.{title}")
            }
        });
    }
    let note = format!("{others} columns of rotations of Vicon are not read, and kept as vicon.…");
    let warnings = Diagnostic::warnings("not-read", (others > 0).then_some(note));
    let head = Head::named(titles, separator, head + 2);
    let period_s = Some(1.0 / rate_hz);
    Ok((head, Capture { axes: Axes::ZUp, format: "Vicon", period_s, warnings }))
}

/// Returns [`Error::Input`] unless there is exactly one body.
fn check_one<'a>(file: &str, kind: &str, bodies: impl Iterator<Item = &'a str>) -> Result<()> {
    let bodies: BTreeSet<&str> = bodies.collect();
    if bodies.len() == 1 {
        return Ok(());
    }
    let names = bodies.iter().copied().collect::<Vec<_>>().join(", ");
    let count = match bodies.len() {
        0 => "none in the take".to_owned(),
        n => format!("{n} ({names})"),
    };
    Err(Error::input(kind, count, "one", "export the drone's rigid body alone").in_file(file, None))
}

/// Returns the error for an export setting that is not supported.
fn setting_error(file: &str, setting: &str, wanted: &str) -> Error {
    Error::input(file, setting, wanted, "export the take again with that setting")
}
