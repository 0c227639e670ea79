//! Formats the JSON object of a report as text for people, by a layout.
//!
//! A layout consists of the lines of the text. Each line begins with a name, which ends at two
//! spaces, or at a tab if the words start at the usual column. The words after the name are
//! wrapped. A line may contain
//!
//! - `{path}`: the value at a path, such as `{rmse_m.0}`,
//! - `{path*100:+.1}`: the value times a factor, with a sign and one digit (`.1e`: with an
//!   exponent),
//! - `{path~none}`: the value, or `none` if it is null,
//! - `{path?yes:no}`: `yes` for true, a string, a number or a list with items, else `no`,
//! - `[words {path}]`: words that are omitted if a value in them is null.
//!
//! A null outside of brackets omits the whole line. A misspelled path is printed unchanged, so that
//! tests/house and tests/it/examples.rs detect it.
//!
//! `*path line` prints a line for each item of a list. Paths are looked up in the item first, and
//! `#` stands for its index. `|path|head` prints a [`table`] of a list, and the next line of the
//! layout gives the cells of a row. An empty line is printed only between two parts that are not
//! empty.

use serde_json::{Value, json};

/// Maximum width of tables and messages, in columns.
const WIDTH: usize = 80;

/// Width of a line's name, in columns.
const NAME_WIDTH: usize = 10;

static NULL: Value = Value::Null;

/// Returns the text of a layout. Each value is looked up in the last scope that contains it.
pub(super) fn print(layout: &str, scopes: &[&Value]) -> String {
    // Each line of the layout produces a part, which may be empty.
    let (mut text, mut is_apart) = (String::new(), false);
    let mut lines = layout.lines();
    while let Some(line) = lines.next() {
        if line.is_empty() {
            is_apart = true;
            continue;
        }
        let part = if let Some((path, head)) = strip(line, '|', '|') {
            let cells: Vec<&str> = lines.next().unwrap_or_default().split('|').collect();
            let row = |scopes: &[&Value]| {
                cells.iter().map(|cell| fill(cell, scopes).unwrap_or("-".to_owned())).collect()
            };
            let rows = each(path, scopes, row);
            let head = fill(head, scopes).unwrap_or_default();
            rows.map_or_else(|| unknown(path) + "\n", |rows| table(&head, &rows))
        } else if let Some((path, line)) = strip(line, '*', ' ') {
            let parts = each(path, scopes, |scopes| filled(line, scopes));
            parts.map_or_else(|| unknown(path) + "\n", |parts| parts.concat())
        } else {
            filled(line, scopes)
        };
        if !part.is_empty() {
            text += if std::mem::take(&mut is_apart) { "\n" } else { "" };
            text += &part;
        }
    }
    if layout.ends_with("\n\n") { text + "\n" } else { text }
}

/// Splits a line that begins with the character `first` at the next character `second`. Returns the
/// texts between both and after `second`, or `None` for another line.
fn strip(line: &str, first: char, second: char) -> Option<(&str, &str)> {
    line.strip_prefix(first)?.split_once(second)
}

/// Applies a function to each item of a list, with the item and its index (`#`) as the last scopes.
/// Returns `None` if no scope contains the list.
fn each<T>(path: &str, scopes: &[&Value], item: impl Fn(&[&Value]) -> T) -> Option<Vec<T>> {
    let items = value(path, scopes)?.as_array().into_iter().flatten().enumerate();
    let items = items.map(|(index, value)| {
        let index = json!({ "#": index.to_string() });
        item(&[scopes, &[&index, value]].concat())
    });
    Some(items.collect())
}

/// Returns a line of a layout with its values, or an empty text if one of the values is null. The
/// name at the beginning of the line stays beside the wrapped words.
fn filled(line: &str, scopes: &[&Value]) -> String {
    // The name ends at the first two spaces, which the words follow.
    let begin = line.find(|c| c != ' ').unwrap_or(0);
    let end = line[begin..].find("  ").map_or(begin, |end| begin + end);
    let (head, words) = line.split_at(end + line[end..].find(|c| c != ' ').unwrap_or(0));
    let (name, width, words) = match line.split_once('\t') {
        Some((name, words)) => (name, NAME_WIDTH, words),
        None => (head.trim_end(), head.chars().count(), words),
    };
    match (fill(name, scopes), fill(words, scopes)) {
        (Some(name), Some(words)) => beside(&name, width, &words),
        _ => String::new(),
    }
}

