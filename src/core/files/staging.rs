//! Staged files, which have a temporary name until they are complete, and which a later program
//! removes if their program is killed.
//!
//! A temporary file is locked while its program runs, so that the next program recognizes files
//! left behind. On a file system without locks, files left behind are not removed.

use std::fs::{File, FileType, OpenOptions, Permissions};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir, TempPath};

const PREFIX: &str = ".noctograph-";
const SUFFIX: &str = ".tmp";

/// Name of the lock file in a folder.
#[cfg(windows)]
const LOCK: &str = ".noctograph-lock";
/// Number of attempts to lock a folder, which take ten seconds with the pauses between them.
#[cfg(windows)]
const LOCK_TRIES: usize = 5000;
#[cfg(windows)]
const LOCK_PAUSE: Duration = Duration::from_millis(2);

/// Gives new files the mode of an ordinary file, which is 0666 before the umask.
#[cfg(unix)]
fn set_ordinary_mode(builder: &mut Builder<'_, '_>) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
fn set_ordinary_mode(_: &mut Builder<'_, '_>) {}

/// Creates a locked temporary file in a folder, with the mode of an ordinary file, and removes
/// temporary files of killed programs.
pub(super) fn file_in(folder: &Path) -> Result<NamedTempFile> {
    remove_leftovers(folder);
    loop {
        let mut builder = Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        set_ordinary_mode(&mut builder);
        let file = builder.tempfile_in(folder)?;
        // Without locks, the file is only not recognized as a leftover.
        let _ = file.as_file().lock();
        // Before this file was locked, another program may have removed it as a leftover.
        if file.path().exists() {
            return Ok(file);
        }
    }
}

/// Creates a temporary folder, which is locked as long as the returned file is open, and removes
/// temporary folders of killed programs.
///
/// # Errors
///
/// Returns the system's error if the folder is not writable.
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

/// Locks a folder until the returned file is closed, or returns `None` if that is not possible.
#[cfg(not(windows))]
pub(super) fn locked(folder: &Path) -> Option<File> {
    File::open(folder).ok().filter(|folder| folder.lock().is_ok())
}

/// Locks a folder with a file in it, because Windows cannot open a folder as a file. Only one
/// program at a time can open the lock file. Windows removes the file when that program closes it
/// or is killed.
#[cfg(windows)]
pub(super) fn locked(folder: &Path) -> Option<File> {
    // Renames by another program take milliseconds. The number of attempts is limited because the
    // folder may never become writable.
    for _ in 0..LOCK_TRIES {
        match only_here(&folder.join(LOCK), true) {
            Err(error) if error.kind() == ErrorKind::NotFound => return None,
            Err(_) => std::thread::sleep(LOCK_PAUSE),
            file => return file.ok(),
        }
    }
    None
}

#[cfg(windows)]
pub(super) use locked as locked_soon;

/// Locks a folder like [`locked`], but gives up after five seconds, because the program's caller
/// may hold the lock forever. Returns `None` without a lock.
#[cfg(not(windows))]
pub(super) fn locked_soon(folder: &Path) -> Option<File> {
    const TRIES: u32 = 500;
    const PAUSE: Duration = Duration::from_millis(10);
    let folder = File::open(folder).ok()?;
    for _ in 0..TRIES {
        match folder.try_lock() {
            Ok(()) => return Some(folder),
            Err(std::fs::TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
            Err(std::fs::TryLockError::Error(_)) => return None,
        }
    }
    None
}

/// Opens a file that no other program has open, creates it if `create`, and removes it when it is
/// closed.
#[cfg(windows)]
fn only_here(path: &Path, create: bool) -> Result<File> {
    use std::os::windows::fs::OpenOptionsExt;
    const DELETE_ON_CLOSE: u32 = 0x0400_0000;
    let mut options = OpenOptions::new();
    options.write(true).create(create).share_mode(0).custom_flags(DELETE_ON_CLOSE);
    options.open(path)
}

/// Removes a temporary file or, if `is_folder`, a folder of a program that has ended. The lock is
/// held until the removal, because another program may have just created the file and may be about
/// to lock it.
fn remove_left_behind(path: &Path, is_folder: bool) -> Result<()> {
    #[cfg(windows)]
    if is_folder {
        match only_here(&path.join(LOCK), false) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => return std::fs::remove_dir_all(path),
        }
    }
    // The lock fails if the program that locked the file is still running.
    let file = File::open(path)?;
    file.try_lock()?;
    if is_folder { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) }
}

