//! With a folder, `noctograph import` writes a page and a conditions file from an evening's logs.

use std::path::Path;

use super::flags::warn_of;
use super::outcome::{Report, shell_word};
use super::output::OutputFolder;
use super::studies::{counter, shortened};
use super::terminal::warn;
use crate::error::Result;
use crate::logs::{ImportOptions, logs_in};
use crate::report::evening_page;
use crate::scene::Scene;
use crate::studies::{Conditions, Evening, MeanDrone};
use crate::vehicle::VehicleOptions;
use serde_json::json;

/// Imports a folder of logs, and reports the drones' parameters and the conditions of the flights.
/// Writes a page, and a file of conditions if at least one log is valid.
pub(super) fn run(
    folder: &Path,
    scene: &Scene,
    options: &ImportOptions,
    output: &Path,
) -> Result<Report> {
    let (logs, others) = logs_in(folder)?;
    if !others.is_empty() {
        warn([format!(
            "{}: these files are not logs and were not read: {}",
            folder.display(),
            others.join(", ")
        )]);
    }
    let bar = counter("reading", logs.len());
    let evening = Evening::import(folder, options, scene, &bar)?;
    drop(bar);
    for log in &evening.logs {
        warn_of(Path::new(&log.log), &log.warnings);
    }
    // The conditions are parsed with the parser of studies before they are written, so that a file
    // that no study can read is never written.
    let mut written = OutputFolder::create(output)?;
    let (rows, mean) = (evening.conditions(), evening.mean_drone(scene));
    let toml = evening.conditions_toml(&rows);
    Conditions::parse(&toml, "conditions.toml")?;
    let file = shell_word(&output.join("conditions.toml"));
    let mut advice = mean.map_or(Vec::new(), |mean| advice_of(&mean, &scene.vehicle));
    if !rows.is_empty() {
        advice.push(format!(
            "to fly under the conditions of this evening: `noctograph preview WORD --spread 20 \
             --conditions {file}`"
        ));
    }
    // Flawed logs are listed, but do not contribute to the conditions.
    let flawed = evening.logs.iter().filter(|log| !log.flaws.is_empty()).map(|log| {
        let flaws: Vec<String> = log.flaws.iter().map(ToString::to_string).collect();
        json!({ "log": log.log, "flaws": flaws.join("; ") })
    });
    let names: Vec<&str> = evening.logs.iter().map(|log| log.log.as_str()).collect();
    let words = json!({
        "folder": folder.display().to_string(), "n_logs": evening.logs.len(), "advice": advice,
        // File names are shortened so that the rows fit into 80 columns.
        "n_sound": evening.sound().count(), "files": shortened(&names, 16),
        "flawed": flawed.collect::<Vec<_>>(),
        "none": rows.is_empty().then_some("none of the logs is valid"),
    });
    let product = json!({ "logs": evening.logs, "conditions": rows, "mean_drone": mean });
    let report = Report::with_words(product, &words, LAYOUT);
    let title = format!("Evening of {}", folder.file_name().unwrap_or_default().to_string_lossy());
    let page = evening_page(&title, &evening, &report.text, &toml);
    written.write("evening.html", page.html())?;
    // A study under these conditions needs at least one valid flight.
    if !rows.is_empty() {
        written.write("conditions.toml", toml)?;
    }
    Ok(report.with_files(&written.keep()?))
}

const LAYOUT: &str = "\
folder    {folder}: {n_logs} logs, {n_sound} valid

|logs|drone<11|air/s>6|gap/s>7|thrust/%>8|trim x/mm>8|y/mm>7|lag/ms>7|gusts/m/s>8|  log<0
{drone:.10}|{figures.air_s:.1}|{figures.longest_gap_s:.2}|{figures.thrust_frac*100:.1}|{figures.trim_m.0*1e3:+.2}|{figures.trim_m.1*1e3:+.2}|{figures.lag_s*1e3:.0}|{figures.gust_m_s:.3}|  {files.#}

*flawed not valid\t{log}: {flaws}

conditions  none: {none}
|conditions|condition<18|value>10|  from<0
{key}|{value:.3e}|  {from}

*advice advice    {}
";

/// Returns advice on scene settings in which the mean drone of the logs differs from the scene's.
fn advice_of(mean: &MeanDrone, vehicle: &VehicleOptions) -> Vec<String> {
    let MeanDrone { k_f_n, center_of_mass_m: [x, y], .. } = *mean;
    let (percent, x_mm, y_mm) = (100.0 * (k_f_n / vehicle.k_f_n - 1.0), 1e3 * x, 1e3 * y);
    let thrust = format!(
        "your drones' thrust differs from the scene's by {percent:+.1} %: \
         `--set vehicle.k_f_n={k_f_n:.3e}`"
    );
    let trim = format!(
        "your drones' center of mass is at ({x_mm:+.1}, {y_mm:+.1}) mm: \
         `--set vehicle.center_of_mass_m=[{x:.4},{y:.4}]`"
    );
    // Where the logs show no significant difference, the mean drone has exactly the scene's value.
    let is_off = [k_f_n != vehicle.k_f_n, [x, y] != vehicle.center_of_mass_m];
    is_off.into_iter().zip([thrust, trim]).filter_map(|(is, said)| is.then_some(said)).collect()
}
