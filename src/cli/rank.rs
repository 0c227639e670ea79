//! `noctograph rank` ranks scenes by the probability that their words are read.

use std::path::{Path, PathBuf};

use super::outcome::Report;
use super::output::OutputFolder;
use super::studies::{
    GRADED, RANKING, StudyFlags, counter, open_results, open_store, ranking_report, write_ranking,
};
use super::terminal::{message, warn};
use crate::error::Result;
use crate::photo::encode_png;
use crate::report::acuity_sheet;
use crate::scene::{NamedScene, SceneTask};
use crate::shoot::Stop;
use crate::studies::{
    Acuity, Conditions, Shard, Store, Study, Trial, Unranked, acuity, evaluate, fly_ladder,
    least_flights, rank, shards, submissions,
};
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
#[command(after_help = "Every flight is immediately appended to OUTPUT/flights.jsonl. To \
                        continue an interrupted command, repeat it. The results are the same as \
                        without the interruption.\n\nSeveral machines with a shared folder can \
                        each fly a shard. The same command without --shard then ranks the \
                        flights of all shards. With GNU parallel:\n  seq 40 | parallel \
                        --sshlogin a,b noctograph rank team tuned \\\n    --words NOOR:9999 \
                        --threads 1 --parts parts --shard {}/40\n  noctograph rank team tuned \
                        --words NOOR:9999 --parts parts\nWith Slurm: sbatch --array=1-40 --wrap \
                        'noctograph ... --shard $SLURM_ARRAY_TASK_ID/40'\nWith Dask: \
                        examples/dask_rank.py")]
pub(super) struct RankArgs {
    /// Scenes: files, presets, team, pid, geometric, tuned, or folders (./tuned). With --task,
    /// these are submissions, as files or folders
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<String>,
    /// Scene of a task for grading, which is flown with those keys of each submission that --may
    /// allows. A submission that changes other keys is refused
    #[arg(long, value_name = "SCENE")]
    task: Option<String>,
    /// Key, or all keys of a table, that a submission may change (may be repeated). Keys that name
    /// files or select the true state are never allowed [default: controller.*,
    /// observer.luenberger.*, observer.ekf.*]
    #[arg(long, value_name = "KEY", requires = "task")]
    may: Vec<String>,
    #[command(flatten)]
    study: StudyFlags,
    /// Fly only one part of the flights, such as 3/20 for part 3 of 20, and do not rank. The part
    /// is written into the folder of --parts, unless it exists there
    #[arg(long, value_name = "I/N", requires = "parts")]
    shard: Option<String>,
    /// Folder of the shards, whose flights are not flown again
    #[arg(long, value_name = "DIR")]
    parts: Option<PathBuf>,
    /// Also find the smallest legible letters, with N more seeds of each word at each of seven cap
    /// heights, 4 to 32 % of the scene's, with a narrow lamp. The smallest height distinguishes
    /// controllers even above a P(read) of 0.96
    #[arg(long, value_name = "N", conflicts_with = "shard")]
    acuity: Option<u32>,
    /// Folder for flights.jsonl, flights.csv, ranking.csv, ranking.json and photos.png (with --task
    /// also marks.csv, with --acuity acuity.png)
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-rank")]
    output: PathBuf,
}

/// Default number of seeds per word of a task. With 100 seeds, thirty LQRs whose mean P(read) of
/// TEA ranges from 0.68 to 0.96 are divided into eight distinguishable ranks, but with 20 seeds
/// only into two.
const GRADED_SEEDS: u32 = 100;
/// Default number of seeds per word without a task.
const RANKED_SEEDS: u32 = 50;

