//! Sheets: tables of loggers, with more freedom than [`noctograph_core::flight::table`] allows.
//!
//! In the form of [`noctograph_core::files::plain_text`], or with semicolons or tabs; a header
//! line, optionally after `#`; missing values; dates and times of day; columns of texts, where
//! nothing needs them; a last line that is cut off.

use super::Job;
use super::recording::shortened;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Lines;
use noctograph_core::input_error;

/// Steps of reading a byte, and a cell besides.
const STEPS: [usize; 2] = [4, 50];

/// Most columns of a sheet.
const MAX_COLUMNS: usize = 1024;

/// What may part cells.
const SEPARATORS: [u8; 3] = [b'\t', b';', b','];

/// Columns of equal length.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) columns: Vec<SheetColumn>,
    pub(super) warnings: Vec<String>,
}

/// A column. Cells without a number are not finite.
#[derive(Debug)]
pub(super) struct SheetColumn {
    pub(super) title: String,
    /// Its place in the file, from 1.
    pub(super) number: usize,
    pub(super) values: Vec<f64>,
    /// Whether it has dates or times of day, which are in seconds.
    pub(super) is_dated: bool,
    /// Whether a text is refused.
    is_needed: bool,
    /// The beginning of its first text, and how many it has.
    texts: Option<(String, usize)>,
}

/// The first line that is not blank.
pub(super) fn first_line(text: &[u8]) -> &[u8] {
    let mut lines = text.split(|byte| *byte == b'\n');
    lines.find(|line| !line.trim_ascii().is_empty()).unwrap_or_default()
}

/// Whether a line has cells, other than between blanks.
pub(super) fn is_separated(line: &[u8]) -> bool {
    line.iter().any(|byte| SEPARATORS.contains(byte))
}

/// A CSV reader with the separator, of comma, semicolon and tab, that is most frequent in the first
/// line.
fn reader(text: &[u8]) -> csv::Reader<Lines<&[u8]>> {
    let line = first_line(text);
    let count = |sign: &u8| line.iter().filter(|byte| *byte == sign).count();
    let separator = SEPARATORS.into_iter().max_by_key(count).unwrap_or(b',');
    let mut builder = csv::ReaderBuilder::new();
    builder.has_headers(false).flexible(true).delimiter(separator).trim(csv::Trim::All);
    builder.from_reader(Lines::new(text))
}

/// The cells of the first line, without `#`.
fn first_cells(text: &[u8]) -> Vec<String> {
    let mut record = csv::StringRecord::new();
    let _ = reader(text).read_record(&mut record);
    record.iter().map(|name| name.trim_start_matches('#').trim().to_owned()).collect()
}

/// The names in the first line; `None` where all of them are numbers, or there is no line.
pub(super) fn header(text: &[u8]) -> Option<Vec<String>> {
    Some(first_cells(text)).filter(|names| !names.iter().all(|name| number(name).is_some()))
}

impl Sheet {
    /// Reads a text of [`noctograph_core::files::plain_text`]; `names` names the columns where the
    /// file has no header. A column that is not `needed` may hold texts: it is left out, and named.
    pub(super) fn read(
        text: &[u8],
        job: Job<'_>,
        names: &[&str],
        needed: impl Fn(&str) -> bool,
    ) -> Result<Self> {
        let Job { file, budget, .. } = job;
        let header = header(text);
        let (mut reader, mut head_due) = (reader(text), header.is_some());
        let titles = header.unwrap_or_else(|| {
            let name = |i: usize| {
                names.get(i).map_or(format!("column{}", i + 1), |name| (*name).to_owned())
            };
            (0..first_cells(text).len()).map(name).collect()
        });
        let n = titles.len();
        if n > MAX_COLUMNS {
            return Err(input_error!(file, "{n} columns", "at most {MAX_COLUMNS}", "{HINT}"));
        }
        let n_lines = text.split(|byte| *byte == b'\n').count();
        budget.bytes(size_of::<f64>() * n_lines.saturating_mul(n))?;
        budget.steps(STEPS[0] * text.len() + STEPS[1] * n_lines * n)?;
        let mut columns: Vec<SheetColumn> = titles
            .into_iter()
            .zip(1..)
            .map(|(title, number)| SheetColumn {
                is_needed: needed(&title),
                title,
                number,
                values: Vec::with_capacity(n_lines),
                is_dated: false,
                texts: None,
            })
            .collect();
        let mut warnings = Vec::new();
        let mut record = csv::StringRecord::new();
        let last_line = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at as u64 + 1);
        let broken = |source: csv::Error| {
            let line = source.position().map_or(1, csv::Position::line);
            Error::input("", &source, "a line of numbers", HINT).at(file, line)
        };
        while reader.read_record(&mut record).map_err(broken)? {
            let is_comment = record.get(0).is_some_and(|cell| cell.starts_with('#'));
            if std::mem::take(&mut head_due) || is_comment || record.iter().all(str::is_empty) {
                continue;
            }
            let line = record.position().map_or(1, csv::Position::line);
            // Half a number may look like a number.
            if record.position().is_some_and(|at| at.byte() >= last_line) {
                warnings.push(format!("line {line} has no end: it may be cut off and is left out"));
                continue;
            }
            let wrong = |place: String, found: String| {
                Error::input(place, found, "a number in every column", HINT).at(file, line)
            };
            // A separator at the end of each line makes one more cell, which is empty.
            let extra = record.iter().skip(n).any(|cell| !cell.is_empty());
            if record.len() < n || extra {
                return Err(wrong("row".to_owned(), format!("{} of {n} cells", record.len())));
            }
            for (column, cell) in columns.iter_mut().zip(&record) {
                if !column.push(cell) {
                    return Err(wrong(format!("column {}", column.title), format!("{cell:?}")));
                }
            }
        }
        let texts: Vec<String> = columns.iter().filter_map(SheetColumn::named).collect();
        if !texts.is_empty() {
            warnings.push(format!("texts are not read: {}", shortened(&texts)));
        }
        columns.retain(|column| !column.is_text());
        Ok(Self { columns, warnings })
    }
}

