//! Rows of a table: whose they are, and when they were written, where two columns say it.

use std::collections::BTreeSet;

use super::cells::DAY_S;
use super::recording::{Block, shortened};
use super::titles::meaning;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Sheet, SheetColumn, simplified};

/// Titles of columns that say whose row it is, as [`simplified`].
const OWNERS: &str = "drone drone_id droneid drone_name drones uri link_uri link id uav uav_id \
                      uav_name robot robot_id robot_name agent agent_id vehicle vehicle_id body \
                      body_id body_name rigid_body rigid_body_id rigid_body_name cf cf_id cfid \
                      cf_name crazyflie crazyflie_id name child_frame_id frame_id object object_id \
                      subject subject_name drohne address serial mac tag tag_id actor entity";

/// Fractions of a second as endings of titles, and their size.
const FRACTIONS: [(&str, f64); 6] = [
    ("nanosec", 1e-9),
    ("nsec", 1e-9),
    ("microsec", 1e-6),
    ("usec", 1e-6),
    ("millisec", 1e-3),
    ("msec", 1e-3),
];

/// Two places of one stamp further apart are two drones', m.
const APART_M: f64 = 0.1;

/// Refuses rows of several drones, and a table in long form.
pub(super) fn check(sheet: &Sheet, file: &str) -> Result<()> {
    let is_time = |column: &&SheetColumn| meaning(&column.title).0 == "t";
    let texts: Vec<_> = sheet.columns.iter().filter(|c| c.is_text() && c.texts.len() > 1).collect();
    let numbers: Vec<_> = sheet.columns.iter().filter(|c| !c.is_text()).collect();
    if let ([names], [time, value]) = (&texts[..], &numbers[..])
        && is_time(time)
    {
        let titles = [&time.title, &names.title, &value.title].map(String::as_str);
        return Err(in_long_form(titles).at(file, None));
    }
    for column in &sheet.columns {
        let owners = if column.is_text() { column.texts.clone() } else { whole(&column.values) };
        check_owners(&column.title, &owners, file)?;
    }
    Ok(())
}

/// A table with a row for each value.
pub(super) fn in_long_form([time, names, value]: [&str; 3]) -> Error {
    let found = format_args!("a table in long form, whose column {names} names each value");
    let hint = format!(
        "pandas.read_csv(FILE).pivot_table(index=\"{time}\", columns=\"{names}\", \
         values=\"{value}\").to_csv(\"log.csv\"), and import that"
    );
    Error::input("rows", found, "a column for each variable", hint)
}

/// Refuses a column that says of each row whose it is, where it names more than one.
pub(super) fn check_owners(title: &str, owners: &[String], file: &str) -> Result<()> {
    let last = title.rsplit(['.', '/']).next().unwrap_or_default();
    let plain = simplified(last);
    if owners.len() < 2 || !OWNERS.split(' ').any(|known| known == plain) {
        return Ok(());
    }
    let found = format_args!("rows of several drones ({})", shortened(owners));
    let hint = "write the rows of one drone to a file of its own, and import that";
    Err(Error::input(format_args!("column {title}"), found, "those of one", hint).at(file, None))
}

/// The different numbers of a column of ids: whole ones, each in several rows.
pub(super) fn whole(values: &[f64]) -> Vec<String> {
    let mut ids = BTreeSet::new();
    for value in values.iter().filter(|value| value.is_finite()) {
        ids.insert(value.to_bits());
        if value.fract() != 0.0 || 2 * ids.len() > values.len() || ids.len() > 64 {
            return Vec::new();
        }
    }
    ids.into_iter().map(|id| f64::from_bits(id).to_string()).collect()
}

