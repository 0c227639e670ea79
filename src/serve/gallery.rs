//! A gallery on the disk: a folder an entry, and the order of flight.
//!
//! An entry is a folder `0012-NOOR` that can be read without the program: photo.png with its scene,
//! photo.jpg, replay.json, scene.toml, wish.json (what was asked for) and entry.json. It is staged
//! beside its place, is on the disk, and then has its name: an entry that was confirmed survives a
//! kill at any moment, and one that was not leaves nothing. A gallery belongs to one server at a
//! time. Links in it are not followed.

use std::fs::File;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::address::secret;
use super::timestamp::now;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Limit, Output, entries_in, folder_in};
use noctograph_export::stem;
pub(crate) use noctograph_photo_service::answer::JPEG;
use noctograph_photo_service::answer::{LargeFacts, PhotoFacts};
use noctograph_photo_service::messages::Message;
use noctograph_photo_service::request::Subject;
use noctograph_score::{LetterVerdict, Reason};

const ENTRY: &str = "entry.json";
const SUBJECT: &str = "wish.json";
const ORDER: &str = "queue.json";
const TABLE: Limit = Limit { bytes: 1 << 20, what: "an entry", hint: "move it out of the gallery" };

/// Files of an entry's photo.
pub(crate) const PNG: &str = "photo.png";
pub(crate) const REPLAY: &str = "replay.json";
const SCENE: &str = "scene.toml";

/// Greatest number of an entry: a folder above it was put there by hand.
const MAX_NUMBER: u32 = 999_999_999;

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum State {
    Waiting,
    Approved,
    Flying,
    Flown,
    Rejected,
}

/// A large photo that a visitor sent.
#[derive(Debug)]
pub(crate) struct Photo {
    /// Name of the wish that it was made of.
    pub(crate) id: String,
    pub(crate) visitor: String,
    pub(crate) subject: Subject,
    pub(crate) figures: Figures,
    /// Its files with some that an entry does not keep.
    pub(crate) files: Vec<noctograph_export::File>,
}

/// What an entry keeps of the facts of its photo.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(default)]
pub(crate) struct Figures {
    /// Number of drones; 0 in an entry of an earlier version.
    drones: usize,
    /// Seconds of the longest flight.
    pub(crate) flight_s: f64,
    /// Whether the word is read; null of a drawing, as the next three.
    pub(crate) legible: Option<bool>,
    letters: Option<Vec<LetterVerdict>>,
    /// What makes any word unreadable.
    obstacles: Vec<Message>,
    pub(crate) read: Option<String>,
    reason: Option<Reason>,
    /// What stops its flight: nothing, or it would not have been kept.
    stops: Vec<Message>,
}

impl Figures {
    pub(crate) fn new(LargeFacts { photo, verdict, stops, drones, .. }: LargeFacts) -> Self {
        let PhotoFacts { flight_s, obstacles, .. } = photo;
        let figures = Self { drones, flight_s, obstacles, stops, ..Self::default() };
        let Some(verdict) = verdict else { return figures };
        Self {
            legible: Some(verdict.legible),
            letters: Some(verdict.letters),
            read: Some(verdict.read),
            reason: verdict.reason,
            ..figures
        }
    }
}

/// An entry as its file has it.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Secret name of its own page.
    pub(crate) id: String,
    /// Name on the wall, which leads to nothing else.
    pub(crate) key: String,
    pub(crate) number: u32,
    /// The word; `None` for a drawing.
    pub(crate) title: Option<String>,
    /// When it was sent (RFC 3339).
    pub(crate) made: String,
    pub(crate) state: State,
    #[serde(default)]
    pub(crate) hidden: bool,
    pub(crate) visitor: String,
    /// The wish that it was made of.
    pub(crate) photo: String,
    pub(crate) language: String,
    #[serde(rename = "found")]
    pub(crate) figures: Figures,
}

/// An entry as the operator sees it. It borrows, as a queue of hundreds is asked for often.
#[derive(Debug, Serialize)]
pub(crate) struct ForOperator<'a> {
    id: &'a str,
    number: &'a u32,
    title: &'a Option<String>,
    made: &'a str,
    state: &'a State,
    hidden: &'a bool,
    visitor: Option<&'a str>,
    #[serde(flatten)]
    figures: &'a Figures,
}

/// Order of flight and whether entries are taken, as the file has it.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Order {
    pub(crate) paused: bool,
    pub(crate) numbers: Vec<u32>,
}

#[derive(Debug)]
pub(crate) struct Gallery {
    folder: PathBuf,
    /// Shows other servers that the gallery is in use.
    _lock: Option<File>,
}

