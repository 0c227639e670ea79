//! Anchors from the file that cfclient saves: YAML, an index with x, y and z in meters each.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::{Limit, Yaml, YamlEntry};

/// Largest file that is read.
const LIMIT: Limit = Limit { bytes: 1 << 20, what: "a file of anchors", hint: HINT };

/// Reads the places of the anchors, in the order of their indices.
///
/// # Errors
///
/// [`Error::Io`] where the file cannot be read; [`Error::Input`] with its line where it is broken,
/// and for indices that do not count from 0.
pub fn read_anchors(path: &Path) -> Result<Vec<[f64; 3]>> {
    parse(&LIMIT.read_text(path)?, &path.display().to_string())
}

const HINT: &str = "save the anchors with cfclient: `0:` and below it `x: 1.0`, `y: 2.0`, `z: 0.2`";

fn parse(yaml: &str, file: &str) -> Result<Vec<[f64; 3]>> {
    let yaml = Yaml::parse(yaml).map_err(|broken| broken.error(file, HINT))?;
    let anchors = yaml.numbered().map_err(|broken| broken.error(file, HINT))?;
    let mut places: Vec<[f64; 3]> = Vec::new();
    for (index, (key, anchor)) in anchors.into_iter().enumerate() {
        let at = format!("{file}:{}: anchor {key}", anchor.line);
        if usize::from(key) != index {
            let (found, wanted) = (format!("key {key}"), format!("key {index}"));
            return Err(Error::input(at, found, wanted, HINT));
        }
        let mut place = [0.0; 3];
        for YamlEntry { key: name, value, .. } in
            anchor.entries().map_err(|broken| broken.error(file, HINT))?
        {
            if !["x", "y", "z"].contains(&name.as_str()) {
                return Err(Error::input(at, format!("key {name}"), "x, y and z", HINT));
            }
            let value = value.number().map_err(|broken| broken.error(file, HINT))?;
            crate::error::within(&format!("{at}, {name}"), value, -1e4, 1e4)?;
        }
        for (axis, name) in place.iter_mut().zip(["x", "y", "z"]) {
            let value = anchor.get(name).and_then(Yaml::number);
            *axis = value.map_err(|broken| broken.error(file, HINT))?;
        }
        if let Some(first) = places.iter().position(|other| *other == place) {
            return Err(Error::input(at, format!("the place of key {first}"), "another", HINT));
        }
        places.push(place);
    }
    Ok(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_cfclient_is_read_and_a_broken_one_refused() {
        let file = "0:\n  x: 0.99\n  y: 1.49\n  z: 1.8\n1:\n  x: 0.99\n  y: 3.29\n  z: 1.8\n";
        assert_eq!(parse(file, "a.yaml").unwrap(), [[0.99, 1.49, 1.8], [0.99, 3.29, 1.8]]);
        for (broken, at, wanted) in [
            (file.replace("1:\n", "2:\n"), ":6: anchor 2", "key 2"),
            (file.replace("1:\n", "one:\n"), ":5", "key one"),
            (file.replacen("z: 1.8", "z: much", 1), ":4", "much"),
            (file.replacen("  x: 0.99\n", "", 1), ":2", "no x"),
            (file.replacen("z: 1.8", "z: 1.8\n  w: 2", 1), ":2: anchor 0", "key w"),
            (file.replace("1.49", ".nan"), ":2: anchor 0, y", "NaN"),
            (file.replace("3.29", "1.49"), ":6: anchor 1", "the place of key 0"),
        ] {
            let error = parse(&broken, "a.yaml").unwrap_err().to_string();
            assert!(error.contains(&format!("a.yaml{at}")) && error.contains(wanted), "{error}");
        }
    }
}
