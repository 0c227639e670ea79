//! Tables of numbers as CSV, the file format of plans and flights.
//!
//! One header line is followed by rows of finite numbers. Unknown columns are kept. Written numbers
//! are rounded to multiples of 1e-6 (micrometers, microseconds, microradians) by [`on_grid`], so
//! that reading a product's file reproduces the product bit for bit.

use std::fmt::Display;
use std::io::Write;
use std::path::Path;

use crate::error::{Error, Result};
use crate::files::{Budget, Head, Limit, RowRules, Sheet, Text};
use crate::product::MAX_QUANTITY;

/// Maximum duration of a flight in s, twelve times the battery life of a Crazyflie.
pub const MAX_DURATION_S: f64 = 3600.0;

/// Code of the error for a file that covers more than [`MAX_DURATION_S`].
pub const FLIGHT_LONG: &str = "flight-long";

/// Largest magnitude allowed in a table, chosen so that squares and sums stay finite.
pub const MAX_NUMBER: f64 = 1e30;

/// Largest magnitude of a time in s, beyond which rounding loses microseconds. Unix timestamps of
/// this century are below this limit.
const MAX_TIME_S: f64 = 4e9;

/// Maximum size of a file, enough for an hour of 36 columns at 100 Hz in numbers of nine digits.
const LIMIT: Limit = Limit { bytes: 128 << 20, what: "a table", hint: SMALLER_HINT };

/// Number of units of 1e-6 above which numbers are not rounded. An `f64` is coarser there.
const MAX_SCALED: f64 = 4.5e15;
/// Number of steps of the grid of numbers in files per unit.
const PER_UNIT: f64 = 1e6;
/// Number of characters of a header that an error shows.
const MAX_SHOWN: usize = 60;

/// Returns a number rounded to a multiple of 1e-6, as files contain it. Negative zero becomes zero.
///
/// Numbers beyond 2^52 · 1e-6 are returned unchanged, because an `f64` has no finer digits there.
#[inline(always)]
pub fn on_grid(value: f64) -> f64 {
    // Adding and subtracting 2^52 rounds to the nearest whole number.
    const TWO_POW_52: f64 = 4_503_599_627_370_496.0;
    let size = (value * PER_UNIT).abs();
    let nearest = (size + TWO_POW_52) - TWO_POW_52;
    // Halves are rounded away from zero as by `round`, which is a function call on many processors.
    // The steps have no branch, so that the compiler can vectorize a row of numbers.
    let below = nearest - if nearest > size { 1.0 } else { 0.0 };
    let above = if size - below >= 0.5 { 1.0 } else { 0.0 };
    let rounded = (below + above).copysign(value) / PER_UNIT + 0.0;
    if size < MAX_SCALED { rounded } else { value }
}

/// Table read from a file, with named columns of equal length. The numbers in required columns are
/// finite.
#[derive(Debug)]
pub struct Table {
    file: String,
    sheet: Sheet,
}

