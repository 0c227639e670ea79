//! Where something is: a file and its line, a key, an item of a list, one of several drones.

use serde::{Serialize, Serializer};

/// Place of a value, from the outside in. Printed: `scene.toml:12: vehicle.mass_kg`, `plan.csv:7`,
/// `scene.toml:40: light.fixtures[2].name`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place(pub Vec<Segment>);

/// One step in the path to a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Segment {
    /// A file, as it was named, or a part of one.
    File(String),
    /// A line of the file, from 1.
    Line(u64),
    /// A key (dotted if it is in a table), a column or a flag.
    Key(String),
    /// An index of a list, from 0.
    Index(usize),
    /// One of several drones.
    Drone(DroneIndex),
}

impl Place {
    /// A file as a whole.
    pub fn file(name: impl std::fmt::Display) -> Self {
        Self(vec![Segment::File(name.to_string())])
    }

    /// The first key in the innermost file, or empty if there is none.
    pub fn key(&self) -> &str {
        let is_file = |segment: &Segment| matches!(segment, Segment::File(_) | Segment::Line(_));
        match &self.0[self.0.iter().rposition(is_file).map_or(0, |file| file + 1)..] {
            [Segment::Key(key), ..] => key,
            _ => "",
        }
    }
}

impl std::fmt::Display for Place {
    /// Writes the place as in `scene.toml:40: light.fixtures[2].name`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A key within a key or an item has a dot before it, other names a colon.
        let mut outer: Option<&Segment> = None;
        for segment in &self.0 {
            match segment {
                Segment::Line(line) => write!(f, ":{line}")?,
                Segment::Index(index) => write!(f, "[{index}]")?,
                Segment::Drone(drone) => write!(f, "drone {drone}")?,
                Segment::File(name) | Segment::Key(name) => {
                    let is_nested = matches!(segment, Segment::Key(_));
                    let separator = match outer {
                        None => "",
                        Some(Segment::Key(_) | Segment::Index(_)) if is_nested => ".",
                        Some(_) => ": ",
                    };
                    write!(f, "{separator}{name}")?;
                }
            }
            outer = Some(segment);
        }
        Ok(())
    }
}

impl From<String> for Place {
    /// A place with this key, or an empty place for an empty key.
    fn from(key: String) -> Self {
        Self(if key.is_empty() { Vec::new() } else { vec![Segment::Key(key)] })
    }
}

impl From<&str> for Place {
    fn from(key: &str) -> Self {
        key.to_owned().into()
    }
}

impl From<std::path::Display<'_>> for Place {
    fn from(file: std::path::Display<'_>) -> Self {
        Self::file(file)
    }
}

/// One of several drones, by its index. People count from 1, and so do texts and JSON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DroneIndex(pub usize);

impl std::fmt::Display for DroneIndex {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        (self.0 + 1).fmt(f)
    }
}

impl Serialize for DroneIndex {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        (self.0 + 1).serialize(to)
    }
}
