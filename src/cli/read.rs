//! `noctograph read` recognizes the word in a photograph without being told it.

use std::path::PathBuf;

use super::names::Corners;
use super::outcome::Report;
use super::picture::CameraFlags;
use super::terminal::message;
use crate::camera::Framing;
use crate::error::Result;
use crate::photo::{self, Photo};
use crate::score::{
    ReadLetter, Reading, View, has_bright_edge, mirrored, quarter_turned, read_any_way_up,
    read_mirrored,
};
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct ReadArgs {
    /// Photo to read (PNG or JPEG): a render, or a picture from a camera
    photo: PathBuf,
    /// Corners of the line of writing in the photo, in pixels, clockwise from the upper left, for a
    /// photo taken at an angle
    #[arg(long, value_name = "X,Y X,Y X,Y X,Y", allow_hyphen_values = true, conflicts_with_all = ["camera", "camera_from"])]
    corners: Option<Corners>,
    #[command(flatten)]
    camera: CameraFlags,
}

/// Probability from which a note names a single mark that is too unclear to be writing. Below it,
/// the mark resembles no letter.
const NOTED: f64 = 0.4;
/// Angle of a quarter turn in degrees.
const QUARTER_DEG: usize = 90;

/// Runs the verb `read`, which reads the writing in a photo. The report passes if any writing is
/// found. A note names a single mark that is almost clear enough to be writing.
pub(super) fn run(args: &ReadArgs) -> Result<Report> {
    let photo = photo::read(&args.photo)?;
    let photo = square_on(photo, args.corners.as_ref(), &args.camera)?;
    // A single mark must be clearer than the letters of a word.
    let reading = read_upright(photo, "").1;
    let single = match reading.letters[..] {
        [ReadLetter { letter, p, .. }] => Some((letter, p)),
        _ => None,
    };
    let reading = reading.of_writing();
    if let Some((letter, p)) = single
        && reading.text.is_empty()
        && p >= NOTED
    {
        let text = format!("a single mark is too unclear to be writing: {letter} with {p:.2}");
        message("note: ", &text);
    }
    let text = Some(&reading.text).filter(|text| !text.is_empty());
    let report = Report::with_words(&reading, &json!({ "line": text }), LAYOUT);
    Ok(report.passes(!reading.text.is_empty()))
}

const LAYOUT: &str = "\
{line~no writing found}

|letters|letter<10|P<0
{letter}|{p:.2}
";

/// Reads a photo, rotated until its writing is upright, or until `word` is if it is not empty.
/// Returns the rotated photo and the reading. Mirrored writing is flipped if no word is given and
/// the writing is clear only when it is flipped. Prints notes on a rotation, on mirrored or smaller
/// writing, and on a bright border.
pub(super) fn read_upright(photo: Photo, word: &str) -> (Photo, Reading) {
    if has_bright_edge(&photo) {
        message("note: ", "the photo's border is bright: crop the photo, or invert dark writing");
    }
    // Smaller writing, such as a photographer's credit, is ignored, but mentioned in a note.
    let (reading, quarters) = read_any_way_up(&photo, word);
    if !reading.smaller.is_empty() {
        let text = reading.smaller.replace('\n', " ");
        message("note: ", &format!("smaller writing is ignored: {text}"));
    }
    if quarters == 0 {
        let Some((flipped, turns)) = read_mirrored(&photo, &reading, word) else {
            return (photo, reading);
        };
        let text = flipped.text.replace('\n', " ");
        let is_doubtful = word.is_empty() && reading.is_clear();
        let how_sure = if is_doubtful { "may be" } else { "is" };
        message("note: ", &format!("the writing {how_sure} mirrored: flipped, it reads {text}"));
        // The photo is read without flipping it if a word is given, or if it is clear as it is.
        return if word.is_empty() && !is_doubtful {
            (quarter_turned(&mirrored(&photo), turns), flipped)
        } else {
            (photo, reading)
        };
    }
    let way_up = ["on its side", "upside down", "on its side"][quarters - 1];
    let angle_deg = QUARTER_DEG * quarters;
    let text = format!("the writing is {way_up}: the photo is rotated clockwise by {angle_deg}°");
    message("note: ", &text);
    (quarter_turned(&photo, quarters), reading)
}

/// Returns the photo with its line of writing rectified, if its corners or a camera are given.
fn square_on(photo: Photo, corners: Option<&Corners>, flags: &CameraFlags) -> Result<Photo> {
    if let Some(Corners(corners_px)) = corners {
        return View::rectified_by_corners(&photo, *corners_px);
    }
    if !flags.is_given() {
        return Ok(photo);
    }
    // The scene needs no word, because a fixed camera does not depend on a word's bounds.
    let mut scene = flags.scene()?;
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    let fixed = matches!(scene.camera.framing, Framing::Fixed(_)) && !scene.has_strokes();
    let bounds_m = if fixed { [0.0; 4] } else { scene.strokes()?.bounds_m() };
    View::rectified_by_camera(&photo, &scene.camera.camera(bounds_m, 0.0)?)
}
