//! CSV files of cfclient: one file a log block, `Timestamp` in ms, then the block's variables.
//!
//! Source: `src/cfclient/utils/logdatawriter.py` of crazyflie-clients-python, which writes
//! `logdata/<connected>/<block>-<started>.csv`.

use super::firmware;
use super::recording::{Block, Column, Recording};
use super::sheet::Sheet;
use noctograph_core::error::Result;
use noctograph_core::files::{Budget, plain_text};

/// The first column's name.
const STAMP: &str = "Timestamp";

/// Radio logs stamp with 24 bits of milliseconds (three bytes in the log packet).
const WRAP_S: f64 = 16_777.216;

/// Whether a header is cfclient's: its stamp, and variables as `group.name`.
pub(super) fn is_header(header: &[String]) -> bool {
    header.first().is_some_and(|name| name == STAMP)
        && header[1..].iter().any(|name| name.contains('.'))
}

/// Reads a file, which is a block of a recording; `recording` is the name of that in messages.
pub(super) fn read(text: &[u8], file: &str, recording: &str, budget: &Budget) -> Result<Recording> {
    let plain = plain_text(text);
    let sheet = Sheet::read(&plain.text, file, &[], &|_| true, budget)?;
    let Sheet { header, columns, mut warnings, .. } = sheet;
    warnings.splice(0..0, plain.notes);
    let mut columns = columns.into_iter();
    let time_s = columns.next().unwrap_or_default().into_iter().map(|ms| ms / 1000.0).collect();
    let named = header.into_iter().skip(1).zip(columns);
    let columns = named.map(|(name, values)| Column { name, values }).collect();
    let name = std::path::Path::new(file).file_stem().unwrap_or_default();
    let name = name.to_string_lossy().into_owned();
    let blocks = vec![Block { name, time_s, columns, ..Block::default() }];
    let (file, firmware) = (recording.to_owned(), firmware::in_comments(text));
    let wrap_s = Some(WRAP_S);
    Ok(Recording { file, blocks, warnings, wrap_s, firmware, ..Recording::default() })
}
