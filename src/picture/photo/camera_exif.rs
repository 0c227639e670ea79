//! Reads a camera's sensor, lens and exposure from the EXIF of a photograph (EXIF 2.32).
//!
//! Only the tags that [`taken_as`] lists change the camera. Broken directories without any of these
//! tags are ignored.
//!
//! The sensor width of a known body is tabulated. For other bodies it is computed from the
//! resolution in pixels per unit of length, or from the focal length and its equivalent on 35 mm
//! film, which refers to diagonals (CIPA DCG-001: 43.3 mm). In an edited picture the number of
//! pixels may be newer than the resolution. Canon writes the resolution as 1000 times the pixels
//! divided by thousandths of the unit, so that it contains both. For other makers the width is used
//! if the film equivalent confirms it. If nothing confirms it, there is a warning, or no width if
//! the tags show that the picture was edited.

use std::path::Path;

use exif::{Exif, In, Tag, Value};

use super::raw_file::refuse_raw;
use noctograph_core::camera::{
    BodyModel, CameraOptions, CustomBody, CustomLens, INFINITY_M, LensModel, Metering,
};
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::{JpegFrame, Limit};

/// Maximum size of a photograph's file: that of a raw file from a technical camera.
const LIMIT: Limit = Limit { bytes: 160 << 20, what: "a photograph", hint: HINT };

/// Value of the tag `SubjectDistance` that means infinity.
const ENDLESS: u32 = u32::MAX;

/// Value of `PhotographicSensitivity` that means 65535 or more. Other tags then contain the number.
const ISO_BEYOND: f64 = 65_535.0;

/// Names in `Software` of programs that edit pictures. Cameras store their firmware there.
const EDITORS: &str = "photoshop,lightroom,gimp,darktable,rawtherapee,paint,capture one,affinity,\
                       snapseed,picasa,imagemagick,photos ,acdsee,luminar,digikam,photo editor";

/// The EXIF tags, each with a part of the camera key that it sets.
const TAGS: [(&str, Tag); 7] = [
    ("f_number", Tag::FNumber),
    ("iso", Tag::PhotographicSensitivity),
    ("shutter", Tag::ExposureTime),
    ("focal_length", Tag::FocalLength),
    ("focus", Tag::SubjectDistance),
    ("sensor_width", Tag::FocalPlaneXResolution),
    ("_px", Tag::PixelXDimension),
];

/// Sets a camera to the one that took a photograph (JPEG, PNG, TIFF, HEIF or WebP with EXIF).
///
/// The photograph sets sensor, lens, aperture number, shutter time, sensitivity, focus distance,
/// and the aspect ratio of the picture, whose longer side keeps its number of pixels. Pose and
/// other options remain unchanged. Each guess gives a warning with its reason.
///
/// # Errors
///
/// Returns [`Error::Io`] if the file cannot be read, and [`Error::Input`] if it has no EXIF, lacks
/// tags that a camera needs (which it names), or has numbers that no camera has.
pub fn taken_as(mut camera: CameraOptions, path: &Path) -> Result<Warned<CameraOptions>> {
    let place = path.display().to_string();
    let bytes = LIMIT.read(path)?;
    refuse_raw(&bytes, &place)?;
    let size_px = size_px(&bytes);
    let mut reader = exif::Reader::new();
    // One broken directory must not hide the tags of an intact one.
    let reader = reader.continue_on_error(true);
    // The container reader would copy a TIFF file, which may be a large raw photograph.
    let is_tiff = bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*");
    let read = if is_tiff {
        reader.read_raw(bytes)
    } else {
        reader.read_from_container(&mut std::io::Cursor::new(bytes))
    };
    let exif = read.or_else(|error| error.distill_partial_result(|_| {})).map_err(|error| {
        let cause = format_args!("no EXIF ({error})");
        Error::input(Place::file(&place), cause, "a photograph as the camera wrote it", HINT)
    })?;
    let mut photograph = Photograph { exif, size_px, warnings: Vec::new() };
    photograph.set(&mut camera, &place)?;
    // The error names the tag, not the key, because the impossible number comes from the file.
    camera.check().map_err(|error| {
        let Error::Input { place: key, found, wanted, .. } = &error else { return error };
        match TAGS.iter().find(|(part, _)| key.key().contains(part)) {
            Some((_, tag)) => Error::input(format!("EXIF, {tag}"), found, wanted.as_str(), HINT)
                .in_file(&place, None),
            None => error,
        }
    })?;
    let warnings = photograph.warnings.into_iter().map(|warning| warning.in_file(&place));
    Ok(Warned { product: camera, warnings: warnings.collect() })
}

