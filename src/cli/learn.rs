//! `noctograph learn`: the next reference and light schedule, from what earlier flights missed.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::inputs::read_flight;
use super::outputs::Output;
use super::studies::on_threads;
use super::{Outcome, print, tell};
use crate::error::{Error, Result};
use crate::plan::Plan;
use crate::scene::{NamedScene, Scene};
use crate::study::{Conditions, LearnOptions, Prepared, Round, Store, align, correct, learn};

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
    let contender = Scene::find(&args.scene, &[])?;
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
    let n_plans = if args.from_log.is_empty() { ready.plans().len() } else { 1 };
    let names = (0..n_plans).map(|drone| NamedScene::plan_file(ready.word(), drone, n_plans));
    let names: Vec<String> = names.collect();
    let plan_files = names.iter().map(|name| Output::create(&args.output.join(name)));
    let plan_files = plan_files.collect::<Result<Vec<_>>>()?;
    let plans = if args.from_log.is_empty() {
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
        on_threads(args.threads, || learn(&ready, &options, Some(&store), &mut watch))??.plans
    } else {
        from_logs(args, &ready, &options)?
    };
    let toml = format!(
        "# Learned by noctograph {} for {}; send {}.\n{}",
        env!("CARGO_PKG_VERSION"),
        ready.word(),
        names.join(", "),
        contender.scene.to_toml()
    );
    let mut paths = vec![scene_file.keep(|out| out.write_all(toml.as_bytes()))?];
    for (file, plan) in plan_files.into_iter().zip(&plans) {
        paths.push(file.keep(|out| plan.write_csv(out))?);
    }
    let paths: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let files = paths.join("\n          ");
    print(&format!("files     {files}\n"))?;
    Ok(Outcome::Done)
}

/// One round from flights that were flown elsewhere, by one drone.
fn from_logs(args: &LearnArgs, ready: &Prepared, options: &LearnOptions) -> Result<Vec<Plan>> {
    let sent = match (&args.sent, ready.plans().as_slice()) {
        (Some(path), _) => Plan::read_csv(path)?,
        (None, [plan]) => plan.clone(),
        (None, plans) => {
            let hint = "learn the plans of several drones one by one: name the one that was sent";
            return Err(Error::input("plan.drones", plans.len(), "one drone", hint));
        }
    };
    let flights = args
        .from_log
        .iter()
        .map(|path| align(read_flight(path)?, &sent, ready, &path.display().to_string()));
    let flights = flights.collect::<Result<Vec<_>>>()?;
    if flights.len() == 1 {
        tell("warning: a single flight cannot tell what repeats; fly the plan again if you can");
    }
    Ok(vec![correct(&sent, ready.scene(), &flights, options)?])
}
