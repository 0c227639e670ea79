//! Store: a folder that never loses a flight.
//!
//! `study.json` names the program that wrote it. `flights.jsonl` holds one JSON object a line,
//! which `jq`, `pandas.read_json(lines=True)` and `DuckDB` read as it is. A record is appended by
//! one write of one line, so a killed program leaves at worst half a line at the end, which the
//! next one takes off. One program at a time writes to the folder (`lock`).

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

/// Layout of the folder and meaning of its figures: 2 since a likelier rival caps `probability`.
const FORMAT: u32 = 2;
/// Records between two syncs to disk, which a power failure loses. Killing the program loses none.
const SYNC_EVERY: usize = 64;
/// Longest line that is read.
const MAX_LINE_BYTES: usize = 1 << 20;
/// Largest file of flights.
const LIMIT: Limit = Limit { bytes: 320 << 20, what: "a store of flights", hint: ANOTHER };
const ANOTHER: &str = "name another folder";
/// Largest header.
const HEADER: Limit = Limit { bytes: 1 << 12, what: "the header of a store", hint: ANOTHER };
/// Names of the other files.
const HEADER_FILE: &str = "study.json";
const LOCK: &str = "lock";
/// How every line begins.
const BEGINNING: &[u8] = b"{\"scene\":\"";

/// One flight, as a line of a store.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`super::Prepared::digest`].
    pub scene: String,
    /// Name of the contender that flew.
    pub contender: String,
    /// The word.
    pub word: String,
    /// Seed of the flight.
    pub seed: u64,
    /// Its outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Program and layout that wrote a folder.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Header {
    noctograph: String,
    format: u32,
}

/// A folder of flights.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    known: Known,
    log: Mutex<Log>,
    /// Held while this lives.
    _lock: File,
}

/// Outcomes by the scene and the seed of their flight.
type Known = BTreeMap<String, BTreeMap<u64, Outcome>>;

/// Adds the outcome of a file's flight, and returns true if the flight is new. A second outcome of
/// a flight is refused.
fn add(known: &mut Known, record: Record, path: &Path) -> Result<bool> {
    let Record { scene, seed, outcome, word, .. } = record;
    match known.entry(scene).or_default().entry(seed) {
        Entry::Vacant(entry) => {
            entry.insert(outcome);
            Ok(true)
        }
        Entry::Occupied(known) if *known.get() == outcome => Ok(false),
        Entry::Occupied(_) => Err(input_error!(
            path.display(),
            "two outcomes of {word} with seed {seed}",
            "one outcome of each flight",
            "take out the line that is wrong, or name another folder",
        )),
    }
}

/// The end of `flights.jsonl`.
#[derive(Debug)]
struct Log {
    file: File,
    /// Bytes of whole lines.
    length: u64,
    n_flights: usize,
}

impl Store {
    /// Name of the file with the flights.
    pub const FLIGHTS: &str = "flights.jsonl";

    /// Opens a store, and makes it if there is none.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] if another process has it open. [`Error::Input`] if another version of
    /// this program wrote it or a line is broken. [`Error::Io`].
    pub fn open(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
        let path = folder.join(Self::FLIGHTS);
        for file in [&path, &folder.join(LOCK), &folder.join(HEADER_FILE)] {
            // A pipe would keep the program waiting.
            if file.exists() && !file.is_file() {
                let wanted = "a file, or nothing yet";
                return Err(Error::input(file.display(), "no regular file", wanted, ANOTHER));
            }
        }
        // The lock before anything is read or written.
        let lock = lock(folder)?;
        check_header(folder)?;
        let mut file = writable(&path)?;
        let (mut known, mut n_flights) = (Known::default(), 0);
        let length = each_line(&file, &path, |record| {
            n_flights += 1;
            add(&mut known, record, &path).map(drop)
        })?;
        // Half a line of a killed program is taken off.
        cut(&mut file, length).map_err(|source| Error::write(&path, source))?;
        let log = Mutex::new(Log { file, length, n_flights });
        Ok(Self { path, known, log, _lock: lock })
    }

    /// The outcome of a flight that was stored before the store was opened, or taken over.
    pub fn get(&self, scene: &str, seed: u64) -> Option<Outcome> {
        self.known.get(scene)?.get(&seed).cloned()
    }

    /// Takes over the flights of another file that it lacks, such as a shard's.
    ///
    /// # Errors
    ///
    /// As [`Self::read`] and [`Self::put`]. [`Error::Input`] if a flight has another outcome there.
    pub fn take(&mut self, path: &Path) -> Result<()> {
        Self::read(path)?.into_iter().try_for_each(|record| {
            if add(&mut self.known, record.clone(), path)? { self.put(&record) } else { Ok(()) }
        })
    }

    /// Flights that were there when it was opened, and those that were taken over.
    pub fn n_known(&self) -> usize {
        self.known.values().map(BTreeMap::len).sum()
    }

