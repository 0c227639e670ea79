//! `noctograph import` of a folder: the logs of an evening become a page and a conditions file.

use std::io::Write;
use std::path::Path;

use serde_json::json;

use super::flags::warn_of;
use super::outcome::{Report, line, typed, wrapped};
use super::output::OutputFolder;
use super::studies::counter;
use super::table::table;
use crate::error::Result;
use crate::logs::{ImportOptions, logs_in};
use crate::report::evening_page;
use crate::scene::Scene;
use crate::study::{Conditions, Evening, EveningLog, MeanDrone};

pub(super) fn run(
    folder: &Path,
    scene: &Scene,
    options: &ImportOptions,
    output: &Path,
) -> Result<Report> {
    let place = folder.display().to_string();
    let bar = counter("reading", logs_in(folder)?.len());
    let evening = Evening::import(folder, options, scene, &bar)?;
    drop(bar);
    for log in &evening.logs {
        warn_of(Path::new(&log.log), &log.warnings);
    }
    let written = OutputFolder::create(output)?;
    let (rows, mean) = (evening.conditions(), evening.mean_drone(scene));
    let toml = evening.conditions_toml(&rows);
    Conditions::parse(&toml, "conditions.toml")?;
    let file = typed(&output.join("conditions.toml"));
    let mut advice: Vec<String> = mean.iter().map(advice_of).collect();
    if !rows.is_empty() {
        advice.push(format!(
            "then fly as on this evening: `noctograph preview WORD --spread 20 --conditions {file}`"
        ));
    }
    let title = format!("Evening of {}", folder.file_name().unwrap_or_default().to_string_lossy());
    let html = evening_page(&title, &evening, &toml, &advice).html();
    written.write("evening.html", |out| out.write_all(html.as_bytes()))?;
    // Without a sound flight there is nothing that a study could use.
    let names: &[&str] = match rows.is_empty() {
        true => &["evening.html"],
        false => &["evening.html", "conditions.toml"],
    };
    if !rows.is_empty() {
        written.write("conditions.toml", |out| out.write_all(toml.as_bytes()))?;
    }
    let files = written.keep(names)?;
    let conditions =
        rows.iter().map(|row| format!("{}\t{:.3e}\t  {}", row.key, row.value, row.from));
    let mut text = line(
        "folder",
        &format!("{place}: {} logs, {} sound", evening.logs.len(), evening.sound().count()),
    );
    let head = "drone<11|air>6|gap>7|thrust>8|trim x>8|y>7|lag>7|gusts>8|  log<0";
    text += &("\n".to_owned() + &table(head, evening.logs.iter().map(row)));
    text += &flaws(&evening);
    text.push('\n');
    if rows.is_empty() {
        text += &line("conditions", "none: no log is sound");
    } else {
        text += &table("condition<18|value>10|  from<0", conditions);
    }
    text.push('\n');
    text.extend(advice.iter().map(|advice| line("advice", advice)));
    let json = json!({ "logs": evening.logs, "conditions": rows, "mean_drone": mean });
    Ok(Report::new(text, json).with_files(&files))
}

/// Settings of a scene with the evening's drones.
fn advice_of(mean: &MeanDrone) -> String {
    let [x, y] = mean.center_of_mass_m;
    format!(
        "the mean of your drones, for any command: --set vehicle.k_f_n={:.3e} --set \
         vehicle.center_of_mass_m=[{x:.2e},{y:.2e}]",
        mean.k_f_n
    )
}

fn row(log: &EveningLog) -> String {
    let figures = log.figures.as_ref().map_or_else(
        || "\t".repeat(6),
        |f| {
            let or_none = |value: Option<String>| value.unwrap_or("-".into());
            format!(
                "{:.1} s\t{:.2} s\t{:.1} %\t{:+.2}\t{:+.2}\t{}\t{}",
                f.air_s,
                f.longest_gap_s,
                100.0 * f.thrust_frac,
                1e3 * f.trim_m[0],
                1e3 * f.trim_m[1],
                or_none(f.lag_s.map(|lag_s| format!("{:.0} ms", 1e3 * lag_s))),
                or_none(f.gust_m_s.map(|gust| format!("{gust:.3}"))),
            )
        },
    );
    // Names are cut so that rows keep to 80 columns: a log's keeps its end.
    let beyond = log.log.chars().count().saturating_sub(16);
    let end: String = match beyond {
        0 => log.log.clone(),
        _ => "…".chars().chain(log.log.chars().skip(beyond + 1)).collect(),
    };
    format!("{:.10}\t{figures}\t  {end}", log.drone)
}

/// What speaks against the logs that are not sound.
fn flaws(evening: &Evening) -> String {
    let flawed = evening.logs.iter().filter(|log| !log.flaws.is_empty());
    let lines = flawed.map(|log| {
        let flaws: Vec<String> = log.flaws.iter().map(ToString::to_string).collect();
        wrapped("not sound ", &format!("{}: {}", log.log, flaws.join("; ")))
    });
    let lines: String = lines.collect();
    if lines.is_empty() { lines } else { "\n".to_owned() + &lines }
}
