//! What a worker makes for a visitor: the photo while one types, the large one with advice, and
//! files; by the verbs of the command line, so that the page can do what these do and nothing else.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

use base64::prelude::{BASE64_STANDARD, Engine};
use clap::Parser;

use super::super::preview::{PreviewArgs, Seen, previewed};
use super::replay::{boxes, replay};
use super::said::{Made, Said};
use super::wish::{Subject, Task, preview_args};
use super::{
    CommandLine, Error, Output, Result, Value, Verb, export, json, shell_word, show, typefaces,
};
use crate::expose::BackendChoice;
use crate::photo::{Photo, jpeg};
use crate::plan::Plan;
use crate::report::plan_view;
use crate::score::{Reader, View, is_judged};
use crate::shoot::{Judging, Problem, Shoot, Shot, Stop};
use crate::strokes::{Picture, Source, SourceStroke, Strokes};
use crate::studies::Remedy;
use noctograph_core::files::files_in;
use noctograph_core::geometry::{bounds, simplify};

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

/// Output of a verb, inside the job's folder.
pub(super) const OUT: &str = "out";
/// Files that a large photo leaves there.
pub(super) const PNG: &str = "photo.png";
pub(super) const JPEG: &str = "photo.jpg";
pub(super) const REPLAY: &str = "replay.json";
pub(super) const SCENE: &str = "scene.toml";

/// Most words whose typefaces are known: an evening's, letter by letter.
const MOST_FACES: usize = 4096;

/// Makes photos and files.
#[derive(Debug)]
pub(super) struct Studio {
    /// Arguments of every verb: the scene that the page begins with.
    base: Vec<OsString>,
    /// Typefaces of this machine for the letters that the scene's font lacks, by all letters of a
    /// word; `None` where there is none.
    faces: RefCell<BTreeMap<BTreeSet<char>, Option<PathBuf>>>,
}

impl Studio {
    pub(super) fn new(base: Vec<OsString>) -> Self {
        Self { base, faces: RefCell::default() }
    }

    /// Does a job, whose files go into a folder.
    pub(super) fn make(
        &self,
        task: &Task,
        folder: &Path,
        n_waiting: usize,
        stop: &Stop,
    ) -> Result<Made> {
        let out = folder.join(OUT);
        std::fs::create_dir(&out).map_err(|source| Error::write(&out, source))?;
        match task {
            Task::Live(subject) => self.live(subject, folder, n_waiting, stop),
            Task::Large(subject, advice) => self.large(subject, folder, *advice),
            Task::Plan(subject) => self.plan(subject, folder),
            Task::Report(subject) => self.report(subject, folder),
            Task::Script(subject) => self.script(subject, folder),
        }
    }

    /// Arguments of a verb. A word of which the scene's font lacks a letter is written in a
    /// typeface of this machine that has all of them.
    fn typed(&self, subject: &Subject, folder: &Path) -> Result<Vec<OsString>> {
        let mut typed = [self.base.clone(), subject.arguments(folder)?].concat();
        // Our own font has these.
        let is_plain = |word: &str| self.base.is_empty() && word.is_ascii();
        if let Some(word) = subject.title().filter(|word| !is_plain(word))
            && let Err(Error::Letter { .. }) = preview_args(typed.clone())?.scene()?.strokes()
            && let Some(face) = self.face(word)
        {
            typed.extend(["--font".into(), face.into()]);
        }
        Ok(typed)
    }

    fn face(&self, word: &str) -> Option<PathBuf> {
        let letters: BTreeSet<char> = word.chars().filter(|c| !c.is_whitespace()).collect();
        let mut faces = self.faces.borrow_mut();
        if faces.len() == MOST_FACES {
            faces.clear();
        }
        let find = || typefaces::with(&letters.iter().copied().collect::<Vec<_>>());
        faces.entry(letters.clone()).or_insert_with(find).clone()
    }

