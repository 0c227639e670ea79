//! `noctograph hold` simulates holding an altitude with three imperfect sensors.

use std::path::{Path, PathBuf};

use super::flags::{SceneFlags, SeedFlag};
use super::names::{named, names};
use super::outcome::Report;
use super::output::OutputFolder;
use super::progress::Progress;
use crate::error::Result;
use crate::report::{Page, hold_figure};
use crate::scene::Preset;
use crate::studies::{
    CONSISTENT, DURATION_S, Hold, HoldFigures, HoldModel, HoldScenario, HoldVerdict, STATE_NAMES,
    hold, hold_figures,
};
use clap::Args;
use serde_json::{Value, json};

#[derive(Debug, Args)]
pub(super) struct HoldArgs {
    /// Scenarios: calm, step, silent, drain, drift, step-silent, or all
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "all")]
    scenario: Vec<String>,
    /// Model of the drone [default: both]
    #[arg(long, value_name = "NAME", value_parser = named::<HoldModel>())]
    model: Option<HoldModel>,
    /// Number of flights of each scenario and model, with consecutive seeds
    #[arg(long, value_name = "N", default_value_t = 80)]
    runs: u32,
    /// Preset with the drone, the sensors and the altitude filter
    #[arg(long, value_name = "NAME", default_value = "bzzz", conflicts_with = "scene",
          value_parser = names::<Preset>())]
    preset: String,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    seed: SeedFlag,
    /// Folder for hold.html, hold.json and, for each scenario and model, a CSV and a figure of the
    /// first flight
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-hold")]
    output: PathBuf,
}

/// Runs the verb `hold`, which simulates altitude hold in scenarios, and reports the errors and the
/// consistency of the filter. Writes a table and a figure of the first flight of each scenario and
/// model, a page and the figures as JSON. The report passes if no bound is missed.
pub(super) fn run(args: &HoldArgs) -> Result<Report> {
    let scenarios = scenarios(&args.scenario)?;
    let preset = format!("preset = \"{}\"", args.preset);
    let scene = args.scene.load_or(&preset, "scene", Path::new(""), |_| Ok(()))?;
    let (options, seed) = (scene.sim(), args.seed.seed.unwrap_or(scene.seed));
    let models = args.model.map_or(HoldModel::ALL.to_vec(), |model| vec![model]);
    let mut folder = OutputFolder::create(&args.output)?;
    let (mut outcomes, mut drawings) = (Vec::new(), Vec::new());
    let mut progress = Progress::new("holding");
    let n = (scenarios.len() * models.len()) as f64;
    for scenario in scenarios {
        for model in &models {
            progress.update(outcomes.len() as f64 / n);
            outcomes.push(hold_figures(*model, &options, scenario, seed, args.runs)?);
            // The first flight is simulated again for the table and the plot.
            let flight = hold(*model, &options, scenario, DURATION_S, seed)?;
            drawings.push(write_flight(&mut folder, scenario, *model, &flight)?);
        }
    }
    drop(progress);
    // hold.json, the printed text and the page show the same figures.
    let product = json!({
        "filter": options.observer.altitude,
        "hover_throttle": options.believed_hover_throttle(),
        "scenarios": outcomes,
    });
    folder.write("hold.json", format!("{product:#}\n"))?;
    let report = Report::with_words(product, &words(&outcomes), LAYOUT);
    let page = Page::new("Altitude hold", "").printed(report.text.trim_end()).drawings(&drawings);
    folder.write("hold.html", page.html())?;
    let files = folder.keep()?;
    let kept = outcomes.iter().all(|figures| figures.missed.is_empty());
    Ok(report.with_files(&files).passes(kept))
}

