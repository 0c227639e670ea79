//! `noctograph check`: whether a word or a plan is safe to fly; exit code 1 if not.

use super::{
    Args, Outcome, ProfileFlags, Report, Result, StandFlag, SubjectFlags, findings, json, show,
    wrapped,
};
use crate::preflight::{Checked, Preflight, Profile, Severity, preflight};

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    #[command(flatten)]
    profile: ProfileFlags,
    #[command(flatten)]
    stand: StandFlag,
}

pub(super) fn run(args: &CheckArgs) -> Result<Report> {
    let shoot = args.subject.shoot(|scene| {
        args.profile.slow(&args.subject, scene);
        args.stand.apply(scene)
    })?;
    let profile = args.profile.profile(&shoot.scene);
    let Preflight { findings: found, placement } = preflight(&shoot, &profile)?;
    let stops = found.iter().any(|checked| checked.row.severity == Severity::Stop);
    let product = json!({
        "fly": !stops, "profile": profile, "drones": shoot.plans.len(),
        "findings": found.iter().map(findings::json).collect::<Vec<_>>(),
    });
    let mut report = Report::new(findings::table(&found) + "\n", product);
    report.add(show::drawing(shoot.strokes.as_ref()));
    if let Some(placement) = placement {
        for [what, place] in placement.rows() {
            report.text += &wrapped(&format!("{what:22} "), &place);
        }
        report.text.push('\n');
        report.value("placement", placement);
    }
    report.text += &conclusion(&found, stops, &profile);
    Ok(report.with_outcome(if stops { Outcome::NotSafe } else { Outcome::Done }))
}

fn conclusion(checks: &[Checked], stops: bool, profile: &Profile) -> String {
    let verdict = if stops { "not safe to fly" } else { "safe to fly" };
    let room = profile.room_m.map_or_else(String::new, |[w, d, h]| format!(", room {w}x{d}x{h}"));
    let counted = |severity, one: &str, several: &str| match checks
        .iter()
        .filter(|checked| checked.row.severity == severity)
        .count()
    {
        0 => String::new(),
        1 => format!(", 1 {one}"),
        n => format!(", {n} {several}"),
    };
    let warnings = counted(Severity::Warning, "warning", "warnings");
    let unchecked = counted(Severity::Unknown, "property not checked", "properties not checked");
    format!("{verdict} (profile {}{room}){warnings}{unchecked}\n", profile.name)
}
