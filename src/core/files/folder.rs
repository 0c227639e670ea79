//! Output folder whose files all appear at the same time.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::output::{Buffer, Output, STANDARD_OUTPUT, WholeFile};
use super::staging::{folder_in, locked};
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
    /// The written files, in the order of writing.
    files: Vec<WholeFile>,
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
        let (path, files, former) = (path.to_owned(), Vec::new(), Vec::new());
        Ok(Self { path, staging, lock, made, files, first: 0, former })
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
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::write_with`].
    pub fn write(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<String> {
        self.write_with(name, |out| out.write_all(content.as_ref()))
    }

    /// Stages the file that receives its final name before all others. That file lists the others,
    /// so that a reader sees which files are missing if the program is killed between two renames.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::write_with`].
    pub fn write_first(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<()> {
        self.first = self.files.len();
        self.write(name, content).map(drop)
    }

    /// Stages a file that will be called `name`, with content from `write`, and returns its SHA-256
    /// in hexadecimal.
    /// A device, a pipe or a socket of that name is written to directly.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the name is that of a folder or is not writable.
    pub fn write_with(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut Buffer<'_>) -> std::io::Result<()>,
    ) -> Result<String> {
        let output = Output::create_in(self.staging.path(), &self.path.join(name))?;
        // The lock of the staging folder replaces that of the file.
        let file = output.write_with(write)?.closed();
        let sha256 = file.sha256().to_owned();
        self.files.push(file);
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
    /// Returns [`Error::Io`]. If there is an error, all files are left unchanged.
    pub fn keep(mut self) -> Result<Vec<PathBuf>> {
        self.made = false;
        let _lock = locked(&self.path);
        let mut files = std::mem::take(&mut self.files);
        let n_moved = files.len().min(self.first + 1);
        files[..n_moved].rotate_right(n_moved.min(1));
        let mut paths = WholeFile::rename_all(files)?;
        paths[..n_moved].rotate_left(n_moved.min(1));
        // All files now have their final names, so files of an earlier set can be removed.
        for path in &self.former {
            std::fs::remove_file(path).map_err(|source| Error::write(path, source))?;
        }
        Ok(paths)
    }
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

    /// Two writers write 200 files each. Finally, the folder contains the complete set of one of
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
        folder.write("a.txt", b"new").unwrap();
        let error = folder.write("b.txt", b"new").unwrap_err().to_string();
        assert!(error.contains("b.txt"), "{error}");
        drop(folder);
        // A name that is taken later is refused by the rename, which takes the others back.
        let mut folder = OutputFolder::create(parent.path()).unwrap();
        for name in ["a.txt", "c.txt"] {
            folder.write(name, b"new").unwrap();
        }
        std::fs::create_dir(parent.path().join("c.txt")).unwrap();
        assert!(folder.keep().unwrap_err().to_string().contains("c.txt"));
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
