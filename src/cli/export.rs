//! `noctograph export` writes plans in the formats of drones and of other programs.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use super::advice::mentioned;
use super::findings;
use super::flags::{ProfileFlags, SubjectFlags};
use super::names::named;
use super::outcome::Report;
use super::output::{Output, OutputFolder};
use super::terminal::warn;
use crate::diagnostic::{Diagnostic, Severity};
use crate::error::{Error, Result};
use crate::export::{File, Form, Format, Length, Mode, check_memory, end_heights_m, stem};
use crate::plan::Plan;
use crate::preflight::{
    CheckedExport, ExportOptions, ExportedFiles, LED_MEMORY, PICTURE, Profile, make_exportable,
};
use crate::shoot::Shoot;
use clap::Args;
use noctograph_core::crazyflie::Release;
use noctograph_core::units::MM_PER_M;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    /// Format of the files
    #[arg(long, value_name = "FORMAT", value_parser = named::<Format>())]
    to: Format,
    /// Maximum distance between trajectory and design, in millimeters [default: 2, or 5 for
    /// polynomials]
    #[arg(long, value_name = "MM")]
    tolerance: Option<f64>,
    /// Setpoints that the cflib script sends, unless the script is started with another --mode
    /// [default: those that `check` simulates, full states for controllers that follow the design's
    /// motion]
    #[arg(long, value_name = "NAME", value_parser = named::<Mode>())]
    mode: Option<Mode>,
    #[command(flatten)]
    profile: ProfileFlags,
    /// Write files even if `check` stops the flight. Scripts then state that they are not safe
    #[arg(long)]
    unchecked: bool,
    /// File to write, or a folder for several
    #[arg(short, long, value_name = "FILE|DIR")]
    output: Option<PathBuf>,
}

/// Runs the verb `export`, which checks a flight and writes it in a drone's or show's format.
/// Nothing is written if the check stops the flight, unless `--unchecked` is given.
pub(super) fn run(args: &ExportArgs) -> Result<Report> {
    let (tolerance_m, (shoot, mode)) = (tolerance_m(args)?, shoot(args)?);
    // `check` judges exactly what the files fly. If it stops the flight, nothing is written.
    let profile = args.profile.profile(&shoot.scene);
    if args.to.flies() && !args.unchecked {
        check_room(args, &profile)?;
    }
    let plans: Vec<Plan> = shoot.plans.iter().map(|planned| planned.plan.clone()).collect();
    let (format, is_unchecked) = (args.to, args.unchecked);
    let options = ExportOptions { format, mode, tolerance_m, profile, is_unchecked };
    let checked = CheckedExport::new(shoot, options)?;
    let word = checked.word();
    let stops = if args.to.flies() {
        warn_of_behavior(args, checked.flies(), &checked.findings);
        findings::stops(&checked.findings)
    } else {
        None
    };
    let mut product = json!({
        "word": word, "format": args.to.name(), "drones": plans.len(), "stops": stops,
        "bytes": null, "deviation_mm": null,
    });
    if stops.is_some() && !args.unchecked {
        return Ok(Report::with_layout(product, REFUSED).with_files(&[]).passes(false));
    }
    let ExportedFiles { files, deviation_m } = checked.files(stops.as_deref())?;
    let paths = written(&files, args.output.as_deref(), word)?;
    product["bytes"] = files.iter().map(|file| file.bytes.len()).sum::<usize>().into();
    product["note"] = args.to.note().into();
    product["deviation_mm"] = deviation_m.map(|m| MM_PER_M * m).into();
    if args.to.stays_in_the_air() {
        plans.iter().try_for_each(warn_of_hovering)?;
    }
    // A fit to a smooth design stays within the tolerance.
    if deviation_m.is_some_and(|deviation_m| deviation_m > 2.0 * tolerance_m) {
        warn(["the design has jumps; plan with --style even for a smooth design"]);
    }
    Ok(Report::with_layout(product, EXPORTED).with_files(&paths))
}

/// Returns the tolerance in m of a trajectory, whose default depends on the form of the trajectory.
fn tolerance_m(args: &ExportArgs) -> Result<f64> {
    let trajectory = args.to.trajectory(args.mode.unwrap_or_default());
    let form = trajectory.map_or(Form::Compressed, |(form, _)| form);
    let tolerance_mm = args.tolerance.unwrap_or(MM_PER_M * form.tolerance_m());
    crate::error::within("--tolerance", tolerance_mm, TOLERANCES_MM[0], TOLERANCES_MM[1])?;
    Ok(tolerance_mm / MM_PER_M)
}

