//! Makes the answers for a page, with a photograph and its verdict, the path of the light over
//! time, and the letters' boxes. Facts are typed, and files are bytes beside them.

use std::collections::BTreeMap;

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::PreparedScene;
use super::messages::{Message, code_on_page};
use super::replay::{LetterBox, LightMap, boxes, end_s};
use super::request::{LOG, Product, Subject};
use noctograph_core::camera::{Camera, Metering};
use noctograph_core::diagnostic::{Change, Diagnostic};
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::{bounds, simplify};
use noctograph_core::strokes::{Source, SourceStroke, Strokes};
use noctograph_export::zip::zip;
use noctograph_export::{File, Form, Format as ExportFormat};
use noctograph_logs::{GrowingLog, ImportOptions};
use noctograph_picture::expose::{BackendChoice, GrowingFilm};
use noctograph_picture::photo::jpeg;
use noctograph_pipeline::preflight::{CheckedExport, ExportOptions, Profile, make_exportable};
use noctograph_pipeline::scene::{CarriedScene, Scene};
use noctograph_pipeline::shoot::problems::FLAWS;
use noctograph_pipeline::shoot::{
    Format, Judging, Recording, Shoot, Shot, Watch, infer_lights_if_dark,
};
use noctograph_score::Verdict;
use noctograph_sim::ControllerOptions;

/// Approximate number of pixels of the photo that is shown while a visitor types.
const LIVE_PIXELS: f64 = 960.0 * 540.0;
/// Approximate number of pixels of the large photo.
const LARGE_PIXELS: f64 = 1920.0 * 1080.0;
/// JPEG quality, out of 100, of the photo that is shown while a visitor types.
const LIVE_QUALITY: u8 = 85;
/// JPEG quality, out of 100, of the large photo.
const LARGE_QUALITY: u8 = 92;

/// File name of the photo that every page shows.
pub const JPEG: &str = "photo.jpg";

/// An answer, or a message that gives the reason for a refusal.
pub type Made = std::result::Result<Answer, Message>;

/// Answer to a request.
#[derive(Debug)]
pub struct Answer {
    /// Facts about the product.
    pub facts: Facts,
    /// The photo as [`JPEG`] and the requested files, or the scripts.
    pub files: Vec<File>,
}

/// Facts about a product.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub enum Facts {
    /// Facts about the photo that is shown while a visitor types.
    Live(Box<LiveFacts>),
    /// Facts about the large photo.
    Large(Box<LargeFacts>),
    /// No facts, for scripts, or for the photo of a flight that has not ended.
    Script {},
}

/// Facts about a photo of either size.
#[derive(Debug, Serialize)]
pub struct PhotoFacts {
    /// Box of each letter, or an empty list for a drawing.
    pub boxes: Vec<Option<LetterBox>>,
    /// Duration of the longest flight, in s.
    pub flight_s: f64,
    /// Height of the photo, in pixels.
    pub height: u32,
    /// Problems that make any word unreadable.
    pub obstacles: Vec<Message>,
    /// Path of the light over time.
    pub replay: LightMap,
    /// Other problems of the picture.
    pub warnings: Vec<Message>,
    /// Width of the photo, in pixels.
    pub width: u32,
}

/// Facts about the photo that is shown while a visitor types.
#[derive(Debug, Serialize)]
pub struct LiveFacts {
    /// Facts about a photo of either size.
    #[serde(flatten)]
    pub photo: PhotoFacts,
    /// Strokes of the drawing, or null for a word.
    pub source: Option<DrawnSource>,
    /// Verdict, or null for a drawing.
    pub verdict: Option<Verdict>,
}

/// Facts about the large photo, which consist of the members of `preview --json` and further facts
/// for the page.
#[derive(Debug, Serialize)]
pub struct LargeFacts {
    /// Facts about a photo of either size.
    #[serde(flatten)]
    pub photo: PhotoFacts,
    /// Verdict with its causes. All of its members are omitted for a drawing.
    #[serde(flatten)]
    pub verdict: Option<Verdict>,
    /// Controller of the flight.
    pub controller: ControllerOptions,
    /// Number of drones.
    pub drones: usize,
    /// SHA-256 digests of the flights.
    pub flight_sha256: Option<String>,
    /// Changes that make an unreadable word easier to read.
    pub remedies: Vec<Suggestion>,
    /// Checks that stop the flight.
    pub stops: Vec<Message>,
}

