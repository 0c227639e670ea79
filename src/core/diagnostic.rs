//! Diagnostics, through which the program reports everything wrong, doubtful or improvable.
//!
//! A [`Diagnostic`] contains a code, to which programs and translations refer, a severity, a place,
//! a message, named figures, and help, which stores scene keys as data. Stages create diagnostics,
//! [`Warned`] returns them together with a product, and only callers print them.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Serialize, Serializer, ser::SerializeMap};

use crate::place::{DroneIndex, Place, Segment};

/// Severity of a diagnostic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The value is within its limit.
    #[default]
    Fine,
    /// The check could not be carried out, because data is missing.
    Unknown,
    /// The drone can fly, but the picture is affected, or the program guessed or omitted something.
    Warning,
    /// The drone should not fly, the word would be unreadable, or an input is refused.
    Stop,
}

/// Named value of a diagnostic.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Figure {
    /// Number, in the unit at the end of the figure's name.
    Number(f64),
    /// Number of items.
    Count(usize),
    /// Position in the world frame in m.
    Position([f64; 3]),
    /// Subject, such as letters or a volume.
    Text(String),
}

macro_rules! figure_from {
    ($($type:ty => $variant:ident,)*) => {$(
        impl From<$type> for Figure {
            fn from(value: $type) -> Self {
                Self::$variant(value.into())
            }
        }
    )*};
}
figure_from! { f64 => Number, usize => Count, [f64; 3] => Position, String => Text, &str => Text, }

/// Result of a check, or report of an event, such as a problem or a possible improvement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagnostic {
    /// Code, which is the name of a check (`lit transit`) or of an event (`shutter-closes`).
    pub code: &'static str,
    /// Severity of the problem.
    pub severity: Severity,
    /// Place of the problem, such as a file with a line, a key or a drone. The place may be empty.
    pub place: Place,
    /// Sentence that states what was found.
    pub message: String,
    /// Sentence that states what is wanted. The text may be empty.
    pub wanted: String,
    /// Figures by name. A check may have the figures `value` and `limit` in the same unit, `count`,
    /// `time_s`, `position_m`, and `detail`, which is its subject or a reason.
    pub figures: BTreeMap<&'static str, Figure>,
    /// Suggested action. The help may be empty.
    pub help: Help,
}

impl Diagnostic {
    /// Creates a diagnostic with a message.
    pub fn new(code: &'static str, severity: Severity, message: impl Into<String>) -> Self {
        Self { code, severity, message: message.into(), ..Self::default() }
    }

