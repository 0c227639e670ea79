//! Base stations from a Lighthouse configuration file, as written by cfclient and cflib.
//!
//! cflib's `lighthouse_config_manager.py` writes YAML in block or in flow style, depending on the
//! release of its YAML library. Its world and station frames are the same as this program's.
//!
//! The factory calibrations (`calibs`, which contain phase, tilt, curve and other values of each
//! sweep) have no effect, and a warning says so. The firmware corrects each angle with them
//! (`lighthouse_calibration.c`), and this program's angles are already corrected. A calibrated tilt
//! of up to 0.05 rad would change the height from second-generation planes by a tenth of its noise.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Matrix3;
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_saphyr::Spanned;

use super::super::{Generation, Station};
use super::from_yaml;
use crate::vehicle::MAX_COORDINATE_M;
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

/// Maximum size of a file. Sixteen stations take about 20 kB.
const LIMIT: Limit = Limit { bytes: 1 << 20, what: "a Lighthouse configuration", hint: HINT };
/// Maximum error of a rotation matrix, which allows for single precision and rounding in files.
const ROTATION_TOLERANCE: f64 = 1e-3;

const HINT: &str = "estimate the base stations' geometry in cfclient's Lighthouse tab, and save \
                    the configuration again";

/// Known keys of the file and of a station's geometry. A warning names other keys.
const KEYS: [&str; 5] = ["type", "version", "systemType", "geos", "calibs"];
const GEOMETRY: [&str; 2] = ["origin", "rotation"];

/// Keys of a mapping, with the lines on which their values begin.
type Keys = BTreeMap<String, Spanned<IgnoredAny>>;

/// Keys of the file that have an effect.
#[derive(Deserialize)]
struct Config {
    r#type: Spanned<String>,
    version: Spanned<String>,
    #[serde(rename = "systemType")]
    system_type: Option<Spanned<String>>,
    #[serde(default)]
    geos: BTreeMap<u8, Geometry>,
    #[serde(default)]
    calibs: BTreeMap<u8, IgnoredAny>,
}

/// Position of a station in m, and the rotation from its frame to the world frame, row by row.
#[derive(Deserialize)]
struct Geometry {
    origin: Spanned<[f64; 3]>,
    rotation: Spanned<[[f64; 3]; 3]>,
}

/// All keys of the stations' geometries.
#[derive(Deserialize)]
struct Geometries {
    #[serde(default)]
    geos: BTreeMap<u8, Keys>,
}

/// Reads the base stations of a Lighthouse configuration file whose geometry is known, in the order
/// of their channels.
///
/// # Errors
///
/// Returns [`Error::Io`] if the file cannot be read. Returns [`Error::Input`] with the line for a
/// file in another format, or for a station with an impossible position or rotation.
pub fn read_lighthouse_config(path: &Path) -> Result<Warned<Vec<Station>>> {
    parse(&LIMIT.read_text(path)?, &path.display().to_string())
}

