//! Photos as PNG files of 8 or 16 bits a channel, with EXIF, XMP, and the scene that made them in a
//! text chunk.

use std::io::{BufReader, Cursor, Read, Write};
use std::path::Path;

use super::{Metadata, Photo, Readout, Tone};
use crate::camera::{Camera, MAX_PIXELS, check_size};
use crate::error::{Error, Result};

/// Keyword of the text chunk that holds the scene file.
const SCENE_KEYWORD: &str = "noctograph.scene";

/// Keyword of the text chunk that holds XMP (PNG, third edition).
const XMP_KEYWORD: &str = "XML:com.adobe.xmp";

/// Largest image file that is read: a photo of [`MAX_PIXELS`] without compression, and some.
const MAX_FILE_BYTES: u64 = 4 * MAX_PIXELS;

/// Levels of a picture, red, green, blue by pixel.
#[derive(Clone, Copy, Debug)]
enum Levels<'a> {
    Eight(&'a [u8]),
    /// Two bytes a level, the higher first.
    Sixteen(&'a [u8]),
}

impl Photo {
    /// Writes the photo as PNG: 8 bits a channel, sRGB, fast compression, no time stamp.
    ///
    /// `notes` go into text chunks, keyword and text; the scene file follows them. With a camera,
    /// EXIF and XMP say how the picture was taken.
    ///
    /// # Errors
    ///
    /// What the writer says.
    pub fn write_png(
        &self,
        out: impl Write,
        camera: Option<&Camera>,
        notes: &[(&str, String)],
    ) -> std::io::Result<()> {
        let metadata = camera.map(|camera| Metadata::new(camera, &self.rgb8));
        let size_px = [self.width_px, self.height_px];
        let scene = self.scene_toml.as_deref();
        write(out, size_px, Levels::Eight(&self.rgb8), metadata.as_ref(), notes, scene)
    }

    /// Reads a photo from a PNG file, one of ours or any other.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it is no PNG image or
    /// too large.
    pub fn read_png(path: &Path) -> Result<Self> {
        Self::from_png(&read_bounded(path)?, path)
    }

    /// Reads the bytes of a PNG file.
    pub(super) fn from_png(bytes: &[u8], path: &Path) -> Result<Self> {
        let broken = |source: &dyn std::fmt::Display| {
            let hint = "name a PNG image, such as the photo.png that `noctograph preview` writes";
            Error::input(path.display().to_string(), source, "a PNG image", hint)
        };
        let mut decoder = png::Decoder::new(BufReader::new(Cursor::new(bytes)));
        decoder.set_limits(png::Limits { bytes: usize::MAX });
        decoder.set_transformations(png::Transformations::EXPAND);
        let header = decoder.read_header_info().map_err(|e| broken(&e))?;
        let (width_px, height_px) = (header.width, header.height);
        checked_size(path, width_px, height_px)?;
        let mut reader = decoder.read_info().map_err(|e| broken(&e))?;
        let mut levels = vec![0; reader.output_buffer_size().ok_or_else(|| broken(&"no size"))?];
        let frame = reader.next_frame(&mut levels).map_err(|e| broken(&e))?;
        if frame.bit_depth == png::BitDepth::Sixteen {
            let nearest = |pair: &[u8; 2]| (u32::from(u16::from_be_bytes(*pair)) + 128) / 257;
            let nearest = |pair| u8::try_from(nearest(pair)).expect("at most 255");
            levels = levels.as_chunks::<2>().0.iter().map(nearest).collect();
        }
        let texts = &reader.info().utf8_text;
        let scene = texts.iter().find(|text| text.keyword == SCENE_KEYWORD);
        let scene_toml = scene.and_then(|text| text.get_text().ok());
        let rgb8 = rgb8(&levels, frame.color_type.samples());
        Ok(Self { width_px, height_px, rgb8, scene_toml })
    }
}

/// Whether bytes begin as a PNG file.
pub(super) fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n")
}

/// Refuses an image that is too large, before it is decoded.
pub(super) fn checked_size(path: &Path, width_px: u32, height_px: u32) -> Result<()> {
    check_size(width_px, height_px).map_err(|error| match error {
        Error::Input { found, wanted, .. } => {
            Error::input(path.display().to_string(), found, wanted, "scale the photo down")
        }
        other => other,
    })
}

/// Red, green and blue of pixels with so many samples: gray, gray and alpha, RGB, or RGBA.
pub(super) fn rgb8(levels: &[u8], samples: usize) -> Vec<u8> {
    let pixels = levels.chunks_exact(samples);
    pixels.flat_map(|p| if samples < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] }).collect()
}

