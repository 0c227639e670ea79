//! `noctograph plan`: a word becomes setpoints and light commands.

use std::path::PathBuf;

use clap::Args;

use super::inputs::{LetterFlags, SceneFlags, strokes};
use super::outputs::Output;
use super::{Outcome, print};
use crate::error::Result;
use crate::plan::plan;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Word to write; the scene's where it is left out
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    /// Plan to write
    #[arg(short, long, value_name = "FILE", default_value = "plan.csv")]
    output: PathBuf,
    /// Print one JSON object instead of a line
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &PlanArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.letters.apply(&mut scene)?;
    let strokes = strokes(&mut scene, args.word.as_deref())?;
    let output = Output::create(&args.output)?;
    let plan = plan(&strokes, &scene.plan)?;
    let path = output.keep(|out| plan.write_csv(out))?;
    let (word, duration_s, n) = (&strokes.word, plan.duration_s(), plan.setpoints.len());
    if args.json {
        let json = serde_json::json!({
            "word": word, "duration_s": duration_s, "setpoints": n, "files": [path],
        });
        print(&format!("{json}\n"))?;
    } else {
        let file = path.display();
        print(&format!("{word}: {duration_s:.1} s, {n} setpoints, written to {file}\n"))?;
    }
    Ok(Outcome::Done)
}
