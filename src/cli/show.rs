//! Tables and JSON that several verbs share.

use serde::Serialize;
use serde_json::{Value, json};

use super::outcome::{line, wrapped};
use super::table::table;
use crate::camera::Camera;
use crate::error::Result;
use crate::flight::tracking::{Part, Tracking, track};
use crate::flight::{BATTERY_V, ENERGY_J, Flight, SATURATED_S, on_floor};
use crate::letters::{Picture, Strokes};
use crate::report::{LEAST_SHARE, rivals};
use crate::score::{LetterVerdict, Reason, Verdict};
use crate::shoot::{Shot, in_stops};

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

/// The verdict in a sentence.
pub(super) fn verdict_sentence(verdict: &Verdict) -> String {
    sentence([&verdict.word, &verdict.read], verdict.legible, verdict.readability)
}

/// A word, what is read of it, and whether it counts.
pub(super) fn sentence(words: [&str; 2], legible: bool, readability: f64) -> String {
    let [word, read] = words.map(in_one_line);
    let legible = if legible { "legible" } else { "NOT legible" };
    format!("{word} reads as {read}: {legible} (readability {readability:.2})")
}

/// The lines of a text as one.
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

/// Figures of a flight, each computed once for people and for programs.
pub(super) struct FlightFigures<'a> {
    flight: &'a Flight,
    tracking: Result<Tracking>,
    sha256: String,
}

/// Adds the strokes of a drawing, and what its detail leaves out.
pub(super) fn add_drawing(strokes: &Strokes, text: &mut String, json: &mut Value) {
    if strokes.font.is_some() {
        return;
    }
    let (n, length_m, left_out) = (strokes.n_strokes(), strokes.length_m(), strokes.left_out);
    let mut drawn = format!("{n} strokes, {length_m:.2} m");
    if left_out.strokes > 0 {
        let share = 100.0 * left_out.share;
        drawn +=
            &format!("; left out: {} short ones, {share:.1} % of the length", left_out.strokes);
    }
    drawn += match strokes.picture {
        Picture::Auto => "",
        Picture::Drawing => "; ink on paper (for a photograph set letters.picture=photograph)",
        Picture::Photograph => {
            "; edges of a photograph (for ink on paper set letters.picture=drawing)"
        }
    };
    *text += &line("drawing", &drawn);
    let left_out = json!({ "strokes": left_out.strokes, "share": left_out.share });
    json["drawing"] = json!({ "strokes": n, "length_m": length_m, "left_out": left_out });
    if !strokes.warnings.is_empty() {
        json["drawing"]["warnings"] = json!(strokes.warnings);
    }
    if strokes.picture != Picture::Auto {
        json["drawing"]["picture"] = json!(strokes.picture.name());
    }
}

impl<'a> FlightFigures<'a> {
    /// Of a flight, its digest and its tracking errors, where they are known already.
    pub(super) fn new(flight: &'a Flight, sha256: String, known: Option<Tracking>) -> Self {
        let tracking = known.map_or_else(|| track(flight, Part::from_flight(flight)), Ok);
        Self { flight, tracking, sha256 }
    }

    /// Flight time, tracking error over the letters or, where none was written, in the air, and
    /// digest.
    pub(super) fn text(&self) -> String {
        let flight = self.flight;
        let duration_s = duration_s(flight);
        let digest = format!("digest    {}\n", self.sha256);
        let tracking = match &self.tracking {
            Ok(tracking) => tracking,
            Err(error) => {
                let why = on_floor(flight).map_or_else(
                    || format!("no tracking error: {error}"),
                    |why| format!("on the floor: {why}"),
                );
                return line("flight", &format!("{duration_s:.1} s, {why}")) + &digest;
            }
        };
        let (rmse, lag_s, contour) = (tracking.rmse_m, tracking.lag_s, tracking.contour);
        let battery = flight.at_end(BATTERY_V).zip(flight.at_end(ENERGY_J));
        let battery = battery.map_or_else(String::new, |(volts, joules)| {
            line("battery", &format!("{volts:.2} V at the end, {joules:.0} J used"))
        });
        let (part, max_m) = (in_part(tracking.part), contour.max_m);
        let (height_m, least_m) = (tracking.rmse_after_lag_m.z, tracking.least_cap_height_m());
        let height = line(
            "height",
            &format!(
                "RMSE {height_m:.3} m without the lag: enough for letters of {least_m:.2} m and more"
            ),
        );
        format!(
            "flight    {duration_s:.1} s, RMSE {part}: x {:.3}  y {:.3}  z {:.3} m\n          lag \
             {lag_s:.2} s, contour error {:.3} m (mean), {max_m:.3} m (max)\n{height}{battery}{digest}",
            rmse.x, rmse.y, rmse.z, contour.mean_m,
        )
    }

    /// Flight time, tracking error and final values of the simulator's own columns for programs;
    /// the error is null where the drone never left the floor.
    pub(super) fn json(&self) -> Value {
        let flight = self.flight;
        let nothing = ["part", "rmse_m", "lag_s", "contour"].map(|key| (key, Value::Null));
        let mut json = match &self.tracking {
            Ok(tracking) => json!(TrackingFigures::from(tracking)),
            Err(_) => nothing.into_iter().collect(),
        };
        json["duration_s"] = duration_s(flight).into();
        for column in [SATURATED_S, BATTERY_V, ENERGY_J] {
            if let Some(last) = flight.at_end(column) {
                json[column] = last.into();
            }
        }
        json["sha256"] = self.sha256.as_str().into();
        json
    }
}

/// Aperture and sensitivity, and what the meter found.
pub(super) fn camera_line(shot: &Shot) -> String {
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
    line("camera", &format!("f/{f_number}, ISO {iso}{metered}"))
}

/// Camera settings for programs; `metered` is null where the meter did not set them.
pub(super) fn camera_json(shot: &Shot) -> Value {
    let Camera { f_number, iso, .. } = shot.camera;
    json!({ "f_number": f_number, "iso": iso, "metered": shot.metered })
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

/// The final value of one of the simulator's own columns.
fn duration_s(flight: &Flight) -> f64 {
    flight.samples.last().map_or(0.0, |last| last.time_s)
}
