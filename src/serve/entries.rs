//! Entries that visitors sent to be flown: the queue, the wall and the page of each entry.

use std::collections::{HashMap, HashSet};
use std::net::IpAddr;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use tokio::sync::watch;
use tokio::time::timeout;

use super::gallery::{self, Entry, Figures, ForOperator, Gallery, Order, Photo, State, regular};
use noctograph_core::error::Result;
use noctograph_photo_service::messages::{Key, KeyResult};
use noctograph_photo_service::request::Subject;

/// Most entries that wait, in all and from one address.
const MOST: usize = 1000;
const MOST_OF_ADDRESS: usize = 500;
/// Entries that an address may send at once, and the time after which it may send one more.
const BURST: f64 = 6.0;
const REFILL_S: f64 = 5.0;
/// Most photos on the wall.
const SHOWN: usize = 500;
/// Longest wait for news.
const NEWS_TIMEOUT: Duration = Duration::from_secs(20);
/// Time between two flights, for changing batteries and carrying the drone back.
const BETWEEN_S: f64 = 60.0;

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Act {
    Approve,
    Reject,
    /// Undoes both.
    Wait,
    /// It flies now, and the one before has flown.
    Fly,
    Flown,
    /// Takes it down from the wall.
    Hide,
    Show,
}

/// An entry for its visitor.
#[derive(Debug, Serialize)]
pub(crate) struct ForVisitor {
    id: String,
    number: u32,
    title: Option<String>,
    /// The day.
    made: String,
    state: State,
    language: String,
    flight_s: f64,
    read: Option<String>,
    legible: Option<bool>,
    /// Entries that fly before it, and the time that they take.
    ahead: usize,
    ahead_s: f64,
}

/// The photos on the wall.
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
    /// True if it is in the air.
    flying: bool,
}

/// The whole queue, for the operator.
#[derive(Debug, Serialize)]
struct Queue<'a> {
    revision: u64,
    paused: bool,
    /// In the order of flight.
    entries: Vec<ForOperator<'a>>,
    /// Name of the entry that is in the air.
    flying: Option<&'a str>,
}

#[derive(Debug, Serialize)]
struct Acted<'a> {
    revision: u64,
    entry: ForOperator<'a>,
}

#[derive(Debug)]
struct Stored {
    entry: Entry,
    folder: PathBuf,
    /// Its sender. `None` after a restart of the server.
    sender: Option<IpAddr>,
}

#[derive(Debug, Default)]
struct List {
    /// In the order of flight.
    entries: Vec<Stored>,
    paused: bool,
    senders: Senders,
}

#[derive(Debug)]
pub(crate) struct Entries {
    gallery: Gallery,
    /// True if the wall shows entries that nobody approved.
    is_open: bool,
    warn: fn(&str),
    list: Mutex<List>,
    /// Rises with every change.
    revision: watch::Sender<u64>,
}

/// Token buckets of recent senders: entries that an address may still send, and since when.
#[derive(Debug, Default)]
struct Senders(HashMap<IpAddr, (f64, Instant)>);

impl Senders {
    /// True if an address may send one more, which is then counted.
    fn admit(&mut self, address: IpAddr, now: Instant) -> bool {
        // Full buckets are forgotten.
        self.0.retain(|_, sender| refilled(*sender, now) < BURST);
        let left = self.0.get(&address).map_or(BURST, |sender| refilled(*sender, now));
        if left >= 1.0 {
            self.0.insert(address, (left - 1.0, now));
        }
        left >= 1.0
    }
}

/// Entries that an address may send now, of those that it had left before.
fn refilled((left, since): (f64, Instant), now: Instant) -> f64 {
    f64::min(BURST, left + now.saturating_duration_since(since).as_secs_f64() / REFILL_S)
}

impl Entries {
    /// Opens a gallery with the entries in it.
    pub(crate) fn open(folder: &std::path::Path, is_open: bool, warn: fn(&str)) -> Result<Self> {
        let gallery = Gallery::open(folder)?;
        let Order { paused, numbers } = gallery.read_order();
        let entries = gallery.read(warn)?.into_iter();
        let mut entries: Vec<Stored> =
            entries.map(|(entry, folder)| Stored { entry, folder, sender: None }).collect();
        entries.sort_by_key(|Stored { entry, .. }| {
            let place = numbers.iter().position(|number| *number == entry.number);
            (place.unwrap_or(usize::MAX), entry.number)
        });
        let list = Mutex::new(List { entries, paused, senders: Senders::default() });
        Ok(Self { gallery, is_open, warn, list, revision: watch::Sender::new(1) })
    }

