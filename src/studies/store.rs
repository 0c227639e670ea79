//! Store: a folder that never loses a flight.
//!
//! `study.json` says which program wrote it; `flights.jsonl` holds one JSON object a line, which
//! `jq`, `pandas.read_json(lines=True)` and `DuckDB` read as it is. A record is appended by one
//! write of one line, so a killed program leaves at worst half a line at the end, which the next
//! one takes off. One program at a time has the folder (`lock`).

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
/// Records between two syncs to disk. Killing the program loses none of them; pulling the plug
/// loses at most so many.
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

/// Adds the outcome of a file's flight; whether it is the first one. Another one is refused.
fn add(known: &mut Known, record: Record, path: &Path) -> Result<bool> {
    let Record { scene, seed, outcome, word, .. } = record;
    match known.entry(scene).or_default().entry(seed) {
        Entry::Vacant(place) => {
            place.insert(outcome);
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

    /// Opens a store, making it where there is none.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] where another process has it open; [`Error::Input`] where another
    /// version of this program wrote it or a line is broken; [`Error::Io`].
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
        let lock = lock(folder)?;
        check_header(folder)?;
        let unwritable = |source| Error::write(&path, source);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(&path).map_err(unwritable)?;
        let (mut known, mut n_flights) = (Known::default(), 0);
        let length = each_line(&file, &path, |record| {
            n_flights += 1;
            add(&mut known, record, &path).map(|_is_new| ())
        })?;
        if file.metadata().map_err(unwritable)?.len() > length {
            file.set_len(length).map_err(unwritable)?;
        }
        file.seek(SeekFrom::Start(length)).map_err(unwritable)?;
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
    /// As [`Self::read`] and [`Self::put`]; [`Error::Input`] where a flight has another outcome
    /// there.
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
    /// [`Error::Io`], such as for a full disk; then the line is taken off again, and all before it
    /// stays. [`Error::Input`] beyond the flights of the largest study.
    ///
    /// # Panics
    ///
    /// If another thread panicked while it wrote.
    pub fn put(&self, record: &Record) -> Result<()> {
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
    /// [`Error::Io`]; then nothing is left.
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
            // Half a line would be taken off at the next start; better not to leave it.
            let _ = self.file.set_len(self.length);
            let _ = self.file.seek(SeekFrom::Start(self.length));
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

/// Takes the folder for this process, until the file is closed.
fn lock(folder: &Path) -> Result<File> {
    let path = folder.join(LOCK);
    let unwritable = |source| Error::write(&path, source);
    let file = OpenOptions::new().create(true).write(true).truncate(false).open(&path);
    let file = file.map_err(unwritable)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::infeasible(
            format!("{}: another noctograph is writing here", folder.display()),
            "wait until it is done, or name another folder",
        )),
        Err(TryLockError::Error(source)) => Err(unwritable(source)),
    }
}

/// Checks the header of the folder; writes that of a new one.
fn check_header(folder: &Path) -> Result<()> {
    let path = folder.join(HEADER_FILE);
    let noctograph = format!("{} (source {SOURCE})", env!("CARGO_PKG_VERSION"));
    let ours = Header { noctograph, format: FORMAT };
    if !path.exists() {
        let text = serde_json::to_string(&ours).expect("plain data") + "\n";
        Output::create(&path)?.keep_on_disk(text)?;
        return Ok(());
    }
    let (text, wanted) = (HEADER.read_text(&path)?, "the header of a store");
    let text = text.trim();
    if text.is_empty() {
        let hint = "remove it (a power failure may leave it so); the flights beside it stay";
        return Err(Error::input(path.display(), "an empty file", wanted, hint));
    }
    let header: Header = serde_json::from_str(text).map_err(|_broken| {
        let start: String = text.chars().take(60).collect();
        Error::input(path.display(), start, wanted, "name another folder: this one holds no study")
    })?;
    if header != ours {
        let (theirs, ours) = (header.noctograph, ours.noctograph);
        let format = header.format;
        return Err(input_error!(
            path.display(),
            "flights of noctograph {theirs} (format {format})",
            "{ours} (format {FORMAT})",
            "name another folder: flights of two builds cannot be compared",
        ));
    }
    Ok(())
}

/// More flights than the largest study has.
fn too_many(place: impl Into<Place>) -> Error {
    let number = format!("more than {MAX_TRIALS} flights");
    Error::input(place, number, "at most those of the largest study", ANOTHER)
}

/// Calls a function with each whole line; how many bytes they take. What follows may be half a line
/// of ours.
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
        let begun = line.starts_with(BEGINNING) || BEGINNING.starts_with(&line);
        if n == 0 || (line.last() != Some(&b'\n') && n < MAX_LINE_BYTES && begun) {
            return Ok(length);
        }
        count += 1;
        let place = || format!("{}:{count}", path.display());
        if count > MAX_TRIALS {
            return Err(too_many(place()));
        }
        let hint = "take the line out, or name another folder";
        let record: Record = serde_json::from_slice(&line)
            .map_err(|error| Error::input(place(), error, "a flight as one JSON object", hint))?;
        record.outcome.check(&place())?;
        each(record)?;
        length += n as u64;
    }
}

#[cfg(test)]
mod tests;
