//! What a page is answered: a photograph with its verdict, where the light is when, and the places
//! of the letters. Facts are typed, and files are bytes beside them.

use std::collections::BTreeMap;

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::PreparedScene;
use super::messages::{Message, code_on_page};
use super::replay::{LetterBox, LightMap, boxes, end_s};
use super::request::{LOG, Product, Subject};
use noctograph_core::diagnostic::{Change, Diagnostic};
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::{bounds, simplify};
use noctograph_core::strokes::{Source, SourceStroke, Strokes};
use noctograph_export::zip::zip;
use noctograph_export::{File, Form, Format as ExportFormat};
use noctograph_picture::expose::BackendChoice;
use noctograph_picture::photo::jpeg;
use noctograph_pipeline::preflight::{CheckedExport, ExportOptions, Profile, make_exportable};
use noctograph_pipeline::scene::{CarriedScene, Scene};
use noctograph_pipeline::shoot::problems::FLAWS;
use noctograph_pipeline::shoot::{Format, Judging, Shoot, Shot, Watch};
use noctograph_score::Verdict;
use noctograph_sim::ControllerOptions;

/// Pixels of the photo while one types, and of the large photo.
const LIVE: f64 = 960.0 * 540.0;
const LARGE: f64 = 1920.0 * 1080.0;
const LIVE_QUALITY: u8 = 85;
const LARGE_QUALITY: u8 = 92;

/// The photo's file that every page shows.
pub const JPEG: &str = "photo.jpg";

/// An answer, or why there is none.
pub type Made = std::result::Result<Answer, Message>;

/// What is made of a subject.
#[derive(Debug)]
pub struct Answer {
    /// What there is to say.
    pub facts: Facts,
    /// The photo as [`JPEG`] and the files that were asked for, or the scripts.
    pub files: Vec<File>,
}

/// What there is to say of a product.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Facts {
    /// Of the photo while one types.
    Live(Box<LiveFacts>),
    /// Of the large photo.
    Large(Box<LargeFacts>),
    /// Of the scripts.
    Script {},
}

/// What there is to say of a photo of either size.
#[derive(Debug, Serialize)]
pub struct PhotoFacts {
    /// A box for each letter; none of a drawing.
    pub boxes: Vec<Option<LetterBox>>,
    /// Seconds of the longest flight.
    pub flight_s: f64,
    /// Height in pixels.
    pub height: u32,
    /// What makes any word unreadable.
    pub obstacles: Vec<Message>,
    /// Where the light is when.
    pub replay: LightMap,
    /// What else one should know.
    pub warnings: Vec<Message>,
    /// Width in pixels.
    pub width: u32,
}

/// What there is to say of the photo while one types.
#[derive(Debug, Serialize)]
pub struct LiveFacts {
    /// Of a photo of either size.
    #[serde(flatten)]
    pub photo: PhotoFacts,
    /// The drawing; null of a word.
    pub source: Option<DrawnSource>,
    /// The verdict; null of a drawing.
    pub verdict: Option<Verdict>,
}

/// What there is to say of the large photo: the members of `preview --json`, and what the page
/// needs.
#[derive(Debug, Serialize)]
pub struct LargeFacts {
    /// Of a photo of either size.
    #[serde(flatten)]
    pub photo: PhotoFacts,
    /// The verdict explained; without its members of a drawing.
    #[serde(flatten)]
    pub verdict: Option<Verdict>,
    /// The controller that flew, as the scene has it.
    pub controller: ControllerOptions,
    /// Number of drones.
    pub drones: usize,
    /// SHA-256 of the flights.
    pub flight_sha256: Option<String>,
    /// Changes that help where the word does not read.
    pub remedies: Vec<Suggestion>,
    /// What stops its flight.
    pub stops: Vec<Message>,
}

/// Changes of a scene that help its word.
#[derive(Debug, Serialize)]
pub struct Suggestion {
    /// How much the probability that the word is read grows.
    pub gain: f64,
    /// The changes in words.
    pub said: Message,
    /// The keys with their values.
    pub set: Vec<Change>,
}

/// A drawing as its file has it: in whole pixels of a picture, or in thousandths of the larger side
/// of any other. y points down.
#[derive(Debug, Serialize)]
pub struct DrawnSource {
    /// Those of the sheet of paper that is drawn.
    pub corners: Option<[[f64; 2]; 4]>,
    /// All strokes in the order of their numbers.
    pub strokes: Vec<DrawnStroke>,
}

/// A stroke of a drawing's file.
#[derive(Debug, Serialize)]
pub struct DrawnStroke {
    /// Points: x, y, x, y …
    #[serde(rename = "at")]
    pub places: Vec<i64>,
    /// Its color by name.
    pub color: Option<&'static str>,
}