/// Writes the table and the figure of a flight, named after its scenario and model. Returns the
/// figure (SVG).
fn write_flight(
    folder: &mut OutputFolder,
    scenario: HoldScenario,
    model: HoldModel,
    flight: &Hold,
) -> Result<String> {
    let (scenario, model) = (scenario.name(), model.name());
    folder.write_with(&format!("{scenario}-{model}.csv"), |out| flight.write_csv(out))?;
    let drawing = hold_figure(flight, &format!("{scenario}, {model} model"));
    folder.write(&format!("{scenario}-{model}.svg"), &drawing)?;
    Ok(drawing)
}

const LAYOUT: &str = "\
RMS error of the estimate and of the hold, fraction of z inside its 95 % band, RMS error of the hover throttle, NIS of satellites, ranger and barometer, detected steps of the floor out of those that the ranger passed, as the mean over the flights

|scenarios|scenario<12|model<8|estimate/cm>8|hold/cm>6|inside>7|throttle>9|NIS>15|  steps<0
{scenario}|{model}|{estimate_m.value*100:.2}|{hold_m.value*100:.2}|{inside:.3}|{hover_throttle:.4}|{nis.0:.2~-} {nis.1:.2~-} {nis.2:.2~-}|  {steps.0:.2} of {steps.1:.2}
*missed missed    {}

mean squared error over variance of each state: 1 where the covariance holds, consistent from {consistent.0} to {consistent.1}; below it the 95 % interval
|states|scenario<12|model<8|{names.0}>10|{names.1}>10|{names.2}>10|{names.3}>10|{names.4}>10|{names.5}>10
{scenario}|{model}|{cells.0}|{cells.1}|{cells.2}|{cells.3}|{cells.4}|{cells.5}
*off off       {}

";

/// Returns the report's texts, which are the rows of states, the missed bounds, and the
/// inconsistent states. Each scenario has two rows: the mean squared errors divided by the
/// variances, and their 95 % intervals.
fn words(figures: &[HoldFigures]) -> Value {
    let (mut states, mut missed, mut inconsistent) = (Vec::new(), Vec::new(), Vec::new());
    for f in figures {
        let name = format!("{}, {}", f.scenario, f.model);
        missed.extend(f.missed.iter().map(|missed| format!("{name}: {missed}")));
        let errors: Vec<String> =
            f.states.iter().map(|state| format!("{:.2}", state.error.value)).collect();
        states.push(json!({ "scenario": f.scenario, "model": f.model, "cells": errors }));
        // A single run has no interval. Values from 10 are shown without decimals, so that the
        // columns stay narrow.
        let intervals = f.states.iter().map(|state| {
            if f.runs < 2 {
                return "-".to_owned();
            }
            let digits = if state.error.high < 10.0 { 2 } else { 0 };
            format!("{:.digits$}-{:.digits$}", state.error.low, state.error.high)
        });
        let intervals: Vec<String> = intervals.collect();
        states.push(json!({ "scenario": "", "model": "", "cells": intervals }));
        let others = f.states.iter().filter(|state| state.verdict != HoldVerdict::Consistent);
        let others = others.map(|state| format!("{} {}", state.state, state.verdict.name()));
        let others = others.collect::<Vec<_>>().join(", ");
        inconsistent.extend((!others.is_empty()).then(|| format!("{name}: {others}")));
    }
    json!({
        "consistent": CONSISTENT, "names": STATE_NAMES, "states": states, "missed": missed,
        "off": inconsistent,
    })
}

/// Returns the scenarios whose names were typed, in the order in which they are defined. `all`
/// stands for every scenario. Returns [`Error::Input`](crate::error::Error::Input) for an unknown
/// name.
fn scenarios(typed: &[String]) -> Result<Vec<HoldScenario>> {
    let named = typed.iter().filter(|name| *name != "all").map(|name| name.parse());
    let named: Vec<HoldScenario> = named.collect::<Result<_>>()?;
    let takes_all = named.len() < typed.len();
    let scenarios = HoldScenario::ALL.iter().copied();
    Ok(scenarios.filter(|scenario| takes_all || named.contains(scenario)).collect())
}
