//! Result of a check: numbers, severity, limits and advice. Each check words its own result.

use serde::Serialize;

use crate::scene::{Change, SceneAdvice};
use noctograph_core::flight::DroneIndex;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Within its limit.
    #[default]
    Fine,
    /// Not checked, for lack of data.
    Unknown,
    /// It flies, but the picture suffers, or the drone cannot be commanded in some way.
    Warning,
    /// It should not fly.
    Stop,
}

/// A finding of one drone, or of all.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checked {
    /// The drone, where there are several and it concerns one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drone: Option<DroneIndex>,
    /// What was found.
    #[serde(flatten)]
    pub row: Row,
}

impl Checked {
    /// The finding, with the number of its drone if there are several.
    pub fn finding(&self) -> String {
        let number = self.drone.map_or_else(String::new, |drone| format!("drone {drone}: "));
        number + &self.row.found
    }

    /// Mark of severity, name of the check, and finding; wanted value and advice, with each change
    /// as `typed` writes it, are empty for a passed check.
    pub fn cells(&self, typed: impl Fn(&Change) -> String) -> [String; 5] {
        let row = &self.row;
        let (mark, wanted) = match row.severity {
            Severity::Fine => ("ok", ""),
            Severity::Unknown => ("?", &*row.wanted),
            Severity::Warning => ("warn", &*row.wanted),
            Severity::Stop => ("STOP", &*row.wanted),
        };
        [mark.into(), row.check.into(), self.finding(), wanted.into(), row.change(typed)]
    }
}

/// A finding as a row of a table: its numbers and its sentences.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Name of the check.
    pub check: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// Measured value in the unit of the check; `None` where there is none.
    pub value: Option<f64>,
    /// Limit of the value; 0 where there is none.
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
    /// Subject of the value: letters, a volume, forms of export, an end of a stroke; or a reason.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub detail: String,
    /// What was found.
    pub found: String,
    /// The limit in words.
    pub wanted: String,
    /// Advice beyond the limit.
    #[serde(skip)]
    pub advice: SceneAdvice,
}

impl Row {
    /// Advice, with each change as `typed` writes it; empty for a passed check.
    pub fn change(&self, typed: impl Fn(&Change) -> String) -> String {
        match self.severity {
            Severity::Fine => String::new(),
            _ => self.advice.sentence(typed),
        }
    }

    pub(super) fn new(
        check: &'static str,
        severity: Severity,
        value: impl Into<Option<f64>>,
    ) -> Self {
        Self { check, severity, value: value.into(), ..Self::default() }
    }

    /// The limit of the value.
    pub(super) fn within(self, limit: f64) -> Self {
        Self { limit, ..self }
    }

    /// When the value occurs.
    pub(super) fn timed(self, time_s: impl Into<Option<f64>>) -> Self {
        Self { time_s: time_s.into(), ..self }
    }

    /// Sets the value's subject, or a reason.
    pub(super) fn detailed(self, detail: impl Into<String>) -> Self {
        Self { detail: detail.into(), ..self }
    }

    /// A check that was not made: reason, needed data, and advice.
    pub(super) fn unchecked(
        check: &'static str,
        why: impl ToString,
        wanted: &'static str,
        advice: &'static str,
    ) -> Self {
        let (row, why) = (Self::new(check, Severity::Unknown, None), why.to_string());
        let actual = format!("not checked: {why}");
        row.detailed(why).say(actual, wanted, advice)
    }

    /// Sets the texts: finding, wanted value and advice.
    pub(super) fn say(
        self,
        found: impl Into<String>,
        wanted: impl Into<String>,
        advice: &'static str,
    ) -> Self {
        Self { found: found.into(), wanted: wanted.into(), advice: SceneAdvice(advice), ..self }
    }
}

/// The largest of some values, with its time; zeros where there are none.
pub(super) fn largest(values: impl IntoIterator<Item = (f64, f64)>) -> (f64, f64) {
    values.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default()
}

/// A time in a sentence.
pub(super) fn at_time(time_s: impl Into<Option<f64>>) -> String {
    time_s.into().map_or(String::new(), |time_s| format!(" at {time_s:.1} s"))
}

pub(super) fn warn_if(bad: bool) -> Severity {
    if bad { Severity::Warning } else { Severity::Fine }
}

pub(super) fn stop_if(bad: bool) -> Severity {
    if bad { Severity::Stop } else { Severity::Fine }
}
