//! Findings of a check in words.

use super::advice::mentioned;
use super::wrapped;
use crate::preflight::{Checked, Severity};

/// The table of findings with advice.
pub(super) fn table(findings: &[Checked]) -> String {
    let mut text = String::new();
    for [mark, check, finding, wanted, change] in findings.iter().map(|it| it.cells(mentioned)) {
        text += &wrapped(&format!("{mark:5} {check:16} "), &finding);
        for (name, words) in [("wanted", wanted), ("change", change)] {
            if !words.is_empty() {
                text += &wrapped(&format!("{:23}{name}: ", ""), &words);
            }
        }
    }
    text
}

/// A finding as JSON: numbers, sentences and advice.
pub(super) fn json(checked: &Checked) -> serde_json::Value {
    let mut json = serde_json::json!(checked);
    json["change"] = checked.row.change(mentioned).into();
    json
}

/// The stops in one line; `None` where there are none.
pub(super) fn stops<'a>(findings: impl IntoIterator<Item = &'a Checked>) -> Option<String> {
    let stops = findings.into_iter().filter(|checked| checked.row.severity == Severity::Stop);
    let stops: Vec<String> =
        stops.map(|stop| format!("{} ({})", stop.row.check, stop.finding())).collect();
    (!stops.is_empty()).then(|| stops.join("; "))
}
