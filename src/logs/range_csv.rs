//! Range logs of a drone with a Loco deck: a row number, a stamp, and one column per anchor.
//!
//! `index,timestamp,ranging.distance0,ranging.distance2 …`, metres; the stamp is a date with a time
//! of day, or a number of seconds or milliseconds. A row brings one new range, the other columns
//! repeat their last: the flight keeps the rows with their own times, and has no position.

use super::plain_csv::seconds_per_unit;
use super::recording::{Block, Column, Recording};
use super::sheet::Sheet;
use crate::error::{Error, Result};

/// What the names of range columns begin with.
pub(super) const RANGE: &str = "ranging.distance";

/// Rows that a date without fractions puts at one time are this far apart at most.
const ROW_S: f64 = 1.0;

/// Reads a range log.
///
/// # Errors
///
/// [`Error::Input`] with line and column of a cell that is no number, or where there is no column
/// of times.
pub(super) fn read(text: &[u8], file: &str) -> Result<Recording> {
    let Sheet { header, columns, mut warnings } = Sheet::read(text, file, &[])?;
    let is_stamp = |name: &String| {
        let name = name.to_lowercase();
        name.contains("time") || name.contains("date") || name == "t"
    };
    let Some(stamp) = header.iter().position(is_stamp) else {
        let place = format!("{file}:1");
        let wanted = "a column timestamp, as date and time of day, s or ms";
        return Err(Error::input(place, header.join(","), wanted, "name the column of times"));
    };
    let mut time_s = columns[stamp].clone();
    let unit_s = seconds_per_unit(&header[stamp], &time_s);
    for time_s in &mut time_s {
        *time_s *= unit_s;
    }
    if spread_rows(&mut time_s) {
        warnings.push("several rows share a stamp: they are spread evenly up to the next".into());
    }
    let named = header.into_iter().zip(columns).enumerate();
    let columns = named.filter(|(i, _)| *i != stamp).map(|(_, (name, values))| {
        let name = if name.is_empty() { "index".into() } else { name };
        Column { name, values }
    });
    let block =
        Block { name: "ranges".into(), time_s, columns: columns.collect(), ..Block::default() };
    Ok(Recording { file: file.to_owned(), blocks: vec![block], warnings, ..Recording::default() })
}

/// Spreads rows of one stamp evenly up to the next stamp, or over a second; whether there are any.
fn spread_rows(time_s: &mut [f64]) -> bool {
    let (mut first, mut any) = (0, false);
    while first < time_s.len() {
        let stamp_s = time_s[first];
        let n = time_s[first..].iter().take_while(|t| **t == stamp_s).count().max(1);
        let next_s = time_s.get(first + n).map_or(ROW_S, |next| next - stamp_s);
        any |= n > 1;
        #[expect(clippy::cast_precision_loss, reason = "row counts are far below 2^53")]
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

    #[test]
    fn rows_keep_their_times_and_ranges() {
        let text = b",timestamp,ranging.distance0,ranging.distance3\n\
            0,2023-05-04 12:00:00.100,2.3918,3.1052\n1,2023-05-04 12:00:00.200,2.2290,3.1052\n";
        let log = read(text, "r.csv").unwrap();
        assert_eq!(
            log.names().collect::<Vec<_>>(),
            ["index", "ranging.distance0", "ranging.distance3"]
        );
        let step_s = log.blocks[0].time_s[1] - log.blocks[0].time_s[0];
        assert!((step_s - 0.1).abs() < 1e-6, "{step_s}");
        assert_eq!(log.channel("ranging.distance0").unwrap().values, [2.3918, 2.229]);
    }

    #[test]
    fn rows_within_a_second_are_spread() {
        let text = b"timestamp,ranging.distance0\n12:00:00,1\n12:00:00,2\n12:00:01,3\n";
        let log = read(text, "r.csv").unwrap();
        assert_eq!(log.blocks[0].time_s, [43_200.0, 43_200.5, 43_201.0]);
        assert_eq!(log.warnings.len(), 1);
    }

    #[test]
    fn without_times_there_is_no_log() {
        let error = read(b"index,ranging.distance0\n0,1\n", "r.csv").unwrap_err().to_string();
        assert!(error.contains("timestamp"), "{error}");
    }
}
