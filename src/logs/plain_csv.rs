//! Reads plain tables with t, x, y, z and other columns under their usual names, and range logs of
//! a drone with a Loco deck.
//!
//! Titles may be the ends of paths (`/cf1/pose/position/x` from `PlotJuggler`,
//! `field.pose.position.x` from rosbag), with units at the end or in brackets (`x_mm`, `yaw
//! [deg]`). Times may be split into two columns. Motive and Vicon tables ([`super::mocap_csv`]) are
//! also read. Without a header, columns are t, x, y, z or, if separated by blanks, t, x, y, z and
//! the quaternion x, y, z, w (TUM). Unknown columns are kept, with a warning. Unknown units, poses
//! of two bodies, rows of several drones and tables in long form are refused.
//!
//! Without a unit, numbers are assumed to be in meters, seconds and radians unless these units are
//! implausible. Each guess causes a warning, and an option can override it. The flight of a range
//! log (`index,timestamp,ranging.distance0 …`, in meters, with one new range in each row) keeps the
//! times of the rows and has no position.

use std::collections::BTreeMap;

use super::cells::{DAY_S, HOUR_S};
use super::mocap_csv::Capture;
use super::recording::{Block, Column, Recording};
use super::titles::{ANGLES, Title, in_si_units};
use super::{AngleUnit, Axes, Job, TimeUnit, cells, firmware, format, rows, subjects};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{DEGREE, Head, Separator, SheetColumn, Text};
use noctograph_core::flight::csv::is_standard_column;
use noctograph_core::flight::timestamps::unit_of;

/// Column names of a file without a header.
const UNNAMED: [&str; 4] = ["t", "x", "y", "z"];

/// Column names of a file without a header that has eight cells separated by blanks.
const TUM: [&str; 8] = ["t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"];

/// Beginning of the titles of a Loco deck's ranges.
const RANGE: &str = "ranging.distance";

/// Maximum time over which rows with equal times are spread. Times may be in whole seconds.
const ROW_S: f64 = 1.0;

/// Reads a plain table, or one from motion capture with its own units and axes. Returns
/// [`Error::Input`] for texts in known columns, for missing times, and for rows of several drones.
pub(super) fn read(
    text: &Text<'_>,
    mut head: Head,
    captured: Option<Capture>,
    job: Job<'_>,
) -> Result<Recording> {
    let Job { file, options, .. } = job;
    let mut log =
        Recording { firmware: firmware::in_comments(&text.bytes), ..Recording::new(file) };

    // Known columns and ranges must contain numbers.
    let unnamed = named_by_order(text, &mut head);
    let is_imported = format::is_imported(&head);
    let (mut sheet, mut are_dated) = cells::read_rows(text, head, job, |title| {
        Title::parse(title).is_known || title.starts_with("ranging.")
    })
    .map_err(|error| with_assumption(error, unnamed.as_deref()))?;
    log.warn_of_notes(&sheet.notes);
    log.warn_of_notes(unnamed.as_slice());
    rows::check(&sheet, file)?;
    sheet.columns.retain(|column| !column.is_text());
    let titles: Vec<String> = sheet.columns.iter().map(|column| column.title.clone()).collect();
    rows::join_times(&mut sheet.columns, &mut are_dated, &mut log)?;

    let is_captured = captured.is_some();
    let period_s = note_format(&mut log, captured, &titles).or(options.period_s);

    // The columns are given their standard names, and then the times are determined.
    let columns = Columns { log, time_unit: options.time_unit, ..Columns::default() };
    let Columns { mut log, time, named, .. } = columns.with_all(sheet.columns, &are_dated)?;
    log.is_stamped = time.is_some() && !is_imported;
    // A capture's period applies only to tables without times, but an option contradicts them.
    if time.is_some() && period_s.is_some() && !is_captured {
        let wanted = "no time column, because a period is given";
        return Err(Error::input(file, "a column of times", wanted, "omit the period"));
    }
    let time_s = time.map(|(_, time_s)| time_s);
    let time_s = time_s.or_else(|| Some(numbered_times(&named, is_captured, period_s?)));
    let mut time_s = time_s.ok_or_else(|| without_times(text, &titles, file))?;
    if unnamed.is_some() {
        check_assumed_times(&time_s, file)?;
    }
    if titles.iter().any(|title| title.starts_with(RANGE)) && spread_rows(&mut time_s) {
        let text = "rows with the same time are spread evenly up to the next time";
        log.warn("times-equal", text);
    }
    let block = Block { name: "csv".into(), time_s, columns: named, ..Block::default() };
    rows::check_positions(&block, file)?;
    log.blocks = vec![block];
    resolve_angles(&mut log, options.angle_unit);
    Ok(log)
}

