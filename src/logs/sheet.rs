//! Sheets: CSV files of loggers, with more freedom than [`crate::flight::table`] allows.
//!
//! Commas, semicolons or tabs; a header line, optionally after `#`; missing values; dates; a last line
//! that is cut off.

use crate::error::{Error, Result};
use crate::files::{Budget, Lines};

/// Steps of reading a byte, and a cell besides.
const STEPS: [usize; 2] = [4, 50];

/// Most columns of a sheet.
const MAX_COLUMNS: usize = 1024;

/// Columns of equal length with their names. Cells without a number are not finite.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) header: Vec<String>,
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) warnings: Vec<String>,
}

/// A CSV reader with the separator, of comma, semicolon and tab, that is most frequent in the first
/// line.
fn reader(text: &[u8]) -> csv::Reader<Lines<&[u8]>> {
    let mut lines = text.split(|byte| *byte == b'\n');
    let line = lines.find(|line| !line.trim_ascii().is_empty()).unwrap_or_default();
    let count = |sign: &u8| line.iter().filter(|byte| *byte == sign).count();
    let separator = [b'\t', b';', b','].into_iter().max_by_key(count).unwrap_or(b',');
    let mut builder = csv::ReaderBuilder::new();
    builder.has_headers(false).flexible(true).delimiter(separator).trim(csv::Trim::All);
    builder.from_reader(Lines::new(text))
}

/// The cells of the first line, without `#`.
fn titles(text: &[u8]) -> Vec<String> {
    let mut record = csv::StringRecord::new();
    let _ = reader(text).read_record(&mut record);
    record.iter().map(|name| name.trim_start_matches('#').trim().to_owned()).collect()
}

/// The names in the first line; `None` where all of them are numbers, or there is no line.
pub(super) fn header(text: &[u8]) -> Option<Vec<String>> {
    let titles = titles(text);
    (!titles.iter().all(|name| number(name).is_some())).then_some(titles)
}

impl Sheet {
    /// Reads a sheet; `names` names the columns where the file has no header.
    pub(super) fn read(text: &[u8], file: &str, names: &[&str], budget: &Budget) -> Result<Self> {
        let found = header(text);
        let mut header_due = found.is_some();
        let header = found.unwrap_or_else(|| {
            let numbered = titles(text).into_iter().enumerate();
            let name = |i: usize| {
                names.get(i).map_or(format!("column{}", i + 1), |name| (*name).to_owned())
            };
            numbered.map(|(i, _)| name(i)).collect()
        });
        if header.len() > MAX_COLUMNS {
            let found = format!("{} columns", header.len());
            return Err(Error::input(file, found, format!("at most {MAX_COLUMNS}"), HINT));
        }
        let next = text.iter().skip(1).chain(&[0]);
        let ends =
            |(byte, next): &(&u8, &u8)| **byte == b'\n' || **byte == b'\r' && **next != b'\n';
        let n_lines = text.iter().zip(next).filter(ends).count() + 1;
        budget.bytes(size_of::<f64>() * n_lines.saturating_mul(header.len()))?;
        budget.steps(STEPS[0] * text.len() + STEPS[1] * n_lines * header.len())?;
        let columns = header.iter().map(|_| Vec::with_capacity(n_lines)).collect();
        let mut sheet = Self { columns, header, warnings: Vec::new() };
        let (mut reader, mut record) = (reader(text), csv::StringRecord::new());
        let last_line = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at as u64 + 1);
        loop {
            let more = reader.read_record(&mut record).map_err(|source| {
                let line = source.position().map_or(1, csv::Position::line);
                Error::input(format!("{file}:{line}"), &source, "a line of numbers", HINT)
            })?;
            if !more {
                return Ok(sheet);
            }
            if std::mem::take(&mut header_due) {
                continue;
            }
            let comment = record.get(0).is_some_and(|cell| cell.starts_with('#'));
            if comment || record.iter().all(str::is_empty) {
                continue;
            }
            let line = record.position().map_or(1, csv::Position::line);
            let unended = record.position().is_some_and(|at| at.byte() >= last_line);
            match sheet.row(&record) {
                // Half a number may look like a number.
                _ if unended => {
                    let text = format!("line {line} has no end: it may be cut off and is left out");
                    sheet.warnings.push(text);
                }
                Ok(row) => {
                    sheet.columns.iter_mut().zip(row).for_each(|(column, cell)| column.push(cell));
                }
                Err((column, found)) => {
                    let place = format!("{file}:{line}: {column}");
                    return Err(Error::input(place, found, "a number in every column", HINT));
                }
            }
        }
    }

    /// The numbers of a row, or the place and the text of a broken cell.
    fn row(&self, record: &csv::StringRecord) -> std::result::Result<Vec<f64>, (String, String)> {
        // A separator at the end of each line makes one more cell, which is empty.
        let extra = record.iter().skip(self.header.len()).any(|cell| !cell.is_empty());
        if record.len() < self.header.len() || extra {
            let found = format!("{} of {} cells", record.len(), self.header.len());
            return Err(("row".into(), found));
        }
        let cells = self.header.iter().zip(record);
        cells
            .map(|(name, cell)| {
                number(cell)
                    .or_else(|| seconds_from_date(cell))
                    .ok_or_else(|| (format!("column {name}"), format!("{cell:?}")))
            })
            .collect()
    }
}

