//! Kinds of faults in a photo, and the sentences of advice about them.

use serde::{Deserialize, Serialize};

use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::distance;
use noctograph_core::statistics::sort_by_number;

/// A fault in the photo, and the gain if the fault is removed.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cause {
    /// Kind of the fault.
    pub kind: CauseKind,
    /// Index of the letter, from 0. `None` if the fault concerns the whole word.
    pub letter: Option<usize>,
    /// Length, distance or width of the fault, in the plane of the word.
    pub length_mm: Option<f64>,
    /// Center of the fault in the plane of the word: x to the right and y upward.
    pub at_m: Option<[f64; 2]>,
    /// The missing part of a stroke, if the fault is one.
    pub missing: Option<MissingRun>,
    /// Switching delay of the lamp, if light connects two strokes and the drone's speed is known.
    pub lamp_delay_s: Option<f64>,
    /// Start and end times of the log gap that caused a missing part of a stroke.
    pub log_gap_s: Option<[f64; 2]>,
    /// The letter that this one looks like, if the fault lies in the font's design.
    pub reads_as: Option<char>,
    /// Gain in the letter's probability, −1 to 1, if the photo is read without the fault. The gain
    /// is `None` if the fault cannot be removed.
    pub gain: Option<f64>,
}

impl Cause {
    /// Creates a fault of a kind, without measurements.
    pub(super) fn new(kind: CauseKind, letter: Option<usize>) -> Self {
        Self { kind, letter, ..Self::default() }
    }
}

/// A part of an intended stroke without light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MissingRun {
    /// Index of the run of the pen within the letter.
    pub stroke: usize,
    /// Position along the run where the missing part starts.
    pub from_mm: f64,
    /// Position along the run where the missing part ends.
    pub to_mm: f64,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// A part of a stroke has no light.
    #[default]
    MissingRun,
    /// A part of a stroke has no light because the flight's log has a gap at that part.
    LogGap,
    /// Light leads from one stroke to the next, although the lamp should be off in between.
    LitTransit,
    /// Light leads to or from the floor.
    Streak,
    /// A spot of light away from the strokes, because the drone waited at that point.
    DwellBlob,
    /// A stroke of a neighboring letter reaches into the letter.
    Overlap,
    /// Other light away from the strokes.
    OtherStray,
    /// The letter is displaced from its intended position.
    Shifted,
    /// Lines are much wider than the pen.
    Glow,
    /// The letters have too few pixels.
    FewPixels,
    /// The light is hardly brighter than the noise.
    Dim,
    /// The font's letter looks like another one even when it is drawn without fault.
    Design,
    /// Light runs beside the intended strokes, because the drone flew beside its path.
    OffPath,
}

/// A sentence of advice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advice {
    /// The kind of fault that the advice removes.
    pub kind: CauseKind,
    /// The advice as a sentence.
    pub text: String,
    /// Gain in readability, 0 to 1, if the photo is read without any fault of this kind. The gain
    /// is `None` if such faults cannot be removed.
    pub gain: Option<f64>,
}

/// A gap in the log of a flight. It is dark in photos, because the lamps' position is unknown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogGap {
    /// Times of the last sample before the gap and the first one after it, on the flight's clock.
    pub span_s: [f64; 2],
    /// Positions of the drone at the ends of the gap, in the plane of the word.
    pub ends_m: [[f64; 2]; 2],
    /// Length of the longest path that the lamps can have taken during the gap.
    pub way_m: f64,
}

impl LogGap {
    /// Parses the gaps in a photo's metadata. `place` names the metadata in error messages.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] if the text does not describe log gaps.
    pub fn parse(json: &str, place: &str) -> Result<Vec<Self>> {
        serde_json::from_str(json).map_err(|error| {
            let hint = "expose the flight again";
            Error::input(place, error, "the gaps of a flight's log", hint)
        })
    }

    /// True if the lamps can have been at a point during the gap. Such points form an ellipse whose
    /// foci are the drone's positions at the ends of the gap.
    pub(super) fn may_hold(&self, point_m: [f64; 2]) -> bool {
        let distances_m = self.ends_m.iter().map(|end| distance(*end, point_m));
        distances_m.sum::<f64>() <= self.way_m
    }
}

/// Known properties of the flight.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Known {
    /// Speed of the drone along the strokes.
    pub speed_m_s: Option<f64>,
    /// Mean distance of the drone from its path.
    pub contour_m: Option<f64>,
    /// Lag of the drone behind its setpoints.
    pub lag_s: Option<f64>,
    /// Gaps in the log that are dark in the photo, sorted by time.
    pub gaps: Vec<LogGap>,
}

/// Minimum lag behind the setpoints that advice mentions.
const LEAST_LAG_S: f64 = 0.02;

