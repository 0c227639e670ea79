//! The report of a verb, which contains its outcome as a table for people and as JSON for programs.

use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use serde::Serialize;

use super::printer::{line, print};
use super::started::words;
use noctograph_core::files::{STANDARD_OUTPUT, file_name};
use serde_json::Value;

/// Result of a verb as a JSON object and as text for people.
#[derive(Debug)]
pub struct Report {
    /// Text for people, in tables of at most 80 columns.
    pub text: String,
    /// JSON object for programs.
    pub json: Value,
    /// True if the word is legible or safe to fly, which determines the exit code.
    pub(super) passed: bool,
    /// True if a file was written to stdout, in which case the report is printed on stderr.
    pub(super) aside: bool,
    /// Content of the photo's file, whose digest is added to the JSON object only.
    pub(super) photo: Option<Vec<u8>>,
}

impl Report {
    /// Creates a report from a text and from a value that serializes as an object.
    pub(super) fn new(text: String, json: impl Serialize) -> Self {
        let json = serde_json::to_value(json).expect("a result is plain data");
        Self { text, json, passed: true, aside: false, photo: None }
    }

    /// Creates a report from a value that serializes as an object, with text formatted by a layout.
    pub(super) fn with_layout(product: impl Serialize, layout: &str) -> Self {
        Self::with_words(product, &Value::Null, layout)
    }

    /// Creates a report with a layout and with values that appear only in the text.
    pub(super) fn with_words(product: impl Serialize, words: &Value, layout: &str) -> Self {
        let report = Self::new(String::new(), product);
        Self { text: print(layout, &[&report.json, words]), ..report }
    }

    /// Appends the text of another report to this one, and adds the members of its JSON object.
    pub(super) fn add(&mut self, other: Self) {
        self.text += &other.text;
        if let (Some(members), Value::Object(more)) = (self.json.as_object_mut(), other.json) {
            members.extend(more);
        }
    }

    /// Adds a value to the JSON object.
    pub(super) fn value(&mut self, key: &str, value: impl Serialize) {
        self.json[key] = serde_json::to_value(value).expect("a figure is plain data");
    }

    /// Adds a line to the text.
    pub(super) fn line(&mut self, name: &str, text: &str) {
        self.text += &line(name, text);
    }

    /// Returns the report with the paths of the files that were written, at the end of the text and
    /// under the key `files`. The text is sent to standard error if one of the files is standard
    /// output.
    pub(super) fn with_files(mut self, files: &[PathBuf]) -> Self {
        // Paths are not wrapped, so that they can be copied.
        for (index, file) in files.iter().enumerate() {
            let head = if index == 0 { "files" } else { "" };
            self.text += &format!("{head:10}{}\n", file.display());
        }
        // Bytes that are not valid Unicode are replaced in file names.
        let names: Vec<_> = files.iter().map(|file| file.to_string_lossy()).collect();
        self.value("files", names);
        self.aside |= files.iter().any(|file| file == Path::new(STANDARD_OUTPUT));
        self
    }

    /// Returns the report with the result that determines the exit code, which is 0 if it `passed`
    /// and otherwise 1.
    pub(super) fn passes(self, passed: bool) -> Self {
        Self { passed, ..self }
    }
}

/// Returns a path as a word for the shell of this operating system, quoted if necessary.
pub(super) fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,:@=".contains(c) || MAIN_SEPARATOR == c;
    if !text.is_empty() && text.chars().all(is_plain) {
        text
    } else if cfg!(windows) {
        // A path on Windows contains no quotation marks.
        format!("\"{text}\"")
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// Returns the arguments of this process, in which bytes that are not valid Unicode are replaced.
pub(super) fn typed_words() -> impl Iterator<Item = String> {
    words().into_iter().map(|word| word.to_string_lossy().into_owned())
}

/// Returns the running command for display in a page. Pages are passed on, so an absolute path,
/// which would reveal folders of this machine, is reduced to its file name.
pub(super) fn typed_command() -> String {
    let words = typed_words().map(|word| shell_word(Path::new(&without_folders(&word))));
    std::iter::once("noctograph".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Returns an argument without the folders of an absolute path, if the argument or its value after
/// `=` is such a path. Quotation marks around the path are also removed.
pub(super) fn without_folders(word: &str) -> String {
    let value = word.rsplit_once('=').map_or(word, |(_, value)| value);
    match value.trim_matches(['"', '\'', ' ']) {
        path if Path::new(path).is_absolute() => {
            format!("{}{}", &word[..word.len() - value.len()], file_name(path))
        }
        _ => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(not(windows))]
    #[test]
    fn a_typed_path_loses_its_folders_if_they_are_of_this_machine() {
        for (typed, shown) in [
            ("/home/jane/logo.svg", "logo.svg"),
            ("--drawing=/home/jane/logo.svg", "--drawing=logo.svg"),
            ("letters.font=\"/home/jane/a.ttf\"", "letters.font=a.ttf"),
            ("art/logo.svg", "art/logo.svg"),
            ("NOOR", "NOOR"),
        ] {
            assert_eq!(without_folders(typed), shown);
        }
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
