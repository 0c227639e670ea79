//! Reader for all tables, which finds a text's header and converts its rows to columns of numbers.
//!
//! The reader accepts commas, semicolons, tabs or blanks between cells, decimal commas if no cell
//! has a point, quotation marks, comments (`#`, `%`, `//`) and other lines before the header, a
//! header that is itself a comment, and a line of units below the header.

use super::csv_cell::{is_date, is_grouped, is_number, short_number, unquoted, with_points};
use super::{Budget, Text, push};
use crate::error::{Error, Result};
use crate::input_error;

/// Number of lines at the beginning of a file that are searched for the first row.
const HEAD_LINES: usize = 200;
/// Maximum number of columns of a table.
const MAX_COLUMNS: usize = 1024;
/// Steps of work charged to the budget per byte, and additionally per cell.
const STEPS_PER_BYTE: usize = 1;
const STEPS_PER_CELL: usize = 60;
/// Maximum number of distinct texts per column, and of characters per text, kept for messages.
const MAX_TEXTS: usize = 4;
const MAX_TEXT_CHARS: usize = 60;
/// Number of characters of a line that a note shows.
const MAX_NOTE_CHARS: usize = 40;
/// Maximum length in bytes of a unit, or of a name within a group, in the line below the titles.
const MAX_UNIT_BYTES: usize = 8;

/// Separator between the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Separator {
    /// A comma, a semicolon or a tab.
    Byte(u8),
    /// One or more blanks.
    Blanks,
}

/// Header of a table.
#[derive(Clone, Debug)]
pub struct Head {
    /// Titles of the columns, each with its unit in brackets, or empty if the file has no header.
    pub titles: Vec<String>,
    /// Number of columns.
    pub n_columns: usize,
    /// Separator between the cells.
    pub separator: Separator,
    /// Index of the line with the first row.
    pub row: usize,
    /// Notes on unread lines above the first row.
    pub notes: Vec<String>,
}

/// Rules for reading the rows of a table.
#[derive(Clone, Copy, Debug)]
pub struct RowRules<'a> {
    /// Name of the table in messages.
    pub file: &'a str,
    /// Limits of work and memory.
    pub budget: &'a Budget,
    /// Hint for a table that cannot be read.
    pub hint: &'a str,
    /// True if a last line without a line end is omitted, because its last number may be truncated.
    pub needs_line_ends: bool,
}

/// Table with columns of equal length.
#[derive(Debug)]
pub struct Sheet {
    /// The columns in the order of the file.
    pub columns: Vec<SheetColumn>,
    /// Notes on assumptions and omitted lines.
    pub notes: Vec<String>,
    /// Line number of each row.
    lines: Vec<u32>,
}

/// Column of a sheet, with NaN for cells that contain no number.
#[derive(Debug, Default)]
pub struct SheetColumn {
    /// Title of the column, or empty if it has none.
    pub title: String,
    /// Position of the column in the file, from 1.
    pub number: usize,
    /// Numbers of the column, one for each row.
    pub values: Vec<f64>,
    /// Number of cells that contain text.
    pub n_texts: usize,
    /// First distinct texts of the column.
    pub texts: Vec<String>,
    /// Line number of the first text.
    text_line: usize,
}

impl Separator {
    const ALL: [Self; 4] = [Self::Byte(b'\t'), Self::Byte(b';'), Self::Byte(b','), Self::Blanks];

    /// Returns the most frequent of tab, semicolon and comma in a line, or a comma if the line
    /// contains none of them.
    pub fn most_in(line: &[u8]) -> Self {
        let count = |sign: &u8| line.iter().filter(|byte| *byte == sign).count();
        Self::Byte([b'\t', b';', b','].into_iter().max_by_key(count).unwrap_or(b','))
    }

