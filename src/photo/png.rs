//! Photos as PNG files, 8 bits a channel, with the scene that made them in a text chunk.

use std::io::{BufReader, Cursor, Read, Write};
use std::path::Path;

use super::Photo;
use crate::camera::{MAX_PIXELS, check_size};
use crate::error::{Error, Result};

/// Keyword of the text chunk that holds the scene file.
const SCENE_KEYWORD: &str = "noctograph.scene";

/// Largest image file that is read: a photo of [`MAX_PIXELS`] without compression, and some.
const MAX_FILE_BYTES: u64 = 4 * MAX_PIXELS;

impl Photo {
    /// Writes the photo as PNG: sRGB, fast compression, no time stamp.
    ///
    /// `notes` go into text chunks, keyword and text; the scene file follows them.
    ///
    /// # Errors
    ///
    /// What the writer says.
    pub fn write_png(&self, out: impl Write, notes: &[(&str, String)]) -> std::io::Result<()> {
        let mut encoder = png::Encoder::new(out, self.width_px, self.height_px);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fastest);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        for (keyword, text) in notes {
            encoder.add_itxt_chunk((*keyword).to_owned(), text.clone())?;
        }
        if let Some(scene) = &self.scene_toml {
            encoder.add_itxt_chunk(SCENE_KEYWORD.to_owned(), scene.clone())?;
        }
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb8)?;
        Ok(writer.finish()?)
    }

    /// Reads a photo from a PNG file, one of ours or any other.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it is no PNG image or
    /// too large.
    pub fn read_png(path: &Path) -> Result<Self> {
        let bytes = read_bounded(path)?;
        let broken = |source: &dyn std::fmt::Display| {
            let hint = "name a PNG image, such as the photo.png that `noctograph preview` writes";
            Error::input(path.display().to_string(), source, "a PNG image", hint)
        };
        let mut decoder = png::Decoder::new(BufReader::new(Cursor::new(&bytes)));
        let header = decoder.read_header_info().map_err(|e| broken(&e))?;
        let (width_px, height_px) = (header.width, header.height);
        check_size(width_px, height_px).map_err(|error| match error {
            Error::Input { found, wanted, .. } => {
                Error::input(path.display().to_string(), found, wanted, "scale the photo down")
            }
            other => other,
        })?;
        let format = image::ImageFormat::Png;
        let picture =
            image::load_from_memory_with_format(&bytes, format).map_err(|e| broken(&e))?;
        let reader = decoder.read_info().map_err(|e| broken(&e))?;
        let texts = &reader.info().utf8_text;
        let scene = texts.iter().find(|text| text.keyword == SCENE_KEYWORD);
        let scene_toml = scene.and_then(|text| text.get_text().ok());
        Ok(Self { width_px, height_px, rgb8: picture.into_rgb8().into_raw(), scene_toml })
    }
}

fn read_bounded(path: &Path) -> Result<Vec<u8>> {
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
        photo().write_png(&mut file, &[("Software", "noctograph".to_owned())]).unwrap();
        std::fs::write(&path, &file).unwrap();
        assert_eq!(Photo::read_png(&path).unwrap(), photo());
        assert!(!file.windows(4).any(|chunk| chunk == b"tIME"), "no time stamp");
    }

    #[test]
    fn what_is_no_image_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let mut file = Vec::new();
        photo().write_png(&mut file, &[]).unwrap();
        for broken in [&b"no image"[..], &[], &file[..20], &file[..file.len() / 2]] {
            std::fs::write(&path, broken).unwrap();
            let error = Photo::read_png(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains("a PNG image"), "{error}");
        }
    }
}
