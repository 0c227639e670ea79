//! Anchors from the file that cfclient saves: YAML, an index with x, y and z in meters each.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::files::Limit;

/// Largest file that is read.
const LIMIT: Limit = Limit { bytes: 1 << 20, what: "a file of anchors", hint: HINT };

/// Most anchors: a byte counts them in the firmware's long mode.
const MAX_ANCHORS: usize = 256;

#[derive(Deserialize)]
struct Place {
    x: f64,
    y: f64,
    z: f64,
}

/// Reads the places of the anchors, in the order of their indices.
///
/// # Errors
///
/// [`Error::Io`] where the file cannot be read; [`Error::Input`] with its line where it is broken,
/// and for indices that do not count from 0.
pub fn read_anchors(path: &Path) -> Result<Vec<[f64; 3]>> {
    parse(&LIMIT.read_text(path)?).map_err(|error| error.in_file(path))
}

const HINT: &str = "save the anchors with cfclient: `0:` and below it `x: 1.0`, `y: 2.0`, `z: 0.2`";

fn parse(yaml: &str) -> Result<Vec<[f64; 3]>> {
    let places: BTreeMap<usize, Place> = serde_saphyr::from_str(yaml).map_err(|error| {
        let text = error.to_string();
        let found = text.lines().next().unwrap_or_default().to_owned();
        Error::input("anchors", found, "anchors with x, y and z", HINT)
    })?;
    if places.len() > MAX_ANCHORS {
        let wanted = format!("at most {MAX_ANCHORS}");
        return Err(Error::input("anchors", format!("{} anchors", places.len()), wanted, HINT));
    }
    for (index, (anchor, place)) in places.iter().enumerate() {
        if *anchor != index {
            let wanted = format!("key {index}");
            return Err(Error::input("anchors", format!("key {anchor}"), wanted, HINT));
        }
        for value in [place.x, place.y, place.z] {
            crate::error::within(&format!("anchors, key {anchor}"), value, -1e4, 1e4)?;
        }
    }
    let places: Vec<[f64; 3]> =
        places.into_values().map(|place| [place.x, place.y, place.z]).collect();
    for (index, place) in places.iter().enumerate() {
        if let Some(first) = places[..index].iter().position(|other| other == place) {
            let found = format!("the place of key {first}");
            return Err(Error::input(format!("anchors, key {index}"), found, "another", HINT));
        }
    }
    Ok(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_cfclient_is_read_and_a_broken_one_refused() {
        let file = "0:\n  x: 0.99\n  y: 1.49\n  z: 1.8\n1:\n  x: 0.99\n  y: 3.29\n  z: 1.8\n";
        assert_eq!(parse(file).unwrap(), [[0.99, 1.49, 1.8], [0.99, 3.29, 1.8]]);
        for (broken, wanted) in [
            (file.replace("1:\n", "2:\n"), "key 2"),
            (file.replace("z: 1.8", "z: much"), "anchors"),
            (file.replace("  x: 0.99\n", ""), "anchors"),
            (file.replace("1.49", ".nan"), "NaN"),
            (file.replace("3.29", "1.49"), "the place of key 0"),
        ] {
            let error = parse(&broken).unwrap_err();
            assert!(error.to_string().contains(wanted), "{error}");
        }
    }
}
