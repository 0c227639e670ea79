//! Metadata of a picture, in EXIF 2.32 and XMP.
//!
//! A timestamp would make the bytes differ in every run, and a maker would refer to a camera that
//! does not exist, so both are left out. The digital source type of the IPTC marks the picture as
//! computed from a model.

use exif::experimental::Writer;
use exif::{Field, In, Rational, Tag, Value};

use super::camera_exif::film_width_m;
use noctograph_core::camera::Camera;
use noctograph_core::digest::sha256;

/// The metadata of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    /// Exposure time.
    pub exposure_s: f64,
    /// Aperture number.
    pub f_number: f64,
    /// Sensitivity.
    pub iso: f64,
    /// Focal length.
    pub focal_length_m: f64,
    /// Ratio of the width of 35 mm film with the same diagonal to the width of the sensor.
    pub crop_factor: f64,
    /// Dots per inch of the print for which the picture is meant.
    pub dots_per_inch: Option<f64>,
    /// 128 bits that identify the picture, in hexadecimal.
    pub unique_id: String,
}

/// Length of one inch.
const INCH_M: f64 = 0.0254;
/// Width of a 35 mm film frame.
const FILM_WIDTH_M: f64 = 0.036;

pub(super) const SOFTWARE: &str = concat!("noctograph ", env!("CARGO_PKG_VERSION"));

impl Metadata {
    /// Returns the metadata of a camera's picture, with an identifier from the picture's bytes.
    pub fn new(camera: &Camera, picture: &[u8]) -> Self {
        let [width, height] = [camera.width_px, camera.height_px].map(f64::from);
        let (longer, shorter) = (width.max(height), width.min(height));
        let longer_m = camera.sensor_width_m * longer / width;
        Self {
            exposure_s: camera.shutter_close_s - camera.shutter_open_s,
            f_number: camera.f_number,
            iso: camera.iso,
            focal_length_m: camera.focal_length_m,
            crop_factor: film_width_m(longer / shorter, FILM_WIDTH_M / longer_m) / longer_m,
            dots_per_inch: None,
            unique_id: unique_id(picture),
        }
    }

    /// Returns the pixels per meter of the print, or `None` if the picture is not meant for print.
    pub(super) fn pixels_per_m(&self) -> Option<u32> {
        self.dots_per_inch.map(|dots| whole(dots / INCH_M))
    }

    /// Encodes the metadata as an EXIF block, with a `TIFF` header and fields.
    pub fn exif(&self) -> Vec<u8> {
        let ascii = |text: &str| Value::Ascii(vec![text.as_bytes().to_vec()]);
        let length_35_mm = 1e3 * self.focal_length_m * self.crop_factor;
        let iso = whole(self.iso);
        let fields = [
            (Tag::Software, ascii(SOFTWARE)),
            (Tag::ExifVersion, Value::Undefined(b"0232".to_vec(), 0)),
            (Tag::ExposureTime, rational(self.exposure_s)),
            (Tag::FNumber, rational(self.f_number)),
            (Tag::PhotographicSensitivity, Value::Short(vec![short(self.iso)])),
            // The value 3 means the ISO speed of ISO 12232.
            (Tag::SensitivityType, Value::Short(vec![3])),
            (Tag::ISOSpeed, Value::Long(vec![iso])),
            (Tag::FocalLength, rational(self.focal_length_m * 1000.0)),
            (Tag::FocalLengthIn35mmFilm, Value::Short(vec![short(length_35_mm)])),
            // The value 1 means sRGB.
            (Tag::ColorSpace, Value::Short(vec![1])),
            (Tag::ImageUniqueID, ascii(&self.unique_id)),
        ];
        let fields = fields.map(|(tag, value)| Field { tag, ifd_num: In::PRIMARY, value });
        let mut writer = Writer::new();
        fields.iter().for_each(|field| writer.push_field(field));
        let mut bytes = std::io::Cursor::new(Vec::new());
        writer.write(&mut bytes, false).expect("a few fields fit into memory");
        bytes.into_inner()
    }