    /// Returns the cells of a line, trimmed but with their quotation marks. With [`Self::Blanks`],
    /// several blanks separate as one, so that no cell is empty.
    pub fn cells(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        // A separator within quotation marks belongs to its cell.
        let mut quoted = false;
        let line = if self == Self::Blanks { line.trim_ascii() } else { line };
        let cells = line.split(move |byte| {
            quoted ^= *byte == b'"';
            let separates = match self {
                Self::Byte(separator) => *byte == separator,
                Self::Blanks => *byte == b' ' || *byte == b'\t',
            };
            separates && !quoted
        });
        let cells = cells.map(<[u8]>::trim_ascii);
        cells.filter(move |cell| self != Self::Blanks || !cell.is_empty())
    }

    /// Returns the number of cells in a line, not counting empty cells at its end.
    fn count(self, line: &[u8]) -> usize {
        let filled = self.cells(line).enumerate().filter(|(_, cell)| !cell.is_empty());
        filled.last().map_or(0, |(place, _)| place + 1)
    }

    /// Returns the cells of a line as titles.
    fn titles(self, line: &[u8]) -> Vec<String> {
        let cells = self.cells(uncommented(line)).take(MAX_COLUMNS + 1);
        cells.map(|cell| String::from_utf8_lossy(unquoted(cell)).trim().to_owned()).collect()
    }

    /// True if a line is a row, whose first cell and most other cells are numbers or dates.
    fn is_row(self, line: &[u8]) -> bool {
        // Blanks as separators leave no cell empty. With other separators, empty cells are ignored.
        let cells: Vec<&[u8]> = self.cells(line).take(MAX_COLUMNS + 1).collect();
        let least = if self == Self::Blanks { 3 } else { 2 };
        let filled = cells.iter().filter(|cell| !cell.is_empty());
        let are_numbers: Vec<bool> = filled.map(|cell| is_number(cell) || is_date(cell)).collect();
        let n_numbers = are_numbers.iter().filter(|is_number| **is_number).count();
        cells.len() >= least
            // A date such as `2026-03-03 10:00` contains a blank that does not separate cells.
            && (self != Self::Blanks || n_numbers == cells.len())
            && are_numbers.first() == Some(&true)
            // A line such as `; 2026-03-03` is a remark, not a row.
            && (are_numbers.len() > 1 || !cells[0].is_empty())
            && 2 * n_numbers >= are_numbers.len()
    }
}

/// Returns the lines of a text, including empty ones, so that their indices give line numbers.
fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|byte| *byte == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line))
}

impl Head {
    /// Finds the header of a table, which is the line of titles above the first row of numbers,
    /// within the first 200 lines. Without such a row, the first line is the header.
    pub fn find(text: &[u8]) -> Self {
        let lines: Vec<&[u8]> = lines(text).take(HEAD_LINES).collect();
        let rows = lines.iter().enumerate().filter(|(_, line)| !is_comment(line));
        // The first row is the first line that any of the separators splits into a row of numbers.
        let first = { rows }.find_map(|(index, line)| {
            Some((index, Separator::ALL.into_iter().find(|s| s.is_row(line))?))
        });
        match first {
            Some((row, separator)) => Self::above_row(&lines, row, separator),
            None => Self::without_rows(&lines),
        }
    }

    /// Returns the header above the first row of numbers, which is the line with index `row` in the
    /// lines of the file. Titles, units and names of groups are looked for in the lines above.
    fn above_row(lines: &[&[u8]], row: usize, separator: Separator) -> Self {
        let LinesAbove { filled, mut bare, fitting, both } =
            LinesAbove::sort(lines, row, separator);
        // If no line has as many cells as the row, the last line is taken as the header. The row is
        // then refused with its line number.
        let title_line = both.first().or(fitting.last()).or(bare.last()).copied();
        let mut titles = title_line.map_or(Vec::new(), |index| separator.titles(lines[index]));
        // In a pandas table with two column levels, group names repeat, whereas titles never do.
        let in_groups =
            titles.iter().enumerate().any(|(i, t)| !t.is_empty() && titles[..i].contains(t));
        // A second line of short names contains units, or names within groups.
        let is_short = |cell: &[u8]| cell.len() <= MAX_UNIT_BYTES;
        let unit_line = match both[..] {
            [_, second] if separator.cells(lines[second]).all(is_short) => Some(second),
            _ => None,
        };
        if let Some(index) = unit_line {
            add_units(&mut titles, &separator.titles(lines[index]), in_groups);
        }
        // Below a line of groups, a line with one cell contains only the index name.
        for index in filled.iter().filter(|_| in_groups) {
            if separator.count(lines[*index]) == 1 {
                titles[0] = separator.titles(lines[*index]).swap_remove(0);
            }
        }
        // Other lines above the row that are not comments are noted, because they are not read.
        bare.retain(|index| ![title_line, unit_line].contains(&Some(*index)));
        let notes = bare.into_iter().map(|index| {
            let line = String::from_utf8_lossy(lines[index]);
            let shown: String = line.trim().chars().take(MAX_NOTE_CHARS).collect();
            format!("line {} precedes the header and is not read: {shown}", index + 1)
        });
        let n_cells = separator.cells(lines[row]).count();
        let n_columns = if titles.is_empty() { n_cells } else { titles.len() };
        Self { titles, n_columns, separator, row, notes: notes.collect() }
    }

