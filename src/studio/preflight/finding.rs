//! Findings: what a check measured.

use serde::Serialize;

use crate::scene::SceneAdvice;
use crate::shoot::Problem;
use noctograph_core::flight::Warning;
use noctograph_export::Memory;
use noctograph_export::safety::Battery;
use noctograph_flying::plan::{Approach, StrokeEnd};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Within its limit.
    #[default]
    Fine,
    /// Not checked: there is nothing to judge by.
    Unknown,
    /// It flies, but the picture suffers, or the drone cannot be commanded in some way.
    Warning,
    /// It should not fly.
    Stop,
}

/// Something outside of its room.
#[derive(Clone, Debug, PartialEq)]
pub struct OutOfRoom {
    /// What it is.
    pub what: String,
    /// Where it stands, m.
    pub place_m: [f64; 3],
    /// Distance from the room where it is farthest outside, m.
    pub by_m: f64,
    /// How bad that is: a camera may look in through a door.
    pub severity: Severity,
}

/// The largest of some values, and its limit, both in the unit of the finding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// The value.
    pub value: f64,
    /// Its limit.
    pub most: f64,
    /// When it occurs first.
    pub time_s: Option<f64>,
}

/// What a check found.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// There is nothing to judge by.
    Unchecked {
        /// Name of the check.
        check: &'static str,
        /// Why it was not made.
        why: String,
        /// What it takes.
        wanted: &'static str,
        /// How to have it.
        advice: SceneAdvice,
    },
    /// Letters with a stroke that is drawn twice: the doubled length, m.
    DoubledStroke(Vec<(char, f64)>),
    /// Letters whose center lines lack a stroke of the typeface: its length, m.
    LostStroke(Vec<(char, f64)>),
    /// Letters whose light is on before the drone has reached them.
    Tail(Vec<char>),
    /// Letters without a dark move at either end.
    LightNeverOff(Vec<char>),
    /// Letters with moves that do not join.
    PenJump(Vec<char>),
    /// Distance of the design from the volume where it is farthest outside.
    Volume {
        /// Negative: the least distance from its walls and ceiling.
        outside_m: f64,
        /// When.
        time_s: f64,
        /// Where; `None` for a plan without setpoints.
        position_m: Option<[f64; 3]>,
        /// The volume in words.
        volume: String,
    },
    /// Speed of the design, m/s.
    Speed(Peak),
    /// Acceleration of the design, m/s².
    Acceleration(Peak),
    /// Acceleration between the velocities of successive setpoints, where the plan has none of its
    /// own, m/s². These steps are not flown as they stand; a planned acceleration is.
    VelocityStep(Peak),
    /// Number of jumps of a setpoint from the design, and the largest, m.
    Jump(usize, Peak),
    /// Time in the air, s.
    FlightTime(Peak),
    /// The trajectory on board, compressed and as polynomials.
    Memory(Memory),
    /// The LED timing memory on board, which plays a ring alone.
    LedMemory {
        /// Entries that the lights take; `None` of other lamps.
        entries: Option<usize>,
        /// Entries that it has.
        most: usize,
    },
    /// Light commands that dim the headlights, which a pin switches.
    Headlights {
        /// Their number; `None`: no headlights are commanded.
        dimmed: Option<usize>,
        /// When the first is sent.
        first_s: Option<f64>,
    },
    /// The closest approach of two drones that are not above each other; `None`: they always are.
    Separation(Option<Approach>),
    /// The drone that is planned into the wake of another: its number, from 1, where it is nearest
    /// below it, and how much farther it flies from where it would be alone, m. `None`: there is
    /// none.
    Wake(Option<(usize, Approach)>, Peak),
    /// The flight does not reach its end: how it is lost.
    Flight(String),
    /// Distance of the flight from the word's plane, m, away from the viewer positive.
    Corridor(Peak),
    /// Cap height of the lowest letters that the drone holds its height well enough to write, m;
    /// its limit is the cap height of the word.
    AltitudeHold(Peak),
    /// Tilt, rad.
    Tilt(Peak),
    /// Time with a motor at its limit, s.
    Motors(Peak),
    /// What the flight takes of the battery, where its voltages are known; why it does not last;
    /// and the voltage under load that the firmware calls low, V.
    Battery {
        /// Voltages at rest and under load.
        taken: Option<Battery>,
        /// What the flight itself warned of.
        warning: Option<Warning>,
        /// The firmware's limit, V.
        low_v: f64,
    },
    /// Of a room: what stands outside of it.
    Frame {
        /// Each with its name, its place and how far outside it is, m.
        outside: Vec<OutOfRoom>,
        /// How many were looked at.
        n: usize,
    },
    /// Of a room: whether a camera square in front of the word has a place in it.
    CameraPlace {
        /// Distance from which the scene's camera shows the whole word, m.
        least_m: f64,
        /// Greatest distance that the room leaves, m.
        most_m: f64,
        /// The first camera of the shot plan that has a place.
        other: Option<String>,
    },
    /// Light error at a stroke's end where it is largest, and its limit, m.
    LitTransit(StrokeEnd, f64),
    /// Longest light on one spot, in seconds of full light.
    LitDwell(Peak),
    /// Range of the exposure along the brightest trail in the picture, from the 5th to the 95th
    /// percentile, in stops: that of the light meter. With the heading at which it would vary
    /// least, rad, and by how much there, where that is half a stop less.
    Evenness(Peak, Option<[f64; 2]>),
    /// Share of the flight's box that two base stations see.
    Coverage(f64),
    /// A problem of the picture; `None`: none was found.
    Picture(Option<Problem>),
}

impl Peak {
    pub(super) fn of(values: impl IntoIterator<Item = (f64, f64)>, most: f64) -> Self {
        let (value, time_s) = largest(values);
        Self { value, most, time_s: Some(time_s) }
    }
}

/// The largest of some values, with its time; zeros where there are none.
pub(super) fn largest(values: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    values.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

impl Finding {
    pub(super) fn unchecked(
        check: &'static str,
        why: impl ToString,
        wanted: &'static str,
        advice: &'static str,
    ) -> Self {
        Self::Unchecked { check, why: why.to_string(), wanted, advice: SceneAdvice(advice) }
    }
}
