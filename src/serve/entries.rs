//! What visitors sent to be flown: the queue, the wall and everybody's own photo.

use std::collections::HashMap;
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

/// Most entries that wait: all, and those of an address.
const MOST: usize = 1000;
const MOST_OF_ADDRESS: usize = 500;
/// Entries that an address may send at once, and the time after which it may send one more.
const BURST: f64 = 6.0;
const REFILL_S: f64 = 5.0;
/// Photos that the wall turns through.
const SHOWN: usize = 500;
/// Longest wait for news.
const NEWS_TIMEOUT: Duration = Duration::from_secs(20);
/// Time between two flights, s: batteries, and the way back.
const BETWEEN_S: f64 = 60.0;

/// What the operator does with an entry.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Act {
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

/// An entry as its visitor sees it.
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

/// What the wall shows.
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
    /// Whether it is in the air.
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

/// What the operator did with an entry.
#[derive(Debug, Serialize)]
struct Acted<'a> {
    revision: u64,
    entry: ForOperator<'a>,
}

#[derive(Debug)]
struct Stored {
    entry: Entry,
    folder: PathBuf,
    /// Where it came from; `None`: the server has been started since.
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
    /// Whether the wall shows what nobody approved.
    is_open: bool,
    warn: fn(&str),
    list: Mutex<List>,
    /// Rises with every change.
    revision: watch::Sender<u64>,
}

/// Who sent entries of late: what an address may still send, and since when.
#[derive(Debug, Default)]
struct Senders(HashMap<IpAddr, (f64, Instant)>);

impl Senders {
    /// Whether an address may send one more.
    fn admit(&mut self, address: IpAddr, now: Instant) -> bool {
        let refilled = |(left, since): (f64, Instant)| {
            f64::min(BURST, left + now.saturating_duration_since(since).as_secs_f64() / REFILL_S)
        };
        self.0.retain(|_, sender| refilled(*sender) < BURST);
        let left = self.0.get(&address).map_or(BURST, |sender| refilled(*sender));
        if left >= 1.0 {
            self.0.insert(address, (left - 1.0, now));
        }
        left >= 1.0
    }
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

    /// Admits a photo that is sent from an address, before it is made. Returns name and number of
    /// the entry that has it already.
    pub(crate) fn admit(&self, photo: &str, sender: IpAddr) -> KeyResult<Option<(String, u32)>> {
        let mut list = self.list();
        if let Some(known) = list.with_photo(photo) {
            return Ok(Some(known));
        }
        if list.paused {
            return Err(Key::Paused);
        }
        let waiting = list.entries.iter().filter(|it| it.entry.state == State::Waiting);
        let n_of_sender = waiting.clone().filter(|it| it.sender == Some(sender)).count();
        if waiting.count() >= MOST || n_of_sender >= MOST_OF_ADDRESS {
            return Err(Key::QueueFull);
        }
        if !list.senders.admit(sender, Instant::now()) {
            return Err(Key::EntriesMany);
        }
        Ok(None)
    }

    /// Keeps a photo that was admitted. Returns the entry's name and number, and whether it is new:
    /// a photo is kept once.
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
        let number = list.entries.iter().map(|it| it.entry.number).max().map_or(1, |n| n + 1);
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

