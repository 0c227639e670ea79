//! Tables and JSON objects that several verbs use.

use super::outcome::Report;
use super::printer::print;
use crate::camera::Camera;
use crate::flight::table::on_grid;
use crate::flight::{BATTERY_V, ENERGY_J, Flight, SATURATED_S, on_floor};
use crate::letters::Strokes;
use crate::report::{LEAST_PROBABILITY, rivals};
use crate::score::{Reason, Verdict};
use crate::shoot::Shot;
use crate::tracking::{Part, Tracking, track};
use serde_json::{Value, json};

/// Returns the text of a verdict, with lines for the word, a row for each letter, and advice.
pub fn verdict_table(verdict: &Verdict) -> String {
    // The second opinion, the reading without the word, is shown unless it is empty.
    let second = verdict.second_opinion.as_deref().filter(|text| !text.is_empty());
    let words = json!({
        "sentence": verdict_sentence(verdict),
        "because": verdict.reason.map(|reason| in_words(reason, verdict)),
        "likely": verdict.rival.as_ref().filter(|rival| rival.p >= LEAST_PROBABILITY),
        "blind": verdict.is_contradicted().then(|| second.unwrap_or("nothing")),
        "seen": verdict.letters.iter().map(rivals).collect::<Vec<_>>(),
        "gains": verdict.advice.first().map(|_| "gain"),
    });
    print(VERDICT, &[&json!(verdict), &words])
}

const VERDICT: &str = "\
{sentence}
because   {because}
rival     {likely.word}, probability {likely.p:.2}
faithful  {faithfulness:.2} (1: every stroke is lit, and nothing else)
blind     reads {blind}

