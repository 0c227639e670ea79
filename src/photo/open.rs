//! Photographs from elsewhere: PNG or JPEG, turned upright according to their EXIF.

use std::io::Cursor;
use std::path::Path;

use exif::{In, Tag};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::Photo;
use super::png::{checked_size, is_png, read_bounded, rgb8};
use crate::error::{Error, Result};

impl Photo {
    /// Reads a photo from a PNG or JPEG file: one of ours, with its scene, or a camera's.
    ///
    /// The header is checked before anything is decoded.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it is not a PNG or JPEG
    /// image, or too large.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_bounded(path)?;
        let photo = if is_png(&bytes) {
            Self::from_png(&bytes, path)?
        } else {
            Self::from_jpeg(&bytes, path)?
        };
        let exif = exif::Reader::new().read_from_container(&mut Cursor::new(&bytes)).ok();
        let orientation =
            exif.and_then(|exif| exif.get_field(Tag::Orientation, In::PRIMARY)?.value.get_uint(0));
        Ok(match orientation {
            Some(orientation @ 2..=8) => photo.upright(orientation),
            _ => photo,
        })
    }

    fn from_jpeg(bytes: &[u8], path: &Path) -> Result<Self> {
        let broken = |source: &dyn std::fmt::Display| {
            let hint = "name a photo: a PNG or JPEG file";
            Error::input(path.display().to_string(), source, "a PNG image or a JPEG photo", hint)
        };
        let options = DecoderOptions::default().set_strict_mode(false);
        let options = options.set_max_width(usize::MAX).set_max_height(usize::MAX);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
        decoder.decode_headers().map_err(|e| broken(&e))?;
        let (width, height) = decoder.dimensions().ok_or_else(|| broken(&"no size"))?;
        let [width_px, height_px] = [width, height].map(|px| u32::try_from(px).unwrap_or(u32::MAX));
        checked_size(path, width_px, height_px)?;
        let gray = decoder.input_colorspace() == Some(ColorSpace::Luma);
        let (levels, samples) = if gray { (ColorSpace::Luma, 1) } else { (ColorSpace::RGB, 3) };
        decoder.set_options(options.jpeg_set_out_colorspace(levels));
        let levels = decoder.decode().map_err(|e| broken(&e))?;
        Ok(Self { width_px, height_px, rgb8: rgb8(&levels, samples), scene_toml: None })
    }

    /// The photo turned by an orientation of EXIF, 2 to 8, and without its scene.
    fn upright(&self, orientation: u32) -> Self {
        let (w, h) = (self.width_px as usize, self.height_px as usize);
        let from = |x: usize, y: usize| match orientation {
            2 => (w - 1 - x, y),
            3 => (w - 1 - x, h - 1 - y),
            4 => (x, h - 1 - y),
            5 => (y, x),
            6 => (y, h - 1 - x),
            7 => (w - 1 - y, h - 1 - x),
            _ => (w - 1 - y, x),
        };
        let (width, height) = if orientation < 5 { (w, h) } else { (h, w) };
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let rgb8 = pixels.flat_map(|(x, y)| {
            let (x, y) = from(x, y);
            let start = 3 * (y * w + x);
            [self.rgb8[start], self.rgb8[start + 1], self.rgb8[start + 2]]
        });
        let rgb8 = rgb8.collect();
        let [width_px, height_px] = if orientation < 5 {
            [self.width_px, self.height_px]
        } else {
            [self.height_px, self.width_px]
        };
        Self { width_px, height_px, rgb8, scene_toml: None }
    }
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
    fn a_jpeg_is_read_and_turned_as_its_exif_says() {
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
    fn what_is_no_photo_is_refused_by_its_header() {
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
            (&huge, "20000x20000"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let error = Photo::read(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains(says), "{error}");
        }
    }

    #[test]
    fn every_orientation_is_turned_upright() {
        // Pixels 0 1 2 over 3 4 5.
        let rgb8 = (0..6).flat_map(|level| [level; 3]).collect();
        let photo = Photo { width_px: 3, height_px: 2, rgb8, scene_toml: None };
        for (orientation, wanted) in [
            (2, [2, 1, 0, 5, 4, 3]),
            (3, [5, 4, 3, 2, 1, 0]),
            (4, [3, 4, 5, 0, 1, 2]),
            (5, [0, 3, 1, 4, 2, 5]),
            (6, [3, 0, 4, 1, 5, 2]),
            (7, [5, 2, 4, 1, 3, 0]),
            (8, [2, 5, 1, 4, 0, 3]),
        ] {
            let upright = photo.upright(orientation);
            let levels: Vec<u8> = upright.rgb8.chunks(3).map(|pixel| pixel[0]).collect();
            assert_eq!(levels, wanted, "{orientation}");
            assert_eq!(upright.width_px, if orientation < 5 { 3 } else { 2 }, "{orientation}");
        }
    }
}
