//! `noctograph fly`: a plan, or the setpoints of a real flight, are flown in the simulator.

use std::path::PathBuf;

use clap::Args;

use super::inputs::{SceneFlags, read_flight, tell_all, watch};
use super::outputs::Output;
use super::{Outcome, print, show, tell};
use crate::error::Result;
use crate::plan::{Plan, Replay, replay};
use crate::shoot::Shoot;

#[derive(Debug, Args)]
pub(super) struct FlyArgs {
    /// Plan to fly, as `noctograph plan` writes it
    #[arg(required_unless_present = "setpoints", conflicts_with = "setpoints")]
    plan: Option<PathBuf>,
    /// Fly the setpoints of this flight or log instead, as they were sent
    #[arg(long, value_name = "LOG")]
    setpoints: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    /// Flight to write
    #[arg(short, long, value_name = "FILE", default_value = "flight.csv")]
    output: PathBuf,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

impl FlyArgs {
    fn plan(&self) -> Result<Plan> {
        let Some(log) = self.setpoints.as_deref() else {
            return Plan::read_csv(self.plan.as_deref().expect("clap wants one of them"));
        };
        let Replay { plan, n_restored } = replay(&read_flight(log)?)?;
        if n_restored > 0 {
            tell(&format!("warning: the log lost {n_restored} setpoints, put back evenly"));
        }
        Ok(plan)
    }
}

pub(super) fn run(args: &FlyArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    scene.set_word("");
    let plan = args.plan()?;
    let output = Output::create(&args.output)?;
    let shoot = Shoot::with_plans(scene, vec![plan])?;
    let flight = shoot.fly(&watch())?.swap_remove(0);
    tell_all(&flight.warnings);
    let path = output.keep(|out| flight.write_csv(out))?;
    if args.json {
        let json = serde_json::json!({ "flight": show::flight_json(&flight), "files": [path] });
        print(&format!("{json}\n"))?;
    } else {
        let file = path.display();
        print(&format!("{}files     {file}\n", show::flight_lines(&flight)))?;
    }
    Ok(Outcome::Done)
}
