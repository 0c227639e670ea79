//! Findings of a check in words.

use super::advice::mentioned;
use super::outcome::wrapped;
use crate::preflight::{Checked, Severity};

/// The table of findings, and what to change.
pub(super) fn table(findings: &[Checked]) -> String {
    let mut text = String::new();
    for checked in findings {
        let row = &checked.row;
        let mark = match row.severity {
            Severity::Fine => "ok",
            Severity::Unknown => "?",
            Severity::Warning => "warn",
            Severity::Stop => "STOP",
        };
        text += &wrapped(&format!("{mark:5} {:16} ", row.check), &numbered(checked));
        if row.severity != Severity::Fine {
            text += &wrapped(&format!("{:23}wanted: ", ""), &row.wanted);
            text += &wrapped(&format!("{:23}change: ", ""), &row.change(mentioned));
        }
    }
    text
}

/// A finding as JSON: its numbers and sentences, and what to change.
pub(super) fn json(checked: &Checked) -> serde_json::Value {
    let mut json = serde_json::json!(checked);
    json["change"] = checked.row.change(mentioned).into();
    json
}

/// What was found, behind the number of its drone where there are several.
fn numbered(checked: &Checked) -> String {
    let number = checked.drone.map_or_else(String::new, |drone| format!("drone {drone}: "));
    number + &checked.row.found
}

/// The stops in one line; `None` where there are none.
pub(super) fn stops(findings: &[Checked]) -> Option<String> {
    let stops = findings.iter().filter(|checked| checked.row.severity == Severity::Stop);
    let stops: Vec<String> =
        stops.map(|stop| format!("{} ({})", stop.row.check, numbered(stop))).collect();
    (!stops.is_empty()).then(|| stops.join("; "))
}
