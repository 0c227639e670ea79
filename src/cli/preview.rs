//! `noctograph preview` takes the photograph of a word and judges it.

use std::path::{Path, PathBuf};

use super::advice::{mentioned, typed};
use super::device::tried;
use super::export::warn_of_trailing;
use super::flags::{ProfileFlags, SubjectFlags};
use super::names::named;
use super::outcome::{Report, typed_command};
use super::output::{OutputFolder, forget_scene, is_csv, leftovers, write_scene};
use super::picture::PictureFlags;
use super::printer::{line, table, wrapped};
use super::progress::watch;
use super::spread::SpreadFlags;
use super::terminal::warn;
use super::{findings, flown, show};
use crate::error::Result;
use crate::export::{Form, Length};
use crate::expose::Developer;
use crate::preflight::{CAMERA_PLACE, Preflight, ShotPlan};
use crate::report::{ShotNotes, shot_page};
use crate::scene::Scene;
use crate::score::Verdict;
use crate::shoot::{Format, Shoot, Shot};
use crate::studies::{Remedy, remedies_for};
use clap::Args;
use noctograph_core::parallel;
use serde_json::{Value, json};

/// Name of the file with the verdict on a word.
const VERDICT: &str = "verdict.json";

/// Name of the page that `--report` writes.
const REPORT: &str = "report.html";

#[derive(Debug, Args)]
pub(super) struct PreviewArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    #[command(flatten)]
    picture: PictureFlags,
    #[command(flatten)]
    profile: ProfileFlags,
    #[command(flatten)]
    spread: SpreadFlags,
    /// Fly the trajectory exported in this format, decoded as in the firmware
    #[arg(long, value_name = "FORM", value_parser = named::<Form>())]
    as_exported: Option<Form>,
    /// Also write report.html, a single page with all results to print or to hand in
    #[arg(long)]
    report: bool,
    /// Log of a real flight, whose photo is compared with the preview, letter by letter
    #[arg(long, value_name = "LOG")]
    flown: Option<PathBuf>,
    /// Folder for photo.png, flight.csv, plan.csv, scene.toml and, for a word, verdict.json
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-out")]
    output: PathBuf,
}

/// Runs the verb `preview`, which flies, photographs and reads a word or plans, checks the flight,
/// and writes the files. The report passes if the word is legible and nothing stops the flight.
pub(super) fn run(args: &PreviewArgs) -> Result<Report> {
    // The graphics device is prepared while the word is planned.
    let developer = Developer::start(tried(args.picture.backend)?);
    let shoot = planned(args)?;
    // Conditions and folder, which may be refused, are checked before the long computation.
    let conditions = args.spread.conditions()?;
    let flown = args.flown.as_deref().map(|log| flown::prepared(&shoot, log)).transpose()?;
    let mut folder = opened(&args.output, shoot.plans.len())?;
    let (shot, flown) = photographed(args, shoot, flown, developer)?;
    let verdict = shot.verdict.as_ref();
    let json = show::verdict_json(verdict, shot.flight_sha256());

    // The files are written while the findings of `check` are computed. The spread and the helpful
    // changes follow.
    let (written, checked) =
        parallel::join(|| write(&shot, &json, &args.output, &mut folder), || checked(args, &shot));
    written?;
    let spread = args.spread.run(&shot.shoot, &conditions, &mut folder)?;
    let remedies = remedies_for(&shot)?;
    let Preflight { findings, placement } = checked?;
    warn_of_no_place(placement.as_ref());
    // A camera behind a wall causes only a warning here, because its photo is taken nevertheless.
    let stops = findings::stops(findings.iter().filter(|it| it.code != CAMERA_PLACE));
    let (facts, notes) = flown.map(|flown| flown::compare(&shot, flown)).unzip();
    let (spread, drawings) = spread.map(|shown| (shown.report, shown.drawings)).unzip();
    let parts = Parts { json, remedies, stops: stops.as_deref(), flown: facts, spread };
    let mut report = assembled(&shot, parts);
    if args.report {
        let notes = ShotNotes {
            lead: &verdict.map_or_else(String::new, show::verdict_sentence),
            printed: &report.text,
            findings: &findings,
            placement: placement.as_ref(),
            typed: mentioned,
            command: &typed_command(),
            drawings: &drawings.unwrap_or_default(),
            flown: notes.as_ref(),
        };
        folder.write(REPORT, shot_page(&shot, &notes)?.html())?;
    }
    let files = folder.keep()?;
    files.iter().filter(|file| is_csv(file)).for_each(|file| forget_scene(file));
    let is_read = verdict.is_none_or(|verdict| verdict.legible);
    report.photo = shot.file;
    Ok(report.with_files(&files).passes(is_read && stops.is_none()))
}

