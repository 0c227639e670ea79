//! `noctograph tune`: turns a scene's knobs until its words read as surely as they can.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;

use super::outputs::Output;
use super::progress::Progress;
use super::studies::{StudyFlags, counter, ranking_table};
use super::{Outcome, print, tell};
use crate::error::{Error, Result};
use crate::report::pareto;
use crate::scene::Scene;
use crate::study::{
    Candidate, Contender, Knob, Limits, SearchKind, Store, Study, TuneOptions, Tuned, evaluate,
    rank, tune,
};

#[derive(Debug, Args)]
#[command(
    after_help = "A budget is a number of flights, or minutes: --budget 2000, --budget 5min. \
                        The tuned scene is OUTPUT/scene.toml, which preview and rank take. Knobs \
                        are keys of the scene: --knob plan.stroke_speed_m_s=0.1..0.4, --knob \
                        'controller.q[2]*=0.1..10', --knob 'controller.kind=lqr|lqr-integral'; \
                        without any, the usual ones for its controller are turned."
)]
pub(super) struct TuneArgs {
    /// Scene to begin from, as for rank
    #[arg(default_value = "team")]
    scene: String,
    #[command(flatten)]
    study: StudyFlags,
    /// Flights, or minutes
    #[arg(long, value_name = "N", default_value = "2000")]
    budget: String,
    /// Who proposes: tpe (tree-structured Parzen estimation), random or grid
    #[arg(long, value_name = "NAME", default_value = "tpe")]
    search: SearchName,
    /// Something to turn, instead of the usual
    #[arg(long, value_name = "KEY=...")]
    knob: Vec<String>,
    /// Longest flight, in seconds; that of the scene as it is where it is left out
    #[arg(long, value_name = "S")]
    longest: Option<f64>,
    /// Height of capitals in m, where not the scene's: smaller letters ask for more
    #[arg(long, value_name = "M")]
    cap_height: Option<f64>,
    /// Words that the result is tested on and has never seen
    #[arg(
        long,
        value_name = "WORD,...",
        value_delimiter = ',',
        default_value = "LOG,WAX,HELLO,QUIZ,SKY"
    )]
    test_words: Vec<String>,
    /// Seeds of each test word, and four times as many of the training words
    #[arg(long, value_name = "N", default_value_t = 10)]
    test_seeds: u32,
    /// Folder for scene.toml, candidates.csv, pareto.svg and flights.jsonl
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-tune")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum SearchName {
    Tpe,
    Random,
    Grid,
}

impl From<SearchName> for SearchKind {
    fn from(name: SearchName) -> Self {
        match name {
            SearchName::Tpe => Self::Tpe,
            SearchName::Random => Self::Random,
            SearchName::Grid => Self::Grid,
        }
    }
}

/// What may be spent.
struct Budget {
    flights: usize,
    time: Option<Duration>,
}

impl std::str::FromStr for Budget {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wanted = "a number of flights, or minutes such as 5min";
        let broken = || Error::input("--budget", text, wanted, "for example --budget 2000");
        if let Some(minutes) = text.strip_suffix("min") {
            let minutes: f64 = minutes.trim().parse().map_err(|_not_a_number| broken())?;
            let time = Duration::try_from_secs_f64(60.0 * minutes);
            let time = time.map_err(|_negative| broken())?;
            return Ok(Self { flights: 10_000_000, time: Some(time) });
        }
        let flights = text.parse().map_err(|_not_a_number| broken())?;
        Ok(Self { flights, time: None })
    }
}

pub(super) fn run(args: &TuneArgs) -> Result<Outcome> {
    let budget: Budget = args.budget.parse()?;
    let mut base = Contender::find(&args.scene)?;
    if let Some(cap_height_m) = args.cap_height {
        scale_letters(&mut base.scene, cap_height_m)?;
    }
    let knobs = match args.knob.as_slice() {
        [] => Knob::usual(&base.scene),
        knobs => knobs.iter().map(|knob| knob.parse()).collect::<Result<_>>()?,
    };
    let options = TuneOptions {
        knobs,
        search: args.search.into(),
        words: args.study.words(6)?,
        budget: budget.flights,
        limits: Limits { duration_s: args.longest, ..Limits::default() },
        conditions: args.study.conditions()?,
        seed: args.study.seed,
    };
    let store = Store::open(&args.output)?;
    let files = ["scene.toml", "candidates.csv", "pareto.svg"];
    let [scene_file, candidates_file, pareto_file] =
        files.map(|name| Output::create(&args.output.join(name)));
    let (scene_file, candidates_file, pareto_file) = (scene_file?, candidates_file?, pareto_file?);
    if store.n_known() > 0 {
        tell(&format!("{}: {} flights are there already", args.output.display(), store.n_known()));
    }

    let (mut progress, start) = (Progress::new("tuning"), Instant::now());
    let mut watch = |n_flights: usize, best: &Candidate| {
        let spent = budget.time.map(|time| start.elapsed().as_secs_f64() / time.as_secs_f64());
        #[expect(clippy::cast_precision_loss, reason = "counts of flights")]
        let spent = spent.unwrap_or(n_flights as f64 / budget.flights as f64);
        progress.update(spent);
        progress.note(format!("{n_flights} flights, best P {:.3}", best.legibility));
        budget.time.is_none() || spent < 1.0
    };
    let tuned =
        args.study.on_threads(|| tune(&base.scene, &options, Some(&store), &mut watch))??;
    drop(progress);

    let paths = [
        scene_file.keep(|out| write!(out, "{}{}", origin(args, &tuned), tuned.scene.to_toml()))?,
        candidates_file.keep(|out| write_candidates(out, &options, &tuned))?,
        pareto_file.keep(|out| out.write_all(plot(&tuned).as_bytes()))?,
    ];
    print(&report(&options, &tuned))?;
    test(args, &options, &base, &tuned, &store)?;
    let shown = paths.map(|path| path.display().to_string()).join("\n          ");
    print(&format!("\nfiles     {shown}\n"))?;
    Ok(Outcome::Done)
}

