//! Checks that all rows of a table belong to one drone, and joins times split into two columns.

use std::collections::BTreeSet;

use super::cells::DAY_S;
use super::recording::{Block, Recording, shortened};
use super::titles::meaning;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Sheet, SheetColumn, simplified};

/// Titles of columns that name a row's drone, as returned by [`simplified`].
const OWNERS: &str = "drone drone_id droneid drone_name drones uri link_uri link id uav uav_id \
                      uav_name quad quad_id swarm_id robot robot_id robot_name agent agent_id vehicle vehicle_id body \
                      body_id body_name rigid_body rigid_body_id rigid_body_name cf cf_id cfid \
                      cf_name crazyflie crazyflie_id name child_frame_id frame_id object object_id \
                      subject subject_name drohne address serial mac tag tag_id trackable tracker_id actor \
                      entity vehicle_name";

/// Names in titles for fractions of a second, and their size in seconds.
const FRACTIONS: [(&str, f64); 6] = [
    ("nanosec", 1e-9),
    ("nsec", 1e-9),
    ("microsec", 1e-6),
    ("usec", 1e-6),
    ("millisec", 1e-3),
    ("msec", 1e-3),
];

/// Minimum distance at which simultaneous positions belong to two drones, m.
const APART_M: f64 = 0.1;

/// Returns [`Error::Input`] for rows of several drones, and for a long-form table.
pub(super) fn check(sheet: &Sheet, file: &str) -> Result<()> {
    // A long-form table has one column each for times, names and values.
    let texts: Vec<_> = sheet.columns.iter().filter(|c| c.is_text() && c.texts.len() > 1).collect();
    let is_index = |c: &SheetColumn| c.is_text() || meaning(&c.title).0 == "index";
    let (times, values): (Vec<_>, Vec<_>) =
        { sheet.columns.iter() }.filter(|c| !is_index(c)).partition(|c| meaning(&c.title).0 == "t");
    if let ([names], [time], [value]) = (&texts[..], &times[..], &values[..]) {
        let titles = [&time.title, &names.title, &value.title].map(String::as_str);
        return Err(long_form_error(titles).in_file(file, None));
    }
    for column in &sheet.columns {
        let owners =
            if column.is_text() { column.texts.clone() } else { repeated_ids(&column.values) };
        check_owners(&column.title, &owners, file)?;
    }
    Ok(())
}

/// Returns the error for a long-form table, given the titles of its three columns.
pub(super) fn long_form_error([time, names, value]: [&str; 3]) -> Error {
    let form = format_args!("a table in long form, whose column {names} names each value");
    let hint = format!(
        "convert it with pandas.read_csv(FILE).pivot_table(index=\"{time}\", columns=\"{names}\", \
         values=\"{value}\").to_csv(\"log.csv\"), and import log.csv"
    );
    Error::input("rows", form, "a column for each variable", hint)
}

/// Returns [`Error::Input`] if a column of drone names, such as `drone_id`, contains different
/// names.
pub(super) fn check_owners(title: &str, owners: &[String], file: &str) -> Result<()> {
    let last = title.rsplit(['.', '/']).next().unwrap_or_default();
    let plain = simplified(last);
    if owners.len() < 2 || !OWNERS.split(' ').any(|owner| owner == plain) {
        return Ok(());
    }
    let rows = format_args!("rows of several drones ({})", shortened(owners));
    let hint = "write the rows of one drone to a separate file, and import this file";
    Err(Error::input(format!("column {title}"), rows, "those of one", hint).in_file(file, None))
}

/// Returns the different numbers in a column if they can be ids, which means at most 64 integers
/// that repeat. Otherwise returns an empty list.
pub(super) fn repeated_ids(values: &[f64]) -> Vec<String> {
    /// More numbers are measurements, not ids.
    const MAX_IDS: usize = 64;
    let mut ids = BTreeSet::new();
    for value in values.iter().filter(|value| value.is_finite()) {
        ids.insert(value.to_bits());
        if value.fract() != 0.0 || 2 * ids.len() > values.len() || ids.len() > MAX_IDS {
            return Vec::new();
        }
    }
    ids.into_iter().map(|id| f64::from_bits(id).to_string()).collect()
}

