//! What a worker makes for a visitor: the photo while one types, the large one, and files. A job
//! has a folder of its own, in which all its files stand by their names, so that no path of this
//! machine gets into what it makes.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::value::to_raw_value;
use serde_json::{Value, json};

use super::messages::{JobResult, Message};
use super::replay::{boxes, replay};
use super::request::{Subject, Task};
use super::{PreparedScene, Program};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Output;
use noctograph_core::geometry::{bounds, simplify};
use noctograph_core::strokes::{Source, SourceStroke, Strokes};
use noctograph_picture::expose::BackendChoice;
use noctograph_picture::photo::{Photo, jpeg};
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::{Format, Judging, Problem, Shoot, Shot, Stop};

/// Pixels of the photo while one types: alone, where others wait, and where a hall waits, in which
/// it is not read either; and of the large photo.
const LIVE: f64 = 960.0 * 540.0;
const SHARED: f64 = 640.0 * 360.0;
const CROWDED: f64 = 480.0 * 270.0;
/// Visitors who wait that make a crowd.
const CROWD: usize = 4;
const LARGE: f64 = 1920.0 * 1080.0;
const LIVE_QUALITY: u8 = 85;
const LARGE_QUALITY: u8 = 92;

/// Folder of what a job makes, inside its own.
pub(crate) const OUT: &str = "out";
/// Files of a large photo.
pub(crate) const PNG: &str = "photo.png";
pub(crate) const JPEG: &str = "photo.jpg";
pub(crate) const REPLAY: &str = "replay.json";
pub(crate) const SCENE: &str = "scene.toml";
pub(crate) const FIGURES: &str = "figures.json";

/// Most words whose typefaces are known: an evening's, letter by letter.
const MOST_FACES: usize = 4096;

/// Makes photos and files.
#[derive(Debug)]
pub(crate) struct Renderer {
    program: Program,
    /// Typefaces of this machine for the letters that the scene's font lacks, by all letters of a
    /// word; `None` where there is none.
    faces: BTreeMap<BTreeSet<char>, Option<PathBuf>>,
}

/// An answer, or why there is none.
type Made = std::result::Result<Value, Message>;

/// A subject that can be planned.
struct Drawn {
    arguments: Vec<OsString>,
    prepared: PreparedScene,
    strokes: Strokes,
}

impl Renderer {
    pub(crate) fn new(program: Program) -> Self {
        Self { program, faces: BTreeMap::new() }
    }

    /// Does a job in the present folder.
    pub(crate) fn make(&mut self, task: &Task, n_waiting: usize, stop: &Stop) -> Result<JobResult> {
        std::fs::create_dir(OUT).map_err(|source| Error::write(OUT.as_ref(), source))?;
        let made = match task {
            Task::Live(subject) => self.live(subject, n_waiting, stop)?,
            Task::Large(subject, advice) => self.large(subject, *advice, stop)?,
            Task::Script(subject) => self.script(subject)?,
        };
        Ok(match made {
            Ok(value) => JobResult::Done(to_raw_value(&value).expect("it is plain data")),
            Err(message) => JobResult::Failed(message),
        })
    }

    /// The strokes of a subject, whose photo has about as many pixels. A word of which the scene's
    /// font lacks a letter is written in a typeface of this machine that has all of them.
    fn draw(&mut self, subject: &Subject, pixels: Option<f64>) -> Result<Drawn> {
        let mut arguments = subject.arguments()?;
        arguments.extend(pixels.map(|pixels| subject.size(pixels).into()));
        let mut prepared = (self.program.prepare)(&arguments)?;
        let strokes = match (prepared.scene.strokes(), subject.title()) {
            (Err(lacks @ Error::Letter { .. }), Some(word)) => {
                let Some(face) = self.face(word) else { return Err(lacks) };
                arguments.push("--font".into());
                arguments.push(brought_here(&face)?.into());
                prepared = (self.program.prepare)(&arguments)?;
                prepared.scene.strokes()?
            }
            (strokes, _) => strokes?,
        };
        Ok(Drawn { arguments, prepared, strokes })
    }

    fn face(&mut self, word: &str) -> Option<PathBuf> {
        let letters: BTreeSet<char> = word.chars().filter(|c| !c.is_whitespace()).collect();
        if self.faces.len() == MOST_FACES {
            self.faces.clear();
        }
        let find = || (self.program.typeface)(&letters.iter().copied().collect::<Vec<_>>());
        self.faces.entry(letters.clone()).or_insert_with(find).clone()
    }

