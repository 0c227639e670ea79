//! The path of the light in time: a small map, by which a page exposes its photo again.
//!
//! Times are in hundredths of a second of the flight, coordinates in ten-thousandths of the photo's
//! width and height, y down. A word has some kilobytes of these whole numbers.

use nalgebra::Vector3;
use serde::Serialize;

use noctograph_core::camera::Camera;
use noctograph_core::flight::{DroneIndex, Flight};
use noctograph_core::strokes::Glyph;
use noctograph_picture::light::{Lamp, LightSample};
use noctograph_pipeline::shoot::{Shot, writing};

/// Time between two points of a stroke.
const STEP_S: f64 = 0.08;
/// Level above which a lamp is lit: even a red die that is set to 2 of 255 writes.
const LIT: f64 = 0.0;
/// Longest darkness within a stroke, of a lamp that changes its color.
const BLINK_S: f64 = 0.05;

/// A stroke of light of one drone, by the brightest lamp in it.
struct Stroke<'a> {
    drone: Option<DroneIndex>,
    samples: Vec<&'a LightSample>,
    rgb: [f64; 3],
}

/// The path of the light in time.
#[derive(Debug, Serialize)]
pub struct LightMap {
    /// Seconds of the longest flight.
    pub seconds: f64,
    /// In the order of their first times.
    pub strokes: Vec<MappedStroke>,
}

/// A stroke of light.
#[derive(Debug, Serialize)]
pub struct MappedStroke {
    /// Points: t in 1/100 s, x and y in 1/10000 of the photo, t, x, y …
    #[serde(rename = "at")]
    pub points: Vec<i64>,
    /// Index of the letter. Null in a drawing.
    pub letter: Option<usize>,
    /// Color of the light.
    pub rgb: [u8; 3],
}

/// A letter's box in 1/10000 of the photo: left, top, right, bottom.
pub type LetterBox = [i64; 4];

impl LightMap {
    pub(crate) fn new(shot: &Shot) -> Self {
        let lamps = writing(&shot.flights, &shot.trace, &shot.shoot.scene.light);
        let mut strokes: Vec<Stroke<'_>> = Vec::new();
        for stroke in lamps.iter().flat_map(|lamp| strokes_of(lamp)) {
            // Lamps of one drone that are lit together are one stroke, of the sum of their colors.
            match strokes.iter_mut().find(|other| overlap(other, &stroke)) {
                None => strokes.push(stroke),
                Some(other) => (0..3).for_each(|k| other.rgb[k] += stroke.rgb[k]),
            }
        }
        strokes.sort_by(|a, b| span_s(a)[0].total_cmp(&span_s(b)[0]));
        let strokes = strokes.iter().filter_map(|stroke| MappedStroke::new(stroke, shot)).collect();
        Self { seconds: end_s(shot), strokes }
    }
}

pub(crate) fn end_s(shot: &Shot) -> f64 {
    let plans = shot.shoot.plans.iter().map(|planned| planned.plan.duration_s());
    plans.reduce(f64::max).unwrap_or_else(|| shot.trace.end_s())
}

/// The lit segments of a lamp's path.
fn strokes_of(lamp: &Lamp) -> Vec<Stroke<'_>> {
    let lit = lamp.samples.iter().filter(|sample| sample.level > LIT);
    let mut strokes: Vec<Stroke<'_>> = Vec::new();
    for sample in lit {
        let light = lamp.emitter.rgb.map(|part| part * lamp.emitter.intensity_cd * sample.level);
        // A short gap is a change of color, and the brightest level is the color of the stroke.
        match strokes.last_mut() {
            Some(stroke) if sample.time_s - span_s(stroke)[1] < BLINK_S => {
                stroke.samples.push(sample);
                (0..3).for_each(|k| stroke.rgb[k] = stroke.rgb[k].max(light[k]));
            }
            _ => strokes.push(Stroke { drone: lamp.drone, samples: vec![sample], rgb: light }),
        }
    }
    strokes
}

/// True if two strokes of one drone have a time in common.
fn overlap(a: &Stroke<'_>, b: &Stroke<'_>) -> bool {
    let ([a_s, b_s], is_same) = ([span_s(a), span_s(b)], a.drone == b.drone);
    is_same && a_s[0] < b_s[1] && b_s[0] < a_s[1]
}

fn span_s(stroke: &Stroke<'_>) -> [f64; 2] {
    let ends = [stroke.samples.first(), stroke.samples.last()];
    ends.map(|sample| sample.map_or(f64::NAN, |sample| sample.time_s))
}

impl MappedStroke {
    /// A stroke as it is sent. `None` outside of the picture, and while the shutter is closed.
    fn new(stroke: &Stroke<'_>, shot: &Shot) -> Option<Self> {
        let mut points = Vec::new();
        let mut next_s = f64::NEG_INFINITY;
        let [_, end_s] = span_s(stroke);
        let open = shot.camera.shutter_open_s..=shot.camera.shutter_close_s;
        for sample in stroke.samples.iter().filter(|sample| open.contains(&sample.time_s)) {
            // A point for each step of time, and the last one.
            if sample.time_s < next_s && sample.time_s < end_s {
                continue;
            }
            next_s = sample.time_s + STEP_S;
            let [x, y] = image(&shot.camera, sample.position_m)?;
            #[expect(clippy::cast_possible_truncation, reason = "an hour")]
            points.extend([(100.0 * sample.time_s).round() as i64, x, y]);
        }
        // The color of full light, roughly as a screen shows it (gamma 2).
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

fn letter_at(flight: &Flight, time_s: f64) -> Option<usize> {
    let next = flight.samples.partition_point(|sample| sample.time_s < time_s);
    flight.samples.get(next)?.letter
}

/// A point in ten-thousandths of the photo.
fn image(camera: &Camera, position_m: Vector3<f64>) -> Option<[i64; 2]> {
    let point = camera.image_from_world(position_m)?;
    let fractions = [(point.x_px, camera.width_px), (point.y_px, camera.height_px)];
    #[expect(clippy::cast_possible_truncation, reason = "a point in a photo, or beside it")]
    Some(fractions.map(|(px, side)| (1e4 * px / f64::from(side)).round() as i64))
}

/// The letters' boxes in the photo. A letter behind the camera has none, nor has a drawing.
pub(crate) fn boxes(shot: &Shot) -> Vec<Option<LetterBox>> {
    let Some(strokes) = shot.shoot.strokes.as_ref().filter(|strokes| strokes.font.is_some()) else {
        return Vec::new();
    };
    let boxes = strokes.glyphs.iter().map(|Glyph { cell, .. }| {
        let [right_m, top_m] = [cell.left_m + cell.width_m, cell.baseline_m + cell.cap_height_m];
        let [left, top] = image(&shot.camera, Vector3::new(cell.left_m, 0.0, top_m))?;
        let [right, bottom] = image(&shot.camera, Vector3::new(right_m, 0.0, cell.baseline_m))?;
        Some([left, top, right, bottom])
    });
    boxes.collect()
}
