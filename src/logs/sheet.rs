//! Sheets: tables of loggers, with more freedom than [`noctograph_core::flight::table`] allows.
//!
//! In the form of [`noctograph_core::files::plain_text`], or with semicolons or tabs; a header
//! line, optionally after `#`; missing values; dates and times of day; columns of texts, where
//! nothing needs them; a last line that is cut off.

use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, Lines};

/// Steps of reading a byte, and a cell besides.
const STEPS: [usize; 2] = [4, 50];

/// Most columns of a sheet.
const MAX_COLUMNS: usize = 1024;

/// Columns of equal length with their names. Cells without a number are not finite.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) header: Vec<String>,
    pub(super) columns: Vec<Vec<f64>>,
    /// Whether a column has dates or times of day, which are in seconds.
    pub(super) dated: Vec<bool>,
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
    /// Reads a sheet; `names` names the columns where the file has no header. A column that is not
    /// `needed` may hold texts: it is left out, and named.
    pub(super) fn read(
        text: &[u8],
        file: &str,
        names: &[&str],
        needed: &dyn Fn(&str) -> bool,
        budget: &Budget,
    ) -> Result<Self> {
        let titled = header(text);
        let mut header_due = titled.is_some();
        let header = titled.unwrap_or_else(|| {
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
        let dated = vec![false; header.len()];
        let mut sheet = Self { columns, header, dated, warnings: Vec::new() };
        let needed: Vec<bool> = sheet.header.iter().map(|title| needed(title)).collect();
        let mut texts: Vec<Option<(String, usize)>> = vec![None; sheet.header.len()];
        let (mut reader, mut record) = (reader(text), csv::StringRecord::new());
        let last_line = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at as u64 + 1);
        loop {
            let more = reader.read_record(&mut record).map_err(|source| {
                let line = source.position().map_or(1, csv::Position::line);
                Error::input("", &source, "a line of numbers", HINT).at(file, line)
            })?;
            if !more {
                sheet.leave_out(&texts);
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
            match sheet.row(&record, &needed, &mut texts) {
                // Half a number may look like a number.
                _ if unended => {
                    let text = format!("line {line} has no end: it may be cut off and is left out");
                    sheet.warnings.push(text);
                }
                Ok(row) => {
                    sheet.columns.iter_mut().zip(row).for_each(|(column, cell)| column.push(cell));
                }
                Err((column, found)) => {
                    let wanted = "a number in every column";
                    return Err(Error::input(column, found, wanted, HINT).at(file, line));
                }
            }
        }
    }

    /// The numbers of a row, or the place and the text of a broken cell.
    fn row(
        &mut self,
        record: &csv::StringRecord,
        needed: &[bool],
        texts: &mut [Option<(String, usize)>],
    ) -> std::result::Result<Vec<f64>, (String, String)> {
        // A separator at the end of each line makes one more cell, which is empty.
        let extra = record.iter().skip(self.header.len()).any(|cell| !cell.is_empty());
        if record.len() < self.header.len() || extra {
            let found = format!("{} of {} cells", record.len(), self.header.len());
            return Err(("row".into(), found));
        }
        let mut row = Vec::with_capacity(self.header.len());
        for (place, cell) in record.iter().take(self.header.len()).enumerate() {
            let value = match (number(cell), seconds_from_date(cell)) {
                (Some(value), _) => value,
                (None, Some(seconds)) => {
                    self.dated[place] = true;
                    seconds
                }
                (None, None) if needed[place] => {
                    return Err((format!("column {}", self.header[place]), format!("{cell:?}")));
                }
                (None, None) => {
                    let text = || (cell.chars().take(40).collect(), 0);
                    texts[place].get_or_insert_with(text).1 += 1;
                    f64::NAN
                }
            };
            row.push(value);
        }
        Ok(row)
    }

    /// Takes out the columns of texts, and names them.
    fn leave_out(&mut self, texts: &[Option<(String, usize)>]) {
        let (mut named, mut place) = (Vec::new(), 0);
        for (index, text) in texts.iter().enumerate() {
            let Some((text, n)) = text else {
                place += 1;
                continue;
            };
            let title = &self.header[place];
            if *n == self.columns[place].iter().filter(|value| value.is_nan()).count()
                && self.columns[place].iter().all(|value| value.is_nan())
            {
                named.push(format!("{title} (column {}, {text:?})", index + 1));
                self.header.remove(place);
                self.columns.remove(place);
                self.dated.remove(place);
            } else {
                named.push(format!("{title} (column {}, {n} cells such as {text:?})", index + 1));
                place += 1;
            }
        }
        if !named.is_empty() {
            self.warnings
                .push(format!("texts are not read: {}", super::recording::shortened(&named)));
        }
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

/// Seconds since 1970 of `2023-05-04 12:34:56.789`, with `T` in place of the space; day, month and
/// year also with `/` or `.`, or the month by its name. A time of day alone counts from midnight.
/// Understood: half days (`PM`), zones (`Z`, `UTC`, `+02:00`, `-0500`), decimal commas, and
/// milliseconds after a third colon.
pub(super) fn seconds_from_date(cell: &str) -> Option<f64> {
    // Most cells are none: numbers are told before, and each has a colon.
    if !cell.contains(':') || cell.len() > 48 {
        return None;
    }
    let lower = cell.trim().to_lowercase();
    let (text, half) = half_day(&lower);
    // The date ends at a blank, or at a T among digits.
    let of_day = text.find(':').unwrap_or_default();
    let ends = |(at, sign): &(usize, char)| {
        *at < of_day
            && (matches!(sign, ' ' | '_') || *sign == 't' && !text[at + 1..].starts_with(' '))
    };
    let (date, time) = match text.char_indices().rfind(ends) {
        Some((at, _)) => (Some(text[..at].trim_end()), &text[at + 1..]),
        None => (None, text),
    };
    let (time, east_s) = zone(time.trim())?;
    let time = time.replace(',', ".");
    let mut parts = time.split(':');
    let mut part = || parts.next().map(|part| part.parse::<f64>().ok());
    let (hour, minute, second) = (part()??, part()??, part().unwrap_or(Some(0.0))?);
    let millis = part().unwrap_or(Some(0.0))?;
    let whole = hour.fract() == 0.0 && minute.fract() == 0.0;
    let hours = match half {
        None => (0.0..=24.0).contains(&hour).then_some(hour)?,
        Some(after_noon) => {
            let of_half = (1.0..=12.0).contains(&hour).then_some(hour % 12.0)?;
            of_half + if after_noon { 12.0 } else { 0.0 }
        }
    };
    let fits = (0.0..60.0).contains(&minute) && (0.0..1000.0).contains(&millis);
    if !whole || !fits || !(0.0..61.0).contains(&second) || parts.next().is_some() {
        return None;
    }
    let days = date.map_or(Some(0), days_from_date)? as f64;
    Some(days * 86_400.0 + hours * 3600.0 + minute * 60.0 + second + millis / 1e3 - east_s)
}

/// A text without its half of the day, and whether that is after noon.
fn half_day(text: &str) -> (&str, Option<bool>) {
    let halves = [("am", false), ("a.m.", false), ("pm", true), ("p.m.", true)];
    let half = halves.iter().find_map(|(end, pm)| Some((text.strip_suffix(end)?, *pm)));
    half.map_or((text, None), |(before, pm)| (before.trim_end(), Some(pm)))
}

/// A time of day without its zone, and the seconds by which the zone is ahead.
fn zone(time: &str) -> Option<(&str, f64)> {
    if let Some(before) = ["z", "utc", "gmt"].iter().find_map(|end| time.strip_suffix(end)) {
        return Some((before.trim_end(), 0.0));
    }
    let Some(at) = time.find(['+', '-']) else { return Some((time, 0.0)) };
    let (before, zone) = time.split_at(at);
    let digits: String = zone[1..].chars().filter(|sign| *sign != ':').collect();
    let minutes = match (digits.len(), digits.parse::<u32>()) {
        (1 | 2, Ok(hours)) => hours * 60,
        (3 | 4, Ok(both)) => both / 100 * 60 + both % 100,
        _ => return None,
    };
    let sign = if zone.starts_with('-') { -60.0 } else { 60.0 };
    (minutes <= 14 * 60).then(|| (before.trim_end(), sign * f64::from(minutes)))
}

/// The months' names, by their first three letters in English and German.
const MONTHS: [&str; 16] = [
    "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec", "mai",
    "okt", "dez", "mär",
];

/// The month of a name.
fn month(name: &str) -> Option<i64> {
    let first: String = name.chars().take(3).collect();
    let place = MONTHS.iter().position(|known| *known == first)?;
    Some([1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 5, 10, 12, 3][place])
}

/// Days since 1970-01-01 of a date: the year first, or the month, the day and the year; the day
/// comes first with points, as in German, and where it is beyond 12.
fn days_from_date(date: &str) -> Option<i64> {
    let parts: Vec<&str> = date.split(['-', '/', '.']).collect();
    let [a, b, c] = parts[..] else { return None };
    let number = |part: &str| part.parse::<i64>().ok();
    let (year, month, day) = match (number(a), number(b), number(c)) {
        (Some(day), None, Some(year)) => (year, month(b)?, day),
        (Some(a), Some(b), Some(c)) if a > 31 => (a, b, c),
        (Some(a), Some(b), Some(c)) if date.contains('.') || a > 12 => (c, b, a),
        (Some(a), Some(b), Some(c)) => (c, a, b),
        _ => return None,
    };
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
        Sheet::read(bytes, file, names, &|_| true, &Budget::of(file, HINT))
    }

    #[test]
    fn dates_count_seconds() {
        assert_eq!(seconds_from_date("1970-01-02 00:00:01.5"), Some(86_401.5));
        // date -u -d '2022-12-14 15:04:05' +%s
        for date in ["2022-12-14T15:04:05Z", "12/14/2022 15:04:05", "2022/12/14 15:04:05+00:00"] {
            assert_eq!(seconds_from_date(date), Some(1_671_030_245.0), "{date}");
        }
        for date in [
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
        assert_eq!(seconds_from_date("12:00:01.25 am"), Some(1.25));
        assert_eq!(seconds_from_date("12:00:01:250"), Some(43_201.25));
        let bad = [
            "",
            "x",
            "2022-13-01 00:00:00",
            "1:2:3:4 5",
            "25:00:00",
            "13:00:00 PM",
            "12:00:00 CET",
            "12:00:00-25:00",
            "1:2:3:4:5",
        ];
        for date in bad {
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
