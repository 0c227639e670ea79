//! What a page is answered: a photograph with its verdict, where the light is when, and the places
//! of the letters.

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

use super::PreparedScene;
use super::messages::Message;
use super::replay::{boxes, replay};
use noctograph_core::error::Result;
use noctograph_core::geometry::{bounds, simplify};
use noctograph_core::strokes::{Source, SourceStroke, Strokes};
use noctograph_export::{File, Form, Format as ExportFormat, Mode};
use noctograph_picture::expose::BackendChoice;
use noctograph_picture::photo::{Photo, jpeg};
use noctograph_pipeline::preflight::{CheckedExport, ExportOptions};
use noctograph_pipeline::shoot::{Format, Judging, Problem, Shoot, Shot, Stop, Watch};

/// Pixels of the photo while one types, and of the large photo.
pub const LIVE: f64 = 960.0 * 540.0;
/// The same of the large photo.
pub const LARGE: f64 = 1920.0 * 1080.0;
const LIVE_QUALITY: u8 = 85;
const LARGE_QUALITY: u8 = 92;

/// How a photo is made: whether it is read, and who watches and stops it.
pub struct Take<'a> {
    /// How it is read.
    pub judging: Judging,
    /// Ends it between two stages.
    pub stop: Stop,
    /// Receives its progress.
    pub watch: &'a Watch<'a>,
}

impl std::fmt::Debug for Take<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Take").field("judging", &self.judging).finish_non_exhaustive()
    }
}

impl Take<'_> {
    fn shot(&self, shoot: Shoot, format: Option<Format>) -> Result<Shot> {
        self.stop.check()?;
        let (judging, stop, backend) = (self.judging, self.stop.clone(), BackendChoice::Cpu);
        Shoot { judging, format, backend, stop, keeps_film: false, ..shoot }.take(self.watch)
    }
}

/// The photo while one types, with its verdict; `Err` says why there is none.
///
/// # Errors
///
/// Those of the stages.
pub fn live(
    scene: PreparedScene,
    strokes: Strokes,
    is_picture: bool,
    take: &Take<'_>,
) -> Result<std::result::Result<Value, Message>> {
    let source = source(&strokes);
    let shoot = match Shoot::of_strokes(scene.scene, strokes) {
        Ok(shoot) => shoot,
        // Of what is too much for a flight, the page leaves strokes out.
        Err(error) => {
            let mut message = Message::of_error(&error, is_picture);
            message.values["source"] = source;
            return Ok(Err(message));
        }
    };
    let shot = take.shot(shoot, None)?;
    let mut json = json!({
        "photo": data_url(&jpeg(&shot.photo, LIVE_QUALITY)), "verdict": shot.verdict,
        "replay": replay(&shot), "judged": take.judging != Judging::Skipped, "source": source,
    });
    describe(&shot, &mut json);
    Ok(Ok(json))
}

/// A large photo.
#[derive(Debug)]
pub struct Large {
    /// The photo, with its file.
    pub shot: Shot,
    /// The photo for a page.
    pub jpeg: Vec<u8>,
    /// The verdict, what stops its flight, and what every photo has.
    pub json: Value,
}

/// The large photo, with what stops its flight.
///
/// # Errors
///
/// Those of the stages.
pub fn large(prepared: PreparedScene, strokes: Strokes, take: &Take<'_>) -> Result<Large> {
    let shot = take.shot(Shoot::of_strokes(prepared.scene, strokes)?, Some(Format::Png))?;
    let findings = shot.findings(&prepared.profile)?;
    let stops: Vec<Message> = findings.iter().filter_map(Message::of_stop).collect();
    let mut json = json!(shot.verdict);
    json["remedies"] = json!([]);
    json["stops"] = json!(stops);
    json["replay"] = replay(&shot);
    describe(&shot, &mut json);
    Ok(Large { jpeg: jpeg(&shot.photo, LARGE_QUALITY), shot, json })
}

/// The scripts that fly a scene by cflib, with what they need; `Err` says what stops the flight.
///
/// # Errors
///
/// Those of the stages.
pub fn script(
    prepared: PreparedScene,
    strokes: Strokes,
) -> Result<std::result::Result<Vec<File>, Message>> {
    let PreparedScene { mut scene, profile } = prepared;
    profile.slow(&mut scene);
    // The scripts find the clock of the drone, and pace by it.
    if scene.trajectory_clock() != 1.0 {
        scene.plan.trajectory_clock.get_or_insert(1.0);
    }
    let (mode, tolerance_m) = (Mode::default(), Form::Compressed.tolerance_m());
    let format = ExportFormat::Cflib;
    let options = ExportOptions { format, mode, tolerance_m, profile, is_unchecked: false };
    let checked = CheckedExport::new(Shoot::of_strokes(scene, strokes)?, options)?;
    let stops: Vec<Message> = checked.findings.iter().filter_map(Message::of_stop).collect();
    match stops.is_empty() {
        true => Ok(Ok(checked.files(None)?.files)),
        false => Ok(Err(Message::of_stops(&json!(stops)))),
    }
}

/// A JPEG as a page shows it.
#[must_use]
pub fn data_url(jpeg: &[u8]) -> String {
    format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(jpeg))
}

/// Adds what a photo of either size has: its size, the flight, problems, and the letters' places.
fn describe(shot: &Shot, json: &mut Value) {
    let Photo { width_px, height_px, .. } = shot.photo;
    let flight_s = shot.shoot.plans.iter().map(|it| it.plan.duration_s()).fold(0.0, f64::max);
    let problems = |are: bool| -> Vec<Message> {
        let problems = shot.problems.iter().filter(|it| it.is_obstacle() == are);
        problems.filter(|it| !matches!(it, Problem::Flight(..))).map(Message::of_problem).collect()
    };
    json["width"] = width_px.into();
    json["height"] = height_px.into();
    json["flight_s"] = flight_s.into();
    json["obstacles"] = json!(problems(true));
    json["warnings"] = json!(problems(false));
    json["boxes"] = boxes(shot);
}

/// A drawing as its file has it, in whole pixels of a picture, or in thousandths of the larger side
/// of any other; null of a word.
fn source(strokes: &Strokes) -> Value {
    let Source { corners_px, is_bitmap, strokes: all } = &strokes.source;
    let [left, top, right, bottom] = bounds(all.iter().flat_map(|it| it.points.iter().copied()));
    let ([x, y], scale) = match is_bitmap {
        true => ([0.0; 2], 1.0),
        false => ([left, top], 1e3 / f64::max(right - left, bottom - top).max(1e-9)),
    };
    let stroke_json = |SourceStroke { points, color }: &SourceStroke| {
        let points: Vec<[f64; 2]> =
            points.iter().map(|point| [scale * (point[0] - x), scale * (point[1] - y)]).collect();
        let kept = simplify(&points, 1.0).into_iter().flat_map(|index| points[index]);
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
        let places: Vec<i64> = kept.map(|place| place.round() as i64).collect();
        json!({ "color": color, "at": places })
    };
    if all.is_empty() {
        return Value::Null;
    }
    json!({ "corners": corners_px, "strokes": all.iter().map(stroke_json).collect::<Vec<_>>() })
}