    /// Admits a photo from an address, before it is made. Returns name and number of the entry that
    /// has it already, if there is one.
    pub(crate) fn admit(&self, photo: &str, sender: IpAddr) -> KeyResult<Option<(String, u32)>> {
        let mut list = self.list();
        if let Some(known) = list.with_photo(photo) {
            return Ok(Some(known));
        }
        // What was sent before the pause is confirmed again, as above.
        if list.paused {
            return Err(Key::Paused);
        }
        // Limits of the queue, and then of the rate, which counts the request.
        let waiting = list.entries.iter().filter(|stored| stored.entry.state == State::Waiting);
        let n_of_sender = waiting.clone().filter(|stored| stored.sender == Some(sender)).count();
        if waiting.count() >= MOST || n_of_sender >= MOST_OF_ADDRESS {
            return Err(Key::QueueFull);
        }
        if !list.senders.admit(sender, Instant::now()) {
            return Err(Key::EntriesMany);
        }
        Ok(None)
    }

    /// Keeps a photo that was admitted, once. Returns the entry's name and number, and `true` for a
    /// new one.
    pub(crate) fn add(
        &self,
        photo: &Photo,
        language: &str,
        sender: IpAddr,
    ) -> KeyResult<(String, u32, bool)> {
        let mut list = self.list();
        if let Some((id, number)) = list.with_photo(&photo.id) {
            return Ok((id, number, false));
        }
        // The list stays locked while the entry is written, so its number is unique.
        let number = list.entries.iter().map(|s| s.entry.number).max().map_or(1, |n| n + 1);
        let kept = Entry::new(photo, language, number).and_then(|mut entry| {
            let folder = self.gallery.keep(&mut entry, photo)?;
            Ok(Stored { entry, folder, sender: Some(sender) })
        });
        let stored = kept.map_err(|error| {
            (self.warn)(&error.to_string());
            Key::DiskFull
        })?;
        let (id, number) = (stored.entry.id.clone(), stored.entry.number);
        list.entries.push(stored);
        self.changed();
        Ok((id, number, true))
    }

    /// Does an action of the operator, who saw the state `was`. Returns the JSON of [`Acted`].
    pub(crate) fn act(&self, id: &str, act: Act, was: Option<State>) -> KeyResult<String> {
        let mut list = self.list();
        let index = list.index(id)?;
        if was.is_some_and(|was| was != list.entries[index].entry.state) {
            return Err(Key::Conflict);
        }
        // One drone team: what flew before has flown.
        if act == Act::Fly {
            let flying = list.entries.iter_mut().filter(|s| s.entry.state == State::Flying);
            for stored in flying.filter(|stored| stored.entry.id != id) {
                stored.change(|entry| entry.state = State::Flown)?;
                self.changed();
            }
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
        let revision = self.changed();
        let acted = Acted { revision, entry: list.entries[index].entry.for_operator() };
        Ok(serde_json::to_string(&acted).expect("an entry is plain data"))
    }

    /// Removes an entry for its visitor, as long as it waits.
    pub(crate) fn withdraw(&self, id: &str, visitor: &str) -> KeyResult<()> {
        let mut list = self.list();
        let index = list.index(id)?;
        // The name of an entry is not enough: others may have seen it on a screen.
        let entry = &list.entries[index].entry;
        if entry.visitor != visitor {
            return Err(Key::Closed);
        }
        if entry.state != State::Waiting {
            return Err(Key::Conflict);
        }
        gallery::remove(&list.entries[index].folder).map_err(|_cause| Key::DiskFull)?;
        list.entries.remove(index);
        self.changed();
        Ok(())
    }

    /// Puts entries first, in an order.
    pub(crate) fn reorder(&self, ids: &[String]) -> KeyResult<u64> {
        let mut list = self.list();
        // The sort is stable: other entries stay behind them in their order.
        let mut entries: Vec<&Stored> = list.entries.iter().collect();
        entries.sort_by_key(|stored| stored.rank(ids));
        self.write_order(list.paused, entries)?;
        list.entries.sort_by_key(|stored| stored.rank(ids));
        Ok(self.changed())
    }

    /// Stops taking entries, or takes them again.
    pub(crate) fn pause(&self, paused: bool) -> KeyResult<u64> {
        let mut list = self.list();
        self.write_order(paused, &list.entries)?;
        list.paused = paused;
        Ok(self.changed())
    }

    /// Writes the order before it changes in memory.
    fn write_order<'a>(
        &self,
        paused: bool,
        entries: impl IntoIterator<Item = &'a Stored>,
    ) -> KeyResult<()> {
        let numbers = entries.into_iter().map(|stored| stored.entry.number).collect();
        self.gallery.write_order(&Order { paused, numbers }).map_err(|_cause| Key::DiskFull)
    }

    /// Waits for a change since a revision, for some time at most. Returns the revision.
    pub(crate) async fn news(&self, seen: u64) -> u64 {
        let mut changes = self.revision.subscribe();
        let _ = timeout(NEWS_TIMEOUT, changes.wait_for(|revision| *revision != seen)).await;
        *changes.borrow()
    }

    pub(crate) fn is_open(&self) -> bool {
        self.is_open
    }

