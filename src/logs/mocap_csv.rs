//! Tables of motion captures' programs, made into plain ones.
//!
//! Understood: Motive (a first line `Format Version,…`; lines of types, names and properties above
//! `Frame,Time (Seconds)`; y up) and Vicon (`Objects`, `Segments` or `Trajectories`, the frames per
//! second, names, `Frame,Sub Frame,…` and units; z up, rotations left out). The one rigid body is
//! taken, or the one marker where there is no body; of more, which one is asked for.

use std::collections::BTreeSet;

use super::Axes;
use noctograph_core::error::{Error, Result};

/// Lines of a head.
const HEAD_LINES: usize = 12;

/// A plain table: its head in one line, its lines at their places.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) text: Vec<u8>,
    pub(super) axes: Axes,
    pub(super) format: &'static str,
    /// Time of a frame, where rows have no other.
    pub(super) period_s: Option<f64>,
    pub(super) notes: Vec<String>,
}

/// Makes the table of a motion capture a plain one; `None` where it is none.
pub(super) fn table(text: &[u8], file: &str) -> Result<Option<Table>> {
    let start = String::from_utf8_lossy(&text[..text.len().min(1 << 16)]);
    let lines: Vec<Vec<&str>> = start
        .lines()
        .take(HEAD_LINES)
        .map(|line| {
            line.split([',', ';', '\t']).map(|cell| cell.trim().trim_matches('"')).collect()
        })
        .collect();
    let is_head = |line: &Vec<&str>| line.len() > 2 && line[0] == "Frame";
    let Some(head) = lines.iter().position(is_head) else { return Ok(None) };
    match lines[0][0] {
        "Format Version" => motive(text, file, &lines, head).map(Some),
        "Objects" | "Segments" | "Trajectories" | "Model Outputs" => {
            vicon(text, file, &lines, head).map(Some)
        }
        _ => Ok(None),
    }
}

fn motive(text: &[u8], file: &str, lines: &[Vec<&str>], head: usize) -> Result<Table> {
    let value = |key: &str| {
        let place = lines[0].iter().position(|cell| *cell == key)?;
        lines[0].get(place + 1).copied()
    };
    let unit = match value("Length Units") {
        None | Some("Meters") => "m",
        Some("Millimeters") => "mm",
        Some("Centimeters") => "cm",
        Some(other) => return Err(refused(file, &format!("Length Units {other}"), "Meters")),
    };
    if let Some(space) = value("Coordinate Space").filter(|space| *space != "Global") {
        return Err(refused(file, &format!("Coordinate Space {space}"), "Global"));
    }
    // Of the lines above: types, names, numbers, properties.
    let above: Vec<&Vec<&str>> = lines[1..head].iter().filter(|line| line.len() > 2).collect();
    let find = |wanted: &[&str]| {
        above.iter().position(|line| line[2..].iter().any(|cell| wanted.contains(cell)))
    };
    let cell = |line: Option<usize>, index: usize| {
        line.and_then(|line| above.get(line)?.get(index).copied()).unwrap_or_default()
    };
    let (types, properties) = (find(&["Rigid Body", "Marker"]), find(&["Position"]));
    let names = types.map(|types| types + 1);
    let has_body = types.is_some_and(|types| above[types].contains(&"Rigid Body"));
    let kind = if has_body { "Rigid Body" } else { "Marker" };
    let of_kind = |index: &usize| cell(types, *index) == kind;
    let bodies = (2..lines[head].len()).filter(of_kind).map(|index| cell(names, index));
    one_of(file, kind, bodies)?;
    let quaternion = value("Rotation Type").is_none_or(|kind| kind == "Quaternion");
    let (mut titles, mut others) = (vec!["index".to_owned(), "t_s".to_owned()], 0);
    for (index, axis) in lines[head].iter().enumerate().skip(2) {
        let axis = axis.to_lowercase();
        titles.push(match cell(properties, index) {
            "Position" if of_kind(&index) => format!("{axis}_{unit}"),
            "Rotation" if of_kind(&index) && quaternion => format!("q{axis}"),
            _ => {
                others += 1;
                format!("motive.column{}", index + 1)
            }
        });
    }
    let mut notes = Vec::new();
    if !quaternion {
        notes.push("rotations are not quaternions: they are not read (export them as such)".into());
    }
    if others > 0 {
        notes
            .push(format!("{others} columns of Motive beside the pose are kept as motive.column…"));
    }
    let text = plain(text, head, head, &titles);
    Ok(Table { text, axes: Axes::YUp, format: "Motive", period_s: None, notes })
}

fn vicon(text: &[u8], file: &str, lines: &[Vec<&str>], head: usize) -> Result<Table> {
    let rate_hz = lines.get(1).and_then(|line| line[0].parse::<f64>().ok());
    let Some(rate_hz) = rate_hz.filter(|hz| (0.1..=1e5).contains(hz)) else {
        return Err(refused(file, "no frames per second in line 2", "a number of them"));
    };
    let names = lines[head - 1].iter().copied().filter(|name| !name.is_empty());
    one_of(file, lines[0][0], names)?;
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
    let notes = if others > 0 { vec![note] } else { Vec::new() };
    let text = plain(text, head, head + 1, &titles);
    Ok(Table { text, axes: Axes::ZUp, format: "Vicon", period_s: Some(1.0 / rate_hz), notes })
}

/// Refuses a table of more than one body.
fn one_of<'a>(file: &str, kind: &str, bodies: impl Iterator<Item = &'a str>) -> Result<()> {
    let bodies: BTreeSet<&str> = bodies.collect();
    if bodies.len() == 1 {
        return Ok(());
    }
    let names = bodies.iter().copied().collect::<Vec<_>>().join(", ");
    let found = format_args!("{} ({names})", bodies.len());
    Err(Error::input(kind, found, "one", "export the drone's rigid body alone").at(file, None))
}

fn refused(file: &str, found: &str, wanted: &str) -> Error {
    Error::input(file, found, wanted, "export the take again with that setting")
}

/// The text with its titles in line `head`, and nothing in the others up to `last`.
fn plain(text: &[u8], head: usize, last: usize, titles: &[String]) -> Vec<u8> {
    let mut plain = Vec::with_capacity(text.len() + 64);
    for (index, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
        if index == head {
            plain.extend(titles.join(",").into_bytes());
        } else if index > last {
            plain.extend(line);
            continue;
        }
        plain.push(b'\n');
    }
    plain
}
