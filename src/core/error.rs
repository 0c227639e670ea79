//! Errors, grouped by how they are fixed.

use std::path::{Component, Path, PathBuf};

pub use crate::place::{DroneIndex, Place, Segment};

/// Result of every function in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// Maximum number of characters of a value that are printed. No digest or name in use is longer.
const LONGEST_FOUND: usize = 160;

/// Error type of all crates.
///
/// The text states the place, the value found and what is wanted. [`Error::hint`] suggests a fix.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
        /// Advice on how to fix the error.
        hint: String,
    },
    /// An input value cannot be used.
    #[error("{place}: found {found}, wanted {wanted}")]
    Input {
        /// Code to which help and translations refer, or `input` if none of them does.
        code: &'static str,
        /// Place of the value.
        place: Box<Place>,
        /// The value found.
        found: String,
        /// Values that are accepted.
        wanted: String,
        /// Advice on how to fix the error.
        hint: String,
    },
    /// The font lacks a letter of the word.
    #[error("word, position {position}: found {letter:?} (U+{:04X}), wanted {wanted}", u32::from(*letter))]
    Letter {
        /// Position of the letter in the word, from 1.
        position: usize,
        /// Letter that the font lacks.
        letter: char,
        /// Letters that the font contains.
        wanted: String,
        /// Advice on how to fix the error.
        hint: String,
    },
    /// The graphics device failed.
    #[error("graphics device: {what}")]
    Gpu {
        /// Failure, with the adapter's name if it is known.
        what: String,
        /// Advice on how to fix the error.
        hint: String,
    },
    /// The input is well formed, but the request cannot be carried out.
    #[error("{what}")]
    Infeasible {
        /// Code of the error as in [`Error::Input`], or `infeasible` if nothing refers to it.
        code: &'static str,
        /// Reason, with the figure that exceeds its limit.
        what: String,
        /// Advice on how to fix the error.
        hint: String,
    },
    /// The caller stopped the work.
    #[error("stopped")]
    Stopped,
}

impl Error {
    /// Returns the code of the error, such as `file`. Help and translations refer to the code.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Io { .. } => "file",
            Self::Input { code, .. } | Self::Infeasible { code, .. } => code,
            Self::Letter { .. } => "letter-missing",
            Self::Gpu { .. } => "graphics-device",
            Self::Stopped => "stopped",
        }
    }

    /// Sets the code of an input error or of an infeasible request. Other errors have fixed codes.
    #[must_use]
    pub fn coded(mut self, name: &'static str) -> Self {
        if let Self::Input { code, .. } | Self::Infeasible { code, .. } = &mut self {
            *code = name;
        }
        self
    }

    /// Creates the error for a well-formed request that cannot be carried out.
    pub fn infeasible(what: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Infeasible { code: "infeasible", what: what.into(), hint: hint.into() }
    }

    /// Returns advice on how to fix the error.
    pub fn hint(&self) -> &str {
        match self {
            Self::Io { hint, .. }
            | Self::Input { hint, .. }
            | Self::Letter { hint, .. }
            | Self::Gpu { hint, .. }
            | Self::Infeasible { hint, .. } => hint,
            Self::Stopped => "start it again",
        }
    }

    /// Replaces the advice on how to fix the error. A stopped program has fixed advice.
    #[must_use]
    pub fn with_hint(mut self, advice: impl Into<String>) -> Self {
        match &mut self {
            Self::Io { hint, .. }
            | Self::Input { hint, .. }
            | Self::Letter { hint, .. }
            | Self::Gpu { hint, .. }
            | Self::Infeasible { hint, .. } => *hint = advice.into(),
            Self::Stopped => {}
        }
        self
    }

    /// Prepends the file, and its line if one is given, to the error's place. A file already in the
    /// place is part of the added file.
    #[must_use]
    pub fn in_file(self, file: impl std::fmt::Display, line: impl Into<Option<u64>>) -> Self {
        let file = Segment::File(file.to_string());
        self.inside([file].into_iter().chain(line.into().map(Segment::Line)))
    }

    /// Names the drone in the error for a flight that cannot be carried out.
    #[must_use]
    pub fn of_drone(mut self, drone: DroneIndex) -> Self {
        if let Self::Infeasible { what, .. } = &mut self {
            *what = format!("drone {drone}: {what}");
        }
        self
    }

    /// Prepends an item of a list to the error's place.
    #[must_use]
    pub fn of_item(self, list: &str, index: usize) -> Self {
        let list = Place::from(list).0;
        self.inside(list.into_iter().chain([Segment::Index(index)]))
    }

    /// Prepends segments to an input's place. Other errors have no place, and are unchanged.
    fn inside(mut self, outer: impl IntoIterator<Item = Segment>) -> Self {
        if let Self::Input { place, .. } = &mut self {
            place.0.splice(..0, outer);
        }
        self
    }

    /// Creates the error for a file that cannot be read.
    pub fn read(path: &Path, source: std::io::Error) -> Self {
        let hint = "name a file or folder that exists and is readable".into();
        Self::Io { path: path.into(), source, hint }
    }

    /// Creates the error for a file or folder that cannot be written, with advice that depends on
    /// the kind of `source`.
    pub fn write(path: &Path, source: std::io::Error) -> Self {
        use std::io::ErrorKind::{AlreadyExists, NotADirectory};
        // On Windows, a forbidden name causes an error that does not state the reason.
        let mut names = path.components().filter_map(|part| match part {
            Component::Normal(name) => Some(name.to_string_lossy()),
            _ => None,
        });
        let hint = match source.kind() {
            _ if cfg!(windows) && names.any(|name| is_reserved(&name)) => {
                "Windows reserves this name: choose another"
            }
            AlreadyExists | NotADirectory => "a file has this folder's name: choose another name",
            _ => "choose a writable folder with space left on its disk",
        };
        Self::Io { path: path.into(), source, hint: hint.into() }
    }

    /// Creates the error for a value that cannot be used. `place` names the value, `found` shows
    /// it, `wanted` says what would be accepted, and `hint` what to do.
    pub fn input(
        place: impl Into<Place>,
        found: impl std::fmt::Display,
        wanted: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self::Input {
            code: "input",
            place: Box::new(place.into()),
            found: shortened(found.to_string()),
            wanted: wanted.into(),
            hint: hint.into(),
        }
    }
}

