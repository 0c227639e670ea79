//! `noctograph import`: the log of a real flight becomes a flight file.

use std::path::PathBuf;

use clap::Args;

use super::inputs::{PositionName, SceneFlags, import_flight, type_word};
use super::outputs::Output;
use super::{Outcome, print, show};
use crate::error::Result;
use crate::flight::airborne;
use crate::logs::{Damaged, ImportOptions};
use crate::plan::relight;

#[derive(Debug, Args)]
pub(super) struct ImportArgs {
    /// Log: AE483 JSON, cfclient CSV (a file, or the folder of its blocks), µSD, plain or range CSV
    log: PathBuf,
    /// Word that was flown: its letters and the headlights' schedule are told from the setpoints
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    /// Samples per second of the flight
    #[arg(long, value_name = "HZ", default_value_t = ImportOptions::default().sample_rate_hz)]
    rate: f64,
    /// Join samples over no longer a gap than this, in seconds
    #[arg(long, value_name = "S", default_value_t = ImportOptions::default().max_gap_s)]
    max_gap: f64,
    /// Which logged position, and attitude, is taken for the truth
    #[arg(long, value_name = "SOURCE", default_value = "best")]
    position: PositionName,
    /// Seconds that the drone's clock counts in a true second (0.98824 for µSD logs of firmware
    /// before August 2026)
    #[arg(long, value_name = "RATIO", default_value_t = 1.0)]
    clock_ratio: f64,
    /// Take what stands before the damage of a broken µSD log, instead of refusing it
    #[arg(long)]
    recover: bool,
    /// Flight to write
    #[arg(short, long, value_name = "FILE", default_value = "flight.csv")]
    output: PathBuf,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &ImportArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    let output = Output::create(&args.output)?;
    let options = ImportOptions {
        sample_rate_hz: args.rate,
        max_gap_s: args.max_gap,
        position: args.position.into(),
        clock_ratio: args.clock_ratio,
        damaged: if args.recover { Damaged::Recover } else { Damaged::Refuse },
    };
    let mut flight = import_flight(&args.log, &options)?;
    if let Some(word) = &args.word {
        type_word(&mut scene, Some(word));
        relight(&mut flight, &scene.strokes()?)?;
    }
    let path = output.keep(|out| flight.write_csv(out))?;
    let air_s = airborne(&flight).map(|air| {
        let air = &flight.samples[air];
        [air[0].time_s, air[air.len() - 1].time_s]
    });
    if args.json {
        let json = serde_json::json!({
            "samples": flight.samples.len(),
            "airborne_s": air_s,
            "gaps_s": flight.gaps,
            "unlogged": flight.unlogged.iter().map(|quantity| quantity.name()).collect::<Vec<_>>(),
            "extra": flight.extra.keys().collect::<Vec<_>>(),
            "warnings": flight.warnings,
            "flight": show::flight_json(&flight),
            "files": [path],
        });
        print(&format!("{json}\n"))?;
    } else {
        let air =
            air_s.map_or("never".to_owned(), |[from, to]| format!("{from:.2} s to {to:.2} s"));
        print(&format!(
            "samples   {}, in the air {air}\n{}files     {}\n",
            flight.samples.len(),
            show::flight_lines(&flight),
            path.display()
        ))?;
    }
    Ok(Outcome::Done)
}
