//! What visitors sent to be flown: the queue, the wall and everybody's own photo, in a gallery.
//!
//! An entry is a folder `0012-NOOR` that can be read without the program: photo.png with its scene,
//! photo.jpg, replay.json, scene.toml, wish.json (what was asked for) and entry.json. It is staged
//! beside its place, is on the disk, and then has its name: an entry that was confirmed survives a
//! kill at any moment, and one that was not leaves nothing. `queue.json` has the order of flight. A
//! gallery belongs to one server at a time. Links in it are not followed.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::address::secret;
use super::kept::Kept;
use super::said::{Key, Told};
use super::time::days_ago;
use super::wish::Subject;
use super::{Error, Output, Result, Value, json, message};
use noctograph_core::files::{Limit, entries_in, folder_in};

const ENTRY: &str = "entry.json";
const WISH: &str = "wish.json";
const ORDER: &str = "queue.json";
const TABLE: Limit = Limit { bytes: 1 << 20, what: "an entry", hint: "move it out of the gallery" };

/// Most entries that wait: a visitor's, and all.
pub(super) const MOST_OF_VISITOR: usize = 3;
const MOST: usize = 500;
/// Photos that the wall shows.
const SHOWN: usize = 24;
/// Longest wait for news.
const NEWS: Duration = Duration::from_secs(20);
/// Time between two flights, s: batteries, and the way back.
const BETWEEN_S: f64 = 60.0;

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum State {
    Waiting,
    Approved,
    Flying,
    Flown,
    Rejected,
}

/// What the operator does with an entry.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Act {
    Approve,
    Reject,
    /// Undoes either.
    Wait,
    /// It flies now; the one before is flown.
    Fly,
    Flown,
    /// Takes it down from the wall.
    Hide,
    Show,
}

/// An entry as its file has it.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    /// Secret name of its own page.
    pub(super) id: String,
    /// Name on the wall, which leads to nothing else.
    key: String,
    pub(super) number: u32,
    /// The word; `None` for a drawing.
    title: Option<String>,
    /// When it was sent (RFC 3339).
    made: String,
    state: State,
    #[serde(default)]
    hidden: bool,
    visitor: String,
    /// The large photo that it was made of.
    photo: String,
    language: String,
    /// What was found: `flight_s`, read, legible, reason, letters, stops, obstacles.
    found: Value,
}

#[derive(Debug)]
struct Stored {
    entry: Entry,
    folder: PathBuf,
}

#[derive(Debug, Default)]
struct List {
    /// In the order of flight.
    entries: Vec<Stored>,
    paused: bool,
    revision: u64,
}

/// Order of flight and whether entries are taken, as the file has it.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Order {
    paused: bool,
    numbers: Vec<u32>,
}

#[derive(Debug)]
pub(super) struct Entries {
    folder: PathBuf,
    /// Shows other servers that the gallery is in use.
    _lock: Option<File>,
    /// Whether the wall shows what nobody approved.
    is_open: bool,
    list: Mutex<List>,
    changed: Condvar,
}