impl Table {
    /// Reads a CSV file.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be opened. Returns [`Error::Input`] with line and
    /// column for a cell that is not a finite number, a row with too few or too many cells, or a
    /// table that is too large.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&LIMIT.read(path)?, &path.display().to_string())
    }

    /// Reads a table from the bytes of its file. `file` is the file's name in messages.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] in the cases of [`Self::read`].
    pub fn parse(bytes: &[u8], file: &str) -> Result<Self> {
        let text = Text::decode(bytes);
        let head = Head::find(&text.bytes);
        Self::below(head, &text, file, |_| true)
    }

    /// Reads the rows below a header. `is_needed` returns true for the titles of columns that must
    /// contain numbers. Texts in other columns become NaN. Numbers beyond ±[`MAX_NUMBER`] count as
    /// texts.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] in the cases of [`Self::read`].
    pub fn below(
        head: Head,
        text: &Text<'_>,
        file: &str,
        is_needed: fn(&str) -> bool,
    ) -> Result<Self> {
        // The whole sheet is read before texts in columns that need numbers are looked for.
        let budget = Budget::new(file, SMALLER_HINT);
        let number = |_, cell: &str| cell.parse().ok().filter(|v: &f64| v.abs() <= MAX_NUMBER);
        let (budget, hint, needs_line_ends) = (&budget, REWRITE_HINT, false);
        let rules = RowRules { file, budget, hint, needs_line_ends };
        let sheet = Sheet::read(text, head, rules, number)?;
        budget.bytes(size_of::<f64>() * sheet.n_rows() * sheet.columns.len())?;
        if let Some((column, line, cell)) = sheet.first_text(|column| is_needed(&column.title)) {
            let wanted = format!("a finite number within ±{MAX_NUMBER:e}");
            let place = format!("column {}", column.title);
            let hint =
                "write numbers, with times in seconds, or have the program write the file again";
            let error = Error::input(place, format_args!("{cell:?}"), wanted, hint);
            return Err(error.in_file(file, line as u64));
        }
        Ok(Self { file: file.to_owned(), sheet })
    }

    /// Returns notes on assumptions about the file, and on omitted rows.
    pub fn notes(&self) -> &[String] {
        &self.sheet.notes
    }

    /// Returns the line number of a row, from 1.
    pub fn line(&self, row: usize) -> usize {
        self.sheet.line(row)
    }

    /// Returns the number of rows.
    pub fn n_rows(&self) -> usize {
        self.sheet.n_rows()
    }

    /// Returns the values of a column by name.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] if there is no such column.
    pub fn column(&self, name: &str) -> Result<&[f64]> {
        self.find(name).ok_or_else(|| {
            let wanted = format!("a column {name}");
            let titles: Vec<&str> = self.columns_after("").map(|(title, _)| title).collect();
            let first: String = titles.join(",").chars().take(MAX_SHOWN).collect();
            Error::input("", first, wanted, REWRITE_HINT).in_file(&self.file, 1)
        })
    }

    /// Returns a column by name, or `None` if there is no such column.
    pub fn find(&self, name: &str) -> Option<&[f64]> {
        Some(self.columns_after("").find(|(title, _)| *title == name)?.1)
    }

    /// Returns the values of a column by name if each of them is within ±1e6.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for a missing column, or with the line of a number beyond ±1e6.
    pub fn quantity(&self, name: &str) -> Result<&[f64]> {
        let column = self.column(name)?;
        match column.iter().position(|value| value.abs() > MAX_QUANTITY) {
            None => Ok(column),
            Some(row) => {
                let wanted = format!("a number within ±{MAX_QUANTITY}");
                Err(self.wrong(name, self.line(row), column[row], wanted, REWRITE_HINT))
            }
        }
    }

    /// Returns the error for a value in a line of a column, with the file's name.
    pub(super) fn wrong(
        &self,
        name: &str,
        line: usize,
        found: impl Display,
        wanted: impl Into<String>,
        hint: &str,
    ) -> Error {
        Error::input(format!("column {name}"), found, wanted, hint).in_file(&self.file, line as u64)
    }

    /// True if there is a column with this name.
    pub fn has(&self, name: &str) -> bool {
        self.find(name).is_some()
    }

    /// Returns the columns whose names begin with `prefix`, each with the rest of its name.
    pub fn columns_after<'a>(
        &'a self,
        prefix: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a [f64])> {
        let columns = self.sheet.columns.iter();
        columns.filter_map(move |column| {
            Some((column.title.strip_prefix(prefix)?, &column.values[..]))
        })
    }

    /// Returns a column of times in seconds.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for an empty column, and with the line of a time that is earlier
    /// than the one before it, or more than an hour after the first.
    pub fn times_s(&self, name: &str) -> Result<&[f64]> {
        self.times_in(name, 1.0)
    }

    /// Returns a column of times in units of `unit_s` seconds, which must not decrease. Errors are
    /// those of [`Self::times_s`].
    pub fn times_in(&self, name: &str, unit_s: f64) -> Result<&[f64]> {
        let times = self.column(name)?;
        if times.is_empty() {
            return Err(Error::input("", "no row", "at least one row", REWRITE_HINT)
                .in_file(&self.file, None));
        }
        if let Some(row) = times.windows(2).position(|pair| pair[1] < pair[0]) {
            let wanted = format!("at least {}, the time in the previous row", times[row]);
            let (line, hint) = (self.line(row + 1), "sort the rows by time");
            return Err(self.wrong(name, line, times[row + 1], wanted, hint));
        }
        // Times beyond 4e9 s lose microseconds to rounding.
        let first_s = times[0] * unit_s;
        let mut times_s = times.iter().map(|time| time * unit_s);
        if let Some(row) =
            times_s.position(|t_s| t_s.abs() > MAX_TIME_S || t_s - first_s > MAX_DURATION_S)
        {
            let wanted = format!("seconds, at most {MAX_DURATION_S} after the first");
            return Err(self.wrong(name, self.line(row), times[row], wanted, MILLISECONDS_HINT));
        }
        Ok(times)
    }
}