    /// Creates a warning.
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(code, Severity::Warning, message)
    }

    /// Creates a warning for each message, all with the same code.
    pub fn warnings(
        code: &'static str,
        messages: impl IntoIterator<Item: Into<String>>,
    ) -> Vec<Self> {
        messages.into_iter().map(|message| Self::warning(code, message)).collect()
    }

    /// Creates a check with its measured value, if there is one. [`Self::say`] adds the texts.
    pub fn check(code: &'static str, severity: Severity, value: impl Into<Option<f64>>) -> Self {
        Self::new(code, severity, "").with_some("value", value.into())
    }

    /// Creates a check that could not be carried out, with the reason, the missing data, and help.
    pub fn unchecked(
        code: &'static str,
        why: impl ToString,
        wanted: &'static str,
        help: &'static str,
    ) -> Self {
        let (check, why) = (Self::check(code, Severity::Unknown, None), why.to_string());
        let message = format!("not checked: {why}");
        check.with("detail", why).say(message, wanted, help)
    }

    /// Adds a figure.
    #[must_use]
    pub fn with(self, name: &'static str, figure: impl Into<Figure>) -> Self {
        self.with_some(name, Some(figure))
    }

    /// Adds a figure if there is one.
    fn with_some(mut self, name: &'static str, figure: Option<impl Into<Figure>>) -> Self {
        self.figures.extend(figure.map(|figure| (name, figure.into())));
        self
    }

    /// Adds the limit of the value.
    #[must_use]
    pub fn within(self, limit: f64) -> Self {
        self.with("limit", limit)
    }

    /// Adds the time at which the value occurs.
    #[must_use]
    pub fn timed(self, time_s: impl Into<Option<f64>>) -> Self {
        self.with_some("time_s", time_s.into())
    }

    /// Adds the position at which the value occurs.
    #[must_use]
    pub fn positioned(self, position_m: impl Into<Option<[f64; 3]>>) -> Self {
        self.with_some("position_m", position_m.into())
    }

    /// Adds the value's subject or a reason, unless the text is empty.
    #[must_use]
    pub fn detailed(self, detail: impl Into<String>) -> Self {
        self.with_some("detail", Some(detail.into()).filter(|detail| !detail.is_empty()))
    }

    /// Sets the message (what was found), what is wanted, and the help.
    #[must_use]
    pub fn say(
        self,
        message: impl Into<String>,
        wanted: impl Into<String>,
        help: &'static str,
    ) -> Self {
        Self { message: message.into(), wanted: wanted.into(), help: Help::from(help), ..self }
    }

    /// Sets the help. String literals contain scene keys in braces, as [`Help`] describes.
    #[must_use]
    pub fn helped(self, help: impl Into<Help>) -> Self {
        Self { help: help.into(), ..self }
    }

    /// Prepends the drone to the place, if there are several drones.
    #[must_use]
    pub fn of_drone(mut self, drone: impl Into<Option<DroneIndex>>) -> Self {
        self.place.0.splice(..0, drone.into().map(Segment::Drone));
        self
    }

    /// Prepends the file to the place.
    #[must_use]
    pub fn in_file(mut self, file: impl fmt::Display) -> Self {
        self.place.0.splice(..0, Place::file(file).0);
        self
    }

    /// True if the severity is [`Severity::Stop`].
    pub fn is_stop(&self) -> bool {
        self.severity == Severity::Stop
    }

    /// Returns the figure with this name in the unit of its check, or `None` if it is missing or
    /// not a number.
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.figures.get(name) {
            Some(Figure::Number(number)) => Some(*number),
            _ => None,
        }
    }

    /// Returns the figure `detail`, which names what the value belongs to or why nothing was
    /// checked, or an empty text if there is none.
    pub fn detail(&self) -> &str {
        match self.figures.get("detail") {
            Some(Figure::Text(text)) => text,
            _ => "",
        }
    }

    /// Returns the help as a sentence, with changes formatted by `format_change`. The sentence is
    /// empty for a passed check.
    pub fn change(&self, format_change: impl Fn(&Change) -> String) -> String {
        match self.severity {
            Severity::Fine => String::new(),
            _ => self.help.sentence(format_change),
        }
    }

    /// Returns the five cells of a row in a table of checks: severity, name, message, what is
    /// wanted, and help. The last two cells are empty for a passed check.
    pub fn cells(&self, format_change: impl Fn(&Change) -> String) -> [String; 5] {
        let (mark, wanted) = match self.severity {
            Severity::Fine => ("ok", ""),
            Severity::Unknown => ("?", &*self.wanted),
            Severity::Warning => ("warn", &*self.wanted),
            Severity::Stop => ("STOP", &*self.wanted),
        };
        [mark.into(), self.code.into(), self.to_string(), wanted.into(), self.change(format_change)]
    }

    /// Returns place, message and help in one line, with changes formatted by `format_change`.
    pub fn sentence(&self, format_change: impl Fn(&Change) -> String) -> String {
        match (self.change(format_change), self.severity) {
            (help, _) if help.is_empty() => self.to_string(),
            (help, Severity::Stop) => format!("{self}: {help}"),
            (help, _) => format!("{self} ({help})"),
        }
    }
}

impl fmt::Display for Diagnostic {
    /// Writes the place, if there is one, and the message in one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.0.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)
    }
}

impl Serialize for Diagnostic {
    /// Serializes a finding as JSON with `check`, `severity`, `found`, `wanted`, its figures, and
    /// `drone` if there are several drones. `value` and `limit` are always present, and are null
    /// and 0 if the check has none.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(None)?;
        // Members that are always present are written first, then other figures and texts.
        if let Some(Segment::Drone(drone)) = self.place.0.first() {
            map.serialize_entry("drone", drone)?;
        }
        map.serialize_entry("check", self.code)?;
        map.serialize_entry("severity", &self.severity)?;
        map.serialize_entry("value", &self.figures.get("value"))?;
        map.serialize_entry("limit", self.figures.get("limit").unwrap_or(&Figure::Number(0.0)))?;
        for (name, figure) in &self.figures {
            if !["value", "limit"].contains(name) {
                map.serialize_entry(name, figure)?;
            }
        }
        map.serialize_entry("found", &self.message)?;
        map.serialize_entry("wanted", &self.wanted)?;
        map.end()
    }
}

