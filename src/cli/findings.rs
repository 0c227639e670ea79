//! Formatting of the findings of `check` as text and as JSON.

use super::advice::mentioned;
use super::printer::wrapped;
use crate::diagnostic::Diagnostic;

/// Returns the table of findings as text, with what is wanted and what to change below each
/// finding.
pub(super) fn table(findings: &[Diagnostic]) -> String {
    let mut text = String::new();
    let rows = findings.iter().map(|finding| finding.cells(mentioned));
    for [mark, check, finding, wanted, change] in rows {
        text += &wrapped(&format!("{mark:5} {check:16} "), &finding);
        for (name, words) in [("wanted", wanted), ("change", change)] {
            if !words.is_empty() {
                text += &wrapped(&format!("{:23}{name}: ", ""), &words);
            }
        }
    }
    text
}

/// Returns a finding as a JSON object with its numbers, sentences and advice.
pub(super) fn json(finding: &Diagnostic) -> serde_json::Value {
    let mut json = serde_json::json!(finding);
    json["change"] = finding.change(mentioned).into();
    json
}

/// Returns the codes and messages of the findings that stop a flight in one line, or `None` if
/// there are none.
pub(super) fn stops<'a>(findings: impl IntoIterator<Item = &'a Diagnostic>) -> Option<String> {
    let stops = findings.into_iter().filter(|finding| finding.is_stop());
    let stops: Vec<String> = stops.map(|stop| format!("{} ({stop})", stop.code)).collect();
    (!stops.is_empty()).then(|| stops.join("; "))
}