/// Returns a name with text wrapped beside it, or below it if the name is as wide as its column.
fn beside(name: &str, width: usize, text: &str) -> String {
    if name.chars().count() < width.max(1) {
        return wrapped(&format!("{name:width$}"), text);
    }
    wrapped("", name) + &wrapped(&" ".repeat(width), text)
}

/// Returns a line that consists of a name and text beside it.
pub(super) fn line(name: &str, text: &str) -> String {
    beside(name, NAME_WIDTH, text)
}

/// Returns a line with the values of its parts `{...}`, or `None` if one of them is null. A part
/// `[...]` with a null value is left out.
fn fill(line: &str, scopes: &[&Value]) -> Option<String> {
    let (mut text, mut rest) = (String::new(), line);
    while let Some(begin) = rest.find(['{', '[']) {
        text += &rest[..begin];
        let end = if rest[begin..].starts_with('{') { '}' } else { ']' };
        let (within, after) = rest[begin + 1..].split_once(end)?;
        match end {
            '}' => text += &figure(within, scopes)?,
            _ => text += &fill(within, scopes).unwrap_or_default(),
        }
        rest = after;
    }
    Some(text + rest)
}

/// Returns the text for the path between braces, or `None` if its value is null. The forms are
/// `path?yes:no` and `path*factor:digits~missing`, in which every part except the path is optional.
/// The digits of a string, such as `.4`, limit its number of characters.
fn figure(form: &str, scopes: &[&Value]) -> Option<String> {
    if let Some((path, words)) = form.split_once('?') {
        return Some(choice(path, words, scopes));
    }
    // The marks are split off from the end, so that no part can contain the mark of a later part.
    let (shown, missing) =
        form.split_once('~').map_or((form, None), |(shown, words)| (shown, Some(words)));
    let (scaled, digits) = shown.split_once(':').unwrap_or((shown, ""));
    let (path, factor) = scaled.split_once('*').unwrap_or((scaled, "1"));
    let text = match value(path, scopes) {
        Some(Value::Number(number)) => {
            let is_whole = factor == "1" && digits.is_empty() && !number.is_f64();
            match number.as_f64().filter(|_| !is_whole) {
                Some(number) => in_digits(number * factor.parse::<f64>().ok()?, digits),
                None => number.to_string(),
            }
        }
        Some(Value::String(text)) => {
            let most = digits.strip_prefix('.').and_then(|most| most.parse().ok());
            text.replace('\n', " ").chars().take(most.unwrap_or(usize::MAX)).collect()
        }
        Some(Value::Null) => return missing.map(str::to_owned),
        None => unknown(path),
        Some(other) => other.to_string(),
    };
    Some(text)
}

/// Returns the first of two words, separated by a colon, if the value at a path is true, or if it
/// is a string, a number or a list with items. Otherwise returns the second word.
fn choice(path: &str, words: &str, scopes: &[&Value]) -> String {
    let (yes, no) = words.split_once(':').unwrap_or((words, ""));
    let is_set = match value(path, scopes) {
        None => return unknown(path),
        Some(Value::Null) => false,
        Some(Value::Bool(is_set)) => *is_set,
        Some(Value::Array(items)) => !items.is_empty(),
        Some(_) => true,
    };
    if is_set { yes } else { no }.to_owned()
}

