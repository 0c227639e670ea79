//! Large photos that are kept for a while, for downloads and for those who send them to be flown.

use std::collections::VecDeque;
use std::io::Write;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use tempfile::TempDir;

use super::studio::OUT;
use super::wish::{Subject, Wish};
use super::{Output, Result, Value};
use noctograph_core::files::Limit;

const SAID: &str = "said.json";
const LIMIT: Limit = Limit { bytes: 16 << 20, what: "a photo's figures", hint: "take it again" };

/// Most photos that are kept, and of a visitor; each takes some 3 MB in the temporary folder.
const MOST: usize = 128;
const MOST_OF_VISITOR: usize = 4;

/// A large photo, and what made it.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    /// A name that nobody guesses.
    pub(super) id: String,
    pub(super) visitor: String,
    pub(super) subject: Subject,
    /// Lives as long as somebody needs its files.
    pub(super) folder: Arc<TempDir>,
}

impl Kept {
    /// Keeps a photo with what was said of it, which waits on the disk and not in memory.
    pub(super) fn new(id: String, wish: Wish, folder: Arc<TempDir>, said: &Value) -> Result<Self> {
        let Wish { visitor, subject, .. } = wish;
        let kept = Self { id, visitor, subject, folder };
        Output::create(&kept.file(SAID))?.keep(|out| write!(out, "{said}"))?;
        Ok(kept)
    }

    pub(super) fn said(&self) -> Value {
        let text = LIMIT.read_text(&self.file(SAID)).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(OUT).join(name)
    }
}

#[derive(Debug, Default)]
pub(super) struct Photos(Mutex<VecDeque<Kept>>);

impl Photos {
    pub(super) fn keep(&self, kept: Kept) {
        let mut photos = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_own = |it: &Kept| it.visitor == kept.visitor;
        let oldest = match photos.iter().filter(|it| is_own(it)).count() {
            MOST_OF_VISITOR.. => photos.iter().position(is_own),
            _ if photos.len() == MOST => Some(0),
            _ => None,
        };
        oldest.map(|at| photos.remove(at));
        photos.push_back(kept);
    }

    pub(super) fn get(&self, id: &str) -> Option<Kept> {
        let photos = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        photos.iter().find(|kept| kept.id == id).cloned()
    }
}
