//! Output folder whose files all appear at the same time.

use std::fs::{File, OpenOptions, Permissions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::output::{BUFFER_BYTES, Output, STANDARD_OUTPUT, WholeFile};
use super::staging::{Former, Place, folder_in, locked};
use crate::digest::{Digest, Digested};
use crate::error::{Error, Result};

/// Folder whose files are staged inside it until all of them are written.
///
/// The folder is locked during the renames, so that it never contains files from two programs.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    staging: TempDir,
    /// Lock that shows other programs that the staging folder is in use.
    lock: Option<File>,
    /// True if the folder is new. A new folder is removed again unless the files are kept.
    made: bool,
    /// Names of the written files, in the order of writing.
    names: Vec<String>,
    /// Index of the file that receives its final name before the others.
    first: usize,
    /// Files of an earlier set, which are removed once the new set is complete.
    former: Vec<PathBuf>,
}

impl OutputFolder {
    /// Opens a folder, and creates it if it does not exist.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the folder cannot be written. Returns [`Error::Input`] for standard
    /// output, which is a single file.
    pub fn create(path: &Path) -> Result<Self> {
        if path == Path::new(STANDARD_OUTPUT) {
            let hint = "name a folder (./- for a folder called -)";
            let wanted = "a folder for several files";
            return Err(Error::input("output", STANDARD_OUTPUT, wanted, hint));
        }
        let unwritable = |source| Error::write(path, source);
        let made = !path.exists();
        std::fs::create_dir_all(path).map_err(unwritable)?;
        let (staging, lock) = folder_in(path).map_err(unwritable)?;
        let (path, names, former) = (path.to_owned(), Vec::new(), Vec::new());
        Ok(Self { path, staging, lock, made, names, first: 0, former })
    }

    /// Checks, before time-consuming work, that files with these names can be written.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if one of the paths is a folder or is not writable.
    pub fn check_writable(&self, names: &[impl AsRef<Path>]) -> Result<()> {
        names.iter().map(|name| self.path.join(name)).try_for_each(|path| {
            let writable = match path.metadata() {
                Ok(there) if there.is_dir() => Err(std::io::ErrorKind::IsADirectory.into()),
                // Only regular files are opened, because opening a pipe blocks and closing it stops
                // its reader.
                Ok(there) if there.is_file() => {
                    OpenOptions::new().write(true).open(&path).map(|_| ())
                }
                // A new file needs a writable folder, as the staging folder in it has shown.
                _ => Ok(()),
            };
            writable.map_err(|source| Error::write(&path, source))
        })
    }

