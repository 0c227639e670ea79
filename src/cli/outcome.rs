//! The report of a verb: a table for people, the same as JSON for programs, and its outcome.

use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use serde::Serialize;

use super::printer::{line, print};
use super::started::words;
use noctograph_core::files::{STANDARD_OUTPUT, file_name};
use serde_json::Value;

/// Result of a verb: its product as an object, and printed for people.
#[derive(Debug)]
pub struct Report {
    /// Text for people: a table of at most 80 columns.
    pub text: String,
    /// An object.
    pub json: Value,
    /// The word is legible, or safe to fly: the exit code.
    pub(super) passed: bool,
    /// A file was written on standard output, so that the report goes to stderr.
    pub(super) aside: bool,
    /// The photo's file, whose digest only programs are given.
    pub(super) photo: Option<Vec<u8>>,
}

impl Report {
    /// A text, and a product that serializes as an object.
    pub(super) fn new(text: String, json: impl Serialize) -> Self {
        let json = serde_json::to_value(json).expect("a result is plain data");
        Self { text, json, passed: true, aside: false, photo: None }
    }

    /// A product that serializes as an object, printed by a layout.
    pub(super) fn with_layout(product: impl Serialize, layout: &str) -> Self {
        Self::with_words(product, &Value::Null, layout)
    }

    /// The same with words that only people are given.
    pub(super) fn with_words(product: impl Serialize, words: &Value, layout: &str) -> Self {
        let report = Self::new(String::new(), product);
        Self { text: print(layout, &[&report.json, words]), ..report }
    }

    /// Adds the text and the members of another report.
    pub(super) fn add(&mut self, other: Self) {
        self.text += &other.text;
        if let (Some(members), Value::Object(more)) = (self.json.as_object_mut(), other.json) {
            members.extend(more);
        }
    }

    /// Adds a value for programs.
    pub(super) fn value(&mut self, key: &str, value: impl Serialize) {
        self.json[key] = serde_json::to_value(value).expect("a figure is plain data");
    }

    /// Adds a line for people.
    pub(super) fn line(&mut self, name: &str, text: &str) {
        self.text += &line(name, text);
    }

    pub(super) fn with_files(mut self, files: &[PathBuf]) -> Self {
        // Paths are not wrapped, so that they can be copied.
        for (index, file) in files.iter().enumerate() {
            let head = if index == 0 { "files" } else { "" };
            self.text += &format!("{head:10}{}\n", file.display());
        }
        // Bytes of a name that are not Unicode are replaced.
        let names: Vec<_> = files.iter().map(|file| file.to_string_lossy()).collect();
        self.value("files", names);
        self.aside |= files.iter().any(|file| file == Path::new(STANDARD_OUTPUT));
        self
    }

    pub(super) fn passes(self, passed: bool) -> Self {
        Self { passed, ..self }
    }
}

/// A path for a shell, quoted if it has to be.
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

/// The arguments of this process. Bytes that are not Unicode are replaced.
pub(super) fn typed_words() -> impl Iterator<Item = String> {
    words().into_iter().map(|word| word.to_string_lossy().into_owned())
}

/// The command that is running, for a page. Pages are handed on, so an absolute path, which names
/// folders of this machine, becomes the name of its file.
pub(super) fn typed_command() -> String {
    let words = typed_words().map(|word| shell_word(Path::new(&without_folders(&word))));
    std::iter::once("noctograph".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// An argument, or the value in it, without the folders of an absolute path.
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
