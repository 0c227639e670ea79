//! `noctograph robustness`: what breaks the word first.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::outputs::Output;
use super::studies::{StudyFlags, counter};
use super::{Outcome, print};
use crate::error::Result;
use crate::report::endurance;
use crate::study::{
    Conditions, Contender, Endurance, Factor, RobustnessOptions, Store, robustness,
};

#[derive(Debug, Args)]
pub(super) struct RobustnessArgs {
    /// Scene, as for rank
    scene: String,
    #[command(flatten)]
    study: StudyFlags,
    /// Multiples of the usual that are tried
    #[arg(long, value_name = "X,...", value_delimiter = ',', default_value = "0,1,2,4,6,8")]
    times: Vec<f64>,
    /// Folder for robustness.csv, robustness.svg and flights.jsonl
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-robustness")]
    output: PathBuf,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &RobustnessArgs) -> Result<Outcome> {
    let options = RobustnessOptions {
        contender: Contender::find(&args.scene)?,
        words: args.study.words(20)?,
        usual: args.study.conditions()?,
        times: args.times.clone(),
        seed: args.study.seed,
    };
    let store = Store::open(&args.output)?;
    let csv = Output::create(&args.output.join("robustness.csv"))?;
    let svg = Output::create(&args.output.join("robustness.svg"))?;
    let n_each: usize = options.words.iter().map(|(_, n)| *n as usize).sum();
    let bar = counter("flying", n_each * options.times.len() * (Factor::ALL.len() + 1));
    let found = args.study.on_threads(|| robustness(&options, Some(&store), &bar))?;
    drop(bar);
    let found = found?;
    let title = format!("{}: what breaks the word", options.contender.name);
    let curves: Vec<_> = found.iter().map(|e| (name(e).to_owned(), points(e))).collect();
    let files = [
        csv.keep(|out| write_csv(out, &found))?,
        svg.keep(|out| out.write_all(endurance(&title, &curves).as_bytes()))?,
    ];
    if args.json {
        print(&format!("{}\n", serde_json::json!({ "factors": found, "files": files })))?;
        return Ok(Outcome::Done);
    }
    let files = files.map(|path| path.display().to_string()).join("\n          ");
    print(&format!("{}\nfiles     {files}\n", table(&options, &found)))?;
    Ok(Outcome::Done)
}

fn name(endurance: &Endurance) -> &'static str {
    endurance.factor.map_or("all together", Factor::name)
}

fn points(endurance: &Endurance) -> Vec<(f64, f64)> {
    endurance.levels.iter().map(|level| (level.times, level.legibility.value)).collect()
}

/// What once is, in the factor's own unit.
fn once(usual: &Conditions, factor: Option<Factor>) -> String {
    match factor {
        None => String::new(),
        Some(Factor::Mass) => format!("σ {:.1} %", 100.0 * usual.mass_frac),
        Some(Factor::CenterOfMass) => format!("σ {:.1} mm", 1e3 * usual.center_of_mass_m),
        Some(Factor::MotorLag) => format!("to {:.0} ms", 1e3 * usual.motor_lag_s),
        Some(Factor::Lighthouse) => format!("σ {:.0} mm", 1e3 * usual.lighthouse_distortion_m),
        Some(Factor::Gusts) => format!("σ {:.2} m/s", usual.gust_m_s),
        Some(Factor::LedDelay) => format!("to {:.0} ms", 1e3 * usual.led_delay_s),
    }
}

fn table(options: &RobustnessOptions, found: &[Endurance]) -> String {
    let mut text = "share of flights in which every letter reads; what breaks first is first\n\n\
                    factor          once        breaks at"
        .to_owned();
    let shown = options.times.len().min(6);
    for times in &options.times[..shown] {
        text += &format!("{:>7}", format!("x{times}"));
    }
    text += "\n";
    for e in found {
        let most = options.times.last().copied().unwrap_or_default();
        let at = e.breaks_at.map_or(format!("beyond x{most}"), |times| format!("x{times:.1}"));
        text += &format!("{:16}{:12}{at:>9}", name(e), once(&options.usual, e.factor));
        for level in &e.levels[..shown] {
            text += &format!("{:7.2}", level.all_read);
        }
        text += "\n";
    }
    text
}

fn write_csv(out: impl Write, found: &[Endurance]) -> std::io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    out.write_record(["factor", "times", "all_read", "legibility", "low", "high", "breaks_at"])?;
    for e in found {
        for level in &e.levels {
            let p = level.legibility;
            let numbers = [level.times, level.all_read, p.value, p.low, p.high];
            let breaks_at = e.breaks_at.map_or(String::new(), |times| times.to_string());
            let row = std::iter::once(name(e).to_owned())
                .chain(numbers.map(|number| number.to_string()))
                .chain([breaks_at]);
            out.write_record(row)?;
        }
    }
    out.flush()
}
