//! `noctograph rank`: scenes in the order of the probability that their words are read.

use std::path::PathBuf;

use super::studies::{
    RANKING, StudyFlags, counter, open_results, open_store, ranking_report, write_ranking,
};
use super::{Args, Report, Result, json};
use crate::shoot::Stop;
use crate::studies::{Record, Shard, Study, Trial, evaluate, rank, shards};

#[derive(Debug, Args)]
#[command(after_help = "Every flight is added to OUTPUT/flights.jsonl at once. An interrupted \
                        command continues when it is repeated, and comes to the same numbers.\n\n\
                        On many machines, with a folder that all of them see: each flies a shard, \
                        and the same command without --shard ranks them. With GNU parallel:\n  seq \
                        40 | parallel --sshlogin a,b noctograph rank team tuned \\\n    --words \
                        NOOR:9999 --threads 1 --parts parts --shard {}/40\n  noctograph rank team \
                        tuned --words NOOR:9999 --parts parts\nWith Slurm: sbatch --array=1-40 \
                        --wrap 'noctograph ... --shard $SLURM_ARRAY_TASK_ID/40'\nWith Dask: \
                        examples/dask_rank.py")]
pub(super) struct RankArgs {
    /// Scenes: files, presets, team, pid, geometric, tuned, or folders (./tuned)
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<String>,
    #[command(flatten)]
    study: StudyFlags,
    /// Fly one part of the flights into the folder of --parts, unless it is there already, and rank
    /// nothing: part 3 of 20 is 3/20
    #[arg(long, value_name = "I/N", requires = "parts")]
    shard: Option<String>,
    /// Folder of shards, whose flights are not flown again
    #[arg(long, value_name = "DIR")]
    parts: Option<PathBuf>,
    /// Folder for flights.jsonl, flights.csv, ranking.csv, ranking.json and photos.png
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-rank")]
    output: PathBuf,
}

pub(super) fn run(args: &RankArgs) -> Result<Report> {
    let shard = args.shard.as_deref().map(str::parse::<Shard>).transpose()?;
    let conditions = args.study.conditions()?;
    let contenders = args.scenes.iter().map(|named| args.study.scene(named, &conditions));
    let contenders = contenders.collect::<Result<_>>()?;
    let (words, seed) = (args.study.words(50)?, args.study.seed);
    let study = Study { contenders, words, conditions, seed };
    study.check()?;
    if let (Some(shard), Some(parts)) = (shard, &args.parts) {
        let bar = counter("flying", study.n_trials().div_ceil(shard.count));
        let (path, flights) = shard.fly(&study, parts, &bar)?;
        let report = Report::of(json!({ "flights": flights }), "flights   {flights}");
        return Ok(report.with_files(&[path]));
    }
    let ready = study.prepare()?;
    let parts = args.parts.as_deref().map(|folder| shards(&study, &ready, folder)).transpose()?;
    let mut store = open_store(&args.output)?;
    parts.iter().flatten().try_for_each(|path| store.take(path))?;
    let results = open_results(&args.output, &RANKING)?;
    let trials: Vec<Trial> = study.trials().collect();
    let bar = counter("flying", trials.len());
    let stop = Stop::default();
    let records: Vec<Record> = evaluate(&study, &ready, &trials, Some(&store), &stop, &bar)?;
    drop(bar);
    let ranking = rank(&study, &records);
    let files = write_ranking(results, &study, &ready, &ranking, &records)?;
    Ok(ranking_report(&study, &ranking, records.len()).with_files(&files))
}
