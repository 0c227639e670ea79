//! `noctograph learn`: the setpoints and light schedule of a word, from its earlier flights.

use std::io::Write;
use std::path::PathBuf;

use super::studies::{open_results, open_store, share};
use super::{
    Args, Error, FlightFlags, Report, Result, SetFlag, Value, find_scene, message, table, warn,
};
use crate::flight::Flight;
use crate::plan::Plan;
use crate::scene::NamedScene;
use crate::studies::{
    Conditions, LearnOptions, Prepared, Round, align, check_writes, correct, learn,
};

#[derive(Debug, Args)]
#[command(
    after_help = "The folder holds scene.toml and plan-WORD.csv: rank and preview take it as a \
                  scene, fly and preview take the plan. After a real flight, the plan of the next \
                  one:\n  noctograph learn my.toml WORD --flight log.json \\\n    --sent \
                  FOLDER/plan-WORD.csv"
)]
pub(super) struct LearnArgs {
    /// Scene: a file, a preset, team, pid, geometric, tuned, or a learned folder
    scene: String,
    /// Word to write
    word: String,
    #[command(flatten)]
    set: SetFlag,
    /// Learn one round from these flights or logs of one plan, instead of simulated ones
    #[arg(long, value_name = "FILE", num_args = 1.., alias = "from-log")]
    flight: Vec<PathBuf>,
    #[command(flatten)]
    flights: FlightFlags,
    /// Plan that was sent in those flights [default: the scene's]
    #[arg(long, value_name = "FILE", requires = "flight")]
    sent: Option<PathBuf>,
    /// Most rounds
    #[arg(long, value_name = "N", default_value_t = LearnOptions::default().rounds)]
    rounds: u32,
    /// Flights of each round, over which errors are averaged
    #[arg(long, value_name = "N", default_value_t = LearnOptions::default().flights)]
    repeats: u32,
    /// Fraction of the error that a round takes off
    #[arg(long, value_name = "FRACTION", default_value_t = LearnOptions::default().gain)]
    gain: f64,
    /// Smoothing of the error, in seconds: more rejects noise, less follows corners
    #[arg(long, value_name = "S", default_value_t = LearnOptions::default().smooth_s)]
    smooth: f64,
    /// Seed that all seeds are drawn from
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Folder for scene.toml, plan-WORD.csv and flights.jsonl
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-learn")]
    output: PathBuf,
}

pub(super) fn run(args: &LearnArgs) -> Result<Report> {
    crate::error::within("gain", args.gain, 0.0, 1.0)?;
    crate::error::within("smooth", args.smooth, 0.0, 10.0)?;
    crate::error::within("repeats", args.repeats.into(), 1.0, 1e4)?;
    let contender = find_scene(&args.scene, &args.set.set)?;
    let ready = Prepared::new(&contender, &args.word, &Conditions::any_drone())?;
    ready.planned()?;
    let options = LearnOptions {
        rounds: args.rounds,
        flights: args.repeats,
        gain: args.gain,
        smooth_s: args.smooth,
        seed: args.seed,
    };
    // Nothing is left behind where a log or a plan is refused.
    let of_logs = match args.flight.is_empty() {
        true => None,
        false => Some(from_logs(args, &ready, &options)?),
    };
    let store = open_store(&args.output)?;
    let word = ready.word();
    let n_plans = if of_logs.is_some() { 1 } else { ready.plans().len() };
    let names = (0..n_plans).map(|drone| NamedScene::plan_file(word, drone, n_plans));
    let names: Vec<String> = names.collect();
    // The plans have their names before the scene that names them.
    let files: Vec<&str> = names.iter().map(String::as_str).chain(["scene.toml"]).collect();
    let results = open_results(&args.output, &files)?;
    let mut report = Report::empty();
    report.value("word", word);
    let mut rounds = Vec::new();
    let plans = if let Some([sent, corrected]) = of_logs {
        let moved_m = moves_m(&sent, &corrected);
        let [mean_mm, max_mm] = moved_m.map(|m| 1e3 * m);
        let moved =
            format!("{word}: its setpoints move by {mean_mm:.0} mm (mean), {max_mm:.0} mm (max)");
        report.value("helped", Value::Null);
        report.figure("moved_m", moved_m, "learned", &moved);
        vec![corrected]
    } else {
        let watch = &mut |round: &Round| {
            let (number, p) = (rounds.len(), round.legibility);
            message("", &format!("round {number}: read with probability {p:.3}"));
            rounds.push(round.clone());
        };
        let all = learn(&ready, &options, Some(&store), watch)?;
        report.text = rounds_table(&rounds);
        let helped = all.helped();
        report.figure("helped", helped, "learned", &learned(word, &rounds, all.best(), helped));
        report.value("moved_m", Value::Null);
        all.plans
    };
    report.value("rounds", rounds);
    let toml = format!(
        "# Learned by noctograph {} for {word}; send {}.\n{}",
        env!("CARGO_PKG_VERSION"),
        names.join(", "),
        contender.scene.to_toml()
    );
    for (name, plan) in names.iter().zip(&plans) {
        results.write(name, |out| plan.write_csv(out))?;
    }
    results.write("scene.toml", |out| out.write_all(toml.as_bytes()))?;
    Ok(report.with_files(&results.keep(&files)?))
}

