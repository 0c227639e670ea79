//! Entries that visitors have sent to be flown, for the queue, the wall and each entry's page.

use std::collections::{HashMap, HashSet};
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use tokio::sync::watch;
use tokio::time::timeout;

use super::gallery::{
    self, Entry, Figures, FlownPhoto, ForOperator, Gallery, Order, Photo, State, regular_file,
};
pub(crate) use flown::FlightNote;
use flown::Light;
use noctograph_core::error::Result;
use noctograph_photo_service::messages::{Key, KeyResult};
use noctograph_photo_service::request::Subject;

mod flown;

/// Maximum number of waiting entries.
const MAX_WAITING: usize = 1000;
/// Maximum number of waiting entries from one IP address.
const MAX_WAITING_OF_SENDER: usize = 500;
/// Number of entries that an IP address may send at once.
const BURST: f64 = 6.0;
/// Time after which an IP address may send one more entry, in s.
const REFILL_S: f64 = 5.0;
/// Maximum number of photos on the wall.
const MAX_ON_WALL: usize = 500;
/// Longest time for which a request waits for a change.
const NEWS_TIMEOUT: Duration = Duration::from_secs(20);
/// Time between two flights for changing the battery and carrying the drone back, in s.
const BETWEEN_S: f64 = 60.0;

/// Title of every drawing in scripts and logs.
const DRAWING: &str = "drawing";

/// Action of the operator on an entry.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Act {
    Approve,
    Reject,
    /// Undoes [`Self::Approve`] and [`Self::Reject`].
    Wait,
    /// Marks the entry as in the air, and any other entry in the air as flown.
    Fly,
    Flown,
    /// Removes the entry from the wall.
    Hide,
    Show,
}

/// An entry as its visitor receives it.
#[derive(Debug, Serialize)]
pub(crate) struct ForVisitor {
    id: String,
    number: u32,
    title: Option<String>,
    /// Date on which the entry was made.
    made: String,
    state: State,
    language: String,
    flight_s: f64,
    read: Option<String>,
    legible: Option<bool>,
    readability: Option<f64>,
    /// Photo of the entry's flight, if its log was followed.
    flown: Option<FlownPhoto>,
    /// Number of entries that fly before this one, and the time that they take in s.
    ahead: usize,
    ahead_s: f64,
    /// Time since take-off in s, or `None` if it is unknown or the entry is not in the air.
    flown_s: Option<f64>,
}

/// Photos on the wall.
#[derive(Debug, Serialize)]
pub(crate) struct Wall {
    revision: u64,
    photos: Vec<WallPhoto>,
}

#[derive(Debug, Serialize)]
struct WallPhoto {
    key: String,
    title: Option<String>,
    flight_s: f64,
    /// True if the entry is in the air.
    flying: bool,
    readability: Option<f64>,
    /// Photo of the entry's flight, if its log was followed.
    flown: Option<FlownPhoto>,
    /// True if the wall shows the light of the flight so far.
    live: bool,
}

/// The complete queue, for the operator.
#[derive(Debug, Serialize)]
struct Queue<'a> {
    revision: u64,
    paused: bool,
    /// In the order of flight.
    entries: Vec<ForOperator<'a>>,
    /// Name of the entry in the air.
    flying: Option<&'a str>,
    /// Notes about the logs of flights.
    notes: &'a Vec<FlightNote>,
}

#[derive(Debug, Serialize)]
struct Acted<'a> {
    revision: u64,
    entry: ForOperator<'a>,
}

/// An entry with its place on the disk.
#[derive(Debug)]
struct Stored {
    entry: Entry,
    folder: PathBuf,
    /// IP address of the sender, or `None` after a restart of the server.
    sender: Option<IpAddr>,
}

/// The entries and the state of the queue.
#[derive(Debug, Default)]
struct List {
    /// In the order of flight.
    entries: Vec<Stored>,
    paused: bool,
    /// Take-off time of the entry in the air.
    took_off: Option<Instant>,
    senders: Senders,
    /// Light of the flight that is being followed.
    light: Option<Light>,
    notes: Vec<FlightNote>,
}

#[derive(Debug)]
pub(crate) struct Entries {
    gallery: Gallery,
    /// True if the wall shows entries that nobody has approved.
    is_open: bool,
    warn: fn(&str),
    list: Mutex<List>,
    /// Revision of the list, which increases with every change.
    revision: watch::Sender<u64>,
}

