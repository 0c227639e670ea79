//! `noctograph read`: the word in a photograph, recognized blindly.

use std::path::PathBuf;

use clap::Args;

use super::flags::CameraFlags;
use super::outcome::{Outcome, Report};
use super::square_on::{Corners, square_on};
use crate::error::Result;
use crate::photo::Photo;
use crate::score::read;

#[derive(Debug, Args)]
pub(super) struct ReadArgs {
    /// Photo to read: PNG or JPEG, a render or a camera's
    photo: PathBuf,
    /// Corners of the line in the photo, clockwise from the upper left, in pixels: for a photo
    /// taken at an angle
    #[arg(long, value_name = "X,Y X,Y X,Y X,Y", allow_hyphen_values = true, conflicts_with_all = ["camera", "camera_from"])]
    corners: Option<Corners>,
    #[command(flatten)]
    camera: CameraFlags,
}

pub(super) fn run(args: &ReadArgs) -> Result<Report> {
    let photo = Photo::read(&args.photo)?;
    let photo = square_on(photo, args.corners.as_ref(), &args.camera)?;
    let reading = read(&photo);
    let json = serde_json::to_value(&reading).expect("a reading is plain data");
    if reading.text.is_empty() {
        let report = Report::new("no writing found\n".into(), json);
        return Ok(report.with_outcome(Outcome::NotLegible));
    }
    let mut text = format!("{}\n\nletter    share\n", reading.text);
    for letter in &reading.letters {
        text += &format!("{:10}{:.2}\n", letter.letter, letter.p);
    }
    Ok(Report::new(text, json))
}
