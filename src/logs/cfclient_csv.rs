//! CSV files of cfclient: one file a log block, `Timestamp` in ms, then the block's variables.
//!
//! Source: `src/cfclient/utils/logdatawriter.py` of crazyflie-clients-python, which writes
//! `logdata/<connected>/<block>-<started>.csv`.

use std::path::Path;

use super::recording::{Block, Column, Recording};
use super::sheet::{self, Sheet, SheetColumn};
use super::{Job, firmware};
use noctograph_core::error::Result;
use noctograph_core::files::plain_text;

/// The first column's name.
const STAMP: &str = "Timestamp";

/// Radio logs stamp with 24 bits of milliseconds (three bytes in the log packet).
pub(super) const WRAP_S: f64 = 16_777.216;

/// Whether a text has cfclient's header: its stamp, and variables as `group.name`.
pub(super) fn is_its_own(text: &[u8]) -> bool {
    sheet::header(text).is_some_and(|header| {
        header.first().is_some_and(|name| name == STAMP)
            && header[1..].iter().any(|name| name.contains('.'))
    })
}

/// Whether a file may be cfclient's, by its name.
pub(super) fn may_be_its_own(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"))
}

/// Reads a file, which is a block of a recording.
pub(super) fn read(text: &[u8], job: Job<'_>) -> Result<Recording> {
    let plain = plain_text(text);
    let sheet = Sheet::read(&plain.text, job, &[], |_| true)?;
    let column = |column: SheetColumn| Column::new(column.title, column.values);
    let mut columns = sheet.columns.into_iter().map(column);
    let stamps_ms = columns.next().map(|stamps| stamps.values).unwrap_or_default();
    let block = Block {
        name: Path::new(job.file).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        time_s: stamps_ms.into_iter().map(|ms| ms / 1000.0).collect(),
        columns: columns.collect(),
        ..Block::default()
    };
    Ok(Recording {
        blocks: vec![block],
        warnings: plain.notes.into_iter().chain(sheet.warnings).collect(),
        wrap_s: Some(WRAP_S),
        firmware: firmware::in_comments(text),
        ..Recording::new(job.file)
    })
}
