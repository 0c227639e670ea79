//! Compact map of the path of the light over time, from which a page exposes its photo again.
//!
//! Times are in hundredths of a second from the start of the flight, and coordinates in
//! ten-thousandths of the photo's width and height, with y down. Because all values are integers, a
//! word's map has only a few kilobytes.

use nalgebra::Vector3;
use serde::Serialize;

use noctograph_core::camera::Camera;
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_core::statistics::sort_by_number;
use noctograph_core::strokes::Glyph;
use noctograph_picture::light::{Lamp, LightSample};
use noctograph_pipeline::shoot::{Shot, writing};

/// Time between two points of a stroke, in s.
const STEP_S: f64 = 0.08;
/// Level above which a lamp counts as lit. It is 0, because even level 2 of 255 leaves a visible
/// line.
const LIT: f64 = 0.0;
/// Longest dark interval within a stroke, in s, as it occurs when a lamp changes its color.
const BLINK_S: f64 = 0.05;
/// Number of coordinate units across the width or the height of the photo.
const UNITS: f64 = 1e4;

/// Stroke of light from one drone.
struct Stroke<'a> {
    drone: Option<DroneIndex>,
    samples: Vec<&'a LightSample>,
    rgb: [f64; 3],
}

/// Path of the light over time.
#[derive(Debug, Serialize)]
pub struct LightMap {
    /// Duration of the longest flight, in s.
    pub seconds: f64,
    /// Strokes of light in the order of their first times.
    pub strokes: Vec<MappedStroke>,
}

/// Stroke of light as the page receives it.
#[derive(Debug, Serialize)]
pub struct MappedStroke {
    /// Points in the order t, x, y, t, x, y …, with t in 1/100 s, and x and y in 1/10000 of the
    /// photo.
    #[serde(rename = "at")]
    pub points: Vec<i64>,
    /// Index of the letter that the stroke is part of, or null in a drawing.
    pub letter: Option<usize>,
    /// Color of the light on a screen (sRGB).
    pub rgb: [u8; 3],
}

/// A letter's box in 1/10000 of the photo, in the order left, top, right, bottom.
pub type LetterBox = [i64; 4];

impl LightMap {
    /// Returns the light paths of the lamps that write. Lamps of one drone that are lit at the same
    /// time form one stroke, which follows the path of the first lamp.
    pub(crate) fn new(shot: &Shot) -> Self {
        let lamps = writing(&shot.flights, &shot.trace, &shot.shoot.scene.light);
        let mut strokes: Vec<Stroke<'_>> = Vec::new();
        for stroke in lamps.iter().flat_map(|lamp| lamp_strokes(lamp)) {
            // The colors of the lamps are summed.
            match strokes.iter_mut().find(|other| overlap(other, &stroke)) {
                None => strokes.push(stroke),
                Some(other) => (0..3).for_each(|color| other.rgb[color] += stroke.rgb[color]),
            }
        }
        sort_by_number(&mut strokes, |stroke| span_s(stroke)[0]);
        let strokes = strokes.iter().filter_map(|stroke| MappedStroke::new(stroke, shot)).collect();
        Self { seconds: end_s(shot), strokes }
    }
}

/// Returns the duration of the longest plan or, without plans, of the light, in s.
pub(crate) fn end_s(shot: &Shot) -> f64 {
    let plans = shot.shoot.plans.iter().map(|planned| planned.plan.duration_s());
    plans.reduce(f64::max).unwrap_or_else(|| shot.trace.end_s())
}

/// Returns the lit segments of a lamp's path, in order of time. A gap shorter than [`BLINK_S`] does
/// not divide a segment. The intensity of a segment is the maximum of its samples in each color.
fn lamp_strokes(lamp: &Lamp) -> Vec<Stroke<'_>> {
    let lit = lamp.samples.iter().filter(|sample| sample.level > LIT);
    let mut strokes: Vec<Stroke<'_>> = Vec::new();
    for sample in lit {
        let intensity_cd = lamp.emitter.intensity_cd;
        let rgb = lamp.emitter.rgb.map(|part| part * intensity_cd * sample.level);
        // A short gap is caused by a change of color and does not end the stroke.
        match strokes.last_mut() {
            Some(stroke) if sample.time_s - span_s(stroke)[1] < BLINK_S => {
                stroke.samples.push(sample);
                (0..3).for_each(|color| stroke.rgb[color] = stroke.rgb[color].max(rgb[color]));
            }
            _ => strokes.push(Stroke { drone: lamp.drone, samples: vec![sample], rgb }),
        }
    }
    strokes
}