impl SheetColumn {
    /// Adds a cell; `false` for a text where a number is needed.
    fn push(&mut self, cell: &str) -> bool {
        let value = number(cell).or_else(|| {
            let seconds = seconds_from_date(cell)?;
            self.is_dated = true;
            Some(seconds)
        });
        if value.is_none() {
            let first = || (cell.chars().take(40).collect(), 0);
            self.texts.get_or_insert_with(first).1 += 1;
        }
        self.values.push(value.unwrap_or(f64::NAN));
        value.is_some() || !self.is_needed
    }

    /// Whether it has nothing but texts.
    fn is_text(&self) -> bool {
        self.texts.as_ref().is_some_and(|(_, n)| *n == self.values.len())
    }

    /// The texts of the column, for a message.
    fn named(&self) -> Option<String> {
        let (first, n) = self.texts.as_ref()?;
        let some = if self.is_text() { String::new() } else { format!("{n} cells such as ") };
        Some(format!("{} (column {}, {some}{first:?})", self.title, self.number))
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

/// The first three letters of each month's names in English and German.
const MONTHS: [&str; 12] = [
    "jan", "feb", "mar mär", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov",
    "dec dez",
];

/// The month of a name.
fn month(name: &str) -> Option<i64> {
    let first: String = name.chars().take(3).collect();
    let mut months = (1..).zip(MONTHS);
    Some(months.find(|(_, names)| names.split(' ').any(|known| known == first))?.0)
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
    use crate::ImportOptions;
    use noctograph_core::files::Budget;

    fn read(bytes: &[u8], file: &str, names: &[&str]) -> Result<Sheet> {
        let (options, budget) = (&ImportOptions::default(), &Budget::of(file, HINT));
        Sheet::read(bytes, Job { file, options, budget }, names, |_| true)
    }

    #[test]
    fn dates_count_seconds() {
        assert_eq!(seconds_from_date("1970-01-02 00:00:01.5"), Some(86_401.5));
        // date -u -d '2022-12-14 15:04:05' +%s
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
        assert_eq!(seconds_from_date("12:00:01.25 am"), Some(1.25));
        assert_eq!(seconds_from_date("12:00:01:250"), Some(43_201.25));
        let bad = "|x|2022-13-01 00:00:00|1:2:3:4 5|25:00:00|13:00:00 PM|12:00:00 CET|\
                   12:00:00-25:00|1:2:3:4:5";
        for date in bad.split('|') {
            assert_eq!(seconds_from_date(date), None, "{date:?}");
        }
    }

    #[test]
    fn header_separator_and_comments_are_found() {
        let titles = |sheet: &Sheet| -> Vec<String> {
            sheet.columns.iter().map(|column| column.title.clone()).collect()
        };
        let sheet = read(b"# t;X;Y\n0;1;nan\n# more\n1;;3\n", "f.csv", &[]).unwrap();
        assert_eq!(titles(&sheet), ["t", "X", "Y"]);
        let [t, x, y] = [0, 1, 2].map(|index| &sheet.columns[index].values);
        assert_eq!(*t, [0.0, 1.0]);
        assert!(y[0].is_nan() && x[1].is_nan(), "{sheet:?}");
        let sheet = read(b"0,1,2\n1,2,3,\n", "f.csv", &["t", "x"]).unwrap();
        assert_eq!(titles(&sheet), ["t", "x", "column3"]);
    }

    #[test]
    fn a_broken_cell_has_its_line_and_a_cut_line_is_left_out() {
        let error = read(b"t,x\n0,1\n1,a\n2,2\n", "f.csv", &[]).unwrap_err().to_string();
        assert!(error.contains("f.csv:3: column x") && error.contains("\"a\""), "{error}");
        let error = read(b"t,x\n0,1\n1\n2,2\n", "f.csv", &[]).unwrap_err().to_string();
        assert!(error.contains("f.csv:3"), "{error}");
        let sheet = read(b"t,x\n0,1\n1,2\n2", "f.csv", &[]).unwrap();
        assert_eq!((sheet.columns[0].values.len(), sheet.warnings.len()), (2, 1));
    }

    #[test]
    fn a_sheet_beyond_its_budget_is_refused_before_it_is_read() {
        let wide = vec!["a"; 1000].join(",") + "\n" + &"\n".repeat(40_000);
        let error = read(wide.as_bytes(), "f.csv", &[]).unwrap_err().to_string();
        assert!(error.contains("f.csv: found more data"), "{error}");
    }
}
