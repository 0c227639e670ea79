//! `noctograph rank`: scenes in the order of the probability that their words are read.

use std::path::PathBuf;

use clap::Args;

use super::outcome::Report;
use super::studies::{StudyFlags, counter, open_store, ranking_report, write_ranking};
use crate::error::Result;
use crate::shoot::Stop;
use crate::study::{Record, Trial, evaluate, rank};

#[derive(Debug, Args)]
#[command(after_help = "Every flight is added to OUTPUT/flights.jsonl at once. An interrupted \
                        command continues when it is repeated, and comes to the same numbers.")]
pub(super) struct RankArgs {
    /// Scenes: files, presets, team, pid, geometric, tuned, or learned folders (./tuned)
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<String>,
    #[command(flatten)]
    study: StudyFlags,
    /// Folder for flights.jsonl, flights.csv, ranking.csv, ranking.json and photos.png
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-rank")]
    output: PathBuf,
}

pub(super) fn run(args: &RankArgs) -> Result<Report> {
    let study = args.study.study(&args.scenes)?;
    study.prepare()?;
    let store = open_store(&args.output)?;
    let trials: Vec<Trial> = study.trials().collect();
    let bar = counter("flying", trials.len());
    let records: Vec<Record> = evaluate(&study, &trials, Some(&store), &Stop::default(), &bar)?;
    drop(bar);
    let ranking = rank(&study, &records);
    let files = write_ranking(&args.output, &study, &ranking, &records)?;
    Ok(ranking_report(&study, &ranking, records.len()).with_files(&files))
}
