//! Check: whether a plan should fly.
//!
//! Products in: letters, [`Plan`]s, and a simulated flight of each. Product out: [`Finding`]s
//! against the limits of a [`Profile`], within a room where its size is known. Not checked: obstacles
//! in the room.
//!
//! [`Plan`]: crate::plan::Plan

use serde::Serialize;

mod flown;
mod letters;
mod plans;
mod profile;
mod written;

pub use flown::{Flown, check_flown};
pub use letters::check_letters;
pub use plans::{check_plans, check_separation};
pub use profile::{Profile, ROOM_MARGIN_M};
pub use written::check_written;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Within its limit.
    Fine,
    /// Not checked: there is nothing to judge by.
    Unknown,
    /// It flies, but the picture suffers, or a way of flying it is closed.
    Warning,
    /// It should not fly.
    Stop,
}

/// A property that is checked, with the unit of its value and limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Check {
    /// Letters with a stroke that is drawn twice; each value is the doubled length in m.
    #[serde(rename = "doubled stroke")]
    DoubledStroke,
    /// Letters whose center lines lack a stroke of the typeface; each value is its length in m.
    #[serde(rename = "lost stroke")]
    LostStroke,
    /// Letters whose light is on before the drone has reached them.
    Tail,
    /// Letters without a dark move at either end.
    #[serde(rename = "light never off")]
    LightNeverOff,
    /// Letters with moves that do not join.
    #[serde(rename = "pen jump")]
    PenJump,
    /// Largest distance of the design outside the volume, m; negative: least distance from its
    /// walls and ceiling. The detail describes the volume.
    Volume,
    /// Largest speed of the design, m/s.
    Speed,
    /// Largest acceleration of the design, m/s².
    Acceleration,
    /// Largest acceleration between the velocities of successive setpoints, where the plan has no
    /// acceleration of its own, m/s².
    #[serde(rename = "acceleration")]
    VelocityStep,
    /// Largest jump of a setpoint from the design, m.
    Jump,
    /// Time in the air, s.
    #[serde(rename = "flight time")]
    FlightTime,
    /// Bytes of the compressed trajectory on board; its count is that of polynomial pieces.
    Memory,
    /// Entries of the LED timing memory on board, which plays a ring alone; no value: it plays none.
    #[serde(rename = "LED memory")]
    LedMemory,
    /// Light commands that dim the headlights, which a pin switches; no value: none is on board.
    Headlights,
    /// Least horizontal distance of two drones that are not above each other, m; no value: they
    /// always are.
    Separation,
    /// Whether the simulated flight reaches its end.
    Flight,
    /// Largest distance of the flight from the word's plane, m.
    Corridor,
    /// Cap height of the lowest letters that the drone holds its height well enough to write, m.
    #[serde(rename = "altitude hold")]
    AltitudeHold,
    /// Largest tilt, rad.
    Tilt,
    /// Time with a motor at its limit, s.
    Motors,
    /// Whether the battery lasts.
    Battery,
    /// Largest light error at a stroke's end, m.
    #[serde(rename = "lit transit")]
    LitTransit,
    /// Longest light on one spot, in seconds of full light.
    #[serde(rename = "lit dwell")]
    LitDwell,
    /// Range of the exposure along the brightest trail in the picture, from the 5th to the 95th
    /// percentile, in stops: that of the light meter.
    Evenness,
    /// Share of the flight's box that two base stations see.
    Coverage,
    /// What keeps the word from being read whatever its letters are: shutter, lamps, framing.
    Picture,
}

/// The result of one check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Number of the drone, from 1, where there are several and it concerns one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drone: Option<usize>,
    /// The property.
    pub check: Check,
    /// How bad it is.
    pub severity: Severity,
    /// Measured value in the unit of the property; `None` where it is unknown or nothing was found.
    pub value: Option<f64>,
    /// Limit of the value.
    pub limit: f64,
    /// Number of occurrences, where they are counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// When the value occurs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Where it occurs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Letters that are concerned, the simulator's message, or why it could not be checked.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub detail: String,
}

impl Finding {
    /// A value, of a severity where it is not good.
    pub fn new(check: Check, good: bool, bad: Severity, value: f64, limit: f64) -> Self {
        let severity = if good { Severity::Fine } else { bad };
        Self { value: Some(value), ..Self::without_value(check, severity, limit) }
    }

    /// A finding without a value.
    pub fn without_value(check: Check, severity: Severity, limit: f64) -> Self {
        let (drone, value, count, time_s, position_m) = (None, None, None, None, None);
        let detail = String::new();
        Self { drone, check, severity, value, limit, count, time_s, position_m, detail }
    }

    /// A property that could not be checked, and why.
    pub fn unchecked(check: Check, why: &str) -> Self {
        Self { detail: why.to_owned(), ..Self::without_value(check, Severity::Unknown, 0.0) }
    }

    fn at(self, time_s: f64) -> Self {
        Self { time_s: Some(time_s), ..self }
    }
}

/// The largest of some values, with its time; zeros where there are none.
fn largest(values: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    values.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

#[cfg(test)]
pub(crate) fn severity_of(findings: &[Finding], check: Check) -> Severity {
    findings.iter().find(|finding| finding.check == check).expect("it was checked").severity
}