/// Token buckets of recent senders.
#[derive(Debug, Default)]
struct Senders(HashMap<IpAddr, Bucket>);

/// Token bucket of a sender.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    /// Number of entries that the address could still send at the time `since`.
    tokens: f64,
    since: Instant,
}

impl Senders {
    /// Returns true if an address may send one more entry, by a token bucket of [`BURST`] entries.
    /// If so, the entry is counted. Forgets addresses that may send as many entries as a new
    /// address.
    fn admit(&mut self, address: IpAddr, now: Instant) -> bool {
        self.0.retain(|_, bucket| bucket.refilled(now) < BURST);
        let tokens = self.0.get(&address).map_or(BURST, |bucket| bucket.refilled(now));
        if tokens >= 1.0 {
            self.0.insert(address, Bucket { tokens: tokens - 1.0, since: now });
        }
        tokens >= 1.0
    }
}

impl Bucket {
    /// Returns the number of tokens in the bucket at the time `now`.
    fn refilled(self, now: Instant) -> f64 {
        let waited_s = now.saturating_duration_since(self.since).as_secs_f64();
        f64::min(BURST, self.tokens + waited_s / REFILL_S)
    }
}

/// An entry for which scripts are made.
#[derive(Debug)]
pub(crate) struct ToFly {
    pub(crate) number: u32,
    pub(crate) title: String,
    /// Word or drawing with its settings, or `None` if it cannot be read.
    pub(crate) subject: Option<Subject>,
}

/// Receipt for the visitor who sent a photo.
#[derive(Debug)]
pub(crate) struct Receipt {
    pub(crate) id: String,
    pub(crate) number: u32,
    /// False if the photo already had an entry.
    pub(crate) is_new: bool,
}

impl Entries {
    /// Opens a gallery, and reads its entries in the order of flight, new ones last. With
    /// `is_open`, the wall shows entries before they are approved. `warn` prints unreadable
    /// entries.
    pub(crate) fn open(folder: &std::path::Path, is_open: bool, warn: fn(&str)) -> Result<Self> {
        let gallery = Gallery::open(folder)?;
        let Order { paused, numbers } = gallery.read_order();
        let entries = gallery.read(warn)?.into_iter();
        let mut entries: Vec<Stored> =
            entries.map(|(entry, folder)| Stored { entry, folder, sender: None }).collect();
        entries.sort_by_key(|Stored { entry, .. }| {
            let rank = numbers.iter().position(|number| *number == entry.number);
            (rank.unwrap_or(usize::MAX), entry.number)
        });
        let list = Mutex::new(List { entries, paused, ..List::default() });
        Ok(Self { gallery, is_open, warn, list, revision: watch::Sender::new(1) })
    }

    /// Checks, before a photo is made, that an address may send it, and counts the request for the
    /// rate limit. Returns the receipt if the photo, named by its id, already has an entry, which
    /// is always accepted and not counted.
    pub(crate) fn admit(&self, photo: &str, sender: IpAddr) -> KeyResult<Option<Receipt>> {
        let mut list = self.list();
        if let Some(receipt) = list.receipt(photo) {
            return Ok(Some(receipt));
        }
        if list.paused {
            return Err(Key::Paused);
        }
        // The limits of the queue are checked before the rate limit, so that a full queue uses up
        // no tokens.
        let waiting = list.entries.iter().filter(|stored| stored.entry.state == State::Waiting);
        let n_of_sender = waiting.clone().filter(|stored| stored.sender == Some(sender)).count();
        if waiting.count() >= MAX_WAITING || n_of_sender >= MAX_WAITING_OF_SENDER {
            return Err(Key::QueueFull);
        }
        if !list.senders.admit(sender, Instant::now()) {
            return Err(Key::EntriesMany);
        }
        Ok(None)
    }

