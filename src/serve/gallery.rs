//! Gallery on the disk, which consists of a folder for each entry and the order of flight.
//!
//! An entry is a folder `0012-NOOR` that can be used without the program: photo.png with its scene,
//! photo.jpg, replay.json, scene.toml, wish.json (the request) and entry.json. The folder is
//! written under a temporary name, synced to the disk and then renamed. If the server is killed,
//! confirmed entries survive, and an unconfirmed entry leaves no entry behind. Only one server can
//! use a gallery at a time. Links in a gallery are not followed.
//!
//! The photo of a flight, such as `flown-1.png`, is stored before entry.json refers to it.

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

/// Name of the file with an entry's facts.
const ENTRY: &str = "entry.json";
/// Name of the file with an entry's word or drawing and settings.
const SUBJECT: &str = "wish.json";
/// Name of the gallery's file with the order of flight.
const ORDER: &str = "queue.json";
const TABLE: Limit = Limit { bytes: 1 << 20, what: "an entry", hint: "move it out of the gallery" };

/// Name of an entry's photo.
pub(crate) const PNG: &str = "photo.png";
/// Name of the file with the path of the light over time.
pub(crate) const REPLAY: &str = "replay.json";
/// Name of an entry's scene file.
const SCENE: &str = "scene.toml";

/// Largest number of an entry. A folder with a larger number was added by hand.
const MAX_NUMBER: u32 = 999_999_999;

/// State of an entry.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum State {
    Waiting,
    Approved,
    Flying,
    Flown,
    Rejected,
}

/// A photo that becomes an entry.
#[derive(Debug)]
pub(crate) struct Photo {
    /// Digest of the photo's request.
    pub(crate) id: String,
    pub(crate) visitor: String,
    pub(crate) subject: Subject,
    pub(crate) figures: Figures,
    /// Files of the photo, of which an entry stores only some.
    pub(crate) files: Vec<noctograph_export::File>,
}

/// Facts about a photo that are stored with its entry.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(default)]
pub(crate) struct Figures {
    /// Number of drones, or 0 in an entry of an earlier version.
    pub(crate) drones: usize,
    /// Duration of the longest flight, in s.
    pub(crate) flight_s: f64,
    /// True if the word is legible. For a drawing, this value is null, and so are the letters, the
    /// reading and the reason.
    pub(crate) legible: Option<bool>,
    letters: Option<Vec<LetterVerdict>>,
    /// Problems that make any word unreadable.
    obstacles: Vec<Message>,
    pub(crate) read: Option<String>,
    /// Probability that the word is read, or `None` for a drawing or an older entry.
    pub(crate) readability: Option<f64>,
    reason: Option<Reason>,
    /// Checks that stop the flight. There are none, because such a photo is refused.
    stops: Vec<Message>,
}

impl Figures {
    /// Returns the facts to be stored with an entry from those of its large photo.
    pub(crate) fn new(LargeFacts { photo, verdict, stops, drones, .. }: LargeFacts) -> Self {
        let PhotoFacts { flight_s, obstacles, .. } = photo;
        let figures = Self { drones, flight_s, obstacles, stops, ..Self::default() };
        let Some(verdict) = verdict else { return figures };
        Self {
            legible: Some(verdict.legible),
            letters: Some(verdict.letters),
            read: Some(verdict.read),
            readability: Some(verdict.readability),
            reason: verdict.reason,
            ..figures
        }
    }
}

/// An entry as its file contains it.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Secret name of the entry's page.
    pub(crate) id: String,
    /// Name of the entry on the wall, which gives no other access.
    pub(crate) key: String,
    pub(crate) number: u32,
    /// The word, or `None` for a drawing.
    pub(crate) title: Option<String>,
    /// Time at which the entry was made (RFC 3339).
    pub(crate) made: String,
    pub(crate) state: State,
    #[serde(default)]
    pub(crate) hidden: bool,
    pub(crate) visitor: String,
    pub(crate) photo: String,
    pub(crate) language: String,
    #[serde(rename = "found")]
    pub(crate) figures: Figures,
    /// Photo of the last flight, if its log was followed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) flown: Option<FlownPhoto>,
}