/// Returns true if two strokes are of one drone and overlap in time.
fn overlap(a: &Stroke<'_>, b: &Stroke<'_>) -> bool {
    let ([a_begin_s, a_end_s], [b_begin_s, b_end_s]) = (span_s(a), span_s(b));
    a.drone == b.drone && a_begin_s < b_end_s && b_begin_s < a_end_s
}

/// Returns the first and the last time of a stroke, in s. They are NaN for a stroke without
/// samples.
fn span_s(stroke: &Stroke<'_>) -> [f64; 2] {
    let ends = [stroke.samples.first(), stroke.samples.last()];
    ends.map(|sample| sample.map_or(f64::NAN, |sample| sample.time_s))
}

impl MappedStroke {
    /// Converts a stroke to the form that the page receives, with a point every [`STEP_S`] while
    /// the shutter is open. The letter is that in the middle of the stroke. Returns `None` if one
    /// of the points is behind the camera, or if the shutter is closed during the entire stroke.
    fn new(stroke: &Stroke<'_>, shot: &Shot) -> Option<Self> {
        let mut points = Vec::new();
        let mut next_s = f64::NEG_INFINITY;
        let [_, end_s] = span_s(stroke);
        let open = shot.camera.shutter_open_s..=shot.camera.shutter_close_s;
        for sample in stroke.samples.iter().filter(|sample| open.contains(&sample.time_s)) {
            // A stroke is reduced to one point per time step and its last point.
            if sample.time_s < next_s && sample.time_s < end_s {
                continue;
            }
            next_s = sample.time_s + STEP_S;
            let [x, y] = photo_coordinates(&shot.camera, sample.position_m)?;
            #[expect(clippy::cast_possible_truncation, reason = "an hour")]
            points.extend([(100.0 * sample.time_s).round() as i64, x, y]);
        }
        // The color is scaled to full brightness and converted to the screen with a gamma of 2.
        let brightest = stroke.rgb.into_iter().fold(f64::MIN_POSITIVE, f64::max);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        let rgb = stroke.rgb.map(|light| (255.0 * (light / brightest).sqrt()).round() as u8);
        let middle = stroke.samples.get(stroke.samples.len() / 2)?;
        let flight = stroke.drone.map_or(0, |DroneIndex(index)| index);
        let letter = shot.flights.get(flight).and_then(|flight| letter_at(flight, middle.time_s));
        let is_word = shot.shoot.strokes.as_ref().is_some_and(|strokes| strokes.font.is_some());
        let letter = letter.filter(|_| is_word);
        (!points.is_empty()).then_some(Self { points, letter, rgb })
    }
}

/// Returns the index of the letter that is written at a time of a flight.
fn letter_at(flight: &Flight, time_s: f64) -> Option<usize> {
    let next = flight.samples.partition_point(|sample| sample.time_s < time_s);
    flight.samples.get(next)?.letter
}

/// Returns the coordinates of a point of the world in ten-thousandths of the photo's sides, from
/// its upper left corner. They may lie outside the photo. Returns `None` for a point behind the
/// camera.
fn photo_coordinates(camera: &Camera, position_m: Vector3<f64>) -> Option<[i64; 2]> {
    let point = camera.image_from_world(position_m)?;
    let fractions = [(point.x_px, camera.width_px), (point.y_px, camera.height_px)];
    #[expect(clippy::cast_possible_truncation, reason = "a point in a photo, or beside it")]
    Some(fractions.map(|(px, side_px)| (UNITS * px / f64::from(side_px)).round() as i64))
}

/// Returns the boxes of letters in the photo, with `None` for a letter behind the camera. The list
/// is empty for a drawing.
pub(crate) fn boxes(shot: &Shot) -> Vec<Option<LetterBox>> {
    let Some(strokes) = shot.shoot.strokes.as_ref().filter(|strokes| strokes.font.is_some()) else {
        return Vec::new();
    };
    let boxes = strokes.glyphs.iter().map(|Glyph { cell, .. }| {
        let [right_m, top_m] = [cell.left_m + cell.width_m, cell.baseline_m + cell.cap_height_m];
        let [left, top] = photo_coordinates(&shot.camera, Vector3::new(cell.left_m, 0.0, top_m))?;
        let [right, bottom] =
            photo_coordinates(&shot.camera, Vector3::new(right_m, 0.0, cell.baseline_m))?;
        Some([left, top, right, bottom])
    });
    boxes.collect()
}
