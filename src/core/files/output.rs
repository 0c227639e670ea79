//! Output file that is opened before time-consuming work, and appears completely or not at all.

use std::fs::{File, Permissions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::staging::{Former, Place, file_in, folder, locked_soon};
use crate::digest::{Digest, Digested};
use crate::error::{Error, Result};
use crate::input_error;

/// Name that represents standard output in place of a file.
pub const STANDARD_OUTPUT: &str = "-";

/// Paths that mean standard output. They are not opened, because opening standard output again
/// would overwrite a file to which it is redirected.
const STANDARD_OUTPUTS: [&str; 4] =
    [STANDARD_OUTPUT, "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

/// Maximum number of symbolic links that are followed in a row.
const MAX_LINKS: usize = 40;

/// Size in bytes of the buffer through which a file is written.
pub(super) const BUFFER_BYTES: usize = 1 << 18;

/// Output file that is being written.
///
/// A regular file is written under a temporary name in the same folder until [`Output::keep`] gives
/// it its final name. If the path is a link, the link's target is replaced. Devices and pipes are
/// written to directly. The path `-` is standard output.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    sink: Sink,
}

/// Care that is taken of a file's content.
#[derive(Clone, Copy, PartialEq)]
enum Durability {
    /// The content may still be in the system's cache when the file receives its name.
    Cached,
    /// The content is synced to the disk, and its digest is computed, for a file to which other
    /// files refer.
    Synced,
}

#[derive(Debug)]
enum Sink {
    StandardOutput,
    Through(File),
    Staged { file: NamedTempFile, place: PathBuf, permissions: Option<Permissions> },
}

impl Output {
    /// Opens a file in an existing folder, or standard output or a device for their names.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] if the folder does not exist. Returns [`Error::Io`] if the path is
    /// itself a folder or is not writable.
    pub fn create(path: &Path) -> Result<Self> {
        let sink = Sink::open(path).map_err(|source| {
            missing_folder(path, &source).unwrap_or_else(|| Error::write(path, source))
        })?;
        Ok(Self { path: path.to_owned(), sink })
    }

    /// True for a regular file, false for a device, a pipe or standard output.
    pub fn is_staged(&self) -> bool {
        matches!(self.sink, Sink::Staged { .. })
    }

    /// Writes the content, gives the file its final name, and returns its path.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`]. If there is an error, a regular file is left unchanged.
    pub fn keep(self, content: impl AsRef<[u8]>) -> Result<PathBuf> {
        self.keep_with(|out| out.write_all(content.as_ref()))
    }

    /// Does the same as [`Self::keep`] with content that `write` produces piece by piece.
    pub fn keep_with(self, write: impl FnOnce(&mut Buffer<'_>) -> Written) -> Result<PathBuf> {
        self.finish(write, Durability::Cached)?.keep()
    }

    /// Does the same as [`Self::keep`], but syncs the content before the file has its final name.
    pub fn keep_on_disk(self, content: impl AsRef<[u8]>) -> Result<PathBuf> {
        self.write_with(|out| out.write_all(content.as_ref()))?.keep()
    }

    /// Writes and syncs the content that `write` produces, without giving the file its final name.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`]. If there is an error, a regular file is left unchanged.
    pub fn write_with(self, write: impl FnOnce(&mut Buffer<'_>) -> Written) -> Result<WholeFile> {
        self.finish(write, Durability::Synced)
    }

    /// Writes the content with `write` to standard output, to a device, or to a staged file. A
    /// staged file also receives the permissions of the file that it replaces, but not its final
    /// name.
    fn finish(
        self,
        write: impl FnOnce(&mut Buffer<'_>) -> Written,
        durability: Durability,
    ) -> Result<WholeFile> {
        let is_durable = durability == Durability::Synced;
        let Self { mut path, sink } = self;
        let mut staged = None;
        let written = match sink {
            Sink::StandardOutput => {
                path = STANDARD_OUTPUT.into();
                match write_buffered(&mut std::io::stdout().lock(), write, is_durable) {
                    // A pipe that its reader, such as `head`, has closed is not an error.
                    Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {
                        Ok(String::new())
                    }
                    written => written,
                }
            }
            Sink::Through(mut file) => write_buffered(&mut file, write, is_durable),
            Sink::Staged { mut file, place, permissions } => {
                let written = write_buffered(file.as_file_mut(), write, is_durable);
                let written = written.and_then(|sha256| {
                    permissions.map_or(Ok(()), |p| file.as_file().set_permissions(p))?;
                    if is_durable { file.as_file().sync_all() } else { Ok(()) }.map(|()| sha256)
                });
                staged = Some((file, place));
                written
            }
        };
        match written {
            Ok(sha256) => Ok(WholeFile { path, sha256, staged }),
            Err(source) => Err(Error::write(&path, source)),
        }
    }
}

/// Writer for the content of a file.
pub type Buffer<'a> = BufWriter<Digested<&'a mut dyn Write>>;

type Written = std::io::Result<()>;

/// Completely written file that does not have its final name yet.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    sha256: String,
    staged: Option<(NamedTempFile, PathBuf)>,
}

impl WholeFile {
    /// Returns the file's name without its folder.
    pub fn name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the file's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the SHA-256 of the content in hexadecimal, or an empty text if it was not computed.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Gives the file its final name, and returns its path. The path of standard output is its
    /// name.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`]. If there is an error, an existing file is left unchanged.
    pub fn keep(self) -> Result<PathBuf> {
        let Self { path, staged, .. } = self;
        let named = staged.map_or(Ok(()), |(file, place)| file.persist(place).map(drop));
        match named {
            Ok(()) => Ok(path),
            Err(error) => Err(Error::write(&path, error.error)),
        }
    }

    /// Returns the regular file that this one replaces, or `None` for a device, a pipe or a socket.
    pub(super) fn place(&self) -> Option<&Path> {
        self.staged.as_ref().map(|(_, place)| place.as_path())
    }

    /// Gives files of one folder their final names while it is locked, and returns their paths.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::keep`]. If there is an error, all files are left unchanged.
    pub fn keep_all(files: Vec<Self>) -> Result<Vec<PathBuf>> {
        let _lock = files.iter().find_map(Self::place).and_then(|place| locked_soon(folder(place)));
        let mut former = Former::default();
        let named = files.into_iter().map(|file| {
            let place = file.place().map(Path::to_owned);
            former.replace(place, || file.keep())
        });
        let named = named.collect::<Result<Vec<_>>>()?;
        former.forget();
        Ok(named)
    }
}

impl Sink {
    /// Opens standard output, a device, or a staged file beside its final place, and returns the
    /// errors of the system.
    fn open(path: &Path) -> std::io::Result<Self> {
        if STANDARD_OUTPUTS.iter().any(|name| path == Path::new(name)) {
            return Ok(Self::StandardOutput);
        }
        if path.file_name().is_none() {
            return Err(std::io::ErrorKind::IsADirectory.into());
        }
        // Links are followed, so that the file is staged beside the link's target.
        let permissions = match Place::for_path(path)? {
            Place::Through(file) => return Ok(Self::Through(file)),
            Place::Regular(permissions) => permissions,
        };
        let place = followed(path)?;
        let file = file_in(folder(&place))?;
        Ok(Self::Staged { file, place, permissions })
    }
}

/// Returns the error for a file whose folder is missing, or `None` if `source` has another cause.
fn missing_folder(path: &Path, source: &std::io::Error) -> Option<Error> {
    // For a link, the folder of its target must exist.
    let place = followed(path).ok()?;
    let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    let is_missing = source.kind() == std::io::ErrorKind::NotFound && !folder.exists();
    let folder = folder.display();
    is_missing.then(|| {
        input_error!(
            path.display(),
            "no folder {folder}",
            "a folder that exists",
            "make the folder {folder} first, or choose another folder",
        )
    })
}

/// Returns the path that a link leads to, existing or not. Other paths are returned unchanged.
/// Returns an error after [`MAX_LINKS`] links.
fn followed(path: &Path) -> std::io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match std::fs::read_link(&path) {
            Ok(to) => path = path.parent().unwrap_or(Path::new("")).join(to),
            Err(_) => return Ok(path),
        }
    }
    Err(std::io::Error::other("a cycle of symbolic links"))
}

/// Writes a file with `write`. If `is_digested`, returns the file's SHA-256 in hexadecimal, and
/// otherwise an empty text. The digest is optional because computing it for a photograph takes a
/// twelfth of the total time.
fn write_buffered(
    file: &mut dyn Write,
    write: impl FnOnce(&mut Buffer<'_>) -> Written,
    is_digested: bool,
) -> std::io::Result<String> {
    let to = Digested { to: file, digest: is_digested.then(Digest::default) };
    let mut out = BufWriter::with_capacity(BUFFER_BYTES, to);
    let written = write(&mut out).and_then(|()| out.flush());
    // The writer is taken apart, because dropping it after a failure would flush the buffer again.
    let (digested, _) = out.into_parts();
    written.map(|()| digested.digest.map_or_else(String::new, Digest::hex))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(path: &Path) -> String {
        std::fs::read_to_string(path).unwrap()
    }

    fn write(path: &Path, content: &[u8]) -> Result<PathBuf> {
        Output::create(path)?.keep(content)
    }

    #[test]
    fn a_file_that_failed_is_not_there_and_the_old_one_is() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("plan.csv");
        std::fs::write(&path, "old").unwrap();
        let failed = Output::create(&path).unwrap().keep_with(|out| {
            out.write_all(b"half")?;
            Err(std::io::ErrorKind::StorageFull.into())
        });
        assert!(failed.is_err());
        assert_eq!(text(&path), "old");
        assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 1, "nothing half-written");
    }

    #[test]
    fn the_next_run_removes_what_a_killed_one_left_and_nothing_else() {
        let parent = tempfile::tempdir().unwrap();
        let path = |name: &str| parent.path().join(name);
        std::fs::write(path(".noctograph-killed.tmp"), "half").unwrap();
        std::fs::create_dir_all(path(".noctograph-killed-2.tmp/inner")).unwrap();
        std::fs::write(path(".noctograph-notes.txt"), "mine").unwrap();
        let living = Output::create(&path("other.csv")).unwrap();
        write(&path("plan.csv"), b"new").unwrap();
        assert!(!path(".noctograph-killed.tmp").exists(), "left by a kill");
        assert!(cfg!(not(unix)) || !path(".noctograph-killed-2.tmp").exists(), "a folder");
        assert!(path(".noctograph-notes.txt").exists(), "a file of the user's");
        living.keep(b"whole").unwrap();
        assert_eq!(text(&path("other.csv")), "whole", "another run's file is not taken away");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed_and_a_file_keeps_its_mode() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let parent = tempfile::tempdir().unwrap();
        let path = |name: &str| parent.path().join(name);
        std::fs::create_dir(path("far")).unwrap();
        std::fs::write(path("far/plan.csv"), "old").unwrap();
        let mode = |name: &str| std::fs::metadata(path(name)).unwrap().permissions().mode() & 0o777;
        std::fs::set_permissions(path("far/plan.csv"), PermissionsExt::from_mode(0o640)).unwrap();
        symlink("far/plan.csv", path("plan.csv")).unwrap();
        symlink("far/new.csv", path("new.csv")).unwrap();
        write(&path("plan.csv"), b"new").unwrap();
        write(&path("new.csv"), b"new").unwrap();
        assert!(path("plan.csv").is_symlink() && path("new.csv").is_symlink(), "they stay links");
        assert_eq!(
            (text(&path("far/plan.csv")), text(&path("far/new.csv"))),
            ("new".into(), "new".into())
        );
        assert_eq!(mode("far/plan.csv"), 0o640);
        std::fs::write(path("plain"), "").unwrap();
        assert_eq!(mode("far/new.csv"), mode("plain"), "the umask's mode");
        symlink("b", path("a")).unwrap();
        symlink("a", path("b")).unwrap();
        assert!(write(&path("a"), b"").is_err(), "a circle");
    }

    /// Two writers each write a pair of files, while a third process holds the folder's lock for
    /// longer than they wait.
    #[test]
    fn files_that_belong_together_are_of_one_writer() {
        let parent = tempfile::tempdir().unwrap();
        let names = ["plan.csv", "plan.scene.toml"].map(|name| parent.path().join(name));
        let write = |writer: &str| {
            let outputs = names.each_ref().map(|path| Output::create(path).unwrap());
            let whole = outputs.map(|it| it.write_with(|out| out.write_all(writer.as_bytes())));
            let whole = whole.map(Result::unwrap);
            assert_eq!(whole[0].sha256(), crate::digest::sha256(writer.as_bytes()));
            assert_eq!(WholeFile::keep_all(whole.into()).unwrap(), names);
        };
        for round in 0..50 {
            std::thread::scope(|scope| {
                for writer in ["a", "bb"] {
                    scope.spawn(move || write(writer));
                }
            });
            assert_eq!(text(&names[0]), text(&names[1]), "round {round}");
        }
        let folder = File::open(parent.path()).unwrap();
        folder.lock().unwrap();
        write("c");
        assert_eq!(text(&names[1]), "c");
    }

    #[test]
    fn where_one_of_several_files_gets_no_name_all_are_as_they_were() {
        let parent = tempfile::tempdir().unwrap();
        let names = ["old.csv", "new.csv", "taken.csv"].map(|name| parent.path().join(name));
        std::fs::write(&names[0], "old").unwrap();
        let outputs = names.each_ref().map(|path| Output::create(path).unwrap());
        let whole = outputs.map(|it| it.write_with(|out| out.write_all(b"new")).unwrap());
        std::fs::create_dir(&names[2]).unwrap();
        assert!(WholeFile::keep_all(whole.into()).is_err());
        assert_eq!((text(&names[0]), names[1].exists()), ("old".to_owned(), false));
        let left = std::fs::read_dir(parent.path()).unwrap().count();
        assert_eq!(left, 2, "old.csv and the folder that stood in the way");
    }

    #[test]
    fn a_folder_that_is_missing_is_named() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new/deep");
        let error = write(&folder.join("x.csv"), b"").unwrap_err();
        let missing = format!("no folder {}", folder.display());
        assert!(error.to_string().contains(&missing), "{error}");
        assert!(error.hint().contains(folder.to_str().unwrap()), "{}", error.hint());
        assert!(!parent.path().join("new").exists(), "no folder is made");
        assert!(write(&parent.path().join("x.csv"), b"").is_ok());
    }

    #[test]
    fn a_folder_is_no_file() {
        let parent = tempfile::tempdir().unwrap();
        assert!(Output::create(parent.path()).is_err());
        assert!(Output::create(Path::new("/")).is_err());
    }
}
