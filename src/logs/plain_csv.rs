//! Plain CSV: t, x, y, z and others, under their usual names; range logs of a drone with a Loco deck.
//!
//! Also the recording of crazyswarm2's simulation (`timestamp,x,y,z,qw,qx,qy,qz`), and files without
//! a header (t, x, y, z). Names may carry their unit (`x_mm`, `yaw_deg`, `t_ms`, `x [m]`); without
//! one, they are meters, seconds and radians, unless the numbers are impossible in these units.
//!
//! A row of a range log (`index,timestamp,ranging.distance0,ranging.distance2 …`, meters) brings one
//! new range, and its stamp is a date or a number: the flight keeps the rows with their own times, and
//! has no position.

use super::recording::{Block, Column, Recording};
use super::sheet::Sheet;
use crate::error::{Error, Result};
use crate::files::Budget;
use crate::statistics::median;

/// Names of the columns where a file has no header.
const UNNAMED: [&str; 4] = ["t", "x", "y", "z"];

/// Our name of a column and its usual names, in lower case and without unit; `*` stands for each of
/// the letters before them.
const NAMES: [(&str, &str, &[&str]); 13] = [
    (" ", "t", &["t", "time", "timestamp", "stamp", "date", "datetime", "seconds", "sec"]),
    ("xyz", "*_m", &["*", "p*", "p_*", "pos_*", "position_*", "*_pos"]),
    ("z", "*_m", &["height"]),
    (" ", "yaw_rad", &["yaw", "psi"]),
    (" ", "pitch_rad", &["pitch", "theta"]),
    (" ", "roll_rad", &["roll", "phi"]),
    ("wxyz", "q*", &["q*", "q_*"]),
    ("xyz", "v*_world_m_s", &["v*", "v_*", "vel_*"]),
    ("xyz", "v*_body_m_s", &["v*_body"]),
    ("xyz", "w*_body_rad_s", &["w*", "w_*", "w*_body"]),
    ("xyz", "*_design_m", &["*_design", "*_des", "*_d", "*d", "*_ref", "*_sp", "*_setpoint"]),
    ("1234", "m*", &["m*", "m_*", "motor*"]),
    (" ", "index", &["index", "row", ""]),
];

/// Units as endings of names, the longest first, and their size in SI units.
const UNITS: [(&str, f64); 14] = [
    ("_rad_s", 1.0),
    ("_deg_s", std::f64::consts::PI / 180.0),
    ("_mm_s", 1e-3),
    ("_m_s", 1.0),
    ("_rad", 1.0),
    ("_deg", std::f64::consts::PI / 180.0),
    ("_mm", 1e-3),
    ("_cm", 1e-2),
    ("_ms", 1e-3),
    ("_us", 1e-6),
    ("_ns", 1e-9),
    ("_sec", 1.0),
    ("_m", 1.0),
    ("_s", 1.0),
];

/// Beginning of the names of range columns.
const RANGE: &str = "ranging.distance";

/// Longest time over which rows of one stamp are spread: stamps may have whole seconds.
const ROW_S: f64 = 1.0;

/// Reads a plain CSV file.
pub(super) fn read(text: &[u8], file: &str, budget: &Budget) -> Result<Recording> {
    let Sheet { header, columns, mut warnings } = Sheet::read(text, file, &UNNAMED, budget)?;
    let (mut time_s, mut named) = (None, Vec::new());
    for (title, mut values) in header.iter().zip(columns) {
        let (name, factor) = meaning(title);
        if name == "t" && time_s.is_none() {
            let unit_s = factor.unwrap_or_else(|| seconds_per_unit(title, &values));
            if factor.is_none() && unit_s != 1.0 {
                warnings.push(format!("column {title}: taken as {unit_s} s a unit"));
            }
            time_s = Some(values.into_iter().map(|t| t * unit_s).collect::<Vec<f64>>());
            continue;
        }
        for value in &mut values {
            *value *= factor.unwrap_or(1.0);
        }
        let angle = ["yaw_rad", "pitch_rad", "roll_rad"].contains(&&*name);
        named.push((Column { name, values }, angle && factor.is_none()));
    }
    let Some(mut time_s) = time_s else {
        let place = format!("{file}:1");
        let wanted = "a column of times (t, time, time_s, timestamp, t_ms …)";
        return Err(Error::input(place, header.join(","), wanted, "name the column of times t"));
    };
    if header.iter().any(|title| title.starts_with(RANGE)) && spread_rows(&mut time_s) {
        warnings.push("several rows share a stamp: they are spread evenly up to the next".into());
    }
    degrees(&mut named, &mut warnings);
    let columns = named.into_iter().map(|(column, _)| column).collect();
    let block = Block { name: "csv".into(), time_s, columns, ..Block::default() };
    Ok(Recording { file: file.to_owned(), blocks: vec![block], warnings, ..Recording::default() })
}

/// Our name of a title, and the size of its unit where it names one; an unknown title stays as it
/// is.
pub(super) fn meaning(title: &str) -> (String, Option<f64>) {
    let lower = title.to_lowercase().replace(['[', '(', ' '], "_").replace([']', ')'], "");
    let mut lower = lower.replace('/', "_");
    while lower.contains("__") {
        lower = lower.replace("__", "_");
    }
    let known = |name: &str| {
        NAMES.iter().find_map(|(letters, ours, names)| {
            let with =
                |text: &str, letter: char| text.replace('*', letter.encode_utf8(&mut [0; 4]));
            let found = |letter: &char| names.iter().any(|usual| with(usual, *letter) == name);
            letters.chars().find(found).map(|letter| with(ours, letter))
        })
    };
    if let Some(ours) = known(&lower) {
        return (ours, None);
    }
    let units = UNITS.iter().filter_map(|(end, factor)| Some((lower.strip_suffix(end)?, *factor)));
    let mut meant = units.filter_map(|(name, factor)| Some((known(name)?, Some(factor))));
    meant.next().unwrap_or_else(|| (title.to_owned(), None))
}