    /// The photo while one types, with its verdict: both read and encode it side by side.
    fn live(
        &self,
        subject: &Subject,
        folder: &Path,
        n_waiting: usize,
        stop: &Stop,
    ) -> Result<Made> {
        let mut typed = self.typed(subject, folder)?;
        let pixels = match n_waiting {
            0 => LIVE,
            1..CROWD => SHARED,
            _ => CROWDED,
        };
        typed.push(subject.size(pixels).into());
        let args = preview_args(typed)?;
        let shoot = match args.shoot() {
            Ok(shoot) => shoot,
            // Of what is too much for a flight, the page leaves strokes out.
            Err(error) => {
                let mut said = Said::of_error(&error, subject.is_picture());
                if let Ok(strokes) = args.scene().and_then(|scene| scene.strokes()) {
                    said.values["source"] = source(&strokes);
                }
                return Ok(Made::Failed(said));
            }
        };
        let (judging, backend) = (Judging::Skipped, BackendChoice::Cpu);
        let shoot = Shoot { judging, backend, stop: stop.clone(), ..shoot };
        stop.check()?;
        let shot = shoot.clone().take(&|_, _| {})?;
        stop.check()?;
        let is_judged = |strokes: &&Strokes| n_waiting < CROWD && is_judged(strokes);
        let judge = || match shoot.strokes.as_ref().filter(is_judged) {
            None => Ok(None),
            Some(strokes) => {
                let reader = Reader::new(strokes, &shoot.scene.score)?;
                reader.score(&shot.photo, &View::from(&shot.camera)).map(Some)
            }
        };
        let (verdict, jpeg) = rayon::join(judge, || jpeg(&shot.photo, LIVE_QUALITY));
        let mut said = json!({
            "photo": format!("data:image/jpeg;base64,{}", BASE64_STANDARD.encode(jpeg)),
            "verdict": verdict?.as_ref().map(|verdict| show::verdict_json(Some(verdict), None)),
            "replay": replay(&shot), "judged": n_waiting < CROWD,
            "source": shoot.strokes.as_ref().map(source),
        });
        describe(&shot, &mut said);
        Ok(Made::Done(said))
    }

    /// The large photo: what `preview --json` says.
    fn large(&self, subject: &Subject, folder: &Path, advice: bool) -> Result<Made> {
        let mut args = self.preview(subject, folder)?;
        args.with_remedies = advice;
        let out = folder.join(OUT);
        let mut said = json!({});
        let mut kept = Ok(());
        let report = previewed(&args, |Seen { shot, findings, remedies }| {
            let track = replay(shot);
            kept = write(&out.join(JPEG), &jpeg(&shot.photo, LARGE_QUALITY))
                .and_then(|()| write(&out.join(REPLAY), track.to_string().as_bytes()));
            let remedy = |it: &Remedy| json!({ "gain": it.gain, "set": it.changes, "said": Said::of_remedy(it) });
            said["replay"] = track;
            said["stops"] = findings.iter().filter_map(Said::of_stop).map(|it| json!(it)).collect();
            said["remedies"] = remedies.iter().map(remedy).collect();
            describe(shot, &mut said);
        })?;
        kept?;
        // Flights and plans are not asked for: their files are larger than the photo.
        let is_table = |path: &&PathBuf| path.extension().is_some_and(|end| end == "csv");
        for path in files_in(&out)?.iter().filter(is_table) {
            let _ = std::fs::remove_file(path);
        }
        let mut all = report.json;
        all["files"] = Value::Null;
        all["warnings"] = Value::Null;
        let own = said.as_object_mut().into_iter().flat_map(std::mem::take);
        own.for_each(|(key, value)| all[key] = value);
        Ok(Made::Done(all))
    }

    /// The arguments of a large photo.
    fn preview(&self, subject: &Subject, folder: &Path) -> Result<PreviewArgs> {
        let mut typed = self.typed(subject, folder)?;
        // As it is typed elsewhere: no path of this machine is in it.
        let shown = typed.iter().map(|word| match Path::new(word) {
            path if path.is_absolute() => shell_word(path.file_name().unwrap_or_default().as_ref()),
            word => shell_word(word),
        });
        let shown = format!("noctograph preview {}", shown.collect::<Vec<_>>().join(" "));
        typed.extend([subject.size(LARGE).into(), "--backend=cpu".into()]);
        typed.extend(["-o".into(), folder.join(OUT).into()]);
        let mut args = preview_args(typed)?;
        args.command = Some(shown);
        Ok(args)
    }

