//! What a worker makes for a visitor: the photo while one types, the large one, and files. A job
//! has a folder of its own, in which all its files stand by their names, so that no path of this
//! machine gets into what it makes.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};
use serde_json::{Value, json};

use super::Program;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Output;
use noctograph_core::strokes::Strokes;
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::{Judging, Stop};
use noctograph_web::PreparedScene;
use noctograph_web::answer::{self, LARGE, LIVE, Large, Take};
use noctograph_web::messages::Message;
use noctograph_web::request::{Subject, Task};

/// Pixels of the photo while one types, where others wait, and where a hall waits, in which it is
/// not read either.
const SHARED: f64 = 640.0 * 360.0;
const CROWDED: f64 = 480.0 * 270.0;
/// Visitors who wait that make a crowd.
const CROWD: usize = 4;

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

/// What became of a job.
#[derive(Debug, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum JobResult {
    /// An object, as text: it is passed on as it is.
    Done(Box<RawValue>),
    Failed(Message),
    Stopped,
}

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
        let mut arguments = arguments(subject)?;
        let size = |[width, height]: [u32; 2]| format!("--size={width}x{height}").into();
        arguments.extend(pixels.map(|pixels| size(subject.size_px(pixels))));
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
        prepared.scene.for_audience();
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
        let is_judged = n_waiting < CROWD;
        let judging = if is_judged { Judging::Scored } else { Judging::Skipped };
        let take = Take { judging, stop: stop.clone(), watch: &|_, _| {} };
        answer::live(prepared, strokes, subject.is_picture(), &take)
    }

    /// The large photo, with what stops its flight and, where it does not read, what helps.
    fn large(&mut self, subject: &Subject, advice: bool, stop: &Stop) -> Result<Made> {
        let Drawn { prepared, strokes, .. } = self.draw(subject, Some(LARGE))?;
        let take = Take { judging: Judging::Scored, stop: stop.clone(), watch: &|_, _| {} };
        let Large { shot, jpeg, mut json } = answer::large(prepared, strokes, &take)?;
        let remedies = if advice { (self.program.advice)(&shot)? } else { Vec::new() };
        let remedies = remedies.into_iter().map(|(changes, gain)| {
            json!({ "gain": gain, "said": Message::of_changes(&changes), "set": changes })
        });
        json["remedies"] = remedies.collect();
        let file = |name: &str, bytes: &[u8]| {
            Output::create(&Path::new(OUT).join(name))?.keep(|out| out.write_all(bytes)).map(drop)
        };
        file(PNG, shot.file.as_deref().expect("a format was asked for"))?;
        file(JPEG, &jpeg)?;
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

/// Arguments for a verb that takes a subject, so that the page can do what the command line does
/// and nothing else; a drawing is written into the present folder.
fn arguments(subject: &Subject) -> Result<Vec<OsString>> {
    let settings = subject.settings.iter().map(|(key, value)| format!("--set={key}={value}"));
    let mut arguments: Vec<OsString> = settings.map(OsString::from).collect();
    arguments.extend(subject.room.iter().map(|room| format!("--room={room}").into()));
    match subject.drawing()? {
        None => arguments.push(format!("--word={}", subject.word).into()),
        Some((name, bytes)) => {
            Output::create(name.as_ref())?.keep(|out| out.write_all(&bytes))?;
            arguments.push(format!("--drawing={name}").into());
        }
    }
    Ok(arguments)
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
