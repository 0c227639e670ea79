//! Flights of entries: the light so far, the photo of a flight, and notes about logs.

use std::path::PathBuf;

use hyper::body::Bytes;
use serde::Serialize;

use super::{DRAWING, Entries, List, Stored};
use crate::gallery::{self, Entry, FlownPhoto, State, regular_file};
use crate::worker::Parcel;
use noctograph_photo_service::messages::{Key, KeyResult};
use noctograph_photo_service::request::Subject;

/// Photo of a flight so far.
#[derive(Debug)]
pub(super) struct Light {
    /// Name of the entry.
    pub(super) id: String,
    jpeg: Bytes,
    /// False when the flight is over. The wall may still request the last photo.
    pub(super) is_live: bool,
}

/// Note for the operator about the log of a flight.
#[derive(Debug, PartialEq, Serialize)]
pub(crate) struct FlightNote {
    /// Key of the note's sentence on the page.
    pub(crate) key: &'static str,
    /// Name of the log.
    pub(crate) name: String,
    /// Reason in English, or the word that was flown according to the log.
    pub(crate) why: String,
}

impl Entries {
    /// Returns the path of a file of an entry's flight, or `None` if it does not exist.
    pub(crate) fn flown_file(&self, id: &str, name: &str) -> Option<PathBuf> {
        self.list().flown_file(|entry| entry.id == id, name)
    }

    /// Returns the path of a flight's file for an entry on the wall.
    pub(crate) fn wall_flown(&self, key: &str, name: &str) -> Option<PathBuf> {
        self.list().flown_file(|entry| self.hangs(entry, key), name)
    }

    /// Returns the JPEG of the flight so far of the entry on the wall whose name there is `key`.
    pub(crate) fn wall_light(&self, key: &str) -> Option<Bytes> {
        let list = self.list();
        let stored = list.first(|entry| self.hangs(entry, key))?;
        let light = list.light.as_ref().filter(|light| light.id == stored.entry.id)?;
        Some(light.jpeg.clone())
    }

    /// Returns the name and the number of drones of the entry to which a log of a word belongs, or
    /// `None` if there is no such entry. This is the entry in the air or else the first approved or
    /// flown entry, preferably one without a photo of its flight.
    pub(crate) fn flies(&self, word: &str) -> Option<(String, usize)> {
        let list = self.list();
        let writes = |entry: &Entry| match &entry.title {
            // In a typed word, the characters `\n` stand for a line break.
            Some(title) => title.replace("\\n", "\n") == word,
            None => word == DRAWING,
        };
        // An entry that lacks the photo of its flight comes before one that has it.
        let rank = |entry: &Entry| match (entry.state, entry.flown.is_some()) {
            (State::Flying, _) => Some(0),
            (State::Approved, false) => Some(1),
            (State::Flown, false) => Some(2),
            (State::Approved, true) => Some(3),
            _ => None,
        };
        let entries = list.entries.iter().map(|stored| &stored.entry);
        let ranked =
            entries.filter(|entry| writes(entry)).filter_map(|entry| Some((rank(entry)?, entry)));
        let (_, entry) = ranked.min_by_key(|(rank, _)| *rank)?;
        Some((entry.id.clone(), entry.figures.drones))
    }

    /// Returns the subject of an entry, or `None` if it cannot be read.
    pub(crate) fn subject(&self, id: &str) -> Option<Subject> {
        let folder = self.list().first(|entry| entry.id == id)?.folder.clone();
        gallery::read_subject(&folder)
    }

    /// Returns true if the operator has approved an entry and has not withdrawn the approval.
    pub(crate) fn is_approved(&self, id: &str) -> bool {
        let is_approved = |entry: &Entry| !matches!(entry.state, State::Waiting | State::Rejected);
        self.list().first(|entry| entry.id == id).is_some_and(|stored| is_approved(&stored.entry))
    }

    /// Shows the photo (JPEG) of an entry's flight so far on the wall. Walls are notified when the
    /// flight begins.
    pub(crate) fn shine(&self, id: &str, jpeg: Vec<u8>) {
        let mut list = self.list();
        let was_live = list.light.as_ref().is_some_and(|light| light.is_live && light.id == id);
        list.light = Some(Light { id: id.to_owned(), jpeg: jpeg.into(), is_live: true });
        if !was_live {
            self.announce_change();
        }
    }

    /// Marks the flight that the wall shows as ended, and notifies the walls.
    pub(crate) fn end_light(&self) {
        if let Some(light) = self.list().light.as_mut().filter(|light| light.is_live) {
            light.is_live = false;
            self.announce_change();
        }
    }

    /// Stores the photo of an entry's flight, with which the wall then replaces the preview.
    /// Returns [`Key::Closed`] for an entry that was removed, and [`Key::DiskFull`] if it cannot be
    /// written.
    pub(crate) fn land(&self, id: &str, Parcel { figures, files }: &Parcel) -> KeyResult<()> {
        let folder = self.list().first(|entry| entry.id == id).ok_or(Key::Closed)?.folder.clone();
        // The list is not locked during the disk access.
        let name = gallery::write_flown(&folder, files).map_err(|_cause| Key::DiskFull)?;
        let mut list = self.list();
        let index = list.index(id)?;
        let flown = FlownPhoto { name, readability: figures.readability };
        list.entries[index].change(|entry| entry.flown = Some(flown))?;
        self.announce_change();
        Ok(())
    }

    /// Replaces the notes about the logs of flights that the operator's page shows.
    pub(crate) fn note(&self, notes: Vec<FlightNote>) {
        let mut list = self.list();
        if list.notes != notes {
            list.notes = notes;
            self.announce_change();
        }
    }
}

impl List {
    /// Returns the path of a flight's file for the first entry for which `is_wanted` is true.
    fn flown_file(&self, is_wanted: impl Fn(&Entry) -> bool, name: &str) -> Option<PathBuf> {
        let Stored { entry, folder, .. } = self.first(is_wanted)?;
        let (flown, _ending) = name.rsplit_once('.')?;
        entry.flown.as_ref().filter(|entry| entry.name == flown)?;
        regular_file(folder.join(name))
    }
}