/// Runs the verb `rank`, which flies scenes or submissions in the same conditions, and ranks them.
/// With `--shard`, only a part of the flights is flown and stored. The report passes if no
/// submission is refused.
pub(super) fn run(args: &RankArgs) -> Result<Report> {
    let shard = args.shard.as_deref().map(str::parse::<Shard>).transpose()?;
    let conditions = args.study.conditions()?;
    let (contenders, unranked) = args.contenders(&conditions)?;
    let usual = if args.task.is_some() { GRADED_SEEDS } else { RANKED_SEEDS };
    let (words, seed) = (args.study.words(usual)?, args.study.seed);
    let study = Study { contenders, words, conditions, seed };
    // If all submissions were refused, there are no contenders, and the ranking only lists them.
    if unranked.is_empty() || !study.contenders.is_empty() {
        study.check()?;
    }
    if args.task.is_some() {
        announce(&study, unranked.len());
    }
    if let (Some(shard), Some(parts)) = (shard, &args.parts) {
        return fly_shard(&study, shard, parts);
    }
    // Without `--shard`, all flights that are missing from shards and earlier runs are flown, and
    // the scenes are ranked.
    let ready = study.prepare()?;
    let parts = args.parts.as_deref().map(|folder| shards(&study, &ready, folder)).transpose()?;
    let mut store = open_store(&args.output)?;
    parts.iter().flatten().try_for_each(|path| store.take(path))?;
    let ladder = args.ladder(&study)?;
    let tables = if args.task.is_some() { &GRADED[..] } else { &RANKING };
    let chart = (!ladder.is_empty()).then_some(ACUITY);
    let files: Vec<&str> = tables.iter().copied().chain(chart).collect();
    let mut results = open_results(&args.output, &files)?;
    let trials: Vec<Trial> = study.trials().collect();
    let bar = counter("flying", trials.len());
    let records = evaluate(&study, &ready, &trials, Some(&store), &Stop::default(), &bar)?;
    drop(bar);
    let mut ranking = rank(&study, &records);
    ranking.unranked = unranked;
    if !ladder.is_empty() {
        ranking.acuity = Some(measured_acuity(&ladder, &store, &mut results)?);
    }
    let files = write_ranking(results, args.task.is_some(), &study, &ready, &ranking, &records)?;
    let report = ranking_report(&study, &ranking, records.len()).with_files(&files);
    Ok(report.passes(ranking.unranked.is_empty()))
}

/// Flies a shard of a study, and writes the flights to the folder `parts`.
fn fly_shard(study: &Study, shard: Shard, parts: &Path) -> Result<Report> {
    let bar = counter("flying", study.n_trials().div_ceil(shard.count));
    let (path, flights) = shard.fly(study, parts, &bar)?;
    let report = Report::with_layout(json!({ "flights": flights }), "flights   {flights}");
    Ok(report.with_files(&[path]))
}

/// Prints a note on how often each submission flies, and how many flights are needed to distinguish
/// two submissions.
fn announce(study: &Study, n_refused: usize) {
    let n = study.contenders.len();
    let (each, least) = (study.n_trials() / n.max(1), least_flights(n));
    let submissions_fly = if n == 1 { "submission flies" } else { "submissions fly" };
    let are = if n_refused == 1 { "is" } else { "are" };
    message(
        "note: ",
        &format!(
            "{n} {submissions_fly} {each} times each; at least {least} are needed to distinguish \
             two; {n_refused} {are} refused"
        ),
    );
}

/// Flies the studies of a ladder of letter heights, and writes the chart of their photos. Returns
/// the smallest legible height of each scene.
fn measured_acuity(ladder: &[Study], store: &Store, results: &mut OutputFolder) -> Result<Acuity> {
    let ready = ladder.iter().map(Study::prepare).collect::<Result<Vec<_>>>()?;
    let bar = counter("flying smaller", ladder.iter().map(Study::n_trials).sum());
    let records = fly_ladder(ladder, &ready, Some(store), &bar)?;
    drop(bar);
    let limits = acuity(ladder, &records);
    let chart = acuity_sheet(ladder, &ready, &limits, &records)?;
    results.write(ACUITY, encode_png(&chart, None, &[]))?;
    Ok(limits)
}

/// Name of the chart of photographs with decreasing letter heights.
const ACUITY: &str = "acuity.png";

impl RankArgs {
    /// Returns the study on each rung of the ladder of letter heights that `--acuity` asks for, or
    /// none without it.
    fn ladder(&self, study: &Study) -> Result<Vec<Study>> {
        let n_seeds = self.acuity.filter(|_| !study.contenders.is_empty());
        n_seeds.map_or_else(|| Ok(Vec::new()), |n_seeds| study.ladder(n_seeds))
    }

    /// Returns the accepted scenes or submissions, and the refused submissions. Warns of files that
    /// are no submissions.
    fn contenders(&self, conditions: &Conditions) -> Result<(Vec<NamedScene>, Vec<Unranked>)> {
        let scene = |named: &String| self.study.scene(named, conditions);
        let Some(task) = &self.task else {
            return Ok((self.scenes.iter().map(scene).collect::<Result<_>>()?, Vec::new()));
        };
        let mut task = scene(task)?.scene;
        task.settle_files()?;
        // The task is read completely before any submission is examined.
        let read = submissions(&SceneTask::new(task, &self.may)?, &self.scenes)?;
        warn(read.passed_over);
        Ok((read.scenes, read.refused))
    }
}