    /// Returns the header of a table without rows, which is its first line unless that is mostly
    /// numbers.
    fn without_rows(lines: &[&[u8]]) -> Self {
        let filled = lines.iter().enumerate().filter(|(_, line)| !line.trim_ascii().is_empty());
        let bare = filled.clone().find(|(_, line)| !is_comment(line));
        let first = bare.or(filled.clone().next());
        let (first, line) = first.map_or((0, &b""[..]), |(index, line)| (index, *line));
        let separator = Separator::most_in(line);
        let titles = separator.titles(line);
        let n_numbers = titles.iter().filter(|title| title.parse::<f64>().is_ok()).count();
        if 2 * n_numbers > titles.len() {
            // The line is a row that begins with text. The table therefore has no titles.
            return Self { n_columns: titles.len(), ..Self::named(Vec::new(), separator, first) };
        }
        Self::named(titles, separator, first + 1)
    }

    /// Creates a header from known titles. `row` is the index of the line of the first row.
    pub fn named(titles: Vec<String>, separator: Separator, row: usize) -> Self {
        Self { n_columns: titles.len(), titles, separator, row, notes: Vec::new() }
    }

    /// True if a column has this title.
    pub fn has(&self, title: &str) -> bool {
        self.titles.iter().any(|other| other == title)
    }
}

/// Indices of the lines above the first row that are not empty.
#[derive(Default)]
struct LinesAbove {
    /// All these lines.
    filled: Vec<usize>,
    /// Lines that are not comments.
    bare: Vec<usize>,
    /// Lines with as many titles as the row contains cells.
    fitting: Vec<usize>,
    /// Lines that are not comments and have as many titles as the row contains cells.
    both: Vec<usize>,
}

impl LinesAbove {
    /// Classifies the lines above a row by their number of cells, and by whether they are comments.
    fn sort(lines: &[&[u8]], row: usize, separator: Separator) -> Self {
        let (n_filled, n_cells) =
            (separator.count(lines[row]), separator.cells(lines[row]).count());
        let mut above = Self::default();
        for (index, line) in lines[..row].iter().enumerate() {
            if line.trim_ascii().is_empty() {
                continue;
            }
            // A blank within a title can raise the number of titles, and empty cells at the end of
            // a row lower the number of filled cells.
            let n_titles = separator.count(uncommented(line));
            let may_end_empty = separator != Separator::Blanks && n_titles > n_filled;
            let fits = n_titles == n_filled || may_end_empty && n_titles == n_cells;
            let is_bare = !is_comment(line);
            above.filled.push(index);
            above.bare.extend(is_bare.then_some(index));
            above.fitting.extend(fits.then_some(index));
            above.both.extend((fits && is_bare).then_some(index));
        }
        above
    }
}

/// Appends the cells of a second line to the titles. The cells are names within groups if
/// `in_groups`, and units otherwise.
fn add_units(titles: &mut [String], cells: &[String], in_groups: bool) {
    for (title, cell) in titles.iter_mut().zip(cells) {
        match cell.trim_matches(['[', ']', '(', ')']) {
            "" | "-" => {}
            name if in_groups => *title = format!("{title}/{name}"),
            unit => *title = format!("{title} [{unit}]"),
        }
    }
}

