//! CSV files of cfclient: one file a log block, `Timestamp` in ms, then the block's variables.
//!
//! Source: `src/cfclient/utils/logdatawriter.py` of crazyflie-clients-python, which writes
//! `logdata/<connected>/<block>-<started>.csv`.

use std::path::Path;

use super::recording::{Block, Column, Recording};
use super::{Job, cells, firmware};
use noctograph_core::error::Result;
use noctograph_core::files::{Head, Text, ending};

/// The first column's name.
const STAMP: &str = "Timestamp";

/// Radio logs stamp with 24 bits of milliseconds (three bytes in the log packet).
pub(super) const WRAP_S: f64 = 16_777.216;

/// Whether a head is cfclient's: its stamp, and variables as `group.name`.
pub(super) fn is_its_own(head: &Head) -> bool {
    head.titles.first().is_some_and(|title| title == STAMP)
        && head.titles[1..].iter().any(|title| title.contains('.'))
}

/// Whether a file may be cfclient's, by its name.
pub(super) fn may_be_its_own(path: &Path) -> bool {
    ending(path) == "csv"
}

/// Reads a file, which is a block of a recording.
pub(super) fn read(text: &Text<'_>, head: Head, job: Job<'_>) -> Result<Recording> {
    let (sheet, _) = cells::read_rows(text, head, job, |_| true)?;
    let mut columns =
        sheet.columns.into_iter().map(|column| Column::new(column.title, column.values));
    let stamps_ms = columns.next().map(|stamps| stamps.values).unwrap_or_default();
    let block = Block {
        name: Path::new(job.file).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        time_s: stamps_ms.into_iter().map(|ms| ms / 1000.0).collect(),
        columns: columns.collect(),
        ..Block::default()
    };
    Ok(Recording {
        blocks: vec![block],
        warnings: sheet.notes,
        wrap_s: Some(WRAP_S),
        firmware: firmware::in_comments(&text.bytes),
        ..Recording::new(job.file)
    })
}
