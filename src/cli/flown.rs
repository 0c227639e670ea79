//! Compares a real flight with the previewed one, letter by letter, for `preview --flown`.

use std::path::Path;

use super::flags::warn_of;
use super::outcome::Report;
use super::printer::table;
use super::show::verdict_sentence;
use crate::diagnostic::Warned;
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::report::FlownNotes;
use crate::shoot::{Judging, Shoot, Shot};
use crate::tracking::{letters_by_plan, track_letters};
use noctograph_core::units::MM_PER_M;
use serde::Serialize;
use serde_json::json;

/// A letter in one of the two photos. Unknown figures are `None`.
#[derive(Debug, Serialize)]
struct Letter {
    /// Probability of the letter.
    p: Option<f64>,
    /// The likeliest letter.
    best: Option<char>,
    lag_s: Option<f64>,
    /// RMS distance from the path of the design.
    contour_m: Option<f64>,
    /// Maximum distance from the word's plane.
    drift_m: Option<f64>,
    /// Duration of the letter's light.
    lit_s: f64,
}

/// Reads a log, prints its warnings, and returns its shoot in the scene of the previewed photo
/// (`promised`). Returns [`Error::Input`] for a scene with several drones.
pub(super) fn prepared(promised: &Shoot, log: &Path) -> Result<Shoot> {
    if promised.plans.len() != 1 {
        let actual = format!("{} drones", promised.plans.len());
        let hint = "omit --flown, or name a word for a single drone";
        return Err(Error::input("flown", actual, "a word written by a single drone", hint));
    }
    let Warned { product, warnings } = Shoot::of_log(promised.scene.clone(), log)?;
    warn_of(log, &warnings);
    Ok(Shoot { judging: Judging::Scored, keeps_film: false, ..product })
}

/// Compares the photo of a flight with the previewed photo, letter by letter. Returns the report
/// and the notes for the page.
pub(super) fn compare(promised: &Shot, flown: Shot) -> (Report, FlownNotes) {
    let [promised_letters, flown_letters] = [promised, &flown].map(|shot| letters(shot, promised));
    let expected = promised.verdict.iter().flat_map(|verdict| &verdict.letters);
    // Each letter has a row in the table and an object in the JSON.
    let (mut rows, mut pairs) = (Vec::new(), Vec::new());
    for ((verdict, before), after) in expected.zip(promised_letters).zip(flown_letters) {
        rows.push(row(verdict.expected, [&before, &after]));
        pairs.push(json!({ "letter": verdict.expected, "promised": before, "flown": after }));
    }
    // A drawing has neither a verdict nor letters.
    let verdict = flown.verdict.as_ref();
    let mut report = Report::new(String::new(), json!({}));
    report.value(
        "flown",
        json!({
            "read": verdict.map(|verdict| &verdict.read),
            "readability": verdict.map(|verdict| verdict.readability),
            "flight_sha256": flown.flight_sha256(),
            "letters": pairs,
        }),
    );
    if let Some(verdict) = verdict {
        report.line("flown", &verdict_sentence(verdict));
        let rows: Vec<Vec<String>> = rows.iter().map(|row| row.to_vec()).collect();
        report.text += &format!("\n{}\n", table(HEAD, &rows));
    }
    (report, FlownNotes { shot: flown, rows })
}

/// Returns a letter's row in the table: the letter, and its figures in the previewed and the flown
/// photo, in the columns of [`HEAD`].
fn row(expected: char, pair: [&Letter; 2]) -> [String; 7] {
    let cell = |value: fn(&Letter) -> Option<f64>, digits| {
        pair.map(|letter| rounded(value(letter), digits)).join(ARROW)
    };
    [
        expected.to_string(),
        pair.map(|letter| letter.best.unwrap_or('-').to_string()).join(ARROW),
        cell(|l| l.p, 2),
        cell(|l| l.lag_s, 2),
        cell(|l| Some(MM_PER_M * l.contour_m?), 0),
        cell(|l| Some(MM_PER_M * l.drift_m?), 0),
        cell(|l| Some(l.lit_s), 1),
    ]
}

/// Arrow from the previewed value to the flown one.
const ARROW: &str = " → ";
const HEAD: &str = "letter<8|reads as<10|P<13|lag/s<15|off path/mm<11|off plane/mm<11|lit/s<0";

/// Returns a value as text with a number of digits, without negative zero, or `-` if it is unknown.
fn rounded(value: Option<f64>, digits: usize) -> String {
    let Some(value) = value else { return "-".to_owned() };
    let text = format!("{value:.digits$}");
    let is_zero = text.bytes().all(|byte| b"-0.".contains(&byte));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Returns the letters of a photo with their reading and tracking errors, or none for a photo
/// without a verdict. The flight followed the plan of the previewed photo (`promised`), which
/// determines the letter at each time.
fn letters(shot: &Shot, promised: &Shot) -> Vec<Letter> {
    let Some(verdict) = &shot.verdict else { return Vec::new() };
    let mut flight = shot.flights[0].clone();
    letters_by_plan(&mut flight, &promised.shoot.plans[0].plan);
    // A flight without a design has no tracking errors.
    let tracked = track_letters(&flight).unwrap_or_default();
    let letters = verdict.letters.iter().enumerate().map(|(index, letter)| {
        let tracking = tracked.get(&index);
        Letter {
            p: letter.p,
            best: letter.best,
            lag_s: tracking.map(|tracking| tracking.lag_s),
            contour_m: tracking.map(|tracking| tracking.contour.rms_m),
            drift_m: tracking.map(|tracking| tracking.drift.max_y_m.max(-tracking.drift.min_y_m)),
            lit_s: lit_s(&flight, index),
        }
    });
    letters.collect()
}

/// Returns the time in s for which at least one light is on during the letter with the index
/// `letter`, from 0.
fn lit_s(flight: &Flight, letter: usize) -> f64 {
    let pairs = flight.samples.windows(2).enumerate();
    let lit = pairs.filter(|(row, pair)| {
        pair[0].letter == Some(letter) && flight.lights.values().any(|levels| levels[*row] > 0.0)
    });
    lit.map(|(_, pair)| pair[1].time_s - pair[0].time_s).sum()
}
