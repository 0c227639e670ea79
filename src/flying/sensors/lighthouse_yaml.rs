//! Base stations from a Lighthouse configuration file, as cfclient and cflib write it.
//!
//! `lighthouse_config_manager.py` of cflib dumps YAML, in block or in flow style after the release
//! of its YAML library, so that it is read by a full YAML reader (`serde-saphyr`: pure Rust, kept,
//! with the line of every value). World and station frames are ours already.
//!
//! The factory calibrations (`calibs`: phase, tilt, curve and the rest of each sweep) are read and
//! checked, and have no effect: the firmware undoes them before it uses an angle
//! (`lighthouse_calibration.c`), and angles here are those after that. They would change
//! the slant of second-generation planes, by the tilt of up to 0.05 rad about 30°: a tenth of the
//! height's noise. A warning says so.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;
use serde_saphyr::Spanned;

use super::{Generation, Station};
use crate::error::{Error, Result};
use crate::files::Limit;

/// Largest file that is read; sixteen stations take some 20 kB.
const LIMIT: Limit = Limit { bytes: 1 << 20, what: "a Lighthouse configuration", hint: HINT };
/// Most that a rotation matrix may be off: files carry single precision, and some are rounded.
const ROTATION_TOLERANCE: f64 = 1e-3;

const HINT: &str = "save the configuration anew in cfclient's Lighthouse tab, with the base \
                    stations' geometry estimated";

#[derive(Deserialize)]
struct File {
    #[serde(rename = "type")]
    kind: Spanned<String>,
    version: Spanned<String>,
    #[serde(rename = "systemType")]
    system_type: Option<Spanned<u8>>,
    #[serde(default)]
    geos: BTreeMap<u8, Geometry>,
    #[serde(default)]
    calibs: BTreeMap<u8, Calibration>,
}

/// A station's factory calibration.
#[derive(Deserialize)]
struct Calibration {
    sweeps: Spanned<[Sweep; 2]>,
}

/// Calibration of one plane, under the firmware's names.
#[derive(Deserialize)]
struct Sweep {
    phase: f64,
    tilt: f64,
    curve: f64,
    gibmag: f64,
    gibphase: f64,
    #[serde(default)]
    ogeemag: f64,
    #[serde(default)]
    ogeephase: f64,
}

#[derive(Deserialize)]
struct Geometry {
    origin: Spanned<[f64; 3]>,
    rotation: Spanned<[[f64; 3]; 3]>,
}

/// Largest figure of a calibration, rad: phases lie within a turn, all others far below one.
const LARGEST_CALIBRATION: f64 = 10.0;

/// Content of a Lighthouse configuration file.
#[derive(Clone, Debug, PartialEq)]
pub struct LighthouseConfig {
    /// The base stations whose geometry is known, in the order of their channels.
    pub stations: Vec<Station>,
    /// Warnings about them.
    pub warnings: Vec<String>,
}

/// Reads a Lighthouse configuration file.
///
/// # Errors
///
/// [`Error::Io`] where the file cannot be read; [`Error::Input`] with the line where it is no such
/// configuration, or a station's place or turn is impossible.
pub fn read_lighthouse_config(path: &Path) -> Result<LighthouseConfig> {
    parse(&LIMIT.read_text(path)?, &path.display().to_string())
}

