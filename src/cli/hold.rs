//! `noctograph hold`: altitude hold from three imperfect sensors, scenario by scenario.

use std::io::Write;
use std::path::PathBuf;

use super::{
    Args, Outcome, OutputFolder, Progress, Report, Result, SceneFlags, SeedFlag, json, line, named,
    names, table,
};
use crate::report::{Page, hold_figure};
use crate::scene::Preset;
use crate::sim::AltitudeSensor;
use crate::studies::{
    CONSISTENT, DURATION_S, Hold, HoldFigures, HoldModel, HoldScenario, HoldVerdict, STATE_NAMES,
    hold, hold_figures,
};

#[derive(Debug, Args)]
pub(super) struct HoldArgs {
    /// Scenarios: calm, step, silent, drain, drift, step-silent, or all
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "all")]
    scenario: Vec<String>,
    /// Model that flies [default: both]
    #[arg(long, value_name = "NAME", value_parser = named::<HoldModel>())]
    model: Option<HoldModel>,
    /// Flights of each scenario and model, with one seed after the other
    #[arg(long, value_name = "N", default_value_t = 80)]
    runs: u32,
    /// Preset whose drone, sensors and altitude filter fly
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

pub(super) fn run(args: &HoldArgs) -> Result<Report> {
    let scenarios = scenarios(&args.scenario)?;
    let preset = format!("preset = \"{}\"", args.preset);
    let scene = args.scene.load_or(&preset, "scene", |_| Ok(()))?;
    let (options, seed) = (scene.sim(), args.seed.seed.unwrap_or(scene.seed));
    let models = args.model.map_or(HoldModel::ALL.to_vec(), |model| vec![model]);
    let folder = OutputFolder::create(&args.output)?;
    let mut names = vec!["hold.html".to_owned(), "hold.json".to_owned()];
    let (mut found, mut figures) = (Vec::new(), Vec::new());
    let mut progress = Progress::new("holding");
    let n = (scenarios.len() * models.len()) as f64;
    for scenario in scenarios {
        for model in &models {
            progress.update(found.len() as f64 / n);
            found.push(hold_figures(*model, &options, scenario, seed, args.runs)?);
            let flight = hold(*model, &options, scenario, DURATION_S, seed)?;
            let name = format!("{}-{}", scenario.name(), model.name());
            let [csv, svg] = ["csv", "svg"].map(|kind| format!("{name}.{kind}"));
            folder.write(&csv, |out| write_csv(out, &flight))?;
            let title = format!("{}, {} model", scenario.name(), model.name());
            let figure = hold_figure(&flight, &title);
            folder.write(&svg, |out| out.write_all(figure.as_bytes()))?;
            figures.push(figure);
            names.extend([csv, svg]);
        }
    }
    drop(progress);
    let text = text_of(&found) + &consistency(&found);
    let json = json!({
        "filter": options.observer.altitude,
        "hover_throttle": options.believed_hover_throttle(),
        "scenarios": found,
    });
    folder.write("hold.json", |out| writeln!(out, "{json:#}"))?;
    let page = Page::new("Altitude hold", "").printed(&text).drawings(&figures);
    folder.write("hold.html", |out| out.write_all(page.html().as_bytes()))?;
    let files = folder.keep(&names)?;
    let kept = found.iter().all(|figures| figures.missed.is_empty());
    let outcome = if kept { Outcome::Done } else { Outcome::NotSafe };
    Ok(Report::new(text + "\n", json).with_files(&files).with_outcome(outcome))
}

fn scenarios(typed: &[String]) -> Result<Vec<HoldScenario>> {
    let named = typed.iter().filter(|name| *name != "all").map(|name| name.parse());
    let named: Vec<HoldScenario> = named.collect::<Result<_>>()?;
    let all = named.len() < typed.len();
    Ok(HoldScenario::ALL.iter().filter(|one| all || named.contains(one)).copied().collect())
}