/// Changes to a scene that make its word easier to read.
#[derive(Debug, Serialize)]
pub struct Suggestion {
    /// Increase of the probability that the word is read.
    pub gain: f64,
    /// Sentence that describes the changes.
    pub message: Message,
    /// The changed keys with their values.
    pub set: Vec<Change>,
}

/// A drawing as its file contains it. Coordinates are whole pixels of a picture, or thousandths of
/// the larger side of another drawing. y points down.
#[derive(Debug, Serialize)]
pub struct DrawnSource {
    /// Corners of the sheet of paper.
    pub corners: Option<[[f64; 2]; 4]>,
    /// All strokes in the order of their numbers.
    pub strokes: Vec<DrawnStroke>,
}

/// A stroke of a drawing's file.
#[derive(Debug, Serialize)]
pub struct DrawnStroke {
    /// Coordinates of the points in the order x, y, x, y …
    #[serde(rename = "at")]
    pub coordinates: Vec<i64>,
    /// Name of the stroke's color.
    pub color: Option<&'static str>,
}

/// The members of a request that the page receives back with the answer.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Asked {
    /// Name of the stored request for a large photo, which the page sends to have the photo flown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Number of the request.
    pub number: Option<u64>,
}

/// An answer for a page, with files in base64.
#[derive(Debug, Default, Serialize)]
pub struct PageAnswer {
    /// Members of the request that the page receives back.
    #[serde(flatten)]
    asked: Asked,
    /// Facts about the product.
    #[serde(flatten)]
    facts: Option<Facts>,
    /// The reason why there is no answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<Message>,
    /// The photo as a data URL.
    #[serde(skip_serializing_if = "Option::is_none")]
    photo: Option<String>,
    /// Contents of the files by file name.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    files: BTreeMap<String, String>,
}

impl PageAnswer {
    /// Makes the answer for a page from an answer or the message of a refusal. All scripts are put
    /// in one archive.
    pub fn new(asked: Asked, made: Made) -> Self {
        let Answer { facts, mut files } = match made {
            Ok(answer) => answer,
            Err(message) => return Self { asked, error: Some(message), ..Self::default() },
        };
        if matches!(facts, Facts::Script {}) {
            files = vec![File { name: "flight.zip".into(), bytes: zip(&files) }];
        }
        // The page displays the photo, and lets the visitor save all other files.
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

    /// Returns the answer as JSON.
    pub fn json(&self) -> String {
        json!(self).to_string()
    }
}

/// Function that returns the scene that the page's controls show at the start, with settings that
/// override its keys.
pub type Base<'a> = dyn Fn(&[(&str, &str)]) -> Result<Scene> + 'a;

/// Makes the products that pages request.
#[expect(missing_debug_implementations, reason = "its fields are functions")]
pub struct Studio<'a> {
    /// Returns the page's scene, with settings that override its keys.
    pub scene: &'a Base<'a>,
    /// Finds a typeface file that contains all letters of a word, if the scene's font lacks some of
    /// them.
    pub typeface: &'a dyn Fn(&str) -> Result<Option<String>>,
    /// Finds changes that make an unreadable word easier to read.
    pub advice: &'a dyn Fn(&Shot) -> Result<Vec<Suggestion>>,
    /// True if words are written for an audience, see [`Scene::for_audience`].
    pub has_audience: bool,
    /// Receives the progress of a photo.
    pub watch: &'a Watch<'a>,
}

/// Film of a flight that is being followed.
#[derive(Debug, Default)]
pub struct FlightFilm {
    film: GrowingFilm,
    /// Aperture and sensitivity of the visitor's photo. Those metered for the light so far would
    /// change with each letter.
    exposure: Option<[f64; 2]>,
}

/// A subject that is ready to be photographed.
struct Ready {
    shoot: Shoot,
    profile: Profile,
    source: Option<DrawnSource>,
    /// Warnings about the subject's log.
    notes: Vec<Message>,
}

/// Options of a large photo.
struct LargeOptions {
    /// True if the answer contains remedies for an illegible word.
    advice: bool,
    /// Format of the photo's file. `None` if the files are not made.
    format: Option<Format>,
}

/// Reason why a product is not made, which is an error of a stage or a message to the page.
enum Refusal {
    Stage(Error),
    Page(Message),
}

