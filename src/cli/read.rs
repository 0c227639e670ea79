//! `noctograph read`: what word a photograph shows, without being told.

use std::path::PathBuf;

use clap::Args;

use super::inputs::{Corners, flat};
use super::{Outcome, print};
use crate::error::Result;
use crate::photo::Photo;
use crate::score::read;

#[derive(Debug, Args)]
pub(super) struct ReadArgs {
    /// Photo to read: PNG or JPEG, ours or a camera's
    photo: PathBuf,
    /// The line's upper left, upper right, lower right and lower left corner in the photo, in
    /// pixels, where it is seen at an angle
    #[arg(long, value_name = "X,Y X,Y X,Y X,Y")]
    corners: Option<Corners>,
    /// Scene file (TOML) whose camera took the photo
    #[arg(long, value_name = "FILE", conflicts_with = "corners")]
    camera: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &ReadArgs) -> Result<Outcome> {
    let photo = Photo::read(&args.photo)?;
    let photo = flat(photo, args.corners.as_ref(), args.camera.as_deref())?;
    let reading = read(&photo)?;
    if args.json {
        let json = serde_json::to_value(&reading).expect("a reading is plain data");
        print(&format!("{json:#}\n"))?;
    } else if reading.text.is_empty() {
        print("nothing is written there\n")?;
    } else {
        let mut text = format!("{}\n\nletter    p\n", reading.text);
        for letter in &reading.letters {
            text += &format!("{:10}{:.2}\n", letter.letter, letter.p);
        }
        print(&text)?;
    }
    Ok(if reading.text.is_empty() { Outcome::NotLegible } else { Outcome::Done })
}
