//! `noctograph check`: should this fly? A table of what was looked at, and exit code 1 if not.

use std::path::Path;

use clap::Args;

use super::inputs::{LetterFlags, PlanFlags, SceneFlags, type_word};
use super::{Outcome, print};
use crate::error::{Error, Result};
use crate::plan::Plan;
use crate::plan::check::{Finding, Profile, Severity};
use crate::scene::Scene;
use crate::shoot::Shoot;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Word to plan and check, or plans as `noctograph plan` writes them (names ending in .csv)
    #[arg(required = true)]
    inputs: Vec<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    #[command(flatten)]
    plan: PlanFlags,
    /// Limits: indoor (a Crazyflie, 1 m/s), careful (0.5 m/s) or outdoor
    #[arg(long, value_name = "NAME", default_value = "indoor")]
    profile: String,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &CheckArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.letters.apply(&mut scene)?;
    args.plan.apply(&mut scene);
    scene.check()?;
    let profile = profile(&args.profile)?;
    let shoot = shoot(args, scene)?;
    let findings = shoot.preflight(&profile)?;
    let stops = findings.iter().any(|finding| finding.severity == Severity::Stop);
    if args.json {
        let json = serde_json::json!({
            "fly": !stops, "profile": profile, "drones": shoot.plans.len(), "findings": findings,
        });
        print(&format!("{json}\n"))?;
    } else {
        print(&table(&findings, stops, &profile))?;
    }
    Ok(if stops { Outcome::ShouldNotFly } else { Outcome::Done })
}

fn profile(name: &str) -> Result<Profile> {
    let all = Profile::all();
    let names = all.iter().map(|profile| profile.name).collect::<Vec<_>>().join(", ");
    all.into_iter().find(|profile| profile.name == name).ok_or_else(|| {
        Error::input("--profile", name, format!("one of {names}"), "choose a name of the list")
    })
}

/// Plans of files, or those of the word.
fn shoot(args: &CheckArgs, mut scene: Scene) -> Result<Shoot> {
    let is_file = |input: &&String| Path::new(input).extension().is_some_and(|e| e == "csv");
    let files: Vec<&String> = args.inputs.iter().filter(is_file).collect();
    match args.inputs.as_slice() {
        all if files.len() == all.len() => {
            scene.set_word("");
            let plans = files.into_iter().map(|file| Plan::read_csv(file.as_ref()));
            Shoot::with_plans(scene, plans.collect::<Result<_>>()?)
        }
        [word] => {
            type_word(&mut scene, Some(word));
            Shoot::new(scene)
        }
        inputs => {
            let hint = "name one word, or plans that are flown together";
            Err(Error::input("inputs", inputs.join(" "), "one word, or files *.csv", hint))
        }
    }
}

fn table(findings: &[Finding], stops: bool, profile: &Profile) -> String {
    let mut text = String::new();
    for finding in findings {
        let mark = match finding.severity {
            Severity::Fine => "ok",
            Severity::Unknown => "?",
            Severity::Warning => "warn",
            Severity::Stop => "STOP",
        };
        text += &format!("{mark:5} {:16} {}\n", finding.check, finding.found);
        if finding.severity != Severity::Fine {
            text += &format!("{:22} wanted: {}\n", "", finding.wanted);
            text += &format!("{:22} change: {}\n", "", finding.change);
        }
    }
    let verdict = if stops { "should not fly" } else { "may fly" };
    text + &format!("\n{verdict} (profile {})\n", profile.name)
}
