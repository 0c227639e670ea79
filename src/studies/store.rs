//! Store: a folder of recorded flights that survives a killed program.
//!
//! `study.json` names the program that wrote the folder. `flights.jsonl` contains one JSON object
//! per line, which `jq`, `pandas.read_json(lines=True)` and `DuckDB` can read directly. A record is
//! appended by a single write of one line. If the program is killed, at most a partial line remains
//! at the end, which the next run removes. Only one program at a time can write (`lock`).

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::experiment::MAX_TRIALS;
use super::{Outcome, SOURCE};
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::{Limit, Output};
use noctograph_core::input_error;

/// Version of the folder's layout and of the meaning of its figures. Since version 2, `probability`
/// is limited by a more probable rival.
const FORMAT: u32 = 2;
/// Number of records between two syncs to disk. A power failure loses the records since the last
/// sync, but a killed program loses none.
const SYNC_EVERY: usize = 64;
/// Maximum length of a line.
const MAX_LINE_BYTES: usize = 1 << 20;
/// Maximum size of a file of flights.
const LIMIT: Limit = Limit { bytes: 320 << 20, what: "a store of flights", hint: ANOTHER };
const ANOTHER: &str = "name another folder";
/// Maximum size of a header.
const HEADER: Limit = Limit { bytes: 1 << 12, what: "the header of a store", hint: ANOTHER };
/// Names of the folder's other files.
const HEADER_FILE: &str = "study.json";
const LOCK: &str = "lock";
/// Bytes at the start of every line.
const BEGINNING: &[u8] = b"{\"scene\":\"";

/// Record of one flight, stored as a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Digest of the prepared scene: [`super::Prepared::digest`].
    pub scene: String,
    /// Name of the contender that flew.
    pub contender: String,
    /// The word that was flown.
    pub word: String,
    /// Seed of the flight.
    pub seed: u64,
    /// Outcome of the flight.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Header: the program that wrote a folder, and the folder's layout version.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    noctograph: String,
    format: u32,
}

/// An open folder of flights.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    known: OutcomesByScene,
    log: Mutex<Log>,
    /// Lock file, which stays locked while the store is open.
    _lock: File,
}

/// Outcomes by scene, and by the seed of the flight.
type OutcomesByScene = BTreeMap<String, BTreeMap<u64, Outcome>>;

/// Adds the outcome of a flight from the file `path`. Returns true if the flight is new. Returns an
/// error if the flight already has a different outcome.
fn add(known: &mut OutcomesByScene, record: Record, path: &Path) -> Result<bool> {
    let Record { scene, seed, outcome, word, .. } = record;
    match known.entry(scene).or_default().entry(seed) {
        Entry::Vacant(entry) => {
            entry.insert(outcome);
            Ok(true)
        }
        Entry::Occupied(entry) if *entry.get() == outcome => Ok(false),
        Entry::Occupied(_) => Err(input_error!(
            path.display(),
            "two outcomes of {word} with seed {seed}",
            "one outcome of each flight",
            "remove the incorrect line, or name another folder",
        )),
    }
}

/// The end of `flights.jsonl`, to which records are appended.
#[derive(Debug)]
struct Log {
    file: File,
    /// Total length of the complete lines, in bytes.
    length: u64,
    n_flights: usize,
}

impl Store {
    /// Name of the file that contains the flights.
    pub const FLIGHTS: &str = "flights.jsonl";