/// Opens the output folder, from which plans and flights of an earlier set with more drones are
/// removed when the new files are kept.
fn opened(path: &Path, n_drones: usize) -> Result<OutputFolder> {
    let mut folder = OutputFolder::create(path)?;
    // The files of a single drone have no numbers, so every numbered file is a leftover.
    let n_numbered = if n_drones > 1 { n_drones } else { 0 };
    for kind in ["plan", "flight"] {
        folder.replaces(leftovers(path, kind, n_numbered)?);
    }
    Ok(folder)
}

/// Takes the photograph of the word, and that of the real flight if `flown` is given, on the same
/// device. Prints warnings about the first photograph.
fn photographed(
    args: &PreviewArgs,
    shoot: Shoot,
    flown: Option<Shoot>,
    developer: Developer,
) -> Result<(Shot, Option<Shot>)> {
    let (format, keeps_film) = (Some(Format::Png), args.report);
    let again = flown.is_some().then(|| developer.clone());
    let shot = Shoot { format, keeps_film, ..shoot }.take_by(developer, &watch())?;
    let flown =
        flown.zip(again).map(|(flown, again)| flown.take_by(again, &watch())).transpose()?;
    let warnings = shot.problems.iter().filter(|problem| !problem.is_stop());
    warn(warnings.map(|problem| problem.sentence(mentioned)));
    Ok((shot, flown))
}

/// Returns the findings and the positions in the room. The checks of memory and picture, which need
/// more time, are made only for the page of `--report`.
fn checked(args: &PreviewArgs, shot: &Shot) -> Result<Preflight> {
    let profile = args.profile.profile(&shot.shoot.scene);
    let findings =
        if args.report { shot.preflight(&profile)?.findings } else { shot.findings(&profile)? };
    Ok(Preflight { findings, placement: shot.placement(&profile)? })
}

/// Parts of the report on a photograph that are computed after the photograph is taken.
struct Parts<'a> {
    /// Verdict as JSON.
    json: Value,
    /// Changes of settings that make the word more legible.
    remedies: Vec<Remedy>,
    /// Findings that stop the flight, as text.
    stops: Option<&'a str>,
    /// Report on the real flight.
    flown: Option<Report>,
    /// Report on the ensemble.
    spread: Option<Report>,
}