/// Photo of an entry's flight.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub(crate) struct FlownPhoto {
    /// Name of the photo's files without extensions, such as `flown-2` for the second flight.
    pub(crate) name: String,
    /// Probability that the word is read, or `None` for a drawing.
    pub(crate) readability: Option<f64>,
}

/// An entry as the operator receives it. Its fields are borrowed, because long queues are requested
/// often.
#[derive(Debug, Serialize)]
pub(crate) struct ForOperator<'a> {
    id: &'a str,
    number: &'a u32,
    title: &'a Option<String>,
    made: &'a str,
    state: &'a State,
    hidden: &'a bool,
    visitor: Option<&'a str>,
    flown: &'a Option<FlownPhoto>,
    #[serde(flatten)]
    figures: &'a Figures,
}

/// The file with the order of flight and the state of the queue.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Order {
    pub(crate) paused: bool,
    pub(crate) numbers: Vec<u32>,
}

/// A gallery that this server has locked.
#[derive(Debug)]
pub(crate) struct Gallery {
    folder: PathBuf,
    /// Open file that locks the gallery against other servers.
    _lock: Option<File>,
}

impl Gallery {
    /// Opens a gallery, which is created if it does not exist, and locks it.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
        Ok(Self { folder: folder.to_owned(), _lock: lock(folder)? })
    }

    /// Reads all entries, and returns them with their folders. Reports entries that cannot be read,
    /// and leaves them in place.
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

    /// Returns the order of flight and the pause. Without a readable file, the order is empty and
    /// not paused.
    pub(crate) fn read_order(&self) -> Order {
        let text =
            regular_file(self.folder.join(ORDER)).and_then(|path| TABLE.read_text(&path).ok());
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
    }

    /// Writes the order of flight and the state of the queue.
    pub(crate) fn write_order(&self, order: &Order) -> Result<()> {
        write(&self.folder.join(ORDER), &pretty(order))
    }

    /// Writes an entry's folder under a temporary name, syncs it to the disk, and renames it.
    /// Increases the entry's number until the folder's name is unused. Returns the folder. After an
    /// error, no entry is left.
    pub(crate) fn add(&self, entry: &mut Entry, photo: &Photo) -> Result<PathBuf> {
        let (staging, mut lock) = folder_in(&self.folder).map_err(|e| self.failed(e))?;
        // Only files that can be used without the program are stored, including the drawing,
        // because the scene refers to it.
        for noctograph_export::File { name, bytes } in &photo.files {
            if [PNG, SCENE, JPEG, REPLAY].contains(&&**name) || name.starts_with("drawing.") {
                write(&staging.path().join(name), bytes)?;
            }
        }
        let subject = serde_json::to_vec(&photo.subject).expect("a subject is plain data");
        write(&staging.path().join(SUBJECT), &subject)?;
        loop {
            write(&staging.path().join(ENTRY), &pretty(entry))?;
            sync(staging.path()).map_err(|e| self.failed(e))?;
            let folder = self.folder.join(entry.folder_name());
            if cfg!(windows) {
                // Windows does not rename a folder that contains an open file.
                lock = None;
            }
            match std::fs::rename(staging.path(), &folder) {
                Ok(()) => {}
                // A folder that was added by hand already has this name.
                Err(_) if folder.symlink_metadata().is_ok() => {
                    entry.number += 1;
                    continue;
                }
                Err(source) => return Err(Error::write(&folder, source)),
            }
            // `staging` must no longer remove its folder, which now has its final name.
            let _ = staging.keep();
            drop(lock);
            if let Err(source) = sync(&self.folder) {
                let _ = remove(&folder);
                return Err(self.failed(source));
            }
            return Ok(folder);
        }
    }

    /// Returns the error for a gallery that cannot be written.
    fn failed(&self, source: std::io::Error) -> Error {
        Error::write(&self.folder, source)
    }
}

impl Entry {
    /// Creates the entry for a photo, with new secret names, waiting for approval.
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
            flown: None,
        })
    }

    /// Returns the part of the entry that the operator receives.
    pub(crate) fn for_operator(&self) -> ForOperator<'_> {
        let Self { id, number, title, made, state, hidden, figures, flown, .. } = self;
        // Four characters of the visitor's secret name are enough to distinguish visitors.
        let visitor = self.visitor.get(..4);
        ForOperator { id, number, title, made, state, hidden, visitor, flown, figures }
    }

    /// Returns the name of the entry's folder, such as `0012-NOOR`.
    fn folder_name(&self) -> String {
        format!("{:04}-{}", self.number, stem(self.title.as_deref().unwrap_or_default()))
    }
}