type Attempt<T> = std::result::Result<T, Refusal>;

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::Stage(error)
    }
}

impl Studio<'_> {
    /// Makes a product of a subject, or returns a message that gives the reason for a refusal.
    pub fn make(&self, product: Product, subject: &Subject) -> Made {
        let made = match product {
            Product::Live => self.live(subject),
            Product::Large { advice, files } => {
                let options = LargeOptions { advice, format: files.then_some(Format::Png) };
                self.prepare(subject, LARGE_PIXELS)
                    .and_then(|ready| self.judged(subject, ready, options))
            }
            Product::Script => self.script(subject),
        };
        made.map_err(|refusal| match refusal {
            Refusal::Stage(error) => refusal_message(&error, subject),
            Refusal::Page(message) => message,
        })
    }

    /// Returns the scene and the strokes of a subject, for a photo of about `pixels`. If the
    /// scene's font lacks a letter, the word is written in a typeface that has all letters.
    fn strokes_for(&self, subject: &Subject, pixels: f64) -> Result<(PreparedScene, Strokes)> {
        let mut prepared = subject.prepared(self.scene, None, pixels)?;
        let strokes = match (prepared.scene.strokes(), subject.title()) {
            (Err(missing_letter @ Error::Letter { .. }), Some(word)) => {
                let Some(face) = (self.typeface)(word)? else { return Err(missing_letter) };
                prepared = subject.prepared(self.scene, Some(&face), pixels)?;
                prepared.scene.strokes()?
            }
            (strokes, _) => strokes?,
        };
        // The changes for an audience do not affect the strokes.
        if self.has_audience {
            prepared.scene.for_audience();
        }
        Ok((prepared, strokes))
    }

    /// Takes a photograph, on the CPU and without keeping its film.
    fn take(&self, shoot: Shoot, judging: Judging, format: Option<Format>) -> Result<Shot> {
        let backend = BackendChoice::Cpu;
        Shoot { judging, format, backend, keeps_film: false, ..shoot }.take(self.watch)
    }

    /// Returns the planned photograph of a subject, with about `pixels` pixels in all. A subject
    /// with a log is photographed as it flew.
    fn prepare(&self, subject: &Subject, pixels: f64) -> Attempt<Ready> {
        if subject.log.is_some() {
            let PreparedScene { scene, profile } = subject.prepared(self.scene, None, pixels)?;
            let log = Shoot::of_log(scene, LOG.as_ref())?;
            let notes = log.warnings.iter().map(Message::of_diagnostic).collect();
            let shoot = log.product;
            return Ok(Ready { shoot, profile, source: None, notes });
        }
        let (PreparedScene { scene, profile }, strokes) = self.strokes_for(subject, pixels)?;
        let source = drawn_source(&strokes);
        match Shoot::of_strokes(scene, strokes, &|_| Ok(())) {
            Ok(shoot) => Ok(Ready { shoot, profile, source, notes: Vec::new() }),
            // If a drawing is too large, the answer contains its strokes, so that the visitor can
            // leave some out on the page.
            Err(error) => {
                let mut message = refusal_message(&error, subject);
                message.values["source"] = json!(source);
                Err(Refusal::Page(message))
            }
        }
    }

    /// Makes the photo that is shown while a visitor types.
    fn live(&self, subject: &Subject) -> Attempt<Answer> {
        let Ready { shoot, source, notes, .. } = self.prepare(subject, LIVE_PIXELS)?;
        let shot = self.take(shoot, Judging::Scored, None)?;
        let files = vec![jpeg_file(&shot, LIVE_QUALITY)];
        let photo = PhotoFacts::new(&shot, notes);
        let facts = LiveFacts { photo, source, verdict: shot.verdict };
        Ok(Answer { facts: Facts::Live(facts.into()), files })
    }

    /// Photographs the flight of a subject from its log. During the flight, only the new light is
    /// drawn on the film, and the photo is not judged. A log that is still too short yields no
    /// photo. When the flight is over, the answer is that for the large photo. `is_over` states
    /// that no more of the log will come.
    pub fn follow(
        &self,
        subject: &Subject,
        log: &GrowingLog,
        film: &mut FlightFilm,
        is_over: bool,
    ) -> Made {
        match self.flown(subject, log, film, is_over) {
            Ok(answer) => Ok(answer),
            Err(_too_short) if !is_over => {
                Ok(Answer { facts: Facts::Script {}, files: Vec::new() })
            }
            Err(Refusal::Stage(error)) => Err(Message::of_log_error(&error)),
            Err(Refusal::Page(message)) => Err(message),
        }
    }

    /// Returns the photo of the flight so far, as [`Self::follow`] does. If the flight `is_over`,
    /// this is the large photo. Meters the exposure in the first call, and keeps it in `film`.
    /// Refuses a log that is too short for a photo.
    fn flown(
        &self,
        subject: &Subject,
        log: &GrowingLog,
        film: &mut FlightFilm,
        is_over: bool,
    ) -> Attempt<Answer> {
        // The scene and the camera are those of the visitor's photo.
        let (PreparedScene { mut scene, profile }, strokes) =
            self.strokes_for(subject, LARGE_PIXELS)?;
        // The exposure of the visitor's photo is kept, so that the light of earlier letters does
        // not change when new light is added.
        if !is_over {
            let exposure = match film.exposure {
                Some(exposure) => exposure,
                None => {
                    let promised = Shoot::of_strokes(scene.clone(), strokes, &|_| Ok(()))?;
                    let Camera { f_number, iso, .. } = promised.lighting(self.watch)?.camera;
                    [f_number, iso]
                }
            };
            film.exposure = Some(exposure);
            [scene.camera.f_number, scene.camera.iso] = exposure;
            scene.camera.metering = Metering::Off;
        }
        let firmware = Some(scene.vehicle.firmware);
        let mut flight = log.flight(&ImportOptions { firmware, ..Default::default() })?.flight;
        infer_lights_if_dark(&mut flight, &mut scene)?;
        let shoot = Shoot::with_recordings(scene, vec![Recording::Flight(flight)])?;
        if is_over {
            let ready = Ready { shoot, profile, source: None, notes: Vec::new() };
            let options = LargeOptions { advice: false, format: Some(Format::Png) };
            return self.judged(subject, ready, options);
        }
        let shoot = Shoot { judging: Judging::Skipped, keeps_film: false, ..shoot };
        let files = vec![jpeg_file(&shoot.take_on(&mut film.film)?, LIVE_QUALITY)];
        Ok(Answer { facts: Facts::Script {}, files })
    }

    /// Takes the large photo of a subject that is ready, and judges it.
    fn judged(
        &self,
        subject: &Subject,
        Ready { shoot, profile, notes, .. }: Ready,
        LargeOptions { advice, format }: LargeOptions,
    ) -> Attempt<Answer> {
        let shot = self.take(shoot, Judging::Explained, format)?;
        // The flight in a log is over, and therefore needs no check.
        let findings = if shot.shoot.is_planned { shot.findings(&profile)? } else { Vec::new() };
        let remedies = if advice { (self.advice)(&shot)? } else { Vec::new() };
        let mut files = vec![jpeg_file(&shot, LARGE_QUALITY)];
        if format.is_some() {
            files.extend(photo_files(&shot)?);
            // The drawing's file is added, because the scene refers to it.
            if let Some((name, bytes)) = subject.drawing()? {
                files.push(File { name: name.into(), bytes });
            }
        }
        let facts = LargeFacts {
            photo: PhotoFacts::new(&shot, notes),
            remedies,
            stops: findings.iter().filter_map(Message::of_stop).collect(),
            drones: shot.shoot.plans.len(),
            flight_sha256: shot.flight_sha256(),
            controller: shot.shoot.scene.controller,
            verdict: shot.verdict,
        };
        Ok(Answer { facts: Facts::Large(facts.into()), files })
    }

    /// Makes the cflib scripts that fly a subject, and the files that they need, sorted by name.
    /// Refuses a flight that a check stops.
    fn script(&self, subject: &Subject) -> Attempt<Answer> {
        let (PreparedScene { mut scene, profile }, strokes) =
            self.strokes_for(subject, LARGE_PIXELS)?;
        let format = ExportFormat::Cflib;
        let mode = make_exportable(&mut scene, Some(&profile), format, None)?;
        let tolerance_m = Form::Compressed.tolerance_m();
        let options = ExportOptions { format, mode, tolerance_m, profile, is_unchecked: false };
        let shoot = Shoot::of_strokes(scene, strokes, &|_| Ok(()))?;
        let checked = CheckedExport::new(shoot, options)?;
        let stops: Vec<Message> = checked.findings.iter().filter_map(Message::of_stop).collect();
        if !stops.is_empty() {
            return Err(Refusal::Page(Message::of_stops(&stops)));
        }
        let mut files = checked.files(None)?.files;
        files.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Answer { facts: Facts::Script {}, files })
    }
}