    /// Opens the store in a folder, or creates it.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Infeasible`] if another process has the folder open. Returns
    /// [`Error::Input`] if another version of this program wrote it or if a line is invalid.
    /// Returns [`Error::Io`] if a file cannot be read or written.
    pub fn open(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
        let path = folder.join(Self::FLIGHTS);
        for file in [&path, &folder.join(LOCK), &folder.join(HEADER_FILE)] {
            // A named pipe would block the program.
            if file.exists() && !file.is_file() {
                let wanted = "a file, or no file yet";
                return Err(Error::input(file.display(), "no regular file", wanted, ANOTHER));
            }
        }
        // The folder is locked before anything is read or written.
        let lock = lock(folder)?;
        check_header(folder)?;
        let mut file = writable(&path)?;
        let (mut known, mut n_flights) = (OutcomesByScene::default(), 0);
        let length = each_line(&file, &path, |record| {
            n_flights += 1;
            add(&mut known, record, &path).map(drop)
        })?;
        // A partial line left by a killed program is removed.
        truncate(&mut file, length).map_err(|source| Error::write(&path, source))?;
        let log = Mutex::new(Log { file, length, n_flights });
        Ok(Self { path, known, log, _lock: lock })
    }

    /// Returns the outcome of a flight that was stored before the store was opened, or that was
    /// copied from another file.
    pub fn get(&self, scene: &str, seed: u64) -> Option<Outcome> {
        self.known.get(scene)?.get(&seed).cloned()
    }

    /// Copies those flights from another file, such as a shard's, that the store lacks.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::read`] and [`Self::put`]. Returns [`Error::Input`] if a flight
    /// has a different outcome in the other file.
    pub fn take(&mut self, path: &Path) -> Result<()> {
        Self::read(path)?.into_iter().try_for_each(|record| {
            if add(&mut self.known, record.clone(), path)? { self.put(&record) } else { Ok(()) }
        })
    }

    /// Returns the number of flights for which [`Self::get`] returns an outcome.
    pub fn n_known(&self) -> usize {
        self.known.values().map(BTreeMap::len).sum()
    }

    /// Appends a flight by a single write of one complete line.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`], for example if the disk is full. The incomplete line is then removed,
    /// and the lines before it remain. Returns [`Error::Input`] if the store already has as many
    /// flights as the largest study. Panics if another thread panicked while writing.
    pub fn put(&self, record: &Record) -> Result<()> {
        // The record is serialized before locking, so that threads wait only for the write.
        let line = line_of(record);
        let mut log = self.log.lock().expect("no writer panics");
        if log.n_flights >= MAX_TRIALS {
            return Err(too_many(self.path.display()));
        }
        log.append(&line).map_err(|source| Error::write(&self.path, source))?;
        log.n_flights += 1;
        Ok(())
    }

    /// Reads all flights from the file of a store or a shard.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be read. Returns [`Error::Input`] for the first
    /// invalid line, and for more than 500,000 flights. A partial line at the end is ignored.
    pub fn read(path: &Path) -> Result<Vec<Record>> {
        let mut records = Vec::new();
        each_line(LIMIT.open(path)?, path, |record| {
            records.push(record);
            Ok(())
        })?;
        Ok(records)
    }

    /// Writes a file of flights under a temporary name, and renames it once it is on disk.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`], in which case no file remains.
    pub fn write(path: &Path, records: &[Record]) -> Result<()> {
        let lines: Vec<u8> = records.iter().flat_map(line_of).collect();
        Output::create(path)?.keep_on_disk(lines).map(drop)
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        if let Ok(log) = self.log.lock() {
            // The sync protects against a power failure. Written lines survive the program anyway.
            let _ = log.file.sync_data();
        }
    }
}

impl Log {
    /// Appends a line, or leaves the file unchanged on failure. Syncs every [`SYNC_EVERY`] flights.
    fn append(&mut self, line: &[u8]) -> std::io::Result<()> {
        if let Err(error) = self.file.write_all(line) {
            // The next record must be written directly after the last complete line.
            let _ = truncate(&mut self.file, self.length);
            return Err(error);
        }
        self.length += line.len() as u64;
        if self.n_flights.is_multiple_of(SYNC_EVERY) { self.file.sync_data() } else { Ok(()) }
    }
}

/// Returns a record as a line of JSON, with its line feed.
fn line_of(record: &Record) -> Vec<u8> {
    let mut line = serde_json::to_vec(record).expect("a record is plain data");
    line.push(b'\n');
    line
}

/// Opens a file for reading and writing, and creates it if it does not exist.
fn writable(path: &Path) -> Result<File> {
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    file.map_err(|source| Error::write(path, source))
}