|letters|letter<10|P<7|best<7|rivals<0
{expected}|{p:.2}|{best}|{seen.#}

{gains}
*advice {gain:+.2~-}\t{text}
";

/// Returns the verdict as a sentence.
pub(super) fn verdict_sentence(verdict: &Verdict) -> String {
    sentence([&verdict.word, &verdict.read], verdict.legible, verdict.readability)
}

/// Returns a sentence with the expected word, the word that was read, and whether the expected word
/// is `legible`. `readability` is a probability.
pub(super) fn sentence(words: [&str; 2], legible: bool, readability: f64) -> String {
    let [word, read] = words.map(in_one_line);
    let legible = if legible { "legible" } else { "NOT legible" };
    format!("{word} reads as {read}: {legible} (readability {readability:.2})")
}

fn in_one_line(text: &str) -> String {
    text.replace('\n', " ")
}

/// Returns the reason for a verdict as words.
fn in_words(reason: Reason, verdict: &Verdict) -> String {
    let text = match reason {
        Reason::NotInPhoto => "the photo does not show the intended position of the word",
        Reason::NoLight => "there is no light at the intended position of the word",
        Reason::TooSmall => "the letters are smaller than 20 pixels",
        Reason::OutOfRange => {
            "the word is too far from its intended position, or too large or too small"
        }
        Reason::OtherLength => "the photo shows a word of another length",
        // Only one word can have a probability above one half.
        Reason::Misread => match verdict.rival.as_ref().filter(|rival| rival.p > 0.5) {
            Some(rival) => return format!("{} is likelier", in_one_line(&rival.word)),
            None => "a letter looks like a different letter, or like no letter",
        },
        Reason::Unsure => "every letter is likeliest as intended, but the readability is too low",
    };
    text.to_owned()
}

/// Reports the strokes of a drawing, and the strokes omitted by `letters.detail`. The report is
/// empty for a word.
pub(super) fn drawing(strokes: Option<&Strokes>) -> Report {
    let Some(strokes) = strokes.filter(|strokes| strokes.font.is_none()) else {
        return Report::with_layout(json!({}), "");
    };
    let left_out =
        json!({ "strokes": strokes.left_out.strokes, "share": strokes.left_out.length_fraction });
    // The text mentions omitted strokes only if there are any.
    let mut drawing = json!({
        "strokes": strokes.n_strokes(), "length_m": strokes.length_m(), "left_out": left_out,
    });
    if !strokes.warnings.is_empty() {
        let warnings = strokes.warnings.iter().map(ToString::to_string);
        drawing["warnings"] = warnings.collect();
    }
    let layout = "drawing   {drawing.strokes} strokes, {drawing.length_m:.2} m[; left out: \
                  {left_out.strokes} short ones, {left_out.share*100:.1} % of the length]";
    let words = json!({ "left_out": Some(left_out).filter(|_| strokes.left_out.strokes > 0) });
    Report::with_words(json!({ "drawing": drawing }), &words, layout)
}

/// Reports the duration of a flight, its tracking error over the letters (or in the air if there
/// are no letters), the final values of the simulator's columns, and its digest. The tracking error
/// is null, and the text says why, if the drone never left the floor or has no design. `known` is
/// the tracking error if it has already been computed.
pub(super) fn flight_report(flight: &Flight, sha256: &str, known: Option<Tracking>) -> Report {
    let tracking = known.map_or_else(|| track(flight, Part::from_flight(flight)), Ok);
    let mut words = json!({ "lead": null, "why": null });
    let mut figures = match &tracking {
        Ok(tracking) => {
            let is_ahead = tracking.lag_s < LEAD_S;
            words["lead"] = is_ahead.then_some("a lead: ahead of its design").into();
            tracking_json(tracking)
        }
        Err(error) => {
            let why = match on_floor(flight) {
                Some(why) => format!("on the floor: {why}"),
                None => format!("no tracking error: {error}"),
            };
            words["why"] = why.into();
            json!({ "part": null, "rmse_m": null, "lag_s": null, "contour": null })
        }
    };
    // The duration is measured from the first sample, because each flight has its own clock.
    let begins_s = flight.samples.first().map_or(0.0, |first| first.time_s);
    let lasts_s = flight.samples.last().map_or(0.0, |last| on_grid(last.time_s - begins_s));
    figures["duration_s"] = lasts_s.into();
    for column in [SATURATED_S, BATTERY_V, ENERGY_J] {
        if let Some(last) = flight.at_end(column) {
            figures[column] = last.into();
        }
    }
    figures["sha256"] = sha256.into();
    // Figures that a flight lacks are set to null, so that the layout omits them.
    for key in ["rmse_after_lag_m", "least_cap_height_m", BATTERY_V, ENERGY_J] {
        words[key] = json!(figures.get(key));
    }
    Report::with_words(figures, &words, FLIGHT)
}

/// Lag, in s, below which it is called a lead. In this time, the drone writes 4 mm of a stroke.
pub(super) const LEAD_S: f64 = -0.02;

const FLIGHT: &str = "\
flight    {duration_s:.1} s, RMSE ({part}): x {rmse_m.0:.3}  y {rmse_m.1:.3}  z {rmse_m.2:.3} m
          lag {lag_s:.2} s[ ({lead})], contour error {contour.mean_m:.3} m (mean), {contour.max_m:.3} m (max)
flight    {duration_s:.1} s, {why}
height    RMSE {rmse_after_lag_m.2:.3} m without the lag: enough for letters of {least_cap_height_m:.2} m and more
battery   {battery_v:.2} V at the end, {energy_j:.0} J used
digest    {sha256}
";

/// Reports the aperture and the ISO, with the light meter's readings if the meter set them.
pub(super) fn camera(shot: &Shot) -> Report {
    let Camera { f_number, iso, .. } = shot.camera;
    let why = "so that a long exposure leaves the room dark";
    let words = json!({
        "help": shot.metered.and_then(|metered| metered.help()),
        "why": shot.metered.filter(|metered| metered.keeps_room_dark).map(|_| why),
    });
    let product =
        json!({ "camera": { "f_number": f_number, "iso": iso, "metered": shot.metered } });
    let layout = "camera    f/{camera.f_number}, ISO {camera.iso}[; metered: ambient \
                  {camera.metered.room_stops:+.1~dark}, trail {camera.metered.trail_stops:+.1} \
                  stops over saturation][: darker than wanted, {why}][; {help}]";
    Report::with_words(product, &words, layout)
}

/// Reports the device that computed the exposure.
pub(super) fn backend(shot: &Shot) -> Report {
    let product = json!({ "backend": shot.backend.name(), "adapter": shot.adapter });
    Report::with_layout(product, "exposed   by {backend} on {adapter}")
}

/// Returns tracking figures as JSON, with the errors in the word's plane added.
pub(super) fn tracking_json(tracking: &Tracking) -> Value {
    let mut json = json!(tracking);
    json["in_plane_rmse_m"] = tracking.in_plane_rmse_m().into();
    json["in_plane_rmse_after_lag_m"] = tracking.in_plane_rmse_after_lag_m().into();
    json["least_cap_height_m"] = tracking.least_cap_height_m().into();
    json
}

/// Converts a verdict to JSON, as in verdict.json (docs/reference/verdict.md). For a drawing, which
/// has no verdict, the keys of a verdict are missing.
pub(super) fn verdict_json(verdict: Option<&Verdict>, flight_sha256: Option<String>) -> Value {
    let mut json = serde_json::to_value(verdict).expect("a verdict is plain data");
    json["flight_sha256"] = flight_sha256.into();
    json
}
