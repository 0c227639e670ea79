//! Causes of errors, and advice: the kinds of faults and the sentences about them.

use serde::{Deserialize, Serialize};

use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::distance;

/// A fault in the photo, and the letter's gain without it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cause {
    /// Its kind.
    pub kind: CauseKind,
    /// Index of the letter, from 0, or `None` if it concerns the whole word.
    pub letter: Option<usize>,
    /// Length, distance or width in the plane of the word.
    pub length_mm: Option<f64>,
    /// Its middle in the plane of the word, to the right and up.
    pub at_m: Option<[f64; 2]>,
    /// The part of a stroke that is missing.
    pub missing: Option<MissingRun>,
    /// Delay of the lamp, if light leads from stroke to stroke and the speed is known.
    pub lamp_delay_s: Option<f64>,
    /// First and last moment of the gap in the log that a part of a stroke is missing for.
    pub log_gap_s: Option<[f64; 2]>,
    /// The letter that it looks like, for a fault of design.
    pub reads_as: Option<char>,
    /// Gain in the letter's probability, −1 to 1, when the photo is read without the fault. `None`
    /// if the fault cannot be taken out.
    pub gain: Option<f64>,
}

impl Cause {
    /// A fault of a kind, without measures.
    pub(super) fn new(kind: CauseKind, letter: Option<usize>) -> Self {
        Self { kind, letter, ..Self::default() }
    }
}

/// A part of an intended stroke without light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MissingRun {
    /// The run of the pen within the letter, from 0.
    pub stroke: usize,
    /// Start along the run.
    pub from_mm: f64,
    /// End along the run.
    pub to_mm: f64,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// A part of a stroke has no light.
    #[default]
    MissingRun,
    /// A part of a stroke has no light, and the log of the flight has a gap there.
    LogGap,
    /// Light leads from one stroke to the next, where it should be off.
    LitTransit,
    /// Light comes from the floor or goes there.
    Streak,
    /// A spot of light beside the strokes, where the drone waited.
    DwellBlob,
    /// A neighbor's stroke reaches into the letter.
    Overlap,
    /// Other light beside the strokes.
    OtherStray,
    /// The letter is beside its place.
    Shifted,
    /// Lines are much wider than a pen.
    Glow,
    /// Too few pixels to a letter.
    FewPixels,
    /// The light is hardly brighter than the noise.
    Dim,
    /// Even drawn without fault, the letter looks like another one: a flaw of its font.
    Design,
    /// Light runs beside the intended strokes: the drone flew beside its path.
    OffPath,
}

/// A sentence of advice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advice {
    /// The kind of fault that it removes.
    pub kind: CauseKind,
    /// A sentence for people.
    pub text: String,
    /// Gain in readability, 0 to 1, when the photo is read without any fault of the kind. `None` if
    /// these cannot be taken out.
    pub gain: Option<f64>,
}

/// A gap in the log of a flight. Its photo is dark there: the place of the lamps is unknown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogGap {
    /// Last moment before it and first one after it, on the clock of the flight.
    pub span_s: [f64; 2],
    /// Where the drone was then, in the plane of the word, to the right and up.
    pub ends_m: [[f64; 2]; 2],
    /// Longest path that the lamps can have taken from the one to the other.
    pub way_m: f64,
}

impl LogGap {
    /// Gaps from the JSON in a photo of a log. `place` is their place in messages.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for any other text.
    pub fn parse(json: &str, place: &str) -> Result<Vec<Self>> {
        serde_json::from_str(json).map_err(|error| {
            let hint = "expose the flight again";
            Error::input(place, error, "the gaps of a flight's log", hint)
        })
    }

    /// True if the lamps can have been at a point then: within the ellipse about the ends.
    pub(super) fn may_hold(&self, at_m: [f64; 2]) -> bool {
        let away_m = self.ends_m.iter().map(|end| distance(*end, at_m));
        away_m.sum::<f64>() <= self.way_m
    }
}

/// Facts of the flight, as far as they are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Speed along the strokes.
    pub speed_m_s: Option<f64>,
    /// Mean distance off the path.
    pub contour_m: Option<f64>,
    /// Lag of the drone behind its setpoints.
    pub lag_s: Option<f64>,
    /// Gaps of its log that the photo leaves dark, in order of time.
    pub gaps: Vec<LogGap>,
}

