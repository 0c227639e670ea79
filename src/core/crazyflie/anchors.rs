//! Anchors from the file that cfclient saves: YAML, an index with x, y and z in meters each.

use std::path::Path;

use crate::error::{Result, within};
use crate::files::{Broken, Limit, Yaml, YamlEntry};
use crate::input_error;

/// Keys of an anchor.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Largest file that is read.
const LIMIT: Limit = Limit { bytes: 1 << 20, what: "a file of anchors", hint: HINT };

/// Reads the places of the anchors, in the order of their indices.
///
/// # Errors
///
/// [`Error::Io`](crate::error::Error::Io) where the file cannot be read;
/// [`Error::Input`](crate::error::Error::Input) with its line where it is broken, and for indices
/// that do not count from 0.
pub fn read_anchors(path: &Path) -> Result<Vec<[f64; 3]>> {
    parse(&LIMIT.read_text(path)?, &path.display().to_string())
}

const HINT: &str = "save the anchors with cfclient: `0:` and below it `x: 1.0`, `y: 2.0`, `z: 0.2`";

fn parse(yaml: &str, file: &str) -> Result<Vec<[f64; 3]>> {
    let broken = |broken: Broken| broken.error(file, HINT);
    let yaml = Yaml::parse(yaml).map_err(broken)?;
    let mut places_m: Vec<[f64; 3]> = Vec::new();
    for (index, (key, anchor)) in yaml.numbered().map_err(broken)?.into_iter().enumerate() {
        let place = format!("{file}:{}: anchor {key}", anchor.line);
        if usize::from(key) != index {
            return Err(input_error!(place, "key {key}", "key {index}", "{HINT}"));
        }
        for YamlEntry { key: name, value, .. } in anchor.entries().map_err(broken)? {
            if !AXES.contains(&name.as_str()) {
                return Err(input_error!(place, "key {name}", "x, y and z", "{HINT}"));
            }
            let number_m = value.number().map_err(broken)?;
            within(&format!("{place}, {name}"), number_m, -1e4, 1e4)?;
        }
        let mut place_m = [0.0; 3];
        for (axis_m, name) in place_m.iter_mut().zip(AXES) {
            *axis_m = anchor.get(name).and_then(Yaml::number).map_err(broken)?;
        }
        if let Some(first) = places_m.iter().position(|other_m| *other_m == place_m) {
            return Err(input_error!(place, "the place of key {first}", "another", "{HINT}"));
        }
        places_m.push(place_m);
    }
    Ok(places_m)
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