/// Returns a number as text with digits such as `+.2` or `.3e`. Without a number of digits, the
/// shortest text that yields the same number is returned.
fn in_digits(number: f64, digits: &str) -> String {
    let (sign, digits) = digits.strip_prefix('+').map_or(("", digits), |digits| ("+", digits));
    let (digits, is_power) = digits.strip_suffix('e').map_or((digits, false), |n| (n, true));
    let text = match (digits.strip_prefix('.').and_then(|n| n.parse::<usize>().ok()), is_power) {
        (Some(n), true) => format!("{number:.n$e}"),
        (Some(n), false) => format!("{number:.n$}"),
        (None, _) => format!("{number}"),
    };
    match text.strip_prefix('-') {
        // A value that rounds to zero gets no minus sign.
        Some(zero) if !zero.contains(|c| matches!(c, '1'..='9')) => sign.to_owned() + zero,
        Some(_) => text,
        None => sign.to_owned() + &text,
    }
}

/// Returns the value at a path of keys and indices, from the last scope that contains it. Members
/// of null, and items beyond the end of a list, are null.
fn value<'a>(path: &str, scopes: &[&'a Value]) -> Option<&'a Value> {
    let index = scopes.iter().rev().find_map(|scope| scope.get("#")?.as_str());
    let step = |value: &'a Value, key: &str| {
        let key = if key == "#" { index.unwrap_or(key) } else { key };
        match value {
            Value::Null => Some(value),
            Value::Array(items) => Some(items.get(key.parse::<usize>().ok()?).unwrap_or(&NULL)),
            _ => value.get(key),
        }
    };
    let keys = || path.split('.').filter(|key| !key.is_empty());
    let scopes = scopes.iter().filter(|scope| path.is_empty() || !scope.is_null());
    scopes.rev().find_map(|scope| keys().try_fold(*scope, step))
}

/// Returns the text for a path that no scope contains. The path itself is printed, because its line
/// would otherwise disappear silently.
fn unknown(path: &str) -> String {
    format!("{{{path}}}")
}

/// Returns a table, or an empty text if there are no rows. `head` gives for each column the name,
/// the unit, the side to which cells are aligned, and the width, as in `scene<16|time/s>7`.
pub(super) fn table(head: &str, rows: &[Vec<String>]) -> String {
    // A column has the form `name/unit<width`, of which the last `<` or `>` is the alignment.
    let columns = head.split('|').map(|column| {
        let side = str::rfind(column, ['<', '>']).expect("a side for each column");
        let width: usize = column[side + 1..].parse().expect("a width for each column");
        let (name, unit) = column[..side].split_once('/').unwrap_or((&column[..side], ""));
        (name, unit, &column[side..=side] == ">", width)
    });
    let columns: Vec<(&str, &str, bool, usize)> = columns.collect();
    let names = columns.iter().map(|(name, ..)| (*name).to_owned()).collect();
    let units: Vec<String> = columns.iter().map(|(_, unit, ..)| (*unit).to_owned()).collect();
    // Units, if there are any, are printed on a separate line.
    let has_units = units.iter().any(|unit| !unit.is_empty());
    let heads = [names, units].into_iter().take(if has_units { 2 } else { 1 });
    let heads: Vec<Vec<String>> = heads.filter(|_| !rows.is_empty()).collect();
    let lines = heads.iter().chain(rows).map(|cells| {
        let padded = columns.iter().zip(cells).map(|((.., is_right, width), cell)| {
            if *is_right { format!("{cell:>width$}") } else { format!("{cell:width$}") }
        });
        padded.collect::<String>().trim_end().to_owned() + "\n"
    });
    lines.collect()
}

