//! Inputs such as files, pipes and devices, each opened once and read up to a limit.

#[cfg(not(target_family = "wasm"))]
use std::fs::File;
use std::io::{Read, Take};
use std::path::{Path, PathBuf};

use super::Text;
#[cfg(target_family = "wasm")]
use super::brought::File;
use crate::error::{Error, Result};
use crate::units::{KIB, MIB};

/// Maximum size of one kind of file that is read.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// Maximum size in bytes.
    pub bytes: u64,
    /// Kind of file, with its article, such as `a scene file`.
    pub what: &'static str,
    /// Advice for a larger file.
    pub hint: &'static str,
}

impl Limit {
    /// Opens a file as a stream that fails once more than the limit has been read.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be opened.
    pub fn open(self, path: &Path) -> Result<impl Read + use<>> {
        let file = File::open(path).map_err(|source| Error::read(path, source))?;
        Ok(Bounded { file: file.take(self.bytes + 1), limit: self })
    }

    /// Reads a whole file of at most the limit.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be read, or [`Error::Input`] if it is too large.
    pub fn read(self, path: &Path) -> Result<Vec<u8>> {
        let unreadable = |source| Error::read(path, source);
        let file = File::open(path).map_err(unreadable)?;
        // The capacity is reserved in advance, because a vector that grows by doubling can occupy
        // three times the file's size during its last reallocation.
        let expected = file.metadata().map_or(0, |metadata| metadata.len().min(self.bytes));
        let mut bytes = Vec::with_capacity(usize::try_from(expected).unwrap_or(0) + 1);
        file.take(self.bytes + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > self.bytes {
            return Err(Error::input(path.display(), self.beyond(), self.wanted(), self.hint));
        }
        Ok(bytes)
    }

    /// Reads the first `n_bytes` of a file, or all of a shorter file.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be read.
    pub fn beginning(self, path: &Path, n_bytes: usize) -> Result<Vec<u8>> {
        let mut head = Vec::with_capacity(n_bytes);
        let read = self.open(path)?.take(n_bytes as u64).read_to_end(&mut head);
        read.map(|_| head).map_err(|source| Error::read(path, source))
    }

    /// Reads a text file in any encoding of Unicode and with any line ends, which [`Text`] lists.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::read`], or [`Error::Input`] with the first invalid byte.
    pub fn read_text(self, path: &Path) -> Result<String> {
        let bytes = self.read(path)?;
        let text = Text::of_unicode(&bytes).into_owned();
        String::from_utf8(text).map_err(|broken| {
            let byte = broken.utf8_error().valid_up_to() + 1;
            let place = format!("byte {byte}");
            let wanted = "text in UTF-8 or UTF-16";
            Error::input(place, "no character", wanted, "save the file as UTF-8")
                .in_file(path.display(), None)
        })
    }

    /// Checks before reading that the total size of several files, including the files of folders,
    /// is within the limit. A link counts as the size of its target each time it is named.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with their total size.
    pub fn check_all<'a>(self, paths: impl IntoIterator<Item = &'a PathBuf>) -> Result<()> {
        let sizes = paths.into_iter().map(|path| n_bytes(path));
        let (n, sum) = sizes.fold((0, 0), |(n, sum), bytes| (n + 1, sum + bytes));
        if sum <= self.bytes {
            return Ok(());
        }
        let actual = format_args!("{n} of {} in total", size(sum));
        let wanted = format!("at most {} in total", size(self.bytes));
        Err(Error::input(self.what, actual, wanted, self.hint))
    }

    /// Returns the text for the value found in the error for a file above the limit.
    fn beyond(self) -> String {
        format!("more than {}", size(self.bytes))
    }

    /// Returns the text for the value wanted in the error for a file above the limit.
    fn wanted(self) -> String {
        format!("{} of at most {}", self.what, size(self.bytes))
    }
}

/// Returns the size in bytes of a file, or of all files in a folder. The size is 0 if it is
/// unknown, as for a pipe. Folders within the folder do not count.
fn n_bytes(path: &Path) -> u64 {
    fn n_file_bytes(path: &Path) -> u64 {
        let metadata = std::fs::metadata(path).ok();
        metadata.filter(std::fs::Metadata::is_file).map_or(0, |metadata| metadata.len())
    }
    if path.is_dir() {
        files_in(path).unwrap_or_default().iter().map(|path| n_file_bytes(path)).sum()
    } else {
        n_file_bytes(path)
    }
}

