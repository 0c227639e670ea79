//! `noctograph expose`: the photograph of flights.

use std::path::PathBuf;

use super::advice::mentioned;
use super::device::tried;
use super::flags::{SceneFlags, SeedFlag};
use super::flight_flags::FlightFlags;
use super::names::named;
use super::outcome::Report;
use super::output::Output;
use super::picture::PictureFlags;
use super::progress::watch;
use super::show;
use super::terminal::{message, warn};
use crate::error::Result;
use crate::shoot::{Format, Judging, Shoot};
use clap::Args;

#[derive(Debug, Args)]
pub(super) struct ExposeArgs {
    /// Flights or logs, one for each drone, or light traces (t,x,y,z,r,g,b, in other programs'
    /// light logs also with colors of 0 to 255)
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    /// Word that the flights write: the camera frames it, the photo names it, and a log without
    /// lights has its [default: the scene's, or the letters of the flights]
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    /// Show a log without lights lit all along, from take-off to landing
    #[arg(long, conflicts_with = "word")]
    lit: bool,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    seed: SeedFlag,
    #[command(flatten)]
    picture: PictureFlags,
    /// Photo to write
    #[arg(short, long, value_name = "FILE", default_value = "photo.png")]
    output: PathBuf,
    /// File format [default: exr for *.exr, else png]
    #[arg(long, value_name = "NAME", value_parser = named::<Format>())]
    format: Option<Format>,
}

pub(super) fn run(args: &ExposeArgs) -> Result<Report> {
    let mut scene = args.scene.load(&args.flights, &args.seed.settings())?;
    args.picture.apply(&mut scene)?;
    let format = args.format.map_or_else(|| Format::from_path(&args.output), Ok)?;
    let output = Output::create(&args.output)?;
    let shoot = args.flight.shoot(scene, args.word.as_deref(), &args.flights, args.lit)?;
    let backend = tried(args.picture.backend)?;
    // The photo is not judged here: `score` does that.
    let (format, judging) = (Some(format), Judging::Skipped);
    let shoot = Shoot { format, judging, backend, keeps_film: false, ..shoot };
    let shot = shoot.take(&watch())?;
    warn(shot.problems.iter().map(|problem| problem.sentence(mentioned)));
    let bytes = shot.file.as_deref().expect("a format was asked for");
    let path = output.keep(bytes)?;
    // A light trace needs no word, because it contains its colors.
    if !shot.shoot.scene.has_strokes() && !shot.flights.is_empty() && !args.lit {
        let note = "the photo names no word: name one with --word, or after the photo in `score`";
        message("note: ", note);
    }
    let mut report = show::camera(&shot);
    report.add(show::backend(&shot));
    report.value("flight_sha256", shot.flight_sha256());
    report.value("word", &shot.shoot.scene.word);
    report.photo = shot.file;
    Ok(report.with_files(&[path]))
}
