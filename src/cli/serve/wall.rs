//! The wall: the newest photos that visitors hung up, and the folder that keeps all of them.

use std::collections::VecDeque;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Value, json};

use super::super::output::Output;
use crate::error::{Error, Result};
use noctograph_core::files::{Limit, files_in};

/// Photos that are shown.
const SHOWN: usize = 12;

const PHOTO: Limit =
    Limit { bytes: 64 << 20, what: "a photo of the wall", hint: "move it out of the gallery" };

#[derive(Clone, Debug)]
struct Photo {
    number: u32,
    word: String,
    png: Arc<[u8]>,
}

#[derive(Debug)]
pub(super) struct Wall {
    /// Where photos are kept as `0001-NOOR.png`; `None`: only as long as the program runs.
    gallery: Option<PathBuf>,
    newest: Mutex<VecDeque<Photo>>,
}

impl Wall {
    /// Opens a gallery, with the photos that hang in it.
    pub(super) fn open(gallery: Option<&Path>) -> Result<Self> {
        let mut newest = VecDeque::new();
        if let Some(folder) = gallery {
            std::fs::create_dir_all(folder).map_err(|source| Error::write(folder, source))?;
            let mut known: Vec<_> = files_in(folder)?.iter().filter_map(|p| numbered(p)).collect();
            known.sort();
            for (number, word, path) in known.split_off(known.len().saturating_sub(SHOWN)) {
                newest.push_back(Photo { number, word, png: PHOTO.read(&path)?.into() });
            }
        }
        Ok(Self { gallery: gallery.map(Path::to_owned), newest: Mutex::new(newest) })
    }

    /// Hangs up a photo and returns its number.
    pub(super) fn hang(&self, word: &str, png: Arc<[u8]>) -> Result<u32> {
        let mut newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        let number = newest.back().map_or(1, |photo| photo.number + 1);
        if let Some(folder) = &self.gallery {
            let name: String = word.chars().filter(char::is_ascii_alphanumeric).collect();
            let path = folder.join(format!("{number:04}-{name}.png"));
            Output::create(&path)?.keep(|out| out.write_all(&png))?;
        }
        newest.push_back(Photo { number, word: word.to_owned(), png });
        if newest.len() > SHOWN {
            newest.pop_front();
        }
        Ok(number)
    }

    /// Numbers and words of the newest photos, the newest first.
    pub(super) fn list(&self) -> Value {
        let newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = |photo: &Photo| json!({ "number": photo.number, "word": photo.word });
        newest.iter().rev().map(entry).collect()
    }

    /// A photo that is shown.
    pub(super) fn photo(&self, number: u32) -> Option<Arc<[u8]>> {
        let newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        newest.iter().find(|photo| photo.number == number).map(|photo| photo.png.clone())
    }
}

/// Number and word of a photo of the gallery: `0001-NOOR.png`.
fn numbered(path: &Path) -> Option<(u32, String, PathBuf)> {
    let (number, word) = path.file_name()?.to_str()?.strip_suffix(".png")?.split_once('-')?;
    Some((number.parse().ok()?, word.to_owned(), path.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gallery_is_opened_again_with_its_newest_photos() {
        let folder = tempfile::tempdir().unwrap();
        let wall = Wall::open(Some(folder.path())).unwrap();
        for n in 1..=SHOWN + 2 {
            let photo = vec![u8::try_from(n).unwrap()].into();
            assert_eq!(wall.hang("../ÄB c", photo).unwrap() as usize, n);
        }
        std::fs::write(folder.path().join("notes.txt"), "by hand").unwrap();
        assert!(folder.path().join("0014-Bc.png").is_file());
        let again = Wall::open(Some(folder.path())).unwrap();
        let list = again.list();
        assert_eq!((list.as_array().unwrap().len(), &list[0]["number"]), (SHOWN, &json!(14)));
        assert_eq!(again.photo(14).as_deref(), Some(&[14][..]));
        assert_eq!(again.photo(2), None);
        assert_eq!(again.hang("NOOR", vec![0].into()).unwrap(), 15);
    }
}
