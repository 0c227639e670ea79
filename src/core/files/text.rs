//! Text of tables in one form: commas between cells, points in numbers, the head in one line.
//!
//! Understood, and turned into that form line by line: UTF-16 and byte order marks; lines that end
//! in CR; semicolons, tabs or blanks between cells; decimal commas, where no cell has a point;
//! comments (`#`, `%`, `//`) and other lines before the head; a head that is a comment; a line of
//! units below the head. Lines keep their numbers.

use std::borrow::Cow;

/// Lines among which the first row is looked for.
const HEAD_LINES: usize = 200;

/// A text in that form.
#[derive(Debug)]
pub struct PlainText<'a> {
    /// Its lines, with commas between the cells.
    pub text: Cow<'a, [u8]>,
    /// What was done to it that a reader should know.
    pub notes: Vec<String>,
}

/// A table's text in the one form; what is no table stays as it is.
pub fn plain_text(bytes: &[u8]) -> PlainText<'_> {
    let text = with_line_feeds(decoded(bytes));
    let mut notes = Vec::new();
    let Some(head) = Head::find(&text).filter(|head| !head.is_plain) else {
        return PlainText { text, notes };
    };
    for (index, line) in text.split(|byte| *byte == b'\n').enumerate().take(head.row) {
        let is_read = [head.titles, head.units].contains(&Some(index));
        if !is_read && !line.trim_ascii().is_empty() && !is_comment(line) {
            let shown: String = String::from_utf8_lossy(line).trim().chars().take(40).collect();
            let number = index + 1;
            notes.push(format!("line {number} stands before the head and is not read: {shown}"));
        }
    }
    let mut decimals = Decimals::default();
    let mut plain = head.rewrite(&text, |line, cell| decimals.push(line, cell));
    if decimals.has_commas && decimals.has_points {
        // Two guesses fit: a comma may part thousands. The cells are refused as they are.
        plain = head.rewrite(&text, push_quoted);
    } else if decimals.has_commas {
        notes.push("its numbers have decimal commas".into());
    }
    PlainText { text: Cow::Owned(plain), notes }
}

/// Text of another encoding, or with a byte order mark, as UTF-8 without one.
pub fn decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    let wide = |unit: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(move |pair| unit([pair[0], pair[1]]));
        let text: String =
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        Cow::Owned(text.into_bytes())
    };
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => Cow::Borrowed(rest),
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => Cow::Borrowed(bytes),
    }
}

/// Text whose lines end in LF, where any ends in CR alone.
fn with_line_feeds(text: Cow<'_, [u8]>) -> Cow<'_, [u8]> {
    let mut pairs = text.iter().zip(text.iter().skip(1).chain(&[0]));
    if !text.contains(&b'\r') || !pairs.any(|(byte, next)| *byte == b'\r' && *next != b'\n') {
        return text;
    }
    let mut lines = Vec::with_capacity(text.len());
    for (at, byte) in text.iter().enumerate() {
        match byte {
            b'\r' if text.get(at + 1) == Some(&b'\n') => {}
            b'\r' => lines.push(b'\n'),
            byte => lines.push(*byte),
        }
    }
    Cow::Owned(lines)
}

/// Whether a line is a comment.
fn is_comment(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    line.starts_with(b"#") || line.starts_with(b"%") || line.starts_with(b"//")
}

/// What parts the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Byte(u8),
    Blanks,
}

impl Separator {
    const ALL: [Self; 4] = [Self::Byte(b'\t'), Self::Byte(b';'), Self::Byte(b','), Self::Blanks];

    /// The cells of a line, trimmed; quotation marks stay.
    fn cells(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        let mut quoted = false;
        let line = if self == Self::Blanks { line.trim_ascii() } else { line };
        let ends = move |byte: &u8| {
            quoted ^= *byte == b'"';
            !quoted
                && match self {
                    Self::Byte(separator) => *byte == separator,
                    Self::Blanks => *byte == b' ' || *byte == b'\t',
                }
        };
        let cells = line.split(ends).map(<[u8]>::trim_ascii);
        cells.filter(move |cell| self != Self::Blanks || !cell.is_empty())
    }

    /// How many cells a line has, without empty ones at its end.
    fn count(self, line: &[u8]) -> usize {
        let filled = self.cells(line).enumerate().filter(|(_, cell)| !cell.is_empty());
        filled.last().map_or(0, |(place, _)| place + 1)
    }
}

/// The lines before the first row, and what parts its cells.
struct Head {
    separator: Separator,
    /// Index of the first row's line.
    row: usize,
    /// Index of the line of titles.
    titles: Option<usize>,
    /// Index of a line of units below it.
    units: Option<usize>,
    /// Whether nothing is to be done.
    is_plain: bool,
}