/// Parses the text of a configuration. Returns the stations with a geometry, and warnings about
/// keys and calibrations that have no effect. `file` is the file's name in messages.
fn parse(yaml: &str, file: &str) -> Result<Warned<Vec<Station>>> {
    // All keys are read first, so that unknown keys are always reported, and then the known keys.
    let keys: Keys = from_yaml(yaml, file, HINT)?;
    let mut unknown = unknown_keys(&keys, &KEYS);
    let config: Config = from_yaml(yaml, file, HINT)?;
    check_value("type", &config.r#type, &["lighthouse_system_configuration"], file)?;
    check_value("version", &config.version, &["1"], file)?;
    let generation = match &config.system_type {
        Some(system_type) => {
            check_value("systemType", system_type, &["1", "2"], file)?;
            if system_type.value == "1" { Generation::V1 } else { Generation::V2 }
        }
        None => Generation::V2,
    };
    if config.geos.is_empty() {
        let content = match unknown.as_slice() {
            [] => "no base station under geos".to_owned(),
            others => format!("no base station under geos, but {}", others.join(", ")),
        };
        return Err(Error::input(file, content, "at least one", HINT));
    }
    let stations =
        config.geos.iter().map(|(id, geometry)| station(generation, geometry, file, *id));
    let product = stations.collect::<Result<_>>()?;
    let geometries: Geometries = from_yaml(yaml, file, HINT)?;
    unknown.extend(geometries.geos.values().flat_map(|geometry| unknown_keys(geometry, &GEOMETRY)));
    let mut warnings = calibration_warnings(&config);
    if !unknown.is_empty() {
        warnings.push(format!("{file}: unknown keys without effect: {}", unknown.join(", ")));
    }
    Ok(Warned { product, warnings: Diagnostic::warnings("base-stations", warnings) })
}

/// Checks that the value of a key is one of the allowed values.
fn check_value(key: &str, value: &Spanned<String>, wanted: &[&str], file: &str) -> Result<()> {
    if wanted.contains(&value.value.as_str()) {
        return Ok(());
    }
    let error = Error::input(key, &value.value, wanted.join(" or "), HINT);
    Err(error.in_file(file, value.referenced.line()))
}

/// Creates station `id` from its geometry. Returns an error with the line for an impossible
/// position or rotation.
fn station(generation: Generation, geometry: &Geometry, file: &str, id: u8) -> Result<Station> {
    let refused = |line: u64, key: &str, value: String, wanted: &str| {
        Err(Error::input(format!("geos.{id}.{key}"), value, wanted, HINT).in_file(file, line))
    };
    let position_m = geometry.origin.value;
    if !position_m.iter().all(|x| x.abs() <= MAX_COORDINATE_M) {
        let line = geometry.origin.referenced.line();
        return refused(line, "origin", format!("{position_m:?}"), "meters within ±1e4");
    }
    let rows = geometry.rotation.value;
    let rotation = Matrix3::from_row_iterator(rows.into_iter().flatten());
    let error = (rotation * rotation.transpose() - Matrix3::identity()).abs().max();
    if !(error <= ROTATION_TOLERANCE && rotation.determinant() > 0.0) {
        let line = geometry.rotation.referenced.line();
        return refused(line, "rotation", format!("{rows:?}"), "a rotation");
    }
    Ok(station_from_rotation(generation, position_m, &rotation))
}

/// Creates a station from its position in m and the rotation from its frame to the world frame.
fn station_from_rotation(
    generation: Generation,
    position_m: [f64; 3],
    rotation: &Matrix3<f64>,
) -> Station {
    let forward = rotation.column(0).into_owned();
    let roll_rad = libm::atan2(rotation[(2, 1)], rotation[(2, 2)]);
    Station::facing(generation, position_m, &forward, roll_rad)
}

/// Returns the keys of a mapping that are unknown, with their lines.
fn unknown_keys(keys: &Keys, known: &[&str]) -> Vec<String> {
    let unknown = keys.iter().filter(|(key, _)| !known.contains(&key.as_str()));
    unknown.map(|(key, value)| format!("{key} (line {})", value.referenced.line())).collect()
}

/// Returns warnings that calibrations have no effect, for stations with and without a geometry.
fn calibration_warnings(config: &Config) -> Vec<String> {
    let [calibrated, unplaced] = [true, false].map(|has_geometry| {
        let ids = config.calibs.keys().filter(|id| config.geos.contains_key(id) == has_geometry);
        ids.map(u8::to_string).collect::<Vec<_>>().join(", ")
    });
    let mut warnings = Vec::new();
    if !calibrated.is_empty() {
        warnings.push(format!(
            "the factory calibration of base station {calibrated} has no effect, because sweep \
             angles are simulated as the firmware computes them after this calibration"
        ));
    }
    if !unplaced.is_empty() {
        warnings.push(format!(
            "base station {unplaced} is left out, because the file contains its calibration but \
             not its position"
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::sensors::StationPose;

    /// Configuration in block style as cflib's YAML library writes it from 5.1 on, with one line in
    /// flow style.
    const BLOCK: &str = "\
calibs:
  0:
    sweeps:
    - curve: -0.05
      gibmag: 0.006
      gibphase: 1.1
      ogeemag: -0.3
      ogeephase: 0.9
      phase: 0.0
      tilt: -0.05
    - {curve: 0.1, gibmag: -0.005, gibphase: 2.4, ogeemag: 0.4, ogeephase: 0.2, phase: -0.006, tilt: 0.05}
    uid: 3332124402
geos:
  0:
    origin:
    - -1.9584829807281494
    - 0.5422989726066589
    - 3.152726888656616
  # turned by 90 degrees about z
    rotation:
    - - 0.0
      - -1.0
      - 0.0
    - - 1.0
      - 0.0
      - 0.0
    - - 0.0
      - 0.0
      - 1.0
  1:
    origin: [1.0, 2.0, 3.0]
    rotation: [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]
systemType: 2
type: lighthouse_system_configuration
version: '1'
";

    #[test]
    fn stations_come_in_place_and_turned() {
        let Warned { product: stations, warnings } = parse(BLOCK, "lh.yaml").unwrap();
        assert_eq!((stations.len(), warnings.len()), (2, 1));
        assert!(warnings[0].message.contains("calibration of base station 0 has no"));
        assert_eq!(stations[0].position_m[2], 3.152726888656616);
        let turned = StationPose::new(&stations[0]).world_from_station * Vector3::x();
        assert!((turned - Vector3::y()).norm() < 1e-15, "x becomes y");
        let pose = StationPose::new(&stations[1]).world_from_station;
        let want = Matrix3::new(0.8, 0.0, 0.6, 0.0, 1.0, 0.0, -0.6, 0.0, 0.8);
        assert!((pose - want).norm() < 1e-15, "{pose}");
        assert!(stations[1].pitch_rad > 0.6, "looks down");
        assert!(stations.iter().all(|s| s.generation == Generation::V2));
        let v1 = parse(&BLOCK.replace("systemType: 2", "systemType: 1"), "lh.yaml").unwrap();
        assert!(v1.product.iter().all(|s| s.generation == Generation::V1));
        let unplaced = parse(&BLOCK.replace("calibs:\n  0:", "calibs:\n  7:"), "lh.yaml").unwrap();
        assert!(unplaced.warnings[0].message.contains("station 7 is left out"), "{unplaced:?}");
        let other = parse(&format!("{BLOCK}wind: 3\n"), "lh.yaml").unwrap();
        assert!(other.warnings[1].message.contains("effect: wind (line 36)"), "{other:?}");
    }

    #[test]
    fn any_rotation_survives_its_angles() {
        for i in 0..200 {
            let angle = |k: f64| 3.0 * libm::sin(f64::from(i) * k);
            let (yaw_rad, pitch_rad, roll_rad) = (angle(1.3), 0.5 * angle(2.1), angle(3.7));
            let position_m = [0.0; 3];
            let generation = Generation::V2;
            let station = Station { generation, position_m, yaw_rad, pitch_rad, roll_rad };
            let r = StationPose::new(&station).world_from_station;
            let again = StationPose::new(&station_from_rotation(generation, position_m, &r))
                .world_from_station;
            assert!((again - r).norm() < 1e-13, "{station:?}");
        }
    }

    #[test]
    fn broken_files_are_named_by_line() {
        let cases = [
            (BLOCK.replace("lighthouse_system", "loco"), ":34: type", "loco_configuration"),
            (BLOCK.replace("'1'", "'2'"), ":35: version", "found 2"),
            (BLOCK.replace("systemType: 2", "systemType: 3"), ":33: systemType", "found 3"),
            (BLOCK.replace("- -1.9584829807281494", "- east"), ":16", "east"),
            (BLOCK.replace("    - 3.152726888656616\n", ""), "lh.yaml:", "3"),
            (BLOCK.replace("- 0.5422989726066589", "- .nan"), ":17", "- .nan"),
            (BLOCK.replace("[0.8, 0.0, 0.6]", "[0.9, 0.0, 0.6]"), ":32: geos.1.rotation", "0.9"),
            (BLOCK.replace("[0.0, 1.0, 0.0]", "[0.0, -1.0, 0.0]"), ":32: geos.1", "a rotation"),
            (BLOCK.replace("geos:", "geoz:"), "lh.yaml", "but geoz (line 14)"),
            (BLOCK.replace("systemType: 2", "systemType: [2"), "lh.yaml:", ""),
            (String::new(), "lh.yaml:1", ""),
            ("\u{0}\u{1}[{".to_owned(), "lh.yaml:1", ""),
        ];
        for (yaml, place, quoted) in cases {
            let error = parse(&yaml, "lh.yaml").unwrap_err();
            let message = error.to_string();
            assert!(message.contains(place) && message.contains(quoted), "{place}: {message}");
            assert!(!message.contains('\n') && !error.hint().is_empty(), "{message}");
        }
    }
}