/// Shorter lags of a drone behind its setpoints are not named.
const LEAST_LAG_S: f64 = 0.02;

/// The sentence for all faults of a kind.
pub(super) fn sentence(
    kind: CauseKind,
    causes: &[&Cause],
    letters: &[char],
    known: &Known,
) -> String {
    use CauseKind as Kind;

    // Lengths of missing or extra light add up. Of distances and widths, the greatest is named.
    let named = named(causes, letters);
    let length_mm: f64 = causes.iter().filter_map(|cause| cause.length_mm).sum();
    let most_mm = causes.iter().filter_map(|cause| cause.length_mm).fold(0.0, f64::max);
    let delays = causes.iter().filter_map(|cause| cause.lamp_delay_s).fold(0.0, f64::max);
    let lag_s = known.lag_s.filter(|lag_s| *lag_s >= LEAST_LAG_S);
    match kind {
        Kind::MissingRun => format!(
            "Keep the light on to the end of the stroke in {named}: {length_mm:.0} mm are missing{}.",
            lag_s.map_or(String::new(), |lag_s| format!(
                "; the drone lags by {lag_s:.2} s, so switch that much later"
            ))
        ),
        Kind::LogGap => format!(
            "{length_mm:.0} mm of {named} are missing because the log of the flight has a gap there \
             ({}), not because of the lamps: log fewer variables, or on the \u{b5}SD card.",
            spans(causes)
        ),
        // Behind a loop that lags, light between strokes says nothing about the lamp.
        Kind::LitTransit if delays > 0.0 && lag_s.is_none() => format!(
            "Switch the light off earlier between strokes of {named}: {length_mm:.0} mm of transit are \
             lit, as by a lamp {:.0} ms late.",
            1000.0 * delays
        ),
        Kind::LitTransit => format!(
            "Switch the light off between strokes of {named}: {length_mm:.0} mm of transit are lit."
        ),
        Kind::Streak => format!(
            "Keep the light off while the drone comes and goes: a streak of {length_mm:.0} mm at {named}."
        ),
        Kind::DwellBlob => format!("Do not wait with the light on: a spot beside {named}."),
        Kind::Overlap => format!("Leave more room beside {named}: a neighbor reaches in."),
        Kind::OtherStray => format!(
            "Take out stray light at {named}: {length_mm:.0} mm of it (status lights, the ring, a lamp \
             in the room)."
        ),
        Kind::Shifted => format!("Bring {named} into place: up to {most_mm:.0} mm away."),
        Kind::Glow => format!(
            "Expose less, or focus: lines up to {most_mm:.0} mm wide close the shapes of {named}."
        ),
        Kind::FewPixels => "Come nearer or take a longer lens: letters have few pixels.".into(),
        Kind::Dim => "Expose more, or darken the room: light hardly stands out.".into(),
        Kind::Design => format!(
            "Choose another font, or draw {named} otherwise: this font's {}.",
            alike(causes, letters)
        ),
        Kind::OffPath => format!(
            "Fly nearer the path in {named}: light runs up to {most_mm:.0} mm beside the strokes{}.",
            known.contour_m.map_or(String::new(), |contour_m| format!(
                "; the log says {:.0} mm on average",
                1000.0 * contour_m
            ))
        ),
    }
}

/// The times of the gaps in the log, each once.
fn spans(causes: &[&Cause]) -> String {
    let mut spans: Vec<[f64; 2]> = causes.iter().filter_map(|cause| cause.log_gap_s).collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    spans.dedup();
    let spans = spans.iter().map(|[from, to]| format!("{from:.2} to {to:.2} s"));
    spans.collect::<Vec<_>>().join(", ")
}

/// The letters that causes are about, with their places from 1, each once.
fn named(causes: &[&Cause], letters: &[char]) -> String {
    let mut names: Vec<String> = Vec::new();
    for index in causes.iter().filter_map(|cause| cause.letter) {
        let name = format!("{} ({})", letters[index], index + 1);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", ")
}

/// The letters whose design resembles others, and which.
fn alike(causes: &[&Cause], letters: &[char]) -> String {
    let alike = causes.iter().filter_map(|cause| {
        Some(format!("{} is read as {}", letters[cause.letter?], cause.reads_as?))
    });
    let mut alike: Vec<String> = alike.collect();
    alike.dedup();
    alike.join(", ")
}