impl Sheet {
    /// Reads the rows of a table. `parse_cell` takes the column's index and a cell that is not a
    /// plain number, and returns its value, or `None` for text. Comments and empty lines are
    /// skipped. If the rules need line ends, a last line without one is left out, with a note.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for a row with too few or many cells, or if the table is too large.
    pub fn read(
        text: &Text<'_>,
        head: Head,
        RowRules { file, budget, hint, needs_line_ends }: RowRules<'_>,
        mut parse_cell: impl FnMut(usize, &str) -> Option<f64>,
    ) -> Result<Self> {
        let n = head.n_columns;
        if n > MAX_COLUMNS {
            return Err(input_error!(file, "{n} columns", "at most {MAX_COLUMNS}", "{hint}"));
        }
        budget.steps(STEPS_PER_BYTE * text.bytes.len())?;
        // All numbers in a table use the same decimal and thousands separators.
        let mut sheet = Self::without_rows(&head);
        sheet.notes = text.notes.iter().chain(&head.notes).cloned().collect();
        let form =
            NumberForm::detect(&text.bytes, &head).map_err(|error| error.in_file(file, None))?;
        sheet.notes.extend(form.note());
        let mut number = |place: usize, cell: &[u8]| {
            let parsed = form.number(cell);
            parsed.or_else(|| parse_cell(place, &String::from_utf8_lossy(unquoted(cell))))
        };
        let mut row = vec![0.0; n];
        let mut rows = lines(&text.bytes).enumerate().skip(head.row).peekable();
        while let Some((index, line)) = rows.next() {
            if is_comment(line) || line.iter().all(is_empty) {
                continue;
            }
            let line_number = index + 1;
            if needs_line_ends && rows.peek().is_none() {
                sheet.notes.push(format!(
                    "line {line_number} has no line end and is left out: it may be cut off"
                ));
                break;
            }
            budget.bytes(size_of::<f64>() * (n + 1))?;
            budget.steps(STEPS_PER_CELL * n)?;
            push(&mut sheet.lines, u32::try_from(line_number).unwrap_or(u32::MAX));
            // Most rows contain only plain numbers. Other rows are read cell by cell.
            if form.thousands.is_none() && plain_row(line, head.separator, &mut row).is_some() {
                let values = sheet.columns.iter_mut().map(|column| &mut column.values);
                values.zip(&row).for_each(|(values, value)| push(values, *value));
            } else if !sheet.push_row(line, line_number, head.separator, &mut number) {
                let count = format!("{} of {n} cells", head.separator.cells(line).count());
                let wanted = "as many cells as the header has titles";
                let error = Error::input("row", count, wanted, hint);
                return Err(error.in_file(file, line_number as u64));
            }
        }
        Ok(sheet)
    }

    /// Adds the cells of a line, after `number` has parsed them from the column's index and the
    /// cell. Returns false if the line has fewer or more cells than the sheet has columns, in which
    /// case the first columns are longer than the others.
    fn push_row(
        &mut self,
        line: &[u8],
        line_number: usize,
        separator: Separator,
        mut number: impl FnMut(usize, &[u8]) -> Option<f64>,
    ) -> bool {
        let mut cells = separator.cells(line);
        for (place, column) in self.columns.iter_mut().enumerate() {
            let Some(cell) = cells.next() else { return false };
            column.push(number(place, cell), cell, line_number);
        }
        // A separator at the end of each line adds one empty cell.
        cells.all(<[u8]>::is_empty)
    }

    /// Creates a sheet with the columns of a header, and without rows.
    fn without_rows(head: &Head) -> Self {
        let titles = head.titles.iter().cloned().chain(std::iter::repeat(String::new()));
        let column = |(number, title)| SheetColumn { title, number, ..SheetColumn::default() };
        let columns = (1..=head.n_columns).zip(titles).map(column).collect();
        Self { columns, notes: Vec::new(), lines: Vec::new() }
    }

    /// Returns the line number of a row, from 1.
    pub fn line(&self, row: usize) -> usize {
        self.lines.get(row).map_or(1, |line| *line as usize)
    }