/// Returns the shoot of the word or the plans, in a scene that the format can express, and the mode
/// in which a script flies it. Returns the error of a trajectory that does not fit into the drone's
/// memory before the flight is simulated.
fn shoot(args: &ExportArgs) -> Result<(Shoot, Mode)> {
    let (release, mode) = (Cell::new(Release::MODELED), Cell::new(Mode::default()));
    let trajectory = args.to.trajectory(args.mode.unwrap_or_default());
    let tolerance_m = tolerance_m(args)?;
    let shoot = args.subject.shoot(
        |scene| {
            release.set(scene.vehicle.firmware);
            let slow = args.profile.limits(&args.subject);
            mode.set(make_exportable(scene, slow.as_ref(), args.to, args.mode)?);
            Ok(())
        },
        &|plans| match trajectory {
            Some((form, Length::OnBoard)) => check_memory(release.get(), plans, form, tolerance_m),
            _ => Ok(()),
        },
    )?;
    Ok((shoot, mode.get()))
}

/// Warns that the drone hovers before and after the trajectory of a plan.
fn warn_of_hovering(plan: &Plan) -> Result<()> {
    let [begins_m, ends_m] = end_heights_m(plan)?;
    warn([format!(
        "the trajectory begins {begins_m:.2} m and ends {ends_m:.2} m above the floor, where the \
         drone hovers until it receives a landing command or its battery is empty: send the \
         take-off and landing commands yourself, or fly the script for cflib"
    )]);
    Ok(())
}

/// Writes one file, or a folder with several files. By default, the folder is named after the word.
/// A single file is written into `output` if that is a folder. Returns the paths.
fn written(files: &[File], output: Option<&Path>, word: &str) -> Result<Vec<PathBuf>> {
    if let [file] = files {
        let path = output.unwrap_or(file.name.as_ref());
        let path = if path.is_dir() { path.join(&file.name) } else { path.to_owned() };
        return Ok(vec![Output::create(&path)?.keep(&file.bytes)?]);
    }
    let folder = output.map_or_else(|| format!("{}-export", stem(word)).into(), Path::to_owned);
    if folder.is_file() {
        let (actual, hint) = ("a file", "name a folder, because there are several files");
        return Err(Error::input(folder.display(), actual, "a folder", hint));
    }
    let mut folder = OutputFolder::create(&folder)?;
    for file in files {
        folder.write(&file.name, &file.bytes)?;
    }
    folder.keep()
}

/// Smallest and largest tolerance in mm of a trajectory that is fitted to a plan. Rounding to whole
/// millimeters in the compressed form already causes an error of up to 0.5 mm.
const TOLERANCES_MM: [f64; 2] = [0.5, 1000.0];

const REFUSED: &str = "\
refused   {stops}
          nothing was written; `check` lists the necessary changes, and --unchecked writes the files anyway
";

const EXPORTED: &str = "\
unchecked\tnot safe: {stops}
exported  {word} to {format}, {bytes} bytes
note      {note}
deviation\tup to {deviation_mm:.1} mm from the design
";

/// Refuses plans whose room is unknown, because the limits of their geofence would be a guess.
/// Words and outdoor flights are accepted without a room.
fn check_room(args: &ExportArgs, profile: &Profile) -> Result<()> {
    let has_walls = profile.name != Profile::outdoor().name;
    let plans = args.subject.plans()?.filter(|_| has_walls && profile.room_m.is_none());
    let Some(plan) = plans.as_ref().and_then(|plans| plans.first()) else { return Ok(()) };
    let hint = "specify the room with --room WxDxH, or the plan's scene with --scene; `plan` and \
                `preview` write the scene beside the plan";
    let (actual, wanted) = ("a plan without a room", "the room of the flight");
    Err(Error::input(plan.display(), actual, wanted, hint))
}

/// Warns if the files of a flight behave differently than the user may expect.
fn warn_of_behavior(args: &ExportArgs, shoot: &Shoot, checks: &[Diagnostic]) {
    if !shoot.designs.is_empty() {
        warn_of_trailing(shoot);
    }
    // Only two warnings of `check` are repeated here, because they concern problems that change how
    // the files behave.
    let is_on_board = args.to == Format::Cflib && args.mode == Some(Mode::Trajectory);
    for check in checks.iter().filter(|check| check.severity == Severity::Warning) {
        match check.code {
            PICTURE => warn([check.sentence(mentioned)]),
            LED_MEMORY if is_on_board => warn([format!(
                "the lights would use {} of the LED timing memory, so the script sends the light \
                 commands over the radio",
                check.message
            )]),
            _ => {}
        }
    }
}

/// Warns if the controller does not follow the motion of a trajectory, but only its positions.
pub(super) fn warn_of_trailing(shoot: &Shoot) {
    if !shoot.scene.controller.kind.follows_reference() {
        warn([
            "this controller tracks positions, and lags behind a trajectory on board: preview the \
             result with `preview --as-exported compressed`, or fly `--set \
             controller.kind=geometric`",
        ]);
    }
}
