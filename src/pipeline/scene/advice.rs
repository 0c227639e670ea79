//! Advice on a scene: sentences, and the keys that they name as data.

use std::fmt;

/// A key of a scene, and the value that it should have.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Change {
    /// Dotted key.
    pub key: &'static str,
    /// The value, as [`crate::scene::Scene::parse_with`] takes it; `None`: the sentence about it
    /// says which way it goes.
    pub value: Option<String>,
}

impl Change {
    /// A key with the value that it should have.
    pub fn new(key: &'static str, value: impl ToString) -> Self {
        Self { key, value: Some(value.to_string()) }
    }
}

impl fmt::Display for Change {
    /// The change as a scene file has it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(value) = &self.value else { return f.write_str(self.key) };
        let quote =
            if format!("value = {value}").parse::<toml::Table>().is_ok() { "" } else { "\"" };
        write!(f, "{} = {quote}{value}{quote}", self.key)
    }
}

/// Advice: a sentence with keys of the scene in braces, some with a value, such as `"raise
/// {camera.iso}, or set {camera.metering=trail}"`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneAdvice(pub &'static str);

impl SceneAdvice {
    /// The keys that it names, in order.
    pub fn changes(self) -> impl Iterator<Item = Change> {
        self.0.split(['{', '}']).skip(1).step_by(2).map(|part| match part.split_once('=') {
            Some((key, value)) => Change::new(key, value),
            None => Change { key: part, value: None },
        })
    }

    /// The sentence with each change as `typed` writes it.
    pub fn sentence(self, typed: impl Fn(&Change) -> String) -> String {
        let words = self.0.split(['{', '}']).step_by(2).map(str::to_owned);
        let changes = self.changes().map(|change| typed(&change));
        words.zip(changes.chain([String::new()])).map(|(words, change)| words + &change).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_names_its_changes_in_order() {
        let advice =
            SceneAdvice("raise {camera.iso} or set {plan.light_clock=light}, {camera.iso=200}.");
        assert_eq!(
            advice.sentence(Change::to_string),
            "raise camera.iso or set plan.light_clock = \"light\", camera.iso = 200."
        );
        assert_eq!(advice.changes().filter(|change| change.value.is_some()).count(), 2);
        assert_eq!(SceneAdvice("wait").sentence(Change::to_string), "wait");
    }
}
