//! `noctograph tune` tunes gains, observer and speed of a scene for legible words.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::{Duration, Instant};

use super::outcome::{Report, without_folders};
use super::output::OutputFolder;
use super::progress::Progress;
use super::studies::{StudyFlags, counter, open_results, open_store, ranking_report};
use super::terminal::warn;
use crate::error::{Error, Result};
use crate::letters::LetterOptions;
use crate::report::pareto;
use crate::scene::Scene;
use crate::shoot::Stop;
use crate::studies::{
    Candidate, Conditions, Knob, Ranking, Store, Study, TuneOptions, Tuned, candidates_csv, tune,
};
use clap::Args;
use serde_json::json;

/// Limit on the number of flights if the budget is a time. It is never reached, because the flights
/// would take days.
const UNLIMITED_FLIGHTS: usize = 10_000_000;
/// Default number of seeds of each training word.
const TRAINING_SEEDS: u32 = 6;
/// Number of seconds in a minute.
const S_PER_MIN: f64 = 60.0;
/// Names of the files that are written once the best scene is found.
const FILES: [&str; 3] = ["scene.toml", "candidates.csv", "pareto.svg"];

#[derive(Debug, Args)]
#[command(
    after_help = "The tuned scene is OUTPUT/scene.toml, which preview and rank accept. Knobs are \
                  keys of the scene with a range, a range of factors, or a choice:\n  --knob \
                  plan.stroke_speed_m_s=0.1..0.4\n  --knob 'controller.lqr.q[2]*=0.1..10'\n  --knob \
                  'controller.kind=lqr|lqr-integral'"
)]
pub(super) struct TuneArgs {
    /// Scene to start from, as for rank
    #[arg(default_value = "cf21")]
    scene: String,
    #[command(flatten)]
    study: StudyFlags,
    /// Budget: a number of flights, or minutes such as 5min
    #[arg(long, value_name = "N", default_value = "2000")]
    budget: String,
    /// Scene key to tune (may be repeated) [default: the usual keys of its controller]
    #[arg(long, value_name = "KEY=...")]
    knob: Vec<String>,
    /// Maximum duration of a flight, in seconds [default: that of the scene]
    #[arg(long, value_name = "S")]
    longest: Option<f64>,
    /// Cap height in meters, with which the other lengths of the letters are scaled
    #[arg(long, value_name = "M")]
    cap_height: Option<f64>,
    /// Words for testing the result, which are not used for training
    #[arg(
        long,
        value_name = "WORD,...",
        value_delimiter = ',',
        default_value = "LOG,WAX,HELLO,QUIZ,SKY"
    )]
    test_words: Vec<String>,
    /// Number of seeds of each test word. Training words are tested with four times as many new
    /// seeds, at least six. This test determines whether the tuned or the original scene is written
    #[arg(long, value_name = "N", default_value_t = 10)]
    test_seeds: u32,
    /// Folder for scene.toml, candidates.csv, pareto.svg and flights.jsonl
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-tune")]
    output: PathBuf,
}

/// Limit of a search.
#[derive(Clone, Copy)]
enum Budget {
    /// Number of flights.
    Flights(usize),
    /// Time on the clock.
    Time(Duration),
}

impl FromStr for Budget {
    type Err = Error;

    /// Parses a number of flights, or a number of minutes such as `5min`.
    fn from_str(text: &str) -> Result<Self> {
        let budget = match text.strip_suffix("min") {
            Some(minutes) => {
                let minutes = minutes.trim().parse::<f64>().ok();
                let time = minutes.and_then(|n| Duration::try_from_secs_f64(S_PER_MIN * n).ok());
                time.map(Self::Time)
            }
            None => text.parse().ok().map(Self::Flights),
        };
        let wanted = "a number of flights, or minutes such as 5min";
        budget.ok_or_else(|| Error::input("budget", text, wanted, "for example 2000, or 5min"))
    }
}

