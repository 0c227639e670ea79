//! Reads cfclient's CSV files, one per log block: `Timestamp` in ms, then a column per variable.
//!
//! Source: `src/cfclient/utils/logdatawriter.py` of crazyflie-clients-python, which writes
//! `logdata/<connected>/<block>-<started>.csv`.

use std::path::Path;

use super::recording::{Block, Column, Recording};
use super::{Job, cells, firmware, unknown};
use noctograph_core::error::Result;
use noctograph_core::files::{Head, Text, ending, entries_in, file_name};
use noctograph_core::units::MS_PER_S;

/// Period after which the times in radio logs, 24-bit milliseconds, restart.
pub(super) const WRAP_S: f64 = 16_777.216;

/// Returns true for a cfclient header: `Timestamp`, and variables named `group.name`.
pub(super) fn is_cfclient(head: &Head) -> bool {
    head.titles.first().is_some_and(|title| title == "Timestamp")
        && head.titles[1..].iter().any(|title| title.contains('.'))
}

/// True if a file name is that of a CSV file.
pub(super) fn may_be_cfclient(path: &Path) -> bool {
    ending(path) == "csv"
}

/// Reads a file as a recording of one block, whose times are in ms of the drone's clock.
pub(super) fn read(text: &Text<'_>, head: Head, job: Job<'_>) -> Result<Recording> {
    let (sheet, _) = cells::read_rows(text, head, job, |_| true)?;
    let mut columns =
        sheet.columns.into_iter().map(|column| Column::new(column.title, column.values));
    // The first column is the time, and the others are variables.
    let times_ms = columns.next().map(|times| times.values).unwrap_or_default();
    let block = Block {
        name: Path::new(job.file).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        time_s: times_ms.into_iter().map(|ms| ms / MS_PER_S).collect(),
        columns: columns.collect(),
        ..Block::default()
    };
    let mut log = Recording {
        blocks: vec![block],
        wrap_s: Some(WRAP_S),
        firmware: firmware::in_comments(&text.bytes),
        ..Recording::new(job.file)
    };
    log.warn_of_notes(&sheet.notes);
    Ok(log)
}

/// Reads the cfclient files in a folder, sorted by name, as one recording. Returns
/// [`noctograph_core::error::Error::Input`] if the folder contains none.
pub(super) fn read_folder(path: &Path, job: Job<'_>) -> Result<Recording> {
    let Job { budget, .. } = job;
    let mut log = Recording::new(job.file);
    let (files, folders): (Vec<_>, Vec<_>) =
        entries_in(path)?.into_iter().partition(|path| path.is_file());
    let mut others: Vec<String> = folders.iter().map(file_name).collect();
    for path in &files {
        if !may_be_cfclient(path) {
            others.push(file_name(path));
            continue;
        }
        let bytes = super::read(path)?;
        budget.steps(bytes.len())?;
        budget.bytes(bytes.len())?;
        let text = Text::decode(&bytes);
        let head = Head::find(&text.bytes);
        if is_cfclient(&head) {
            let file = path.display().to_string();
            let one = read(&text, head, Job { file: &file, ..job })?;
            log.warnings.extend(one.warnings.into_iter().map(|warning| warning.in_file(&file)));
            log.blocks.extend(one.blocks);
            log.firmware = log.firmware.or(one.firmware);
            log.wrap_s = one.wrap_s;
            // The limit applies to all files together.
            log.check_variables()?;
        } else {
            others.push(file_name(path));
        }
        budget.free(bytes.len() as u64);
    }
    if log.blocks.is_empty() {
        let content = "a folder without a cfclient CSV file (Timestamp,group.name …)";
        return Err(unknown(job.file, content));
    }
    if !others.is_empty() {
        let others = others.join(", ");
        let text = format!("not read, because they are not cfclient files: {others}");
        log.warn("not-read", text);
    }
    Ok(log)
}