impl Entries {
    /// Opens a gallery with the entries in it.
    pub(super) fn open(folder: &Path, is_open: bool) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
        let lock = lock(folder)?;
        let mut entries = Vec::new();
        for path in entries_in(folder)? {
            match read(&path) {
                Ok(Some(entry)) => entries.push(Stored { entry, folder: path }),
                Ok(None) => {}
                Err(error) => message("warning: ", &format!("left alone: {error}")),
            }
        }
        let order = regular(folder.join(ORDER)).and_then(|path| TABLE.read_text(&path).ok());
        let order = order.and_then(|text| serde_json::from_str(&text).ok());
        let Order { paused, numbers } = order.unwrap_or_default();
        let place = |stored: &Stored| {
            let place = numbers.iter().position(|number| *number == stored.entry.number);
            (place.unwrap_or(usize::MAX), stored.entry.number)
        };
        entries.sort_by_key(place);
        let list = List { entries, paused, revision: 1 };
        let (list, changed) = (Mutex::new(list), Condvar::new());
        Ok(Self { folder: folder.to_owned(), _lock: lock, is_open, list, changed })
    }

    /// Keeps a photo that a visitor sends. Returns the entry's name and number, and whether it is
    /// new: the same photo is kept once.
    pub(super) fn add(
        &self,
        photo: &Kept,
        visitor: &str,
        language: &str,
    ) -> Told<(String, u32, bool)> {
        let mut list = self.list();
        let same = |it: &&Stored| it.entry.photo == photo.id && it.entry.visitor == visitor;
        if let Some(Stored { entry, .. }) = list.entries.iter().find(same) {
            return Ok((entry.id.clone(), entry.number, false));
        }
        if list.paused {
            return Err(Key::Paused);
        }
        let waiting = list.entries.iter().filter(|it| it.entry.state == State::Waiting);
        if waiting.clone().filter(|it| it.entry.visitor == visitor).count() >= MOST_OF_VISITOR {
            return Err(Key::EntriesMany);
        }
        if waiting.count() >= MOST {
            return Err(Key::QueueFull);
        }
        let number = list.entries.iter().map(|it| it.entry.number).max().map_or(1, |n| n + 1);
        let stored = self.keep(photo, visitor, language, number).map_err(|error| {
            message("warning: ", &error.to_string());
            Key::DiskFull
        })?;
        let (id, number) = (stored.entry.id.clone(), stored.entry.number);
        list.entries.push(stored);
        self.tell(&mut list);
        Ok((id, number, true))
    }

    /// Writes an entry's folder: whole, on the disk, and then under its name.
    fn keep(&self, photo: &Kept, visitor: &str, language: &str, number: u32) -> Result<Stored> {
        let said = photo.said();
        let found = ["flight_s", "read", "legible", "reason", "letters", "stops", "obstacles"];
        let mut entry = Entry {
            id: secret()?,
            key: secret()?,
            number,
            title: photo.subject.title().map(str::to_owned),
            made: days_ago(0.0),
            state: State::Waiting,
            hidden: false,
            visitor: visitor.to_owned(),
            photo: photo.id.clone(),
            language: language.to_owned(),
            found: found.into_iter().map(|name| (name, said[name].clone())).collect(),
        };
        let failed = |source| Error::write(&self.folder, source);
        let (staging, lock) = folder_in(&self.folder).map_err(failed)?;
        for name in super::KEPT {
            copy(&photo.file(name), &staging.path().join(name)).map_err(failed)?;
        }
        let wish = serde_json::to_vec(&photo.subject).expect("a wish is plain data");
        write(&staging.path().join(WISH), &wish)?;
        loop {
            write(&staging.path().join(ENTRY), &pretty(&entry))?;
            synced(staging.path()).map_err(failed)?;
            let folder = self.folder.join(entry.folder_name());
            match std::fs::rename(staging.path(), &folder) {
                Ok(()) => {
                    synced(&self.folder).map_err(failed)?;
                    // It has its name: nothing is left to remove.
                    let _ = staging.keep();
                    drop(lock);
                    return Ok(Stored { entry, folder });
                }
                // Something that was put there by hand has the name.
                Err(_) if folder.symlink_metadata().is_ok() => entry.number += 1,
                Err(source) => return Err(Error::write(&folder, source)),
            }
        }
    }

    /// Does what the operator says; `was` is the state that the operator saw.
    pub(super) fn act(&self, id: &str, act: Act, was: Option<State>) -> Told<Value> {
        let mut list = self.list();
        let at = list.entries.iter().position(|it| it.entry.id == id).ok_or(Key::Gone)?;
        if was.is_some_and(|was| was != list.entries[at].entry.state) {
            return Err(Key::Conflict);
        }
        if act == Act::Fly {
            let flies = |it: &&mut Stored| it.entry.state == State::Flying && it.entry.id != id;
            for stored in list.entries.iter_mut().filter(flies) {
                stored.change(|entry| entry.state = State::Flown)?;
            }
        }
        list.entries[at].change(|entry| match act {
            Act::Approve => entry.state = State::Approved,
            Act::Reject => entry.state = State::Rejected,
            Act::Wait => entry.state = State::Waiting,
            Act::Fly => entry.state = State::Flying,
            Act::Flown => entry.state = State::Flown,
            Act::Hide => entry.hidden = true,
            Act::Show => entry.hidden = false,
        })?;
        self.tell(&mut list);
        let entry = list.entries[at].entry.for_operator();
        Ok(json!({ "revision": list.revision, "entry": entry }))
    }

    /// Takes back what a visitor sent, as long as it waits.
    pub(super) fn withdraw(&self, id: &str, visitor: &str) -> Told<()> {
        let mut list = self.list();
        let is_own = |it: &Stored| it.entry.id == id && it.entry.visitor == visitor;
        let at = list.entries.iter().position(is_own).ok_or(Key::Gone)?;
        if list.entries[at].entry.state != State::Waiting {
            return Err(Key::Conflict);
        }
        remove(&list.entries.remove(at).folder);
        self.tell(&mut list);
        Ok(())
    }

    /// Puts entries first, in an order.
    pub(super) fn reorder(&self, ids: &[String]) -> Told<u64> {
        let mut list = self.list();
        let place = |it: &Stored| ids.iter().position(|id| *id == it.entry.id);
        list.entries.sort_by_key(|it| place(it).unwrap_or(usize::MAX));
        self.keep_order(&mut list)
    }

    /// Takes no more entries, or takes them again.
    pub(super) fn pause(&self, paused: bool) -> Told<u64> {
        let mut list = self.list();
        list.paused = paused;
        self.keep_order(&mut list)
    }

    fn keep_order(&self, list: &mut List) -> Told<u64> {
        let numbers = list.entries.iter().map(|it| it.entry.number).collect();
        let order = pretty(&Order { paused: list.paused, numbers });
        write(&self.folder.join(ORDER), &order).map_err(|_cause| Key::DiskFull)?;
        self.tell(list);
        Ok(list.revision)
    }

    /// Removes entries that are older than some days.
    pub(super) fn sweep(&self, days: f64) {
        let mut list = self.list();
        let limit = days_ago(days);
        let old: Vec<Stored> = list.entries.extract_if(.., |it| it.entry.made < limit).collect();
        if !old.is_empty() {
            old.iter().for_each(|it| remove(&it.folder));
            self.tell(&mut list);
        }
    }

    /// Waits until there is something new since a revision, or for a while.
    pub(super) fn news(&self, seen: u64) -> u64 {
        let list = self.list();
        let is_old = |list: &mut List| list.revision == seen;
        let waited = self.changed.wait_timeout_while(list, NEWS, is_old);
        waited.unwrap_or_else(PoisonError::into_inner).0.revision
    }

    /// Whether the wall shows what nobody approved.
    pub(super) fn is_open(&self) -> bool {
        self.is_open
    }

    pub(super) fn is_paused(&self) -> bool {
        self.list().paused
    }

    /// The whole queue, for the operator.
    pub(super) fn queue(&self) -> Value {
        let list = self.list();
        let flying = list.entries.iter().find(|it| it.entry.state == State::Flying);
        let entries: Vec<Value> = list.entries.iter().map(|it| it.entry.for_operator()).collect();
        json!({
            "revision": list.revision, "paused": list.paused, "entries": entries,
            "flying": flying.map(|it| &it.entry.id),
        })
    }

    /// An entry as its visitor sees it.
    pub(super) fn own(&self, id: &str) -> Option<Value> {
        let list = self.list();
        let at = list.entries.iter().position(|it| it.entry.id == id)?;
        let Entry { number, title, made, state, language, found, .. } = &list.entries[at].entry;
        let flies = |it: &&Stored| !matches!(it.entry.state, State::Flown | State::Rejected);
        let ahead = list.entries[..at].iter().filter(flies);
        let flight_s = |it: &Stored| it.entry.found["flight_s"].as_f64().unwrap_or(0.0);
        let ahead_s = ahead.clone().fold(0.0, |sum, it| sum + flight_s(it) + BETWEEN_S);
        Some(json!({
            "id": id, "number": number, "title": title, "made": made.get(..10), "state": state,
            "language": language, "flight_s": found["flight_s"], "read": found["read"],
            "legible": found["legible"], "ahead": ahead.count(), "ahead_s": ahead_s,
        }))
    }

    pub(super) fn file(&self, id: &str, name: &str) -> Option<PathBuf> {
        self.file_of(|entry| entry.id == id, name)
    }

    /// What the wall shows, the newest first: of each visitor a word once.
    pub(super) fn wall(&self) -> Value {
        let list = self.list();
        let mut shown: Vec<&Entry> = Vec::new();
        let entries = list.entries.iter().map(|it| &it.entry).filter(|it| self.is_shown(it));
        let mut entries: Vec<&Entry> = entries.collect();
        entries.sort_by_key(|entry| std::cmp::Reverse(entry.number));
        for entry in entries {
            let is_same = |it: &&Entry| {
                it.title.is_some() && it.title == entry.title && it.visitor == entry.visitor
            };
            if shown.len() < SHOWN && !shown.iter().any(is_same) {
                shown.push(entry);
            }
        }
        let photo = |entry: &&Entry| {
            json!({
                "key": entry.key, "title": entry.title, "flight_s": entry.found["flight_s"],
                "flying": entry.state == State::Flying,
            })
        };
        let photos: Vec<Value> = shown.iter().map(photo).collect();
        json!({ "revision": list.revision, "photos": photos })
    }

    /// A file of a photo on the wall.
    pub(super) fn shown(&self, key: &str, name: &str) -> Option<PathBuf> {
        self.file_of(|entry| entry.key == key && self.is_shown(entry), name)
    }

    fn is_shown(&self, entry: &Entry) -> bool {
        let is_approved = match entry.state {
            State::Approved | State::Flying | State::Flown => true,
            State::Waiting => self.is_open,
            State::Rejected => false,
        };
        is_approved && !entry.hidden
    }

    /// The approved entries in the order of flight: number, title, and what was asked for.
    pub(super) fn approved(&self) -> Vec<(u32, Option<String>, Option<Subject>)> {
        let list = self.list();
        let approved = list.entries.iter().filter(|it| it.entry.state == State::Approved);
        let subject = |it: &Stored| {
            serde_json::from_str(&TABLE.read_text(&regular(it.folder.join(WISH))?).ok()?).ok()
        };
        approved.map(|it| (it.entry.number, it.entry.title.clone(), subject(it))).collect()
    }

    fn file_of(&self, is_it: impl Fn(&Entry) -> bool, name: &str) -> Option<PathBuf> {
        let list = self.list();
        regular(list.entries.iter().find(|it| is_it(&it.entry))?.folder.join(name))
    }

    fn tell(&self, list: &mut List) {
        list.revision += 1;
        self.changed.notify_all();
    }

    fn list(&self) -> MutexGuard<'_, List> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stored {
    /// Changes an entry, on the disk first.
    fn change(&mut self, change: impl FnOnce(&mut Entry)) -> Told<()> {
        let mut entry = self.entry.clone();
        change(&mut entry);
        write(&self.folder.join(ENTRY), &pretty(&entry)).map_err(|_cause| Key::DiskFull)?;
        self.entry = entry;
        Ok(())
    }
}

