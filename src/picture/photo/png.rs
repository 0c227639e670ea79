//! Photos as PNG files of 8 or 16 bits per channel, with EXIF, XMP and the scene as a text chunk.

use std::io::Cursor;
use std::path::Path;

use image::DynamicImage;
use image::metadata::Orientation;

use super::strips::idat_chunks;
use super::{Metadata, Photo, PhotoData, Readout, Tone};
use noctograph_core::camera::{Camera, MAX_PIXELS, check_size};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

const SCENE_KEYWORD: &str = "noctograph.scene";

/// Keyword of the text that contains the gaps in flight logs, as JSON.
pub const LOG_GAPS_KEYWORD: &str = "noctograph.log_gaps";

/// Keyword of the text that contains the digests of the flights.
pub const FLIGHT_KEYWORD: &str = "noctograph.flight_sha256";
/// Keyword of the text that contains the digest of the strokes.
pub const STROKES_KEYWORD: &str = "noctograph.strokes_sha256";

/// Maximum size of a decompressed text in bytes, equal to that of the largest scene file.
const MAX_TEXT_BYTES: usize = 1 << 20;

/// Maximum memory in bytes for everything except the picture.
const MAX_METADATA_BYTES: usize = 16 << 20;

/// Keyword of the text chunk that contains XMP (PNG, third edition).
const XMP_KEYWORD: &str = "XML:com.adobe.xmp";

/// Size of a chunk without its contents, and of the metadata of most photos, in bytes.
const CHUNK_BYTES: usize = 12;
const USUAL_METADATA_BYTES: usize = 1 << 14;

const FITS: &str = "a checked picture fits into memory";

/// Maximum size of an image file: an uncompressed photo of [`MAX_PIXELS`].
pub(super) const LIMIT: Limit =
    Limit { bytes: 4 * MAX_PIXELS, what: "a photo", hint: "scale the photo down" };

/// Encodes a photo as PNG: 8 bits per channel, sRGB, fast compression, no timestamp.
///
/// The scene and `notes`, which are pairs of keyword and text, become text chunks. With metadata,
/// the file also contains EXIF, XMP and the size of the print.
pub fn encode_png(photo: &Photo, metadata: Option<&Metadata>, notes: &[(&str, String)]) -> Vec<u8> {
    let size_px = [photo.width_px, photo.height_px];
    let scene = photo.scene_toml.as_deref();
    let levels = (png::BitDepth::Eight, &*photo.rgb8);
    encode(size_px, levels, metadata, notes, scene).expect(FITS)
}

/// Decodes a PNG file, and also its notes if `texts` is true. Returns [`Error::Input`] for a broken
/// or too large file.
///
/// Color profile and texts are not decompressed with the picture, because a few kilobytes of either
/// may expand to gigabytes.
pub(super) fn from_png(bytes: &[u8], path: &Path, texts: bool) -> Result<(Photo, Notes)> {
    let broken = |source: &dyn std::fmt::Display| {
        Error::input(path.display(), source, "a PNG image", "choose another file")
    };
    // The header is checked before any memory for pixels is allocated.
    let limits = png::Limits { bytes: MAX_METADATA_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_ignore_text_chunk(!texts);
    decoder.set_transformations(png::Transformations::EXPAND);
    let header = decoder.read_header_info().map_err(|e| broken(&e))?;
    let (width_px, height_px) = (header.width, header.height);
    checked_size(path, width_px, height_px)?;
    let mut reader = decoder.read_info().map_err(|e| broken(&e))?;
    let size = reader.output_buffer_size().ok_or_else(|| broken(&"a picture without end"))?;
    let mut samples = vec![0; size];
    let frame = reader.next_frame(&mut samples).map_err(|e| broken(&e))?;
    // Converts the picture to 8 bits, turns it upright, and then reads the texts.
    to_rgb8(&mut samples, frame.color_type, frame.bit_depth);
    let stored = PhotoData { width_px, height_px, rgb8: samples, scene_toml: None };
    let info = reader.info();
    let orientation = info.exif_metadata.as_deref().and_then(Orientation::from_exif_chunk);
    let photo = turned(stored, orientation.unwrap_or(Orientation::NoTransforms));
    let text = |keyword| text(&info.utf8_text, keyword, path);
    Ok((
        Photo::new(PhotoData { scene_toml: text(SCENE_KEYWORD)?, ..photo })?,
        Notes {
            flight_sha256: text(FLIGHT_KEYWORD)?,
            strokes_sha256: text(STROKES_KEYWORD)?,
            log_gaps_json: text(LOG_GAPS_KEYWORD)?,
        },
    ))
}

/// Turns a photo upright by the orientation in its EXIF.
pub(super) fn turned(photo: PhotoData, orientation: Orientation) -> PhotoData {
    if orientation == Orientation::NoTransforms {
        return photo;
    }
    let PhotoData { width_px, height_px, rgb8, scene_toml } = photo;
    let stored = image::RgbImage::from_raw(width_px, height_px, rgb8);
    let mut picture = DynamicImage::from(stored.expect("three bytes a pixel"));
    picture.apply_orientation(orientation);
    let (width_px, height_px) = (picture.width(), picture.height());
    PhotoData { width_px, height_px, rgb8: picture.into_rgb8().into_raw(), scene_toml }
}

/// The texts of a photo that Noctograph wrote.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes {
    /// SHA-256 of each of the photo's flights, separated by spaces.
    pub flight_sha256: Option<String>,
    /// SHA-256 of the photo's strokes, if they come from the user's font or drawing.
    pub strokes_sha256: Option<String>,
    /// Gaps in the flight logs during which the photo shows no light, as JSON.
    pub log_gaps_json: Option<String>,
}