/// Hint for a flight longer than an hour.
pub const MILLISECONDS_HINT: &str =
    "are the times in milliseconds? Convert them to seconds, or cut the file to one flight";

const SMALLER_HINT: &str = "reduce the sample rate of the log, or split the log into parts";

pub(super) const REWRITE_HINT: &str = "correct the file, or write it again with the program";

/// Writes the header and the rows of a table as CSV, with numbers rounded to multiples of 1e-6.
///
/// # Errors
///
/// Returns the errors of the writer.
pub fn write_table(
    out: &mut impl Write,
    header: &[String],
    rows: impl Iterator<Item = impl IntoIterator<Item = f64>>,
) -> std::io::Result<()> {
    writeln!(out, "{}", header.join(","))?;
    // One buffer is used for all lines. Each number is followed by a comma, and the last comma of a
    // line is replaced by a line end.
    let mut line = Vec::new();
    for row in rows {
        line.clear();
        for value in row {
            push_number(&mut line, value);
            line.push(b',');
        }
        line.pop();
        line.push(b'\n');
        out.write_all(&line)?;
    }
    Ok(())
}

/// Appends a multiple of 1e-6 in as few digits as possible. The bytes are the same as those of
/// `Display`, which is too slow for the 300,000 numbers of a flight.
fn push_number(line: &mut Vec<u8>, value: f64) {
    /// Index of the decimal point, which leaves room for 17 digits before it and six after it.
    const POINT: usize = 17;
    let scaled = (value * PER_UNIT).abs();
    if scaled >= MAX_SCALED {
        line.extend_from_slice(value.to_string().as_bytes());
        return;
    }
    #[expect(clippy::cast_possible_truncation, reason = "below 4.5e15")]
    let millionths = (scaled + 0.5) as u64;
    if value < 0.0 && millionths > 0 {
        line.push(b'-');
    }
    let (mut whole, mut part) = (millionths / 1_000_000, (millionths % 1_000_000) as u32);
    // The digits are filled from the last to the first by division by constants, which the compiler
    // turns into multiplications.
    let mut digits = [b'.'; POINT + 7];
    for digit in digits[POINT + 1..].iter_mut().rev() {
        *digit = b'0' + (part % 10) as u8;
        part /= 10;
    }
    let mut first = POINT;
    loop {
        first -= 1;
        digits[first] = b'0' + (whole % 10) as u8;
        whole /= 10;
        if whole == 0 {
            break;
        }
    }
    let last = digits.iter().rposition(|digit| *digit != b'0').unwrap_or(first);
    // Zeros at the end of the fraction are left out, and so is the point if no digit follows it.
    line.extend_from_slice(&digits[first..if last == POINT { POINT } else { last + 1 }]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_are_no_finite_numbers_and_rows_of_another_length_are_refused() {
        let table = Table::parse(b"t, \"x\"\r\n0,1e-3\n\n 0.5 ,-2", "a.csv").unwrap();
        let columns: Vec<(&str, &[f64])> = table.columns_after("").collect();
        assert_eq!(columns, [("t", &[0.0, 0.5][..]), ("x", &[1e-3, -2.0])]);
        for broken in ["t,x\n0,1\n2\n", "t,x\n0,1,2\n", "t,x\n0,NaN\n", "t,x\n0,\n"] {
            assert!(Table::parse(broken.as_bytes(), "a.csv").is_err(), "{broken}");
        }
    }

    use proptest::prelude::*;

    fn text(value: f64) -> String {
        let mut line = Vec::new();
        push_number(&mut line, value);
        String::from_utf8(line).unwrap()
    }

    #[test]
    fn numbers_take_the_digits_they_need() {
        let cases =
            [(0.0, "0"), (-0.25, "-0.25"), (1_234.000_001, "1234.000001"), (65535.0, "65535")];
        for (value, wanted) in cases {
            assert_eq!(text(value), wanted);
        }
    }

    proptest! {
        #[test]
        fn a_number_on_the_grid_reads_back_bit_by_bit(value in -1e6..1e6_f64) {
            let value = on_grid(value);
            let back: f64 = text(value).parse().unwrap();
            prop_assert_eq!(back.to_bits(), value.to_bits());
        }
    }

    #[test]
    fn the_grid_is_the_nearest_with_halves_away_from_zero() {
        let wanted = |value: f64| (value * 1e6).round() / 1e6 + 0.0;
        let ties = (-9..9).map(|k| (f64::from(k) + 0.5) * 1e-6);
        let near = ties.flat_map(|tie| [tie.next_down(), tie, tie.next_up(), tie * 1e7, -tie]);
        let edges = [0.0, -0.0, 4.4e9, -4.4e9, 4.6e9, 1e300, -1e308];
        let drawn = (0..100_000).map(|k| f64::from(k) * 1.234_567_891e-4 - 6.0);
        for value in near.chain(edges).chain(drawn) {
            let wanted = if value.abs() > 4.5e9 { value } else { wanted(value) };
            assert_eq!(on_grid(value).to_bits(), wanted.to_bits(), "{value:e}");
        }
        assert!(on_grid(f64::NAN).is_nan(), "NaN stays NaN");
    }

    #[test]
    fn a_broken_cell_is_named_by_line_and_column() {
        for cell in ["NaN", "inf", "", "1,2", "x"] {
            let csv = format!("time_s,x_m\n0,1\n0.1,{cell}\n");
            let error = Table::parse(csv.as_bytes(), "plan.csv").unwrap_err().to_string();
            assert!(error.contains("plan.csv:3"), "{cell:?}: {error}");
        }
        let table = Table::parse(b"time_s\n0\n0.2\n0.1\n", "plan.csv").unwrap();
        let error = table.times_s("time_s").unwrap_err().to_string();
        assert!(error.contains("plan.csv:4") && error.contains("0.1"), "{error}");
    }

    #[test]
    fn a_table_of_too_many_numbers_is_refused_with_the_memory_of_the_limit() {
        let header = vec!["a"; 1000].join(",") + "\n";
        let row = vec!["0"; 1000].join(",") + "\n";
        let parse = |n| Table::parse((header.clone() + &row.repeat(n)).as_bytes(), "flight.csv");
        assert_eq!(parse(15_000).unwrap().n_rows(), 15_000, "an hour of 41 columns at 100 Hz");
        let error = parse(16_000).unwrap_err().to_string();
        assert!(error.contains("flight.csv: found more data"), "{error}");
        assert!(error.contains("at most 240 MiB of memory"), "{error}");
    }
}
