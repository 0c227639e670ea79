//! `noctograph expose` takes the long-exposure photograph of flights.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::advice::mentioned;
use super::device::tried;
use super::flags::{SceneFlags, SeedFlag, set_word, warn_of};
use super::flight_flags::{FlightFlags, LogLights, light_if_dark, note};
use super::follow::{Letters, begun, follow};
use super::names::named;
use super::outcome::Report;
use super::output::Output;
use super::picture::PictureFlags;
use super::progress::watch;
use super::show;
use super::terminal::{message, warn};
use crate::error::{Error, Result};
use crate::expose::{Developer, GrowingFilm};
use crate::logs::GrowingLog;
use crate::scene::Scene;
use crate::shoot::{Format, Judging, Recording, Shoot, Shot};
use clap::Args;

#[derive(Debug, Args)]
pub(super) struct ExposeArgs {
    /// Flights or logs, one for each drone, or light traces (t,x,y,z,r,g,b, with colors of 0 to 255
    /// in light logs of other programs)
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    /// Expose logs while they are written (`NAME_flight.jsonl` of exported scripts). The photo is
    /// rewritten up to twice a second, until the flights end or Ctrl-C is pressed
    #[arg(long, conflicts_with = "backend")]
    follow: bool,
    /// Plan of the flights. With this plan, --follow prints the reading of the photo after each
    /// letter
    #[arg(long, value_name = "FILE", requires = "follow")]
    plan: Option<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    /// Word that the flights write, which the camera frames and the photo's scene contains. For a
    /// log without lights, the lights are inferred from this word [default: the scene's, or the
    /// letters of the flights]
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    /// Show the lamps of a log without lights lit from take-off to landing
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

/// Runs the verb `expose`, which photographs recorded flights and writes the photo, without judging
/// it.
pub(super) fn run(args: &ExposeArgs) -> Result<Report> {
    if args.follow {
        return follow_logs(args);
    }
    // The graphics device is prepared while the flights are read.
    let developer = Developer::start(tried(args.picture.backend)?);
    let (scene, format) = (args.scene()?, args.format()?);
    let output = Output::create(&args.output)?;
    let shoot = args.flight.shoot(scene, args.word.as_deref(), &args.flights, args.lights())?;
    // `expose` does not judge the photo, which is the task of `score`.
    let (format, judging) = (Some(format), Judging::Skipped);
    let shoot = Shoot { format, judging, keeps_film: false, ..shoot };
    let shot = shoot.take_by(developer, &watch())?;
    let path = output.keep(file_of(&shot))?;
    Ok(args.report(shot, path))
}

/// Photographs logs while they grow, and rewrites the photo with their new light until all flights
/// have ended. With a plan, prints the reading of each letter when it is complete. Returns the
/// report on the last photo.
fn follow_logs(args: &ExposeArgs) -> Result<Report> {
    if !Output::create(&args.output)?.is_staged() {
        let hint = "name an output file, which is rewritten while the logs grow";
        return Err(Error::input("output", args.output.display(), "a file", hint));
    }
    let logs = begun(&args.flights)?;
    let mut scene = args.scene()?;
    if let Some(word) = &args.word {
        set_word(&mut scene, word);
    }
    let plan = args.plan.as_deref();
    let mut letters = plan.map(|plan| Letters::new(plan, &scene, logs.len())).transpose()?;
    let (mut film, mut noted) = (GrowingFilm::default(), BTreeSet::new());
    // With a single thread, the measured duration of the work equals the processor time it takes,
    // from which `follow` sets the interval of the photos. Without the thread, any thread works.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().ok();
    let (shot, path) = follow(logs, |logs| {
        let shoot = args.shoot_logs(scene.clone(), logs, &mut noted)?;
        let shot = match &pool {
            Some(pool) => pool.install(|| shoot.take_on(&mut film)),
            None => shoot.take_on(&mut film),
        }?;
        let path = Output::create(&args.output)?.keep(file_of(&shot))?;
        if let Some(letters) = &mut letters {
            letters.tell(&shot)?;
        }
        Ok((shot, path))
    })?;
    for (flight, path) in shot.flights.iter().zip(&args.flights) {
        warn_of(path, &flight.warnings);
    }
    let verdict = letters.map(|letters| letters.read(&shot)).transpose()?;
    let mut report = args.report(shot, path);
    if let Some(verdict) = verdict {
        report.line("word", &show::verdict_sentence(&verdict));
        report.value("read", &verdict.read);
        report.value("readability", verdict.readability);
    }
    Ok(report)
}

/// Returns the bytes of the photo's file.
fn file_of(shot: &Shot) -> &[u8] {
    shot.file.as_deref().expect("a format was asked for")
}

impl ExposeArgs {
    /// Returns the scene of the flights with the flags of the seed and the picture applied.
    fn scene(&self) -> Result<Scene> {
        let mut scene = self.scene.load(&self.flights, &self.seed.settings())?;
        self.picture.apply(&mut scene)?;
        Ok(scene)
    }

    fn lights(&self) -> LogLights {
        if self.lit { LogLights::AlwaysOn } else { LogLights::Inferred }
    }

    fn format(&self) -> Result<Format> {
        self.format.map_or_else(|| Format::from_path(&self.output), Ok)
    }

    /// Returns the shoot of the samples that the growing logs contain so far, and prints notes on
    /// inferred lights. `noted` contains the notes that were already printed, so that each is
    /// printed once.
    fn shoot_logs(
        &self,
        mut scene: Scene,
        logs: &[GrowingLog],
        noted: &mut BTreeSet<String>,
    ) -> Result<Shoot> {
        let mut recordings = Vec::new();
        for (log, path) in logs.iter().zip(&self.flights) {
            let mut flight = log.flight(&self.flight.options(Some(&scene)))?.flight;
            let text = light_if_dark(&mut flight, &mut scene, path, self.lights())?;
            text.filter(|text| noted.insert(text.clone())).into_iter().for_each(note);
            recordings.push(Recording::Flight(flight));
        }
        let shoot = Shoot::with_recordings(scene, recordings)?;
        let format = Some(self.format()?);
        Ok(Shoot { format, judging: Judging::Skipped, keeps_film: false, ..shoot })
    }

    /// Prints warnings about a shot, and a note if its photo contains no word. Returns the report
    /// on the camera and the files of the shot. `path` is the photo's file.
    fn report(&self, shot: Shot, path: PathBuf) -> Report {
        warn(shot.problems.iter().map(|problem| problem.sentence(mentioned)));
        // A light trace contains its own colors and needs no word. It yields no flights.
        if !shot.shoot.scene.has_strokes() && !shot.flights.is_empty() && !self.lit {
            let note = "the photo names no word: pass the word with --word, or after the photo in \
                 `score`";
            message("note: ", note);
        }
        let mut report = show::camera(&shot);
        report.add(show::backend(&shot));
        report.value("flight_sha256", shot.flight_sha256());
        report.value("word", &shot.shoot.scene.word);
        report.photo = shot.file;
        report.with_files(&[path])
    }
}