/// Enters the axes and the warnings of a format that the header identifies in the log. Returns the
/// period that the header of a motion capture table states.
fn note_format(log: &mut Recording, captured: Option<Capture>, titles: &[String]) -> Option<f64> {
    if let Some(captured) = captured {
        (log.axes, log.in_format) = (captured.axes, Some(captured.format));
        log.warnings.extend(captured.warnings);
        return captured.period_s;
    }
    if is_px4(titles) {
        (log.axes, log.in_format) = (Axes::ZDown, Some("the local position of PX4"));
    }
    None
}

/// Names the columns of a table without a header by their order. Returns a note about this, or
/// `None` for a table with a header.
fn named_by_order(text: &Text<'_>, head: &mut Head) -> Option<String> {
    if !head.titles.is_empty() {
        return None;
    }
    let is_tum = head.separator == Separator::Blanks && head.n_columns == TUM.len();
    let message_names = ros_message_names(text, head);
    let names = message_names.unwrap_or(if is_tum { &TUM } else { &UNNAMED });
    let others = (names.len() + 1..=head.n_columns).map(|number| format!("column{number}"));
    head.titles = names.iter().map(|name| (*name).to_owned()).chain(others).collect();
    head.titles.truncate(head.n_columns);
    let as_printed = message_names.map_or("", |_| ", as `ros2 topic echo --csv` prints a pose");
    Some(format!("no header: the columns are assumed to be {}{as_printed}", names.join(", ")))
}

/// Returns the error for a table without times, or for lines that are not a table.
fn without_times(text: &Text<'_>, titles: &[String], file: &str) -> Error {
    /// Number of characters of the first line that the error shows.
    const SHOWN: usize = 48;
    let are_titles = titles.iter().filter(|title| {
        !title.is_empty() && title.parse::<f64>().is_err() && !title.contains([':', '=', '[', '{'])
    });
    // If most of the texts are numbers or symbols, they are not titles.
    if 2 * are_titles.count() <= titles.len() {
        let first = text.bytes.trim_ascii_start().split(|byte| *byte == b'\n').next();
        let first = String::from_utf8_lossy(first.unwrap_or_default());
        let first: String = first.trim().chars().take(SHOWN).collect();
        let seen = format!("lines that are not a table, such as {first:?}");
        let hint =
            "write the time and the position of each sample to columns below a header t,x,y,z";
        return Error::input(file, seen, "a table with a column of times", hint);
    }
    let titles = format!("the columns {}", titles.join(", "));
    let wanted = "a column of times (t, time, time_s, timestamp, t_ms …), or the seconds between \
                  two rows";
    let hint = "name the column of times t, or give the period of the rows";
    Error::input("times", titles, wanted, hint).coded("times-missing").in_file(file, 1)
}

