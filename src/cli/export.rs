//! `noctograph export`: plans for drones and other programs.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::flags::SubjectFlags;
use super::names::named;
use super::output::{Output, OutputFolder};
use super::report::{Report, line};
use super::warn;
use crate::error::{Error, Result};
use crate::export::{Form, Format, Job, Mode, deviation_m, export};
use crate::plan::Plan;
use crate::shoot::Shoot;

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    /// Form of the files
    #[arg(long, value_name = "FORMAT", value_parser = named::<Format>())]
    to: Format,
    /// Largest distance of a trajectory from the design, in millimeters [default: 2, or 5 for
    /// polynomials]
    #[arg(long, value_name = "MM")]
    tolerance: Option<f64>,
    /// What the script for cflib sends, unless it is told otherwise
    #[arg(long, value_name = "NAME", default_value = "position", value_parser = named::<Mode>())]
    mode: Mode,
    /// File to write, or a folder for several
    #[arg(short, long, value_name = "FILE|DIR")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &ExportArgs) -> Result<Report> {
    let polynomials =
        matches!(args.to, Format::Poly4d | Format::Crazyswarm2 | Format::UavTrajectories);
    let form = if polynomials { Form::Poly4d } else { Form::Compressed };
    let tolerance_mm = args.tolerance.unwrap_or(1e3 * form.tolerance_m());
    crate::error::within("--tolerance", tolerance_mm, 0.5, 1000.0)?;
    let shoot = args.subject.shoot(|_| Ok(()))?;
    let plans: Vec<Plan> = shoot.plans.iter().map(|planned| planned.plan.clone()).collect();
    let word = match &shoot.strokes {
        Some(strokes) if strokes.font.is_some() => strokes.word.clone(),
        _ => "drawing".to_owned(),
    };
    let sim = shoot.scene.sim();
    let job = Job {
        plans: &plans,
        word: &word,
        light: &shoot.scene.light,
        sim: &sim,
        camera: &shoot.scene.camera.camera(bounds_m(&shoot), 0.0)?,
        tolerance_m: tolerance_mm / 1e3,
        mode: args.mode,
        trajectory_clock: shoot.scene.plan.trajectory_clock,
    };
    let files = export(args.to, &job)?;
    let paths = match files.as_slice() {
        [file] => {
            let path = args.output.clone().unwrap_or_else(|| file.name.clone().into());
            let path = if path.is_dir() { path.join(&file.name) } else { path };
            vec![Output::create(&path)?.keep(|out| out.write_all(&file.bytes))?]
        }
        files => {
            let folder = args.output.clone().unwrap_or_else(|| format!("{word}-export").into());
            if folder.is_file() {
                let (found, hint) = ("a file", "name a folder: there are several files");
                return Err(Error::input(folder.display().to_string(), found, "a folder", hint));
            }
            let folder = OutputFolder::create(&folder)?;
            for file in files {
                folder.write(&file.name, |out| out.write_all(&file.bytes))?;
            }
            folder.keep(&files.iter().map(|file| file.name.as_str()).collect::<Vec<_>>())?
        }
    };
    let bytes: usize = files.iter().map(|file| file.bytes.len()).sum();
    let deviation_m = deviation_m(args.to, &job)?;
    let mut text = line("exported", &format!("{word} to {}, {bytes} bytes", args.to.name()));
    if let Some(off_m) = deviation_m {
        text += &line("deviation", &format!("up to {:.1} mm from the design", 1e3 * off_m));
        if off_m > 2.0 * job.tolerance_m {
            warn(&["the design jumps; plan with --style even for a smooth one".to_owned()]);
        }
    }
    let json = json!({
        "word": word, "format": args.to.name(), "bytes": bytes, "drones": plans.len(),
        "deviation_mm": deviation_m.map(|m| 1e3 * m),
    });
    Ok(Report::new(text, json).with_files(&paths))
}

/// The box of the word, or of the plans.
fn bounds_m(shoot: &Shoot) -> [f64; 4] {
    if let Some(strokes) = &shoot.strokes {
        return strokes.bounds_m();
    }
    let setpoints = shoot.plans.iter().flat_map(|planned| &planned.plan.setpoints);
    let places = setpoints.filter(|setpoint| setpoint.letter.is_some()).map(|s| s.position_m);
    let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    places.fold(none, |b, p| [b[0].min(p.x), b[1].min(p.z), b[2].max(p.x), b[3].max(p.z)])
}
