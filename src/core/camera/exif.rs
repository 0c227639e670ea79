//! A camera from the EXIF of a photograph: sensor, lens and exposure.
//!
//! EXIF 2.32. The width of the sensor is that of the body where the model is known, else from its
//! resolution in pixels per centimeter or inch (as Canon, Nikon and Sony write it), else from the
//! focal length and its equivalent on 35 mm film (36 mm wide, as most makers define it).

use std::path::Path;

use exif::{Exif, In, Tag, Value};

use super::{BodyModel, CameraOptions, CustomBody, CustomLens, LensModel, Metering};
use crate::error::{Error, Result};
use crate::files::Limit;

/// Largest file of a photograph: a raw one of a technical camera.
const LIMIT: Limit = Limit { bytes: 160 << 20, what: "a photograph", hint: HINT };

impl CameraOptions {
    /// The camera that took a photograph (JPEG, PNG, TIFF, HEIF or WebP with EXIF): sensor, focal
    /// length, aperture number, shutter time, sensitivity, distance in focus, and the picture's
    /// aspect, with as many pixels on the longer side as before. Pose and all else stay.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it has no EXIF or lacks
    /// tags that a camera needs, with their names.
    pub fn taken_as(self, path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let mut bytes = std::io::Cursor::new(LIMIT.read(path)?);
        match exif::Reader::new().read_from_container(&mut bytes) {
            Ok(exif) => self.with_exif(&exif, &place),
            Err(error) => {
                let found = format!("no EXIF ({error})");
                Err(Error::input(place, found, "a photograph as the camera wrote it", HINT))
            }
        }
    }

    fn with_exif(mut self, exif: &Exif, place: &str) -> Result<Self> {
        let body = text(exif, Tag::Model).and_then(|model| BodyModel::from_exif_model(&model));
        let focal_length_m = number(exif, Tag::FocalLength).map(|mm| mm / 1000.0);
        let equivalent_m = number(exif, Tag::FocalLengthIn35mmFilm).map(|mm| mm / 1000.0);
        let of_film = focal_length_m.zip(equivalent_m).map(|(f, film)| 0.036 * f / film);
        // Programs that shrink a picture leave its resolution tags unchanged.
        let agrees = |width_m: &f64| of_film.is_none_or(|film| (width_m / film - 1.0).abs() < 0.1);
        let of_pixels = focal_plane_width_m(exif)
            .filter(|width_m| SENSORS_M.contains(width_m) && agrees(width_m));
        let sensor_width_m = body.as_ref().map(BodyModel::sensor_width_m).or(of_pixels).or(of_film);
        let f_number = number(exif, Tag::FNumber);
        let exposure_s = number(exif, Tag::ExposureTime);
        let iso =
            number(exif, Tag::ISOSpeed).or_else(|| number(exif, Tag::PhotographicSensitivity));

        let needed = [
            ("FocalLength", focal_length_m.is_some()),
            (
                "FocalLengthIn35mmFilm (or FocalPlaneXResolution, or a Model that is known)",
                sensor_width_m.is_some(),
            ),
            ("FNumber", f_number.is_some()),
            ("ExposureTime", exposure_s.is_some()),
            ("PhotographicSensitivity", iso.is_some()),
        ];
        let missing: Vec<&str> =
            needed.iter().filter(|(_, there)| !there).map(|(tag, _)| *tag).collect();
        let (Some(focal_length_m), Some(sensor_width_m), Some(f_number)) =
            (focal_length_m, sensor_width_m, f_number)
        else {
            return Err(without(place, &missing));
        };
        let (Some(exposure_s), Some(iso)) = (exposure_s, iso) else {
            return Err(without(place, &missing));
        };

        self.body = body.unwrap_or(BodyModel::Custom(CustomBody { sensor_width_m }));
        let distortion = match self.lens {
            LensModel::Custom(lens) => lens.distortion,
            _ => [0.0; 4],
        };
        self.lens = LensModel::Custom(CustomLens { focal_length_m, distortion });
        (self.f_number, self.iso, self.metering) = (f_number, iso, Metering::Off);
        self.shutter_close_s = Some(self.shutter_open_s + exposure_s);
        self.focus_m = number(exif, Tag::SubjectDistance).or(self.focus_m);
        self.take_aspect(exif);
        Ok(self)
    }