/// Returns the names of the first columns of a ROS message with a pose, as printed by `ros2 topic
/// echo --csv` without a header: time and frame, the child frame (only for odometry and
/// transforms), and the pose. Returns `None` for other tables.
fn ros_message_names(text: &Text<'_>, head: &Head) -> Option<&'static [&'static str]> {
    const POSE: [&str; 10] = ["sec", "nanosec", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"];
    const ODOMETRY: [&str; 11] =
        ["sec", "nanosec", "frame", "body", "x", "y", "z", "qx", "qy", "qz", "qw"];
    let row = text.bytes.split(|byte| *byte == b'\n').nth(head.row)?;
    let row = String::from_utf8_lossy(row);
    let cells: Vec<&str> = row.trim_end().split(',').collect();
    let are_numbers: Vec<bool> = cells.iter().map(|cell| cell.parse::<f64>().is_ok()).collect();
    // The row contains the time as two integers, one or two frame names, and then numbers.
    let names: &[&str] = match (&are_numbers[..], cells.len()) {
        ([true, true, false, false, ..], 11..) => &ODOMETRY,
        ([true, true, false, true, ..], 10..) => &POSE,
        ([true, true, false, true, ..], 6) => &POSE[..6],
        _ => return None,
    };
    let is_time = cells[..2].iter().all(|cell| cell.bytes().all(|byte| byte.is_ascii_digit()));
    is_time.then_some(names)
}

/// Returns [`Error::Input`] for a table without a header if the first column, assumed to be the
/// times, rarely exceeds all previous values. Such a column may be the first element of a matrix.
fn check_assumed_times(time_s: &[f64], file: &str) -> Result<()> {
    let mut latest_s = f64::NEG_INFINITY;
    let rising = time_s.iter().filter(|time_s| {
        let rises = **time_s > latest_s;
        latest_s = latest_s.max(**time_s);
        rises
    });
    let (n_rising, n) = (rising.count(), time_s.len());
    if 2 * n_rising >= n {
        return Ok(());
    }
    let numbers = format!("no header, and {} of {n} numbers that do not increase", n - n_rising);
    let hint = "write a header above the rows that names the columns, such as t,x,y,z";
    Err(Error::input("column 1", numbers, "times", hint).in_file(file, None))
}

/// Adds the assumption about the columns to an error's hint.
fn with_assumption(mut error: Error, assumed: Option<&str>) -> Error {
    if let (Error::Input { hint, .. }, Some(assumed)) = (&mut error, assumed) {
        *hint = format!("{assumed}; write a header above the rows if that is wrong");
    }
    error
}

/// True for the header of PX4's `vehicle_local_position`, in which z points down.
fn is_px4(header: &[String]) -> bool {
    let titles: Vec<&str> = header.iter().map(String::as_str).collect();
    titles.contains(&"z")
        && titles.contains(&"vz")
        && ["ref_timestamp", "z_valid", "dist_bottom"].iter().any(|name| titles.contains(name))
}

/// Returns the times of rows in s from their numbers or, if `by_frame` is true, from the frame
/// numbers.
fn numbered_times(named: &[Column], by_frame: bool, period_s: f64) -> Vec<f64> {
    let n = named.first().map_or(0, |column| column.values.len());
    match named.iter().find(|column| by_frame && column.name == "index") {
        Some(frames) => frames.values.iter().map(|frame| frame * period_s).collect(),
        None => (0..n).map(|row| row as f64 * period_s).collect(),
    }
}

/// Columns of a table that have been identified so far.
#[derive(Default)]
struct Columns {
    log: Recording,
    time_unit: TimeUnit,
    time: Option<(String, Vec<f64>)>,
    named: Vec<Column>,
    /// Original title and body, by standard name.
    from: BTreeMap<String, (String, String)>,
}

impl Columns {
    /// Adds a column under its standard name and in SI units, or uses it as the times. `is_dated`
    /// is true if its values come from dates or times of day. Returns [`Error::Input`] for an
    /// unknown unit, and for columns of two bodies.
    fn add(&mut self, column: SheetColumn, is_dated: bool) -> Result<()> {
        let SheetColumn { title, number, values, .. } = column;
        let Title { mut name, is_known, unit, body, other_unit } = Title::parse(&title);
        if let Some(other) = other_unit {
            let (place, unit) = (format!("column {title}"), format!("the unit {other}"));
            let wanted = "m, cm, mm, in, ft, s, ms, us, ns, min, h, d, rad, deg, or these by s";
            let hint = "convert the column, or correct its title";
            return Err(Error::input(place, unit, wanted, hint).in_file(&self.log.file, None));
        }
        // Pandas writes times as an index of dates.
        if is_dated && name == "index" {
            "t".clone_into(&mut name);
        }
        // The first column of times may be empty while the second one is filled.
        if name == "t" && (title == "t" || is_dated || values.iter().any(|value| !value.is_nan())) {
            let (time_s, guess) = times(&title, values, is_dated, unit, self.time_unit);
            self.add_times(title, time_s, guess);
            return Ok(());
        }
        let mut unknown = None;
        // PX4's heading is the yaw in its world frame.
        if name == "heading" && self.log.in_format.is_some() {
            name = "yaw_rad".to_owned();
        } else if name == "t" {
            name.clone_from(&title);
        } else if !is_known && !is_expected(&title) {
            unknown = Some(format!("{title} (column {number})"));
        }
        // Of two columns with the same quantity, the first is used if both belong to the same body.
        if is_known && let Some((first, first_body)) = self.from.get(&name) {
            if *first_body != body {
                let place = format!("columns {first} and {title}");
                let hint = "keep the columns of one body";
                let error = Error::input(place, "two bodies", "one, for a flight", hint);
                return Err(error.in_file(&self.log.file, None));
            }
            let text =
                format!("{title} (column {number}) is the same quantity as {first}, which is used");
            self.log.warn("column-twice", text);
            name.clone_from(&title);
        }
        self.from.entry(name.clone()).or_insert_with(|| (title, body));
        self.named.push(Column { unknown, ..in_si_units(name, unit, values) });
        Ok(())
    }

    /// Adds all columns, and identifies a position that is named after a subject. `are_dated` says
    /// for each column of the file whether its values come from dates or times of day.
    fn with_all(mut self, columns: Vec<SheetColumn>, are_dated: &[bool]) -> Result<Self> {
        for column in columns {
            let is_dated = are_dated[column.number - 1];
            self.add(column, is_dated)?;
        }
        subjects::resolve(&mut self.log, &mut self.named)?;
        Ok(self)
    }

    /// Uses a column as the times, with the warning `guess` about their unit. A second column of
    /// times is added under its title, with another warning.
    fn add_times(&mut self, title: String, time_s: Vec<f64>, guess: Option<Diagnostic>) {
        let Some((first, _)) = &self.time else {
            self.log.warnings.extend(guess);
            self.time = Some((title, time_s));
            return;
        };
        let text = format!("the times are those of {first}, and {title} contains different times");
        self.log.warn("times-twice", text);
        self.named.push(Column::new(title, time_s));
    }
}

/// True for a title of the simulator or the firmware, which causes no warning.
fn is_expected(title: &str) -> bool {
    // Titles of the simulator's columns, and of row numbers.
    const OURS: &str = "saturated_s battery_v energy_j estimate_sigma_m estimate_nees frame seq";
    OURS.split(' ').any(|listed| listed == title)
        || is_standard_column(title)
        || title.split_once('.').is_some_and(|(group, name)| {
            let are_plain = [group, name].iter().all(|text| {
                !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || c == '_')
            });
            are_plain && group != "field"
        })
}

/// Returns the values of a column as times in s, and a warning if their unit is a guess. `unit` is
/// the title's unit in s. If `is_dated` is true, the values are already in s, and midnights are
/// undone.
fn times(
    title: &str,
    mut values: Vec<f64>,
    is_dated: bool,
    unit: Option<f64>,
    wanted: TimeUnit,
) -> (Vec<f64>, Option<Diagnostic>) {
    if is_dated {
        let wraps = undo_midnights(&mut values);
        let text =
            format!("column {title}: its clock restarts {wraps} time(s), which is corrected");
        return (values, (wraps > 0).then(|| Diagnostic::warning("clock-wrapped", text)));
    }
    // An option takes precedence over the title, and the title over the steps.
    let (named_s, inferred) = (wanted.seconds().or(unit), unit_of(&values));
    let (unit_s, step) = (named_s.unwrap_or(inferred.unit_s), inferred.step);
    values.iter_mut().for_each(|value| *value *= unit_s);
    if named_s.is_some() || unit_s == 1.0 && !inferred.in_doubt {
        return (values, None);
    }
    let guess = if unit_s != 1.0 {
        format!(
            "read in units of {unit_s} s, because its rows are {step} apart, which is not a usual \
             step of a log in seconds"
        )
    } else {
        format!("its rows are {step} apart, taken as seconds, not milliseconds")
    };
    (values, Some(Diagnostic::warning("unit-guessed", format!("column {title}: {guess}"))))
}

/// Adds a day, half a day or an hour after each backward step of about that size. Returns the
/// number of backward steps.
fn undo_midnights(times_s: &mut [f64]) -> u32 {
    /// Largest difference between a backward step and the time that the clock restarted after.
    const NEAR_S: f64 = 60.0;
    /// Latest time of day, 25 hours. Larger numbers are dates, which do not restart.
    const LATEST_S: f64 = 90_000.0;
    let (mut added_s, mut last_s, mut wraps) = (0.0, f64::NEG_INFINITY, 0);
    for time_s in times_s.iter_mut().filter(|t| t.is_finite() && **t < LATEST_S) {
        let fall_s = last_s - *time_s;
        last_s = *time_s;
        for day_s in [DAY_S, 0.5 * DAY_S, HOUR_S] {
            if (fall_s - day_s).abs() < NEAR_S {
                (added_s, wraps) = (added_s + day_s, wraps + 1);
            }
        }
        *time_s += added_s;
    }
    wraps
}

/// Returns the largest absolute value, in the values' unit, or 0 without values.
fn max_abs(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |max, value| value.abs().max(max))
}

