//! `noctograph check`: whether a word or a plan is safe to fly; exit code 1 if not.

use clap::Args;
use serde_json::json;

use super::findings;
use super::flags::SubjectFlags;
use super::report::{Outcome, Report};
use crate::error::{Error, Result};
use crate::plan::check::{Finding, Profile, Severity};

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    /// Limits: indoor (a Crazyflie, 1 m/s), careful (0.5 m/s) or outdoor
    #[arg(long, value_name = "NAME", default_value = "indoor")]
    profile: String,
}

pub(super) fn run(args: &CheckArgs) -> Result<Report> {
    let profile = profile(&args.profile)?;
    let shoot = args.subject.shoot(|_| Ok(()))?;
    let findings = shoot.preflight(&profile)?;
    let stops = findings.iter().any(|finding| finding.severity == Severity::Stop);
    let json = json!({
        "fly": !stops, "profile": profile, "drones": shoot.plans.len(),
        "findings": findings.iter().map(findings::json).collect::<Vec<_>>(),
    });
    let outcome = if stops { Outcome::NotSafe } else { Outcome::Done };
    Ok(Report::new(table(&findings, stops, &profile), json).with_outcome(outcome))
}

fn profile(name: &str) -> Result<Profile> {
    let all = Profile::all();
    let names = all.iter().map(|profile| profile.name).collect::<Vec<_>>().join(", ");
    all.into_iter().find(|profile| profile.name == name).ok_or_else(|| {
        Error::input("--profile", name, format!("one of {names}"), "choose a name of the list")
    })
}

fn table(findings: &[Finding], stops: bool, profile: &Profile) -> String {
    let verdict = if stops { "not safe to fly" } else { "safe to fly" };
    format!("{}\n{verdict} (profile {})\n", findings::table(findings), profile.name)
}