/// Reads the text of a configuration; `file` is its name in messages.
fn parse(yaml: &str, file: &str) -> Result<LighthouseConfig> {
    let config: File = serde_saphyr::from_str(yaml).map_err(|error| {
        let line = error.location().map_or(1, |place| place.line());
        let found = error.without_snippet().to_string().replace('\n', "; ");
        Error::input(format!("{file}:{line}"), found, "a Lighthouse configuration (YAML)", HINT)
    })?;
    let place = |line: u64, key: &str| format!("{file}:{line}: {key}");
    let kind = &config.kind;
    if kind.value != "lighthouse_system_configuration" {
        let at = place(kind.referenced.line(), "type");
        return Err(Error::input(at, &kind.value, "lighthouse_system_configuration", HINT));
    }
    if config.version.value != "1" {
        let at = place(config.version.referenced.line(), "version");
        return Err(Error::input(at, &config.version.value, "1", HINT));
    }
    let generation = match &config.system_type {
        Some(system) if system.value == 1 => Generation::V1,
        Some(system) if system.value != 2 => {
            let at = place(system.referenced.line(), "systemType");
            return Err(Error::input(at, system.value, "1 or 2", HINT));
        }
        _ => Generation::V2,
    };
    if config.geos.is_empty() {
        return Err(Error::input(file, "no base station under geos", "at least one", HINT));
    }
    let station = |(id, geometry): (&u8, &Geometry)| {
        let at = |line, key: &str| place(line, &format!("geos.{id}.{key}"));
        let (origin, rotation) = (&geometry.origin, &geometry.rotation);
        if !origin.value.iter().all(|x| x.abs() <= 1e4) {
            let at = at(origin.referenced.line(), "origin");
            return Err(Error::input(
                at,
                format!("{:?}", origin.value),
                "meters within ±1e4",
                HINT,
            ));
        }
        let r = Matrix3::from_row_iterator(rotation.value.into_iter().flatten());
        let off = (r * r.transpose() - Matrix3::identity()).abs().max();
        if !(off <= ROTATION_TOLERANCE && r.determinant() > 0.0) {
            let at = at(rotation.referenced.line(), "rotation");
            return Err(Error::input(at, format!("{:?}", rotation.value), "a rotation", HINT));
        }
        Ok(placed(generation, origin.value, &r))
    };
    let stations = config.geos.iter().map(station).collect::<Result<_>>()?;
    for (id, calibration) in &config.calibs {
        calibration.check(&place(calibration.sweeps.referenced.line(), &format!("calibs.{id}")))?;
    }
    Ok(LighthouseConfig { stations, warnings: warnings(&config) })
}

impl Calibration {
    fn check(&self, place: &str) -> Result<()> {
        for sweep in &self.sweeps.value {
            let Sweep { phase, tilt, curve, gibmag, gibphase, ogeemag, ogeephase } = *sweep;
            let figures = [phase, tilt, curve, gibmag, gibphase, ogeemag, ogeephase];
            let wild = |figure: &&f64| figure.is_nan() || figure.abs() > LARGEST_CALIBRATION;
            if let Some(figure) = figures.iter().find(wild) {
                let wanted = format!("figures within ±{LARGEST_CALIBRATION}");
                return Err(Error::input(place, figure, wanted, HINT));
            }
        }
        Ok(())
    }
}

fn warnings(config: &File) -> Vec<String> {
    let list = |ids: Vec<&u8>| ids.iter().map(|id| id.to_string()).collect::<Vec<_>>().join(", ");
    let calibrated: Vec<&u8> =
        config.calibs.keys().filter(|id| config.geos.contains_key(id)).collect();
    let homeless: Vec<&u8> =
        config.calibs.keys().filter(|id| !config.geos.contains_key(id)).collect();
    let mut warnings = Vec::new();
    if !calibrated.is_empty() {
        warnings.push(format!(
            "the factory calibration of base station {} has no effect: sweep angles are simulated \
             as they are after the firmware has undone it",
            list(calibrated)
        ));
    }
    if !homeless.is_empty() {
        warnings.push(format!(
            "base station {} is left out: its place is not known, only its calibration",
            list(homeless)
        ));
    }
    warnings
}