/// Returns the root mean square, in the values' unit.
fn rms(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    (values.iter().map(|value| value * value).sum::<f64>() / n).sqrt()
}

/// True if angles of unknown unit are in degrees. Also returns the reason, or `None` if
/// radians are plausible.
pub(super) fn are_degrees(block: &Block) -> (bool, Option<String>) {
    /// Root mean square (20°) and maximum (40°) of pitch and roll in an ordinary flight, rad.
    const USUAL_RMS: f64 = 0.35;
    const USUAL_MAX: f64 = 0.7;
    let (tilt, angles) = (open_angles(block, &ANGLES[1..]), open_angles(block, &ANGLES));
    let (max_tilt, max_angle, rms_tilt) = (max_abs(&tilt), max_abs(&angles), rms(&tilt));
    // The indications are tested in order, the most reliable first.
    if max_angle > std::f64::consts::TAU {
        (true, Some("yaw, pitch and roll go beyond a full turn of 2π".to_owned()))
    } else if max_tilt > std::f64::consts::FRAC_PI_2 {
        let odd = "which in radians would be upside down";
        (true, Some(format!("pitch and roll reach {max_tilt:.2}, {odd}")))
    } else if rms_tilt > USUAL_RMS {
        let odd = "which no flight could have in radians";
        (true, Some(format!("pitch and roll are {rms_tilt:.2} on average, {odd}")))
    } else if max_tilt > USUAL_MAX {
        (false, Some(format!("pitch and roll reach {max_tilt:.2}")))
    } else if tilt.is_empty() && max_angle > std::f64::consts::PI {
        (false, Some(format!("the yaw reaches {max_angle:.2}")))
    } else {
        (false, None)
    }
}