/// A tag that a camera needs, the scene key that replaces it, and its value.
type Needed = (Tag, &'static str, Option<f64>);

/// The width of a sensor, computed from a number of pixels across and their resolution.
struct FromResolution {
    pixels: f64,
    width_m: f64,
    /// True if both tags were certainly written together.
    is_of_one_age: bool,
}

/// The tags of a photograph, its size in pixels, and the warnings about its tags.
struct Photograph {
    exif: Exif,
    size_px: Option<[f64; 2]>,
    warnings: Vec<Diagnostic>,
}

impl Photograph {
    /// Sets body, lens, exposure and aspect ratio of a camera. Returns [`Error::Input`] if the
    /// photograph lacks tags that a camera needs. `place` is its name in errors.
    fn set(&mut self, camera: &mut CameraOptions, place: &str) -> Result<()> {
        let body = self.text(Tag::Model).and_then(|model| BodyModel::from_exif_model(&model));
        let focal_length_m = self.number(Tag::FocalLength).map(|mm| mm / 1000.0);
        let sensor_width_m = match &body {
            Some(body) => Some(body.figures().sensor_width_m),
            None => self.sensor_width_m(focal_length_m),
        };
        // Computes missing values from APEX values: N = 2^(Av/2), t = 2^-Tv.
        let f_number = self
            .number(Tag::FNumber)
            .or_else(|| Some(libm::exp2(0.5 * self.signed(Tag::ApertureValue)?)));
        let exposure_s = self
            .number(Tag::ExposureTime)
            .or_else(|| Some(libm::exp2(-self.signed(Tag::ShutterSpeedValue)?)));
        let needed: [Needed; 5] = [
            (Tag::FocalLength, "camera.lens.focal_length_m", focal_length_m),
            (Tag::FocalLengthIn35mmFilm, "camera.body.sensor_width_m", sensor_width_m),
            (Tag::FNumber, "camera.f_number", f_number),
            (Tag::ExposureTime, "camera.shutter_close_s", exposure_s),
            (Tag::PhotographicSensitivity, "camera.iso", self.iso()),
        ];
        let [
            Some(focal_length_m),
            Some(sensor_width_m),
            Some(f_number),
            Some(exposure_s),
            Some(iso),
        ] = needed.map(|(.., value)| value)
        else {
            return Err(self.incomplete(&needed, place));
        };
        // The lens keeps the scene's distortion, because EXIF contains none.
        camera.body = body.unwrap_or(BodyModel::Custom(CustomBody { sensor_width_m }));
        let distortion = match &camera.lens {
            LensModel::Custom(lens) => lens.distortion,
            _ => [0.0; 4],
        };
        camera.lens = LensModel::Custom(CustomLens { focal_length_m, distortion });
        (camera.f_number, camera.iso, camera.metering) = (f_number, iso, Metering::Off);
        camera.shutter_close_s = Some(camera.shutter_open_s + exposure_s);
        camera.focus_m = self.subject_m().or(camera.focus_m);
        self.set_aspect(camera);
        self.warn_of_odd_tags();
        Ok(())
    }

    /// Returns the error for needed tags that are missing or 0. `place` is the photograph's name.
    fn incomplete(&self, needed: &[Needed; 5], place: &str) -> Error {
        let [(_, focal_key, _), (.., sensor_width_m), ..] = needed;
        // Cameras write 0 for an unknown value, which needs a different hint than a missing tag.
        let is_zero =
            |tag| self.value(tag).is_some() && self.signed(tag).is_none_or(|value| value <= 0.0);
        let film_mm = self
            .number(Tag::FocalLengthIn35mmFilm)
            .filter(|_| self.value(Tag::FocalLength).is_none() && sensor_width_m.is_none());
        let (mut empty, mut missing) = (Vec::new(), Vec::new());
        for (tag, key, _) in needed.iter().filter(|(.., value)| value.is_none()) {
            match (*tag, film_mm) {
                (tag, _) if is_zero(tag) => empty.push(format!("{tag} = 0 (give {key})")),
                (Tag::FocalLength, Some(_)) => {}
                (tag @ Tag::FocalLengthIn35mmFilm, Some(mm)) => empty
                    .push(format!("{tag} = {mm} without FocalLength (give {focal_key} and {key})")),
                (tag @ Tag::FocalLengthIn35mmFilm, None) => missing.push(format!(
                    "{tag} (or FocalPlaneXResolution with PixelXDimension, or a known camera \
                     Model)"
                )),
                (tag, _) => missing.push(tag.to_string()),
            }
        }
        let missing = missing.join(", ");
        if empty.is_empty() {
            let why = self.warnings.iter().map(|why| format!("; {why}")).collect::<String>();
            let wanted = format!("the lens and exposure tags{why}");
            return Error::input(place, format!("EXIF without {missing}"), wanted, HINT);
        }
        let and = if missing.is_empty() { "" } else { ", and without " };
        let seen = format!("EXIF with {}{and}{missing}", empty.join(", "));
        let wanted = "lens and exposure values (a camera writes 0 for an unknown value, such as \
                      the aperture of a lens without contacts)";
        let hint = "omit the photograph, and set these keys in a scene file together with those that \
                    the photograph has";
        Error::input(place, seen, wanted, hint)
    }

    /// Sets width and height to the aspect ratio of the upright photograph.
    fn set_aspect(&mut self, camera: &mut CameraOptions) {
        let Some([mut width, mut height]) = self.tagged_size_px().or(self.size_px) else {
            let missing = "EXIF without PixelXDimension and PixelYDimension";
            self.warn("no-size", format!("{missing}: the picture keeps the scene's aspect ratio"));
            return;
        };
        // Orientations 5 to 8 swap x and y, unless a program has already turned the pixels without
        // updating the tag.
        let orientation = self.number(Tag::Orientation);
        let mut turned = orientation.is_some_and(|number| (5.0..=8.0).contains(&number));
        if let Some([real_width, real_height]) = self.size_px
            && relative_difference(real_width / real_height, width / height) >= SAME_ASPECT
        {
            if relative_difference(real_width / real_height, height / width) < SAME_ASPECT {
                turned = false;
            } else {
                let message = format!(
                    "EXIF describes a picture of {width} x {height} pixels, but this picture has \
                     {real_width} x {real_height}: it was cropped, and shows only a part of what \
                     the camera saw"
                );
                self.warn("cropped", message);
            }
            (width, height) = (real_width, real_height);
        }
        // The longer side keeps its number of pixels.
        let longer = camera.width_px.max(camera.height_px);
        let shorter_px = f64::from(longer) * (width.min(height) / width.max(height));
        #[expect(clippy::cast_possible_truncation, reason = "a side")]
        let shorter = (shorter_px.round() as u32).max(1);
        (camera.width_px, camera.height_px) = (longer, shorter);
        if (width < height) != turned {
            (camera.width_px, camera.height_px) = (shorter, longer);
            // In a portrait, the longer side of the sensor is vertical.
            let aspect = f64::from(shorter) / f64::from(longer);
            let sensor_width_m = camera.body.figures().sensor_width_m * aspect;
            camera.body = BodyModel::Custom(CustomBody { sensor_width_m });
        }
    }

    /// Returns the sensor width in m of an unknown camera from tags that were written together, or
    /// `None` if there are none. Warns if the width is a guess.
    fn sensor_width_m(&mut self, focal_length_m: Option<f64>) -> Option<f64> {
        let film_width_m = self.equivalent_width_m(focal_length_m);
        let resolution = self.resolution_width_m(film_width_m.is_none());
        let plausible = resolution.filter(|sensor| SENSORS_M.contains(&sensor.width_m));
        let Some(FromResolution { pixels, width_m, is_of_one_age }) = plausible else {
            return film_width_m;
        };
        let mm = 1e3 * width_m;
        match film_width_m {
            // A program that shrinks a picture may leave its resolution tags unchanged.
            Some(film_m) if relative_difference(width_m, film_m) >= SAME_WIDTH => {
                let message = format!(
                    "the sensor is assumed to be {:.2} mm wide according to \
                     FocalLengthIn35mmFilm, although FocalPlaneXResolution implies {mm:.2} mm",
                    1e3 * film_m
                );
                self.warn("sensor-width", message);
                return Some(film_m);
            }
            None if !is_of_one_age => {}
            _ => return Some(width_m),
        }
        // No other tag confirms the resolution, so it is only used if the picture was not edited.
        if let Some(why) = self.edited() {
            let message = format!(
                "{pixels} pixels and FocalPlaneXResolution imply a sensor of {mm:.2} mm, but {why}: \
                 they may have been written at different times"
            );
            self.warn("edited", message);
            return None;
        }
        let message = format!(
            "the sensor is assumed to be {mm:.2} mm wide, from {pixels} pixels and \
             FocalPlaneXResolution, which no other tag confirms. If the picture was resized, \
             this width is too small: set camera.body in a scene file"
        );
        self.warn("sensor-width", message);
        Some(width_m)
    }

    /// Returns the sensor width by the resolution, in inches without a unit, or `None` without the
    /// tags. An unknown unit gives `None` and, if `is_needed` is true, a warning.
    fn resolution_width_m(&mut self, is_needed: bool) -> Option<FromResolution> {
        let unit_m = match self.number(Tag::FocalPlaneResolutionUnit) {
            None | Some(2.0) => 0.0254, // inches by default
            Some(3.0) => 0.01,
            Some(4.0) => 1e-3,
            Some(5.0) => 1e-6,
            Some(unit) => {
                let message =
                    format!("FocalPlaneResolutionUnit {unit} is not a unit that EXIF defines");
                is_needed.then(|| self.warn("resolution-unit", message));
                return None;
            }
        };
        let pixels = self.number(Tag::PixelXDimension).or_else(|| self.number(Tag::ImageWidth))?;
        let per_unit = self.number(Tag::FocalPlaneXResolution)?;
        let canon = self.canon_width();
        let width_m = canon.unwrap_or(pixels / per_unit) * unit_m;
        Some(FromResolution { pixels, width_m, is_of_one_age: canon.is_some() })
    }

    /// Returns the width and height in pixels that the tags give, or `None` without the tags.
    fn tagged_size_px(&self) -> Option<[f64; 2]> {
        let side = |tag, or| self.number(tag).or_else(|| self.number(or));
        let width = side(Tag::PixelXDimension, Tag::ImageWidth)?;
        Some([width, side(Tag::PixelYDimension, Tag::ImageLength)?])
    }

    /// Returns the sensor width in m computed from the focal length and its equivalent on 35 mm
    /// film, for the picture's aspect ratio. Returns `None` without tags. Warns of an impossible
    /// equivalent.
    fn equivalent_width_m(&mut self, focal_length_m: Option<f64>) -> Option<f64> {
        let film_mm = self.number(Tag::FocalLengthIn35mmFilm)?;
        if !FILM_MM.contains(&film_mm) {
            let message = format!("FocalLengthIn35mmFilm {film_mm} mm is not possible for a lens");
            self.warn("film-equivalent", message);
            return None;
        }
        // A picture of unknown size is assumed to have the common aspect ratio of 3:2.
        let [width, height] = self.tagged_size_px().or(self.size_px).unwrap_or([3.0, 2.0]);
        let aspect = width.max(height) / width.min(height);
        let film_by_sensor = film_mm / (1e3 * focal_length_m?);
        Some(film_width_m(aspect, film_by_sensor) / film_by_sensor)
    }

    /// Returns the sensor width in the unit of the resolution if Canon wrote it. Canon's rational
    /// number is 1000 times the sensor's pixels divided by the width in thousandths of the unit.
    fn canon_width(&self) -> Option<f64> {
        if !self.text(Tag::Make)?.to_lowercase().contains("canon") {
            return None;
        }
        let Value::Rational(ratio) = self.value(Tag::FocalPlaneXResolution)? else { return None };
        let exif::Rational { num, denom } = *ratio.first()?;
        // In thousandths of an inch, the width of a 3 mm sensor is 118. No camera of Canon has
        // fewer than 640 pixels per row.
        (num % 1000 == 0 && num >= 640_000 && (100..3000).contains(&denom))
            .then(|| f64::from(denom) / 1000.0)
    }

    /// Returns the reason to regard a picture as edited, or `None` if no tag shows editing.
    fn edited(&self) -> Option<String> {
        if let Some(software) = self.text(Tag::Software) {
            // The added space lets `photos ` match at the end, but not within a longer word.
            let lower = format!("{} ", software.to_lowercase());
            if EDITORS.split(',').any(|editor| lower.contains(editor)) {
                return Some(format!("the picture was edited with {}", software.trim()));
            }
        }
        let (taken, written) = (self.text(Tag::DateTimeOriginal)?, self.text(Tag::DateTime)?);
        // Only the days are compared, because the file of a long exposure is written after it ends.
        (taken.get(..10) != written.get(..10))
            .then(|| format!("the picture was taken at {taken} and changed at {written}"))
    }

    /// Returns the ISO sensitivity from the first tag that can represent it, or `None` without such
    /// a tag.
    fn iso(&self) -> Option<f64> {
        let others = [Tag::ISOSpeed, Tag::RecommendedExposureIndex, Tag::StandardOutputSensitivity];
        match self.number(Tag::PhotographicSensitivity) {
            Some(named) if named < ISO_BEYOND => self.number(Tag::ISOSpeed).or(Some(named)),
            _ => others.into_iter().find_map(|tag| self.number(tag)),
        }
    }

    /// Returns the focus distance in m, or `None` if it is missing or 0, which means unknown.
    fn subject_m(&self) -> Option<f64> {
        match self.value(Tag::SubjectDistance)? {
            Value::Rational(ratio) if ratio.first()?.num == ENDLESS => Some(INFINITY_M),
            _ => self.number(Tag::SubjectDistance).map(|m| m.min(INFINITY_M)),
        }
    }

    /// Warns of tags that should change the camera but whose values cannot be used.
    fn warn_of_odd_tags(&mut self) {
        let [subject, orientation] = [Tag::SubjectDistance, Tag::Orientation]
            .map(|tag| Some(self.exif.get_field(tag, In::PRIMARY)?.display_value().to_string()));
        if let Some(zoom) = self.number(Tag::DigitalZoomRatio).filter(|zoom| *zoom > 1.0) {
            let shown = "the picture shows only a part of what the sensor recorded";
            self.warn("digital-zoom", format!("DigitalZoomRatio {zoom}: {shown}"));
        }
        // A distance of 0 means unknown. A value that is not a number cannot be used.
        if let Some(subject) = subject
            && self.signed(Tag::SubjectDistance).is_none_or(|m| m < 0.0)
            && self.subject_m().is_none()
        {
            let message =
                format!("SubjectDistance {subject} is not a distance: the focus is not changed");
            self.warn("subject-distance", message);
        }
        if let Some(orientation) = orientation
            && !self.number(Tag::Orientation).is_some_and(|number| (1.0..=8.0).contains(&number))
        {
            let message = format!(
                "Orientation {orientation} is not one of 1 to 8: the picture is assumed to be \
                 upright"
            );
            self.warn("orientation", message);
        }
    }

    /// Adds a warning.
    fn warn(&mut self, code: &'static str, message: String) {
        self.warnings.push(Diagnostic::warning(code, message));
    }

    /// Returns the first value of a tag as a number, or `None` if it is missing or not positive.
    fn number(&self, tag: Tag) -> Option<f64> {
        self.signed(tag).filter(|value| *value > 0.0)
    }

    /// Returns the first value of a tag as a finite number of any sign, in the unit of EXIF.
    /// Returns `None` for a missing tag.
    fn signed(&self, tag: Tag) -> Option<f64> {
        let value = match self.value(tag)? {
            Value::Rational(values) => values.first()?.to_f64(),
            Value::SRational(values) => values.first()?.to_f64(),
            Value::Float(values) => f64::from(*values.first()?),
            Value::Double(values) => *values.first()?,
            value => f64::from(value.get_uint(0)?),
        };
        value.is_finite().then_some(value)
    }

    /// Returns the first line of a tag's text, or `None` if the tag is missing or not text.
    fn text(&self, tag: Tag) -> Option<String> {
        match self.value(tag)? {
            Value::Ascii(lines) => Some(String::from_utf8_lossy(lines.first()?).into_owned()),
            _ => None,
        }
    }

    /// Returns the value of a tag that belongs to the main picture.
    fn value(&self, tag: Tag) -> Option<&Value> {
        Some(&self.exif.get_field(tag, In::PRIMARY)?.value)
    }
}

/// Maximum relative difference between two equal aspect ratios. Thumbnails have small sides, which
/// are rounded to whole pixels.
const SAME_ASPECT: f64 = 0.04;

/// Relative difference below which two sensor widths count as equal.
const SAME_WIDTH: f64 = 0.1;

/// Returns the relative difference between two positive numbers.
fn relative_difference(a: f64, b: f64) -> f64 {
    (a / b - 1.0).abs()
}

const HINT: &str = "take the file from the camera's card, because photo editors and messengers \
                    remove its EXIF, or set the camera's keys in a scene file";

/// Diagonal of a 35 mm film frame, which is 36 by 24 mm.
const FILM_DIAGONAL_M: f64 = 0.043_267;

/// Returns the width in m on 35 mm film of a picture's longer side. `aspect` is the picture's
/// aspect ratio, and the film is `film_by_sensor` times as large as the sensor.
///
/// The aspect ratio of the sensor follows from its size. It is 3:2 for full frame, APS-C and
/// one-inch sensors (2.7), and 4:3 for larger sensors, Micro Four Thirds (2.0) and smaller sensors.
/// A picture longer than that was cropped in height, and a squarer one in width.
pub(super) fn film_width_m(aspect: f64, film_by_sensor: f64) -> f64 {
    let is_3_by_2 = [0.9..1.8, 2.4..3.0].iter().any(|sizes| sizes.contains(&film_by_sensor));
    let sensor_aspect = if is_3_by_2 { 3.0 / 2.0 } else { 4.0 / 3.0 };
    aspect.min(sensor_aspect) / libm::hypot(sensor_aspect, 1.0) * FILM_DIAGONAL_M
}

/// Equivalent focal lengths of real lenses in mm, from fisheye lenses to bridge cameras.
const FILM_MM: std::ops::RangeInclusive<f64> = 4.0..=4000.0;

/// Widths of real sensors, from a phone's second camera to the back of a technical camera.
const SENSORS_M: std::ops::RangeInclusive<f64> = 0.003..=0.06;

/// Returns width and height from the header of a JPEG or PNG file, or `None` for other files.
fn size_px(bytes: &[u8]) -> Option<[f64; 2]> {
    let size_px = if bytes.starts_with(b"\x89PNG") {
        let [width, height] = [16, 20].map(|offset| bytes.get(offset..)?.first_chunk());
        [width?, height?].map(|bytes| u64::from(u32::from_be_bytes(*bytes)))
    } else {
        JpegFrame::parse(bytes)?.size_px
    };
    size_px.iter().all(|side| *side > 0).then(|| size_px.map(|side| side as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use exif::{Field, Rational, experimental::Writer};

    /// Returns a TIFF file with only these tags.
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

    /// Returns the telephone's tags, with some left out and others added or replaced.
    fn telephone_with(left_out: &[Tag], added: &[(Tag, Value)]) -> Vec<(Tag, Value)> {
        let mut tags = telephone();
        tags.retain(|(tag, _)| {
            !left_out.contains(tag) && !added.iter().any(|(other, _)| other == tag)
        });
        tags.extend_from_slice(added);
        tags
    }

    fn read(path: &Path) -> Result<(CameraOptions, Vec<String>)> {
        let Warned { product, warnings } = taken_as(CameraOptions::default(), path)?;
        Ok((product, warnings.iter().map(Diagnostic::to_string).collect()))
    }

    fn taken(tags: &[(Tag, Value)]) -> (CameraOptions, Vec<String>) {
        read(tiff(tags).path()).unwrap()
    }

    #[test]
    fn a_photograph_sets_sensor_lens_and_exposure() {
        let (camera, said) = taken(&telephone());
        assert!(said.is_empty(), "{said:?}");
        assert_eq!(
            (camera.lens.figures().focal_length_m, camera.f_number, camera.iso),
            (0.0057, 1.8, 50.0)
        );
        let sensor_width_m = camera.body.figures().sensor_width_m;
        // The diagonal is 43.267 mm for film, and 5 units for a picture of 4 by 3 units.
        assert!((sensor_width_m - 0.8 * 0.043_267 * 5.7 / 26.0).abs() < 1e-12, "{camera:?}");
        assert_eq!(camera.shutter_close_s, Some(30.0));
        assert_eq!((camera.width_px, camera.height_px), (1920, 1440));
        camera.check().unwrap();

        let turned = telephone_with(&[], &[(Tag::Orientation, Value::Short(vec![6]))]);
        let camera = taken(&turned).0;
        assert_eq!((camera.width_px, camera.height_px), (1440, 1920), "held upright");
    }

    #[test]
    fn an_equivalent_focal_length_that_no_lens_has_is_named() {
        let film = (Tag::FocalLengthIn35mmFilm, Value::Short(vec![11_113]));
        let file = tiff(&telephone_with(&[], &[film]));
        let error = read(file.path()).unwrap_err().to_string();
        assert!(error.contains("FocalLengthIn35mmFilm 11113 mm"), "{error}");
    }

    #[test]
    fn a_raw_file_is_named_with_the_way_out() {
        for head in
            [&b"\0\0\0\x18ftypcrx \0\0"[..], b"FUJIFILMCCD-RAW 0201", b"IIU\0\x18\0", b"FOVb\0\0"]
        {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), head).unwrap();
            let error = read(file.path()).unwrap_err();
            assert!(error.to_string().contains("a raw file ("), "{error}");
            assert!(error.hint().contains("JPEG"), "{}", error.hint());
        }
    }

    #[test]
    fn a_known_model_needs_no_35_mm_equivalent() {
        let model = (Tag::Model, Value::Ascii(vec![b"ILCE-6400".to_vec()]));
        let camera = taken(&telephone_with(&[Tag::FocalLengthIn35mmFilm], &[model])).0;
        assert_eq!(
            (&camera.body, camera.body.figures().sensor_width_m),
            (&BodyModel::A6400, 0.0235)
        );
    }

    #[test]
    fn the_resolution_gives_the_sensor_unless_the_picture_was_shrunk() {
        let resolution = [
            (Tag::PixelXDimension, Value::Long(vec![6000])),
            (Tag::FocalPlaneResolutionUnit, Value::Short(vec![3])),
            (Tag::FocalPlaneXResolution, ratio(26_906, 10)),
        ];
        let mut tags = telephone_with(&[Tag::FocalLengthIn35mmFilm], &resolution);
        let width_m = |tags: &[(Tag, Value)]| taken(tags).0.body.figures().sensor_width_m;
        assert!((width_m(&tags) - 0.0223).abs() < 1e-5, "Canon's APS-C: {}", width_m(&tags));
        tags.push((Tag::FocalLengthIn35mmFilm, Value::Short(vec![26])));
        // On a sensor this small, a 2:1 picture is as wide as a 4:3 picture.
        assert!((width_m(&tags) - 0.034_613_6 * 5.7 / 26.0).abs() < 1e-7, "{}", width_m(&tags));
        assert!(taken(&tags).1[0].contains("implies 22.30 mm"), "{:?}", taken(&tags).1);
    }

    /// Returns the tags of a Canon compact camera, whose resolution is 1000 times its pixels
    /// divided by thousandths of an inch.
    fn compact(pixels: [u32; 2]) -> Vec<(Tag, Value)> {
        let resolution = [
            (Tag::Make, Value::Ascii(vec![b"Canon".to_vec()])),
            (Tag::PixelXDimension, Value::Long(vec![pixels[0]])),
            (Tag::PixelYDimension, Value::Long(vec![pixels[1]])),
            (Tag::FocalPlaneXResolution, ratio(4_000_000, 291)),
            (Tag::FocalPlaneResolutionUnit, Value::Short(vec![2])),
        ];
        telephone_with(&[Tag::FocalLengthIn35mmFilm], &resolution)
    }

    #[test]
    fn the_sensor_of_an_edited_picture_is_of_one_age_or_not_said() {
        for pixels in [[4000, 3000], [2560, 1920], [640, 480]] {
            let (camera, said) = taken(&compact(pixels));
            let width_mm = 1e3 * camera.body.figures().sensor_width_m;
            assert!((width_mm - 7.391).abs() < 0.001 && said.is_empty(), "{pixels:?}: {width_mm}");
        }
        // Resolution tags of other makers do not reveal when they were written.
        let mut other = compact([2560, 1920]);
        other.retain(|(tag, _)| *tag != Tag::Make);
        let (camera, said) = taken(&other);
        assert!((1e3 * camera.body.figures().sensor_width_m - 4.73).abs() < 0.01, "{said:?}");
        assert!(said[0].contains("4.73 mm") && said[0].contains("resized"), "{said:?}");
        for (tag, text, why) in [
            (Tag::Software, "Adobe Photoshop 25.1 (Windows)", "edited with Adobe"),
            (Tag::DateTime, "2024:05:06 10:00:00", "changed at 2024:05:06"),
        ] {
            let mut edited = other.clone();
            let taken = Value::Ascii(vec![b"2024:05:04 22:00:00".to_vec()]);
            edited.extend([(Tag::DateTimeOriginal, taken), (tag, Value::Ascii(vec![text.into()]))]);
            let error = read(tiff(&edited).path()).unwrap_err();
            let message = error.to_string();
            assert!(message.contains("FocalLengthIn35mmFilm"), "{message}");
            assert!(message.contains(why), "{message}");
        }
    }

    #[test]
    fn sentinels_are_what_the_standard_says() {
        let with = |tag: Tag, value: Value| taken(&telephone_with(&[], &[(tag, value)])).0;
        assert_eq!(with(Tag::SubjectDistance, ratio(u32::MAX, 1)).focus_m, Some(INFINITY_M));
        assert_eq!(with(Tag::SubjectDistance, ratio(0, 1)).focus_m, None, "unknown");
        assert_eq!(with(Tag::SubjectDistance, ratio(5, 2)).focus_m, Some(2.5));
        let fast = [
            (Tag::PhotographicSensitivity, Value::Short(vec![65_535])),
            (Tag::RecommendedExposureIndex, Value::Long(vec![102_400])),
        ];
        assert_eq!(taken(&telephone_with(&[], &fast)).0.iso, 102_400.0, "more than 16 bits hold");
        let signed = |num| Value::SRational(vec![exif::SRational { num, denom: 1 }]);
        let apex = [(Tag::ApertureValue, ratio(3, 1)), (Tag::ShutterSpeedValue, signed(-5))];
        let camera = taken(&telephone_with(&[Tag::FNumber, Tag::ExposureTime], &apex)).0;
        assert!((camera.f_number - 8_f64.sqrt()).abs() < 1e-9, "{camera:?}");
        assert_eq!(camera.shutter_close_s, Some(32.0));
    }

    #[test]
    fn an_impossible_number_stands_at_the_file_and_its_tag() {
        for (tag, value) in [
            (Tag::FNumber, ratio(1, 1000)),
            (Tag::PhotographicSensitivity, Value::Long(vec![4_000_000_000])),
        ] {
            let file = tiff(&telephone_with(&[], &[(tag, value)]));
            let error = read(file.path()).unwrap_err().to_string();
            assert!(error.starts_with(&file.path().display().to_string()), "{error}");
            assert!(error.contains(&tag.to_string()) && !error.contains("camera."), "{error}");
        }
    }

    #[test]
    fn a_directory_that_is_not_needed_may_be_broken() {
        let file = tiff(&telephone());
        let mut bytes = std::fs::read(file.path()).unwrap();
        fn long(bytes: &[u8], start: usize) -> usize {
            u32::from_be_bytes(bytes[start..start + 4].try_into().unwrap()) as usize
        }
        fn entries(bytes: &[u8], start: usize) -> usize {
            usize::from(u16::from_be_bytes(bytes[start..start + 2].try_into().unwrap()))
        }
        // Locates the EXIF directory, and the pointer after it, which must be 0.
        let first = long(&bytes, 4);
        let tag = (0..entries(&bytes, first)).map(|n| first + 2 + 12 * n);
        let tag = tag.clone().find(|start| bytes[*start..*start + 2] == [0x87, 0x69]).unwrap();
        let inner = long(&bytes, tag + 8);
        let next = inner + 2 + 12 * entries(&bytes, inner);
        bytes[next..next + 4].copy_from_slice(&[0, 0, 0x1e, 0]);
        std::fs::write(file.path(), &bytes).unwrap();
        let camera = read(file.path()).unwrap().0;
        assert_eq!((camera.f_number, camera.iso), (1.8, 50.0));
        // Overwrites the pointer from the first directory to the thumbnail's directory.
        let next = first + 2 + 12 * entries(&bytes, first);
        bytes[next..next + 4].copy_from_slice(&[0xff; 4]);
        std::fs::write(file.path(), &bytes).unwrap();
        assert_eq!(read(file.path()).unwrap().0.iso, 50.0);
    }

    fn jpeg(tags: &[(Tag, Value)], [width, height]: [u16; 2]) -> tempfile::NamedTempFile {
        let exif = std::fs::read(tiff(tags).path()).unwrap();
        let length = u16::try_from(exif.len() + 8).unwrap().to_be_bytes();
        let mut bytes = [&b"\xff\xd8\xff\xe1"[..], &length, b"Exif\0\0", &exif].concat();
        bytes.extend([0xff, 0xc0, 0, 11, 8]);
        bytes.extend([height.to_be_bytes(), width.to_be_bytes()].concat());
        bytes.extend([1, 1, 0x11, 0, 0xff, 0xd9]);
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    #[test]
    fn a_picture_is_turned_once_and_a_cropped_one_is_named() {
        let turned = telephone_with(&[], &[(Tag::Orientation, Value::Short(vec![6]))]);
        for (tags, size_px, wanted) in [
            (&turned, [4000, 3000], (1440, 1920)),
            // A program turned the pixels but did not change the tag.
            (&turned, [3000, 4000], (1440, 1920)),
            (&telephone(), [3000, 4000], (1440, 1920)),
            (&telephone(), [400, 300], (1920, 1440)),
        ] {
            let (camera, said) = read(jpeg(tags, size_px).path()).unwrap();
            assert_eq!((camera.width_px, camera.height_px), wanted, "{size_px:?}");
            assert!(said.is_empty(), "{said:?}");
        }
        let cropped = jpeg(&telephone(), [2000, 2000]);
        let (camera, said) = read(cropped.path()).unwrap();
        assert_eq!((camera.width_px, camera.height_px), (1920, 1920));
        assert!(said[0].contains("cropped"), "{said:?}");
    }

    proptest::proptest! {
        #![proptest_config(proptest::prelude::ProptestConfig::with_cases(64))]

        /// Tests sensor sizes from data sheets, in mm, and pictures cropped as cameras crop them.
        #[test]
        fn an_equivalent_focal_length_gives_the_width_of_every_sensor_and_aspect(
            sensor in proptest::sample::select(vec![
                [36.0, 24.0], [43.8, 32.9], [23.5, 15.6], [22.3, 14.9], [17.3, 13.0], [13.2, 8.8],
                [9.8, 7.3], [6.17, 4.55], [4.8, 3.6],
            ]),
            aspect in proptest::sample::select(vec![1.0_f64, 4.0 / 3.0, 1.5, 16.0 / 9.0]),
            film_mm in 50..200_u16,
            is_upright: bool,
        ) {
            let [width_mm, height_mm] = sensor;
            let focal_mm = f64::from(film_mm) * libm::hypot(width_mm, height_mm) / 43.267;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a focal length")]
            let focal_length = ratio((1e3 * focal_mm).round() as u32, 1000);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a side")]
            let height_px = (4000.0 / aspect).round() as u32;
            let camera = taken(&telephone_with(&[], &[
                (Tag::FocalLength, focal_length),
                (Tag::FocalLengthIn35mmFilm, Value::Short(vec![film_mm])),
                (Tag::PixelYDimension, Value::Long(vec![height_px])),
                (Tag::Orientation, Value::Short(vec![if is_upright { 6 } else { 1 }])),
            ])).0;
            let longer_mm = width_mm.min(aspect * height_mm);
            let wanted_mm = if is_upright { longer_mm / aspect } else { longer_mm };
            let found_mm = 1e3 * camera.body.figures().sensor_width_m;
            let error = found_mm / wanted_mm - 1.0;
            proptest::prop_assert!(error.abs() < 0.02, "{found_mm} mm, not {wanted_mm} mm");
        }

        /// Tests that any unusable tag of a valid file leaves the camera unchanged or is named.
        #[test]
        fn a_tag_that_is_not_understood_is_named_or_changes_nothing(
            which in 0..13_usize,
            kind in 0..4_usize,
            number in 9..60_u32,
        ) {
            let mut good = telephone();
            good.push((Tag::Orientation, Value::Short(vec![6])));
            good.push((Tag::SubjectDistance, ratio(5, 2)));
            let more = [
                Tag::DigitalZoomRatio, Tag::FocalPlaneXResolution, Tag::FocalPlaneResolutionUnit,
            ];
            let (tag, _) = good.get(which).cloned().unwrap_or_else(|| (more[which - 10], ratio(1, 1)));
            let odd = match (kind, tag) {
                (0, Tag::DigitalZoomRatio) => ratio(number, 1),
                (0, Tag::Orientation) => Value::Long(vec![number]),
                (0 | 1, _) => Value::Ascii(vec![format!("a{number}").into_bytes()]),
                (2, _) => ratio(number, 0),
                _ => Value::Undefined(vec![b'7'; 3], 0),
            };
            let wanted = taken(&good).0;
            good.retain(|(other, _)| *other != tag);
            good.push((tag, odd));
            match read(tiff(&good).path()) {
                Ok((camera, said)) => {
                    let name = tag.to_string();
                    let is_named = said.iter().any(|text| text.contains(&name));
                    proptest::prop_assert!(is_named || camera == wanted, "{name}: {said:?}");
                }
                Err(error) => {
                    let name = tag.to_string();
                    proptest::prop_assert!(error.to_string().contains(&name), "{name}: {error}");
                }
            }
        }
    }

    #[test]
    fn missing_tags_are_named() {
        fn error(path: &Path) -> Error {
            read(path).unwrap_err()
        }
        let some: Vec<_> = telephone().drain(..2).collect();
        let message = error(tiff(&some).path()).to_string();
        for tag in ["FocalLengthIn35mmFilm", "FNumber", "ExposureTime", "PhotographicSensitivity"] {
            assert!(message.contains(tag), "{message}");
        }
        assert!(!message.contains("FocalLength,"), "{message}");
        assert!(message.contains("FocalPlaneXResolution with PixelXDimension"), "{message}");
        let zero = [(Tag::FNumber, ratio(0, 0)), (Tag::ExposureTime, ratio(1, 0))];
        assert!(error(tiff(&zero).path()).to_string().contains("FNumber"));
        for (tag, value, key) in [
            (Tag::FNumber, ratio(0, 1), "camera.f_number"),
            (Tag::ExposureTime, ratio(0, 1), "camera.shutter_close_s"),
            (Tag::PhotographicSensitivity, Value::Short(vec![0]), "camera.iso"),
            (Tag::FocalLength, ratio(0, 1), "camera.lens.focal_length_m"),
        ] {
            let error = error(tiff(&telephone_with(&[], &[(tag, value)])).path()).to_string();
            assert!(error.contains(&format!("{tag} = 0 (give {key})")), "{error}");
            assert!(!error.contains("EXIF without"), "{error}");
        }
        let of_film = error(tiff(&telephone_with(&[Tag::FocalLength], &[])).path()).to_string();
        assert!(of_film.contains("FocalLengthIn35mmFilm = 26 without FocalLength"), "{of_film}");
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