/// Returns the report on a photograph, with its parts in reading order.
fn assembled(shot: &Shot, parts: Parts<'_>) -> Report {
    let Parts { json, remedies, stops, flown, spread } = parts;
    // Obstacles make any word unreadable. The first one is printed above the verdict.
    let obstacles = shot.problems.iter().filter(|problem| problem.is_stop());
    let obstacles: Vec<String> = obstacles.map(|problem| problem.sentence(mentioned)).collect();
    let flights = shot.flights.iter().zip(shot.digests()).zip(shot.tracking());
    let flights =
        flights.map(|((flight, sha256), known)| show::flight_report(flight, sha256, *known));
    let flights: Vec<Report> = flights.collect();
    let changes = remedies
        .iter()
        .map(|one| json!({ "change": typed(&one.changes), "gain": one.gain, "set": one.changes }));
    let mut report = Report::new(String::new(), json);
    report.value("flights", flights.iter().map(|flight| &flight.json).collect::<Vec<_>>());
    report.value("remedies", changes.collect::<Vec<_>>());
    report.text.extend(obstacles.first().map(|obstacle| line("photo", obstacle)));
    report.text += &verdict_text(shot, &remedies);
    report.text.push('\n');
    report.value("obstacles", obstacles);
    report.value("stops", stops);
    report.text.extend(stops.map(|stops| wrapped("check     not safe to fly: ", stops)));
    report.add(show::drawing(shot.shoot.strokes.as_ref()));
    report.text.extend(flights.iter().map(|flight| &*flight.text));
    report.add(show::camera(shot));
    if let Some(flown) = flown {
        report.add(flown);
    }
    if let Some(spread) = spread {
        report.text += &spread.text;
        report.value("spread", spread.json);
    }
    report.add(show::backend(shot));
    report
}

/// Returns the shoot of the word or the plans, with exported trajectories if they are requested.
fn planned(args: &PreviewArgs) -> Result<Shoot> {
    let change = |scene: &mut Scene| {
        args.profile.slow(&args.subject, scene);
        args.picture.apply(scene)
    };
    let Some(form) = args.as_exported else { return args.subject.flown(change) };
    let shoot = args.subject.shoot(change, &|_| Ok(()))?;
    warn_of_trailing(&shoot);
    let shoot = shoot.as_exported(form, form.tolerance_m(), Length::OnBoard)?;
    // The slow firmware clock applies only to the compressed form. The other form is flown by
    // Crazyswarm2's script, which compensates for the clock by speeding up the trajectory.
    Ok(if form == Form::Compressed { shoot.by_firmware_clock() } else { shoot })
}

/// Warns if the scene's camera does not fit in the room, with the reason.
fn warn_of_no_place(placement: Option<&ShotPlan>) {
    let camera = placement.and_then(|plan| plan.cameras.first());
    warn(camera.filter(|camera| camera.tripod_m.is_none()).map(|camera| {
        let why = camera.sentence();
        let why = why.strip_prefix("nowhere: ").unwrap_or(&why);
        format!("the camera does not fit in the room: {why} (see `check --room`)")
    }));
}

/// Writes the files of the photograph, the scene and, for a word, the verdict into a folder whose
/// final path is `path`. Without a verdict, an earlier verdict in the folder is removed.
fn write(shot: &Shot, verdict: &Value, path: &Path, folder: &mut OutputFolder) -> Result<()> {
    let digests = shot.each_file(|name, write| folder.write_with(name, |out| write(out)))?;
    write_scene(&shot.shoot.scene, path, folder, digests)?;
    let former = path.join(VERDICT);
    match shot.verdict {
        Some(_) => folder.write(VERDICT, format!("{verdict:#}\n")).map(drop)?,
        // The earlier verdict is not about this photograph.
        None if former.is_file() => folder.replaces(vec![former]),
        None => {}
    }
    Ok(())
}

/// Returns the text of the verdict. If changes of settings were simulated, they replace the advice
/// on strokes, because they are more reliable.
fn verdict_text(shot: &Shot, remedies: &[Remedy]) -> String {
    // There is no verdict on a drawing, or on a word with letters that the reader does not know.
    match &shot.verdict {
        Some(verdict) if !remedies.is_empty() => {
            let verdict = Verdict { advice: Vec::new(), ..verdict.clone() };
            let row = |it: &Remedy| vec![format!("{:+.2}", it.gain), typed(&it.changes)];
            let rows: Vec<Vec<String>> = remedies.iter().map(row).collect();
            show::verdict_table(&verdict) + "\n" + &table("P(read)<9|change<0", &rows)
        }
        Some(verdict) => show::verdict_table(verdict),
        None if shot.shoot.strokes.is_none() => {
            line("verdict", "none: no word is named (--word WORD)")
        }
        None => line("verdict", "none: the reader knows only Latin letters and digits"),
    }
}
