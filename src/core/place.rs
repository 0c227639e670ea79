//! Place of a value, such as a file and its line, a key, a list item, or one of several drones.

use serde::{Serialize, Serializer};

/// Place of a value, from the outermost segment to the innermost. Printed examples are
/// `scene.toml:12: vehicle.mass_kg`, `plan.csv:7` and `scene.toml:40: light.fixtures[2].name`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place(pub Vec<Segment>);

/// One step in the path to a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Segment {
    /// File as the user named it, or a part of a file.
    File(String),
    /// Line of the file, from 1.
    Line(u64),
    /// Key (dotted if it is in a table), column or flag.
    Key(String),
    /// Index of a list, from 0.
    Index(usize),
    /// One of several drones.
    Drone(DroneIndex),
}

impl Place {
    /// Creates the place of a whole file.
    pub fn file(name: impl std::fmt::Display) -> Self {
        Self(vec![Segment::File(name.to_string())])
    }

    /// Returns the first key in the innermost file, or an empty text if there is none.
    pub fn key(&self) -> &str {
        let is_file = |segment: &Segment| matches!(segment, Segment::File(_) | Segment::Line(_));
        match &self.0[self.0.iter().rposition(is_file).map_or(0, |file| file + 1)..] {
            [Segment::Key(key), ..] => key,
            _ => "",
        }
    }
}

impl std::fmt::Display for Place {
    /// Writes the segments from the outermost to the innermost, such as `scene.toml:40:
    /// light.fixtures[2].name`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // A dot precedes a key within a key or an item, and a colon precedes other names.
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
    /// Creates a place with this key, or an empty place for an empty key.
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

/// Index of one of several drones. Messages and JSON count drones from 1.
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