/// Returns the text of a keyword, or `None` if there is none. Returns [`Error::Input`] if the text
/// is damaged or larger than the limit.
fn text(
    texts: &[png::text_metadata::ITXtChunk],
    keyword: &str,
    path: &Path,
) -> Result<Option<String>> {
    let Some(text) = texts.iter().find(|text| text.keyword == keyword) else { return Ok(None) };
    let mut text = text.clone();
    let unpacked = text.decompress_text_with_limit(MAX_TEXT_BYTES);
    let plain = unpacked.and_then(|()| text.get_text());
    plain.map(Some).map_err(|error| {
        let wanted = format!("a text of at most {} MiB", MAX_TEXT_BYTES >> 20);
        let hint = "name a scene, which replaces the photo's own";
        Error::input(keyword, error, wanted, hint).in_file(path.display(), None)
    })
}

/// Converts samples in place to RGB with 8 bits per channel. The samples have 8 or 16 bits, with or
/// without color and transparency.
fn to_rgb8(samples: &mut Vec<u8>, color: png::ColorType, depth: png::BitDepth) {
    let is_wide = depth == png::BitDepth::Sixteen;
    if color == png::ColorType::Rgb && !is_wide {
        return;
    }
    let bytes = color.samples() * if is_wide { 2 } else { 1 };
    let has_color = color.samples() > 2;
    let n = samples.len() / bytes;
    samples.resize(samples.len().max(3 * n), 0);
    for index in 0..n {
        // Pixels that get shorter are converted forward, and pixels that get longer backward, so
        // that no sample is overwritten before it is read.
        let index = if bytes >= 3 { index } else { n - 1 - index };
        let pixel = &samples[index * bytes..][..bytes];
        let levels = [0, 1, 2].map(|channel| match if has_color { channel } else { 0 } {
            channel if !is_wide => pixel[channel],
            // Rounds to the nearest of 256 levels. Note that 65535 = 255 · 257.
            channel => {
                let level = u16::from_be_bytes([pixel[2 * channel], pixel[2 * channel + 1]]);
                u8::try_from((u32::from(level) + 128) / 257).unwrap_or(u8::MAX)
            }
        });
        samples[3 * index..][..3].copy_from_slice(&levels);
    }
    samples.truncate(3 * n);
}

/// Returns [`Error::Input`] for an image that is too large, before it is decoded.
pub(super) fn checked_size(path: &Path, width_px: u32, height_px: u32) -> Result<()> {
    check_size(width_px, height_px).map_err(|error| match error {
        Error::Input { found, wanted, .. } => {
            Error::input(path.display(), found, wanted, "scale the photo down")
        }
        other => other,
    })
}