    /// Returns the number of rows.
    pub fn n_rows(&self) -> usize {
        self.lines.len()
    }

    /// Returns the first cell of text in a column that needs numbers, its column and its line
    /// number.
    pub fn first_text(
        &self,
        is_needed: impl Fn(&SheetColumn) -> bool,
    ) -> Option<(&SheetColumn, usize, &str)> {
        let texts = self.columns.iter().filter(|column| column.n_texts > 0 && is_needed(column));
        let first = texts.min_by_key(|column| column.text_line)?;
        Some((first, first.text_line, &first.texts[0]))
    }
}

impl SheetColumn {
    /// Adds a row's cell to the column, as a number or, with the value NaN, as text.
    fn push(&mut self, value: Option<f64>, cell: &[u8], line: usize) {
        push(&mut self.values, value.unwrap_or(f64::NAN));
        if value.is_none() {
            // The first text's line number and the first distinct texts are kept for messages.
            self.text_line = if self.n_texts == 0 { line } else { self.text_line };
            self.n_texts += 1;
            if self.texts.len() < MAX_TEXTS {
                let text = String::from_utf8_lossy(unquoted(cell));
                let shown: String = text.chars().take(MAX_TEXT_CHARS).collect();
                if !self.texts.contains(&shown) {
                    self.texts.push(shown);
                }
            }
        }
    }

    /// True if there are cells, and all of them are texts.
    pub fn is_text(&self) -> bool {
        self.n_texts > 0 && self.n_texts == self.values.len()
    }
}

/// True for a byte that an otherwise empty line may contain, such as a blank or a separator.
fn is_empty(byte: &u8) -> bool {
    matches!(byte, b' ' | b'\t' | b',' | b';' | b'"' | b'\r')
}

/// True if a line is a comment.
fn is_comment(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    line.starts_with(b"#") || line.starts_with(b"%") || line.starts_with(b"//")
}

/// Returns a line without the comment sign and blanks at its beginning.
fn uncommented(line: &[u8]) -> &[u8] {
    let begin = line.iter().take_while(|byte| b"#%/ \t".contains(byte)).count();
    if is_comment(line) { &line[begin..] } else { line }
}

/// Number format of a table, given by the decimal and thousands separators.
struct NumberForm {
    /// Thousands separator, if the numbers have one.
    thousands: Option<u8>,
    has_decimal_commas: bool,
}

impl NumberForm {
    /// Detects the decimal and thousands separators of a table. Returns an error if a comma could
    /// be either.
    fn detect(text: &[u8], head: &Head) -> Result<Self> {
        // If commas separate cells, numbers contain commas only within quotation marks.
        let separates_by_commas = head.separator == Separator::Byte(b',');
        if separates_by_commas && !text.contains(&b'"') {
            return Ok(Self { thousands: None, has_decimal_commas: false });
        }
        let rows = || lines(text).skip(head.row).filter(|line| !is_comment(line));
        let any_number_has = |sign: u8| {
            let mut cells = rows().flat_map(|line| head.separator.cells(line)).map(unquoted);
            cells.any(|cell| cell.contains(&sign) && is_number(cell))
        };
        let has_commas = any_number_has(b',');
        // A cell with commas and a point can be a number only if the commas separate thousands.
        let may_have_commas = separates_by_commas
            || has_commas
            || lines(text).skip(head.row).any(|line| line.contains(&b','));
        // A point can separate thousands only in a table without commas or blanks as separators.
        let thousands = match (may_have_commas, head.separator) {
            (true, _) => thousands_separator(rows(), head, b',')?,
            (false, Separator::Blanks) => None,
            (false, Separator::Byte(_)) => thousands_separator(rows(), head, b'.')?,
        };
        // In a table with decimal points, a cell with a comma counts as text.
        let has_decimal_commas = thousands.is_none() && has_commas && !any_number_has(b'.');
        Ok(Self { thousands, has_decimal_commas })
    }