impl Head {
    fn find(text: &[u8]) -> Option<Self> {
        let lines: Vec<&[u8]> = text.split(|byte| *byte == b'\n').take(HEAD_LINES).collect();
        let (row, separator) = lines.iter().enumerate().find_map(|(index, line)| {
            let separator = Separator::ALL.into_iter().find(|s| is_row(*s, line));
            Some((index, separator.filter(|_| !is_comment(line))?))
        })?;
        let n = separator.count(lines[row]);
        let before = || (0..row).filter(|index| !lines[*index].trim_ascii().is_empty());
        let fits = |index: &usize| {
            let n_titles = separator.count(uncommented(lines[*index]));
            // A title may have blanks in it, and a row an empty cell at its end.
            let may_end_empty = separator != Separator::Blanks && n_titles > n;
            n_titles == n || may_end_empty && n_titles == separator.cells(lines[row]).count()
        };
        let is_bare = |index: &usize| !is_comment(lines[*index]);
        let bare: Vec<usize> = before().filter(fits).filter(is_bare).collect();
        let titles = bare.first().copied();
        let titles = titles.or_else(|| before().rfind(fits));
        // Without a line that fits, the last one is the head, and its row is refused with its
        // place.
        let titles = titles.or_else(|| before().rfind(is_bare));
        let are_short = |index: &usize| separator.cells(lines[*index]).all(|cell| cell.len() <= 8);
        let units = bare.get(1).copied().filter(|index| bare.len() == 2 && are_short(index));
        let is_alone = match titles {
            Some(titles) => titles == 0 && row == 1 && is_bare(&titles),
            None => row == 0,
        };
        let has_commas = separator == Separator::Byte(b',') && !lines[row].contains(&b'"');
        Some(Self { separator, row, titles, units, is_plain: has_commas && is_alone })
    }

    /// The text with its titles in one line, nothing in the other lines above the rows, and commas
    /// between cells as `push` appends them.
    fn rewrite(&self, text: &[u8], mut push: impl FnMut(&mut Vec<u8>, &[u8])) -> Vec<u8> {
        let mut plain = Vec::with_capacity(text.len() + 16);
        for (index, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
            if index >= self.row && is_comment(line) {
                plain.extend(line);
                continue;
            }
            if Some(index) == self.titles {
                plain.extend(self.title_line(text).into_bytes());
            } else if index >= self.row {
                for (place, cell) in self.separator.cells(line).enumerate() {
                    plain.extend((place > 0).then_some(b','));
                    push(&mut plain, cell);
                }
            }
            plain.extend(line.last().filter(|byte| **byte == b'\n'));
        }
        plain
    }

    /// The titles with commas between them, their units in brackets.
    fn title_line(&self, text: &[u8]) -> String {
        let line = |index: usize| text.split(|byte| *byte == b'\n').nth(index).unwrap_or_default();
        let titles = uncommented(line(self.titles.unwrap_or_default()));
        let mut units = self.separator.cells(self.units.map_or(&b""[..], line));
        let cells = self.separator.cells(titles).map(|title| {
            let title = String::from_utf8_lossy(title).into_owned();
            let unit = units.next().map(String::from_utf8_lossy).unwrap_or_default();
            match unit.trim_matches(['[', ']', '(', ')']) {
                "" | "-" => title,
                unit => format!("{} [{unit}]", title.trim_matches('"')),
            }
        });
        let quote = |cell: String| match cell.contains(',') && !cell.starts_with('"') {
            true => format!("\"{cell}\""),
            false => cell,
        };
        cells.map(quote).collect::<Vec<_>>().join(",")
    }
}

/// A line without the sign of a comment.
fn uncommented(line: &[u8]) -> &[u8] {
    let is_sign = |byte: &u8| matches!(byte, b'#' | b'%' | b'/' | b' ' | b'\t');
    match is_comment(line) {
        true => &line[line.iter().take_while(|byte| is_sign(byte)).count()..],
        false => line,
    }
}

/// Whether a line is a row of a table: its first cell is a number or a date, and most others are.
fn is_row(separator: Separator, line: &[u8]) -> bool {
    let cells: Vec<&[u8]> = separator.cells(line).collect();
    let least = if separator == Separator::Blanks { 3 } else { 2 };
    let starts = |cell: &&[u8]| is_number(cell) || is_date(cell);
    let filled: Vec<_> = cells.iter().filter(|cell| !cell.is_empty()).collect();
    let numbers = filled.iter().filter(|cell| starts(cell)).count();
    // A date without a separator of its own has a blank in it.
    let whole = separator != Separator::Blanks || numbers == cells.len();
    cells.len() >= least
        && whole
        && filled.first().is_some_and(|cell| starts(cell))
        && 2 * numbers >= filled.len()
}

/// Whether a cell is a number, with a point or a comma.
fn is_number(cell: &[u8]) -> bool {
    let text = with_points(unquoted(cell));
    let commas = cell.iter().filter(|byte| **byte == b',').count();
    commas <= 1 && std::str::from_utf8(&text).is_ok_and(|text| text.parse::<f64>().is_ok())
}