impl Entry {
    fn for_operator(&self) -> Value {
        let mut json = json!({
            "id": self.id, "number": self.number, "title": self.title, "made": self.made,
            "state": self.state, "hidden": self.hidden,
            // Enough to tell visitors apart.
            "visitor": self.visitor.get(..4),
        });
        let own = json.as_object_mut().expect("it is an object");
        for (name, value) in self.found.as_object().into_iter().flatten() {
            own.entry(name).or_insert_with(|| value.clone());
        }
        json
    }

    /// The name of its folder: `0012-NOOR`.
    fn folder_name(&self) -> String {
        let title = self.title.as_deref().unwrap_or("drawing");
        let title: String = title.chars().filter(char::is_ascii_alphanumeric).collect();
        format!("{:04}-{title}", self.number)
    }
}

/// Reads an entry; `None` for what is none.
fn read(folder: &Path) -> Result<Option<Entry>> {
    let is_folder = folder.symlink_metadata().is_ok_and(|found| found.is_dir());
    let Some(path) = regular(folder.join(ENTRY)).filter(|_| is_folder) else { return Ok(None) };
    let refused = |error: serde_json::Error| {
        Error::input(path.display(), error, "an entry of this program", TABLE.hint)
    };
    serde_json::from_str(&TABLE.read_text(&path)?).map(Some).map_err(refused)
}

/// A path that is a file itself, not a link to one.
fn regular(path: PathBuf) -> Option<PathBuf> {
    path.symlink_metadata().is_ok_and(|found| found.is_file()).then_some(path)
}

fn pretty(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec_pretty(value).expect("it is plain data")
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Output::create(path)?.keep_on_disk(|out| out.write_all(bytes)).map(drop)
}

#[expect(clippy::disallowed_methods, reason = "a file that this program wrote")]
fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    let mut to = File::create_new(to)?;
    std::io::copy(&mut File::open(from)?, &mut to)?;
    to.sync_all()
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
            let found = "in use by another server";
            Err(Error::input(folder.display(), found, "a gallery of one's own", hint))
        }
        Err(std::fs::TryLockError::Error(_)) => Ok(None),
    }
}

/// Removes an entry's folder: first what makes it one.
fn remove(folder: &Path) {
    let _ = std::fs::remove_file(folder.join(ENTRY));
    let _ = std::fs::remove_dir_all(folder);
}
