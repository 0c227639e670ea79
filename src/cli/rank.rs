//! `noctograph rank`: scenes in order of how surely their words read.

use std::path::PathBuf;

use clap::Args;

use super::studies::{StudyFlags, counter, ranking_table, write_ranking};
use super::{Outcome, print, tell};
use crate::error::Result;
use crate::study::{Contender, Record, Store, Trial, evaluate, rank};

#[derive(Debug, Args)]
#[command(
    after_help = "Every flight goes into OUTPUT/flights.jsonl at once; the same command goes \
                        on where it was interrupted, and comes to the same numbers."
)]
pub(super) struct RankArgs {
    /// Scenes: the names team, pid, geometric, tuned, presets, files, or learned folders (./tuned)
    #[arg(required = true)]
    scenes: Vec<String>,
    #[command(flatten)]
    study: StudyFlags,
    /// Folder for flights.jsonl, flights.csv, ranking.csv, ranking.json and photos.png
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-rank")]
    output: PathBuf,
    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &RankArgs) -> Result<Outcome> {
    let contenders = args.scenes.iter().map(|named| Contender::find(named));
    let study = args.study.study(contenders.collect::<Result<_>>()?)?;
    study.prepare()?;
    let store = Store::open(&args.output)?;
    if store.n_known() > 0 {
        tell(&format!("{}: {} flights are there already", args.output.display(), store.n_known()));
    }
    let trials: Vec<Trial> = study.trials().collect();
    let bar = counter("flying", trials.len());
    let flown = args.study.on_threads(|| evaluate(&study, &trials, Some(&store), &bar))?;
    drop(bar);
    let records: Vec<Record> = flown?;
    let ranking = rank(&study, &records);
    let files = write_ranking(&args.output, &study, &ranking, &records)?;
    if args.json {
        let json = serde_json::json!({
            "flights": records.len(),
            "measures": ranking.measures,
            "pairs": ranking.pairs,
            "files": files,
        });
        print(&format!("{json}\n"))?;
    } else {
        let files: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
        let files = files.trim_end().replace('\n', "\n          ");
        print(&format!("{}\nfiles     {files}\n", ranking_table(&study, &ranking)))?;
    }
    Ok(Outcome::Done)
}
