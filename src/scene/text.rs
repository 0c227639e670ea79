//! The scene file as text: what each key means, and where in the file a mistake stands.

use toml::de::DeTable;

use super::Scene;
use crate::error::Error;

/// What to do about a broken scene file.
pub(super) const HINT: &str = "`noctograph scene` prints every key with its default and unit";

/// Every key of a scene in the order of the file: section, key, meaning with unit.
const KEYS: &[(&str, &str, &str)] = &[
    ("", "preset", "where the defaults come from"),
    ("", "word", "the word to write"),
    ("", "seed", "seed of all noise: the same seed makes the same photo"),
];

/// What each section is about.
const SECTIONS: &[(&str, &str)] = &[];

/// The whole scene as a commented TOML file.
pub(super) fn document(scene: &Scene) -> String {
    let values = toml::Table::try_from(scene).expect("a checked scene is a TOML table");
    let mut text =
        "# A noctograph scene: everything that the photo depends on. SI units; angles in \
                    radians.\n# Keys that are left out keep their default.\n"
            .to_owned();
    let mut section = "";
    for (place, key, meaning) in KEYS {
        if *place != section {
            section = place;
            let about = SECTIONS.iter().find(|(name, _)| *name == section).map_or("", |(_, a)| a);
            text += &format!("\n# {about}\n[{section}]\n");
        }
        let table = match *place {
            "" => Some(&values),
            section => values.get(section).and_then(toml::Value::as_table),
        };
        match table.and_then(|table| table.get(*key)) {
            Some(value) => text += &entry(key, value, meaning),
            None => text += &format!("# {key} =   # {meaning}\n"),
        }
    }
    text
}

/// One key with its value and meaning; a list of tables takes a line a table.
fn entry(key: &str, value: &toml::Value, meaning: &str) -> String {
    match value.as_array() {
        Some(rows) if rows.iter().any(toml::Value::is_table) => {
            let rows: String = rows.iter().map(|row| format!("    {row},\n")).collect();
            format!("# {meaning}\n{key} = [\n{rows}]\n")
        }
        _ => format!("{key} = {value}  # {meaning}\n"),
    }
}

/// A file that is no TOML, has an unknown key or a value of the wrong type.
pub(super) fn syntax_error(error: &toml::de::Error, toml: &str, file: &str) -> Error {
    let line = error.span().map_or(1, |span| line_at(toml, span.start));
    let found = error.message().replace('\n', "; ");
    Error::input(format!("{file}:{line}"), found, "keys and values of a scene", HINT)
}

/// Puts file and line before an error's place, where the place begins with a key of the file.
pub(super) fn with_line(error: Error, toml: &str, file: &str) -> Error {
    match error {
        Error::Input { place, found, wanted, hint } => {
            let line = line_of(toml, &place).map_or(String::new(), |line| format!(":{line}"));
            Error::Input { place: format!("{file}{line}: {place}"), found, wanted, hint }
        }
        other => other,
    }
}

/// The line of the key that a place begins with, such as `camera.iso`; that of its section where
/// the key is not in the file.
fn line_of(toml: &str, place: &str) -> Option<usize> {
    let parsed = DeTable::parse(toml).ok()?;
    let mut words = place.split([' ', '.']);
    let (name, value) = parsed.get_ref().get_key_value(words.next()?)?;
    let inner = value.get_ref().as_table().zip(words.next());
    let inner = inner.and_then(|(table, key)| table.get_key_value(key));
    let span = inner.map_or(name.span(), |(key, _)| key.span());
    Some(line_at(toml, span.start))
}

fn line_at(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_explained_once() {
        let mut scene = Scene::default();
        scene.camera.shutter_close_s = Some(1.0);
        let values = toml::Table::try_from(&scene).unwrap();
        let mut keys: Vec<(String, String)> = Vec::new();
        for (name, value) in &values {
            match value.as_table() {
                Some(table) => keys.extend(table.keys().map(|key| (name.clone(), key.clone()))),
                None => keys.push((String::new(), name.clone())),
            }
        }
        let mut explained: Vec<(String, String)> =
            KEYS.iter().map(|(s, k, _)| ((*s).to_owned(), (*k).to_owned())).collect();
        keys.sort();
        explained.sort();
        assert_eq!(explained, keys);
        let sections: Vec<&str> = SECTIONS.iter().map(|(name, _)| *name).collect();
        let tables = values.iter().filter(|(_, value)| value.is_table());
        assert!(tables.clone().all(|(name, _)| sections.contains(&name.as_str())), "{sections:?}");
        assert_eq!(tables.count(), sections.len(), "no section too many");
    }
}
