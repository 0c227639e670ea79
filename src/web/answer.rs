//! What a page is answered: a photograph with its verdict, where the light is when, and the places
//! of the letters.

use std::collections::BTreeMap;

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

use super::PreparedScene;
use super::messages::Message;
use super::replay::{boxes, end_s, replay};
use super::request::{LOG, Product, Subject};
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::{bounds, simplify};
use noctograph_core::strokes::{Source, SourceStroke, Strokes};
use noctograph_export::zip::zip;
use noctograph_export::{Form, Format as ExportFormat, Mode};
use noctograph_picture::expose::BackendChoice;
use noctograph_picture::photo::{Photo, jpeg};
use noctograph_pipeline::preflight::{CheckedExport, ExportOptions, Profile};
use noctograph_pipeline::scene::{Change, Scene};
use noctograph_pipeline::shoot::{Format, Judging, Problem, Shoot, Shot, Watch};

/// Pixels of the photo while one types, and of the large photo.
const LIVE: f64 = 960.0 * 540.0;
const LARGE: f64 = 1920.0 * 1080.0;
const DATA_URL: &str = "data:image/jpeg;base64,";
const LIVE_QUALITY: u8 = 85;
const LARGE_QUALITY: u8 = 92;

/// Changes of a scene, and how much the probability that its word is read grows by them.
pub type Suggestion = (Vec<Change>, f64);

/// The scene that the page begins with, some settings laid over it.
pub type Base<'a> = dyn Fn(&[(&str, &str)]) -> Result<Scene> + 'a;

/// Makes what pages ask for.
pub struct Studio<'a> {
    /// The scene that the page begins with, settings laid over it.
    pub scene: &'a Base<'a>,
    /// File of a typeface that has all letters of a word which the scene's font lacks.
    pub typeface: &'a dyn Fn(&str) -> Result<Option<String>>,
    /// Changes that help where a word does not read.
    pub advice: &'a dyn Fn(&Shot) -> Result<Vec<Suggestion>>,
    /// Whether words are written for an audience, see [`Scene::for_audience`].
    pub has_audience: bool,
    /// Receives the progress of a photo.
    pub watch: &'a Watch<'a>,
}

impl std::fmt::Debug for Studio<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Studio").finish_non_exhaustive()
    }
}

/// An answer, or why there is none.
type Made = std::result::Result<Value, Message>;

/// A subject that is ready to be photographed.
struct Ready {
    shoot: Shoot,
    profile: Profile,
    /// See [`source`].
    source: Value,
    /// What one should know of a log.
    notes: Vec<Message>,
}

impl Studio<'_> {
    /// Makes a product of a subject: an object whose `error` says why there is none.
    pub fn make(&self, product: Product, subject: &Subject) -> Value {
        let made = match product {
            Product::Live => self.live(subject),
            Product::Large { advice, files } => {
                self.large(subject, advice, files.then_some(Format::Png))
            }
            Product::Script => self.script(subject),
        };
        let made = made.unwrap_or_else(|error| Err(refusal(&error, subject)));
        made.unwrap_or_else(|message| message.json())
    }

    /// The scene and the strokes of a subject, whose photo has about as many pixels. Where the
    /// scene's font lacks a letter, the word is written in a typeface that has all of them.
    fn drawn(&self, subject: &Subject, pixels: f64) -> Result<(PreparedScene, Strokes)> {
        let mut prepared = subject.prepared(self.scene, None, pixels)?;
        let strokes = match (prepared.scene.strokes(), subject.title()) {
            (Err(lacks @ Error::Letter { .. }), Some(word)) => {
                let Some(face) = (self.typeface)(word)? else { return Err(lacks) };
                prepared = subject.prepared(self.scene, Some(&face), pixels)?;
                prepared.scene.strokes()?
            }
            (strokes, _) => strokes?,
        };
        if self.has_audience {
            prepared.scene.for_audience();
        }
        Ok((prepared, strokes))
    }

    fn shot(&self, shoot: Shoot, judging: Judging, format: Option<Format>) -> Result<Shot> {
        let backend = BackendChoice::Cpu;
        Shoot { judging, format, backend, keeps_film: false, ..shoot }.take(self.watch)
    }

    /// The shoot of a subject, whose photo has about as many pixels.
    fn ready(&self, subject: &Subject, pixels: f64) -> Result<std::result::Result<Ready, Message>> {
        if subject.log.is_some() {
            let PreparedScene { scene, profile } = subject.prepared(self.scene, None, pixels)?;
            let (shoot, notes) = Shoot::of_log(scene, LOG.as_ref())?;
            let notes = notes.iter().map(|note| Message::of_log(note)).collect();
            return Ok(Ok(Ready { shoot, profile, source: Value::Null, notes }));
        }
        let (PreparedScene { scene, profile }, strokes) = self.drawn(subject, pixels)?;
        let source = source(&strokes);
        Ok(match Shoot::of_strokes(scene, strokes, &|_| Ok(())) {
            Ok(shoot) => Ok(Ready { shoot, profile, source, notes: Vec::new() }),
            // Of what is too much for a flight, the page leaves strokes out.
            Err(error) => {
                let mut message = refusal(&error, subject);
                message.values["source"] = source;
                Err(message)
            }
        })
    }

    fn live(&self, subject: &Subject) -> Result<Made> {
        let Ready { shoot, source, notes, .. } = match self.ready(subject, LIVE)? {
            Ok(ready) => ready,
            Err(message) => return Ok(Err(message)),
        };
        let shot = self.shot(shoot, Judging::Scored, None)?;
        let mut json = json!({
            "photo": data_url(&jpeg(&shot.photo, LIVE_QUALITY)), "verdict": shot.verdict,
            "replay": replay(&shot), "source": source,
        });
        describe(&shot, notes, &mut json);
        Ok(Ok(json))
    }

    fn large(&self, subject: &Subject, advice: bool, format: Option<Format>) -> Result<Made> {
        let Ready { shoot, profile, notes, .. } = match self.ready(subject, LARGE)? {
            Ok(ready) => ready,
            Err(message) => return Ok(Err(message)),
        };
        let shot = self.shot(shoot, Judging::Explained, format)?;
        // What was flown needs no check.
        let is_planned = shot.shoot.is_planned;
        let findings = if is_planned { shot.findings(&profile)? } else { Vec::new() };
        let stops: Vec<Message> = findings.iter().filter_map(Message::of_stop).collect();
        let remedies = if advice { (self.advice)(&shot)? } else { Vec::new() };
        let remedies = remedies.into_iter().map(|(changes, gain)| {
            json!({ "gain": gain, "said": Message::of_changes(&changes), "set": changes })
        });
        let mut json = json!(shot.verdict);
        json["remedies"] = remedies.collect();
        json["stops"] = json!(stops);
        json["replay"] = replay(&shot);
        json["photo"] = data_url(&jpeg(&shot.photo, LARGE_QUALITY)).into();
        json["flight_sha256"] = shot.flight_sha256().into();
        json["controller"] = json!(shot.shoot.scene.controller);
        if format.is_some() {
            json["files"] = encoded(files(&shot));
        }
        describe(&shot, notes, &mut json);
        Ok(Ok(json))
    }

    /// The scripts that fly a scene by cflib, with what they need.
    fn script(&self, subject: &Subject) -> Result<Made> {
        let (PreparedScene { mut scene, profile }, strokes) = self.drawn(subject, LARGE)?;
        profile.slow(&mut scene);
        // The scripts find the clock of the drone, and pace by it.
        if scene.trajectory_clock() != 1.0 {
            scene.plan.trajectory_clock.get_or_insert(1.0);
        }
        let (mode, tolerance_m) = (Mode::default(), Form::Compressed.tolerance_m());
        let format = ExportFormat::Cflib;
        let options = ExportOptions { format, mode, tolerance_m, profile, is_unchecked: false };
        let checked = CheckedExport::new(Shoot::of_strokes(scene, strokes, &|_| Ok(()))?, options)?;
        let stops: Vec<Message> = checked.findings.iter().filter_map(Message::of_stop).collect();
        if !stops.is_empty() {
            return Ok(Err(Message::of_stops(&json!(stops))));
        }
        let files = checked.files(None)?.files.into_iter().map(|file| (file.name, file.bytes));
        Ok(Ok(json!({ "files": encoded(files) })))
    }
}

