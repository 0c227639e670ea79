//! `noctograph import` converts the log of a real flight to a flight file, or summarizes the logs
//! of an evening in a page.

use std::path::{Path, PathBuf};

use super::evening;
use super::flags::{SceneFlags, set_word};
use super::flight_flags::{FlightFlags, infer_lights_if_dark, note};
use super::outcome::Report;
use super::output::Outputs;
use super::show::flight_report;
use super::terminal::warn;
use crate::error::{Error, Result};
use crate::flight::{Flight, Quantity, airborne};
use crate::logs::{OnClock, is_one_log};
use crate::scene::CarriedScene;
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// Log: AE483 JSON, cfclient CSV (a file, or the folder of its blocks), µSD, plain or range
    /// CSV, tables of motion captures and other programs (docs/reference/files.md). Any other
    /// folder is read as the logs of an evening, and yields one page and a conditions file. Logs of
    /// exported scripts name their drones. Any other log must be in a folder named after the drone,
    /// or its file name must begin with the drone's name and - or _
    log: PathBuf,
    /// Word that was flown. For a log without lights, the letters and the schedule of the
    /// headlights are inferred from this word and the setpoints, with the font and size of the
    /// scene or of a preset
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    flight: FlightFlags,
    /// Flight to write, or folder for evening.html and conditions.toml [default: flight.csv, or
    /// noctograph-evening]
    #[arg(short, long, value_name = "FILE|DIR")]
    output: Option<PathBuf>,
}

/// Runs the verb `import`, which converts a log to a flight file, or reports on a folder of logs.
pub(super) fn run(args: &ImportArgs) -> Result<Report> {
    if args.log.is_dir() && !is_one_log(&args.log)? {
        return import_evening(args);
    }
    // A scene is written beside the flight only if `--scene` names a scene or the log contains one.
    let mut scene = args.scene.load(std::slice::from_ref(&args.log), &[])?;
    let is_known = args.scene.is_given() || CarriedScene::read(&args.log)?.is_some();
    let outputs = Outputs::create(args.output.as_deref(), "flight", 1)?;
    let OnClock { mut flight, firmware, .. } = args.flight.read_log(&args.log, Some(&scene))?;
    if let Some(word) = &args.word {
        set_word(&mut scene, word);
        infer_lights_if_dark(&mut flight, &mut scene, &args.log)?.into_iter().for_each(note);
        if flight.lights.is_empty() {
            warn([
                "--word has no effect: letters and lights are inferred from setpoints, which the log \
                 lacks",
            ]);
        }
    }
    let scene = Some(&scene).filter(|_| is_known);
    let flights = std::slice::from_ref(&flight);
    let files = outputs.keep(flights, scene, |flight, mut out| flight.write_csv(&mut out))?;
    let air_s = airborne(&flight)
        .map(|air| [air.start, air.end - 1].map(|index| flight.samples[index].time_s));
    let figures = flight_report(&flight, &flight.sha256(), None);
    let product = json!({
        "samples": flight.samples.len(), "airborne_s": air_s, "firmware": firmware,
        "unlogged": flight.unlogged.iter().map(|it| it.name()).collect::<Vec<_>>(),
        "extra": flight.extra.keys().collect::<Vec<_>>(),
        "warnings": flight.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "flight": figures.json, "gaps_s": &flight.gaps,
    });
    let words = json!({ "air": in_the_air(&flight, air_s) });
    let mut report = Report::with_words(product, &words, LAYOUT);
    report.text += &figures.text;
    Ok(report.with_files(&files))
}

/// Imports a folder of logs as an evening. Returns [`Error::Input`] if a word is given, because it
/// belongs to a single flight.
fn import_evening(args: &ImportArgs) -> Result<Report> {
    if let Some(word) = &args.word {
        let hint = "separately import the log of the flight that wrote the word";
        return Err(Error::input("input", word, "a folder of logs, without a word", hint));
    }
    let output = args.output.as_deref().unwrap_or(Path::new("noctograph-evening"));
    let scene = args.scene.load(&[], &[])?;
    evening::run(&args.log, &scene, &args.flight.options(Some(&scene)), output)
}

/// Returns a phrase that says when a drone was in the air, from take-off to landing (`air_s`), if
/// the log shows that.
fn in_the_air(flight: &Flight, air_s: Option<[f64; 2]>) -> String {
    // Without any of these quantities, it is unknown whether the drone flew.
    let evidence = [Quantity::Position, Quantity::Design, Quantity::Motors];
    match air_s {
        Some([from_s, to_s]) => format!("in the air {from_s:.2} s to {to_s:.2} s"),
        None if evidence.iter().any(|quantity| flight.has(*quantity)) => "never in the air".into(),
        None => "the log contains no height, setpoints or motors".into(),
    }
}

const LAYOUT: &str = "\
samples   {samples}, {air}
firmware  {firmware}
";
