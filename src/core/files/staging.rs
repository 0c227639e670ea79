//! Staged files: under a temporary name until they are whole, and removed if their program was
//! killed.
//!
//! A temporary file is locked while its program lives, so that the next program can tell one that
//! was left behind. Where a file system has no locks, files that are left behind stay.

use std::fs::{File, FileType, OpenOptions, Permissions, TryLockError};
use std::io::Result;
use std::path::Path;
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir};

const PREFIX: &str = ".noctograph-";
const SUFFIX: &str = ".tmp";

/// Mode of a new file before the umask.
#[cfg(unix)]
fn mode(builder: &mut Builder<'_, '_>, mode: u32) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(Permissions::from_mode(mode));
}

#[cfg(not(unix))]
fn mode(_: &mut Builder<'_, '_>, _: u32) {}

/// Makes a temporary file in a folder, with the mode of an ordinary file.
pub(super) fn file_in(folder: &Path) -> Result<NamedTempFile> {
    remove_leftovers(folder);
    loop {
        let mut builder = Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        mode(&mut builder, 0o666);
        let file = builder.tempfile_in(folder)?;
        let _ = file.as_file().lock();
        // Another program may have taken it for a leftover before it was locked.
        if file.path().exists() {
            return Ok(file);
        }
    }
}

/// Makes a temporary folder in a folder, and removes those there that killed programs left; it is
/// locked as long as the file returned is open.
///
/// # Errors
///
/// [`Error::Io`](crate::error::Error::Io) without write permission.
pub fn folder_in(folder: &Path) -> Result<(TempDir, Option<File>)> {
    remove_leftovers(folder);
    loop {
        let staging = Builder::new().prefix(PREFIX).suffix(SUFFIX).tempdir_in(folder)?;
        let lock = locked(staging.path());
        if staging.path().exists() {
            return Ok((staging, lock));
        }
    }
}

/// Locks a folder until the file is closed, waiting for another program; `None` where the system
/// has no such locks.
pub(super) fn locked(folder: &Path) -> Option<File> {
    File::open(folder).ok().filter(|folder| folder.lock().is_ok())
}

/// The same for a moment at most: whoever runs the program under a lock of the folder would wait
/// forever.
pub(super) fn locked_soon(folder: &Path) -> Option<File> {
    let folder = File::open(folder).ok()?;
    for _ in 0..500 {
        match folder.try_lock() {
            Ok(()) => return Some(folder),
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(10)),
            Err(TryLockError::Error(_)) => return None,
        }
    }
    None
}

/// Removes temporary files of ended processes.
fn remove_leftovers(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let name = name.to_string_lossy();
        let is_ours = name.starts_with(PREFIX) && name.ends_with(SUFFIX);
        // Others, such as a pipe, could block when they are opened.
        let opens = |kind: &FileType| is_ours && (kind.is_file() || kind.is_dir());
        let Some(kind) = entry.file_type().ok().filter(opens) else { continue };
        if File::open(&path).is_ok_and(|file| file.try_lock().is_ok()) {
            // A file that stays does no harm.
            let _ = match kind.is_dir() {
                true => std::fs::remove_dir_all(&path),
                false => std::fs::remove_file(&path),
            };
        }
    }
}

/// The state of the place for a new file.
pub(super) enum Place {
    /// Nothing, or a regular file whose permissions it takes over.
    Regular(Option<Permissions>),
    /// A device, a pipe or a socket, open for writing: it is written to, never replaced.
    Through(File),
}

impl Place {
    /// Looks at a path, following links.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] for a folder, and without write permission.
    pub(super) fn for_path(path: &Path) -> Result<Self> {
        let there = std::fs::metadata(path);
        if there.as_ref().is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound) {
            return Ok(Self::Regular(None));
        }
        let there = there?;
        if there.is_dir() {
            return Err(std::io::ErrorKind::IsADirectory.into());
        }
        let file = OpenOptions::new().write(true).open(path)?;
        Ok(match there.is_file() {
            true => Self::Regular(Some(there.permissions())),
            false => Self::Through(file),
        })
    }
}
