//! `noctograph check`: whether a word or a plan is safe to fly; exit code 1 if not.

use super::{
    Args, Outcome, ProfileFlags, Report, Result, StandFlag, SubjectFlags, findings, json, print,
    show, wrapped,
};
use crate::preflight::{Preflight, Severity, preflight};

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
    let counts = [Severity::Warning, Severity::Unknown].map(|severity| {
        let n = found.iter().filter(|checked| checked.row.severity == severity).count();
        Some(n).filter(|n| *n > 0)
    });
    let words = json!({
        "room": profile.room_m, "warnings": counts[0], "unchecked": counts[1],
    });
    report.text += &print(CONCLUSION, &[&report.json, &words]);
    Ok(report.with_outcome(if stops { Outcome::NotSafe } else { Outcome::Done }))
}

const CONCLUSION: &str = "\
{fly?safe to fly:not safe to fly} (profile {profile.name}[, room {room.0}x{room.1}x{room.2}])[, warnings: {warnings}][, not checked: {unchecked}]
";
