//! `noctograph sweep`: a ranking's flights in shards, for any engine that can run a command.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde_json::json;

use super::outcome::{Report, line};
use super::output::Output;
use super::studies::{StudyFlags, counter, ranking_report, write_ranking};
use crate::error::{Error, Result};
use crate::study::{Record, Shard, Store, Sweep, rank};

#[derive(Debug, Subcommand)]
pub(super) enum SweepVerb {
    /// List the flights: the file that every worker reads
    Plan(PlanArgs),
    /// Fly one shard of a plan, unless it is there already
    Run(RunArgs),
    /// Merge the shards into a ranking: the same bytes however they were cut
    Merge(MergeArgs),
    /// Print a script for Slurm that flies a plan as an array of tasks
    Slurm(SlurmArgs),
}

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Scenes, as for rank
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<String>,
    #[command(flatten)]
    study: StudyFlags,
    /// Plan to write
    #[arg(short, long, value_name = "FILE", default_value = "sweep.json")]
    output: PathBuf,
}

#[derive(Debug, Args)]
#[command(
    after_help = "On the cores of several machines, with GNU parallel:\n  seq 40 | parallel \
                        --sshlogin a,b --resume-failed --joblog jobs \\\n    noctograph sweep run \
                        sweep.json --shard {}/40 --threads 1 -o parts\nWith Dask: \
                        examples/dask_sweep.py"
)]
pub(super) struct RunArgs {
    /// Plan, as `sweep plan` writes it
    plan: PathBuf,
    /// Shard to fly, of how many: 3/20
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: String,
    /// Folder for the shards
    #[arg(short, long, value_name = "DIR", default_value = "parts")]
    output: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct MergeArgs {
    /// Plan, as `sweep plan` writes it
    plan: PathBuf,
    /// Folder with the shards
    parts: PathBuf,
    /// Folder for the results, as for rank
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-rank")]
    output: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct SlurmArgs {
    /// Plan, as `sweep plan` writes it
    plan: PathBuf,
    /// Number of shards, one for each task; some minutes of work each
    #[arg(long, value_name = "N", default_value_t = 100)]
    shards: usize,
    /// Folder for the shards, on a disk that all nodes share
    #[arg(short, long, value_name = "DIR", default_value = "parts")]
    output: PathBuf,
}

pub(super) fn run(verb: &SweepVerb) -> Result<Report> {
    match verb {
        SweepVerb::Plan(args) => plan(args),
        SweepVerb::Run(args) => fly(args),
        SweepVerb::Merge(args) => merge(args),
        SweepVerb::Slurm(args) => slurm(args),
    }
}

fn plan(args: &PlanArgs) -> Result<Report> {
    let sweep = Sweep::new(args.study.study(&args.scenes)?)?;
    let output = Output::create(&args.output)?;
    let path = output.keep(|out| out.write_all(sweep.to_json().as_bytes()))?;
    let text = line("flights", &sweep.flights.to_string());
    Ok(Report::new(text, json!({ "flights": sweep.flights })).with_files(&[path]))
}

fn fly(args: &RunArgs) -> Result<Report> {
    let (sweep, shard) = (Sweep::read(&args.plan)?, args.shard.parse::<Shard>()?);
    let bar = counter("flying", sweep.flights.div_ceil(shard.count));
    let (path, flown) = sweep.run(shard, &args.output, &bar)?;
    drop(bar);
    let state = if flown { "flown" } else { "there already" };
    let text = line("shard", &format!("{} {state}", args.shard));
    Ok(Report::new(text, json!({ "shard": args.shard, "flown": flown })).with_files(&[path]))
}

fn merge(args: &MergeArgs) -> Result<Report> {
    let sweep = Sweep::read(&args.plan)?;
    let records = sweep.merge(&args.parts)?;
    let store = Store::open(&args.output)?;
    let path = args.output.join(Store::FLIGHTS);
    if store.n_known() > 0 && !are_there(&path, &records)? {
        let found = format!("{} flights of another study", store.n_known());
        let hint = "name another folder with -o: flights are never overwritten";
        return Err(Error::input(path.display().to_string(), found, "no flights", hint));
    }
    Store::write(&path, &records)?;
    drop(store);
    let ranking = rank(&sweep.study, &records);
    let files = write_ranking(&args.output, &sweep.study, &ranking, &records)?;
    Ok(ranking_report(&sweep.study, &ranking, records.len()).with_files(&files))
}

/// Whether a file holds these flights and no others.
fn are_there(path: &Path, records: &[Record]) -> Result<bool> {
    let mut expected = records.iter();
    let mut same = true;
    Store::each(path, |record| {
        same &= expected.next() == Some(&record);
        Ok(())
    })?;
    Ok(same && expected.next().is_none())
}

fn slurm(args: &SlurmArgs) -> Result<Report> {
    let sweep = Sweep::read(&args.plan)?;
    let shards = args.shards.clamp(1, sweep.flights.max(1));
    let quoted =
        |path: &PathBuf| format!("'{}'", path.display().to_string().replace('\'', r"'\''"));
    let (plan, parts) = (quoted(&args.plan), quoted(&args.output));
    let script = format!(
        "#!/bin/bash\n# {} flights in {shards} tasks. Submit with sbatch; submit again for failed \
         tasks:\n# shards that are there are not flown again. Then:\n#   noctograph sweep merge \
         {plan} {parts}\n#SBATCH --job-name=noctograph\n#SBATCH --array=1-{shards}\n#SBATCH \
         --cpus-per-task=1\n#SBATCH --requeue\nset -euo pipefail\nnoctograph sweep run {plan} \\\n  \
         --shard \"$SLURM_ARRAY_TASK_ID/{shards}\" --threads 1 -o {parts}\n",
        sweep.flights
    );
    Ok(Report::new(script.clone(), json!({ "script": script })))
}