/// Returns the photo, the plans and the scene as files. Flights are omitted, because they can be
/// reproduced from the scene.
fn photo_files(shot: &Shot) -> Result<Vec<File>> {
    let mut files = Vec::new();
    let digests = shot.each_file(|name, write| {
        let mut bytes = Vec::new();
        write(&mut bytes).expect("memory takes it");
        // The scene contains the digests of all files, including the omitted flights.
        let digest = sha256(&bytes);
        if !name.starts_with("flight") {
            files.push(File { name: name.into(), bytes });
        }
        Ok(digest)
    })?;
    let scene = shot.shoot.scene.portable().to_toml();
    let bytes = CarriedScene::text(&scene, digests).into_bytes();
    files.push(File { name: "scene.toml".into(), bytes });
    Ok(files)
}

/// Encodes the photo that a page shows.
fn jpeg_file(shot: &Shot, quality: u8) -> File {
    File { name: JPEG.into(), bytes: jpeg(&shot.photo, quality) }
}

/// Returns the message to the page about an error.
fn refusal_message(error: &Error, subject: &Subject) -> Message {
    match (error, &subject.log) {
        (Error::Input { .. }, Some(_)) => Message::of_log_error(error),
        _ => Message::of_error(error, subject.is_picture()),
    }
}

impl PhotoFacts {
    /// Returns the facts about a shot. `notes` are the warnings about its log.
    fn new(shot: &Shot, notes: Vec<Message>) -> Self {
        let (obstacles, others): (Vec<&Diagnostic>, Vec<_>) =
            shot.problems.iter().partition(|problem| problem.is_stop());
        // The page shows a visitor flaws of the picture, but not warnings about the flight.
        let flaws =
            others.into_iter().filter(|problem| FLAWS.contains(&code_on_page(problem.code)));
        Self {
            boxes: boxes(shot),
            flight_s: end_s(shot),
            height: shot.photo.height_px,
            obstacles: obstacles.into_iter().map(Message::of_diagnostic).collect(),
            replay: LightMap::new(shot),
            warnings: notes.into_iter().chain(flaws.map(Message::of_diagnostic)).collect(),
            width: shot.photo.width_px,
        }
    }
}