/// Converts angles and angular velocities without a unit in their title to radians. `wanted` is
/// their unit, if it is known.
pub(super) fn resolve_angles(
    Recording { blocks, warnings, .. }: &mut Recording,
    wanted: AngleUnit,
) {
    /// Least change of roll and pitch with which rates are compared, rad/s.
    const LEAST_CHANGE_RAD_S: f64 = 0.01;
    /// Geometric mean of 1 and 57, the ratio of rates in degrees to changes in radians.
    const MAX_RATIO: f64 = 7.6;
    /// Rate that no drone reaches, rad/s. It is the limit if roll and pitch do not change.
    const MAX_RATE_RAD_S: f64 = 35.0;
    let is_auto = wanted == AngleUnit::Auto;
    for block in blocks {
        let (are_degrees, why) = are_degrees(block);
        if let Some(why) = why.filter(|_| is_auto) {
            let unit = if are_degrees { "degrees" } else { "radians, not degrees" };
            let text = format!("{why}: taken as {unit}");
            warnings.push(Diagnostic::warning("unit-guessed", text));
        }
        if wanted == AngleUnit::Degrees || is_auto && are_degrees {
            from_degrees(block, false);
        }
        // Rates must match the changes of roll and pitch, which have been converted to radians.
        let rates = open_angles(block, &["wx_body_rad_s", "wy_body_rad_s"]);
        let angles = ANGLES[1..].iter().filter_map(|name| block.column(name));
        let pairs = angles.flat_map(|angle| angle.values.windows(2).zip(block.time_s.windows(2)));
        let changes = pairs.map(|(angle, time)| (angle[1] - angle[0]) / (time[1] - time[0]));
        let rms_change = rms(&changes.filter(|change| change.is_finite()).collect::<Vec<_>>());
        let too_fast = if rms_change > LEAST_CHANGE_RAD_S && !rates.is_empty() {
            rms(&rates) / rms_change > MAX_RATIO
        } else {
            max_abs(&rates) > MAX_RATE_RAD_S
        };
        if is_auto && too_fast {
            let text = "angular velocities without a unit are too fast for rad/s: taken as degrees";
            warnings.push(Diagnostic::warning("unit-guessed", text));
        }
        if wanted == AngleUnit::Degrees || is_auto && too_fast {
            from_degrees(block, true);
        }
    }
}