    /// Adds an entry for an admitted photo, unless one exists. Returns the receipt.
    pub(crate) fn add(&self, photo: &Photo, language: &str, sender: IpAddr) -> KeyResult<Receipt> {
        let mut list = self.list();
        if let Some(receipt) = list.receipt(&photo.id) {
            return Ok(receipt);
        }
        // The list stays locked while the entry is written, so that its number is unique.
        let number = list.entries.iter().map(|s| s.entry.number).max().map_or(1, |n| n + 1);
        let added = Entry::new(photo, language, number).and_then(|mut entry| {
            let folder = self.gallery.add(&mut entry, photo)?;
            Ok(Stored { entry, folder, sender: Some(sender) })
        });
        let stored = added.map_err(|error| {
            (self.warn)(&error.to_string());
            Key::DiskFull
        })?;
        let (id, number) = (stored.entry.id.clone(), stored.entry.number);
        list.entries.push(stored);
        self.announce_change();
        Ok(Receipt { id, number, is_new: true })
    }

    /// Performs an action of the operator, whose page showed the state `seen`. Refuses the action
    /// if the state has changed since. [`Act::Fly`] also marks any other entry in the air as flown,
    /// and stores the take-off time. Returns the JSON of [`Acted`].
    pub(crate) fn act(&self, id: &str, act: Act, seen: Option<State>) -> KeyResult<String> {
        let mut list = self.list();
        let index = list.index(id)?;
        if seen.is_some_and(|seen| seen != list.entries[index].entry.state) {
            return Err(Key::Conflict);
        }
        // Only one entry flies at a time, so any other entry in the air has flown.
        if act == Act::Fly {
            let flying = list.entries.iter_mut().filter(|s| s.entry.state == State::Flying);
            for stored in flying.filter(|stored| stored.entry.id != id) {
                stored.change(|entry| entry.state = State::Flown)?;
                self.announce_change();
            }
            list.took_off = Some(Instant::now());
        }
        list.entries[index].change(|entry| match act {
            Act::Approve => entry.state = State::Approved,
            Act::Reject => entry.state = State::Rejected,
            Act::Wait => entry.state = State::Waiting,
            Act::Fly => entry.state = State::Flying,
            Act::Flown => entry.state = State::Flown,
            Act::Hide => entry.hidden = true,
            Act::Show => entry.hidden = false,
        })?;
        let revision = self.announce_change();
        let acted = Acted { revision, entry: list.entries[index].entry.for_operator() };
        Ok(serde_json::to_string(&acted).expect("an entry is plain data"))
    }

    /// Removes a visitor's own entry if it is still waiting for approval. `visitor` is the secret
    /// name that only its browser knows.
    pub(crate) fn withdraw(&self, id: &str, visitor: &str) -> KeyResult<()> {
        let mut list = self.list();
        let index = list.index(id)?;
        // Knowing the id does not prove ownership, because others may have seen it on a screen.
        let entry = &list.entries[index].entry;
        if entry.visitor != visitor {
            return Err(Key::Closed);
        }
        if entry.state != State::Waiting {
            return Err(Key::Conflict);
        }
        // The folder is removed first. If this fails, the entry stays in the operator's list.
        gallery::remove(&list.entries[index].folder).map_err(|_cause| Key::NotRemoved)?;
        list.entries.remove(index);
        self.announce_change();
        Ok(())
    }

    /// Moves the entries `ids`, in this order, to the front of the queue, first on the disk and
    /// then in memory. Returns the new revision.
    pub(crate) fn reorder(&self, ids: &[String]) -> KeyResult<u64> {
        let mut list = self.list();
        // The sort is stable, so that the other entries keep their order.
        let mut entries: Vec<&Stored> = list.entries.iter().collect();
        entries.sort_by_key(|stored| stored.rank(ids));
        self.write_order(list.paused, entries)?;
        list.entries.sort_by_key(|stored| stored.rank(ids));
        Ok(self.announce_change())
    }

    /// Stops accepting entries if `paused`, or accepts them again. Returns the new revision.
    pub(crate) fn pause(&self, paused: bool) -> KeyResult<u64> {
        let mut list = self.list();
        self.write_order(paused, &list.entries)?;
        list.paused = paused;
        Ok(self.announce_change())
    }