/// Removes the temporary files and folders of programs that have ended. Failures have no effect.
fn remove_leftovers(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let name = name.to_string_lossy();
        let is_ours = name.starts_with(PREFIX) && name.ends_with(SUFFIX);
        // Opening other entries, such as a pipe, could block.
        let is_removable = |kind: &FileType| is_ours && (kind.is_file() || kind.is_dir());
        let Some(kind) = entry.file_type().ok().filter(is_removable) else { continue };
        // Failures are ignored, because a remaining temporary file is harmless.
        let _ = remove_left_behind(&path, kind.is_dir());
    }
}

/// Entry at the path of a new file.
pub(super) enum Place {
    /// Nothing, or a regular file whose permissions the new file receives.
    Regular(Option<Permissions>),
    /// Device, pipe or socket that is open for writing and is never replaced.
    Through(File),
}

impl Place {
    /// Finds the entry at a path, following links.
    ///
    /// # Errors
    ///
    /// Returns the system's error if the path is a folder or is not writable.
    pub(super) fn for_path(path: &Path) -> Result<Self> {
        // Windows returns no metadata for its null device.
        if cfg!(windows) && path.as_os_str().eq_ignore_ascii_case("NUL") {
            return Ok(Self::Through(OpenOptions::new().write(true).open(path)?));
        }
        let metadata = match std::fs::metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::Regular(None)),
            metadata => metadata?,
        };
        if metadata.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        // Opening the file now detects missing write permission before time-consuming work.
        let file = OpenOptions::new().write(true).open(path)?;
        Ok(if metadata.is_file() {
            Self::Regular(Some(metadata.permissions()))
        } else {
            Self::Through(file)
        })
    }
}

/// Returns the folder of a file, or `.` if the path has none.
pub(super) fn folder(path: &Path) -> &Path {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}

/// Former files at the paths of a set of new files. The former files are restored unless all new
/// files receive their names. On a file system without hard links, former files are not preserved.
///
/// Each entry consists of a path and of the second name of its former file, which is `None` if
/// there was no file.
#[derive(Debug, Default)]
pub(super) struct Former(Vec<(PathBuf, Option<TempPath>)>);

impl Former {
    /// Calls `replace`, which puts a file at `place`, and keeps the former file under another name
    /// so that it can be restored. Returns the result of `replace`.
    pub(super) fn replace<T, E>(
        &mut self,
        place: Option<PathBuf>,
        replace: impl FnOnce() -> std::result::Result<T, E>,
    ) -> std::result::Result<T, E> {
        // A hard link preserves the former file under another name.
        let linked = place.map(|place| {
            let hard_link = |to: &Path| std::fs::hard_link(&place, to);
            let builder = &mut Builder::new();
            let link = builder.prefix(PREFIX).suffix(SUFFIX).make_in(folder(&place), hard_link);
            (place, link)
        });
        let replaced = replace()?;
        // A file that cannot be linked for another reason than its absence cannot be restored.
        self.0.extend(linked.and_then(|(place, link)| match link {
            Ok(link) => Some((place, Some(link.into_temp_path()))),
            Err(error) => (error.kind() == ErrorKind::NotFound).then_some((place, None)),
        }));
        Ok(replaced)
    }

    /// Removes the former files after all new files have received their names.
    pub(super) fn forget(mut self) {
        self.0.clear();
    }
}

impl Drop for Former {
    /// Restores the former files in reverse order, unless [`Self::forget`] has been called.
    fn drop(&mut self) {
        for (place, link) in self.0.drain(..).rev() {
            // A failure is ignored, because there is no other way to restore the file.
            let _ = match link {
                Some(link) => link.persist(&place).map_err(|error| error.error),
                None => std::fs::remove_file(&place),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_ended_program_left_is_cleared_and_what_is_in_use_stays() {
        let parent = tempfile::tempdir().unwrap();
        let left = parent.path().join(".noctograph-dead.tmp");
        std::fs::create_dir(&left).unwrap();
        std::fs::write(left.join("photo.png"), "half").unwrap();
        std::fs::write(parent.path().join(".noctograph-file.tmp"), "half").unwrap();
        let (used, lock) = folder_in(parent.path()).unwrap();
        assert!(lock.is_some() && !left.exists(), "cleared");
        let (other, other_lock) = folder_in(parent.path()).unwrap();
        assert!(used.path().exists() && other.path().exists(), "in use");
        drop((lock, other_lock));
        drop((used, other));
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 0, "nothing is left");
    }
}