/// Returns the regular files of a folder, including links to them, sorted by name. Other entries
/// are skipped, because reading from a pipe could block the program forever.
///
/// # Errors
///
/// Returns [`Error::Io`] if the folder cannot be read.
pub fn files_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = entries_in(folder)?;
    paths.retain(|path| path.is_file());
    Ok(paths)
}

/// Returns the paths of all files and folders in a folder, sorted by name.
///
/// # Errors
///
/// Returns [`Error::Io`] if the folder cannot be read.
pub fn entries_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.map_err(|source| Error::read(folder, source))?;
    let mut paths: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    paths.sort();
    Ok(paths)
}

/// Returns a size as text in MiB, KiB or bytes, rounded down.
fn size(bytes: u64) -> String {
    match bytes {
        MIB.. => format!("{} MiB", bytes / MIB),
        KIB.. => format!("{} KiB", bytes / KIB),
        _ => format!("{bytes} bytes"),
    }
}

/// Stream that returns an error once its limit is exceeded.
struct Bounded {
    file: Take<File>,
    limit: Limit,
}

impl Read for Bounded {
    /// Reads into a buffer up to the limit. Returns an error if the file is longer.
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let n = self.file.read(buffer)?;
        if self.file.limit() == 0 && n > 0 {
            let what = format!("{}, wanted {}", self.limit.beyond(), self.limit.wanted());
            return Err(std::io::Error::new(std::io::ErrorKind::FileTooLarge, what));
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Limit = Limit { bytes: 2048, what: "a note", hint: "shorten it" };

    #[test]
    fn a_file_of_the_limit_is_read_and_one_byte_more_is_refused() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), [b'x'; 2048]).unwrap();
        assert_eq!(LIMIT.read_text(file.path()).unwrap().len(), 2048);
        let mut text = Vec::new();
        LIMIT.open(file.path()).unwrap().read_to_end(&mut text).unwrap();
        assert_eq!(text.len(), 2048);
        std::fs::write(file.path(), [b'x'; 2049]).unwrap();
        let error = LIMIT.read(file.path()).unwrap_err();
        assert!(error.to_string().contains("more than 2 KiB, wanted a note"), "{error}");
        assert_eq!(error.hint(), "shorten it");
        let streamed = LIMIT.open(file.path()).unwrap().read_to_end(&mut Vec::new()).unwrap_err();
        assert_eq!(streamed.kind(), std::io::ErrorKind::FileTooLarge);
    }

    #[test]
    fn files_count_together_also_in_folders_and_through_links() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("inner")).unwrap();
        std::fs::write(path("a"), [b'x'; 1000]).unwrap();
        std::fs::write(path("inner/b"), [b'x'; 1000]).unwrap();
        LIMIT.check_all(&[path("a"), path("inner"), path("missing")]).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("a", path("link")).unwrap();
        #[cfg(not(unix))]
        std::fs::copy(path("a"), path("link")).unwrap();
        let error =
            LIMIT.check_all(&[path("a"), path("inner"), path("link")]).unwrap_err().to_string();
        assert_eq!(error, "a note: found 3 of 2 KiB in total, wanted at most 2 KiB in total");
    }

    #[test]
    fn what_is_no_text_is_named_by_its_byte() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), b"ab\xff").unwrap();
        let error = LIMIT.read_text(file.path()).unwrap_err().to_string();
        assert!(error.contains("byte 3"), "{error}");
    }

    #[test]
    fn a_text_that_powershell_or_an_old_editor_wrote_is_the_same_text() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let utf16: Vec<u8> =
            "\u{feff}a = 'ψ'\r\nb\r\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        for bytes in [&utf16, "\u{feff}a = 'ψ'\r\nb\r\n".as_bytes(), "a = 'ψ'\rb\r".as_bytes()] {
            std::fs::write(file.path(), bytes).unwrap();
            let text = LIMIT.read_text(file.path()).unwrap();
            assert_eq!(text.lines().collect::<Vec<_>>(), ["a = 'ψ'", "b"], "{bytes:x?}");
        }
    }
}
