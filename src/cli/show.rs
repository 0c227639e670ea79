//! Results as people read them, and as programs do.

use sha2::{Digest, Sha256};

use crate::expose::Backend;
use crate::flight::{Flight, rmse_m};
use crate::score::{Reason, Verdict};

/// The verdict: a line for the word, a row for each letter.
pub(super) fn verdict_table(verdict: &Verdict) -> String {
    let Verdict { word, read, legible, probability, .. } = verdict;
    let legible = if *legible { "legible" } else { "NOT legible" };
    let mut text = format!("{word} reads as {read}: {legible} (probability {probability:.2})\n");
    if let Some(reason) = verdict.reason {
        text += &format!("because   {}\n", in_words(reason));
    }
    text += "\nletter    best      runner-up margin\n";
    for letter in &verdict.letters {
        let shown = |c: Option<char>| c.map_or("-".to_owned(), String::from);
        let (best, runner_up) = (shown(letter.best), shown(letter.runner_up));
        text += &format!("{:10}{best:10}{runner_up:10}{:+.3}\n", letter.expected, letter.margin);
    }
    text
}

fn in_words(reason: Reason) -> &'static str {
    match reason {
        Reason::NotInPhoto => "the place of the word is not in the photo",
        Reason::NoLight => "nothing shines in the place of the word",
        Reason::TooSmall => "its letters are less than 20 pixels high",
        Reason::OutOfRange => "it hangs too far from its place, or is too large or too small",
        Reason::Misread => "a letter looks like another one, or like nothing",
    }
}

/// Flight time and tracking error.
pub(super) fn flight_lines(flight: &Flight) -> String {
    let duration_s = duration_s(flight);
    let rmse = rmse_m(flight).map_or("no letter was written".to_owned(), |rmse| {
        format!("x {:.3}  y {:.3}  z {:.3} m", rmse.x, rmse.y, rmse.z)
    });
    format!("flight    {duration_s:.1} s, RMSE over the letters: {rmse}\n")
}

/// Flight time and tracking error for programs; `rmse_m` is null where no letter was written.
pub(super) fn flight_json(flight: &Flight) -> serde_json::Value {
    let rmse_m = rmse_m(flight).map(|rmse| [rmse.x, rmse.y, rmse.z]);
    serde_json::json!({ "duration_s": duration_s(flight), "rmse_m": rmse_m })
}

/// Who exposed.
pub(super) fn exposure_line(backend: Backend, adapter: &str) -> String {
    format!("exposed   by {} on {adapter}\n", backend.name())
}

/// The verdict for programs; its fields are those of [`Verdict`].
pub(super) fn to_json(verdict: &Verdict) -> serde_json::Value {
    serde_json::to_value(verdict).expect("a verdict is plain data")
}

/// SHA-256 of a file's bytes, in hexadecimal.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn duration_s(flight: &Flight) -> f64 {
    flight.samples.last().map_or(0.0, |last| last.time_s)
}