    /// Sets width and height to the aspect of the photograph, upright.
    fn take_aspect(&mut self, exif: &Exif) {
        let side = |tag, or| number(exif, tag).or_else(|| number(exif, or));
        let width = side(Tag::PixelXDimension, Tag::ImageWidth);
        let height = side(Tag::PixelYDimension, Tag::ImageLength);
        let (Some(width), Some(height)) = (width, height) else { return };
        // Orientations 5 to 8 exchange x and y.
        let turned = number(exif, Tag::Orientation).is_some_and(|o| (5.0..=8.0).contains(&o));
        let longer = self.width_px.max(self.height_px);
        let shorter = f64::from(longer) * (width.min(height) / width.max(height));
        #[expect(clippy::cast_possible_truncation, reason = "a side")]
        let shorter = (shorter.round() as u32).max(1);
        let upright = (width < height) != turned;
        [self.width_px, self.height_px] =
            if upright { [shorter, longer] } else { [longer, shorter] };
        if upright {
            // The longer side of the sensor is vertical.
            let sensor_width_m =
                self.body.sensor_width_m() * (f64::from(shorter) / f64::from(longer));
            self.body = BodyModel::Custom(CustomBody { sensor_width_m });
        }
    }
}

const HINT: &str = "take the file from the camera's card: programs and messengers strip its EXIF; \
                    or set the camera's keys in a scene file";

fn without(place: &str, missing: &[&str]) -> Error {
    let found = format!("EXIF without {}", missing.join(", "));
    Error::input(place, found, "the tags of lens and exposure", HINT)
}

/// Widths of sensors, from the second camera of a telephone to the back of a technical camera.
const SENSORS_M: std::ops::RangeInclusive<f64> = 0.003..=0.06;

/// Width of the sensor from its pixels and their number per unit of length.
fn focal_plane_width_m(exif: &Exif) -> Option<f64> {
    let unit_m = match number(exif, Tag::FocalPlaneResolutionUnit) {
        Some(3.0) => 0.01,
        None | Some(2.0) => 0.0254, // inches by default
        Some(_) => return None,
    };
    let pixels = number(exif, Tag::PixelXDimension).or_else(|| number(exif, Tag::ImageWidth))?;
    Some(pixels / number(exif, Tag::FocalPlaneXResolution)? * unit_m)
}

/// Positive number of a tag.
fn number(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(values) => values.first()?.to_f64(),
        value => f64::from(value.get_uint(0)?),
    };
    (value.is_finite() && value > 0.0).then_some(value)
}

