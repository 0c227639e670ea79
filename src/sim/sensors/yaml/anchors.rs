//! Anchors from cfclient's YAML file, which contains x, y and z in meters under each index.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_saphyr::Spanned;

use super::from_yaml;
use crate::vehicle::MAX_COORDINATE_M;
use noctograph_core::error::{Result, within};
use noctograph_core::files::Limit;
use noctograph_core::input_error;

/// Maximum size of a file.
const LIMIT: Limit = Limit { bytes: 1 << 20, what: "an anchor file", hint: HINT };

const HINT: &str = "save the anchors with cfclient as `0:` and, indented below it, `x: 1.0`, \
                    `y: 2.0`, `z: 0.2`";

/// Position of an anchor in the file in m.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Anchor {
    x: f64,
    y: f64,
    z: f64,
}

/// Reads the positions of the anchors, in the order of their indices.
///
/// # Errors
///
/// Returns [`Error::Io`](noctograph_core::error::Error::Io) if the file cannot be read. Returns
/// [`Error::Input`](noctograph_core::error::Error::Input) with the line of an error, or if the
/// indices do not count up from 0.
pub fn read_anchors(path: &Path) -> Result<Vec<[f64; 3]>> {
    parse(&LIMIT.read_text(path)?, &path.display().to_string())
}

/// Parses the text of an anchor file. Returns the anchors' positions in m in the order of their
/// keys, which must be 0, 1, 2 and so on. `file` is the file's name in messages.
fn parse(yaml: &str, file: &str) -> Result<Vec<[f64; 3]>> {
    let anchors: BTreeMap<u8, Spanned<Anchor>> = from_yaml(yaml, file, HINT)?;
    let mut positions_m: Vec<[f64; 3]> = Vec::new();
    for (index, (key, Spanned { value, referenced, .. })) in anchors.into_iter().enumerate() {
        let place = format!("{file}:{}: anchor {key}", referenced.line());
        if usize::from(key) != index {
            return Err(input_error!(place, "key {key}", "key {index}", "{HINT}"));
        }
        let position_m = [value.x, value.y, value.z];
        for (name, coordinate_m) in ["x", "y", "z"].into_iter().zip(position_m) {
            let range_m = [-MAX_COORDINATE_M, MAX_COORDINATE_M];
            within(&format!("{place}, {name}"), coordinate_m, range_m[0], range_m[1])?;
        }
        if let Some(first) = positions_m.iter().position(|other_m| *other_m == position_m) {
            return Err(input_error!(
                place,
                "the position of anchor {first}",
                "a different one",
                "{HINT}"
            ));
        }
        positions_m.push(position_m);
    }
    Ok(positions_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_of_cfclient_is_read_and_a_broken_one_refused() {
        let file = "0:\n  x: 0.99\n  y: 1.49\n  z: 1.8\n1:\n  x: 0.99\n  y: 3.29\n  z: 1.8\n";
        assert_eq!(parse(file, "a.yaml").unwrap(), [[0.99, 1.49, 1.8], [0.99, 3.29, 1.8]]);
        for (broken, place, wanted) in [
            (file.replace("1:\n", "2:\n"), ":6: anchor 2", "key 2"),
            (file.replace("1:\n", "one:\n"), ":5", "`one:`"),
            (file.replacen("z: 1.8", "z: much", 1), ":4", "much"),
            (file.replacen("  x: 0.99\n", "", 1), ":", "missing field `x`"),
            (file.replacen("z: 1.8", "z: 1.8\n  w: 2", 1), ":5", "unknown field `w`"),
            (file.replace("1.49", ".nan"), ":2: anchor 0, y", "NaN"),
            (file.replace("3.29", "1.49"), ":6: anchor 1", "the position of anchor 0"),
        ] {
            let error = parse(&broken, "a.yaml").unwrap_err().to_string();
            assert!(error.contains(&format!("a.yaml{place}")) && error.contains(wanted), "{error}");
        }
    }
}
