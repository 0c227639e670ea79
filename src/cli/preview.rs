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
use crate::diagnostic::Diagnostic;
use crate::error::Result;
use crate::export::{Form, Length};
use crate::expose::Developer;
use crate::preflight::{CAMERA_PLACE, ShotPlan};
use crate::report::{ShotNotes, shot_page};
use crate::scene::Scene;
use crate::score::Verdict;
use crate::shoot::{Format, Shoot, Shot};
use crate::studies::{Remedy, remedies_for};
use clap::Args;
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
    let mut folder = OutputFolder::create(&args.output)?;
    let n_numbered = Some(shoot.plans.len()).filter(|n| *n > 1).unwrap_or(0);
    for kind in ["plan", "flight"] {
        folder.replaces(leftovers(&args.output, kind, n_numbered)?);
    }
    let (format, keeps_film) = (Some(Format::Png), args.report);
    // Both photos are exposed on one device.
    let again = flown.is_some().then(|| developer.clone());
    let shot = Shoot { format, keeps_film, ..shoot }.take_by(developer, &watch())?;
    let flown =
        flown.zip(again).map(|(flown, again)| flown.take_by(again, &watch())).transpose()?;
    let sentence = |problem: &Diagnostic| problem.sentence(mentioned);
    let problems = |are: bool| shot.problems.iter().filter(move |it| it.is_stop() == are);
    let obstacles: Vec<String> = problems(true).map(sentence).collect();
    warn(problems(false).map(sentence));

    // After the photograph is taken, its files are written, and the spread, the helpful changes and
    // the findings of `check` are computed.
    let verdict = shot.verdict.as_ref();
    let json = show::verdict_json(verdict, shot.flight_sha256());
    write(&shot, &json, &args.output, &mut folder)?;
    let spread = args.spread.run(&shot.shoot, &conditions, &mut folder)?;
    let remedies = remedies_for(&shot)?;
    let profile = args.profile.profile(&shot.shoot.scene);
    let findings = match args.report {
        true => shot.preflight(&profile)?.findings,
        false => shot.findings(&profile)?,
    };
    let placement = shot.placement(&profile)?;
    warn_of_no_place(placement.as_ref());
    // A camera behind a wall causes only a warning here, because its photo is taken nevertheless.
    let stops = findings::stops(findings.iter().filter(|it| it.code != CAMERA_PLACE));

    // The parts of the report are added in reading order.
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
    if let Some(obstacle) = obstacles.first() {
        report.line("photo", obstacle);
    }
    report.text += &verdict_text(&shot, &remedies);
    report.text.push('\n');
    report.value("obstacles", obstacles);
    report.value("stops", &stops);
    report.text.extend(stops.iter().map(|stops| wrapped("check     not safe to fly: ", stops)));
    report.add(show::drawing(shot.shoot.strokes.as_ref()));
    report.text.extend(flights.iter().map(|flight| &*flight.text));
    report.add(show::camera(&shot));
    let flown = flown.map(|flown| flown::compare(&shot, flown));
    let flown = flown.map(|(facts, notes)| {
        report.add(facts);
        notes
    });
    let mut drawings = Vec::new();
    if let Some(spread) = spread {
        report.text += &spread.report.text;
        report.value("spread", spread.report.json);
        drawings = spread.drawings;
    }
    report.add(show::backend(&shot));
    if args.report {
        let notes = ShotNotes {
            lead: &verdict.map_or_else(String::new, show::verdict_sentence),
            printed: &report.text,
            findings: &findings,
            placement: placement.as_ref(),
            typed: mentioned,
            command: &typed_command(),
            drawings: &drawings,
            flown: flown.as_ref(),
        };
        let html = shot_page(&shot, &notes)?.html();
        folder.write(REPORT, html)?;
    }
    let files = folder.keep()?;
    files.iter().filter(|file| is_csv(file)).for_each(|file| forget_scene(file));
    let is_read = verdict.is_none_or(|verdict| verdict.legible);
    report.photo = shot.file;
    Ok(report.with_files(&files).passes(is_read && stops.is_none()))
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

/// Warns if the room has no place for the scene's camera.
fn warn_of_no_place(placement: Option<&ShotPlan>) {
    let camera = placement.and_then(|plan| plan.cameras.first());
    warn(camera.filter(|camera| camera.tripod_m.is_none()).map(|camera| {
        let why = camera.sentence();
        let why = why.strip_prefix("nowhere: ").unwrap_or(&why);
        format!("the camera does not fit in the room: {why} (see `check --room`)")
    }));
}

/// Writes the files of the photograph, the scene and, for a word, the verdict into a folder whose
/// final path is `path`.
fn write(shot: &Shot, verdict: &Value, path: &Path, folder: &mut OutputFolder) -> Result<()> {
    let digests = shot.each_file(|name, write| folder.write_with(name, |out| write(out)))?;
    write_scene(&shot.shoot.scene, path, folder, digests)?;
    let former = path.join(VERDICT);
    match shot.verdict {
        Some(_) => folder.write(VERDICT, format!("{verdict:#}\n")).map(drop)?,
        // The file of an earlier verdict, which is not about this photograph, is removed.
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