/// Makes one column of stamps of two, which then holds seconds as dates do: a date and a time of
/// day, or seconds and a fraction of them.
pub(super) fn join_stamps(
    columns: &mut Vec<SheetColumn>,
    are_dated: &mut [bool],
    file: &str,
    warnings: &mut Vec<String>,
) -> Result<()> {
    let pair = columns.iter().enumerate().find_map(|(part, column)| {
        let (whole, size_s) = whole_of(&column.title)?;
        let whole = columns.iter().position(|other| simplified(&other.title) == whole)?;
        is_fraction(&columns[whole].values, &column.values, size_s).then_some((whole, part, size_s))
    });
    if let Some((whole, part, size_s)) = pair {
        join(columns, are_dated, [whole, part], size_s);
        return Ok(());
    }
    let dated = |is_meant: fn(&f64) -> bool| {
        let is_all = |column: &SheetColumn| {
            let known = || column.values.iter().filter(|value| value.is_finite());
            are_dated[column.number - 1] && known().count() > 0 && known().all(is_meant)
        };
        columns.iter().position(is_all)
    };
    let Some(date) = dated(|value| *value > 0.0 && value % DAY_S == 0.0) else { return Ok(()) };
    if let Some(clock) = dated(|value| *value <= DAY_S).filter(|clock| *clock != date) {
        join(columns, are_dated, [clock, date], 1.0);
        return Ok(());
    }
    let title = columns.remove(date).title;
    if columns.iter().any(|column| meaning(&column.title).0 == "t") {
        warnings.push(format!("column {title} has days alone: it is not read"));
        return Ok(());
    }
    let hint = "add the times of day, or seconds as a column t";
    let place = format_args!("column {title}");
    Err(Error::input(place, "days alone", "times", hint).at(file, None))
}

/// The title of the seconds of which a column has the fraction, and the fraction's size.
pub(super) fn whole_of(title: &str) -> Option<(String, f64)> {
    let plain = simplified(title);
    FRACTIONS.iter().find_map(|(end, size)| {
        let place = plain.rfind(end)?;
        let unit = format!("sec{}", &plain[place + end.len()..]);
        let is_unit = ["sec", "secs", "second", "seconds"].contains(&&*unit);
        is_unit.then(|| (format!("{}{unit}", &plain[..place]), *size))
    })
}

/// Whether whole seconds have their fraction in another column.
pub(super) fn is_fraction(seconds: &[f64], parts: &[f64], size: f64) -> bool {
    let is_whole = |value: &f64| value.is_nan() || value.fract() == 0.0;
    let is_part = |value: &f64| value.is_nan() || (0.0..1.0).contains(&(value * size));
    seconds.iter().all(is_whole) && parts.iter().all(is_part)
}

/// Adds a column, in units of some seconds, to one of stamps.
fn join(
    columns: &mut Vec<SheetColumn>,
    are_dated: &mut [bool],
    [stamps, other]: [usize; 2],
    unit_s: f64,
) {
    let parts = std::mem::take(&mut columns[other].values);
    let column = &mut columns[stamps];
    column.values.iter_mut().zip(parts).for_each(|(stamp, part)| *stamp += unit_s * part);
    are_dated[column.number - 1] = true;
    if meaning(&column.title).0 != "t" {
        column.title = "t".to_owned();
    }
    columns.remove(other);
}

/// Refuses rows of one stamp at several places, as those of two drones.
pub(super) fn check_places(block: &Block, file: &str) -> Result<()> {
    let mut apart = 0;
    for column in ["x_m", "y_m", "z_m"].iter().filter_map(|name| block.column(name)) {
        let pairs = block.time_s.windows(2).zip(column.values.windows(2));
        let is_apart = |(time, place): &(&[f64], &[f64])| {
            time[0] == time[1] && (place[1] - place[0]).abs() > APART_M
        };
        apart = apart.max(pairs.filter(is_apart).count());
    }
    if 10 * apart <= block.time_s.len() {
        return Ok(());
    }
    let found = format!("{apart} of {} rows at another place at the same time", block.time_s.len());
    let hint = "keep the rows of one drone; and see that the stamps have all their digits";
    Err(Error::input(file, found, "one place at a time", hint))
}