    /// Stages a file that will be called `name`, and returns its digest.
    pub fn write(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<String> {
        self.write_with(name, |out| out.write_all(content.as_ref()))
    }

    /// Stages the file that receives its final name before all others. That file lists the others,
    /// so that a reader sees which files are missing if the program is killed between two renames.
    pub fn write_first(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<()> {
        self.first = self.names.len();
        self.write(name, content).map(drop)
    }

    /// Stages a file that will be called `name`, with content from `write`, and returns its SHA-256
    /// in hexadecimal. Returns [`Error::Io`] if it cannot be written.
    pub fn write_with(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut BufWriter<Digested<File>>) -> std::io::Result<()>,
    ) -> Result<String> {
        // The file is synced to the disk before it receives its final name.
        let file = File::create(self.staging.path().join(name));
        let written = file.and_then(|file| {
            let mut out = BufWriter::with_capacity(BUFFER_BYTES, Digested::new(file));
            write(&mut out)?;
            let Digested { to: file, digest } = out.into_inner()?;
            file.sync_all()?;
            Ok(digest.map_or_else(String::new, Digest::hex))
        });
        let sha256 = written.map_err(|source| Error::write(&self.path.join(name), source))?;
        self.names.push(name.to_owned());
        Ok(sha256)
    }

    /// Adds files of an earlier set, which [`Self::keep`] removes.
    pub fn replaces(&mut self, former: Vec<PathBuf>) {
        self.former.extend(former);
    }

    /// Renames all staged files to their final names, beginning with the file of
    /// [`Self::write_first`]. Returns their paths in the order of writing.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`]. A name that cannot be written is refused before any file is renamed.
    pub fn keep(mut self) -> Result<Vec<PathBuf>> {
        self.made = false;
        let _lock = locked(&self.path);
        // Everything that can fail happens before the first rename. A file behind a link or on
        // another disk is therefore copied now.
        let ready = self.names.iter().map(|name| self.prepare(name).map(Some));
        let mut ready = ready.collect::<Result<Vec<_>>>()?;
        let mut former = Former::default();
        for index in std::iter::once(self.first).chain(0..self.names.len()) {
            if let Some(file) = ready.get_mut(index).and_then(Option::take) {
                former.replace(file.replaced(), || file.keep())?;
            }
        }
        former.forget();
        // All files now have their final names, so files of an earlier set can be removed.
        for path in &self.former {
            std::fs::remove_file(path).map_err(|source| Error::write(path, source))?;
        }
        Ok(self.names.iter().map(|name| self.path.join(name)).collect())
    }

    /// Prepares the rename of a staged file, so that only a rename or a write to a device remains.
    /// A file whose target is behind a link is copied beside that target.
    fn prepare(&self, name: &str) -> Result<Ready> {
        let (staged, path) = (self.staging.path().join(name), self.path.join(name));
        let target = match Place::for_path(&path) {
            Ok(Place::Regular(_)) if path.is_symlink() => {
                let linked = Output::create(&path)?;
                Target::Linked(linked.write_with(|out| copy(&staged, out))?)
            }
            Ok(Place::Regular(permissions)) => Target::Renamed(permissions),
            Ok(Place::Through(file)) => Target::Through(file),
            Err(source) => return Err(Error::write(&path, source)),
        };
        Ok(Ready { staged, path, target })
    }
}

/// Staged file that is complete except for its name.
struct Ready {
    staged: PathBuf,
    path: PathBuf,
    target: Target,
}

enum Target {
    /// New path, or an existing file, whose permissions the new file receives.
    Renamed(Option<Permissions>),
    /// Target of a link, which may be on another disk.
    Linked(WholeFile),
    /// Device, pipe or socket.
    Through(File),
}

impl Ready {
    /// Returns the regular file that this one replaces, or `None` for a device, a pipe or a socket.
    fn replaced(&self) -> Option<PathBuf> {
        match &self.target {
            Target::Renamed(_) => Some(self.path.clone()),
            Target::Linked(file) => file.place().map(Path::to_owned),
            Target::Through(_) => None,
        }
    }

    /// Gives the file its final name and permissions, or writes it to its device, pipe or socket.
    fn keep(self) -> Result<()> {
        let Self { staged, path, target } = self;
        let named = match target {
            Target::Linked(file) => return file.keep().map(drop),
            Target::Renamed(permissions) => permissions
                .map_or(Ok(()), |permissions| std::fs::set_permissions(&staged, permissions))
                .and_then(|()| std::fs::rename(&staged, &path)),
            Target::Through(mut file) => copy(&staged, &mut file),
        };
        named.map_err(|source| Error::write(&path, source))
    }
}

/// Copies a file to a writer.
fn copy(from: &Path, to: &mut impl Write) -> std::io::Result<()> {
    std::io::copy(&mut File::open(from)?, to).map(|_| ())
}

impl Drop for OutputFolder {
    /// Removes a folder that was created for files that were not kept.
    fn drop(&mut self) {
        self.lock = None;
        if self.made {
            // A folder that now contains other files cannot be removed, and therefore remains.
            let _ = std::fs::remove_dir_all(self.staging.path());
            let _ = std::fs::remove_dir(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_of_files_appears_whole() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("a/b");
        let mut folder = OutputFolder::create(&path).unwrap();
        folder.write("one.txt", b"1").unwrap();
        assert!(!path.join("one.txt").exists(), "not yet");
        folder.keep().unwrap();
        assert_eq!(std::fs::read(path.join("one.txt")).unwrap(), b"1");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 1, "and nothing else");
    }

    #[test]
    fn a_folder_that_nothing_came_of_is_gone() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        let mut folder = OutputFolder::create(&path).unwrap();
        folder.write("one.txt", b"1").unwrap();
        drop(folder);
        assert!(!path.exists(), "the folder that was made for it went with it");
    }

