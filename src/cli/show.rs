//! Tables and JSON that several verbs share.

use serde::Serialize;

use super::{Report, Value, json, line, table, wrapped};
use crate::camera::Camera;
use crate::flight::{BATTERY_V, ENERGY_J, Flight, SATURATED_S, on_floor};
use crate::letters::Strokes;
use crate::report::{LEAST_SHARE, rivals};
use crate::score::{LetterVerdict, Reason, Verdict};
use crate::shoot::{Shot, in_stops};
use crate::tracking::{Part, Tracking, track};

/// The verdict: lines for the word, a row for each letter, advice.
pub fn verdict_table(verdict: &Verdict) -> String {
    let mut text = wrapped("", &verdict_sentence(verdict));
    if let Some(reason) = verdict.reason {
        text += &line("because", &in_words(reason, verdict));
    }
    if let Some(rival) = verdict.rival.as_ref().filter(|rival| rival.p >= LEAST_SHARE) {
        text += &line("rival", &format!("{}, share {:.2}", in_one_line(&rival.word), rival.p));
    }
    if let Some(faithfulness) = verdict.faithfulness {
        let scale = "(1: every stroke is lit, and nothing else)";
        text += &line("faithful", &format!("{faithfulness:.2} {scale}"));
    }
    if verdict.is_contradicted() {
        let second = verdict.second_opinion.as_deref().filter(|text| !text.is_empty());
        text += &line("blind", &format!("reads {}", in_one_line(second.unwrap_or("nothing"))));
    }
    text += "\n";
    text += &table("letter<10|share<7|best<7|rivals<0", verdict.letters.iter().map(row));
    for (index, advice) in verdict.advice.iter().enumerate() {
        let gain = advice.gain.map_or("?".to_owned(), |gain| format!("{gain:+.2}"));
        text += if index == 0 { "\ngain\n" } else { "" };
        text += &wrapped(&format!("{gain:6}"), &advice.text);
    }
    text
}

pub(super) fn verdict_sentence(verdict: &Verdict) -> String {
    sentence([&verdict.word, &verdict.read], verdict.legible, verdict.readability)
}

/// A word, what is read of it, and whether it counts.
pub(super) fn sentence(words: [&str; 2], legible: bool, readability: f64) -> String {
    let [word, read] = words.map(in_one_line);
    let legible = if legible { "legible" } else { "NOT legible" };
    format!("{word} reads as {read}: {legible} (readability {readability:.2})")
}

fn in_one_line(text: &str) -> String {
    text.replace('\n', " ")
}

/// A letter, its share, what is seen instead, and likely other letters.
fn row(letter: &LetterVerdict) -> String {
    let expected = letter.expected;
    let Some(p) = letter.p else { return format!("{expected}\tnot judged") };
    let best = letter.best.unwrap_or('-');
    format!("{expected}\t{p:.2}\t{best}\t{}", rivals(letter))
}

fn in_words(reason: Reason, verdict: &Verdict) -> String {
    let text = match reason {
        Reason::NotInPhoto => "the photo does not show the place of the word",
        Reason::NoLight => "there is no light in the place of the word",
        Reason::TooSmall => "its letters are less than 20 pixels high",
        Reason::OutOfRange => "it is too far from its place, or too large or too small",
        Reason::OtherLength => "the photo shows a word of another length",
        Reason::Misread => match verdict.rival.as_ref().filter(|rival| rival.p > 0.5) {
            Some(rival) => return format!("{} is likelier", in_one_line(&rival.word)),
            None => "a letter looks like another one, or like none",
        },
        Reason::Unsure => {
            "each letter is the likeliest in its place, but the readability is too low to count"
        }
    };
    text.to_owned()
}

/// Adds the strokes of a drawing, and what its detail leaves out.
pub(super) fn tell_drawing(report: &mut Report, strokes: &Strokes) {
    if strokes.font.is_some() {
        return;
    }
    let (n, length_m, left_out) = (strokes.n_strokes(), strokes.length_m(), strokes.left_out);
    let mut text = format!("{n} strokes, {length_m:.2} m");
    if left_out.strokes > 0 {
        let percent = 100.0 * left_out.share;
        text +=
            &format!("; left out: {} short ones, {percent:.1} % of the length", left_out.strokes);
    }
    let left_out = json!({ "strokes": left_out.strokes, "share": left_out.share });
    let mut json = json!({ "strokes": n, "length_m": length_m, "left_out": left_out });
    if !strokes.warnings.is_empty() {
        json["warnings"] = json!(strokes.warnings);
    }
    report.figure("drawing", json, "drawing", &text);
}