    /// Does what the operator says; `was` is the state that the operator saw. Returns the JSON of
    /// [`Acted`].
    pub(crate) fn act(&self, id: &str, act: Act, was: Option<State>) -> KeyResult<String> {
        let mut list = self.list();
        let index = list.entries.iter().position(|it| it.entry.id == id).ok_or(Key::Closed)?;
        if was.is_some_and(|was| was != list.entries[index].entry.state) {
            return Err(Key::Conflict);
        }
        if act == Act::Fly {
            let flying = list.entries.iter_mut().filter(|it| it.entry.state == State::Flying);
            for stored in flying.filter(|it| it.entry.id != id) {
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

    /// Takes back what a visitor sent, as long as it waits.
    pub(crate) fn withdraw(&self, id: &str, visitor: &str) -> KeyResult<()> {
        let mut list = self.list();
        let is_own = |it: &Stored| it.entry.id == id && it.entry.visitor == visitor;
        let index = list.entries.iter().position(is_own).ok_or(Key::Closed)?;
        if list.entries[index].entry.state != State::Waiting {
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
        let place =
            |it: &Stored| ids.iter().position(|id| *id == it.entry.id).unwrap_or(usize::MAX);
        let mut entries: Vec<&Stored> = list.entries.iter().collect();
        entries.sort_by_key(|it| place(it));
        self.write_order(list.paused, entries)?;
        list.entries.sort_by_key(place);
        Ok(self.changed())
    }

    /// Takes no more entries, or takes them again.
    pub(crate) fn pause(&self, paused: bool) -> KeyResult<u64> {
        let mut list = self.list();
        self.write_order(paused, &list.entries)?;
        list.paused = paused;
        Ok(self.changed())
    }

    /// Writes what is about to be true of the list: the disk comes first.
    fn write_order<'a>(
        &self,
        paused: bool,
        entries: impl IntoIterator<Item = &'a Stored>,
    ) -> KeyResult<()> {
        let numbers = entries.into_iter().map(|it| it.entry.number).collect();
        self.gallery.write_order(&Order { paused, numbers }).map_err(|_cause| Key::DiskFull)
    }

    /// Waits until there is something new since a revision, or for a while.
    pub(crate) async fn news(&self, seen: u64) -> u64 {
        let mut changes = self.revision.subscribe();
        let _ = timeout(NEWS_TIMEOUT, changes.wait_for(|revision| *revision != seen)).await;
        *changes.borrow()
    }

    /// Whether the wall shows what nobody approved.
    pub(crate) fn is_open(&self) -> bool {
        self.is_open
    }

    pub(crate) fn is_paused(&self) -> bool {
        self.list().paused
    }

    /// The whole queue, for the operator.
    pub(crate) fn queue(&self) -> String {
        let list = self.list();
        let queue = Queue {
            revision: *self.revision.borrow(),
            paused: list.paused,
            entries: list.entries.iter().map(|it| it.entry.for_operator()).collect(),
            flying: list.first(|it| it.state == State::Flying).map(|it| &*it.entry.id),
        };
        serde_json::to_string(&queue).expect("entries are plain data")
    }

    /// An entry as its visitor sees it.
    pub(crate) fn own(&self, id: &str) -> KeyResult<ForVisitor> {
        let list = self.list();
        let index = list.entries.iter().position(|it| it.entry.id == id).ok_or(Key::Closed)?;
        let Entry { id, number, title, made, state, language, figures, .. } =
            list.entries[index].entry.clone();
        let flies = |it: &&Stored| !matches!(it.entry.state, State::Flown | State::Rejected);
        let ahead = list.entries[..index].iter().filter(flies);
        let ahead_s =
            ahead.clone().fold(0.0, |sum, it| sum + it.entry.figures.flight_s + BETWEEN_S);
        let made = made.get(..10).unwrap_or_default().to_owned();
        let (ahead, Figures { flight_s, read, legible, .. }) = (ahead.count(), figures);
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

    /// A file of an entry.
    pub(crate) fn file(&self, id: &str, name: &str) -> Option<PathBuf> {
        regular(self.list().first(|entry| entry.id == id)?.folder.join(name))
    }

    /// What the wall shows, the newest first: of each visitor a word once.
    pub(crate) fn wall(&self) -> Wall {
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
        let photo = |entry: &Entry| WallPhoto {
            key: entry.key.clone(),
            title: entry.title.clone(),
            flight_s: entry.figures.flight_s,
            flying: entry.state == State::Flying,
        };
        let photos = shown.into_iter().map(photo).collect();
        Wall { revision: *self.revision.borrow(), photos }
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

    /// Entries whose scripts are written, in the order of flight: number, title, and what was asked
    /// for. `id` names one of any state; `None`: those that are approved or in the air.
    pub(crate) fn to_fly(&self, id: Option<&str>) -> Vec<(u32, String, Option<Subject>)> {
        let list = self.list();
        let is_wanted = |it: &&Stored| match id {
            Some(id) => it.entry.id == id,
            None => matches!(it.entry.state, State::Approved | State::Flying),
        };
        let subject = |it: &Stored| {
            let title = it.entry.title.clone().unwrap_or_else(|| "drawing".to_owned());
            (it.entry.number, title, gallery::read_subject(&it.folder))
        };
        list.entries.iter().filter(is_wanted).map(subject).collect()
    }

    /// Tells all who wait for news. Returns the new revision.
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

    fn first(&self, is_it: impl Fn(&Entry) -> bool) -> Option<&Stored> {
        self.entries.iter().find(|it| is_it(&it.entry))
    }
}

impl Stored {
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