impl Readout {
    /// Writes the readout as PNG of 16 bits a channel, as [`develop`](super::develop) makes it at 8;
    /// the rest as [`Photo::write_png`].
    ///
    /// # Errors
    ///
    /// What the writer says.
    pub fn write_png16(
        &self,
        out: impl Write,
        tone: Tone,
        camera: &Camera,
        notes: &[(&str, String)],
        scene_toml: Option<&str>,
    ) -> std::io::Result<()> {
        let rgb16 = self.rgb16(tone);
        let bytes: Vec<u8> = rgb16.iter().flat_map(|level| level.to_be_bytes()).collect();
        let metadata = Metadata::new(camera, &bytes);
        let size_px = [self.width_px, self.height_px];
        write(out, size_px, Levels::Sixteen(&bytes), Some(&metadata), notes, scene_toml)
    }
}

fn write(
    out: impl Write,
    [width_px, height_px]: [u32; 2],
    levels: Levels<'_>,
    metadata: Option<&Metadata>,
    notes: &[(&str, String)],
    scene_toml: Option<&str>,
) -> std::io::Result<()> {
    let (depth, bytes) = match levels {
        Levels::Eight(bytes) => (png::BitDepth::Eight, bytes),
        Levels::Sixteen(bytes) => (png::BitDepth::Sixteen, bytes),
    };
    let mut info = png::Info::with_size(width_px, height_px);
    (info.color_type, info.bit_depth) = (png::ColorType::Rgb, depth);
    info.exif_metadata = metadata.map(|metadata| metadata.exif().into());
    let mut encoder = png::Encoder::with_info(out, info)?;
    encoder.set_compression(png::Compression::Fastest);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    if let Some(metadata) = metadata {
        encoder.add_itxt_chunk(XMP_KEYWORD.to_owned(), metadata.xmp())?;
    }
    for (keyword, text) in notes {
        encoder.add_itxt_chunk((*keyword).to_owned(), text.clone())?;
    }
    if let Some(scene) = scene_toml {
        encoder.add_itxt_chunk(SCENE_KEYWORD.to_owned(), scene.to_owned())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    Ok(writer.finish()?)
}

pub(super) fn read_bounded(path: &Path) -> Result<Vec<u8>> {
    let unreadable = |source| Error::read(path, source);
    let file = std::fs::File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let found = format!("more than {MAX_FILE_BYTES} bytes");
        let wanted = "a PNG image of at most that";
        return Err(Error::input(path.display().to_string(), found, wanted, "scale it down"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraOptions;

    fn photo() -> Photo {
        let rgb8 = (0..5 * 4 * 3).map(|i| u8::try_from(i * 4 % 251).unwrap()).collect();
        let scene_toml = Some("seed = 7 # ψ\n".to_owned());
        Photo { width_px: 5, height_px: 4, rgb8, scene_toml }
    }

    #[test]
    fn a_photo_reads_back_with_its_scene() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let mut file = Vec::new();
        photo().write_png(&mut file, None, &[("Software", "noctograph".to_owned())]).unwrap();
        std::fs::write(&path, &file).unwrap();
        assert_eq!(Photo::read_png(&path).unwrap(), photo());
        assert!(!file.windows(4).any(|chunk| chunk == b"tIME"), "no time stamp");
    }

    #[test]
    fn a_photo_says_how_it_was_taken_at_8_and_16_bits() {
        let camera = CameraOptions::default().camera([0.0, 0.5, 1.0, 1.0], 46.0).unwrap();
        let mut eight = Vec::new();
        photo().write_png(&mut eight, Some(&camera), &[]).unwrap();
        let rgb = (0..5 * 4 * 3).map(|i| i as f32 / 59.0).collect();
        let readout = Readout { width_px: 5, height_px: 4, rgb, white_lx_s: 0.78 };
        let mut sixteen = Vec::new();
        readout.write_png16(&mut sixteen, Tone::Linear, &camera, &[], Some("seed = 7")).unwrap();
        for file in [eight, sixteen] {
            let mut reader = png::Decoder::new(Cursor::new(&file)).read_info().unwrap();
            let exif = reader.info().exif_metadata.clone().unwrap();
            let exif = exif::Reader::new().read_raw(exif.into_owned()).unwrap();
            let exposure = exif.get_field(exif::Tag::ExposureTime, exif::In::PRIMARY).unwrap();
            assert_eq!(exposure.display_value().to_string(), "46");
            let xmp = reader.info().utf8_text.iter().find(|text| text.keyword == XMP_KEYWORD);
            assert!(xmp.unwrap().get_text().unwrap().contains("algorithmicMedia"));
            assert!(!file.windows(4).any(|chunk| chunk == b"tIME"), "no time stamp");
            if reader.info().bit_depth == png::BitDepth::Sixteen {
                let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
                reader.next_frame(&mut bytes).unwrap();
                let levels: Vec<u16> =
                    bytes.chunks(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
                assert_eq!(levels, readout.rgb16(Tone::Linear));
                assert_eq!((levels[0], levels[59]), (0, 65535));
            }
        }
    }

    #[test]
    fn what_is_no_image_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let mut file = Vec::new();
        photo().write_png(&mut file, None, &[]).unwrap();
        for broken in [&b"no image"[..], &[], &file[..20], &file[..file.len() / 2]] {
            std::fs::write(&path, broken).unwrap();
            let error = Photo::read_png(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains("a PNG image"), "{error}");
        }
    }
}
