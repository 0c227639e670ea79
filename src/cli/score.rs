//! `noctograph score` judges whether the word in a photograph is legible.

use std::path::PathBuf;

use super::flags::{SceneFlags, set_word, typed_word};
use super::flight_flags::{FLIGHTS, FlightFlags, infer_lights_if_dark, note};
use super::names::Corners;
use super::outcome::{Report, shell_word};
use super::output::{Output, is_svg};
use super::picture::CameraFlags;
use super::read::read_upright;
use super::show;
use super::terminal::message;
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::letters::Strokes;
use crate::photo::png::Notes;
use crate::photo::{self, Photo};
use crate::plan::Plan;
use crate::preflight::check_written;
use crate::report::{overlay_photo, overlay_svg};
use crate::scene::{Scene, folder_of};
use crate::score::{Homography, LogGap, Reader, Reading, View, find_word};
use crate::shoot::{flight_sha256, known};
use clap::Args;

#[derive(Debug, Args)]
pub(super) struct ScoreArgs {
    /// Photo to judge (PNG or JPEG): a render, or a picture from a camera
    photo: PathBuf,
    /// Expected word [default: the scene's]
    word: Option<String>,
    /// Expected word, even if a file has this name
    #[arg(long = "word", value_name = "WORD", conflicts_with_all = ["word"])]
    as_word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    camera: CameraFlags,
    /// Corners of the word in the photo, in pixels, clockwise from the upper left, in place of a
    /// camera
    #[arg(long, value_name = "X,Y X,Y X,Y X,Y", allow_hyphen_values = true, conflicts_with_all = ["camera", "camera_from"])]
    corners: Option<Corners>,
    /// Plan that was flown, which must write the word
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Flights or logs that the photo shows, from which speed, lag and contour error are computed
    #[arg(long, value_name = "FILE", num_args = 1..)]
    flight: Vec<PathBuf>,
    #[command(flatten)]
    flights: FlightFlags,
    /// Open the font or drawing that the photo's scene names, relative to the photo's folder. Use
    /// this only for photos from authors whom you trust
    #[arg(long)]
    trust: bool,
    /// Picture to write, PNG or SVG: the photo with intended strokes (green), missing ones (pink),
    /// other light (yellow) and the probability of each letter
    #[arg(short, long, value_name = "FILE", alias = "overlay")]
    output: Option<PathBuf>,
}

/// Runs the verb `score`, which reads the word in a photo and reports how legible it is. Writes a
/// picture of the photo with the judged strokes if an output is given. The report passes if the
/// word is legible.
pub(super) fn run(args: &ScoreArgs) -> Result<Report> {
    let word = typed_word(args.word.as_ref(), args.as_word.as_ref())?;
    let output = args.output.as_deref().map(Output::create).transpose()?;
    let (photo, notes) = photo::read_with_notes(&args.photo)?;
    let has_scene = photo.scene_toml.is_some() && !args.scene.is_given();
    let Subject { photo, mut scene, strokes, view } = subject(args, photo, &notes, word)?;
    if let Some(path) = &args.plan {
        check_written(&Plan::read_csv(path)?, &strokes)
            .map_err(|error| error.in_file(path.display(), None))?;
    }
    // The speed, lag and gaps of the flight explain faults better than the photo does.
    let flights = flights(args, &mut scene, notes.flight_sha256.as_deref())?;
    let mut known = known(&flights, &scene.plan);
    if let Some(json) = notes.log_gaps_json.filter(|_| flights.is_empty()) {
        known.gaps = LogGap::parse(&json, &format!("{} (log gaps)", args.photo.display()))?;
    }
    let (verdict, marks) = Reader::new(&strokes, &scene.score)?.explain(&photo, &view, &known)?;
    let mut files = Vec::new();
    if let Some(output) = output {
        let overlay = if args.output.as_deref().is_some_and(is_svg) {
            overlay_svg(&photo, &marks, &verdict).into_bytes()
        } else {
            photo::encode_png(&overlay_photo(&photo, &marks, &verdict), None, &[])
        };
        files.push(output.keep(overlay)?);
    }
    let json = show::verdict_json(Some(&verdict), flight_sha256(&flights));
    let mut report = Report::new(show::verdict_table(&verdict), json);
    // `score` does not simulate the scene in a photo, because its origin is unknown.
    if has_scene && !verdict.legible {
        let again = format!("`noctograph preview --scene {}`", shell_word(&args.photo));
        let text = format!("{again} simulates its scene again, and suggests settings that help");
        report.line("settings", &text);
    }
    Ok(report.with_files(&files).passes(verdict.legible))
}

/// A photo with the word that it should show, and the position of the word in the photo.
struct Subject {
    photo: Photo,
    scene: Scene,
    strokes: Strokes,
    view: View,
}

