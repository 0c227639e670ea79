//! Photos from PNG and JPEG files, turned upright by their EXIF.

use std::io::{BufReader, Cursor, Read};
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::Photo;
use super::png::SCENE_KEYWORD;
use crate::camera::{MAX_PIXELS, check_size};
use crate::error::{Error, Result};

/// Largest image file: a photo of [`MAX_PIXELS`] without compression.
const MAX_FILE_BYTES: u64 = 4 * MAX_PIXELS;

impl Photo {
    /// Reads a photo from a PNG or JPEG file. One that Noctograph wrote has its scene.
    ///
    /// The header is checked before anything is decoded.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it is no PNG or JPEG
    /// image, or too large.
    pub fn read(path: &Path) -> Result<Self> {
        let unreadable = |source| Error::read(path, source);
        let place = || path.display().to_string();
        let broken = |source: &dyn std::fmt::Display| {
            Error::input(place(), source, "a PNG image or a JPEG photo", "choose another file")
        };
        let file = std::fs::File::open(path).map_err(unreadable)?;
        let mut bytes = Vec::new();
        file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            return Err(broken(&format!("more than {MAX_FILE_BYTES} bytes")));
        }
        let reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format();
        let reader = reader.map_err(unreadable)?;
        let format = reader.format();
        if !matches!(format, Some(ImageFormat::Png | ImageFormat::Jpeg)) {
            return Err(broken(&"no PNG or JPEG header"));
        }
        let mut decoder = reader.into_decoder().map_err(|e| broken(&e))?;
        let (width_px, height_px) = decoder.dimensions();
        check_size(width_px, height_px).map_err(|error| match error {
            Error::Input { found, wanted, .. } => {
                Error::input(place(), found, wanted, "scale the photo down")
            }
            other => other,
        })?;
        let orientation = decoder.orientation().map_err(|e| broken(&e))?;
        let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| broken(&e))?;
        picture.apply_orientation(orientation);
        let picture = picture.into_rgb8();
        let (width_px, height_px) = picture.dimensions();
        let scene_toml = scene(&bytes).filter(|_| format == Some(ImageFormat::Png));
        Ok(Self { width_px, height_px, rgb8: picture.into_raw(), scene_toml })
    }
}

/// The scene in a text chunk of a PNG file.
fn scene(png: &[u8]) -> Option<String> {
    let reader = png::Decoder::new(BufReader::new(Cursor::new(png))).read_info().ok()?;
    let mut texts = reader.info().utf8_text.iter();
    texts.find(|text| text.keyword == SCENE_KEYWORD)?.get_text().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A JPEG of 2 × 1 pixels, black and white, with an EXIF block that asks for a quarter turn.
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
    fn a_jpeg_is_turned_upright_by_its_exif() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.jpg");
        for (orientation, size, first) in [(1, (16, 8), 0), (3, (16, 8), 255), (6, (8, 16), 0)] {
            std::fs::write(&path, jpeg(orientation)).unwrap();
            let photo = Photo::read(&path).unwrap();
            assert_eq!((photo.width_px, photo.height_px), size, "orientation {orientation}");
            assert!(photo.rgb8[0].abs_diff(first) < 16, "orientation {orientation}");
        }
    }

    #[test]
    fn other_files_are_refused_by_their_header() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let mut huge = Vec::new();
        let encoder = png::Encoder::new(&mut huge, 20_000, 20_000);
        encoder.write_header().unwrap().write_chunk(png::chunk::IDAT, b"none").unwrap();
        let whole = jpeg(1);
        for (bytes, says) in [
            (&b"no image"[..], "JPEG"),
            (&b""[..], "JPEG"),
            (&whole[..30], "JPEG"),
            (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "PNG"),
            (&huge, "20000x20000"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = Photo::read(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains(says), "{error}");
        }
    }
}