impl Readout {
    /// Encodes the readout as PNG with 16 bits per channel, with the resolution for printing if it
    /// is given. Otherwise, the file is that of [`develop`](super::develop) and [`encode_png`].
    pub fn encode_png16(
        &self,
        tone: Tone,
        (camera, dots_per_inch): (&Camera, Option<f64>),
        notes: &[(&str, String)],
        scene_toml: Option<&str>,
    ) -> Vec<u8> {
        // The readout's levels are dropped before the encoder allocates as much memory again.
        let bytes: Vec<u8> =
            self.rgb16(tone).iter().flat_map(|level| level.to_be_bytes()).collect();
        let metadata = Metadata { dots_per_inch, ..Metadata::new(camera, &bytes) };
        let size_px = [self.width_px, self.height_px];
        let levels = (png::BitDepth::Sixteen, &*bytes);
        encode(size_px, levels, Some(&metadata), notes, scene_toml).expect(FITS)
    }
}

/// Encodes a PNG with EXIF and texts in memory. `bytes` contains the levels of red, green and blue
/// row by row, with the higher byte first. The encoder is generic over its writer, so only this one
/// instance is compiled.
fn encode(
    [width_px, height_px]: [u32; 2],
    (depth, bytes): (png::BitDepth, &[u8]),
    metadata: Option<&Metadata>,
    notes: &[(&str, String)],
    scene_toml: Option<&str>,
) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut info = png::Info::with_size(width_px, height_px);
    (info.color_type, info.bit_depth) = (png::ColorType::Rgb, depth);
    info.exif_metadata = metadata.map(|metadata| metadata.exif().into());
    let per_m = metadata.and_then(Metadata::pixels_per_m);
    info.pixel_dims =
        per_m.map(|n| png::PixelDimensions { xppu: n, yppu: n, unit: png::Unit::Meter });
    // The picture is compressed first, so that the memory of the file is reserved at once.
    let pixel_bytes = if depth == png::BitDepth::Sixteen { 6 } else { 3 };
    let chunks = idat_chunks(bytes, width_px as usize * pixel_bytes, pixel_bytes);
    let n_bytes = chunks.iter().map(|chunk| chunk.len() + CHUNK_BYTES).sum::<usize>();
    let mut file = Vec::with_capacity(n_bytes + USUAL_METADATA_BYTES);
    let mut encoder = png::Encoder::with_info(&mut file, info)?;
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    // The texts come before the pixels, for the sake of readers that stop at the pixels.
    let xmp = metadata.map(|metadata| (XMP_KEYWORD, metadata.xmp()));
    let scene = scene_toml.map(|scene| (SCENE_KEYWORD, scene.to_owned()));
    for (keyword, text) in xmp.into_iter().chain(notes.iter().cloned()).chain(scene) {
        encoder.add_itxt_chunk(keyword.to_owned(), text)?;
    }
    let mut writer = encoder.write_header()?;
    for chunk in &chunks {
        writer.write_chunk(png::chunk::IDAT, chunk)?;
    }
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::camera::CameraOptions;

    fn photo() -> Photo {
        let rgb8 = (0..5 * 4 * 3).map(|i| u8::try_from(i * 4 % 251).unwrap()).collect();
        let scene_toml = Some("seed = 7 # ψ\n".to_owned());
        Photo::made(PhotoData { width_px: 5, height_px: 4, rgb8, scene_toml })
    }

    #[test]
    fn a_photo_reads_back_with_its_scene() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let file = encode_png(&photo(), None, &[("Software", "noctograph".to_owned())]);
        std::fs::write(&path, &file).unwrap();
        let (read, notes) = crate::photo::read_with_notes(&path).unwrap();
        assert_eq!((read, notes), (photo(), Notes::default()));
        assert_eq!(crate::photo::read(&path).unwrap().scene_toml, None, "read where it is wanted");
        assert!(!file.windows(4).any(|chunk| chunk == b"tIME"), "no time stamp");
    }

    #[test]
    fn exif_and_xmp_are_in_files_of_8_and_16_bits() {
        let camera = CameraOptions::default().camera([0.0, 0.5, 1.0, 1.0], 46.0).unwrap();
        let print = Some(150.0);
        let metadata = Metadata { dots_per_inch: print, ..Metadata::new(&camera, &photo().rgb8) };
        let eight = encode_png(&photo(), Some(&metadata), &[]);
        let rgb = (0..5 * 4 * 3).map(|i| i as f32 / 59.0).collect();
        let readout = Readout { width_px: 5, height_px: 4, rgb, white_lx_s: 0.78 };
        let linear = Tone::Linear;
        let sixteen = readout.encode_png16(linear, (&camera, print), &[], Some("seed = 7"));
        for file in [eight, sixteen] {
            let mut reader = png::Decoder::new(Cursor::new(&file)).read_info().unwrap();
            // The print has 150 dots per inch (25.4 mm).
            let dims = reader.info().pixel_dims.unwrap();
            assert_eq!((dims.xppu, dims.yppu, dims.unit), (5906, 5906, png::Unit::Meter));
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

    /// Tests a text chunk of 60 kB that expands to 60 MB, in an otherwise valid photo.
    #[test]
    fn a_text_that_unpacks_without_end_is_refused_only_where_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let mut file = Vec::new();
        let mut info = png::Info::with_size(1, 1);
        (info.color_type, info.bit_depth) = (png::ColorType::Rgb, png::BitDepth::Eight);
        let text = "# more\n".repeat(60 << 17);
        let mut chunk = png::text_metadata::ITXtChunk::new(SCENE_KEYWORD, text);
        chunk.compressed = true;
        chunk.compress_text().unwrap();
        info.utf8_text.push(chunk);
        let encoder = png::Encoder::with_info(&mut file, info).unwrap();
        encoder.write_header().unwrap().write_image_data(&[1, 2, 3]).unwrap();
        assert!(file.len() < 1 << 20, "{}", file.len());
        std::fs::write(&path, &file).unwrap();
        let error = crate::photo::read_with_notes(&path).unwrap_err().to_string();
        assert!(error.contains("noctograph.scene") && error.contains("at most 1 MiB"), "{error}");
        assert_eq!(crate::photo::read(&path).unwrap().rgb8, [1, 2, 3]);
    }

    /// Compares every kind of PNG with the decoder of the crate `image`, which is a second
    /// implementation on top of the same decompression.
    #[test]
    fn every_color_type_and_depth_becomes_rgb_of_8_bits() {
        use png::{BitDepth, ColorType};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        for (color, depth) in [
            (ColorType::Grayscale, BitDepth::Two),
            (ColorType::Grayscale, BitDepth::Eight),
            (ColorType::Grayscale, BitDepth::Sixteen),
            (ColorType::GrayscaleAlpha, BitDepth::Eight),
            (ColorType::GrayscaleAlpha, BitDepth::Sixteen),
            (ColorType::Indexed, BitDepth::Four),
            (ColorType::Rgb, BitDepth::Sixteen),
            (ColorType::Rgba, BitDepth::Eight),
            (ColorType::Rgba, BitDepth::Sixteen),
        ] {
            let mut file = Vec::new();
            let mut info = png::Info::with_size(7, 5);
            (info.color_type, info.bit_depth) = (color, depth);
            let palette: Vec<u8> = (0..48).map(|i| i * 5).collect();
            info.palette = (color == ColorType::Indexed).then(|| palette.into());
            let n = info.raw_bytes() - 5;
            let samples: Vec<u8> = (0..n).map(|i| (i * 89).to_le_bytes()[0]).collect();
            let encoder = png::Encoder::with_info(&mut file, info).unwrap();
            encoder.write_header().unwrap().write_image_data(&samples).unwrap();
            std::fs::write(&path, &file).unwrap();
            let wanted = image::load_from_memory(&file).unwrap().into_rgb8().into_raw();
            assert_eq!(crate::photo::read(&path).unwrap().rgb8, wanted, "{color:?} {depth:?}");
        }
    }

    #[test]
    fn what_is_no_image_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.png");
        let file = encode_png(&photo(), None, &[]);
        for broken in [&b"no image"[..], &[], &file[..20], &file[..file.len() / 2]] {
            std::fs::write(&path, broken).unwrap();
            let error = crate::photo::read(&path).unwrap_err().to_string();
            assert!(error.contains("photo.png") && error.contains("a PNG image"), "{error}");
        }
    }
}
