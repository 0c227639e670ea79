//! Files that a verb writes: opened before the long work, and whole or not at all.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempDir};

use crate::error::{Error, Result};

/// A file under a temporary name beside its place, until it is kept.
#[derive(Debug)]
pub(super) struct Output {
    path: PathBuf,
    file: NamedTempFile,
}

impl Output {
    /// Opens a file beside `path`, in a folder that exists.
    pub(super) fn create(path: &Path) -> Result<Self> {
        let unwritable = |source| Error::write(path, source);
        if path.is_dir() || path.file_name().is_none() {
            return Err(unwritable(std::io::ErrorKind::IsADirectory.into()));
        }
        let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let mut builder = tempfile::Builder::new();
        builder.prefix(".noctograph-");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder.unwrap_or(Path::new("."))).map_err(unwritable)?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Writes the content and gives the file its name.
    pub(super) fn keep(
        self,
        write: impl FnOnce(&mut BufWriter<&std::fs::File>) -> std::io::Result<()>,
    ) -> Result<PathBuf> {
        let mut out = BufWriter::with_capacity(1 << 18, self.file.as_file());
        let written = write(&mut out).and_then(|()| out.flush());
        written.map_err(|source| Error::write(&self.path, source))?;
        drop(out);
        self.file.persist(&self.path).map_err(|e| Error::write(&self.path, e.error))?;
        Ok(self.path)
    }
}

/// Whether a path names an SVG drawing.
pub(super) fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("svg"))
}

/// A folder of files that appear together.
#[derive(Debug)]
pub(super) struct OutputFolder {
    path: PathBuf,
    /// Folder inside it that holds the files until all are written.
    staging: TempDir,
    /// Whether the folder is new, and removed again unless the files are kept.
    made: bool,
}

impl OutputFolder {
    /// Opens a folder, making it where it does not exist.
    pub(super) fn create(path: &Path) -> Result<Self> {
        let unwritable = |source| Error::write(path, source);
        let made = !path.exists();
        std::fs::create_dir_all(path).map_err(unwritable)?;
        let staging = tempfile::Builder::new().prefix(".noctograph-").tempdir_in(path);
        Ok(Self { path: path.to_owned(), staging: staging.map_err(unwritable)?, made })
    }

    /// Writes a file that will be called `name`.
    pub(super) fn write(
        &self,
        name: &str,
        write: impl FnOnce(&mut BufWriter<std::fs::File>) -> std::io::Result<()>,
    ) -> Result<()> {
        let file = std::fs::File::create(self.staging.path().join(name));
        let written = file.and_then(|file| {
            let mut out = BufWriter::with_capacity(1 << 18, file);
            write(&mut out)?;
            out.flush()
        });
        written.map_err(|source| Error::write(&self.path.join(name), source))
    }

    /// Gives all files their names, in the order named.
    pub(super) fn keep(mut self, names: &[impl AsRef<Path>]) -> Result<Vec<PathBuf>> {
        self.made = false;
        names
            .iter()
            .map(|name| {
                let path = self.path.join(name);
                std::fs::rename(self.staging.path().join(name), &path)
                    .map_err(|source| Error::write(&path, source))?;
                Ok(path)
            })
            .collect()
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        if self.made {
            // A folder that holds other files by now stays.
            let _ = std::fs::remove_dir_all(self.staging.path());
            let _ = std::fs::remove_dir(&self.path);
        }
    }
}

/// Files of one kind, one for each drone: a file, or numbered files in a folder.
#[derive(Debug)]
pub(super) enum Outputs {
    One(Output),
    Several(OutputFolder, &'static str),
}

impl Outputs {
    /// Opens `path`, or by default `kind.csv` or the folder `kinds`.
    pub(super) fn create(path: Option<&Path>, kind: &'static str, n: usize) -> Result<Self> {
        let path = |default: String| path.map_or_else(|| default.into(), Path::to_owned);
        Ok(match n {
            1 => Self::One(Output::create(&path(format!("{kind}.csv")))?),
            _ => Self::Several(OutputFolder::create(&path(format!("{kind}s")))?, kind),
        })
    }

    /// Writes all.
    pub(super) fn keep<T>(
        self,
        items: &[T],
        write: impl Fn(&T, &mut dyn Write) -> std::io::Result<()>,
    ) -> Result<Vec<PathBuf>> {
        match self {
            Self::One(file) => Ok(vec![file.keep(|out| write(&items[0], out))?]),
            Self::Several(folder, kind) => {
                let names = (1..=items.len()).map(|n| format!("{kind}-{n}.csv"));
                let names: Vec<String> = names.collect();
                for (item, name) in items.iter().zip(&names) {
                    folder.write(name, |out| write(item, out))?;
                }
                folder.keep(&names)
            }
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
        let folder = OutputFolder::create(&path).unwrap();
        folder.write("one.txt", |out| out.write_all(b"1")).unwrap();
        assert!(!path.join("one.txt").exists(), "not yet");
        folder.keep(&["one.txt"]).unwrap();
        assert_eq!(std::fs::read(path.join("one.txt")).unwrap(), b"1");
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 1, "and nothing else");
    }

    #[test]
    fn a_folder_that_nothing_came_of_is_gone() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        let folder = OutputFolder::create(&path).unwrap();
        folder.write("one.txt", |out| out.write_all(b"1")).unwrap();
        drop(folder);
        assert!(!path.exists(), "the folder that was made for it went with it");
    }

    #[test]
    fn a_file_that_failed_is_not_there_and_the_old_one_is() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("plan.csv");
        std::fs::write(&path, "old").unwrap();
        let failed = Output::create(&path).unwrap().keep(|out| {
            out.write_all(b"half")?;
            Err(std::io::ErrorKind::StorageFull.into())
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 1, "nothing half-written");
    }
}