    pub(crate) fn is_paused(&self) -> bool {
        self.list().paused
    }

    pub(crate) fn queue(&self) -> String {
        let list = self.list();
        let queue = Queue {
            revision: *self.revision.borrow(),
            paused: list.paused,
            entries: list.entries.iter().map(|stored| stored.entry.for_operator()).collect(),
            flying: list.first(|entry| entry.state == State::Flying).map(|s| &*s.entry.id),
        };
        serde_json::to_string(&queue).expect("entries are plain data")
    }

    pub(crate) fn for_visitor(&self, id: &str) -> KeyResult<ForVisitor> {
        let list = self.list();
        let index = list.index(id)?;
        // The list is in the order of flight.
        let (mut ahead, mut ahead_s) = (0, 0.0);
        for Stored { entry, .. } in &list.entries[..index] {
            if !matches!(entry.state, State::Flown | State::Rejected) {
                (ahead, ahead_s) = (ahead + 1, ahead_s + entry.figures.flight_s + BETWEEN_S);
            }
        }
        let Entry { id, number, title, made, state, language, figures, .. } =
            list.entries[index].entry.clone();
        let Figures { flight_s, read, legible, .. } = figures;
        let made = made.get(..10).unwrap_or_default().to_owned();
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
            ahead,
            ahead_s,
        })
    }

    pub(crate) fn file(&self, id: &str, name: &str) -> Option<PathBuf> {
        regular(self.list().first(|entry| entry.id == id)?.folder.join(name))
    }

    /// The photos on the wall, the newest first. Each visitor's word appears once.
    pub(crate) fn wall(&self) -> Wall {
        let list = self.list();
        let entries = list.entries.iter().map(|stored| &stored.entry);
        let mut entries: Vec<&Entry> = entries.filter(|entry| self.is_shown(entry)).collect();
        entries.sort_by_key(|entry| std::cmp::Reverse(entry.number));
        // Drawings have no title, and each of them counts.
        let mut seen = HashSet::new();
        entries.retain(|Entry { title, visitor, .. }| {
            title.as_ref().is_none_or(|title| seen.insert((title, visitor)))
        });
        let photos = entries.into_iter().take(SHOWN).map(|entry| WallPhoto {
            key: entry.key.clone(),
            title: entry.title.clone(),
            flight_s: entry.figures.flight_s,
            flying: entry.state == State::Flying,
        });
        Wall { revision: *self.revision.borrow(), photos: photos.collect() }
    }

    /// A file of a photo on the wall.
    pub(crate) fn shown(&self, key: &str, name: &str) -> Option<PathBuf> {
        let list = self.list();
        regular(list.first(|entry| entry.key == key && self.is_shown(entry))?.folder.join(name))
    }

    fn is_shown(&self, entry: &Entry) -> bool {
        let is_approved = match entry.state {
            State::Approved | State::Flying | State::Flown => true,
            State::Waiting => self.is_open,
            State::Rejected => false,
        };
        is_approved && !entry.hidden
    }

    /// Number, title and subject of the entries that are flown, in their order: the one with a
    /// name, or all that are approved or in the air.
    pub(crate) fn to_fly(&self, id: Option<&str>) -> Vec<(u32, String, Option<Subject>)> {
        let list = self.list();
        let entries = list.entries.iter().filter(|Stored { entry, .. }| match id {
            Some(id) => entry.id == id,
            None => matches!(entry.state, State::Approved | State::Flying),
        });
        // A request that cannot be read is reported with its entry.
        let subjects = entries.map(|Stored { entry, folder, .. }| {
            let title = entry.title.clone().unwrap_or_else(|| "drawing".to_owned());
            (entry.number, title, gallery::read_subject(folder))
        });
        subjects.collect()
    }

    /// Wakes all who wait for a change. Returns the new revision.
    fn changed(&self) -> u64 {
        self.revision.send_modify(|revision| *revision += 1);
        *self.revision.borrow()
    }

    fn list(&self) -> MutexGuard<'_, List> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl List {
    /// Name and number of the entry that has a photo.
    fn with_photo(&self, photo: &str) -> Option<(String, u32)> {
        let Stored { entry, .. } = self.first(|entry| entry.photo == photo)?;
        Some((entry.id.clone(), entry.number))
    }

    fn first(&self, is_wanted: impl Fn(&Entry) -> bool) -> Option<&Stored> {
        self.entries.iter().find(|stored| is_wanted(&stored.entry))
    }

    fn index(&self, id: &str) -> KeyResult<usize> {
        self.entries.iter().position(|stored| stored.entry.id == id).ok_or(Key::Closed)
    }
}

impl Stored {
    /// Its index in a list of names, or the greatest number.
    fn rank(&self, ids: &[String]) -> usize {
        ids.iter().position(|id| *id == self.entry.id).unwrap_or(usize::MAX)
    }
    /// Changes an entry, on the disk first.
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