/// True if Windows refuses a name because it is a device's or contains a forbidden character.
fn is_reserved(name: &str) -> bool {
    is_device(name)
        || name.ends_with(['.', ' '])
        || name.chars().any(|c| c.is_control() || "<>:\"|?*".contains(c))
}

/// True if a name is reserved for a device on Windows, regardless of its extension.
#[must_use]
pub fn is_device(name: &str) -> bool {
    let stem = name.split('.').next().unwrap_or_default().trim_end().to_ascii_uppercase();
    let port = ["COM", "LPT"].iter().find_map(|device| stem.strip_prefix(device));
    ["CON", "PRN", "AUX", "NUL"].contains(&&*stem)
        || port.is_some_and(|rest| matches!(rest.as_bytes(), [b'0'..=b'9']))
}

/// Creates an [`Error::input`] from texts with inline format arguments, such as
/// `input_error!("word", "{n} characters", "at most {most}", "split the text")`.
#[macro_export]
macro_rules! input_error {
    ($place:expr, $found:literal, $wanted:literal, $hint:literal $(,)?) => {
        $crate::error::Error::input($place, format_args!($found), format!($wanted), format!($hint))
    };
}

/// Truncates a string with an ellipsis if it is too long to print, such as the 309 digits of 1e308.
fn shortened(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(LONGEST_FOUND) {
        text.truncate(end);
        text.push('…');
    }
    text
}

/// Checks that a setting is a number within `min..=max`, which NaN is not.
///
/// # Errors
///
/// Returns [`Error::Input`] with `key` as its place.
pub fn within(key: &str, value: f64, min: f64, max: f64) -> Result<()> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    let wanted = format!("a number from {min} to {max}");
    Err(Error::input(key, value, wanted, "choose a number within the range"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_the_place_of_a_folder_is_said() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let source = std::fs::create_dir_all(file.path()).unwrap_err();
        assert!(Error::write(file.path(), source).hint().starts_with("a file has this folder's"));
    }

    #[test]
    fn names_that_windows_keeps_are_known() {
        for name in ["CON", "nul", "AUX.csv", "com1.tar.gz", "LPT9", "x?.csv", "a:b", "end.", "a "]
        {
            assert!(is_reserved(name), "{name}");
        }
        for name in ["CONE", "NULL.csv", "COM", "COM10", "x.con", ".hidden", "LPTX", "Łódź.png"]
        {
            assert!(!is_reserved(name), "{name}");
        }
    }

    #[test]
    fn a_number_of_309_digits_is_cut() {
        let error = within("air.wind_m_s", 1e308, 0.0, 10.0).unwrap_err().to_string();
        assert!(error.chars().count() < 220 && error.contains("000…, wanted"), "{error}");
    }
}
