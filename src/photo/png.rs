//! Photos as PNG files of 8 or 16 bits a channel, with EXIF, XMP and a text chunk of the scene.

use std::io::{BufReader, Cursor, Write};
use std::path::Path;

use super::{Metadata, Photo, Readout, Tone};
use crate::camera::{Camera, MAX_PIXELS, check_size};
use crate::error::{Error, Result};
use crate::files::Limit;

/// Keyword of the text chunk of the scene.
const SCENE_KEYWORD: &str = "noctograph.scene";

/// Keyword of the text chunk of XMP (PNG, third edition).
const XMP_KEYWORD: &str = "XML:com.adobe.xmp";

/// Largest image file: a photo of [`MAX_PIXELS`] without compression.
pub(super) const LIMIT: Limit =
    Limit { bytes: 4 * MAX_PIXELS, what: "a photo", hint: "scale the photo down" };

impl Photo {
    /// Writes the photo as PNG: 8 bits a channel, sRGB, fast compression, no time stamp.
    ///
    /// `notes`, pairs of keyword and text, and the scene become text chunks. With a camera, the file
    /// has its EXIF and XMP.
    ///
    /// # Errors
    ///
    /// Those of the writer.
    pub fn write_png(
        &self,
        out: impl Write,
        camera: Option<&Camera>,
        notes: &[(&str, String)],
    ) -> std::io::Result<()> {
        let metadata = camera.map(|camera| Metadata::new(camera, &self.rgb8));
        let size_px = [self.width_px, self.height_px];
        let scene = self.scene_toml.as_deref();
        let levels = (png::BitDepth::Eight, &*self.rgb8);
        write(out, size_px, levels, metadata.as_ref(), notes, scene)
    }

    /// Reads the bytes of a PNG file.
    pub(super) fn from_png(bytes: &[u8], path: &Path) -> Result<Self> {
        let broken = |source: &dyn std::fmt::Display| {
            Error::input(path.display().to_string(), source, "a PNG image", "choose another file")
        };
        let mut decoder = png::Decoder::new(BufReader::new(Cursor::new(bytes)));
        let header = decoder.read_header_info().map_err(|e| broken(&e))?;
        let (width_px, height_px) = (header.width, header.height);
        checked_size(path, width_px, height_px)?;
        let picture = image::load_from_memory_with_format(bytes, image::ImageFormat::Png);
        let rgb8 = picture.map_err(|e| broken(&e))?.into_rgb8().into_raw();
        let reader = decoder.read_info().map_err(|e| broken(&e))?;
        let texts = &reader.info().utf8_text;
        let scene = texts.iter().find(|text| text.keyword == SCENE_KEYWORD);
        let scene_toml = scene.and_then(|text| text.get_text().ok());
        Ok(Self { width_px, height_px, rgb8, scene_toml })
    }
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

impl Readout {
    /// Writes the readout as PNG of 16 bits a channel, as [`develop`](super::develop) makes it at 8;
    /// the rest as [`Photo::write_png`].
    ///
    /// # Errors
    ///
    /// Those of the writer.
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
        let levels = (png::BitDepth::Sixteen, &*bytes);
        write(out, size_px, levels, Some(&metadata), notes, scene_toml)
    }
}

fn write(
    out: impl Write,
    [width_px, height_px]: [u32; 2],
    (depth, bytes): (png::BitDepth, &[u8]),
    metadata: Option<&Metadata>,
    notes: &[(&str, String)],
    scene_toml: Option<&str>,
) -> std::io::Result<()> {
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
        assert_eq!(Photo::read(&path).unwrap(), photo());
        assert!(!file.windows(4).any(|chunk| chunk == b"tIME"), "no time stamp");
    }

    #[test]
    fn exif_and_xmp_are_in_files_of_8_and_16_bits() {
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
            let error = Photo::read(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains("a PNG image"), "{error}");
        }
    }
}