/// Runs the verb `tune`, which searches for settings with which a scene's words are read more
/// often, tests them with new seeds and words, and writes the best scene.
pub(super) fn run(args: &TuneArgs) -> Result<Report> {
    let budget: Budget = args.budget.parse()?;
    let conditions = args.study.conditions()?;
    let mut base = args.study.scene(&args.scene, &conditions)?.scene;
    if let Some(cap_height_m) = args.cap_height {
        let scaled = base.letters.scaled(cap_height_m / base.letters.cap_height_m);
        base.letters = LetterOptions { cap_height_m, ..scaled };
    }
    let options = options(args, &base, budget, conditions)?;
    let store = open_store(&args.output)?;
    let results = open_results(&args.output, &FILES)?;
    let mut progress = Progress::new("tuning");
    let (start, mut is_first) = (Instant::now(), true);
    let mut watch = |n_flights: usize, best: &Candidate| {
        let spent = match budget {
            Budget::Flights(flights) => n_flights as f64 / flights as f64,
            Budget::Time(time) => start.elapsed().as_secs_f64() / time.as_secs_f64(),
        };
        // The first flights show how long the smallest study would take.
        if matches!(budget, Budget::Time(_)) && std::mem::take(&mut is_first) {
            warn_if_short(&args.budget, spent / n_flights as f64, options.least_budget());
        }
        progress.update(spent);
        progress.note(format!("{n_flights} flights, best P {:.3}", best.legibility));
        // A budget of flights is limited by the search itself.
        matches!(budget, Budget::Flights(_)) || spent < 1.0
    };
    let tuned = tune(&base, &options, Some(&store), &Stop::default(), &mut watch)?;
    drop(progress);
    let paths = write(args, &tuned, &options, results)?;
    let others = other_words(args, &options, &base, &tuned, &store)?;
    Ok(tuning_report(&options, &tuned, others.as_ref()).with_files(&paths))
}

/// Returns the options of the search from a scene. Returns [`Error::Input`] for a duration of
/// flights out of range, unknown knobs, and too small a budget.
fn options(
    args: &TuneArgs,
    base: &Scene,
    budget: Budget,
    conditions: Conditions,
) -> Result<TuneOptions> {
    if let Some(longest_s) = args.longest {
        crate::error::within("longest", longest_s, 1.0, 3600.0)?;
    }
    let options = TuneOptions {
        knobs: match args.knob.as_slice() {
            [] => Knob::usual(base),
            knobs => knobs.iter().map(|knob| knob.parse()).collect::<Result<_>>()?,
        },
        words: args.study.words(TRAINING_SEEDS)?,
        budget: match budget {
            Budget::Flights(flights) => flights,
            Budget::Time(_) => UNLIMITED_FLIGHTS,
        },
        longest_s: args.longest,
        // The best candidate on the training seeds must also win on new seeds, of which there are
        // four times as many as for each test word.
        test_seeds: 4 * args.test_seeds,
        conditions,
        seed: args.study.seed,
    };
    options.check()?;
    Ok(options)
}

/// Warns if a budget in minutes is too short for the smallest study of `least_flights`. A flight
/// takes the fraction `flight_frac` of the budget.
fn warn_if_short(budget: &str, flight_frac: f64, least_flights: usize) {
    let needed = flight_frac * least_flights as f64;
    if needed > 1.0 {
        warn([format!(
            "{budget} is too short: the minimum of {least_flights} flights takes about \
             {needed:.1} times as long"
        )]);
    }
}

/// Writes the tuned scene with the files that it names, the table of candidates, and the plot of
/// the Pareto front. Returns the paths.
fn write(
    args: &TuneArgs,
    tuned: &Tuned,
    options: &TuneOptions,
    mut results: OutputFolder,
) -> Result<Vec<PathBuf>> {
    let [scene, candidates, front] = FILES;
    let files = tuned.scene.in_folder(&args.output, "")?;
    for (name, bytes) in &files.copies {
        results.write(name, bytes)?;
    }
    results.write(scene, origin(args, tuned) + &files.toml)?;
    results.write(candidates, candidates_csv(tuned, &options.knobs))?;
    results.write(front, plot(tuned))?;
    results.keep()
}

/// Returns comment lines that describe the tuned scene's origin, for the top of its file.
fn origin(args: &TuneArgs, tuned: &Tuned) -> String {
    let what = if tuned.helped() { "Tuned from" } else { "No improvement found on" };
    format!(
        "# {what} `{}` by noctograph {}: {} candidates in {} flights, seed {}.\n# In the finals, \
         P(read) was {:.3} for the best candidate and {:.3} for the original scene.\n",
        without_folders(&args.scene),
        env!("CARGO_PKG_VERSION"),
        tuned.candidates.len(),
        tuned.n_flights,
        args.study.seed,
        tuned.best.legibility,
        tuned.before.legibility
    )
}