/// Returns the entry in a folder, or `None` for other files and folders. Returns [`Error::Input`]
/// for an entry that this program did not write.
fn read_entry(folder: &Path) -> Result<Option<Entry>> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    // The name of an unfinished entry, which a killed server left behind, begins with a dot.
    let is_folder =
        folder.symlink_metadata().is_ok_and(|metadata| metadata.is_dir()) && !name.starts_with('.');
    let Some(path) = regular_file(folder.join(ENTRY)).filter(|_| is_folder) else {
        return Ok(None);
    };
    let wrong = match serde_json::from_str::<Entry>(&TABLE.read_text(&path)?) {
        Ok(entry) if (1..=MAX_NUMBER).contains(&entry.number) => return Ok(Some(entry)),
        Ok(entry) => format!("the number {}", entry.number),
        Err(error) => error.to_string(),
    };
    Err(Error::input(path.display(), wrong, "an entry of this program", TABLE.hint))
}

/// Writes the photo of a flight into an entry's folder under a new name, and syncs it to the disk.
/// Returns this name, which has no extension.
pub(crate) fn write_flown(folder: &Path, files: &[noctograph_export::File]) -> Result<String> {
    let exists = |number: &u32| folder.join(format!("flown-{number}.png")).exists();
    let name = format!("flown-{}", (1..).find(|number| !exists(number)).unwrap_or(1));
    // The PNG, which takes the name, is written last. An unfinished set is overwritten.
    for (file, ending) in [(JPEG, "jpg"), (REPLAY, "json"), (PNG, "png")] {
        for noctograph_export::File { bytes, .. } in files.iter().filter(|f| f.name == file) {
            write(&folder.join(format!("{name}.{ending}")), bytes)?;
        }
    }
    sync(folder).map_err(|source| Error::write(folder, source))?;
    Ok(name)
}

/// Writes an entry's file into its folder.
pub(crate) fn write_entry(folder: &Path, entry: &Entry) -> Result<()> {
    write(&folder.join(ENTRY), &pretty(entry))
}

/// Reads the subject of the entry in a folder. Returns `None` if it cannot be read.
pub(crate) fn read_subject(folder: &Path) -> Option<Subject> {
    serde_json::from_str(&TABLE.read_text(&regular_file(folder.join(SUBJECT))?).ok()?).ok()
}

/// Returns a path if it is that of a file and not of a link.
pub(crate) fn regular_file(path: PathBuf) -> Option<PathBuf> {
    path.symlink_metadata().is_ok_and(|metadata| metadata.is_file()).then_some(path)
}

/// Removes an entry's folder. The entry file is removed first, because the remaining files do not
/// count as an entry without it.
pub(crate) fn remove(folder: &Path) -> Result<()> {
    let path = folder.join(ENTRY);
    std::fs::remove_file(&path).map_err(|source| Error::write(&path, source))?;
    let _ = std::fs::remove_dir_all(folder);
    Ok(())
}

/// Returns a value as JSON with line breaks.
fn pretty(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec_pretty(value).expect("it is plain data")
}

/// Writes a file, which appears only when it is complete, and syncs it to the disk.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Output::create(path)?.keep_on_disk(bytes).map(drop)
}

/// Syncs the file names in a folder to the disk, if the system supports it.
#[expect(clippy::disallowed_methods, reason = "a folder")]
fn sync(folder: &Path) -> std::io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

/// Locks a gallery as long as the returned file is open. Returns `None` if the system does not
/// support such locks, and [`Error::Input`] if another server uses the gallery.
#[expect(clippy::disallowed_methods, reason = "a folder")]
fn lock(folder: &Path) -> Result<Option<File>> {
    let Ok(file) = File::open(folder) else { return Ok(None) };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(std::fs::TryLockError::WouldBlock) => {
            let hint = "stop that server, or name another gallery";
            let actual = "in use by another server";
            Err(Error::input(folder.display(), actual, "a gallery that no server uses", hint))
        }
        Err(std::fs::TryLockError::Error(_)) => Ok(None),
    }
}
