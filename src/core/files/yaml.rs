//! YAML, as Bitcraze's programs write it: mappings, lists and scalars in block or flow style.
//!
//! `granit-parser` makes events of the text; here they become nodes with their lines. Anchors,
//! tags, keys that are no scalars, keys twice and a second document are refused.

use granit_parser::{Event, Parser};

use crate::error::Error;

/// Deepest nesting; a rotation in a Lighthouse configuration takes five.
const DEEPEST: usize = 16;

/// Most keys of a mapping: stations and anchors are numbered by a byte.
const MOST_KEYS: usize = 512;

/// A value and the line on which it begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Yaml {
    /// The line, from 1.
    pub line: usize,
    value: Value,
}

#[derive(Clone, Debug, PartialEq)]
enum Value {
    Scalar(String),
    List(Vec<Yaml>),
    Map(Vec<YamlEntry>),
}

/// A key of a mapping, its line and its value.
#[derive(Clone, Debug, PartialEq)]
pub struct YamlEntry {
    /// The line of the key, from 1.
    pub line: usize,
    /// The key.
    pub key: String,
    /// The value.
    pub value: Yaml,
}

/// A value, or what is wrong in its place.
type Result<T> = std::result::Result<T, Broken>;

/// What is wrong in a file, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Broken {
    /// The line, from 1.
    pub line: usize,
    /// What was found.
    pub found: String,
    /// What is wanted.
    pub wanted: String,
}

impl Broken {
    fn new(line: usize, found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { line, found: found.into(), wanted: wanted.into() }
    }

    /// The error of a file by its name, with a hint.
    #[must_use]
    pub fn error(self, file: &str, hint: &str) -> Error {
        Error::input("", self.found, self.wanted, hint).at(file, self.line as u64)
    }
}

/// A list or a mapping that has not ended, with its line, and the key whose value comes next.
struct Open {
    line: usize,
    value: Value,
    key: Option<(usize, String)>,
}

impl Yaml {
    /// Reads a text with one document.
    ///
    /// # Errors
    ///
    /// [`Broken`] where the text is no YAML, or has what is refused.
    pub fn parse(text: &str) -> Result<Self> {
        let broken = |line, found: &str| Broken::new(line, found, "YAML");
        let (mut open, mut root): (Vec<Open>, Option<Self>) = (Vec::new(), None);
        for event in Parser::new_from_str(text) {
            let (event, span) =
                event.map_err(|error| broken(error.marker().line().max(1), &error.info()))?;
            let line = span.start.line().max(1);
            let refused = |what| Err(broken(line, what));
            let (line, value, is_open) = match event {
                Event::Scalar(_, _, 1.., _)
                | Event::SequenceStart(_, 1.., _)
                | Event::MappingStart(_, 1.., _)
                | Event::Alias(_)
                | Event::UnresolvedAlias(_) => return refused("an anchor or an alias"),
                Event::Scalar(_, _, _, Some(_))
                | Event::SequenceStart(_, _, Some(_))
                | Event::MappingStart(_, _, Some(_)) => return refused("a tag"),
                Event::DocumentStart(..) if root.is_some() => return refused("a second document"),
                Event::Scalar(text, ..) => (line, Value::Scalar(text.into_owned()), false),
                Event::SequenceStart(..) => (line, Value::List(Vec::new()), true),
                Event::MappingStart(..) => (line, Value::Map(Vec::new()), true),
                Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                    Some(Open { line, value, .. }) => (line, value, false),
                    None => continue,
                },
                _ => continue,
            };
            if is_open && open.len() == DEEPEST {
                return refused(&format!("more than {DEEPEST} levels"));
            } else if is_open {
                open.push(Open { line, value, key: None });
                continue;
            }
            let node = Self { line, value };
            match open.last_mut() {
                Some(parent) => parent.add(node)?,
                None => root = Some(node),
            }
        }
        root.ok_or_else(|| broken(1, "nothing"))
    }

    fn broken(&self, wanted: impl Into<String>) -> Broken {
        let found = match &self.value {
            Value::Scalar(text) => text,
            Value::List(_) => "a list",
            Value::Map(_) => "a mapping",
        };
        Broken::new(self.line, found, wanted)
    }

    /// The text of a scalar.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is none.
    pub fn text(&self) -> Result<&str> {
        match &self.value {
            Value::Scalar(text) => Ok(text),
            _ => Err(self.broken("a text or a number")),
        }
    }

    /// A number; YAML knows `.nan` and `.inf` beside those with digits.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is none.
    pub fn number(&self) -> Result<f64> {
        let broken = || self.broken("a number");
        let text = self.text().map_err(|_no_scalar| broken())?;
        match text.to_ascii_lowercase().as_str() {
            ".nan" => Ok(f64::NAN),
            ".inf" | "+.inf" => Ok(f64::INFINITY),
            "-.inf" => Ok(f64::NEG_INFINITY),
            digits if digits.contains(|c: char| c.is_ascii_digit()) => {
                digits.parse().map_err(|_no_number| broken())
            }
            _ => Err(broken()),
        }
    }

    /// The items of a list of as many.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is none.
    pub fn items<const N: usize>(&self) -> Result<&[Self; N]> {
        let wanted = format!("a list of {N}");
        match &self.value {
            Value::List(items) => items.as_slice().try_into().map_err(|_other_length| {
                Broken::new(self.line, format!("a list of {}", items.len()), wanted)
            }),
            _ => Err(self.broken(wanted)),
        }
    }

    /// A list of as many numbers.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is none.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(self.items::<N>()?) {
            *number = item.number()?;
        }
        Ok(numbers)
    }

    /// The keys of a mapping with their values, in the order of the file.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is none.
    pub fn entries(&self) -> Result<&[YamlEntry]> {
        match &self.value {
            Value::Map(entries) => Ok(entries),
            _ => Err(self.broken("a mapping")),
        }
    }

    /// The value of a key of a mapping, if it has that.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is no mapping.
    pub fn find(&self, key: &str) -> Result<Option<&Self>> {
        Ok(self.entries()?.iter().find(|entry| entry.key == key).map(|entry| &entry.value))
    }

    /// The value of a key that a mapping must have.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is no mapping, or lacks the key.
    pub fn get(&self, key: &str) -> Result<&Self> {
        let missing = || Broken::new(self.line, format!("no {key}"), format!("the key {key}"));
        self.find(key)?.ok_or_else(missing)
    }

    /// The entries of a mapping whose keys are whole numbers, in their order.
    ///
    /// # Errors
    ///
    /// [`Broken`] where it is no mapping, or has another key.
    pub fn numbered(&self) -> Result<Vec<(u8, &Self)>> {
        let mut numbers: Vec<(u8, &Self)> = Vec::new();
        for YamlEntry { line, key, value } in self.entries()? {
            let number = key.parse().map_err(|_no_byte| {
                Broken::new(*line, format!("key {key}"), "a number from 0 to 255 as its key")
            })?;
            if numbers.iter().any(|(other, _)| *other == number) {
                return Err(Broken::new(*line, format!("key {number} twice"), "it once"));
            }
            numbers.push((number, value));
        }
        numbers.sort_by_key(|(number, _)| *number);
        Ok(numbers)
    }
}

