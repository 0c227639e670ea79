//! Shows the light of a flight while it is being flown, from the log that its script writes.
//!
//! 1. Four times a second, a folder and its direct subfolders are searched for logs that have
//!    grown. Logs that existed before the server was started are ignored until they grow.
//! 2. A log belongs to the entry of its word that is in the air, or else to the first approved
//!    entry of the word, preferably without a flight. The operator is notified of other logs.
//! 3. A worker exposes the light so far, at most twice a second and with at most a quarter of a
//!    processor core.
//! 4. When the log ends or stops growing, the photo is judged and stored with the entry.
//!
//! Only one log is followed at a time. Other logs wait, and are read from their files later.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::entries::{Entries, FlightNote};
use super::gallery::{PNG, regular_file};
use super::routes::Server;
use super::worker::{Followed, Job};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{ending, entries_in};
use noctograph_logs::word_in;
use noctograph_photo_service::messages::{Key, Message};
use noctograph_photo_service::request::{Product, Subject};

/// Interval at which the folder is searched.
const LOOK: Duration = Duration::from_millis(250);
/// Shortest interval from one photo to the next.
const PERIOD: Duration = Duration::from_millis(500);
/// Shortest interval from one photo to the next, as a multiple of the time that a photo takes.
const PERIODS_OF_WORK: u32 = 4;
/// Time without new samples after which a flight counts as over. Scripts write ten times a second.
const SILENCE: Duration = Duration::from_secs(20);
/// Maximum number of logs that are searched for.
const MAX_LOGS: usize = 2000;
/// Maximum number of notes for the operator at a time.
const MAX_NOTES: usize = 4;

/// State of a log.
#[derive(Debug, PartialEq)]
enum State {
    /// The log is ignored until it grows, because it is old or its flight was shown. `is_cut` is
    /// true if it has no end mark.
    Rests { is_cut: bool },
    /// The log is being followed, or waits to be followed.
    Waits,
    /// The log cannot be shown, for the given reason.
    Refused(String),
}

/// A log in the folder.
#[derive(Debug)]
struct Log {
    /// Size of the file in bytes.
    n_bytes: u64,
    /// Time at which the log last grew.
    grew: Instant,
    state: State,
    /// Word that was flown, or `None` until the log's header has been read.
    word: Option<String>,
}

/// The log that is being followed.
#[derive(Debug)]
struct Current {
    path: PathBuf,
    /// Name of the entry to which the log belongs.
    id: String,
    subject: Subject,
    /// Number of bytes in the log when the last photo was made.
    n_bytes: u64,
    /// Time of the next photo.
    next: Instant,
}

/// The logs in a folder.
#[derive(Debug)]
pub(crate) struct Flights {
    folder: PathBuf,
    logs: BTreeMap<PathBuf, Log>,
    current: Option<Current>,
    /// Number of logs that have been followed.
    n_followed: u64,
}

impl Flights {
    /// Creates the folder if it does not exist, and searches it for the first time. Logs that
    /// already exist are ignored until they grow.
    pub(crate) fn new(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
        let folder = std::path::absolute(folder).map_err(|e| Error::read(folder, e))?;
        let mut flights = Self { logs: BTreeMap::new(), current: None, n_followed: 0, folder };
        flights.update(sizes_in(&flights.folder)?);
        for log in flights.logs.values_mut() {
            log.state = State::Rests { is_cut: false };
        }
        Ok(flights)
    }

