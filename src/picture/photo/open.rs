//! Reads photos from PNG and JPEG files, and turns them upright according to their EXIF data.

use std::io::Cursor;
use std::path::Path;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::png::{LIMIT, Notes, checked_size, from_png, turned};
use super::raw_file::refuse_raw;
use super::{Photo, PhotoData};
use noctograph_core::camera::MAX_PIXELS;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::JpegFrame;

/// Maximum memory for decoding a JPEG file: that of the largest PNG with four 16-bit channels.
const MAX_BYTES: u64 = 8 * MAX_PIXELS;

/// Reads a photo from a PNG or JPEG file. The header is checked before anything is decoded.
///
/// # Errors
///
/// Returns [`Error::Io`] if the file cannot be read, and [`Error::Input`] if it is not a PNG or
/// JPEG image or is too large.
pub fn read(path: &Path) -> Result<Photo> {
    Ok(open(path, false)?.0)
}

/// Reads a photo like [`read`], and also the scene and the notes if Noctograph wrote the file.
///
/// # Errors
///
/// Returns the same errors as [`read`], and [`Error::Input`] if a text is damaged or too large.
pub fn read_with_notes(path: &Path) -> Result<(Photo, Notes)> {
    open(path, true)
}

/// Reads a photo, and also the texts of a PNG file if `texts` is true. Returns [`Error::Io`] for a
/// file that cannot be read, and [`Error::Input`] for one that is neither PNG nor JPEG.
fn open(path: &Path, texts: bool) -> Result<(Photo, Notes)> {
    let bytes = LIMIT.read(path)?;
    let broken = |source: &dyn std::fmt::Display| {
        Error::input(path.display(), source, "a PNG image or a JPEG photo", "choose another file")
    };
    match image::guess_format(&bytes) {
        Ok(ImageFormat::Png) => return from_png(&bytes, path, texts),
        Ok(ImageFormat::Jpeg) => {}
        _ => {
            refuse_raw(&bytes, &path.display().to_string())?;
            return Err(broken(&"no PNG or JPEG header"));
        }
    }
    check_memory(&bytes, path)?;
    let reader = ImageReader::with_format(Cursor::new(&bytes), ImageFormat::Jpeg);
    let mut decoder = reader.into_decoder().map_err(|e| broken(&e))?;
    let (width_px, height_px) = decoder.dimensions();
    checked_size(path, width_px, height_px)?;
    // A broken EXIF block is ignored.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let rgb8 = DynamicImage::from_decoder(decoder).map_err(|e| broken(&e))?.into_rgb8();
    let photo = PhotoData { width_px, height_px, rgb8: rgb8.into_raw(), scene_toml: None };
    Ok((Photo::new(turned(photo, orientation))?, Notes::default()))
}

/// Returns [`Error::Input`] for a JPEG file that is cut off, or that needs more memory than the
/// largest other photo.
fn check_memory(bytes: &[u8], path: &Path) -> Result<()> {
    // The decoder itself rejects a file without a frame.
    let Some(frame) = JpegFrame::parse(bytes) else { return Ok(()) };
    // The decoder keeps a copy of the file in memory.
    let needed = 2 * bytes.len() as u64 + frame.decoded_bytes();
    if needed > MAX_BYTES {
        let kind = if frame.progressive { "progressive " } else { "" };
        let [width, height] = frame.size_px;
        let photo =
            format!("a {kind}JPEG of {width}x{height} pixels, which takes {} MiB", needed >> 20);
        let wanted = format!("at most {} MiB", MAX_BYTES >> 20);
        let hint = "scale the photo down, or save the photo again as a baseline JPEG";
        return Err(Error::input(path.display(), photo, wanted, hint));
    }
    if !frame.has_end {
        let hint = "copy the whole file from the camera's card";
        return Err(Error::input(path.display(), "a truncated JPEG", "a whole photo", hint));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a black and white JPEG of 2 × 1 pixels with an EXIF orientation.
    fn jpeg(orientation: u8) -> Vec<u8> {
        let mut bytes = Vec::new();
        let gray: Vec<u8> = (0..16 * 8).map(|i| if i % 16 < 8 { 0 } else { 255 }).collect();
        let encoder = image::codecs::jpeg::JpegEncoder::new(&mut bytes);
        image::ImageEncoder::write_image(encoder, &gray, 16, 8, image::ExtendedColorType::L8)
            .unwrap();
        let exif = [
            b"Exif\0\0II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(),
            &[orientation, 0, 0, 0, 0, 0, 0, 0],
        ]
        .concat();
        let length = u16::try_from(exif.len() + 2).unwrap().to_be_bytes();
        let app1 = [&[0xff, 0xe1][..], &length, &exif].concat();
        bytes.splice(2..2, app1);
        bytes
    }

    #[test]
    fn a_jpeg_that_is_cut_off_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.jpg");
        let whole = jpeg(1);
        std::fs::write(&path, &whole[..whole.len() - 2]).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("truncated"));
    }

    #[test]
    fn a_jpeg_is_read_and_turned_as_its_exif_says() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.jpg");
        for (orientation, size, first) in [(1, (16, 8), 0), (3, (16, 8), 255), (6, (8, 16), 0)] {
            std::fs::write(&path, jpeg(orientation)).unwrap();
            let photo = read(&path).unwrap();
            assert_eq!((photo.width_px, photo.height_px), size, "orientation {orientation}");
            assert!(photo.rgb8[0].abs_diff(first) < 16, "orientation {orientation}");
        }
    }

    #[test]
    fn the_coefficients_of_a_progressive_photo_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.jpg");
        // Returns the header of an image of 8000 x 8000 pixels with four components in one scan.
        fn frame(marker: u8) -> Vec<u8> {
            let mut bytes = vec![0xff, 0xd8, 0xff, marker, 0, 20, 8, 0x1f, 0x40, 0x1f, 0x40, 4];
            (0..4).for_each(|id| bytes.extend([id, 0x11, 0]));
            bytes
        }
        std::fs::write(&path, frame(0xc2)).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("a progressive JPEG of 8000x8000 pixels"), "{error}");
        std::fs::write(&path, frame(0xc0)).unwrap();
        assert!(!read(&path).unwrap_err().to_string().contains("MiB"));
    }

    #[test]
    fn what_is_no_photo_is_refused_by_its_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let mut huge = Vec::new();
        let encoder = png::Encoder::new(&mut huge, 20_000, 20_000);
        encoder.write_header().unwrap().write_chunk(png::chunk::IDAT, b"none").unwrap();
        let whole = jpeg(1);
        for (bytes, says) in [
            (&b"no image"[..], "JPEG"),
            (b"FUJIFILMCCD-RAW 0201", "a raw file (Fujifilm RAF)"),
            (b"\xff\x0a\xfa", "JPEG XL"),
            (&b""[..], "JPEG"),
            (&whole[..30], "JPEG"),
            (&huge, "20000x20000"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains(says), "{error}");
        }
    }
}