/// Returns the sentence of advice about all faults of a kind. `causes` are these faults, and
/// `letters` the characters of the word.
pub(super) fn sentence(
    kind: CauseKind,
    causes: &[&Cause],
    letters: &[char],
    known: &Known,
) -> String {
    use CauseKind as Kind;

    // Lengths of missing or extra light are summed. For distances and widths, the maximum is given.
    let named_letters = named_letters(causes, letters);
    let length_mm: f64 = causes.iter().filter_map(|cause| cause.length_mm).sum();
    let most_mm = causes.iter().filter_map(|cause| cause.length_mm).fold(0.0, f64::max);
    let delays = causes.iter().filter_map(|cause| cause.lamp_delay_s).fold(0.0, f64::max);
    let lag_s = known.lag_s.filter(|lag_s| *lag_s >= LEAST_LAG_S);
    match kind {
        Kind::MissingRun => format!(
            "Keep the light on to the end of the stroke in {named_letters}: {length_mm:.0} mm are missing{}.",
            lag_s.map_or(String::new(), |lag_s| format!(
                ". The drone lags by {lag_s:.2} s, so switch the light off that much later"
            ))
        ),
        Kind::LogGap => format!(
            "{length_mm:.0} mm of {named_letters} are missing because the log of the flight has a gap there \
             ({}), not because of the lamps. Log fewer variables, or log to the \u{b5}SD card.",
            gap_times(causes)
        ),
        // If the drone lags, light between strokes does not reveal the lamp's delay.
        Kind::LitTransit if delays > 0.0 && lag_s.is_none() => format!(
            "Switch the light off earlier between strokes of {named_letters}: {length_mm:.0} mm of transit are \
             lit, as if the lamp were {:.0} ms late.",
            1000.0 * delays
        ),
        Kind::LitTransit => format!(
            "Switch the light off between strokes of {named_letters}: {length_mm:.0} mm of transit are lit."
        ),
        Kind::Streak => format!(
            "Keep the light off while the drone arrives and leaves: there is a streak of {length_mm:.0} mm at \
                {named_letters}."
        ),
        Kind::DwellBlob => {
            format!("Do not wait with the light on: there is a spot beside {named_letters}.")
        }
        Kind::Overlap => format!(
            "Leave more room beside {named_letters}, because a neighboring letter overlaps."
        ),
        Kind::OtherStray => format!(
            "Remove {length_mm:.0} mm of stray light at {named_letters}, for example from status lights, the \
             ring, or a lamp in the room."
        ),
        Kind::Shifted => format!(
            "Correct the position of {named_letters}, which is off by up to {most_mm:.0} mm."
        ),
        Kind::Glow => format!(
            "Expose less, or focus better: lines up to {most_mm:.0} mm wide fill the gaps in {named_letters}."
        ),
        Kind::FewPixels => {
            "Move the camera closer, or use a longer lens: the letters have too few pixels.".into()
        }
        Kind::Dim => "Expose more, or darken the room: the light hardly stands out.".into(),
        Kind::Design => format!(
            "Choose another font, or draw {named_letters} differently: in this font, {}.",
            confused_letters(causes, letters)
        ),
        Kind::OffPath => format!(
            "Fly closer to the path in {named_letters}: light is up to {most_mm:.0} mm away from the strokes{}.",
            known.contour_m.map_or(String::new(), |contour_m| format!(
                ", and {:.0} mm on average according to the log",
                1000.0 * contour_m
            ))
        ),
    }
}

/// Returns the times of the log gaps in s as text, without duplicates.
fn gap_times(causes: &[&Cause]) -> String {
    let mut gap_times: Vec<[f64; 2]> = causes.iter().filter_map(|cause| cause.log_gap_s).collect();
    sort_by_number(&mut gap_times, |[from, _]| *from);
    gap_times.dedup();
    let texts = gap_times.iter().map(|[from, to]| format!("{from:.2} to {to:.2} s"));
    texts.collect::<Vec<_>>().join(", ")
}

/// Lists the letters of the causes as text, each with its position in the word from 1, without
/// duplicates.
fn named_letters(causes: &[&Cause], letters: &[char]) -> String {
    let mut names: Vec<String> = Vec::new();
    for index in causes.iter().filter_map(|cause| cause.letter) {
        let name = format!("{} ({})", letters[index], index + 1);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", ")
}

/// Returns text that names the misread letters and what each one is read as.
fn confused_letters(causes: &[&Cause], letters: &[char]) -> String {
    let confused_letters = causes.iter().filter_map(|cause| {
        Some(format!("{} is read as {}", letters[cause.letter?], cause.reads_as?))
    });
    let mut confused_letters: Vec<String> = confused_letters.collect();
    confused_letters.dedup();
    confused_letters.join(", ")
}
