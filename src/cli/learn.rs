//! `noctograph learn`: the next reference and light schedule, from what earlier flights missed.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::inputs::read_flight;
use super::outputs::Output;
use super::studies::on_threads;
use super::{Outcome, print, tell};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::flight::comparison::{ComparisonOptions, compare};
use crate::plan::{Plan, relight};
use crate::study::{Conditions, Contender, LearnOptions, Prepared, Round, Store, correct, learn};

#[derive(Debug, Args)]
#[command(after_help = "The folder holds scene.toml and plan-WORD.csv: `noctograph rank FOLDER` \
                        flies it, `noctograph fly FOLDER/plan-WORD.csv` too. After a real flight: \
                        noctograph learn my.toml WORD --from-log flight.json --sent \
                        FOLDER/plan-WORD.csv writes the plan for the next one.")]
pub(super) struct LearnArgs {
    /// Scene to fly, as for rank
    scene: String,
    /// Word to write
    word: String,
    /// Learn from these flights or logs of one plan, instead of simulated ones: one round
    #[arg(long, value_name = "LOG", num_args = 1..)]
    from_log: Vec<PathBuf>,
    /// Plan that was sent in those flights; the scene's own where it is left out
    #[arg(long, value_name = "FILE", requires = "from_log")]
    sent: Option<PathBuf>,
    /// Most rounds
    #[arg(long, value_name = "N", default_value_t = LearnOptions::default().rounds)]
    rounds: u32,
    /// Flights of a round, over which errors are averaged
    #[arg(long, value_name = "N", default_value_t = LearnOptions::default().flights)]
    flights: u32,
    /// Share of the error that a round takes off
    #[arg(long, value_name = "SHARE", default_value_t = LearnOptions::default().gain)]
    gain: f64,
    /// Smoothing of the error, in seconds: more keeps noise out, less follows corners
    #[arg(long, value_name = "S", default_value_t = LearnOptions::default().smooth_s)]
    smooth: f64,
    /// Seed of all seeds
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Threads; as many as the machine has where it is left out
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Folder for scene.toml, plan-WORD.csv and flights.jsonl
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-learn")]
    output: PathBuf,
}

pub(super) fn run(args: &LearnArgs) -> Result<Outcome> {
    crate::error::within("--gain", args.gain, 0.0, 1.0)?;
    crate::error::within("--smooth", args.smooth, 0.0, 10.0)?;
    crate::error::within("--flights", args.flights.into(), 1.0, 1e4)?;
    let contender = Contender::find(&args.scene)?;
    let ready = Prepared::new(&contender, &args.word, &Conditions::default())?;
    let options = LearnOptions {
        rounds: args.rounds,
        flights: args.flights,
        gain: args.gain,
        smooth_s: args.smooth,
        seed: args.seed,
    };
    let store = Store::open(&args.output)?;
    let scene_file = Output::create(&args.output.join("scene.toml"))?;
    let plan_file = Output::create(&args.output.join(format!("plan-{}.csv", ready.word())))?;
    let plan = if args.from_log.is_empty() {
        print(
            "round   P(read)   contour      rmse      lag\n                     mm        mm        s\n",
        )?;
        let mut number = 0;
        let mut watch = |round: &Round| {
            let Round { legibility: p, contour_m, rmse_m, lag_s, kept, .. } = *round;
            let kept = if kept { "" } else { "  no better beyond chance" };
            let [contour, rmse] = [contour_m, rmse_m].map(|m| 1e3 * m);
            let _ =
                print(&format!("{number:5}{p:10.3}{contour:10.1}{rmse:10.1}{lag_s:9.2}{kept}\n"));
            number += 1;
        };
        on_threads(args.threads, || learn(&ready, &options, Some(&store), &mut watch))??.plan
    } else {
        from_logs(args, &ready, &options)?
    };
    let toml = format!(
        "# Learned by noctograph {} for {}; send plan-{}.csv.\n{}",
        env!("CARGO_PKG_VERSION"),
        ready.word(),
        ready.word(),
        contender.scene.to_toml()
    );
    let paths = [
        scene_file.keep(|out| out.write_all(toml.as_bytes()))?,
        plan_file.keep(|out| plan.write_csv(out))?,
    ];
    let files = paths.map(|path| path.display().to_string()).join("\n          ");
    print(&format!("files     {files}\n"))?;
    Ok(Outcome::Done)
}

/// One round from flights that were flown elsewhere.
fn from_logs(args: &LearnArgs, ready: &Prepared, options: &LearnOptions) -> Result<Plan> {
    let sent = args.sent.as_deref().map_or(Ok(ready.sent().clone()), Plan::read_csv)?;
    let flights = args.from_log.iter().map(|path| on_the_plans_clock(path, ready, &sent));
    let flights = flights.collect::<Result<Vec<Flight>>>()?;
    if flights.len() == 1 {
        tell("warning: a single flight cannot tell what repeats; fly the plan again if you can");
    }
    correct(&sent, ready.scene(), &flights, options)
}

/// A flight with the clock, the letters and the design of the plan that it flew.
fn on_the_plans_clock(path: &Path, ready: &Prepared, sent: &Plan) -> Result<Flight> {
    let mut flight = read_flight(path)?;
    let place = || path.display().to_string();
    let hint = "name the plan that was sent with --sent, and the word that it wrote";
    if flight.samples.iter().all(|sample| sample.letter.is_none()) {
        let strokes = crate::letters::write(ready.word(), &ready.scene().letters)?;
        relight(&mut flight, &strokes)?;
    }
    let sending = ready.sending(sent.clone());
    // The log's design is what was sent; so must be that of the flight whose clock it is set by.
    let mut planned = crate::shoot::rehearse(ready.scene(), sent)?;
    let mut at = 0;
    for sample in &mut planned.samples {
        while sent.setpoints.get(at + 1).is_some_and(|s| s.time_s <= sample.time_s + 1e-6) {
            at += 1;
        }
        sample.design_m = sent.sent_m(at);
    }
    let offset_s = compare(&planned, &flight, &ComparisonOptions::default())?.offset_s;
    for sample in &mut flight.samples {
        sample.time_s += offset_s;
    }
    let apart_m = sending.redesign(&mut flight);
    if apart_m > 0.2 {
        let found = format!("setpoints {apart_m:.2} m from those of the plan");
        return Err(Error::input(place(), found, "a flight of this plan", hint));
    }
    Ok(flight)
}
