//! `noctograph hold`: altitude hold from three imperfect sensors, scenario by scenario.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::output::OutputFolder;
use super::report::{Outcome, Report};
use crate::error::Result;
use crate::report::hold_figure;
use crate::sim::altitude::{AltitudeOptions, Hold, Scenario, hold};
use crate::study::{DURATION_S, HoldFigures, hold_figures};

#[derive(Debug, Args)]
pub(super) struct HoldArgs {
    /// Scenarios: calm, step, silent, drain, drift, step-silent, or all
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "all")]
    scenario: Vec<String>,
    /// Flights of each scenario, with seeds 0, 1, 2, …
    #[arg(long, value_name = "N", default_value_t = 80)]
    runs: u32,
    /// Folder for hold.json and, for each scenario, a CSV and a figure of the first flight
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-hold")]
    output: PathBuf,
}

pub(super) fn run(args: &HoldArgs) -> Result<Report> {
    let scenarios = scenarios(&args.scenario)?;
    let options = AltitudeOptions::default();
    let folder = OutputFolder::create(&args.output)?;
    let (mut names, mut found) = (vec!["hold.json".to_owned()], Vec::new());
    for scenario in scenarios {
        found.push(hold_figures(&options, scenario, args.runs)?);
        let flight = hold(&options, scenario, DURATION_S, 0)?;
        let [csv, svg] = ["csv", "svg"].map(|kind| format!("{}.{kind}", scenario.name()));
        folder.write(&csv, |out| write_csv(out, &flight))?;
        let figure = hold_figure(&flight, scenario.name());
        folder.write(&svg, |out| out.write_all(figure.as_bytes()))?;
        names.extend([csv, svg]);
    }
    let json = json!({ "scenarios": found });
    folder.write("hold.json", |out| writeln!(out, "{json:#}"))?;
    let files = folder.keep(&names)?;
    let kept = found.iter().all(|figures| figures.missed.is_empty());
    let outcome = if kept { Outcome::Done } else { Outcome::NotSafe };
    Ok(Report::new(table(&found), json).with_files(&files).with_outcome(outcome))
}

fn scenarios(typed: &[String]) -> Result<Vec<Scenario>> {
    if typed.iter().any(|name| name == "all") {
        return Ok(Scenario::ALL.to_vec());
    }
    typed.iter().map(|name| name.parse::<Scenario>()).collect()
}

fn table(found: &[HoldFigures]) -> String {
    let mut text =
        "scenario      estimate     hold  inside 95 %  hover    NIS gnss  tof  baro  steps\n"
            .to_owned();
    for f in found {
        let [gnss, tof, barometer] =
            f.nis.map(|nis| nis.map_or("-".to_owned(), |nis| format!("{nis:.2}")));
        text += &format!(
            "{:12}{:7.2} cm{:6.2} cm{:13.3}{:7.4}{gnss:>12}{tof:>5}{barometer:>6}{:7.2}\n",
            f.scenario,
            100.0 * f.estimate_m.value,
            100.0 * f.hold_m.value,
            f.inside,
            f.hover_throttle,
            f.steps,
        );
    }
    text.push('\n');
    for (f, missed) in found.iter().flat_map(|f| f.missed.iter().map(move |m| (f, m))) {
        text += &format!("missed: {}: {missed}\n", f.scenario);
    }
    text
}

fn write_csv(out: impl Write, flight: &Hold) -> std::io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    let states = ["z_m", "v_m_s", "offset_m_s2", "gain_m_s2", "ranger_bias_m", "barometer_bias_m"];
    let columns = ["true", "estimated", "sigma"]
        .iter()
        .flat_map(|kind| states.iter().map(move |state| format!("{state}_{kind}")));
    let head = ["time_s", "throttle", "hover_throttle_true"].map(str::to_owned);
    out.write_record(head.into_iter().chain(columns))?;
    for s in &flight.samples {
        let numbers = [s.time_s, s.throttle, s.hover_throttle].into_iter();
        let states = [s.truth, s.estimate, s.sigma].into_iter().flatten();
        out.write_record(numbers.chain(states).map(|number| number.to_string()))?;
    }
    out.flush()
}
