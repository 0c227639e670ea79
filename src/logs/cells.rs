//! Parses the cells of tables in logs: numbers, missing values, dates and times of day.

use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, RowRules, Sheet, SheetColumn, Text};
use noctograph_core::units::MS_PER_S;

use super::Job;
use super::titles::meaning;

/// Advice for a cell that is not a number.
const HINT: &str = "correct or cut the file, because each line needs one number per column";

/// Duration of a day, s.
pub(super) const DAY_S: f64 = 86_400.0;
/// Duration of an hour, s.
pub(super) const HOUR_S: f64 = 3600.0;
/// Duration of a minute, s.
const MINUTE_S: f64 = 60.0;
/// Maximum length of a cell that is parsed as a date, in bytes.
const LONGEST_DATE: usize = 48;

/// Reads the rows below a header. Also returns for each column whether it contains dates or times
/// of day, whose values are in seconds. Returns [`Error::Input`] for a cell of text if `is_needed`
/// is true for its column's title. Other cells of text become a note.
pub(super) fn read_rows(
    text: &Text<'_>,
    head: Head,
    Job { file, budget, .. }: Job<'_>,
    is_needed: impl Fn(&str) -> bool,
) -> Result<(Sheet, Vec<bool>)> {
    let mut are_dated = vec![false; head.n_columns];
    let rules = RowRules { file, budget, hint: HINT, needs_line_ends: true };
    // A date is converted to a number, and its column is marked.
    let mut sheet = Sheet::read(text, head, rules, |place, cell| {
        let (value, is_dated) = value(cell)?;
        are_dated[place] |= is_dated;
        Some(value)
    })?;
    if let Some((column, line, cell)) = sheet.first_text(|column| is_needed(&column.title)) {
        let place = format!("column {}", column.title);
        let error = Error::input(place, format_args!("{cell:?}"), "a number in every column", HINT);
        return Err(error.in_file(file, line as u64));
    }
    // A table that contains only texts and times is an error.
    let texts: Vec<String> = sheet.columns.iter().filter_map(list_of_texts).collect();
    let is_text_or_time =
        |column: &SheetColumn| column.is_text() || meaning(&column.title).0 == "t";
    if !texts.is_empty() && sheet.columns.iter().all(is_text_or_time) {
        let actual = format_args!("texts in {}", texts.join(", "));
        let hint = "write each variable to its own column, below a header t,x,y,z";
        return Err(Error::input(file, actual, "one number in each cell", hint));
    }
    if !texts.is_empty() {
        sheet.notes.push(format!("text cells are not read: {}", texts.join(", ")));
    }
    Ok((sheet, are_dated))
}

/// Returns a description of a column with texts, including the first ones, for a message. Returns
/// `None` for a column without texts.
fn list_of_texts(column: &SheetColumn) -> Option<String> {
    let first = column.texts.first()?;
    let n = column.n_texts;
    let count = if column.is_text() { String::new() } else { format!("{n} cells such as ") };
    Some(format!("{} (column {}, {count}{first:?})", column.title, column.number))
}

/// Parses a cell. Returns its number, and true for the seconds of a date or time of day.
fn value(cell: &str) -> Option<(f64, bool)> {
    number(cell).map(|value| (value, false)).or_else(|| Some((seconds_from_date(cell)?, true)))
}

/// Parses a number. Returns NaN for a missing value, 1 or 0 for a truth value, and `None` for any
/// other text.
fn number(cell: &str) -> Option<f64> {
    match cell {
        "" | "None" | "none" | "null" | "NA" | "N/A" => Some(f64::NAN),
        "True" | "true" => Some(1.0),
        "False" | "false" => Some(0.0),
        _ => cell.parse().ok(),
    }
}