/// What a page that asks gets back with its answer.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Asked {
    /// The text that asked for a large photo: whoever sends the photo to be flown sends this text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Number of the request.
    pub number: Option<u64>,
}

/// An answer as a page reads it, which has files in base64.
#[derive(Debug, Default, Serialize)]
pub struct PageAnswer {
    /// What asked for it.
    #[serde(flatten)]
    asked: Asked,
    /// What there is to say.
    #[serde(flatten)]
    facts: Option<Facts>,
    /// Why there is no answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<Message>,
    /// The photo as an address of data.
    #[serde(skip_serializing_if = "Option::is_none")]
    photo: Option<String>,
    /// Files by their names.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    files: BTreeMap<String, String>,
}

impl PageAnswer {
    /// The answer of what was made; a page saves scripts as one archive.
    pub fn new(asked: Asked, made: Made) -> Self {
        let Answer { facts, mut files } = match made {
            Ok(answer) => answer,
            Err(message) => return Self { asked, error: Some(message), ..Self::default() },
        };
        if matches!(facts, Facts::Script {}) {
            files = vec![File { name: "flight.zip".into(), bytes: zip(&files) }];
        }
        let mut answer = Self { asked, facts: Some(facts), ..Self::default() };
        for File { name, bytes } in files {
            let text = BASE64_STANDARD.encode(bytes);
            if name == JPEG {
                answer.photo = Some(format!("data:image/jpeg;base64,{text}"));
            } else {
                answer.files.insert(name, text);
            }
        }
        answer
    }

    /// Its JSON.
    pub fn json(&self) -> String {
        json!(self).to_string()
    }
}

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

/// A subject that is ready to be photographed.
struct Ready {
    shoot: Shoot,
    profile: Profile,
    /// See [`source`].
    source: Option<DrawnSource>,
    /// What one should know of a log.
    notes: Vec<Message>,
}

impl Studio<'_> {
    /// Makes a product of a subject.
    ///
    /// # Errors
    ///
    /// The message to the page.
    pub fn make(&self, product: Product, subject: &Subject) -> Made {
        match product {
            Product::Live => self.live(subject),
            Product::Large { advice, files } => {
                self.large(subject, advice, files.then_some(Format::Png))
            }
            Product::Script => self.script(subject),
        }
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
    fn ready(&self, subject: &Subject, pixels: f64) -> std::result::Result<Ready, Message> {
        let told = |error| message(&error, subject);
        if subject.log.is_some() {
            let prepared = subject.prepared(self.scene, None, pixels).map_err(told)?;
            let PreparedScene { scene, profile } = prepared;
            let log = Shoot::of_log(scene, LOG.as_ref()).map_err(told)?;
            let notes = log.warnings.iter().map(Message::of_diagnostic).collect();
            let shoot = log.product;
            return Ok(Ready { shoot, profile, source: None, notes });
        }
        let (PreparedScene { scene, profile }, strokes) =
            self.drawn(subject, pixels).map_err(told)?;
        let source = source(&strokes);
        match Shoot::of_strokes(scene, strokes, &|_| Ok(())) {
            Ok(shoot) => Ok(Ready { shoot, profile, source, notes: Vec::new() }),
            // Of what is too much for a flight, the page leaves strokes out.
            Err(error) => {
                let mut message = told(error);
                message.values["source"] = json!(source);
                Err(message)
            }
        }
    }

    fn live(&self, subject: &Subject) -> Made {
        let told = |error| message(&error, subject);
        let Ready { shoot, source, notes, .. } = self.ready(subject, LIVE)?;
        let shot = self.shot(shoot, Judging::Scored, None).map_err(told)?;
        let files = vec![photo(&shot, LIVE_QUALITY)];
        let photo = PhotoFacts::new(&shot, notes);
        let facts = LiveFacts { photo, source, verdict: shot.verdict };
        Ok(Answer { facts: Facts::Live(facts.into()), files })
    }

    fn large(&self, subject: &Subject, advice: bool, format: Option<Format>) -> Made {
        let told = |error| message(&error, subject);
        let Ready { shoot, profile, notes, .. } = self.ready(subject, LARGE)?;
        let shot = self.shot(shoot, Judging::Explained, format).map_err(told)?;
        // What was flown needs no check.
        let findings = shot.shoot.is_planned.then(|| shot.findings(&profile)).transpose();
        let findings = findings.map_err(told)?.unwrap_or_default();
        let remedies = advice.then(|| (self.advice)(&shot)).transpose().map_err(told)?;
        let mut files = vec![photo(&shot, LARGE_QUALITY)];
        if format.is_some() {
            let digests = shot.each_file(|name, write| {
                let mut bytes = Vec::new();
                write(&mut bytes).expect("memory takes it");
                let digest = sha256(&bytes);
                // A page has no use for flights, which its scene flies again.
                if !name.starts_with("flight") {
                    files.push(File { name: name.into(), bytes });
                }
                Ok(digest)
            });
            let scene = shot.shoot.scene.portable().to_toml();
            let bytes = CarriedScene::text(&scene, digests.map_err(told)?).into_bytes();
            files.push(File { name: "scene.toml".into(), bytes });
            // The scene names it.
            if let Some((name, bytes)) = subject.drawing().map_err(told)? {
                files.push(File { name: name.into(), bytes });
            }
        }
        let facts = LargeFacts {
            photo: PhotoFacts::new(&shot, notes),
            remedies: remedies.unwrap_or_default(),
            stops: findings.iter().filter_map(Message::of_stop).collect(),
            drones: shot.shoot.plans.len(),
            flight_sha256: shot.flight_sha256(),
            controller: shot.shoot.scene.controller,
            verdict: shot.verdict,
        };
        Ok(Answer { facts: Facts::Large(facts.into()), files })
    }

    /// The scripts that fly a scene by cflib, with what they need, in the order of their names.
    fn script(&self, subject: &Subject) -> Made {
        let told = |error| message(&error, subject);
        let (PreparedScene { mut scene, profile }, strokes) =
            self.drawn(subject, LARGE).map_err(told)?;
        let format = ExportFormat::Cflib;
        let mode = make_exportable(&mut scene, Some(&profile), format, None).map_err(told)?;
        let tolerance_m = Form::Compressed.tolerance_m();
        let options = ExportOptions { format, mode, tolerance_m, profile, is_unchecked: false };
        let shoot = Shoot::of_strokes(scene, strokes, &|_| Ok(()));
        let checked = shoot.and_then(|shoot| CheckedExport::new(shoot, options)).map_err(told)?;
        let stops: Vec<Message> = checked.findings.iter().filter_map(Message::of_stop).collect();
        if !stops.is_empty() {
            return Err(Message::of_stops(&stops));
        }
        let mut files = checked.files(None).map_err(told)?.files;
        files.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Answer { facts: Facts::Script {}, files })
    }
}