    /// Follows flights until the program ends. May block on the disk and on the list of entries.
    pub(crate) fn follow(mut self, server: &Server) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let Ok(runtime) = runtime else { return };
        loop {
            std::thread::sleep(LOOK);
            let sizes = sizes_in(&self.folder);
            let is_gone = sizes.is_err();
            if let Ok(sizes) = sizes {
                self.update(sizes);
            }
            self.choose(&server.entries);
            runtime.block_on(self.expose(server));
            server.entries.note(self.notes(&server.entries, is_gone));
        }
    }

    /// Updates the sizes and states of the logs. Forgets logs that no longer exist and are not
    /// followed. A log at rest that has grown is then waiting to be followed.
    fn update(&mut self, sizes: BTreeMap<PathBuf, u64>) {
        let current = self.current.as_ref().map(|current| current.path.clone());
        self.logs.retain(|path, _| sizes.contains_key(path) || current.as_ref() == Some(path));
        for (path, n_bytes) in sizes {
            let grew = Instant::now();
            let new = Log { n_bytes: 0, grew, state: State::Waits, word: None };
            let is_current = current.as_ref() == Some(&path);
            let log = self.logs.entry(path).or_insert(new);
            if n_bytes == log.n_bytes {
                continue;
            }
            // A file that has become shorter is treated as a new log. A refused log remains refused
            // when it grows.
            if n_bytes < log.n_bytes {
                (log.state, log.word) = (State::Waits, None);
                self.current = self.current.take().filter(|_| !is_current);
            } else if matches!(log.state, State::Rests { .. }) {
                log.state = State::Waits;
            }
            (log.n_bytes, log.grew) = (n_bytes, grew);
        }
    }

    /// Reads the words of new logs, and chooses the log to follow if none is being followed. Only
    /// the log of an entry for a single drone is followed.
    fn choose(&mut self, entries: &Entries) {
        for (path, log) in self.logs.iter_mut().filter(|(_, log)| log.state == State::Waits) {
            // A file that no longer grows does not become a script's log, so its header is not read
            // again.
            if log.word.is_none() && log.grew.elapsed() < SILENCE {
                log.word = word_in(path);
            }
            let flown = log.word.as_ref().and_then(|word| entries.flies(word));
            // An entry of an earlier version has 0 drones.
            let Some((id, 0 | 1)) = flown.filter(|_| self.current.is_none()) else { continue };
            if let Some(subject) = entries.subject(&id) {
                self.n_followed += 1;
                let (path, next) = (path.clone(), Instant::now());
                self.current = Some(Current { path, id, subject, n_bytes: 0, next });
            }
        }
    }

    /// Makes the photo of the flight so far if its log has grown. Shows its light or, when the
    /// flight is over, stores the photo. A log that is refused is no longer followed, nor is one
    /// whose entry is no longer approved.
    async fn expose(&mut self, server: &Server) {
        let Some(current) = &mut self.current else { return };
        let Some(log) = self.logs.get_mut(&current.path) else { return };
        if !server.entries.is_approved(&current.id) {
            server.entries.end_light();
            self.current = None;
            return;
        }
        // A log that stopped growing without an end mark is over after a while. The worker
        // recognizes the mark of a complete log.
        let is_over = log.n_bytes == current.n_bytes && log.grew.elapsed() > SILENCE;
        if Instant::now() < current.next || (log.n_bytes == current.n_bytes && !is_over) {
            return;
        }
        current.n_bytes = log.n_bytes;
        let begun = Instant::now();
        let flight = Followed { path: current.path.clone(), number: self.n_followed, is_over };
        let product = Product::Large { advice: false, files: true };
        let job =
            Job { product, subject: current.subject.clone(), page: None, flight: Some(flight) };
        let made = server.flights.make(job).await;
        current.next = begun + PERIOD.max(PERIODS_OF_WORK * begun.elapsed());
        log.state = match made {
            Ok(parcel) if parcel.files.iter().any(|file| file.name == PNG) => {
                match server.entries.land(&current.id, &parcel) {
                    Ok(()) => State::Rests { is_cut: is_over },
                    Err(key) => State::Refused(Message::from(key).text),
                }
            }
            Ok(parcel) => {
                // A log that is still too short yields no photo.
                if let Some(photo) = parcel.files.into_iter().next() {
                    server.entries.shine(&current.id, photo.bytes);
                }
                return;
            }
            // Nothing is wrong with the log, which is tried again.
            Err(message) if message.key == Key::Busy.name() => return,
            Err(_too_short) if is_over => State::Rests { is_cut: true },
            Err(message) => State::Refused(message.text),
        };
        server.entries.end_light();
        self.current = None;
    }

    /// Returns the operator's notes about the logs that are not followed, at most [`MAX_NOTES`],
    /// and about the folder if it has disappeared (`is_gone`).
    fn notes(&self, entries: &Entries, is_gone: bool) -> Vec<FlightNote> {
        let note = |key, path: &Path, why: &str| {
            let name = path.strip_prefix(&self.folder).unwrap_or(path).display().to_string();
            FlightNote { key, name, why: why.to_owned() }
        };
        let is_current =
            |path: &Path| self.current.as_ref().is_some_and(|current| current.path == path);
        let gone = is_gone.then(|| note("flights-gone", &self.folder, ""));
        let notes = self.logs.iter().filter_map(|(path, log)| match (&log.state, &log.word) {
            (State::Rests { is_cut: false }, _) => None,
            (State::Rests { is_cut: true }, _) => Some(note("log-cut", path, "")),
            (State::Refused(why), _) => Some(note("log-broken", path, why)),
            (State::Waits, _) if log.n_bytes == 0 || is_current(path) => None,
            (State::Waits, None) => Some(note("log-broken", path, "not the log of a script")),
            (State::Waits, Some(word)) => match entries.flies(word) {
                None => Some(note("log-unknown", path, word)),
                Some((_, 0 | 1)) => Some(note("log-later", path, "")),
                Some(_) => Some(note("log-fleet", path, "")),
            },
        });
        gone.into_iter().chain(notes).take(MAX_NOTES).collect()
    }
}

/// Returns the sizes in bytes of the logs in a folder and its direct subfolders, at most
/// [`MAX_LOGS`]. Links are not followed.
fn sizes_in(folder: &Path) -> Result<BTreeMap<PathBuf, u64>> {
    let mut paths = entries_in(folder)?;
    let folders = paths.iter().filter(|path| path.symlink_metadata().is_ok_and(|m| m.is_dir()));
    // A subfolder that cannot be read is treated as empty.
    let inside: Vec<PathBuf> =
        folders.flat_map(|folder| entries_in(folder).unwrap_or_default()).collect();
    paths.extend(inside);
    let logs = paths.into_iter().filter(|path| ending(path) == "jsonl").filter_map(regular_file);
    let sizes = logs.take(MAX_LOGS).filter_map(|log| {
        let n_bytes = log.metadata().ok()?.len();
        Some((log, n_bytes))
    });
    Ok(sizes.collect())
}