/// Returns a prefix followed by text that is wrapped at 80 columns and indented to the prefix. A
/// command in backquotes is kept on one line, so that it can be copied.
pub(super) fn wrapped(head: &str, text: &str) -> String {
    let indent = head.chars().count();
    let mut lines = head.to_owned();
    // Lines are filled greedily. A word that does not fit on a line begins the next one.
    for (index, paragraph) in text.lines().enumerate() {
        if index > 0 {
            lines += &format!("\n{:indent$}", "");
        }
        let mut column = indent;
        let mut is_command = false;
        let parts = paragraph.split(|c| {
            is_command ^= c == '`';
            c == ' ' && !is_command
        });
        for word in parts {
            let width = word.chars().count();
            if column > indent && column + 1 + width > WIDTH {
                lines.truncate(lines.trim_end().len());
                lines += &format!("\n{:indent$}", "");
                column = indent;
            } else if column > indent {
                lines.push(' ');
                column += 1;
            }
            lines += word;
            column += width;
        }
    }
    lines.truncate(lines.trim_end().len());
    lines + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_layout_prints_values_words_and_tables() {
        let product = json!({
            "n": 3, "m": [0.0123, -2.5], "name": "NO\nOR", "legible": false, "none": null,
            "letters": [{"letter": "N", "p": 0.25}, {"letter": "O", "p": null}],
        });
        let words = json!({ "sides": ["left", "right"] });
        let layout = "\
            {name} is {legible?legible:NOT legible}\n\
            samples   {n} of {name:.2}[, {m.0*100:+.1} cm][, {none}]\n\
            never     {none}\n\
            power     {m.1:.1e} {none~dark} {m.1}\n\
            *letters {sides.#}: {letter}\n\
            \n\
            |none|gone<4\n\
            {}\n\
            \n\
            |letters|letter<8|share/%>6\n\
            {letter}|{p*100:.0}\n\
            end\n\
            \n\
            [{none}]never  {none}\n";
        let text = "NO OR is NOT legible\nsamples   3 of NO, +1.2 cm\npower     -2.5e0 dark -2.5\n\
                    left: N\nright: O\n\nletter   share\n             %\nN           25\n\
                    O            -\nend\n";
        assert_eq!(print(layout, &[&product, &words]), text);
    }

    #[test]
    fn a_path_that_leads_nowhere_is_printed() {
        let product = json!({ "n": 3, "none": null, "rows": [{ "a": 1 }], "empty": [] });
        for (layout, text) in [
            ("line  {m}", "line  {m}\n"),
            ("line  [a {m.0:.1}]b", "line  a {m.0}b\n"),
            ("line  {m?yes:no}", "line  {m}\n"),
            ("*rows row   {b} {n}", "row   {b} 3\n"),
            ("|rows|a<3\n{b}", "a\n{b}\n"),
            ("|lines|a<3\n{b}", "{lines}\n"),
            ("*lines a", "{lines}\n"),
            ("line  {none.m}", ""),
            ("line  {empty.0.m~-}", "line  -\n"),
        ] {
            assert_eq!(print(layout, &[&product, &Value::Null]), text, "{layout}");
        }
    }

    #[test]
    fn cells_stand_under_their_heads() {
        let rows = [["team", "0.9", "well"], ["µ", "0.25", ""], ["a long one", "1", "a\tb"]];
        let rows = rows.map(|row| row.map(str::to_owned).to_vec());
        assert_eq!(
            table("scene<8|P>5|  note<0", &rows),
            "scene       P  note\nteam      0.9well\nµ        0.25\na long one    1a\tb\n"
        );
        assert_eq!(table("scene<8", &[]), "");
    }

    #[test]
    fn lines_are_wrapped_beside_their_head() {
        let text = "word ".repeat(30);
        let actual = line("name", &text);
        let widths: Vec<usize> = actual.lines().map(str::len).collect();
        assert_eq!(widths, [79, 79, 19], "{actual}");
        assert!(actual.lines().skip(1).all(|line| line.starts_with("          word")), "{actual}");
        assert_eq!(line("", "two  spaces stay"), "          two  spaces stay\n");
    }

    #[test]
    fn a_name_and_its_text_never_touch() {
        assert_eq!(line("star.svg", "34.8 s"), "star.svg  34.8 s\n");
        for name in ["rocket.svg", "notre étoile.svg"] {
            assert_eq!(line(name, "34.8 s"), format!("{name}\n          34.8 s\n"));
        }
    }

    #[test]
    fn a_command_stays_on_one_line() {
        let actual = line("name", &format!("{} `run 'a b'` ends", "word ".repeat(13).trim_end()));
        let lines: Vec<&str> = actual.lines().collect();
        assert_eq!(lines[1], "          `run 'a b'` ends", "{actual}");
    }
}