impl Gallery {
    /// Opens a gallery, making it where it does not exist.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
        Ok(Self { folder: folder.to_owned(), _lock: lock(folder)? })
    }

    /// Reads all entries with their folders; warns of unreadable ones and leaves them alone.
    pub(crate) fn read(&self, warn: fn(&str)) -> Result<Vec<(Entry, PathBuf)>> {
        let mut entries = Vec::new();
        for path in entries_in(&self.folder)? {
            match read_entry(&path) {
                Ok(Some(entry)) => entries.push((entry, path)),
                Ok(None) => {}
                Err(error) => warn(&format!("left alone: {error}")),
            }
        }
        Ok(entries)
    }

    pub(crate) fn read_order(&self) -> Order {
        let text = regular(self.folder.join(ORDER)).and_then(|path| TABLE.read_text(&path).ok());
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
    }

    pub(crate) fn write_order(&self, order: &Order) -> Result<()> {
        write(&self.folder.join(ORDER), &pretty(order))
    }

    /// Writes an entry's folder: whole, on the disk, and then under its name. Its number rises
    /// until it is free.
    pub(crate) fn keep(&self, entry: &mut Entry, photo: &Photo) -> Result<PathBuf> {
        let failed = |source| Error::write(&self.folder, source);
        let (staging, mut lock) = folder_in(&self.folder).map_err(failed)?;
        for noctograph_export::File { name, bytes } in &photo.files {
            if [PNG, SCENE, JPEG, REPLAY].contains(&&**name) || name.starts_with("drawing.") {
                write(&staging.path().join(name), bytes)?;
            }
        }
        let subject = serde_json::to_vec(&photo.subject).expect("a subject is plain data");
        write(&staging.path().join(SUBJECT), &subject)?;
        loop {
            write(&staging.path().join(ENTRY), &pretty(entry))?;
            synced(staging.path()).map_err(failed)?;
            let folder = self.folder.join(entry.folder_name());
            if cfg!(windows) {
                // It renames no folder in which a file is open.
                lock = None;
            }
            match std::fs::rename(staging.path(), &folder) {
                Ok(()) => {}
                // Something that was put there by hand has the name.
                Err(_) if folder.symlink_metadata().is_ok() => {
                    entry.number += 1;
                    continue;
                }
                Err(source) => return Err(Error::write(&folder, source)),
            }
            // It has its name: nothing is left to remove.
            let _ = staging.keep();
            drop(lock);
            if let Err(source) = synced(&self.folder) {
                let _ = remove(&folder);
                return Err(failed(source));
            }
            return Ok(folder);
        }
    }
}

impl Entry {
    pub(crate) fn new(photo: &Photo, language: &str, number: u32) -> Result<Self> {
        Ok(Self {
            id: secret()?,
            key: secret()?,
            number,
            title: photo.subject.title().map(str::to_owned),
            made: now(),
            state: State::Waiting,
            hidden: false,
            visitor: photo.visitor.clone(),
            photo: photo.id.clone(),
            language: language.to_owned(),
            figures: photo.figures.clone(),
        })
    }

    pub(crate) fn for_operator(&self) -> ForOperator<'_> {
        let Self { id, number, title, made, state, hidden, figures, .. } = self;
        // Enough to tell visitors apart.
        let visitor = self.visitor.get(..4);
        ForOperator { id, number, title, made, state, hidden, visitor, figures }
    }

    /// The name of its folder: `0012-NOOR`.
    fn folder_name(&self) -> String {
        format!("{:04}-{}", self.number, stem(self.title.as_deref().unwrap_or_default()))
    }
}

/// Reads an entry; `None` for what is none.
fn read_entry(folder: &Path) -> Result<Option<Entry>> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    // What a killed server was writing has a name with a dot.
    let is_folder = folder.symlink_metadata().is_ok_and(|it| it.is_dir()) && !name.starts_with('.');
    let Some(path) = regular(folder.join(ENTRY)).filter(|_| is_folder) else { return Ok(None) };
    let refused = |actual: String| {
        Error::input(path.display(), actual, "an entry of this program", TABLE.hint)
    };
    let entry: Entry = serde_json::from_str(&TABLE.read_text(&path)?)
        .map_err(|error| refused(error.to_string()))?;
    match entry.number {
        1..=MAX_NUMBER => Ok(Some(entry)),
        number => Err(refused(format!("the number {number}"))),
    }
}

/// Writes what became of an entry.
pub(crate) fn write_entry(folder: &Path, entry: &Entry) -> Result<()> {
    write(&folder.join(ENTRY), &pretty(entry))
}

/// What was asked for with an entry.
pub(crate) fn read_subject(folder: &Path) -> Option<Subject> {
    serde_json::from_str(&TABLE.read_text(&regular(folder.join(SUBJECT))?).ok()?).ok()
}

/// A path that is a file itself, not a link to one.
pub(crate) fn regular(path: PathBuf) -> Option<PathBuf> {
    path.symlink_metadata().is_ok_and(|it| it.is_file()).then_some(path)
}

/// Removes an entry's folder: first what makes it one.
pub(crate) fn remove(folder: &Path) -> Result<()> {
    let path = folder.join(ENTRY);
    std::fs::remove_file(&path).map_err(|source| Error::write(&path, source))?;
    let _ = std::fs::remove_dir_all(folder);
    Ok(())
}

fn pretty(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec_pretty(value).expect("it is plain data")
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Output::create(path)?.keep_on_disk(bytes).map(drop)
}

/// Brings a folder's names to the disk, where the system can.
#[expect(clippy::disallowed_methods, reason = "a folder")]
fn synced(folder: &Path) -> std::io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// Locks a gallery as long as the file returned is open; `None` where the system has no such locks.
#[expect(clippy::disallowed_methods, reason = "a folder")]
fn lock(folder: &Path) -> Result<Option<File>> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(std::fs::TryLockError::WouldBlock) => {
            let hint = "end it, or name another gallery";
            let actual = "in use by another server";
            Err(Error::input(folder.display(), actual, "a gallery of one's own", hint))
        }
        Err(std::fs::TryLockError::Error(_)) => Ok(None),
    }
}
