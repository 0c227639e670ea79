//! `noctograph robustness`: the disturbance that makes a word illegible first.

use std::io::Write;
use std::path::PathBuf;

use super::studies::{StudyFlags, counter, open_results, open_store};
use super::{Args, Report, Result, json, table};
use crate::report::endurance;
use crate::study::{Conditions, Endurance, Factor, RobustnessOptions, robustness, robustness_csv};

/// Files that are written at the end.
const FILES: [&str; 2] = ["robustness.csv", "robustness.svg"];
/// What helps against the radio.
const ON_BOARD: &str = "outages of the radio do not move a drone that flies a trajectory on board: export \
     --to compressed, and compare with --set 'radio.setpoints=\"on-board\"'";

#[derive(Debug, Args)]
pub(super) struct RobustnessArgs {
    /// Scene: a file, a preset, team, pid, geometric, tuned, or a folder
    scene: String,
    #[command(flatten)]
    study: StudyFlags,
    /// Multiples of the usual disturbance that are tried
    #[arg(long, value_name = "X,...", value_delimiter = ',', default_value = "0,1,2,4,6,8")]
    times: Vec<f64>,
    /// Folder for robustness.csv, robustness.svg and flights.jsonl
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-robustness")]
    output: PathBuf,
}

pub(super) fn run(args: &RobustnessArgs) -> Result<Report> {
    let usual = args.study.conditions("evening")?;
    let options = RobustnessOptions {
        contender: args.study.scene(&args.scene, &usual)?,
        words: args.study.words(20)?,
        usual,
        times: args.times.clone(),
        seed: args.study.seed,
    };
    // Nothing is left behind where a word or a scene is refused.
    options.prepare()?;
    let store = open_store(&args.output)?;
    let results = open_results(&args.output, &FILES)?;
    let bar = counter("flying", options.n_flights());
    let endurances = robustness(&options, Some(&store), &bar)?;
    drop(bar);
    let title = format!("{}: disturbances that break the word", options.contender.name);
    let curves = endurances.iter().map(|endurance| {
        let points = endurance.levels.iter().map(|level| (level.times, level.legible.value));
        (name(endurance).to_owned(), points.collect::<Vec<_>>())
    });
    let curves: Vec<_> = curves.collect();
    let [csv, svg] = FILES;
    results.write(csv, |out| out.write_all(robustness_csv(&endurances).as_bytes()))?;
    results.write(svg, |out| out.write_all(endurance(&title, &curves).as_bytes()))?;
    let files = results.keep(&FILES)?;
    let json = json!({ "factors": endurances });
    let mut report = Report::new(text(&options, &endurances), json);
    let of_radio = endurances.iter().find(|e| e.factor == Some(Factor::Radio));
    match of_radio.and_then(|radio| radio.breaks_at) {
        Some(times) if times > 0.0 => report.line("advice", ON_BOARD),
        Some(_) => {
            report.line("advice", "the word does not read without disturbances: mend that first");
        }
        None => {}
    }
    report.text.push('\n');
    Ok(report.with_files(&files))
}

fn name(endurance: &Endurance) -> &'static str {
    endurance.factor.map_or("all together", Factor::name)
}

/// The usual disturbance, in the factor's own unit.
fn usual(conditions: &Conditions, factor: Option<Factor>) -> String {
    let Some(factor) = factor else { return String::new() };
    match factor {
        Factor::Mass => format!("σ {:.1} %", 100.0 * conditions.mass_frac),
        Factor::CenterOfMass => format!("σ {:.1} mm", 1e3 * conditions.center_of_mass_m),
        Factor::MotorLag => format!("to {:.0} ms", 1e3 * conditions.motor_lag_s),
        Factor::Lighthouse => format!("σ {:.0} mm", 1e3 * conditions.lighthouse_distortion_m),
        Factor::AirspeedMoment => format!("to {:.2} mN s", 1e3 * conditions.airspeed_moment_n_s),
        Factor::Gusts => format!("σ {:.2} m/s", conditions.gust_m_s),
        Factor::LedDelay => format!("to {:.0} ms", 1e3 * conditions.led_delay_s),
        Factor::Radio => format!("{:.0} ms out", 1e3 * conditions.radio_outage_s),
        Factor::Yaw => format!("σ {:.2} °/s", conditions.yaw_drift_rad_s.to_degrees()),
        Factor::Propeller => format!("to {:.0} %", 100.0 * conditions.motor_loss_frac),
        Factor::Battery => format!("to age {:.1}", conditions.battery_age),
    }
}

fn text(options: &RobustnessOptions, endurances: &[Endurance]) -> String {
    let shown = options.times.len().min(5);
    let times: String = options.times[..shown].iter().map(|times| format!("|x{times}>6")).collect();
    let most = options.times.last().copied().unwrap_or_default();
    let beyond =
        |times: Option<f64>| times.map_or(format!(">{most}"), |times| format!("{times:.1}"));
    let row = |e: &Endurance| {
        let (at, [from, to]) = (beyond(e.breaks_at), e.breaks_between.map(beyond));
        let shares = e.levels[..shown].iter().map(|level| format!("\t{:.2}", level.legible.value));
        let (name, usual) = (name(e), usual(&options.usual, e.factor));
        format!("{:>2}\t{name}\t{usual}\tx{at}\t  {from} to {to}", e.place)
            + &shares.collect::<String>()
    };
    "fraction of legible photos at multiples of the usual disturbance; a word breaks\n\
     where the fraction falls to one half; factors with the same number in front\n\
     cannot be told apart (intervals of 95 %)\n\n"
        .to_owned()
        + &table(
            &format!("<4|factor<16|usual (x1)<12|breaks>6|  interval<12{times}"),
            endurances.iter().map(row),
        )
}