/// Returns the seconds since 1970 of a date such as `2023-05-04 12:34:56.789`, or the seconds since
/// midnight of a time of day. A date without a time means midnight. Returns `None` for other cells.
///
/// Further accepted forms are `T` between date and time, `/` and `.` in dates, names of months,
/// `AM` and `PM`, zones (`Z`, `UTC`, `+02:00`, `-0500`), decimal commas, milliseconds after a third
/// colon, minutes and seconds (`34:56.7`, as in spreadsheets), and days (`0 days 00:00:01`, as in
/// pandas).
pub(super) fn seconds_from_date(cell: &str) -> Option<f64> {
    if cell.len() > LONGEST_DATE || !cell.starts_with(|sign: char| sign.is_ascii_digit()) {
        return None;
    }
    let lower = cell.trim().to_lowercase();
    if !cell.contains(':') {
        return Some(days_from_date(&lower)? as f64 * DAY_S);
    }
    let (text, half_from) = half_day(&lower);
    // The date ends at a blank, at an underscore, or at a T between digits.
    let first_colon = text.find(':').unwrap_or_default();
    let (date, time) = match text.char_indices().rfind(|(place, sign)| {
        *place < first_colon
            && (matches!(sign, ' ' | '_') || *sign == 't' && !text[place + 1..].starts_with(' '))
    }) {
        Some((place, _)) => (Some(text[..place].trim_end()), &text[place + 1..]),
        None => (None, text),
    };
    let (time, east_s) = zone(time.trim())?;
    let [minutes_s, second_s, millis_s] = time_of_day(&time.replace(',', "."), half_from)?;
    let days = date.map_or(Some(0), days_from_date)? as f64;
    Some(days * DAY_S + minutes_s + second_s + millis_s - east_s)
}

/// Parses a time of day of two to four parts that are separated by colons. `half_from` is the hour
/// at which its half of the day begins, if it is given in one of two halves. Returns the whole
/// minutes, the seconds and the milliseconds, each in s, or `None` if a part is out of range.
fn time_of_day(time: &str, half_from: Option<f64>) -> Option<[f64; 3]> {
    let parts: Option<Vec<f64>> = time.split(':').map(|part| part.parse().ok()).collect();
    let (hour, minute, second, millis) = match parts?[..] {
        [minute, second] if time.contains('.') => (0.0, minute, second, 0.0),
        [hour, minute] => (hour, minute, 0.0, 0.0),
        [hour, minute, second] => (hour, minute, second, 0.0),
        [hour, minute, second, millis] => (hour, minute, second, millis),
        _ => return None,
    };
    let whole = hour.fract() == 0.0 && minute.fract() == 0.0;
    let hours = match half_from {
        None => (0.0..=24.0).contains(&hour).then_some(hour)?,
        Some(from) => from + (1.0..=12.0).contains(&hour).then_some(hour % 12.0)?,
    };
    // A minute may have 61 seconds, of which the last is a leap second.
    let fits = (0.0..60.0).contains(&minute) && (0.0..1000.0).contains(&millis);
    (whole && fits && (0.0..61.0).contains(&second)).then_some([
        hours * HOUR_S + minute * MINUTE_S,
        second,
        millis / MS_PER_S,
    ])
}

/// Removes `am` or `pm` from a string in lower case. Returns the rest, and the hour at which this
/// half of the day begins: 0 or 12.
fn half_day(text: &str) -> (&str, Option<f64>) {
    let halves = [("am", 0.0), ("a.m.", 0.0), ("pm", 12.0), ("p.m.", 12.0)];
    let half = halves.iter().find_map(|(end, from)| Some((text.strip_suffix(end)?, *from)));
    half.map_or((text, None), |(before, from)| (before.trim_end(), Some(from)))
}

/// Removes the zone from a time of day. Returns the rest, and the seconds by which the zone is
/// ahead of UTC. Returns `None` for an unknown zone.
fn zone(time: &str) -> Option<(&str, f64)> {
    if let Some(before) = ["z", "utc", "gmt"].iter().find_map(|end| time.strip_suffix(end)) {
        return Some((before.trim_end(), 0.0));
    }
    let Some(sign) = time.find(['+', '-']) else { return Some((time, 0.0)) };
    let (before, zone) = time.split_at(sign);
    // The zone consists of hours, or of hours and minutes with or without a colon.
    let digits: String = zone[1..].chars().filter(|sign| *sign != ':').collect();
    let minutes = match (digits.len(), digits.parse::<u32>()) {
        (1 | 2, Ok(hours)) => hours * 60,
        (3 | 4, Ok(both)) => both / 100 * 60 + both % 100,
        _ => return None,
    };
    let sign = if zone.starts_with('-') { -MINUTE_S } else { MINUTE_S };
    // The easternmost zone is 14 hours ahead.
    (minutes <= 14 * 60).then(|| (before.trim_end(), sign * f64::from(minutes)))
}