impl Suggestion {
    /// Makes a suggestion of changes and their gain, or returns `None` if there is no change.
    pub fn new(set: Vec<Change>, gain: f64) -> Option<Self> {
        Some(Self { gain, message: Message::of_changes(&set)?, set })
    }
}

/// Returns the strokes of the drawing's file, before they are laid out, simplified and rounded to
/// the units of [`DrawnSource`], or `None` for a word.
fn drawn_source(strokes: &Strokes) -> Option<DrawnSource> {
    let Source { corners_px, is_bitmap, strokes } = &strokes.source;
    let points = strokes.iter().flat_map(|stroke| stroke.points.iter().copied());
    let [left, top, right, bottom] = bounds(points);
    // The strokes of a drawing that is not a picture are shifted to 0, 0 and scaled so that the
    // larger side has 1000 units.
    let ([left, top], scale) = if *is_bitmap {
        ([0.0; 2], 1.0)
    } else {
        // A drawing of a single point has no extent.
        ([left, top], 1e3 / f64::max(right - left, bottom - top).max(1e-9))
    };
    let mut drawn = Vec::new();
    for SourceStroke { points, color } in strokes {
        // Whole units are accurate enough. Points within one unit of the line between their
        // neighbors are omitted.
        let points: Vec<[f64; 2]> =
            points.iter().map(|[x, y]| [scale * (x - left), scale * (y - top)]).collect();
        let kept = simplify(&points, 1.0).into_iter().flat_map(|index| points[index]);
        #[expect(clippy::cast_possible_truncation, reason = "pixels, or units up to 1000")]
        let coordinates = kept.map(|coordinate| coordinate.round() as i64).collect();
        drawn.push(DrawnStroke { coordinates, color: *color });
    }
    (!drawn.is_empty()).then_some(DrawnSource { corners: *corners_px, strokes: drawn })
}