impl Open {
    /// Adds an item to the list, or a key or its value to the mapping.
    fn add(&mut self, node: Yaml) -> Result<()> {
        match (&mut self.value, self.key.take(), node) {
            (Value::Map(entries), Some((line, key)), value) => {
                entries.push(YamlEntry { line, key, value });
            }
            (Value::Map(entries), None, Yaml { line, value: Value::Scalar(key) }) => {
                if entries.iter().any(|entry| entry.key == key) {
                    return Err(Broken::new(line, format!("key {key} twice"), "it once"));
                }
                if entries.len() == MOST_KEYS {
                    return Err(Broken::new(line, format!("more than {MOST_KEYS} keys"), "fewer"));
                }
                self.key = Some((line, key));
            }
            (Value::Map(_), None, node) => return Err(node.broken("a key")),
            (Value::List(items), _, node) => items.push(node),
            (Value::Scalar(_), ..) => unreachable!("a scalar is never open"),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_and_flow_style_are_one() {
        let block = "# saved\na:\n- 1.5\n- - x\n  - .inf\nb:\n  c: '2'\n";
        let (block, flow) = (
            Yaml::parse(block).unwrap(),
            Yaml::parse("{a: [1.5, [x, .inf]], b: {c: \"2\"}}").unwrap(),
        );
        for yaml in [&block, &flow] {
            let [number, list] = yaml.get("a").unwrap().items().unwrap();
            assert_eq!(number.number(), Ok(1.5));
            let [text, infinite] = list.items().unwrap();
            assert_eq!((text.text(), infinite.number()), (Ok("x"), Ok(f64::INFINITY)));
            let two = yaml.get("b").unwrap().get("c").unwrap();
            assert_eq!((two.text(), two.number()), (Ok("2"), Ok(2.0)));
            assert_eq!(yaml.find("d").unwrap(), None);
        }
        assert_eq!([&block, &flow].map(|yaml| yaml.get("b").unwrap().line), [7, 1]);
    }

    #[test]
    fn what_is_no_such_file_is_named_with_its_line() {
        let deep = "[".repeat(40) + &"]".repeat(40);
        for (text, line, found) in [
            ("a: 1\nb: [2", 2, ""),
            ("a: 1\na: 2\n", 2, "key a twice"),
            ("a: &x 1\nb: *x\n", 1, "anchor"),
            ("a: !!str 1\n", 1, "a tag"),
            ("a: 1\n---\nb: 2\n", 2, "second document"),
            ("? [a]\n: 1\n", 1, "a list"),
            (deep.as_str(), 1, "levels"),
            ("", 1, "nothing"),
        ] {
            let broken = Yaml::parse(text).unwrap_err();
            assert!(broken.line == line && broken.found.contains(found), "{text}: {broken:?}");
        }
        let yaml = Yaml::parse("a: east\nb: inf\nc:\n- 1\n").unwrap();
        for (key, line) in [("a", 1), ("b", 2), ("c", 4)] {
            assert_eq!(yaml.get(key).unwrap().number().unwrap_err().line, line);
        }
        let many: String = (0..600).map(|k| format!("k{k}: 1\n")).collect();
        assert_eq!(Yaml::parse(&many).unwrap_err().line, 513);
        assert_eq!(yaml.get("d").unwrap_err().found, "no d");
        assert!(yaml.get("c").unwrap().items::<2>().unwrap_err().found.contains("list of 1"));
    }
}
