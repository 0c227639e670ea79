//! `noctograph fly` simulates plans, or the setpoints of real flights.

use std::path::PathBuf;

use super::flags::{SceneFlags, SeedFlag, read_plans, warn_of};
use super::flight_flags::{FLIGHTS, FlightFlags};
use super::outcome::Report;
use super::output::Outputs;
use super::progress::watch;
use super::show;
use super::terminal::warn;
use crate::error::Result;
use crate::flight::Flight;
use crate::plan::{Plan, Replay, replay};
use crate::scene::Scene;
use crate::shoot::Shoot;
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct FlyArgs {
    /// Plans to fly, one for each drone, as `noctograph plan` writes them
    #[arg(
        required_unless_present = "setpoints",
        conflicts_with = "setpoints",
        value_name = "PLAN"
    )]
    plans: Vec<PathBuf>,
    /// Flight or log whose setpoints are flown as they were sent, instead of a plan
    #[arg(long, value_name = "FILE")]
    setpoints: Vec<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    seed: SeedFlag,
    /// Flight to write, or a folder for several [default: flight.csv, or flights]
    #[arg(short, long, value_name = "FILE|DIR")]
    output: Option<PathBuf>,
}

/// Runs the verb `fly`, which simulates plans or the setpoints of logs, and writes the flights. The
/// JSON contains an object for a single flight, and a list for several.
pub(super) fn run(args: &FlyArgs) -> Result<Report> {
    let files = [&args.plans[..], &args.setpoints].concat();
    // The scene of the plans is used unless `--scene` names another one.
    let carried = args.scene.carried(&files)?;
    let scene = args.scene.load_from(carried.as_ref(), &args.seed.settings(), &[])?;
    let of_plans = carried.filter(|_| !args.plans.is_empty());
    let mut plans = read_plans(&args.plans, of_plans.as_ref())?;
    plans.extend(sent_setpoints(args, &scene)?);
    let shoot = Shoot::with_plans(scene, plans)?;
    let outputs = Outputs::create(args.output.as_deref(), "flight", shoot.plans.len())?;
    let flights = shoot.fly(&watch())?;
    flights.iter().for_each(|flight| warn(&flight.warnings));
    let files =
        outputs.keep(&flights, Some(&shoot.scene), |flight, mut out| flight.write_csv(&mut out))?;

    let report = |flight: &Flight| show::flight_report(flight, &flight.sha256(), None);
    let reports: Vec<Report> = flights.iter().map(report).collect();
    let json = match reports.as_slice() {
        [flight] => json!({ "flight": flight.json }),
        flights => json!({ "flights": flights.iter().map(|one| &one.json).collect::<Vec<_>>() }),
    };
    let text = reports.into_iter().map(|flight| flight.text).collect();
    Ok(Report::new(text, json).with_files(&files))
}

/// Returns the setpoints in logs as plans. Warns of each log whose firmware is not known, but
/// matters.
fn sent_setpoints(args: &FlyArgs, scene: &Scene) -> Result<Vec<Plan>> {
    FLIGHTS.check_all(&args.setpoints)?;
    let plans = args.setpoints.iter().map(|path| {
        let log = args.flight.read_log(path, Some(scene))?;
        // Only the log of a drone's own clock, without a zero timestamp, needs a firmware.
        if log.firmware.is_none() && log.zero_stamp_s.is_none() {
            let release = scene.vehicle.firmware.name();
            let text =
                format!("the log names no firmware: {release} is assumed (vehicle.firmware)");
            warn_of(path, &[text]);
        }
        sent(&log.flight)
    });
    plans.collect()
}

/// Returns the plan that a log's setpoints follow, and warns if some of them were interpolated.
fn sent(log: &Flight) -> Result<Plan> {
    let Replay { plan, n_restored } = replay(log)?;
    if n_restored > 0 {
        warn([format!("{n_restored} setpoints are missing from the log and were interpolated")]);
    }
    Ok(plan)
}