/// Figures of a flight with its digest and, where they are known already, its tracking errors: the
/// flight time; the tracking error over the letters, or in the air if there are none; for programs,
/// the last values of the simulator's own columns. The error is null if the drone never left the
/// floor.
pub(super) fn flight_report(flight: &Flight, sha256: &str, known: Option<Tracking>) -> Report {
    let tracking = known.map_or_else(|| track(flight, Part::from_flight(flight)), Ok);
    let duration_s = flight.samples.last().map_or(0.0, |last| last.time_s);
    let mut report = Report::empty();
    match &tracking {
        Ok(tracking) => {
            let (rmse, contour) = (tracking.rmse_m, tracking.contour);
            let (part, lag_s) = (in_part(tracking.part), tracking.lag_s);
            let errors = format!(
                "{duration_s:.1} s, RMSE {part}: x {:.3}  y {:.3}  z {:.3} m\nlag {lag_s:.2} s, \
                 contour error {:.3} m (mean), {:.3} m (max)",
                rmse.x, rmse.y, rmse.z, contour.mean_m, contour.max_m
            );
            report.line("flight", &errors);
            let height = format!(
                "RMSE {:.3} m without the lag: enough for letters of {:.2} m and more",
                tracking.rmse_after_lag_m.z,
                tracking.least_cap_height_m()
            );
            report.line("height", &height);
            if let Some((volts, joules)) = flight.at_end(BATTERY_V).zip(flight.at_end(ENERGY_J)) {
                let battery = format!("{volts:.2} V at the end, {joules:.0} J used");
                report.line("battery", &battery);
            }
            report.json = json!(TrackingFigures::from(tracking));
        }
        Err(error) => {
            let why = match on_floor(flight) {
                Some(why) => format!("on the floor: {why}"),
                None => format!("no tracking error: {error}"),
            };
            report.line("flight", &format!("{duration_s:.1} s, {why}"));
            for key in ["part", "rmse_m", "lag_s", "contour"] {
                report.value(key, Value::Null);
            }
        }
    }
    report.value("duration_s", duration_s);
    for column in [SATURATED_S, BATTERY_V, ENERGY_J] {
        if let Some(last) = flight.at_end(column) {
            report.value(column, last);
        }
    }
    report.figure("sha256", sha256, "digest", sha256);
    report
}

/// Adds aperture and sensitivity, and what the meter found; null where it did not set them.
pub(super) fn tell_camera(report: &mut Report, shot: &Shot) {
    let Camera { f_number, iso, .. } = shot.camera;
    let metered = shot.metered.map_or_else(String::new, |metered| {
        let room = metered.room_stops.map_or("dark".to_owned(), in_stops);
        let gave_way = if metered.gave_way {
            ": darker than wanted, so that a long exposure leaves the room dark"
        } else {
            ""
        };
        let trail = in_stops(metered.trail_stops);
        let help = metered.help().map_or_else(String::new, |help| format!("; {help}"));
        format!("; metered: ambient {room}, trail {trail}{gave_way}{help}")
    });
    let json = json!({ "f_number": f_number, "iso": iso, "metered": shot.metered });
    report.figure("camera", json, "camera", &format!("f/{f_number}, ISO {iso}{metered}"));
}

/// Adds what computed the exposure.
pub(super) fn tell_backend(report: &mut Report, shot: &Shot) {
    let (backend, adapter) = (shot.backend.name(), &shot.adapter);
    report.value("backend", backend);
    report.figure("adapter", adapter, "exposed", &format!("by {backend} on {adapter}"));
}

/// Figures of tracking for programs.
#[derive(Serialize)]
pub(super) struct TrackingFigures<'a> {
    #[serde(flatten)]
    tracking: &'a Tracking,
    in_plane_rmse_m: f64,
    in_plane_rmse_after_lag_m: f64,
    least_cap_height_m: f64,
}

impl<'a> From<&'a Tracking> for TrackingFigures<'a> {
    fn from(tracking: &'a Tracking) -> Self {
        Self {
            tracking,
            in_plane_rmse_m: tracking.in_plane_rmse_m(),
            in_plane_rmse_after_lag_m: tracking.in_plane_rmse_after_lag_m(),
            least_cap_height_m: tracking.least_cap_height_m(),
        }
    }
}

/// A part of a flight, after a figure.
pub(super) fn in_part(part: Part) -> &'static str {
    match part {
        Part::Letters => "over the letters",
        Part::Airborne => "in the air",
        Part::All => "overall",
    }
}

/// A verdict as in verdict.json and in every `--json`: see docs/reference/verdict.md. Without a
/// verdict, as of a drawing, its keys are left out.
pub(super) fn verdict_json(verdict: Option<&Verdict>, flight_sha256: Option<String>) -> Value {
    let mut json = serde_json::to_value(verdict).expect("a verdict is plain data");
    json["flight_sha256"] = flight_sha256.into();
    json
}
