//! Why a letter is at risk, and what its mending would gain.

use serde::Serialize;

/// A fault that the photo shows, and what the letter would gain without it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// What it is.
    pub kind: CauseKind,
    /// Index of the letter, from 0; `None` where it is the whole word's.
    pub letter: Option<usize>,
    /// How long, or how far, in the plane of the word.
    pub length_mm: Option<f64>,
    /// Where: its middle, to the right of the word's plane's zero and up.
    pub at_m: Option<[f64; 2]>,
    /// The run of the pen, from 0, and from where to where along it, where a part is missing.
    pub missing: Option<MissingRun>,
    /// How late the lamp went off, where light leads from stroke to stroke and the speed is known.
    pub lamp_delay_s: Option<f64>,
    /// The letter that it looks like, where the design is at fault.
    pub reads_as: Option<char>,
    /// What the letter's share in the choice would gain without it, −1 to 1: the photo was read
    /// again with the fault taken out. `None` where it cannot be taken out.
    pub gain: Option<f64>,
}

/// A part of an intended stroke without light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MissingRun {
    /// The run of the pen within the letter, from 0.
    pub stroke: usize,
    /// From there.
    pub from_mm: f64,
    /// To there.
    pub to_mm: f64,
}

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// A part of a stroke has no light.
    MissingRun,
    /// Light leads from one stroke to the next, where it should be off.
    LitTransit,
    /// Light comes from the floor or goes there.
    Streak,
    /// A spot of light beside the strokes: the drone stood there.
    DwellBlob,
    /// A neighbour's stroke reaches into the letter.
    Overlap,
    /// Other light beside the strokes.
    OtherStray,
    /// The letter stands beside its place.
    Shifted,
    /// Lines are much wider than a pen: without their glow the letter would read otherwise.
    Glow,
    /// Too few pixels to a letter.
    FewPixels,
    /// The light is hardly brighter than the noise.
    Dim,
    /// The letter, drawn without fault, looks like another one: its font's fault.
    Design,
    /// Light runs beside the intended strokes: the drone flew beside its path.
    OffPath,
}

/// A sentence of advice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advice {
    /// What it mends.
    pub kind: CauseKind,
    /// What to do, for people.
    pub text: String,
    /// What the word's probability would gain, 0 to 1: the photo was read again with all faults of
    /// the kind taken out. `None` where they cannot be taken out.
    pub gain: Option<f64>,
}

/// What is known of the flight, where it is known: plain numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// Speed along the strokes.
    pub speed_m_s: Option<f64>,
    /// Mean distance off the path.
    pub contour_m: Option<f64>,
    /// Time by which the drone trails.
    pub lag_s: Option<f64>,
}

/// The sentence for all faults of a kind.
pub(super) fn sentence(
    kind: CauseKind,
    causes: &[&Cause],
    letters: &[char],
    known: &Known,
) -> String {
    let mut named: Vec<String> = Vec::new();
    for index in causes.iter().filter_map(|cause| cause.letter) {
        let name = format!("{} ({})", letters[index], index + 1);
        if !named.contains(&name) {
            named.push(name);
        }
    }
    let who = named.join(", ");
    let length_mm: f64 = causes.iter().filter_map(|cause| cause.length_mm).sum();
    let most_mm = causes.iter().filter_map(|cause| cause.length_mm).fold(0.0, f64::max);
    let delays = causes.iter().filter_map(|cause| cause.lamp_delay_s).fold(0.0, f64::max);
    match kind {
        CauseKind::MissingRun => format!(
            "Keep the light on to the end of the stroke in {who}: {length_mm:.0} mm are missing{}.",
            known.lag_s.map_or(String::new(), |lag_s| format!(
                "; the drone trails by {lag_s:.2} s, so switch that much later"
            ))
        ),
        CauseKind::LitTransit if delays > 0.0 => format!(
            "Switch the light off earlier between strokes of {who}: {length_mm:.0} mm of transit are \
             lit, as by a lamp {:.0} ms late.",
            1000.0 * delays
        ),
        CauseKind::LitTransit => format!(
            "Switch the light off between strokes of {who}: {length_mm:.0} mm of transit are lit."
        ),
        CauseKind::Streak => format!(
            "Keep the light off while the drone comes and goes: a streak of {length_mm:.0} mm at {who}."
        ),
        CauseKind::DwellBlob => {
            format!("Do not wait with the light on: a spot beside {who}.")
        }
        CauseKind::Overlap => format!("Leave more room beside {who}: a neighbour reaches in."),
        CauseKind::OtherStray => format!(
            "Take out stray light at {who}: {length_mm:.0} mm of it (status lights, the ring, a lamp \
             in the room)."
        ),
        CauseKind::Shifted => {
            format!("Bring {who} to its place: it stands up to {most_mm:.0} mm beside it.")
        }
        CauseKind::Glow => format!(
            "Expose less, or focus: lines up to {most_mm:.0} mm wide close the shapes of {who}."
        ),
        CauseKind::FewPixels => {
            "Come nearer or take a longer lens: letters have few pixels.".into()
        }
        CauseKind::Dim => "Expose more, or darken the room: light hardly stands out.".into(),
        CauseKind::Design => {
            let alike = causes.iter().filter_map(|cause| {
                let letter = letters[cause.letter?];
                Some(format!("{letter} is read as {}", cause.reads_as?))
            });
            let mut alike: Vec<String> = alike.collect();
            alike.dedup();
            format!(
                "Choose another font, or draw {who} otherwise: this font's {}.",
                alike.join(", ")
            )
        }
        CauseKind::OffPath => format!(
            "Fly nearer the path in {who}: light runs up to {most_mm:.0} mm beside the strokes{}.",
            known.contour_m.map_or(String::new(), |contour_m| format!(
                "; the log says {:.0} mm on average",
                1000.0 * contour_m
            ))
        ),
    }
}