/// A product with its diagnostics.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Warned<T> {
    /// The product.
    pub product: T,
    /// The diagnostics, in the order in which they were found.
    pub warnings: Vec<Diagnostic>,
}

impl<T> Warned<T> {
    /// Converts the product, and keeps the warnings.
    pub fn map<U>(self, make: impl FnOnce(T) -> U) -> Warned<U> {
        Warned { product: make(self.product), warnings: self.warnings }
    }
}

/// Scene key, and the value to which it should be set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    /// Dotted key in the scene file.
    pub key: String,
    /// Value in scene-file syntax, or `None` if the sentence only says to raise or lower it.
    pub value: Option<String>,
}

impl Change {
    /// Creates a change from a key and its new value.
    pub fn new(key: impl Into<String>, value: impl ToString) -> Self {
        Self { key: key.into(), value: Some(value.to_string()) }
    }
}

impl fmt::Display for Change {
    /// Writes the change in the syntax of a scene file.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(value) = &self.value else { return f.write_str(&self.key) };
        // Numbers, lists and quoted strings are valid TOML, but a bare name is not.
        let is_toml = format!("value = {value}").parse::<toml::Table>().is_ok();
        let quote = if is_toml { "" } else { "\"" };
        write!(f, "{} = {quote}{value}{quote}", self.key)
    }
}

/// Suggested action, made of words and of scene keys as data. In a string literal, keys are in
/// braces and may include a value, as in `"raise {camera.iso}, or set {camera.metering=trail}"`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Help(Vec<Part>);

/// Part of a suggested action.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    Words(String),
    Change(Change),
}

impl Help {
    /// Returns the suggested changes in the order of the sentence.
    pub fn changes(&self) -> impl Iterator<Item = &Change> {
        self.0.iter().filter_map(|part| match part {
            Part::Words(_) => None,
            Part::Change(change) => Some(change),
        })
    }

    /// Returns the sentence with each change formatted by `format_change`, and all words as they
    /// are.
    pub fn sentence(&self, format_change: impl Fn(&Change) -> String) -> String {
        self.0.iter().fold(String::new(), |text, part| match part {
            Part::Words(words) => text + words,
            Part::Change(change) => text + &format_change(change),
        })
    }

    /// True if there is no suggested action.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl From<&'static str> for Help {
    /// Parses a string literal with keys in braces, such as `raise {camera.iso}`.
    fn from(text: &'static str) -> Self {
        // After the split, every second part was enclosed in braces.
        let parts = text.split(['{', '}']).enumerate().map(|(index, part)| {
            match (index % 2, part.split_once('=')) {
                (0, _) => Part::Words(part.to_owned()),
                (_, Some((key, value))) => Part::Change(Change::new(key, value)),
                (_, None) => Part::Change(Change { key: part.to_owned(), value: None }),
            }
        });
        Self(parts.filter(|part| *part != Part::Words(String::new())).collect())
    }
}

impl From<String> for Help {
    /// Converts a string without keys. Braces in the string have no special meaning.
    fn from(words: String) -> Self {
        Self(if words.is_empty() { Vec::new() } else { vec![Part::Words(words)] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_names_its_changes_in_order() {
        let help =
            Help::from("raise {camera.iso} or set {plan.light_clock=light}, {camera.iso=200}.");
        assert_eq!(
            help.sentence(Change::to_string),
            "raise camera.iso or set plan.light_clock = \"light\", camera.iso = 200."
        );
        assert_eq!(help.changes().filter(|change| change.value.is_some()).count(), 2);
        assert_eq!(Help::from("wait").sentence(Change::to_string), "wait");
        assert_eq!(Help::from("a {b}".to_owned()).changes().count(), 0, "words of an input");
    }

    #[test]
    fn a_line_has_place_message_and_help() {
        let warning = Diagnostic::warning("speed", "5 m/s").helped("lower {plan.stroke_speed_m_s}");
        let second = warning.clone().of_drone(DroneIndex(1));
        assert_eq!(
            second.sentence(|change| format!("`{change}`")),
            "drone 2: 5 m/s (lower `plan.stroke_speed_m_s`)"
        );
        let stop = Diagnostic { severity: Severity::Stop, ..warning.in_file("a.csv") };
        assert_eq!(stop.sentence(Change::to_string), "a.csv: 5 m/s: lower plan.stroke_speed_m_s");
    }
}