    /// Writes the order of flight and the pause to the gallery, before callers change them in
    /// memory.
    fn write_order<'a>(
        &self,
        paused: bool,
        entries: impl IntoIterator<Item = &'a Stored>,
    ) -> KeyResult<()> {
        let numbers = entries.into_iter().map(|stored| stored.entry.number).collect();
        self.gallery.write_order(&Order { paused, numbers }).map_err(|_cause| Key::DiskFull)
    }

    /// Waits for a change since the revision `seen`, for at most [`NEWS_TIMEOUT`]. Returns the
    /// current revision.
    pub(crate) async fn news(&self, seen: u64) -> u64 {
        let mut changes = self.revision.subscribe();
        let _ = timeout(NEWS_TIMEOUT, changes.wait_for(|revision| *revision != seen)).await;
        *changes.borrow()
    }

    /// Returns true if the wall shows entries before they are approved.
    pub(crate) fn is_open(&self) -> bool {
        self.is_open
    }

    /// Returns true if no entries are accepted at the moment.
    pub(crate) fn is_paused(&self) -> bool {
        self.list().paused
    }

    /// Returns the JSON of [`Queue`], which the operator's page shows.
    pub(crate) fn queue(&self) -> String {
        let list = self.list();
        let queue = Queue {
            revision: *self.revision.borrow(),
            paused: list.paused,
            entries: list.entries.iter().map(|stored| stored.entry.for_operator()).collect(),
            flying: list.first(|entry| entry.state == State::Flying).map(|s| &*s.entry.id),
            notes: &list.notes,
        };
        serde_json::to_string(&queue).expect("entries are plain data")
    }

    /// Returns an entry as its visitor receives it, with its place in the queue.
    pub(crate) fn for_visitor(&self, id: &str) -> KeyResult<ForVisitor> {
        let list = self.list();
        let index = list.index(id)?;
        let (ahead, ahead_s) = list.ahead(index);
        let Entry { id, number, title, made, state, language, figures, flown, .. } =
            list.entries[index].entry.clone();
        let Figures { flight_s, read, legible, readability, .. } = figures;
        // The first ten characters of an RFC 3339 time are its date.
        const DATE: std::ops::RangeTo<usize> = ..10;
        let made = made.get(DATE).unwrap_or_default().to_owned();
        Ok(ForVisitor {
            id,
            number,
            title,
            made,
            state,
            language,
            flight_s,
            read,
            legible,
            readability,
            flown,
            ahead,
            ahead_s,
            flown_s: list.flown_s(&list.entries[index].entry),
        })
    }

    /// Returns the path of an entry's file, or `None` if it does not exist.
    pub(crate) fn file(&self, id: &str, name: &str) -> Option<PathBuf> {
        regular_file(self.list().first(|entry| entry.id == id)?.folder.join(name))
    }

    /// Returns the photos on the wall, newest first, at most [`MAX_ON_WALL`]. If a visitor sent a
    /// word several times, only the newest photo appears.
    pub(crate) fn wall(&self) -> Wall {
        let list = self.list();
        let entries = list.entries.iter().map(|stored| &stored.entry);
        let mut entries: Vec<&Entry> = entries.filter(|entry| self.is_shown(entry)).collect();
        entries.sort_by_key(|entry| std::cmp::Reverse(entry.number));
        // All drawings are shown, because they have no titles to compare.
        let mut words = HashSet::new();
        entries.retain(|Entry { title, visitor, .. }| {
            title.as_ref().is_none_or(|title| words.insert((title, visitor)))
        });
        let photos = entries.into_iter().take(MAX_ON_WALL).map(|entry| WallPhoto {
            key: entry.key.clone(),
            title: entry.title.clone(),
            flight_s: entry.figures.flight_s,
            flying: entry.state == State::Flying,
            readability: entry.figures.readability,
            flown: entry.flown.clone(),
            live: list.light.as_ref().is_some_and(|light| light.is_live && light.id == entry.id),
        });
        Wall { revision: *self.revision.borrow(), photos: photos.collect() }
    }

    /// Returns the path of a photo's file, or `None` if the photo is not on the wall.
    pub(crate) fn wall_file(&self, key: &str, name: &str) -> Option<PathBuf> {
        regular_file(self.list().first(|entry| self.hangs(entry, key))?.folder.join(name))
    }

    /// Returns true if an entry is on the wall and `key` is its name there.
    fn hangs(&self, entry: &Entry, key: &str) -> bool {
        entry.key == key && self.is_shown(entry)
    }

    /// Returns true if an entry is on the wall: approved, or waiting on an open wall, and not
    /// hidden.
    fn is_shown(&self, entry: &Entry) -> bool {
        let is_approved = match entry.state {
            State::Approved | State::Flying | State::Flown => true,
            State::Waiting => self.is_open,
            State::Rejected => false,
        };
        is_approved && !entry.hidden
    }

    /// Returns the entry with the name `id` or, if `id` is `None`, all entries that are approved or
    /// in the air, in the order of flight.
    pub(crate) fn to_fly(&self, id: Option<&str>) -> Vec<ToFly> {
        let list = self.list();
        let entries = list.entries.iter().filter(|Stored { entry, .. }| match id {
            Some(id) => entry.id == id,
            None => matches!(entry.state, State::Approved | State::Flying),
        });
        // Drawings have no title.
        let subjects = entries.map(|Stored { entry, folder, .. }| {
            let title = entry.title.clone().unwrap_or_else(|| DRAWING.to_owned());
            ToFly { number: entry.number, title, subject: gallery::read_subject(folder) }
        });
        subjects.collect()
    }

    /// Increases the revision, wakes requests that wait for a change, and returns the revision.
    fn announce_change(&self) -> u64 {
        self.revision.send_modify(|revision| *revision += 1);
        *self.revision.borrow()
    }

    /// Locks the list.
    fn list(&self) -> MutexGuard<'_, List> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl List {
    /// Returns the number of entries that fly before the one with this index, and the time in s
    /// until they have flown.
    fn ahead(&self, index: usize) -> (usize, f64) {
        // The list is sorted by the order of flight.
        let entries = self.entries[..index].iter().map(|stored| &stored.entry);
        let entries = entries.filter(|e| !matches!(e.state, State::Flown | State::Rejected));
        entries.fold((0, 0.0), |(ahead, ahead_s), entry| {
            let left_s = entry.figures.flight_s - self.flown_s(entry).unwrap_or(0.0);
            (ahead + 1, ahead_s + left_s.max(0.0) + BETWEEN_S)
        })
    }

    /// Returns the time since the take-off of an entry in s, or `None` if it is not in the air or
    /// took off before the server was started.
    fn flown_s(&self, entry: &Entry) -> Option<f64> {
        (entry.state == State::Flying).then_some(self.took_off?.elapsed().as_secs_f64())
    }

    /// Returns the receipt for the entry of a photo, or `None` if there is no such entry.
    fn receipt(&self, photo: &str) -> Option<Receipt> {
        let Stored { entry, .. } = self.first(|entry| entry.photo == photo)?;
        Some(Receipt { id: entry.id.clone(), number: entry.number, is_new: false })
    }

    /// Returns the first entry in the order of flight for which `is_wanted` is true.
    fn first(&self, is_wanted: impl Fn(&Entry) -> bool) -> Option<&Stored> {
        self.entries.iter().find(|stored| is_wanted(&stored.entry))
    }

    /// Returns the index of an entry in the order of flight.
    fn index(&self, id: &str) -> KeyResult<usize> {
        self.entries.iter().position(|stored| stored.entry.id == id).ok_or(Key::Closed)
    }
}