    /// The photo while one types, with its verdict.
    fn live(&mut self, subject: &Subject, n_waiting: usize, stop: &Stop) -> Result<Made> {
        let pixels = match n_waiting {
            0 => LIVE,
            1..CROWD => SHARED,
            _ => CROWDED,
        };
        let Drawn { prepared, strokes, .. } = self.draw(subject, Some(pixels))?;
        let source = source(&strokes);
        let shoot = match Shoot::of_strokes(prepared.scene, strokes) {
            Ok(shoot) => shoot,
            // Of what is too much for a flight, the page leaves strokes out.
            Err(error) => {
                let mut message = Message::of_error(&error, subject.is_picture());
                message.values["source"] = source;
                return Ok(Err(message));
            }
        };
        let is_judged = n_waiting < CROWD;
        let judging = if is_judged { Judging::Scored } else { Judging::Skipped };
        stop.check()?;
        let shot = taken(shoot, judging, None, stop)?;
        let jpeg = BASE64_STANDARD.encode(jpeg(&shot.photo, LIVE_QUALITY));
        let mut json = json!({
            "photo": format!("data:image/jpeg;base64,{jpeg}"), "verdict": shot.verdict,
            "replay": replay(&shot), "judged": is_judged, "source": source,
        });
        describe(&shot, &mut json);
        Ok(Ok(json))
    }

    /// The large photo, with what stops its flight and, where it does not read, what helps.
    fn large(&mut self, subject: &Subject, advice: bool, stop: &Stop) -> Result<Made> {
        let Drawn { prepared, strokes, .. } = self.draw(subject, Some(LARGE))?;
        let shoot = Shoot::of_strokes(prepared.scene, strokes)?;
        let shot = taken(shoot, Judging::Scored, Some(Format::Png), stop)?;
        let findings = shot.findings(&prepared.profile)?;
        let stops: Vec<Message> = findings.iter().filter_map(Message::of_stop).collect();
        let remedies = if advice { (self.program.advice)(&shot)? } else { Vec::new() };
        let remedies = remedies.into_iter().map(|(changes, gain)| {
            json!({ "gain": gain, "said": Message::of_changes(&changes), "set": changes })
        });
        let mut json = json!(shot.verdict);
        json["remedies"] = remedies.collect();
        json["stops"] = json!(stops);
        json["replay"] = replay(&shot);
        describe(&shot, &mut json);
        let file = |name: &str, bytes: &[u8]| {
            Output::create(&Path::new(OUT).join(name))?.keep(|out| out.write_all(bytes)).map(drop)
        };
        file(PNG, shot.file.as_deref().expect("a format was asked for"))?;
        file(JPEG, &jpeg(&shot.photo, LARGE_QUALITY))?;
        file(REPLAY, json["replay"].to_string().as_bytes())?;
        file(SCENE, shot.shoot.scene.to_toml().as_bytes())?;
        file(FIGURES, json.to_string().as_bytes())?;
        Ok(Ok(json))
    }

    fn script(&mut self, subject: &Subject) -> Result<Made> {
        let Drawn { arguments, .. } = self.draw(subject, None)?;
        let Some(stops) = (self.program.script)(&arguments, OUT.as_ref())? else {
            return Ok(Ok(Value::Null));
        };
        let stop = json!({ "key": "stop-export", "values": {}, "text": stops, "hint": "" });
        Ok(Err(Message::of_stops(&json!([stop]))))
    }
}

fn taken(shoot: Shoot, judging: Judging, format: Option<Format>, stop: &Stop) -> Result<Shot> {
    let (backend, stop) = (BackendChoice::Cpu, stop.clone());
    let shoot = Shoot { judging, format, backend, stop, keeps_film: false, ..shoot };
    shoot.take(&|_, _| {})
}

/// Brings the files of a scene into the present folder, and names them by their names alone.
///
/// # Errors
///
/// [`Error::Io`] where one cannot be brought.
pub fn bring_files(scene: &mut Scene) -> Result<()> {
    for file in scene.files_mut().filter(|file| Path::new(file).is_absolute()) {
        *file = brought_here(file.as_ref())?;
    }
    Ok(())
}

/// Brings a file into the present folder, unless it is there. Returns its name there.
fn brought_here(path: &Path) -> Result<String> {
    let here = std::env::current_dir().map_err(|source| Error::read(path, source))?;
    let mut name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if path.parent() == Some(&here) {
        return Ok(name);
    }
    // Another file may have its name.
    while Path::new(&name).exists() {
        name.insert(0, '_');
    }
    let linked = std::fs::hard_link(path, &name);
    let brought = linked.or_else(|_| std::fs::copy(path, &name).map(drop));
    brought.map_err(|source| Error::read(name.as_ref(), source))?;
    Ok(name)
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
