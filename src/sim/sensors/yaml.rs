//! Parsing of Bitcraze's YAML files into plain structs.

mod anchors;
mod lighthouse;

use serde::de::DeserializeOwned;

use noctograph_core::error::{Error, Result};

pub use self::anchors::read_anchors;
pub use self::lighthouse::read_lighthouse_config;

/// Maximum number of characters of a line that are shown in a message.
const MOST_SHOWN: usize = 60;

/// Parses a YAML text with one document. An error contains the line, the beginning of that line,
/// and `file` as the text's name.
fn from_yaml<T: DeserializeOwned>(text: &str, file: &str, hint: &str) -> Result<T> {
    // The library rejects duplicate keys, excessive alias expansion, and deep nesting.
    serde_saphyr::from_str(text).map_err(|error| {
        let line = error.location().map_or(1, |location| location.line()).max(1);
        let faulty = usize::try_from(line - 1).ok().and_then(|row| text.lines().nth(row));
        let shown: String = faulty.unwrap_or_default().trim().chars().take(MOST_SHOWN).collect();
        let quoted = format!("`{shown}`: {}", error.without_snippet());
        Error::input("", quoted, "the format that Bitcraze's programs write", hint)
            .in_file(file, line)
    })
}
