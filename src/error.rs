//! What can go wrong, by what the reader must mend. Imports nothing of ours.

use std::path::{Path, PathBuf};

/// Result of everything in this crate that can fail.
pub type Result<T> = std::result::Result<T, Error>;

/// One error for the whole crate.
///
/// The text says where, what was found and what is wanted; [`Error::hint`] says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
        /// What to do.
        hint: String,
    },
    /// A value, a key or a text that was handed in cannot be used.
    #[error("{place}: found {found}, wanted {wanted}")]
    Input {
        /// Where it stands: `scene.toml:12: vehicle.mass_kg`, `plan.csv:7: x_m`, `word, position 3`.
        place: String,
        /// What stands there.
        found: String,
        /// What could stand there.
        wanted: String,
        /// What to do.
        hint: String,
    },
    /// The graphics device cannot do what it was asked for.
    #[error("graphics device: {what}")]
    Gpu {
        /// What failed, with the adapter's name where it is known.
        what: String,
        /// What to do.
        hint: String,
    },
    /// The input is well formed, but what it asks for cannot be done.
    #[error("{what}")]
    Infeasible {
        /// What cannot be done, with the figure that stands in the way.
        what: String,
        /// What to do.
        hint: String,
    },
}

impl Error {
    /// What the reader can do about it.
    #[must_use]
    pub fn hint(&self) -> &str {
        match self {
            Self::Io { hint, .. }
            | Self::Input { hint, .. }
            | Self::Gpu { hint, .. }
            | Self::Infeasible { hint, .. } => hint,
        }
    }

    /// A file that cannot be read.
    #[must_use]
    pub fn read(path: &Path, source: std::io::Error) -> Self {
        let hint = "name a file that exists and that you may read".into();
        Self::Io { path: path.into(), source, hint }
    }

    /// A file or folder that cannot be written.
    #[must_use]
    pub fn write(path: &Path, source: std::io::Error) -> Self {
        let hint = "choose a folder that you may write to with -o, with space left on it".into();
        Self::Io { path: path.into(), source, hint }
    }

    /// A value that cannot be used.
    pub fn input(
        place: impl Into<String>,
        found: impl std::fmt::Display,
        wanted: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self::Input {
            place: place.into(),
            found: found.to_string(),
            wanted: wanted.into(),
            hint: hint.into(),
        }
    }
}

/// Checks that a setting is a number within `min..=max`.
///
/// # Errors
///
/// [`Error::Input`] with `key` as its place.
pub fn within(key: &str, value: f64, min: f64, max: f64) -> Result<()> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(Error::input(
        key,
        value,
        format!("a number from {min} to {max}"),
        format!("set {key} in the scene file; `noctograph scene` prints the default with its unit"),
    ))
}