/// First three letters of the months' names in English and German.
const MONTHS: [&str; 12] = [
    "jan", "feb", "mar mär", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov",
    "dec dez",
];

/// Returns the number of a month from 1 to 12, given its name or the first three letters of its
/// name in lower case. Returns `None` for other words.
fn month(name: &str) -> Option<i64> {
    let first: String = name.chars().take(3).collect();
    let mut months = (1..).zip(MONTHS);
    Some(months.find(|(_, names)| names.split(' ').any(|listed| listed == first))?.0)
}

/// Returns the days since 1970-01-01 of a date, or `None` if it is not one. The order is year,
/// month, day if the first number exceeds 31, otherwise month, day, year. The day comes first in
/// dates with points, as in German, and if the first number exceeds 12.
fn days_from_date(date: &str) -> Option<i64> {
    if let Some(days) = date.strip_suffix(" days") {
        return days.parse().ok().filter(|days| (0..100_000).contains(days));
    }
    let parts: Vec<&str> = date.split(['-', '/', '.']).collect();
    let [a, b, c] = parts[..] else { return None };
    let (year, month, day) = match [a, b, c].map(|part| part.parse::<i64>().ok()) {
        [Some(day), None, Some(year)] => (year, month(b)?, day),
        [Some(a), Some(b), Some(c)] if a > 31 => (a, b, c),
        [Some(a), Some(b), Some(c)] if date.contains('.') || a > 12 => (c, b, a),
        [Some(a), Some(b), Some(c)] => (c, a, b),
        _ => return None,
    };
    let fits =
        (1970..10_000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    if !fits {
        return None;
    }
    // Years are counted from March, so that the leap day comes last (Hinnant, days_from_civil).
    let year = if month <= 2 { year - 1 } else { year };
    let month = (month + 9) % 12;
    // From March on, five months have 153 days. 1970 began 719,468 days after March of year 0.
    let day_of_year = (153 * month + 2) / 5 + day - 1;
    Some(365 * year + year / 4 - year / 100 + year / 400 + day_of_year - 719_468)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_count_seconds() {
        assert_eq!(seconds_from_date("1970-01-02 00:00:01.5"), Some(86_401.5));
        // The expected value was computed by: date -u -d '2022-12-14 15:04:05' +%s
        for date in [
            "2022-12-14T15:04:05Z",
            "12/14/2022 15:04:05",
            "2022/12/14 15:04:05+00:00",
            "2022-12-14T10:04:05-05:00",
            "2022-12-14 17:04:05.000 +0200",
            "14.12.2022 15:04:05",
            "14-Dec-2022 15:04:05",
            "12/14/2022 3:04:05 PM",
            "2022-12-14 15:04:05 UTC",
            "2022-12-14 15:04:05,000",
            "2022-12-14 15:04:05:000",
        ] {
            assert_eq!(seconds_from_date(date), Some(1_671_030_245.0), "{date}");
        }
        assert_eq!(value("2022-12-14"), Some((19_340.0 * DAY_S, true)), "a date alone");
        assert_eq!(seconds_from_date("12:00:01.25 am"), Some(1.25));
        assert_eq!(seconds_from_date("12:00:01:250"), Some(43_201.25));
        assert_eq!(seconds_from_date("34:56.7"), Some(2096.7), "no hours with a fraction");
        assert_eq!(seconds_from_date("34:56"), None, "no hour 34");
        assert_eq!(seconds_from_date("1 days 00:00:01.500000"), Some(DAY_S + 1.5));
        let bad = "|x|2022-13-01 00:00:00|1:2:3:4 5|25:00:00|13:00:00 PM|12:00:00 CET|\
                   12:00:00-25:00|1:2:3:4:5";
        for date in bad.split('|') {
            assert_eq!(seconds_from_date(date), None, "{date:?}");
        }
    }
}
