//! What a verb reports: a table for people, the same as JSON for programs, and its outcome.

use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use serde::Serialize;

use super::{Value, json};
use crate::score::Verdict;
use noctograph_core::files::STANDARD_OUTPUT;

/// Columns that tables and messages keep to.
const WIDTH: usize = 80;

/// Columns of the names of lines.
const NAME_WIDTH: usize = 10;

/// Result of a verb: figure by figure, a line for people and a member of an object for programs.
#[derive(Debug)]
pub struct Report {
    /// What people read: a table of at most 80 columns.
    pub text: String,
    /// An object.
    pub json: Value,
    pub(super) outcome: Outcome,
    /// Whether a file was written on standard output, so that this belongs on stderr.
    pub(super) aside: bool,
    /// Columns of the names of lines.
    name_width: usize,
}

/// What decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Done,
    NotLegible,
    NotSafe,
    Refused,
}

impl Report {
    /// The table, and what serializes as an object.
    pub(super) fn new(text: String, json: impl Serialize) -> Self {
        let json = serde_json::to_value(json).expect("a result is plain data");
        Self { text, json, outcome: Outcome::Done, aside: false, name_width: NAME_WIDTH }
    }

    /// What is for programs alone, to which figures are added.
    pub(super) fn of(json: impl Serialize) -> Self {
        Self::new(String::new(), json)
    }

    /// A report to which figures are added.
    pub(super) fn empty() -> Self {
        Self::of(json!({}))
    }

    /// The same with names of up to so many columns, less one.
    pub(super) fn with_names_of(name_width: usize) -> Self {
        Self { name_width, ..Self::empty() }
    }

    /// Adds a figure: its key and value for programs; its name for people, and the value with its
    /// unit, digits and explanation.
    pub(super) fn figure(&mut self, key: &str, value: impl Serialize, name: &str, text: &str) {
        self.value(key, value);
        self.line(name, text);
    }

    /// Adds a figure that may be missing: null for programs, and no line.
    pub(super) fn optional<T: Serialize>(
        &mut self,
        key: &str,
        value: Option<T>,
        name: &str,
        text: impl Fn(&T) -> String,
    ) {
        value.iter().for_each(|value| self.line(name, &text(value)));
        self.value(key, value);
    }

    /// Adds a value for programs alone.
    pub(super) fn value(&mut self, key: &str, value: impl Serialize) {
        self.json[key] = serde_json::to_value(value).expect("a figure is plain data");
    }

    /// Adds a line for people alone: its name, and text that is wrapped beside it. A name that
    /// fills its column, such as that of a file, has the text below it.
    pub(super) fn line(&mut self, name: &str, text: &str) {
        let width = self.name_width;
        self.text += &match name.chars().count() < width {
            true => wrapped(&format!("{name:width$}"), text),
            false => wrapped("", name) + &wrapped(&" ".repeat(width), text),
        };
    }

    /// Adds a table after an empty line, if it has rows.
    pub(super) fn table(&mut self, table: &str) {
        if !table.is_empty() {
            self.text += &format!("\n{table}");
        }
    }

    pub(super) fn with_files(mut self, files: &[PathBuf]) -> Self {
        for (index, file) in files.iter().enumerate() {
            let head = if index == 0 { "files" } else { "" };
            self.text += &format!("{head:NAME_WIDTH$}{}\n", file.display());
        }
        // A name that is not Unicode is shown as far as it is.
        let names: Vec<_> = files.iter().map(|file| file.to_string_lossy()).collect();
        self.value("files", names);
        self.aside |= files.iter().any(|file| file == Path::new(STANDARD_OUTPUT));
        self
    }

    pub(super) fn with_outcome(self, outcome: Outcome) -> Self {
        Self { outcome, ..self }
    }
}

impl From<&Verdict> for Outcome {
    fn from(verdict: &Verdict) -> Self {
        if verdict.legible { Self::Done } else { Self::NotLegible }
    }
}

/// A line as [`Report::line`] adds it.
pub(super) fn line(name: &str, text: &str) -> String {
    let mut report = Report::empty();
    report.line(name, text);
    report.text
}

/// A path as one types it into a shell: quoted where it has to be.
pub(super) fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:@=".contains(c) || MAIN_SEPARATOR == c;
    if !text.is_empty() && text.chars().all(is_plain) {
        text
    } else if cfg!(windows) {
        format!("\"{text}\"")
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// The command that is running, as one types it.
pub(super) fn typed_command() -> String {
    let words = std::env::args().skip(1).map(|word| shell_word(Path::new(&word)));
    std::iter::once("noctograph".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Text after a head, wrapped at 80 columns and indented as far as the head reaches. What stands in
/// backquotes, a command to copy, stays on one line.
pub(super) fn wrapped(head: &str, text: &str) -> String {
    let indent = head.chars().count();
    let mut lines = head.to_owned();
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
    fn lines_are_wrapped_beside_their_head() {
        let text = "word ".repeat(30);
        let found = line("name", &text);
        let widths: Vec<usize> = found.lines().map(str::len).collect();
        assert_eq!(widths, [79, 79, 19], "{found}");
        assert!(found.lines().skip(1).all(|line| line.starts_with("          word")), "{found}");
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
        let found = line("name", &format!("{} `run 'a b'` ends", "word ".repeat(13).trim_end()));
        let lines: Vec<&str> = found.lines().collect();
        assert_eq!(lines[1], "          `run 'a b'` ends", "{found}");
    }

    #[cfg(not(windows))]
    #[test]
    fn a_path_can_be_pasted_into_a_shell() {
        for (path, in_shell) in [
            ("out/photo-1.png", "out/photo-1.png"),
            ("Noor's photo.png", r"'Noor'\''s photo.png'"),
            ("~/$HOME", "'~/$HOME'"),
            ("zażółć.png", "zażółć.png"),
            ("", "''"),
        ] {
            assert_eq!(shell_word(Path::new(path)), in_shell);
            let echo = format!("printf %s {in_shell}");
            let echoed = std::process::Command::new("sh").args(["-c", &echo]).output().unwrap();
            assert_eq!(String::from_utf8_lossy(&echoed.stdout), path);
        }
    }
}