fn photo(shot: &Shot, quality: u8) -> File {
    File { name: JPEG.into(), bytes: jpeg(&shot.photo, quality) }
}

/// Why there is no answer.
fn message(error: &Error, subject: &Subject) -> Message {
    match (error, &subject.log) {
        (Error::Input { .. }, Some(_)) => Message::of_log(&format!("{error}: {}", error.hint())),
        _ => Message::of_error(error, subject.is_picture()),
    }
}

impl PhotoFacts {
    /// Those of a shot; `notes` are of its log.
    fn new(shot: &Shot, notes: Vec<Message>) -> Self {
        // Warnings of the flight are for those who fly it.
        let is_seen = |problem: &&Diagnostic| {
            problem.is_stop() || FLAWS.contains(&code_on_page(problem.code))
        };
        let problems = shot.problems.iter().filter(is_seen);
        let (obstacles, flaws): (Vec<&Diagnostic>, Vec<_>) = problems.partition(|it| it.is_stop());
        Self {
            boxes: boxes(shot),
            flight_s: end_s(shot),
            height: shot.photo.height_px,
            obstacles: obstacles.into_iter().map(Message::of_diagnostic).collect(),
            replay: LightMap::new(shot),
            warnings: notes
                .into_iter()
                .chain(flaws.into_iter().map(Message::of_diagnostic))
                .collect(),
            width: shot.photo.width_px,
        }
    }
}

impl Suggestion {
    /// Changes of a scene with their gain; `None` without a change.
    pub fn new(set: Vec<Change>, gain: f64) -> Option<Self> {
        Some(Self { gain, said: Message::of_changes(&set)?, set })
    }
}

/// A drawing as its file has it; `None` of a word.
fn source(strokes: &Strokes) -> Option<DrawnSource> {
    let Source { corners_px, is_bitmap, strokes: all } = &strokes.source;
    let [left, top, right, bottom] = bounds(all.iter().flat_map(|it| it.points.iter().copied()));
    let ([x, y], scale) = match is_bitmap {
        true => ([0.0; 2], 1.0),
        false => ([left, top], 1e3 / f64::max(right - left, bottom - top).max(1e-9)),
    };
    let stroke = |SourceStroke { points, color }: &SourceStroke| {
        let points: Vec<[f64; 2]> =
            points.iter().map(|point| [scale * (point[0] - x), scale * (point[1] - y)]).collect();
        let kept = simplify(&points, 1.0).into_iter().flat_map(|index| points[index]);
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a picture")]
        let places = kept.map(|place| place.round() as i64).collect();
        DrawnStroke { places, color: *color }
    };
    let strokes: Vec<DrawnStroke> = all.iter().map(stroke).collect();
    (!strokes.is_empty()).then_some(DrawnSource { corners: *corners_px, strokes })
}