/// Angles without a unit that go beyond a full turn are degrees.
fn degrees(columns: &mut [(Column, bool)], warnings: &mut Vec<String>) {
    let beyond = |value: &f64| value.abs() > std::f64::consts::TAU;
    if !columns.iter().any(|(column, open)| *open && column.values.iter().any(beyond)) {
        return;
    }
    warnings.push("yaw, pitch and roll go beyond a full turn of 2π: taken as degrees".into());
    for (column, _) in columns.iter_mut().filter(|(_, open)| *open) {
        for value in &mut column.values {
            *value = value.to_radians();
        }
    }
}

/// Size of the unit of a column of times. Without a unit in its name, whole numbers in steps of one
/// or more are ms (no log is that slow, but one of several rows in a second), in steps of a thousand
/// or more µs, of a million or more ns.
fn seconds_per_unit(title: &str, stamps: &[f64]) -> f64 {
    let lower = title.to_lowercase();
    if let Some((_, factor)) = UNITS.iter().find(|(end, _)| lower.ends_with(end)) {
        return *factor;
    }
    let steps = stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let whole = stamps.iter().filter(|t| t.is_finite()).all(|t| t.fract() == 0.0);
    let is_rising = stamps.windows(2).all(|pair| pair[1] > pair[0]);
    match median(steps) {
        Some(step) if whole && step >= 1e6 => 1e-9,
        Some(step) if whole && step >= 1e3 => 1e-6,
        Some(step) if whole && (step > 1.0 || is_rising) => 1e-3,
        _ => 1.0,
    }
}

/// Spreads rows of one stamp evenly up to the next stamp, or over a second; returns whether there
/// are any.
fn spread_rows(time_s: &mut [f64]) -> bool {
    let (mut first, mut any) = (0, false);
    while first < time_s.len() {
        let stamp_s = time_s[first];
        let n = time_s[first..].iter().take_while(|t| **t == stamp_s).count().max(1);
        let next_s = time_s.get(first + n).map_or(ROW_S, |next| next - stamp_s);
        any |= n > 1;
        for (k, t) in time_s[first..first + n].iter_mut().enumerate() {
            *t += next_s.clamp(0.0, ROW_S) * k as f64 / n as f64;
        }
        first += n;
    }
    any
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], file: &str) -> Result<Recording> {
        super::read(bytes, file, &Budget::of(file, "none"))
    }

    fn value(text: &str, name: &str) -> f64 {
        read(text.as_bytes(), "f.csv").unwrap().channel(name).unwrap().values[0]
    }

    #[test]
    fn names_and_units_are_understood() {
        assert_eq!(value("t,x,y,z\n0,1,2,3\n", "y_m"), 2.0);
        assert_eq!(value("time [s],X [mm],yaw_deg\n0,500,180\n", "x_m"), 0.5);
        assert_eq!(value("t_ms,yaw_deg\n0,180\n", "yaw_rad"), std::f64::consts::PI);
        assert_eq!(value("0,1,2,3\n1,2,3,4\n", "z_m"), 3.0);
        assert_eq!(value("timestamp,x,y,z,qw,qx,qy,qz\n0,1,2,3,1,0,0,0\n", "qw"), 1.0);
        assert_eq!(value("t,x,color\n0,1,7\n", "color"), 7.0);
    }

    #[test]
    fn stamps_in_ms_and_angles_in_degrees_are_detected() {
        let log = read(b"t,yaw\n0,10\n20,20\n40,30\n", "f.csv").unwrap();
        assert_eq!(log.blocks[0].time_s, [0.0, 0.02, 0.04]);
        assert_eq!(log.channel("yaw_rad").unwrap().values[0], 10_f64.to_radians());
        assert_eq!(log.warnings.len(), 2, "both with a warning: {:?}", log.warnings);
        // At 1 kHz, and in ns.
        for (text, end_s) in [("t,x\n0,1\n1,2\n2,3\n", 0.002), ("t,x\n0,1\n4000000,2\n", 0.004)] {
            let log = read(text.as_bytes(), "f.csv").unwrap();
            assert!((log.blocks[0].time_s.last().unwrap() - end_s).abs() < 1e-9, "{text}");
        }
    }

    #[test]
    fn range_rows_keep_their_times_and_rows_within_a_second_are_spread() {
        let text = b",timestamp,ranging.distance0,ranging.distance3\n\
            0,2023-05-04 12:00:00.100,2.3918,3.1052\n1,2023-05-04 12:00:00.200,2.2290,3.1052\n";
        let log = read(text, "r.csv").unwrap();
        let names: Vec<&str> = log.names().collect();
        assert_eq!(names, ["index", "ranging.distance0", "ranging.distance3"]);
        let step_s = log.blocks[0].time_s[1] - log.blocks[0].time_s[0];
        assert!((step_s - 0.1).abs() < 1e-6, "{step_s}");
        let text = b"timestamp,ranging.distance0\n12:00:00,1\n12:00:00,2\n12:00:01,3\n";
        let log = read(text, "r.csv").unwrap();
        assert_eq!(log.blocks[0].time_s, [43_200.0, 43_200.5, 43_201.0]);
        assert_eq!(log.warnings.len(), 1);
    }
}
