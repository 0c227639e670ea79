//! `noctograph check` reports whether a word or plan is safe to fly, and exits with 1 if not.

use super::flags::{ProfileFlags, SubjectFlags};
use super::outcome::Report;
use super::picture::StandFlag;
use super::printer::{print, wrapped};
use super::{findings, show};
use crate::diagnostic::{Diagnostic, Severity};
use crate::error::Result;
use crate::preflight::{Preflight, preflight_flown};
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    #[command(flatten)]
    profile: ProfileFlags,
    #[command(flatten)]
    stand: StandFlag,
}

/// Runs the verb `check`, which flies the word or the plans in simulation and lists the findings.
/// The report passes if no finding stops the flight.
pub(super) fn run(args: &CheckArgs) -> Result<Report> {
    let shoot = args.subject.flown(|scene| {
        args.profile.slow(&args.subject, scene);
        args.stand.apply(scene)
    })?;
    // If the scene has a room, its walls limit the profile's volume.
    let profile = args.profile.profile(&shoot.scene);
    let (shoot, Preflight { findings, placement }) = preflight_flown(shoot, &profile)?;
    let stops = findings.iter().any(Diagnostic::is_stop);
    let product = json!({
        "fly": !stops, "profile": profile, "drones": shoot.plans.len(),
        "findings": findings.iter().map(findings::json).collect::<Vec<_>>(),
    });
    let mut report = Report::new(findings::table(&findings) + "\n", product);
    report.add(show::drawing(shoot.strokes.as_ref()));
    if let Some(placement) = placement {
        for [what, place] in placement.rows() {
            report.text += &wrapped(&format!("{what:22} "), &place);
        }
        report.text.push('\n');
        report.value("placement", placement);
    }
    let words = json!({
        "room": profile.room_m,
        "warnings": counted(&findings, Severity::Warning, ["warning", "warnings"]),
        "unchecked": counted(&findings, Severity::Unknown, ["property", "properties"]),
    });
    report.text += &print(CONCLUSION, &[&report.json, &words]);
    Ok(report.passes(!stops))
}

/// Returns the number of findings of a severity with a noun in the singular or plural, or `None` if
/// there are none.
fn counted(
    findings: &[Diagnostic],
    severity: Severity,
    [one, several]: [&str; 2],
) -> Option<String> {
    match findings.iter().filter(|finding| finding.severity == severity).count() {
        0 => None,
        1 => Some(format!("1 {one}")),
        n => Some(format!("{n} {several}")),
    }
}

const CONCLUSION: &str = "\
{fly?safe to fly:not safe to fly} (profile {profile.name}[, room {room.0}x{room.1}x{room.2}])[, {warnings}][, {unchecked} not checked]
";
