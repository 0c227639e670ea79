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

/// Runs the verb `score`, which reads the word in a photo and reports how legible it is.
pub(super) fn run(args: &ScoreArgs) -> Result<Report> {
    let word = typed_word(args.word.as_ref(), args.as_word.as_ref())?;
    let output = args.output.as_deref().map(Output::create).transpose()?;
    let (mut photo, notes) = photo::read_with_notes(&args.photo)?;

    // The scene is the one named by --scene, or else the one in the photo. Files that the photo's
    // scene names are opened only with --trust.
    let inside = photo.scene_toml.clone().filter(|_| !args.scene.is_given());
    let has_camera = args.scene.is_given() || inside.is_some() || args.camera.is_given();
    let file = format!("{} (scene)", args.photo.display());
    let toml = inside.as_deref().unwrap_or_default();
    let mut scene = args.scene.load_or(toml, &file, &folder_of(&args.photo), |scene| {
        if inside.is_some() && !args.trust {
            distrust(args, scene, &file)?;
        }
        Ok(())
    })?;
    let foreign = foreign_file(args, &scene).filter(|_| inside.is_some());
    args.camera.apply(&mut scene)?;
    // If no camera is given, the photo is rotated until its writing is upright.
    let mut reading = None;
    if !has_camera && args.corners.is_none() {
        let upright = read_upright(photo, word.unwrap_or_default());
        (photo, reading) = (upright.0, Some(upright.1));
    }
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    // The camera framed the word that was flown, even if the photo is judged against another word.
    let flown = scene.has_strokes().then(|| scene.strokes()).transpose()?;
    if let Some(flown) = flown.as_ref().filter(|_| foreign.is_some()) {
        check_strokes(flown, notes.strokes_sha256.as_deref(), file)?;
    }
    if let Some(word) = word {
        set_word(&mut scene, word);
    }
    if !scene.has_strokes() {
        let hint = "name the word after the photo, or name the scene of the photo";
        return Err(Error::input("word", "none", "the word that the photo should show", hint));
    }
    let strokes = scene.strokes()?;
    if let Some(path) = &args.plan {
        check_written(&Plan::read_csv(path)?, &strokes)
            .map_err(|error| error.in_file(path.display(), None))?;
    }

    // The word is located by the given corners, by the detected writing, or by the camera's
    // framing.
    let located = match (&args.corners, &reading) {
        (Some(Corners(corners_px)), _) => {
            let size_px = [photo.width_px, photo.height_px];
            let plane = Homography::from_corners(strokes.bounds_m(), *corners_px, size_px)?;
            Some(View::Plane(plane))
        }
        (None, Some(reading)) => by_light(&photo, reading, &strokes)?,
        (None, None) => None,
    };
    let view = match located {
        Some(view) => view,
        None => {
            let framed = flown.as_ref().unwrap_or(&strokes);
            (&scene.camera.camera(framed.bounds_m(), 0.0)?).into()
        }
    };

    // The speed, lag and gaps of the flight explain faults better than the photo does.
    let mut flights = Vec::new();
    FLIGHTS.check_all(&args.flight)?;
    for path in &args.flight {
        let mut flight = args.flights.read(path, Some(&scene))?;
        // Lights are inferred in the same way as in `expose`.
        infer_lights_if_dark(&mut flight, &mut scene, path)?.into_iter().for_each(note);
        flights.push(flight);
    }
    check_flights(args, &flights, notes.flight_sha256.as_deref())?;
    let mut known = known(&flights, &scene.plan);
    if let Some(json) = notes.log_gaps_json.filter(|_| flights.is_empty()) {
        known.gaps = LogGap::parse(&json, &format!("{} (log gaps)", args.photo.display()))?;
    }
    let reader = Reader::new(&strokes, &scene.score)?;
    let (verdict, marks) = reader.explain(&photo, &view, &known)?;
    let mut files = Vec::new();
    if let Some(output) = output {
        let overlay = match args.output.as_deref().is_some_and(is_svg) {
            true => overlay_svg(&photo, &marks, &verdict).into_bytes(),
            false => photo::encode_png(&overlay_photo(&photo, &marks, &verdict), None, &[]),
        };
        files.push(output.keep(overlay)?);
    }
    let json = show::verdict_json(Some(&verdict), flight_sha256(&flights));
    let mut report = Report::new(show::verdict_table(&verdict), json);
    // `score` does not simulate the scene in a photo, because its origin is unknown.
    if inside.is_some() && !verdict.legible {
        let again = format!("`noctograph preview --scene {}`", shell_word(&args.photo));
        let text = format!("{again} simulates its scene again, and suggests settings that help");
        report.line("settings", &text);
    }
    Ok(report.with_files(&files).passes(verdict.legible))
}

/// Refuses a font or drawing whose strokes differ from those whose digest is in the photo
/// (`of_photo`), if the photo has one. `file` is the photo's name in messages.
fn check_strokes(strokes: &Strokes, of_photo: Option<&str>, file: String) -> Result<()> {
    let Some(digest) = of_photo.filter(|digest| strokes.sha256() != **digest) else {
        return Ok(());
    };
    let actual = "a font or drawing with other strokes";
    let hint = "find the font or drawing with which the photo was made";
    Err(Error::input(file, actual, format!("strokes with the digest {digest}"), hint))
}

/// Returns the first key of the photo's scene that names a file and was not typed.
fn foreign_file(args: &ScoreArgs, scene: &Scene) -> Option<&'static str> {
    scene.letters.files().map(|(key, _)| key).find(|key| !args.scene.sets(key))
}

/// Refuses the scene in a photo if the scene names a font or a drawing. Removes the scene's
/// background, which a verdict does not need.
fn distrust(args: &ScoreArgs, scene: &mut Scene, file: &str) -> Result<()> {
    scene.photo.background.clear();
    let Some(key) = foreign_file(args, scene) else { return Ok(()) };
    let hint = "pass a scene with --scene, or trust the photo's scene if you know who made it";
    let wanted = "a built-in font, because a photo may name any file";
    Err(Error::input(key, "the path of a file", wanted, hint).in_file(file, None))
}

/// Refuses flights whose digests are not among those in the photo, if the photo has any.
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

/// Returns the view in which the word is located by its light, or `None` if none is found, and
/// prints a note on which of both it is.
fn by_light(photo: &Photo, reading: &Reading, strokes: &Strokes) -> Result<Option<View>> {
    let view = find_word(photo, reading, strokes);
    let text = match view {
        Some(_) => "no camera is given: the word is located by its light",
        None => "no camera is given and no writing was found: the default camera is assumed",
    };
    message("note: ", text);
    Ok(view)
}