/// Truncates a file to a length and moves the file position to its end.
fn truncate(file: &mut File, length: u64) -> std::io::Result<()> {
    file.set_len(length)?;
    file.seek(SeekFrom::End(0)).map(drop)
}

/// Locks the folder for this process until the returned file is closed. Returns an error if another
/// process has locked the folder.
fn lock(folder: &Path) -> Result<File> {
    let path = folder.join(LOCK);
    let file = writable(&path)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::infeasible(
            format!("{}: another noctograph is writing here", folder.display()),
            "wait until that program ends, or name another folder",
        )),
        Err(TryLockError::Error(source)) => Err(Error::write(&path, source)),
    }
}

/// Checks that this build wrote the folder, and writes the header if there is none. Returns an
/// error for the header of another build, whose outcomes may differ.
fn check_header(folder: &Path) -> Result<()> {
    let path = folder.join(HEADER_FILE);
    let noctograph = format!("{} (source {SOURCE})", env!("CARGO_PKG_VERSION"));
    let ours = Header { noctograph, format: FORMAT };
    if !path.exists() {
        let text = serde_json::to_string(&ours).expect("plain data") + "\n";
        return Output::create(&path)?.keep_on_disk(text).map(drop);
    }
    let (text, wanted) = (HEADER.read_text(&path)?, "the header of a store");
    let text = text.trim();
    if text.is_empty() {
        let hint = "remove the file (a power failure may have left it empty); flights are kept";
        return Err(Error::input(path.display(), "an empty file", wanted, hint));
    }
    let Header { noctograph, format } = serde_json::from_str(text).map_err(|_broken| {
        let start: String = text.chars().take(60).collect();
        Error::input(
            path.display(),
            start,
            wanted,
            "name another folder: this folder holds no study",
        )
    })?;
    // Another build may produce different outcomes, even with the same version number.
    if (&noctograph, format) == (&ours.noctograph, FORMAT) {
        return Ok(());
    }
    let this_build = ours.noctograph;
    Err(input_error!(
        path.display(),
        "flights of noctograph {noctograph} (format {format})",
        "{this_build} (format {FORMAT})",
        "name another folder, because flights of two builds cannot be compared",
    ))
}

/// Returns the error for more flights than the largest study contains.
fn too_many(place: impl Into<Place>) -> Error {
    let number = format!("more than {MAX_TRIALS} flights");
    Error::input(place, number, "at most the flights of the largest study", ANOTHER)
}

/// Calls `f` with the record of each complete line, and returns the total length of these lines in
/// bytes. A partial line written by this program may follow them. Returns the errors of reading, of
/// a line that is no record, and of `f`.
fn each_line(file: impl Read, path: &Path, mut f: impl FnMut(Record) -> Result<()>) -> Result<u64> {
    let mut reader = BufReader::new(file);
    let (mut count, mut length, mut line) = (0, 0, Vec::new());
    loop {
        line.clear();
        let mut limited = Read::take(&mut reader, MAX_LINE_BYTES as u64);
        let n = limited.read_until(b'\n', &mut line).map_err(|e| Error::read(path, e))?;
        // A partial line at the end is ignored if this program wrote it. Any other text is an error
        // below, so that no foreign text is removed.
        let is_ours = line.starts_with(BEGINNING) || BEGINNING.starts_with(&line);
        if n == 0 || (line.last() != Some(&b'\n') && n < MAX_LINE_BYTES && is_ours) {
            return Ok(length);
        }
        count += 1;
        let place = format!("{}:{count}", path.display());
        if count > MAX_TRIALS {
            return Err(too_many(place));
        }
        let hint = "remove the line, or name another folder";
        let record: Record = serde_json::from_slice(&line)
            .map_err(|error| Error::input(&*place, error, "a flight as one JSON object", hint))?;
        record.outcome.check(&place)?;
        f(record)?;
        length += n as u64;
    }
}

#[cfg(test)]
mod tests;
