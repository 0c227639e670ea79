//! Large photos that are kept for a while, for downloads and for those who send them to be flown.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::Value;
use tempfile::TempDir;

use super::render::{FIGURES, OUT};
use noctograph_core::files::Limit;
use noctograph_web::request::Subject;

const LIMIT: Limit = Limit { bytes: 16 << 20, what: "a photo's figures", hint: "take it again" };

/// Most photos that are kept, and of a visitor; each takes some 3 MB in the temporary folder.
const MOST: usize = 128;
const MOST_OF_VISITOR: usize = 4;

/// A large photo, and what made it.
#[derive(Clone, Debug)]
pub(crate) struct CachedPhoto {
    /// A name that nobody guesses.
    pub(crate) id: String,
    pub(crate) visitor: String,
    pub(crate) subject: Subject,
    /// Lives as long as somebody needs its files.
    pub(crate) folder: Arc<TempDir>,
}

impl CachedPhoto {
    /// What was found on it, which waits on the disk and not in memory.
    pub(crate) fn figures(&self) -> Value {
        let text = LIMIT.read_text(&self.file(FIGURES)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(OUT).join(name)
    }
}

#[derive(Debug, Default)]
pub(crate) struct PhotoCache(Mutex<VecDeque<CachedPhoto>>);

impl PhotoCache {
    pub(crate) fn keep(&self, photo: CachedPhoto) {
        let mut photos = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_own = |it: &CachedPhoto| it.visitor == photo.visitor;
        let oldest = match photos.iter().filter(|it| is_own(it)).count() {
            MOST_OF_VISITOR.. => photos.iter().position(is_own),
            _ if photos.len() == MOST => Some(0),
            _ => None,
        };
        oldest.map(|index| photos.remove(index));
        photos.push_back(photo);
    }

    pub(crate) fn get(&self, id: &str) -> Option<CachedPhoto> {
        let photos = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        photos.iter().find(|photo| photo.id == id).cloned()
    }
}