/// The photo's files as `preview` names them.
fn files(shot: &Shot) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::from([
        ("photo.png".to_owned(), shot.file.clone().expect("a format was asked for")),
        ("scene.toml".to_owned(), shot.shoot.scene.portable().to_toml().into_bytes()),
    ]);
    for (index, planned) in shot.shoot.plans.iter().enumerate() {
        let number =
            if shot.shoot.plans.len() > 1 { format!("-{}", index + 1) } else { String::new() };
        let mut csv = Vec::new();
        planned.plan.write_csv(&mut csv).expect("memory takes it");
        files.insert(format!("plan{number}.csv"), csv);
    }
    files
}

/// Files as an answer has them: in base64, by their names.
fn encoded(files: impl IntoIterator<Item = (String, Vec<u8>)>) -> Value {
    let encoded = files.into_iter().map(|(name, bytes)| (name, BASE64_STANDARD.encode(bytes)));
    json!(encoded.collect::<BTreeMap<_, _>>())
}

/// The files of an answer.
pub fn files_of(answer: &Value) -> Vec<(String, Vec<u8>)> {
    let file = |(name, text): (&String, &Value)| {
        Some((name.clone(), BASE64_STANDARD.decode(text.as_str()?).ok()?))
    };
    answer["files"].as_object().into_iter().flatten().filter_map(file).collect()
}

/// The answer with scripts for a page, which saves them as one archive.
pub fn archived(mut answer: Value) -> Value {
    if answer["files"].is_object() {
        answer["files"] = encoded([("flight.zip".to_owned(), zip(&files_of(&answer)))]);
    }
    answer
}

/// A JPEG as a page shows it.
fn data_url(jpeg: &[u8]) -> String {
    format!("{DATA_URL}{}", BASE64_STANDARD.encode(jpeg))
}

/// The JPEG of an answer.
pub fn jpeg_of(answer: &Value) -> Option<Vec<u8>> {
    BASE64_STANDARD.decode(answer["photo"].as_str()?.strip_prefix(DATA_URL)?).ok()
}

/// Why there is no answer.
fn refusal(error: &Error, subject: &Subject) -> Message {
    match (error, &subject.log) {
        (Error::Input { .. }, Some(_)) => Message::of_log(&format!("{error}: {}", error.hint())),
        _ => Message::of_error(error, subject.is_picture()),
    }
}

/// Adds what a photo of either size has: its size, the flight, problems, and the letters' places.
fn describe(shot: &Shot, notes: Vec<Message>, json: &mut Value) {
    let Photo { width_px, height_px, .. } = shot.photo;
    let problems = |are: bool| -> Vec<Message> {
        let problems = shot.problems.iter().filter(|it| it.is_obstacle() == are);
        problems.filter(|it| !matches!(it, Problem::Flight(..))).map(Message::of_problem).collect()
    };
    json["width"] = width_px.into();
    json["height"] = height_px.into();
    json["flight_s"] = end_s(shot).into();
    json["obstacles"] = json!(problems(true));
    json["warnings"] = json!([notes, problems(false)].concat());
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
