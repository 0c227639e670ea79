//! `noctograph import` of a folder: the logs of an evening become a page and a conditions file.

use std::io::Write;
use std::path::Path;

use super::studies::counter;
use super::{OutputFolder, Report, Result, json, shell_word, table, warn_of, wrapped};
use crate::logs::{ImportOptions, logs_in};
use crate::report::evening_page;
use crate::scene::Scene;
use crate::studies::{Conditions, Evening, EveningLog, MeanDrone};

pub(super) fn run(
    folder: &Path,
    scene: &Scene,
    options: &ImportOptions,
    output: &Path,
) -> Result<Report> {
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
    let file = shell_word(&output.join("conditions.toml"));
    let mut advice: Vec<String> = mean.iter().map(advice_of).collect();
    if !rows.is_empty() {
        advice.push(format!(
            "then fly as on this evening: `noctograph preview WORD --spread 20 --conditions {file}`"
        ));
    }
    let title = format!("Evening of {}", folder.file_name().unwrap_or_default().to_string_lossy());
    let html = evening_page(&title, &evening, &toml, &advice).html();
    written.write("evening.html", |out| out.write_all(html.as_bytes()))?;
    let mut names = vec!["evening.html"];
    // Without a sound flight there is nothing that a study could use.
    if !rows.is_empty() {
        written.write("conditions.toml", |out| out.write_all(toml.as_bytes()))?;
        names.push("conditions.toml");
    }
    let files = written.keep(&names)?;
    let json = json!({ "logs": evening.logs, "conditions": rows, "mean_drone": mean });
    let mut report = Report::of(json);
    let (n_logs, n_sound) = (evening.logs.len(), evening.sound().count());
    report.line("folder", &format!("{}: {n_logs} logs, {n_sound} sound", folder.display()));
    let head = "drone<11|air>6|gap>7|thrust>8|trim x>8|y>7|lag>7|gusts>8|  log<0";
    report.text.push('\n');
    report.text += &table(head, evening.logs.iter().map(row));
    // What speaks against the logs that are not sound.
    let mut flawed = evening.logs.iter().filter(|log| !log.flaws.is_empty()).peekable();
    if flawed.peek().is_some() {
        report.text.push('\n');
    }
    for log in flawed {
        let flaws: Vec<String> = log.flaws.iter().map(ToString::to_string).collect();
        report.text += &wrapped("not sound ", &format!("{}: {}", log.log, flaws.join("; ")));
    }
    report.text.push('\n');
    if rows.is_empty() {
        report.line("conditions", "none: no log is sound");
    } else {
        let rows = rows.iter().map(|row| format!("{}\t{:.3e}\t  {}", row.key, row.value, row.from));
        report.text += &table("condition<18|value>10|  from<0", rows);
    }
    report.text.push('\n');
    advice.iter().for_each(|advice| report.line("advice", advice));
    Ok(report.with_files(&files))
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
            let [x, y] = f.trim_m.map(|m| 1e3 * m);
            let lag = f.lag_s.map_or("-".to_owned(), |lag_s| format!("{:.0} ms", 1e3 * lag_s));
            let gust = f.gust_m_s.map_or("-".to_owned(), |gust| format!("{gust:.3}"));
            let percent = 100.0 * f.thrust_frac;
            let times = format!("{:.1} s\t{:.2} s", f.air_s, f.longest_gap_s);
            format!("{times}\t{percent:.1} %\t{x:+.2}\t{y:+.2}\t{lag}\t{gust}")
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