/// Returns the plot (SVG) of all candidates by flight time and legibility, in which candidates that
/// were abandoned or exceed a limit are drawn differently. A candidate that lost every drone has no
/// flight time, and is plotted at 0 s.
fn plot(tuned: &Tuned) -> String {
    fn point(c: &Candidate) -> (f64, f64) {
        (c.duration_s.unwrap_or(0.0), c.legibility)
    }
    let (start, candidates) = tuned.candidates.split_first().expect("the original scene is one");
    let (valid, others): (Vec<_>, Vec<_>) =
        candidates.iter().partition(|c| !c.given_up && c.broken == 0.0);
    let [valid, others] =
        [valid, others].map(|some| some.into_iter().map(point).collect::<Vec<_>>());
    let front: Vec<_> = tuned.front.iter().map(|n| point(&tuned.candidates[*n])).collect();
    pareto(&valid, &others, &front, Some(point(start)))
}

/// Reports the Pareto front of flight time and P(read), the best candidate's changes, and the
/// results of its tests on new seeds and, in `others`, on new words.
pub fn tuning_report(
    options: &TuneOptions,
    tuned: &Tuned,
    others: Option<&(Study, Ranking)>,
) -> Report {
    let front: Vec<_> = tuned.front.iter().map(|index| &tuned.candidates[*index]).collect();
    let product = json!({
        "flights": tuned.n_flights, "candidates": tuned.candidates.len(), "front": front,
        "helped": tuned.helped(), "best": tuned.best, "before": tuned.before,
    });
    // The changes are listed only if the best candidate won the test against the original scene.
    let changes = options.knobs.iter().flat_map(|knob| &knob.keys).map(|key| {
        let [before, after] = [&tuned.before, &tuned.best].map(|c| shown(&c.settings[key]));
        json!({ "key": key, "before": before, "after": after })
    });
    let changes: Vec<_> = changes.filter(|_| tuned.helped()).collect();
    let words = json!({
        "given_up": tuned.candidates.iter().filter(|c| c.given_up).count(), "changes": changes,
        "best": tuned.test.is_none().then_some("nothing found"),
        "kept": (tuned.test.is_some() && !tuned.helped()).then_some("the original scene"),
    });
    let mut report = Report::with_words(product, &words, LAYOUT);
    // The tests use new seeds and new words, because the results on the training seeds are biased
    // toward the best candidate.
    let mut tests = Vec::new();
    for (new, test) in [("seeds", tuned.test.as_ref()), ("words and seeds", others)] {
        let Some((study, ranking)) = test else { continue };
        let Report { text, json, .. } = ranking_report(study, ranking, study.n_trials());
        report.text += &format!("\ntested on new {new}: {text}");
        tests.push(json!({ "new": new, "measures": json["measures"], "pairs": json["pairs"] }));
    }
    report.value("tests", tests);
    report
}

const LAYOUT: &str = "\
evaluated {candidates} candidates ({given_up} abandoned early) in {flights} flights

Pareto front of flight time and P(read):
|front|s>7|P(read)>10|legible/%>9|interval/%>12
{duration_s:.1}|{legibility:.3}|{legible.value*100:.1}|{legible.low*100:.0} to {legible.high*100:.0}

best      {best}: no candidate did better in the finals than the original scene, which scene.toml contains; try a larger budget, other knobs, or wider ranges
best      not better on new seeds: scene.toml holds {kept}; try a larger budget, other knobs, or wider ranges
|changes|best candidate<44|before>16|after>16
  {key}|{before}|{after}

";

/// Returns the value of a scene key as text, with numbers rounded to three decimals, or five below
/// 1. Numbers below 0.001 or from 100,000 have an exponent.
fn shown(value: &toml::Value) -> String {
    match value.as_float() {
        Some(number) if number != 0.0 && !(1e-3..1e5).contains(&number.abs()) => {
            format!("{number:.3e}")
        }
        Some(number) if number.abs() < 1.0 => format!("{number:.5}"),
        Some(number) => format!("{number:.3}"),
        None => value.as_str().map_or_else(|| value.to_string(), str::to_owned),
    }
}

/// Tests the tuned scene against the original one on the test words, except for those that it was
/// trained on. Returns `None` if no word or no seed is left, or if the search found nothing better.
fn other_words(
    args: &TuneArgs,
    options: &TuneOptions,
    base: &Scene,
    tuned: &Tuned,
    store: &Store,
) -> Result<Option<(Study, Ranking)>> {
    let words =
        args.test_words.iter().filter(|word| options.words.iter().all(|(known, _)| known != *word));
    let words: Vec<_> = words.map(|word| (word.clone(), args.test_seeds)).collect();
    if !tuned.helped() || words.is_empty() || args.test_seeds == 0 {
        return Ok(None);
    }
    // Each seed of each word is flown with both scenes.
    let bar = counter("testing", 2 * words.len() * args.test_seeds as usize);
    let stop = Stop::default();
    options.test([base, &tuned.scene], words, Some(store), &stop, &bar).map(Some)
}