fn text(exif: &Exif, tag: Tag) -> Option<String> {
    match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Ascii(lines) => Some(String::from_utf8_lossy(lines.first()?).into_owned()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use exif::{Field, Rational, experimental::Writer};

    /// A TIFF file with these tags alone.
    fn tiff(fields: &[(Tag, Value)]) -> tempfile::NamedTempFile {
        let fields: Vec<Field> = fields
            .iter()
            .map(|(tag, value)| Field { tag: *tag, ifd_num: In::PRIMARY, value: value.clone() })
            .collect();
        let mut writer = Writer::new();
        fields.iter().for_each(|field| writer.push_field(field));
        let mut bytes = std::io::Cursor::new(Vec::new());
        writer.write(&mut bytes, false).unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes.into_inner()).unwrap();
        file
    }

    fn ratio(num: u32, denom: u32) -> Value {
        Value::Rational(vec![Rational { num, denom }])
    }

    fn telephone() -> Vec<(Tag, Value)> {
        vec![
            (Tag::Model, Value::Ascii(vec![b"Telephone 7".to_vec()])),
            (Tag::FocalLength, ratio(57, 10)),
            (Tag::FocalLengthIn35mmFilm, Value::Short(vec![26])),
            (Tag::FNumber, ratio(18, 10)),
            (Tag::ExposureTime, ratio(30, 1)),
            (Tag::PhotographicSensitivity, Value::Short(vec![50])),
            (Tag::PixelXDimension, Value::Long(vec![4000])),
            (Tag::PixelYDimension, Value::Long(vec![3000])),
        ]
    }

    #[test]
    fn a_photograph_sets_sensor_lens_and_exposure() {
        let file = tiff(&telephone());
        let camera = CameraOptions::default().taken_as(file.path()).unwrap();
        assert_eq!(
            (camera.lens.focal_length_m(), camera.f_number, camera.iso),
            (0.0057, 1.8, 50.0)
        );
        let sensor_width_m = camera.body.sensor_width_m();
        assert!((sensor_width_m - 0.036 * 5.7 / 26.0).abs() < 1e-12, "{camera:?}");
        assert_eq!(camera.shutter_close_s, Some(30.0));
        assert_eq!((camera.width_px, camera.height_px), (1920, 1440));
        camera.check().unwrap();

        let mut turned = telephone();
        turned.push((Tag::Orientation, Value::Short(vec![6])));
        let camera = CameraOptions::default().taken_as(tiff(&turned).path()).unwrap();
        assert_eq!((camera.width_px, camera.height_px), (1440, 1920), "held upright");
    }

    #[test]
    fn a_known_model_needs_no_35_mm_equivalent() {
        let mut tags = telephone();
        tags[0].1 = Value::Ascii(vec![b"ILCE-6400".to_vec()]);
        tags.remove(2);
        let camera = CameraOptions::default().taken_as(tiff(&tags).path()).unwrap();
        assert_eq!((&camera.body, camera.body.sensor_width_m()), (&BodyModel::A6400, 0.0235));
    }

    #[test]
    fn the_resolution_gives_the_sensor_unless_the_picture_was_shrunk() {
        let mut tags = telephone();
        tags.retain(|(tag, _)| *tag != Tag::FocalLengthIn35mmFilm && *tag != Tag::PixelXDimension);
        tags.extend([
            (Tag::PixelXDimension, Value::Long(vec![6000])),
            (Tag::FocalPlaneResolutionUnit, Value::Short(vec![3])),
            (Tag::FocalPlaneXResolution, ratio(26_906, 10)),
        ]);
        let width_m = |tags: &[(Tag, Value)]| {
            CameraOptions::default().taken_as(tiff(tags).path()).unwrap().body.sensor_width_m()
        };
        assert!((width_m(&tags) - 0.0223).abs() < 1e-5, "Canon's APS-C: {}", width_m(&tags));
        tags.push((Tag::FocalLengthIn35mmFilm, Value::Short(vec![26])));
        assert!((width_m(&tags) - 0.036 * 5.7 / 26.0).abs() < 1e-12, "{}", width_m(&tags));
    }

    #[test]
    fn missing_tags_are_named() {
        let error = |path: &Path| CameraOptions::default().taken_as(path).unwrap_err();
        let some: Vec<_> = telephone().drain(..2).collect();
        let message = error(tiff(&some).path()).to_string();
        for tag in ["FocalLengthIn35mmFilm", "FNumber", "ExposureTime", "PhotographicSensitivity"] {
            assert!(message.contains(tag), "{message}");
        }
        assert!(!message.contains("FocalLength,"), "{message}");
        let zero = [(Tag::FNumber, ratio(0, 0)), (Tag::ExposureTime, ratio(1, 0))];
        assert!(error(tiff(&zero).path()).to_string().contains("FNumber"));
        for bytes in [&b""[..], b"no image", b"\x89PNG\r\n\x1a\n", b"II*\0\xff\xff\xff\xff"] {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), bytes).unwrap();
            let error = error(file.path());
            assert!(error.to_string().contains("EXIF"), "{error}");
            assert!(error.hint().contains("card"), "{error}");
        }
        assert!(matches!(error(Path::new("nowhere.jpg")), Error::Io { .. }));
    }
}