const HINT: &str = "correct or cut the file; each line needs one number a column";

/// The number in a cell; not finite where the value is missing.
fn number(cell: &str) -> Option<f64> {
    match cell {
        "" | "None" | "none" | "null" | "NA" | "N/A" => Some(f64::NAN),
        "True" | "true" => Some(1.0),
        "False" | "false" => Some(0.0),
        _ => cell.parse().ok(),
    }
}

/// Seconds since 1970 of `2023-05-04 12:34:56.789`, with `T`, `/` or `.` in place of space and
/// dashes; the time zone is ignored. A time of day alone counts from midnight.
pub(super) fn seconds_from_date(cell: &str) -> Option<f64> {
    let (date, time) = match cell.split_once(['T', ' ']) {
        Some((date, time)) => (Some(date), time),
        None => (None, cell),
    };
    let time = time.trim().trim_end_matches('Z');
    let time = time.split(['+', ' ']).next()?;
    let mut clock = time.split(':').map(|part| part.parse::<f64>().ok());
    let (hour, minute, second) =
        (clock.next()??, clock.next()??, clock.next().unwrap_or(Some(0.0))?);
    let whole = hour.fract() == 0.0 && minute.fract() == 0.0;
    let fits = (0.0..=24.0).contains(&hour) && (0.0..60.0).contains(&minute);
    if !whole || !fits || !(0.0..61.0).contains(&second) {
        return None;
    }
    let days = date.map_or(Some(0), days_from_date)?;
    let days = days as f64;
    Some(days * 86_400.0 + hour * 3600.0 + minute * 60.0 + second)
}

/// Days since 1970-01-01 of a date as year, month, day or as month, day, year.
fn days_from_date(date: &str) -> Option<i64> {
    let parts: Vec<i64> =
        date.split(['-', '/', '.']).map(|part| part.parse().ok()).collect::<Option<_>>()?;
    let [a, b, c] = parts[..] else { return None };
    let (year, month, day) = if a > 31 { (a, b, c) } else { (c, a, b) };
    let fits =
        (1970..10_000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    if !fits {
        return None;
    }
    // Years from March on, so that the leap day is the last.
    let year = if month <= 2 { year - 1 } else { year };
    let month = (month + 9) % 12;
    let day_of_year = (153 * month + 2) / 5 + day - 1;
    Some(365 * year + year / 4 - year / 100 + year / 400 + day_of_year - 719_468)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], file: &str, names: &[&str]) -> Result<Sheet> {
        Sheet::read(bytes, file, names, &Budget::of(file, HINT))
    }

    #[test]
    fn dates_count_seconds() {
        assert_eq!(seconds_from_date("1970-01-02 00:00:01.5"), Some(86_401.5));
        // date -u -d '2022-12-14 15:04:05' +%s
        for date in ["2022-12-14T15:04:05Z", "12/14/2022 15:04:05", "2022/12/14 15:04:05+00:00"] {
            assert_eq!(seconds_from_date(date), Some(1_671_030_245.0), "{date}");
        }
        for date in ["", "x", "2022-13-01 00:00:00", "1:2:3:4 5", "25:00:00"] {
            assert_eq!(seconds_from_date(date), None, "{date:?}");
        }
    }

    #[test]
    fn header_separator_and_comments_are_found() {
        let sheet = read(b"# t;X;Y\n0;1;nan\n# more\n1;;3\n", "f.csv", &[]).unwrap();
        assert_eq!(sheet.header, ["t", "X", "Y"]);
        assert_eq!(sheet.columns[0], [0.0, 1.0]);
        assert!(sheet.columns[2][0].is_nan() && sheet.columns[1][1].is_nan(), "{sheet:?}");
        let sheet = read(b"0,1,2\n1,2,3,\n", "f.csv", &["t", "x"]).unwrap();
        assert_eq!(sheet.header, ["t", "x", "column3"]);
    }

    #[test]
    fn a_broken_cell_has_its_line_and_a_cut_line_is_left_out() {
        let error = read(b"t,x\n0,1\n1,a\n2,2\n", "f.csv", &[]).unwrap_err().to_string();
        assert!(error.contains("f.csv:3: column x") && error.contains("\"a\""), "{error}");
        let error = read(b"t,x\n0,1\n1\n2,2\n", "f.csv", &[]).unwrap_err().to_string();
        assert!(error.contains("f.csv:3"), "{error}");
        let sheet = read(b"t,x\n0,1\n1,2\n2", "f.csv", &[]).unwrap();
        assert_eq!((sheet.columns[0].len(), sheet.warnings.len()), (2, 1));
    }

    #[test]
    fn a_sheet_beyond_its_budget_is_refused_before_it_is_read() {
        let wide = vec!["a"; 1000].join(",") + "\n" + &"\n".repeat(40_000);
        let error = read(wide.as_bytes(), "f.csv", &[]).unwrap_err().to_string();
        assert!(error.contains("f.csv: found more data"), "{error}");
    }
}