    /// Returns an XMP packet that marks the picture as computed.
    pub fn xmp(&self) -> String {
        format!(
            "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\
             <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\
             <rdf:Description rdf:about=\"\" xmlns:xmp=\"http://ns.adobe.com/xap/1.0/\" \
             xmlns:Iptc4xmpExt=\"http://iptc.org/std/Iptc4xmpExt/2008-02-29/\" \
             xmp:CreatorTool=\"{SOFTWARE}\" \
             Iptc4xmpExt:DigitalSourceType=\"http://cv.iptc.org/newscodes/digitalsourcetype/\
             algorithmicMedia\"/></rdf:RDF></x:xmpmeta>"
        )
    }
}

/// Number of bytes that each checksum of [`unique_id`] covers.
const BLOCK: usize = 4096;

/// Returns 128 bits of the SHA-256 of all blocks' CRC-32. A SHA-256 of the whole picture would take
/// a quarter of the time from light trace to photo.
fn unique_id(picture: &[u8]) -> String {
    let sums = picture.chunks(BLOCK).flat_map(|block| crc32fast::hash(block).to_le_bytes());
    sha256(&sums.collect::<Vec<_>>())[..32].to_owned()
}

/// Returns a rational number in millionths, or in thousandths or whole numbers if it is large.
fn rational(value: f64) -> Value {
    let mut denoms = [1_000_000_u32, 1000, 1].into_iter();
    let denom = denoms.find(|denom| value * f64::from(*denom) < f64::from(u32::MAX)).unwrap_or(1);
    Value::Rational(vec![Rational { num: whole(value * f64::from(denom)), denom }])
}

/// Rounds a number to an integer.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn whole(value: f64) -> u32 {
    value.round() as u32
}

/// Rounds a number to a 16-bit integer. Larger numbers saturate.
fn short(value: f64) -> u16 {
    u16::try_from(whole(value)).unwrap_or(u16::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::camera::CameraOptions;

    #[test]
    fn exif_reads_back() {
        let options = CameraOptions { iso: 102_400.0, f_number: 5.6, ..CameraOptions::default() };
        let camera = options.camera([0.0, 0.5, 1.0, 1.0], 46.25).unwrap();
        let metadata = Metadata::new(&camera, b"picture");
        let exif = exif::Reader::new().read_raw(metadata.exif()).unwrap();
        let number = |tag| match &exif.get_field(tag, In::PRIMARY).unwrap().value {
            Value::Rational(values) => values[0].to_f64(),
            value => f64::from(value.get_uint(0).unwrap()),
        };
        assert_eq!(number(Tag::ExposureTime), 46.25);
        assert_eq!(number(Tag::FNumber), 5.6);
        assert_eq!(number(Tag::FocalLength), 35.0);
        assert_eq!(number(Tag::FocalLengthIn35mmFilm), 35.0);
        assert_eq!(number(Tag::PhotographicSensitivity), 65535.0, "more does not fit there");
        assert_eq!(number(Tag::ISOSpeed), 102_400.0);
        let text = |tag| exif.get_field(tag, In::PRIMARY).unwrap().display_value().to_string();
        assert!(text(Tag::Software).contains("noctograph "));
        assert!(text(Tag::ImageUniqueID).contains(&metadata.unique_id));
        assert_eq!(metadata.unique_id.len(), 32);
        let mut pictures = [(); 3].map(|()| vec![7_u8; 2 * BLOCK + 1]);
        (pictures[1][BLOCK - 1], pictures[2][2 * BLOCK]) = (6, 6);
        let [id, ids @ ..] = pictures.map(|picture| Metadata::new(&camera, &picture).unique_id);
        assert!(ids[0] != ids[1] && !ids.contains(&id), "each byte counts");
        for tag in [Tag::Make, Tag::Model, Tag::DateTime, Tag::DateTimeOriginal] {
            assert!(exif.get_field(tag, In::PRIMARY).is_none(), "{tag} is not known");
        }
        assert!(metadata.xmp().contains("digitalsourcetype/algorithmicMedia\""));
    }
}