fn text_of(figures: &[HoldFigures]) -> String {
    let row = |f: &HoldFigures| {
        let nis = f.nis.map(|nis| nis.map_or("   -".to_owned(), |nis| format!("{nis:.2}")));
        format!(
            "{}\t{}\t{:.2}\t{:.2}\t{:.3}\t{:.4}\t {}\t{:.2} of {:.2}",
            f.scenario,
            f.model,
            100.0 * f.estimate_m.value,
            100.0 * f.hold_m.value,
            f.inside,
            f.hover_throttle,
            nis.join(" "),
            f.steps[0],
            f.steps[1],
        )
    };
    let head = "scenario<12|model<8|estimate>8|hold>6|inside>7|throttle>9|     NIS<17| steps<0";
    let units = std::iter::once("\t\tcm\tcm".to_owned());
    let mut text = "RMS error of the estimate and of the hold, share of z inside its 95 % band, RMS\n\
                    error of the hover throttle, NIS of satellites, ranger and barometer, steps of\n\
                    the floor that were found of those seen, on average over the flights\n\n"
        .to_owned()
        + &table(head, units.chain(figures.iter().map(row)));
    for (f, missed) in figures.iter().flat_map(|f| f.missed.iter().map(move |m| (f, m))) {
        text += &line("missed", &format!("{}, {}: {missed}", f.scenario, f.model));
    }
    text
}

/// Squared error over variance of each state, with its 95 % interval below it and a word where it
/// is out of bounds.
fn consistency(figures: &[HoldFigures]) -> String {
    let [least, most] = CONSISTENT;
    let rows = figures.iter().flat_map(|f| {
        let errors = f.states.iter().map(|state| format!("\t{:.2}", state.error.value));
        let intervals = f.states.iter().map(|state| {
            if f.runs < 2 {
                return "\t -".to_owned();
            }
            let digits = if state.error.high < 10.0 { 2 } else { 0 };
            format!("\t {:.digits$}-{:.digits$}", state.error.low, state.error.high)
        });
        let (errors, intervals): (String, String) = (errors.collect(), intervals.collect());
        [format!("{}\t{}{errors}", f.scenario, f.model), format!("\t{intervals}")]
    });
    let names: String = STATE_NAMES.iter().map(|name| format!("|{name}>10")).collect();
    let mut text = format!(
        "\nmean squared error over variance of each state: 1 where the covariance holds,\n\
         consistent from {least} to {most}; below it the 95 % interval\n{}",
        table(&format!("scenario<12|model<8{names}"), rows)
    );
    for f in figures {
        let off = f.states.iter().filter(|state| state.verdict != HoldVerdict::Consistent);
        let off = off.map(|state| format!("{} {}", state.state, state.verdict.name()));
        let off = off.collect::<Vec<_>>().join(", ");
        if !off.is_empty() {
            text += &line("off", &format!("{}, {}: {off}", f.scenario, f.model));
        }
    }
    text
}

fn write_csv(out: impl Write, flight: &Hold) -> std::io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    let states = ["z_m", "v_m_s", "offset_m_s2", "gain_m_s2", "ranger_bias_m", "barometer_bias_m"];
    let columns = ["true", "estimated", "sigma"]
        .iter()
        .flat_map(|kind| states.iter().map(move |state| format!("{state}_{kind}")));
    let head = ["time_s", "throttle", "gnss_m", "time_of_flight_m", "barometer_m"];
    out.write_record(head.map(str::to_owned).into_iter().chain(columns))?;
    for s in &flight.samples {
        let numbers = [s.time_s, s.throttle].map(Some);
        let readings = AltitudeSensor::ALL.map(|sensor| {
            let last = s.readings.iter().rfind(|reading| reading.sensor == sensor);
            last.map(|reading| reading.measured_m)
        });
        let states = [s.truth, s.estimate, s.sigma].into_iter().flatten().map(Some);
        let cells = numbers.into_iter().chain(readings).chain(states);
        let cells = cells.map(|number| number.map_or_else(String::new, |n| n.to_string()));
        out.write_record(cells)?;
    }
    out.flush()
}