/// A station from its rotation matrix.
fn placed(
    generation: Generation,
    position_m: [f64; 3],
    world_from_station: &Matrix3<f64>,
) -> Station {
    let [forward, left, up]: [Vector3<f64>; 3] =
        [0, 1, 2].map(|axis| world_from_station.column(axis).into_owned());
    Station::facing(generation, position_m, &forward, libm::atan2(left.z, up.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::StationPose;

    /// Block style, as cflib writes it since 5.1 of its YAML library, with a line of flow style.
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
        let LighthouseConfig { stations, warnings } = parse(BLOCK, "lh.yaml").unwrap();
        assert_eq!((stations.len(), warnings.len()), (2, 1));
        assert!(warnings[0].contains("calibration of base station 0 has no"), "{warnings:?}");
        assert_eq!(stations[0].position_m[2], 3.152726888656616);
        let turned = StationPose::new(&stations[0]).world_from_station * Vector3::x();
        assert!((turned - Vector3::y()).norm() < 1e-15, "x becomes y");
        let pose = StationPose::new(&stations[1]).world_from_station;
        let want = Matrix3::new(0.8, 0.0, 0.6, 0.0, 1.0, 0.0, -0.6, 0.0, 0.8);
        assert!((pose - want).norm() < 1e-15, "{pose}");
        assert!(stations[1].pitch_rad > 0.6, "looks down");
        assert!(stations.iter().all(|s| s.generation == Generation::V2));
        let v1 = parse(&BLOCK.replace("systemType: 2", "systemType: 1"), "lh.yaml").unwrap();
        assert!(v1.stations.iter().all(|s| s.generation == Generation::V1));
        let homeless = parse(&BLOCK.replace("calibs:\n  0:", "calibs:\n  7:"), "lh.yaml").unwrap();
        assert!(homeless.warnings[0].contains("station 7 is left out"), "{homeless:?}");
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
            let again = StationPose::new(&placed(generation, position_m, &r)).world_from_station;
            assert!((again - r).norm() < 1e-13, "{station:?}");
        }
    }

    #[test]
    fn broken_files_are_named_by_line() {
        let cases = [
            (BLOCK.replace("lighthouse_system", "loco"), ":34: type", "loco_configuration"),
            (BLOCK.replace("'1'", "'2'"), ":35: version", "found 2"),
            (BLOCK.replace("systemType: 2", "systemType: 3"), ":33: systemType", "found 3"),
            (BLOCK.replace("- -1.9584829807281494", "- east"), ":16", "invalid floating point"),
            (BLOCK.replace("    - 3.152726888656616\n", ""), "lh.yaml:", "3"),
            (BLOCK.replace("- 0.5422989726066589", "- .nan"), ": geos.0.origin", "NaN"),
            (BLOCK.replace("[0.8, 0.0, 0.6]", "[0.9, 0.0, 0.6]"), ":32: geos.1.rotation", "0.9"),
            (BLOCK.replace("[0.0, 1.0, 0.0]", "[0.0, -1.0, 0.0]"), ":32: geos.1", "a rotation"),
            (BLOCK.replace("geos:", "geoz:"), "lh.yaml", "no base station"),
            (BLOCK.replace("systemType: 2", "systemType: [2"), "lh.yaml:", ""),
            (BLOCK.replace("gibmag: 0.006", "gibmag: much"), "lh.yaml:5", "floating point"),
            (BLOCK.replace("gibmag: 0.006", "gibmag: .nan"), "lh.yaml:4: calibs.0", "NaN"),
            (BLOCK.replace("tilt: 0.05", "tilt: 50"), "lh.yaml:4: calibs.0", "50"),
            (BLOCK.replace("      gibphase: 1.1\n", ""), "lh.yaml:", "gibphase"),
            (String::new(), "lh.yaml:1", ""),
            ("\u{0}\u{1}[{".to_owned(), "lh.yaml:1", ""),
        ];
        for (yaml, place, found) in cases {
            let error = parse(&yaml, "lh.yaml").unwrap_err();
            let message = error.to_string();
            assert!(message.contains(place) && message.contains(found), "{place}: {message}");
            assert!(!message.contains('\n') && !error.hint().is_empty(), "{message}");
        }
    }
}
