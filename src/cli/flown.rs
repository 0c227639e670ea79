//! `preview --flown`: a flight beside the one that was promised, letter by letter.

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
use serde::Serialize;
use serde_json::json;

/// A letter in one of the two photos. What is not known is `None`.
#[derive(Debug, Default, Serialize)]
struct Letter {
    /// Probability of the letter.
    p: Option<f64>,
    /// The likeliest letter.
    best: Option<char>,
    lag_s: Option<f64>,
    /// Distance from the path of the design, RMS.
    contour_m: Option<f64>,
    /// Greatest distance from the word's plane.
    drift_m: Option<f64>,
    /// Duration of its light.
    lit_s: f64,
}

/// Prepares the photo of a log with the scene of the promised one.
pub(super) fn prepared(promised: &Shoot, log: &Path) -> Result<Shoot> {
    if promised.plans.len() != 1 {
        let actual = format!("{} drones", promised.plans.len());
        let hint = "leave --flown out, or name a word of one drone";
        return Err(Error::input("flown", actual, "a word that one drone writes", hint));
    }
    let Warned { product, warnings } = Shoot::of_log(promised.scene.clone(), log)?;
    warn_of(log, &warnings);
    Ok(Shoot { judging: Judging::Scored, keeps_film: false, ..product })
}

/// Compares both photos. Returns the report, and the notes for the page.
pub(super) fn compare(promised: &Shot, flown: Shot) -> (Report, FlownNotes) {
    let both = [promised, &flown].map(|shot| letters(shot, promised));
    let expected = promised.verdict.iter().flat_map(|verdict| &verdict.letters);
    let (mut rows, mut pairs) = (Vec::new(), Vec::new());
    let [of_promised, of_flown] = &both;
    for ((letter, a), b) in expected.zip(of_promised).zip(of_flown) {
        let cell = |value: fn(&Letter) -> Option<f64>, n_digits| {
            let text = |value: Option<f64>| {
                value.map_or_else(|| "-".to_owned(), |value| format!("{value:.n_digits$}"))
            };
            format!("{} {}", text(value(a)), text(value(b)))
        };
        let best = |letter: &Letter| letter.best.unwrap_or('-');
        rows.push([
            letter.expected.to_string(),
            format!("{} {}", best(a), best(b)),
            cell(|l| l.p, 2),
            cell(|l| l.lag_s, 2),
            cell(|l| Some(1e3 * l.contour_m?), 0),
            cell(|l| Some(1e3 * l.drift_m?), 0),
            cell(|l| Some(l.lit_s), 1),
        ]);
        pairs.push(json!({ "letter": letter.expected, "promised": a, "flown": b }));
    }
    let verdict = flown.verdict.as_ref();
    let mut report = Report::new(String::new(), json!({}));
    if let Some(verdict) = verdict {
        report.line("flown", &verdict_sentence(verdict));
    }
    // Each cell has the promised value and the flown one.
    report.text += "\n";
    report.text += &table(HEAD, &rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>());
    report.text += "\n";
    report.value(
        "flown",
        json!({
            "read": verdict.map(|verdict| &verdict.read),
            "readability": verdict.map(|verdict| verdict.readability),
            "flight_sha256": flown.flight_sha256(),
            "letters": pairs,
        }),
    );
    (report, FlownNotes { shot: flown, rows })
}

const HEAD: &str = "letter<8|reads as<10|P<11|lag/s<12|off path/mm<10|off plane/mm<11|lit/s<0";

/// Returns the letters of a photo, whose flight flew the plan of the promised one.
fn letters(shot: &Shot, promised: &Shot) -> Vec<Letter> {
    let Some(verdict) = &shot.verdict else { return Vec::new() };
    let mut flight = shot.flights[0].clone();
    letters_by_plan(&mut flight, &promised.shoot.plans[0].plan);
    // Without a design there are no tracking errors.
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

/// Returns the duration of the light of a letter.
fn lit_s(flight: &Flight, letter: usize) -> f64 {
    let pairs = flight.samples.windows(2).enumerate();
    let lit = pairs.filter(|(row, pair)| {
        pair[0].letter == Some(letter) && flight.lights.values().any(|levels| levels[*row] > 0.0)
    });
    lit.map(|(_, pair)| pair[1].time_s - pair[0].time_s).sum()
}
