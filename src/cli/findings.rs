//! Findings of a check in words.

use super::advice::mentioned;
use super::report::wrapped;
use crate::plan::PlanOptions;
use crate::preflight::{Checked, Row, Severity};

/// Findings as rows, of plans that were made with some options.
pub(super) fn rows(findings: &[Checked], options: &PlanOptions) -> Vec<Row> {
    findings.iter().map(|finding| finding.row(options)).collect()
}

/// The table of findings, and what to change.
pub(super) fn table(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let mark = match row.severity {
            Severity::Fine => "ok",
            Severity::Unknown => "?",
            Severity::Warning => "warn",
            Severity::Stop => "STOP",
        };
        text += &wrapped(&format!("{mark:5} {:16} ", row.check), &numbered(row));
        if row.severity != Severity::Fine {
            text += &wrapped(&format!("{:23}wanted: ", ""), &row.wanted);
            text += &wrapped(&format!("{:23}change: ", ""), &row.change(mentioned));
        }
    }
    text
}

/// A finding as JSON: its numbers and sentences, and what to change.
pub(super) fn json(row: &Row) -> serde_json::Value {
    let mut json = serde_json::json!(row);
    json["change"] = row.change(mentioned).into();
    json
}

/// What was found, behind the number of its drone where there are several.
fn numbered(row: &Row) -> String {
    let number = row.drone.map_or_else(String::new, |drone| format!("drone {drone}: "));
    number + &row.found
}

/// The stops in one line; `None` where there are none.
pub(super) fn stops(rows: &[Row]) -> Option<String> {
    let stops = rows.iter().filter(|row| row.severity == Severity::Stop);
    let stops: Vec<String> =
        stops.map(|stop| format!("{} ({})", stop.check, numbered(stop))).collect();
    (!stops.is_empty()).then(|| stops.join("; "))
}