    /// Returns a note on separators that a reader may not expect, or `None` for plain numbers.
    fn note(&self) -> Option<String> {
        match self.thousands {
            Some(sign) => {
                Some(format!("`{}` separates thousands in its numbers", char::from(sign)))
            }
            None => self.has_decimal_commas.then(|| "its numbers have decimal commas".into()),
        }
    }

    /// Returns the number in a cell, or `None` if the cell is not in the table's number format.
    fn number(&self, cell: &[u8]) -> Option<f64> {
        let bare = unquoted(cell);
        let text = match self.thousands {
            None => match short_number(cell) {
                Some((value, length)) if length == cell.len() => return Some(value),
                _ if self.has_decimal_commas && is_number(bare) => with_points(bare),
                _ => return None,
            },
            Some(sign) => bare.iter().copied().filter(|byte| *byte != sign).collect(),
        };
        std::str::from_utf8(&text).ok()?.parse().ok()
    }
}

/// Returns `sign` if this character separates thousands. Returns `None` if a number begins with
/// zero or does not have exactly three digits after the sign. The character certainly separates
/// thousands if its column also contains whole numbers below a thousand, or if a number contains it
/// twice or contains both a comma and a point. Otherwise, a point is the decimal point, and a comma
/// is an error.
fn thousands_separator<'a>(
    rows: impl Iterator<Item = &'a [u8]>,
    head: &Head,
    sign: u8,
) -> Result<Option<u8>> {
    // Each column has two flags, for whole numbers of two or three digits and for `sign`.
    let mut columns = vec![[false; 2]; head.n_columns];
    let (mut first, mut is_clear) = (None, false);
    for line in rows {
        for (cell, column) in head.separator.cells(line).zip(&mut columns) {
            let bare = unquoted(cell);
            let n = bare.iter().filter(|byte| **byte == sign).count();
            if n == 0 {
                column[0] |= (2..=3).contains(&bare.len()) && bare.iter().all(u8::is_ascii_digit);
                continue;
            }
            if !is_grouped(bare, sign) {
                return Ok(None);
            }
            is_clear |= n > 1 || sign == b',' && bare.contains(&b'.');
            column[1] = true;
            first.get_or_insert(bare);
        }
    }
    let Some(first) = first else { return Ok(None) };
    if is_clear || columns.contains(&[true; 2]) {
        return Ok(Some(sign));
    }
    if sign == b'.' {
        return Ok(None);
    }
    let actual = format!("{:?}", String::from_utf8_lossy(first));
    let wanted = "numbers without thousands separators, or unambiguous decimal commas";
    let hint = "write them with a decimal point (in a spreadsheet: format the cells as General, and \
                export again)";
    Err(Error::input("numbers", actual, wanted, hint))
}