    /// Three writers write 200 files each. Finally, the folder contains the complete set of one of
    /// them.
    #[test]
    fn two_writers_of_one_folder_never_mix() {
        let parent = tempfile::tempdir().unwrap();
        let names: Vec<String> = (0..200).map(|k| format!("{k}.txt")).collect();
        for round in 0..5 {
            std::thread::scope(|scope| {
                for writer in ["a", "b", "c"] {
                    let (path, names) = (parent.path(), &names);
                    scope.spawn(move || {
                        let mut folder = OutputFolder::create(path).unwrap();
                        for name in names {
                            folder.write(name, writer).unwrap();
                        }
                        folder.keep().unwrap();
                    });
                }
            });
            let read = |name: &String| std::fs::read_to_string(parent.path().join(name)).unwrap();
            let first = read(&names[0]);
            assert!(names.iter().all(|name| read(name) == first), "round {round}");
        }
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 200, "and nothing else");
    }

    #[test]
    fn where_one_name_is_taken_by_a_folder_no_file_is_replaced() {
        let parent = tempfile::tempdir().unwrap();
        std::fs::write(parent.path().join("a.txt"), "old").unwrap();
        std::fs::create_dir(parent.path().join("b.txt")).unwrap();
        let mut folder = OutputFolder::create(parent.path()).unwrap();
        folder.check_writable(&["a.txt", "c.txt"]).unwrap();
        assert!(folder.check_writable(&["a.txt", "b.txt"]).is_err(), "before the long work");
        for name in ["a.txt", "b.txt"] {
            folder.write(name, b"new").unwrap();
        }
        let error = folder.keep().unwrap_err().to_string();
        assert!(error.contains("b.txt"), "{error}");
        assert_eq!(std::fs::read_to_string(parent.path().join("a.txt")).unwrap(), "old");
    }

    #[test]
    fn a_set_replaces_what_the_earlier_one_has_more() {
        let parent = tempfile::tempdir().unwrap();
        let path = |name: &str| parent.path().join(name);
        for name in ["plan-1.csv", "plan-2.csv", "notes.txt"] {
            std::fs::write(path(name), "old").unwrap();
        }
        let mut folder = OutputFolder::create(parent.path()).unwrap();
        folder.replaces(vec![path("plan-2.csv")]);
        folder.write("plan-1.csv", b"new").unwrap();
        assert!(path("plan-2.csv").exists(), "not yet");
        folder.keep().unwrap();
        assert!(!path("plan-2.csv").exists() && path("notes.txt").exists());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_link_in_the_folder_is_written_through() {
        let parent = tempfile::tempdir().unwrap();
        let path = |name: &str| parent.path().join(name);
        std::fs::create_dir(path("out")).unwrap();
        std::fs::write(path("far.txt"), "a longer old text").unwrap();
        std::os::unix::fs::symlink("../far.txt", path("out/one.txt")).unwrap();
        std::os::unix::fs::symlink("/dev/null", path("out/two.txt")).unwrap();
        let mut folder = OutputFolder::create(&path("out")).unwrap();
        for name in ["one.txt", "two.txt"] {
            folder.write(name, b"new").unwrap();
        }
        folder.keep().unwrap();
        assert_eq!(std::fs::read_to_string(path("far.txt")).unwrap(), "new");
        assert!(path("out/one.txt").is_symlink() && path("out/two.txt").is_symlink());
    }
}
