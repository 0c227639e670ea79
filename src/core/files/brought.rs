//! Files from a web page, stored in memory by name because browsers have no file system.

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::io::{Cursor, Error, ErrorKind, Read, Result};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

static BROUGHT: Mutex<BTreeMap<PathBuf, Vec<u8>>> = Mutex::new(BTreeMap::new());

/// Stores a file from the web page, and replaces any file with the same name.
pub fn bring(name: &str, bytes: Vec<u8>) {
    BROUGHT.lock().unwrap_or_else(PoisonError::into_inner).insert(name.into(), bytes);
}

/// File from the web page, read like a `std::fs::File`.
pub(super) struct File(Cursor<Vec<u8>>);

impl File {
    /// Opens a file that the page has stored under this path. Returns `NotFound` for any other
    /// name.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let brought = BROUGHT.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = brought.get(path).ok_or(Error::from(ErrorKind::NotFound))?;
        Ok(Self(Cursor::new(bytes.clone())))
    }

    /// Returns an error, because a file in memory has no metadata.
    pub(super) fn metadata(&self) -> Result<Metadata> {
        Err(ErrorKind::Unsupported.into())
    }
}

impl Read for File {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        self.0.read(buffer)
    }
}