    /// Appends a flight, by one write of one whole line.
    ///
    /// # Errors
    ///
    /// [`Error::Io`], such as for a full disk. The line is then taken off again, and all before it
    /// stays. [`Error::Input`] beyond the flights of the largest study. Panics if another thread
    /// panicked while it wrote.
    pub fn put(&self, record: &Record) -> Result<()> {
        // The line is made before the lock is taken, so that threads wait only for the write.
        let line = line_of(record);
        let mut log = self.log.lock().expect("no writer panics");
        if log.n_flights >= MAX_TRIALS {
            return Err(too_many(self.path.display()));
        }
        log.append(&line).map_err(|source| Error::write(&self.path, source))?;
        log.n_flights += 1;
        Ok(())
    }

    /// Reads the flights of a file of a store, or of a shard.
    ///
    /// # Errors
    ///
    /// [`Error::Io`], [`Error::Input`] with the line that is broken, and for more than 500,000
    /// flights. Half a line at the end is skipped.
    pub fn read(path: &Path) -> Result<Vec<Record>> {
        let mut records = Vec::new();
        each_line(LIMIT.open(path)?, path, |record| {
            records.push(record);
            Ok(())
        })?;
        Ok(records)
    }

    /// Writes records as a whole file of such lines: under another name, kept by the disk, then
    /// named.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]. Nothing is left then.
    pub fn write(path: &Path, records: &[Record]) -> Result<()> {
        let lines: Vec<u8> = records.iter().flat_map(line_of).collect();
        Output::create(path)?.keep_on_disk(lines).map(drop)
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        if let Ok(log) = self.log.lock() {
            // Against a power failure: written lines outlive the program.
            let _ = log.file.sync_data();
        }
    }
}

impl Log {
    fn append(&mut self, line: &[u8]) -> std::io::Result<()> {
        if let Err(error) = self.file.write_all(line) {
            // The next record goes behind the last whole line.
            let _ = cut(&mut self.file, self.length);
            return Err(error);
        }
        self.length += line.len() as u64;
        if self.n_flights.is_multiple_of(SYNC_EVERY) { self.file.sync_data() } else { Ok(()) }
    }
}

fn line_of(record: &Record) -> Vec<u8> {
    let mut line = serde_json::to_vec(record).expect("a record is plain data");
    line.push(b'\n');
    line
}

/// A file to read and write, which is made if there is none.
fn writable(path: &Path) -> Result<File> {
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
    file.map_err(|source| Error::write(path, source))
}

/// Cuts a file to a length, and writes on from there.
fn cut(file: &mut File, length: u64) -> std::io::Result<()> {
    file.set_len(length)?;
    file.seek(SeekFrom::End(0)).map(drop)
}

/// Takes the folder for this process, until the file is closed.
fn lock(folder: &Path) -> Result<File> {
    let path = folder.join(LOCK);
    let file = writable(&path)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::infeasible(
            format!("{}: another noctograph is writing here", folder.display()),
            "wait until it is done, or name another folder",
        )),
        Err(TryLockError::Error(source)) => Err(Error::write(&path, source)),
    }
}

/// Checks the header of the folder, and writes that of a new one.
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
        let hint = "remove it (a power failure may leave it so); the flights beside it stay";
        return Err(Error::input(path.display(), "an empty file", wanted, hint));
    }
    let Header { noctograph, format } = serde_json::from_str(text).map_err(|_broken| {
        let start: String = text.chars().take(60).collect();
        Error::input(path.display(), start, wanted, "name another folder: this one holds no study")
    })?;
    // Another build flies other flights, whatever its version is.
    if (&noctograph, format) == (&ours.noctograph, FORMAT) {
        return Ok(());
    }
    let wanted = ours.noctograph;
    Err(input_error!(
        path.display(),
        "flights of noctograph {noctograph} (format {format})",
        "{wanted} (format {FORMAT})",
        "name another folder: flights of two builds cannot be compared",
    ))
}

/// More flights than the largest study has.
fn too_many(place: impl Into<Place>) -> Error {
    let number = format!("more than {MAX_TRIALS} flights");
    Error::input(place, number, "at most those of the largest study", ANOTHER)
}

/// Calls a function with each whole line, and returns their length in bytes. Half a line of ours
/// may follow them.
fn each_line(
    file: impl Read,
    path: &Path,
    mut each: impl FnMut(Record) -> Result<()>,
) -> Result<u64> {
    let mut reader = BufReader::new(file);
    let (mut count, mut length, mut line) = (0, 0, Vec::new());
    loop {
        line.clear();
        let limited = Read::take(&mut reader, MAX_LINE_BYTES as u64);
        let n = { limited }.read_until(b'\n', &mut line).map_err(|e| Error::read(path, e))?;
        // Half a line at the end is skipped if it is one of ours. Foreign text is an error below,
        // so that it is never cut off.
        let is_ours = line.starts_with(BEGINNING) || BEGINNING.starts_with(&line);
        if n == 0 || (line.last() != Some(&b'\n') && n < MAX_LINE_BYTES && is_ours) {
            return Ok(length);
        }
        count += 1;
        let place = format!("{}:{count}", path.display());
        if count > MAX_TRIALS {
            return Err(too_many(place));
        }
        let hint = "take the line out, or name another folder";
        let record: Record = serde_json::from_slice(&line)
            .map_err(|error| Error::input(&*place, error, "a flight as one JSON object", hint))?;
        record.outcome.check(&place)?;
        each(record)?;
        length += n as u64;
    }
}

#[cfg(test)]
mod tests;