/// Adds two columns of times: a date and a time of day, or whole seconds and their fraction.
/// `are_dated` says for each column of the file whether its values come from dates. Returns
/// [`Error::Input`] for days without times.
pub(super) fn join_times(
    columns: &mut Vec<SheetColumn>,
    are_dated: &mut [bool],
    log: &mut Recording,
) -> Result<()> {
    let pair = columns.iter().enumerate().find_map(|(fraction, column)| {
        let (title, unit_s) = whole_seconds_title(&column.title)?;
        let seconds = columns.iter().position(|other| simplified(&other.title) == title)?;
        is_fraction(&columns[seconds].values, &column.values, unit_s)
            .then_some((seconds, fraction, unit_s))
    });
    if let Some((seconds, fraction, unit_s)) = pair {
        join(columns, are_dated, [seconds, fraction], unit_s);
        return Ok(());
    }
    // A column of whole days is a date if another column contains times of day.
    let tests: [fn(&f64) -> bool; 2] = [|v| *v > 0.0 && v % DAY_S == 0.0, |v| *v <= DAY_S];
    let [date, clock] = tests.map(|test| {
        columns.iter().position(|column| {
            let mut finite = column.values.iter().filter(|value| value.is_finite()).peekable();
            are_dated[column.number - 1] && finite.peek().is_some() && finite.all(test)
        })
    });
    let Some(date) = date else { return Ok(()) };
    if let Some(clock) = clock.filter(|clock| *clock != date) {
        join(columns, are_dated, [clock, date], 1.0);
        return Ok(());
    }
    let title = columns.remove(date).title;
    if columns.iter().any(|column| meaning(&column.title).0 == "t") {
        log.warn("not-read", format!("column {title} contains only days, and is not read"));
        return Ok(());
    }
    let hint = "add the times of day, or seconds as a column t";
    Err(Error::input(format!("column {title}"), "days alone", "times", hint)
        .in_file(&log.file, None))
}

/// Returns the title of the whole seconds and the fraction's unit, given the title of fractions of
/// a second. For example, `stamp_nanosecs` yields `stamp_secs` and 1e-9.
pub(super) fn whole_seconds_title(title: &str) -> Option<(String, f64)> {
    let plain = simplified(title);
    FRACTIONS.iter().find_map(|(fraction_name, unit_s)| {
        let (before, ending) = plain.rsplit_once(fraction_name)?;
        let seconds_name = format!("sec{ending}");
        let is_seconds = ["sec", "secs", "second", "seconds"].contains(&&*seconds_name);
        is_seconds.then(|| (format!("{before}{seconds_name}"), *unit_s))
    })
}

/// True if `seconds` are whole and `fractions`, in units of `unit_s`, are below a second.
pub(super) fn is_fraction(seconds: &[f64], fractions: &[f64], unit_s: f64) -> bool {
    seconds.iter().all(|value: &f64| value.is_nan() || value.fract() == 0.0)
        && fractions.iter().all(|value| value.is_nan() || (0.0..1.0).contains(&(value * unit_s)))
}

/// Adds the column `other`, in units of `unit_s`, to the column `stamps`, and removes it. Both are
/// indices.
fn join(
    columns: &mut Vec<SheetColumn>,
    are_dated: &mut [bool],
    [stamps, other]: [usize; 2],
    unit_s: f64,
) {
    // The sum is titled as times, and treated as dated, because its unit is seconds.
    let parts = std::mem::take(&mut columns[other].values);
    let column = &mut columns[stamps];
    column.values.iter_mut().zip(parts).for_each(|(stamp, part)| *stamp += unit_s * part);
    are_dated[column.number - 1] = true;
    if meaning(&column.title).0 != "t" {
        column.title = "t".to_owned();
    }
    columns.remove(other);
}

/// Returns [`Error::Input`] for a block in which more than a tenth of the rows follow a row with
/// the same time but a different position. Such rows belong to two drones.
pub(super) fn check_positions(block: &Block, file: &str) -> Result<()> {
    let mut n_apart = 0;
    for column in ["x_m", "y_m", "z_m"].iter().filter_map(|name| block.column(name)) {
        let pairs = block.time_s.windows(2).zip(column.values.windows(2));
        // Alternating rows of two drones have equal times and different positions.
        let jumps = pairs
            .filter(|(time, place)| time[0] == time[1] && (place[1] - place[0]).abs() > APART_M);
        n_apart = n_apart.max(jumps.count());
    }
    if 10 * n_apart <= block.time_s.len() {
        return Ok(());
    }
    let n = block.time_s.len();
    let rows = format!("{n_apart} of {n} rows share their time with a row at another position");
    let hint = "keep the rows of one drone, and check that the timestamps have all their digits";
    Err(Error::input(file, rows, "one position per time", hint))
}