/// A cell with points in place of its commas.
fn with_points(cell: &[u8]) -> Vec<u8> {
    cell.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect()
}

/// A cell without its quotation marks.
fn unquoted(cell: &[u8]) -> &[u8] {
    cell.strip_prefix(b"\"").and_then(|cell| cell.strip_suffix(b"\"")).unwrap_or(cell)
}

/// Whether a cell begins as a date or a time of day does.
fn is_date(cell: &[u8]) -> bool {
    let digits = cell.first().is_some_and(u8::is_ascii_digit);
    digits && cell.iter().any(|byte| matches!(byte, b':' | b'-' | b'/'))
}

/// Signs of decimals in a table's cells.
#[derive(Default)]
struct Decimals {
    has_commas: bool,
    has_points: bool,
}

impl Decimals {
    /// Appends a cell, its decimal comma as a point.
    fn push(&mut self, line: &mut Vec<u8>, cell: &[u8]) {
        let bare = unquoted(cell);
        let has = |sign: u8| bare.contains(&sign);
        if has(b',') && is_number(bare) {
            self.has_commas = true;
            line.extend(with_points(bare));
        } else if has(b':') && has(b',') && !has(b'.') {
            // A time of day with a decimal comma.
            line.extend(with_points(bare));
        } else if has(b',') {
            // No number: its reader says so.
            line.push(b'"');
            line.extend(bare);
            line.push(b'"');
        } else {
            self.has_points = self.has_points || has(b'.') && is_number(bare);
            line.extend(cell);
        }
    }
}

/// Appends a cell as it is, in quotation marks where it needs them.
fn push_quoted(line: &mut Vec<u8>, cell: &[u8]) {
    let quote = Some(b'"').filter(|_| cell.contains(&b',') && !cell.starts_with(b"\""));
    line.extend(quote);
    line.extend(cell);
    line.extend(quote);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(text: &[u8]) -> String {
        String::from_utf8(plain_text(text).text.into_owned()).unwrap()
    }

    #[test]
    fn every_way_of_writing_a_table_is_one_table() {
        let wanted = "t,x,y\n0.5,1,-2.25\n1.5,2,3\n";
        let utf16: Vec<u8> = [0xff, 0xfe]
            .into_iter()
            .chain(wanted.encode_utf16().flat_map(u16::to_le_bytes))
            .collect();
        assert_eq!(plain(&utf16), wanted, "UTF-16");
        for text in [
            wanted,
            "\u{feff}t,x,y\n0.5,1,-2.25\n1.5,2,3\n",
            "t,x,y\r0.5,1,-2.25\r1.5,2,3\r",
            "t;x;y\n0,5;1;-2,25\n1,5;2;3\n",
            "t\tx\ty\n0,5\t1\t-2,25\n1,5\t2\t3\n",
            "t x y\n0.5  1 -2.25\n 1.5 2  3\n",
            "t,x,y\n\"0,5\",1,\"-2,25\"\n\"1,5\",2,3\n",
        ] {
            assert_eq!(plain(text.as_bytes()), wanted, "{text:?}");
        }
        for text in [
            "# t,x,y\n0.5,1,-2.25\n1.5,2,3\n",
            "# of May\n# t x y\n0.5 1 -2.25\n1.5 2 3\n",
            "% of May\nt,x,y\n\n0.5,1,-2.25\n1.5,2,3\n",
            "Log of drone 3\n\nt;x;y\n0,5;1;-2,25\n1,5;2;3\n",
        ] {
            assert_eq!(
                plain(text.as_bytes()).trim_start().replace("\n\n", "\n"),
                wanted,
                "{text:?}"
            );
        }
        assert_eq!(plain(b"t,x\ns,mm\n0,1\n"), "t [s],x [mm]\n\n0,1\n", "a line of units");
    }

    #[test]
    fn lines_keep_their_numbers_and_what_is_left_out_is_noted() {
        let found = plain_text(b"Log 3\n# a\nt;x\n0,5;1\n");
        assert_eq!(&*found.text, b"\n\nt,x\n0.5,1\n");
        assert!(found.notes[0].contains("line 1") && found.notes[0].contains("Log 3"), "{found:?}");
        assert!(found.notes[1].contains("decimal commas"), "{found:?}");
    }

    #[test]
    fn commas_beside_points_stay_as_they_are() {
        assert_eq!(plain(b"t;x\n0.5;1,234\n1.5;2,5\n"), "t,x\n0.5,\"1,234\"\n1.5,\"2,5\"\n");
        assert_eq!(plain(b"no table"), "no table");
        let german = plain_text(b"t;x\n1.234,5;1\n2.234,5;1\n");
        assert!(!german.notes.iter().any(|note| note.contains("decimal")), "{german:?}");
    }
}