impl Stored {
    /// Returns the entry's index in a list of names, or the largest number if it is not listed.
    fn rank(&self, ids: &[String]) -> usize {
        ids.iter().position(|id| *id == self.entry.id).unwrap_or(usize::MAX)
    }

    /// Changes the entry first on the disk and then in memory. Returns [`Key::DiskFull`] if it
    /// cannot be written.
    fn change(&mut self, change: impl FnOnce(&mut Entry)) -> KeyResult<()> {
        let mut entry = self.entry.clone();
        change(&mut entry);
        gallery::write_entry(&self.folder, &entry).map_err(|_cause| Key::DiskFull)?;
        self.entry = entry;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_sends_some_at_once_and_then_one_at_a_time() {
        let (mut senders, begun) = (Senders::default(), Instant::now());
        let [here, there] = [1, 2].map(|last| IpAddr::from([10, 0, 0, last]));
        let mut admitted = |address, after_s: f64, n: usize| {
            let now = begun + Duration::from_secs_f64(after_s);
            (0..n).filter(|_| senders.admit(address, now)).count()
        };
        assert_eq!(admitted(here, 0.0, 99), 6);
        assert_eq!(admitted(there, 0.0, 3), 3, "others are not held up");
        assert_eq!([admitted(here, 4.9, 9), admitted(here, 5.0, 9)], [0, 1]);
        assert_eq!(admitted(here, 20.0, 9), 3);
        assert_eq!(admitted(here, 1e4, 99), 6);
        assert_eq!(senders.0.len(), 1, "who has sent nothing of late is forgotten");
    }
}
