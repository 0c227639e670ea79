//! `noctograph check`: whether a word or a plan is safe to fly; exit code 1 if not.

use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::json;

use super::findings;
use super::flags::SubjectFlags;
use super::report::{Outcome, Report};
use crate::error::Result;
use crate::plan::check::{Finding, Profile, Severity};

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    /// Limits: indoor (a Crazyflie, 1 m/s), careful (0.5 m/s) or outdoor
    #[arg(long, value_name = "NAME", default_value = "indoor", value_parser = profiles())]
    profile: String,
}

pub(super) fn run(args: &CheckArgs) -> Result<Report> {
    let profile = Profile::all().into_iter().find(|profile| profile.name == args.profile);
    let profile = profile.expect("the parser knows the names");
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

fn profiles() -> PossibleValuesParser {
    Profile::all().map(|profile| profile.name).into()
}

fn table(findings: &[Finding], stops: bool, profile: &Profile) -> String {
    let verdict = if stops { "not safe to fly" } else { "safe to fly" };
    format!("{}\n{verdict} (profile {})\n", findings::table(findings), profile.name)
}
