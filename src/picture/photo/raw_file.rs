//! Raw files of cameras, and other formats that cannot be read, which are refused by name.

use noctograph_core::error::{Error, Result};

/// Signatures of file formats that cannot be read, where `.` stands for any byte. CR2, DNG, NEF and
/// ARW are TIFF files and can be read.
const RAW_FILES: [(&str, &[u8]); 12] = [
    ("JPEG XL", b"....JXL "),
    ("JPEG XL", b"\xff\x0a"),
    ("a video", b"....ftypqt"),
    ("Canon CR3", b"....ftypcrx "),
    ("Canon CRW", b"II......HEAPCCDR"),
    ("Fujifilm RAF", b"FUJIFILMCCD-RAW"),
    ("Minolta MRW", b"\0MRM"),
    ("Olympus ORF", b"IIRO"),
    ("Olympus ORF", b"IIRS"),
    ("Olympus ORF", b"MMOR"),
    ("Panasonic RW2", b"IIU\0"),
    ("Sigma X3F", b"FOVb"),
];

/// Returns [`Error::Input`] with the name of the format if a file is a raw file.
pub(super) fn refuse_raw(bytes: &[u8], place: &str) -> Result<()> {
    let raw = RAW_FILES.iter().find(|(_, signature)| {
        bytes.len() >= signature.len()
            && signature.iter().zip(bytes).all(|(wanted, byte)| [b'.', *byte].contains(wanted))
    });
    let Some((maker, _)) = raw else { return Ok(()) };
    let hint = "use the JPEG that the camera wrote together with the raw file, or export a JPEG \
                with its EXIF";
    Err(Error::input(place, format_args!("a raw file ({maker})"), "its JPEG", hint))
}
