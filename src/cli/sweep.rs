//! `noctograph sweep`: a ranking's flights in shards, for any engine that can run a command.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::outputs::Output;
use super::studies::{StudyFlags, counter, on_threads, ranking_table, write_ranking};
use super::{Outcome, print};
use crate::error::{Error, Result};
use crate::study::{Contender, Shard, Store, Sweep, rank};

#[derive(Debug, Subcommand)]
pub(super) enum SweepVerb {
    /// Write down which flights there are: the file that every worker reads
    Plan(PlanArgs),
    /// Fly one shard of a plan; what lies there already is not flown again
    Run(RunArgs),
    /// Gather the shards: the same bytes however they were cut, and the ranking
    Merge(MergeArgs),
    /// Print a Slurm array script that flies a plan
    Slurm(SlurmArgs),
}

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Scenes, as for rank
    #[arg(required = true)]
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
    /// Which part, of how many: 3/20
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: String,
    /// Threads; as many as the machine has where it is left out
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
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
    /// Folder for the results, as of rank
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-rank")]
    output: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct SlurmArgs {
    /// Plan, as `sweep plan` writes it
    plan: PathBuf,
    /// Shards, a task each; minutes of work each are right
    #[arg(long, value_name = "N", default_value_t = 100)]
    shards: usize,
    /// Folder for the shards, on a disk that all nodes share
    #[arg(short, long, value_name = "DIR", default_value = "parts")]
    output: PathBuf,
}

pub(super) fn run(verb: &SweepVerb) -> Result<Outcome> {
    match verb {
        SweepVerb::Plan(args) => plan(args),
        SweepVerb::Run(args) => fly(args),
        SweepVerb::Merge(args) => merge(args),
        SweepVerb::Slurm(args) => slurm(args),
    }
}

fn plan(args: &PlanArgs) -> Result<Outcome> {
    let contenders = args.scenes.iter().map(|named| Contender::find(named));
    let sweep = Sweep::new(args.study.study(contenders.collect::<Result<_>>()?)?)?;
    let output = Output::create(&args.output)?;
    let path = output.keep(|out| std::io::Write::write_all(out, sweep.to_json().as_bytes()))?;
    print(&format!("flights   {}\nfiles     {}\n", sweep.flights, path.display()))?;
    Ok(Outcome::Done)
}

fn fly(args: &RunArgs) -> Result<Outcome> {
    let (sweep, shard) = (Sweep::read(&args.plan)?, args.shard.parse::<Shard>()?);
    let bar = counter("flying", sweep.flights.div_ceil(shard.count));
    let run = on_threads(args.threads, || sweep.run(shard, &args.output, &bar))?;
    drop(bar);
    let (path, flown) = run?;
    let what = if flown { "flown" } else { "there already" };
    print(&format!("shard     {} {what}\nfiles     {}\n", args.shard, path.display()))?;
    Ok(Outcome::Done)
}

fn merge(args: &MergeArgs) -> Result<Outcome> {
    let sweep = Sweep::read(&args.plan)?;
    let records = sweep.merge(&args.parts)?;
    let store = Store::open(&args.output)?;
    let path = args.output.join(Store::FLIGHTS);
    if store.n_known() > 0 && Store::read(&path)? != records {
        let found = format!("{} flights of something else", store.n_known());
        let hint = "name another folder with -o: nothing is written over";
        return Err(Error::input(path.display().to_string(), found, "no flights", hint));
    }
    Store::write(&path, &records)?;
    drop(store);
    let ranking = rank(&sweep.study, &records);
    let files = write_ranking(&args.output, &sweep.study, &ranking, &records)?;
    let files: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
    let files = files.trim_end().replace('\n', "\n          ");
    print(&format!("{}\nfiles     {files}\n", ranking_table(&sweep.study, &ranking)))?;
    Ok(Outcome::Done)
}

fn slurm(args: &SlurmArgs) -> Result<Outcome> {
    let sweep = Sweep::read(&args.plan)?;
    let shards = args.shards.clamp(1, sweep.flights.max(1));
    let quoted =
        |path: &PathBuf| format!("'{}'", path.display().to_string().replace('\'', r"'\''"));
    let (plan, parts) = (quoted(&args.plan), quoted(&args.output));
    print(&format!(
        "#!/bin/bash\n# {} flights in {shards} tasks. Submit with sbatch; submit again for what \
         failed:\n# shards that are there are not flown again. Then: noctograph sweep merge {plan} \
         {parts}\n#SBATCH --job-name=noctograph\n#SBATCH --array=1-{shards}\n#SBATCH \
         --cpus-per-task=1\n#SBATCH --requeue\nset -euo pipefail\nnoctograph sweep run {plan} \
         --shard \"$SLURM_ARRAY_TASK_ID/{shards}\" --threads 1 -o {parts}\n",
        sweep.flights
    ))?;
    Ok(Outcome::Done)
}