/// Makes letters another size, and all lengths of the layout with them.
fn scale_letters(scene: &mut Scene, cap_height_m: f64) -> Result<()> {
    let letters = &mut scene.letters;
    let factor = cap_height_m / letters.cap_height_m;
    letters.cap_height_m = cap_height_m;
    letters.width_m *= factor;
    letters.gap_m *= factor;
    scene.check()
}

/// Where a tuned scene comes from, as the head of its file.
fn origin(args: &TuneArgs, tuned: &Tuned) -> String {
    format!(
        "# Tuned by noctograph {} from `{}`: the best of {} candidates in {} flights, seed {}.\n# \
         In the finals it was read with probability {:.3}.\n",
        env!("CARGO_PKG_VERSION"),
        args.scene,
        tuned.candidates.len(),
        tuned.n_flights,
        args.study.seed,
        tuned.best.legibility
    )
}

fn write_candidates(out: impl Write, options: &TuneOptions, tuned: &Tuned) -> std::io::Result<()> {
    let mut out = csv::Writer::from_writer(out);
    let mut header = [
        "number",
        "flights",
        "given_up",
        "merit",
        "legibility",
        "duration_s",
        "broken",
        "on_front",
    ]
    .map(str::to_owned)
    .to_vec();
    header.extend(options.knobs.iter().map(|knob| knob.keys.join("+")));
    out.write_record(header)?;
    for c in &tuned.candidates {
        let mut row = vec![
            c.number.to_string(),
            c.n_flights.to_string(),
            c.given_up.to_string(),
            c.merit.to_string(),
            c.legibility.to_string(),
            c.duration_s.map_or(String::new(), |s| s.to_string()),
            c.broken.to_string(),
            tuned.front.contains(&c.number).to_string(),
        ];
        let settings = (0..options.knobs.len()).map(|index| c.point.get(index));
        row.extend(settings.map(|at| at.map_or(String::new(), f64::to_string)));
        out.write_record(row)?;
    }
    out.flush()
}

fn plot(tuned: &Tuned) -> String {
    let at = |c: &Candidate| c.duration_s.map(|s| (s, c.legibility));
    let sound = |c: &&Candidate| !c.given_up && c.broken == 0.0;
    let all: Vec<_> = tuned.candidates.iter().filter(sound).filter_map(at).collect();
    let front: Vec<_> = tuned.front.iter().filter_map(|n| at(&tuned.candidates[*n])).collect();
    pareto(&all, &front, at(&tuned.candidates[0]))
}

fn report(options: &TuneOptions, tuned: &Tuned) -> String {
    let given_up = tuned.candidates.iter().filter(|c| c.given_up).count();
    let mut text = format!(
        "tuned     {} candidates ({given_up} given up halfway), {} flights\n\nflight time against \
         legibility, what no candidate beats in both:\n      s   P(read)\n",
        tuned.candidates.len(),
        tuned.n_flights
    );
    for number in &tuned.front {
        let c = &tuned.candidates[*number];
        text += &format!("{:7.1}{:10.3}\n", c.duration_s.unwrap_or_default(), c.legibility);
    }
    text += "\nsetting of the winner, 0 to 1 within its range:\n";
    for (knob, at) in options.knobs.iter().zip(&tuned.best.point) {
        text += &format!("  {at:4.2}  {}\n", knob.keys.join(" "));
    }
    text
}

/// Holds the result against the scene as it was, on seeds and on words that it has not seen.
fn test(
    args: &TuneArgs,
    options: &TuneOptions,
    base: &Contender,
    tuned: &Tuned,
    store: &Store,
) -> Result<()> {
    let seen = |word: &str| options.words.iter().any(|(known, _)| known == word);
    let others = args.test_words.iter().cloned();
    let others: Vec<_> =
        others.filter(|word| !seen(word)).map(|word| (word, args.test_seeds)).collect();
    let again = options.words.iter().map(|(word, _)| (word.clone(), 4 * args.test_seeds)).collect();
    for (what, words) in [("seeds", again), ("words and seeds", others)] {
        if words.is_empty() || args.test_seeds == 0 {
            continue;
        }
        let study = Study {
            contenders: vec![base.clone(), Contender::new("tuned", tuned.scene.clone())],
            words,
            conditions: options.conditions.clone(),
            // Neither the search's seeds nor the finals'.
            seed: options.seed ^ 0x5eed_0000_0000_0000,
        };
        let trials: Vec<_> = study.trials().collect();
        let bar = counter("testing", trials.len());
        let run = || evaluate(&study, &trials, Some(store), &bar);
        let records = args.study.on_threads(run)??;
        let ranking = rank(&study, &records);
        print(&format!("\ntested on {what} never seen: {}", ranking_table(&study, &ranking)))?;
    }
    Ok(())
}