/// Returns the finite numbers of unknown unit in the columns with these names, one column after
/// another.
fn open_angles(block: &Block, names: &[&str]) -> Vec<f64> {
    let open = block.columns.iter().filter(|column| column.is_open_angle);
    let values = open.filter(|column| names.contains(&&*column.name)).flat_map(|c| &c.values);
    values.copied().filter(|value| value.is_finite()).collect()
}

/// Converts angles of unknown unit from degrees to radians or, if `are_rates` is true, angular
/// velocities.
fn from_degrees(block: &mut Block, are_rates: bool) {
    let open = block.columns.iter_mut().filter(|column| column.is_open_angle);
    let open = open.filter(|column| column.name.starts_with('w') == are_rates);
    open.flat_map(|column| &mut column.values).for_each(|value| *value *= DEGREE);
}

/// Spreads rows with equal times evenly up to the next time, or over [`ROW_S`] if that is shorter.
/// Returns true if there are such rows.
fn spread_rows(time_s: &mut [f64]) -> bool {
    let mut has_equal_times = false;
    let mut first = 0;
    while first < time_s.len() {
        let stamp_s = time_s[first];
        let n = time_s[first..].iter().take_while(|t| **t == stamp_s).count().max(1);
        // Rows with equal times extend to the next time.
        let next_s = time_s.get(first + n).map_or(ROW_S, |next| next - stamp_s);
        has_equal_times |= n > 1;
        for (k, t) in time_s[first..first + n].iter_mut().enumerate() {
            *t += next_s.clamp(0.0, ROW_S) * k as f64 / n as f64;
        }
        first += n;
    }
    has_equal_times
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;
    use noctograph_core::files::Budget;

    fn read(bytes: &[u8], file: &str) -> Result<Recording> {
        let (options, budget) = (&ImportOptions::default(), &Budget::new(file, "none"));
        let (text, job) = (Text::decode(bytes), Job { file, options, budget });
        super::read(&text, Head::find(&text.bytes), None, job)
    }

    #[test]
    fn a_column_is_numbered_by_its_place_in_the_file() {
        let log = read(b"t,mode,x,y,z,foo\n0,hover,0,0,1,5\n1,hover,0,0,1,6\n", "a.csv").unwrap();
        let said = crate::tests::said(&log);
        assert!(said.contains("mode (column 2,"), "{said}");
        assert_eq!(log.blocks[0].columns[3].unknown.as_deref(), Some("foo (column 6)"));
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
        // The rows have a rate of 1 kHz, and times in ns.
        let kilohertz: String = (0..=600).map(|ms| format!("{ms},1\n")).collect();
        for (rows, end_s) in [(&*kilohertz, 0.6), ("0,1\n4000000,2\n", 0.004)] {
            let text = format!("t,x\n{rows}");
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