/// Returns the photo with its expected word and the view in which the word is judged. If neither a
/// camera nor corners are known, the photo is rotated until its writing is upright. `word` is the
/// word that was typed, which replaces that of the scene.
fn subject(args: &ScoreArgs, photo: Photo, notes: &Notes, word: Option<&str>) -> Result<Subject> {
    let has_scene = photo.scene_toml.is_some() && !args.scene.is_given();
    let place = format!("{} (scene)", args.photo.display());
    let mut scene = scene(args, photo.scene_toml.as_deref().filter(|_| has_scene), &place)?;
    let has_foreign_file = has_scene && foreign_file(args, &scene).is_some();
    let has_camera = has_scene || args.scene.is_given() || args.camera.is_given();
    let (photo, reading) = if has_camera || args.corners.is_some() {
        (photo, None)
    } else {
        let (photo, reading) = read_upright(photo, word.unwrap_or_default());
        (photo, Some(reading))
    };
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    // The camera framed the word that was flown, even if the photo is judged against another word.
    let flown = scene.has_strokes().then(|| scene.strokes()).transpose()?;
    if let Some(flown) = flown.as_ref().filter(|_| has_foreign_file) {
        check_strokes(flown, notes.strokes_sha256.as_deref(), place)?;
    }
    if let Some(word) = word {
        set_word(&mut scene, word);
    }
    if !scene.has_strokes() {
        let hint = "name the word after the photo, or name the scene of the photo";
        return Err(Error::input("word", "none", "the word that the photo should show", hint));
    }
    let strokes = scene.strokes()?;
    let view = match located(args.corners.as_ref(), reading.as_ref(), &photo, &strokes)? {
        Some(view) => view,
        None => (&scene.camera.camera(flown.as_ref().unwrap_or(&strokes).bounds_m(), 0.0)?).into(),
    };
    Ok(Subject { photo, scene, strokes, view })
}

/// Returns the scene of a photo with the camera of the flags: the scene that `--scene` names, or
/// else the scene in the photo (`toml`), or else the default scene. The scene in a photo may name
/// files only with `--trust`. `place` names it in messages.
fn scene(args: &ScoreArgs, toml: Option<&str>, place: &str) -> Result<Scene> {
    let folder = folder_of(&args.photo);
    let distrust = |scene: &mut Scene| match toml.filter(|_| !args.trust) {
        Some(_) => distrust(args, scene, place),
        None => Ok(()),
    };
    let mut scene = args.scene.load_or(toml.unwrap_or_default(), place, &folder, distrust)?;
    args.camera.apply(&mut scene)?;
    Ok(scene)
}

/// Reads the flights that the photo shows, and infers the lights of a flight without lights, as
/// `expose` does. `digests` contains the digests of the flights in the photo, if it has any.
fn flights(args: &ScoreArgs, scene: &mut Scene, digests: Option<&str>) -> Result<Vec<Flight>> {
    let mut flights = Vec::new();
    FLIGHTS.check_all(&args.flight)?;
    for path in &args.flight {
        let mut flight = args.flights.read(path, Some(scene))?;
        infer_lights_if_dark(&mut flight, scene, path)?.into_iter().for_each(note);
        flights.push(flight);
    }
    check_flights(args, &flights, digests)?;
    Ok(flights)
}

/// Refuses strokes of a font or drawing whose digest differs from the one in the photo
/// (`digest`), if the photo contains a digest. `place` names the photo's scene in messages.
fn check_strokes(strokes: &Strokes, digest: Option<&str>, place: String) -> Result<()> {
    let Some(digest) = digest.filter(|digest| strokes.sha256() != **digest) else {
        return Ok(());
    };
    let actual = "a font or drawing with other strokes";
    let hint = "find the font or drawing with which the photo was made";
    Err(Error::input(place, actual, format!("strokes with the digest {digest}"), hint))
}

/// Returns the first key of the photo's scene that names a file and was not typed.
fn foreign_file(args: &ScoreArgs, scene: &Scene) -> Option<&'static str> {
    scene.letters.files().map(|(key, _)| key).find(|key| !args.scene.sets(key))
}

/// Refuses the scene in a photo if the scene names a font or a drawing. Removes the scene's
/// background, which a verdict does not need. `place` names the scene in messages.
fn distrust(args: &ScoreArgs, scene: &mut Scene, place: &str) -> Result<()> {
    scene.photo.background.clear();
    let Some(key) = foreign_file(args, scene) else { return Ok(()) };
    let hint = "pass a scene with --scene, or trust the photo's scene if you know who made it";
    let wanted = "a built-in font, because a photo may name any file";
    Err(Error::input(key, "the path of a file", wanted, hint).in_file(place, None))
}

/// Refuses flights whose digests are not among those in the photo (`shown`, separated by spaces),
/// if the photo contains any.
fn check_flights(args: &ScoreArgs, flights: &[Flight], shown: Option<&str>) -> Result<()> {
    let Some(shown) = shown else { return Ok(()) };
    for (flight, path) in flights.iter().zip(&args.flight) {
        let digest = flight.sha256();
        if !shown.split(' ').any(|known| known == digest) {
            let hint = "name the flight that was exposed in this photo";
            let actual = format!("a flight with the digest {digest}");
            let wanted = format!("the flight that the photo shows, {shown}");
            return Err(Error::input(path.display(), actual, wanted, hint));
        }
    }
    Ok(())
}

/// Returns the view that maps the word to the photo, from the corners that were given, or else from
/// the writing that was read. Prints a note on whether the word's light was found. Returns `None`
/// if the camera determines the view.
fn located(
    corners: Option<&Corners>,
    reading: Option<&Reading>,
    photo: &Photo,
    strokes: &Strokes,
) -> Result<Option<View>> {
    if let Some(Corners(corners_px)) = corners {
        let size_px = [photo.width_px, photo.height_px];
        let plane = Homography::from_corners(strokes.bounds_m(), *corners_px, size_px)?;
        return Ok(Some(View::Plane(plane)));
    }
    let Some(reading) = reading else { return Ok(None) };
    let view = find_word(photo, reading, strokes);
    let text = match view {
        Some(_) => "no camera is given: the word is located by its light",
        None => "no camera is given and no writing was found: the default camera is assumed",
    };
    message("note: ", text);
    Ok(view)
}