/// Reads a line of only short numbers and separators into `row`, which has one place for each
/// column. Returns `None` for any other line, of which the first numbers may be in `row`.
fn plain_row(mut line: &[u8], separator: Separator, row: &mut [f64]) -> Option<()> {
    let Separator::Byte(separator) = separator else { return None };
    for (place, value) in row.iter_mut().enumerate() {
        line = if place > 0 { line.strip_prefix(&[separator])? } else { line };
        let length;
        (*value, length) = short_number(line)?;
        line = &line[length..];
    }
    line.is_empty().then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &[u8]) -> Result<Sheet> {
        let (text, budget) = (Text::decode(text), Budget::new("f.csv", "none"));
        let head = Head::find(&text.bytes);
        let (file, hint, needs_line_ends) = ("f.csv", "none", true);
        let rules = RowRules { file, budget: &budget, hint, needs_line_ends };
        Sheet::read(&text, head, rules, |_, cell| match cell {
            "" => Some(f64::NAN),
            cell => cell.parse().ok(),
        })
    }

    fn titles(sheet: &Sheet) -> Vec<&str> {
        sheet.columns.iter().map(|column| &*column.title).collect()
    }

    #[test]
    fn every_way_of_writing_a_table_is_one_table() {
        for text in [
            "t,x,y\n0.5,1,-2.25\n1.5,2,3\n",
            "\u{feff}t,x,y\n0.5,1,-2.25\n1.5,2,3\n",
            "t,x,y\r0.5,1,-2.25\r1.5,2,3\r",
            "t;x;y\n0,5;1;-2,25\n1,5;2;3\n",
            "t\tx\ty\n0,5\t1\t-2,25\n1,5\t2\t3\n",
            "t x y\n0.5  1 -2.25\n 1.5 2  3\n",
            "t,x,y\n\"0,5\",1,\"-2,25\"\n\"1,5\",2,3\n",
            "# t,x,y\n0.5,1,-2.25\n1.5,2,3\n",
            "# of May\n# t x y\n0.5 1 -2.25\n1.5 2 3\n",
            "% of May\nt,x,y\n\n0.5,1,-2.25\n# more\n1.5,2,3,\n",
            "Log of drone 3\n\nt;x;y\n0,5;1;-2,25\n1,5;2;3\n",
            "; 2026-03-03\nt,x,y\n0.5,1,-2.25\n1.5,2,3\n",
        ] {
            let sheet = read(text.as_bytes()).unwrap();
            assert_eq!(titles(&sheet), ["t", "x", "y"], "{text:?}");
            let columns: Vec<&[f64]> = sheet.columns.iter().map(|c| &*c.values).collect();
            assert_eq!(columns, [[0.5, 1.5], [1.0, 2.0], [-2.25, 3.0]], "{text:?}");
        }
        assert_eq!(titles(&read(b"t,x\ns,mm\n0,1\n").unwrap()), ["t [s]", "x [mm]"]);
        let groups = read(b",p,p,a\n,x,y,yaw\ntime,,,\n0,1,2,3\n").unwrap();
        assert_eq!(titles(&groups), ["time", "p/x", "p/y", "a/yaw"]);
        assert_eq!(titles(&read(b"0,1\n1,2\n").unwrap()), ["", ""], "no head");
    }

    #[test]
    fn rows_keep_their_lines_and_what_is_left_out_is_noted() {
        let sheet = read(b"Log 3\n# a\nt;x\n0,5;1\n").unwrap();
        assert_eq!(sheet.line(0), 4);
        assert!(sheet.notes[0].contains("line 1") && sheet.notes[0].contains("Log 3"), "{sheet:?}");
        assert!(sheet.notes[1].contains("decimal commas"), "{sheet:?}");
        let error = read(b"t,x\n0,1\n1\n2,2\n").unwrap_err().to_string();
        assert!(error.contains("f.csv:3") && error.contains("1 of 2 cells"), "{error}");
        let sheet = read(b"t,x\n0,1\n1,2\n2").unwrap();
        assert_eq!((sheet.n_rows(), sheet.columns[1].values.len(), sheet.notes.len()), (2, 2, 1));
    }

    #[test]
    fn commas_beside_points_are_texts() {
        let sheet = read(b"t;x\n0.5;1,234\n1.5;2,5\n").unwrap();
        let first = sheet.first_text(|_| true).map(|(_, line, text)| (line, text));
        assert_eq!(first, Some((2, "1,234")), "{sheet:?}");
        assert!(sheet.notes.is_empty(), "{sheet:?}");
        assert!(read(b"t;x\n1.234,5;1\n2.234,5;1\n").is_err());
    }

    proptest! {
        /// A blank before the first separator forces the row through the general reader.
        #[test]
        fn plain_rows_are_read_as_any_are(
            rows in proptest::collection::vec("-?[0-9]{1,3}(,-?[0-9]{0,9}[.]?[0-9]{0,9}(e3)?){2}", 1..9)
        ) {
            let text = |sep: &str| {
                rows.iter().fold("t,x,y\n".to_owned(), |text, row| text + &row.replacen(',', sep, 1) + "\n")
            };
            let [plain, other] = [",", " ,"].map(|sep| read(text(sep).as_bytes()).unwrap());
            let bits = |sheet: &Sheet| -> Vec<Vec<u64>> {
                let columns = sheet.columns.iter();
                columns.map(|c| c.values.iter().map(|value| value.to_bits()).collect()).collect()
            };
            prop_assert_eq!(bits(&plain), bits(&other));
            prop_assert_eq!(&plain.lines, &other.lines);
        }
    }
}