    fn plan(&self, subject: &Subject, folder: &Path) -> Result<Made> {
        let shoot = self.preview(subject, folder)?.shoot()?;
        let plans: Vec<Plan> = shoot.plans.into_iter().map(|planned| planned.plan).collect();
        let numbers = shoot.strokes.map_or_else(Vec::new, |strokes| strokes.numbers);
        let svg = plan_view(&plans, subject.title().unwrap_or("drawing"), &numbers);
        write(&folder.join(OUT).join("plan.svg"), svg.as_bytes())?;
        Ok(Made::Done(Value::Null))
    }

    fn report(&self, subject: &Subject, folder: &Path) -> Result<Made> {
        let mut args = self.preview(subject, folder)?;
        args.report = true;
        previewed(&args, |_| ())?;
        Ok(Made::Done(Value::Null))
    }

    fn script(&self, subject: &Subject, folder: &Path) -> Result<Made> {
        let typed = ["noctograph", "export", "--to", "cflib", "-o"].map(OsString::from);
        let typed = [typed.to_vec(), vec![folder.join(OUT).into()], self.typed(subject, folder)?];
        let Ok(CommandLine { verb: Verb::Export(args), .. }) =
            CommandLine::try_parse_from(typed.concat())
        else {
            let hint = "reload the page";
            return Err(Error::input("settings", "others", "those of the page", hint));
        };
        let report = export::run(&args)?;
        let Some(stops) = report.json["stops"].as_str() else { return Ok(Made::Done(Value::Null)) };
        let stop = json!({ "key": "stop-export", "values": {}, "text": stops, "hint": "" });
        Ok(Made::Failed(Said::of_stops(&json!([stop]))))
    }
}

/// Adds what a photo of either size has: its size, the flight, problems, and the letters' places.
fn describe(shot: &Shot, said: &mut Value) {
    let Photo { width_px, height_px, .. } = shot.photo;
    let flight_s = shot.plans.iter().map(|it| it.plan.duration_s()).fold(0.0, f64::max);
    let problems = |are: bool| -> Vec<Said> {
        let problems = shot.problems.iter().filter(|it| it.is_obstacle() == are);
        problems.filter(|it| !matches!(it, Problem::Flight(..))).map(Said::of_problem).collect()
    };
    said["width"] = width_px.into();
    said["height"] = height_px.into();
    said["flight_s"] = flight_s.into();
    said["obstacles"] = json!(problems(true));
    said["warnings"] = json!(problems(false));
    said["boxes"] = boxes(shot);
}

/// A drawing as its file has it, in whole pixels of a picture, or in thousandths of the larger side
/// of any other; null of a word.
fn source(strokes: &Strokes) -> Value {
    let Source { corners_px, strokes: all } = &strokes.source;
    let [left, top, right, bottom] = bounds(all.iter().flat_map(|it| it.points.iter().copied()));
    let ([x, y], scale) = match strokes.picture {
        Picture::Auto => ([left, top], 1e3 / f64::max(right - left, bottom - top).max(1e-9)),
        Picture::Drawing | Picture::Photograph => ([0.0; 2], 1.0),
    };
    let told = |SourceStroke { points, color }: &SourceStroke| {
        let points: Vec<[f64; 2]> =
            points.iter().map(|point| [scale * (point[0] - x), scale * (point[1] - y)]).collect();
        let kept = simplify(&points, 1.0).into_iter().flat_map(|index| points[index]);
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
        let at: Vec<i64> = kept.map(|place| place.round() as i64).collect();
        json!({ "color": color, "at": at })
    };
    let told: Vec<Value> = all.iter().map(told).collect();
    if told.is_empty() { Value::Null } else { json!({ "corners": corners_px, "strokes": told }) }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Output::create(path)?.keep(|out| out.write_all(bytes)).map(|_| ())
}
