//! Rows of a table: the drone that each belongs to, and times that are split over two columns.

use std::collections::BTreeSet;

use super::cells::DAY_S;
use super::recording::{Block, Recording, shortened};
use super::titles::meaning;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Sheet, SheetColumn, simplified};

/// Titles of columns that name the drone of a row, as [`simplified`].
const OWNERS: &str = "drone drone_id droneid drone_name drones uri link_uri link id uav uav_id \
                      uav_name quad quad_id swarm_id robot robot_id robot_name agent agent_id vehicle vehicle_id body \
                      body_id body_name rigid_body rigid_body_id rigid_body_name cf cf_id cfid \
                      cf_name crazyflie crazyflie_id name child_frame_id frame_id object object_id \
                      subject subject_name drohne address serial mac tag tag_id trackable tracker_id actor \
                      entity vehicle_name";

/// Fractions of a second as endings of titles, and their size.
const FRACTIONS: [(&str, f64); 3] =
    [("nanosec nsec", 1e-9), ("microsec usec", 1e-6), ("millisec msec", 1e-3)];

/// Two positions at one time farther apart than this belong to two drones, m.
const APART_M: f64 = 0.1;

/// Refuses rows of several drones, and a table in long form.
pub(super) fn check(sheet: &Sheet, file: &str) -> Result<()> {
    // One time, one name and one value: the rows are those of a long form.
    let texts: Vec<_> = sheet.columns.iter().filter(|c| c.is_text() && c.texts.len() > 1).collect();
    let is_index = |c: &SheetColumn| c.is_text() || meaning(&c.title).0 == "index";
    let (times, values): (Vec<_>, Vec<_>) =
        { sheet.columns.iter() }.filter(|c| !is_index(c)).partition(|c| meaning(&c.title).0 == "t");
    if let ([names], [time], [value]) = (&texts[..], &times[..], &values[..]) {
        let titles = [&time.title, &names.title, &value.title].map(String::as_str);
        return Err(in_long_form(titles).in_file(file, None));
    }
    for column in &sheet.columns {
        let owners = if column.is_text() { column.texts.clone() } else { whole(&column.values) };
        check_owners(&column.title, &owners, file)?;
    }
    Ok(())
}

pub(super) fn in_long_form([time, names, value]: [&str; 3]) -> Error {
    let form = format_args!("a table in long form, whose column {names} names each value");
    let hint = format!(
        "pandas.read_csv(FILE).pivot_table(index=\"{time}\", columns=\"{names}\", \
         values=\"{value}\").to_csv(\"log.csv\"), and import that"
    );
    Error::input("rows", form, "a column for each variable", hint)
}

pub(super) fn check_owners(title: &str, owners: &[String], file: &str) -> Result<()> {
    let last = title.rsplit(['.', '/']).next().unwrap_or_default();
    let plain = simplified(last);
    if owners.len() < 2 || !OWNERS.split(' ').any(|known| known == plain) {
        return Ok(());
    }
    let rows = format_args!("rows of several drones ({})", shortened(owners));
    let hint = "write the rows of one drone to a file of its own, and import that";
    Err(Error::input(format!("column {title}"), rows, "those of one", hint).in_file(file, None))
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

/// Joins two columns of times into one of seconds: a date and a time of day, or seconds and their
/// fraction.
pub(super) fn join_times(
    columns: &mut Vec<SheetColumn>,
    are_dated: &mut [bool],
    log: &mut Recording,
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
    // A column of days only is a date if another has times of day. Without one it is of no use.
    let tests: [fn(&f64) -> bool; 2] = [|v| *v > 0.0 && v % DAY_S == 0.0, |v| *v <= DAY_S];
    let [date, clock] = tests.map(|test| {
        columns.iter().position(|column| {
            let mut known = column.values.iter().filter(|value| value.is_finite()).peekable();
            are_dated[column.number - 1] && known.peek().is_some() && known.all(test)
        })
    });
    let Some(date) = date else { return Ok(()) };
    if let Some(clock) = clock.filter(|clock| *clock != date) {
        join(columns, are_dated, [clock, date], 1.0);
        return Ok(());
    }
    let title = columns.remove(date).title;
    if columns.iter().any(|column| meaning(&column.title).0 == "t") {
        log.warn("not-read", format!("column {title} has days alone: it is not read"));
        return Ok(());
    }
    let hint = "add the times of day, or seconds as a column t";
    Err(Error::input(format!("column {title}"), "days alone", "times", hint)
        .in_file(&log.file, None))
}

/// For a column with fractions of seconds: the title of the whole seconds, and the fraction's unit.
pub(super) fn whole_of(title: &str) -> Option<(String, f64)> {
    let plain = simplified(title);
    let ends =
        FRACTIONS.iter().flat_map(|(ends, size)| ends.split(' ').map(move |end| (end, size)));
    { ends }.find_map(|(end, size)| {
        let place = plain.rfind(end)?;
        let unit = format!("sec{}", &plain[place + end.len()..]);
        let is_unit = ["sec", "secs", "second", "seconds"].contains(&&*unit);
        is_unit.then(|| (format!("{}{unit}", &plain[..place]), *size))
    })
}

/// True if whole seconds have their fraction in another column.
pub(super) fn is_fraction(seconds: &[f64], parts: &[f64], size: f64) -> bool {
    seconds.iter().all(|value: &f64| value.is_nan() || value.fract() == 0.0)
        && parts.iter().all(|value: &f64| value.is_nan() || (0.0..1.0).contains(&(value * size)))
}

/// Adds a column, in units of some seconds, to one of times.
fn join(
    columns: &mut Vec<SheetColumn>,
    are_dated: &mut [bool],
    [stamps, other]: [usize; 2],
    unit_s: f64,
) {
    // The sum has the title of times, and counts as dated: its unit is seconds.
    let parts = std::mem::take(&mut columns[other].values);
    let column = &mut columns[stamps];
    column.values.iter_mut().zip(parts).for_each(|(stamp, part)| *stamp += unit_s * part);
    are_dated[column.number - 1] = true;
    if meaning(&column.title).0 != "t" {
        column.title = "t".to_owned();
    }
    columns.remove(other);
}

/// Refuses rows that are at several positions at the same time: they belong to two drones.
pub(super) fn check_positions(block: &Block, file: &str) -> Result<()> {
    let mut apart = 0;
    for column in ["x_m", "y_m", "z_m"].iter().filter_map(|name| block.column(name)) {
        let pairs = block.time_s.windows(2).zip(column.values.windows(2));
        // Rows in turn of two drones have equal times and another position.
        let jumps = pairs
            .filter(|(time, place)| time[0] == time[1] && (place[1] - place[0]).abs() > APART_M);
        apart = apart.max(jumps.count());
    }
    if 10 * apart <= block.time_s.len() {
        return Ok(());
    }
    let n = block.time_s.len();
    let rows = format!("{apart} of {n} rows at another place at the same time");
    let hint = "keep the rows of one drone; and see that the stamps have all their digits";
    Err(Error::input(file, rows, "one place at a time", hint))
}