/// What was learned of a word, and whether it helps.
fn learned(word: &str, rounds: &[Round], best: usize, helped: bool) -> String {
    let last = rounds.len().saturating_sub(1);
    if best == 0 {
        return format!(
            "nothing: none of the rounds ({last}) is better than the design, which is kept; try more \
             repeats, less gain, or another controller"
        );
    }
    let [before, after] = [0, best].map(|number| rounds[number].legibility);
    let doubt = if helped {
        "significantly better than the design (95 %)"
    } else {
        "not significantly better than the design (95 %): try more repeats"
    };
    format!("{word} in round {best}: P(read) {before:.3} to {after:.3}, {doubt}")
}

fn rounds_table(rounds: &[Round]) -> String {
    let units = rounds.first().map(|_| "\t\t\t\tmm\tmm\ts".to_owned());
    let row = |(number, round): (usize, &Round)| {
        let [share, interval] = share(&round.legible);
        let [contour, rmse] = [round.contour_m, round.rmse_m].map(|m| 1e3 * m);
        let note = match (number, round.kept, round.significant) {
            (0, ..) => "  the design",
            (_, true, true) => "",
            (_, true, false) => "  not significantly better",
            (_, false, _) => "  not better",
        };
        format!(
            "{number}\t{:.3}\t{share}\t{interval}\t{contour:.1}\t{rmse:.1}\t{:.2}\t{note}",
            round.legibility, round.lag_s
        )
    };
    table(
        "round>5|P(read)>10|legible>9|interval>12|contour>10|rmse>10|lag>9|<0",
        units.into_iter().chain(rounds.iter().enumerate().map(row)),
    )
}

/// Mean and largest distance between the setpoints of two plans while they write, m.
fn moves_m(sent: &Plan, corrected: &Plan) -> [f64; 2] {
    let rows = (0..sent.setpoints.len()).filter(|row| sent.setpoints[*row].letter.is_some());
    let moves: Vec<f64> =
        rows.map(|row| (corrected.sent_m(row) - sent.sent_m(row)).norm()).collect();
    let max_m = moves.iter().copied().fold(0.0, f64::max);
    [moves.iter().sum::<f64>() / moves.len().max(1) as f64, max_m]
}

/// The plan that was sent, and that corrected from flights that were flown elsewhere, by one drone.
fn from_logs(args: &LearnArgs, ready: &Prepared, options: &LearnOptions) -> Result<[Plan; 2]> {
    let sent = match (&args.sent, ready.plans().as_slice()) {
        (Some(path), _) => {
            let sent = Plan::read_csv(path)?;
            check_writes(&sent, ready, &path.display().to_string())?;
            sent
        }
        (None, [plan]) => plan.clone(),
        (None, plans) => {
            let hint = "learn the plans of several drones one by one: name the one that was sent";
            return Err(Error::input("sent", plans.len(), "one plan", hint));
        }
    };
    let flown = args.flights.read_all(&args.flight, Some(ready.scene()))?;
    let aligned = flown
        .into_iter()
        .zip(&args.flight)
        .map(|(flight, path)| align(flight, &sent, ready, &path.display().to_string()));
    let flights: Vec<Flight> = aligned.collect::<Result<_>>()?;
    if flights.len() == 1 {
        warn(["one flight does not show which errors repeat; fly the plan again if you can"]);
    }
    let corrected = correct(&sent, ready.scene(), &flights, options)?;
    Ok([sent, corrected])
}
